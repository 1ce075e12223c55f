//! Mass properties from CAD programs. A file that a rig names goes in; masses, centres and inertias of its bodies come
//! out, in SI units.
//!
//! A table (`table`) has one row per body, a report (`report`) is what a CAD program prints for one part. Both give
//! printed values, from which `tensor` determines the inertia about the centre of mass.
//!
//! Decision: units, coordinates and, where nothing determines it, the sign of products are required and never guessed,
//! since a wrong guess gives a model with plausible forces.

mod fault;
mod numbers;
mod report;
mod table;
mod tensor;
mod thresholds;
mod units;

use std::path::Path;

use modelmill_boundary::files::{FileSource, normalise_path};
use modelmill_spec::{Diagnostic, DiagnosticSeverity, LARGEST_FILE, SourceFile, SourceFiles, SourceSpan};
use nalgebra::Matrix3;
use toml::Spanned;

use crate::file::{BodyEntry, MassPropertiesEntry, RigEntry, RigInertiaEntry, RigName};
use crate::load::{plain_error, source_span};
use crate::log::RigLog;

use fault::{CadFault, CadRow};
use tensor::{InertiaFault, InertiaPoint, ProductSign, SignEvidence, determine_inertia};
use thresholds::{DENSITIES, FEWEST_UNITS};

/// Conventions that the rig file states for a file of mass properties.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct StatedConventions {
    /// The point of the inertia.
    point: Option<InertiaPoint>,
    /// The sign of products.
    sign: Option<ProductSign>,
}

/// Reads all files of mass properties that a rig file names, and adds their values to its bodies. Faults go to the log,
/// assumptions to the remarks. Returns the bodies that only these files name, with their places.
pub(crate) fn read_mass_properties(
    file: usize,
    folder: &Path,
    entry: &mut RigEntry,
    files: &dyn FileSource,
    sources: &mut SourceFiles,
    log: &mut RigLog,
    remarks: &mut Vec<Diagnostic>,
) -> Vec<(String, SourceSpan)> {
    let own = entry.body.len();
    for properties in std::mem::take(&mut entry.mass_properties) {
        let Some((rows, index)) = read_file(file, folder, &properties, files, sources, log) else {
            continue;
        };
        let is_assembly = match properties.coordinates.get_ref().as_str() {
            "assembly" => true,
            "part" => false,
            _ => {
                log.error(
                    source_span(file, &properties.coordinates.span()),
                    "these coordinates are not known".to_owned(),
                    "expected `assembly` or `part`",
                    "`assembly`: all values are in the base frame in the nominal configuration; `part`: they are in the \
                     frame of the body, which `at` and `rpy` of its `[[body]]` place",
                );
                continue;
            }
        };
        if let Some(body) = properties.body.as_ref().filter(|_| rows.len() != 1) {
            log.error(
                source_span(file, &body.span()),
                format!("`body` names one body, but this file has {}", rows.len()),
                "expected a report of one part",
                "delete `body`; names of a table are in its column `name`",
            );
            continue;
        }
        let n_faults = log.0.len();
        let mut evidence = Vec::new();
        for row in rows {
            evidence.extend(add_row(
                file,
                index,
                &properties,
                is_assembly,
                &row,
                &mut entry.body,
                log,
                remarks,
            ));
        }
        if log.0.len() == n_faults {
            remarks.extend(sign_remark(index, &evidence));
        }
    }
    let added = entry.body[own..].iter();
    added
        .map(|body| (body.name.get_ref().clone(), source_span(file, &body.name.span())))
        .collect()
}

/// Refuses bodies that only mass properties of a variant name, if the file that it extends gives them a pose: the new
/// entry would replace the whole body, and the pose would be lost.
pub(crate) fn refuse_lost_poses(added: &[(String, SourceSpan)], extended: &RigEntry, path: &Path, log: &mut RigLog) {
    for (name, place) in added {
        let has_pose = |body: &BodyEntry| body.name.get_ref() == name && (body.at.is_some() || body.rpy.is_some());
        if extended.body.iter().any(has_pose) {
            log.error(
                *place,
                format!("these mass properties replace the body `{name}` of `{}`, which has a pose", path.display()),
                "the pose would be lost",
                &format!(
                    "add `[[body]]` with `name = \"{name}\"` to this file: with `at` and `rpy` for `coordinates = \"part\"`, \
                     without them for `coordinates = \"assembly\"`"
                ),
            );
        }
    }
}

/// The rows of one file with its index among the sources; faults of the file are logged.
fn read_file(
    file: usize,
    folder: &Path,
    properties: &MassPropertiesEntry,
    files: &dyn FileSource,
    sources: &mut SourceFiles,
    log: &mut RigLog,
) -> Option<(Vec<CadRow>, usize)> {
    let path = normalise_path(&folder.join(properties.file.get_ref()));
    let span = source_span(file, &properties.file.span());
    let text = match files.read_text(&path, LARGEST_FILE as u64) {
        Ok(text) => text,
        Err(error) => {
            log.error(
                span,
                format!("cannot read `{}`: {}", path.display(), error.fault),
                "expected a table or report of mass properties",
                "the path is relative to the folder of this file; save text as UTF-8",
            );
            return None;
        }
    };
    // Errors quote lines. So a file of another kind, which a rig from elsewhere may name, is not quoted.
    if !text.to_ascii_lowercase().contains("mass") {
        log.error(
            span,
            format!("`{}` contains no mass", path.display()),
            "expected a table with a column `mass`, or a report of a CAD program in English",
            "",
        );
        return None;
    }
    let stated = stated_conventions(file, properties, log)?;
    let index = sources.files.len();
    let is_table = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("csv") || e.eq_ignore_ascii_case("tsv"));
    let read = if is_table {
        table::read_table(&text, &properties.units, stated)
    } else {
        report::read_reports(&text, &properties.units, stated)
    };
    sources.files.push(SourceFile { path, text });
    match read {
        Ok(rows) => Some((rows, index)),
        Err(faults) => {
            for CadFault {
                span,
                message,
                expected,
            } in faults
            {
                log.error(source_span(index, &span), message, "", &format!("expected {expected}"));
            }
            None
        }
    }
}

/// The conventions of an entry; none after a fault.
fn stated_conventions(file: usize, properties: &MassPropertiesEntry, log: &mut RigLog) -> Option<StatedConventions> {
    let mut is_known = true;
    let mut pick = |name: &Option<RigName>, known: [&str; 2]| {
        let name = name.as_ref()?;
        let found = known.iter().position(|one| *one == name.get_ref());
        if found.is_none() {
            is_known = false;
            log.error(
                source_span(file, &name.span()),
                "this value is not known".to_owned(),
                &format!("expected `{}` or `{}`", known[0], known[1]),
                "",
            );
        }
        found
    };
    let point = pick(&properties.inertia, ["centre", "origin"]);
    let sign = pick(&properties.products, ["positive", "negative"]);
    let stated = StatedConventions {
        point: point.map(|k| [InertiaPoint::Centre, InertiaPoint::Origin][k]),
        sign: sign.map(|k| [ProductSign::Positive, ProductSign::Negative][k]),
    };
    is_known.then_some(stated)
}

/// Adds the values of a row to the body of its name, or a new body. Returns how the sign of its products is known.
#[expect(
    clippy::too_many_arguments,
    reason = "places of two files, and the two lists of findings"
)]
fn add_row(
    file: usize,
    index: usize,
    properties: &MassPropertiesEntry,
    is_assembly: bool,
    row: &CadRow,
    bodies: &mut Vec<BodyEntry>,
    log: &mut RigLog,
    remarks: &mut Vec<Diagnostic>,
) -> Option<(String, SourceSpan, SignEvidence)> {
    let place = source_span(index, &row.span);
    let name = match &properties.body {
        Some(name) => name.get_ref().clone(),
        None => word_of(&row.name),
    };
    if name.is_empty() {
        let label = "expected a name of letters, digits and `_`";
        log.error(
            place,
            "this body has no name".to_owned(),
            label,
            "state `body = \"NAME\"` in `[[mass_properties]]`",
        );
        return None;
    }
    let printed = &row.body;
    if printed.mass.is_nan() || printed.mass < 0.0 {
        log.error(
            place,
            format!("the mass of `{name}` is below zero"),
            "",
            "correct the value",
        );
        return None;
    }
    let (tensor, sign) = match determine_inertia(printed) {
        Ok(found) => (found.tensor, found.sign),
        // A row without moments is a point mass.
        Err(InertiaFault::Missing) => (Matrix3::zeros(), SignEvidence::NoEffect),
        Err(fault) => {
            report_inertia(place, &name, &fault, log);
            return None;
        }
    };
    check_density(place, &name, row, remarks);
    check_inertia(place, &name, row, &tensor, remarks);
    let spanned = |value: [f64; 3]| Spanned::new(properties.file.span(), value);
    let at = bodies
        .iter()
        .position(|body| body.name.get_ref() == &name)
        .unwrap_or_else(|| {
            bodies.push(BodyEntry::with_name(Spanned::new(properties.file.span(), name.clone())));
            bodies.len() - 1
        });
    let body = &mut bodies[at];
    if !is_consistent(file, index, body, is_assembly, row, log) {
        return None;
    }
    body.mass = Some(Spanned::new(properties.file.span(), printed.mass));
    body.centre = Some(spanned(printed.centre.into()));
    body.inertia = Some(Spanned::new(
        properties.file.span(),
        RigInertiaEntry {
            xx: tensor[(0, 0)],
            yy: tensor[(1, 1)],
            zz: tensor[(2, 2)],
            xy: tensor[(0, 1)],
            xz: tensor[(0, 2)],
            yz: tensor[(1, 2)],
        },
    ));
    Some((name, place, sign))
}

/// Whether a body can take the values of a row: it has none yet, and a pose if and only if the row needs one.
fn is_consistent(
    file: usize,
    index: usize,
    body: &BodyEntry,
    is_assembly: bool,
    row: &CadRow,
    log: &mut RigLog,
) -> bool {
    let name = body.name.get_ref();
    let place = source_span(index, &row.span);
    if body.mass.is_some() || body.centre.is_some() || body.inertia.is_some() {
        log.error(
            place,
            format!("`{name}` has mass properties already"),
            "the rig file or an earlier row states them",
            "rename or delete one of the two",
        );
        return false;
    }
    let pose = body.at.as_ref().or(body.rpy.as_ref());
    match (is_assembly, pose) {
        (true, Some(pose)) => {
            log.error(
                source_span(file, &pose.span()),
                format!("`{name}` has a pose, and its mass properties are in coordinates of the assembly"),
                "",
                "delete `at` and `rpy`, or state `coordinates = \"part\"` if its values are in the frame of the part",
            );
            false
        }
        (false, None) => {
            log.error(
                place,
                format!("the pose of `{name}` is not stated, and its mass properties are in coordinates of the part"),
                "",
                &format!(
                    "add `[[body]]` with `name = \"{name}\"`, `at` and `rpy`, or export values in coordinates of the \
                     assembly and state `coordinates = \"assembly\"`"
                ),
            );
            false
        }
        _ => true,
    }
}

/// Reports why an inertia cannot be used.
fn report_inertia(place: SourceSpan, name: &str, fault: &InertiaFault, log: &mut RigLog) {
    let (message, help) = match fault {
        InertiaFault::Missing => return,
        InertiaFault::UnknownSign => (
            format!("the sign of the products of inertia of `{name}` is not known"),
            "state `products = \"positive\"` in `[[mass_properties]]` if they are integrals of x y dm, or `products = \
             \"negative\"` if they are entries of the tensor (their negatives)"
                .to_owned(),
        ),
        InertiaFault::ContradictedSign(stated) => (
            format!(
                "the products of inertia of `{name}` are stated to be {}, which contradicts other values of this file",
                if *stated == ProductSign::Positive {
                    "positive"
                } else {
                    "negative"
                }
            ),
            "correct `products`, or delete it: the values of this file determine the sign".to_owned(),
        ),
        InertiaFault::ContradictedPoints => (
            format!("the inertias of `{name}` about its centre and about the origin contradict each other"),
            "check the units of mass and lengths, and whether both are in the same coordinate system".to_owned(),
        ),
        InertiaFault::Impossible(moments) => (
            format!(
                "the inertia of `{name}` is impossible: its principal moments are {:.4e}, {:.4e} and {:.4e} kg m^2",
                moments[0], moments[1], moments[2]
            ),
            "each moment must be positive and at most the sum of the two others; check the point of the inertia \
             (`inertia = \"centre\"` or `\"origin\"`), the sign of products (`products`) and the units"
                .to_owned(),
        ),
    };
    log.error(place, message, "", &help);
}

/// Remarks on a mean density that no solid has.
fn check_density(place: SourceSpan, name: &str, row: &CadRow, remarks: &mut Vec<Diagnostic>) {
    let Some(volume) = row.volume.filter(|volume| *volume > 0.0) else {
        return;
    };
    let density = row.body.mass / volume;
    if !DENSITIES.contains(&density) {
        remarks.push(Diagnostic {
            severity: DiagnosticSeverity::Warning,
            label: format!("solids have {:.0} to {:.0} kg/m^3", DENSITIES.start(), DENSITIES.end()),
            help: vec!["check the units of mass and volume, and whether a material is assigned to the part".into()],
            ..plain_error(Some(place), format!("`{name}` has a density of {density:.3e} kg/m^3"))
        });
    }
}

/// Remarks on an inertia that is absent or incomplete, or that has few digits.
fn check_inertia(place: SourceSpan, name: &str, row: &CadRow, tensor: &Matrix3<f64>, remarks: &mut Vec<Diagnostic>) {
    let printed = &row.body;
    let mut remark = |message: String, help: &str| {
        remarks.push(Diagnostic {
            severity: DiagnosticSeverity::Warning,
            help: vec![help.into()],
            ..plain_error(Some(place), message)
        });
    };
    if printed.mass == 0.0 {
        return;
    }
    let Some(unit) = row.place else {
        remark(
            format!("no moments of inertia of `{name}` are stated: it is a point mass"),
            "add the columns `Ixx` to `Iyz` if the body rotates, or 0 for a point mass",
        );
        return;
    };
    let moments = tensor.diagonal();
    if printed.inertias.iter().all(|inertia| inertia.moments.amax() == 0.0) {
        remark(
            format!("all moments of inertia of `{name}` are zero: it is a point mass"),
            "export with more decimals, or in smaller units, unless this is so",
        );
        return;
    }
    if moments
        .iter()
        .any(|moment| *moment != 0.0 && moment.abs() < FEWEST_UNITS * unit)
    {
        remark(
            format!("moments of inertia of `{name}` about its centre of mass have fewer than three digits"),
            "export with more decimals, or in smaller units; trailing zeros count as digits",
        );
    }
    let is_spatial = moments.iter().filter(|moment| **moment != 0.0).count() > 1;
    if is_spatial && !row.has_products {
        remark(
            format!("not all products of inertia of `{name}` are stated: those that are absent are taken as zero"),
            "export the products too, or state 0",
        );
    }
}

/// One remark on a file whose products of inertia have a stated sign that nothing confirms.
fn sign_remark(index: usize, evidence: &[(String, SourceSpan, SignEvidence)]) -> Option<Diagnostic> {
    let (place, sign) = evidence.iter().find_map(|(_, place, sign)| match sign {
        SignEvidence::Stated(sign) => Some((*place, *sign)),
        _ => None,
    })?;
    let convention = match sign {
        ProductSign::Positive => "positive (integrals of x y dm)",
        ProductSign::Negative => "negative (entries of the tensor)",
    };
    Some(Diagnostic {
        severity: DiagnosticSeverity::Warning,
        help: vec!["export the inertia about the origin too, or the principal moments: they determine the sign".into()],
        ..plain_error(
            Some(SourceSpan { file: index, ..place }),
            format!("products of inertia are taken as {convention}, as stated; no other value of the file confirms it"),
        )
    })
}

/// A name as a word that rig files accept: other characters become `_`.
fn word_of(name: &str) -> String {
    let mut word: String = name
        .trim()
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if word.starts_with(|c: char| c.is_ascii_digit()) {
        word.insert(0, '_');
    }
    word
}
