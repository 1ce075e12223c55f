//! The numeric reduction, for loops that cannot be sampled exactly: the rank test of eq. (9) on the model file's values.
//!
//! Its factors are floating-point numbers and hold for these values alone; results say so.

use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use super::rational_function::RationalFunction;
use super::reduction::{Dependency, Method, Reduction};
use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{Atom, ExprId, F64, Graph, Rational, Tape};
use crate::loops::numeric_poses::{NumericLoops, symmetric};
use crate::regressor::projection::Projection;
use crate::tree::expressions::Monomial;

/// What is left of a column, relative to its size, below which it counts as dependent.
const DEPENDENT: f64 = 1e-9;
/// A column this much smaller than the largest is rounding.
const NOTHING: f64 = 1e-13;
/// How far poses lie from the nominal one, in rad or relative to the size of the loops, and how often that is halved
/// where most of such poses cannot be reached.
const REACH: f64 = 0.4;
const HALVINGS: u32 = 6;

/// Reduces `columns[k][d]`, trying them in the given order.
pub(super) fn reduce(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    candidates: &[Monomial],
    columns: &[Vec<ExprId>],
    order: &[usize],
    because: DeriveError,
) -> Result<Reduction, DeriveError> {
    let w = sample(graph, mechanism, projection, columns, 4 * columns.len())?;
    let norms: Vec<f64> = (0..columns.len()).map(|k| w.column(k).norm()).collect();
    let largest = norms.iter().fold(0.0, |a: f64, b| a.max(*b));
    let mut kept: Vec<usize> = Vec::new();
    let mut lines: Vec<(usize, Vec<f64>)> = Vec::new();
    let (mut least_kept, mut most_dropped) = (1.0_f64, 0.0_f64);
    let mut effective = Vec::new();
    for &k in order {
        if norms[k] <= NOTHING * largest {
            continue;
        }
        effective.push(k);
        let basis = DMatrix::from_fn(w.nrows(), kept.len(), |i, j| {
            w[(i, kept[j])] / norms[kept[j]]
        });
        let column: DVector<f64> = w.column(k) / norms[k];
        let factors = if kept.is_empty() {
            DVector::zeros(0)
        } else {
            let qr = basis.clone().qr();
            let rotated = qr.q().transpose() * &column;
            qr.r()
                .solve_upper_triangular(&rotated)
                .ok_or(DeriveError::RankChanged)?
        };
        let left = (&column - &basis * &factors).norm();
        if left > DEPENDENT {
            least_kept = least_kept.min(left);
            kept.push(k);
        } else {
            most_dropped = most_dropped.max(left);
            // What contributes less than is dropped is rounding.
            let above_rounding = |f: f64| if f.abs() > DEPENDENT { f } else { 0.0 };
            lines.push((
                k,
                factors
                    .iter()
                    .zip(&kept)
                    .map(|(f, j)| above_rounding(*f) * norms[k] / norms[*j])
                    .collect(),
            ));
        }
    }
    effective.sort_unstable();
    let at = |k: usize| {
        effective
            .iter()
            .position(|x| *x == k)
            .expect("an effective column has a position")
    };
    let mut sorted = kept.clone();
    sorted.sort_unstable();
    let mut dependencies: Vec<Dependency> = lines
        .iter()
        .map(|(k, factors)| Dependency {
            product: at(*k),
            equals: kept
                .iter()
                .zip(factors)
                .filter(|(_, f)| **f != 0.0)
                .map(|(j, f)| {
                    (
                        sorted
                            .iter()
                            .position(|x| x == j)
                            .expect("a kept column is kept"),
                        decimal(*f),
                    )
                })
                .collect(),
        })
        .collect();
    dependencies.sort_by_key(|line| line.product);
    let products: Vec<Monomial> = effective.iter().map(|k| candidates[*k].clone()).collect();
    Ok(Reduction {
        without_effect: candidates
            .iter()
            .filter(|c| !products.contains(c))
            .cloned()
            .collect(),
        retained: sorted.iter().map(|k| at(*k)).collect(),
        products,
        dependencies,
        method: Method::Numeric {
            least_kept,
            most_dropped,
            because: Box::new(because),
        },
    })
}

/// Whether dependences that were found elsewhere fail on the model file's values around the nominal pose. Where no pose
/// is found they do not.
pub(super) fn contradicts(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    candidates: &[Monomial],
    columns: &[Vec<ExprId>],
    found: &Reduction,
) -> bool {
    /// Far above rounding in poses that are followed, far below what a wrong dependence makes.
    const WRONG: f64 = 1e-6;
    let Ok(w) = sample(graph, mechanism, projection, columns, 0) else {
        return false;
    };
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let column = |product: usize| {
        let at = candidates
            .iter()
            .position(|c| *c == found.products[product])
            .expect("a product is a candidate");
        w.column(at)
    };
    let largest = w.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
    found.dependencies.iter().any(|line| {
        let mut left = column(line.product).into_owned();
        let mut size = left.norm();
        for (k, factor) in &line.equals {
            let term = column(found.retained[*k]) * factor.value_f64(&constants);
            size += term.norm();
            left -= term;
        }
        left.norm() > WRONG * size && left.norm() > NOTHING * largest
    })
}

/// A number with thirteen significant digits, as an exact rational, so that everything behind treats it like any other
/// factor.
fn decimal(value: f64) -> RationalFunction {
    const DIGITS: i32 = 12;
    let written = format!("{value:.12e}");
    let rational = written.split_once('e').and_then(|(mantissa, exponent)| {
        let mantissa: i64 = mantissa.replace('.', "").parse().ok()?;
        let exponent: i32 = exponent.parse().ok()?;
        Some(&Rational::integer(mantissa) * &Rational::integer(10).pow(exponent - DIGITS))
    });
    RationalFunction::constant(rational.expect("a finite number has a mantissa and an exponent"))
}

/// W of eq. (9) at random states around the nominal pose, with some more rows than are wanted.
pub(super) fn sample(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    columns: &[Vec<ExprId>],
    wanted: usize,
) -> Result<DMatrix<f64>, DeriveError> {
    let n_drives = projection.drives.len();
    let outputs: Vec<ExprId> = (0..n_drives)
        .flat_map(|d| columns.iter().map(move |c| c[d]))
        .collect();
    let loops = NumericLoops::new(graph, mechanism, &projection.loops.residual);
    let [rates, accelerations, outputs] = [
        &projection.passive_rates,
        &projection.passive_accelerations,
        &outputs,
    ]
    .map(|roots| Tape::new(graph, roots));
    let mut stream = Stream::new(SEED);
    let n_coordinates = mechanism.coordinates.len();
    let mut rows: Vec<f64> = Vec::new();
    let wanted = wanted.div_ceil(n_drives.max(1)) + 10;
    let (mut n_points, mut tries) = (0, 0);
    let mut reach = REACH;
    while n_points < wanted && tries < (HALVINGS as usize + 20) * wanted {
        if tries % wanted == 0 && n_points < tries / 4 {
            reach = (reach / 2.0).max(REACH / f64::from(1_u32 << HALVINGS));
        }
        tries += 1;
        let Some(q) = loops.random(reach, &mut stream) else {
            continue;
        };
        let mut moving = |most: f64| -> Vec<f64> {
            (0..n_coordinates)
                .map(|i| most * loops.unit(i) * symmetric(&mut stream))
                .collect()
        };
        let (mut qd, mut qdd) = (moving(2.0), moving(5.0));
        let load: Vec<f64> = (0..n_drives)
            .map(|_| 100.0 * symmetric(&mut stream))
            .collect();
        let evaluate = |tape: &Tape, qd: &[f64], qdd: &[f64]| {
            tape.evaluate(&F64(|atom: Atom| match atom {
                Atom::Constant(i) => mechanism.constants[i].value,
                Atom::Parameter(i) => mechanism.parameters[i].nominal,
                Atom::Coordinate(i) => q[i],
                Atom::Rate(i) => qd[i],
                Atom::Acceleration(i) => qdd[i],
                Atom::Load(d) => load[d],
                Atom::Pi => std::f64::consts::PI,
                Atom::Base(_) | Atom::Shared(_) => 0.0,
            }))
        };
        let Some(found) = evaluate(&rates, &qd, &qdd) else {
            continue;
        };
        for (p, value) in projection.loops.passive.iter().zip(found) {
            qd[*p] = value;
        }
        let Some(found) = evaluate(&accelerations, &qd, &qdd) else {
            continue;
        };
        for (p, value) in projection.loops.passive.iter().zip(found) {
            qdd[*p] = value;
        }
        let Some(values) = evaluate(&outputs, &qd, &qdd) else {
            continue;
        };
        if values.iter().all(|v| v.is_finite()) {
            rows.extend(values);
            n_points += 1;
        }
    }
    if n_points < wanted {
        return Err(DeriveError::NoPointFound { draws: tries });
    }
    Ok(DMatrix::from_row_slice(
        n_points * n_drives,
        columns.len(),
        &rows,
    ))
}
