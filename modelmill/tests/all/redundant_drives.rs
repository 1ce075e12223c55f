//! More drives than degrees of freedom in closed loops: a platform with three freedoms on four driven legs. The torques of a
//! recording contain an inner part that moves nothing; the forces on the platform, which they determine, are identified.

use std::fmt::Write as _;
use std::path::Path;

use modelmill::Model;
use modelmill::identify::EstimatorOptions;
use modelmill::recording::RecordingOptions;
use modelmill_codegen::{ModelEvaluator, MotionStates};
use nalgebra::{DMatrix, DVector};

/// Lengths of both links of each leg, m.
const LINKS: [f64; 2] = [0.4, 0.35];
/// Half the side of the platform, m.
const HALF: f64 = 0.12;

/// Pose of the platform, its rate or its acceleration at a time.
fn motion(t: f64, order: usize) -> [f64; 3] {
    [(0.5, 0.03, 2.3), (0.48, 0.025, 3.1), (0.05, 0.12, 4.7)].map(|(at, size, rate): (f64, f64, f64)| {
        let (sin, cos) = (rate * t).sin_cos();
        match order {
            0 => at + size * sin,
            1 => size * rate * cos,
            _ => -size * rate * rate * sin,
        }
    })
}

/// Derivatives of the four driven angles by the pose, from the geometry of a leg: the second link keeps its length.
fn jacobian([x, y, phi]: [f64; 3]) -> DMatrix<f64> {
    let [l, k] = LINKS;
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|c| c.map(|u| u * HALF));
    let pivots = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    DMatrix::from_fn(4, 3, |leg, i| {
        let ([cx, cy], [bx, by]) = (corners[leg], pivots[leg]);
        let (s, c) = phi.sin_cos();
        let arm = [cx * c - cy * s, cx * s + cy * c];
        let tip = [x + arm[0] - bx, y + arm[1] - by];
        let square = tip[0] * tip[0] + tip[1] * tip[1];
        let elbow = ((square - l * l - k * k) / (2.0 * l * k)).acos();
        let q = tip[1].atan2(tip[0]) - (k * elbow.sin()).atan2(l + k * elbow.cos());
        let along = [tip[0] - l * q.cos(), tip[1] - l * q.sin()];
        let moved = match i {
            0 => along[0],
            1 => along[1],
            _ => arm[0] * along[1] - arm[1] * along[0],
        };
        moved / (l * (along[1] * q.cos() - along[0] * q.sin()))
    })
}

#[test]
fn four_legs_move_three_freedoms() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/redundant/four_rrr.toml");
    let model = Model::from_text("four_rrr", &std::fs::read_to_string(file).unwrap()).expect("the model");
    assert_eq!(model.row_names(), ["on_x", "on_y", "on_phi"]);
    let (samples, step) = (900, 0.005);
    let time = |k: usize| step * k as f64;
    let columns: Vec<Vec<Vec<f64>>> = (0..3)
        .map(|order| {
            (0..3)
                .map(|i| (0..samples).map(|k| motion(time(k), order)[i]).collect())
                .collect()
        })
        .collect();
    let slices = |o: usize| -> Vec<&[f64]> { columns[o].iter().map(Vec::as_slice).collect() };
    let states = MotionStates {
        q: slices(0),
        qd: slices(1),
        qdd: slices(2),
        load: Vec::new(),
    };
    let forces = ModelEvaluator::new(&model.derivation)
        .inverse_dynamics(&states, &model.values)
        .expect("forces");
    let mut text = "t,x,y,phi,x_d,y_d,phi_d,x_dd,y_dd,phi_dd,d1,d2,d3,d4".to_owned();
    for k in 0..samples {
        let pose = motion(time(k), 0);
        let transposed = jacobian(pose).transpose();
        let wanted = DVector::from_fn(3, |i, _| forces[i][k]);
        // Inner torques that the model cannot know, and the least torques with which the sum exerts the wanted forces. Two
        // steps leave only rounding; singular vectors of nalgebra would have 1e-6 at single poses.
        let mut torques = DVector::from_column_slice(&[1.0, -2.0, 3.0, 1.5]) * (1.0 + 0.3 * (5.0 * time(k)).sin());
        let normal = (&transposed * transposed.transpose())
            .cholesky()
            .expect("three freedoms");
        for _ in 0..2 {
            let lacking = &wanted - &transposed * &torques;
            torques += transposed.transpose() * normal.solve(&lacking);
        }
        let _ = write!(text, "\n{}", time(k));
        for value in (0..3).flat_map(|order| motion(time(k), order)) {
            let _ = write!(text, ",{value}");
        }
        for torque in torques.iter() {
            let _ = write!(text, ",{torque}");
        }
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("four-rrr.csv");
    std::fs::write(&file, text + "\n").expect("a recording");
    let recording = model
        .recording(&file, &RecordingOptions::default())
        .expect("a recording");
    let notes: Vec<String> = recording.notes().map(|note| note.says.in_library_words()).collect();
    assert!(notes.iter().any(|note| note.contains("are not unique")), "{notes:?}");
    let found = model
        .identify(&[&recording], &[], &EstimatorOptions::default())
        .expect("a fit");
    // Rates and accelerations are recorded, so that only rounding is left.
    for (parameter, truth) in found.fit.parameters.iter().zip(&model.values) {
        let error = (parameter.value - truth).abs();
        assert!(error < 1e-8, "{} instead of {truth}", parameter.value);
    }
}
