//! The symbols of a kinematic diagram as SVG paths, in units of the picture, with y downwards.

use std::fmt::Write as _;

use crate::scene::{JointActuation, JointMark};

/// Radius of a joint's symbol.
const JOINT_RADIUS: f64 = 7.0;
/// Half the length of a joint's cylinder.
const HALF_CYLINDER: f64 = 11.0;
/// An axis whose length in the picture is below this share counts as pointing at the viewer.
const END_ON: f64 = 0.08;

/// A place in the picture at which a symbol is drawn.
#[derive(Clone, Copy)]
pub(crate) struct SymbolPlace {
    /// x to the right and y downwards.
    pub(crate) at: [f64; 2],
    /// Whether the picture shows a planar mechanism in its plane.
    pub(crate) is_flat: bool,
}

/// A line with a margin in the colour of the paper, so that it appears in front of other lines; thin lines have no
/// margin.
pub(crate) fn line(class: &str, a: [f64; 2], b: [f64; 2]) -> String {
    let d = format!("M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
    let line = format!("<path class=\"{class}\" d=\"{d}\"/>");
    if class == "arm" || class == "base" {
        return line;
    }
    format!("<path class=\"halo\" d=\"{d}\"/>{line}")
}

/// A closed polygon.
pub(crate) fn polygon(class: &str, corners: &[[f64; 2]]) -> String {
    let mut d = String::new();
    for (i, [x, y]) in corners.iter().enumerate() {
        _ = write!(d, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' });
    }
    format!("<path class=\"{class}\" d=\"{d}Z\"/>")
}

/// A circle.
fn circle(class: &str, [x, y]: [f64; 2], radius: f64) -> String {
    format!("<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"/>")
}

/// The symbol of a joint: a circle or a cylinder for a revolute joint, a sleeve for a prismatic one. `axis` is its
/// projection onto the picture, and `towards` the component of the axis towards the viewer.
pub(crate) fn joint(joint: &JointMark, spot: SymbolPlace, axis: [f64; 2], towards: f64) -> String {
    let class = match joint.actuation {
        JointActuation::Drive => "joint driven",
        JointActuation::Independent => "joint",
        JointActuation::Loops => "joint passive",
    };
    let length = axis[0].hypot(axis[1]);
    // A prismatic joint is a sleeve only; a screw has both symbols.
    if joint.is_prismatic && !joint.is_revolute {
        return sleeve(class, spot.at, axis, length);
    }
    // An axis towards the viewer, or a planar mechanism, needs only a circle.
    let mut out = if length < END_ON || spot.is_flat {
        circle(class, spot.at, JOINT_RADIUS)
    } else {
        cylinder(class, spot.at, axis.map(|x| x / length), length, towards)
    };
    if joint.is_prismatic {
        out.push_str(&sleeve("joint slide", spot.at, axis, length));
    }
    out
}

/// A cylinder about `along`, a unit vector of the picture, where `length` is the foreshortening of its axis.
fn cylinder(class: &str, at: [f64; 2], along: [f64; 2], length: f64, towards: f64) -> String {
    let across = [-along[1], along[0]];
    // The caps are circles seen at an angle: ellipses with this half axis.
    let cap = JOINT_RADIUS * towards.abs();
    let turn = along[1].atan2(along[0]).to_degrees();
    let end = |side: f64| [0, 1].map(|k| at[k] + side * HALF_CYLINDER * length * along[k]);
    let edge = |end: [f64; 2], side: f64| [0, 1].map(|k| end[k] + side * JOINT_RADIUS * across[k]);
    // The end that is nearer to the viewer shows its cap.
    let near = if towards > 0.0 { 1.0 } else { -1.0 };
    let [far, close] = [end(-near), end(near)];
    let [a, b, c, d] = [edge(far, 1.0), edge(close, 1.0), edge(close, -1.0), edge(far, -1.0)];
    // The outline of the far cap bulges away from the near one.
    let sweep = u8::from(near < 0.0);
    let hull = format!(
        "M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}A{cap:.1} {JOINT_RADIUS:.1} {turn:.0} 0 {sweep} {:.1} {:.1}Z",
        a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1], a[0], a[1]
    );
    format!(
        "<path class=\"{class}\" d=\"{hull}\"/><ellipse class=\"{class} cap\" rx=\"{cap:.1}\" ry=\"{JOINT_RADIUS:.1}\" transform=\"translate({:.1} {:.1}) rotate({turn:.0})\"/>",
        close[0], close[1]
    )
}

/// The sleeve of a prismatic joint: a rectangle around the part that slides through it.
fn sleeve(class: &str, at: [f64; 2], axis: [f64; 2], length: f64) -> String {
    let along = if length < END_ON {
        [1.0, 0.0]
    } else {
        axis.map(|x| x / length)
    };
    let half = [(13.0 * length).max(7.0), 7.0];
    let across = [-along[1], along[0]];
    let corner = |u: f64, v: f64| [0, 1].map(|k| at[k] + u * half[0] * along[k] + v * half[1] * across[k]);
    let corners = [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ];
    polygon(class, &corners)
}

/// The guide of a prismatic joint between two places on it, and beyond both of them along its projected direction.
pub(crate) fn rail(ends: [[f64; 2]; 2], along: [f64; 2], beyond: f64) -> String {
    let [a, b] = ends;
    // The second place may lie in the negative direction.
    let sign = if (0..2).map(|k| (b[k] - a[k]) * along[k]).sum::<f64>() < 0.0 {
        -beyond
    } else {
        beyond
    };
    line(
        "rail",
        [0, 1].map(|k| a[k] - sign * along[k]),
        [0, 1].map(|k| b[k] + sign * along[k]),
    )
}

/// The symbol of a closed loop: two rings at the common point.
pub(crate) fn loop_closure(spot: SymbolPlace) -> String {
    circle("closing", spot.at, JOINT_RADIUS) + &circle("closing", spot.at, 3.0)
}

/// A linear drive: a tube with its rod, and a pin at each end.
pub(crate) fn drive([from, to]: [[f64; 2]; 2]) -> String {
    let part = |share: f64| [0, 1].map(|k| from[k] + share * (to[k] - from[k]));
    let (rod, tube) = (line("rod", from, to), line("tube", part(0.12), part(0.58)));
    rod + &tube + &circle("pin", from, 3.5) + &circle("pin", to, 3.5)
}

/// The symbol of the base with its hatching: perpendicular to `up` in a plane, a disc in space. `towards` is the
/// component of `up` towards the viewer.
pub(crate) fn ground(spot: SymbolPlace, up: [f64; 2], towards: f64) -> String {
    let [x, y] = spot.at;
    if !spot.is_flat {
        let flat = (17.0 * towards.abs()).max(2.0);
        let turn = up[0].atan2(-up[1]).to_degrees();
        return format!(
            "<ellipse class=\"foot\" rx=\"17\" ry=\"{flat:.1}\" transform=\"translate({x:.1} {y:.1}) rotate({turn:.0})\"/>"
        );
    }
    let length = up[0].hypot(up[1]);
    // Seen from above, the hatching has no side.
    if length < END_ON {
        return circle("foot", spot.at, 13.0);
    }
    let down = up.map(|u| -u / length);
    let side = [-down[1], down[0]];
    // u along the base line, v downwards from the point.
    let at = |u: f64, v: f64| [x + u * side[0] + v * down[0], y + u * side[1] + v * down[1]];
    let mut d = String::new();
    let mut stroke = |a: [f64; 2], b: [f64; 2]| {
        _ = write!(d, "M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
    };
    // A triangle with its base line, and the hatching below it.
    stroke(at(0.0, 0.0), at(-9.0, 15.0));
    stroke(at(0.0, 0.0), at(9.0, 15.0));
    stroke(at(-15.0, 15.0), at(15.0, 15.0));
    for k in 0..5 {
        let u = -13.0 + 6.5 * f64::from(k);
        stroke(at(u, 15.0), at(u - 5.0, 21.0));
    }
    format!("<path class=\"foot\" d=\"{d}\"/>")
}

/// A named point.
pub(crate) fn point(at: [f64; 2]) -> String {
    circle("point", at, 2.2)
}

/// A lumped mass; a negative one has another class.
pub(crate) fn lump(at: [f64; 2], radius: f64, is_negative: bool) -> String {
    circle(if is_negative { "lump negative" } else { "lump" }, at, radius)
}

/// The symbol of a centre of mass: a disc with two dark quarters.
pub(crate) fn centre([x, y]: [f64; 2], r: f64, is_negative: bool) -> String {
    let class = if is_negative { "centre negative" } else { "centre" };
    circle(class, [x, y], r)
        + &format!(
            "<path class=\"quarters\" d=\"M{x:.1} {y:.1}v{:.1}A{r:.1} {r:.1} 0 0 1 {:.1} {y:.1}ZM{x:.1} {y:.1}v{r:.1}A{r:.1} {r:.1} 0 0 1 {:.1} {y:.1}Z\"/>",
            -r,
            x + r,
            x - r
        )
}

/// Three axes with their names, each with its foreshortened length. Axes towards the viewer are left out.
pub(crate) fn axes(at: [f64; 2], axes: &[[f64; 2]; 3], length: f64, names: [&str; 3]) -> String {
    let mut out = String::new();
    for ((axis, name), class) in axes.iter().zip(names).zip(["axis x", "axis y", "axis z"]) {
        let tip = [0, 1].map(|k| at[k] + length * axis[k]);
        if axis[0].hypot(axis[1]) < END_ON {
            continue;
        }
        out.push_str(&line(class, at, tip));
        if !name.is_empty() {
            let text = [0, 1].map(|k| at[k] + (length + 8.0) * axis[k]);
            _ = write!(
                out,
                "<text class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{name}</text>",
                text[0],
                text[1] + 4.0
            );
        }
    }
    out
}

/// An arrow along gravity. If gravity points at the viewer or away, its tip or its tail is drawn in a ring instead.
pub(crate) fn gravity(at: [f64; 2], down: [f64; 2], towards: f64) -> String {
    let length = down[0].hypot(down[1]);
    let [x, y] = at;
    // Nearly along the line of sight: a dot for the tip, a cross for the tail.
    if length < 0.2 {
        let inner = if towards > 0.0 {
            circle("pin", [x, y + 10.0], 2.0)
        } else {
            let (a, b, c, d) = (x - 4.2, y + 5.8, x + 4.2, y + 14.2);
            format!("<path class=\"scale\" d=\"M{a:.1} {b:.1}L{c:.1} {d:.1}M{c:.1} {b:.1}L{a:.1} {d:.1}\"/>")
        };
        return format!(
            "{}{inner}<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">g</text>",
            circle("ring", [x, y + 10.0], 6.0),
            x - 11.0,
            y + 14.0
        );
    }
    let along = down.map(|d| d / length);
    let tip = [0, 1].map(|k| at[k] + 36.0 * length * along[k]);
    let across = [-along[1], along[0]];
    let wing = |side: f64| [0, 1].map(|k| tip[k] - 8.0 * along[k] + side * 3.5 * across[k]);
    let [a, b] = [wing(1.0), wing(-1.0)];
    format!(
        "<path class=\"scale\" d=\"M{x:.1} {y:.1}L{:.1} {:.1}\"/>{}<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">g</text>",
        tip[0],
        tip[1],
        polygon("tip", &[tip, a, b]),
        x - 8.0,
        y + 16.0
    )
}
