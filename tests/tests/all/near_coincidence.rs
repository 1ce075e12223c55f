//! Mechanisms whose constants are zero, equal, or equal but for the last digits: forces are right beside virtual power on
//! maximal coordinates, or the model is refused.

use modelmill_tests::laws::Case;
use modelmill_tests::random::{self, Matter};

/// What `derive` lets pass as rounding, with the oracle's own share.
const RIGHT: f64 = 2e-6;

/// What became of some mechanisms.
#[derive(Debug, Default)]
struct Outcome {
    right: usize,
    /// Said to be beyond the mill.
    refused: Vec<String>,
    wrong: Vec<String>,
    /// Right ones that lose more digits than any need.
    poor: Vec<String>,
    worst: f64,
}

impl Outcome {
    fn look_at(&mut self, case: Result<Case, String>) {
        let case = match case {
            Ok(case) => case,
            Err(says) => return self.refused.push(says),
        };
        match case.forces_satisfy_dalembert_to(RIGHT, 6) {
            Ok(error) => {
                self.right += 1;
                self.worst = self.worst.max(error);
                if error > 1e-10 {
                    self.poor
                        .push(format!("{}: {error:.1e}", case.derivation.mechanism.name));
                }
            }
            Err(says) => self.wrong.push(says),
        }
    }
}

fn all(trees: std::ops::Range<u64>, loops: std::ops::Range<u64>) {
    let n = usize::try_from(trees.end - trees.start + loops.end - loops.start).unwrap();
    let mut outcome = Outcome::default();
    for seed in trees {
        outcome.look_at(Case::new(&random::tree(seed, Matter::Special), 8, 3.0));
    }
    for seed in loops {
        outcome.look_at(Case::new(&random::planar_loop(seed, Matter::Special), 8, 0.3));
    }
    println!("{outcome:#?}");
    assert!(outcome.wrong.is_empty(), "{:#?}", outcome.wrong);
    assert!(
        outcome.poor.len() * 100 <= n && outcome.refused.len() * 20 <= n,
        "{outcome:#?}"
    );
}

#[test]
fn forces_are_right_or_refused() {
    all(0..40, 0..20);
}

/// All five hundred; minutes without optimisation.
#[test]
#[ignore = "a share of it runs above"]
fn forces_are_right_or_refused_everywhere() {
    all(0..300, 0..200);
}
