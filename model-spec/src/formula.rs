//! Expressions of a model file before their names are looked up: trees whose every node knows its place.

#[cfg(any(test, feature = "schema"))]
use std::borrow::Cow;

use num_rational::BigRational;

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::{TomlNode, TomlValue, quote};
use crate::exact::ExactFunction;
use crate::parser::parse;
use crate::record::{SchemaValue, wrong_type};

/// Longest text of an expression, in bytes.
pub(crate) const LONGEST_FORMULA: usize = 4000;
/// The functions of the language.
pub(crate) const FUNCTIONS: [(&str, ExactFunction); 7] = [
    ("sin", ExactFunction::Sin),
    ("cos", ExactFunction::Cos),
    ("sqrt", ExactFunction::Sqrt),
    ("abs", ExactFunction::Abs),
    ("sign", ExactFunction::Sign),
    ("tanh", ExactFunction::Tanh),
    ("exp", ExactFunction::Exp),
];

/// A parsed expression whose names are not yet looked up.
#[derive(Clone, Debug)]
pub(crate) struct FormulaAst {
    pub(crate) span: SourceSpan,
    pub(crate) kind: FormulaAstKind,
}

/// Shape of a node; see [`crate::ExactExpression`].
#[derive(Clone, Debug)]
pub(crate) enum FormulaAstKind {
    Rational(BigRational),
    Pi,
    Name(String),
    Sum(Vec<FormulaAst>),
    Product(Vec<FormulaAst>),
    Quotient(Box<FormulaAst>, Box<FormulaAst>),
    Negative(Box<FormulaAst>),
    Power(Box<FormulaAst>, i32),
    Apply(ExactFunction, Box<FormulaAst>),
}

/// An expression of the file with its text.
#[derive(Clone, Debug)]
pub(crate) struct SourceFormula {
    pub(crate) text: String,
    pub(crate) ast: FormulaAst,
}

impl SchemaValue for SourceFormula {
    const EXPECTED: &'static str = "an expression in quotes, or a number";
    const EXAMPLE: &'static str = "\"2*d1\"";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let (text, inner) = match &node.value {
            TomlValue::Text { text, inner } => (text, *inner),
            TomlValue::Number { text, .. } => {
                if text.parse::<f64>().is_ok_and(|value| !value.is_finite()) {
                    log.push(
                        Diagnostic::error(node.span, format!("`{}` is not finite", quote(text)))
                            .label("expected a finite number"),
                    );
                    return None;
                }
                // The number as written may hold `_`; only an untouched one can be marked digit by digit.
                let same = text.len() == node.span.end - node.span.start;
                (text, same.then_some(node.span.start))
            }
            _ => return wrong_type::<Self>(node, log),
        };
        let ast = parse(text, node.span, inner, log)?;
        Some(Self {
            text: text.clone(),
            ast,
        })
    }
}

#[cfg(any(test, feature = "schema"))]
impl schemars::JsonSchema for SourceFormula {
    fn schema_name() -> Cow<'static, str> {
        "Expression".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "An exact expression such as \"2*r3 + d4\", \"-pi/2\" or 0.316: names, decimals, pi, + - * / ^ ( ), and the functions sin cos sqrt abs sign tanh exp.",
            "type": ["string", "number"],
            "maxLength": LONGEST_FORMULA,
        })
    }
}
