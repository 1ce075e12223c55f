//! Sums of angles: integer combinations of atoms plus a multiple of pi/12.

use std::collections::BTreeMap;

use super::{Atom, ExprId, Graph, Node, Rational, Unary};

/// An integer combination of angle atoms, sorted, without zero factors.
///
/// Each entry is an atom with its integer factor.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AtomAngleSum(Vec<(Atom, i32)>);

impl AtomAngleSum {
    /// The empty sum.
    pub const NONE: Self = Self(Vec::new());

    /// Merges equal atoms and drops zeros.
    pub fn new(terms: impl IntoIterator<Item = (Atom, i32)>) -> Self {
        let mut merged = BTreeMap::new();
        for (atom, factor) in terms {
            *merged.entry(atom).or_insert(0) += factor;
        }
        Self(merged.into_iter().filter(|(_, factor)| *factor != 0).collect())
    }

    /// The atoms with their factors.
    pub fn terms(&self) -> &[(Atom, i32)] {
        &self.0
    }

    /// The atoms alone.
    pub fn atoms(&self) -> impl Iterator<Item = Atom> {
        self.0.iter().map(|(atom, _)| *atom)
    }

    /// Whether the sum has no terms.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// `self + factor * other`
    #[must_use]
    pub fn plus(&self, other: &Self, factor: i32) -> Self {
        Self::new(
            self.0
                .iter()
                .copied()
                .chain(other.0.iter().map(|(a, n)| (*a, n * factor))),
        )
    }
}

impl Graph {
    /// Cosine and sine of `sum + pi12 * pi/12`.
    pub fn cos_sin(&mut self, sum: &AtomAngleSum, pi12: i32) -> (ExprId, ExprId) {
        let (cd, sd) = self.cos_sin_fixed(pi12);
        // A constant angle has exact values.
        if sum.is_empty() {
            return (cd, sd);
        }
        // Sines and cosines are stored for angles whose first factor is positive.
        let negative = sum.0[0].1 < 0;
        let canonical = if negative {
            AtomAngleSum::default().plus(sum, -1)
        } else {
            sum.clone()
        };
        let c = self.intern(Node::Cos(canonical.clone()));
        let mut s = self.intern(Node::Sin(canonical));
        if negative {
            s = self.neg(s);
        }
        // Addition theorem of the variable part and the constant part.
        let (cc, ss) = (self.mul(c, cd), self.mul(s, sd));
        let (sc, cs) = (self.mul(s, cd), self.mul(c, sd));
        (self.sub(cc, ss), self.add(sc, cs))
    }

    /// `sum + pi12 * pi/12` as a number.
    pub fn angle(&mut self, sum: &AtomAngleSum, pi12: i32) -> ExprId {
        let mut terms: Vec<(ExprId, Rational)> = sum
            .terms()
            .iter()
            .map(|(atom, n)| (self.atom(*atom), Rational::integer(i64::from(*n))))
            .collect();
        if pi12 != 0 {
            // Here pi is an ordinary atom, with a rational factor.
            terms.push((self.atom(Atom::Pi), Rational::new(i64::from(pi12), 12)));
        }
        self.sum(&terms)
    }

    /// Cosine and sine of `k * pi/12`, exactly.
    fn cos_sin_fixed(&mut self, k: i32) -> (ExprId, ExprId) {
        // The angle is reduced to the first quadrant and then rotated by quarter turns.
        let quarter = k.div_euclid(6).rem_euclid(4);
        let (mut c, mut s) = match k.rem_euclid(6) {
            0 => (Self::ONE, Self::ZERO),
            // (sqrt 6 + sqrt 2)/4 and (sqrt 6 - sqrt 2)/4
            1 => self.cos_sin_15(),
            2 => (self.root_over_2(3), self.rational(Rational::new(1, 2))),
            3 => (self.root_over_2(2), self.root_over_2(2)),
            4 => (self.rational(Rational::new(1, 2)), self.root_over_2(3)),
            _ => {
                let (c, s) = self.cos_sin_15();
                (s, c)
            }
        };
        // A quarter turn maps (c, s) to (-s, c).
        for _ in 0..quarter {
            (c, s) = (self.neg(s), c);
        }
        (c, s)
    }

    /// `sqrt(radicand) / 2`
    fn root_over_2(&mut self, radicand: i64) -> ExprId {
        let number = self.rational(Rational::integer(radicand));
        let root = self.unary(Unary::Sqrt, number);
        self.scale(root, &Rational::new(1, 2))
    }

    /// Cosine and sine of pi/12: `(sqrt 6 + sqrt 2)/4` and `(sqrt 6 - sqrt 2)/4`.
    fn cos_sin_15(&mut self) -> (ExprId, ExprId) {
        let (r3, r2) = (self.root_over_2(3), self.root_over_2(2));
        let r6 = self.mul(r3, r2);
        let r2 = self.scale(r2, &Rational::new(1, 2));
        (self.add(r6, r2), self.sub(r6, r2))
    }
}
