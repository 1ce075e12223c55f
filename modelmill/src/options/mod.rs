//! Options of operations, each declared once: its names, its help, the values that it takes, and the field that it
//! sets. Front ends make their flags, keywords, checks of values, help and reference pages from the declarations.
//!
//! A type of options implements [`DeclaredOptions`]; its list of [`OptionDeclaration`]s stands in a file of its own.
//! A new option is one entry of such a list, and the code that uses the field.

mod estimation;
mod recording;

/// A type of options that front ends offer.
pub trait DeclaredOptions: Default + Clone + Send + Sync + 'static {
    /// The heading of these options in help and reference pages.
    const HEADING: &'static str;

    /// The options in the order in which they are shown, and in which values are set.
    fn declarations() -> &'static [OptionDeclaration<Self>];
}

/// One option.
#[derive(Debug)]
pub struct OptionDeclaration<T: 'static> {
    /// Its name in the library and in Python, in snake case.
    pub name: &'static str,
    /// Its name as a flag of the program, without hyphens in front.
    pub flag: &'static str,
    /// What stands for its value in help, such as `HZ`; empty for a switch.
    pub placeholder: &'static str,
    /// What it does. `{name}` refers to an option of the same list, `{name=value}` to an option with a value;
    /// [`OptionDeclaration::format_help`] replaces them.
    pub help: &'static str,
    /// Names of options that must not be given together with it.
    pub excludes: &'static [&'static str],
    /// The values that it takes, and the field that it sets.
    pub kind: OptionKind<T>,
}

/// The values of an option, with the function that sets one.
#[derive(Debug)]
pub enum OptionKind<T: 'static> {
    /// No value: the option is given or not.
    Switch {
        /// Sets the option.
        set: fn(&mut T),
    },
    /// A real number.
    Number {
        /// Sets a valid number.
        set: fn(&mut T, f64),
        /// Whether a number is valid.
        is_valid: fn(f64) -> bool,
        /// The sentence about an invalid value: "expected ...".
        expected: &'static str,
        /// The value of a flag without a value, for example `--robust`, and of `robust=True` in Python.
        implied: Option<&'static str>,
    },
    /// An integer.
    Integer {
        /// Sets a valid number.
        set: fn(&mut T, usize),
        /// Smallest and largest valid number.
        range: (usize, usize),
        /// The sentence about an invalid value.
        expected: &'static str,
        /// The value that has the same meaning as omitting the option, if there is one.
        default: Option<usize>,
    },
    /// Two integers; a single one stands for both.
    IntegerPair {
        /// Sets the numbers.
        set: fn(&mut T, (usize, usize)),
        /// The sentence about an invalid value.
        expected: &'static str,
    },
    /// Two finite numbers, the first below the second.
    Interval {
        /// Sets the numbers.
        set: fn(&mut T, (f64, f64)),
        /// The sentence about an invalid value.
        expected: &'static str,
    },
    /// One of several values; the first is the default.
    Choice {
        /// The values.
        values: &'static [ChoiceValue<T>],
    },
    /// Pairs of a name of the model and columns of a recording.
    Columns {
        /// Sets all pairs.
        set: fn(&mut T, Vec<(String, String)>),
    },
}

/// A value of [`OptionKind::Choice`].
#[derive(Debug)]
pub struct ChoiceValue<T: 'static> {
    /// Its name in the library and in Python, in snake case.
    pub name: &'static str,
    /// Its name as the value of a flag.
    pub flag: &'static str,
    /// What it means; references as in [`OptionDeclaration::help`].
    pub help: &'static str,
    /// Sets it.
    pub set: fn(&mut T),
}

/// A value as a front end reads it, before its range is checked.
#[derive(Clone, Debug, PartialEq)]
pub enum OptionValue {
    /// A switch that is on.
    On,
    /// A real number.
    Number(f64),
    /// An integer.
    Integer(usize),
    /// Two integers.
    IntegerPair(usize, usize),
    /// Two real numbers.
    Interval(f64, f64),
    /// The name of a choice, in snake case.
    Choice(String),
    /// Names of the model with columns of a recording.
    Columns(Vec<(String, String)>),
}

impl<T> OptionDeclaration<T> {
    /// Checks a value and sets the option. The error states what is expected.
    pub fn set(&self, options: &mut T, value: OptionValue) -> Result<(), String> {
        match (&self.kind, value) {
            (OptionKind::Switch { set }, OptionValue::On) => set(options),
            (OptionKind::Number { set, is_valid, .. }, OptionValue::Number(number)) if is_valid(number) => {
                set(options, number);
            }
            (OptionKind::Integer { set, range, .. }, OptionValue::Integer(number))
                if (range.0..=range.1).contains(&number) =>
            {
                set(options, number);
            }
            (OptionKind::IntegerPair { set, .. }, OptionValue::IntegerPair(first, second)) => {
                set(options, (first, second));
            }
            (OptionKind::Interval { set, .. }, OptionValue::Interval(from, to))
                if from < to && from.is_finite() && to.is_finite() =>
            {
                set(options, (from, to));
            }
            (OptionKind::Choice { values }, OptionValue::Choice(name)) => {
                let value = values.iter().find(|value| value.name == name);
                (value.ok_or_else(|| self.expected())?.set)(options);
            }
            (OptionKind::Columns { set }, OptionValue::Columns(pairs)) => set(options, pairs),
            _ => return Err(self.expected()),
        }
        Ok(())
    }

    /// The sentence about an invalid value: "expected ...".
    pub fn expected(&self) -> String {
        match &self.kind {
            OptionKind::Switch { .. } => "expected true or false".to_owned(),
            OptionKind::Number { expected, .. }
            | OptionKind::Integer { expected, .. }
            | OptionKind::IntegerPair { expected, .. }
            | OptionKind::Interval { expected, .. } => (*expected).to_owned(),
            OptionKind::Choice { values } => {
                let names: Vec<&str> = values.iter().map(|value| value.name).collect();
                format!("expected one of {}", names.join(", "))
            }
            OptionKind::Columns { .. } => "expected NAME=COLUMN, such as theta1=pos_left".to_owned(),
        }
    }

    /// Reads values as a command line has them: one text for each time that the option is given. Only columns may be
    /// given several times; a switch has no text.
    pub fn parse<'a>(&self, texts: impl IntoIterator<Item = &'a str>) -> Result<OptionValue, String> {
        if let OptionKind::Columns { .. } = self.kind {
            let pairs: Result<Vec<_>, String> = texts.into_iter().map(parse_column).collect();
            return pairs.map(OptionValue::Columns);
        }
        let Some(text) = texts.into_iter().last() else {
            return Ok(OptionValue::On);
        };
        let number = |text: &str| text.trim().parse::<f64>().ok();
        let integer = |text: &str| text.trim().parse::<usize>().ok();
        let value = match &self.kind {
            OptionKind::Switch { .. } | OptionKind::Columns { .. } => None,
            OptionKind::Number { .. } => number(text).map(OptionValue::Number),
            OptionKind::Integer { .. } => integer(text).map(OptionValue::Integer),
            OptionKind::IntegerPair { .. } => {
                let (first, second) = text.split_once(',').unwrap_or((text, text));
                let pair = integer(first).zip(integer(second));
                pair.map(|(first, second)| OptionValue::IntegerPair(first, second))
            }
            OptionKind::Interval { .. } => {
                let pair = text.split_once(',').and_then(|(from, to)| number(from).zip(number(to)));
                pair.map(|(from, to)| OptionValue::Interval(from, to))
            }
            OptionKind::Choice { values } => {
                let value = values.iter().find(|value| value.flag == text);
                value.map(|value| OptionValue::Choice(value.name.to_owned()))
            }
        };
        value.ok_or_else(|| self.expected())
    }

    /// The help text, in which `write_reference` writes each reference to another option. It gets the name of the option, and a
    /// value if one is recommended.
    pub fn format_help(&self, write_reference: &dyn Fn(&str, Option<&str>) -> String) -> String {
        replace_references(self.help, write_reference)
    }
}

impl<T> ChoiceValue<T> {
    /// The help text, as [`OptionDeclaration::format_help`] writes it.
    pub fn format_help(&self, write_reference: &dyn Fn(&str, Option<&str>) -> String) -> String {
        replace_references(self.help, write_reference)
    }
}

/// The option of a name in a list.
pub fn find_declaration<T: DeclaredOptions>(name: &str) -> Option<&'static OptionDeclaration<T>> {
    T::declarations().iter().find(|one| one.name == name)
}

/// The first two of the options given that exclude each other.
pub fn find_excluded_pair<T: DeclaredOptions>(given: &[&str]) -> Option<(&'static str, &'static str)> {
    let is_given = |name: &str| given.contains(&name);
    let all = T::declarations().iter().filter(|one| is_given(one.name));
    all.into_iter().find_map(|one| {
        let other = one.excludes.iter().find(|other| is_given(other));
        other.map(|other| (one.name, *other))
    })
}

/// The flag of a declared option of any list, without hyphens in front.
pub fn find_flag(name: &str) -> Option<&'static str> {
    use crate::identify::EstimatorOptions;
    use crate::recording::RecordingOptions;

    let reading = find_declaration::<RecordingOptions>(name).map(|one| one.flag);
    reading.or_else(|| find_declaration::<EstimatorOptions>(name).map(|one| one.flag))
}

/// A text with each `{name}` or `{name=value}` as `write_reference` writes it.
fn replace_references(text: &str, write_reference: &dyn Fn(&str, Option<&str>) -> String) -> String {
    let mut pieces = text.split('{');
    let mut written = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let (reference, rest) = piece.split_once('}').unwrap_or((piece, ""));
        let (name, value) = match reference.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (reference, None),
        };
        written.push_str(&write_reference(name, value));
        written.push_str(rest);
    }
    written
}

/// Reads `NAME=COLUMN`: a name of the model and an expression of columns.
pub fn parse_column(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((ours, theirs)) if !ours.trim().is_empty() && !theirs.trim().is_empty() => {
            Ok((ours.trim().to_owned(), theirs.trim().to_owned()))
        }
        _ => Err("expected NAME=COLUMN, such as theta1=pos_left".to_owned()),
    }
}

/// Whether a number is finite and above 0.
fn is_positive(number: f64) -> bool {
    number > 0.0 && number.is_finite()
}
