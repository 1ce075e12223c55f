//! `reduce`: a full-body rig to a planar model, with the size of every approximation.

use std::path::Path;

use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_reduction::{PlanarReduction, sampled_forces};
use modelmill_rig::{Rig, RigState};

use crate::error::{Error, Outcome};
use crate::host::Host;

/// Poses at which the model is held against the rig, and how far from nominal, rad or m.
const POSES: (usize, f64) = (100, 0.2);

/// A rig that was reduced to a planar model.
pub struct RigReduction {
    /// The rig's name.
    pub rig: String,
    /// The model file and the report of what was assumed.
    pub reduction: PlanarReduction,
    /// How far the model's forces are from the rig's, drive by drive.
    pub forces: Vec<DriveForceError>,
    /// Poses at which they were held against each other.
    pub poses: usize,
}

impl Host {
    /// Reduces a full-body rig to a planar model file by a plan, and measures every approximation; without a plan every body
    /// becomes a part of its own.
    ///
    /// Fails with every finding about rig and plan, each with its place, and where the mechanism is none that the reduction
    /// knows.
    pub fn reduce(&self, path: &Path, plan: Option<&Path>) -> Outcome<RigReduction> {
        let loaded = self.rig(path)?;
        let made = match plan {
            Some(plan) => modelmill_reduction::plan_file_with(plan, self.files())?,
            None => modelmill_reduction::default_plan(&loaded.rig)
                .map_err(|says| Error::input(message!("{}: {}", path.display(), says)))?,
        };
        let rig = made.rig(&loaded.rig);
        let reduction = self
            .run_job(&format!("reducing {}", rig.name), 0, |_| {
                modelmill_reduction::reduce(rig, &made)
            })?
            .map_err(|failure| match plan {
                Some(_) => failure.into(),
                None => Error::input(message!(
                    "{}\nnote: no plan was given, so that every body became a part of its own; a plan ({}) can make one \
                     part of bodies that move alike, such as parallel cranks, whose joints are redundant",
                    failure.render(false).trim_end(),
                    Remedy::option(OptionName::Plan)
                )),
            })?;
        let forces = self.run_job("holding the model against the rig", 0, |_| {
            compare(rig, &reduction)
        })??;
        Ok(RigReduction {
            rig: rig.name.clone(),
            reduction,
            forces,
            poses: POSES.0,
        })
    }
}

/// How far the forces of a drive are from the rig's.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveForceError {
    /// The drive.
    pub drive: String,
    /// Norm of the difference over that of the rig's force.
    pub nrms: f64,
}

/// The model's forces with its nominal values against the rig's own: two programs that share no mechanics.
fn compare(rig: &Rig, reduction: &PlanarReduction) -> Outcome<Vec<DriveForceError>> {
    let loaded = modelmill_spec::load(
        "the reduced model",
        &reduction.model,
        &MemoryFiles::default(),
    )?;
    let derivation = modelmill_codegen::derive(&loaded.mechanism)
        .map_err(|error| Error::derivation("the reduced model", error))?;
    let mechanism = &derivation.mechanism;
    let sampled =
        sampled_forces(rig, POSES.0, POSES.1).map_err(|error| Error::input(error.to_string()))?;
    // Coordinates and drives by name: their order in the model may be another.
    let active = mechanism
        .coordinates
        .iter()
        .filter(|coordinate| !coordinate.passive);
    let order: Vec<usize> = active
        .filter_map(|c| {
            rig.coordinates
                .iter()
                .position(|known| known.name == c.name)
        })
        .collect();
    let column = |of: fn(&RigState) -> &Vec<f64>| -> Vec<Vec<f64>> {
        order
            .iter()
            .map(|k| sampled.iter().map(|(state, _)| of(state)[*k]).collect())
            .collect()
    };
    let (q, qd, qdd) = (column(|s| &s.q), column(|s| &s.qd), column(|s| &s.qdd));
    let truth: Vec<Vec<f64>> = mechanism
        .drives
        .iter()
        .filter_map(|drive| rig.drives.iter().position(|known| known.name == drive.name))
        .map(|d| sampled.iter().map(|(_, forces)| forces[d]).collect())
        .collect();
    let states = MotionStates {
        q: slices(&q),
        qd: slices(&qd),
        qdd: slices(&qdd),
        load: slices(&truth),
    };
    let model = ModelEvaluator::new(&derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .map_err(|fault| {
            Error::input(format!(
                "the reduced model does not follow the rig: {fault}"
            ))
        })?;
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    Ok(mechanism
        .drives
        .iter()
        .zip(model.iter().zip(&truth))
        .map(|(drive, (model, truth))| DriveForceError {
            drive: drive.name.clone(),
            nrms: norm(&mut model.iter().zip(truth).map(|(x, y)| x - y))
                / norm(&mut truth.iter().copied()),
        })
        .collect())
}

fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}
