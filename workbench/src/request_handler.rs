//! The request handler of a session in memory, for a page that contains the program as WebAssembly. Files are added
//! first; then it answers the same requests as the server.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill::diagnose::SeparationProposal;
use modelmill::edit::NewEffect;
use modelmill::print::{CommandName, OptionSetting, RemedyWording, RustWording, StepWording};
use modelmill::{Host, Model};
use serde::Deserialize;
use serde_json::json;

use crate::answers::{PageResponse, RequestRefusal, answer_request, parse_body};
use crate::memory_store::MemoryStore;
use crate::options::{ExcitationSettings, Options, WorkbenchCommands, WorkbenchStep};
use crate::session::WorkbenchSession;

/// A session in memory, and the files for the next one.
pub struct RequestHandler {
    /// Files, clock and progress.
    memory_store: MemoryStore,
    /// The open session, if any.
    session: Option<Arc<WorkbenchSession>>,
}

/// Body of the request `open`: names of files that were added before.
#[derive(Deserialize)]
struct OpenRequest {
    /// Model file.
    model: PathBuf,
    /// Recordings for the fit.
    #[serde(default)]
    data: Vec<PathBuf>,
    /// Recordings for validation.
    #[serde(default)]
    check: Vec<PathBuf>,
    /// First value of revisions and versions, see [`Options::first`].
    #[serde(default)]
    first: u64,
}

impl RequestHandler {
    /// A handler without files. `seconds` is its clock, and `goes_on` gets the progress of long work as JSON (`what`,
    /// `done`, `total`).
    pub fn new(seconds: fn() -> f64, goes_on: fn(&serde_json::Value)) -> Self {
        Self {
            memory_store: MemoryStore::new(seconds, goes_on),
            session: None,
        }
    }

    /// Adds a file, or replaces the file with this name.
    pub fn add_file(&mut self, name: &str, bytes: &[u8]) {
        self.memory_store.insert_file(Path::new(name), bytes);
    }

    /// Answers a request: JSON with the HTTP `status` of the server, and the response under `told`. `open` (`model`,
    /// `data`, `check`: names of files) starts a session; all other requests are those of the server.
    pub fn answer_request(&mut self, question: &str, body: &[u8]) -> String {
        let found = if question == "open" {
            self.open_session(body)
        } else {
            match &self.session {
                Some(session) => answer_request(session, question, body),
                None => Err("no model is open".to_owned().into()),
            }
        };
        let (status, response) = match found {
            Ok(PageResponse::Json(response)) => (200, response),
            Ok(PageResponse::Svg(response) | PageResponse::Html(response)) => (200, json!(response)),
            Err(RequestRefusal(fault, says)) => (fault.status(), json!({ "says": says })),
        };
        json!({ "status": status, "told": response }).to_string()
    }

    /// Opens a session on the files that were added; each recording is one file.
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
        let memory_store = Arc::new(self.memory_store.clone());
        let opened = WorkbenchSession::open(&Host::new(), options, Arc::new(PageWording), memory_store);
        let session = Arc::new(opened.map_err(|error| error.to_string())?);
        let response = session.view();
        self.session = Some(session);
        Ok(PageResponse::Json(response))
    }
}

/// Wording of advice for a page without a command line: names of panes if a pane does it, else calls of the library.
struct PageWording;

impl RemedyWording for PageWording {
    fn format_options(&self, settings: &[OptionSetting]) -> String {
        RustWording.format_options(settings)
    }

    fn format_command(&self, command: CommandName) -> String {
        match command {
            CommandName::Check => "pane `Mechanism`".to_owned(),
            CommandName::Diagnose => "pane `Diagnosis`".to_owned(),
            CommandName::Excite => "pane `Excitation`".to_owned(),
            CommandName::Adopt | CommandName::Evaluate | CommandName::Identify => RustWording.format_command(command),
        }
    }
}

impl StepWording for PageWording {
    fn format_effect(&self, model: &Model, effect: &NewEffect) -> String {
        RustWording.format_effect(model, effect)
    }

    fn format_completion(&self) -> String {
        RustWording.format_completion()
    }

    fn format_identification(&self, model: &Model) -> String {
        RustWording.format_identification(model)
    }

    fn format_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
        RustWording.format_separation(model, separation)
    }
}

impl WorkbenchCommands for PageWording {
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

    fn response(answer: &str) -> (u64, Value) {
        let mut answer: Value = serde_json::from_str(answer).unwrap();
        let response = answer["told"].take();
        (answer["status"].as_u64().unwrap(), response)
    }

    #[test]
    fn a_desk_answers_as_the_server_does() {
        let mut request_handler = RequestHandler::new(|| 0.0, |_| {});
        assert_eq!(response(&request_handler.answer_request("view", b"")).0, 422);
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../model-spec/models/");
        for name in ["delta.toml", "delta_tied.toml"] {
            request_handler.add_file(name, &std::fs::read(format!("{folder}{name}")).unwrap());
        }
        let (status, view) =
            response(&request_handler.answer_request("open", br#"{ "model": "delta_tied.toml", "first": 40 }"#));
        assert_eq!((status, &view["valid"]), (200, &json!(true)), "{view}");
        assert_eq!((&view["revision"], &view["version"]), (&json!(41), &json!(41)));
        let edit = |base: u64, text: &str| json!({ "base": base, "text": text }).to_string();
        let (status, fault) = response(&request_handler.answer_request("edit", edit(41, "schema = [").as_bytes()));
        assert_eq!((status, &fault["valid"]), (200, &json!(false)));
        assert_eq!(fault["diagnostics"][0]["line"], 1, "{fault}");
        // Compared with the saved file, and with another model of the folder.
        let text = view["text"].as_str().unwrap();
        let saved = request_handler.answer_request("edit", edit(42, text).as_bytes());
        assert_eq!(response(&saved).1["valid"], true, "{saved}");
        let (_, models) = response(&request_handler.answer_request("models", b"{}"));
        assert_eq!(models, json!({ "models": ["delta.toml"], "named": null }));
        for beside in [json!(null), json!("delta.toml")] {
            let body = json!({ "beside": beside }).to_string();
            let (status, variant) = response(&request_handler.answer_request("variant", body.as_bytes()));
            assert_eq!((status, &variant["same"]), (200, &json!(beside.is_null())));
            assert_eq!(variant["along"], json!(null), "there is no recording");
        }
        // Made of a text that is no longer there, or of nothing.
        assert_eq!(
            response(&request_handler.answer_request("edit", edit(41, "").as_bytes())).0,
            409
        );
        assert_eq!(response(&request_handler.answer_request("edit", b"{}")).0, 400);
        assert_eq!(response(&request_handler.answer_request("compile", b"{}")).0, 404);
        assert_eq!(
            response(&request_handler.answer_request("open", br#"{ "model": "none.toml" }"#)).0,
            422
        );
    }
}
