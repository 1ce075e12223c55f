//! A model with other vectors of gravity. Each is derived once, since recordings of one machine may need the same ones.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use modelmill_spec::edit::write_gravity;

use crate::error::{Error, Outcome};
use crate::model::Model;

/// Vectors of gravity whose models are kept: the axes of the base with both signs. By judgement.
const MOST_KEPT: usize = 6;

/// Models that were derived with another gravity.
#[derive(Clone, Default)]
pub(super) struct GravityVariants(Arc<Mutex<Vec<GravityVariant>>>);

/// One of them.
struct GravityVariant {
    /// The bits of the components of gravity, m/s^2.
    bits: [u64; 3],
    /// The model.
    model: Model,
}

impl Model {
    /// The model with another vector of gravity, m/s^2. Its file has the new entry, so that effects can be added to it.
    ///
    /// Fails when the entry cannot be written, or when the derivation fails.
    pub(crate) fn with_gravity(&self, gravity: [f64; 3]) -> Outcome<Self> {
        let known = || (self.gravity_variants.0.lock()).unwrap_or_else(PoisonError::into_inner);
        let bits = gravity.map(f64::to_bits);
        let same = known()
            .iter()
            .find(|other| other.bits == bits)
            .map(|other| other.model.clone());
        // Nothing is locked during a derivation, which may wait for other threads.
        let derived = if let Some(same) = same {
            same
        } else {
            let text = write_gravity(self.text(), gravity).map_err(Error::input)?;
            let host = self.host.clone().without_notes();
            let loaded = host.load_text(Path::new(&self.path), &text)?;
            let derived = host.derive(&self.path, loaded)?;
            let mut known = known();
            // The oldest one makes room, so that a direction that recordings ask for again stays.
            if known.len() >= MOST_KEPT {
                known.remove(0);
            }
            let model = derived.clone();
            known.push(GravityVariant { bits, model });
            derived
        };
        // Values may differ between clones that share the derivations.
        Ok(derived.with_values_of(self).with_host(&self.host))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_is_derived_once_and_values_are_those_of_the_model() {
        let model = Model::open("../model-spec/models/two_link.toml").unwrap();
        let side = [9.81, 0.0, 0.0];
        let first = model.with_gravity(side).unwrap();
        let values: Vec<f64> = model.values.iter().map(|value| 2.0 * value).collect();
        let second = model.with_values(&values).with_gravity(side).unwrap();
        assert!(Arc::ptr_eq(&first.derivation, &second.derivation));
        assert_eq!(second.gravity().map(f64::to_bits), side.map(f64::to_bits));
        assert_ne!(first.values, second.values);
        // The latest directions are kept, however many there are.
        for k in 0..=MOST_KEPT {
            let tilted = [0.1 * (k as f64 + 1.0), 9.81, 0.0];
            let [one, again] = [(); 2].map(|()| model.with_gravity(tilted).unwrap());
            assert!(Arc::ptr_eq(&one.derivation, &again.derivation), "{k}");
        }
        assert_eq!(model.gravity_variants.0.lock().unwrap().len(), MOST_KEPT);
        // Another direction is another derivation.
        let up = model.with_gravity([0.0, 9.81, 0.0]).unwrap();
        assert!(!Arc::ptr_eq(&first.derivation, &up.derivation));
    }
}
