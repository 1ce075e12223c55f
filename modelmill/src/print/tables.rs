//! Results in text, for people: parameters, figures and regions.

use modelmill_identify::{ErrorFigures, FitParameter, ParameterStatus, TRIMMED_PART};

use crate::compare::{ErrorLocations, ROUNDING};
use crate::model::Model;
use crate::text::table::{ColumnAlignment, count, number, percent, significant, table};

/// Identified base parameters beside their nominal values.
pub fn parameters(parameters: &[FitParameter]) -> Vec<String> {
    let rows: Vec<Vec<String>> = parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                p.nominal.map_or_else(|| "-".to_owned(), number),
                if p.status == ParameterStatus::Identified {
                    number(p.value)
                } else {
                    format!("({})", number(p.value))
                },
                match (p.status, p.std) {
                    (ParameterStatus::Known, _) => "known".to_owned(),
                    (ParameterStatus::NotEssential, _) => "not essential".to_owned(),
                    (ParameterStatus::Undetermined, _) => "not determined".to_owned(),
                    (ParameterStatus::Identified, Some(std)) => significant(std, 2),
                    (ParameterStatus::Identified, None) => "—".to_owned(),
                },
                p.std.map_or_else(String::new, |std| {
                    if p.value == 0.0 {
                        "-".to_owned()
                    } else {
                        percent(Some((std / p.value).abs()))
                    }
                }),
                p.unit.clone(),
            ]
        })
        .collect();
    table(
        2,
        &[
            ("parameter", ColumnAlignment::Left),
            ("nominal", ColumnAlignment::Right),
            ("identified", ColumnAlignment::Right),
            ("std", ColumnAlignment::Right),
            ("std", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
        ],
        &rows,
    )
}

/// Which name stands for which expression, as JSON and fits write it: `p1_min = ...`.
pub fn expressions(indent: usize, model: &Model) -> Vec<String> {
    let indent = " ".repeat(indent);
    let lines = model.base.iter();
    lines
        .map(|base| format!("{indent}{} = {}", base.name, base.expression))
        .collect()
}

/// Error figures of several comparisons, one line for the total, where there is one, and one for each channel.
pub fn figures(named: &[(&str, &ErrorFigures)]) -> Vec<String> {
    let mut rows = Vec::new();
    for (name, figures) in named {
        let mut name = (*name).to_owned();
        if let Some(rms) = figures.rms {
            rows.push(vec![
                std::mem::take(&mut name),
                "all".to_owned(),
                percent(figures.nrms),
                figures
                    .band
                    .as_ref()
                    .map_or_else(String::new, |band| percent(band.nrms)),
                String::new(),
                String::new(),
                significant(rms, 4),
                String::new(),
                common_unit(figures),
            ]);
        }
        for (channel, one) in &figures.channels {
            let band = figures.band.as_ref();
            let band = band.and_then(|band| band.channels.get(channel));
            rows.push(vec![
                std::mem::take(&mut name),
                channel.clone(),
                percent(one.nrms),
                band.map_or_else(String::new, |band| percent(band.nrms)),
                percent(one.abs_ratio),
                percent(one.mean_relative),
                significant(one.rms, 4),
                significant(one.max_abs, 4),
                one.unit.clone(),
            ]);
        }
    }
    let mut lines = table(
        2,
        &[
            ("", ColumnAlignment::Left),
            ("drive", ColumnAlignment::Left),
            ("nrms", ColumnAlignment::Right),
            ("in band", ColumnAlignment::Right),
            ("sum|e|/sum|f|", ColumnAlignment::Right),
            ("mean relative", ColumnAlignment::Right),
            ("rms", ColumnAlignment::Right),
            ("largest", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
        ],
        &rows,
    );
    if let Some(band) = named.iter().find_map(|(_, figures)| figures.band.as_ref()) {
        lines.push(format!(
            "  in band: nrms with both forces below {} Hz (Butterworth of order 4, both ways; {} of the samples dropped at \
             each end)",
            significant(band.cutoff_hz, 3),
            percent(Some(TRIMMED_PART)),
        ));
    }
    for (name, figures) in named {
        let Some(rows) = &figures.rows else { continue };
        let drives = rows.channels.iter();
        let drives = drives.map(|(drive, one)| format!("{drive} {}", percent(one.nrms)));
        let drives: Vec<String> = drives.collect();
        lines.push(format!(
            "  {name}: {} in the {} that are left of it, both forces below {} Hz ({})",
            percent(rows.nrms),
            count(rows.samples, "sample", "samples"),
            significant(rows.cutoff_hz, 3),
            drives.join(", ")
        ));
    }
    lines
}

/// The unit that all drives have.
fn common_unit(figures: &ErrorFigures) -> String {
    let first = figures.channels.values().next();
    first.map_or_else(String::new, |one| one.unit.clone())
}

/// Where an error lives, one sentence for each region.
pub fn places(places: &ErrorLocations) -> Vec<String> {
    let regions = places.regions.iter();
    let mut lines: Vec<String> = regions
        .map(|region| format!("  {}.", region.says))
        .collect();
    if !places.rounding.is_empty() {
        lines.push(format!(
            "  The error of {} is below {ROUNDING:e} of the force, which is rounding: there is nothing to find.",
            places.rounding.join(", ")
        ));
    }
    if lines.is_empty() {
        lines.push("  No region of coordinates, rates, loads or time stands out.".to_owned());
    }
    lines
}
