//! A robot description of ROS as a starting point: its model must have the forces that another path gives.

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_reduction::{ImportOptions, import};
use modelmill_rig::{RigState, RigTracker, forces};

use crate::lines;

/// An arm with a joint along a slanted axis, a prismatic one, a tool behind a fixed joint, and roundings as CAD
/// exports have them.
const ARM: &str = r#"<?xml version="1.0"?>
<robot name="Test Arm">
  <link name="world"/>
  <link name="foot"><inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="upper">
    <inertial>
      <origin xyz="0.1 0.02 0.2" rpy="0.3 0.1 -0.2"/><mass value="4"/>
      <inertia ixx="0.10" ixy="0.01" ixz="0.02" iyy="0.12" iyz="-0.01" izz="0.05"/>
    </inertial>
  </link>
  <link name="fore-arm">
    <inertial><origin xyz="0.2 0 0"/><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.04"/></inertial>
  </link>
  <link name="tool">
    <inertial><origin xyz="0 0.05 0" rpy="0 0 0.4"/><mass value="0.7"/><inertia ixx="0.002" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.002"/></inertial>
  </link>
  <link name="slide">
    <inertial><origin xyz="0 0 0.1"/><mass value="1.5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.004"/></inertial>
  </link>
  <joint name="floor" type="fixed"><parent link="world"/><child link="foot"/><origin xyz="0 0 0.1"/></joint>
  <joint name="shoulder" type="revolute">
    <parent link="foot"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0 1.5708 0"/><axis xyz="-1 0 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/><dynamics damping="0.8" friction="0"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="fore-arm"/><origin xyz="0.4 0.1 0" rpy="0.2 0 -0.5"/><axis xyz="0 0.6 0.8"/>
  </joint>
  <joint name="grip" type="fixed"><parent link="fore-arm"/><child link="tool"/><origin xyz="0.3 0 0.05" rpy="0 0.7 0"/></joint>
  <joint name="quill" type="prismatic">
    <parent link="tool"/><child link="slide"/><origin xyz="0 0 0.1" rpy="0 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="0.1" upper="0.3" effort="1" velocity="1"/>
  </joint>
</robot>"#;

/// The same arm as a rig, written down by hand: places and axes in the base frame at the zero of all joints.
fn rig() -> modelmill_rig::Rig {
    use nalgebra::{Rotation3, Vector3};
    let rpy = |r: f64, p: f64, y: f64| Rotation3::from_euler_angles(r, p, y);
    // Zero poses, joint after joint. The importer takes 1.5708 for a right angle.
    let (upper, p_upper) = (rpy(0.0, std::f64::consts::FRAC_PI_2, 0.0), Vector3::new(0.0, 0.0, 0.4));
    let (fore, p_fore) = (
        upper * rpy(0.2, 0.0, -0.5),
        p_upper + upper * Vector3::new(0.4, 0.1, 0.0),
    );
    let (tool, p_tool) = (fore * rpy(0.0, 0.7, 0.0), p_fore + fore * Vector3::new(0.3, 0.0, 0.05));
    let (slide, p_slide) = (tool * rpy(0.0, 0.0, 0.1), p_tool + tool * Vector3::new(0.0, 0.0, 0.1));
    let list = |v: Vector3<f64>| format!("[{}, {}, {}]", v.x, v.y, v.z);
    // A frame in the inertial's own axes saves turning the inertia.
    let body = |name: &str, r: Rotation3<f64>, p: Vector3<f64>, rest: &str| {
        let (roll, pitch, yaw) = r.euler_angles();
        format!(
            "[[body]]\nname = \"{name}\"\nat = {}\nrpy = [{roll}, {pitch}, {yaw}]\n{rest}\n",
            list(p)
        )
    };
    let joint = |name: &str, kind: &str, between: &str, at: Vector3<f64>, axis: Vector3<f64>| {
        format!(
            "[[joint]]\nname = \"{name}\"\nkind = \"{kind}\"\nbetween = {between}\nat = {}\naxis = {}\n",
            list(at),
            list(axis)
        )
    };
    let mut text = "schema = 1\nname = \"arm\"\ngravity = [0, 0, -9.81]\n".to_owned();
    text += &body(
        "upper",
        upper * rpy(0.3, 0.1, -0.2),
        p_upper + upper * Vector3::new(0.1, 0.02, 0.2),
        "mass = 4\ninertia = { xx = 0.10, xy = 0.01, xz = 0.02, yy = 0.12, yz = -0.01, zz = 0.05 }",
    );
    text += &body(
        "fore",
        fore,
        p_fore,
        "mass = 2\ncentre = [0.2, 0, 0]\ninertia = { xx = 0.01, yy = 0.04, zz = 0.04 }",
    );
    text += &body(
        "tool",
        tool * rpy(0.0, 0.0, 0.4),
        p_tool + tool * Vector3::new(0.0, 0.05, 0.0),
        "mass = 0.7\ninertia = { xx = 0.002, yy = 0.001, zz = 0.002 }",
    );
    text += &body(
        "slide",
        slide,
        p_slide,
        "mass = 1.5\ncentre = [0, 0, 0.1]\ninertia = { xx = 0.01, yy = 0.01, zz = 0.004 }",
    );
    text += &joint(
        "shoulder_joint",
        "revolute",
        "[\"base\", \"upper\"]",
        p_upper,
        upper * -Vector3::x(),
    );
    text += &joint(
        "elbow_joint",
        "revolute",
        "[\"upper\", \"fore\"]",
        p_fore,
        fore * Vector3::new(0.0, 0.6, 0.8),
    );
    text += &joint("grip", "fixed", "[\"fore\", \"tool\"]", p_tool, Vector3::z());
    text += &joint(
        "quill_joint",
        "prismatic",
        "[\"tool\", \"slide\"]",
        p_slide,
        slide * Vector3::y(),
    );
    let named =
        |table: &str, name: &str, joint: &str| format!("[[{table}]]\nname = \"{name}\"\njoint = \"{joint}_joint\"\n");
    for name in ["shoulder", "elbow", "quill"] {
        text.push_str(&named("coordinate", name, name));
    }
    for name in ["shoulder", "elbow", "quill"] {
        text.push_str(&named("drive", &format!("{name}_drive"), name));
    }
    text += "[[effect]]\nkind = \"viscous_friction\"\nat = [\"shoulder_drive\"]\nvalues = { Fv = 0.8 }\n";
    modelmill_rig::load("arm.toml", &text, &MemoryFiles::default())
        .unwrap_or_else(|f| panic!("{f}"))
        .rig
}

fn derived(text: &str) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", text, &MemoryFiles::default());
    modelmill_codegen::derive(&loaded.unwrap_or_else(|failure| panic!("{failure}")).mechanism).expect("a derivation")
}

#[test]
fn an_imported_arm_has_the_forces_of_its_rig() {
    let options = ImportOptions {
        round_angles: true,
        ..ImportOptions::default()
    };
    let imported = import(ARM, &options).unwrap_or_else(|error| panic!("{error}"));
    println!("{}\n{:?}", imported.model, imported.remarks);
    let derivation = derived(&imported.model);
    let names: Vec<&str> = derivation
        .mechanism
        .coordinates
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    assert_eq!(names, ["shoulder", "elbow", "quill"]);
    let rig = rig();
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    let mut columns = vec![Vec::new(); 9];
    let mut expected = vec![Vec::new(); 3];
    for i in 0..40 {
        let wave = |k: f64| (k * f64::from(i)).sin();
        let draw = |k: f64| vec![wave(k), wave(k + 0.3), 0.2 * wave(k + 0.7)];
        let state = RigState {
            q: draw(0.7),
            qd: draw(1.9),
            qdd: draw(2.9),
        };
        let found = forces(&rig, &tracker.follow(&state).expect("a pose")).expect("forces");
        for d in 0..3 {
            expected[d].push(found[d]);
            columns[d].push(state.q[d]);
            columns[3 + d].push(state.qd[d]);
            columns[6 + d].push(state.qdd[d]);
        }
    }
    let slices = |range: std::ops::Range<usize>| columns[range].iter().map(Vec::as_slice).collect();
    let states = MotionStates {
        q: slices(0..3),
        qd: slices(3..6),
        qdd: slices(6..9),
        load: Vec::new(),
    };
    let found = ModelEvaluator::new(&derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .expect("forces");
    for (found, expected) in found.iter().zip(&expected) {
        for (x, y) in found.iter().zip(expected) {
            assert!((x - y).abs() < 1e-8 * y.abs().max(1.0), "{x} instead of {y}");
        }
    }
    let says = lines(&imported.remarks);
    assert!(
        says.contains("1.5708 rad, is rounded to pi/2 (difference 0.0000037 rad)") || says.contains("3.7e-6"),
        "{says}"
    );
    let facts = lines(&imported.facts);
    assert!(facts.contains("`foot` does not move"), "{facts}");
    assert!(
        imported.model.contains("quill = { nominal = 0.2 }"),
        "the middle of its range"
    );
}

#[test]
fn what_makes_no_model_is_said() {
    let says = |text: &str| {
        import(text, &ImportOptions::default())
            .expect_err("a fault")
            .to_string()
    };
    assert!(says("").contains("not a readable URDF"));
    assert!(says("schema = 1").contains("not a readable URDF"));
    assert!(says("<robot name='r'><link name='a'/></robot>").contains("no joint that moves"));
    let two = |joints: &str| format!("<robot name='r'><link name='a'/><link name='b'/>{joints}</robot>");
    let joint = |name: &str, kind: &str, parent: &str, child: &str, more: &str| {
        format!("<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>{more}</joint>")
    };
    assert!(says(&two("")).contains("are both without a parent"));
    assert!(says(&two(&joint("j", "revolute", "a", "c", ""))).contains("`c`, which does not exist"));
    assert!(says(&two(&joint("j", "planar", "a", "b", ""))).contains("the joint type planar is not supported"));
    assert!(says(&two(&joint("j", "revolute", "a", "b", "<axis xyz='0 0 0'/>"))).contains("no direction"));
    let ring = joint("j", "revolute", "a", "b", "") + &joint("k", "revolute", "b", "a", "");
    assert!(says(&two(&ring)).contains("there is no root link"));
    let twice = joint("j", "revolute", "a", "b", "") + &joint("k", "revolute", "a", "b", "");
    assert!(says(&two(&twice)).contains("is the child of two joints"));
    let heavy = two(&joint("j", "revolute", "a", "b", ""))
        .replace("<link name='b'/>", "<link name='b'><inertial><mass value='-1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>");
    assert!(says(&heavy).contains("the mass of the link `b` is negative"));
}

/// Descriptions that someone is still writing: cut anywhere, or with a line left out, they give an answer and no panic.
#[test]
fn unfinished_descriptions_give_an_answer() {
    let lines: Vec<&str> = ARM.lines().collect();
    let without = (0..lines.len()).map(|k| [&lines[..k], &lines[k + 1..]].concat().join("\n"));
    let cut = (0..ARM.len())
        .step_by(29)
        .filter_map(|k| ARM.get(..k).map(str::to_owned));
    let odd = ["\"4\"", "\"0.2 0 0\"", "\"upper\"", "revolute", "xyz"]
        .into_iter()
        .flat_map(|old| ["\"\"", "\"nan\"", "\"1e999 0 0\"", "\"-\""].map(|new| ARM.replace(old, new)));
    let mut sound = 0;
    for unfinished in without.chain(cut).chain(odd) {
        match import(&unfinished, &ImportOptions::default()) {
            Ok(imported) => {
                sound += 1;
                assert!(imported.model.contains("[[frame]]"));
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    assert!(sound > 0);
}

/// A right angle with eleven digits behind the point is one, and forces are those of the rig all the same; with four it stays.
#[test]
fn right_angles_are_read_from_their_digits() {
    let robot = |angle: &str| {
        let text = format!(
            "<robot name='r'><link name='a'/><link name='b'><inertial><mass value='1'/>\
             <inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>\
             <joint name='j' type='continuous'><origin rpy='{angle} 0 0'/><parent link='a'/><child link='b'/></joint></robot>"
        );
        import(&text, &ImportOptions::default()).unwrap()
    };
    let eleven = robot("1.57079632679");
    assert!(eleven.model.contains("\"pi/2\""), "{}", eleven.model);
    assert!(!lines(&eleven.remarks).contains("angle"));
    let four = robot("1.5708");
    assert!(four.model.contains("value = 1.5708"), "{}", four.model);
    assert!(lines(&four.remarks).contains("is not rounded to pi/2"));
}

#[test]
fn the_world_needs_no_link() {
    let declared = import(ARM, &ImportOptions::default()).unwrap();
    let implied = ARM.replace("  <link name=\"world\"/>\n", "");
    assert_ne!(implied, ARM);
    assert_eq!(
        import(&implied, &ImportOptions::default()).unwrap().model,
        declared.model
    );
    // Other links must exist, and the world is no child.
    for text in [
        implied.replace("<parent link=\"world\"/>", "<parent link=\"floor_plate\"/>"),
        implied.replace("<child link=\"tool\"/>", "<child link=\"world\"/>"),
    ] {
        assert!(import(&text, &ImportOptions::default()).is_err());
    }
}

#[test]
fn all_values_of_a_body_are_written_and_zeros_are_exact() {
    // A rotation by a quarter turn leaves rounding beside the zeros.
    let turned = ARM.replace(
        "<origin xyz=\"0 0 0.1\"/><mass",
        "<origin xyz=\"0 0 0.1\" rpy=\"1.5707963267948966 0 3.141592653589793\"/><mass",
    );
    assert_ne!(turned, ARM);
    let imported = import(&turned, &ImportOptions::default()).unwrap().model;
    assert!(!imported.contains("e-1"), "{imported}");
    let files = MemoryFiles::default();
    let loaded = modelmill_spec::load("arm.toml", &imported, &files).unwrap();
    let parameters = &loaded.mechanism.parameters;
    assert!(parameters.iter().all(|parameter| parameter.has_nominal), "{imported}");
    // The products of inertia and two first moments of the slide.
    assert_eq!(
        parameters.iter().filter(|parameter| parameter.nominal == 0.0).count(),
        5
    );
}
