//! Computed-torque control of a simulated robot with emitted code: without the model, with its nominal parameters, and
//! with parameters that were identified from the robot's own recording.
//!
//! The plant is the rig: all bodies of the parallel robot SpiderMill, with rods and friction that the nominal model
//! does not contain. It shares no mechanics with the emitted code. The controller runs at 500 Hz, reads encoders of 20
//! bits and sets the forces of the spindles. All three controllers have the same gains.
//!
//! `cargo run --release -p modelmill-example-computed-torque`

mod control;
mod identification;
mod reference;

include!(concat!(env!("OUT_DIR"), "/models.rs"));

use std::error::Error;
use std::path::Path;

use control::{TorqueController, run};
use identification::identify;
use modelmill_generated::spidermill;
use reference::ReferenceMotion;

/// Loads the rig and prints the tracking errors of the three controllers.
fn main() -> Result<(), Box<dyn Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("rig.toml");
    let rig = modelmill_rig::load_file(&file)
        .map_err(|failure| failure.render(false))?
        .rig;
    for line in report(&rig, &ReferenceMotion::task())? {
        println!("{line}");
    }
    Ok(())
}

/// Runs the three controllers along a task; returns the lines that are printed.
fn report(rig: &modelmill_rig::Rig, task: &ReferenceMotion) -> Result<Vec<String>, Box<dyn Error>> {
    let geometry = spidermill::Geometry::default();
    // The nominal model, as it is known before any measurement.
    let nominal = spidermill::base_parameters(&geometry, &spidermill::Parameters::default())?;
    let nominal = spidermill::InverseDynamics::new(&geometry, &nominal);
    let drives = spidermill::Model::new(&geometry);

    let without = TorqueController::without_model(&nominal, &drives)?;
    let with = TorqueController::with_nominal(&nominal);
    // The robot's own recording: the nominal model controls it along another motion.
    let recording = run(rig, &with, &ReferenceMotion::excitation())?;
    let base = identify(&recording)?;
    // The identified model also has friction.
    let known = spidermill_with_friction::InverseDynamics::new(&spidermill_with_friction::Geometry::default(), &base);
    let identified = TorqueController::with_identified(&known);

    let mut lines = vec!["root mean square of the tracking error, mrad        theta1    theta2".to_owned()];
    let controllers = [
        ("without the model (constant gains per drive)", &without),
        ("computed torque, nominal parameters", &with),
        ("computed torque, identified", &identified),
    ];
    // All controllers follow the same task on the same plant, each on a thread of its own.
    let runs: Vec<Result<[f64; 2], String>> = std::thread::scope(|scope| {
        let threads = controllers.map(|(_, controller)| {
            scope.spawn(move || match run(rig, controller, task) {
                Ok(recording) => Ok(recording.rms_error()),
                Err(error) => Err(error.to_string()),
            })
        });
        let joined = threads.map(|thread| {
            thread
                .join()
                .unwrap_or_else(|_| Err("a simulation panicked".to_owned()))
        });
        joined.into()
    });
    for ((name, _), error) in controllers.iter().zip(runs) {
        let [first, second] = error?.map(|e| 1e3 * e);
        lines.push(format!("  {name:<46} {first:>9.3} {second:>9.3}"));
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same comparison as in the guide, over a shorter time.
    #[test]
    fn each_step_lowers_the_error() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("rig.toml");
        let rig = modelmill_rig::load_file(&file)
            .map_err(|f| f.render(false))
            .unwrap()
            .rig;
        let mut task = ReferenceMotion::task();
        task.duration = 2.0;
        let lines = report(&rig, &task).unwrap();
        let errors: Vec<Vec<f64>> = lines[1..]
            .iter()
            .map(|line| {
                line.split_whitespace()
                    .rev()
                    .take(2)
                    .map(|x| x.parse().unwrap())
                    .collect()
            })
            .collect();
        for k in 0..2 {
            assert!(errors[1][k] < 0.5 * errors[0][k], "{lines:#?}");
            assert!(errors[2][k] < 0.2 * errors[1][k], "{lines:#?}");
        }
    }
}
