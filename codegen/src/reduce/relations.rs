//! Dependences of columns as they are closest together, and the factors of eq. (6) put together from them.
//!
//! A column that depends on others can often be written with a few near ones, which may depend on others in turn: the
//! columns of a link of an arm need those of the link before it and the constants of the one joint between them (Gautier
//! and Khalil 1990), while its factors on the retained columns run through all joints down to the base. So relations
//! between neighbours are reconstructed, and factors are their sums of products.
//!
//! Decision: products of relations are multiplied out up to 5000 terms; beyond that, base parameters are given by
//! named sums, link by link. Polynomials over powers of lengths have one normal form, so this gives the same result
//! as a direct reconstruction. Other quotients are reconstructed again from the combined relation, which needs no
//! further points of motion.

use std::collections::BTreeMap;

use modelmill_algebra::eliminate::{self, RowEchelonForm};
use modelmill_algebra::field::FieldElement;

use super::rational_function::{
    FactorVariable, PowerProduct, RationalFunction, TrigonometricPolynomial,
};
use crate::DeriveError;
use crate::expr::{FieldPoint, Rational};

/// One column in terms of others, all by position among the effective ones.
#[derive(Clone, Debug)]
pub(super) struct ColumnRelation {
    /// The column.
    pub(super) column: usize,
    /// Retained columns that it needs.
    retained: Vec<usize>,
    /// Columns that it needs and that have relations of their own, before this one.
    pub(super) dependent: Vec<usize>,
}

impl ColumnRelation {
    /// How many factors it has.
    pub(super) fn len(&self) -> usize {
        self.retained.len() + self.dependent.len()
    }

    /// Whether it needs retained columns alone.
    pub(super) fn has_retained_only(&self) -> bool {
        self.dependent.is_empty()
    }

    /// Columns with a factor, in the order of [`Self::values`].
    fn columns(&self) -> impl Iterator<Item = usize> + '_ {
        self.retained.iter().chain(&self.dependent).copied()
    }

    /// Its factors for the constants at which columns were reduced to `echelon`.
    fn values<const P: u64>(
        &self,
        echelon: &RowEchelonForm<P>,
    ) -> Result<Vec<FieldElement<P>>, DeriveError> {
        let entry = |p: usize, k: usize| echelon.entry(p, k).ok_or(DeriveError::RankChanged);
        let mut of_dependent = Vec::new();
        if !self.dependent.is_empty() {
            // Factors of the dependent columns from the rows of all retained ones that have no factor here.
            let mut rows = Vec::new();
            for p in &echelon.pivots {
                if self.retained.contains(p) {
                    continue;
                }
                let mut row = Vec::with_capacity(self.dependent.len() + 1);
                for k in &self.dependent {
                    row.push(entry(*p, *k)?);
                }
                row.push(-entry(*p, self.column)?);
                if row.iter().any(|x| *x != FieldElement::ZERO) {
                    rows.push(row);
                }
            }
            let solutions = eliminate::null_space(rows, self.dependent.len() + 1);
            let [solution] = solutions.as_slice() else {
                return Err(DeriveError::RankChanged);
            };
            let (last, rest) = solution.split_last().ok_or(DeriveError::RankChanged)?;
            let scale = last.inverse().ok_or(DeriveError::RankChanged)?;
            of_dependent.extend(rest.iter().map(|x| *x * scale));
        }
        let mut values = Vec::with_capacity(self.len());
        for p in &self.retained {
            let mut value = entry(*p, self.column)?;
            for (k, factor) in self.dependent.iter().zip(&of_dependent) {
                value = value - *factor * entry(*p, *k)?;
            }
            values.push(value);
        }
        values.extend(of_dependent);
        Ok(values)
    }
}

/// Relations for every dependent column, in an order in which each needs earlier columns only: to retained
/// columns, then, if they are fewer, to the columns before it that come last.
///
/// `order` is that in which columns are retained.
pub(super) fn find_relations<const P: u64>(
    echelon: &RowEchelonForm<P>,
    order: &[usize],
    dependent: &[usize],
) -> Vec<ColumnRelation> {
    let mut found = Vec::new();
    for (at, column) in order.iter().enumerate() {
        if !dependent.contains(column) {
            continue;
        }
        let mut direct: Vec<usize> = (echelon.pivots.iter().copied())
            .filter(|p| echelon.entry(*p, *column) != Some(FieldElement::ZERO))
            .collect();
        direct.sort_unstable();
        let near = needed_columns(echelon, &order[..at], *column);
        let is_shorter = near.len() < direct.len();
        for columns in [Some(direct), is_shorter.then_some(near)]
            .into_iter()
            .flatten()
        {
            let (dependent, retained) = columns.into_iter().partition(|k| dependent.contains(k));
            found.push(ColumnRelation {
                column: *column,
                retained,
                dependent,
            });
        }
    }
    found
}

/// The columns among those before `column` that it needs if the last ones are preferred.
fn needed_columns<const P: u64>(
    echelon: &RowEchelonForm<P>,
    before: &[usize],
    column: usize,
) -> Vec<usize> {
    /// Columns as vectors over the retained ones, each with what it is made of.
    struct ColumnCombination<const P: u64> {
        pivot: usize,
        vector: Vec<FieldElement<P>>,
        combination: BTreeMap<usize, FieldElement<P>>,
    }
    let mut known: Vec<ColumnCombination<P>> = Vec::new();
    let vector_of = |k: usize| -> Vec<FieldElement<P>> {
        let entries = echelon.pivots.iter().map(|p| echelon.entry(*p, k));
        entries.map(Option::unwrap_or_default).collect()
    };
    let reduced = |known: &[ColumnCombination<P>],
                   target: &mut Vec<FieldElement<P>>,
                   of: &mut BTreeMap<_, _>| {
        for one in known {
            let factor = -target[one.pivot];
            if factor == FieldElement::ZERO {
                continue;
            }
            for (x, y) in target.iter_mut().zip(&one.vector) {
                *x = *x + factor * *y;
            }
            for (k, y) in &one.combination {
                let x: &mut FieldElement<P> = of.entry(*k).or_default();
                *x = *x + factor * *y;
            }
        }
    };
    let (mut target, mut made) = (vector_of(column), BTreeMap::new());
    for &k in before.iter().rev() {
        let (mut vector, mut of) = (vector_of(k), BTreeMap::from([(k, FieldElement::ONE)]));
        reduced(&known, &mut vector, &mut of);
        let Some(pivot) = vector.iter().position(|x| *x != FieldElement::ZERO) else {
            continue;
        };
        let Some(scale) = vector[pivot].inverse() else {
            continue;
        };
        for x in vector.iter_mut().chain(of.values_mut()) {
            *x = *x * scale;
        }
        known.push(ColumnCombination {
            pivot,
            vector,
            combination: of,
        });
        let last = known.len() - 1;
        reduced(&known[last..], &mut target, &mut made);
        if target.iter().all(|x| *x == FieldElement::ZERO) {
            break;
        }
    }
    made.retain(|_, x| *x != FieldElement::ZERO);
    made.into_keys().collect()
}

/// Values of the factors of all relations, one after the other, from columns that were reduced to `echelon`.
pub(super) fn values<const P: u64>(
    relations: &[ColumnRelation],
    echelon: &RowEchelonForm<P>,
) -> Result<Vec<FieldElement<P>>, DeriveError> {
    let mut values = Vec::new();
    for relation in relations {
        values.extend(relation.values(echelon)?);
    }
    Ok(values)
}

/// The factors of a relation, from rows of values of all columns as they come.
pub(super) struct RelationRows<'a, const P: u64> {
    relation: &'a ColumnRelation,
    echelon: RowEchelonForm<P>,
    /// How many rows came when the factors were determined.
    n_more: usize,
}

impl<'a, const P: u64> RelationRows<'a, P> {
    pub(super) fn new(relation: &'a ColumnRelation) -> Self {
        let order: Vec<usize> = (0..=relation.len()).collect();
        Self {
            relation,
            echelon: RowEchelonForm::new(&order),
            n_more: 0,
        }
    }

    /// Takes further rows, as far as it needs them.
    pub(super) fn take(&mut self, rows: &[Vec<FieldElement<P>>]) {
        for row in rows {
            if self.is_confirmed() {
                break;
            }
            let columns = self.relation.columns().chain([self.relation.column]);
            let row: Vec<FieldElement<P>> = columns.map(|k| row[k]).collect();
            if row.iter().all(|x| *x == FieldElement::ZERO) {
                continue;
            }
            if self.echelon.pivots.len() == self.relation.len() {
                self.n_more += 1;
            }
            self.echelon.insert(row);
        }
    }

    /// Whether rows beyond those that determine the factors have shown that the relation holds.
    pub(super) fn is_confirmed(&self) -> bool {
        const MORE: usize = 2;
        self.n_more == MORE
    }

    /// The factors; an error if they are not determined, or rows contradict each other.
    pub(super) fn values(&self) -> Result<Vec<FieldElement<P>>, DeriveError> {
        let n = self.relation.len();
        // A pivot in the last column is a row that the others contradict.
        if self.echelon.pivots.len() != n || self.echelon.pivots.contains(&n) {
            return Err(DeriveError::RankChanged);
        }
        let entry = |k| self.echelon.entry(k, n).ok_or(DeriveError::RankChanged);
        (0..n).map(entry).collect()
    }
}

/// A dependent column by others, with factors; `None` for those that resist.
#[derive(Debug, PartialEq)]
pub(super) struct DependentColumn {
    pub(super) column: usize,
    /// Retained columns, and dependent ones that stand for what they equal.
    pub(super) factors: Vec<(usize, Option<RationalFunction>)>,
}

/// Relations with their factors as functions of the constants.
pub(super) struct SolvedRelations(Vec<(ColumnRelation, RelationFactors)>);

/// The factor of each column of a relation; `None` for those that resist.
type RelationFactors = Vec<Option<RationalFunction>>;

impl SolvedRelations {
    /// Takes the factors as [`values`] orders them.
    pub(super) fn new<'a>(
        relations: impl Iterator<Item = &'a ColumnRelation>,
        factors: RelationFactors,
    ) -> Self {
        let mut rest = factors.into_iter();
        let own = |relation: &ColumnRelation| {
            let factors = relation.columns().map(|_| rest.next().flatten());
            (relation.clone(), factors.collect())
        };
        Self(relations.map(own).collect())
    }

    /// Dependent columns whose relations to others that depend are not known, or hold quotients other than by lengths.
    pub(super) fn unwieldy_columns(&self) -> Vec<usize> {
        let is_simple = |f: &Option<RationalFunction>| {
            f.as_ref()
                .and_then(MonomialQuotient::from_function)
                .is_some()
        };
        let lines = self.0.iter();
        let unwieldy =
            lines.filter(|(r, factors)| !r.has_retained_only() && !factors.iter().all(is_simple));
        unwieldy.map(|(relation, _)| relation.column).collect()
    }

    /// Whether a factor on retained columns resists, so that no others need be looked for.
    pub(super) fn has_unknown_factor(&self) -> bool {
        let mut direct = self
            .0
            .iter()
            .filter(|(relation, _)| relation.has_retained_only());
        direct.any(|(_, factors)| factors.iter().any(Option::is_none))
    }

    /// Puts others in the place of relations of the same columns, if they are known.
    pub(super) fn replace(&mut self, others: Self) {
        let known =
            |(_, factors): &(ColumnRelation, RelationFactors)| factors.iter().all(Option::is_some);
        for other in others.0.into_iter().filter(known) {
            if let Some(line) = self.0.iter_mut().find(|(r, _)| r.column == other.0.column) {
                *line = other;
            }
        }
    }

    /// The wanted factors, each written out if that takes no quotients but by lengths (the lowest terms of others are not
    /// seen from their parts) and no roots that are not independent.
    pub(super) fn expanded_factors(
        &self,
        wanted: &[(usize, usize)],
        roots: &[i64],
    ) -> Vec<Option<RationalFunction>> {
        let mut expanded: BTreeMap<usize, RetainedFactors> = BTreeMap::new();
        for (relation, factors) in &self.0 {
            let line = if relation.has_retained_only() {
                RetainedFactors::from_relation(relation, factors)
            } else if are_independent(roots) {
                RetainedFactors::from_lines(relation, factors, &expanded)
            } else {
                RetainedFactors::default()
            };
            expanded.insert(relation.column, line);
        }
        let function = |j: &usize, p: &usize| expanded.get(j)?.functions.get(p).cloned();
        wanted.iter().map(|(j, p)| function(j, p)).collect()
    }

    /// How many terms the factors on retained columns have together when they are written out, at most.
    pub(super) fn n_terms(&self) -> usize {
        let mut counts: BTreeMap<usize, BTreeMap<usize, usize>> = BTreeMap::new();
        for (relation, factors) in &self.0 {
            let mut line: BTreeMap<usize, usize> = BTreeMap::new();
            for (k, factor) in relation.columns().zip(factors) {
                let n = factor.as_ref().map_or(1, |f| f.numerator.len());
                match counts.get(&k) {
                    None => *line.entry(k).or_default() += n,
                    Some(inner) => {
                        for (p, m) in inner {
                            let sum = line.entry(*p).or_default();
                            *sum = sum.saturating_add(n.saturating_mul(*m));
                        }
                    }
                }
            }
            counts.insert(relation.column, line);
        }
        let all = counts.values().flat_map(BTreeMap::values);
        all.fold(0_usize, |sum, n| sum.saturating_add(*n))
    }

    /// The relations as they are.
    pub(super) fn into_dependent_columns(self) -> Vec<DependentColumn> {
        let lines = self.0.into_iter();
        let written = |(relation, factors): (ColumnRelation, RelationFactors)| DependentColumn {
            column: relation.column,
            factors: relation.columns().zip(factors).collect(),
        };
        lines.map(written).collect()
    }

    /// Whether every factor is known.
    pub(super) fn is_complete(&self) -> bool {
        let mut all = self.0.iter().flat_map(|(_, factors)| factors);
        all.all(Option::is_some)
    }

    /// Values of some wanted factors; `None` where a denominator vanishes.
    pub(super) fn values<const P: u64>(
        &self,
        wanted: &[(usize, usize)],
        constants: &FieldPoint<FieldElement<P>>,
    ) -> Option<Vec<FieldElement<P>>> {
        let mut expanded: BTreeMap<usize, BTreeMap<usize, FieldElement<P>>> = BTreeMap::new();
        for (relation, factors) in &self.0 {
            let mut line: BTreeMap<usize, FieldElement<P>> = BTreeMap::new();
            let mut add = |p: usize, value: FieldElement<P>| {
                let sum = line.entry(p).or_default();
                *sum = *sum + value;
            };
            for (k, factor) in relation.columns().zip(factors) {
                let factor = factor.as_ref()?.value(constants)?;
                match expanded.get(&k) {
                    None => add(k, factor),
                    Some(inner) => inner.iter().for_each(|(p, x)| add(*p, factor * *x)),
                }
            }
            expanded.insert(relation.column, line);
        }
        let value = |j: &usize, p: &usize| expanded.get(j)?.get(p).copied();
        wanted.iter().map(|(j, p)| value(j, p)).collect()
    }
}

/// Whether all are prime, so that no product of different ones is a square: those that occur are small.
fn are_independent(roots: &[i64]) -> bool {
    let is_prime = |n: i64| n > 1 && (2..n).take_while(|d| d * d <= n).all(|d| n % d != 0);
    roots.iter().all(|n| is_prime(*n))
}

/// A column's factors on retained ones.
#[derive(Default)]
struct RetainedFactors {
    functions: BTreeMap<usize, RationalFunction>,
    /// The same as quotients; `None` if one of them is more than that.
    quotients: Option<BTreeMap<usize, MonomialQuotient>>,
}

impl RetainedFactors {
    fn from_relation(relation: &ColumnRelation, factors: &[Option<RationalFunction>]) -> Self {
        let pairs = relation.retained.iter().zip(factors);
        let quotients =
            (pairs.clone()).map(|(p, f)| Some((*p, MonomialQuotient::from_function(f.as_ref()?)?)));
        Self {
            quotients: quotients.collect(),
            functions: pairs.filter_map(|(p, f)| Some((*p, f.clone()?))).collect(),
        }
    }

    fn from_lines(
        relation: &ColumnRelation,
        factors: &[Option<RationalFunction>],
        expanded: &BTreeMap<usize, Self>,
    ) -> Self {
        let mut line: BTreeMap<usize, MonomialQuotient> = BTreeMap::new();
        for (k, factor) in relation.columns().zip(factors) {
            let Some(factor) = factor.as_ref().and_then(MonomialQuotient::from_function) else {
                return Self::default();
            };
            let Some(known) = expanded.get(&k) else {
                line.entry(k).or_default().add(&factor);
                continue;
            };
            let Some(inner) = &known.quotients else {
                return Self::default();
            };
            for (p, inner) in inner {
                line.entry(*p).or_default().add(&factor.times(inner));
            }
        }
        Self {
            functions: line.iter().map(|(p, q)| (*p, q.to_function())).collect(),
            quotients: Some(line),
        }
    }
}

/// A polynomial over a product of powers of lengths, in lowest terms but for common powers of lengths. No square of a
/// sine or root occurs, so that there is one way to write it.
#[derive(Clone, Debug, Default)]
struct MonomialQuotient {
    numerator: TrigonometricPolynomial,
    denominator: PowerProduct,
}

impl MonomialQuotient {
    /// `None` if the denominator is something else.
    fn from_function(function: &RationalFunction) -> Option<Self> {
        let mut terms = function.denominator.iter();
        let (Some((powers, scale)), None) = (terms.next(), terms.next()) else {
            return None;
        };
        let is_length = |(v, _): &(FactorVariable, u32)| matches!(v, FactorVariable::Constant(_));
        if !powers.iter().all(is_length) {
            return None;
        }
        let scale = scale.recip();
        let mut numerator = TrigonometricPolynomial::new();
        for (powers, k) in &function.numerator {
            add_term(&mut numerator, powers.clone(), &(k * &scale));
        }
        Some(Self {
            numerator,
            denominator: powers.clone(),
        })
    }

    fn times(&self, other: &Self) -> Self {
        let mut numerator = TrigonometricPolynomial::new();
        for (a, x) in &self.numerator {
            for (b, y) in &other.numerator {
                add_term(&mut numerator, product(a, b), &(x * y));
            }
        }
        Self {
            numerator,
            denominator: product(&self.denominator, &other.denominator),
        }
    }

    fn add(&mut self, other: &Self) {
        let common = least_common_multiple(&self.denominator, &other.denominator);
        if common != self.denominator {
            let missing = quotient(&common, &self.denominator);
            let numerator = std::mem::take(&mut self.numerator);
            let terms = numerator.into_iter();
            self.numerator = terms.map(|(p, k)| (product(&p, &missing), k)).collect();
            self.denominator = common;
        }
        let missing = quotient(&self.denominator, &other.denominator);
        for (powers, k) in &other.numerator {
            add_term(&mut self.numerator, product(powers, &missing), k);
        }
    }

    fn to_function(&self) -> RationalFunction {
        let denominator =
            TrigonometricPolynomial::from([(self.denominator.clone(), Rational::ONE)]);
        RationalFunction::new(self.numerator.clone(), denominator)
    }
}

/// The product of two products of powers, both sorted.
fn product(a: &PowerProduct, b: &PowerProduct) -> PowerProduct {
    merge_powers(a, b, |n, m| n + m)
}

fn least_common_multiple(a: &PowerProduct, b: &PowerProduct) -> PowerProduct {
    merge_powers(a, b, u32::max)
}

/// `a / b`, which must be a product of powers.
fn quotient(a: &PowerProduct, b: &PowerProduct) -> PowerProduct {
    merge_powers(a, b, |n, m| n - m)
}

fn merge_powers(
    a: &PowerProduct,
    b: &PowerProduct,
    exponent: impl Fn(u32, u32) -> u32,
) -> PowerProduct {
    let mut found = PowerProduct::with_capacity(a.len() + b.len());
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    loop {
        let next = match (a.peek(), b.peek()) {
            (None, None) => return found,
            (Some((v, _)), None) => *v,
            (None, Some((w, _))) => *w,
            (Some((v, _)), Some((w, _))) => *v.min(w),
        };
        let n = a.next_if(|(v, _)| *v == next).map_or(0, |(_, n)| *n);
        let m = b.next_if(|(w, _)| *w == next).map_or(0, |(_, m)| *m);
        let n = exponent(n, m);
        if n > 0 {
            found.push((next, n));
        }
    }
}

/// Adds a term with squares of sines and roots written otherwise.
fn add_term(to: &mut TrigonometricPolynomial, powers: PowerProduct, k: &Rational) {
    if k.is_zero() {
        return;
    }
    let squared = powers
        .iter()
        .position(|(v, n)| *n > 1 && matches!(v, FactorVariable::Sin(_) | FactorVariable::Root(_)));
    let Some(at) = squared else {
        let sum = to.entry(powers);
        match sum {
            std::collections::btree_map::Entry::Vacant(place) => _ = place.insert(k.clone()),
            std::collections::btree_map::Entry::Occupied(mut place) => {
                let total = place.get() + k;
                if total.is_zero() {
                    place.remove();
                } else {
                    place.insert(total);
                }
            }
        }
        return;
    };
    let (variable, n) = powers[at];
    let mut rest = powers;
    if n == 2 {
        rest.remove(at);
    } else {
        rest[at].1 = n - 2;
    }
    match variable {
        FactorVariable::Root(root) => add_term(to, rest, &(k * &Rational::integer(root))),
        FactorVariable::Sin(i) => {
            let with = product(&rest, &vec![(FactorVariable::Cos(i), 2)]);
            add_term(to, rest, k);
            add_term(to, with, &-k);
        }
        FactorVariable::Constant(_) | FactorVariable::Cos(_) => add_term(to, rest, k),
    }
}
