//! Error maps: for each drive, the size of the error over the two variables that concentrate it most, before and
//! after with one scale.

use std::fmt::Write as _;

use modelmill_identify::float_to_count;

use super::draw::{PlotAxis, SvgPicture, range};
use super::units::{force_unit, variable_unit};
use crate::compare::variable_phrase;
use crate::diagnose::ModelVersion;
use crate::text::svg::escape;
use crate::text::table::significant;

/// Number of cells of a map across; few enough that each has several samples.
const COLUMNS: usize = 22;
/// Number of cells of a map upwards.
const ROWS: usize = 14;
/// Number of shades of a map; the page has a class for each.
const SHADES: usize = 9;
/// Smallest number of samples of a cell that is shown.
const LEAST: usize = 2;

/// A variable with its name, along the validation runs.
pub(crate) type MapVariable = (String, Vec<f64>);

/// The cells of a map over two variables.
struct ErrorGrid {
    /// Least and largest value of the variable across.
    x: [f64; 2],
    /// Least and largest value of the variable upwards.
    y: [f64; 2],
    /// Index of the cell of each sample, row by row from below.
    cells: Vec<usize>,
}

impl ErrorGrid {
    /// The cells of two variables; `None` if one of them is constant.
    fn new(x: &[f64], y: &[f64]) -> Option<Self> {
        let (of_x, of_y) = (range(x), range(y));
        // A variable that does not change has no cells.
        if !(of_x[1] > of_x[0] && of_y[1] > of_y[0]) {
            return None;
        }
        // The largest value belongs to the last cell.
        let cell = |v: f64, [low, high]: [f64; 2], n: usize| -> usize {
            let k = float_to_count((v - low) / (high - low) * n as f64);
            k.min(n - 1)
        };
        let pairs = x.iter().zip(y);
        let cells = pairs.map(|(a, b)| cell(*b, of_y, ROWS) * COLUMNS + cell(*a, of_x, COLUMNS));
        Some(Self {
            x: of_x,
            y: of_y,
            cells: cells.collect(),
        })
    }

    /// Number of samples and sum of squares in each cell.
    fn sums(&self, error: &[f64]) -> Vec<(usize, f64)> {
        let mut sums = vec![(0, 0.0); COLUMNS * ROWS];
        for (cell, e) in self.cells.iter().zip(error) {
            if e.is_finite() {
                sums[*cell].0 += 1;
                sums[*cell].1 += e * e;
            }
        }
        sums
    }

    /// The fraction of the variance of the squared error that is between cells, adjusted for what as many cells
    /// show by chance.
    fn error_concentration(&self, error: &[f64]) -> f64 {
        // Adjusted coefficient of determination of an analysis of variance, with the cell as the only factor.
        let n = error.len() as f64;
        let mean = error.iter().map(|e| e * e).sum::<f64>() / n;
        let total: f64 = error.iter().map(|e| (e * e - mean).powi(2)).sum();
        let sums = self.sums(error);
        let used = sums.iter().filter(|(count, _)| *count > 0).count() as f64;
        let between: f64 = sums
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, sum)| *count as f64 * (sum / *count as f64 - mean).powi(2))
            .sum();
        if total > 0.0 && n > used {
            1.0 - (1.0 - between / total) * (n - 1.0) / (n - used)
        } else {
            0.0
        }
    }
}

/// Pairs of variables that may explain an error: a motion and its rate. Two positions would only retrace the path.
fn pairs(variables: &[MapVariable]) -> Vec<(usize, usize)> {
    let at = |name: &str| variables.iter().position(|(n, _)| n == name);
    let mut pairs = Vec::new();
    for (i, (name, _)) in variables.iter().enumerate() {
        let of = name.strip_suffix("_length").unwrap_or(name);
        // The force of a linear drive has its name, its motion is called by its length.
        if of == name && at(&format!("{name}_length")).is_some() {
            continue;
        }
        if let Some(rate) = at(&format!("{of}_d"))
            && !name.ends_with("_d")
        {
            pairs.push((i, rate));
        }
    }
    pairs
}

/// A figure for each drive, with maps before and after the effects.
pub(crate) fn figures(before: &ModelVersion, after: Option<&ModelVersion>, variables: &[MapVariable]) -> String {
    let judged = before.validation_runs();
    let mut html = String::new();
    for (d, drive) in before.model.row_names().iter().enumerate() {
        // Errors on the runs that judge the model.
        let error = before.errors(&judged, d);
        // With a delay the model with effects has other samples.
        let rest = after.map(|after| after.errors(&judged, d));
        let rest = rest.filter(|rest| rest.len() == error.len());
        let mut best: Option<(f64, usize, usize, ErrorGrid)> = None;
        for (i, j) in pairs(variables) {
            let (x, y) = (&variables[i].1, &variables[j].1);
            if x.len() != error.len() || y.len() != error.len() {
                continue;
            }
            let Some(grid) = ErrorGrid::new(x, y) else {
                continue;
            };
            // The map is drawn over the pair of variables that concentrates the error most.
            let gathers = grid.error_concentration(&error);
            if best.as_ref().is_none_or(|(most, ..)| gathers > *most) {
                best = Some((gathers, i, j, grid));
            }
        }
        let Some((_, i, j, grid)) = best else {
            continue;
        };
        // Cells with too few samples stay empty.
        let sizes = |error: &[f64]| -> Vec<Option<f64>> {
            let sums = grid.sums(error).into_iter();
            sums.map(|(count, sum)| (count >= LEAST).then(|| (sum / count as f64).sqrt()))
                .collect()
        };
        let maps: Vec<(&str, Vec<Option<f64>>)> = [Some(("given model", sizes(&error)))]
            .into_iter()
            .chain([rest.map(|rest| ("with the effects", sizes(&rest)))])
            .flatten()
            .collect();
        // Names of the axes with units.
        let names = [i, j].map(|k| {
            let name = &variables[k].0;
            format!("{name}, {}", variable_unit(&before.model, name))
        });
        let unit = force_unit(&before.model, d);
        let picture = picture(&maps, &grid, &names, unit);
        let _ = writeln!(
            html,
            "<figure class=\"still\"><figcaption><b>rms error of {} as a function of {} and {}</b></figcaption>\n{picture}</figure>",
            escape(drive),
            escape(&variable_phrase(&before.model, &variables[i].0)),
            escape(&variable_phrase(&before.model, &variables[j].0)),
        );
    }
    html
}

/// Maps side by side with one scale of shades; `names` are the variables across and upwards, `unit` is that of
/// the error.
fn picture(maps: &[(&str, Vec<Option<f64>>)], grid: &ErrorGrid, names: &[String; 2], unit: &str) -> String {
    let (width, height, top) = (330.0, 190.0, 30.0);
    // Both maps use the scale of the larger error.
    let largest = maps
        .iter()
        .flat_map(|(_, map)| map.iter().flatten())
        .fold(0.0_f64, |m, v| m.max(*v));
    let mut picture = SvgPicture::new(860.0, top + height + 66.0);
    for (k, (title, map)) in maps.iter().enumerate() {
        // The second map is to the right of the first.
        let left = 62.0 + k as f64 * (width + 62.0);
        let x = PlotAxis::new(grid.x, [left, left + width]);
        let y = PlotAxis::new(grid.y, [top + height, top]);
        picture.text("label", [left, top - 8.0], "start", title);
        let (w, h) = (width / COLUMNS as f64, height / ROWS as f64);
        let mut shades = vec![String::new(); SHADES];
        // Cells of one shade are one path, so that the file stays small.
        for (cell, size) in map.iter().enumerate() {
            let Some(size) = size else { continue };
            let shade = float_to_count(size / largest.max(f64::MIN_POSITIVE) * SHADES as f64);
            let (column, row) = (cell % COLUMNS, cell / COLUMNS);
            let _ = write!(
                shades[shade.min(SHADES - 1)],
                "M{:.1} {:.1}h{w:.1}v{h:.1}h-{w:.1}z",
                left + column as f64 * w,
                top + height - (row + 1) as f64 * h
            );
        }
        for (shade, d) in shades.iter().enumerate().filter(|(_, d)| !d.is_empty()) {
            picture.path(&format!("heat h{shade}"), d);
        }
        picture.frame(&x, &y, &names[0], [5, 4]);
    }
    // The scale of the shades is below the maps.
    let foot = top + height + 48.0;
    for shade in 0..SHADES {
        let at = 62.0 + 16.0 * shade as f64;
        picture.rect(&format!("heat h{shade}"), [at, foot], [at + 16.0, foot + 10.0]);
    }
    let right = 62.0 + 16.0 * SHADES as f64 + 8.0;
    picture.text(
        "tick",
        [right, foot + 9.0],
        "start",
        &format!(
            "0 to {} {unit} (rms in a cell); vertical axis: {}",
            significant(largest, 2),
            names[1]
        ),
    );
    picture.finish("maps of the size of the error")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_mapped_over_the_variables_that_gather_it() {
        let n = 4000;
        let phase = |f: f64| -> Vec<f64> { (0..n).map(|i| (f * f64::from(i)).sin()).collect() };
        let (q, rate, other) = (phase(0.013), phase(0.0171), phase(0.0237));
        let error: Vec<f64> = q
            .iter()
            .zip(&rate)
            .map(|(q, v)| if *q > 0.5 && *v < 0.0 { 3.0 } else { 0.1 })
            .collect();
        let right = ErrorGrid::new(&q, &rate).unwrap().error_concentration(&error);
        let wrong = ErrorGrid::new(&other, &rate).unwrap().error_concentration(&error);
        assert!(right > 0.8 && wrong < 0.5 * right, "{right} {wrong}");
        assert!(ErrorGrid::new(&q, &vec![1.0; q.len()]).is_none());
    }

    #[test]
    fn pairs_are_motions_with_their_rates() {
        let variables: Vec<MapVariable> = ["q_d", "q_dd", "q", "left_length", "left_d", "left"]
            .into_iter()
            .map(|name| (name.to_owned(), Vec::new()))
            .collect();
        let named: Vec<(&str, &str)> = pairs(&variables)
            .into_iter()
            .map(|(i, j)| (variables[i].0.as_str(), variables[j].0.as_str()))
            .collect();
        assert!(
            named.contains(&("q", "q_d")) && named.contains(&("left_length", "left_d")),
            "{named:?}"
        );
    }
}
