//! The requests of a page to a session. A name and a JSON body go in; JSON, SVG, HTML or a refusal comes out.
//!
//! Decision: the page sends a name and a JSON body and does not know whether a server or a worker answers. So there
//! is one page, and tests with a server are valid for both.

use std::sync::Arc;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::session::{KeepTrajectoryRequest, PictureRequest, WorkbenchSession};

/// A response to a page.
pub(crate) enum PageResponse {
    /// Data for the scripts of the page.
    Json(Value),
    /// A picture.
    Svg(String),
    /// A part of a page.
    Html(String),
}

/// Kind of a refusal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RequestFault {
    /// There is no request with this name.
    Unknown,
    /// The body does not fit the request.
    Malformed,
    /// The text was changed since the revision that the request refers to.
    Conflict,
    /// The request is valid but cannot be fulfilled.
    Refused,
}

impl RequestFault {
    /// The HTTP status code.
    pub(crate) fn status(self) -> u16 {
        match self {
            Self::Unknown => 404,
            Self::Malformed => 400,
            Self::Conflict => 409,
            Self::Refused => 422,
        }
    }
}

/// A refusal: its kind, and a sentence with the reason.
pub(crate) struct RequestRefusal(pub(crate) RequestFault, pub(crate) String);

impl From<String> for RequestRefusal {
    fn from(says: String) -> Self {
        Self(RequestFault::Refused, says)
    }
}

/// Body of `edit`.
#[derive(Deserialize)]
struct EditRequest {
    /// The revision that was edited.
    base: u64,
    /// The complete new text.
    text: String,
    /// Name of the step for the pane *Steps*, if the edit is a step.
    #[serde(default)]
    did: Option<String>,
}

/// Body of `save`.
#[derive(Default, Deserialize)]
struct SaveRequest {
    /// The revision that the page shows; without it the current text is saved.
    #[serde(default)]
    base: Option<u64>,
}

/// Body of `choose`, which resolves a conflict between two texts.
#[derive(Deserialize)]
struct ConflictRequest {
    /// Whether the text of the other program replaces that of the page.
    theirs: bool,
}

/// Body of `compare`.
#[derive(Deserialize)]
struct CompareRequest {
    /// Whether to search for the regions with the largest error.
    places: bool,
    /// Whether to read the recordings again.
    afresh: bool,
}

/// Body of `curves`.
#[derive(Deserialize)]
struct CurvesRequest {
    /// Whether to use identified values instead of those of the file.
    identified: bool,
}

/// Body of `variant`.
#[derive(Deserialize)]
struct VariantRequest {
    /// The model to compare with, by its name in `models`; none for the saved text.
    beside: Option<String>,
}

/// Body of `add`.
#[derive(Deserialize)]
struct AddEffectRequest {
    /// Index of the effect among the findings of the last diagnosis.
    entry: usize,
}

/// Answers a request to a session.
pub(crate) fn answer_request(
    session: &Arc<WorkbenchSession>,
    question: &str,
    body: &[u8],
) -> Result<PageResponse, RequestRefusal> {
    Ok(PageResponse::Json(match question {
        "view" => session.view(),
        "edit" => {
            let EditRequest { base, text, did } = parse_body(body)?;
            let view_json = session.edit(base, &text, did.as_deref());
            view_json.ok_or_else(refuse_outdated)?
        }
        "save" => {
            let SaveRequest { base } = parse_body(body)?;
            session.save(base)?.ok_or_else(refuse_outdated)?
        }
        "choose" => session.resolve_conflict(parse_body::<ConflictRequest>(body)?.theirs),
        "picture" => {
            return Ok(PageResponse::Svg(
                session.picture(&parse_body::<PictureRequest>(body)?)?,
            ));
        }
        "equations" => return Ok(PageResponse::Html(session.equations()?)),
        "compare" => {
            let CompareRequest { places, afresh } = parse_body(body)?;
            session.compare(places, afresh)?
        }
        "curves" => {
            let CurvesRequest { identified } = parse_body(body)?;
            return Ok(PageResponse::Html(session.curves(identified)?));
        }
        "motion" => session.motion()?,
        "models" => session.models(),
        "variant" => session.variant(parse_body::<VariantRequest>(body)?.beside.as_deref())?,
        "diagnosis" => session.diagnosis(),
        "diagnose" => session.diagnose()?,
        "cancel" => session.cancel(),
        "add" => session.add(parse_body::<AddEffectRequest>(body)?.entry)?,
        "words" => session.completions()?,
        "limits" => session.limits()?,
        "excite" => session.excite(parse_body(body)?)?,
        "excitation" => session.excitation(),
        "stop_excitation" => session.stop_excitation(),
        "trajectory" => session.trajectory()?,
        "keep_trajectory" => session.keep_trajectory(&parse_body::<KeepTrajectoryRequest>(body)?)?,
        other => {
            let says = format!("there is no request `{other}`");
            return Err(RequestRefusal(RequestFault::Unknown, says));
        }
    }))
}

/// The refusal of a request that refers to an earlier text.
fn refuse_outdated() -> RequestRefusal {
    let says = "the text was changed in another window";
    RequestRefusal(RequestFault::Conflict, says.to_owned())
}

/// Reads a JSON body; refuses one that does not fit the request.
pub(crate) fn parse_body<T: DeserializeOwned>(body: &[u8]) -> Result<T, RequestRefusal> {
    serde_json::from_slice(body).map_err(|error| RequestRefusal(RequestFault::Malformed, error.to_string()))
}
