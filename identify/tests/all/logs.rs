//! One run in the formats that robots write, as Python packages wrote it (`tests/fixtures/make_logs.py`: h5py 3.16,
//! pyarrow 26, mcap 1.6, mcap-ros2-support 0.6, rosbags 0.11, zstandard 0.25): all of them give the bits of the CSV.

use std::path::{Path, PathBuf};
use std::process::Command;

use modelmill_boundary::files::DiskFiles;
use modelmill_identify::{ReadOptions, RecordingFile, SignalRecording, TableInfo};

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

const OURS: [&str; 7] = ["t", "q_1", "q_2", "qd_1", "qd_2", "tau_1", "tau_2"];

/// Every format with the names that it gives to the columns of [`OURS`].
fn forms() -> Vec<(&'static str, [String; 7])> {
    let plain = || OURS.map(str::to_owned);
    let state = |topic: &str| {
        let mut names = plain();
        let columns = ["position", "velocity", "effort"];
        for (k, column) in columns.iter().enumerate() {
            for (j, joint) in ["elbow", "arm/wrist"].iter().enumerate() {
                names[1 + 2 * k + j] = format!("{topic}.{column}.{joint}");
            }
        }
        names
    };
    let grouped = || {
        let mut names = plain();
        for name in &mut names[1..] {
            *name = format!("run.{name}");
        }
        names
    };
    vec![
        ("run.csv.gz", plain()),
        ("run.csv.zst", plain()),
        ("run-zstd-v1.parquet", plain()),
        ("run-zstd-v2.parquet", plain()),
        ("run-brotli-v1.parquet", plain()),
        ("run-brotli-v2.parquet", plain()),
        ("run-v73.mat", plain()),
        ("run-earliest.h5", grouped()),
        ("run-latest.h5", grouped()),
        ("run-zstd.mcap", state("joint_states")),
        ("run-lz4.mcap", state("joint_states")),
        ("run-none.mcap", state("joint_states")),
        ("run-none.mcap", state("lab/split")),
        ("run-v8.db3", state("joint_states")),
        ("run-v9-big.db3", state("joint_states")),
    ]
}

fn options(theirs: &[String; 7]) -> ReadOptions {
    let renames = OURS.iter().zip(theirs).skip(1);
    ReadOptions {
        renames: renames
            .map(|(ours, theirs)| ((*ours).to_owned(), theirs.clone()))
            .collect(),
        wanted: Some(OURS.map(str::to_owned).to_vec()),
        ..ReadOptions::default()
    }
}

fn tables(path: &Path) -> Vec<TableInfo> {
    let file = RecordingFile::open(&DiskFiles::default(), path).unwrap();
    file.tables().unwrap()
}

/// Holds all files of a folder against its CSV.
fn same_in(folder: &Path) {
    let csv = SignalRecording::read(folder.join("run.csv"), &[]).unwrap();
    for (file, theirs) in forms() {
        let path = folder.join(file);
        let recording = SignalRecording::read_with(&path, &options(&theirs)).unwrap();
        assert_eq!(recording.samples(), csv.samples(), "{file}");
        for name in OURS {
            let (found, expected) = (recording.column(name).unwrap(), csv.column(name).unwrap());
            for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
                assert_eq!(found.to_bits(), expected.to_bits(), "{file}: {name}, sample {k}");
            }
        }
        let bytes = std::fs::read(&path).unwrap();
        let piped = SignalRecording::from_bytes(&bytes, "a pipe", &options(&theirs)).unwrap();
        assert_eq!(piped.column("tau_2").unwrap(), csv.column("tau_2").unwrap(), "{file}");
        let with_columns = tables(&path).into_iter().find(|table| {
            let mut columns = table.columns.iter();
            columns.any(|column| column.name == theirs[1])
        });
        let table = with_columns.unwrap();
        assert_eq!(table.samples, csv.samples(), "{file}");
        let rate = table.rate().unwrap();
        assert!((rate - 250.0).abs() < 1e-6, "{file}: {rate}");
        // A file that lost its end is no recording.
        let cut = SignalRecording::from_bytes(&bytes[..bytes.len() * 2 / 3], file, &options(&theirs));
        assert!(cut.is_err(), "{file}");
    }
}

#[test]
fn formats_give_the_same_numbers() {
    same_in(&fixtures());
}

/// Where Python has the packages, files are made afresh, of another length.
#[test]
fn files_that_are_made_now_give_the_same_numbers() {
    let python = std::env::var("MODELMILL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let packages = "import h5py, pyarrow, mcap_ros2, rosbags, zstandard";
    let has = Command::new(&python).args(["-c", packages]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        println!("left out: `{python}` lacks packages ({packages}); MODELMILL_PYTHON names another one");
        return;
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("logs");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let made = Command::new(&python)
        .arg(fixtures().join("make_logs.py"))
        .arg(&folder)
        .arg("3001")
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    same_in(&folder);
}

#[test]
fn whole_numbers_of_all_types_are_read_right() {
    for file in ["run-zstd-v1.parquet", "run-brotli-v2.parquet"] {
        let recording = SignalRecording::read(fixtures().join(file), &[]).unwrap();
        let kinds = tables(&fixtures().join(file)).remove(0).columns;
        for k in [0, 1, 59] {
            let x = k as f64;
            for (name, kind, expected) in [
                ("u8", "uint32", (200.0 + x) % 256.0),
                ("u16", "uint32", 65535.0 - x),
                ("u32", "uint32", 4_294_967_295.0 - x),
                ("u64", "uint64", 18_446_744_073_709_551_616.0 - 4096.0 * (x + 1.0)),
                ("i8", "int32", x - 128.0),
                ("i16", "int32", -x),
                ("i32", "int32", x - 2_147_483_648.0),
                ("i64", "int64", 1024.0 * x - 4_611_686_018_427_387_904.0),
            ] {
                let value = recording.column(name).unwrap()[k];
                assert!((value - expected).abs() < 0.5, "{name}: {value}");
                let said = kinds.iter().find(|column| column.name == name).unwrap();
                assert_eq!(said.kind, kind, "{name}");
            }
        }
    }
}

#[test]
fn datasets_of_all_types_are_read_right() {
    for file in ["run-earliest.h5", "run-latest.h5"] {
        let recording = SignalRecording::read(fixtures().join(file), &[]).unwrap();
        for k in [0, 1, 59] {
            let q = recording.column("run.q_1").unwrap()[k];
            for (name, expected) in [
                ("run.count", 4_294_967_295.0 - k as f64),
                ("run.is_on", f64::from(u8::from(k % 2 == 0))),
                ("run.record.left", q),
                ("run.record.right", -(k as f64)),
                ("more.group11.x", q + 11.0),
            ] {
                let value = recording.column(name).unwrap()[k];
                assert!((value - expected).abs() < 1e-12, "{file}: {name} is {value}");
            }
        }
        let notes = recording.notes();
        assert!(
            notes
                .iter()
                .any(|note| note.says.in_library_words().contains("`calibration`")
                    && note.says.in_library_words().contains("`operator`")),
            "{notes:?}"
        );
    }
}

#[test]
fn messages_of_any_type_become_columns() {
    let path = fixtures().join("run-zstd.mcap");
    let topics = tables(&path);
    let status: Vec<_> = topics.iter().filter(|topic| topic.name == "status").collect();
    assert_eq!(status.len(), 1);
    assert_eq!(
        (status[0].kind.as_str(), status[0].samples),
        ("lab_msgs/msg/Status", 12)
    );
    let columns: Vec<String> = status[0]
        .columns
        .iter()
        .map(|column| format!("{} {}", column.name, column.kind))
        .collect();
    assert_eq!(
        columns,
        [
            "status.is_on bool",
            "status.drives.left.current int16",
            "status.drives.left.count uint64",
            "status.drives.left.force.x float64",
            "status.drives.left.force.y float64",
            "status.drives.left.force.z float64",
            "status.drives.right.current int16",
            "status.drives.right.count uint64",
            "status.drives.right.force.x float64",
            "status.drives.right.force.y float64",
            "status.drives.right.force.z float64",
            "status.temperatures_1 float32",
            "status.temperatures_2 float32",
        ]
    );
    let one = |name: &str| {
        let options = ReadOptions {
            wanted: Some(vec!["t".to_owned(), name.to_owned()]),
            ..ReadOptions::default()
        };
        SignalRecording::read_with(&path, &options).unwrap()
    };
    let current = one("status.drives.right.current");
    let expected: Vec<f64> = (0..12).map(|i| -5.0 * f64::from(i)).collect();
    assert_eq!(current.column("status.drives.right.current").unwrap(), expected);
    assert!(
        current.notes()[0].says.in_library_words().contains("`status`")
            && current.notes()[0].says.in_library_words().contains("arrival"),
        "{:?}",
        current.notes()
    );
    for (name, k, expected) in [
        ("status.drives.left.count", 1, 9_007_199_254_741_002.0),
        ("status.temperatures_2", 2, 31.0),
    ] {
        let value = one(name).column(name).unwrap()[k];
        assert!((value - expected).abs() < 1e-9, "{name}: {value}");
    }
}

/// The slower topic gives the times, and the faster one is interpolated: linearly, so that a straight line stays one.
#[test]
fn topics_are_joined_on_time() {
    let path = fixtures().join("run-v8.db3");
    let options = ReadOptions {
        wanted: Some(
            ["t", "command.data", "joint_states.position.elbow"]
                .map(str::to_owned)
                .to_vec(),
        ),
        ..ReadOptions::default()
    };
    let recording = SignalRecording::read_with(&path, &options).unwrap();
    let command = recording.column("command.data").unwrap();
    // The first command comes 1 us after the first state, which has none before it.
    assert_eq!(recording.samples(), 59);
    for (k, value) in command.iter().enumerate() {
        let expected = k as f64 + 1.0 - 1000.0 / 4e6;
        assert!((value - expected).abs() < 1e-9, "{k}: {value}");
    }
    let says: Vec<String> = recording
        .notes()
        .iter()
        .map(|note| note.says.in_library_words())
        .collect();
    assert!(
        says.iter().any(|says| says.contains("1 sample of `joint_states`")),
        "{says:?}"
    );
    assert!(
        says.iter()
            .any(|says| says.contains("`command` is interpolated linearly to them")),
        "{says:?}"
    );
}
