//! The factors of eq. (6) as rational functions of the constants: reconstructed from points of motion for relations that
//! are as simple as can be found, put together from there.

use modelmill_algebra::field::{Element, Stream};

use super::dependences::Dependences;
use super::oracle::{Budget, Occurrence, Oracle};
use super::rational_function::RationalFunction;
use super::reconstruct::{self, Survey};
use super::relations::{self, ColumnRelation, Related};
use super::sample::SampledRegressor;
use crate::DeriveError;
use crate::expr::FieldPoint;

/// Operations of the field that factors may take: a minute or so.
pub(super) const MOST_OPERATIONS: u64 = 20_000_000_000;

/// Factors of no more constants than this are found at once.
const FEW: usize = 6;

/// The wanted factors of the dependences; those that resist are `None`.
pub(super) fn find(
    dependences: &Dependences,
    regressor: &SampledRegressor,
    variables: &[Occurrence],
    roots: &[i64],
    operations: u64,
    stream: &mut Stream,
) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
    if dependences.wanted.is_empty() {
        return Ok(Vec::new());
    }
    let direct: Vec<ColumnRelation> = (dependences.relations.iter())
        .filter(|relation| relation.is_direct())
        .cloned()
        .collect();
    let mut budget = Budget::new(operations);
    let mut by = |relations: &[ColumnRelation]| {
        by_relations(
            relations,
            dependences,
            regressor,
            variables,
            roots,
            &mut budget,
            stream,
        )
    };
    match by(&dependences.relations) {
        // Which columns are near may depend on the constants, as with roots that take either sign.
        Err(DeriveError::RankChanged) if direct.len() < dependences.relations.len() => by(&direct),
        found => found,
    }
}

/// The wanted factors by some relations, those to retained columns among them.
fn by_relations(
    all: &[ColumnRelation],
    dependences: &Dependences,
    regressor: &SampledRegressor,
    variables: &[Occurrence],
    roots: &[i64],
    budget: &mut Budget,
    stream: &mut Stream,
) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
    let mut oracle = FromMotion {
        regressor,
        pivots: &dependences.pivots,
        relations: all,
        sampling: stream.clone(),
        budget,
    };
    let mut survey = Survey::new(&mut oracle, variables, roots, stream)?;
    let starts: Vec<usize> = (all.iter())
        .scan(0, |next, relation| {
            let start = *next;
            *next += relation.len();
            Some(start)
        })
        .collect();
    let factors_of = |i: usize| starts[i]..starts[i] + all[i].len();
    // What is near is taken where its factors depend on far fewer constants.
    let most_constants = |i: usize| {
        factors_of(i)
            .map(|k| survey.n_constants(k))
            .max()
            .unwrap_or(0)
    };
    let chosen: Vec<usize> = (0..all.len())
        .filter(|i| all[*i].is_direct())
        .map(|direct| {
            let next = direct + 1;
            let has_near = all.get(next).is_some_and(|near| !near.is_direct());
            if has_near && most_constants(direct) > FEW.max(2 * most_constants(next)) {
                next
            } else {
                direct
            }
        })
        .collect();
    let mut found = |chosen: &[usize], stream: &mut Stream| -> Result<Related, DeriveError> {
        let factors = |i: &usize| {
            let is_needed = all[*i].is_direct();
            factors_of(*i).map(move |k| (k, is_needed))
        };
        let wanted: Vec<(usize, bool)> = chosen.iter().flat_map(factors).collect();
        let factors = survey.functions(&mut oracle, &wanted, stream)?;
        Ok(Related::new(chosen.iter().map(|i| &all[*i]), factors))
    };
    let mut related = found(&chosen, stream)?;
    // What is near need not be simple: where the first joints of an arm do not feel all of a link, relations between links
    // divide by sines of twists, and those to retained columns do not.
    let unwieldy = related.unwieldy();
    let direct: Vec<usize> = (0..all.len())
        .filter(|i| all[*i].is_direct() && unwieldy.contains(&all[*i].column))
        .collect();
    if !direct.is_empty() && !related.is_lost() {
        related.replace(found(&direct, stream)?);
    }
    let mut written = related.written_out(&dependences.wanted, roots);
    let missing: Vec<usize> = (0..written.len())
        .filter(|k| written[*k].is_none())
        .collect();
    if !missing.is_empty() && related.is_complete() {
        let mut rest = FromRelations {
            related: &related,
            regressor,
            wanted: missing.iter().map(|k| dependences.wanted[*k]).collect(),
            budget: &mut *oracle.budget,
        };
        let found = reconstruct::reconstruct(&mut rest, variables, roots, stream)?;
        for (k, function) in missing.into_iter().zip(found) {
            written[k] = function;
        }
    }
    Ok(written)
}

/// The factors of relations, from points of motion.
struct FromMotion<'a> {
    regressor: &'a SampledRegressor,
    pivots: &'a [usize],
    relations: &'a [ColumnRelation],
    sampling: Stream,
    budget: &'a mut Budget,
}

impl Oracle for FromMotion<'_> {
    fn constants<const P: u64>(
        &self,
        stream: &mut Stream,
    ) -> Result<FieldPoint<Element<P>>, DeriveError> {
        self.regressor.sampler.constants(stream)
    }

    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<Element<P>>,
    ) -> Result<Vec<Element<P>>, DeriveError> {
        let rank = self.pivots.len();
        self.spend(rank * rank * self.regressor.n_columns)?;
        let rank = Some(rank);
        let echelon = self
            .regressor
            .echelon(constants, self.pivots, rank, &mut self.sampling)?;
        relations::values(self.relations, &echelon)
    }

    fn spend(&mut self, operations: usize) -> Result<(), DeriveError> {
        self.budget.spend(operations)
    }
}

/// Wanted factors from relations, all of which must be known: much cheaper than from points of motion.
struct FromRelations<'a> {
    related: &'a Related,
    regressor: &'a SampledRegressor,
    /// Which ones.
    wanted: Vec<(usize, usize)>,
    budget: &'a mut Budget,
}

impl Oracle for FromRelations<'_> {
    fn constants<const P: u64>(
        &self,
        stream: &mut Stream,
    ) -> Result<FieldPoint<Element<P>>, DeriveError> {
        self.regressor.sampler.constants(stream)
    }

    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<Element<P>>,
    ) -> Result<Vec<Element<P>>, DeriveError> {
        self.spend(1000 * self.wanted.len())?;
        let values = self.related.values(&self.wanted, constants);
        values.ok_or(DeriveError::RankChanged)
    }

    fn spend(&mut self, operations: usize) -> Result<(), DeriveError> {
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
    use crate::reduce::constants::{occurrences, root_radicands};
    use crate::reduce::sample::sampled;

    /// An arm of revolute joints, each with a length, a twist and an offset of its own.
    fn twisted(n: usize) -> Mechanism {
        let mut text = String::from(
            "schema = 1\nname = \"twisted\"\ngravity = [0, 0, \"-9.81\"]\n[constants]\n",
        );
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
            &modelmill_boundary::files::Memory::default(),
        )
        .unwrap_or_else(|failure| panic!("{failure}"))
        .mechanism
    }

    /// Factors by near relations where they pay, and by relations to retained columns alone.
    fn both(
        mechanism: &Mechanism,
        operations: u64,
    ) -> Result<[Vec<Option<RationalFunction>>; 2], DeriveError> {
        let mut graph = Graph::new();
        let equations = crate::regressor::equations(&mut graph, mechanism)?;
        let columns: Vec<&Vec<ExprId>> = (equations.columns.iter())
            .filter(|column| column.iter().any(|x| *x != Graph::ZERO))
            .collect();
        let projection = &equations.projection;
        let outputs: Vec<ExprId> = (0..projection.drives.len())
            .flat_map(|d| columns.iter().map(move |column| column[d]))
            .collect();
        let regressor = sampled(&mut graph, mechanism, projection, &outputs, columns.len())?;
        let mut stream = Stream::new(SEED);
        let order: Vec<usize> = (0..columns.len()).collect();
        let mut dependences = Dependences::find(&regressor, &order, &mut stream)?;
        let variables = occurrences(&graph, &outputs, &projection.loops.residual);
        let roots = root_radicands(&graph, &outputs, &projection.loops.residual);
        let mut factors = |dependences: &Dependences| {
            find(
                dependences,
                &regressor,
                &variables,
                &roots,
                operations,
                &mut stream,
            )
        };
        let near = factors(&dependences)?;
        assert!(
            dependences.relations.iter().any(|r| !r.is_direct()),
            "nothing is near"
        );
        dependences.relations.retain(ColumnRelation::is_direct);
        Ok([near, factors(&dependences)?])
    }

    #[test]
    fn factors_put_together_from_near_ones_are_those_that_are_found_at_once() {
        let [near, direct] = both(&twisted(4), MOST_OPERATIONS).unwrap();
        assert!(direct.iter().all(Option::is_some));
        assert_eq!(near, direct);
    }

    #[test]
    fn what_takes_too_long_is_given_up() {
        let found = both(&twisted(4), 100_000).unwrap_err();
        assert_eq!(
            found,
            DeriveError::FactorsTooLong {
                operations: 100_000
            }
        );
    }
}
