//! Evaluation with many digits: small contributions of columns remain distinguishable from rounding errors.

use std::collections::BTreeMap;

use modelmill_algebra::digits::BigFloat;

use super::{Atom, AtomAngleSum, EvaluationDomain, Rational, Unary};

/// Values of atoms, with cosines and sines of those that are used as angles.
#[derive(Clone, Debug, Default)]
pub(crate) struct BigFloatPoint {
    /// Value of every atom that was set.
    values: BTreeMap<Atom, BigFloat>,
    /// Cosine and sine of every atom that was set as an angle.
    circles: BTreeMap<Atom, (BigFloat, BigFloat)>,
}

impl BigFloatPoint {
    /// Sets the value of an atom. `None` where it is used as an angle and is too large for a cosine and a sine.
    pub(crate) fn set(&mut self, atom: Atom, value: BigFloat, is_angle: bool) -> Option<()> {
        // Cosine and sine are computed once, when the value is set.
        if is_angle {
            self.circles.insert(atom, value.cos_sin()?);
        }
        self.values.insert(atom, value);
        Some(())
    }

    /// The value of an atom that has one.
    pub(crate) fn value(&self, atom: Atom) -> Option<&BigFloat> {
        self.values.get(&atom)
    }
}

impl EvaluationDomain for BigFloatPoint {
    type Value = BigFloat;
    fn rational(&self, value: &Rational) -> Option<BigFloat> {
        Some(BigFloat::from_rational(value))
    }
    fn add(&self, a: &BigFloat, b: &BigFloat) -> BigFloat {
        a + b
    }
    fn mul(&self, a: &BigFloat, b: &BigFloat) -> BigFloat {
        a * b
    }
    fn power(&self, a: &BigFloat, n: i32) -> Option<BigFloat> {
        a.power(n)
    }
    fn unary(&self, function: Unary, a: &BigFloat) -> Option<BigFloat> {
        match function {
            Unary::Sqrt => a.sqrt(),
            // The sign of zero is zero.
            Unary::Sign if a.is_zero() => Some(BigFloat::zero()),
            Unary::Sign => Some(BigFloat::integer(if a.is_negative() { -1 } else { 1 })),
            Unary::Abs => Some(a.abs()),
            Unary::Tanh => a.tanh(),
            Unary::Exp => a.exp(),
            Unary::Sin => Some(a.cos_sin()?.1),
            Unary::Cos => Some(a.cos_sin()?.0),
        }
    }
    fn atom(&self, atom: Atom) -> Option<BigFloat> {
        self.values.get(&atom).cloned()
    }
    fn cos_sin(&self, angle: &AtomAngleSum) -> Option<(BigFloat, BigFloat)> {
        // Angles are added one unit at a time by the addition theorems.
        let mut total = (BigFloat::integer(1), BigFloat::zero());
        for (atom, n) in angle.terms() {
            let (c, s) = self.circles.get(atom)?;
            let s = if *n < 0 { -s } else { s.clone() };
            for _ in 0..n.unsigned_abs() {
                total = (&(&total.0 * c) - &(&total.1 * &s), &(&total.0 * &s) + &(&total.1 * c));
            }
        }
        Some(total)
    }
}
