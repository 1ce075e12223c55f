//! Units of mass properties: the text of a unit goes in, its factor to SI units comes out.

/// A unit whose text is not known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct UnknownCadUnit(pub(super) String);

/// Finds the factor of a unit by its text.
pub(super) type UnitFactorSearch = fn(&str) -> Result<f64, UnknownCadUnit>;

/// Units of mass as CAD programs write them, in kg.
const MASSES: [(&[&str], f64); 7] = [
    (&["kg", "kilogram", "kilograms"], 1.0),
    (&["g", "gram", "grams"], 1e-3),
    (&["mg", "milligram", "milligrams"], 1e-6),
    (&["t", "tonne", "tonnes"], 1e3),
    (
        &["lb", "lbs", "lbm", "lbmass", "pound", "pounds", "pound-mass"],
        0.453_592_37,
    ),
    (&["oz", "ounce", "ounces"], 0.028_349_523_125),
    (&["slug", "slugs"], 14.593_902_937_206),
];

/// Units of length, in m.
const LENGTHS: [(&[&str], f64); 6] = [
    (&["m", "meter", "meters", "metre", "metres"], 1.0),
    (&["cm", "centimeter", "centimeters", "centimetre", "centimetres"], 1e-2),
    (&["mm", "millimeter", "millimeters", "millimetre", "millimetres"], 1e-3),
    (&["um", "µm", "micrometer", "micrometers"], 1e-6),
    (&["in", "inch", "inches"], 0.0254),
    (&["ft", "foot", "feet"], 0.3048),
];

/// The factor of a unit of mass to kg.
pub(super) fn mass_factor(text: &str) -> Result<f64, UnknownCadUnit> {
    find_unit(&MASSES, &text.trim().to_lowercase()).ok_or_else(|| UnknownCadUnit(text.trim().to_owned()))
}

/// The factor of a unit of length to m.
pub(super) fn length_factor(text: &str) -> Result<f64, UnknownCadUnit> {
    find_unit(&LENGTHS, &text.trim().to_lowercase()).ok_or_else(|| UnknownCadUnit(text.trim().to_owned()))
}

/// The factor of a unit of volume, such as `mm^3` or `cubic millimeters`, to m^3.
pub(super) fn volume_factor(text: &str) -> Result<f64, UnknownCadUnit> {
    let unknown = || UnknownCadUnit(text.trim().to_owned());
    let lower = text.to_lowercase();
    let words: Vec<&str> = unit_words(&lower).filter(|word| *word != "cubic").collect();
    match words[..] {
        [length] if lower.contains(['3', '³']) || lower.contains("cubic") => {
            find_unit(&LENGTHS, length).map(|f| f.powi(3)).ok_or_else(unknown)
        }
        _ => Err(unknown()),
    }
}

/// The factor of a unit of inertia, such as `kg m^2`, `g*mm2` or `grams * square millimeters`, to kg m^2.
pub(super) fn inertia_factor(text: &str) -> Result<f64, UnknownCadUnit> {
    let unknown = || UnknownCadUnit(text.trim().to_owned());
    let lower = text.to_lowercase();
    // A product of mass and length without the square is another quantity, as is a mass per area.
    if !lower.contains(['2', '²']) && !lower.contains("square") || lower.contains('/') {
        return Err(unknown());
    }
    let words: Vec<&str> = unit_words(&lower).filter(|word| *word != "square").collect();
    match words[..] {
        [mass, length] => find_unit(&MASSES, mass).zip(find_unit(&LENGTHS, length)),
        // Without a sign between them, as in `kgm2`, the only division into two units counts.
        [both] => (1..both.len())
            .filter(|at| both.is_char_boundary(*at))
            .find_map(|at| find_unit(&MASSES, &both[..at]).zip(find_unit(&LENGTHS, &both[at..]))),
        _ => None,
    }
    .map(|(mass, length)| mass * length * length)
    .ok_or_else(unknown)
}

/// Names of the units that are known, for messages.
pub(super) const KNOWN_UNITS: &str =
    "known are kg, g, mg, t, lb, oz, slug; m, cm, mm, um, in, ft; and products such as `kg m^2` or `g mm^2`";

/// The words of a unit, without exponents and signs of operations.
fn unit_words(lower: &str) -> impl Iterator<Item = &str> {
    lower
        .split(|c: char| !(c.is_alphabetic()))
        .filter(|word| !word.is_empty())
}

/// The factor of a name in a table of units.
fn find_unit(table: &[(&[&str], f64)], name: &str) -> Option<f64> {
    let row = table.iter().find(|(names, _)| names.contains(&name));
    row.map(|(_, factor)| *factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: Result<f64, UnknownCadUnit>, expected: f64) {
        let found = found.expect("a unit");
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }

    #[test]
    fn units_of_cad_programs_have_their_factors() {
        for text in [
            "kg m^2",
            "kg*m^2",
            "kgm2",
            "kilograms * square meters",
            "kg m²",
            "kg-m^2",
        ] {
            assert_close(inertia_factor(text), 1.0);
        }
        for text in ["g mm^2", "grams *  square millimeters", "gmm2"] {
            assert_close(inertia_factor(text), 1e-9);
        }
        assert_close(inertia_factor("KILOGRAM * MM^2"), 1e-6);
        assert_close(inertia_factor("lbmass in^2"), 0.453_592_37 * 0.0254 * 0.0254);
        assert_close(volume_factor("cubic millimeters"), 1e-9);
        assert_close(mass_factor(" grams "), 1e-3);
        // A moment of mass is no inertia, and a bare number no unit.
        assert!(inertia_factor("kg/m^2").is_err());
        assert!(inertia_factor("kg m").is_err() && inertia_factor("").is_err() && length_factor("kg").is_err());
    }
}
