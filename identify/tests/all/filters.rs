//! Filters and differences against numbers from scipy and numpy.

use modelmill_identify::{LowPass, decimate, decimate_columns, decimate_table, differentiate};

#[allow(clippy::unreadable_literal, reason = "numbers as numpy prints them")]
#[path = "../reference/filter_tables.rs"]
mod tables;

fn signal() -> Vec<f64> {
    (0..120_u32)
        .map(|i| {
            let k = f64::from(i);
            (0.11 * k).sin() + 0.3 * (1.7 * k + 0.4).cos() + 0.01 * k - if i % 7 == 3 { 0.2 } else { 0.0 }
        })
        .collect()
}

#[track_caller]
fn check(actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (i, (a, e)) in actual.iter().zip(expected).enumerate() {
        assert!((a - e).abs() <= tolerance, "sample {i}: {a} instead of {e}");
    }
}

fn picked(values: &[f64]) -> Vec<f64> {
    tables::PICKS.iter().map(|&i| values[i]).collect()
}

#[test]
fn zero_phase_butterworth_agrees_with_scipy() {
    for (order, cutoff, rate, expected) in [
        (4, 100.0, 1000.0, tables::BUTTER4_100_OF_1000),
        (3, 12.5, 250.0, tables::BUTTER3_12_OF_250),
        (1, 5.0, 250.0, tables::BUTTER1_5_OF_250),
        (4, 0.8, 1000.0, tables::BUTTER4_SLOW),
    ] {
        let filtered = LowPass::butterworth(order, cutoff, rate)
            .unwrap()
            .zero_phase(&signal())
            .unwrap();
        check(&picked(&filtered), &expected, 1e-9);
    }
}

#[test]
fn decimation_agrees_with_scipy() {
    check(&decimate(&signal(), 10).unwrap(), &tables::DECIMATED_10, 1e-9);
    check(&decimate(&signal(), 3).unwrap(), &tables::DECIMATED_3, 1e-9);
}

#[test]
fn a_table_is_decimated_column_by_column() {
    let x = signal();
    let table: Vec<f64> = x.iter().flat_map(|v| [*v, -2.0 * v]).collect();
    let short = decimate_table(&table, 2, 10).unwrap();
    let column: Vec<f64> = short.iter().step_by(2).copied().collect();
    check(&column, &tables::DECIMATED_10, 1e-9);
    let column: Vec<f64> = short.iter().skip(1).step_by(2).map(|v| v / -2.0).collect();
    check(&column, &tables::DECIMATED_10, 1e-9);
}

#[test]
fn differences_over_uneven_times_agree_with_numpy() {
    let time: Vec<f64> = (0..120)
        .map(|k| 0.004 * f64::from(k) + 0.0007 * f64::from(k).sin())
        .collect();
    check(
        &picked(&differentiate(&time, &signal())),
        &tables::GRADIENT_UNEVEN,
        1e-9,
    );
}

#[test]
fn a_design_has_the_gain_it_promises() {
    for order in 1..=8 {
        let filter = LowPass::butterworth(order, 30.0, 250.0).unwrap();
        assert!((filter.gain(0.0, 250.0) - 1.0).abs() < 1e-12);
        assert!(
            (filter.gain(30.0, 250.0) - 0.5_f64.sqrt()).abs() < 1e-12,
            "order {order}"
        );
        let filter = LowPass::chebyshev1(order, 0.5, 30.0, 250.0).unwrap();
        assert!(
            (filter.gain(30.0, 250.0) - 10.0_f64.powf(-0.5 / 20.0)).abs() < 1e-12,
            "order {order}"
        );
    }
}

#[test]
fn columns_side_by_side_get_the_bits_that_they_get_alone() {
    let columns: Vec<Vec<f64>> = (0..11)
        .map(|k| {
            let bent = |x: f64| x.powi(2) - f64::from(k) * x;
            signal().into_iter().map(bent).collect()
        })
        .collect();
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let together = decimate_columns(&columns, 10).unwrap();
    assert_eq!(together.len(), columns.len());
    for (column, short) in columns.iter().zip(together) {
        assert_eq!(decimate(column, 10).unwrap(), short);
    }
}

#[test]
fn what_cannot_be_filtered_is_an_error_that_says_so() {
    let says = |error: modelmill_identify::FilterError| error.to_string();
    assert!(says(LowPass::butterworth(4, 600.0, 1000.0).unwrap_err()).contains("below 500"));
    assert!(says(LowPass::butterworth(4, f64::NAN, 1000.0).unwrap_err()).contains("NaN"));
    assert!(says(LowPass::butterworth(0, 10.0, 1000.0).unwrap_err()).contains("order"));
    let filter = LowPass::butterworth(4, 10.0, 100.0).unwrap();
    assert!(says(filter.zero_phase(&[0.0; 15]).unwrap_err()).contains("at least 16"));
    assert!(says(decimate(&[0.0; 20], 0).unwrap_err()).contains("decimation by 0"));
    assert!(says(decimate(&[0.0; 20], 2).unwrap_err()).contains("at least 28"));
    assert!(says(decimate_table(&[0.0; 20], 3, 2).unwrap_err()).contains("20 numbers"));
}
