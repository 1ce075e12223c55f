//! Limits of robot descriptions.

/// Longest text that is read, bytes. By judgement: the largest published MJCF with meshes in other files has 1 MB.
pub const LARGEST_DESCRIPTION: usize = 16 << 20;

/// Largest file of a mesh, bytes. MuJoCo reads at most 200 000 triangles from an STL, which are 10 MB; as OBJ they take up
/// to five times as much.
pub const LARGEST_MESH: u64 = 64 << 20;

/// Deepest nesting of XML elements. Readers use some kilobytes of the stack per level, and threads have 2 MB: 600
/// levels overflowed it. Published robots have less than 60 levels.
pub(super) const DEEPEST_ELEMENT: usize = 200;

/// Most attributes of one element; the formats define less than 60 for any element. The parser's cost per element is
/// the square of their number.
pub(super) const MOST_ATTRIBUTES: usize = 500;

/// Most tags, comments and attributes of a text together. The parser keeps some 100 bytes of each, which is ten to twenty
/// times their size for the smallest ones, so that this many take some 50 MB. Published robots have less than 50 000; 15 000
/// links with inertias have 420 000.
pub(super) const MOST_XML_NODES: usize = 500_000;

/// Most links or bodies, each of which takes some kilobytes. Published robots have less than 1000.
pub(super) const MOST_LINKS: usize = 30_000;

/// Longest file of closures, bytes. Published ones have some kilobytes; a list of names takes forty times its size.
pub(super) const LARGEST_CLOSURES: usize = 1 << 20;

/// Most joints that move. By judgement: models have at most 100 coordinates, and each joint becomes entries of the model
/// file, of which a table has at most 1000.
pub(super) const MOST_MOVING_JOINTS: usize = 1000;

/// Most elements of one kind whose names are searched for each other, such as sites, tendons or default classes. The
/// search takes the square of their number: about a second for this one. Published robots have some hundreds.
pub(super) const MOST_NAMED_ELEMENTS: usize = 5000;

/// Most loop closures. Each is a condition of one dense system of equations. Published robots have less than 20.
pub(super) const MOST_CLOSURES: usize = 200;

/// Largest difference (rad or m, and relative) between the value given for a joint and the one by its coupling. By
/// judgement: typed values have few digits, and a difference that matters is larger.
pub(super) const COUPLED_VALUES: f64 = 1e-4;

/// Largest ratio of an entry of an inertia or a first moment to the largest one that counts as rounding of a rotation.
/// Rounding of some rotations in sequence is below 1e-15; values that CAD exports have are above 1e-9.
pub(super) const ROUNDING_OF_ROTATION: f64 = 1e-14;
