//! The machine: the rig along its motion, read by encoders and sensors of the forces at 1 kHz, before and after wear.
//!
//! The motion repeats itself, so the rig's forces are computed once for a period. Friction enters them in proportion to its
//! coefficients: a period with what has grown besides is enough for all sizes of it.

use std::error::Error;
use std::f64::consts::TAU;
use std::path::Path;

use modelmill_rig::{Rig, RigLaw, RigPlace, RigState, RigTracker, forces};
use modelmill_runtime::Random;

use crate::motion::{PERIOD, motion};
use crate::spidermill_worn as model;

/// Time between two samples, s.
pub(crate) const CYCLE: f64 = 1e-3;
/// Turns of 20 bits, rad.
const RESOLUTION: f64 = TAU / 1_048_576.0;
/// Deviations of the reading of a force, N: of white noise, and of what wanders.
const FORCE_NOISE: [f64; 2] = [8.0, 4.0];
/// How much of what wanders is what it was a cycle before: it lies below some 2 Hz.
const DRIFT_CORRELATION: f64 = 0.987;

/// Friction that grows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrictionWear {
    /// Of which spindle.
    pub(crate) drive: usize,
    /// The friction: by how much it has grown at last, in N or N s/m.
    pub(crate) growth: RigLaw,
    /// From when, s.
    pub(crate) from: f64,
    /// For how long, s.
    pub(crate) duration: f64,
}

/// What is read in a cycle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CycleReading {
    /// Encoders of the cranks, rad.
    pub(crate) q: [f64; 2],
    /// Forces of the spindles, N.
    pub(crate) forces: [f64; 2],
}

/// The rig in motion, with its sensors.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedMachine {
    /// True angles, and forces as they are before any wear, over a period.
    q: Vec<[f64; 2]>,
    forces: Vec<[f64; 2]>,
    /// What the wear adds to the forces at last.
    worn: Option<(FrictionWear, Vec<[f64; 2]>)>,
    random: Random,
    wandering: [f64; 2],
    n: usize,
}

/// Base parameters that the controller uses: bodies as on the drawing, rods and friction as somebody has guessed them.
pub(crate) fn parameters_in_use() -> Result<[f64; model::N_BASE], Box<dyn Error>> {
    let parameters = model::Parameters::<f64> {
        Jr_spindle_left_spindle_right: 2.0,
        Sr_spindle_left_spindle_right: 3.0,
        Fc_spindle_left: 30.0,
        Fc_spindle_right: 30.0,
        Fv_spindle_left: 150.0,
        Fv_spindle_right: 150.0,
        ..Default::default()
    };
    Ok(model::base_parameters(
        &model::Geometry::default(),
        &parameters,
    )?)
}

impl SimulatedMachine {
    /// The rig of this example with noise from a seed.
    pub(crate) fn new(seed: u64) -> Result<Self, Box<dyn Error>> {
        Ok(Self {
            q: times().map(|t| motion(t)[0]).collect(),
            forces: forces_along(&rig()?)?,
            worn: None,
            random: Random::new(seed),
            wandering: [0.0; 2],
            n: 0,
        })
    }

    /// The same machine with wear that is to come.
    pub(crate) fn with_wear(mut self, wear: FrictionWear) -> Result<Self, Box<dyn Error>> {
        let mut rig = rig()?;
        let place = [RigPlace::Drive(wear.drive)];
        let effects = &mut rig.effects;
        effects.retain(|effect| matches!(effect.law, RigLaw::CoulombFriction { .. }));
        let effect = effects.iter_mut().find(|effect| effect.places == place);
        effect.ok_or("this drive of the rig has no friction")?.law = wear.growth;
        effects.retain(|effect| effect.law == wear.growth && effect.places == place);
        let grown = forces_along(&rig)?;
        rig.effects.clear();
        let without = forces_along(&rig)?;
        let added = grown.iter().zip(&without);
        let added = added.map(|(with, without)| [with[0] - without[0], with[1] - without[1]]);
        self.worn = Some((wear, added.collect()));
        Ok(self)
    }

    /// Time of the next reading, s.
    pub(crate) fn time(&self) -> f64 {
        self.n as f64 * CYCLE
    }

    /// The next reading.
    pub(crate) fn read(&mut self) -> CycleReading {
        let (t, at) = (self.time(), self.n % self.q.len());
        self.n += 1;
        let (q, mut forces) = (self.q[at], self.forces[at]);
        if let Some((wear, added)) = &self.worn {
            let share = ((t - wear.from) / wear.duration).clamp(0.0, 1.0);
            for (force, added) in forces.iter_mut().zip(&added[at]) {
                *force += share * added;
            }
        }
        let q = q.map(|q| {
            let noisy = q + RESOLUTION * self.normal();
            (noisy / RESOLUTION).round() * RESOLUTION
        });
        for (k, force) in forces.iter_mut().enumerate() {
            let rest = f64::sqrt(1.0 - DRIFT_CORRELATION * DRIFT_CORRELATION);
            self.wandering[k] = DRIFT_CORRELATION * self.wandering[k] + rest * self.normal();
            *force += FORCE_NOISE[0] * self.normal() + FORCE_NOISE[1] * self.wandering[k];
        }
        CycleReading { q, forces }
    }

    /// Normal with mean zero and deviation one (G. Box, M. Muller 1958).
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.random.uniform(f64::MIN_POSITIVE, 1.0).ln()).sqrt();
        radius * (TAU * self.random.uniform(0.0, 1.0)).cos()
    }
}

/// The rig of this example.
fn rig() -> Result<Rig, Box<dyn Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("rig.toml");
    let loaded = modelmill_rig::load_file(&file).map_err(|failure| failure.render(false))?;
    Ok(loaded.rig)
}

/// Times of the samples of a period, s.
pub(crate) fn times() -> impl Iterator<Item = f64> {
    let n = (PERIOD / CYCLE).round();
    (0..)
        .map(f64::from)
        .take_while(move |i| *i < n)
        .map(|i| i * CYCLE)
}

/// Forces of a rig's drives along a period, N.
fn forces_along(rig: &Rig) -> Result<Vec<[f64; 2]>, Box<dyn Error>> {
    let mut tracker = RigTracker::new(rig)?;
    let mut all = Vec::new();
    for t in times() {
        let [q, qd, qdd] = motion(t).map(Vec::from);
        let found = forces(rig, &tracker.follow(&RigState { q, qd, qdd })?)?;
        all.push([found[0], found[1]]);
    }
    Ok(all)
}
