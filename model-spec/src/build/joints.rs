//! Joints as elementary motions: one rotation or translation per coordinate.
//!
//! The entry `joint` of a frame goes in; steps from the parent frame come out. A free body with a quaternion is one
//! step.

use num_traits::One;

use crate::build::frames::{angle_or_zero, length_or_zero};
use crate::build::symbols::SymbolTable;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::{CoordinateIdx, ExactExpression, ModelSymbol};
use crate::formula::{FormulaAstKind, SourceFormula};
use crate::joint_motion::CoordinateMotion;
use crate::mechanism::{FrameAxis, FrameStep, FreeBody, TwistAxes};
use crate::record::EntryList;
use crate::schema::JointEntry;
use crate::scope::SymbolSort;
use crate::values::{AxisName, QuaternionOrder, TwistName};

/// The coordinates of a joint with several of them, each with its kind of motion.
///
/// Joints with one coordinate are not listed; their expression may be more than a name.
pub(super) fn coordinates(joint: &JointEntry) -> Vec<(&SourceFormula, CoordinateMotion)> {
    let motion = |is_angle| {
        if is_angle {
            CoordinateMotion::Revolute
        } else {
            CoordinateMotion::Prismatic
        }
    };
    // Only one of the lists is present in a valid joint.
    let mut all: Vec<(&SourceFormula, CoordinateMotion)> = Vec::new();
    // Seven coordinates: three of the position, four of the quaternion, whose scalar part comes first or last.
    if let Some(list) = joint.free.as_ref().filter(|list| list.entries.len() == 7) {
        let scalar = match joint.quaternion {
            Some(QuaternionOrder::Wxyz) => 3,
            _ => 6,
        };
        let entries = list.entries.iter().enumerate();
        return entries
            .map(|(i, formula)| match i {
                0..3 => (formula, CoordinateMotion::Prismatic),
                _ if i == scalar => (formula, CoordinateMotion::QuaternionScalar),
                _ => (formula, CoordinateMotion::Quaternion),
            })
            .collect();
    }
    // The number of coordinates at the start that are lengths; a cylindrical joint starts with its angle.
    for (list, n_lengths) in [(&joint.universal, 0), (&joint.spherical, 0), (&joint.free, 3)] {
        let entries = list.iter().flat_map(|list| &list.entries).enumerate();
        all.extend(entries.map(|(i, formula)| (formula, motion(i >= n_lengths))));
    }
    // A cylindrical joint has its angle first, then its displacement.
    let cylindrical = joint.cylindrical.iter().flat_map(|list| &list.entries);
    all.extend(cylindrical.enumerate().map(|(i, formula)| (formula, motion(i == 0))));
    all
}

/// Appends the motions of a joint to `steps`, and its description to `text`.
///
/// A joint without a kind, or with several of them, is reported and has no steps.
pub(super) fn steps(
    joint: &JointEntry,
    symbols: &SymbolTable,
    steps: &mut Vec<FrameStep>,
    text: &mut Vec<String>,
    log: &mut DiagnosticLog,
) {
    // Exactly one kind of joint must be given.
    let n_kinds = [joint.revolute.is_some(), joint.prismatic.is_some()]
        .into_iter()
        .chain([&joint.cylindrical, &joint.universal, &joint.spherical, &joint.free].map(Option::is_some))
        .filter(|given| *given)
        .count();
    if n_kinds != 1 {
        if !log.syntax_broken && !joint.faulty {
            log.push(
                Diagnostic::error(joint.span, "this joint does not specify how it moves")
                    .label("expected one of `revolute`, `prismatic`, `cylindrical`, `universal`, `spherical`, `free`")
                    .help(
                        "for example `joint = { revolute = \"q1\", axis = \"z\" }`; omit `joint` where nothing moves",
                    ),
            );
        }
        return;
    }
    // Axis and direction of joints with one axis.
    let (axis, minus, shown) = axis_of(joint);
    let mut builder = Builder { symbols, steps, log };
    // `entries` below checks the number of coordinates of joints with several of them.
    // A revolute and a prismatic joint have one step each.
    if let Some(formula) = &joint.revolute {
        text.push(format!("revolute({}, {shown})", formula.text));
        builder.rotate(axis, minus, formula);
    } else if let Some(formula) = &joint.prismatic {
        text.push(format!("prismatic({}, {shown})", formula.text));
        builder.translate(axis, minus, formula);
    } else if let Some([angle, length]) = builder.entries(joint.cylindrical.as_ref(), "an angle and a displacement") {
        text.push(format!("cylindrical({}, {}, {shown})", angle.text, length.text));
        builder.rotate(axis, minus, &angle);
        builder.translate(axis, minus, &length);
    } else if let Some(angles) = builder.entries::<2>(joint.universal.as_ref(), "two angles") {
        builder.rotations("universal", joint, &angles, text);
    } else if let Some(angles) = builder.entries::<3>(joint.spherical.as_ref(), "three angles") {
        builder.rotations("spherical", joint, &angles, text);
    } else if joint.free.as_ref().is_some_and(|list| list.entries.len() == 7) {
        builder.free_body(joint, text);
    } else if let Some([x, y, z, a, b, c]) = builder.entries(
        joint.free.as_ref(),
        "three coordinates of its position and three angles, or seven with a quaternion",
    ) {
        // The six coordinates of a free joint: translations along x, y and z, then three rotations.
        text.push(format!("translation({}, {}, {})", x.text, y.text, z.text));
        for (axis, formula) in [(FrameAxis::X, x), (FrameAxis::Y, y), (FrameAxis::Z, z)] {
            builder.translate(axis, false, &formula);
        }
        builder.rotations("spherical", joint, &[a, b, c], text);
    }
    reject_unused_axes(joint, log);
}

/// Reports axes, a quaternion or a twist that the joint cannot use.
///
/// `axis` belongs to joints with one axis, `axes` to those with several, `quaternion` and `twist` to free bodies.
fn reject_unused_axes(joint: &JointEntry, log: &mut DiagnosticLog) {
    let has_quaternion = joint.free.as_ref().is_some_and(|list| list.entries.len() == 7);
    if (joint.quaternion.is_some() || joint.twist.is_some()) && !has_quaternion {
        log.push(
            Diagnostic::error(joint.span, "`quaternion` and `twist` do not apply to this joint")
                .label("they belong to `free` with seven coordinates: three of the position and four of a quaternion"),
        );
    }
    // The orientation of a body with a quaternion needs no axes.
    if has_quaternion {
        if joint.axis.is_some() || joint.axes.is_some() {
            log.push(
                Diagnostic::error(joint.span, "a body with a quaternion has no axes").label("delete `axis` or `axes`"),
            );
        }
        return;
    }
    // Joints with one axis use `axis`, all others use `axes`.
    let one = joint.revolute.is_some() || joint.prismatic.is_some() || joint.cylindrical.is_some();
    let (unused, wanted) = if one {
        (
            joint.axes.as_ref().map(|axes| axes.span),
            "`axis`, such as `axis = \"x\"`",
        )
    } else {
        let given = joint.axis.map(|_| joint.span);
        (given, "`axes`, such as `axes = \"xy\"`")
    };
    if let Some(span) = unused {
        let (has, several) = if one {
            ("one axis", "`axes`")
        } else {
            ("several axes", "`axis`")
        };
        log.push(
            Diagnostic::error(span, format!("this joint has {has}; {several} does not apply to it"))
                .label(format!("expected {wanted}")),
        );
    }
}

/// The axis of a joint, whether its direction is negative, and its name; z if the file gives none.
fn axis_of(joint: &JointEntry) -> (FrameAxis, bool, &'static str) {
    match joint.axis.unwrap_or(AxisName::Z) {
        AxisName::X => (FrameAxis::X, false, "x"),
        AxisName::Y => (FrameAxis::Y, false, "y"),
        AxisName::Z => (FrameAxis::Z, false, "z"),
        AxisName::MinusX => (FrameAxis::X, true, "-x"),
        AxisName::MinusY => (FrameAxis::Y, true, "-y"),
        AxisName::MinusZ => (FrameAxis::Z, true, "-z"),
    }
}

/// Builds the steps of one joint.
struct Builder<'a> {
    /// Names that expressions may use.
    symbols: &'a SymbolTable,
    /// Steps of the frame so far.
    steps: &'a mut Vec<FrameStep>,
    /// Receives faults.
    log: &'a mut DiagnosticLog,
}

impl Builder<'_> {
    /// The coordinates of a joint with `N` of them; another number is reported.
    ///
    /// `expected` describes the coordinates for the message.
    fn entries<const N: usize>(
        &mut self,
        list: Option<&EntryList<SourceFormula>>,
        expected: &str,
    ) -> Option<[SourceFormula; N]> {
        let list = list?;
        let found: Option<[SourceFormula; N]> = list.entries.clone().try_into().ok();
        if found.is_none() && !list.faulty {
            self.log.push(
                Diagnostic::error(
                    list.span,
                    format!("this joint has {N} coordinates, not {}", list.entries.len()),
                )
                .label(format!("expected {expected}")),
            );
        }
        found
    }

    /// Adds the step of a free body with a quaternion.
    ///
    /// `text` gets its description. Its coordinates, the order of its quaternion and the axes of its twist must be
    /// given.
    fn free_body(&mut self, joint: &JointEntry, text: &mut Vec<String>) {
        let Some(list) = &joint.free else { return };
        let (Some(order), Some(twist)) = (joint.quaternion, joint.twist) else {
            if !joint.faulty {
                self.log.push(
                    Diagnostic::error(joint.span, "a free body with a quaternion needs two more entries")
                        .label("expected `quaternion` and `twist`")
                        .help("`quaternion = \"xyzw\"` or `\"wxyz\"` is the order of its last four coordinates")
                        .help("`twist = \"body\"`, `\"world\"` or `\"mixed\"` are the axes of velocity and force, angular velocity and moment"),
                );
            }
            return;
        };
        // Its coordinates must be plain names, all different.
        let found: Vec<CoordinateIdx> = list
            .entries
            .iter()
            .filter_map(|formula| self.coordinate(formula))
            .collect();
        let Ok([x, y, z, a, b, c, d]) = <[CoordinateIdx; 7]>::try_from(found) else {
            return;
        };
        // The scalar part comes first, whatever the order of the file.
        let quaternion = match order {
            QuaternionOrder::Xyzw => [d, a, b, c],
            QuaternionOrder::Wxyz => [a, b, c, d],
        };
        let all = [x, y, z, a, b, c, d];
        // A coordinate in two roles would tie them to each other.
        if let Some(k) = (1..7).find(|k| all[..*k].contains(&all[*k])) {
            self.log.push(
                Diagnostic::error(list.entries[k].ast.span, "this coordinate is listed twice")
                    .label("expected seven different ones"),
            );
            return;
        }
        // Axes of velocity, then of angular velocity, and their name for print.
        let (linear, angular, axes) = match twist {
            TwistName::Body => (TwistAxes::Body, TwistAxes::Body, "body"),
            TwistName::World => (TwistAxes::World, TwistAxes::World, "world"),
            TwistName::Mixed => (TwistAxes::World, TwistAxes::Body, "mixed"),
        };
        let names: Vec<&str> = list.entries.iter().map(|formula| formula.text.as_str()).collect();
        let order = match order {
            QuaternionOrder::Xyzw => "xyzw",
            QuaternionOrder::Wxyz => "wxyz",
        };
        text.push(format!("free({}, {order}, twist {axes})", names.join(", ")));
        self.steps.push(FrameStep::Free(FreeBody {
            position: [x, y, z],
            quaternion,
            linear,
            angular,
        }));
    }

    /// The coordinate that a formula consists of; anything else is reported.
    fn coordinate(&mut self, formula: &SourceFormula) -> Option<CoordinateIdx> {
        // A free body needs names, because its rates are those of the body itself.
        let FormulaAstKind::Name(name) = &formula.ast.kind else {
            self.log.push(
                Diagnostic::error(formula.ast.span, "a free body takes names of coordinates only")
                    .label("expected the name of a coordinate"),
            );
            return None;
        };
        let span = formula.ast.span;
        let scope = &self.symbols.scope;
        let meaning = scope.look_up(name, span, &[SymbolSort::Coordinate], self.log)?;
        match meaning.exact {
            ExactExpression::Symbol(ModelSymbol::Coordinate(idx)) => Some(idx),
            _ => None,
        }
    }

    /// Adds a rotation about an axis; `minus` reverses its direction.
    fn rotate(&mut self, axis: FrameAxis, minus: bool, formula: &SourceFormula) {
        // The negative angle: all terms change their sign, and so does the multiple of pi.
        let mut about = angle_or_zero(Some(formula), self.symbols, self.log);
        if minus {
            if !about.pi.is_one() {
                about.pi = -about.pi; // Half a turn is the same in both directions.
            }
            for term in &mut about.terms {
                term.1 = -term.1;
            }
        }
        self.steps.push(FrameStep::Rotate(axis, about));
    }

    /// Adds a translation along an axis; `minus` reverses its direction.
    fn translate(&mut self, axis: FrameAxis, minus: bool, formula: &SourceFormula) {
        // The negative length: the offset and all factors change their sign.
        let mut along = length_or_zero(Some(formula), self.symbols, "the length of a joint", self.log);
        if minus {
            along.offset = match along.offset {
                ExactExpression::Rational(value) => ExactExpression::Rational(-value),
                other => ExactExpression::Negative(Box::new(other)),
            };
            for term in &mut along.coordinates {
                term.1 = -term.1.clone();
            }
        }
        self.steps.push(FrameStep::Translate(axis, along));
    }

    /// Adds rotations about several axes, each turned by those before. The letters of `axes` give the order.
    ///
    /// `kind` is the name of the joint for `text`. Without `axes` they are xy or zyx.
    fn rotations(&mut self, kind: &str, joint: &JointEntry, angles: &[SourceFormula], text: &mut Vec<String>) {
        // The order of the axes, from the file or the default.
        let given = joint.axes.as_ref();
        let usual = if angles.len() == 2 { "xy" } else { "zyx" };
        let written = given.map_or(usual, |axes| axes.text.as_str());
        let axes: Vec<Option<FrameAxis>> = written
            .chars()
            .map(|letter| match letter {
                'x' => Some(FrameAxis::X),
                'y' => Some(FrameAxis::Y),
                'z' => Some(FrameAxis::Z),
                _ => None,
            })
            .collect();
        // Equal neighbours would be one rotation with two coordinates.
        let is_fine = axes.len() == angles.len()
            && axes.iter().all(Option::is_some)
            && axes.windows(2).all(|pair| pair[0] != pair[1]);
        if !is_fine {
            let span = given.map_or(joint.span, |axes| axes.span);
            self.log.push(
                Diagnostic::error(span, "these are not the axes of this joint")
                    .label(format!(
                        "expected {} of the letters x, y and z, no two neighbours equal",
                        angles.len()
                    ))
                    .help(format!("for example `axes = \"{usual}\"`")),
            );
        }
        let names: Vec<&str> = angles.iter().map(|angle| angle.text.as_str()).collect();
        text.push(format!("{kind}({}, {written})", names.join(", ")));
        // A letter that is not an axis was reported; z replaces it so that the frame keeps its coordinates.
        for (axis, angle) in axes.into_iter().zip(angles) {
            self.rotate(axis.unwrap_or(FrameAxis::Z), false, angle);
        }
    }
}
