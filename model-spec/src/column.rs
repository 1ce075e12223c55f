//! Columns of recordings as a model file or a command line describes them.
//!
//! A text such as `"q_meas_m"`, `"qm5/45"`, `"(qm6 - qm5)/32 - pi/2"` or `"pos1 [deg]"` and the column names of a
//! recording go in. An affine sum of its columns in SI units comes out.
//!
//! A text that equals the name of a column is that column, even if it could also be an expression. A unit in the name of
//! a column, as in `pos [deg]`, is the unit of its numbers, and the name may be written without it.
//!
//! Decision: this crate reads the sum and resolves it against each file, so that `modelmill-identify` gets numbers
//! only.

use std::fmt;

use num_traits::ToPrimitive;

use crate::actuators::{ModelActuator, SignalQuantity};
use crate::column_unit::{split_header_unit, unit_factor};
use crate::diagnostic::{DiagnosticLog, SourceSpan};
use crate::exact::ExactFunction;
use crate::formula::{FormulaAst, FormulaAstKind};
use crate::joint_motion::CoordinateMotion;
use crate::kinds::PlaceLoad;
use crate::mechanism::Mechanism;
use crate::parser::parse;
use crate::suggest;

/// The quantity in a column of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnQuantity {
    /// Time, s.
    Time,
    /// An angle or its first or second derivative, rad, rad/s, rad/s^2.
    Angle(u8),
    /// A length or its first or second derivative, m, m/s, m/s^2.
    Length(u8),
    /// A number without a unit.
    Number,
    /// A force, N.
    Force,
    /// A torque, N m.
    Torque,
    /// The variance of a force, N^2.
    ForceVariance,
    /// The variance of a torque, (N m)^2.
    TorqueVariance,
    /// A current, A.
    Current,
    /// A voltage, V.
    Voltage,
    /// A pressure, Pa.
    Pressure,
}

/// `offset + sum of factor * column`, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnSum {
    /// Columns of the recording with their factors, none of which is zero; in the order of the text.
    pub terms: Vec<(String, f64)>,
    /// The constant term, in SI units.
    pub offset: f64,
}

/// Why a text does not describe a column of a recording.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ColumnFault {
    /// It names a column that the recording does not have.
    Missing {
        /// The name.
        column: String,
        /// The closest name that the recording has.
        nearest: Option<String>,
    },
    /// It cannot be parsed, or is not an affine sum of columns.
    Malformed {
        /// What is wrong, as a clause.
        says: String,
    },
}

impl fmt::Display for ColumnFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { column, nearest } => {
                write!(f, "the recording has no column `{column}`")?;
                match nearest {
                    Some(nearest) => write!(f, "; did you mean `{nearest}`?"),
                    None => Ok(()),
                }
            }
            Self::Malformed { says } => f.write_str(says),
        }
    }
}

impl std::error::Error for ColumnFault {}

/// One degree in radians.
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// One turn in radians.
const TURN: f64 = std::f64::consts::TAU;

/// Units of columns with their factors to SI; the SI unit comes first.
pub(crate) fn units(quantity: ColumnQuantity) -> &'static [(&'static str, f64)] {
    match quantity {
        ColumnQuantity::Time => &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0)],
        ColumnQuantity::Number => &[("1", 1.0), ("%", 1e-2)],
        ColumnQuantity::Current => &[("A", 1.0), ("mA", 1e-3)],
        ColumnQuantity::Voltage => &[("V", 1.0), ("mV", 1e-3)],
        ColumnQuantity::Pressure => &[
            ("Pa", 1.0),
            ("bar", 1e5),
            ("mbar", 1e2),
            ("kPa", 1e3),
            ("MPa", 1e6),
            ("psi", 6_894.757_293_168),
        ],
        ColumnQuantity::Angle(0) => &[("rad", 1.0), ("deg", DEGREE), ("mrad", 1e-3), ("rev", TURN)],
        ColumnQuantity::Angle(1) => &[("rad/s", 1.0), ("deg/s", DEGREE), ("rpm", TURN / 60.0), ("rev/s", TURN)],
        ColumnQuantity::Angle(_) => &[("rad/s^2", 1.0), ("deg/s^2", DEGREE), ("rev/s^2", TURN)],
        ColumnQuantity::Length(0) => &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6)],
        ColumnQuantity::Length(1) => &[("m/s", 1.0), ("mm/s", 1e-3), ("cm/s", 1e-2), ("mm/min", 1e-3 / 60.0)],
        ColumnQuantity::Length(_) => &[("m/s^2", 1.0), ("mm/s^2", 1e-3), ("cm/s^2", 1e-2)],
        ColumnQuantity::Force => &[("N", 1.0), ("kN", 1e3), ("mN", 1e-3)],
        ColumnQuantity::Torque => &[
            ("N m", 1.0),
            ("Nm", 1.0),
            ("N mm", 1e-3),
            ("Nmm", 1e-3),
            ("N cm", 1e-2),
            ("Ncm", 1e-2),
            ("mN m", 1e-3),
            ("mNm", 1e-3),
            ("kN m", 1e3),
            ("kNm", 1e3),
        ],
        ColumnQuantity::ForceVariance => &[("N^2", 1.0), ("kN^2", 1e6), ("mN^2", 1e-6)],
        ColumnQuantity::TorqueVariance => &[("N^2 m^2", 1.0), ("(N m)^2", 1.0), ("Nm^2", 1.0)],
    }
}

impl Mechanism {
    /// The names that columns of recordings have in this model, with their quantities: `t`, every active coordinate
    /// with its two derivatives (`_d`, `_dd`), every drive with the variance of its force (`_var`), and the signal of
    /// every actuator.
    pub fn columns(&self) -> Vec<(String, ColumnQuantity)> {
        let mut columns = vec![("t".to_owned(), ColumnQuantity::Time)];
        for coordinate in self.coordinates.iter().filter(|c| !c.passive) {
            let signal = self
                .actuators
                .iter()
                .find(|actuator| actuator.signal == coordinate.name);
            for (order, suffix) in (0..).zip(["", "_d", "_dd"]) {
                // In the equations of servos, signals are coordinates.
                if let (0, Some(signal)) = (order, signal) {
                    columns.push((signal.signal.clone(), self.signal_column(signal)));
                    continue;
                }
                let quantity = match coordinate.motion {
                    CoordinateMotion::Revolute => ColumnQuantity::Angle(order),
                    CoordinateMotion::Prismatic => ColumnQuantity::Length(order),
                    // Rates of the vector part are angular velocities; the scalar part has none.
                    CoordinateMotion::Quaternion if order > 0 => ColumnQuantity::Angle(order),
                    CoordinateMotion::QuaternionScalar if order > 0 => continue,
                    CoordinateMotion::Quaternion | CoordinateMotion::QuaternionScalar => ColumnQuantity::Number,
                };
                columns.push((format!("{}{suffix}", coordinate.name), quantity));
            }
        }
        for drive in self.drives.iter().chain(&self.shared_drives) {
            let (force, variance) = match drive.kind.place_load(&self.coordinates) {
                PlaceLoad::Torque => (ColumnQuantity::Torque, ColumnQuantity::TorqueVariance),
                _ => (ColumnQuantity::Force, ColumnQuantity::ForceVariance),
            };
            columns.push((drive.name.clone(), force));
            columns.push((format!("{}_var", drive.name), variance));
        }
        for actuator in self.actuators.iter().filter(|_| self.servo_forces.is_empty()) {
            columns.push((actuator.signal.clone(), self.signal_column(actuator)));
        }
        columns
    }

    /// The quantity in the column of the signal of an actuator.
    fn signal_column(&self, actuator: &ModelActuator) -> ColumnQuantity {
        let load = self.drives[actuator.drive.0].kind.place_load(&self.coordinates);
        match (actuator.quantity, load) {
            (SignalQuantity::Position, PlaceLoad::Torque) => ColumnQuantity::Angle(0),
            (SignalQuantity::Position, _) => ColumnQuantity::Length(0),
            (SignalQuantity::Rate, PlaceLoad::Torque) => ColumnQuantity::Angle(1),
            (SignalQuantity::Rate, _) => ColumnQuantity::Length(1),
            (SignalQuantity::Current, _) => ColumnQuantity::Current,
            (SignalQuantity::Voltage, _) => ColumnQuantity::Voltage,
            (SignalQuantity::Share, _) => ColumnQuantity::Number,
            (SignalQuantity::Pressure, _) => ColumnQuantity::Pressure,
        }
    }
}

/// Reads the description of a column with the quantity `quantity`, for a recording whose columns are called `names`.
///
/// The text is the name of a column or an expression. An expression is affine in names of columns and may contain
/// numbers and constants of the model, whose values `constants` gives. A unit in brackets at its end, such as
/// `[deg]`, states the unit of the column if it is not the SI unit.
/// Fails when it names a column that does not exist, is not affine, or has a unit that does not fit the quantity.
///
/// ```
/// use modelmill_spec::{ColumnQuantity, read_column};
/// let names = ["time_s".to_owned(), "qm5".to_owned(), "qm6".to_owned()];
/// let sum = read_column("(qm6 - qm5)/32 [deg]", ColumnQuantity::Angle(0), &names, &|_| None)?;
/// assert_eq!(sum.terms[1].0, "qm5");
/// assert!((sum.terms[1].1 + std::f64::consts::PI / 180.0 / 32.0).abs() < 1e-18);
/// # Ok::<(), modelmill_spec::ColumnFault>(())
/// ```
pub fn read_column(
    text: &str,
    quantity: ColumnQuantity,
    names: &[String],
    constants: &dyn Fn(&str) -> Option<f64>,
) -> Result<ColumnSum, ColumnFault> {
    let text = text.trim();
    let single = |name: &str, factor: f64| ColumnSum {
        terms: vec![(name.to_owned(), factor)],
        offset: 0.0,
    };
    let has = |name: &str| names.iter().any(|other| other == name);
    // The factor of the unit in the name of a column; a unit of another quantity leaves the numbers as they are.
    let header_factor = |name: &str| {
        let unit = split_header_unit(name).map(|(_, unit)| unit);
        unit.and_then(|unit| unit_factor(unit, quantity)).unwrap_or(1.0)
    };
    // The complete text comes first: a column may be called `pos [deg]`.
    if has(text) {
        return Ok(single(text, header_factor(text)));
    }
    let (body, unit) = split_unit(text);
    let stated = match unit {
        Some(unit) => Some(factor_of(unit, quantity)?),
        None => None,
    };
    if has(body) {
        return Ok(single(body, stated.unwrap_or(1.0)));
    }
    // Names without the unit behind them, where that is not ambiguous.
    let bases = names_without_units(names);
    let full_name = |name: &str| {
        bases
            .iter()
            .find(|(base, _)| base == name)
            .map(|(_, full)| full.as_str())
    };
    if let Some(full) = full_name(body) {
        return Ok(single(full, stated.unwrap_or_else(|| header_factor(full))));
    }
    let missing = |column: &str| ColumnFault::Missing {
        column: column.to_owned(),
        nearest: suggest::nearest(column, names.iter().map(String::as_str)).map(str::to_owned),
    };
    // Names with dots cannot be parsed; they are replaced by names that can.
    let known: Vec<String> = names
        .iter()
        .cloned()
        .chain(bases.iter().map(|(base, _)| base.clone()))
        .collect();
    let (plain, stand_ins) = with_plain_names(body, &known);
    let span = SourceSpan {
        file: 0,
        start: 0,
        end: plain.len(),
    };
    let mut log = DiagnosticLog::default();
    let Some(ast) = parse(&plain, span, None, &mut log) else {
        // A text without operators is reported as a missing column, because names may contain blanks.
        if !body.contains(['+', '*', '/', '^', '(']) {
            return Err(missing(body));
        }
        let faults = log.finish();
        let fault = faults.first();
        return Err(ColumnFault::Malformed {
            says: format!(
                "`{body}` is neither the name of a column nor an expression: {}",
                fault.map_or("it cannot be read", |fault| fault.message.as_str())
            ),
        });
    };
    // Names of columns take precedence over constants of the model.
    let sum = affine_value(&ast, &|name| {
        let stands_for = stand_ins.iter().find(|(stand_in, _)| stand_in == name);
        let name = stands_for.map_or(name, |(_, column)| *column);
        if has(name) {
            Some(AffineValue::column(name))
        } else if let Some(full) = full_name(name) {
            Some(AffineValue::column(full))
        } else {
            constants(name).map(AffineValue::number)
        }
    })
    .map_err(|fault| match fault {
        AffineFault::Name(name) => missing(&name),
        AffineFault::Says(says) => ColumnFault::Malformed {
            says: format!("in `{body}` {says}"),
        },
    })?;
    if sum.terms.is_empty() {
        return Err(ColumnFault::Malformed {
            says: format!("`{body}` contains no column of the recording"),
        });
    }
    sum_in_si(sum, body, &|name| stated.unwrap_or_else(|| header_factor(name)))
}

/// A sum in SI units; `factor` converts a column of it. Units in the names hold for the number in the sum, too.
fn sum_in_si(sum: AffineValue, body: &str, factor: &dyn Fn(&str) -> f64) -> Result<ColumnSum, ColumnFault> {
    let factors: Vec<f64> = sum.terms.iter().map(|(name, _)| factor(name)).collect();
    if sum.offset != 0.0 && factors.windows(2).any(|pair| pair[0].total_cmp(&pair[1]).is_ne()) {
        return Err(ColumnFault::Malformed {
            says: format!(
                "the columns in `{body}` have different units, so the unit of the number in it is not clear; state the unit of \
                 the sum behind it, such as `[deg]`"
            ),
        });
    }
    Ok(ColumnSum {
        offset: factors[0] * sum.offset,
        terms: (sum.terms.into_iter().zip(factors))
            .map(|((name, value), factor)| (name, factor * value))
            .collect(),
    })
}

/// Names without the unit behind them, each with its full name; only those that belong to one column.
fn names_without_units(names: &[String]) -> Vec<(String, String)> {
    let split = |name: &String| split_header_unit(name).map(|(base, _)| base.to_owned());
    let bases: Vec<Option<String>> = names.iter().map(split).collect();
    let is_unique = |base: &String| {
        let same = bases.iter().filter(|other| other.as_ref() == Some(base)).count();
        same == 1 && !names.contains(base)
    };
    let pairs = bases.iter().zip(names);
    let pairs = pairs.filter_map(|(base, full)| Some((base.clone()?, full.clone())));
    pairs.filter(|(base, _)| is_unique(base)).collect()
}

/// Replaces names of columns with dots, such as `joint_states.position.elbow`, which no expression can contain.
/// Returns the text, and each replacement with the column it stands for.
fn with_plain_names<'a>(text: &str, names: &'a [String]) -> (String, Vec<(String, &'a str)>) {
    let mut others: Vec<&String> = names
        .iter()
        .filter(|name| name.contains('.') && text.contains(name.as_str()))
        .collect();
    // Longer names come first because one name may be the beginning of another.
    others.sort_by_key(|name| std::cmp::Reverse(name.len()));
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    let mut plain = text.to_owned();
    let mut stand_ins = Vec::new();
    for name in others {
        // The replacement must not occur in the text or among the columns.
        let mut stand_in = format!("column_{}", stand_ins.len());
        while text.contains(&stand_in) || names.contains(&stand_in) {
            stand_in.push('_');
        }
        let mut done = String::new();
        let mut rest = plain.as_str();
        while let Some(at) = rest.find(name.as_str()) {
            // A match inside of a longer name is left unchanged.
            let end = at + name.len();
            let is_within = rest[end..].starts_with(is_part)
                || rest[..at].ends_with(is_part)
                || (at == 0 && done.ends_with(is_part));
            done.push_str(&rest[..at]);
            done.push_str(if is_within { name } else { &stand_in });
            rest = &rest[end..];
        }
        done.push_str(rest);
        plain = done;
        stand_ins.push((stand_in, name.as_str()));
    }
    (plain, stand_ins)
}

/// Why a text can describe no column of any recording; `None` if it may describe one.
pub(crate) fn fault_without_recording(text: &str) -> Option<String> {
    let (body, _) = split_unit(text.trim());
    let span = SourceSpan {
        file: 0,
        start: 0,
        end: text.len(),
    };
    let ast = parse(body, span, None, &mut DiagnosticLog::default())?;
    match affine_value(&ast, &|name| Some(AffineValue::column(name))) {
        Err(AffineFault::Says(says)) => Some(says),
        _ => None,
    }
}

/// Splits a unit in brackets off the end: the text before it, and the unit.
fn split_unit(text: &str) -> (&str, Option<&str>) {
    let split = text.strip_suffix(']').and_then(|rest| rest.rsplit_once('['));
    match split {
        Some((body, unit)) if !body.trim().is_empty() => (body.trim(), Some(unit.trim())),
        _ => (text, None),
    }
}

/// The factor from a unit to SI; fails with the list of units that fit the quantity.
fn factor_of(unit: &str, quantity: ColumnQuantity) -> Result<f64, ColumnFault> {
    let units = units(quantity);
    unit_factor(unit, quantity).ok_or_else(|| ColumnFault::Malformed {
        says: format!(
            "the unit `{unit}` does not fit this quantity; expected one of {}",
            units
                .iter()
                .map(|(name, _)| format!("`{name}`"))
                .collect::<Vec<_>>()
                .join(", ")
        ),
    })
}

/// An affine value during evaluation.
#[derive(Clone, Debug, Default)]
struct AffineValue {
    /// Columns with their factors; none is zero after an addition.
    terms: Vec<(String, f64)>,
    /// The constant term.
    offset: f64,
}

/// Why an expression is not affine.
enum AffineFault {
    /// It uses a name that is neither a column nor a constant.
    Name(String),
    /// Any other reason, as a clause for a message.
    Says(String),
}

impl AffineValue {
    /// A value without columns.
    fn number(offset: f64) -> Self {
        Self {
            terms: Vec::new(),
            offset,
        }
    }

    /// A column with factor one.
    fn column(name: &str) -> Self {
        Self {
            terms: vec![(name.to_owned(), 1.0)],
            offset: 0.0,
        }
    }

    /// The sum; terms of the same column are added, and terms that cancel are dropped.
    fn add(mut self, other: Self) -> Self {
        for (name, factor) in other.terms {
            match self.terms.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += factor,
                None => self.terms.push((name, factor)),
            }
        }
        self.terms.retain(|(_, factor)| *factor != 0.0);
        self.offset += other.offset;
        self
    }

    /// Applies a linear function to all factors and to the constant term.
    fn map(mut self, f: impl Fn(f64) -> f64) -> Self {
        for (_, factor) in &mut self.terms {
            *factor = f(*factor);
        }
        self.offset = f(self.offset);
        self
    }
}

/// Evaluates an expression; `look_up` gives the value of each name.
fn affine_value(ast: &FormulaAst, look_up: &dyn Fn(&str) -> Option<AffineValue>) -> Result<AffineValue, AffineFault> {
    let of = |ast: &FormulaAst| affine_value(ast, look_up);
    // Divisors, bases of powers and operands of functions must be free of columns.
    let number = |ast: &FormulaAst, what: &str| {
        let value = affine_value(ast, look_up)?;
        if value.terms.is_empty() {
            return Ok(value.offset);
        }
        Err(AffineFault::Says(format!(
            "a column stands {what}; expected a sum of columns, each times a number, and numbers"
        )))
    };
    let value = match &ast.kind {
        FormulaAstKind::Rational(value) => AffineValue::number(value.to_f64().unwrap_or(f64::NAN)),
        FormulaAstKind::Pi => AffineValue::number(std::f64::consts::PI),
        FormulaAstKind::Name(name) => look_up(name).ok_or_else(|| AffineFault::Name(name.clone()))?,
        FormulaAstKind::Sum(terms) => {
            let mut sum = AffineValue::default();
            for term in terms {
                sum = sum.add(of(term)?);
            }
            sum
        }
        FormulaAstKind::Negative(inner) => of(inner)?.map(|value| -value),
        FormulaAstKind::Product(factors) => {
            let mut product = AffineValue::number(1.0);
            for factor in factors {
                let factor = of(factor)?;
                product = if factor.terms.is_empty() {
                    product.map(|value| value * factor.offset)
                } else if product.terms.is_empty() {
                    factor.map(|value| value * product.offset)
                } else {
                    return Err(AffineFault::Says(
                        "columns are multiplied with each other; expected a sum of columns, each times a number"
                            .to_owned(),
                    ));
                };
            }
            product
        }
        FormulaAstKind::Quotient(above, below) => {
            let below = number(below, "below a fraction line")?;
            of(above)?.map(|value| value / below)
        }
        FormulaAstKind::Power(base, 1) => of(base)?,
        FormulaAstKind::Power(base, exponent) => AffineValue::number(number(base, "in a power")?.powi(*exponent)),
        FormulaAstKind::Apply(function, inner) => {
            AffineValue::number(apply_function(*function, number(inner, "in a function")?))
        }
    };
    if value.offset.is_finite() && value.terms.iter().all(|(_, factor)| factor.is_finite()) {
        Ok(value)
    } else {
        Err(AffineFault::Says(
            "a number is not finite; is something divided by zero?".to_owned(),
        ))
    }
}

/// Value of a function in floating point; the sign of zero is zero.
fn apply_function(function: ExactFunction, x: f64) -> f64 {
    match function {
        ExactFunction::Sin => x.sin(),
        ExactFunction::Cos => x.cos(),
        ExactFunction::Sqrt => x.sqrt(),
        ExactFunction::Abs => x.abs(),
        ExactFunction::Sign if x == 0.0 => 0.0,
        ExactFunction::Sign => x.signum(),
        ExactFunction::Tanh => x.tanh(),
        ExactFunction::Exp => x.exp(),
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn read(text: &str) -> Result<ColumnSum, ColumnFault> {
        let names = ["t_s", "qm5", "qm6", "pos 1 [deg]", "pos"].map(str::to_owned);
        read_column(text, ColumnQuantity::Angle(0), &names, &|name| {
            (name == "N5").then_some(45.0)
        })
    }

    #[track_caller]
    fn check(text: &str, terms: &[(&str, f64)], offset: f64) {
        let sum = read(text).unwrap_or_else(|fault| panic!("{text}: {fault}"));
        assert_eq!(sum.terms.len(), terms.len(), "{text}");
        for ((name, factor), (expected, value)) in sum.terms.iter().zip(terms) {
            assert_eq!(name, expected);
            assert!((factor - value).abs() < 1e-16, "{text}: {factor}");
        }
        assert!((sum.offset - offset).abs() < 1e-15, "{text}");
    }

    #[test]
    fn sums_of_columns_are_read() {
        check("qm5", &[("qm5", 1.0)], 0.0);
        check("qm5/45", &[("qm5", 1.0 / 45.0)], 0.0);
        check("qm5/N5", &[("qm5", 1.0 / 45.0)], 0.0);
        check(
            "(qm6 - qm5)/32 - pi/2",
            &[("qm6", 1.0 / 32.0), ("qm5", -1.0 / 32.0)],
            -PI / 2.0,
        );
        check("2*(qm5 + 1) - qm5", &[("qm5", 1.0)], 2.0);
        check("pos [deg]", &[("pos", PI / 180.0)], 0.0);
        check("pos - 90 [deg]", &[("pos", PI / 180.0)], -PI / 2.0);
        // The very name of a column is that column in the unit of its name, and a unit may follow it.
        check("pos 1 [deg]", &[("pos 1 [deg]", PI / 180.0)], 0.0);
        check("pos 1 [deg] [deg]", &[("pos 1 [deg]", PI / 180.0)], 0.0);
    }

    /// A unit in the header converts the numbers, whatever form of the name is written.
    #[test]
    fn units_in_names_of_columns_convert() {
        let names = ["q1 [deg]", "q2 (°)", "arm.q3 [rad]", "i4 [A]", "q5 [deg]", "q5 [rad]"].map(str::to_owned);
        let read = |text: &str| read_column(text, ColumnQuantity::Angle(0), &names, &|_| None);
        let factor = |text: &str| read(text).unwrap().terms[0].1;
        let degree = PI / 180.0;
        for text in ["q1", "q1 [deg]", "q2", "q2 (°)", "q2 [deg]"] {
            assert!((factor(text) - degree).abs() < 1e-16, "{text}");
        }
        assert!((factor("q1 [rad]") - 1.0).abs() < 1e-16, "a stated unit has priority");
        assert!((factor("2*arm.q3") - 2.0).abs() < 1e-16);
        assert!((factor("i4") - 1.0).abs() < 1e-16, "another quantity is not converted");
        let sum = read("(q1 - q2)/2 - 90").unwrap();
        assert!((sum.terms[1].1 + degree / 2.0).abs() < 1e-16 && (sum.offset + PI / 2.0).abs() < 1e-15);
        // Without a number each column has its own unit, with one the unit is not clear.
        let mixed = read("q1 + arm.q3").unwrap();
        assert!((mixed.terms[0].1 - degree).abs() < 1e-16 && (mixed.terms[1].1 - 1.0).abs() < 1e-16);
        assert!(
            read("q1 + arm.q3 - 1")
                .unwrap_err()
                .to_string()
                .contains("different units")
        );
        // Two columns of one name are not guessed.
        assert!(read("q5").is_err());
    }

    #[test]
    fn what_cannot_be_read_says_why() {
        let says = |text: &str| read(text).unwrap_err().to_string();
        assert_eq!(says("qm7/45"), "the recording has no column `qm7`; did you mean `qm5`?");
        assert_eq!(says("gear box"), "the recording has no column `gear box`");
        assert!(says("qm5*qm6").contains("multiplied with each other"));
        assert!(says("1/qm5").contains("below a fraction line"));
        assert!(says("sin(qm5)").contains("in a function"));
        assert!(says("qm5^2").contains("in a power"));
        assert!(says("qm5/0").contains("zero") || says("qm5/0").contains("finite"));
        assert!(says("qm5 - qm5 + 1").contains("no column"));
        assert!(says("qm5 +").contains("neither the name of a column nor an expression"));
        assert!(says("qm5 [mm]").contains("`mm` does not fit this quantity; expected one of `rad`, `deg`"));
    }

    #[test]
    fn columns_of_logs_stand_in_sums() {
        let names = ["joints.position.q", "joints.position.q2", "lab/split.effort.arm/wrist"].map(str::to_owned);
        let read = |text: &str| read_column(text, ColumnQuantity::Angle(0), &names, &|_| None).unwrap();
        let sum = read("-joints.position.q/2 + 3*joints.position.q2");
        assert_eq!(
            sum.terms,
            [
                ("joints.position.q".to_owned(), -0.5),
                ("joints.position.q2".to_owned(), 3.0)
            ]
        );
        let sum = read("2*lab/split.effort.arm/wrist - 1");
        assert_eq!(sum.terms, [("lab/split.effort.arm/wrist".to_owned(), 2.0)]);
        assert!((sum.offset + 1.0).abs() < 1e-15);
        let missing = read_column("-joints.position.q3", ColumnQuantity::Angle(0), &names, &|_| None);
        assert!(missing.is_err());
    }
}
