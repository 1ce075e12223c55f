//! Why a valid model file may still have no derivation.

use std::fmt;

use modelmill_spec::ExactExpression;

/// A mechanism that the mill cannot derive, and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeriveError {
    /// An expression is used in a way that has no meaning here.
    Unsupported {
        /// What is wrong.
        why: &'static str,
        /// The expression.
        expression: String,
    },
    /// A linear system is singular for every pose.
    Singular {
        /// Which system.
        what: String,
    },
    /// A linear system is larger than cofactors should solve.
    TooLarge {
        /// Which system.
        what: String,
        /// Its size.
        size: usize,
        /// The largest size.
        limit: usize,
    },
    /// Products of sums of parameters, written out, have too many terms.
    TooManyTerms {
        /// The most that are taken.
        limit: usize,
    },
    /// The loops do not determine the passive coordinates, or determine too much.
    LoopCount {
        /// Independent equations.
        equations: usize,
        /// Passive coordinates.
        passive: usize,
    },
    /// The loops or the drives are singular at the nominal pose.
    SingularNominal,
    /// There must be one drive per degree of freedom.
    DriveCount {
        /// Drives.
        drives: usize,
        /// Degrees of freedom.
        freedoms: usize,
    },
    /// No order was found in which every loop is a planar dyad, so that it cannot be sampled exactly.
    LoopsNotSampled {
        /// Names of the loops.
        loops: Vec<String>,
    },
    /// Assembly modes that square roots cannot tell apart, as those of a mechanism that can be flat.
    BranchesNotSeparated {
        /// Names of the loops.
        loops: Vec<String>,
    },
    /// No point of the loops' variety came up.
    NoPointFound {
        /// How many draws were made.
        draws: usize,
    },
    /// A number that is infinite or none.
    NotFinite {
        /// Which number.
        what: String,
        /// What to do about it.
        todo: &'static str,
    },
    /// At the file's values retained columns all but coincide, so that forces from p_min have lost their digits.
    DigitsLost {
        /// Error of the forces, relative to their size.
        lost: String,
        /// Retained products whose columns all but coincide.
        retained: Vec<String>,
        /// Products that are written by these with huge factors.
        dependent: Vec<String>,
    },
    /// A factor of eq. (6) is no rational function of reasonable size.
    FactorNotRecovered {
        /// The eliminated product.
        product: String,
        /// The retained product.
        retained: String,
    },
    /// The factors of eq. (6) would take too long to find in symbols.
    FactorsTooLong {
        /// How many operations of the prime field were spent.
        operations: u64,
    },
    /// An effect asks for a force that is not affine in the accelerations.
    NotAffine {
        /// Its name in the model file.
        effect: String,
    },
    /// The rank differs between two random sets of constants.
    RankChanged,
    /// The final proof at fresh points failed.
    NotConfirmed,
}

impl DeriveError {
    pub(crate) fn unsupported(why: &'static str, expression: &ExactExpression) -> Self {
        Self::Unsupported {
            why,
            expression: format!("{expression:?}"),
        }
    }
}

impl fmt::Display for DeriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsupported { why, expression } => write!(f, "{why}: {expression}"),
            Self::Singular { what } => write!(
                f,
                "{what} are singular at every pose; check that the passive coordinates can move the loops shut and that every drive moves something"
            ),
            Self::TooLarge { what, size, limit } => {
                write!(
                    f,
                    "{what} make a coupled system of {size} unknowns; at most {limit} can be solved in symbols"
                )
            }
            Self::TooManyTerms { limit } => write!(
                f,
                "powers or products of sums of parameters make more than {limit} products of parameters; write such a sum as one parameter"
            ),
            Self::LoopCount { equations, passive } => write!(
                f,
                "the loops give {equations} independent equations for {passive} passive coordinates; mark as many coordinates passive as there are equations"
            ),
            Self::SingularNominal => f.write_str(
                "the nominal pose is singular: there the passive coordinates do not follow from the active ones, or a drive moves nothing; give the coordinates other nominal values",
            ),
            Self::DriveCount { drives, freedoms } => {
                write!(
                    f,
                    "{drives} drives for {freedoms} degrees of freedom; there must be one drive for each"
                )
            }
            Self::LoopsNotSampled { loops } => write!(
                f,
                "the loops {} cannot be solved in symbols: they are not planar, or no two coordinates of each can be solved for in turn",
                loops.join(", ")
            ),
            Self::BranchesNotSeparated { loops } => write!(
                f,
                "the loops {} cannot be solved in symbols: their assembly modes meet, or depend on each other, so that square roots cannot tell them apart",
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
                let quoted: Vec<String> = dependent.iter().map(|p| format!("\"{p}\"")).collect();
                write!(
                    f,
                    "with the file's values the columns of {} all but depend on each other, though for general values they do \
                     not: {} would be written by them with factors so large that forces from the base parameters are wrong by \
                     {lost} of their size; retain other products (`retain = [{}]` at the head of the file), or change the \
                     constants that make them coincide",
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
                "the factors between dependent columns were not found in symbols within {:.0e} operations; fewer symbolic constants (write numbers for some) take fewer",
                *operations as f64
            ),
            Self::NotAffine { effect } => write!(
                f,
                "the effect `{effect}` is not affine in the accelerations, so that there is no mass matrix; the inverse dynamics holds as it is"
            ),
            Self::RankChanged => f.write_str(
                "the rank differs between random constants",
            ),
            Self::NotConfirmed => {
                f.write_str("what was found does not hold at other poses")
            }
        }
    }
}

impl std::error::Error for DeriveError {}
