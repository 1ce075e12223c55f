//! `reduce`: reduces a rig with spatial bodies to a planar model and measures the error of every approximation.

use std::path::Path;

use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::RecordingNote;
use modelmill_reduction::{ImportOptions, LARGEST_DESCRIPTION, MeshFiles, PlanarReduction, sampled_forces};
use modelmill_rig::{LoadedRig, Rig, RigState};

use crate::error::{Error, Outcome};
use crate::host::Host;

/// Number of random poses for the comparison with the rig, and their largest distance from the nominal pose, rad or m.
const POSES: (usize, f64) = (100, 0.2);

/// Endings of robot descriptions.
const DESCRIPTION_ENDINGS: [&str; 4] = ["urdf", "xml", "mjcf", "sdf"];

/// Options of a reduction.
#[derive(Clone, Copy, Debug, Default)]
pub struct RigReductionOptions<'a> {
    /// The path of a plan file, which states the plane and the bodies that are merged to one part. Without a plan,
    /// every body becomes a separate part.
    pub plan: Option<&'a Path>,
    /// Largest gap that joints may have, m or rad; 0 for joints that close.
    pub gap_tolerance: f64,
}

impl RigReductionOptions<'_> {
    /// The tolerance for gaps.
    ///
    /// Fails when it is negative or no number.
    fn checked_tolerance(&self) -> Outcome<f64> {
        let tolerance = self.gap_tolerance;
        if tolerance.is_finite() && tolerance >= 0.0 {
            return Ok(tolerance);
        }
        Err(Error::input(
            "the tolerance for gaps must be a length in m that is not negative".to_owned(),
        ))
    }
}

/// The planar model of a rig.
pub struct RigReduction {
    /// The rig's name.
    pub rig: String,
    /// The model file and the report of its assumptions.
    pub reduction: PlanarReduction,
    /// Error of the model's forces relative to the rig's, drive by drive.
    pub forces: Vec<DriveForceError>,
    /// Number of poses of that comparison.
    pub poses: usize,
    /// Number of base parameters of the model.
    pub n_base: usize,
}

/// A plan that was proposed for a rig, with the planar model to which it leads.
pub struct ProposedReduction {
    /// The text of the plan file.
    pub plan: String,
    /// What the plan proposes, one sentence each.
    pub proposes: Vec<String>,
    /// The model of this plan.
    pub reduced: RigReduction,
}

impl Host {
    /// Reduces a rig with spatial bodies to a planar model file, and measures the error of every approximation.
    /// With a tolerance for gaps, the rig's joints are closed as well as possible (least squares), and the rig's forces
    /// are computed for the motion with the remaining gaps. The model closes its loops exactly. So the difference
    /// between the forces of rig and model is the error that the gaps cause.
    ///
    /// Fails with all errors and warnings of rig and plan, each with its place, and when the reduction does not support
    /// the mechanism.
    pub fn reduce(&self, path: &Path, options: &RigReductionOptions<'_>) -> Outcome<RigReduction> {
        let plan = options.plan;
        let mut loaded = self.noted_rig(path)?;
        loaded.rig.gap_tolerance = options.checked_tolerance()?;
        // The plan names parts and their bodies; the default plan has one part for each body.
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
                    "{}\nnote: no plan was given, so that every body became a separate part; a plan ({}) can merge \
                     bodies that move alike, such as parallel cranks, whose joints are redundant",
                    failure.render(false).trim_end(),
                    Remedy::option(OptionName::Plan)
                )),
            })?;
        self.compare_reduction(rig, reduction)
    }

    /// Proposes a plan file for a rig whose bodies move in one plane. The plan states the plane, the bodies that are
    /// merged into one part, and the symbols of their values. Bodies that move alike become one part, bodies that only
    /// translate become point masses, and equal values share a symbol. The rig is reduced by this plan, so that the
    /// error of the plan is known.
    ///
    /// Fails with the errors of the rig, and when no plan can be proposed for it.
    ///
    /// ```no_run
    /// use std::path::Path;
    ///
    /// let rig = Path::new("model-spec/rigs/spidermill-seventeen.toml");
    /// let proposed = modelmill::Host::new().propose_plan(rig, &modelmill::reduce::RigReductionOptions::default())?;
    /// std::fs::write("plan.toml", &proposed.plan).unwrap();
    /// assert!(proposed.reduced.forces.iter().all(|force| force.nrms < 1e-6));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn propose_plan(&self, path: &Path, options: &RigReductionOptions<'_>) -> Outcome<ProposedReduction> {
        let mut loaded = self.noted_rig(path)?;
        loaded.rig.gap_tolerance = options.checked_tolerance()?;
        let rig = &loaded.rig;
        let refuse = |says: String| Error::input(format!("{}: {says}", path.display()));
        let proposal = self
            .run_job(&format!("proposing a plan for {}", rig.name), 0, |_| {
                modelmill_reduction::propose_plan(rig)
            })?
            .map_err(refuse)?;
        let plan = modelmill_reduction::plan("the proposed plan", &proposal.text)?;
        let reduction = self.run_job(&format!("reducing {}", rig.name), 0, |_| {
            modelmill_reduction::reduce(rig, &plan)
        })??;
        Ok(ProposedReduction {
            plan: proposal.text,
            proposes: proposal.remarks,
            reduced: self.compare_reduction(rig, reduction)?,
        })
    }

    /// Reads a rig file, or makes a rig from a URDF, MJCF or SDF of a planar mechanism.
    ///
    /// Fails with the errors of the file.
    pub fn rig_or_description(&self, path: &Path) -> Outcome<LoadedRig> {
        if is_description(path) {
            Ok(self.rig_of_description(path)?.0)
        } else {
            self.rig(path)
        }
    }

    /// Reads a rig file or a robot description, and notes what a rig cannot have.
    fn noted_rig(&self, path: &Path) -> Outcome<LoadedRig> {
        if !is_description(path) {
            return self.rig(path);
        }
        let (loaded, remarks) = self.rig_of_description(path)?;
        for says in remarks {
            self.note(&RecordingNote::warning(format!("{}: {says}", path.display())));
        }
        Ok(loaded)
    }

    /// The rig of a robot description, with what was left out or assumed.
    fn rig_of_description(&self, path: &Path) -> Outcome<(LoadedRig, Vec<String>)> {
        let refuse = |says: String| Error::input(format!("{}: {says}", path.display()));
        let read = |file: &Path| {
            let text = self.files().read_text(file, LARGEST_DESCRIPTION as u64);
            text.map_err(|error| format!("{} cannot be read: {}", file.display(), error.fault))
        };
        let text = read(path).map_err(Error::input)?;
        let read_included = |file: &str| read(&path.with_file_name(file));
        let text = modelmill_reduction::expand_other_files(&text, &read_included).map_err(refuse)?;
        let read_mesh = |file: &str| self.read_mesh(path, file);
        let options = ImportOptions {
            meshes: Some(MeshFiles(&read_mesh)),
            ..ImportOptions::default()
        };
        let made =
            modelmill_reduction::rig_of_description(&text, &options).map_err(|error| refuse(error.to_string()))?;
        // Faults show lines of the rig that was made from the description.
        let loaded = modelmill_rig::load(&path.to_string_lossy(), &made.text, self.files())?;
        Ok((loaded, made.remarks))
    }

    /// A reduction with the errors of its forces.
    fn compare_reduction(&self, rig: &Rig, reduction: PlanarReduction) -> Outcome<RigReduction> {
        let (forces, n_base) = self.run_job("comparing the model with the rig", 0, |_| compare(rig, &reduction))??;
        Ok(RigReduction {
            rig: rig.name.clone(),
            reduction,
            forces,
            poses: POSES.0,
            n_base,
        })
    }
}

/// Whether a file is a robot description by its ending.
fn is_description(path: &Path) -> bool {
    let ending = path.extension().and_then(|end| end.to_str());
    ending.is_some_and(|end| DESCRIPTION_ENDINGS.iter().any(|known| known.eq_ignore_ascii_case(end)))
}

/// Error of the forces of a drive relative to the rig's.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveForceError {
    /// The drive.
    pub drive: String,
    /// Norm of the difference divided by the norm of the rig's force.
    pub nrms: f64,
}

/// Compares the model's forces at its nominal values with the rig's. Both programs share no mechanics, so that the
/// comparison is independent. Returns the number of base parameters too.
///
/// Fails when the reduced model cannot be loaded or derived, or when the rig cannot be sampled.
fn compare(rig: &Rig, reduction: &PlanarReduction) -> Outcome<(Vec<DriveForceError>, usize)> {
    let loaded = modelmill_spec::load("the reduced model", &reduction.model, &MemoryFiles::default())?;
    let derivation =
        modelmill_codegen::derive(&loaded.mechanism).map_err(|error| Error::derivation("the reduced model", error))?;
    let mechanism = &derivation.mechanism;
    let sampled = sampled_forces(rig, POSES.0, POSES.1).map_err(|error| Error::input(error.to_string()))?;
    // Coordinates and drives are matched by name, since their order in the model may differ.
    let active = mechanism.coordinates.iter().filter(|coordinate| !coordinate.passive);
    let order: Vec<usize> = active
        .filter_map(|c| rig.coordinates.iter().position(|known| known.name == c.name))
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
    // The rig's forces are the load for effects that depend on it.
    let states = MotionStates {
        q: slices(&q),
        qd: slices(&qd),
        qdd: slices(&qdd),
        load: slices(&truth),
    };
    let model = ModelEvaluator::new(&derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .map_err(|fault| Error::input(format!("the reduced model does not follow the rig: {fault}")))?;
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    let errors = mechanism
        .drives
        .iter()
        .zip(model.iter().zip(&truth))
        .map(|(drive, (model, truth))| DriveForceError {
            drive: drive.name.clone(),
            nrms: norm(&mut model.iter().zip(truth).map(|(x, y)| x - y)) / norm(&mut truth.iter().copied()),
        })
        .collect();
    Ok((errors, derivation.reduction.retained.len()))
}

/// Columns as slices.
fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}
