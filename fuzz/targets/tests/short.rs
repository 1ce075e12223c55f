//! Every target reads its corpus and some mutations of it. One test, because the counters of memory are those of the
//! whole program.

use std::time::{Duration, Instant};

use modelmill_fuzz_targets::corpus::{read_corpus, repository};
use modelmill_fuzz_targets::mutation::{MutationNoise, mutate};
use modelmill_fuzz_targets::targets::TARGETS;

/// Time of the mutations of each target. An hour of them is run by the program `modelmill-fuzz`.
const TIME: Duration = Duration::from_millis(120);

#[test]
fn every_reader_ends_within_its_budget() {
    for target in TARGETS {
        let corpus = read_corpus(&target).expect("the files of the repository");
        assert!(!corpus.is_empty(), "{} has no files", target.name);
        for (path, bytes) in &corpus {
            println!("{}: {}", target.name, path.display());
            (target.run)(bytes);
        }
        let files: Vec<Vec<u8>> = corpus.into_iter().map(|(_, bytes)| bytes).collect();
        let mut noise = MutationNoise::new(1);
        let start = Instant::now();
        let mut n = 0;
        while start.elapsed() < TIME {
            n += 1;
            println!("{}: mutation {n} with the seed 1", target.name);
            (target.run)(&mutate(&files, &mut noise));
        }
    }
}

#[test]
fn every_target_has_a_wrapper_for_coverage_guided_fuzzing() {
    let folder = repository().join("fuzz");
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).expect("the workspace of `cargo fuzz`");
    let listed: Vec<&str> = manifest
        .lines()
        .filter_map(|line| line.strip_prefix("path = \"fuzz_targets/")?.strip_suffix(".rs\""))
        .collect();
    assert_eq!(listed, TARGETS.map(|target| target.name));
    for name in listed {
        let wrapper = std::fs::read_to_string(folder.join(format!("fuzz_targets/{name}.rs"))).expect("a wrapper");
        assert!(wrapper.contains(&format!("targets::{name}(data)")), "{name}");
    }
}
