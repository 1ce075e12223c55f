//! Relations between columns that depend on each other as directly as possible, and the factors of eq. (6) combined
//! from them.
//!
//! A dependent column can often be written with a few near columns, which may depend on others in turn. The columns of
//! a link of an arm need only those of the link before it and the constants of the one joint between them (Gautier and
//! Khalil 1990). Its factors on the retained columns depend on all joints down to the base. So relations between
//! neighbours are reconstructed, and the factors are sums of their products.
//!
//! Decision: products of relations are multiplied out up to 150 terms of one base parameter; beyond that, base
//! parameters are given by named sums, link by link, if these are shorter. Polynomials over powers of lengths have one normal form, so this gives the same result
//! as a direct reconstruction. Other quotients are reconstructed again from the combined relation, which needs no
//! further points of motion.

use std::collections::BTreeMap;

use modelmill_algebra::eliminate::{self, RowEchelonForm};
use modelmill_algebra::field::{FieldElement, RandomStream};

use super::link_transfer::LinkTransfers;
use super::rational_function::{FactorVariable, PowerProduct, RationalFunction, TrigonometricPolynomial};
use super::tree_columns::{TreeColumns, TreeValues};
use super::trigonometric::{add_term, least_common_multiple, power_product, power_quotient};
use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{FieldPoint, Graph, Rational};
use crate::regressor::UnreducedEquations;

/// One column as a combination of others, all numbered among the columns with an effect.
#[derive(Clone, Debug)]
pub(super) struct ColumnRelation {
    /// The column that the relation expresses.
    pub(super) column: usize,
    /// Retained columns in the combination.
    retained: Vec<usize>,
    /// Dependent columns in the combination, which have relations before this one.
    pub(super) dependent: Vec<usize>,
    /// Whether its factors follow from the links of a tree alone, without points of motion.
    pub(super) is_in_tree: bool,
    /// Its factors, if they are known without reconstruction.
    pub(super) factors: Option<Vec<RationalFunction>>,
}

impl ColumnRelation {
    /// Number of its factors.
    pub(super) fn len(&self) -> usize {
        self.retained.len() + self.dependent.len()
    }

    /// Whether it contains retained columns only.
    pub(super) fn has_retained_only(&self) -> bool {
        self.dependent.is_empty()
    }

    /// A relation whose factors are known; `dependent` are all dependent columns.
    fn from_factors(column: usize, factors: Vec<(usize, RationalFunction)>, dependent: &[usize]) -> Self {
        let mut factors = factors;
        factors.sort_by_key(|(k, _)| (dependent.contains(k), *k));
        let (others, retained): (Vec<usize>, Vec<usize>) =
            factors.iter().map(|(k, _)| *k).partition(|k| dependent.contains(k));
        Self {
            column,
            retained,
            dependent: others,
            is_in_tree: false,
            factors: Some(factors.into_iter().map(|(_, factor)| factor).collect()),
        }
    }

    /// Whether its known factors combine columns that were reduced to `echelon` at the same constants.
    fn has_values_of<const P: u64>(
        &self,
        constants: &FieldPoint<FieldElement<P>>,
        echelon: &RowEchelonForm<P>,
    ) -> bool {
        let factors = self.factors.iter().flatten().map(|factor| factor.value(constants));
        let Some(factors) = factors.collect::<Option<Vec<FieldElement<P>>>>() else {
            return false;
        };
        echelon.pivots.iter().all(|p| {
            let entry = |k: usize| echelon.entry(*p, k).unwrap_or_default();
            let terms = self.columns().zip(&factors);
            let sum = terms.fold(FieldElement::ZERO, |sum, (k, factor)| sum + *factor * entry(k));
            sum == entry(self.column)
        })
    }

    /// Determines whether the links of a tree give the factors that the columns have at the constants of `values`, at
    /// which columns were reduced to `echelon`.
    pub(super) fn compare_with_tree<const P: u64>(
        &mut self,
        tree: &TreeColumns,
        values: &TreeValues<P>,
        echelon: &RowEchelonForm<P>,
    ) {
        let columns: Vec<usize> = self.columns().collect();
        let is_known = tree.n_links(columns.iter().copied().chain([self.column])).is_some();
        let found = is_known.then(|| tree.relation_factors(values, &columns, self.column));
        // The combination must be the column itself, entry by entry.
        self.is_in_tree = found.flatten().is_some_and(|factors| {
            echelon.pivots.iter().all(|p| {
                let entry = |k: usize| echelon.entry(*p, k).unwrap_or_default();
                let terms = columns.iter().zip(&factors);
                let sum = terms.fold(FieldElement::ZERO, |sum, (k, factor)| sum + *factor * entry(*k));
                sum == entry(self.column)
            })
        });
    }

    /// Its factors from the links of a tree.
    ///
    /// # Errors
    /// [`DeriveError::RankChanged`] if the links have other dependences at these constants.
    pub(super) fn tree_factors<const P: u64>(
        &self,
        tree: &TreeColumns,
        values: &TreeValues<P>,
    ) -> Result<Vec<FieldElement<P>>, DeriveError> {
        let columns: Vec<usize> = self.columns().collect();
        let found = tree.relation_factors(values, &columns, self.column);
        found.ok_or(DeriveError::RankChanged)
    }

    /// The columns of its factors, in the order of [`Self::values`].
    pub(super) fn columns(&self) -> impl Iterator<Item = usize> + '_ {
        self.retained.iter().chain(&self.dependent).copied()
    }

    /// Its factors for the constants at which columns were reduced to `echelon`.
    ///
    /// # Errors
    /// [`DeriveError::RankChanged`] if the columns have other dependences at these constants.
    fn values<const P: u64>(&self, echelon: &RowEchelonForm<P>) -> Result<Vec<FieldElement<P>>, DeriveError> {
        let entry = |p: usize, k: usize| echelon.entry(p, k).ok_or(DeriveError::RankChanged);
        let mut of_dependent = Vec::new();
        if !self.dependent.is_empty() {
            // The factors of dependent columns must cancel all retained columns that are not in the relation.
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
            // The solution must be unique up to a scale, which is set by the column itself.
            let solutions = eliminate::null_space(rows, self.dependent.len() + 1);
            let [solution] = solutions.as_slice() else {
                return Err(DeriveError::RankChanged);
            };
            let (last, rest) = solution.split_last().ok_or(DeriveError::RankChanged)?;
            let scale = last.inverse().ok_or(DeriveError::RankChanged)?;
            of_dependent.extend(rest.iter().map(|x| *x * scale));
        }
        // The factors of retained columns are the remainder.
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

/// Relations for every dependent column, in an order in which each needs only earlier columns. The relation to retained
/// columns comes first. If fewer columns are sufficient, a relation to the last columns before this one follows.
///
/// In a tree, the last columns are those of the nearest links, and their relation also follows if it involves fewer links.
/// Relations that `transfers` between links give take their place.
///
/// `order` is the order in which columns are retained, and `constants` are those at which columns were reduced.
pub(super) fn find_relations<const P: u64>(
    echelon: &RowEchelonForm<P>,
    structure: &TreeStructure,
    constants: &FieldPoint<FieldElement<P>>,
    order: &[usize],
    dependent: &[usize],
) -> Vec<ColumnRelation> {
    let tree = structure.columns.as_ref();
    let mut found = Vec::new();
    // Columns that are not in the order come last.
    let n = order.iter().max().map_or(0, |most| most + 1);
    let mut positions = vec![usize::MAX; n.max(structure.n_columns)];
    for (at, column) in order.iter().enumerate() {
        positions[*column] = at;
    }
    for (at, column) in order.iter().enumerate() {
        if !dependent.contains(column) {
            continue;
        }
        // Retained columns with a factor that is not zero.
        let mut direct: Vec<usize> = (echelon.pivots.iter().copied())
            .filter(|p| echelon.entry(*p, *column) != Some(FieldElement::ZERO))
            .collect();
        direct.sort_unstable();
        let transferred = structure.transfers.as_ref().and_then(|transfers| {
            let factors = transfers.relation(*column, &positions)?;
            let relation = ColumnRelation::from_factors(*column, factors, dependent);
            relation.has_values_of(constants, echelon).then_some(relation)
        });
        if let Some(relation) = transferred {
            if !relation.has_retained_only() {
                let retained = direct;
                found.push(ColumnRelation {
                    column: *column,
                    retained,
                    dependent: Vec::new(),
                    is_in_tree: false,
                    factors: None,
                });
            }
            found.push(relation);
            continue;
        }
        let nearest: Vec<usize> = match tree {
            Some(tree) => tree.nearest_first(*column, &order[..at]),
            None => order[..at].iter().rev().copied().collect(),
        };
        let near = needed_columns(echelon, &nearest, *column);
        let n_links = |columns: &[usize]| tree.and_then(|tree| tree.n_links(columns.iter().copied().chain([*column])));
        let has_fewer_links = n_links(&near)
            .zip(n_links(&direct))
            .is_some_and(|(near, direct)| near < direct);
        let is_shorter = near.len() < direct.len() || has_fewer_links;
        for columns in [Some(direct), is_shorter.then_some(near)].into_iter().flatten() {
            let (dependent, retained) = columns.into_iter().partition(|k| dependent.contains(k));
            found.push(ColumnRelation {
                column: *column,
                retained,
                dependent,
                is_in_tree: false,
                factors: None,
            });
        }
    }
    found
}

/// The columns among `candidates` that express `column` if the first ones are preferred.
fn needed_columns<const P: u64>(echelon: &RowEchelonForm<P>, candidates: &[usize], column: usize) -> Vec<usize> {
    /// A column as a vector over the retained ones, with the combination of columns that it equals.
    struct ColumnCombination<const P: u64> {
        /// Position of its first entry that is not zero, which is 1.
        pivot: usize,
        /// Entries by retained column.
        vector: Vec<FieldElement<P>>,
        /// Columns with their factors.
        combination: BTreeMap<usize, FieldElement<P>>,
    }
    let mut known: Vec<ColumnCombination<P>> = Vec::new();
    // A column as a vector over the retained ones.
    let vector_of = |k: usize| -> Vec<FieldElement<P>> {
        let entries = echelon.pivots.iter().map(|p| echelon.entry(*p, k));
        entries.map(Option::unwrap_or_default).collect()
    };
    // Eliminates the known pivots from a vector, and applies the same steps to its combination.
    let reduced = |known: &[ColumnCombination<P>], target: &mut Vec<FieldElement<P>>, of: &mut BTreeMap<_, _>| {
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
    // The target is reduced by one column after the other, until nothing of it remains.
    let (mut target, mut made) = (vector_of(column), BTreeMap::new());
    for &k in candidates {
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

/// What is known about the columns of an open tree from its links.
pub(super) struct TreeStructure {
    /// Number of effective columns.
    n_columns: usize,
    /// Spaces of the links; `None` unless every link has a coordinate of its own.
    pub(super) columns: Option<TreeColumns>,
    /// Inertia that moves between links; `None` with loops.
    transfers: Option<LinkTransfers>,
}

impl TreeStructure {
    /// Prepares the columns in `effective`.
    pub(super) fn new(graph: &mut Graph, equations: &UnreducedEquations, effective: &[usize]) -> Self {
        let mut stream = RandomStream::new(SEED);
        Self {
            n_columns: effective.len(),
            columns: TreeColumns::new(graph, equations, effective, &mut stream),
            transfers: LinkTransfers::new(graph, equations, effective),
        }
    }
}

/// Values of the factors of all relations in order, from columns that were reduced to `echelon`.
///
/// # Errors
/// As [`ColumnRelation::values`].
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
    /// Where its columns stand in the rows, its own column last.
    places: Vec<usize>,
    echelon: RowEchelonForm<P>,
    /// How many rows came when the factors were determined.
    n_more: usize,
}

impl<'a, const P: u64> RelationRows<'a, P> {
    /// A relation of which no row is known; rows consist of the given columns, which are in ascending order.
    pub(super) fn new(relation: &'a ColumnRelation, columns: &[usize]) -> Self {
        let order: Vec<usize> = (0..=relation.len()).collect();
        let places = (relation.columns().chain([relation.column]))
            .map(|column| columns.binary_search(&column).expect("a column of the rows"))
            .collect();
        Self {
            relation,
            places,
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
            let row: Vec<FieldElement<P>> = self.places.iter().map(|k| row[*k]).collect();
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

/// A dependent column as a combination of others; factors that could not be reconstructed are `None`.
#[derive(Debug, PartialEq)]
pub(super) struct DependentColumn {
    /// The column.
    pub(super) column: usize,
    /// Factors of retained columns, and of dependent ones that are combinations themselves.
    pub(super) factors: Vec<(usize, Option<RationalFunction>)>,
}

/// Relations with their factors as functions of the constants, in an order in which each needs only earlier columns.
pub(super) struct SolvedRelations(Vec<(ColumnRelation, RelationFactors)>);

/// The factor of each column of a relation; `None` if it could not be reconstructed.
type RelationFactors = Vec<Option<RationalFunction>>;

impl SolvedRelations {
    /// Assigns factors, in the order of [`values`], to the relations.
    pub(super) fn new<'a>(relations: impl Iterator<Item = &'a ColumnRelation>, factors: RelationFactors) -> Self {
        let mut rest = factors.into_iter();
        let own = |relation: &ColumnRelation| {
            let factors = relation.columns().map(|_| rest.next().flatten());
            (relation.clone(), factors.collect())
        };
        Self(relations.map(own).collect())
    }

    /// Dependent columns whose relations to other dependent columns are unknown, or have denominators other than
    /// lengths.
    pub(super) fn unwieldy_columns(&self) -> Vec<usize> {
        let is_simple = |f: &Option<RationalFunction>| f.as_ref().and_then(MonomialQuotient::from_function).is_some();
        let lines = self.0.iter();
        let unwieldy = lines.filter(|(r, factors)| !r.has_retained_only() && !factors.iter().all(is_simple));
        unwieldy.map(|(relation, _)| relation.column).collect()
    }

    /// Dependent columns whose relations to other dependent columns have no finite value at given constants.
    pub(super) fn undefined_columns(&self, constants: &[f64]) -> Vec<usize> {
        let is_finite = |f: &Option<RationalFunction>| f.as_ref().is_none_or(|f| f.value_f64(constants).is_finite());
        let lines = self.0.iter();
        let undefined = lines.filter(|(r, factors)| !r.has_retained_only() && !factors.iter().all(is_finite));
        undefined.map(|(relation, _)| relation.column).collect()
    }

    /// Columns of which a factor is unknown.
    pub(super) fn incomplete_columns(&self) -> Vec<usize> {
        let lines = self.0.iter();
        let incomplete = lines.filter(|(_, factors)| factors.iter().any(Option::is_none));
        incomplete.map(|(relation, _)| relation.column).collect()
    }

    /// Whether a factor on retained columns could not be reconstructed, so that the others are of no use.
    pub(super) fn has_unknown_factor(&self) -> bool {
        let mut direct = self.0.iter().filter(|(relation, _)| relation.has_retained_only());
        direct.any(|(_, factors)| factors.iter().any(Option::is_none))
    }

    /// Replaces relations by others of the same columns, as far as these are completely known.
    pub(super) fn replace(&mut self, others: Self) {
        let known = |(_, factors): &(ColumnRelation, RelationFactors)| factors.iter().all(Option::is_some);
        for other in others.0.into_iter().filter(known) {
            if let Some(line) = self.0.iter_mut().find(|(r, _)| r.column == other.0.column) {
                *line = other;
            }
        }
    }

    /// The wanted factors, each multiplied out if all denominators are products of lengths and all roots are
    /// independent. Other factors are `None`, because their lowest terms cannot be determined from their parts.
    pub(super) fn expanded_factors(&self, wanted: &[(usize, usize)], roots: &[i64]) -> Vec<Option<RationalFunction>> {
        // Columns in order, so that the factors of dependent columns in a relation are already expanded.
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

    /// Whether the relations have fewer terms than the factors on retained columns after multiplication, and one
    /// retained column then has more than `most_terms`. Terms that cancel are counted.
    pub(super) fn is_shorter_nested(&self, most_terms: usize) -> bool {
        let mut nested = 0_usize;
        let mut counts: BTreeMap<usize, BTreeMap<usize, usize>> = BTreeMap::new();
        for (relation, factors) in &self.0 {
            let mut line: BTreeMap<usize, usize> = BTreeMap::new();
            for (k, factor) in relation.columns().zip(factors) {
                // Terms of a product of polynomials multiply, terms of sums add up.
                let n = factor.as_ref().map_or(1, |f| f.numerator.len());
                nested = nested.saturating_add(n);
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
        // Terms by retained column, each of which becomes a base parameter.
        let mut expanded: BTreeMap<usize, usize> = BTreeMap::new();
        for (p, n) in counts.values().flatten() {
            let sum = expanded.entry(*p).or_default();
            *sum = sum.saturating_add(*n);
        }
        let all = expanded.values().fold(0_usize, |sum, n| sum.saturating_add(*n));
        nested < all && expanded.values().any(|n| *n > most_terms)
    }

    /// The relations without expansion.
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

    /// Values of wanted factors for given constants; `None` where a denominator vanishes.
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

/// Whether all radicands are prime, so that no product of different roots is rational. A short search is sufficient,
/// because the radicands that occur are small.
fn are_independent(roots: &[i64]) -> bool {
    let is_prime = |n: i64| n > 1 && (2..n).take_while(|d| d * d <= n).all(|d| n % d != 0);
    roots.iter().all(|n| is_prime(*n))
}

/// The factors of a column on retained columns.
#[derive(Default)]
struct RetainedFactors {
    /// Factors that are known, by retained column.
    functions: BTreeMap<usize, RationalFunction>,
    /// The same as polynomials over products of lengths; `None` if one of them has another form.
    quotients: Option<BTreeMap<usize, MonomialQuotient>>,
}

impl RetainedFactors {
    /// The factors of a relation that contains retained columns only.
    fn from_relation(relation: &ColumnRelation, factors: &[Option<RationalFunction>]) -> Self {
        let pairs = relation.retained.iter().zip(factors);
        let quotients = (pairs.clone()).map(|(p, f)| Some((*p, MonomialQuotient::from_function(f.as_ref()?)?)));
        Self {
            quotients: quotients.collect(),
            functions: pairs.filter_map(|(p, f)| Some((*p, f.clone()?))).collect(),
        }
    }

    /// The factors of a relation whose dependent columns are expanded already; without factors if any form is
    /// unsuitable.
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

/// A polynomial divided by a product of powers of lengths, in lowest terms except for common powers of lengths. It
/// contains no square of a sine or root, so its form is unique.
#[derive(Clone, Debug, Default)]
struct MonomialQuotient {
    /// The polynomial.
    numerator: TrigonometricPolynomial,
    /// Powers of lengths.
    denominator: PowerProduct,
}

impl MonomialQuotient {
    /// Converts a function; `None` if its denominator is no product of lengths.
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

    /// The product.
    fn times(&self, other: &Self) -> Self {
        let mut numerator = TrigonometricPolynomial::new();
        for (a, x) in &self.numerator {
            for (b, y) in &other.numerator {
                add_term(&mut numerator, power_product(a, b), &(x * y));
            }
        }
        Self {
            numerator,
            denominator: power_product(&self.denominator, &other.denominator),
        }
    }

    /// Adds another quotient, over the common denominator.
    fn add(&mut self, other: &Self) {
        let common = least_common_multiple(&self.denominator, &other.denominator);
        if common != self.denominator {
            let missing = power_quotient(&common, &self.denominator);
            let numerator = std::mem::take(&mut self.numerator);
            let terms = numerator.into_iter();
            self.numerator = terms.map(|(p, k)| (power_product(&p, &missing), k)).collect();
            self.denominator = common;
        }
        let missing = power_quotient(&self.denominator, &other.denominator);
        for (powers, k) in &other.numerator {
            add_term(&mut self.numerator, power_product(powers, &missing), k);
        }
    }

    /// Converts to a general rational function in lowest terms.
    fn to_function(&self) -> RationalFunction {
        let denominator = TrigonometricPolynomial::from([(self.denominator.clone(), Rational::ONE)]);
        RationalFunction::new(self.numerator.clone(), denominator)
    }
}
