//! Converts effects of a model to properties that robot descriptions have: friction, inertia of drives and springs of
//! joints and tendons, and elements between two points. Other effects are reported.

use modelmill_boundary::message;
use modelmill_boundary::text::Message;
use modelmill_spec::{DriveKind, EffectPlace, Mechanics, Mechanism, ModelEffect, PointIdx};

use super::DescriptionFormat;

/// Passive properties of a joint or tendon.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PassiveProperties {
    /// Viscous friction, N s/m or N m s/rad.
    pub(super) damping: f64,
    /// Coulomb friction, N or N m.
    pub(super) friction: f64,
    /// Inertia of the drive, kg or kg m^2.
    pub(super) armature: f64,
    /// Stiffness, N/m or N m/rad.
    pub(super) stiffness: f64,
    /// Position or length at which the spring is relaxed, m or rad.
    pub(super) rest: f64,
}

/// The passive properties of a mechanism.
#[derive(Clone, Debug)]
pub(super) struct PassiveEffects {
    /// For each coordinate.
    pub(super) joints: Vec<PassiveProperties>,
    /// For each drive; used for drives between two points.
    pub(super) drives: Vec<PassiveProperties>,
    /// Elements between two points.
    pub(super) elements: Vec<([PointIdx; 2], PassiveProperties)>,
}

/// Converts the effects of a mechanism; adds a remark for each effect that the format does not have.
pub(super) fn passive_effects(
    mechanism: &Mechanism,
    format: DescriptionFormat,
    remarks: &mut Vec<Message>,
) -> PassiveEffects {
    let mut found = PassiveEffects {
        joints: vec![PassiveProperties::default(); mechanism.coordinates.len()],
        drives: vec![PassiveProperties::default(); mechanism.drives.len()],
        elements: Vec::new(),
    };
    for effect in &mechanism.effects {
        // Effects with zero values change nothing.
        let is_zero = |p: &usize| mechanism.parameters[*p].nominal == 0.0;
        if !effect.terms.is_empty() && effect.terms.iter().all(|term| is_zero(&term.parameter.0)) {
            continue;
        }
        if !add_effect(mechanism, effect, format, &mut found) {
            let places: Vec<String> = effect.places.iter().map(|p| place_text(mechanism, *p)).collect();
            remarks.push(message!(
                "`{}` at {} is left out: {} has no such effect",
                effect.kind,
                places.join(", "),
                format.name().to_uppercase()
            ));
        }
    }
    found
}

/// Adds an effect to the properties; false if the format does not have it.
fn add_effect(
    mechanism: &Mechanism,
    effect: &ModelEffect,
    format: DescriptionFormat,
    found: &mut PassiveEffects,
) -> bool {
    // Nominal value of a parameter or a constant of the effect; zero if it has none.
    let value = |symbol: &str| {
        let term = effect.terms.iter().find(|term| term.symbol == symbol);
        term.map_or(0.0, |term| mechanism.parameters[term.parameter.0].nominal)
    };
    let constant = |symbol: &str| {
        let constant = effect.constants.iter().find(|(name, _)| name == symbol);
        constant.map_or(0.0, |(_, value)| value.evaluate(&|s| mechanism.symbol_nominal(s)))
    };
    // A spring and damper between two points.
    if effect.mechanics == Some(Mechanics::Strut) {
        let (stiffness, constant) = (value("k"), value("F0"));
        let [EffectPlace::Point(from), EffectPlace::Point(to)] = effect.places[..] else {
            return false;
        };
        // A pull of `F0 + k l` is a spring with the relaxed length `-F0/k`, which must be a valid length.
        let rest = if constant == 0.0 { 0.0 } else { -constant / stiffness };
        if format != DescriptionFormat::Mjcf || !rest.is_finite() || rest < 0.0 {
            return false;
        }
        let passive = PassiveProperties {
            damping: value("Fv"),
            stiffness,
            rest,
            ..PassiveProperties::default()
        };
        found.elements.push(([from, to], passive));
        return true;
    }
    // Effects that are bodies are added to the links elsewhere, and a tilt of the base is in gravity already.
    let is_body = effect.places.iter().all(|place| matches!(place, EffectPlace::Point(_)));
    if matches!(
        effect.mechanics,
        Some(Mechanics::Part | Mechanics::Placement | Mechanics::Tilt)
    ) || effect.mechanics.is_none() && is_body
    {
        return true;
    }
    // What the effect changes; URDF has viscous and Coulomb friction only.
    let change: &dyn Fn(&mut PassiveProperties) = match effect.kind.as_str() {
        "viscous_friction" => &|one| one.damping += value("Fv"),
        "coulomb_friction" => &|one| one.friction += value("Fc"),
        "drive_inertia" if format == DescriptionFormat::Mjcf => &|one| one.armature += value("Ia"),
        "spring" if format == DescriptionFormat::Mjcf => &|one| {
            let (k, rest) = (value("k"), constant("rest"));
            // Two springs act as one, with the sum of the stiffnesses and the weighted mean of the relaxed positions.
            let sum = one.stiffness + k;
            one.rest = (one.stiffness * one.rest + k * rest) / sum;
            one.stiffness = sum;
        },
        _ => return false,
    };
    // Apply it at each place, as far as the format has such a place.
    for place in &effect.places {
        match *place {
            EffectPlace::Coordinate(i) => change(&mut found.joints[i.0]),
            EffectPlace::Drive(d) => match mechanism.drives[d.0].kind {
                DriveKind::Joint(i) => change(&mut found.joints[i.0]),
                DriveKind::Linear { .. } if format == DescriptionFormat::Mjcf => {
                    change(&mut found.drives[d.0]);
                }
                DriveKind::Linear { .. } => return false,
            },
            EffectPlace::Point(_) | EffectPlace::Part(_) | EffectPlace::Base | EffectPlace::Force => return false,
        }
    }
    true
}

/// The name of the place of an effect, in quotes.
fn place_text(mechanism: &Mechanism, place: EffectPlace) -> String {
    match place {
        EffectPlace::Drive(d) => format!("`{}`", mechanism.drives[d.0].name),
        EffectPlace::Coordinate(i) => format!("`{}`", mechanism.coordinates[i.0].name),
        EffectPlace::Point(p) => format!("`{}`", mechanism.points[p.0].name),
        EffectPlace::Part(p) => format!("`{}`", mechanism.parts[p.0].name),
        EffectPlace::Base => "`base`".to_owned(),
        EffectPlace::Force => "`force`".to_owned(),
    }
}
