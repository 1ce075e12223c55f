//! Expressions of a model file before their names are looked up: trees whose every node knows its place.

#[cfg(any(test, feature = "schema"))]
use std::borrow::Cow;

use num_rational::BigRational;

use crate::diagnostic::{Diagnostic, Log, Span};
use crate::document::{Node, Value, quote};
use crate::exact::Function;
use crate::parser::parse;
use crate::record::{Read, wrong_type};

/// Longest text of an expression, in bytes.
pub(crate) const LONGEST_FORMULA: usize = 4000;
/// The functions of the language.
pub(crate) const FUNCTIONS: [(&str, Function); 7] = [
    ("sin", Function::Sin),
    ("cos", Function::Cos),
    ("sqrt", Function::Sqrt),
    ("abs", Function::Abs),
    ("sign", Function::Sign),
    ("tanh", Function::Tanh),
    ("exp", Function::Exp),
];

/// A parsed expression whose names are not yet looked up.
#[derive(Clone, Debug)]
pub(crate) struct Ast {
    pub(crate) span: Span,
    pub(crate) kind: AstKind,
}

/// Shape of a node; see [`crate::Exact`].
#[derive(Clone, Debug)]
pub(crate) enum AstKind {
    Rational(BigRational),
    Pi,
    Name(String),
    Sum(Vec<Ast>),
    Product(Vec<Ast>),
    Quotient(Box<Ast>, Box<Ast>),
    Negative(Box<Ast>),
    Power(Box<Ast>, i32),
    Apply(Function, Box<Ast>),
}

/// An expression of the file with its text.
#[derive(Clone, Debug)]
pub(crate) struct Formula {
    pub(crate) text: String,
    pub(crate) ast: Ast,
}

impl Read for Formula {
    const EXPECTED: &'static str = "an expression in quotes, or a number";
    const EXAMPLE: &'static str = "\"2*d1\"";

    fn read(node: &Node, log: &mut Log) -> Option<Self> {
        let (text, inner) = match &node.value {
            Value::Text { text, inner } => (text, *inner),
            Value::Number { text, .. } => {
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
impl schemars::JsonSchema for Formula {
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
