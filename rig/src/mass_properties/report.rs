//! Mass properties as the text reports of SolidWorks, Solid Edge, Inventor, Creo and Onshape.
//!
//! The reports differ in layout, but have the same elements: a title with the name of the part, `Mass`, a centre of mass
//! or gravity, and blocks of moments of inertia with entries such as `Lxx` or `Ixx`. Each line is read for one of these
//! elements; other lines are skipped. Which point and which convention of signs a block has is read from its heading.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};

use super::StatedConventions;
use super::fault::{CadFault, CadRow};
use super::numbers::{CLEAR_NUMBERS, PrintedNumber, PrintedNumberFault, read_number};
use super::table::lines_with_places;
use super::tensor::{InertiaPoint, PrintedBody, PrintedInertia, PrintedPrincipalMoments, ProductSign};
use super::thresholds::SAME_VALUE;
use super::units::{
    KNOWN_UNITS, UnitFactorSearch, UnknownCadUnit, inertia_factor, length_factor, mass_factor, volume_factor,
};
use crate::file::CadUnits;

/// The block of a report that is being read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ReportBlock {
    /// None that is needed.
    Other,
    /// The centre of mass, with the factor of its unit.
    Centre(Option<f64>),
    /// Moments of inertia: the point and the factor of the unit as far as the heading states them.
    Inertia(Option<InertiaPoint>, Option<f64>),
    /// Principal moments, with the factor of their unit.
    Principal(Option<f64>),
}

/// A word of a line.
#[derive(Clone, Debug, PartialEq)]
enum ReportToken {
    /// A name such as `lxx` or `x`.
    Key(String),
    /// A number.
    Number(PrintedNumber),
    /// What cannot be read as one number, with the reason.
    Unclear(String),
    /// Anything else, such as a unit.
    Word(String),
}

/// Moments and products of one block, in SI units, row by row; absent entries are not printed.
type Entries = [[Option<f64>; 3]; 3];

/// One report while it is read.
struct ReportReader<'a> {
    units: &'a CadUnits,
    stated: StatedConventions,
    block: ReportBlock,
    name: String,
    mass: Option<f64>,
    volume: Option<f64>,
    centre: [Option<f64>; 3],
    inertias: Vec<(InertiaPoint, Entries)>,
    principal: [Option<f64>; 3],
    axes: [Option<[f64; 3]>; 3],
    sign: Option<ProductSign>,
    place: Option<f64>,
}

/// Reads a file with one report, or with several that each begin with a title.
pub(super) fn read_reports(
    text: &str,
    units: &CadUnits,
    stated: StatedConventions,
) -> Result<Vec<CadRow>, Vec<CadFault>> {
    let mut rows = Vec::new();
    let mut faults = Vec::new();
    for (start, part) in split_reports(text) {
        let mut reader = ReportReader::new(units, stated);
        let mut own = Vec::new();
        for (at, line) in lines_with_places(part) {
            let span = start + at..start + at + line.len();
            if let Err(fault) = reader.line(line, span) {
                own.push(fault);
            }
        }
        let span = start..start + part.trim_end().len().min(part.find('\n').unwrap_or(part.len()));
        if own.is_empty() {
            match reader.row(span) {
                Ok(row) => rows.push(row),
                Err(fault) => faults.push(fault),
            }
        } else {
            faults.append(&mut own);
        }
    }
    if faults.is_empty() { Ok(rows) } else { Err(faults) }
}

/// The reports of a file with their places: each begins with a title, or there is one.
fn split_reports(text: &str) -> Vec<(usize, &str)> {
    let mut starts: Vec<usize> = lines_with_places(text)
        .filter(|(_, line)| title_of(&clean(line)).is_some())
        .map(|(at, _)| at)
        .collect();
    if starts.is_empty() {
        return vec![(0, text)];
    }
    // What precedes the first title belongs to it.
    starts[0] = 0;
    let ends = starts[1..].iter().copied().chain([text.len()]);
    starts
        .iter()
        .copied()
        .zip(ends)
        .map(|(from, to)| (from, &text[from..to]))
        .collect()
}

/// A line without marks of comments and of tables.
fn clean(line: &str) -> String {
    let marks = ['#', '%', '*', '|', '/', ' ', '\t', '\u{feff}'];
    line.trim_start_matches(marks)
        .trim_end_matches(['|', ' ', '\t'])
        .to_owned()
}

/// The name of the part in a title.
fn title_of(line: &str) -> Option<String> {
    let lower = line.to_ascii_lowercase();
    for title in [
        "mass properties of",
        "physical properties for",
        "physical properties of",
        "physical properties report for",
    ] {
        if let Some(rest) = lower.strip_prefix(title) {
            let name = line[line.len() - rest.len()..].trim_matches([' ', ':', '"', '\t']);
            // Creo writes `MASS PROPERTIES OF THE PART G1`.
            let name = name
                .strip_prefix("THE PART ")
                .or(name.strip_prefix("THE ASSEMBLY "))
                .unwrap_or(name);
            // These are several parts.
            if name.to_ascii_lowercase().starts_with("selected ") {
                return Some(String::new());
            }
            return Some(name.to_owned()).filter(|name| !name.is_empty());
        }
    }
    None
}

impl<'a> ReportReader<'a> {
    fn new(units: &'a CadUnits, stated: StatedConventions) -> Self {
        Self {
            units,
            stated,
            block: ReportBlock::Other,
            name: String::new(),
            mass: None,
            volume: None,
            centre: [None; 3],
            inertias: Vec::new(),
            principal: [None; 3],
            axes: [None; 3],
            sign: None,
            place: None,
        }
    }

    /// Reads one line.
    fn line(&mut self, line: &str, span: std::ops::Range<usize>) -> Result<(), CadFault> {
        let line = clean(line);
        let lower = line.to_lowercase();
        if let Some(name) = title_of(&line) {
            self.name = name;
            return Ok(());
        }
        self.read_sign(&lower);
        if let Some(rest) = value_of(&lower, "mass") {
            let unit = &self.units.mass;
            let mass = scaled_value(rest, unit.as_deref(), mass_factor, "mass", &span)?;
            state_value(&mut self.mass, mass, "mass", &span)?;
            self.block = ReportBlock::Other;
            return Ok(());
        }
        if let Some(rest) = value_of(&lower, "volume") {
            // Only the density needs it.
            self.volume = scaled_value(rest, None, volume_factor, "volume", &span).ok();
            return Ok(());
        }
        let mut rest = lower.as_str();
        if let Some(block) = Self::heading(&lower) {
            self.block = block;
            // A heading may have values on its own line.
            match lower.split_once(':') {
                Some((_, after)) => rest = after,
                None => return Ok(()),
            }
        } else if let Some(at) = lower.find("taken at") {
            if let ReportBlock::Inertia(point, _) = &mut self.block {
                *point = point_of(&lower[at..]).or(*point);
            }
            return Ok(());
        }
        self.values(rest, &span)
    }

    /// The convention of signs that a line states.
    fn read_sign(&mut self, lower: &str) {
        if lower.contains("positive tensor notation") || lower.contains("positive integral") {
            self.sign = Some(ProductSign::Positive);
        } else if lower.contains("negative tensor notation") || lower.contains("negative integral") {
            self.sign = Some(ProductSign::Negative);
        }
    }

    /// The block that a heading begins.
    fn heading(lower: &str) -> Option<ReportBlock> {
        let unit = || in_brackets(lower).find_map(|text| inertia_factor(text).ok());
        if lower.contains("gyration")
            || lower.contains("rotation")
            || lower.contains("center of volume")
            || lower.contains("orientation")
        {
            return Some(ReportBlock::Other);
        }
        if lower.starts_with("taken at") {
            return None;
        }
        if lower.contains("inertia") {
            // The second heading of a block in Creo.
            if lower.starts_with("inertia tensor") {
                return None;
            }
            if lower.contains("area") {
                return Some(ReportBlock::Other);
            }
            if lower.contains("principal") {
                return Some(ReportBlock::Principal(unit()));
            }
            return Some(ReportBlock::Inertia(point_of(lower), unit()));
        }
        if has_centre(lower) {
            let unit = in_brackets(lower).find_map(|text| length_factor(text).ok());
            return Some(ReportBlock::Centre(unit));
        }
        None
    }

    /// Reads the values of a line for the present block.
    fn values(&mut self, text: &str, span: &std::ops::Range<usize>) -> Result<(), CadFault> {
        // Lines that are not needed may have numbers of any form.
        if self.block == ReportBlock::Other {
            return Ok(());
        }
        let found = assignments(&tokens_of(text), span)?;
        match self.block {
            ReportBlock::Other => Ok(()),
            ReportBlock::Centre(factor) => {
                for (key, values, unit) in found {
                    let Some(k) = ["x", "y", "z"].iter().position(|axis| *axis == key) else {
                        continue;
                    };
                    let default = self.units.length.as_deref();
                    let factor = pick_factor(factor, &unit, default, length_factor, "centre of mass", span)?;
                    state_value(&mut self.centre[k], values[0].value * factor, "centre of mass", span)?;
                }
                Ok(())
            }
            ReportBlock::Inertia(point, factor) => {
                for (key, values, unit) in found {
                    let Some((letter, row, column)) = entry_of(&key) else {
                        continue;
                    };
                    let factor = self.inertia_factor(factor, &unit, span)?;
                    // L is about the centre in SolidWorks and Onshape.
                    let by_letter = (letter == 'l').then_some(InertiaPoint::Centre);
                    let Some(about) = point.or(by_letter).or(self.stated.point) else {
                        return Err(CadFault::new(
                            span.clone(),
                            "this report does not state the point of its moments of inertia",
                            "`inertia = \"centre\"` (about the centre of mass) or `inertia = \"origin\"` in \
                             `[[mass_properties]]`",
                        ));
                    };
                    let at = self
                        .inertias
                        .iter()
                        .position(|(known, _)| *known == about)
                        .unwrap_or_else(|| {
                            self.inertias.push((about, Entries::default()));
                            self.inertias.len() - 1
                        });
                    let entry = &mut self.inertias[at].1[row][column];
                    state_value(entry, values[0].value * factor, &format!("entry `{key}`"), span)?;
                    self.place = Some(self.place.unwrap_or(f64::INFINITY).min(values[0].place * factor));
                }
                Ok(())
            }
            ReportBlock::Principal(factor) => {
                for (key, values, unit) in found {
                    let of = |names: [&str; 3]| names.iter().position(|name| *name == key);
                    if let (Some(k), [x, y, z]) = (of(["ix", "iy", "iz"]), &values[..]) {
                        self.axes[k] = Some([x.value, y.value, z.value]);
                    } else if let (Some(k), [value]) = (of(["px", "py", "pz"]).or(of(["i1", "i2", "i3"])), &values[..])
                    {
                        let value = value.value * self.inertia_factor(factor, &unit, span)?;
                        state_value(&mut self.principal[k], value, &format!("entry `{key}`"), span)?;
                    }
                }
                Ok(())
            }
        }
    }

    /// The factor of the unit of an inertia.
    fn inertia_factor(
        &self,
        heading: Option<f64>,
        after: &str,
        span: &std::ops::Range<usize>,
    ) -> Result<f64, CadFault> {
        let default = self.units.inertia.as_deref();
        pick_factor(heading, after, default, inertia_factor, "inertia", span)
    }

    /// The body of the report.
    fn row(self, span: std::ops::Range<usize>) -> Result<CadRow, CadFault> {
        let missing = |what: &str, line: &str| {
            CadFault::new(
                span.clone(),
                format!("this report states no {what}"),
                format!(
                    "a line such as `{line}`; read are reports of SolidWorks, Solid Edge, Inventor, Creo and Onshape in English, and tables (.csv)"
                ),
            )
        };
        let mass = self.mass.ok_or_else(|| missing("mass", "Mass = 12.5 kilograms"))?;
        let [Some(x), Some(y), Some(z)] = self.centre else {
            return Err(missing("centre of mass", "Center of mass: ( millimeters )"));
        };
        self.refuse_other_conventions(&span)?;
        self.refuse_asymmetric_entries(&span)?;
        let has_products = self.inertias.iter().any(|(_, entries)| {
            [(0, 1), (0, 2), (1, 2)]
                .iter()
                .all(|&(i, j)| entries[i][j].or(entries[j][i]).is_some())
        });
        let inertias: Vec<PrintedInertia> = self
            .inertias
            .iter()
            .filter_map(|(about, entries)| {
                let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(|k| entries[k][k]) else {
                    return None;
                };
                // Either half of the symmetric matrix may be printed.
                let product = |i: usize, j: usize| entries[i][j].or(entries[j][i]).unwrap_or_default();
                Some(PrintedInertia {
                    about: *about,
                    moments: Vector3::new(x, y, z),
                    products: Vector3::new(product(0, 1), product(0, 2), product(1, 2)),
                })
            })
            .collect();
        if inertias.is_empty() {
            return Err(missing("moments of inertia", "Lxx = 1.0  Lxy = 0.0  Lxz = 0.0"));
        }
        let principal = match self.principal {
            [Some(x), Some(y), Some(z)] => Some(PrintedPrincipalMoments {
                moments: Vector3::new(x, y, z),
                axes: match self.axes {
                    [Some(x), Some(y), Some(z)] => {
                        Some(Matrix3::from_rows(&[x, y, z].map(|a| Vector3::from(a).transpose())))
                    }
                    _ => None,
                },
            }),
            _ => None,
        };
        Ok(CadRow {
            name: self.name,
            span: span.clone(),
            volume: self.volume,
            has_products,
            place: self.place,
            body: PrintedBody {
                mass,
                centre: Vector3::new(x, y, z),
                inertias,
                principal,
                stated: self.sign.or(self.stated.sign),
            },
        })
    }

    /// Refuses products whose two places have different values.
    fn refuse_asymmetric_entries(&self, span: &std::ops::Range<usize>) -> Result<(), CadFault> {
        for (_, entries) in &self.inertias {
            for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                let mut first = entries[i][j];
                if let Some(second) = entries[j][i] {
                    let what = format!("product of inertia {}", ["xy", "xz", "yz"][i + j - 1]);
                    state_value(&mut first, second, &what, span)?;
                }
            }
        }
        Ok(())
    }

    /// Refuses conventions of the rig file that the report contradicts.
    fn refuse_other_conventions(&self, span: &std::ops::Range<usize>) -> Result<(), CadFault> {
        if let (Some(own), Some(stated)) = (self.sign, self.stated.sign)
            && own != stated
        {
            let word = if own == ProductSign::Positive {
                "positive"
            } else {
                "negative"
            };
            return Err(CadFault::new(
                span.clone(),
                format!(
                    "this report states that its products of inertia are {word}, and `products` states the contrary"
                ),
                "no `products` in `[[mass_properties]]`, where the report states them; delete it",
            ));
        }
        if let Some(stated) = self.stated.point
            && self.inertias.iter().all(|(about, _)| *about != stated)
        {
            let (own, word) = match stated {
                InertiaPoint::Centre => ("the origin", "centre"),
                InertiaPoint::Origin => ("the centre of mass", "origin"),
            };
            return Err(CadFault::new(
                span.clone(),
                format!("this report states moments of inertia about {own}, and `inertia = \"{word}\"` the contrary"),
                "no `inertia` in `[[mass_properties]]`, where the report states the point; delete it",
            ));
        }
        Ok(())
    }
}

/// The text after `NAME =` or `NAME (note):`.
fn value_of<'l>(lower: &'l str, name: &str) -> Option<&'l str> {
    let rest = lower.strip_prefix(name)?.trim_start();
    let rest = match rest.strip_prefix('(') {
        Some(note) => note.split_once(')')?.1.trim_start(),
        None => rest,
    };
    rest.strip_prefix(['=', ':'])
}

/// Sets a value that is not yet known. Two values mean two parts, of which one would be lost.
fn state_value(known: &mut Option<f64>, value: f64, what: &str, span: &std::ops::Range<usize>) -> Result<(), CadFault> {
    if let Some(before) = *known
        && (before - value).abs() > SAME_VALUE * before.abs()
    {
        return Err(CadFault::new(
            span.clone(),
            format!("the {what} is stated twice with different values"),
            "one value per part; save the report of each part as its own file, or begin each report with a title such as \
             `Mass properties of NAME`",
        ));
    }
    *known = Some(value);
    Ok(())
}

/// A number with its unit, in SI units.
fn scaled_value(
    text: &str,
    default: Option<&str>,
    factor: UnitFactorSearch,
    what: &str,
    span: &std::ops::Range<usize>,
) -> Result<f64, CadFault> {
    let tokens = tokens_of(text);
    let value = match tokens.first() {
        Some(ReportToken::Number(number)) => number.value,
        Some(ReportToken::Unclear(says)) => return Err(CadFault::new(span.clone(), says, CLEAR_NUMBERS)),
        _ => {
            return Err(CadFault::new(
                span.clone(),
                format!("this line has no number for the {what}"),
                "a number with its unit",
            ));
        }
    };
    let unit = unit_after(&tokens[1..]);
    Ok(value * unit_factor_of(&unit, default, factor, what, span)?)
}

/// The factor of a value's unit: from the heading, after the value, or from the rig file.
fn pick_factor(
    heading: Option<f64>,
    after: &str,
    default: Option<&str>,
    factor: UnitFactorSearch,
    what: &str,
    span: &std::ops::Range<usize>,
) -> Result<f64, CadFault> {
    match heading {
        Some(known) => Ok(known),
        None => unit_factor_of(after, default, factor, what, span),
    }
}

/// The factor of a unit that stands after a value, else of the default unit.
fn unit_factor_of(
    after: &str,
    default: Option<&str>,
    factor: UnitFactorSearch,
    what: &str,
    span: &std::ops::Range<usize>,
) -> Result<f64, CadFault> {
    let given = Some(after).filter(|unit| !unit.is_empty()).or(default);
    match given.map(factor) {
        Some(Ok(factor)) => Ok(factor),
        Some(Err(UnknownCadUnit(unit))) => Err(CadFault::new(
            span.clone(),
            format!("the unit `{unit}` of the {what} is not known"),
            KNOWN_UNITS,
        )),
        None => Err(CadFault::new(
            span.clone(),
            format!("the unit of the {what} is missing"),
            "a unit in the report, or `units = { mass = \"kg\", length = \"mm\", inertia = \"kg mm^2\" }` in \
             `[[mass_properties]]`",
        )),
    }
}

/// Whether a line names the centre of mass.
fn has_centre(lower: &str) -> bool {
    [
        "center of mass",
        "centre of mass",
        "center of gravity",
        "centre of gravity",
        "centroid",
    ]
    .iter()
    .any(|name| lower.contains(name))
}

/// The point that a heading of moments names.
fn point_of(lower: &str) -> Option<InertiaPoint> {
    if has_centre(lower) {
        return Some(InertiaPoint::Centre);
    }
    let is_origin = [
        "output coordinate system",
        "coordinate frame",
        "global",
        "origin",
        "coordinate system",
    ]
    .iter()
    .any(|name| lower.contains(name));
    is_origin.then_some(InertiaPoint::Origin)
}

/// The texts in brackets of a line.
fn in_brackets(line: &str) -> impl Iterator<Item = &str> {
    line.split('(')
        .skip(1)
        .filter_map(|rest| rest.split_once(')'))
        .map(|(inside, _)| inside)
}

/// Letter, row and column of an entry such as `lxx`, `ixy` or `izzg`.
fn entry_of(key: &str) -> Option<(char, usize, usize)> {
    let mut letters = key.chars();
    let letter = letters.next().filter(|c| matches!(c, 'l' | 'i'))?;
    let axis = |c: Option<char>| "xyz".find(c?);
    let (row, column) = (axis(letters.next())?, axis(letters.next())?);
    matches!(letters.as_str(), "" | "g").then_some((letter, row, column))
}

/// The words of a line. Commas are decimal signs or separate numbers.
fn tokens_of(text: &str) -> Vec<ReportToken> {
    let mut tokens = Vec::new();
    // The note `(Relative Error = 0.01 %)` of Inventor contains no value.
    let mut pieces = text.split("(relative");
    let mut kept = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        kept.push(' ');
        kept.push_str(piece.split_once(')').map_or("", |(_, rest)| rest));
    }
    let words = kept
        .split(|c: char| c.is_whitespace() || matches!(c, '=' | ':' | '|' | '(' | ')' | '[' | ']'))
        .map(|word| word.trim_matches([',', ';']))
        .filter(|word| !word.is_empty());
    for word in words {
        let pieces: Vec<&str> =
            if word.matches(',').count() > 1 && word.contains('.') && word.split(',').all(|p| p.contains('.')) {
                word.split(',').collect()
            } else {
                vec![word]
            };
        tokens.extend(pieces.into_iter().map(token_of));
    }
    tokens
}

/// One word as a token.
fn token_of(word: &str) -> ReportToken {
    let is_key = matches!(
        word,
        "x" | "y" | "z" | "ix" | "iy" | "iz" | "px" | "py" | "pz" | "i1" | "i2" | "i3"
    );
    if is_key || entry_of(word).is_some() {
        return ReportToken::Key(word.to_owned());
    }
    match read_number(word, false) {
        Ok(number) => ReportToken::Number(number),
        Err(PrintedNumberFault::NoNumber) => ReportToken::Word(word.to_owned()),
        Err(PrintedNumberFault::Unclear) => {
            ReportToken::Unclear(format!("`{word}` has a decimal comma or separates thousands"))
        }
        Err(PrintedNumberFault::Infinite) => ReportToken::Unclear(format!("`{word}` is not a finite number")),
    }
}

/// The words up to the next key or number, as a unit.
fn unit_after(tokens: &[ReportToken]) -> String {
    let words: Vec<&str> = tokens
        .iter()
        .map_while(|token| match token {
            ReportToken::Word(word) => Some(word.as_str()),
            _ => None,
        })
        .collect();
    words.join(" ")
}

/// Keys with their numbers and units. Keys may stand before all their numbers, as in `X Y Z 1 2 3`; a single key may
/// have several numbers, as the axis in `Ix = (1, 0, 0)`.
fn assignments(
    tokens: &[ReportToken],
    span: &std::ops::Range<usize>,
) -> Result<Vec<(String, Vec<PrintedNumber>, String)>, CadFault> {
    let mut found: Vec<(String, Vec<PrintedNumber>, String)> = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let mut keys = VecDeque::new();
        while let Some(ReportToken::Key(key)) = tokens.get(at) {
            keys.push_back(key.clone());
            at += 1;
        }
        let mut numbers = Vec::new();
        while let Some(ReportToken::Number(value)) = tokens.get(at) {
            numbers.push(*value);
            at += 1;
        }
        if let (Some(ReportToken::Unclear(says)), false) = (tokens.get(at), keys.is_empty()) {
            return Err(CadFault::new(span.clone(), says, CLEAR_NUMBERS));
        }
        let unit = unit_after(&tokens[at..]);
        while let Some(ReportToken::Word(_) | ReportToken::Unclear(_)) = tokens.get(at) {
            at += 1;
        }
        if keys.len() == 1 {
            found.extend(keys.pop_front().map(|key| (key, numbers, unit)));
        } else if keys.len() == numbers.len() {
            found.extend(
                keys.into_iter()
                    .zip(numbers)
                    .map(|(key, value)| (key, vec![value], unit.clone())),
            );
        }
    }
    found.retain(|(_, values, _)| !values.is_empty());
    Ok(found)
}
