//! Values of gains and delays with which the forces of actuators follow from their signals.
//!
//! A gain has its nominal value if the model file gives one. Otherwise it is identified from the signals. Base parameters
//! of the identification determine gains up to directions that no data can distinguish from the effects of the model,
//! such as `kd` and viscous friction: any choice among these leaves the balance of forces unchanged.

use std::collections::BTreeMap;

use modelmill_spec::{ActuatorTerm, Mechanism, ModelActuator};

use super::ServoModel;
use super::delay::ServoDelay;
use super::estimate::{ServoIdentification, ServoStatus};
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::text::table::number;

/// A product of parameters with their powers, as it stands in a term of an actuator.
pub(super) type GainProduct = Vec<(usize, u32)>;

/// Values of the gains of all actuators.
pub(super) struct GainValues {
    /// Values by product.
    values: BTreeMap<GainProduct, f64>,
    /// The products that were identified and are no nominal values.
    identified: Vec<GainProduct>,
}

impl GainValues {
    /// Nominal values where the file gives them; the others are identified from recordings.
    ///
    /// Fails when a gain has no nominal value, and the recordings determine only ratios.
    pub(super) fn new(model: &Model, servo: &ServoModel, fit: &[&PreparedRecording]) -> Outcome<Self> {
        // A fit changes these nominal values, and no derivation.
        let mechanism = &model.loaded.mechanism;
        let mut all = Self {
            values: BTreeMap::new(),
            identified: Vec::new(),
        };
        for term in mechanism.actuators.iter().flat_map(|actuator| &actuator.terms) {
            let product = product_of(term);
            if let Some(value) = nominal_value(mechanism, &product) {
                all.values.insert(product, value);
            } else if !all.identified.contains(&product) {
                all.identified.push(product);
            }
        }
        if !all.identified.is_empty() {
            let found = servo.identify(fit, &[])?;
            all.add_identified(servo, &found)?;
        }
        Ok(all)
    }

    /// The gains that belong to values of the base parameters of the equations.
    pub(super) fn from_base_values(servo: &ServoModel, base: &[f64]) -> Self {
        let terms = servo.actuators().iter().flat_map(|actuator| &actuator.terms);
        let products = terms.map(product_of).filter(|product| !product.is_empty());
        let values = products.map(|product| {
            let value = retaining(servo, &product).map_or(0.0, |k| base[k]);
            (product, value)
        });
        Self {
            values: values.collect(),
            identified: Vec::new(),
        }
    }

    /// Adds the values of products without nominal ones from an identification.
    fn add_identified(&mut self, servo: &ServoModel, found: &ServoIdentification) -> Outcome {
        for product in self.identified.clone() {
            // A product whose column was not kept acts like parameters of the model, which then contain it.
            let mut value = 0.0;
            if let Some(k) = retaining(servo, &product) {
                let parameter = &found.parameters[k];
                if !matches!(parameter.status, ServoStatus::Identified | ServoStatus::Known) {
                    return Err(Error::input(format!(
                        "{}: the forces of the drives cannot be computed from signals, since the value of {} is unknown and the \
                         recordings determine {}; give a nominal value for it in [parameters]{}",
                        servo.equations.path,
                        parameter.expression,
                        if parameter.status == ServoStatus::Undetermined {
                            "nothing about it"
                        } else {
                            "only ratios"
                        },
                        fixing_clause(servo, k),
                    )));
                }
                let mechanism = &servo.model.loaded.mechanism;
                let known = servo.equations.products_of(k).into_iter().skip(1);
                let known = known.filter_map(|(other, factor)| {
                    let gain = self.values.get(&other.0).copied();
                    // The model applies the nominal value of its friction itself.
                    Some(factor * gain.or_else(|| nominal_value(mechanism, &other.0))?)
                });
                value = parameter.value - known.sum::<f64>();
            }
            self.values.insert(product, value);
        }
        Ok(())
    }

    /// The slopes of the force of an actuator, see [`ModelActuator::slopes`].
    pub(super) fn slopes(&self, model: &Model, actuator: &ModelActuator) -> [f64; 4] {
        let constants = &model.derivation.mechanism.constants;
        actuator.slopes(&|c| constants[c].value, &|term| self.term_value(term))
    }

    /// The value of the parameters of a term; 1 if the term is known.
    fn term_value(&self, term: &ActuatorTerm) -> f64 {
        self.values.get(&product_of(term)).copied().unwrap_or(1.0)
    }

    /// The gains of an actuator as a phrase; `None` if all are numbers of the formula.
    pub(super) fn phrase<'a>(
        &self,
        mechanism: &Mechanism,
        terms: impl Iterator<Item = &'a ActuatorTerm>,
    ) -> Option<String> {
        let mut parts: Vec<String> = Vec::new();
        for product in terms.map(product_of).filter(|product| !product.is_empty()) {
            let names: Vec<&str> = product
                .iter()
                .map(|(p, _)| mechanism.parameters[*p].name.as_str())
                .collect();
            let unit = match product.as_slice() {
                [(p, 1)] => format!(" {}", mechanism.parameters[*p].unit),
                _ => String::new(),
            };
            let origin = if self.identified.contains(&product) {
                "identified from the signals"
            } else {
                "nominal"
            };
            let value = self.values.get(&product).copied().unwrap_or(0.0);
            let part = format!("{} = {}{unit} ({origin})", names.join("*"), number(value));
            if !parts.contains(&part) {
                parts.push(part);
            }
        }
        (!parts.is_empty()).then(|| parts.join(", "))
    }

    /// Whether some values were identified.
    pub(super) fn has_identified(&self) -> bool {
        !self.identified.is_empty()
    }
}

/// The base parameter whose column is that of a product; `None` if it depends on others.
pub(super) fn retaining(servo: &ServoModel, product: &GainProduct) -> Option<usize> {
    (0..servo.equations.base.len()).find(|k| {
        let products = servo.equations.products_of(*k);
        products.first().is_some_and(|(first, _)| first.0 == *product)
    })
}

impl ServoModel {
    /// Whether only a ratio of the gain of a term can be known.
    pub(super) fn is_ratio(&self, term: &ActuatorTerm) -> bool {
        let product = product_of(term);
        !product.is_empty() && retaining(self, &product).is_some_and(|k| self.scale.is_open(k))
    }
}

/// What else fixes the scale, as the end of a message.
fn fixing_clause(servo: &ServoModel, base: usize) -> String {
    let freedom = servo.scale.freedoms.iter().find(|one| one.base.contains(&base));
    match freedom.map_or(&[][..], |one| one.fixed_by.as_slice()) {
        [] => String::new(),
        names => format!(", or a number in place of one of {}", names.join(", ")),
    }
}

/// The nominal value of a product; `None` if a parameter has none.
pub(super) fn nominal_value(mechanism: &Mechanism, product: &GainProduct) -> Option<f64> {
    mechanism.nominal_product(product.iter().copied())
}

/// The parameters of a term.
pub(super) fn product_of(term: &ActuatorTerm) -> GainProduct {
    term.parameters.iter().map(|(p, power)| (p.0, *power)).collect()
}

/// A delay as a phrase.
pub(super) fn delay_phrase(delay: &ServoDelay) -> String {
    let ms = |seconds: f64| crate::text::table::significant(1e3 * seconds, 3);
    match delay.interval {
        None => format!("delay {} ms (model file)", ms(delay.value)),
        Some([low, high]) => format!(
            "delay {} ms (estimated, 95 % interval {} to {} ms)",
            ms(delay.value),
            ms(low),
            ms(high)
        ),
    }
}
