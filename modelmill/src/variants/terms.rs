//! What makes the difference of forces between two models: the summands of base parameters, eq. (16), each with its column.
//!
//! Forces are linear in base parameters, `f = sum_k h_k p_k`, and each base parameter is a sum of products of parameters, so
//! that the difference of forces is a sum too: for each summand `h'_k v' - h_k v`, with its values and columns in both models.
//! The share of a summand for a drive is what its part of the difference projects on the whole of it,
//! `<h'_k v' - h_k v, f' - f> / <f' - f, f' - f>` over all samples. Shares add up to 1; one that works against the difference
//! is negative, and where summands nearly cancel, shares are large. A share falls into what the value does along the mean
//! column, `<(h_k + h'_k)/2 (v' - v), f' - f>`, and what the column does with the mean value, which is geometry and effects.

use std::collections::BTreeMap;

use modelmill_codegen::{ModelEvaluator, PoseFault, review};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::stretch::RecordingSegment;

/// Shares below this are rounding and left out.
const ROUNDING: f64 = 1e-12;

/// The share that a product of parameters has in a difference of forces, through all base parameters that it is in. Unlike
/// that of a single summand it does not depend on which columns are retained.
#[derive(Clone, Debug, PartialEq)]
pub struct ProductShare {
    /// The product of p_g, eq. (5), such as `mP`; an expression of p_min where its value was identified as a whole.
    pub product: String,
    /// Its share.
    pub share: f64,
    /// Its summands in base parameters, the largest share first; theirs add up to that of the product.
    pub terms: Vec<TermShare>,
}

/// The share of one summand of a base parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct TermShare {
    /// The summand, such as `LB*mP`.
    pub term: String,
    /// The base parameter that it is in, by its retained product.
    pub retained: String,
    /// Unit of its value.
    pub unit: String,
    /// Its value in the first model; absent where it is no summand there.
    pub before: Option<f64>,
    /// Its value in the second model; absent where it is no summand there.
    pub after: Option<f64>,
    /// Its share.
    pub share: f64,
    /// What its value makes of that share; the rest is its column, which other geometry and other constants of effects change.
    pub by_value: f64,
}

/// A summand in both models.
struct SummandPair {
    product: String,
    retained: String,
    /// Where it stands in each model.
    places: [Option<SummandPlace>; 2],
}

/// A summand in a model.
#[derive(Clone, Copy)]
struct SummandPlace {
    base: usize,
    /// Position in p_g; none where the base parameter is taken as a whole.
    product: Option<usize>,
    value: f64,
}

/// Summands, and their columns held against the differences of forces.
pub(super) struct SummandColumns {
    slots: Vec<SummandPair>,
    /// For each model `<h_k, f' - f>`, by pair of drives and base parameter.
    inner: [Vec<Vec<f64>>; 2],
}

impl SummandColumns {
    /// The summands of both models, without samples yet.
    pub(super) fn from_models(models: [&Model; 2]) -> Self {
        let is_whole = |retained: &str| {
            models.iter().any(|model| {
                let mut base = model.base.iter().zip(0..);
                base.any(|(one, k)| one.retained == retained && model.is_identified(k))
            })
        };
        let mut places: BTreeMap<(String, String), usize> = BTreeMap::new();
        let mut slots: Vec<SummandPair> = Vec::new();
        for (m, model) in models.into_iter().enumerate() {
            for (product, place) in summands(model, &is_whole) {
                let retained = model.base[place.base].retained.clone();
                let key = (retained.clone(), product.clone());
                let slot = *places.entry(key).or_insert_with(|| {
                    slots.push(SummandPair {
                        product,
                        retained,
                        places: [None; 2],
                    });
                    slots.len() - 1
                });
                slots[slot].places[m] = Some(place);
            }
        }
        Self {
            slots,
            inner: [Vec::new(), Vec::new()],
        }
    }

    /// Adds a motion: the states of each model, pairs of drives, and for each pair the difference of forces, `[pair][sample]`.
    pub(super) fn add(
        &mut self,
        models: [&Model; 2],
        states: &[RecordingSegment; 2],
        pairs: &[[usize; 2]],
        rest: &[Vec<f64>],
    ) -> Outcome {
        for (m, model) in models.into_iter().enumerate() {
            let n = model.base.len();
            let sums = &mut self.inner[m];
            sums.resize(pairs.len(), vec![0.0; n]);
            let evaluator = ModelEvaluator::new(&model.derivation);
            let what = format!(
                "seeing what makes the difference along {}",
                states[m].run.file
            );
            let mut start = 0;
            model.host().run_job(&what, states[m].samples(), |job| {
                states[m].for_each_block(model, |block| {
                    job.step(block.len())?;
                    let found = evaluator.regressor_blocks(block, |len, columns| {
                        for ((sums, pair), rest) in sums.iter_mut().zip(pairs).zip(rest) {
                            let rest = &rest[start..start + len];
                            let own = &columns[pair[m] * n..][..n];
                            for (sum, column) in sums.iter_mut().zip(own) {
                                *sum += column.iter().zip(rest).map(|(h, r)| h * r).sum::<f64>();
                            }
                        }
                        start += len;
                        Ok::<_, PoseFault>(())
                    });
                    Ok::<_, Error>(found)
                })
            })??;
        }
        Ok(())
    }

    /// The shares for a pair of drives; `squares` is the sum of the squared difference of forces, not 0.
    pub(super) fn shares(
        &self,
        models: [&Model; 2],
        pair: usize,
        squares: f64,
    ) -> Vec<ProductShare> {
        let mut products: Vec<ProductShare> = Vec::new();
        for slot in &self.slots {
            let [before, after] = [0, 1].map(|m| {
                let place = slot.places[m]?;
                Some((place.value, self.inner[m][pair][place.base]))
            });
            let part = |one: Option<(f64, f64)>| one.map_or(0.0, |(value, inner)| value * inner);
            let share = (part(after) - part(before)) / squares;
            let by_value = match (before, after) {
                (Some((v, u)), Some((w, x))) => 0.5 * (w - v) * (u + x) / squares,
                // What is new or gone has one column only.
                _ => share,
            };
            if share.abs() < ROUNDING && by_value.abs() < ROUNDING {
                continue;
            }
            let term = TermShare {
                term: slot.text(models),
                retained: slot.retained.clone(),
                unit: slot.unit(models),
                before: before.map(|(value, _)| value),
                after: after.map(|(value, _)| value),
                share,
                by_value,
            };
            match products.iter_mut().find(|one| one.product == slot.product) {
                Some(one) => {
                    one.share += share;
                    one.terms.push(term);
                }
                None => products.push(ProductShare {
                    product: slot.product.clone(),
                    share,
                    terms: vec![term],
                }),
            }
        }
        for one in &mut products {
            one.terms
                .sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
        }
        products.sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
        products
    }
}

impl SummandPair {
    /// The place in the second model, or in the first where there is none.
    fn latest_place<'a>(&self, models: [&'a Model; 2]) -> Option<(&'a Model, SummandPlace)> {
        let last = |m: usize| Some((models[m], self.places[m]?));
        last(1).or_else(|| last(0))
    }

    /// The summand as people read it.
    fn text(&self, models: [&Model; 2]) -> String {
        let last = self.latest_place(models);
        let text = last.map(|(model, place)| match place.product {
            Some(product) => review::base_summand(&model.derivation, place.base, product).text(),
            None => model.base[place.base].expression.clone(),
        });
        text.unwrap_or_default()
    }

    fn unit(&self, models: [&Model; 2]) -> String {
        let last = self.latest_place(models);
        last.map_or_else(String::new, |(model, place)| {
            model.base[place.base].unit.clone()
        })
    }
}

/// What the base parameters of a model are sums of, with the products in words; one that `is_whole` names is one summand.
fn summands(model: &Model, is_whole: &dyn Fn(&str) -> bool) -> Vec<(String, SummandPlace)> {
    let mechanism = &model.derivation.mechanism;
    let reduction = &model.derivation.reduction;
    let parameters: Vec<f64> = mechanism.parameters.iter().map(|p| p.nominal).collect();
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let factors = reduction.factors(&constants);
    let mut found = Vec::new();
    for (base, one) in model.base.iter().enumerate() {
        if is_whole(&one.retained) {
            let place = SummandPlace {
                base,
                product: None,
                value: model.nominal[base],
            };
            found.push((one.retained.clone(), place));
            continue;
        }
        let lines = reduction.dependencies.iter().zip(&factors);
        let dependent =
            lines.filter_map(|(line, factors)| Some((line.product, *factors.get(&base)?)));
        let retained = std::iter::once((reduction.retained[base], 1.0));
        for (product, factor) in retained.chain(dependent) {
            let monomial = &reduction.products[product];
            let place = SummandPlace {
                base,
                product: Some(product),
                value: factor * monomial.value(&parameters),
            };
            found.push((monomial.text(mechanism), place));
        }
    }
    found
}
