//! Evaluation of expressions: one traversal, many domains (floating point, exact rationals, a prime field).

use std::collections::BTreeMap;
use std::ops::Range;

use modelmill_algebra::field::{FieldElement, FieldNumber, RandomStream};
use rustc_hash::FxHashMap;

use super::{Atom, AtomAngleSum, ExprId, Graph, Node, Rational, Unary};

/// A number system in which expressions can be evaluated. `None` means that the value does not exist there:
/// a division by zero, a root that is not in the field, a function that the domain does not know.
pub trait EvaluationDomain {
    /// Its numbers.
    type Value: Clone;
    /// A rational number.
    fn rational(&self, value: &Rational) -> Option<Self::Value>;
    /// `a + b`
    fn add(&self, a: &Self::Value, b: &Self::Value) -> Self::Value;
    /// `a * b`
    fn mul(&self, a: &Self::Value, b: &Self::Value) -> Self::Value;
    /// `a^n`
    fn power(&self, a: &Self::Value, n: i32) -> Option<Self::Value>;
    /// `a^n` for a negative `n`. `inverse` belongs to `a` and is empty at first: a domain in which division takes long
    /// keeps `1/a` there for further powers.
    fn negative_power(&self, a: &Self::Value, n: i32, inverse: &mut Option<Self::Value>) -> Option<Self::Value> {
        let _ = inverse;
        self.power(a, n)
    }
    /// A function of one argument.
    fn unary(&self, function: Unary, a: &Self::Value) -> Option<Self::Value>;
    /// What an atom stands for.
    fn atom(&self, atom: Atom) -> Option<Self::Value>;
    /// Cosine and sine of a sum of atoms.
    fn cos_sin(&self, angle: &AtomAngleSum) -> Option<(Self::Value, Self::Value)>;
}

/// The nodes that some roots need, in the order of evaluation.
#[derive(Clone, Debug)]
pub struct EvaluationTape {
    /// Nodes, operands before the nodes that use them.
    steps: Vec<TapeStep>,
    /// Operands of sums and products, one step after the other.
    operands: Vec<TapeOperand>,
    /// Numbers, each once: converting them can take as long as a division.
    rationals: Vec<Rational>,
    angles: Vec<AtomAngleSum>,
    /// How many steps are divided by.
    n_divisors: usize,
    /// The step of each root.
    roots: Vec<u32>,
}

/// One value of an [`EvaluationTape`]; what it needs stands in the tape's lists.
#[derive(Clone, Debug)]
enum TapeStep {
    Rational(u32),
    Atom(Atom),
    Sin(u32),
    Cos(u32),
    Sum(Range<u32>),
    Product(Range<u32>),
    Unary(Unary, u32),
}

/// A term of a sum or a factor of a product.
#[derive(Clone, Copy, Debug)]
struct TapeOperand {
    step: u32,
    kind: OperandKind,
}

#[derive(Clone, Copy, Debug)]
enum OperandKind {
    /// The value as it is.
    Plain,
    /// Times a number of the tape, as a term.
    Scaled(u32),
    /// To a power, as a factor.
    Raised(i32),
    /// To a negative power; with the place of the divisor among those of the tape.
    Divided(i32, u32),
}

impl EvaluationTape {
    /// Collects what `roots` need.
    pub fn new(graph: &Graph, roots: &[ExprId]) -> Self {
        // The position of nodes that are not on the tape.
        const NOWHERE: u32 = u32::MAX;
        // Position on the tape of every node of the graph.
        let mut positions = vec![NOWHERE; graph.len()];
        let (mut places, mut divisors) = (FxHashMap::default(), FxHashMap::default());
        let mut tape = Self {
            steps: Vec::new(),
            operands: Vec::new(),
            rationals: Vec::new(),
            angles: Vec::new(),
            n_divisors: 0,
            roots: Vec::new(),
        };
        for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
            if !needed {
                continue;
            }
            positions[i] = index(tape.steps.len());
            let start = index(tape.operands.len());
            // Operands precede their nodes, so their positions are known.
            let mut place = |rationals: &mut Vec<Rational>, value: &Rational| {
                *places.entry(value.clone()).or_insert_with(|| {
                    rationals.push(value.clone());
                    index(rationals.len() - 1)
                })
            };
            let step = match &graph.nodes[i] {
                Node::Rational(value) => TapeStep::Rational(place(&mut tape.rationals, value)),
                Node::Atom(atom) => TapeStep::Atom(*atom),
                Node::Sin(angle) => TapeStep::Sin(tape.push_angle(angle)),
                Node::Cos(angle) => TapeStep::Cos(tape.push_angle(angle)),
                Node::Sum(terms) => {
                    for (child, factor) in terms {
                        let kind = if factor.is_one() {
                            OperandKind::Plain
                        } else {
                            OperandKind::Scaled(place(&mut tape.rationals, factor))
                        };
                        let step = positions[child.index()];
                        tape.operands.push(TapeOperand { step, kind });
                    }
                    TapeStep::Sum(start..index(tape.operands.len()))
                }
                Node::Product(factors) => {
                    for (child, n) in factors {
                        let step = positions[child.index()];
                        let kind = match *n {
                            1 => OperandKind::Plain,
                            n if n < 0 => {
                                let next = index(divisors.len());
                                OperandKind::Divided(n, *divisors.entry(step).or_insert(next))
                            }
                            n => OperandKind::Raised(n),
                        };
                        tape.operands.push(TapeOperand { step, kind });
                    }
                    TapeStep::Product(start..index(tape.operands.len()))
                }
                Node::Unary(function, child) => TapeStep::Unary(*function, positions[child.index()]),
            };
            tape.steps.push(step);
        }
        tape.n_divisors = divisors.len();
        tape.roots = roots.iter().map(|root| positions[root.index()]).collect();
        tape
    }

    /// The part that some of the roots need, given by their places.
    #[must_use]
    pub fn restricted_to(&self, roots: &[usize]) -> Self {
        let mut is_needed = vec![false; self.steps.len()];
        for root in roots {
            is_needed[self.roots[*root] as usize] = true;
        }
        let range = |range: &Range<u32>| range.start as usize..range.end as usize;
        // Operands stand before the steps that use them.
        for i in (0..self.steps.len()).rev() {
            if !is_needed[i] {
                continue;
            }
            match &self.steps[i] {
                TapeStep::Sum(operands) | TapeStep::Product(operands) => {
                    for operand in &self.operands[range(operands)] {
                        is_needed[operand.step as usize] = true;
                    }
                }
                TapeStep::Unary(_, argument) => is_needed[*argument as usize] = true,
                TapeStep::Rational(_) | TapeStep::Atom(_) | TapeStep::Sin(_) | TapeStep::Cos(_) => {}
            }
        }
        let mut part = Self {
            steps: Vec::new(),
            operands: Vec::new(),
            rationals: Vec::new(),
            angles: Vec::new(),
            n_divisors: 0,
            roots: Vec::new(),
        };
        // New places of steps, numbers and divisors. Each angle belongs to one sine and one cosine at most.
        let mut positions = vec![0; self.steps.len()];
        let (mut places, mut divisors) = (FxHashMap::default(), FxHashMap::default());
        for (i, step) in self.steps.iter().enumerate().filter(|(i, _)| is_needed[*i]) {
            positions[i] = index(part.steps.len());
            let mut place = |rationals: &mut Vec<Rational>, old: u32| {
                *places.entry(old).or_insert_with(|| {
                    rationals.push(self.rationals[old as usize].clone());
                    index(rationals.len() - 1)
                })
            };
            let start = index(part.operands.len());
            let mut push_operands = |part: &mut Self, operands: &Range<u32>| {
                for operand in &self.operands[range(operands)] {
                    let kind = match operand.kind {
                        OperandKind::Scaled(old) => OperandKind::Scaled(place(&mut part.rationals, old)),
                        OperandKind::Divided(n, old) => {
                            let next = index(divisors.len());
                            OperandKind::Divided(n, *divisors.entry(old).or_insert(next))
                        }
                        kind @ (OperandKind::Plain | OperandKind::Raised(_)) => kind,
                    };
                    let step = positions[operand.step as usize];
                    part.operands.push(TapeOperand { step, kind });
                }
                start..index(part.operands.len())
            };
            let step = match step {
                TapeStep::Sum(operands) => TapeStep::Sum(push_operands(&mut part, operands)),
                TapeStep::Product(operands) => TapeStep::Product(push_operands(&mut part, operands)),
                TapeStep::Rational(old) => TapeStep::Rational(place(&mut part.rationals, *old)),
                TapeStep::Atom(atom) => TapeStep::Atom(*atom),
                TapeStep::Sin(angle) => TapeStep::Sin(part.push_angle(&self.angles[*angle as usize])),
                TapeStep::Cos(angle) => TapeStep::Cos(part.push_angle(&self.angles[*angle as usize])),
                TapeStep::Unary(function, argument) => TapeStep::Unary(*function, positions[*argument as usize]),
            };
            part.steps.push(step);
        }
        part.n_divisors = divisors.len();
        part.roots = roots.iter().map(|root| positions[self.roots[*root] as usize]).collect();
        part
    }

    fn push_angle(&mut self, angle: &AtomAngleSum) -> u32 {
        self.angles.push(angle.clone());
        index(self.angles.len() - 1)
    }

    /// How many nodes it evaluates.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there is nothing to evaluate.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Values of the roots; `None` if any of them does not exist.
    pub fn evaluate<D: EvaluationDomain>(&self, domain: &D) -> Option<Vec<D::Value>> {
        let rationals = self.rationals.iter().map(|value| domain.rational(value));
        let rationals: Vec<D::Value> = rationals.collect::<Option<_>>()?;
        let mut inverses: Vec<Option<D::Value>> = vec![None; self.n_divisors];
        let mut values: Vec<D::Value> = Vec::with_capacity(self.steps.len());
        let operands = |range: &Range<u32>| &self.operands[range.start as usize..range.end as usize];
        for step in &self.steps {
            // Values of operands are known, since the tape has them before their nodes.
            let value = match step {
                TapeStep::Rational(place) => rationals[*place as usize].clone(),
                TapeStep::Atom(atom) => domain.atom(*atom)?,
                TapeStep::Sin(angle) => domain.cos_sin(&self.angles[*angle as usize])?.1,
                TapeStep::Cos(angle) => domain.cos_sin(&self.angles[*angle as usize])?.0,
                TapeStep::Sum(terms) => {
                    let mut total: Option<D::Value> = None;
                    for operand in operands(terms) {
                        // Products with 1 are skipped: they are the most frequent ones.
                        let value = &values[operand.step as usize];
                        let scaled = match operand.kind {
                            OperandKind::Scaled(k) => Some(domain.mul(&rationals[k as usize], value)),
                            _ => None,
                        };
                        let term = scaled.as_ref().unwrap_or(value);
                        total = Some(match total {
                            Some(sum) => domain.add(&sum, term),
                            None => term.clone(),
                        });
                    }
                    total?
                }
                TapeStep::Product(factors) => {
                    let mut total: Option<D::Value> = None;
                    for operand in operands(factors) {
                        let value = &values[operand.step as usize];
                        let raised = match operand.kind {
                            OperandKind::Raised(n) => Some(domain.power(value, n)?),
                            OperandKind::Divided(n, k) => {
                                let inverse = &mut inverses[k as usize];
                                Some(domain.negative_power(value, n, inverse)?)
                            }
                            OperandKind::Plain | OperandKind::Scaled(_) => None,
                        };
                        let factor = raised.as_ref().unwrap_or(value);
                        total = Some(match total {
                            Some(product) => domain.mul(&product, factor),
                            None => factor.clone(),
                        });
                    }
                    total?
                }
                TapeStep::Unary(function, argument) => domain.unary(*function, &values[*argument as usize])?,
            };
            values.push(value);
        }
        let roots = self.roots.iter();
        Some(roots.map(|root| values[*root as usize].clone()).collect())
    }
}

/// A position in a list of an [`EvaluationTape`].
fn index(position: usize) -> u32 {
    u32::try_from(position).expect("tape below 4G nodes")
}

/// Double-precision evaluation; the values of atoms come from a function.
pub struct FloatDomain<F: Fn(Atom) -> f64>(
    /// Value of an atom.
    pub F,
);

impl<F: Fn(Atom) -> f64> EvaluationDomain for FloatDomain<F> {
    type Value = f64;
    fn rational(&self, value: &Rational) -> Option<f64> {
        Some(value.to_f64())
    }
    fn add(&self, a: &f64, b: &f64) -> f64 {
        a + b
    }
    fn mul(&self, a: &f64, b: &f64) -> f64 {
        a * b
    }
    // Zero to a power of zero or below has no value.
    fn power(&self, a: &f64, n: i32) -> Option<f64> {
        (*a != 0.0 || n > 0).then(|| a.powi(n))
    }
    fn unary(&self, function: Unary, a: &f64) -> Option<f64> {
        match function {
            Unary::Sqrt => (*a >= 0.0).then(|| a.sqrt()),
            Unary::Sign => Some(if *a == 0.0 { 0.0 } else { a.signum() }),
            Unary::Abs => Some(a.abs()),
            Unary::Tanh => Some(a.tanh()),
            Unary::Exp => Some(a.exp()),
            Unary::Sin => Some(a.sin()),
            Unary::Cos => Some(a.cos()),
        }
    }
    fn atom(&self, atom: Atom) -> Option<f64> {
        Some((self.0)(atom))
    }
    fn cos_sin(&self, angle: &AtomAngleSum) -> Option<(f64, f64)> {
        let total: f64 = angle
            .terms()
            .iter()
            .map(|(atom, n)| f64::from(*n) * (self.0)(*atom))
            .sum();
        Some((total.cos(), total.sin()))
    }
}

/// Evaluation in a prime field or its quadratic extension.
///
/// Functions that are not algebraic are opaque: equal arguments get equal random values. They keep the laws that
/// matter for dependence: `sign` is odd with square 1, `abs(x) = x sign(x)`, `tanh` is odd.
#[derive(Clone, Debug, Default)]
pub struct FieldPoint<N = FieldElement> {
    /// Values of atoms outside sines and cosines of sums of angles.
    pub values: BTreeMap<Atom, N>,
    /// Cosine and sine of atoms in sums of angles.
    pub angles: BTreeMap<Atom, (N, N)>,
    /// Seed of the opaque functions.
    pub seed: u64,
    /// Seed of the choice between the two roots of a square.
    pub root_seed: u64,
}

impl<N: FieldNumber> FieldPoint<N> {
    /// The same point over a larger field.
    pub fn over_field<M: From<N>>(&self) -> FieldPoint<M> {
        let values = self.values.iter().map(|(atom, x)| (*atom, M::from(*x)));
        let circle = |(c, s): (N, N)| (M::from(c), M::from(s));
        let angles = self.angles.iter().map(|(atom, cs)| (*atom, circle(*cs)));
        FieldPoint {
            values: values.collect(),
            angles: angles.collect(),
            seed: self.seed,
            root_seed: self.root_seed,
        }
    }

    /// An opaque sign of a field number: 1 or -1 drawn from the number itself, odd in it, and zero for zero.
    fn sign(&self, a: N) -> N {
        // The value is drawn for the smaller of a and -a, so that sign(-a) = -sign(a).
        let (key, odd) = canonical_sign(a);
        let value = if key.hash_bits(self.seed) & 1 == 0 {
            N::ONE
        } else {
            -N::ONE
        };
        if a == N::ZERO {
            N::ZERO
        } else if odd {
            -value
        } else {
            value
        }
    }

    /// Cosine and sine of an opaque angle: even and odd, on the unit circle.
    fn opaque_circle(&self, a: N) -> (N, N) {
        let (key, odd) = canonical_sign(a);
        let seed = key.hash_bits(self.seed ^ 0x0073_696E);
        let (c, s) = N::draw_circle(&mut RandomStream::new(seed));
        (c, if odd { -s } else { s })
    }
}

/// The smaller of `a` and `-a` in the order of the field, and whether that is `-a`.
fn canonical_sign<N: FieldNumber>(a: N) -> (N, bool) {
    if (-a) < a { (-a, true) } else { (a, false) }
}

impl<N: FieldNumber> EvaluationDomain for FieldPoint<N> {
    type Value = N;
    // The number 1 is the most frequent factor, so it skips the general conversion.
    fn rational(&self, value: &Rational) -> Option<N> {
        if value.is_one() {
            return Some(N::ONE);
        }
        N::from_rational(value)
    }
    fn add(&self, a: &N, b: &N) -> N {
        *a + *b
    }
    fn mul(&self, a: &N, b: &N) -> N {
        *a * *b
    }
    fn power(&self, a: &N, n: i32) -> Option<N> {
        a.integer_power(n)
    }
    fn negative_power(&self, a: &N, n: i32, inverse: &mut Option<N>) -> Option<N> {
        let known = match inverse {
            Some(known) => *known,
            None => *inverse.insert(a.inverse()?),
        };
        known.integer_power(n.checked_neg()?)
    }
    fn unary(&self, function: Unary, a: &N) -> Option<N> {
        match function {
            // A prime field has no positive root: a drawn bit decides between the two.
            // One fixed choice per radicand: equal radicands must have equal roots.
            Unary::Sqrt => a.square_root().map(|root| {
                let flip = a.hash_bits(self.root_seed) & 1 == 1;
                if flip {
                    -canonical_sign(root).0
                } else {
                    canonical_sign(root).0
                }
            }),
            Unary::Sign => Some(self.sign(*a)),
            Unary::Abs => Some(*a * self.sign(*a)),
            // tanh is an opaque odd function.
            Unary::Tanh => {
                let (key, odd) = canonical_sign(*a);
                let value = key.hash_with_seed(self.seed ^ 0x7461_6E68);
                Some(if odd { -value } else { value })
            }
            Unary::Exp => Some(a.hash_with_seed(self.seed ^ 0x0065_7870)),
            Unary::Cos => Some(self.opaque_circle(*a).0),
            Unary::Sin => Some(self.opaque_circle(*a).1),
        }
    }
    fn atom(&self, atom: Atom) -> Option<N> {
        self.values.get(&atom).copied()
    }
    fn cos_sin(&self, angle: &AtomAngleSum) -> Option<(N, N)> {
        // Angles are added one unit at a time by the addition theorems.
        let mut total = (N::ONE, N::ZERO);
        for (atom, n) in angle.terms() {
            let (c, s) = *self.angles.get(atom)?;
            let s = if *n < 0 { -s } else { s };
            for _ in 0..n.unsigned_abs() {
                total = (total.0 * c - total.1 * s, total.0 * s + total.1 * c);
            }
        }
        Some(total)
    }
}

/// Exact evaluation where possible: roots and angles must happen to be rational.
#[derive(Clone, Debug, Default)]
pub struct RationalPoint {
    /// Values of atoms that are not angles.
    pub values: BTreeMap<Atom, Rational>,
    /// Cosine and sine of angle atoms.
    pub angles: BTreeMap<Atom, (Rational, Rational)>,
}

impl EvaluationDomain for RationalPoint {
    type Value = Rational;
    fn rational(&self, value: &Rational) -> Option<Rational> {
        Some(value.clone())
    }
    fn add(&self, a: &Rational, b: &Rational) -> Rational {
        a + b
    }
    fn mul(&self, a: &Rational, b: &Rational) -> Rational {
        a * b
    }
    fn power(&self, a: &Rational, n: i32) -> Option<Rational> {
        (!a.is_zero() || n > 0).then(|| a.pow(n))
    }
    fn unary(&self, function: Unary, a: &Rational) -> Option<Rational> {
        match function {
            // The sign of zero is zero.
            Unary::Sign if a.is_zero() => Some(Rational::ZERO),
            Unary::Sign => Some(if a.is_negative() {
                Rational::MINUS_ONE
            } else {
                Rational::ONE
            }),
            Unary::Abs => Some(a.abs()),
            // Rational only where numerator and denominator of the reduced fraction are squares.
            Unary::Sqrt => {
                let big = a.to_big();
                let (n, d) = (big.numer().sqrt(), big.denom().sqrt());
                let root = num_rational::BigRational::new(n, d);
                (&root * &root == big).then(|| Rational::from(root))
            }
            // These functions have no rational values except at single points.
            Unary::Tanh | Unary::Exp | Unary::Sin | Unary::Cos => None,
        }
    }
    fn atom(&self, atom: Atom) -> Option<Rational> {
        self.values.get(&atom).cloned()
    }
    fn cos_sin(&self, angle: &AtomAngleSum) -> Option<(Rational, Rational)> {
        // Addition theorems, as in the prime field.
        let mut total = (Rational::ONE, Rational::ZERO);
        for (atom, n) in angle.terms() {
            let (c, s) = self.angles.get(atom)?;
            let s = if *n < 0 { -s } else { s.clone() };
            for _ in 0..n.unsigned_abs() {
                total = (&(&total.0 * c) - &(&total.1 * &s), &(&total.0 * &s) + &(&total.1 * c));
            }
        }
        Some(total)
    }
}
