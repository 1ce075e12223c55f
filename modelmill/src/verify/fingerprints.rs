//! Fingerprints of the files of a verification: paths go in, their SHA-256 hashes come out.

use std::path::Path;

use crate::error::{Error, Outcome};
use crate::model::Model;

use super::digest::{hash_bytes, hash_file};

/// What a file is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FileRole {
    /// A model file, a file that it extends, or a library of effects.
    Model,
    /// A recording.
    Data,
    /// A fit with the values of the base parameters.
    Fit,
    /// The limits.
    Limits,
}

impl FileRole {
    /// Its name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Data => "data",
            Self::Fit => "fit",
            Self::Limits => "limits",
        }
    }
}

/// A file with the hash of its contents.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileFingerprint {
    /// What the file is used for.
    pub role: FileRole,
    /// Its path.
    pub file: String,
    /// SHA-256 of its contents, 64 hexadecimal digits; `None` for a pipe, which cannot be read again.
    pub sha256: Option<String>,
}

impl FileFingerprint {
    /// The fingerprints of the model's own files, then of other files.
    ///
    /// Fails when one of the other files cannot be read.
    pub fn all<'a>(model: &Model, others: impl IntoIterator<Item = (FileRole, &'a Path)>) -> Outcome<Vec<Self>> {
        // The text that was derived counts, even if the file has changed since.
        let own = model.loaded.sources.files.iter().map(|file| Self {
            role: FileRole::Model,
            file: file.path.display().to_string(),
            sha256: Some(hash_bytes(file.text.as_bytes())),
        });
        let mut all: Vec<Self> = own.collect();
        for (role, path) in others {
            let sha256 = hash_file(model.host().files(), path).map_err(|error| {
                let [fault, remedy] = [error.fault.to_string(), error.fault.remedy().to_string()];
                Error::input(format!("{} cannot be read: {fault}; {remedy}", path.display()))
            })?;
            let file = path.display().to_string();
            all.push(Self { role, file, sha256 });
        }
        Ok(all)
    }
}
