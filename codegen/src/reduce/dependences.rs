//! Dependences between columns at random points of the field, and the confirmation of a reduction at fresh points.

use modelmill_algebra::field::{FieldElement, MODULUS, PRIMES, RandomStream};
use modelmill_spec::Mechanism;

use super::reduction::{BaseReduction, ColumnDependency, ReductionMethod};
use super::relations::{self, ColumnRelation, DependentColumn, TreeStructure};
use super::sample::SampledRegressor;
use crate::DeriveError;
use crate::tree::expressions::ParameterMonomial;

/// Number of sets of constants with which a result is confirmed.
const CONFIRMED_WITH: usize = 4;
/// Number of points of motion for each of them.
const CONFIRMED_AT: usize = 2;

/// Which columns depend on which, for one random set of constants. Columns are numbered among those with an effect.
pub(super) struct DependenceStructure {
    /// Columns that are not identically zero.
    pub(super) shown: Vec<usize>,
    /// Retained columns, sorted.
    pub(super) pivots: Vec<usize>,
    /// Columns that depend on them.
    pub(super) dependent: Vec<usize>,
    /// Pairs of a dependent and a retained column with a factor that does not vanish.
    pub(super) wanted: Vec<(usize, usize)>,
    /// The same dependences, also between columns that depend on each other more directly.
    pub(super) relations: Vec<ColumnRelation>,
    /// Number of points of motion that were sampled.
    pub(super) n_points: usize,
}

impl DependenceStructure {
    /// Samples the regressor and eliminates; columns that come first in `order` are retained first. In a `tree`, columns
    /// are near if their links are.
    pub(super) fn find_dependences(
        regressor: &SampledRegressor,
        tree: &TreeStructure,
        order: &[usize],
        stream: &mut RandomStream,
    ) -> Result<Self, DeriveError> {
        let n = regressor.n_columns;
        let constants = regressor.sampler.constants::<MODULUS>(stream)?;
        let (echelon, n_points) = regressor.reduced_rows(&constants, order, None, stream)?;
        let shown: Vec<usize> = (0..n).filter(|k| echelon.has_nonzero_value(*k)).collect();
        let mut pivots = echelon.pivots.clone();
        pivots.sort_unstable();
        // Columns without a pivot depend on the retained ones.
        let dependent: Vec<usize> = shown.iter().copied().filter(|k| !pivots.contains(k)).collect();
        let wanted = dependent
            .iter()
            .flat_map(|j| pivots.iter().map(move |p| (*j, *p)))
            // Factors that vanish at random constants vanish always.
            .filter(|(j, p)| echelon.entry(*p, *j).is_some_and(|x| x != FieldElement::ZERO))
            .collect();
        let order: Vec<usize> = (order.iter().copied()).filter(|k| shown.contains(k)).collect();
        let mut relations = relations::find_relations(&echelon, tree, &constants, &order, &dependent);
        if let Some(tree) = &tree.columns
            && let Some(values) = tree.evaluate(&constants)
        {
            for relation in relations.iter_mut().filter(|r| r.factors.is_none()) {
                relation.compare_with_tree(tree, &values, &echelon);
            }
        }
        Ok(Self {
            shown,
            pivots,
            dependent,
            wanted,
            relations,
            n_points,
        })
    }

    /// The reduction from the factors of all dependent columns; `name` returns the product of a column.
    ///
    /// # Errors
    /// [`DeriveError::FactorNotRecovered`] if a factor is `None`.
    pub(super) fn reduction(
        &self,
        mechanism: &Mechanism,
        candidates: &[ParameterMonomial],
        name: &dyn Fn(usize) -> ParameterMonomial,
        lines: Vec<DependentColumn>,
    ) -> Result<BaseReduction, DeriveError> {
        let position = |k: usize| {
            self.shown
                .iter()
                .position(|x| *x == k)
                .expect("a column with an effect is shown")
        };
        // One line per dependent column, filled below.
        let mut dependencies: Vec<ColumnDependency> = self
            .dependent
            .iter()
            .map(|j| ColumnDependency {
                product: position(*j),
                equals: Vec::new(),
                via: Vec::new(),
            })
            .collect();
        for written in lines {
            let j = written.column;
            let line = (self.dependent.iter().position(|x| *x == j)).expect("a written column is dependent");
            for (p, factor) in written.factors {
                let factor = factor.ok_or_else(|| DeriveError::FactorNotRecovered {
                    product: name(j).text(mechanism),
                    retained: name(p).text(mechanism),
                })?;
                // A factor belongs to a retained column, or to another dependent one.
                match self.pivots.iter().position(|x| *x == p) {
                    Some(retained) => dependencies[line].equals.push((retained, factor)),
                    None => dependencies[line].via.push((position(p), factor)),
                }
            }
        }
        let products: Vec<ParameterMonomial> = self.shown.iter().map(|k| name(*k)).collect();
        Ok(BaseReduction {
            without_effect: candidates.iter().filter(|c| !products.contains(c)).cloned().collect(),
            retained: self.pivots.iter().map(|p| position(*p)).collect(),
            products,
            dependencies,
            method: ReductionMethod::Exact {
                confirmed_at: CONFIRMED_WITH * CONFIRMED_AT,
                at_values: mechanism.has_numeric_constants,
            },
        })
    }
}

impl BaseReduction {
    /// Confirms `H p_g = H_min p_min` for random parameters at fresh points of motion with fresh constants.
    ///
    /// # Errors
    /// [`DeriveError::NotConfirmed`] if it is not true, [`DeriveError::RankChanged`] if a factor has no value there.
    pub(super) fn confirm_reduction(
        &self,
        regressor: &SampledRegressor,
        shown: &[usize],
        stream: &mut RandomStream,
    ) -> Result<(), DeriveError> {
        /// A field that was not used to find the reduction.
        const FRESH: u64 = PRIMES[PRIMES.len() - 1];
        for _ in 0..CONFIRMED_WITH {
            let constants = regressor.sampler.constants::<FRESH>(stream)?;
            // Random parameters, and the base parameters that eq. (7) gives for them.
            let parameters: Vec<FieldElement<FRESH>> = self.products.iter().map(|_| stream.next_element()).collect();
            let mut base: Vec<FieldElement<FRESH>> = self.retained.iter().map(|k| parameters[*k]).collect();
            let factors = self
                .factors_by(&|factor| factor.value(&constants))
                .ok_or(DeriveError::RankChanged)?;
            for (line, factors) in self.dependencies.iter().zip(factors) {
                for (k, factor) in factors {
                    base[k] = base[k] + factor * parameters[line.product];
                }
            }
            // Both sides at fresh points of motion.
            for _ in 0..CONFIRMED_AT {
                for row in regressor.draw_rows(&constants, stream)? {
                    let sum = |terms: &mut dyn Iterator<Item = (usize, FieldElement<FRESH>)>| {
                        terms.fold(FieldElement::ZERO, |s, (k, p)| s + row[k] * p)
                    };
                    let full = sum(&mut shown.iter().copied().zip(parameters.iter().copied()));
                    let reduced = sum(&mut self.retained.iter().map(|k| shown[*k]).zip(base.iter().copied()));
                    if full != reduced {
                        return Err(DeriveError::NotConfirmed);
                    }
                }
            }
        }
        Ok(())
    }
}
