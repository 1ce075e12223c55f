//! Long mechanisms in general position: processor time from the model file to the source of its code, and how long that is.
//!
//! `cargo bench -p modelmill-tests --bench chains [-- --seed N] [--write DIR]`: a chain and a binary tree of thirty joints
//! whose axes have arbitrary twists and distances, made of the seed, and the bundled humanoid. `--write` keeps the model
//! files and the modules, to be compiled.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use modelmill_boundary::files::MemoryFiles;
use modelmill_tests::fixtures::model_file;
use modelmill_tests::stream::Stream;

const JOINTS: usize = 30;

fn main() {
    let mut seed = 1;
    let mut folder = None;
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--seed" => {
                let number = words.next().expect("a number behind `--seed`");
                seed = number.parse().expect("a whole number behind `--seed`");
            }
            "--write" => folder = Some(PathBuf::from(words.next().expect("a folder"))),
            // What cargo says to every benchmark.
            "--bench" => {}
            other => panic!("there is no option {other}"),
        }
    }
    println!(
        "{:<10} {:>7} {:>6} {:>14} {:>10}",
        "model", "joints", "p_min", "processor, s", "source, kB"
    );
    let humanoid = fs::read_to_string(model_file("humanoid")).expect("the bundled humanoid");
    for (name, text) in [
        ("chain", tree("chain", seed, &|k| k.checked_sub(1))),
        ("tree", tree("tree", seed, &|k| k.checked_sub(1).map(|k| k / 2))),
        ("humanoid", humanoid),
    ] {
        let start = processor_seconds();
        let loaded = modelmill_spec::load(name, &text, &MemoryFiles::default())
            .unwrap_or_else(|failure| panic!("{}", failure.render(false)));
        let derivation = modelmill_codegen::derive(&loaded.mechanism).unwrap_or_else(|error| panic!("{name}: {error}"));
        let module = modelmill_emit::emit(&derivation).module();
        let seconds = processor_seconds() - start;
        println!(
            "{name:<10} {JOINTS:>7} {:>6} {seconds:>14.2} {:>10.0}",
            derivation.reduction.retained.len(),
            module.len() as f64 / 1e3
        );
        if let Some(folder) = &folder {
            for (ending, text) in [("toml", &text), ("rs", &module)] {
                let file = folder.join(format!("{name}.{ending}"));
                fs::write(&file, text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
            }
        }
    }
}

/// A model file of joints that turn, each on the one that `parent` says or on the base, with a twist and distances of its own.
fn tree(name: &str, seed: u64, parent: &dyn Fn(usize) -> Option<usize>) -> String {
    let mut stream = Stream::new(seed);
    let (mut constants, mut coordinates) = (String::new(), String::new());
    let (mut frames, mut parts) = (String::new(), String::new());
    for k in 0..JOINTS {
        for (constant, unit, low, high) in [("a", "m", 0.1, 0.4), ("alpha", "rad", 0.3, 1.2), ("d", "m", 0.1, 0.4)] {
            let value = stream.either_side(low, high);
            let _ = writeln!(constants, "{constant}{k} = {{ value = {value:.4}, unit = \"{unit}\" }}");
        }
        let nominal = stream.between(-1.0, 1.0);
        let _ = writeln!(coordinates, "q{k} = {{ nominal = {nominal:.3} }}");
        let on = parent(k).map_or("base".to_owned(), |k| format!("link{k}"));
        let _ = write!(
            frames,
            "\n[[frame]]\nname = \"link{k}\"\non = \"{on}\"\n\
             modified_dh = {{ a = \"a{k}\", alpha = \"alpha{k}\", d = \"d{k}\", theta = \"q{k}\" }}\n"
        );
        let _ = write!(
            parts,
            "\n[[part]]\nname = \"body{k}\"\non = \"link{k}\"\nlinear = {{ all = \"{k}\" }}\n\
             \n[[drive]]\nname = \"drive{k}\"\njoint = \"q{k}\"\n"
        );
    }
    format!(
        "schema = 1\nname = \"{name}\"\ngravity = [0, 0, -9.81]\n\n[constants]\n{constants}\n[coordinates]\n{coordinates}{frames}{parts}"
    )
}

/// Seconds that this process has had a processor.
fn processor_seconds() -> f64 {
    let text = fs::read_to_string("/proc/self/schedstat").expect("Linux");
    let nanoseconds = text.split_whitespace().next().expect("three numbers");
    nanoseconds.parse::<f64>().expect("a number") * 1e-9
}
