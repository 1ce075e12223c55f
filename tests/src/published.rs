//! Regroupings of dynamic parameters as exact linear maps from p_g to p_min.
//!
//! A published map comes from a text such as `ZZ1 <- ZZ1 + L^2*M2`; the mill's own comes from its reduction. Both hold
//! rational functions of the constants, which are compared as such, never as floating-point numbers.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Rational;
use modelmill_codegen::field::{FieldElement, RandomStream};
use modelmill_codegen::{BaseReduction, Derivation, FactorVariable, RationalFunction};
use modelmill_spec::{Mechanism, ParameterIdx};

/// A product of powers of names.
pub type Powers = BTreeMap<String, u32>;

/// A polynomial in names with rational coefficients, none of them zero.
pub type Polynomial = BTreeMap<Powers, Rational>;

/// A quotient of polynomials, not reduced.
#[derive(Clone, Debug)]
pub struct Fraction {
    /// Above the line.
    pub numerator: Polynomial,
    /// Below the line; not zero.
    pub denominator: Polynomial,
}

fn number(value: Rational) -> Polynomial {
    if value.is_zero() {
        Polynomial::new()
    } else {
        BTreeMap::from([(Powers::new(), value)])
    }
}

fn plus(a: &Polynomial, b: &Polynomial) -> Polynomial {
    let mut sum = a.clone();
    for (powers, k) in b {
        let total = sum.get(powers).map_or_else(|| k.clone(), |there| there + k);
        sum.insert(powers.clone(), total);
    }
    sum.retain(|_, k| !k.is_zero());
    sum
}

fn times(a: &Polynomial, b: &Polynomial) -> Polynomial {
    let mut product = Polynomial::new();
    for (p, k) in a {
        for (q, l) in b {
            let mut powers = p.clone();
            for (name, n) in q {
                *powers.entry(name.clone()).or_insert(0) += n;
            }
            product = plus(&product, &BTreeMap::from([(powers, k * l)]));
        }
    }
    product
}

impl Fraction {
    /// A number.
    pub fn number(value: Rational) -> Self {
        Self {
            numerator: number(value),
            denominator: number(Rational::ONE),
        }
    }

    /// A name.
    pub fn name(name: &str) -> Self {
        let powers = Powers::from([(name.to_owned(), 1)]);
        Self {
            numerator: BTreeMap::from([(powers, Rational::ONE)]),
            denominator: number(Rational::ONE),
        }
    }

    /// Reads an expression of names, integers, `+ - * / ^` and parentheses.
    pub fn parse(text: &str, definitions: &BTreeMap<String, Fraction>) -> Self {
        let tokens = tokens(text);
        let mut parser = Parser {
            tokens: &tokens,
            at: 0,
            definitions,
        };
        let value = parser.sum();
        assert!(parser.at == tokens.len(), "cannot read all of '{text}'");
        value
    }

    /// A factor of the mill, with the names of the file.
    pub fn of_mill(function: &RationalFunction, mechanism: &Mechanism) -> Self {
        let name = |variable: &FactorVariable| match variable {
            FactorVariable::Constant(i) => mechanism.constants[*i].name.clone(),
            FactorVariable::Cos(i) => format!("cos({})", mechanism.constants[*i].name),
            FactorVariable::Sin(i) => format!("sin({})", mechanism.constants[*i].name),
            FactorVariable::Root(n) => format!("sqrt({n})"),
        };
        let convert = |p: &BTreeMap<Vec<(FactorVariable, u32)>, Rational>| -> Polynomial {
            p.iter()
                .map(|(powers, k)| {
                    let powers = powers.iter().map(|(v, n)| (name(v), *n)).collect();
                    (powers, k.clone())
                })
                .collect()
        };
        Self {
            numerator: convert(&function.numerator),
            denominator: convert(&function.denominator),
        }
    }

    /// Whether it is 0.
    pub fn is_zero(&self) -> bool {
        self.numerator.is_empty()
    }

    fn plus(&self, other: &Self) -> Self {
        if self.denominator == other.denominator {
            return Self {
                numerator: plus(&self.numerator, &other.numerator),
                denominator: self.denominator.clone(),
            };
        }
        Self {
            numerator: plus(
                &times(&self.numerator, &other.denominator),
                &times(&other.numerator, &self.denominator),
            ),
            denominator: times(&self.denominator, &other.denominator),
        }
    }

    fn times(&self, other: &Self) -> Self {
        Self {
            numerator: times(&self.numerator, &other.numerator),
            denominator: times(&self.denominator, &other.denominator),
        }
    }

    fn inverse(&self) -> Self {
        assert!(!self.is_zero(), "division by zero");
        Self {
            numerator: self.denominator.clone(),
            denominator: self.numerator.clone(),
        }
    }

    fn value(&self, values: &BTreeMap<String, FieldElement>) -> Option<FieldElement> {
        let evaluate = |p: &Polynomial| -> Option<FieldElement> {
            p.iter().try_fold(FieldElement::ZERO, |sum, (powers, k)| {
                let term = powers
                    .iter()
                    .try_fold(FieldElement::from_rational(k)?, |product, (name, n)| {
                        Some(product * values.get(name)?.power(u64::from(*n)))
                    })?;
                Some(sum + term)
            })
        };
        Some(evaluate(&self.numerator)? * evaluate(&self.denominator)?.inverse()?)
    }
}

/// Equality as functions: cross products agree.
impl PartialEq for Fraction {
    fn eq(&self, other: &Self) -> bool {
        times(&self.numerator, &other.denominator) == times(&other.numerator, &self.denominator)
    }
}

fn tokens(text: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut in_word = false;
    for c in text.chars() {
        let word = c.is_alphanumeric() || c == '_' || c == '\'';
        if word && in_word {
            tokens.last_mut().expect("a word has begun").push(c);
        } else if !c.is_whitespace() {
            tokens.push(c.to_string());
        }
        in_word = word;
    }
    tokens
}

struct Parser<'a> {
    tokens: &'a [String],
    at: usize,
    definitions: &'a BTreeMap<String, Fraction>,
}

impl Parser<'_> {
    fn next_is(&mut self, token: &str) -> bool {
        let found = self.tokens.get(self.at).is_some_and(|t| t == token);
        self.at += usize::from(found);
        found
    }

    fn sum(&mut self) -> Fraction {
        let mut total = Fraction::number(Rational::ZERO);
        let mut sign = if self.next_is("-") {
            Rational::MINUS_ONE
        } else {
            Rational::ONE
        };
        loop {
            let term = self.product().times(&Fraction::number(sign));
            total = total.plus(&term);
            sign = if self.next_is("+") {
                Rational::ONE
            } else if self.next_is("-") {
                Rational::MINUS_ONE
            } else {
                return total;
            };
        }
    }

    fn product(&mut self) -> Fraction {
        let mut total = self.power();
        loop {
            if self.next_is("*") {
                total = total.times(&self.power());
            } else if self.next_is("/") {
                total = total.times(&self.power().inverse());
            } else {
                return total;
            }
        }
    }

    fn power(&mut self) -> Fraction {
        let base = self.operand();
        if !self.next_is("^") {
            return base;
        }
        let exponent: usize = self.tokens[self.at].parse().expect("an integer exponent");
        self.at += 1;
        (0..exponent).fold(Fraction::number(Rational::ONE), |p, _| p.times(&base))
    }

    fn operand(&mut self) -> Fraction {
        if self.next_is("(") {
            let inner = self.sum();
            assert!(self.next_is(")"), "a parenthesis is not closed");
            return inner;
        }
        let token = &self.tokens[self.at];
        self.at += 1;
        if let Ok(value) = token.parse::<i64>() {
            return Fraction::number(Rational::integer(value));
        }
        self.definitions
            .get(token)
            .cloned()
            .unwrap_or_else(|| Fraction::name(token))
    }
}

/// A linear map from products of parameters to base parameters, with rational functions of the constants.
#[derive(Clone, Debug)]
pub struct Map {
    /// Per base parameter: the product that it is named for, and the factors of all products in it.
    pub rows: Vec<(String, BTreeMap<String, Fraction>)>,
}

impl Map {
    /// Reads a published map.
    ///
    /// A line `name = expression` defines an abbreviation, a line `product <- expression` is a base parameter,
    /// a line without either lists products that stay as they are, and `#` starts a remark.
    pub fn parse(text: &str, mechanism: &Mechanism) -> Self {
        let mut definitions = BTreeMap::new();
        let mut rows = Vec::new();
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if let Some((name, expression)) = line.split_once("<-") {
                let value = Fraction::parse(expression, &definitions);
                rows.push((name.trim().to_owned(), by_product(&value, mechanism)));
            } else if let Some((name, expression)) = line.split_once('=') {
                let value = Fraction::parse(expression, &definitions);
                definitions.insert(name.trim().to_owned(), value);
            } else {
                for name in line.split_whitespace() {
                    rows.push((name.to_owned(), by_product(&Fraction::name(name), mechanism)));
                }
            }
        }
        let names: BTreeSet<&String> = rows.iter().map(|(name, _)| name).collect();
        assert_eq!(names.len(), rows.len(), "a base parameter is given twice");
        Self { rows }
    }

    /// The map that the mill found.
    pub fn of_mill(derivation: &Derivation) -> Self {
        let BaseReduction {
            products,
            retained,
            dependencies,
            ..
        } = &derivation.reduction;
        let text = |k: usize| products[k].text(&derivation.mechanism);
        let mut rows: Vec<(String, BTreeMap<String, Fraction>)> = retained
            .iter()
            .map(|k| {
                let one = Fraction::number(Rational::ONE);
                (text(*k), BTreeMap::from([(text(*k), one)]))
            })
            .collect();
        for line in dependencies {
            for (k, factor) in &line.equals {
                let factor = Fraction::of_mill(factor, &derivation.mechanism);
                assert!(!factor.is_zero(), "a factor that is listed is not zero");
                rows[*k].1.insert(text(line.product), factor);
            }
        }
        Self { rows }
    }

    /// The products that name the base parameters, as [`Mechanism::retain`] takes them.
    pub fn retained(&self, mechanism: &Mechanism) -> Vec<Vec<(ParameterIdx, u32)>> {
        let index = |name: &str| {
            let found = mechanism.parameters.iter().position(|p| p.name == name);
            ParameterIdx(found.unwrap_or_else(|| panic!("the model has no parameter '{name}'")))
        };
        self.rows
            .iter()
            .map(|(product, _)| {
                product
                    .split('*')
                    .map(|factor| match factor.split_once('^') {
                        Some((name, n)) => (index(name), n.parse().expect("an exponent")),
                        None => (index(factor), 1),
                    })
                    .collect()
            })
            .collect()
    }

    /// Asserts that two maps agree row by row and factor by factor, as rational functions.
    pub fn assert_equals(&self, other: &Self) {
        let names = |map: &Self| -> BTreeSet<String> { map.rows.iter().map(|(name, _)| name.clone()).collect() };
        assert_eq!(names(self), names(other), "other parameters are retained");
        for (name, row) in &self.rows {
            let (_, there) = other.rows.iter().find(|(n, _)| n == name).expect("the same names");
            let zero = Fraction::number(Rational::ZERO);
            for product in row.keys().chain(there.keys()) {
                let (a, b) = (row.get(product).unwrap_or(&zero), there.get(product).unwrap_or(&zero));
                assert!(
                    a == b,
                    "the factor of {product} in {name} is {a:?} here and {b:?} there"
                );
            }
        }
    }

    /// Asserts that the base parameters of one map are linear combinations of the other's, and the other way round.
    ///
    /// Row spaces are compared in a prime field of 61 bits at several random values of the constants: two maps that
    /// differ as rational functions agree at one of them with a probability below 1e-15.
    pub fn assert_spans_like(&self, other: &Self, mechanism: &Mechanism) {
        let products: BTreeSet<String> = self
            .rows
            .iter()
            .chain(&other.rows)
            .flat_map(|(_, row)| row.keys().cloned())
            .collect();
        let mut stream = RandomStream::new(0x5052_4F44);
        for _ in 0..5 {
            let constants: BTreeMap<String, FieldElement> = mechanism
                .constants
                .iter()
                .map(|c| (c.name.clone(), stream.next_element()))
                .collect();
            let (a, b) = (
                self.reduced_rows(&products, &constants),
                other.reduced_rows(&products, &constants),
            );
            assert_eq!(a.len(), b.len(), "the ranks differ");
            assert!(a == b, "the base parameters span different spaces");
        }
    }

    /// Rows at one value of the constants, brought to reduced echelon form.
    fn reduced_rows(
        &self,
        products: &BTreeSet<String>,
        constants: &BTreeMap<String, FieldElement>,
    ) -> Vec<Vec<FieldElement>> {
        let mut rows: Vec<Vec<FieldElement>> = self
            .rows
            .iter()
            .map(|(_, row)| {
                products
                    .iter()
                    .map(|product| {
                        row.get(product)
                            .map_or(FieldElement::ZERO, |f| f.value(constants).expect("a regular value"))
                    })
                    .collect()
            })
            .collect();
        let mut rank = 0;
        for column in 0..products.len() {
            let Some(pivot) = (rank..rows.len()).find(|r| rows[*r][column] != FieldElement::ZERO) else {
                continue;
            };
            rows.swap(rank, pivot);
            let inverse = rows[rank][column].inverse().expect("a pivot is not zero");
            for x in &mut rows[rank] {
                *x = *x * inverse;
            }
            let pivot_row = rows[rank].clone();
            for (r, row) in rows.iter_mut().enumerate() {
                let factor = row[column];
                if r != rank && factor != FieldElement::ZERO {
                    for (x, p) in row.iter_mut().zip(&pivot_row) {
                        *x = *x - factor * *p;
                    }
                }
            }
            rank += 1;
        }
        rows.truncate(rank);
        rows
    }
}

/// Splits an expression that is linear in products of parameters into their factors over constants.
fn by_product(value: &Fraction, mechanism: &Mechanism) -> BTreeMap<String, Fraction> {
    let position = |name: &str| mechanism.parameters.iter().position(|p| p.name == name);
    let is_constant = |name: &str| mechanism.constants.iter().any(|c| c.name == name);
    assert!(
        value
            .denominator
            .keys()
            .all(|powers| powers.keys().all(|name| is_constant(name))),
        "a denominator holds more than constants: {value:?}"
    );
    let mut parts: BTreeMap<String, Polynomial> = BTreeMap::new();
    for (powers, k) in &value.numerator {
        let mut product: Vec<(usize, String, u32)> = Vec::new();
        let mut rest = Powers::new();
        for (name, n) in powers {
            match position(name) {
                Some(i) => product.push((i, name.clone(), *n)),
                None => {
                    assert!(is_constant(name), "the model has no symbol '{name}'");
                    rest.insert(name.clone(), *n);
                }
            }
        }
        product.sort();
        let factors: Vec<String> = product
            .into_iter()
            .map(|(_, name, n)| if n == 1 { name } else { format!("{name}^{n}") })
            .collect();
        assert!(!factors.is_empty(), "a term holds no parameter: {powers:?}");
        let part = parts.entry(factors.join("*")).or_default();
        *part = plus(part, &BTreeMap::from([(rest, k.clone())]));
    }
    parts
        .into_iter()
        .map(|(product, numerator)| {
            let fraction = Fraction {
                numerator,
                denominator: value.denominator.clone(),
            };
            (product, fraction)
        })
        .collect()
}
