//! Computes the torque that a pendulum needs to stay or to accelerate, with code generated from `models/pendulum.toml`.
//!
//! `build.rs` generates the module `pendulum` from the model file. Numbers are in SI units.
//! The program prints the base parameters, then the torque at three angles.

include!(concat!(env!("OUT_DIR"), "/models.rs"));

use modelmill_runtime::SpecialGeometry;
use pendulum::{BASE_PARAMETERS, Geometry, InverseDynamics, Parameters, State, base_parameters};

/// Prints the base parameters with the file's values, and the torque at three angles.
fn main() -> Result<(), SpecialGeometry> {
    // Constants and parameters have the values of the model file as defaults.
    let geometry = Geometry::<f64>::default();
    let base = base_parameters(&geometry, &Parameters::default())?;
    // Each base parameter with its formula in the parameters of the model.
    for (parameter, value) in BASE_PARAMETERS.iter().zip(&base) {
        println!(
            "{} = {} = {value:.4} {}",
            parameter.name, parameter.expression, parameter.unit
        );
    }
    // The inverse dynamics: coordinates, rates and accelerations go in, torques come out.
    let dynamics = InverseDynamics::new(&geometry, &base);
    for q in [0.0, 0.5, 1.0] {
        match dynamics.forces(&State {
            q: [q],
            qd: [0.0],
            qdd: [1.0],
        }) {
            Ok([torque]) => println!("q = {q:.1} rad, 1 rad/s^2: {torque:.4} N m"),
            // A model with closed loops may have no solution at a pose; this one always has.
            Err(error) => println!("q = {q:.1} rad: {error}"),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The torque of the emitted code is that of the equation of motion in a textbook.
    #[test]
    fn the_torque_is_that_of_the_textbook() {
        let geometry = Geometry::<f64>::default();
        let p = Parameters {
            m: 1.5,
            c: 0.4,
            I: 0.07,
            Fv_motor: 0.2,
        };
        let dynamics = InverseDynamics::new(&geometry, &base_parameters(&geometry, &p).unwrap());
        let (q, qd, qdd) = (0.7_f64, -1.3, 2.1);
        let [torque] = dynamics
            .forces(&State {
                q: [q],
                qd: [qd],
                qdd: [qdd],
            })
            .unwrap();
        let expected = (p.I + p.m * p.c * p.c) * qdd + p.m * p.c * 9.81 * q.cos() + p.Fv_motor * qd;
        assert!((torque - expected).abs() < 1e-12 * expected.abs());
    }
}
