//! The reduction of a full-body rig to a planar model: the strategy of the SpiderMill paper, section 2.3.
//!
//! A rig and a plan go in; a model file comes out, with a report of everything that was assumed and how large it is.
//! Nothing is taken on trust: the rig is moved through sampled motions, and each claim (this lies in the plane, these
//! move alike, this only translates, this loop closes) is measured along them. The steps:
//!
//! 1. planar reduction - `planar`: bodies as the plane sees them;
//! 2. substitution parts and lumped masses, eq. (1) - `part`;
//! 3. symmetry: what shares a symbol - `draft`;
//! 4. drives - `drive`.
//!
//! Beside it, [`import`](fn@import) makes a model file of a robot description of other programs, and [`export`](fn@export) a
//! description of a model.

mod draft;
mod drive;
mod export;
mod import;
mod names;
mod part;
mod plan;
mod plan_for;
mod planar;
mod reduce;
mod reduce_drives;
mod reduce_parts;
mod report;
mod samples;
mod write;

pub use export::{DescriptionExport, DescriptionFormat as ExportFormat, ExportError, export};
pub use import::{
    DescriptionImport, ImportError, ImportedJoint, LARGEST_DESCRIPTION, Options as ImportOptions,
    expand_includes, import,
};
pub use plan::{ReductionPlan, plan, plan_file, plan_file_with};
pub use plan_for::default_plan;
pub use reduce::{PlanarReduction, reduce};
pub use report::{AssumptionSize, ReductionFinding, ReductionReport};
pub use samples::sampled_forces;
