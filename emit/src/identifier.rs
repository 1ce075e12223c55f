//! Rust identifiers for names of the model file: different names give different identifiers.
//! A name of the model file goes in, an identifier that compiles and stays readable comes out.

use std::fmt::Write as _;

use proc_macro2::{Ident, Span};

/// Names that a pattern would not bind: keywords without a raw form, names of the prelude, and constants and structs of
/// the emitted module, which a pattern would match instead.
const UNBINDABLE_NAMES: [&str; 41] = [
    "self",
    "Self",
    "super",
    "crate",
    "None",
    "Some",
    "Ok",
    "Err",
    "ScalarNumbers",
    "Var",
    "ACTIVE",
    "BASE_PARAMETERS",
    "CONSTANTS",
    "DRIVES",
    "INPUTS",
    "INPUTS_WITH_PASSIVE",
    "JOINTS",
    "LOOPS",
    "N_ACTIVE",
    "N_BASE",
    "N_DRIVES",
    "N_JOINTS",
    "N_LOOPS",
    "N_PASSIVE",
    "N_PRODUCTS",
    "PARAMETERS",
    "PASSIVE",
    "POSE",
    "Bias",
    "Columns",
    "Coriolis",
    "Effects",
    "Forces",
    "Gaps",
    "Gravity",
    "LoopScales",
    "MassMatrix",
    "MotionOfDrives",
    "MotionOfPassive",
    "Regressor",
    "Wrenches",
];

/// Keywords of the current edition that the parser, which knows an older edition, accepts as identifiers.
const NEWER_KEYWORDS: [&str; 1] = ["gen"];

/// Names in scope everywhere; a module of the same name would shadow them for its siblings.
const IN_SCOPE: [&str; 20] = [
    "alloc", "bool", "char", "core", "f32", "f64", "i8", "i16", "i32", "i64", "i128", "isize", "std", "str", "u8",
    "u16", "u32", "u64", "u128", "usize",
];

/// The identifier of a field: the name itself, as `r#type` if it is a keyword.
///
/// Other names are spelled with a leading `_`, which no name of a model file has. Characters that an identifier cannot
/// contain are written as their code, so that different names stay different.
pub(super) fn field_identifier(name: &str) -> Ident {
    // Letters first, then letters, digits and underscores.
    let plain = name.starts_with(|c: char| c.is_ascii_alphabetic())
        // Only ASCII names are taken as they are; others may look alike after normalisation.
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !UNBINDABLE_NAMES.contains(&name);
    if !plain {
        return Ident::new(&spell_plain(name), Span::call_site());
    }
    // A keyword is no identifier for the parser, and needs the raw form.
    if NEWER_KEYWORDS.contains(&name) || syn::parse_str::<syn::Ident>(name).is_err() {
        Ident::new_raw(name, Span::call_site())
    } else {
        Ident::new(name, Span::call_site())
    }
}

/// The identifier of a module: as [`field_identifier`], and different from the names in scope around it.
pub(super) fn module_identifier(name: &str) -> Ident {
    if IN_SCOPE.contains(&name) {
        Ident::new(&spell_plain(name), Span::call_site())
    } else {
        field_identifier(name)
    }
}

/// A leading `_`, which no name of a model file has, and the name with other characters as `_HEX_`.
pub(super) fn spell_plain(name: &str) -> String {
    let mut spelled = "_".to_owned();
    // The code of a character is unique, so that no two names become equal.
    for c in name.chars() {
        if c.is_ascii_alphanumeric() {
            spelled.push(c);
        } else {
            _ = write!(spelled, "_{:x}_", u32::from(c));
        }
    }
    spelled
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn different_names_give_different_identifiers() {
        let names = [
            "Gravity", "_Gravity", "None", "type", "type_", "_type", "r", "r_type", "self", "self_", "_self", "Self",
            "super", "crate", "gen", "async", "try", "union", "x", "_", "__", "_x", "_x_", "a-b", "a_b", "a_2d_b",
            "_a_2d_b", "\u{e4}", "_e4_", "1", "_1", "f64", "_f64", "T", "Model",
        ];
        for of in [field_identifier, module_identifier] {
            let mut seen = BTreeMap::new();
            for name in names {
                let identifier = of(name).to_string();
                assert!(syn::parse_str::<Ident>(&identifier).is_ok(), "{identifier}");
                if let Some(other) = seen.insert(identifier.clone(), name) {
                    panic!("`{name}` and `{other}` are both `{identifier}`");
                }
            }
        }
    }

    #[test]
    fn names_stay_readable() {
        let field = |name: &str| field_identifier(name).to_string();
        assert_eq!(field("dc1"), "dc1");
        assert_eq!(field("type"), "r#type");
        assert_eq!(field("self"), "_self");
        assert_eq!(module_identifier("f64").to_string(), "_f64");
        assert_eq!(module_identifier("arm").to_string(), "arm");
    }
}
