//! Runs the four steps of a reduction: a rig and a plan go in, the text of a model file and the report come out.

use std::collections::BTreeMap;

use nalgebra::Complex;

use crate::alike::RotationSum;
use crate::names::PlanNames;
use crate::part::SubstitutionPart;
use crate::plan::ReductionPlan;
use crate::planar::{PlanarBody, check_group, out_of_plane_rate};
use crate::planar_draft::PlanarDraft;
use crate::report::{AssumptionSize, ReductionReport};
use crate::samples::{MotionPlane, MotionSamples};
use crate::tolerance::{TOLERANCE, rate_tolerance};
use crate::write::{model_file, significant_digits};
use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use modelmill_rig::{LoadFailure, Rig, RigLog, RigPoseError, plain_error};
use modelmill_spec::Diagnostic;

/// The result of a reduction.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarReduction {
    /// The text of the model file.
    pub model: String,
    /// All assumptions with their sizes.
    pub report: ReductionReport,
}

/// Lengths (m), angles (rad) and accelerations (m/s^2) below this count as zero.
pub(crate) const ZERO: f64 = 1e-12;

/// Reduces a rig by a plan.
///
/// Fails with every fault of the plan, each with its position: unknown names, bodies that are missing or used twice,
/// bodies that leave the plane, joints that do not coincide.
pub fn reduce(rig: &Rig, plan: &ReductionPlan) -> Result<PlanarReduction, LoadFailure> {
    let mut log = RigLog::default();
    // A result counts only if the log has no faults.
    let outcome = run(rig, plan, &mut log);
    match outcome {
        Some((draft, report)) if log.0.is_empty() => {
            let model = model_file(&draft);
            // The result is loaded like any model file; its faults come from the plan.
            let path = format!("{}.toml (reduced)", draft.name);
            modelmill_spec::load(&path, &model, &MemoryFiles::default())?;
            Ok(PlanarReduction { model, report })
        }
        _ => {
            // Faults in the sequence of the plan's text.
            log.0.sort_by_key(|found| found.span.map(|span| span.start));
            Err(LoadFailure {
                diagnostics: log.0,
                sources: plan.sources.clone(),
            })
        }
    }
}

/// The draft of the model file of a rig and a plan, with the report; for a comparison of its symbols.
///
/// Fails with the faults of the plan.
pub(crate) fn draft(rig: &Rig, plan: &ReductionPlan) -> Result<(PlanarDraft, ReductionReport), LoadFailure> {
    let mut log = RigLog::default();
    match run(rig, plan, &mut log) {
        Some(outcome) if log.0.is_empty() => Ok(outcome),
        _ => Err(LoadFailure {
            diagnostics: log.0,
            sources: plan.sources.clone(),
        }),
    }
}

/// Runs all steps; `None` if the log has faults after which the others make no sense.
fn run(rig: &Rig, plan: &ReductionPlan, log: &mut RigLog) -> Option<(PlanarDraft, ReductionReport)> {
    let entry = &plan.entry;
    // Groups, the plane of motion, and samples of the rig's motion.
    let names = PlanNames::new(rig, entry, log);
    let plane = MotionPlane::new(entry.plane.at, entry.plane.normal, entry.plane.x);
    let samples = match MotionSamples::new(rig, entry.samples.number, entry.samples.range) {
        Ok(samples) if samples.moments.len() >= 4 => samples,
        // Too few poses for the checks.
        Ok(samples) => {
            let says = format!(
                "{} of {} sampled poses cannot be reached by the rig; reduce `range` in `[samples]`",
                samples.n_out_of_reach, entry.samples.number
            );
            log.0.push(plain_error(None, says));
            return None;
        }
        Err(error) => {
            let says = format!("the rig cannot be assembled in its nominal configuration: {error}");
            let may_have_gaps = match &error {
                RigPoseError::OutOfReach { .. } => true,
                RigPoseError::TooManyCoordinates { enough_with_gaps, .. } => *enough_with_gaps,
                _ => false,
            };
            let accept = may_have_gaps.then(|| {
                message!(
                    "to accept gaps of joints, and to measure what they change, use {}",
                    Remedy::option(OptionName::Tolerance)
                )
            });
            log.0.push(Diagnostic {
                help: open_joints(rig).into_iter().chain(accept).collect(),
                ..plain_error(None, says)
            });
            return None;
        }
    };
    // All steps work on the same state.
    let mut work = ReductionState {
        names,
        plane,
        samples,
        parts: Vec::new(),
        draft: PlanarDraft {
            name: entry.name.get_ref().clone(),
            title: entry.title.clone().unwrap_or_default(),
            origin: format!("Reduced from the rig {} by modelmill reduce.", rig.name),
            ..PlanarDraft::default()
        },
        report: ReductionReport::default(),
        used_groups: Vec::new(),
        part_totals: Vec::new(),
        is_generated: plan.rig.is_some(),
        rotations: Vec::new(),
        nominal: BTreeMap::new(),
        loop_directions: Vec::new(),
    };
    work.report_gaps();
    // The next steps make no sense if the motion is not planar, or if parts are missing.
    work.planar_reduction(log);
    if !log.0.is_empty() {
        return None;
    }
    work.parts(log);
    if !log.0.is_empty() {
        return None;
    }
    // The remaining steps report all faults at once.
    work.lumped_masses(log);
    work.check_equation_1();
    work.loops(log);
    work.drives(log);
    work.effects();
    work.check_completeness(log);
    work.check_constants(log);
    let draft = work.draft;
    let mut report = work.report;
    // Symbols that stand for several quantities, with the differences between their values.
    for symbols in [&draft.masses, &draft.centres, &draft.inertias, &draft.constants] {
        symbols.report_ties(&mut report);
    }
    Some((draft, report))
}

/// The largest gaps of joints in the poses that the file states, with what can be done; `None` if all are closed. The
/// residual of the assembly is smaller than these, because it is shared by all joints of a loop.
fn open_joints(rig: &Rig) -> Option<Message> {
    /// Largest number of joints that are named.
    const NAMED: usize = 3;
    let mut gaps = rig.nominal_gaps();
    gaps.retain(|gap| gap.distance > TOLERANCE);
    gaps.sort_by(|a, b| b.distance.total_cmp(&a.distance));
    let named = gaps.iter().take(NAMED).map(|gap| {
        let millimetres = significant_digits(1e3 * gap.distance, 3);
        format!("`{}` by {millimetres} mm", gap.joint)
    });
    let named: Vec<String> = named.collect();
    (!named.is_empty()).then(|| {
        message!(
            "with the poses of the file, joints are open: {}; correct their points, or lengths in the same loop",
            named.join(", ")
        )
    })
}

/// The state of a reduction between its steps.
pub(crate) struct ReductionState<'a> {
    /// Names of the plan and the rig.
    pub(crate) names: PlanNames<'a>,
    /// The plane of motion.
    pub(crate) plane: MotionPlane,
    /// Sampled motions of the rig.
    pub(crate) samples: MotionSamples,
    /// Parts so far; carriers stand before what they carry.
    pub(crate) parts: Vec<SubstitutionPart>,
    /// The model so far.
    pub(crate) draft: PlanarDraft,
    /// The report so far.
    pub(crate) report: ReductionReport,
    /// Groups that are in the model or left out by name.
    pub(crate) used_groups: Vec<String>,
    /// For each part of the draft a description, and its exact mass, centre and inertia.
    pub(crate) part_totals: Vec<(String, PlanarBody)>,
    /// Whether the plan was generated: then parts that move alike share their coordinates.
    pub(crate) is_generated: bool,
    /// The rotation of each part since the nominal configuration, in the order of `parts`.
    pub(crate) rotations: Vec<RotationSum>,
    /// Exact values of the coordinates in the nominal configuration, rad.
    pub(crate) nominal: BTreeMap<String, f64>,
    /// Gaps of the loops so far, as orthogonal directions of length 1.
    pub(crate) loop_directions: Vec<BTreeMap<RotationSum, Complex<f64>>>,
}

impl ReductionState<'_> {
    /// Reports the largest gap along the samples if the rig may have gaps.
    fn report_gaps(&mut self) {
        let allowed = self.names.rig.gap_tolerance;
        if allowed > 0.0 {
            let (joint, gap) = &self.samples.largest_gap;
            let says = format!(
                "do not close exactly; gaps up to {} mm are accepted, and all joints of a loop share them; the largest is at \
                 `{joint}`",
                significant_digits(1e3 * allowed, 3)
            );
            let sizes = vec![AssumptionSize::new("largest gap", *gap, "m or rad")];
            self.report.add(1, "joints", says, sizes);
        }
    }

    /// Step 1: checks that motion is planar, and writes gravity in the plane.
    fn planar_reduction(&mut self, log: &mut RigLog) {
        let rig = self.names.rig;
        // No body may leave the plane.
        let out = out_of_plane_rate(&self.plane, &self.samples);
        if out.is_nan() || out > rate_tolerance(rig) {
            log.0.push(plain_error(
                None,
                format!(
                    "bodies leave the plane with up to {} m/s or rad/s; correct the plane of motion in `[plane]`, or write a \
                     spatial model of this rig",
                    significant_digits(out, 3)
                ),
            ));
        }
        let reach = match self.samples.n_out_of_reach {
            0 => String::new(),
            n => format!(" ({n} others cannot be reached)"),
        };
        let poses = self.samples.moments.len();
        self.report.add(
            1,
            "motion",
            format!("all bodies stay in the plane at {poses} sampled poses{reach}"),
            vec![AssumptionSize::new("largest rate out of it", out, "m/s or rad/s")],
        );
        // Gravity in the plane; the component out of it loads bearings only.
        let across = self.plane.normal.dot(&rig.gravity);
        let flat = self.plane.components(&rig.gravity);
        self.report.add(
            1,
            "gravity",
            "acts in the plane",
            vec![AssumptionSize::new("component out of the plane", across, "m/s^2")],
        );
        // One symbol `g` with a sign if gravity is along an axis, else two components.
        self.draft.gravity = match (flat.x.abs() > ZERO, flat.y.abs() > ZERO) {
            (false, false) => ["0", "0"].map(str::to_owned),
            (true, true) => [("gx", flat.x), ("gy", flat.y)].map(|(name, value)| self.gravity_constant(name, value)),
            (true, false) => [
                signed_name(self.gravity_constant("g", flat.x.abs()), flat.x),
                "0".to_owned(),
            ],
            (false, true) => [
                "0".to_owned(),
                signed_name(self.gravity_constant("g", flat.y.abs()), flat.y),
            ],
        };
        // The size of what the plane neglects in each group.
        for (name, bodies) in &self.names.groups {
            check_group(rig, name, bodies, &self.plane, &self.samples, &mut self.report);
        }
    }

    /// Adds a constant for gravity, and returns its name.
    fn gravity_constant(&mut self, name: &str, value: f64) -> String {
        self.draft
            .constants
            .add_value(name, "m/s^2", "acceleration of gravity", "gravity", value);
        name.to_owned()
    }
}

/// The name with the sign of a value.
fn signed_name(name: String, value: f64) -> String {
    if value < 0.0 { format!("-{name}") } else { name }
}
