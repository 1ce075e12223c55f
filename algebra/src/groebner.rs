//! Groebner bases: equations go in; equations with the same solutions come out from which the solutions can be read.
//!
//! Buchberger's algorithm with the normal strategy and his two criteria, in exact arithmetic
//! (D. Cox, J. Little, D. O'Shea, "Ideals, Varieties, and Algorithms", 2.6 to 2.10).

use num_traits::One;

use crate::polynomial::{Polynomial, TermExponents};

/// More than this much work is given up: `terms * bits of coefficients`, summed over all steps of division.
const MOST_WORK: u64 = 4_000_000_000;

/// The equations are too many or of too high degree to be solved exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroebnerLimitExceeded;

/// How much work was done.
#[derive(Debug, Default)]
pub struct GroebnerWork(u64);

impl GroebnerWork {
    fn add_division_cost(&mut self, polynomial: &Polynomial) -> Result<(), GroebnerLimitExceeded> {
        let bits = polynomial
            .leading_term()
            .map_or(0, |(_, k)| k.numer().bits() + k.denom().bits());
        self.0 += polynomial.terms.len() as u64 * (64 + bits);
        if self.0 > MOST_WORK {
            Err(GroebnerLimitExceeded)
        } else {
            Ok(())
        }
    }
}

/// The remainder of division by a list of monic polynomials, of which no term can be divided any more.
pub fn remainder(
    polynomial: &Polynomial,
    by: &[Polynomial],
    work: &mut GroebnerWork,
) -> Result<Polynomial, GroebnerLimitExceeded> {
    let mut rest = polynomial.clone();
    let mut remainder = Polynomial::new(polynomial.n);
    while let Some((term, factor)) = rest.terms.last_key_value() {
        let (term, factor) = (term.clone(), factor.clone());
        let divisor = by.iter().find_map(|g| {
            let shift = term.quotient(g.leading_term()?.0)?;
            Some((g, shift))
        });
        match divisor {
            Some((g, shift)) => {
                work.add_division_cost(g)?;
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
pub fn groebner_basis(
    equations: &[Polynomial],
    work: &mut GroebnerWork,
) -> Result<Vec<Polynomial>, GroebnerLimitExceeded> {
    let mut basis: Vec<Polynomial> = Vec::new();
    let mut pairs: Vec<(TermExponents, usize, usize)> = Vec::new();
    // Low degrees first: linear equations then act as a plain elimination.
    let mut inputs: Vec<&Polynomial> = equations.iter().collect();
    inputs.sort_by_key(|p| p.degree());
    for input in inputs {
        let new = remainder(input, &basis, work)?;
        insert_basis_member(new, &mut basis, &mut pairs);
    }
    while let Some(next) = least_pair(&pairs) {
        let (lcm, i, j) = pairs.swap_remove(next);
        if is_redundant_pair(&lcm, i, j, &basis, &pairs) {
            continue;
        }
        let mut s = Polynomial::new(basis[i].n);
        for (k, sign) in [(i, 1), (j, -1)] {
            let leading = basis[k].leading_term().expect("members are not zero").0;
            let shift = lcm.quotient(leading).expect("a multiple of both");
            let sign = num_rational::BigRational::from_integer(sign.into());
            s.add_shifted(&basis[k], &shift, &sign);
        }
        let new = remainder(&s, &basis, work)?;
        insert_basis_member(new, &mut basis, &mut pairs);
    }
    reduce_basis(basis, work)
}

/// Adds a member, and the pairs that it makes with the others.
fn insert_basis_member(
    mut new: Polynomial,
    basis: &mut Vec<Polynomial>,
    pairs: &mut Vec<(TermExponents, usize, usize)>,
) {
    new.make_monic();
    let Some((leading, _)) = new.leading_term() else {
        return;
    };
    for (i, other) in basis.iter().enumerate() {
        let theirs = other.leading_term().expect("members are not zero").0;
        let lcm = leading.least_common_multiple(theirs);
        // Coprime leading terms have nothing to say to each other.
        if lcm.degree() < leading.degree() + theirs.degree() {
            pairs.push((lcm, i, basis.len()));
        }
    }
    basis.push(new);
}

fn least_pair(pairs: &[(TermExponents, usize, usize)]) -> Option<usize> {
    (0..pairs.len()).min_by(|a, b| pairs[*a].cmp(&pairs[*b]))
}

/// Buchberger's second criterion: a third member stands between the two, and its pairs with them are done.
fn is_redundant_pair(
    lcm: &TermExponents,
    i: usize,
    j: usize,
    basis: &[Polynomial],
    pairs: &[(TermExponents, usize, usize)],
) -> bool {
    let is_open = |a: usize, b: usize| {
        let wanted = (a.min(b), a.max(b));
        pairs.iter().any(|(_, i, j)| (*i, *j) == wanted)
    };
    (0..basis.len()).any(|k| {
        k != i
            && k != j
            && basis[k]
                .leading_term()
                .is_some_and(|(leading, _)| lcm.quotient(leading).is_some())
            && !is_open(i, k)
            && !is_open(j, k)
    })
}

/// Drops members whose leading terms others divide, and divides each by the rest.
fn reduce_basis(
    mut basis: Vec<Polynomial>,
    work: &mut GroebnerWork,
) -> Result<Vec<Polynomial>, GroebnerLimitExceeded> {
    basis.sort_by(|a, b| {
        a.leading_term()
            .map(|l| l.0)
            .cmp(&b.leading_term().map(|l| l.0))
    });
    let mut kept: Vec<Polynomial> = Vec::new();
    for member in basis {
        let leading = member.leading_term().expect("members are not zero").0;
        let divides = |g: &Polynomial| {
            leading
                .quotient(g.leading_term().expect("not zero").0)
                .is_some()
        };
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
pub fn has_no_solution(basis: &[Polynomial]) -> bool {
    basis.first().is_some_and(|p| {
        p.degree() == 0 && p.leading_term().is_some_and(|(_, factor)| factor.is_one())
    })
}

/// The terms that no leading term divides, by ascending order; `None` where they never end, because solutions form
/// curves or surfaces. At most `most` of them, else [`GroebnerLimitExceeded`].
pub fn standard_terms(
    basis: &[Polynomial],
    n: usize,
    most: usize,
) -> Result<Option<Vec<TermExponents>>, GroebnerLimitExceeded> {
    let leading: Vec<&TermExponents> = basis
        .iter()
        .filter_map(|g| Some(g.leading_term()?.0))
        .collect();
    let is_bounded = |i: usize| leading.iter().any(|term| term.degree() == term.0[i]);
    if !(0..n).all(is_bounded) {
        return Ok(None);
    }
    let mut terms = std::collections::BTreeSet::new();
    let mut open = vec![TermExponents::unit_term(n)];
    while let Some(term) = open.pop() {
        if leading.iter().any(|l| term.quotient(l).is_some()) || !terms.insert(term.clone()) {
            continue;
        }
        if terms.len() > most {
            return Err(GroebnerLimitExceeded);
        }
        open.extend((0..n).map(|i| term.times(&TermExponents::unknown(n, i))));
    }
    Ok(Some(terms.into_iter().collect()))
}
