//! Proposed laws. Where a residual is repeatable and no candidate explains it, products of the motion and load of
//! places are compared with the residual. Those that explain most of it on data that was not fitted are proposed. A
//! proposal is a hypothesis: it states what would explain the recordings, not what the machine has.
//! Input: the set of effects and its residual. Output: proposals, each with laws that are nearly as good.
//!
//! 1. `shapes`, `features` - the grammar; `dimensions` - units of the parameters.
//! 2. `projection` - thousands of products are scored by inner products, with the base parameters and the effects found
//!    projected out.
//! 3. The best product of each form gets its constants refined, and second terms are tried in addition.
//! 4. `held_out` - what each law explains on time that was not fitted, and which differences are within the noise of
//!    that.
//!
//! Sources: S. L. Brunton, J. L. Proctor, J. N. Kutz, PNAS 113 (2016), for sparse regression over a library of
//! functions; Y. C. Pati, R. Rezaiifar, P. S. Krishnaprasad, Asilomar 1993, for the orthogonal search.

mod dimensions;
mod features;
mod held_out;
mod projection;
mod shapes;

use std::collections::BTreeMap;

pub use features::{LawFactor, LawProduct, LawSite};
pub use shapes::{LawShape, LawVariable};

use super::bench::{EffectSelector, SelectedEffect};
use super::pool::FitScope;
use super::problem::{ColumnProvider, LocatedEffect};
use super::thresholds::{
    LAW_HOPEFUL_PART, LAW_INDEPENDENT_COLUMNS, LAW_LEAST_NOISE_RATIO, LAW_LEAST_REPEATABLE_SHARE,
    LAW_LEAST_SHARE_ALONE, LAW_MOST_CHANCE, LAW_SAME_SHARE, LEAST_GAIN, MAX_NEAR_TIES, MIN_DISTINCTION,
    SECOND_TERM_LEAST_T,
};
use crate::signal::dot;
use features::ProductForm;
use held_out::{BlockValidation, ValidatedLaw};
use projection::{LawProjection, LawSamples, ScoredProduct, SiteProjection};

/// A term of a law: a product and its one or more parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LawTerm {
    /// The product of shapes.
    pub product: LawProduct,
    /// Its parameters: one, or one for sine and one for cosine. [`LawProduct::unit`] gives the unit.
    pub values: Vec<f64>,
    /// Their standard deviations, in the same unit.
    pub standard_deviations: Vec<f64>,
}

/// A law at a place, as the search finds it: its place is an index.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteLaw {
    /// Index of the place where it acts, among the sites of the diagnosis.
    pub site: usize,
    /// One or two terms, which are added.
    pub terms: Vec<LawTerm>,
    /// Share of the squared residual that it explains on data that was not fitted, on the drives on which it has an
    /// effect, 0 to 1.
    pub gain: f64,
    /// Effects that were found and that it makes unnecessary.
    pub replaced_effects: Vec<LocatedEffect>,
}

/// A proposed law for an unexplained residual, with its alternatives. The law is the simplest of those that explain the
/// residual equally well.
#[derive(Clone, Debug, PartialEq)]
pub struct LawProposal {
    /// The law.
    pub law: SiteLaw,
    /// Laws that are worse by no more than the noise of the ranking, the best first.
    pub near_ties: Vec<SiteLaw>,
    /// Indices of the channels on which it has an effect, of those with an unexplained residual.
    pub channels: Vec<usize>,
}

/// Number of samples for scoring all products, and for validating the best ones.
const SCREENED: usize = 1500;
const VALIDATION_SAMPLES: usize = 8000;
/// Number of forms whose constants are refined.
const FORMS: usize = 48;
/// Number of laws of one term to which a second term is added, and of second terms for each.
const FIRST_TERMS: usize = 6;
const SECOND_TERMS: usize = 4;
/// First and last step of the search for constants, as shares of the range of the variable.
const STEPS: [f64; 2] = [0.06, 0.002];
/// A smaller relative improvement does not count: a constant on its way to infinity would improve for ever.
const WORTH_A_STEP: f64 = 1e-4;
/// Largest number of rounds over all constants of a form.
const MOST_ROUNDS: usize = 40;

/// A set of effects in whose presence laws are searched, prepared for scoring and validation.
struct LawBaseline {
    /// The effects.
    picks: Vec<SelectedEffect>,
    /// Projection of the set, for scores on few samples.
    ground: LawProjection,
    /// Inner products by block, for validation on many samples.
    held_out: BlockValidation,
}

impl LawBaseline {
    /// Fits a set of effects and prepares both; `deviations` are the standard deviations of the channels.
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

    /// Adds a law to the columns that are projected out and fitted; `site` is the index of its place.
    fn add_law(&mut self, few: &LawSamples<'_>, many: &LawSamples<'_>, site: usize, terms: &[LawProduct]) {
        for term in terms {
            self.ground = self.ground.conditional_on_product(few, site, term);
        }
        self.held_out.add_law(many, site, terms);
    }
}

/// A law with its validation.
struct LawTrial {
    site: usize,
    /// Its products, which are added.
    terms: Vec<LawProduct>,
    /// Index of the baseline to which it is added.
    base: usize,
    /// Length of its description, that of the effects of its baseline included.
    size: usize,
    /// Its errors on data that was not fitted.
    validation: ValidatedLaw,
}

/// Residual of a set of effects, as the search for laws needs it.
pub(crate) struct ResidualView<'a> {
    /// `[channel][sample]`, N or N m.
    pub(crate) residual: &'a [Vec<f64>],
    /// Repeatable share of each channel's squares, 0 to 1.
    pub(crate) repeatable_share: &'a [f64],
    /// Indices of the channels whose repeatable residual is more than noise.
    pub(crate) unexplained: &'a [usize],
}

impl ResidualView<'_> {
    /// Mean square of the residual of a channel.
    fn squares_per_sample(&self, channel: usize) -> f64 {
        let rest = &self.residual[channel];
        dot(rest, rest) / rest.len().max(1) as f64
    }

    /// Sum over some channels of a part of the mean square, relative to the variance of the noise.
    fn squares_over_noise(&self, channels: &[usize], deviations: &[f64], part: &dyn Fn(usize) -> f64) -> f64 {
        let scaled = channels
            .iter()
            .map(|d| part(*d) * self.squares_per_sample(*d) / deviations[*d].powi(2));
        scaled.sum()
    }

    /// Standard deviation of the non-repeatable residual of each channel, at least that of its noise.
    fn non_repeatable_deviations(&self, noise: &[f64]) -> Vec<f64> {
        let deviation = |d: usize| {
            let own = self.squares_per_sample(d) * (1.0 - self.repeatable_share[d]);
            own.sqrt().max(noise[d].max(f64::MIN_POSITIVE))
        };
        (0..self.residual.len()).map(deviation).collect()
    }

    /// Channels for which a law is searched: those that are unexplained, then those that are far above white noise. A
    /// law of few variables may be repeatable where no flexible function of all variables is.
    fn open_channels(&self, noise: &[f64]) -> Vec<usize> {
        let is_suspicious = |d: &usize| {
            !self.unexplained.contains(d) && self.squares_per_sample(*d) > LAW_LEAST_NOISE_RATIO * noise[*d].powi(2)
        };
        let others = (0..self.residual.len()).filter(is_suspicious);
        self.unexplained.iter().copied().chain(others).collect()
    }
}

/// Proposes laws for the residual of a set of effects, one after the other, until no channel is open. Returns the
/// places and the proposals.
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
    // Variables along the recordings: few samples to score many products, many samples to validate the best.
    let load = bench.load(picks);
    let of_site = |site: &LawSite| site.channel.and_then(|d| load.0[d].clone());
    let loads: Vec<Option<Vec<f64>>> = sites.iter().map(of_site).collect();
    let deviations = left.non_repeatable_deviations(&bench.problem.noise);
    let few = LawSamples::new(bench, &sites, &loads, &deviations, SCREENED);
    let many = LawSamples::new(bench, &sites, &loads, &deviations, VALIDATION_SAMPLES);
    let base = |picks: Vec<SelectedEffect>| LawBaseline::new(bench, picks, &few, &many, &deviations);
    // Laws are searched in addition to the effects found, and in place of those on the open channels.
    let mut bases = vec![base(picks.to_vec())];
    let fewer = drop_effects_on(bench, picks, &open);
    if fewer.len() < picks.len() {
        bases.push(base(fewer));
    }
    let mut proposals = Vec::new();
    while let Some(channel) = open.first().copied() {
        open.retain(|d| *d != channel);
        // Places whose forces have an effect on the channel.
        let is_felt = |site: &usize| few.channels(*site).contains(&channel);
        let felt: Vec<usize> = (0..sites.len()).filter(is_felt).collect();
        let squares = |samples: &LawSamples<'_>, site: usize, of: &dyn Fn(usize) -> f64| {
            samples.picked.len() as f64 * left.squares_over_noise(&samples.channels(site), &deviations, of)
        };
        // Least share of the residual that a law must explain on the channels of a place.
        let least = |site: usize| {
            let channels = many.channels(site);
            if channels.iter().any(|d| left.unexplained.contains(d)) {
                let again = squares(&many, site, &|d| left.repeatable_share[d]);
                LAW_LEAST_REPEATABLE_SHARE * again / squares(&many, site, &|_| 1.0)
            } else {
                LAW_LEAST_SHARE_ALONE
            }
        };
        let is_hopeful =
            |one: &ScoredProduct| one.score >= LAW_HOPEFUL_PART * least(one.site) * squares(&few, one.site, &|_| 1.0);
        let without = bases[0].held_out.validate_law(&many, 0, &[]);
        let tried = try_laws(bench, &bases, [&few, &many], &felt, &is_hopeful);
        let left_there = |one: &LawTrial| bases[one.base].held_out.residual_at_site(&many, one);
        // If base parameters improve other drives after a law is added, that does not count as a gain on its own
        // drives.
        let gain = |one: &LawTrial| {
            let all = squares(&many, one.site, &|_| 1.0).max(f64::MIN_POSITIVE);
            let off = without.total() - one.validation.total();
            (off / all).min(1.0 - left_there(one).0 / all)
        };
        // Squares of one independent sample: the scale for differences between laws.
        let scatter = |one: &LawTrial| {
            let (squares, worth) = left_there(one);
            squares / worth.max(1.0)
        };
        let is_one = |one: &LawTrial| {
            let channels = many.channels(one.site);
            let gain = gain(one);
            // The best of many unrelated columns explains this much of few samples by chance.
            let worth = bench.effective_equations(left.residual, &channels);
            let by_chance = LAW_INDEPENDENT_COLUMNS * (1.0 - gain).max(0.0).powf(0.5 * worth);
            let (off, deviation) = without.excess_over(&one.validation);
            gain >= least(one.site) && off > deviation && by_chance < LAW_MOST_CHANCE
        };
        let Some((chosen, near_ties)) = select_law(tried, &without, &many, &is_one, &scatter) else {
            continue;
        };
        let law = |one: &LawTrial| {
            let is_gone = |pick: &&SelectedEffect| !bases[one.base].picks.contains(pick);
            let replaced = picks.iter().filter(is_gone);
            SiteLaw {
                site: one.site,
                terms: law_terms(one),
                gain: gain(one),
                replaced_effects: replaced.map(|pick| bench.candidate(pick).effect.clone()).collect(),
            }
        };
        proposals.push(LawProposal {
            law: law(&chosen),
            near_ties: near_ties.iter().map(law).collect(),
            channels: asked_of(&many.channels(chosen.site)),
        });
        // The next law is searched in the presence of the chosen one.
        bases.swap(0, chosen.base);
        bases.truncate(1);
        bases[0].add_law(&few, &many, chosen.site, &chosen.terms);
        open.retain(|d| !many.channels(chosen.site).contains(d));
    }
    (sites.into_iter().map(without_motion).collect(), proposals)
}

/// Searches laws for each baseline, formed on few samples and validated on many.
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
                size: beside + terms.iter().map(|term| 1 + term.description_length()).sum::<usize>(),
                base: k,
                site,
                terms,
            });
        }
    }
    tried
}

/// A place without its series, which are no longer needed.
fn without_motion(site: LawSite) -> LawSite {
    LawSite {
        name: site.name,
        is_angle: site.is_angle,
        channel: site.channel,
        ..LawSite::default()
    }
}

/// Effects without those that act on open channels: an effect that was found there may only be the part of the law that
/// resembles an effect of the library. Disturbances stay.
fn drop_effects_on(bench: &EffectSelector<'_>, picks: &[SelectedEffect], open: &[usize]) -> Vec<SelectedEffect> {
    let stays = |pick: &&SelectedEffect| {
        let channels = bench.affected_channels(std::slice::from_ref(*pick));
        bench.candidate(pick).nature.is_disturbance() || channels.iter().all(|d| !open.contains(d))
    };
    picks.iter().filter(stays).cloned().collect()
}

/// The terms of a law with their estimates.
fn law_terms(one: &LawTrial) -> Vec<LawTerm> {
    let mut parameters = one.validation.values.iter().zip(&one.validation.standard_deviations);
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

/// The best law of each form with refined constants, as (place, products): first those of one term, then those of two
/// whose first term is among the best.
fn best_laws_by_form(
    ground: &LawProjection,
    samples: &LawSamples<'_>,
    sites: &[usize],
    is_hopeful: &dyn Fn(&ScoredProduct) -> bool,
) -> Vec<(usize, Vec<LawProduct>)> {
    let parts: BTreeMap<usize, SiteProjection> = (sites.iter())
        .map(|site| (*site, ground.project_at_site(samples, *site)))
        .collect();
    let screened = parts.values().flat_map(|part| part.screen_products(samples, &|_| true));
    let mut single: Vec<ScoredProduct> = (best_of_forms(screened, FORMS).into_iter())
        .filter(is_hopeful)
        .map(|one| refine_constants(&parts[&one.site], samples, one))
        .collect();
    single.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut laws: Vec<(usize, Vec<LawProduct>)> = Vec::new();
    // Second terms are scored in the presence of the first.
    for first in single.iter().take(FIRST_TERMS) {
        let part =
            (ground.conditional_on_product(samples, first.site, &first.product)).project_at_site(samples, first.site);
        let screened = part.screen_products(samples, &|other| first.product.other == Some(other));
        for second in best_of_forms(screened.into_iter(), SECOND_TERMS) {
            let second = refine_constants(&part, samples, second);
            laws.push((first.site, vec![first.product.clone(), second.product]));
        }
    }
    let singles = single.into_iter().map(|one| (one.site, vec![one.product]));
    singles.chain(laws).collect()
}

/// The best product of each form, at most `most`, best first.
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

/// The same form with better constants: pattern search with decreasing steps.
fn refine_constants(part: &SiteProjection, samples: &LawSamples<'_>, mut best: ScoredProduct) -> ScoredProduct {
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

/// The simplest of the laws with the smallest validation error, and those that are nearly equal; `None` if the best
/// does not satisfy `is_one`. A law is nearly equal if it is worse by less than some independent samples, whose squares
/// `scatter` gives.
fn select_law(
    tried: Vec<LawTrial>,
    without: &ValidatedLaw,
    samples: &LawSamples<'_>,
    is_one: &dyn Fn(&LawTrial) -> bool,
    scatter: &dyn Fn(&LawTrial) -> f64,
) -> Option<(LawTrial, Vec<LawTrial>)> {
    // Laws of the library have been tried as effects already.
    let is_new = |one: &LawTrial| {
        let mut terms = one.terms.iter();
        terms.any(|term| !term.is_in_library(&samples.sites[one.site]))
    };
    let all = tried.into_iter().filter(is_new);
    let (mut laws, double): (Vec<LawTrial>, Vec<LawTrial>) = all.partition(|one| one.terms.len() == 1);
    // Index of the law with the smallest validation error.
    let least = |all: &[LawTrial]| -> Option<usize> {
        let totals = all.iter().map(|one| one.validation.total()).enumerate();
        totals.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    };
    // Two terms replace one only if they are clearly better.
    if let (Some(one), Some(two)) = (least(&laws), least(&double)) {
        let (more, deviation) = laws[one].validation.excess_over(&double[two].validation);
        if more > SECOND_TERM_LEAST_T * deviation && more > LEAST_GAIN * without.total() {
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
    // Keep all laws within the noise of the best, then choose the simplest.
    let less = without.total() - first.validation.total();
    let most = first.validation.total() + (MIN_DISTINCTION * scatter(first)).max(LAW_SAME_SHARE * less);
    laws.retain(|one| one.validation.total() <= most);
    let simplest = (0..laws.len()).min_by_key(|k| laws[*k].size)?;
    let chosen = laws.remove(simplest);
    // Of each form only the best is reported.
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

/// Forms of the products of a law.
fn product_forms(one: &LawTrial) -> Vec<ProductForm> {
    one.terms.iter().map(LawProduct::product_form).collect()
}
