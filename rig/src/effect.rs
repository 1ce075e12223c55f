//! Effects: what friction, rotors, springs and the like add to the force of a drive or in a joint.
//!
//! A place's value, rate, acceleration and load go in, the force or torque that must be supplied there besides
//! comes out. The kinds bear the names that model files use, and their laws are those of the library of effects.
//! Sources: the laws are textbook ones, e.g. B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, "A survey of
//! models, analysis tools and compensation methods for the control of machines with friction" (1994);
//! the coupled drive is the wrist of the Staubli TX40 (M. Gautier, A. Jubien).

use std::f64::consts::PI;

use crate::dynamics::Measured;
use crate::rig::Rig;

/// An effect in a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// What it does.
    pub law: Law,
    /// Where.
    pub places: Vec<Place>,
}

/// Where an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A drive, by index.
    Drive(usize),
    /// A joint with one coordinate, by index.
    Joint(usize),
}

/// A law with its values, in SI units of the place: N and m, or N m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(non_snake_case, reason = "symbols as in model files")]
pub enum Law {
    /// `Fv*rate`
    ViscousFriction {
        /// Coefficient.
        Fv: f64,
    },
    /// `Fc*sign(rate)`
    CoulombFriction {
        /// Size.
        Fc: f64,
    },
    /// `Fs*sign(rate)*exp(-(rate/vs)^2)`
    StribeckFriction {
        /// Size near standstill.
        Fs: f64,
        /// Stribeck speed.
        vs: f64,
    },
    /// `Fq*rate*abs(rate)`
    QuadraticFriction {
        /// Coefficient.
        Fq: f64,
    },
    /// `Fvp*rate` while the place's value grows, `Fvn*rate` while it shrinks
    DirectionalViscousFriction {
        /// Coefficient while growing.
        Fvp: f64,
        /// Coefficient while shrinking.
        Fvn: f64,
    },
    /// `Fcp` while the place's value grows, `-Fcn` while it shrinks
    DirectionalCoulombFriction {
        /// Size while growing.
        Fcp: f64,
        /// Size while shrinking.
        Fcn: f64,
    },
    /// `mu*abs(load)*sign(rate)`; the load is the drive's force before any effect
    LoadFriction {
        /// Coefficient.
        mu: f64,
    },
    /// `Ia*acceleration`
    DriveInertia {
        /// Mass or inertia as felt at the place.
        Ia: f64,
    },
    /// `F0`
    ForceOffset {
        /// Force.
        F0: f64,
    },
    /// `k*(value - rest)`
    Spring {
        /// Stiffness.
        k: f64,
        /// Where it is at rest.
        rest: f64,
    },
    /// `As*sin(2*pi*value/pitch) + Ac*cos(2*pi*value/pitch)`
    ForceRipple {
        /// Amplitude of the sine.
        As: f64,
        /// Amplitude of the cosine.
        Ac: f64,
        /// Distance after which it repeats.
        pitch: f64,
    },
    /// At each of two places, with the other's motion: `Ia*acceleration + Fv*rate + Fs*sign(rate of both)`
    CoupledDrive {
        /// Inertia.
        Ia: f64,
        /// Viscous coefficient.
        Fv: f64,
        /// Dry friction, by the sum of both rates.
        Fs: f64,
    },
}

impl Law {
    /// Names of all kinds.
    pub const KINDS: [&'static str; 12] = [
        "viscous_friction",
        "coulomb_friction",
        "stribeck_friction",
        "quadratic_friction",
        "directional_viscous_friction",
        "directional_coulomb_friction",
        "load_friction",
        "drive_inertia",
        "force_offset",
        "spring",
        "force_ripple",
        "coupled_drive",
    ];

    /// The values that a kind takes: symbol, the value where none is given (none: it must be given), and whether
    /// it must be above zero. `None` for an unknown kind.
    pub(crate) fn values(kind: &str) -> Option<&'static [(&'static str, Option<f64>, bool)]> {
        Some(match kind {
            "viscous_friction" => &[("Fv", None, false)],
            "coulomb_friction" => &[("Fc", None, false)],
            "stribeck_friction" => &[("Fs", None, false), ("vs", Some(0.02), true)],
            "quadratic_friction" => &[("Fq", None, false)],
            "directional_viscous_friction" => &[("Fvp", None, false), ("Fvn", None, false)],
            "directional_coulomb_friction" => &[("Fcp", None, false), ("Fcn", None, false)],
            "load_friction" => &[("mu", None, false)],
            "drive_inertia" => &[("Ia", None, false)],
            "force_offset" => &[("F0", None, false)],
            "spring" => &[("k", None, false), ("rest", Some(0.0), false)],
            "force_ripple" => &[
                ("As", Some(0.0), false),
                ("Ac", Some(0.0), false),
                ("pitch", None, true),
            ],
            "coupled_drive" => &[
                ("Ia", Some(0.0), false),
                ("Fv", Some(0.0), false),
                ("Fs", Some(0.0), false),
            ],
            _ => return None,
        })
    }

    /// The law of a kind with the values of [`Law::values`] in their order; `None` for an unknown kind or another
    /// number of values.
    pub(crate) fn new(kind: &str, values: &[f64]) -> Option<Self> {
        Some(match (kind, values) {
            ("viscous_friction", &[Fv]) => Self::ViscousFriction { Fv },
            ("coulomb_friction", &[Fc]) => Self::CoulombFriction { Fc },
            ("stribeck_friction", &[Fs, vs]) => Self::StribeckFriction { Fs, vs },
            ("quadratic_friction", &[Fq]) => Self::QuadraticFriction { Fq },
            ("directional_viscous_friction", &[Fvp, Fvn]) => {
                Self::DirectionalViscousFriction { Fvp, Fvn }
            }
            ("directional_coulomb_friction", &[Fcp, Fcn]) => {
                Self::DirectionalCoulombFriction { Fcp, Fcn }
            }
            ("load_friction", &[mu]) => Self::LoadFriction { mu },
            ("drive_inertia", &[Ia]) => Self::DriveInertia { Ia },
            ("force_offset", &[F0]) => Self::ForceOffset { F0 },
            ("spring", &[k, rest]) => Self::Spring { k, rest },
            ("force_ripple", &[As, Ac, pitch]) => Self::ForceRipple { As, Ac, pitch },
            ("coupled_drive", &[Ia, Fv, Fs]) => Self::CoupledDrive { Ia, Fv, Fs },
            _ => return None,
        })
    }

    /// Whether the law depends on the load, which only a drive has.
    pub(crate) fn needs_load(&self) -> bool {
        matches!(self, Self::LoadFriction { .. })
    }

    /// What must be supplied at a place beside its load; `other` is the other place of a coupled drive.
    pub(crate) fn force(&self, at: Measured, load: f64, other: Measured) -> f64 {
        let way = sign(at.rate);
        match *self {
            Self::ViscousFriction { Fv } => Fv * at.rate,
            Self::CoulombFriction { Fc } => Fc * way,
            Self::StribeckFriction { Fs, vs } => {
                let share = at.rate / vs;
                Fs * way * libm::exp(-share * share)
            }
            Self::QuadraticFriction { Fq } => Fq * at.rate * at.rate.abs(),
            Self::DirectionalViscousFriction { Fvp, Fvn } => {
                at.rate * if at.rate > 0.0 { Fvp } else { Fvn }
            }
            // At standstill the mean of both, as the library's expression has it.
            Self::DirectionalCoulombFriction { Fcp, Fcn } => {
                0.5 * (Fcp * (1.0 + way) - Fcn * (1.0 - way))
            }
            Self::LoadFriction { mu } => mu * load.abs() * way,
            Self::DriveInertia { Ia } => Ia * at.acceleration,
            Self::ForceOffset { F0 } => F0,
            Self::Spring { k, rest } => k * (at.value - rest),
            Self::ForceRipple { As, Ac, pitch } => {
                let phase = 2.0 * PI * at.value / pitch;
                As * libm::sin(phase) + Ac * libm::cos(phase)
            }
            Self::CoupledDrive { Ia, Fv, Fs } => {
                Ia * other.acceleration + Fv * other.rate + Fs * sign(at.rate + other.rate)
            }
        }
    }
}

impl Effect {
    /// Forces that the effect adds, each with its place; `measured` gives the motion of a place and `load` the
    /// force of a drive before any effect.
    pub(crate) fn forces(
        &self,
        measured: impl Fn(Place) -> Measured,
        load: impl Fn(usize) -> f64,
    ) -> Vec<(Place, f64)> {
        let n = self.places.len();
        self.places
            .iter()
            .enumerate()
            .map(|(i, place)| {
                let other = measured(self.places[(i + 1) % n]);
                let load = match place {
                    Place::Drive(drive) => load(*drive),
                    Place::Joint(_) => 0.0,
                };
                (*place, self.law.force(measured(*place), load, other))
            })
            .collect()
    }
}

impl Place {
    /// What is measured at the place.
    pub(crate) fn pair(self, rig: &Rig) -> Option<&crate::pair::Pair> {
        match self {
            Self::Drive(drive) => Some(&rig.drives[drive].measures),
            Self::Joint(joint) => rig.joints[joint].motion.as_ref(),
        }
    }
}

/// -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}
