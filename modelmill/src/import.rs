//! `import`: converts a robot description (URDF, MJCF, SDF) to a first model file.

use std::path::Path;

use modelmill_identify::RecordingNote;

pub use modelmill_reduction::{ImportOptions as Options, ImportedJoint, MeshFiles};

use crate::error::{Error, Outcome};
use crate::host::Host;

/// Largest size of a robot description and of each file that it includes, bytes.
const LARGEST_DESCRIPTION: u64 = modelmill_reduction::LARGEST_DESCRIPTION as u64;

/// A model file made from a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedRobot {
    /// The text of the model file.
    pub model: String,
    /// Movable joints of the description, with the coordinates of the model.
    pub joints: Vec<ImportedJoint>,
    /// Notes on what was left out or rounded.
    pub notes: Vec<RecordingNote>,
}

impl Host {
    /// Makes a model file from the text of a URDF, MJCF or SDF. Links behind fixed joints are merged with the body
    /// that carries them, and every body gets its ten linear parameters. `name` is the name of the file in messages;
    /// if it is a path, files that an MJCF includes or attaches and files of its meshes are read from the same folder.
    ///
    /// Fails when the text is none of these formats, or describes something that a model file cannot express.
    ///
    /// ```no_run
    /// use modelmill::Host;
    /// use modelmill::import::Options;
    ///
    /// let text = std::fs::read_to_string("arm.urdf").unwrap();
    /// let imported = Host::new().import("arm.urdf", &text, &Options::default())?;
    /// std::fs::write("arm.toml", imported.model).unwrap();
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn import(&self, name: &str, text: &str, options: &Options) -> Outcome<ImportedRobot> {
        // Included files are read relative to the description, through the host's file source.
        let read = |file: &str| {
            let path = Path::new(name).with_file_name(file);
            let text = self.files().read_text(&path, LARGEST_DESCRIPTION);
            text.map_err(|error| format!("{} cannot be read: {}", path.display(), error.fault))
        };
        let read_mesh = |file: &str| self.read_mesh(Path::new(name), file);
        let options = Options {
            meshes: options.meshes.or(Some(MeshFiles(&read_mesh))),
            ..*options
        };
        let imported = self.run_job(&format!("importing {name}"), 0, |_| {
            let text = modelmill_reduction::expand_other_files(text, &read)?;
            modelmill_reduction::import(&text, &options).map_err(|error| error.to_string())
        })?;
        let imported = imported.map_err(|fault| Error::input(format!("{name}: {fault}")))?;
        let facts = imported.facts.into_iter().map(RecordingNote::info);
        let notes: Vec<RecordingNote> = (imported.remarks.into_iter().map(RecordingNote::warning))
            .chain(facts)
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

    /// The bytes of a mesh file, whose name is relative to the folder of the description; fails with a sentence.
    pub(crate) fn read_mesh(&self, description: &Path, file: &str) -> Result<Vec<u8>, String> {
        let path = description.with_file_name(file);
        let bytes = self.files().read(&path, modelmill_reduction::LARGEST_MESH);
        bytes.map_err(|error| format!("{} cannot be read: {}", path.display(), error.fault))
    }
}
