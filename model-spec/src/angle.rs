//! Angles and lengths of joints: expressions of the special shapes that symbolic derivation needs.
//!
//! An angle is an integer combination of angle symbols plus a multiple of pi/12. A length is linear in prismatic
//! coordinates. Any other shape is reported together with the expected one.

use std::collections::BTreeMap;

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive, Zero};

use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::{ExactAngle, ExactExpression, ExactLength, ModelSymbol};
use crate::formula::{FormulaAst, FormulaAstKind, SourceFormula};
use crate::scope::{FormulaRequirement, FormulaScope, SymbolSort};
use crate::unit::UnitDimension;

/// Largest integer factor of an angle's symbol.
const LARGEST_FACTOR: i32 = 16;
/// Sorts of names that angles and lengths may use.
const SYMBOLS: [SymbolSort; 2] = [SymbolSort::Constant, SymbolSort::Coordinate];

/// Reads an angle over constants with unit rad and coordinates.
///
/// `None` after a fault: an unknown name, a constant that is not an angle, or another shape.
pub(crate) fn angle(formula: &SourceFormula, scope: &FormulaScope, log: &mut DiagnosticLog) -> Option<ExactAngle> {
    let before = log.n_errors();
    let wanted = FormulaRequirement {
        sorts: &SYMBOLS,
        dimension: UnitDimension::ONE,
        what: "this angle",
    };
    // Unknown names and wrong units are reported first; after that only the shape can be at fault.
    check_angle_symbols(&formula.ast, scope, log);
    if log.n_errors() > before {
        // Constants that are not angles are reported by now; unknown names are added.
        let mut rest = DiagnosticLog::default();
        if scope.resolve_ast(&formula.ast, &SYMBOLS, &mut rest).is_none() {
            for found in rest.finish() {
                log.push(found);
            }
        }
        return None;
    }
    // Dimensions and values of the complete expression.
    scope.resolve(formula, wanted, log)?;
    // The shape: a multiple of pi, and a factor for each symbol.
    let mut sum = ExactAngleSum::default();
    collect_angle(&formula.ast, &BigRational::one(), scope, &mut sum, log)?;
    let twelve = BigRational::from_integer(BigInt::from(12));
    // Only these angles have sines and cosines with square roots of 2 and 3.
    if !(&sum.pi * &twelve).is_integer() {
        log.push(
            Diagnostic::error(
                formula.ast.span,
                "the fixed part of this angle is not a multiple of pi/12",
            )
            .label("expected for example `pi/2`, `-pi/6` or `5*pi/12`")
            .help("declare any other angle as a constant with unit `rad` and use its name"),
        );
        return None;
    }
    // Full turns are dropped, so that equal angles are equal as values: pi is in (-1, 1].
    let two = BigRational::from_integer(BigInt::from(2));
    let turns = (&sum.pi / &two).round();
    let mut pi = sum.pi - turns * &two;
    // Minus half a turn equals half a turn.
    if pi == -BigRational::one() {
        pi = BigRational::one();
    }
    // Factors must be integers, so that sines of multiple angles expand into powers.
    let mut terms = Vec::new();
    for (symbol, factor) in sum.terms {
        // A factor that cancels to zero drops its symbol.
        let whole = factor.is_integer().then(|| factor.to_i32()).flatten();
        match whole {
            Some(0) => {}
            Some(factor) if factor.abs() <= LARGEST_FACTOR => terms.push((symbol, factor)),
            _ => {
                log.push(
                    Diagnostic::error(
                        formula.ast.span,
                        "this angle has a factor that is not a small integer",
                    )
                    .label(format!(
                        "expected integer multiples, at most {LARGEST_FACTOR}, of angles"
                    ))
                    .help(format!(
                        "for half angles, declare the half as the coordinate and write the full angle as twice that; for the \
                         ratio of a gear, declare a coordinate that follows, such as `geared = {{ follows = \"{}\" }}`, and \
                         write `geared` here",
                        formula.text
                    )),
                );
                return None;
            }
        }
    }
    Some(ExactAngle { pi, terms })
}

/// Reports constants that are pure numbers or lengths in an angle.
fn check_angle_symbols(ast: &FormulaAst, scope: &FormulaScope, log: &mut DiagnosticLog) {
    match &ast.kind {
        FormulaAstKind::Name(name) => {
            if let Some(meaning) = scope.get(name)
                && meaning.sort == SymbolSort::Constant
                && meaning.unit != "rad"
                && meaning.dimension.is_some()
            {
                // Marked as used, so that it is not reported a second time as unused.
                meaning.used.set(true);
                let diagnostic = Diagnostic::error(ast.span, format!("`{name}` is not an angle"))
                    .label(format!("its unit is `{}`, expected `rad`", meaning.unit));
                log.push(match meaning.declared {
                    Some(declared) => diagnostic.related(declared, "defined here"),
                    None => diagnostic,
                });
            }
        }
        // All operands are checked, so that each wrong constant is reported.
        FormulaAstKind::Sum(inner) | FormulaAstKind::Product(inner) => {
            for one in inner {
                check_angle_symbols(one, scope, log);
            }
        }
        FormulaAstKind::Quotient(above, below) => {
            check_angle_symbols(above, scope, log);
            check_angle_symbols(below, scope, log);
        }
        FormulaAstKind::Negative(inner) | FormulaAstKind::Power(inner, _) | FormulaAstKind::Apply(_, inner) => {
            check_angle_symbols(inner, scope, log);
        }
        FormulaAstKind::Rational(_) | FormulaAstKind::Pi => {}
    }
}

/// An angle while its terms are collected.
#[derive(Default)]
struct ExactAngleSum {
    /// Coefficient of pi.
    pi: BigRational,
    /// Factor of each symbol.
    terms: BTreeMap<ModelSymbol, BigRational>,
}

/// Adds `factor` times an expression to `sum`; `None` after a fault, which is reported.
///
/// `factor` is the product of the numbers and signs on the path to this node.
fn collect_angle(
    ast: &FormulaAst,
    factor: &BigRational,
    scope: &FormulaScope,
    sum: &mut ExactAngleSum,
    log: &mut DiagnosticLog,
) -> Option<()> {
    match &ast.kind {
        FormulaAstKind::Rational(value) if value.is_zero() => Some(()),
        // A bare number could be degrees, so only multiples of pi are accepted.
        FormulaAstKind::Rational(_) => {
            log.push(
                Diagnostic::error(ast.span, "an angle cannot be a bare number")
                    .label("expected a multiple of `pi`, such as `pi/2`")
                    .help("declare any other angle as a constant with unit `rad` and use its name"),
            );
            None
        }
        FormulaAstKind::Pi => {
            sum.pi += factor;
            Some(())
        }
        // Each use of a symbol adds to its factor.
        FormulaAstKind::Name(name) => {
            let meaning = scope.get(name)?;
            let ExactExpression::Symbol(symbol) = meaning.exact else {
                return None;
            };
            *sum.terms.entry(symbol).or_default() += factor;
            Some(())
        }
        FormulaAstKind::Sum(terms) => {
            let mut fine = true;
            for term in terms {
                fine &= collect_angle(term, factor, scope, sum, log).is_some();
            }
            fine.then_some(())
        }
        FormulaAstKind::Negative(inner) => collect_angle(inner, &-factor, scope, sum, log),
        // Numbers in a product join the factor; exactly one other member may remain.
        FormulaAstKind::Product(factors) => {
            let (numbers, rest): (Vec<&FormulaAst>, Vec<&FormulaAst>) = factors
                .iter()
                .partition(|one| matches!(one.kind, FormulaAstKind::Rational(_)));
            let mut scaled = factor.clone();
            for number in numbers {
                if let FormulaAstKind::Rational(value) = &number.kind {
                    scaled *= value;
                }
            }
            match rest.as_slice() {
                [only] => collect_angle(only, &scaled, scope, sum, log),
                _ => report_angle_shape(ast, log),
            }
        }
        _ => report_angle_shape(ast, log),
    }
}

/// Reports a shape that an angle cannot have.
fn report_angle_shape(ast: &FormulaAst, log: &mut DiagnosticLog) -> Option<()> {
    log.push(
        Diagnostic::error(ast.span, "an angle cannot be computed like this")
            .label("expected a sum of integer multiples of angles and of `pi/12`")
            .help("for example `theta1 - 2*gamma + pi/2`"),
    );
    None
}

/// Reads a length that is linear in coordinates, with rational factors; `what` names it in messages.
///
/// `None` after a fault, which is reported.
pub(crate) fn length(
    formula: &SourceFormula,
    scope: &FormulaScope,
    what: &str,
    log: &mut DiagnosticLog,
) -> Option<ExactLength> {
    let wanted = FormulaRequirement {
        sorts: &SYMBOLS,
        dimension: UnitDimension::LENGTH,
        what,
    };
    let exact = scope.resolve(formula, wanted, log)?;
    let mut offset = Vec::new();
    let mut coordinates: BTreeMap<_, BigRational> = BTreeMap::new();
    // The offset is a list of terms here, and one expression below.
    if !split_length(&exact, &BigRational::one(), &mut offset, &mut coordinates) {
        log.push(
            Diagnostic::error(formula.ast.span, "a joint's length must be linear in its coordinates")
                .label("expected for example `q3`, or `d3 + 2*q3`")
                .help(format!(
                    "for a constant times an angle, as of a screw, declare a coordinate that follows, such as \
                     `travel = {{ follows = \"{}\" }}`, and write `travel` here",
                    formula.text
                )),
        );
        return None;
    }
    // Coordinates that cancel are dropped.
    coordinates.retain(|_, factor| !factor.is_zero());
    let offset = match offset.len() {
        0 => ExactExpression::zero(),
        1 => offset.swap_remove(0),
        _ => ExactExpression::Sum(offset),
    };
    Some(ExactLength {
        offset,
        coordinates: coordinates.into_iter().collect(),
    })
}

/// Splits `factor * exact` into terms without coordinates and factors of coordinates; false if it is not linear.
fn split_length(
    exact: &ExactExpression,
    factor: &BigRational,
    offset: &mut Vec<ExactExpression>,
    coordinates: &mut BTreeMap<crate::CoordinateIdx, BigRational>,
) -> bool {
    // Parts without coordinates belong to the offset.
    if !exact.mentions(&|symbol| matches!(symbol, ModelSymbol::Coordinate(_))) {
        if !exact.is_zero() {
            offset.push(scale_exact(exact, factor));
        }
        return true;
    }
    match exact {
        // A coordinate by itself: the accumulated factor belongs to it.
        ExactExpression::Symbol(ModelSymbol::Coordinate(coordinate)) => {
            *coordinates.entry(*coordinate).or_default() += factor;
            true
        }
        ExactExpression::Sum(terms) => terms.iter().all(|term| split_length(term, factor, offset, coordinates)),
        ExactExpression::Negative(inner) => split_length(inner, &-factor, offset, coordinates),
        // Rational members join the factor; at most one other member may remain.
        ExactExpression::Product(factors) => {
            let mut scale = factor.clone();
            let mut rest = None;
            for one in factors {
                match one {
                    ExactExpression::Rational(value) => scale *= value,
                    _ if rest.is_none() => rest = Some(one),
                    _ => return false,
                }
            }
            rest.is_none_or(|one| split_length(one, &scale, offset, coordinates))
        }
        _ => false,
    }
}

/// A rational multiple of an expression, without factors of one or minus one.
fn scale_exact(exact: &ExactExpression, factor: &BigRational) -> ExactExpression {
    if factor.is_one() {
        return exact.clone();
    }
    match exact {
        ExactExpression::Rational(value) => ExactExpression::Rational(value * factor),
        _ if (-factor).is_one() => ExactExpression::Negative(Box::new(exact.clone())),
        _ if factor.is_negative() => ExactExpression::Negative(Box::new(scale_exact(exact, &-factor))),
        _ => ExactExpression::Product(vec![ExactExpression::Rational(factor.clone()), exact.clone()]),
    }
}

/// The value of an expression of numbers only, as a rational; `None` if it contains anything else or divides by zero.
pub(crate) fn rational_value(ast: &FormulaAst) -> Option<BigRational> {
    match &ast.kind {
        FormulaAstKind::Rational(value) => Some(value.clone()),
        FormulaAstKind::Sum(terms) => terms.iter().map(rational_value).sum(),
        FormulaAstKind::Product(factors) => factors.iter().map(rational_value).product(),
        FormulaAstKind::Negative(inner) => rational_value(inner).map(|value| -value),
        FormulaAstKind::Quotient(above, below) => {
            let (above, below) = (rational_value(above)?, rational_value(below)?);
            (!below.is_zero()).then(|| above / below)
        }
        FormulaAstKind::Power(base, exponent) => {
            let base = rational_value(base)?;
            (*exponent >= 0 || !base.is_zero()).then(|| num_traits::Pow::pow(base, *exponent))
        }
        FormulaAstKind::Pi | FormulaAstKind::Name(_) | FormulaAstKind::Apply(..) => None,
    }
}
