//! Laws for the residual that are in no library, with the names of a model: the places where they may act,
//! their formulas over coordinates, drives and loads, and the entry of a library with which `add` can add them.

use std::fmt::Write as _;

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    ForceColumn, LawFactor, LawProduct, LawProposal, LawShape, LawSite, LawTerm, LawVariable, LocatedEffect,
    ModelDiagnosis, SiteLaw as Proposed,
};
use modelmill_spec::edit::{NewEffect, NewParameter};
use modelmill_spec::{ActsOn, DriveKind, EffectPlace, PlaceLoad};

use crate::along;
use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::SegmentList;
use crate::segment::RecordingSegment;

use super::candidates::DerivedCandidates;
use super::columns::unit_forces;
use super::estimates::{EffectEstimate, round_by_deviation, rounded_estimate};
use super::places::{CandidatePlace, candidate_places};

/// Places on which laws may act, along all recordings: drives, and joints without a drive of their own.
///
/// Fails when a pose has no solution.
pub(crate) fn sites(candidates: &DerivedCandidates, model: &Model, all: &SegmentList<'_>) -> Outcome<Vec<LawSite>> {
    // The file's mechanism, since places have its names.
    let mechanism = &model.loaded.mechanism;
    let forces = unit_forces(candidates, model, all)?;
    let mut sites: Vec<LawSite> = Vec::new();
    let mut places = Vec::new();
    for spot in candidate_places(mechanism) {
        if !matches!(spot.sort, ActsOn::Drive | ActsOn::Coordinate) {
            continue;
        }
        // A place without a drive acts on the drives through the mechanism; its column comes from the derivation.
        // A drive acts on itself alone.
        let (force, channel) = match (spot.place, forces.iter().find(|(at, _)| *at == spot)) {
            (EffectPlace::Drive(d), _) => (drive_column(model, all, d.0), Some(d.0)),
            (_, Some((_, force))) => (force.clone(), None),
            (_, None) => continue,
        };
        // A place without effect on any drive cannot be seen.
        if force.is_zero() {
            continue;
        }
        sites.push(LawSite {
            name: spot.name.clone(),
            is_angle: spot.carries == PlaceLoad::Torque,
            channel,
            drive_forces: force,
            ..LawSite::default()
        });
        places.push(spot);
    }
    // Positions, rates and accelerations of the places, recording by recording.
    for (one, _) in all {
        let motions = motions(model, one, &places)?;
        for (site, [position, rate, acceleration]) in sites.iter_mut().zip(motions) {
            site.position.extend(position);
            site.rate.extend(rate);
            site.acceleration.extend(acceleration);
        }
    }
    Ok(sites)
}

/// A force of one along a drive.
fn drive_column(model: &Model, all: &SegmentList<'_>, drive: usize) -> ForceColumn {
    // Samples after decimation, over all recordings.
    let samples = all.iter().map(|(one, _)| one.time().len()).sum();
    let mut column = ForceColumn(vec![None; model.row_names().len()]);
    column.0[drive] = Some(vec![1.0; samples]);
    column
}

/// Position, rate and acceleration of places along a recording, of the samples that are kept.
///
/// Fails when a pose has no solution.
fn motions(model: &Model, one: &RecordingSegment, places: &[CandidatePlace]) -> Outcome<Vec<[Vec<f64>; 3]>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let mechanism = &model.derivation.mechanism;
    let (active, passive) = model.derivation.coordinates();
    // Positions and rates of the drives, for linear ones.
    let drives = along::columns(model, one, |states| evaluator.drive_motion(states))?;
    let of_passive = if passive.is_empty() {
        Vec::new()
    } else {
        along::columns(model, one, |states| evaluator.passive_motion(states))?
    };
    // Active coordinates are recorded, passive ones are computed.
    let of_coordinate = |i: usize| -> Option<[Vec<f64>; 3]> {
        let run = &one.run;
        if let Some(k) = active.iter().position(|a| *a == i) {
            return Some([run.q[k].clone(), run.qd[k].clone(), run.qdd[k].clone()]);
        }
        let k = passive.iter().position(|p| *p == i)?;
        // Positions come first, then rates and accelerations.
        let n = passive.len();
        Some([k, n + k, 2 * n + k].map(|at| of_passive[at].clone()))
    };
    let kept = |values: Vec<f64>| values.into_iter().step_by(one.decimation()).collect();
    // The acceleration of a linear drive is the derivative of its rate.
    let motion = |spot: &CandidatePlace| {
        let found = match spot.place {
            EffectPlace::Coordinate(i) => of_coordinate(i.0),
            EffectPlace::Drive(d) => match mechanism.drives[d.0].kind {
                DriveKind::Joint(i) => of_coordinate(i.0),
                DriveKind::Linear { .. } => {
                    let rate = drives[mechanism.drives.len() + d.0].clone();
                    let acceleration = slopes(&rate, &one.run.time);
                    Some([drives[d.0].clone(), rate, acceleration])
                }
            },
            _ => None,
        };
        found.unwrap_or_default().map(&kept)
    };
    Ok(places.iter().map(motion).collect())
}

/// Central differences.
fn slopes(values: &[f64], time: &[f64]) -> Vec<f64> {
    // One-sided at both ends.
    let last = values.len().saturating_sub(1);
    let at = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
        let step = time[b] - time[a];
        if step > 0.0 {
            (values[b] - values[a]) / step
        } else {
            0.0
        }
    };
    (0..values.len()).map(at).collect()
}

/// A force law with the names of the model; it has a place, a formula and values. It belongs to a
/// [`NamedLawProposal`]. The search has the same law as [`SiteLaw`](modelmill_identify::diagnose::SiteLaw), with
/// indices in place of names.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedLaw {
    /// The force that it adds at its place, as a formula over coordinates, rates (`_d`), lengths of drives
    /// (`_length`) and loads of drives (by the names of the drives).
    pub expression: String,
    /// The drive or coordinate on which it acts.
    pub at: String,
    /// Its parameters.
    pub parameters: Vec<EffectEstimate>,
    /// Share of the squared residual that it explains on data that were not fitted, on the drives on which it
    /// has an effect.
    pub gain: f64,
    /// Effects found that become unnecessary with it.
    pub instead_of: Vec<LocatedEffect>,
    /// Effects found at the same place that stay. They are estimated together with the law, so their values differ from
    /// those without it.
    pub in_addition_to: Vec<LocatedEffect>,
    /// Its entry; `None` if the law depends on the earlier motion, which no formula can express.
    pub entry: Option<LawEntry>,
}

/// A law as a kind of effect for a library.
#[derive(Clone, Debug, PartialEq)]
pub struct LawEntry {
    /// The table of the library, as TOML.
    pub text: String,
    /// The effect that adds it to a model.
    pub effect: NewEffect,
}

/// A proposed law, with its alternatives: other laws that explain the recordings equally well. It is a hypothesis. The
/// search has the same proposal as [`LawProposal`], with indices in place of names.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedLawProposal {
    /// The simplest law.
    pub law: NamedLaw,
    /// Other laws that explain the recordings equally well, the best first.
    pub near_ties: Vec<NamedLaw>,
}

impl NamedLaw {
    /// The formula with its place.
    pub fn label(&self) -> String {
        format!("{} at {}", self.expression, self.at)
    }
}

/// Laws that a diagnosis proposes, by the names of the model.
pub(crate) fn hypotheses(model: &Model, diagnosis: &ModelDiagnosis) -> Vec<NamedLawProposal> {
    let sites = &diagnosis.sites;
    let effects: Vec<&LocatedEffect> = diagnosis.effects.iter().map(|one| &one.effect).collect();
    // Alternatives are named in the same way.
    let one = |proposal: &LawProposal| NamedLawProposal {
        law: law(model, sites, &effects, &proposal.law),
        near_ties: (proposal.near_ties.iter())
            .map(|tie| law(model, sites, &effects, tie))
            .collect(),
    };
    diagnosis.laws.iter().map(one).collect()
}

/// A law of the search with the names of the model; `effects` are those that were found.
fn law(model: &Model, sites: &[LawSite], effects: &[&LocatedEffect], law: &Proposed) -> NamedLaw {
    let site = &sites[law.site];
    // A joint and the drive on it are one place.
    let place = joint_of(model, &site.name);
    let stays = |one: &&&LocatedEffect| {
        one.at.iter().any(|other| joint_of(model, other) == place) && !law.replaced_effects.contains(one)
    };
    // Parameters are numbered in the order of the terms.
    let mut named = LawFormula::new(law);
    let expression = named.text(law, &|variable, other| {
        variable_name(model, &sites[other.unwrap_or(law.site)], variable)
    });
    let mut parameters = Vec::new();
    let mut symbols = named.parameters.iter();
    // One value for each parameter of the term.
    for term in &law.terms {
        let values = term.values.iter().zip(&term.standard_deviations);
        for ((value, deviation), symbol) in values.zip(symbols.by_ref()) {
            let deviation = deviation.is_finite().then_some(*deviation);
            parameters.push(rounded_estimate(
                symbol,
                *value,
                deviation,
                &term.product.unit(site, sites),
            ));
        }
    }
    NamedLaw {
        expression,
        at: site.name.clone(),
        entry: library_entry(sites, law, &parameters),
        parameters,
        gain: law.gain,
        instead_of: law.replaced_effects.clone(),
        in_addition_to: effects.iter().filter(stays).map(|one| (*one).clone()).collect(),
    }
}

/// The coordinate of a drive that acts on a joint; other names stay as they are.
fn joint_of<'a>(model: &'a Model, name: &'a str) -> &'a str {
    let mechanism = &model.derivation.mechanism;
    match mechanism
        .drives
        .iter()
        .find(|drive| drive.name == name)
        .map(|drive| &drive.kind)
    {
        Some(DriveKind::Joint(i)) => &mechanism.coordinates[i.0].name,
        _ => name,
    }
}

/// The name of a place's variable, as errors and recordings have it.
fn variable_name(model: &Model, site: &LawSite, variable: LawVariable) -> String {
    // A drive on a joint uses the name of the coordinate, a linear drive its own.
    let drive = site.channel.map(|d| &model.derivation.mechanism.drives[d].kind);
    // Other places use their own name.
    let base = match drive {
        Some(DriveKind::Joint(i)) => &model.derivation.mechanism.coordinates[i.0].name,
        _ => &site.name,
    };
    let is_linear = matches!(drive, Some(DriveKind::Linear { .. }));
    match variable {
        LawVariable::Position | LawVariable::OtherPosition if is_linear => format!("{base}_length"),
        LawVariable::Position | LawVariable::OtherPosition => base.clone(),
        LawVariable::Rate | LawVariable::OtherRate => format!("{base}_d"),
        LawVariable::Acceleration => format!("{base}_dd"),
        LawVariable::Load => site.name.clone(),
    }
}

/// The words of a kind's expression.
fn variable_word(variable: LawVariable) -> &'static str {
    match variable {
        LawVariable::Position => "coordinate",
        LawVariable::Rate => "rate",
        LawVariable::Acceleration => "acceleration",
        LawVariable::Load => "load",
        LawVariable::OtherPosition => "other_coordinate",
        LawVariable::OtherRate => "other_rate",
    }
}

/// The table of a library for a law, and the effect that adds it to a model; `None` for a law that depends on
/// the earlier motion.
fn library_entry(sites: &[LawSite], law: &Proposed, parameters: &[EffectEstimate]) -> Option<LawEntry> {
    let mut products = law.terms.iter().map(|term| &term.product);
    // A law that depends on the earlier motion has no formula over the state.
    if products.any(LawProduct::has_memory) {
        return None;
    }
    // The kind is written as TOML, with the words of the library instead of names of the model.
    let site = &sites[law.site];
    // A second place gives the words `other_coordinate` and `other_rate`.
    let other = law.terms.iter().find_map(|term| term.product.other);
    let other = other.map(|other| &sites[other]);
    let mut formula = LawFormula::new(law);
    formula.with_symbols = true;
    let expression = formula.text(law, &|variable, _| variable_word(variable).to_owned());
    // The kind is named after its place, so that several laws can be in one library.
    let kind = format!("law_of_{}", site.name);
    let on = if site.channel.is_some() { "drive" } else { "coordinate" };
    // Places on angles have torques.
    let carries = if site.is_angle { "torque" } else { "force" };
    let mut text = format!("[[effect_kind]]\nname = \"{kind}\"\non = \"{on}\"\n");
    if let Some(other) = other {
        let motion = if other.is_angle { "angle" } else { "length" };
        let _ = writeln!(text, "other = \"{motion}\"");
    }
    let _ = writeln!(
        text,
        "expression = \"{expression}\"\nsays = \"A hypothesis that recordings suggest. Do not treat it as a property of the machine before its physical cause is known.\""
    );
    // Units are those of the place: of a force or of a torque.
    text.push_str("[effect_kind.parameters]\n");
    for parameter in parameters {
        let _ = writeln!(
            text,
            "{} = {{ unit = {{ {carries} = \"{}\" }} }}",
            parameter.name, parameter.unit
        );
    }
    if !formula.constants.is_empty() {
        text.push_str("[effect_kind.constants]\n");
    }
    for (symbol, value, factor) in &formula.constants {
        let unit = factor.unit(site.is_angle, other.is_some_and(|other| other.is_angle));
        let _ = writeln!(
            text,
            "{symbol} = {{ unit = {{ {carries} = \"{unit}\" }}, value = {} }}",
            round_by_deviation(*value, None)
        );
    }
    // Estimates become nominal values.
    let nominal = |p: &EffectEstimate| NewParameter {
        symbol: p.name.clone(),
        nominal: Some(p.value),
        ..NewParameter::default()
    };
    // The effect acts at the first place; the second one is an argument.
    let at = std::iter::once(site).chain(other);
    Some(LawEntry {
        text,
        effect: NewEffect {
            kind,
            at: at.map(|site| site.name.clone()).collect(),
            parameters: parameters.iter().map(nominal).collect(),
            ..NewEffect::default()
        },
    })
}

/// A law as a formula, with the symbols of its parameters and constants.
struct LawFormula {
    /// Symbols of the parameters.
    parameters: Vec<String>,
    /// Symbols of the constants with their values and the factors in which they stand.
    constants: Vec<(String, f64, LawFactor)>,
    /// Whether constants stand as symbols rather than as numbers.
    with_symbols: bool,
}

impl LawFormula {
    /// Symbols of the parameters: `k` for a term, `ks` and `kc` for sine and cosine, numbered if there are
    /// several terms.
    fn new(law: &Proposed) -> Self {
        // A single term needs no number.
        let several = law.terms.len() > 1;
        let of_term = |(k, term): (usize, &LawTerm)| {
            let number = if several { (k + 1).to_string() } else { String::new() };
            let symbols: &[&str] = match term.values.len() {
                1 => &["k"],
                _ => &["ks", "kc"],
            };
            let named = symbols.iter().map(|symbol| format!("{symbol}{number}"));
            named.collect::<Vec<_>>()
        };
        Self {
            parameters: law.terms.iter().enumerate().flat_map(of_term).collect(),
            constants: Vec::new(),
            with_symbols: false,
        }
    }

    /// The formula of a law; `name` gives the name of each variable. Constants are collected on the way if they
    /// have symbols.
    fn text(&mut self, law: &Proposed, name: &dyn Fn(LawVariable, Option<usize>) -> String) -> String {
        let mut symbols = self.parameters.clone().into_iter();
        let mut terms = Vec::new();
        for term in &law.terms {
            let factors: Vec<Vec<String>> = (term.product.factors.iter())
                .map(|factor| {
                    // Variables of the second place have its name.
                    let is_other = matches!(factor.variable, LawVariable::OtherPosition | LawVariable::OtherRate);
                    let other = term.product.other.filter(|_| is_other);
                    self.factor(*factor, &name(factor.variable, other))
                })
                .collect();
            // Sine and cosine have two parameters, all other factors one.
            let wave = factors.iter().find(|texts| texts.len() > 1);
            let mut product = Vec::new();
            if let Some(wave) = wave {
                let parts = wave.iter().zip(symbols.by_ref());
                let parts: Vec<String> = parts.map(|(text, symbol)| format!("{symbol}*{text}")).collect();
                // A sum needs parentheses only next to other factors or terms.
                let is_alone = factors.len() == 1 && law.terms.len() == 1;
                let sum = parts.join(" + ");
                product.push(if is_alone { sum } else { format!("({sum})") });
            } else {
                product.extend(symbols.next());
            }
            // The remaining factors follow the parameter.
            let others = factors.iter().filter(|texts| texts.len() == 1);
            product.extend(others.map(|texts| texts[0].clone()));
            terms.push(product.join("*"));
        }
        terms.join(" + ")
    }

    /// A constant as a number, or by a symbol of its own.
    fn constant(&mut self, symbol: &str, value: f64, factor: LawFactor) -> String {
        if !self.with_symbols {
            return round_by_deviation(value, None).to_string();
        }
        let of_name = |one: &&(String, f64, LawFactor)| one.0.trim_end_matches(char::is_numeric) == symbol;
        // Several constants of one name are numbered from the second on.
        let symbol = match self.constants.iter().filter(of_name).count() {
            0 => symbol.to_owned(),
            n => format!("{symbol}{}", n + 1),
        };
        self.constants.push((symbol.clone(), value, factor));
        symbol
    }

    /// A shape of a variable: one text, or those of sine and cosine.
    fn factor(&mut self, factor: LawFactor, z: &str) -> Vec<String> {
        let text = match factor.shape {
            // Powers of half integers need a scale, so that the unit is independent of the power.
            LawShape::Power { halves, is_odd, scale } => {
                if halves % 2 == 0 {
                    integer_power(z, halves / 2, is_odd)
                } else {
                    // An odd multiple of one half: whole powers times a root.
                    let share = format!("abs({z})/{}", self.constant("scale", scale, factor));
                    let whole = match halves / 2 {
                        0 => String::new(),
                        1 => format!("{share}*"),
                        n => format!("({share})^{n}*"),
                    };
                    let sign = if is_odd { format!("sign({z})*") } else { String::new() };
                    format!("{sign}{whole}sqrt({share})")
                }
            }
            // A power about a centre other than zero.
            LawShape::Shifted { centre, power } => {
                let centre = self.constant("centre", centre, factor);
                format!("({})^{power}", difference_text(z, &centre))
            }
            // A hinge is zero on one side of its start.
            LawShape::Hinge { from, side, power } => {
                let over = if from == 0.0 {
                    z.to_owned()
                } else {
                    difference_text(z, &self.constant("from", from, factor))
                };
                let way = if side > 0.0 { "+" } else { "-" };
                let ramp = format!("(abs({over}) {way} ({over}))/2");
                match power {
                    1 => ramp,
                    n => format!("({ramp})^{n}"),
                }
            }
            // Both phases, since the phase is estimated linearly.
            LawShape::Wave { pitch } => {
                let pitch = self.constant("pitch", pitch, factor);
                return ["sin", "cos"].map(|f| format!("{f}(2*pi*{z}/{pitch})")).to_vec();
            }
            // A smooth bump at one position.
            LawShape::Bump { centre, width } => {
                format!("exp(-({})^2)", self.scaled_distance(z, centre, width, factor))
            }
            LawShape::Detent { centre, width } => {
                let near = self.scaled_distance(z, centre, width, factor);
                format!("{near}*exp(-({near})^2)")
            }
            // A smooth step between two levels.
            LawShape::Step { centre, width } => {
                format!("tanh({})", self.scaled_distance(z, centre, width, factor))
            }
            // A force that decays away from zero and changes sign there, as Stribeck friction does over the rate.
            LawShape::Fading { scale, halves } => {
                let scale = self.constant("scale", scale, factor);
                let power = match halves {
                    1 => format!("sqrt(abs({z})/{scale})"),
                    2 => format!("abs({z})/{scale}"),
                    _ => format!("({z}/{scale})^{}", halves / 2),
                };
                format!("sign({z})*exp(-{power})")
            }
            // Friction that builds up over a distance; its name is that of the friction model.
            LawShape::Memory { length, curve } => {
                let state = if curve == 1 { "dahl" } else { "bouc_wen" };
                format!("{state}({z}, {})", self.constant("length", length, factor))
            }
            LawShape::Slip { width } => {
                format!("slip({z}, {})", self.constant("width", width, factor))
            }
        };
        vec![text]
    }

    /// `(z - centre)/width`
    fn scaled_distance(&mut self, z: &str, centre: f64, width: f64, factor: LawFactor) -> String {
        // A centre at zero is left out.
        let from = if centre == 0.0 {
            z.to_owned()
        } else {
            let centre = self.constant("centre", centre, factor);
            format!("({})", difference_text(z, &centre))
        };
        format!("{from}/{}", self.constant("width", width, factor))
    }
}

/// `z` to a whole power, with the sign of `z` if `is_odd`.
fn integer_power(z: &str, power: i32, is_odd: bool) -> String {
    match (power, is_odd) {
        (0, _) => format!("sign({z})"),
        (1, true) => z.to_owned(),
        (1, false) => format!("abs({z})"),
        (n, is_odd) if (n % 2 == 1) == is_odd => format!("{z}^{n}"),
        (2, _) => format!("{z}*abs({z})"),
        (n, true) => format!("sign({z})*{z}^{n}"),
        (n, false) => format!("abs({z})^{n}"),
    }
}

/// `z - centre`, where the centre may be a number below zero.
fn difference_text(z: &str, centre: &str) -> String {
    match centre.strip_prefix('-') {
        Some(positive) => format!("{z} + {positive}"),
        None => format!("{z} - {centre}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formula(factors: &[(LawVariable, LawShape)], with_symbols: bool) -> String {
        let factor = |(variable, shape): &(LawVariable, LawShape)| LawFactor {
            variable: *variable,
            shape: *shape,
        };
        let product = LawProduct {
            other: None,
            factors: factors.iter().map(factor).collect(),
        };
        let parameters = if factors.iter().any(|f| matches!(f.1, LawShape::Wave { .. })) {
            2
        } else {
            1
        };
        let law = Proposed {
            site: 0,
            terms: vec![LawTerm {
                product,
                values: vec![1.0; parameters],
                standard_deviations: vec![0.0; parameters],
            }],
            gain: 1.0,
            replaced_effects: Vec::new(),
        };
        let mut formula = LawFormula::new(&law);
        formula.with_symbols = with_symbols;
        formula.text(&law, &|variable, _| variable_word(variable).to_owned())
    }

    /// A law at a joint names the effects that stay at the drive on this joint, and not those that it replaces.
    #[test]
    fn effects_at_the_place_of_a_law_are_named() {
        let model = Model::open("../model-spec/models/two_link.toml").unwrap();
        let effect = |kind: &str, at: &str| LocatedEffect {
            kind: kind.to_owned(),
            at: vec![at.to_owned()],
        };
        let drive = model.row_names()[0].clone();
        let joint = joint_of(&model, &drive).to_owned();
        assert_ne!(joint, drive);
        let sites = [LawSite {
            name: joint,
            ..LawSite::default()
        }];
        let found = [
            effect("coulomb_friction", &drive),
            effect("viscous_friction", &drive),
            effect("coulomb_friction", &model.row_names()[1]),
        ];
        let proposed = Proposed {
            site: 0,
            terms: Vec::new(),
            gain: 0.5,
            replaced_effects: vec![found[1].clone()],
        };
        let law = law(&model, &sites, &found.iter().collect::<Vec<_>>(), &proposed);
        assert_eq!(law.in_addition_to, found[..1]);
    }

    #[test]
    fn laws_are_formulas() {
        use LawVariable::{Load, OtherPosition, Position, Rate};
        let wave = LawShape::Wave { pitch: 0.02 };
        assert_eq!(
            formula(&[(OtherPosition, LawShape::LINEAR), (Rate, LawShape::LINEAR)], false),
            "k*other_coordinate*rate"
        );
        assert_eq!(
            formula(&[(Position, wave), (Rate, LawShape::LINEAR)], true),
            "(ks*sin(2*pi*coordinate/pitch) + kc*cos(2*pi*coordinate/pitch))*rate"
        );
        let beyond = LawShape::Hinge {
            from: -0.25,
            side: 1.0,
            power: 1,
        };
        assert_eq!(
            formula(&[(Position, beyond)], false),
            "k*(abs(coordinate + 0.25) + (coordinate + 0.25))/2"
        );
        let power = LawShape::Power {
            halves: 3,
            is_odd: false,
            scale: 200.0,
        };
        assert_eq!(
            formula(&[(Load, power), (Rate, LawShape::SIGN)], false),
            "k*abs(load)/200*sqrt(abs(load)/200)*sign(rate)"
        );
    }
}
