//! Limits of robot descriptions.

/// Longest text that is read, bytes. By judgement: the largest published MJCF with meshes in other files has 1 MB.
pub const LARGEST_DESCRIPTION: usize = 16 << 20;

/// Deepest nesting of XML elements. Readers use some kilobytes of the stack per level, and threads have 2 MB: 600
/// levels overflowed it. Published robots have less than 60 levels.
pub(super) const DEEPEST_ELEMENT: usize = 200;

/// Most attributes of one element; the formats define less than 60 for any element. The parser's cost per element is
/// the square of their number.
pub(super) const MOST_ATTRIBUTES: usize = 500;

/// Largest difference (rad or m, and relative) between the value given for a joint and the one by its coupling. By
/// judgement: typed values have few digits, and a difference that matters is larger.
pub(super) const COUPLED_VALUES: f64 = 1e-4;

/// Largest ratio of an entry of an inertia or a first moment to the largest one that counts as rounding of a rotation.
/// Rounding of some rotations in sequence is below 1e-15; values that CAD exports have are above 1e-9.
pub(super) const ROUNDING_OF_ROTATION: f64 = 1e-14;
