//! The regressor block by block: the same numbers as all at once, in order, up to the first state without an answer.

use modelmill_codegen::{ModelEvaluator, PoseFault};
use modelmill_tests::fixtures::derived;
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

/// All rows that are shown, and how it ended.
fn shown(evaluator: &ModelEvaluator<'_>, sample: &Sample) -> (Vec<Vec<f64>>, Result<(), PoseFault>) {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let end = evaluator.regressor_blocks::<PoseFault>(&sample.states(), |len, block| {
        columns.resize(block.len(), Vec::new());
        for (column, values) in columns.iter_mut().zip(block) {
            assert_eq!(values.len(), len);
            column.extend_from_slice(values);
        }
        Ok(())
    });
    (columns, end)
}

#[test]
fn blocks_hold_what_the_regressor_holds() {
    for name in ["five_bar-tied", "four_bar", "panda", "spidermill", "emps"] {
        let derivation = derived(name);
        let evaluator = ModelEvaluator::new(&derivation);
        let mut sample = Sample::random(&derivation.mechanism, 150, 0.2, &mut Stream::new(3));
        let matrix = evaluator.regressor(&sample.states()).unwrap();
        let (columns, end) = shown(&evaluator, &sample);
        assert_eq!(end, Ok(()));
        let drives = derivation.mechanism.drives.len();
        for (k, column) in columns.iter().enumerate() {
            for (i, value) in column.iter().enumerate() {
                let expected = matrix[(i * drives + k / matrix.ncols(), k % matrix.ncols())];
                assert_eq!(value.to_bits(), expected.to_bits(), "{name}");
            }
        }
        sample.q[0][100] = f64::NAN;
        let (columns, end) = shown(&evaluator, &sample);
        assert_eq!(end.unwrap_err().sample, 100);
        assert!(columns.iter().all(|column| column.len() == 100), "{name}");
    }
}

/// Some columns alone are the same numbers, and the others zero.
#[test]
fn some_columns_are_what_they_are_among_all() {
    for name in ["five_bar-tied", "panda", "spidermill"] {
        let derivation = derived(name);
        let evaluator = ModelEvaluator::new(&derivation);
        let sample = Sample::random(&derivation.mechanism, 70, 0.2, &mut Stream::new(3));
        let matrix = evaluator.regressor(&sample.states()).unwrap();
        let n = matrix.ncols();
        let drives = derivation.mechanism.drives.len();
        for wanted in [vec![0], vec![n - 1], (0..n).step_by(3).collect()] {
            let mut before = 0;
            let is_wanted = |k: usize| wanted.contains(&k);
            let end = evaluator.regressor_column_blocks::<PoseFault>(&sample.states(), &is_wanted, |len, block| {
                for (k, values) in block.iter().enumerate() {
                    for (i, value) in values.iter().enumerate() {
                        let entry = matrix[((before + i) * drives + k / n, k % n)];
                        let expected = if is_wanted(k % n) { entry } else { 0.0 };
                        assert_eq!(value.to_bits(), expected.to_bits(), "{name} {wanted:?}");
                    }
                }
                before += len;
                Ok(())
            });
            assert_eq!((end, before), (Ok(()), 70));
        }
    }
}

/// Angles beyond the range of the fast sine go another way, and turns by whole circles change nothing but rounding.
#[test]
fn large_angles_are_turned_back() {
    let derivation = derived("panda");
    let evaluator = ModelEvaluator::new(&derivation);
    let sample = Sample::random(&derivation.mechanism, 70, 0.5, &mut Stream::new(4));
    let matrix = evaluator.regressor(&sample.states()).unwrap();
    for (turns, tolerance) in [(10.0, 1e-12), (2e5, 1e-8), (1e7, 1e-6)] {
        let mut turned = sample.clone();
        for q in turned.q.iter_mut().flatten() {
            *q += turns * std::f64::consts::TAU;
        }
        let apart = (evaluator.regressor(&turned.states()).unwrap() - &matrix).norm();
        assert!(apart < tolerance * matrix.norm(), "{turns} turns: {apart}");
    }
}
