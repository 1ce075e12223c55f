//! Effects that descriptions of robots know: friction, inertia of drives and springs of joints and tendons, and elements
//! between two points.

use modelmill_boundary::message;
use modelmill_boundary::text::Message;
use modelmill_spec::{DriveKind, EffectPlace, Mechanics, Mechanism, ModelEffect, PointIdx};

use super::DescriptionFormat;

/// What a joint or tendon has by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PassiveProperties {
    /// N s/m or N m s/rad
    pub(super) damping: f64,
    /// N or N m
    pub(super) friction: f64,
    /// kg or kg m^2
    pub(super) armature: f64,
    /// N/m or N m/rad
    pub(super) stiffness: f64,
    /// Where the spring is at rest, m or rad.
    pub(super) rest: f64,
}

/// Effects by what has them.
#[derive(Clone, Debug)]
pub(super) struct PassiveEffects {
    /// Of each coordinate.
    pub(super) joints: Vec<PassiveProperties>,
    /// Of each drive that is a line between two points.
    pub(super) drives: Vec<PassiveProperties>,
    /// Elements between two points.
    pub(super) elements: Vec<([PointIdx; 2], PassiveProperties)>,
}

/// Sorts the effects of a mechanism; those that a format does not know become remarks.
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
        let is_zero = |p: &usize| mechanism.parameters[*p].nominal == 0.0;
        if !effect.terms.is_empty() && effect.terms.iter().all(|term| is_zero(&term.parameter.0)) {
            continue;
        }
        if !add_effect(mechanism, effect, format, &mut found) {
            let places: Vec<String> = effect
                .places
                .iter()
                .map(|p| place_text(mechanism, *p))
                .collect();
            remarks.push(message!(
                "`{}` at {} is left out: {} has nothing like it",
                effect.kind,
                places.join(", "),
                format.name().to_uppercase()
            ));
        }
    }
    found
}

/// Takes an effect in; false if the format has nothing like it.
fn add_effect(
    mechanism: &Mechanism,
    effect: &ModelEffect,
    format: DescriptionFormat,
    found: &mut PassiveEffects,
) -> bool {
    let value = |symbol: &str| {
        let term = effect.terms.iter().find(|term| term.symbol == symbol);
        term.map_or(0.0, |term| mechanism.parameters[term.parameter.0].nominal)
    };
    let constant = |symbol: &str| {
        let constant = effect.constants.iter().find(|(name, _)| name == symbol);
        constant.map_or(0.0, |(_, value)| {
            value.evaluate(&|s| mechanism.symbol_nominal(s))
        })
    };
    if effect.mechanics == Some(Mechanics::Strut) {
        let (stiffness, constant) = (value("k"), value("F0"));
        let [EffectPlace::Point(from), EffectPlace::Point(to)] = effect.places[..] else {
            return false;
        };
        // A pull of `F0 + k l` is a spring with the length at rest of `-F0/k`, which must be one.
        let rest = if constant == 0.0 {
            0.0
        } else {
            -constant / stiffness
        };
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
    // Bodies are added up with those of the links, and gravity is turned already.
    let is_body = effect
        .places
        .iter()
        .all(|place| matches!(place, EffectPlace::Point(_)));
    if matches!(
        effect.mechanics,
        Some(Mechanics::Part | Mechanics::Placement | Mechanics::Tilt)
    ) || effect.mechanics.is_none() && is_body
    {
        return true;
    }
    let change: &dyn Fn(&mut PassiveProperties) = match effect.kind.as_str() {
        "viscous_friction" => &|one| one.damping += value("Fv"),
        "coulomb_friction" => &|one| one.friction += value("Fc"),
        "drive_inertia" if format == DescriptionFormat::Mjcf => &|one| one.armature += value("Ia"),
        "spring" if format == DescriptionFormat::Mjcf => &|one| {
            let (k, rest) = (value("k"), constant("rest"));
            let sum = one.stiffness + k;
            one.rest = (one.stiffness * one.rest + k * rest) / sum;
            one.stiffness = sum;
        },
        _ => return false,
    };
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
            EffectPlace::Point(_)
            | EffectPlace::Part(_)
            | EffectPlace::Base
            | EffectPlace::Force => return false,
        }
    }
    true
}

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
