//! Mechanisms rebuilt from public reports, with the counts of an independent program: ranks of virtual power on maximal
//! coordinates, by singular values. The files are not part of the project; where they are absent, that is printed.

use std::path::{Path, PathBuf};

use modelmill::Model;
use modelmill::recording::RecordingOptions;

fn file(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data/mechanisms")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("../shared/data/mechanisms/{name} is absent: nothing is tested");
    None
}

fn text(name: &str) -> Option<String> {
    file(name).map(|path| std::fs::read_to_string(path).expect("a model"))
}

fn model(text: &str) -> Model {
    Model::from_text("mechanism", text).unwrap_or_else(|error| panic!("{error:?}"))
}

/// Number of base parameters, numeric rank, and warnings.
fn counts(text: &str) -> (usize, usize, Vec<String>) {
    let model = model(text);
    let checked = model.check().expect("a check");
    let rank = checked.rank.expect("a rank").numeric_rank.rank;
    (model.derivation.reduction.retained.len(), rank, checked.warnings)
}

/// Loops with more equations than passive coordinates move by a slide as they do by a turn.
#[test]
fn overconstrained_loops_may_be_moved_by_a_slide() {
    for (name, base) in [("sarrus", 6), ("sarrus_u", 6), ("tripteron", 16)] {
        let Some(text) = text(&format!("{name}.toml")) else {
            continue;
        };
        let (retained, _, warnings) = counts(&text);
        assert_eq!(retained, base, "{name}: {warnings:?}");
    }
}

/// A Bennett linkage whose twist is rounded to 17 digits, and a rod on three equal cranks: the count is that of the
/// linkage that moves, as the rank at random states is.
#[test]
fn equations_that_follow_from_others_add_no_base_parameter() {
    for (name, base) in [("bennett", 7), ("locomotive", 3), ("weld2", 8)] {
        let Some(text) = text(&format!("{name}.toml")) else {
            continue;
        };
        let (retained, rank, warnings) = counts(&text);
        assert_eq!((retained, rank), (base, base), "{name}: {warnings:?}");
    }
}

/// A screw of 10 mm per turn moves the links behind it by degrees in many turns.
#[test]
fn numeric_ranks_are_sampled_along_the_travel_of_a_screw() {
    let Some(text) = text("screwpress.toml") else { return };
    let (retained, rank, warnings) = counts(&text);
    assert_eq!((retained, rank), (11, 11), "{warnings:?}");
    assert!(warnings.is_empty(), "{warnings:?}");
}

/// A crank of 0.2 m whose coupler and rocker of 0.3 m nearly reach the ground of 0.4 m in one line.
#[test]
fn a_nominal_pose_near_a_fold_is_reported() {
    let four_bar = |angle: f64| {
        // The crank's end, and the distance that coupler and rocker bridge.
        let (px, py) = (0.2 * angle.cos(), 0.2 * angle.sin());
        let (dx, dy): (f64, f64) = (0.55 - px, -py);
        let d = dx.hypot(dy);
        let inner = ((0.09 + d * d - 0.09) / (0.6 * d)).acos();
        let coupler = dy.atan2(dx) + inner;
        let rocker = (0.3 * coupler.sin() + py).atan2(px + 0.3 * coupler.cos() - 0.55);
        format!(
            r#"schema = 1
name = "four_bar"
gravity = [0, "-9.81", 0]
[coordinates]
q = {{ nominal = {angle} }}
c = {{ nominal = {}, passive = true }}
r = {{ nominal = {rocker}, passive = true }}
[[frame]]
name = "crank"
on = "base"
joint = {{ revolute = "q" }}
[[frame]]
name = "coupler"
on = "crank"
transform = {{ xyz = [0.2, 0, 0] }}
joint = {{ revolute = "c" }}
[[frame]]
name = "rocker"
on = "base"
transform = {{ xyz = [0.55, 0, 0] }}
joint = {{ revolute = "r" }}
[[point]]
name = "a"
on = "coupler"
at = [0.3, 0, 0]
[[point]]
name = "b"
on = "rocker"
at = [0.3, 0, 0]
[[loop]]
name = "l"
joins = ["a", "b"]
[[drive]]
name = "m"
joint = "q"
[[part]]
on = "crank"
linear = {{ planar = "_1", nominal = {{ ZZ = 0.1, MX = 0.2, MY = 0.0, M = 1 }} }}
[[part]]
on = "rocker"
linear = {{ planar = "_2", nominal = {{ ZZ = 0.1, MX = 0.2, MY = 0.0, M = 1 }} }}
"#,
            coupler - angle
        )
    };
    // Coupler and rocker are in line at a distance of 0.6 m between their ends.
    let fold = ((0.04 + 0.55_f64.powi(2) - 0.36) / (2.0 * 0.2 * 0.55)).acos();
    let near = counts(&four_bar(fold - 1e-5)).2;
    assert!(near.iter().any(|says| says.contains("near a fold")), "{near:?}");
    let far = counts(&four_bar(fold - 0.8)).2;
    assert!(!far.iter().any(|says| says.contains("near a fold")), "{far:?}");
    // A nominal value of zero is a value.
    let notes = model(&four_bar(fold - 0.8)).base_parameter_values().notes;
    assert!(
        notes.is_empty(),
        "{:?}",
        notes.iter().map(|n| n.says.in_library_words()).collect::<Vec<_>>()
    );
}

/// States of a free body with its rates and accelerations need no filter: forces are those of the states, and all
/// samples stay, however few they are.
#[test]
fn recorded_twists_of_a_free_body_are_not_filtered() {
    let Some(path) = file("ant.csv") else { return };
    let table = std::fs::read_to_string(path).expect("states");
    let model = model(&text("ant.toml").expect("a model"));
    let values = model.base_parameter_values().values;
    let folder = std::env::temp_dir().join(format!("modelmill-ant-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let forces = |lines: &[&str], name: &str| {
        let file = folder.join(name);
        std::fs::write(&file, lines.join("\n") + "\n").expect("written");
        let found = model.evaluate(&file, &RecordingOptions::default(), &values);
        found.unwrap_or_else(|error| panic!("{error:?}"))
    };
    let lines: Vec<&str> = table.lines().collect();
    let all = forces(&lines, "all.csv");
    assert_eq!(all.time.len(), 30);
    let few = forces(&lines[..16], "few.csv");
    assert_eq!(few.time.len(), 15);
    // The states are not a motion: each one alone gives the same forces, in any order.
    let mut turned = lines[1..].to_vec();
    turned.reverse();
    let turned: Vec<String> = (turned.iter().zip(&lines[1..]))
        .map(|(line, at)| {
            let time = at.split(',').next().expect("a time");
            format!("{time},{}", line.split_once(',').expect("columns").1)
        })
        .collect();
    let backwards: Vec<&str> = std::iter::once(lines[0])
        .chain(turned.iter().map(String::as_str))
        .collect();
    let backwards = forces(&backwards, "backwards.csv");
    for (((name, a), (_, b)), (_, c)) in all.columns.iter().zip(&few.columns).zip(&backwards.columns) {
        for k in 0..30 {
            assert!((a[k] - c[29 - k]).abs() <= 1e-12 * (1.0 + a[k].abs()), "{name} {k}");
        }
        assert_eq!(a[..15], b[..], "{name}");
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}
