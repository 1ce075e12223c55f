//! The numeric reduction, for loops that cannot be sampled exactly: the rank test of eq. (9) on the model file's values, with
//! so many digits that what is dependent shows beside what is only small.
//!
//! Columns of a mechanism with one freedom are functions of one coordinate, and smooth: on a short path they differ by less than
//! machine numbers resolve. So states come from a walk along the whole motion, have some 130 digits, and are on all loops.
//! The factors hold for the file's values alone; results say so, with what they leave at further states.
//!
//! Decision: with machine numbers the singular values of such columns fade into rounding without a gap; a Bricard
//! linkage had 18, 22 or 26 base parameters, depending on the path. With 130 digits a dependent column leaves
//! 1e-120 and an independent one about 1e-5. Products of the file's constants are recognised in the factors by all
//! their digits (the shortest match is written). If loops have more equations than needed and the lengths of the
//! file are rounded, that rounding sets the limit, and a factor is at most one constant times a number. The factors
//! as written are checked at further states; if that fails there is no base.

use modelmill_algebra::digits::Digits;
use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::base;
use super::recognise::{Constants, metres};
use super::reduction::{Dependency, Method, Reduction};
use super::states::States;
use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{Atom, ExprId, F64, Graph, Tape};
use crate::loops::numeric_poses::{NumericLoops, symmetric};
use crate::regressor::projection::Projection;
use crate::tree::expressions::Monomial;

/// A column counts as dependent where others leave less than this of it, relative to its size; and as none where it is smaller
/// than this, relative to the largest. So does a column at a pose in machine numbers.
const DEPENDENT: f64 = 1e-13;
/// The same where the digits of the file leave loops open: as a multiple of what they leave, relative to the size of a loop.
const PER_OFF: f64 = 100.0;
/// What written factors may leave of a column at further states, relative to its terms.
const SHOWN: f64 = 1e-10;
/// The same where loops are left open, as a multiple of that.
const SHOWN_PER_OFF: f64 = 1000.0;
/// How far poses lie from the nominal one, in rad or relative to the size of the loops, and how often that is halved
/// where most of such poses cannot be reached.
pub(super) const REACH: f64 = 0.4;
const HALVINGS: u32 = 7;

/// How often states are added where dependences do not hold further along the motion.
const ROUNDS: usize = 4;

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
    let mut states = States::new(graph, mechanism, projection, columns)?;
    let n_rows = columns.len() + columns.len() / 4 + 20;
    let values: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let mut rows = states.rows(n_rows)?;
    for _ in 0..ROUNDS {
        let w = Columns::new(&rows, columns.len());
        let limit = DEPENDENT.max(PER_OFF * states.off());
        // Masses and their moments are compared at the length of the largest loop.
        let sized = |k: usize| {
            let metres = metres(&base::unit(mechanism, &candidates[k])).unwrap_or(2);
            w.norms[k] / states.length().powi(2 - metres)
        };
        let sizes: Vec<f64> = (0..columns.len()).map(sized).collect();
        let largest = sizes.iter().fold(0.0, |a: f64, b| a.max(*b));
        let is_effective = |k: &usize| sizes[*k] > limit * largest;
        let tried: Vec<usize> = order.iter().copied().filter(is_effective).collect();
        let base = Base::new(&w, &tried, limit);
        // What contributes less than is dropped is rounding.
        let rounding = (1e3 * base.most_dropped).clamp(1e-60, 1e-9);
        let (mut found, effective) = written(mechanism, candidates, &w, &tried, &base, rounding);
        let further = states.rows(n_rows)?;
        let residual = Columns::new(&further, columns.len()).left(&found, &effective, &values);
        // Terms that count as rounding are left out, each by itself.
        let left_out = rounding * base.kept.len() as f64;
        if residual <= SHOWN.max(SHOWN_PER_OFF * states.off()).max(left_out) {
            found.method = Method::Numeric {
                least_kept: base.least_kept,
                most_dropped: base.most_dropped,
                residual,
                because: Box::new(because),
            };
            return Ok(found);
        }
        // The path was too short for what is so small on it.
        rows.extend(further);
    }
    Err(DeriveError::NotConfirmed)
}

/// What was found as dependences of columns that have an effect, with the positions of these; factors as a person would write
/// them.
fn written(
    mechanism: &Mechanism,
    candidates: &[Monomial],
    w: &Columns,
    tried: &[usize],
    base: &Base,
    rounding: f64,
) -> (Reduction, Vec<usize>) {
    let mut effective = tried.to_vec();
    effective.sort_unstable();
    let at = |k: usize| {
        effective
            .iter()
            .position(|x| *x == k)
            .expect("an effective column has a position")
    };
    let mut sorted = base.kept.clone();
    sorted.sort_unstable();
    let retained_at = |k: usize| {
        sorted
            .iter()
            .position(|x| *x == k)
            .expect("a kept column is kept")
    };
    let constants = Constants::new(mechanism, rounding.min(1e-10));
    let mut dependencies: Vec<Dependency> = Vec::new();
    for j in tried.iter().copied().filter(|j| !base.kept.contains(j)) {
        let factors = base.kept.iter().zip(base.factors(j));
        let mut equals: Vec<_> = factors
            .filter(|(k, f)| f.abs().to_f64() * w.norms[**k] > rounding * w.norms[j])
            .map(|(k, f)| {
                (
                    retained_at(*k),
                    constants.factor(&f, &candidates[j], &candidates[*k]),
                )
            })
            .collect();
        equals.sort_by_key(|(k, _)| *k);
        dependencies.push(Dependency {
            product: at(j),
            equals,
            via: Vec::new(),
        });
    }
    dependencies.sort_by_key(|line| line.product);
    let products: Vec<Monomial> = effective.iter().map(|k| candidates[*k].clone()).collect();
    let found = Reduction {
        without_effect: candidates
            .iter()
            .filter(|c| !products.contains(c))
            .cloned()
            .collect(),
        retained: sorted.iter().map(|k| at(*k)).collect(),
        products,
        dependencies,
        method: Method::Unreduced,
    };
    (found, effective)
}

/// Columns of W.
struct Columns {
    values: Vec<Vec<Digits>>,
    norms: Vec<f64>,
}

impl Columns {
    fn new(rows: &[Vec<Digits>], n: usize) -> Self {
        let values: Vec<Vec<Digits>> = (0..n)
            .map(|k| rows.iter().map(|row| row[k].clone()).collect())
            .collect();
        Self {
            norms: values.iter().map(|column| norm(column)).collect(),
            values,
        }
    }

    /// The most that dependences leave of a column, relative to their terms.
    fn left(&self, found: &Reduction, effective: &[usize], constants: &[f64]) -> f64 {
        let lines = found.dependencies.iter().zip(found.factors(constants));
        let shares = lines.map(|(line, factors)| {
            let product = effective[line.product];
            let mut left = self.values[product].clone();
            let mut size = self.norms[product];
            for (k, factor) in factors {
                let kept = effective[found.retained[k]];
                size += factor.abs() * self.norms[kept];
                let factor = Digits::from_f64(-factor).expect("a factor is a number");
                add(&mut left, &factor, &self.values[kept]);
            }
            norm(&left) / size
        });
        shares.fold(0.0, f64::max)
    }
}

fn norm(column: &[Digits]) -> f64 {
    column
        .iter()
        .map(|x| x.to_f64().powi(2))
        .sum::<f64>()
        .sqrt()
}

fn dot(a: &[Digits], b: &[Digits]) -> Digits {
    let products = a.iter().zip(b).map(|(a, b)| a * b);
    products.fold(Digits::zero(), |sum, term| &sum + &term)
}

/// `column + factor * other`
fn add(column: &mut [Digits], factor: &Digits, other: &[Digits]) {
    for (x, y) in column.iter_mut().zip(other) {
        *x = &*x + &(factor * y);
    }
}

/// Columns that are kept, and what all others are beside them.
struct Base {
    /// In the order in which they were taken.
    kept: Vec<usize>,
    /// What the others leave of the kept column that is nearest to being dependent, and of the dropped one that is furthest.
    least_kept: f64,
    most_dropped: f64,
    /// Of each column the shares along what was left of each kept one when that was taken.
    shares: Vec<Vec<Digits>>,
}

impl Base {
    /// The first columns of which much is left beside those before, then those of which most is left, down to `limit`.
    fn new(w: &Columns, tried: &[usize], limit: f64) -> Self {
        const MUCH: f64 = 1e-3;
        let mut left = w.values.clone();
        let mut base = Self {
            kept: Vec::new(),
            least_kept: 1.0,
            most_dropped: 0.0,
            shares: vec![Vec::new(); w.values.len()],
        };
        loop {
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
            let direction = left[pivot].clone();
            let square = dot(&direction, &direction);
            for (j, _) in open.into_iter().filter(|(j, _)| *j != pivot) {
                let share = dot(&direction, &left[j]) / square.clone();
                add(&mut left[j], &-&share, &direction);
                base.shares[j].push(share);
            }
        }
    }

    /// A dropped column by the kept ones.
    fn factors(&self, j: usize) -> Vec<Digits> {
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
            left.norm() > WRONG * size && left.norm() > DEPENDENT * largest
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regressor::equations;
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
            let found = equations(&mut graph, &mechanism).expect("equations");
            let exact = crate::reduce::reduce(&mut graph, &mechanism, &found).expect("a base");
            assert!(matches!(exact.method, Method::Exact { .. }), "{name}");
            let order: Vec<usize> = (0..found.columns.len())
                .filter(|k| found.columns[*k].iter().any(|x| *x != Graph::ZERO))
                .collect();
            let numeric = reduce(
                &mut graph,
                &mechanism,
                &found.projection,
                &found.products,
                &found.columns,
                &order,
                DeriveError::NotConfirmed,
            )
            .expect("a base");
            assert_eq!(numeric.retained.len(), exact.retained.len(), "{name}");
            let Method::Numeric {
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
        let memory = modelmill_boundary::files::Memory::default();
        match modelmill_spec::load(name, &text, &memory) {
            Ok(loaded) => loaded.mechanism,
            Err(failure) => panic!("{}", failure.render(false)),
        }
    }

    /// Loops that move against the count of their freedoms, and loops that fold: the number is beyond doubt, and factors are
    /// constants of the file, without a decimal point.
    #[test]
    fn overconstrained_and_symmetric_loops() {
        for (name, rank) in [
            ("bricard_trihedral", 22),
            ("bricard_regular", 19),
            ("sarrus", 5),
        ] {
            let found = crate::derive(&judged(name, &[])).expect("a derivation");
            assert_eq!(found.reduction.retained.len(), rank, "{name}");
            let Method::Numeric {
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
                assert!(
                    !base.expression.contains('.'),
                    "{name}: {}",
                    base.expression
                );
            }
        }
    }

    /// Lengths that a person has rounded close a loop with more equations than it needs only nearly: the base is that of the
    /// loop that was meant, and what is left says how nearly.
    #[test]
    fn rounded_lengths_keep_the_base() {
        let rounded = [(
            r#"xyz = ["-(a)", 0, 0]"#,
            r#"xyz = ["-0.4000000003", 0, 0]"#,
        )];
        let found = crate::derive(&judged("bricard_regular", &rounded)).expect("a derivation");
        assert_eq!(found.reduction.retained.len(), 19);
        let Method::Numeric { residual, .. } = found.reduction.method else {
            panic!("{:?}", found.reduction.method);
        };
        assert!(residual > 1e-12 && residual < 1e-6, "{residual:.1e}");
    }
}
