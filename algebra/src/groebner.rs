//! Groebner bases: equations go in. Equations with the same solutions come out, from which the solutions can be
//! computed.
//!
//! Buchberger's algorithm with the normal strategy and his two criteria, in exact arithmetic
//! (D. Cox, J. Little, D. O'Shea, "Ideals, Varieties, and Algorithms", 2.6 to 2.10).

use num_traits::One;

use crate::polynomial::{Polynomial, TermExponents};

/// Limit of the work: `terms * bits of coefficients`, summed over all division steps.
const MOST_WORK: u64 = 4_000_000_000;

/// Error: the equations are too many, or of too high degree, to be solved exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroebnerLimitExceeded;

/// Work that has been done, in the units of the limit.
#[derive(Debug, Default)]
pub struct GroebnerWork(u64);

impl GroebnerWork {
    /// Counts one division step by `polynomial`; an error if the limit is exceeded.
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

/// The remainder of a division by a list of monic polynomials: none of its terms is divisible by a leading term.
///
/// # Errors
/// [`GroebnerLimitExceeded`] if the work exceeds the limit.
pub fn remainder(
    polynomial: &Polynomial,
    by: &[Polynomial],
    work: &mut GroebnerWork,
) -> Result<Polynomial, GroebnerLimitExceeded> {
    let mut rest = polynomial.clone();
    let mut remainder = Polynomial::new(polynomial.n);
    while let Some((term, factor)) = rest.terms.last_key_value() {
        let (term, factor) = (term.clone(), factor.clone());
        // The first member whose leading term divides the present one is subtracted.
        let divisor = by.iter().find_map(|g| {
            let shift = term.quotient(g.leading_term()?.0)?;
            Some((g, shift))
        });
        match divisor {
            Some((g, shift)) => {
                work.add_division_cost(g)?;
                rest.add_shifted(g, &shift, &-factor);
            }
            // A term that no member divides belongs to the remainder.
            None => {
                rest.terms.remove(&term);
                remainder.terms.insert(term, factor);
            }
        }
    }
    Ok(remainder)
}

/// The reduced Groebner basis, in ascending order of leading terms; `[1]` if there are no solutions.
///
/// # Errors
/// [`GroebnerLimitExceeded`] if the work exceeds the limit.
pub fn groebner_basis(
    equations: &[Polynomial],
    work: &mut GroebnerWork,
) -> Result<Vec<Polynomial>, GroebnerLimitExceeded> {
    // Members so far, and pairs whose S-polynomials have not been reduced, each with the common multiple of its leading
    // terms.
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
        // The S-polynomial: the leading terms of both multiples cancel.
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

/// Adds a member, and its pairs with the others; zero is not added.
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
        // Buchberger's first criterion: the S-polynomial of coprime leading terms reduces to zero.
        if lcm.degree() < leading.degree() + theirs.degree() {
            pairs.push((lcm, i, basis.len()));
        }
    }
    basis.push(new);
}

/// Index of the pair with the least common multiple (normal strategy).
fn least_pair(pairs: &[(TermExponents, usize, usize)]) -> Option<usize> {
    (0..pairs.len()).min_by(|a, b| pairs[*a].cmp(&pairs[*b]))
}

/// Buchberger's second criterion: the leading term of a third member divides the common multiple, and its pairs with
/// both members have been reduced.
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

/// Removes members whose leading terms are divisible by others', and reduces the remaining ones by each other.
fn reduce_basis(mut basis: Vec<Polynomial>, work: &mut GroebnerWork) -> Result<Vec<Polynomial>, GroebnerLimitExceeded> {
    basis.sort_by(|a, b| a.leading_term().map(|l| l.0).cmp(&b.leading_term().map(|l| l.0)));
    let mut kept: Vec<Polynomial> = Vec::new();
    for member in basis {
        let leading = member.leading_term().expect("members are not zero").0;
        let divides = |g: &Polynomial| leading.quotient(g.leading_term().expect("not zero").0).is_some();
        if !kept.iter().any(divides) {
            kept.push(member);
        }
    }
    // Only the tail is reduced: no other member divides the leading term.
    for k in 0..kept.len() {
        let mut tail = kept[k].clone();
        let (leading, factor) = tail.terms.pop_last().expect("members are not zero");
        let mut member = remainder(&tail, &kept, work)?;
        member.terms.insert(leading, factor);
        kept[k] = member;
    }
    Ok(kept)
}

/// Whether a basis shows that there are no solutions, not even complex ones.
pub fn has_no_solution(basis: &[Polynomial]) -> bool {
    basis
        .first()
        .is_some_and(|p| p.degree() == 0 && p.leading_term().is_some_and(|(_, factor)| factor.is_one()))
}

/// The terms that no leading term divides, in ascending order; `None` if they are infinitely many, because solutions
/// form curves or surfaces.
///
/// # Errors
/// [`GroebnerLimitExceeded`] if there are more than `most`.
pub fn standard_terms(
    basis: &[Polynomial],
    n: usize,
    most: usize,
) -> Result<Option<Vec<TermExponents>>, GroebnerLimitExceeded> {
    let leading: Vec<&TermExponents> = basis.iter().filter_map(|g| Some(g.leading_term()?.0)).collect();
    // They are finitely many if a power of every unknown is a leading term.
    let is_bounded = |i: usize| leading.iter().any(|term| term.degree() == term.0[i]);
    if !(0..n).all(is_bounded) {
        return Ok(None);
    }
    // Search from the term 1 by multiplication with unknowns.
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
