//! What languages differ in when they print expressions and statements, and what they share.

use modelmill_codegen::expr::Unary;

use crate::tree::{CodeExpression, OperatorPrecedence};
/// How a language writes what stands in statements.
pub(crate) trait LanguageSyntax {
    /// A variable.
    fn name(&self, name: &str) -> String;
    /// A number between operators.
    fn number(&self, value: f64) -> String;
    /// A number that stands by itself where a variable is expected.
    fn standalone_number(&self, value: f64) -> String;
    /// A function of one argument; the argument holds together.
    fn call(&self, function: Unary, argument: &str) -> String;
    /// Angle of the point (`x`, `y`); `y` holds together.
    fn atan2(&self, y: &str, x: &str) -> String;

    /// An expression, with parentheses where they are needed.
    fn expression_text(&self, value: &CodeExpression) -> String {
        match value {
            CodeExpression::Number(value) => self.number(*value),
            CodeExpression::Name(name) => self.name(name),
            CodeExpression::Add(a, b) => self.binary_text(a, "+", b, OperatorPrecedence::Sum),
            CodeExpression::Sub(a, b) => self.binary_text(a, "-", b, OperatorPrecedence::Sum),
            CodeExpression::Mul(a, b) => self.binary_text(a, "*", b, OperatorPrecedence::Product),
            CodeExpression::Div(a, b) => self.binary_text(a, "/", b, OperatorPrecedence::Product),
            CodeExpression::Neg(a) => format!("-{}", self.grouped_text(a)),
            CodeExpression::Call(function, a) => self.call(*function, &self.grouped_text(a)),
            CodeExpression::Atan2(y, x) => self.atan2(&self.grouped_text(y), &self.operand_text(x)),
        }
    }

    /// An expression where a variable is expected.
    fn operand_text(&self, value: &CodeExpression) -> String {
        match value {
            CodeExpression::Number(value) => self.standalone_number(*value),
            value => self.expression_text(value),
        }
    }

    /// A term that holds together.
    fn grouped_text(&self, value: &CodeExpression) -> String {
        parenthesize(self.operand_text(value), value, OperatorPrecedence::Whole)
    }

    /// One operator on two operands; numbers may stand on one side only.
    fn binary_text(
        &self,
        a: &CodeExpression,
        operator: &str,
        b: &CodeExpression,
        binding: OperatorPrecedence,
    ) -> String {
        let both = matches!(
            (a, b),
            (CodeExpression::Number(_), CodeExpression::Number(_))
        );
        let left = if both {
            self.operand_text(a)
        } else {
            self.expression_text(a)
        };
        let next = match binding {
            OperatorPrecedence::Sum => OperatorPrecedence::Product,
            _ => OperatorPrecedence::Negation,
        };
        let (left, right) = (
            parenthesize(left, a, binding),
            parenthesize(self.expression_text(b), b, next),
        );
        format!("{left} {operator} {right}")
    }
}

/// Text in parentheses if it does not hold together as tightly as asked.
fn parenthesize(text: String, value: &CodeExpression, binding: OperatorPrecedence) -> String {
    if value.precedence() < binding {
        format!("({text})")
    } else {
        text
    }
}
