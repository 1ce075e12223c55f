//! Forces that no library of effects holds, made from the true motion of the drives.
//!
//! A spring of third order is none of them: over the travel of a spindle a ripple beside a spring says as much.

use std::f64::consts::PI;

use crate::plant::{DRIVES, PlantMotion};
use crate::random::{CaseRandom, three_digits};

/// A law of one drive, the other being number `1 - at`.
#[derive(Clone, Debug, PartialEq)]
pub struct OutsideForce {
    /// Which law.
    pub law: OutsideLaw,
    /// Which drive feels it.
    pub at: usize,
    /// Its size: N, or what makes N of the law's function.
    pub size: f64,
    /// What shapes it: a length in m, a frequency in Hz or 1/m, or nothing.
    shape: f64,
}

/// The laws. `l` is the length of the drive, `m` that of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutsideLaw {
    /// `size * m'`: this drive alone feels the other's rate.
    OtherRate,
    /// `size * l' * m'`
    ProductOfRates,
    /// A spring that drags a block along: the stretch is at most `shape`, and what it is depends on the way there.
    Hysteresis,
    /// `size * sin(2 pi l shape) * l'`: viscous friction that differs from place to place, beside `size * l'`.
    FrictionByPlace,
    /// `size * (l - shape)` beyond a length, nothing before.
    Stop,
    /// The whole force is cut where it is beyond `size`.
    Saturation,
    /// `size * t`
    Drift,
    /// `size * sin(2 pi shape t)`
    Hum,
}

impl OutsideLaw {
    /// All of them, in the order in which cases take them.
    pub const ALL: [Self; 8] = [
        Self::OtherRate,
        Self::ProductOfRates,
        Self::Hysteresis,
        Self::FrictionByPlace,
        Self::Stop,
        Self::Saturation,
        Self::Drift,
        Self::Hum,
    ];

    /// Its name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::OtherRate => "rate of the other drive",
            Self::ProductOfRates => "product of both rates",
            Self::Hysteresis => "hysteresis",
            Self::FrictionByPlace => "friction that differs by place",
            Self::Stop => "elastic stop",
            Self::Saturation => "saturation",
            Self::Drift => "drift in time",
            Self::Hum => "hum in time",
        }
    }

    /// What it is called among the disturbances of recordings, if it is one.
    pub fn disturbance(self) -> Option<&'static str> {
        match self {
            Self::Drift => Some("offset_drift"),
            Self::Hum => Some("periodic_in_time"),
            _ => None,
        }
    }
}

impl std::fmt::Display for OutsideForce {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { law, at, size, shape } = self;
        write!(f, "{} at {} (size {size}, shape {shape})", law.name(), DRIVES[*at])
    }
}

impl OutsideForce {
    /// Draws a drive and a shape; the size is one.
    pub fn draw(law: OutsideLaw, random: &mut CaseRandom) -> Self {
        let shape = match law {
            OutsideLaw::Hysteresis => random.uniform_between(0.02, 0.06),
            OutsideLaw::FrictionByPlace => random.uniform_between(4.0, 20.0),
            OutsideLaw::Stop => random.uniform_between(0.76, 0.82),
            OutsideLaw::Hum => random.log_between(2.0, 20.0),
            _ => 0.0,
        };
        Self {
            law,
            at: random.below(2),
            size: if matches!(
                law,
                OutsideLaw::OtherRate | OutsideLaw::ProductOfRates | OutsideLaw::Drift
            ) {
                random.sign()
            } else {
                1.0
            },
            shape: three_digits(shape),
        }
    }

    /// The same, larger or smaller.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            size: three_digits(self.size * factor),
            ..self.clone()
        }
    }

    /// What it adds to the forces along a motion: samples times drives.
    pub fn added(&self, along: &PlantMotion) -> Vec<f64> {
        let own = along.of_drive(self.at);
        let other = along.of_drive(1 - self.at);
        let mut rows = vec![0.0; along.plain.len()];
        let mut block = own.first().map_or(0.0, |m| m.value);
        for (i, (l, m)) in own.iter().zip(&other).enumerate() {
            let row = DRIVES.len() * i + self.at;
            let unit = match self.law {
                OutsideLaw::OtherRate => m.rate,
                OutsideLaw::ProductOfRates => l.rate * m.rate,
                OutsideLaw::Hysteresis => {
                    block = block.clamp(l.value - self.shape, l.value + self.shape);
                    (l.value - block) / self.shape
                }
                OutsideLaw::FrictionByPlace => (1.0 + libm::sin(2.0 * PI * self.shape * l.value)) * l.rate,
                OutsideLaw::Stop => (l.value - self.shape).max(0.0),
                OutsideLaw::Saturation => {
                    let force = along.plain[row];
                    rows[row] = force.clamp(-self.size, self.size) - force;
                    continue;
                }
                OutsideLaw::Drift => along.times[i],
                OutsideLaw::Hum => libm::sin(2.0 * PI * self.shape * along.times[i]),
            };
            rows[row] = self.size * unit;
        }
        rows
    }
}
