//! Geometry of planes: the plane in which a mechanism moves, and the outline of places of a body in one plane.

use nalgebra::{Matrix3, Vector3};

use crate::scene::JointMark;

/// Unit vectors count as parallel if their vector product is shorter.
const PARALLEL: f64 = 1e-6;

/// The unit normal of the plane in which all joints move, if there is one: revolute axes are along it, prismatic axes
/// in the plane. If several planes are possible, gravity lies in the plane.
pub(crate) fn plane_of_motion<'a>(
    joints: impl Iterator<Item = &'a JointMark>,
    down: Option<Vector3<f64>>,
) -> Option<Vector3<f64>> {
    let joints: Vec<&JointMark> = joints.collect();
    let turning = joints.iter().filter(|joint| joint.is_revolute);
    let sliding: Vec<Vector3<f64>> = (joints.iter())
        .filter(|joint| joint.is_prismatic)
        .map(|joint| joint.axis)
        .collect();
    // A normal of a prismatic axis: perpendicular to another one, or to gravity, or to an axis of the base.
    let across = |a: &Vector3<f64>| {
        let others = sliding.iter().copied().chain(down).chain(Vector3::identity_axes());
        let mut normals = others.map(|b| a.cross(&b));
        normals.find(|n| n.norm() > PARALLEL)
    };
    // The first revolute axis, or else a normal of the first prismatic axis.
    let normal = turning
        .map(|joint| joint.axis)
        .next()
        .or_else(|| sliding.first().and_then(across))?
        .normalize();
    let is_planar = joints.iter().all(|joint| {
        let turns = !joint.is_revolute || joint.axis.cross(&normal).norm() < PARALLEL;
        turns && (!joint.is_prismatic || joint.axis.dot(&normal).abs() < PARALLEL)
    });
    is_planar.then_some(orient_to_viewer(normal))
}

/// The one of both normals of a plane from which the base axes have their usual directions in the picture.
fn orient_to_viewer(normal: Vector3<f64>) -> Vector3<f64> {
    // z towards the viewer; else y away, as in a front view; else x towards the viewer.
    let way = [normal.z, -normal.y, normal.x];
    let first = way.into_iter().find(|along| along.abs() > 0.1);
    if first.is_some_and(|along| along < 0.0) {
        -normal
    } else {
        normal
    }
}

/// The axes of the base frame.
trait IdentityAxes {
    /// y, z and x, in the order in which they are tried.
    fn identity_axes() -> [Vector3<f64>; 3];
}

impl IdentityAxes for Vector3<f64> {
    fn identity_axes() -> [Self; 3] {
        [Self::y(), Self::z(), Self::x()]
    }
}

/// Corners of the convex hull of places in one plane, in order; `None` if they lie on a line, or in no plane.
pub(crate) fn convex_hull(places: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
    // Largest thickness relative to the length.
    const FLAT: f64 = 1e-3;
    if places.len() < 3 {
        return None;
    }
    let centre = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
    // The principal axes of the places: two large ones and a small one if they lie in a plane.
    let spread: Matrix3<f64> = (places.iter())
        .map(|at| (at - centre) * (at - centre).transpose())
        .sum();
    let spread = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| spread.eigenvalues[*b].total_cmp(&spread.eigenvalues[*a]));
    let [most, second, least] = order.map(|k| spread.eigenvalues[k].max(0.0).sqrt());
    if most.is_nan() || second <= 0.05 * most || least > FLAT * most {
        return None;
    }
    let [right, up] = [order[0], order[1]].map(|k| spread.eigenvectors.column(k).into_owned());
    let mut flat: Vec<([f64; 2], Vector3<f64>)> = (places.iter())
        .map(|at| ([(at - centre).dot(&right), (at - centre).dot(&up)], *at))
        .collect();
    flat.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    // Whether three places in this order turn to the left.
    let left_turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 1e-9 * most * most
    };
    // Andrew's monotone chain: the lower half from left to right, the upper one back.
    let half = |points: &mut dyn Iterator<Item = &([f64; 2], Vector3<f64>)>| {
        let mut chain: Vec<([f64; 2], Vector3<f64>)> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && !left_turn(a.0, b.0, point.0)
            {
                chain.pop();
            }
            chain.push(*point);
        }
        chain.pop();
        chain
    };
    let mut corners = half(&mut flat.iter());
    corners.extend(half(&mut flat.iter().rev()));
    (corners.len() >= 3).then(|| corners.into_iter().map(|(_, at)| at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_a_place_inside_has_four_corners() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.7, 1.1);
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.4, 0.6], [0.5, 0.0]];
        let places = square.map(|[x, y]| turn * Vector3::new(x, y, 2.0));
        let corners = convex_hull(&places).expect("a plane");
        assert_eq!(corners.len(), 4);
        let around: f64 = (0..4).map(|i| (corners[i] - corners[(i + 1) % 4]).norm()).sum();
        assert!((around - 4.0).abs() < 1e-9, "{around}");
        // On a line, and in no plane.
        assert!(convex_hull(&[Vector3::zeros(), Vector3::x(), 2.0 * Vector3::x()]).is_none());
        assert!(convex_hull(&[Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()]).is_none());
    }
}
