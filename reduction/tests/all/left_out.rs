//! One feature of a format at a time: its effect is in the model, or a remark names it. Found by random descriptions
//! (`lab/random-descriptions`), and compared here with sums by hand or with another notation of the same mechanism.

use modelmill_reduction::{ImportOptions, import};

use crate::extensions::{derived, force, imported};
use crate::lines;

/// Inertia and damping of the first joint: differences of forces for one unit of acceleration and of rate.
fn inertia_and_damping(text: &str) -> [f64; 2] {
    let derivation = derived(&imported(text));
    let [still, fast, accelerated] =
        [[0.3, 0.0, 0.0], [0.3, 1.0, 0.0], [0.3, 0.0, 1.0]].map(|state| force(&derivation, state).1);
    [accelerated - still, fast - still]
}

fn assert_close(found: [f64; 2], expected: [f64; 2], text: &str) {
    for (one, other) in found.into_iter().zip(expected) {
        assert!((one - other).abs() < 1e-12, "{found:?}, not {expected:?}\n{text}");
    }
}

/// Two arms on hinges about y, side by side: 0.01 kg m^2 about the joint each.
fn two_arms(head: &str, [first, second]: [&str; 2], tail: &str) -> String {
    let arm = |name: &str, joint: &str| {
        format!(
            "<body name=\"{name}\"><joint name=\"{name}_turn\" axis=\"0 1 0\" {joint}/>\
             <inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"0.01 0.01 0.01\"/></body>"
        )
    };
    let bodies = arm("a", first) + &arm("b", second);
    format!("<mujoco>{head}<worldbody>{bodies}</worldbody>{tail}</mujoco>")
}

#[test]
fn later_sections_of_defaults_add_to_the_main_class() {
    let sections = "<default><joint damping=\"0.2\"/><default class=\"old\"><joint armature=\"0.1\"/></default></default>\
                    <default><joint damping=\"0.5\" armature=\"0.3\"/><default class=\"new\"/></default>";
    for (joint, expected) in [
        ("", [0.31, 0.5]),
        ("class=\"new\"", [0.31, 0.5]),
        // A class keeps what the main class was at its place.
        ("class=\"old\"", [0.11, 0.2]),
        ("class=\"main\"", [0.31, 0.5]),
    ] {
        let text = two_arms(sections, [joint, ""], "");
        assert_close(inertia_and_damping(&text), expected, &text);
    }
}

#[test]
fn all_kinds_of_actuators_share_defaults() {
    for default in ["general", "motor", "position", "damper"] {
        for kind in ["motor", "general", "velocity"] {
            let head = format!("<default><{default} armature=\"0.1\" damping=\"0.02\" gear=\"3\"/></default>");
            let tail =
                format!("<actuator><{kind} joint=\"a_turn\"/><{kind} joint=\"b_turn\" armature=\"0\"/></actuator>");
            let text = two_arms(&head, ["", ""], &tail);
            assert_close(inertia_and_damping(&text), [0.91, 0.18], &text);
        }
    }
}

#[test]
fn equalities_and_tendons_have_defaults() {
    let coupled = "<equality><joint joint1=\"b_turn\" joint2=\"a_turn\"/></equality>";
    let off = "<default><equality active=\"false\"/></default>";
    for (head, n) in [("", 1), (off, 2)] {
        let derivation = derived(&imported(&two_arms(head, ["", ""], coupled)));
        assert_eq!(derivation.mechanism.coordinates.len(), n, "{head}");
    }
    let fixed = "<tendon><fixed name=\"rope\"><joint joint=\"a_turn\" coef=\"1\"/><joint joint=\"b_turn\" coef=\"2\"/></fixed></tendon>";
    for key in [
        "damping",
        "stiffness",
        "frictionloss",
        "armature",
        "range",
        "actuatorfrcrange",
    ] {
        let value = if key.ends_with("range") { "-1 1" } else { "0.4" };
        let head = format!("<default><tendon {key}=\"{value}\"/></default>");
        let named = lines(&imported(&two_arms(&head, ["", ""], fixed)).remarks);
        let word = if key == "actuatorfrcrange" { "force limit" } else { key };
        assert!(named.contains(&format!("{word} of this tendon")), "{key}: {named}");
    }
    let calm = lines(&imported(&two_arms("", ["", ""], fixed)).remarks);
    assert!(!calm.contains("tendon"), "{calm}");
}

#[test]
fn losses_of_free_joints_are_named() {
    for key in ["damping", "frictionloss", "armature", "stiffness"] {
        for (head, joint) in [
            (String::new(), format!("type=\"free\" {key}=\"0.4\"")),
            (
                format!("<default><joint {key}=\"0.4\"/></default>"),
                "type=\"free\"".to_owned(),
            ),
        ] {
            let named = lines(&imported(&two_arms(&head, [&joint, ""], "")).remarks);
            assert!(
                named.contains("of the free joint `a_turn` are left out"),
                "{key}: {named}"
            );
        }
    }
}

/// An arm with what gives it mass.
fn arm_with(inside: &str) -> String {
    let text = format!(
        "<mujoco><worldbody><body name=\"a\"><joint name=\"turn\" axis=\"0 1 0\"/>{inside}</body></worldbody></mujoco>"
    );
    imported(&text).model
}

#[test]
fn other_notations_of_a_mass_are_equal() {
    // A mass inside of a frame.
    let plain = "<inertial pos=\"0.3 0 0.1\" mass=\"2\" diaginertia=\"0.03 0.02 0.04\"/>";
    let framed = "<frame pos=\"0.1 0 0.1\"><frame pos=\"0.2 0 0\"><inertial pos=\"0 0 0\" mass=\"2\" \
                  diaginertia=\"0.03 0.02 0.04\"/></frame></frame>";
    assert_eq!(arm_with(plain), arm_with(framed));
    // An ellipsoid between two points.
    let sized = "<geom type=\"ellipsoid\" size=\"0.1 0.1 0.25\" pos=\"0.3 0 0.15\"/>";
    let between = "<geom type=\"ellipsoid\" size=\"0.1\" fromto=\"0.3 0 -0.1 0.3 0 0.4\"/>";
    assert_eq!(arm_with(sized), arm_with(between));
}

/// The position of `relpose` is that of the anchor in the first body (`MuJoCo`, engine of equality constraints), so that a
/// weld of two sites with these poses is the same.
#[test]
fn a_weld_with_a_relative_pose_connects_the_anchor() {
    let welded = |weld: &str| {
        let link = |name: &str, inside: &str| {
            format!(
                "<body name=\"{name}\" pos=\"0.4 0 0\" euler=\"0 40 0\"><joint name=\"{name}_turn\" axis=\"0 1 0\"/>\
                 <inertial pos=\"0.1 0 0\" mass=\"1\" diaginertia=\"0.01 0.02 0.02\"/>{inside}</body>"
            )
        };
        let chain = link("c", &link("d", "<site name=\"tip\" pos=\"0.1 0 0.05\"/>"));
        let all = link(
            "a",
            &(link("b", &chain) + "<site name=\"foot\" pos=\"-0.05 0 0.2\" quat=\"0.9 0 0.2 0\"/>"),
        );
        imported(&format!(
            "<mujoco><worldbody>{all}</worldbody><equality><weld name=\"w\" {weld}/></equality></mujoco>"
        ))
        .model
    };
    let sites = welded("site1=\"foot\" site2=\"tip\"");
    assert!(sites.contains("passive"), "{sites}");
    let bodies = welded("body1=\"a\" body2=\"d\" anchor=\"0.1 0 0.05\" relpose=\"-0.05 0 0.2 0.9 0 0.2 0\"");
    assert_eq!(sites, bodies);
}

#[test]
fn names_of_the_description_are_no_words_of_expressions() {
    for name in ["t", "pi", "sin", "rate", "base", "M_b", "XX_a"] {
        let text = two_arms("", ["", ""], "").replace("a_turn", name);
        let result = import(&text, &ImportOptions::default());
        assert!(result.is_ok(), "{name}: {}", result.unwrap_err());
    }
}

/// An arm in an SDF of some version, turned by half a right angle.
fn sdf_arm(version: &str, joint: &str) -> String {
    format!(
        "<sdf version=\"{version}\"><model name=\"m\"><link name=\"arm\"><pose>0 0 0 0.7 0.2 0</pose><inertial>\
         <pose>0.3 0 0.1 0 0 0</pose><mass>1</mass></inertial></link><joint name=\"turn\" type=\"revolute\">\
         <parent>world</parent><child>arm</child><axis><xyz>0 1 0</xyz>{joint}</axis></joint></model></sdf>"
    )
}

#[test]
fn versions_of_sdf_are_no_decimals() {
    let model = |version: &str| imported(&sdf_arm(version, "")).model;
    let newest = model("1.12");
    for version in ["1.5", "1.7", "1.9", "1.10", "1.11"] {
        assert_eq!(model(version), newest, "{version}");
    }
    // Until 1.4 the axis is given in the axes of the model.
    assert_ne!(model("1.4"), newest);
    let in_model = imported(&sdf_arm("1.12", "").replace("<xyz>", "<xyz expressed_in=\"__model__\">")).model;
    assert_eq!(model("1.4"), in_model);
}

#[test]
fn limits_and_losses_that_find_no_place_are_named() {
    let one_side = sdf_arm("1.12", "<limit><lower>-1</lower></limit>");
    let both = sdf_arm("1.12", "<limit><lower>-1</lower><upper>1</upper></limit>");
    assert!(lines(&imported(&one_side).remarks).contains("on one side only"));
    assert!(!lines(&imported(&both).remarks).contains("side"));
    let ball = sdf_arm("1.12", "<dynamics><damping>0.4</damping></dynamics>").replace("revolute", "ball");
    let named = lines(&imported(&ball).remarks);
    assert!(named.contains("of the ball joint `turn` are left out"), "{named}");
    // A joint that follows another has no drive of its own.
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" \
             ixz=\"0\" iyz=\"0\"/></inertial></link>"
        )
    };
    let joint = |name: &str, child: &str, more: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"base\"/><child link=\"{child}\"/><axis xyz=\"0 1 0\"/>\
             <limit lower=\"-1\" upper=\"1\" effort=\"5\" velocity=\"2\"/>{more}</joint>"
        )
    };
    let links = ["base", "a", "b"].map(link).concat();
    let joints = joint("j1", "a", "") + &joint("j2", "b", "<mimic joint=\"j1\" multiplier=\"-2\"/>");
    let urdf = format!("<robot name=\"r\">{links}{joints}</robot>");
    let named = lines(&imported(&urdf).remarks);
    assert!(
        named.contains("the force limit of `j2`, which follows `j1`, is left out"),
        "{named}"
    );
    // A file of closures that gives a hinge another motion.
    let options = ImportOptions {
        closures: Some("joint_name: [j2]\njoint_type: [UJOINT_XY]\n"),
        ..ImportOptions::default()
    };
    let plain = format!(
        "<robot name=\"r\">{links}{}</robot>",
        joint("j1", "a", "") + &joint("j2", "b", "")
    );
    let named = lines(&import(&plain, &options).expect("an import").remarks);
    assert!(named.contains("the limits of `j2` are left out"), "{named}");
}

/// The force limits of the drive at a joint or along a tendon, as the model file states them.
fn force_limits(model: &str, drive: &str) -> Option<String> {
    let table = model.split("[limits.drives]").nth(1)?;
    let entry = table.lines().find(|line| line.starts_with(&format!("{drive} = ")))?;
    Some(entry.split("force = ").nth(1)?.trim_end_matches(" }").to_owned())
}

/// `MuJoCo` clamps the force of each actuator, and then the sum of all at one joint. At tendons it clamps the sum before
/// the gears.
#[test]
fn limits_of_actuators_and_of_their_joint_both_apply() {
    for (joint, actuators, expected) in [
        (
            "-10 10",
            "<motor joint=\"a_turn\" forcerange=\"-1 1\"/>",
            Some("[-1.0, 1.0]"),
        ),
        (
            "-2 10",
            "<motor joint=\"a_turn\" forcerange=\"-3 4\" gear=\"2\"/>",
            Some("[-2.0, 8.0]"),
        ),
        (
            "-2 10",
            "<motor joint=\"a_turn\" forcerange=\"-3 4\" ctrlrange=\"-0.5 9\"/>",
            Some("[-0.5, 4.0]"),
        ),
        // A general actuator is a motor with a gain, if its force is a multiple of its control.
        (
            "-10 10",
            "<general joint=\"a_turn\" ctrlrange=\"-2 3\" gainprm=\"-4\"/>",
            Some("[-10.0, 8.0]"),
        ),
        (
            "-99 99",
            "<general joint=\"a_turn\" ctrlrange=\"-2 3\" gainprm=\"4 0 0\" dyntype=\"filter\" gear=\"2\"/>",
            Some("[-16.0, 24.0]"),
        ),
        (
            "-99 99",
            "<general joint=\"a_turn\" ctrlrange=\"-2 3\" biastype=\"affine\"/>",
            Some("[-99.0, 99.0]"),
        ),
        (
            "-9 9",
            "<motor joint=\"a_turn\" forcerange=\"-3 4\"/><motor joint=\"a_turn\" forcerange=\"-1 3\" gear=\"-1\"/>",
            Some("[-6.0, 5.0]"),
        ),
        (
            "-9 9",
            "<motor joint=\"a_turn\" forcerange=\"-3 4\"/><motor joint=\"a_turn\"/>",
            Some("[-9.0, 9.0]"),
        ),
        ("0 0", "<motor joint=\"a_turn\"/>", None),
        ("-1 1", "<motor joint=\"a_turn\" forcerange=\"2 4\"/>", None),
    ] {
        let text = two_arms(
            "",
            [&format!("actuatorfrcrange=\"{joint}\""), ""],
            &format!("<actuator>{actuators}<motor joint=\"b_turn\"/></actuator>"),
        );
        let result = imported(&text);
        let limits = force_limits(&result.model, "a_turn_drive");
        assert_eq!(limits.as_deref(), expected, "{text}");
        let is_named = lines(&result.remarks).contains("leave only the force 1; they are left out");
        assert_eq!(is_named, joint == "-1 1", "{text}");
    }
    let line = "<site name=\"s\" pos=\"1 0 0\"/><body name=\"a\"><joint name=\"slide\" type=\"slide\" axis=\"1 0 0\"/>\
                <inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"0.01 0.01 0.01\"/><site name=\"e\"/></body>";
    for (tendon, actuators, expected, is_named) in [
        (
            "-10 10",
            "<motor name=\"m\" tendon=\"t\" forcerange=\"-1 1\"/>",
            Some("[-1.0, 1.0]"),
            false,
        ),
        (
            "-10 10",
            "<motor name=\"m\" tendon=\"t\" gear=\"2\"/>",
            Some("[-20.0, 20.0]"),
            false,
        ),
        (
            "-10 10",
            "<motor name=\"m\" tendon=\"t\" gear=\"-2\" forcerange=\"-1 30\"/>",
            Some("[-20.0, 2.0]"),
            false,
        ),
        (
            "-10 10",
            "<motor name=\"m\" tendon=\"t\"/><motor name=\"n\" tendon=\"t\"/>",
            None,
            true,
        ),
    ] {
        let text = format!(
            "<mujoco><worldbody>{line}</worldbody><tendon><spatial name=\"t\" actuatorfrcrange=\"{tendon}\"><site site=\"s\"/>\
             <site site=\"e\"/></spatial></tendon><actuator>{actuators}</actuator></mujoco>"
        );
        let result = imported(&text);
        assert_eq!(force_limits(&result.model, "m").as_deref(), expected, "{text}");
        assert_eq!(
            lines(&result.remarks).contains("without force limits"),
            is_named,
            "{text}"
        );
    }
}

#[test]
fn equal_and_exchanged_limits_are_named() {
    let with_limits = |lower: &str, upper: &str| {
        let limit = format!("<limit><lower>{lower}</lower><upper>{upper}</upper></limit>");
        sdf_arm("1.12", &limit)
    };
    let named = |lower: &str, upper: &str| lines(&imported(&with_limits(lower, upper)).remarks);
    let equal = named("0.3", "0.3");
    assert!(
        equal.contains("both limits of `turn` are 0.3") && equal.contains("lock it at 0.3"),
        "{equal}"
    );
    let exchanged = named("1", "-1");
    assert!(
        exchanged.contains("the lower limit of `turn`, 1, is above its upper limit, -1"),
        "{exchanged}"
    );
    assert!(!named("-1", "1").contains("limit"));
    // The same in URDF.
    let link = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    for (limits, remark) in [
        ("lower=\"0.3\" upper=\"0.3\"", "both limits of `turn` are 0.3"),
        (
            "lower=\"1\" upper=\"-1\"",
            "the lower limit of `turn`, 1, is above its upper limit, -1",
        ),
    ] {
        let urdf = format!(
            "<robot name=\"r\"><link name=\"base\"/><link name=\"a\">{link}</link><joint name=\"turn\" type=\"revolute\">\
             <parent link=\"base\"/><child link=\"a\"/><axis xyz=\"0 1 0\"/><limit {limits} effort=\"5\" velocity=\"2\"/></joint></robot>"
        );
        let named = lines(&imported(&urdf).remarks);
        assert!(named.contains(remark), "{named}");
    }
    // A locked joint does not move.
    let locked = [("turn".to_owned(), 0.3)];
    let options = ImportOptions {
        locked: &locked,
        ..ImportOptions::default()
    };
    let two = with_limits("0.3", "0.3").replace(
        "</model>",
        "<link name=\"hand\"/><joint name=\"wrist\" type=\"revolute\"><parent>arm</parent><child>hand</child><axis/></joint></model>",
    );
    let calm = lines(&import(&two, &options).expect("an import").remarks);
    assert!(!calm.contains("both limits"), "{calm}");
}

#[test]
fn an_axis_has_no_meaning_for_a_ball_joint() {
    let ball = |axis: &str, more: &str| {
        let text = sdf_arm("1.12", "").replace("revolute", "ball");
        imported(&text.replace("<axis><xyz>0 1 0</xyz></axis>", &format!("{axis}{more}")))
    };
    let plain = ball("", "");
    assert!(!lines(&plain.remarks).contains("left out"));
    for (axis, more, remark) in [
        ("<axis><xyz>0 0 0</xyz></axis>", "", ""),
        ("<axis><xyz expressed_in=\"nowhere\">0 0 1</xyz></axis>", "", ""),
        (
            "<axis><limit><effort>0</effort></limit></axis>",
            "",
            "the effort of 0 of the ball joint",
        ),
        (
            "<axis><limit><effort>3</effort></limit></axis>",
            "",
            "and limits of the ball joint",
        ),
        (
            "<axis><limit><velocity>3</velocity></limit></axis>",
            "",
            "and limits of the ball joint",
        ),
        (
            "<axis><mimic joint=\"other\"/></axis>",
            "",
            "the coupling of the ball joint",
        ),
        ("", "<rotor_inertia>0.1</rotor_inertia>", "and limits of the ball joint"),
    ] {
        let result = ball(axis, more);
        assert_eq!(result.model, plain.model, "{axis}{more}");
        let named = lines(&result.remarks);
        assert_eq!(named.contains("left out"), !remark.is_empty(), "{axis}{more}: {named}");
        assert!(named.contains(remark), "{axis}{more}: {named}");
    }
}

#[test]
fn limits_of_joints_that_close_a_loop_are_named() {
    for (limit, is_named) in [
        ("", false),
        ("<velocity>2</velocity>", true),
        ("<effort>3</effort>", true),
        ("<lower>-1</lower><upper>1</upper>", true),
    ] {
        // A four-bar linkage whose last hinge closes the loop.
        let link = |name: &str, x: f64, z: f64| {
            format!("<link name=\"{name}\"><pose>{x} 0 {z} 0 0 0</pose><inertial><mass>1</mass></inertial></link>")
        };
        let joint = |name: &str, [parent, child]: [&str; 2], more: &str| {
            format!(
                "<joint name=\"{name}\" type=\"revolute\"><parent>{parent}</parent><child>{child}</child>\
                 <axis><xyz>0 1 0</xyz>{more}</axis></joint>"
            )
        };
        let links = link("a", 0.0, 0.0) + &link("b", 0.1, 0.3) + &link("c", 0.5, 0.0);
        let joints = joint("j1", ["world", "a"], "")
            + &joint("j2", ["a", "b"], "")
            + &joint("j3", ["world", "c"], "")
            + &joint("cut", ["c", "b"], &format!("<limit>{limit}</limit>"));
        let text = format!("<sdf version=\"1.12\"><model name=\"m\">{links}{joints}</model></sdf>");
        let named = lines(&imported(&text).remarks);
        let remark = "rotor and limits of `cut`, which closes a loop, are left out";
        assert_eq!(named.contains(remark), is_named, "{limit}: {named}");
    }
}

#[test]
fn bodies_have_different_symbols() {
    let arm = |name: &str| {
        format!(
            "<body name=\"body_{name}\"><joint name=\"{name}\" axis=\"0 1 0\"/>\
             <inertial pos=\"0.1 0 0\" mass=\"1\" diaginertia=\"0.01 0.01 0.01\"/></body>"
        )
    };
    let text = ["a", "a_body", "M_a"].map(arm).concat().replace("\"body_", "\"");
    let model = imported(&format!("<mujoco><worldbody>{text}</worldbody></mujoco>")).model;
    let mut symbols: Vec<&str> = model.lines().filter(|line| line.starts_with("linear")).collect();
    for line in &mut symbols {
        *line = line.split('"').nth(1).unwrap_or_default();
    }
    let mut different = symbols.clone();
    different.sort_unstable();
    different.dedup();
    assert_eq!(different.len(), 3, "{symbols:?}\n{model}");
}

/// A program pulls a mocap body along, so that an equality with it closes no loop of the mechanism.
#[test]
fn equalities_with_mocap_bodies_are_named() {
    let hand = "<body name=\"hand\" mocap=\"true\" pos=\"1 0 0\"/>";
    let arms = |equality: &str| {
        let text = two_arms("", ["", ""], equality).replace("</worldbody>", &format!("{hand}</worldbody>"));
        imported(&text)
    };
    let plain = arms("");
    for weld in [
        "<equality><weld body1=\"a\" body2=\"hand\"/></equality>",
        "<equality><connect body1=\"hand\" body2=\"b\" anchor=\"0 0 0\"/></equality>",
    ] {
        let result = arms(weld);
        assert_eq!(result.model, plain.model, "{weld}");
        assert!(
            lines(&result.remarks).contains("one end is the mocap body `hand`"),
            "{weld}"
        );
    }
}

/// Other readers take the mass of an `<inertial>` without `<inertia>` for a point mass.
#[test]
fn masses_without_inertia_are_point_masses() {
    let text = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"><inertial><origin xyz=\"0.5 0 0\"/><mass value=\"2\"/>\
                </inertial></link><joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/>\
                <axis xyz=\"0 0 1\"/>MORE</joint></robot>";
    let result = imported(&text.replace("MORE", ""));
    assert!(lines(&result.remarks).contains("point mass"), "{:?}", result.remarks);
    assert!(result.model.contains("ZZ = 0.5, MX = 1.0"), "{}", result.model);
    let coupled = text.replace("MORE", "<mimic joint=\"lost\"/>");
    let fault = import(&coupled, &ImportOptions::default()).unwrap_err().to_string();
    assert!(fault.contains("`lost`, but there is no joint of this name"), "{fault}");
}
