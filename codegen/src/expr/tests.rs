//! Expressions against exact evaluation: the constructors keep the value of every random expression.

use modelmill_algebra::field::{FieldElement, MODULUS};

use proptest::prelude::*;

use super::{
    Atom, AtomAngleSum, EvaluationDomain, EvaluationTape, ExprId, FieldPoint, FloatDomain, Graph, Rational,
    RationalPoint, Unary,
};

/// A random expression as a program for the constructors: each step uses values made before.
#[derive(Clone, Debug)]
enum Step {
    Number(i64, i64),
    Atom(usize),
    Angle(Vec<(usize, i32)>, bool),
    Add(usize, usize),
    Sub(usize, usize),
    Mul(usize, usize),
    Div(usize, usize),
    Pow(usize, i32),
    Abs(usize),
    Sign(usize),
    SumOf(Vec<(usize, i64)>),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let i = 0..30usize;
    let step = prop_oneof![
        (-5i64..6, 1i64..4).prop_map(|(n, d)| Step::Number(n, d)),
        (0..3usize).prop_map(Step::Atom),
        (prop::collection::vec((0..2usize, -2i32..3), 1..3), any::<bool>()).prop_map(|(a, s)| Step::Angle(a, s)),
        (i.clone(), i.clone()).prop_map(|(a, b)| Step::Add(a, b)),
        (i.clone(), i.clone()).prop_map(|(a, b)| Step::Sub(a, b)),
        (i.clone(), i.clone()).prop_map(|(a, b)| Step::Mul(a, b)),
        (i.clone(), i.clone()).prop_map(|(a, b)| Step::Div(a, b)),
        (i.clone(), -2i32..4).prop_map(|(a, n)| Step::Pow(a, n)),
        i.clone().prop_map(Step::Abs),
        i.clone().prop_map(Step::Sign),
        prop::collection::vec((i, -3i64..4), 2..5).prop_map(Step::SumOf),
    ];
    prop::collection::vec(step, 4..25)
}

/// Values of atoms and of the sines and cosines of two angles, rational all of them.
fn point(seed: [i64; 3], tangents: [i64; 2]) -> RationalPoint {
    let mut point = RationalPoint::default();
    for (i, value) in seed.into_iter().enumerate() {
        point.values.insert(Atom::Parameter(i), Rational::new(value, 7));
    }
    for (i, t) in tangents.into_iter().enumerate() {
        let t = Rational::new(t, 5);
        let square = &t * &t;
        let scale = (&Rational::ONE + &square).recip();
        let (c, s) = (&(&Rational::ONE - &square) * &scale, &(&t + &t) * &scale);
        point.angles.insert(Atom::Coordinate(i), (c, s));
    }
    point
}

/// Builds the expressions, and computes their values by plain rational arithmetic.
fn build(graph: &mut Graph, steps: &[Step], point: &RationalPoint) -> (Vec<ExprId>, Vec<Rational>) {
    let mut made: Vec<(ExprId, Rational)> = vec![(Graph::ONE, Rational::ONE)];
    for step in steps {
        let get = |i: usize| made[i % made.len()].clone();
        let next = match step {
            Step::Number(n, d) => {
                let value = Rational::new(*n, *d);
                (graph.rational(value.clone()), value)
            }
            Step::Atom(i) => (
                graph.atom(Atom::Parameter(*i)),
                point.values[&Atom::Parameter(*i)].clone(),
            ),
            Step::Angle(terms, sine) => {
                let sum = AtomAngleSum::new(terms.iter().map(|(i, n)| (Atom::Coordinate(*i), *n)));
                let (c, s) = graph.cos_sin(&sum, 0);
                let (cv, sv) = point.cos_sin(&sum).expect("both angles are known");
                if *sine { (s, sv) } else { (c, cv) }
            }
            Step::Add(a, b) => {
                let ((a, x), (b, y)) = (get(*a), get(*b));
                (graph.add(a, b), &x + &y)
            }
            Step::Sub(a, b) => {
                let ((a, x), (b, y)) = (get(*a), get(*b));
                (graph.sub(a, b), &x - &y)
            }
            Step::Mul(a, b) => {
                let ((a, x), (b, y)) = (get(*a), get(*b));
                (graph.mul(a, b), &x * &y)
            }
            Step::Div(a, b) => {
                let ((a, x), (b, y)) = (get(*a), get(*b));
                if y.is_zero() {
                    continue;
                }
                (graph.div(a, b), &x * &y.recip())
            }
            Step::Pow(a, n) => {
                let (a, x) = get(*a);
                if x.is_zero() && *n <= 0 {
                    continue;
                }
                (graph.pow(a, *n), x.pow(*n))
            }
            Step::Abs(a) => {
                let (a, x) = get(*a);
                (graph.unary(Unary::Abs, a), x.abs())
            }
            Step::Sign(a) => {
                let (a, x) = get(*a);
                let sign = i64::from(!x.is_zero()) * if x.is_negative() { -1 } else { 1 };
                (graph.unary(Unary::Sign, a), Rational::integer(sign))
            }
            Step::SumOf(terms) => {
                let terms: Vec<_> = terms.iter().map(|(i, k)| (get(*i), Rational::integer(*k))).collect();
                let value = terms.iter().fold(Rational::ZERO, |s, ((_, x), k)| &s + &(x * k));
                let terms: Vec<_> = terms.into_iter().map(|((id, _), k)| (id, k)).collect();
                (graph.sum(&terms), value)
            }
        };
        // Numbers of hundreds of digits test nothing new.
        if next.1.as_small().is_some_and(|(n, d)| n.abs() < 1 << 40 && d < 1 << 40) {
            made.push(next);
        }
    }
    made.into_iter().unzip()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn constructors_keep_the_value(
        steps in steps(),
        values in [1i64..60, -60i64..60, -60i64..60],
        tangents in [-9i64..10, -9i64..10],
    ) {
        let mut graph = Graph::new();
        let point = point(values, tangents);
        let (ids, expected) = build(&mut graph, &steps, &point);
        let found = EvaluationTape::new(&graph, &ids).evaluate(&point);
        // A division by an expression that merely happens to vanish may be moved; then there is no value to compare.
        if let Some(found) = found {
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn field_and_floating_point_agree_with_exact_values(
        steps in steps(),
        values in [1i64..60, -60i64..60, -60i64..60],
        tangents in [-9i64..10, -9i64..10],
    ) {
        let mut graph = Graph::new();
        let exact = point(values, tangents);
        let (ids, expected) = build(&mut graph, &steps, &exact);
        let tape = EvaluationTape::new(&graph, &ids);
        let angle = |i: usize| 2.0 * (tangents[i] as f64 / 5.0).atan();
        let float = tape.evaluate(&FloatDomain(|atom: Atom| match atom {
            Atom::Parameter(i) => values[i] as f64 / 7.0,
            Atom::Coordinate(i) => angle(i),
            _ => f64::NAN,
        }));
        let has_sign = graph
            .nodes_of(&ids)
            .any(|node| matches!(node, super::Node::Unary(Unary::Sign | Unary::Abs, _)));
        if let Some(float) = float.filter(|_| !has_sign) {
            let size = expected.iter().map(|x| x.abs().to_f64()).fold(1.0, f64::max);
            for (a, b) in float.iter().zip(&expected) {
                prop_assert!((a - b.to_f64()).abs() <= 1e-6 * size * size, "{a} {b}");
            }
        }
        let element = |x: &Rational| FieldElement::<MODULUS>::from_rational(x).expect("no denominator is the modulus");
        let field = FieldPoint {
            values: exact.values.iter().map(|(a, x)| (*a, element(x))).collect(),
            angles: exact.angles.iter().map(|(a, (c, s))| (*a, (element(c), element(s)))).collect(),
            ..FieldPoint::default()
        };
        if let Some(found) = tape.evaluate(&field).filter(|_| !has_sign) {
            prop_assert_eq!(found, expected.iter().map(element).collect::<Vec<_>>());
        }
    }

    #[test]
    fn derivatives_agree_with_dual_numbers(
        steps in steps(),
        values in [1i64..60, -60i64..60, -60i64..60],
        tangents in [-9i64..10, -9i64..10],
    ) {
        let mut graph = Graph::new();
        let exact = point(values, tangents);
        let (ids, _) = build(&mut graph, &steps, &exact);
        for atom in [Atom::Parameter(0), Atom::Coordinate(1)] {
            let dual = EvaluationTape::new(&graph, &ids).evaluate(&Dual { point: &exact, atom });
            let derivatives = graph.differentiate(&ids, atom);
            let found = EvaluationTape::new(&graph, &derivatives).evaluate(&exact);
            if let (Some(dual), Some(found)) = (dual, found) {
                prop_assert_eq!(found, dual.into_iter().map(|(_, d)| d).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn substitution_is_evaluation_elsewhere(
        steps in steps(),
        values in [1i64..60, -60i64..60, -60i64..60],
        tangents in [-9i64..10, -9i64..10],
    ) {
        let mut graph = Graph::new();
        let here = point(values, tangents);
        let (ids, _) = build(&mut graph, &steps, &here);
        // p0 becomes p1 + 2
        let (p0, p1) = (graph.atom(Atom::Parameter(0)), graph.atom(Atom::Parameter(1)));
        let two = graph.integer(2);
        let shifted = graph.add(p1, two);
        let zero_divisor = EvaluationTape::new(&graph, &[shifted]).evaluate(&here).is_none_or(|v| v[0].is_zero());
        prop_assume!(!zero_divisor);
        let mut there = here.clone();
        there.values.insert(Atom::Parameter(0), &here.values[&Atom::Parameter(1)] + &Rational::integer(2));
        let expected = EvaluationTape::new(&graph, &ids).evaluate(&there);
        prop_assume!(expected.is_some());
        let put = graph.substitute(&ids, &std::collections::BTreeMap::from([(p0, shifted)]));
        if let Some(found) = EvaluationTape::new(&graph, &put).evaluate(&here) {
            prop_assert_eq!(Some(found), expected);
        }
    }
}

/// Rational numbers with a derivative by one atom.
struct Dual<'a> {
    point: &'a RationalPoint,
    atom: Atom,
}

impl EvaluationDomain for Dual<'_> {
    type Value = (Rational, Rational);
    fn rational(&self, value: &Rational) -> Option<Self::Value> {
        Some((value.clone(), Rational::ZERO))
    }
    fn add(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        (&a.0 + &b.0, &a.1 + &b.1)
    }
    fn mul(&self, a: &Self::Value, b: &Self::Value) -> Self::Value {
        (&a.0 * &b.0, &(&a.1 * &b.0) + &(&a.0 * &b.1))
    }
    fn power(&self, a: &Self::Value, n: i32) -> Option<Self::Value> {
        if a.0.is_zero() {
            return None;
        }
        let slope = &(&Rational::integer(i64::from(n)) * &a.0.pow(n - 1)) * &a.1;
        Some((a.0.pow(n), slope))
    }
    fn unary(&self, function: Unary, a: &Self::Value) -> Option<Self::Value> {
        let value = self.point.unary(function, &a.0)?;
        match function {
            Unary::Sign => Some((value, Rational::ZERO)),
            Unary::Abs => Some((value, &a.1 * &self.point.unary(Unary::Sign, &a.0)?)),
            _ => None,
        }
    }
    fn atom(&self, atom: Atom) -> Option<Self::Value> {
        let slope = if atom == self.atom {
            Rational::ONE
        } else {
            Rational::ZERO
        };
        Some((self.point.atom(atom)?, slope))
    }
    fn cos_sin(&self, angle: &AtomAngleSum) -> Option<(Self::Value, Self::Value)> {
        let (c, s) = self.point.cos_sin(angle)?;
        let n = angle
            .terms()
            .iter()
            .find(|(a, _)| *a == self.atom)
            .map_or(0, |(_, n)| *n);
        let n = Rational::integer(i64::from(n));
        let (dc, ds) = (-&(&n * &s), &n * &c);
        Some(((c, dc), (s, ds)))
    }
}

#[test]
fn multiples_of_a_twelfth_of_pi_have_their_exact_sines() {
    let mut graph = Graph::new();
    for k in -30..30 {
        let (c, s) = graph.cos_sin(&AtomAngleSum::NONE, k);
        let angle = f64::from(k) * std::f64::consts::PI / 12.0;
        let found = EvaluationTape::new(&graph, &[c, s])
            .evaluate(&FloatDomain(|_| f64::NAN))
            .expect("numbers have values");
        assert!(
            (found[0] - angle.cos()).abs() < 1e-14,
            "cos of {k} pi/12 is {}",
            found[0]
        );
        assert!(
            (found[1] - angle.sin()).abs() < 1e-14,
            "sin of {k} pi/12 is {}",
            found[1]
        );
    }
    let (c, s) = graph.cos_sin(&AtomAngleSum::NONE, 6);
    assert_eq!((c, s), (Graph::ZERO, Graph::ONE));
}

#[test]
fn equal_structure_has_equal_ids() {
    let mut graph = Graph::new();
    let [a, b, c] = [0, 1, 2].map(|i| graph.atom(Atom::Parameter(i)));
    let (ab, ba) = (graph.add(a, b), graph.add(b, a));
    assert_eq!(ab, ba);
    let (difference, opposite) = (graph.sub(a, b), graph.sub(b, a));
    assert_eq!(graph.neg(difference), opposite);
    let (left, right) = (graph.mul(difference, c), graph.mul(opposite, c));
    assert_eq!(graph.neg(left), right);
    let sum = graph.sum(&[(ab, Rational::ONE), (b, Rational::MINUS_ONE)]);
    assert_eq!(sum, a, "what cancels is opened");
}
