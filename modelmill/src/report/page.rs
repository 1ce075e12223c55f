//! The page: what a user asks, in that order; one file that needs no other.

use std::fmt::Write as _;

use modelmill_codegen::review::PageFormat;
use modelmill_draw::page as pages;
use modelmill_identify::diagnose::DiagnosisVerdict;

use super::{DiagnosisFindings, curves, ladder, legend, maps, regions, spectrum, tables, words};
use crate::compare::ErrorLocations;
use crate::error::Outcome;
use crate::print::{StepSpelling, laws as told};
use crate::text::svg::escape;
use crate::text::table::percent;

/// The page's text; `spelling` says how its reader asks for what it advises.
///
/// Fails only when whoever watches stops it.
pub fn page(findings: &DiagnosisFindings, spelling: &dyn StepSpelling) -> Outcome<String> {
    let final_version = findings.final_version();
    let equations = final_version.model.equations(PageFormat::Html)?.text;
    let name = &findings.before.model.name;
    let title = format!("{name}: what the model lacks");
    let mut page = pages::begin(&title);
    let sections = [
        ("ladder", "How the error falls", ladder_section(findings)),
        (
            "found",
            "What was found, and how to go on",
            missing_section(findings, spelling),
        ),
        (
            "curves",
            "Measured and calculated forces",
            curves_section(findings),
        ),
        ("where", "Where the error lives", location(findings)),
        (
            "frequency",
            "At which frequencies",
            spectrum::figures(&findings.before, findings.after.as_ref().ok()),
        ),
        ("candidates", "What else was tried", candidates(findings)),
        ("parameters", "Parameters", parameters(findings)),
        (
            "data",
            "What was done to the recordings",
            tables::data(findings, spelling),
        ),
        (
            "equations",
            "Equations",
            embed_equations(findings, &equations),
        ),
    ];
    page.push_str("<nav>");
    for (id, title, _) in &sections {
        let _ = write!(page, "<a href=\"#report-{id}\">{title}</a> ");
    }
    page.push_str("</nav>\n");
    page.push_str(&summary(findings));
    for (id, title, html) in &sections {
        let _ = write!(
            page,
            "<section id=\"report-{id}\">\n<h2>{title}</h2>\n{html}</section>\n"
        );
    }
    page.push_str(&end());
    Ok(page)
}

/// The end of a page with curves.
pub(super) fn end() -> String {
    pages::end(&[CURVES])
}

/// What makes curves that are drawn anew as they are zoomed, and tables that can be sorted.
const CURVES: &str = include_str!("page.js");

/// The style of all pages.
pub use pages::STYLE;

/// Scripts of pages, once they stand. Who puts parts of a page into another one later calls `enliven(element)` on them.
pub fn scripts() -> impl Iterator<Item = &'static str> {
    pages::SCRIPTS.into_iter().chain([CURVES])
}

/// What stands between two marks; empty if they are missing.
pub(super) fn text_between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let inner = text
        .split_once(from)
        .and_then(|(_, rest)| rest.split_once(to));
    inner.map_or("", |(inner, _)| inner)
}

fn summary(findings: &DiagnosisFindings) -> String {
    let diagnosis = &findings.diagnosis;
    let (class, word) = match diagnosis.verdict {
        DiagnosisVerdict::Adequate => ("adequate", "adequate"),
        DiagnosisVerdict::MissingEffect => ("missing", "an effect is missing"),
        DiagnosisVerdict::Unexplained => ("unexplained", "unexplained"),
    };
    let says = words::verdict(
        diagnosis,
        &findings.before.model.drives(),
        findings.validation,
    );
    let mut tiles = vec![("verdict", word.to_owned())];
    if let (Some(first), Some(last)) = (diagnosis.steps.first(), diagnosis.steps.last()) {
        tiles.push(("error as it is", percent(Some(first.check))));
        if diagnosis.steps.len() > 1 {
            tiles.push(("with the effects", percent(Some(last.check))));
        }
    }
    tiles.push(("noise", percent(Some(diagnosis.noise_floor))));
    let tiles: Vec<String> = tiles
        .iter()
        .map(|(name, value)| format!("<div><dt>{name}</dt><dd>{}</dd></div>", escape(value)))
        .collect();
    format!(
        "<p class=\"verdict {class}\">{}</p>\n<dl class=\"tiles\">{}</dl>\n",
        escape(&says),
        tiles.join("")
    )
}

fn ladder_section(findings: &DiagnosisFindings) -> String {
    let diagnosis = &findings.diagnosis;
    format!(
        "<figure class=\"still\"><figcaption><b>Error relative to the force</b> <span class=\"key c-fit\">fit</span> \
         <span class=\"key c-after\">{}</span></figcaption>\n{}</figure>\n{}\n\
         <p>An error is the root of the squared difference of measured and calculated forces over the squared measured ones. \
         Steps were judged {}.</p>\n{}",
        findings.validation.phrase(),
        ladder::picture(&diagnosis.steps, diagnosis.noise_floor, findings.validation),
        tables::ladder(findings),
        findings.validation.phrase(),
        tables::drives(findings)
    )
}

fn missing_section(findings: &DiagnosisFindings, spelling: &dyn StepSpelling) -> String {
    let mut html = effects(findings, spelling);
    if !findings.laws.is_empty() {
        html.push_str(&laws(findings, spelling));
    }
    html
}

/// Laws that would explain what is left.
fn laws(findings: &DiagnosisFindings, spelling: &dyn StepSpelling) -> String {
    let model = &findings.before.model;
    let mut html = format!(
        "<h3>Which law would explain what is left</h3>\n<p>{}</p>\n",
        escape(told::HYPOTHESIS)
    );
    for hypothesis in &findings.laws {
        let law = &hypothesis.law;
        let _ = writeln!(
            html,
            "<p><code>{}</code> with {}: it {}</p>",
            escape(&law.label()),
            escape(&told::values(law)),
            escape(&told::gain(law))
        );
        if !hypothesis.near_ties.is_empty() {
            html.push_str("<p>As near to these recordings are</p>\n<ul>\n");
            for tie in &hypothesis.near_ties {
                let _ = writeln!(html, "<li><code>{}</code></li>", escape(&tie.label()));
            }
            html.push_str("</ul>\n");
        }
        match &law.entry {
            Some(entry) => {
                let command = spelling.spell_effect_of_library(model, &entry.effect, told::LIBRARY);
                let _ = writeln!(
                    html,
                    "<p>As a library, <code>{}</code>, and with it:</p>\n<pre class=\"commands\"><code>{}</code></pre>\n\
                     <pre class=\"commands\"><code>{}</code></pre>",
                    told::LIBRARY,
                    escape(&entry.text),
                    escape(&command)
                );
            }
            None => {
                let _ = writeln!(html, "<p>{}</p>", escape(told::PATH_DEPENDENT_NOTE));
            }
        }
    }
    html
}

fn effects(findings: &DiagnosisFindings, spelling: &dyn StepSpelling) -> String {
    if findings.entries_to_add().is_empty() {
        if let Some(says) = findings.further_action() {
            return format!("{}<p>{says}</p>\n", tables::effects(findings));
        }
        let says = match findings.diagnosis.verdict {
            DiagnosisVerdict::Adequate => {
                "Nothing needs to be added. The parameters below are those that the recordings ask for."
            }
            _ => {
                "No effect of the library may be added in good faith. Below it says where the error lives; a kind of your own \
                 can be given in the model file or a library."
            }
        };
        return format!("<p>{says}</p>\n");
    }
    let mut html = tables::effects(findings);
    if let Err(says) = &findings.after {
        let _ = writeln!(
            html,
            "<p class=\"alias\">The model with these effects could not be made: {}</p>",
            escape(&says.spell(spelling))
        );
    }
    let model = &findings.before.model;
    let mut commands: Vec<String> = findings
        .entries_to_add()
        .iter()
        .map(|entry| spelling.spell_effect(model, entry))
        .collect();
    commands.push(spelling.spell_identification(model));
    let _ = writeln!(
        html,
        "<p>Add it to the model file, which keeps its comments, and identify again:</p>\n<pre class=\"commands\"><code>{}</code></pre>",
        escape(&commands.join("\n"))
    );
    html
}

fn curves_section(findings: &DiagnosisFindings) -> String {
    format!(
        "<p class=\"script-only\">Turn the wheel over a picture to zoom, drag to move, drag with Shift to mark a stretch, double \
         click for the whole. With the keyboard: + and −, arrows, 0. A click on a name hides its curve, one on a number of a \
         table copies its digits.</p>\n{}",
        curves::section(
            &findings.before,
            findings.after.as_ref().ok(),
            ["model as it is", "with the effects"]
        )
    )
}

fn location(findings: &DiagnosisFindings) -> String {
    let after = findings.after.as_ref().ok();
    let mut html = String::new();
    html.push_str(&sentences(
        &findings.places,
        "The error of the model as it is",
    ));
    if !findings.places.regions.is_empty() {
        let _ = writeln!(
            html,
            "<p>Each picture shows mean and standard deviation of the error over its variable, the region shaded. {}</p>",
            legend(after.is_some())
        );
        html.push_str(&regions::figures(
            &findings.places.regions,
            &findings.before,
            after,
            &findings.variables,
        ));
    }
    if let Some(left) = &findings.residual_locations {
        html.push_str("<h3>What is left with the effects</h3>\n");
        html.push_str(&sentences(left, "What is left"));
        if !left.regions.is_empty() {
            html.push_str("<ul>\n");
            for region in &left.regions {
                let _ = writeln!(
                    html,
                    "<li>{}.</li>",
                    escape(&regions::sentence(region, &findings.before.model))
                );
            }
            html.push_str("</ul>\n");
        }
    }
    html.push_str("<h3>Error maps</h3>\n");
    html.push_str(&maps::figures(&findings.before, after, &findings.variables));
    html
}

/// What there is to say where there is no region.
fn sentences(places: &ErrorLocations, what: &str) -> String {
    let mut html = String::new();
    if !places.rounding.is_empty() {
        let _ = writeln!(
            html,
            "<p>{what} of {} is rounding of the numbers in the recording: there is nothing to find.</p>",
            escape(&places.rounding.join(", "))
        );
    } else if places.regions.is_empty() {
        let _ = writeln!(
            html,
            "<p>No region of coordinates, rates, loads or time stands out in {}.</p>",
            what.to_lowercase()
        );
    }
    html
}

fn candidates(findings: &DiagnosisFindings) -> String {
    format!(
        "<p>Every kind of the library at every place that it fits. The first share is of the squared error of the model as it is; \
         the gain is of what is left beside the effects that were found, for a found one what would be lost without it.\
         <span class=\"script-only\"> A click on a head sorts.</span></p>\n{}",
        tables::candidates(findings)
    )
}

fn parameters(findings: &DiagnosisFindings) -> String {
    if findings.before.identified.is_none() {
        return tables::parameters(&findings.before);
    }
    let mut html = String::new();
    match &findings.after {
        Ok(after) => {
            html.push_str("<p>Base parameters of the model with the effects, identified from the recordings of the fit with drives weighted by their residuals. Deviations allow for residuals that resemble their neighbours.</p>\n");
            html.push_str(&tables::parameters(after));
            let _ = writeln!(
                html,
                "<details>\n<summary>The same without the effects</summary>\n{}</details>",
                tables::parameters(&findings.before)
            );
        }
        Err(_) => {
            html.push_str("<p>Base parameters, identified from the recordings of the fit with drives weighted by their residuals. Deviations allow for residuals that resemble their neighbours.</p>\n");
            html.push_str(&tables::parameters(&findings.before));
        }
    }
    html
}

/// The page of equations within this one: names of places on it get a prefix, headings go down two steps.
fn embed_equations(findings: &DiagnosisFindings, page: &str) -> String {
    let inner = text_between(page, "<main>", "</main>")
        .replace(" id=\"", " id=\"equations-")
        .replace("href=\"#", "href=\"#equations-");
    let mut inner = inner;
    for (from, to) in [("h3", "h5"), ("h2", "h4"), ("h1", "h3")] {
        inner = inner
            .replace(&format!("<{from} "), &format!("<{to} "))
            .replace(&format!("<{from}>"), &format!("<{to}>"))
            .replace(&format!("</{from}>"), &format!("</{to}>"));
    }
    let what = if findings.after.is_ok() {
        "The model with the effects"
    } else {
        "The model"
    };
    format!(
        "<details class=\"embedded\">\n<summary>{what}: how it was derived, p_g, dependences, p_min, programs</summary>\n{inner}</details>\n",
    )
}
