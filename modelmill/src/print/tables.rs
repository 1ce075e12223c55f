//! Tables of text for people: base parameters, error figures, regions where the error is largest, and its dependence on
//! the rates of the drives.

use modelmill_identify::{ErrorFigures, FitParameter, ParameterStatus, TRIMMED_PART};

use crate::compare::{ErrorLocations, ROUNDING};
use crate::model::Model;
use crate::text::table::{ColumnAlignment, number, percent, significant, table};

/// Identified base parameters with nominal values and standard deviations, absolute and relative.
pub fn parameters(parameters: &[FitParameter]) -> Vec<String> {
    // One row for each parameter; the second `std` is relative to the value.
    let rows: Vec<Vec<String>> = parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                p.nominal.map_or_else(|| "-".to_owned(), number),
                // Values that were not identified are in parentheses.
                if p.status == ParameterStatus::Identified {
                    number(p.value)
                } else {
                    format!("({})", number(p.value))
                },
                // A parameter that was not identified says why.
                match (p.status, p.std) {
                    (ParameterStatus::Known, _) => "known".to_owned(),
                    (ParameterStatus::NotEssential, _) => "not essential".to_owned(),
                    (ParameterStatus::Undetermined, _) => "not determined".to_owned(),
                    (ParameterStatus::Identified, Some(std)) => significant(std, 2),
                    (ParameterStatus::Identified, None) => "—".to_owned(),
                },
                // A value of zero has no relative standard deviation.
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
            ("std, %", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
        ],
        &rows,
    )
}

/// Expressions of the base parameters as JSON and fit files write them: `p1_min = ...`.
pub fn expressions(indent: usize, model: &Model) -> Vec<String> {
    // The expression shows which physical parameters a base parameter combines.
    let indent = " ".repeat(indent);
    let lines = model.base.iter();
    lines
        .map(|base| format!("{indent}{} = {}", base.name, base.expression))
        .collect()
}

/// Error figures of several comparisons: a line for all drives together, where they have one unit, and a line for each
/// drive. `rms` and `largest` are in the unit of the force; the other figures are relative to the force. If a fit used
/// decimated samples, the error figures of these follow as a second table.
pub fn figures(named: &[(&str, &ErrorFigures)]) -> Vec<String> {
    let mut rows = Vec::new();
    // The name stands in the first row of its comparison only.
    for (name, figures) in named {
        let mut name = (*name).to_owned();
        // A total needs one unit: forces and torques are not added up.
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
        // One row for each drive, with its error in the band if there is one.
        for (channel, one) in &figures.channels {
            // The band is the same for all drives.
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
    // Relative errors come first, absolute ones after them.
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
    lines.push("  nrms: rms of the error divided by rms of the measured force".to_owned());
    if let Some(band) = named.iter().find_map(|(_, figures)| figures.band.as_ref()) {
        lines.push(format!(
            "  in band: the same error with measured and calculated force low-pass filtered at {} Hz, without {} of the \
             samples at each end",
            significant(band.cutoff_hz, 3),
            percent(Some(TRIMMED_PART)),
        ));
    }
    lines.extend(rows_of_fits(named));
    lines
}

/// Errors on the rows that the fits used, after low-pass and decimation: a column for each comparison that has them.
fn rows_of_fits(named: &[(&str, &ErrorFigures)]) -> Vec<String> {
    // Only fits after decimation have rows of their own.
    let fits = named.iter();
    let fits = fits.filter_map(|(name, figures)| Some((*name, figures.rows.as_ref()?)));
    let fits: Vec<_> = fits.collect();
    let Some((_, first)) = fits.first() else {
        return Vec::new();
    };
    // A row has a title and one cell for each comparison.
    let row = |title: &str, cell: &dyn Fn(usize) -> String| {
        let cells = (0..fits.len()).map(cell);
        std::iter::once(title.to_owned()).chain(cells).collect()
    };
    let mut rows: Vec<Vec<String>> = vec![
        row("rows", &|k| fits[k].1.samples.to_string()),
        row("low-pass, Hz", &|k| significant(fits[k].1.cutoff_hz, 3)),
        row("nrms of all", &|k| percent(fits[k].1.nrms)),
    ];
    // One line for each drive, one column for each comparison.
    for drive in first.channels.keys() {
        let cell = |k: usize| {
            let one = fits[k].1.channels.get(drive);
            one.map_or_else(String::new, |one| percent(one.nrms))
        };
        rows.push(row(drive, &cell));
    }
    // The comparisons are the columns.
    let heads = fits.iter().map(|(name, _)| (*name, ColumnAlignment::Right));
    let columns: Vec<(&str, ColumnAlignment)> = std::iter::once(("", ColumnAlignment::Left)).chain(heads).collect();
    let mut lines = vec![
        String::new(),
        "  On the rows that the fit used, after low-pass and decimation:".to_owned(),
    ];
    lines.extend(table(2, &columns, &rows));
    lines
}

/// The unit that all drives have.
fn common_unit(figures: &ErrorFigures) -> String {
    let first = figures.channels.values().next();
    first.map_or_else(String::new, |one| one.unit.clone())
}

/// Where an error is largest, one sentence for each region.
pub fn places(places: &ErrorLocations) -> Vec<String> {
    let regions = places.regions.iter();
    let mut lines: Vec<String> = regions.map(|region| format!("  {}.", region.says)).collect();
    // Errors at the level of rounding have no place that means anything.
    if !places.rounding.is_empty() {
        lines.push(format!(
            "  The error of {} is rounding (below {ROUNDING:e} of the force): there is nothing to find.",
            places.rounding.join(", ")
        ));
    }
    if lines.is_empty() {
        lines.push("  The error is clearly larger in no range of a coordinate, rate, load or time.".to_owned());
    }
    lines
}

/// How the residuals depend on the rates of their drives, one sentence for each dependence; empty if they do not.
pub fn by_rate(places: &ErrorLocations) -> Vec<String> {
    let dependences = places.by_rate.iter();
    dependences.map(|one| format!("  {}.", one.says)).collect()
}
