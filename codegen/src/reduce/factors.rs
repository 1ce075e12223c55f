//! The factors of eq. (6) as rational functions of the constants. Simple relations between columns are reconstructed
//! from points of motion, and the factors are combined from these.

use std::collections::BTreeSet;

use modelmill_algebra::field::{FieldElement, RandomStream};

use super::dependences::DependenceStructure;
use super::oracle::{ConstantOccurrence, OperationBudget, PrimeFieldOracle};
use super::rational_function::RationalFunction;
use super::reconstruct::{self, DependenceSurvey, FunctionNeed};
use super::relations::{self, ColumnRelation, DependentColumn, RelationRows, SolvedRelations, TreeStructure};
use super::sample::{ColumnEvaluation, SampledRegressor};
use super::tree_columns::TreeColumns;
use crate::DeriveError;
use crate::expr::FieldPoint;
use crate::stop::StopRequest;

/// Largest number of field operations for the factors, which takes about a minute.
pub(super) const MOST_OPERATIONS: u64 = 20_000_000_000;

/// Relations to retained columns that are not longer than this are used directly.
const FEW: usize = 12;

/// Above this number of terms in one base parameter, columns are written by neighbouring columns where that is shorter.
/// A parameter of so many terms takes some 2000 characters, more than a reader can check. By judgement.
const MOST_TERMS: usize = 150;

/// The dependent columns as combinations of others. Factors that cannot be reconstructed are `None`.
pub(super) fn find_factors(
    mut search: FactorSearch<'_>,
    stream: &mut RandomStream,
) -> Result<Vec<DependentColumn>, DeriveError> {
    let dependences = search.dependences;
    if dependences.wanted.is_empty() {
        return Ok(Vec::new());
    }
    // Relations to retained columns only.
    let direct: Vec<ColumnRelation> = (dependences.relations.iter())
        .filter(|relation| relation.has_retained_only())
        .cloned()
        .collect();
    let mut by = |relations: &[ColumnRelation]| factors_by_relations(relations, &mut search, stream);
    match by(&dependences.relations) {
        // Which columns are near may depend on the constants, for example with roots of either sign.
        Err(DeriveError::RankChanged) if direct.len() < dependences.relations.len() => by(&direct),
        found => found,
    }
}

/// Number of factors on retained columns with a sum in a denominator.
pub(super) fn n_quotients(
    dependences: &DependenceStructure,
    regressor: &SampledRegressor,
    tree: &TreeStructure,
    variables: &[ConstantOccurrence],
    stop: StopRequest<'_>,
    stream: &mut RandomStream,
) -> Result<usize, DeriveError> {
    let direct = dependences.relations.iter().filter(|r| r.has_retained_only());
    let direct: Vec<ColumnRelation> = direct.cloned().collect();
    // Only relations to retained columns have factors on retained columns. Factors that are known are polynomials.
    let direct = direct.into_iter().filter(|r| r.factors.is_none());
    let (in_tree, others): (Vec<ColumnRelation>, Vec<ColumnRelation>) = direct.partition(|r| r.is_in_tree);
    let mut budget = OperationBudget::new(MOST_OPERATIONS, stop);
    let mut found = 0;
    if let Some(tree) = tree.columns.as_ref().filter(|_| !in_tree.is_empty()) {
        let mut oracle = TreeFactorOracle {
            regressor,
            tree,
            relations: &in_tree,
            budget: &mut budget,
        };
        found += reconstruct::n_quotients(&mut oracle, variables, stream)?;
    }
    if !others.is_empty() {
        let mut oracle = MotionFactorOracle::new(regressor, dependences, &others, stream, &mut budget);
        found += reconstruct::n_quotients(&mut oracle, variables, stream)?;
    }
    Ok(found)
}

/// The dependent columns from given relations, which include those to retained columns.
fn factors_by_relations(
    all: &[ColumnRelation],
    search: &mut FactorSearch<'_>,
    stream: &mut RandomStream,
) -> Result<Vec<DependentColumn>, DeriveError> {
    let mut related = nearest_relations(all, search, stream)?;
    // A near relation may be complicated: if the first joints of an arm have no effect on all of a link, relations
    // between links divide by sines of twists, and relations to retained columns do not.
    let is_long = related.is_complete() && related.is_shorter_nested(MOST_TERMS);
    let unwieldy = related.unwieldy_columns();
    // At the file's values a pivot of a near relation may vanish, for example at lengths that are equal on both sides.
    let undefined = related.undefined_columns(search.values);
    let direct: Vec<ColumnRelation> = (all.iter())
        .filter(|r| r.has_retained_only() && unwieldy.contains(&r.column))
        .filter(|r| !is_long || r.len() <= FEW || undefined.contains(&r.column))
        .cloned()
        .collect();
    search.replace_relations(&mut related, &direct, stream)?;
    // Too many terms: columns are written by near columns.
    if is_long {
        return Ok(related.into_dependent_columns());
    }
    let (wanted, roots) = (&search.dependences.wanted, search.roots);
    let mut written = related.expanded_factors(wanted, roots);
    // Factors that cannot be multiplied out are reconstructed from the combined relations.
    let missing: Vec<usize> = (0..written.len()).filter(|k| written[*k].is_none()).collect();
    if !missing.is_empty() && related.is_complete() {
        let mut rest = RelationFactorOracle {
            related: &related,
            regressor: search.regressor,
            wanted: missing.iter().map(|k| wanted[*k]).collect(),
            budget: &mut search.budget,
        };
        let found = reconstruct::reconstruct(&mut rest, search.variables, roots, stream)?;
        for (k, function) in missing.into_iter().zip(found) {
            written[k] = function;
        }
    }
    // Every factor on a retained column becomes a line of its own.
    let pairs = wanted.iter().zip(written);
    let line = |((column, p), factor): (&(usize, usize), _)| DependentColumn {
        column: *column,
        factors: vec![(*p, factor)],
    };
    Ok(pairs.map(line).collect())
}

/// The relations to near columns where there are any, and to retained columns elsewhere.
///
/// Factors of a near relation may have hundreds of terms although the relation to retained columns is short. Both give
/// the same factors in the end. So long factors are reconstructed only if the short relation fails.
fn nearest_relations(
    all: &[ColumnRelation],
    search: &mut FactorSearch<'_>,
    stream: &mut RandomStream,
) -> Result<SolvedRelations, DeriveError> {
    let short_direct: Vec<&ColumnRelation> = (all.iter())
        .filter(|r| r.has_retained_only() && r.len() <= FEW)
        .collect();
    let may_wait = |r: &ColumnRelation| !r.has_retained_only() && short_direct.iter().any(|d| d.column == r.column);
    // The relation to near columns comes directly after the one to retained columns.
    let nearest = (0..all.len()).filter(|i| all.get(i + 1).is_none_or(ColumnRelation::has_retained_only));
    let nearest: Vec<ColumnRelation> = nearest.map(|i| all[i].clone()).collect();
    let mut related = search.solve_relations(&nearest, may_wait, stream)?;
    let open = related.incomplete_columns();
    let direct = short_direct.iter().filter(|r| open.contains(&r.column));
    let direct: Vec<ColumnRelation> = direct.map(|r| (*r).clone()).collect();
    search.replace_relations(&mut related, &direct, stream)?;
    let open = related.incomplete_columns();
    let waiting = nearest.iter().filter(|r| open.contains(&r.column) && may_wait(r));
    let waiting: Vec<ColumnRelation> = waiting.cloned().collect();
    search.replace_relations(&mut related, &waiting, stream)?;
    Ok(related)
}

/// What all reconstructions of the factors of relations share.
pub(super) struct FactorSearch<'a> {
    /// The dependences between columns.
    pub(super) dependences: &'a DependenceStructure,
    /// The regressor's columns at random points.
    pub(super) regressor: &'a SampledRegressor,
    /// What the links of a tree tell about their columns.
    pub(super) tree: &'a TreeStructure,
    /// Constants on which factors may depend.
    pub(super) variables: &'a [ConstantOccurrence],
    /// Integers whose square roots factors may contain.
    pub(super) roots: &'a [i64],
    /// Values of all constants in the file, at which factors should be finite.
    pub(super) values: &'a [f64],
    /// Remaining field operations.
    pub(super) budget: OperationBudget<'a>,
}

impl FactorSearch<'_> {
    /// Reconstructs the factors of some relations. Factors with many terms are left out where a relation `may_wait`.
    fn solve_relations(
        &mut self,
        chosen: &[ColumnRelation],
        may_wait: impl Fn(&ColumnRelation) -> bool,
        stream: &mut RandomStream,
    ) -> Result<SolvedRelations, DeriveError> {
        // Relations between the links of a tree need no points of motion.
        let unknown = chosen.iter().filter(|r| r.factors.is_none()).cloned();
        let (in_tree, others): (Vec<ColumnRelation>, Vec<ColumnRelation>) = unknown.partition(|r| r.is_in_tree);
        let mut of_tree = Vec::new();
        if let Some(tree) = self.tree.columns.as_ref().filter(|_| !in_tree.is_empty()) {
            let mut oracle = TreeFactorOracle {
                regressor: self.regressor,
                tree,
                relations: &in_tree,
                budget: &mut self.budget,
            };
            of_tree = reconstruct_factors(&mut oracle, &in_tree, &may_wait, self.variables, self.roots, stream)?;
        }
        let mut of_others = Vec::new();
        if !others.is_empty() {
            let (regressor, dependences) = (self.regressor, self.dependences);
            let mut oracle = MotionFactorOracle::new(regressor, dependences, &others, stream, &mut self.budget);
            of_others = reconstruct_factors(&mut oracle, &others, &may_wait, self.variables, self.roots, stream)?;
        }
        // Back in the order of the relations.
        let (mut of_tree, mut of_others) = (of_tree.into_iter(), of_others.into_iter());
        let mut factors = Vec::new();
        for relation in chosen {
            if let Some(known) = &relation.factors {
                factors.extend(known.iter().cloned().map(Some));
                continue;
            }
            let source = if relation.is_in_tree {
                &mut of_tree
            } else {
                &mut of_others
            };
            factors.extend(source.take(relation.len()));
        }
        Ok(SolvedRelations::new(chosen.iter(), factors))
    }

    /// Replaces relations by others of the same columns, as far as the factors of these can be reconstructed.
    fn replace_relations(
        &mut self,
        related: &mut SolvedRelations,
        others: &[ColumnRelation],
        stream: &mut RandomStream,
    ) -> Result<(), DeriveError> {
        if !others.is_empty() && !related.has_unknown_factor() {
            related.replace(self.solve_relations(others, |_| false, stream)?);
        }
        Ok(())
    }
}

/// Reconstructs the factors of relations, one relation after the other. Factors with many terms are left out where a
/// relation `may_wait`.
fn reconstruct_factors<O: PrimeFieldOracle>(
    oracle: &mut O,
    relations: &[ColumnRelation],
    may_wait: &dyn Fn(&ColumnRelation) -> bool,
    variables: &[ConstantOccurrence],
    roots: &[i64],
    stream: &mut RandomStream,
) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
    let mut survey = DependenceSurvey::new(oracle, variables, roots, stream)?;
    // A relation to retained columns is needed by all that use its column.
    let of_relation = |r: &ColumnRelation| {
        let need = match (r.has_retained_only(), may_wait(r)) {
            (true, _) => FunctionNeed::ByOthers,
            (_, true) => FunctionNeed::IfShort,
            (_, false) => FunctionNeed::ByItself,
        };
        std::iter::repeat_n(need, r.len())
    };
    let wanted: Vec<(usize, FunctionNeed)> = relations.iter().flat_map(of_relation).enumerate().collect();
    survey.reconstruct_functions(oracle, &wanted, stream)
}

/// Evaluates the factors of relations from the links of a tree.
struct TreeFactorOracle<'a, 'b> {
    /// Source of constants at which all functions exist.
    regressor: &'a SampledRegressor,
    /// The links.
    tree: &'a TreeColumns,
    /// Relations whose factors are evaluated.
    relations: &'a [ColumnRelation],
    /// Remaining field operations.
    budget: &'a mut OperationBudget<'b>,
}

impl PrimeFieldOracle for TreeFactorOracle<'_, '_> {
    fn constants<const P: u64>(&self, stream: &mut RandomStream) -> Result<FieldPoint<FieldElement<P>>, DeriveError> {
        self.regressor.sampler.constants(stream)
    }

    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<FieldElement<P>>,
    ) -> Result<Vec<FieldElement<P>>, DeriveError> {
        // An estimate: the spaces of a link take some 10^4 operations, and so does a relation.
        self.charge(10_000 * (self.tree.n_all_links() + self.relations.len()))?;
        let values = self.tree.evaluate(constants).ok_or(DeriveError::RankChanged)?;
        let mut factors = Vec::new();
        for relation in self.relations {
            factors.extend(relation.tree_factors(self.tree, &values)?);
        }
        Ok(factors)
    }

    fn charge(&mut self, operations: usize) -> Result<(), DeriveError> {
        self.budget.spend(operations)
    }
}

/// Evaluates the factors of relations from points of motion.
struct MotionFactorOracle<'a, 'b> {
    /// The regressor's columns at random points.
    regressor: &'a SampledRegressor,
    /// Dependences that the columns must show again.
    dependences: &'a DependenceStructure,
    /// Relations whose factors are evaluated.
    relations: &'a [ColumnRelation],
    /// The columns of these relations, in ascending order.
    columns: Vec<usize>,
    /// Evaluates these columns alone: a relation between few links needs a small part of the regressor.
    evaluation: ColumnEvaluation,
    /// Random numbers for the points.
    sampling: RandomStream,
    /// Remaining field operations.
    budget: &'a mut OperationBudget<'b>,
}

impl<'a, 'b> MotionFactorOracle<'a, 'b> {
    /// Evaluates the factors of relations at points that `stream` draws.
    fn new(
        regressor: &'a SampledRegressor,
        dependences: &'a DependenceStructure,
        relations: &'a [ColumnRelation],
        stream: &RandomStream,
        budget: &'a mut OperationBudget<'b>,
    ) -> Self {
        let columns: BTreeSet<usize> = (relations.iter())
            .flat_map(|relation| relation.columns().chain([relation.column]))
            .collect();
        let columns: Vec<usize> = columns.into_iter().collect();
        Self {
            regressor,
            dependences,
            relations,
            evaluation: regressor.evaluation_of(&columns),
            columns,
            sampling: stream.clone(),
            budget,
        }
    }
}

impl PrimeFieldOracle for MotionFactorOracle<'_, '_> {
    fn constants<const P: u64>(&self, stream: &mut RandomStream) -> Result<FieldPoint<FieldElement<P>>, DeriveError> {
        self.regressor.sampler.constants(stream)
    }

    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<FieldElement<P>>,
    ) -> Result<Vec<FieldElement<P>>, DeriveError> {
        // Two ways: eliminate all columns at once, or each relation from its own columns. The cheaper one is used.
        let rank = self.dependences.pivots.len();
        let at_once = rank * rank * self.regressor.n_columns;
        let one_by_one: usize = self.relations.iter().map(|r| (r.len() + 1).pow(3)).sum();
        self.charge(at_once.min(one_by_one))?;
        // One relation at a time: its columns at no more points than the survey of dependences used.
        if one_by_one < at_once {
            // Few points are enough for relations between few columns.
            let rows_of = |relation| RelationRows::new(relation, &self.columns);
            let mut open: Vec<RelationRows<P>> = self.relations.iter().map(rows_of).collect();
            for _ in 0..self.dependences.n_points {
                if open.iter().all(RelationRows::is_confirmed) {
                    break;
                }
                let rows = (self.regressor).draw_rows_of(&self.evaluation, constants, &mut self.sampling)?;
                for relation in &mut open {
                    relation.take(&rows);
                }
            }
            let values = open.iter().map(RelationRows::values);
            return Ok(values.collect::<Result<Vec<_>, _>>()?.concat());
        }
        let (echelon, _) =
            self.regressor
                .reduced_rows(constants, &self.dependences.pivots, Some(rank), &mut self.sampling)?;
        relations::values(self.relations, &echelon)
    }

    fn charge(&mut self, operations: usize) -> Result<(), DeriveError> {
        self.budget.spend(operations)
    }
}

/// Evaluates wanted factors from relations whose factors are all known; much cheaper than from points of motion.
struct RelationFactorOracle<'a, 'b> {
    /// The relations.
    related: &'a SolvedRelations,
    /// Source of constants at which all functions exist.
    regressor: &'a SampledRegressor,
    /// Pairs of a dependent and a retained column.
    wanted: Vec<(usize, usize)>,
    /// Remaining field operations.
    budget: &'a mut OperationBudget<'b>,
}

impl PrimeFieldOracle for RelationFactorOracle<'_, '_> {
    fn constants<const P: u64>(&self, stream: &mut RandomStream) -> Result<FieldPoint<FieldElement<P>>, DeriveError> {
        self.regressor.sampler.constants(stream)
    }

    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<FieldElement<P>>,
    ) -> Result<Vec<FieldElement<P>>, DeriveError> {
        // An estimate: a thousand operations per factor.
        self.charge(1000 * self.wanted.len())?;
        let values = self.related.values(&self.wanted, constants);
        values.ok_or(DeriveError::RankChanged)
    }

    fn charge(&mut self, operations: usize) -> Result<(), DeriveError> {
        self.budget.spend(operations)
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use modelmill_spec::Mechanism;

    use super::*;
    use crate::expr::independent::SEED;
    use crate::expr::{ExprId, Graph};
    use crate::reduce::constants::{constant_occurrences, root_radicands};
    use crate::reduce::sample::sample_regressor;

    /// An arm of revolute joints, each with a length, a twist and an offset of its own.
    fn twisted(n: usize) -> Mechanism {
        let mut text = String::from("schema = 1\nname = \"twisted\"\ngravity = [0, 0, \"-9.81\"]\n[constants]\n");
        for i in 1..n {
            writeln!(text, "a{i} = {{ value = 0.1, unit = \"m\" }}\nb{i} = {{ value = 0.{i}, unit = \"rad\" }}\nd{i} = {{ value = 0.2, unit = \"m\" }}").unwrap();
        }
        text.push_str("[coordinates]\n");
        for i in 0..n {
            writeln!(text, "q{i} = {{ nominal = 0.{i} }}").unwrap();
        }
        let mut on = String::from("base");
        for i in 0..n {
            let [a, b, d] = ["a", "b", "d"].map(|x| match i {
                0 => "0".to_owned(),
                _ => format!("\"{x}{i}\""),
            });
            writeln!(text, "[[frame]]\nname = \"l{i}\"\non = \"{on}\"\nmodified_dh = {{ a = {a}, alpha = {b}, d = {d}, theta = \"q{i}\" }}\n[[part]]\non = \"l{i}\"\nlinear = {{ all = \"_{i}\" }}\n[[drive]]\nname = \"t{i}\"\njoint = \"q{i}\"").unwrap();
            on = format!("l{i}");
        }
        modelmill_spec::load(
            "twisted.toml",
            &text,
            &modelmill_boundary::files::MemoryFiles::default(),
        )
        .unwrap_or_else(|failure| panic!("{failure}"))
        .mechanism
    }

    /// Factors by relations between neighbouring links, by relations to retained columns alone from the spaces of the
    /// links, and by the same from points of motion.
    fn three_ways(mechanism: &Mechanism, operations: u64) -> Result<[Vec<DependentColumn>; 3], DeriveError> {
        let mut graph = Graph::new();
        let equations = crate::regressor::unreduced_equations(&mut graph, mechanism)?;
        let columns: Vec<&Vec<ExprId>> = (equations.columns.iter())
            .filter(|column| column.iter().any(|x| *x != Graph::ZERO))
            .collect();
        let projection = &equations.projection;
        let outputs: Vec<ExprId> = (0..projection.drives.len())
            .flat_map(|d| columns.iter().map(move |column| column[d]))
            .collect();
        let regressor = sample_regressor(&mut graph, mechanism, projection, &outputs, columns.len())?;
        let mut stream = RandomStream::new(SEED);
        let order: Vec<usize> = (0..columns.len()).collect();
        let effective: Vec<usize> = (0..equations.columns.len())
            .filter(|k| equations.columns[*k].iter().any(|x| *x != Graph::ZERO))
            .collect();
        let tree = TreeStructure::new(&mut graph, &equations, &effective);
        let mut dependences = DependenceStructure::find_dependences(&regressor, &tree, &order, &mut stream)?;
        let variables = constant_occurrences(&graph, &outputs, &projection.loops.residual);
        let roots = root_radicands(&graph, &outputs, &projection.loops.residual);
        let mut factors = |dependences: &DependenceStructure| {
            let values: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
            let search = FactorSearch {
                dependences,
                regressor: &regressor,
                tree: &tree,
                variables: &variables,
                roots: &roots,
                values: &values,
                budget: OperationBudget::new(operations, StopRequest::NEVER),
            };
            find_factors(search, &mut stream)
        };
        let near = factors(&dependences)?;
        assert!(
            dependences.relations.iter().any(|r| !r.has_retained_only()),
            "nothing is near"
        );
        dependences.relations.retain(ColumnRelation::has_retained_only);
        let by_links = factors(&dependences)?;
        for relation in &mut dependences.relations {
            let is_closed = relation.is_in_tree || relation.factors.is_some();
            assert!(is_closed, "column {} is not of a link", relation.column);
            (relation.is_in_tree, relation.factors) = (false, None);
        }
        Ok([near, by_links, factors(&dependences)?])
    }

    #[test]
    fn factors_put_together_from_near_ones_are_those_that_are_found_at_once() {
        let [near, by_links, direct] = three_ways(&twisted(4), MOST_OPERATIONS).unwrap();
        let all = direct.iter().flat_map(|line| &line.factors);
        assert!(all.clone().count() > 50 && all.clone().all(|(_, factor)| factor.is_some()));
        assert_eq!(near, direct);
        assert_eq!(by_links, direct);
    }

    #[test]
    fn what_takes_too_long_is_given_up() {
        let found = three_ways(&twisted(4), 100_000).unwrap_err();
        assert_eq!(found, DeriveError::FactorsTooLong { operations: 100_000 });
    }
}
