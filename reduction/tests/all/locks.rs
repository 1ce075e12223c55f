//! Joints of a description that are locked at a value: the rest of the robot moves as the complete robot does with
//! these joints at standstill.

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_reduction::{DescriptionImport, ImportOptions, import};

/// An arm of three joints and a gripper with two coupled fingers.
fn arm() -> String {
    let body = "<inertial><mass value='2'/><origin xyz='0.1 0.03 -0.02'/>\
        <inertia ixx='0.1' ixy='0.01' ixz='0' iyy='0.12' iyz='-0.02' izz='0.09'/></inertial>";
    let links: String = ["torso", "upper", "fore", "left", "right"]
        .map(|name| format!("<link name='{name}'>{body}</link>"))
        .concat();
    let joint = |name: &str, kind: &str, [parent, child]: [&str; 2], [xyz, rpy, axis]: [&str; 3], more: &str| {
        format!(
            "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>\
             <origin xyz='{xyz}' rpy='{rpy}'/><axis xyz='{axis}'/>\
             <limit lower='-1' upper='1' effort='1' velocity='1'/><dynamics friction='0.4'/>{more}</joint>"
        )
    };
    let joints = [
        joint("lift", "prismatic", ["foot", "torso"], ["0 0 1", "0 0 0", "0 0 1"], ""),
        joint(
            "shoulder",
            "revolute",
            ["torso", "upper"],
            ["0.1 0 0.2", "0.4 0.2 0", "0 1 0"],
            "",
        ),
        joint(
            "elbow",
            "revolute",
            ["upper", "fore"],
            ["0.5 0.1 0", "0.2 0 -0.5", "0 0.6 0.8"],
            "",
        ),
        joint(
            "finger",
            "prismatic",
            ["fore", "left"],
            ["0.4 0 0", "0 0.3 0", "0 1 0"],
            "",
        ),
        joint(
            "other_finger",
            "prismatic",
            ["fore", "right"],
            ["0.4 0 0", "0 0.3 0", "0 -1 0"],
            "<mimic joint='finger' multiplier='1' offset='0.01'/>",
        ),
    ];
    format!(
        "<robot name='arm'><link name='foot'/>{links}{}</robot>",
        joints.concat()
    )
}

fn imported(options: &ImportOptions) -> DescriptionImport {
    import(&arm(), options).unwrap_or_else(|error| panic!("{error}"))
}

fn derived(found: &DescriptionImport) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", &found.model, &MemoryFiles::default())
        .unwrap_or_else(|failure| panic!("{failure}\n{}", found.model));
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    modelmill_codegen::derive(&loaded.mechanism).expect("a derivation")
}

/// Forces of the drives by the names of their joints; `state` gives position, rate and acceleration of a coordinate.
fn forces(derivation: &Derivation, state: &dyn Fn(&str) -> [f64; 3]) -> Vec<(String, f64)> {
    let names: Vec<String> = derivation
        .mechanism
        .coordinates
        .iter()
        .map(|c| c.name.clone())
        .collect();
    let column = |k: usize| -> Vec<[f64; 1]> { names.iter().map(|name| [state(name)[k]]).collect() };
    let [q, qd, qdd] = [0, 1, 2].map(column);
    let states = MotionStates {
        q: q.iter().map(|x| &x[..]).collect(),
        qd: qd.iter().map(|x| &x[..]).collect(),
        qdd: qdd.iter().map(|x| &x[..]).collect(),
        load: Vec::new(),
    };
    let found = ModelEvaluator::new(derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .expect("forces");
    names
        .into_iter()
        .zip(found)
        .map(|(name, force)| (name, force[0]))
        .collect()
}

/// Compares the forces of a locked robot with those of the complete one, whose locked joints stand still.
#[track_caller]
fn check(options: &ImportOptions, expected: &[&str], still: &[(&str, f64)]) {
    let complete = derived(&imported(&ImportOptions::default()));
    let locked = derived(&imported(options));
    for i in 0..5 {
        let wave = |k: f64| (k * f64::from(i) + k).sin();
        let state = |name: &str| match still.iter().find(|(other, _)| *other == name) {
            Some((_, value)) => [*value, 0.0, 0.0],
            None => {
                let k = 1.0 + 0.1 * f64::from(name.bytes().fold(0_u8, u8::wrapping_add));
                [0.5 * wave(k), wave(1.7 * k), 3.0 * wave(2.3 * k)]
            }
        };
        let (all, few) = (forces(&complete, &state), forces(&locked, &state));
        let names: Vec<&str> = few.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, expected);
        for (name, force) in &few {
            let (_, wanted) = all.iter().find(|(other, _)| other == name).expect("the same joint");
            assert!(
                (force - wanted).abs() < 1e-9 * wanted.abs().max(1.0),
                "{name}: {force} and not {wanted}"
            );
        }
    }
}

#[test]
fn locked_joints_stand_still() {
    let locked = [("elbow".to_owned(), 0.7), ("finger".to_owned(), -0.2)];
    let options = ImportOptions {
        locked: &locked,
        ..ImportOptions::default()
    };
    // The other finger follows a locked one.
    check(&options, &["lift", "shoulder"], &[("elbow", 0.7), ("finger", -0.2)]);
    let found = imported(&options);
    let says = crate::lines(&found.remarks);
    assert!(says.contains("`elbow` is fixed at 0.7"), "{says}");
    // Bodies behind locked joints are one with those before them.
    assert_eq!(found.model.matches("[[part]]").count(), 2, "{}", found.model);
}

#[test]
fn only_the_named_joints_move() {
    let kept = ["shoulder", "finger"].map(str::to_owned);
    let options = ImportOptions {
        kept: Some(&kept),
        ..ImportOptions::default()
    };
    // The coupled finger moves with the named one.
    check(&options, &["shoulder", "finger"], &[("lift", 0.0), ("elbow", 0.0)]);
    // A value for a joint that is not named replaces its pose.
    let locked = [("elbow".to_owned(), -0.3)];
    let both = ImportOptions {
        locked: &locked,
        ..options
    };
    check(&both, &["shoulder", "finger"], &[("lift", 0.0), ("elbow", -0.3)]);
}

/// A follower is locked with its leader, at the value by which the follower has its own.
#[test]
fn a_locked_follower_fixes_its_leader() {
    // The other finger is the finger's value plus 0.01.
    let locked = [("other_finger".to_owned(), 0.11)];
    let options = ImportOptions {
        locked: &locked,
        ..ImportOptions::default()
    };
    check(&options, &["lift", "shoulder", "elbow"], &[("finger", 0.1)]);
    // Both values may be given, if they agree.
    let both = [("finger".to_owned(), 0.1), ("other_finger".to_owned(), 0.11)];
    let options = ImportOptions {
        locked: &both,
        ..ImportOptions::default()
    };
    check(&options, &["lift", "shoulder", "elbow"], &[("finger", 0.1)]);
    let against = [("finger".to_owned(), 0.1), ("other_finger".to_owned(), 0.5)];
    let options = ImportOptions {
        locked: &against,
        ..ImportOptions::default()
    };
    let says = import(&arm(), &options).expect_err("a fault").to_string();
    assert!(says.contains("`other_finger` follows `finger`"), "{says}");
    // Joints that are fixed at the pose keep their coupling.
    let kept = ["lift", "shoulder", "elbow"].map(str::to_owned);
    let options = ImportOptions {
        kept: Some(&kept),
        ..ImportOptions::default()
    };
    check(&options, &["lift", "shoulder", "elbow"], &[("finger", 0.0)]);
}

/// Ball joints and free joints have no single value, and are named if they move without being listed.
#[test]
fn joints_without_a_single_value_are_remarked() {
    let text = "<mujoco model='leg'><worldbody><body name='trunk'><freejoint name='trunk_free'/>\
        <inertial pos='0 0 0' mass='5' diaginertia='0.1 0.1 0.1'/>\
        <body name='thigh' pos='0 0 -0.1'><joint name='hip' type='ball'/>\
        <inertial pos='0 0 -0.2' mass='2' diaginertia='0.02 0.02 0.01'/>\
        <body name='shank' pos='0 0 -0.4'><joint name='knee' axis='0 1 0'/>\
        <inertial pos='0 0 -0.2' mass='1' diaginertia='0.01 0.01 0.01'/></body></body></body></worldbody>\
        <actuator><motor joint='knee'/></actuator></mujoco>";
    let remarks = |kept: &[String]| {
        let options = ImportOptions {
            kept: Some(kept),
            ..ImportOptions::default()
        };
        crate::lines(&import(text, &options).unwrap_or_else(|error| panic!("{error}")).remarks)
    };
    let few = remarks(&["knee".to_owned()]);
    for says in [
        "the free joint `trunk_free` moves too",
        "the ball joint `hip` moves too",
    ] {
        assert!(few.contains(says), "{few}");
    }
    let all = remarks(&["knee", "hip", "trunk_free"].map(str::to_owned));
    assert!(!all.contains("moves too"), "{all}");
}

#[test]
fn joints_that_cannot_be_locked_are_refused() {
    let says = |locked: &[(String, f64)], kept: Option<&[String]>| {
        let options = ImportOptions {
            locked,
            kept,
            ..ImportOptions::default()
        };
        import(&arm(), &options).expect_err("a fault").to_string()
    };
    let unknown = says(&[("wrist".to_owned(), 0.0)], None);
    assert!(
        unknown.contains("there is no joint `wrist` that moves; the description has lift,"),
        "{unknown}"
    );
    let elbow = ("elbow".to_owned(), 0.0);
    assert!(says(&[elbow.clone(), elbow.clone()], None).contains("named twice"));
    let finger = ("finger".to_owned(), 0.0);
    let coupled = says(&[finger], Some(&["other_finger".to_owned()]));
    assert!(coupled.contains("coupled with a locked one"), "{coupled}");
    assert!(says(&[elbow], Some(&["elbow".to_owned()])).contains("named twice"));
    let all = ["lift", "shoulder", "elbow", "finger"].map(|name| (name.to_owned(), 0.0));
    assert!(says(&all, None).contains("no joint that moves"));
}
