//! Divides polygons of OBJ files into triangles: the corners of a polygon go in, triangles come out.
//!
//! Source: the reader tinyobjloader in MuJoCo 4.0 (ears are cut off in the plane of two axes). Its result is copied with
//! its limits, since the mass of a mesh depends on the triangles: numbers have 32 bits, polygons with more than 100 corners
//! are left out, and so is what remains of a polygon in which no further ear is found.

use nalgebra::Vector3;

/// Most corners of a polygon that MuJoCo reads.
const MOST_CORNERS: usize = 100;

/// A corner in a plane.
type PlanarPoint = [f32; 2];

/// The triangles of a polygon, given by the places of its corners.
pub(super) fn divide_polygon(corners: &[Vector3<f64>], polygon: &[usize]) -> Vec<[usize; 3]> {
    #[expect(clippy::cast_possible_truncation, reason = "corners of a mesh have 32 bits")]
    let at = |place: usize| -> [f32; 3] { corners[place].map(|x| x as f32).into() };
    match *polygon {
        [a, b, c] => vec![[a, b, c]],
        // The shorter diagonal divides a quadrangle.
        [a, b, c, d] => {
            let squared = |from: usize, to: usize| -> f32 {
                let [x, y, z] = subtract(at(to), at(from));
                x * x + y * y + z * z
            };
            if squared(a, c) < squared(b, d) {
                vec![[a, b, c], [a, c, d]]
            } else {
                vec![[a, b, d], [b, c, d]]
            }
        }
        _ if polygon.len() > MOST_CORNERS => Vec::new(),
        _ => {
            let axes = find_plane_axes(&polygon.iter().map(|place| at(*place)).collect::<Vec<_>>());
            cut_ears(polygon, &|place| axes.map(|axis| at(place)[axis]))
        }
    }
}

/// The two axes of the plane in which a polygon is divided: those across which its first true corner is largest.
fn find_plane_axes(polygon: &[[f32; 3]]) -> [usize; 2] {
    let n = polygon.len();
    for k in 0..n {
        let [first, second, third] = [0, 1, 2].map(|step| polygon[(k + step) % n]);
        let (a, b) = (subtract(second, first), subtract(third, second));
        let x = (a[1] * b[2] - a[2] * b[1]).abs();
        let y = (a[2] * b[0] - a[0] * b[2]).abs();
        let z = (a[0] * b[1] - a[1] * b[0]).abs();
        if [x, y, z].iter().any(|size| *size > f32::EPSILON) {
            return match () {
                () if x > y && x > z => [1, 2],
                () if z > x && z > y => [0, 1],
                () => [0, 2],
            };
        }
    }
    [1, 2]
}

/// Cuts off ears, one corner each, until three corners are left or no ear is found.
fn cut_ears(polygon: &[usize], at: &dyn Fn(usize) -> PlanarPoint) -> Vec<[usize; 3]> {
    let mut left = polygon.to_vec();
    let mut out = Vec::with_capacity(left.len());
    let (mut guess, mut tries) = (0, left.len());
    let mut before = left.len();
    while left.len() > 3 && tries > 0 {
        let n = left.len();
        if guess >= n {
            guess -= n;
        }
        if before == n {
            tries -= 1;
        } else {
            (before, tries) = (n, n);
        }
        let ear = [0, 1, 2].map(|step| left[(guess + step) % n]);
        let [a, b, c] = ear.map(at);
        let turn = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
        let area = (a[0] * b[1] - a[1] * b[0]) * 0.5;
        let mut others = (3..n).map(|step| at(left[(guess + step) % n]));
        if turn * area < 0.0 || others.any(|other| is_inside(&[a, b, c], other)) {
            guess += 1;
            continue;
        }
        out.push(ear);
        left.remove((guess + 1) % n);
    }
    if let [a, b, c] = left[..] {
        out.push([a, b, c]);
    }
    out
}

/// Whether a point is inside a triangle: a line from it crosses one edge.
fn is_inside(triangle: &[PlanarPoint; 3], [x, y]: PlanarPoint) -> bool {
    let mut is_in = false;
    for (k, from) in triangle.iter().enumerate() {
        let to = triangle[(k + 2) % 3];
        let crosses = (from[1] > y) != (to[1] > y);
        if crosses && x < (to[0] - from[0]) * (y - from[1]) / (to[1] - from[1]) + from[0] {
            is_in = !is_in;
        }
    }
    is_in
}

/// The vector from `b` to `a`.
fn subtract(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::super::meshes::{MeshInertia, TriangleMesh};

    /// A prism of height 0.5 whose base is a star with `n` corners, all as polygons.
    fn star(n: usize) -> String {
        let mut text = String::new();
        for z in [0.0, 0.5] {
            for k in 0..n {
                #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                let angle = 2.0 * std::f64::consts::PI * k as f64 / n as f64;
                let r = if k % 2 == 0 { 1.0 } else { 0.4 };
                let _ = writeln!(text, "v {:.5} {:.5} {z}", 3.0 + r * angle.cos(), 1.0 + r * angle.sin());
            }
        }
        let line = |places: Vec<usize>| {
            let places: Vec<String> = places.iter().map(usize::to_string).collect();
            format!("f {}\n", places.join(" "))
        };
        text += &line((1..=n).rev().collect());
        text += &line((n + 1..=2 * n).collect());
        for k in 0..n {
            let next = (k + 1) % n;
            text += &line(vec![k + 1, next + 1, next + 1 + n, k + 1 + n]);
        }
        text
    }

    /// Numbers of triangles and masses of MuJoCo 4.0.0 for the same files with 1 kg/m^3.
    #[test]
    fn polygons_are_divided_as_mujoco_does() {
        for (n, triangles, mass) in [
            (6, 20, 0.519_616_562_231_539_6),
            (10, 32, 0.538_086_930_247_268),
            (24, 73, 0.597_930_272_665_032_7),
            (98, 296, 1.029_487_318_880_254_5),
            (100, 300, 1.024_337_599_958_507_4),
            (102, 204, 0.418_614_212_162_585_3),
        ] {
            let mesh = TriangleMesh::read("star.obj", star(n).as_bytes()).unwrap();
            assert_eq!(mesh.triangles.len(), triangles, "{n}");
            let found = mesh.integrals(MeshInertia::Legacy).unwrap().inertial(None, 1.0).mass;
            assert!((found - mass).abs() < 1e-12 * mass, "{n}: {found}, not {mass}");
        }
    }
}
