//! Variables of an emitted program, so that it reads as its equations do: `0.5 * r_x + r_y * x1`.
//!
//! A product is kept unevaluated until its next operation. If it is added to something, both become one instruction
//! where the machine has a fused multiply-add, which rounds once.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::Real;

/// Type of a variable: one number, or as many as a vector register of the machine takes.
pub trait ProgramValue:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A number as a value like `self`.
    #[must_use]
    fn number_like(self, x: f64) -> Self;
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// -1, 0 or 1; NaN stays NaN.
    #[must_use]
    fn sign(self) -> Self;
    /// Hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;
    /// Exponential.
    #[must_use]
    fn exp(self) -> Self;
    /// Angle of the point (`x`, `self`) in rad.
    #[must_use]
    fn atan2(self, x: Self) -> Self;

    /// `self + a * b`, rounded once where the machine does so at no cost.
    #[allow(clippy::inline_always, reason = "an instruction or two")]
    #[inline(always)]
    #[must_use]
    fn plus_product(self, a: Self, b: Self) -> Self {
        a * b + self
    }
    /// `a * b - self`, as [`Self::plus_product`].
    #[allow(clippy::inline_always, reason = "an instruction or two")]
    #[inline(always)]
    #[must_use]
    fn product_less(self, a: Self, b: Self) -> Self {
        a * b - self
    }
    /// `self - a * b`, as [`Self::plus_product`].
    #[allow(clippy::inline_always, reason = "an instruction or two")]
    #[inline(always)]
    #[must_use]
    fn less_product(self, a: Self, b: Self) -> Self {
        self - a * b
    }
}

#[allow(clippy::inline_always, reason = "each is an instruction or a call")]
impl<T: Real> ProgramValue for T {
    #[inline(always)]
    fn number_like(self, x: f64) -> Self {
        T::from_f64(x)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Real::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Real::abs(self)
    }
    #[inline(always)]
    fn sign(self) -> Self {
        Real::sign(self)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        Real::tanh(self)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Real::exp(self)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        Real::atan2(self, x)
    }
}

/// A variable of a program.
#[derive(Clone, Copy, Debug)]
pub struct Var<V>(pub V);

/// A product of two variables that is kept unevaluated until its next operation.
#[derive(Clone, Copy, Debug)]
pub struct DeferredProduct<V>(V, V);

/// An operand of the arithmetic: a variable, or an expression of variables.
pub trait Term<V>: Copy {
    /// Its value.
    fn get(self) -> V;
    /// Its value as a variable.
    #[allow(clippy::inline_always, reason = "nothing at all")]
    #[inline(always)]
    fn var(self) -> Var<V> {
        Var(self.get())
    }
}

#[allow(clippy::inline_always, reason = "nothing at all")]
impl<V: Copy> Term<V> for Var<V> {
    #[inline(always)]
    fn get(self) -> V {
        self.0
    }
}

#[allow(clippy::inline_always, reason = "one instruction")]
impl<V: ProgramValue> Term<V> for DeferredProduct<V> {
    #[inline(always)]
    fn get(self) -> V {
        self.0 * self.1
    }
}

macro_rules! functions {
    ($($name:ident $what:literal)*) => {$(
        #[doc = $what]
        #[allow(clippy::inline_always, reason = "an instruction or a call")]
        #[inline(always)]
        #[must_use]
        pub fn $name(self) -> Var<V> {
            Var(self.get().$name())
        }
    )*};
}

macro_rules! terms {
    ($($term:ident)*) => {$(
        impl<V: ProgramValue> $term<V> {
            /// Its value.
            #[allow(clippy::inline_always, reason = "an instruction at most")]
            #[inline(always)]
            #[must_use]
            pub fn get(self) -> V {
                Term::get(self)
            }
            functions! {
                sqrt "Square root."
                abs "Absolute value."
                sign "-1, 0 or 1; NaN stays NaN."
                tanh "Hyperbolic tangent."
                exp "Exponential."
            }
            /// Angle of the point (`x`, `self`) in rad.
            #[allow(clippy::inline_always, reason = "a call")]
            #[inline(always)]
            #[must_use]
            pub fn atan2(self, x: impl Term<V>) -> Var<V> {
                Var(self.get().atan2(x.get()))
            }
        }

        #[allow(clippy::inline_always, reason = "one instruction")]
        impl<V: ProgramValue> Neg for $term<V> {
            type Output = Var<V>;
            #[inline(always)]
            fn neg(self) -> Var<V> {
                Var(-self.get())
            }
        }
    )*};
}
terms! { Var DeferredProduct }

/// `left operator right` for terms, where `a` and `b` are both.
macro_rules! operators {
    ($($left:ident $operator:ident::$method:ident $right:ident = $output:ident, |$a:ident, $b:ident| $result:expr;)*) => {$(
        #[allow(clippy::inline_always, reason = "an instruction or two")]
        impl<V: ProgramValue> $operator<$right<V>> for $left<V> {
            type Output = $output<V>;
            #[inline(always)]
            fn $method(self, other: $right<V>) -> $output<V> {
                let ($a, $b) = (self, other);
                $result
            }
        }
    )*};
}
operators! {
    Var Add::add Var = Var, |a, b| Var(a.0 + b.0);
    Var Add::add DeferredProduct = Var, |a, b| Var(a.0.plus_product(b.0, b.1));
    DeferredProduct Add::add Var = Var, |a, b| Var(b.0.plus_product(a.0, a.1));
    DeferredProduct Add::add DeferredProduct = Var, |a, b| Var(a.get().plus_product(b.0, b.1));
    Var Sub::sub Var = Var, |a, b| Var(a.0 - b.0);
    Var Sub::sub DeferredProduct = Var, |a, b| Var(a.0.less_product(b.0, b.1));
    DeferredProduct Sub::sub Var = Var, |a, b| Var(b.0.product_less(a.0, a.1));
    DeferredProduct Sub::sub DeferredProduct = Var, |a, b| Var(a.get().less_product(b.0, b.1));
    Var Mul::mul Var = DeferredProduct, |a, b| DeferredProduct(a.0, b.0);
    Var Mul::mul DeferredProduct = DeferredProduct, |a, b| DeferredProduct(a.0, b.get());
    DeferredProduct Mul::mul Var = DeferredProduct, |a, b| DeferredProduct(a.get(), b.0);
    DeferredProduct Mul::mul DeferredProduct = DeferredProduct, |a, b| DeferredProduct(a.get(), b.get());
    Var Div::div Var = Var, |a, b| Var(a.0 / b.0);
    Var Div::div DeferredProduct = Var, |a, b| Var(a.0 / b.get());
    DeferredProduct Div::div Var = Var, |a, b| Var(a.get() / b.0);
    DeferredProduct Div::div DeferredProduct = Var, |a, b| Var(a.get() / b.get());
}

/// The same where one side is a literal number of the program.
macro_rules! with_numbers {
    ($($term:ident)*) => {$(
        with_numbers! { $term Add::add = Var, |a, b| a + b }
        with_numbers! { $term Sub::sub = Var, |a, b| a - b }
        with_numbers! { $term Mul::mul = DeferredProduct, |a, b| a * b }
        with_numbers! { $term Div::div = Var, |a, b| a / b }
    )*};
    ($term:ident $operator:ident::$method:ident = $output:ident, |$a:ident, $b:ident| $result:expr) => {
        #[allow(clippy::inline_always, reason = "an instruction or two")]
        impl<V: ProgramValue> $operator<f64> for $term<V> {
            type Output = $output<V>;
            #[inline(always)]
            fn $method(self, other: f64) -> $output<V> {
                let ($a, $b) = (self, Var(self.0.number_like(other)));
                $result
            }
        }

        #[allow(clippy::inline_always, reason = "an instruction or two")]
        impl<V: ProgramValue> $operator<$term<V>> for f64 {
            type Output = $output<V>;
            #[inline(always)]
            fn $method(self, other: $term<V>) -> $output<V> {
                let ($a, $b) = (Var(other.0.number_like(self)), other);
                $result
            }
        }
    };
}
with_numbers! { Var DeferredProduct }

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operator on every pair of terms agrees with plain arithmetic; all results are exact.
    #[test]
    fn terms_compute_as_numbers_do() {
        let [a, b, c, d] = [3.0, 5.0, 7.0, 11.0_f64];
        let [x, y, z, w] = [a, b, c, d].map(Var);
        let exactly = |found: f64, expected: f64| assert_eq!(found.to_bits(), expected.to_bits());
        exactly((x + y).get(), a + b);
        exactly((x + y * z).get(), a + b * c);
        exactly((x * y + z).get(), a * b + c);
        exactly((x * y + z * w).get(), a * b + c * d);
        exactly((x - y).get(), a - b);
        exactly((x - y * z).get(), a - b * c);
        exactly((x * y - z).get(), a * b - c);
        exactly((x * y - z * w).get(), a * b - c * d);
        exactly((x * y * z).get(), a * b * c);
        exactly((x * (y * z)).get(), a * (b * c));
        exactly((x * y * (z * w)).get(), a * b * (c * d));
        exactly((x / y).get(), a / b);
        exactly((x / (y * z)).get(), a / (b * c));
        exactly((x * y / z).get(), a * b / c);
        exactly((x * y / (z * w)).get(), a * b / (c * d));
        exactly((-x).get(), -a);
        exactly((-(x * y)).get(), -(a * b));
        exactly((2.0 * x - 0.5).get(), 2.0 * a - 0.5);
        exactly((2.0 + x * y).get(), 2.0 + a * b);
        exactly((2.0 - x * y).get(), 2.0 - a * b);
        exactly((x * y - 2.0).get(), a * b - 2.0);
        exactly((1.0 / x).get(), 1.0 / a);
        exactly((x * y / 2.0).get(), a * b / 2.0);
        exactly((x * y).sqrt().get(), (a * b).sqrt());
        exactly((x * y).atan2(z * w).get(), (a * b).atan2(c * d));
    }

    #[test]
    fn single_precision_takes_the_same_numbers() {
        let x = Var(3.0_f32);
        assert_eq!((0.5 * x + 0.1).get().to_bits(), (0.5 * 3.0_f32 + 0.1).to_bits());
    }
}
