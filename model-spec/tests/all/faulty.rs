//! Faulty files: each fixture's whole message is a snapshot, so that every change of a message is seen.

use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use modelmill_boundary::files::{DiskFiles, FileSource, MemoryFiles};
use modelmill_spec::{DiagnosticSeverity, LoadFailure, load};

/// Reads a fixture under the path that messages should show.
fn render(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faulty");
    let text = std::fs::read_to_string(folder.join(name)).unwrap();
    match load(name, &text, &beside(&folder)) {
        Ok(loaded) => format!("(no errors)\n\n{}", loaded.render(false)),
        Err(failure) => failure.render(false),
    }
}

/// The fixtures under their names alone.
fn beside(folder: &Path) -> MemoryFiles {
    let paths = DiskFiles::default().list(folder).unwrap();
    let files = paths.iter().filter(|path| path.is_file());
    files.fold(MemoryFiles::default(), |files, path| {
        files.with_file(path.file_name().unwrap(), std::fs::read(path).unwrap())
    })
}

fn failure(text: &str) -> LoadFailure {
    let start = Instant::now();
    let result = load("model.toml", text, &MemoryFiles::default());
    let took = start.elapsed();
    assert!(took < Duration::from_secs(5), "took {took:?}");
    result.map(|_| ()).expect_err("the file is faulty")
}

#[test]
fn messages() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faulty");
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "toml"))
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert!(names.len() >= 30);
    insta::with_settings!({ snapshot_path => "../snapshots", prepend_module_to_snapshot => false, omit_expression => true }, {
        for name in names {
            let message = render(&name);
            insta::assert_snapshot!(name.trim_end_matches(".toml").to_owned(), message);
        }
    });
}

/// Bytes that are no text are named by line and column; nothing is printed of what cannot be read at all.
#[test]
fn a_file_that_is_no_text_in_utf_8() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("latin.toml");
    std::fs::write(&path, b"schema = 1\nname = \"arm\" # m\xFCde\n").unwrap();
    let found = modelmill_spec::load_file(&path).unwrap_err();
    let says = found.render(false).replace(&*path.to_string_lossy(), "latin.toml");
    insta::assert_snapshot!(says, @r#"
    error: this file is not UTF-8 text
     --> latin.toml:2:17
      |
    2 | name = "arm" # m�de
      |                 ^ the first invalid byte
      |
      = help: save it as UTF-8; `modelmill` reads model files as text (TOML)
    "#);
    let none = modelmill_spec::load_file(Path::new("no/such.toml")).unwrap_err();
    assert_eq!(
        none.render(false),
        "error: cannot read `no/such.toml`: no such file\n  \
         = help: give the path of a model file, such as `model-spec/models/two_link.toml`\n"
    );
}

/// A drive of an unknown joint drives nothing, so that another one on the first coordinate is no second one.
#[test]
fn one_fault_of_a_drive_makes_no_second_one() {
    let text = r#"
schema = 1
name = "arm"
coordinates = { q1 = {}, q2 = {} }
frame = [
    { name = "upper", on = "base", modified_dh = { theta = "q1" } },
    { name = "lower", on = "upper", modified_dh = { a = 0.5, theta = "q2" } },
]
part = [{ on = "upper", linear = { planar = 1 } }, { on = "lower", linear = { planar = 2 } }]
drive = [{ name = "shoulder", joint = "shoulder_joint" }, { name = "elbow", joint = "q1" }]
"#;
    let found = failure(text).diagnostics;
    let says: Vec<&str> = found.iter().map(|one| one.message.as_str()).collect();
    assert_eq!(says, ["unknown name `shoulder_joint`"]);
    let twice = text.replace("shoulder_joint", "q1");
    let says = failure(&twice).render(false);
    assert!(says.contains("two drives act on `q1`"), "{says}");
}

/// Loops that tie every coordinate leave no motion, which one more passive coordinate would not bring about.
#[test]
fn what_cannot_move_is_told_where_to_look() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/four_bar.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let braced = format!(
        "{}\n[[point]]\nname = \"a\"\non = \"body1\"\nat = [0.2, 0.13]\n[[point]]\nname = \"b\"\non = \"body3\"\nat = [0.23, 0.05]\n\
         [[frame]]\nname = \"brace\"\non = \"body1\"\ntransform = {{ xyz = [0.2, 0.13, 0] }}\n\
         joint = {{ revolute = \"extra\", axis = \"z\" }}\n[[point]]\nname = \"c\"\non = \"brace\"\nat = [0.83, 0]\n\
         [[loop]]\njoins = [\"c\", \"b\"]\n",
        text.replace(
            "[coordinates]",
            "[coordinates]\nextra = { nominal = 0.1, passive = true }"
        )
    );
    let says = failure(&braced).render(false);
    assert!(
        says.contains("this mechanism cannot move: its loops constrain all 4 coordinates")
            && says.contains("a joint that is missing")
            && !says.contains("mark 1 coordinate more"),
        "{says}"
    );
    let idle = failure(&text.replace("crank = { nominal = 1.1 }", "crank = { nominal = 1.1, passive = true }"));
    let says = idle.render(false);
    assert!(says.contains("every coordinate is `passive`"), "{says}");
}

/// A triangle of links, neither of which is driven.
#[test]
fn what_cannot_move_is_no_model_without_drives_either() {
    let says = failure(TRIANGLE).render(false);
    assert!(
        says.contains("this mechanism cannot move: its loops constrain all 2 coordinates"),
        "{says}"
    );
}

const TRIANGLE: &str = r#"
schema = 1
name = "zero_mob"
[constants]
a = { value = 1.0, unit = "m" }
b = { value = 0.8, unit = "m" }
c = { value = 0.7, unit = "m" }
[coordinates]
q1 = { nominal = 0.7, passive = true }
q2 = { nominal = -1.4, passive = true }
[[frame]]
name = "f1"
on = "base"
modified_dh = { theta = "q1" }
[[frame]]
name = "f2"
on = "f1"
modified_dh = { a = "b", theta = "q2" }
[[point]]
name = "tip"
on = "f2"
at = ["c", 0]
[[point]]
name = "pin"
on = "base"
at = ["a", 0]
[[part]]
name = "p1"
on = "f1"
linear = { planar = 1 }
[[part]]
name = "p2"
on = "f2"
linear = { planar = 2 }
[[loop]]
name = "l"
joins = ["tip", "pin"]
"#;

#[test]
fn color_marks_the_same_text() {
    let failure = failure("schema = 2");
    assert!(failure.render(true).contains("\u{1b}["));
    assert!(!failure.render(false).contains("\u{1b}["));
}

#[test]
fn a_thousand_nested_brackets() {
    for (open, close) in [("[", "]"), ("{ a = ", " }")] {
        let text = format!("schema = 1\nx = {}1{}\n", open.repeat(1000), close.repeat(1000));
        let found = failure(&text);
        assert!(
            found.render(false).contains("at most 80 deep"),
            "{}",
            found.render(false)
        );
        let unclosed = format!("x = {}", open.repeat(200_000));
        failure(&unclosed);
    }
    let dotted = format!("x{} = 1\n[y{}]\n", ".x".repeat(1000), ".y".repeat(1000));
    failure(&dotted);
    let parentheses = format!("gravity = [\"{}1{}\", 0, 0]", "(".repeat(1000), ")".repeat(1000));
    assert!(failure(&parentheses).render(false).contains("nested too deeply"));
    let minus = format!(
        "gravity = [\"{}1\", \"1{}\", \"1{}\"]",
        "-".repeat(3000),
        "/2".repeat(1900),
        "-g".repeat(1900)
    );
    failure(&minus);
    let towers = format!("gravity = [\"2{}\", 0]", "^2".repeat(1000));
    failure(&towers);
}

#[test]
fn a_file_of_megabytes() {
    let huge = "x".repeat(5 << 20);
    assert!(failure(&huge).render(false).contains("too large"));
    let mut table = "schema = 1\nname = \"big\"\n[constants]\n".to_owned();
    for i in 0..15_000 {
        let _ = writeln!(table, "c{i} = {{ value = 1, unit = \"m\" }}");
    }
    assert!(failure(&table).render(false).contains("at most 1000"));
    let mut frames = "schema = 1\nname = \"big\"\n".to_owned();
    for i in 0..10_000 {
        let _ = writeln!(frames, "[[frame]]\nname = \"f{i}\"\non = \"f{}\"", i + 1);
    }
    assert!(failure(&frames).render(false).contains("at most 1000"));
    // Marks of a byte each would take a hundred times their size in memory.
    for mark in ["\n", ",", "[", "a.", "\"\"", "x=1\n"] {
        let start = std::time::Instant::now();
        let found = failure(&format!("schema = 1\n{}", mark.repeat((4 << 20) / mark.len() - 20)));
        assert!(
            found.render(false).contains("too many lines, brackets and entries"),
            "{mark:?}"
        );
        assert!(start.elapsed().as_secs() < 5, "{mark:?}: {:?}", start.elapsed());
    }
    let one_line = format!("schema = 1\nretain = [{}]\n", "\"a*b\", ".repeat(200_000));
    failure(&one_line);
    let keys = (0..150_000).fold(String::new(), |mut text, i| {
        let _ = writeln!(text, "k{i} = {i}");
        text
    });
    let found = failure(&keys);
    assert!(found.diagnostics.len() <= 102);
    let broken = "= 1\n".repeat(200_000);
    failure(&broken);
    let long_text = format!("name = \"{}\"", "a".repeat(1 << 20));
    failure(&long_text);
    let long_name = format!("{} = 1\n", "k".repeat(1 << 20));
    failure(&long_name);
}

#[test]
fn every_error_says_where() {
    let found = failure("schema = 1\nname = \"x\"\ngravity = [\"q\", 0, 0]\nframe = 1\ncoordinates = { q = 1 }\n");
    let mut places = Vec::new();
    for diagnostic in &found.diagnostics {
        assert_eq!(diagnostic.severity, DiagnosticSeverity::Error);
        let span = diagnostic.span.expect("a place");
        places.push(found.sources.line_and_column(span));
    }
    assert_eq!(places, [(3, 13), (4, 9), (5, 21)]);
}

#[test]
fn a_file_that_cannot_be_read() {
    let failure = modelmill_spec::load_file(Path::new("no/such/model.toml")).unwrap_err();
    assert!(failure.render(false).contains("cannot read `no/such/model.toml`"));
}

#[test]
fn line_ends_and_marks_of_other_systems() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/two_link.toml");
    let text = std::fs::read_to_string(path).unwrap().replace('\n', "\r\n");
    let none = MemoryFiles::default();
    assert!(load("model.toml", &text, &none).is_ok());
    assert!(load("model.toml", &format!("\u{feff}{text}"), &none).is_ok());
}
