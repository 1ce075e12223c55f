//! Laws from the literature that the library lacks, computed from the true motion, with the variables of a right
//! proposal.
//!
//! Sources: B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994): friction over speed, load and
//! place, rising static friction; A. Simoni et al., and W. Khalil, E. Dombre, "Modeling, Identification and Control of
//! Robots" (2002): friction by load and of coupled axes; V. I. Johannes et al., Rev. Sci. Instrum. 44 (1973): friction
//! with hysteresis; H. Hertz 1882: contacts whose friction grows with a power of the load; P. R. N. Childs: drag of
//! turbulent and of disc flow, `v^1.5`, `v^3`; A. G. Jack et al.: detents of magnets.

use modelmill_lab::random::{CaseRandom, three_digits};

use super::scene::{Place, Scene};

/// A law planted at a place.
#[derive(Clone, Debug)]
pub(crate) struct Planted {
    pub(crate) law: Law,
    pub(crate) at: String,
    /// The other place on whose motion it depends.
    pub(crate) other: Option<String>,
    pub(crate) size: f64,
    /// Parameters between 0 and 1.
    pub(crate) shape: [f64; 2],
}

/// `x`, `v`, `a`, `F` are position, rate, acceleration and load of the place; `y`, `w` position and rate of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Law {
    /// `y v`
    Coupling,
    /// `w v`
    ProductOfRates,
    /// `sign(w)`: a belt or a cable of the other axis that rubs here.
    RubsWithOther,
    /// `y^2`: a hose that the other axis stretches.
    Hose,
    /// `(1 + sin(2 pi x/p)) v`
    DragByPlace,
    /// `(1 + (x - c)/travel) sign(v)`: the preload of a screw varies along it.
    PreloadByPlace,
    /// `(x - c)` beyond `c`
    Stop,
    /// `(x - c)^2` beyond `c`: a bumper that hardens.
    Bumper,
    /// `(x - c)^3`
    CubicSpring,
    /// `d/(1 + d^2)^2`, `d = (x - c)/w`: a magnet next to the path.
    Magnet,
    /// `sign(v) |F|^(2/3)`
    Hertz,
    /// `|F| v`: oil squeezed by the load.
    OilUnderLoad,
    /// `F |F|`: a motor that saturates.
    Saturation,
    /// `|v|^1.5`: a fan that pushes one way.
    Fan,
    /// `v^2` one way: a valve.
    Valve,
    /// `v^3`: a fluid that thickens.
    Thickening,
    /// A sum of three springs that drag blocks, with different widths and strengths.
    Hysteresis,
    /// `v exp(-|v|/s)`: a film that breaks down.
    Film,
    /// `x a`: an inertia that grows with the position, such as a rope that is wound up.
    WoundUp,
}

impl Law {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Coupling => "y v",
            Self::ProductOfRates => "w v",
            Self::RubsWithOther => "sign(w)",
            Self::Hose => "y^2",
            Self::DragByPlace => "(1 + sin x) v",
            Self::PreloadByPlace => "(1 + x) sign(v)",
            Self::Stop => "stop",
            Self::Bumper => "bumper",
            Self::CubicSpring => "(x - c)^3",
            Self::Magnet => "magnet",
            Self::Hertz => "|F|^(2/3) sign(v)",
            Self::OilUnderLoad => "|F| v",
            Self::Saturation => "F |F|",
            Self::Fan => "|v|^1.5",
            Self::Valve => "v^2 one way",
            Self::Thickening => "v^3",
            Self::Hysteresis => "hysteresis",
            Self::Film => "v exp(-|v|)",
            Self::WoundUp => "x a",
        }
    }

    /// Variables of its own place, as indices: position, rate, acceleration, load.
    fn own(self) -> &'static [usize] {
        match self {
            Self::Coupling | Self::ProductOfRates | Self::Fan | Self::Valve | Self::Thickening | Self::Film => &[1],
            Self::RubsWithOther | Self::Hose => &[],
            Self::DragByPlace | Self::PreloadByPlace => &[0, 1],
            Self::Stop | Self::Bumper | Self::CubicSpring | Self::Magnet | Self::Hysteresis => &[0],
            Self::Hertz | Self::OilUnderLoad => &[1, 3],
            Self::Saturation => &[3],
            Self::WoundUp => &[0, 2],
        }
    }

    /// Variables of the other place, as indices: position, rate.
    fn others(self) -> &'static [usize] {
        match self {
            Self::Coupling | Self::Hose => &[0],
            Self::ProductOfRates | Self::RubsWithOther => &[1],
            _ => &[],
        }
    }

    /// Whether it depends on the way there.
    pub(crate) fn remembers(self) -> bool {
        self == Self::Hysteresis
    }
}

impl std::fmt::Display for Planted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} at {}", self.law.name(), self.at)?;
        if let Some(other) = &self.other {
            write!(f, " with {other}")?;
        }
        write!(f, " (size {}, shape {:?})", self.size, self.shape)
    }
}

impl Planted {
    /// A law at its places with drawn parameters; the size is one.
    pub(crate) fn draw(law: Law, at: &str, other: Option<&str>, random: &mut CaseRandom) -> Self {
        let mut number = || three_digits(random.uniform_between(0.0, 1.0));
        Self {
            law,
            at: at.to_owned(),
            other: other.map(str::to_owned),
            shape: [number(), number()],
            size: 1.0,
        }
    }

    /// Names of the variables of a right proposal, sorted.
    pub(crate) fn words(&self, scene: &Scene) -> Result<Vec<String>, String> {
        let place = scene.place(&self.at)?;
        let own = self.law.own().iter().map(|k| match k {
            3 => place.name.clone(),
            k => place.words[*k].clone(),
        });
        let mut words: Vec<String> = own.collect();
        if let Some(other) = &self.other {
            let other = scene.place(other)?;
            words.extend(self.law.others().iter().map(|k| other.words[*k].clone()));
        }
        words.sort();
        Ok(words)
    }

    /// The forces that it adds along a motion, `[drive][sample]`; its parameters are relative to the motion
    /// `reference`.
    pub(crate) fn added(&self, scene: &Scene, reference: &Scene) -> Result<Vec<Vec<f64>>, String> {
        let place = scene.place(&self.at)?;
        let of = reference.place(&self.at)?;
        let other = self.other.as_ref().map(|o| scene.place(o)).transpose()?;
        let values = self.values(place, of, other);
        let scaled = place
            .force
            .iter()
            .map(|force| force.iter().zip(&values).map(|(f, x)| self.size * f * x).collect());
        Ok(scaled.collect())
    }

    /// The law's function at each sample, for size one.
    fn values(&self, place: &Place, reference: &Place, other: Option<&Place>) -> Vec<f64> {
        let [low, high] = ends(&reference.position);
        let travel = high - low;
        let fastest = ends(&reference.rate).map(f64::abs).into_iter().fold(0.0, f64::max);
        let [p, r] = self.shape;
        let at = |part: f64| low + part * travel;
        let sign = |z: f64| if z == 0.0 { 0.0 } else { z.signum() };
        let (x, v, a) = (&place.position, &place.rate, &place.acceleration);
        let zeros = vec![0.0; x.len()];
        let load = place.load.as_ref().unwrap_or(&zeros);
        let (y, w) = other.map_or((&zeros, &zeros), |o| (&o.position, &o.rate));
        if self.law == Law::Hysteresis {
            let widths = [0.02, 0.06, 0.15].map(|part| part * (0.6 + 0.8 * p) * travel);
            let parts = widths.map(|width| dragged(x, width));
            return (0..x.len())
                .map(|i| parts[0][i] + 0.8 * parts[1][i] + 0.5 * r * parts[2][i])
                .collect();
        }
        let one = |i: usize| match self.law {
            Law::Coupling => y[i] * v[i],
            Law::ProductOfRates => w[i] * v[i],
            Law::RubsWithOther => sign(w[i]),
            Law::Hose => y[i] * y[i],
            Law::DragByPlace => {
                let waves = 1.5 + 3.0 * p;
                let phase = std::f64::consts::TAU * (waves * (x[i] - low) / travel + r);
                (1.0 + libm::sin(phase)) * v[i]
            }
            Law::PreloadByPlace => (0.3 + 1.4 * (x[i] - low) / travel) * sign(v[i]),
            Law::Stop => (x[i] - at(0.7 + 0.15 * p)).max(0.0),
            Law::Bumper => (at(0.2 + 0.15 * p) - x[i]).max(0.0).powi(2),
            Law::CubicSpring => (x[i] - at(0.3 + 0.4 * p)).powi(3),
            Law::Magnet => {
                let d = (x[i] - at(0.3 + 0.4 * p)) / ((0.05 + 0.1 * r) * travel);
                d / (1.0 + d * d).powi(2)
            }
            Law::Hertz => sign(v[i]) * libm::cbrt(load[i] * load[i]),
            Law::OilUnderLoad => load[i].abs() * v[i],
            Law::Saturation => load[i] * load[i].abs(),
            Law::Fan => v[i].abs() * v[i].abs().sqrt(),
            Law::Valve => (sign(p - 0.5) * v[i]).max(0.0).powi(2),
            Law::Thickening => v[i].powi(3),
            Law::Film => v[i] * libm::exp(-v[i].abs() / ((0.1 + 0.2 * p) * fastest)),
            Law::WoundUp => (x[i] - low + 0.5 * travel) * a[i],
            Law::Hysteresis => 0.0,
        };
        (0..x.len()).map(one).collect()
    }
}

/// Least and greatest value.
fn ends(z: &[f64]) -> [f64; 2] {
    z.iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| [a.min(*z), b.max(*z)])
}

/// The elongation of a spring that drags a block, relative to its largest value `width`.
fn dragged(x: &[f64], width: f64) -> Vec<f64> {
    let mut block = x[0];
    let step = |x: &f64| {
        block = block.clamp(x - width, x + width);
        (x - block) / width
    };
    x.iter().map(step).collect()
}
