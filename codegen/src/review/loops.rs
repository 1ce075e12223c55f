//! The sections of loops and drives: closure equations, how they are solved, drive lengths and the Jacobian of the
//! drives.

use modelmill_spec::{DriveKind, Mechanism, PlaceLoad};

use super::document::{InlineSpan, PageBlock, PageDocument, PageEquation, PageTable, TextLine, cell, code, text};
use crate::expr::print::{PrintedFormula, angle_sum_formula, formula, tree_size};
use crate::expr::{ExprId, Graph, Rational, nominal_value};
use crate::{Derivation, PassivePosition};

/// Expressions with more nodes than this are shown in a program rather than in one line.
const LONGEST: usize = 70;

/// Names of coordinates as a list: `a, b and c`.
fn coordinate_names(mechanism: &Mechanism, coordinates: &[usize]) -> TextLine {
    let mut line = TextLine::new();
    for (i, c) in coordinates.iter().enumerate() {
        if i > 0 {
            line.push(text(if i + 1 == coordinates.len() { " and " } else { ", " }));
        }
        line.push(InlineSpan::Math(PrintedFormula::name(&*mechanism.coordinates[*c].name)));
    }
    line
}

/// The formula of an expression, or `None` if it is too long for a line.
fn short_formula(graph: &Graph, mechanism: &Mechanism, id: ExprId) -> Option<PrintedFormula> {
    (tree_size(graph, id, LONGEST) < LONGEST).then(|| formula(graph, mechanism, id))
}

/// Adds couplings, closure equations, and the solution for the passive coordinates.
pub(super) fn loops(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        programs,
        equations,
        ..
    } = derivation;
    // Couplings have a section of their own, which a mechanism without loops has as well.
    let projection = &equations.projection;
    list_couplings(page, derivation);
    if mechanism.loops.is_empty() {
        return;
    }
    page.heading("Loops");
    // The tag counts all closure equations, so that a missing number shows that a long one was left out.
    let mut tag = 0;
    for (l, closure) in mechanism.loops.iter().zip(&projection.loops.closures) {
        // The two points that coincide.
        let [a, b] = l.joins.map(|p| code(&*mechanism.points[p.0].name));
        // A chain of links exists for planar loops only.
        let plane = if closure.chain.is_some() {
            "; the loop is planar"
        } else if closure.residual.is_empty() {
            "; the other loops close it"
        } else {
            ""
        };
        page.paragraph([
            text("Loop "),
            code(&*l.name),
            text(": "),
            a,
            text(" and "),
            b,
            text(format!(" coincide{plane}.")),
        ]);
        // Equations that fit into a line.
        let lines = closure
            .residual
            .iter()
            .filter_map(|id| {
                tag += 1;
                Some(PageEquation {
                    left: PrintedFormula::integer(0),
                    right: short_formula(graph, mechanism, *id)?,
                    tag: format!("L{tag}"),
                    unit: None,
                })
            })
            .collect();
        page.equations("closure equations", lines);
    }
    // How the passive coordinates are computed: not at all, in closed form, or iteratively.
    match &programs.passive_position {
        PassivePosition::None => {}
        // Closed form: the steps of the solution.
        PassivePosition::Closed => list_closed_form(page, derivation),
        // Iterative: the list of the coordinates is enough.
        PassivePosition::Newton { .. } => {
            let mut line = vec![text("The passive coordinates ")];
            line.extend(coordinate_names(mechanism, &projection.loops.passive));
            line.push(text(
                " are computed by Newton's method on the closure equations, started from the nominal pose or the previous pose. \
                 This keeps the assembly mode of the model file.",
            ));
            page.paragraph(line);
        }
    }
    // Determinants of the linear equations of the rates and of the drives' Jacobian.
    let determinants: Vec<PageEquation> = projection
        .determinants
        .iter()
        .enumerate()
        .filter_map(|(k, id)| {
            Some(PageEquation {
                left: PrintedFormula::name(format!("Delta_{}", k + 1)),
                right: short_formula(graph, mechanism, *id)?,
                tag: format!("L{}", tag + k + 1),
                unit: None,
            })
        })
        .collect();
    let mut says =
        "Their rates and accelerations are the solutions of linear equations, the derivatives of the closure equations."
            .to_owned();
    // Determinants that are too long are not listed.
    if determinants.is_empty() {
        says.push_str(" Poses where the matrix of these equations is singular are reported.");
    } else {
        says.push_str(
            " Poses where a determinant of these equations or of the drives' Jacobian is zero are singular, and are \
             reported. The determinants are:",
        );
    }
    page.paragraph([text(says)]);
    page.equations("determinants", determinants);
}

/// The section of couplings: coordinates that are given functions of others.
fn list_couplings(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        equations,
        ..
    } = derivation;
    // Couplings are closures with a coordinate that others determine.
    let closures = equations.projection.loops.closures.iter();
    let mut lines = Vec::new();
    for follower in closures.filter_map(|closure| closure.follower.as_ref()) {
        // A long coupling is left out.
        let Some(right) = short_formula(graph, mechanism, follower.value) else {
            continue;
        };
        lines.push(PageEquation {
            left: PrintedFormula::name(&*mechanism.coordinates[follower.coordinate].name),
            right,
            tag: format!("C{}", lines.len() + 1),
            unit: None,
        });
    }
    if lines.is_empty() {
        return;
    }
    // Equations of all couplings together.
    page.heading("Couplings");
    page.paragraph([text(
        "These coordinates are determined by others, and so are their rates and accelerations. A force on one of them acts \
         on the coordinates that determine it, times the factor.",
    )]);
    page.equations("couplings", lines);
}

/// The solution in closed form, step by step; a step solves for one or two passive coordinates.
fn list_closed_form(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        closing,
        ..
    } = derivation;
    let Some(plan) = closing.plan() else {
        return;
    };
    // Relations between angles of parallelograms and the like are gathered and shown at the end.
    let mut related = Vec::new();
    // Whether a coordinate is determined by a coupling.
    let is_follower = |i: &usize| {
        let mut couplings = mechanism.couplings.iter();
        couplings.any(|coupling| coupling.coordinate.0 == *i)
    };
    // Steps of couplings only are shown in their own section.
    for step in &plan.steps {
        if step.unknown.iter().all(is_follower) {
            continue;
        }
        for relation in &step.solved.relations {
            // Offsets are multiples of pi/12.
            let offset = Rational::new(i64::from(relation.pi12), 12);
            related.push(PageEquation {
                left: PrintedFormula::name(&*mechanism.coordinates[relation.coordinate].name),
                right: PrintedFormula::sum([
                    angle_sum_formula(mechanism, &relation.sum),
                    PrintedFormula::product(offset, [PrintedFormula::name("pi")]),
                ]),
                tag: format!("P{}", related.len() + 1),
                unit: None,
            });
        }
        if !step.solved.relations.is_empty() {
            continue;
        }
        // The unknowns of the step, and how they are solved for.
        let mut line = coordinate_names(mechanism, &step.unknown);
        // How many unknowns of the step are values and not angles states its kind.
        line.push(text(match step.solved.values.len() {
            0 => " are determined in closed form as the intersection of two circles",
            1 => " are determined in closed form as the intersection of a circle and a line",
            _ => " are determined by two linear equations",
        }));
        // The sign of a square root chooses the assembly mode; it is that of the nominal pose.
        if let Some(root) = step.solved.root {
            let sign = if nominal_value(graph, mechanism, root.witness).is_none_or(|x| x >= 0.0) {
                "positive"
            } else {
                "negative"
            };
            line.push(text(format!(
                "; of the two solutions, the nominal pose selects the one with the {sign} square root. Where the expression under the \
                 root is negative, the pose cannot be reached"
            )));
        }
        line.push(text("."));
        page.paragraph(line);
    }
    if !related.is_empty() {
        page.paragraph([text(
            "Around the nominal pose these relations between angles close their loops identically:",
        )]);
        page.equations("relations", related);
    }
}

/// The section of drives: where each acts; for linear drives also length and derivatives by the independent
/// coordinates.
pub(super) fn drives(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        equations,
        ..
    } = derivation;
    let projection = &equations.projection;
    page.heading("Drives");
    // Whether the paragraph on lengths is needed.
    let mut any_linear = false;
    let rows = mechanism
        .drives
        .iter()
        // A joint drive acts on a coordinate, a linear drive between two points.
        .map(|drive| {
            // What the force acts on, and its sign.
            let acts = match drive.kind {
                DriveKind::Joint(i) => {
                    // A joint drive acts on its coordinate.
                    let coordinate = &mechanism.coordinates[i.0];
                    // Torque or force, by the motion of the coordinate.
                    let kind = match coordinate.motion.place_load() {
                        PlaceLoad::Torque => "torque on ",
                        _ => "force on ",
                    };
                    vec![text(kind), InlineSpan::Math(PrintedFormula::name(&*coordinate.name))]
                }
                DriveKind::Linear { from, to } => {
                    any_linear = true;
                    vec![
                        text("force from "),
                        code(&*mechanism.points[from.0].name),
                        text(" to "),
                        code(&*mechanism.points[to.0].name),
                        text(", positive when it pushes them apart"),
                    ]
                }
            };
            vec![cell(code(&*drive.name)), acts]
        })
        .collect();
    // All drives, joint drives as well.
    page.table(
        "drives",
        PageTable {
            head: vec!["drive", "acts as"],
            rows,
        },
    );
    // Only linear drives are listed: their lengths are new quantities.
    let mut lines = Vec::new();
    // The tag counts all equations, so that a missing number shows that a long one was left out, and comments of
    // emitted code refer to the same numbers.
    let mut tag = 0;
    for (d, drive) in mechanism.drives.iter().enumerate() {
        if matches!(drive.kind, DriveKind::Joint(_)) {
            continue;
        }
        // Entries that are zero or too long for a line are left out.
        let mut line = |left: String, id: ExprId| {
            if id == Graph::ZERO {
                return None;
            }
            tag += 1;
            let right = short_formula(graph, mechanism, id)?;
            lines.push(PageEquation {
                left: PrintedFormula::name(left),
                right,
                tag: format!("D{tag}"),
                unit: None,
            });
            Some(())
        };
        // The length.
        line(format!("l_{}", drive.name), projection.drives[d].coordinate);
        // The row of the Jacobian.
        for (a, slope) in projection.loops.active.iter().zip(&projection.drive_jacobian[d]) {
            let coordinate = &mechanism.coordinates[*a].name;
            line(format!("J_{}_{coordinate}", drive.name), *slope);
        }
    }
    if any_linear {
        page.paragraph([text(
            "Lengths of the linear drives and their derivatives with respect to the independent coordinates, the Jacobian J. \
             Entries that are zero are not listed; long entries are shown only in the programs below. \
             By the principle of virtual power, J^T f is the generalised force of the independent coordinates.",
        )]);
        page.blocks.push(PageBlock::Equations(lines));
    }
}
