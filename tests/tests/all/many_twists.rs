//! Arms in which every joint has a length, a twist and an offset of its own, all symbolic: their base parameters run
//! through all joints, and are reduced all the same.

use std::fmt::Write;

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::ReductionMethod;
use modelmill_spec::Mechanism;
use modelmill_tests::laws::{ACCURACY, Case};

/// An arm of `n` revolute joints on a vertical axis; every body has all ten parameters, with values of no special kind.
fn twisted(n: usize) -> Mechanism {
    let mut text = String::from("schema = 1\nname = \"twisted\"\ngravity = [0, 0, -9.81]\n");
    text.push_str("[constants]\n");
    for i in 1..n {
        let (a, d) = (0.1 + 0.01 * i as f64, 0.05 + 0.02 * i as f64);
        let b = 0.4 + 0.13 * i as f64;
        writeln!(text, "a{i} = {{ value = {a:.3}, unit = \"m\" }}").unwrap();
        writeln!(text, "d{i} = {{ value = {d:.3}, unit = \"m\" }}").unwrap();
        writeln!(text, "b{i} = {{ value = {b:.3}, unit = \"rad\" }}").unwrap();
    }
    text.push_str("[coordinates]\n");
    for i in 0..n {
        writeln!(text, "q{i} = {{ nominal = {:.1} }}", 0.2 * i as f64).unwrap();
    }
    let mut on = String::from("base");
    for i in 0..n {
        let own = if i == 0 {
            String::new()
        } else {
            format!("a = \"a{i}\", alpha = \"b{i}\", d = \"d{i}\", ")
        };
        writeln!(text, "[[frame]]\nname = \"l{i}\"\non = \"{on}\"").unwrap();
        writeln!(text, "modified_dh = {{ {own}theta = \"q{i}\" }}").unwrap();
        writeln!(text, "[[part]]\non = \"l{i}\"\nlinear = {{ all = \"_{i}\" }}").unwrap();
        writeln!(text, "[[drive]]\nname = \"t{i}\"\njoint = \"q{i}\"").unwrap();
        on = format!("l{i}");
    }
    let loaded = modelmill_spec::load("twisted.toml", &text, &MemoryFiles::default());
    let mut mechanism = match loaded {
        Ok(loaded) => loaded.mechanism,
        Err(failure) => panic!("{}", failure.render(false)),
    };
    for (i, parameter) in mechanism.parameters.iter_mut().enumerate() {
        parameter.nominal = 0.3 + 0.07 * i as f64;
    }
    mechanism
}

/// An arm of `n` revolute joints, the first of them vertical, has 7 n - 6 base parameters (Mayeda, Yoshida and Osuka
/// 1990: seven for each joint, four fewer for the first and two more fewer where gravity is along it).
#[track_caller]
fn check(n: usize) {
    let case = Case::new(&twisted(n), 40, 1.0).unwrap();
    let reduction = &case.derivation.reduction;
    assert!(
        matches!(reduction.method, ReductionMethod::Exact { .. }),
        "{n}: {:?}",
        reduction.method
    );
    assert_eq!(reduction.retained.len(), 7 * n - 6, "{n}");
    case.exact_rank_is_numeric_rank().unwrap();
    for error in [case.reduction_keeps_the_forces(), case.forces_satisfy_dalembert(5)] {
        let error = error.unwrap();
        assert!(error < 100.0 * ACCURACY, "{n}: {error:.1e}");
    }
}

#[test]
fn arms_of_many_symbolic_twists_are_reduced_exactly() {
    for n in [3, 7, 12] {
        check(n);
    }
}

/// A sum of links is used as soon as a base parameter without it is long.
#[test]
fn base_parameters_of_ten_twisted_joints_can_be_read() {
    let case = Case::new(&twisted(10), 12, 0.5).unwrap();
    let base = case.derivation.base_parameters();
    let longest = base.iter().map(|base| base.expression.len()).max().unwrap();
    assert!(longest < 4_000, "{longest} characters");
    let expanded = modelmill_emit::emit(&case.derivation).module();
    assert!(expanded.len() < 500_000, "{} bytes", expanded.len());
    case.reduction_keeps_the_forces().unwrap();
}

/// Base parameters of a long arm are sums link by link, and their text does not grow with the power of the joints.
#[test]
fn long_arms_are_grouped_link_by_link() {
    let case = Case::new(&twisted(18), 12, 0.5).unwrap();
    let reduction = &case.derivation.reduction;
    assert!(matches!(reduction.method, ReductionMethod::Exact { .. }));
    assert_eq!(reduction.retained.len(), 7 * 18 - 6);
    let sums = case.derivation.base_sums();
    assert!(!sums.is_empty());
    // A sum refers to those before it only.
    for (i, (_, text)) in sums.iter().enumerate() {
        let names = text.split(|c: char| !c.is_alphanumeric() && c != '_');
        let later = |name: &str| sums[i..].iter().any(|(other, _)| other == name);
        assert!(!names.into_iter().any(later), "{text}");
    }
    case.reduction_keeps_the_forces().unwrap();
    case.forces_satisfy_dalembert_to(1e-9, 4).unwrap();
    let module = modelmill_emit::emit(&case.derivation).module();
    assert!(module.len() < 600_000, "{} bytes", module.len());
}
