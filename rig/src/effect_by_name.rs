//! Effects from names: kind, places and values go in as rig files and programs state them. A checked [`RigEffect`]
//! or all errors come out, each with the expected entry and a remedy.

use crate::effect::{RigEffect, RigLaw, RigPlace, ValueSign};
use crate::pair::PairFunction;
use crate::rig::Rig;

/// An error in an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectFault {
    /// The part that is wrong.
    pub part: EffectPart,
    /// What is wrong.
    pub message: String,
    /// What was expected; may be empty.
    pub expected: String,
    /// What to do; may be empty.
    pub help: String,
}

/// A part of an effect's description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EffectPart {
    /// The kind.
    Kind,
    /// The list of places.
    Places,
    /// One of the places, by its index.
    Place(usize),
    /// A value, by its symbol.
    Value(String),
}

impl std::fmt::Display for EffectFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.message)?;
        for more in [&self.expected, &self.help] {
            if !more.is_empty() {
                write!(f, "; {more}")?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for EffectFault {}

/// The places where a kind may act.
#[derive(Clone, Copy, PartialEq, Eq)]
enum AllowedPlaces {
    /// Drives, coordinates of joints, and joints with one coordinate.
    DrivesAndJoints,
    /// Drives only, because the effect needs the load.
    Drives,
    /// Two of the places that [`Self::DrivesAndJoints`] allows.
    TwoDrivesOrJoints,
    /// Drives along the distance of two points.
    LinearDrives,
    /// Points of bodies other than the base.
    Points,
    /// Two points of one body.
    TwoPointsOfABody,
    /// The word `base`.
    Base,
    /// The word `force`: the signals of all drives.
    Force,
}

impl AllowedPlaces {
    /// The allowed places of a kind.
    fn for_kind(kind: &str) -> Self {
        match kind {
            "load_friction" => Self::Drives,
            "coupled_drive" => Self::TwoDrivesOrJoints,
            "rod_inertia" => Self::LinearDrives,
            "point_mass" => Self::Points,
            "lumped_mass_placement" => Self::TwoPointsOfABody,
            "gravity_tilt" => Self::Base,
            "time_delay" => Self::Force,
            _ => Self::DrivesAndJoints,
        }
    }

    /// The allowed places as text for messages.
    fn description(self) -> &'static str {
        match self {
            Self::DrivesAndJoints => "a drive, a coordinate or a joint with one coordinate",
            Self::Drives => "a drive (its load is known)",
            Self::TwoDrivesOrJoints => "two drives or joints",
            Self::LinearDrives => "a linear drive",
            Self::Points => "a point of a body",
            Self::TwoPointsOfABody => {
                "two points of one body: where the mass is, and where the balance of moments assumes it"
            }
            Self::Base => "`base`",
            Self::Force => "`force`",
        }
    }

    /// Number of places; `None` for one or more.
    fn n_places(self) -> Option<usize> {
        match self {
            Self::TwoDrivesOrJoints | Self::TwoPointsOfABody => Some(2),
            Self::Base | Self::Force => Some(1),
            _ => None,
        }
    }
}

impl Rig {
    /// An effect of this rig by names: a kind ([`RigLaw::KINDS`]), its places, and its values by symbol.
    ///
    /// Places are drives, coordinates, joints, points, `base` or `force`, depending on the kind. The effect acts after
    /// it has been pushed to [`Rig::effects`]. Fails with all errors of the description.
    ///
    /// ```
    /// # let text = "schema = 1\nname = 'm'\nbody = [{ name = 'cart', mass = 2 }]\n\
    /// #     joint = [{ name = 'rail', kind = 'prismatic', between = ['base', 'cart'], at = [0, 0, 0], axis = [1, 0, 0] }]\n\
    /// #     coordinate = [{ name = 'x', joint = 'rail' }]\ndrive = [{ name = 'screw', joint = 'rail' }]";
    /// # let files = modelmill_boundary::files::MemoryFiles::default();
    /// # let mut rig = modelmill_rig::load("m.toml", text, &files)?.rig;
    /// let friction = rig.effect("viscous_friction", &["screw"], &[("Fv", 20.0)]).unwrap();
    /// rig.effects.push(friction);
    /// let state = modelmill_rig::RigState { q: vec![0.0], qd: vec![0.1], qdd: vec![3.0] };
    /// let force = modelmill_rig::forces(&rig, &modelmill_rig::RigTracker::new(&rig)?.follow(&state)?)?[0];
    /// assert!((force - (2.0 * 3.0 + 20.0 * 0.1)).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn effect(&self, kind: &str, at: &[&str], values: &[(&str, f64)]) -> Result<RigEffect, Vec<EffectFault>> {
        let Some(known) = RigLaw::values(kind) else {
            return Err(vec![EffectFault {
                part: EffectPart::Kind,
                message: format!("there is no kind of effect `{kind}`"),
                expected: "expected the name of a kind".to_owned(),
                help: format!("known are {}", name_list(&RigLaw::KINDS)),
            }]);
        };
        // Values in the order of the kind; missing ones take their default, and all errors are collected.
        let mut faults = Vec::new();
        let mut numbers = Vec::new();
        for value in known {
            let given = values.iter().find(|(symbol, _)| *symbol == value.symbol);
            let number = given.map(|(_, number)| *number).or(value.default);
            let says = match (number, value.sign) {
                (None, _) => {
                    faults.push(EffectFault {
                        part: EffectPart::Kind,
                        message: format!("`{kind}` lacks the value `{}`", value.symbol),
                        expected: String::new(),
                        help: format!(
                            "write `values = {{ {} = ... }}`, in SI units of the place",
                            value.symbol
                        ),
                    });
                    continue;
                }
                (Some(x), _) if !x.is_finite() => Some("a finite number"),
                (Some(x), ValueSign::Positive) if x <= 0.0 => Some("a number above zero"),
                (Some(x), ValueSign::NotNegative) if x < 0.0 => Some("a number that is not below zero"),
                _ => None,
            };
            if let Some(says) = says {
                faults.push(EffectFault {
                    part: EffectPart::Value(value.symbol.to_owned()),
                    message: format!(
                        "`{}` of `{kind}` cannot be {}",
                        value.symbol,
                        number.unwrap_or(f64::NAN)
                    ),
                    expected: format!("expected {says}"),
                    help: String::new(),
                });
            }
            numbers.extend(number);
        }
        // Symbols that the kind does not have.
        let symbols: Vec<&str> = known.iter().map(|value| value.symbol).collect();
        for (symbol, _) in values.iter().filter(|(symbol, _)| !symbols.contains(symbol)) {
            faults.push(EffectFault {
                part: EffectPart::Value((*symbol).to_owned()),
                message: format!("there is no value `{symbol}` of `{kind}`"),
                expected: "expected a symbol of this kind".to_owned(),
                help: format!("known are {}", name_list(&symbols)),
            });
        }
        // Places are checked even if values are wrong, so that one call reports all errors.
        let places = self.places(kind, at, &mut faults);
        match RigLaw::new(kind, &numbers) {
            Some(law) if faults.is_empty() => Ok(RigEffect { law, places }),
            _ => Err(faults),
        }
    }

    /// The places of an effect; reports those where its kind cannot act.
    fn places(&self, kind: &str, at: &[&str], faults: &mut Vec<EffectFault>) -> Vec<RigPlace> {
        let acts = AllowedPlaces::for_kind(kind);
        let mut places = Vec::new();
        for (i, name) in at.iter().enumerate() {
            let Some(place) = self.place(acts, name) else {
                faults.push(EffectFault {
                    part: EffectPart::Place(i),
                    message: format!("`{kind}` cannot act at `{name}`"),
                    expected: format!("expected {}", acts.description()),
                    help: format!("known are {}", name_list(&self.place_names(acts))),
                });
                continue;
            };
            places.push(place);
        }
        // A kind with a fixed number of places needs exactly that many, any other at least one.
        let wanted = acts.n_places().unwrap_or(at.len().max(1));
        let mut wrong = at.len() != wanted;
        if let [RigPlace::Point(a), RigPlace::Point(b)] = places[..]
            && acts == AllowedPlaces::TwoPointsOfABody
        {
            wrong |= self.points[a].anchor.body != self.points[b].anchor.body;
        }
        if wrong {
            faults.push(EffectFault {
                part: EffectPart::Places,
                message: format!("`{kind}` cannot act at this combination of places"),
                expected: format!("expected {}", acts.description()),
                help: String::new(),
            });
        }
        places
    }

    /// The place of a name among the allowed ones.
    fn place(&self, acts: AllowedPlaces, name: &str) -> Option<RigPlace> {
        // The joint that a coordinate measures.
        let joint = |pair: &PairFunction| self.joints.iter().position(|j| j.motion.as_ref() == Some(pair));
        let drive = || self.drives.iter().position(|drive| drive.name == name);
        match acts {
            AllowedPlaces::Drives => drive().map(RigPlace::Drive),
            AllowedPlaces::LinearDrives => drive()
                .filter(|d| self.drives[*d].measures.is_distance())
                .map(RigPlace::Drive),
            AllowedPlaces::DrivesAndJoints | AllowedPlaces::TwoDrivesOrJoints => {
                let coordinate = || self.coordinates.iter().find(|c| c.name == name);
                let named = || self.joints.iter().position(|j| j.name == name && j.motion.is_some());
                // Drives come first, then the joints of coordinates, then joints by their own names.
                drive()
                    .map(RigPlace::Drive)
                    .or_else(|| coordinate().and_then(|c| joint(&c.measures)).map(RigPlace::Joint))
                    .or_else(|| named().map(RigPlace::Joint))
            }
            AllowedPlaces::Points | AllowedPlaces::TwoPointsOfABody => {
                let point = self.points.iter().position(|point| point.name == name)?;
                self.points[point].anchor.body.map(|_| RigPlace::Point(point))
            }
            AllowedPlaces::Base => (name == "base").then_some(RigPlace::Base),
            AllowedPlaces::Force => (name == "force").then_some(RigPlace::Force),
        }
    }

    /// All names at which a kind may act.
    fn place_names(&self, acts: AllowedPlaces) -> Vec<&str> {
        let drives = self.drives.iter().map(|drive| drive.name.as_str());
        let coordinates = self.coordinates.iter().map(|c| c.name.as_str());
        let joints = self.joints.iter().map(|joint| joint.name.as_str());
        let points = self.points.iter().map(|point| point.name.as_str());
        let all: Vec<&str> = match acts {
            AllowedPlaces::Base => vec!["base"],
            AllowedPlaces::Force => vec!["force"],
            AllowedPlaces::Points | AllowedPlaces::TwoPointsOfABody => points.collect(),
            AllowedPlaces::Drives | AllowedPlaces::LinearDrives => drives.collect(),
            _ => drives.chain(coordinates).chain(joints).collect(),
        };
        all.into_iter()
            // Candidates pass the same test as the name itself.
            .filter(|name| self.place(acts, name).is_some())
            .collect()
    }
}

/// A list of names for a message, at most 24 of them.
pub(crate) fn name_list(names: &[&str]) -> String {
    let mut list: Vec<String> = names.iter().take(24).map(|name| format!("`{name}`")).collect();
    if names.len() > 24 {
        list.push("...".to_owned());
    }
    if list.is_empty() {
        "none".to_owned()
    } else {
        list.join(", ")
    }
}
