//! A second opinion on kinematics and dynamics, numeric and slow, that shares no code with the mill.
//!
//! Poses are 4x4 matrices whose entries are truncated Taylor series in time. With the pseudo-inertia matrix J of a body,
//! its kinetic energy is `tr(X' J X'^T) / 2` (Uicker 1965), so that d'Alembert's principle reads
//! `power along dX = tr(dX J X''^T) - g . (m dp + dR mc)`. No recursion, no frames of links, no angular velocities.

use std::ops::{Add, Mul, Neg, Sub};

use modelmill_spec::{
    DriveKind, EffectPlace, ExactExpression, ExactFunction, FrameAxis, FrameStep, FreeBody, LumpedMass, Mechanics,
    Mechanism, ModelSymbol, PartInertia, PlaceQuantity, PointIdx, TwistAxes,
};
use nalgebra::{DMatrix, Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};

/// A value with its first and second derivative by time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet(pub [f64; 3]);

impl Jet {
    /// A constant.
    pub fn constant(value: f64) -> Self {
        Self([value, 0.0, 0.0])
    }

    fn function(self, f: f64, f1: f64, f2: f64) -> Self {
        let [_, v, a] = self.0;
        Self([f, f1 * v, f1 * a + f2 * v * v])
    }

    fn cos(self) -> Self {
        let (s, c) = self.0[0].sin_cos();
        self.function(c, -s, -c)
    }

    fn sin(self) -> Self {
        let (s, c) = self.0[0].sin_cos();
        self.function(s, c, -s)
    }

    /// 1 by it.
    #[must_use]
    pub fn recip(self) -> Self {
        let one = self.0[0].recip();
        self.function(one, -one * one, 2.0 * one * one * one)
    }

    /// Square root.
    #[must_use]
    pub fn sqrt(self) -> Self {
        let root = self.0[0].sqrt();
        self.function(root, 0.5 / root, -0.25 / (root * self.0[0]))
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let ([a, a1, a2], [b, b1, b2]) = (self.0, other.0);
        Self([a * b, a1 * b + a * b1, a2 * b + 2.0 * a1 * b1 + a * b2])
    }
}

/// A pose with its derivatives: `[rotation | position]` by rows.
#[derive(Clone, Debug)]
struct Pose([[Jet; 4]; 3]);

impl Pose {
    fn identity() -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| Jet::constant(f64::from(u8::from(i == j))))
        }))
    }

    fn then(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let moved = if j == 3 { self.0[i][3] } else { Jet::constant(0.0) };
                (0..3).fold(moved, |sum, k| sum + self.0[i][k] * other.0[k][j])
            })
        }))
    }

    fn rotation(axis: FrameAxis, angle: Jet) -> Self {
        let mut pose = Self::identity();
        let (j, k) = match axis {
            FrameAxis::X => (1, 2),
            FrameAxis::Y => (2, 0),
            FrameAxis::Z => (0, 1),
        };
        let (c, s) = (angle.cos(), angle.sin());
        pose.0[j][j] = c;
        pose.0[k][k] = c;
        pose.0[k][j] = s;
        pose.0[j][k] = -s;
        pose
    }

    fn translation(axis: FrameAxis, length: Jet) -> Self {
        let mut pose = Self::identity();
        pose.0[axis as usize][3] = length;
        pose
    }

    /// Derivatives of a rotation R with the angular velocity w in body axes: R' = R [w]x, and so on.
    fn free(body: &FreeBody, coordinates: &[Jet]) -> Self {
        let of = |i: modelmill_spec::CoordinateIdx, order: usize| coordinates[i.0].0[order];
        let [w, x, y, z] = body.quaternion.map(|i| of(i, 0));
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let turn: Matrix3<f64> = turn.to_rotation_matrix().into_inner();
        let vector = |all: &[modelmill_spec::CoordinateIdx], order: usize| Vector3::from_fn(|k, _| of(all[k], order));
        let angular = |order: usize| match body.angular {
            TwistAxes::Body => vector(&body.quaternion[1..], order),
            TwistAxes::World => turn.transpose() * vector(&body.quaternion[1..], order),
        };
        let (omega, alpha) = (angular(1), angular(2));
        let skew = omega.cross_matrix();
        let orders = [turn, turn * skew, turn * (skew * skew + alpha.cross_matrix())];
        let [velocity, change] = [1, 2].map(|order| vector(&body.position, order));
        let (velocity, acceleration) = match body.linear {
            TwistAxes::World => (velocity, change),
            TwistAxes::Body => (turn * velocity, turn * (change + omega.cross(&velocity))),
        };
        let place = [vector(&body.position, 0), velocity, acceleration];
        Self(std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                Jet(std::array::from_fn(|k| {
                    if j == 3 { place[k][i] } else { orders[k][(i, j)] }
                }))
            })
        }))
    }

    fn point(&self, at: [f64; 3]) -> [Jet; 3] {
        std::array::from_fn(|i| (0..3).fold(self.0[i][3], |sum, k| sum + self.0[i][k] * Jet::constant(at[k])))
    }

    /// The derivative of the given order as a 4x4 matrix.
    fn derivative(&self, order: usize) -> Matrix4<f64> {
        Matrix4::from_fn(|i, j| match i {
            3 => f64::from(u8::from(j == 3 && order == 0)),
            _ => self.0[i][j].0[order],
        })
    }
}

/// A mechanism in numbers.
#[derive(Clone, Debug)]
pub struct Numbers<'a> {
    mechanism: &'a Mechanism,
    constants: Vec<f64>,
    parameters: Vec<f64>,
}

/// A sum with the magnitude of what was summed, by which its rounding is judged.
#[derive(Clone, Copy, Debug, Default)]
pub struct Balance {
    /// The sum.
    pub value: f64,
    /// Sum of magnitudes.
    pub magnitude: f64,
}

impl Balance {
    fn add(&mut self, term: f64) {
        self.value += term;
        self.magnitude += term.abs();
    }
}

impl<'a> Numbers<'a> {
    /// The model file's constants with given values of the dynamic parameters.
    pub fn new(mechanism: &'a Mechanism, parameters: Vec<f64>) -> Self {
        Self {
            mechanism,
            constants: mechanism.constants.iter().map(|c| c.value).collect(),
            parameters,
        }
    }

    /// Value of an expression over constants and parameters.
    pub fn value(&self, exact: &ExactExpression) -> f64 {
        self.value_at(exact, &|_| unreachable!("no quantity of a place stands here"))
    }

    fn value_at(&self, exact: &ExactExpression, place: &dyn Fn(PlaceQuantity) -> f64) -> f64 {
        let value = |e: &ExactExpression| self.value_at(e, place);
        match exact {
            ExactExpression::Rational(r) => rational(r),
            ExactExpression::Pi => std::f64::consts::PI,
            ExactExpression::Symbol(ModelSymbol::Constant(i)) => self.constants[i.0],
            ExactExpression::Symbol(ModelSymbol::Parameter(i)) => self.parameters[i.0],
            ExactExpression::Symbol(ModelSymbol::Coordinate(_)) => {
                unreachable!("coordinates stand in steps alone")
            }
            ExactExpression::Symbol(ModelSymbol::Place(quantity)) => place(*quantity),
            ExactExpression::Sum(operands) => operands.iter().map(value).sum(),
            ExactExpression::Product(operands) => operands.iter().map(value).product(),
            ExactExpression::Quotient(a, b) => value(a) / value(b),
            ExactExpression::Negative(a) => -value(a),
            ExactExpression::Power(a, n) => value(a).powi(*n),
            ExactExpression::Apply(function, a) => {
                let a = value(a);
                match function {
                    ExactFunction::Sin => a.sin(),
                    ExactFunction::Cos => a.cos(),
                    ExactFunction::Sqrt => a.sqrt(),
                    ExactFunction::Abs => a.abs(),
                    ExactFunction::Sign => f64::from(i8::from(a > 0.0) - i8::from(a < 0.0)),
                    ExactFunction::Tanh => a.tanh(),
                    ExactFunction::Exp => a.exp(),
                }
            }
        }
    }

    /// An expression over coordinates, with its derivatives.
    fn jet(&self, exact: &ExactExpression, coordinates: &[Jet]) -> Jet {
        let jet = |exact: &ExactExpression| self.jet(exact, coordinates);
        match exact {
            ExactExpression::Symbol(ModelSymbol::Coordinate(i)) => coordinates[i.0],
            ExactExpression::Rational(_) | ExactExpression::Pi | ExactExpression::Symbol(_) => {
                Jet::constant(exact.evaluate(&|symbol| self.mechanism.symbol_nominal(symbol)))
            }
            ExactExpression::Sum(operands) => operands.iter().fold(Jet::constant(0.0), |sum, one| sum + jet(one)),
            ExactExpression::Product(operands) => operands.iter().fold(Jet::constant(1.0), |all, one| all * jet(one)),
            ExactExpression::Quotient(a, b) => jet(a) * jet(b).recip(),
            ExactExpression::Negative(a) => -jet(a),
            ExactExpression::Power(a, n) => {
                let power = (0..n.unsigned_abs()).fold(Jet::constant(1.0), |all, _| all * jet(a));
                if *n < 0 { power.recip() } else { power }
            }
            ExactExpression::Apply(function, a) => {
                let a = jet(a);
                match function {
                    ExactFunction::Sin => a.sin(),
                    ExactFunction::Cos => a.cos(),
                    ExactFunction::Sqrt => a.sqrt(),
                    ExactFunction::Abs if a.0[0] < 0.0 => -a,
                    ExactFunction::Abs => a,
                    ExactFunction::Sign => Jet::constant(a.0[0].signum()),
                    ExactFunction::Tanh => {
                        let (f, slope) = (a.0[0].tanh(), 1.0 - a.0[0].tanh().powi(2));
                        a.function(f, slope, -2.0 * f * slope)
                    }
                    ExactFunction::Exp => {
                        let f = a.0[0].exp();
                        a.function(f, f, f)
                    }
                }
            }
        }
    }

    fn vector(&self, exact: &[ExactExpression; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.value(&exact[i]))
    }

    /// Poses of all frames for coordinates with rates and accelerations.
    fn poses(&self, coordinates: &[Jet]) -> Vec<Pose> {
        let mut poses: Vec<Pose> = vec![Pose::identity()];
        for frame in &self.mechanism.frames[1..] {
            let mut pose = poses[frame.parent.0].clone();
            for step in &frame.steps {
                pose = pose.then(&match step {
                    FrameStep::Free(body) => Pose::free(body, coordinates),
                    FrameStep::Rotate(axis, angle) => {
                        let mut total = Jet::constant(rational(&angle.pi) * std::f64::consts::PI);
                        for (symbol, n) in &angle.terms {
                            let factor = Jet::constant(f64::from(*n));
                            total = total
                                + factor
                                    * match symbol {
                                        ModelSymbol::Constant(i) => Jet::constant(self.constants[i.0]),
                                        ModelSymbol::Coordinate(i) => coordinates[i.0],
                                        _ => unreachable!("an angle is made of angles"),
                                    };
                        }
                        Pose::rotation(*axis, total)
                    }
                    FrameStep::Translate(axis, length) => {
                        let mut total = Jet::constant(self.value(&length.offset));
                        for (i, factor) in &length.coordinates {
                            total = total + Jet::constant(rational(factor)) * coordinates[i.0];
                        }
                        Pose::translation(*axis, total)
                    }
                });
            }
            poses.push(pose);
        }
        poses
    }

    fn point(&self, poses: &[Pose], point: PointIdx) -> [Jet; 3] {
        let point = &self.mechanism.points[point.0];
        poses[point.frame.0].point(self.vector(&point.at))
    }

    /// Poses of all frames with their first and second time derivatives.
    pub fn motions(&self, coordinates: &[Jet]) -> Vec<[Matrix4<f64>; 3]> {
        let poses = self.poses(coordinates);
        let orders = |pose: &Pose| [0, 1, 2].map(|order| pose.derivative(order));
        poses.iter().map(orders).collect()
    }

    /// Where a point is, with derivatives.
    pub fn point_motion(&self, coordinates: &[Jet], point: PointIdx) -> [Jet; 3] {
        self.point(&self.poses(coordinates), point)
    }

    /// Pose that a frame's steps reach behind the one that a coordinate moves, and behind what follows along or about z.
    pub fn pose_behind(&self, coordinates: &[Jet], frame: usize, coordinate: usize) -> Matrix4<f64> {
        let moves = |step: &FrameStep| match step {
            FrameStep::Rotate(_, angle) => angle
                .terms
                .iter()
                .any(|(s, _)| matches!(s, ModelSymbol::Coordinate(c) if c.0 == coordinate)),
            FrameStep::Translate(_, length) => length.coordinates.iter().any(|(c, _)| c.0 == coordinate),
            FrameStep::Free(body) => {
                let mut all = body.position.iter().chain(&body.quaternion);
                all.any(|c| c.0 == coordinate)
            }
        };
        let axis = |step: &FrameStep| match step {
            FrameStep::Rotate(axis, _) | FrameStep::Translate(axis, _) => *axis,
            // Nothing follows along or about an axis of its own.
            FrameStep::Free(_) => FrameAxis::X,
        };
        let mut behind = self.mechanism.clone();
        let steps = &mut behind.frames[frame].steps;
        let joint = steps.iter().rposition(moves).expect("a joint of it");
        let mut end = joint + 1;
        if axis(&steps[joint]) == FrameAxis::Z {
            let more = steps[end..].iter().take_while(|s| axis(s) == FrameAxis::Z);
            end += more.count();
        }
        steps.truncate(end);
        let numbers = Numbers {
            mechanism: &behind,
            constants: self.constants.clone(),
            parameters: self.parameters.clone(),
        };
        numbers.poses(coordinates)[frame].derivative(0)
    }

    /// Frames and pseudo-inertias of all bodies but lumped masses.
    pub fn bodies(&self) -> Vec<(usize, Matrix4<f64>)> {
        let mut parts: Vec<&modelmill_spec::ModelPart> = self.mechanism.parts.iter().collect();
        let mut points = Vec::new();
        for effect in &self.mechanism.effects {
            parts.extend(&effect.bodies.parts);
            if effect.mechanics.is_some() {
                continue;
            }
            for place in &effect.places {
                let EffectPlace::Point(p) = place else {
                    continue;
                };
                let point = &self.mechanism.points[p.0];
                for term in &effect.terms {
                    let mass = self.parameters[term.parameter.0] * self.value(&term.expression);
                    let at = Vector3::from(self.vector(&point.at));
                    points.push((point.frame.0, point_mass(mass, at)));
                }
            }
        }
        let parts = parts
            .into_iter()
            .map(|part| (part.frame.0, self.pseudo_inertia(&part.inertial)));
        parts.chain(points).collect()
    }

    /// Frames and masses of lumped masses, with where the balances of forces and of moments see them.
    pub fn lumps(&self) -> Vec<(usize, f64, [f64; 3], [f64; 3])> {
        let mut lumps: Vec<&LumpedMass> = self.mechanism.lumped_masses.iter().collect();
        for effect in &self.mechanism.effects {
            lumps.extend(&effect.bodies.lumped_masses);
        }
        let one = |lump: &LumpedMass| {
            let mass = self.value(&lump.mass) * rational(&lump.share);
            let [force_at, moment_at] = [&lump.force_at, &lump.moment_at].map(|at| self.vector(at));
            (lump.frame.0, mass, force_at, moment_at)
        };
        lumps.into_iter().map(one).collect()
    }

    /// What effects on joints ask for, one force or torque per coordinate.
    pub fn effects_on_joints(&self, coordinates: &[Jet]) -> Vec<f64> {
        let drives = self.drives(coordinates);
        let mut forces = vec![0.0; coordinates.len()];
        for effect in &self.mechanism.effects {
            let motions: Vec<Option<Jet>> = (effect.places.iter())
                .map(|place| match place {
                    EffectPlace::Drive(d) => Some(drives[d.0]),
                    EffectPlace::Coordinate(i) => Some(coordinates[i.0]),
                    _ => None,
                })
                .collect();
            for (p, place) in effect.places.iter().enumerate() {
                let EffectPlace::Coordinate(i) = place else {
                    continue;
                };
                let other = motions[(p + 1) % motions.len()];
                let other = other.unwrap_or(Jet::constant(f64::NAN));
                for term in &effect.terms {
                    let quantity = quantity(coordinates[i.0], f64::NAN, other);
                    let parameter = self.parameters[term.parameter.0];
                    forces[i.0] += parameter * self.value_at(&term.expression, &quantity);
                }
            }
        }
        forces
    }

    /// Rods along drives: the drive, and moments of second, first and no order.
    pub fn rods(&self) -> Vec<(usize, [f64; 3])> {
        let mut rods = Vec::new();
        for effect in &self.mechanism.effects {
            for place in &effect.places {
                if let (Some(Mechanics::Rod), EffectPlace::Drive(d)) = (effect.mechanics, place) {
                    let moments = |k: usize| self.parameters[effect.terms[k].parameter.0];
                    rods.push((d.0, [0, 1, 2].map(moments)));
                }
            }
        }
        rods
    }

    /// Acceleration of free fall.
    pub fn gravity(&self) -> Vector3<f64> {
        Vector3::from(self.vector(&self.mechanism.gravity))
    }

    /// Distances of the points that loops join, with derivatives: three components per loop; then by how much each
    /// coordinate that follows others is off.
    pub fn gaps(&self, coordinates: &[Jet]) -> Vec<Jet> {
        let poses = self.poses(coordinates);
        let of_loops = self.mechanism.loops.iter().flat_map(|l| {
            let [a, b] = l.joins.map(|p| self.point(&poses, p));
            std::array::from_fn::<Jet, 3, _>(|i| a[i] - b[i])
        });
        let value = |exact: &ExactExpression| exact.evaluate(&|symbol| self.mechanism.symbol_nominal(symbol));
        let of_couplings = self.mechanism.couplings.iter().map(|coupling| {
            let own = coordinates[coupling.coordinate.0] - Jet::constant(value(&coupling.offset));
            let off = coupling.terms.iter().fold(own, |off, (i, factor)| {
                off - Jet::constant(value(factor)) * coordinates[i.0]
            });
            let function = coupling.function.iter();
            function.fold(off, |off, function| off - self.jet(&function.value, coordinates))
        });
        of_loops.chain(of_couplings).collect()
    }

    /// Derivatives of the gaps by the coordinates, one column each.
    pub fn gap_jacobian(&self, coordinates: &[f64]) -> DMatrix<f64> {
        let columns: Vec<Vec<Jet>> = (0..coordinates.len())
            .map(|i| self.gaps(&along(coordinates, i)))
            .collect();
        DMatrix::from_fn(columns[0].len(), columns.len(), |r, c| columns[c][r].0[1])
    }

    /// Lengths or angles of the drives with their derivatives.
    pub fn drives(&self, coordinates: &[Jet]) -> Vec<Jet> {
        let poses = self.poses(coordinates);
        self.mechanism
            .drives
            .iter()
            .map(|drive| match drive.kind {
                DriveKind::Joint(i) => coordinates[i.0],
                DriveKind::Linear { from, to } => {
                    let (a, b) = (self.point(&poses, from), self.point(&poses, to));
                    (0..3)
                        .fold(Jet::constant(0.0), |sum, i| sum + (b[i] - a[i]) * (b[i] - a[i]))
                        .sqrt()
                }
            })
            .collect()
    }

    /// What the drives must supply per unit of the virtual motion `direction` (one rate per coordinate), in W:
    /// inertia, weight and effects. The direction must satisfy the loops.
    pub fn virtual_power(&self, coordinates: &[Jet], direction: &[f64], load: &[f64]) -> Balance {
        let poses = self.poses(coordinates);
        let moved: Vec<Jet> = coordinates
            .iter()
            .zip(direction)
            .map(|(q, d)| Jet([q.0[0], *d, 0.0]))
            .collect();
        let displaced = self.poses(&moved);
        let gravity = Vector3::from(self.vector(&self.mechanism.gravity));
        let mut balance = Balance::default();
        for part in &self.mechanism.parts {
            let inertia = self.pseudo_inertia(&part.inertial);
            let (pose, change) = (&poses[part.frame.0], &displaced[part.frame.0]);
            add_body(&mut balance, pose, change, &inertia, &gravity);
        }
        for lump in &self.mechanism.lumped_masses {
            self.add_lump(
                &mut balance,
                &poses[lump.frame.0],
                &displaced[lump.frame.0],
                lump,
                &gravity,
            );
        }
        let (drives, drive_rates) = (self.drives(coordinates), self.drives(&moved));
        for effect in &self.mechanism.effects {
            for part in &effect.bodies.parts {
                let inertia = self.pseudo_inertia(&part.inertial);
                let (pose, change) = (&poses[part.frame.0], &displaced[part.frame.0]);
                add_body(&mut balance, pose, change, &inertia, &gravity);
            }
            for lump in &effect.bodies.lumped_masses {
                let (pose, change) = (&poses[lump.frame.0], &displaced[lump.frame.0]);
                self.add_lump(&mut balance, pose, change, lump, &gravity);
            }
            if let (Some(Mechanics::Strut), [EffectPlace::Point(a), EffectPlace::Point(b)]) =
                (effect.mechanics, effect.places.as_slice())
            {
                let ends = self.ends([*a, *b], [&poses, &displaced]);
                let values = [0, 1, 2].map(|i| self.parameters[effect.terms[i].parameter.0]);
                add_strut(&mut balance, &ends, values);
            }
            let motions: Vec<Option<Jet>> = (effect.places.iter())
                .map(|place| match place {
                    EffectPlace::Drive(d) => Some(drives[d.0]),
                    EffectPlace::Coordinate(i) => Some(coordinates[i.0]),
                    _ => None,
                })
                .collect();
            for (p, place) in effect.places.iter().enumerate() {
                let other = motions[(p + 1) % motions.len()];
                let other = other.unwrap_or(Jet::constant(f64::NAN));
                if let (Some(Mechanics::Rod), EffectPlace::Drive(d)) = (effect.mechanics, place) {
                    let [second, first, mass] = [0, 1, 2].map(|i| self.parameters[effect.terms[i].parameter.0]);
                    let DriveKind::Linear { from, to } = self.mechanism.drives[d.0].kind else {
                        panic!("a rod lies along a linear drive");
                    };
                    let ends = self.ends([from, to], [&poses, &displaced]);
                    add_rod(&mut balance, ends, [second, first, mass], &gravity);
                }
                if effect.mechanics.is_some() {
                    continue;
                }
                for term in &effect.terms {
                    let parameter = self.parameters[term.parameter.0];
                    match place {
                        EffectPlace::Point(p) => {
                            let point = &self.mechanism.points[p.0];
                            let factor = self.value(&term.expression);
                            let inertia = point_mass(parameter * factor, self.vector(&point.at).into());
                            let (pose, change) = (&poses[point.frame.0], &displaced[point.frame.0]);
                            add_body(&mut balance, pose, change, &inertia, &gravity);
                        }
                        EffectPlace::Drive(d) => {
                            let quantity = quantity(drives[d.0], load[d.0], other);
                            let force = parameter * self.value_at(&term.expression, &quantity);
                            balance.add(force * drive_rates[d.0].0[1]);
                        }
                        EffectPlace::Coordinate(i) => {
                            let quantity = quantity(coordinates[i.0], f64::NAN, other);
                            let force = parameter * self.value_at(&term.expression, &quantity);
                            balance.add(force * direction[i.0]);
                        }
                        EffectPlace::Part(_) | EffectPlace::Base | EffectPlace::Force => {}
                    }
                }
            }
        }
        balance
    }

    /// Kinetic and potential energy of parts, lumped masses and masses at points.
    pub fn energy(&self, coordinates: &[Jet]) -> f64 {
        let poses = self.poses(coordinates);
        let gravity = Vector3::from(self.vector(&self.mechanism.gravity));
        let mut bodies: Vec<(usize, Matrix4<f64>)> = self
            .mechanism
            .parts
            .iter()
            .map(|part| (part.frame.0, self.pseudo_inertia(&part.inertial)))
            .collect();
        for lump in &self.mechanism.lumped_masses {
            let mass = self.value(&lump.mass) * rational(&lump.share);
            let at = Vector3::from(self.vector(&lump.force_at));
            bodies.push((lump.frame.0, point_mass(mass, at)));
        }
        for effect in &self.mechanism.effects {
            for place in &effect.places {
                if let EffectPlace::Point(p) = place {
                    let point = &self.mechanism.points[p.0];
                    for term in &effect.terms {
                        let mass = self.parameters[term.parameter.0] * self.value(&term.expression);
                        let at = Vector3::from(self.vector(&point.at));
                        bodies.push((point.frame.0, point_mass(mass, at)));
                    }
                }
            }
        }
        bodies
            .iter()
            .map(|(frame, inertia)| {
                let (x, v) = (poses[*frame].derivative(0), poses[*frame].derivative(1));
                let kinetic = 0.5 * (v * inertia * v.transpose()).trace();
                let moment = (x * inertia.column(3)).xyz();
                kinetic - gravity.dot(&moment)
            })
            .sum()
    }

    /// Positions of a linear drive's points in several motions.
    /// Two points along each of two motions.
    fn ends(&self, points: [PointIdx; 2], motions: [&[Pose]; 2]) -> [[[Jet; 3]; 2]; 2] {
        motions.map(|poses| {
            points.map(|point| {
                let point = &self.mechanism.points[point.0];
                poses[point.frame.0].point(self.vector(&point.at))
            })
        })
    }

    fn add_lump(&self, balance: &mut Balance, pose: &Pose, change: &Pose, lump: &LumpedMass, gravity: &Vector3<f64>) {
        let mass = self.value(&lump.mass) * rational(&lump.share);
        let acceleration = |at: [f64; 3]| -> Vector3<f64> {
            let point = pose.point(at);
            Vector3::from_fn(|i, _| point[i].0[2]) - gravity
        };
        let (force_at, moment_at) = (self.vector(&lump.force_at), self.vector(&lump.moment_at));
        let x = pose.derivative(0);
        let rotation: Matrix3<f64> = x.fixed_view::<3, 3>(0, 0).into();
        let dx = change.derivative(1);
        let turning: Matrix3<f64> = dx.fixed_view::<3, 3>(0, 0) * rotation.transpose();
        let turn = Vector3::new(turning[(2, 1)], turning[(0, 2)], turning[(1, 0)]);
        let shift: Vector3<f64> = dx.fixed_view::<3, 1>(0, 3).into();
        let arm = rotation * Vector3::from(moment_at);
        balance.add(mass * shift.dot(&acceleration(force_at)));
        balance.add(mass * turn.dot(&arm.cross(&acceleration(moment_at))));
    }

    fn pseudo_inertia(&self, inertial: &PartInertia) -> Matrix4<f64> {
        match inertial {
            PartInertia::Linear {
                mass,
                first_moment,
                inertia,
            } => {
                let inertia: [f64; 6] = std::array::from_fn(|i| self.value(&inertia[i]));
                let mut j = spread(inertia);
                let moment = self.vector(first_moment);
                for i in 0..3 {
                    j[(i, 3)] = moment[i];
                    j[(3, i)] = moment[i];
                }
                j[(3, 3)] = self.value(mass);
                j
            }
            PartInertia::AboutCentre { mass, centre, inertia } => {
                let inertia: [f64; 6] = std::array::from_fn(|i| self.value(&inertia[i]));
                spread(inertia) + point_mass(self.value(mass), self.vector(centre).into())
            }
        }
    }
}

/// Coordinates that move along coordinate `i` alone, at rate 1.
pub fn along(coordinates: &[f64], i: usize) -> Vec<Jet> {
    coordinates
        .iter()
        .enumerate()
        .map(|(k, q)| Jet([*q, f64::from(u8::from(k == i)), 0.0]))
        .collect()
}

/// Whether a coordinate is an angle.
pub fn is_angle(mechanism: &Mechanism, coordinate: usize) -> bool {
    mechanism.coordinates[coordinate].motion.is_angle()
}

/// A rod as three particles along it that have its moments: jets do the rest.
fn add_rod(
    balance: &mut Balance,
    [moving, displaced]: [[[Jet; 3]; 2]; 2],
    [second, first, mass]: [f64; 3],
    gravity: &Vector3<f64>,
) {
    // Particles at -1, 0 and 1 m have the moments m0 + m1 + m2, m2 - m0 and m2 + m0.
    let outer = [0.5 * (second - first), 0.5 * (second + first)];
    for (at, particle) in [(-1.0, outer[0]), (0.0, mass - second), (1.0, outer[1])] {
        let place = |[a, b]: [[Jet; 3]; 2]| -> [Jet; 3] {
            let d: [Jet; 3] = std::array::from_fn(|i| b[i] - a[i]);
            let square = (0..3).fold(Jet::constant(0.0), |sum, i| sum + d[i] * d[i]);
            let scale = Jet::constant(at) * square.sqrt().recip();
            std::array::from_fn(|i| a[i] + scale * d[i])
        };
        let (moves, change) = (place(moving), place(displaced));
        for i in 0..3 {
            balance.add(particle * change[i].0[1] * (moves[i].0[2] - gravity[i]));
        }
    }
}

/// The virtual work of what pulls two points together by a constant, by their distance and by its rate.
fn add_strut(balance: &mut Balance, motions: &[[[Jet; 3]; 2]; 2], [constant, stiffness, damping]: [f64; 3]) {
    let [moves, change] = motions.each_ref().map(|[a, b]| {
        let d: [Jet; 3] = std::array::from_fn(|i| b[i] - a[i]);
        (0..3).fold(Jet::constant(0.0), |sum, i| sum + d[i] * d[i]).sqrt()
    });
    let pull = constant + stiffness * moves.0[0] + damping * moves.0[1];
    balance.add(pull * change.0[1]);
}

fn quantity(motion: Jet, load: f64, other: Jet) -> impl Fn(PlaceQuantity) -> f64 {
    move |quantity| match quantity {
        PlaceQuantity::OtherCoordinate => other.0[0],
        PlaceQuantity::OtherRate => other.0[1],
        PlaceQuantity::OtherAcceleration => other.0[2],
        PlaceQuantity::Coordinate => motion.0[0],
        PlaceQuantity::Rate => motion.0[1],
        PlaceQuantity::Acceleration => motion.0[2],
        PlaceQuantity::Load => load,
    }
}

fn add_body(balance: &mut Balance, pose: &Pose, change: &Pose, inertia: &Matrix4<f64>, gravity: &Vector3<f64>) {
    let (a, d) = (pose.derivative(2), change.derivative(1));
    let product = d * inertia * a.transpose();
    for i in 0..3 {
        balance.add(product[(i, i)]);
    }
    let moment = d * inertia.column(3);
    for i in 0..3 {
        balance.add(-gravity[i] * moment[i]);
    }
}

/// Second moments `integral of x x^T` from the inertia about the same point.
fn spread([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Matrix4<f64> {
    let half = 0.5 * (xx + yy + zz);
    Matrix4::new(
        half - xx,
        -xy,
        -xz,
        0.0,
        -xy,
        half - yy,
        -yz,
        0.0,
        -xz,
        -yz,
        half - zz,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
}

fn point_mass(mass: f64, at: Vector3<f64>) -> Matrix4<f64> {
    let place = at.push(1.0);
    mass * place * place.transpose()
}

fn rational(value: &num_rational::BigRational) -> f64 {
    modelmill_codegen::expr::Rational::from(value.clone()).to_f64()
}
