//! Verdicts of `runs` on recordings with planted values: right at any number of rows, no change where nothing changed,
//! and "cannot tell" where the forces show nothing.

use modelmill::Model;
use modelmill::print::RustWording;
use modelmill::recording::PreparedRecording;
use modelmill::runs::{KnownLoad, PhysicalChange, RunReport, RunVerdict, RunsComparison, RunsOptions};
use modelmill::text::TerminalStyle;

use crate::run_plans::{PlannedMotion, RunPlan, arm_with_friction};

fn compare_runs(model: &Model, recordings: &[&PreparedRecording], options: &RunsOptions) -> RunsComparison {
    let recordings = recordings.iter().map(|one| Ok(*one));
    model.runs(recordings, options).expect("a comparison")
}

/// The report of the second of two runs.
fn report(model: &Model, recordings: [&PreparedRecording; 2]) -> RunReport {
    compare_runs(model, &recordings, &RunsOptions::default()).runs.remove(1)
}

/// The only change, which is a load: its mass with the standard deviation.
#[track_caller]
fn only_load(report: &RunReport) -> [f64; 2] {
    let [change] = &report.changes[..] else {
        panic!("{report:#?}");
    };
    let PhysicalChange::Payload { mass: Some(mass), .. } = &change.change else {
        panic!("{change:#?}");
    };
    assert_eq!(report.verdict(), RunVerdict::Changed);
    [mass.value, mass.std]
}

fn tool(frame: &str, mass: f64) -> String {
    let inertia = 0.002 * mass;
    format!(
        "\n[[part]]\nname = \"tool\"\non = \"{frame}\"\nmass = {mass}\ncentre = [0.03, -0.02, 0.08]\n\
         inertia = {{ xx = {inertia}, yy = {inertia}, zz = {inertia} }}\n"
    )
}

/// A run of at most 256 rows once lay in one block: nothing remained when it was left out, so that nothing was ever
/// reported.
#[test]
fn a_load_is_weighed_at_any_number_of_rows() {
    let model = arm_with_friction("scara", "");
    for (k, (decimate, mass)) in [(20, 2.0), (8, 0.5), (7, 1.0), (2, 0.5)].into_iter().enumerate() {
        let seed = 10 * k as u64;
        let plan = |seed: u64| RunPlan {
            decimate,
            ..RunPlan::new(seed)
        };
        let loaded = arm_with_friction("scara", &tool("link4", mass));
        let first = plan(seed).record(&model, &model);
        let found = report(&model, [&first, &plan(seed + 1).record(&model, &loaded)]);
        let [value, std] = only_load(&found);
        let off = (value - mass).abs();
        assert!(off < 0.1 * mass && off < 5.0 * std, "1 in {decimate}: {value} +- {std}");
        let found = report(&model, [&first, &plan(seed + 2).record(&model, &model)]);
        assert_eq!(found.verdict(), RunVerdict::Unchanged, "1 in {decimate}: {found:#?}");
    }
}

/// Friction takes any value in pauses and about reversals, which once looked like another friction.
#[test]
fn slow_motions_with_the_same_friction_show_no_change() {
    let model = arm_with_friction("scara", "");
    for seed in 0..10 {
        let plan = |seed: u64, motion: PlannedMotion| {
            let plan = RunPlan {
                motion,
                decimate: if seed.is_multiple_of(3) { 4 } else { 8 },
                ..RunPlan::new(seed)
            };
            plan.record(&model, &model)
        };
        let slow = if seed % 2 == 0 {
            PlannedMotion::Pauses(0.5)
        } else {
            PlannedMotion::Waves(0.25)
        };
        let first = plan(100 + 2 * seed, PlannedMotion::Waves(0.8));
        let found = report(&model, [&first, &plan(101 + 2 * seed, slow)]);
        let is_event = |change: &PhysicalChange| matches!(change, PhysicalChange::ContactEvent { .. });
        assert!(
            found.changes.iter().all(|one| is_event(&one.change)),
            "{seed}: {:#?}",
            found.changes
        );
        assert!(found.moved.is_empty(), "{seed}: {:#?}", found.moved);
    }
}

/// Recorded rates do not scale with the clock: taken for derivatives of positions, they gave half of the error.
#[test]
fn a_clock_is_found_where_rates_are_recorded() {
    let model = arm_with_friction("scara", "");
    for (seed, clock) in [(200, 1.02), (210, 0.99)] {
        let plan = |seed: u64, clock: f64| RunPlan {
            clock,
            has_rates: true,
            ..RunPlan::new(seed)
        };
        let first = plan(seed, 1.0).record(&model, &model);
        let found = report(&model, [&first, &plan(seed + 1, clock).record(&model, &model)]);
        let [change] = &found.changes[..] else {
            panic!("{:#?}", found.changes);
        };
        let PhysicalChange::Clock { factor } = &change.change else {
            panic!("{change:#?}");
        };
        let off = (factor.value - clock).abs();
        assert!(off < 1e-3 && off < 5.0 * factor.std, "{clock}: {factor:?}");
        // A load beside it is weighed with the true clock.
        let loaded = arm_with_friction("scara", &tool("link4", 1.5));
        let found = report(&model, [&first, &plan(seed + 2, clock).record(&model, &loaded)]);
        let masses = found.changes.iter().filter_map(|one| match &one.change {
            PhysicalChange::Payload { mass, .. } => *mass,
            _ => None,
        });
        let masses: Vec<f64> = masses.map(|mass| mass.value).collect();
        assert!(
            matches!(masses[..], [mass] if (mass - 1.5).abs() < 0.1),
            "{:#?}",
            found.changes
        );
    }
}

/// Noise is no error of the model, even if it is a large part of the forces: a load that explains less than it is named.
#[test]
fn a_load_below_the_noise_is_named() {
    let model = arm_with_friction("scara", "");
    let loaded = arm_with_friction("scara", &tool("link4", 0.3));
    let noisy = |seed: u64| RunPlan {
        noise: 0.5,
        decimate: 2,
        samples: 20_000,
        ..RunPlan::new(seed)
    };
    for seed in [500, 510] {
        let first = noisy(seed).record(&model, &model);
        let found = report(&model, [&first, &noisy(seed + 1).record(&model, &loaded)]);
        let is_load = |one: &modelmill::runs::RunChange| matches!(one.change, PhysicalChange::Payload { .. });
        assert!(found.changes.iter().any(is_load), "{seed}: {found:#?}");
        assert!(!found.has_rejected_changes, "{seed}: {found:#?}");
    }
}

/// Forces that the model does not explain, and drives that stand, show nothing.
#[test]
fn runs_that_show_nothing_are_no_proof_of_no_change() {
    let model = arm_with_friction("scara", "");
    let noisy = |seed: u64| RunPlan {
        noise: 3.0,
        decimate: 4,
        ..RunPlan::new(seed)
    };
    let recordings = [300, 301].map(|seed| noisy(seed).record(&model, &model));
    let found = compare_runs(&model, &recordings.each_ref(), &RunsOptions::default());
    let second = &found.runs[1];
    assert_eq!(second.verdict(), RunVerdict::Undecided, "{second:#?}");
    assert!(second.moved.is_empty() && second.undecided.len() == 4, "{second:#?}");
    let text = found.text(TerminalStyle::PLAIN, &RustWording);
    assert!(
        text.contains("cannot show whether anything changed") && !text.contains("No change found"),
        "{text}"
    );
    assert_eq!(found.json(&RustWording)["runs"][1]["verdict"], "cannot_tell");

    let standing = |seed: u64| RunPlan {
        motion: PlannedMotion::Stands,
        decimate: 4,
        ..RunPlan::new(seed)
    };
    let recordings = [310, 311].map(|seed| standing(seed).record(&model, &model));
    let found = report(&model, recordings.each_ref());
    // Only the weight on the vertical axis can be compared.
    assert!(found.undecided.len() >= 3 && found.moved.is_empty(), "{found:#?}");
}

/// A load is weighed in units of the measured forces; a known load corrects it and adds its own uncertainty.
#[test]
fn a_known_load_corrects_other_loads() {
    let model = arm_with_friction("puma560", "");
    let record = |seed: u64, mass: f64| {
        let machine = match mass {
            0.0 => model.clone(),
            _ => arm_with_friction("puma560", &tool("link6", mass)),
        };
        let plan = RunPlan {
            decimate: 4,
            scales: vec![1.1; 6],
            ..RunPlan::new(seed)
        };
        plan.record(&model, &machine)
    };
    let [first, known, later] = [(400, 0.0), (401, 2.0), (402, 3.0)].map(|(seed, mass)| record(seed, mass));
    let [value, certain] = only_load(&report(&model, [&first, &later]));
    assert!((value - 3.3).abs() < 5.0 * certain, "{value} +- {certain}");
    let options = RunsOptions {
        per_run: Vec::new(),
        loads: vec![KnownLoad::parse("run-401 (table)=2.0@link6").expect("a load")],
    };
    let found = compare_runs(&model, &[&first, &known, &later], &options);
    let [value, std] = only_load(&found.runs[2]);
    assert!((value - 3.0).abs() < 5.0 * std, "{value} +- {std}");
    assert!(std > certain / 1.1, "{std} {certain}");
}

/// Runs with loads that nobody declared do not count as unloaded where a known load determines the factors of the forces.
/// The known load is declared on a frame that carries no body of its own.
#[test]
fn undeclared_loads_do_not_spoil_the_factors_of_forces() {
    let plate = "\n[[frame]]\nname = \"plate\"\non = \"link6\"\nmodified_dh = { d = \"0.1\" }\n";
    let model = arm_with_friction("puma560", plate);
    let record = |seed: u64, mass: f64| {
        let machine = match mass {
            0.0 => model.clone(),
            _ => arm_with_friction("puma560", &tool("link6", mass)),
        };
        let plan = RunPlan {
            decimate: 4,
            scales: vec![1.1; 6],
            ..RunPlan::new(seed)
        };
        plan.record(&model, &machine)
    };
    let runs = [(420, 0.0), (421, 2.0), (422, 3.0), (423, 3.0)].map(|(seed, mass)| record(seed, mass));
    let options = |text: &str| RunsOptions {
        per_run: Vec::new(),
        loads: vec![KnownLoad::parse(text).expect("a load")],
    };
    let all: Vec<&PreparedRecording> = runs.iter().collect();
    let found = compare_runs(&model, &all, &options("run-421 (table)=2.0@plate"));
    for report in &found.runs[2..] {
        let [value, std] = only_load(report);
        assert!((value - 3.0).abs() < (5.0 * std).min(0.3), "{value} +- {std}");
    }
    for (drive, gain) in &found.shared.expect("a fit").gains[..3] {
        assert!((gain.value - 1.0 / 1.1).abs() < 0.05, "{drive}: {gain:?}");
    }
    let error = model.runs(all.into_iter().map(Ok), &options("run-421 (table)=2.0@nowhere"));
    assert!(error.err().expect("a refusal").to_string().contains("link6"));
}
