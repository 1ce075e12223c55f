//! Groebner bases: equations go in; equations with the same solutions come out from which the solutions can be read.
//!
//! Buchberger's algorithm with the normal strategy and his two criteria, in exact arithmetic
//! (D. Cox, J. Little, D. O'Shea, "Ideals, Varieties, and Algorithms", 2.6 to 2.10).

use num_traits::One;

use crate::polynomial::{Polynomial, Powers};

/// More than this much work is given up: `terms * bits of coefficients`, summed over all steps of division.
const MOST_WORK: u64 = 4_000_000_000;

/// The equations are too many or of too high degree to be solved exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooHard;

/// How much work was done.
#[derive(Debug, Default)]
pub struct Work(u64);

impl Work {
    fn spend(&mut self, polynomial: &Polynomial) -> Result<(), TooHard> {
        let bits = polynomial
            .leading()
            .map_or(0, |(_, k)| k.numer().bits() + k.denom().bits());
        self.0 += polynomial.terms.len() as u64 * (64 + bits);
        if self.0 > MOST_WORK {
            Err(TooHard)
        } else {
            Ok(())
        }
    }
}

/// The remainder of division by a list of monic polynomials, of which no term can be divided any more.
pub fn remainder(
    polynomial: &Polynomial,
    by: &[Polynomial],
    work: &mut Work,
) -> Result<Polynomial, TooHard> {
    let mut rest = polynomial.clone();
    let mut remainder = Polynomial::new(polynomial.n);
    while let Some((term, factor)) = rest.terms.last_key_value() {
        let (term, factor) = (term.clone(), factor.clone());
        let divisor = by.iter().find_map(|g| {
            let shift = term.over(g.leading()?.0)?;
            Some((g, shift))
        });
        match divisor {
            Some((g, shift)) => {
                work.spend(g)?;
                rest.add_shifted(g, &shift, &-factor);
            }
            None => {
                rest.terms.remove(&term);
                remainder.terms.insert(term, factor);
            }
        }
    }
    Ok(remainder)
}

/// The reduced Groebner basis, by ascending leading terms; `[1]` where there are no solutions.
pub fn groebner(equations: &[Polynomial], work: &mut Work) -> Result<Vec<Polynomial>, TooHard> {
    let mut basis: Vec<Polynomial> = Vec::new();
    let mut pairs: Vec<(Powers, usize, usize)> = Vec::new();
    // Low degrees first: linear equations then act as a plain elimination.
    let mut inputs: Vec<&Polynomial> = equations.iter().collect();
    inputs.sort_by_key(|p| p.degree());
    for input in inputs {
        let new = remainder(input, &basis, work)?;
        insert(new, &mut basis, &mut pairs);
    }
    while let Some(next) = least(&pairs) {
        let (lcm, i, j) = pairs.swap_remove(next);
        if is_covered(&lcm, i, j, &basis, &pairs) {
            continue;
        }
        let mut s = Polynomial::new(basis[i].n);
        for (k, sign) in [(i, 1), (j, -1)] {
            let leading = basis[k].leading().expect("members are not zero").0;
            let shift = lcm.over(leading).expect("a multiple of both");
            let sign = num_rational::BigRational::from_integer(sign.into());
            s.add_shifted(&basis[k], &shift, &sign);
        }
        let new = remainder(&s, &basis, work)?;
        insert(new, &mut basis, &mut pairs);
    }
    reduced(basis, work)
}

/// Adds a member, and the pairs that it makes with the others.
fn insert(
    mut new: Polynomial,
    basis: &mut Vec<Polynomial>,
    pairs: &mut Vec<(Powers, usize, usize)>,
) {
    new.make_monic();
    let Some((leading, _)) = new.leading() else {
        return;
    };
    for (i, other) in basis.iter().enumerate() {
        let theirs = other.leading().expect("members are not zero").0;
        let lcm = leading.least_common_multiple(theirs);
        // Coprime leading terms have nothing to say to each other.
        if lcm.degree() < leading.degree() + theirs.degree() {
            pairs.push((lcm, i, basis.len()));
        }
    }
    basis.push(new);
}

fn least(pairs: &[(Powers, usize, usize)]) -> Option<usize> {
    (0..pairs.len()).min_by(|a, b| pairs[*a].cmp(&pairs[*b]))
}

/// Buchberger's second criterion: a third member stands between the two, and its pairs with them are done.
fn is_covered(
    lcm: &Powers,
    i: usize,
    j: usize,
    basis: &[Polynomial],
    pairs: &[(Powers, usize, usize)],
) -> bool {
    let is_open = |a: usize, b: usize| {
        let wanted = (a.min(b), a.max(b));
        pairs.iter().any(|(_, i, j)| (*i, *j) == wanted)
    };
    (0..basis.len()).any(|k| {
        k != i
            && k != j
            && basis[k]
                .leading()
                .is_some_and(|(leading, _)| lcm.over(leading).is_some())
            && !is_open(i, k)
            && !is_open(j, k)
    })
}

/// Drops members whose leading terms others divide, and divides each by the rest.
fn reduced(mut basis: Vec<Polynomial>, work: &mut Work) -> Result<Vec<Polynomial>, TooHard> {
    basis.sort_by(|a, b| a.leading().map(|l| l.0).cmp(&b.leading().map(|l| l.0)));
    let mut kept: Vec<Polynomial> = Vec::new();
    for member in basis {
        let leading = member.leading().expect("members are not zero").0;
        let divides = |g: &Polynomial| leading.over(g.leading().expect("not zero").0).is_some();
        if !kept.iter().any(divides) {
            kept.push(member);
        }
    }
    for k in 0..kept.len() {
        let mut tail = kept[k].clone();
        let (leading, factor) = tail.terms.pop_last().expect("members are not zero");
        let mut member = remainder(&tail, &kept, work)?;
        member.terms.insert(leading, factor);
        kept[k] = member;
    }
    Ok(kept)
}

/// Whether a basis says that there are no solutions, not even complex ones.
pub fn is_contradiction(basis: &[Polynomial]) -> bool {
    basis
        .first()
        .is_some_and(|p| p.degree() == 0 && p.leading().is_some_and(|(_, factor)| factor.is_one()))
}

/// The terms that no leading term divides, by ascending order; `None` where they never end, because solutions form
/// curves or surfaces. At most `most` of them, else [`TooHard`].
pub fn standard_terms(
    basis: &[Polynomial],
    n: usize,
    most: usize,
) -> Result<Option<Vec<Powers>>, TooHard> {
    let leading: Vec<&Powers> = basis.iter().filter_map(|g| Some(g.leading()?.0)).collect();
    let is_bounded = |i: usize| leading.iter().any(|term| term.degree() == term.0[i]);
    if !(0..n).all(is_bounded) {
        return Ok(None);
    }
    let mut terms = std::collections::BTreeSet::new();
    let mut open = vec![Powers::one(n)];
    while let Some(term) = open.pop() {
        if leading.iter().any(|l| term.over(l).is_some()) || !terms.insert(term.clone()) {
            continue;
        }
        if terms.len() > most {
            return Err(TooHard);
        }
        open.extend((0..n).map(|i| term.times(&Powers::unknown(n, i))));
    }
    Ok(Some(terms.into_iter().collect()))
}
