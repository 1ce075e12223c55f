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
