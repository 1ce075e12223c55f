//! Variants: a file that extends another one takes its entries, and overrides or removes some of them.
//!
//! Tables merge key by key, lists of tables by the names of entries. Inside of an entry each field is replaced as a
//! unit. Every value keeps its place, so that later findings point into the faulty file.

use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::document::{TomlKey, TomlNode, TomlTable, TomlValue, find_key, quote};
use crate::suggest;

/// Fields that exclude each other: a variant that sets one of a group drops the others of the extended file.
const ALTERNATIVES: [&[&[&str]]; 3] = [
    &[&["modified_dh"], &["standard_dh"], &["transform", "joint"]],
    &[&["mass", "centre", "inertia"], &["linear"]],
    &[&["joint"], &["linear"]],
];
/// A field that each new entry of a list must have. An entry of a variant without it can only override another one.
const REQUIRED_FIELDS: [(&str, &str); 9] = [
    ("frame", "on"),
    ("point", "on"),
    ("part", "on"),
    ("lumped_mass", "mass"),
    ("loop", "joins"),
    ("effect", "kind"),
    ("effect_kind", "on"),
    ("drive", "name"),
    ("actuator", "kind"),
];
/// Keys that belong to one file and are not taken over.
const OWN_KEYS: [&str; 4] = ["schema", "name", "extends", "remove"];

/// Applies a variant to the file that it extends. Removals come first, then entries override or are added.
///
/// `base` is the table of the extended file. Faults go to the log.
pub(crate) fn merge(mut base: TomlTable, variant: TomlTable, log: &mut DiagnosticLog) -> TomlTable {
    base.retain(|(key, _)| !OWN_KEYS.contains(&key.name.as_str()));
    if let Some((_, list)) = find_key(&variant, "remove") {
        remove_entries(&mut base, list, log);
    }
    // Then each entry of the variant is merged or added.
    for (key, node) in variant {
        match base.iter_mut().find(|(old, _)| old.name == key.name) {
            Some((_, old)) => merge_section(&key.name, old, node, log),
            None => base.push((key, node)),
        }
    }
    base
}

/// Merges one top-level entry of a variant into that of the extended file.
///
/// `section` is the name of the entry, `old` its value in the extended file.
fn merge_section(section: &str, old: &mut TomlNode, new: TomlNode, log: &mut DiagnosticLog) {
    // Tables of named entries merge by key, lists of tables by name; everything else is replaced.
    match (&mut old.value, new.value) {
        (TomlValue::Table(old), TomlValue::Table(new)) => {
            // Named entries: known names are merged, new ones are added at the end.
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
        // Lists of tables: entries are found by the value of their field `name`.
        (TomlValue::Array(old), TomlValue::Array(new))
            if !new.is_empty() && new.iter().all(|entry| matches!(entry.value, TomlValue::Table(_))) =>
        {
            // Entries of the variant itself never override each other.
            let n_old = old.len();
            for entry in new {
                let name = name_of(&entry).map(str::to_owned);
                let known = old[..n_old]
                    .iter_mut()
                    .find(|other| name.is_some() && name_of(other) == name.as_deref());
                // An entry without the required fields must override an existing one.
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

/// Merges the fields of one entry; a value that is not a table is replaced.
///
/// The merged entry has the place of the variant, because that is where the user edits.
fn merge_entry(old: &mut TomlNode, new: TomlNode) {
    old.span = new.span;
    let (TomlValue::Table(old_fields), TomlValue::Table(new_fields)) = (&mut old.value, &new.value) else {
        old.value = new.value;
        return;
    };
    // A variant that sets one alternative removes the others, such as `standard_dh` instead of `modified_dh`.
    for choice in ALTERNATIVES {
        let sets = |table: &TomlTable, option: &[&str]| option.iter().any(|key| find_key(table, key).is_some());
        // `joint` and `linear` occur in several kinds of entries, so only groups with a field on both sides matter.
        if let Some(taken) = choice.iter().find(|option| sets(new_fields, option)) {
            old_fields.retain(|(key, _)| {
                taken.contains(&key.name.as_str()) || !choice.iter().any(|option| option.contains(&key.name.as_str()))
            });
        }
    }
    let TomlValue::Table(new_fields) = new.value else {
        return;
    };
    // Fields of the variant replace fields of the same name.
    for (key, value) in new_fields {
        match old_fields.iter_mut().find(|(name, _)| name.name == key.name) {
            Some(field) => *field = (key, value),
            None => old_fields.push((key, value)),
        }
    }
}

/// Whether an entry lacks the required field of a new one, so that it can only be an override.
fn is_partial(section: &str, entry: &TomlNode) -> bool {
    let TomlValue::Table(table) = &entry.value else {
        return false;
    };
    // Sections without a required field have complete entries only.
    REQUIRED_FIELDS
        .iter()
        .any(|(list, key)| *list == section && find_key(table, key).is_none())
}

/// The diagnostic of an entry that overrides no existing one.
///
/// `old` are the entries of the extended file.
fn overrides_nothing(section: &str, entry: &TomlNode, old: &[TomlNode]) -> Diagnostic {
    let (message, advice) = match name_of(entry) {
        Some(name) => {
            let names = old.iter().filter_map(name_of);
            (
                format!("no `{section}` of the extended file is called `{}`", quote(name)),
                names
                    .clone()
                    .next()
                    .map(|_| suggest::advice(name, "names there", names.clone())),
            )
        }
        None => (
            format!("this entry does not state which `{section}` it overrides"),
            Some("add its `name`".to_owned()),
        ),
    };
    // The field that would make it a new entry.
    let needed = REQUIRED_FIELDS
        .iter()
        .find(|(list, _)| *list == section)
        .map_or("", |(_, key)| key);
    with_unnamed(
        Diagnostic::error(entry.span, message)
            .label(format!(
                "expected the name of an existing entry, or `{needed}` and all other fields of a new entry"
            ))
            .help_if(advice),
        section,
        old,
        None,
    )
}

/// Adds the advice that entries without a name cannot be overridden or removed, if there are such entries. `wanted`
/// is a text that the user may have taken for a name, such as a kind.
fn with_unnamed(diagnostic: Diagnostic, section: &str, entries: &[TomlNode], wanted: Option<&str>) -> Diagnostic {
    // An entry whose kind or frame is the wanted text is the most likely one.
    let mut unnamed = entries.iter().filter(|entry| name_of(entry).is_none());
    let says = |entry: &&TomlNode| {
        let TomlValue::Table(table) = &entry.value else {
            return false;
        };
        // Kind and frame are the texts that users take for names.
        let texts = ["kind", "on"].map(|key| find_key(table, key).map(|(_, node)| &node.value));
        texts
            .iter()
            .any(|value| matches!(value, Some(TomlValue::Text { text, .. }) if Some(text.as_str()) == wanted))
    };
    let Some(first) = unnamed.clone().find(says).or_else(|| unnamed.next()) else {
        return diagnostic;
    };
    diagnostic
        .related(first.span, format!("this `{section}` has no name"))
        .help("entries without a `name` can be neither overridden nor removed: give it a name in the extended file")
}

/// The name of an entry of a list, if it has one.
fn name_of(node: &TomlNode) -> Option<&str> {
    let TomlValue::Table(table) = &node.value else {
        return None;
    };
    match find_key(table, "name").map(|(_, name)| &name.value) {
        Some(TomlValue::Text { text, .. }) => Some(text),
        _ => None,
    }
}

/// Removes the entries that a variant lists, as `table` or `table.name`; unknown ones are reported.
///
/// `base` is the table of the extended file, `list` the value of `remove`.
fn remove_entries(base: &mut TomlTable, list: &TomlNode, log: &mut DiagnosticLog) {
    let TomlValue::Array(list) = &list.value else {
        return; // The reader of the merged file reports the type.
    };
    for path in list {
        let TomlValue::Text { text, .. } = &path.value else {
            continue;
        };
        // `table.name` removes one entry, `table` a complete section.
        let (section, name) = match text.split_once('.') {
            Some((section, name)) => (section, Some(name)),
            None => (text.as_str(), None),
        };
        // Names are collected before anything is removed, for the advice.
        let sections: Vec<String> = base.iter().map(|(key, _)| key.name.clone()).collect();
        let Some(position) = base.iter().position(|(key, _)| key.name == section) else {
            log.push(
                Diagnostic::error(path.span, format!("there is no `{}` to remove", quote(section)))
                    .label("the extended file has no such entry")
                    .help(suggest::advice(section, "entries", sections.iter().map(String::as_str))),
            );
            continue;
        };
        let Some(name) = name else {
            base.remove(position);
            continue;
        };
        let names: Vec<String> = entry_names(&base[position].1);
        // Tables remove by key, lists by the name of the entry.
        let removed = match &mut base[position].1.value {
            TomlValue::Table(table) => {
                let before = table.len();
                table.retain(|(key, _)| key.name != name);
                table.len() < before
            }
            TomlValue::Array(entries) => {
                let before = entries.len();
                entries.retain(|entry| name_of(entry) != Some(name));
                entries.len() < before
            }
            _ => false,
        };
        // Uses of a removed entry are reported later with this place.
        if removed {
            log.removed.insert((section.to_owned(), name.to_owned()), path.span);
        }
        // An unknown name is reported with the names that exist.
        if !removed && !log.is_full() {
            let entries = match &base[position].1.value {
                TomlValue::Array(entries) => entries.as_slice(),
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

/// The names of all entries of a table or list.
fn entry_names(node: &TomlNode) -> Vec<String> {
    match &node.value {
        TomlValue::Table(table) => table.iter().map(|(TomlKey { name, .. }, _)| name.clone()).collect(),
        TomlValue::Array(entries) => entries.iter().filter_map(name_of).map(str::to_owned).collect(),
        _ => Vec::new(),
    }
}
