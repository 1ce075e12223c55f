//! The columns of a Parquet file: each leaf of its schema is a column of numbers, or a list with a column for each element.

use std::sync::Arc;

use parquet::basic::Repetition;
use parquet::column::reader::ColumnReader;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use crate::recording::error::RecordingFault;
use crate::recording::formats::lerobot::ElementNames;
use crate::recording::formats::parquet::{SharedChunkReader, check_pages, column_reader};
use crate::recording::formats::parquet_values::{ListShape, ParquetValueKind, longest_list};

/// Longest list that becomes columns; a longer one is an image or a cloud of points.
const MOST_ELEMENTS: usize = 256;
/// Samples at the start of a file that decide how long its lists are.
const DECIDING_SAMPLES: usize = 1024;
/// Endings of paths that only say that a column has lists, as different writers call them.
const LIST_ENDINGS: [&str; 6] = [
    ".list.element",
    ".list.item",
    ".bag.array_element",
    ".list.array",
    ".array",
    ".element",
];

/// A leaf of the schema with its columns.
pub(super) struct ParquetLeaf {
    /// Its name, without the parts that only say that it has lists.
    pub(super) name: String,
    /// Position of its first column.
    pub(super) first: usize,
    /// Number of its columns.
    pub(super) width: usize,
    /// Its lists, if it has lists.
    pub(super) list: Option<ListShape>,
    /// The meaning of its numbers.
    pub(super) kind: ParquetValueKind,
}

/// All columns of a file.
pub(super) struct ParquetColumns {
    /// The leaves, in the order of the schema.
    pub(super) leaves: Vec<ParquetLeaf>,
    /// Names of the columns.
    pub(super) names: Vec<String>,
}

impl ParquetColumns {
    /// Finds the columns of a file; `elements` has names for elements of lists.
    ///
    /// Fails when the first lists cannot be read.
    pub(super) fn new<R: ChunkReader + 'static>(
        bytes: &Arc<R>,
        reader: &SerializedFileReader<SharedChunkReader<R>>,
        elements: &ElementNames,
    ) -> Result<Self, RecordingFault> {
        let schema = reader.metadata().file_metadata().schema_descr_ptr();
        let mut columns = Self {
            leaves: Vec::new(),
            names: Vec::new(),
        };
        for i in 0..schema.num_columns() {
            let column = schema.column(i);
            let mut kind = ParquetValueKind::from_column(&column);
            let path = column.path().string();
            let mut list = None;
            if column.max_rep_level() == 1 && !matches!(kind, ParquetValueKind::Unusable) {
                list = list_shape(bytes, reader, i, &column)?;
                // A list without elements, or with very many, is no signal.
                if list.is_none() {
                    kind = ParquetValueKind::Unusable;
                }
            }
            let name = if list.is_some() {
                bare_name(&path).to_owned()
            } else {
                path
            };
            let first = columns.names.len();
            match list {
                None => columns.names.push(name.clone()),
                Some(ListShape { width, .. }) => match elements.names_of(&name, width) {
                    Some(own) => columns
                        .names
                        .extend(own.iter().map(|element| format!("{name}.{element}"))),
                    None => columns.names.extend((1..=width).map(|place| format!("{name}_{place}"))),
                },
            }
            columns.leaves.push(ParquetLeaf {
                name,
                first,
                width: columns.names.len() - first,
                list,
                kind,
            });
        }
        Ok(columns)
    }
}

/// The name of a column without the parts that only say that it has lists.
fn bare_name(path: &str) -> &str {
    LIST_ENDINGS
        .iter()
        .find_map(|ending| path.strip_suffix(ending))
        .unwrap_or(path)
}

/// The lists of a column by those at the start of the file; `None` if they cannot be columns.
fn list_shape<R: ChunkReader + 'static>(
    bytes: &Arc<R>,
    reader: &SerializedFileReader<SharedChunkReader<R>>,
    i: usize,
    column: &ColumnDescriptor,
) -> Result<Option<ListShape>, RecordingFault> {
    // The leaf must be the element itself; fields of messages in lists have further levels.
    let is_own_list = column.self_type().get_basic_info().repetition() == Repetition::REPEATED;
    let path = column.path().string();
    if reader.num_row_groups() == 0 || !is_own_list && bare_name(&path) == path {
        return Ok(None);
    }
    let value_level = column.max_def_level();
    let is_optional = column.self_type().get_basic_info().repetition() == Repetition::OPTIONAL;
    let element_level = value_level - i16::from(is_optional);
    let group = reader.get_row_group(0).map_err(super::parquet::parquet_fault)?;
    let mut wanted = vec![false; group.num_columns()];
    wanted[i] = true;
    check_pages(bytes.as_ref(), group.metadata(), &wanted)?;
    let descriptor = group.metadata().column(i).column_descr_ptr();
    let mut values: ColumnReader = column_reader(bytes, &*group, i, &descriptor)?;
    let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let width = longest_list(&mut values, rows.min(DECIDING_SAMPLES), element_level)?;
    Ok((1..=MOST_ELEMENTS).contains(&width).then_some(ListShape {
        width,
        element_level,
        value_level,
    }))
}
