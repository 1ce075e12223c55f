//! Why a valid model file may still have no derivation.
//! `DeriveError` has one variant per cause. Its text states what was found, what it means and what to do.

use std::fmt;

use modelmill_spec::ExactExpression;

/// A mechanism for which no equations can be derived, with what the text about it needs.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeriveError {
    /// An expression is used in a way that has no meaning here.
    Unsupported {
        /// The fault, as the first part of the text.
        why: &'static str,
        /// The expression in which it occurs.
        expression: String,
    },
    /// A linear system is singular for every pose.
    Singular {
        /// The unknowns of the system, in the plural or with an article: it follows "the linear equations for".
        what: String,
    },
    /// A linear system is larger than cofactors should solve.
    TooLarge {
        /// The unknowns of the system.
        what: String,
        /// Number of coupled unknowns.
        size: usize,
        /// Largest number of unknowns that is solved symbolically.
        limit: usize,
    },
    /// Products of sums of parameters have too many terms after expansion.
    TooManyTerms {
        /// Largest number of terms.
        limit: usize,
    },
    /// The loops do not determine the passive coordinates, or determine too much.
    LoopCount {
        /// Number of independent closure equations.
        equations: usize,
        /// Number of passive coordinates.
        passive: usize,
    },
    /// The loops or the drives are singular at the nominal pose.
    SingularNominal,
    /// There must be one drive per degree of freedom.
    DriveCount {
        /// Number of drives.
        drives: usize,
        /// Number of degrees of freedom.
        freedoms: usize,
    },
    /// No order was found in which every loop is a planar dyad, so that it cannot be sampled exactly.
    LoopsNotSampled {
        /// Names of the loops.
        loops: Vec<String>,
    },
    /// Signs of square roots do not distinguish the assembly modes, for example those of a mechanism that can be flat.
    BranchesNotSeparated {
        /// Names of the loops.
        loops: Vec<String>,
    },
    /// No random draw gave a point on the variety of the closure equations.
    NoPointFound {
        /// Number of draws.
        draws: usize,
    },
    /// A number is NaN or infinite.
    NotFinite {
        /// Which number.
        what: String,
        /// The remedy, as the last part of the text.
        todo: &'static str,
    },
    /// At the file's values retained columns are almost dependent, so that rounding makes forces from p_min wrong.
    DigitsLost {
        /// Error of the forces, relative to their size.
        lost: String,
        /// Retained products whose columns are almost dependent.
        retained: Vec<String>,
        /// Dependent products whose factors on these are too large.
        dependent: Vec<String>,
    },
    /// A factor of eq. (6) is no rational function of reasonable size.
    FactorNotRecovered {
        /// The eliminated product.
        product: String,
        /// The retained product.
        retained: String,
    },
    /// The symbolic search for the factors of eq. (6) took too many operations.
    FactorsTooLong {
        /// Operations in the prime field until the search was stopped.
        operations: u64,
    },
    /// The force of an effect is not affine in the accelerations.
    NotAffine {
        /// Its name in the model file.
        effect: String,
    },
    /// The rank differs between two random sets of constants.
    RankChanged,
    /// The final check at new random points failed.
    NotConfirmed,
    /// The caller requested to stop.
    Stopped,
}

impl DeriveError {
    /// An expression that has no meaning where it stands; `why` is the first part of the text.
    pub(crate) fn unsupported(why: &'static str, expression: &ExactExpression) -> Self {
        Self::Unsupported {
            why,
            expression: format!("{expression:?}"),
        }
    }
}

impl fmt::Display for DeriveError {
    /// One line without a full stop at its end; the caller adds the place in the model file.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsupported { why, expression } => write!(f, "{why}: {expression}"),
            Self::Singular { what } => write!(
                f,
                "the linear equations for {what} are singular at every pose; check that the passive coordinates can close the loops and that every drive moves something"
            ),
            Self::TooLarge { what, size, limit } => {
                write!(
                    f,
                    "the linear equations for {what} have {size} coupled unknowns; at most {limit} can be solved symbolically"
                )
            }
            Self::TooManyTerms { limit } => write!(
                f,
                "powers or products of sums of parameters expand to more than {limit} products of parameters; define such a sum as one parameter"
            ),
            Self::LoopCount { equations, passive } => write!(
                f,
                "the loops give {equations} independent equations for {passive} passive coordinates; mark as many coordinates passive as there are equations"
            ),
            Self::SingularNominal => f.write_str(
                "the nominal pose is singular: there the active coordinates do not determine the passive ones, or a drive moves nothing; choose other nominal values of the coordinates",
            ),
            Self::DriveCount { drives, freedoms } => {
                write!(
                    f,
                    "the model has {drives} drives for {freedoms} degrees of freedom; give it one drive per degree of freedom"
                )
            }
            Self::LoopsNotSampled { loops } => write!(
                f,
                "the loops {} cannot be solved symbolically: no order was found in which each of them determines the coordinates that it closes with",
                loops.join(", ")
            ),
            Self::BranchesNotSeparated { loops } => write!(
                f,
                "the loops {} cannot be solved symbolically: their assembly modes meet or depend on each other, so the signs of square roots do not distinguish them",
                loops.join(", ")
            ),
            Self::NoPointFound { draws } => {
                write!(
                    f,
                    "no pose was found in {draws} draws at which all loops close and every passive joint and drive can move; check that the loops do not contradict each other, that each passive joint moves when the active ones do, and that every drive moves with them"
                )
            }
            Self::NotFinite { what, todo } => {
                write!(f, "{what} is no finite number; {todo}")
            }
            Self::DigitsLost {
                lost,
                retained,
                dependent,
            } => {
                // The products are quoted so that the list can be copied into the model file.
                let quoted: Vec<String> = dependent.iter().map(|p| format!("\"{p}\"")).collect();
                write!(
                    f,
                    "with the file's values the columns of {} are almost linearly dependent, although for general values they \
                     are not: {} would depend on them with factors so large that forces from the base parameters are wrong by \
                     {lost} of their size; retain other products (`retain = [{}]` at the head of the file), or change the \
                     constants that cause this",
                    retained.join(", "),
                    dependent.join(", "),
                    quoted.join(", ")
                )
            }
            Self::FactorNotRecovered { product, retained } => write!(
                f,
                "the factor between the columns of {product} and {retained} is no rational function of the constants of reasonable size"
            ),
            Self::FactorsTooLong { operations } => write!(
                f,
                "the factors between dependent columns were not found symbolically within {:.0e} operations; use fewer symbolic constants (write numbers for some)",
                *operations as f64
            ),
            Self::NotAffine { effect } => write!(
                f,
                "the effect `{effect}` is not affine in the accelerations, so the model has no mass matrix; the inverse dynamics is not affected"
            ),
            Self::RankChanged => f.write_str(
                "the rank of the regressor differs between two random sets of constants",
            ),
            Self::NotConfirmed => {
                f.write_str("the dependencies that were found are not valid at other poses")
            }
            Self::Stopped => f.write_str("the derivation was stopped before its end; allow more time"),
        }
    }
}

impl std::error::Error for DeriveError {}
