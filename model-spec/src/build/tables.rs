//! Tables of a coordinate that follows others, such as the lift of a cam over its angle.
//!
//! Points go in; an expression with continuous second derivatives comes out, so that all later stages need no tables. A
//! table over an interval is a natural cubic spline, written as a straight line and cubes of distances to the points,
//! `a + b x + sum of c_k |x - x_k|^3` (de Boor, A Practical Guide to Splines). Beyond its ends it is continued by straight
//! lines. A table over one turn is a trigonometric polynomial through the points.

use num_rational::BigRational;

use crate::at_values::exact_decimal;
use crate::build::thresholds::{LARGEST_TABLE_GAP, TABLE_CLOSURE};
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::{ExactExpression, ExactFunction};
use crate::numeric::least_squares;
use crate::record::EntryList;
use crate::values::TableRow;

/// Most points of a table: each adds a term to the equations of motion.
const MOST_POINTS: usize = 100;

/// The table as a function of `argument`; faults are reported.
///
/// `is_periodic`: the table covers one turn of `argument`, rad.
pub(super) fn table_function(
    table: &EntryList<TableRow>,
    argument: &ExactExpression,
    is_periodic: bool,
    log: &mut DiagnosticLog,
) -> Option<ExactExpression> {
    let points: Vec<[f64; 2]> = table.entries.iter().map(|row| row.values).collect();
    if table.faulty || !check_points(table, is_periodic, log) {
        return None;
    }
    if is_periodic {
        turn_polynomial(&points, argument, table.span, log)
    } else {
        spline(&points, argument)
    }
}

/// Reports tables with too few or too many points, in the wrong order, or of more than one turn; true if there are no
/// faults.
fn check_points(table: &EntryList<TableRow>, is_periodic: bool, log: &mut DiagnosticLog) -> bool {
    let rows = &table.entries;
    let before = log.n_errors();
    if rows.len() < 4 || rows.len() > MOST_POINTS {
        log.push(
            Diagnostic::error(table.span, format!("this table has {} points", rows.len()))
                .label(format!("expected 4 to {MOST_POINTS} points")),
        );
        return false;
    }
    for pair in rows.windows(2) {
        if pair[1].values[0] <= pair[0].values[0] {
            log.push(
                Diagnostic::error(pair[1].span, "the arguments of a table must increase")
                    .label(format!("expected more than {}", pair[0].values[0])),
            );
            return false;
        }
    }
    let (first, last) = (rows[0].values, rows[rows.len() - 1]);
    let turn = std::f64::consts::TAU;
    if is_periodic && last.values[0] - first[0] > turn - TABLE_CLOSURE {
        log.push(
            Diagnostic::error(
                last.span,
                "a periodic table covers one turn, and its end is its beginning",
            )
            .label(format!("expected an argument below {:.6} rad", first[0] + turn))
            .help("delete the last point if it repeats the first one after 2 pi"),
        );
    }
    log.n_errors() == before
}

/// A number of a table as an exact decimal.
fn number(value: f64) -> ExactExpression {
    ExactExpression::Rational(exact_decimal(value))
}

/// A computed coefficient with all its digits.
fn coefficient(value: f64) -> Option<ExactExpression> {
    Some(ExactExpression::Rational(BigRational::from_float(value)?))
}

/// The natural cubic spline; `None` if a coefficient is not finite.
fn spline(points: &[[f64; 2]], argument: &ExactExpression) -> Option<ExactExpression> {
    let n = points.len();
    let step: Vec<f64> = points.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let slope: Vec<f64> = points
        .windows(2)
        .zip(&step)
        .map(|(pair, h)| (pair[1][1] - pair[0][1]) / h)
        .collect();
    // Second derivatives at the inner points, by elimination of the tridiagonal system; those at the ends are zero.
    let mut diagonal = vec![0.0; n];
    let mut right = vec![0.0; n];
    for k in 1..n - 1 {
        diagonal[k] = 2.0 * (step[k - 1] + step[k]);
        right[k] = 6.0 * (slope[k] - slope[k - 1]);
        if k > 1 {
            let factor = step[k - 1] / diagonal[k - 1];
            diagonal[k] -= factor * step[k - 1];
            right[k] -= factor * right[k - 1];
        }
    }
    let mut second = vec![0.0; n];
    for k in (1..n - 1).rev() {
        second[k] = (right[k] - step[k] * second[k + 1]) / diagonal[k];
    }
    // Jumps of the third derivative, which is zero outside; that of |x|^3 is 12.
    let third: Vec<f64> = (0..n - 1).map(|k| (second[k + 1] - second[k]) / step[k]).collect();
    let jump = |k: usize| {
        let after = third.get(k).copied().unwrap_or(0.0);
        after - k.checked_sub(1).map_or(0.0, |before| third[before])
    };
    let cubes: Vec<f64> = (0..n).map(|k| jump(k) / 12.0).collect();
    let of_cubes = |x: f64| -> f64 {
        let terms = cubes.iter().zip(points);
        terms.map(|(c, point)| c * (x - point[0]).abs().powi(3)).sum()
    };
    // The remainder is a straight line, which the two end points determine.
    let (first, last) = (points[0], points[n - 1]);
    let rest = [first, last].map(|[x, y]| y - of_cubes(x));
    let incline = (rest[1] - rest[0]) / (last[0] - first[0]);
    let from = |x: f64| ExactExpression::Sum(vec![argument.clone(), ExactExpression::Negative(Box::new(number(x)))]);
    let mut terms = vec![
        coefficient(rest[0])?,
        ExactExpression::Product(vec![coefficient(incline)?, from(first[0])]),
    ];
    for (c, point) in cubes.iter().zip(points) {
        if *c != 0.0 {
            let distance = ExactExpression::Apply(ExactFunction::Abs, Box::new(from(point[0])));
            let cube = ExactExpression::Power(Box::new(distance), 3);
            terms.push(ExactExpression::Product(vec![coefficient(*c)?, cube]));
        }
    }
    Some(ExactExpression::Sum(terms))
}

/// The trigonometric polynomial through the points of one turn; points at very uneven distances are reported, since the
/// polynomial would swing between them.
fn turn_polynomial(
    points: &[[f64; 2]],
    argument: &ExactExpression,
    span: SourceSpan,
    log: &mut DiagnosticLog,
) -> Option<ExactExpression> {
    let n = points.len();
    let largest = (0..n)
        .map(|k| {
            let next = if k + 1 < n {
                points[k + 1][0]
            } else {
                points[0][0] + std::f64::consts::TAU
            };
            next - points[k][0]
        })
        .fold(0.0, f64::max);
    let even = std::f64::consts::TAU / f64::from(u32::try_from(n).ok()?);
    if largest > LARGEST_TABLE_GAP * even {
        log.push(
            Diagnostic::error(span, "the points of this periodic table are at very different distances")
                .label(format!("the largest distance is {largest:.3} rad, and the mean one is {even:.3} rad"))
                .help("a periodic table is interpolated by a Fourier series, which would swing there; give points at equal distances"),
        );
        return None;
    }
    // Cosines and sines up to (n - 1)/2; an even number of points has one more cosine, measured from the first point.
    let mut shapes: Vec<(u32, bool, f64)> = vec![(0, false, 0.0)];
    for order in 1..=u32::try_from((n - 1) / 2).ok()? {
        shapes.extend([(order, false, 0.0), (order, true, 0.0)]);
    }
    if n.is_multiple_of(2) {
        shapes.push((u32::try_from(n / 2).ok()?, false, points[0][0]));
    }
    let value = |(order, is_sine, from): &(u32, bool, f64), x: f64| {
        let angle = f64::from(*order) * (x - from);
        if *is_sine { angle.sin() } else { angle.cos() }
    };
    let matrix: Vec<Vec<f64>> = points
        .iter()
        .map(|point| shapes.iter().map(|shape| value(shape, point[0])).collect())
        .collect();
    let mut weights = vec![0.0; n];
    // The second pass removes the rounding of the first.
    for _ in 0..2 {
        let rest: Vec<f64> = matrix
            .iter()
            .zip(points)
            .map(|(row, point)| point[1] - row.iter().zip(&weights).map(|(a, b)| a * b).sum::<f64>())
            .collect();
        for (weight, change) in weights.iter_mut().zip(least_squares(&matrix, &rest, 0.0)?) {
            *weight += change;
        }
    }
    let mut terms = Vec::new();
    for ((order, is_sine, from), weight) in shapes.iter().zip(&weights) {
        let function = if *is_sine {
            ExactFunction::Sin
        } else {
            ExactFunction::Cos
        };
        // cos(n (x - from)) is written with cosine and sine of n x, whose angles are exact.
        let turned = f64::from(*order) * from;
        let parts: &[(ExactFunction, f64)] = if *from == 0.0 {
            &[(function, *weight)]
        } else {
            &[
                (ExactFunction::Cos, weight * turned.cos()),
                (ExactFunction::Sin, weight * turned.sin()),
            ]
        };
        for (function, factor) in parts {
            if *order == 0 {
                terms.push(coefficient(*factor)?);
                continue;
            }
            let order = ExactExpression::Rational(BigRational::from_integer((*order).into()));
            let angle = ExactExpression::Product(vec![order, argument.clone()]);
            terms.push(ExactExpression::Product(vec![
                coefficient(*factor)?,
                ExactExpression::Apply(*function, Box::new(angle)),
            ]));
        }
    }
    Some(ExactExpression::Sum(terms))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::{CoordinateIdx, ModelSymbol};

    fn argument() -> ExactExpression {
        ExactExpression::Symbol(ModelSymbol::Coordinate(CoordinateIdx(0)))
    }

    /// Values of a spline and its first two derivatives by differences of the slope.
    fn values(exact: &ExactExpression, x: f64) -> [f64; 3] {
        let slope = |x: f64| exact.slope(CoordinateIdx(0), &|_| x);
        [
            exact.evaluate(&|_| x),
            slope(x),
            (slope(x + 1e-5) - slope(x - 1e-5)) / 2e-5,
        ]
    }

    #[test]
    fn a_spline_meets_its_points_and_is_smooth() {
        let points: Vec<[f64; 2]> = (0..100)
            .map(|k| {
                let x = 0.05 * f64::from(k) + 0.01 * f64::from(k % 3);
                [x, 0.02 * x.sin()]
            })
            .collect();
        let exact = spline(&points, &argument()).unwrap();
        for [x, y] in &points {
            assert!((exact.evaluate(&|_| *x) - y).abs() < 1e-13);
        }
        // Inside, the spline of a smooth function is near it, with both derivatives.
        for k in 0..40 {
            let x = 1.0 + 0.07 * f64::from(k);
            let [y, y1, y2] = values(&exact, x);
            assert!((y - 0.02 * x.sin()).abs() < 1e-7);
            assert!((y1 - 0.02 * x.cos()).abs() < 1e-5);
            assert!((y2 + 0.02 * x.sin()).abs() < 2e-4);
        }
        // Straight beyond the ends.
        assert!(values(&exact, 7.0)[2].abs() < 1e-9 && values(&exact, -2.0)[2].abs() < 1e-9);
    }

    #[test]
    fn a_periodic_table_reproduces_a_series() {
        for n in [9, 12] {
            let lift = |x: f64| 0.01 - 0.004 * (x - 0.3).cos() + 0.001 * (3.0 * x).sin();
            let points: Vec<[f64; 2]> = (0..n)
                .map(|k| {
                    let x = 0.2 + std::f64::consts::TAU * f64::from(k) / f64::from(n);
                    [x, lift(x)]
                })
                .collect();
            let mut log = DiagnosticLog::default();
            let span = SourceSpan {
                file: 0,
                start: 0,
                end: 0,
            };
            let exact = turn_polynomial(&points, &argument(), span, &mut log).unwrap();
            for k in 0..30 {
                let x = 0.5 * f64::from(k) - 7.0;
                assert!((exact.evaluate(&|_| x) - lift(x)).abs() < 1e-14);
            }
        }
    }
}
