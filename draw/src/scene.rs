//! The shapes of a mechanism: at given coordinates it becomes bars, joints, loops, drives and masses in the base frame.

use modelmill_spec::{
    CoordinateIdx, DriveKind, ExactExpression, FrameIdx, FramePlacement, FrameStep, Kinematics, LumpedMass, Mechanism,
    MechanismPoses, ModelPart, ModelSymbol, PartInertia, PointIdx,
};
use nalgebra::Vector3;

use crate::plane::{convex_hull, plane_of_motion};
use crate::virtual_chain::{drive_ends, mark_virtual_frames};

/// A mechanism at one pose, as shapes to draw.
#[derive(Clone, Debug)]
pub struct MechanismScene {
    /// The title of the mechanism, or its name.
    pub title: String,
    /// All shapes.
    pub marks: Vec<SceneMark>,
    /// Unit normal of the plane in which all motion takes place, if there is one.
    pub plane: Option<Vector3<f64>>,
    /// Direction of gravity, a unit vector in the base frame; `None` without gravity.
    pub down: Option<Vector3<f64>>,
}

/// One shape with the object that it represents.
#[derive(Clone, Debug)]
pub struct SceneMark {
    /// Its geometry.
    pub shape: MarkShape,
    /// The body that carries it; 0 is the base.
    pub body: usize,
    /// Its name in the model file; empty if it has none.
    pub name: String,
    /// What it is, as text for the reader.
    pub description: String,
}

/// The geometry of a shape; places in the base frame, m.
#[derive(Clone, Debug, PartialEq)]
pub enum MarkShape {
    /// A straight piece of a body, between its ends.
    Bar([Vector3<f64>; 2]),
    /// A piece of a body that leads to a point at which nothing is connected.
    Arm([Vector3<f64>; 2]),
    /// The guide of a prismatic joint: its zero and the place of the joint on it, and its direction.
    Rail([Vector3<f64>; 2], Vector3<f64>),
    /// A flat body between three or more joints: its corners in order.
    Plate(Vec<Vector3<f64>>),
    /// A joint with its axis.
    Joint(JointMark),
    /// Two points that a loop connects.
    Closing(Vector3<f64>),
    /// A drive between two points.
    Drive([Vector3<f64>; 2]),
    /// A place at which the base carries something.
    Ground(Vector3<f64>),
    /// A named point.
    Point(Vector3<f64>),
    /// A lumped mass: place, and mass in kg.
    Lump(Vector3<f64>, f64),
    /// The centre of mass of a part: place, and mass in kg.
    Centre(Vector3<f64>, f64),
    /// A frame: its origin and its axes.
    Frame(Vector3<f64>, [Vector3<f64>; 3]),
}

/// A joint as it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct JointMark {
    /// Place, m.
    pub at: Vector3<f64>,
    /// Direction of its axis, a unit vector.
    pub axis: Vector3<f64>,
    /// Whether it rotates about the axis.
    pub is_revolute: bool,
    /// Whether it translates along the axis; a screw does both.
    pub is_prismatic: bool,
    /// What moves it.
    pub actuation: JointActuation,
    /// Name of the drive on it.
    pub drive: Option<String>,
}

/// What moves a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointActuation {
    /// A drive on the joint itself.
    Drive,
    /// Its coordinate is independent, but no drive acts on it.
    Independent,
    /// The loops: its coordinate is passive.
    Loops,
}

impl MarkShape {
    /// All places of the shape, m.
    pub fn places(&self) -> Vec<Vector3<f64>> {
        match self {
            Self::Bar(ends) | Self::Arm(ends) | Self::Drive(ends) | Self::Rail(ends, _) => ends.to_vec(),
            Self::Plate(corners) => corners.clone(),
            Self::Joint(joint) => vec![joint.at],
            Self::Closing(at)
            | Self::Ground(at)
            | Self::Point(at)
            | Self::Lump(at, _)
            | Self::Centre(at, _)
            | Self::Frame(at, _) => vec![*at],
        }
    }
}

impl MechanismScene {
    /// The mechanism at `coordinates`, rad and m, one for each coordinate in the order of the file (asserted). Passive
    /// ones must close the loops, which is not checked: otherwise the ends of a loop are drawn apart.
    pub fn new(mechanism: &Mechanism, coordinates: &[f64]) -> Self {
        let kinematics = Kinematics::new(mechanism);
        let poses = kinematics.poses(coordinates);
        let mut builder = Builder {
            mechanism,
            kinematics,
            poses,
            bodies: vec![0; mechanism.frames.len()],
            n_bodies: 1,
            anchors: vec![Vec::new()],
            is_virtual: Vec::new(),
            marks: Vec::new(),
        };
        builder.is_virtual = mark_virtual_frames(mechanism, &builder.poses);
        // Frames come first, because they assign bodies to everything else.
        for frame in 1..mechanism.frames.len() {
            builder.add_frame(frame);
        }
        builder.add_points();
        builder.add_drives();
        builder.add_masses();
        builder.end_last_links();
        builder.add_plates();
        builder.add_ground();
        let joints = builder.marks.iter().filter_map(|mark| match &mark.shape {
            MarkShape::Joint(joint) => Some(joint),
            _ => None,
        });
        // A free body leaves every plane.
        let mut steps = mechanism.frames.iter().flat_map(|frame| &frame.steps);
        let flies = steps.any(|step| matches!(step, FrameStep::Free(_)));
        let gravity = Vector3::from(mechanism.gravity.each_ref().map(|g| constant_value(mechanism, g)));
        let down = gravity.try_normalize(0.0);
        Self {
            title: (mechanism.title.clone()).unwrap_or_else(|| mechanism.name.clone()),
            plane: if flies { None } else { plane_of_motion(joints, down) },
            marks: builder.marks,
            down,
        }
    }
}

/// The value of an expression with all coordinates zero.
fn constant_value(mechanism: &Mechanism, exact: &ExactExpression) -> f64 {
    exact.evaluate(&|symbol| match symbol {
        ModelSymbol::Coordinate(_) => 0.0,
        other => mechanism.symbol_nominal(other),
    })
}

/// Collects the shapes of a mechanism.
struct Builder<'a> {
    /// The mechanism.
    mechanism: &'a Mechanism,
    /// Its frames as functions of the coordinates.
    kinematics: Kinematics,
    /// Their poses at the given coordinates.
    poses: MechanismPoses,
    /// The body that carries each frame.
    bodies: Vec<usize>,
    /// Number of bodies, the base included.
    n_bodies: usize,
    /// Places at which each body is connected to others, m.
    anchors: Vec<Vec<Vector3<f64>>>,
    /// Frames of virtual chains, which are not drawn.
    is_virtual: Vec<bool>,
    /// All shapes so far.
    marks: Vec<SceneMark>,
}

impl Builder<'_> {
    /// Adds a shape with its body, its name, and its description.
    fn add_mark(&mut self, shape: MarkShape, body: usize, name: &str, says: String) {
        let name = name.to_owned();
        self.marks.push(SceneMark {
            shape,
            body,
            name,
            description: says,
        });
    }

    /// Pose of a frame by its index.
    fn frame_pose(&self, frame: usize) -> &FramePlacement {
        &self.poses.frames()[frame]
    }

    /// The place in the base frame of a point given in a frame, m.
    fn place_in_base(&self, frame: FrameIdx, at: &[ExactExpression; 3]) -> Vector3<f64> {
        let local = at.each_ref().map(|x| constant_value(self.mechanism, x));
        let pose = self.frame_pose(frame.0);
        Vector3::from_fn(|k, _| {
            let turned: f64 = (0..3).map(|j| pose.rotation[k][j] * local[j]).sum();
            pose.origin[k] + turned
        })
    }

    /// The joints and bars from a frame's parent to the frame.
    fn add_frame(&mut self, frame: usize) {
        let own = &self.mechanism.frames[frame];
        let pose = self.frame_pose(frame).clone();
        let mut body = self.bodies[own.parent.0];
        let mut from = Vector3::from(self.frame_pose(own.parent.0).origin);
        let is_free = own.steps.iter().any(|step| matches!(step, FrameStep::Free(_)));
        if is_free || self.is_virtual[frame] {
            // A free body is not connected to its parent, so no bar leads there.
            body = self.n_bodies;
            self.n_bodies += 1;
            from = Vector3::from(pose.origin);
            self.anchors.push(vec![from]);
        }
        // Translations become bars and coordinates become joints, in the order of the frame's steps.
        let mut next = 0;
        let mut way = pose.translations.iter().peekable();
        while !self.is_virtual[frame] {
            while let Some((at, _)) = way.next_if(|(_, behind)| *behind <= next) {
                let to = Vector3::from(*at);
                self.add_bar(body, from, to, frame);
                from = to;
            }
            let Some(first) = pose.joint_axes.get(next) else {
                break;
            };
            // Coordinates of one step, or of a rotation and a translation along one axis, are one joint.
            let is_same = |other: &modelmill_spec::CoordinateAxis| {
                let [a, b] = [first, other].map(|m| Vector3::from(m.axis));
                let [p, q] = [first, other].map(|m| Vector3::from(m.origin));
                (p - q).norm() < 1e-12 && (a - b).norm() < 1e-9
            };
            let count = pose.joint_axes[next..].iter().take_while(|m| is_same(m)).count();
            let together = &pose.joint_axes[next..next + count];
            next += count;
            // Where the translation of a prismatic joint leads to.
            let moved = way.peek().filter(|(_, behind)| *behind <= next);
            let moved = moved.map_or(from, |(at, _)| Vector3::from(*at));
            // The rail of a slide on the base replaces the bar along it.
            let is_block = body == 0 && together.iter().all(|one| !one.is_rotation);
            self.add_joint(together, moved, frame, &mut body);
            if is_block {
                way.next_if(|(_, behind)| *behind <= next);
                from = moved;
            }
        }
        self.bodies[frame] = body;
        // The axes of the frame are the columns of its rotation.
        let axes = [0, 1, 2].map(|j| Vector3::from_fn(|k, _| pose.rotation[k][j]));
        let shape = MarkShape::Frame(Vector3::from(pose.origin), axes);
        self.add_mark(shape, body, &own.name, format!("frame {}", own.name));
    }

    /// Adds a bar of a body; its description is the name of the frame to which it belongs.
    fn add_bar(&mut self, body: usize, from: Vector3<f64>, to: Vector3<f64>, frame: usize) {
        let name = &self.mechanism.frames[frame].name;
        let says = if body == 0 {
            "ground".to_owned()
        } else if body == self.bodies[self.mechanism.frames[frame].parent.0] {
            let parent = self.mechanism.frames[frame].parent.0;
            self.mechanism.frames[parent].name.clone()
        } else {
            name.clone()
        };
        self.add_mark(MarkShape::Bar([from, to]), body, "", says);
    }

    /// Adds a joint; a prismatic one leads to the place `moved`. Behind it a new body begins, whose index `body` gets.
    fn add_joint(
        &mut self,
        together: &[modelmill_spec::CoordinateAxis],
        moved: Vector3<f64>,
        frame: usize,
        body: &mut usize,
    ) {
        let coordinates = &self.mechanism.coordinates;
        let names: Vec<&str> = (together.iter())
            .map(|moved| coordinates[moved.coordinate].name.as_str())
            .collect();
        let names = names.join(", ");
        let drives = &self.mechanism.drives;
        // The drive on one of the joint's coordinates, if there is one.
        let driven_by = |c: usize| {
            let kind = DriveKind::Joint(CoordinateIdx(c));
            drives.iter().find(|drive| drive.is_driven && drive.kind == kind)
        };
        let drive = together.iter().find_map(|moved| driven_by(moved.coordinate));
        let moved_by = match drive {
            Some(_) => JointActuation::Drive,
            None if together.iter().all(|m| coordinates[m.coordinate].passive) => JointActuation::Loops,
            None => JointActuation::Independent,
        };
        // Kinds of motion of its coordinates.
        let [turns, slides] = [true, false].map(|turns| {
            let mut all = together.iter();
            all.any(|moved| moved.is_rotation == turns)
        });
        let kind = match (turns, slides) {
            (true, true) => "cylindrical",
            (true, false) => "revolute",
            _ => "prismatic",
        };
        let whose = match (drive, moved_by) {
            (Some(drive), _) => format!("driven by {}", drive.name),
            (None, JointActuation::Loops) => "passive".to_owned(),
            (None, _) => "independent".to_owned(),
        };
        let name = &self.mechanism.frames[frame].name;
        let says = format!("{names}: {kind} joint of {name}, {whose}");
        let at = Vector3::from(together[0].origin);
        let is_slide = slides && !turns;
        // A slide on the base is the block that moves along the rail. Else the sleeve is between both ends, so that it
        // covers neither of the other joints of the two bodies.
        let place = match (is_slide, *body) {
            (true, 0) => moved,
            (true, _) => 0.5 * (at + moved),
            _ => at,
        };
        let joint = JointMark {
            at: place,
            axis: Vector3::from(together[0].axis),
            is_revolute: turns,
            is_prismatic: slides,
            actuation: moved_by,
            drive: drive.map(|drive| drive.name.clone()),
        };
        // The joint connects the body before it with the new one.
        self.anchors[*body].push(at);
        if slides {
            self.add_mark(MarkShape::Rail([at, place], joint.axis), *body, "", says.clone());
        }
        *body = self.n_bodies;
        self.n_bodies += 1;
        self.anchors.push(vec![if is_slide { moved } else { at }]);
        self.add_mark(MarkShape::Joint(joint), *body, &names, says);
    }

    /// Adds points, and the closures of loops.
    fn add_points(&mut self) {
        let mechanism = self.mechanism;
        // Whether a loop or a drive is connected to a point.
        let held = |point: usize| {
            let in_loop = mechanism.loops.iter().any(|l| l.joins.contains(&PointIdx(point)));
            in_loop
                || mechanism
                    .drives
                    .iter()
                    .chain(&mechanism.shared_drives)
                    .any(|d| drive_ends(d.kind).contains(&PointIdx(point)))
        };
        for (i, point) in mechanism.points.iter().enumerate() {
            let at = self.place_in_base(point.frame, &point.at);
            let body = self.bodies[point.frame.0];
            let from = Vector3::from(self.frame_pose(point.frame.0).origin);
            if held(i) {
                self.anchors[body].push(at);
            }
            // A bar or a thin line from the frame's origin to the point.
            if body != 0 {
                let ends = [from, at];
                let shape = if held(i) {
                    MarkShape::Bar(ends)
                } else {
                    MarkShape::Arm(ends)
                };
                let frame = &mechanism.frames[point.frame.0].name;
                self.add_mark(shape, body, "", frame.clone());
            }
            let says = format!("point {} of {}", point.name, mechanism.frames[point.frame.0].name);
            self.add_mark(MarkShape::Point(at), body, &point.name, says);
        }
        for closed in &mechanism.loops {
            let [one, other] = closed.joins.map(|point| self.point_in_base(point));
            let names = closed.joins.map(|p| mechanism.points[p.0].name.as_str());
            let says = format!("loop {}: {} meets {}", closed.name, names[0], names[1]);
            let body = self.bodies[mechanism.points[closed.joins[0].0].frame.0];
            self.add_mark(MarkShape::Closing(one), body, &closed.name, says.clone());
            // At a pose that does not close the loop, both ends are drawn.
            if (one - other).norm() > 1e-6 {
                self.add_mark(MarkShape::Closing(other), body, "", says);
            }
        }
    }

    /// Place of a point in the base frame, m.
    fn point_in_base(&self, point: PointIdx) -> Vector3<f64> {
        Vector3::from(self.kinematics.point_position(&self.poses, point))
    }

    /// Adds drives between points.
    fn add_drives(&mut self) {
        let mechanism = self.mechanism;
        for drive in mechanism.drives.iter().chain(&mechanism.shared_drives) {
            let ends = drive_ends(drive.kind);
            let [from, to] = ends[..] else { continue };
            let shape = MarkShape::Drive([self.point_in_base(from), self.point_in_base(to)]);
            let body = self.bodies[self.mechanism.points[from.0].frame.0];
            self.add_mark(shape, body, &drive.name, format!("drive {}", drive.name));
        }
    }

    /// Adds lumped masses and centres of mass, also those of effects.
    fn add_masses(&mut self) {
        let mechanism = self.mechanism;
        let of_effects = mechanism.effects.iter();
        let lumps = of_effects.clone().flat_map(|effect| &effect.bodies.lumped_masses);
        for lump in mechanism.lumped_masses.iter().chain(lumps) {
            self.add_lump(lump);
        }
        let parts = of_effects.flat_map(|effect| &effect.bodies.parts);
        for part in mechanism.parts.iter().chain(parts) {
            self.add_centre_of_mass(part);
        }
    }

    /// Adds a lumped mass at the point where its force acts.
    fn add_lump(&mut self, lump: &LumpedMass) {
        let share = modelmill_spec::ExactExpression::Rational(lump.share.clone());
        let mass = constant_value(self.mechanism, &lump.mass) * constant_value(self.mechanism, &share);
        let at = self.place_in_base(lump.frame, &lump.force_at);
        let says = format!("{} = {mass:.4} kg", self.mechanism.text_of(&lump.mass));
        let body = self.bodies[lump.frame.0];
        if mass != 0.0 && mass.is_finite() {
            self.add_arm(lump.frame, at);
            self.add_mark(MarkShape::Lump(at, mass), body, "", says);
        }
    }

    /// Adds a thin line from a frame's origin to a place, unless the place is on a bar of the same body.
    fn add_arm(&mut self, frame: FrameIdx, at: Vector3<f64>) {
        let body = self.bodies[frame.0];
        let from = Vector3::from(self.frame_pose(frame.0).origin);
        // A place is on a bar if its distances to both ends add up to the length.
        let is_on_bar = self.marks.iter().any(|mark| match &mark.shape {
            MarkShape::Bar([a, b]) | MarkShape::Arm([a, b]) if mark.body == body => {
                ((at - a).norm() + (at - b).norm() - (a - b).norm()) < 1e-6
            }
            _ => false,
        });
        if !is_on_bar && body != 0 {
            let says = self.mechanism.frames[frame.0].name.clone();
            self.add_mark(MarkShape::Arm([from, at]), body, "", says);
        }
    }

    /// Adds the centre of mass of a part with a mass other than zero.
    fn add_centre_of_mass(&mut self, part: &ModelPart) {
        let value = |exact: &ExactExpression| constant_value(self.mechanism, exact);
        let (mass, at) = match &part.inertial {
            PartInertia::AboutCentre { mass, centre, .. } => (value(mass), self.place_in_base(part.frame, centre)),
            // The centre is the first moment divided by the mass.
            PartInertia::Linear { mass, first_moment, .. } => {
                let mass = value(mass);
                let local = first_moment.each_ref().map(|m| value(m) / mass);
                let pose = self.frame_pose(part.frame.0);
                let at = Vector3::from_fn(|k, _| {
                    let turned: f64 = (0..3).map(|j| pose.rotation[k][j] * local[j]).sum();
                    pose.origin[k] + turned
                });
                (mass, at)
            }
        };
        let says = format!("centre of mass of {}, {mass:.4} kg", part.name);
        let body = self.bodies[part.frame.0];
        if mass != 0.0 && mass.is_finite() && at.iter().all(|x| x.is_finite()) {
            self.add_arm(part.frame, at);
            self.add_mark(MarkShape::Centre(at, mass), body, "", says);
        }
    }

    /// Draws the last bodies of chains, which nothing else ends, as bars from their joint to their centre of mass.
    fn end_last_links(&mut self) {
        for body in 1..self.n_bodies {
            let has_bar = |mark: &SceneMark| mark.body == body && matches!(mark.shape, MarkShape::Bar(_));
            if self.anchors[body].len() > 1 || self.marks.iter().any(has_bar) {
                continue;
            }
            for mark in self.marks.iter_mut().filter(|mark| mark.body == body) {
                if let MarkShape::Arm(ends) = mark.shape {
                    mark.shape = MarkShape::Bar(ends);
                }
            }
        }
    }

    /// Adds plates for bodies that are connected at three or more places of one plane.
    fn add_plates(&mut self) {
        for body in 1..self.n_bodies {
            if let Some(corners) = convex_hull(&self.anchors[body]) {
                let mut marks = self.marks.iter();
                let says = marks.find(|mark| mark.body == body && matches!(mark.shape, MarkShape::Bar(_)));
                let says = says.map_or_else(String::new, |mark| mark.description.clone());
                self.add_mark(MarkShape::Plate(corners), body, "", says);
            }
        }
    }

    /// Adds the symbol of the base at every place where it is connected, each once.
    fn add_ground(&mut self) {
        let mut places: Vec<Vector3<f64>> = Vec::new();
        for at in &self.anchors[0] {
            if places.iter().all(|other| (other - at).norm() > 1e-9) {
                places.push(*at);
            }
        }
        for at in places {
            self.add_mark(MarkShape::Ground(at), 0, "", "ground".to_owned());
        }
    }
}
