//! Equations for review: a page that shows a model's derivation from its file to p_min and the programs, and the same
//! facts as JSON. A [`Derivation`] goes in, text of one notation comes out; equal input gives equal bytes.
//!
//! Equation numbers 5, 6 and 16 are those of the paper on the parameter-minimal model of the SpiderMill.

mod balances;
mod base_parameters;
mod document;
mod effects;
mod equations;
mod frames;
mod listing;
mod loops;
mod parameters;
mod programs;
mod rank;
mod render_html;
mod render_latex;
mod render_markdown;
mod render_text;

#[cfg(test)]
pub(crate) mod tests;

pub use balances::{BalanceEquation, BalanceVector, BodyBalances, CutFreeError, balance_page, body_balances};
pub use base_parameters::{base_expression, base_summand, factored_base_expression};
pub use equations::{
    BaseParameterLine, DependencyLine, NumericMethod, ProgramOperations, RankSummary, ReducedEquations,
};
pub use rank::NumericRank;

use modelmill_draw::{DrawingStyle, MechanismScene, inline_svg};
use modelmill_spec::Mechanism;

use crate::Derivation;
use document::PageDocument;

/// How a page is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PageFormat {
    /// Plain text for a terminal.
    Text,
    /// Markdown with LaTeX formulas.
    Markdown,
    /// A standalone LaTeX article.
    Latex,
    /// One self-contained HTML file with MathML.
    Html,
    /// [`ReducedEquations`] as JSON; needs the feature `json`.
    #[cfg(any(test, feature = "json"))]
    Json,
}

/// The page of a model in one notation.
///
/// `numeric` is the rank of eq. (9) on the file's values, if the caller has computed it.
pub fn page(derivation: &Derivation, format: PageFormat, numeric: Option<&NumericRank>) -> String {
    // JSON needs no page, so it is composed on demand.
    let document = || compose_page(derivation, numeric);
    match format {
        PageFormat::Text => render_text::render(&document()),
        PageFormat::Markdown => render_markdown::render(&document()),
        PageFormat::Latex => render_latex::render(&document()),
        // The picture is part of the HTML page only.
        PageFormat::Html => render_html::render(&document(), &mechanism_picture(&derivation.mechanism)),
        #[cfg(any(test, feature = "json"))]
        PageFormat::Json => ReducedEquations::new(derivation, numeric).json(),
    }
}

/// The mechanism at its nominal pose, as an inline SVG.
fn mechanism_picture(mechanism: &Mechanism) -> String {
    // Nominal pose, from the direction in which the mechanism is seen best.
    let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    let scene = MechanismScene::new(mechanism, &nominal);
    inline_svg(&[&scene], &scene.best_view(), &DrawingStyle::default())
}

/// The page in the order of the derivation: given quantities, kinematics, effects, base parameters, programs.
fn compose_page(derivation: &Derivation, numeric: Option<&NumericRank>) -> PageDocument {
    let mechanism = &derivation.mechanism;
    // The title of the model file, or the name of the model.
    let title = mechanism.title.clone();
    let mut page = PageDocument {
        title: title.unwrap_or_else(|| mechanism.name.clone()),
        blocks: Vec::new(),
    };
    // Sections in the order in which one follows from the others.
    parameters::summary(&mut page, derivation);
    parameters::quantities(&mut page, mechanism);
    frames::frames(&mut page, mechanism);
    frames::bodies(&mut page, mechanism);
    loops::loops(&mut page, derivation);
    loops::drives(&mut page, derivation);
    effects::effects(&mut page, mechanism);
    base_parameters::products(&mut page, derivation);
    base_parameters::dependencies(&mut page, derivation);
    base_parameters::base_parameters(&mut page, derivation, numeric);
    programs::programs(&mut page, derivation);
    page
}
