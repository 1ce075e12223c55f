//! Numbers of base parameters that the literature prints, and those that independent programs agree on.

use modelmill_codegen::ModelEvaluator;
use modelmill_tests::fixtures::{derive, model};
use modelmill_tests::rank::rank_of_products;
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

/// Checks the exact rank against the published one, and both against singular values of many states.
#[track_caller]
fn check(name: &str, published: usize) {
    let mechanism = model(name);
    let derivation = derive(&mechanism);
    assert_eq!(derivation.reduction.retained.len(), published, "{name}");
    let evaluator = ModelEvaluator::new(&derivation);
    let products = derivation.reduction.products.len();
    let reach = if mechanism.loops.is_empty() { 3.0 } else { 0.3 };
    let n = 60 + 4 * products / mechanism.drives.len();
    let sample = Sample::random(&mechanism, n, reach, &mut Stream::new(published as u64)).reachable(&evaluator);
    assert!(
        sample.len() * mechanism.drives.len() > 2 * products,
        "{name}: too few states"
    );
    let rank = rank_of_products(&evaluator, &sample).expect("reachable states");
    assert_eq!(rank.rank, published, "{name}: {rank:?}");
    assert!(rank.gap > 1e6, "{name}: gap {:.1e}", rank.gap);
}

macro_rules! ranks {
    ($($test:ident: $($name:literal => $rank:literal),+;)+) => {
        $(#[test]
        fn $test() {
            $(check($name, $rank);)+
        })+
    };
}

ranks! {
    puma560_has_36_and_40_with_drive_inertia: "puma560" => 36, "puma560-ia" => 40;
    rx90_has_36_and_40_with_drive_inertia: "rx90" => 36, "rx90-ia" => 40;
    tx40_has_36_and_40_with_drive_inertia: "tx40-rigid" => 36, "tx40-ia" => 40;
    ur5_has_36_and_40_with_drive_inertia: "ur5" => 36, "ur5-ia" => 40;
    stanford_has_33_and_37_with_drive_inertia: "stanford" => 33, "stanford-ia" => 37;
    panda_has_43_and_48_with_drive_inertia: "panda" => 43, "panda-ia" => 48;
    scara_has_8_and_11_with_drive_inertia: "scara" => 8, "scara-ia" => 11;
    planar_arms_have_4_and_7_with_gravity_normal: "two_link-normal" => 4, "three_r-normal" => 7;
    planar_arms_have_6_and_9_with_gravity_in_the_plane: "two_link" => 6, "three_r" => 9;
    four_bar_has_8_and_4_without_gravity: "four_bar" => 8, "four_bar-weightless" => 4;
    parallelogram_has_3_and_1_without_gravity: "parallelogram" => 3, "parallelogram-weightless" => 1;
    parallelogram_has_3_also_when_a_loop_closes_it: "parallelogram-loop" => 3;
    five_bar_has_11_and_7_without_gravity: "five_bar" => 11, "five_bar-weightless" => 7;
    tied_five_bar_has_6_and_4_without_gravity: "five_bar-tied" => 6, "five_bar-tied-weightless" => 4;
    tied_five_bar_with_tool_has_5_and_3_without_gravity:
        "five_bar-tied-tool" => 5, "five_bar-tied-tool-weightless" => 3;
    three_rrr_has_19_and_13_without_gravity: "three_rrr" => 19, "three_rrr-weightless" => 13;
    tied_three_rrr_has_9_and_7_without_gravity:
        "three_rrr-tied" => 9, "three_rrr-tied-weightless" => 7;
    gough_stewart_has_88_and_64_without_gravity:
        "gough_stewart" => 88, "gough_stewart-weightless" => 64;
    tied_gough_stewart_has_23_and_19_without_gravity:
        "gough_stewart_tied" => 23, "gough_stewart_tied-weightless" => 19;
    delta_has_34_and_28_without_gravity: "delta" => 34, "delta-weightless" => 28;
    tied_delta_has_12_and_10_without_gravity:
        "delta_tied" => 12, "delta_tied-weightless" => 10;
}
