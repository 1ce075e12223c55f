//! `<replicate>` and parts that an MJCF attaches: the forces at all joints are those of `mj_inverse` of MuJoCo 4.0.0, and
//! what MuJoCo refuses is refused with its place.
//!
//! The state: joint `k` of `n`, from 0 and in the order of the tree, has the position `0.1*(k + 1)` rad, the rate
//! `0.3 - 0.1*k` and the acceleration `0.5 + 0.2*k`.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_reduction::{ImportOptions, MeshFiles, expand_other_files, import};
use modelmill_spec::DriveKind;

use crate::derived;

/// The files by their names.
fn read(name: &str) -> Result<String, String> {
    match name {
        "child.xml" => Ok(CHILD.to_owned()),
        "rows.xml" => Ok(rows("")),
        "arm.urdf" => Ok(ARM.to_owned()),
        other => Err(format!("{other} is not there")),
    }
}

/// Two bodies and a shape of the world, with a document type.
const CHILD: &str = r#"<?xml version="1.0"?>
<!DOCTYPE mujoco [
  <!ENTITY unused "'>">
]>
<mujoco model="child">
  <default><geom density="500"/></default>
  <worldbody>
    <geom name="shelf" type="box" size=".1 .2 .3" pos="0 .2 .1"/>
    <body name="upper" pos=".1 0 .4" euler="0 30 0">
      <joint name="shoulder" axis="0 1 0" damping="0.4"/>
      <geom type="capsule" size=".05 .25" pos="0 0 .3"/>
    </body>
    <body name="other" pos=".3 .1 0"><joint name="turn" axis="1 1 0"/><geom size=".1" pos=".1 .2 .3"/></body>
  </worldbody>
  <actuator><motor name="shoulder" joint="shoulder"/><motor name="turn" joint="turn"/></actuator>
</mujoco>"#;

/// A URDF with two joints.
const ARM: &str = r#"<robot name="arm">
  <link name="base"><inertial><mass value="1.5"/><origin xyz="0 0 .1" rpy=".3 .2 .1"/><inertia ixx=".03" iyy=".02" izz=".04" ixy=".001" ixz=".002" iyz=".003"/></inertial></link>
  <link name="lower"><inertial><mass value="2"/><origin xyz="0 .1 .2" rpy=".1 .2 .3"/><inertia ixx=".05" iyy=".02" izz=".04" ixy=".001" ixz=".002" iyz=".003"/></inertial></link>
  <link name="slider"><inertial><mass value="0.7"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="elbow" type="revolute"><parent link="base"/><child link="lower"/><origin xyz="1 0 0" rpy=".1 .2 .3"/>
    <axis xyz="0 2 1"/><limit lower="-1" upper="1" effort="5" velocity="3"/><dynamics damping="0.3"/></joint>
  <joint name="slide" type="prismatic"><parent link="lower"/><child link="slider"/><origin xyz="0 0 .4" rpy="0 .5 0"/>
    <axis xyz="1 0 0"/><limit lower="-.1" upper="1" effort="50" velocity="3"/></joint>
</robot>"#;

/// Rows of pendulums: copies inside of copies, with a class.
fn rows(extra: &str) -> String {
    format!(
        r#"<mujoco model="rows">
  <default><joint axis="0 1 0"/><default class="heavy"><geom density="3000"/></default></default>
  <worldbody>
    <body name="table" pos="0 0 1">
      <joint name="tilt" axis="1 0 0"/>
      <geom type="box" size=".5 .5 .05"/>
      <frame pos=".1 .2 0" euler="0 0 40">
        <replicate count="2" offset="0 .4 .1" sep="_row" childclass="heavy">
          <replicate count="3" euler="10 20 30" offset=".3 .1 .2"
                     sep="_">
            <body name="bob" pos=".2 0 -.1">
              <joint name="swing" damping="0.2"/>
              <geom type="box" size=".05 .1 .15" pos="0 .1 -.3"/>
            </body>
          </replicate>
        </replicate>
      </frame>
    </body>
  </worldbody>
  <actuator><motor name="tilt" joint="tilt"/><motor name="swing" joint="swing" gear="2"/></actuator>
  {extra}
</mujoco>"#
    )
}

/// The forces at the joints in the order of the tree.
fn forces(text: &str) -> Vec<(String, f64)> {
    let whole = expand_other_files(text, &read).unwrap();
    assert_eq!(whole.lines().count(), text.lines().count(), "{whole}");
    let imported = import(&whole, &ImportOptions::default()).unwrap();
    let derivation = derived(&imported.model);
    let coordinates = &derivation.mechanism.coordinates;
    #[expect(clippy::cast_precision_loss, reason = "a small number of joints")]
    let values = |first: f64, step: f64| -> Vec<[f64; 1]> {
        (0..coordinates.len()).map(|k| [first + step * k as f64]).collect()
    };
    let levels = [values(0.1, 0.1), values(0.3, -0.1), values(0.5, 0.2)];
    let [q, qd, qdd] = levels
        .each_ref()
        .map(|level| level.iter().map(<[f64; 1]>::as_slice).collect());
    let states = MotionStates {
        q,
        qd,
        qdd,
        load: Vec::new(),
    };
    let found = ModelEvaluator::new(&derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .unwrap();
    let force_at = |k: usize| {
        let drives = derivation.mechanism.drives.iter();
        let at = drives.zip(&found).find_map(|(drive, force)| match drive.kind {
            DriveKind::Joint(coordinate) if coordinate.0 == k => Some(force[0]),
            _ => None,
        });
        at.unwrap_or_else(|| panic!("{} has no drive", coordinates[k].name))
    };
    (0..coordinates.len())
        .map(|k| (coordinates[k].name.clone(), force_at(k)))
        .collect()
}

/// Compares with the forces of MuJoCo.
fn check_forces(text: &str, expected: &[(&str, f64)]) {
    let found = forces(text);
    let largest = expected.iter().map(|(_, force)| force.abs()).fold(0.0, f64::max);
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for ((name, force), (joint, by_mujoco)) in found.iter().zip(expected) {
        assert_eq!(name, joint);
        assert!(
            (force - by_mujoco).abs() < 1e-9 * largest,
            "{name}: {force}, not {by_mujoco}"
        );
    }
}

/// A model that attaches the others in a frame of its body.
fn main_file(attach: &str) -> String {
    format!(
        r#"<mujoco model="main">
  <asset><model name="ch" file="child.xml"/><model file="rows.xml"/><model file="arm.urdf"/></asset>
  <worldbody>
    <body name="root" pos="0 0 2"><joint name="yaw" axis="1 0 1"/><geom size=".2"/>
      <frame pos="0 0 .3" euler="90 0 0">{attach}</frame>
    </body>
  </worldbody>
  <actuator><motor name="yaw" joint="yaw"/></actuator>
</mujoco>"#
    )
}

#[test]
fn copies_inside_of_copies_have_the_forces_of_mujoco() {
    check_forces(
        &rows(""),
        &[
            ("tilt", 788.494_169_176_499_4),
            ("swing_0_row0", 8.049_030_512_588_908),
            ("swing_1_row0", 22.327_131_033_693_572),
            ("swing_2_row0", 13.955_212_713_218_35),
            ("swing_0_row1", 25.153_909_642_854_17),
            ("swing_1_row1", 36.975_753_767_013_67),
            ("swing_2_row1", 26.424_164_032_462_06),
        ],
    );
    // One of the copies in another model, and copies of another model.
    check_forces(
        &main_file(r#"<attach model="rows" body="bob_1_row1" prefix="x_"/>"#),
        &[
            ("yaw", 50.018_871_978_613_745),
            ("x_swing_1_row1", 1.272_403_577_016_677_3),
        ],
    );
    check_forces(
        &main_file(
            r#"<replicate count="2" offset=".3 0 0" euler="0 45 0" sep="-"><attach model="ch" prefix="x_"/></replicate>"#,
        ),
        &[
            ("yaw", -44.568_630_400_474_1),
            ("x_shoulder_0", 0.739_537_807_448_138_1),
            ("x_turn_0", -4.121_645_784_097_319_5),
            ("x_shoulder_1", 0.923_995_357_494_843_1),
            ("x_turn_1", -3.721_532_830_913_757),
        ],
    );
}

#[test]
fn the_world_and_parts_of_the_same_model_are_attached() {
    check_forces(
        &main_file(r#"<attach model="ch" body="world" prefix="x_"/>"#),
        &[
            ("yaw", -33.321_446_037_633_32),
            ("x_shoulder", 0.739_537_807_448_137_9),
            ("x_turn", -4.121_645_784_097_319),
        ],
    );
    // The second part is a copy of the first, the last two are copies of the second.
    let parts = r#"<attach model="ch" body="upper" prefix="x_"/></frame><frame pos=".5 0 0" euler="0 40 0"><attach body="x_upper" prefix="y_"/><replicate count="2" euler="0 0 50"><attach body="y_x_upper" prefix="z_"/></replicate>"#;
    check_forces(
        &main_file(parts),
        &[
            ("yaw", -0.350_684_965_779_910_93),
            ("x_shoulder", 0.739_537_807_448_137_9),
            ("y_x_shoulder", -6.278_890_562_610_792),
            ("z_y_x_shoulder0", -6.265_835_623_322_217),
            ("z_y_x_shoulder1", -5.188_842_511_529_086),
        ],
    );
    // A part that is attached inside of itself has what stands before.
    let own = |name: &str| {
        format!(
            r#"<mujoco><worldbody><body name="o"><joint name="a"/><geom size=".1" mass="1"/>
               <body name="i" pos="0 0 1"><joint name="b"/><geom size=".1" mass="2"/><attach {name} prefix="x_"/>
               <body name="later"/></body></body></worldbody></mujoco>"#
        )
    };
    let imported = import(&own(r#"body="o""#), &ImportOptions::default()).unwrap();
    let names: Vec<&str> = imported.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "x_a", "x_b"]);
    assert!(!imported.model.contains("x_later"), "{}", imported.model);
    let fault = import(&own(r#"body="later""#), &ImportOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        fault.starts_with("line 2, <attach>: there is no body `later` before this element"),
        "{fault}"
    );
    let fault = import(&own(""), &ImportOptions::default()).unwrap_err().to_string();
    assert!(fault.contains("needs `body` or `frame`"), "{fault}");
}

/// `MuJoCo` 4.0.0 reads a URDF as a part of an MJCF: the effort is a limit, and the joints have only the drives of the MJCF.
#[test]
fn a_urdf_is_attached_as_mujoco_does() {
    let with_drives = |text: String| {
        text.replace(
            "</actuator>",
            "<motor joint=\"x_elbow\"/><motor joint=\"x_slide\"/></actuator>",
        )
    };
    let attach = r#"<attach model="arm" prefix="x_"/>"#;
    let text = with_drives(main_file(attach));
    check_forces(
        &text,
        &[
            ("yaw", -2.494_222_681_674_303_4),
            ("x_elbow", 2.983_219_893_515_047_3),
            ("x_slide", 3.510_541_789_289_782),
        ],
    );
    let imported = import(&expand_other_files(&text, &read).unwrap(), &ImportOptions::default()).unwrap();
    for limits in ["[-1.0, 1.0]", "[-5.0, 5.0]", "[-50.0, 50.0]"] {
        assert!(imported.model.contains(limits), "{limits} in {}", imported.model);
    }
    let remarks = crate::lines(&imported.remarks);
    let says = "in `arm.urdf`: line 5: the limit of the rate of `elbow` is left out";
    assert!(remarks.contains(says), "{remarks}");
    // A coupling, and what `MuJoCo` computes from shapes.
    let changed = |from: &str, to: &str| {
        let arm = ARM.replace(from, to);
        assert_ne!(arm, ARM);
        expand_other_files(&main_file(attach), &|name| {
            if name == "arm.urdf" {
                Ok(arm.clone())
            } else {
                read(name)
            }
        })
    };
    let mimic = changed(
        "<limit lower=\"-.1\"",
        "<mimic joint=\"elbow\" multiplier=\"2\" offset=\".5\"/><limit lower=\"-.1\"",
    );
    let imported = import(&mimic.unwrap(), &ImportOptions::default()).unwrap();
    for constant in ["x_slide_per_x_elbow = { value = 2.0", "x_slide_offset = { value = 0.5"] {
        assert!(imported.model.contains(constant), "{}", imported.model);
    }
    let shapes = "<link name=\"tip\"><collision/></link><joint name=\"f\" type=\"fixed\"><parent link=\"base\"/>\
                  <child link=\"tip\"/></joint></robot>";
    let fault = changed("</robot>", shapes).unwrap_err();
    assert!(
        fault.starts_with("line 5, <attach>: in `arm.urdf`: line 9, <link> `tip`: MuJoCo computes the mass"),
        "{fault}"
    );
}

/// What refers to copied elements is copied as `MuJoCo` 4.0.0 does it: names and references of the file that it saves.
#[test]
fn what_refers_to_copies_is_copied() {
    let text = |inside: &str, sections: &str| {
        format!(
            r#"<mujoco model="rope"><worldbody><body name="o"><joint name="k"/><geom size=".1"/></body>{inside}</worldbody>
            {sections}</mujoco>"#
        )
    };
    let body = |n: &str, pos: &str| {
        format!(
            r#"<body name="b{n}" pos="{pos}"><joint name="j{n}"/><geom size=".1"/>
               <body name="e{n}" pos="0 0 1"><joint name="l{n}"/><geom size=".1"/></body></body>"#
        )
    };
    let sections = |n: &str| {
        format!(
            r#"<tendon><fixed name="t{n}"><joint joint="j{n}" coef="2"/><joint joint="k" coef="1"/></fixed></tendon>
            <equality><joint name="c{n}" joint1="l{n}" joint2="j{n}" polycoef="0 3 0 0 0"/></equality>
            <actuator><motor name="m{n}" tendon="t{n}"/><motor joint="j{n}"/></actuator>"#
        )
    };
    let copied = text(
        &format!(
            r#"<replicate count="2" offset="0 1 0">{}</replicate>"#,
            body("", "1 0 0")
        ),
        &sections(""),
    );
    let by_hand = text(
        &(body("0", "1 0 0") + &body("1", "1 1 0")),
        &(sections("0") + &sections("1")),
    );
    let model = |text: &str| {
        let model = import(text, &ImportOptions::default()).unwrap().model;
        // Comments name lines.
        let lines = model
            .lines()
            .map(|line| line.split('#').next().unwrap_or("").trim_end().to_owned() + "\n");
        lines.collect::<String>()
    };
    assert_eq!(model(&copied), model(&by_hand));
    // A part of the same model: the coupling to what is not attached stays with the first.
    let attached = text(
        &format!(
            r#"{}<frame pos="0 1 0"><attach body="b" prefix="x_"/></frame>"#,
            body("", "1 0 0")
        ),
        r#"<equality><joint joint1="j" joint2="k"/></equality><actuator><motor name="m" joint="l"/></actuator>"#,
    );
    let renamed = body("", "1 1 0").replace("name=\"", "name=\"x_");
    let by_hand = text(
        &(body("", "1 0 0") + &renamed),
        r#"<equality><joint joint1="j" joint2="k"/></equality>
        <actuator><motor name="m" joint="l"/><motor name="x_m" joint="x_l"/></actuator>"#,
    );
    assert_eq!(model(&attached), model(&by_hand));
}

#[test]
fn what_cannot_be_copied_is_refused_with_its_place() {
    let fault = |inside: &str, sections: &str| {
        let text = format!(
            "<mujoco>\n<worldbody><body name=\"o\"><joint name=\"k\"/><geom size=\".1\"/>\n{inside}</body></worldbody>\n{sections}</mujoco>"
        );
        import(&text, &ImportOptions::default()).unwrap_err().to_string()
    };
    let body = r#"<body name="b"><joint name="j"/><geom size=".1"/></body>"#;
    let two = format!(r#"<replicate count="2" offset="0 1 0">{body}</replicate>"#);
    for (inside, sections, says) in [
        (
            format!("<replicate>{body}</replicate>"),
            "",
            "line 3, <replicate>: it needs the attribute `count`",
        ),
        (
            format!("<replicate count=\"1.5\">{body}</replicate>"),
            "",
            "line 3, <replicate>: expected a number of copies in `count`",
        ),
        (
            "<replicate count=\"2\"><frame><joint/></frame></replicate>".to_owned(),
            "",
            "line 3, <joint>: <joint> cannot be copied alone",
        ),
        (
            format!("<replicate count=\"100000000\">{body}</replicate>"),
            "",
            "line 3, <replicate>: with these copies the description is too large",
        ),
        (
            two.clone(),
            "<equality><joint name=\"c\" joint1=\"k\" joint2=\"j\"/></equality>",
            "line 4, <joint> `c`: it refers to `j` inside of <replicate> and to `k` outside of it",
        ),
        // The copy has the name of another body.
        (
            format!("{two}<body name=\"b1\"/>"),
            "",
            "two bodies have the name `b1`; rename one",
        ),
    ] {
        let found = fault(&inside, sections);
        assert!(found.contains(says), "{found}");
    }
    // Copies of copies grow without an end.
    let deep = |n: usize| {
        let open = "<replicate count=\"9\" sep=\"_\">".repeat(n);
        format!("{open}{body}{}", "</replicate>".repeat(n))
    };
    assert!(fault(&deep(12), "").contains("too large"));
    // Each of many elements is searched for each of many names.
    let many = "<replicate count=\"1\"/>".repeat(3000);
    let motors = format!("<actuator>{}</actuator>", "<motor joint=\"k\"/>".repeat(3000));
    assert!(fault(&many, &motors).contains("too many copies and references"));
    // One element may have many references.
    let tendon = format!(
        "<tendon><spatial>{}</spatial></tendon>",
        "<site site=\"s\"/>".repeat(2000)
    );
    assert!(fault(&many, &tendon).contains("too many copies and references"));
    // `MuJoCo` reads this; the import states what it cannot.
    let inside = format!(r#"<replicate count="2">{body}<attach body="b" prefix="x_"/></replicate>"#);
    let found = fault(&inside, "");
    assert!(
        found.contains("line 3, <attach>") && found.contains("inside the same <replicate> cannot be attached here"),
        "{found}"
    );
    // A part of the same model must not be named as a model.
    let text = main_file(r#"<attach model="own" body="root" prefix="x_"/>"#)
        .replace("<model file=\"rows.xml\"/>", "<model name=\"own\"/>");
    let found = expand_other_files(&text, &read).unwrap_err();
    assert!(
        found.starts_with("line 2, <model> `own`: it needs the attribute `file`"),
        "{found}"
    );
}

/// `MuJoCo` refuses equal names of one kind, and leaves elements without a name unnamed.
#[test]
fn names_are_given_once() {
    let fault = |text: &str| import(text, &ImportOptions::default()).unwrap_err().to_string();
    let joint = |name: &str| format!("<body><joint name=\"{name}\"/><geom size=\".1\"/></body>");
    let text = format!("<mujoco><worldbody>{}\n{}</worldbody></mujoco>", joint("j"), joint("j"));
    let found = fault(&text);
    assert!(
        found.starts_with("line 2, <joint> `j`: two joints have the name `j`"),
        "{found}"
    );
    let attached = main_file(r#"<attach model="ch" prefix="x_"/><body name="n"><joint name="x_turn"/></body>"#);
    let found = fault(&expand_other_files(&attached, &read).unwrap());
    assert!(
        found.contains("line 5") && found.contains("two joints have the name `x_turn`"),
        "{found}"
    );
    // Names that the import gives are not those of the file: bodies, joints and free joints.
    let text = r#"<mujoco model="unnamed"><worldbody>
        <body name="a"><joint/><geom size=".1" mass="1"/>
          <body><joint/><geom size=".1" mass="2"/></body></body>
        <body name="body2" pos="1 0 0"><joint name="a_joint"/><geom size=".1" mass="3" pos="0 1 0"/></body>
        <body><freejoint/><geom size=".1"/></body><body name="c"><joint name="root"/><geom size=".1"/></body></worldbody>
        <actuator><motor name="m" joint="a_joint"/></actuator></mujoco>"#;
    let imported = import(text, &ImportOptions::default()).unwrap();
    let driven = imported.joints.iter().find(|joint| joint.name == "a_joint").unwrap();
    let driven_line = format!("joint = \"{}\"", driven.coordinates[0]);
    let drives: Vec<&str> = imported.model.split("[[drive]]").skip(1).collect();
    assert!(
        drives.len() == 1 && drives[0].contains(&driven_line),
        "{}",
        imported.model
    );
    let mut names: Vec<&str> = imported.joints.iter().map(|joint| joint.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), 5, "{names:?}");
}

/// `MuJoCo` 4.0.0 reads a mesh relative to the main file, with the folder of its settings. If there is none, it reads the one
/// in the folder of the included file, without the folder of the settings.
#[test]
fn meshes_of_included_files_are_found() {
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let body = r#"<body name="b"><joint/><geom type="mesh" mesh="q"/></body>"#;
    let files = |name: &str| match name {
        "s/inc.xml" => Ok("<mujoco>\n<asset><mesh name=\"q\"\nfile=\"q.obj\"/></asset></mujoco>".to_owned()),
        "d/c.xml" => Ok(format!(
            "<mujoco model=\"c\"><compiler meshdir=\"m\"/><include file=\"s/inc.xml\"/><worldbody>{body}</worldbody></mujoco>"
        )),
        "d/s/inc.xml" => Ok("<mujoco><asset><mesh name=\"q\" file=\"q.obj\"/></asset></mujoco>".to_owned()),
        other => Err(format!("{other} is not there")),
    };
    let check = |text: &str, present: &[&str], expected: Result<&str, &str>| {
        let whole = expand_other_files(text, &files).unwrap();
        let read_mesh = |name: &str| {
            if present.contains(&name) {
                // The first file is larger, so that the mass shows which was read.
                let scaled = corners.replace("1 0 0", if name == present[0] { "2 0 0" } else { "1 0 0" });
                Ok(scaled.into_bytes())
            } else {
                Err(format!("{name} is not there"))
            }
        };
        let options = ImportOptions {
            meshes: Some(MeshFiles(&read_mesh)),
            ..ImportOptions::default()
        };
        match (import(&whole, &options), expected) {
            (Ok(imported), Ok(mass)) => assert!(imported.model.contains(mass), "{}", imported.model),
            (Err(fault), Err(says)) => assert!(fault.to_string().contains(says), "{fault}"),
            (found, _) => panic!("{found:?}"),
        }
    };
    let included = |compiler: &str| {
        format!("<mujoco>{compiler}<include file=\"s/inc.xml\"/><worldbody>{body}</worldbody></mujoco>")
    };
    // A corner of a cube of water: 1000 kg/6, the larger one 1000 kg/3.
    let (small, large) = (Ok("166.666666666667"), Ok("333.333333333333"));
    check(&included(""), &["s/q.obj", "q.obj"], small);
    check(&included(""), &["s/q.obj"], large);
    check(&included("<compiler meshdir=\"m\"/>"), &["s/q.obj", "q.obj"], large);
    check(
        &included("<compiler meshdir=\"m\"/>"),
        &["s/m/q.obj", "q.obj"],
        Err("m/q.obj is not there"),
    );
    check(
        &included("<compiler meshdir=\"m\" strippath=\"true\"/>"),
        &["s/q.obj"],
        Err("m/q.obj is not there"),
    );
    let attached = r#"<mujoco><asset><model name="c" file="d/c.xml"/></asset><worldbody><attach model="c" prefix="x_"/></worldbody></mujoco>"#;
    check(attached, &["d/s/q.obj", "d/m/q.obj"], small);
    check(attached, &["d/s/q.obj", "s/q.obj"], large);
}
