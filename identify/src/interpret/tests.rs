//! Tests of interpretation with small systems whose solutions are known.
use super::*;

/// `sum of factor * product of powers` for each equation.
type Equations<'a> = &'a [&'a [(f64, &'a [(usize, u32)])]];

/// A problem with `n` unknowns, equal standard deviations, and nominal values of 1.
fn system(n: usize, equations: Equations<'_>, values: &[f64], std: Option<f64>) -> InterpretationProblem {
    let polynomial = |terms: &&[(f64, &[(usize, u32)])]| {
        let mut p = Polynomial::new(n);
        for (factor, powers) in *terms {
            p.add_term(powers, &exact_decimal(*factor));
        }
        p
    };
    let k = values.len();
    InterpretationProblem {
        equations: equations.iter().map(polynomial).collect(),
        values: values.to_vec(),
        covariance: std.map(|s| DMatrix::identity(k, k) * s * s),
        nominal: vec![1.0; n],
    }
}

#[test]
fn both_solutions_of_a_quadratic_are_found_with_their_deviations() {
    // x y = 6, x + y = 5: (2, 3) and (3, 2). J = [y x; 1 1], inverse 1/(y - x) [1 -x; -1 y].
    let found = interpret(&system(
        2,
        &[&[(1.0, &[(0, 1), (1, 1)])], &[(1.0, &[(0, 1)]), (1.0, &[(1, 1)])]],
        &[6.0, 5.0],
        Some(0.1),
    ))
    .unwrap();
    let PhysicalInterpretation::Exact { mut solutions } = found else {
        panic!("{found:?}")
    };
    solutions.sort_by(|a, b| a.values[0].total_cmp(&b.values[0]));
    assert_eq!(solutions[0].values, [2.0, 3.0]);
    assert_eq!(solutions[1].values, [3.0, 2.0]);
    let std = solutions[0].std.as_ref().unwrap();
    assert!((std[0] - 0.1 * 5.0_f64.sqrt()).abs() < 1e-12);
    assert!((std[1] - 0.1 * 10.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn a_double_solution_has_no_deviation() {
    // x^2 = 2 x - 1 touches the axis at 1.
    let found = interpret(&system(
        1,
        &[&[(1.0, &[(0, 2)]), (-2.0, &[(0, 1)])]],
        &[-1.0],
        Some(0.1),
    ))
    .unwrap();
    let PhysicalInterpretation::Exact { solutions } = found else {
        panic!("{found:?}")
    };
    assert_eq!(solutions.len(), 1);
    assert_eq!(solutions[0].values, [1.0]);
    assert_eq!(solutions[0].std, None);
}

#[test]
fn what_is_not_determined_is_named() {
    // Only x + 2 y and z are seen.
    let found = interpret(&system(
        3,
        &[
            &[(1.0, &[(0, 1)]), (2.0, &[(1, 1)])],
            &[(3.0, &[(0, 1)]), (6.0, &[(1, 1)])],
            &[(1.0, &[(2, 1)])],
        ],
        &[1.0, 3.0, 1.0],
        None,
    ))
    .unwrap();
    let PhysicalInterpretation::Undetermined { directions, determined } = found else {
        panic!("{found:?}")
    };
    assert_eq!(determined, [false, false, true]);
    let names = ["x", "y", "z"].map(str::to_owned);
    assert_eq!(
        directions[0].describe(&names),
        "only a combination of x and y is determined: x + 1 with y - 0.5 changes nothing"
    );
}

#[test]
fn more_equations_than_unknowns_are_weighed() {
    // x seen twice: the mean.
    let found = interpret(&system(
        1,
        &[&[(1.0, &[(0, 1)])], &[(1.0, &[(0, 1)])]],
        &[1.0, 2.0],
        Some(0.5),
    ))
    .unwrap();
    let PhysicalInterpretation::LeastSquares {
        solutions,
        is_linear: true,
        ..
    } = found
    else {
        panic!("{found:?}")
    };
    assert!((solutions[0].values[0] - 1.5).abs() < 1e-12);
    assert!((solutions[0].std.as_ref().unwrap()[0] - 0.5 / 2.0_f64.sqrt()).abs() < 1e-12);
    assert!((solutions[0].chi_squared.unwrap() - 2.0).abs() < 1e-9);
    // x^2 = 4 and x^4 = 16 agree at both 2 and -2.
    let found = interpret(&system(
        1,
        &[&[(1.0, &[(0, 2)])], &[(1.0, &[(0, 4)])]],
        &[4.0, 16.0],
        None,
    ))
    .unwrap();
    let PhysicalInterpretation::LeastSquares { solutions, .. } = found else {
        panic!("{found:?}")
    };
    let mut values: Vec<f64> = solutions.iter().map(|s| s.values[0]).collect();
    values.sort_by(f64::total_cmp);
    assert_eq!(values.len(), 2);
    assert!((values[0] + 2.0).abs() < 1e-9 && (values[1] - 2.0).abs() < 1e-9);
}
