//! Dependence of a residual on the rate of its drive. Input: residual, position, rate and calculated force of a drive;
//! output: which forms of friction the residual looks like, with size, standard deviation and share of its squares.
//!
//! The residual is fitted by `e = c + k q + m q'' + s (f + l (|F| - mean |F|) + h r) + b q'`, where `s` is the sign of
//! the rate, `F` the calculated force, and `r` is 1 while the speed rises and -1 while it falls. The first three terms
//! are those of errors of offset, stiffness and inertia; the others are the [`RateTerm`]s. Terms that are not
//! significant are removed one by one (backward elimination). Of the others, those are reported that explain a material
//! share of the squared residual; small ones stay in the fit, since the others would be biased without them. Standard
//! deviations allow for autocorrelated residuals ([`uncertainty_with_autocorrelation`]).
//!
//! Decision: the load is the calculated force and not the measured one. The measured force contains the residual, so
//! that its magnitude follows the sign of the rate by itself.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::thresholds::{
    AGREEING_MOVEMENTS_LEAST_SHARE, EQUAL_TERM_LEAST_SHARE, FEWEST_MOVEMENTS, MOVEMENT_FEWEST_SAMPLES,
    NEAR_STANDSTILL_RATE_SHARE, RATE_TERM_LEAST_SHARE, RATE_TERM_LEAST_SIGNIFICANCE, STEADY_ACCELERATION_SHARE,
};
use crate::estimate::{
    LeastSquares, LeastSquaresError, RegressionSolution, RowVisitor, uncertainty_with_autocorrelation,
};
use crate::words::with_digits;

/// Number of columns that are fitted but not reported: offset, position and acceleration.
const NUISANCES: usize = 3;

/// Rows that are shown at once to the estimation of standard deviations.
const BLOCK: usize = 4096;

/// Samples on each side from which an acceleration is computed.
const ACCELERATION_REACH: usize = 2;

/// One segment of the residual of a drive, without gaps in time. All lists are `[sample]` and have one length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DriveResidual {
    /// Time, s.
    pub time: Vec<f64>,
    /// Measured minus calculated force, N or N m.
    pub residual: Vec<f64>,
    /// Calculated force of the drive, N or N m.
    pub load: Vec<f64>,
    /// Position of the drive, m or rad.
    pub position: Vec<f64>,
    /// Rate of the drive, m/s or rad/s.
    pub rate: Vec<f64>,
    /// Whether the force of a sample was not measured, and does not count.
    pub excluded: Vec<bool>,
}

/// What a residual depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RateTerm {
    /// The sign of the rate, as dry friction does.
    Sign,
    /// The rate, as viscous friction does.
    Rate,
    /// The sign of the rate times the magnitude of the calculated force, as load-dependent friction does.
    Load,
    /// The sign of the rate, differently while the speed rises and while it falls, as friction with hysteresis does.
    Hysteresis,
}

/// A dependence of the residual of a drive on its rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RateDependence {
    /// Name of the drive.
    pub channel: String,
    /// What the residual depends on.
    pub term: RateTerm,
    /// Its size, in `unit`. For `Sign`, half of the difference between positive and negative rate; for `Rate` the
    /// slope; for `Load` the slope over the magnitude of the calculated force; for `Hysteresis` the part that follows
    /// the sign of the rate while the speed rises, minus that while it falls.
    pub value: f64,
    /// Standard deviation of `value`, for autocorrelated residuals, in `unit`.
    pub std: f64,
    /// Unit of `value`: that of the force, the force per rate, or `1`.
    pub unit: String,
    /// Mean square of the term divided by that of the residual, of the samples at which the drive moves; at most what
    /// all terms explain together.
    pub share: f64,
    /// The residual at positive and negative rate; for `Sign` only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<ResidualLevels>,
    /// If the motion cannot distinguish `Sign` from `Rate`: the value of the other one alone, in its unit, which
    /// explains the residual equally well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alternative: Option<f64>,
    /// Description in one sentence, without a full stop.
    pub says: String,
}

/// The residual at positive and at negative rate, at the mean position and load, in the unit of the force. If it
/// follows the rate, too, these are the limits at zero rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ResidualLevels {
    /// At positive rate.
    pub positive: f64,
    /// Standard deviation of `positive`.
    pub positive_std: f64,
    /// At negative rate.
    pub negative: f64,
    /// Standard deviation of `negative`.
    pub negative_std: f64,
}

/// Finds how the residual of a drive depends on its rate: the significant terms that explain a material share of its
/// squares, at most one of each kind. `unit` is that of the force, `N` or `N m`. Samples near standstill, and samples
/// that are not finite, do not count; segments with lists of different lengths are skipped.
///
/// ```
/// use modelmill_identify::{DriveResidual, RateTerm, find_rate_dependence};
/// let time: Vec<f64> = (0..4000).map(|i| 0.01 * f64::from(i)).collect();
/// let rate: Vec<f64> = time.iter().map(|t| t.cos()).collect();
/// let segment = DriveResidual {
///     position: time.iter().map(|t| t.sin()).collect(),
///     residual: rate.iter().zip(&time).map(|(v, t)| 2.0 * v.signum() + 0.1 * (40.0 * t).sin()).collect(),
///     load: vec![10.0; 4000],
///     excluded: vec![false; 4000],
///     time,
///     rate,
/// };
/// let found = find_rate_dependence("joint2", "N m", &[segment]);
/// assert_eq!((found.len(), found[0].term), (1, RateTerm::Sign));
/// assert!((found[0].value - 2.0).abs() < 0.05);
/// ```
pub fn find_rate_dependence(channel: &str, unit: &str, segments: &[DriveResidual]) -> Vec<RateDependence> {
    let columns = RateColumns::new(segments);
    if columns.movements.len() < FEWEST_MOVEMENTS {
        return Vec::new();
    }
    let Some(fit) = significant_fit(&columns).filter(|fit| columns.agrees_with(fit)) else {
        return Vec::new();
    };
    let alternative = equal_alternative(&columns, &fit);
    let describe = |term: &RateTerm| {
        let mut one = RateDependence {
            channel: channel.to_owned(),
            term: *term,
            value: term.scale() * fit.value(*term),
            std: term.scale() * fit.std(*term),
            unit: term.unit(unit),
            share: fit.share(&columns, *term),
            levels: (*term == RateTerm::Sign).then(|| fit.levels()),
            alternative: alternative.filter(|_| !term.is_modulation()),
            says: String::new(),
        };
        one.says = sentence(&one, unit, fit.terms.contains(&RateTerm::Rate));
        one
    };
    fit.material_terms(&columns).iter().map(describe).collect()
}

impl RateTerm {
    /// All terms, in the order of the report.
    const ALL: [Self; 4] = [Self::Sign, Self::Rate, Self::Load, Self::Hysteresis];

    /// Whether the term changes the size of the part that follows the sign of the rate.
    fn is_modulation(self) -> bool {
        matches!(self, Self::Load | Self::Hysteresis)
    }

    /// Factor from the coefficient of the column to the reported value.
    fn scale(self) -> f64 {
        // The column of the hysteresis is 1 and -1, and the difference between both is reported.
        if self == Self::Hysteresis { 2.0 } else { 1.0 }
    }

    /// Unit of the value, from that of the force.
    fn unit(self, force: &str) -> String {
        match self {
            Self::Sign | Self::Hysteresis => force.to_owned(),
            Self::Rate if force == "N" => "N s/m".to_owned(),
            Self::Rate => format!("{force} s/rad"),
            Self::Load => "1".to_owned(),
        }
    }
}

/// Columns of the fit, `[sample]` over all segments; zero where a sample does not count.
struct RateColumns {
    /// Measured minus calculated force.
    residual: Vec<f64>,
    /// Offset, position and acceleration.
    nuisances: [Vec<f64>; NUISANCES],
    /// A column for each term, in the order of [`RateTerm::ALL`].
    terms: [Vec<f64>; 4],
    /// Samples between two reversals or pauses.
    movements: Vec<Range<usize>>,
    /// Number of samples that count.
    counted: f64,
}

impl RateColumns {
    /// Columns of the segments, joined.
    fn new(segments: &[DriveResidual]) -> Self {
        let has_one_length = |one: &&DriveResidual| {
            let lists = [&one.residual, &one.load, &one.position, &one.rate];
            lists.iter().all(|list| list.len() == one.time.len()) && one.excluded.len() == one.time.len()
        };
        let mut columns = Self {
            residual: Vec::new(),
            nuisances: Default::default(),
            terms: Default::default(),
            movements: Vec::new(),
            counted: 0.0,
        };
        let segments: Vec<&DriveResidual> = segments.iter().filter(has_one_length).collect();
        let rates = segments.iter().flat_map(|one| &one.rate).filter(|v| v.is_finite());
        let fastest = rates.fold(0.0_f64, |most, v| most.max(v.abs()));
        let mut is_counted = Vec::new();
        let mut acceleration = Vec::new();
        for segment in &segments {
            let first = is_counted.len();
            acceleration.extend(accelerations(&segment.time, &segment.rate));
            is_counted.extend((0..segment.time.len()).map(|i| {
                let values = [
                    segment.residual[i],
                    segment.load[i],
                    segment.position[i],
                    segment.rate[i],
                ];
                let is_moving = fastest > 0.0 && segment.rate[i].abs() >= NEAR_STANDSTILL_RATE_SHARE * fastest;
                is_moving
                    && !segment.excluded[i]
                    && values.iter().all(|x| x.is_finite())
                    && acceleration[first + i].is_finite()
            }));
            columns.add_movements(first, &is_counted[first..], &segment.rate);
        }
        let join = |list: fn(&DriveResidual) -> &Vec<f64>| -> Vec<f64> {
            let all = segments.iter().flat_map(|one| list(one)).zip(&is_counted);
            all.map(|(x, counted)| if *counted { *x } else { 0.0 }).collect()
        };
        columns.counted = is_counted.iter().filter(|counted| **counted).count() as f64;
        columns.residual = join(|one| &one.residual);
        let offset = is_counted.iter().map(|counted| f64::from(u8::from(*counted))).collect();
        let position = centred(join(|one| &one.position), &is_counted);
        for (a, counted) in acceleration.iter_mut().zip(&is_counted) {
            *a = if *counted { *a } else { 0.0 };
        }
        let rate = join(|one| &one.rate);
        let sign: Vec<f64> = rate.iter().map(|v| sign_beyond(*v, 0.0)).collect();
        let magnitude = join(|one| &one.load).iter().map(|f| f.abs()).collect();
        let load = centred(magnitude, &is_counted)
            .iter()
            .zip(&sign)
            .map(|(l, s)| l * s)
            .collect();
        // Sign of the rate times 1 for a rising and -1 for a falling speed: the sign of the acceleration.
        let steady = STEADY_ACCELERATION_SHARE * (sum_of_squares(&acceleration) / columns.counted.max(1.0)).sqrt();
        let hysteresis = acceleration.iter().map(|a| sign_beyond(*a, steady)).collect();
        columns.nuisances = [offset, position, centred(acceleration, &is_counted)];
        columns.terms = [sign, rate, load, hysteresis];
        columns
    }

    /// Divides a segment, whose first sample is `first`, into movements in one direction.
    fn add_movements(&mut self, first: usize, is_counted: &[bool], rate: &[f64]) {
        let mut start = 0;
        for i in 1..=rate.len() {
            let continues = i < rate.len() && is_counted[i - 1] && is_counted[i] && rate[i - 1] * rate[i] > 0.0;
            if continues {
                continue;
            }
            if i - start >= MOVEMENT_FEWEST_SAMPLES {
                self.movements.push(first + start..first + i);
            }
            start = i;
        }
    }

    /// The column of a term.
    fn column(&self, term: RateTerm) -> &[f64] {
        &self.terms[term as usize]
    }

    /// Columns of a fit: those that are not reported, and those of the terms.
    fn regressor(&self, terms: &[RateTerm]) -> Vec<&[f64]> {
        let nuisances = self.nuisances.iter().map(Vec::as_slice);
        nuisances.chain(terms.iter().map(|term| self.column(*term))).collect()
    }

    /// Whether the residual agrees with the terms of a fit in most movements.
    fn agrees_with(&self, fit: &RateFit) -> bool {
        let columns = self.regressor(&fit.terms);
        let part = |range: Range<usize>, i: usize| -> f64 {
            let columns = columns[range.clone()].iter().zip(&fit.solution.values[range]);
            columns.map(|(column, value)| value * column[i]).sum()
        };
        let agrees = |movement: &&Range<usize>| {
            let product = |i: usize| {
                let known = part(0..NUISANCES, i);
                (self.residual[i] - known) * part(NUISANCES..columns.len(), i)
            };
            (*movement).clone().map(product).sum::<f64>() > 0.0
        };
        let agreeing = self.movements.iter().filter(agrees).count();
        agreeing as f64 >= AGREEING_MOVEMENTS_LEAST_SHARE * self.movements.len() as f64
    }
}

/// A fit of the residual by some terms.
struct RateFit {
    /// The terms, in the order of their columns.
    terms: Vec<RateTerm>,
    solution: RegressionSolution,
    /// Standard deviations for autocorrelated residuals, `[column]`.
    std: Vec<f64>,
    /// Covariance of offset and first term.
    covariance_with_offset: f64,
    /// Part of the squared residual that the terms explain together.
    explained: f64,
}

impl RateFit {
    /// Fits the residual; `None` if there are too few samples. `unexplained` is the squared residual that remains
    /// without any term.
    fn new(columns: &RateColumns, terms: &[RateTerm], unexplained: f64) -> Option<Self> {
        let regressor = columns.regressor(terms);
        let solution = solve(&regressor, &columns.residual)?;
        let n = regressor.len();
        let mut rows = vec![0.0; n * BLOCK];
        let show = |visit: &mut RowVisitor<'_>| -> Result<(), LeastSquaresError> {
            for start in (0..columns.residual.len()).step_by(BLOCK) {
                let end = (start + BLOCK).min(columns.residual.len());
                for (j, column) in regressor.iter().enumerate() {
                    for (row, value) in rows.chunks_exact_mut(n).zip(&column[start..end]) {
                        row[j] = *value;
                    }
                }
                visit(&rows[..n * (end - start)], &columns.residual[start..end])?;
            }
            Ok(())
        };
        let uncertainty = uncertainty_with_autocorrelation(&solution, 1, show).ok()?;
        let total = sum_of_squares(&columns.residual);
        let explained = (unexplained - solution.residual_norm.powi(2)) / total;
        (!uncertainty.few_samples).then(|| Self {
            terms: terms.to_vec(),
            covariance_with_offset: uncertainty.covariance[(0, NUISANCES)],
            std: uncertainty.std,
            explained,
            solution,
        })
    }

    /// The terms to report. What changes the part that follows the sign of the rate is reported only with a significant
    /// such part.
    fn material_terms(&self, columns: &RateColumns) -> Vec<RateTerm> {
        let is_significant = |term: RateTerm| self.significance(term) >= RATE_TERM_LEAST_SIGNIFICANCE;
        let is_material = |term: &RateTerm| {
            let has_base = !term.is_modulation() || is_significant(RateTerm::Sign);
            has_base && is_significant(*term) && self.share(columns, *term) >= RATE_TERM_LEAST_SHARE
        };
        self.terms.iter().copied().filter(is_material).collect()
    }

    /// Index of the column of a term.
    fn index(&self, term: RateTerm) -> usize {
        let place = self.terms.iter().position(|one| *one == term);
        NUISANCES + place.unwrap_or_default()
    }

    /// Coefficient of a term.
    fn value(&self, term: RateTerm) -> f64 {
        self.solution.values[self.index(term)]
    }

    /// Standard deviation of the coefficient of a term.
    fn std(&self, term: RateTerm) -> f64 {
        self.std[self.index(term)]
    }

    /// Ratio of a coefficient to its standard deviation; zero if it is not determined.
    fn significance(&self, term: RateTerm) -> f64 {
        let ratio = self.value(term).abs() / self.std(term);
        if ratio.is_nan() || !self.solution.determined[self.index(term)] {
            0.0
        } else {
            ratio
        }
    }

    /// Mean square of a term divided by that of the residual, at most what all terms explain.
    fn share(&self, columns: &RateColumns, term: RateTerm) -> f64 {
        let column = columns.column(term);
        let mean = column.iter().sum::<f64>() / columns.counted;
        let squares = sum_of_squares(column) - columns.counted * mean * mean;
        let share = self.value(term).powi(2) * squares / sum_of_squares(&columns.residual);
        share.min(self.explained)
    }

    /// Residual at positive and negative rate. The first term is the sign of the rate.
    fn levels(&self) -> ResidualLevels {
        let (offset, half) = (self.solution.values[0], self.value(RateTerm::Sign));
        let variances = self.std[0].powi(2) + self.std(RateTerm::Sign).powi(2);
        let std = |sign: f64| {
            let variance = variances + 2.0 * sign * self.covariance_with_offset;
            variance.max(0.0).sqrt()
        };
        ResidualLevels {
            positive: offset + half,
            positive_std: std(1.0),
            negative: offset - half,
            negative_std: std(-1.0),
        }
    }
}

/// The fit after backward elimination; `None` if no term remains.
fn significant_fit(columns: &RateColumns) -> Option<RateFit> {
    let unexplained = unexplained_squares(columns)?;
    let mut terms = RateTerm::ALL.to_vec();
    while !terms.is_empty() {
        let fit = RateFit::new(columns, &terms, unexplained)?;
        let is_weak = |term: &RateTerm| fit.significance(*term) < RATE_TERM_LEAST_SIGNIFICANCE;
        // Modulations go first, and the part that they modulate stays as long as one of them does.
        let has_modulation = terms.iter().any(|term| term.is_modulation());
        let is_removable = |term: &&RateTerm| **term != RateTerm::Sign || !has_modulation;
        let weak: Vec<RateTerm> = terms.iter().filter(is_removable).copied().filter(is_weak).collect();
        let weakest = weak.into_iter().min_by(|a, b| {
            let order = b.is_modulation().cmp(&a.is_modulation());
            order.then(fit.significance(*a).total_cmp(&fit.significance(*b)))
        });
        match weakest {
            None => return Some(fit),
            Some(weakest) => terms.retain(|term| *term != weakest),
        }
    }
    None
}

/// If a fit has only one of sign and rate: the coefficient of the other one in its place, if it explains the residual
/// as well.
fn equal_alternative(columns: &RateColumns, fit: &RateFit) -> Option<f64> {
    let has = |term| fit.terms.contains(&term);
    let (one, other) = match (has(RateTerm::Sign), has(RateTerm::Rate)) {
        (true, false) => (RateTerm::Sign, RateTerm::Rate),
        (false, true) => (RateTerm::Rate, RateTerm::Sign),
        _ => return None,
    };
    let replace = |term: &RateTerm| if *term == one { other } else { *term };
    let terms: Vec<RateTerm> = fit.terms.iter().map(replace).collect();
    let alternative = RateFit::new(columns, &terms, unexplained_squares(columns)?)?;
    (alternative.explained >= EQUAL_TERM_LEAST_SHARE * fit.explained).then(|| alternative.value(other))
}

/// Squared residual that remains without any term.
fn unexplained_squares(columns: &RateColumns) -> Option<f64> {
    let solution = solve(&columns.regressor(&[]), &columns.residual)?;
    Some(solution.residual_norm.powi(2))
}

/// Least squares of columns; `None` without samples, or if a number is not finite.
fn solve(regressor: &[&[f64]], measured: &[f64]) -> Option<RegressionSolution> {
    let mut regression = LeastSquares::new(regressor.len());
    regression.add_columns(0, regressor, measured).ok()?;
    regression.solve().ok()
}

/// A dependence in one sentence. `has_rate` states whether the residual follows the rate, too.
fn sentence(one: &RateDependence, force_unit: &str, has_rate: bool) -> String {
    let (channel, unit) = (&one.channel, &one.unit);
    let size = with_digits(one.value.abs(), 3);
    let share = format!("{:.0} % of its squared residual", 100.0 * one.share);
    let std = format!("standard deviation {}", with_digits(one.std, 2));
    let is_missing = one.value > 0.0;
    match one.term {
        RateTerm::Sign => {
            let levels = one.levels.map_or([0.0; 2], |levels| [levels.positive, levels.negative]);
            let [positive, negative] = levels.map(with_sign);
            let limit = if has_rate { "small " } else { "" };
            let cause = if is_missing {
                format!("dry friction of {size} {unit} ({std} {unit}) does")
            } else {
                format!("{size} {unit} ({std} {unit}) less dry friction than in the model does")
            };
            let alternative = one.alternative.map_or_else(String::new, |slope| {
                let unit = RateTerm::Rate.unit(force_unit);
                format!(
                    "; the motion cannot distinguish it from {} {unit} of viscous friction",
                    with_digits(slope, 3)
                )
            });
            format!(
                "The residual of {channel} follows the sign of its velocity: {positive} {unit} at {limit}positive velocity, \
                 {negative} {unit} at {limit}negative velocity ({share}), as {cause}{alternative}"
            )
        }
        RateTerm::Rate => {
            let cause = if is_missing {
                "viscous friction does"
            } else {
                "less viscous friction than in the model does"
            };
            let alternative = one.alternative.map_or_else(String::new, |dry| {
                format!(
                    "; the motion cannot distinguish it from {} {force_unit} of dry friction",
                    with_digits(dry, 3)
                )
            });
            format!(
                "The residual of {channel} follows its velocity with a slope of {} {unit} ({std} {unit}; {share}), as \
                 {cause}{alternative}",
                with_sign(one.value)
            )
        }
        RateTerm::Load => format!(
            "The part of the residual of {channel} that follows the sign of its velocity changes by {} {force_unit} for \
             each {force_unit} of calculated force ({std}; {share}), as load-dependent friction does",
            with_sign(one.value)
        ),
        RateTerm::Hysteresis => format!(
            "The part of the residual of {channel} that follows the sign of its velocity is {size} {unit} {} while the \
             speed rises than while it falls ({std} {unit}; {share}), as friction with hysteresis does",
            if is_missing { "larger" } else { "smaller" }
        ),
    }
}

/// A number with three digits and its sign.
fn with_sign(value: f64) -> String {
    let sign = if value < 0.0 { "-" } else { "+" };
    format!("{sign}{}", with_digits(value.abs(), 3))
}

/// Sign of a value; zero up to the bound in size.
fn sign_beyond(value: f64, bound: f64) -> f64 {
    if value.abs() > bound { value.signum() } else { 0.0 }
}

/// Sum of the squares of a list.
fn sum_of_squares(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum()
}

/// A column minus its mean over the samples that count.
fn centred(mut column: Vec<f64>, is_counted: &[bool]) -> Vec<f64> {
    let counted = is_counted.iter().filter(|counted| **counted).count().max(1);
    let mean = column.iter().sum::<f64>() / counted as f64;
    for (x, _) in column.iter_mut().zip(is_counted).filter(|(_, counted)| **counted) {
        *x -= mean;
    }
    column
}

/// Accelerations from rates by central differences.
fn accelerations(time: &[f64], rate: &[f64]) -> Vec<f64> {
    let last = rate.len().saturating_sub(1);
    let difference = |i: usize| {
        let (from, to) = (i.saturating_sub(ACCELERATION_REACH), (i + ACCELERATION_REACH).min(last));
        (rate[to] - rate[from]) / (time[to] - time[from])
    };
    (0..rate.len()).map(difference).collect()
}

#[cfg(test)]
mod tests;
