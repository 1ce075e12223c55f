//! Recordings of arms with planted values: friction that does not change, motions that pause, loads, clocks, scales of
//! forces, recorded rates, and encoders with steps.
//!
//! Bodies are those of the model, but friction, sticking and recording are written here. While a joint pauses, its
//! friction is some value between plus and minus the dry friction.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use modelmill::Model;
use modelmill::recording::{PreparedRecording, RecordingOptions, StatePreparation};
use modelmill_codegen::{ModelEvaluator, MotionStates};

use crate::draws::Draws;
use crate::made::bundled;

/// How the joints move.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum PlannedMotion {
    /// Sums of sines up to this frequency, Hz.
    Waves(f64),
    /// Moves from point to point with pauses, at up to this speed, rad/s or m/s.
    Pauses(f64),
    /// Nothing moves.
    Stands,
}

/// What a recording contains.
#[derive(Clone)]
pub(crate) struct RunPlan {
    pub(crate) seed: u64,
    pub(crate) samples: usize,
    /// True time between two samples, s.
    pub(crate) step: f64,
    pub(crate) motion: PlannedMotion,
    /// Dry and viscous friction of each drive.
    pub(crate) friction: [f64; 2],
    /// Seconds of the time stamps in a true second.
    pub(crate) clock: f64,
    /// Whether rates are recorded.
    pub(crate) has_rates: bool,
    /// Factors of the measured forces, drive by drive; 1 beyond the end.
    pub(crate) scales: Vec<f64>,
    /// Noise of each force relative to its rms value.
    pub(crate) noise: f64,
    /// One sample in so many is kept; 0 leaves the choice to the program.
    pub(crate) decimate: usize,
}

impl RunPlan {
    pub(crate) fn new(seed: u64) -> Self {
        Self {
            seed,
            samples: 2000,
            step: 0.01,
            motion: PlannedMotion::Waves(0.8),
            friction: [0.6, 0.4],
            clock: 1.0,
            has_rates: false,
            scales: Vec::new(),
            noise: 0.01,
            decimate: 0,
        }
    }

    /// The recording of a machine, read and prepared for `model`.
    pub(crate) fn record(&self, model: &Model, machine: &Model) -> PreparedRecording {
        let mut options = RecordingOptions::default();
        if self.decimate > 0 {
            options.preparation = StatePreparation {
                decimate: self.decimate,
                cutoff_hz: Some(4.0),
                ..StatePreparation::default()
            };
        }
        let columns = self.columns(machine);
        model
            .recording_of_table(&format!("run-{}", self.seed), columns, &options)
            .expect("the recording")
    }

    /// The columns as they are recorded.
    fn columns(&self, machine: &Model) -> Vec<(String, Vec<f64>)> {
        let mut draws = Draws::new(self.seed);
        let coordinates = &machine.derivation.mechanism.coordinates;
        let states: Vec<[Vec<f64>; 3]> = (coordinates.iter().filter(|one| !one.passive))
            .map(|one| {
                let reach = if one.motion.is_angle() { 0.5 } else { 0.08 };
                self.motion_of_joint(&mut draws, one.nominal, reach)
            })
            .collect();
        let of = |order: usize| -> Vec<&[f64]> { states.iter().map(|one| one[order].as_slice()).collect() };
        let evaluator = ModelEvaluator::new(&machine.derivation);
        let motion = MotionStates {
            q: of(0),
            qd: of(1),
            qdd: of(2),
            load: Vec::new(),
        };
        let mut forces = evaluator.inverse_dynamics(&motion, &machine.values).expect("forces");
        for (d, force) in forces.iter_mut().enumerate() {
            // Drives of these arms are those of their joints, in the same order.
            self.add_friction(force, &states[d][1], &mut draws);
            let size = (force.iter().map(|f| f * f).sum::<f64>() / force.len() as f64).sqrt();
            let scale = self.scales.get(d).copied().unwrap_or(1.0);
            for f in force {
                *f = scale * (*f + self.noise * size * draws.normal());
            }
        }
        let time = (0..self.samples).map(|k| self.clock * self.step * k as f64).collect();
        let mut columns: Vec<(String, Vec<f64>)> = vec![("t".to_owned(), time)];
        for (name, [q, qd, _]) in machine.active_coordinates().iter().zip(&states) {
            // An encoder of 17 bits per turn with a little noise.
            let step = TAU / f64::from(1 << 17);
            let coarse = |x: &f64| ((x + 1e-5 * draws.normal()) / step).round() * step;
            columns.push((name.clone(), q.iter().map(coarse).collect()));
            if self.has_rates {
                columns.push((
                    format!("{name}_d"),
                    qd.iter().map(|v| v + 1e-3 * draws.normal()).collect(),
                ));
            }
        }
        columns.extend(machine.row_names().into_iter().zip(forces));
        columns
    }

    /// Position, rate and acceleration of a joint.
    fn motion_of_joint(&self, draws: &mut Draws, middle: f64, reach: f64) -> [Vec<f64>; 3] {
        let mut motion = [
            vec![middle; self.samples],
            vec![0.0; self.samples],
            vec![0.0; self.samples],
        ];
        match self.motion {
            PlannedMotion::Stands => {}
            PlannedMotion::Waves(highest) => {
                for _ in 0..5 {
                    let rate = TAU * highest * (0.1 + 0.9 * draws.uniform());
                    let (phase, amplitude) = (TAU * draws.uniform(), 0.5 * reach * (0.3 + draws.uniform()));
                    for k in 0..self.samples {
                        let (sin, cos) = (rate * self.step * k as f64 + phase).sin_cos();
                        motion[0][k] += amplitude * sin;
                        motion[1][k] += amplitude * rate * cos;
                        motion[2][k] -= amplitude * rate * rate * sin;
                    }
                }
            }
            PlannedMotion::Pauses(speed) => {
                let (mut k, mut from) = (0, middle);
                while k < self.samples {
                    let to = middle + reach * (2.0 * draws.uniform() - 1.0);
                    let lasts = ((to - from).abs() * 1.875 / speed * (0.7 + 0.8 * draws.uniform())).max(0.4);
                    // A polynomial of order 5 starts and ends without rate and acceleration.
                    let rows = (k..self.samples).take_while(|i| self.step * (*i - k) as f64 <= lasts);
                    let rows: Vec<usize> = rows.collect();
                    for i in &rows {
                        let x = self.step * (*i - k) as f64 / lasts;
                        let way = to - from;
                        motion[0][*i] = from + way * x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x);
                        motion[1][*i] = way * 30.0 * x * x * (1.0 - x).powi(2) / lasts;
                        motion[2][*i] = way * 60.0 * x * (1.0 - 3.0 * x + 2.0 * x * x) / (lasts * lasts);
                    }
                    k += rows.len();
                    // The joint sticks for up to 0.6 s.
                    let pause = 0.6 * draws.uniform() / self.step;
                    let until = (0..self.samples).find(|n| *n as f64 >= pause).unwrap_or(0);
                    for i in k..(k + until).min(self.samples) {
                        motion[0][i] = to;
                    }
                    k += until;
                    from = to;
                }
            }
        }
        motion
    }

    /// Adds friction; while the joint sticks it relaxes to a value of its own.
    fn add_friction(&self, force: &mut [f64], rates: &[f64], draws: &mut Draws) {
        let [dry, viscous] = self.friction;
        let mut state = 0.0;
        let mut target = 0.0;
        for (k, (f, rate)) in force.iter_mut().zip(rates).enumerate() {
            if *rate == 0.0 {
                if k > 0 && rates[k - 1] != 0.0 {
                    target = dry * (2.0 * draws.uniform() - 1.0);
                }
                state += 0.05 * (target - state);
            } else {
                state = dry * rate.signum();
            }
            *f += state + viscous * rate;
        }
    }
}

/// A bundled arm with dry and viscous friction of all drives and a further part, given as its entry in the model file.
pub(crate) fn arm_with_friction(name: &str, part: &str) -> Model {
    let mut text = std::fs::read_to_string(bundled(name)).expect("a model");
    let drives = Model::open(bundled(name)).expect("the model").row_names();
    for (d, drive) in drives.iter().enumerate() {
        for (kind, symbol) in [("coulomb_friction", "Fc"), ("viscous_friction", "Fv")] {
            let _ = write!(
                text,
                "\n[[effect]]\nname = \"{kind}{d}\"\nkind = \"{kind}\"\nat = \"{drive}\"\n\
                 parameters = {{ {symbol} = {{ name = \"{symbol}{d}\" }} }}\n"
            );
        }
    }
    Model::from_text(name, &format!("{text}{part}")).expect("the model")
}
