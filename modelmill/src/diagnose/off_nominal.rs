//! Base parameters that come out off what the file says, and what that means where no body could have them.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, OptionName, Remedy};
use modelmill_identify::{FitParameter, ParameterStatus, RecordingNote};
use modelmill_runtime::Random;
use modelmill_spec::Sign;

use super::versions::ModelVersion;

/// A base parameter is off its nominal value from this many of its deviations on, and from this share of it on.
const SIGMAS: f64 = 5.0;
const OFF: f64 = 0.01;
/// Every parameter of a body may be off by this factor before the sign of a base parameter is called impossible.
const FACTOR: f64 = 3.0;
/// How many bodies with such parameters are tried.
const TRIED: usize = 200;

/// A base parameter that is not what the file says.
#[derive(Clone, Debug, PartialEq)]
pub struct OffNominalParameter {
    /// The parameter as it was identified.
    pub parameter: FitParameter,
    /// Its nominal value.
    pub nominal: f64,
    /// How many of its standard deviations lie between.
    pub sigmas: f64,
}

/// Base parameters of the bodies that are not what the file says, with the nominal value and the distance in deviations.
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
            let is_off =
                std > 0.0 && sigmas > SIGMAS && (p.value - nominal).abs() > OFF * nominal.abs();
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

/// What base parameters say whose sign no bodies near those of the file have: not the bodies are wrong, but what turns their
/// forces.
pub(super) fn reversed_sign_note(
    version: &ModelVersion,
    off: &[OffNominalParameter],
) -> Option<RecordingNote> {
    let model = &version.model;
    let has_turned = |off: &&OffNominalParameter| {
        let p = &off.parameter;
        let is_other = p.value * off.nominal < 0.0
            && p.std.is_some_and(|std| p.value.abs() > SIGMAS * std)
            && FACTOR * p.value.abs() > off.nominal.abs();
        let k = model.base.iter().position(|one| one.name == p.name);
        is_other && k.is_some_and(|k| has_one_sign(version, k))
    };
    let turned: Vec<&OffNominalParameter> = off.iter().filter(has_turned).collect();
    let first = turned.first()?;
    let names: Vec<&str> = turned.iter().map(|o| o.parameter.name.as_str()).collect();
    let unit = &first.parameter.unit;
    Some(RecordingNote::warning(message!(
        "{} with a sign that no bodies near those of the file have (`{}` is {:.4} {unit}; the file's values give {:.4} {unit}). Look \
         first at the direction of gravity, the signs of lengths and angles, and which way drives and columns of the recording \
         count ({} draws the mechanism with {}): what is said to be missing may only make up for that.",
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

/// Whether a base parameter keeps its sign whatever the parameters of the bodies are, within a factor of those of the file. First
/// moments and products of inertia may have either sign: they turn with a small change of where a body's mass is.
fn has_one_sign(version: &ModelVersion, k: usize) -> bool {
    let derivation = &version.model.derivation;
    let mechanism = &derivation.mechanism;
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let nominal = version.model.nominal[k];
    let mut random = Random::new(1);
    let may_turn =
        |i: usize| version.model.sign_of(i) == Sign::Any && mechanism.parameters[i].unit != "m";
    // Where the file has none, one as large as others of its unit.
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
        // Extremes count most: a sum changes its sign there first.
        turned * FACTOR.powf(random.uniform(-2.0, 2.0).clamp(-1.0, 1.0))
    };
    (0..TRIED).all(|_| {
        let parameters = (0..mechanism.parameters.len()).map(|i| size(i) * factor(i));
        let parameters: Vec<f64> = parameters.collect();
        derivation.base_values(&parameters, &constants)[k] * nominal > 0.0
    })
}
