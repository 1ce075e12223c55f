//! Mechanisms on which earlier versions of the mill failed or were wrong: the same laws as for random ones.

use std::fmt::Write;

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::{DeriveError, ModelEvaluator, MotionStates, PassivePosition, ReductionMethod};
use modelmill_spec::{DriveKind, FrameIdx, Mechanism, PointIdx};
use modelmill_tests::fixtures::{derive, fixtures, model};
use modelmill_tests::laws::Case;
use modelmill_tests::scaled::scaled;

/// All laws that hold for any mechanism. Parameters without a nominal value get one, so that they are felt.
fn keeps_the_laws(mut mechanism: Mechanism, reach: f64) -> Case {
    for (i, parameter) in mechanism.parameters.iter_mut().enumerate() {
        if parameter.nominal == 0.0 {
            parameter.nominal = 0.3 + 0.07 * i as f64;
        }
    }
    let case = Case::new(&mechanism, 120, reach).unwrap();
    let figures = [
        case.exact_rank_is_numeric_rank(),
        case.reduction_keeps_the_forces(),
        case.forces_satisfy_dalembert(20),
        case.loops_stay_closed(),
    ]
    .map(Result::unwrap);
    println!("{}: {figures:?}", mechanism.name);
    case
}

fn awkward(name: &str) -> Mechanism {
    let file = fixtures().join("awkward").join(format!("{name}.toml"));
    match modelmill_spec::load_file(&file) {
        Ok(loaded) => loaded.mechanism,
        Err(failure) => panic!("{name}: {}", failure.render(false)),
    }
}

/// Keeps the laws, and has as many base parameters as can be counted by hand.
fn exact(name: &str, reach: f64, rank: usize) -> Case {
    let case = keeps_the_laws(awkward(name), reach);
    assert_eq!(case.derivation.reduction.retained.len(), rank, "{name}");
    assert!(matches!(
        case.derivation.reduction.method,
        ReductionMethod::Exact { .. }
    ));
    case
}

#[test]
fn parallelograms_measured_from_elsewhere() {
    // Three as for the parallelogram, and the stiffness of a spring.
    exact("half_turned_parallelogram", 0.4, 4);
    exact("tilted_parallelogram", 0.4, 3);
    // One stiffness for both springs, since crank and rocker turn alike, and the offset.
    exact("twice_sprung_parallelogram", 0.4, 5);
}

#[test]
fn passive_angles_beyond_half_a_turn() {
    // Eight as for the four-bar, and the stiffness.
    for name in ["turned_rocker", "rocker_at_half_turn"] {
        exact(name, 0.4, 9);
    }
}

#[test]
fn effects_that_are_sines_of_the_joint_angle() {
    // ZZ, and the two first moments under gravity with which the effect's parameters go together.
    exact("unbalance", 3.0, 3);
}

#[test]
fn screws_along_their_own_slides() {
    // The mass with the screw's inertia, and its weight with the offset.
    exact("lift", 0.5, 2);
    exact("turning_slide", 0.4, 8);
}

#[test]
fn lengths_that_are_no_plain_constants() {
    exact("decimals", 3.0, 6);
    exact("root_of_a_half", 3.0, 6);
    exact("number_and_angle", 3.0, 6);
}

#[test]
fn what_no_rational_function_can_say_is_said_in_numbers() {
    for name in ["diagonal", "half_an_angle"] {
        let case = keeps_the_laws(awkward(name), 3.0);
        assert_eq!(case.derivation.reduction.retained.len(), 6);
        assert!(matches!(
            case.derivation.reduction.method,
            ReductionMethod::Numeric { .. }
        ));
    }
}

#[test]
fn loops_alike_but_for_their_assembly_modes() {
    // Each rocker has its own inertia and two first moments: mirrored motion is another motion.
    exact("mirrored_four_bars", 0.3, 6);
    // The equal cranks make pistons move oppositely: masses at both, and where the rods' centres differ.
    exact("boxer", 0.3, 3);
    exact("opposed_sliders", 0.3, 3);
    // The larger one's columns are those of the smaller one times its scale.
    exact("sliders_to_scale", 0.3, 3);
    let case = keeps_the_laws(awkward("sliders_in_numbers"), 0.3);
    assert_eq!(case.derivation.reduction.retained.len(), 3);
}

#[test]
fn parallelograms_that_others_drive_or_stand_beside() {
    for (name, rank, poses) in [
        ("desk_lamp", 3, vec![vec![0.8, 0.5, 0.1, -0.3, -1.2]]),
        (
            "parallelogram_beside_a_slide",
            6,
            vec![vec![0.8, 0.5, 0.1, -0.3, -1.2], vec![0.3325; 5]],
        ),
    ] {
        let case = exact(name, 0.2, rank);
        // Far beyond the pose where the parallelogram is flat and might turn into the crossed linkage.
        let evaluator = ModelEvaluator::new(&case.derivation);
        let still = vec![vec![0.0; 5]; poses.len()];
        let states = MotionStates {
            q: poses.iter().map(Vec::as_slice).collect(),
            qd: still.iter().map(Vec::as_slice).collect(),
            qdd: still.iter().map(Vec::as_slice).collect(),
            load: Vec::new(),
        };
        let passive = evaluator.passive_motion(&states).unwrap();
        for (k, q) in poses[0].iter().enumerate() {
            let pairs = passive[..if name == "desk_lamp" { 4 } else { 2 }].chunks(2);
            for pair in pairs {
                assert!((pair[0][k] + q).abs() < 1e-12, "{name}: the coupler at {q}");
                assert!((pair[1][k] - q).abs() < 1e-12, "{name}: the rocker at {q}");
            }
        }
    }
    exact("rocker_cranks_parallelogram", 0.3, 8);
}

/// Where two pairs of links are equal, the loop's radicand is the square of the crank's sine (times lengths): the crossed
/// motion and the other one meet where all links lie on one line, and each goes straight on there.
#[test]
fn assembly_modes_that_meet_are_told_apart() {
    for name in ["antiparallelogram", "deltoid"] {
        let case = exact(name, 0.3, 8);
        assert!(matches!(
            case.derivation.programs.passive_position,
            PassivePosition::Closed
        ));
    }
}

#[test]
fn a_singular_nominal_pose_is_refused() {
    let error = modelmill_codegen::derive(&awkward("drive_through_its_pivot")).err();
    assert_eq!(error, Some(DeriveError::SingularNominal));
}

#[test]
fn any_unit_of_length_gives_the_same_rank() {
    for name in ["spatial_press", "spatial_slider"] {
        let rank = derive(&model(name)).reduction.retained.len();
        for unit in [1e-3, 1e3] {
            let scaled = derive(&scaled(&model(name), name, unit));
            assert_eq!(scaled.reduction.retained.len(), rank, "{name} times {unit}");
        }
    }
}

/// These took all time or memory once.
#[test]
fn large_multiples_and_many_roots_come_to_an_end() {
    // ZZ1 and ZZ2, four first moments in two pairs of which one mass is part, and the effect.
    let many = derive(&awkward("sine_of_a_large_multiple"));
    assert_eq!(
        many.reduction.retained.len(),
        derive(&model("two_link")).reduction.retained.len() + 1
    );
    let roots = derive(&awkward("many_roots"));
    assert!(matches!(roots.reduction.method, ReductionMethod::Numeric { .. }));
}

/// Four-bars beside each other, each with a crank of its own, or in a row, each cranked by the rocker of the one before.
fn four_bars(n: usize, in_a_row: bool) -> Mechanism {
    let mut text = String::from("schema = 1\nname = \"four_bars\"\ngravity = [0, \"-g\", 0]\n");
    let mut constants = String::from("[constants]\ng = { value = 9.81, unit = \"m/s^2\" }\n");
    let mut coordinates = String::from("[coordinates]\n");
    let mut rest = String::new();
    let mut crank = 1.1;
    for i in 0..n {
        // Lengths of a parallelogram's kind, so that a rocker turns about as far as its crank.
        let (a, b, c, d) = (0.4, 0.9 + 0.02 * i as f64, 0.42, 0.9);
        let (coupler, rocker) = assembled(a, b, c, d, crank);
        for (name, value) in [("A", a), ("B", b), ("C", c), ("D", d)] {
            writeln!(constants, "{name}{i} = {{ value = {value}, unit = \"m\" }}").unwrap();
        }
        let driver = if in_a_row && i > 0 {
            format!("r{}", i - 1)
        } else {
            writeln!(coordinates, "q{i} = {{ nominal = {crank} }}").unwrap();
            write!(rest, "[[drive]]\nname = \"motor{i}\"\njoint = \"q{i}\"\n").unwrap();
            format!("q{i}")
        };
        write!(
            coordinates,
            "k{i} = {{ nominal = {coupler}, passive = true }}\nr{i} = {{ nominal = {rocker}, passive = true }}\n"
        )
        .unwrap();
        write!(
            rest,
            r#"
            [[frame]]
            name = "crank{i}"
            on = "base"
            modified_dh = {{ theta = "{driver}" }}
            [[frame]]
            name = "coupler{i}"
            on = "crank{i}"
            modified_dh = {{ a = "A{i}", theta = "k{i}" }}
            [[frame]]
            name = "rocker{i}"
            on = "base"
            modified_dh = {{ a = "D{i}", theta = "r{i}" }}
            [[point]]
            name = "coupler_end{i}"
            on = "coupler{i}"
            at = ["B{i}", 0]
            [[point]]
            name = "rocker_end{i}"
            on = "rocker{i}"
            at = ["C{i}", 0]
            [[loop]]
            name = "loop{i}"
            joins = ["coupler_end{i}", "rocker_end{i}"]
            [[part]]
            on = "rocker{i}"
            linear = {{ planar = {i}, nominal = {{ ZZ = 0.57, MX = 1.2, MY = -0.02, M = 3.5 }} }}
            "#
        )
        .unwrap();
        if in_a_row {
            crank = rocker;
        }
    }
    text = text + &constants + &coordinates + &rest;
    match modelmill_spec::load("four_bars.toml", &text, &MemoryFiles::default()) {
        Ok(loaded) => loaded.mechanism,
        Err(failure) => panic!("{}", failure.render(false)),
    }
}

/// Coupler angle against the crank and rocker angle of the open four-bar, by the triangle over its diagonal.
fn assembled(a: f64, b: f64, c: f64, d: f64, crank: f64) -> (f64, f64) {
    let (x, y) = (d - a * crank.cos(), -a * crank.sin());
    let diagonal = x.hypot(y);
    let coupler = y.atan2(x) + ((b * b + diagonal * diagonal - c * c) / (2.0 * b * diagonal)).acos();
    let (ex, ey) = (
        a * crank.cos() + b * coupler.cos() - d,
        a * crank.sin() + b * coupler.sin(),
    );
    (coupler - crank, ey.atan2(ex))
}

#[test]
fn drives_whose_rows_say_little_each() {
    // Per four-bar the rocker's inertia and its two first moments.
    for n in [2, 6] {
        let case = keeps_the_laws(four_bars(n, false), 0.3);
        assert_eq!(case.derivation.reduction.retained.len(), 3 * n);
    }
}

#[test]
fn loops_that_drive_loops() {
    // The loops' system for the passive rates has twelve unknowns, two of them at a time.
    let derivation = derive(&four_bars(6, true));
    assert_eq!(derivation.reduction.retained.len(), 18);
    keeps_the_laws(four_bars(2, true), 0.3);
}

#[test]
fn a_power_of_a_sum_of_parameters_is_refused_before_it_fills_the_memory() {
    let names = ["a", "b", "c", "d", "e", "f"];
    let parameters = names
        .map(|n| format!("{n} = {{ nominal = 1, unit = \"1\" }}"))
        .join("\n");
    let text = format!(
        r#"
        schema = 1
        name = "sums"
        gravity = [0, "-g", 0]
        [constants]
        g = {{ value = 9.81, unit = "m/s^2" }}
        [parameters]
        M = {{ nominal = 1, unit = "kg" }}
        {parameters}
        [coordinates]
        q = {{ nominal = 0.4 }}
        [[frame]]
        name = "link"
        on = "base"
        modified_dh = {{ theta = "q" }}
        [[lumped_mass]]
        mass = "M*({})^16"
        on = "link"
        at = ["1/2", 0, 0]
        [[drive]]
        name = "motor"
        joint = "q"
        "#,
        names.join("+")
    );
    let loaded = modelmill_spec::load("sums.toml", &text, &MemoryFiles::default()).unwrap();
    let error = modelmill_codegen::derive(&loaded.mechanism)
        .err()
        .expect("no derivation");
    assert!(error.to_string().contains("more than 2000 products"), "{error}");
}

#[test]
fn a_drive_that_nothing_moves_is_refused() {
    // Opposite joints of a parallelogram's coupler keep their distance.
    let mut mechanism = awkward("tilted_parallelogram");
    let ends = ["coupler_end", "rocker_end"].map(|name| {
        let found = mechanism.points.iter().position(|p| p.name == name);
        found.expect("a point of the model")
    });
    let crank = mechanism.frames.iter().position(|f| f.name == "body1");
    let mut tip = mechanism.points[ends[1]].clone();
    tip.frame = FrameIdx(crank.expect("a frame of the model"));
    mechanism.points.push(tip);
    mechanism.drives[0].kind = DriveKind::Linear {
        from: PointIdx(mechanism.points.len() - 1),
        to: PointIdx(ends[1]),
    };
    let error = modelmill_codegen::derive(&mechanism).err().expect("no derivation");
    assert!(error.to_string().contains("that every drive moves"), "{error}");
}
