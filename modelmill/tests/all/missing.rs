//! `diagnose` where an arm carries more than its model, where a length of the model or the direction of gravity is wrong, and where
//! a gear yields or an encoder has another zero. Forces are those of a model file that has the body or the length; errors of
//! encoders are put into the recorded positions.

use std::path::Path;

use modelmill::Model;
use modelmill::diagnose::{DiagnosisFindings, DiagnosisOptions, DiagnosisVerdict, FixedParameters, MissingEffect};
use modelmill::identify::EstimatorOptions;
use modelmill::recording::RecordingOptions;

use crate::made::{Made, bundled, run, run_of, with_part};

const ARM: &str = "puma560";

fn diagnosed(file: &Path, held: FixedParameters) -> DiagnosisFindings {
    let model = Model::open(bundled(ARM)).expect("the model");
    let recording = model
        .recording(file, &RecordingOptions::default())
        .expect("the recording");
    let question = DiagnosisOptions {
        fixed: held,
        repeat_with_nominal: false,
    };
    (model.diagnose(&[&recording], &[], &question)).expect("an answer")
}

/// The only effect that was found, at its place.
#[track_caller]
fn only<'a>(findings: &'a DiagnosisFindings, kind: &str, at: &str) -> &'a MissingEffect {
    let [found] = &findings.missing[..] else {
        panic!("{:#?}", findings.missing);
    };
    assert_eq!(
        (found.effect.kind.as_str(), &found.effect.at[..]),
        (kind, &[at.to_owned()][..])
    );
    found
}

#[track_caller]
fn near(found: &MissingEffect, name: &str, truth: f64, part: f64) {
    let estimate = found.estimates.iter().find(|one| one.name == name);
    let value = estimate.expect("an estimate").value;
    assert!(
        (value - truth).abs() < part * truth.abs(),
        "{name}: {value}, not {truth}"
    );
}

#[test]
fn a_load_on_the_flange_is_weighed_and_placed_while_the_base_is_held() {
    let part = "\n[[part]]\nname = \"tool\"\non = \"link6\"\nmass = 2.8\ncentre = [0.03, -0.02, 0.08]\n\
                inertia = { xx = 0.004, yy = 0.005, zz = 0.006 }\n";
    let file = run(ARM, 700, Made::Body(part));
    let findings = diagnosed(&file, FixedParameters::All);
    let found = only(&findings, "payload", "link6");
    near(found, "mass", 2.8, 0.05);
    near(found, "mz", 2.8 * 0.08, 0.1);
    // Beside free base parameters it is none of what may be missing.
    let free = diagnosed(&file, FixedParameters::Known);
    assert!(free.missing.is_empty(), "{:#?}", free.missing);
    let candidates = &free.diagnosis.candidates;
    assert!(candidates.iter().all(|one| one.effect.kind != "payload"));
}

#[test]
fn nothing_is_carried_where_nothing_was_added() {
    for seed in 710..713 {
        let file = run(ARM, seed, Made::Nothing);
        let findings = diagnosed(&file, FixedParameters::All);
        assert!(findings.missing.is_empty(), "{:#?}", findings.missing);
    }
}

#[test]
fn a_length_that_is_off_is_found_with_its_error() {
    let text = std::fs::read_to_string(bundled(ARM)).expect("a model");
    let longer = text.replacen("r4 = { value = 0.4331", "r4 = { value = 0.5331", 1);
    assert_ne!(text, longer);
    let truth = Model::from_text("longer", &longer).expect("the model");
    let file = run_of(&truth, ARM, 720, Made::Nothing);
    let findings = diagnosed(&file, FixedParameters::Known);
    near(only(&findings, "constant_error", "r4"), "error", 0.1, 0.1);
}

/// Fixed base parameters contain lengths too, so they have the same error.
#[test]
fn a_length_that_is_off_is_found_while_base_parameters_are_fixed() {
    let text = std::fs::read_to_string(bundled(ARM)).expect("a model");
    for (seed, changed) in [(721, 0.45), (722, 0.41)] {
        let other = text.replacen("r4 = { value = 0.4331", &format!("r4 = {{ value = {changed}"), 1);
        let truth = Model::from_text("other", &other).expect("the model");
        let file = run_of(&truth, ARM, seed, Made::Nothing);
        let findings = diagnosed(&file, FixedParameters::All);
        near(only(&findings, "constant_error", "r4"), "error", changed - 0.4331, 0.1);
    }
}

/// The contact point of a spindle beside the axis of its crank, and the end of a coupler beside its axis: the file writes
/// 0 there. Neither effects nor other constants are claimed in its place.
#[test]
fn a_zero_of_the_file_that_is_wrong_is_found_with_its_value() {
    const ROBOT: &str = "spidermill";
    let text = std::fs::read_to_string(bundled(ROBOT)).expect("a model");
    let given = Model::open(bundled(ROBOT)).expect("the model");
    for (seed, point, place, value) in [(740, "A_right", "\"dA\", 0", 0.02), (741, "A_left", "\"dA\", 0", -0.03)] {
        let entry = format!("name = \"{point}\"");
        let (before, after) = text.split_once(&entry).expect("the point");
        let other = before.to_owned() + &entry + &after.replacen(place, &place.replace('0', &value.to_string()), 1);
        let truth = Model::from_text("other", &other).expect("the model");
        let file = run_of(&truth, ROBOT, seed, Made::Nothing);
        let recording = given
            .recording(&file, &RecordingOptions::default())
            .expect("a recording");
        let findings = given
            .diagnose(&[&recording], &[], &DiagnosisOptions::default())
            .expect("an answer");
        let name = format!("y of {point}");
        let is_close = |found: f64| (found / value - 1.0).abs() < 0.1;
        let is_claimed =
            (findings.missing.iter()).any(|one| one.effect.at == [name.clone()] && is_close(one.estimates[0].value));
        // Where the error changes the forces by less than their noise, several effects explain it; none is claimed then.
        let is_named = (findings.geometry_alternatives.iter().flat_map(|one| &one.errors))
            .any(|error| error.name() == name && is_close(error.value));
        let is_sure = findings
            .missing
            .iter()
            .any(|one| one.effect.at != [name.clone()] && one.probability > 0.5);
        assert!(
            is_claimed || (is_named && !is_sure),
            "{} {:#?} {:#?}",
            findings.verdict_text(),
            findings.missing,
            findings.geometry_alternatives
        );
    }
}

/// The coordinate of the base's pivot and the length of the crank to the contact point change the forces in the same
/// way: neither is claimed, and both are named.
#[test]
fn constants_that_act_alike_share_their_probability() {
    const ROBOT: &str = "spidermill";
    let text = std::fs::read_to_string(bundled(ROBOT)).expect("a model");
    let given = Model::open(bundled(ROBOT)).expect("the model");
    for (seed, name, error) in [(742, "Bx", 0.08), (743, "dA", -0.06)] {
        let constants = &given.derivation.mechanism.constants;
        let value = constants
            .iter()
            .find(|one| one.name == name)
            .expect("the constant")
            .value;
        let entry = format!("{name} = {{ value = {value}");
        let changed = text.replacen(&entry, &format!("{name} = {{ value = {}", value + error), 1);
        assert_ne!(text, changed, "{entry}");
        let truth = Model::from_text("other", &changed).expect("the model");
        let files = [0, 10].map(|more| run_of(&truth, ROBOT, seed + more, Made::Nothing));
        let recordings = files.map(|file| {
            given
                .recording(&file, &RecordingOptions::default())
                .expect("a recording")
        });
        let findings = given
            .diagnose(&[&recordings[0]], &[&recordings[1]], &DiagnosisOptions::default())
            .expect("an answer");
        let [claim] = findings.missing.as_slice() else {
            panic!("{}", findings.verdict_text());
        };
        let named = claim.indistinguishable_from.iter().chain([&claim.effect]);
        let named: Vec<&str> = named.flat_map(|one| &one.at).map(String::as_str).collect();
        assert!(named.contains(&name), "{named:?}");
        assert!(claim.probability < 0.5, "{claim:?}");
    }
}

/// Both contact points 20 mm beside their axes: two wrong constants explain nearly as much, so both explanations are
/// named.
#[test]
fn wrong_zeros_are_alternatives_to_wrong_constants() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/seventeen-bodies");
    let files = ["fit", "check"].map(|name| folder.join(format!("contact-20mm-{name}.csv.gz")));
    if !files[0].exists() {
        eprintln!("../shared/data/seventeen-bodies is absent: nothing is tested");
        return;
    }
    let model = Model::open(bundled("spidermill")).expect("the model");
    let recordings = files.map(|file| {
        model
            .recording(&file, &RecordingOptions::default())
            .expect("a recording")
    });
    for fixed in [FixedParameters::Known, FixedParameters::All] {
        let question = DiagnosisOptions {
            fixed,
            repeat_with_nominal: false,
        };
        let findings = model
            .diagnose(&[&recordings[0]], &[&recordings[1]], &question)
            .expect("an answer");
        let names = ["y of A_left", "y of A_right"];
        let claimed = |name: &&str| findings.missing.iter().any(|one| one.effect.at == [(*name).to_owned()]);
        let is_named = findings.geometry_alternatives.iter().any(|one| {
            let errors = one.errors.iter().map(|error| (error.name(), error.value.abs()));
            errors
                .clone()
                .all(|(name, value)| names.contains(&name.as_str()) && (value - 0.02).abs() < 2e-3)
                && errors.count() == 2
        });
        assert!(
            names.iter().all(claimed) || is_named,
            "{:#?} {:#?}",
            findings.missing,
            findings.geometry_alternatives
        );
    }
}

/// The published model with a name for the distance of the contact points and all parameters fixed: the misplaced mass
/// and the distance are found with their values, since effects are evaluated at the claimed length.
#[test]
fn effects_act_at_the_length_that_is_claimed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/seventeen-bodies");
    let files = ["fit", "check"].map(|name| folder.join(format!("contact-20mm-{name}.csv.gz")));
    if !files[0].exists() {
        eprintln!("../shared/data/seventeen-bodies is absent: nothing is tested");
        return;
    }
    let text = std::fs::read_to_string(folder.join("paperea.toml")).expect("a text");
    let own = std::env::temp_dir().join(format!("modelmill-paperea-{}", std::process::id()));
    std::fs::create_dir_all(&own).expect("a folder");
    let file = own.join("paperea.toml");
    let bundled = bundled("spidermill-paper").display().to_string();
    std::fs::write(&file, text.replace("spidermill-models/spidermill-paper.toml", &bundled)).expect("a file");
    let model = Model::open(&file).expect("the model");
    let recordings = files.map(|file| {
        model
            .recording(&file, &RecordingOptions::default())
            .expect("a recording")
    });
    let question = DiagnosisOptions {
        fixed: FixedParameters::All,
        repeat_with_nominal: false,
    };
    let findings = model
        .diagnose(&[&recordings[0]], &[&recordings[1]], &question)
        .expect("an answer");
    std::fs::remove_dir_all(&own).expect("a folder");
    let found = findings.missing.iter();
    let mut found: Vec<(&str, f64)> = found
        .map(|one| (one.effect.kind.as_str(), one.estimates[0].value))
        .collect();
    found.sort_by(|a, b| a.0.cmp(b.0));
    let [("constant_error", distance), ("lumped_mass_placement", mass)] = found.as_slice() else {
        panic!("{found:?}");
    };
    assert!((distance - 0.02).abs() < 1e-5, "{distance}");
    // The platform's mass in the rig's file, kg.
    assert!((mass - 12.456).abs() < 1e-3, "{mass}");
}

#[test]
fn a_gear_that_yields_is_found_with_its_compliance() {
    let file = run(ARM, 730, Made::Yields(1, 4e-4));
    let findings = diagnosed(&file, FixedParameters::All);
    let drive = findings.channels()[1].clone();
    near(only(&findings, "drive_compliance", &drive), "compliance", 4e-4, 0.2);
}

/// A zero is a fault of the recording: the model lacks nothing. Beside free base parameters only joints behind it tell.
#[test]
fn an_encoder_with_another_zero_is_found_with_its_shift() {
    for (seed, joint, held) in [
        (750, 1, FixedParameters::Known),
        (751, 2, FixedParameters::Known),
        (752, 1, FixedParameters::All),
        (753, 2, FixedParameters::All),
    ] {
        let file = run(ARM, seed, Made::Zero(joint, 0.05));
        let findings = diagnosed(&file, held);
        assert!(findings.missing.is_empty(), "{:#?}", findings.missing);
        let zeros = findings.diagnosis.disturbances.iter();
        let zeros: Vec<_> = zeros.filter(|one| one.kind == "encoder_zero").collect();
        let [zero] = &zeros[..] else {
            panic!("{:#?}", findings.diagnosis.disturbances);
        };
        assert_eq!(zero.at, [format!("q{}", joint + 1)]);
        let shift = zero.estimates[0].value;
        assert!((shift - 0.05).abs() < 0.006, "{seed}: {shift}");
    }
}

/// Friction that the model has, with values of another day: it lacks none, and what is other about it is said.
#[test]
fn friction_of_another_day_is_no_further_friction() {
    let friction = "[[effect]]\nkind = \"coulomb_friction\"\nat = \"PLACE\"\nparameters = { Fc = { name = \"Fc\", nominal = 2.0 } }\n\n\
                    [[effect]]\nkind = \"viscous_friction\"\nat = \"PLACE\"\nparameters = { Fv = { name = \"Fv\", nominal = 3.0 } }\n";
    let text = std::fs::read_to_string(bundled(ARM)).expect("a model");
    let drive = Model::open(bundled(ARM)).expect("the model").row_names()[1].clone();
    let text = format!("{text}\n{}", friction.replace("PLACE", &drive));
    let model = Model::from_text("with friction", &text).expect("the model");
    let file = run(ARM, 760, Made::Friction(1, 5.0, 7.0));
    let recording = model.recording(&file, &RecordingOptions::default());
    let recording = recording.expect("the recording");
    let question = DiagnosisOptions {
        fixed: FixedParameters::All,
        repeat_with_nominal: false,
    };
    let findings = model.diagnose(&[&recording], &[], &question);
    let findings = findings.expect("an answer");
    assert!(findings.missing.is_empty(), "{:#?}", findings.missing);
    let changes = findings.diagnosis.disturbances.iter();
    let changes: Vec<_> = changes.filter(|one| one.kind == "different_runs").collect();
    let [change] = &changes[..] else {
        panic!("{:#?}", findings.diagnosis.disturbances);
    };
    assert_eq!((change.kind.as_str(), &change.at), ("different_runs", &vec![drive]));
    for (name, truth) in [("change of Fc", 3.0), ("change of Fv", 4.0)] {
        let value = change.estimates.iter().find(|one| one.name == name);
        let value = value.expect("an estimate").value;
        assert!((value - truth).abs() < 0.1 * truth, "{name}: {value}");
    }
}

/// Each of two differences between recordings is needed by itself. They are tested one by one, and both stay.
#[test]
fn two_differences_between_recordings_are_named() {
    let model = Model::open(bundled(ARM)).expect("the model");
    let made = [Made::Nothing, Made::Friction(1, 8.0, 10.0), Made::Scale(2, 1.3)];
    let recordings = made.into_iter().zip(780..).map(|(made, seed)| {
        let file = run(ARM, seed, made);
        let recording = model.recording(&file, &RecordingOptions::default());
        recording.expect("the recording")
    });
    let recordings: Vec<_> = recordings.collect();
    let question = DiagnosisOptions {
        fixed: FixedParameters::Known,
        repeat_with_nominal: false,
    };
    let all: Vec<_> = recordings.iter().collect();
    let findings = model.diagnose(&all, &[], &question).expect("an answer");
    assert!(findings.missing.is_empty(), "{:#?}", findings.missing);
    let disturbances = findings.diagnosis.disturbances.iter();
    let differences: Vec<_> = disturbances.filter(|one| one.kind == "different_runs").collect();
    let places: Vec<&[String]> = differences.iter().map(|one| &one.at[..]).collect();
    assert_eq!(places, [&model.row_names()[1..2], &model.row_names()[2..3]]);
    let values =
        |one: &modelmill::diagnose::Disturbance| -> Vec<f64> { one.estimates.iter().map(|v| v.value).collect() };
    for (one, truth) in differences.iter().zip([vec![8.0, 10.0], vec![1.3]]) {
        for (value, truth) in values(one).iter().zip(truth) {
            assert!((value / truth - 1.0).abs() < 0.1, "{value}, not {truth}");
        }
    }
}

/// Joints whose friction the model describes by one value, while one of them has more: the value of that joint is
/// missing, and no other law of friction.
#[test]
fn a_value_that_joints_share_is_separated_where_one_differs() {
    let text = std::fs::read_to_string(bundled(ARM)).expect("a model");
    let drives = Model::open(bundled(ARM)).expect("the model").row_names();
    let kind = |kind: &str, places: &[String]| format!("\n[[effect]]\nkind = \"{kind}\"\nat = {places:?}\n");
    let text = format!(
        "{text}{}{}",
        kind("viscous_friction", &drives[..3]),
        kind("coulomb_friction", &drives[1..2])
    );
    let model = Model::from_text("shared friction", &text).expect("the model");
    let file = run(ARM, 770, Made::Friction(1, 5.0, 7.0));
    let recording = model.recording(&file, &RecordingOptions::default());
    let recording = recording.expect("the recording");
    let findings = (model.diagnose(&[&recording], &[], &DiagnosisOptions::default())).expect("an answer");
    let found = only(&findings, "viscous_friction", &drives[1]);
    near(found, "Fv", 7.0, 0.1);
    let mut sharing = found.shared_with.clone();
    sharing.sort_unstable();
    assert_eq!(sharing, [drives[0].clone(), drives[2].clone()]);
    assert_eq!(findings.diagnosis.verdict, DiagnosisVerdict::MissingEffect);
    // The completed model has both values, and explains the recording.
    let completed = findings.after.version().expect("the completed model");
    assert_eq!(completed.model.base.len(), model.base.len() + 1);
    let says = findings.verdict_text();
    assert!(says.contains("separate values of viscous friction"), "{says}");
}

/// No polynomial is like a pull that gives way: it is one effect all the same, with one place.
#[test]
fn a_hose_that_gives_way_is_one_effect() {
    for (seed, way) in [(732, 0.35), (733, 0.5)] {
        let file = run(ARM, seed, Made::Hose(2, 12.0, way));
        let findings = diagnosed(&file, FixedParameters::All);
        let drive = findings.channels()[2].clone();
        only(&findings, "cable_torque", &drive);
        assert_eq!(findings.diagnosis.verdict, DiagnosisVerdict::MissingEffect);
    }
}

/// A fit of one run is known to its own deviations only: a further run in which nothing changed misses it by as much, and a load
/// stands out against that.
#[test]
fn what_a_fit_does_not_know_is_no_error_of_the_model() {
    let model = Model::open(bundled(ARM)).expect("the model");
    let read = |file: &Path| {
        let recording = model.recording(file, &RecordingOptions::default());
        recording.expect("the recording")
    };
    let before = read(&run(ARM, 740, Made::Nothing));
    let found = model.identify(&[&before], &[], &EstimatorOptions::default());
    let found = found.expect("a fit");
    let values = model.values_of(&found.fit, "fit.json");
    let values = values.expect("its values");
    assert!(values.covariance.is_some());
    let fitted = model.with_fit(&values);
    let question = DiagnosisOptions {
        fixed: FixedParameters::All,
        repeat_with_nominal: false,
    };
    let asked = |file: &Path| {
        let recording = read(file);
        fitted.diagnose(&[&recording], &[], &question).expect("an answer")
    };
    let same = asked(&run(ARM, 741, Made::Nothing));
    assert!(same.missing.is_empty(), "{:#?}", same.missing);
    assert_eq!(same.diagnosis.verdict, DiagnosisVerdict::Adequate);
    let part = "\n[[part]]\nname = \"tool\"\non = \"link6\"\nmass = 1.4\ncentre = [0.03, -0.02, 0.08]\n\
                inertia = { xx = 0.004, yy = 0.005, zz = 0.006 }\n";
    let loaded = asked(&run(ARM, 742, Made::Body(part)));
    near(only(&loaded, "payload", "link6"), "mass", 1.4, 0.05);
}

/// Bodies that would have to push upwards: gravity is turned, and so are drives that count the other way.
#[test]
fn gravity_of_the_wrong_sign_is_corrected() {
    let text = std::fs::read_to_string(bundled("spidermill")).expect("a model");
    let corrected = |text: &str| -> Vec<String> {
        let model = Model::from_text("spidermill.toml", text).expect("a model");
        let runs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/spidermill-mbs");
        let recording =
            |name: &str| (model.recording(runs.join(name), &RecordingOptions::default())).expect("a recording");
        let question = DiagnosisOptions {
            fixed: FixedParameters::Known,
            repeat_with_nominal: false,
        };
        let [fit, check] = ["plain-fit.csv", "plain-check.csv"].map(recording);
        let found = model.diagnose(&[&fit], &[&check], &question).expect("an answer");
        // Either way nothing is missing.
        assert!(found.missing.is_empty());
        found.corrected.into_iter().map(|fault| fault.clause).collect()
    };
    assert!(corrected(&text).is_empty());
    let turned = text.replace("[0, \"-g\", 0]", "[0, \"g\", 0]");
    assert_ne!(turned, text);
    let says = corrected(&turned);
    assert!(
        says.len() == 1 && says[0].starts_with("gravity points along -y"),
        "{says:?}"
    );
}

/// A tilted base makes the first moment of a link on a vertical axis act on its drive. It has no effect while the base is
/// level and is no base parameter, but its nominal value is known: nothing but the tilt is missing.
#[test]
fn a_tilted_base_needs_no_counterbalance() {
    let column = "\n[[part]]\nname = \"column\"\non = \"link1\"\nmass = 25\ncentre = [0.12, 0.1, 0]\n\
                  inertia = { xx = 0.1, yy = 0.1, zz = 0.1 }\n";
    let tilt =
        "\n[[effect]]\nkind = \"gravity_tilt\"\nat = [\"base\"]\nconstants = { tx = 0.04, ty = -0.03, tz = 0 }\n";
    let truth = with_part(ARM, &format!("{column}{tilt}"));
    let file = run_of(&truth, ARM, 760, Made::Nothing);
    let model = with_part(ARM, column);
    let recording = model.recording(&file, &RecordingOptions::default());
    let recording = recording.expect("the recording");
    let question = DiagnosisOptions {
        fixed: FixedParameters::Known,
        repeat_with_nominal: false,
    };
    let findings = (model.diagnose(&[&recording], &[], &question)).expect("an answer");
    let found = only(&findings, "gravity_tilt", "base");
    near(found, "tx", 0.04, 0.1);
    near(found, "ty", -0.03, 0.1);
}
