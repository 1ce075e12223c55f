//! What a reduction says: which products are retained, and how all others follow.

use super::rational_function::RationalFunction;
use crate::DeriveError;
use crate::tree::expressions::Monomial;

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
            Self::Exact {
                at_values: false, ..
            }
            | Self::Unreduced => None,
            Self::Exact { .. } => Some(
                "the constants stand as the numbers of this file: base and equations hold for these values alone".to_owned(),
            ),
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
