//! Expressions: what is printed is read again as the same, and what is read is exact.

use num_bigint::BigInt;
use num_rational::BigRational;
use proptest::prelude::*;

use crate::angle::{angle, length};
use crate::diagnostic::{DiagnosticLog, SourceSpan};
use crate::exact::{ConstantIdx, CoordinateIdx, ExactExpression, ExactFunction, ModelSymbol};
use crate::formula::SourceFormula;
use crate::parser::parse;
use crate::scope::{FormulaScope, SymbolSort, symbol_meaning};
use crate::unit::UnitDimension;

const WHERE: SourceSpan = SourceSpan {
    file: 0,
    start: 0,
    end: 0,
};
const NAMES: [&str; 4] = ["a", "b", "c_1", "pitch"];

/// Names of no unit, an angle `alpha`, a turning joint `q` and a sliding one `s`.
fn scope() -> FormulaScope {
    let mut scope = FormulaScope::default();
    let mut log = DiagnosticLog::default();
    for (i, name) in NAMES.iter().enumerate() {
        let symbol = ModelSymbol::Constant(ConstantIdx(i));
        scope.declare(
            name,
            symbol_meaning(SymbolSort::Constant, symbol, None, "?", None),
            &mut log,
        );
    }
    let one = Some(UnitDimension::ONE);
    let angle = ModelSymbol::Constant(ConstantIdx(4));
    scope.declare(
        "alpha",
        symbol_meaning(SymbolSort::Constant, angle, one, "rad", None),
        &mut log,
    );
    let turns = ModelSymbol::Coordinate(CoordinateIdx(0));
    scope.declare(
        "q",
        symbol_meaning(SymbolSort::Coordinate, turns, one, "rad", None),
        &mut log,
    );
    let slides = ModelSymbol::Coordinate(CoordinateIdx(1));
    let metre = Some(UnitDimension::LENGTH);
    scope.declare(
        "s",
        symbol_meaning(SymbolSort::Coordinate, slides, metre, "m", None),
        &mut log,
    );
    scope
}

fn formula(text: &str) -> Option<SourceFormula> {
    let ast = parse(text, WHERE, None, &mut DiagnosticLog::default())?;
    Some(SourceFormula {
        text: text.to_owned(),
        ast,
    })
}

fn read(text: &str) -> Option<ExactExpression> {
    let sorts = [SymbolSort::Constant, SymbolSort::Coordinate];
    let formula = formula(text)?;
    let (exact, _) = scope().resolve_ast(&formula.ast, &sorts, &mut DiagnosticLog::default())?;
    Some(exact)
}

fn name(symbol: ModelSymbol) -> String {
    match symbol {
        ModelSymbol::Constant(ConstantIdx(4)) => "alpha".to_owned(),
        ModelSymbol::Constant(idx) => NAMES[idx.0].to_owned(),
        ModelSymbol::Coordinate(CoordinateIdx(0)) => "q".to_owned(),
        _ => "s".to_owned(),
    }
}

fn rational(above: i64, below: i64) -> BigRational {
    BigRational::new(BigInt::from(above), BigInt::from(below))
}

fn any_exact() -> impl Strategy<Value = ExactExpression> {
    let leaf = prop_oneof![
        (1_i64..200, 1_i64..50, any::<bool>()).prop_map(|(above, below, minus)| {
            ExactExpression::Rational(rational(if minus { -above } else { above }, below))
        }),
        Just(ExactExpression::Pi),
        (0_usize..NAMES.len()).prop_map(|i| ExactExpression::Symbol(ModelSymbol::Constant(ConstantIdx(i)))),
    ];
    leaf.prop_recursive(4, 24, 3, |inner| {
        let functions = prop_oneof![
            Just(ExactFunction::Sin),
            Just(ExactFunction::Cos),
            Just(ExactFunction::Abs),
            Just(ExactFunction::Sign),
            Just(ExactFunction::Tanh),
        ];
        prop_oneof![
            prop::collection::vec(inner.clone(), 2..4).prop_map(ExactExpression::Sum),
            prop::collection::vec(inner.clone(), 2..4).prop_map(ExactExpression::Product),
            (inner.clone(), inner.clone())
                .prop_map(|(above, below)| ExactExpression::Quotient(Box::new(above), Box::new(below))),
            inner.clone().prop_map(|one| ExactExpression::Negative(Box::new(one))),
            (inner.clone(), -2_i32..=2).prop_map(|(base, power)| ExactExpression::Power(Box::new(base), power)),
            (functions, inner).prop_map(|(function, one)| ExactExpression::Apply(function, Box::new(one))),
        ]
    })
}

proptest! {
    #[test]
    fn printed_text_reads_as_the_same(exact in any_exact()) {
        let text = exact.to_text(&name);
        let first = read(&text).expect("printed text is an expression");
        let value = |symbol: ModelSymbol| match symbol {
            ModelSymbol::Constant(idx) => 0.7 + 0.31 * idx.0 as f64,
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
        let mut log = DiagnosticLog::default();
        let read = parse(&text, WHERE, Some(0), &mut log);
        prop_assert_eq!(read.is_none(), log.n_errors() == 1);
    }

    #[test]
    fn any_formula_like_text_is_read_or_refused(text in "[ab0-9.+*/^()piesq -]{0,40}") {
        let mut log = DiagnosticLog::default();
        let read = parse(&text, WHERE, Some(0), &mut log);
        prop_assert_eq!(read.is_none(), log.n_errors() == 1);
    }
}

#[test]
fn decimals_are_exact() {
    assert_eq!(read("0.316"), Some(ExactExpression::Rational(rational(79, 250))));
    assert_eq!(read("2.5e-3"), Some(ExactExpression::Rational(rational(1, 400))));
    assert_eq!(read("-1/3"), Some(ExactExpression::Rational(rational(-1, 3))));
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
        let found = angle(&formula(text).unwrap(), &scope(), &mut DiagnosticLog::default()).unwrap();
        assert_eq!(found.pi, rational(pi.0, pi.1), "{text}");
        assert_eq!(found.terms.len(), terms, "{text}");
    }
    for text in ["pi/5", "1.57", "q/2", "q*alpha", "sin(q)", "17*q", "s"] {
        assert!(
            angle(&formula(text).unwrap(), &scope(), &mut DiagnosticLog::default()).is_none(),
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
        &mut DiagnosticLog::default(),
    )
    .unwrap();
    assert_eq!(found.coordinates, [(CoordinateIdx(1), rational(1, 2))]);
    assert_eq!(found.offset, ExactExpression::Rational(rational(-3, 20)));
    for text in ["s^2", "s*s", "1/s", "a*s", "q"] {
        assert!(
            length(&formula(text).unwrap(), &scope(), "it", &mut DiagnosticLog::default()).is_none(),
            "{text}"
        );
    }
}

#[test]
fn dimensions_follow_the_formula() {
    let dimension = |text: &str| {
        let formula = formula(text).unwrap();
        scope()
            .resolve_ast(&formula.ast, &[SymbolSort::Coordinate], &mut DiagnosticLog::default())
            .map(|(_, dimension)| dimension)
    };
    assert_eq!(dimension("2*s"), Some(Some(UnitDimension::LENGTH)));
    assert_eq!(dimension("s*s/s"), Some(Some(UnitDimension::LENGTH)));
    assert_eq!(dimension("sqrt(s^2) + 0.1"), Some(Some(UnitDimension::LENGTH)));
    assert_eq!(dimension("s + q"), None);
    assert_eq!(dimension("cos(s)"), None);
    assert_eq!(dimension("3"), Some(None));
}
