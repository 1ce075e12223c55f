//! Random spatial trees of revolute and prismatic joints.

use modelmill_spec::{
    CoordinateIdx, CoordinateMotion, ExactAngle, FrameAxis, FrameIdx, FrameStep, Mechanism, ModelSymbol,
};

use super::{Draft, Matter, ZERO, ratio, shift, slide, small};

/// A random tree of one to four joints; twists are multiples of pi/12 (mostly of pi/2) or symbols.
pub fn tree(seed: u64, matter: Matter) -> Mechanism {
    (0..)
        .find_map(|attempt| {
            let seed_of_attempt = seed.wrapping_mul(1000).wrapping_add(attempt);
            let mut mechanism = draw(seed_of_attempt, matter)?;
            mechanism.name = format!("tree_{seed}");
            Some(mechanism)
        })
        .expect("a tree whose drives move it comes up")
}

fn draw(seed: u64, matter: Matter) -> Option<Mechanism> {
    let mut draft = Draft::new("tree", seed, matter);
    let n = 1 + draft.stream.below(4);
    let mut joints: Vec<(CoordinateIdx, FrameIdx)> = Vec::new();
    for i in 0..n {
        let parent = if draft.stream.chance(0.75) {
            FrameIdx(draft.mechanism.frames.len() - 1)
        } else {
            FrameIdx(draft.stream.below(draft.mechanism.frames.len()))
        };
        joints.push(draft.joint(parent, i < 3));
    }
    draft.gravity(false);
    draft.bodies(1, false, matter);
    if matter != Matter::Physical {
        draft.lumps(false);
    }
    draft.drives(&joints, false);
    if !draft.drives_move() {
        return None;
    }
    if matter != Matter::Physical {
        draft.effects();
    }
    Some(draft.mechanism)
}

const AXES: [FrameAxis; 3] = [FrameAxis::X, FrameAxis::Y, FrameAxis::Z];

impl Draft {
    /// A fixed angle; `symbolic` allows a constant of the model.
    fn twist(&mut self, symbolic: bool) -> ExactAngle {
        let quarters = small(self.stream.below(4));
        let choice = self.stream.below(20);
        if symbolic && choice < 5 {
            let value = self.stream.either_side(0.2, 1.4);
            let constant = self.constant("a", value, "rad");
            ExactAngle {
                pi: ratio(0, 1),
                terms: vec![(ModelSymbol::Constant(constant), 1)],
            }
        } else if choice < 7 {
            ExactAngle {
                pi: ratio(small(self.stream.below(24)), 12),
                terms: Vec::new(),
            }
        } else {
            ExactAngle {
                pi: ratio(quarters, 2),
                terms: Vec::new(),
            }
        }
    }

    /// A frame with one joint: by modified Denavit-Hartenberg or by steps about and along any axes.
    fn joint(&mut self, parent: FrameIdx, symbolic: bool) -> (CoordinateIdx, FrameIdx) {
        let motion = if self.stream.chance(0.7) {
            CoordinateMotion::Revolute
        } else {
            CoordinateMotion::Prismatic
        };
        let coordinate = self.coordinate(motion);
        let twist = self.twist(symbolic);
        let offsets: [_; 2] = std::array::from_fn(|_| {
            if self.stream.chance(0.5) {
                ZERO()
            } else {
                self.length(0.2, 0.8)
            }
        });
        let [a, d] = offsets;
        let general = self.stream.chance(0.3);
        let mut axis = |fixed: FrameAxis| {
            if general { *self.stream.pick(&AXES) } else { fixed }
        };
        let (about, along, joint, last) = (
            axis(FrameAxis::X),
            axis(FrameAxis::X),
            axis(FrameAxis::Z),
            axis(FrameAxis::Z),
        );
        let turn = ExactAngle {
            pi: ratio(0, 1),
            terms: vec![(ModelSymbol::Coordinate(coordinate), 1)],
        };
        let mut steps = vec![FrameStep::Rotate(about, twist), shift(along, a)];
        if motion.is_angle() {
            steps.push(FrameStep::Rotate(joint, turn));
            steps.push(shift(last, d));
        } else {
            steps.push(slide(joint, d, coordinate));
            steps.push(FrameStep::Rotate(last, self.twist(false)));
        }
        (coordinate, self.frame(parent, steps))
    }
}
