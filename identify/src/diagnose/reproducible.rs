//! What of a residual would come again: a flexible function of the state is fitted to it and held against time that it has
//! not seen. What that explains no noise can be, whether a library knows its law or not.
//!
//! The functions are all products of up to three variables (two if there are many) and smooth signs of the rates, with a
//! ridge whose strength is chosen by the same folds.

use nalgebra::{DMatrix, DVector};

use super::pool::dot;
use super::problem::Layout;

/// Folds over all recordings.
const FOLDS: usize = 8;
/// Samples that are looked at, at most.
const MOST: usize = 6000;
/// Strengths of the ridge, relative to a function's own squares.
const RIDGES: [f64; 5] = [1e-6, 1e-4, 1e-2, 1e-1, 1.0];

/// Quantiles of a position beyond which stops may begin, percent from either end.
const BEYOND: [usize; 4] = [3, 8, 15, 30];
/// Lengths over which friction may remember, in units of a position's spread.
const MEMORIES: [f64; 3] = [0.02, 0.08, 0.3];

/// Half widths of what is dragged along a position, in units of its spread.
const STOPS: [f64; 4] = [0.05, 0.15, 0.4, 1.0];

/// How much of each channel's squared residual comes again where it was not fitted, between 0 and 1.
pub(crate) fn reproducible(
    layout: &Layout,
    variables: &[(String, Vec<f64>)],
    rest: &[Vec<f64>],
) -> Vec<f64> {
    let n = layout.samples();
    let step = n.div_ceil(MOST).max(1);
    let picked: Vec<usize> = (0..n).step_by(step).collect();
    let features = features(variables, &picked);
    if features.is_empty() {
        return vec![0.0; rest.len()];
    }
    let folds: Vec<Vec<usize>> = layout
        .blocks(FOLDS)
        .iter()
        .map(|block| {
            let places = picked.iter().enumerate();
            places
                .filter(|(_, at)| block.contains(at))
                .map(|(i, _)| i)
                .collect()
        })
        .collect();
    let m = features.len();
    let targets: Vec<Vec<f64>> = rest
        .iter()
        .map(|r| picked.iter().map(|i| r[*i]).collect())
        .collect();
    let pick =
        |values: &[f64], fold: &[usize]| -> Vec<f64> { fold.iter().map(|i| values[*i]).collect() };
    // Inner products fold by fold; their sum less one fold is what the others say.
    let parts: Vec<(DMatrix<f64>, Vec<DVector<f64>>)> = folds
        .iter()
        .map(|fold| {
            let columns: Vec<DVector<f64>> = features
                .iter()
                .map(|f| DVector::from(pick(f, fold)))
                .collect();
            let matrix = DMatrix::from_columns(&columns);
            let right = targets
                .iter()
                .map(|t| matrix.tr_mul(&DVector::from(pick(t, fold))))
                .collect();
            (matrix.tr_mul(&matrix), right)
        })
        .collect();
    let whole = parts
        .iter()
        .fold(DMatrix::zeros(m, m), |sum, (gram, _)| sum + gram);
    let mut best = vec![0.0_f64; rest.len()];
    let totals: Vec<f64> = targets.iter().map(|t| dot(t, t)).collect();
    for ridge in RIDGES {
        let mut left = vec![0.0; rest.len()];
        for (fold, (gram, _)) in folds.iter().zip(&parts) {
            let mut others = &whole - gram;
            for i in 0..m {
                others[(i, i)] *= 1.0 + ridge;
                others[(i, i)] += 1e-12;
            }
            let Some(factor) = others.cholesky() else {
                return best;
            };
            for (d, target) in targets.iter().enumerate() {
                let mut right = DVector::zeros(m);
                for ((other, (_, rights)), _) in folds.iter().zip(&parts).zip(0..) {
                    if !std::ptr::eq(other, fold) {
                        right += &rights[d];
                    }
                }
                let factors = factor.solve(&right);
                for i in fold {
                    let said: f64 = features
                        .iter()
                        .zip(factors.iter())
                        .map(|(f, x)| f[*i] * x)
                        .sum();
                    left[d] += (target[*i] - said).powi(2);
                }
            }
        }
        for (best, (left, total)) in best.iter_mut().zip(left.iter().zip(&totals)) {
            if *total > 0.0 {
                *best = best.max(1.0 - left / total);
            }
        }
    }
    best
}

/// Functions of the variables at some samples, each of unit size.
fn features(variables: &[(String, Vec<f64>)], picked: &[usize]) -> Vec<Vec<f64>> {
    let mut scaled: Vec<Vec<f64>> = Vec::new();
    let (mut signs, mut shapes): (Vec<Vec<f64>>, Vec<Vec<f64>>) = Default::default();
    for (name, values) in variables {
        let values: Vec<f64> = picked.iter().map(|i| values[*i]).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let spread = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
        if spread <= 0.0 || !spread.is_finite() {
            continue;
        }
        // A sign that is no jump at its zero, so that noise of the rate does no harm.
        if name.ends_with("_d") {
            let sign = |share: f64| {
                values
                    .iter()
                    .map(|x| (x / (share * spread)).tanh())
                    .collect()
            };
            signs.push(sign(0.02));
            signs.push(sign(0.2));
        }
        // Of positions also what only begins beyond a place, as stops do, and friction that remembers where it reversed.
        if !name.ends_with("_d") && !name.ends_with("_dd") {
            shapes.extend(hinges(&values, spread));
            let memories = MEMORIES.iter().map(|share| memory(&values, share * spread));
            shapes.extend(memories);
            let stops = STOPS.iter().map(|share| stop(&values, share * spread));
            shapes.extend(stops);
        }
        scaled.push(values.iter().map(|x| (x - mean) / (2.0 * spread)).collect());
    }
    let product =
        |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(x, y)| x * y).collect() };
    let mut features: Vec<Vec<f64>> = signs.iter().cloned().chain(shapes).collect();
    features.push(vec![1.0; picked.len()]);
    features.extend(scaled.iter().cloned());
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

/// How far a position is beyond some of its own quantiles, at both ends, in units of its spread.
fn hinges(values: &[f64], spread: f64) -> Vec<Vec<f64>> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len() - 1;
    let beyond = |at: usize, sign: f64| -> Vec<f64> {
        let place = sorted[at];
        let over = values
            .iter()
            .map(|x| (sign * (x - place)).max(0.0) / spread);
        over.collect()
    };
    let places = BEYOND.iter().flat_map(|share| {
        let at = last * share / 100;
        [beyond(at, -1.0), beyond(last - at, 1.0)]
    });
    places.collect()
}

/// Dahl's state of dry friction along a position: it reaches its bound over a length after each reversal
/// (P. R. Dahl, AIAA Journal 14, 1976).
fn memory(values: &[f64], length: f64) -> Vec<f64> {
    let mut state = 0.0_f64;
    let mut before = values[0];
    let step = |x: &f64| {
        let moved = x - before;
        before = *x;
        // Exact for a straight way between samples.
        let bound = moved.signum();
        state = bound + (state - bound) * (-moved.abs() / length).exp();
        state
    };
    values.iter().map(step).collect()
}

/// The stretch of a spring that drags a block along a position, relative to the largest: the operator of which hysteresis that
/// does not depend on the rate is made (L. Prandtl 1928, A. Ishlinskii 1944).
fn stop(values: &[f64], width: f64) -> Vec<f64> {
    let mut block = values[0];
    let step = |x: &f64| {
        block = block.clamp(x - width, x + width);
        (x - block) / width
    };
    values.iter().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::super::problem::Stretch;
    use super::*;
    use crate::test_noise::Noise;

    #[test]
    fn laws_come_again_and_noise_does_not() {
        let n = 3000;
        let layout = Layout {
            channels: vec!["a".into(), "b".into()],
            stretches: vec![Stretch {
                name: String::new(),
                samples: n,
                step: 0.004,
                sampled: 0.004,
                is_check: false,
            }],
            left_out: Vec::new(),
        };
        let time = |i: usize| 0.004 * i as f64;
        let q: Vec<f64> = (0..n).map(|i| (1.7 * time(i)).sin()).collect();
        let p: Vec<f64> = (0..n).map(|i| (2.9 * time(i)).cos()).collect();
        let mut noise = Noise::new(11);
        let law: Vec<f64> = (0..n)
            .map(|i| q[i] * p[i] * p[i] + 0.3 * noise.normal())
            .collect();
        let white: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        let size = law.iter().map(|x| x * x).sum::<f64>() / n as f64;
        let found = reproducible(
            &layout,
            &[("q".into(), q), ("p_d".into(), p)],
            &[law, white],
        );
        let expected = 1.0 - 0.09 / size;
        assert!((found[0] - expected).abs() < 0.03, "{found:?} {expected}");
        assert!(found[1] < 0.01, "{found:?}");
    }
}
