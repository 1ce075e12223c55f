//! Printed balances of parts cut free: every printed equation is read again and evaluated with the reactions of the
//! evaluator.

use std::collections::BTreeMap;

use modelmill_codegen::review::{BalanceEquation, BalanceVector, BodyBalances, CutFreeError, body_balances};
use modelmill_codegen::{ModelEvaluator, ReactionPrograms};
use modelmill_spec::{DriveIdx, EffectPlace, Mechanism};
use nalgebra::{Matrix3, Vector3};

use crate::base_parameters::{base, nominal};
use crate::infix;
use crate::laws::{ACCURACY, Case, motion};
use crate::mechanics::{Jet, Numbers};

/// How many equations of the printed balances were compared.
#[derive(Clone, Copy, Debug, Default)]
pub struct ComparedBalances {
    /// Bodies that were cut free.
    pub bodies: usize,
    /// Equations that hold.
    pub held: usize,
    /// Equations with a component that the equations of motion do not determine.
    pub open: usize,
    /// Largest relative error.
    pub error: f64,
}

/// One state with everything that is known of it.
struct EvaluatedState<'a> {
    mechanism: &'a Mechanism,
    numbers: &'a Numbers<'a>,
    motion: Vec<Jet>,
    reactions: &'a ReactionPrograms,
    values: Vec<f64>,
    names: BTreeMap<String, f64>,
    drives: Vec<f64>,
}

impl EvaluatedState<'_> {
    /// Axes by columns: those behind the joint of this name, or of the free frame of this name.
    fn axes(&self, name: &str) -> Option<Matrix3<f64>> {
        if name == "base" {
            return Some(Matrix3::identity());
        }
        let frame_named = |name: &str| self.mechanism.frames.iter().position(|f| f.name == name);
        let joint = self.reactions.joints.iter().find(|joint| joint.name == name)?;
        let frame = frame_named(name).or_else(|| frame_named(name.split_once('.')?.0))?;
        let pose = match joint.coordinates.first() {
            Some(first) => {
                let coordinate = self.mechanism.coordinates.iter().position(|c| c.name == *first)?;
                self.numbers.pose_behind(&self.motion, frame, coordinate)
            }
            None => self.numbers.motions(&self.motion)[frame][0],
        };
        Some(pose.fixed_view::<3, 3>(0, 0).into())
    }

    /// The components of a reaction along `axes`; not a number where they are not determined.
    fn reaction(&self, vector: &BalanceVector, by: &str, axes: &Matrix3<f64>) -> Option<Vector3<f64>> {
        let joint = self.reactions.joints.iter().find(|joint| joint.name == by);
        let closed = self.reactions.loops.iter().find(|closed| closed.name == by);
        let (places, own) = match (joint, closed) {
            (Some(joint), _) if vector.unit == "N" => (joint.force, self.axes(by)?),
            (Some(joint), _) => (joint.moment, self.axes(by)?),
            (None, Some(closed)) if vector.unit == "N" => (closed.force, self.axes(&closed.axes)?),
            // Moments of pins are not determined; without them the determined components are the same.
            (None, Some(_)) => return Some(Vector3::zeros()),
            (None, None) => return None,
        };
        let seen = axes.transpose() * own;
        Some(Vector3::from_fn(|i, _| {
            let terms = (0..3).filter(|k| seen[(i, *k)].abs() > 1e-12);
            terms
                .map(|k| seen[(i, k)] * places[k].map_or(f64::NAN, |place| self.values[place]))
                .sum()
        }))
    }

    /// Values of all names in the balances of a body; `None` if its axes are unknown.
    fn names_of(&self, body: &BodyBalances) -> Option<BTreeMap<String, f64>> {
        let axes = self.axes(&body.axes)?;
        let mut names = self.names.clone();
        for vector in &body.vectors {
            let Some(by) = &vector.transmitted_by else { continue };
            if vector.components.is_empty() {
                let drive = self.mechanism.drives.iter().position(|drive| drive.name == *by)?;
                names.insert(vector.symbol.clone(), self.drives[drive]);
                continue;
            }
            let value = self.reaction(vector, by, &axes)?;
            for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
                names.insert(format!("{}_{axis}", vector.symbol), value[k]);
            }
        }
        for definition in &body.definitions {
            let value = infix::scalar(&definition.right, &names);
            names.insert(definition.left.clone(), value);
        }
        Some(names)
    }
}

/// The vectors of a body by their symbols.
fn vectors_of(body: &BodyBalances, names: &BTreeMap<String, f64>) -> BTreeMap<String, Vector3<f64>> {
    let with_components = body.vectors.iter().filter(|v| !v.components.is_empty());
    with_components
        .map(|v| {
            let value = Vector3::from_fn(|k, _| infix::scalar(&v.components[k], names));
            (v.symbol.clone(), value)
        })
        .collect()
}

/// The equation with vectors, in which sums with angular velocities are written by their own symbols.
fn without_rotation(body: &BodyBalances, equation: &BalanceEquation) -> [String; 2] {
    let described = |start: &str| {
        let mut vectors = body.vectors.iter();
        let found = vectors.find(|v| v.meaning.starts_with(start));
        found.map_or("", |v| v.symbol.as_str())
    };
    let [alpha, omega] = ["angular acceleration", "angular velocity"].map(described);
    [&equation.left, &equation.right].map(|side| {
        let mut side = side.clone();
        for vector in &body.vectors {
            let index = vector.symbol.trim_start_matches("k_").trim_start_matches("j_");
            let written = if vector.symbol.starts_with("k_c") {
                format!("I_{index}*{alpha} + cross({omega}, I_{index}*{omega})")
            } else if vector.symbol.starts_with("j_c") {
                format!("cross({alpha}, s_{index}) + cross({omega}, cross({omega}, s_{index}))")
            } else {
                continue;
            };
            side = side.replace(&written, &vector.symbol);
        }
        side
    })
}

impl Case {
    /// Every printed balance of every body holds with the reactions of the evaluator.
    pub fn printed_balances_hold(&self) -> Result<ComparedBalances, String> {
        let mechanism = self.mechanism();
        let reactions = self.derivation.reactions().map_err(|e| self.breach(&e.to_string()))?;
        let evaluator = ModelEvaluator::new(&self.derivation);
        let numbers = Numbers::new(mechanism, nominal(mechanism));
        let mut compared = ComparedBalances::default();
        let mut bodies: Vec<BodyBalances> = Vec::new();
        for frame in &mechanism.frames[1..] {
            match body_balances(&self.derivation, &frame.name) {
                Ok(body) if bodies.iter().all(|other| other.frames != body.frames) => bodies.push(body),
                Ok(_) | Err(CutFreeError::FixedToBase { .. }) => {}
                Err(error) => return Err(self.breach(&error.to_string())),
            }
        }
        compared.bodies = bodies.len();
        for i in 0..self.sample.len().min(3) {
            let state = self.evaluated_state(&evaluator, &numbers, &reactions, i)?;
            for body in &bodies {
                self.compare_body(body, &state, &mut compared)?;
            }
        }
        Ok(compared)
    }

    fn evaluated_state<'a>(
        &'a self,
        evaluator: &ModelEvaluator<'_>,
        numbers: &'a Numbers<'a>,
        reactions: &'a ReactionPrograms,
        i: usize,
    ) -> Result<EvaluatedState<'a>, String> {
        let mechanism = self.mechanism();
        let one = self.sample.only(i);
        let fault = |e: modelmill_codegen::PoseFault| self.breach(&e.to_string());
        let values = evaluator.reactions(reactions, &one.states()).map_err(fault)?;
        let passive = evaluator.passive_motion(&one.states()).map_err(fault)?;
        let p_min = base(&self.derivation, &nominal(mechanism));
        let drives = evaluator.inverse_dynamics(&one.states(), &p_min).map_err(fault)?;
        let mut names = BTreeMap::from([("pi".to_owned(), std::f64::consts::PI)]);
        names.extend(mechanism.constants.iter().map(|c| (c.name.clone(), c.value)));
        names.extend(mechanism.parameters.iter().map(|p| (p.name.clone(), p.nominal)));
        let (mut active, mut following) = (0, 0);
        let n_passive = mechanism.coordinates.iter().filter(|c| c.passive).count();
        for coordinate in &mechanism.coordinates {
            let moved = if coordinate.passive {
                following += 1;
                [0, 1, 2].map(|order| passive[order * n_passive + following - 1][0])
            } else {
                active += 1;
                [&one.q, &one.qd, &one.qdd].map(|columns| columns[active - 1][0])
            };
            for (suffix, value) in ["", "_d", "_dd"].into_iter().zip(moved) {
                names.insert(format!("{}{suffix}", coordinate.name), value);
            }
        }
        // Effects of a drive are no part of the force on its ends.
        let has_effect = |d: usize| {
            let mut effects = mechanism.effects.iter().filter(|effect| effect.mechanics.is_none());
            effects.any(|effect| effect.places.contains(&EffectPlace::Drive(DriveIdx(d))))
        };
        let drives = drives.iter().enumerate();
        Ok(EvaluatedState {
            mechanism,
            numbers,
            motion: motion(evaluator, mechanism, &one),
            reactions,
            values: values.iter().map(|v| v[0]).collect(),
            names,
            drives: drives
                .map(|(d, f)| if has_effect(d) { f64::NAN } else { f[0] })
                .collect(),
        })
    }

    fn compare_body(
        &self,
        body: &BodyBalances,
        state: &EvaluatedState<'_>,
        compared: &mut ComparedBalances,
    ) -> Result<(), String> {
        let Some(names) = state.names_of(body) else {
            compared.open += body.components.len();
            return Ok(());
        };
        let sizes = state.values.iter().chain(&state.drives).filter(|x| x.is_finite());
        let scale = sizes.fold(1e-6, |m: f64, x| m.max(x.abs()));
        let vectors = vectors_of(body, &names);
        let mut check = |tag: &str, left: f64, right: f64| {
            if left.is_nan() || right.is_nan() {
                compared.open += 1;
                return Ok(());
            }
            let error = (left - right).abs() / (scale + left.abs());
            compared.error = compared.error.max(error);
            compared.held += 1;
            if error > 100.0 * ACCURACY {
                return Err(self.breach(&format!("balance {tag} of {}: {left} is not {right}", body.part)));
            }
            Ok(())
        };
        for equation in &body.components {
            let [left, right] = [&equation.left, &equation.right].map(|side| infix::scalar(side, &names));
            check(&equation.tag, left, right)?;
        }
        for equation in [&body.forces, &body.moments] {
            let [left, right] = without_rotation(body, equation).map(|side| infix::vector(&side, &names, &vectors));
            for component in &body.components {
                let Some(axis) = component.tag.strip_prefix(&equation.tag) else {
                    continue;
                };
                let k = ["x", "y", "z"].iter().position(|a| *a == axis).expect("an axis");
                check(&component.tag, left[k], right[k])?;
            }
        }
        Ok(())
    }
}
