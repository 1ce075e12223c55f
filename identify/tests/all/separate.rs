//! Motion of one axis that tells effects apart, where the best that can be is known.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use modelmill_identify::excite::separate::{SeparationProblem, measure_separation};
use modelmill_identify::excite::{
    ExcitationCriterion, ExcitationLimits, ExcitationMotion, ExcitationPlant, ExciteError, Options, excite,
};
use nalgebra::DMatrix;

/// A function of coordinate, rate and acceleration.
type Law = fn([f64; 3]) -> f64;

/// An axis with laws that are fitted in any case, an effect, and what it may be taken for.
struct Axis {
    base: Vec<Law>,
    effect: Law,
    rival: Law,
}

impl ExcitationPlant for Axis {
    fn regressor(&self, _: &ExcitationMotion) -> Option<DMatrix<f64>> {
        None
    }

    fn limits(&self) -> Vec<String> {
        Vec::new()
    }

    fn excess(&self, _: &ExcitationMotion) -> Option<Vec<Vec<f64>>> {
        Some(Vec::new())
    }

    fn separation(&self, motion: &ExcitationMotion) -> Option<f64> {
        let [q, qd, qdd] = [&motion.q[0], &motion.qd[0], &motion.qdd[0]];
        let columns = |laws: &[Law]| DMatrix::from_fn(q.len(), laws.len(), |i, k| laws[k]([q[i], qd[i], qdd[i]]));
        let effect = columns(&[self.effect]);
        let question = SeparationProblem {
            base: columns(&self.base),
            fitted: vec![effect.clone()],
            effect,
            rivals: vec![columns(&[self.rival])],
        };
        let found = measure_separation(&question)?;
        (!found.is_mimicked()).then(|| found.residual.min(found.reverse_residual))
    }
}

fn found(axis: &Axis, harmonics: usize) -> Result<f64, ExciteError> {
    let limits = [ExcitationLimits {
        name: "q".to_owned(),
        position: [-1.0, 1.0],
        rate: None,
        acceleration: None,
    }];
    let options = Options {
        harmonics,
        period: 2.0 * PI,
        criterion: ExcitationCriterion::Separation,
        random: 200,
        ..Options::default()
    };
    let found = excite(axis, &limits, &options, &|_| ControlFlow::Continue(()))?;
    assert!(found.margins.iter().all(|margin| margin.excess <= 0.0));
    assert!(found.value <= found.start_value);
    println!(
        "{:.6} apart, {:.6} in the best random motion",
        (-found.value).exp(),
        (-found.start_value).exp()
    );
    Ok((-found.value).exp())
}

const SPRING: Law = |[q, _, _]| q;
const OFFSET: Law = |_| 1.0;
const MASS: Law = |[_, _, qdd]| qdd;

/// A sine over all of the travel leaves its own root mean square.
#[test]
fn a_spring_is_told_from_an_offset_by_the_largest_sine() {
    let axis = Axis {
        base: Vec::new(),
        effect: SPRING,
        rival: OFFSET,
    };
    let apart = found(&axis, 1).unwrap();
    assert!((apart - 0.5_f64.sqrt()).abs() < 1e-4, "{apart}");
}

/// Beside a mass it takes a second harmonic, for in a motion of one frequency the acceleration is the coordinate. The best of
/// two harmonics is known from trying all: with amplitudes a and b, the mass leaves 3 a b / sqrt(2 (a^2 + 16 b^2)).
#[test]
fn a_spring_beside_a_mass_takes_two_harmonics() {
    let axis = Axis {
        base: vec![MASS],
        effect: SPRING,
        rival: OFFSET,
    };
    let mut best = 0.0_f64;
    for ratio in (1..300).map(|k| 0.01 * f64::from(k)) {
        for phase in (0..360).map(|k| PI * f64::from(k) / 180.0) {
            let at = |x: f64| x.sin() + ratio * (2.0 * x + phase).sin();
            let values = (0..720).map(|k| at(PI * f64::from(k) / 360.0));
            let [low, high] = values.fold([0.0_f64; 2], |[low, high], q| [low.min(q), high.max(q)]);
            let a = 2.0 / (high - low);
            let b = ratio * a;
            best = best.max(3.0 * a * b / (2.0 * (a * a + 16.0 * b * b)).sqrt());
        }
    }
    let apart = found(&axis, 2).unwrap();
    println!("{best:.6} is the best of all");
    assert!((apart / best - 1.0).abs() < 2e-3, "{apart} where {best} is known");
    assert_eq!(found(&axis, 1), Err(ExciteError::Inseparable));
}
