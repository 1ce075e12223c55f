//! The sum of all masses at the nominal values, by which wrong units of masses show.

use crate::exact::{ExactExpression, ModelSymbol};
use crate::mechanism::{
    EffectBodies, EffectPlace, FrameIdx, LumpedMass, Mechanism, ModelEffect, ModelPart, PartInertia, carrying_frame,
};

impl Mechanism {
    /// The sum of the nominal masses of all bodies that move relative to the base, those of effects and masses at points
    /// included, kg.
    ///
    /// `None` if the file does not give all of them, or describes no mass.
    pub fn total_nominal_mass(&self) -> Option<f64> {
        let total = self.sum_of_masses(&|body| body != FrameIdx(0))?;
        (total != 0.0).then_some(total)
    }

    /// The nominal mass of the body that contains a frame, with all parts, lumped masses and masses at points that move
    /// with it, kg; `None` if the file does not give all of them.
    pub(crate) fn nominal_mass_of_body(&self, frame: FrameIdx) -> Option<f64> {
        let body = carrying_frame(&self.frames, frame);
        self.sum_of_masses(&|other| other == body)
    }

    /// The sum of the masses of the bodies that are included, by the frames that carry them, kg; `None` if a parameter
    /// of a mass has no nominal value.
    fn sum_of_masses(&self, is_included: &dyn Fn(FrameIdx) -> bool) -> Option<f64> {
        let is_counted = |frame: FrameIdx| is_included(carrying_frame(&self.frames, frame));
        let own = self.sum_bodies(&self.parts, &self.lumped_masses, &is_counted)?;
        let of_effects: Option<Vec<f64>> = self
            .effects
            .iter()
            .map(|effect| {
                let EffectBodies { parts, lumped_masses } = &effect.bodies;
                let bodies = self.sum_bodies(parts, lumped_masses, &is_counted)?;
                Some(bodies + self.mass_at_points(effect, &is_counted)?)
            })
            .collect();
        Some(own + of_effects?.iter().sum::<f64>())
    }

    /// The sum of the masses of these bodies, kg; `None` if a parameter of a mass has no nominal value.
    fn sum_bodies(
        &self,
        parts: &[ModelPart],
        lumped_masses: &[LumpedMass],
        is_counted: &dyn Fn(FrameIdx) -> bool,
    ) -> Option<f64> {
        let parts = parts.iter().filter(|part| is_counted(part.frame));
        let parts = parts.map(|part| match &part.inertial {
            PartInertia::AboutCentre { mass, .. } | PartInertia::Linear { mass, .. } => self.nominal_mass(mass),
        });
        let lumped = lumped_masses.iter().filter(|lumped| is_counted(lumped.frame));
        let lumped = lumped.map(|lumped| Some(crate::print::to_f64(&lumped.share) * self.nominal_mass(&lumped.mass)?));
        parts.chain(lumped).sum()
    }

    /// The masses that an effect adds at points, kg; `None` if one of its parameters has no nominal value.
    fn mass_at_points(&self, effect: &ModelEffect, is_counted: &dyn Fn(FrameIdx) -> bool) -> Option<f64> {
        // Effects with mechanics of their own add bodies or forces instead.
        if effect.mechanics.is_some() {
            return Some(0.0);
        }
        let is_at_point = |place: &&EffectPlace| match place {
            EffectPlace::Point(point) => is_counted(self.points[point.0].frame),
            _ => false,
        };
        let places = effect.places.iter().filter(is_at_point).count();
        if places == 0 {
            return Some(0.0);
        }
        let terms = effect.terms.iter().map(|term| {
            let parameter = &self.parameters[term.parameter.0];
            let factor = term.expression.evaluate(&|symbol| self.symbol_nominal(symbol));
            parameter.has_nominal.then_some(factor * parameter.nominal)
        });
        Some(places as f64 * terms.sum::<Option<f64>>()?)
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
