//! Which inertial parameters of each link of a tree have an effect, and which may move to the link before, in closed
//! form link by link.
//!
//! The forces of a tree vanish for a change of the parameters exactly if all elements `M_jk` of the mass matrix vanish,
//! where gravity counts as the acceleration of one more coordinate k of the base. Each element is linear in the
//! inertia of a link, `w' I v`, with the twists w and v that the coordinates j and k give to the link. So three spaces
//! are carried from the base to the ends: the twists v that occur, the functionals `w' I v` that occur, and the part of
//! the functionals that the link's own joint changes. Where these last ones vanish, inertia may move to the parent
//! (Gautier and Khalil 1990 for single joints; Wensing, Niemeyer and Slotine, "Observability in inertial parameter
//! identification", 2017, for the recursion).
//!
//! Decision: functionals are carried as pairs of twists at the same pose. The products of two spaces of twists would be
//! too many, because twists at different poses never occur together.

use modelmill_algebra::eliminate::RowEchelonForm;
use modelmill_algebra::field::FieldElement;

/// Number of inertial parameters of a link.
pub(super) const PARAMETERS: usize = 10;

/// Position of the element (a, b) of a symmetric matrix of four rows among its ten elements.
const POSITION: [[usize; 4]; 4] = [[0, 1, 2, 6], [1, 3, 4, 7], [2, 4, 5, 8], [6, 7, 8, 9]];

/// A symmetric matrix of four rows: of the second moments, first moments and mass of a link (its pseudo-inertia), or of
/// a functional of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SymmetricFour<const P: u64>(pub(super) [FieldElement<P>; PARAMETERS]);

impl<const P: u64> SymmetricFour<P> {
    /// All elements zero.
    pub(super) const ZERO: Self = Self([FieldElement::ZERO; PARAMETERS]);

    /// The pseudo-inertia from mass, first moments, and the inertia matrix in the order xx, xy, xz, yy, yz, zz.
    pub(super) fn from_inertia(
        mass: FieldElement<P>,
        first: [FieldElement<P>; 3],
        inertia: [FieldElement<P>; 6],
    ) -> Self {
        let half = FieldElement::from_i64(2).inverse().unwrap_or(FieldElement::ZERO);
        let [xx, xy, xz, yy, yz, zz] = inertia;
        let total = (xx + yy + zz) * half;
        let [x, y, z] = first;
        Self([total - xx, -xy, -xz, total - yy, -yz, total - zz, x, y, z, mass])
    }

    /// `T S T'`: moves a pseudo-inertia from a link to its parent.
    fn moved_out(&self, pose: &LinkPose<P>) -> Self {
        self.transformed(&pose.matrix())
    }

    /// `T' S T`: the functional of a link's inertia that has the value of this one of the parent's.
    fn moved_in(&self, pose: &LinkPose<P>) -> Self {
        let t = pose.matrix();
        let transposed: [[FieldElement<P>; 4]; 4] = std::array::from_fn(|a| std::array::from_fn(|b| t[b][a]));
        self.transformed(&transposed)
    }

    /// `T S T'`.
    fn transformed(&self, t: &[[FieldElement<P>; 4]; 4]) -> Self {
        let mut left = [[FieldElement::ZERO; 4]; 4];
        for (row, out) in t.iter().zip(&mut left) {
            for (factor, elements) in row.iter().zip(&POSITION) {
                if *factor == FieldElement::ZERO {
                    continue;
                }
                for (x, position) in out.iter_mut().zip(elements) {
                    *x = x.plus_product(*factor, self.0[*position]);
                }
            }
        }
        let mut found = Self::ZERO;
        for a in 0..4 {
            for b in a..4 {
                let mut sum = FieldElement::ZERO;
                for (x, y) in left[a].iter().zip(&t[b]) {
                    if *y != FieldElement::ZERO {
                        sum = sum.plus_product(*x, *y);
                    }
                }
                found.0[POSITION[a][b]] = sum;
            }
        }
        found
    }

    /// A functional as a row by which the ten elements are multiplied: elements off the diagonal occur twice.
    fn row(&self) -> Vec<FieldElement<P>> {
        let twice = |a: usize| self.0[a] + self.0[a];
        let mut row: Vec<FieldElement<P>> = (0..PARAMETERS).map(twice).collect();
        for a in 0..4 {
            row[POSITION[a][a]] = self.0[POSITION[a][a]];
        }
        row
    }

    /// Adds another matrix.
    pub(super) fn add(&mut self, other: &Self) {
        for (x, y) in self.0.iter_mut().zip(&other.0) {
            *x = *x + *y;
        }
    }

    /// The value of a functional, given as a row, of this pseudo-inertia.
    pub(super) fn weighted(&self, row: &[FieldElement<P>]) -> FieldElement<P> {
        let pairs = self.0.iter().zip(row).filter(|(x, _)| **x != FieldElement::ZERO);
        pairs.fold(FieldElement::ZERO, |sum, (x, y)| sum.plus_product(*x, *y))
    }

    fn minus(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|a| self.0[a] - other.0[a]))
    }
}

/// Angular velocity, and velocity of the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct FieldTwist<const P: u64> {
    /// Angular velocity, in the link's axes.
    pub(super) angular: [FieldElement<P>; 3],
    /// Velocity of the link's origin, in its axes.
    pub(super) linear: [FieldElement<P>; 3],
}

impl<const P: u64> FieldTwist<P> {
    /// The twist with one component.
    fn unit(component: usize) -> Self {
        let mut parts = [[FieldElement::ZERO; 3]; 2];
        parts[component / 3][component % 3] = FieldElement::ONE;
        let [angular, linear] = parts;
        Self { angular, linear }
    }

    fn row(&self) -> Vec<FieldElement<P>> {
        [self.angular, self.linear].concat()
    }

    /// The same motion at a link whose pose relative to the present frame is given, in the link's axes.
    fn moved_in(&self, pose: &LinkPose<P>) -> Self {
        let swung = cross(&self.angular, &pose.position);
        let linear: [FieldElement<P>; 3] = std::array::from_fn(|i| self.linear[i] + swung[i]);
        Self {
            angular: pose.to_link(&self.angular),
            linear: pose.to_link(&linear),
        }
    }

    /// The functional `w' I v` of the pseudo-inertia, for this twist w.
    fn paired_with(&self, other: &Self) -> SymmetricFour<P> {
        // The velocity of the point x is linear in (x, 1), so that its square is a quadratic form in (x, 1).
        let [left, right] = [self.velocity_matrix(), other.velocity_matrix()];
        let half = FieldElement::from_i64(2).inverse().unwrap_or(FieldElement::ZERO);
        let mut found = SymmetricFour::ZERO;
        for a in 0..4 {
            for b in a..4 {
                let mut sum = FieldElement::ZERO;
                for i in 0..3 {
                    sum = sum + left[i][a] * right[i][b] + left[i][b] * right[i][a];
                }
                found.0[POSITION[a][b]] = sum * half;
            }
        }
        found
    }

    /// `[omega]x` with the velocity of the origin as fourth column.
    fn velocity_matrix(&self) -> [[FieldElement<P>; 4]; 3] {
        let [x, y, z] = self.angular;
        let [u, v, w] = self.linear;
        let zero = FieldElement::ZERO;
        [[zero, -z, y, u], [z, zero, -x, v], [-y, x, zero, w]]
    }
}

fn cross<const P: u64>(a: &[FieldElement<P>; 3], b: &[FieldElement<P>; 3]) -> [FieldElement<P>; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

/// A link's pose relative to its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinkPose<const P: u64> {
    /// The link's axes in the parent's frame, as columns.
    pub(super) axes: [[FieldElement<P>; 3]; 3],
    /// Its origin in the parent's frame.
    pub(super) position: [FieldElement<P>; 3],
}

impl<const P: u64> LinkPose<P> {
    /// Components in the link's axes of a vector in the parent's.
    fn to_link(self, v: &[FieldElement<P>; 3]) -> [FieldElement<P>; 3] {
        self.axes.map(|axis| axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2])
    }

    /// The homogeneous matrix that maps points of the link to points of the parent.
    fn matrix(&self) -> [[FieldElement<P>; 4]; 4] {
        let zero = FieldElement::ZERO;
        let [x, y, z] = self.axes;
        let row = |i: usize| [x[i], y[i], z[i], self.position[i]];
        [row(0), row(1), row(2), [zero, zero, zero, FieldElement::ONE]]
    }
}

/// How a link moves relative to its parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LinkMobility {
    /// It is fixed to the parent.
    Fixed,
    /// It rotates about its z axis.
    Revolute,
    /// It translates along its z axis.
    Prismatic,
    /// It moves freely, on the base.
    Free,
}

impl LinkMobility {
    /// Number of joint positions at which the functions that a joint multiplies inertia with are independent: 1, c, s,
    /// c^2 and cs of an angle, or 1, q and q^2.
    pub(super) fn n_poses(self) -> usize {
        match self {
            Self::Fixed | Self::Free => 1,
            Self::Revolute => 5,
            Self::Prismatic => 3,
        }
    }
}

/// Dimensions of the spaces of a link, at which collecting may end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SpaceDimensions {
    /// Twists of the link.
    twists: usize,
    /// Functionals of its inertia.
    effective: usize,
    /// Functionals that vanish where inertia may move to the parent.
    own: usize,
}

impl SpaceDimensions {
    /// The largest dimensions that there can be.
    pub(super) const MOST: Self = Self {
        twists: 6,
        effective: PARAMETERS,
        own: PARAMETERS,
    };

    /// Number of functionals that are a link's own, which is the number of its base parameters.
    #[cfg(test)]
    pub(super) fn n_own(&self) -> usize {
        self.own
    }
}

/// The spaces of one link, for given constants.
#[derive(Clone, Debug)]
pub(super) struct LinkSpaces<const P: u64> {
    /// Twists that the coordinates up to the link's own, and gravity, give to it at all poses.
    twists: Vec<FieldTwist<P>>,
    /// Functionals of the link's inertia that occur in the mass matrix: inertia at which all vanish has no effect.
    effective: Vec<SymmetricFour<P>>,
    /// Functionals as rows: inertia at which all vanish has the effect of the moved inertia on the parent.
    own: Vec<Vec<FieldElement<P>>>,
    /// A pose relative to the parent at which inertia is moved.
    pose: LinkPose<P>,
}

/// Vectors that are independent, collected until a known dimension is reached.
struct IndependentVectors<const P: u64> {
    echelon: RowEchelonForm<P>,
    most: usize,
}

impl<const P: u64> IndependentVectors<P> {
    fn new(n: usize, most: usize) -> Self {
        let order: Vec<usize> = (0..n).collect();
        Self {
            echelon: RowEchelonForm::new(&order),
            most,
        }
    }

    fn is_full(&self) -> bool {
        self.echelon.pivots.len() >= self.most
    }

    /// Whether a vector is independent of those so far.
    fn insert(&mut self, row: Vec<FieldElement<P>>) -> bool {
        self.echelon.insert(row)
    }
}

impl<const P: u64> LinkSpaces<P> {
    /// The base: without a coordinate, and with the acceleration of gravity.
    pub(super) fn base(gravity: [FieldElement<P>; 3]) -> Self {
        let fall = FieldTwist {
            angular: [FieldElement::ZERO; 3],
            linear: gravity,
        };
        let has_gravity = gravity.iter().any(|x| *x != FieldElement::ZERO);
        Self {
            twists: if has_gravity { vec![fall] } else { Vec::new() },
            effective: Vec::new(),
            own: Vec::new(),
            pose: LinkPose {
                axes: [[FieldElement::ZERO; 3]; 3],
                position: [FieldElement::ZERO; 3],
            },
        }
    }

    /// The spaces of a link from those of its parent. `poses` has the link's poses relative to the parent at
    /// [`LinkMobility::n_poses`] different positions of its joint, and `most` the dimensions at which collecting ends.
    pub(super) fn next(&self, mobility: LinkMobility, poses: &[LinkPose<P>], most: SpaceDimensions) -> Self {
        let pose = poses[0];
        // The coordinates of the joint itself.
        let joint: Vec<FieldTwist<P>> = match mobility {
            LinkMobility::Fixed => Vec::new(),
            LinkMobility::Revolute => vec![FieldTwist::unit(2)],
            LinkMobility::Prismatic => vec![FieldTwist::unit(5)],
            LinkMobility::Free => (0..6).map(FieldTwist::unit).collect(),
        };
        let mut twists = Vec::new();
        let mut known = IndependentVectors::new(6, most.twists);
        let carried = poses
            .iter()
            .flat_map(|pose| self.twists.iter().map(|v| v.moved_in(pose)));
        for v in joint.iter().copied().chain(carried) {
            if known.is_full() {
                break;
            }
            if known.insert(v.row()) {
                twists.push(v);
            }
        }
        // What the joint changes, and what its own force is.
        let mut own = Vec::new();
        let mut changes = Vec::new();
        let mut known = IndependentVectors::new(PARAMETERS, most.own);
        let first: Vec<SymmetricFour<P>> = self.effective.iter().map(|f| f.moved_in(&pose)).collect();
        let forces = joint.iter().flat_map(|w| twists.iter().map(|v| w.paired_with(v)));
        let changed = poses[1..].iter().flat_map(|other| {
            let pairs = self.effective.iter().zip(&first);
            pairs.map(|(f, first)| f.moved_in(other).minus(first))
        });
        for functional in forces.chain(changed) {
            if known.is_full() {
                break;
            }
            if known.insert(functional.row()) {
                own.push(functional.row());
                changes.push(functional);
            }
        }
        // All that has an effect on the parent has one here, in addition to these.
        let mut effective = changes;
        for functional in first {
            if known.echelon.pivots.len() >= most.effective {
                break;
            }
            if known.insert(functional.row()) {
                effective.push(functional);
            }
        }
        Self {
            twists,
            effective,
            own,
            pose,
        }
    }

    /// The dimensions of its spaces.
    pub(super) fn dimensions(&self) -> SpaceDimensions {
        SpaceDimensions {
            twists: self.twists.len(),
            effective: self.effective.len(),
            own: self.own.len(),
        }
    }

    /// Functionals as rows: inertia at which all vanish has the effect of the moved inertia on the parent.
    pub(super) fn own_rows(&self) -> &[Vec<FieldElement<P>>] {
        &self.own
    }

    /// Functionals as rows: inertia at which all vanish has no effect.
    pub(super) fn effective_rows(&self) -> Vec<Vec<FieldElement<P>>> {
        self.effective.iter().map(SymmetricFour::row).collect()
    }

    /// The inertia of the parent that has the same effect as one of this link, if the link's own functionals vanish.
    pub(super) fn moved_out(&self, inertia: &SymmetricFour<P>) -> SymmetricFour<P> {
        inertia.moved_out(&self.pose)
    }
}
