//! What an importer of MJCF says beside the model it makes.

use modelmill_reduction::{ImportOptions, import};

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
    import(&text, &ImportOptions::default())
        .unwrap()
        .remarks
        .join("\n")
}

/// A four-bar linkage in a plane, closed by its fourth hinge: two conditions, which are independent; or by a last body that is
/// welded to the ground, of whose conditions some follow from others.
#[test]
fn conditions_that_follow_from_others_are_said() {
    let weld = bar("last", "0 0 -2", "");
    let rocker = bar("rocker", "3 0 1", &weld);
    let chain = bar("crank", "0 0 0", &bar("coupler", "0 0 1", &rocker));
    let welded = remarks("", &chain, "<weld body1=\"last\"/>");
    assert!(
        welded.contains("conditions of its loops 3 are independent"),
        "{welded}"
    );
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
    assert!(without.contains("switches gravity off"), "{without}");
    let wet = remarks("<option viscosity=\"0.1\"/>", &one, "");
    assert!(wet.contains("`viscosity`"), "{wet}");
}

/// A bar that a tendon lifts, with what else pulls.
fn pulled(tendon: &str, actuators: &str) -> Result<modelmill_reduction::Imported, String> {
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
    const STRAIGHT: &str =
        " damping=\"2\" armature=\"0.5\" stiffness=\"3\"><site site=\"top\"/><site site=\"tip\"/>";
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
    let remarks = imported.remarks.join("\n");
    assert!(remarks.contains("stiffness of this tendon"), "{remarks}");
    assert!(!remarks.contains("damping"), "{remarks}");
    // A joint with a motor and a rope besides has more drives than freedoms.
    let both = pulled(
        STRAIGHT,
        &format!("{one}<motor name=\"turn\" joint=\"bar_turn\"/>"),
    )
    .unwrap();
    assert_eq!(both.model.matches("[[drive]]").count(), 2, "{}", both.model);
}

#[test]
fn tendons_that_bend_are_said() {
    let bent = "><site site=\"top\"/><site site=\"side\"/><site site=\"tip\"/>";
    let imported = pulled(bent, "<motor tendon=\"rope\"/><motor joint=\"bar_turn\"/>").unwrap();
    let remarks = imported.remarks.join("\n");
    assert!(
        remarks.contains("no straight line between two sites"),
        "{remarks}"
    );
    assert_eq!(imported.model.matches("[[drive]]").count(), 1);
    let missing = pulled(
        "><site site=\"top\"/><site site=\"tap\"/>",
        "<motor tendon=\"rope\"/>",
    );
    let error = missing.unwrap_err();
    assert!(error.contains("line") && error.contains("`tap`"), "{error}");
}
