//! Pictures of mechanisms as SVG, and the style that all pages with pictures share.
//!
//! A [`Mechanism`](modelmill_spec::Mechanism) and the values of its coordinates become a [`MechanismScene`]: the shapes
//! to draw with their places in metres. A [`ViewDirection`] projects it, onto the plane of motion if there is one, else
//! from a chosen direction, and [`svg`] draws it. [`page`] is common to all pages with pictures. Dynamics are not
//! needed here.
//!
//! ```
//! # let text = r#"
//! # schema = 1
//! # name = "pendulum"
//! # gravity = [0, -9.81, 0]
//! # [constants]
//! # l = { value = 0.5, unit = "m" }
//! # [parameters]
//! # m = { nominal = 2.0, unit = "kg" }
//! # [coordinates]
//! # q = { nominal = 0.3 }
//! # [[frame]]
//! # name = "rod"
//! # on = "base"
//! # modified_dh = { theta = "q" }
//! # [[lumped_mass]]
//! # on = "rod"
//! # mass = "m"
//! # at = ["l", 0]
//! # [[drive]]
//! # name = "motor"
//! # joint = "q"
//! # "#;
//! let files = modelmill_boundary::files::MemoryFiles::default();
//! let mechanism = modelmill_spec::load("pendulum.toml", text, &files).expect("a model").mechanism;
//! let scene = modelmill_draw::MechanismScene::new(&mechanism, &[0.3]);
//! let picture = modelmill_draw::svg(&[&scene], &scene.best_view(), &modelmill_draw::DrawingStyle::default());
//! assert!(picture.starts_with("<svg"));
//! ```

mod free_body;
mod labels;
mod loads;
pub mod page;
mod paint;
mod plane;
mod scene;
mod symbols;
mod view;
mod virtual_chain;

pub use free_body::{CutArrow, CutArrowKind, FreeBodyDrawing, free_body_svg};
pub use loads::{DriveArrow, ERROR_SHADES};
pub use paint::{DrawingStyle, inline_svg, loaded_svg, svg};
pub use scene::{JointActuation, JointMark, MarkShape, MechanismScene, SceneMark};
pub use view::ViewDirection;
