//! Measured forces of more drives than degrees of freedom, such as cables or redundant legs. A recording goes in; the
//! forces `J' f` on the rows of the equation of motion are added to it.
//!
//! The forces `f` of such drives are not unique: inner forces with `J' f = 0` do not change the motion. `J' f` is unique,
//! and is what the model computes. With closed loops, `J = J_a + J_p G` is the derivative of the drives by the independent
//! coordinates, with the passive rates `G = -K_p^-1 K_a` of the closure equations `K_p y_p + K_a y_a = 0` (Müller, 2005,
//! redundantly actuated parallel manipulators).

use modelmill_boundary::message;
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::{RecordingNote, SignalRecording as Raw};
use modelmill_spec::{DriveKind, Kinematics, Mechanism};
use nalgebra::DMatrix;

use super::thresholds::PROJECTION_CONDITION;
use crate::error::{Error, Outcome};
use crate::model::Model;

/// Adds the projected forces of drives that share rows, `J' f`, to the forces that were recorded on these rows.
///
/// The note states that these forces, and not those of single drives, are used; none if no drive shares rows.
///
/// Fails at a pose where loops do not close or do not determine the passive rates.
pub(super) fn add_projected_forces(model: &Model, raw: &mut Raw) -> Outcome<Option<RecordingNote>> {
    let mechanism = &model.derivation.mechanism;
    let shared = &mechanism.shared_drives;
    let has = |name: &str| raw.has_column(name);
    let mut active = mechanism.coordinates.iter().filter(|c| !c.passive);
    if !shared.iter().any(|drive| has(&drive.name)) || !active.all(|c| has(&c.name)) {
        // No forces were measured, or poses are missing, which is reported when states are prepared.
        return Ok(None);
    }
    let column = |name: &str| raw.column(name).map(<[f64]>::to_vec);
    let forces: Vec<Vec<f64>> = shared.iter().map(|d| column(&d.name)).collect::<Result<_, _>>()?;
    let q = closed_positions(model, raw)?;
    let kinematics = Kinematics::new(mechanism);
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for row in &mechanism.drives {
        rows.push(if has(&row.name) {
            column(&row.name)?
        } else {
            vec![0.0; raw.samples()]
        });
    }
    // The Jacobian of the drives is evaluated at the pose of each sample.
    for sample in 0..raw.samples() {
        let here: Vec<f64> = q.iter().map(|q| q[sample]).collect();
        let poses = kinematics.poses(&here);
        // Forces on all coordinates of the open tree, then on the independent ones.
        let mut on_tree = vec![0.0; here.len()];
        for (drive, force) in shared.iter().zip(&forces) {
            for (total, slope) in on_tree.iter_mut().zip(kinematics.drive_slopes(&poses, drive.kind)) {
                // A drive without leverage adds nothing, also where its force is missing.
                if slope != 0.0 {
                    *total += slope * force[sample];
                }
            }
        }
        let projected = project_forces(mechanism, &kinematics.gap_jacobian(&poses), &on_tree).ok_or_else(|| {
            let place = raw
                .line(sample)
                .map_or_else(|| format!("at sample {}", sample + 1), |line| format!("in line {line}"));
            Error::input(message!(
                "{}: {place} the loops do not determine the passive rates; the forces of the drives cannot be \
                 projected on the independent coordinates there, so leave such poses out of the recording",
                raw.file()
            ))
        })?;
        for (row, total) in mechanism.drives.iter().zip(&mut rows) {
            if let DriveKind::Joint(i) = row.kind {
                total[sample] += projected[i.0];
            }
        }
    }
    for (row, total) in mechanism.drives.iter().zip(rows) {
        raw.set_column(&row.name, total);
    }
    let rows: Vec<String> = mechanism.drives.iter().map(|row| format!("`{}`", row.name)).collect();
    Ok(Some(RecordingNote::info(format!(
        "{} drives act on {} degrees of freedom, so their forces are not unique. The forces that they exert together on the \
         independent coordinates are unique, and are used: {}.",
        shared.len(),
        mechanism.drives.len(),
        rows.join(", ")
    ))))
}

/// Positions of all coordinates along a recording, `[coordinate][sample]`: the active ones as recorded, the passive ones
/// from the loops.
fn closed_positions(model: &Model, raw: &Raw) -> Outcome<Vec<Vec<f64>>> {
    let mechanism = &model.derivation.mechanism;
    let names = model.active_coordinates();
    let recorded: Vec<Vec<f64>> = names
        .iter()
        .map(|name| raw.column(name).map(<[f64]>::to_vec))
        .collect::<Result<_, _>>()?;
    let still = vec![vec![0.0; raw.samples()]; recorded.len()];
    let load = vec![vec![0.0; raw.samples()]; mechanism.drives.len()];
    let (active, passive) = model.derivation.coordinates();
    let mut q = vec![Vec::new(); mechanism.coordinates.len()];
    if !passive.is_empty() {
        let states = MotionStates {
            q: recorded.iter().map(Vec::as_slice).collect(),
            qd: still.iter().map(Vec::as_slice).collect(),
            qdd: still.iter().map(Vec::as_slice).collect(),
            load: load.iter().map(Vec::as_slice).collect(),
        };
        let found = ModelEvaluator::new(&model.derivation)
            .passive_motion(&states)
            .map_err(|fault| Error::input(message!("{}: {}", raw.file(), fault)))?;
        for (i, values) in passive.iter().zip(found) {
            q[*i] = values;
        }
    }
    for (i, values) in active.into_iter().zip(recorded) {
        q[i] = values;
    }
    Ok(q)
}

/// Forces on the coordinates of the open tree projected on the independent coordinates: `tau_a + G' tau_p`, in the place of
/// each independent coordinate. `gaps` are the derivatives of all closure equations by all coordinates, redundant ones
/// included.
///
/// `None` where the equations do not determine the passive rates.
fn project_forces(mechanism: &Mechanism, gaps: &[Vec<f64>], on_tree: &[f64]) -> Option<Vec<f64>> {
    let of_kind = |passive: bool| -> Vec<usize> {
        let all = mechanism.coordinates.iter().enumerate();
        all.filter(|(_, c)| c.passive == passive).map(|(i, _)| i).collect()
    };
    let (active, passive) = (of_kind(false), of_kind(true));
    let mut projected = on_tree.to_vec();
    if passive.is_empty() {
        return Some(projected);
    }
    let pick = |columns: &[usize]| DMatrix::from_fn(gaps.len(), columns.len(), |r, k| gaps[r][columns[k]]);
    let (of_passive, of_active) = (pick(&passive), pick(&active));
    let decomposed = of_passive.clone().svd(true, true);
    let (largest, least) = (decomposed.singular_values.max(), decomposed.singular_values.min());
    let is_determined = least > PROJECTION_CONDITION * largest;
    if decomposed.singular_values.len() < passive.len() || !is_determined {
        return None;
    }
    let mut rates = decomposed.solve(&of_active, 0.0).ok()?;
    // The decomposition has only half of all digits at single poses; one step of refinement restores them.
    rates += decomposed.solve(&(of_active - of_passive * &rates), 0.0).ok()?;
    for (k, i) in active.iter().enumerate() {
        let carried: f64 = passive
            .iter()
            .enumerate()
            .map(|(j, p)| rates[(j, k)] * on_tree[*p])
            .sum();
        projected[*i] -= carried;
    }
    Some(projected)
}
