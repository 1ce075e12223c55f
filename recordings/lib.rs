//! Recordings that ship with modelmill, as texts of CSV files, for programs that carry them.
//!
//! SI units, 500 Hz; `README.md` in this folder states where they come from and what the columns are.

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
