//! Mass properties as a table in CSV: one row per body, with units in the header or from the rig file.

use std::ops::Range;

use nalgebra::Vector3;

use super::StatedConventions;
use super::fault::{CadFault, CadRow};
use super::numbers::{CLEAR_NUMBERS, PrintedNumber, PrintedNumberFault, proves_decimal_comma, read_number};
use super::tensor::{InertiaPoint, PrintedBody, PrintedInertia};
use super::units::{
    KNOWN_UNITS, UnitFactorSearch, UnknownCadUnit, inertia_factor, length_factor, mass_factor, volume_factor,
};
use crate::file::CadUnits;

/// What a column contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CadColumn {
    /// Name of the body.
    Name,
    /// Mass.
    Mass,
    /// Volume, for the density only.
    Volume,
    /// A coordinate of the centre of mass, 0 to 2.
    Centre(usize),
    /// A moment of inertia, 0 to 2, perhaps with its point.
    Moment(usize, Option<InertiaPoint>),
    /// A product of inertia: 0 xy, 1 xz, 2 yz.
    Product(usize, Option<InertiaPoint>),
}

/// A column with its factor to SI units.
struct ScaledColumn {
    kind: CadColumn,
    factor: f64,
}

/// A field of a line, with its place in the text.
type Field<'t> = (usize, &'t str);

/// Reads a table; each row becomes a body.
pub(super) fn read_table(
    text: &str,
    units: &CadUnits,
    stated: StatedConventions,
) -> Result<Vec<CadRow>, Vec<CadFault>> {
    let separator = find_separator(text);
    let mut lines = lines_with_places(text).filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let Some((at, header)) = lines.next() else {
        return Err(vec![CadFault::new(
            0..0,
            "this table is empty",
            "a header and one row per body",
        )]);
    };
    let header = split_fields(at, header, separator);
    let columns = read_header(&header, units, stated)?;
    let lines: Vec<(usize, &str, Vec<Field<'_>>)> = lines
        .map(|(at, line)| (at, line, split_fields(at, line, separator)))
        .collect();
    let has_decimal_comma = lines.iter().any(|(_, _, fields)| {
        let mut numbers = fields
            .iter()
            .zip(&columns)
            .filter(|(_, column)| column.as_ref().is_some_and(|column| column.kind != CadColumn::Name));
        separator != ',' && numbers.any(|((_, text), _)| proves_decimal_comma(text))
    });
    let mut rows = Vec::new();
    let mut faults = Vec::new();
    for (at, line, fields) in lines {
        if fields.len() > columns.len() {
            faults.push(CadFault::new(
                at..at + line.trim_end().len(),
                format!(
                    "this row has {} fields, and the header has {}",
                    fields.len(),
                    columns.len()
                ),
                "as many fields as in the header; a decimal comma needs `;` between fields",
            ));
            continue;
        }
        match read_row(at, line, &fields, &columns, has_decimal_comma, stated) {
            Ok(row) => rows.push(row),
            Err(fault) => faults.push(fault),
        }
    }
    if rows.is_empty() && faults.is_empty() {
        faults.push(CadFault::new(
            at..at,
            "this table has no row",
            "one row per body below the header",
        ));
    }
    if faults.is_empty() { Ok(rows) } else { Err(faults) }
}

/// The columns of a header. Columns that are not known are ignored, as notes and materials are, but not inertias.
fn read_header(
    header: &[Field<'_>],
    units: &CadUnits,
    stated: StatedConventions,
) -> Result<Vec<Option<ScaledColumn>>, Vec<CadFault>> {
    let mut columns: Vec<Option<ScaledColumn>> = Vec::new();
    let mut faults = Vec::new();
    for (at, text) in header {
        let range = *at..at + text.len();
        let (name, unit) = split_unit(text);
        let Some(kind) = column_of(name) else {
            if looks_like_inertia(name) || unit.is_some_and(|unit| inertia_factor(unit).is_ok()) {
                faults.push(CadFault::new(
                    range,
                    format!("the column `{name}` seems to be an inertia, but this name is not known"),
                    "`Ixx`, `Iyy`, `Izz`, `Ixy`, `Ixz`, `Iyz`, or `Lxx` to `Lyz` about the centre of mass; rename this \
                     column, or delete it if it is not needed",
                ));
            }
            columns.push(None);
            continue;
        };
        let is_known = columns.iter().flatten().any(|known| known.kind == kind);
        // A table of all nine entries has each product twice.
        if is_known && matches!(kind, CadColumn::Product(..)) {
            columns.push(None);
            continue;
        }
        if is_known {
            faults.push(CadFault::new(
                range,
                format!("there are two columns for `{name}`"),
                "one column for each quantity; delete one of them",
            ));
            continue;
        }
        let (given, factor): (Option<&str>, UnitFactorSearch) = match kind {
            CadColumn::Name => {
                columns.push(Some(ScaledColumn { kind, factor: 1.0 }));
                continue;
            }
            CadColumn::Mass => (unit.or(units.mass.as_deref()), mass_factor),
            CadColumn::Volume => (unit, volume_factor),
            CadColumn::Centre(_) => (unit.or(units.length.as_deref()), length_factor),
            CadColumn::Moment(..) | CadColumn::Product(..) => (unit.or(units.inertia.as_deref()), inertia_factor),
        };
        match given.map(factor) {
            Some(Ok(factor)) => columns.push(Some(ScaledColumn { kind, factor })),
            Some(Err(UnknownCadUnit(unit))) => faults.push(CadFault::new(
                range,
                format!("the unit `{unit}` of `{name}` is not known"),
                format!("a unit in brackets, such as `mass [kg]` or `Ixx [kg m^2]`; {KNOWN_UNITS}"),
            )),
            // A volume serves as a check only.
            None if kind == CadColumn::Volume => columns.push(None),
            None => faults.push(CadFault::new(
                range,
                format!("the unit of `{name}` is missing"),
                "a unit in brackets, such as `mass [kg]`, or `units = { mass = \"kg\", length = \"mm\", inertia = \
                 \"kg mm^2\" }` in the rig file",
            )),
        }
    }
    let whole = header.first().map_or(0..0, |first| {
        let last = header.last().unwrap_or(first);
        first.0..last.0 + last.1.len()
    });
    check_columns(&columns, whole, stated, &mut faults);
    if faults.is_empty() { Ok(columns) } else { Err(faults) }
}

/// Faults of a header that lacks columns, or whose columns contradict the rig file.
fn check_columns(
    columns: &[Option<ScaledColumn>],
    whole: Range<usize>,
    stated: StatedConventions,
    faults: &mut Vec<CadFault>,
) {
    let has = |wanted: &dyn Fn(CadColumn) -> bool| columns.iter().flatten().any(|column| wanted(column.kind));
    let mut require = |is_there: bool, what: &str, help: &str| {
        if !is_there {
            faults.push(CadFault::new(
                whole.clone(),
                format!("this table has no column {what}"),
                help,
            ));
        }
    };
    require(has(&|kind| kind == CadColumn::Name), "of names", "a column `name`");
    require(
        has(&|kind| kind == CadColumn::Mass),
        "of masses",
        "a column such as `mass [kg]`",
    );
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        require(
            has(&|kind| kind == CadColumn::Centre(k)),
            &format!("`{axis}` of the centre of mass"),
            "columns such as `x [mm]`, `y [mm]`, `z [mm]`",
        );
    }
    let open = |kind: CadColumn| matches!(kind, CadColumn::Moment(_, None) | CadColumn::Product(_, None));
    require(
        stated.point.is_some() || !has(&open),
        "that states the point of the inertia",
        "`inertia = \"centre\"` (about the centre of mass) or `inertia = \"origin\"` in `[[mass_properties]]`, or columns \
         `Lxx`, `Lxy` ... about the centre of mass",
    );
    let about =
        |wanted| has(&|kind| matches!(kind, CadColumn::Moment(_, point) if point.or(stated.point) == Some(wanted)));
    let is_contradicted = stated
        .point
        .is_some_and(|point| has(&|kind| matches!(kind, CadColumn::Moment(..))) && !about(point));
    if is_contradicted {
        faults.push(CadFault::new(
            whole,
            "the columns of this table state another point of the inertia than `inertia` in `[[mass_properties]]`",
            "delete `inertia`, or rename the columns",
        ));
    }
}

/// Whether a name has the form of a moment or product of inertia, such as `Jxx`, `MOI_xy` or `Ixx_com`.
fn looks_like_inertia(name: &str) -> bool {
    let lower = name.to_lowercase();
    let is_pair = |text: &str| text.len() == 2 && text.bytes().all(|c| matches!(c, b'x' | b'y' | b'z'));
    let is_entry = |word: &str| {
        let rest = word.strip_prefix("moi").or(word.strip_prefix(['i', 'j', 'l', 'p']));
        is_pair(word) || rest.is_some_and(|rest| rest.get(..2).is_some_and(is_pair))
    };
    lower.contains("inertia") || lower.split(|c: char| !c.is_alphanumeric()).any(is_entry)
}

/// One row.
fn read_row(
    at: usize,
    line: &str,
    fields: &[Field<'_>],
    columns: &[Option<ScaledColumn>],
    has_decimal_comma: bool,
    stated: StatedConventions,
) -> Result<CadRow, CadFault> {
    let span = at..at + line.trim_end().len();
    let mut name = String::new();
    let (mut mass, mut volume) = (None, None);
    let mut centre = [None; 3];
    // Moments and products about the centre, and about the origin.
    let mut moments = [[None; 3]; 2];
    let mut products = [[None; 3]; 2];
    let mut least_place: Option<f64> = None;
    for ((place, text), column) in fields.iter().zip(columns) {
        let Some(column) = column else { continue };
        if column.kind == CadColumn::Name {
            (*text).clone_into(&mut name);
            continue;
        }
        if text.is_empty() {
            continue;
        }
        let PrintedNumber { value, place } = read_field(*place, text, has_decimal_comma)?;
        let value = value * column.factor;
        if matches!(column.kind, CadColumn::Moment(..) | CadColumn::Product(..)) {
            least_place = Some(least_place.unwrap_or(f64::INFINITY).min(place * column.factor));
        }
        let index = |point: Option<InertiaPoint>| usize::from(point.or(stated.point) == Some(InertiaPoint::Origin));
        match column.kind {
            CadColumn::Name => {}
            CadColumn::Mass => mass = Some(value),
            CadColumn::Volume => volume = Some(value),
            CadColumn::Centre(k) => centre[k] = Some(value),
            CadColumn::Moment(k, point) => moments[index(point)][k] = Some(value),
            CadColumn::Product(k, point) => products[index(point)][k] = Some(value),
        }
    }
    let missing = |what: &str| {
        CadFault::new(
            span.clone(),
            format!("this row states no {what}"),
            "a number in this column",
        )
    };
    let mass = mass.ok_or_else(|| missing("mass"))?;
    let [Some(x), Some(y), Some(z)] = centre else {
        return Err(missing("complete centre of mass"));
    };
    let mut inertias = Vec::new();
    let mut has_products = false;
    for (k, about) in [InertiaPoint::Centre, InertiaPoint::Origin].into_iter().enumerate() {
        let told = moments[k];
        // A planar table has zz alone.
        match told.iter().flatten().count() {
            0 => continue,
            2 => return Err(missing("complete inertia, but two of three moments")),
            _ => {}
        }
        has_products |= products[k].iter().all(Option::is_some);
        inertias.push(PrintedInertia {
            about,
            moments: Vector3::from(told.map(Option::unwrap_or_default)),
            products: Vector3::from(products[k].map(Option::unwrap_or_default)),
        });
    }
    Ok(CadRow {
        name,
        span: span.clone(),
        volume,
        has_products,
        place: least_place,
        body: PrintedBody {
            mass,
            centre: Vector3::new(x, y, z),
            inertias,
            principal: None,
            stated: stated.sign,
        },
    })
}

/// The number of a field.
fn read_field(place: usize, text: &str, has_decimal_comma: bool) -> Result<PrintedNumber, CadFault> {
    read_number(text, has_decimal_comma).map_err(|fault| {
        let short: String = text.chars().take(40).collect();
        let (message, expected) = match fault {
            PrintedNumberFault::Unclear if has_decimal_comma => (
                format!("`{short}` has a point, and other numbers of this table have a decimal comma"),
                "decimal signs of one kind, and no separators of thousands",
            ),
            PrintedNumberFault::Unclear => (
                format!("`{short}` has a decimal comma or separates thousands"),
                CLEAR_NUMBERS,
            ),
            _ => (format!("`{short}` is not a number"), "a finite number, without a unit"),
        };
        CadFault::new(place..place + text.len(), message, expected)
    })
}

/// The quantity of a column by its name, without regard to case and signs.
fn column_of(name: &str) -> Option<CadColumn> {
    let key: String = name.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    Some(match key.as_str() {
        "name" | "body" | "part" | "component" | "partname" | "bodyname" => CadColumn::Name,
        "mass" | "m" => CadColumn::Mass,
        "volume" | "vol" => CadColumn::Volume,
        _ => {
            let prefixes = [
                "centreofmass",
                "centerofmass",
                "centerofgravity",
                "centreofgravity",
                "centre",
                "center",
                "com",
                "cog",
                "cg",
                "c",
            ];
            let axis = |text: &str| ["x", "y", "z"].iter().position(|axis| *axis == text);
            // `x`, `cx`, `com_x`, `x_com`.
            let bare = prefixes
                .iter()
                .find_map(|prefix| key.strip_prefix(prefix).or(key.strip_suffix(prefix)))
                .and_then(axis);
            if let Some(k) = axis(&key).or(bare) {
                return Some(CadColumn::Centre(k));
            }
            let (key, point) = match (
                key.strip_suffix("origin"),
                key.strip_suffix("centre").or(key.strip_suffix("center")),
            ) {
                (Some(rest), _) => (rest, Some(InertiaPoint::Origin)),
                (_, Some(rest)) => (rest, Some(InertiaPoint::Centre)),
                _ => (key.as_str(), None),
            };
            let (rest, point) = match key.strip_prefix('l') {
                // As in reports of SolidWorks, L is about the centre.
                Some(rest) => (rest, Some(InertiaPoint::Centre)),
                None => (key.strip_prefix('i')?, point),
            };
            match rest {
                "xx" => CadColumn::Moment(0, point),
                "yy" => CadColumn::Moment(1, point),
                "zz" => CadColumn::Moment(2, point),
                "xy" | "yx" => CadColumn::Product(0, point),
                "xz" | "zx" => CadColumn::Product(1, point),
                "yz" | "zy" => CadColumn::Product(2, point),
                _ => return None,
            }
        }
    })
}

/// A header such as `mass [kg]` or `Ixx (kg*m^2)` as name and unit.
fn split_unit(text: &str) -> (&str, Option<&str>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((name, rest)) = text.split_once(open)
            && let Some(unit) = rest.trim_end().strip_suffix(close)
        {
            return (name.trim(), Some(unit.trim()));
        }
    }
    (text.trim(), None)
}

/// The separator of the first line that is no comment.
fn find_separator(text: &str) -> char {
    let header = text
        .lines()
        .find(|line| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
        .unwrap_or_default();
    let count = |c: char| header.matches(c).count();
    [';', '\t']
        .into_iter()
        .find(|c| count(*c) > 0 && count(*c) >= count(','))
        .unwrap_or(',')
}

/// The lines of a text with their places.
pub(super) fn lines_with_places(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut at = 0;
    text.split_inclusive('\n').map(move |line| {
        let here = at;
        at += line.len();
        (here, line.trim_end_matches(['\n', '\r']))
    })
}

/// The fields of a line without blanks and quotes. Quotes protect a separator.
fn split_fields(at: usize, line: &str, separator: char) -> Vec<Field<'_>> {
    let mut fields = Vec::new();
    let (mut start, mut is_quoted) = (0, false);
    let mut push = |from: usize, to: usize| {
        let field = &line[from..to];
        let inner = field.trim().trim_matches('"').trim();
        // The place of the trimmed text in its line.
        let offset = inner.as_ptr() as usize - line.as_ptr() as usize;
        fields.push((at + offset, inner));
    };
    for (k, c) in line.char_indices() {
        if c == '"' {
            is_quoted = !is_quoted;
        } else if c == separator && !is_quoted {
            push(start, k);
            start = k + c.len_utf8();
        }
    }
    push(start, line.len());
    fields
}
