//! A mechanism goes in, the equations before reduction come out: tree, inertia, projection and columns.
//! The regressor H of eq. (4): one column per product of dynamic parameters, one row per drive.

pub(crate) mod form;
pub(crate) mod mechanics;
pub(crate) mod projection;

use std::collections::BTreeSet;

use modelmill_spec::{
    ActuatorTerm, CoordinateIdx, DriveKind, EffectPlace, EffectTerm, ExactExpression, Mechanism, ModelEffect,
    PlaceQuantity,
};

use crate::DeriveError;
use crate::expr::{Atom, ExprId, Graph};
use crate::newton_euler;
use crate::newton_euler::inertia::InertiaByProduct;
use crate::regressor::form::{ColumnForm, RecursionFrames, TotalForm};
use crate::regressor::projection::LoopProjection;
use crate::tree::KinematicTree;
use crate::tree::expressions::{self, ParameterMonomial};

/// The mechanism's equations before reduction.
pub(crate) struct UnreducedEquations {
    /// The open tree.
    pub(crate) tree: KinematicTree,
    /// Gravity in the axes of the base, m/s^2.
    pub(crate) gravity: crate::expr::vector::SymbolicVector,
    /// Inertia of the links by product of parameters.
    pub(crate) inertia: InertiaByProduct,
    /// Kinematics of loops and drives.
    pub(crate) projection: LoopProjection,
    /// For every effect the result of [`mechanics::generalised_forces`].
    of_mechanics: Vec<Vec<Vec<Vec<ExprId>>>>,
    /// Products of parameters that occur anywhere, in the order of eq. (5).
    pub(crate) products: Vec<ParameterMonomial>,
    /// `columns[k][d]`: force of drive `d` for product `k`.
    pub(crate) columns: Vec<Vec<ExprId>>,
}

/// Forces of effects.
pub(crate) struct EffectForces {
    /// Generalised forces by coordinate of the open tree.
    pub(crate) on_tree: Vec<ExprId>,
    /// Forces along the drives.
    pub(crate) on_drives: Vec<ExprId>,
}

/// Derives the regressor H for all products of parameters.
pub(crate) fn unreduced_equations(graph: &mut Graph, mechanism: &Mechanism) -> Result<UnreducedEquations, DeriveError> {
    // Kinematics and inertia of the open tree, then loops and drives.
    let tree = KinematicTree::new(graph, mechanism)?;
    let gravity = [
        expressions::expression(graph, &mechanism.gravity[0])?,
        expressions::expression(graph, &mechanism.gravity[1])?,
        expressions::expression(graph, &mechanism.gravity[2])?,
    ];
    let inertia = InertiaByProduct::new(graph, mechanism, &tree)?;
    let projection = LoopProjection::new(graph, mechanism, &tree)?;
    let mut of_mechanics = Vec::new();
    for effect in &mechanism.effects {
        of_mechanics.push(mechanics::generalised_forces(
            graph,
            mechanism,
            &tree,
            &projection,
            &gravity,
            effect,
        )?);
    }
    // Products of bodies and parameters of effects, in the order of eq. (5).
    let mut products: BTreeSet<ParameterMonomial> = inertia.products();
    // The bodies of effects are part of the inertia already.
    // Effects of expressions always have columns, those of mechanics only if they have forces.
    let all = mechanism.effects.iter().zip(&of_mechanics);
    for (effect, _) in all.filter(|(e, forces)| e.mechanics.is_none() || !forces.is_empty()) {
        products.extend(
            effect
                .terms
                .iter()
                .map(|term| ParameterMonomial(vec![(term.parameter.0, 1)])),
        );
    }
    products.extend(
        mechanism
            .servo_forces
            .iter()
            .flat_map(|force| &force.terms)
            .map(servo_product),
    );
    let products: Vec<ParameterMonomial> = products.into_iter().collect();
    let mut equations = UnreducedEquations {
        tree,
        gravity,
        inertia,
        projection,
        of_mechanics,
        products,
        columns: Vec::new(),
    };
    // Columns in the plain form; cheaper forms are searched for the retained ones only.
    let form = ColumnForm::PLAIN;
    let mut frames = RecursionFrames::new(graph, &equations.tree, &gravity, form.style, false);
    let products = equations.products.clone();
    equations.columns = equations.columns_of(graph, mechanism, &mut frames, &products, form)?;
    Ok(equations)
}

impl UnreducedEquations {
    /// Forces of the drives for each of some products with the value 1 and all others 0.
    pub(crate) fn columns_of(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        frames: &mut RecursionFrames,
        products: &[ParameterMonomial],
        form: ColumnForm,
    ) -> Result<Vec<Vec<ExprId>>, DeriveError> {
        let n = mechanism.coordinates.len();
        products
            .iter()
            .map(|product| {
                // Wrenches of the links, carried to the joints.
                let wrenches = form.wrenches(graph, &self.inertia, frames, product, products);
                let on_tree = newton_euler::carry_wrench(
                    graph,
                    &frames.tree,
                    form.style,
                    &mut frames.axes,
                    n,
                    form.depths,
                    wrenches,
                );
                let value = |m: &ParameterMonomial| {
                    if m == product { Graph::ONE } else { Graph::ZERO }
                };
                self.drive_forces(graph, mechanism, &on_tree, &value)
            })
            .collect()
    }

    /// Inverse dynamics: forces of the drives if every product has the value that `value` returns.
    pub(crate) fn inverse_dynamics(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        frames: &RecursionFrames,
        value: &dyn Fn(&ParameterMonomial) -> ExprId,
        form: TotalForm,
    ) -> Result<Vec<ExprId>, DeriveError> {
        let wrenches = form.wrenches(graph, &self.inertia, &self.tree, frames, value);
        let n = mechanism.coordinates.len();
        let on_tree = newton_euler::backward_recursion(graph, &frames.tree, form.style, n, wrenches);
        self.drive_forces(graph, mechanism, &on_tree, value)
    }

    /// Forces of the drives from generalised forces of the bodies on the open tree and from the effects.
    fn drive_forces(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        on_tree: &[ExprId],
        value: &dyn Fn(&ParameterMonomial) -> ExprId,
    ) -> Result<Vec<ExprId>, DeriveError> {
        // Effects on the tree join the bodies; those along drives are added at the end.
        let effects = self.effect_forces(graph, mechanism, value)?;
        let on_tree: Vec<ExprId> = on_tree
            .iter()
            .zip(effects.on_tree)
            .map(|(a, b)| graph.add(*a, b))
            .collect();
        // Constraint forces are eliminated here.
        let forces = self.projection.drive_forces(graph, &on_tree)?;
        Ok(forces
            .into_iter()
            .zip(effects.on_drives)
            .map(|(a, b)| graph.add(a, b))
            .collect())
    }

    /// Generalised forces on the independent coordinates, from those of the open tree and from forces along the drives.
    pub(crate) fn project_on_active(&self, graph: &mut Graph, on_tree: &[ExprId], on_drives: &[ExprId]) -> Vec<ExprId> {
        // Forces along drives act through the Jacobian.
        let projected = self.projection.project(graph, on_tree);
        projected
            .into_iter()
            .enumerate()
            .map(|(a, force)| {
                let mut terms = vec![force];
                for (row, force) in self.projection.drive_jacobian.iter().zip(on_drives) {
                    terms.push(graph.mul(row[a], *force));
                }
                graph.add_all(&terms)
            })
            .collect()
    }

    /// Forces of all effects for the parameter values that `value` returns.
    pub(crate) fn effect_forces(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        value: &dyn Fn(&ParameterMonomial) -> ExprId,
    ) -> Result<EffectForces, DeriveError> {
        // Sums over all effects.
        let mut on_tree = vec![Graph::ZERO; mechanism.coordinates.len()];
        let mut on_drives = vec![Graph::ZERO; mechanism.drives.len()];
        let value_of = value;
        let value = |term: &EffectTerm| value(&ParameterMonomial(vec![(term.parameter.0, 1)]));
        for (effect, of_mechanics) in mechanism.effects.iter().zip(&self.of_mechanics) {
            // Effects with mechanics act on the tree by their generalised forces.
            for by_term in of_mechanics {
                for (term, factors) in effect.terms.iter().zip(by_term) {
                    let value = value(term);
                    for (slot, factor) in on_tree.iter_mut().zip(factors) {
                        let force = graph.mul(*factor, value);
                        *slot = graph.add(*slot, force);
                    }
                }
            }
            if effect.mechanics.is_some() {
                continue;
            }
            // All others act at their places, term by term.
            for (p, place) in effect.places.iter().enumerate() {
                for term in &effect.terms {
                    let value = value(term);
                    // A parameter of zero adds nothing.
                    if value == Graph::ZERO {
                        continue;
                    }
                    let slot = match place {
                        EffectPlace::Coordinate(i) => &mut on_tree[i.0],
                        EffectPlace::Drive(d) => &mut on_drives[d.0],
                        // Masses are in the inertia, and the rest has no parameters.
                        EffectPlace::Point(_) | EffectPlace::Part(_) | EffectPlace::Base | EffectPlace::Force => {
                            continue;
                        }
                    };
                    let factor = self.effect_factor(graph, mechanism, effect, p, term)?;
                    let force = graph.mul(factor, value);
                    *slot = graph.add(*slot, force);
                }
            }
        }
        self.add_servo_forces(graph, mechanism, value_of, &mut on_drives)?;
        Ok(EffectForces { on_tree, on_drives })
    }

    /// Adds the forces of actuators to those along the drives.
    fn add_servo_forces(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        value: &dyn Fn(&ParameterMonomial) -> ExprId,
        on_drives: &mut [ExprId],
    ) -> Result<(), DeriveError> {
        for servo in &mechanism.servo_forces {
            let (place, signal) = (EffectPlace::Drive(servo.drive), EffectPlace::Coordinate(servo.signal));
            for term in &servo.terms {
                let value = value(&servo_product(term));
                if value == Graph::ZERO {
                    continue;
                }
                let factor = self.place_factor(graph, mechanism, place, Some(signal), &term.factor)?;
                let force = graph.mul(factor, value);
                let slot = &mut on_drives[servo.drive.0];
                *slot = graph.add(*slot, force);
            }
        }
        Ok(())
    }

    /// The factor of an effect's parameter at one of its places: the term's expression with the quantities of the
    /// place.
    fn effect_factor(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        effect: &ModelEffect,
        at: usize,
        term: &EffectTerm,
    ) -> Result<ExprId, DeriveError> {
        // With two places, each is the other place of the other one.
        let place = effect.places[at];
        let other = match effect.places.as_slice() {
            [_, _] => Some(effect.places[1 - at]),
            _ => effect.other,
        };
        self.place_factor(graph, mechanism, place, other, &term.expression)
    }

    /// The value of an expression in the quantities of a place and of another one.
    fn place_factor(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        place: EffectPlace,
        other: Option<EffectPlace>,
        expression: &ExactExpression,
    ) -> Result<ExprId, DeriveError> {
        // Quantities of the place and of the other place.
        let here = self.quantities(graph, place);
        let there = other.map_or([None; 4], |other| self.quantities(graph, other));
        // An angle is inserted as a coordinate, so that its sine is that of the joint.
        let mut expression = expression.clone();
        let named = [
            (Some(place), PlaceQuantity::Coordinate),
            (other, PlaceQuantity::OtherCoordinate),
        ];
        for (place, quantity) in named {
            if let Some(i) = place.and_then(|place| rotation_coordinate(mechanism, place)) {
                expression = expressions::name_place_coordinate(&expression, quantity, i);
            }
        }
        expressions::expression_at(graph, &expression, &|quantity| match quantity {
            PlaceQuantity::Coordinate => here[0],
            PlaceQuantity::Rate => here[1],
            PlaceQuantity::Acceleration => here[2],
            PlaceQuantity::Load => here[3],
            PlaceQuantity::OtherCoordinate => there[0],
            PlaceQuantity::OtherRate => there[1],
            PlaceQuantity::OtherAcceleration => there[2],
        })
    }

    /// Coordinate, rate, acceleration and load of a place, where they exist.
    fn quantities(&self, graph: &mut Graph, place: EffectPlace) -> [Option<ExprId>; 4] {
        match place {
            EffectPlace::Drive(d) => {
                let drive = &self.projection.drives[d.0];
                [
                    Some(drive.coordinate),
                    Some(drive.rate),
                    Some(drive.acceleration),
                    Some(graph.atom(Atom::Load(d.0))),
                ]
            }
            EffectPlace::Coordinate(i) => {
                let atoms = [Atom::Coordinate(i.0), Atom::Rate(i.0), Atom::Acceleration(i.0)];
                let [q, qd, qdd] = atoms.map(|a| Some(graph.atom(a)));
                [q, qd, qdd, None]
            }
            EffectPlace::Point(_) | EffectPlace::Part(_) | EffectPlace::Base | EffectPlace::Force => [None; 4],
        }
    }
}

/// The product of gains of a term of an actuator's force.
fn servo_product(term: &ActuatorTerm) -> ParameterMonomial {
    ParameterMonomial(term.parameters.iter().map(|(p, power)| (p.0, *power)).collect())
}

/// The angle of a revolute joint at a place; `None` for all other places.
fn rotation_coordinate(mechanism: &Mechanism, place: EffectPlace) -> Option<CoordinateIdx> {
    let coordinate = match place {
        EffectPlace::Coordinate(i) => i,
        EffectPlace::Drive(d) => match mechanism.drives[d.0].kind {
            DriveKind::Joint(i) => i,
            DriveKind::Linear { .. } => return None,
        },
        EffectPlace::Point(_) | EffectPlace::Part(_) | EffectPlace::Base | EffectPlace::Force => {
            return None;
        }
    };
    // Lengths have no sine.
    let motion = mechanism.coordinates[coordinate.0].motion;
    motion.is_angle().then_some(coordinate)
}
