//! `import`: a robot description of other programs as the start of a model file.

use modelmill_identify::Note;

use crate::error::{Error, Outcome};
use crate::host::Host;

/// A model file that was made of a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The text of the model file.
    pub model: String,
    /// How many joints move.
    pub joints: usize,
    /// What was left out or rounded.
    pub notes: Vec<Note>,
}

impl Host {
    /// Makes a model file of a URDF's text: links behind fixed joints join the body that carries them, every body gets its
    /// ten linear parameters, gravity is along -z. `name` is what messages call the file.
    ///
    /// Fails when the text is no URDF, or describes what a model file cannot.
    pub fn import(&self, name: &str, text: &str) -> Outcome<Imported> {
        let imported = modelmill_reduction::import_urdf(text)
            .map_err(|error| Error::input(format!("{name}: {error}")))?;
        let notes: Vec<Note> = imported.remarks.into_iter().map(Note::warning).collect();
        for note in &notes {
            self.note(note);
        }
        Ok(Imported {
            joints: imported.model.matches("[[frame]]").count(),
            model: imported.model,
            notes,
        })
    }
}
