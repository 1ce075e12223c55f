//! `import`: a robot description of other programs as the start of a model file.

use std::path::Path;

use modelmill_identify::RecordingNote;

pub use modelmill_reduction::{ImportOptions as Options, ImportedJoint};

use crate::error::{Error, Outcome};
use crate::host::Host;

/// No robot description, and no file that it includes, is longer, bytes.
const LARGEST_DESCRIPTION: u64 = modelmill_reduction::LARGEST_DESCRIPTION as u64;

/// A model file that was made of a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedRobot {
    /// The text of the model file.
    pub model: String,
    /// Joints of the description that move, with the coordinates of the model.
    pub joints: Vec<ImportedJoint>,
    /// What was left out or rounded.
    pub notes: Vec<RecordingNote>,
}

impl Host {
    /// Makes a model file of the text of a URDF, MJCF or SDF: links behind fixed joints join the body that carries them, every
    /// body gets its ten linear parameters. `name` is what messages call the file; where it is a path, files that an MJCF
    /// includes are read beside it.
    ///
    /// Fails when the text is none of these formats, or describes what a model file cannot.
    pub fn import(&self, name: &str, text: &str, options: &Options) -> Outcome<ImportedRobot> {
        let read = |file: &str| {
            let path = Path::new(name).with_file_name(file);
            let text = self.files().read_text(&path, LARGEST_DESCRIPTION);
            text.map_err(|error| format!("{} cannot be read: {}", path.display(), error.fault))
        };
        let text = modelmill_reduction::expand_includes(text, &read)
            .map_err(|fault| Error::input(format!("{name}: {fault}")))?;
        let imported = modelmill_reduction::import(&text, options)
            .map_err(|error| Error::input(format!("{name}: {error}")))?;
        let notes: Vec<RecordingNote> = imported
            .remarks
            .into_iter()
            .map(RecordingNote::warning)
            .collect();
        for note in &notes {
            self.note(note);
        }
        Ok(ImportedRobot {
            joints: imported.joints,
            model: imported.model,
            notes,
        })
    }
}
