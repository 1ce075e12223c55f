//! Nominal values of products of parameters, and parameters of effects by their names.

use crate::exact::ParameterIdx;
use crate::mechanism::Mechanism;

impl Mechanism {
    /// The nominal value of a product of parameters, given as indices with powers; 1 for none. `None` if a parameter has no
    /// nominal value.
    pub fn nominal_product(&self, product: impl Iterator<Item = (usize, u32)>) -> Option<f64> {
        let factor = |(p, power): (usize, u32)| {
            let parameter = &self.parameters[p];
            let power = i32::try_from(power).unwrap_or(i32::MAX);
            parameter.has_nominal.then(|| parameter.nominal.powi(power))
        };
        product.map(factor).product()
    }

    /// The parameter of an effect that has a name; `None` if it belongs to a body or an actuator, or does not exist.
    pub fn effect_parameter(&self, name: &str) -> Option<ParameterIdx> {
        let terms = self.effects.iter().flat_map(|effect| &effect.terms);
        let mut places = terms.map(|term| term.parameter);
        places.find(|p| self.parameters[p.0].name == name)
    }
}
