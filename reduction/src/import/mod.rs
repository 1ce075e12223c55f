//! Converts robot descriptions of other programs: the text of a URDF, MJCF or SDF goes in, the text of a model file
//! comes out, with remarks on what was left out or rounded.
//!
//! `urdf`, `mjcf` and `sdf` each read one format into a `description`. `welds` cuts loops at the joints where they are
//! simplest, `couplings` resolves which joints follow others, `model_text` writes frames, bodies and forces. `closing`
//! determines which coordinates are passive (determined by loop closure), on the numeric kinematics of `chain`.

mod chain;
mod closing;
mod closures_file;
mod counts;
mod couplings;
mod description;
mod geoms;
mod locks;
mod mesh_polygons;
mod meshes;
mod mjcf;
mod mjcf_actuators;
mod mjcf_attach;
mod mjcf_compiler;
mod mjcf_copies;
mod mjcf_defaults;
mod mjcf_equalities;
mod mjcf_include;
mod mjcf_meshes;
mod mjcf_names;
mod mjcf_of_urdf;
mod model_text;
mod placed;
mod rig_text;
mod sdf;
mod sdf_couplings;
mod sdf_tree;
mod thresholds;
mod unread;
mod urdf;
mod urdf_extensions;
mod welds;
mod xml;
mod xml_budget;
mod xml_repair;

pub use mjcf_attach::expand_other_files;
pub use mjcf_include::FileReader;
pub use mjcf_meshes::MeshFiles;
pub use thresholds::{LARGEST_DESCRIPTION, LARGEST_MESH};

use std::borrow::Cow;
use std::fmt;

use description::RobotDescription;
use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::text::Message;
use roxmltree::Document;

/// A model file made from a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct DescriptionImport {
    /// The text of the model file.
    pub model: String,
    /// What was left out, rounded or assumed; one sentence each.
    pub remarks: Vec<Message>,
    /// What has no effect on a model in any reading; one sentence each.
    pub facts: Vec<Message>,
    /// Joints of the description, with the coordinates of the model that move them.
    pub joints: Vec<ImportedJoint>,
}

/// A joint of the description in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedJoint {
    /// Its name in the description.
    pub name: String,
    /// One for revolute and prismatic joints, three angles for ball joints, position and quaternion for free ones.
    pub coordinates: Vec<String>,
    /// A joint of one coordinate is `ratio*coordinate + offset`.
    pub ratio: f64,
    /// See `ratio`, rad or m.
    pub offset: f64,
    /// Axes of a ball joint's angles, `wxyz` for free joints, else empty.
    pub axes: String,
}

/// Settings that a description does not contain.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// Whether the root of a URDF is free (floating base) instead of fixed to the world.
    pub floating: bool,
    /// Whether angles within 1e-4 rad of a multiple of pi/12 are rounded to it.
    pub round_angles: bool,
    /// Whether masses and inertias are known numbers instead of parameters with nominal values.
    pub known_bodies: bool,
    /// Text of a `robot.yaml` with closures and drives of a URDF, in the format of the collection
    /// example-parallel-robots.
    pub closures: Option<&'a str>,
    /// Joints by name with the values, rad or m from the description's own zero, from which loops are closed; others
    /// start at the pose of the description. They select one of several assembly modes.
    pub pose: &'a [(String, f64)],
    /// Joints by name that are fixed at a value, rad or m from the description's own zero: they are no coordinates.
    pub locked: &'a [(String, f64)],
    /// The joints that move; all others are fixed at the pose of the description, except those that are coupled with
    /// one of these, and ball joints and free joints, which are remarked. Without it all joints move.
    pub kept: Option<&'a [String]>,
    /// Reads the files of meshes from which an MJCF infers masses; without it such a description is refused.
    pub meshes: Option<MeshFiles<'a>>,
}

/// Why a robot description cannot be converted: one sentence with the place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImportError(String);

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ImportError {}

/// Converts a robot description into a model file. The root element determines the format.
///
/// Fails if the text is not URDF, MJCF or SDF, or contains something that models cannot express; the message names
/// element and line.
pub fn import(text: &str, options: &Options) -> Result<DescriptionImport, ImportError> {
    let mut description = read_description(text, options)?;
    welds::cut_at_joints(&mut description);
    // The result is loaded like any model file, so that faults of the description appear here and not later.
    let imported = model_text::model_text(description, options).map_err(ImportError)?;
    match modelmill_spec::load("the model made from it", &imported.model, &MemoryFiles::default()) {
        Ok(_) => Ok(imported),
        Err(failure) => Err(ImportError(format!(
            "the model file made from this description is not valid:\n{}",
            failure.render(false)
        ))),
    }
}

/// A rig file made from a robot description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescriptionRig {
    /// The text of the rig file.
    pub text: String,
    /// What was left out or assumed; one sentence each.
    pub remarks: Vec<String>,
}

/// Converts the description of a planar mechanism into a rig file, for a reduction.
///
/// Fails as [`import`](fn@import) does, and if the description has what rigs cannot express.
pub fn rig_of_description(text: &str, options: &Options) -> Result<DescriptionRig, ImportError> {
    let mut description = read_description(text, options)?;
    let text = rig_text::rig_text(&description).map_err(ImportError)?;
    let mut remarks = std::mem::take(&mut description.remarks);
    for joint in description.links.iter().flat_map(|link| &link.joints) {
        // Effects of rigs act at drives.
        let at_drive = |value: f64| if joint.is_driven { 0.0 } else { value };
        let left_out = [
            ("spring", joint.stiffness),
            ("viscous friction", at_drive(joint.damping)),
            ("Coulomb friction", at_drive(joint.friction)),
            ("rotor inertia", at_drive(joint.armature)),
        ];
        for (what, _) in left_out.into_iter().filter(|(_, value)| *value != 0.0) {
            remarks.push(format!(
                "the {what} of the joint `{}` is left out; add it to the model",
                joint.name
            ));
        }
    }
    Ok(DescriptionRig { text, remarks })
}

/// Reads a description in the format that its root element determines.
fn read_description(text: &str, options: &Options) -> Result<RobotDescription, ImportError> {
    if text.len() > LARGEST_DESCRIPTION {
        return Err(ImportError("this file is too large for a robot description".to_owned()));
    }
    xml_budget::check_xml_budget(text).map_err(|fault| {
        ImportError(format!(
            "{fault}; no robot description needs that, so check that this is the intended file"
        ))
    })?;
    let readable = xml_repair::readable_xml(text);
    let copied = mjcf_copies::expand_copies(&readable).map_err(ImportError)?;
    if let Cow::Owned(changed) = &copied {
        xml_budget::check_xml_budget(changed).map_err(ImportError)?;
    }
    let text = copied.as_ref();
    // A frequent mistake is a file with macros or the YAML next to the description.
    let document = Document::parse(text).map_err(|error| {
        let expected = if matches!(error, roxmltree::Error::UnknownEntityReference(..)) {
            "XML with the text of its entities written out"
        } else if text.trim_start().starts_with('<') {
            "XML with macros (xacro) expanded"
        } else {
            "XML (if the robot has a `robot.yaml`, give the URDF; the yaml next to it is found automatically)"
        };
        ImportError(format!(
            "this is not a readable URDF, MJCF or SDF file ({error}); expected {expected}"
        ))
    })?;
    // Lines in messages are looked up in a table while this value exists.
    let _lines = xml::LineTable::install(&document);
    counts::check_elements(&document).map_err(ImportError)?;
    let read = match document.root_element().tag_name().name() {
        "robot" => urdf::read(&document, options.closures, options.floating),
        "mujoco" => mjcf::read(&document, options.meshes),
        "sdf" => sdf::read(&document),
        other => Err(xml::located_message(
            &document.root_element(),
            &format!("expected <robot> (URDF), <mujoco> (MJCF) or <sdf>, found <{other}>"),
        )),
    };
    let mut description = read.map_err(ImportError)?;
    counts::check_description(&description).map_err(ImportError)?;
    description.remarks.extend(unread::unread_remarks(&document));
    // Values of the options replace those of the description, such as a keyframe of MJCF.
    for (name, value) in options.pose {
        let mut joints = description.links.iter().flat_map(|link| &link.joints);
        if !joints.any(|joint| joint.name == *name) {
            return Err(ImportError(format!(
                "a value is given for the joint `{name}`, which does not exist"
            )));
        }
        description.pose.retain(|(known, _)| known != name);
        description.pose.push((name.clone(), *value));
    }
    locks::lock_joints(&mut description, options.locked, options.kept)?;
    // Options for URDF only would have no effect on other formats.
    let is_urdf = description.format == "URDF";
    if !is_urdf && (options.floating || options.closures.is_some()) {
        return Err(ImportError(format!(
            "a floating root and a file of closures are for URDF only; {} files contain both themselves",
            description.format
        )));
    }
    Ok(description)
}
