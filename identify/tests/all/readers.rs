//! Files that other programs wrote (`tests/fixtures/README.md` names them) give the motion that was written into them.

use std::path::{Path, PathBuf};

use modelmill_boundary::files::DiskFiles;
use modelmill_identify::{
    NonFinitePolicy, ReadOptions, RecordingFault, RecordingFile, RecordingFiles, SignalRecording, TableInfo,
};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures/readers")
        .join(name)
}

/// Samples of the motion.
const N: usize = 40;

fn time(k: usize) -> f64 {
    k as f64 / 100.0
}

/// Position of a joint, 1 to 3.
fn q(j: usize, k: usize) -> f64 {
    (time(k) + j as f64).sin()
}

fn rate(j: usize, k: usize) -> f64 {
    (time(k) + j as f64).cos()
}

fn tau(j: usize, k: usize) -> f64 {
    3.0 * q(j, k) + j as f64
}

fn options(renames: &[(&str, &str)]) -> ReadOptions {
    ReadOptions {
        wanted: Some(renames.iter().map(|(ours, _)| (*ours).to_owned()).collect()),
        renames: renames
            .iter()
            .filter(|(ours, theirs)| ours != theirs)
            .map(|(ours, theirs)| ((*ours).to_owned(), (*theirs).to_owned()))
            .collect(),
        ..ReadOptions::default()
    }
}

fn open(name: &str) -> RecordingFile {
    RecordingFile::open(&DiskFiles::default(), &fixture(name)).unwrap_or_else(|error| panic!("{error}"))
}

fn tables(name: &str) -> Vec<TableInfo> {
    open(name).tables().unwrap_or_else(|error| panic!("{error}"))
}

/// A column has these values, to the accuracy of the numbers in the file.
#[track_caller]
fn check(recording: &SignalRecording, name: &str, expected: impl Fn(usize) -> f64, tolerance: f64) {
    let found = recording.column(name).unwrap_or_else(|error| panic!("{error}"));
    for (k, found) in found.iter().enumerate() {
        let expected = expected(k);
        assert!(
            (found - expected).abs() <= tolerance,
            "{name}, sample {k}: {found} instead of {expected}"
        );
    }
}

fn notes(recording: &SignalRecording) -> String {
    let all = recording.notes().iter().map(|note| note.says.in_library_words());
    all.collect::<Vec<_>>().join("\n")
}

/// Chunks of all compressions; names of different lengths put later numbers at odd places.
#[test]
fn bags_of_ros_1_give_their_messages() {
    for name in ["ros1-none.bag", "ros1-bz2.bag", "ros1-lz4.bag"] {
        let columns = [
            ("t", "t"),
            ("q", "joint_states.position.wrist"),
            ("v", "joint_states.velocity.hand"),
            ("tau", "joint_states.effort.elbow"),
        ];
        let recording = open(name).read(&options(&columns)).unwrap();
        assert_eq!(recording.samples(), N, "{name}");
        check(&recording, "t", time, 1e-12);
        check(&recording, "q", |k| q(2, k), 0.0);
        check(&recording, "v", |k| rate(3, k), 0.0);
        check(&recording, "tau", |k| tau(1, k), 0.0);
        let all = tables(name);
        let topics: Vec<(&str, usize)> = all.iter().map(|one| (one.name.as_str(), one.samples)).collect();
        assert_eq!(topics, [("joint_states", N), ("current", N)], "{name}");
        assert!((all[0].rate().unwrap() - 100.0).abs() < 1e-6);
        // A message without a time of its own has that of its arrival.
        let current = open(name).read(&options(&[("t", "t"), ("i", "current.data")])).unwrap();
        check(&current, "i", |k| tau(1, k), 0.0);
        assert!(notes(&current).contains("that of arrival"), "{}", notes(&current));
    }
}

#[test]
fn damaged_bags_of_ros_1_say_where() {
    let bytes = std::fs::read(fixture("ros1-bz2.bag")).unwrap();
    let refuse = |bytes: &[u8]| {
        let read = SignalRecording::from_bytes(bytes, "run.bag", &ReadOptions::default());
        read.expect_err("a damaged bag").to_string()
    };
    // Cut in a record, and changed inside of a chunk.
    let cut = refuse(&bytes[..bytes.len() / 2]);
    assert!(
        cut.contains("this is a bag of ROS 1") && cut.contains("in the middle of a record"),
        "{cut}"
    );
    let mut changed = bytes.clone();
    let middle = bytes.len() / 2;
    changed[middle..middle + 40].fill(0x55);
    let says = refuse(&changed);
    assert!(
        says.contains("the record before byte") && says.contains("cannot be decompressed"),
        "{says}"
    );
    let old = refuse(b"#ROSBAG V1.2\nand more");
    assert!(old.contains("only version 2.0"), "{old}");
    // Any other byte gives an answer as well, and no panic.
    for at in (13..bytes.len()).step_by(97) {
        let mut changed = bytes.clone();
        changed[at] ^= 0xFF;
        let _ = SignalRecording::from_bytes(&changed, "run.bag", &ReadOptions::default());
    }
}

/// Logs from Foxy to Humble do not define their messages; common types are known, others are named as unknown.
#[test]
fn logs_without_definitions_are_read_by_common_types() {
    let columns = [
        ("t", "t"),
        ("q", "joint_states.position.elbow"),
        ("tau", "joint_states.effort.hand"),
        ("pull", "wrench.wrench.force.y"),
    ];
    let recording = open("humble.db3").read(&options(&columns)).unwrap();
    assert_eq!(recording.samples(), N);
    check(&recording, "t", time, 1e-12);
    check(&recording, "q", |k| q(1, k), 0.0);
    check(&recording, "tau", |k| tau(3, k), 0.0);
    check(&recording, "pull", |k| tau(2, k), 0.0);
    let all = tables("humble.db3");
    assert_eq!(all[0].columns.len(), 9);
    let unknown = all.iter().find(|one| one.kind.contains("Torques")).unwrap();
    let says = unknown.remark.as_deref().unwrap();
    assert!(
        says.contains("does not define `lab_msgs/Torques`") && says.contains("ros2 bag convert"),
        "{says}"
    );
}

/// Elements of lists have the names of the description; episodes of one file or of several are apart in time.
#[test]
fn data_sets_of_lerobot_are_read_with_their_names() {
    let columns = [
        ("t", "timestamp"),
        ("q", "observation.state.wrist.pos"),
        ("v", "action.elbow"),
        ("tau", "effort_3"),
    ];
    for version in ["lerobot-v2", "lerobot-v3"] {
        let recording = open(version).read(&options(&columns)).unwrap();
        assert_eq!(recording.samples(), N, "{version}");
        check(&recording, "q", |k| q(2, k), 1e-7);
        check(&recording, "v", |k| rate(1, k), 1e-7);
        check(&recording, "tau", |k| tau(3, k), 0.0);
        // The second episode begins with its 26th sample.
        check(
            &recording,
            "t",
            |k| if k < 25 { time(k) } else { time(24) + 3.0 + time(k - 25) },
            1e-5,
        );
        assert!(notes(&recording).contains("2 episodes"), "{}", notes(&recording));
        let table = tables(version).remove(0);
        assert_eq!((table.samples, table.time), (N, None), "{version}");
        assert!(table.remark.unwrap().contains("2 episodes"));
    }
    // A single episode has its own time, and the names as well.
    let file = "lerobot-v2/data/chunk-000/episode_000001.parquet";
    let recording = open(file).read(&options(&columns)).unwrap();
    assert_eq!(recording.samples(), 15);
    check(&recording, "t", time, 1e-7);
    check(&recording, "q", |k| q(2, k + 25), 1e-7);
    assert!((tables(file)[0].rate().unwrap() - 100.0).abs() < 1e-3);
    // Without the description elements have numbers.
    let bytes = std::fs::read(fixture(file)).unwrap();
    let names = SignalRecording::names_in_bytes(&bytes, "x").unwrap();
    assert!(names.contains(&"observation.state_2".to_owned()), "{names:?}");
    // A sampling rate counts over the gap as well.
    let by_rate = ReadOptions {
        rate: Some(100.0),
        ..options(&columns[1..])
    };
    let by_rate = ReadOptions {
        wanted: by_rate.wanted.map(|mut wanted| {
            wanted.push("t".to_owned());
            wanted
        }),
        ..by_rate
    };
    let recording = open("lerobot-v3").read(&by_rate).unwrap();
    check(&recording, "t", |k| time(k) + if k < 25 { 0.0 } else { 3.0 }, 1e-9);
}

/// A description that is no JSON, and a set without its data, are named with what to do.
#[test]
fn incomplete_data_sets_say_what_is_missing() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("lerobot-incomplete");
    let _ = std::fs::remove_dir_all(&folder);
    for part in ["data/chunk-000", "meta"] {
        std::fs::create_dir_all(folder.join(part)).unwrap();
    }
    let file = folder.join("data/chunk-000/episode_000000.parquet");
    let open = |path: &Path| RecordingFile::open(&DiskFiles::default(), path).map(|_| ());
    std::fs::write(folder.join("meta/info.json"), "{\"features\": {}}").unwrap();
    let says = open(&folder).unwrap_err().to_string();
    assert!(
        says.contains("no files such as") && says.contains("copy the data"),
        "{says}"
    );
    std::fs::copy(fixture("lerobot-v2/data/chunk-000/episode_000000.parquet"), &file).unwrap();
    open(&folder).unwrap();
    std::fs::write(folder.join("meta/info.json"), "{").unwrap();
    let says = open(&file).unwrap_err().to_string();
    assert!(says.contains("info.json") && says.contains("repair it"), "{says}");
}

#[test]
fn lists_of_other_lengths_are_no_silent_numbers() {
    let mut options = options(&[("t", "t"), ("a", "x_1"), ("b", "x_2")]);
    let recording = open("ragged.parquet").read(&options).unwrap();
    let says = recording.column("b").unwrap_err().to_string();
    assert!(says.contains("row 2") && says.contains("4 fields"), "{says}");
    options.not_finite = NonFinitePolicy::LeaveOut;
    let recording = open("ragged.parquet").read(&options).unwrap();
    assert_eq!(recording.samples(), 1);
    assert_eq!(recording.column("b").unwrap(), [2.0]);
    options.not_finite = NonFinitePolicy::Refuse;
    let longer = open("longer.parquet").read(&options).unwrap_err().to_string();
    assert!(
        longer.contains("`x` in row 2001") && longer.contains("2 elements"),
        "{longer}"
    );
}

fn several(names: &[&str]) -> RecordingFiles {
    let paths: Vec<PathBuf> = names.iter().map(|name| fixture(name)).collect();
    let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
    RecordingFiles::open(&DiskFiles::default(), &paths).unwrap()
}

/// Files of one variable each are joined row by row; equal names get that of their file.
#[test]
fn matlab_files_of_one_variable_are_one_recording() {
    let files = several(&["time.mat", "angles.mat", "torques.mat"]);
    let names = files.names().unwrap();
    assert!(
        names.contains(&"angles.data_2".to_owned()) && names.contains(&"torques.data_2".to_owned()),
        "{names:?}"
    );
    let columns = [("t", "t"), ("q", "angles.data_2"), ("tau", "torques.data_3")];
    let recording = files.read(&options(&columns)).unwrap();
    assert_eq!(recording.samples(), N);
    check(&recording, "t", time, 0.0);
    check(&recording, "q", |k| q(2, k), 0.0);
    check(&recording, "tau", |k| tau(3, k), 0.0);
    assert!(!notes(&recording).contains("No column of"), "{}", notes(&recording));
    let part = ReadOptions {
        time_interval: Some((0.1, 0.2)),
        ..options(&columns)
    };
    let part = files.read(&part).unwrap();
    assert_eq!(part.samples(), 11);
    check(&part, "q", |k| q(2, k + 10), 0.0);
    // Without the file of the name it is not clear which column is meant.
    let unclear = files
        .read(&options(&[("t", "t"), ("q", "data_2")]))
        .unwrap_err()
        .to_string();
    assert!(
        unclear.contains("is in") && unclear.contains("torques.data_2"),
        "{unclear}"
    );
    // A file with one sample less does not belong to these times.
    let short = several(&["time.mat", "short.mat"]);
    let short = short.read(&options(&[("t", "t"), ("q", "other_1")])).unwrap_err();
    assert!(
        matches!(short.fault, RecordingFault::NoTimeOfOwn { samples: 39, .. }),
        "{short}"
    );
    let with_rate = ReadOptions {
        rate: Some(100.0),
        ..options(&[("t", "t"), ("q", "data_1")])
    };
    let recording = several(&["angles.mat"]).read(&with_rate).unwrap();
    check(&recording, "t", time, 1e-12);
}

#[test]
fn text_without_header_has_numbered_columns() {
    let columns = [("t", "column_1"), ("q", "column_3"), ("tau", "column_7")];
    let recording = open("bare.txt").read(&options(&columns)).unwrap();
    assert_eq!(recording.samples(), N);
    check(&recording, "t", time, 0.0);
    check(&recording, "q", |k| q(2, k), 0.0);
    check(&recording, "tau", |k| tau(3, k), 0.0);
    assert_eq!(recording.line(0), Some(1));
    assert!(notes(&recording).contains("no line of names"), "{}", notes(&recording));
    assert!(tables("bare.txt")[0].remark.is_some());
    // The header of numpy is a comment.
    let recording = open("commented.txt")
        .read(&options(&[("t", "t"), ("q", "q_2")]))
        .unwrap();
    check(&recording, "q", |k| q(2, k), 0.0);
    assert_eq!(recording.line(0), Some(3));
}

#[test]
fn times_follow_from_a_sampling_rate() {
    let mut options = options(&[("t", "t"), ("q", "q_1")]);
    options.renames.clear();
    options.wanted = Some(vec!["t".to_owned(), "q_1".to_owned()]);
    let missing = open("no-time.csv")
        .read(&options)
        .unwrap()
        .column("t")
        .unwrap_err()
        .to_string();
    assert!(
        missing.contains("no column `t`") && missing.contains("option `rate` = `HZ`"),
        "{missing}"
    );
    options.rate = Some(100.0);
    let recording = open("no-time.csv").read(&options).unwrap();
    check(&recording, "t", time, 1e-12);
    check(&recording, "q_1", |k| q(1, k), 0.0);
    options.time_interval = Some((0.1, 0.2));
    let part = open("no-time.csv").read(&options).unwrap();
    assert_eq!(part.samples(), 11);
    check(&part, "t", |k| time(k + 10), 1e-12);
}

#[test]
fn decimal_commas_units_and_time_stamps_are_read() {
    let names = open("german.csv").names().unwrap();
    assert_eq!(names[1], "q_1 [deg]");
    let columns = [("t", "time"), ("q", "q_2 [deg]"), ("tau", "tau_3 (Nmm)")];
    let recording = open("german.csv").read(&options(&columns)).unwrap();
    check(&recording, "t", time, 1e-12);
    check(&recording, "q", |k| q(2, k).to_degrees(), 1e-12);
    check(&recording, "tau", |k| 1e3 * tau(3, k), 1e-9);
    assert!(notes(&recording).contains("time stamps"), "{}", notes(&recording));
    let table = tables("german.csv").remove(0);
    assert_eq!(table.columns[0].kind, "time");
    assert!((table.rate().unwrap() - 100.0).abs() < 1e-9);
    // A row of units becomes part of the names.
    let names = open("units.csv").names().unwrap();
    assert_eq!(names[..2], ["t [ms]".to_owned(), "q_1 [deg]".to_owned()]);
    let recording = open("units.csv")
        .read(&options(&[("t", "t [ms]"), ("q", "q_3 [deg]")]))
        .unwrap();
    check(&recording, "t", |k| 1e3 * time(k), 1e-9);
    assert_eq!(recording.line(0), Some(3));
    assert!((tables("units.csv")[0].rate().unwrap() - 100.0).abs() < 1e-9);
}

fn text(text: &str) -> Result<SignalRecording, modelmill_identify::RecordingError> {
    SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default())
}

/// A thousands separator, or a number between time stamps, must not become another number.
#[test]
fn mixed_decimal_signs_are_refused() {
    let says = |lines: &str, column: &str| text(lines).unwrap().column(column).unwrap_err().to_string();
    let mixed = says("t;q\n0;1,5\n1;1.234\n", "q");
    assert!(
        mixed.contains("line 3") && mixed.contains("`1.234`") && mixed.contains("decimal comma"),
        "{mixed}"
    );
    let mixed = says("t;q\n0;1.5\n1;1,234\n", "q");
    assert!(mixed.contains("line 3") && mixed.contains("decimal point"), "{mixed}");
    assert!(says("t;q\n0;1.234,5\n", "q").contains("line 2"));
    let stamps = says("t,q\n2024-05-01T10:00:00Z,1\n2024-05-01T10:00:61Z,2\n", "t");
    assert!(stamps.contains("line 3"), "{stamps}");
    assert!(says("t,q\n2024-05-01T10:00:00Z,1\n1.5,2\n", "t").contains("line 3"));
}

/// The first lines decide the layout; lines count as in the file.
#[test]
fn layouts_of_other_programs() {
    for (lines, names) in [
        ("t q\n0 1\n1 2\n", ["t", "q"]),
        ("  t [s]   q (deg)\n  0.0   1\n  1.0   2\n", ["t [s]", "q (deg)"]),
        ("% made by x\n% t, q\n0,1\n1,2\n", ["t", "q"]),
        (
            "# made by x\n\nt,q\n# units unknown\n0,1\n  # a remark\n1,2\n# end\n",
            ["t", "q"],
        ),
        ("t;q\n[s];[rad]\n0;1\n1;2\n", ["t [s]", "q [rad]"]),
        ("t\tq\ns\t\n0\t1\n1\t2\n", ["t [s]", "q"]),
        ("0,5;1\n1,5;2\n", ["column_1", "column_2"]),
        ("0,5 1\n1,5 2\n", ["column_1", "column_2"]),
        ("0, 1\n1, 2\n", ["column_1", "column_2"]),
        ("t;\"q; rad\"\n0;1\n1;2\n", ["t", "q; rad"]),
    ] {
        let recording = text(lines).unwrap_or_else(|error| panic!("{lines:?}: {error}"));
        assert_eq!(recording.names().collect::<Vec<_>>(), names, "{lines:?}");
        assert_eq!(recording.column(names[1]).unwrap(), [1.0, 2.0], "{lines:?}");
    }
    let remarks = text("# a\nt,q\n0,1\n# b\n1,x\n")
        .unwrap()
        .column("q")
        .unwrap_err()
        .to_string();
    assert!(remarks.contains("line 5"), "{remarks}");
    // A row of words is no row of units, and a line of numbers is never one.
    assert!(text("t,mode\n0,A\n1,V\n").unwrap().column("mode").is_err());
    let unclear = text("# a\nt q force\n0;1;2\n").unwrap_err().to_string();
    assert!(unclear.contains("line 2") && unclear.contains("separator"), "{unclear}");
}
