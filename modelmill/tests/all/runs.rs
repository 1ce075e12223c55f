//! `runs` on forces of models with a further body, other friction, another scale and another clock, along motions of their own,
//! with noise that has a memory: what changed is told as such, and nothing else.

use std::path::PathBuf;

use modelmill::Model;
use modelmill::print::RustWording;
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::runs::{
    ChangeEstimate, KnownLoad, PerRunSelection, PhysicalChange, RunChange, RunsComparison, RunsOptions, UnreadRun,
};

use crate::made::{Made, bundled, run};

/// What is told of a run against one to which nothing was done.
fn told(name: &str, seed: u64, made: Made) -> Vec<RunChange> {
    let model = Model::open(bundled(name)).expect("the model");
    let files = [run(name, seed, Made::Nothing), run(name, seed + 1, made)];
    let read = |file: &PathBuf| -> PreparedRecording {
        model
            .recording(file, &RecordingOptions::default())
            .expect("the recording")
    };
    let [before, later] = files.each_ref().map(read);
    let mut found = held(&model, &[&before, &later], &RunsOptions::default());
    assert!(found.runs[0].changes.is_empty());
    found.runs.remove(1).changes
}

fn held(model: &Model, recordings: &[&PreparedRecording], asked: &RunsOptions) -> RunsComparison {
    let recordings = recordings.iter().map(|one| Ok(*one));
    model.runs(recordings, asked).expect("an answer")
}

/// A value within five deviations of the truth and so many parts of it.
#[track_caller]
fn is_near(found: &ChangeEstimate, truth: f64, part: f64) {
    let off = (found.value - truth).abs();
    assert!(
        off < part * truth.abs() && off < 6.0 * found.std,
        "{found:?} is not {truth}"
    );
}

#[test]
fn nothing_is_told_where_nothing_changed() {
    for (k, name) in ["puma560", "scara", "five_bar", "spidermill"].iter().enumerate() {
        let found = told(name, 100 + 2 * k as u64, Made::Nothing);
        assert!(found.is_empty(), "{name}: {found:#?}");
    }
}

/// The body is part of the model file of the run, so that its forces go the way of all bodies.
#[test]
fn a_load_is_weighed_and_placed() {
    let part = "\n[[part]]\nname = \"tool\"\non = \"link6\"\nmass = 2.8\ncentre = [0.03, -0.02, 0.08]\n\
                inertia = { xx = 0.004, yy = 0.005, zz = 0.006 }\n";
    let found = told("puma560", 300, Made::Body(part));
    let [
        RunChange {
            change:
                PhysicalChange::Payload {
                    frame,
                    mass: Some(mass),
                    centre,
                },
            ..
        },
    ] = &found[..]
    else {
        panic!("{found:#?}");
    };
    assert_eq!(frame, "link6");
    is_near(mass, 2.8, 0.05);
    for (found, truth) in centre.iter().zip([0.03, -0.02, 0.08]) {
        let found = found.expect("a known place");
        assert!((found.value - truth).abs() < 0.01, "{found:?}");
    }
}

/// Bodies of a loop share what can be known of them, so that another one may be named beside the one that carries the load.
#[test]
fn a_load_in_a_loop_is_told_where_it_is() {
    let model = Model::open(bundled("five_bar")).expect("the model");
    let mechanism = &model.derivation.mechanism;
    let part = mechanism.parts.last().expect("a part");
    let last = mechanism.frames[part.frame.0].name.clone();
    let part = format!("\n[[part]]\nname = \"tool\"\non = \"{last}\"\nlinear = {{ MX = 0.5, MY = 0.2, ZZ = 0.3 }}\n");
    let found = told("five_bar", 400, Made::Body(&part));
    let [
        RunChange {
            change: PhysicalChange::Payload { frame, .. },
            rivals,
            ..
        },
    ] = &found[..]
    else {
        panic!("{found:#?}");
    };
    let named = rivals.iter().any(|rival| rival.contains(&last));
    assert!(*frame == last || named, "{found:#?}");
}

#[test]
fn drives_and_clocks_are_told_apart() {
    let found = told("scara", 500, Made::Friction(1, 0.6, 0.3));
    let [
        RunChange {
            change: PhysicalChange::Friction {
                drive, dry, viscous, ..
            },
            ..
        },
    ] = &found[..]
    else {
        panic!("{found:#?}");
    };
    assert_eq!(drive, "joint2");
    is_near(dry, 0.6, 0.1);
    is_near(viscous, 0.3, 0.1);

    let found = told("puma560", 600, Made::Scale(2, 1.05));
    let [
        RunChange {
            change: PhysicalChange::Scale { drive, factor },
            ..
        },
    ] = &found[..]
    else {
        panic!("{found:#?}");
    };
    let model = Model::open(bundled("puma560")).expect("the model");
    assert_eq!(*drive, model.row_names()[2]);
    is_near(factor, 1.05, 0.01);

    let found = told("puma560", 700, Made::Offset(1, 4.0));
    let [
        RunChange {
            change: PhysicalChange::Offset { drive, force },
            ..
        },
    ] = &found[..]
    else {
        panic!("{found:#?}");
    };
    assert_eq!(*drive, model.row_names()[1]);
    is_near(force, 4.0, 0.1);

    let found = told("puma560", 800, Made::Clock(1.02));
    let [
        RunChange {
            change: PhysicalChange::Clock { factor },
            ..
        },
    ] = &found[..]
    else {
        panic!("{found:#?}");
    };
    assert!((factor.value - 1.02).abs() < 0.003, "{factor:?}");
}

/// Between samples whose forces were lost stand straight lines, which say nothing of the machine.
#[test]
fn lost_forces_move_nothing() {
    let model = Model::open(bundled("puma560")).expect("the model");
    let reading = RecordingOptions {
        skip_bad_samples: true,
        ..RecordingOptions::default()
    };
    let files = [
        run("puma560", 1000, Made::Nothing),
        run("puma560", 1001, Made::Lost(1, 600, 1100)),
    ];
    let read = |file: &PathBuf| model.recording(file, &reading).expect("the recording");
    let [before, later] = files.each_ref().map(read);
    let found = held(&model, &[&before, &later], &RunsOptions::default());
    assert!(found.runs[1].changes.is_empty(), "{:#?}", found.runs[1]);
    assert!(found.runs[1].moved.is_empty(), "{:?}", found.runs[1].moved);
}

#[test]
fn one_run_alone_is_refused() {
    let model = Model::open(bundled("scara")).expect("the model");
    let file = run("scara", 900, Made::Nothing);
    let one = model
        .recording(&file, &RecordingOptions::default())
        .expect("the recording");
    let runs = |all: Vec<Result<&PreparedRecording, UnreadRun>>| model.runs(all, &RunsOptions::default());
    let error = runs(vec![Ok(&one)]).err().expect("a refusal");
    assert!(error.to_string().contains("two or more"), "{error}");
    // A run that cannot be read is no reason to fail, unless nothing is left.
    let unread = || {
        let missing = model.recording("nowhere.csv", &RecordingOptions::default());
        let error = missing.err().expect("a refusal");
        let file = "nowhere.csv".to_owned();
        Err(UnreadRun { file, error })
    };
    let error = runs(vec![Ok(&one), unread()]).err().expect("a refusal");
    assert!(error.to_string().contains("nowhere.csv"), "{error}");
    let found = runs(vec![Ok(&one), unread(), Ok(&one)]).expect("an answer");
    assert_eq!((found.runs.len(), found.unread.len()), (2, 1));
    assert_eq!(found.json(&RustWording)["unread"][0]["file"], "nowhere.csv");
}

const TOOL: &str = "\n[[part]]\nname = \"tool\"\non = \"link6\"\nmass = 2.8\ncentre = [0.03, -0.02, 0.08]\n\
                    inertia = { xx = 0.004, yy = 0.005, zz = 0.006 }\n";

/// A push is an interval of time on some drives, and no load.
#[test]
fn a_push_is_told_with_its_times() {
    let found = told("puma560", 1200, Made::Bump(&[1, 2], 900, 1000, 0.8));
    let [
        RunChange {
            change:
                PhysicalChange::ContactEvent {
                    drives,
                    interval: [from, to],
                },
            ..
        },
    ] = &found[..]
    else {
        panic!("{found:#?}");
    };
    assert!((from - 9.0).abs() < 0.3 && (to - 10.0).abs() < 0.3, "{found:#?}");
    let model = Model::open(bundled("puma560")).expect("the model");
    let names = model.row_names();
    assert!(
        drives.iter().all(|(drive, _)| [&names[1], &names[2]].contains(&drive)),
        "{drives:?}"
    );
}

/// In one fit of all runs each has its own load and its own friction.
#[test]
fn what_is_each_runs_own_is_told_in_one_fit() {
    let model = Model::open(bundled("puma560")).expect("the model");
    let files = [
        run("puma560", 1300, Made::Nothing),
        run("puma560", 1301, Made::Body(TOOL)),
        run("puma560", 1302, Made::BodyAndFriction(TOOL, 3, 0.9, 0.4)),
    ];
    let read = |file: &PathBuf| {
        model
            .recording(file, &RecordingOptions::default())
            .expect("the recording")
    };
    let [a, b, c] = files.each_ref().map(read);
    let drive = &model.row_names()[3];
    let parse = |text: &str| PerRunSelection::parse(text).expect("a place");
    let asked = RunsOptions {
        per_run: vec![parse("payload@link6"), parse(&format!("friction@{drive}"))],
        loads: Vec::new(),
    };
    let found = held(&model, &[&a, &b, &c], &asked);
    let fit = found.shared.as_ref().expect("a fit");
    let own = |run: usize, name: &str| {
        let mut values = fit.runs[run].1.iter();
        let value = values.find(|one| one.name == name).expect("a value").value;
        let std = value.std.expect("a standard deviation");
        ChangeEstimate {
            value: value.value,
            std,
        }
    };
    for run in [1, 2] {
        is_near(&own(run, "mass"), 2.8, 0.05);
        for (axis, truth) in [("x", 0.03), ("y", -0.02), ("z", 0.08)] {
            let at = own(run, axis);
            assert!((at.value - truth).abs() < (6.0 * at.std).min(0.01), "{axis}: {at:?}");
        }
    }
    let more = |name: &str| {
        let [before, now] = [own(1, name), own(2, name)];
        let std = before.std.hypot(now.std);
        ChangeEstimate {
            value: now.value - before.value,
            std,
        }
    };
    is_near(&more("Fc"), 0.9, 0.2);
    is_near(&more("Fv"), 0.4, 0.2);
    let asked = RunsOptions {
        per_run: vec![parse("payload@nowhere")],
        loads: Vec::new(),
    };
    let error = model.runs([Ok(&a), Ok(&b)], &asked).err().expect("a refusal");
    assert!(error.to_string().contains("link6"), "{error}");
}

/// One run with a load of known mass tells by how much every measured force is off.
#[test]
fn a_known_load_tells_the_scales_of_all_forces() {
    let model = Model::open(bundled("puma560")).expect("the model");
    let scales = [1.1, 0.9, 1.25, 0.8, 1.05, 0.95];
    let files = [
        run("puma560", 1400, Made::BodyAndScales("", &scales)),
        run("puma560", 1401, Made::BodyAndScales(TOOL, &scales)),
    ];
    let read = |file: &PathBuf| {
        model
            .recording(file, &RecordingOptions::default())
            .expect("the recording")
    };
    let [bare, loaded] = files.each_ref().map(read);
    let load = |text: &str| RunsOptions {
        per_run: Vec::new(),
        loads: vec![KnownLoad::parse(text).expect("a load")],
    };
    let found = held(&model, &[&bare, &loaded], &load("runs-puma560-1401.csv=2.8@link6"));
    let fit = found.shared.expect("a fit");
    for ((drive, gain), scale) in fit.gains.iter().zip(scales) {
        let std = gain.std.expect("a standard deviation");
        let off = (gain.value - 1.0 / scale).abs();
        assert!(off < 5.0 * std && off < 0.05, "{drive}: {gain:?} is not 1/{scale}");
    }
    let error = model.runs([Ok(&bare), Ok(&loaded)], &load("other.csv=2.8@link6"));
    let error = error.err().expect("a refusal").to_string();
    assert!(error.contains("runs-puma560-1401.csv"), "{error}");
}

/// Friction that rises at one run and stays is told from that run on; a run that is different by itself is no lasting change.
#[test]
fn what_changed_and_stayed_is_told_with_its_run() {
    let model = Model::open(bundled("emps")).expect("the model");
    let made = |k: u64| match k {
        4 => Made::Scale(0, 1.1),
        7.. => Made::Friction(0, 5.0, 30.0),
        _ => Made::Nothing,
    };
    let recordings = (0..12).map(|k| {
        let file = run("emps", 1500 + k, made(k));
        Ok(model
            .recording(file, &RecordingOptions::default())
            .expect("the recording"))
    });
    let found = model.runs(recordings, &RunsOptions::default()).expect("an answer");
    let [point] = &found.points[..] else {
        panic!("{:#?}", found.points);
    };
    assert_eq!(point.run, 7);
    let [
        RunChange {
            change: PhysicalChange::Friction { drive, dry, .. },
            ..
        },
    ] = &point.changes[..]
    else {
        panic!("{:#?}", point.changes);
    };
    assert_eq!(*drive, model.row_names()[0]);
    is_near(dry, 5.0, 0.2);
    let page = modelmill::report::runs_page(&found, &RustWording);
    assert!(
        page.contains("From run 8 on") && page.contains("friction of"),
        "{}",
        page.len()
    );
    // The scaled run moves parameters that return: these are not among those without a change.
    let lasting: Vec<usize> = point.steps.iter().map(|step| step.parameter).collect();
    let single: Vec<usize> = (found.runs[4].moved.iter().copied())
        .filter(|k| !lasting.contains(k))
        .collect();
    assert!(!single.is_empty(), "{:?} {lasting:?}", found.runs[4].moved);
    let folded = page
        .split_once("without a detected change")
        .map_or("", |(_, after)| after);
    for k in single {
        let heading = format!("<figcaption><b>{}</b>", found.parameters[k].name);
        assert!(page.contains(&heading) && !folded.contains(&heading), "{heading}");
    }
}
