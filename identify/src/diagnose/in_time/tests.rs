use super::super::problem::{SampleLayout, SampleSegment};
use super::*;
use crate::test_noise::TestNoise;

/// Names of recordings.
const RECORDINGS: [&str; 8] = ["one", "two", "three", "four", "five", "six", "seven", "eight"];

/// Two recordings of 20 s at 50 Hz of one drive, whose force is 3 N per unit of a column plus noise of 0.2 N.
fn problem(seed: u64, change: impl Fn(usize, f64, f64) -> f64) -> DiagnosisProblem {
    problem_with(2, seed, change)
}

/// The same with some recordings, of which the last one is the validation run.
fn problem_with(recordings: usize, seed: u64, change: impl Fn(usize, f64, f64) -> f64) -> DiagnosisProblem {
    let samples = 1000 * recordings;
    let mut noise = TestNoise::new(seed);
    let segment = |name: &str, is_check: bool| SampleSegment {
        name: name.to_owned(),
        samples: 1000,
        start: 100.0,
        step: 0.02,
        recorded_step: 0.02,
        is_check,
    };
    let time = |i: usize| 0.02 * (i % 1000) as f64;
    let column: Vec<f64> = (0..samples)
        .map(|i| (1.9 * time(i)).sin() + 0.6 * (4.1 * time(i) + 1.0).cos() + 0.4)
        .collect();
    let force = |i: usize| {
        let plain = 3.0 * column[i];
        plain + change(i / 1000, time(i), plain) + 0.2 * noise.normal()
    };
    let measured: Vec<f64> = (0..samples).map(force).collect();
    let mut problem = DiagnosisProblem {
        layout: SampleLayout {
            channels: vec!["a".into()],
            segments: (0..recordings)
                .map(|run| segment(RECORDINGS[run], run + 1 == recordings))
                .collect(),
            left_out: Vec::new(),
        },
        measured: ForceColumn(vec![Some(measured)]),
        base: vec![
            ForceColumn(vec![Some(column)]),
            ForceColumn(vec![Some(vec![1.0; samples])]),
        ],
        noise: vec![0.2],
        idle: vec![false],
        idle_squares: Vec::new(),
        removed: vec![0.0],
        ..DiagnosisProblem::default()
    };
    problem.change_shapes = signal_changes(&problem, &["N".to_owned()]);
    problem
}

fn found(problem: &DiagnosisProblem) -> Vec<FoundChange> {
    find_changes(problem, &problem.base.iter().collect::<Vec<_>>())
}

/// The change with the kind, with its time in the first recording that has it.
fn interval_of(found: &[FoundChange], kind: &str) -> Option<(String, [f64; 2], bool)> {
    let of_kind = found.iter().find(|one| one.candidate.effect.kind == kind)?;
    let first = &of_kind.intervals[0];
    Some((first.recording.clone(), first.interval, first.lasts))
}

#[test]
fn a_step_is_found_at_its_time() {
    for seed in 0..10 {
        let scaled = problem(
            seed,
            |run, t, force| if run == 1 && t >= 12.34 { 0.15 * force } else { 0.0 },
        );
        let (recording, [from, _], lasts) = interval_of(&found(&scaled), "gain_change").unwrap();
        assert_eq!((recording.as_str(), lasts), ("two", true), "seed {seed}");
        // The force is small about that time, so that its scale shows late.
        assert!((from - 112.34).abs() < 0.6, "seed {seed}: {from}");
        let jumped = problem(seed, |run, t, _| if run == 0 && t >= 7.5 { 0.5 } else { 0.0 });
        let (recording, [from, _], _) = interval_of(&found(&jumped), "offset_step").unwrap();
        assert_eq!(recording, "one");
        assert!((from - 107.5).abs() < 0.4, "seed {seed}: {from}");
    }
}

/// A step in each recording is found in each, a large and a small one in both, and a large one alone leaves no steps in the
/// other recordings, though it biases the fit of all.
#[test]
fn steps_are_found_in_the_recordings_that_have_them() {
    for seed in 0..5 {
        for (recordings, sizes) in [
            (3, vec![1.0, 1.0, 1.0]),
            (8, vec![1.0; 8]),
            (2, vec![3.0, 1.0]),
            (3, vec![6.0, 0.0, 0.0]),
            (8, vec![0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ] {
            let jumped = problem_with(recordings, seed, |run, t, _| if t >= 9.0 { sizes[run] } else { 0.0 });
            let found = found(&jumped);
            let step = found.iter().find(|one| one.candidate.effect.kind == "offset_step");
            let names: Vec<&str> = (step.iter().flat_map(|one| &one.intervals))
                .map(|one| one.recording.as_str())
                .collect();
            let expected: Vec<&str> = (0..recordings)
                .filter(|r| sizes[*r] > 0.0)
                .map(|r| RECORDINGS[r])
                .collect();
            assert_eq!(names, expected, "seed {seed}, steps {sizes:?}");
        }
    }
}

#[test]
fn an_interval_has_an_end() {
    for seed in 0..10 {
        let between = problem(
            seed,
            |run, t, _| if run == 0 && (6.0..9.0).contains(&t) { 1.0 } else { 0.0 },
        );
        let (_, [from, to], lasts) = interval_of(&found(&between), "offset_step").unwrap();
        assert!(
            !lasts && (from - 106.0).abs() < 0.2 && (to - 109.0).abs() < 0.2,
            "{from} {to}"
        );
    }
}

/// Noise has no steps, and a zero that drifts evenly or comes to rest has none either.
#[test]
fn noise_and_drift_are_no_steps() {
    for seed in 0..20 {
        assert!(found(&problem(seed, |_, _, _| 0.0)).is_empty(), "seed {seed}");
        let drifting = problem(seed, |_, t, _| 0.05 * t);
        assert_eq!(interval_of(&found(&drifting), "offset_step"), None, "seed {seed}");
        let warming = problem(seed, |_, t, _| (-t / 4.0).exp());
        assert_eq!(interval_of(&found(&warming), "offset_step"), None, "seed {seed}");
    }
}

/// Noise of positions that is derived twice and cut off by a low-pass is no resonance; a ringing joint is one.
#[test]
fn a_resonance_is_no_noise_of_derivatives() {
    let problem = problem(1, |_, _, _| 0.0);
    let scaled = |values: Vec<f64>| -> Vec<f64> {
        let size = (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
        values.iter().map(|x| 0.8 * x / size).collect()
    };
    let frequency = |rest: &[f64]| {
        let found = time_residual(&problem, 0, rest, 0.0)?;
        (found.character == ResidualCharacter::Resonance).then_some(found.frequency)?
    };
    for seed in 0..10 {
        let mut noise = TestNoise::new(seed);
        let positions: Vec<f64> = (0..2000).map(|_| noise.normal()).collect();
        for cutoff in [4.0, 6.0, 9.0] {
            let filter = crate::signal::LowPass::butterworth(4, cutoff, 50.0).expect("a filter");
            let smooth = filter.zero_phase(&positions).expect("enough samples");
            let mut derived = vec![0.0; 2000];
            for i in 1..1999 {
                derived[i] = smooth[i + 1] - 2.0 * smooth[i] + smooth[i - 1];
            }
            assert_eq!(frequency(&scaled(derived)), None, "{seed} {cutoff}");
        }
        // A joint with 6 Hz and a damping ratio of 0.02, excited by noise.
        let (rate, damping) = (std::f64::consts::TAU * 6.0, 0.02);
        let [mut x, mut v] = [0.0, 0.0];
        let mut ring = Vec::new();
        for force in &positions {
            for _ in 0..20 {
                v += 0.001 * (force - 2.0 * damping * rate * v - rate * rate * x);
                x += 0.001 * v;
            }
            ring.push(x);
        }
        let found = frequency(&scaled(ring)).expect("a resonance");
        assert!((found - 6.0).abs() < 0.3, "{seed}: {found}");
    }
}

/// One spike of a rate does not turn slow motion into standstill.
#[test]
fn a_spike_of_a_rate_is_no_top_speed() {
    let mut problem = problem(1, |_, _, _| 0.0);
    let mut rate: Vec<f64> = (0..2000).map(|i| (0.01 * f64::from(i)).sin()).collect();
    rate[700] = 1e3;
    problem.friction = vec![ForceColumn(vec![Some(rate)])];
    let standing = standstill_samples(&problem, 0).iter().filter(|stands| **stands).count();
    // A sine is below 2 % of its amplitude for 1.3 % of the time.
    assert!((10..60).contains(&standing), "{standing}");
}
