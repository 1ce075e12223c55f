//! Every effect that may be missing, written down as `add` would write it, in one variant of the model: a single derivation
//! gives the columns of all.

use std::fmt::Write as _;
use std::path::Path;

use modelmill_codegen::Derivation;
use modelmill_spec::{Carries, EffectKind, Loaded, Mechanism, ParameterIdx, Sign};

use crate::failure::{Failure, Outcome};

use super::places::{Spot, sets, spots};

/// How a constant of a kind is searched for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Search {
    /// Not at all: the value of the library.
    Given,
    /// The expression is linear in it, so that it becomes a column of its own.
    Linear,
    /// Values between two shares of the largest rate of the place, evenly in the logarithm.
    OfRate([f64; 2], usize),
    /// Lengths that fit into the travel of the place between these many times, evenly in their number.
    OfTravel([f64; 2], usize),
}

/// An effect at one place.
pub(crate) struct Single {
    pub(crate) kind: usize,
    pub(crate) spot: Spot,
    /// Names of its parameters in the variant.
    pub(crate) parameters: Vec<String>,
    /// Names of its constants in the variant, with how each is searched for.
    pub(crate) constants: Vec<(String, String, Search)>,
}

/// A candidate: a kind at places that share its parameters.
pub(crate) struct Entry {
    /// Effects at single places, whose columns add up.
    pub(crate) singles: Vec<usize>,
}

/// All candidates of a model, derived.
pub(crate) struct Candidates {
    pub(crate) kinds: Vec<EffectKind>,
    pub(crate) singles: Vec<Single>,
    pub(crate) entries: Vec<Entry>,
    /// Effects whose constants are known.
    pub(crate) known: Derivation,
    /// Effects with constants that are searched for, whose columns are evaluated again and again.
    pub(crate) searched: Derivation,
}

impl Single {
    /// Whether a constant of it is searched for.
    pub(crate) fn is_searched(&self) -> bool {
        (self.constants.iter())
            .any(|(_, _, search)| !matches!(search, Search::Given | Search::Linear))
    }
}

/// How a kind's constant is searched for.
fn search(kind: &EffectKind, symbol: &str) -> Search {
    match (kind.name.as_str(), symbol) {
        (_, "rest") => Search::Linear,
        (_, "vs") => Search::OfRate([0.005, 0.5], 14),
        (_, "pitch") => Search::OfTravel([0.5, 24.0], 72),
        _ => Search::Given,
    }
}

/// Writes down and derives all candidates of a model read from `path`.
pub(crate) fn candidates(path: &Path, loaded: &Loaded) -> Outcome<Candidates> {
    let mechanism = &loaded.mechanism;
    let all = spots(mechanism);
    let mut singles: Vec<Single> = Vec::new();
    let mut entries = Vec::new();
    let mut variants = [Variant::new(path)?, Variant::new(path)?];
    for (k, kind) in loaded.kinds.iter().enumerate() {
        let fitting: Vec<&Spot> = all
            .iter()
            .filter(|spot| fits(kind, spot) && !has(mechanism, kind, spot))
            .collect();
        let first = singles.len();
        for spot in &fitting {
            let single = single(k, kind, spot, singles.len());
            variants[usize::from(single.is_searched())].write(kind, &single);
            singles.push(single);
        }
        // Waves along the travel differ in their phase, even at places that are alike otherwise.
        let is_wave = |c: &(String, String, Search)| matches!(c.2, Search::OfTravel(..));
        let waves = singles[first..]
            .iter()
            .any(|s| s.constants.iter().any(is_wave));
        for set in sets(mechanism, &fitting) {
            if waves && set.len() > 1 {
                continue;
            }
            let place = |spot: &&Spot| fitting.iter().position(|other| other == spot);
            entries.push(Entry {
                singles: set.iter().filter_map(place).map(|i| first + i).collect(),
            });
        }
    }
    let [known, searched] = variants;
    Ok(Candidates {
        kinds: loaded.kinds.clone(),
        singles,
        entries,
        known: known.derive(path)?,
        searched: searched.derive(path)?,
    })
}

/// A variant of the model that has effects besides, as text.
struct Variant {
    text: String,
    constants: String,
    parameters: Vec<String>,
}

impl Variant {
    fn new(path: &Path) -> Outcome<Self> {
        Ok(Self {
            text: header(path)?,
            constants: String::new(),
            parameters: Vec::new(),
        })
    }

    fn derive(mut self, path: &Path) -> Outcome<Derivation> {
        if !self.constants.is_empty() {
            let _ = write!(self.text, "[constants]\n{}", self.constants);
        }
        let name = path.with_file_name("candidates.toml");
        let mut read = |path: &Path| std::fs::read_to_string(path);
        let variant = modelmill_spec::load(&name.to_string_lossy(), &self.text, &mut read)
            .map_err(|failure| Failure::Rendered(failure.render(false)))?;
        let mechanism = &variant.mechanism;
        let own = mechanism.parameters.iter().enumerate();
        let own: Vec<ParameterIdx> = own
            .filter(|(_, p)| self.parameters.contains(&p.name))
            .map(|(i, _)| ParameterIdx(i))
            .collect();
        modelmill_codegen::derive_columns(mechanism, &own)
            .map_err(|error| Failure::Input(format!("{}: {error}", path.display())))
    }

    fn write(&mut self, kind: &EffectKind, single: &Single) {
        let Self {
            text,
            constants,
            parameters: own,
        } = self;
        own.extend(single.parameters.iter().cloned());
        let list = |pairs: Vec<String>| pairs.join(", ");
        let parameters = kind.parameters.iter().zip(&single.parameters);
        let parameters =
            parameters.map(|(p, name)| format!("{} = {{ name = \"{name}\" }}", p.symbol));
        let _ = writeln!(
            text,
            "[[effect]]\nkind = \"{}\"\nat = \"{}\"\nparameters = {{ {} }}",
            kind.name,
            single.spot.name,
            list(parameters.collect())
        );
        let searched = single
            .constants
            .iter()
            .filter(|(_, _, s)| *s != Search::Given);
        let given: Vec<String> = searched
            .clone()
            .map(|(symbol, name, _)| format!("{symbol} = \"{name}\""))
            .collect();
        if given.is_empty() {
            return;
        }
        let _ = writeln!(text, "constants = {{ {} }}", list(given));
        for (symbol, name, _) in searched {
            let constant = kind.constants.iter().find(|c| c.symbol == *symbol);
            let unit = constant
                .and_then(|c| c.units.iter().find(|(c, _)| *c == single.spot.carries))
                .map_or("1", |(_, unit)| unit.as_str());
            let _ = writeln!(constants, "{name} = {{ value = 1, unit = \"{unit}\" }}");
        }
    }
}

fn header(path: &Path) -> Outcome<String> {
    let file = path.file_name().map(|name| name.to_string_lossy());
    let file = file.ok_or_else(|| {
        Failure::Input(format!(
            "{} is not the path of a model file",
            path.display()
        ))
    })?;
    let extends = serde_json::to_string(&file).map_err(Failure::input)?;
    Ok(format!(
        "schema = 1\nname = \"candidates\"\nextends = {extends}\n"
    ))
}

/// Whether a kind may act at a place.
fn fits(kind: &EffectKind, spot: &Spot) -> bool {
    let has_unit = |units: &[(Carries, String)]| units.iter().any(|(c, _)| *c == spot.carries);
    // Only drives carry a load that is measured.
    let has_load = spot.sort == modelmill_spec::ActsOn::Drive || !kind.expression.contains("load");
    has_load && kind.on.contains(&spot.sort) && kind.parameters.iter().all(|p| has_unit(&p.units))
}

/// Whether the model has the effect already.
fn has(mechanism: &Mechanism, kind: &EffectKind, spot: &Spot) -> bool {
    let mut effects = mechanism.effects.iter();
    effects.any(|effect| effect.kind == kind.name && effect.places.contains(&spot.place))
}

fn single(k: usize, kind: &EffectKind, spot: &Spot, number: usize) -> Single {
    let name = |symbol: &str| format!("candidate{number}_{symbol}");
    Single {
        kind: k,
        spot: spot.clone(),
        parameters: kind.parameters.iter().map(|p| name(&p.symbol)).collect(),
        constants: kind
            .constants
            .iter()
            .map(|c| (c.symbol.clone(), name(&c.symbol), search(kind, &c.symbol)))
            .collect(),
    }
}

/// The sign of a kind's parameter, as the search knows it.
pub(crate) fn sign(sign: Sign) -> modelmill_identify::diagnose::Sign {
    use modelmill_identify::diagnose::Sign as Known;
    match sign {
        Sign::Positive => Known::Positive,
        Sign::Negative => Known::Negative,
        Sign::Any => Known::Any,
    }
}
