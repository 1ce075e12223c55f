//! The result of a reduction: the retained products, and every other product's column as a combination of theirs.

use std::collections::BTreeMap;
use std::ops::{Add, Mul};

use super::rational_function::RationalFunction;
use crate::DeriveError;
use crate::tree::expressions::ParameterMonomial;

/// The result: which columns are retained, and how the others are combined from them.
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
    /// The method that found it.
    pub method: ReductionMethod,
}

/// The method by which a reduction was found.
#[derive(Clone, Debug, PartialEq)]
pub enum ReductionMethod {
    /// In the prime field: it is valid for all values of the constants except special ones. With `at_values` it is
    /// valid for the values of the file only.
    Exact {
        /// Number of points of motion, with fresh constants, at which `H p_g = H_min p_min` was confirmed.
        confirmed_at: usize,
        /// Whether the constants were replaced by numbers, so that the result is valid for the file's values alone.
        at_values: bool,
    },
    /// No reduction: every requested product is retained.
    Unreduced,
    /// From the values of the model file, with many digits. Recognised factors are exact, others are rounded numbers.
    Numeric {
        /// Residual of the retained column that is nearest to being dependent on the others, relative to its size.
        least_kept: f64,
        /// The same for the dependent column with the largest residual.
        most_dropped: f64,
        /// Largest residual of a dependent column at further states, relative to its terms.
        residual: f64,
        /// Largest change of a constant, in rad or relative to its size, with which loops close that have more equations
        /// than needed; `None` without a change.
        constant_change: Option<f64>,
        /// Why there is no exact reduction.
        because: Box<DeriveError>,
    },
}

impl ReductionMethod {
    /// The limitation of the reduction as a sentence for the reader; `None` if it is valid for general values.
    pub fn caution(&self) -> Option<String> {
        match self {
            Self::Exact { at_values: false, .. } | Self::Unreduced => None,
            Self::Exact { .. } => Some(
                "the constants are replaced by the values of this file: base and equations are valid for these values \
                 only"
                    .to_owned(),
            ),
            Self::Numeric {
                because,
                residual,
                most_dropped,
                constant_change,
                ..
            } => Some(format!(
                "the base parameters were computed numerically from the values of this file: {because}; factors are \
                 rounded (residual {residual:.1e} of a column), and base and factors are valid for these values only; \
                 the dependences were verified to {} digits and not proved{}",
                n_verified_digits(*most_dropped),
                constant_change.map_or_else(String::new, |change| format!("; {}", constant_change_text(change)))
            )),
        }
    }
}

/// Number of digits to which dependences hold whose columns leave a residual of `most_dropped`.
pub(crate) fn n_verified_digits(most_dropped: f64) -> i32 {
    /// Digits of the numbers that are used.
    const MOST: f64 = 130.0;
    #[expect(clippy::cast_possible_truncation, reason = "at most 130")]
    let n = -most_dropped.max(f64::MIN_POSITIVE).log10().clamp(-MOST, 0.0).ceil() as i32;
    n
}

/// The statement that loops close only with changed constants, as a clause.
pub(crate) fn constant_change_text(change: f64) -> String {
    format!(
        "the loops have more equations than needed, and these agree only with constants that differ from the file by up \
         to {change:.0e} (rounding, relative or in rad), which were used"
    )
}

/// One line of eq. (6): `h_j = sum of a_k h_k`.
#[derive(Clone, Debug)]
pub struct ColumnDependency {
    /// Position of the eliminated product in [`BaseReduction::products`].
    pub product: usize,
    /// Positions in [`BaseReduction::retained`] with the factors.
    pub equals: Vec<(usize, RationalFunction)>,
    /// Positions in [`BaseReduction::products`] of other dependent products with the factors: these columns are
    /// combinations themselves. Empty if the factors on retained columns are not longer.
    pub via: Vec<(usize, RationalFunction)>,
}

impl BaseReduction {
    /// The factors of every dependent product on retained ones alone, by position in [`BaseReduction::retained`];
    /// `None` if `value` returns `None` for a factor.
    pub fn factors_by<T>(&self, value: &dyn Fn(&RationalFunction) -> Option<T>) -> Option<Vec<BTreeMap<usize, T>>>
    where
        T: Clone + Add<Output = T> + Mul<Output = T>,
    {
        let mut all: Vec<BTreeMap<usize, T>> = vec![BTreeMap::new(); self.dependencies.len()];
        // Lines that others refer to come first, so their factors are complete when they are needed.
        for i in self.lines_in_dependency_order() {
            let line = &self.dependencies[i];
            let mut found: BTreeMap<usize, T> = BTreeMap::new();
            // Adds to the factor on retained column k.
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

    /// The same in double precision, for constants in the order of the model file.
    pub fn factors(&self, constants: &[f64]) -> Vec<BTreeMap<usize, f64>> {
        let found = self.factors_by(&|factor| Some(factor.value_f64(constants)));
        found.expect("floating point has a value for everything")
    }

    /// Index in `dependencies` of a dependent product.
    pub(crate) fn line_of(&self, product: usize) -> usize {
        let line = self.dependencies.iter().position(|line| line.product == product);
        line.expect("what a product goes by is dependent")
    }

    /// Indices of all lines, each after the lines that it refers to.
    pub(crate) fn lines_in_dependency_order(&self) -> Vec<usize> {
        let mut order = Vec::with_capacity(self.dependencies.len());
        let mut is_done = vec![false; self.dependencies.len()];
        for start in 0..self.dependencies.len() {
            // Depth-first search: a line is complete after all lines that it refers to.
            let mut open = vec![start];
            while let Some(i) = open.last().copied() {
                let via = self.dependencies[i].via.iter();
                let next = via.map(|(product, _)| self.line_of(*product)).find(|l| !is_done[*l]);
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
