//! Exact reduction to base parameters without expanding anything.
//!
//! The columns of H are functions on the loops' variety. They are evaluated at random points of a prime field, their
//! linear dependences found by elimination there, and the constant factors of eq. (6) reconstructed as rational functions
//! of the model's constants. A wrong answer has a probability below 1e-15 (Schwartz 1980, Zippel 1979).

mod eliminate;
mod numeric;
mod print;
mod rational_function;
mod reconstruct;
mod sample;
mod univariate;

use modelmill_spec::Mechanism;

pub use rational_function::{Polynomial, Powers, RationalFunction, Variable};
pub(crate) use sample::{Plan, Unknowns, plan};

use crate::DeriveError;
use crate::exact::Monomial;
use crate::expr::{Atom, ExprId, FieldPoint, Graph, Node, Tape, Unary};
use crate::field::{Element, Stream};
use crate::projection::Projection;
use sample::Sampler;

/// Seed of the draws: the same model gives the same text on any machine.
const SEED: u64 = 0x6D6F_6465_6C6D_696C;

/// The result: which columns are kept and how the others follow from them.
#[derive(Clone, Debug)]
pub struct Reduction {
    /// Products of parameters whose column is not zero, in the order of eq. (5): p_g.
    pub products: Vec<Monomial>,
    /// Products whose column is identically zero.
    pub without_effect: Vec<Monomial>,
    /// Positions in `products` of the retained columns, in the order of p_min.
    pub retained: Vec<usize>,
    /// Eq. (6): for every other product, by position, the retained ones (by position in `retained`) with their factors.
    pub dependencies: Vec<Dependency>,
    /// How it was found.
    pub method: Method,
}

/// How a reduction was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// In the prime field: it holds for all values of the constants but special ones.
    Exact {
        /// At how many points of motion `H p_g = H_min p_min` was shown, with fresh constants.
        confirmed_at: usize,
    },
    /// On the model file's values, in floating point: the factors are rounded numbers.
    Numeric {
        /// What the others leave of the retained column that is nearest to being dependent, relative to its size.
        least_kept: f64,
        /// The same for the dependent column that is furthest from it.
        most_dropped: f64,
    },
}

/// One line of eq. (6): `h_j = sum of a_k h_k`.
#[derive(Clone, Debug)]
pub struct Dependency {
    /// Position of the eliminated product in [`Reduction::products`].
    pub product: usize,
    /// Positions in [`Reduction::retained`] with the factors.
    pub equals: Vec<(usize, RationalFunction)>,
}

/// Which of some functions are linearly independent over the constants, all atoms being free; the first ones are kept.
pub(crate) fn independent_functions(
    graph: &Graph,
    roots: &[ExprId],
) -> Result<Vec<usize>, DeriveError> {
    if roots.is_empty() {
        return Ok(Vec::new());
    }
    let tape = Tape::new(graph, roots);
    let atoms = graph.atoms(roots);
    let mut stream = Stream::new(SEED);
    let mut constants = FieldPoint::default();
    let mut draw = |point: &mut FieldPoint, fixed: bool| {
        for atom in &atoms {
            if matches!(atom, Atom::Constant(_)) == fixed {
                point.values.insert(*atom, stream.element());
                point.angles.insert(*atom, stream.circle());
            }
        }
    };
    draw(&mut constants, true);
    let mut rows = Vec::new();
    for _ in 0..50 * roots.len() {
        let mut point = constants.clone();
        draw(&mut point, false);
        rows.extend(tape.evaluate(&point));
        if rows.len() >= roots.len() + 4 {
            break;
        }
    }
    if rows.len() < roots.len() {
        return Err(DeriveError::NoPointFound {
            draws: 50 * roots.len(),
        });
    }
    let order: Vec<usize> = (0..roots.len()).collect();
    let mut kept = eliminate::echelon(rows, &order).pivots;
    kept.sort_unstable();
    Ok(kept)
}

/// Reduces the columns `columns[k][d]` (product by drive) to a base.
///
/// `retain` names products that should be retained if they can, most wanted first.
pub(crate) fn reduce(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    candidates: &[Monomial],
    columns: &[Vec<ExprId>],
) -> Result<Reduction, DeriveError> {
    let effective: Vec<usize> = (0..columns.len())
        .filter(|k| columns[*k].iter().any(|x| *x != Graph::ZERO))
        .collect();
    let n_drives = projection.drives.len();
    let outputs: Vec<ExprId> = (0..n_drives)
        .flat_map(|d| effective.iter().map(move |k| (d, *k)))
        .map(|(d, k)| columns[k][d])
        .collect();
    let roots = root_radicands(graph, &outputs, projection);
    let sampler = match Sampler::new(graph, mechanism, projection, &outputs) {
        Err(DeriveError::LoopsNotSampled { .. }) => {
            let order = preference(mechanism, candidates, &effective);
            let order: Vec<usize> = order.into_iter().map(|k| effective[k]).collect();
            return numeric::reduce(graph, mechanism, projection, candidates, columns, &order);
        }
        sampler => sampler?,
    };
    let mut stream = Stream::new(SEED);
    let n = effective.len();

    // A sign takes only two values: that two of them agree by chance at all points must be out of the question.
    let least_points = if has_sign(graph, &outputs) { 80 } else { 0 };
    // Rows of W for one set of constants, enough of them to show `rank` and a few more.
    let rows_at = |constants: &FieldPoint,
                   rank: usize,
                   stream: &mut Stream|
     -> Result<Vec<Vec<Element>>, DeriveError> {
        let mut rows = Vec::new();
        let mut points = 0;
        while rows.len() < rank + 6 || points < least_points {
            let values = sampler.draw(constants, stream)?;
            rows.extend(values.chunks(n.max(1)).map(<[Element]>::to_vec));
            points += 1;
        }
        Ok(rows)
    };

    let constants = sampler.constants(&mut stream);
    let rows = if n == 0 {
        Vec::new()
    } else {
        rows_at(&constants, n, &mut stream)?
    };
    let is_zero: Vec<bool> = (0..n)
        .map(|k| rows.iter().all(|row| row[k] == Element::ZERO))
        .collect();
    let preferred = preference(mechanism, candidates, &effective);
    let echelon = eliminate::echelon(rows, &preferred);
    let mut pivots = echelon.pivots.clone();
    pivots.sort_unstable();
    let order: Vec<usize> = pivots.clone();
    let rank = pivots.len();
    let dependent: Vec<usize> = (0..n)
        .filter(|k| !is_zero[*k] && !pivots.contains(k))
        .collect();

    // The factors that do not vanish, found again at any other constants.
    let row_of = |echelon: &eliminate::Echelon, pivot: usize| {
        echelon.pivots.iter().position(|p| *p == pivot)
    };
    let wanted: Vec<(usize, usize)> = dependent
        .iter()
        .flat_map(|j| pivots.iter().map(move |p| (*j, *p)))
        .filter(|(j, p)| row_of(&echelon, *p).is_some_and(|r| echelon.rows[r][*j] != Element::ZERO))
        .collect();
    let mut sampling = stream.clone();
    let mut oracle = |constants: &FieldPoint| -> Result<Vec<Element>, DeriveError> {
        let rows = rows_at(constants, rank, &mut sampling)?;
        let echelon = eliminate::echelon(rows, &order);
        wanted
            .iter()
            .map(|(j, p)| {
                row_of(&echelon, *p)
                    .map(|r| echelon.rows[r][*j])
                    .ok_or(DeriveError::RankChanged)
            })
            .collect()
    };
    let used = graph.atoms(&outputs);
    let variables: Vec<(usize, bool)> = mechanism
        .constants
        .iter()
        .enumerate()
        .filter(|(i, _)| used.contains(&Atom::Constant(*i)))
        .map(|(i, c)| (i, c.is_angle))
        .collect();
    let draw = |stream: &mut Stream| sampler.constants(stream);
    let functions = if wanted.is_empty() {
        Vec::new()
    } else {
        reconstruct::reconstruct(&mut oracle, &variables, &roots, &draw, &mut stream)?
    };

    let position: Vec<Option<usize>> = {
        let kept: Vec<usize> = (0..n).filter(|k| !is_zero[*k]).collect();
        (0..n).map(|k| kept.iter().position(|x| *x == k)).collect()
    };
    let at = |k: usize| position[k].expect("a column with an effect has a position");
    let mut dependencies: Vec<Dependency> = dependent
        .iter()
        .map(|j| Dependency {
            product: at(*j),
            equals: Vec::new(),
        })
        .collect();
    for ((j, p), function) in wanted.iter().zip(functions) {
        let k = pivots
            .iter()
            .position(|x| x == p)
            .expect("a wanted pivot is one");
        let line = dependent
            .iter()
            .position(|x| x == j)
            .expect("a wanted column is dependent");
        let function = function.ok_or_else(|| DeriveError::FactorNotRecovered {
            product: candidates[effective[*j]].text(mechanism),
            retained: candidates[effective[*p]].text(mechanism),
        })?;
        dependencies[line].equals.push((k, function));
    }
    let products: Vec<Monomial> = (0..n)
        .filter(|k| !is_zero[*k])
        .map(|k| candidates[effective[k]].clone())
        .collect();
    let without_effect = candidates
        .iter()
        .filter(|c| !products.contains(c))
        .cloned()
        .collect();
    let retained: Vec<usize> = pivots.iter().map(|p| at(*p)).collect();
    let mut reduction = Reduction {
        products,
        without_effect,
        retained,
        dependencies,
        method: Method::Exact { confirmed_at: 0 },
    };
    let shown: Vec<usize> = (0..n).filter(|k| !is_zero[*k]).collect();
    reduction.confirm(&sampler, n, &shown, &mut stream)?;
    Ok(reduction)
}

impl Reduction {
    /// Shows `H p_g = H_min p_min` for random parameters at fresh points of motion with fresh constants.
    fn confirm(
        &mut self,
        sampler: &Sampler,
        n: usize,
        shown: &[usize],
        stream: &mut Stream,
    ) -> Result<(), DeriveError> {
        let mut points = 0;
        for _ in 0..4 {
            let constants = sampler.constants(stream);
            let parameters: Vec<Element> = self.products.iter().map(|_| stream.element()).collect();
            let mut base: Vec<Element> = self.retained.iter().map(|k| parameters[*k]).collect();
            for line in &self.dependencies {
                for (k, factor) in &line.equals {
                    let factor = factor.value(&constants).ok_or(DeriveError::RankChanged)?;
                    base[*k] = base[*k] + factor * parameters[line.product];
                }
            }
            for _ in 0..2 {
                for row in sampler.draw(&constants, stream)?.chunks(n.max(1)) {
                    let full = shown
                        .iter()
                        .zip(&parameters)
                        .fold(Element::ZERO, |s, (k, p)| s + row[*k] * *p);
                    let reduced = self
                        .retained
                        .iter()
                        .zip(&base)
                        .fold(Element::ZERO, |s, (k, p)| s + row[shown[*k]] * *p);
                    if full != reduced {
                        return Err(DeriveError::NotConfirmed);
                    }
                }
                points += 1;
            }
        }
        self.method = Method::Exact {
            confirmed_at: points,
        };
        Ok(())
    }
}

/// Order in which columns are tried as retained ones: those that the file names, then the others as they stand.
fn preference(mechanism: &Mechanism, candidates: &[Monomial], effective: &[usize]) -> Vec<usize> {
    let mut order: Vec<usize> = mechanism
        .retain
        .iter()
        .filter_map(|powers| {
            let wanted = powers.iter().fold(Monomial::default(), |m, (p, n)| {
                m.times(&Monomial(vec![(p.0, *n)]))
            });
            effective.iter().position(|k| candidates[*k] == wanted)
        })
        .collect();
    for k in 0..effective.len() {
        if !order.contains(&k) {
            order.push(k);
        }
    }
    order
}

fn has_sign(graph: &Graph, outputs: &[ExprId]) -> bool {
    graph
        .nodes_of(outputs)
        .any(|node| matches!(node, Node::Unary(Unary::Sign | Unary::Abs, _)))
}

/// Numbers under a root sign: they come from sines and cosines of multiples of pi/12.
fn root_radicands(graph: &Graph, outputs: &[ExprId], projection: &Projection) -> Vec<i64> {
    let mut roots = outputs.to_vec();
    roots.extend(&projection.residual);
    let mut found = Vec::new();
    for node in graph.nodes_of(&roots) {
        if let Node::Unary(Unary::Sqrt, inner) = node
            && let Node::Rational(value) = graph.node(*inner)
            && let Some((n, 1)) = value.as_small()
            && !found.contains(&n)
        {
            found.push(n);
        }
    }
    found
}
