//! What languages differ in when they print expressions and statements, and what they share.

use modelmill_codegen::expr::Unary;

use crate::tree::{Binding, Expression};

/// How a language writes what stands in statements.
pub(crate) trait Syntax {
    /// A variable.
    fn name(&self, name: &str) -> String;
    /// A number between operators.
    fn number(&self, value: f64) -> String;
    /// A number that stands by itself where a variable is expected.
    fn alone(&self, value: f64) -> String;
    /// A function of one argument; the argument holds together.
    fn call(&self, function: Unary, argument: &str) -> String;
    /// Angle of the point (`x`, `y`); `y` holds together.
    fn atan2(&self, y: &str, x: &str) -> String;

    /// An expression, with parentheses where they are needed.
    fn expression(&self, value: &Expression) -> String {
        match value {
            Expression::Number(value) => self.number(*value),
            Expression::Name(name) => self.name(name),
            Expression::Add(a, b) => self.binary(a, "+", b, Binding::Sum),
            Expression::Sub(a, b) => self.binary(a, "-", b, Binding::Sum),
            Expression::Mul(a, b) => self.binary(a, "*", b, Binding::Product),
            Expression::Div(a, b) => self.binary(a, "/", b, Binding::Product),
            Expression::Neg(a) => format!("-{}", self.whole(a)),
            Expression::Call(function, a) => self.call(*function, &self.whole(a)),
            Expression::Atan2(y, x) => self.atan2(&self.whole(y), &self.term(x)),
        }
    }

    /// An expression where a variable is expected.
    fn term(&self, value: &Expression) -> String {
        match value {
            Expression::Number(value) => self.alone(*value),
            value => self.expression(value),
        }
    }

    /// A term that holds together.
    fn whole(&self, value: &Expression) -> String {
        bound(self.term(value), value, Binding::Whole)
    }

    /// One operator on two operands; numbers may stand on one side only.
    fn binary(&self, a: &Expression, operator: &str, b: &Expression, binding: Binding) -> String {
        let both = matches!((a, b), (Expression::Number(_), Expression::Number(_)));
        let left = if both {
            self.term(a)
        } else {
            self.expression(a)
        };
        let next = match binding {
            Binding::Sum => Binding::Product,
            _ => Binding::Negation,
        };
        let (left, right) = (bound(left, a, binding), bound(self.expression(b), b, next));
        format!("{left} {operator} {right}")
    }
}

/// Text in parentheses if it does not hold together as tightly as asked.
fn bound(text: String, value: &Expression, binding: Binding) -> String {
    if value.binding() < binding {
        format!("({text})")
    } else {
        text
    }
}
