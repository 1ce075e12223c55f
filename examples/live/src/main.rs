//! A controller that monitors its own model: the dry friction of one spindle grows, an alarm is raised, and the changed
//! parameter is identified.
//!
//! The machine is the rig: all bodies of the parallel robot SpiderMill with rods and friction. Encoders of 20 bits and
//! force sensors with partly coloured noise are read at 1 kHz. The rig shares no mechanics with the emitted code. The
//! watch starts from the parameters of a controller, which are not the true ones.
//!
//! `cargo run --release -p modelmill-example-live`, or with `-- 10` for ten hours in which nothing happens.

mod machine;
mod motion;
mod smoothing;
#[cfg(test)]
mod truth;

include!(concat!(env!("OUT_DIR"), "/models.rs"));

use std::error::Error;
use std::time::Instant;

use machine::{CYCLE, FrictionWear, SimulatedMachine, parameters_in_use};
use modelmill_rig::RigLaw;
use modelmill_runtime::PoseError;
use modelmill_runtime::live::{Options, WatchChange, WatchVerdict};
use smoothing::{MotionSmoother, SmoothedState};
use spidermill_worn as model;

/// Below this rate of a spindle, m/s, its friction is unknown.
const STANDSTILL: f64 = 5e-3;

/// Runs the machine with wear; or, with a number of hours as the argument, without any change.
fn main() -> Result<(), Box<dyn Error>> {
    if let Some(hours) = std::env::args().nth(1) {
        let mut sitting = WatchSession::new(SimulatedMachine::new(1)?)?;
        sitting.run_until(3600.0 * hours.parse::<f64>()?)?;
        println!("{} false alarms in {hours} hours", sitting.alarms.len());
        return Ok(());
    }
    let wear = FrictionWear {
        drive: 0,
        growth: RigLaw::CoulombFriction { Fc: 15.0 },
        from: 90.0,
        duration: 2.0,
    };
    println!("from 90 s to 92 s the dry friction of the left spindle grows from 40 N to 55 N");
    let mut sitting = WatchSession::new(SimulatedMachine::new(1)?.with_wear(wear)?)?;
    sitting.run_until(105.0)?;
    for line in sitting.lines() {
        println!("{line}");
    }
    println!("{}", sitting.times());
    Ok(())
}

/// A machine with its watch, and the results of the watch.
#[derive(Clone, Debug)]
struct WatchSession {
    /// The simulated machine.
    machine: SimulatedMachine,
    /// Differentiates its readings.
    smoother: MotionSmoother,
    /// Computes drive rates and regressors; emitted.
    model: model::Model<f64>,
    /// Compares forces and model; emitted.
    watch: model::Watch<f64>,
    /// End of the watch's learning, s.
    learned: Option<f64>,
    /// Times of alarms, s.
    alarms: Vec<f64>,
    /// Changes whose parameter was identified, with the time of that, s.
    identified: Vec<(f64, WatchChange<f64, { model::N_BASE }>)>,
    /// Times that steps of the watch took, s; of the first hundred thousand.
    steps: Vec<f64>,
}

impl WatchSession {
    /// Starts the watch with the parameters of the controller.
    fn new(machine: SimulatedMachine) -> Result<Self, Box<dyn Error>> {
        let geometry = model::Geometry::default();
        let options = Options::at_rate(1.0 / CYCLE);
        Ok(Self {
            machine,
            smoother: MotionSmoother::new(CYCLE),
            model: model::Model::new(&geometry),
            watch: model::Watch::new(&geometry, &parameters_in_use()?, &options),
            learned: None,
            alarms: Vec::new(),
            identified: Vec::new(),
            steps: Vec::new(),
        })
    }

    /// Runs the machine until a time, s. A change is accepted ten seconds after its alarm.
    fn run_until(&mut self, end: f64) -> Result<(), Box<dyn Error>> {
        const PATIENCE: f64 = 10.0;
        let mut is_raised = false;
        while self.machine.time() < end {
            let t = self.machine.time();
            let reading = self.machine.read();
            // The smoother has a delay: its first state comes after half a window.
            let Some(motion) = self.smoother.add_readings(reading.q, reading.forces) else {
                continue;
            };
            let (state, forces) = sample(&self.model, &motion)?;
            // Only the watch is timed, with the regressor that it computes.
            let start = Instant::now();
            let verdict = *self.watch.step(&state, &forces)?;
            if self.steps.len() < 100_000 {
                self.steps.push(start.elapsed().as_secs_f64());
            }
            match verdict {
                WatchVerdict::Learning => {}
                WatchVerdict::Quiet => self.learned = self.learned.or(Some(t)),
                // The first sample of a change is an alarm. Later ones identify the parameter.
                WatchVerdict::Changed(change) => {
                    if !is_raised {
                        self.alarms.push(t);
                        is_raised = true;
                    }
                    if change.is_identified() && self.identified.len() < self.alarms.len() {
                        self.identified.push((t, change));
                    }
                    if self.alarms.last().is_some_and(|raised| t > raised + PATIENCE) {
                        self.watch.live.accept();
                        is_raised = false;
                    }
                }
            }
        }
        Ok(())
    }

    /// The results as lines of text.
    fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(t) = self.learned {
            lines.push(format!(
                "{t:7.2} s  the watch has learned the usual motion of this machine"
            ));
        }
        let mut told = self.identified.iter();
        for alarm in &self.alarms {
            lines.push(format!("{alarm:7.2} s  alarm"));
            let Some((t, change)) = told.next() else {
                continue;
            };
            let parameter = &model::BASE_PARAMETERS[change.parameter];
            lines.push(format!(
                "{t:7.2} s  {} changed by {:+.1} +- {:.1} {}; this parameter alone explains {:.0} % of the change",
                parameter.expression,
                change.amount,
                change.deviation,
                parameter.unit,
                100.0 * change.share
            ));
        }
        lines
    }

    /// Mean time of a step of the watch, and the time that 99.9 % of the steps do not exceed.
    fn times(&self) -> String {
        let mut sorted = self.steps.clone();
        sorted.sort_by(f64::total_cmp);
        let mean = 1e6 * sorted.iter().sum::<f64>() / sorted.len() as f64;
        let most = 1e6 * sorted[sorted.len() * 999 / 1000];
        format!(
            "a step of the watch with its regressor takes {mean:.2} us on average, and 999 of 1000 steps take less \
             than {most:.2} us; the cycle is 1000 us"
        )
    }
}

/// A state and its forces for the watch; NaN stands for the force of a drive that hardly moves.
fn sample(model: &model::Model<f64>, motion: &SmoothedState) -> Result<(model::State<f64>, [f64; 2]), PoseError> {
    let state = model::State {
        q: motion.q,
        qd: motion.qd,
        qdd: motion.qdd,
    };
    let mut forces = motion.forces;
    for (force, rate) in forces.iter_mut().zip(model.drives(&state)?.rate) {
        if rate.abs() < STANDSTILL {
            *force = f64::NAN;
        }
    }
    Ok((state, forces))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every friction parameter of every spindle, from the same state of the watch.
    #[test]
    fn friction_that_grows_is_named_within_ten_seconds() {
        let mut sitting = WatchSession::new(SimulatedMachine::new(1).unwrap()).unwrap();
        sitting.run_until(240.0).unwrap();
        assert!(sitting.learned.is_some() && sitting.alarms.is_empty());
        let dry = RigLaw::CoulombFriction { Fc: 10.0 };
        let viscous = RigLaw::ViscousFriction { Fv: 120.0 };
        let check = |name: &str, drive: usize, growth: RigLaw| {
            let mut now = sitting.clone();
            let wear = FrictionWear {
                drive,
                growth,
                from: 240.0,
                duration: 1.0,
            };
            now.machine = now.machine.with_wear(wear).unwrap();
            now.run_until(250.0).unwrap();
            let found = now.identified.first();
            let (t, change) = found.unwrap_or_else(|| panic!("{name}: {:?}", now.lines()));
            let parameter = &model::BASE_PARAMETERS[change.parameter];
            assert_eq!(parameter.expression, name, "{:?}", now.lines());
            assert!(*t < 250.0);
        };
        std::thread::scope(|scope| {
            for (name, drive, growth) in [
                ("Fc_spindle_left", 0, dry),
                ("Fc_spindle_right", 1, dry),
                ("Fv_spindle_left", 0, viscous),
                ("Fv_spindle_right", 1, viscous),
            ] {
                let check = &check;
                scope.spawn(move || check(name, drive, growth));
            }
        });
    }

    #[test]
    fn nothing_is_named_where_nothing_changes() {
        let mut sitting = WatchSession::new(SimulatedMachine::new(2).unwrap()).unwrap();
        sitting.run_until(300.0).unwrap();
        assert!(sitting.alarms.is_empty(), "{:?}", sitting.lines());
    }

    /// Some minutes with optimisation: `cargo test --release -p modelmill-example-live -- --ignored`.
    #[test]
    #[ignore = "ten hours of the machine take minutes"]
    fn there_is_less_than_one_false_alarm_in_ten_hours() {
        for seed in 1..=4 {
            let mut sitting = WatchSession::new(SimulatedMachine::new(seed).unwrap()).unwrap();
            sitting.run_until(36_000.0).unwrap();
            assert!(sitting.alarms.is_empty(), "{seed}: {:?}", sitting.lines());
        }
    }
}
