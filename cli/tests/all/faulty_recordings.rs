//! Faulty recordings: each fault gets a clear answer, the exit status that suits it, and no panic.
//!
//! A sound recording is spoilt in one way at a time.

use crate::common::{json, model, number, ran, refused, run, scratch, workspace};
use serde_json::Value;

/// A recording as a header and rows of numbers.
#[derive(Clone)]
struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

/// The bundled recording, every second sample, with the columns of these names.
fn sound(names: &[&str]) -> Table {
    let text = std::fs::read_to_string(run("plain-fit.csv")).expect("a bundled recording");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let places: Vec<usize> = names
        .iter()
        .map(|name| header.iter().position(|other| other == name).expect("a column"))
        .collect();
    let rows = lines.step_by(2).map(|line| {
        let fields: Vec<f64> = line.split(',').map(|f| f.parse().expect("a number")).collect();
        places.iter().map(|place| fields[*place]).collect()
    });
    Table {
        names: names.iter().map(|name| (*name).to_owned()).collect(),
        rows: rows.collect(),
    }
}

fn positions() -> Table {
    sound(&["t", "theta1", "theta2", "spindle_left", "spindle_right"])
}

impl Table {
    fn write(&self, name: &str, separator: &str) -> String {
        let path = scratch(name);
        let mut text = self.names.join(separator);
        for row in &self.rows {
            let fields: Vec<String> = row.iter().map(f64::to_string).collect();
            text.push('\n');
            text.push_str(&fields.join(separator));
        }
        std::fs::write(&path, text).expect("written");
        path
    }

    fn spoilt(&self, name: &str, spoil: impl Fn(&mut Table)) -> String {
        let mut table = self.clone();
        spoil(&mut table);
        table.write(name, ",")
    }
}

fn spidermill() -> String {
    model("spidermill.toml")
}

/// Notes in the JSON of an identification that succeeds.
#[track_caller]
fn notes(path: &str, more: &[&str]) -> (Value, String) {
    let model = spidermill();
    let mut args = vec!["identify", &model, "--data", path, "--json"];
    args.extend(more);
    let fit = json(&args);
    let says = fit["data"].as_array().map_or_else(String::new, |notes| {
        let says = notes.iter().map(|note| note["says"].as_str().unwrap_or_default());
        says.collect::<Vec<_>>().join("\n")
    });
    (fit, says)
}

#[track_caller]
fn refuses(path: &str, expected: &[&str]) {
    let says = refused(1, &["identify", &spidermill(), "--data", path, "--json"]);
    for expected in expected {
        assert!(says.contains(expected), "`{expected}` is not in: {says}");
    }
}

#[test]
fn the_sound_recording_raises_no_warning() {
    let path = positions().write("sound.csv", ",");
    let (fit, says) = notes(&path, &[]);
    assert!(number(&fit, "/fit/nrms") < 2e-3);
    let warned = fit["data"]
        .as_array()
        .is_some_and(|notes| notes.iter().any(|note| note["severity"] == "warning"));
    assert!(!warned, "{says}");
}

#[test]
fn faults_that_leave_nothing_to_compute_are_refused() {
    let table = positions();
    let path = table.spoilt("nan.csv", |t| t.rows[100][3] = f64::NAN);
    refuses(
        &path,
        &["line 102: column `spindle_left` contains `NaN`", "--skip-bad-samples"],
    );
    let (_, says) = notes(&path, &["--skip-bad-samples"]);
    assert!(
        says.contains("1 of 1798 samples") && says.contains("line 102"),
        "{says}"
    );

    let path = table.spoilt("two_rows.csv", |t| t.rows.truncate(2));
    refuses(&path, &["2 samples are too few", "use a longer recording"]);
    let path = table.spoilt("no_rows.csv", |t| t.rows.clear());
    refuses(&path, &["no sample"]);
    let path = table.spoilt("no_theta2.csv", |t| t.names[2] = "angle".to_owned());
    refuses(&path, &["there is no column `theta2`", "`angle`", "--map theta2="]);
    // Blanks separate as well as commas.
    let (_, says) = notes(&table.write("blanks.csv", " "), &[]);
    assert!(says.contains("separated by blanks"), "{says}");
    refuses(
        &table.write("bars.csv", "|"),
        &["line 1", "the separator of the columns is not clear"],
    );
    let path = table.spoilt("repeated.csv", |t| t.rows[51] = t.rows[50].clone());
    refuses(&path, &["line 53", "time goes from", "remove repeated samples"]);
}

#[test]
fn gaps_and_standstill_are_said() {
    let table = positions();
    let path = table.spoilt("gap.csv", |t| drop(t.rows.drain(800..1000)));
    let (fit, says) = notes(&path, &[]);
    assert!(
        says.contains("1 gap in time") && says.contains("after line 801"),
        "{says}"
    );
    assert!(number(&fit, "/fit/nrms") < 3e-3);

    // Times that jitter are no gaps; one among them is.
    let jitter = |t: &mut Table| {
        let step = t.rows[1][0] - t.rows[0][0];
        for (k, row) in t.rows.iter_mut().enumerate() {
            let fraction = (4e4 * (k as f64 + 1.0).sin()).abs().fract();
            row[0] += 0.4 * step * (2.0 * fraction - 1.0);
        }
    };
    let path = table.spoilt("jitter.csv", jitter);
    let (_, says) = notes(&path, &[]);
    assert!(!says.contains("gap"), "{says}");
    let path = table.spoilt("jitter-and-gap.csv", |t| {
        jitter(t);
        drop(t.rows.drain(800..1000));
    });
    let (_, says) = notes(&path, &[]);
    assert!(says.contains("1 gap in time"), "{says}");

    let path = table.spoilt("still.csv", |t| {
        for row in &mut t.rows {
            row[1] = 1.8;
            row[2] = 1.8;
        }
    });
    let ran = ran(&["identify", &spidermill(), "--data", &path]);
    assert!(ran.status == 0 || ran.status == 1);
    assert!(!ran.err.contains("panicked"), "{}", ran.err);
    assert!(ran.err.contains("`theta1` does not move"), "{}", ran.err);
}

#[test]
fn exchanged_columns_are_named() {
    let table = positions();
    let path = table.spoilt("forces.csv", |t| t.names.swap(3, 4));
    let (_, says) = notes(&path, &[]);
    assert!(says.contains("exchanged") || says.contains("wrong sign"), "{says}");
    let arm = table.spoilt("angles.csv", |t| t.names.swap(1, 2));
    let told = ran(&["identify", &spidermill(), "--data", &arm]);
    assert!(told.err.contains("exchanged"), "{}", told.err);
    let told = ran(&["diagnose", &spidermill(), "--data", &arm]);
    // The verdict starts with the fault, and the rest holds for the corrected recording.
    let first: String = told.out.split_whitespace().collect::<Vec<_>>().join(" ");
    let expected = "the coordinates theta1 and theta2 are exchanged. With it corrected, the model";
    assert!(first.starts_with("In ") && first.contains(expected), "{}", told.out);
    let found = json(&["diagnose", &spidermill(), "--data", &path, "--json"]);
    let kinds = found["disturbances"].as_array().expect("disturbances").iter();
    let kinds: Vec<&str> = kinds.filter_map(|one| one["kind"].as_str()).collect();
    assert!(kinds.contains(&"exchanged_columns"), "{kinds:?}");
}

#[test]
fn degrees_are_named_and_read_once_they_are_said() {
    let table = positions();
    let path = table.spoilt("degrees.csv", |t| {
        for row in &mut t.rows {
            row[1] = row[1].to_degrees();
            row[2] = row[2].to_degrees();
        }
    });
    refuses(&path, &["[deg]", "check the units (rad, m)"]);
    let (fit, _) = notes(
        &path,
        &["--map", "theta1=theta1 [deg]", "--map", "theta2 = theta2 [deg]"],
    );
    assert!(number(&fit, "/fit/nrms") < 2e-3);
}

/// With the angles go their rates, where these are recorded.
#[test]
fn rates_in_degrees_are_named_with_their_angles() {
    let names = [
        "t",
        "theta1",
        "theta2",
        "theta1_d",
        "theta2_d",
        "theta1_dd",
        "theta2_dd",
        "spindle_left",
        "spindle_right",
    ];
    let path = sound(&names).spoilt("degrees-all.csv", |t| {
        for row in &mut t.rows {
            for value in &mut row[1..7] {
                *value = value.to_degrees();
            }
        }
    });
    let says = refused(1, &["identify", &spidermill(), "--data", &path]);
    let seem = says
        .split("are in degrees and not in rad")
        .nth(1)
        .expect("the suspicion");
    let told: Vec<&str> = seem
        .split('`')
        .nth(1)
        .expect("options")
        .split('"')
        .skip(1)
        .step_by(2)
        .collect();
    assert_eq!(told.len(), 6, "{told:?}");
    let maps: Vec<&str> = told.iter().flat_map(|map| ["--map", *map]).collect();
    let (fit, _) = notes(&path, &maps);
    assert!(number(&fit, "/fit/nrms") < 2e-3);
}

/// Parameters of any sign and size fit forces of any sign and size, so that only nominal values tell.
#[test]
fn forces_of_another_sign_or_unit_are_named() {
    let table = positions();
    for (name, factor, expected) in [
        (
            "turned.csv",
            -1.0,
            "--map \"spindle_left=-spindle_left\" --map \"spindle_right=-spindle_right\"",
        ),
        (
            "kilo.csv",
            1e-3,
            "--map \"spindle_left=spindle_left [kN]\" --map \"spindle_right=spindle_right [kN]\"",
        ),
    ] {
        let path = table.spoilt(name, |t| {
            for row in &mut t.rows {
                row[3] *= factor;
                row[4] *= factor;
            }
        });
        let (fit, says) = notes(&path, &[]);
        assert!(number(&fit, "/fit/nrms") < 2e-3);
        assert!(says.contains(expected), "{says}");
        // As advised, it is the sound recording again.
        let maps: Vec<&str> = expected
            .split('"')
            .skip(1)
            .step_by(2)
            .flat_map(|map| ["--map", map])
            .collect();
        let (mended, says) = notes(&path, &maps);
        assert!(!says.contains("it seems that"), "{says}");
        let nominal = number(&mended, "/parameters/0/nominal");
        assert!((number(&mended, "/parameters/0/value") / nominal - 1.0).abs() < 0.5);
    }
}

/// Forces that are read some samples later than they act, by the cubic through the four nearest samples.
fn late(table: &mut Table, column: usize, samples: f64) {
    let before: Vec<f64> = table.rows.iter().map(|row| row[column]).collect();
    for (k, row) in table.rows.iter_mut().enumerate() {
        let at = (k as f64 - samples).max(0.0);
        let below = (0..before.len()).take_while(|i| *i as f64 <= at).count();
        let first = below.saturating_sub(2).min(before.len() - 4);
        let x = at - first as f64;
        row[column] = (0..4)
            .map(|i| {
                let others = (0..4).filter(|j| *j != i);
                let weight: f64 = others.map(|j| (x - j as f64) / (i as f64 - j as f64)).product();
                weight * before[first + i]
            })
            .sum();
    }
}

/// What is said of a delay, and its number of samples.
#[track_caller]
fn told(says: &str) -> (&str, f64) {
    let line = says.lines().find(|line| line.contains(" samples or "));
    let line = line.unwrap_or_else(|| panic!("no delay in {says}"));
    let before = line.split(" samples or ").next().expect("a beginning");
    let number = before.rsplit(' ').next().expect("a number");
    (line, number.parse().expect("a number"))
}

#[test]
fn late_forces_are_measured_to_a_part_of_a_sample() {
    for samples in [0.5, 1.0, 2.0, 5.0, 30.0, 60.0] {
        let path = positions().spoilt("late.csv", |t| {
            late(t, 3, samples);
            late(t, 4, samples);
        });
        let (_, says) = notes(&path, &[]);
        let (line, found) = told(&says);
        assert!((found - samples).abs() < 0.06, "{samples}: {says}");
        assert!(
            line.starts_with("The forces in") && line.contains("come later"),
            "{says}"
        );
        // Every second sample of 500 Hz.
        let ms = format!("{found:.0}", found = 4.0 * samples);
        assert!(line.contains(&format!("samples or {ms}.")), "{ms}: {says}");
        let path = positions().spoilt("one-late.csv", |t| late(t, 4, samples));
        let (_, says) = notes(&path, &[]);
        let (line, found) = told(&says);
        assert!((found - samples).abs() < 0.06, "{samples}: {says}");
        assert!(line.starts_with("The force of `spindle_right` comes later"), "{says}");
    }
    let (_, says) = notes(&positions().write("in-time.csv", ","), &[]);
    assert!(!says.contains(" samples or "), "{says}");
}

/// Recordings made by another program, with friction, encoder and noise: 1 ms of both forces, a quarter of a sample, and 3 ms of
/// one.
#[test]
fn less_than_a_sample_is_told() {
    let harsh = workspace("../shared/data/spidermill-harsh");
    if !harsh.is_dir() {
        println!("Small delays are not tested: there is no ../shared/data beside the workspace.");
        return;
    }
    let [with_friction, base] = ["model-friction.toml", "spidermill.toml"].map(scratch);
    std::fs::copy(harsh.join("model-friction.toml"), &with_friction).expect("writable");
    std::fs::copy(spidermill(), base).expect("writable");
    let notes = |case: &str| -> String {
        let path = harsh.join(case).join("check.csv");
        let path = path.to_str().expect("plain text");
        let found = json(&["identify", &with_friction, "--data", path, "--json"]);
        let notes = found["data"].as_array().expect("notes").iter();
        notes
            .map(|note| note["says"].as_str().unwrap_or_default())
            .collect::<Vec<_>>()
            .join("\n")
    };
    for (case, samples, who) in [
        ("delay-small", 0.25, "The forces in"),
        ("delay-medium", 0.5, "The forces in"),
        ("delay-one-drive", 0.75, "The force of `spindle_left`"),
    ] {
        let says = notes(case);
        let (line, found) = told(&says);
        assert!(
            (found - samples).abs() < 0.03 && line.starts_with(who),
            "{case}: {says}"
        );
    }
    for case in ["clean", "noise-medium", "outliers", "hum", "scale-one-drive"] {
        let says = notes(case);
        assert!(!says.contains(" samples or "), "{case}: {says}");
    }
}

#[test]
fn a_force_at_its_limit_is_named() {
    let path = positions().spoilt("limit.csv", |t| {
        let largest = t.rows.iter().map(|row| row[3]).fold(f64::MIN, f64::max);
        for row in &mut t.rows {
            row[3] = row[3].min(0.8 * largest);
        }
    });
    let (_, says) = notes(&path, &[]);
    assert!(says.contains("the force of `spindle_left` is cut off at"), "{says}");
}

#[test]
fn columns_may_be_sums_in_other_units() {
    let table = positions();
    let (plain, _) = notes(&table.write("plain.csv", ","), &[]);
    let path = table.spoilt("sums.csv", |t| {
        t.names = ["ms", "a", "b", "sum", "spindle_right"].map(str::to_owned).to_vec();
        for row in &mut t.rows {
            *row = vec![
                1e3 * row[0],
                row[1].to_degrees() - 90.0,
                -row[2],
                (row[3] - 2.0 * row[4]) / 1e3,
                row[4],
            ];
        }
    });
    let (fit, _) = notes(
        &path,
        &[
            "--map",
            "t=ms [ms]",
            "--map",
            "theta1=a + 90 [deg]",
            "--map",
            "theta2=-b",
            "--map",
            "spindle_left=1000*sum + 2*spindle_right",
        ],
    );
    for k in 0..plain["parameters"].as_array().map_or(0, Vec::len) {
        let at = format!("/parameters/{k}/value");
        let (a, b) = (number(&plain, &at), number(&fit, &at));
        assert!((a / b - 1.0).abs() < 1e-6, "{a} and {b}");
    }
    let says = refused(2, &["identify", &spidermill(), "--data", &path, "--map", "theta1=a*b"]);
    assert!(says.contains("multiplied with each other"), "{says}");
    let says = refused(
        2,
        &["identify", &spidermill(), "--data", &path, "--map", "theta1=a [mm]"],
    );
    assert!(
        says.contains("`mm` does not fit this quantity") && says.contains("`deg`"),
        "{says}"
    );
    let says = refused(1, &["identify", &spidermill(), "--data", &path, "--map", "theta1=2*aa"]);
    assert!(says.contains("no column `aa`") && says.contains("`a`"), "{says}");
}

/// Local polynomials and Fourier series find what the low-pass finds.
#[test]
fn every_smoothing_gives_the_same_parameters() {
    let path = positions().write("smoothing.csv", ",");
    let (plain, _) = notes(&path, &[]);
    // The period of the paper, eq. (17), of which the recording lacks the first and the last tenth of a second.
    let period = "7.29";
    for more in [
        &["--smoothing", "savitzky-golay"][..],
        &["--smoothing", "fourier", "--period", period],
    ] {
        let (fit, says) = notes(&path, more);
        println!("{more:?}: nrms {}, {says}", number(&fit, "/fit/nrms"));
        for k in 0..plain["parameters"].as_array().map_or(0, Vec::len) {
            let at = format!("/parameters/{k}/value");
            let (a, b) = (number(&plain, &at), number(&fit, &at));
            assert!((a / b - 1.0).abs() < 0.02, "{more:?}: {a} and {b}");
        }
    }
    let says = refused(
        1,
        &["identify", &spidermill(), "--data", &path, "--smoothing", "fourier"],
    );
    assert!(says.contains("--period"), "{says}");
}
