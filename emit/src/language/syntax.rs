//! The part of printing that languages share, and the trait for the part in which they differ.

use modelmill_codegen::expr::Unary;

use crate::tree::{CodeExpression, OperatorPrecedence};
/// How a language writes names, numbers and functions.
pub(crate) trait LanguageSyntax {
    /// A variable; keywords and special characters are replaced.
    fn name(&self, name: &str) -> String;
    /// A number between operators, with as many digits as give it back.
    fn number(&self, value: f64) -> String {
        format!("{value:?}")
    }
    /// A number that stands alone where a variable is expected; it may need a conversion. A negative one may follow an
    /// operator, and needs parentheses.
    fn standalone_number(&self, value: f64) -> String {
        let number = self.number(value);
        if value.is_sign_negative() {
            format!("({number})")
        } else {
            number
        }
    }
    /// A function of one argument; the text of the argument needs no further parentheses.
    fn call(&self, function: Unary, argument: &str) -> String;
    /// Angle of the point (`x`, `y`) in rad; the text of `y` needs no further parentheses.
    fn atan2(&self, y: &str, x: &str) -> String;

    /// An expression with as few parentheses as possible.
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

    /// An expression where a variable is expected; only a lone number differs.
    fn operand_text(&self, value: &CodeExpression) -> String {
        match value {
            CodeExpression::Number(value) => self.standalone_number(*value),
            value => self.expression_text(value),
        }
    }

    /// An expression that may be an operand of any operator or function.
    fn grouped_text(&self, value: &CodeExpression) -> String {
        parenthesize(self.operand_text(value), value, OperatorPrecedence::Whole)
    }

    /// A binary operation. Two numbers cannot be combined by the operators of Rust's variables, so the left one is
    /// converted.
    fn binary_text(
        &self,
        a: &CodeExpression,
        operator: &str,
        b: &CodeExpression,
        binding: OperatorPrecedence,
    ) -> String {
        // Whether both operands are numbers.
        let both = matches!((a, b), (CodeExpression::Number(_), CodeExpression::Number(_)));
        let left = if both {
            self.operand_text(a)
        } else {
            self.expression_text(a)
        };
        // The right operand needs parentheses already at equal precedence: `a - (b - c)`.
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

/// The text in parentheses if its operator binds less strongly than `binding`.
fn parenthesize(text: String, value: &CodeExpression, binding: OperatorPrecedence) -> String {
    if value.precedence() < binding {
        format!("({text})")
    } else {
        text
    }
}
