//! Printed text read again has the value of what was printed; LaTeX and MathML are balanced.

use std::collections::BTreeMap;

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use proptest::prelude::*;

use super::parse::parse;
use super::{FormulaFunction, FormulaSymbol, PrintedFormula, atom, formula};
use crate::expr::{Atom, AtomAngleSum, EvaluationTape, ExprId, FieldPoint, Graph, Rational, Unary};

/// How to build an expression.
#[derive(Clone, Debug)]
enum Recipe {
    Number(i64, i64),
    Atom(Atom),
    Sin(Vec<(usize, i32)>),
    Cos(Vec<(usize, i32)>),
    Sum(Vec<(Recipe, i64)>),
    Product(Vec<(Recipe, i32)>),
    Unary(Unary, Box<Recipe>),
}

impl Recipe {
    fn build(&self, graph: &mut Graph) -> ExprId {
        let angle = |terms: &[(usize, i32)]| AtomAngleSum::new(terms.iter().map(|(i, n)| (Atom::Coordinate(*i), *n)));
        match self {
            Self::Number(n, d) => graph.rational(Rational::new(*n, *d)),
            Self::Atom(a) => graph.atom(*a),
            Self::Sin(terms) => graph.cos_sin(&angle(terms), 0).1,
            Self::Cos(terms) => graph.cos_sin(&angle(terms), 0).0,
            Self::Sum(terms) => {
                let terms: Vec<_> = terms
                    .iter()
                    .map(|(r, k)| (r.build(graph), Rational::new(*k, 2)))
                    .collect();
                graph.sum(&terms)
            }
            Self::Product(factors) => {
                let factors: Vec<_> = factors
                    .iter()
                    .map(|(r, n)| {
                        let id = r.build(graph);
                        // Nothing is divided by zero.
                        (id, if id == Graph::ZERO { n.abs() } else { *n })
                    })
                    .collect();
                graph.product(&factors)
            }
            Self::Unary(function, inner) => {
                let inner = inner.build(graph);
                graph.unary(*function, inner)
            }
        }
    }
}

fn recipe() -> impl Strategy<Value = Recipe> {
    let atoms = prop_oneof![
        (0..7usize).prop_map(Atom::Constant),
        (0..8usize).prop_map(Atom::Parameter),
        (0..4usize).prop_map(Atom::Rate),
        (0..4usize).prop_map(Atom::Acceleration),
        (0..2usize).prop_map(Atom::Load),
        (0..3usize).prop_map(Atom::Base),
    ];
    let angle = || prop::collection::vec((0..4usize, -2..3i32), 1..3);
    let leaf = prop_oneof![
        (-9..10i64, 1..5i64).prop_map(|(n, d)| Recipe::Number(n, d)),
        atoms.prop_map(Recipe::Atom),
        angle().prop_map(Recipe::Sin),
        angle().prop_map(Recipe::Cos),
    ];
    leaf.prop_recursive(4, 40, 4, |inner| {
        let function = prop_oneof![
            Just(Unary::Sqrt),
            Just(Unary::Sign),
            Just(Unary::Abs),
            Just(Unary::Tanh),
            Just(Unary::Exp)
        ];
        prop_oneof![
            prop::collection::vec((inner.clone(), -4..5i64), 1..5).prop_map(Recipe::Sum),
            prop::collection::vec((inner.clone(), -2..4i32), 1..4).prop_map(Recipe::Product),
            (function, inner).prop_map(|(f, r)| Recipe::Unary(f, Box::new(r))),
        ]
    })
}

fn spidermill() -> Mechanism {
    crate::review::tests::model("spidermill-paper")
}

/// All names with the atoms that they stand for, and a random point of the field.
fn point(mechanism: &Mechanism) -> (BTreeMap<String, Atom>, FieldPoint) {
    let mut atoms: Vec<Atom> = (0..mechanism.constants.len()).map(Atom::Constant).collect();
    atoms.extend((0..mechanism.parameters.len()).map(Atom::Parameter));
    for i in 0..mechanism.coordinates.len() {
        atoms.extend([Atom::Coordinate(i), Atom::Rate(i), Atom::Acceleration(i)]);
    }
    atoms.extend((0..mechanism.drives.len()).map(Atom::Load));
    atoms.extend((0..3).map(Atom::Base));
    let mut stream = RandomStream::new(7);
    let mut at = FieldPoint::default();
    for a in &atoms {
        at.values.insert(*a, stream.next_element());
        at.angles.insert(*a, stream.next_circle_point());
    }
    let names = atoms.into_iter().map(|a| (atom(mechanism, a).text(), a)).collect();
    (names, at)
}

/// Whether braces, `\left` and `\right` pair up.
pub(crate) fn latex_is_balanced(latex: &str) -> bool {
    let mut depth = 0;
    for c in latex.chars() {
        depth += match c {
            '{' => 1,
            '}' => -1,
            _ => 0,
        };
        if depth < 0 {
            return false;
        }
    }
    depth == 0 && latex.matches("\\left").count() == latex.matches("\\right").count()
}

/// Whether every element that opens closes, in order.
pub(crate) fn markup_is_balanced(markup: &str) -> bool {
    let mut open = Vec::new();
    for tag in markup.split('<').skip(1) {
        let Some((tag, _)) = tag.split_once('>') else {
            return false;
        };
        let name = tag.split([' ', '/']).next().unwrap_or_default();
        match tag.strip_prefix('/') {
            Some(closed) => {
                if open.pop() != Some(closed) {
                    return false;
                }
            }
            None if tag.ends_with('/') || tag.starts_with('!') || ["meta", "link", "br"].contains(&name) => {}
            None => open.push(name),
        }
    }
    open.is_empty()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]
    #[test]
    fn printed_text_read_again_has_the_same_value(recipe in recipe()) {
        let mechanism = spidermill();
        let mut graph = Graph::new();
        let id = recipe.build(&mut graph);
        let printed = formula(&graph, &mechanism, id);
        let (names, at) = point(&mechanism);
        let text = printed.text();
        if let Some(value) = EvaluationTape::new(&graph, &[id]).evaluate(&at) {
            prop_assert_eq!(parse(&text).value(&at, &names), Some(value[0]), "{}", text);
        }
        prop_assert!(!text.contains("+ -") && !text.contains("- -"), "{}", text);
        prop_assert!(!text.contains("-1*"), "{}", text);
        let latex = printed.latex();
        prop_assert!(latex_is_balanced(&latex), "{}", latex);
        let mathml = printed.mathml();
        prop_assert!(markup_is_balanced(&mathml), "{}", mathml);
        // In segments the text is the same; only parts that were too wide are written with other signs.
        let segments = printed.mathml_segments();
        for segment in &segments {
            prop_assert!(markup_is_balanced(segment), "{}", segment);
        }
        prop_assert_eq!(words(&segments.concat()), words(&mathml), "{}", text);
    }
}

/// The visible text of markup, without the signs of fractions and roots on the line.
fn words(markup: &str) -> String {
    let mut shown: String = markup
        .split('<')
        .filter_map(|piece| piece.split_once('>'))
        .map(|(_, text)| text)
        .collect();
    for sign in ["(", ")", "/", "&#x221A;"] {
        shown = shown.replace(sign, "");
    }
    shown
}

#[test]
fn long_formulas_can_be_parted_within_parentheses_fractions_and_roots() {
    let sum = |letter: &str| {
        let terms =
            (1..9).map(|k| PrintedFormula::product(Rational::integer(1), [name(&format!("{letter}{k}")), name("d1")]));
        PrintedFormula::sum(terms)
    };
    let quotient = PrintedFormula::quotient(sum("m"), sum("k"));
    let root = PrintedFormula::apply(FormulaFunction::Sqrt, sum("x"));
    let all = PrintedFormula::product(Rational::integer(3), [sum("a"), root, quotient]);
    let segments = all.mathml_segments();
    assert!(segments.len() >= 4 * 7, "{}", segments.len());
    for segment in &segments {
        assert!(markup_is_balanced(segment), "{segment}");
        assert!(words(segment).chars().count() < 40, "{segment}");
    }
}

fn name(name: &str) -> PrintedFormula {
    PrintedFormula::name(name)
}

fn check(formula: &PrintedFormula, text: &str, latex: &str) {
    assert_eq!(formula.text(), text);
    assert_eq!(formula.latex(), latex);
}

#[test]
fn names_are_typeset_as_engineers_write_them() {
    for (plain, latex) in [
        ("theta1", "\\theta_{1}"),
        ("dc1", "d_{c1}"),
        ("Ic12", "I_{c12}"),
        ("g", "g"),
        ("Bx", "B_{x}"),
        ("ZZ1", "\\mathrm{ZZ}_{1}"),
        ("MX_d1", "\\mathrm{MX}_{d1}"),
        ("p1_min", "p_{1,\\mathrm{min}}"),
        ("omega_S3_z", "\\omega_{S3,z}"),
        ("s_theta1", "s_{\\theta 1}"),
        ("offset", "\\mathrm{offset}"),
        ("off", "\\mathrm{off}"),
        ("rod2", "\\mathrm{rod}_{2}"),
        ("len_a", "\\mathrm{len}_{a}"),
        ("Fvp", "F_{vp}"),
    ] {
        assert_eq!(FormulaSymbol::new(plain).latex(), latex, "{plain}");
    }
    assert_eq!(FormulaSymbol::time_derivative("theta1", 2).text(), "theta1_dd");
    assert_eq!(
        FormulaSymbol::time_derivative("theta1", 2).latex(),
        "\\ddot{\\theta}_{1}"
    );
}

#[test]
fn signs_fractions_and_powers_are_tidy() {
    let half = Rational::new(1, 2);
    let term = PrintedFormula::term(half.clone(), [name("d1"), name("m4"), name("dc3")], [name("d3")]);
    check(
        &PrintedFormula::sum([name("m3").negate(), term]),
        "1/2*d1*m4*dc3/d3 - m3",
        "\\frac{d_{1} \\, m_{4} \\, d_{c3}}{2 \\, d_{3}} - m_{3}",
    );
    let sum = PrintedFormula::sum([name("a"), name("b").negate()]);
    check(
        &PrintedFormula::product(Rational::integer(-2), [sum.clone(), name("c")]),
        "-2*(a - b)*c",
        "-2 \\, \\left(a - b\\right) \\, c",
    );
    check(&sum.clone().negate(), "b - a", "b - a");
    check(
        &PrintedFormula::term(half, [], [name("x").power(2)]),
        "1/(2*x^2)",
        "\\frac{1}{2 \\, x^{2}}",
    );
    check(
        &PrintedFormula::apply(FormulaFunction::Sin, name("q1")).power(2),
        "sin(q1)^2",
        "\\sin^{2}{q_{1}}",
    );
    check(
        &PrintedFormula::quotient(name("a"), sum).power(-1),
        "(a - b)/a",
        "\\frac{a - b}{a}",
    );
}
