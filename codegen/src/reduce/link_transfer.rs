//! Relations between the columns of a link and of the link before it, as polynomials in the constants.
//!
//! Some inertia moves equally on both sides of a joint: a mass on the axis of a revolute joint, with its first and second
//! moment along the axis, and the second moments of a body behind a prismatic joint. So a combination of a link's
//! columns that amounts to such inertia equals a combination of the columns of its parent (Gautier and Khalil 1990 for
//! the parameters of Denavit and Hartenberg; here for any constant position and direction of the axis).
//!
//! The links of an open tree go in, and for a column its relation to others comes out, without points of motion. First
//! moments and second moments are the elements of the pseudo-inertia, which moves from link to parent by `T S T'`.

use super::rational_function::{FactorVariable, RationalFunction, TrigonometricPolynomial};
use super::trigonometric::{polynomial_of, product_of, sum_into};
use crate::expr::{ExprId, Graph, Node, Rational};
use crate::newton_euler::{InertiaElement, InertiaFactors};
use crate::regressor::UnreducedEquations;
use crate::tree::TreeLink;

/// Number of elements of a pseudo-inertia.
const ELEMENTS: usize = 10;

/// Rows and columns of the elements in a symmetric matrix of four rows: second moments, first moments, mass.
const PLACES: [(usize, usize); ELEMENTS] = [
    (0, 0),
    (0, 1),
    (0, 2),
    (1, 1),
    (1, 2),
    (2, 2),
    (0, 3),
    (1, 3),
    (2, 3),
    (3, 3),
];

/// A column of one link whose inertia has numbers as elements.
struct LinkColumn {
    /// Position among the effective columns; `None` for a column that is zero.
    column: Option<usize>,
    /// Its pseudo-inertia.
    elements: [Rational; ELEMENTS],
}

/// What moves from a link to its parent.
struct MovedInertia {
    /// The parent; `None` for the base.
    parent: Option<usize>,
    /// Whether the link is fixed to its parent, so that everything moves.
    is_fixed: bool,
    /// Elements that move equally on both sides of the joint, each with its elements on the parent.
    moved: Vec<(usize, Vec<TrigonometricPolynomial>)>,
}

/// The columns of all links, and what moves between links.
pub(super) struct LinkTransfers {
    links: Vec<MovedInertia>,
    /// Columns by link.
    columns: Vec<Vec<LinkColumn>>,
    /// The link of each effective column, and its position there.
    places: Vec<Option<(usize, usize)>>,
}

impl LinkTransfers {
    /// Prepares the columns of an open tree; `effective` are those with an effect. `None` if there are loops.
    pub(super) fn new(graph: &mut Graph, equations: &UnreducedEquations, effective: &[usize]) -> Option<Self> {
        let loops = &equations.projection.loops;
        if !loops.closures.is_empty() || !loops.passive.is_empty() {
            return None;
        }
        let tree = &equations.tree;
        let links: Vec<MovedInertia> = tree.links.iter().map(|link| moved_inertia(graph, link)).collect();
        let mut columns: Vec<Vec<LinkColumn>> = tree.links.iter().map(|_| Vec::new()).collect();
        let mut places = vec![None; effective.len()];
        for (k, product) in equations.products.iter().enumerate() {
            let mut on_links = equations.inertia.link_inertias(product);
            let (Some((link, inertia)), None) = (on_links.next(), on_links.next()) else {
                continue;
            };
            let Some(elements) = number_elements(graph, inertia) else {
                continue;
            };
            let (link, elements) = to_moving_link(&links, link, elements);
            let column = effective.binary_search(&k).ok();
            if let Some(column) = column {
                places[column] = Some((link, columns[link].len()));
            }
            columns[link].push(LinkColumn { column, elements });
        }
        Some(Self { links, columns, places })
    }

    /// A column as a combination of columns of its own link and of the link before it that stand before it in an order;
    /// `None` if there is no such relation. `positions` has the position of every effective column in that order.
    pub(super) fn relation(&self, column: usize, positions: &[usize]) -> Option<Vec<(usize, RationalFunction)>> {
        let (link, at) = self.places[column]?;
        let target = &self.columns[link][at].elements;
        let here = &self.links[link];
        // Own columns cancel all elements that do not move.
        let stays: Vec<usize> = (0..ELEMENTS)
            .filter(|e| here.moved.iter().all(|(moved, _)| moved != e))
            .collect();
        let own = self.earlier_columns(link, column, positions);
        let vectors: Vec<Vec<Rational>> = (own.iter())
            .map(|one| stays.iter().map(|e| one.elements[*e].clone()).collect())
            .collect();
        let wanted: Vec<Rational> = stays.iter().map(|e| target[*e].clone()).collect();
        let factors = combination(&vectors, &wanted)?;
        let mut rest = target.clone();
        let mut found: Vec<(usize, TrigonometricPolynomial)> = Vec::new();
        for (one, factor) in own.iter().zip(&factors).filter(|(_, factor)| !factor.is_zero()) {
            for (x, y) in rest.iter_mut().zip(&one.elements) {
                *x = &*x + &-&(factor * y);
            }
            if let Some(k) = one.column {
                found.push((k, constant(factor)));
            }
        }
        // What remains moves to the parent.
        let mut elements = vec![TrigonometricPolynomial::new(); ELEMENTS];
        for (element, on_parent) in &here.moved {
            add_multiple(&mut elements, on_parent, &constant(&rest[*element]));
        }
        let mut next = here.parent;
        while let Some(parent) = next
            && elements.iter().any(|x| !x.is_empty())
        {
            let columns = self.earlier_columns(parent, column, positions);
            if let Some(factors) = polynomial_combination(&columns, &elements) {
                for (one, factor) in columns.iter().zip(factors) {
                    found.extend(one.column.filter(|_| !factor.is_empty()).map(|k| (k, factor)));
                }
                break;
            }
            // A frame without a body passes everything on if it is fixed.
            let above = &self.links[parent];
            if !above.is_fixed || above.moved.len() < ELEMENTS {
                return None;
            }
            let mut further = vec![TrigonometricPolynomial::new(); ELEMENTS];
            for (element, on_parent) in &above.moved {
                add_multiple(&mut further, on_parent, &elements[*element]);
            }
            elements = further;
            next = above.parent;
        }
        let function = |(k, p)| (k, RationalFunction::new(p, constant(&Rational::ONE)));
        Some(found.into_iter().map(function).collect())
    }

    /// Columns of a link that are zero, and then those before `column`, in order.
    fn earlier_columns(&self, link: usize, column: usize, positions: &[usize]) -> Vec<&LinkColumn> {
        let mut found: Vec<(Option<usize>, &LinkColumn)> = (self.columns[link].iter())
            .map(|one| (one.column.map(|k| positions[k]), one))
            .filter(|(position, _)| *position < Some(positions[column]))
            .collect();
        found.sort_by_key(|(position, _)| *position);
        found.into_iter().map(|(_, one)| one).collect()
    }
}

/// The same inertia on the link that carries a fixed one, as long as its elements stay numbers. The axes of a joint along
/// x or y are such fixed links.
fn to_moving_link(
    links: &[MovedInertia],
    mut link: usize,
    mut elements: [Rational; ELEMENTS],
) -> (usize, [Rational; ELEMENTS]) {
    while let (true, Some(parent)) = (links[link].is_fixed, links[link].parent) {
        let mut further = vec![TrigonometricPolynomial::new(); ELEMENTS];
        for (element, on_parent) in &links[link].moved {
            add_multiple(&mut further, on_parent, &constant(&elements[*element]));
        }
        let numbers: Option<Vec<Rational>> = further.iter().map(number_value).collect();
        let Some(numbers) = numbers.filter(|_| links[link].moved.len() == ELEMENTS) else {
            break;
        };
        let Ok(numbers) = <[Rational; ELEMENTS]>::try_from(numbers) else {
            break;
        };
        (link, elements) = (parent, numbers);
    }
    (link, elements)
}

/// The value of a polynomial without variables.
fn number_value(polynomial: &TrigonometricPolynomial) -> Option<Rational> {
    match polynomial.iter().next() {
        None => Some(Rational::ZERO),
        Some((powers, value)) => (powers.is_empty() && polynomial.len() == 1).then(|| value.clone()),
    }
}

/// What moves from a link to its parent, as far as it is polynomial in the constants.
fn moved_inertia(graph: &mut Graph, link: &TreeLink) -> MovedInertia {
    let nothing = MovedInertia {
        parent: link.parent,
        is_fixed: !link.is_moving(),
        moved: Vec::new(),
    };
    // Elements by the columns of the pose that they need.
    let elements: &[usize] = match (link.turns.is_empty(), link.slides.is_empty(), link.free.is_some()) {
        (_, _, true) => &[],
        (true, true, false) => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
        // Second and first moment along the axis, and mass.
        (false, true, false) => &[5, 8, 9],
        (true, false, false) => &[0, 1, 2, 3, 4, 5],
        // With a rotation and a translation together, only the second moment along the axis.
        (false, false, false) => &[5],
    };
    let mut pose: Vec<Option<[TrigonometricPolynomial; 4]>> = Vec::with_capacity(4);
    for axis in 0..3 {
        if !elements.iter().any(|e| PLACES[*e].0 == axis || PLACES[*e].1 == axis) {
            pose.push(None);
            continue;
        }
        let mut v = [Graph::ZERO; 3];
        v[axis] = Graph::ONE;
        // The axis of a revolute joint does not depend on its angle.
        if link.turns.is_empty() {
            v = graph.rotate_out(&link.joint, &v);
        }
        for turn in link.pre.iter().rev() {
            v = graph.rotate_out(turn, &v);
        }
        let Some(v) = vector_of(graph, &v) else {
            return nothing;
        };
        let [x, y, z] = v;
        pose.push(Some([x, y, z, TrigonometricPolynomial::new()]));
    }
    let position = if elements.contains(&9) {
        let Some([x, y, z]) = vector_of(graph, &link.position) else {
            return nothing;
        };
        Some([x, y, z, constant(&Rational::ONE)])
    } else {
        None
    };
    pose.push(position);
    let moved = elements.iter().map(|element| {
        let (a, b) = PLACES[*element];
        let (Some(left), Some(right)) = (&pose[a], &pose[b]) else {
            unreachable!("the columns of all elements are written");
        };
        // T E T' of a symmetric matrix E with ones at (a, b) and (b, a).
        let on_parent = PLACES.iter().map(|(i, j)| {
            let mut sum = product_of(&left[*i], &right[*j]);
            if a != b {
                sum_into(&mut sum, &product_of(&left[*j], &right[*i]));
            }
            sum
        });
        (*element, on_parent.collect())
    });
    MovedInertia {
        moved: moved.collect(),
        ..nothing
    }
}

/// A vector as polynomials in the constants.
fn vector_of(graph: &Graph, v: &[ExprId; 3]) -> Option<[TrigonometricPolynomial; 3]> {
    Some([
        polynomial_of(graph, v[0])?,
        polynomial_of(graph, v[1])?,
        polynomial_of(graph, v[2])?,
    ])
}

/// The pseudo-inertia of a link whose inertia has numbers as elements; `None` for other inertia, and for masses with
/// different places in the two balances.
fn number_elements(graph: &Graph, inertia: &InertiaFactors) -> Option<[Rational; ELEMENTS]> {
    let number = |element: InertiaElement| match graph.node(inertia[element.index()]) {
        Node::Rational(value) => Some(value.clone()),
        _ => None,
    };
    let mut first = Vec::with_capacity(3);
    for i in 0..3 {
        let [force, moment] = [InertiaElement::ForceMoment(i), InertiaElement::MomentMoment(i)].map(number);
        first.push(force.filter(|force| Some(force) == moment.as_ref())?);
    }
    let mut j = Vec::with_capacity(6);
    for i in 0..6 {
        j.push(number(InertiaElement::Inertia(i))?);
    }
    let half = &(&(&j[0] + &j[3]) + &j[5]) * &Rational::new(1, 2);
    let mass = number(InertiaElement::Mass)?;
    let second = |i: usize| &half + &-&j[i];
    let [x, y, z] = <[Rational; 3]>::try_from(first).ok()?;
    Some([second(0), -&j[1], -&j[2], second(3), -&j[4], second(5), x, y, z, mass])
}

/// A number as a polynomial.
fn constant(value: &Rational) -> TrigonometricPolynomial {
    let mut found = TrigonometricPolynomial::new();
    if !value.is_zero() {
        found.insert(Vec::<(FactorVariable, u32)>::new(), value.clone());
    }
    found
}

/// Adds `factor * other` to polynomials.
fn add_multiple(
    to: &mut [TrigonometricPolynomial],
    other: &[TrigonometricPolynomial],
    factor: &TrigonometricPolynomial,
) {
    if factor.is_empty() {
        return;
    }
    for (x, y) in to.iter_mut().zip(other) {
        sum_into(x, &product_of(factor, y));
    }
}

/// Vectors of numbers in echelon form, each with the combination of the given vectors that it is.
#[derive(Default)]
struct NumberEchelon(Vec<(usize, Vec<Rational>, Vec<Rational>)>);

impl NumberEchelon {
    fn new(vectors: &[Vec<Rational>]) -> Self {
        let mut found = Self::default();
        for (at, vector) in vectors.iter().enumerate() {
            let mut own = vec![Rational::ZERO; vectors.len()];
            own[at] = Rational::ONE;
            let mut vector = vector.clone();
            let taken = found.reduce(&mut vector);
            for (x, y) in own.iter_mut().zip(&taken) {
                *x = &*x + &-y;
            }
            let Some(pivot) = vector.iter().position(|x| !x.is_zero()) else {
                continue;
            };
            let scale = vector[pivot].recip();
            for x in vector.iter_mut().chain(&mut own) {
                *x = &*x * &scale;
            }
            found.0.push((pivot, vector, own));
        }
        found
    }

    /// Subtracts the known vectors from one, and returns the combination of the given vectors that was subtracted.
    fn reduce(&self, vector: &mut [Rational]) -> Vec<Rational> {
        let n = self.0.first().map_or(0, |(_, _, own)| own.len());
        let mut taken = vec![Rational::ZERO; n];
        for (pivot, known, own) in &self.0 {
            let factor = vector[*pivot].clone();
            if factor.is_zero() {
                continue;
            }
            for (x, y) in vector.iter_mut().zip(known) {
                *x = &*x + &-&(&factor * y);
            }
            for (x, y) in taken.iter_mut().zip(own) {
                *x = &*x + &(&factor * y);
            }
        }
        taken
    }
}

/// The factors with which vectors add up to a vector; `None` if they do not. The first vectors are preferred.
fn combination(vectors: &[Vec<Rational>], wanted: &[Rational]) -> Option<Vec<Rational>> {
    let mut rest = wanted.to_vec();
    let mut factors = NumberEchelon::new(vectors).reduce(&mut rest);
    factors.resize(vectors.len(), Rational::ZERO);
    rest.iter().all(Rational::is_zero).then_some(factors)
}

/// The factors with which columns add up to inertia whose elements are polynomials; `None` if they do not.
fn polynomial_combination(
    columns: &[&LinkColumn],
    elements: &[TrigonometricPolynomial],
) -> Option<Vec<TrigonometricPolynomial>> {
    let vectors: Vec<Vec<Rational>> = columns.iter().map(|one| one.elements.to_vec()).collect();
    let echelon = NumberEchelon::new(&vectors);
    let mut found = vec![TrigonometricPolynomial::new(); columns.len()];
    // A polynomial element is a number times a unit vector, so that unit vectors are combined.
    for (at, element) in elements.iter().enumerate().filter(|(_, element)| !element.is_empty()) {
        let mut unit = vec![Rational::ZERO; ELEMENTS];
        unit[at] = Rational::ONE;
        let factors = echelon.reduce(&mut unit);
        if unit.iter().any(|x| !x.is_zero()) {
            return None;
        }
        for (sum, factor) in found.iter_mut().zip(&factors).filter(|(_, factor)| !factor.is_zero()) {
            sum_into(sum, &product_of(&constant(factor), element));
        }
    }
    Some(found)
}
