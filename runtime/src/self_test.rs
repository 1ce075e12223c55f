//! Self-test of an emitted model: are the base parameters complete, and is none of them redundant?
//!
//! The rows of H and of H_min at random states go into R factors, whose singular values give the ranks. The forces of
//! all parameters are compared with those of the base parameters. The test allocates nothing.
//!
//! Decision: the test is emitted on request, because H for all products is as long as H_min again. Rotations give
//! the R factor and one-sided rotations its singular values, so that it needs no allocation and no linear algebra
//! crate, and uses the same random states on every machine.

use core::fmt;

use crate::{PoseError, RandomBits, Real};

/// With columns of length 1, a singular value below this share of the largest counts as zero. Forces agree if they
/// differ by less than this share of their terms.
const ZERO_SHARE: f64 = 1e-9;

/// Random numbers around those of a model, the same on every machine.
#[derive(Clone, Copy, Debug)]
pub struct Random(RandomBits);

impl Random {
    /// A stream that starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(RandomBits::new(seed))
    }

    /// Uniform between two numbers.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + self.0.below_one() * (high - low)
    }

    /// The value times a random factor of 0.5 to 1.5; the factor itself if the value is 0.
    pub fn perturb(&mut self, value: f64) -> f64 {
        let factor = self.uniform(0.5, 1.5);
        if value == 0.0 { factor } else { value * factor }
    }
}

/// Why the self-test of an emitted model failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SelfTestError {
    /// The model can be evaluated at too few random states around the nominal pose.
    TooFewStates {
        /// Number of states at which it can be evaluated.
        found: usize,
        /// Number of states required.
        needed: usize,
        /// Error at the last state that failed.
        last: PoseError,
    },
    /// The rank of a regressor is not the number of base parameters.
    Rank {
        /// Which regressor: `H` for all products of parameters, or `H_min`.
        of: &'static str,
        /// Rank by singular values.
        found: usize,
        /// Number of base parameters.
        expected: usize,
    },
    /// The geometry is special: a denominator of the base parameters is zero.
    Geometry(crate::SpecialGeometry),
    /// Base parameters do not give the forces of all parameters.
    Forces {
        /// Which forces: of `H_min p_min`, or of the inverse dynamics.
        of: &'static str,
        /// Force by all products of parameters.
        expected: f64,
        /// Force by base parameters.
        found: f64,
    },
}

impl From<crate::SpecialGeometry> for SelfTestError {
    fn from(special: crate::SpecialGeometry) -> Self {
        Self::Geometry(special)
    }
}

impl fmt::Display for SelfTestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Geometry(special) => special.fmt(f),
            Self::TooFewStates { found, needed, last } => write!(
                f,
                "the model can be evaluated at only {found} of {needed} random states around the nominal pose; the \
                 last failure was: {last}"
            ),
            Self::Rank { of, found, expected } => write!(
                f,
                "{of} has rank {found} at random states, but the model has {expected} base parameters"
            ),
            Self::Forces { of, expected, found } => write!(
                f,
                "{of} gives a force of {found}, but all parameters together give {expected}"
            ),
        }
    }
}

impl core::error::Error for SelfTestError {}

/// Receives a row of H, the row of H_min, and the force of the inverse dynamics at one random state.
pub type ShowRows<'a, const N_PRODUCTS: usize, const N_BASE: usize> =
    dyn FnMut(&[f64; N_PRODUCTS], &[f64; N_BASE], f64) + 'a;

/// Tests base parameters: ranks of H and H_min, and forces by all parameters, by base parameters and by the inverse
/// dynamics.
///
/// `products` and `base` are values of both for one set of parameters. `rows` draws a state, within the given share of
/// its reach around the nominal pose, and passes on its rows.
///
/// # Errors
/// The first failure; see [`SelfTestError`].
pub fn self_test<const N_PRODUCTS: usize, const N_BASE: usize>(
    products: &[f64; N_PRODUCTS],
    base: &[f64; N_BASE],
    mut rows: impl FnMut(&mut Random, f64, &mut ShowRows<'_, N_PRODUCTS, N_BASE>) -> Result<(), PoseError>,
) -> Result<(), SelfTestError> {
    /// How often the range of the states is halved before the test fails.
    const HALVINGS: usize = 4;
    let needed = 2 * N_PRODUCTS + 20;
    let mut all = GivensFactor::<N_PRODUCTS>::new();
    let mut few = GivensFactor::<N_BASE>::new();
    let mut random = Random::new(1);
    let (mut found, mut reach, mut last) = (0, 1.0, PoseError::OutOfReach);
    let mut worst: Option<SelfTestError> = None;
    // States are drawn from a smaller and smaller range until enough of them can be evaluated.
    for _ in 0..=HALVINGS {
        for _ in 0..needed {
            if found == needed {
                break;
            }
            let shown = rows(&mut random, reach, &mut |h, h_min, force| {
                all.add(*h);
                few.add(*h_min);
                let (expected, size) = product_and_magnitude(h, products);
                let (reduced, reduced_size) = product_and_magnitude(h_min, base);
                let limit = ZERO_SHARE * (size + reduced_size);
                for (of, found) in [("H_min p_min", reduced), ("the inverse dynamics", force)] {
                    // Written so that NaN fails as well.
                    let holds = Real::abs(found - expected) <= limit;
                    if worst.is_none() && !holds {
                        worst = Some(SelfTestError::Forces { of, expected, found });
                    }
                }
            });
            match shown {
                Ok(()) => found += 1,
                Err(error) => last = error,
            }
        }
        reach *= 0.5;
    }
    if found < needed {
        return Err(SelfTestError::TooFewStates { found, needed, last });
    }
    // Both regressors must have as many independent columns as there are base parameters.
    for (of, found) in [("H_min", few.rank()), ("H", all.rank())] {
        if found != N_BASE {
            return Err(SelfTestError::Rank {
                of,
                found,
                expected: N_BASE,
            });
        }
    }
    worst.map_or(Ok(()), Err)
}

/// A row times a column, and the sum of the magnitudes of its terms.
fn product_and_magnitude<const N: usize>(row: &[f64; N], column: &[f64; N]) -> (f64, f64) {
    let terms = row.iter().zip(column).map(|(a, b)| a * b);
    terms.fold((0.0, 0.0), |(sum, size), term| (sum + term, size + Real::abs(term)))
}

/// The R factor of a QR factorisation that takes row after row by rotations (Givens 1958).
struct GivensFactor<const N: usize>([[f64; N]; N]);

impl<const N: usize> GivensFactor<N> {
    fn new() -> Self {
        Self([[0.0; N]; N])
    }

    /// Adds a row by rotations that set its entries to zero one after the other.
    fn add(&mut self, mut row: [f64; N]) {
        for (k, own) in self.0.iter_mut().enumerate() {
            let (Some(a), Some(b)) = (own.get(k).copied(), row.get(k).copied()) else {
                return;
            };
            if b == 0.0 {
                continue;
            }
            let length = Real::sqrt(a * a + b * b);
            let (c, s) = (a / length, b / length);
            for (x, y) in own.iter_mut().zip(&mut row) {
                (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
            }
        }
    }

    /// How many singular values are not zero, with all columns of length 1 (one-sided rotations; Hestenes 1958).
    fn rank(mut self) -> usize {
        const SWEEPS: usize = 30;
        const ROUNDING: f64 = 1e-15;
        // Columns are stored as rows, so that two of them can be rotated at once.
        let mut columns = [[0.0; N]; N];
        for (i, row) in self.0.iter_mut().enumerate() {
            for (column, x) in columns.iter_mut().zip(row) {
                if let Some(slot) = column.get_mut(i) {
                    *slot = *x;
                }
            }
        }
        for column in &mut columns {
            let length = Real::sqrt(dot(column, column));
            if length > 0.0 {
                for x in column {
                    *x /= length;
                }
            }
        }
        // Pairs of columns are rotated until all of them are orthogonal; their lengths are then the singular values.
        for _ in 0..SWEEPS {
            let mut turned = false;
            for q in 1..N {
                let (before, behind) = columns.split_at_mut(q);
                let Some(second) = behind.first_mut() else {
                    continue;
                };
                for first in before {
                    let (a, b, mixed) = (dot(first, first), dot(second, second), dot(first, second));
                    if Real::abs(mixed) <= ROUNDING * Real::sqrt(a * b) || a * b == 0.0 {
                        continue;
                    }
                    turned = true;
                    let zeta = (b - a) / (2.0 * mixed);
                    let sign = if zeta < 0.0 { -1.0 } else { 1.0 };
                    let t = sign / (Real::abs(zeta) + Real::sqrt(1.0 + zeta * zeta));
                    let c = 1.0 / Real::sqrt(1.0 + t * t);
                    let s = c * t;
                    for (x, y) in first.iter_mut().zip(second.iter_mut()) {
                        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
                    }
                }
            }
            if !turned {
                break;
            }
        }
        let sizes = columns.map(|column| Real::sqrt(dot(&column, &column)));
        let largest = sizes.iter().fold(0.0, |m: f64, x| if *x > m { *x } else { m });
        sizes.iter().filter(|x| **x > ZERO_SHARE * largest).count()
    }
}

/// Scalar product.
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).fold(0.0, |sum, (x, y)| sum + x * y)
}
