//! What a page may ask of a sitting, by name and with a body of JSON, wherever the sitting takes place.
//!
//! Decision: the page sends a name and a JSON body and does not know whether a server or a worker answers. So there
//! is one page, and what is tested on a server holds for both.

use std::sync::Arc;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::sitting::{KeepTrajectoryRequest, PictureRequest, WorkbenchSession};

/// What a page gets.
pub(crate) enum PageResponse {
    Json(Value),
    Svg(String),
    Html(String),
}

/// Why it gets none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RequestFault {
    /// Nothing of that name can be asked.
    Unknown,
    /// The body is none of this question.
    Malformed,
    /// The text was changed meanwhile.
    Conflict,
    /// It cannot be done.
    Refused,
}

impl RequestFault {
    /// As HTTP counts it.
    pub(crate) fn status(self) -> u16 {
        match self {
            Self::Unknown => 404,
            Self::Malformed => 400,
            Self::Conflict => 409,
            Self::Refused => 422,
        }
    }
}

/// No answer, with a sentence that says why.
pub(crate) struct RequestRefusal(pub(crate) RequestFault, pub(crate) String);

impl From<String> for RequestRefusal {
    fn from(says: String) -> Self {
        Self(RequestFault::Refused, says)
    }
}

#[derive(Deserialize)]
struct EditRequest {
    /// The revision that the text was made of.
    base: u64,
    text: String,
    /// What it does, in words.
    #[serde(default)]
    did: Option<String>,
}

#[derive(Deserialize)]
struct ConflictRequest {
    theirs: bool,
}

#[derive(Deserialize)]
struct CompareRequest {
    /// Whether to look where the error lives.
    places: bool,
    /// Whether to read the recordings again.
    afresh: bool,
}

#[derive(Deserialize)]
struct CurvesRequest {
    /// With identified values rather than those of the file.
    identified: bool,
}

#[derive(Deserialize)]
struct VariantRequest {
    /// The model that is held beside the text, as `models` names it; the text as it was saved if there is none.
    beside: Option<String>,
}

#[derive(Deserialize)]
struct AddEffectRequest {
    entry: usize,
}

/// Answers a question about a sitting.
pub(crate) fn answer_request(
    sitting: &Arc<WorkbenchSession>,
    question: &str,
    body: &[u8],
) -> Result<PageResponse, RequestRefusal> {
    Ok(PageResponse::Json(match question {
        "view" => sitting.view(),
        "edit" => {
            let EditRequest { base, text, did } = parse_body(body)?;
            let told = sitting.edit(base, &text, did.as_deref());
            told.ok_or_else(|| {
                let says = "the text was changed elsewhere meanwhile";
                RequestRefusal(RequestFault::Conflict, says.to_owned())
            })?
        }
        "save" => sitting.save()?,
        "choose" => sitting.resolve_conflict(parse_body::<ConflictRequest>(body)?.theirs),
        "picture" => {
            return Ok(PageResponse::Svg(
                sitting.picture(&parse_body::<PictureRequest>(body)?)?,
            ));
        }
        "equations" => return Ok(PageResponse::Html(sitting.equations()?)),
        "compare" => {
            let CompareRequest { places, afresh } = parse_body(body)?;
            sitting.compare(places, afresh)?
        }
        "curves" => {
            let CurvesRequest { identified } = parse_body(body)?;
            return Ok(PageResponse::Html(sitting.curves(identified)?));
        }
        "motion" => sitting.motion()?,
        "models" => sitting.models(),
        "variant" => sitting.variant(parse_body::<VariantRequest>(body)?.beside.as_deref())?,
        "diagnosis" => sitting.diagnosis(),
        "diagnose" => sitting.diagnose()?,
        "cancel" => sitting.cancel(),
        "add" => sitting.add(parse_body::<AddEffectRequest>(body)?.entry)?,
        "words" => sitting.completions()?,
        "limits" => sitting.limits()?,
        "excite" => sitting.excite(parse_body(body)?)?,
        "excitation" => sitting.excitation(),
        "stop_excitation" => sitting.stop_excitation(),
        "trajectory" => sitting.trajectory()?,
        "keep_trajectory" => {
            sitting.keep_trajectory(&parse_body::<KeepTrajectoryRequest>(body)?)?
        }
        other => {
            let says = format!("nothing called `{other}` can be asked");
            return Err(RequestRefusal(RequestFault::Unknown, says));
        }
    }))
}

/// A body of JSON.
pub(crate) fn parse_body<T: DeserializeOwned>(body: &[u8]) -> Result<T, RequestRefusal> {
    serde_json::from_slice(body)
        .map_err(|error| RequestRefusal(RequestFault::Malformed, error.to_string()))
}
