//! Numeric kinematics of the imported frames. Values of the variables go in; poses of frames, gaps of loop closures and
//! their Jacobian come out, and values at which the loops close.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::placed::{DescriptionPose, rotation_about};

/// One elementary motion of a frame: `ratio*variable + offset` about or along an axis of the frame.
#[derive(Clone, Copy)]
pub(crate) struct ChainMotion {
    /// Whether it is a rotation; else a translation.
    pub(crate) is_turn: bool,
    /// Unit vector in the axes that the motions before have reached.
    pub(crate) axis: Vector3<f64>,
    /// Index of the variable; none for a constant.
    pub(crate) variable: Option<usize>,
    /// Factor of the variable.
    pub(crate) ratio: f64,
    /// Constant part, rad or m.
    pub(crate) offset: f64,
}

/// A frame: a fixed pose in its parent, then its motions.
pub(crate) struct ChainFrame {
    /// Index of the parent; none is the base.
    pub(crate) on: Option<usize>,
    /// Fixed pose in the parent.
    pub(crate) at: DescriptionPose,
    /// Motions in sequence.
    pub(crate) moves: Vec<ChainMotion>,
}

/// Two points of two frames that coincide when the loops are closed.
#[derive(Clone, Copy)]
pub(crate) struct CoincidentPair {
    /// Frame (none is the base) and the point in it, m.
    pub(crate) ends: [(Option<usize>, Vector3<f64>); 2],
    /// Index of the closure.
    pub(crate) closure: usize,
}

/// A frame at given values of the variables.
struct PosedFrame {
    /// Its pose in the base.
    at: DescriptionPose,
    /// Axis and origin of each motion, in the base.
    moves: Vec<(Vector3<f64>, Vector3<f64>)>,
}

/// All frames of a mechanism.
pub(crate) struct FrameChain {
    /// Frames; parents stand before their children.
    pub(crate) nodes: Vec<ChainFrame>,
    /// Number of variables.
    pub(crate) n_variables: usize,
}

impl FrameChain {
    /// Forward kinematics: all frames in the base.
    fn pose(&self, values: &[f64]) -> Vec<PosedFrame> {
        let mut out: Vec<PosedFrame> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            // The fixed pose, then one motion after the other.
            let mut at = node
                .on
                .map_or(DescriptionPose::identity(), |on| out[on].at)
                .compose(&node.at);
            let mut moves = Vec::new();
            for motion in &node.moves {
                let value = motion.variable.map_or(0.0, |v| motion.ratio * values[v]) + motion.offset;
                // The axis as the motions before have left it.
                moves.push((at.r * motion.axis, at.p));
                at = at.compose(&if motion.is_turn {
                    DescriptionPose {
                        p: Vector3::zeros(),
                        r: rotation_about(&motion.axis, value),
                    }
                } else {
                    DescriptionPose {
                        p: motion.axis * value,
                        r: Matrix3::identity(),
                    }
                });
            }
            out.push(PosedFrame { at, moves });
        }
        out
    }

    /// Gaps of all pairs (three rows each, m), their Jacobian with respect to the variables, and the size of the
    /// mechanism: the largest coordinate of a closure point, m.
    pub(crate) fn gaps(&self, pairs: &[CoincidentPair], values: &[f64]) -> (DVector<f64>, DMatrix<f64>, f64) {
        let posed = self.pose(values);
        let mut gaps = DVector::zeros(3 * pairs.len());
        let mut rows = DMatrix::zeros(3 * pairs.len(), self.n_variables);
        // The size is at least a millimetre, also if all points are at the origin.
        let mut size = 1e-3_f64;
        for (k, pair) in pairs.iter().enumerate() {
            for ((frame, local), sign) in pair.ends.iter().zip([1.0, -1.0]) {
                // The point in the base, with opposite signs for both ends.
                let place = frame.map_or(DescriptionPose::identity(), |frame| posed[frame].at);
                let point = place.p + place.r * local;
                size = size.max(point.amax());
                let mut block = gaps.fixed_rows_mut::<3>(3 * k);
                block += sign * point;
                // Each motion between the frame and the base moves the point: columns of the geometric Jacobian.
                let mut here = *frame;
                while let Some(frame) = here {
                    let node = &self.nodes[frame];
                    for (motion, (axis, origin)) in node.moves.iter().zip(&posed[frame].moves) {
                        let Some(variable) = motion.variable else {
                            continue;
                        };
                        let rate = if motion.is_turn {
                            axis.cross(&(point - origin))
                        } else {
                            *axis
                        };
                        let mut block = rows.fixed_view_mut::<3, 1>(3 * k, variable);
                        block += sign * motion.ratio * rate;
                    }
                    here = node.on;
                }
            }
        }
        (gaps, rows, size)
    }

    /// Redefines the second point of each pair so that it coincides with the first at these values.
    pub(crate) fn align_pairs(&self, pairs: &mut [CoincidentPair], values: &[f64]) {
        let posed = self.pose(values);
        for pair in pairs {
            let [place, other] = pair
                .ends
                .map(|(frame, _)| frame.map_or(DescriptionPose::identity(), |frame| posed[frame].at));
            // The first point in the frame of the second one.
            let first = place.p + place.r * pair.ends[0].1;
            pair.ends[1].1 = other.r.transpose() * (first - other.p);
        }
    }

    /// Solves for values at which the pairs coincide, by damped Gauss-Newton steps with a pseudoinverse. Returns the
    /// largest remaining gap relative to the size, and the number of steps.
    pub(crate) fn close_pairs(&self, pairs: &[CoincidentPair], values: &mut [f64]) -> (f64, usize) {
        /// Largest step of a variable, rad or m.
        const LONGEST_STEP: f64 = 0.2;
        /// Steps after which the least gap has to be below [`LEAST_FALL`] times what it was.
        const PATIENCE: usize = 40;
        /// See [`PATIENCE`]. Steps towards a pose that exists lower the gap by far more.
        const LEAST_FALL: f64 = 0.99;
        // Without a condition there is nothing to solve, and no matrix to decompose.
        if pairs.is_empty() {
            return (0.0, 0);
        }
        let mut left = f64::INFINITY;
        // The least gap so far, and what it was at the last check.
        let (mut least, mut least_before) = (f64::INFINITY, f64::INFINITY);
        let mut n_steps = 0;
        while n_steps < 300 {
            n_steps += 1;
            let (gaps, rows, size) = self.gaps(pairs, values);
            let now = gaps.amax() / size;
            least = least.min(now);
            if n_steps % PATIENCE == 0 {
                if least > LEAST_FALL * least_before {
                    return (now, n_steps);
                }
                least_before = least;
            }
            // Close to rounding, a step that does not halve the gap is the last one.
            let is_idle = now >= 0.5 * left && now < 1e-12;
            left = now;
            if now < 1e-15 || is_idle {
                break;
            }
            // Small singular values are cut off: redundant conditions are usual in closed loops.
            let svd = rows.svd(true, true);
            let cut = 1e-7 * svd.singular_values.max();
            let Ok(step) = svd.solve(&gaps, cut) else {
                break;
            };
            // Shorten long steps, so that the assembly mode hardly changes.
            let scale = (LONGEST_STEP / step.amax()).min(1.0);
            if !scale.is_finite() {
                break;
            }
            for (value, step) in values.iter_mut().zip(step.iter()) {
                *value -= scale * step;
            }
        }
        (left, n_steps)
    }
}

/// Numeric rank of a matrix: the number of singular values above a share of the largest, and the smallest of these
/// relative to the largest.
pub(crate) fn rank(matrix: &DMatrix<f64>, share: f64) -> (usize, f64) {
    if matrix.is_empty() {
        return (0, 1.0);
    }
    let values = matrix.clone().singular_values();
    let largest = values.max();
    // Values that count, and the smallest of them.
    let kept: Vec<f64> = values
        .iter()
        .copied()
        .filter(|value| *value > share * largest && *value > 0.0)
        .collect();
    let least = kept.iter().fold(f64::INFINITY, |m, x| m.min(*x));
    (kept.len(), least / largest)
}
