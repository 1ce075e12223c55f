//! The four steps in a row: a rig and a plan go in, the text of a model file and the report come out.

use crate::draft::Draft;
use crate::names::Names;
use crate::part::Part;
use crate::plan::Plan;
use crate::planar::{Flat, check_group, out_of_plane};
use crate::report::{Report, Size};
use crate::samples::{Plane, Samples};
use crate::write::{digits, model_file};
use modelmill_boundary::files::Memory;
use modelmill_rig::{Failure, Log, Rig, fault};

/// What a reduction gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduction {
    /// The text of the model file.
    pub model: String,
    /// What was assumed.
    pub report: Report,
}

/// Rates out of the plane, gaps of joints and changes of shifts above this are no rounding.
pub(crate) const TOLERANCE: f64 = 1e-6;
/// Lengths and angles below this are zero.
pub(crate) const ZERO: f64 = 1e-12;

/// Reduces a rig by a plan.
///
/// Fails with every fault of the plan, each with its place: unknown names, bodies that are forgotten or used twice,
/// bodies that leave the plane, joints that do not meet.
pub fn reduce(rig: &Rig, plan: &Plan) -> Result<Reduction, Failure> {
    let mut log = Log::default();
    let outcome = run(rig, plan, &mut log);
    match outcome {
        Some((draft, report)) if log.0.is_empty() => {
            let model = model_file(&draft);
            // What comes out is a sound model file, or the plan asks for something that is none.
            let path = format!("{}.toml (reduced)", draft.name);
            modelmill_spec::load(&path, &model, &Memory::default())?;
            Ok(Reduction { model, report })
        }
        _ => {
            log.0.sort_by_key(|found| found.span.map(|span| span.start));
            Err(Failure {
                diagnostics: log.0,
                sources: plan.sources.clone(),
            })
        }
    }
}

fn run(rig: &Rig, plan: &Plan, log: &mut Log) -> Option<(Draft, Report)> {
    let entry = &plan.entry;
    let names = Names::new(rig, entry, log);
    let plane = Plane::new(entry.plane.at, entry.plane.normal, entry.plane.x);
    let samples = match Samples::new(rig, entry.samples.number, entry.samples.range) {
        Ok(samples) if samples.moments.len() >= 4 => samples,
        Ok(samples) => {
            let says = format!(
                "{} of {} sampled poses are out of the rig's reach; lower `range` in `[samples]`",
                samples.n_out_of_reach, entry.samples.number
            );
            log.0.push(fault(None, says));
            return None;
        }
        Err(error) => {
            log.0
                .push(fault(None, format!("the rig does not stand: {error}")));
            return None;
        }
    };
    let mut work = Work {
        names,
        plane,
        samples,
        parts: Vec::new(),
        draft: Draft {
            name: entry.name.get_ref().clone(),
            title: entry.title.clone().unwrap_or_default(),
            origin: format!("Reduced from the rig {} by modelmill reduce.", rig.name),
            ..Draft::default()
        },
        report: Report::default(),
        used: Vec::new(),
        wholes: Vec::new(),
    };
    work.planar_reduction(log);
    if !log.0.is_empty() {
        return None;
    }
    work.parts(log);
    if !log.0.is_empty() {
        return None;
    }
    work.lumped_masses(log);
    work.check_equation_1();
    work.loops(log);
    work.drives(log);
    work.effects();
    work.nothing_is_forgotten(log);
    work.check_constants(log);
    let draft = work.draft;
    let mut report = work.report;
    for symbols in [
        &draft.masses,
        &draft.centres,
        &draft.inertias,
        &draft.constants,
    ] {
        symbols.report_ties(&mut report);
    }
    Some((draft, report))
}

/// A reduction in the making.
pub(crate) struct Work<'a> {
    pub(crate) names: Names<'a>,
    pub(crate) plane: Plane,
    pub(crate) samples: Samples,
    pub(crate) parts: Vec<Part>,
    pub(crate) draft: Draft,
    pub(crate) report: Report,
    /// Groups that have a place in the model.
    pub(crate) used: Vec<String>,
    /// What each part of the draft stands for, in words and exactly.
    pub(crate) wholes: Vec<(String, Flat)>,
}

impl Work<'_> {
    /// Step 1.
    fn planar_reduction(&mut self, log: &mut Log) {
        let rig = self.names.rig;
        let out = out_of_plane(&self.plane, &self.samples);
        if out.is_nan() || out > TOLERANCE {
            log.0.push(fault(
                None,
                format!(
                    "bodies leave the plane at up to {} m/s or rad/s; give the plane of motion in `[plane]`, or model \
                     this rig in space",
                    digits(out, 3)
                ),
            ));
        }
        let reach = match self.samples.n_out_of_reach {
            0 => String::new(),
            n => format!(" ({n} more are out of reach)"),
        };
        let poses = self.samples.moments.len();
        self.report.add(
            1,
            "motion",
            format!("all bodies stay in the plane at {poses} sampled poses{reach}"),
            vec![Size::new("largest rate out of it", out, "m/s or rad/s")],
        );
        let across = self.plane.normal.dot(&rig.gravity);
        let flat = self.plane.flat(&rig.gravity);
        self.report.add(
            1,
            "gravity",
            "acts in the plane",
            vec![Size::new("across it", across, "m/s^2")],
        );
        self.draft.gravity = match (flat.x.abs() > ZERO, flat.y.abs() > ZERO) {
            (false, false) => ["0", "0"].map(str::to_owned),
            (true, true) => [("gx", flat.x), ("gy", flat.y)]
                .map(|(name, value)| self.gravity_constant(name, value)),
            (true, false) => [
                signed(self.gravity_constant("g", flat.x.abs()), flat.x),
                "0".to_owned(),
            ],
            (false, true) => [
                "0".to_owned(),
                signed(self.gravity_constant("g", flat.y.abs()), flat.y),
            ],
        };
        for (name, bodies) in &self.names.groups {
            check_group(
                rig,
                name,
                bodies,
                &self.plane,
                &self.samples,
                &mut self.report,
            );
        }
    }

    fn gravity_constant(&mut self, name: &str, value: f64) -> String {
        self.draft
            .constants
            .stand_for(name, "m/s^2", "acceleration of gravity", "gravity", value);
        name.to_owned()
    }
}

fn signed(name: String, value: f64) -> String {
    if value < 0.0 {
        format!("-{name}")
    } else {
        name
    }
}
