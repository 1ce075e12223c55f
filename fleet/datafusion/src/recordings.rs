//! A table function that reads a folder of recordings as a table of summaries. The folder is on disk or in an object
//! store of the session. One file per partition is in memory.

use std::path::PathBuf;
use std::sync::Arc;

use async_trait::async_trait;
use datafusion::arrow::array::{ArrayRef, BinaryArray, RecordBatch, StringArray};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::catalog::streaming::StreamingTable;
use datafusion::catalog::{Session, TableFunctionArgs, TableFunctionImpl, TableProvider};
use datafusion::common::{DataFusionError, Result, ScalarValue, plan_err};
use datafusion::datasource::listing::ListingTableUrl;
use datafusion::execution::{SendableRecordBatchStream, TaskContext};
use datafusion::logical_expr::{Expr, TableType};
use datafusion::object_store::{ObjectMeta, ObjectStore, ObjectStoreExt, path::Path as Place};
use datafusion::physical_plan::ExecutionPlan;
use datafusion::physical_plan::stream::RecordBatchStreamAdapter;
use datafusion::physical_plan::streaming::PartitionStream;
use futures::{StreamExt, TryStreamExt};
use modelmill_fleet::folder::{FleetFile, FolderEntry, group_by_robot, robots};
use modelmill_fleet::{FleetModel, FleetSummary};

use crate::samples::external_error;

/// `modelmill_recordings('folder')`: `robot`, `day`, `recording`, `summary`, and `bad` with the reason if the recording
/// could not be evaluated. The folder is a path, or a URL such as `s3://bucket/folder` in a store of the session.
#[derive(Clone)]
pub struct RecordingsFunction {
    /// The plan with its derived model.
    ground: Arc<FleetModel>,
}

impl RecordingsFunction {
    /// The function over a plan.
    pub fn new(ground: Arc<FleetModel>) -> Self {
        Self { ground }
    }
}

impl std::fmt::Debug for RecordingsFunction {
    /// Shows the name of the function.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("modelmill_recordings")
    }
}

impl TableFunctionImpl for RecordingsFunction {
    /// The table of a folder; its files are not listed yet.
    fn call_with_args(&self, args: TableFunctionArgs<'_, '_>) -> Result<Arc<dyn TableProvider>> {
        let [Expr::Literal(ScalarValue::Utf8(Some(folder)) | ScalarValue::Utf8View(Some(folder)), _)] = args.exprs()
        else {
            return plan_err!(
                "modelmill_recordings needs one text argument: the folder that contains those of the robots"
            );
        };
        // A URL has a scheme, a path has none.
        let folder = if folder.contains("://") {
            RecordingsFolder::Stored(ListingTableUrl::parse(folder)?)
        } else {
            RecordingsFolder::Path(folder.into())
        };
        Ok(Arc::new(RecordingsTable {
            ground: self.ground.clone(),
            folder,
            schema: schema(),
        }))
    }
}

/// The folder of the recordings.
enum RecordingsFolder {
    /// A path on disk.
    Path(PathBuf),
    /// A URL in an object store.
    Stored(ListingTableUrl),
}

impl RecordingsFolder {
    /// The source of the files, and all recordings with their robots.
    async fn files(&self, session: &dyn Session) -> Result<(RecordingsSource, Vec<(String, FleetFile)>)> {
        let (source, robots) = match self {
            Self::Path(folder) => (RecordingsSource::Disk, robots(folder).map_err(external_error)?),
            Self::Stored(url) => {
                // All objects below the URL.
                let store = session.runtime_env().object_store(url)?;
                let above = url.prefix();
                let found: Vec<ObjectMeta> = store.list(Some(above)).try_collect().await?;
                let found = found.into_iter().map(|object| {
                    // The name of an object is its path below the folder.
                    let below = object.location.prefix_match(above);
                    let parts: Vec<_> = below
                        .into_iter()
                        .flatten()
                        .map(|part| part.as_ref().to_owned())
                        .collect();
                    FolderEntry {
                        name: parts.join("/"),
                        path: object.location.as_ref().into(),
                        version: format!("{} {}", object.size, object.last_modified.timestamp_micros()),
                    }
                });
                let robots = group_by_robot(url, found).map_err(external_error)?;
                (RecordingsSource::Store(store), robots)
            }
        };
        let files = robots
            .into_iter()
            .flat_map(|(robot, files)| files.into_iter().map(move |file| (robot.clone(), file)));
        Ok((source, files.collect()))
    }
}

/// The source of files.
#[derive(Clone)]
enum RecordingsSource {
    /// The disk of this computer.
    Disk,
    /// An object store.
    Store(Arc<dyn ObjectStore>),
}

impl RecordingsSource {
    /// The summary of a file. A fault of the recording is part of the summary; a store that does not answer is an
    /// error.
    async fn summary(&self, ground: Arc<FleetModel>, file: FleetFile) -> Result<FleetSummary> {
        // Objects of a store are read completely; files are opened by the library.
        let bytes = match self {
            Self::Disk => None,
            Self::Store(store) => {
                let place = Place::parse(file.path.to_string_lossy())?;
                Some(store.get(&place).await?.bytes().await?)
            }
        };
        // Computing takes long, so that it must not block the threads of the engine.
        let summed = tokio::task::spawn_blocking(move || match bytes {
            None => ground.summarise_file(&file.name, &file.path),
            Some(bytes) => ground.summarise_bytes(&file.name, bytes.into()),
        });
        summed.await.map_err(|error| DataFusionError::External(Box::new(error)))
    }
}

/// The table. Files are listed when it is scanned, because a store is only accessible then.
struct RecordingsTable {
    /// The plan with its derived model.
    ground: Arc<FleetModel>,
    /// The folder of the recordings.
    folder: RecordingsFolder,
    /// Columns of the table.
    schema: SchemaRef,
}

impl std::fmt::Debug for RecordingsTable {
    /// Shows the folder.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.folder {
            RecordingsFolder::Path(folder) => write!(f, "recordings below {}", folder.display()),
            RecordingsFolder::Stored(url) => write!(f, "recordings below {url}"),
        }
    }
}

#[async_trait]
impl TableProvider for RecordingsTable {
    fn schema(&self) -> SchemaRef {
        self.schema.clone()
    }

    /// It is computed and has no data of its own.
    fn table_type(&self) -> TableType {
        TableType::View
    }

    /// Lists the files and distributes them over partitions.
    async fn scan(
        &self,
        session: &dyn Session,
        projection: Option<&Vec<usize>>,
        filters: &[Expr],
        limit: Option<usize>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let (source, files) = self.folder.files(session).await?;
        // One partition per core, with about the same number of files.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let each = files.len().div_ceil(cores).max(1);
        let partitions = files.chunks(each).map(|files| {
            Arc::new(RecordingsPartition {
                ground: self.ground.clone(),
                schema: self.schema.clone(),
                source: source.clone(),
                files: files.to_vec(),
            }) as Arc<dyn PartitionStream>
        });
        let streamed = StreamingTable::try_new(self.schema.clone(), partitions.collect())?;
        streamed.scan(session, projection, filters, limit).await
    }
}

/// Columns of the table.
fn schema() -> SchemaRef {
    let text = |name: &str, nullable: bool| Field::new(name, DataType::Utf8, nullable);
    Arc::new(Schema::new(vec![
        text("robot", false),
        text("day", false),
        text("recording", false),
        Field::new("summary", DataType::Binary, false),
        text("bad", true),
    ]))
}

/// A partition of the table: some of the files.
struct RecordingsPartition {
    /// The plan with its derived model.
    ground: Arc<FleetModel>,
    /// Columns of the table.
    schema: SchemaRef,
    /// The source of the files.
    source: RecordingsSource,
    /// Robots with their files.
    files: Vec<(String, FleetFile)>,
}

impl std::fmt::Debug for RecordingsPartition {
    /// Shows the number of files.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} recordings", self.files.len())
    }
}

impl PartitionStream for RecordingsPartition {
    fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    /// One batch with one row per file, read when it is requested.
    fn execute(&self, _: Arc<TaskContext>) -> SendableRecordBatchStream {
        let (ground, schema, source) = (self.ground.clone(), self.schema.clone(), self.source.clone());
        let batches = futures::stream::iter(self.files.clone()).then(move |(robot, file)| {
            let (ground, schema, source) = (ground.clone(), schema.clone(), source.clone());
            async move {
                let summary = source.summary(ground, file.clone()).await?;
                summary_row(schema, &robot, &file, &summary)
            }
        });
        Box::pin(RecordBatchStreamAdapter::new(self.schema.clone(), batches))
    }
}

/// The row of one recording.
fn summary_row(schema: SchemaRef, robot: &str, file: &FleetFile, summary: &FleetSummary) -> Result<RecordBatch> {
    let text = |text: &str| Arc::new(StringArray::from(vec![text])) as ArrayRef;
    let bad = summary.bad.first().map(|bad| bad.says.as_str());
    let columns: Vec<ArrayRef> = vec![
        text(robot),
        text(&file.day),
        text(&file.name),
        Arc::new(BinaryArray::from_vec(vec![&summary.bytes()])),
        Arc::new(StringArray::from(vec![bad])),
    ];
    Ok(RecordBatch::try_new(schema, columns)?)
}
