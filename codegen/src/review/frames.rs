//! Tables of frames, points, bodies and lumped masses.

use modelmill_spec::{
    Axis, Convention, CoordinateIdx, Exact, Frame, FreeBody, Inertial, Mechanism, Step, TwistAxes,
};

use super::document::{Block, Document, Inline, Line, Table, cell, code, text};
use crate::expr::Rational;
use crate::expr::print::{Formula, angle, exact, length};

/// Frames and points.
pub(super) fn frames(page: &mut Document, mechanism: &Mechanism) {
    page.heading("Frames");
    let on = |frame: &Frame| code(&*mechanism.frames[frame.parent.0].name);
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
        let rows: Vec<Vec<Line>> = mechanism.frames[1..]
            .iter()
            .filter(|frame| match frame.convention {
                Convention::ModifiedDh(_) => !standard,
                Convention::StandardDh(_) => standard,
                Convention::Base | Convention::Transform(_) => false,
            })
            .map(|frame| {
                let mut row = vec![cell(code(&*frame.name)), cell(on(frame))];
                row.extend(dh(mechanism, frame).map(|x| cell(Inline::Math(x))));
                row
            })
            .collect();
        if rows.is_empty() {
            continue;
        }
        page.paragraph([text(title)]);
        let head = vec!["frame", "on", "a", "alpha", "d", "theta"];
        page.blocks.push(Block::Table(Table { head, rows }));
    }
    let rows: Vec<Vec<Line>> = mechanism.frames[1..]
        .iter()
        .filter(|frame| matches!(frame.convention, Convention::Transform(_)))
        .map(|frame| {
            let mut steps: Line = Vec::new();
            for step in &frame.steps {
                let (letter, axis, by) = match step {
                    Step::Free(body) => {
                        steps.extend(free_body(mechanism, body));
                        continue;
                    }
                    Step::Rotate(axis, by) => ("R", axis, angle(mechanism, by)),
                    Step::Translate(axis, by) => ("T", axis, length(mechanism, by)),
                };
                let axis = match axis {
                    Axis::X => "x",
                    Axis::Y => "y",
                    Axis::Z => "z",
                };
                let space = if steps.is_empty() { "" } else { " " };
                steps.push(text(format!("{space}{letter}{axis}(")));
                steps.push(Inline::Math(by));
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
        page.blocks.push(Block::Table(Table { head, rows }));
    }
    let rows: Vec<Vec<Line>> = mechanism
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
        page.table("points", Table { head, rows });
    }
}

/// What a body that hangs on nothing moves by.
fn free_body(mechanism: &Mechanism, body: &FreeBody) -> Line {
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
fn dh(mechanism: &Mechanism, frame: &Frame) -> [Formula; 4] {
    let rotation = |wanted: Axis| {
        Formula::sum(frame.steps.iter().filter_map(|step| match step {
            Step::Rotate(axis, by) if *axis == wanted => Some(angle(mechanism, by)),
            _ => None,
        }))
    };
    let translation = |wanted: Axis| {
        Formula::sum(frame.steps.iter().filter_map(|step| match step {
            Step::Translate(axis, by) if *axis == wanted => Some(length(mechanism, by)),
            _ => None,
        }))
    };
    [
        translation(Axis::X),
        rotation(Axis::X),
        translation(Axis::Z),
        rotation(Axis::Z),
    ]
}

fn vector(mechanism: &Mechanism, at: &[Exact; 3]) -> Line {
    let mut line = vec![text("(")];
    for (i, x) in at.iter().enumerate() {
        if i > 0 {
            line.push(text(", "));
        }
        line.push(Inline::Math(exact(mechanism, x)));
    }
    line.push(text(")"));
    line
}

/// The entries of an inertia that are not zero, with their places.
fn entries(mechanism: &Mechanism, names: [&str; 6], values: &[Exact; 6]) -> Line {
    let mut line = Vec::new();
    for (name, value) in names.iter().zip(values) {
        if value.is_zero() {
            continue;
        }
        if !line.is_empty() {
            line.push(text(", "));
        }
        line.push(text(format!("{name} ")));
        line.push(Inline::Math(exact(mechanism, value)));
    }
    if line.is_empty() {
        line.push(text("0"));
    }
    line
}

const PLACES: [&str; 6] = ["xx", "xy", "xz", "yy", "yz", "zz"];

/// Parts and lumped masses.
pub(super) fn bodies(page: &mut Document, mechanism: &Mechanism) {
    page.heading("Bodies");
    let (mut about_centre, mut linear) = (Vec::new(), Vec::new());
    for part in &mechanism.parts {
        let start = vec![
            cell(text(&*part.name)),
            cell(code(&*mechanism.frames[part.frame.0].name)),
        ];
        let (rows, mass, place, inertia) = match &part.inertial {
            Inertial::AboutCentre {
                mass,
                centre,
                inertia,
            } => (&mut about_centre, mass, centre, inertia),
            Inertial::Linear {
                mass,
                first_moment,
                inertia,
            } => (&mut linear, mass, first_moment, inertia),
        };
        let mut row = start;
        row.push(cell(Inline::Math(exact(mechanism, mass))));
        row.push(vector(mechanism, place));
        row.push(entries(mechanism, PLACES, inertia));
        rows.push(row);
    }
    if !about_centre.is_empty() {
        page.paragraph([text(
            "Parts by mass, centre of mass, and inertia about the centre along the frame's axes; what is not listed is zero.",
        )]);
        let head = vec!["part", "frame", "mass, kg", "centre, m", "inertia, kg m²"];
        page.table(
            "parts",
            Table {
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
        page.table("parts", Table { head, rows: linear });
    }
    lumped_masses(page, mechanism);
}

fn lumped_masses(page: &mut Document, mechanism: &Mechanism) {
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
            let mass = Formula::product(share, [exact(mechanism, &lump.mass)]);
            let same = lump.force_at == lump.moment_at;
            apart += usize::from(!same);
            let moment = if same {
                cell(text("the same place"))
            } else {
                vector(mechanism, &lump.moment_at)
            };
            vec![
                cell(Inline::Math(mass)),
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
    page.table("lumped masses", Table { head, rows });
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
