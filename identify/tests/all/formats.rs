//! Recordings in other formats than CSV give the same numbers as CSV does, and faulty ones an answer.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill_identify::{
    ComputedColumn, NonFinitePolicy, ReadOptions, RecordingFault, SignalRecording, display_name_of_bytes,
};
use parquet::basic::Compression;
use parquet::data_type::{DoubleType, FixedLenByteArray, FixedLenByteArrayType, FloatType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

const SAMPLES: usize = 20_000;

fn time(k: usize) -> f64 {
    k as f64 * 0.001
}

/// Two row groups, time stamps in microseconds, a float and a nullable double whose sample 7 is null.
fn write_parquet(path: &Path, compression: Compression) {
    let schema = parse_message_type(
        "message run { required int64 stamp (TIMESTAMP(MICROS,true)); required float q; \
         optional double motor; required double spare; }",
    )
    .expect("a schema");
    let properties = WriterProperties::builder().set_compression(compression).build();
    let file = File::create(path).expect("a writable folder");
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).expect("a writer");
    for group in 0..2 {
        let rows = group * SAMPLES / 2..(group + 1) * SAMPLES / 2;
        let mut columns = writer.next_row_group().expect("a row group");
        let stamps: Vec<i64> = rows
            .clone()
            .map(|k| 1_700_000_000_000_000 + 1000 * i64::try_from(k).expect("a small count"))
            .collect();
        let mut column = columns.next_column().expect("no fault").expect("a column");
        column
            .typed::<Int64Type>()
            .write_batch(&stamps, None, None)
            .expect("written");
        column.close().expect("closed");
        #[expect(clippy::cast_possible_truncation, reason = "the column is of that type")]
        let q: Vec<f32> = rows.clone().map(|k| time(k).sin() as f32).collect();
        let mut column = columns.next_column().expect("no fault").expect("a column");
        column
            .typed::<FloatType>()
            .write_batch(&q, None, None)
            .expect("written");
        column.close().expect("closed");
        let force: Vec<f64> = rows.clone().filter(|k| *k != 7).map(|k| 3.0 * time(k)).collect();
        let levels: Vec<i16> = rows.clone().map(|k| i16::from(k != 7)).collect();
        let mut column = columns.next_column().expect("no fault").expect("a column");
        column
            .typed::<DoubleType>()
            .write_batch(&force, Some(&levels), None)
            .expect("written");
        column.close().expect("closed");
        let spare: Vec<f64> = rows.map(|_| f64::NAN).collect();
        let mut column = columns.next_column().expect("no fault").expect("a column");
        column
            .typed::<DoubleType>()
            .write_batch(&spare, None, None)
            .expect("written");
        column.close().expect("closed");
        columns.close().expect("closed");
    }
    writer.close().expect("closed");
}

fn options() -> ReadOptions {
    ReadOptions {
        renames: vec![("t".to_owned(), "stamp".to_owned())],
        wanted: Some(["t", "q", "motor"].map(str::to_owned).to_vec()),
        ..ReadOptions::default()
    }
}

#[test]
fn parquet_gives_numbers_times_and_nulls() {
    for (name, compression) in [
        ("plain", Compression::UNCOMPRESSED),
        ("snappy", Compression::SNAPPY),
        ("lz4", Compression::LZ4_RAW),
    ] {
        let path = scratch(&format!("{name}.parquet"));
        write_parquet(&path, compression);
        assert_eq!(
            SignalRecording::names_in(&path).unwrap(),
            ["stamp", "q", "motor", "spare"]
        );
        let recording = SignalRecording::read_with(&path, &options()).unwrap();
        assert_eq!(recording.samples(), SAMPLES);
        for k in [0, 1, 9_999, 10_000, 19_999] {
            assert!((recording.column("t").unwrap()[k] - time(k)).abs() < 1e-12);
            assert!((recording.column("q").unwrap()[k] - time(k).sin()).abs() < 1e-6);
        }
        let missing = recording.column("motor").unwrap_err().to_string();
        assert!(
            missing.contains(", row 8: column `motor` contains `null or NaN`"),
            "{missing}"
        );
        let kept = SignalRecording::read_with(
            &path,
            &ReadOptions {
                not_finite: NonFinitePolicy::LeaveOut,
                ..options()
            },
        )
        .unwrap();
        assert_eq!(kept.samples(), SAMPLES - 1);
        assert_eq!(kept.line(7), Some(9));
        assert!((kept.column("motor").unwrap()[7] - 3.0 * time(8)).abs() < 1e-12);
    }
}

/// What came through a pipe is in memory: it gives what the file gives.
#[test]
fn every_format_is_read_from_memory_too() {
    let parquet = scratch("memory.parquet");
    write_parquet(&parquet, Compression::SNAPPY);
    let csv = scratch("memory.csv");
    std::fs::write(&csv, "t,q\n0,1.5\n0.1,1.6\n").unwrap();
    for path in [&parquet, &csv, &fixture("run-v7.mat"), &fixture("run-v6.mat")] {
        let bytes = std::fs::read(path).unwrap();
        let file = path.display().to_string();
        assert_eq!(
            SignalRecording::names_in_bytes(&bytes, &file).unwrap(),
            SignalRecording::names_in(path).unwrap()
        );
        let options = if *path == parquet {
            options()
        } else {
            ReadOptions::default()
        };
        let from_bytes = SignalRecording::from_bytes(&bytes, &file, &options).unwrap();
        let from_file = SignalRecording::read_with(path, &options).unwrap();
        assert_eq!(from_bytes.samples(), from_file.samples());
        let column = from_file.column("t").unwrap();
        assert_eq!(from_bytes.column("t").unwrap(), column);
        assert_eq!(from_bytes.notes(), from_file.notes());
    }
    // A pipe has no ending that tells what it carries; what is in the bytes does.
    let bytes = std::fs::read(&parquet).unwrap();
    let name = display_name_of_bytes("/dev/stdin", &bytes);
    let missing = SignalRecording::from_bytes(&bytes, &name, &options()).unwrap();
    let missing = missing.column("motor").unwrap_err().to_string();
    assert!(
        missing.contains("/dev/stdin (Parquet), row 8: column `motor`"),
        "{missing}"
    );
    assert_eq!(display_name_of_bytes("/dev/stdin", b"t,q\n"), "/dev/stdin");
    let broken = bytes;
    let broken = &broken[..broken.len() / 2];
    for says in [
        SignalRecording::names_in_bytes(broken, "-").unwrap_err().to_string(),
        SignalRecording::from_bytes(b"MATLAB 7.3 MAT-file, Platform", "-", &options())
            .unwrap_err()
            .to_string(),
    ] {
        assert!(says.starts_with("-: this is a"), "{says}");
    }
}

#[test]
fn only_the_time_that_is_asked_for_is_read() {
    let path = scratch("between.parquet");
    write_parquet(&path, Compression::SNAPPY);
    let part = |between| {
        SignalRecording::read_with(
            &path,
            &ReadOptions {
                time_interval: Some(between),
                max_numbers: 40_004,
                ..options()
            },
        )
    };
    let recording = part((2.0, 12.0)).unwrap();
    assert!((9_999..=10_001).contains(&recording.samples()));
    assert!(recording.notes()[0].says.in_library_words().contains("time stamps"));
    assert!(
        recording.notes()[1]
            .says
            .in_library_words()
            .contains("from t = 2 s to 12 s are read; 2000 samples before")
    );
    assert_eq!(
        part((30.0, 40.0)).unwrap_err().fault,
        RecordingFault::NoSamplesInInterval { from: 30.0, to: 40.0 }
    );
    let says = part((0.0, 20.0)).unwrap_err().to_string();
    assert!(
        says.contains("too large to be kept in memory") && says.contains("option `between` = `0,10`"),
        "{says}"
    );
}

#[test]
fn broken_files_get_an_answer() {
    let path = scratch("broken.parquet");
    write_parquet(&path, Compression::SNAPPY);
    let bytes = std::fs::read(&path).unwrap();
    for length in [4, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let says = SignalRecording::read_with(&path, &options()).unwrap_err().to_string();
        assert!(says.contains("this is a Parquet file: it cannot be read"), "{says}");
    }
    let path = scratch("broken.mat");
    let bytes = std::fs::read(fixture("run-v7.mat")).unwrap();
    for length in [40, 130, bytes.len() / 2] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let says = SignalRecording::read(&path, &[]).unwrap_err().to_string();
        assert!(says.contains("this is a MATLAB file"), "{says}");
    }
    std::fs::write(&path, b"MATLAB 7.3 MAT-file, Platform: GLNXA64").unwrap();
    let says = SignalRecording::read(&path, &[]).unwrap_err().to_string();
    assert!(says.contains("is it complete"), "{says}");
}

/// Both files were written by scipy 1.17, the one with compressed and upright arrays, the other with arrays that lie.
#[test]
fn matlab_files_give_vectors_and_columns_of_matrices() {
    for name in ["run-v7.mat", "run-v6.mat"] {
        let recording = SignalRecording::read(fixture(name), &[("q1", "q_1"), ("motor", "F")]).unwrap();
        assert_eq!(recording.samples(), 50, "{name}");
        for k in [0, 1, 49] {
            let t = k as f64 * 0.01;
            for (column, expected) in [
                ("t", t),
                ("q1", t.sin()),
                ("q_2", (2.0 * t).cos()),
                ("motor", 3.0 * k as f64),
            ] {
                let value = recording.column(column).unwrap()[k];
                assert!((value - expected).abs() < 1e-12, "{name}: {column} is {value}");
            }
        }
    }
    let recording = SignalRecording::read(fixture("run-v7.mat"), &[]).unwrap();
    let says = recording.notes()[0].says.in_library_words();
    assert!(says.contains("`gain`") && !says.contains("`z`"), "{says}");
    // Complex numbers are refused as such, not read by their real parts.
    let says = recording.column("z").unwrap_err().to_string();
    assert!(says.contains("`z`") && says.contains("a complex number"), "{says}");
}

#[test]
fn sums_of_columns_are_computed_and_keep_their_faults() {
    let text = "t,a,b\n0,1,10\n1,2,NaN\n2,3,30\n";
    let read = |terms: &[(&str, f64)], not_finite| {
        let options = ReadOptions {
            computed: vec![ComputedColumn {
                name: "a".to_owned(),
                terms: terms.iter().map(|(name, f)| ((*name).to_owned(), *f)).collect(),
                offset: 0.5,
            }],
            not_finite,
            wanted: Some(vec!["t".to_owned(), "a".to_owned()]),
            ..ReadOptions::default()
        };
        SignalRecording::from_reader(text.as_bytes(), "run.csv", &options)
    };
    let own = read(&[("a", 2.0)], NonFinitePolicy::Refuse).unwrap();
    assert_eq!(own.column("a").unwrap(), [2.5, 4.5, 6.5]);
    let sum = read(&[("a", 2.0), ("b", -1.0)], NonFinitePolicy::Refuse).unwrap();
    assert!(sum.column("a").unwrap_err().to_string().contains("line 3"));
    let left = read(&[("a", 2.0), ("b", -1.0)], NonFinitePolicy::LeaveOut).unwrap();
    assert_eq!(left.column("a").unwrap(), [-7.5, -23.5]);
    assert!(read(&[("c", 1.0)], NonFinitePolicy::Refuse).is_err());
}

/// Half floats of pyarrow: two bytes with the logical type FLOAT16.
#[test]
fn half_floats_of_parquet_are_numbers() {
    let schema = parse_message_type(
        "message run { required double t; optional fixed_len_byte_array(2) q (FLOAT16); \
         required fixed_len_byte_array(2) raw; }",
    )
    .expect("a schema");
    let path = scratch("half.parquet");
    let file = File::create(&path).expect("a writable folder");
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), properties).expect("a writer");
    let mut columns = writer.next_row_group().expect("a row group");
    let mut column = columns.next_column().expect("no fault").expect("a column");
    column
        .typed::<DoubleType>()
        .write_batch(&[0.0, 0.1, 0.2], None, None)
        .expect("written");
    column.close().expect("closed");
    // 1.5, -2 and the smallest number above zero, in IEEE 754 binary16.
    let halves: Vec<_> = [0x3e00_u16, 0xc000, 0x0001]
        .map(|bits| FixedLenByteArray::from(bits.to_le_bytes().to_vec()))
        .into();
    for levels in [Some([1_i16; 3]), None] {
        let mut column = columns.next_column().expect("no fault").expect("a column");
        column
            .typed::<FixedLenByteArrayType>()
            .write_batch(&halves, levels.as_ref().map(<[i16; 3]>::as_slice), None)
            .expect("written");
        column.close().expect("closed");
    }
    columns.close().expect("closed");
    writer.close().expect("closed");
    let recording = SignalRecording::read_with(&path, &ReadOptions::default()).unwrap();
    for (k, value) in [1.5, -2.0, 2_f64.powi(-24)].into_iter().enumerate() {
        assert!((recording.column("q").unwrap()[k] - value).abs() < 1e-15);
    }
    // Two bytes without that type have no meaning.
    assert!(recording.column("raw").is_err());
}

/// A file with many datasets is listed in a time that grows with their number.
#[test]
fn hdf5_files_of_many_datasets_and_groups_are_read() {
    let mut builder = hdf5_pure::FileBuilder::new();
    let numbers: Vec<f64> = (0..20).map(f64::from).collect();
    for k in 0..2000 {
        builder.create_dataset(&format!("x{k}")).with_f64_data(&numbers);
        let mut group = builder.create_group(&format!("g{k}"));
        group.create_dataset("y").with_f64_data(&numbers);
        builder.add_group(group.finish());
    }
    let path = scratch("many.h5");
    std::fs::write(&path, builder.finish().expect("a file")).expect("a writable folder");
    let start = std::time::Instant::now();
    let names = SignalRecording::names_in(&path).unwrap();
    assert_eq!(names.len(), 4000);
    assert!(start.elapsed().as_secs() < 4, "{:?}", start.elapsed());
    let recording = SignalRecording::read_with(
        &path,
        &ReadOptions {
            wanted: Some(vec!["x7".to_owned(), "g1999.y".to_owned()]),
            ..ReadOptions::default()
        },
    )
    .unwrap();
    assert_eq!(recording.column("g1999.y").unwrap(), numbers);
}

/// Files whose stated sizes are lies are refused before memory is reserved for them.
#[test]
fn hdf5_chunks_beyond_the_end_of_the_file_are_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/hostile");
    if !folder.is_dir() {
        println!("skipped: there is no folder shared/data/hostile");
        return;
    }
    let path = folder.join("hdf5-panic.h5");
    let fault = SignalRecording::read_with(&path, &ReadOptions::default()).unwrap_err();
    assert!(fault.to_string().contains("it is damaged or incomplete"), "{fault}");
}

/// A soft link in a group of the older layout has no address, and the library cannot pass over it.
#[test]
fn hdf5_files_with_soft_links_of_the_older_layout_are_refused_by_their_cause() {
    let fault = SignalRecording::read_with(fixture("soft-link.h5"), &ReadOptions::default()).unwrap_err();
    let says = fault.to_string();
    assert!(
        says.contains("soft or external link") && !says.contains("complete"),
        "{says}"
    );
}

/// A column of text can be one byte, but takes some hundred in memory.
#[test]
fn text_with_very_many_columns_is_refused() {
    let read = |n: usize| {
        let names: Vec<String> = (0..n).map(|k| format!("c{k}")).collect();
        let text = format!("{}\n{}\n", names.join(","), vec!["1"; n].join(","));
        let options = ReadOptions {
            wanted: Some(vec!["c7".to_owned()]),
            ..ReadOptions::default()
        };
        SignalRecording::from_bytes(text.as_bytes(), "wide.csv", &options)
    };
    assert_eq!(read(20_000).unwrap().column("c7").unwrap(), [1.0]);
    for text in [
        ",".repeat(70_000),
        ";".repeat(70_000),
        "1,".repeat(70_000),
        "a\n".to_owned() + &",".repeat(70_000),
    ] {
        let fault = SignalRecording::from_bytes(text.as_bytes(), "wide.csv", &ReadOptions::default()).unwrap_err();
        assert!(fault.to_string().contains("more than 65536 columns"), "{fault}");
    }
    assert!(
        read(70_000)
            .unwrap_err()
            .to_string()
            .contains("more than 65536 columns")
    );
}
