//! A `Mechanism` goes in; the page gets the sections that describe geometry and masses as the model file states them.
//! Tables of frames, points, bodies and lumped masses.

use modelmill_spec::{
    CoordinateIdx, ExactExpression, FrameAxis, FrameConvention, FrameStep, FreeBody, Mechanism, ModelFrame,
    PartInertia, TwistAxes,
};

use super::document::{InlineSpan, PageBlock, PageDocument, PageTable, TextLine, cell, code, text};
use crate::expr::Rational;
use crate::expr::print::{PrintedFormula, angle_formula, exact_formula, length_formula};

/// The section of frames: Denavit-Hartenberg tables, one per convention, then transforms, then points.
pub(super) fn frames(page: &mut PageDocument, mechanism: &Mechanism) {
    page.heading("Frames");
    // The frame on which another one is mounted.
    let on = |frame: &ModelFrame| code(&*mechanism.frames[frame.parent.0].name);
    // The base frame at index 0 has no row.
    for (title, standard) in [
        (
            "Modified Denavit-Hartenberg parameters: Rx(alpha) Tx(a) Rz(theta) Tz(d) leads from a frame to the next.",
            false,
        ),
        (
            "Standard Denavit-Hartenberg parameters: Rz(theta) Tz(d) Tx(a) Rx(alpha) leads from a frame to the next.",
            true,
        ),
    ] {
        // One table per convention, with the frames that use it.
        let rows: Vec<Vec<TextLine>> = mechanism.frames[1..]
            .iter()
            .filter(|frame| match frame.convention {
                FrameConvention::ModifiedDh(_) => !standard,
                FrameConvention::StandardDh(_) => standard,
                FrameConvention::Base | FrameConvention::Transform(_) => false,
            })
            .map(|frame| {
                let mut row = vec![cell(code(&*frame.name)), cell(on(frame))];
                row.extend(dh_parameters(mechanism, frame).map(|x| cell(InlineSpan::Math(x))));
                row
            })
            .collect();
        // A convention that no frame uses has no table.
        if rows.is_empty() {
            continue;
        }
        page.paragraph([text(title)]);
        let head = vec!["frame", "on", "a", "alpha", "d", "theta"];
        page.blocks.push(PageBlock::Table(PageTable { head, rows }));
    }
    // Frames that are given by single rotations and translations.
    let rows: Vec<Vec<TextLine>> = mechanism.frames[1..]
        .iter()
        .filter(|frame| matches!(frame.convention, FrameConvention::Transform(_)))
        // Each step is written as `Rx(...)`, `Tz(...)`, in the order in which the file has them.
        .map(|frame| {
            let mut steps: TextLine = Vec::new();
            for step in &frame.steps {
                // Kind, axis and amount of one step.
                let (letter, axis, by) = match step {
                    // A floating body is described in words.
                    FrameStep::Free(body) => {
                        steps.extend(free_body_motion(mechanism, body));
                        continue;
                    }
                    FrameStep::Rotate(axis, by) => ("R", axis, angle_formula(mechanism, by)),
                    FrameStep::Translate(axis, by) => ("T", axis, length_formula(mechanism, by)),
                };
                // The letter of the axis becomes part of the name: `Rx`, `Tz`.
                let axis = match axis {
                    FrameAxis::X => "x",
                    FrameAxis::Y => "y",
                    FrameAxis::Z => "z",
                };
                // Steps are separated by blanks.
                let space = if steps.is_empty() { "" } else { " " };
                steps.push(text(format!("{space}{letter}{axis}(")));
                steps.push(InlineSpan::Math(by));
                steps.push(text(")"));
            }
            // A frame without steps coincides with its parent.
            if steps.is_empty() {
                steps.push(text("identity"));
            }
            vec![cell(code(&*frame.name)), cell(on(frame)), steps]
        })
        .collect();
    if !rows.is_empty() {
        page.paragraph([text(
            "Transforms: each rotation is about, and each translation along, the axes of the frame reached so far.",
        )]);
        let head = vec!["frame", "on", "transform"];
        page.blocks.push(PageBlock::Table(PageTable { head, rows }));
    }
    // Points with their frames and positions.
    let rows: Vec<Vec<TextLine>> = mechanism
        .points
        .iter()
        .map(|point| {
            vec![
                cell(code(&*point.name)),
                cell(code(&*mechanism.frames[point.frame.0].name)),
                vector(mechanism, &point.at),
            ]
        })
        .collect();
    if !rows.is_empty() {
        page.paragraph([text("Points, fixed to their frames.")]);
        let head = vec!["point", "on", "position in the frame, m"];
        page.table("points", PageTable { head, rows });
    }
}

/// The coordinates of a floating body and the axes in which its velocities and forces are given.
fn free_body_motion(mechanism: &Mechanism, body: &FreeBody) -> TextLine {
    // Names of the coordinates as a list.
    let names = |all: &[CoordinateIdx]| {
        let names = all.iter().map(|i| mechanism.coordinates[i.0].name.as_str());
        names.collect::<Vec<_>>().join(", ")
    };
    // The axes in words.
    let axes = |axes| match axes {
        TwistAxes::Body => "the body's axes",
        // Linear and angular quantities may use different axes.
        TwistAxes::World => "the base's axes",
    };
    vec![
        text("free: position ("),
        code(names(&body.position)),
        text("), quaternion w, x, y, z ("),
        code(names(&body.quaternion)),
        text(format!(
            "); velocity and force in {}, angular velocity and moment in {}",
            axes(body.linear),
            axes(body.angular)
        )),
    ]
}

/// Lengths a and d (m), angles alpha and theta (rad), in the order a, alpha, d, theta.
/// Steps about or along the same axis are summed.
fn dh_parameters(mechanism: &Mechanism, frame: &ModelFrame) -> [PrintedFormula; 4] {
    // The angle about an axis.
    let rotation = |wanted: FrameAxis| {
        PrintedFormula::sum(frame.steps.iter().filter_map(|step| match step {
            FrameStep::Rotate(axis, by) if *axis == wanted => Some(angle_formula(mechanism, by)),
            _ => None,
        }))
    };
    // The length along an axis.
    let translation = |wanted: FrameAxis| {
        PrintedFormula::sum(frame.steps.iter().filter_map(|step| match step {
            FrameStep::Translate(axis, by) if *axis == wanted => Some(length_formula(mechanism, by)),
            _ => None,
        }))
    };
    [
        // The convention has a along x, alpha about x, d along z and theta about z.
        translation(FrameAxis::X),
        rotation(FrameAxis::X),
        translation(FrameAxis::Z),
        rotation(FrameAxis::Z),
    ]
}

/// A vector with three components, in parentheses.
fn vector(mechanism: &Mechanism, at: &[ExactExpression; 3]) -> TextLine {
    let mut line = vec![text("(")];
    for (i, x) in at.iter().enumerate() {
        if i > 0 {
            line.push(text(", "));
        }
        line.push(InlineSpan::Math(exact_formula(mechanism, x)));
    }
    line.push(text(")"));
    line
}

/// The entries of an inertia that are not zero, each after its name, or `0`.
fn inertia_entries(mechanism: &Mechanism, names: [&str; 6], values: &[ExactExpression; 6]) -> TextLine {
    let mut line = Vec::new();
    for (name, value) in names.iter().zip(values) {
        // Most inertias have few entries.
        if value.is_zero() {
            continue;
        }
        if !line.is_empty() {
            line.push(text(", "));
        }
        line.push(text(format!("{name} ")));
        line.push(InlineSpan::Math(exact_formula(mechanism, value)));
    }
    if line.is_empty() {
        line.push(text("0"));
    }
    line
}

/// Entries of a symmetric matrix in the order of the model file.
const PLACES: [&str; 6] = ["xx", "xy", "xz", "yy", "yz", "zz"];

/// The section of bodies: parts given about their centre of mass, parts given linearly, lumped masses.
pub(super) fn bodies(page: &mut PageDocument, mechanism: &Mechanism) {
    page.heading("Bodies");
    let (mut about_centre, mut linear) = (Vec::new(), Vec::new());
    for part in &mechanism.parts {
        // Name and frame of a part.
        let start = vec![
            cell(text(&*part.name)),
            cell(code(&*mechanism.frames[part.frame.0].name)),
        ];
        // Both forms have the same three columns, but the meaning of the last two differs, so each has a table.
        let (rows, mass, place, inertia) = match &part.inertial {
            PartInertia::AboutCentre { mass, centre, inertia } => (&mut about_centre, mass, centre, inertia),
            PartInertia::Linear {
                mass,
                first_moment,
                inertia,
            } => (&mut linear, mass, first_moment, inertia),
        };
        // Mass, centre or first moment, and inertia.
        let mut row = start;
        row.push(cell(InlineSpan::Math(exact_formula(mechanism, mass))));
        row.push(vector(mechanism, place));
        row.push(inertia_entries(mechanism, PLACES, inertia));
        rows.push(row);
    }
    // Each form has its own table, because the third and fourth columns differ.
    if !about_centre.is_empty() {
        page.paragraph([text(
            "Each part has a mass, a centre of mass, and an inertia about the centre of mass in the frame's axes. \
             Entries not listed are zero.",
        )]);
        let head = vec!["part", "frame", "mass, kg", "centre, m", "inertia, kg m²"];
        page.table(
            "parts",
            PageTable {
                head,
                rows: about_centre,
            },
        );
    }
    if !linear.is_empty() {
        page.paragraph([text(
            "Each part has a mass, a first moment, and an inertia about the frame's origin. Entries not listed are zero.",
        )]);
        let head = vec!["part", "frame", "mass, kg", "first moment, kg m", "inertia, kg m²"];
        page.table("parts", PageTable { head, rows: linear });
    }
    lumped_masses(page, mechanism);
}

/// The table of lumped masses: a share of a mass at a point for forces and at a point for moments.
fn lumped_masses(page: &mut PageDocument, mechanism: &Mechanism) {
    if mechanism.lumped_masses.is_empty() {
        return;
    }
    page.paragraph([text("Lumped masses.")]);
    // Number of masses that act at two different points.
    let mut apart = 0;
    let rows = mechanism
        .lumped_masses
        .iter()
        .map(|lump| {
            // The share is exact, such as 1/2 of a rod's mass.
            let share = Rational::from(lump.share.clone());
            let mass = PrintedFormula::product(share, [exact_formula(mechanism, &lump.mass)]);
            // Usually both balances use the same point.
            let same = lump.force_at == lump.moment_at;
            apart += usize::from(!same);
            let moment = if same {
                cell(text("the same point"))
            } else {
                vector(mechanism, &lump.moment_at)
            };
            vec![
                cell(InlineSpan::Math(mass)),
                cell(code(&*mechanism.frames[lump.frame.0].name)),
                vector(mechanism, &lump.force_at),
                moment,
            ]
        })
        .collect();
    let head = vec![
        "mass, kg",
        "frame",
        "point in the balance of forces, m",
        "point in the balance of moments, m",
    ];
    page.table("lumped masses", PageTable { head, rows });
    // Such a mass belongs to a simplified model and not to a rigid body, which a reader has to know.
    if apart > 0 {
        // The noun in singular or plural.
        let n = if apart == 1 {
            "one mass".to_owned()
        } else {
            format!("{apart} masses")
        };
        page.paragraph([text(format!(
            "Note: the balance of forces and the balance of moments use different points for {n}. \
             This is not a rigid body; the model file states it so."
        ))]);
    }
}
