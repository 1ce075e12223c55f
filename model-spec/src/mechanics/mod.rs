//! Effects that no expression at their place can state: one enum, and one file for each of its variants.
//!
//! Model files, pages and the diagnosis use them through [`MechanicsEntry`]. Generalised forces of those that have
//! some are in `regressor/mechanics` of `modelmill-codegen`.
//!
//! Decision: an effect is an expression at a place wherever an expression can state it. Only effects that act on
//! bodies, on gravity or on the force signal have `mechanics`. Bodies of effects join the others as polynomials of
//! their parameters; a tilt rotates gravity by named constants, so that sines stay exact; a delay is applied where
//! recordings are prepared.

mod delay;
mod part;
mod placement;
mod rod;
mod strut;
mod tilt;

use crate::build::effect_places::EffectTargets;
use crate::build::symbols::SymbolTable as Names;
use crate::diagnostic::DiagnosticLog;
use crate::exact::ExactExpression;
use crate::kinds::ActsOn;
use crate::mechanism::{
    EffectBodies, EffectPlace, EffectTerm, Mechanism, ModelConstant, ModelEffect, ModelPart, PointIdx,
};
use crate::schema::EffectEntry;
use crate::unit::UnitDimension;
use crate::values::SpannedName;
use crate::words::words;

words! {
    /// An effect that no expression at its place can state.
    #[derive(PartialOrd, Ord, Hash)]
    pub Mechanics as "MechanicsName": "mechanics",
    /// A slender rod along each of the linear drives. It rotates about the drive's first point and slides through its
    /// second one. The terms are moments of its mass along itself about the first point: of second order (kg m^2), of
    /// first order (kg m), and the mass (kg). With `a` the first point and `u` the unit vector along the drive, the
    /// generalised force is `du'(Jr u'' + Sr (a'' - g)) + da'(Sr u'' + mr (a'' - g))` (d'Alembert).
    "rod" => Rod,
    /// A passive element along the line between two points. The terms are a constant pull (N), a pull proportional to
    /// the distance `l` of the points (N/m), and one proportional to its rate (N s/m).
    /// The generalised force is `(F0 + k l + Fv l') dl/dq`.
    "strut" => Strut,
    /// Corrects lumped masses: their moments are taken at the point of their forces.
    "placement" => Placement,
    /// Differences of one part from its entry in the model file.
    "part" => Part,
    /// A rotation of the base relative to gravity; [`Mechanism::gravity`] contains the result.
    "tilt" => Tilt,
    /// A delay of the recorded forces; [`Mechanism::force_delay`] contains the time.
    "delay" => Delay,
}

impl Mechanics {
    /// The properties of the variant.
    pub(crate) fn entry(self) -> &'static dyn MechanicsEntry {
        match self {
            Self::Rod => &rod::RodMechanics,
            Self::Strut => &strut::StrutMechanics,
            Self::Placement => &placement::PlacementMechanics,
            Self::Part => &part::PartMechanics,
            Self::Tilt => &tilt::TiltMechanics,
            Self::Delay => &delay::DelayMechanics,
        }
    }

    /// What it does, for places where other kinds print an expression.
    pub fn description(self) -> &'static str {
        self.entry().description()
    }

    /// What it does in a model: the text before the list of its parameters, or of its constants if it has no
    /// parameters.
    pub fn introduction(self) -> &'static str {
        self.entry().introduction()
    }

    /// The text before the value of a constant in a list of constants; empty if there is only one.
    pub fn constant_label(self, symbol: &str) -> &'static str {
        self.entry().constant_label(symbol)
    }

    /// Whether its forces are part of the load of the drives, as those of masses are.
    pub fn is_part_of_load(self) -> bool {
        self.entry().is_part_of_load()
    }

    /// Whether it can change the forces of a model at a place. If not, the diagnosis does not try it there.
    pub fn has_effect_at(self, mechanism: &Mechanism, place: EffectPlace) -> bool {
        self.entry().has_effect_at(mechanism, place)
    }

    /// The symbols of its parameters at a place, if these depend on the place.
    pub fn parameters_at(self, mechanism: &Mechanism, place: EffectPlace) -> Option<Vec<&'static str>> {
        self.entry().parameters_at(place, &mechanism.parts)
    }

    /// Groups of places on which it acts jointly, by positions in the list; `None` if it acts on each place alone.
    pub fn groups(self, mechanism: &Mechanism, places: &[EffectPlace]) -> Option<Vec<Vec<usize>>> {
        self.entry().groups(mechanism, places)
    }

    /// Pairs of points between which it may act; `None` if it acts on single places.
    pub fn pairs(self, mechanism: &Mechanism) -> Option<Vec<[PointIdx; 2]>> {
        self.entry().pairs(mechanism)
    }

    /// Whether it is a property of the complete mechanism, which can occur only once.
    pub(crate) fn is_global(self) -> bool {
        matches!(self.entry().acts_on(), ActsOn::Base | ActsOn::Force)
    }
}

/// Symbols with their dimensions.
pub(crate) type MechanicsSymbols = &'static [(&'static str, UnitDimension)];

/// The properties of one of the [`Mechanics`]. Defaults are those of an effect on a single place without parameters.
pub(crate) trait MechanicsEntry: Sync {
    /// See [`Mechanics::description`].
    fn description(&self) -> &'static str;

    /// See [`Mechanics::introduction`].
    fn introduction(&self) -> &'static str;

    /// See [`Mechanics::constant_label`].
    fn constant_label(&self, _symbol: &str) -> &'static str {
        ""
    }

    /// The only sort of place on which it acts.
    fn acts_on(&self) -> ActsOn;

    /// Its parameters with their dimensions, in the order of an effect's terms.
    fn parameters(&self) -> MechanicsSymbols {
        &[]
    }

    /// Its constants with their dimensions.
    fn constants(&self) -> MechanicsSymbols {
        &[]
    }

    /// How many places an effect must have; `None` for any number.
    fn n_places(&self) -> Option<usize> {
        Some(1)
    }

    /// Reports a place on which it cannot act.
    fn check_place(
        &self,
        _name: &SpannedName,
        _place: EffectPlace,
        _scene: &EffectTargets<'_>,
        _log: &mut DiagnosticLog,
    ) {
    }

    /// Reports places that cannot be combined in one effect.
    fn check_places(
        &self,
        _names: &[SpannedName],
        _places: &[EffectPlace],
        _scene: &EffectTargets<'_>,
        _log: &mut DiagnosticLog,
    ) {
    }

    /// See [`Mechanics::parameters_at`].
    fn parameters_at(&self, _place: EffectPlace, _parts: &[ModelPart]) -> Option<Vec<&'static str>> {
        None
    }

    /// Reports a parameter that an effect names but that does not exist at its place; `those` are the ones that do.
    fn refuse_parameter(&self, _entry: &EffectEntry, _symbol: &str, _those: &[&str], _log: &mut DiagnosticLog) {}

    /// Whether an effect may have only some of its parameters.
    fn may_lack_parameters(&self) -> bool {
        false
    }

    /// The values of an effect's constants, some of which become named constants of the model. `None` after a fault,
    /// which is reported.
    fn named_constants(
        &self,
        values: Vec<(String, ExactExpression)>,
        _kind: &SpannedName,
        _names: &mut Names,
        _log: &mut DiagnosticLog,
    ) -> Option<Vec<(String, ExactExpression)>> {
        Some(values)
    }

    /// Bodies that an effect adds to the mechanism.
    fn bodies(&self, _terms: &[EffectTerm], _places: &[EffectPlace], _scene: &EffectTargets<'_>) -> EffectBodies {
        EffectBodies::default()
    }

    /// Gravity of the mechanism with the effect; `gravity` is that without it, m/s^2.
    fn gravity(&self, _effect: &ModelEffect, gravity: [ExactExpression; 3]) -> [ExactExpression; 3] {
        gravity
    }

    /// Delay of the recorded forces that an effect defines, s.
    fn force_delay(&self, _effect: &ModelEffect, _constants: &[ModelConstant]) -> f64 {
        0.0
    }

    /// See [`Mechanics::is_part_of_load`].
    fn is_part_of_load(&self) -> bool {
        true
    }

    /// See [`Mechanics::has_effect_at`].
    fn has_effect_at(&self, _mechanism: &Mechanism, _place: EffectPlace) -> bool {
        true
    }

    /// See [`Mechanics::pairs`].
    fn pairs(&self, _mechanism: &Mechanism) -> Option<Vec<[PointIdx; 2]>> {
        None
    }

    /// See [`Mechanics::groups`].
    fn groups(&self, _mechanism: &Mechanism, _places: &[EffectPlace]) -> Option<Vec<Vec<usize>>> {
        None
    }
}

/// Gravity of the mechanism with its effects, m/s^2, and the sum of their delays of the recorded forces, s.
pub(crate) fn gravity_and_delay(
    effects: &[ModelEffect],
    mut gravity: [ExactExpression; 3],
    constants: &[ModelConstant],
) -> ([ExactExpression; 3], f64) {
    let mut delay = 0.0;
    for effect in effects {
        if let Some(mechanics) = effect.mechanics {
            gravity = mechanics.entry().gravity(effect, gravity);
            delay += mechanics.entry().force_delay(effect, constants);
        }
    }
    (gravity, delay)
}
