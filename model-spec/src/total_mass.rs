//! The sum of all masses at the nominal values, by which wrong units of masses show.

use crate::exact::{ExactExpression, ModelSymbol};
use crate::mechanism::{EffectBodies, FrameIdx, LumpedMass, Mechanism, ModelPart, PartInertia};

impl Mechanism {
    /// The sum of the nominal masses of all bodies that are not fixed to the base, those of effects included, kg.
    ///
    /// `None` if the file does not give all of them, or describes no mass.
    pub fn total_nominal_mass(&self) -> Option<f64> {
        let of_effects = self.effects.iter().map(|effect| &effect.bodies);
        let own = self.sum_masses(&self.parts, &self.lumped_masses)?;
        let sums: Option<Vec<f64>> = of_effects
            .map(|EffectBodies { parts, lumped_masses }| self.sum_masses(parts, lumped_masses))
            .collect();
        let total = own + sums?.iter().sum::<f64>();
        (total != 0.0).then_some(total)
    }

    /// The sum of the masses of these bodies, kg; `None` if a parameter of a mass has no nominal value.
    fn sum_masses(&self, parts: &[ModelPart], lumped_masses: &[LumpedMass]) -> Option<f64> {
        let base = FrameIdx(0);
        let parts = parts.iter().filter(|part| part.frame != base);
        let parts = parts.map(|part| match &part.inertial {
            PartInertia::AboutCentre { mass, .. } | PartInertia::Linear { mass, .. } => self.nominal_mass(mass),
        });
        let lumped = lumped_masses.iter().filter(|lumped| lumped.frame != base);
        let lumped = lumped.map(|lumped| Some(crate::print::to_f64(&lumped.share) * self.nominal_mass(&lumped.mass)?));
        parts.chain(lumped).sum()
    }

    /// The value of a mass, kg; `None` if one of its parameters has no nominal value.
    fn nominal_mass(&self, mass: &ExactExpression) -> Option<f64> {
        let is_unknown = |symbol| match symbol {
            ModelSymbol::Parameter(i) => !self.parameters[i.0].has_nominal,
            _ => false,
        };
        (!mass.mentions(&is_unknown)).then(|| mass.evaluate(&|symbol| self.symbol_nominal(symbol)))
    }
}
