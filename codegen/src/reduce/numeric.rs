//! The numeric reduction, for loops that cannot be sampled exactly: the rank test of eq. (9) on the model file's
//! values, with so many digits that dependent columns can be distinguished from small ones.
//!
//! Columns of a mechanism with one degree of freedom are smooth functions of one coordinate. On a short path they
//! differ by less than double precision resolves. So states come from a walk along the complete motion, have some 130
//! digits, and close all loops. The factors are valid for the file's values alone; results state this, with the
//! residual at further states.
//!
//! Decision: with machine numbers the singular values of such columns fade into rounding without a gap; a Bricard
//! linkage had 18, 22 or 26 base parameters, depending on the path. With 130 digits a dependent column leaves
//! 1e-120 and an independent one about 1e-5. Products of the file's constants are recognised in the factors by all
//! their digits (the shortest match is written). If loops have more equations than needed and the lengths of the
//! file are rounded, that rounding sets the limit, and a factor is at most one constant times a number. The factors
//! as written are checked at further states; if that fails there is no base.

use modelmill_algebra::digits::BigFloat;
use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::base;
use super::closing_constants::NO_CONTRADICTION;
use super::recognise::{FileConstants, length_exponent};
use super::reduction::{BaseReduction, ColumnDependency, ReductionMethod};
use super::states::WalkSampler;
use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{Atom, EvaluationTape, ExprId, FloatDomain, Graph};
use crate::loops::numeric_poses::{NumericLoops, uniform_symmetric};
use crate::regressor::UnreducedEquations;
use crate::regressor::projection::LoopProjection;
use crate::stop::StopRequest;
use crate::tree::expressions::ParameterMonomial;

/// A column counts as dependent if its residual is below this share of its size, and as zero if it is below this share
/// of the largest column. The second limit is also used for columns in double precision.
const DEPENDENT: f64 = 1e-13;
/// The same for loops with rounded lengths: as a multiple of their closure error, relative to the size of a loop.
const PER_OFF: f64 = 100.0;
/// How much larger contradictions of a loop with changed constants may be at further poses. By judgement.
const FURTHER: f64 = 100.0;
/// Largest residual of a column at further states with the factors as written, relative to its terms.
const SHOWN: f64 = 1e-10;
/// The same for loops with rounded lengths, as a multiple of their closure error or of the change of constants that
/// removes it.
const SHOWN_PER_OFF: f64 = 1000.0;
/// Distance of poses from the nominal one, in rad or relative to the size of the loops.
pub(super) const REACH: f64 = 0.4;
/// How often the distance is halved if most of such poses cannot be reached.
const HALVINGS: u32 = 7;

/// How often states are added if dependences are not valid further along the motion.
const ROUNDS: usize = 4;

/// Reduces `columns[k][d]` (product by drive), trying them as retained ones in the given order. `because` is the reason
/// why the exact reduction failed.
///
/// # Errors
/// [`DeriveError::NotConfirmed`] if the factors are not valid at further states, or the errors of [`WalkSampler`].
pub(super) fn reduce(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    order: &[usize],
    because: DeriveError,
    stop: StopRequest<'_>,
) -> Result<BaseReduction, DeriveError> {
    let (projection, candidates, columns) = (&equations.projection, &equations.products, &equations.columns);
    let mut states = WalkSampler::new(graph, mechanism, projection, columns)?;
    // More rows than columns, so that dependences cannot appear by chance.
    let n_rows = columns.len() + columns.len() / 4 + 20;
    let values: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let mut rows = states.next_rows(n_rows, stop)?;
    // Equations that contradict each other in the last digits would look like independent columns.
    if states.close_by_constants() {
        rows = match states.next_rows(n_rows, stop) {
            Ok(closed) if states.closure_error() <= FURTHER * NO_CONTRADICTION => closed,
            _ => {
                states.restore_constants();
                states.next_rows(n_rows, stop)?
            }
        };
    }
    for _ in 0..ROUNDS {
        let w = ObservationColumns::new(&rows, columns.len());
        let limit = DEPENDENT.max(PER_OFF * states.closure_error());
        // Masses and their moments are compared at the size of the largest loop as the length.
        let sized = |k: usize| {
            let metres = length_exponent(&base::product_unit(mechanism, &candidates[k])).unwrap_or(2);
            w.norms[k] / states.loop_size().powi(2 - metres)
        };
        let sizes: Vec<f64> = (0..columns.len()).map(sized).collect();
        let largest = sizes.iter().fold(0.0, |a: f64, b| a.max(*b));
        let is_effective = |k: &usize| sizes[*k] > limit * largest;
        let tried: Vec<usize> = order.iter().copied().filter(is_effective).collect();
        let base = NumericBase::new(&w, &tried, limit);
        // Contributions below the residual of dropped columns are rounding errors.
        let rounding = (1e3 * base.most_dropped).clamp(1e-60, 1e-9);
        let constants = FileConstants::new(mechanism, &|i| states.constant_value(i).cloned(), rounding.min(1e-10));
        let (mut found, effective) = numeric_reduction(&constants, candidates, &w, &tried, &base, rounding);
        // The factors as written are checked at states that were not used.
        let further = states.next_rows(n_rows, stop)?;
        let residual = ObservationColumns::new(&further, columns.len()).largest_residual(&found, &effective, &values);
        // Terms below the rounding error are dropped, each by itself.
        let left_out = rounding * base.kept.len() as f64;
        // Factors are checked with the constants of the file, which the user has.
        let rounded = states.closure_error().max(states.constant_change().unwrap_or(0.0));
        if residual <= SHOWN.max(SHOWN_PER_OFF * rounded).max(left_out) {
            found.method = ReductionMethod::Numeric {
                least_kept: base.least_kept,
                most_dropped: base.most_dropped,
                residual,
                constant_change: states.constant_change(),
                because: Box::new(because),
            };
            return Ok(found);
        }
        // The path was too short to distinguish small columns, so it is extended.
        rows.extend(further);
    }
    Err(DeriveError::NotConfirmed)
}

/// The reduction by the numeric dependences, and the positions of the columns with an effect. Factors are written in
/// the form that a person would choose.
fn numeric_reduction(
    constants: &FileConstants<'_>,
    candidates: &[ParameterMonomial],
    w: &ObservationColumns,
    tried: &[usize],
    base: &NumericBase,
    rounding: f64,
) -> (BaseReduction, Vec<usize>) {
    let mut effective = tried.to_vec();
    effective.sort_unstable();
    let at = |k: usize| {
        effective
            .iter()
            .position(|x| *x == k)
            .expect("an effective column has a position")
    };
    // Retained columns in the order of the products.
    let mut sorted = base.kept.clone();
    sorted.sort_unstable();
    let retained_at = |k: usize| sorted.iter().position(|x| *x == k).expect("a kept column is kept");
    let mut dependencies: Vec<ColumnDependency> = Vec::new();
    for j in tried.iter().copied().filter(|j| !base.kept.contains(j)) {
        let factors = base.kept.iter().zip(base.column_factors(j));
        // Factors whose contribution is below the rounding error are dropped.
        let mut equals: Vec<_> = factors
            .filter(|(k, f)| f.abs().to_f64() * w.norms[**k] > rounding * w.norms[j])
            .map(|(k, f)| {
                (
                    retained_at(*k),
                    constants.recognise_factor(&f, &candidates[j], &candidates[*k]),
                )
            })
            .collect();
        equals.sort_by_key(|(k, _)| *k);
        dependencies.push(ColumnDependency {
            product: at(j),
            equals,
            via: Vec::new(),
        });
    }
    dependencies.sort_by_key(|line| line.product);
    let products: Vec<ParameterMonomial> = effective.iter().map(|k| candidates[*k].clone()).collect();
    let found = BaseReduction {
        without_effect: candidates.iter().filter(|c| !products.contains(c)).cloned().collect(),
        retained: sorted.iter().map(|k| at(*k)).collect(),
        products,
        dependencies,
        method: ReductionMethod::Unreduced,
    };
    (found, effective)
}

/// Columns of the observation matrix W of eq. (9).
struct ObservationColumns {
    /// One vector per column.
    values: Vec<Vec<BigFloat>>,
    /// Euclidean norm of every column.
    norms: Vec<f64>,
}

impl ObservationColumns {
    /// Collects the columns of some rows.
    fn new(rows: &[Vec<BigFloat>], n: usize) -> Self {
        let values: Vec<Vec<BigFloat>> = (0..n)
            .map(|k| rows.iter().map(|row| row[k].clone()).collect())
            .collect();
        Self {
            norms: values.iter().map(|column| norm(column)).collect(),
            values,
        }
    }

    /// The largest residual of a dependent column with given factors, relative to the sum of the norms of its terms.
    fn largest_residual(&self, found: &BaseReduction, effective: &[usize], constants: &[f64]) -> f64 {
        let lines = found.dependencies.iter().zip(found.factors(constants));
        let shares = lines.map(|(line, factors)| {
            let product = effective[line.product];
            let mut left = self.values[product].clone();
            let mut size = self.norms[product];
            for (k, factor) in factors {
                let kept = effective[found.retained[k]];
                size += factor.abs() * self.norms[kept];
                let factor = BigFloat::from_f64(-factor).expect("a factor is a number");
                add_multiple(&mut left, &factor, &self.values[kept]);
            }
            norm(&left) / size
        });
        shares.fold(0.0, f64::max)
    }
}

/// Euclidean norm, in double precision.
fn norm(column: &[BigFloat]) -> f64 {
    column.iter().map(|x| x.to_f64().powi(2)).sum::<f64>().sqrt()
}

/// Scalar product with all digits.
fn dot(a: &[BigFloat], b: &[BigFloat]) -> BigFloat {
    let products = a.iter().zip(b).map(|(a, b)| a * b);
    products.fold(BigFloat::zero(), |sum, term| &sum + &term)
}

/// `column + factor * other`
fn add_multiple(column: &mut [BigFloat], factor: &BigFloat, other: &[BigFloat]) {
    for (x, y) in column.iter_mut().zip(other) {
        *x = &*x + &(factor * y);
    }
}

/// Retained columns, and all other columns as combinations of them.
struct NumericBase {
    /// Retained columns, in the order in which they were selected.
    kept: Vec<usize>,
    /// Least relative residual of a retained column when it was selected.
    least_kept: f64,
    /// Largest relative residual of a column that was not selected.
    most_dropped: f64,
    /// For each column its components along the residuals of the retained columns, in the order of their selection.
    shares: Vec<Vec<BigFloat>>,
}

impl NumericBase {
    /// Selects columns by Gram-Schmidt: first the earliest columns with a large residual, then always the one with the
    /// largest residual, down to `limit`.
    fn new(w: &ObservationColumns, tried: &[usize], limit: f64) -> Self {
        // Relative residual above which the order decides, and not the size.
        const MUCH: f64 = 1e-3;
        let mut left = w.values.clone();
        let mut base = Self {
            kept: Vec::new(),
            least_kept: 1.0,
            most_dropped: 0.0,
            shares: vec![Vec::new(); w.values.len()],
        };
        loop {
            // Relative residuals of all columns that are not selected.
            let open: Vec<(usize, f64)> = (tried.iter().copied())
                .filter(|j| !base.kept.contains(j))
                .map(|j| (j, norm(&left[j]) / w.norms[j]))
                .collect();
            let most = open.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            base.most_dropped = most.map_or(0.0, |(_, size)| *size);
            let first = open.iter().find(|(_, size)| *size > MUCH);
            let Some(&(pivot, size)) = first.or(most).filter(|(_, size)| *size > limit) else {
                return base;
            };
            base.least_kept = base.least_kept.min(size);
            base.kept.push(pivot);
            // The selected residual is removed from all other columns.
            let direction = left[pivot].clone();
            let square = dot(&direction, &direction);
            for (j, _) in open.into_iter().filter(|(j, _)| *j != pivot) {
                let share = dot(&direction, &left[j]) / square.clone();
                add_multiple(&mut left[j], &-&share, &direction);
                base.shares[j].push(share);
            }
        }
    }

    /// The factors of the retained columns in a dependent column, by back substitution.
    fn column_factors(&self, j: usize) -> Vec<BigFloat> {
        let mut factors = self.shares[j].clone();
        for m in (0..factors.len()).rev() {
            for i in 0..m {
                let change = &factors[m] * &self.shares[self.kept[m]][i];
                factors[i] = &factors[i] - &change;
            }
        }
        factors
    }
}

/// Whether dependences that were found exactly are not valid at the model file's values around the nominal pose. False
/// if no pose is found.
pub(super) fn is_contradicted(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &LoopProjection,
    candidates: &[ParameterMonomial],
    columns: &[Vec<ExprId>],
    found: &BaseReduction,
) -> bool {
    /// Far above rounding errors at followed poses, and far below the residual of a wrong dependence.
    const WRONG: f64 = 1e-6;
    let Ok(w) = sample_observations(graph, mechanism, projection, columns, 0, REACH) else {
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
    found.dependencies.iter().zip(&factors).any(|(line, factors)| {
        let mut left = column(line.product).into_owned();
        let mut size = left.norm();
        for (k, factor) in factors {
            let term = column(found.retained[*k]) * *factor;
            size += term.norm();
            left -= term;
        }
        left.norm() > WRONG * size && left.norm() > DEPENDENT * largest
    })
}

/// The observation matrix W of eq. (9) at random states around the nominal pose, with a few more rows than `wanted`.
///
/// # Errors
/// [`DeriveError::NoPointFound`] if too few poses can be reached.
pub(super) fn sample_observations(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &LoopProjection,
    columns: &[Vec<ExprId>],
    wanted: usize,
    farthest: f64,
) -> Result<DMatrix<f64>, DeriveError> {
    let n_drives = projection.drives.len();
    let outputs: Vec<ExprId> = (0..n_drives).flat_map(|d| columns.iter().map(move |c| c[d])).collect();
    let loops = NumericLoops::new(graph, mechanism, &projection.loops.residual);
    let [rates, accelerations, outputs] = [&projection.passive_rates, &projection.passive_accelerations, &outputs]
        .map(|roots| EvaluationTape::new(graph, roots));
    let mut stream = RandomStream::new(SEED);
    let n_coordinates = mechanism.coordinates.len();
    let mut rows: Vec<f64> = Vec::new();
    let wanted = wanted.div_ceil(n_drives.max(1)) + 10;
    let (mut n_points, mut tries) = (0, 0);
    let mut reach = farthest;
    while n_points < wanted && tries < (HALVINGS as usize + 20) * wanted {
        // Poses are drawn nearer to the nominal one while fewer than a quarter of them can be reached.
        if tries % wanted == 0 && n_points < tries / 4 {
            reach = (reach / 2.0).max(farthest / f64::from(1_u32 << HALVINGS));
        }
        tries += 1;
        let Some(q) = loops.random_pose(reach, &mut stream) else {
            continue;
        };
        // Random rates and accelerations, scaled by the units of the coordinates.
        let mut moving = |most: f64| -> Vec<f64> {
            (0..n_coordinates)
                .map(|i| most * loops.coordinate_unit(i) * uniform_symmetric(&mut stream))
                .collect()
        };
        let (mut qd, mut qdd) = (moving(2.0), moving(5.0));
        let load: Vec<f64> = (0..n_drives).map(|_| 100.0 * uniform_symmetric(&mut stream)).collect();
        let evaluate = |tape: &EvaluationTape, qd: &[f64], qdd: &[f64]| {
            tape.evaluate(&FloatDomain(|atom: Atom| match atom {
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
        // The loops determine the passive rates, then the passive accelerations.
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
    Ok(DMatrix::from_row_slice(n_points * n_drives, columns.len(), &rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regressor::unreduced_equations;
    use crate::review::tests::model;

    /// Where an exact base is known the numeric one has as many columns, with factors that are constants of the file.
    #[test]
    fn as_many_columns_as_in_the_field() {
        for name in [
            "two_link",
            "scara",
            "drone",
            "four_bar",
            "slider_crank",
            "parallelogram",
            "five_bar",
            "three_rrr",
            "delta",
        ] {
            let mechanism = model(name);
            let mut graph = Graph::new();
            let found = unreduced_equations(&mut graph, &mechanism).expect("equations");
            let exact = crate::reduce::reduce(&mut graph, &mechanism, &found, StopRequest::NEVER).expect("a base");
            assert!(matches!(exact.method, ReductionMethod::Exact { .. }), "{name}");
            let order: Vec<usize> = (0..found.columns.len())
                .filter(|k| found.columns[*k].iter().any(|x| *x != Graph::ZERO))
                .collect();
            let numeric = reduce(
                &mut graph,
                &mechanism,
                &found,
                &order,
                DeriveError::NotConfirmed,
                StopRequest::NEVER,
            )
            .expect("a base");
            assert_eq!(numeric.retained.len(), exact.retained.len(), "{name}");
            let ReductionMethod::Numeric {
                least_kept,
                most_dropped,
                residual,
                ..
            } = numeric.method
            else {
                panic!("{name}: {:?}", numeric.method);
            };
            assert!(least_kept > 1e-8 && most_dropped < 1e-100, "{name}");
            assert!(residual < SHOWN, "{name}: {residual:.1e}");
        }
    }

    /// A mechanism of which an independent program counted the base parameters, with changes in its text.
    fn judged(name: &str, changes: &[(&str, &str)]) -> Mechanism {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/fixtures/judged");
        let mut text = std::fs::read_to_string(format!("{folder}/{name}.toml")).expect("a fixture");
        for (old, new) in changes {
            assert!(text.contains(old), "{name} has no {old}");
            text = text.replace(old, new);
        }
        let memory = modelmill_boundary::files::MemoryFiles::default();
        match modelmill_spec::load(name, &text, &memory) {
            Ok(loaded) => loaded.mechanism,
            Err(failure) => panic!("{}", failure.render(false)),
        }
    }

    /// Loops that move against the count of their freedoms, and loops that fold: the number is beyond doubt, and
    /// factors are constants of the file, without a decimal point.
    #[test]
    fn overconstrained_and_symmetric_loops() {
        for (name, rank) in [("bricard_trihedral", 22), ("bricard_regular", 19)] {
            let found = crate::derive(&judged(name, &[])).expect("a derivation");
            assert_eq!(found.reduction.retained.len(), rank, "{name}");
            let ReductionMethod::Numeric {
                least_kept,
                most_dropped,
                residual,
                ..
            } = found.reduction.method
            else {
                panic!("{name}: {:?}", found.reduction.method);
            };
            assert!(least_kept > 1e-6 && most_dropped < 1e-100, "{name}");
            assert!(residual < 1e-12, "{name}: {residual:.1e}");
            if name == "bricard_trihedral" {
                continue;
            }
            for base in found.base_parameters() {
                assert!(!base.expression.contains('.'), "{name}: {}", base.expression);
            }
        }
    }

    /// A Bennett linkage whose second length is rounded to 16 digits: equations that are nearly singular enlarge the
    /// rounding in rates and accelerations, but no column consists of it.
    #[test]
    fn enlarged_rounding_is_no_column() {
        let (al, be) = (0.6_f64, 1.01_f64);
        let length = 0.4 * be.sin() / al.sin();
        // Equation of both angles of a Bennett linkage at the first angle of 1 rad (G. T. Bennett, 1903).
        let ratio = (0.5 * (al + be)).sin() / (0.5 * (al - be)).sin();
        let angle = -2.0 * (ratio / 0.5_f64.tan()).atan();
        let [first, second] = [format!("value = {al}"), format!("value = {be}")];
        let nominal = format!("nominal = {angle}");
        let changes = [
            ("a*sin(be)/sin(al)", format!("{length}")),
            ("value = 0.9", first),
            ("value = 0.5", second),
            ("nominal = -2.807781", nominal),
        ];
        let changes: Vec<(&str, &str)> = changes.iter().map(|(old, new)| (*old, new.as_str())).collect();
        let found = crate::derive(&judged("bennett", &changes)).expect("a derivation");
        assert_eq!(found.reduction.retained.len(), 7, "{al} {be}");
        let ReductionMethod::Numeric { constant_change, .. } = found.reduction.method else {
            panic!("{:?}", found.reduction.method);
        };
        assert!(
            constant_change.is_some_and(|change| change < 1e-15),
            "{constant_change:?}"
        );
    }

    /// With rounded lengths, a loop with more equations than needed closes only approximately. The base is that of the
    /// exact loop, and the residual shows the rounding.
    #[test]
    fn rounded_lengths_keep_the_base() {
        let rounded = [(r#"xyz = ["-(a)", 0, 0]"#, r#"xyz = ["-0.4000000003", 0, 0]"#)];
        let found = crate::derive(&judged("bricard_regular", &rounded)).expect("a derivation");
        assert_eq!(found.reduction.retained.len(), 19);
        let ReductionMethod::Numeric { residual, .. } = found.reduction.method else {
            panic!("{:?}", found.reduction.method);
        };
        assert!(residual > 1e-12 && residual < 1e-6, "{residual:.1e}");
    }
}
