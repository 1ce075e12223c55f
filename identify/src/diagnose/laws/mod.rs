//! Laws that no library holds: where something comes again with the state and no candidate explains it, products of what places
//! do and carry are held against what is left, and those that take most of it off where they were not fitted are proposed.
//! A proposal is a hypothesis: it says what would explain the recordings, not what the machine has.
//!
//! 1. `shapes`, `features` - the grammar; `dimensions` - units of what multiplies it.
//! 2. `ground` - thousands of products are scored by inner products beside the base parameters and the effects that were found.
//! 3. The best of each form has its constants sought, and second terms beside it.
//! 4. `held_out` - what each takes off in time that it was not fitted to, and which differences are within the noise of that.
//!
//! Sources: S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113 (2016), for sparse regression over a library of functions;
//! Y. C. Pati, R. Rezaiifar, P. S. Krishnaprasad, Asilomar 1993, for the orthogonal search.

mod dimensions;
mod features;
mod ground;
mod held_out;
mod shapes;

use std::collections::BTreeMap;

pub use features::{LawFactor, LawProduct, LawSite};
pub use shapes::{LawShape, LawVariable};

use super::aliases::MIN_DISTINCTION;
use super::bench::{EffectSelector, SelectedEffect};
use super::evidence::LEAST_GAIN;
use super::pool::{FitScope, dot};
use super::problem::{CandidateNature, ColumnProvider, LocatedEffect};
use features::ProductForm;
use ground::{LawProjection, LawSamples, ScoredProduct, SiteProjection};
use held_out::{BlockValidation, ValidatedLaw};

/// A term of a law: a product, and the parameter or two that it is multiplied by.
#[derive(Clone, Debug, PartialEq)]
pub struct LawTerm {
    /// The product.
    pub product: LawProduct,
    /// Its parameters: one, or those of sine and cosine.
    pub values: Vec<f64>,
    /// Their standard deviations.
    pub standard_deviations: Vec<f64>,
}

/// A law at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteLaw {
    /// Where it acts, by number among the sites.
    pub site: usize,
    /// One or two.
    pub terms: Vec<LawTerm>,
    /// Share of the squares on the drives that feel it that it takes off where it was not fitted.
    pub gain: f64,
    /// Effects that were found and that it makes needless.
    pub replaced_effects: Vec<LocatedEffect>,
}

/// What is proposed for what nobody explains, the simplest of those that do it best first.
#[derive(Clone, Debug, PartialEq)]
pub struct LawProposal {
    /// The law.
    pub law: SiteLaw,
    /// Laws that differ from it by no more than the noise of the ranking, the best first.
    pub near_ties: Vec<SiteLaw>,
    /// The channels that feel it, of those that something is left of.
    pub channels: Vec<usize>,
}

/// Samples by which products are scored first, and on which the best are held out.
const SCREENED: usize = 1500;
const VALIDATION_SAMPLES: usize = 8000;
/// Forms whose constants are sought.
const FORMS: usize = 48;
/// Laws of one term beside which a second is sought, and second terms of each.
const FIRST_TERMS: usize = 6;
const SECOND_TERMS: usize = 4;
/// Steps by which constants are sought, as parts of what is usual: the first, and the last.
const STEPS: [f64; 2] = [0.06, 0.002];
/// A constant that gets better by less than this part has come to rest: on its way to infinity it gets better for ever.
const WORTH_A_STEP: f64 = 1e-4;
/// Rounds over all constants of a form.
const MOST_ROUNDS: usize = 40;
/// Squares that are left of a channel, in units of its white noise, from which on a law is sought though nothing else says that they
/// come again.
const SUSPICIOUS: f64 = 4.0;
/// What a law must take off of that which comes again, and of all that is left where nothing else says that it does.
const LEAST_PART: f64 = 0.5;
const LEAST_ALONE: f64 = 0.6;
/// The part of it that a term must take off with constants that are only tried, to be worth a search for better ones.
const HOPEFUL: f64 = 0.2;
/// How many independent columns the grammar may have, and how likely it may be that one of them does as well by chance.
const FORMS_THERE_ARE: f64 = 1e5;
const CHANCE: f64 = 1e-3;
/// Deviations over the blocks by which two terms must be better than one.
const LEAST_T: f64 = 3.0;
/// The part of what the best takes off that is nobody's: what readings and derivatives err by is no noise.
const SAME: f64 = 0.002;
/// Near-ties that are told.
const MAX_NEAR_TIES: usize = 8;

/// Beside what laws are sought: a set of effects, and what it leaves.
struct LawBaseline {
    picks: Vec<SelectedEffect>,
    ground: LawProjection,
    held_out: BlockValidation,
}

impl LawBaseline {
    fn new(
        bench: &EffectSelector<'_>,
        picks: Vec<SelectedEffect>,
        few: &LawSamples<'_>,
        many: &LawSamples<'_>,
        deviations: &[f64],
    ) -> Self {
        let (factors, _) = bench.fit(&picks, FitScope::All);
        let rest = bench.residual(&picks, &factors);
        Self {
            ground: LawProjection::new(bench, &picks, few, deviations),
            held_out: BlockValidation::new(bench, &picks, &rest, many, deviations),
            picks,
        }
    }

    fn add_law(
        &mut self,
        few: &LawSamples<'_>,
        many: &LawSamples<'_>,
        site: usize,
        terms: &[LawProduct],
    ) {
        for term in terms {
            self.ground = self.ground.conditional_on_product(few, site, term);
        }
        self.held_out.add_law(many, site, terms);
    }
}

/// A law with what it leaves.
struct LawTrial {
    site: usize,
    terms: Vec<LawProduct>,
    /// Beside which of the bases.
    base: usize,
    /// What it takes to write it down, with the effects beside it.
    size: usize,
    validation: ValidatedLaw,
}

/// What a set of effects leaves.
pub(crate) struct ResidualView<'a> {
    /// `[channel][sample]`
    pub(crate) residual: &'a [Vec<f64>],
    /// The part of each channel's squares that comes again.
    pub(crate) repeatable_share: &'a [f64],
    /// Channels of which that is more than noise.
    pub(crate) unexplained: &'a [usize],
}

impl ResidualView<'_> {
    /// Squares per sample of a channel.
    fn squares_per_sample(&self, channel: usize) -> f64 {
        let rest = &self.residual[channel];
        dot(rest, rest) / rest.len().max(1) as f64
    }

    /// Part of the squares per sample of some channels, in units of the noise.
    fn squares_over_noise(
        &self,
        channels: &[usize],
        deviations: &[f64],
        part: &dyn Fn(usize) -> f64,
    ) -> f64 {
        let scaled = channels
            .iter()
            .map(|d| part(*d) * self.squares_per_sample(*d) / deviations[*d].powi(2));
        scaled.sum()
    }

    /// Of each channel what does not come again, at least its noise.
    fn non_repeatable_deviations(&self, noise: &[f64]) -> Vec<f64> {
        let deviation = |d: usize| {
            let own = self.squares_per_sample(d) * (1.0 - self.repeatable_share[d]);
            own.sqrt().max(noise[d].max(f64::MIN_POSITIVE))
        };
        (0..self.residual.len()).map(deviation).collect()
    }

    /// Channels that a law may be sought for: those that are unexplained, then those that are far from white noise, since a law that
    /// depends on few things of many may come again where no flexible function of all of them does.
    fn open_channels(&self, noise: &[f64]) -> Vec<usize> {
        let is_suspicious = |d: &usize| {
            !self.unexplained.contains(d)
                && self.squares_per_sample(*d) > SUSPICIOUS * noise[*d].powi(2)
        };
        let others = (0..self.residual.len()).filter(is_suspicious);
        self.unexplained.iter().copied().chain(others).collect()
    }
}

/// Proposes laws for what a set of effects leaves.
pub(crate) fn propose_laws(
    bench: &EffectSelector<'_>,
    picks: &[SelectedEffect],
    left: &ResidualView<'_>,
    supply: &dyn ColumnProvider,
) -> (Vec<LawSite>, Vec<LawProposal>) {
    let mut open = left.open_channels(&bench.problem.noise);
    if open.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let all_open = open.clone();
    let asked_of = |channels: &[usize]| -> Vec<usize> {
        let of = channels.iter().filter(|d| all_open.contains(d));
        of.copied().collect()
    };
    let sites = supply.sites();
    if sites.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let load = bench.load(picks);
    let of_site = |site: &LawSite| site.channel.and_then(|d| load.0[d].clone());
    let loads: Vec<Option<Vec<f64>>> = sites.iter().map(of_site).collect();
    let deviations = left.non_repeatable_deviations(&bench.problem.noise);
    let few = LawSamples::new(bench, &sites, &loads, &deviations, SCREENED);
    let many = LawSamples::new(bench, &sites, &loads, &deviations, VALIDATION_SAMPLES);
    let base =
        |picks: Vec<SelectedEffect>| LawBaseline::new(bench, picks, &few, &many, &deviations);
    let mut bases = vec![base(picks.to_vec())];
    let fewer = drop_effects_on(bench, picks, &open);
    if fewer.len() < picks.len() {
        bases.push(base(fewer));
    }
    let mut proposals = Vec::new();
    while let Some(channel) = open.first().copied() {
        open.retain(|d| *d != channel);
        let is_felt = |site: &usize| few.channels(*site).contains(&channel);
        let felt: Vec<usize> = (0..sites.len()).filter(is_felt).collect();
        let squares = |samples: &LawSamples<'_>, site: usize, of: &dyn Fn(usize) -> f64| {
            samples.picked.len() as f64
                * left.squares_over_noise(&samples.channels(site), &deviations, of)
        };
        // What a law must take off of all that is left there.
        let least = |site: usize| {
            let channels = many.channels(site);
            if channels.iter().any(|d| left.unexplained.contains(d)) {
                let again = squares(&many, site, &|d| left.repeatable_share[d]);
                LEAST_PART * again / squares(&many, site, &|_| 1.0)
            } else {
                LEAST_ALONE
            }
        };
        let is_hopeful = |one: &ScoredProduct| {
            one.score >= HOPEFUL * least(one.site) * squares(&few, one.site, &|_| 1.0)
        };
        let without = bases[0].held_out.validate_law(&many, 0, &[]);
        let tried = try_laws(bench, &bases, [&few, &many], &felt, &is_hopeful);
        let left_there = |one: &LawTrial| bases[one.base].held_out.residual_at_site(&many, one);
        // Where the base, freed by a law, fits other drives better as well, that is not gained on its own drives.
        let gain = |one: &LawTrial| {
            let all = squares(&many, one.site, &|_| 1.0).max(f64::MIN_POSITIVE);
            let off = without.total() - one.validation.total();
            (off / all).min(1.0 - left_there(one).0 / all)
        };
        let scatter = |one: &LawTrial| {
            let (squares, worth) = left_there(one);
            squares / worth.max(1.0)
        };
        let is_one = |one: &LawTrial| {
            let channels = many.channels(one.site);
            let gain = gain(one);
            // The best of many columns that have nothing to do with what is left explains so much of so few samples.
            let worth = bench.effective_equations(left.residual, &channels);
            let by_chance = FORMS_THERE_ARE * (1.0 - gain).max(0.0).powf(0.5 * worth);
            let (off, deviation) = without.excess_over(&one.validation);
            gain >= least(one.site) && off > deviation && by_chance < CHANCE
        };
        let Some((chosen, near_ties)) = select_law(tried, &without, &many, &is_one, &scatter)
        else {
            continue;
        };
        let law = |one: &LawTrial| {
            let is_gone = |pick: &&SelectedEffect| !bases[one.base].picks.contains(pick);
            let replaced = picks.iter().filter(is_gone);
            SiteLaw {
                site: one.site,
                terms: law_terms(one),
                gain: gain(one),
                replaced_effects: replaced
                    .map(|pick| bench.candidate(pick).effect.clone())
                    .collect(),
            }
        };
        proposals.push(LawProposal {
            law: law(&chosen),
            near_ties: near_ties.iter().map(law).collect(),
            channels: asked_of(&many.channels(chosen.site)),
        });
        bases.swap(0, chosen.base);
        bases.truncate(1);
        bases[0].add_law(&few, &many, chosen.site, &chosen.terms);
        open.retain(|d| !many.channels(chosen.site).contains(d));
    }
    (sites.into_iter().map(without_motion).collect(), proposals)
}

/// Laws beside each of the bases, formed on few samples and judged on many.
fn try_laws(
    bench: &EffectSelector<'_>,
    bases: &[LawBaseline],
    [few, many]: [&LawSamples<'_>; 2],
    sites: &[usize],
    is_hopeful: &dyn Fn(&ScoredProduct) -> bool,
) -> Vec<LawTrial> {
    let mut tried = Vec::new();
    for (k, base) in bases.iter().enumerate() {
        let beside: usize = base.picks.iter().map(|pick| 2 * bench.freedoms(pick)).sum();
        for (site, terms) in best_laws_by_form(&base.ground, few, sites, is_hopeful) {
            tried.push(LawTrial {
                validation: base.held_out.validate_law(many, site, &terms),
                size: beside
                    + terms
                        .iter()
                        .map(|term| 1 + term.description_length())
                        .sum::<usize>(),
                base: k,
                site,
                terms,
            });
        }
    }
    tried
}

/// A site whose motions have done their part.
fn without_motion(site: LawSite) -> LawSite {
    LawSite {
        name: site.name,
        is_angle: site.is_angle,
        channel: site.channel,
        ..LawSite::default()
    }
}

/// Effects without those that act where something is open: what was found may be no more than what of the law an effect of the
/// library is like.
fn drop_effects_on(
    bench: &EffectSelector<'_>,
    picks: &[SelectedEffect],
    open: &[usize],
) -> Vec<SelectedEffect> {
    let stays = |pick: &&SelectedEffect| {
        let channels = bench.affected_channels(std::slice::from_ref(*pick));
        bench.candidate(pick).nature == CandidateNature::Disturbance
            || channels.iter().all(|d| !open.contains(d))
    };
    picks.iter().filter(stays).cloned().collect()
}

/// The products of a law with their parameters.
fn law_terms(one: &LawTrial) -> Vec<LawTerm> {
    let mut parameters = one
        .validation
        .values
        .iter()
        .zip(&one.validation.standard_deviations);
    let term = |product: &LawProduct| {
        let own = parameters.by_ref().take(product.parameters());
        let (values, deviations) = own.unzip();
        LawTerm {
            product: product.clone(),
            values,
            standard_deviations: deviations,
        }
    };
    one.terms.iter().map(term).collect()
}

/// The best laws of each form with their constants, those of one term and then those of two, as far as their first term
/// is hopeful.
fn best_laws_by_form(
    ground: &LawProjection,
    samples: &LawSamples<'_>,
    sites: &[usize],
    is_hopeful: &dyn Fn(&ScoredProduct) -> bool,
) -> Vec<(usize, Vec<LawProduct>)> {
    let parts: BTreeMap<usize, SiteProjection> = (sites.iter())
        .map(|site| (*site, ground.project_at_site(samples, *site)))
        .collect();
    let screened = parts
        .values()
        .flat_map(|part| part.screen_products(samples, &|_| true));
    let mut single: Vec<ScoredProduct> = (best_of_forms(screened, FORMS).into_iter())
        .filter(is_hopeful)
        .map(|one| refine_constants(&parts[&one.site], samples, one))
        .collect();
    single.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut laws: Vec<(usize, Vec<LawProduct>)> = Vec::new();
    for first in single.iter().take(FIRST_TERMS) {
        let part = (ground.conditional_on_product(samples, first.site, &first.product))
            .project_at_site(samples, first.site);
        let screened = part.screen_products(samples, &|other| first.product.other == Some(other));
        for second in best_of_forms(screened.into_iter(), SECOND_TERMS) {
            let second = refine_constants(&part, samples, second);
            laws.push((first.site, vec![first.product.clone(), second.product]));
        }
    }
    let singles = single.into_iter().map(|one| (one.site, vec![one.product]));
    singles.chain(laws).collect()
}

/// The best of each form, the best forms first.
fn best_of_forms(scored: impl Iterator<Item = ScoredProduct>, most: usize) -> Vec<ScoredProduct> {
    let mut best: BTreeMap<(usize, ProductForm), ScoredProduct> = BTreeMap::new();
    for one in scored {
        let form = (one.site, one.product.product_form());
        match best.get(&form) {
            Some(known) if known.score >= one.score => {}
            _ => {
                best.insert(form, one);
            }
        }
    }
    let mut forms: Vec<ScoredProduct> = best.into_values().collect();
    forms.sort_by(|a, b| b.score.total_cmp(&a.score));
    forms.truncate(most);
    forms
}

/// The same form with the constants that take most off, found by smaller and smaller steps.
fn refine_constants(
    part: &SiteProjection,
    samples: &LawSamples<'_>,
    mut best: ScoredProduct,
) -> ScoredProduct {
    let [mut step, last] = STEPS;
    for _ in 0..MOST_ROUNDS {
        if step <= last {
            break;
        }
        let mut is_better = false;
        for factor in 0..best.product.factors.len() {
            for which in 0..best.product.factors[factor].shape.freedoms() {
                let range = samples.range(best.site, &best.product, factor);
                for way in [step, -step] {
                    let mut product = best.product.clone();
                    let shape = &mut product.factors[factor].shape;
                    *shape = shape.with_moved_constant(which, way, range);
                    let score = part.score(samples, &product);
                    if score > best.score {
                        is_better |= score > (1.0 + WORTH_A_STEP) * best.score;
                        best.score = score;
                        best.product = product;
                        break;
                    }
                }
            }
        }
        if !is_better {
            step *= 0.4;
        }
    }
    best
}

/// The simplest of the laws that leave least where they were not fitted, with those that leave no more; `None` where the best
/// is none, as `is_one` says. What a law leaves more than the best is held against the squares of an independent sample, which
/// `scatter` gives.
fn select_law(
    tried: Vec<LawTrial>,
    without: &ValidatedLaw,
    samples: &LawSamples<'_>,
    is_one: &dyn Fn(&LawTrial) -> bool,
    scatter: &dyn Fn(&LawTrial) -> f64,
) -> Option<(LawTrial, Vec<LawTrial>)> {
    // What the library has it was asked about already.
    let is_new = |one: &LawTrial| {
        let mut terms = one.terms.iter();
        terms.any(|term| !term.is_in_library(&samples.sites[one.site]))
    };
    let all = tried.into_iter().filter(is_new);
    let (mut laws, double): (Vec<LawTrial>, Vec<LawTrial>) =
        all.partition(|one| one.terms.len() == 1);
    let least = |all: &[LawTrial]| -> Option<usize> {
        let totals = all.iter().map(|one| one.validation.total()).enumerate();
        totals.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    };
    if let (Some(one), Some(two)) = (least(&laws), least(&double)) {
        let (more, deviation) = laws[one].validation.excess_over(&double[two].validation);
        if more > LEAST_T * deviation && more > LEAST_GAIN * without.total() {
            laws = double;
        }
    } else if laws.is_empty() {
        laws = double;
    }
    laws.sort_by(|a, b| a.validation.total().total_cmp(&b.validation.total()));
    let first = laws.first()?;
    if !is_one(first) {
        return None;
    }
    let less = without.total() - first.validation.total();
    let most = first.validation.total() + (MIN_DISTINCTION * scatter(first)).max(SAME * less);
    laws.retain(|one| one.validation.total() <= most);
    let simplest = (0..laws.len()).min_by_key(|k| laws[*k].size)?;
    let chosen = laws.remove(simplest);
    let mut seen = vec![(chosen.site, product_forms(&chosen))];
    laws.retain(|one| {
        let form = (one.site, product_forms(one));
        let is_new = !seen.contains(&form);
        seen.push(form);
        is_new
    });
    laws.truncate(MAX_NEAR_TIES);
    Some((chosen, laws))
}

fn product_forms(one: &LawTrial) -> Vec<ProductForm> {
    one.terms.iter().map(LawProduct::product_form).collect()
}
