//! The settings of `<compiler>` of an MJCF. An attached model keeps its own.
//!
//! Source of names and defaults: MuJoCo's XML reference, "compiler".

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::mjcf_attach::{ATTACHED, attached_number};
use super::mjcf_meshes::MeshFolder;
use super::placed::rotation_about;
use super::xml::{children, exact_numbers, located_message};

/// Settings of `<compiler>`, with MuJoCo's defaults.
pub(super) struct MjcfCompiler {
    /// Whether angles are in degrees.
    pub(super) is_degree: bool,
    /// Sequence of rotations of Euler angles; capitals rotate about fixed axes.
    pub(super) euler: String,
    /// Whether a range is a limit if `limited` is not specified.
    pub(super) has_auto_limits: bool,
    /// Whether inertia is computed from shapes: always, never, or (none) if there is no `<inertial>`.
    pub(super) from_geoms: Option<bool>,
    /// Lower bound of each mass, kg.
    pub(super) least_mass: f64,
    /// Lower bound of each principal moment, kg m^2.
    pub(super) least_inertia: f64,
    /// Whether impossible principal moments are replaced by their mean.
    pub(super) balances_inertia: bool,
    /// First and last group of shapes that have mass.
    pub(super) groups: [f64; 2],
    /// Total mass to which all bodies are scaled, kg.
    pub(super) total_mass: Option<f64>,
    /// Where files of meshes are.
    pub(super) mesh_folder: MeshFolder,
}

/// The settings of a description and of the models attached to it.
pub(super) struct CompilerSettings<'a> {
    /// Those of the description itself.
    main: MjcfCompiler,
    /// Those of attached models, by their numbers.
    attached: BTreeMap<&'a str, MjcfCompiler>,
}

impl<'a> CompilerSettings<'a> {
    /// Reads all `<compiler>` elements of a `<mujoco>` element.
    pub(super) fn read(root: &Node<'a, '_>) -> Result<Self, String> {
        let mut main = Vec::new();
        let mut attached: BTreeMap<&str, Vec<Node>> = BTreeMap::new();
        for node in children(root, "compiler") {
            match node.attribute(ATTACHED) {
                None => main.push(node),
                Some(number) => attached.entry(number).or_default().push(node),
            }
        }
        let attached = attached
            .into_iter()
            .map(|(number, all)| Ok((number, read_compiler(&all)?)));
        Ok(Self {
            main: read_compiler(&main)?,
            attached: attached.collect::<Result<_, String>>()?,
        })
    }

    /// The settings of the description itself.
    pub(super) fn main_settings(&self) -> &MjcfCompiler {
        &self.main
    }

    /// The settings of the file to which an element belongs.
    pub(super) fn find_settings(&self, node: &Node) -> &MjcfCompiler {
        if self.attached.is_empty() {
            return &self.main;
        }
        let number = attached_number(node);
        number
            .and_then(|number| self.attached.get(number))
            .unwrap_or(&self.main)
    }
}

impl MjcfCompiler {
    /// An angle of the file in rad.
    pub(super) fn angle(&self, value: f64) -> f64 {
        if self.is_degree { value * PI / 180.0 } else { value }
    }

    /// The rotation of Euler angles that are in the unit and the sequence of the file.
    pub(super) fn euler_rotation(&self, angles: [f64; 3]) -> Matrix3<f64> {
        let mut out = Matrix3::identity();
        for (letter, angle) in self.euler.chars().zip(angles) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => Vector3::x(),
                'y' => Vector3::y(),
                _ => Vector3::z(),
            };
            let turn = rotation_about(&axis, self.angle(angle));
            // Rotations about fixed axes multiply from the left.
            out = if letter.is_ascii_lowercase() {
                out * turn
            } else {
                turn * out
            };
        }
        out
    }

    /// An inertia with the bounds of the file, applied to the principal moments as in MuJoCo.
    pub(super) fn bounded_inertia(&self, inertia: Matrix3<f64>) -> Matrix3<f64> {
        let mut moments = inertia.symmetric_eigen();
        let given = moments.eigenvalues;
        let least = self.least_inertia;
        moments.eigenvalues = given.map(|moment| moment.max(least));
        let all = moments.eigenvalues;
        // The sum of two principal moments cannot be less than the third.
        if self.balances_inertia && 2.0 * all.max() > all.sum() {
            moments.eigenvalues.fill(all.mean());
        }
        // An unchanged matrix is returned as it is, without rounding errors.
        if moments.eigenvalues == given {
            inertia
        } else {
            moments.recompose()
        }
    }
}

/// Reads the `<compiler>` elements of one file; later ones replace earlier settings.
fn read_compiler(all: &[Node]) -> Result<MjcfCompiler, String> {
    let mut out = MjcfCompiler {
        is_degree: true,
        euler: "xyz".to_owned(),
        has_auto_limits: true,
        from_geoms: None,
        least_mass: 0.0,
        least_inertia: 0.0,
        balances_inertia: false,
        groups: [0.0, f64::INFINITY],
        total_mass: None,
        mesh_folder: MeshFolder::read(all),
    };
    for node in all {
        if let Some(angle) = node.attribute("angle") {
            out.is_degree = angle != "radian";
        }
        if let Some(sequence) = node.attribute("eulerseq") {
            // Capitals rotate about fixed axes; the two kinds cannot be mixed.
            let is_fine = sequence.len() == 3
                && sequence.chars().all(|c| "xyzXYZ".contains(c))
                && (sequence == sequence.to_lowercase() || sequence == sequence.to_uppercase());
            if !is_fine {
                return Err(located_message(node, "expected three of x, y and z in `eulerseq`"));
            }
            sequence.clone_into(&mut out.euler);
        }
        if let Some(auto) = node.attribute("autolimits") {
            out.has_auto_limits = auto != "false";
        }
        match node.attribute("inertiafromgeom") {
            Some("true") => out.from_geoms = Some(true),
            Some("false") => out.from_geoms = Some(false),
            _ => {}
        }
        for (key, value) in [
            ("boundmass", &mut out.least_mass),
            ("boundinertia", &mut out.least_inertia),
        ] {
            if let Some(text) = node.attribute(key) {
                [*value] = exact_numbers(node, key, text)?;
            }
        }
        // Poses relative to the world have another meaning, so the file cannot be read.
        if node.attribute("coordinate") == Some("global") {
            return Err(located_message(
                node,
                "global coordinates were removed from MuJoCo in version 2.3.3; convert the file with an older version",
            ));
        }
        if let Some(balance) = node.attribute("balanceinertia") {
            out.balances_inertia = balance == "true";
        }
        if let Some(text) = node.attribute("inertiagrouprange") {
            out.groups = exact_numbers(node, "inertiagrouprange", text)?;
        }
        if let Some(text) = node.attribute("settotalmass") {
            let [total] = exact_numbers(node, "settotalmass", text)?;
            // The default of MuJoCo is -1, which means "no scaling".
            out.total_mass = (total > 0.0).then_some(total);
        }
    }
    Ok(out)
}
