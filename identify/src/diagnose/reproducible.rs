//! The repeatable part of a residual. A flexible function of the state is fitted to it and tested on time that was not
//! fitted. What it explains there cannot be noise, whether a library has a law for it or not. Input: residual and state
//! variables; output: the repeatable share of each channel.
//!
//! The functions are all products of up to three variables (two if there are many) and smooth signs of the rates, with
//! a ridge whose strength is chosen by the same folds.
//!
//! Decision: a residual above the noise may be a law or coloured noise, and its autocorrelation does not distinguish
//! them. A flexible function of the state does: what it explains in folds that were not fitted is repeatable. A
//! residual that is not repeatable is reported as noise, however strongly its neighbours are correlated.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::problem::SampleLayout;

/// Number of folds in each segment.
const FOLDS: usize = 8;
/// Largest number of samples; the number of features from which on fewer samples are used, and that number.
const MOST: usize = 6000;
const MOST_FEATURES: usize = 1500;
const MOST_OF_MANY: usize = 1500;
/// Strengths of the ridge regularisation, relative to the squares of each feature.
const RIDGES: [f64; 5] = [1e-6, 1e-4, 1e-2, 1e-1, 1.0];

/// Quantiles of a position beyond which end stops may begin, percent from either end.
const HINGE_QUANTILES: [usize; 4] = [3, 8, 15, 30];
/// Lengths over which friction depends on the past motion, in units of a position's standard deviation.
const MEMORIES: [f64; 3] = [0.02, 0.08, 0.3];

/// Half widths of the play of hysteresis along a position, in units of its standard deviation.
const STOPS: [f64; 4] = [0.05, 0.15, 0.4, 1.0];

/// Share of each channel's squared residual that is repeatable on data that was not fitted, 0 to 1, `[channel]`.
pub(crate) fn repeatable_shares(
    layout: &SampleLayout,
    variables: &[(String, Vec<f64>)],
    rest: &[Vec<f64>],
) -> Vec<f64> {
    // Take equally spaced samples.
    let n = layout.samples();
    // Many features need many operations, so fewer samples are used then.
    let count = feature_count(variables.len());
    let most = if count > MOST_FEATURES { MOST_OF_MANY } else { MOST };
    let picked: Vec<usize> = (0..n).step_by(n.div_ceil(most).max(1)).collect();
    let features = state_features(variables, &picked);
    if features.is_empty() {
        return vec![0.0; rest.len()];
    }
    // Blocks of samples become ranges among the selected samples.
    let folds: Vec<Range<usize>> = (layout.blocks(FOLDS).iter())
        .map(|block| {
            let at = |sample: usize| picked.partition_point(|i| *i < sample);
            at(block.start)..at(block.end)
        })
        .collect();
    // Residuals of all channels at the selected samples, as columns.
    let target = |r: &Vec<f64>| DVector::from_iterator(picked.len(), picked.iter().map(|i| r[*i]));
    let targets: Vec<DVector<f64>> = rest.iter().map(target).collect();
    let targets = DMatrix::from_columns(&targets);
    let columns: Vec<DVector<f64>> = features.into_iter().map(DVector::from).collect();
    let features = DMatrix::from_columns(&columns);
    // Solve in the smaller dimension: features or samples.
    let held_out = if features.ncols() <= features.nrows() {
        errors_by_features(&features, &targets, &folds)
    } else {
        errors_by_samples(features, &targets, &folds)
    };
    let totals = targets.column_iter().map(|target| target.norm_squared());
    // The best ridge of each channel; a negative share means that nothing is repeatable.
    let share = |(d, total): (usize, f64)| {
        let explained = held_out.iter().map(|left| 1.0 - left[d] / total);
        let best = explained.fold(0.0, f64::max);
        if total > 0.0 { best } else { 0.0 }
    };
    totals.enumerate().map(share).collect()
}

/// Squared errors on folds that were not fitted, `[ridge][target]`; strengths after one that fails are missing.
type FoldErrors = Vec<Vec<f64>>;

/// Validation errors from normal equations of the features. Their matrices are computed per fold; the sum minus one
/// fold belongs to the other folds.
fn errors_by_features(features: &DMatrix<f64>, targets: &DMatrix<f64>, folds: &[Range<usize>]) -> FoldErrors {
    let m = features.ncols();
    let rows = |of: &DMatrix<f64>, fold: &Range<usize>| of.rows_range(fold.clone()).into_owned();
    // Products of the features with themselves and with the targets, fold by fold.
    let parts: Vec<[DMatrix<f64>; 2]> = (folds.iter())
        .map(|fold| {
            let own = rows(features, fold);
            let transposed = own.transpose();
            [&transposed * own, transposed * rows(targets, fold)]
        })
        .collect();
    let mut whole = [DMatrix::zeros(m, m), DMatrix::zeros(m, targets.ncols())];
    for part in &parts {
        for (sum, part) in whole.iter_mut().zip(part) {
            *sum += part;
        }
    }
    let of_ridge = |ridge: &f64| {
        let mut left = vec![0.0; targets.ncols()];
        for (fold, [gram, right]) in folds.iter().zip(&parts) {
            // Fit on all other folds.
            let mut others = &whole[0] - gram;
            for i in 0..m {
                others[(i, i)] *= 1.0 + ridge;
                others[(i, i)] += 1e-12;
            }
            let factors = others.cholesky()?.solve(&(&whole[1] - right));
            add_errors(&mut left, rows(features, fold) * factors, &rows(targets, fold));
        }
        Some(left)
    };
    RIDGES.iter().map_while(of_ridge).collect()
}

/// The same if there are more features than samples: kernel ridge regression from inner products of the samples (C.
/// Saunders, A. Gammerman and V. Vovk, ICML 1998).
fn errors_by_samples(mut features: DMatrix<f64>, targets: &DMatrix<f64>, folds: &[Range<usize>]) -> FoldErrors {
    for mut column in features.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    let products = &features * features.transpose();
    let n = products.nrows();
    let of_ridge = |ridge: &f64| {
        let mut left = vec![0.0; targets.ncols()];
        for fold in folds {
            // Samples outside of the fold.
            let others: Vec<usize> = (0..n).filter(|i| !fold.contains(i)).collect();
            let mut own = products.select_rows(&others).select_columns(&others);
            for i in 0..others.len() {
                own[(i, i)] += ridge + 1e-12;
            }
            let factors = own.cholesky()?.solve(&targets.select_rows(&others));
            let across = products.rows_range(fold.clone()).select_columns(&others);
            let target = targets.rows_range(fold.clone()).into_owned();
            add_errors(&mut left, across * factors, &target);
        }
        Some(left)
    };
    RIDGES.iter().map_while(of_ridge).collect()
}

/// Adds the squared errors of a prediction to the sum of each target.
fn add_errors(left: &mut [f64], predicted: DMatrix<f64>, target: &DMatrix<f64>) {
    for (left, column) in left.iter_mut().zip((target - predicted).column_iter()) {
        *left += column.norm_squared();
    }
}

/// Number of products of two variables, squares included.
fn feature_count(variables: usize) -> usize {
    variables * (variables + 1) / 2
}

/// Features: functions of the variables at some samples, `[feature][sample]`. Names that end with `_d` are rates, with
/// `_dd` accelerations, others positions.
fn state_features(variables: &[(String, Vec<f64>)], picked: &[usize]) -> Vec<Vec<f64>> {
    let mut scaled: Vec<Vec<f64>> = Vec::new();
    let (mut signs, mut shapes): (Vec<Vec<f64>>, Vec<Vec<f64>>) = Default::default();
    for (name, values) in variables {
        let values: Vec<f64> = picked.iter().map(|i| values[*i]).collect();
        let n = values.len() as f64;
        // Scale each variable by its mean and standard deviation.
        let mean = values.iter().sum::<f64>() / n;
        let spread = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
        if spread <= 0.0 || !spread.is_finite() {
            continue;
        }
        // A sign that is smooth at zero, so that noise of the rate does no harm.
        if name.ends_with("_d") {
            let sign = |share: f64| values.iter().map(|x| (x / (share * spread)).tanh()).collect();
            // Two widths: nearly a jump, and a smooth transition.
            signs.push(sign(0.02));
            signs.push(sign(0.2));
        }
        // For positions also functions that begin beyond a place, as end stops do, and friction states that depend on
        // earlier reversals.
        if !name.ends_with("_d") && !name.ends_with("_dd") {
            shapes.extend(hinges(&values, spread));
            let memories = MEMORIES.iter().map(|share| dahl_state(&values, share * spread));
            shapes.extend(memories);
            let stops = STOPS.iter().map(|share| stop_operator(&values, share * spread));
            shapes.extend(stops);
        }
        scaled.push(values.iter().map(|x| (x - mean) / (2.0 * spread)).collect());
    }
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(x, y)| x * y).collect() };
    // Signs and shapes alone, a constant, the variables, and their products.
    let mut features: Vec<Vec<f64>> = signs.iter().cloned().chain(shapes).collect();
    features.push(vec![1.0; picked.len()]);
    features.extend(scaled.iter().cloned());
    // Products of up to three variables if there are few, else two.
    let degree = if scaled.len() <= 6 { 3 } else { 2 };
    for i in 0..scaled.len() {
        for j in i..scaled.len() {
            let two = product(&scaled[i], &scaled[j]);
            if degree > 2 {
                for third in &scaled[j..] {
                    features.push(product(&two, third));
                }
            }
            features.push(two);
        }
        if degree > 2 {
            features.extend(signs.iter().map(|sign| product(sign, &scaled[i])));
        }
    }
    features
}

/// Distance of a position beyond some of its quantiles, at both ends, in units of its standard deviation.
fn hinges(values: &[f64], spread: f64) -> Vec<Vec<f64>> {
    // Quantiles from the sorted values.
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len() - 1;
    let beyond = |at: usize, sign: f64| -> Vec<f64> {
        let place = sorted[at];
        let over = values.iter().map(|x| (sign * (x - place)).max(0.0) / spread);
        over.collect()
    };
    let places = HINGE_QUANTILES.iter().flat_map(|share| {
        let at = last * share / 100;
        [beyond(at, -1.0), beyond(last - at, 1.0)]
    });
    places.collect()
}

/// Dahl's state of dry friction along a position: it reaches its bound over a length after each reversal
/// (P. R. Dahl, AIAA Journal 14, 1976).
fn dahl_state(values: &[f64], length: f64) -> Vec<f64> {
    let mut state = 0.0_f64;
    let mut before = values[0];
    let step = |x: &f64| {
        let moved = x - before;
        before = *x;
        // Exact for a linear motion between samples.
        let bound = moved.signum();
        state = bound + (state - bound) * (-moved.abs() / length).exp();
        state
    };
    values.iter().map(step).collect()
}

/// Elongation of a spring that drags a block along a position, relative to its largest value: the stop operator, from
/// which rate-independent hysteresis is composed (L. Prandtl 1928, A. Ishlinskii 1944).
fn stop_operator(values: &[f64], width: f64) -> Vec<f64> {
    let mut block = values[0];
    let step = |x: &f64| {
        block = block.clamp(x - width, x + width);
        (x - block) / width
    };
    values.iter().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::super::problem::SampleSegment;
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn laws_come_again_and_noise_does_not() {
        let n = 3000;
        let layout = SampleLayout {
            channels: vec!["a".into(), "b".into()],
            segments: vec![SampleSegment {
                name: String::new(),
                samples: n,
                start: 0.0,
                step: 0.004,
                recorded_step: 0.004,
                is_check: false,
            }],
            left_out: Vec::new(),
        };
        let time = |i: usize| 0.004 * i as f64;
        let q: Vec<f64> = (0..n).map(|i| (1.7 * time(i)).sin()).collect();
        let p: Vec<f64> = (0..n).map(|i| (2.9 * time(i)).cos()).collect();
        let mut noise = TestNoise::new(11);
        let law: Vec<f64> = (0..n).map(|i| q[i] * p[i] * p[i] + 0.3 * noise.normal()).collect();
        let white: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        let size = law.iter().map(|x| x * x).sum::<f64>() / n as f64;
        let found = repeatable_shares(&layout, &[("q".into(), q), ("p_d".into(), p)], &[law, white]);
        let expected = 1.0 - 0.09 / size;
        assert!((found[0] - expected).abs() < 0.03, "{found:?} {expected}");
        assert!(found[1] < 0.01, "{found:?}");
    }

    /// Few features and many samples, or the other way round: the errors are the same.
    #[test]
    fn errors_by_features_and_by_samples_agree() {
        let mut noise = TestNoise::new(3);
        let features = DMatrix::from_fn(60, 25, |_, _| noise.normal());
        let targets = DMatrix::from_fn(60, 2, |i, d| features[(i, d)] + noise.normal());
        let folds = [0..20, 20..45, 45..60];
        let mut scaled = features.clone();
        for mut column in scaled.column_iter_mut() {
            column.normalize_mut();
        }
        let [by_features, by_samples] = [
            errors_by_features(&scaled, &targets, &folds),
            errors_by_samples(features, &targets, &folds),
        ];
        assert_eq!((by_features.len(), by_samples.len()), (5, 5));
        // A ridge counts the squares of what is fitted in the one, of all samples in the other.
        let [weakest, strongest] = [0, 4];
        for d in 0..2 {
            let ratio = by_features[weakest][d] / by_samples[weakest][d];
            assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
            let ratio = by_features[strongest][d] / by_samples[strongest][d];
            assert!((0.7..1.3).contains(&ratio), "{ratio}");
        }
    }
}
