//! Emitted functions over many states give what they give one by one, and fail where that fails.

use modelmill_generated::{five_bar, panda, spidermill, three_rrr};
use modelmill_runtime::PoseError;
use modelmill_runtime::blocks::BlockError;
use modelmill_tests::fixtures::derived;
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

/// Largest difference, relative to the largest magnitude of its kind.
fn difference(found: &[f64], expected: &[f64]) -> f64 {
    let scale = expected.iter().fold(1e-30, |m: f64, x| m.max(x.abs()));
    let pairs = found.iter().zip(expected);
    pairs.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / scale
}

/// States of a model around its nominal pose, 8 n + 3 of them so that the last line is not full.
macro_rules! check {
    ($model:ident $name:literal, $float:ty, $tolerance:literal) => {{
        let derivation = derived($name);
        let sample = Sample::random(&derivation.mechanism, 203, 0.2, &mut Stream::new(11));
        let column = |c: &Vec<f64>| c.iter().map(|x| *x as $float).collect::<Vec<$float>>();
        let [q, qd, qdd] =
            [&sample.q, &sample.qd, &sample.qdd].map(|columns| columns.iter().map(column).collect::<Vec<_>>());
        let geometry = $model::Geometry::<$float>::default();
        let base = $model::base_parameters(&geometry, &$model::Parameters::default()).unwrap();
        let dynamics = $model::InverseDynamics::new(&geometry, &base);
        let model = $model::Model::new(&geometry);
        let state = |i: usize| $model::State {
            q: std::array::from_fn(|k| q[k][i]),
            qd: std::array::from_fn(|k| qd[k][i]),
            qdd: std::array::from_fn(|k| qdd[k][i]),
        };
        // Up to the first state that has no answer.
        let n = (0..203).take_while(|i| dynamics.forces(&state(*i)).is_ok()).count();
        assert!(n > 10, "{n}");
        let upto = |n: usize| $model::States {
            q: std::array::from_fn(|k| &q[k][..n]),
            qd: std::array::from_fn(|k| &qd[k][..n]),
            qdd: std::array::from_fn(|k| &qdd[k][..n]),
        };
        let mut forces = vec![vec![0.0 as $float; n]; $model::N_DRIVES];
        let mut in_parallel = forces.clone();
        let mut regressor = vec![0.0 as $float; $model::N_DRIVES * $model::N_BASE * n];
        {
            let mut columns = forces.iter_mut();
            let mut columns = std::array::from_fn(|_| &mut columns.next().unwrap()[..]);
            dynamics.forces_of_many(&upto(n), &mut columns).unwrap();
            let mut columns = in_parallel.iter_mut();
            let mut columns = std::array::from_fn(|_| &mut columns.next().unwrap()[..]);
            dynamics.forces_of_many_in_parallel(&upto(n), &mut columns).unwrap();
        }
        assert_eq!(forces, in_parallel);
        model.regressor_of_many(&upto(n), &mut regressor).unwrap();
        let [mut found, mut expected] = [Vec::new(), Vec::new()];
        let [mut found_h, mut expected_h] = [Vec::new(), Vec::new()];
        for i in 0..n {
            let (one, h) = (dynamics.forces(&state(i)).unwrap(), model.regressor(&state(i)).unwrap());
            expected.extend(one.map(f64::from));
            found.extend(forces.iter().map(|f| f64::from(f[i])));
            expected_h.extend(h.as_flattened().iter().map(|x| f64::from(*x)));
            found_h.extend((0..$model::N_DRIVES * $model::N_BASE).map(|k| f64::from(regressor[k * n + i])));
        }
        for error in [difference(&found, &expected), difference(&found_h, &expected_h)] {
            assert!(error < $tolerance, "{}: {error}", $name);
        }
        if n < 203 {
            let reason = dynamics.forces(&state(n)).unwrap_err();
            let mut forces = vec![vec![0.0 as $float; 203]; $model::N_DRIVES];
            let mut columns = forces.iter_mut();
            let mut columns = std::array::from_fn(|_| &mut columns.next().unwrap()[..]);
            let fault = dynamics.forces_of_many(&upto(203), &mut columns).unwrap_err();
            assert_eq!(fault, BlockError::At { sample: n, reason });
        }
    }};
}

#[test]
fn many_states_give_what_one_gives() {
    check!(panda "panda", f64, 1e-14);
    check!(five_bar "five_bar", f64, 1e-13);
    check!(spidermill "spidermill", f64, 1e-12);
    // The passive coordinates are followed from the state before, so they agree as far as Newton's method goes.
    check!(three_rrr "three_rrr", f64, 1e-10);
}

#[test]
#[allow(clippy::cast_possible_truncation, reason = "that is asked for")]
fn in_single_precision_too() {
    check!(panda "panda", f32, 1e-5);
    check!(five_bar "five_bar", f32, 1e-4);
}

/// A Panda that moves a little, with one number replaced.
fn forces_with(n: usize, at: usize, q: f64) -> (Result<(), BlockError>, Vec<Vec<f64>>) {
    let column: Vec<f64> = (0..n).map(|i| 0.1 + 0.01 * i as f64).collect();
    let mut odd = column.clone();
    odd[at] = q;
    let geometry = panda::Geometry::default();
    let base = panda::base_parameters(&geometry, &panda::Parameters::default()).unwrap();
    let dynamics = panda::InverseDynamics::new(&geometry, &base);
    let mut states = panda::States {
        q: [&column[..]; 7],
        qd: [&column[..]; 7],
        qdd: [&column[..]; 7],
    };
    states.q[2] = &odd;
    let mut forces = vec![vec![0.0; n]; 7];
    let mut columns = forces.iter_mut();
    let mut columns = std::array::from_fn(|_| &mut columns.next().unwrap()[..]);
    let result = dynamics.forces_of_many(&states, &mut columns);
    (result, forces)
}

#[test]
fn what_is_no_number_is_found_where_it_stands() {
    for (at, odd) in [(0, f64::NAN), (7, f64::INFINITY), (8, -1e200), (20, f64::NAN)] {
        let (result, forces) = forces_with(21, at, odd);
        let reason = PoseError::NotFinite("q3");
        assert_eq!(result, Err(BlockError::At { sample: at, reason }));
        let (_, regular) = forces_with(21, at, 0.3);
        if at > 0 {
            let error = difference(&forces[6][..at], &regular[6][..at]);
            assert!(error < 1e-14, "{error}");
        }
        let text = result.unwrap_err().to_string();
        assert_eq!(
            text,
            format!("at sample {at}: `q3` is NaN, infinite or too large to compute with")
        );
    }
}

#[test]
fn angles_of_many_turns_are_still_angles() {
    let (result, forces) = forces_with(21, 13, 0.3 + 40_000.0 * std::f64::consts::TAU);
    result.unwrap();
    let (_, expected) = forces_with(21, 13, 0.3);
    let error = difference(&forces.concat(), &expected.concat());
    assert!(error < 1e-9, "{error}");
}

#[test]
fn arrays_of_different_lengths_are_refused() {
    let (long, short) = (vec![0.1; 12], vec![0.1; 9]);
    let model = panda::Model::new(&panda::Geometry::default());
    let mut states = panda::States {
        q: [&long[..]; 7],
        qd: [&long[..]; 7],
        qdd: [&long[..]; 7],
    };
    let mut regressor = vec![0.0; 12 * 7 * 43];
    let short_output = model.regressor_of_many(&states, &mut regressor[1..]);
    assert_eq!(
        short_output.unwrap_err().to_string(),
        "the array of `output` has 3611 numbers where 3612 are expected"
    );
    states.qd[1] = &short;
    let fault = BlockError::Length {
        array: "q2_d",
        found: 9,
        expected: 12,
    };
    assert_eq!(model.regressor_of_many(&states, &mut regressor), Err(fault));
    // Nothing at all is no fault.
    let none = panda::States {
        q: [&[][..]; 7],
        qd: [&[][..]; 7],
        qdd: [&[][..]; 7],
    };
    assert_eq!(model.regressor_of_many(&none, &mut []), Ok(()));
}

/// The same in narrower vectors, which another process of this test is told to use.
#[test]
fn narrower_vectors_agree_too() {
    if std::env::var_os("MODELMILL_VECTORS").is_some() {
        return;
    }
    for vectors in ["256", "none"] {
        let program = std::env::current_exe().unwrap();
        let output = std::process::Command::new(program)
            .arg("many_states::")
            .env("MODELMILL_VECTORS", vectors)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{vectors}: {}",
            String::from_utf8_lossy(&output.stdout)
        );
    }
}

#[test]
fn the_array_that_is_too_short_is_named() {
    let model = panda::Model::<f64>::default();
    let (long, short) = ([0.1; 9], [0.1; 8]);
    for odd in 0..3 {
        let mut states = panda::States {
            q: [&long[..]; 7],
            qd: [&long[..]; 7],
            qdd: [&long[..]; 7],
        };
        states.q[odd] = &short;
        let mut columns = vec![0.0; 9 * 7 * panda::N_BASE];
        let expected = BlockError::Length {
            array: ["q1", "q2", "q3"][odd],
            found: 8,
            expected: 9,
        };
        assert_eq!(model.regressor_of_many(&states, &mut columns), Err(expected));
    }
}
