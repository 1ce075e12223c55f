//! A body that is cut free: its shape, the axes of components at its origin, and arrows of the forces and moments at
//! its cuts.

use std::fmt::Write as _;

use modelmill_boundary::text::html as escape;
use nalgebra::Vector3;

use crate::labels::LabelLayout;
use crate::loads::{arrow_head, circular_arrow};
use crate::paint::{DrawingSheet, DrawingStyle, frame_picture};
use crate::scene::{MarkShape, MechanismScene};
use crate::symbols;
use crate::view::ViewDirection;

/// A force or moment at a cut of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct CutArrow {
    /// The place at which it acts, in the base frame, m.
    pub at: Vector3<f64>,
    /// How it is drawn.
    pub kind: CutArrowKind,
    /// Its name, with the sign with which it acts on the body.
    pub name: String,
}

/// How the arrow of a force or moment is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CutArrowKind {
    /// A force along a known direction in the base frame.
    Force(Vector3<f64>),
    /// A weight along the direction of gravity in the base frame.
    Weight(Vector3<f64>),
    /// A force of unknown direction: the arrow points away from the body.
    UnknownForce,
    /// A moment of unknown sense.
    UnknownMoment,
}

/// What is drawn of a body.
#[derive(Clone, Copy, Debug)]
pub struct FreeBodyDrawing<'a> {
    /// A frame of the body.
    pub frame: &'a str,
    /// The origin of its moments, in the base frame, m.
    pub origin: Vector3<f64>,
    /// The axes of components in the base frame, with their names; an axis without a name is left out.
    pub axes: [(Vector3<f64>, &'a str); 3],
    /// Forces and moments.
    pub arrows: &'a [CutArrow],
}

/// Length of an arrow, in units of the picture.
const ARROW_LENGTH: f64 = 62.0;
/// Length of the axes at the origin, in units of the picture.
const AXIS_LENGTH: f64 = 40.0;
/// Margin around the body for arrows and their names, in units of the picture.
const BODY_MARGIN: f64 = 105.0;
/// Share of a turn of the arrow of a moment.
const MOMENT_TURN: f64 = 0.8;
/// Shortest projection of a direction, relative to its length, that is drawn as an arrow and not as a dot.
const END_ON: f64 = 0.05;

/// The body of `drawing` alone as an inline SVG, seen in the view of its mechanism.
pub fn free_body_svg(
    scene: &MechanismScene,
    view: &ViewDirection,
    style: &DrawingStyle,
    drawing: &FreeBodyDrawing<'_>,
) -> String {
    let body = cut_free(scene, drawing);
    let sheet = DrawingSheet::with_margin(&[&body], view, style, BODY_MARGIN);
    let mut inner = sheet.paint_scene(&body);
    let mut labels = LabelLayout::new(style.width, style.height);
    let origin = sheet.project_point(&drawing.origin);
    let axes = drawing.axes.map(|(axis, _)| sheet.project_direction(&axis));
    let shown = [0, 1, 2].map(|k| {
        if drawing.axes[k].1.is_empty() {
            [0.0; 2]
        } else {
            axes[k]
        }
    });
    let names = drawing.axes.map(|(_, name)| name);
    _ = write!(
        inner,
        "<g class=\"furniture\">{}</g>",
        symbols::axes(origin, &shown, AXIS_LENGTH, names)
    );
    for axis in shown {
        labels.occupy([0, 1].map(|k| origin[k] + AXIS_LENGTH * axis[k]), 12.0);
    }
    let middle = [0.5 * style.width, 0.5 * style.height];
    let arrows: Vec<DrawnArrow> = spread_arrows(&sheet, drawing, middle);
    for arrow in &arrows {
        labels.occupy(arrow.from, 8.0);
        labels.occupy(arrow.tip, 5.0);
    }
    let mut text = String::new();
    for (arrow, drawn) in drawing.arrows.iter().zip(&arrows) {
        let title = escape(&arrow.name);
        _ = writeln!(
            inner,
            "<g class=\"load {}\"><title>{title}</title>{}</g>",
            drawn.class, drawn.drawing
        );
        if let Some(place) = labels.place_label(drawn.tip, arrow.name.chars().count()) {
            text.push_str(&place.paint(drawn.tip, &title, drawn.class));
        }
    }
    for arrow in drawing.arrows {
        inner.push_str(&symbols::point(sheet.project_point(&arrow.at)));
    }
    if let Some(place) = labels.place_label(origin, 1) {
        text.push_str(&place.paint(origin, "O", ""));
    }
    _ = writeln!(inner, "<g class=\"names\">{text}</g>");
    let names: Vec<&str> = drawing.arrows.iter().map(|arrow| arrow.name.as_str()).collect();
    let says = format!("the body of {} cut free, with {}", drawing.frame, names.join(", "));
    frame_picture(style, "", &says, &inner)
}

/// The marks of the body alone; joints become cuts, which the arrows show.
fn cut_free(scene: &MechanismScene, drawing: &FreeBodyDrawing<'_>) -> MechanismScene {
    let is_frame = |shape: &MarkShape| matches!(shape, MarkShape::Frame(..));
    let named = scene
        .marks
        .iter()
        .find(|mark| is_frame(&mark.shape) && mark.name == drawing.frame);
    let body = named.map(|mark| mark.body);
    let mut alone = scene.clone();
    alone.marks.retain(|mark| {
        let shown = matches!(
            mark.shape,
            MarkShape::Bar(_) | MarkShape::Arm(_) | MarkShape::Plate(_) | MarkShape::Centre(..) | MarkShape::Lump(..)
        );
        shown && Some(mark.body) == body
    });
    alone
}

/// An arrow as it is drawn.
struct DrawnArrow {
    /// Its first point.
    from: [f64; 2],
    /// The point next to which its name stands.
    tip: [f64; 2],
    /// Its class.
    class: &'static str,
    /// The drawing.
    drawing: String,
}

/// Arrows of all forces; unknown forces at one place point in different directions.
fn spread_arrows(sheet: &DrawingSheet<'_>, drawing: &FreeBodyDrawing<'_>, middle: [f64; 2]) -> Vec<DrawnArrow> {
    let mut drawn: Vec<DrawnArrow> = Vec::new();
    for arrow in drawing.arrows {
        let from = sheet.project_point(&arrow.at);
        let one = match arrow.kind {
            CutArrowKind::Force(direction) => straight(sheet, from, &direction, "e0", ARROW_LENGTH),
            CutArrowKind::Weight(direction) => straight(sheet, from, &direction, "e2", 0.75 * ARROW_LENGTH),
            CutArrowKind::UnknownForce => {
                // Away from the middle of the body.
                let away = [from[0] - middle[0], from[1] - middle[1]];
                let length = away[0].hypot(away[1]);
                let away = if length > 1.0 {
                    away.map(|x| x / length)
                } else {
                    [-0.7, 0.7]
                };
                segment(from, away, "e4", ARROW_LENGTH)
            }
            CutArrowKind::UnknownMoment => DrawnArrow {
                from,
                tip: [from[0] + 19.0, from[1] - 12.0],
                class: "e4",
                drawing: circular_arrow(from, MOMENT_TURN),
            },
        };
        drawn.push(one);
    }
    drawn
}

/// An arrow along a direction of the base frame; a dot if it points at the viewer.
fn straight(
    sheet: &DrawingSheet<'_>,
    from: [f64; 2],
    direction: &Vector3<f64>,
    class: &'static str,
    length: f64,
) -> DrawnArrow {
    let projected = sheet.project_direction(direction);
    let size = projected[0].hypot(projected[1]);
    if size <= END_ON * direction.norm() {
        return DrawnArrow {
            from,
            tip: from,
            class,
            drawing: symbols::point(from),
        };
    }
    segment(from, projected.map(|x| x / size), class, length)
}

/// An arrow from a point along a unit vector of the picture.
fn segment(from: [f64; 2], along: [f64; 2], class: &'static str, length: f64) -> DrawnArrow {
    let tip = [0, 1].map(|k| from[k] + length * along[k]);
    let drawing = format!(
        "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\"/>{}",
        from[0],
        from[1],
        tip[0],
        tip[1],
        arrow_head(tip, along)
    );
    DrawnArrow {
        from,
        tip,
        class,
        drawing,
    }
}
