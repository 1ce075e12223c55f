//! Two variants along the same motions, held against closed forms, against forces that are evaluated otherwise, and against
//! conservation of energy.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use modelmill::print::RustWording;
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::variants::{DriveVariants, LimitCrossing, VariantComparison};
use modelmill::{Model, NoteSeverity, along};

/// Two links in a vertical plane with a tool at the end of the second.
const ARM: &str = r#"
schema = 1
name = "arm"
gravity = [0, "-g", 0]
retain = ["ZZ1", "MX1", "ZZ2", "MX2"]
[constants]
LA = { value = 0.6, unit = "m" }
LB = { value = 0.8, unit = "m" }
g = { value = 9.81, unit = "m/s^2" }
[parameters]
mP = { nominal = 5.0, unit = "kg" }
[coordinates]
q1 = { nominal = 0.4 }
q2 = { nominal = 0.8 }
[limits.coordinates]
q1 = { position = [-3, 3], rate = 9 }
[limits.drives]
shoulder = { force = 450 }
boom = { force = 100 }
[[frame]]
name = "upper"
on = "base"
modified_dh = { theta = "q1" }
[[frame]]
name = "fore"
on = "upper"
modified_dh = { a = "LA", theta = "q2" }
[[part]]
on = "upper"
linear = { planar = 1, nominal = { ZZ = 0.35, MX = 1.05, M = 4.2 } }
[[part]]
on = "fore"
linear = { planar = 2, nominal = { ZZ = 0.12, MX = 0.42, M = 2.1 } }
[[lumped_mass]]
name = "tool"
mass = "mP"
on = "fore"
at = ["LB", 0]
[[drive]]
name = "shoulder"
joint = "q1"
[[drive]]
name = "boom"
joint = "q2"
"#;
const LENGTHS: [f64; 2] = [0.6, 0.8];
const G: f64 = 9.81;
/// Samples of a period, and their distance, s.
const SAMPLES: usize = 400;
const STEP: f64 = 0.01;

/// Angle, rate and acceleration of a joint that swings `times` in the period.
fn swing(middle: f64, size: f64, times: f64, k: usize) -> [f64; 3] {
    let rate = TAU * times / (SAMPLES as f64 * STEP);
    let (sin, cos) = (rate * STEP * k as f64).sin_cos();
    [middle + size * sin, size * rate * cos, -size * rate * rate * sin]
}

fn states(k: usize) -> [[f64; 3]; 2] {
    [swing(0.4, 0.7, 1.0, k), swing(0.8, -0.5, 2.0, k)]
}

/// A file with one whole period of the motion, its end included; `forces` are columns besides.
fn recording(name: &str, forces: &[(&str, Vec<f64>)]) -> PathBuf {
    let mut text = "t,q1,q1_d,q1_dd,q2,q2_d,q2_dd".to_owned();
    for (name, _) in forces {
        let _ = write!(text, ",{name}");
    }
    for k in 0..=SAMPLES {
        let _ = write!(text, "\n{}", STEP * k as f64);
        for value in states(k).iter().flatten() {
            let _ = write!(text, ",{value:e}");
        }
        for (_, values) in forces {
            let _ = write!(text, ",{:e}", values[k]);
        }
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("variants-{name}.csv"));
    std::fs::write(&file, text + "\n").expect("a recording");
    file
}

fn arm(changes: &[(&str, &str)]) -> Model {
    let mut text = ARM.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Model::from_text("arm.toml", &text).unwrap_or_else(|error| panic!("{error}"))
}

/// Both models along a file, each as it reads it.
fn along(before: &Model, after: &Model, file: &Path) -> VariantComparison {
    let read = |model: &Model| {
        model
            .recording(file, &RecordingOptions::default())
            .expect("a recording")
    };
    let (first, second): (PreparedRecording, PreparedRecording) = (read(before), read(after));
    VariantComparison::along_recordings([before, after], [&[&first], &[&second]]).expect("both along the motion")
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance * expected.abs().max(1e-300),
        "{found} for {expected}"
    );
}

/// Shares of products, and of the summands of each, add up.
#[track_caller]
fn shares_add_up(drive: &DriveVariants) {
    let all: f64 = drive.products.iter().map(|one| one.share).sum();
    assert!((all - 1.0).abs() < 1e-8, "{}: {all}", drive.drive);
    for one in &drive.products {
        let terms: f64 = one.terms.iter().map(|term| term.share).sum();
        assert!((terms - one.share).abs() < 1e-9 * one.share.abs().max(1.0));
    }
}

/// Forces that a point mass at the tool asks for: `m J' (a - g)`.
fn of_tool(mass: f64, k: usize) -> [f64; 2] {
    let [[q1, v1, a1], [q2, v2, a2]] = states(k);
    let [la, lb] = LENGTHS;
    let (sin1, cos1) = q1.sin_cos();
    let (sin, cos) = (q1 + q2).sin_cos();
    let (v, a) = (v1 + v2, a1 + a2);
    let ax = -la * (a1 * sin1 + v1 * v1 * cos1) - lb * (a * sin + v * v * cos);
    let ay = la * (a1 * cos1 - v1 * v1 * sin1) + lb * (a * cos - v * v * sin) + G;
    let fore = lb * (ay * cos - ax * sin);
    [mass * (la * (ay * cos1 - ax * sin1) + fore), mass * fore]
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn a_heavier_tool_costs_what_its_closed_form_says() {
    let (before, after) = (arm(&[]), arm(&[("nominal = 5.0", "nominal = 45.0")]));
    let found = along(&before, &after, &recording("tool", &[]));
    assert_eq!((found.samples, found.drives.len()), (SAMPLES + 1, 2));
    close(found.seconds, SAMPLES as f64 * STEP, 1e-12);
    for (d, drive) in found.drives.iter().enumerate() {
        let expected: Vec<f64> = (0..=SAMPLES).map(|k| of_tool(40.0, k)[d]).collect();
        let peak = expected.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        close(drive.difference.rms, rms(&expected), 1e-9);
        close(drive.difference.peak, peak, 1e-9);
        // One product makes it all, by its value alone: geometry is the same.
        shares_add_up(drive);
        let names: Vec<&str> = drive.products.iter().map(|one| one.product.as_str()).collect();
        assert_eq!(names, ["mP"]);
        for term in &drive.products[0].terms {
            close(term.by_value, term.share, 1e-9);
        }
    }
    // The summands by their readable names: at the boom what the tool adds to the first moment and to the inertia.
    let terms = &found.drives[1].products[0].terms;
    let mut names: Vec<&str> = terms.iter().map(|term| term.term.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["LB*mP", "LB^2*mP"]);
    let moment = terms.iter().find(|term| term.term == "LB*mP").expect("it is there");
    assert_eq!((moment.retained.as_str(), moment.unit.as_str()), ("MX2", "kg m"));
    close(moment.before.expect("a value"), 4.0, 1e-12);
    close(moment.after.expect("a value"), 36.0, 1e-12);
}

/// The share of a summand is the projection of what it does by itself: forces with that summand alone changed.
#[test]
fn a_share_is_what_the_summand_alone_projects_on_the_difference() {
    let (before, after) = (
        arm(&[]),
        arm(&[("nominal = 5.0", "nominal = 45.0"), ("MX = 0.42", "MX = 0.9")]),
    );
    let file = recording("projection", &[]);
    let found = along(&before, &after, &file);
    let states = &before
        .recording(&file, &RecordingOptions::default())
        .expect("a recording")
        .segments[0];
    let forces = |values: &[f64]| along::forces(&before, states, values).expect("forces");
    let first = forces(&before.values);
    let last = forces(&after.values);
    let mut seen = 0;
    for (d, drive) in found.drives.iter().enumerate() {
        shares_add_up(drive);
        let whole: Vec<f64> = last[d].iter().zip(&first[d]).map(|(b, a)| b - a).collect();
        let squares: f64 = whole.iter().map(|x| x * x).sum();
        for term in drive.products.iter().flat_map(|one| &one.terms) {
            let k = before
                .base
                .iter()
                .position(|b| b.retained == term.retained)
                .expect("a base parameter");
            let mut values = before.values.clone();
            values[k] += term.after.expect("a value") - term.before.expect("a value");
            let part = forces(&values);
            let inner = part[d].iter().zip(&first[d]).zip(&whole).map(|((b, a), r)| (b - a) * r);
            close(term.share, inner.sum::<f64>() / squares, 1e-7);
            seen += 1;
        }
    }
    assert!(seen >= 6, "{seen} summands");
}

/// Figures are those of forces that `evaluate` gives, and of rates that are recorded.
#[test]
fn figures_are_those_of_evaluated_forces() {
    let (before, after) = (
        arm(&[]),
        arm(&[("ZZ = 0.35", "ZZ = 3.5"), ("LA = { value = 0.6", "LA = { value = 0.7")]),
    );
    let file = recording("figures", &[]);
    let found = along(&before, &after, &file);
    for (model, pick) in [
        (&before, (|one: &DriveVariants| one.before) as fn(&DriveVariants) -> _),
        (&after, |one: &DriveVariants| one.after),
    ] {
        let forces = model
            .evaluate(&file, &RecordingOptions::default(), &model.values)
            .expect("forces");
        for (d, (drive, force)) in forces.columns.iter().enumerate() {
            assert_eq!(&found.drives[d].drive, drive);
            let effort: modelmill::variants::DriveEffort = pick(&found.drives[d]);
            let power: Vec<f64> = (0..=SAMPLES).map(|k| force[k] * states(k)[d][1]).collect();
            let largest = |all: &[f64]| all.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            close(effort.peak, largest(force), 1e-9);
            close(effort.rms, rms(force), 1e-9);
            close(effort.peak_power, largest(&power), 1e-9);
            close(effort.rms_power, rms(&power), 1e-9);
            let net: f64 = power.windows(2).map(|p| 0.5 * STEP * (p[0] + p[1])).sum();
            assert!((effort.net_work - net).abs() < 1e-9 * effort.work);
            assert!(effort.work >= effort.net_work);
        }
    }
    for drive in &found.drives {
        shares_add_up(drive);
        // Another length changes columns too.
        let terms = drive.products.iter().flat_map(|one| &one.terms);
        let of_columns: f64 = terms.map(|term| (term.share - term.by_value).abs()).sum();
        assert!(of_columns > 1e-3, "{of_columns}");
    }
    let json = found.json(&RustWording);
    let first = &json["drives"][0];
    assert_eq!(first["after"]["peak"].as_f64(), Some(found.drives[0].after.peak));
    assert_eq!(
        first["difference"]["rms"].as_f64(),
        Some(found.drives[0].difference.rms)
    );
}

/// A machine without friction gets back all the work that it was given, once it is where it began; one with friction keeps some.
#[test]
fn a_closed_motion_takes_no_net_work_without_friction() {
    let friction =
        "\n[[effect]]\nkind = \"viscous_friction\"\nat = [\"boom\"]\nparameters = { Fv = { nominal = 2.5 } }\n";
    let before = arm(&[]);
    let after = Model::from_text("worn.toml", &format!("{ARM}{friction}")).expect("a model");
    let found = along(&before, &after, &recording("energy", &[]));
    let sum = |pick: fn(&DriveVariants) -> f64| found.drives.iter().map(pick).sum::<f64>();
    let work = sum(|one| one.before.work);
    assert!(work > 10.0 && sum(|one| one.before.net_work).abs() < 1e-9 * work);
    // Fv times the integral of the squared rate, (size rate)^2 / 2 in the mean.
    let rate = 0.5 * TAU * 2.0 / (SAMPLES as f64 * STEP);
    let lost = 2.5 * 0.5 * rate * rate * SAMPLES as f64 * STEP;
    close(sum(|one| one.after.net_work), lost, 1e-9);
    // The shoulder does not feel it; the boom's difference is that effect, which is new.
    assert!(found.drives[0].products.is_empty());
    shares_add_up(&found.drives[1]);
    let term = &found.drives[1].products[0].terms[0];
    assert_eq!((term.before, term.after), (None, Some(2.5)));
}

#[test]
fn limits_tell_what_the_variant_exceeds() {
    let (before, after) = (arm(&[]), arm(&[("nominal = 5.0", "nominal = 45.0")]));
    let found = along(&before, &after, &recording("limits", &[]));
    let of = |name: &str| {
        let mut limits = found.limits.iter();
        limits.find(|one| one.limit == name).unwrap_or_else(|| panic!("{name}"))
    };
    assert_eq!(found.limits.len(), 4);
    assert_eq!(of("shoulder").crossing(), LimitCrossing::NowExceeded);
    assert_eq!(of("boom").crossing(), LimitCrossing::NowExceeded);
    close(
        of("boom").used[1].expect("a limit"),
        found.drives[1].after.peak / 100.0,
        1e-12,
    );
    close(of("q1").used[0].expect("a limit"), 1.1 / 3.0, 1e-9);
    assert_eq!(of("q1_d").crossing(), LimitCrossing::Kept);
    // Each model has the limits of its own file.
    let strong = arm(&[
        ("nominal = 5.0", "nominal = 45.0"),
        ("force = 450", "force = 4500"),
        ("boom = { force = 100 }", ""),
    ]);
    let found = along(&after, &strong, &recording("limits", &[]));
    let of = |name: &str| found.limits.iter().find(|one| one.limit == name).expect("a limit");
    assert_eq!(of("shoulder").crossing(), LimitCrossing::NoLongerExceeded);
    assert_eq!(of("boom").crossing(), LimitCrossing::NoLongerExceeded);
    assert_eq!((of("boom").used[1], of("boom").ranges[1]), (None, None));
}

/// Retained columns, points, passive coordinates and singular poses of a mechanism with a loop; errors as `compare` gives them.
#[test]
fn other_columns_are_told_apart_and_errors_are_those_of_compare() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let open = |name: &str| Model::open(root.join("model-spec/models").join(name)).expect("a model");
    let (before, after) = (open("spidermill.toml"), open("spidermill-paper.toml"));
    let file = root.join("recordings/spidermill-mbs/with-rods-check.csv");
    let found = along(&before, &after, &file);
    assert_eq!(found.drives.len(), 2);
    for drive in &found.drives {
        shares_add_up(drive);
        assert!(drive.difference.rms > 0.0);
    }
    let singular = found.limits.iter().filter(|one| one.limit.starts_with("singularity"));
    assert!(singular.clone().all(|one| one.used.iter().all(Option::is_some)) && singular.count() == 2);
    for (model, errors) in [&before, &after].into_iter().zip(&found.errors) {
        let run = model
            .recording(&file, &RecordingOptions::default())
            .expect("a recording");
        let compared = model.compare(&[&run], &model.values).expect("figures");
        assert_eq!(errors.as_ref(), Some(&compared.figures));
    }
    // Another length: every column of the loop moves, and shares still add up.
    let longer = before.text().replace("d1 = { value = 1.13", "d1 = { value = 1.14");
    let longer = Model::from_text("longer.toml", &longer).expect("a model");
    for drive in &along(&before, &longer, &file).drives {
        shares_add_up(drive);
    }
    // A model beside itself makes no difference.
    let same = along(&before, &before.clone(), &file);
    for drive in &same.drives {
        assert_eq!((drive.before, drive.difference.peak), (drive.after, 0.0));
        assert!(drive.products.is_empty());
    }
}

/// What nobody measured is made of the model itself: friction by load, with the force that the drive has without it.
#[test]
fn effects_by_load_need_no_recorded_forces() {
    let friction = "\n[[effect]]\nkind = \"load_friction\"\nat = [\"boom\"]\nparameters = { mu = { nominal = 0.1 } }\n";
    let before = arm(&[]);
    let after = Model::from_text("worn.toml", &format!("{ARM}{friction}")).expect("a model");
    let found = along(&before, &after, &recording("load", &[]));
    // A tenth of the force itself, whichever way it moves; only at rest there is none.
    close(found.drives[1].difference.peak, 0.1 * found.drives[1].before.peak, 0.02);
    assert!(
        found
            .notes
            .iter()
            .any(|note| note.says.in_library_words().contains("load_friction"))
    );
    assert!(found.errors.iter().all(Option::is_none));
}

#[test]
fn coordinates_may_stand_in_another_order() {
    let before = arm(&[]);
    let turned = arm(&[(
        "q1 = { nominal = 0.4 }\nq2 = { nominal = 0.8 }",
        "q2 = { nominal = 0.8 }\nq1 = { nominal = 0.4 }",
    )]);
    assert_ne!(before.active_coordinates(), turned.active_coordinates());
    for drive in &along(&before, &turned, &recording("order", &[])).drives {
        assert!(drive.difference.rms < 1e-12 * drive.before.rms, "{}", drive.drive);
    }
}

#[test]
fn what_has_no_counterpart_is_said() {
    let before = arm(&[]);
    let says = |after: &Model| match VariantComparison::check([&before, after]) {
        Err(error) => error.to_string(),
        Ok(()) => panic!("{} is no counterpart", after.path),
    };
    let other = arm(&[("q2", "elbow")]);
    let said = says(&other);
    assert!(
        said.contains("no active coordinate q2") && said.contains("same names"),
        "{said}"
    );
    let unnamed = arm(&[
        ("name = \"shoulder\"", "name = \"a\""),
        ("name = \"boom\"", "name = \"b\""),
        ("shoulder =", "a ="),
        ("boom =", "b ="),
    ]);
    assert!(says(&unnamed).contains("no drive in common"), "{}", says(&unnamed));
    // One drive by another name is left out, with a word.
    let one = arm(&[("name = \"boom\"", "name = \"elbow\""), ("boom =", "elbow =")]);
    let found = along(&before, &one, &recording("names", &[]));
    assert_eq!(found.drives.len(), 1);
    let warned: Vec<String> = (found.notes.iter())
        .filter(|note| note.severity == NoteSeverity::Warning)
        .map(|note| note.says.in_library_words())
        .filter(|says| says.starts_with("Left out"))
        .collect();
    assert!(
        warned.len() == 2 && warned[0].contains("boom") && warned[1].contains("elbow"),
        "{warned:?}"
    );
}

/// What nothing drives has no power: it is left out, with a word.
#[test]
fn what_nothing_drives_is_left_out() {
    let loose = arm(&[
        ("q2 = { nominal = 0.8 }", "q2 = { nominal = 0.8, driven = false }"),
        ("[[drive]]\nname = \"boom\"\njoint = \"q2\"\n", ""),
        ("boom = { force = 100 }", ""),
    ]);
    let found = along(&arm(&[]), &loose, &recording("loose", &[]));
    assert_eq!(found.drives.len(), 1);
    assert_eq!(found.drives[0].drive, "shoulder");
    let found = along(&loose, &loose.clone(), &recording("loose", &[]));
    assert_eq!(found.drives.len(), 1);
    assert!(
        found
            .notes
            .iter()
            .any(|note| note.says.in_library_words().starts_with("No drive acts on on_q2")),
        "{:?}",
        found.notes
    );
}
