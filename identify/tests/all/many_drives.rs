//! The search on problems of many drives: friction in every joint of an arm, and claims that are no claims. Columns are
//! smooth functions of time; what is hidden is known.

use std::f64::consts::TAU;

use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, DiagnosisProblem, EffectParameter, ForceColumn,
    LocatedEffect, ModelDiagnosis, NoColumnProvider, SampleLayout, SampleSegment, SignConstraint, diagnose,
    reading_fault_candidates, white_noise,
};
use modelmill_runtime::RandomBits;

/// Samples of each of two recordings.
const SAMPLES: usize = 1000;
const STEP: f64 = 0.01;
const NOISE: f64 = 0.02;

/// Motion of a drive: position, rate and acceleration, as a sum of waves.
struct DriveMotion {
    position: Vec<f64>,
    rate: Vec<f64>,
    acceleration: Vec<f64>,
}

/// Random numbers for a seed.
struct Draw(RandomBits);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(RandomBits::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.0.above_zero().ln()).sqrt();
        radius * (TAU * self.0.above_zero()).cos()
    }

    fn motion(&mut self) -> DriveMotion {
        let waves: Vec<[f64; 3]> = (0..5)
            .map(|_| {
                let rate = TAU * (0.1 + 0.5 * self.0.above_zero());
                [rate, TAU * self.0.above_zero(), 0.4 * self.normal()]
            })
            .collect();
        let series = |of: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            let value = |i: usize| {
                let t = STEP * i as f64;
                let wave = |[rate, phase, size]: &[f64; 3]| size * of(*rate, rate * t + phase);
                waves.iter().map(wave).sum()
            };
            (0..2 * SAMPLES).map(value).collect()
        };
        DriveMotion {
            position: series(&|_, angle| angle.sin()),
            rate: series(&|rate, angle| rate * angle.cos()),
            acceleration: series(&|rate, angle| -rate * rate * angle.sin()),
        }
    }
}

/// A column on one of several channels.
fn column(channels: usize, channel: usize, values: Vec<f64>) -> ForceColumn {
    let mut column = ForceColumn(vec![None; channels]);
    column.0[channel] = Some(values);
    column
}

/// A candidate with one parameter at a drive.
fn candidate(kind: &str, drive: &str, column: ForceColumn, sign: SignConstraint) -> CandidateEffect {
    CandidateEffect {
        effect: LocatedEffect {
            kind: kind.into(),
            at: vec![drive.into()],
        },
        parameters: vec![EffectParameter {
            symbol: "p".into(),
            unit: "N m".into(),
            sign,
        }],
        searched_constants: 0,
        is_part_of_load: false,
        refines: None,
        nature: CandidateNature::Effect,
        is_per_run: false,
        source: ColumnSource::Columns(vec![ColumnChoice {
            constants: Vec::new(),
            columns: vec![column],
        }]),
    }
}

/// An arm whose base columns act on all drives; `hidden` is the force of each drive beyond it. Five kinds are candidates
/// at every drive.
fn arm(seed: u64, drives: usize, hidden: &dyn Fn(&DriveMotion) -> Vec<f64>) -> DiagnosisProblem {
    let mut draw = Draw::new(seed);
    let motions: Vec<DriveMotion> = (0..drives).map(|_| draw.motion()).collect();
    let names: Vec<String> = (0..drives).map(|d| format!("drive{d}")).collect();
    // Bodies move with several drives, so that every column acts on the drives below.
    let base: Vec<ForceColumn> = (0..3 * drives)
        .map(|k| {
            let d = k / 3;
            let on = |channel: usize| -> Vec<f64> {
                let of = |i: usize| match k % 3 {
                    0 => motions[d].acceleration[i] * (1.0 + 0.2 * motions[channel].position[i]),
                    1 => (motions[d].position[i] + 0.5 * motions[channel].position[i]).sin(),
                    _ => (motions[d].position[i] - 0.3 * motions[channel].position[i]).cos(),
                };
                (0..2 * SAMPLES).map(of).collect()
            };
            ForceColumn((0..drives).map(|channel| (channel <= d).then(|| on(channel))).collect())
        })
        .collect();
    let mut measured = ForceColumn(
        (motions.iter())
            .map(|motion| {
                let noise = hidden(motion).into_iter().map(|x| x + NOISE * draw.normal());
                Some(noise.collect())
            })
            .collect(),
    );
    for (k, column) in base.iter().enumerate() {
        measured.add(1.0 + 0.3 * (k as f64).sin(), column);
    }
    let positive = SignConstraint::Positive;
    let candidates = (0..drives).flat_map(|d| {
        let motion = &motions[d];
        let at = |kind: &str, values: Vec<f64>, sign| candidate(kind, &names[d], column(drives, d, values), sign);
        [
            at("viscous_friction", motion.rate.clone(), positive),
            at(
                "coulomb_friction",
                motion.rate.iter().map(|v| v.signum()).collect(),
                positive,
            ),
            at(
                "quadratic_friction",
                motion.rate.iter().map(|v| v * v.abs()).collect(),
                positive,
            ),
            at("drive_inertia", motion.acceleration.clone(), positive),
            at("spring", motion.position.clone(), SignConstraint::Any),
        ]
    });
    let segment = |name: &str, is_check: bool| SampleSegment {
        name: name.into(),
        samples: SAMPLES,
        start: 0.0,
        step: STEP,
        recorded_step: STEP,
        is_check,
    };
    DiagnosisProblem {
        layout: SampleLayout {
            channels: names.clone(),
            segments: vec![segment("fit", false), segment("check", true)],
            left_out: Vec::new(),
        },
        noise: measured.0.iter().flatten().map(|force| white_noise(force)).collect(),
        measured,
        base_is_part_of_load: vec![true; base.len()],
        base,
        candidates: candidates.collect(),
        effects_only: true,
        ..DiagnosisProblem::default()
    }
}

fn answer(problem: &DiagnosisProblem) -> ModelDiagnosis {
    diagnose(&mut problem.clone(), &NoColumnProvider)
}

/// Kinds with places, sorted.
fn found(diagnosis: &ModelDiagnosis) -> Vec<String> {
    let effects = diagnosis.effects.iter().map(|found| &found.effect);
    let mut all: Vec<String> = effects.map(|e| format!("{} {}", e.kind, e.at.join(" "))).collect();
    all.sort_unstable();
    all
}

/// Friction of two kinds in every joint is found: one effect alone leaves a smooth residual on its drive.
#[test]
fn two_kinds_of_friction_are_found_in_all_drives() {
    for seed in 0..3 {
        let friction = |motion: &DriveMotion| motion.rate.iter().map(|v| 2.0 * v.signum() + 1.5 * v).collect();
        let diagnosis = answer(&arm(seed, 6, &friction));
        let expected: Vec<String> = ["coulomb_friction", "viscous_friction"]
            .iter()
            .flat_map(|kind| (0..6).map(move |d| format!("{kind} drive{d}")))
            .collect();
        assert_eq!(found(&diagnosis), expected, "seed {seed}");
        for effect in &diagnosis.effects {
            let truth = if effect.effect.kind == "coulomb_friction" {
                2.0
            } else {
                1.5
            };
            assert!((effect.estimates[0] - truth).abs() < 0.1, "seed {seed}: {effect:?}");
        }
        // No step gives back what an earlier one has gained.
        let checks: Vec<f64> = diagnosis.steps.iter().map(|step| step.check).collect();
        assert!(checks.windows(2).all(|pair| pair[1] <= 1.002 * pair[0]), "{checks:?}");
    }
}

/// Nothing is claimed at all drives together where one drive lacks one effect, and nothing where none lacks any.
#[test]
fn kinds_at_all_drives_are_not_claimed_for_one() {
    for seed in 10..13 {
        let diagnosis = answer(&arm(seed, 4, &|motion: &DriveMotion| vec![0.0; motion.rate.len()]));
        assert_eq!(found(&diagnosis), [""; 0], "seed {seed}");
        let mut problem = arm(seed, 4, &|motion: &DriveMotion| vec![0.0; motion.rate.len()]);
        let ColumnSource::Columns(choices) = &problem.candidates[6].source else {
            panic!("known columns");
        };
        let coulomb = choices[0].columns[0].clone();
        problem.measured.add(1.0, &coulomb);
        assert_eq!(found(&answer(&problem)), ["coulomb_friction drive1"], "seed {seed}");
    }
}

/// A column that is nearly one of the model needs a force far above that of the drive, which is no claim.
#[test]
fn a_force_far_above_that_of_the_drive_is_no_claim() {
    let mut problem = arm(20, 2, &|motion: &DriveMotion| {
        motion.rate.iter().map(|v| (3.0 * v).sin()).collect()
    });
    let mut draw = Draw::new(21);
    let small: Vec<f64> = draw.motion().position.iter().map(|x| 1e-2 * x).collect();
    let mut nearly = ForceColumn(vec![problem.base[0].0[0].clone(), None]);
    nearly.add(1.0, &column(2, 0, small.clone()));
    let hidden = column(2, 0, small);
    problem.measured.add(200.0, &hidden);
    problem.base.push(ForceColumn(vec![problem.base[0].0[0].clone(), None]));
    problem.base_is_part_of_load.push(true);
    problem.candidates = vec![candidate("balance", "drive0", nearly, SignConstraint::Any)];
    problem.effects_only = false;
    let diagnosis = answer(&problem);
    assert_eq!(found(&diagnosis), [""; 0]);
    let refused = diagnosis.candidates[0]
        .rejection_reason
        .map(modelmill_identify::diagnose::RejectionReason::name);
    assert_eq!(refused, Some("implausible value"));
}

/// A scale of the force signal is claimed if the force is scaled, and not if the signal does not follow the motion.
#[test]
fn a_scale_near_minus_one_is_no_scale() {
    let zero = |motion: &DriveMotion| vec![0.0; motion.rate.len()];
    for (scale, expected) in [(0.8, vec!["drive_gain drive1"]), (-0.05, vec![])] {
        let mut problem = arm(30, 3, &zero);
        for x in problem.measured.0[1].iter_mut().flatten() {
            *x *= scale;
        }
        problem.candidates.extend(reading_fault_candidates(&problem));
        assert_eq!(found(&answer(&problem)), expected, "scale {scale}");
    }
}

/// A force signal after a mixture of a delay and a low-pass of the same time, in samples; `share` is that of the
/// low-pass.
fn shifted(force: &[f64], time: usize, share: f64) -> Vec<f64> {
    let constant = time as f64;
    let keeps = (-constant.recip()).exp();
    let mut state = force[0];
    let mut before = force[0];
    (0..force.len())
        .map(|i| {
            // Exact for a force that is linear between its samples.
            let slope = force[i] - before;
            state = force[i] - slope * constant + (state - before + slope * constant) * keeps;
            before = force[i];
            (1.0 - share) * force[i.saturating_sub(time)] + share * state
        })
        .collect()
}

/// A delay or a low-pass is stated alone where the forces show it. A short one bends the force too little for that: either
/// may be true, and they share the probability.
#[test]
fn a_short_delay_is_not_distinguished_from_a_low_pass() {
    let zero = |motion: &DriveMotion| vec![0.0; motion.rate.len()];
    for (time, share, kinds, is_clear) in [
        (8, 0.0, &["time_delay"][..], true),
        (8, 1.0, &["force_lag"][..], true),
        (1, 0.0, &["time_delay", "force_lag"][..], false),
    ] {
        let mut problem = arm(40, 3, &zero);
        let signal = problem.measured.0[1].clone().unwrap();
        let mut changed: Vec<f64> = signal
            .chunks(SAMPLES)
            .flat_map(|run| shifted(run, time, share))
            .collect();
        let mut draw = Draw::new(41);
        for x in &mut changed {
            *x += NOISE * draw.normal();
        }
        problem.measured.0[1] = Some(changed);
        problem.effects_only = false;
        problem.candidates = reading_fault_candidates(&problem);
        let diagnosis = answer(&problem);
        let [effect] = &diagnosis.effects[..] else {
            panic!("{share}: {:?}", found(&diagnosis));
        };
        assert!(kinds.contains(&effect.effect.kind.as_str()), "{share}: {effect:?}");
        let others: Vec<&str> = effect
            .indistinguishable_from
            .iter()
            .map(|other| other.kind.as_str())
            .collect();
        assert_eq!(others.is_empty(), is_clear, "{share}: {others:?}");
        assert_eq!(effect.probability > 0.9, is_clear, "{share}: {}", effect.probability);
    }
}
