//! A real ball-screw axis: the published least squares of the EMPS benchmark, from the raw file.
//!
//! The data carry no licence and are not copied: they are looked for beside the workspace.
//! Source of the numbers: A. Janot, M. Gautier, M. Brunot, "Data set and reference models of
//! EMPS", Workshop on Nonlinear System Identification Benchmarks, 2019.

use std::path::PathBuf;

use modelmill_identify::estimate::uncertainty_with_autocorrelation;
use modelmill_identify::{
    LeastSquares, LeastSquaresError, LocateOptions, PreparedRun, SignalRecording, StatePreparation, compare_forces,
    decimate_table, decimate_time, locate_errors,
};

fn data() -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/emps");
    if folder.join("emps_train.csv").is_file() {
        return Some(folder);
    }
    println!("EMPS is not tested: there are no recordings in ../shared/data/emps beside the workspace.");
    None
}

struct Regression {
    regressor: Vec<f64>,
    force: Vec<f64>,
    time: Vec<f64>,
    rate: Vec<f64>,
}

fn read(path: PathBuf) -> PreparedRun {
    let recording =
        SignalRecording::read(path, &[("t", "t_s"), ("x", "q_meas_m"), ("axis", "force_N")]).expect("a readable file");
    recording
        .states_with(&["x".to_owned()], &["axis".to_owned()], &StatePreparation::emps())
        .expect("states")
}

/// Columns qdd, qd, sign(qd), 1, decimated in parallel with the force.
fn regression(run: &PreparedRun) -> Regression {
    let (qd, qdd) = (&run.qd[0], &run.qdd[0]);
    let full: Vec<f64> = qd.iter().zip(qdd).flat_map(|(v, a)| [*a, *v, sign(*v), 1.0]).collect();
    let factor = run.prepared.decimate;
    let force = run.measured_interleaved().expect("a force");
    Regression {
        regressor: decimate_table(&full, 4, factor).expect("columns"),
        force: decimate_table(&force, 1, factor).expect("force"),
        time: decimate_time(&run.time, factor),
        rate: decimate_table(qd, 1, factor).expect("rate"),
    }
}

fn sign(v: f64) -> f64 {
    if v == 0.0 { 0.0 } else { v.signum() }
}

fn model(data: &Regression, values: &[f64]) -> Vec<f64> {
    data.regressor
        .chunks_exact(4)
        .map(|row| row.iter().zip(values).map(|(w, p)| w * p).sum())
        .collect()
}

fn relative_error(data: &Regression, values: &[f64]) -> f64 {
    let figures = compare_forces(
        &["axis".to_owned()],
        std::slice::from_ref(&data.force),
        std::slice::from_ref(&model(data, values)),
    );
    100.0 * figures.expect("figures").nrms.expect("a force was measured")
}

#[test]
fn the_published_parameters_come_out() {
    let Some(folder) = data() else { return };
    let run = read(folder.join("emps_train.csv"));
    let train = regression(&run);
    assert_eq!(train.force.len(), 2475);
    assert_eq!(train.time.len(), 2475);
    let mut fit = LeastSquares::new(4);
    fit.add_rows(&train.regressor, &train.force).expect("finite rows");
    let solution = fit.solve().expect("a solution");
    let deviations = uncertainty_with_autocorrelation(&solution, 1, |visit| {
        visit(&train.regressor, &train.force)?;
        Ok::<(), LeastSquaresError>(())
    })
    .expect("deviations");

    let published = [("M", 95.1089), ("Fv", 203.5034), ("Fc", 20.3935), ("offset", -3.1648)];
    for (j, (name, expected)) in published.iter().enumerate() {
        let value = solution.values[j];
        println!(
            "{name}: {value:.4} (published {expected}), std {:.4}, classical {:.4}, effective samples {:.0}",
            deviations.std[j], solution.classical_std[j], deviations.effective_samples[j]
        );
        assert!(
            (value / expected - 1.0).abs() < 0.005,
            "{name}: {value} instead of {expected}"
        );
    }
    println!(
        "condition number {:.3} (published 25.99), bandwidth {}",
        solution.condition_number, deviations.bandwidth
    );
    assert!((solution.condition_number - 25.99).abs() < 0.05);

    let on_train = relative_error(&train, &solution.values);
    let pulses = regression(&read(folder.join("emps_pulses.csv")));
    let on_pulses = relative_error(&pulses, &solution.values);
    println!("relative error: train {on_train:.3} % (published 4.083), pulses {on_pulses:.3} % (published 5.982)");
    assert!((on_train - 4.083).abs() < 0.15);
    assert!((on_pulses - 5.982).abs() < 0.15);

    // The residual is strongly autocorrelated, and the deviations must say so.
    println!("lag-1 correlation of the residual {:.3}", deviations.residual_lag1[0]);
    assert!((deviations.residual_lag1[0] - 0.66).abs() < 0.05);
    for j in 0..4 {
        assert!(deviations.std[j] > 1.5 * solution.classical_std[j]);
    }

    let error: Vec<f64> = train
        .force
        .iter()
        .zip(model(&train, &solution.values))
        .map(|(y, m)| y - m)
        .collect();
    let regions = locate_errors(
        &[("axis", &error)],
        &[("t", &train.time), ("x_d", &train.rate)],
        &LocateOptions::default(),
    );
    for region in &regions {
        println!("{}", region.says);
    }
}

/// With friction that differs by direction the published error is 3.112 %.
#[test]
fn friction_by_direction_explains_what_was_published() {
    let Some(folder) = data() else { return };
    let run = read(folder.join("emps_train.csv"));
    let (qd, qdd) = (&run.qd[0], &run.qdd[0]);
    let full: Vec<f64> = qd
        .iter()
        .zip(qdd)
        .flat_map(|(v, a)| {
            let (forward, backward) = (f64::from(u8::from(*v > 0.0)), f64::from(u8::from(*v < 0.0)));
            [*a, v * forward, forward, v * backward, -backward]
        })
        .collect();
    let w = decimate_table(&full, 5, 10).expect("columns");
    let y = decimate_table(&run.measured_interleaved().expect("a force"), 1, 10).expect("force");
    let mut fit = LeastSquares::new(5);
    fit.add_rows(&w, &y).expect("finite rows");
    let solution = fit.solve().expect("a solution");
    let error = 100.0 * solution.residual_norm / solution.measured_norm;
    println!("{:?}, {error:.3} %", solution.values);
    for (value, published) in solution.values.iter().zip([95.154, 166.706, 20.144, 240.424, 20.628]) {
        assert!(
            (value / published - 1.0).abs() < 0.025,
            "{value} instead of {published}"
        );
    }
    assert!((error - 3.112).abs() < 0.15);
}
