//! What links carry: the inertia of parts, lumped masses and such effects as are bodies, added up.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_spec::{Exact, FrameIdx, Inertial, LumpedMass, Mechanism, Part, Place};
use nalgebra::{Matrix3, Vector3};

use super::ExportError;
use super::tree::{Placed, Tree};

/// Below this share of a link's own size, numbers are rounding.
const ROUNDING: f64 = 1e-12;

/// Radius of gyration of a link that never turns, m.
const UNFELT_RADIUS: f64 = 0.05;
/// Moments across the direction about which a link turns, as parts of that about it: a body somewhat thicker than a plate.
const ACROSS: f64 = 0.6;

/// Ten numbers about the origin of a link, in its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Body {
    /// kg
    pub(super) mass: f64,
    /// kg m
    pub(super) first: Vector3<f64>,
    /// About the origin, kg m^2.
    pub(super) inertia: Matrix3<f64>,
}

impl Body {
    const NONE: Self = Self {
        mass: 0.0,
        first: Vector3::new(0.0, 0.0, 0.0),
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Centre of mass, m; the origin where there is no mass.
    pub(super) fn centre(&self) -> Vector3<f64> {
        if self.mass == 0.0 {
            return Vector3::zeros();
        }
        self.first / self.mass
    }

    /// About the centre of mass, kg m^2.
    pub(super) fn central(&self) -> Matrix3<f64> {
        let c = self.centre();
        self.inertia - self.mass * (c.norm_squared() * Matrix3::identity() - c * c.transpose())
    }

    /// Whether there is nothing.
    pub(super) fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// The same body about the origin of a frame in which its own one is placed.
    fn seen(&self, placed: &Placed) -> Self {
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
pub(super) fn bodies(mechanism: &Mechanism, tree: &Tree) -> Result<Vec<Body>, ExportError> {
    let value = |exact: &Exact| exact.evaluate(&|symbol| mechanism.symbol_nominal(symbol));
    let vector = |exact: &[Exact; 3]| Vector3::from_fn(|k, _| value(&exact[k]));
    let mut bodies = vec![Body::NONE; tree.links.len()];
    let mut add = |frame: FrameIdx, body: &Body| {
        let link = tree.link_of[frame.0];
        let placed = tree.links[link].placed.sees(&tree.frames[frame.0]);
        bodies[link].add(&body.seen(&placed));
    };
    let of_effects = mechanism.effects.iter().map(|effect| &effect.bodies);
    let parts = mechanism.parts.iter();
    for part in parts.chain(of_effects.clone().flat_map(|bodies| &bodies.parts)) {
        add(part.frame, &of_part(part, &value, &vector));
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
        add(lump.frame, &point(share * value(&lump.mass), forces));
    }
    for effect in mechanism.effects.iter().filter(|e| e.mechanics.is_none()) {
        for place in &effect.places {
            let Place::Point(at) = place else { continue };
            let at = &mechanism.points[at.0];
            for term in &effect.terms {
                let mass = mechanism.parameters[term.parameter.0].nominal * value(&term.expression);
                add(at.frame, &point(mass, vector(&at.at)));
            }
        }
    }
    Ok(bodies)
}

fn lump_share(lump: &LumpedMass) -> f64 {
    Exact::Rational(lump.share.clone()).evaluate(&|_| 0.0)
}

fn point(mass: f64, at: Vector3<f64>) -> Body {
    Body {
        mass,
        first: mass * at,
        inertia: mass * (at.norm_squared() * Matrix3::identity() - at * at.transpose()),
    }
}

fn of_part(
    part: &Part,
    value: &dyn Fn(&Exact) -> f64,
    vector: &dyn Fn(&[Exact; 3]) -> Vector3<f64>,
) -> Body {
    let matrix = |six: &[Exact; 6]| {
        let [xx, xy, xz, yy, yz, zz] = [0, 1, 2, 3, 4, 5].map(|k: usize| value(&six[k]));
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    };
    match &part.inertial {
        Inertial::Linear {
            mass,
            first_moment,
            inertia,
        } => Body {
            mass: value(mass),
            first: vector(first_moment),
            inertia: matrix(inertia),
        },
        Inertial::AboutCentre {
            mass,
            centre,
            inertia,
        } => {
            let mut body = point(value(mass), vector(centre));
            body.inertia += matrix(inertia);
            body
        }
    }
}

/// Gives links that only slide, or turn about one direction, moments of inertia that a body can have: those that the model
/// does not say are not felt.
pub(super) fn complete(tree: &Tree, bodies: &mut [Body], remarks: &mut Vec<Message>) {
    let mut completed = Vec::new();
    for (l, link) in tree.links.iter().enumerate().skip(1) {
        let body = &mut bodies[l];
        if body.mass <= 0.0 || fault(body).is_none() {
            continue;
        }
        let central = match turns(tree, l) {
            Turns::Never => body.mass * UNFELT_RADIUS.powi(2) * Matrix3::identity(),
            Turns::About(axis) => {
                let n = link.placed.rotation.transpose() * axis;
                let about = n.dot(&(body.central() * n));
                let across = ACROSS * about;
                across * Matrix3::identity() + (about - across) * n * n.transpose()
            }
            Turns::Anyhow => continue,
        };
        let other = Body {
            inertia: body.inertia - body.central() + central,
            ..*body
        };
        if fault(&other).is_none() {
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
enum Turns {
    Never,
    About(Vector3<f64>),
    Anyhow,
}

fn turns(tree: &Tree, mut link: usize) -> Turns {
    let mut turns = Turns::Never;
    while link != 0 {
        let one = &tree.links[link];
        if one.joints.is_empty() {
            return Turns::Anyhow;
        }
        for joint in one.joints.iter().filter(|joint| joint.is_rotation) {
            turns = match turns {
                Turns::Never => Turns::About(joint.axis),
                Turns::About(axis) if axis.cross(&joint.axis).norm() < 1e-9 => Turns::About(axis),
                _ => return Turns::Anyhow,
            };
        }
        link = one.parent;
    }
    turns
}

/// Why nothing can be such a body.
fn fault(body: &Body) -> Option<&'static str> {
    let moments = body.central().symmetric_eigenvalues();
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
pub(super) fn judge(tree: &Tree, bodies: &[Body], remarks: &mut Vec<Message>) {
    for (link, body) in tree.links.iter().zip(bodies).skip(1) {
        let Some(fault) = fault(body).filter(|_| !body.is_none()) else {
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
