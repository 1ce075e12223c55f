//! The smart constructors: the only way to create a node. Operands go in, the id of the canonical node comes out.

use super::{Atom, ExprId, Graph, Node, Rational, Unary};

/// The square root of a rational number, if it is rational.
fn rational_root(value: &Rational) -> Option<Rational> {
    prime_root_product(value).and_then(|(root, primes)| primes.is_empty().then_some(root))
}

/// Writes the square root of a positive rational as a rational factor times the roots of different primes, so that
/// relations such as `sqrt(8) = 2 sqrt(2)` are found. A cofactor without divisors up to 1000 counts as a prime.
///
/// `None` for numbers that are not positive or do not fit `i64`.
fn prime_root_product(value: &Rational) -> Option<(Rational, Vec<i64>)> {
    // Trial division stops here: larger prime factors are rare in model files.
    const LARGEST: i64 = 1000;
    let (n, d) = value.as_small().filter(|(n, _)| *n > 0)?;
    // sqrt(n/d) = sqrt(n d)/d, so only the integer n d is factored.
    let mut rest = n.checked_mul(d)?;
    let (mut factor, mut primes) = (1, Vec::new());
    let mut p = 2;
    while p <= LARGEST && p <= rest {
        while rest % (p * p) == 0 {
            rest /= p * p;
            factor *= p;
        }
        if rest % p == 0 {
            rest /= p;
            primes.push(p);
        }
        p += 1;
    }
    // The rest has no divisor up to the limit: it is a square, or it counts as one prime.
    let whole = rest.isqrt();
    if whole * whole == rest {
        factor *= whole;
    } else {
        primes.push(rest);
    }
    Some((Rational::new(factor, d), primes))
}

impl Graph {
    /// A rational number.
    pub fn rational(&mut self, value: Rational) -> ExprId {
        self.intern(Node::Rational(value))
    }

    /// An integer.
    pub fn integer(&mut self, value: i64) -> ExprId {
        self.rational(Rational::integer(value))
    }

    /// An opaque quantity.
    pub fn atom(&mut self, atom: Atom) -> ExprId {
        self.intern(Node::Atom(atom))
    }

    /// `a + b`
    pub fn add(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.sum(&[(a, Rational::ONE), (b, Rational::ONE)])
    }

    /// `a - b`
    pub fn sub(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.sum(&[(a, Rational::ONE), (b, Rational::MINUS_ONE)])
    }

    /// `-a`
    pub fn neg(&mut self, a: ExprId) -> ExprId {
        self.scale(a, &Rational::MINUS_ONE)
    }

    /// `factor * a`
    pub fn scale(&mut self, a: ExprId, factor: &Rational) -> ExprId {
        if factor.is_one() {
            return a;
        }
        // A factor that `a` has already is merged, so that factors are never nested.
        let (base, k) = self.split_factor(a);
        let k = &k * factor;
        self.scaled_node(base, k)
    }

    /// Sum of all `terms`.
    pub fn add_all(&mut self, terms: &[ExprId]) -> ExprId {
        let terms: Vec<_> = terms.iter().map(|t| (*t, Rational::ONE)).collect();
        self.sum(&terms)
    }

    /// Linear combination of `terms`.
    ///
    /// A term that is itself a sum stays nested, unless opening it makes something cancel.
    pub fn sum(&mut self, terms: &[(ExprId, Rational)]) -> ExprId {
        let mut flat: Vec<(ExprId, Rational)> = Vec::with_capacity(terms.len());
        // Like terms are added first, each without its own rational factor.
        for (term, factor) in terms {
            let (base, k) = self.split_factor(*term);
            merge(&mut flat, base, &(&k * factor));
        }
        flat.retain(|(_, k)| !k.is_zero());
        // Sums are opened one at a time, because each opened sum may make another one cancel.
        while let Some(opened) = self.open_cancelling(&flat) {
            flat = opened;
        }
        self.canonical_sum(flat)
    }

    /// `a * b`
    pub fn mul(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.product(&[(a, 1), (b, 1)])
    }

    /// `a / b`; `b` must not be zero.
    pub fn div(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.product(&[(a, 1), (b, -1)])
    }

    /// `a^n`
    pub fn pow(&mut self, a: ExprId, n: i32) -> ExprId {
        self.product(&[(a, n)])
    }

    /// Product of integer powers; a factor 0 with a negative exponent is refused by an assertion.
    pub fn product(&mut self, factors: &[(ExprId, i32)]) -> ExprId {
        // The rational factors of all operands are collected in one number outside the product.
        let mut scale = Rational::ONE;
        let mut flat: Vec<(ExprId, i32)> = Vec::with_capacity(factors.len());
        // Adds an exponent to a factor that is in the list, or appends the factor.
        let push = |flat: &mut Vec<(ExprId, i32)>, base: ExprId, n: i32| match flat.iter_mut().find(|f| f.0 == base) {
            Some(found) => found.1 += n,
            None => flat.push((base, n)),
        };
        for (factor, n) in factors {
            if *n == 0 {
                continue;
            }
            let (base, k) = self.split_factor(*factor);
            assert!(!k.is_zero() || *n > 0, "division by an exact zero");
            scale = &scale * &k.pow(*n);
            match self.node(base) {
                Node::Rational(_) => {}
                // Powers of a product are opened so that a quotient can cancel; a plain factor stays shared.
                Node::Product(inner) if *n != 1 || inner.iter().any(|(_, m)| *m < 0) => {
                    for (inner_base, m) in inner.clone() {
                        push(&mut flat, inner_base, m * n);
                    }
                }
                _ => push(&mut flat, base, *n),
            }
        }
        // A product with a factor zero is zero, however many other factors it has.
        if scale.is_zero() {
            return Self::ZERO;
        }
        // sqrt(x)^2 = x
        for i in 0..flat.len() {
            if let (Node::Unary(Unary::Sqrt, inner), n) = (self.node(flat[i].0), flat[i].1)
                && n.abs() >= 2
            {
                let inner = *inner;
                let rest = (flat[i].0, n % 2);
                flat.remove(i);
                flat.extend([(inner, n / 2), rest]);
                let opened = self.product(&flat);
                return self.scale(opened, &scale);
            }
        }
        flat.retain(|(_, n)| *n != 0);
        // An order by id makes equal products equal nodes.
        let base = match flat.as_slice() {
            [] => Self::ONE,
            [(only, 1)] => *only,
            _ => {
                flat.sort_unstable();
                self.intern(Node::Product(flat))
            }
        };
        self.scaled_node(base, scale)
    }

    /// A function of one argument.
    ///
    /// Numbers are evaluated where the result is exact, and signs and rational factors move out of the function.
    pub fn unary(&mut self, function: Unary, a: ExprId) -> ExprId {
        // Exact values of numbers.
        if let Node::Rational(value) = self.node(a).clone() {
            match function {
                Unary::Sqrt if value.is_zero() || value.is_one() => return a,
                // A rational root, or a product of roots of primes with a rational factor.
                Unary::Sqrt => {
                    if let Some((factor, primes)) = prime_root_product(&value)
                        && (primes.len() != 1 || !factor.is_one())
                    {
                        let roots: Vec<(ExprId, i32)> = primes
                            .into_iter()
                            .map(|p| {
                                let p = self.integer(p);
                                (self.intern(Node::Unary(Unary::Sqrt, p)), 1)
                            })
                            .collect();
                        let product = self.product(&roots);
                        return self.scale(product, &factor);
                    }
                }
                Unary::Sign => {
                    let sign = i64::from(!value.is_zero()) * if value.is_negative() { -1 } else { 1 };
                    return self.integer(sign);
                }
                Unary::Abs => return self.rational(value.abs()),
                Unary::Tanh | Unary::Sin if value.is_zero() => return Self::ZERO,
                Unary::Exp | Unary::Cos if value.is_zero() => return Self::ONE,
                _ => {}
            }
        }
        // Odd functions move a minus sign outwards; even functions drop it.
        let (base, k) = self.split_factor(a);
        match function {
            Unary::Sign | Unary::Tanh | Unary::Abs | Unary::Sin | Unary::Cos if k.is_negative() => {
                let positive = self.neg(a);
                let value = self.unary(function, positive);
                if matches!(function, Unary::Abs | Unary::Cos) {
                    value
                } else {
                    self.neg(value)
                }
            }
            // sign(k x) = sign(x) and abs(k x) = k abs(x) for k > 0, which is true here.
            Unary::Sign if !k.is_one() => self.unary(Unary::Sign, base),
            Unary::Abs if !k.is_one() => {
                let value = self.unary(Unary::Abs, base);
                self.scale(value, &k)
            }
            // sqrt(k x) = sqrt(k) sqrt(x) where sqrt(k) is rational.
            Unary::Sqrt if !k.is_one() && base != Self::ONE && rational_root(&k).is_some() => {
                let value = self.unary(Unary::Sqrt, base);
                let factor = rational_root(&k).unwrap_or(Rational::ONE);
                self.scale(value, &factor)
            }
            // sqrt(x^2) = abs(x)
            Unary::Sqrt => {
                if let Node::Product(factors) = self.node(a)
                    && let [(inner, 2)] = factors.as_slice()
                {
                    let inner = *inner;
                    return self.unary(Unary::Abs, inner);
                }
                self.intern(Node::Unary(function, a))
            }
            _ => self.intern(Node::Unary(function, a)),
        }
    }

    /// Writes `a` as `factor * base`, where `base` has no rational factor of its own (1 for numbers).
    pub fn split_factor(&self, a: ExprId) -> (ExprId, Rational) {
        match self.node(a) {
            Node::Rational(value) => (Self::ONE, value.clone()),
            Node::Sum(terms) if terms.len() == 1 => terms[0].clone(),
            _ => (a, Rational::ONE),
        }
    }

    /// `factor * base` as a node, where `base` has no rational factor of its own.
    fn scaled_node(&mut self, base: ExprId, factor: Rational) -> ExprId {
        if factor.is_zero() {
            Self::ZERO
        } else if base == Self::ONE {
            self.rational(factor)
        } else if factor.is_one() {
            base
        } else {
            self.intern(Node::Sum(vec![(base, factor)]))
        }
    }

    /// The sum of merged terms as a node: terms in order of their ids, and a common factor moved outwards.
    fn canonical_sum(&mut self, mut flat: Vec<(ExprId, Rational)>) -> ExprId {
        match flat.len() {
            0 => return Self::ZERO,
            1 => {
                let (base, factor) = flat.remove(0);
                return self.scaled_node(base, factor);
            }
            _ => {}
        }
        flat.sort_by_key(|(id, _)| *id);
        // The number stands last, so that the sign of a sum is that of its first true term.
        if flat[0].0 == Self::ONE {
            flat.rotate_left(1);
        }
        // A factor that all terms share goes outwards; a mere common divisor stays, as it would only be multiplied
        // back.
        let first = flat[0].1.clone();
        let content = if flat.iter().all(|(_, k)| k.abs() == first.abs()) {
            first
        } else if first.is_negative() {
            Rational::MINUS_ONE
        } else {
            Rational::ONE
        };
        if !content.is_one() {
            let inverse = content.recip();
            for (_, k) in &mut flat {
                *k = &*k * &inverse;
            }
        }
        let base = self.intern(Node::Sum(flat));
        self.scaled_node(base, content)
    }

    /// The list with one nested sum opened, if a term of that sum cancels against the others; `None` if nothing
    /// cancels.
    fn open_cancelling(&self, flat: &[(ExprId, Rational)]) -> Option<Vec<(ExprId, Rational)>> {
        // Terms of a true sum; a single scaled term is not one.
        let inner_terms = |id: ExprId| match self.node(id) {
            Node::Sum(terms) if terms.len() > 1 => Some(terms),
            _ => None,
        };
        for (i, (id, factor)) in flat.iter().enumerate() {
            let Some(inner) = inner_terms(*id) else {
                continue;
            };
            // Whether a term of the inner sum is the negative of an outer term, or of a term inside another nested sum.
            let cancels = inner.iter().any(|(base, k)| {
                let k = k * factor;
                flat.iter().enumerate().filter(|(j, _)| *j != i).any(|(_, (other, m))| {
                    let opposite = |m: &Rational| (m + &k).is_zero();
                    (other == base && opposite(m))
                        || inner_terms(*other).is_some_and(|t| t.iter().any(|(b, x)| b == base && opposite(&(x * m))))
                })
            });
            if cancels {
                let mut opened: Vec<_> = flat
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| *j != i)
                    .map(|(_, t)| t.clone())
                    .collect();
                for (base, k) in inner {
                    merge(&mut opened, *base, &(k * factor));
                }
                opened.retain(|(_, k)| !k.is_zero());
                return Some(opened);
            }
        }
        None
    }
}

/// Adds `factor * base` to a list of terms without duplicates.
fn merge(flat: &mut Vec<(ExprId, Rational)>, base: ExprId, factor: &Rational) {
    match flat.iter_mut().find(|(id, _)| *id == base) {
        Some((_, k)) => *k = &*k + factor,
        None => flat.push((base, factor.clone())),
    }
}
