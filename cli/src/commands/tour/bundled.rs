//! Models and recordings that are part of the program, so that the tour needs no files.

/// Model files by name.
pub(crate) const MODELS: [(&str, &str); 2] = [
    (
        "spidermill.toml",
        include_str!("../../../../model-spec/models/spidermill.toml"),
    ),
    (
        "spidermill-paper.toml",
        include_str!("../../../../model-spec/models/spidermill-paper.toml"),
    ),
];

/// A recorded pair of runs of the whole robot: one to identify from, one to check on.
pub(crate) struct Runs {
    /// Name and text of the recording to identify from.
    pub(crate) fit: (&'static str, &'static str),
    /// Name and text of the recording to check on.
    pub(crate) check: (&'static str, &'static str),
}

/// The robot as the model describes it.
pub(crate) const PLAIN: Runs = Runs {
    fit: (
        "spidermill-mbs/plain-fit.csv",
        include_str!("../../../../recordings/spidermill-mbs/plain-fit.csv"),
    ),
    check: (
        "spidermill-mbs/plain-check.csv",
        include_str!("../../../../recordings/spidermill-mbs/plain-check.csv"),
    ),
};

/// The robot with something that the model does not know of.
pub(crate) const WITH_RODS: Runs = Runs {
    fit: (
        "spidermill-mbs/with-rods-fit.csv",
        include_str!("../../../../recordings/spidermill-mbs/with-rods-fit.csv"),
    ),
    check: (
        "spidermill-mbs/with-rods-check.csv",
        include_str!("../../../../recordings/spidermill-mbs/with-rods-check.csv"),
    ),
};
