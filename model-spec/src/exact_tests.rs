//! Expressions: what is printed is read again as the same, and what is read is exact.

use num_bigint::BigInt;
use num_rational::BigRational;
use proptest::prelude::*;

use crate::angle::{angle, length};
use crate::diagnostic::{Log, Span};
use crate::exact::{ConstantIdx, CoordinateIdx, Exact, Function, Symbol};
use crate::formula::Formula;
use crate::parser::parse;
use crate::scope::{Scope, Sort, meaning};
use crate::unit::Dimension;

const WHERE: Span = Span {
    file: 0,
    start: 0,
    end: 0,
};
const NAMES: [&str; 4] = ["a", "b", "c_1", "pitch"];

/// Names of no unit, an angle `alpha`, a turning joint `q` and a sliding one `s`.
fn scope() -> Scope {
    let mut scope = Scope::default();
    let mut log = Log::default();
    for (i, name) in NAMES.iter().enumerate() {
        let symbol = Symbol::Constant(ConstantIdx(i));
        scope.declare(
            name,
            meaning(Sort::Constant, symbol, None, "?", None),
            &mut log,
        );
    }
    let one = Some(Dimension::ONE);
    let angle = Symbol::Constant(ConstantIdx(4));
    scope.declare(
        "alpha",
        meaning(Sort::Constant, angle, one, "rad", None),
        &mut log,
    );
    let turns = Symbol::Coordinate(CoordinateIdx(0));
    scope.declare(
        "q",
        meaning(Sort::Coordinate, turns, one, "rad", None),
        &mut log,
    );
    let slides = Symbol::Coordinate(CoordinateIdx(1));
    let metre = Some(Dimension::LENGTH);
    scope.declare(
        "s",
        meaning(Sort::Coordinate, slides, metre, "m", None),
        &mut log,
    );
    scope
}

fn formula(text: &str) -> Option<Formula> {
    let ast = parse(text, WHERE, None, &mut Log::default())?;
    Some(Formula {
        text: text.to_owned(),
        ast,
    })
}

fn read(text: &str) -> Option<Exact> {
    let sorts = [Sort::Constant, Sort::Coordinate];
    let formula = formula(text)?;
    let (exact, _) = scope().walk(&formula.ast, &sorts, &mut Log::default())?;
    Some(exact)
}

fn name(symbol: Symbol) -> String {
    match symbol {
        Symbol::Constant(ConstantIdx(4)) => "alpha".to_owned(),
        Symbol::Constant(idx) => NAMES[idx.0].to_owned(),
        Symbol::Coordinate(CoordinateIdx(0)) => "q".to_owned(),
        _ => "s".to_owned(),
    }
}

fn rational(above: i64, below: i64) -> BigRational {
    BigRational::new(BigInt::from(above), BigInt::from(below))
}

fn any_exact() -> impl Strategy<Value = Exact> {
    let leaf = prop_oneof![
        (1_i64..200, 1_i64..50, any::<bool>()).prop_map(|(above, below, minus)| {
            Exact::Rational(rational(if minus { -above } else { above }, below))
        }),
        Just(Exact::Pi),
        (0_usize..NAMES.len()).prop_map(|i| Exact::Symbol(Symbol::Constant(ConstantIdx(i)))),
    ];
    leaf.prop_recursive(4, 24, 3, |inner| {
        let functions = prop_oneof![
            Just(Function::Sin),
            Just(Function::Cos),
            Just(Function::Abs),
            Just(Function::Sign),
            Just(Function::Tanh),
        ];
        prop_oneof![
            prop::collection::vec(inner.clone(), 2..4).prop_map(Exact::Sum),
            prop::collection::vec(inner.clone(), 2..4).prop_map(Exact::Product),
            (inner.clone(), inner.clone())
                .prop_map(|(above, below)| Exact::Quotient(Box::new(above), Box::new(below))),
            inner.clone().prop_map(|one| Exact::Negative(Box::new(one))),
            (inner.clone(), -2_i32..=2)
                .prop_map(|(base, power)| Exact::Power(Box::new(base), power)),
            (functions, inner).prop_map(|(function, one)| Exact::Apply(function, Box::new(one))),
        ]
    })
}

proptest! {
    #[test]
    fn printed_text_reads_as_the_same(exact in any_exact()) {
        let text = exact.to_text(&name);
        let first = read(&text).expect("printed text is an expression");
        let value = |symbol: Symbol| match symbol {
            Symbol::Constant(idx) => 0.7 + 0.31 * idx.0 as f64,
            _ => 0.0,
        };
        let (before, after) = (exact.evaluate(&value), first.evaluate(&value));
        // The parser collects numbers, so only rounding may differ.
        if before.is_finite() && before.abs() < 1e6 {
            prop_assert!((before - after).abs() <= 1e-6 * before.abs().max(1.0), "{text}: {before} {after}");
        }
        let again = read(&first.to_text(&name));
        prop_assert_eq!(again, Some(first));
    }

    #[test]
    fn any_text_is_read_or_refused(text in ".{0,60}") {
        let mut log = Log::default();
        let read = parse(&text, WHERE, Some(0), &mut log);
        prop_assert_eq!(read.is_none(), log.n_errors() == 1);
    }

    #[test]
    fn any_formula_like_text_is_read_or_refused(text in "[ab0-9.+*/^()piesq -]{0,40}") {
        let mut log = Log::default();
        let read = parse(&text, WHERE, Some(0), &mut log);
        prop_assert_eq!(read.is_none(), log.n_errors() == 1);
    }
}

#[test]
fn decimals_are_exact() {
    assert_eq!(read("0.316"), Some(Exact::Rational(rational(79, 250))));
    assert_eq!(read("2.5e-3"), Some(Exact::Rational(rational(1, 400))));
    assert_eq!(read("-1/3"), Some(Exact::Rational(rational(-1, 3))));
}

#[test]
fn operators_bind_as_usual() {
    for (text, printed) in [
        ("a-b-c_1", "a - b - c_1"),
        ("a - (b - c_1)", "a - (b - c_1)"),
        ("-a^2", "-a^2"),
        ("(-a)^2", "(-a)^2"),
        ("a/b/c_1", "a/(b*c_1)"),
        ("a/b*c_1", "a*c_1/b"),
        ("a/(b*c_1)", "a/(b*c_1)"),
        ("2*a/4", "1/2*a"),
        ("(a + b)*2", "2*(a + b)"),
        ("a*-b", ""),
        ("a^-1", "a^-1"),
    ] {
        let shown = read(text).map_or(String::new(), |exact| exact.to_text(&name));
        assert_eq!(shown, printed, "{text}");
    }
}

#[test]
fn angles_are_exact() {
    for (text, pi, terms) in [
        ("-pi/2", (-1, 2), 0),
        ("3*pi/2", (-1, 2), 0),
        ("-pi", (1, 1), 0),
        ("2*pi", (0, 1), 0),
        ("pi/12 + q", (1, 12), 1),
        ("q - 2*(q - alpha)", (0, 1), 2),
        ("q - q", (0, 1), 0),
    ] {
        let found = angle(&formula(text).unwrap(), &scope(), &mut Log::default()).unwrap();
        assert_eq!(found.pi, rational(pi.0, pi.1), "{text}");
        assert_eq!(found.terms.len(), terms, "{text}");
    }
    for text in ["pi/5", "1.57", "q/2", "q*alpha", "sin(q)", "17*q", "s"] {
        assert!(
            angle(&formula(text).unwrap(), &scope(), &mut Log::default()).is_none(),
            "{text}"
        );
    }
}

#[test]
fn lengths_are_linear_in_coordinates() {
    let found = length(
        &formula("2*(s - 0.3)/4").unwrap(),
        &scope(),
        "it",
        &mut Log::default(),
    )
    .unwrap();
    assert_eq!(found.coordinates, [(CoordinateIdx(1), rational(1, 2))]);
    assert_eq!(found.offset, Exact::Rational(rational(-3, 20)));
    for text in ["s^2", "s*s", "1/s", "a*s", "q"] {
        assert!(
            length(&formula(text).unwrap(), &scope(), "it", &mut Log::default()).is_none(),
            "{text}"
        );
    }
}

#[test]
fn dimensions_follow_the_formula() {
    let dimension = |text: &str| {
        let formula = formula(text).unwrap();
        scope()
            .walk(&formula.ast, &[Sort::Coordinate], &mut Log::default())
            .map(|(_, dimension)| dimension)
    };
    assert_eq!(dimension("2*s"), Some(Some(Dimension::LENGTH)));
    assert_eq!(dimension("s*s/s"), Some(Some(Dimension::LENGTH)));
    assert_eq!(dimension("sqrt(s^2) + 0.1"), Some(Some(Dimension::LENGTH)));
    assert_eq!(dimension("s + q"), None);
    assert_eq!(dimension("cos(s)"), None);
    assert_eq!(dimension("3"), Some(None));
}
