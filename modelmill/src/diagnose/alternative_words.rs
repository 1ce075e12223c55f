//! Sentences about other causes that explain as much as what a diagnosis found.

use super::elastic_drives::ElasticAlternative;
use super::geometry_alternatives::{GeometryAlternative, GeometryError};
use super::words::effect;
use crate::text::names::joined_by_and;
use crate::text::table::significant;

/// The sentence about the best error of the geometry that explains as much as the effects found; `None` if there is none.
pub(super) fn geometry_alternative_text(alternatives: &[GeometryAlternative], has_effects: bool) -> Option<String> {
    let best = alternatives.first()?;
    let errors: Vec<String> = best.errors.iter().map(geometry_error_text).collect();
    let has_zero = best.errors.iter().any(|error| error.zero.is_some());
    let zero = if has_zero {
        " The file writes such a coordinate as 0."
    } else {
        ""
    };
    let errors = joined_by_and(&errors);
    Some(if has_effects {
        format!(
            "Errors of the geometry explain this as well: {errors}.{zero} Measure the lengths before you change the model."
        )
    } else {
        format!(
            "Instead of the time base, the geometry may be wrong: {errors}.{zero} The recordings do not distinguish the two, so \
             check the clock and measure the lengths."
        )
    })
}

/// Sentences about encoders whose error an elastic drive explains as well; `None` if there are none.
pub(super) fn elastic_alternative_text(alternatives: &[ElasticAlternative]) -> Option<String> {
    let all: Vec<String> = (alternatives.iter())
        .map(|one| {
            format!(
                "The error of the encoder of {} may be {} instead: the weight deflects an elastic drive once per turn, too.",
                one.coordinate,
                effect(&one.compliance)
            )
        })
        .collect();
    (!all.is_empty()).then(|| all.join(" "))
}

/// An error of the geometry with its value.
pub(crate) fn geometry_error_text(error: &GeometryError) -> String {
    format!("{} off by {} {}", error.name(), significant(error.value, 3), error.unit)
}
