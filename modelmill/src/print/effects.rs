//! Output of `effects`: the library of effects as JSON, as a table, or one kind in detail.

use crate::text::wrap::wrap_words;
use modelmill_spec::{ActsOn, ConstantSearch, EffectKind, KindConstant, KindParameter, PlaceLoad, Scale, Sign};
use serde_json::{Value, json};

use crate::error::{Error, Outcome};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, table};

/// Width of a line of text, letters.
const WIDTH: usize = 96;

/// The kinds as one JSON object: where each acts, its expression, and its parameters and constants with units.
pub fn json(kinds: &[EffectKind]) -> Value {
    json!({ "kinds": kinds.iter().map(kind_json).collect::<Vec<_>>() })
}

/// The kinds as a table, a line for each.
pub fn kind_table(kinds: &[EffectKind]) -> Vec<String> {
    // Name, places and expression fit into one line for most kinds.
    let rows: Vec<Vec<String>> = kinds
        .iter()
        .map(|kind| vec![kind.name.clone(), places(kind), addition_text(kind)])
        .collect();
    let columns = [
        ("effect", ColumnAlignment::Left),
        ("acts on", ColumnAlignment::Left),
        ("adds", ColumnAlignment::Left),
    ];
    table(0, &columns, &rows)
}

/// A kind by its name.
///
/// Fails if there is no kind of that name; the message lists the known ones.
pub fn kind<'a>(kinds: &'a [EffectKind], name: &str) -> Outcome<&'a EffectKind> {
    let found = kinds.iter().find(|kind| kind.name == name);
    found.ok_or_else(|| unknown_kind_error(name, kinds))
}

/// Other kinds whose first sentence contains the name of this kind, such as `two_point_element` for `spring`.
pub fn related_kinds<'a>(kinds: &'a [EffectKind], name: &str) -> Vec<&'a EffectKind> {
    let word = name.replace('_', " ");
    let others = kinds.iter().filter(|kind| kind.name != name);
    others.filter(|kind| has_word(&kind.says, &word)).collect()
}

/// Whether a text has a word, or words in sequence, also as a plural.
fn has_word(text: &str, word: &str) -> bool {
    let plain = |text: &str| {
        let words = text.split(|c: char| !c.is_alphanumeric()).filter(|one| !one.is_empty());
        format!(" {} ", words.map(str::to_lowercase).collect::<Vec<_>>().join(" "))
    };
    let (text, word) = (plain(text), plain(word));
    text.contains(&word) || text.contains(&format!("{}s ", word.trim_end()))
}

/// The error for an unknown kind; it lists the known ones.
fn unknown_kind_error(name: &str, kinds: &[EffectKind]) -> Error {
    let names: Vec<&str> = kinds.iter().map(|kind| kind.name.as_str()).collect();
    // Users search for what they see on the machine, such as a strut.
    let word = name.replace('_', " ");
    let described = kinds
        .iter()
        .filter(|kind| has_word(&kind.says, &word) || has_word(&kind.explains, &word));
    let described: Vec<String> = described.map(|kind| format!("`{}`", kind.name)).collect();
    let described = if described.is_empty() {
        String::new()
    } else {
        format!("; the word stands in the description of {}", described.join(", "))
    };
    Error::input(format!(
        "there is no kind of effect `{name}`{described}; the known kinds are {}",
        names.join(", ")
    ))
}

/// Where a kind acts, in words.
fn places(kind: &EffectKind) -> String {
    // A kind may act on several sorts of places.
    let all: Vec<&str> = kind.on.iter().map(|on| on.description()).collect();
    let joined = all.join(" or ");
    match (kind.places, kind.other) {
        // Effects such as those of gears depend on a second place.
        (_, Some(other)) => format!("{joined}, as a function of another place that {}", other.description()),
        (Some(2), None) => format!("two of: {joined}"),
        _ => joined,
    }
}

/// What a kind adds to the forces: its expression, or the change of the mechanics in words.
fn addition_text(kind: &EffectKind) -> String {
    match kind.mechanics {
        Some(mechanics) => mechanics.description().to_owned(),
        None => kind.expression.clone(),
    }
}

/// Everything about one kind, as text.
pub fn kind_text(kind: &EffectKind, style: TerminalStyle) -> String {
    let mut lines = vec![style.bold(&kind.name)];
    lines.extend(wrap_text(&kind.says, 0));
    lines.push(String::new());
    lines.push(format!("acts on  {}", places(kind)));
    lines.push(format!("adds     {}", addition_text(kind)));
    // Parameters are identified, constants are fixed or searched.
    let mut symbols: Vec<Vec<String>> = Vec::new();
    // Parameters come first, with the sign that they must have.
    for one in &kind.parameters {
        let sign = sign(one);
        symbols.push(vec![
            one.symbol.clone(),
            units(&one.units),
            format!("parameter{}", sign.map_or_else(String::new, |s| format!(", {s}"))),
            one.note.clone(),
        ]);
    }
    // Constants follow, with their default or the range of their search.
    for one in &kind.constants {
        // A default stands in parentheses, as text of the library.
        let value = one.value.as_ref();
        let default = value.map_or_else(String::new, |v| format!(" ({v} if not given)"));
        symbols.push(vec![
            one.symbol.clone(),
            units(&one.units),
            format!("constant{default}"),
            [one.note.clone(), search_text(one)]
                .into_iter()
                .filter(|text| !text.is_empty())
                .collect::<Vec<_>>()
                .join("; "),
        ]);
    }
    if !symbols.is_empty() {
        lines.push(String::new());
        let columns = [
            ("symbol", ColumnAlignment::Left),
            ("unit", ColumnAlignment::Left),
            ("", ColumnAlignment::Left),
            ("", ColumnAlignment::Left),
        ];
        lines.extend(table(0, &columns, &symbols));
    }
    // The explanations of the library.
    for (head, text) in [
        ("what it is", &kind.explains),
        ("what it can be confused with", &kind.confused_with),
    ] {
        if !text.is_empty() {
            lines.push(String::new());
            lines.push(style.bold(head));
            lines.extend(wrap_text(text, 2));
        }
    }
    lines.join("\n")
}

/// Text in lines of at most `WIDTH` letters.
fn wrap_text(text: &str, indent: usize) -> Vec<String> {
    let lines = wrap_words(text, WIDTH - indent);
    lines
        .iter()
        .map(|line| format!("{}{line}", " ".repeat(indent)))
        .collect()
}

/// Units for the places where a symbol may stand, without repetition.
fn units(units: &[(PlaceLoad, String)]) -> String {
    let mut all: Vec<&str> = units.iter().map(|(_, unit)| unit.as_str()).collect();
    // Forces and torques often have different units; equal ones are named once.
    all.dedup();
    all.join(" or ")
}

/// The bound of a parameter's sign in words; `None` if it may have either.
fn sign(parameter: &KindParameter) -> Option<&'static str> {
    match parameter.sign {
        Sign::Positive => Some("not negative"),
        Sign::Negative => Some("not positive"),
        Sign::Any => None,
    }
}

/// How a constant is determined if no value is given.
fn search_text(constant: &KindConstant) -> String {
    match constant.search {
        None => String::new(),
        Some(ConstantSearch::Linear) => "estimated linearly".to_owned(),
        Some(ConstantSearch::Range { from, to, of }) => {
            // Ranges may be relative to the motion of the place.
            let of = match of {
                Scale::Rate => " times the largest rate",
                Scale::Travel => " times the travel",
                Scale::One => "",
            };
            format!("searched from {from} to {to}{of}")
        }
    }
}

/// A kind as JSON.
fn kind_json(kind: &EffectKind) -> Value {
    // Units depend on whether the place is one of forces, torques or points.
    let by_place = |units: &[(PlaceLoad, String)]| -> Value {
        let name = |carries: &PlaceLoad| match carries {
            PlaceLoad::Force => "force",
            PlaceLoad::Torque => "torque",
            PlaceLoad::Mass => "point",
            PlaceLoad::Elsewhere => "elsewhere",
        };
        let entries = units
            .iter()
            .map(|(carries, unit)| (name(carries).to_owned(), json!(unit)));
        Value::Object(entries.collect())
    };
    // The kinds of places on which the effect can act.
    let on = kind.on.iter().map(|on| match on {
        ActsOn::Drive => "drive",
        ActsOn::Coordinate => "coordinate",
        ActsOn::Point => "point",
        ActsOn::Part => "part",
        ActsOn::Base => "base",
        ActsOn::Force => "force",
    });
    let parameters = kind.parameters.iter().map(|one| {
        json!({
            "symbol": one.symbol,
            "units": by_place(&one.units),
            "sign": match one.sign {
                Sign::Positive => "positive",
                Sign::Negative => "negative",
                Sign::Any => "any",
            },
            "note": one.note,
        })
    });
    // How a constant is found: linearly, by a search in a range, or not at all.
    let constants = kind.constants.iter().map(|one| {
        json!({
            "symbol": one.symbol,
            "units": by_place(&one.units),
            "value": one.value,
            "search": match one.search {
                None => Value::Null,
                Some(ConstantSearch::Linear) => json!("linear"),
                Some(ConstantSearch::Range { from, to, of }) => json!({
                    "from": from,
                    "to": to,
                    "of": match of {
                        Scale::Rate => "rate",
                        Scale::Travel => "travel",
                        Scale::One => "one",
                    },
                }),
            },
            "note": one.note,
        })
    });
    json!({
        "name": kind.name,
        "on": on.collect::<Vec<_>>(),
        "places": kind.places,
        "adds": addition_text(kind),
        "parameters": parameters.collect::<Vec<_>>(),
        "constants": constants.collect::<Vec<_>>(),
        "says": kind.says,
        "explains": kind.explains,
        "doubles": kind.confused_with,
        "own": kind.is_own,
    })
}
