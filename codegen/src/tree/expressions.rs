//! Expressions of the model file as nodes of the graph, and polynomials in the dynamic parameters.

use std::collections::BTreeMap;

use modelmill_spec::{
    CoordinateIdx, ExactAngle, ExactExpression, ExactFunction, ExactLength, Mechanism, ModelSymbol, PlaceQuantity,
};
use num_traits::ToPrimitive;

use crate::DeriveError;
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Rational, Unary};

/// A product of powers of dynamic parameters: `m1*dc1^2` is `[(0, 1), (4, 2)]`. Sorted by parameter.
///
/// Monomials are ordered like words in a dictionary, with the parameters as letters in the order of their declaration;
/// this is the order of eq. (5).
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct ParameterMonomial(pub Vec<(usize, u32)>);

impl ParameterMonomial {
    /// The product of two monomials.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        // Exponents of equal parameters add up.
        let mut powers: BTreeMap<usize, u32> = self.0.iter().copied().collect();
        for (parameter, n) in &other.0 {
            *powers.entry(*parameter).or_insert(0) += n;
        }
        Self(powers.into_iter().collect())
    }

    /// The parameters, each as often as its power states.
    fn repeated_parameters(&self) -> impl Iterator<Item = usize> {
        self.0.iter().flat_map(|(p, n)| std::iter::repeat_n(*p, *n as usize))
    }

    /// As infix text: `m1*dc1^2`.
    pub fn text(&self, mechanism: &Mechanism) -> String {
        if self.0.is_empty() {
            return "1".to_owned();
        }
        let factors: Vec<String> = self
            .0
            .iter()
            .map(|(p, n)| {
                let name = &mechanism.parameters[*p].name;
                if *n == 1 { name.clone() } else { format!("{name}^{n}") }
            })
            .collect();
        factors.join("*")
    }

    /// Its value for given parameters, by index.
    pub fn value(&self, parameters: &[f64]) -> f64 {
        self.0
            .iter()
            .map(|(p, n)| parameters[*p].powi(i32::try_from(*n).unwrap_or(i32::MAX)))
            .product()
    }
}

impl PartialOrd for ParameterMonomial {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for ParameterMonomial {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.repeated_parameters().cmp(other.repeated_parameters())
    }
}

/// Largest number of terms of a polynomial, since powers of sums of parameters can have very many.
const MOST_TERMS: usize = 2000;

/// A polynomial in the dynamic parameters whose coefficients are expressions over constants.
#[derive(Clone, Debug, Default)]
pub(crate) struct ParameterPolynomial(pub(crate) BTreeMap<ParameterMonomial, ExprId>);

impl ParameterPolynomial {
    /// A polynomial without parameters.
    fn constant(value: ExprId) -> Self {
        let mut terms = BTreeMap::new();
        if value != Graph::ZERO {
            terms.insert(ParameterMonomial::default(), value);
        }
        Self(terms)
    }

    /// The sum; terms that cancel are removed.
    pub(crate) fn plus(&self, other: &Self, graph: &mut Graph) -> Self {
        let mut terms = self.0.clone();
        for (monomial, value) in &other.0 {
            let old = terms.get(monomial).copied().unwrap_or(Graph::ZERO);
            terms.insert(monomial.clone(), graph.add(old, *value));
        }
        terms.retain(|_, value| *value != Graph::ZERO);
        Self(terms)
    }

    /// The product with a number.
    pub(crate) fn scale(&self, factor: &Rational, graph: &mut Graph) -> Self {
        Self(
            self.0
                .iter()
                .map(|(m, v)| (m.clone(), graph.scale(*v, factor)))
                .collect(),
        )
    }

    /// The product of two polynomials.
    ///
    /// # Errors
    /// [`DeriveError::TooManyTerms`] if it has more than [`MOST_TERMS`] terms.
    pub(crate) fn times(&self, other: &Self, graph: &mut Graph) -> Result<Self, DeriveError> {
        let mut terms: BTreeMap<ParameterMonomial, Vec<(ExprId, Rational)>> = BTreeMap::new();
        for (m, a) in &self.0 {
            for (n, b) in &other.0 {
                let value = graph.mul(*a, *b);
                terms.entry(m.times(n)).or_default().push((value, Rational::ONE));
                if terms.len() > MOST_TERMS {
                    return Err(DeriveError::TooManyTerms { limit: MOST_TERMS });
                }
            }
        }
        // Coefficients of equal monomials are added, and those that cancel are dropped.
        let mut product: BTreeMap<ParameterMonomial, ExprId> =
            terms.into_iter().map(|(m, values)| (m, graph.sum(&values))).collect();
        product.retain(|_, value| *value != Graph::ZERO);
        Ok(Self(product))
    }
}

/// An exact angle as a sum of atoms and a multiple of pi/12.
pub(crate) fn angle_sum(angle: &ExactAngle) -> (AtomAngleSum, i32) {
    let twelfths = Rational::from(angle.pi.clone());
    let twelfths = &twelfths * &Rational::integer(12);
    assert!(
        twelfths.is_integer(),
        "a validated angle's fixed part is a multiple of pi/12, not pi * {}",
        angle.pi
    );
    // Full turns are dropped.
    let pi12 = twelfths.to_big().to_integer() % num_bigint::BigInt::from(24);
    let terms = angle.terms.iter().map(|(symbol, n)| (atom(*symbol), *n));
    (
        AtomAngleSum::new(terms),
        pi12.to_i32().expect("a remainder modulo 24 fits"),
    )
}

/// The atom of a symbol of the model file; quantities of a place must have been replaced before.
fn atom(symbol: ModelSymbol) -> Atom {
    match symbol {
        ModelSymbol::Constant(i) => Atom::Constant(i.0),
        ModelSymbol::Parameter(i) => Atom::Parameter(i.0),
        ModelSymbol::Coordinate(i) => Atom::Coordinate(i.0),
        ModelSymbol::Place(_) => unreachable!("quantities of a place are put in before"),
    }
}

/// The offset and the coordinates of a length as one expression, m.
pub(crate) fn length(graph: &mut Graph, length: &ExactLength) -> Result<ExprId, DeriveError> {
    let mut terms = vec![(expression(graph, &length.offset)?, Rational::ONE)];
    for (coordinate, factor) in &length.coordinates {
        terms.push((
            graph.atom(Atom::Coordinate(coordinate.0)),
            Rational::from(factor.clone()),
        ));
    }
    Ok(graph.sum(&terms))
}

/// An expression without dynamic parameters and without quantities of a place.
///
/// # Errors
/// [`DeriveError`] if it has any of these, or divides by zero.
pub(crate) fn expression(graph: &mut Graph, exact: &ExactExpression) -> Result<ExprId, DeriveError> {
    expression_at(graph, exact, &|_| None)
}

/// An expression over constants and the quantities of a place, which `place` returns.
pub(crate) fn expression_at(
    graph: &mut Graph,
    exact: &ExactExpression,
    place: &dyn Fn(PlaceQuantity) -> Option<ExprId>,
) -> Result<ExprId, DeriveError> {
    // A polynomial without parameters has at most one term.
    let polynomial = polynomial_at(graph, exact, place)?;
    // Only the monomial without parameters is allowed.
    match polynomial.0.len() {
        0 => Ok(Graph::ZERO),
        1 if polynomial.0.contains_key(&ParameterMonomial::default()) => {
            Ok(polynomial.0[&ParameterMonomial::default()])
        }
        _ => Err(DeriveError::unsupported(
            "a dynamic parameter stands where only constants may",
            exact,
        )),
    }
}

/// An expression without quantities of a place, as a polynomial in the dynamic parameters.
pub(crate) fn polynomial(graph: &mut Graph, exact: &ExactExpression) -> Result<ParameterPolynomial, DeriveError> {
    polynomial_at(graph, exact, &|_| None)
}

/// An expression as a polynomial in the dynamic parameters, with the quantities of a place from `place`.
fn polynomial_at(
    graph: &mut Graph,
    exact: &ExactExpression,
    place: &dyn Fn(PlaceQuantity) -> Option<ExprId>,
) -> Result<ParameterPolynomial, DeriveError> {
    Ok(match exact {
        ExactExpression::Rational(value) => {
            ParameterPolynomial::constant(graph.rational(Rational::from(value.clone())))
        }
        ExactExpression::Pi => ParameterPolynomial::constant(graph.atom(Atom::Pi)),
        ExactExpression::Symbol(ModelSymbol::Parameter(i)) => {
            ParameterPolynomial(BTreeMap::from([(ParameterMonomial(vec![(i.0, 1)]), Graph::ONE)]))
        }
        // Quantities of places exist only inside effects.
        ExactExpression::Symbol(ModelSymbol::Place(quantity)) => match place(*quantity) {
            Some(value) => ParameterPolynomial::constant(value),
            None => {
                return Err(DeriveError::unsupported(
                    "a quantity of a place stands outside an effect",
                    exact,
                ));
            }
        },
        ExactExpression::Symbol(symbol) => ParameterPolynomial::constant(graph.atom(atom(*symbol))),
        ExactExpression::Sum(operands) => {
            let mut total = ParameterPolynomial::default();
            for operand in operands {
                let operand = polynomial_at(graph, operand, place)?;
                total = total.plus(&operand, graph);
            }
            total
        }
        ExactExpression::Product(operands) => {
            let mut total = ParameterPolynomial::constant(Graph::ONE);
            for operand in operands {
                let operand = polynomial_at(graph, operand, place)?;
                total = total.times(&operand, graph)?;
            }
            total
        }
        // Parameters in a denominator are not supported.
        ExactExpression::Quotient(a, b) => {
            let divisor = expression_at(graph, b, place)?;
            if divisor == Graph::ZERO {
                return Err(DeriveError::unsupported("division by zero", exact));
            }
            let inverse = ParameterPolynomial::constant(graph.pow(divisor, -1));
            polynomial_at(graph, a, place)?.times(&inverse, graph)?
        }
        ExactExpression::Negative(a) => polynomial_at(graph, a, place)?.scale(&Rational::MINUS_ONE, graph),
        ExactExpression::Power(a, n) if *n < 0 => {
            let base = expression_at(graph, a, place)?;
            if base == Graph::ZERO {
                return Err(DeriveError::unsupported("division by zero", exact));
            }
            ParameterPolynomial::constant(graph.pow(base, *n))
        }
        // Repeated multiplication: exponents in files are small.
        ExactExpression::Power(a, n) => {
            let base = polynomial_at(graph, a, place)?;
            let mut power = ParameterPolynomial::constant(Graph::ONE);
            for _ in 0..*n {
                power = power.times(&base, graph)?;
            }
            power
        }
        // Sines and cosines of exact angles stay exact; other arguments become nodes of their own.
        ExactExpression::Apply(function, a) => {
            // An exact angle, if the argument is one.
            if let (ExactFunction::Sin | ExactFunction::Cos, Some((sum, pi12))) = (function, AngleAccumulator::angle(a))
            {
                let (c, s) = graph.cos_sin(&sum, pi12);
                return Ok(ParameterPolynomial::constant(if *function == ExactFunction::Sin {
                    s
                } else {
                    c
                }));
            }
            let argument = expression_at(graph, a, place)?;
            ParameterPolynomial::constant(graph.unary(unary(*function), argument))
        }
    })
}

/// The expression with a quantity of a place replaced by a coordinate of the mechanism.
pub(crate) fn name_place_coordinate(
    exact: &ExactExpression,
    quantity: PlaceQuantity,
    coordinate: CoordinateIdx,
) -> ExactExpression {
    // Replaces the quantity in an operand.
    let inner = |a: &ExactExpression| Box::new(name_place_coordinate(a, quantity, coordinate));
    let all = |operands: &[ExactExpression]| {
        operands
            .iter()
            .map(|a| name_place_coordinate(a, quantity, coordinate))
            .collect()
    };
    match exact {
        ExactExpression::Symbol(ModelSymbol::Place(found)) if *found == quantity => {
            ExactExpression::Symbol(ModelSymbol::Coordinate(coordinate))
        }
        ExactExpression::Rational(_) | ExactExpression::Pi | ExactExpression::Symbol(_) => exact.clone(),
        ExactExpression::Sum(operands) => ExactExpression::Sum(all(operands)),
        ExactExpression::Product(operands) => ExactExpression::Product(all(operands)),
        ExactExpression::Quotient(a, b) => ExactExpression::Quotient(inner(a), inner(b)),
        ExactExpression::Negative(a) => ExactExpression::Negative(inner(a)),
        ExactExpression::Power(a, n) => ExactExpression::Power(inner(a), *n),
        ExactExpression::Apply(function, a) => ExactExpression::Apply(*function, inner(a)),
    }
}

/// The graph's function for one of the model file.
fn unary(function: ExactFunction) -> Unary {
    match function {
        ExactFunction::Sin => Unary::Sin,
        ExactFunction::Cos => Unary::Cos,
        ExactFunction::Sqrt => Unary::Sqrt,
        ExactFunction::Abs => Unary::Abs,
        ExactFunction::Sign => Unary::Sign,
        ExactFunction::Tanh => Unary::Tanh,
        ExactFunction::Exp => Unary::Exp,
    }
}

/// Terms of an angle that is being collected: multiples of pi and of atoms.
#[derive(Default)]
struct AngleAccumulator {
    /// Factor of pi.
    pi: Rational,
    /// Atoms with rational factors, in order of occurrence.
    atoms: Vec<(Atom, Rational)>,
}

impl AngleAccumulator {
    /// An expression as an exact angle; `None` if it is no sum of integer multiples of angles and of pi/12.
    fn angle(exact: &ExactExpression) -> Option<(AtomAngleSum, i32)> {
        /// Largest integer factor: sines of larger multiples have too many terms as polynomials.
        const MOST: u32 = 100;
        let mut parts = Self::default();
        parts.collect_terms(exact, &Rational::ONE)?;
        let integer = |value: &Rational| {
            let (n, _) = value.as_small().filter(|(_, d)| *d == 1)?;
            i32::try_from(n).ok().filter(|n| n.unsigned_abs() <= MOST)
        };
        let twelfths = &parts.pi * &Rational::integer(12);
        let (n, _) = twelfths.as_small().filter(|(_, d)| *d == 1)?;
        let pi12 = i32::try_from(n.rem_euclid(24)).ok()?;
        let atoms: Option<Vec<_>> = parts.atoms.iter().map(|(a, k)| Some((*a, integer(k)?))).collect();
        Some((AtomAngleSum::new(atoms?), pi12))
    }

    /// Adds `factor` times an expression to the terms; `None` if that is not linear in angles and pi.
    fn collect_terms(&mut self, exact: &ExactExpression, factor: &Rational) -> Option<()> {
        match exact {
            ExactExpression::Rational(value) if Rational::from(value.clone()).is_zero() => {}
            ExactExpression::Pi => self.pi = &self.pi + factor,
            ExactExpression::Symbol(symbol @ (ModelSymbol::Constant(_) | ModelSymbol::Coordinate(_))) => {
                self.atoms.push((atom(*symbol), factor.clone()));
            }
            ExactExpression::Sum(operands) => {
                for operand in operands {
                    self.collect_terms(operand, factor)?;
                }
            }
            ExactExpression::Negative(a) => self.collect_terms(a, &-factor)?,
            ExactExpression::Quotient(a, b) => match b.as_ref() {
                ExactExpression::Rational(value) if !Rational::from(value.clone()).is_zero() => {
                    self.collect_terms(a, &(factor * &Rational::from(value.clone()).recip()))?;
                }
                _ => return None,
            },
            // At most one operand may be other than a number.
            ExactExpression::Product(operands) => {
                let mut factor = factor.clone();
                let mut rest = None;
                for operand in operands {
                    match operand {
                        ExactExpression::Rational(value) => {
                            factor = &factor * &Rational::from(value.clone());
                        }
                        _ if rest.is_none() => rest = Some(operand),
                        _ => return None,
                    }
                }
                self.collect_terms(rest?, &factor)?;
            }
            _ => return None,
        }
        Some(())
    }
}
