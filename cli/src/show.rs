//! Results in text, for people: parameters, figures and regions.

use modelmill_identify::{Figures, FitParameter, Region};

use crate::model::Model;
use crate::table::{Align, number, percent, significant, table};

/// Identified base parameters beside their nominal values.
pub(crate) fn parameters(parameters: &[FitParameter]) -> Vec<String> {
    let rows: Vec<Vec<String>> = parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                p.nominal.map_or_else(|| "-".to_owned(), number),
                if p.std.is_some() {
                    number(p.value)
                } else {
                    format!("({})", number(p.value))
                },
                p.std
                    .map_or_else(|| "not determined".to_owned(), |std| significant(std, 2)),
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
            ("parameter", Align::Left),
            ("nominal", Align::Right),
            ("identified", Align::Right),
            ("std", Align::Right),
            ("std", Align::Right),
            ("unit", Align::Left),
        ],
        &rows,
    )
}

/// Which name stands for which expression, as JSON and fits write it: `p1_min = ...`.
pub(crate) fn expressions(indent: usize, model: &Model) -> Vec<String> {
    let indent = " ".repeat(indent);
    let lines = model.base.iter();
    lines
        .map(|base| format!("{indent}{} = {}", base.name, base.expression))
        .collect()
}

/// Error figures of several comparisons, one line for the total and one for each channel.
pub(crate) fn figures(named: &[(&str, &Figures)]) -> Vec<String> {
    let mut rows = Vec::new();
    for (name, figures) in named {
        rows.push(vec![
            (*name).to_owned(),
            "all".to_owned(),
            percent(figures.nrms),
            String::new(),
            significant(figures.rms, 4),
            String::new(),
        ]);
        for (channel, one) in &figures.channels {
            rows.push(vec![
                String::new(),
                channel.clone(),
                percent(one.nrms),
                percent(one.mean_relative),
                significant(one.rms, 4),
                significant(one.max_abs, 4),
            ]);
        }
    }
    table(
        2,
        &[
            ("", Align::Left),
            ("drive", Align::Left),
            ("nrms", Align::Right),
            ("mean relative", Align::Right),
            ("rms", Align::Right),
            ("largest", Align::Right),
        ],
        &rows,
    )
}

/// Where an error lives, one sentence for each region.
pub(crate) fn regions(regions: &[Region]) -> Vec<String> {
    if regions.is_empty() {
        return vec![
            "  The error is spread evenly over coordinates, rates, loads and time.".to_owned(),
        ];
    }
    regions
        .iter()
        .map(|region| format!("  {}.", region.says))
        .collect()
}
