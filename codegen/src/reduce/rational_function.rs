//! Rational functions of the model's constants: the factors a_k of eq. (6), with their values and normal form.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_algebra::field::FieldElement;

use num_rational::BigRational;
use num_traits::{ToPrimitive, Zero};

use crate::expr::{Atom, AtomAngleSum, ExprId, FieldPoint, Graph, Rational};

/// A sum below this share of its terms' magnitudes is added up exactly, because rounding would dominate it.
const CANCELLED: f64 = 1e-3;

/// What a factor may depend on: a constant, or the cosine or sine of a constant angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FactorVariable {
    /// A constant of the model file.
    Constant(usize),
    /// Cosine of a constant angle.
    Cos(usize),
    /// Sine of a constant angle.
    Sin(usize),
    /// Square root of a small integer, from a sine or cosine of a multiple of pi/12.
    Root(i64),
}

impl FactorVariable {
    /// Its value at a point of the field.
    pub(crate) fn value<const P: u64>(self, point: &FieldPoint<FieldElement<P>>) -> Option<FieldElement<P>> {
        // Sine and cosine of a constant are drawn independently of its value.
        match self {
            Self::Constant(i) => point.values.get(&Atom::Constant(i)).copied(),
            Self::Cos(i) => point.angles.get(&Atom::Constant(i)).map(|cs| cs.0),
            Self::Sin(i) => point.angles.get(&Atom::Constant(i)).map(|cs| cs.1),
            // Both signs of the root are possible; the point has chosen one.
            Self::Root(n) => {
                crate::expr::EvaluationDomain::unary(point, crate::expr::Unary::Sqrt, &FieldElement::from_i64(n))
            }
        }
    }

    /// Its value in double precision, for constants by index.
    fn value_f64(self, constants: &[f64]) -> f64 {
        match self {
            Self::Constant(i) => constants[i],
            Self::Cos(i) => constants[i].cos(),
            Self::Sin(i) => constants[i].sin(),
            Self::Root(n) => (n as f64).sqrt(),
        }
    }

    /// Its node in the graph.
    pub fn expression(self, graph: &mut Graph) -> ExprId {
        match self {
            Self::Constant(i) => graph.atom(Atom::Constant(i)),
            Self::Cos(i) => graph.cos_sin(&AtomAngleSum::new([(Atom::Constant(i), 1)]), 0).0,
            Self::Sin(i) => graph.cos_sin(&AtomAngleSum::new([(Atom::Constant(i), 1)]), 0).1,
            Self::Root(n) => {
                let radicand = graph.integer(n);
                graph.unary(crate::expr::Unary::Sqrt, radicand)
            }
        }
    }
}

/// A product of powers of variables, sorted, without zero exponents.
pub type PowerProduct = Vec<(FactorVariable, u32)>;

/// A polynomial with rational coefficients, none of them zero.
pub type TrigonometricPolynomial = BTreeMap<PowerProduct, Rational>;

/// A quotient of two polynomials in the constants, in lowest terms up to common factors of several terms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RationalFunction {
    /// Numerator; empty for 0.
    pub numerator: TrigonometricPolynomial,
    /// Denominator with coprime integer coefficients, the first of them positive.
    pub denominator: TrigonometricPolynomial,
}

impl RationalFunction {
    /// A number.
    pub fn constant(value: Rational) -> Self {
        // Zero is the polynomial without terms.
        let one = BTreeMap::from([(PowerProduct::new(), Rational::ONE)]);
        let numerator = if value.is_zero() {
            BTreeMap::new()
        } else {
            BTreeMap::from([(PowerProduct::new(), value)])
        };
        Self {
            numerator,
            denominator: one,
        }
    }

    /// Normalises a quotient; the denominator must not be zero.
    pub(crate) fn new(mut numerator: TrigonometricPolynomial, mut denominator: TrigonometricPolynomial) -> Self {
        assert!(!denominator.is_empty(), "a denominator is not zero");
        if numerator.is_empty() {
            // A numerator without terms is zero.
            return Self::constant(Rational::ZERO);
        }
        (numerator, denominator) = (with_fewest_terms(numerator), with_fewest_terms(denominator));
        // Powers of variables that all terms have are removed from both polynomials.
        let common = denominator
            .keys()
            .chain(numerator.keys())
            .map(|powers| powers.iter().copied().collect::<BTreeMap<_, _>>())
            // The smallest exponent of every variable.
            .reduce(|a, b| {
                a.into_iter()
                    .filter_map(|(v, n)| b.get(&v).map(|m| (v, n.min(*m))))
                    .collect()
            })
            .unwrap_or_default();
        // Divides every term by the common powers.
        let strip = |p: TrigonometricPolynomial| -> TrigonometricPolynomial {
            p.into_iter()
                .map(|(powers, k)| {
                    let rest = powers
                        .into_iter()
                        .map(|(v, n)| (v, n - common.get(&v).copied().unwrap_or(0)))
                        .filter(|(_, n)| *n > 0)
                        .collect();
                    (rest, k)
                })
                .collect()
        };
        (numerator, denominator) = (strip(numerator), strip(denominator));
        // The denominator gets coprime integer coefficients, the first of them positive.
        let mut content = denominator.values().fold(Rational::ZERO, |c, k| c.content_with(k));
        if denominator.values().next_back().is_some_and(Rational::is_negative) {
            content = -&content;
        }
        let inverse = content.recip();
        for k in numerator.values_mut().chain(denominator.values_mut()) {
            *k = &*k * &inverse;
        }
        Self { numerator, denominator }
    }

    /// Whether it is 0.
    pub fn is_zero(&self) -> bool {
        self.numerator.is_empty()
    }

    /// Its value at a point of the field; `None` where the denominator vanishes.
    pub(crate) fn value<const P: u64>(&self, point: &FieldPoint<FieldElement<P>>) -> Option<FieldElement<P>> {
        let denominator = polynomial_value(&self.denominator, point)?.inverse()?;
        Some(polynomial_value(&self.numerator, point)? * denominator)
    }

    /// Its value in double precision, for constants by index. Sums whose terms nearly cancel are added up exactly,
    /// because quotients with them are large and would lose digits in both parts.
    pub fn value_f64(&self, constants: &[f64]) -> f64 {
        let evaluate = |p: &TrigonometricPolynomial| -> f64 {
            // The sum and the sum of the magnitudes of its terms.
            let (mut sum, mut size) = (0.0, 0.0);
            for (powers, k) in p {
                let term = powers.iter().fold(k.to_f64(), |product, (v, n)| {
                    product * v.value_f64(constants).powi(i32::try_from(*n).unwrap_or(i32::MAX))
                });
                sum += term;
                size += term.abs();
            }
            // Most digits have cancelled, so the terms are added as fractions.
            if sum.abs() < CANCELLED * size && size.is_finite() {
                let exact: Vec<BigRational> = constants.iter().map(|c| from_f64(*c)).collect();
                return polynomial_exact(p, &exact).to_f64().unwrap_or(f64::NAN);
            }
            sum
        };
        evaluate(&self.numerator) / evaluate(&self.denominator)
    }

    /// Its exact value for exact constants, by index; sines, cosines and roots are those of double precision.
    pub fn value_exact(&self, constants: &[BigRational]) -> BigRational {
        polynomial_exact(&self.numerator, constants) / polynomial_exact(&self.denominator, constants)
    }

    /// As an expression of the graph.
    pub fn expression(&self, graph: &mut Graph) -> ExprId {
        // Each polynomial as a sum of products of powers.
        let mut build = |p: &TrigonometricPolynomial| {
            let terms: Vec<_> = p
                .iter()
                .map(|(powers, k)| {
                    let factors: Vec<_> = powers
                        .iter()
                        .map(|(v, n)| (v.expression(graph), i32::try_from(*n).expect("a small exponent")))
                        .collect();
                    (graph.product(&factors), k.clone())
                })
                .collect();
            graph.sum(&terms)
        };
        let (n, d) = (build(&self.numerator), build(&self.denominator));
        graph.div(n, d)
    }
}

/// The exact value of a double; zero if it is not finite.
fn from_f64(value: f64) -> BigRational {
    BigRational::from_float(value).unwrap_or_else(BigRational::zero)
}

/// The exact value of a polynomial for exact constants; sines, cosines and roots are those of double precision.
fn polynomial_exact(p: &TrigonometricPolynomial, constants: &[BigRational]) -> BigRational {
    let mut sum = BigRational::zero();
    for (powers, k) in p {
        let mut product = k.to_big();
        for (v, n) in powers {
            // Angles are rounded to double precision before their sine or cosine is computed.
            let angle = |i: &usize| constants[*i].to_f64().unwrap_or(f64::NAN);
            let value = match v {
                FactorVariable::Constant(i) => constants[*i].clone(),
                FactorVariable::Cos(i) => from_f64(angle(i).cos()),
                FactorVariable::Sin(i) => from_f64(angle(i).sin()),
                FactorVariable::Root(r) => from_f64((*r as f64).sqrt()),
            };
            product *= num_traits::pow(value, *n as usize);
        }
        sum += product;
    }
    sum
}

/// The same polynomial with even powers of a cosine written as powers of the sine if that has fewer terms:
/// `L^2 - L^2*cos(beta)^2` is `L^2*sin(beta)^2`.
fn with_fewest_terms(mut p: TrigonometricPolynomial) -> TrigonometricPolynomial {
    // Angles whose cosines occur.
    let angles: BTreeSet<usize> = p
        .keys()
        .flatten()
        .filter_map(|(v, _)| match v {
            FactorVariable::Cos(i) => Some(*i),
            _ => None,
        })
        .collect();
    for i in angles {
        let mut in_sines = TrigonometricPolynomial::new();
        for (powers, k) in &p {
            // Exponent of a variable in this term.
            let power_of = |v: FactorVariable| {
                let found = powers.iter().find(|(w, _)| *w == v);
                found.map_or(0, |(_, n)| *n)
            };
            let (cosines, sines) = (power_of(FactorVariable::Cos(i)), power_of(FactorVariable::Sin(i)));
            // cos^2n = (1 - sin^2)^n, term by term with alternating binomial coefficients.
            let n = cosines / 2;
            let mut coefficient = k.clone();
            for j in 0..=n {
                let mut term: BTreeMap<FactorVariable, u32> = powers.iter().copied().collect();
                term.insert(FactorVariable::Cos(i), cosines % 2);
                term.insert(FactorVariable::Sin(i), sines + 2 * j);
                let term: PowerProduct = term.into_iter().filter(|(_, n)| *n > 0).collect();
                let sum = in_sines.entry(term).or_insert(Rational::ZERO);
                *sum = &*sum + &coefficient;
                coefficient = &coefficient * &Rational::new(-i64::from(n - j), i64::from(j) + 1);
            }
        }
        // Terms may have cancelled.
        in_sines.retain(|_, k| !k.is_zero());
        if in_sines.len() < p.len() {
            p = in_sines;
        }
    }
    p
}

/// The value of a product of powers at a point of the field; `None` if a root does not exist there.
pub(crate) fn monomial_value<const P: u64>(
    powers: &PowerProduct,
    point: &FieldPoint<FieldElement<P>>,
) -> Option<FieldElement<P>> {
    powers.iter().try_fold(FieldElement::ONE, |product, (v, n)| {
        Some(product * v.value(point)?.power(u64::from(*n)))
    })
}

/// The value of a polynomial at a point of the field; `None` if a root does not exist there.
fn polynomial_value<const P: u64>(
    p: &TrigonometricPolynomial,
    point: &FieldPoint<FieldElement<P>>,
) -> Option<FieldElement<P>> {
    p.iter().try_fold(FieldElement::ZERO, |sum, (powers, k)| {
        Some(sum + FieldElement::from_rational(k)? * monomial_value(powers, point)?)
    })
}
