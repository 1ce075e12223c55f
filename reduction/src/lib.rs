//! The reduction of a full-body rig to a planar model, with the strategy of the SpiderMill paper, section 2.3.
//!
//! A rig and a plan go in; a model file comes out, with a report of every assumption and its size. The rig is moved
//! through sampled motions, and each assumption (a body is in the plane, bodies move alike, a body only translates, a
//! loop closes) is measured along them. The steps:
//!
//! 1. planar reduction - `planar`: projection of bodies onto the plane;
//! 2. substitution parts and lumped masses, eq. (1) - `part`;
//! 3. symmetry: shared symbols - `planar_draft`;
//! 4. drives - `drive`.
//!
//! In addition, [`import`](fn@import) converts a robot description of other programs into a model file, and
//! [`export`](fn@export) a model into a description.

mod alike;
mod drive;
mod export;
mod import;
mod names;
mod part;
mod plan;
mod plan_for;
mod planar;
mod planar_draft;
mod propose;
mod reduce;
mod reduce_drives;
mod reduce_parts;
mod report;
mod samples;
mod tolerance;
mod write;

pub use export::{DescriptionExport, DescriptionFormat as ExportFormat, ExportError, export};
pub use import::{
    DescriptionImport, DescriptionRig, FileReader, ImportError, ImportedJoint, LARGEST_DESCRIPTION, LARGEST_MESH,
    MeshFiles, Options as ImportOptions, expand_other_files, import, rig_of_description,
};
pub use plan::{ReductionPlan, plan, plan_file, plan_file_with};
pub use plan_for::default_plan;
pub use propose::{PlanProposal, propose_plan};
pub use reduce::{PlanarReduction, reduce};
pub use report::{AssumptionSize, ReductionFinding, ReductionReport};
pub use samples::sampled_forces;
