//! The machine: the rig along its motion, with encoders and force sensors at 1 kHz, before and after wear.
//!
//! The motion is periodic, so the rig's forces are computed once for a period. They are linear in the coefficients of
//! friction, so a period with the additional friction alone is sufficient for all amounts of wear.

use std::error::Error;
use std::f64::consts::TAU;
use std::path::Path;

use modelmill_rig::{Rig, RigLaw, RigPlace, RigState, RigTracker, forces};
use modelmill_runtime::Random;

use crate::motion::{PERIOD, motion};
use crate::spidermill_worn as model;

/// Time between two samples, s.
pub(crate) const CYCLE: f64 = 1e-3;
/// Smallest step of the encoders, rad: one revolution has 2^20 steps.
const RESOLUTION: f64 = TAU / 1_048_576.0;
/// Standard deviations of a measured force, N: of white noise, and of slow noise.
const FORCE_NOISE: [f64; 2] = [8.0, 4.0];
/// Correlation of the slow noise from cycle to cycle: it lies below about 2 Hz.
const DRIFT_CORRELATION: f64 = 0.987;

/// Friction that grows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrictionWear {
    /// Index of the spindle.
    pub(crate) drive: usize,
    /// The additional friction at the end, N or N s/m.
    pub(crate) growth: RigLaw,
    /// Beginning, s.
    pub(crate) from: f64,
    /// Duration, s.
    pub(crate) duration: f64,
}

/// The readings of one cycle.
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
    /// True angles of the cranks over a period, rad.
    q: Vec<[f64; 2]>,
    /// Forces without wear over a period, N.
    forces: Vec<[f64; 2]>,
    /// The wear, and the forces that it adds at the end, N.
    worn: Option<(FrictionWear, Vec<[f64; 2]>)>,
    /// Source of the noise.
    random: Random,
    /// Present value of the slow noise of each sensor.
    wandering: [f64; 2],
    /// Number of readings so far.
    n: usize,
}

/// Base parameters of the controller: bodies as designed, rods and friction as estimated by hand.
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
    Ok(model::base_parameters(&model::Geometry::default(), &parameters)?)
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

    /// The same machine with wear in the future.
    pub(crate) fn with_wear(mut self, wear: FrictionWear) -> Result<Self, Box<dyn Error>> {
        let mut rig = rig()?;
        let place = [RigPlace::Drive(wear.drive)];
        // Only the friction that grows remains, with its additional value. The difference to forces without it is the
        // effect of wear.
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
            // The share of the wear that has happened by now.
            let share = ((t - wear.from) / wear.duration).clamp(0.0, 1.0);
            for (force, added) in forces.iter_mut().zip(&added[at]) {
                *force += share * added;
            }
        }
        // Encoders: noise of one step, then rounding.
        let q = q.map(|q| {
            let noisy = q + RESOLUTION * self.normal();
            (noisy / RESOLUTION).round() * RESOLUTION
        });
        // Forces: white noise and slow noise.
        for (k, force) in forces.iter_mut().enumerate() {
            let rest = f64::sqrt(1.0 - DRIFT_CORRELATION * DRIFT_CORRELATION);
            self.wandering[k] = DRIFT_CORRELATION * self.wandering[k] + rest * self.normal();
            *force += FORCE_NOISE[0] * self.normal() + FORCE_NOISE[1] * self.wandering[k];
        }
        CycleReading { q, forces }
    }

    /// A random number with mean zero and standard deviation one (G. Box, M. Muller 1958).
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
    (0..).map(f64::from).take_while(move |i| *i < n).map(|i| i * CYCLE)
}

/// Forces of a rig's drives along a period, N.
fn forces_along(rig: &Rig) -> Result<Vec<[f64; 2]>, Box<dyn Error>> {
    // The tracker follows the motion from pose to pose.
    let mut tracker = RigTracker::new(rig)?;
    let mut all = Vec::new();
    for t in times() {
        let [q, qd, qdd] = motion(t).map(Vec::from);
        let found = forces(rig, &tracker.follow(&RigState { q, qd, qdd })?)?;
        all.push([found[0], found[1]]);
    }
    Ok(all)
}
