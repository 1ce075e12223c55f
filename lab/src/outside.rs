//! Forces that no effect of the library represents, computed from the true motion of the drives.
//!
//! A cubic spring is not one of them: over the travel of a spindle, a spring with a ripple represents it as well.

use std::f64::consts::PI;

use crate::plant::{DRIVES, PlantMotion};
use crate::random::{CaseRandom, three_digits};

/// A law that acts on drive `at`, with its size and shape. The other drive has number `1 - at`.
#[derive(Clone, Debug, PartialEq)]
pub struct OutsideForce {
    /// The law.
    pub law: OutsideLaw,
    /// Index of the drive on which it acts.
    pub at: usize,
    /// Factor of the law's function, so that the product is in N; for saturation the limit, N.
    pub size: f64,
    /// Parameter of the law: a length, m, or a frequency, Hz or 1/m; zero if it has none.
    shape: f64,
}

/// The laws. `l` is the length of the drive and `m` that of the other, m; a prime marks a rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutsideLaw {
    /// `size * m'`: a force on this drive that is proportional to the rate of the other.
    OtherRate,
    /// `size * l' * m'`
    ProductOfRates,
    /// A spring that drags a block: its elongation is at most `shape` and depends on the path.
    Hysteresis,
    /// `size * (1 + sin(2 pi l shape)) * l'`: viscous friction that depends on the position.
    FrictionByPlace,
    /// `size * (l - shape)` beyond the length `shape`, zero below.
    Stop,
    /// The magnitude of the total force is limited to `size`.
    Saturation,
    /// `size * t`: a force that grows with time.
    Drift,
    /// `size * sin(2 pi shape t)`: a force that is periodic in time.
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

    /// The kind under which the program reports it as a disturbance of the recordings, if it does.
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
    /// Draws a drive and a shape; the size is 1, or -1 for some laws.
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

    /// The same law with its size multiplied by a factor and rounded to three digits.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            size: three_digits(self.size * factor),
            ..self.clone()
        }
    }

    /// The forces that it adds along a motion, N, samples times drives; zero for the other drive.
    pub fn added(&self, along: &PlantMotion) -> Vec<f64> {
        let own = along.of_drive(self.at);
        let other = along.of_drive(1 - self.at);
        let mut rows = vec![0.0; along.plain.len()];
        // Position of the dragged block, m: the memory of the hysteresis.
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
                // The limited force minus the force without effects.
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
