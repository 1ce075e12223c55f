//! What a page may ask of a sitting, by name and with a body of JSON, wherever the sitting takes place.
//!
//! Decision: the page sends a name and a JSON body and does not know whether a server or a worker answers. So there
//! is one page, and what is tested on a server holds for both.

use std::sync::Arc;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::sitting::{Keeping, Seeing, Sitting};

/// What a page gets.
pub(crate) enum Answer {
    Json(Value),
    Svg(String),
    Html(String),
}

/// Why it gets none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// Nothing of that name can be asked.
    Unknown,
    /// The body is none of this question.
    Malformed,
    /// The text was changed meanwhile.
    Conflict,
    /// It cannot be done.
    Refused,
}

impl Fault {
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
pub(crate) struct Refusal(pub(crate) Fault, pub(crate) String);

impl From<String> for Refusal {
    fn from(says: String) -> Self {
        Self(Fault::Refused, says)
    }
}

#[derive(Deserialize)]
struct Edit {
    /// The revision that the text was made of.
    base: u64,
    text: String,
    /// What it does, in words.
    #[serde(default)]
    did: Option<String>,
}

#[derive(Deserialize)]
struct Choice {
    theirs: bool,
}

#[derive(Deserialize)]
struct Comparing {
    /// Whether to look where the error lives.
    places: bool,
    /// Whether to read the recordings again.
    afresh: bool,
}

#[derive(Deserialize)]
struct Curves {
    /// With identified values rather than those of the file.
    identified: bool,
}

#[derive(Deserialize)]
struct Variant {
    /// The model that is held beside the text, as `models` names it; the text as it was saved if there is none.
    beside: Option<String>,
}

#[derive(Deserialize)]
struct Add {
    entry: usize,
}

/// Answers a question about a sitting.
pub(crate) fn answer(
    sitting: &Arc<Sitting>,
    question: &str,
    body: &[u8],
) -> Result<Answer, Refusal> {
    Ok(Answer::Json(match question {
        "view" => sitting.view(),
        "edit" => {
            let Edit { base, text, did } = read(body)?;
            let told = sitting.edit(base, &text, did.as_deref());
            told.ok_or_else(|| {
                let says = "the text was changed elsewhere meanwhile";
                Refusal(Fault::Conflict, says.to_owned())
            })?
        }
        "save" => sitting.save()?,
        "choose" => sitting.choose(read::<Choice>(body)?.theirs),
        "picture" => return Ok(Answer::Svg(sitting.picture(&read::<Seeing>(body)?)?)),
        "equations" => return Ok(Answer::Html(sitting.equations()?)),
        "compare" => {
            let Comparing { places, afresh } = read(body)?;
            sitting.compare(places, afresh)?
        }
        "curves" => {
            let Curves { identified } = read(body)?;
            return Ok(Answer::Html(sitting.curves(identified)?));
        }
        "motion" => sitting.motion()?,
        "models" => sitting.models(),
        "variant" => sitting.variant(read::<Variant>(body)?.beside.as_deref())?,
        "diagnosis" => sitting.diagnosis(),
        "diagnose" => sitting.diagnose()?,
        "cancel" => sitting.cancel(),
        "add" => sitting.add(read::<Add>(body)?.entry)?,
        "words" => sitting.words()?,
        "limits" => sitting.limits()?,
        "excite" => sitting.excite(read(body)?)?,
        "excitation" => sitting.excitation(),
        "stop_excitation" => sitting.stop_excitation(),
        "trajectory" => sitting.trajectory()?,
        "keep_trajectory" => sitting.keep_trajectory(&read::<Keeping>(body)?)?,
        other => {
            let says = format!("nothing called `{other}` can be asked");
            return Err(Refusal(Fault::Unknown, says));
        }
    }))
}

/// A body of JSON.
pub(crate) fn read<T: DeserializeOwned>(body: &[u8]) -> Result<T, Refusal> {
    serde_json::from_slice(body).map_err(|error| Refusal(Fault::Malformed, error.to_string()))
}
