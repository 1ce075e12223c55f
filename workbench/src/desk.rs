//! A desk: a sitting in memory, for a page that has the mill in itself. Files are put on it, then it is asked as the server is.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill::diagnose::SeparationProposal;
use modelmill::edit::NewEffect;
use modelmill::print::{CommandName, LibrarySpelling, OptionSetting, RemedySpelling, StepSpelling};
use modelmill::{Host, Model};
use serde::Deserialize;
use serde_json::json;

use crate::answers::{PageResponse, RequestRefusal, answer_request, parse_body};
use crate::options::{ExcitationSettings, Options, WorkbenchCommands, WorkbenchStep};
use crate::shelf::MemoryStore;
use crate::sitting::WorkbenchSession;

/// A sitting in memory, and the files for the next one.
pub struct RequestHandler {
    shelf: MemoryStore,
    sitting: Option<Arc<WorkbenchSession>>,
}

/// What a page opens.
#[derive(Deserialize)]
struct OpenRequest {
    model: PathBuf,
    #[serde(default)]
    data: Vec<PathBuf>,
    #[serde(default)]
    check: Vec<PathBuf>,
    /// What counts begin with.
    #[serde(default)]
    first: u64,
}

impl RequestHandler {
    /// An empty desk. `seconds` is its clock, and `goes_on` gets JSON that says how far long work is (`what`, `done`, `total`).
    pub fn new(seconds: fn() -> f64, goes_on: fn(&serde_json::Value)) -> Self {
        Self {
            shelf: MemoryStore::new(seconds, goes_on),
            sitting: None,
        }
    }

    /// Puts a file there, in the place of one of that name.
    pub fn add_file(&mut self, name: &str, bytes: &[u8]) {
        self.shelf.insert_file(Path::new(name), bytes);
    }

    /// Answers a question: JSON with the `status` that a server would give, and what is `told`. `open` (`model`, `data`,
    /// `check`: names of files) begins a sitting, all other questions are the server's.
    pub fn answer_request(&mut self, question: &str, body: &[u8]) -> String {
        let found = if question == "open" {
            self.open_session(body)
        } else {
            match &self.sitting {
                Some(sitting) => answer_request(sitting, question, body),
                None => Err("no model is open".to_owned().into()),
            }
        };
        let (status, told) = match found {
            Ok(PageResponse::Json(told)) => (200, told),
            Ok(PageResponse::Svg(told) | PageResponse::Html(told)) => (200, json!(told)),
            Err(RequestRefusal(fault, says)) => (fault.status(), json!({ "says": says })),
        };
        json!({ "status": status, "told": told }).to_string()
    }

    fn open_session(&mut self, body: &[u8]) -> Result<PageResponse, RequestRefusal> {
        let asked: OpenRequest = parse_body(body)?;
        let alone = |files: Vec<PathBuf>| files.into_iter().map(|file| vec![file]).collect();
        let options = Options {
            model: asked.model,
            data: alone(asked.data),
            check: alone(asked.check),
            first: asked.first,
            ..Options::default()
        };
        let shelf = Arc::new(self.shelf.clone());
        let opened = WorkbenchSession::open(&Host::new(), options, Arc::new(PageSpelling), shelf);
        let sitting = Arc::new(opened.map_err(|error| error.to_string())?);
        let told = sitting.view();
        self.sitting = Some(sitting);
        Ok(PageResponse::Json(told))
    }
}

/// PlainAdvice for a page without a command line: panes of the workbench where one does it, else the library's.
struct PageSpelling;

impl RemedySpelling for PageSpelling {
    fn spell_options(&self, settings: &[OptionSetting]) -> String {
        LibrarySpelling.spell_options(settings)
    }

    fn spell_command(&self, command: CommandName) -> String {
        match command {
            CommandName::Check => "pane `Mechanism`".to_owned(),
            CommandName::Diagnose => "pane `Diagnosis`".to_owned(),
            CommandName::Excite => "pane `ExcitationSettings`".to_owned(),
            CommandName::Adopt | CommandName::Evaluate | CommandName::Identify => {
                LibrarySpelling.spell_command(command)
            }
        }
    }
}

impl StepSpelling for PageSpelling {
    fn spell_effect(&self, model: &Model, effect: &NewEffect) -> String {
        LibrarySpelling.spell_effect(model, effect)
    }

    fn spell_identification(&self, model: &Model) -> String {
        LibrarySpelling.spell_identification(model)
    }

    fn spell_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
        LibrarySpelling.spell_separation(model, separation)
    }
}

impl WorkbenchCommands for PageSpelling {
    fn step_command(&self, _: WorkbenchStep) -> Option<String> {
        None
    }

    fn variant_command(&self, _: &Path) -> Option<String> {
        None
    }

    fn excite_command(&self, _: &ExcitationSettings) -> Option<String> {
        None
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    fn told(answer: &str) -> (u64, Value) {
        let mut answer: Value = serde_json::from_str(answer).unwrap();
        let told = answer["told"].take();
        (answer["status"].as_u64().unwrap(), told)
    }

    #[test]
    fn a_desk_answers_as_the_server_does() {
        let mut desk = RequestHandler::new(|| 0.0, |_| {});
        assert_eq!(told(&desk.answer_request("view", b"")).0, 422);
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../model-spec/models/");
        for name in ["delta.toml", "delta_tied.toml"] {
            desk.add_file(name, &std::fs::read(format!("{folder}{name}")).unwrap());
        }
        let (status, view) =
            told(&desk.answer_request("open", br#"{ "model": "delta_tied.toml", "first": 40 }"#));
        assert_eq!((status, &view["valid"]), (200, &json!(true)), "{view}");
        assert_eq!(
            (&view["revision"], &view["version"]),
            (&json!(41), &json!(41))
        );
        let edit = |base: u64, text: &str| json!({ "base": base, "text": text }).to_string();
        let (status, fault) = told(&desk.answer_request("edit", edit(41, "schema = [").as_bytes()));
        assert_eq!((status, &fault["valid"]), (200, &json!(false)));
        assert_eq!(fault["diagnostics"][0]["line"], 1, "{fault}");
        // Beside the file as saved, and beside a model that is there.
        let text = view["text"].as_str().unwrap();
        let saved = desk.answer_request("edit", edit(42, text).as_bytes());
        assert_eq!(told(&saved).1["valid"], true, "{saved}");
        let (_, models) = told(&desk.answer_request("models", b"{}"));
        assert_eq!(models, json!({ "models": ["delta.toml"], "named": null }));
        for beside in [json!(null), json!("delta.toml")] {
            let body = json!({ "beside": beside }).to_string();
            let (status, variant) = told(&desk.answer_request("variant", body.as_bytes()));
            assert_eq!((status, &variant["same"]), (200, &json!(beside.is_null())));
            assert_eq!(variant["along"], json!(null), "there is no recording");
        }
        // Made of a text that is no longer there, or of nothing.
        assert_eq!(
            told(&desk.answer_request("edit", edit(41, "").as_bytes())).0,
            409
        );
        assert_eq!(told(&desk.answer_request("edit", b"{}")).0, 400);
        assert_eq!(told(&desk.answer_request("compile", b"{}")).0, 404);
        assert_eq!(
            told(&desk.answer_request("open", br#"{ "model": "none.toml" }"#)).0,
            422
        );
    }
}
