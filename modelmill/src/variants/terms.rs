//! Causes of a difference of forces between two models: the summands of base parameters, eq. (16), each with its
//! column.
//!
//! Forces are linear in base parameters, `f = sum_k h_k p_k`, and each base parameter is a sum of products of
//! parameters. Therefore the difference of forces is a sum too: for each summand `h'_k v' - h_k v`, with its values
//! and columns in both models. The share of a summand for a drive is the projection of its part on the complete
//! difference, `<h'_k v' - h_k v, f' - f> / <f' - f, f' - f>` over all samples. Shares add up to 1. A summand that
//! reduces the difference has a negative share; where summands nearly cancel, shares are large. A share has two
//! parts: the change of the value along the mean column, `<(h_k + h'_k)/2 (v' - v), f' - f>`, and the change of the
//! column with the mean value, which is due to geometry and effects.

use std::collections::BTreeMap;

use modelmill_codegen::{ModelEvaluator, PoseFault, review};

use super::thresholds::CAUSE_LEAST_SHARE;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::segment::RecordingSegment;

/// The share of a product of parameters in a difference of forces, over all base parameters that contain it. Unlike
/// the share of a single summand, it does not depend on which columns are retained.
#[derive(Clone, Debug, PartialEq)]
pub struct ProductShare {
    /// The product of p_g, eq. (5), such as `mP`. If a base parameter has an identified value in one of the models, its
    /// products are not known separately. Then its expression is used.
    pub product: String,
    /// Its share, 1 for the complete difference.
    pub share: f64,
    /// Its summands in base parameters, the largest share first; they add up to the share of the product.
    pub terms: Vec<TermShare>,
}

/// The share of one summand of a base parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct TermShare {
    /// The summand, such as `LB*mP`.
    pub term: String,
    /// The retained product of the base parameter that contains it.
    pub retained: String,
    /// Unit of its value.
    pub unit: String,
    /// Its value in the first model; `None` if it is no summand there.
    pub before: Option<f64>,
    /// Its value in the second model; `None` if it is no summand there.
    pub after: Option<f64>,
    /// Its share.
    pub share: f64,
    /// The part of the share due to the change of its value. The rest is due to the change of its regressor column, by
    /// other geometry or other constants of effects.
    pub by_value: f64,
}

/// A summand in both models.
struct SummandPair {
    /// The product of parameters, as text.
    product: String,
    /// The retained product of its base parameter.
    retained: String,
    /// Its place in each model; `None` if it is no summand there.
    places: [Option<SummandPlace>; 2],
}

/// The place of a summand in a model.
#[derive(Clone, Copy)]
struct SummandPlace {
    /// Index of the base parameter.
    base: usize,
    /// Index in p_g; `None` if the base parameter is treated as one number.
    product: Option<usize>,
    /// Its value, in the unit of the base parameter.
    value: f64,
}

/// Summands, and the inner products of their columns with the differences of forces.
pub(super) struct SummandColumns {
    /// One entry for each summand of either model.
    slots: Vec<SummandPair>,
    /// For each model `<h_k, f' - f>`, by pair of drives and base parameter.
    inner: [Vec<Vec<f64>>; 2],
}

impl SummandColumns {
    /// The summands of both models, without samples yet.
    pub(super) fn from_models(models: [&Model; 2]) -> Self {
        // A base parameter that was identified as one number in either model has no summands in both.
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
                // Summands are matched by retained product and product.
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

    /// Adds a motion: the states of each model, pairs of drives, and for each pair the difference of forces,
    /// `[pair][sample]`.
    ///
    /// Fails when a pose has no solution, or when it is cancelled.
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
            let what = format!("finding the causes of the difference along {}", states[m].run.file);
            let mut start = 0;
            model.host().run_job(&what, states[m].samples(), |job| {
                states[m].for_each_block(model, |block| {
                    job.step(block.len())?;
                    let found = evaluator.regressor_blocks(block, |len, columns| {
                        for ((sums, pair), rest) in sums.iter_mut().zip(pairs).zip(rest) {
                            // Only the columns of the compared drive contribute.
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

    /// The shares for a pair of drives, the largest first; `squares` is the sum of squares of the difference, not
    /// 0.
    pub(super) fn shares(&self, models: [&Model; 2], pair: usize, squares: f64) -> Vec<ProductShare> {
        let mut products: Vec<ProductShare> = Vec::new();
        for slot in &self.slots {
            let [before, after] = [0, 1].map(|m| {
                let place = slot.places[m]?;
                Some((place.value, self.inner[m][pair][place.base]))
            });
            // The share of the summand in the difference, and the part of it from its value.
            let part = |one: Option<(f64, f64)>| one.map_or(0.0, |(value, inner)| value * inner);
            let share = (part(after) - part(before)) / squares;
            let by_value = match (before, after) {
                (Some((v, u)), Some((w, x))) => 0.5 * (w - v) * (u + x) / squares,
                // A summand of one model only has one column.
                _ => share,
            };
            if share.abs() < CAUSE_LEAST_SHARE && by_value.abs() < CAUSE_LEAST_SHARE {
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
            // Summands are grouped by their product.
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
            one.terms.sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
        }
        products.sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
        products
    }
}

impl SummandPair {
    /// The place in the second model, or in the first if there is none.
    fn latest_place<'a>(&self, models: [&'a Model; 2]) -> Option<(&'a Model, SummandPlace)> {
        let last = |m: usize| Some((models[m], self.places[m]?));
        last(1).or_else(|| last(0))
    }

    /// The summand as text, with its factor.
    fn text(&self, models: [&Model; 2]) -> String {
        let last = self.latest_place(models);
        let text = last.map(|(model, place)| match place.product {
            Some(product) => review::base_summand(&model.derivation, place.base, product).text(),
            None => model.base[place.base].expression.clone(),
        });
        text.unwrap_or_default()
    }

    /// The unit of its base parameter.
    fn unit(&self, models: [&Model; 2]) -> String {
        let last = self.latest_place(models);
        last.map_or_else(String::new, |(model, place)| model.base[place.base].unit.clone())
    }
}

/// The summands of all base parameters of a model, each with its product as text; a base parameter for which
/// `is_whole` holds is one summand.
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
                value: model.values[base],
            };
            found.push((one.retained.clone(), place));
            continue;
        }
        // The retained product has the factor 1, the dependent ones those of eq. (6).
        let lines = reduction.dependencies.iter().zip(&factors);
        let dependent = lines.filter_map(|(line, factors)| Some((line.product, *factors.get(&base)?)));
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
