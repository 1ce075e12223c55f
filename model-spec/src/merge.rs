//! Variants: a file that extends another takes over its entries and overrides or removes single ones.
//!
//! Tables merge key by key, lists of tables by the entries' names, and inside an entry each field is replaced whole.
//! Every value keeps its place, so that later findings point into the file at fault.

use crate::diagnostic::{Diagnostic, Log};
use crate::document::{Key, Node, Table, Value, get, quote};
use crate::suggest;

/// Fields of which one rules the others out: a variant that sets one drops the others of the extended file.
const ALTERNATIVES: [&[&[&str]]; 3] = [
    &[&["modified_dh"], &["standard_dh"], &["transform", "joint"]],
    &[&["mass", "centre", "inertia"], &["linear"]],
    &[&["joint"], &["linear"]],
];
/// A field that an entry of a list must have: an entry of a variant without it can only mean to override another one.
const NEEDED: [(&str, &str); 8] = [
    ("frame", "on"),
    ("point", "on"),
    ("part", "on"),
    ("lumped_mass", "mass"),
    ("loop", "joins"),
    ("effect", "kind"),
    ("effect_kind", "on"),
    ("drive", "name"),
];
/// Keys that are a file's own and are not taken over.
const OWN: [&str; 4] = ["schema", "name", "extends", "remove"];

/// Applies a variant to the file that it extends.
pub(crate) fn merge(mut base: Table, variant: Table, log: &mut Log) -> Table {
    base.retain(|(key, _)| !OWN.contains(&key.name.as_str()));
    if let Some((_, list)) = get(&variant, "remove") {
        remove(&mut base, list, log);
    }
    for (key, node) in variant {
        match base.iter_mut().find(|(old, _)| old.name == key.name) {
            Some((_, old)) => merge_section(&key.name, old, node, log),
            None => base.push((key, node)),
        }
    }
    base
}

fn merge_section(section: &str, old: &mut Node, new: Node, log: &mut Log) {
    match (&mut old.value, new.value) {
        (Value::Table(old), Value::Table(new)) => {
            for (key, entry) in new {
                match old.iter_mut().find(|(name, _)| name.name == key.name) {
                    Some((old_key, old_entry)) => {
                        old_key.span = key.span;
                        merge_entry(old_entry, entry);
                    }
                    None => old.push((key, entry)),
                }
            }
        }
        (Value::Array(old), Value::Array(new))
            if !new.is_empty()
                && new
                    .iter()
                    .all(|entry| matches!(entry.value, Value::Table(_))) =>
        {
            let n_old = old.len();
            for entry in new {
                let name = name_of(&entry).map(str::to_owned);
                let known = old[..n_old]
                    .iter_mut()
                    .find(|other| name.is_some() && name_of(other) == name.as_deref());
                match known {
                    Some(known) => merge_entry(known, entry),
                    None if is_partial(section, &entry) && !log.syntax_broken => {
                        log.push(overrides_nothing(section, &entry, &old[..n_old]));
                    }
                    None => old.push(entry),
                }
            }
        }
        (_, value) => {
            old.span = new.span;
            old.value = value;
        }
    }
}

fn merge_entry(old: &mut Node, new: Node) {
    old.span = new.span;
    let (Value::Table(old_fields), Value::Table(new_fields)) = (&mut old.value, &new.value) else {
        old.value = new.value;
        return;
    };
    for choice in ALTERNATIVES {
        let sets =
            |table: &Table, option: &[&str]| option.iter().any(|key| get(table, key).is_some());
        // `joint` and `linear` stand in several kinds of entries; both sides of a choice must occur to matter.
        if let Some(taken) = choice.iter().find(|option| sets(new_fields, option)) {
            old_fields.retain(|(key, _)| {
                taken.contains(&key.name.as_str())
                    || !choice
                        .iter()
                        .any(|option| option.contains(&key.name.as_str()))
            });
        }
    }
    let Value::Table(new_fields) = new.value else {
        return;
    };
    for (key, value) in new_fields {
        match old_fields
            .iter_mut()
            .find(|(name, _)| name.name == key.name)
        {
            Some(field) => *field = (key, value),
            None => old_fields.push((key, value)),
        }
    }
}

/// Whether an entry lacks what a new one must have, so that it can only mean to override.
fn is_partial(section: &str, entry: &Node) -> bool {
    let Value::Table(table) = &entry.value else {
        return false;
    };
    NEEDED
        .iter()
        .any(|(list, key)| *list == section && get(table, key).is_none())
}

/// What is wrong with an entry that means to override, but none that there is.
fn overrides_nothing(section: &str, entry: &Node, old: &[Node]) -> Diagnostic {
    let (message, advice) = match name_of(entry) {
        Some(name) => {
            let names = old.iter().filter_map(name_of);
            (
                format!(
                    "no `{section}` of the extended file is called `{}`",
                    quote(name)
                ),
                names
                    .clone()
                    .next()
                    .map(|_| suggest::advice(name, "names there", names.clone())),
            )
        }
        None => (
            format!("it is not said which `{section}` this overrides"),
            Some("add its `name`".to_owned()),
        ),
    };
    let needed = NEEDED
        .iter()
        .find(|(list, _)| *list == section)
        .map_or("", |(_, key)| key);
    with_unnamed(
        Diagnostic::error(entry.span, message)
            .label(format!(
                "expected the name of an entry there, or `{needed}` and all else that a new entry needs"
            ))
            .help_if(advice),
        section,
        old,
        None,
    )
}

/// Adds that entries without a name cannot be overridden or removed, if there are any; `wanted` is what the user may
/// have taken for a name.
fn with_unnamed(
    diagnostic: Diagnostic,
    section: &str,
    entries: &[Node],
    wanted: Option<&str>,
) -> Diagnostic {
    let mut unnamed = entries.iter().filter(|entry| name_of(entry).is_none());
    let says = |entry: &&Node| {
        let Value::Table(table) = &entry.value else {
            return false;
        };
        let texts = ["kind", "on"].map(|key| get(table, key).map(|(_, node)| &node.value));
        texts
            .iter()
            .any(|value| matches!(value, Some(Value::Text { text, .. }) if Some(text.as_str()) == wanted))
    };
    let Some(first) = unnamed.clone().find(says).or_else(|| unnamed.next()) else {
        return diagnostic;
    };
    diagnostic
        .related(first.span, format!("this `{section}` has no name"))
        .help("what has no `name` can be neither overridden nor removed: give it a name in the extended file")
}

/// The name of an entry of a list.
fn name_of(node: &Node) -> Option<&str> {
    let Value::Table(table) = &node.value else {
        return None;
    };
    match get(table, "name").map(|(_, name)| &name.value) {
        Some(Value::Text { text, .. }) => Some(text),
        _ => None,
    }
}

fn remove(base: &mut Table, list: &Node, log: &mut Log) {
    let Value::Array(list) = &list.value else {
        return; // The reader of the merged file reports the type.
    };
    for path in list {
        let Value::Text { text, .. } = &path.value else {
            continue;
        };
        let (section, name) = match text.split_once('.') {
            Some((section, name)) => (section, Some(name)),
            None => (text.as_str(), None),
        };
        let sections: Vec<String> = base.iter().map(|(key, _)| key.name.clone()).collect();
        let Some(position) = base.iter().position(|(key, _)| key.name == section) else {
            log.push(
                Diagnostic::error(
                    path.span,
                    format!("there is no `{}` to remove", quote(section)),
                )
                .label("the extended file has no such entry")
                .help(suggest::advice(
                    section,
                    "entries",
                    sections.iter().map(String::as_str),
                )),
            );
            continue;
        };
        let Some(name) = name else {
            base.remove(position);
            continue;
        };
        let names: Vec<String> = names_in(&base[position].1);
        let removed = match &mut base[position].1.value {
            Value::Table(table) => {
                let before = table.len();
                table.retain(|(key, _)| key.name != name);
                table.len() < before
            }
            Value::Array(entries) => {
                let before = entries.len();
                entries.retain(|entry| name_of(entry) != Some(name));
                entries.len() < before
            }
            _ => false,
        };
        if removed {
            log.removed
                .insert((section.to_owned(), name.to_owned()), path.span);
        }
        if !removed && !log.is_full() {
            let entries = match &base[position].1.value {
                Value::Array(entries) => entries.as_slice(),
                _ => &[],
            };
            let advice = (!names.is_empty() || entries.is_empty())
                .then(|| suggest::advice(name, "names there", names.iter().map(String::as_str)));
            log.push(with_unnamed(
                Diagnostic::error(
                    path.span,
                    format!("there is no `{}` in `{section}` to remove", quote(name)),
                )
                .label("the extended file has no entry of this name")
                .help_if(advice),
                section,
                entries,
                Some(name),
            ));
        }
    }
}

fn names_in(node: &Node) -> Vec<String> {
    match &node.value {
        Value::Table(table) => table
            .iter()
            .map(|(Key { name, .. }, _)| name.clone())
            .collect(),
        Value::Array(entries) => entries
            .iter()
            .filter_map(name_of)
            .map(str::to_owned)
            .collect(),
        _ => Vec::new(),
    }
}
