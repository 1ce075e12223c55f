//! A folder of recordings as a table of summaries: one file is in memory for each partition.

use std::path::Path;
use std::sync::Arc;

use datafusion::arrow::array::{ArrayRef, BinaryArray, RecordBatch, StringArray};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::catalog::streaming::StreamingTable;
use datafusion::catalog::{TableFunctionImpl, TableProvider};
use datafusion::common::{DataFusionError, Result, ScalarValue, plan_err};
use datafusion::execution::{SendableRecordBatchStream, TaskContext};
use datafusion::logical_expr::Expr;
use datafusion::physical_plan::stream::RecordBatchStreamAdapter;
use datafusion::physical_plan::streaming::PartitionStream;
use futures::StreamExt;
use modelmill_fleet::Ground;
use modelmill_fleet::folder::{File, robots};

use crate::samples::external;

/// `modelmill_recordings('folder')`: `robot`, `day`, `recording`, `summary`, and `bad` with the reason where it gave no answer.
#[derive(Clone)]
pub struct Recordings {
    ground: Arc<Ground>,
}

impl Recordings {
    /// The function over a plan.
    pub fn new(ground: Arc<Ground>) -> Self {
        Self { ground }
    }
}

impl std::fmt::Debug for Recordings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("modelmill_recordings")
    }
}

impl TableFunctionImpl for Recordings {
    fn call(&self, arguments: &[Expr]) -> Result<Arc<dyn TableProvider>> {
        let [Expr::Literal(ScalarValue::Utf8(Some(folder)), _)] = arguments else {
            return plan_err!(
                "modelmill_recordings takes one text, the folder above those of the robots"
            );
        };
        let files: Vec<(String, File)> = robots(Path::new(folder))
            .map_err(external)?
            .into_iter()
            .flat_map(|(robot, files)| files.into_iter().map(move |file| (robot.clone(), file)))
            .collect();
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let each = files.len().div_ceil(cores).max(1);
        let schema = schema();
        let partitions = files.chunks(each).map(|files| {
            Arc::new(Part {
                ground: self.ground.clone(),
                schema: schema.clone(),
                files: files.to_vec(),
            }) as Arc<dyn PartitionStream>
        });
        Ok(Arc::new(StreamingTable::try_new(
            schema.clone(),
            partitions.collect(),
        )?))
    }
}

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

/// Some of the files.
struct Part {
    ground: Arc<Ground>,
    schema: SchemaRef,
    files: Vec<(String, File)>,
}

impl std::fmt::Debug for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} recordings", self.files.len())
    }
}

impl PartitionStream for Part {
    fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    fn execute(&self, _: Arc<TaskContext>) -> SendableRecordBatchStream {
        let (ground, schema) = (self.ground.clone(), self.schema.clone());
        let batches = futures::stream::iter(self.files.clone()).then(move |(robot, file)| {
            let (ground, schema) = (ground.clone(), schema.clone());
            async move {
                let read = tokio::task::spawn_blocking(move || one(&ground, schema, &robot, &file));
                read.await
                    .map_err(|error| DataFusionError::External(Box::new(error)))?
            }
        });
        Box::pin(RecordBatchStreamAdapter::new(self.schema.clone(), batches))
    }
}

fn one(ground: &Ground, schema: SchemaRef, robot: &str, file: &File) -> Result<RecordBatch> {
    let summary = ground.summarise_file(&file.name, &file.path);
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
