//! Checks the mechanism at its nominal pose: the loops must close there, they must determine the passive coordinates,
//! and the drives must act on all degrees of freedom.
//!
//! A mechanism goes in; its passive coordinates come out refined until the loops close. The refinement uses
//! Gauss-Newton steps with the damping of Levenberg and Marquardt.

use crate::build::MechanismSpans;
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::ModelSymbol;
use crate::kinematics::{Vec3, frame_poses, jacobian, position};
use crate::mechanism::{CoordinateCoupling, DriveKind, FrameStep, Mechanism};
use crate::numeric::{DenseRows, least_squares, rank};

/// Passive angles may change by this much, in rad, before the result counts as another assembly.
const FARTHEST_TURN: f64 = 0.5;
/// Loops must close to this tolerance, relative to the size of the mechanism.
const CLOSED: f64 = 1e-9;
/// Pivots below this share of the largest one count as zero.
const SINGULAR: f64 = 1e-8;
/// An equation whose remainder after elimination is below this share of the largest one counts as dependent. Rounded
/// digits of a file may leave such a remainder of an equation that follows from others.
const DEPENDENCE_TOLERANCE: f64 = 1e-5;

/// Checks the nominal pose and refines the passive coordinates there. Each check needs the ones before it.
pub(crate) fn check_pose(mechanism: &mut Mechanism, places: &MechanismSpans, log: &mut DiagnosticLog) {
    // Values that are not finite would make all other checks fail.
    if !check_finite(mechanism, places, log) {
        return;
    }
    // Then: the number of constraints, closure, the passive coordinates, and the drives.
    if check_constraint_count(mechanism, places, log)
        && close_loops(mechanism, places, log)
        && check_passive(mechanism, places, log)
    {
        check_drives(mechanism, places, log);
    }
}

/// Residuals of all constraints: three per loop, then one per coupling.
pub(crate) struct LoopGaps {
    /// Differences of the points of loops, m, then of coordinates that follow others, rad or m.
    pub(crate) values: Vec<f64>,
    /// Derivatives of the values by all coordinates.
    pub(crate) rows: DenseRows,
    /// Largest coordinate of a frame's origin or a point of a loop, m.
    pub(crate) size: f64,
}

/// Evaluates the constraints at the nominal values.
pub(crate) fn loop_gaps(mechanism: &Mechanism) -> LoopGaps {
    let poses = frame_poses(mechanism);
    let mut found = LoopGaps {
        values: Vec::new(),
        rows: Vec::new(),
        size: 0.0,
    };
    // Three rows per loop: differences of positions and of Jacobians.
    for closed in &mechanism.loops {
        let [one, other] = closed.joins.map(|point| position(mechanism, &poses, point));
        let left = jacobian(mechanism, &poses, closed.joins[0], one);
        let right = jacobian(mechanism, &poses, closed.joins[1], other);
        for k in 0..3 {
            found.values.push(one[k] - other[k]);
            found
                .rows
                .push(left[k].iter().zip(&right[k]).map(|(a, b)| a - b).collect());
            found.size = found.size.max(one[k].abs()).max(other[k].abs());
        }
    }
    // The size of the mechanism is the scale of all tolerances.
    for pose in &poses {
        found.size = pose.origin.iter().fold(found.size, |size, x| size.max(x.abs()));
    }
    // One row per coupling: the coordinate minus what it follows.
    let value = |symbol: ModelSymbol| mechanism.symbol_nominal(symbol);
    for (coupling, row) in mechanism.couplings.iter().zip(coupling_rows(mechanism)) {
        let own = mechanism.coordinates[coupling.coordinate.0].nominal;
        found.values.push(own - coupling.value(&value));
        found.rows.push(row);
    }
    found
}

/// Derivative of each coupling's residual by all coordinates: one row per coupling.
fn coupling_rows(mechanism: &Mechanism) -> DenseRows {
    let value = |symbol: ModelSymbol| mechanism.symbol_nominal(symbol);
    let row = |coupling: &CoordinateCoupling| {
        let mut row = vec![0.0; mechanism.coordinates.len()];
        // The derivative of the coordinate minus its value.
        row[coupling.coordinate.0] = 1.0;
        for (i, slope) in coupling.slopes(&value) {
            row[i.0] -= slope;
        }
        row
    };
    mechanism.couplings.iter().map(row).collect()
}

/// Euclidean norm.
fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Columns of the passive coordinates, or of the active ones.
///
/// `passive` selects which ones.
fn columns(mechanism: &Mechanism, rows: &DenseRows, passive: bool) -> DenseRows {
    rows.iter()
        .map(|row| {
            row.iter()
                .zip(&mechanism.coordinates)
                .filter(|(_, coordinate)| coordinate.passive == passive)
                .map(|(entry, _)| *entry)
                .collect()
        })
        .collect()
}

/// Reports lengths and positions without a finite value, such as the root of a negative number; true if there are
/// none.
fn check_finite(mechanism: &Mechanism, places: &MechanismSpans, log: &mut DiagnosticLog) -> bool {
    let before = log.n_errors();
    let value = |symbol: ModelSymbol| mechanism.symbol_nominal(symbol);
    // Messages name what has no value.
    let mut report = |span: Option<SourceSpan>, what: &str| {
        if let Some(span) = span {
            log.push(
                Diagnostic::error(span, format!("{what} has no finite value"))
                    .label("with the constants of this file")
                    .help(
                        "look for a division by zero, the root of a negative number, or a value that is far too large",
                    ),
            );
        }
    };
    // Frames: all angles and lengths of their steps.
    for (i, frame) in mechanism.frames.iter().enumerate() {
        let finite = frame.steps.iter().all(|step| match step {
            FrameStep::Rotate(_, angle) => angle.evaluate(&value).is_finite(),
            FrameStep::Translate(_, length) => length.evaluate(&value).abs() < 1e100,
            // Its coordinates are checked where they are read.
            FrameStep::Free(_) => true,
        });
        if !finite {
            report(places.frames.get(i).copied().flatten(), "the place of this frame");
        }
    }
    // Points: all entries of their positions.
    for (i, point) in mechanism.points.iter().enumerate() {
        if point
            .at
            .iter()
            .any(|at| at.evaluate(&value).abs() > 1e100 || at.evaluate(&value).is_nan())
        {
            report(places.points.get(i).copied(), "the position of this point");
        }
    }
    if mechanism
        .gravity
        .iter()
        .any(|entry| !entry.evaluate(&value).is_finite())
    {
        report(places.whole, "gravity");
    }
    log.n_errors() == before
}

/// Changes the passive coordinates until the loops close; false if they do not close, or only far from the given
/// values.
///
/// The nominal values of the passive coordinates in `mechanism` are the result.
fn close_loops(mechanism: &mut Mechanism, places: &MechanismSpans, log: &mut DiagnosticLog) -> bool {
    if mechanism.loops.is_empty() {
        return true;
    }
    let passive: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|&i| mechanism.coordinates[i].passive)
        .collect();
    // The given values are kept, to measure how far the coordinates moved.
    let given: Vec<f64> = passive.iter().map(|&i| mechanism.coordinates[i].nominal).collect();
    let ClosureResidual { gaps: now, size } = move_passive(mechanism, &passive);
    // Each loop that stays open is reported with its gap.
    let mut closes = true;
    for (i, closed) in mechanism.loops.iter().enumerate() {
        let gap = norm(&now.values[3 * i..3 * i + 3]);
        // Written so that a gap that is not a number counts as open.
        if gap <= CLOSED * size {
            continue;
        }
        closes = false;
        let [one, other] = closed.joins.map(|point| mechanism.points[point.0].name.as_str());
        log.push(
            Diagnostic::error(
                places.loops[i],
                format!("the loop `{}` does not close at the nominal pose", closed.name),
            )
            .label(format!("`{one}` and `{other}` stay {gap:.3} m apart"))
            .help("check the lengths, and the nominal values of the coordinates of both chains")
            .help("the values of passive coordinates are only a start: they are changed until the loops close, those of active ones stay fixed"),
        );
    }
    // The residuals of the couplings follow those of the loops.
    let followers = now.values[3 * mechanism.loops.len()..].iter();
    for (coupling, gap) in mechanism.couplings.iter().zip(followers) {
        if gap.abs() <= CLOSED * size.max(1.0) {
            continue;
        }
        closes = false;
        // The gap of a coupling is an angle or a length, in the unit of the coordinate.
        let coordinate = &mechanism.coordinates[coupling.coordinate.0];
        log.push(
            Diagnostic::error(
                places.coordinates[coupling.coordinate.0],
                format!(
                    "the loops contradict the coupling of `{}` at the nominal pose",
                    coordinate.name
                ),
            )
            .label(format!("it stays {gap:.3} {} away", coordinate.motion.unit()))
            .help("check what it follows, and the nominal values of the coordinates of the loops"),
        );
    }
    closes && check_same_assembly(mechanism, &passive, &given, size, places, log)
}

/// The smallest residual that the passive coordinates can reach.
struct ClosureResidual {
    /// The residual.
    gaps: LoopGaps,
    /// The size of the mechanism at the start, m.
    size: f64,
}

impl ClosureResidual {
    /// Whether all loops close; couplings are not checked here.
    fn is_closed(&self) -> bool {
        let mut loops = self.gaps.values.chunks(3);
        loops.all(|gap| norm(gap) <= CLOSED * self.size)
    }
}

/// Changes the passive coordinates until the residual is as small as possible, in at most 100 steps.
///
/// The Levenberg-Marquardt damping is scaled by the square of the size, as the entries of the normal equations are.
fn move_passive(mechanism: &mut Mechanism, passive: &[usize]) -> ClosureResidual {
    let at_start = loop_gaps(mechanism);
    // A lower limit of the size avoids tolerances of zero.
    let size = at_start.size.max(1e-6);
    let mut now = at_start;
    let mut damping = 1e-9;
    // A step that reduces the residual is kept and the damping decreases; otherwise the damping increases.
    for _ in 0..100 {
        if norm(&now.values) <= 1e-14 * size || passive.is_empty() {
            break;
        }
        // Singular equations get more damping and are solved again.
        let rows = columns(mechanism, &now.rows, true);
        let Some(step) = least_squares(&rows, &now.values, damping * size * size) else {
            damping = f64::max(damping * 10.0, 1e-12);
            continue;
        };
        // Take the step, and keep it only if the residual decreases.
        let before: Vec<f64> = passive.iter().map(|&i| mechanism.coordinates[i].nominal).collect();
        for (&i, change) in passive.iter().zip(&step) {
            mechanism.coordinates[i].nominal -= change;
        }
        let next = loop_gaps(mechanism);
        if norm(&next.values) < norm(&now.values) {
            now = next;
            damping *= 0.1;
        } else {
            for (&i, value) in passive.iter().zip(before) {
                mechanism.coordinates[i].nominal = value;
            }
            damping *= 10.0;
            if damping > 1e3 {
                break;
            }
        }
    }
    ClosureResidual { gaps: now, size }
}

/// Reports passive coordinates that moved far from their given values; true if there are none.
///
/// `given` are the values of the file, `size` the size of the mechanism, m.
fn check_same_assembly(
    mechanism: &Mechanism,
    passive: &[usize],
    given: &[f64],
    size: f64,
    places: &MechanismSpans,
    log: &mut DiagnosticLog,
) -> bool {
    let mut fine = true;
    for (&i, given) in passive.iter().zip(given) {
        let coordinate = &mechanism.coordinates[i];
        // Coordinates that follow others have no given value.
        let mut followers = mechanism.couplings.iter();
        if followers.any(|coupling| coupling.coordinate.0 == i) {
            continue; // Its value was not given by the author.
        }
        // The limit is an angle, or a share of the mechanism's size.
        let unit = coordinate.motion.unit();
        let farthest = if coordinate.motion.is_angle() {
            FARTHEST_TURN
        } else {
            0.3 * size
        };
        let way = (coordinate.nominal - given).abs();
        if way <= farthest {
            continue;
        }
        fine = false;
        log.push(
            Diagnostic::error(
                places.coordinates[i],
                format!("the loops do not close near the nominal value of `{}`", coordinate.name),
            )
            .label(format!(
                "given {given}, but the loops close at {:.4}, {way:.2} {unit} away",
                coordinate.nominal
            ))
            .help("the nominal values choose among the ways to assemble the mechanism, so they must be near the intended one")
            .help(format!(
                "if that is the assembly you mean, write `{} = {{ nominal = {:.4}, passive = true }}`",
                coordinate.name, coordinate.nominal
            )),
        );
    }
    fine
}

/// Derivative of the constraints as if both points of each loop coincided. With a remaining gap the loops would seem
/// to depend on coordinates that move both points together.
fn constraint_rows(mechanism: &Mechanism) -> DenseRows {
    let poses = frame_poses(mechanism);
    let mut rows = DenseRows::new();
    for closed in &mechanism.loops {
        // Both Jacobians are taken at the position of the first point.
        let at = position(mechanism, &poses, closed.joins[0]);
        let [left, right] = closed.joins.map(|point| jacobian(mechanism, &poses, point, at));
        for (left, right) in left.iter().zip(&right) {
            rows.push(left.iter().zip(right).map(|(a, b)| a - b).collect());
        }
    }
    rows.extend(coupling_rows(mechanism));
    rows
}

/// Checks that the loops do not constrain more coordinates than are passive, and that some coordinate is independent.
fn check_constraint_count(mechanism: &Mechanism, places: &MechanismSpans, log: &mut DiagnosticLog) -> bool {
    let passive: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|&i| mechanism.coordinates[i].passive)
        .collect();
    let n_passive = passive.len();
    // The number of independent equations at the nominal values.
    let mut n_equations = rank(&constraint_rows(mechanism), DEPENDENCE_TOLERANCE);
    if n_equations > n_passive {
        // Overconstrained linkages have dependent equations only where the loops close, so the count is repeated at
        // the closed pose. At rounded nominal values the equations seem independent.
        let mut closed = mechanism.clone();
        if move_passive(&mut closed, &passive).is_closed() {
            n_equations = rank(&constraint_rows(&closed), DEPENDENCE_TOLERANCE);
        }
    }
    let n_coordinates = mechanism.coordinates.len();
    // Normal case: enough passive coordinates, and at least one active one.
    if n_equations <= n_passive && n_passive < n_coordinates {
        return true;
    }
    // Without any place in the file there is nothing to report.
    let place = places.loops.first().or(places.coordinates.first());
    let Some(span) = place.copied() else {
        return false;
    };
    // First fault: every coordinate is passive.
    if n_equations < n_passive {
        log.push(
            Diagnostic::error(span, "all coordinates are passive")
                .label("expected at least one independent coordinate")
                .help("remove `passive` where a drive acts, or write `driven = false` where nothing does"),
        );
        return false;
    }
    // Second fault: the equations leave no degree of freedom.
    if n_equations >= n_coordinates {
        log.push(
            Diagnostic::error(
                span,
                format!(
                    "this mechanism cannot move: its loops constrain {} {}",
                    if n_coordinates == 1 { "its" } else { "all" },
                    plural(n_coordinates, "coordinate")
                ),
            )
            .label(format!(
                "{} at the nominal pose, and no degree of freedom",
                plural(n_equations, "independent loop equation")
            ))
            .help(
                "each `[[loop]]` joins two points, which constrains up to 2 coordinates in a plane and 3 in space: look for a loop or a link too many, or for a joint that \
                 is missing (a `[[frame]]` with a coordinate of its own)",
            )
            .help(
                "a linkage that moves against this count, as a parallelogram with a third bar does, moves for exact lengths \
                 only: check the constants",
            ),
        );
        return false;
    }
    // Third fault: too few passive coordinates.
    log.push(
        Diagnostic::error(
            span,
            format!(
                "the loops constrain {}, but {} passive",
                plural(n_equations, "coordinate"),
                if n_passive == 1 {
                    "1 is".to_owned()
                } else {
                    format!("{n_passive} are")
                }
            ),
        )
        .label(format!(
            "{} at the nominal pose",
            plural(n_equations, "independent loop equation")
        ))
        .help(format!(
            "mark {} more as `passive = true`, or give the mechanism another joint",
            plural(n_equations - n_passive, "coordinate")
        )),
    );
    false
}

/// A number with its noun, such as `2 coordinates`.
fn plural(n: usize, one: &str) -> String {
    format!("{n} {one}{}", if n == 1 { "" } else { "s" })
}

/// Checks that the loops determine the passive coordinates: their columns must have full rank.
fn check_passive(mechanism: &Mechanism, places: &MechanismSpans, log: &mut DiagnosticLog) -> bool {
    let passive: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|&i| mechanism.coordinates[i].passive)
        .collect();
    // The rank of the passive columns, and that of all columns.
    let rows = loop_gaps(mechanism).rows;
    let settled = rank(&columns(mechanism, &rows, true), SINGULAR);
    let equations = rank(&rows, SINGULAR);
    if settled == passive.len() {
        return true;
    }
    // Report a coordinate that is not determined: without its column the rank stays the same.
    let left_over = passive.iter().enumerate().rev().find(|(k, _)| {
        let mut without = columns(mechanism, &rows, true);
        for row in &mut without {
            row.remove(*k);
        }
        rank(&without, SINGULAR) == settled
    });
    let i = left_over.map_or(passive[0], |(_, &i)| i);
    let diagnostic = Diagnostic::error(
        places.coordinates[i],
        format!("the loops do not determine `{}`", mechanism.coordinates[i].name),
    );
    // If the equations are enough, only the pose is singular; otherwise a loop is missing.
    log.push(if equations > settled {
        diagnostic
            .label("at the nominal pose this passive coordinate is free to move")
            .help("the nominal pose is singular: choose another one, or make other coordinates passive")
    } else {
        diagnostic
            .label(format!(
                "{} at the nominal pose for {}",
                plural(equations, "independent loop equation"),
                plural(passive.len(), "passive coordinate")
            ))
            .help("close another loop, or drive this coordinate and drop `passive`")
            .help("if the loops should determine it, the nominal pose is singular: choose another one")
    });
    false
}

/// Checks that the drives' rates determine the rates of the degrees of freedom at the nominal pose.
///
/// Rows are drives, columns active coordinates; passive rates are eliminated by the derivative of the loops.
fn check_drives(mechanism: &Mechanism, places: &MechanismSpans, log: &mut DiagnosticLog) {
    let found = loop_gaps(mechanism);
    let poses = frame_poses(mechanism);
    let mut rates: DenseRows = Vec::new();
    // One row per drive: the derivative of its angle or length by all coordinates.
    for (i, drive) in mechanism.drives.iter().enumerate() {
        let mut row = vec![0.0; mechanism.coordinates.len()];
        match drive.kind {
            DriveKind::Joint(coordinate) => row[coordinate.0] = 1.0,
            DriveKind::Linear { from, to } => {
                // The rate of a linear drive is the velocity of its end relative to its start, along the drive.
                let (start, end) = (position(mechanism, &poses, from), position(mechanism, &poses, to));
                // A linear drive without a length has no direction.
                let along: Vec3 = std::array::from_fn(|k| end[k] - start[k]);
                let length = norm(&along);
                if length.is_nan() || length <= 1e-12 * found.size {
                    log.push(
                        Diagnostic::error(
                            places.drives[i],
                            format!("the drive `{}` has no length at the nominal pose", drive.name),
                        )
                        .label("its two points coincide there, so its force has no direction"),
                    );
                    return;
                }
                let tail = jacobian(mechanism, &poses, from, start);
                let head = jacobian(mechanism, &poses, to, end);
                for k in 0..3 {
                    for (j, entry) in row.iter_mut().enumerate() {
                        *entry += along[k] / length * (head[k][j] - tail[k][j]);
                    }
                }
            }
        }
        rates.push(row);
    }
    // Rates of the passive coordinates follow from those of the active ones by the derivative of the loops.
    let dependent = columns(mechanism, &found.rows, true);
    let independent = columns(mechanism, &found.rows, false);
    let direct = columns(mechanism, &rates, false);
    let through = columns(mechanism, &rates, true);
    // The number of degrees of freedom, without scalar parts of quaternions.
    let n_active = direct.first().map_or(0, Vec::len);
    let rated = mechanism
        .coordinates
        .iter()
        .filter(|c| !c.passive && c.motion.has_rate());
    let n_freedoms = rated.count();
    let mut total = direct;
    // For each active coordinate: the rates of the passive ones, and their part in the rates of the drives.
    for j in 0..n_active {
        if dependent.first().is_none_or(Vec::is_empty) {
            break;
        }
        let driven: Vec<f64> = independent.iter().map(|row| -row[j]).collect();
        let Some(passive_rates) = least_squares(&dependent, &driven, 0.0) else {
            return;
        };
        for (row, through) in total.iter_mut().zip(&through) {
            row[j] += through.iter().zip(&passive_rates).map(|(a, b)| a * b).sum::<f64>();
        }
    }
    // Lengths and angles have different units, so each row is scaled to length one.
    for row in &mut total {
        let size = norm(row);
        if size > 0.0 {
            for entry in row {
                *entry /= size;
            }
        }
    }
    // The drives determine the motion if this matrix has full rank.
    let held = rank(&total, 1e-7);
    if held < n_freedoms {
        // The mark is on a drive without any effect, or on the last one.
        let weakest = total
            .iter()
            .position(|row| norm(row) == 0.0)
            .unwrap_or_else(|| mechanism.drives.len().saturating_sub(1));
        if let Some(span) = places.drives.get(weakest) {
            log.push(
                Diagnostic::error(
                    *span,
                    format!("the drives act on only {held} of {n_freedoms} degrees of freedom at the nominal pose"),
                )
                .label("the rate of this drive depends on those of the other drives there")
                .help("choose a nominal pose away from this singularity, or drive another coordinate"),
            );
        }
    }
}
