//! Random planar mechanisms of one loop.

use modelmill_spec::{
    CoordinateIdx, CoordinateMotion, ExactAngle, ExactExpression, FrameAxis, FrameIdx, FrameStep, KinematicLoop,
    Mechanism, ModelSymbol, PointIdx,
};

use super::{Draft, Matter, ZERO, number, ratio, shift, slide};
use crate::mechanics::{Jet, Numbers};

/// Least sine-like measure of how far the passive joints' motions at the closing point are from parallel.
const REGULAR: f64 = 0.35;

/// A random planar loop of two chains with three to five joints in all, closed by a revolute joint at their tips.
///
/// Two joints are passive. The second chain's base is placed so that the loop closes at the nominal pose.
pub fn planar_loop(seed: u64, matter: Matter) -> Mechanism {
    (0..)
        .find_map(|attempt| {
            let seed_of_attempt = seed.wrapping_mul(1000).wrapping_add(attempt);
            let mut mechanism = draw(seed_of_attempt, matter)?;
            mechanism.name = format!("loop_{seed}");
            Some(mechanism)
        })
        .expect("a regular loop comes up")
}

fn draw(seed: u64, matter: Matter) -> Option<Mechanism> {
    let mut draft = Draft::new("loop", seed, matter);
    let n = 3 + draft.stream.below(3);
    let n_left = 1 + draft.stream.below(n - 1);
    let mut joints = Vec::new();
    let left = draft.chain(FrameIdx(0), n_left, &mut joints);
    // The right chain hangs on a base frame whose place follows when all else is known.
    let (x, y) = (draft.constant("bx", 0.0, "m"), draft.constant("by", 0.0, "m"));
    let symbol = |i| ExactExpression::Symbol(ModelSymbol::Constant(i));
    let base_steps = vec![shift(FrameAxis::X, symbol(x)), shift(FrameAxis::Y, symbol(y))];
    let base = draft.frame(FrameIdx(0), base_steps);
    let right = draft.chain(base, n - n_left, &mut joints);
    draft.mechanism.loops.push(KinematicLoop {
        name: "closure".to_owned(),
        joins: [left, right],
    });
    let nominal: Vec<Jet> = draft
        .mechanism
        .coordinates
        .iter()
        .map(|c| Jet::constant(c.nominal))
        .collect();
    let gap = Numbers::new(&draft.mechanism, Vec::new()).gaps(&nominal);
    draft.mechanism.constants[x.0].value = gap[0].0[0];
    draft.mechanism.constants[y.0].value = gap[1].0[0];

    let first = draft.stream.below(n);
    let second = (first + 1 + draft.stream.below(n - 1)) % n;
    for passive in [first, second] {
        draft.mechanism.coordinates[joints[passive].0.0].passive = true;
    }
    if regularity(&draft.mechanism) < REGULAR || stands_still(&draft.mechanism) {
        return None;
    }
    draft.gravity(true);
    draft.bodies(1, true, matter);
    if matter != Matter::Physical {
        draft.lumps(true);
    }
    draft.drives(&joints, true);
    if !draft.drives_move() {
        return None;
    }
    if matter != Matter::Physical {
        draft.effects();
    }
    Some(draft.mechanism)
}

/// Whether a passive joint keeps its angle or length whatever the active ones do: a structure within the mechanism.
fn stands_still(mechanism: &Mechanism) -> bool {
    let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    let jacobian = Numbers::new(mechanism, Vec::new()).gap_jacobian(&nominal);
    let (passive, active): (Vec<usize>, Vec<usize>) =
        (0..nominal.len()).partition(|i| mechanism.coordinates[*i].passive);
    let rates = jacobian
        .select_columns(&passive)
        .svd(true, true)
        .solve(&jacobian.select_columns(&active), 1e-12)
        .expect("both factors were asked for");
    rates.row_iter().any(|row| row.amax() < 1e-3)
}

/// Sine of the angle between the velocities that the two passive joints give the closing point, at the nominal pose.
fn regularity(mechanism: &Mechanism) -> f64 {
    let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    regularity_at(mechanism, &nominal)
}

/// Sine of the angle between the velocities that the two passive joints give the closing point; 0 where one is slow.
pub fn regularity_at(mechanism: &Mechanism, coordinates: &[f64]) -> f64 {
    let jacobian = Numbers::new(mechanism, Vec::new()).gap_jacobian(coordinates);
    let passive: Vec<usize> = (0..coordinates.len())
        .filter(|i| mechanism.coordinates[*i].passive)
        .collect();
    let [a, b] = [jacobian.column(passive[0]), jacobian.column(passive[1])];
    let (na, nb) = (a.norm(), b.norm());
    if na.min(nb) < 0.15 {
        return 0.0;
    }
    (a[0] * b[1] - a[1] * b[0]).abs() / (na * nb)
}

impl Draft {
    /// A chain of `n` joints on `base`; returns its tip.
    fn chain(&mut self, base: FrameIdx, n: usize, joints: &mut Vec<(CoordinateIdx, FrameIdx)>) -> PointIdx {
        let mut frame = base;
        for i in 0..n {
            let motion = if self.stream.chance(0.75) {
                CoordinateMotion::Revolute
            } else {
                CoordinateMotion::Prismatic
            };
            let coordinate = self.coordinate(motion);
            let offset = if i == 0 { ZERO() } else { self.length(0.3, 0.9) };
            let mut steps = vec![shift(FrameAxis::X, offset)];
            if motion.is_angle() {
                steps.push(FrameStep::Rotate(
                    FrameAxis::Z,
                    ExactAngle {
                        pi: ratio(0, 1),
                        terms: vec![(ModelSymbol::Coordinate(coordinate), 1)],
                    },
                ));
            } else {
                let angle = if self.stream.chance(0.5) {
                    let value = self.stream.either_side(0.3, 1.3);
                    let constant = self.constant("a", value, "rad");
                    ExactAngle {
                        pi: ratio(0, 1),
                        terms: vec![(ModelSymbol::Constant(constant), 1)],
                    }
                } else {
                    ExactAngle {
                        pi: ratio(1, 2),
                        terms: Vec::new(),
                    }
                };
                steps.push(FrameStep::Rotate(FrameAxis::Z, angle));
                let axis = *self.stream.pick(&[FrameAxis::X, FrameAxis::Y]);
                steps.push(slide(axis, number(0), coordinate));
            }
            frame = self.frame(frame, steps);
            joints.push((coordinate, frame));
        }
        let mut tip = [self.length(0.3, 0.9), ZERO(), ZERO()];
        if self.stream.chance(0.3) {
            tip[1] = self.length(0.1, 0.5);
        }
        self.point(frame, tip)
    }
}
