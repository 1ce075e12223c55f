//! The page: what a user asks, in that order; one file that needs no other.

use std::fmt::Write as _;

use modelmill_identify::diagnose::Verdict;

use super::{Study, Version, added, curves, keys, ladder, maps, regions, spectrum, tables, words};
use crate::along::Places;
use crate::commands::equations;
use crate::svg::escape;
use crate::table::percent;

/// The page's text.
pub(crate) fn render(study: &Study) -> String {
    let last = study.last();
    let equations = equations::html(&last.model);
    let name = &study.before.model.name;
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{0}: what the model lacks</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n{1}{2}</style>\n</head>\n\
         <body>\n<main>\n<h1>{0}: what the model lacks</h1>\n",
        escape(name),
        between(&equations, "<style>", "</style>"),
        include_str!("page.css"),
    );
    let sections = [
        ("ladder", "How the error falls", the_ladder(study)),
        ("found", "What was found, and how to go on", found(study)),
        (
            "curves",
            "Measured and calculated forces",
            the_curves(study),
        ),
        ("where", "Where the error lives", location(study)),
        (
            "frequency",
            "At which frequencies",
            spectrum::figures(&study.before, study.after.as_ref().ok()),
        ),
        ("candidates", "What else was tried", candidates(study)),
        ("parameters", "Parameters", parameters(study)),
        (
            "data",
            "What was done to the recordings",
            tables::data(study),
        ),
        ("equations", "Equations", embedded(study, &equations)),
    ];
    page.push_str("<nav>");
    for (id, title, _) in &sections {
        let _ = write!(page, "<a href=\"#report-{id}\">{title}</a> ");
    }
    page.push_str("</nav>\n");
    page.push_str(&summary(study));
    for (id, title, html) in &sections {
        let _ = write!(
            page,
            "<section id=\"report-{id}\">\n<h2>{title}</h2>\n{html}</section>\n"
        );
    }
    page.push_str("</main>\n<script>\n");
    page.push_str(include_str!("page.js"));
    page.push_str("</script>\n</body>\n</html>\n");
    page
}

impl Study {
    /// The model with what was found, or as it is.
    fn last(&self) -> &Version {
        self.after.as_ref().unwrap_or(&self.before)
    }
}

/// What stands between two marks; empty if they are missing.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let inner = text
        .split_once(from)
        .and_then(|(_, rest)| rest.split_once(to));
    inner.map_or("", |(inner, _)| inner)
}

fn summary(study: &Study) -> String {
    let diagnosis = &study.answer.diagnosis;
    let (class, word) = match diagnosis.verdict {
        Verdict::Adequate => ("adequate", "adequate"),
        Verdict::MissingEffect => ("missing", "an effect is missing"),
        Verdict::Unexplained => ("unexplained", "unexplained"),
    };
    let says = words::verdict(diagnosis, &study.before.model.drives(), study.judged);
    let mut tiles = vec![("verdict", word.to_owned())];
    if let (Some(first), Some(last)) = (diagnosis.ladder.first(), diagnosis.ladder.last()) {
        tiles.push(("error as it is", percent(Some(first.check))));
        if diagnosis.ladder.len() > 1 {
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

fn the_ladder(study: &Study) -> String {
    let diagnosis = &study.answer.diagnosis;
    format!(
        "<figure class=\"still\"><figcaption><b>Error relative to the force</b> <span class=\"key c-fit\">fit</span> \
         <span class=\"key c-after\">{}</span></figcaption>\n{}</figure>\n{}\n\
         <p>An error is the root of the squared difference of measured and calculated forces over the squared measured ones. \
         Steps were judged {}.</p>\n{}",
        study.judged.words(),
        ladder::picture(&diagnosis.ladder, diagnosis.noise_floor, study.judged),
        tables::ladder(study),
        study.judged.words(),
        tables::drives(study)
    )
}

fn found(study: &Study) -> String {
    if study.entries.is_empty() {
        let says = match study.answer.diagnosis.verdict {
            Verdict::Adequate => {
                "Nothing needs to be added. The parameters below are those that the recordings ask for."
            }
            _ => {
                "No effect of the library may be added in good faith. Below it says where the error lives; a kind of your own \
                 can be given in the model file or a library (<code>modelmill help diagnose</code>)."
            }
        };
        return format!("<p>{says}</p>\n");
    }
    let mut html = tables::effects(study);
    if let Err(says) = &study.after {
        let _ = writeln!(
            html,
            "<p class=\"alias\">The model with these effects could not be made: {}</p>",
            escape(says)
        );
    }
    let path = &study.before.model.path;
    let mut commands: Vec<String> = study
        .entries
        .iter()
        .map(|entry| added::command(path, entry))
        .collect();
    commands.push(format!(
        "modelmill identify {} {} --out fit.json",
        added::quoted(path),
        study.recordings
    ));
    let _ = writeln!(
        html,
        "<p>Add it to the model file, which keeps its comments, and identify again:</p>\n<pre class=\"commands\"><code>{}</code></pre>",
        escape(&commands.join("\n"))
    );
    html
}

fn the_curves(study: &Study) -> String {
    format!(
        "<p class=\"script-only\">Turn the wheel over a picture to zoom, drag to move, drag with Shift to mark a stretch, double \
         click for the whole. With the keyboard: + and −, arrows, 0. A click on a name hides its curve.</p>\n{}",
        curves::section(&study.before, study.after.as_ref().ok())
    )
}

fn location(study: &Study) -> String {
    let after = study.after.as_ref().ok();
    let mut html = String::new();
    html.push_str(&sentences(&study.places, "The error of the model as it is"));
    if !study.places.regions.is_empty() {
        let _ = writeln!(
            html,
            "<p>Each picture shows mean and standard deviation of the error over its variable, the region shaded. {}</p>",
            keys(after.is_some())
        );
        html.push_str(&regions::figures(
            &study.places.regions,
            &study.before,
            after,
            &study.variables,
        ));
    }
    if let Some(left) = &study.left {
        html.push_str("<h3>What is left with the effects</h3>\n");
        html.push_str(&sentences(left, "What is left"));
        if !left.regions.is_empty() {
            html.push_str("<ul>\n");
            for region in &left.regions {
                let _ = writeln!(
                    html,
                    "<li>{}.</li>",
                    escape(&regions::sentence(region, &study.before.model))
                );
            }
            html.push_str("</ul>\n");
        }
    }
    html.push_str("<h3>Error maps</h3>\n");
    html.push_str(&maps::figures(&study.before, after, &study.variables));
    html
}

/// What there is to say where there is no region.
fn sentences(places: &Places, what: &str) -> String {
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

fn candidates(study: &Study) -> String {
    format!(
        "<p>Every kind of the library at every place that it fits. The first share is of the squared error of the model as it is; \
         the gain is of what is left beside the effects that were found, for a found one what would be lost without it.\
         <span class=\"script-only\"> A click on a head sorts.</span></p>\n{}",
        tables::candidates(study)
    )
}

fn parameters(study: &Study) -> String {
    if study.before.identified.is_none() {
        return tables::parameters(&study.before);
    }
    let mut html = String::new();
    match &study.after {
        Ok(after) => {
            html.push_str("<p>Base parameters of the model with the effects, identified from the recordings of the fit with drives weighted by their residuals. Deviations allow for residuals that resemble their neighbours.</p>\n");
            html.push_str(&tables::parameters(after));
            let _ = writeln!(
                html,
                "<details>\n<summary>The same without the effects</summary>\n{}</details>",
                tables::parameters(&study.before)
            );
        }
        Err(_) => {
            html.push_str("<p>Base parameters, identified from the recordings of the fit with drives weighted by their residuals. Deviations allow for residuals that resemble their neighbours.</p>\n");
            html.push_str(&tables::parameters(&study.before));
        }
    }
    html
}

/// The page of equations within this one: names of places on it get a prefix, headings go down two steps.
fn embedded(study: &Study, page: &str) -> String {
    let inner = between(page, "<main>", "</main>")
        .replace(" id=\"", " id=\"equations-")
        .replace("href=\"#", "href=\"#equations-");
    let mut inner = inner;
    for (from, to) in [("h3", "h5"), ("h2", "h4"), ("h1", "h3")] {
        inner = inner
            .replace(&format!("<{from} "), &format!("<{to} "))
            .replace(&format!("<{from}>"), &format!("<{to}>"))
            .replace(&format!("</{from}>"), &format!("</{to}>"));
    }
    let what = if study.after.is_ok() {
        "The model with the effects"
    } else {
        "The model"
    };
    format!(
        "<details class=\"embedded\">\n<summary>{what}: how it was derived, p_g, dependences, p_min, programs</summary>\n{inner}</details>\n",
    )
}
