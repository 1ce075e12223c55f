//! Forces of one drive that no effect of the library represents, computed from the true motion.

use modelmill_lab::plant::{DRIVES, PlantMotion};
use modelmill_lab::random::{CaseRandom, three_digits};

/// Position limits of the coordinates in the model file, rad.
const RANGES: [[f64; 2]; 2] = [[1.50, 2.10], [1.04, 1.64]];

/// A law at a drive.
pub(crate) struct Law {
    /// The kind of law.
    what: What,
    /// Index of the drive on which it acts.
    pub(crate) at: usize,
    /// Factor of the law's function, so that the product is in N.
    pub(crate) size: f64,
    /// Parameter of the law: a share of the range, a time (s), a power, an angular wave number or a length (m).
    shape: f64,
}

/// Kinds of laws. `q` is the coordinate of the drive; a prime marks a rate.
#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    /// `size` times the distance beyond a position, zero before it. `shape` is the position as a share of the range.
    Stop,
    /// `size * q' * exp(-t / shape)`
    Fading,
    /// `size * |q'|^shape`, with the same sign in both directions.
    Even,
    /// `size * other q * q'`
    Product,
    /// `size * sin(shape * q) * q'`
    Sine,
    /// Dry friction of `size` with hysteresis over the length `shape` (P. R. Dahl 1976).
    Memory,
}

impl Law {
    /// The law of a kind of case with drawn parameter; `None` if the kind has no law.
    pub(crate) fn draw(kind: &str, at: usize, random: &mut CaseRandom) -> Option<Self> {
        let (what, shape) = match kind {
            "end-stop" => {
                let shape = random.uniform_between(0.7, 0.85);
                let is_upper = random.chance(0.5);
                (What::Stop, if is_upper { shape } else { 1.0 - shape })
            }
            "fading-friction" => (What::Fading, random.uniform_between(3.0, 8.0)),
            "power-even" => (What::Even, random.uniform_between(1.3, 1.7)),
            "product" => (What::Product, 0.0),
            "sine-rate" => (What::Sine, random.uniform_between(2.0, 5.0)),
            "hysteresis" => (What::Memory, random.log_between(0.002, 0.008)),
            _ => return None,
        };
        Some(Self {
            what,
            at,
            size: 1.0,
            shape: three_digits(shape),
        })
    }

    /// The forces that it adds along a motion, N, samples times drives.
    pub(crate) fn added(&self, along: &PlantMotion) -> Vec<f64> {
        let drive = along.of_drive(self.at);
        let mut rows = vec![0.0; along.plain.len()];
        let (mut state, mut before) = (0.0_f64, drive.first().map_or(0.0, |one| one.value));
        for (i, (one, now)) in along.states.iter().zip(&drive).enumerate() {
            let (q, qd) = (one.q[self.at], one.qd[self.at]);
            rows[DRIVES.len() * i + self.at] = self.size
                * match self.what {
                    What::Stop if self.shape > 0.5 => (q - self.place()).max(0.0),
                    What::Stop => (q - self.place()).min(0.0),
                    What::Fading => now.rate * libm::exp(-along.times[i].max(0.0) / self.shape),
                    What::Even => libm::pow(qd.abs(), self.shape),
                    What::Product => one.q[1 - self.at] * qd,
                    What::Sine => libm::sin(self.shape * q) * qd,
                    What::Memory => {
                        let moved = now.value - before;
                        before = now.value;
                        let bound = if moved < 0.0 { -1.0 } else { 1.0 };
                        let kept = libm::exp(-moved.abs() / self.shape);
                        state = bound + (state - bound) * kept;
                        state
                    }
                };
        }
        rows
    }

    /// Position at which a stop begins, rad.
    fn place(&self) -> f64 {
        let [low, high] = RANGES[self.at];
        low + self.shape * (high - low)
    }

    /// Whether the model has friction of both drives in cases with this law.
    pub(crate) fn has_known_friction(&self) -> bool {
        self.what == What::Memory
    }

    /// The law as text for the truth.
    pub(crate) fn says(&self) -> String {
        let words = match self.what {
            What::Stop => "an elastic stop beyond a position",
            What::Fading => "viscous friction that fades",
            What::Even => "a power of the rate with the same sign in both directions",
            What::Product => "the other coordinate times the rate",
            What::Sine => "viscous friction multiplied by a sine of the position",
            What::Memory => "friction with hysteresis",
        };
        let Self { size, shape, .. } = self;
        format!("{words} at {} (size {size}, shape {shape})", DRIVES[self.at])
    }

    /// Patterns of words that name it.
    pub(crate) fn named_by(&self) -> Vec<String> {
        let words = match self.what {
            What::Stop => r"\bstop\b|one-sided|beyond",
            What::Fading => r"drift|fad(e|es|ing)|with time|in time|over time",
            What::Even => r"\^\s*1\.[0-9]",
            What::Product => r"theta[12]\s*\*\s*theta[12]_d",
            What::Sine => r"sin\(",
            What::Memory => r"hystere|presliding|dahl|bristle|memory",
        };
        vec![words.to_owned()]
    }

    /// Effects, kind and place, that describe it correctly.
    pub(crate) fn also(&self) -> Vec<[String; 2]> {
        match self.what {
            What::Fading => self.placed(&["friction_drift"], false),
            What::Memory => self.placed(&["dahl_friction"], true),
            _ => Vec::new(),
        }
    }

    /// Approximations that are accepted if the verdict is `unexplained`.
    pub(crate) fn tolerated(&self) -> Vec<[String; 2]> {
        match self.what {
            What::Fading | What::Product | What::Sine => self.placed(&["viscous_friction"], true),
            What::Even => self.placed(&["directional_viscous_friction", "force_offset"], true),
            What::Stop | What::Memory => Vec::new(),
        }
    }

    /// Kinds at the drive, and if requested at its coordinate.
    fn placed(&self, kinds: &[&str], at_coordinate: bool) -> Vec<[String; 2]> {
        let mut places = vec![DRIVES[self.at].to_owned()];
        if at_coordinate {
            places.push(format!("theta{}", self.at + 1));
        }
        let of = |kind: &&str| {
            let kind = (*kind).to_owned();
            places.clone().into_iter().map(move |at| [kind.clone(), at])
        };
        kinds.iter().flat_map(of).collect()
    }
}
