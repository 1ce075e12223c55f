//! A scene as SVG without scripts: all marks sorted from far to near, each with its description as a title.

use std::fmt::Write as _;

use modelmill_boundary::text::html as escape;
use nalgebra::Vector3;

use crate::labels::LabelLayout;
use crate::loads::{DriveArrow, drive_arrow};
use crate::scene::{MarkShape, MechanismScene, SceneMark};
use crate::symbols::{self, SymbolPlace};
use crate::view::ViewDirection;

/// Colours and strokes, for light and dark mode.
const STYLE: &str = include_str!("picture.css");
/// Margin around the mechanism, in units of the picture.
const MARGIN: f64 = 46.0;
/// The namespace that a stand-alone SVG file needs.
const NAMESPACE: &str = " xmlns=\"http://www.w3.org/2000/svg\"";
/// Distance of each layer of symbols in front of the one below it, in units of the picture.
const LAYER_SPACING: f64 = 8.0;
/// Length of a rail beyond its ends, in units of the picture.
const RAIL_OVERHANG: f64 = 30.0;
/// Number of colours of bodies in the style.
const COLOURS: usize = 8;

/// Options of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawingStyle {
    /// Width in units of the picture; it is scaled with the page.
    pub width: f64,
    /// Height in units of the picture.
    pub height: f64,
    /// Whether names are always visible; otherwise only under the pointer.
    pub names: bool,
    /// Whether the axes of frames are drawn.
    pub frames: bool,
}

impl Default for DrawingStyle {
    fn default() -> Self {
        Self {
            width: 640.0,
            height: 480.0,
            names: true,
            frames: false,
        }
    }
}

/// Scenes on top of each other, in one view: the last one in colour, those before it as shadows.
///
/// The text begins with `<svg`, contains its style, and can be part of a page or a file.
pub fn svg(scenes: &[&MechanismScene], view: &ViewDirection, style: &DrawingStyle) -> String {
    loaded_svg(scenes, view, style, &[])
}

/// The same with forces of drives as arrows over the last scene. Empty if there are no scenes.
pub fn loaded_svg(
    scenes: &[&MechanismScene],
    view: &ViewDirection,
    style: &DrawingStyle,
    loads: &[DriveArrow],
) -> String {
    let paper = DrawingSheet::new(scenes, view, style);
    let mut body = String::new();
    let [shadows @ .., scene] = scenes else {
        return body;
    };
    for shadow in shadows {
        let inner = paper.paint_scene(shadow);
        _ = write!(body, "<g class=\"shadow\">{inner}</g>");
    }
    body.push_str(&paper.paint_scene(scene));
    body.push_str(&paper.paint_drive_arrows(scene, loads));
    body.push_str(&paper.paint_axes_and_scale_bar(scene));
    body.push_str(&paper.paint_labels(scene));
    let says = describe_scene(scene);
    frame_picture(style, NAMESPACE, &says, &body)
}

/// A picture from its content and a description for readers who cannot see it; `namespace` is empty inside a page.
pub(crate) fn frame_picture(style: &DrawingStyle, namespace: &str, says: &str, body: &str) -> String {
    let names = if style.names { " named" } else { "" };
    format!(
        "<svg{namespace} class=\"mechanism{names}\" role=\"img\" \
         viewBox=\"0 0 {:.0} {:.0}\">\n<title>{}</title>\n<style>{STYLE}</style>\n\
         <rect class=\"paper\" width=\"100%\" height=\"100%\"/>\n{body}</svg>\n",
        style.width,
        style.height,
        escape(says),
    )
}

/// The same as a part of an HTML page, which needs no namespace.
pub fn inline_svg(scenes: &[&MechanismScene], view: &ViewDirection, style: &DrawingStyle) -> String {
    svg(scenes, view, style).replacen(NAMESPACE, "", 1)
}

/// A description of a picture for readers who cannot see it.
fn describe_scene(scene: &MechanismScene) -> String {
    let count = |is: fn(&MarkShape) -> bool| scene.marks.iter().filter(|m| is(&m.shape)).count();
    let kinds = [
        ("joint", count(|s| matches!(s, MarkShape::Joint(_)))),
        ("drive between points", count(|s| matches!(s, MarkShape::Drive(_)))),
        ("closed loop", count(|s| matches!(s, MarkShape::Closing(_)))),
        ("lumped mass", count(|s| matches!(s, MarkShape::Lump(..)))),
    ];
    // Several marks of a kind are counted in the plural.
    let counts = kinds.iter().filter(|(_, n)| *n > 0).map(|(what, n)| {
        let many = match (n, what.strip_suffix("between points")) {
            (1, _) => (*what).to_owned(),
            (_, Some(drive)) => format!("{}s between points", drive.trim_end()),
            _ if what.ends_with("ss") => format!("{what}es"),
            _ => format!("{what}s"),
        };
        format!("{n} {many}")
    });
    let counts: Vec<String> = counts.collect();
    format!("{}: {}", scene.title, counts.join(", "))
}

/// The sheet of a picture: the projection of metres onto it.
pub(crate) struct DrawingSheet<'a> {
    /// The direction of view.
    view: &'a ViewDirection,
    /// Options of the picture.
    style: &'a DrawingStyle,
    /// Units of the picture per metre.
    scale: f64,
    /// Whether all marks are at one point.
    is_point: bool,
    /// The projected centre of all marks, m to the right and up.
    middle: [f64; 2],
    /// The largest mass, kg, relative to which others are drawn.
    heaviest: f64,
}

impl<'a> DrawingSheet<'a> {
    /// A sheet on which all scenes fit.
    fn new(scenes: &[&MechanismScene], view: &'a ViewDirection, style: &'a DrawingStyle) -> Self {
        Self::with_margin(scenes, view, style, MARGIN)
    }

    /// A sheet on which all scenes fit within a margin, in units of the picture.
    pub(crate) fn with_margin(
        scenes: &[&MechanismScene],
        view: &'a ViewDirection,
        style: &'a DrawingStyle,
        margin: f64,
    ) -> Self {
        // The projected range of all marks.
        let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let mut heaviest = 0.0_f64;
        for mark in scenes.iter().flat_map(|scene| &scene.marks) {
            for at in mark.shape.places() {
                for (range, x) in range.iter_mut().zip(view.project(&at)) {
                    *range = [range[0].min(x), range[1].max(x)];
                }
            }
            if let MarkShape::Lump(_, mass) | MarkShape::Centre(_, mass) = mark.shape {
                heaviest = heaviest.max(mass.abs());
            }
        }
        // The scale at which that range fits within the margins.
        let room = [style.width - 2.0 * margin, style.height - 2.0 * margin - 16.0];
        let scales = [0, 1].map(|k| room[k].max(1.0) / (range[k][1] - range[k][0]).max(1e-9));
        let smallest = scales[0].min(scales[1]);
        let is_point = smallest > 1e8 || !smallest.is_finite();
        let middle = range.map(|[low, high]| 0.5 * (low + high));
        Self {
            view,
            style,
            // A mechanism without extent, such as one joint alone, is drawn at 1 m.
            scale: if is_point { room[1] } else { smallest },
            is_point,
            middle: middle.map(|m| if m.is_finite() { m } else { 0.0 }),
            heaviest,
        }
    }

    /// The place of a point in the picture.
    pub(crate) fn project_point(&self, at: &Vector3<f64>) -> [f64; 2] {
        let [right, up] = self.view.project(at);
        [
            0.5 * self.style.width + self.scale * (right - self.middle[0]),
            0.5 * self.style.height - 8.0 - self.scale * (up - self.middle[1]),
        ]
    }

    /// The projection of a direction, with y downwards.
    pub(crate) fn project_direction(&self, v: &Vector3<f64>) -> [f64; 2] {
        let [right, up] = self.view.project(v);
        [right, -up]
    }

    /// All marks of a scene, in the order in which they are drawn.
    pub(crate) fn paint_scene(&self, scene: &MechanismScene) -> String {
        let towards = self.view.viewer_direction();
        let mut drawn: Vec<(u8, f64, String)> = Vec::new();
        for mark in &scene.marks {
            // The mean depth of a mark's places.
            let places = mark.shape.places();
            let depth = places.iter().map(|at| at.dot(&towards)).sum::<f64>() / places.len() as f64;
            let drawing = self.paint_mark(scene, mark);
            if drawing.is_empty() {
                continue;
            }
            let title = escape(&mark.description);
            let colour = body_colour(mark.body);
            let group = format!("<g class=\"{colour}\"><title>{title}</title>{drawing}</g>\n");
            // In a plane nothing is hidden, so the kinds of marks are drawn in a fixed order. In space, symbols are
            // drawn slightly in front of the bars on which they are.
            let layer = match &mark.shape {
                // Lines of the base must not cut the bodies in front of it.
                MarkShape::Bar(_) if mark.body == 0 => 0,
                shape => drawing_layer(shape),
            };
            if scene.plane.is_some() {
                drawn.push((layer, 0.0, group));
            } else {
                let before = LAYER_SPACING / self.scale * f64::from(layer);
                drawn.push((0, depth + before, group));
            }
        }
        drawn.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        drawn.into_iter().map(|(.., group)| group).collect()
    }

    /// Arrows of all loads.
    fn paint_drive_arrows(&self, scene: &MechanismScene, loads: &[DriveArrow]) -> String {
        let towards = self.view.viewer_direction();
        let mut out = String::new();
        for mark in &scene.marks {
            for load in loads {
                out.push_str(&drive_arrow(
                    mark,
                    load,
                    |at| self.project_point(at),
                    |axis| self.project_direction(axis),
                    |axis| axis.dot(&towards),
                ));
            }
        }
        out
    }

    /// The drawing of one mark; empty if it is not visible.
    fn paint_mark(&self, scene: &MechanismScene, mark: &SceneMark) -> String {
        let spot = |at: &Vector3<f64>| SymbolPlace {
            at: self.project_point(at),
            is_flat: scene.plane.is_some(),
        };
        match &mark.shape {
            MarkShape::Bar(ends) => self.paint_segment("bar", ends, mark.body == 0),
            MarkShape::Arm(ends) => self.paint_segment("arm", ends, false),
            MarkShape::Rail(ends, axis) => {
                // On an empty sheet the rail shows what moves.
                let beyond = if self.is_point {
                    0.35 * self.style.width
                } else {
                    RAIL_OVERHANG
                };
                symbols::rail(
                    ends.each_ref().map(|at| self.project_point(at)),
                    self.project_direction(axis),
                    beyond,
                )
            }
            MarkShape::Plate(corners) => {
                let corners: Vec<[f64; 2]> = corners.iter().map(|at| self.project_point(at)).collect();
                symbols::polygon("plate", &corners)
            }
            MarkShape::Joint(joint) => {
                let axis = self.project_direction(&joint.axis);
                let towards = joint.axis.dot(&self.view.viewer_direction());
                symbols::joint(joint, spot(&joint.at), axis, towards)
            }
            MarkShape::Closing(at) => symbols::loop_closure(spot(at)),
            MarkShape::Drive(ends) => symbols::drive(ends.each_ref().map(|at| self.project_point(at))),
            MarkShape::Ground(at) => {
                let up = scene.down.map_or_else(Vector3::z, |down| -down);
                symbols::ground(
                    spot(at),
                    self.project_direction(&up),
                    up.dot(&self.view.viewer_direction()),
                )
            }
            MarkShape::Point(at) => symbols::point(self.project_point(at)),
            MarkShape::Lump(at, mass) => symbols::lump(self.project_point(at), self.mass_radius(*mass), *mass < 0.0),
            MarkShape::Centre(at, mass) => {
                symbols::centre(self.project_point(at), self.mass_radius(*mass), *mass < 0.0)
            }
            MarkShape::Frame(at, axes) if self.style.frames => {
                let axes = axes.each_ref().map(|axis| self.project_direction(axis));
                symbols::axes(self.project_point(at), &axes, 26.0, ["", "", ""])
            }
            MarkShape::Frame(..) => String::new(),
        }
    }

    /// Radius of a mass in units of the picture: its area grows with the mass.
    fn mass_radius(&self, mass: f64) -> f64 {
        4.0 + 8.0 * (mass.abs() / self.heaviest).sqrt()
    }

    /// A bar or thin line; empty if it points at the viewer.
    fn paint_segment(&self, class: &str, ends: &[Vector3<f64>; 2], is_ground: bool) -> String {
        let [a, b] = ends.each_ref().map(|at| self.project_point(at));
        // Shorter than half a unit of the picture.
        if (a[0] - b[0]).hypot(a[1] - b[1]) < 0.5 {
            return String::new();
        }
        let class = if is_ground { "base" } else { class };
        symbols::line(class, a, b)
    }

    /// Gravity, the axes of the base, and a scale bar.
    fn paint_axes_and_scale_bar(&self, scene: &MechanismScene) -> String {
        let (width, height) = (self.style.width, self.style.height);
        let mut out = String::from("<g class=\"furniture\">");
        if let Some(down) = scene.down {
            let depth = down.dot(&self.view.viewer_direction());
            out.push_str(&symbols::gravity(
                [width - 30.0, 22.0],
                self.project_direction(&down),
                depth,
            ));
        }
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| self.project_direction(&axis));
        // Axes to the left or downwards need room for their names.
        let beyond = |along: fn(&[f64; 2]) -> f64| axes.iter().map(along).fold(0.0, f64::max);
        let origin = [
            (36.0 * beyond(|a| -a[0]) + 10.0).max(26.0),
            height - (36.0 * beyond(|a| a[1]) + 12.0).max(24.0),
        ];
        out.push_str(&symbols::axes(origin, &axes, 28.0, ["x", "y", "z"]));
        // A round length of about a fifth of the width.
        let length = round_length(0.2 * width / self.scale);
        let (x, y) = (width - 14.0, height - 14.0);
        _ = writeln!(
            out,
            "<path class=\"scale\" d=\"M{:.1} {:.1}v5H{x:.1}v-5\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text></g>",
            x - length * self.scale,
            y - 5.0,
            x - length * self.scale - 6.0,
            y,
            length_text(length)
        );
        out
    }

    /// Names of joints, points and drives, where there is room.
    fn paint_labels(&self, scene: &MechanismScene) -> String {
        let mut labels = LabelLayout::new(self.style.width, self.style.height);
        // Joints, masses and closures must not be covered.
        for mark in &scene.marks {
            let taken = match &mark.shape {
                MarkShape::Joint(joint) => Some((&joint.at, 12.0)),
                MarkShape::Lump(at, mass) | MarkShape::Centre(at, mass) => Some((at, self.mass_radius(*mass))),
                MarkShape::Closing(at) | MarkShape::Ground(at) => Some((at, 9.0)),
                _ => None,
            };
            if let Some((at, radius)) = taken {
                labels.occupy(self.project_point(at), radius);
            }
        }
        let mut out = String::from("<g class=\"names\">");
        for mark in &scene.marks {
            let (at, class) = match &mark.shape {
                MarkShape::Joint(joint) => (self.project_point(&joint.at), "of-joint"),
                MarkShape::Drive(ends) => {
                    let [a, b] = ends.each_ref().map(|at| self.project_point(at));
                    ([0.6 * a[0] + 0.4 * b[0], 0.6 * a[1] + 0.4 * b[1]], "of-drive")
                }
                MarkShape::Point(at) => (self.project_point(at), "of-point"),
                _ => continue,
            };
            if mark.name.is_empty() {
                continue;
            }
            if let Some(place) = labels.place_label(at, mark.name.chars().count()) {
                out.push_str(&place.paint(at, &escape(&mark.name), class));
            }
        }
        out.push_str("</g>\n");
        out
    }
}

/// The class of a body's colour; the base has a class of its own.
fn body_colour(body: usize) -> String {
    match body {
        0 => "ground".to_owned(),
        n => format!("body c{}", (n - 1) % COLOURS),
    }
}

/// The layer of a mark in a planar picture, from back to front.
fn drawing_layer(shape: &MarkShape) -> u8 {
    match shape {
        MarkShape::Ground(_) => 0,
        MarkShape::Plate(_) => 1,
        MarkShape::Arm(_) | MarkShape::Rail(..) => 2,
        MarkShape::Bar(_) => 3,
        MarkShape::Drive(_) => 4,
        MarkShape::Lump(..) | MarkShape::Centre(..) => 5,
        MarkShape::Closing(_) | MarkShape::Joint(_) => 6,
        MarkShape::Point(_) => 7,
        MarkShape::Frame(..) => 8,
    }
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `most`.
fn round_length(most: f64) -> f64 {
    let decade = 10_f64.powf(most.log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|step| step * decade);
    steps
        .into_iter()
        .find(|step| *step <= most * 1.000_001)
        .unwrap_or(decade)
}

/// A round length with a suitable unit.
fn length_text(length: f64) -> String {
    if length < 0.0095 {
        format!("{:.0} mm", length * 1e3)
    } else if length < 0.95 {
        format!("{:.0} cm", length * 1e2)
    } else {
        format!("{length:.0} m")
    }
}
