//! Mutilated model files: whatever the bytes, the loader answers soon, without a panic, and says where a fault is.
//!
//! `MODELMILL_FUZZ_SECONDS=600 cargo test --release -p modelmill-spec fuzz` runs for as long as that;
//! `MODELMILL_FUZZ_SEED` starts elsewhere. A failing input is printed and written to the temporary folder.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use modelmill_boundary::files::MemoryFiles;
use modelmill_spec::{DiagnosticSeverity, load};

/// Cases without `MODELMILL_FUZZ_SECONDS`.
const CASES: u64 = 2000;
/// No case may take longer; the slowest seen takes some hundredths of a second.
const SLOWEST: Duration = Duration::from_secs(5);

/// Pieces that mean something in a model file, and some that hurt.
const PIECES: [&str; 72] = [
    "\"",
    "'",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "=",
    ",",
    ".",
    "\n",
    "#",
    "\\",
    "\"\"\"",
    "'''",
    "0",
    "-1",
    "1e308",
    "1e-308",
    "1e999",
    "nan",
    "inf",
    "-0.0",
    "0x7fffffffffffffff",
    "9223372036854775808",
    "0.1",
    "\"pi\"",
    "\"-pi/2\"",
    "\"1/0\"",
    "\"0^-1\"",
    "\"(\"",
    "\"((((((((((((((((1))))))))))))))))\"",
    "\"2^16\"",
    "\"sqrt(-1)\"",
    "\"q1\"",
    "\"g\"",
    "\"d1*d1\"",
    "\"exp(1e30)\"",
    "\"sign(0)\"",
    "\"\u{e9}\"",
    "\u{1f916}",
    "\u{0}",
    "\r\n",
    "true",
    "1979-05-27",
    "passive = true",
    "extends = \"two_link.toml\"\n",
    "remove = [\"gravity\", \"frame.link1\"]\n",
    "[[frame]]\n",
    "[[loop]]\n",
    "[[drive]]\n",
    "[[effect]]\n",
    "[[effect_kind]]\n",
    "[[lumped_mass]]\n",
    "[[point]]\n",
    "[[part]]\n",
    "on = \"base\"",
    "at = [0, 0, 0]",
    "transform = {}",
    "joint = { revolute = \"q1\" }",
    "linear = { all = 1 }",
    "linear = { planar = \"\" }",
    "share = \"1/3\"",
    "kind = \"spring\"",
    "retain = [\"M1\"]",
    "theta",
    "alpha",
    "unit",
    "\"kg m^2/s\"",
    "\"1\"",
    "name = \"base\"",
];

/// A small generator of random numbers; the cases must be the same everywhere (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    #[allow(clippy::cast_possible_truncation)] // The remainder fits: `n` is a length.
    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

fn corpus() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files: Vec<PathBuf> = ["models", "tests/faulty", "../tests/fixtures/variants"]
        .iter()
        .flat_map(|place| std::fs::read_dir(root.join(place)).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "toml"))
        .collect();
    files.sort();
    files
        .iter()
        .map(|path| {
            (
                path.file_name().unwrap().to_string_lossy().into_owned(),
                std::fs::read_to_string(path).unwrap(),
            )
        })
        .collect()
}

/// A stretch of a text between character boundaries.
fn segment(text: &str, random: &mut Random) -> (usize, usize) {
    let mut start = random.below(text.len() + 1);
    let mut end = (start + random.below(60)).min(text.len());
    while !text.is_char_boundary(start) {
        start -= 1;
    }
    while !text.is_char_boundary(end) {
        end += 1;
    }
    (start, end)
}

/// A stretch that holds whole words or numbers, where there are any.
fn word(text: &str, random: &mut Random) -> (usize, usize) {
    let (start, _) = segment(text, random);
    let is_word = |found: char| found.is_alphanumeric() || found == '_' || found == '.';
    let start = start + text[start..].find(is_word).unwrap_or(0);
    let end = text[start..]
        .find(|found| !is_word(found))
        .unwrap_or(text.len() - start);
    (start, start + end)
}

fn mutate(text: &mut String, others: &[(String, String)], random: &mut Random) {
    let (start, end) = segment(text, random);
    match random.below(11) {
        0 => text.replace_range(start..end, ""),
        1 => {
            let copy = text[start..end].to_owned();
            text.insert_str(start, &copy);
        }
        2 | 3 => text.insert_str(start, PIECES[random.below(PIECES.len())]),
        4 | 5 => {
            let (start, end) = word(text, random);
            text.replace_range(start..end, PIECES[random.below(PIECES.len())].trim_matches('"'));
        }
        6 => {
            // A word of the file in the place of another: names that exist, in the wrong place.
            let (from, to) = word(text, random);
            let taken = text[from..to].to_owned();
            let (start, end) = word(text, random);
            text.replace_range(start..end, &taken);
        }
        7 => {
            let other = &others[random.below(others.len())].1;
            let (from, _) = segment(other, random);
            let mut to = (from + random.below(400)).min(other.len());
            while !other.is_char_boundary(to) {
                to += 1;
            }
            text.insert_str(start, &other[from..to]);
        }
        8 => {
            let mut lines: Vec<&str> = text.lines().collect();
            if !lines.is_empty() {
                let line = lines.remove(random.below(lines.len()));
                if random.below(2) == 0 {
                    lines.insert(random.below(lines.len() + 1), line);
                }
            }
            *text = lines.join("\n");
        }
        9 => {
            let digits: Vec<usize> = text
                .match_indices(|found: char| found.is_ascii_digit())
                .map(|found| found.0)
                .collect();
            if !digits.is_empty() {
                let at = digits[random.below(digits.len())];
                let digit = random.below(10).to_string();
                text.replace_range(at..=at, &digit);
            }
        }
        _ => {
            if let Some(letter) = text[start..].chars().next() {
                let other = char::from(u8::try_from(random.below(128)).unwrap_or(b'?'));
                text.replace_range(start..start + letter.len_utf8(), &other.to_string());
            }
        }
    }
}

/// What must hold for any text.
fn check(name: &str, text: &str, others: &MemoryFiles) -> bool {
    match load(name, text, others) {
        Ok(loaded) => {
            let _ = loaded.render(true);
            assert!(
                loaded
                    .warnings
                    .iter()
                    .all(|found| found.severity == DiagnosticSeverity::Warning)
            );
            let mechanism = &loaded.mechanism;
            assert!(mechanism.coordinates.iter().all(|one| one.nominal.is_finite()));
            for point in &mechanism.points {
                for at in &point.at {
                    assert!(!mechanism.text_of(at).is_empty());
                    assert!(at.evaluate(&|symbol| mechanism.symbol_nominal(symbol)).is_finite());
                }
            }
            for (i, frame) in mechanism.frames.iter().enumerate() {
                assert!(frame.parent.0 < i.max(1));
            }
            true
        }
        Err(failure) => {
            assert!(
                failure
                    .diagnostics
                    .iter()
                    .any(|found| found.severity == DiagnosticSeverity::Error)
            );
            assert!(failure.render(false).contains("error"));
            let _ = failure.render(true);
            false
        }
    }
}

#[test]
fn no_text_makes_it_panic_or_hang() {
    let seconds = std::env::var("MODELMILL_FUZZ_SECONDS")
        .ok()
        .and_then(|text| text.parse::<u64>().ok());
    let seed = std::env::var("MODELMILL_FUZZ_SEED")
        .ok()
        .and_then(|text| text.parse::<u64>().ok());
    let mut random = Random(seed.unwrap_or(1).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let others = corpus();
    let files = others.iter().fold(MemoryFiles::default(), |files, (name, text)| {
        files.with_file(name, text.as_str())
    });
    let start = Instant::now();
    let (mut cases, mut sound, mut slowest) = (0_u64, 0_u64, Duration::ZERO);
    while seconds.map_or(cases < CASES, |limit| start.elapsed().as_secs() < limit) {
        let (name, original) = &others[random.below(others.len())];
        let mut text = original.clone();
        for _ in 0..=random.below(6) {
            mutate(&mut text, &others, &mut random);
        }
        let began = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| check(name, &text, &files)));
        let took = began.elapsed();
        slowest = slowest.max(took);
        cases += 1;
        let fault = match outcome {
            Ok(is_sound) => {
                sound += u64::from(is_sound);
                (took > SLOWEST).then(|| format!("took {took:?}"))
            }
            Err(_) => Some("panicked".to_owned()),
        };
        if let Some(fault) = fault {
            let path = std::env::temp_dir().join("modelmill-fuzz.toml");
            let _ = std::fs::write(&path, &text);
            panic!(
                "case {cases} from {name} {fault}; the text is in {}\n{text}",
                path.display()
            );
        }
    }
    println!("{cases} cases, {sound} of them sound models, slowest {slowest:?}");
    assert!(sound > 0, "the mutations are so coarse that nothing survives them");
}
