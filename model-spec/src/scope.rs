//! The names that an expression may use, with their meanings and dimensions.
//!
//! A parsed expression and a scope go in, an [`Exact`] comes out; every unknown name and every clash
//! of units in it is reported.

use std::cell::Cell;
use std::collections::BTreeMap;

use crate::diagnostic::{Diagnostic, Log, Span};
use crate::document::quote;
use crate::exact::{Exact, Function, Symbol};
use crate::finite;
use crate::formula::{Ast, AstKind, Formula};
use crate::suggest;
use crate::unit::Dimension;
use crate::values::check_not_reserved;

/// What sort of thing a name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sort {
    Constant,
    Parameter,
    Coordinate,
    Place,
}

impl Sort {
    fn name(self) -> &'static str {
        match self {
            Self::Constant => "a constant",
            Self::Parameter => "a parameter",
            Self::Coordinate => "a coordinate",
            Self::Place => "a quantity of a place",
        }
    }
}

/// The meaning of a name.
#[derive(Clone, Debug)]
pub(crate) struct Meaning {
    pub(crate) sort: Sort,
    pub(crate) exact: Exact,
    /// Unknown where the unit was faulty; then it fits anything.
    pub(crate) dimension: Option<Dimension>,
    /// The unit as printed.
    pub(crate) unit: String,
    /// The number that the file gives it; only constants have one.
    pub(crate) value: Option<f64>,
    pub(crate) declared: Option<Span>,
    pub(crate) used: Cell<bool>,
}

/// Names and their meanings.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scope {
    names: BTreeMap<String, Meaning>,
}

/// What an expression must be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted<'a> {
    /// Its sorts of names.
    pub(crate) sorts: &'a [Sort],
    /// Its dimension.
    pub(crate) dimension: Dimension,
    /// What it is, for messages: `the mass of a part`.
    pub(crate) what: &'a str,
}

impl Scope {
    /// Adds a name; a second definition is reported and gives false.
    pub(crate) fn declare(&mut self, name: &str, meaning: Meaning, log: &mut Log) -> bool {
        if let (Some(span), Some(first)) = (meaning.declared, self.names.get(name)) {
            let mut diagnostic =
                Diagnostic::error(span, format!("`{}` is defined twice", quote(name)))
                    .label(format!("defined here as {}", meaning.sort.name()))
                    .help(
                        "constants, parameters and coordinates share one set of names; rename one",
                    );
            if let Some(first_span) = first.declared {
                diagnostic = diagnostic.related(
                    first_span,
                    format!("first defined as {}", first.sort.name()),
                );
            }
            log.push(diagnostic);
            return false;
        }
        if let Some(span) = meaning.declared
            && !check_not_reserved(name, span, log)
        {
            return false;
        }
        self.names.insert(name.to_owned(), meaning);
        true
    }

    /// Looks a name up.
    pub(crate) fn get(&self, name: &str) -> Option<&Meaning> {
        self.names.get(name)
    }

    /// All names with their meanings.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&str, &Meaning)> {
        self.names
            .iter()
            .map(|(name, meaning)| (name.as_str(), meaning))
    }

    /// Looks up a name that must be of one of the given sorts, reports it otherwise, and marks it as used.
    pub(crate) fn look_up(
        &self,
        name: &str,
        span: Span,
        sorts: &[Sort],
        log: &mut Log,
    ) -> Option<&Meaning> {
        let allowed = || {
            self.names
                .iter()
                .filter(|(_, meaning)| sorts.contains(&meaning.sort))
                .map(|(name, _)| name.as_str())
        };
        let list = sorts
            .iter()
            .map(|sort| sort.name())
            .collect::<Vec<_>>()
            .join(" or ");
        let Some(meaning) = self.names.get(name) else {
            if !log.is_full() {
                let candidates: Vec<&str> = allowed().collect();
                let removal = log.removal(&["constants", "parameters", "coordinates"], name);
                log.push(
                    Diagnostic::error(span, format!("unknown name `{}`", quote(name)))
                        .label(format!("expected {list}"))
                        .removed_or(removal, || {
                            suggest::advice(name, "names", candidates.iter().copied())
                        }),
                );
            }
            return None;
        };
        meaning.used.set(true);
        if !sorts.contains(&meaning.sort) {
            let diagnostic = Diagnostic::error(
                span,
                format!(
                    "`{name}` is {}, which cannot stand here",
                    meaning.sort.name()
                ),
            )
            .label(format!("expected {list}"));
            log.push(match meaning.declared {
                Some(declared) => diagnostic.related(declared, "defined here"),
                None => diagnostic,
            });
            return None;
        }
        Some(meaning)
    }

    /// Gives an expression its meaning; faults are reported.
    pub(crate) fn resolve(
        &self,
        formula: &Formula,
        wanted: Wanted<'_>,
        log: &mut Log,
    ) -> Option<Exact> {
        let before = log.n_errors();
        let (exact, dimension) = self.walk(&formula.ast, wanted.sorts, log)?;
        self.check_value(&formula.ast, log);
        if let Some(found) = dimension
            && found != wanted.dimension
        {
            log.push(
                Diagnostic::error(
                    formula.ast.span,
                    format!("{} has the wrong unit", wanted.what),
                )
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

    /// Reports an expression without a finite value at the constants of the file.
    fn check_value(&self, ast: &Ast, log: &mut Log) {
        if let Err(fault) = finite::value(ast, &|name| self.value(name)) {
            let declared = match &fault.piece.kind {
                AstKind::Name(name) => self.get(name).and_then(|meaning| meaning.declared),
                _ => None,
            };
            log.push(fault.report(declared));
        }
    }

    /// The meaning and dimension of a subexpression; `None` as a dimension fits any, as bare numbers do.
    pub(crate) fn walk(
        &self,
        ast: &Ast,
        sorts: &[Sort],
        log: &mut Log,
    ) -> Option<(Exact, Option<Dimension>)> {
        match &ast.kind {
            AstKind::Rational(value) => Some((Exact::Rational(value.clone()), None)),
            AstKind::Pi => Some((Exact::Pi, None)),
            AstKind::Name(name) => {
                let meaning = self.look_up(name, ast.span, sorts, log)?;
                Some((meaning.exact.clone(), meaning.dimension))
            }
            AstKind::Sum(terms) => {
                let mut sum = Vec::new();
                let mut dimension: Option<(Dimension, Span)> = None;
                let mut faulty = false;
                for term in terms {
                    let Some((exact, found)) = self.walk(term, sorts, log) else {
                        faulty = true;
                        continue;
                    };
                    sum.push(exact);
                    match (dimension, found) {
                        (None, Some(found)) => dimension = Some((found, term.span)),
                        (Some((first, first_span)), Some(found)) if first != found => {
                            log.push(
                                Diagnostic::error(
                                    term.span,
                                    format!(
                                        "{} and {} cannot be added",
                                        first.describe(),
                                        found.describe()
                                    ),
                                )
                                .label(format!("this is {}", found.describe()))
                                .related(first_span, format!("this is {}", first.describe())),
                            );
                            faulty = true;
                        }
                        _ => {}
                    }
                }
                (!faulty).then(|| (Exact::Sum(sum), dimension.map(|(found, _)| found)))
            }
            AstKind::Product(factors) => {
                let mut product = Vec::new();
                let mut dimension: Option<Dimension> = None;
                let mut faulty = false;
                for factor in factors {
                    let Some((exact, found)) = self.walk(factor, sorts, log) else {
                        faulty = true;
                        continue;
                    };
                    product.push(exact);
                    if let Some(found) = found {
                        dimension = Some(dimension.map_or(found, |before| before.times(found)));
                    }
                }
                (!faulty).then_some((Exact::Product(product), dimension))
            }
            AstKind::Quotient(above, below) => {
                let above = self.walk(above, sorts, log);
                let below = self.walk(below, sorts, log);
                let ((above, upper), (below, lower)) = (above?, below?);
                let dimension = match (upper, lower) {
                    (None, None) => None,
                    (upper, lower) => Some(
                        upper
                            .unwrap_or(Dimension::ONE)
                            .over(lower.unwrap_or(Dimension::ONE)),
                    ),
                };
                Some((Exact::Quotient(Box::new(above), Box::new(below)), dimension))
            }
            AstKind::Negative(inner) => {
                let (exact, dimension) = self.walk(inner, sorts, log)?;
                Some((Exact::Negative(Box::new(exact)), dimension))
            }
            AstKind::Power(base, exponent) => {
                let (exact, dimension) = self.walk(base, sorts, log)?;
                Some((
                    Exact::Power(Box::new(exact), *exponent),
                    dimension.map(|found| found.power(*exponent)),
                ))
            }
            AstKind::Apply(function, inner) => {
                let (exact, dimension) = self.walk(inner, sorts, log)?;
                let dimension = apply(*function, dimension, inner.span, log)?;
                Some((Exact::Apply(*function, Box::new(exact)), dimension))
            }
        }
    }
}

/// The dimension of a function's value; a wrong operand is reported.
#[allow(clippy::option_option)] // Outer: faulty or not; inner: fits any dimension.
fn apply(
    function: Function,
    operand: Option<Dimension>,
    span: Span,
    log: &mut Log,
) -> Option<Option<Dimension>> {
    match (function, operand) {
        (Function::Abs, operand) => Some(operand),
        (Function::Sign, _) => Some(Some(Dimension::ONE)),
        (Function::Sqrt, None) => Some(None),
        (Function::Sqrt, Some(found)) => {
            let root = found.square_root();
            if root.is_none() {
                log.push(
                    Diagnostic::error(span, format!("{} has no square root", found.describe()))
                        .label("expected a square, such as an area"),
                );
            }
            root.map(Some)
        }
        (Function::Sin | Function::Cos | Function::Tanh | Function::Exp, operand) => {
            if let Some(found) = operand
                && found != Dimension::ONE
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
            Some(Some(Dimension::ONE))
        }
    }
}

/// A symbol's meaning.
pub(crate) fn meaning(
    sort: Sort,
    symbol: Symbol,
    dimension: Option<Dimension>,
    unit: &str,
    declared: Option<Span>,
) -> Meaning {
    Meaning {
        sort,
        exact: Exact::Symbol(symbol),
        dimension,
        unit: unit.to_owned(),
        value: None,
        declared,
        used: Cell::new(false),
    }
}
