//! Random spatial trees of revolute and prismatic joints.

use modelmill_spec::{Angle, Axis, CoordinateIdx, FrameIdx, Mechanism, Motion, Step, Symbol};

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

const AXES: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

impl Draft {
    /// A fixed angle; `symbolic` allows a constant of the model.
    fn twist(&mut self, symbolic: bool) -> Angle {
        let quarters = small(self.stream.below(4));
        let choice = self.stream.below(20);
        if symbolic && choice < 5 {
            let value = self.stream.either_side(0.2, 1.4);
            let constant = self.constant("a", value, "rad");
            Angle {
                pi: ratio(0, 1),
                terms: vec![(Symbol::Constant(constant), 1)],
            }
        } else if choice < 7 {
            Angle {
                pi: ratio(small(self.stream.below(24)), 12),
                terms: Vec::new(),
            }
        } else {
            Angle {
                pi: ratio(quarters, 2),
                terms: Vec::new(),
            }
        }
    }

    /// A frame with one joint: by modified Denavit-Hartenberg or by steps about and along any axes.
    fn joint(&mut self, parent: FrameIdx, symbolic: bool) -> (CoordinateIdx, FrameIdx) {
        let motion = if self.stream.chance(0.7) {
            Motion::Revolute
        } else {
            Motion::Prismatic
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
        let mut axis = |fixed: Axis| {
            if general {
                *self.stream.pick(&AXES)
            } else {
                fixed
            }
        };
        let (about, along, joint, last) =
            (axis(Axis::X), axis(Axis::X), axis(Axis::Z), axis(Axis::Z));
        let turn = Angle {
            pi: ratio(0, 1),
            terms: vec![(Symbol::Coordinate(coordinate), 1)],
        };
        let mut steps = vec![Step::Rotate(about, twist), shift(along, a)];
        if motion.is_angle() {
            steps.push(Step::Rotate(joint, turn));
            steps.push(shift(last, d));
        } else {
            steps.push(slide(joint, d, coordinate));
            steps.push(Step::Rotate(last, self.twist(false)));
        }
        (coordinate, self.frame(parent, steps))
    }
}
