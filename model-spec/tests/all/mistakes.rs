//! One mistake in a correct file gives one finding with its remedy, and values that no machine has are remarked.

use modelmill_boundary::files::MemoryFiles;
use modelmill_spec::{Diagnostic, LoadedModel, load};

/// A pendulum without any finding.
const PENDULUM: &str = r#"
schema = 1
name = "pendulum"
gravity = [0, "-g", 0]

[constants]
g = { value = 9.81, unit = "m/s^2" }
l = { value = 0.4, unit = "m" }

[parameters]
m = { nominal = 2, unit = "kg" }
c = { nominal = 0.2, unit = "m" }
I = { nominal = 0.02, unit = "kg m^2" }

[coordinates]
angle = { nominal = 0.3 }

[limits.coordinates]
angle = { position = [-3, 3] }

[[frame]]
name = "arm"
on = "base"
modified_dh = { theta = "angle" }

[[frame]]
name = "tip"
on = "arm"
transform = { xyz = ["l", 0, 0] }

[[point]]
name = "near"
on = "arm"
at = [0.1, 0, 0]

[[point]]
name = "far"
on = "tip"
at = [0.1, 0, 0]

[[part]]
on = "arm"
mass = "m"
centre = ["c", 0, 0]
inertia = { zz = "I" }

[[drive]]
name = "motor"
joint = "angle"
"#;

/// The pendulum with one text replaced by another.
fn changed(from: &str, to: &str) -> String {
    assert!(PENDULUM.contains(from), "{from}");
    PENDULUM.replace(from, to)
}

fn loaded(text: &str) -> LoadedModel {
    load("p.toml", text, &MemoryFiles::default()).unwrap_or_else(|failure| panic!("{}", failure.render(false)))
}

/// The only finding of a faulty file, with its help in one text.
fn only_fault(text: &str) -> (Diagnostic, String) {
    let failure = load("p.toml", text, &MemoryFiles::default()).expect_err("the file is faulty");
    let shown = failure.render(false);
    let [only] = failure.diagnostics.as_slice() else {
        panic!("one mistake gives one finding:\n{shown}");
    };
    (only.clone(), shown)
}

#[test]
fn the_pendulum_has_no_finding() {
    assert!(loaded(PENDULUM).warnings.is_empty());
}

#[test]
fn one_misspelt_table_gives_one_error() {
    for (section, misspelt) in [
        ("[constants]", "[constant]"),
        ("[parameters]", "[paramters]"),
        ("[coordinates]", "[coordinate]"),
        ("[[frame]]", "[[frames]]"),
        ("[[point]]", "[[pont]]"),
        ("[[part]]", "[[parts]]"),
        ("[[drive]]", "[[drives]]"),
        ("modified_dh", "modifed_dh"),
        ("position =", "positon ="),
    ] {
        let (fault, shown) = only_fault(&changed(section, misspelt));
        assert!(fault.message.starts_with("unknown key"), "{shown}");
        let name = section.trim_matches(['[', ']', '=', ' ']);
        assert!(shown.contains(&format!("did you mean `{name}`?")), "{shown}");
    }
}

#[test]
fn a_table_of_the_wrong_sort_gives_one_error() {
    only_fault(&changed("[[drive]]", "[drive]"));
    only_fault(&changed("[[part]]", "[part]"));
    only_fault(&changed("[parameters]\nm =", "[[parameters]]\nm ="));
}

#[test]
fn a_unit_is_corrected() {
    for (from, written, remedy) in [
        ("m/s^2", "m/s2", "write `m/s^2`"),
        ("m/s^2", "m/s/s", "write `m/s^2`"),
        ("kg m^2", "kgm^2", "write `kg m^2`"),
        ("kg m^2", "kg m2", "write `kg m^2`"),
        ("kg m^2", "kg.m^2", "write `kg m^2`"),
        ("kg m^2", "kg\u{b7}m\u{b2}", "write `kg\u{b7}m^2`"),
    ] {
        let (_, shown) = only_fault(&changed(&format!("\"{from}\""), &format!("\"{written}\"")));
        assert!(shown.contains(remedy), "{written}: {shown}");
    }
}

/// A metre times a newton is another quantity than a millinewton.
#[test]
fn milli_units_are_not_split() {
    for (written, si) in [
        ("mN", "N"),
        ("mrad", "rad"),
        ("mH", "H"),
        ("mOhm", "Ohm"),
        ("mNm", "N m"),
        ("mA", "A"),
        ("mN/m", "N"),
    ] {
        let (_, shown) = only_fault(&changed("\"kg m^2\"", &format!("\"{written}\"")));
        assert!(
            shown.contains(&format!("write `{si}` and convert the value")),
            "{written}: {shown}"
        );
    }
    // Without advice there is no wrong one.
    let (_, shown) = only_fault(&changed("\"kg m^2\"", "\"mN.m\""));
    assert!(!shown.contains("write `m N"), "{shown}");
}

#[test]
fn a_name_with_a_blank_is_corrected() {
    let (_, shown) = only_fault(&changed("\"pendulum\"", "\"my pendulum\""));
    assert!(shown.contains("write `my_pendulum`"), "{shown}");
    let (_, shown) = only_fault(&changed("mass = \"m\"", "mass = \"m * the mass\""));
    assert!(shown.contains("call it `the_mass`"), "{shown}");
}

#[test]
fn a_parameter_in_geometry_becomes_a_constant() {
    let (_, shown) = only_fault(&changed("xyz = [\"l\"", "xyz = [\"c\""));
    assert!(shown.contains("move `c` to `[constants]`"), "{shown}");
}

#[test]
fn a_drive_inside_one_body_is_reported() {
    let drive = "linear = { from = \"near\", to = \"far\" }";
    let (fault, shown) = only_fault(&changed("joint = \"angle\"", drive));
    assert_eq!(
        fault.message, "the points `near` and `far` are on the same body",
        "{shown}"
    );
    // Between two bodies it is accepted.
    loaded(&changed("joint = \"angle\"", drive).replacen("on = \"arm\"\nat", "on = \"base\"\nat", 1));
}

#[test]
fn angles_in_degrees_are_remarked() {
    for (from, to) in [
        (
            "nominal = 0.3 }\n\n[limits.coordinates]\nangle = { position = [-3, 3] }",
            "nominal = 35 }",
        ),
        ("position = [-3, 3]", "position = [-170, 170]"),
        ("[parameters]", "tilt = { value = 90, unit = \"rad\" }\n\n[parameters]"),
    ] {
        let text = changed(from, to).replace("theta = \"angle\" }", "theta = \"angle\", alpha = \"tilt\" }");
        let text = if text.contains("tilt =") {
            text
        } else {
            text.replace(", alpha = \"tilt\"", "")
        };
        let warnings = loaded(&text).warnings;
        assert!(
            warnings.len() == 1 && warnings[0].label == "angles are in rad",
            "{to}: {warnings:?}"
        );
        assert!(!warnings[0].is_impossible);
    }
}

#[test]
fn lengths_in_millimetres_are_remarked() {
    for (from, to, meant) in [
        ("l = { value = 0.4,", "l = { value = 400,", "write 0.4"),
        ("c = { nominal = 0.2,", "c = { nominal = -200,", "write -0.2"),
    ] {
        let warnings = loaded(&changed(from, to)).warnings;
        assert!(
            warnings.len() == 1 && warnings[0].label == "lengths are in m" && !warnings[0].is_impossible,
            "{to}: {warnings:?}"
        );
        assert!(format!("{:?}", warnings[0].help).contains(meant), "{to}: {warnings:?}");
    }
    // A long boom, and large values of other units.
    for (from, to) in [
        ("l = { value = 0.4,", "l = { value = 45,"),
        ("m = { nominal = 2,", "m = { nominal = 2000,"),
    ] {
        assert!(loaded(&changed(from, to)).warnings.is_empty(), "{to}");
    }
}

/// A motor behind a gear has many turns at the nominal pose.
#[test]
fn many_turns_behind_a_gear_are_not_remarked() {
    let text = changed(
        "angle = { nominal = 0.3 }",
        "angle = { nominal = 0.3 }\nrotor = { follows = \"100*angle\" }",
    ) + "\n[[frame]]\nname = \"spindle\"\non = \"base\"\nmodified_dh = { theta = \"rotor\" }\n";
    assert!(loaded(&text).warnings.is_empty());
}

#[test]
fn masses_and_moments_below_zero_are_impossible() {
    for (from, to) in [
        ("nominal = 2,", "nominal = -230,"),
        ("nominal = 0.02,", "nominal = -0.02,"),
    ] {
        let warnings = loaded(&changed(from, to)).warnings;
        assert!(warnings.len() == 1 && warnings[0].is_impossible, "{to}: {warnings:?}");
    }
    // Linear parameters of moments may be regrouped with those of other bodies.
    let regrouped = "linear = { planar = 1, nominal = { ZZ = -0.1, MX = 1, M = 1 } }\n";
    let text = changed(
        "mass = \"m\"\ncentre = [\"c\", 0, 0]\ninertia = { zz = \"I\" }\n",
        regrouped,
    );
    let impossible = loaded(&text).warnings.into_iter().any(|warning| warning.is_impossible);
    assert!(!impossible);
}

/// A hole may be a full body with a negative lumped mass.
#[test]
fn a_lumped_mass_below_zero_is_impossible_only_in_a_body_below_zero() {
    for (share, is_impossible) in [("1/2", false), ("3/2", true)] {
        // The frame of the point `far` is fixed to the body of 2 kg, or is the body itself.
        let hole = format!("\n[[lumped_mass]]\nmass = \"-m\"\nshare = \"{share}\"\nat = \"far\"\n");
        let warnings = loaded(&(PENDULUM.to_owned() + &hole)).warnings;
        assert!(
            warnings.len() == 1 && warnings[0].is_impossible == is_impossible,
            "{share}: {warnings:?}"
        );
    }
}

/// Bodies without a joint to the base do not move, and a mass at a point that moves does.
#[test]
fn the_total_mass_is_that_of_what_moves() {
    let stand = "\n[[frame]]\nname = \"stand\"\non = \"base\"\ntransform = { xyz = [0, 0, 1] }\n\
                 \n[[point]]\nname = \"foot\"\non = \"stand\"\nat = [0, 0.1, 0]\n\
                 \n[[part]]\nname = \"column\"\non = \"stand\"\nmass = \"25*m\"\n";
    assert_eq!(
        loaded(&(PENDULUM.to_owned() + stand)).mechanism.total_nominal_mass(),
        Some(2.0)
    );
    for (point, total) in [("far", 2.75), ("foot", 2.0)] {
        let tool = format!(
            "\n[[effect]]\nkind = \"point_mass\"\nat = [\"{point}\"]\nparameters = {{ m = {{ nominal = 0.75 }} }}\n"
        );
        let text = PENDULUM.to_owned() + stand + &tool;
        assert_eq!(loaded(&text).mechanism.total_nominal_mass(), Some(total), "{point}");
    }
}

#[test]
fn the_total_mass_needs_all_masses() {
    assert_eq!(loaded(PENDULUM).mechanism.total_nominal_mass(), Some(2.0));
    let more = "\n[[lumped_mass]]\nmass = \"m\"\nshare = \"1/2\"\nat = \"far\"\n";
    let with_load = loaded(&(PENDULUM.to_owned() + more));
    assert_eq!(with_load.mechanism.total_nominal_mass(), Some(3.0));
    let unknown = changed("nominal = 2, ", "");
    assert_eq!(loaded(&unknown).mechanism.total_nominal_mass(), None);
}
