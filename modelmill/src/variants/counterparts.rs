//! Matches two models of one machine: coordinates and drives with the same names.

use modelmill_identify::{PreparedRun, RecordingNote};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::free::free_bodies;
use crate::segment::RecordingSegment;

/// Coordinates and drives that two models share.
pub(super) struct ModelCounterparts {
    /// For each active coordinate of the second model, its index among those of the first.
    coordinates: Vec<usize>,
    /// Drives that both have, by their indices in the first and in the second model.
    pub(super) drives: Vec<[usize; 2]>,
    /// Notes on what is left out.
    pub(super) notes: Vec<RecordingNote>,
}

impl ModelCounterparts {
    /// Matches two models by names.
    ///
    /// Fails when the models do not have the same active coordinates, or no drive is in both.
    pub(super) fn match_models(models: [&Model; 2]) -> Outcome<Self> {
        let coordinates = coordinates(models)?;
        let [before, after] = models.map(|model| &model.derivation.mechanism.drives);
        // With more drives than degrees of freedom only the total force along each coordinate is comparable.
        let is_shared = models
            .iter()
            .all(|model| !model.derivation.mechanism.shared_drives.is_empty());
        let mut notes = Vec::new();
        if is_shared {
            notes.push(RecordingNote::info(
                "There are more drives than degrees of freedom: figures are of their total force along each coordinate.",
            ));
        }
        // A drive is compared if it is driven in both models and its force has the same unit.
        let mut drives = Vec::new();
        for (d, drive) in before.iter().enumerate() {
            let Some(e) = after.iter().position(|other| other.name == drive.name) else {
                continue;
            };
            // Drives in different units, such as a joint and a cylinder, are not comparable.
            let units = [models[0].force_unit(d), models[1].force_unit(e)];
            if !(drive.is_driven && after[e].is_driven || is_shared) {
                notes.push(RecordingNote::info(format!(
                    "No drive acts on {}, and it is left out.",
                    drive.name
                )));
            } else if units[0] == units[1] {
                drives.push([d, e]);
            } else {
                notes.push(RecordingNote::warning(format!(
                    "{} is left out: its force is in {} in {} and in {} in {}.",
                    drive.name, units[0], models[0].path, units[1], models[1].path
                )));
            }
        }
        // Drives of one model only are named in a note.
        for (here, there) in [(0, 1), (1, 0)] {
            let all = models.map(Model::row_names);
            let alone = all[here].iter().filter(|name| !all[there].contains(name));
            let alone: Vec<&str> = alone.map(String::as_str).collect();
            if !alone.is_empty() {
                notes.push(RecordingNote::warning(format!(
                    "Left out, since only {} has them: drives {}.",
                    models[here].path,
                    alone.join(", ")
                )));
            }
        }
        // Without a common drive there is nothing to compare.
        if drives.is_empty() {
            return Err(Error::input(format!(
                "{} and {} have no drive in common ({}; {}); give a drive the same name in both files",
                models[0].path,
                models[1].path,
                models[0].row_names().join(", "),
                models[1].row_names().join(", ")
            )));
        }
        Ok(Self {
            coordinates,
            drives,
            notes,
        })
    }

    /// The states of a motion in the order of each model, with the load that its own forces cause.
    ///
    /// Fails when a model cannot follow the motion.
    pub(super) fn own_states(&self, models: [&Model; 2], motion: &RecordingSegment) -> Outcome<[RecordingSegment; 2]> {
        // The second model may list its coordinates in another order.
        let in_order = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let places = self.coordinates.iter();
            places.map(|i| columns[*i].clone()).collect()
        };
        // Measured forces are dropped, so that both models compute their loads in the same way.
        let before = without_forces(&motion.run);
        let after = PreparedRun {
            q: in_order(&before.q),
            qd: in_order(&before.qd),
            qdd: in_order(&before.qdd),
            ..before.clone()
        };
        Ok([
            with_own_load(models[0], before.into())?,
            with_own_load(models[1], after.into())?,
        ])
    }
}

/// The motion of a run without its forces.
fn without_forces(run: &PreparedRun) -> PreparedRun {
    PreparedRun {
        force: None,
        left_out: Vec::new(),
        notes: Vec::new(),
        ..run.clone()
    }
}

/// The states with the load of the drives, if effects depend on it: the model's forces without these effects.
///
/// Fails when the model cannot follow the motion.
fn with_own_load(model: &Model, mut states: RecordingSegment) -> Outcome<RecordingSegment> {
    if !model.load_dependent_effects().is_empty() {
        // Zero load makes the effects zero; the forces without them are the load.
        states.load = Some(vec![vec![0.0; states.samples()]; model.row_names().len()]);
        states.load = Some(super::forces_of(model, &states)?);
    }
    Ok(states)
}

/// For each active coordinate of the second model, its index among those of the first.
///
/// Fails when the names or kinds of the active coordinates differ.
fn coordinates(models: [&Model; 2]) -> Outcome<Vec<usize>> {
    let active = models.map(Model::active_coordinate_types);
    let place = |of: &[(String, bool)], name: &str| of.iter().position(|(other, _)| other == name);
    // Both directions are tested, so that the message names the model that lacks a coordinate.
    for (here, there) in [(0, 1), (1, 0)] {
        let names = active[here].iter().map(|(name, _)| name.as_str());
        let alone: Vec<&str> = names.filter(|name| place(&active[there], name).is_none()).collect();
        if !alone.is_empty() {
            return Err(Error::input(format!(
                "{} has no active {} {}, but {} has: two models are compared along one motion of \
                 the same coordinates; give them the same names in both files",
                models[there].path,
                if alone.len() == 1 { "coordinate" } else { "coordinates" },
                alone.join(", "),
                models[here].path
            )));
        }
    }
    // Coordinates with the same name must have the same unit.
    let mut places = Vec::new();
    for (name, is_angle) in &active[1] {
        let Some(i) = place(&active[0], name) else {
            continue;
        };
        if active[0][i].1 != *is_angle {
            let unit = |is_angle: bool| if is_angle { "rad" } else { "m" };
            return Err(Error::input(format!(
                "`{name}` is in {} in {} and in {} in {}: they cannot share a motion",
                unit(active[0][i].1),
                models[0].path,
                unit(*is_angle),
                models[1].path
            )));
        }
        places.push(i);
    }
    // The order of a pose cannot be changed column by column.
    let has_free_bodies = models
        .iter()
        .any(|model| free_bodies(&model.derivation.mechanism).next().is_some());
    // The rates of a free body are its twist, which is assigned by the order of the coordinates.
    if has_free_bodies && !places.is_sorted() {
        return Err(Error::input(format!(
            "{} and {} have a free body and name their coordinates in different orders; use one order in both files",
            models[0].path, models[1].path
        )));
    }
    Ok(places)
}
