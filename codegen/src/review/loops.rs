//! Loops and drives: closure equations, how they are solved, and what the drives see.

use modelmill_spec::{Carries, DriveKind, Mechanism};

use super::document::{Block, Document, Equation, Inline, Line, Table, cell, code, text};
use crate::expr::print::{Formula, angle_sum, formula, tree_size};
use crate::expr::{ExprId, Graph, Rational, nominal_value};
use crate::{Derivation, PassivePosition};

/// Expressions with more nodes than this are shown in a program rather than in one line.
const LONGEST: usize = 70;

fn names(mechanism: &Mechanism, coordinates: &[usize]) -> Line {
    let mut line = Line::new();
    for (i, c) in coordinates.iter().enumerate() {
        if i > 0 {
            line.push(text(if i + 1 == coordinates.len() {
                " and "
            } else {
                ", "
            }));
        }
        line.push(Inline::Math(Formula::name(
            &*mechanism.coordinates[*c].name,
        )));
    }
    line
}

fn shown(graph: &Graph, mechanism: &Mechanism, id: ExprId) -> Option<Formula> {
    (tree_size(graph, id, LONGEST) < LONGEST).then(|| formula(graph, mechanism, id))
}

/// Closure equations and the way from the active to the passive coordinates.
pub(super) fn loops(page: &mut Document, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        programs,
        equations,
        ..
    } = derivation;
    let projection = &equations.projection;
    couplings(page, derivation);
    if mechanism.loops.is_empty() {
        return;
    }
    page.heading("Loops");
    let mut tag = 0;
    for (l, closure) in mechanism.loops.iter().zip(&projection.loops.closures) {
        let [a, b] = l.joins.map(|p| code(&*mechanism.points[p.0].name));
        let plane = if closure.chain.is_some() {
            "; the loop is planar"
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
        let lines = closure
            .residual
            .iter()
            .filter_map(|id| {
                tag += 1;
                Some(Equation {
                    left: Formula::integer(0),
                    right: shown(graph, mechanism, *id)?,
                    tag: format!("L{tag}"),
                    unit: None,
                })
            })
            .collect();
        page.equations("closure equations", lines);
    }
    match &programs.passive_position {
        PassivePosition::None => {}
        PassivePosition::Closed => solved_in_closed_form(page, derivation),
        PassivePosition::Newton { .. } => {
            let mut line = vec![text("The passive coordinates ")];
            line.extend(names(mechanism, &projection.loops.passive));
            line.push(text(
                " follow by Newton's method on the closure equations, started from the nominal pose or the pose before, \
                 which keeps to the assembly mode of the model file.",
            ));
            page.paragraph(line);
        }
    }
    let determinants: Vec<Equation> = projection
        .determinants
        .iter()
        .enumerate()
        .filter_map(|(k, id)| {
            Some(Equation {
                left: Formula::name(format!("Delta_{}", k + 1)),
                right: shown(graph, mechanism, *id)?,
                tag: format!("L{}", tag + k + 1),
                unit: None,
            })
        })
        .collect();
    let mut says = "Their rates and accelerations follow from the differentiated closure equations, which are linear in them."
        .to_owned();
    if determinants.is_empty() {
        says.push_str(" A pose where their matrix is singular is reported as such.");
    } else {
        says.push_str(" The mechanism is singular, and the model says so, where a determinant of theirs or of the drives' Jacobian vanishes:");
    }
    page.paragraph([text(says)]);
    page.equations("determinants", determinants);
}

/// What follows other coordinates.
fn couplings(page: &mut Document, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        equations,
        ..
    } = derivation;
    let closures = equations.projection.loops.closures.iter();
    let mut lines = Vec::new();
    for follower in closures.filter_map(|closure| closure.follower.as_ref()) {
        let Some(right) = shown(graph, mechanism, follower.value) else {
            continue;
        };
        lines.push(Equation {
            left: Formula::name(&*mechanism.coordinates[follower.coordinate].name),
            right,
            tag: format!("C{}", lines.len() + 1),
            unit: None,
        });
    }
    if lines.is_empty() {
        return;
    }
    page.heading("Couplings");
    page.paragraph([text(
        "These coordinates follow others, and their rates and accelerations do alike. Forces on them act on what they \
         follow, times the factor.",
    )]);
    page.equations("couplings", lines);
}

fn solved_in_closed_form(page: &mut Document, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        closing,
        ..
    } = derivation;
    let Some(plan) = closing.plan() else {
        return;
    };
    let mut related = Vec::new();
    let is_follower = |i: &usize| {
        let mut couplings = mechanism.couplings.iter();
        couplings.any(|coupling| coupling.coordinate.0 == *i)
    };
    for step in &plan.steps {
        if step.unknown.iter().all(is_follower) {
            continue;
        }
        for relation in &step.solved.relations {
            let offset = Rational::new(i64::from(relation.pi12), 12);
            related.push(Equation {
                left: Formula::name(&*mechanism.coordinates[relation.coordinate].name),
                right: Formula::sum([
                    angle_sum(mechanism, &relation.sum),
                    Formula::product(offset, [Formula::name("pi")]),
                ]),
                tag: format!("P{}", related.len() + 1),
                unit: None,
            });
        }
        if !step.solved.relations.is_empty() {
            continue;
        }
        let mut line = names(mechanism, &step.unknown);
        line.push(text(match step.solved.values.len() {
            0 => " follow in closed form as the intersection of two circles",
            1 => " follow in closed form as the intersection of a circle and a line",
            _ => " follow from two linear equations",
        }));
        if let Some(root) = step.solved.root {
            let sign = if nominal_value(graph, mechanism, root.witness).is_none_or(|x| x >= 0.0) {
                "positive"
            } else {
                "negative"
            };
            line.push(text(format!(
                "; the nominal pose chooses the {sign} root. Where the radicand is negative the pose is out of reach"
            )));
        }
        line.push(text("."));
        page.paragraph(line);
    }
    if !related.is_empty() {
        page.paragraph([text(
            "Around the nominal pose these passive angles are tied to others outright, which closes their loops identically:",
        )]);
        page.equations("relations", related);
    }
}

/// Drives with their coordinates and Jacobian.
pub(super) fn drives(page: &mut Document, derivation: &Derivation) {
    let Derivation {
        mechanism,
        graph,
        equations,
        ..
    } = derivation;
    let projection = &equations.projection;
    page.heading("Drives");
    let mut any_linear = false;
    let rows = mechanism
        .drives
        .iter()
        .map(|drive| {
            let acts = match drive.kind {
                DriveKind::Joint(i) => {
                    let coordinate = &mechanism.coordinates[i.0];
                    let kind = match coordinate.motion.carries() {
                        Carries::Torque => "torque on ",
                        _ => "force on ",
                    };
                    vec![text(kind), Inline::Math(Formula::name(&*coordinate.name))]
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
    page.table(
        "drives",
        Table {
            head: vec!["drive", "acts as"],
            rows,
        },
    );
    let mut lines = Vec::new();
    for (d, drive) in mechanism.drives.iter().enumerate() {
        if matches!(drive.kind, DriveKind::Joint(_)) {
            continue;
        }
        let mut line = |left: String, id: ExprId| {
            if id == Graph::ZERO {
                return None;
            }
            let right = shown(graph, mechanism, id)?;
            let tag = format!("D{}", lines.len() + 1);
            lines.push(Equation {
                left: Formula::name(left),
                right,
                tag,
                unit: None,
            });
            Some(())
        };
        line(format!("l_{}", drive.name), projection.drives[d].coordinate);
        for (a, slope) in projection
            .loops
            .active
            .iter()
            .zip(&projection.drive_jacobian[d])
        {
            let coordinate = &mechanism.coordinates[*a].name;
            line(format!("J_{}_{coordinate}", drive.name), *slope);
        }
    }
    if any_linear {
        page.paragraph([text(
            "Lengths of the linear drives, and their derivatives by the independent coordinates, the Jacobian J; what is not listed is zero. \
             By virtual power J' f equals the generalised forces of the independent coordinates.",
        )]);
        page.blocks.push(Block::Equations(lines));
    }
}
