//! Expressions of a model file before their names are resolved: trees in which every node has its place.
//!
//! Text of the file goes in; the scope turns the tree into an exact expression.

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
/// The functions of the expression language, by their names.
pub(crate) const FUNCTIONS: [(&str, ExactFunction); 7] = [
    ("sin", ExactFunction::Sin),
    ("cos", ExactFunction::Cos),
    ("sqrt", ExactFunction::Sqrt),
    ("abs", ExactFunction::Abs),
    ("sign", ExactFunction::Sign),
    ("tanh", ExactFunction::Tanh),
    ("exp", ExactFunction::Exp),
];

/// A parsed expression whose names are not resolved yet.
#[derive(Clone, Debug)]
pub(crate) struct FormulaAst {
    /// Where the node stands.
    pub(crate) span: SourceSpan,
    /// Its shape with its operands.
    pub(crate) kind: FormulaAstKind,
}

/// Shape of a node; see [`crate::ExactExpression`].
#[derive(Clone, Debug)]
pub(crate) enum FormulaAstKind {
    /// A number, exact.
    Rational(BigRational),
    /// The number pi.
    Pi,
    /// A name that is not resolved yet.
    Name(String),
    /// Sum of at least two terms.
    Sum(Vec<FormulaAst>),
    /// Product of factors.
    Product(Vec<FormulaAst>),
    /// First operand over the second.
    Quotient(Box<FormulaAst>, Box<FormulaAst>),
    /// The operand with the opposite sign.
    Negative(Box<FormulaAst>),
    /// Integer power.
    Power(Box<FormulaAst>, i32),
    /// A function of its operand.
    Apply(ExactFunction, Box<FormulaAst>),
}

/// An expression of the file with its text.
#[derive(Clone, Debug)]
pub(crate) struct SourceFormula {
    /// The text as the author wrote it.
    pub(crate) text: String,
    /// The parsed tree.
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
                // A number in the file may contain `_`. Only without them the parts of the number have known places.
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
