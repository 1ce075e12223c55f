//! The page of a diagnosis: verdict, errors, effects, curves, maps, candidates, parameters, recordings and
//! equations, in the order in which a user needs them. Input are findings, output is one HTML file that needs
//! no other file.

use std::fmt::Write as _;

use modelmill_codegen::review::PageFormat;
use modelmill_draw::page as pages;
use modelmill_identify::diagnose::DiagnosisVerdict;

use super::{DiagnosisFindings, curves, legend, maps, regions, spectrum, steps, tables, words};
use crate::compare::ErrorLocations;
use crate::error::Outcome;
use crate::print::{StepWording, laws as law_texts, values_text};
use crate::text::svg::escape;
use crate::text::table::percent;

/// The HTML of the page; `wording` writes commands or calls for its reader.
///
/// Fails only if the derivation of the equations is cancelled.
pub fn page(findings: &DiagnosisFindings, wording: &dyn StepWording) -> Outcome<String> {
    // Equations are those of the model with the effects, if it could be built.
    let final_version = findings.final_version();
    let equations = final_version.model.equations(PageFormat::Html)?.text;
    let name = &findings.before.model.name;
    let title = format!("{name}: effects that the model lacks");
    let mut page = pages::begin(&title);
    // The sections in the order in which a user needs them, each with its id and title.
    let sections = [
        ("steps", "Error after each step", steps_section(findings)),
        (
            "found",
            "Missing effects and next steps",
            missing_section(findings, wording),
        ),
        ("curves", "Measured and calculated forces", curves_section(findings)),
        ("where", "Where the error is largest", location(findings)),
        (
            "frequency",
            "Spectrum of the error",
            spectrum::figures(&findings.before, findings.after.version()),
        ),
        ("candidates", "All candidates", candidates(findings)),
        ("parameters", "Parameters", parameters(findings)),
        (
            "data",
            "Recordings and their preparation",
            tables::data(findings, wording),
        ),
        ("equations", "Equations", embed_equations(findings, &equations)),
    ];
    // Links to all sections at the top of the page.
    page.push_str("<nav>");
    // Each link leads to the id of its section.
    for (id, title, _) in &sections {
        let _ = write!(page, "<a href=\"#report-{id}\">{title}</a> ");
    }
    page.push_str("</nav>\n");
    // The summary is above all sections, so that the result is seen first.
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

/// Script for curves that can be zoomed and tables that can be sorted.
const CURVES: &str = include_str!("page.js");

/// The style of all pages.
pub use pages::STYLE;

/// Scripts of pages. If parts of a page are put into another page later, call `enliven(element)` on them.
pub fn scripts() -> impl Iterator<Item = &'static str> {
    pages::SCRIPTS.into_iter().chain([CURVES])
}

/// Text between two marks; empty if they are missing.
pub(super) fn text_between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    // The first occurrence of each mark counts.
    let inner = text.split_once(from).and_then(|(_, rest)| rest.split_once(to));
    inner.map_or("", |(inner, _)| inner)
}

/// Verdict and tiles with the main figures.
fn summary(findings: &DiagnosisFindings) -> String {
    let diagnosis = &findings.diagnosis;
    // The class of the verdict gives its colour.
    let (class, word) = match diagnosis.verdict {
        DiagnosisVerdict::Adequate => ("adequate", "model is adequate"),
        DiagnosisVerdict::MissingEffect => ("missing", "an effect is missing"),
        DiagnosisVerdict::Unexplained if words::has_only_changes_in_time(diagnosis) => {
            ("unexplained", "a change during a recording explains the error")
        }
        DiagnosisVerdict::Unexplained if words::is_only_hidden_by_noise(diagnosis) => {
            ("unexplained", "noise hides what may be missing")
        }
        DiagnosisVerdict::Unexplained => ("unexplained", "error is not explained"),
    };
    // The same sentences as in the text output.
    let says = findings.verdict_text();
    // Tiles: verdict, error before and after, noise.
    let mut tiles = vec![("verdict", word.to_owned())];
    if let (Some(first), Some(last)) = (diagnosis.steps.first(), diagnosis.steps.last()) {
        tiles.push(("error of the given model", percent(Some(first.check))));
        if diagnosis.steps.len() > 1 {
            tiles.push(("error after the last step", percent(Some(last.check))));
        }
    }
    // Errors cannot fall below the noise.
    let noise = words::floor_label(diagnosis.noise_floor);
    tiles.push((noise, percent(Some(diagnosis.noise_floor))));
    // A list of terms, which also makes sense without style.
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

/// Errors after each step, as picture and table, and errors of each drive.
fn steps_section(findings: &DiagnosisFindings) -> String {
    // The picture shows the steps, the table has the numbers.
    format!(
        "<figure class=\"still\"><figcaption><b>Error relative to the force</b> <span class=\"key c-fit\">fit</span> \
         <span class=\"key c-after\">{}</span></figcaption>\n{}</figure>\n{}\n\
         <p>All errors are nrms: rms of measured minus calculated force, divided by rms of the measured force. \
         The line of the noise or rounding is computed from all recordings together.</p>\n<ul>\n\
         <li><i>decrease of the squared error</i>: relative to the step before, evaluated {} and only for the drives on \
         which the added effects act.</li>\n\
         <li><i>t value of the decrease</i>: the validation run is cut into blocks of time; the t value is the mean decrease of \
         a block, divided by the standard error of this mean.</li>\n\
         <li><i>effective samples</i>: the number of independent samples that carry as much information as the samples of the \
         residual, which are correlated in time.</li>\n</ul>\n{}\
         <p><i>upper bound of the noise</i>: computed from differences of successive samples. The standard deviations \
         of the parameters of missing effects are computed from this bound or from the residual, whichever is larger.</p>\n",
        findings.validation.phrase(),
        steps::picture(findings),
        tables::steps(findings),
        findings.validation.phrase(),
        tables::drives(findings)
    )
}

/// Missing effects with next steps, then laws.
fn missing_section(findings: &DiagnosisFindings, wording: &dyn StepWording) -> String {
    // Effects of the library come before laws, which are only hypotheses.
    let mut html = effects(findings, wording);
    if !findings.laws.is_empty() {
        html.push_str(&laws(findings, wording));
    }
    html
}

/// Laws that would explain the residual.
fn laws(findings: &DiagnosisFindings, wording: &dyn StepWording) -> String {
    let model = &findings.before.model;
    let mut html = format!(
        "<h3>Laws that would explain the residual</h3>\n<p>{}</p>\n",
        escape(law_texts::HYPOTHESIS)
    );
    for hypothesis in &findings.laws {
        // Each law with its values, the share that it explains, and its alternatives.
        let law = &hypothesis.law;
        let _ = writeln!(
            html,
            "<p><code>{}</code> with {}: it {}</p>",
            escape(&law.label()),
            escape(&values_text(&law.parameters)),
            escape(&law_texts::gain(law))
        );
        // Alternatives that the recordings do not distinguish.
        if !hypothesis.near_ties.is_empty() {
            html.push_str("<p>These laws explain the recordings equally well:</p>\n<ul>\n");
            for tie in &hypothesis.near_ties {
                let _ = writeln!(html, "<li><code>{}</code></li>", escape(&tie.label()));
            }
            html.push_str("</ul>\n");
        }
        // A law without memory can be added from a library file.
        match &law.entry {
            Some(entry) => {
                let command = wording.format_effect_of_library(model, &entry.effect, law_texts::LIBRARY);
                let _ = writeln!(
                    html,
                    "<p>As a library file, <code>{}</code>, and the step that adds it:</p>\n<pre class=\"commands\"><code>{}</code></pre>\n\
                     <pre class=\"commands\"><code>{}</code></pre>",
                    law_texts::LIBRARY,
                    escape(&entry.text),
                    escape(&command)
                );
            }
            None => {
                let _ = writeln!(html, "<p>{}</p>", escape(law_texts::PATH_DEPENDENT_NOTE));
            }
        }
    }
    html
}

/// Missing effects and the steps that add them, or the reason why none should be added.
fn effects(findings: &DiagnosisFindings, wording: &dyn StepWording) -> String {
    // Without entries to add there may still be findings, such as a delayed force signal.
    if findings.entries_to_add().is_empty() {
        if let Some(says) = findings.further_action() {
            return format!("{}<p>{says}</p>\n", tables::effects(findings));
        }
        let says = match findings.diagnosis.verdict {
            DiagnosisVerdict::Adequate => {
                "Nothing needs to be added. The parameters below are fitted to the recordings."
            }
            _ if words::has_only_changes_in_time(&findings.diagnosis) => {
                "No effect needs to be added: changes during the recordings explain the error. The verdict at the top of this \
                 page names them with their times. Split the recordings at these times, and identify the parts separately."
            }
            _ => {
                "No effect of the library explains the error reliably. Look below where the error is largest. You can define a \
                 kind of effect of your own in the model file or in a library."
            }
        };
        return format!("<p>{says}</p>\n");
    }
    // The effects with values, then the steps.
    let mut html = tables::effects(findings);
    if let Some(says) = findings.after.refusal() {
        let _ = writeln!(
            html,
            "<p class=\"alias\">The model with these effects could not be built: {}</p>",
            escape(&says.format_for(wording))
        );
    }
    let model = &findings.before.model;
    // The steps: one for each effect, and a new identification.
    let mut commands: Vec<String> = findings
        .entries_to_add()
        .iter()
        .map(|entry| wording.format_effect(model, entry))
        .collect();
    commands.push(wording.format_identification(model));
    let _ = writeln!(
        html,
        "<p>Add the effects to the model file (its comments stay), and identify again:</p>\n<pre class=\"commands\"><code>{}</code></pre>",
        escape(&commands.join("\n"))
    );
    html
}

/// Forces over time, with help for the mouse.
fn curves_section(findings: &DiagnosisFindings) -> String {
    format!(
        "<p class=\"script-only\">Mouse wheel: zoom. Drag: move. Shift and drag: zoom to a time interval. Double click: show all. \
         Keys: + and −, arrows, 0. Click on a name to hide its curve. Click on a number of a table to copy it.</p>\n{}",
        curves::section(
            &findings.before,
            findings.after.version(),
            ["given model", "model with the effects"]
        )
    )
}

/// Regions of the error before and after the effects, and error maps.
fn location(findings: &DiagnosisFindings) -> String {
    // Both models are shown if the second one could be built.
    let after = findings.after.version();
    let mut html = String::new();
    html.push_str(&sentences(&findings.error_locations, "The error of the given model"));
    if !findings.error_locations.regions.is_empty() {
        let _ = writeln!(
            html,
            "<p>Mean and standard deviation of the error as functions of one variable. The range named in the caption is shaded. \
             The same samples may be in the ranges of several variables. {}</p>",
            legend(after.is_some())
        );
        html.push_str(&regions::figures(
            &findings.error_locations.regions,
            &findings.before,
            after,
            &findings.variables,
        ));
    }
    html.push_str(&by_rate(&findings.error_locations));
    // Regions of the residual are listed without pictures.
    if let Some(left) = &findings.residual_locations {
        html.push_str("<h3>Residual with the effects</h3>\n");
        html.push_str(&sentences(left, "The residual"));
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
        html.push_str(&by_rate(left));
    }
    html.push_str("<h3>Error maps</h3>\n");
    html.push_str(&maps::figures(&findings.before, after, &findings.variables));
    html
}

/// How the error depends on the rates of the drives, as a list; empty if it does not.
fn by_rate(places: &ErrorLocations) -> String {
    if places.by_rate.is_empty() {
        return String::new();
    }
    let mut html = String::from("<ul>\n");
    for one in &places.by_rate {
        let _ = writeln!(html, "<li>{}.</li>", escape(&one.says));
    }
    html.push_str("</ul>\n");
    html
}

/// A sentence in place of regions: the error is rounding, or no region stands out.
fn sentences(places: &ErrorLocations, what: &str) -> String {
    let mut html = String::new();
    // Regions of rounding errors would mislead.
    if !places.rounding.is_empty() {
        let _ = writeln!(
            html,
            "<p>{what} of {} is only rounding error of the recorded numbers, so it contains no further effect.</p>",
            escape(&places.rounding.join(", "))
        );
    } else if places.regions.is_empty() {
        let _ = writeln!(
            html,
            "<p>{what} is clearly larger in no range of a coordinate, rate, load or time.</p>",
        );
    }
    html
}

/// Table of all candidates with an explanation of its columns.
fn candidates(findings: &DiagnosisFindings) -> String {
    format!(
        "<p>The table lists the candidates that were tried: kinds of effects and disturbances at the places where they can act (drive, joint, point, frame, body, base, a constant of the model file such as a length, or `force` for all force signals). \
         <i>squared error explained if added alone</i>: the share of the squared error of the given model that the candidate \
         removes without any other effect. <i>gain in addition to the effects found</i>: the share of the squared residual that \
         the candidate removes if it is added to the model with these effects; where the residual is only noise or rounding, a large \
         share means nothing. For an effect that was found, all other effects found are added \
         first.\
         <span class=\"script-only\"> Click on the heading of a column to sort.</span></p>\n{}",
        tables::candidates(findings)
    )
}

/// Base parameters with the effects, and folded those without.
fn parameters(findings: &DiagnosisFindings) -> String {
    if findings.before.identified.is_none() {
        return tables::parameters(&findings.before);
    }
    let mut html = String::new();
    match findings.after.version() {
        Some(after) => {
            html.push_str(
                "<p>Base parameters of the model with the effects, fitted by weighted least squares: the equations of each drive \
                 are divided by the standard deviation of its residual. The standard deviations in this section are computed \
                 from the residual alone, and allow for its correlation in time. The section of missing effects also uses the \
                 upper bound of the noise, so its standard deviations may differ. With little noise, an estimate may differ from \
                 its nominal value by many standard deviations although the difference is too small to matter.</p>\n",
            );
            html.push_str(&tables::parameters(after));
            let _ = writeln!(
                html,
                "<details>\n<summary>Parameters without the effects</summary>\n{}</details>",
                tables::parameters(&findings.before)
            );
        }
        None => {
            html.push_str(
                "<p>Base parameters, fitted by weighted least squares: the equations of each drive are divided by the standard \
                 deviation of its residual. The standard deviations of the parameters are computed from the residual alone, and \
                 allow for its correlation in time.</p>\n",
            );
            html.push_str(&tables::parameters(&findings.before));
        }
    }
    html
}

/// The page of equations inside this page: its anchors get a prefix, its headings go down two levels.
fn embed_equations(findings: &DiagnosisFindings, page: &str) -> String {
    // Only the main part is taken; styles and scripts are on this page already.
    let inner = text_between(page, "<main>", "</main>")
        .replace(" id=\"", " id=\"equations-")
        .replace("href=\"#", "href=\"#equations-");
    // Headings become lower ones in an order in which no replacement meets the result of another.
    let mut inner = inner;
    for (from, to) in [("h3", "h5"), ("h2", "h4"), ("h1", "h3")] {
        inner = inner
            .replace(&format!("<{from} "), &format!("<{to} "))
            .replace(&format!("<{from}>"), &format!("<{to}>"))
            .replace(&format!("</{from}>"), &format!("</{to}>"));
    }
    // The summary of the folded part names the model.
    let what = if findings.after.version().is_some() {
        "Equations of the model with the effects"
    } else {
        "Equations of the model"
    };
    format!("<details class=\"embedded\">\n<summary>{what}</summary>\n{inner}</details>\n")
}
