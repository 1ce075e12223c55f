//! Declared options: names are unique, defaults are those of the library, references lead somewhere, and the keywords of
//! the Python package are those of the declarations.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use modelmill::identify::{EstimatorOptions, HUBER_BOUND};
use modelmill::options::{DeclaredOptions, OptionDeclaration, OptionKind, OptionValue, find_declaration};
use modelmill::options::{find_excluded_pair, parse_column};
use modelmill::recording::{MAX_FILTER_ORDER, RecordingOptions, SmoothingMethod};
use modelmill::text::wrap::wrap_words;

/// Letters of a line of the Python package.
const LINE_LETTERS: usize = 120;

/// Checks what holds for every list of declarations.
fn check_list<T: DeclaredOptions + PartialEq + std::fmt::Debug>() {
    let all = T::declarations();
    let names: BTreeSet<&str> = all.iter().map(|one| one.name).collect();
    let flags: BTreeSet<&str> = all.iter().map(|one| one.flag).collect();
    assert_eq!(
        (names.len(), flags.len()),
        (all.len(), all.len()),
        "two options have one name"
    );
    for one in all {
        assert!(!one.flag.contains('_') && !one.name.contains('-'), "{}", one.name);
        assert_eq!(
            one.placeholder.is_empty(),
            matches!(one.kind, OptionKind::Switch { .. }),
            "{}",
            one.name
        );
        for other in one.excludes {
            assert!(
                names.contains(other),
                "{} excludes {other}, which is not declared",
                one.name
            );
        }
        // Every reference of a help names an option of the list, and a value that it takes.
        let check = |name: &str, value: Option<&str>| {
            let other = find_declaration::<T>(name).unwrap_or_else(|| panic!("{}: {name}", one.name));
            let value = value.map(|value| {
                other
                    .parse([value])
                    .unwrap_or_else(|says| panic!("{name}={value}: {says}"))
            });
            if let Some(value) = value {
                assert_eq!(other.set(&mut T::default(), value), Ok(()), "{}", one.name);
            }
            String::new()
        };
        one.format_help(&check);
        if let OptionKind::Choice { values } = &one.kind {
            // The first choice is the default of the library.
            let mut options = T::default();
            assert_eq!(
                one.set(&mut options, OptionValue::Choice(values[0].name.to_owned())),
                Ok(())
            );
            assert_eq!(options, T::default(), "{}", one.name);
            for value in *values {
                value.format_help(&check);
                assert_eq!(one.parse([value.flag]), Ok(OptionValue::Choice(value.name.to_owned())));
            }
        }
        if let OptionKind::Integer {
            default: Some(default), ..
        } = one.kind
        {
            let mut options = T::default();
            assert_eq!(one.set(&mut options, OptionValue::Integer(default)), Ok(()));
            assert_eq!(options, T::default(), "{}", one.name);
        }
    }
}

#[test]
fn lists_of_options_are_consistent() {
    check_list::<RecordingOptions>();
    check_list::<EstimatorOptions>();
}

/// Sets one option by a text.
fn set_text<T: DeclaredOptions>(options: &mut T, name: &str, text: &str) -> Result<(), String> {
    let one = find_declaration::<T>(name).expect("a declared option");
    one.parse([text]).and_then(|value| one.set(options, value))
}

#[test]
fn values_out_of_range_are_refused_and_leave_options_unchanged() {
    let above = (MAX_FILTER_ORDER + 1).to_string();
    for (name, text) in [
        ("cutoff_hz", "0"),
        ("cutoff_hz", "-1"),
        ("cutoff_hz", "inf"),
        ("cutoff_hz", "NaN"),
        ("cutoff_hz", "fast"),
        ("order", "0"),
        ("order", above.as_str()),
        ("order", "2.5"),
        ("trim", "1,"),
        ("trim", "-1"),
        ("decimate", "0"),
        ("between", "3,1"),
        ("between", "1,1"),
        ("between", "1"),
        ("between", "0,inf"),
        ("standstill", "1"),
        ("standstill", "-0.1"),
        ("smoothing", "savitzky_golay"),
        ("columns", "q="),
        ("columns", "q"),
    ] {
        let mut options = RecordingOptions::default();
        let refused = set_text(&mut options, name, text);
        assert!(
            refused.is_err_and(|says| says.starts_with("expected ")),
            "{name}={text}"
        );
        assert_eq!(options, RecordingOptions::default(), "{name}={text}");
    }
    let order = find_declaration::<RecordingOptions>("order").expect("declared");
    assert!(
        order.expected().contains(&format!("1 to {MAX_FILTER_ORDER};")),
        "{}",
        order.expected()
    );
}

#[test]
fn a_period_selects_a_series_and_no_other_method() {
    for (smoothing, expected) in [
        ("auto", SmoothingMethod::Fourier { period: Some(7.29) }),
        ("fourier", SmoothingMethod::Fourier { period: Some(7.29) }),
        ("butterworth", SmoothingMethod::Butterworth),
        ("savitzky-golay", SmoothingMethod::SavitzkyGolay),
    ] {
        let mut options = RecordingOptions::default();
        set_text(&mut options, "smoothing", smoothing).expect("valid");
        set_text(&mut options, "period", "7.29").expect("valid");
        assert_eq!(options.preparation.smoothing, expected, "{smoothing}");
    }
}

#[test]
fn refinements_exclude_each_other() {
    for pair in [["prior", "physical"], ["prior", "essential"], ["physical", "essential"]] {
        let found = find_excluded_pair::<EstimatorOptions>(&pair);
        assert!(
            found.is_some_and(|(one, other)| pair.contains(&one) && pair.contains(&other)),
            "{pair:?}"
        );
    }
    assert_eq!(
        find_excluded_pair::<EstimatorOptions>(&["robust", "physical", "weights"]),
        None
    );
    let robust = find_declaration::<EstimatorOptions>("robust").expect("declared");
    let OptionKind::Number {
        implied: Some(implied), ..
    } = robust.kind
    else {
        panic!("--robust has an implied value");
    };
    assert_eq!(implied.parse::<f64>(), Ok(HUBER_BOUND));
}

#[test]
fn columns_are_pairs_of_texts() {
    assert_eq!(parse_column(" q1 = a=b "), Ok(("q1".to_owned(), "a=b".to_owned())));
}

/// `UPDATE_OPTIONS=1` writes the file.
#[test]
fn keywords_of_python_are_those_of_the_declarations() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python/package/modelmill/_options.py");
    let expected = python_module();
    if std::env::var_os("UPDATE_OPTIONS").is_some() {
        fs::write(&path, &expected).expect("written");
    }
    let found = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == expected,
        "{} differs from the declarations; write it with UPDATE_OPTIONS=1 cargo test -p modelmill --test all options",
        path.display()
    );
}

/// The module of the Python package with the keywords of all lists.
fn python_module() -> String {
    let mut module = "\
\"\"\"Keywords of methods, with their defaults. Written from the declarations in modelmill/src/options; do not edit.

`UPDATE_OPTIONS=1 cargo test -p modelmill --test all options` writes this file.
\"\"\"

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, TypedDict, Union

PathText = Union[str, \"os.PathLike[str]\"]
"
    .to_owned();
    module.push_str(&python_list::<RecordingOptions>(
        "ReadingOptions",
        "READING",
        "How a recording is read and its states are prepared; keywords of every method that takes recordings.",
    ));
    module.push_str(&python_list::<EstimatorOptions>(
        "EstimationOptions",
        "ESTIMATION",
        "How parameters are estimated; keywords of `identify`.",
    ));
    module
}

/// The typed dictionary and the defaults of a list.
fn python_list<T: DeclaredOptions>(class: &str, defaults: &str, about: &str) -> String {
    let mut docs = String::new();
    let mut fields = String::new();
    let mut values = String::new();
    for one in T::declarations() {
        let keyword = PythonKeyword::new(one);
        let _ = writeln!(docs, "    {} : {}", one.name, keyword.described);
        for line in wrap_words(&keyword.help, LINE_LETTERS - 8) {
            let _ = writeln!(docs, "        {line}");
        }
        let _ = writeln!(fields, "    {}: {}", one.name, keyword.annotation);
        let _ = writeln!(values, "    \"{}\": {},", one.name, keyword.default);
    }
    format!(
        "\n\nclass {class}(TypedDict, total=False):\n    \"\"\"{about}\n\n    Attributes\n    ----------\n{docs}    \"\"\"\n\n\
         {fields}\n\n#: Defaults of :class:`{class}`.\n{defaults}: dict[str, Any] = {{\n{values}}}\n"
    )
}

/// An option as a keyword of Python.
struct PythonKeyword {
    /// Type in explanations.
    described: String,
    /// Type in annotations.
    annotation: String,
    /// Default value.
    default: String,
    /// Explanation.
    help: String,
}

impl PythonKeyword {
    fn new<T: DeclaredOptions>(one: &OptionDeclaration<T>) -> Self {
        let write_reference =
            |name: &str, value: Option<&str>| match (value, find_declaration::<T>(name).map(|one| &one.kind)) {
                (None, _) => name.to_owned(),
                (Some(value), Some(OptionKind::Columns { .. })) => {
                    let (ours, theirs) = parse_column(value).expect("a pair");
                    format!("{{\"{ours}\": \"{theirs}\"}}")
                }
                (Some(value), _) => format!("{name}=\"{value}\""),
            };
        let mut help = one.format_help(&write_reference);
        let optional = |described: &str, annotation: &str| {
            (described.to_owned(), format!("{annotation} | None"), "None".to_owned())
        };
        let (described, annotation, default) = match &one.kind {
            OptionKind::Switch { .. } => ("bool".to_owned(), "bool".to_owned(), "False".to_owned()),
            OptionKind::Number { .. } => optional("float", "float"),
            OptionKind::Integer {
                default: Some(default), ..
            } => ("int".to_owned(), "int".to_owned(), default.to_string()),
            OptionKind::Integer { default: None, .. } => optional("int", "int"),
            OptionKind::IntegerPair { .. } => optional("int or (int, int)", "int | tuple[int, int]"),
            OptionKind::Interval { .. } => optional("(float, float)", "tuple[float, float]"),
            OptionKind::Choice { values } => {
                let names: Vec<String> = values.iter().map(|value| format!("\"{}\"", value.name)).collect();
                let meanings = values
                    .iter()
                    .zip(&names)
                    .map(|(value, name)| format!("{name}: {}", value.format_help(&write_reference)));
                help = format!("{help}. {}", meanings.collect::<Vec<_>>().join(". "));
                (format!("{{{}}}", names.join(", ")), "str".to_owned(), names[0].clone())
            }
            OptionKind::Columns { .. } => {
                help.push_str(". Or the path of a file with the table `[recording.columns]`");
                (
                    "dict of str to str, or path".to_owned(),
                    "Mapping[str, str] | PathText".to_owned(),
                    "{}".to_owned(),
                )
            }
        };
        // A backtick is doubled in docstrings.
        let help = help.replace('`', "``") + ".";
        Self {
            described,
            annotation,
            default,
            help,
        }
    }
}
