//! Inertia of the links as polynomials in the dynamic parameters, and the products of parameters of eq. (5).

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::{EffectPlace, EffectTerm, ExactExpression, FramePoint, LumpedMass, Mechanism, PartInertia};

use crate::DeriveError;
use crate::expr::{ExprId, Graph, Rational};
use crate::newton_euler::{ELEMENTS, InertiaElement, InertiaFactors};
use crate::tree::KinematicTree;
use crate::tree::expressions::{self, ParameterMonomial, ParameterPolynomial};

/// The inertia of each link that every product of parameters is multiplied with.
#[derive(Clone, Debug, Default)]
pub(crate) struct InertiaByProduct(BTreeMap<ParameterMonomial, BTreeMap<usize, InertiaFactors>>);

impl InertiaByProduct {
    /// Collects the inertia of all parts and lumped masses, also those of effects.
    ///
    /// # Errors
    /// A [`DeriveError`] of an expression that cannot be written as a polynomial in the parameters.
    pub(crate) fn new(graph: &mut Graph, mechanism: &Mechanism, tree: &KinematicTree) -> Result<Self, DeriveError> {
        let mut by_product = Self::default();
        // Parts and lumped masses of the file.
        for part in &mechanism.parts {
            let elements = part_elements(graph, &part.inertial)?;
            by_product.add_elements(graph, tree.link_of(part.frame), elements);
        }
        for lump in &mechanism.lumped_masses {
            let elements = lump_elements(graph, lump)?;
            by_product.add_elements(graph, tree.link_of(lump.frame), elements);
        }
        // Effects may add bodies, or point masses at points.
        for effect in &mechanism.effects {
            for part in &effect.bodies.parts {
                let elements = part_elements(graph, &part.inertial)?;
                by_product.add_elements(graph, tree.link_of(part.frame), elements);
            }
            for lump in &effect.bodies.lumped_masses {
                let elements = lump_elements(graph, lump)?;
                by_product.add_elements(graph, tree.link_of(lump.frame), elements);
            }
            // Effects with mechanics of their own are not additional masses.
            if effect.mechanics.is_some() {
                continue;
            }
            // The terms of an effect at a point are masses there.
            for place in &effect.places {
                let EffectPlace::Point(point) = place else {
                    continue;
                };
                let point = &mechanism.points[point.0];
                for term in &effect.terms {
                    let lump = added_point_mass(point, term);
                    let elements = lump_elements(graph, &lump)?;
                    by_product.add_elements(graph, tree.link_of(point.frame), elements);
                }
            }
        }
        Ok(by_product)
    }

    /// The products that occur, in the order of eq. (5).
    pub(crate) fn products(&self) -> BTreeSet<ParameterMonomial> {
        self.0.keys().cloned().collect()
    }

    /// Links and their inertia that belong to one product.
    pub(crate) fn link_inertias(&self, product: &ParameterMonomial) -> impl Iterator<Item = (usize, &InertiaFactors)> {
        self.0
            .get(product)
            .into_iter()
            .flatten()
            .map(|(link, inertia)| (*link, inertia))
    }

    /// The inertia of each link if every product has the value that `value` returns.
    pub(crate) fn total_inertias(
        &self,
        graph: &mut Graph,
        value: impl Fn(&ParameterMonomial) -> ExprId,
    ) -> BTreeMap<usize, InertiaFactors> {
        // Terms of every element of every link.
        let mut terms: BTreeMap<usize, [Vec<ExprId>; ELEMENTS]> = BTreeMap::new();
        for (product, links) in &self.0 {
            let value = value(product);
            for (link, inertia) in links {
                let slots = terms.entry(*link).or_default();
                for (slot, factor) in slots.iter_mut().zip(inertia) {
                    slot.push(graph.mul(*factor, value));
                }
            }
        }
        terms
            .into_iter()
            .map(|(link, slots)| (link, slots.map(|slot| graph.add_all(&slot))))
            .collect()
    }

    /// Adds the elements of a part to its link; `None` is the base.
    fn add_elements(&mut self, graph: &mut Graph, link: Option<usize>, elements: [ParameterPolynomial; ELEMENTS]) {
        // Parts that are fixed to the base have no effect on the motion. Their products are listed without any inertia.
        for (element, polynomial) in elements.into_iter().enumerate() {
            for (product, factor) in polynomial.0 {
                let links = self.0.entry(product).or_default();
                if let Some(link) = link {
                    let inertia = links.entry(link).or_insert([Graph::ZERO; ELEMENTS]);
                    inertia[element] = graph.add(inertia[element], factor);
                }
            }
        }
    }
}

/// The point mass that a term of an effect adds at a point.
fn added_point_mass(point: &FramePoint, term: &EffectTerm) -> LumpedMass {
    // The mass is the parameter times the term's expression.
    let parameter = ExactExpression::Symbol(modelmill_spec::ModelSymbol::Parameter(term.parameter));
    LumpedMass {
        mass: ExactExpression::Product(vec![parameter, term.expression.clone()]),
        share: num_rational::BigRational::from_integer(1.into()),
        frame: point.frame,
        force_at: point.at.clone(),
        moment_at: point.at.clone(),
    }
}

/// Elements of a part about its frame's origin, as polynomials in the parameters.
fn part_elements(graph: &mut Graph, inertial: &PartInertia) -> Result<[ParameterPolynomial; ELEMENTS], DeriveError> {
    let mut elements: [ParameterPolynomial; ELEMENTS] = Default::default();
    match inertial {
        // Linear parameters are the elements themselves, with one first moment for both balances.
        PartInertia::Linear {
            mass,
            first_moment,
            inertia,
        } => {
            elements[InertiaElement::Mass.index()] = expressions::polynomial(graph, mass)?;
            for i in 0..3 {
                let moment = expressions::polynomial(graph, &first_moment[i])?;
                elements[InertiaElement::ForceMoment(i).index()] = moment.clone();
                elements[InertiaElement::MomentMoment(i).index()] = moment;
            }
            for i in 0..6 {
                elements[InertiaElement::Inertia(i).index()] = expressions::polynomial(graph, &inertia[i])?;
            }
        }
        // Steiner's rule from the centre of mass, plus the inertia about it.
        PartInertia::AboutCentre { mass, centre, inertia } => {
            let mass = expressions::polynomial(graph, mass)?;
            let centre = polynomials(graph, centre)?;
            elements = point_elements(graph, &mass, &centre, &centre)?;
            for i in 0..6 {
                let own = expressions::polynomial(graph, &inertia[i])?;
                let slot = &mut elements[InertiaElement::Inertia(i).index()];
                *slot = slot.plus(&own, graph);
            }
        }
    }
    Ok(elements)
}

/// Elements of a lumped mass, which may act at different points in the two balances.
fn lump_elements(graph: &mut Graph, lump: &LumpedMass) -> Result<[ParameterPolynomial; ELEMENTS], DeriveError> {
    // A lumped mass may be shared by several bodies, each with its share.
    let share = Rational::from(lump.share.clone());
    let mass = expressions::polynomial(graph, &lump.mass)?.scale(&share, graph);
    let force_at = polynomials(graph, &lump.force_at)?;
    let moment_at = polynomials(graph, &lump.moment_at)?;
    point_elements(graph, &mass, &force_at, &moment_at)
}

/// Three components as polynomials in the parameters.
fn polynomials(graph: &mut Graph, exact: &[ExactExpression; 3]) -> Result<[ParameterPolynomial; 3], DeriveError> {
    Ok([
        expressions::polynomial(graph, &exact[0])?,
        expressions::polynomial(graph, &exact[1])?,
        expressions::polynomial(graph, &exact[2])?,
    ])
}

/// Elements of a point mass: `m`, `m c` and `m (c'c 1 - c c')` about the origin (Steiner).
fn point_elements(
    graph: &mut Graph,
    mass: &ParameterPolynomial,
    force_at: &[ParameterPolynomial; 3],
    moment_at: &[ParameterPolynomial; 3],
) -> Result<[ParameterPolynomial; ELEMENTS], DeriveError> {
    let mut elements: [ParameterPolynomial; ELEMENTS] = Default::default();
    // The first moment is the mass times the place, separately for both balances.
    elements[InertiaElement::Mass.index()] = mass.clone();
    for i in 0..3 {
        elements[InertiaElement::ForceMoment(i).index()] = mass.times(&force_at[i], graph)?;
        elements[InertiaElement::MomentMoment(i).index()] = mass.times(&moment_at[i], graph)?;
    }
    // Second moments of the mass about the origin.
    let mut second = |i: usize, j: usize| {
        let product = moment_at[i].times(&moment_at[j], graph)?;
        mass.times(&product, graph)
    };
    let squares = [second(0, 0)?, second(1, 1)?, second(2, 2)?];
    let pairs = [second(0, 1)?, second(0, 2)?, second(1, 2)?];
    let mut set = |position: usize, value: ParameterPolynomial| {
        elements[InertiaElement::Inertia(position).index()] = value;
    };
    set(0, squares[1].plus(&squares[2], graph));
    set(3, squares[0].plus(&squares[2], graph));
    set(5, squares[0].plus(&squares[1], graph));
    for (position, pair) in [1, 2, 4].into_iter().zip(pairs) {
        set(position, pair.scale(&Rational::MINUS_ONE, graph));
    }
    Ok(elements)
}
