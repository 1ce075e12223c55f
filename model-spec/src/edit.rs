//! Edits of the text of a model file: an effect is inserted, and everything else stays as it is, byte for byte. Nothing
//! is derived here; the module `add` of the library `modelmill` uses these edits and returns a model.
//!
//! A text and a [`NewEffect`] go in, the new text comes out. The table is inserted behind the last effect, or at the
//! end of a file without effects. An inline list of effects gets one more entry.
//!
//! Decision: an edit inserts text at one place, which is found from the spans of the parsed file. A parser that
//! prints the complete document would change line ends and layout. The diagnosis and `add` use the same edit.

mod adopted;

use std::collections::BTreeSet;
use std::fmt;
use std::path::PathBuf;

use modelmill_boundary::files::FileSource;

use crate::build::effect_places::ALL_DRIVES;
use crate::diagnostic::{DiagnosticLog, SourceFile, SourceSpan};
use crate::document::{self, TomlNode, TomlValue, find_key, quote};
use crate::exact::ExactExpression;
use crate::kinds::EffectKind;
use crate::load::{LoadFailure, LoadedModel, load_with};
use crate::mechanism::{EffectPlace, Mechanism, ModelEffect};
use crate::suggest;
use crate::values::is_name;

pub use adopted::{AdoptedValues, write_identified};

/// An effect to be written into a model file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewEffect {
    /// Name of the entry, by which a variant can replace it; `None` for an entry without a name.
    pub name: Option<String>,
    /// Name of the kind.
    pub kind: String,
    /// Names of the places on which it acts.
    pub at: Vec<String>,
    /// Whether each place has parameters of its own; otherwise the places share them.
    pub is_at_each: bool,
    /// Symbols of those parameters of its kind that this effect omits.
    pub without: Vec<String>,
    /// Names and nominal values of its parameters; all others have the defaults of the kind.
    pub parameters: Vec<NewParameter>,
    /// Values of its constants by their symbols, in SI units.
    pub constants: Vec<(String, f64)>,
    /// A remark, which becomes comment lines above the effect.
    pub comment: Option<String>,
}

/// Name and nominal value of a parameter of a new effect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewParameter {
    /// Its symbol in the kind.
    pub symbol: String,
    /// Its name in the model file; `None` for the default `symbol_place`. If a parameter of this name exists, the
    /// effect uses that parameter.
    pub name: Option<String>,
    /// Nominal value in SI units.
    pub nominal: Option<f64>,
}

/// Why an effect cannot be added.
#[derive(Clone, Debug)]
pub enum EditFailure {
    /// The effect is faulty: what is wrong, and what to do.
    Effect(String),
    /// The model file has errors, or would have them with the effect.
    Model(Box<LoadFailure>),
}

impl fmt::Display for EditFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Effect(says) => f.write_str(says),
            Self::Model(failure) => failure.fmt(f),
        }
    }
}

impl std::error::Error for EditFailure {}

/// A model file with an effect added.
#[derive(Clone, Debug)]
pub struct EditedModel {
    /// Its text.
    pub text: String,
    /// The model after the edit.
    pub loaded: LoadedModel,
    /// The effect as it was added, with names for parameters whose default names are taken.
    pub effect: NewEffect,
}

/// Adds an effect to a model that is read from its text, as [`crate::load_with`] does, and reads the result.
///
/// Fails if the model file has errors before or after the edit, if the kind or one of its symbols is unknown, or if
/// the same effect already acts at one of the places.
pub fn add_to_model(
    path_name: &str,
    text: &str,
    effect: &NewEffect,
    libraries: &[PathBuf],
    files: &dyn FileSource,
) -> Result<EditedModel, EditFailure> {
    let model = |failure| EditFailure::Model(Box::new(failure));
    // The file is read before and after the edit, so that the result is known to be valid.
    let before = load_with(path_name, text, libraries, files).map_err(model)?;
    let kind = kind_of(effect, &before.kinds)?;
    refuse_twin(effect, kind, &before.mechanism)?;
    let mut effect = with_free_names(effect, kind, &before.mechanism);
    if effect.name.is_none() {
        effect.name = Some(free_entry_name(&effect, &before));
    }
    let edited = add_effect(text, &effect)?;
    let loaded = load_with(path_name, &edited, libraries, files)
        .map_err(|failure| model(relocate_failure(failure, text, &edited, &effect)))?;
    Ok(EditedModel {
        text: edited,
        loaded,
        effect,
    })
}

/// Name in messages for the text of the new effect, which is in no file yet.
const NEW_EFFECT: &str = "the effect to be added";

/// Moves the places of a failure from the edited text to texts that the user knows: the file as it is, and the effect
/// as a text of its own.
fn relocate_failure(mut failure: LoadFailure, old: &str, new: &str, effect: &NewEffect) -> LoadFailure {
    let line_end = if old.contains("\r\n") { "\r\n" } else { "\n" };
    // Length of the common beginning of both texts; the edit lies behind it.
    let same = old.bytes().zip(new.bytes()).take_while(|(a, b)| a == b).count();
    // The same text before the place of the edit belongs to another effect.
    let found = [effect_table(effect, line_end), inline_effect(effect)]
        .into_iter()
        .find_map(|entry| {
            let mut places = new.match_indices(&entry);
            let place = places.find(|(at, _)| at + entry.len() > same)?.0;
            Some((place, entry))
        });
    let (Some((start, entry)), Some(file)) = (found, failure.sources.files.first_mut()) else {
        return failure;
    };
    // The first source becomes the file of the user again; the effect becomes an additional source.
    old.clone_into(&mut file.text);
    let end = start + entry.len();
    let added = failure.sources.files.len();
    failure.sources.files.push(SourceFile {
        path: PathBuf::from(NEW_EFFECT),
        text: entry,
    });
    let longer = new.len().saturating_sub(old.len());
    // Places inside of the effect move to the new source, those behind it back by the added length.
    let moved = |span: &mut SourceSpan| {
        if span.file != 0 {
            return;
        }
        if span.start >= start && span.end <= end {
            span.file = added;
            span.start -= start;
            span.end -= start;
        } else if span.start >= end {
            span.start = span.start.saturating_sub(longer);
            span.end = span.end.saturating_sub(longer);
        }
    };
    for found in &mut failure.diagnostics {
        found.span.iter_mut().for_each(moved);
        found.related.iter_mut().for_each(|(span, _)| moved(span));
    }
    failure
}

/// Writes the vector of gravity, m/s^2, into the text of a model file. It replaces the entry `gravity`; without such an
/// entry, it is inserted before all other entries.
///
/// Fails if the text is not TOML.
///
/// ```
/// use modelmill_spec::edit::write_gravity;
/// let text = write_gravity("name = \"arm\"\ngravity = [0, 0, \"-g\"] # up\n", [9.81, 0.0, 0.0]).unwrap();
/// assert_eq!(text, "name = \"arm\"\ngravity = [\"9.81\", \"0\", \"0\"] # up\n");
/// ```
pub fn write_gravity(text: &str, gravity: [f64; 3]) -> Result<String, String> {
    let mut log = DiagnosticLog::default();
    let table = document::parse_toml(text, 0, &mut log);
    if log.n_errors() > 0 {
        return Err("this is not TOML; correct the file first".to_owned());
    }
    let components = gravity.map(|g| format!("\"{g}\""));
    let entry = format!("gravity = [{}]", components.join(", "));
    // Top-level entries come before all tables, so that the beginning of the file is always a valid place.
    Ok(match find_key(&table, "gravity") {
        Some((key, value)) => format!("{}{entry}{}", &text[..key.span.start], &text[value.span.end..]),
        None => format!("{entry}\n{text}"),
    })
}

/// Adds an effect to the text of a model file. Whether the effect fits the model is not checked.
///
/// Fails if the text is not TOML, if its `effect` is not a list of tables, or if the effect has names or values that
/// cannot be written.
///
/// ```
/// use modelmill_spec::edit::{NewEffect, NewParameter, add_effect};
/// let effect = NewEffect {
///     kind: "coulomb_friction".to_owned(),
///     at: vec!["motor".to_owned()],
///     parameters: vec![NewParameter { symbol: "Fc".to_owned(), nominal: Some(25.9), ..NewParameter::default() }],
///     ..NewEffect::default()
/// };
/// let text = add_effect("name = \"arm\" # mine\n", &effect).unwrap();
/// assert_eq!(text, "name = \"arm\" # mine\n\n[[effect]]\nkind = \"coulomb_friction\"\nat = [\"motor\"]\n\
///                   parameters = { Fc = { nominal = 25.9 } }\n");
/// ```
pub fn add_effect(text: &str, effect: &NewEffect) -> Result<String, EditFailure> {
    check_writable(effect)?;
    let mut log = DiagnosticLog::default();
    let table = document::parse_toml(text, 0, &mut log);
    if log.n_errors() > 0 {
        let says = log.finish().into_iter().next().map(|found| found.message);
        return Err(EditFailure::Effect(format!(
            "{}; correct the file first",
            says.unwrap_or_else(|| "this is not TOML".to_owned())
        )));
    }
    let line_end = if text.contains("\r\n") { "\r\n" } else { "\n" };
    match find_key(&table, "effect") {
        None => Ok(append(text, effect, line_end)),
        Some((key, node)) => {
            let TomlValue::Array(entries) = &node.value else {
                return Err(EditFailure::Effect(
                    "`effect` of this file is not a list of tables; write effects as `[[effect]]`".to_owned(),
                ));
            };
            // The key of an inline list is followed by `=`, that of a header by `]]`.
            let is_inline = text[key.span.end..].trim_start().starts_with('=');
            if is_inline {
                Ok(extend_inline(text, node, entries, effect, line_end))
            } else {
                Ok(insert_behind(text, node, effect, line_end))
            }
        }
    }
}

/// End of a value, including everything in it, in bytes.
fn end_of(node: &TomlNode) -> usize {
    let inner = match &node.value {
        TomlValue::Array(entries) => entries.iter().map(end_of).max(),
        TomlValue::Table(table) => table.iter().map(|(key, node)| key.span.end.max(end_of(node))).max(),
        _ => None,
    };
    inner.unwrap_or(0).max(node.span.end)
}

/// Inserts a table behind the last effect.
fn insert_behind(text: &str, list: &TomlNode, effect: &NewEffect, line_end: &str) -> String {
    let end = end_of(list).min(text.len());
    // Without a line end behind the last effect the file ends there.
    let Some(rest) = text[end..].find('\n') else {
        return append(text, effect, line_end);
    };
    let at = end + rest + 1;
    let block = effect_table(effect, line_end);
    format!("{}{line_end}{block}{}", &text[..at], &text[at..])
}

/// Appends a table to the file, separated by an empty line.
fn append(text: &str, effect: &NewEffect, line_end: &str) -> String {
    let mut new = text.to_owned();
    if !text.is_empty() {
        if !text.ends_with('\n') {
            new.push_str(line_end);
        }
        new.push_str(line_end);
    }
    new.push_str(&effect_table(effect, line_end));
    new
}

/// Inserts an entry behind the last one of an inline list.
fn extend_inline(text: &str, list: &TomlNode, entries: &[TomlNode], effect: &NewEffect, line_end: &str) -> String {
    let entry = inline_effect(effect);
    let Some(last) = entries.last() else {
        let at = list.span.start + 1; // Position behind the bracket.
        return format!("{}{entry}{}", &text[..at], &text[at..]);
    };
    let end = last.span.end;
    // If entries stand on lines of their own, the new one gets its own line with the same indentation.
    let line = text[..last.span.start].rfind('\n').map_or(0, |at| at + 1);
    let indent = &text[line..last.span.start];
    let lead = if line > list.span.start && indent.trim().is_empty() {
        format!("{line_end}{indent}")
    } else {
        " ".to_owned()
    };
    // A comma behind the last entry is kept; otherwise one is inserted.
    let (comma, behind) = match comma_behind(text, end) {
        Some(comma) => (None, comma + 1),
        None => (Some(end), end),
    };
    // A comment on the same line belongs to the last entry, so the new one goes to the next line.
    let rest_of_line = text[behind..].split_inclusive('\n').next().unwrap_or_default();
    let remark = rest_of_line.trim_start().starts_with('#');
    let (at, lead) = if remark {
        let length = rest_of_line.trim_end_matches(['\r', '\n']).len();
        let own_line = if lead == " " { line_end } else { &lead };
        (behind + length, own_line.to_owned())
    } else {
        (behind, lead)
    };
    // The new entry ends with a comma exactly if the last one did.
    let (comma, close) = match comma {
        Some(_) => (",", ""),
        None => ("", ","),
    };
    format!(
        "{}{comma}{}{lead}{entry}{close}{}",
        &text[..end],
        &text[end..at],
        &text[at..]
    )
}

/// Position of the comma behind an entry of a list, after blanks and comments; `None` if there is none.
fn comma_behind(text: &str, end: usize) -> Option<usize> {
    let mut at = end;
    loop {
        let rest = &text[at..];
        let blank = rest.len() - rest.trim_start().len();
        at += blank;
        match text[at..].chars().next()? {
            ',' => return Some(at),
            '#' => at += text[at..].find('\n')?,
            _ => return None,
        }
    }
}

/// The effect as a table with a header, preceded by its remark as comment lines.
fn effect_table(effect: &NewEffect, line_end: &str) -> String {
    let mut lines: Vec<String> = remarks(effect).map(|line| format!("# {line}")).collect();
    lines.push("[[effect]]".to_owned());
    lines.extend(fields(effect));
    lines.push(String::new());
    lines.join(line_end)
}

/// The effect as an inline table; its remark becomes the field `note`.
fn inline_effect(effect: &NewEffect) -> String {
    let mut fields = fields(effect);
    let remark: Vec<String> = remarks(effect).collect();
    if !remark.is_empty() {
        let text = remark.join(" ").replace('\\', "\\\\").replace('"', "\\\"");
        fields.push(format!("note = \"{text}\""));
    }
    format!("{{ {} }}", fields.join(", "))
}

/// The lines of the remark without control characters.
fn remarks(effect: &NewEffect) -> impl Iterator<Item = String> {
    let lines = effect.comment.iter().flat_map(|comment| comment.lines());
    lines.map(|line| line.trim().chars().filter(|char| !char.is_control()).collect())
}

/// The fields of the effect as `key = value`; parameters and constants only if there are any.
fn fields(effect: &NewEffect) -> Vec<String> {
    let list = |names: &[String]| {
        let names: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        format!("[{}]", names.join(", "))
    };
    let mut fields: Vec<String> = effect.name.iter().map(|name| format!("name = \"{name}\"")).collect();
    fields.push(format!("kind = \"{}\"", effect.kind));
    // A single word stands for all drives.
    fields.push(match (effect.is_at_each, effect.at.as_slice()) {
        (false, at) => format!("at = {}", list(at)),
        (true, [one]) => format!("at_each = \"{one}\""),
        (true, at) => format!("at_each = {}", list(at)),
    });
    if !effect.without.is_empty() {
        fields.push(format!("without = {}", list(&effect.without)));
    }
    // Parameters without a name and a value keep the defaults of the kind.
    let said = effect
        .parameters
        .iter()
        .filter(|one| one.name.is_some() || one.nominal.is_some());
    let parameters: Vec<String> = said
        .map(|one| {
            let name = one.name.iter().map(|name| format!("name = \"{name}\""));
            let nominal = one.nominal.map(|value| format!("nominal = {value:?}"));
            let both: Vec<String> = name.chain(nominal).collect();
            format!("{} = {{ {} }}", one.symbol, both.join(", "))
        })
        .collect();
    if !parameters.is_empty() {
        fields.push(format!("parameters = {{ {} }}", parameters.join(", ")));
    }
    let constants: Vec<String> = (effect.constants.iter())
        .map(|(symbol, value)| format!("{symbol} = {value:?}"))
        .collect();
    if !constants.is_empty() {
        fields.push(format!("constants = {{ {} }}", constants.join(", ")));
    }
    fields
}

/// Refuses names that are not identifiers, and values that are not finite.
fn check_writable(effect: &NewEffect) -> Result<(), EditFailure> {
    let parameters = effect.parameters.iter();
    let names = std::iter::once(&effect.kind)
        .chain(&effect.name)
        .chain(&effect.at)
        .chain(&effect.without)
        .chain(parameters.clone().map(|one| &one.symbol))
        .chain(parameters.clone().filter_map(|one| one.name.as_ref()))
        .chain(effect.constants.iter().map(|(symbol, _)| symbol));
    for name in names {
        if !is_name(name) {
            return Err(EditFailure::Effect(format!(
                "`{}` cannot be a name; a letter, then letters, digits and `_`, at most 60",
                quote(name)
            )));
        }
    }
    let values = parameters
        .filter_map(|one| Some((&one.symbol, one.nominal?)))
        .chain(effect.constants.iter().map(|(symbol, value)| (symbol, *value)));
    for (symbol, value) in values {
        if !value.is_finite() {
            return Err(EditFailure::Effect(format!(
                "`{symbol}` is {value}; a finite number is expected"
            )));
        }
    }
    Ok(())
}

/// The kind of a new effect; fails if it is unknown or lacks a symbol that the effect uses.
fn kind_of<'a>(effect: &NewEffect, kinds: &'a [EffectKind]) -> Result<&'a EffectKind, EditFailure> {
    let unknown = |what: &str, name: &str, known: Vec<&str>, of: &str| {
        let advice = suggest::advice(name, &format!("{what}s"), known.iter().copied());
        EditFailure::Effect(format!("unknown {what} `{}`{of}; {advice}", quote(name)))
    };
    let Some(kind) = kinds.iter().find(|kind| kind.name == effect.kind) else {
        let known = kinds.iter().map(|kind| kind.name.as_str()).collect();
        return Err(unknown("kind", &effect.kind, known, ""));
    };
    let of = format!(" of `{}`", kind.name);
    let symbols: Vec<&str> = (kind.parameters.iter()).map(|one| one.symbol.as_str()).collect();
    for symbol in effect.parameters.iter().map(|one| &one.symbol).chain(&effect.without) {
        if !symbols.contains(&symbol.as_str()) {
            return Err(unknown("parameter", symbol, symbols, &of));
        }
    }
    let symbols: Vec<&str> = (kind.constants.iter()).map(|one| one.symbol.as_str()).collect();
    for (symbol, _) in &effect.constants {
        if !symbols.contains(&symbol.as_str()) {
            return Err(unknown("constant", symbol, symbols, &of));
        }
    }
    Ok(kind)
}

/// Refuses an effect that already acts at one of its places with the same constants.
fn refuse_twin(effect: &NewEffect, kind: &EffectKind, mechanism: &Mechanism) -> Result<(), EditFailure> {
    // The value of the new effect, else the default of the kind.
    let wanted = |symbol: &str| {
        let given = effect.constants.iter().find(|(name, _)| name == symbol);
        given.map(|(_, value)| *value).or_else(|| {
            let constant = kind.constants.iter().find(|one| one.symbol == symbol)?;
            constant.value.as_ref()?.parse().ok()
        })
    };
    let at = effect.places(mechanism);
    let is_named = |place: &EffectPlace| at.iter().any(|at| at == mechanism.place_name(*place));
    let of_kind = || mechanism.effects.iter().filter(|e| e.kind == effect.kind);
    let meets = of_kind().flat_map(|e| &e.places).filter(|place| is_named(place));
    let meets: Vec<EffectPlace> = meets.copied().collect();
    // Where places share a value, a further effect at some of them is the difference of their values.
    if mechanism.sharing_places(&effect.kind, &meets).is_some() {
        return Ok(());
    }
    for known in of_kind() {
        let alike = kind
            .constants
            .iter()
            .all(|one| known.constant(&one.symbol, mechanism) == wanted(&one.symbol));
        // Effects that couple two places are equal only if they couple the same ones.
        let places = known.places.iter().chain(&known.other);
        let names = places.map(|p| mechanism.place_name(*p));
        if kind.places == Some(2) && !names.clone().all(|n| at.iter().any(|at| at == n)) {
            continue;
        }
        // Tilt and delay are properties of the complete mechanism, whatever their constants are.
        let whole = matches!(known.places[..], [EffectPlace::Base | EffectPlace::Force]);
        let place = names.into_iter().find(|name| at.iter().any(|at| at == name));
        if let Some(place) = place.filter(|_| alike || whole) {
            return Err(EditFailure::Effect(format!(
                "`{}` acts at `{place}` already; change that effect in the model file instead, or remove it there",
                effect.kind
            )));
        }
    }
    Ok(())
}

/// A name for the entry of an effect that no other effect of the file, or of files that it extends, has.
fn free_entry_name(effect: &NewEffect, before: &LoadedModel) -> String {
    /// Longest name with places; names have at most 60 letters.
    const LONGEST: usize = 50;
    let list = before.entries.model.effect.iter().flat_map(|list| &list.entries);
    let taken: BTreeSet<&str> = list
        .filter_map(|entry| Some(entry.name.as_ref()?.text.as_str()))
        .collect();
    let usual = format!("{}_{}", effect.kind, effect.at.join("_"));
    let usual = if usual.len() > LONGEST {
        effect.kind.clone()
    } else {
        usual
    };
    let numbered = (2..).map(|n| format!("{usual}_{n}"));
    let mut names = std::iter::once(usual.clone()).chain(numbered);
    names.find(|name| !taken.contains(name.as_str())).unwrap_or(usual)
}

impl NewEffect {
    /// The names of its places; all drives if it acts at each of them.
    fn places(&self, mechanism: &Mechanism) -> Vec<String> {
        let is_all = self.is_at_each && self.at == [ALL_DRIVES];
        if !is_all || mechanism.drives.iter().any(|drive| drive.name == ALL_DRIVES) {
            return self.at.clone();
        }
        let driven = mechanism.drives.iter().filter(|drive| drive.is_driven);
        driven.map(|drive| drive.name.clone()).collect()
    }
}

/// The effect with new names for parameters whose default names are taken by other quantities.
fn with_free_names(effect: &NewEffect, kind: &EffectKind, mechanism: &Mechanism) -> NewEffect {
    let parameters = mechanism.parameters.iter().map(|one| one.name.as_str());
    let constants = mechanism.constants.iter().map(|one| one.name.as_str());
    let coordinates = mechanism.coordinates.iter().map(|one| one.name.as_str());
    let taken: BTreeSet<&str> = parameters.chain(constants).chain(coordinates).collect();
    let mut named = effect.clone();
    // Parameters of several places have no names in the file.
    if effect.is_at_each {
        return named;
    }
    for symbol in kind.parameters.iter().map(|one| &one.symbol) {
        let usual = format!("{symbol}_{}", effect.at.join("_"));
        let said = named.parameters.iter().position(|one| one.symbol == *symbol);
        if !taken.contains(usual.as_str()) || said.is_some_and(|i| named.parameters[i].name.is_some()) {
            continue;
        }
        // One of these numbers is free, because there are more of them than names.
        let free = (2..taken.len() + 3)
            .map(|n| format!("{usual}_{n}"))
            .find(|name| !taken.contains(name.as_str()));
        match said {
            Some(i) => named.parameters[i].name = free,
            None => named.parameters.push(NewParameter {
                symbol: symbol.clone(),
                name: free,
                nominal: None,
            }),
        }
    }
    named
}

impl Mechanism {
    /// The name of a place in the model file.
    pub fn place_name(&self, place: EffectPlace) -> &str {
        match place {
            EffectPlace::Drive(idx) => &self.drives[idx.0].name,
            EffectPlace::Coordinate(idx) => &self.coordinates[idx.0].name,
            EffectPlace::Point(idx) => &self.points[idx.0].name,
            EffectPlace::Part(idx) => &self.parts[idx.0].name,
            EffectPlace::Base => "base",
            EffectPlace::Force => "force",
        }
    }
}

impl ModelEffect {
    /// The value of a constant of its kind, in SI units; `None` if the kind has no such constant or the value is
    /// omitted.
    pub fn constant(&self, symbol: &str, mechanism: &Mechanism) -> Option<f64> {
        let found = self.constants.iter().find(|(name, _)| name == symbol);
        let value = |exact: &ExactExpression| exact.evaluate(&|symbol| mechanism.symbol_nominal(symbol));
        found.map(|(_, exact)| value(exact))
    }
}
