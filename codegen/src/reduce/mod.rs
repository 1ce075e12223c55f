//! Exact reduction to base parameters without expanding anything.
//!
//! The columns of H are functions on the loops' variety. They are evaluated at random points of a prime field, their
//! linear dependences found by elimination there, and the constant factors of eq. (6) reconstructed as rational functions
//! of the model's constants. A wrong answer has a probability below 1e-15 (Schwartz 1980, Zippel 1979).

mod factors;
mod fit;
mod numeric;
mod print;
mod rational_function;
mod reconstruct;
mod relations;
mod sample;
mod support;

use std::collections::BTreeSet;

use modelmill_spec::Mechanism;

pub use rational_function::{Polynomial, Powers, RationalFunction, Variable};

use crate::DeriveError;
use crate::expr::{Atom, ExprId, FieldPoint, Graph, Node, Tape, Unary};
use crate::loops::SEED;
use crate::regressor::projection::Projection;
use crate::tree::expressions::Monomial;
use modelmill_algebra::eliminate::{self, Echelon};
use modelmill_algebra::field::{Element, MODULUS, PRIMES, Stream};
use relations::Relation;
use sample::Sampler;

/// How many points in a row must show nothing new. At a random point the rows of H leave a space that is not yet all of
/// theirs with certainty but for a chance of about 2^-55, so that one would do.
const IDLE: usize = 2;

/// The same where signs occur, which take only two values: that two of them agree by chance at all points must be out of
/// the question.
const IDLE_WITH_SIGNS: usize = 80;

/// With how many sets of constants the result is shown, and at how many points of motion for each.
const CONFIRMED_WITH: usize = 4;
const CONFIRMED_AT: usize = 2;

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
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// In the prime field: it holds for all values of the constants but special ones.
    Exact {
        /// At how many points of motion `H p_g = H_min p_min` was shown, with fresh constants.
        confirmed_at: usize,
    },
    /// Not at all: every product that was asked for is retained.
    Unreduced,
    /// On the model file's values, in floating point: the factors are rounded numbers.
    Numeric {
        /// What the others leave of the retained column that is nearest to being dependent, relative to its size.
        least_kept: f64,
        /// The same for the dependent column that is furthest from it.
        most_dropped: f64,
        /// Why there is no exact reduction.
        because: Box<DeriveError>,
    },
}

impl Method {
    /// What a reader of a numeric reduction must know, in words; `None` where the reduction holds for general values.
    pub fn caution(&self) -> Option<String> {
        match self {
            Self::Exact { .. } | Self::Unreduced => None,
            Self::Numeric { because, .. } => Some(format!(
                "the base parameters were found numerically, on the values of this file: {because}; factors are rounded, and \
                 base and factors hold for these values alone"
            )),
        }
    }
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
    let mut constants = FieldPoint::<Element> {
        seed: stream.bits(),
        root_seed: stream.bits(),
        ..FieldPoint::default()
    };
    let mut draw = |point: &mut FieldPoint, fixed: bool| {
        for atom in &atoms {
            if matches!(atom, Atom::Constant(_) | Atom::Pi) == fixed {
                point.values.insert(*atom, stream.element());
                point.angles.insert(*atom, stream.circle());
            }
        }
    };
    draw(&mut constants, true);
    let order: Vec<usize> = (0..roots.len()).collect();
    let mut echelon = eliminate::Echelon::new(&order);
    let mut idle = 0;
    for _ in 0..50 * roots.len() {
        let mut point = constants.clone();
        draw(&mut point, false);
        if let Some(row) = tape.evaluate(&point) {
            idle = if echelon.insert(row) { 0 } else { idle + 1 };
        } else {
            // Roots of constants that are not in the field: others may be.
            draw(&mut constants, true);
        }
        if idle >= IDLE {
            let mut kept = echelon.pivots;
            kept.sort_unstable();
            return Ok(kept);
        }
    }
    Err(DeriveError::NoPointFound {
        draws: 50 * roots.len(),
    })
}

/// Reduces the columns `columns[k][d]` (product by drive) to a base.
///
/// Products that the model file wants to retain are tried first, then all others in order.
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
    let order = preference(mechanism, candidates, &effective);
    let outputs: Vec<ExprId> = (0..projection.drives.len())
        .flat_map(|d| effective.iter().map(move |k| columns[*k][d]))
        .collect();
    let exact = reduce_exactly(
        graph, mechanism, projection, candidates, &effective, &order, &outputs,
    );
    let exact = exact.and_then(|found| {
        // Loops are sampled on their algebraic variety; machines live on the branch of the nominal pose.
        let is_contradicted = !projection.closures.is_empty()
            && numeric::contradicts(graph, mechanism, projection, candidates, columns, &found);
        if is_contradicted {
            Err(DeriveError::NotConfirmed)
        } else {
            Ok(found)
        }
    });
    match exact {
        Err(
            because @ (DeriveError::LoopsNotSampled { .. }
            | DeriveError::BranchesNotSeparated { .. }
            | DeriveError::FactorNotRecovered { .. }
            | DeriveError::FactorsTooLong { .. }
            | DeriveError::NoPointFound { .. }
            | DeriveError::NotConfirmed
            | DeriveError::RankChanged),
        ) => {
            let order: Vec<usize> = order.into_iter().map(|k| effective[k]).collect();
            numeric::reduce(
                graph, mechanism, projection, candidates, columns, &order, because,
            )
        }
        exact => exact,
    }
}

/// The products that are wanted and have an effect, all retained.
pub(crate) fn unreduced(
    candidates: &[Monomial],
    columns: &[Vec<ExprId>],
    wanted: &dyn Fn(&Monomial) -> bool,
) -> Reduction {
    let is_zero = |column: &Vec<ExprId>| column.iter().all(|x| *x == Graph::ZERO);
    let pick = |zero: bool| -> Vec<Monomial> {
        let pairs = candidates.iter().zip(columns);
        let found = pairs.filter(|(product, column)| wanted(product) && is_zero(column) == zero);
        found.map(|(product, _)| product.clone()).collect()
    };
    let products = pick(false);
    Reduction {
        retained: (0..products.len()).collect(),
        without_effect: pick(true),
        products,
        dependencies: Vec::new(),
        method: Method::Unreduced,
    }
}

fn reduce_exactly(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    candidates: &[Monomial],
    effective: &[usize],
    order: &[usize],
    outputs: &[ExprId],
) -> Result<Reduction, DeriveError> {
    let regressor = sampled(graph, mechanism, projection, outputs, effective.len())?;
    let mut stream = Stream::new(SEED);
    let pattern = Pattern::find(&regressor, order, &mut stream)?;
    let roots = root_radicands(graph, outputs, projection);
    let variables = occurrences(graph, outputs, projection);
    let factors = factors::of(
        &pattern,
        &regressor,
        &variables,
        &roots,
        factors::MOST_OPERATIONS,
        &mut stream,
    )?;
    let names = |k: usize| candidates[effective[k]].clone();
    let reduction = pattern.reduction(mechanism, candidates, &names, factors)?;
    reduction.confirm(&regressor, &pattern.shown, &mut stream)?;
    Ok(reduction)
}

/// Prepares the evaluation of so many columns, drive by drive.
fn sampled(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    outputs: &[ExprId],
    n_columns: usize,
) -> Result<SampledRegressor, DeriveError> {
    Ok(SampledRegressor {
        sampler: Sampler::new(graph, mechanism, projection, outputs)?,
        n_columns,
        idle: if has_sign(graph, outputs) {
            IDLE_WITH_SIGNS
        } else {
            IDLE
        },
    })
}

/// In which ways the constants occur in the columns and in the loops.
fn occurrences(
    graph: &Graph,
    outputs: &[ExprId],
    projection: &Projection,
) -> Vec<reconstruct::Occurrence> {
    let mut roots = outputs.to_vec();
    roots.extend(&projection.residual);
    let mut found = BTreeSet::new();
    for node in graph.nodes_of(&roots) {
        match node {
            Node::Atom(Atom::Constant(i)) => _ = found.insert((*i, false)),
            Node::Sin(angle) | Node::Cos(angle) => {
                found.extend(angle.atoms().filter_map(|atom| match atom {
                    Atom::Constant(i) => Some((i, true)),
                    _ => None,
                }));
            }
            _ => {}
        }
    }
    found.into_iter().collect()
}

/// The regressor's effective columns at random points of motion.
struct SampledRegressor {
    sampler: Sampler,
    n_columns: usize,
    /// How many points in a row must show nothing new.
    idle: usize,
}

impl SampledRegressor {
    /// The rows of H at one random point.
    fn point<const P: u64>(
        &self,
        constants: &FieldPoint<Element<P>>,
        stream: &mut Stream,
    ) -> Result<Vec<Vec<Element<P>>>, DeriveError> {
        let values = self.sampler.draw(constants, stream)?;
        Ok(values
            .chunks(self.n_columns.max(1))
            .map(<[Element<P>]>::to_vec)
            .collect())
    }

    /// Rows of W for one set of constants, reduced, until they show nothing new or `rank` is reached.
    fn echelon<const P: u64>(
        &self,
        constants: &FieldPoint<Element<P>>,
        order: &[usize],
        rank: Option<usize>,
        stream: &mut Stream,
    ) -> Result<Echelon<P>, DeriveError> {
        let mut echelon = Echelon::new(order);
        let mut idle = 0;
        while self.n_columns > 0 && idle < self.idle && Some(echelon.pivots.len()) != rank {
            idle += 1;
            for row in self.point(constants, stream)? {
                if echelon.insert(row) {
                    idle = 0;
                }
            }
        }
        Ok(echelon)
    }
}

/// Which columns depend on which, as seen for one random set of constants; columns by position among the effective ones.
struct Pattern {
    /// Columns that are not identically zero.
    shown: Vec<usize>,
    /// Retained columns, sorted.
    pivots: Vec<usize>,
    /// Columns that depend on them.
    dependent: Vec<usize>,
    /// Pairs of a dependent and a retained column with a factor that does not vanish.
    wanted: Vec<(usize, usize)>,
    /// The same dependences, also between columns that are closer together.
    relations: Vec<Relation>,
}

impl Pattern {
    fn find(
        regressor: &SampledRegressor,
        order: &[usize],
        stream: &mut Stream,
    ) -> Result<Self, DeriveError> {
        let n = regressor.n_columns;
        let constants = regressor.sampler.constants::<MODULUS>(stream)?;
        let echelon = regressor.echelon(&constants, order, None, stream)?;
        let shown: Vec<usize> = (0..n).filter(|k| echelon.is_seen(*k)).collect();
        let mut pivots = echelon.pivots.clone();
        pivots.sort_unstable();
        let dependent: Vec<usize> = shown
            .iter()
            .copied()
            .filter(|k| !pivots.contains(k))
            .collect();
        let wanted = dependent
            .iter()
            .flat_map(|j| pivots.iter().map(move |p| (*j, *p)))
            .filter(|(j, p)| echelon.entry(*p, *j).is_some_and(|x| x != Element::ZERO))
            .collect();
        let order: Vec<usize> = (order.iter().copied())
            .filter(|k| shown.contains(k))
            .collect();
        let relations = relations::find(&echelon, &order, &dependent);
        Ok(Self {
            shown,
            pivots,
            dependent,
            wanted,
            relations,
        })
    }

    fn reduction(
        &self,
        mechanism: &Mechanism,
        candidates: &[Monomial],
        name: &dyn Fn(usize) -> Monomial,
        factors: Vec<Option<RationalFunction>>,
    ) -> Result<Reduction, DeriveError> {
        let position = |k: usize| {
            self.shown
                .iter()
                .position(|x| *x == k)
                .expect("a column with an effect is shown")
        };
        let mut dependencies: Vec<Dependency> = self
            .dependent
            .iter()
            .map(|j| Dependency {
                product: position(*j),
                equals: Vec::new(),
            })
            .collect();
        for ((j, p), factor) in self.wanted.iter().zip(factors) {
            let retained = self
                .pivots
                .iter()
                .position(|x| x == p)
                .expect("a wanted pivot is one");
            let line = self
                .dependent
                .iter()
                .position(|x| x == j)
                .expect("a wanted column is dependent");
            let factor = factor.ok_or_else(|| DeriveError::FactorNotRecovered {
                product: name(*j).text(mechanism),
                retained: name(*p).text(mechanism),
            })?;
            dependencies[line].equals.push((retained, factor));
        }
        let products: Vec<Monomial> = self.shown.iter().map(|k| name(*k)).collect();
        Ok(Reduction {
            without_effect: candidates
                .iter()
                .filter(|c| !products.contains(c))
                .cloned()
                .collect(),
            retained: self.pivots.iter().map(|p| position(*p)).collect(),
            products,
            dependencies,
            method: Method::Exact {
                confirmed_at: CONFIRMED_WITH * CONFIRMED_AT,
            },
        })
    }
}

impl Reduction {
    /// Shows `H p_g = H_min p_min` for random parameters at fresh points of motion with fresh constants.
    fn confirm(
        &self,
        regressor: &SampledRegressor,
        shown: &[usize],
        stream: &mut Stream,
    ) -> Result<(), DeriveError> {
        /// A field that had no part in finding it.
        const FRESH: u64 = PRIMES[PRIMES.len() - 1];
        for _ in 0..CONFIRMED_WITH {
            let constants = regressor.sampler.constants::<FRESH>(stream)?;
            let parameters: Vec<Element<FRESH>> =
                self.products.iter().map(|_| stream.element()).collect();
            let mut base: Vec<Element<FRESH>> =
                self.retained.iter().map(|k| parameters[*k]).collect();
            for line in &self.dependencies {
                for (k, factor) in &line.equals {
                    let factor = factor.value(&constants).ok_or(DeriveError::RankChanged)?;
                    base[*k] = base[*k] + factor * parameters[line.product];
                }
            }
            for _ in 0..CONFIRMED_AT {
                for row in regressor.point(&constants, stream)? {
                    let sum = |terms: &mut dyn Iterator<Item = (usize, Element<FRESH>)>| {
                        terms.fold(Element::ZERO, |s, (k, p)| s + row[k] * p)
                    };
                    let full = sum(&mut shown.iter().copied().zip(parameters.iter().copied()));
                    let reduced = sum(&mut self
                        .retained
                        .iter()
                        .map(|k| shown[*k])
                        .zip(base.iter().copied()));
                    if full != reduced {
                        return Err(DeriveError::NotConfirmed);
                    }
                }
            }
        }
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
