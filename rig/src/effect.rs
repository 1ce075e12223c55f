//! Effects: additions of friction, rotors, springs, rods, tools and others to the force of a drive, in a joint, at a
//! point, to gravity or to the measured forces.
//!
//! A place's value, rate, acceleration and load go in, and the additional force or torque at that place
//! comes out. Effects with mass are in `massive`. The kinds have the names that model files use, and their laws are
//! those of the library of effects.
//! Sources: the laws are textbook ones, e.g. B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, "A survey of
//! models, analysis tools and compensation methods for the control of machines with friction" (1994);
//! the coupled drive is the wrist of the Staubli TX40 (M. Gautier, A. Jubien).

use std::f64::consts::PI;

use crate::dynamics::ScalarMotion;
use crate::rig::Rig;

/// An effect in a rig. [`Rig::effect`] creates one from names; a program may also construct it directly.
#[derive(Clone, Debug, PartialEq)]
pub struct RigEffect {
    /// The law with its values.
    pub law: RigLaw,
    /// The places; indices refer to the rig.
    pub places: Vec<RigPlace>,
}

/// The place where an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RigPlace {
    /// A drive, by index.
    Drive(usize),
    /// A joint with one coordinate, by index.
    Joint(usize),
    /// A point, by index.
    Point(usize),
    /// The complete base.
    Base,
    /// All measured forces.
    Force,
}

/// A law with its values, in SI units of the place: N and m, or N m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(non_snake_case, reason = "symbols as in model files")]
pub enum RigLaw {
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
    /// `mu*abs(load)*sign(rate)`; the load is the drive's force for all masses, before friction and the like
    LoadFriction {
        /// Coefficient.
        mu: f64,
    },
    /// `Ia*acceleration`
    DriveInertia {
        /// Mass or inertia that acts at the place.
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
        /// Value without force.
        rest: f64,
    },
    /// `As*sin(2*pi*value/pitch) + Ac*cos(2*pi*value/pitch)`
    ForceRipple {
        /// Amplitude of the sine.
        As: f64,
        /// Amplitude of the cosine.
        Ac: f64,
        /// Period.
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
    /// A slender rod along a linear drive: it rotates about the drive's first point and slides through the second.
    RodInertia {
        /// Mass, kg.
        m: f64,
        /// Distance of its centre of mass from the first point, m.
        c: f64,
        /// Inertia about its centre across the rod, kg m^2.
        I: f64,
    },
    /// A mass at a point.
    PointMass {
        /// Mass, kg.
        m: f64,
    },
    /// Of two points of one body: the moments of a mass at the first point are computed as if it were at the second.
    LumpedMassPlacement {
        /// Mass, kg.
        m: f64,
    },
    /// The base is rotated against the vertical by this rotation vector, rad: gravity is rotated back by it.
    GravityTilt {
        /// About x.
        tx: f64,
        /// About y.
        ty: f64,
        /// About z.
        tz: f64,
    },
    /// All forces are read with this delay, s.
    TimeDelay {
        /// Delay, s.
        T: f64,
    },
}

/// A value of a kind of effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueOfKind {
    /// Its symbol, as in model files.
    pub symbol: &'static str,
    /// Its default; a value without a default must be given.
    pub default: Option<f64>,
    /// Whether it must be above zero (lengths), or not below zero (masses, delays).
    pub sign: ValueSign,
}

/// The range of valid values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueSign {
    /// Any finite number.
    Any,
    /// Zero or above.
    NotNegative,
    /// Above zero.
    Positive,
}

/// Any finite number, without a default.
const fn any_value(symbol: &'static str) -> ValueOfKind {
    ValueOfKind {
        symbol,
        default: None,
        sign: ValueSign::Any,
    }
}

/// Any finite number; zero by default.
const fn zero_by_default(symbol: &'static str) -> ValueOfKind {
    ValueOfKind {
        symbol,
        default: Some(0.0),
        sign: ValueSign::Any,
    }
}

/// A number of at least zero, without a default.
const fn not_negative_value(symbol: &'static str) -> ValueOfKind {
    ValueOfKind {
        symbol,
        default: None,
        sign: ValueSign::NotNegative,
    }
}

/// A number above zero.
const fn positive_value(symbol: &'static str, default: Option<f64>) -> ValueOfKind {
    ValueOfKind {
        symbol,
        default,
        sign: ValueSign::Positive,
    }
}

impl RigLaw {
    /// Names of all kinds.
    pub const KINDS: [&'static str; 17] = [
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
        "rod_inertia",
        "point_mass",
        "lumped_mass_placement",
        "gravity_tilt",
        "time_delay",
    ];

    /// The values of a kind, in a fixed order; `None` for an unknown kind.
    pub fn values(kind: &str) -> Option<&'static [ValueOfKind]> {
        Some(match kind {
            "viscous_friction" => const { &[any_value("Fv")] },
            "coulomb_friction" => const { &[any_value("Fc")] },
            "stribeck_friction" => const { &[any_value("Fs"), positive_value("vs", Some(0.02))] },
            "quadratic_friction" => const { &[any_value("Fq")] },
            "directional_viscous_friction" => const { &[any_value("Fvp"), any_value("Fvn")] },
            "directional_coulomb_friction" => const { &[any_value("Fcp"), any_value("Fcn")] },
            "load_friction" => const { &[any_value("mu")] },
            "drive_inertia" => const { &[any_value("Ia")] },
            "force_offset" => const { &[any_value("F0")] },
            "spring" => const { &[any_value("k"), zero_by_default("rest")] },
            "force_ripple" => {
                const {
                    &[
                        zero_by_default("As"),
                        zero_by_default("Ac"),
                        positive_value("pitch", None),
                    ]
                }
            }
            "coupled_drive" => const { &[zero_by_default("Ia"), zero_by_default("Fv"), zero_by_default("Fs")] },
            "rod_inertia" => const { &[not_negative_value("m"), any_value("c"), not_negative_value("I")] },
            "point_mass" | "lumped_mass_placement" => const { &[any_value("m")] },
            "gravity_tilt" => const { &[zero_by_default("tx"), zero_by_default("ty"), zero_by_default("tz")] },
            "time_delay" => const { &[not_negative_value("T")] },
            _ => return None,
        })
    }

    /// The law of a kind with the values of [`RigLaw::values`] in their order; `None` for an unknown kind or another
    /// number of values.
    pub(crate) fn new(kind: &str, values: &[f64]) -> Option<Self> {
        Some(match (kind, values) {
            ("viscous_friction", &[Fv]) => Self::ViscousFriction { Fv },
            ("coulomb_friction", &[Fc]) => Self::CoulombFriction { Fc },
            ("stribeck_friction", &[Fs, vs]) => Self::StribeckFriction { Fs, vs },
            ("quadratic_friction", &[Fq]) => Self::QuadraticFriction { Fq },
            ("directional_viscous_friction", &[Fvp, Fvn]) => Self::DirectionalViscousFriction { Fvp, Fvn },
            ("directional_coulomb_friction", &[Fcp, Fcn]) => Self::DirectionalCoulombFriction { Fcp, Fcn },
            ("load_friction", &[mu]) => Self::LoadFriction { mu },
            ("drive_inertia", &[Ia]) => Self::DriveInertia { Ia },
            ("force_offset", &[F0]) => Self::ForceOffset { F0 },
            ("spring", &[k, rest]) => Self::Spring { k, rest },
            ("force_ripple", &[As, Ac, pitch]) => Self::ForceRipple { As, Ac, pitch },
            ("coupled_drive", &[Ia, Fv, Fs]) => Self::CoupledDrive { Ia, Fv, Fs },
            ("rod_inertia", &[m, c, I]) => Self::RodInertia { m, c, I },
            ("point_mass", &[m]) => Self::PointMass { m },
            ("lumped_mass_placement", &[m]) => Self::LumpedMassPlacement { m },
            ("gravity_tilt", &[tx, ty, tz]) => Self::GravityTilt { tx, ty, tz },
            ("time_delay", &[T]) => Self::TimeDelay { T },
            _ => return None,
        })
    }

    /// The name of its kind and its values by symbol.
    pub fn kind_and_values(&self) -> (&'static str, Vec<(&'static str, f64)>) {
        let (kind, values): (&str, Vec<f64>) = match *self {
            Self::ViscousFriction { Fv } => ("viscous_friction", vec![Fv]),
            Self::CoulombFriction { Fc } => ("coulomb_friction", vec![Fc]),
            Self::StribeckFriction { Fs, vs } => ("stribeck_friction", vec![Fs, vs]),
            Self::QuadraticFriction { Fq } => ("quadratic_friction", vec![Fq]),
            Self::DirectionalViscousFriction { Fvp, Fvn } => ("directional_viscous_friction", vec![Fvp, Fvn]),
            Self::DirectionalCoulombFriction { Fcp, Fcn } => ("directional_coulomb_friction", vec![Fcp, Fcn]),
            Self::LoadFriction { mu } => ("load_friction", vec![mu]),
            Self::DriveInertia { Ia } => ("drive_inertia", vec![Ia]),
            Self::ForceOffset { F0 } => ("force_offset", vec![F0]),
            Self::Spring { k, rest } => ("spring", vec![k, rest]),
            Self::ForceRipple { As, Ac, pitch } => ("force_ripple", vec![As, Ac, pitch]),
            Self::CoupledDrive { Ia, Fv, Fs } => ("coupled_drive", vec![Ia, Fv, Fs]),
            Self::RodInertia { m, c, I } => ("rod_inertia", vec![m, c, I]),
            Self::PointMass { m } => ("point_mass", vec![m]),
            Self::LumpedMassPlacement { m } => ("lumped_mass_placement", vec![m]),
            Self::GravityTilt { tx, ty, tz } => ("gravity_tilt", vec![tx, ty, tz]),
            Self::TimeDelay { T } => ("time_delay", vec![T]),
        };
        let symbols = Self::values(kind).unwrap_or(&[]).iter().map(|value| value.symbol);
        (kind, symbols.zip(values).collect())
    }

    /// The force at a drive or in a joint in addition to the load; `other` is the motion of the other place of a
    /// coupled drive. Zero for effects that act elsewhere.
    pub(crate) fn force(&self, at: ScalarMotion, load: f64, other: ScalarMotion) -> f64 {
        let way = sign(at.rate);
        match *self {
            Self::ViscousFriction { Fv } => Fv * at.rate,
            Self::CoulombFriction { Fc } => Fc * way,
            Self::StribeckFriction { Fs, vs } => {
                let share = at.rate / vs;
                Fs * way * libm::exp(-share * share)
            }
            Self::QuadraticFriction { Fq } => Fq * at.rate * at.rate.abs(),
            Self::DirectionalViscousFriction { Fvp, Fvn } => at.rate * if at.rate > 0.0 { Fvp } else { Fvn },
            // At standstill the mean of both values, as in the library's expression.
            Self::DirectionalCoulombFriction { Fcp, Fcn } => 0.5 * (Fcp * (1.0 + way) - Fcn * (1.0 - way)),
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
            Self::RodInertia { .. }
            | Self::PointMass { .. }
            | Self::LumpedMassPlacement { .. }
            | Self::GravityTilt { .. }
            | Self::TimeDelay { .. } => 0.0,
        }
    }
}

impl RigEffect {
    /// Forces of the effect at drives and in joints, each with its place. `measured` returns the motion of a
    /// place, and `load` the force of a drive before friction and other effects.
    pub(crate) fn forces(
        &self,
        measured: impl Fn(RigPlace) -> ScalarMotion,
        load: impl Fn(usize) -> f64,
    ) -> Vec<(RigPlace, f64)> {
        let n = self.places.len();
        let acts = |place: &RigPlace| matches!(place, RigPlace::Drive(_) | RigPlace::Joint(_));
        let places = self.places.iter().enumerate().filter(|(_, place)| acts(place));
        places
            .map(|(i, place)| {
                let other = measured(self.places[(i + 1) % n]);
                let load = match place {
                    RigPlace::Drive(drive) => load(*drive),
                    _ => 0.0,
                };
                (*place, self.law.force(measured(*place), load, other))
            })
            .collect()
    }
}

impl RigPlace {
    /// The quantity that is measured at the place, if it is a drive or a joint with one coordinate.
    pub(crate) fn pair(self, rig: &Rig) -> Option<&crate::pair::PairFunction> {
        match self {
            Self::Drive(drive) => Some(&rig.drives.get(drive)?.measures),
            Self::Joint(joint) => rig.joints.get(joint)?.motion.as_ref(),
            Self::Point(_) | Self::Base | Self::Force => None,
        }
    }
}

/// The sign of a number: -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}
