//! Rows per second of the streaming least squares and of its second pass, on one core:
//! `cargo run --release -p modelmill-identify --example least_squares_speed`.

use std::time::Instant;

use modelmill_identify::LeastSquares;
use modelmill_identify::estimate::uncertainty_with_autocorrelation;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for (parameters, channels, samples) in [(6, 2, 1_000_000), (43, 7, 100_000)] {
        let block = 512 * channels;
        let w: Vec<f64> = (0..block * parameters).map(|i| (i as f64 * 0.713).sin()).collect();
        let y: Vec<f64> = (0..block).map(|i| (i as f64 * 0.31).cos()).collect();
        let blocks = samples / 512;
        let start = Instant::now();
        let mut regression = LeastSquares::new(parameters);
        for _ in 0..blocks {
            regression.add_rows(&w, &y)?;
        }
        let solution = regression.solve()?;
        let first = start.elapsed().as_secs_f64();
        let start = Instant::now();
        uncertainty_with_autocorrelation(&solution, channels, |visit| (0..blocks).try_for_each(|_| visit(&w, &y)))?;
        let second = start.elapsed().as_secs_f64();
        let rate = |seconds: f64| f64::from(blocks * 512) / seconds / 1e6;
        println!(
            "{parameters} parameters, {channels} channels: {:.2} million samples/s, deviations {:.2} million samples/s",
            rate(first),
            rate(second)
        );
    }
    Ok(())
}
