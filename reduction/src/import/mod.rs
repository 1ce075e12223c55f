//! Robot descriptions of other programs as a starting point: URDF, MJCF or SDF goes in, the text of a model file comes out,
//! with what was left out or rounded.
//!
//! `urdf`, `mjcf` and `sdf` read a format each into a `description`; `welds` cuts loops where they are simplest, `couplings`
//! says what follows what, `model_text` makes frames, bodies and forces of it, and `closing` finds out which coordinates the
//! loops settle, on the frames in numbers (`chain`).

mod chain;
mod closing;
mod closures_file;
mod couplings;
mod description;
mod geoms;
mod mjcf;
mod mjcf_actuators;
mod mjcf_defaults;
mod mjcf_equalities;
mod mjcf_include;
mod model_text;
mod placed;
mod sdf;
mod urdf;
mod welds;
mod xml;

pub use mjcf_include::expand_includes;

use std::fmt;

use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::text::Message;
use roxmltree::Document;

/// A model file made from a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct DescriptionImport {
    /// The text of the model file.
    pub model: String,
    /// What was left out, rounded or made up; one sentence each.
    pub remarks: Vec<Message>,
    /// Joints of the description, with the coordinates of the model that move them.
    pub joints: Vec<ImportedJoint>,
}

/// A joint of the description in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedJoint {
    /// As the description has it.
    pub name: String,
    /// One for joints that turn or slide, three angles for ball joints, position and quaternion for free ones.
    pub coordinates: Vec<String>,
    /// A joint of one coordinate is `ratio*coordinate + offset`.
    pub ratio: f64,
    /// See `ratio`, rad or m.
    pub offset: f64,
    /// Axes of a ball joint's angles, `wxyz` for free joints, else empty.
    pub axes: String,
}

/// What a description does not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// The root of a URDF hangs on nothing, rather than on the world.
    pub floating: bool,
    /// Angles within 1e-4 of multiples of a twelfth of pi are taken for these.
    pub round_angles: bool,
    /// Text of a file with closures and drives beside a URDF, as the collection example-parallel-robots has it.
    pub closures: Option<&'a str>,
    /// Joints by name with the values, rad or m in the description's own zero, from which loops are closed; others are at the
    /// pose of the description. They say in which of their assemblies loops are meant.
    pub pose: &'a [(String, f64)],
}

/// Why a robot description makes no model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImportError(String);

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ImportError {}

/// The longest text that is looked at, bytes.
pub const LARGEST_DESCRIPTION: usize = 16 << 20;

/// Makes a model file of a robot description; its root element says the format.
///
/// Fails when the text is none of URDF, MJCF and SDF, or holds what models cannot say; the message names element and line.
pub fn import(text: &str, options: &Options) -> Result<DescriptionImport, ImportError> {
    if text.len() > LARGEST_DESCRIPTION {
        return Err(ImportError(
            "this file is too large for a robot description".to_owned(),
        ));
    }
    let document = Document::parse(text).map_err(|error| {
        let expected = if text.trim_start().starts_with('<') {
            "XML with macros (xacro) expanded"
        } else {
            "XML; of a robot with a `robot.yaml` the URDF is given, and the file beside it is found"
        };
        ImportError(format!(
            "this is no URDF, MJCF or SDF that can be read ({error}); expected {expected}"
        ))
    })?;
    let read = match document.root_element().tag_name().name() {
        "robot" => urdf::read(&document, options.closures, options.floating),
        "mujoco" => mjcf::read(&document),
        "sdf" => sdf::read(&document),
        other => Err(xml::located_message(
            &document.root_element(),
            &format!("expected <robot> (URDF), <mujoco> (MJCF) or <sdf>, found <{other}>"),
        )),
    };
    let mut description = read.map_err(ImportError)?;
    for (name, value) in options.pose {
        let mut joints = description.links.iter().flat_map(|link| &link.joints);
        if !joints.any(|joint| joint.name == *name) {
            return Err(ImportError(format!(
                "no joint is called `{name}`, for which a value is given"
            )));
        }
        description.pose.retain(|(known, _)| known != name);
        description.pose.push((name.clone(), *value));
    }
    welds::cut_at_joints(&mut description);
    let is_urdf = description.format == "URDF";
    if !is_urdf && (options.floating || options.closures.is_some()) {
        return Err(ImportError(format!(
            "a free root and a file of closures are for URDF; {} says both itself",
            description.format
        )));
    }
    let imported = model_text::model_text(description, options).map_err(ImportError)?;
    match modelmill_spec::load(
        "the model made from it",
        &imported.model,
        &MemoryFiles::default(),
    ) {
        Ok(_) => Ok(imported),
        Err(failure) => Err(ImportError(format!(
            "this description makes no sound model:\n{}",
            failure.render(false)
        ))),
    }
}
