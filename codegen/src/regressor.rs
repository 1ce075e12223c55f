//! The regressor H of eq. (4): one column per product of dynamic parameters, one row per drive.

use std::collections::BTreeSet;

use modelmill_spec::{
    DriveKind, EffectTerm, Mechanism, Motion as JointMotion, Place, PlaceQuantity,
};

use crate::DeriveError;
use crate::exact::{self, Monomial};
use crate::expr::{Atom, ExprId, Graph};
use crate::inertia::InertiaByProduct;
use crate::newton_euler::{self, Motion, Style};
use crate::projection::Projection;
use crate::tree::Tree;

/// The mechanism's equations before reduction.
pub(crate) struct Equations {
    pub(crate) tree: Tree,
    /// The links' motion in every style that differs for this tree.
    motions: Vec<(Style, Motion)>,
    pub(crate) inertia: InertiaByProduct,
    pub(crate) projection: Projection,
    /// Products of parameters that occur anywhere, in the order of eq. (5).
    pub(crate) products: Vec<Monomial>,
    /// `columns[k][d]`: force of drive `d` for product `k`.
    pub(crate) columns: Vec<Vec<ExprId>>,
}

/// Derives the regressor of all products.
pub(crate) fn equations(
    graph: &mut Graph,
    mechanism: &Mechanism,
) -> Result<Equations, DeriveError> {
    let tree = Tree::new(graph, mechanism)?;
    let gravity = [
        exact::expression(graph, &mechanism.gravity[0])?,
        exact::expression(graph, &mechanism.gravity[1])?,
        exact::expression(graph, &mechanism.gravity[2])?,
    ];
    let has_parallel_axes = tree
        .links
        .iter()
        .enumerate()
        .any(|(i, link)| link.first_parallel != i);
    let styles = [Style::LinkByLink, Style::AcrossParallelAxes];
    let motions = styles
        .into_iter()
        .filter(|style| *style == Style::LinkByLink || has_parallel_axes)
        .map(|style| (style, newton_euler::forward(graph, &tree, &gravity, style)))
        .collect();
    let inertia = InertiaByProduct::new(graph, mechanism, &tree)?;
    let projection = Projection::new(graph, mechanism, &tree)?;
    let mut products: BTreeSet<Monomial> = inertia.products();
    for effect in &mechanism.effects {
        products.extend(
            effect
                .terms
                .iter()
                .map(|term| Monomial(vec![(term.parameter.0, 1)])),
        );
    }
    let products: Vec<Monomial> = products.into_iter().collect();
    let mut equations = Equations {
        tree,
        motions,
        inertia,
        projection,
        products,
        columns: Vec::new(),
    };
    for product in equations.products.clone() {
        let column = equations.column(graph, mechanism, &product, Style::LinkByLink)?;
        equations.columns.push(column);
    }
    Ok(equations)
}

impl Equations {
    /// The styles in which the equations can be written.
    pub(crate) fn styles(&self) -> Vec<Style> {
        self.motions.iter().map(|(style, _)| *style).collect()
    }

    fn motion(&self, style: Style) -> &Motion {
        &self
            .motions
            .iter()
            .find(|(s, _)| *s == style)
            .unwrap_or(&self.motions[0])
            .1
    }

    /// Forces of the drives for one product of value 1, all others 0.
    pub(crate) fn column(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        product: &Monomial,
        style: Style,
    ) -> Result<Vec<ExprId>, DeriveError> {
        let bodies: Vec<_> = self
            .inertia
            .of(product)
            .map(|(link, inertia)| (link, *inertia))
            .collect();
        let motion = self.motion(style);
        let wrenches: Vec<_> = bodies
            .iter()
            .map(|(link, inertia)| (*link, motion.wrench(graph, *link, inertia)))
            .collect();
        let n = mechanism.coordinates.len();
        let on_tree = match style {
            Style::LinkByLink => newton_euler::backward(graph, &self.tree, n, wrenches),
            Style::AcrossParallelAxes => {
                newton_euler::backward_across(graph, &self.tree, n, wrenches)
            }
        };
        let value = |m: &Monomial| {
            if m == product {
                Graph::ONE
            } else {
                Graph::ZERO
            }
        };
        self.forces(graph, mechanism, on_tree, &value)
    }

    /// Inverse dynamics: forces of the drives when every product has the value that `value` gives it.
    pub(crate) fn inverse_dynamics(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        value: &dyn Fn(&Monomial) -> ExprId,
        style: Style,
    ) -> Result<Vec<ExprId>, DeriveError> {
        let inertia = self.inertia.total(graph, value);
        let motion = self.motion(style);
        let wrenches: Vec<_> = inertia
            .iter()
            .map(|(link, inertia)| (*link, motion.wrench(graph, *link, inertia)))
            .collect();
        let on_tree =
            newton_euler::backward(graph, &self.tree, mechanism.coordinates.len(), wrenches);
        self.forces(graph, mechanism, on_tree, value)
    }

    fn forces(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        mut on_tree: Vec<ExprId>,
        value: &dyn Fn(&Monomial) -> ExprId,
    ) -> Result<Vec<ExprId>, DeriveError> {
        let mut on_drives = vec![Graph::ZERO; mechanism.drives.len()];
        for effect in &mechanism.effects {
            for (place, term) in effect
                .places
                .iter()
                .flat_map(|p| effect.terms.iter().map(move |t| (p, t)))
            {
                let value = value(&Monomial(vec![(term.parameter.0, 1)]));
                if value == Graph::ZERO {
                    continue;
                }
                let slot = match place {
                    Place::Coordinate(i) => &mut on_tree[i.0],
                    Place::Drive(d) => &mut on_drives[d.0],
                    Place::Point(_) => continue,
                };
                let factor = self.effect_factor(graph, mechanism, place, term)?;
                let force = graph.mul(factor, value);
                *slot = graph.add(*slot, force);
            }
        }
        let forces = self.projection.drive_forces(graph, &on_tree)?;
        Ok(forces
            .into_iter()
            .zip(on_drives)
            .map(|(a, b)| graph.add(a, b))
            .collect())
    }

    /// What an effect's parameter multiplies at a place.
    fn effect_factor(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        place: &Place,
        term: &EffectTerm,
    ) -> Result<ExprId, DeriveError> {
        let quantities = match place {
            Place::Drive(d) => {
                let drive = &self.projection.drives[d.0];
                [
                    Some(drive.coordinate),
                    Some(drive.rate),
                    Some(drive.acceleration),
                    Some(graph.atom(Atom::Load(d.0))),
                ]
            }
            Place::Coordinate(i) => {
                let atoms = [
                    Atom::Coordinate(i.0),
                    Atom::Rate(i.0),
                    Atom::Acceleration(i.0),
                ];
                let [q, qd, qdd] = atoms.map(|a| Some(graph.atom(a)));
                [q, qd, qdd, None]
            }
            Place::Point(_) => [None; 4],
        };
        // An angle stands as itself, so that its sine is that of a joint.
        let turning = match place {
            Place::Coordinate(i) => Some(*i),
            Place::Drive(d) => match mechanism.drives[d.0].kind {
                DriveKind::Joint(i) => Some(i),
                DriveKind::Linear { .. } => None,
            },
            Place::Point(_) => None,
        };
        let turning =
            turning.filter(|i| mechanism.coordinates[i.0].motion == JointMotion::Revolute);
        let expression = match turning {
            Some(i) => exact::with_coordinate(&term.expression, i),
            None => term.expression.clone(),
        };
        exact::expression_at(graph, &expression, &|quantity| match quantity {
            PlaceQuantity::Coordinate => quantities[0],
            PlaceQuantity::Rate => quantities[1],
            PlaceQuantity::Acceleration => quantities[2],
            PlaceQuantity::Load => quantities[3],
        })
    }
}
