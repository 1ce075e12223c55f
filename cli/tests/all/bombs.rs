//! Small files that unpack to much, and streams that never end, under an address space of 1 GB: all of them are refused
//! by name, and nothing aborts.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use crate::common::model;

/// A new folder for one test.
fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bombs").join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

fn text(path: &Path) -> String {
    path.to_str().expect("plain text").to_owned()
}

/// The program with 1 GB of addresses, which threads and the program itself come out of too. `first` runs in the shell
/// before it.
fn confined(first: &str, args: &[&str]) -> Output {
    Command::new("sh")
        .args(["-c", &format!("ulimit -v 1048576 || exit 77; {first} \"$0\" \"$@\"")])
        .arg(env!("CARGO_BIN_EXE_modelmill"))
        .args(args)
        .stdin(Stdio::null())
        .output()
        .expect("a shell")
}

/// Holds a refusal: an answer of the program rather than of the system, which names what it is about.
#[track_caller]
fn refused(output: &Output, words: &[&str]) {
    let err = String::from_utf8_lossy(&output.stderr);
    // A command that a signal ended has a larger status in a shell.
    assert!(
        matches!(output.status.code(), Some(1 | 2)),
        "{:?}: {err}",
        output.status
    );
    assert!(err.contains("error"), "{err}");
    for word in words {
        assert!(err.contains(word), "{word}: {err}");
    }
}

/// An element of a MATLAB file: a tag and its bytes, padded.
fn element(kind: u32, bytes: &[u8]) -> Vec<u8> {
    let length = u32::try_from(bytes.len()).expect("short");
    let mut out = [kind.to_le_bytes(), length.to_le_bytes()].concat();
    out.extend(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A compressed column of zeros, each stored as one byte, that says it has so many rows.
fn zeros(name: &str, rows: u32, stored: u32) -> Vec<u8> {
    const DOUBLE: u32 = 6;
    const BLOCK: u32 = 1 << 20;
    let mut matrix = element(6, &[DOUBLE.to_le_bytes(), [0; 4]].concat());
    matrix.extend(element(5, &[rows.to_le_bytes(), 1_u32.to_le_bytes()].concat()));
    matrix.extend(element(1, name.as_bytes()));
    matrix.extend([2_u32.to_le_bytes(), stored.to_le_bytes()].concat());
    let length = u32::try_from(matrix.len()).expect("short") + stored;
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    let block = vec![0; BLOCK as usize];
    encoder
        .write_all(&[14_u32.to_le_bytes(), length.to_le_bytes()].concat())
        .expect("packed");
    encoder.write_all(&matrix).expect("packed");
    let mut ends = Vec::new();
    for _ in 0..3 {
        encoder.write_all(&block).expect("packed");
        encoder.flush().expect("packed");
        ends.push(encoder.get_ref().len());
    }
    // Blocks of zeros behind zeros are alike, so that none needs to be packed again.
    let mut packed = encoder.get_ref()[..ends[1]].to_vec();
    let again = encoder.get_ref()[ends[1]..ends[2]].to_vec();
    for _ in 2..stored / BLOCK {
        packed.extend(&again);
    }
    let length = u32::try_from(packed.len()).expect("short");
    [15_u32.to_le_bytes(), length.to_le_bytes()]
        .concat()
        .into_iter()
        .chain(packed)
        .collect()
}

fn matlab(path: &Path, columns: &[Vec<u8>]) {
    let mut bytes = b"MATLAB 5.0 MAT-file".to_vec();
    bytes.resize(124, b' ');
    bytes.extend([0, 1, b'I', b'M']);
    bytes.extend(columns.concat());
    assert!(bytes.len() < 4_000_000, "{} bytes", bytes.len());
    std::fs::write(path, bytes).expect("written");
}

/// 1.2 thousand million zeros per column are 9.4 GB as numbers.
#[test]
fn a_matlab_file_that_unpacks_to_gigabytes_is_refused() {
    let folder = folder("matlab");
    let two_link = model("two_link.toml");
    let rows = 1_175 << 20;
    let names = ["t", "q1", "q2"];
    let large = folder.join("large.mat");
    matlab(&large, &names.map(|name| zeros(name, rows, rows)));
    // One that says it is small, and is not.
    let lies = folder.join("lies.mat");
    matlab(&lies, &names.map(|name| zeros(name, 1000, rows)));
    for (path, word) in [(&large, "too large"), (&lies, "lies.mat")] {
        let path = text(path);
        let name = path.rsplit('/').next().expect("a name");
        let compare = ["compare", &two_link, "--data", &path];
        refused(&confined("exec", &compare), &[name, word]);
        let piped = ["compare", &two_link, "--data", "/dev/stdin"];
        refused(&confined(&format!("cat '{path}' |"), &piped), &["/dev/stdin"]);
    }
}

/// A Parquet file of columns `t` and `q1` with zeros.
fn parquet(path: &Path, rows: usize, has_dictionary: bool) {
    let schema = parse_message_type("message run { required double t; required double q1; }").expect("a schema");
    let properties = WriterProperties::builder()
        .set_compression(parquet::basic::Compression::GZIP(parquet::basic::GzipLevel::default()))
        .set_dictionary_enabled(has_dictionary)
        .set_data_page_size_limit(usize::MAX)
        .set_data_page_row_count_limit(usize::MAX)
        .set_statistics_enabled(parquet::file::properties::EnabledStatistics::None)
        .build();
    let file = File::create(path).expect("a file");
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).expect("a writer");
    let zeros = vec![0.0; 1 << 20];
    let mut group = writer.next_row_group().expect("a group");
    while let Some(mut column) = group.next_column().expect("a column") {
        for from in (0..rows).step_by(zeros.len()) {
            let n = zeros.len().min(rows - from);
            column
                .typed::<DoubleType>()
                .write_batch(&zeros[..n], None, None)
                .expect("written");
        }
        column.close().expect("closed");
    }
    group.close().expect("closed");
    writer.close().expect("closed");
    assert!(path.metadata().expect("a file").len() < 4_000_000);
}

#[test]
fn a_parquet_file_that_unpacks_to_gigabytes_is_refused() {
    let folder = folder("parquet");
    let two_link = model("two_link.toml");
    // Pages larger than any writer makes.
    let pages = folder.join("pages.parquet");
    parquet(&pages, 20 << 20, false);
    // Small pages that stand for more samples than memory holds, since they say a value and how often it comes.
    let runs = folder.join("runs.parquet");
    parquet(&runs, 40 << 20, true);
    for (path, word) in [(pages, "Parquet"), (runs, "too large to be kept in memory")] {
        let path = text(&path);
        let name = path.rsplit('/').next().expect("a name");
        let args = ["compare", &two_link, "--data", &path];
        refused(&confined("exec", &args), &[name, word]);
    }
}

/// Blocks of zstd that say a byte and how often it comes: 4 bytes for 128 KB.
fn runs_of_zstd(n: u32, head: &[u8], byte: u8) -> Vec<u8> {
    let mut bytes = vec![0x28, 0xB5, 0x2F, 0xFD, 0, 0x58];
    let block = |length: u32, kind: u32, last: bool| {
        let header = length << 3 | kind << 1 | u32::from(last);
        header.to_le_bytes()[..3].to_vec()
    };
    bytes.extend(block(u32::try_from(head.len()).expect("short"), 0, false));
    bytes.extend(head);
    for i in 0..n {
        bytes.extend(block(128 << 10, 1, i + 1 == n));
        bytes.push(byte);
    }
    bytes
}

/// 25 GB of text in 800 KB.
#[test]
fn packed_text_that_unpacks_to_gigabytes_is_refused() {
    let folder = folder("packed");
    let two_link = model("two_link.toml");
    let path = folder.join("lines.csv.zst");
    let head = b"t,q1,q2,joint1,joint2\n";
    std::fs::write(&path, runs_of_zstd(200_000, head, b'\n')).expect("written");
    let args = ["compare", &two_link, "--data", &text(&path)];
    refused(&confined("exec", &args), &["lines.csv.zst", "two hundred times"]);
}

/// A record of MCAP: kind, length, content.
fn record(kind: u8, bytes: &[u8]) -> Vec<u8> {
    let length = bytes.len() as u64;
    [&[kind], &length.to_le_bytes()[..], bytes].concat()
}

#[test]
fn a_log_that_lies_of_its_size_is_refused() {
    let folder = folder("mcap");
    let two_link = model("two_link.toml");
    let text_of = |text: &[u8]| [&u32::try_from(text.len()).expect("short").to_le_bytes(), text].concat();
    let chunk = |says: u64| {
        let packed = runs_of_zstd(1024, b"", 0);
        let fields = [
            vec![0; 16],
            says.to_le_bytes().to_vec(),
            vec![0; 4],
            text_of(b"zstd"),
            (packed.len() as u64).to_le_bytes().to_vec(),
            packed,
        ];
        record(6, &fields.concat())
    };
    let log = |chunks: Vec<u8>| [b"\x89MCAP0\r\n".to_vec(), record(1, &[0; 8]), chunks].concat();
    let mut endless = log(Vec::new());
    endless.push(6);
    endless.extend((1_u64 << 60).to_le_bytes());
    for (name, bytes, word) in [
        ("many.mcap", log(chunk(128 << 20).repeat(100)), "two hundred times"),
        ("more.mcap", log(chunk(1000)), "more than the file declares"),
        ("long.mcap", endless, "larger than 128 MB"),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("written");
        let args = ["compare", &two_link, "--data", &text(&path)];
        refused(&confined("exec", &args), &[name, word]);
    }
}

/// A million million samples, and a chunk of 2 GB, in some kilobytes.
#[test]
fn an_hdf5_file_that_says_to_be_large_is_refused() {
    let two_link = model("two_link.toml");
    for (name, word) in [("bomb-long.h5", "too large"), ("bomb-chunk.h5", "smaller ones")] {
        let path = crate::common::workspace("identify/tests/fixtures").join(name);
        let args = ["compare", &two_link, "--data", &text(&path)];
        refused(&confined("exec", &args), &[name, word]);
    }
}

/// Says a text again and again into a named pipe, for as long as somebody listens.
struct Endless {
    pipe: PathBuf,
    writer: Child,
}

impl Endless {
    fn new(folder: &Path, says: &str) -> Self {
        // A name of its own for each text.
        let pipe = folder.join(says.replace(|c: char| !c.is_ascii_alphanumeric(), "-") + "-pipe");
        assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
        let writer = Command::new("sh")
            .args(["-c", "exec yes \"$1\" > \"$0\""])
            .arg(&pipe)
            .arg(says)
            .stderr(Stdio::null())
            .spawn()
            .expect("a shell");
        Self { pipe, writer }
    }
}

impl Drop for Endless {
    fn drop(&mut self) {
        let _ = self.writer.kill();
        let _ = self.writer.wait();
    }
}

#[test]
fn streams_without_an_end_are_refused() {
    let folder = folder("endless");
    let two_link = model("two_link.toml");
    let out = text(&folder.join("out.toml"));
    // A model, by all ways in which it can come.
    for from in ["yes |", "cat /dev/zero |", "exec < /dev/zero;", "yes '[a]' |"] {
        refused(&confined(from, &["check", "/dev/stdin"]), &["/dev/stdin"]);
    }
    refused(&confined("yes |", &["check", "-"]), &["/dev/stdin is standard input"]);
    for (says, args) in [
        ("y", &["check", "PIPE"][..]),
        ("yy", &["generate", "PIPE"]),
        ("[[x]]", &["interpret", &two_link, "--unknown", "m1", "--fit", "PIPE"]),
        ("<robot>", &["import", "PIPE", "--out", &out]),
        ("a = 1", &["simulate", "PIPE", "--trajectory", &two_link, "--out", &out]),
        ("# remark", &["effects", "--library", "PIPE"]),
    ] {
        let endless = Endless::new(&folder, says);
        let pipe = text(&endless.pipe);
        let args: Vec<&str> = args
            .iter()
            .map(|arg| if *arg == "PIPE" { pipe.as_str() } else { arg })
            .collect();
        refused(&confined("exec", &args), &["-pipe", "more than", "bytes"]);
    }
    for (key, says) in [("extends", "endless base"), ("library", "endless library")] {
        let endless = Endless::new(&folder, says);
        let variant = folder.join(format!("{key}.toml"));
        std::fs::write(
            &variant,
            format!("schema = 1\nname = \"variant\"\n{key} = {:?}\n", text(&endless.pipe)),
        )
        .expect("written");
        refused(
            &confined("exec", &["check", &text(&variant)]),
            &["-pipe", "more than", "bytes"],
        );
    }
    // A recording, whose cap is larger: an endless one, and one that ends right below the cap and holds the shortest rows.
    let compare = ["compare", &two_link, "--data", "/dev/stdin"];
    let names = "echo t,q1,q2,joint1,joint2";
    refused(
        &confined(&format!("({names}; yes 0,0,0,0,0) |"), &compare),
        &["/dev/stdin", "more than 402653184 bytes"],
    );
    refused(
        &confined("(echo t; yes 1 | head -c 400000000) |", &compare),
        &["/dev/stdin", "too large to be kept in memory"],
    );
}
