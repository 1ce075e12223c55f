//! `recordings`: lists the contents of recordings, before a model is compared with them.

use std::path::Path;

use modelmill_identify::RecordingFile;

use crate::error::{Error, Outcome};
use crate::host::{Host, kinds_of_files};

pub use modelmill_identify::{ColumnInfo, TableInfo};

/// Contents of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingContents {
    /// Name of the file in messages.
    pub file: String,
    /// Its tables, or the topics of a log.
    pub tables: Vec<TableInfo>,
}

impl Host {
    /// Lists the tables and topics of a recording with their columns, samples and rates.
    ///
    /// Fails when the file cannot be read.
    pub fn recordings(&self, path: impl AsRef<Path>) -> Outcome<RecordingContents> {
        // A model, rig or fit file is named as such, since it is often given by mistake.
        if let Some(kind) = kinds_of_files::file_kind(self, path.as_ref()) {
            let path = path.as_ref().display();
            return Err(Error::input(format!("{path} is {kind}; a recording is expected")));
        }
        let file = RecordingFile::open(self.files(), path.as_ref())?;
        let tables = self.run_job(&format!("reading {}", file.name()), 0, |_| file.tables())??;
        Ok(RecordingContents {
            file: file.name().to_owned(),
            tables,
        })
    }
}
