//! Vectors of three expressions and elementary rotations.

use modelmill_spec::FrameAxis;

use crate::expr::{AtomAngleSum, ExprId, Graph, Rational};

/// Three components.
pub(crate) type SymbolicVector = [ExprId; 3];

/// The zero vector.
pub(crate) const ZERO: SymbolicVector = [Graph::ZERO; 3];

/// A rotation by `sum + pi12 * pi/12` about an axis of the frame reached so far.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AxisRotation {
    /// Axis of the frame that is rotated.
    pub(crate) axis: FrameAxis,
    /// Variable part of the angle, rad.
    pub(crate) sum: AtomAngleSum,
    /// Constant part of the angle, in multiples of pi/12.
    pub(crate) pi12: i32,
}

impl AxisRotation {
    /// Whether it is the identity by its form: no variable part, and full turns only.
    pub(crate) fn is_identity(&self) -> bool {
        self.sum.is_empty() && self.pi12.rem_euclid(24) == 0
    }
}

/// Appends a rotation to a product of rotations and merges it with the last one if the axes are equal.
pub(crate) fn push_rotation(turns: &mut Vec<AxisRotation>, turn: &AxisRotation) {
    if turn.is_identity() {
        return;
    }
    match turns.last_mut() {
        Some(last) if last.axis == turn.axis => {
            last.sum = last.sum.plus(&turn.sum, 1);
            last.pi12 = (last.pi12 + turn.pi12).rem_euclid(24);
            if last.is_identity() {
                turns.pop();
            }
        }
        _ => turns.push(turn.clone()),
    }
}

impl Graph {
    /// Sum of vectors in one frame.
    pub(crate) fn add_vectors(&mut self, vectors: &[SymbolicVector]) -> SymbolicVector {
        std::array::from_fn(|i| {
            let terms: Vec<_> = vectors.iter().map(|v| v[i]).collect();
            self.add_all(&terms)
        })
    }

    /// `a - b`, both in one frame.
    pub(crate) fn sub_vectors(&mut self, a: &SymbolicVector, b: &SymbolicVector) -> SymbolicVector {
        std::array::from_fn(|i| self.sub(a[i], b[i]))
    }

    /// `k * v`
    pub(crate) fn scale_vector(&mut self, k: ExprId, v: &SymbolicVector) -> SymbolicVector {
        std::array::from_fn(|i| self.mul(k, v[i]))
    }

    /// Scalar product of two vectors in one frame.
    pub(crate) fn dot(&mut self, a: &SymbolicVector, b: &SymbolicVector) -> ExprId {
        let terms = [0, 1, 2].map(|i| self.mul(a[i], b[i]));
        self.add_all(&terms)
    }

    /// Vector product of two vectors in one frame.
    pub(crate) fn cross(&mut self, a: &SymbolicVector, b: &SymbolicVector) -> SymbolicVector {
        std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (x, y) = (self.mul(a[j], b[k]), self.mul(a[k], b[j]));
            self.sub(x, y)
        })
    }

    /// Components, in the outer frame, of a vector given in the rotated frame.
    pub(crate) fn rotate_out(&mut self, turn: &AxisRotation, v: &SymbolicVector) -> SymbolicVector {
        self.rotate_by(turn, v, false)
    }

    /// Components, in the rotated frame, of a vector given in the outer frame.
    pub(crate) fn rotate_in(&mut self, turn: &AxisRotation, v: &SymbolicVector) -> SymbolicVector {
        self.rotate_by(turn, v, true)
    }

    /// Components of `v` after a rotation about one axis, by the angle of `turn` or, with `inverse`, by its negative.
    fn rotate_by(&mut self, turn: &AxisRotation, v: &SymbolicVector, inverse: bool) -> SymbolicVector {
        let (c, s) = self.cos_sin(&turn.sum, turn.pi12);
        let s = if inverse { self.neg(s) } else { s };
        let axis = turn.axis as usize;
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        // The component along the axis is unchanged; the other two are rotated in their plane.
        let mut out = *v;
        let products = [(c, v[i]), (s, v[j]), (s, v[i]), (c, v[j])].map(|(a, b)| self.mul(a, b));
        out[i] = self.sub(products[0], products[1]);
        out[j] = self.add(products[2], products[3]);
        out
    }

    /// Linear combination with rational factors.
    pub(crate) fn linear_combination(&mut self, terms: impl IntoIterator<Item = (ExprId, Rational)>) -> ExprId {
        let terms: Vec<_> = terms.into_iter().collect();
        self.sum(&terms)
    }
}
