//! Dependence on the rate: synthetic residuals of known truth, and noise without any.

use super::*;
use crate::test_noise::TestNoise;

/// A motion of two sines without residual, under a load that changes with the position.
fn motion(samples: u32) -> DriveResidual {
    let time: Vec<f64> = (0..samples).map(|i| 0.01 * f64::from(i)).collect();
    let position: Vec<f64> = time.iter().map(|t| (1.3 * t).sin() + 0.4 * (3.1 * t).cos()).collect();
    let rate = (time.iter()).map(|t| 1.3 * (1.3 * t).cos() - 1.24 * (3.1 * t).sin());
    DriveResidual {
        rate: rate.collect(),
        residual: vec![0.0; time.len()],
        load: position.iter().map(|q| 40.0 * (0.7 * q + 0.3).sin()).collect(),
        excluded: vec![false; time.len()],
        position,
        time,
    }
}

/// Accelerations of [`motion`].
fn exact_accelerations(time: &[f64]) -> Vec<f64> {
    let one = |t: &f64| -1.69 * (1.3 * t).sin() - 3.844 * (3.1 * t).cos();
    time.iter().map(one).collect()
}

/// The motion with this residual for each sample, and noise with the correlation of neighbours `correlation`.
fn with_residual(
    correlation: f64,
    std: f64,
    seed: u64,
    residual: impl Fn(&DriveResidual, usize) -> f64,
) -> DriveResidual {
    let mut segment = motion(6000);
    let mut noise = TestNoise::new(seed);
    let drive = std * (1.0 - correlation * correlation).sqrt();
    let mut state = std * noise.normal();
    segment.residual = (0..6000)
        .map(|i| {
            state = correlation * state + drive * noise.normal();
            state + residual(&segment, i)
        })
        .collect();
    segment
}

/// The dependence on one term.
fn dependence(found: &[RateDependence], term: RateTerm) -> &RateDependence {
    let one = found.iter().find(|one| one.term == term);
    one.unwrap_or_else(|| panic!("{term:?} is not in {found:#?}"))
}

/// The terms that are found.
fn terms(found: &[RateDependence]) -> Vec<RateTerm> {
    found.iter().map(|one| one.term).collect()
}

/// Checks a value within some standard deviations, which must be small.
fn check(one: &RateDependence, truth: f64) {
    assert!(
        (one.value - truth).abs() < 4.0 * one.std + 0.03 * truth.abs(),
        "{one:?}, true {truth}"
    );
    assert!(one.std < 0.15 * truth.abs(), "{one:?}, true {truth}");
}

#[test]
fn dry_friction_is_found_with_its_levels_and_share() {
    for correlation in [0.0, 0.9] {
        let segment = with_residual(correlation, 1.0, 3, |d, i| 2.0 * d.rate[i].signum() + 0.5);
        let found = find_rate_dependence("joint2", "N m", &[segment]);
        assert_eq!(terms(&found), [RateTerm::Sign]);
        check(&found[0], 2.0);
        let levels = found[0].levels.unwrap();
        assert!((levels.positive - 2.5).abs() < 4.0 * levels.positive_std, "{levels:?}");
        assert!((levels.negative + 1.5).abs() < 4.0 * levels.negative_std, "{levels:?}");
        assert!((found[0].share - 4.0 / 5.25).abs() < 0.07, "{found:?}");
        assert_eq!((found[0].unit.as_str(), found[0].alternative), ("N m", None));
        assert!(
            found[0]
                .says
                .starts_with("The residual of joint2 follows the sign of its velocity: +2.")
        );
        assert!(found[0].says.contains("as dry friction of"), "{}", found[0].says);
        assert_eq!(serde_json::to_value(&found[0]).unwrap()["term"], "sign");
    }
}

#[test]
fn too_much_dry_friction_is_found_as_less() {
    let segment = with_residual(0.5, 0.5, 4, |d, i| -2.0 * d.rate[i].signum());
    let found = find_rate_dependence("a", "N", &[segment]);
    assert_eq!(terms(&found), [RateTerm::Sign]);
    check(&found[0], -2.0);
    assert!(
        found[0].says.contains("less dry friction than in the model"),
        "{}",
        found[0].says
    );
}

#[test]
fn viscous_friction_is_found_alone_and_with_dry_friction() {
    let segment = with_residual(0.5, 0.5, 5, |d, i| 1.5 * d.rate[i]);
    let found = find_rate_dependence("a", "N", &[segment]);
    assert_eq!(terms(&found), [RateTerm::Rate]);
    check(&found[0], 1.5);
    assert_eq!(found[0].unit, "N s/m");

    let segment = with_residual(0.5, 0.3, 6, |d, i| 1.0 * d.rate[i].signum() + 1.0 * d.rate[i]);
    let found = find_rate_dependence("a", "N m", &[segment]);
    assert_eq!(terms(&found), [RateTerm::Sign, RateTerm::Rate]);
    check(&found[0], 1.0);
    check(&found[1], 1.0);
    assert_eq!(found[1].unit, "N m s/rad");
}

/// A fit with viscous friction alone has taken up as much of the dry friction as it can.
#[test]
fn dry_friction_is_found_behind_fitted_viscous_friction() {
    let rate = motion(6000).rate;
    let slope = rate.iter().map(|v| v.abs()).sum::<f64>() / sum_of_squares(&rate);
    let segment = with_residual(0.5, 0.2, 7, |d, i| 2.0 * (d.rate[i].signum() - slope * d.rate[i]));
    let found = find_rate_dependence("a", "N m", &[segment]);
    assert_eq!(terms(&found), [RateTerm::Sign, RateTerm::Rate]);
    check(&found[0], 2.0);
    check(&found[1], -2.0 * slope);
    assert!(found.iter().all(|one| one.share <= 1.0));
}

#[test]
fn load_dependent_friction_is_found() {
    let segment = with_residual(0.5, 0.5, 8, |d, i| 0.1 * d.load[i].abs() * d.rate[i].signum());
    let found = find_rate_dependence("a", "N m", &[segment]);
    assert_eq!(terms(&found), [RateTerm::Sign, RateTerm::Load]);
    check(dependence(&found, RateTerm::Load), 0.1);
}

#[test]
fn hysteresis_is_found_and_inertia_is_not_taken_for_it() {
    let acceleration = exact_accelerations(&motion(6000).time);
    let segment = with_residual(0.5, 0.3, 9, |d, i| {
        2.0 * d.rate[i].signum() + 1.5 * acceleration[i].signum() + 0.5 * acceleration[i]
    });
    let found = find_rate_dependence("a", "N m", &[segment]);
    assert_eq!(terms(&found), [RateTerm::Sign, RateTerm::Hysteresis]);
    check(dependence(&found, RateTerm::Sign), 2.0);
    check(dependence(&found, RateTerm::Hysteresis), 3.0);

    let segment = with_residual(0.5, 0.3, 10, |d, i| 0.5 * acceleration[i] + 3.0 * d.position[i].cos());
    let found = find_rate_dependence("a", "N m", &[segment]);
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn white_and_coloured_noise_show_nothing() {
    for correlation in [0.0, 0.9, 0.99, 0.998] {
        for seed in 0..25 {
            let segment = with_residual(correlation, 1.0, seed, |_, _| 0.0);
            let found = find_rate_dependence("a", "N m", &[segment]);
            assert!(found.is_empty(), "correlation {correlation}, seed {seed}: {found:#?}");
        }
    }
}

#[test]
fn small_friction_in_much_noise_is_not_material() {
    let segment = with_residual(0.0, 1.0, 11, |d, i| 0.2 * d.rate[i].signum());
    let found = find_rate_dependence("a", "N m", &[segment]);
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn one_speed_cannot_distinguish_dry_from_viscous_friction() {
    let mut segment = with_residual(0.0, 0.3, 12, |_, _| 0.0);
    for i in 0..6000 {
        let sign = if (i / 300) % 2 == 0 { 1.0 } else { -1.0 };
        segment.rate[i] = 0.5 * sign;
        segment.position[i] = f64::from(u16::try_from(i % 300).unwrap()) * 0.005 * sign;
        segment.residual[i] += 2.0 * sign;
    }
    let found = find_rate_dependence("a", "N", &[segment]);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].alternative.is_some(), "{found:#?}");
    assert!(found[0].says.contains("cannot distinguish"), "{}", found[0].says);
}

/// At standstill friction takes any value, samples without a measured force have none, and drift is no friction.
#[test]
fn standstill_faults_and_single_movements_do_not_count() {
    let mut segment = with_residual(0.5, 0.5, 13, |d, i| 2.0 * d.rate[i].signum());
    let mut still = segment.clone();
    for i in 0..6000 {
        still.rate[i] = 0.001 * segment.residual[i].signum();
        still.residual[i] = 50.0;
    }
    for i in 1000..1200 {
        segment.residual[i] = if i % 2 == 0 { 900.0 } else { f64::NAN };
        segment.excluded[i] = i % 2 == 0;
    }
    let found = find_rate_dependence("a", "N m", &[segment, still]);
    assert_eq!(terms(&found), [RateTerm::Sign]);
    check(&found[0], 2.0);

    let mut single = motion(200);
    for i in 0..200 {
        single.rate[i] = if i < 100 { 1.0 } else { -1.0 };
        single.residual[i] = single.rate[i];
    }
    assert!(find_rate_dependence("a", "N m", &[single]).is_empty());
}

#[test]
fn odd_input_does_not_panic() {
    assert!(find_rate_dependence("a", "N", &[]).is_empty());
    assert!(find_rate_dependence("a", "N", &[DriveResidual::default()]).is_empty());
    assert!(find_rate_dependence("a", "N", &[motion(6000)]).is_empty());
    let mut odd = motion(400);
    odd.load.pop();
    assert!(find_rate_dependence("a", "N", &[odd]).is_empty());
    let mut odd = motion(400);
    odd.rate.fill(f64::NAN);
    assert!(find_rate_dependence("a", "N", &[odd]).is_empty());
    let mut odd = motion(400);
    odd.time.fill(0.0);
    assert!(find_rate_dependence("a", "N", &[odd]).is_empty());
}

/// The estimate of dry friction is not biased by viscous friction that is too small to be reported.
#[test]
fn small_terms_stay_in_the_fit() {
    let segment = with_residual(0.5, 0.1, 14, |d, i| 2.0 * d.rate[i].signum() + 0.4 * d.rate[i]);
    let found = find_rate_dependence("a", "N m", &[segment]);
    assert_eq!(terms(&found), [RateTerm::Sign]);
    check(&found[0], 2.0);
    assert!(
        found[0].says.contains("at small positive velocity"),
        "{}",
        found[0].says
    );
}
