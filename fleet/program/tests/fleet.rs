//! A small fleet from generator to answer: what was planted is found, and nothing depends on order, partition or a killed job.

use std::fs;
use std::path::{Path, PathBuf};

use modelmill::recording::RecordingOptions;
use modelmill_fleet::folder::robots;
use modelmill_fleet::{FleetModel, FleetPlan, FleetSummary};
use modelmill_fleet_program::generate::{FleetSize, generate};
use modelmill_fleet_program::identify::{FleetRequest, identify};
use modelmill_fleet_program::score::score;
use serde_json::Value;

/// A fleet in a folder of its own, which goes when the test ends.
struct Fleet(PathBuf);

impl Fleet {
    fn new(name: &str, robots: usize, bad: usize) -> Self {
        let folder = std::env::temp_dir().join(format!("modelmill-{name}-{}", std::process::id()));
        let size = FleetSize {
            robots,
            days: 7,
            per_day: 1,
            seconds: 24.0,
            rate: 100.0,
            seed: 5,
            bad,
            changes: 1.0,
        };
        generate(&folder, &size).expect("a fleet");
        Self(folder)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn identify(&self, out: &str) -> String {
        let (model, recordings, out) = (self.at("model.toml"), self.at("recordings"), self.at(out));
        let asked = FleetRequest {
            model: &model,
            recordings: &recordings,
            out: &out,
            plan: None,
            reading: &RecordingOptions::default(),
        };
        identify(&asked).expect("results")
    }

    fn results(&self, out: &str) -> Value {
        serde_json::from_str(&fs::read_to_string(self.at(out).join("results.json")).expect("results")).expect("JSON")
    }

    fn ground(&self) -> FleetModel {
        let first = self.at("recordings/robot=R00000/day=2026-03-01/recording=0/data.parquet");
        let plan = FleetPlan::from_recordings(&self.at("model.toml"), &RecordingOptions::default(), &[&first])
            .expect("a plan");
        assert_eq!(FleetPlan::parse("the plan", &plan.json()).expect("a plan"), plan);
        plan.derive_model().expect("a ground")
    }
}

impl Drop for Fleet {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn near(a: &FleetSummary, b: &FleetSummary, ground: &FleetModel) {
    let [a, b] = [a, b].map(|one| ground.solve(one).expect("parameters"));
    for (a, b) in a.parameters.iter().zip(&b.parameters) {
        assert!(
            (a.value - b.value).abs() < 1e-9 * a.value.abs().max(1e-3),
            "{a:?} {b:?}"
        );
    }
}

#[test]
fn what_was_planted_is_found_and_a_killed_job_goes_on() {
    let fleet = Fleet::new("planted", 10, 1);
    let says = fleet.identify("out");
    assert!(says.contains("1 recordings gave no result"), "{says}");
    let told = score(&fleet.at("out"), &fleet.at("truth.json")).expect("a score");
    for line in [
        "dead_sensor: 1 simulated, 1 found, 1 with the day within one day, 1 with the right name",
        "payload: 1 simulated, 1 found, 1 with the day within one day, 1 with the right name",
        "wear: 1 simulated, 1 found, 1 with the day within one day, 1 with the right name",
        "bad recordings: 1 simulated, 0 not reported, 0 others reported",
    ] {
        assert!(told.contains(line), "{told}");
    }
    let before = fleet.results("out");
    // A job that was killed while it wrote: one state lacks its tail, another is not there.
    let mut states: Vec<PathBuf> = fs::read_dir(fleet.at("out/state"))
        .unwrap()
        .map(|one| one.unwrap().path())
        .collect();
    states.sort();
    let cut = fs::read(&states[0]).unwrap();
    fs::write(&states[0], &cut[..cut.len() - 100]).unwrap();
    fs::remove_file(&states[1]).unwrap();
    let says = fleet.identify("out");
    assert!(says.contains("70 recordings, 62 of which were done before"), "{says}");
    assert_eq!(fleet.results("out"), before);
    // Another model does not go on from there.
    let model = fs::read_to_string(fleet.at("model.toml")).unwrap();
    fs::write(fleet.at("model.toml"), model.replace("0.8", "0.81")).unwrap();
    let (model, recordings, out) = (fleet.at("model.toml"), fleet.at("recordings"), fleet.at("out"));
    let asked = FleetRequest {
        model: &model,
        recordings: &recordings,
        out: &out,
        plan: None,
        reading: &RecordingOptions::default(),
    };
    assert!(identify(&asked).unwrap_err().to_string().contains("another model"));
}

#[test]
fn summaries_add_in_any_order_and_samples_come_in_any() {
    let fleet = Fleet::new("order", 3, 0);
    let ground = fleet.ground();
    let all: Vec<(String, PathBuf)> = robots(&fleet.at("recordings"))
        .expect("robots")
        .into_values()
        .flatten()
        .map(|file| (file.name, file.path))
        .collect();
    let summaries: Vec<FleetSummary> = all
        .iter()
        .map(|(name, path)| ground.summarise_file(name, path))
        .collect();
    let sum = |order: &mut dyn Iterator<Item = &FleetSummary>| {
        let mut sum = ground.empty_summary();
        order.for_each(|one| sum.merge(one).expect("one plan"));
        sum
    };
    let whole = sum(&mut summaries.iter());
    assert_eq!(whole.recordings, 21);
    near(&whole, &sum(&mut summaries.iter().rev()), &ground);
    // Parts of parts.
    let parts: Vec<FleetSummary> = summaries.chunks(4).map(|some| sum(&mut some.iter())).collect();
    near(&whole, &sum(&mut parts.iter().rev()), &ground);
    // As bytes; changed bytes are recognised.
    let bytes = whole.bytes();
    let again = FleetSummary::from_bytes(&bytes).expect("a summary");
    assert_eq!(again.bytes(), bytes);
    near(&again, &whole, &ground);
    for broken in [&bytes[..bytes.len() - 3], &bytes[1..], &[][..]] {
        assert!(FleetSummary::from_bytes(broken).is_err());
    }
    let mut changed = bytes.clone();
    changed[200] ^= 1;
    assert!(FleetSummary::from_bytes(&changed).is_err());
    // Samples of a recording in another order are the same recording, to the last digit.
    let columns = read(&all[3].1, &ground);
    let n = columns[0].1.len();
    let shuffled = columns.iter().map(|(name, values)| {
        let values = (0..n).map(|i| values[(i * 7919 + 13) % n]).collect();
        (name.clone(), values)
    });
    let shuffled: Vec<(String, Vec<f64>)> = shuffled.collect();
    assert_ne!(shuffled, columns);
    let [a, b] = [columns, shuffled].map(|columns| ground.summarise("one", columns));
    assert_eq!(a, b);
    assert_eq!((a.recordings, &a.all_columns), (1, &summaries[3].all_columns));
}

#[test]
fn recordings_that_give_no_answer_are_named() {
    let fleet = Fleet::new("bad", 1, 0);
    let ground = fleet.ground();
    let path = fleet.at("recordings/robot=R00000/day=2026-03-02/recording=0/data.parquet");
    let good = read(&path, &ground);
    let mut twice = good.clone();
    twice[0].1[7] = twice[0].1[6];
    let mut dead = good.clone();
    dead[1].1.fill(2.0);
    let mut missing = good.clone();
    missing.remove(3);
    let mut ragged = good.clone();
    ragged[2].1.pop();
    let mut sum = ground.summarise("good", good);
    for (name, columns, why) in [
        ("twice", twice, "time"),
        ("dead", dead, "q1 is constant"),
        ("missing", missing, "motor_left"),
        ("ragged", ragged, "q3"),
        ("none", Vec::new(), "no sample"),
    ] {
        let summary = ground.summarise(name, columns);
        assert_eq!((summary.recordings, summary.bad.len()), (0, 1));
        assert!(summary.bad[0].says.contains(why), "{}", summary.bad[0].says);
        assert!(ground.solve(&summary).unwrap_err().to_string().contains(name));
        sum.merge(&summary).expect("one plan");
    }
    let fit = ground.solve(&sum).expect("that of the good one");
    assert_eq!((fit.recordings, fit.bad), (1, 5));
}

/// The columns of a file.
fn read(path: &Path, ground: &FleetModel) -> Vec<(String, Vec<f64>)> {
    let model = modelmill::Model::open(path.ancestors().nth(5).expect("the fleet's folder").join("model.toml"))
        .expect("a model");
    let recording = model
        .recording(path, &RecordingOptions::default())
        .expect("a recording");
    let column = |name: String| {
        let values = recording.raw_column(&name).expect("a column").to_vec();
        (name, values)
    };
    ground.columns().into_iter().map(column).collect()
}

/// A recording without the columns of the model: the remedy is a flag of this program, not a word of the library.
#[test]
fn advice_names_flags_of_this_program() {
    let folder = std::env::temp_dir().join(format!("modelmill-fleet-flags-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    let run = folder.join("run.csv");
    fs::write(&run, "t,angle,elbow\n0,0,0\n0.01,0,0\n").expect("a recording");
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../model-spec/models/two_link.toml");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_modelmill-fleet"))
        .arg("plan")
        .args([&model, &run])
        .arg("--out")
        .arg(folder.join("plan.json"))
        .output()
        .expect("the program runs");
    let says = String::from_utf8_lossy(&output.stderr).into_owned();
    fs::remove_dir_all(&folder).expect("the folder goes");
    assert_eq!(output.status.code(), Some(1), "{says}");
    assert!(says.contains("`--map \"q1="), "{says}");
    assert!(!says.contains("option `"), "{says}");
}
