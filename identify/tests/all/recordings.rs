//! Recordings as users have them: faulty ones get an answer with the place and the remedy, sound
//! ones give the states they hold.

use std::fmt::Write as _;

use modelmill_identify::{
    DerivativeSource, NonFinitePolicy, NoteSeverity, ReadOptions, RecordingError, RecordingFault, SignalRecording,
    StatePreparation,
};

fn read(text: &str) -> Result<SignalRecording, RecordingError> {
    SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default())
}

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|name| (*name).to_owned()).collect()
}

#[track_caller]
fn check_refused(text: &str, expected: &str) {
    assert_eq!(read(text).expect_err("the recording is faulty").to_string(), expected);
}

#[test]
fn files_that_are_no_recordings() {
    check_refused(
        "",
        "run.csv: the recording is empty; a header line and one line per sample are expected",
    );
    check_refused(
        "\n \r\n",
        "run.csv: the recording is empty; a header line and one line per sample are expected",
    );
    check_refused(
        "t,q\n",
        "run.csv: there is a header but no sample; one line of numbers per sample is expected",
    );
    check_refused(
        "t q force\n0,1,2\n",
        "run.csv, line 1: the separator of the columns is not clear in `t q force`; separate all lines by a comma, or all \
         by `;`, a tab or blanks",
    );
    check_refused(
        "PAR1\u{1}\u{2}",
        "run.csv: this looks like a Parquet file, not like a recording; save it as CSV (UTF-8, with a header), Parquet, HDF5, MCAP or a MATLAB file",
    );
    let utf16: Vec<u8> = std::iter::once(0xFEFF)
        .chain("t,q\n0,1\n".encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let error = SignalRecording::from_reader(utf16.as_slice(), "run.csv", &ReadOptions::default()).unwrap_err();
    assert_eq!(
        error.fault,
        RecordingFault::NotCsv {
            looks_like: "UTF-16 text"
        }
    );
    let error = SignalRecording::from_reader([b't', b',', 0xE9, b'\n'].as_slice(), "run.csv", &ReadOptions::default());
    assert!(error.unwrap_err().to_string().contains("another encoding than UTF-8"));
    let missing = SignalRecording::read("no/such/run.csv", &[]).unwrap_err().to_string();
    assert!(
        missing.starts_with("no/such/run.csv: the recording cannot be read:"),
        "{missing}"
    );
    let folder = SignalRecording::read(env!("CARGO_MANIFEST_DIR"), &[])
        .unwrap_err()
        .to_string();
    assert!(folder.contains("a folder, not a file"), "{folder}");
}

#[test]
fn faults_of_header_and_lines() {
    check_refused(
        "t,q,t\n0,1,2\n",
        "run.csv: columns 1 and 3 are both called `t`; give every column a name of its own",
    );
    check_refused(
        "t,q,\n0,1,\n",
        "run.csv: column 3 has no name; name it, or remove a separator at the end of the lines",
    );
    check_refused(
        "t,q\n0,1\n\n0.1,1,5\n",
        "run.csv, line 4: 3 fields where the header has 2; complete or remove the line",
    );
    check_refused(
        "t,q\n0\n",
        "run.csv, line 2: 1 field where the header has 2; complete or remove the line",
    );
}

#[test]
fn a_quote_left_open_is_named_where_it_opens() {
    let check = |text: &str, line: u64| {
        let error = read(text).expect_err("the recording is faulty");
        assert_eq!(error.fault, RecordingFault::OpenQuote { line }, "{text:?}: {error}");
        assert!(
            error.to_string().starts_with(&format!(
                "run.csv, line {line}: a quote opens here, but the field that it begins does not end in the same line;"
            )),
            "{error}"
        );
    };
    // To the end of the text, with and without an end of its last line.
    check("t,q,f\n0,1,2\n\n0.1,\"1,2\n0.2,1,2\n0.3,1,2\n", 4);
    check("t,q,f\n0,1,2\n\n0.1,\"1,2\n0.2,1,2\n0.3,1,2", 4);
    check("t,q,f\n0,1,2\n0.1,1,2\n0.2,1,\"2\n", 4);
    // To the next quote, so that fields are missing, or are no numbers.
    check(
        "t,q,f\r\n0,1,2\r\n0.1,\"1,2\r\n0.2,1\",2\r\n0.3,1\r\n0.4,\"1\",2\r\n",
        3,
    );
    check("t,q,f\n0,1,2\n0.1,\"1\n\n0.2\",2,1\n0.3,1,2\n", 3);
    // In the header, below a blank line.
    check("\nt,\"q,f\n0,1,2\n", 2);
    // A remark of two lines in a column that nobody asks for is no fault.
    let text = "t,q,remark\n0,1,\"it\nbegins\"\n0.1,\" 2 \",\n";
    let options = ReadOptions {
        wanted: Some(names(&["t", "q"])),
        ..ReadOptions::default()
    };
    let recording = SignalRecording::from_reader(text.as_bytes(), "run.csv", &options).unwrap();
    assert_eq!(recording.column("q").unwrap(), [1.0, 2.0]);
    assert_eq!(recording.line(1), Some(4));
}

#[test]
fn a_column_with_other_things_than_numbers_is_refused_when_it_is_used() {
    let recording = read("t,q,f,remark\n0,1,NaN,start\n0.1,abc,2,\n0.2,x,inf,end\n0.3,4,,\n").unwrap();
    assert_eq!(recording.column("t").unwrap(), [0.0, 0.1, 0.2, 0.3]);
    assert_eq!(
        recording.column("q").unwrap_err().to_string(),
        "run.csv, line 3: column `q` contains `abc` where a number is expected \
         (2 fields of the column are not numbers); correct or remove it"
    );
    assert_eq!(
        recording.column("f").unwrap_err().to_string(),
        "run.csv, line 2: column `f` contains `NaN` where a finite number is expected \
         (3 fields of the column are not finite or empty); \
         repair the recording, or leave such samples out with option `skip_bad_samples` (they are counted)"
    );
    let says: Vec<String> = recording
        .notes()
        .iter()
        .map(|note| note.says.in_library_words())
        .collect();
    assert!(
        says.iter()
            .any(|s| { s.contains("Column `remark` of run.csv contains text that is not a number (2 fields") })
    );
    let decimal_comma = read("t;q\n0;1.5\n1;1,6\n").unwrap();
    assert!(
        decimal_comma
            .column("q")
            .unwrap_err()
            .to_string()
            .ends_with("write decimals with a point")
    );
}

#[test]
fn samples_left_out_are_counted() {
    let options = ReadOptions {
        not_finite: NonFinitePolicy::LeaveOut,
        ..ReadOptions::default()
    };
    let text = "t,q\n0,1\n0.1,NaN\n0.2,2\n0.3,\n0.4,5\n";
    let recording = SignalRecording::from_reader(text.as_bytes(), "run.csv", &options).unwrap();
    assert_eq!(recording.column("q").unwrap(), [1.0, 2.0, 5.0]);
    assert_eq!(recording.line(1), Some(4));
    assert_eq!(
        recording.notes()[0].says.in_library_words(),
        "2 of 5 samples of run.csv contain NaN, infinite or empty fields and are left out, the first in line 3."
    );
}

#[test]
fn renamings_and_missing_columns() {
    let read = |renames: &[(&str, &str)]| {
        let renames = renames
            .iter()
            .map(|(ours, theirs)| ((*ours).to_owned(), (*theirs).to_owned()))
            .collect();
        let text = "t_s,theta1,F_left\n0,1,2\n0.1,2,3\n";
        SignalRecording::from_reader(
            text.as_bytes(),
            "run.csv",
            &ReadOptions {
                renames,
                ..ReadOptions::default()
            },
        )
    };
    let recording = read(&[("t", "t_s"), ("spindle_left", "F_left")]).unwrap();
    assert_eq!(recording.names().collect::<Vec<_>>(), ["t", "theta1", "spindle_left"]);
    assert_eq!(
        read(&[]).unwrap().column("t").unwrap_err().to_string(),
        "run.csv: there is no column `t`; did you mean `t_s`? The columns are: `t_s`, `theta1`, `F_left`. \
         Assign one of them with option `columns` = `t=t_s`."
    );
    assert_eq!(
        read(&[("spindle_left", "F_lefd")]).unwrap_err().to_string(),
        "run.csv: a mapping names the column `F_lefd`, which does not exist; did you mean `F_left`? \
         The columns are: `t_s`, `theta1`, `F_left`. A mapping has the form option `columns` = `NAME=COLUMN`."
    );
    assert!(
        read(&[("theta1", "F_left")])
            .unwrap_err()
            .to_string()
            .contains("a mapping causes this")
    );
    assert!(matches!(
        read(&[("a", "t_s"), ("a", "F_left")]).unwrap_err().fault,
        RecordingFault::DuplicateRenaming { .. }
    ));
    assert!(matches!(
        read(&[("a", "t_s"), ("b", "t_s")]).unwrap_err().fault,
        RecordingFault::DuplicateRenaming { .. }
    ));
}

#[test]
fn marks_line_ends_and_separators_of_other_programs() {
    for text in [
        "\u{feff}t,q\r\n0,1\r\n0.1,2\r\n",
        "t;q\n0;1\n0.1;2\n",
        "t\tq\n0\t1\n0.1\t2",
        "\"t\",\"q\"\n 0 , 1 \n+1e-1, 2.0\n\n",
    ] {
        let recording = read(text).unwrap();
        assert_eq!(recording.names().collect::<Vec<_>>(), ["t", "q"], "{text:?}");
        assert_eq!(recording.column("q").unwrap(), [1.0, 2.0], "{text:?}");
    }
}

#[test]
fn recorded_derivatives_are_taken_as_they_are() {
    let text = "t,q,q_d,q_dd,drive\n0,1,10,100,5\n0.1,2,20,200,6\n0.2,3,30,300,7\n";
    let run = read(text).unwrap().states(&names(&["q"]), &names(&["drive"])).unwrap();
    assert_eq!((run.samples(), run.prepared.cutoff_hz), (3, None));
    assert_eq!((run.q[0][1], run.qd[0][1], run.qdd[0][1]), (2.0, 20.0, 200.0));
    assert_eq!(run.measured_interleaved().unwrap(), [5.0, 6.0, 7.0]);
    assert!(run.notes.is_empty());
}

#[test]
fn a_force_may_be_missing_until_it_is_needed() {
    let text = "t,q,q_d,q_dd,left\n0,1,10,100,5\n0.1,2,20,200,6\n";
    let run = read(text)
        .unwrap()
        .states(&names(&["q"]), &names(&["left", "right"]))
        .unwrap();
    assert!(run.force.is_none());
    assert_eq!(
        run.measured_forces().unwrap_err().to_string(),
        "run.csv: the measured force of `right` is needed, but there is no such column; \
         assign a column with option `columns` = `right=COLUMN`"
    );
}

#[test]
fn time_must_increase_and_gaps_are_said() {
    let back = read("t,q,q_d,q_dd\n0,1,1,1\n0.1,1,1,1\n0.1,1,1,1\n").unwrap();
    assert_eq!(
        back.states(&names(&["q"]), &[]).unwrap_err().to_string(),
        "run.csv, line 4: time goes from 0.1 s to 0.1 s, but must increase from sample to sample; \
         remove repeated samples, or split the file where the clock was reset"
    );
    let gap = read("t,q,q_d,q_dd\n0,1,1,1\n0.1,2,1,1\n0.2,3,1,1\n0.5,4,1,1\n0.6,5,1,1\n").unwrap();
    let run = gap.states(&names(&["q"]), &[]).unwrap();
    assert_eq!(run.notes[0].severity, NoteSeverity::Warning);
    assert!(
        run.notes[0].says.in_library_words().contains("1 gap ")
            && run.notes[0].says.in_library_words().contains("after line 4"),
        "{}",
        run.notes[0].says.in_library_words()
    );
}

/// `sin` at 200 Hz in 400 samples, with the columns asked for.
fn sine(columns: &[&str]) -> SignalRecording {
    let mut text = format!("t,{}\n", columns.join(","));
    for i in 0..400 {
        let t = 0.005 * f64::from(i);
        text += &t.to_string();
        for column in columns {
            let value = match *column {
                "q" => (4.0 * t).sin(),
                "q_d" => 4.0 * (4.0 * t).cos(),
                "q_dd" => -16.0 * (4.0 * t).sin(),
                _ => 1.0,
            };
            write!(text, ",{value}").unwrap();
        }
        text.push('\n');
    }
    read(&text).expect("a sound recording")
}

#[test]
fn missing_derivatives_are_prepared_and_said() {
    let truth = sine(&["q", "q_d", "q_dd"]).states(&names(&["q"]), &[]).unwrap();
    for columns in [&["q", "drive"][..], &["q", "q_d"], &["q", "q_dd"]] {
        let run = sine(columns).states(&names(&["q"]), &[]).unwrap();
        let (start, end) = run.prepared.trimmed;
        assert!(start > 0 && run.samples() == 400 - start - end);
        assert!(run.prepared.cutoff_chosen);
        assert!(
            run.notes
                .iter()
                .any(|note| note.says.in_library_words().contains("chosen from the signal")),
            "{:?}",
            run.notes
        );
        assert!(
            run.notes
                .iter()
                .any(|note| note.says.in_library_words().contains("are dropped"))
        );
        let middle = 50..350 - start;
        for i in middle {
            assert!((run.q[0][i] - truth.q[0][i + start]).abs() < 1e-3);
            assert!((run.qd[0][i] - truth.qd[0][i + start]).abs() < 4e-3);
            assert!(
                (run.qdd[0][i] - truth.qdd[0][i + start]).abs() < 1.6e-2,
                "{columns:?}, sample {i}"
            );
        }
    }
}

#[test]
fn a_preparation_of_ones_own_is_kept_to() {
    let preparation = StatePreparation {
        cutoff_hz: Some(30.0),
        trim: Some((7, 3)),
        decimate: 5,
        source: DerivativeSource::Positions,
        ..StatePreparation::default()
    };
    let run = sine(&["q", "q_d", "q_dd"])
        .states_with(&names(&["q"]), &[], &preparation)
        .unwrap();
    assert_eq!(
        (run.prepared.cutoff_hz, run.prepared.trimmed, run.prepared.decimate),
        (Some(30.0), (7, 3), 5)
    );
    assert_eq!(run.samples(), 390);
    assert!((run.time[0] - 0.035).abs() < 1e-12);
    let bad = StatePreparation {
        cutoff_hz: Some(150.0),
        ..preparation.clone()
    };
    let error = sine(&["q"])
        .states_with(&names(&["q"]), &[], &bad)
        .unwrap_err()
        .to_string();
    assert!(error.contains("150 Hz") && error.contains("below 100"), "{error}");
    let bad = StatePreparation {
        trim: Some((usize::MAX, 1)),
        ..preparation
    };
    assert!(
        sine(&["q"])
            .states_with(&names(&["q"]), &[], &bad)
            .unwrap_err()
            .to_string()
            .contains("option `trim`")
    );
    let bad = StatePreparation {
        cutoff_hz: Some(1e-9),
        ..bad
    };
    let error = sine(&["q"])
        .states_with(&names(&["q"]), &[], &bad)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("0.000000001 Hz is too low") && error.contains("above 0.5000 Hz"),
        "{error}"
    );
}

#[test]
fn short_and_still_recordings_get_an_answer() {
    let two = read("t,q\n0,1\n0.1,2\n").unwrap();
    assert_eq!(
        two.states(&names(&["q"]), &[]).unwrap_err().to_string(),
        "run.csv: 2 samples are too few for preparing derivatives from positions, which takes at least 16; \
         use a longer recording"
    );
    assert!(read("t,q\n0,1\n").unwrap().states(&names(&["q"]), &[]).is_err());
    let still = sine(&["still"]).states(&names(&["still"]), &[]).unwrap();
    assert!(
        still
            .notes
            .iter()
            .any(|note| note.says.in_library_words().contains("`still` does not move")),
        "{:?}",
        still.notes
    );
    assert!(still.qd[0].iter().all(|v| v.abs() < 1e-9));
}

/// Ten thousand mutilated recordings: an answer each, no panic.
#[test]
fn mutilated_recordings_get_an_answer() {
    let sound = b"\xEF\xBB\xBFt,q,drive\r\n0,1,2\r\n0.1,1.5,2e3\r\n0.2,-1,\"3\"\r\n0.3,NaN,inf\r\n".to_vec();
    let pieces: [&[u8]; 12] = [
        b",", b";", b"\t", b"\r", b"\n", b"\"", b"NaN", b"1e400", b"-", b"\0", b"\xFF", b"t",
    ];
    let mut seed = 1_u64;
    let mut draw = |bound: usize| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(seed >> 33).expect("31 bits") % bound
    };
    let mut read_well = 0;
    for _ in 0..10_000 {
        let mut bytes = sound.clone();
        for _ in 0..=draw(4) {
            let place = draw(bytes.len());
            match draw(3) {
                0 => drop(bytes.splice(place..place, pieces[draw(pieces.len())].iter().copied())),
                1 => drop(bytes.drain(place..(place + 1 + draw(6)).min(bytes.len()))),
                _ => bytes.truncate(place + 1),
            }
            if bytes.is_empty() {
                bytes.push(b't');
            }
        }
        let not_finite = if draw(2) == 0 {
            NonFinitePolicy::Refuse
        } else {
            NonFinitePolicy::LeaveOut
        };
        let options = ReadOptions {
            renames: Vec::new(),
            not_finite,
            ..ReadOptions::default()
        };
        match SignalRecording::from_reader(bytes.as_slice(), "run.csv", &options) {
            Ok(recording) => {
                read_well += 1;
                let _ = recording
                    .states(&names(&["q"]), &names(&["drive"]))
                    .map_err(|error| error.to_string());
            }
            Err(error) => assert!(error.to_string().len() > 30),
        }
    }
    assert!(read_well > 100);
}
