//! Options that the library declares, as flags: names, help, checks of values, completions.

use std::fmt::Write as _;

use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use modelmill::options::{DeclaredOptions, OptionDeclaration, OptionKind, find_declaration};

use crate::flags::quote_word;

/// The options of a type, as they were given.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DeclaredArgs<T> {
    /// The options of the library.
    pub(crate) options: T,
    /// Flags without hyphens that differ from their defaults, with the values as they were given.
    given: Vec<(&'static str, Vec<String>)>,
}

impl<T> DeclaredArgs<T> {
    /// The flags that differ from their defaults.
    pub(crate) fn given_flags(&self) -> impl Iterator<Item = String> {
        self.given.iter().map(|(flag, _)| format!("--{flag}"))
    }

    /// The options that differ from their defaults, as text for a command line, each with a space before it.
    pub(crate) fn to_flags(&self) -> String {
        let mut all = String::new();
        for (flag, values) in &self.given {
            if values.is_empty() {
                let _ = write!(all, " --{flag}");
            }
            for value in values {
                let _ = write!(all, " --{flag} {}", quote_word(value));
            }
        }
        all
    }
}

impl<T: DeclaredOptions> Args for DeclaredArgs<T> {
    fn augment_args(command: Command) -> Command {
        T::declarations()
            .iter()
            .fold(command, |command, one| command.arg(argument(one)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<T: DeclaredOptions> FromArgMatches for DeclaredArgs<T> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut args = Self {
            options: T::default(),
            given: Vec::new(),
        };
        args.update_from_arg_matches(matches)?;
        Ok(args)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for one in T::declarations() {
            let values: Vec<String> = match &one.kind {
                OptionKind::Switch { .. } if !matches.get_flag(one.name) => continue,
                OptionKind::Switch { .. } => Vec::new(),
                _ => match matches.get_many::<String>(one.name) {
                    Some(values) => values.cloned().collect(),
                    None => continue,
                },
            };
            // Values were checked as they were read.
            let value = one.parse(values.iter().map(String::as_str));
            let set = value.and_then(|value| one.set(&mut self.options, value));
            set.map_err(|message| clap::Error::raw(ErrorKind::ValueValidation, message))?;
            if !is_default(one, &values) {
                self.given.push((one.flag, values));
            }
        }
        Ok(())
    }
}

/// Whether these values are those of an option that is not given.
fn is_default<T>(one: &OptionDeclaration<T>, values: &[String]) -> bool {
    match (&one.kind, values) {
        (OptionKind::Choice { values: known }, [value]) => known.first().is_some_and(|first| first.flag == value),
        (
            OptionKind::Integer {
                default: Some(default), ..
            },
            [value],
        ) => *value == default.to_string(),
        _ => false,
    }
}

/// The argument of a declared option.
fn argument<T: DeclaredOptions>(one: &'static OptionDeclaration<T>) -> Arg {
    let write_reference = format_reference::<T>;
    let mut help = one.format_help(&write_reference);
    if let OptionKind::Columns { .. } = one.kind {
        help.push_str("; may be repeated");
    }
    let argument = Arg::new(one.name)
        .long(one.flag)
        .help(help)
        .help_heading(T::HEADING)
        .conflicts_with_all(one.excludes.iter().copied());
    if let OptionKind::Switch { .. } = one.kind {
        return argument.action(ArgAction::SetTrue);
    }
    let argument = argument.value_name(one.placeholder).value_parser(move |text: &str| {
        let value = one.parse([text])?;
        one.set(&mut T::default(), value)?;
        Ok::<String, String>(text.to_owned())
    });
    match &one.kind {
        OptionKind::Columns { .. } => argument.action(ArgAction::Append),
        OptionKind::Number {
            implied: Some(implied), ..
        } => argument
            .num_args(0..=1)
            .default_missing_value(*implied)
            .allow_negative_numbers(true),
        OptionKind::Switch { .. } | OptionKind::Number { .. } | OptionKind::Integer { .. } => {
            argument.allow_negative_numbers(true)
        }
        OptionKind::IntegerPair { .. } | OptionKind::Interval { .. } => argument.allow_hyphen_values(true),
        OptionKind::Choice { values } => {
            let possible = values
                .iter()
                .map(|value| PossibleValue::new(value.flag).help(value.format_help(&write_reference)));
            let default = values.first().map(|value| value.flag);
            argument
                .value_parser(PossibleValuesParser::new(possible))
                .default_value(default.unwrap_or_default())
        }
    }
}

/// A reference to another option of the list, as a flag with its value.
fn format_reference<T: DeclaredOptions>(name: &str, value: Option<&str>) -> String {
    let flag = find_declaration::<T>(name).map_or(name, |one| one.flag);
    match value {
        None => format!("--{flag}"),
        Some(value) if value.contains(' ') => format!("--{flag} \"{value}\""),
        Some(value) => format!("--{flag} {value}"),
    }
}
