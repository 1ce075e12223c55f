//! What a reduction says: which products are retained, and how all others follow.

use std::collections::BTreeMap;
use std::ops::{Add, Mul};

use super::rational_function::RationalFunction;
use crate::DeriveError;
use crate::tree::expressions::ParameterMonomial;

/// The result: which columns are kept and how the others follow from them.
#[derive(Clone, Debug)]
pub struct BaseReduction {
    /// Products of parameters whose column is not zero, in the order of eq. (5): p_g.
    pub products: Vec<ParameterMonomial>,
    /// Products whose column is identically zero.
    pub without_effect: Vec<ParameterMonomial>,
    /// Positions in `products` of the retained columns, in the order of p_min.
    pub retained: Vec<usize>,
    /// Eq. (6): for every other product, by position, the retained ones (by position in `retained`) with their factors.
    pub dependencies: Vec<ColumnDependency>,
    /// How it was found.
    pub method: ReductionMethod,
}

/// How a reduction was found.
#[derive(Clone, Debug, PartialEq)]
pub enum ReductionMethod {
    /// In the prime field: it holds for all values of the constants but special ones, and for the file's own where these
    /// were put in their place.
    Exact {
        /// At how many points of motion `H p_g = H_min p_min` was shown, with fresh constants.
        confirmed_at: usize,
        /// Whether the constants stand as numbers, so that it holds for the file's values alone.
        at_values: bool,
    },
    /// Not at all: every product that was asked for is retained.
    Unreduced,
    /// On the model file's values, with many digits: factors that are recognised are written so, others are rounded numbers.
    Numeric {
        /// What the others leave of the retained column that is nearest to being dependent, relative to its size.
        least_kept: f64,
        /// The same for the dependent column that is furthest from it.
        most_dropped: f64,
        /// What the factors leave of a dependent column at further states, relative to its terms: the most of all.
        residual: f64,
        /// Why there is no exact reduction.
        because: Box<DeriveError>,
    },
}

impl ReductionMethod {
    /// What a reader of a numeric reduction must know, in words; `None` where the reduction holds for general values.
    pub fn caution(&self) -> Option<String> {
        match self {
            Self::Exact {
                at_values: false, ..
            }
            | Self::Unreduced => None,
            Self::Exact { .. } => Some(
                "the constants are replaced by the values of this file: base and equations are valid for these values \
                 only".to_owned(),
            ),
            Self::Numeric { because, residual, .. } => Some(format!(
                "the base parameters were computed numerically from the values of this file: {because}; factors are \
                 rounded (residual {residual:.1e} of a column), and base and factors are valid for these values only"
            )),
        }
    }
}

/// One line of eq. (6): `h_j = sum of a_k h_k`.
#[derive(Clone, Debug)]
pub struct ColumnDependency {
    /// Position of the eliminated product in [`Reduction::products`].
    pub product: usize,
    /// Positions in [`Reduction::retained`] with the factors.
    pub equals: Vec<(usize, RationalFunction)>,
    /// Positions in [`Reduction::products`] of other dependent products with the factors: their columns stand for what they
    /// equal in turn. None where it is no longer to write that out.
    pub via: Vec<(usize, RationalFunction)>,
}

impl BaseReduction {
    /// The factors of every dependent product on retained ones alone, by position in [`Reduction::retained`]; `None` where
    /// `value` has none for a factor.
    pub fn factors_by<T>(
        &self,
        value: &dyn Fn(&RationalFunction) -> Option<T>,
    ) -> Option<Vec<BTreeMap<usize, T>>>
    where
        T: Clone + Add<Output = T> + Mul<Output = T>,
    {
        let mut all: Vec<BTreeMap<usize, T>> = vec![BTreeMap::new(); self.dependencies.len()];
        for i in self.lines_in_dependency_order() {
            let line = &self.dependencies[i];
            let mut found: BTreeMap<usize, T> = BTreeMap::new();
            let mut add = |k: usize, term: T| {
                let sum = match found.remove(&k) {
                    Some(before) => before + term,
                    None => term,
                };
                found.insert(k, sum);
            };
            for (k, factor) in &line.equals {
                add(*k, value(factor)?);
            }
            for (product, factor) in &line.via {
                let factor = value(factor)?;
                for (k, inner) in &all[self.line_of(*product)] {
                    add(*k, factor.clone() * inner.clone());
                }
            }
            all[i] = found;
        }
        Some(all)
    }

    /// The same in floating point, for constants in the order of the model file.
    pub fn factors(&self, constants: &[f64]) -> Vec<BTreeMap<usize, f64>> {
        let found = self.factors_by(&|factor| Some(factor.value_f64(constants)));
        found.expect("floating point has a value for everything")
    }

    /// The line of a dependent product.
    pub(crate) fn line_of(&self, product: usize) -> usize {
        let line = self
            .dependencies
            .iter()
            .position(|line| line.product == product);
        line.expect("what a product goes by is dependent")
    }

    /// All lines, each after those that it goes by.
    pub(crate) fn lines_in_dependency_order(&self) -> Vec<usize> {
        let mut order = Vec::with_capacity(self.dependencies.len());
        let mut is_done = vec![false; self.dependencies.len()];
        for start in 0..self.dependencies.len() {
            let mut open = vec![start];
            while let Some(i) = open.last().copied() {
                let via = self.dependencies[i].via.iter();
                let next = via
                    .map(|(product, _)| self.line_of(*product))
                    .find(|l| !is_done[*l]);
                match next {
                    Some(next) => open.push(next),
                    None => {
                        open.pop();
                        if !std::mem::replace(&mut is_done[i], true) {
                            order.push(i);
                        }
                    }
                }
            }
        }
        order
    }
}
