//! A strut welded to a crank's pin, and the same strut hung on the pin from the start: one mechanism, whatever its file says.

use modelmill_boundary::files::Memory;
use modelmill_codegen::{Derivation, Evaluator, States, derive};
use modelmill_reduction::{ImportOptions, Imported, import};

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
    format!("<link name='{name}'/>")
        + &joint(&format!("{name}_at"), "fixed", [on, name], xyz, "1 0 0")
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

fn imported(robot: &str, closures: &str) -> Imported {
    let options = ImportOptions {
        closures: Some(closures),
        ..ImportOptions::default()
    };
    import(&format!("<robot name='strut'>{robot}</robot>"), &options).expect("a model")
}

fn derived(imported: &Imported) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", &imported.model, &Memory::default());
    let loaded = loaded.unwrap_or_else(|failure| panic!("{failure}"));
    derive(&loaded.mechanism).expect("a derivation")
}

/// Forces of the strut's drive at some states.
fn forces(derivation: &Derivation) -> Vec<f64> {
    let names = derivation.mechanism.coordinates.iter();
    let active: Vec<_> = names.filter(|c| !c.passive).map(|c| &c.name).collect();
    assert_eq!(active, ["extend"]);
    let start = derivation.mechanism.coordinates.iter();
    let start = start
        .clone()
        .find(|c| c.name == "extend")
        .expect("extend")
        .nominal;
    let q: Vec<f64> = (0..8).map(|k| start + 0.01 * f64::from(k)).collect();
    let qd: Vec<f64> = (0..8).map(|k| 0.3 - 0.1 * f64::from(k)).collect();
    let qdd: Vec<f64> = (0..8).map(|k| 0.2 * f64::from(k) - 0.5).collect();
    let states = States {
        q: vec![&q],
        qd: vec![&qd],
        qdd: vec![&qdd],
        load: Vec::new(),
    };
    let found = Evaluator::new(derivation)
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
        + &joint(
            "extend",
            "prismatic",
            ["tube", "rod"],
            "-0.2 0 0.1",
            "-1 0 0",
        )
        + &place("end", "rod", "-0.3 0 0")
        + &place("seat", "pin", "0.05 0 0");
    let welded = imported(
        &welded,
        &format!("closed_loop: [['seat', 'end']]\ntype: ['6d']\n{drives}"),
    );
    // The rod is a part of the pin, the tube slides on it, and its end is a point of the ground.
    let hung = common()
        + &joint("hold", "fixed", ["pin", "rod"], "0.35 0 0", "1 0 0")
        + &joint(
            "extend",
            "prismatic",
            ["rod", "tube"],
            "0.2 0 -0.1",
            "1 0 0",
        )
        + &place("foot", "tube", "0 0 0")
        + &place("stand", "ground", "1 0 0.3");
    let hung = imported(
        &hung,
        &format!("closed_loop: [['foot', 'stand']]\ntype: ['3d']\n{drives}"),
    );
    let said = welded.remarks.join("\n");
    assert!(said.contains("the loop is cut at `x`, `y`, `z`"), "{said}");
    let [welded, hung] = [&welded, &hung].map(derived);
    assert_eq!(
        welded.reduction.retained.len(),
        hung.reduction.retained.len()
    );
    let [a, b] = [&welded, &hung].map(forces);
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a} and {b}");
    }
}

#[test]
fn the_pose_says_which_assembly_is_meant() {
    let robot = common()
        + &joint("hold", "fixed", ["pin", "rod"], "0.35 0 0", "1 0 0")
        + &joint(
            "extend",
            "prismatic",
            ["rod", "tube"],
            "0.2 0 -0.1",
            "1 0 0",
        )
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
        let loaded = modelmill_spec::load("model.toml", &imported.model, &Memory::default());
        let loaded = loaded.unwrap_or_else(|failure| panic!("{failure}"));
        let found = loaded
            .mechanism
            .coordinates
            .iter()
            .find(|c| c.name == "turn");
        found.expect("turn").nominal
    };
    assert!(turn(0.9, -1.5) > 0.0);
    assert!(turn(-1.4, 1.5) < 0.0);
    let error = at(&[("tern".to_owned(), 1.0)]).expect_err("no such joint");
    assert!(error.to_string().contains("`tern`"), "{error}");
}
