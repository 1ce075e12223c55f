//! Alternatives to what is hidden: claimed effects go in; their residual of the true forces without noise comes out.
//!
//! Two explanations with the same residual are indistinguishable on these recordings.
//!
//! Decision: a claim in place of the truth counts only if it names the truth as its alternative, and if, fitted to
//! the noise-free forces of both runs, it leaves less than three standard deviations of the noise with values of
//! physically possible sign.

use std::iter::repeat;

use crate::case::{COARSE, HiddenCase, RATE};
use crate::columns::{columns, constants, must_be_positive};
use crate::hidden::{HiddenEffect, choices};
use crate::judge::{CaseClass, SAME};
use crate::placed::{EffectAtom, HOLDS, PlacedEffect, atoms};
use crate::plant::SpidermillPlant;
use crate::span::{ColumnSpan, norm, rms};

impl HiddenCase {
    /// Squared residual of the true forces of both runs with the claimed effects, in units of the noise variance.
    ///
    /// Infinite if a claim has no columns, or if a value has a physically impossible sign.
    pub fn excess(&self, plant: &SpidermillPlant, claims: &[PlacedEffect]) -> Result<f64, String> {
        // Rows of the fit come first, then those of the validation run.
        let both = |of: &dyn Fn(usize) -> Result<Vec<f64>, String>| -> Result<Vec<f64>, String> {
            Ok([of(0)?, of(1)?].concat())
        };
        let [fit, check] = &self.coarse;
        let base = [fit.base(&plant.derivation)?, check.base(&plant.derivation)?];
        let base = joined(&base[0], &base[1]);
        let total = both(&|k| self.forces(&self.coarse[k], &self.courses[k]))?;
        let beside = self.masses_hidden()?;
        let of = |claim: &PlacedEffect, constant: f64| {
            let fit = columns(fit, claim, constant, &beside)?;
            Some(joined(&fit, &columns(check, claim, constant, &beside)?))
        };
        // All columns of each claim, with the first value of its shape parameter.
        let mut all: Vec<Vec<Vec<f64>>> = Vec::new();
        for claim in claims {
            all.push(if claim.kind == "time_delay" {
                // If a delay is hidden, its exact change of the forces is the column, else that of a small delay.
                let delayed = self.hidden.iter().any(|one| one.delay() > 0.0);
                let column = if delayed {
                    let prompt = both(&|k| self.prompt_forces(&self.coarse[k]))?;
                    total.iter().zip(&prompt).map(|(a, b)| a - b).collect()
                } else {
                    both(&|k| self.delay_column(k))?
                };
                vec![column]
            } else {
                match of(claim, constants(&claim.kind)[0]) {
                    Some(columns) => columns,
                    None => return Ok(f64::INFINITY),
                }
            });
        }
        // Shape parameters are chosen one by one for the least residual together with all other claims, in two passes.
        for (k, claim) in [claims, claims].concat().iter().enumerate() {
            let k = k % claims.len();
            let mut tried = constants(&claim.kind);
            if tried.len() == 1 {
                continue;
            }
            // The true shape parameter is tried as well, so that a grid cannot miss it.
            let same = self.hidden.iter().filter(|h| h.placed.kind == claim.kind);
            tried.extend(same.filter_map(HiddenEffect::constant));
            let mut others = ColumnSpan::from_columns(base.clone());
            let rest = all.iter().enumerate().filter(|(j, _)| *j != k);
            others.extend(rest.flat_map(|(_, columns)| columns.clone()));
            let mut least = f64::INFINITY;
            for constant in tried {
                let Some(columns) = of(claim, constant) else {
                    return Ok(f64::INFINITY);
                };
                let mut with = others.clone();
                with.extend(columns.clone());
                let left = rms(&with.rest(&total));
                if left < least {
                    least = left;
                    all[k] = columns;
                }
            }
        }
        // Each column with whether its value must be positive.
        let mut claimed: Vec<(Vec<f64>, bool)> = Vec::new();
        for (claim, columns) in claims.iter().zip(all) {
            let signs = must_be_positive(&claim.kind).iter().copied();
            claimed.extend(columns.into_iter().zip(signs.chain(repeat(false))));
        }
        let mut span = ColumnSpan::from_columns(base.clone());
        span.extend(claimed.iter().map(|(column, _)| column.clone()));
        if self.has_wrong_sign(&base, &claimed, &total) {
            return Ok(f64::INFINITY);
        }
        // Squares of the coarse samples are scaled to the number of recorded ones.
        let rest = rms(&span.rest(&total)) / self.noise;
        let rows = total.len() as f64 * RATE / COARSE;
        Ok(rest * rest * rows)
    }

    /// Whether a least-squares value that must be positive is below minus three standard deviations.
    fn has_wrong_sign(&self, base: &[Vec<f64>], claimed: &[(Vec<f64>, bool)], total: &[f64]) -> bool {
        claimed.iter().enumerate().any(|(k, (column, positive))| {
            if !positive {
                return false;
            }
            let mut others = ColumnSpan::from_columns(base.to_vec());
            let rest = claimed.iter().enumerate().filter(|(j, _)| *j != k);
            others.extend(rest.map(|(_, (column, _))| column.clone()));
            let own = others.rest(column);
            // The value times the norm of its independent column, and its standard deviation for all recorded samples.
            let size: f64 = own.iter().zip(total).map(|(a, b)| a * b).sum::<f64>() / norm(&own);
            let deviation = self.noise * (COARSE / RATE).sqrt();
            norm(&own) > 1e-9 * norm(column) && size < -3.0 * deviation
        })
    }

    /// Choices of one kind that are indistinguishable from the one hidden effect; empty for other classes.
    ///
    /// Ripple is not tried, because its wavelength is estimated.
    pub fn doubles(&self, plant: &SpidermillPlant) -> Result<Vec<PlacedEffect>, String> {
        let truth = atoms(&self.placed());
        let mut doubles = Vec::new();
        if self.class != CaseClass::One {
            return Ok(doubles);
        }
        for choice in choices() {
            let claims = choice.claims();
            // A choice that contains the truth is not an alternative to it.
            let holds = |(kind, place): &EffectAtom| {
                let mut less = vec![kind.as_str()];
                less.extend(HOLDS.iter().filter(|(more, _)| more == kind).map(|(_, l)| *l));
                less.iter()
                    .any(|kind| truth.contains(&((*kind).to_owned(), place.clone())))
            };
            if choice.kind == "force_ripple" || atoms(&claims).iter().any(holds) {
                continue;
            }
            if self.excess(plant, &claims)? < SAME {
                doubles.extend(claims);
            }
        }
        Ok(doubles)
    }
}

/// Columns of the fit, each followed by the column of the validation run.
fn joined(fit: &[Vec<f64>], check: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let pairs = fit.iter().zip(check);
    pairs.map(|(a, b)| [a.as_slice(), b].concat()).collect()
}
