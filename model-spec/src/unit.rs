//! Units and their algebra: `"kg m^2"`, `"N s/m"` become powers of kg, m, s and A.
//!
//! Only coherent SI units are known, so that no conversion factor is needed; rad counts as 1.

#[cfg(any(test, feature = "schema"))]
use std::borrow::Cow;

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::{TomlNode, TomlValue, quote};
use crate::record::SchemaValue;
use crate::suggest;

/// Twice the exponents of kg, m, s, A; doubled, so that exponents of square roots are integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct UnitDimension([i32; 4]);

/// The base of the algebra and the units derived from it, as single exponents of kg, m, s, A.
const UNITS: [(&str, [i32; 4]); 17] = [
    ("1", [0, 0, 0, 0]),
    ("rad", [0, 0, 0, 0]),
    ("kg", [1, 0, 0, 0]),
    ("m", [0, 1, 0, 0]),
    ("s", [0, 0, 1, 0]),
    ("A", [0, 0, 0, 1]),
    ("N", [1, 1, -2, 0]),
    ("J", [1, 2, -2, 0]),
    ("W", [1, 2, -3, 0]),
    ("V", [1, 2, -3, -1]),
    ("Hz", [0, 0, -1, 0]),
    ("Pa", [1, -1, -2, 0]),
    ("C", [0, 0, 1, 1]),
    ("F", [-1, -2, 4, 2]),
    ("Ohm", [1, 2, -3, -2]),
    ("H", [1, 2, -2, -2]),
    ("T", [1, 0, -2, -1]),
];

/// Common units that would need a factor, each with the SI unit to use instead.
const FOREIGN: [(&str, &str); 29] = [
    ("mm", "m"),
    ("cm", "m"),
    ("km", "m"),
    ("g", "kg"),
    ("t", "kg"),
    ("deg", "rad"),
    ("\u{b0}", "rad"),
    ("rpm", "rad/s"),
    ("min", "s"),
    ("ms", "s"),
    ("h", "s"),
    ("kN", "N"),
    ("Nm", "N m"),
    ("Nmm", "N m"),
    ("lb", "kg"),
    ("mN", "N"),
    ("mNm", "N m"),
    ("mrad", "rad"),
    ("mH", "H"),
    ("mOhm", "Ohm"),
    ("mA", "A"),
    ("mV", "V"),
    ("mW", "W"),
    ("mJ", "J"),
    ("mF", "F"),
    ("mT", "T"),
    ("mPa", "Pa"),
    ("mC", "C"),
    ("mHz", "Hz"),
];

/// How common dimensions are printed: unit, single exponents of kg, m, s, A, and name.
const PRINTED: [(&str, [i32; 4], &str); 18] = [
    ("1", [0, 0, 0, 0], "a pure number or an angle"),
    ("m", [0, 1, 0, 0], "a length"),
    ("m^2", [0, 2, 0, 0], "an area"),
    ("kg", [1, 0, 0, 0], "a mass"),
    ("s", [0, 0, 1, 0], "a time"),
    ("1/s", [0, 0, -1, 0], "an angular rate"),
    ("1/s^2", [0, 0, -2, 0], "an angular acceleration"),
    ("m/s", [0, 1, -1, 0], "a velocity"),
    ("m/s^2", [0, 1, -2, 0], "an acceleration"),
    ("kg m", [1, 1, 0, 0], "a first moment of mass"),
    ("kg m^2", [1, 2, 0, 0], "a moment of inertia"),
    ("N", [1, 1, -2, 0], "a force"),
    ("N m", [1, 2, -2, 0], "a torque"),
    ("N/m", [1, 0, -2, 0], "a stiffness"),
    ("N s/m", [1, 0, -1, 0], "a viscous friction"),
    ("N m s", [1, 2, -1, 0], "a viscous friction"),
    ("V", [1, 2, -3, -1], "a voltage"),
    ("A", [0, 0, 0, 1], "a current"),
];

impl UnitDimension {
    /// A pure number or an angle.
    pub(crate) const ONE: Self = Self::new([0, 0, 0, 0]);
    /// s
    pub(crate) const TIME: Self = Self::new([0, 0, 1, 0]);
    /// m
    pub(crate) const LENGTH: Self = Self::new([0, 1, 0, 0]);
    /// kg
    pub(crate) const MASS: Self = Self::new([1, 0, 0, 0]);
    /// kg m, mass times a distance.
    pub(crate) const FIRST_MOMENT: Self = Self::new([1, 1, 0, 0]);
    /// kg m^2
    pub(crate) const INERTIA: Self = Self::new([1, 2, 0, 0]);
    /// m/s^2
    pub(crate) const ACCELERATION: Self = Self::new([0, 1, -2, 0]);
    /// N
    pub(crate) const FORCE: Self = Self::new([1, 1, -2, 0]);
    /// N m
    pub(crate) const TORQUE: Self = Self::new([1, 2, -2, 0]);
    /// N/m
    pub(crate) const STIFFNESS: Self = Self::new([1, 0, -2, 0]);
    /// N s/m
    pub(crate) const DAMPING: Self = Self::new([1, 0, -1, 0]);
    /// m/s
    pub(crate) const VELOCITY: Self = Self::new([0, 1, -1, 0]);
    /// 1/s, an angular rate.
    pub(crate) const RATE: Self = Self::new([0, 0, -1, 0]);
    /// 1/s^2
    pub(crate) const ANGULAR_ACCELERATION: Self = Self::new([0, 0, -2, 0]);

    /// A dimension from the single exponents of kg, m, s, A.
    pub(crate) const fn new(single: [i32; 4]) -> Self {
        Self([2 * single[0], 2 * single[1], 2 * single[2], 2 * single[3]])
    }

    /// The dimension of a product.
    pub(crate) fn multiplied_by(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].saturating_add(other.0[i])))
    }

    /// The dimension of a quotient.
    pub(crate) fn divided_by(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].saturating_sub(other.0[i])))
    }

    /// The dimension of an integer power.
    pub(crate) fn power(self, exponent: i32) -> Self {
        Self(self.0.map(|one| one.saturating_mul(exponent)))
    }

    /// The dimension of the square root; `None` if an exponent would not be a multiple of one half.
    /// An odd doubled exponent would need quarters of exponents.
    pub(crate) fn square_root(self) -> Option<Self> {
        self.0
            .iter()
            .all(|one| one % 2 == 0)
            .then(|| Self(self.0.map(|one| one / 2)))
    }

    /// Its common name with its unit: `a length (m)`.
    /// Dimensions without a common name are printed as powers.
    pub(crate) fn describe(self) -> String {
        PRINTED
            .iter()
            .find(|(_, single, _)| Self::new(*single) == self)
            .map_or_else(
                || format!("a quantity in {self}"),
                |(unit, _, name)| {
                    if *unit == "1" {
                        (*name).to_owned()
                    } else {
                        format!("{name} ({unit})")
                    }
                },
            )
    }
}

/// Prints the common unit, or powers of the base units.
impl std::fmt::Display for UnitDimension {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some((unit, _, _)) = PRINTED.iter().find(|(_, single, _)| Self::new(*single) == *self) {
            return f.write_str(unit);
        }
        let mut blank = "";
        // One factor per base unit, exponents of one half as fractions.
        for (name, twice) in ["kg", "m", "s", "A"].iter().zip(self.0) {
            if twice == 0 {
                continue;
            }
            write!(f, "{blank}{name}")?;
            if twice % 2 != 0 {
                write!(f, "^({twice}/2)")?;
            } else if twice != 2 {
                write!(f, "^{}", twice / 2)?;
            }
            blank = " ";
        }
        Ok(())
    }
}

/// A unit of the file.
#[derive(Clone, Debug)]
pub(crate) struct ModelUnit {
    /// As the author wrote it, with single blanks.
    pub(crate) text: String,
    /// Its dimension, for checks of expressions.
    pub(crate) dimension: UnitDimension,
}

impl ModelUnit {
    /// Parses a unit such as `N s/m`. It stands at `span`; its text begins at byte `inner`, if that is known.
    ///
    /// A fault goes to the log and gives `None`.
    pub(crate) fn from_text(
        text: &str,
        span: SourceSpan,
        inner: Option<usize>,
        log: &mut DiagnosticLog,
    ) -> Option<Self> {
        // The fault has the part of the text that is wrong.
        let fault = match parse_unit(text) {
            Ok(dimension) => {
                return Some(Self {
                    text: text.split_whitespace().collect::<Vec<_>>().join(" "),
                    dimension,
                });
            }
            Err(fault) => fault,
        };
        // The mark covers only the faulty part if the position of the text is known.
        let place = inner.map_or(span, |inner| SourceSpan {
            file: span.file,
            start: inner + fault.start,
            end: inner + fault.end,
        });
        let found = &text[fault.start..fault.end];
        let mut diagnostic = Diagnostic::error(place, fault.message.as_str())
            .label("expected SI units such as `kg`, `m`, `rad`, `kg m^2`, `N s/m`, `m/s^2`, or `1`");
        // Prefixed units are refused, because no factor is ever applied.
        if let Some((_, si)) = FOREIGN.iter().find(|(foreign, _)| *foreign == found) {
            diagnostic = diagnostic.help(format!(
                "write `{si}` and convert the value; modelmill uses SI units without prefixes"
            ));
        } else if let Some(text) = corrected_unit(text, &fault) {
            diagnostic = diagnostic.help(format!("write `{text}`"));
        } else if let Some(near) = suggest::nearest(found, UNITS.iter().map(|(name, _)| *name)) {
            diagnostic = diagnostic.help(format!("did you mean `{near}`?"));
        }
        log.push(diagnostic);
        None
    }

    /// True for a length.
    pub(crate) fn is_length(&self) -> bool {
        self.text == "m"
    }

    /// True for an angle, which may be the operand of sines and cosines.
    pub(crate) fn is_angle(&self) -> bool {
        self.text == "rad"
    }
}

impl SchemaValue for ModelUnit {
    const EXPECTED: &'static str = "a unit in quotes";
    const EXAMPLE: &'static str = "\"kg m^2\"";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Text { text, inner } = &node.value else {
            return crate::record::wrong_type::<Self>(node, log);
        };
        Self::from_text(text, node.span, *inner, log)
    }
}

#[cfg(any(test, feature = "schema"))]
impl schemars::JsonSchema for ModelUnit {
    fn schema_name() -> Cow<'static, str> {
        "Unit".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "An SI unit such as \"kg\", \"m\", \"rad\", \"kg m^2\", \"N s/m\", \"m/s^2\", or \"1\" for a pure number.",
            "type": "string",
            "examples": ["m", "rad", "kg", "kg m", "kg m^2", "N s/m", "N m s/rad", "m/s^2", "1"],
        })
    }
}

/// Unit of a product of powers of quantities: `kg m` for a mass times a length.
///
/// A single quantity keeps its unit as the file writes it. A text that is not a unit counts as a pure number.
/// A single unit keeps its spelling, such as `N m s/rad`.
pub fn unit_product(factors: &[(&str, i32)]) -> String {
    if let [(unit, 1)] = factors {
        return (*unit).to_owned();
    }
    let product = factors
        .iter()
        .filter_map(|(unit, n)| parse_unit(unit).ok().map(|dimension| dimension.power(*n)))
        .fold(UnitDimension::ONE, UnitDimension::multiplied_by);
    product.to_string()
}

/// A segment of the unit's text that is not valid.
struct UnitFault {
    /// First byte in the text of the unit.
    start: usize,
    /// One past the last byte.
    end: usize,
    /// What is wrong, for the title of the diagnostic.
    message: String,
}

/// The unit that a text with a fault probably means: `m/s^2` for `m/s2`, `m/s/s` and `m s\u{207b}\u{b2}`.
fn corrected_unit(text: &str, fault: &UnitFault) -> Option<String> {
    // Divisors one after the other divide by their product.
    if let [above, below @ ..] = text.split('/').collect::<Vec<_>>().as_slice()
        && below.len() > 1
    {
        return parse_unit(&format!("{above}/({})", below.join(" ")))
            .ok()
            .map(|dimension| dimension.to_string());
    }
    let separated = separate_units(&text[fault.start..fault.end])?;
    let corrected = format!("{}{separated}{}", &text[..fault.start], &text[fault.end..]);
    parse_unit(&corrected).is_ok().then_some(corrected)
}

/// Known units that stand together as one word, with exponents that lack their `^`: `kg m^2` for `kgm2`.
fn separate_units(word: &str) -> Option<String> {
    let mut rest = word;
    let mut units = Vec::new();
    while !rest.is_empty() {
        // Other programs separate units by points and hyphens.
        if let Some(behind) = rest.strip_prefix(['.', '-', '\u{22c5}']) {
            rest = behind;
            continue;
        }
        let known = UNITS.iter().map(|(name, _)| *name).filter(|name| *name != "1");
        let unit = known
            .filter(|name| rest.starts_with(name))
            .max_by_key(|name| name.len())?;
        rest = &rest[unit.len()..];
        // `mN` means millinewton, not `m N`.
        if unit == "m" && rest.starts_with(|found: char| found.is_alphabetic()) {
            return None;
        }
        let is_exponent = |found: char| found.is_ascii_digit() || superscript(found).is_some();
        let end = rest.find(|found| !is_exponent(found)).unwrap_or(rest.len());
        let exponent: String = rest[..end].chars().map(|c| superscript(c).unwrap_or(c)).collect();
        rest = &rest[end..];
        units.push(if exponent.is_empty() {
            unit.to_owned()
        } else {
            format!("{unit}^{exponent}")
        });
    }
    Some(units.join(" "))
}

/// The character that a superscript stands for.
fn superscript(found: char) -> Option<char> {
    let known = [
        ('\u{207b}', '-'),
        ('\u{b9}', '1'),
        ('\u{b2}', '2'),
        ('\u{b3}', '3'),
        ('\u{2074}', '4'),
    ];
    known.iter().find(|(sign, _)| *sign == found).map(|(_, plain)| *plain)
}

/// The dimension of a unit: factors separated by blanks or `*`; after one `/` a single unit or a bracket.
fn parse_unit(text: &str) -> Result<UnitDimension, UnitFault> {
    let whole = |message: &str| UnitFault {
        start: 0,
        end: text.len(),
        message: message.to_owned(),
    };
    if text.len() > 100 {
        return Err(whole("this unit is too long"));
    }
    if text.trim().is_empty() {
        return Err(whole("this unit is empty"));
    }
    // At most one `/` is allowed.
    let (above, below) = match text.split_once('/') {
        Some((above, below)) => (above, Some(below)),
        None => (text, None),
    };
    let mut dimension = factors(above, 0)?.0;
    if let Some(below) = below {
        let offset = above.len() + 1;
        // A bracket counts as one divisor.
        let trimmed = below.trim();
        let bracket = trimmed.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
        let (divisor, n_factors) = if let Some(inner) = bracket {
            let skip = below.find('(').unwrap_or(0) + 1;
            (factors(inner, offset + skip)?.0, 1)
        } else {
            factors(below, offset)?
        };
        // `N/m s` could mean `N/(m s)` or `(N/m) s`.
        if n_factors != 1 {
            return Err(UnitFault {
                start: offset,
                end: text.len(),
                message: "this unit has an ambiguous divisor".to_owned(),
            });
        }
        dimension = dimension.divided_by(divisor);
    }
    Ok(dimension)
}

/// The product of units separated by blanks, `*` or a middle dot, and their number.
/// `offset` is the position of `text` in the complete unit, for the places of faults.
fn factors(text: &str, offset: usize) -> Result<(UnitDimension, usize), UnitFault> {
    // Units are separated by blanks or product signs.
    let mut dimension = UnitDimension::ONE;
    let mut n_factors = 0;
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        let blanks = rest
            .find(|found: char| !found.is_whitespace() && found != '*' && found != '\u{b7}')
            .unwrap_or(rest.len());
        at += blanks;
        let rest = &text[at..];
        if rest.is_empty() {
            break;
        }
        let end = rest
            .find(|found: char| found.is_whitespace() || found == '*' || found == '\u{b7}')
            .unwrap_or(rest.len());
        let word = &rest[..end];
        // A unit may have an integer exponent, up to nine.
        let (name, exponent) = match word.split_once('^') {
            Some((name, exponent)) => (name, exponent.parse::<i32>().ok()),
            None => (word, Some(1)),
        };
        let fault = |message: String, length: usize| UnitFault {
            start: offset + at,
            end: offset + at + length,
            message,
        };
        let Some((_, single)) = UNITS.iter().find(|(unit, _)| *unit == name) else {
            return Err(fault(format!("unknown unit `{}`", quote(name)), name.len()));
        };
        let Some(exponent) = exponent.filter(|exponent| exponent.abs() <= 9) else {
            return Err(fault(format!("this exponent of `{name}` is not allowed"), word.len()));
        };
        dimension = dimension.multiplied_by(UnitDimension::new(*single).power(exponent));
        n_factors += 1;
        at += end;
    }
    // A missing unit is reported at its position.
    if n_factors == 0 {
        return Err(UnitFault {
            start: offset,
            end: offset + text.len(),
            message: "a unit is missing here".to_owned(),
        });
    }
    Ok((dimension, n_factors))
}

#[cfg(test)]
mod tests {
    use super::{UNITS, UnitDimension, parse_unit};

    #[test]
    fn units_multiply_and_divide() {
        for (text, printed) in [
            ("kg m^2", "kg m^2"),
            ("N s/m", "N s/m"),
            ("N m s/rad", "N m s"),
            ("m/s^2", "m/s^2"),
            ("J", "N m"),
            ("1/s", "1/s"),
            ("kg*m", "kg m"),
            ("V s/(rad A)", "kg m^2 s^-2 A^-2"),
            ("rad", "1"),
        ] {
            let dimension = parse_unit(text).map_err(|fault| fault.message).unwrap();
            assert_eq!(dimension.to_string(), printed, "{text}");
        }
        for text in [
            "", "kg m s/", "m/s/s", "N/m s", "Nm", "mm", "m^x", "m^99", "()", "m/(", "\u{e9}",
        ] {
            assert!(parse_unit(text).is_err(), "{text}");
        }
    }

    #[test]
    fn printed_dimensions_read_as_the_same() {
        for (name, _) in UNITS {
            let dimension = parse_unit(name).map_err(|fault| fault.message).unwrap();
            let square = dimension.multiplied_by(dimension);
            for found in [dimension, square, UnitDimension::ONE.divided_by(dimension)] {
                assert_eq!(parse_unit(&found.to_string()).ok(), Some(found), "{name}");
            }
        }
    }
}
