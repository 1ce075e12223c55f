//! Rigs and recordings of the workspace, and rigs from text.

use std::path::{Path, PathBuf};

use modelmill_boundary::files::MemoryFiles;
use modelmill_rig::{CoordinateSamples, Rig, RigState, RigTracker, Trajectory, forces};

fn workspace(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// A rig that ships with the program.
pub(crate) fn load(name: &str) -> Rig {
    let path = workspace("model-spec/rigs").join(format!("{name}.toml"));
    modelmill_rig::load_file(&path)
        .unwrap_or_else(|failure| panic!("{failure}"))
        .rig
}

/// A rig from its text; `schema` and `name` are added.
pub(crate) fn rig(text: &str) -> Rig {
    let text = format!("schema = 1\nname = \"test\"\n{text}");
    modelmill_rig::load("test.toml", &text, &MemoryFiles::default())
        .unwrap_or_else(|failure| panic!("{failure}"))
        .rig
}

/// Named columns.
pub(crate) type Table = Vec<(String, Vec<f64>)>;

/// A bundled recording.
pub(crate) fn bundled(name: &str) -> Table {
    let path = workspace("recordings/spidermill-mbs").join(format!("{name}.csv"));
    let mut reader = csv::Reader::from_path(path).expect("a recording");
    let names = reader.headers().expect("a header").clone();
    let mut table: Table = names.iter().map(|name| (name.to_owned(), Vec::new())).collect();
    for record in reader.records() {
        for ((_, values), field) in table.iter_mut().zip(&record.expect("a record")) {
            values.push(field.parse().expect("a number"));
        }
    }
    table
}

/// The first samples only.
pub(crate) fn shortened(table: &Table, n: usize) -> Table {
    table
        .iter()
        .map(|(name, values)| (name.clone(), values[..n].to_vec()))
        .collect()
}

/// A column by its name.
pub(crate) fn column<'a>(table: &'a Table, name: &str) -> &'a [f64] {
    let found = table.iter().find(|(known, _)| known == name);
    &found.unwrap_or_else(|| panic!("no column {name}")).1
}

/// The trajectory of a recording.
pub(crate) fn trajectory(table: &Table, coordinates: &[&str]) -> Trajectory {
    let of = |name: String| column(table, &name).to_vec();
    let samples = coordinates.iter().map(|name| CoordinateSamples {
        q: of((*name).to_owned()),
        qd: Some(of(format!("{name}_d"))),
        qdd: Some(of(format!("{name}_dd"))),
    });
    Trajectory::new(of("t".to_owned()), samples.collect()).expect("a trajectory")
}

/// Root mean square of the difference over that of the expected values.
pub(crate) fn relative_rms(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let error: f64 = found.iter().zip(expected).map(|(x, y)| (x - y).powi(2)).sum();
    (error / expected.iter().map(|y| y * y).sum::<f64>()).sqrt()
}

/// Forces of the drives in a state.
pub(crate) fn force(rig: &Rig, tracker: &mut RigTracker<'_>, state: &RigState) -> Vec<f64> {
    let motion = tracker.follow(state).unwrap_or_else(|error| panic!("{error}"));
    forces(rig, &motion).unwrap_or_else(|error| panic!("{error}"))
}

/// States with coordinates between -0.5 and 0.5, rates and accelerations between -2 and 2, always the same.
pub(crate) fn states(n_coordinates: usize, n: usize) -> Vec<RigState> {
    let mut bits = 1_u32;
    let mut draw = |scale: f64| -> Vec<f64> {
        let mut values = Vec::new();
        for _ in 0..n_coordinates {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            values.push(scale * (f64::from(bits) / f64::from(u32::MAX) - 0.5));
        }
        values
    };
    (0..n)
        .map(|_| RigState {
            q: draw(1.0),
            qd: draw(4.0),
            qdd: draw(4.0),
        })
        .collect()
}

/// Two numbers that must agree, to a share of the larger one or of 1.
#[track_caller]
pub(crate) fn close(found: f64, expected: f64, tolerance: f64) {
    let scale = expected.abs().max(1.0);
    assert!(
        (found - expected).abs() <= tolerance * scale,
        "{found} instead of {expected}"
    );
}
