//! `report`: the findings of a diagnosis as one self-contained HTML page.
//!
//! [`runs_page`] is the page of differences between runs, [`atlas()`] that of many mechanisms.
//!
//! The pictures need no script; with the script `page.js`, curves can be zoomed and tables can be sorted.

mod atlas;
mod curves;
mod draw;
mod maps;
mod page;
mod regions;
mod runs;
mod spectrum;
mod steps;
mod tables;
mod units;

use crate::diagnose::{DiagnosisFindings, ModelVersion, words};

pub use atlas::{AtlasMechanism, atlas};
pub use curves::section as curves;
pub use modelmill_draw::page::{begin as begin_page, end as end_page};
pub use page::{STYLE, page, scripts};
pub use runs::{parameter_history, runs_page};
pub use tables::{TableCell, table};

/// Picture (SVG) of the error after each step, on the fitted and on the validation runs, with the noise.
pub fn steps_picture(findings: &DiagnosisFindings) -> String {
    steps::picture(findings)
}

/// The key of the colours: the model before and after the effects.
fn legend(with_after: bool) -> &'static str {
    if with_after {
        "<span class=\"key c-before\">given model</span> <span class=\"key c-after\">with the effects</span>"
    } else {
        "<span class=\"key c-before\">given model</span>"
    }
}
