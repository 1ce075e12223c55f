//! Reactions of joints and loops, as emitted models return them.

/// A joint whose reaction a model computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joint {
    /// Name of its frame in the model file, followed by the coordinate where the frame has several joints.
    pub name: &'static str,
    /// Coordinates that move it.
    pub coordinates: &'static [&'static str],
    /// Axis of motion, `x`, `y` or `z`, in the axes in which the reaction is given.
    pub axis: char,
}

/// A closed loop whose force a model computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClosedLoop {
    /// Its name in the model file.
    pub name: &'static str,
    /// The joint in whose axes its force is given.
    pub axes: &'static str,
}

/// A force and a moment, component by component. `None` marks a component that the equations of motion do not
/// determine, because the mechanism is overconstrained there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench<T> {
    /// Force, N.
    pub force: [Option<T>; 3],
    /// Moment about the joint's origin, N m.
    pub moment: [Option<T>; 3],
}
