//! Forces of one drive that no library of effects holds, made from the true motion.

use modelmill_lab::plant::{DRIVES, PlantMotion};
use modelmill_lab::random::{CaseRandom, three_digits};

/// Between which angles the model file lets the coordinates turn, rad.
const RANGES: [[f64; 2]; 2] = [[1.50, 2.10], [1.04, 1.64]];

/// A law at a drive.
pub(crate) struct Law {
    what: What,
    /// Which drive feels it.
    pub(crate) at: usize,
    /// What makes N of the law's function.
    pub(crate) size: f64,
    /// What shapes it: a place in rad, a time in s, a power, a number of waves or a length in m.
    shape: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    /// `size` times the way beyond a place, nothing before: `shape` from the lower to the upper end of the limits.
    Stop,
    /// `size * q' * exp(-t / shape)`
    Fading,
    /// `size * |q'|^shape`, the same sign in both directions.
    Even,
    /// `size * other q * q'`
    Product,
    /// `size * sin(shape * q) * q'`
    Sine,
    /// Dry friction of `size` that remembers over a length (P. R. Dahl 1976).
    Memory,
}

impl Law {
    /// The law of a kind of case, if it has one.
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

    /// What it adds to the forces along a motion: samples times drives.
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

    /// Where a stop begins, rad.
    fn place(&self) -> f64 {
        let [low, high] = RANGES[self.at];
        low + self.shape * (high - low)
    }

    /// Whether the model knows friction of both drives beside it.
    pub(crate) fn has_known_friction(&self) -> bool {
        self.what == What::Memory
    }

    pub(crate) fn says(&self) -> String {
        let words = match self.what {
            What::Stop => "a stop beyond a place",
            What::Fading => "viscous friction that fades",
            What::Even => "a power of the rate, the same in both directions",
            What::Product => "the other coordinate times the rate",
            What::Sine => "friction that comes and goes with the place",
            What::Memory => "friction with memory",
        };
        let Self { size, shape, .. } = self;
        format!("{words} at {} (size {size}, shape {shape})", DRIVES[self.at])
    }

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

    /// Effects that name it truly.
    pub(crate) fn also(&self) -> Vec<[String; 2]> {
        match self.what {
            What::Fading => self.placed(&["friction_drift"], false),
            What::Memory => self.placed(&["dahl_friction"], true),
            _ => Vec::new(),
        }
    }

    /// Approximations that may be named beside a rest that is not explained.
    pub(crate) fn tolerated(&self) -> Vec<[String; 2]> {
        match self.what {
            What::Fading | What::Product | What::Sine => self.placed(&["viscous_friction"], true),
            What::Even => self.placed(&["directional_viscous_friction", "force_offset"], true),
            What::Stop | What::Memory => Vec::new(),
        }
    }

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
