//! The whole pipeline on a two-link arm with two drives, recorded as a robot would record it:
//! positions only, from encoders of 20 bits with noise, and forces with noise.
//!
//! Source of the regressor: M. W. Spong and M. Vidyasagar, "Robot Dynamics and Control", the
//! planar elbow manipulator, written in its base parameters.

use std::f64::consts::PI;
use std::fmt::Write as _;

use modelmill_identify::estimate::uncertainty_with_autocorrelation;
use modelmill_identify::{
    ErrorAccumulator, FitFile, LeastSquares, LeastSquaresError, ParameterInfo, PreparedRun, ReadOptions,
    SignalRecording, StatePreparation, fit_parameters,
};

const GRAVITY: f64 = 9.81;
/// Inertia about joint 1, coupling, inertia about joint 2, first moments of both links.
const TRUTH: [f64; 5] = [48.0, 21.0, 14.5, 62.0, 18.6];
const NAMES: [&str; 2] = ["theta1", "theta2"];
const DRIVES: [&str; 2] = ["left", "right"];

fn rows(q: [f64; 2], qd: [f64; 2], qdd: [f64; 2]) -> [[f64; 5]; 2] {
    let (sin, cos) = q[1].sin_cos();
    let (first, both) = (GRAVITY * q[0].cos(), GRAVITY * (q[0] + q[1]).cos());
    [
        [
            qdd[0],
            cos * (2.0 * qdd[0] + qdd[1]) - sin * (2.0 * qd[0] * qd[1] + qd[1] * qd[1]),
            qdd[0] + qdd[1],
            first,
            both,
        ],
        [0.0, cos * qdd[0] + sin * qd[0] * qd[0], qdd[0] + qdd[1], 0.0, both],
    ]
}

/// Finite Fourier series of seven harmonics over 7.29 s, and its derivatives.
fn motion(axis: usize, t: f64) -> [f64; 3] {
    let base = 2.0 * PI / 7.29;
    let mut state = [1.4 + 0.3 * axis as f64, 0.0, 0.0];
    for h in 1..=7 {
        let (w, phase) = (base * f64::from(h), 1.7 * f64::from(h * h) + 2.3 * axis as f64);
        let (sin, cos) = (w * t + phase).sin_cos();
        let amplitude = 0.35 / f64::from(h);
        state[0] += amplitude * sin;
        state[1] += amplitude * w * cos;
        state[2] -= amplitude * w * w * sin;
    }
    state
}

/// Uniform numbers by an LCG; sums of twelve pass for normal ones.
struct Noise(u64);

impl Noise {
    fn normal(&mut self) -> f64 {
        (0..12)
            .map(|_| {
                self.0 = self
                    .0
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 11) as f64 / (1_u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }
}

/// A recording of 14.58 s at 250 Hz; `bias` is a force on the right drive that the model lacks.
fn recording(seed: u64, bias: f64) -> SignalRecording {
    let mut noise = Noise(seed);
    let mut text = "t,theta1,theta2,left,right\n".to_owned();
    let step = 2.0 * PI / f64::from(1 << 20);
    for i in 0..3645 {
        let t = 0.004 * f64::from(i);
        let [a, b] = [motion(0, t), motion(1, t)];
        let force = rows([a[0], b[0]], [a[1], b[1]], [a[2], b[2]]).map(|row| dot(&row, &TRUTH));
        let mut encode = |angle: f64| ((angle + 4e-6 * noise.normal()) / step).round() * step;
        let angles = [encode(a[0]), encode(b[0])];
        let (left, right) = (
            force[0] + noise.normal(),
            force[1] + bias * b[1].signum() + noise.normal(),
        );
        writeln!(text, "{t:.3},{:.9},{:.9},{left:.6},{right:.6}", angles[0], angles[1]).expect("a string takes text");
    }
    SignalRecording::from_reader(text.as_bytes(), "synthetic.csv", &ReadOptions::default()).expect("a sound recording")
}

fn dot(row: &[f64], p: &[f64]) -> f64 {
    row.iter().zip(p).map(|(w, p)| w * p).sum()
}

fn regressor(run: &PreparedRun) -> Vec<f64> {
    (0..run.samples())
        .flat_map(|i| {
            let pick = |columns: &[Vec<f64>]| [columns[0][i], columns[1][i]];
            rows(pick(&run.q), pick(&run.qd), pick(&run.qdd)).concat()
        })
        .collect()
}

fn run(seed: u64, bias: f64) -> PreparedRun {
    recording(seed, bias)
        .states_with(
            &NAMES.map(str::to_owned),
            &DRIVES.map(str::to_owned),
            &StatePreparation::default(),
        )
        .expect("states")
}

#[test]
fn positions_alone_give_the_parameters_within_a_fifth_of_a_percent() {
    let run = run(7, 0.0);
    println!(
        "cut-off {:?} Hz, dropped {:?}",
        run.prepared.cutoff_hz, run.prepared.trimmed
    );
    let (w, y) = (regressor(&run), run.measured_interleaved().expect("forces"));
    let mut regression = LeastSquares::new(5);
    // In blocks, as a long recording would come.
    for (w, y) in w.chunks(500 * 10).zip(y.chunks(500 * 2)) {
        regression.add_rows(w, y).expect("finite rows");
    }
    let solution = regression.solve().expect("a solution");
    let deviations = uncertainty_with_autocorrelation(&solution, 2, |visit| {
        for (w, y) in w.chunks(300 * 10).zip(y.chunks(300 * 2)) {
            visit(w, y)?;
        }
        Ok::<(), LeastSquaresError>(())
    })
    .expect("deviations");
    for (j, truth) in TRUTH.iter().enumerate() {
        let (value, std) = (solution.values[j], deviations.std[j]);
        println!("{value:.4} +- {std:.4} (true {truth})");
        assert!(
            (value / truth - 1.0).abs() < 0.002,
            "parameter {j}: {value} instead of {truth}"
        );
        assert!(
            (value - truth).abs() < 5.0 * std,
            "parameter {j}: {value} +- {std} instead of {truth}"
        );
        // Without anything missing the two formulas nearly agree.
        assert!((0.6..1.8).contains(&(std / solution.classical_std[j])));
    }
    // What is left over is the noise of the forces, 1 N.
    let rms = solution.residual_norm / (solution.rows as f64).sqrt();
    assert!((rms - 1.0).abs() < 0.05, "{rms}");

    let model: Vec<f64> = w.chunks_exact(5).map(|row| dot(row, &solution.values)).collect();
    let mut comparison = ErrorAccumulator::new(DRIVES.map(str::to_owned));
    comparison.add(&y, &model).expect("finite values");
    let infos: Vec<ParameterInfo> = (0..5)
        .map(|j| ParameterInfo {
            name: format!("p{}_min", j + 1),
            expression: format!("x{j}"),
            unit: "kg m^2".to_owned(),
            nominal: None,
        })
        .collect();
    let fit = FitFile {
        gains: Vec::new(),
        delays: Vec::new(),
        model: "two_link".to_owned(),
        samples: run.samples(),
        condition_number: Some(solution.condition_number),
        scaled_condition_number: Some(solution.scaled_condition_number),
        parameters: fit_parameters(&infos, &solution, &deviations),
        covariance: None,
        constants: [("L1".to_owned(), 0.7)].into(),
        equation_sample: None,
        undetermined: Vec::new(),
        fit: comparison.finish().expect("figures"),
        check: None,
        data: run.notes.clone(),
        estimator: modelmill_identify::EstimatorOutput::default(),
    };
    let again = FitFile::parse(&serde_json::to_string(&fit).expect("JSON"), "fit.json").expect("a fit");
    let names: Vec<(&str, &str)> = infos.iter().map(|i| (i.name.as_str(), i.expression.as_str())).collect();
    let values = again.values_for(&names, "fit.json").expect("the same parameters");
    for (a, b) in values.iter().zip(&solution.values) {
        assert!((a / b - 1.0).abs() < 1e-15);
    }
}

/// What the model lacks makes the residual repeat itself; the deviations must grow with it.
#[test]
fn a_missing_effect_widens_the_deviations() {
    let run = run(3, 25.0);
    let (w, y) = (regressor(&run), run.measured_interleaved().expect("forces"));
    let mut regression = LeastSquares::new(5);
    regression.add_rows(&w, &y).expect("finite rows");
    let solution = regression.solve().expect("a solution");
    let deviations = uncertainty_with_autocorrelation(&solution, 2, |visit| visit(&w, &y)).expect("deviations");
    println!(
        "lag 1: {:?}, effective samples {:?}",
        deviations.residual_lag1, deviations.effective_samples
    );
    assert!(deviations.residual_lag1[1] > 0.9);
    assert!((0..5).all(|j| deviations.std[j] > 2.0 * solution.classical_std[j]));
}
