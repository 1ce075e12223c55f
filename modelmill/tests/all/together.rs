//! Recordings that are prepared together: those of a fit decide, and all get the same preparation.

use std::fmt::Write as _;
use std::path::Path;

use modelmill::Model;
use modelmill::recording::{PreparedRecording, RecordingOptions};

use crate::draws::Draws;
use crate::made::bundled;

/// Time between samples, s.
const STEP: f64 = 0.002;
/// Number of samples.
const SAMPLES: usize = 6000;

/// Positions and forces of an axis that follows sines up to a frequency, rad/s, as text with columns; positions have a
/// noise, m.
fn text_of(fastest: f64, noise: f64, seed: u64) -> String {
    let mut draws = Draws::new(seed);
    let waves: Vec<[f64; 3]> = (1..6)
        .map(|k| {
            // The frequencies have no common period: a periodic motion has its own smoothing.
            let part = (f64::from(k) / 5.0).powf(1.1);
            [0.05 / f64::from(k), fastest * part, 6.3 * draws.uniform()]
        })
        .collect();
    let sum = |of: &dyn Fn(&[f64; 3]) -> f64| -> f64 { waves.iter().map(of).sum() };
    let mut text = "t,x,motor\n".to_owned();
    for i in 0..SAMPLES {
        let t = STEP * i as f64;
        let x = sum(&|[a, w, p]| a * (w * t + p).sin());
        let v = sum(&|[a, w, p]| a * w * (w * t + p).cos());
        let a = sum(&|[a, w, p]| -a * w * w * (w * t + p).sin());
        let force = 95.0 * a + 200.0 * v + 25.0 * v.signum() + 0.5 * draws.normal();
        let x = x + noise * draws.normal();
        writeln!(text, "{t},{x},{force}").expect("a line of text");
    }
    text
}

/// Cut-off and decimation of a recording.
fn prepared(recording: &PreparedRecording) -> (Option<f64>, usize) {
    let prepared = &recording.segments[0].run.prepared;
    (prepared.cutoff_hz, prepared.decimate)
}

#[test]
fn recordings_of_one_machine_get_one_preparation() {
    let model = Model::open(bundled("emps")).expect("the model");
    let folder = std::env::temp_dir().join(format!("modelmill-together-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let paths = [
        ("slow.csv", text_of(4.0, 2e-5, 1)),
        ("fast.csv", text_of(12.0, 2e-6, 2)),
        ("check.csv", text_of(25.0, 2e-6, 3)),
    ]
    .map(|(name, text)| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file");
        path
    });
    let reading = RecordingOptions {
        columns: ["t", "x", "motor"]
            .map(|name| (name.to_owned(), name.to_owned()))
            .to_vec(),
        ..RecordingOptions::default()
    };
    let together = |fit: &[&Path], check: &[&Path]| {
        let [fit, check] = model.prepare_recordings([&one_file_each(fit), &one_file_each(check)], &reading);
        let all = fit.into_iter().chain(check);
        all.map(|one| prepared(&one.expect("a recording"))).collect::<Vec<_>>()
    };
    let [slow, fast, check] = [&paths[0], &paths[1], &paths[2]];
    let alone = |path: &Path| prepared(&model.recording(path, &reading).expect("a recording"));
    assert_ne!(
        alone(slow),
        alone(fast),
        "the recordings do not differ enough for this test"
    );
    // A validation run that moves slower gets the preparation of the fit; one that moves faster raises the cut-off of both.
    assert_eq!(together(&[fast], &[slow]), [alone(fast); 2]);
    let all = together(&[slow], &[check]);
    assert_eq!(all[0], all[1]);
    assert!(all[0].0 > alone(slow).0 && all[0].0 < alone(check).0, "{all:?}");
    // Recordings of one fit get the same one, whichever is first.
    let all = together(&[slow, fast], &[check]);
    assert!(all.iter().all(|one| *one == all[0]), "{all:?}");
    assert_eq!(together(&[fast, slow], &[check])[0], all[0]);
    // A file that cannot be read leaves the others as they are.
    let [fit, _] = model.prepare_recordings([&one_file_each(&[&folder.join("none.csv"), slow]), &[]], &reading);
    assert!(fit[0].is_err());
    assert_eq!(fit[1].as_ref().map(prepared).ok(), Some(alone(slow)));
    // Neither does a file that is too short to be prepared: the others are still prepared together.
    let short = folder.join("short.csv");
    std::fs::write(&short, "t,x,motor\n0,0,0\n0.002,0,0\n").expect("a file");
    let [fit, _] = model.prepare_recordings([&one_file_each(&[slow, &short, fast]), &[]], &reading);
    let [first, second, third] = &fit[..] else {
        panic!("{} recordings", fit.len());
    };
    assert!(second.is_err());
    let both = together(&[slow, fast], &[]);
    let found: Vec<_> = [first, third].map(|one| one.as_ref().map(prepared).ok()).into();
    assert_eq!(found, both.into_iter().map(Some).collect::<Vec<_>>());
    std::fs::remove_dir_all(&folder).expect("the folder");
}

/// Recordings of one file each.
fn one_file_each<'a>(paths: &[&'a Path]) -> Vec<Vec<&'a Path>> {
    paths.iter().map(|path| vec![*path]).collect()
}
