//! One file per command.

pub(crate) mod add;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod diagnose;
pub(crate) mod diff;
pub(crate) mod effects;
pub(crate) mod equations;
pub(crate) mod evaluate;
pub(crate) mod excite;
pub(crate) mod experiment;
pub(crate) mod generate;
pub(crate) mod identify;
pub(crate) mod import;
pub(crate) mod interpret;
pub(crate) mod reduce;
pub(crate) mod report;
pub(crate) mod simulate;
pub(crate) mod tour;
