use super::*;

/// A model of two links with other names.
fn model(names: [(&str, &str); 2]) -> Model {
    let text = std::fs::read_to_string("../model-spec/models/two_link.toml").unwrap();
    let text = names.iter().fold(text, |text, (old, new)| text.replace(old, new));
    Model::from_text("arm.toml", &text).unwrap()
}

/// Columns by their names and numbers.
fn signals(columns: Vec<(&str, Vec<f64>)>) -> Vec<FileSignal> {
    let columns = columns.into_iter();
    columns
        .map(|(name, values)| FileSignal::new(name.to_owned(), values))
        .collect()
}

/// The pair of a name of the model.
fn pair<'a>(pairing: &'a ColumnPairing<'_>, name: &str) -> Option<&'a ColumnPair> {
    pairing.ours.iter().find(|one| one.name == name)?.pair.as_ref()
}

#[test]
fn the_first_number_of_joints_is_that_of_the_file() {
    for (names, columns, first) in [
        ([("q1", "q0"), ("q2", "q1")], ["pos1", "pos2"], "from 1"),
        ([("q1", "q1"), ("q2", "q2")], ["pos0", "pos1"], "from 0"),
    ] {
        let arm = model(names);
        let columns = columns.map(|name| (name, Vec::new()));
        let mut pairing = ColumnPairing::new(&arm, signals(columns.to_vec()));
        pairing.pair_by_name(SignalRole::Position);
        let reasons = &pair(&pairing, names[0].1).unwrap().reasons;
        assert!(reasons[0].ends_with(first), "{reasons:?}");
    }
}

#[test]
fn a_guessed_unit_of_time_is_a_guess() {
    let arm = model([("q1", "q1"), ("q2", "q2")]);
    let time: Vec<f64> = (0..500).map(|k| 0.9999 * f64::from(k)).collect();
    let unit_of = |name: &str| {
        let mut pairing = ColumnPairing::new(&arm, signals(vec![(name, time.clone())]));
        pairing.pair_time();
        let pair = pair(&pairing, "t").unwrap().clone();
        (pair.unit, pair.is_guess)
    };
    assert_eq!(unit_of("time"), (Some("ms".to_owned()), true));
    assert_eq!(unit_of("time_ms"), (Some("ms".to_owned()), false));
    assert_eq!(unit_of("time [ms]"), (None, false));
}

#[test]
fn rates_of_names_that_end_like_rates_are_checked() {
    let arm = model([("q1", "arm_d"), ("q2", "q2")]);
    let time: Vec<f64> = (0..500).map(|k| 0.004 * f64::from(k)).collect();
    let of = |f: &dyn Fn(f64) -> f64| -> Vec<f64> { time.iter().map(|t| f(*t)).collect() };
    let position = of(&|t| (3.0 * t).sin());
    for (rate, is_rate) in [(of(&|t| 3.0 * (3.0 * t).cos()), true), (position.clone(), false)] {
        let columns = vec![
            ("t", time.clone()),
            ("arm_d", position.clone()),
            ("arm_d_d", rate),
            ("q2", of(&|t| (2.0 * t).sin())),
        ];
        let mut pairing = ColumnPairing::new(&arm, signals(columns));
        pairing.pair_equal_names();
        pairing.check_rates();
        let reasons = pair(&pairing, "arm_d_d").map(|pair| pair.reasons[0].as_str());
        assert_eq!(reasons.is_some_and(|reason| reason.contains("correlation")), is_rate);
        assert_eq!(
            pairing.remarks.iter().any(|says| says.contains("of `arm_d` by")),
            !is_rate
        );
    }
}

#[test]
fn a_unit_of_something_else_makes_a_pair_uncertain() {
    let arm = model([("q1", "q1"), ("q2", "q2")]);
    for (header, is_guess) in [("q1 [kg]", true), ("q1 [deg]", false), ("q1", false)] {
        let mut pairing = ColumnPairing::new(&arm, signals(vec![(header, Vec::new())]));
        pairing.pair_by_name(SignalRole::Position);
        pairing.doubt_foreign_units();
        let pair = pair(&pairing, "q1").unwrap();
        assert_eq!(pair.is_guess, is_guess, "{header}: {:?}", pair.reasons);
        assert_eq!(
            pair.reasons.iter().any(|reason| reason.contains("kg is no unit")),
            is_guess
        );
    }
}
