//! A strut welded to a crank's pin, and the same strut hung on the pin from the start: one mechanism, whatever its file says.

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates, derive};
use modelmill_reduction::{DescriptionImport, ImportOptions, import};

use crate::lines;

fn link(name: &str, mass: f64, at: &str) -> String {
    format!(
        "<link name='{name}'><inertial><origin xyz='{at}'/><mass value='{mass}'/>\
         <inertia ixx='0.02' ixy='0.001' ixz='0' iyy='0.03' iyz='0' izz='0.01'/></inertial></link>"
    )
}

fn joint(name: &str, kind: &str, [parent, child]: [&str; 2], xyz: &str, axis: &str) -> String {
    format!(
        "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>\
         <origin xyz='{xyz}'/><axis xyz='{axis}'/></joint>"
    )
}

fn place(name: &str, on: &str, xyz: &str) -> String {
    format!("<link name='{name}'/>") + &joint(&format!("{name}_at"), "fixed", [on, name], xyz, "1 0 0")
}

/// Ground, crank and pin, which both descriptions share.
fn common() -> String {
    "<link name='ground'/>".to_owned()
        + &link("crank", 2.0, "0.2 0 0.01")
        + &link("pin", 0.3, "0.01 0 0.02")
        + &joint("turn", "continuous", ["ground", "crank"], "0 0 0", "0 1 0")
        + &joint("hinge", "continuous", ["crank", "pin"], "0.4 0 0", "0 1 0")
        + &link("tube", 1.5, "0.1 0 0.02")
        + &link("rod", 0.8, "0.15 0 0.01")
}

fn imported(robot: &str, closures: &str) -> DescriptionImport {
    let options = ImportOptions {
        closures: Some(closures),
        ..ImportOptions::default()
    };
    import(&format!("<robot name='strut'>{robot}</robot>"), &options).expect("a model")
}

fn derived(imported: &DescriptionImport) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", &imported.model, &MemoryFiles::default());
    let loaded = loaded.unwrap_or_else(|failure| panic!("{failure}"));
    derive(&loaded.mechanism).expect("a derivation")
}

/// Forces of the strut's drive at some states.
fn forces(derivation: &Derivation) -> Vec<f64> {
    let names = derivation.mechanism.coordinates.iter();
    let active: Vec<_> = names.filter(|c| !c.passive).map(|c| &c.name).collect();
    assert_eq!(active, ["extend"]);
    let start = derivation.mechanism.coordinates.iter();
    let start = start.clone().find(|c| c.name == "extend").expect("extend").nominal;
    let q: Vec<f64> = (0..8).map(|k| start + 0.01 * f64::from(k)).collect();
    let qd: Vec<f64> = (0..8).map(|k| 0.3 - 0.1 * f64::from(k)).collect();
    let qdd: Vec<f64> = (0..8).map(|k| 0.2 * f64::from(k) - 0.5).collect();
    let states = MotionStates {
        q: vec![&q],
        qd: vec![&qd],
        qdd: vec![&qdd],
        load: Vec::new(),
    };
    let found = ModelEvaluator::new(derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .expect("forces");
    found[0].clone()
}

#[test]
fn a_loop_is_cut_at_its_ball_joint_wherever_the_file_cuts_it() {
    let drives = "name_mot: ['extend']\n";
    // The strut stands on the ground by three hinges that meet, and its rod is welded to the pin.
    let welded = common()
        + "<link name='b1'/><link name='b2'/>"
        + &joint("x", "continuous", ["ground", "b1"], "1 0 0.3", "1 0 0")
        + &joint("y", "continuous", ["b1", "b2"], "0 0 0", "0 1 0")
        + &joint("z", "continuous", ["b2", "tube"], "0 0 0", "0 0 1")
        + &joint("extend", "prismatic", ["tube", "rod"], "-0.2 0 0.1", "-1 0 0")
        + &place("end", "rod", "-0.3 0 0")
        + &place("seat", "pin", "0.05 0 0");
    let welded = imported(
        &welded,
        &format!("closed_loop: [['seat', 'end']]\ntype: ['6d']\n{drives}"),
    );
    // The rod is a part of the pin, the tube slides on it, and its end is a point of the ground.
    let hung = common()
        + &joint("hold", "fixed", ["pin", "rod"], "0.35 0 0", "1 0 0")
        + &joint("extend", "prismatic", ["rod", "tube"], "0.2 0 -0.1", "1 0 0")
        + &place("foot", "tube", "0 0 0")
        + &place("stand", "ground", "1 0 0.3");
    let hung = imported(
        &hung,
        &format!("closed_loop: [['foot', 'stand']]\ntype: ['3d']\n{drives}"),
    );
    let said = lines(&welded.remarks);
    assert!(said.contains("the loop is cut at `x`, `y`, `z`"), "{said}");
    let [welded, hung] = [&welded, &hung].map(derived);
    assert_eq!(welded.reduction.retained.len(), hung.reduction.retained.len());
    let [a, b] = [&welded, &hung].map(forces);
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a} and {b}");
    }
}

#[test]
fn the_pose_says_which_assembly_is_meant() {
    let robot = common()
        + &joint("hold", "fixed", ["pin", "rod"], "0.35 0 0", "1 0 0")
        + &joint("extend", "prismatic", ["rod", "tube"], "0.2 0 -0.1", "1 0 0")
        + &place("foot", "tube", "0 0 0")
        + &place("stand", "ground", "1 0 0.3");
    let robot = format!("<robot name='strut'>{robot}</robot>");
    let closures = "closed_loop: [['foot', 'stand']]\ntype: ['3d']\nname_mot: ['extend']\n";
    let at = |pose: &[(String, f64)]| {
        let options = ImportOptions {
            closures: Some(closures),
            pose,
            ..ImportOptions::default()
        };
        import(&robot, &options)
    };
    let turn = |turn: f64, hinge: f64| {
        let pose = [("turn", turn), ("hinge", hinge), ("extend", 0.4)];
        let pose = pose.map(|(name, value)| (name.to_owned(), value));
        let imported = at(&pose).expect("a model");
        let loaded = modelmill_spec::load("model.toml", &imported.model, &MemoryFiles::default());
        let loaded = loaded.unwrap_or_else(|failure| panic!("{failure}"));
        let found = loaded.mechanism.coordinates.iter().find(|c| c.name == "turn");
        found.expect("turn").nominal
    };
    assert!(turn(0.9, -1.5) > 0.0);
    assert!(turn(-1.4, 1.5) < 0.0);
    let error = at(&[("tern".to_owned(), 1.0)]).expect_err("no such joint");
    assert!(error.to_string().contains("`tern`"), "{error}");
}

/// A rod between a crank and a rocker, as a URDF draws it that knows no balls: a hinge at one end, and a frame at the other.
fn rod_between(joint_of_rod: &str) -> String {
    let robot = "<link name='ground'/>".to_owned()
        + &link("crank", 2.0, "0.2 0 0.01")
        + &link("rocker", 1.0, "0.1 0 0.01")
        + &link("stick", 0.5, "0 0 0.5")
        + &joint("turn", "continuous", ["ground", "crank"], "0 0 0", "0.1 1 0")
        + &joint("swing", "continuous", ["ground", "rocker"], "0 0 1", "0 1 0.2")
        + &joint("held", joint_of_rod, ["crank", "stick"], "0.4 0 0", "0 1 0")
        + &place("top", "stick", "0 0 1")
        + &place("seat", "rocker", "0.4 0 0");
    format!("<robot name='rod'>{robot}</robot>")
}

const SEATED: &str = "closed_loop: [['top', 'seat']]\ntype: ['3d']\nname_mot: ['turn']\n";

fn with(robot: &str, closures: &str) -> Result<DescriptionImport, String> {
    let options = ImportOptions {
        closures: Some(closures),
        ..ImportOptions::default()
    };
    import(robot, &options).map_err(|error| error.to_string())
}

#[test]
fn joints_are_what_the_file_of_closures_says() {
    let more = |name: &str, kind: &str| format!("{SEATED}joint_name: ['{name}']\njoint_type: ['{kind}']\n");
    let ball = with(&rod_between("revolute"), &more("held", "SPHERICAL")).expect("a model");
    // A rod turns about itself last, wherever its length leads: that turn is the one that the loop leaves free.
    assert!(ball.model.contains("axes = \"yxz\""), "{}", ball.model);
    let passive = |line: &&str| line.contains("passive = true");
    let passive: Vec<&str> = ball.model.lines().filter(passive).collect();
    assert_eq!(passive.len(), 3, "{passive:?}");
    assert!(!passive.iter().any(|line| line.starts_with("held_z")), "{passive:?}");
    let spherical = with(&rod_between("spherical"), SEATED).expect("a model");
    assert_eq!(ball.model, spherical.model);
    let cross = with(&rod_between("revolute"), &more("held", "UJOINT_XY")).expect("a model");
    let names: Vec<&str> = cross.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["turn", "swing", "held_X", "held_Y"]);
    let open = "name_mot: ['turn']\njoint_name: ['swing']\njoint_type: ['FIXED']\n";
    let fixed = with(&rod_between("revolute"), open).expect("a model");
    assert!(fixed.joints.iter().all(|joint| joint.name != "swing"));
    let fault = |text: &str| with(&rod_between("revolute"), text).expect_err("a fault");
    assert!(fault(&more("hold", "SPHERICAL")).contains("`hold`"));
    assert!(fault(&more("held", "SPHERE")).contains("found `SPHERE`"));
    let short = format!("{SEATED}joint_name: ['held']\n");
    assert!(fault(&short).contains("a `joint_type` for each"));
    let odd = with(&rod_between("spherical"), &format!("{SEATED}color: ['red']\n"));
    let remarks = lines(&odd.expect("a model").remarks);
    assert!(remarks.contains("`color` is not read"), "{remarks}");
}

/// Grippers whose fingers were fixed by hand keep their <mimic>.
#[test]
fn fixed_joints_follow_nothing() {
    let follow = |of: &str| format!("<mimic joint='{of}' multiplier='-1' offset='0.25'/></joint>");
    let finger = |name: &str, kind: &str, of: &str| {
        let text = joint(name, kind, ["palm", &format!("{name}_link")], "0 0 0", "0 1 0");
        link(&format!("{name}_link"), 0.1, "0.1 0 0") + &text.replace("</joint>", &follow(of))
    };
    let robot = "<link name='base'/>".to_owned()
        + &link("palm", 1.0, "0 0 0.1")
        + &joint("wrist", "continuous", ["base", "palm"], "0 0 0", "1 0 0")
        + &finger("one", "fixed", "wrist")
        + &finger("two", "revolute", "one");
    let imported = import(
        &format!("<robot name='hand'>{robot}</robot>"),
        &ImportOptions::default(),
    );
    let imported = imported.expect("a model");
    assert_eq!(imported.joints.len(), 1);
    let remarks = lines(&imported.remarks);
    assert!(remarks.contains("`one` is fixed; its <mimic> is left out"), "{remarks}");
    assert!(remarks.contains("it is fixed at 0.25"), "{remarks}");
}
