//! Meshes of MJCF: their entries in `<asset>`, their files, and the mass of shapes made of them.
//!
//! Source of names, defaults and the order of transformations: MuJoCo's XML reference, "asset/mesh".

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::Vector3;
use roxmltree::{Node, NodeId};

use super::description::DescriptionInertia;
use super::geoms::GIVE_INERTIAL;
use super::meshes::{MeshInertia, MeshIntegrals, TriangleMesh};
use super::mjcf::MjcfReader;
use super::mjcf_include::{FILE_FOLDER, joined_path};
use super::placed::{DescriptionPose, rotation_from_quaternion};
use super::xml::{located_message, numbers, vector};

/// Reads the bytes of a mesh file by its name relative to the folder of the description; fails with a sentence.
#[derive(Clone, Copy)]
pub struct MeshFiles<'a>(pub &'a dyn Fn(&str) -> Result<Vec<u8>, String>);

impl fmt::Debug for MeshFiles<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("MeshFiles")
    }
}

/// Settings of `<compiler>` for the files of meshes.
#[derive(Clone, Debug, Default)]
pub(super) struct MeshFolder {
    /// Folder of the file with the settings, relative to that of the description; ends with a slash or is empty.
    file_folder: String,
    /// `meshdir`, or else `assetdir`; empty without both.
    folder: String,
    /// Whether paths of files are cut down to their last part.
    strips_paths: bool,
}

impl MeshFolder {
    /// Reads the settings of all `<compiler>` elements of a file.
    pub(super) fn read(all: &[Node]) -> Self {
        let last = |key: &str| all.iter().filter_map(|node| node.attribute(key)).next_back();
        Self {
            file_folder: last(FILE_FOLDER).unwrap_or_default().to_owned(),
            folder: last("meshdir").or(last("assetdir")).unwrap_or_default().to_owned(),
            strips_paths: last("strippath") == Some("true"),
        }
    }

    /// The path of a mesh file relative to the description. Whether paths are cut down is a setting of the `main` file.
    fn path(&self, file: &str, main: &Self) -> String {
        let file = if main.strips_paths { last_part(file) } else { file };
        let own = &self.file_folder;
        match self.folder.trim_end_matches('/') {
            _ if file.starts_with('/') => file.to_owned(),
            "" => format!("{own}{file}"),
            folder if folder.starts_with('/') => format!("{folder}/{file}"),
            folder => format!("{own}{folder}/{file}"),
        }
    }
}

/// Meshes that were read, by their names.
pub(super) type LoadedMeshes = BTreeMap<String, LoadedMesh>;

/// A mesh that was read: what its triangles give for all shapes that are made of it, or a phrase that states its fault.
pub(super) struct LoadedMesh(Result<MeshIntegrals, String>);

/// The entries of meshes in `<asset>`, by their names.
pub(super) type MeshEntries<'a> = BTreeMap<&'a str, NodeId>;

impl<'a> MjcfReader<'a> {
    /// Mass, centre and inertia of a shape that is a mesh, in the axes of the shape.
    ///
    /// Fails with the place of the shape or of the mesh.
    pub(super) fn mesh_inertia(
        &mut self,
        geom: &Node<'a, '_>,
        name: &str,
        mass: Option<f64>,
        density: f64,
    ) -> Result<DescriptionInertia, String> {
        if !self.loaded_meshes.contains_key(name) {
            let entry = self.mesh_entries.get(name).and_then(|id| geom.document().get_node(*id));
            let entry = entry.ok_or_else(|| located_message(geom, &format!("there is no mesh `{name}` in <asset>")))?;
            let loaded = self.load_mesh(&entry)?;
            self.loaded_meshes.insert(name.to_owned(), loaded);
        }
        match &self.loaded_meshes[name].0 {
            Ok(integrals) => Ok(integrals.inertial(mass, density)),
            Err(fault) => Err(located_message(geom, &format!("mesh `{name}`: {fault}"))),
        }
    }

    /// Reads an entry of `<asset>` with its corners and triangles.
    fn load_mesh(&self, entry: &Node<'a, '_>) -> Result<LoadedMesh, String> {
        let not_computed = |what: &str| {
            let says = format!("mass and inertia of {what} are not computed here; {GIVE_INERTIAL}");
            Err(located_message(entry, &says))
        };
        let kind = match self.text(entry, None, "inertia")?.unwrap_or("legacy") {
            "legacy" => MeshInertia::Legacy,
            "exact" => MeshInertia::Exact,
            "shell" => MeshInertia::Shell,
            "convex" => return not_computed("the convex hull of a mesh"),
            other => {
                let says = format!("there is no inertia `{other}`; expected convex, exact, legacy or shell");
                return Err(located_message(entry, &says));
            }
        };
        let mesh = if let Some(file) = entry.attribute("file") {
            self.read_mesh_file(entry, file)?
        } else if let (Some(corners), Some(triangles)) = (entry.attribute("vertex"), entry.attribute("face")) {
            inline_mesh(entry, corners, triangles)?
        } else if entry.attribute("vertex").is_some() {
            return not_computed("the convex hull of points");
        } else {
            return not_computed("a built-in mesh");
        };
        let mut reference = DescriptionPose::identity();
        if let Some(position) = self.numbers(entry, None, "refpos")? {
            reference.p = vector(position);
        }
        if let Some(quaternion) = self.numbers(entry, None, "refquat")? {
            reference.r = rotation_from_quaternion(quaternion)
                .ok_or_else(|| located_message(entry, "`refquat` has no direction"))?;
        }
        let scale = self.numbers(entry, None, "scale")?.unwrap_or([1.0; 3]);
        Ok(LoadedMesh(mesh.placed(&reference, scale).integrals(kind)))
    }

    /// Reads the file of a mesh.
    fn read_mesh_file(&self, entry: &Node<'a, '_>, file: &str) -> Result<TriangleMesh, String> {
        let Some(MeshFiles(read)) = self.mesh_files else {
            let says = "the file of this mesh can only be read if the description is given as a file";
            return Err(located_message(entry, says));
        };
        let main = &self.settings.main_settings().mesh_folder;
        let path = self.settings_of(entry).mesh_folder.path(file, main);
        let mut bytes = read(&path);
        // MuJoCo 4 also reads the file in the folder of the included file, unless it cuts paths down.
        let include = entry.attribute(FILE_FOLDER).filter(|_| !main.strips_paths);
        if let (Err(_), Some(folder)) = (&bytes, include) {
            bytes = read(&joined_path(folder, file)).or(bytes);
        }
        let bytes = bytes.map_err(|fault| located_message(entry, &fault))?;
        TriangleMesh::read(&path, &bytes).map_err(|fault| located_message(entry, &format!("`{path}`: {fault}")))
    }
}

/// The entries of all meshes by their names, which are those of their files without ending if none is given. The first one
/// of a name counts.
pub(super) fn mesh_entries<'a>(root: &Node<'a, '_>) -> MeshEntries<'a> {
    let mut out = MeshEntries::new();
    let assets = root.children().filter(|node| node.has_tag_name("asset"));
    for entry in assets.flat_map(|asset| asset.children().filter(|node| node.has_tag_name("mesh"))) {
        let of_file = || entry.attribute("file").map(name_of_file);
        if let Some(name) = entry.attribute("name").or_else(of_file) {
            out.entry(name).or_insert(entry.id());
        }
    }
    out
}

/// The last part of a path.
fn last_part(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// The name of a file without its folder and its ending, which is the name of a mesh that has no other.
pub(super) fn name_of_file(path: &str) -> &str {
    let file = last_part(path);
    file.rsplit_once('.').map_or(file, |(name, _)| name)
}

/// A mesh whose corners and triangles stand in the description.
fn inline_mesh(entry: &Node, corners: &str, triangles: &str) -> Result<TriangleMesh, String> {
    let corners = numbers(entry, "vertex", corners)?;
    let places: Option<Vec<usize>> = triangles.split_whitespace().map(|word| word.parse().ok()).collect();
    let places = places.filter(|places| places.len() % 3 == 0 && corners.len() % 3 == 0);
    let says = "expected triples of numbers in `vertex` and of places in `face`";
    let mesh = TriangleMesh {
        corners: corners
            .chunks_exact(3)
            .map(|c| Vector3::new(c[0], c[1], c[2]))
            .collect(),
        triangles: (places.ok_or_else(|| located_message(entry, says))?.chunks_exact(3))
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
    };
    mesh.checked().map_err(|fault| located_message(entry, &fault))
}
