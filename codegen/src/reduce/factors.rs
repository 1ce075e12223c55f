//! The factors of eq. (6) as rational functions of the constants: reconstructed from points of motion for relations that
//! are as simple as can be found, put together from there.

use super::rational_function::RationalFunction;
use super::reconstruct::{self, Occurrence, Oracle, Survey};
use super::relations::{self, Related, Relation};
use super::{Pattern, SampledRegressor};
use crate::DeriveError;
use crate::expr::FieldPoint;
use crate::field::{Element, Stream};

/// The wanted factors of a pattern; those that resist are `None`.
pub(super) fn of(
    pattern: &Pattern,
    regressor: &SampledRegressor,
    variables: &[Occurrence],
    roots: &[i64],
    stream: &mut Stream,
) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
    if pattern.wanted.is_empty() {
        return Ok(Vec::new());
    }
    let all = &pattern.relations;
    let mut oracle = FromMotion {
        regressor,
        pivots: &pattern.pivots,
        relations: all,
        sampling: stream.clone(),
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
    // What is near is taken where its factors depend on fewer constants.
    let most_constants = |i: usize| factors_of(i).map(|k| survey.n_constants(k)).max();
    let chosen: Vec<usize> = (0..all.len())
        .filter(|i| all[*i].is_direct())
        .map(|direct| {
            let next = direct + 1;
            let has_near = all.get(next).is_some_and(|near| !near.is_direct());
            if has_near && most_constants(next) < most_constants(direct) {
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
    if !direct.is_empty() {
        related.replace(found(&direct, stream)?);
    }
    let mut written = related.written_out(&pattern.wanted, roots);
    let missing: Vec<usize> = (0..written.len())
        .filter(|k| written[*k].is_none())
        .collect();
    if !missing.is_empty() && related.is_complete() {
        let mut rest = FromRelations {
            related: &related,
            regressor,
            wanted: missing.iter().map(|k| pattern.wanted[*k]).collect(),
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
    relations: &'a [Relation],
    sampling: Stream,
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
        let rank = Some(self.pivots.len());
        let echelon = self
            .regressor
            .echelon(constants, self.pivots, rank, &mut self.sampling)?;
        relations::values(self.relations, &echelon)
    }
}

/// Wanted factors from relations, all of which must be known: much cheaper than from points of motion.
pub(super) struct FromRelations<'a> {
    pub(super) related: &'a Related,
    pub(super) regressor: &'a SampledRegressor,
    /// Which ones.
    pub(super) wanted: Vec<(usize, usize)>,
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
        let values = self.related.values(&self.wanted, constants);
        values.ok_or(DeriveError::RankChanged)
    }
}
