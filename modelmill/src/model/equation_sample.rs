//! The equations of a model at one state, which a fit stores, so that its values are never used in other equations.
//!
//! Base parameters may have the same names and expressions in two models whose lengths, angles, gravity or laws of effects
//! differ. The forces at a state differ then. They are computed for fixed values of the base parameters, so that nominal
//! values, titles, notes and limits of the file have no effect.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::{EquationSample, FitFault, FitFile, FitFileError};

use crate::error::Outcome;
use crate::model::Model;
use crate::model::sampled_rank::motion_unit;
use crate::model::thresholds::{EQUAL_FORCES, SAMPLE_DISTANCES};

/// Rates (rad/s) and accelerations (rad/s^2) of the sample, for lengths half as many m.
const RATE: f64 = 1.3;
const ACCELERATION: f64 = 2.1;

impl Model {
    /// The equations at the first of some states around the nominal pose that the mechanism can reach; `None` if it
    /// reaches none of them.
    pub(crate) fn equation_sample(&self) -> Option<EquationSample> {
        let evaluator = ModelEvaluator::new(&self.derivation);
        let coordinates = self.derivation.mechanism.coordinates.iter();
        let active: Vec<(f64, f64)> = coordinates
            .filter(|c| !c.passive)
            .map(|c| (c.nominal, motion_unit(c.motion)))
            .collect();
        let signed = |shift: usize| {
            let units = active.iter().enumerate();
            units.map(move |(k, (_, unit))| unit * (2.0 * spread(k + shift) - 1.0))
        };
        let n = active.len();
        SAMPLE_DISTANCES.iter().find_map(|distance| {
            let nominal = active.iter().map(|(nominal, _)| nominal);
            let mut sample = EquationSample {
                positions: nominal.zip(signed(0)).map(|(q, x)| q + distance * x).collect(),
                rates: signed(n).map(|x| RATE * x).collect(),
                accelerations: signed(2 * n).map(|x| ACCELERATION * x).collect(),
                loads: (0..self.row_names().len()).map(|k| 1.0 + spread(k)).collect(),
                forces: Vec::new(),
            };
            let found = forces_at(&evaluator, &sample)?;
            sample.forces = found.into_iter().map(|(force, _)| force).collect();
            Some(sample)
        })
    }

    /// Fails if the equations differ from those for which a fit was computed, as far as the fit has a sample of them.
    pub(super) fn check_equations(&self, fit: &FitFile, file: &str) -> Outcome<()> {
        let Some(sample) = &fit.equation_sample else {
            return Ok(());
        };
        let fail = |fault| {
            let file = file.to_owned();
            Err(FitFileError { file, fault }.into())
        };
        let (n, drives) = (self.active_coordinates().len(), self.row_names());
        let motion = [&sample.positions, &sample.rates, &sample.accelerations];
        let forces = [&sample.loads, &sample.forces];
        if motion.iter().any(|values| values.len() != n) || forces.iter().any(|values| values.len() != drives.len()) {
            return fail(FitFault::DrivesDiffer);
        }
        let found = forces_at(&ModelEvaluator::new(&self.derivation), sample);
        for (k, drive) in drives.into_iter().enumerate() {
            let theirs = sample.forces[k];
            let ours = found.as_ref().map(|found| found[k]);
            if ours.is_none_or(|(force, size)| (force - theirs).abs() > EQUAL_FORCES * size.max(theirs.abs())) {
                return fail(FitFault::EquationsDiffer {
                    drive,
                    file: theirs,
                    model: ours.map(|(force, _)| force),
                });
            }
        }
        Ok(())
    }
}

/// Forces of the drives at the state of a sample, each with the sum of the magnitudes of its summands; `None` if
/// the mechanism has no solution there.
fn forces_at(evaluator: &ModelEvaluator<'_>, sample: &EquationSample) -> Option<Vec<(f64, f64)>> {
    fn columns(values: &[f64]) -> Vec<&[f64]> {
        values.iter().map(std::slice::from_ref).collect()
    }
    let regressor = evaluator
        .regressor(&MotionStates {
            q: columns(&sample.positions),
            qd: columns(&sample.rates),
            qdd: columns(&sample.accelerations),
            load: columns(&sample.loads),
        })
        .ok()?;
    let sums = regressor.row_iter().map(|row| {
        let summands = row.iter().enumerate().map(|(k, h)| h * (0.5 + spread(k)));
        summands.fold((0.0, 0.0), |(sum, size), x| (sum + x, size + x.abs()))
    });
    let sums: Vec<(f64, f64)> = sums.collect();
    sums.iter().all(|(force, _)| force.is_finite()).then_some(sums)
}

/// Numbers between 0 and 1 that are far from each other and from simple ratios: multiples of the golden ratio, without
/// their integral parts.
fn spread(k: usize) -> f64 {
    let k = u32::try_from(k).map_or(0.0, f64::from);
    ((k + 1.0) * 0.618_033_988_749_894_9).fract()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A model whose lengths, gravity and directions are numbers that no base parameter contains.
    const TEXT: &str = "schema = 1
name = \"arm\"
title = \"An arm\"
gravity = [0, -9.81, 0]
[parameters]
m = { nominal = 2.0, unit = \"kg\" }
[coordinates]
q = { nominal = 0.4 }
[[frame]]
name = \"link\"
on = \"base\"
modified_dh = { theta = \"q\", d = 0.3 }
[[lumped_mass]]
mass = \"m\"
on = \"link\"
at = [0.5, 0]
[[drive]]
name = \"motor\"
joint = \"q\"
";

    /// A fit of the model with a sample of its equations.
    fn fit_of(model: &Model) -> FitFile {
        let base = &model.base[0];
        let text = format!(
            r#"{{"model": "arm", "samples": 10, "condition_number": 1.0, "parameters": [{{"name": {:?}, "expression": {:?},
            "value": 2.5, "std": 0.1, "unit": "kg", "nominal": 2.0}}], "equation_sample": {},
            "fit": {{"nrms": 0.1, "rms": 1.0, "samples": 10, "channels": {{}}}}, "check": null}}"#,
            base.name,
            base.expression,
            serde_json::to_string(&model.equation_sample().unwrap()).unwrap(),
        );
        FitFile::parse(&text, "fit.json").unwrap()
    }

    #[test]
    fn a_fit_of_other_equations_with_the_same_base_parameters_is_refused() {
        let model = Model::from_text("arm.toml", TEXT).unwrap();
        assert_eq!(model.base.len(), 1);
        let fit = fit_of(&model);
        let changed = |from: &str, to: &str| {
            let text = TEXT.replace(from, to);
            assert_ne!(text, TEXT);
            Model::from_text("arm.toml", &text).unwrap()
        };
        // Texts, nominal values and lengths without effect leave the equations.
        for (from, to) in [
            ("nominal = 0.4", "nominal = 1.4"),
            ("An arm", "Other"),
            ("d = 0.3", "d = 0.7"),
        ] {
            let values = changed(from, to).values_of(&fit, "fit.json").unwrap();
            assert_eq!((values.values, values.notes.len()), (vec![2.5], 0), "{to}");
        }
        for (from, to) in [("-9.81", "-9.8"), ("[0, -9.81, 0]", "[-9.81, 0, 0]")] {
            let other = changed(from, to);
            assert_eq!(other.base[0].expression, model.base[0].expression, "{to}");
            let says = other.values_of(&fit, "fit.json").unwrap_err().to_string();
            assert!(says.contains("other equations") && says.contains("`motor`"), "{says}");
        }
        let mut broken = fit.clone();
        broken.equation_sample.as_mut().unwrap().rates.clear();
        let says = model.values_of(&broken, "fit.json").unwrap_err().to_string();
        assert!(says.contains("other coordinates or drives"), "{says}");
    }

    #[test]
    fn platforms_and_loops_have_a_sample_which_another_derivation_repeats() {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
        for name in ["delta.toml", "spidermill.toml", "three_rpr.toml", "quadruped.toml"] {
            let text = std::fs::read_to_string(models.join(name)).unwrap();
            let model = |text: &str| Model::from_text(name, text).unwrap();
            let sample = model(&text).equation_sample();
            let sample = sample.unwrap_or_else(|| panic!("{name} has no state"));
            assert!(
                sample.forces.iter().any(|force| force.abs() > 1e-3),
                "{name}: {sample:?}"
            );
            assert_eq!(model(&text).equation_sample().unwrap(), sample, "{name}");
        }
    }
}
