//! `reduce` and `import`: what comes out is a model file that other commands take.

use crate::common::{json, model, number, printed, refused, scratch, workspace};

fn rigs(name: &str) -> String {
    workspace("model-spec/rigs").join(name).display().to_string()
}

#[test]
fn the_whole_robot_reduces_to_the_bundled_model() {
    let out = scratch("reduced.toml");
    let reduce = [
        "reduce",
        &rigs("spidermill-full.toml"),
        "--plan",
        &rigs("spidermill-plan.toml"),
        "--out",
        &out,
    ];
    let report = printed(&reduce);
    for part in [
        "Step 1",
        "Step 2",
        "eq. (1)",
        "Step 3",
        "Step 4",
        "0.02 m",
        "Error - forces",
    ] {
        assert!(report.contains(part), "{part}: {report}");
    }
    let told = json(&[reduce.as_slice(), &["--json"]].concat());
    for drive in 0..2 {
        let nrms = number(&told, &format!("/forces/{drive}/nrms"));
        assert!(nrms < 1e-9, "{nrms}");
    }
    let base = |path: &str| json(&["equations", path, "--format", "json"])["base"].clone();
    assert_eq!(base(&out), base(&model("spidermill.toml")));
}

/// The spindles' rods have no place in the M structure: forgotten they are an error, left out they have an error too.
#[test]
fn what_a_plan_leaves_out_has_an_error() {
    let plan = scratch("rods.toml");
    let text = std::fs::read_to_string(rigs("spidermill-plan.toml")).expect("a plan");
    std::fs::write(&plan, &text).expect("written");
    let out = scratch("rodless.toml");
    let rig = rigs("spidermill-with-rods.toml");
    let says = refused(1, &["reduce", &rig, "--plan", &plan, "--out", &out]);
    assert!(
        says.contains("the plan does not mention rod_left, rod_right") && says.contains("rods.toml:"),
        "{says}"
    );
    let left = text.replacen("schema = 1", "schema = 1\nleave_out = [\"rod_left\", \"rod_right\"]", 1);
    std::fs::write(&plan, left).expect("written");
    let told = json(&["reduce", &rig, "--plan", &plan, "--out", &out, "--json"]);
    let error = number(&told, "/forces/0/nrms");
    println!("error of leaving out the rods: {error:.3}");
    assert!((1e-3..0.3).contains(&error), "{error}");
}

/// Cranks side by side close more loops than the robot needs: equations that follow from others are left out, and the
/// model of all bodies has the rig's forces.
#[test]
fn a_rig_with_redundant_loops_needs_no_plan() {
    let out = scratch("unplanned.toml");
    let rig = rigs("spidermill-full.toml");
    let told = json(&["reduce", &rig, "--out", &out, "--json"]);
    for drive in 0..2 {
        let price = number(&told, &format!("/forces/{drive}/nrms"));
        assert!(price < 1e-9, "{price}");
    }
}

#[test]
fn faults_of_a_reduction_are_said() {
    let out = scratch("never-reduced.toml");
    let says = refused(1, &["reduce", "no/such.toml", "--out", &out]);
    assert!(says.contains("no/such.toml"), "{says}");
    let plan = rigs("spidermill-plan.toml");
    let says = refused(
        2,
        &["reduce", &rigs("spidermill-full.toml"), "--plan", &plan, "--out", &plan],
    );
    assert!(says.contains("overwrite"), "{says}");
    assert!(!std::path::Path::new(&out).exists());
}

#[test]
fn a_urdf_becomes_a_model() {
    let urdf = scratch("arm.urdf");
    let text = "<robot name='arm'><link name='foot'/><link name='arm'><inertial><origin xyz='0 0 0.3'/><mass value='2'/>\
        <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.01'/></inertial></link>\
        <joint name='hip' type='revolute'><parent link='foot'/><child link='arm'/><origin rpy='1.5708 0 0'/>\
        <axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>";
    std::fs::write(&urdf, text).expect("written");
    let out = scratch("arm-model.toml");
    let ran = crate::common::ran(&["import", &urdf, "--out", &out]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(ran.err.contains("1.5708 rad, is not rounded to pi/2"), "{}", ran.err);
    let ran = crate::common::ran(&["import", &urdf, "--round-angles", "--out", &out]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(ran.err.contains("is rounded to pi/2"), "{}", ran.err);
    let checked = json(&["check", &out, "--json"]);
    assert_eq!(checked["joints"]["active"][0], "hip");

    std::fs::write(&urdf, "<robot").expect("written");
    let says = refused(1, &["import", &urdf, "--out", &out]);
    assert!(
        says.contains("arm.urdf") && says.contains("not a readable URDF"),
        "{says}"
    );
    let says = refused(1, &["import", "no/such.urdf", "--out", &out]);
    assert!(says.contains("no/such.urdf"), "{says}");
}

/// From a table of masses and a list of joints to the structure of eq. (16): checked, proposed, edited and reduced.
#[test]
fn a_table_of_masses_becomes_the_structure_of_the_paper() {
    let rig = rigs("spidermill-seventeen.toml");
    let checked = json(&["check", &rig, "--json"]);
    assert_eq!(checked["bodies"].as_array().map(Vec::len), Some(17));
    // The masses of the bundled rig of eleven groups.
    let whole = json(&["check", &rigs("spidermill-full.toml"), "--json"]);
    let difference = number(&checked, "/mass") - number(&whole, "/mass");
    assert!(difference.abs() < 1e-9, "{difference}");
    let (plan, out) = (scratch("proposed.toml"), scratch("seventeen.toml"));
    let proposed = json(&["reduce", &rig, "--propose", &plan, "--json"]);
    assert_eq!(proposed["out"], serde_json::Value::Null);
    // The names of the model are the user's: a part gets another one.
    let text = std::fs::read_to_string(&plan).expect("a plan");
    let edited = text.replace("\"q_G9F\"", "\"gamma1\"");
    assert_ne!(text, edited);
    std::fs::write(&plan, edited).expect("written");
    let reduced = json(&["reduce", &rig, "--plan", &plan, "--out", &out, "--json"]);
    let bundled = json(&["equations", &model("spidermill.toml"), "--format", "json"]);
    let found = json(&["equations", &out, "--format", "json"]);
    let count = |object: &serde_json::Value| object["base"].as_array().map(Vec::len);
    assert_eq!(count(&found), count(&bundled));
    for told in [&proposed, &reduced] {
        assert!((number(told, "/base_parameters") - 4.0).abs() < 0.5);
        for drive in 0..2 {
            let nrms = number(told, &format!("/forces/{drive}/nrms"));
            assert!(nrms < 1e-9, "{nrms}");
        }
    }
    // One file cannot be both; a path that is spelled differently is the same file.
    let fresh = scratch("fresh/both.toml");
    let folder = std::path::Path::new(&fresh).parent().expect("a folder");
    std::fs::create_dir_all(folder).expect("a folder");
    let other = folder.join("../fresh/both.toml").display().to_string();
    for out in [&fresh, &other] {
        let says = refused(2, &["reduce", &rig, "--propose", &fresh, "--out", out]);
        assert!(says.contains("--propose and --out are the same file"), "{says}");
        assert!(!std::path::Path::new(&fresh).exists());
    }
    // The proposal does not overwrite what it reads.
    let says = refused(2, &["reduce", &rig, "--propose", &rig]);
    assert!(says.contains("would overwrite"), "{says}");
}

/// A rig that does not close states by how much and at which joint.
#[test]
fn open_joints_are_reported_with_their_gap() {
    let path = scratch("open.toml");
    let text = std::fs::read_to_string(rigs("spidermill-full.toml")).expect("a rig");
    let open = text.replacen("at = [1.13, 0, 0]", "at = [1.23, 0, 0]", 1);
    assert_ne!(text, open);
    std::fs::write(&path, open).expect("written");
    let says = refused(1, &["check", &path]);
    assert!(says.contains("do not close") && says.contains("100 mm"), "{says}");
}

/// A planar mechanism as MJCF is reduced like a rig.
#[test]
fn a_description_is_reduced() {
    let (description, out) = (scratch("linkage.xml"), scratch("linkage.toml"));
    printed(&["export", &model("five_bar.toml"), "--out", &description]);
    let reduced = json(&["reduce", &description, "--out", &out, "--json"]);
    for drive in 0..2 {
        let nrms = number(&reduced, &format!("/forces/{drive}/nrms"));
        assert!(nrms < 1e-9, "{nrms}");
    }
}
