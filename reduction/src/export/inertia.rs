//! What links carry: the inertia of parts, lumped masses and such effects as are bodies, added up.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_spec::{
    EffectPlace, ExactExpression, FrameIdx, LumpedMass, Mechanism, ModelPart, PartInertia,
};
use nalgebra::{Matrix3, Vector3};

use super::ExportError;
use super::tree::{LinkPlacement, LinkTree};

/// Below this share of a link's own size, numbers are rounding.
const ROUNDING: f64 = 1e-12;

/// Radius of gyration of a link that never turns, m.
const DEFAULT_RADIUS_OF_GYRATION: f64 = 0.05;
/// Moments across the direction about which a link turns, as parts of that about it: a body somewhat thicker than a plate.
const TRANSVERSE_RATIO: f64 = 0.6;

/// Ten numbers about the origin of a link, in its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinkInertia {
    /// kg
    pub(super) mass: f64,
    /// kg m
    pub(super) first: Vector3<f64>,
    /// About the origin, kg m^2.
    pub(super) inertia: Matrix3<f64>,
}

impl LinkInertia {
    const NONE: Self = Self {
        mass: 0.0,
        first: Vector3::new(0.0, 0.0, 0.0),
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Centre of mass, m; the origin where there is no mass.
    pub(super) fn centre_of_mass(&self) -> Vector3<f64> {
        if self.mass == 0.0 {
            return Vector3::zeros();
        }
        self.first / self.mass
    }

    /// About the centre of mass, kg m^2.
    pub(super) fn central_inertia(&self) -> Matrix3<f64> {
        let c = self.centre_of_mass();
        self.inertia - self.mass * (c.norm_squared() * Matrix3::identity() - c * c.transpose())
    }

    /// Whether there is nothing.
    pub(super) fn is_zero(&self) -> bool {
        *self == Self::NONE
    }

    /// The same body about the origin of a frame in which its own one is placed.
    fn in_outer_frame(&self, placed: &LinkPlacement) -> Self {
        let (r, t) = (placed.rotation, placed.origin);
        let turned = r * self.first;
        let square =
            |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(b) * Matrix3::identity() - a * b.transpose();
        Self {
            mass: self.mass,
            first: turned + self.mass * t,
            inertia: r * self.inertia * r.transpose()
                + square(&t, &turned)
                + square(&turned, &t)
                + self.mass * square(&t, &t),
        }
    }

    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.first += other.first;
        self.inertia += other.inertia;
    }
}

/// What each link carries.
pub(super) fn bodies(
    mechanism: &Mechanism,
    tree: &LinkTree,
) -> Result<Vec<LinkInertia>, ExportError> {
    let value =
        |exact: &ExactExpression| exact.evaluate(&|symbol| mechanism.symbol_nominal(symbol));
    let vector = |exact: &[ExactExpression; 3]| Vector3::from_fn(|k, _| value(&exact[k]));
    let mut bodies = vec![LinkInertia::NONE; tree.links.len()];
    let mut add = |frame: FrameIdx, body: &LinkInertia| {
        let link = tree.link_of[frame.0];
        let placed = tree.links[link]
            .placed
            .relative_placement(&tree.frames[frame.0]);
        bodies[link].add(&body.in_outer_frame(&placed));
    };
    let of_effects = mechanism.effects.iter().map(|effect| &effect.bodies);
    let parts = mechanism.parts.iter();
    for part in parts.chain(of_effects.clone().flat_map(|bodies| &bodies.parts)) {
        add(part.frame, &from_part(part, &value, &vector));
    }
    let lumps = mechanism.lumped_masses.iter();
    for lump in lumps.chain(of_effects.flat_map(|bodies| &bodies.lumped_masses)) {
        let (forces, moments) = (vector(&lump.force_at), vector(&lump.moment_at));
        if (forces - moments).norm() > ROUNDING * (forces.norm() + moments.norm()) {
            return Err(ExportError(format!(
                "a lumped mass on `{}` stands at different places for the balances of forces and of moments, which no body \
                 does; export a model whose `moment_at` are where its `force_at` are",
                mechanism.frames[lump.frame.0].name
            )));
        }
        let share = lump_share(lump);
        add(lump.frame, &point_mass(share * value(&lump.mass), forces));
    }
    for effect in mechanism.effects.iter().filter(|e| e.mechanics.is_none()) {
        for place in &effect.places {
            let EffectPlace::Point(at) = place else {
                continue;
            };
            let at = &mechanism.points[at.0];
            for term in &effect.terms {
                let mass = mechanism.parameters[term.parameter.0].nominal * value(&term.expression);
                add(at.frame, &point_mass(mass, vector(&at.at)));
            }
        }
    }
    Ok(bodies)
}

fn lump_share(lump: &LumpedMass) -> f64 {
    ExactExpression::Rational(lump.share.clone()).evaluate(&|_| 0.0)
}

fn point_mass(mass: f64, at: Vector3<f64>) -> LinkInertia {
    LinkInertia {
        mass,
        first: mass * at,
        inertia: mass * (at.norm_squared() * Matrix3::identity() - at * at.transpose()),
    }
}

fn from_part(
    part: &ModelPart,
    value: &dyn Fn(&ExactExpression) -> f64,
    vector: &dyn Fn(&[ExactExpression; 3]) -> Vector3<f64>,
) -> LinkInertia {
    let matrix = |six: &[ExactExpression; 6]| {
        let [xx, xy, xz, yy, yz, zz] = [0, 1, 2, 3, 4, 5].map(|k: usize| value(&six[k]));
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    };
    match &part.inertial {
        PartInertia::Linear {
            mass,
            first_moment,
            inertia,
        } => LinkInertia {
            mass: value(mass),
            first: vector(first_moment),
            inertia: matrix(inertia),
        },
        PartInertia::AboutCentre {
            mass,
            centre,
            inertia,
        } => {
            let mut body = point_mass(value(mass), vector(centre));
            body.inertia += matrix(inertia);
            body
        }
    }
}

/// Gives links that only slide, or turn about one direction, moments of inertia that a body can have: those that the model
/// does not say are not felt.
pub(super) fn complete_inertias(
    tree: &LinkTree,
    bodies: &mut [LinkInertia],
    remarks: &mut Vec<Message>,
) {
    let mut completed = Vec::new();
    for (l, link) in tree.links.iter().enumerate().skip(1) {
        let body = &mut bodies[l];
        if body.mass <= 0.0 || inertia_fault(body).is_none() {
            continue;
        }
        let central = match link_rotation(tree, l) {
            LinkRotation::Never => {
                body.mass * DEFAULT_RADIUS_OF_GYRATION.powi(2) * Matrix3::identity()
            }
            LinkRotation::OneAxis(axis) => {
                let n = link.placed.rotation.transpose() * axis;
                let about = n.dot(&(body.central_inertia() * n));
                let across = TRANSVERSE_RATIO * about;
                across * Matrix3::identity() + (about - across) * n * n.transpose()
            }
            LinkRotation::AnyAxis => continue,
        };
        let other = LinkInertia {
            inertia: body.inertia - body.central_inertia() + central,
            ..*body
        };
        if inertia_fault(&other).is_none() {
            *body = other;
            completed.push(format!("`{}`", link.name));
        }
    }
    if !completed.is_empty() {
        remarks.push(message!(
            "moments of inertia that no motion feels are chosen so that a body can have them: of {}",
            completed.join(", ")
        ));
    }
}

/// How a link turns against the base.
enum LinkRotation {
    Never,
    OneAxis(Vector3<f64>),
    AnyAxis,
}

fn link_rotation(tree: &LinkTree, mut link: usize) -> LinkRotation {
    let mut turns = LinkRotation::Never;
    while link != 0 {
        let one = &tree.links[link];
        if one.joints.is_empty() {
            return LinkRotation::AnyAxis;
        }
        for joint in one.joints.iter().filter(|joint| joint.is_rotation) {
            turns = match turns {
                LinkRotation::Never => LinkRotation::OneAxis(joint.axis),
                LinkRotation::OneAxis(axis) if axis.cross(&joint.axis).norm() < 1e-9 => {
                    LinkRotation::OneAxis(axis)
                }
                _ => return LinkRotation::AnyAxis,
            };
        }
        link = one.parent;
    }
    turns
}

/// Why nothing can be such a body.
fn inertia_fault(body: &LinkInertia) -> Option<&'static str> {
    let moments = body.central_inertia().symmetric_eigenvalues();
    let size = body.inertia.norm();
    let (least, largest) = (moments.min(), moments.max());
    if body.mass <= 0.0 {
        Some("has no mass above zero")
    } else if least <= ROUNDING * size {
        Some("has no moment of inertia above zero about every axis through its centre")
    } else if 2.0 * largest > moments.sum() * (1.0 + 1e-9) {
        Some("has a moment of inertia that is larger than the two others together")
    } else {
        None
    }
}

/// Tells of links that no body can be: simulators refuse them, or move them as nothing moves.
pub(super) fn report_impossible(
    tree: &LinkTree,
    bodies: &[LinkInertia],
    remarks: &mut Vec<Message>,
) {
    for (link, body) in tree.links.iter().zip(bodies).skip(1) {
        let Some(fault) = inertia_fault(body).filter(|_| !body.is_zero()) else {
            continue;
        };
        remarks.push(message!(
            "`{}` {fault}, which no body does: simulators refuse it or go astray; identify with {} and let {} write that fit",
            link.name,
            Remedy::option(OptionName::Physical),
            Remedy::command(CommandName::Adopt)
        ));
    }
}
