//! The numeric reduction, for loops that cannot be sampled exactly: the rank test of eq. (9) on the model file's values.
//!
//! Its factors are floating-point numbers and hold for these values alone; results say so.

use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;
use num_traits::ToPrimitive;

use super::rational_function::{Polynomial, Powers, RationalFunction, Variable};
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
pub(super) const REACH: f64 = 0.4;
/// The same where a base is looked for: columns of a mechanism with one freedom hardly differ along a short path, and a long
/// one may lead through a singular pose into another branch, where the mechanism is another one.
const FAR: f64 = 0.5;
const HALVINGS: u32 = 7;

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
    let w = sample(
        graph,
        mechanism,
        projection,
        columns,
        4 * columns.len(),
        FAR,
    )?;
    let norms: Vec<f64> = (0..columns.len()).map(|k| w.column(k).norm()).collect();
    let largest = norms.iter().fold(0.0, |a: f64, b| a.max(*b));
    let mut effective: Vec<usize> = (order.iter().copied())
        .filter(|k| norms[*k] > NOTHING * largest)
        .collect();
    let units = DMatrix::from_fn(w.nrows(), effective.len(), |i, j| {
        w[(i, effective[j])] / norms[effective[j]]
    });
    let rank = rank(&units);
    let Chosen {
        kept: chosen,
        least_kept,
        most_dropped,
    } = Chosen::new(&units, rank);
    let kept: Vec<usize> = chosen.iter().map(|j| effective[*j]).collect();
    let basis = units.select_columns(&chosen);
    let qr = basis.qr();
    let triangle = qr.r();
    let mut lines: Vec<(usize, Vec<f64>)> = Vec::new();
    for (j, k) in effective.iter().enumerate() {
        if chosen.contains(&j) {
            continue;
        }
        let mut rotated = units.columns(j, 1).into_owned();
        qr.q_tr_mul(&mut rotated);
        let factors = triangle
            .solve_upper_triangular(&rotated.rows(0, chosen.len()))
            .ok_or(DeriveError::RankChanged)?;
        // What contributes less than is dropped is rounding.
        let above_rounding = |f: f64| if f.abs() > DEPENDENT { f } else { 0.0 };
        let factors = factors.iter().zip(&kept);
        lines.push((
            *k,
            factors
                .map(|(f, j)| above_rounding(*f) * norms[*k] / norms[*j])
                .collect(),
        ));
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
                        recognised(*f, mechanism),
                    )
                })
                .collect(),
            via: Vec::new(),
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

/// The rank of columns of unit length: up to the widest gap between singular values where they are small.
fn rank(units: &DMatrix<f64>) -> usize {
    /// Singular values above this share of the largest count.
    const LARGE: f64 = 1e-6;
    /// Below, all is rounding.
    const ROUNDING: f64 = 1e-15;
    if units.ncols() == 0 {
        return 0;
    }
    let mut values: Vec<f64> = units.singular_values().iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    let floor = ROUNDING * values[0];
    values.push(0.0);
    let gap = |k: usize| values[k - 1].max(floor) / values[k].max(floor);
    let candidates = (1..values.len()).filter(|k| values[*k] <= LARGE * values[0]);
    // Of equal gaps the first.
    let widest = candidates.fold(None, |best: Option<usize>, k| match best {
        Some(best) if gap(best) >= gap(k) => Some(best),
        _ => Some(k),
    });
    widest.unwrap_or(units.ncols())
}

/// Columns that are kept, as many as the rank says.
struct Chosen {
    kept: Vec<usize>,
    /// What the others leave of the kept column that is nearest to being dependent, and of the dropped one that is furthest.
    least_kept: f64,
    most_dropped: f64,
}

impl Chosen {
    /// The first columns of which much is left beside those before, then those of which most is left.
    fn new(units: &DMatrix<f64>, rank: usize) -> Self {
        const MUCH: f64 = 1e-3;
        let mut left = units.clone();
        let mut kept: Vec<usize> = Vec::with_capacity(rank);
        let mut least_kept = 1.0_f64;
        while kept.len() < rank {
            let open = (0..units.ncols()).filter(|j| !kept.contains(j));
            let sizes: Vec<(usize, f64)> = open.map(|j| (j, left.column(j).norm())).collect();
            let first = sizes.iter().find(|(_, size)| *size > MUCH);
            let most = sizes.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some(&(pivot, size)) = first.or(most).filter(|(_, size)| *size > 0.0) else {
                break;
            };
            least_kept = least_kept.min(size);
            kept.push(pivot);
            // Twice, so that rounding leaves nothing of it.
            for _ in 0..2 {
                let direction = left.column(pivot).normalize();
                for j in (0..units.ncols()).filter(|j| *j != pivot && !kept.contains(j)) {
                    let share = direction.dot(&left.column(j));
                    left.column_mut(j).axpy(-share, &direction, 1.0);
                }
            }
        }
        let dropped = (0..units.ncols()).filter(|j| !kept.contains(j));
        let most_dropped = dropped.map(|j| left.column(j).norm()).fold(0.0, f64::max);
        kept.sort_unstable();
        Self {
            kept,
            least_kept,
            most_dropped,
        }
    }
}

/// A factor as a small rational, or as one times constants of the file, where it is that up to rounding; else as a number.
fn recognised(value: f64, mechanism: &Mechanism) -> RationalFunction {
    /// Factors come from poses that are closed to about this accuracy.
    const ROUNDING: f64 = 1e-10;
    const LARGEST_DENOMINATOR: i64 = 24;
    let is_near = |a: f64| (a - value).abs() <= ROUNDING * value.abs();
    for below in 1..=LARGEST_DENOMINATOR {
        let above = (value * below as f64).round();
        if let Some(n) = above.to_i64().filter(|n| n.abs() < 1000)
            && is_near(above / below as f64)
        {
            return RationalFunction::constant(Rational::new(n, below));
        }
    }
    let lengths: Vec<(usize, f64)> = (mechanism.constants.iter().enumerate())
        .filter(|(_, c)| !c.is_angle && c.value != 0.0)
        .map(|(i, c)| (i, c.value))
        .collect();
    let function = |number: Rational, above: &[usize], below: &[usize]| {
        let powers = |of: &[usize]| {
            let mut powers = Powers::new();
            for i in of {
                match powers
                    .iter_mut()
                    .find(|(v, _)| *v == Variable::Constant(*i))
                {
                    Some((_, n)) => *n += 1,
                    None => powers.push((Variable::Constant(*i), 1)),
                }
            }
            powers.sort_unstable();
            powers
        };
        RationalFunction::new(
            Polynomial::from([(powers(above), number)]),
            Polynomial::from([(powers(below), Rational::ONE)]),
        )
    };
    for number in [(1, 1), (-1, 1), (2, 1), (-2, 1), (1, 2), (-1, 2)] {
        let k = f64::from(number.0) / f64::from(number.1);
        let number = || Rational::new(i64::from(number.0), i64::from(number.1));
        for (i, a) in &lengths {
            if is_near(k * a) {
                return function(number(), &[*i], &[]);
            }
            if is_near(k / a) {
                return function(number(), &[], &[*i]);
            }
        }
        for (i, a) in &lengths {
            for (j, b) in &lengths {
                if is_near(k * a * b) {
                    return function(number(), &[*i, *j], &[]);
                }
                if i != j && is_near(k * a / b) {
                    return function(number(), &[*i], &[*j]);
                }
            }
        }
    }
    decimal(value)
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
    let Ok(w) = sample(graph, mechanism, projection, columns, 0, REACH) else {
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
    let factors = found.factors(&constants);
    found
        .dependencies
        .iter()
        .zip(&factors)
        .any(|(line, factors)| {
            let mut left = column(line.product).into_owned();
            let mut size = left.norm();
            for (k, factor) in factors {
                let term = column(found.retained[*k]) * *factor;
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
    farthest: f64,
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
    let mut reach = farthest;
    while n_points < wanted && tries < (HALVINGS as usize + 20) * wanted {
        if tries % wanted == 0 && n_points < tries / 4 {
            reach = (reach / 2.0).max(farthest / f64::from(1_u32 << HALVINGS));
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
