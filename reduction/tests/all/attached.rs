//! Models that an MJCF attaches: the import is that of the complete model which MuJoCo 4.0 makes of the files (saved with
//! `mj_saveLastXML`, with all digits and with the settings of each compiler).

use std::cell::RefCell;

use modelmill_reduction::{ImportOptions, MeshFiles, expand_other_files, import};

/// Shapes outside of bodies, two classes, a compiler in rad, a coupling, a tendon, and actuators.
const CHILD: &str = r#"<mujoco model="child">
  <compiler angle="radian"/>
  <default><geom density="500"/><default class="c"><joint damping="0.7"/></default></default>
  <worldbody>
    <geom name="base" type="box" size=".1 .1 .1"/>
    <frame pos="0 0 5" childclass="c">
      <body name="b1" pos="0 0 1" quat="0.8 0.6 0 0">
        <joint name="j1" axis="1 0 0" range="-1 1"/>
        <geom type="capsule" size=".05 .25"/>
        <body name="b2" pos="0 0 .5">
          <joint name="j2" axis="0 1 0" class="c"/>
          <geom type="sphere" size=".1"/>
        </body>
      </body>
    </frame>
    <body name="b3" pos="1 0 0"><joint name="j3"/><geom size=".1" mass="2"/></body>
  </worldbody>
  <tendon><fixed name="t"><joint joint="j3" coef="2"/></fixed></tendon>
  <equality><joint joint1="j1" joint2="j2" polycoef="0 1 0 0 0"/></equality>
  <actuator><motor joint="j1" gear="3"/><motor name="m3" joint="j3"/><motor name="mt" tendon="t"/></actuator>
</mujoco>"#;

/// A model in degrees with defaults that the attached model does not have.
fn parent(attach: &str) -> String {
    format!(
        r#"<mujoco model="parent">
  <default><joint damping="9" frictionloss="2"/><geom density="2000"/></default>
  <asset><model name="ch" file="sub/child.xml"/></asset>
  <worldbody>
    <body name="root" pos="0 0 2"><joint name="jr" range="-90 90"/><geom size=".2"/>
      <frame pos="0 0 .3" euler="90 0 0">{attach}</frame>
    </body>
  </worldbody>
</mujoco>"#
    )
}

/// The complete model with what stands in place of the attached one. Angles are in rad.
fn complete(inside: &str, sections: &str) -> String {
    format!(
        r#"<mujoco model="parent">
  <compiler angle="radian"/>
  <worldbody>
    <body name="root" pos="0 0 2">
      <joint name="jr" range="-1.5707963267948966 1.5707963267948966" damping="9" frictionloss="2"/>
      <geom size=".2" density="2000"/>
      <frame pos="0 0 .3" euler="1.5707963267948966 0 0">{inside}</frame>
    </body>
  </worldbody>
  {sections}
</mujoco>"#
    )
}

/// The first two bodies of the attached model at `pos`.
fn bodies(pos: &str) -> String {
    format!(
        r#"<body name="L_b1" pos="{pos}" quat="0.8 0.6 0 0">
          <joint name="L_j1" axis="1 0 0" range="-1 1" damping="0.7"/>
          <geom type="capsule" size=".05 .25" density="500"/>
          <body name="L_b2" pos="0 0 .5">
            <joint name="L_j2" axis="0 1 0" damping="0.7"/>
            <geom type="sphere" size=".1" density="500"/>
          </body>
        </body>"#
    )
}

/// The coupling and the actuator of the first two bodies.
const SECTIONS: &str = r#"<equality><joint joint1="L_j1" joint2="L_j2" polycoef="0 1 0 0 0"/></equality>
  <actuator><motor joint="L_j1" gear="3"/></actuator>"#;

/// The files by their names.
fn read(name: &str) -> Result<String, String> {
    match name {
        "sub/child.xml" => Ok(CHILD.to_owned()),
        // A model that attaches another one.
        "nested.xml" => Ok(parent(r#"<attach model="ch" prefix="L_"/>"#)),
        other => Err(format!("{other} is not there")),
    }
}

/// The model file of a description with other files.
fn imported(text: &str) -> String {
    let whole = expand_other_files(text, &read).unwrap();
    assert_eq!(whole.lines().count(), text.lines().count(), "{whole}");
    let model = import(&whole, &ImportOptions::default()).unwrap().model;
    without_places(&model)
}

/// The model file without comments, which name lines of the description.
fn without_places(model: &str) -> String {
    model
        .lines()
        .map(|line| line.split('#').next().unwrap_or("").trim_end().to_owned() + "\n")
        .collect()
}

/// The model file of a complete description.
fn expected(text: &str) -> String {
    without_places(&import(text, &ImportOptions::default()).unwrap().model)
}

#[test]
fn an_attached_model_keeps_its_own_defaults_and_units() {
    let of_world = r#"<geom name="L_base" type="box" size=".1 .1 .1" density="500"/>"#;
    let third = r#"<body name="L_b3" pos="1 0 0"><joint name="L_j3"/><geom size=".1" mass="2"/></body>"#;
    let framed = format!("<frame pos=\"0 0 5\">{}</frame>", bodies("0 0 1"));
    let sections = r#"<tendon><fixed name="L_t"><joint joint="L_j3" coef="2"/></fixed></tendon>
  <equality><joint joint1="L_j1" joint2="L_j2" polycoef="0 1 0 0 0"/></equality>
  <actuator><motor joint="L_j1" gear="3"/><motor name="L_m3" joint="L_j3"/><motor name="L_mt" tendon="L_t"/></actuator>"#;
    let all = complete(&format!("{of_world}{framed}{third}"), sections);
    assert_eq!(imported(&parent(r#"<attach model="ch" prefix="L_"/>"#)), expected(&all));
}

#[test]
fn a_body_is_attached_without_what_is_around_it() {
    // The frame around the body is left out, but its class counts. The tendon belongs to the third body.
    let one = complete(&bodies("0 0 1"), SECTIONS);
    assert_eq!(
        imported(&parent(r#"<attach model="ch" body="b1" prefix="L_"/>"#)),
        expected(&one)
    );
}

#[test]
fn models_are_attached_twice_and_inside_each_other() {
    // A class of the outer model has the name of one of the attached model.
    let twice = r#"<mujoco model="two"><compiler angle="radian"/>
  <default><default class="x_c"><joint damping="4"/></default></default>
  <asset><model name="ch" file="sub/child.xml"/></asset>
  <worldbody>
    <attach model="ch" body="b2" prefix="x_"/>
    <body name="own" pos="0 1 0"><joint class="x_c" name="jo"/><geom size=".1"/>
      <attach model="ch" body="b2" prefix="y_"/></body>
  </worldbody></mujoco>"#;
    let ball = |name: &str| {
        format!(
            r#"<body name="{name}_b2" pos="0 0 .5"><joint name="{name}_j2" axis="0 1 0" damping="0.7"/>
            <geom type="sphere" size=".1" density="500"/></body>"#
        )
    };
    let by_hand = format!(
        r#"<mujoco model="two"><worldbody>{}<body name="own" pos="0 1 0"><joint damping="4" name="jo"/><geom size=".1"/>{}</body>
        </worldbody></mujoco>"#,
        ball("x"),
        ball("y")
    );
    assert_eq!(imported(twice), expected(&by_hand));

    // Prefixes are put together, and each file keeps its unit of angles.
    let outer = r#"<mujoco model="outer"><compiler angle="radian"/>
  <asset><model name="n" file="nested.xml"/></asset>
  <worldbody><body name="base"><joint name="jb" range="-2 2"/><geom size=".1"/><attach model="n" prefix="A_"/></body></worldbody>
</mujoco>"#;
    let model = imported(outer);
    for name in ["A_jr", "A_L_j1", "A_L_j2", "A_L_j3"] {
        assert!(model.contains(name), "{name} in {model}");
    }
    assert!(model.contains("[-1.5707963267949, 1.5707963267949]"), "{model}");
    assert!(model.contains("[-1.0, 1.0]"), "{model}");
}

#[test]
fn what_cannot_be_attached_is_refused_with_its_place() {
    let fault = |attach: &str| expand_other_files(&parent(attach), &read).unwrap_err();
    for (attach, says) in [
        (
            r#"<attach model="other" prefix=""/>"#,
            "no <model> with the name `other`",
        ),
        (r#"<attach model="ch"/>"#, "needs the attribute `prefix`"),
        (
            r#"<attach body="b" prefix=""/>"#,
            "there is no body `b` before this element",
        ),
        (
            r#"<attach model="ch" body="b9" prefix=""/>"#,
            "`sub/child.xml` has no body `b9`",
        ),
    ] {
        let found = fault(attach);
        assert!(found.starts_with("line 6") && found.contains(says), "{found}");
    }
    // A model that attaches itself.
    let text = r#"<mujoco model="m"><asset><model name="m" file="m.xml"/></asset>
<worldbody><attach model="m" prefix="a"/></worldbody></mujoco>"#;
    let found = expand_other_files(text, &|_| Ok(text.to_owned())).unwrap_err();
    assert!(
        found.starts_with("line 2") && found.contains("`m.xml` attaches itself"),
        "{found}"
    );
    // Text without files.
    let found = import(&parent(r#"<attach model="ch" prefix=""/>"#), &ImportOptions::default());
    let found = found.unwrap_err().to_string();
    assert!(
        found.contains("can only be read if the description is given as a file"),
        "{found}"
    );
}

#[test]
fn classes_of_different_models_never_mix() {
    // Without a prefix both models have a main class and a class `c`.
    let child = r#"<mujoco><default><joint damping=".7"/><default class="c"><joint frictionloss=".1"/></default></default>
        <worldbody><body name="b"><joint name="j"/><joint name="k" axis="1 0 0" class="c"/><geom size=".1"/></body></worldbody></mujoco>"#;
    let text = r#"<mujoco model="two">
  <default><joint frictionloss="2"/><default class="c"><joint damping="5"/></default></default>
  <asset><model name="ch" file="child.xml"/></asset>
  <worldbody><body name="r"><joint name="jr"/><joint name="kr" axis="1 0 0" class="c"/><geom size=".1"/>
    <attach model="ch" prefix=""/></body></worldbody></mujoco>"#;
    let whole = expand_other_files(text, &|_| Ok(child.to_owned())).unwrap();
    let model = import(&whole, &ImportOptions::default()).unwrap().model;
    let by_hand = r#"<mujoco model="two"><worldbody><body name="r">
        <joint name="jr" frictionloss="2"/><joint name="kr" axis="1 0 0" frictionloss="2" damping="5"/><geom size=".1"/>
        <body name="b"><joint name="j" damping=".7"/><joint name="k" axis="1 0 0" damping=".7" frictionloss=".1"/>
        <geom size=".1"/></body></body></worldbody></mujoco>"#;
    assert_eq!(without_places(&model), expected(by_hand));
}

#[test]
fn elements_are_left_out_by_kind_and_name() {
    // The tendon has the name of a body that is not attached, the joint that of a body which is.
    let child = r#"<mujoco><worldbody>
        <body name="t"><joint name="b"/><geom size=".1"/></body>
        <body name="b"><joint name="world"/><geom size=".1"/></body></worldbody>
        <tendon><fixed name="t"><joint joint="world" coef="2"/></fixed></tendon>
        <actuator><motor name="m" tendon="t"/><motor name="n" joint="b"/></actuator></mujoco>"#;
    let text = r#"<mujoco model="one"><asset><model name="ch" file="child.xml"/></asset>
        <worldbody><attach model="ch" body="b" prefix="x_"/></worldbody></mujoco>"#;
    let whole = expand_other_files(text, &|_| Ok(child.to_owned())).unwrap();
    let model = import(&whole, &ImportOptions::default()).unwrap().model;
    let by_hand = r#"<mujoco model="one"><worldbody><body name="x_b"><joint name="x_world"/><geom size=".1"/></body></worldbody>
        <tendon><fixed name="x_t"><joint joint="x_world" coef="2"/></fixed></tendon>
        <actuator><motor name="x_m" tendon="x_t"/></actuator></mujoco>"#;
    assert_eq!(without_places(&model), expected(by_hand));
}

#[test]
fn files_are_relative_to_the_file_that_names_them() {
    // The main file includes `s/assets.xml`, whose model is `s/m.xml`, which attaches `s/deep/c.xml` with a mesh.
    let body = r#"<body name="b"><joint/><geom type="mesh" mesh="q"/></body>"#;
    let files = |name: &str| match name {
        "s/assets.xml" => Ok("<mujoco><asset><model name=\"m\" file=\"m.xml\"/></asset></mujoco>".to_owned()),
        "s/m.xml" => Ok("<mujoco><compiler meshdir=\"no\" strippath=\"true\"/>\
                         <asset><model name=\"c\" file=\"deep/c.xml\"/></asset>\
                         <worldbody><attach model=\"c\" prefix=\"\"/></worldbody></mujoco>"
            .to_owned()),
        "s/deep/c.xml" => Ok(format!(
            "<mujoco><compiler meshdir=\"shapes\"/><asset><mesh file=\"parts/q.obj\"/></asset><worldbody>{body}</worldbody></mujoco>"
        )),
        other => Err(format!("{other} is not there")),
    };
    let text = r#"<mujoco><include file="s/assets.xml"/><worldbody><attach model="m" prefix=""/></worldbody></mujoco>"#;
    let whole = expand_other_files(text, &files).unwrap();
    let asked = RefCell::new(Vec::new());
    let read_mesh = |name: &str| {
        asked.borrow_mut().push(name.to_owned());
        Err("no meshes here".to_owned())
    };
    let options = ImportOptions {
        meshes: Some(MeshFiles(&read_mesh)),
        ..ImportOptions::default()
    };
    let fault = import(&whole, &options).unwrap_err().to_string();
    assert!(fault.contains("no meshes here"), "{fault}");
    assert_eq!(asked.into_inner(), ["s/deep/shapes/parts/q.obj"]);
}

#[test]
fn nested_models_have_a_limit() {
    // Each file attaches the next one twice, under two names.
    let files = |name: &str| {
        let next: usize = name.trim_end_matches(".xml").parse::<usize>().expect("a number") + 1;
        let attach = |k: usize| format!("<attach model=\"m{k}\" prefix=\"{k}\"/>");
        let model = |k: usize| format!("<model name=\"m{k}\" file=\"{next}.xml\"/>");
        Ok(format!(
            "<mujoco><asset>{}{}</asset><worldbody><body name=\"b\">{}{}</body></worldbody></mujoco>",
            model(1),
            model(2),
            if next < 19 { attach(1) } else { String::new() },
            if next < 19 { attach(2) } else { String::new() },
        ))
    };
    let main = files("0.xml").unwrap();
    let fault = expand_other_files(&main, &files).unwrap_err();
    assert!(fault.contains("more than") || fault.contains("too large"), "{fault}");
}
