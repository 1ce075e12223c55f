//! Regions where the error is largest: a sentence and a picture for each, with mean and standard deviation of
//! the error over the variable of the region.

use std::cmp::Ordering;
use std::fmt::Write as _;

use modelmill_identify::{ErrorRegion, TIME_COLUMN, float_to_count};

use super::draw::{PlotAxis, SvgPicture, range, with_room};
use super::maps::MapVariable;
use super::units::{force_unit, variable_unit};
use crate::compare::{region_range, variable_phrase};
use crate::diagnose::ModelVersion;
use crate::model::Model;
use crate::text::svg::escape;

/// Segments of the variable in a picture.
const BINS: usize = 44;
/// Width of a picture.
const WIDTH: f64 = 420.0;
/// Height of a picture.
const HEIGHT: f64 = 190.0;
/// Space for the ticks at the left.
const LEFT: f64 = 58.0;

/// A figure for each region of the error of the model as it is.
pub(crate) fn figures(
    regions: &[ErrorRegion],
    before: &ModelVersion,
    after: Option<&ModelVersion>,
    variables: &[MapVariable],
) -> String {
    let mut html = String::from("<div class=\"grid\">\n");
    for region in regions {
        // A region without samples has a sentence only.
        let picture = picture(region, before, after, variables).unwrap_or_default();
        let _ = writeln!(
            html,
            "<figure class=\"still\"><figcaption>{}.</figcaption>\n{picture}</figure>",
            escape(&sentence(region, &before.model))
        );
    }
    html.push_str("</div>\n");
    html
}

/// A region in one sentence; every number has its unit.
pub(crate) fn sentence(region: &ErrorRegion, model: &Model) -> String {
    let unit = variable_unit(model, &region.variable);
    // Units make the sentence readable without the picture.
    let name = if region.variable == TIME_COLUMN {
        "time".to_owned()
    } else {
        variable_phrase(model, &region.variable)
    };
    let interval = format!("{name} {}", region_range(region, &unit));
    // Times of several recordings overlap, so a region in time names its file.
    let file = region.says.split_once(": ").map(|(file, _)| file);
    let of = match file {
        Some(file) if region.variable == TIME_COLUMN => format!(" in {file}"),
        _ => String::new(),
    };
    format!(
        "{:.0} % of the squared error of {}{of} is in the samples with {} ({:.0} % of all samples)",
        100.0 * region.share,
        region.channel,
        interval.replace('-', "−"),
        100.0 * region.samples
    )
}

/// Picture of a region: mean and standard deviation of the error over the variable, before and after. `None`
/// without samples.
fn picture(
    region: &ErrorRegion,
    before: &ModelVersion,
    after: Option<&ModelVersion>,
    variables: &[MapVariable],
) -> Option<String> {
    let model = &before.model;
    let d = model.row_names().iter().position(|d| *d == region.channel)?;
    let judged = before.validation_runs();
    // A segment of time belongs to one recording, which its sentence names if there are several.
    let runs: Vec<usize> = if region.variable == TIME_COLUMN {
        let named = |k: &usize| region.says.starts_with(&format!("{}: ", before.runs[*k].name));
        vec![judged.iter().copied().find(named).unwrap_or(*judged.first()?)]
    } else {
        judged
    };
    // The variable along the same runs as the errors.
    let over: Vec<f64> = if region.variable == TIME_COLUMN {
        before.runs[*runs.first()?].time.clone()
    } else {
        let (_, values) = variables.iter().find(|(name, _)| *name == region.variable)?;
        values.clone()
    };
    // Errors before and after the effects.
    let mut curves = vec![("c-before", before.errors(&runs, d))];
    if let Some(after) = after {
        curves.push(("c-after", after.errors(&runs, d)));
    }
    // With a delay the model with effects may have other samples.
    curves.retain(|(_, error)| error.len() == over.len());
    let bins: Vec<(&str, Vec<ErrorBin>)> = curves
        .iter()
        .map(|(class, error)| (*class, bin_errors(&over, error)))
        .collect();
    // The axis upwards covers mean and standard deviation of all curves.
    let bounds: Vec<f64> = bins
        .iter()
        .flat_map(|(_, bins)| bins.iter().flat_map(|b| [b.mean - b.spread, b.mean + b.spread]))
        .collect();
    if bounds.is_empty() {
        return None;
    }
    // The axis across covers all samples.
    let x = PlotAxis::new(range(&over), [LEFT, WIDTH - 10.0]);
    let y = PlotAxis::new(with_room(range(&bounds), 0.06), [HEIGHT - 36.0, 8.0]);
    let mut picture = SvgPicture::new(WIDTH, HEIGHT);
    let [low, high] = region.range.map(|v| x.position(v));
    // The region is shaded below the curves.
    picture.rect("region", [low, y.start], [high.max(low + 1.0), y.end]);
    let unit = variable_unit(model, &region.variable);
    let name = if region.variable == TIME_COLUMN {
        "time".to_owned()
    } else {
        variable_phrase(model, &region.variable)
    };
    let title = format!("{name}, {unit} (error in {})", force_unit(model, d));
    picture.frame(&x, &y, &title, [5, 4]);
    // A band of one standard deviation, and the mean as a line in it.
    for (class, bins) in &bins {
        let (mut upper, mut lower, mut mean) = (String::new(), String::new(), String::new());
        for (k, bin) in bins.iter().enumerate() {
            // The band is a closed path: up along one side, back along the other.
            let at = x.position(bin.at);
            let pen = if k == 0 { 'M' } else { 'L' };
            let _ = write!(mean, "{pen}{at:.1} {:.1}", y.position(bin.mean));
            let _ = write!(upper, "{pen}{at:.1} {:.1}", y.position(bin.mean + bin.spread));
            lower = format!("L{at:.1} {:.1}{lower}", y.position(bin.mean - bin.spread));
        }
        picture.path(&format!("band {class}"), &format!("{upper}{lower}Z"));
        picture.path(&format!("curve {class}"), &mean);
    }
    Some(picture.finish(&region.says))
}

/// Error statistics in a segment of a variable.
struct ErrorBin {
    /// Middle of the segment, in the unit of the variable.
    at: f64,
    /// Mean of the error, N or N m.
    mean: f64,
    /// Standard deviation of the error.
    spread: f64,
}

/// Mean and standard deviation of an error in segments of equal length; segments with fewer than three samples
/// are left out.
fn bin_errors(over: &[f64], error: &[f64]) -> Vec<ErrorBin> {
    let [low, high] = range(over);
    if high.partial_cmp(&low) != Some(Ordering::Greater) {
        return Vec::new();
    }
    // Number, sum and sum of squares of the error in each segment.
    let mut sums = vec![(0.0, 0.0, 0.0); BINS];
    for (v, e) in over.iter().zip(error).filter(|(v, e)| v.is_finite() && e.is_finite()) {
        let k = float_to_count((v - low) / (high - low) * BINS as f64);
        let sum = &mut sums[k.min(BINS - 1)];
        *sum = (sum.0 + 1.0, sum.1 + e, sum.2 + e * e);
    }
    // Means of very few samples would only show noise.
    let bins = sums.iter().enumerate().filter(|(_, (n, _, _))| *n >= 3.0);
    bins.map(|(k, (n, sum, squares))| {
        let mean = sum / n;
        ErrorBin {
            at: low + (k as f64 + 0.5) / BINS as f64 * (high - low),
            mean,
            spread: (squares / n - mean * mean).max(0.0).sqrt(),
        }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_mean_and_spread() {
        let over: Vec<f64> = (0..4400).map(|i| f64::from(i) / 4400.0).collect();
        let error: Vec<f64> = (0..4400)
            .map(|i| if i < 2200 { 1.0 } else { 5.0 } + if i % 2 == 0 { 0.5 } else { -0.5 })
            .collect();
        let bins = bin_errors(&over, &error);
        assert_eq!(bins.len(), BINS);
        assert!((bins[3].mean - 1.0).abs() < 1e-9 && (bins[40].mean - 5.0).abs() < 1e-9);
        assert!(bins.iter().all(|b| (b.spread - 0.5).abs() < 1e-9));
        assert!(bin_errors(&[1.0; 50], &[1.0; 50]).is_empty());
    }
}
