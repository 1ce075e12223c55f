//! Limits of a verification: a file `verify.toml` goes in, limits by drive, parameter and effect come out.

use std::path::Path;

use toml::de::{DeTable, DeValue};

use crate::error::{Error, Outcome};
use crate::model::Model;

/// Largest file of limits, bytes.
const LARGEST_FILE: u64 = 1 << 20;

/// Limits of a verification that the user chooses. [`VerificationLimits::default`] has none. Default limits are used for
/// everything that has no limit here.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VerificationLimits {
    /// Limits of the errors of all drives that have no limit of their own.
    pub all_drives: DriveErrorLimit,
    /// Limits of the errors of single drives, by name.
    pub drives: Vec<(String, DriveErrorLimit)>,
    /// Limits of the position errors of all coordinates that have no limit of their own.
    pub all_positions: PositionErrorLimit,
    /// Limits of the position errors of single coordinates, by name.
    pub positions: Vec<(String, PositionErrorLimit)>,
    /// Intervals for estimates of base parameters, by name or expression.
    pub parameters: Vec<(String, [f64; 2])>,
    /// Probability above which a new effect is a failure.
    pub most_probability: Option<f64>,
    /// Effects that are known and accepted: a kind, or `kind@place`.
    pub accepted_effects: Vec<String>,
}

/// Limits of the error of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveErrorLimit {
    /// Largest accepted rms error, in % of the rms force of the drive.
    pub percent: Option<f64>,
    /// Largest accepted rms error, N or N m.
    pub rms: Option<f64>,
}

/// Limit of the position error of a coordinate when the model is simulated from recorded states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PositionErrorLimit {
    /// Largest accepted rms error, rad or m; `None` for no check.
    pub rms: Option<f64>,
    /// Time of each simulation, s; 1 s if none is given.
    pub horizon: Option<f64>,
}

impl DriveErrorLimit {
    /// Whether there is no limit.
    pub fn is_empty(self) -> bool {
        self.percent.is_none() && self.rms.is_none()
    }
}

impl VerificationLimits {
    /// Reads a file of limits.
    ///
    /// Fails when it cannot be read, and at entries that are unknown or have wrong values, with their line.
    pub fn read(model: &Model, path: &Path) -> Outcome<Self> {
        let text = (model.host().files().read_text(path, LARGEST_FILE)).map_err(|error| {
            let [fault, remedy] = [error.fault.to_string(), error.fault.remedy().to_string()];
            Error::options(format!("{} cannot be read: {fault}; {remedy}", path.display()))
        })?;
        Self::parse(model, &text, &path.display().to_string())
    }

    /// Reads the text of a file of limits; `file` is its name in messages.
    ///
    /// Fails at entries that are unknown or have wrong values, with their line.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::verify::VerificationLimits;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// let text = "[drives.joint1]\nerror_percent = 5.0\n";
    /// let limits = VerificationLimits::parse(&arm, text, "verify.toml")?;
    /// assert_eq!(limits.drives[0].1.percent, Some(5.0));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn parse(model: &Model, text: &str, file: &str) -> Outcome<Self> {
        let place = LimitsText { text, file };
        if let Some(excess) = modelmill_spec::find_toml_excess(text) {
            return Err(place.error(excess.at, &format!("{}: {}", excess.fault, excess.limit)));
        }
        let table = DeTable::parse(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            place.error(at, &format!("this is not valid TOML: {}", error.message()))
        })?;
        let mut limits = Self::default();
        let mut positions_at = 0;
        for (key, value) in table.get_ref() {
            let (name, at) = (key.get_ref().as_ref(), value.span().start);
            match name {
                "all_drives" => limits.all_drives = drive_limit(&place, value.get_ref(), at)?,
                "drives" => {
                    let table = NamedLimits {
                        key: "drives",
                        one: "drive",
                        names: model.row_names(),
                    };
                    limits.drives = place.named_limits(model, &table, value.get_ref(), at, drive_limit)?;
                }
                "all_positions" => limits.all_positions = position_limit(&place, value.get_ref(), at)?,
                "positions" => {
                    let names = model.active_coordinates();
                    let table = NamedLimits {
                        key: "positions",
                        one: "independent coordinate",
                        names,
                    };
                    limits.positions = place.named_limits(model, &table, value.get_ref(), at, position_limit)?;
                    positions_at = at;
                }
                "parameters" => limits.read_parameters(model, &place, value.get_ref(), at)?,
                "effects" => limits.read_effects(&place, value.get_ref(), at)?,
                other => {
                    let says = format!(
                        "unknown entry `{other}`; the tables are [all_drives], [drives.NAME], [all_positions], [positions.NAME], \
                         [parameters] and [effects]"
                    );
                    return Err(place.error(key.span().start, &says));
                }
            }
        }
        // A horizon without an error would check nothing.
        let without = limits
            .positions
            .iter()
            .find(|(name, _)| limits.position(name).rms.is_none());
        if let Some((name, _)) = without {
            return Err(place.error(positions_at, &format!("[positions.{name}] has no `error`, rad or m")));
        }
        if limits.all_positions.rms.is_none() && limits.all_positions.horizon.is_some() && limits.positions.is_empty() {
            return Err(place.error(0, "[all_positions] has no `error`, rad or m"));
        }
        Ok(limits)
    }

    /// The limits of a drive, each from the drive or else from all drives.
    pub fn drive(&self, name: &str) -> DriveErrorLimit {
        let own = self.drives.iter().find(|(drive, _)| drive == name);
        let own = own.map_or_else(DriveErrorLimit::default, |(_, limit)| *limit);
        if own.is_empty() { self.all_drives } else { own }
    }

    /// The limit of a coordinate: its own entries, and those of all positions for the others.
    pub fn position(&self, name: &str) -> PositionErrorLimit {
        let own = self.positions.iter().find(|(coordinate, _)| coordinate == name);
        let own = own.map_or_else(PositionErrorLimit::default, |(_, limit)| *limit);
        PositionErrorLimit {
            rms: own.rms.or(self.all_positions.rms),
            horizon: own.horizon.or(self.all_positions.horizon),
        }
    }

    /// The interval of a base parameter, by its name or expression.
    pub fn interval(&self, name: &str, expression: &str) -> Option<[f64; 2]> {
        let mut found = self.parameters.iter();
        found
            .find(|(key, _)| key == name || key == expression)
            .map(|(_, interval)| *interval)
    }

    /// Reads the table `parameters`.
    fn read_parameters(&mut self, model: &Model, place: &LimitsText<'_>, value: &DeValue<'_>, at: usize) -> Outcome {
        for (key, value) in place.table(value, at, "parameters")? {
            let name = key.get_ref().as_ref();
            let mut base = model.base.iter();
            if !base.any(|one| one.name == name || one.expression == name) {
                let known = model
                    .base
                    .iter()
                    .map(|one| format!("{} = {}", one.name, one.expression));
                let says = format!(
                    "{} has no base parameter `{name}`, and recordings determine no others; its base parameters are {}",
                    model.path,
                    known.collect::<Vec<_>>().join(", ")
                );
                return Err(place.error(key.span().start, &says));
            }
            let numbers: Option<Vec<f64>> = match value.get_ref() {
                DeValue::Array(all) => all.iter().map(|one| number(one.get_ref())).collect(),
                _ => None,
            };
            match numbers.as_deref() {
                Some([low, high]) if low <= high => self.parameters.push((name.to_owned(), [*low, *high])),
                _ => {
                    let says = format!("`{name}` needs an interval: two numbers, the lower first, such as [1.2, 1.4]");
                    return Err(place.error(value.span().start, &says));
                }
            }
        }
        Ok(())
    }

    /// Reads the table `effects`.
    fn read_effects(&mut self, place: &LimitsText<'_>, value: &DeValue<'_>, at: usize) -> Outcome {
        for (key, value) in place.table(value, at, "effects")? {
            let (name, at) = (key.get_ref().as_ref(), value.span().start);
            match (name, value.get_ref()) {
                ("most_probability", value) => match number(value) {
                    Some(p) if (0.0..=1.0).contains(&p) => self.most_probability = Some(p),
                    _ => return Err(place.error(at, "`most_probability` is a number from 0 to 1, such as 0.5")),
                },
                ("accepted", DeValue::Array(all)) => {
                    for one in all {
                        let DeValue::String(text) = one.get_ref() else {
                            return Err(place.error(one.span().start, ACCEPTED));
                        };
                        self.accepted_effects.push(text.to_string());
                    }
                }
                ("accepted", _) => return Err(place.error(at, ACCEPTED)),
                (other, _) => {
                    let says = format!("unknown entry `{other}` in [effects]; use `most_probability` or `accepted`");
                    return Err(place.error(key.span().start, &says));
                }
            }
        }
        Ok(())
    }
}

/// What the list of accepted effects expects.
const ACCEPTED: &str = "`accepted` is a list of effects, such as [\"coulomb_friction@joint1\", \"payload\"]";

/// Reads the limits of a drive.
fn drive_limit(place: &LimitsText<'_>, value: &DeValue<'_>, at: usize) -> Outcome<DriveErrorLimit> {
    let mut limit = DriveErrorLimit::default();
    for (key, value) in place.table(value, at, "limits of a drive")? {
        let slot = match key.get_ref().as_ref() {
            "error_percent" => &mut limit.percent,
            "error" => &mut limit.rms,
            other => {
                let says = format!(
                    "there is no limit `{other}` of a drive; use `error_percent` (rms error in % of the rms force) or `error` \
                     (rms error in N or N m)"
                );
                return Err(place.error(key.span().start, &says));
            }
        };
        *slot = Some(positive_number(
            place,
            key.get_ref(),
            value.get_ref(),
            value.span().start,
        )?);
    }
    Ok(limit)
}

/// Reads the limit of a position.
fn position_limit(place: &LimitsText<'_>, value: &DeValue<'_>, at: usize) -> Outcome<PositionErrorLimit> {
    let mut limit = PositionErrorLimit::default();
    for (key, value) in place.table(value, at, "limit of a position")? {
        let slot = match key.get_ref().as_ref() {
            "error" => &mut limit.rms,
            "horizon" => &mut limit.horizon,
            other => {
                let says = format!(
                    "there is no limit `{other}` of a position; use `error` (rms error in rad or m) and `horizon` (time of each \
                     simulation in s)"
                );
                return Err(place.error(key.span().start, &says));
            }
        };
        *slot = Some(positive_number(
            place,
            key.get_ref(),
            value.get_ref(),
            value.span().start,
        )?);
    }
    Ok(limit)
}

/// A number above zero.
fn positive_number(place: &LimitsText<'_>, name: &str, value: &DeValue<'_>, at: usize) -> Outcome<f64> {
    let found = number(value).filter(|number| *number > 0.0 && number.is_finite());
    found.ok_or_else(|| place.error(at, &format!("`{name}` is a number above 0, such as 5.0")))
}

/// A number of the file.
fn number(value: &DeValue<'_>) -> Option<f64> {
    let text = match value {
        DeValue::Integer(number) if number.radix() == 10 => number.as_str(),
        DeValue::Float(number) => number.as_str(),
        _ => return None,
    };
    text.parse().ok().filter(|number: &f64| !number.is_nan())
}

/// The text of a file of limits, for messages with lines.
struct LimitsText<'a> {
    text: &'a str,
    file: &'a str,
}

/// A table of limits by the names of a model.
struct NamedLimits {
    /// Its key.
    key: &'static str,
    /// What has a name, in messages.
    one: &'static str,
    /// The names of the model.
    names: Vec<String>,
}

impl LimitsText<'_> {
    /// The limits of a table by name, each read by `read`.
    ///
    /// Fails at names that the model does not have.
    fn named_limits<T>(
        &self,
        model: &Model,
        table: &NamedLimits,
        value: &DeValue<'_>,
        at: usize,
        read: impl Fn(&Self, &DeValue<'_>, usize) -> Outcome<T>,
    ) -> Outcome<Vec<(String, T)>> {
        let NamedLimits {
            key: table_key,
            one,
            names,
        } = table;
        let mut limits = Vec::new();
        for (key, value) in self.table(value, at, table_key)? {
            let name = key.get_ref().as_ref();
            if !names.iter().any(|other| other == name) {
                let says = format!(
                    "{} has no {one} `{name}`; its {one}s are {}",
                    model.path,
                    names.join(", ")
                );
                return Err(self.error(key.span().start, &says));
            }
            limits.push((name.to_owned(), read(self, value.get_ref(), value.span().start)?));
        }
        Ok(limits)
    }

    /// An error at a byte of the text.
    fn error(&self, at: usize, says: &str) -> Error {
        let before = self.text.get(..at).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        Error::options(format!("{}, line {line}: {says}", self.file))
    }

    /// The entries of a value that must be a table.
    fn table<'t, 'i>(&self, value: &'t DeValue<'i>, at: usize, what: &str) -> Outcome<&'t DeTable<'i>> {
        match value {
            DeValue::Table(table) => Ok(table),
            _ => Err(self.error(
                at,
                &format!("`{what}` must be a table: write [{what}] and its entries below"),
            )),
        }
    }
}
