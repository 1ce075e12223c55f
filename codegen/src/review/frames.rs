//! Tables of frames, points, bodies and lumped masses.

use modelmill_spec::{
    CoordinateIdx, ExactExpression, FrameAxis, FrameConvention, FrameStep, FreeBody, Mechanism,
    ModelFrame, PartInertia, TwistAxes,
};

use super::document::{InlineSpan, PageBlock, PageDocument, PageTable, TextLine, cell, code, text};
use crate::expr::Rational;
use crate::expr::print::{PrintedFormula, angle_formula, exact_formula, length_formula};

/// Frames and points.
pub(super) fn frames(page: &mut PageDocument, mechanism: &Mechanism) {
    page.heading("Frames");
    let on = |frame: &ModelFrame| code(&*mechanism.frames[frame.parent.0].name);
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
        if rows.is_empty() {
            continue;
        }
        page.paragraph([text(title)]);
        let head = vec!["frame", "on", "a", "alpha", "d", "theta"];
        page.blocks.push(PageBlock::Table(PageTable { head, rows }));
    }
    let rows: Vec<Vec<TextLine>> = mechanism.frames[1..]
        .iter()
        .filter(|frame| matches!(frame.convention, FrameConvention::Transform(_)))
        .map(|frame| {
            let mut steps: TextLine = Vec::new();
            for step in &frame.steps {
                let (letter, axis, by) = match step {
                    FrameStep::Free(body) => {
                        steps.extend(free_body_motion(mechanism, body));
                        continue;
                    }
                    FrameStep::Rotate(axis, by) => ("R", axis, angle_formula(mechanism, by)),
                    FrameStep::Translate(axis, by) => ("T", axis, length_formula(mechanism, by)),
                };
                let axis = match axis {
                    FrameAxis::X => "x",
                    FrameAxis::Y => "y",
                    FrameAxis::Z => "z",
                };
                let space = if steps.is_empty() { "" } else { " " };
                steps.push(text(format!("{space}{letter}{axis}(")));
                steps.push(InlineSpan::Math(by));
                steps.push(text(")"));
            }
            if steps.is_empty() {
                steps.push(text("the same place"));
            }
            vec![cell(code(&*frame.name)), cell(on(frame)), steps]
        })
        .collect();
    if !rows.is_empty() {
        page.paragraph([text(
            "Transforms, each rotation and translation about and along the axes reached so far.",
        )]);
        let head = vec!["frame", "on", "transform"];
        page.blocks.push(PageBlock::Table(PageTable { head, rows }));
    }
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

/// What a body that hangs on nothing moves by.
fn free_body_motion(mechanism: &Mechanism, body: &FreeBody) -> TextLine {
    let names = |all: &[CoordinateIdx]| {
        let names = all.iter().map(|i| mechanism.coordinates[i.0].name.as_str());
        names.collect::<Vec<_>>().join(", ")
    };
    let axes = |axes| match axes {
        TwistAxes::Body => "the body's axes",
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

/// a, alpha, d, theta of a frame in a Denavit-Hartenberg convention.
fn dh_parameters(mechanism: &Mechanism, frame: &ModelFrame) -> [PrintedFormula; 4] {
    let rotation = |wanted: FrameAxis| {
        PrintedFormula::sum(frame.steps.iter().filter_map(|step| match step {
            FrameStep::Rotate(axis, by) if *axis == wanted => Some(angle_formula(mechanism, by)),
            _ => None,
        }))
    };
    let translation = |wanted: FrameAxis| {
        PrintedFormula::sum(frame.steps.iter().filter_map(|step| match step {
            FrameStep::Translate(axis, by) if *axis == wanted => {
                Some(length_formula(mechanism, by))
            }
            _ => None,
        }))
    };
    [
        translation(FrameAxis::X),
        rotation(FrameAxis::X),
        translation(FrameAxis::Z),
        rotation(FrameAxis::Z),
    ]
}

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

/// The entries of an inertia that are not zero, with their places.
fn inertia_entries(
    mechanism: &Mechanism,
    names: [&str; 6],
    values: &[ExactExpression; 6],
) -> TextLine {
    let mut line = Vec::new();
    for (name, value) in names.iter().zip(values) {
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

const PLACES: [&str; 6] = ["xx", "xy", "xz", "yy", "yz", "zz"];

/// Parts and lumped masses.
pub(super) fn bodies(page: &mut PageDocument, mechanism: &Mechanism) {
    page.heading("Bodies");
    let (mut about_centre, mut linear) = (Vec::new(), Vec::new());
    for part in &mechanism.parts {
        let start = vec![
            cell(text(&*part.name)),
            cell(code(&*mechanism.frames[part.frame.0].name)),
        ];
        let (rows, mass, place, inertia) = match &part.inertial {
            PartInertia::AboutCentre {
                mass,
                centre,
                inertia,
            } => (&mut about_centre, mass, centre, inertia),
            PartInertia::Linear {
                mass,
                first_moment,
                inertia,
            } => (&mut linear, mass, first_moment, inertia),
        };
        let mut row = start;
        row.push(cell(InlineSpan::Math(exact_formula(mechanism, mass))));
        row.push(vector(mechanism, place));
        row.push(inertia_entries(mechanism, PLACES, inertia));
        rows.push(row);
    }
    if !about_centre.is_empty() {
        page.paragraph([text(
            "Parts by mass, centre of mass, and inertia about the centre along the frame's axes; what is not listed is zero.",
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
            "Parts by mass, first moment, and inertia about the frame's origin; what is not listed is zero.",
        )]);
        let head = vec![
            "part",
            "frame",
            "mass, kg",
            "first moment, kg m",
            "inertia, kg m²",
        ];
        page.table("parts", PageTable { head, rows: linear });
    }
    lumped_masses(page, mechanism);
}

fn lumped_masses(page: &mut PageDocument, mechanism: &Mechanism) {
    if mechanism.lumped_masses.is_empty() {
        return;
    }
    page.paragraph([text("Lumped masses.")]);
    let mut apart = 0;
    let rows = mechanism
        .lumped_masses
        .iter()
        .map(|lump| {
            let share = Rational::from(lump.share.clone());
            let mass = PrintedFormula::product(share, [exact_formula(mechanism, &lump.mass)]);
            let same = lump.force_at == lump.moment_at;
            apart += usize::from(!same);
            let moment = if same {
                cell(text("the same place"))
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
        "the balance of forces sees it at, m",
        "the balance of moments sees it at, m",
    ];
    page.table("lumped masses", PageTable { head, rows });
    if apart > 0 {
        let n = if apart == 1 {
            "one mass".to_owned()
        } else {
            format!("{apart} masses")
        };
        page.paragraph([text(format!(
            "Note: the balance of forces and the balance of moments see {n} at different places. \
             This is no rigid body; the file asks for it."
        ))]);
    }
}
