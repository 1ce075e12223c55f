//! The inertia of links: parts, lumped masses and effects that are bodies go in, their sums per link come out. Also
//! completes and checks inertias for simulators.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_spec::{EffectPlace, ExactExpression, FrameIdx, LumpedMass, Mechanism, ModelPart, PartInertia};
use nalgebra::{Matrix3, Vector3};

use super::ExportError;
use super::tree::{LinkPlacement, LinkTree};

/// Numbers below this share of a link's own size are rounding.
const ROUNDING: f64 = 1e-12;

/// Radius of gyration that is assumed for a link that never rotates, m.
const DEFAULT_RADIUS_OF_GYRATION: f64 = 0.05;
/// Transverse moments of a link that rotates about one axis, relative to the moment about that axis: slightly more than
/// for a plate.
const TRANSVERSE_RATIO: f64 = 0.6;

/// The ten inertial parameters of a link about its origin, in its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinkInertia {
    /// Mass, kg.
    pub(super) mass: f64,
    /// First moment, kg m.
    pub(super) first: Vector3<f64>,
    /// Inertia about the origin, kg m^2.
    pub(super) inertia: Matrix3<f64>,
}

impl LinkInertia {
    /// A link without mass.
    const NONE: Self = Self {
        mass: 0.0,
        first: Vector3::new(0.0, 0.0, 0.0),
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Centre of mass, m; the origin if the mass is zero.
    pub(super) fn centre_of_mass(&self) -> Vector3<f64> {
        if self.mass == 0.0 {
            return Vector3::zeros();
        }
        self.first / self.mass
    }

    /// Inertia about the centre of mass, kg m^2.
    pub(super) fn central_inertia(&self) -> Matrix3<f64> {
        let c = self.centre_of_mass();
        self.inertia - self.mass * (c.norm_squared() * Matrix3::identity() - c * c.transpose())
    }

    /// Whether all ten parameters are zero.
    pub(super) fn is_zero(&self) -> bool {
        *self == Self::NONE
    }

    /// The same body about the origin of the outer frame, in which its own frame has the pose `placed`.
    fn in_outer_frame(&self, placed: &LinkPlacement) -> Self {
        let (r, t) = (placed.rotation, placed.origin);
        // Turn into the axes of the outer frame, then shift by the pose (Steiner).
        let turned = r * self.first;
        let square = |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(b) * Matrix3::identity() - a * b.transpose();
        Self {
            mass: self.mass,
            first: turned + self.mass * t,
            inertia: r * self.inertia * r.transpose()
                + square(&t, &turned)
                + square(&turned, &t)
                + self.mass * square(&t, &t),
        }
    }

    /// Adds a body given about the same origin.
    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.first += other.first;
        self.inertia += other.inertia;
    }
}

/// The inertia of each link, with the nominal values of the parameters.
///
/// Fails if a lumped mass has different positions in the balances of forces and of moments.
pub(super) fn bodies(mechanism: &Mechanism, tree: &LinkTree) -> Result<Vec<LinkInertia>, ExportError> {
    // Values of exact expressions at the nominal values of all symbols.
    let value = |exact: &ExactExpression| exact.evaluate(&|symbol| mechanism.symbol_nominal(symbol));
    let vector = |exact: &[ExactExpression; 3]| Vector3::from_fn(|k, _| value(&exact[k]));
    let mut bodies = vec![LinkInertia::NONE; tree.links.len()];
    // Add a body on a frame to the link that carries the frame.
    let mut add = |frame: FrameIdx, body: &LinkInertia| {
        let link = tree.link_of[frame.0];
        let placed = tree.links[link].placed.relative_placement(&tree.frames[frame.0]);
        bodies[link].add(&body.in_outer_frame(&placed));
    };
    // Some effects are bodies.
    let of_effects = mechanism.effects.iter().map(|effect| &effect.bodies);
    let parts = mechanism.parts.iter();
    for part in parts.chain(of_effects.clone().flat_map(|bodies| &bodies.parts)) {
        add(part.frame, &from_part(part, &value, &vector));
    }
    let lumps = mechanism.lumped_masses.iter();
    for lump in lumps.chain(of_effects.flat_map(|bodies| &bodies.lumped_masses)) {
        let (forces, moments) = (vector(&lump.force_at), vector(&lump.moment_at));
        // Such a mass fits measurements, but no body has it.
        if (forces - moments).norm() > ROUNDING * (forces.norm() + moments.norm()) {
            return Err(ExportError(format!(
                "a lumped mass on `{}` has different places in the balances of forces and of moments, which is impossible for a \
                 body; export a model in which `moment_at` equals `force_at`",
                mechanism.frames[lump.frame.0].name
            )));
        }
        // A mass in shares at several points.
        let share = lump_share(lump);
        add(lump.frame, &point_mass(share * value(&lump.mass), forces));
    }
    // Effects at points are point masses.
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

/// The share of a lumped mass at its point.
fn lump_share(lump: &LumpedMass) -> f64 {
    ExactExpression::Rational(lump.share.clone()).evaluate(&|_| 0.0)
}

/// The inertia of a point mass.
fn point_mass(mass: f64, at: Vector3<f64>) -> LinkInertia {
    LinkInertia {
        mass,
        first: mass * at,
        inertia: mass * (at.norm_squared() * Matrix3::identity() - at * at.transpose()),
    }
}

/// The inertia of a part about the origin of its frame.
fn from_part(
    part: &ModelPart,
    value: &dyn Fn(&ExactExpression) -> f64,
    vector: &dyn Fn(&[ExactExpression; 3]) -> Vector3<f64>,
) -> LinkInertia {
    // The symmetric matrix of six expressions.
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
        PartInertia::AboutCentre { mass, centre, inertia } => {
            // Steiner: the inertia of the mass at the centre, plus the inertia about the centre.
            let mut body = point_mass(value(mass), vector(centre));
            body.inertia += matrix(inertia);
            body
        }
    }
}

/// Completes the inertia of links that only translate, or rotate about one direction only, so that it is physically
/// possible. The moments that a model lacks have no effect on the motion of such links.
pub(super) fn complete_inertias(tree: &LinkTree, bodies: &mut [LinkInertia], remarks: &mut Vec<Message>) {
    let mut completed = Vec::new();
    for (l, link) in tree.links.iter().enumerate().skip(1) {
        let body = &mut bodies[l];
        // Only links with mass and an impossible inertia are completed.
        if body.mass <= 0.0 || inertia_fault(body).is_none() {
            continue;
        }
        let central = match link_rotation(tree, l) {
            LinkRotation::Never => body.mass * DEFAULT_RADIUS_OF_GYRATION.powi(2) * Matrix3::identity(),
            LinkRotation::OneAxis(axis) => {
                // The moment about the axis has an effect and is kept; the others get possible values.
                let n = link.placed.rotation.transpose() * axis;
                let about = n.dot(&(body.central_inertia() * n));
                let across = TRANSVERSE_RATIO * about;
                across * Matrix3::identity() + (about - across) * n * n.transpose()
            }
            LinkRotation::AnyAxis => continue,
        };
        // Replace the central inertia; mass and first moment stay.
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
            "moments of inertia without effect on any motion are set to physically possible values: {}",
            completed.join(", ")
        ));
    }
}

/// How a link rotates relative to the base.
enum LinkRotation {
    /// It only translates.
    Never,
    /// About one direction, a unit vector in the axes of the base.
    OneAxis(Vector3<f64>),
    /// About several directions.
    AnyAxis,
}

/// How a link rotates, by the axes of all joints between it and the base.
fn link_rotation(tree: &LinkTree, mut link: usize) -> LinkRotation {
    let mut turns = LinkRotation::Never;
    while link != 0 {
        let one = &tree.links[link];
        if one.joints.is_empty() {
            return LinkRotation::AnyAxis;
        }
        for joint in one.joints.iter().filter(|joint| joint.is_rotation) {
            // Parallel axes are one direction.
            turns = match turns {
                LinkRotation::Never => LinkRotation::OneAxis(joint.axis),
                LinkRotation::OneAxis(axis) if axis.cross(&joint.axis).norm() < 1e-9 => LinkRotation::OneAxis(axis),
                _ => return LinkRotation::AnyAxis,
            };
        }
        link = one.parent;
    }
    turns
}

/// Why an inertia is physically impossible; none if it is possible.
fn inertia_fault(body: &LinkInertia) -> Option<&'static str> {
    // Principal moments must be positive and satisfy the triangle inequality.
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

/// Adds a remark for each link with an impossible inertia; simulators refuse such links or become unstable.
pub(super) fn report_impossible(tree: &LinkTree, bodies: &[LinkInertia], remarks: &mut Vec<Message>) {
    for (link, body) in tree.links.iter().zip(bodies).skip(1) {
        let Some(fault) = inertia_fault(body).filter(|_| !body.is_zero()) else {
            continue;
        };
        remarks.push(message!(
            "`{}` {fault}, which is impossible for a body. Simulators refuse it or become unstable. Identify with {} and write \
             the fit with {}",
            link.name,
            Remedy::option(OptionName::Physical),
            Remedy::command(CommandName::Adopt)
        ));
    }
}
