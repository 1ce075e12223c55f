//! Triangle meshes: reads STL, OBJ and MSH, and integrates mass, centre and inertia over them.
//!
//! The integrals are sums over tetrahedra, one for each triangle, with the triangle as its base (B. Mirtich, "Fast and
//! accurate computation of polyhedral mass properties", J. of Graphics Tools 1(2), 1996, gives the same integrals by
//! faces). MuJoCo's three kinds differ in what is summed: see [`MeshInertia`].
//!
//! Decision: these are three readers of some twenty lines and not the crates `stl_io` and `tobj`. Only corners and
//! triangles are needed, and memory is reserved for what the bytes hold and not for what they state.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::description::DescriptionInertia;
use super::mesh_polygons::divide_polygon;
use super::placed::DescriptionPose;

/// Length of the header of a binary STL, bytes.
const STL_HEADER: usize = 80;
/// Length of one triangle of a binary STL: normal, three corners and two bytes.
const STL_TRIANGLE: usize = 50;
/// A volume below this share of the cube of the mesh's size is that of a flat mesh. By judgement: far above rounding,
/// far below a thin sheet.
const FLAT: f64 = 1e-9;

/// How the mass of a mesh is distributed: MuJoCo's attribute `inertia`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MeshInertia {
    /// Tetrahedra with their volumes as positive numbers: exact for convex meshes, too much for others.
    Legacy,
    /// Tetrahedra with signs: exact for each closed mesh whose triangles face outwards.
    Exact,
    /// The mass lies on the surface.
    Shell,
}

/// Triangles in space.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TriangleMesh {
    /// Corners, m.
    pub(super) corners: Vec<Vector3<f64>>,
    /// Three corners of each triangle, counterclockwise as seen from outside.
    pub(super) triangles: Vec<[usize; 3]>,
}

impl TriangleMesh {
    /// Reads a mesh from the bytes of a file; the ending of its name determines the format.
    ///
    /// Fails with a phrase that states the fault.
    pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Self, String> {
        let ending = name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
        match ending.as_str() {
            "stl" => Self::read_stl(bytes),
            "obj" => Self::read_obj(&String::from_utf8_lossy(bytes)),
            "msh" => Self::read_msh(bytes),
            _ => Err("only meshes in STL, OBJ and MSH files are read here".to_owned()),
        }
    }

    /// Reads a binary STL, the only one that MuJoCo reads.
    fn read_stl(bytes: &[u8]) -> Result<Self, String> {
        let count = bytes.get(STL_HEADER..STL_HEADER + 4);
        let count = count.and_then(|four| four.try_into().ok()).map(u32::from_le_bytes);
        let body = bytes.get(STL_HEADER + 4..).unwrap_or_default();
        let is_complete = count.is_some_and(|count| body.len() as u64 == u64::from(count) * STL_TRIANGLE as u64);
        if !is_complete {
            return Err("expected a binary STL whose length is that of its stated number of triangles".to_owned());
        }
        let number = |four: &[u8]| {
            four.try_into()
                .map_or(f64::NAN, |four| f64::from(f32::from_le_bytes(four)))
        };
        let mut mesh = Self::default();
        for triangle in body.chunks_exact(STL_TRIANGLE) {
            let first = mesh.corners.len();
            // The normal stands before the corners; it follows from them.
            for corner in triangle[12..48].chunks_exact(12) {
                let numbers = [0, 4, 8].map(|at| number(&corner[at..at + 4]));
                mesh.corners.push(Vector3::from(numbers));
            }
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        mesh.checked()
    }

    /// Reads an MSH, MuJoCo's own format: numbers of corners, normals, places in a texture and triangles; then all of these,
    /// as floats and whole numbers of 32 bits.
    fn read_msh(bytes: &[u8]) -> Result<Self, String> {
        let words: Vec<[u8; 4]> = (bytes.chunks_exact(4))
            .filter_map(|four| four.try_into().ok())
            .collect();
        let whole = |word: &[u8; 4]| usize::try_from(i32::from_le_bytes(*word)).ok();
        let layout = || {
            let counts = words.get(..4)?.iter().map(whole).collect::<Option<Vec<usize>>>()?;
            let lengths = [3_usize, 3, 2, 3].iter().zip(&counts);
            let lengths: Vec<usize> = lengths
                .map(|(each, count)| each.checked_mul(*count))
                .collect::<Option<_>>()?;
            let stated: u64 = lengths.iter().map(|length| *length as u64).sum();
            let is_complete = 4 * (4 + stated) == bytes.len() as u64;
            let (corners, others) = is_complete.then(|| words[4..].split_at(lengths[0]))?;
            Some((corners, &others[lengths[1] + lengths[2]..]))
        };
        let (corners, places) =
            layout().ok_or("expected an MSH whose length is that of its stated numbers of corners and triangles")?;
        let places: Option<Vec<usize>> = places.iter().map(whole).collect();
        let places = places.ok_or("a triangle of the mesh has a corner that does not exist")?;
        let numbers: Vec<f64> = corners
            .iter()
            .map(|word| f64::from(f32::from_le_bytes(*word)))
            .collect();
        let mesh = Self {
            corners: numbers
                .chunks_exact(3)
                .map(|c| Vector3::new(c[0], c[1], c[2]))
                .collect(),
            triangles: places.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        };
        mesh.checked()
    }

    /// Reads the corners and faces of an OBJ. Corners have 32 bits, as in MuJoCo.
    fn read_obj(text: &str) -> Result<Self, String> {
        let mut mesh = Self::default();
        for (i, line) in text.lines().enumerate() {
            let mut words = line.split_whitespace();
            let fault = |what: &str| format!("line {} of the mesh: {what}", i + 1);
            match words.next() {
                Some("v") => {
                    let numbers: Vec<f64> = words.take(3).filter_map(|word| word.parse().ok()).collect();
                    let [x, y, z] = numbers[..] else {
                        return Err(fault("expected three numbers after `v`"));
                    };
                    #[expect(clippy::cast_possible_truncation, reason = "MuJoCo keeps 32 bits")]
                    let short = [x, y, z].map(|x| f64::from(x as f32));
                    mesh.corners.push(Vector3::from(short));
                }
                Some("f") => {
                    let n = mesh.corners.len();
                    // A corner is `place`, `place/texture` or `place/texture/normal`; negative places count from the end.
                    let place = |word: &str| {
                        let place: i64 = word.split('/').next()?.parse().ok()?;
                        let from_start = if place < 0 {
                            n.checked_sub(usize::try_from(place.unsigned_abs()).ok()?)
                        } else {
                            usize::try_from(place).ok()?.checked_sub(1)
                        };
                        from_start.filter(|at| *at < n)
                    };
                    let corners: Option<Vec<usize>> = words.map(place).collect();
                    let Some(corners) = corners.filter(|corners| corners.len() >= 3) else {
                        return Err(fault("expected at least three corners that exist after `f`"));
                    };
                    mesh.triangles.extend(divide_polygon(&mesh.corners, &corners));
                }
                _ => {}
            }
        }
        mesh.checked()
    }

    /// The mesh, if it has triangles and all its corners are finite and exist.
    pub(super) fn checked(self) -> Result<Self, String> {
        if self.triangles.is_empty() {
            return Err("the mesh has no triangles".to_owned());
        }
        if self
            .triangles
            .iter()
            .flatten()
            .any(|corner| *corner >= self.corners.len())
        {
            return Err("a triangle of the mesh has a corner that does not exist".to_owned());
        }
        if !self.corners.iter().flat_map(Vector3::iter).all(|x| x.is_finite()) {
            return Err("a corner of the mesh is not finite".to_owned());
        }
        Ok(self)
    }

    /// Moves the corners into other axes, then scales them: `scale (R^T (x - p))` per axis, as MuJoCo's `refpos`,
    /// `refquat` and `scale` do. A mirrored mesh has its triangles turned round, so that they face outwards again.
    pub(super) fn placed(mut self, reference: &DescriptionPose, scale: [f64; 3]) -> Self {
        for corner in &mut self.corners {
            let turned = reference.r.transpose() * (*corner - reference.p);
            *corner = turned.component_mul(&Vector3::from(scale));
        }
        if scale.iter().product::<f64>() < 0.0 {
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self
    }

    /// Volume, centre and inertia. They are computed once for all shapes that are made of the mesh.
    ///
    /// Fails with a phrase if the mesh has no volume, or is open where it must be closed.
    pub(super) fn integrals(&self, kind: MeshInertia) -> Result<MeshIntegrals, String> {
        if kind == MeshInertia::Exact && !self.is_closed() {
            return Err("the mesh is not closed, as `inertia=\"exact\"` needs it".to_owned());
        }
        // Centre of the surface, from which the volume is divided into tetrahedra.
        let faces = || self.triangles.iter().map(|triangle| triangle.map(|k| self.corners[k]));
        let (mut area, mut middle) = (0.0, Vector3::zeros());
        for [a, b, c] in faces() {
            let of_face = 0.5 * (b - a).cross(&(c - a)).norm();
            area += of_face;
            middle += of_face * (a + b + c) / 3.0;
        }
        if area <= 0.0 {
            return Err("the mesh has no surface".to_owned());
        }
        middle /= area;
        let size = area.sqrt();
        // Volume (or area) and centre.
        let (mut volume, mut centre) = (0.0, Vector3::zeros());
        for corners in faces() {
            let share = kind.share(corners.map(|corner| corner - middle));
            let [a, b, c] = corners;
            let of_face = (a + b + c) / 3.0;
            volume += share;
            centre += share * kind.centre(&of_face, &middle);
        }
        if volume <= FLAT * size.powi(if kind == MeshInertia::Shell { 2 } else { 3 }) {
            return Err("the mesh has no positive volume; its triangles must face outwards".to_owned());
        }
        centre /= volume;
        // Second moments about the centre: for a tetrahedron with one corner there, and for a triangle.
        let (mut second, mut total) = (Matrix3::zeros(), 0.0);
        for corners in faces() {
            let [a, b, c] = corners.map(|corner| corner - centre);
            let share = kind.share([a, b, c]);
            let sum = a + b + c;
            let products = a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose();
            second += share * products / if kind == MeshInertia::Shell { 12.0 } else { 20.0 };
            total += share;
        }
        Ok(MeshIntegrals {
            // The volume of tetrahedra from the centre of mass, which differs from that before for `Legacy`, is MuJoCo's.
            volume: total,
            centre,
            inertia: Matrix3::identity() * second.trace() - second,
        })
    }

    /// Whether each edge of a triangle is that of another one in the opposite direction. Corners at one place count as
    /// one, since an STL has three for each triangle.
    fn is_closed(&self) -> bool {
        let mut places: BTreeMap<[u64; 3], usize> = BTreeMap::new();
        let place: Vec<usize> = (self.corners.iter())
            .map(|corner| {
                // Zeros of both signs are one place.
                let key = [corner.x, corner.y, corner.z].map(|x| (x + 0.0).to_bits());
                let next = places.len();
                *places.entry(key).or_insert(next)
            })
            .collect();
        let mut edges: BTreeMap<(usize, usize), i64> = BTreeMap::new();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|corner| place[corner]);
            for (from, to) in [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from != to) {
                *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        edges.values().all(|balance| *balance == 0)
    }
}

/// Integrals over a mesh with the density 1.
#[derive(Clone, Debug)]
pub(super) struct MeshIntegrals {
    /// Volume, m^3; the area of a shell, m^2.
    volume: f64,
    /// Centre, m.
    centre: Vector3<f64>,
    /// Inertia about the centre, m^5; of a shell m^4.
    inertia: Matrix3<f64>,
}

impl MeshIntegrals {
    /// Mass, centre and inertia for a mass in kg, or else for a density in kg/m^3 (kg/m^2 for a shell).
    pub(super) fn inertial(&self, mass: Option<f64>, density: f64) -> DescriptionInertia {
        let mass = mass.unwrap_or(density * self.volume);
        DescriptionInertia {
            mass,
            at: DescriptionPose {
                p: self.centre,
                r: Matrix3::identity(),
            },
            inertia: self.inertia * (mass / self.volume),
        }
    }
}

impl MeshInertia {
    /// Volume of the tetrahedron between the origin and a triangle, m^3, or the area of the triangle, m^2.
    fn share(self, [a, b, c]: [Vector3<f64>; 3]) -> f64 {
        match self {
            Self::Legacy => (a.cross(&b).dot(&c) / 6.0).abs(),
            Self::Exact => a.cross(&b).dot(&c) / 6.0,
            Self::Shell => 0.5 * (b - a).cross(&(c - a)).norm(),
        }
    }

    /// The centre of a tetrahedron between a triangle with centre `of_face` and the corner `apex`, or of the triangle.
    fn centre(self, of_face: &Vector3<f64>, apex: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Legacy | Self::Exact => 0.75 * of_face + 0.25 * apex,
            Self::Shell => *of_face,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed body with the outline of an L, 2 m by 3 m with arms of 1 m, and 0.5 m thick.
    fn letter() -> TriangleMesh {
        let outline = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)];
        let n = outline.len();
        let level = |z: f64| outline.map(|(x, y)| Vector3::new(x, y, z));
        let mut triangles = Vec::new();
        for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]] {
            triangles.extend([[a, c, b], [a + n, b + n, c + n]]);
        }
        for i in 0..n {
            let j = (i + 1) % n;
            triangles.extend([[i, j, j + n], [i, j + n, i + n]]);
        }
        TriangleMesh {
            corners: level(0.0).into_iter().chain(level(0.5)).collect(),
            triangles,
        }
    }

    fn assert_near(found: &DescriptionInertia, mass: f64, centre: [f64; 3], moments: [f64; 3]) {
        let mut own: Vec<f64> = found.inertia.symmetric_eigenvalues().iter().copied().collect();
        own.sort_by(|a, b| b.total_cmp(a));
        let off = |a: f64, b: f64| (a - b).abs() / b.abs();
        assert!(off(found.mass, mass) < 1e-12, "{}", found.mass);
        assert!((found.at.p - Vector3::from(centre)).norm() < 1e-8, "{}", found.at.p);
        assert!(own.iter().zip(moments).all(|(a, b)| off(*a, b) < 1e-8), "{own:?}");
    }

    /// The numbers are those of MuJoCo 4.0.0 for the same corners and triangles with 100 kg/m^3.
    #[test]
    fn masses_of_a_letter_are_those_of_mujoco() {
        let of = |kind| letter().integrals(kind).unwrap().inertial(None, 100.0);
        let exact = [208.333_333_333, 170.833_333_333, 45.833_333_333];
        assert_near(&of(MeshInertia::Exact), 200.0, [0.75, 1.25, 0.25], exact);
        let shell = [1_636.538_461_54, 1_323.567_044_35, 433.804_750_52];
        assert_near(&of(MeshInertia::Shell), 1300.0, [10.0 / 13.0, 16.5 / 13.0, 0.25], shell);
        let legacy = [211.702_060_62, 172.060_940_49, 48.176_248_73];
        let place = [0.774_362_91, 1.242_154_32, 0.25];
        assert_near(&of(MeshInertia::Legacy), 208.071_810_602_485_44, place, legacy);
    }

    /// The same body from each format, also mirrored.
    #[test]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "small numbers, and halves"
    )]
    fn all_formats_give_one_body() {
        let body = letter();
        let corners = body.corners.iter().map(|v| format!("v {} {} {}\n", v.x, v.y, v.z));
        // The last corner of each triangle is counted from the end.
        let last = |corner: usize| corner as i64 - 12;
        let triangles = (body.triangles.iter()).map(|[a, b, c]| format!("f {}/1/1 {}//2 {}\n", a + 1, b + 1, last(*c)));
        let obj = corners.chain(triangles).collect::<Vec<_>>().concat();
        let mut stl = vec![0; STL_HEADER];
        stl.extend(u32::try_from(body.triangles.len()).unwrap().to_le_bytes());
        for triangle in &body.triangles {
            stl.extend([0; 12]);
            for corner in triangle {
                stl.extend(body.corners[*corner].iter().flat_map(|x| (*x as f32).to_le_bytes()));
            }
            stl.extend([0; 2]);
        }
        // One normal and one place in a texture, which are passed over.
        let mut msh: Vec<u8> = [12, 1, 1, body.triangles.len()]
            .iter()
            .flat_map(|n| (*n as i32).to_le_bytes())
            .collect();
        let floats = body
            .corners
            .iter()
            .flat_map(|corner| corner.iter().map(|x| *x as f32).collect::<Vec<f32>>());
        msh.extend(floats.chain([0.0; 5]).flat_map(f32::to_le_bytes));
        msh.extend(body.triangles.iter().flatten().flat_map(|k| (*k as i32).to_le_bytes()));
        let want = body.integrals(MeshInertia::Exact).unwrap().inertial(Some(3.0), 0.0);
        for mesh in [
            TriangleMesh::read("l.msh", &msh),
            TriangleMesh::read("l.OBJ", obj.as_bytes()),
            TriangleMesh::read("l.stl", &stl),
        ] {
            let mesh = mesh.unwrap();
            assert_eq!(
                mesh.integrals(MeshInertia::Exact)
                    .unwrap()
                    .inertial(Some(3.0), 0.0)
                    .inertia,
                want.inertia
            );
            // A mirrored mesh still faces outwards.
            let mirrored = mesh.placed(&DescriptionPose::identity(), [-1.0, 1.0, 1.0]);
            let found = mirrored.integrals(MeshInertia::Exact).unwrap().inertial(Some(3.0), 0.0);
            assert!((found.at.p.x + want.at.p.x).abs() + (found.mass - 3.0).abs() < 1e-12);
        }
    }

    #[test]
    fn faults_of_meshes_are_stated() {
        let fault = |name: &str, bytes: &[u8]| TriangleMesh::read(name, bytes).unwrap_err();
        assert!(fault("a.stl", b"solid a").contains("binary STL"));
        let mut long = vec![0; STL_HEADER];
        long.extend(u32::MAX.to_le_bytes());
        assert!(fault("a.stl", &long).contains("stated number of triangles"));
        assert!(fault("a.dae", b"").contains("STL, OBJ and MSH"));
        for words in [&[1, 0, 0, 1, 7][..], &[-1, 0, 0, 0], &[i32::MAX; 4], &[3]] {
            let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
            assert!(fault("a.msh", &bytes).contains("expected an MSH"));
        }
        let minus: Vec<u8> = [0, 0, 0, 1, -1, 0, 0]
            .iter()
            .flat_map(|word: &i32| word.to_le_bytes())
            .collect();
        assert!(fault("a.msh", &minus).contains("does not exist"));
        assert!(fault("a.obj", b"v 0 0\n").contains("line 1"));
        assert!(fault("a.obj", b"v 0 0 0\nf 1 1 2\n").contains("line 2"));
        assert!(fault("a.obj", b"v 0 0 nan\nf 1 1 1\n").contains("not finite"));
        assert!(fault("a.obj", b"v 0 0 0\n").contains("no triangles"));
        let mut open = letter();
        open.triangles.pop();
        let inertial = |mesh: &TriangleMesh, kind| mesh.integrals(kind).map(|one| one.inertial(None, 1.0).mass);
        assert!(inertial(&open, MeshInertia::Exact).unwrap_err().contains("not closed"));
        let mut inside_out = letter();
        inside_out.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        assert!(
            inertial(&inside_out, MeshInertia::Exact)
                .unwrap_err()
                .contains("face outwards")
        );
        let mut flat = letter();
        flat.corners.iter_mut().for_each(|corner| corner.z = 0.0);
        assert!(
            inertial(&flat, MeshInertia::Legacy)
                .unwrap_err()
                .contains("no positive volume")
        );
    }
}
