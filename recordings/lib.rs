//! Recordings that ship with modelmill, as texts of CSV files, and models of the recorded robot, for programs that carry them.
//!
//! SI units, 500 Hz; `README.md` in this folder states where they come from and what the columns are.

/// Models of the robot: with its true lengths, and as the paper has them. Name and text of each file.
///
/// The texts are copies of `model-spec/models`, which a test compares. If `modelmill-spec` contained them, every crate of the
/// derivation would be compiled again after a change of these models, and `generated` would wait for them.
pub const MODELS: [(&str, &str); 2] = [
    ("spidermill.toml", include_str!("models/spidermill.toml")),
    ("spidermill-paper.toml", include_str!("models/spidermill-paper.toml")),
];

/// A recorded pair of runs of one machine: one to identify from, one to check on.
#[derive(Debug)]
pub struct BundledRuns {
    /// Name and text of the recording to identify from.
    pub fit: (&'static str, &'static str),
    /// Name and text of the recording to check on.
    pub check: (&'static str, &'static str),
}

/// The robot as its model describes it.
pub const PLAIN: BundledRuns = BundledRuns {
    fit: (
        "spidermill-mbs/plain-fit.csv",
        include_str!("spidermill-mbs/plain-fit.csv"),
    ),
    check: (
        "spidermill-mbs/plain-check.csv",
        include_str!("spidermill-mbs/plain-check.csv"),
    ),
};

/// The robot with a rod along each drive, which its model does not know of.
pub const WITH_RODS: BundledRuns = BundledRuns {
    fit: (
        "spidermill-mbs/with-rods-fit.csv",
        include_str!("spidermill-mbs/with-rods-fit.csv"),
    ),
    check: (
        "spidermill-mbs/with-rods-check.csv",
        include_str!("spidermill-mbs/with-rods-check.csv"),
    ),
};

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::MODELS;

    #[test]
    fn models_equal_their_originals() {
        let originals = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
        for (name, text) in MODELS {
            let original = std::fs::read_to_string(originals.join(name)).expect("an original");
            assert_eq!(
                text, original,
                "copy it: cp model-spec/models/{name} recordings/models/"
            );
        }
    }
}
