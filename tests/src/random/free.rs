//! Mechanisms taken off their base: everything that stood on it hangs on a body that nothing holds.

use modelmill_spec::{
    CoordinateIdx, CoordinateMotion, DriveKind, FrameConvention, FrameIdx, FrameStep, FreeBody, JointCoordinate,
    Mechanism, ModelDrive, ModelFrame, TwistAxes,
};

/// The mechanism with a free body between base and all else, which carries what the base did.
///
/// Limits and names of recordings stay behind.
#[must_use]
pub fn hung_free(mut mechanism: Mechanism, linear: TwistAxes, angular: TwistAxes) -> Mechanism {
    let n = mechanism.coordinates.len();
    let names = ["bx", "by", "bz", "bqw", "bqx", "bqy", "bqz"];
    let motions = [CoordinateMotion::Prismatic; 3].into_iter().chain([
        CoordinateMotion::QuaternionScalar,
        CoordinateMotion::Quaternion,
        CoordinateMotion::Quaternion,
        CoordinateMotion::Quaternion,
    ]);
    for (name, motion) in names.into_iter().zip(motions) {
        mechanism.coordinates.push(JointCoordinate {
            name: name.to_owned(),
            motion,
            passive: false,
            nominal: f64::from(u8::from(motion == CoordinateMotion::QuaternionScalar)),
        });
    }
    let at = |k: usize| CoordinateIdx(n + k);
    let body = FreeBody {
        position: [at(0), at(1), at(2)],
        quaternion: [at(3), at(4), at(5), at(6)],
        linear,
        angular,
    };
    for k in [0, 1, 2, 4, 5, 6] {
        mechanism.drives.push(ModelDrive {
            name: format!("on_{}", names[k]),
            kind: DriveKind::Joint(at(k)),
            is_driven: false,
        });
    }
    // The free frame comes right behind the base; what hung on the base hangs on it, and all others move up by one.
    for frame in &mut mechanism.frames[1..] {
        frame.parent = FrameIdx(frame.parent.0 + 1);
    }
    let free = ModelFrame {
        name: "floating".to_owned(),
        parent: FrameIdx(0),
        steps: vec![FrameStep::Free(body)],
        convention: FrameConvention::Transform("free".to_owned()),
    };
    mechanism.frames.insert(1, free);
    let up = |frame: &mut FrameIdx| *frame = FrameIdx(frame.0 + 1);
    let effects = mechanism.effects.iter_mut();
    let bodies = effects.map(|effect| &mut effect.bodies);
    for bodies in bodies {
        bodies.parts.iter_mut().for_each(|part| up(&mut part.frame));
        bodies.lumped_masses.iter_mut().for_each(|mass| up(&mut mass.frame));
    }
    mechanism.points.iter_mut().for_each(|point| up(&mut point.frame));
    mechanism.parts.iter_mut().for_each(|part| up(&mut part.frame));
    mechanism.lumped_masses.iter_mut().for_each(|mass| up(&mut mass.frame));
    mechanism.name = format!("free_{}", mechanism.name);
    mechanism
}
