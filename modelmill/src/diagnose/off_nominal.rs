//! Base parameters whose estimates differ from the nominal values, and a warning if no physical body could have
//! their sign.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, OptionName, Remedy};
use modelmill_identify::{FitParameter, ParameterStatus, RecordingNote};
use modelmill_runtime::Random;
use modelmill_spec::Sign;

use super::model_versions::ModelVersion;
use super::thresholds::{BODY_PARAMETER_FACTOR, OFF_NOMINAL_PART, OFF_NOMINAL_SIGMAS, SIGN_TRIALS};

/// A base parameter whose estimate differs from its nominal value.
#[derive(Clone, Debug, PartialEq)]
pub struct OffNominalParameter {
    /// The parameter as it was identified.
    pub parameter: FitParameter,
    /// Its nominal value.
    pub nominal: f64,
    /// Magnitude of the difference, in standard deviations of the estimate.
    pub sigmas: f64,
}

/// Base parameters of the bodies whose estimates differ from the file, the one with the most standard deviations first.
pub(super) fn off_nominal_parameters(version: &ModelVersion) -> Vec<OffNominalParameter> {
    let Some(identified) = &version.identified else {
        return Vec::new();
    };
    let parameters = identified.fit.parameters.iter().enumerate();
    let mut off: Vec<OffNominalParameter> = parameters
        .filter(|(k, p)| p.status == ParameterStatus::Identified && !version.model.is_effect(*k))
        .filter_map(|(_, p)| {
            let (nominal, std) = (p.nominal?, p.std?);
            let sigmas = (p.value - nominal).abs() / std;
            // Both bounds: a precise fit would report tiny differences, a poor one large but uncertain ones.
            let is_off = std > 0.0
                && sigmas > OFF_NOMINAL_SIGMAS
                && (p.value - nominal).abs() > OFF_NOMINAL_PART * nominal.abs();
            is_off.then(|| OffNominalParameter {
                parameter: p.clone(),
                nominal,
                sigmas,
            })
        })
        .collect();
    off.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
    off
}

/// A warning about base parameters whose sign no bodies near those of the file can have. Then not the bodies
/// are wrong, but a direction: of gravity, a length, a drive or a column.
pub(super) fn reversed_sign_note(version: &ModelVersion, off: &[OffNominalParameter]) -> Option<RecordingNote> {
    let model = &version.model;
    // A sign counts only if the estimate is clear and about as large as the nominal value.
    let has_turned = |off: &&OffNominalParameter| {
        let p = &off.parameter;
        let is_other = p.value * off.nominal < 0.0
            && p.std.is_some_and(|std| p.value.abs() > OFF_NOMINAL_SIGMAS * std)
            && BODY_PARAMETER_FACTOR * p.value.abs() > off.nominal.abs();
        let k = model.base.iter().position(|one| one.name == p.name);
        is_other && k.is_some_and(|k| has_one_sign(version, k))
    };
    let turned: Vec<&OffNominalParameter> = off.iter().filter(has_turned).collect();
    let first = turned.first()?;
    let names: Vec<&str> = turned.iter().map(|o| o.parameter.name.as_str()).collect();
    let unit = &first.parameter.unit;
    Some(RecordingNote::warning(message!(
        "{} with a sign that no bodies near those of the file can have (`{}` is {:.4} {unit}; the file's values give {:.4} \
         {unit}). The effects found may only compensate a wrong direction. Check the direction of gravity, the signs of lengths \
         and angles, and the positive directions of drives and recorded columns ({} draws the mechanism with {}).",
        if names.len() == 1 {
            format!("{} comes out", names[0])
        } else {
            format!("{} come out", names.join(", "))
        },
        first.parameter.expression,
        first.parameter.value,
        first.nominal,
        Remedy::command(CommandName::Check),
        Remedy::option(OptionName::Picture),
    )))
}

/// Whether a base parameter has the same sign for all bodies whose parameters are within a factor of those of
/// the file. First moments and products of inertia may have either sign, since a small shift of the centre of
/// mass can change it.
fn has_one_sign(version: &ModelVersion, k: usize) -> bool {
    let derivation = &version.model.derivation;
    let mechanism = &derivation.mechanism;
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let nominal = version.model.values[k];
    // A fixed seed: the same recording always gives the same warning.
    let mut random = Random::new(1);
    let may_turn = |i: usize| version.model.sign_of_parameter(i) == Sign::Any && mechanism.parameters[i].unit != "m";
    // A value that is zero in the file may be as large as the largest one of its unit.
    let size = |i: usize| {
        let own = &mechanism.parameters[i];
        if own.nominal != 0.0 || !may_turn(i) {
            return own.nominal;
        }
        let alike = mechanism.parameters.iter().filter(|p| p.unit == own.unit);
        alike.map(|p| p.nominal.abs()).fold(0.0, f64::max)
    };
    let mut factor = |i: usize| {
        let turned = if may_turn(i) && random.uniform(0.0, 1.0) < 0.5 {
            -1.0
        } else {
            1.0
        };
        // Extreme values are drawn most often: a sum changes its sign there first.
        turned * BODY_PARAMETER_FACTOR.powf(random.uniform(-2.0, 2.0).clamp(-1.0, 1.0))
    };
    (0..SIGN_TRIALS).all(|_| {
        // All parameters vary at once; one trial with the other sign is enough.
        let parameters = (0..mechanism.parameters.len()).map(|i| size(i) * factor(i));
        let parameters: Vec<f64> = parameters.collect();
        derivation.base_values(&parameters, &constants)[k] * nominal > 0.0
    })
}
