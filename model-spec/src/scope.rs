//! The names that an expression may use, with their values and dimensions.
//!
//! A parsed expression and a scope go in, an [`ExactExpression`] comes out. Every unknown name and every sum of
//! different units in it is reported.

use std::cell::Cell;
use std::collections::BTreeMap;

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::quote;
use crate::exact::{ExactExpression, ExactFunction, ModelSymbol};
use crate::finite;
use crate::formula::{FormulaAst, FormulaAstKind, SourceFormula};
use crate::suggest;
use crate::unit::UnitDimension;
use crate::values::check_not_reserved;

/// The sort of quantity that a name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SymbolSort {
    /// A known quantity of the file.
    Constant,
    /// A dynamic parameter.
    Parameter,
    /// A joint coordinate.
    Coordinate,
    /// A quantity of the place of an effect, such as `rate`.
    Place,
}

impl SymbolSort {
    /// The sort, for messages.
    fn name(self) -> &'static str {
        match self {
            Self::Constant => "a constant",
            Self::Parameter => "a parameter",
            Self::Coordinate => "a coordinate",
            Self::Place => "a quantity of a place",
        }
    }
}

/// The quantity that a name stands for.
#[derive(Clone, Debug)]
pub(crate) struct SymbolMeaning {
    /// Its sort, which decides where the name may be used.
    pub(crate) sort: SymbolSort,
    /// The expression that replaces the name.
    pub(crate) exact: ExactExpression,
    /// Dimension; `None` where the unit was faulty, which then fits any other.
    pub(crate) dimension: Option<UnitDimension>,
    /// The unit as the file writes it; may be empty.
    pub(crate) unit: String,
    /// The number that the file gives; only constants have one.
    pub(crate) value: Option<f64>,
    /// Where the file declares it; `None` for names that the program declares.
    pub(crate) declared: Option<SourceSpan>,
    /// Whether an expression used it; a cell, because resolving borrows the scope.
    pub(crate) used: Cell<bool>,
}

/// Names and the quantities that they stand for.
#[derive(Clone, Debug, Default)]
pub(crate) struct FormulaScope {
    /// By name.
    names: BTreeMap<String, SymbolMeaning>,
}

/// What an expression must satisfy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FormulaRequirement<'a> {
    /// Sorts of names that it may use.
    pub(crate) sorts: &'a [SymbolSort],
    /// Dimension that it must have.
    pub(crate) dimension: UnitDimension,
    /// The quantity that it describes, for messages: `the mass of a part`.
    pub(crate) what: &'a str,
}

impl FormulaScope {
    /// Adds a name; a second definition or a reserved word is reported and gives false.
    pub(crate) fn declare(&mut self, name: &str, meaning: SymbolMeaning, log: &mut DiagnosticLog) -> bool {
        // A second definition is reported with the place of the first one.
        if let (Some(span), Some(first)) = (meaning.declared, self.names.get(name)) {
            let mut diagnostic = Diagnostic::error(span, format!("`{}` is defined twice", quote(name)))
                .label(format!("defined here as {}", meaning.sort.name()))
                .help("constants, parameters and coordinates share one set of names; rename one");
            if let Some(first_span) = first.declared {
                diagnostic = diagnostic.related(first_span, format!("first defined as {}", first.sort.name()));
            }
            log.push(diagnostic);
            return false;
        }
        // Names of the program have no place and may be reserved words.
        if let Some(span) = meaning.declared
            && !check_not_reserved(name, span, log)
        {
            return false;
        }
        self.names.insert(name.to_owned(), meaning);
        true
    }

    /// The quantity of a name, without marking it as used.
    pub(crate) fn get(&self, name: &str) -> Option<&SymbolMeaning> {
        self.names.get(name)
    }

    /// All names in alphabetical order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&str, &SymbolMeaning)> {
        self.names.iter().map(|(name, meaning)| (name.as_str(), meaning))
    }

    /// The quantity of a name, which is marked as used. Unknown names and other sorts are reported.
    ///
    /// `sorts` are those that may be used at this place.
    pub(crate) fn look_up(
        &self,
        name: &str,
        span: SourceSpan,
        sorts: &[SymbolSort],
        log: &mut DiagnosticLog,
    ) -> Option<&SymbolMeaning> {
        // Names of the right sorts, for the advice.
        let allowed = || {
            self.names
                .iter()
                .filter(|(_, meaning)| sorts.contains(&meaning.sort))
                .map(|(name, _)| name.as_str())
        };
        // The list of sorts for the label, such as `a constant or a parameter`.
        let list = sorts.iter().map(|sort| sort.name()).collect::<Vec<_>>().join(" or ");
        let Some(meaning) = self.names.get(name) else {
            if !log.is_full() {
                // Candidates are collected only if the finding will be kept: large files with many faults stay fast.
                let candidates: Vec<&str> = allowed().collect();
                let removal = log.removal(&["constants", "parameters", "coordinates"], name);
                log.push(
                    Diagnostic::error(span, format!("unknown name `{}`", quote(name)))
                        .label(format!("expected {list}"))
                        .with_removal_or(removal, || suggest::advice(name, "names", candidates.iter().copied())),
                );
            }
            return None;
        };
        // A wrong use counts as a use, so that the name is not reported as unused, too.
        meaning.used.set(true);
        if !sorts.contains(&meaning.sort) {
            let diagnostic = Diagnostic::error(
                span,
                format!("`{name}` is {}, which cannot stand here", meaning.sort.name()),
            )
            .label(format!("expected {list}"));
            let needs_value = meaning.sort == SymbolSort::Parameter && sorts.contains(&SymbolSort::Constant);
            let advice = format!(
                "geometry and other known quantities are constants: move `{name}` to `[constants]`, with `value` in place of \
                 `nominal`; masses and inertias may contain constants, too"
            );
            let diagnostic = diagnostic.help_if(needs_value.then_some(advice));
            log.push(match meaning.declared {
                Some(declared) => diagnostic.related(declared, "defined here"),
                None => diagnostic,
            });
            return None;
        }
        Some(meaning)
    }

    /// Resolves an expression to exact form; `None` after any error, each of which is reported.
    ///
    /// `wanted` gives the sorts of names, the dimension, and the name of the quantity in messages.
    pub(crate) fn resolve(
        &self,
        formula: &SourceFormula,
        wanted: FormulaRequirement<'_>,
        log: &mut DiagnosticLog,
    ) -> Option<ExactExpression> {
        let before = log.n_errors();
        // First the names, then the value at the constants of the file, then the dimension.
        let (exact, dimension) = self.resolve_ast(&formula.ast, wanted.sorts, log)?;
        self.check_value(&formula.ast, log);
        if let Some(found) = dimension
            && found != wanted.dimension
        {
            log.push(
                Diagnostic::error(formula.ast.span, format!("{} has the wrong unit", wanted.what))
                    .label(format!(
                        "expected {}, found {}",
                        wanted.dimension.describe(),
                        found.describe()
                    ))
                    .help("check the units of the names in it, and whether a factor is missing"),
            );
        }
        (log.n_errors() == before).then_some(exact)
    }

    /// The number that the file gives a name; only constants have one.
    pub(crate) fn value(&self, name: &str) -> Option<f64> {
        self.get(name)?.value
    }

    /// Reports an expression whose value at the constants of the file is not finite.
    ///
    /// Parts with coordinates or parameters have no value and are not reported.
    fn check_value(&self, ast: &FormulaAst, log: &mut DiagnosticLog) {
        if let Err(fault) = finite::value(ast, &|name| self.value(name)) {
            let declared = match &fault.piece.kind {
                FormulaAstKind::Name(name) => self.get(name).and_then(|meaning| meaning.declared),
                _ => None,
            };
            log.push(fault.report(declared));
        }
    }

    /// The exact form and dimension of a subexpression. A dimension of `None` fits any, as that of bare numbers does.
    pub(crate) fn resolve_ast(
        &self,
        ast: &FormulaAst,
        sorts: &[SymbolSort],
        log: &mut DiagnosticLog,
    ) -> Option<(ExactExpression, Option<UnitDimension>)> {
        // Bare numbers fit any dimension.
        match &ast.kind {
            FormulaAstKind::Rational(value) => Some((ExactExpression::Rational(value.clone()), None)),
            FormulaAstKind::Pi => Some((ExactExpression::Pi, None)),
            FormulaAstKind::Name(name) => {
                let meaning = self.look_up(name, ast.span, sorts, log)?;
                Some((meaning.exact.clone(), meaning.dimension))
            }
            // Terms of a sum must have the same dimension.
            FormulaAstKind::Sum(terms) => {
                let mut sum = Vec::new();
                // The first term with a dimension decides; all others must agree with it.
                let mut dimension: Option<(UnitDimension, SourceSpan)> = None;
                let mut faulty = false;
                for term in terms {
                    let Some((exact, found)) = self.resolve_ast(term, sorts, log) else {
                        faulty = true;
                        continue;
                    };
                    sum.push(exact);
                    match (dimension, found) {
                        (None, Some(found)) => dimension = Some((found, term.span)),
                        // Both places are marked: the term, and the first term with a dimension.
                        (Some((first, first_span)), Some(found)) if first != found => {
                            log.push(
                                Diagnostic::error(
                                    term.span,
                                    format!("{} and {} cannot be added", first.describe(), found.describe()),
                                )
                                .label(format!("this is {}", found.describe()))
                                .related(first_span, format!("this is {}", first.describe())),
                            );
                            faulty = true;
                        }
                        _ => {}
                    }
                }
                (!faulty).then(|| (ExactExpression::Sum(sum), dimension.map(|(found, _)| found)))
            }
            FormulaAstKind::Product(factors) => {
                let mut product = Vec::new();
                // Bare numbers in a product do not change its dimension.
                let mut dimension: Option<UnitDimension> = None;
                let mut faulty = false;
                for factor in factors {
                    let Some((exact, found)) = self.resolve_ast(factor, sorts, log) else {
                        faulty = true;
                        continue;
                    };
                    product.push(exact);
                    if let Some(found) = found {
                        dimension = Some(dimension.map_or(found, |before| before.multiplied_by(found)));
                    }
                }
                (!faulty).then_some((ExactExpression::Product(product), dimension))
            }
            // A quotient has the quotient of the dimensions.
            FormulaAstKind::Quotient(above, below) => {
                let above = self.resolve_ast(above, sorts, log);
                let below = self.resolve_ast(below, sorts, log);
                let ((above, upper), (below, lower)) = (above?, below?);
                // A bare number above or below counts as dimensionless once the other side has a dimension.
                let dimension = match (upper, lower) {
                    (None, None) => None,
                    (upper, lower) => Some(
                        upper
                            .unwrap_or(UnitDimension::ONE)
                            .divided_by(lower.unwrap_or(UnitDimension::ONE)),
                    ),
                };
                Some((ExactExpression::Quotient(Box::new(above), Box::new(below)), dimension))
            }
            FormulaAstKind::Negative(inner) => {
                let (exact, dimension) = self.resolve_ast(inner, sorts, log)?;
                Some((ExactExpression::Negative(Box::new(exact)), dimension))
            }
            // An integer power multiplies all exponents of the dimension.
            FormulaAstKind::Power(base, exponent) => {
                let (exact, dimension) = self.resolve_ast(base, sorts, log)?;
                Some((
                    ExactExpression::Power(Box::new(exact), *exponent),
                    dimension.map(|found| found.power(*exponent)),
                ))
            }
            FormulaAstKind::Apply(function, inner) => {
                let (exact, dimension) = self.resolve_ast(inner, sorts, log)?;
                let dimension = function_dimension(*function, dimension, inner.span, log)?;
                Some((ExactExpression::Apply(*function, Box::new(exact)), dimension))
            }
        }
    }
}

/// The dimension of a function's value; an operand that does not fit is reported.
#[allow(clippy::option_option)] // Outer: faulty or not; inner: fits any dimension.
fn function_dimension(
    function: ExactFunction,
    operand: Option<UnitDimension>,
    span: SourceSpan,
    log: &mut DiagnosticLog,
) -> Option<Option<UnitDimension>> {
    match (function, operand) {
        (ExactFunction::Abs, operand) => Some(operand),
        // The sign of any quantity is a pure number.
        (ExactFunction::Sign, _) => Some(Some(UnitDimension::ONE)),
        (ExactFunction::Sqrt, None) => Some(None),
        // The square root halves all exponents of the dimension.
        (ExactFunction::Sqrt, Some(found)) => {
            let root = found.square_root();
            if root.is_none() {
                log.push(
                    Diagnostic::error(span, format!("{} has no square root", found.describe()))
                        .label("expected a square, such as an area"),
                );
            }
            root.map(Some)
        }
        (ExactFunction::Sin | ExactFunction::Cos | ExactFunction::Tanh | ExactFunction::Exp, operand) => {
            // All other functions need a pure number or an angle.
            if let Some(found) = operand
                && found != UnitDimension::ONE
            {
                log.push(
                    Diagnostic::error(
                        span,
                        format!(
                            "`{}` takes a pure number or an angle",
                            crate::print::function_name(function)
                        ),
                    )
                    .label(format!("this is {}", found.describe()))
                    .help("divide by a constant of the same unit"),
                );
                return None;
            }
            Some(Some(UnitDimension::ONE))
        }
    }
}

/// The entry of the scope for a symbol of the model, not used yet and without a value.
pub(crate) fn symbol_meaning(
    sort: SymbolSort,
    symbol: ModelSymbol,
    dimension: Option<UnitDimension>,
    unit: &str,
    declared: Option<SourceSpan>,
) -> SymbolMeaning {
    SymbolMeaning {
        sort,
        exact: ExactExpression::Symbol(symbol),
        dimension,
        unit: unit.to_owned(),
        value: None,
        declared,
        used: Cell::new(false),
    }
}
