//! What an importer of MJCF says beside the model it makes.

use modelmill_reduction::{ImportOptions, MeshFiles, import};

use crate::lines;

/// A bar on a hinge about y, and what stands inside.
fn bar(name: &str, pos: &str, inside: &str) -> String {
    format!(
        "<body name=\"{name}\" pos=\"{pos}\"><joint name=\"{name}_turn\" axis=\"0 1 0\"/>\
         <inertial mass=\"1\" pos=\"0.1 0 0\" diaginertia=\"0.01 0.02 0.02\"/>{inside}</body>"
    )
}

fn remarks(options: &str, bodies: &str, equality: &str) -> String {
    let text = format!(
        "<mujoco model=\"bars\">{options}<worldbody>{bodies}</worldbody><equality>{equality}</equality></mujoco>"
    );
    lines(&import(&text, &ImportOptions::default()).unwrap().remarks)
}

/// A four-bar linkage in a plane, closed by its fourth hinge: two conditions, which are independent; or by a last body that is
/// welded to the ground, of whose conditions some follow from others.
#[test]
fn conditions_that_follow_from_others_are_said() {
    let weld = bar("last", "0 0 -2", "");
    let rocker = bar("rocker", "3 0 1", &weld);
    let chain = bar("crank", "0 0 0", &bar("coupler", "0 0 1", &rocker));
    let welded = remarks("", &chain, "<weld body1=\"last\"/>");
    assert!(welded.contains("conditions of its loops 3 are independent"), "{welded}");
    let rocker = bar("rocker", "3 0 1", "");
    let chain = bar("crank", "0 0 0", &bar("coupler", "0 0 1", &rocker));
    let hinged = remarks("", &chain, "<connect body1=\"rocker\" anchor=\"0 0 -2\"/>");
    assert!(!hinged.contains("independent"), "{hinged}");
}

#[test]
fn options_that_change_forces_are_said() {
    let one = bar("bar", "0 0 0", "");
    let plain = remarks("", &one, "");
    let calm = remarks("<option density=\"0\"/>", &one, "");
    assert_eq!(plain, calm);
    let without = remarks("<option><flag gravity=\"disable\"/></option>", &one, "");
    assert!(without.contains("disables gravity"), "{without}");
    let wet = remarks("<option viscosity=\"0.1\"/>", &one, "");
    assert!(wet.contains("`viscosity`"), "{wet}");
}

/// A bar that a tendon lifts, with what else pulls.
fn pulled(tendon: &str, actuators: &str) -> Result<modelmill_reduction::DescriptionImport, String> {
    let inside = "<site name=\"tip\" pos=\"0.3 0 0\"/>";
    let one = bar("bar", "0 0 0", inside);
    let text = format!(
        "<mujoco model=\"bars\"><worldbody><site name=\"top\" pos=\"0 0 0.5\"/><site name=\"side\" pos=\"0 0.1 0.2\"/>{one}</worldbody>\
         <tendon><spatial name=\"rope\"{tendon}</spatial></tendon><actuator>{actuators}</actuator></mujoco>"
    );
    import(&text, &ImportOptions::default()).map_err(|error| error.to_string())
}

#[test]
fn straight_tendons_are_drives_between_points() {
    const STRAIGHT: &str = " damping=\"2\" armature=\"0.5\" stiffness=\"3\"><site site=\"top\"/><site site=\"tip\"/>";
    let one = "<motor name=\"lift\" tendon=\"rope\" gear=\"-2\" ctrlrange=\"-1 4\"/>";
    let imported = pulled(STRAIGHT, one).unwrap();
    let model = imported.model;
    assert!(
        model.contains("linear = { from = \"lift_from\", to = \"lift_to\" }"),
        "{model}"
    );
    assert!(model.contains("lift = { force = [-8.0, 2.0] }"), "{model}");
    // It drives the only joint, which needs no drive by hand and is none that nothing drives.
    assert!(
        !model.contains("driven = false") && !model.contains("joint = \"bar_turn\""),
        "{model}"
    );
    assert!(
        model.contains("viscous_friction") && model.contains("drive_inertia"),
        "{model}"
    );
    let remarks = lines(&imported.remarks);
    assert!(remarks.contains("stiffness of this tendon"), "{remarks}");
    assert!(!remarks.contains("damping"), "{remarks}");
    // A joint with a motor and a rope besides has more drives than freedoms.
    let both = pulled(STRAIGHT, &format!("{one}<motor name=\"turn\" joint=\"bar_turn\"/>")).unwrap();
    assert_eq!(both.model.matches("[[drive]]").count(), 2, "{}", both.model);
}

#[test]
fn tendons_that_bend_are_said() {
    let bent = "><site site=\"top\"/><site site=\"side\"/><site site=\"tip\"/>";
    let imported = pulled(bent, "<motor tendon=\"rope\"/><motor joint=\"bar_turn\"/>").unwrap();
    let remarks = lines(&imported.remarks);
    assert!(
        remarks.contains("is not a straight line between two sites"),
        "{remarks}"
    );
    assert_eq!(imported.model.matches("[[drive]]").count(), 1);
    let missing = pulled("><site site=\"top\"/><site site=\"tap\"/>", "<motor tendon=\"rope\"/>");
    let error = missing.unwrap_err();
    assert!(error.contains("line") && error.contains("`tap`"), "{error}");
}

/// The nominal values of a body's part that are not zero, as they stand in a model file.
fn part(model: &str, body: &str) -> String {
    let from = model.find(&format!("name = \"{body}_body\"")).unwrap();
    let values = model[from..].split("nominal = {").nth(1).unwrap();
    let values = values.split('}').next().unwrap().trim().split(", ");
    values
        .filter(|value| !value.ends_with("= 0.0"))
        .collect::<Vec<_>>()
        .join(", ")
}

#[test]
fn masses_are_as_the_compiler_says() {
    let model = |compiler: &str| {
        let text = format!(
            "<mujoco model=\"two\"><compiler {compiler}/><worldbody>\
             <body name=\"one\"><joint axis=\"0 1 0\"/><inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 2 4\"/>\
             <body name=\"two\"><joint axis=\"0 1 0\"/><geom type=\"box\" size=\"0.5 0.5 0.5\" mass=\"2\"/>\
             <geom type=\"box\" size=\"0.5 0.5 0.5\" mass=\"1\" group=\"3\"/></body></body>\
             </worldbody></mujoco>"
        );
        import(&text, &ImportOptions::default()).unwrap().model
    };
    let plain = model("");
    assert_eq!(part(&plain, "one"), "XX = 1.0, YY = 2.0, ZZ = 4.0, M = 1.0");
    assert_eq!(part(&plain, "two"), "XX = 0.5, YY = 0.5, ZZ = 0.5, M = 3.0");
    let outer = model("inertiagrouprange=\"0 2\"");
    assert!(part(&outer, "two").ends_with("M = 2.0"), "{outer}");
    let heavy = model("settotalmass=\"8\"");
    assert_eq!(part(&heavy, "one"), "XX = 2.0, YY = 4.0, ZZ = 8.0, M = 2.0");
    assert_eq!(part(&heavy, "two"), "XX = 1.0, YY = 1.0, ZZ = 1.0, M = 6.0");
    let even = model("balanceinertia=\"true\"");
    let third = "2.33333333333333";
    assert_eq!(
        part(&even, "one"),
        format!("XX = {third}, YY = {third}, ZZ = {third}, M = 1.0")
    );
    assert_eq!(part(&even, "two"), part(&plain, "two"));
    assert!(model("settotalmass=\"-1\"") == plain);
}

/// Joints on a fixed tendon of constant length follow each other: `2*one - other` stays as it is.
#[test]
fn fixed_tendons_of_constant_length_couple_joints() {
    let bodies = bar("one", "0 0 0", &bar("other", "0 0 1", &bar("third", "0 0 1", "")));
    let text = |joints: &str, equality: &str| {
        format!(
            "<mujoco model=\"bars\"><worldbody>{bodies}</worldbody>\
             <tendon><fixed name=\"rope\">{joints}</fixed><fixed name=\"twin\"><joint joint=\"third_turn\" coef=\"1\"/></fixed></tendon>\
             <equality><tendon tendon1=\"rope\" {equality}/></equality></mujoco>"
        )
    };
    let of = |joint: &str, coef: &str| format!("<joint joint=\"{joint}_turn\" coef=\"{coef}\"/>");
    let two = of("one", "2") + &of("other", "-1");
    let imported = import(&text(&two, ""), &ImportOptions::default()).unwrap();
    let joint = |name: &str| imported.joints.iter().find(|joint| joint.name == name).unwrap();
    let (one, other) = (joint("one_turn"), joint("other_turn"));
    assert_eq!(one.coordinates, other.coordinates);
    let near = |found: f64, expected: f64| (found - expected).abs() < 1e-15;
    assert!(near(one.ratio, 1.0) && near(one.offset, 0.0), "{one:?}");
    assert!(near(other.ratio, 2.0) && near(other.offset, 0.0), "{other:?}");
    // A tendon that follows another one has the joints of both.
    let single = text(&of("one", "2"), "tendon2=\"twin\" polycoef=\"0 4\"");
    let imported = import(&single, &ImportOptions::default()).unwrap();
    let third = imported.joints.iter().find(|joint| joint.name == "third_turn").unwrap();
    assert!(
        third.coordinates[0].starts_with("third") || !near(third.ratio, 1.0),
        "{third:?}"
    );
    let fault = |text: String| import(&text, &ImportOptions::default()).unwrap_err().to_string();
    let three = fault(text(&(two + &of("third", "1")), ""));
    assert!(three.contains("couples 3 joints"), "{three}");
}

#[test]
fn included_files_stand_in_their_place() {
    let main = "<mujoco model=\"bars\">\n<include file=\"more/defaults.xml\"/>\n<worldbody>\n<include file=\"bar.xml\"/>\n\
                <body name=\"odd\"><joint type=\"screw\"/></body></worldbody></mujoco>";
    let read = |name: &str| match name {
        "more/defaults.xml" => {
            Ok("<mujocoinclude>\n<default>\n<joint axis=\"1 0 0\"/></default></mujocoinclude>".to_owned())
        }
        // The name of the next file is relative to this one's folder, as MuJoCo 4 reads it if no other file has the name.
        "deep/bar.xml" => Ok("<mujoco><!-- a -- b --><include file=\"parts/inner.xml\"/></mujoco>".to_owned()),
        "bar.xml" | "deep/parts/inner.xml" => Ok(format!("<mujoco>\n{}\n</mujoco>", bar("bar", "0 0 0", ""))),
        other => Err(format!("{other} is not there")),
    };
    let whole = modelmill_reduction::expand_other_files(main, &read).unwrap();
    // Places of the main file stay.
    let fault = import(&whole, &ImportOptions::default()).unwrap_err().to_string();
    assert!(fault.starts_with("line 5"), "{fault}");
    let sound = whole.replace("<joint type=\"screw\"/>", "");
    let model = import(&sound, &ImportOptions::default()).unwrap().model;
    assert!(model.contains("name = \"bar\""), "{model}");
    let deep = main.replace("bar.xml", "deep/bar.xml");
    assert_eq!(modelmill_reduction::expand_other_files(&deep, &read).unwrap(), whole);
    let lost = main.replace("bar.xml", "bare.xml");
    let fault = modelmill_reduction::expand_other_files(&lost, &read).unwrap_err();
    assert!(
        fault.contains("line 4") && fault.contains("bare.xml is not there"),
        "{fault}"
    );
    let twice = main.replace("more/defaults.xml", "bar.xml");
    let fault = modelmill_reduction::expand_other_files(&twice, &read).unwrap_err();
    assert!(fault.contains("included twice"), "{fault}");
}

/// A body on a hinge whose mass is that of a mesh: the outline of an L, as corners and triangles.
fn letter(mesh: &str, geom: &str) -> String {
    format!(
        "<mujoco model=\"letter\"><compiler meshdir=\"shapes\" strippath=\"true\"/>\
         <default><mesh scale=\"-2 1 3\"/></default>\
         <asset>{mesh}</asset>\
         <worldbody><body name=\"foot\"><geom type=\"mesh\" mesh=\"lost\"/><body name=\"letter\">\
         <joint name=\"turn\" axis=\"0 1 0\"/>{geom}</body></body></worldbody></mujoco>"
    )
}

/// Mass and first moments of the body, and an entry of its inertia, are those that MuJoCo 4.0.0 compiles: 1200 kg with the
/// centre of mass at (-1.01215631, 0.02484649, 1.57833465) m.
#[test]
fn masses_of_meshes_are_those_of_mujoco() {
    let corners = "0 0 0 2 0 0 2 1 0 1 1 0 1 3 0 0 3 0 0 0 .5 2 0 .5 2 1 .5 1 1 .5 1 3 .5 0 3 .5";
    let triangles = "0 2 1 6 7 8 0 3 2 6 8 9 0 4 3 6 9 10 0 5 4 6 10 11 0 1 7 0 7 6 1 2 8 1 8 7 2 3 9 2 9 8 3 4 10 3 10 9 \
                     4 5 11 4 11 10 5 0 6 5 6 11";
    let more = "inertia=\"exact\" refpos=\"0.1 0.2 0.3\" refquat=\"0.8 0.2 0.5 0.1\"";
    let geom = "<geom type=\"mesh\" mesh=\"m\" density=\"100\" pos=\".3 .2 .1\" euler=\"10 20 30\"/>";
    let inline = format!("<mesh name=\"m\" vertex=\"{corners}\" face=\"{triangles}\" {more}/>");
    // The mesh of the fixed body does not exist, and needs none.
    let model = import(&letter(&inline, geom), &ImportOptions::default()).unwrap().model;
    let value = |key: &str| -> f64 {
        let at = model
            .find(&format!("{key} = "))
            .unwrap_or_else(|| panic!("no {key} in {model}"))
            + key.len()
            + 3;
        let number: String = model[at..]
            .chars()
            .take_while(|c| "0123456789.-e".contains(*c))
            .collect();
        number.parse().unwrap()
    };
    assert!((value(" M") - 1200.0).abs() < 1e-6, "{model}");
    for (key, centre) in [("MX", -1.012_156_31), ("MY", 0.024_846_49), ("MZ", 1.578_334_65)] {
        assert!((value(key) / 1200.0 - centre).abs() < 1e-7, "{key}: {model}");
    }
    // The trace of the inertia does not depend on the axes; Steiner's part is 2 m |c|^2.
    let trace = 4_893.939_464_96 + 4_093.670_427_66 + 929.411_383_98;
    let steiner = 2.0 * 1200.0 * (1.012_156_31f64.powi(2) + 0.024_846_49f64.powi(2) + 1.578_334_65f64.powi(2));
    let sum = value("XX") + value("YY") + value("ZZ");
    assert!((sum / (trace + steiner) - 1.0).abs() < 1e-7, "{sum}: {model}");

    // The same from a file, whose path is cut down to its name.
    let triples = |text: &str, tag: &str, add: f64| -> String {
        let all: Vec<f64> = text
            .split_whitespace()
            .map(|word| word.parse::<f64>().unwrap() + add)
            .collect();
        let lines = all.chunks(3).map(|c| format!("{tag} {} {} {}", c[0], c[1], c[2]));
        lines.collect::<Vec<_>>().join("\n") + "\n"
    };
    let obj = triples(corners, "v", 0.0) + &triples(triangles, "f", 1.0);
    let read = |path: &str| match path {
        "shapes/m.obj" => Ok(obj.clone().into_bytes()),
        other => Err(format!("{other} is not there")),
    };
    let options = ImportOptions {
        meshes: Some(MeshFiles(&read)),
        ..ImportOptions::default()
    };
    let from_file = import(
        &letter(&format!("<mesh file=\"far/away/m.obj\" {more}/>"), geom),
        &options,
    )
    .unwrap();
    assert_eq!(from_file.model, model);

    // What is not computed is stated with its place.
    let fault = |mesh: &str, geom: &str| import(&letter(mesh, geom), &options).unwrap_err().to_string();
    assert!(fault("<mesh name=\"m\" file=\"n.obj\"/>", geom).contains("shapes/n.obj is not there"));
    assert!(fault("<mesh file=\"m.obj\" inertia=\"convex\"/>", geom).contains("convex hull of a mesh"));
    assert!(fault("<mesh name=\"m\" vertex=\"0 0 0\"/>", geom).contains("convex hull of points"));
    assert!(fault("<mesh name=\"m\" builtin=\"sphere\"/>", geom).contains("built-in mesh"));
    assert!(fault("<mesh file=\"m.obj\" inertia=\"thick\"/>", geom).contains("no inertia `thick`"));
    assert!(fault("", geom).contains("no mesh `m`"));
    let fitted = fault("<mesh file=\"m.obj\"/>", "<geom type=\"box\" mesh=\"m\"/>");
    assert!(fitted.contains("a box that is fitted to a mesh"), "{fitted}");
    let file = letter("<mesh file=\"m.obj\"/>", geom);
    let without = import(&file, &ImportOptions::default()).unwrap_err().to_string();
    assert!(without.contains("given as a file"), "{without}");
}
