//! Servos of MJCF: gains, delays and limits are imported as actuators and exported again, and controllers that a model cannot
//! express are named. That the gains mean the same is shown by the motion of `recordings/servo-arm`, which MuJoCo simulated.

use modelmill_boundary::files::DiskFiles;
use modelmill_boundary::text::Message;
use modelmill_reduction::{ExportFormat, ImportOptions, export, import};
use modelmill_spec::Mechanism;

/// An arm of one joint with some actuators.
fn arm(actuators: &str) -> String {
    format!(
        r#"<mujoco model="arm"><compiler angle="radian"/><worldbody><body name="link">
             <joint name="q" axis="0 1 0" damping="0.1" armature="0.02"/>
             <inertial pos="0 0 0.1" mass="0.5" diaginertia="0.003 0.003 0.001"/>
           </body></worldbody><actuator>{actuators}</actuator></mujoco>"#
    )
}

/// The mechanism of a model file.
fn mechanism(text: &str) -> Mechanism {
    let loaded = modelmill_spec::load("arm.toml", text, &DiskFiles::default());
    loaded.unwrap_or_else(|failure| panic!("{failure}\n{text}")).mechanism
}

/// The model file and the remarks of an import.
fn imported(actuators: &str) -> (String, String) {
    let found = import(&arm(actuators), &ImportOptions::default()).unwrap();
    let remarks: Vec<String> = found.remarks.iter().map(Message::in_library_words).collect();
    (found.model, remarks.join("\n"))
}

/// The table of the actuator in a model file; empty if there is none.
fn actuator(model: &str) -> Vec<String> {
    let lines = model.lines().skip_while(|line| *line != "[[actuator]]").skip(1);
    lines.take_while(|line| !line.is_empty()).map(str::to_owned).collect()
}

#[test]
fn gains_limits_and_delays_become_an_actuator() {
    let position = r#"<position name="servo" joint="q" kp="20" kv="0.4" forcerange="-3 3" delay="0.01" nsample="6"/>"#;
    let wanted = [
        r#"drive = "q_drive""#,
        r#"kind = "position_servo""#,
        "kp = 20.0",
        "kd = 0.4",
        r#"signal = "servo""#,
        "delay = 0.01",
        "saturation = 3.0",
    ];
    assert_eq!(actuator(&imported(position).0), wanted);
    // MuJoCo saves the same servo as a general actuator.
    let general = r#"<general name="servo" joint="q" biastype="affine" gainprm="20" biasprm="0 -20 -0.4" forcerange="-3 3" delay="0.01" nsample="6"/>"#;
    assert_eq!(actuator(&imported(general).0), wanted);
    let velocity = actuator(&imported(r#"<velocity joint="q" kv="2"/>"#).0);
    assert_eq!(velocity[1..], [r#"kind = "velocity_servo""#, "kv = 2.0"]);
}

/// The command cannot have the name of the joint.
#[test]
fn a_servo_with_the_name_of_its_joint_has_the_usual_signal() {
    let (model, _) = imported(r#"<position name="q" joint="q" kp="20"/>"#);
    assert!(
        actuator(&model).iter().all(|line| !line.starts_with("signal")),
        "{model}"
    );
}

#[test]
fn controllers_that_a_model_cannot_express_are_named() {
    let refused = [
        (r#"<position joint="q" kp="20" gear="2"/>"#, "gear is not 1"),
        (r#"<position joint="q" kp="20" dampratio="1"/>"#, "`dampratio`"),
        (r#"<position joint="q" kp="20" timeconst="0.1"/>"#, "`timeconst`"),
        (
            r#"<position joint="q" kp="20"/><motor joint="q"/>"#,
            "whose controller is left out",
        ),
        (
            r#"<general joint="q" biastype="affine" gainprm="20" biasprm="0 -5"/>"#,
            "its controller is left out",
        ),
        (
            r#"<motor joint="q"/><position joint="q" kp="20"/>"#,
            "another actuator acts on the same joint",
        ),
    ];
    for (text, reason) in refused {
        let (model, remarks) = imported(text);
        assert!(actuator(&model).is_empty(), "{text}: {model}");
        assert!(remarks.contains(reason), "{text}: {remarks}");
    }
    // A motor has no controller.
    let (model, remarks) = imported(r#"<motor joint="q"/>"#);
    assert!(
        actuator(&model).is_empty() && !remarks.contains("controller"),
        "{remarks}"
    );
}

#[test]
fn an_exported_servo_is_read_again() {
    let text = r#"<position name="servo" joint="q" kp="20" kv="0.4" forcerange="-3 3" delay="0.01" nsample="6"/>"#;
    let (model, _) = imported(text);
    let exported = export(&mechanism(&model), ExportFormat::Mjcf).unwrap();
    let servo = exported
        .text
        .lines()
        .find(|line| line.contains("<position"))
        .unwrap()
        .trim();
    // The buffer of MuJoCo holds the delay at small steps too, and its value is no multiple of the step.
    assert_eq!(
        servo,
        text.replace("nsample=\"6\"", "nsample=\"101\" interp=\"linear\"")
    );
    let again = import(&exported.text, &ImportOptions::default()).unwrap().model;
    assert_eq!(actuator(&again), actuator(&model));
}

/// What MJCF has no word for is said.
#[test]
fn a_dead_band_and_an_unknown_gain_are_named() {
    let (model, _) = imported(r#"<position joint="q" kp="20" kv="0.4"/>"#);
    let with_band = model.replace("kd = 0.4\n", "kd = 0.4\ndead_band = 0.01\n");
    let exported = export(&mechanism(&with_band), ExportFormat::Mjcf).unwrap();
    let remarks: Vec<String> = exported.remarks.iter().map(Message::in_library_words).collect();
    assert!(remarks.iter().any(|one| one.contains("dead band")), "{remarks:?}");
    let unknown = model.replace("kp = 20.0", "kp = \"kp\"");
    let unknown = unknown.replace(
        "\n[coordinates]",
        "\n[parameters]\nkp = { unit = \"N m\" }\n\n[coordinates]",
    );
    let exported = export(&mechanism(&unknown), ExportFormat::Mjcf).unwrap();
    assert!(exported.text.contains("<motor"), "{}", exported.text);
    let remarks: Vec<String> = exported.remarks.iter().map(Message::in_library_words).collect();
    assert!(
        remarks.iter().any(|one| one.contains("no nominal value")),
        "{remarks:?}"
    );
}

/// Known bodies have numbers, and identified values of single parameters are exported.
#[test]
fn known_bodies_have_numbers_and_identified_friction_is_exported() {
    let options = ImportOptions {
        known_bodies: true,
        ..ImportOptions::default()
    };
    let model = import(&arm(r#"<motor joint="q"/>"#), &options).unwrap().model;
    assert!(
        model.contains("linear = { XX = ") && !model.contains("all ="),
        "{model}"
    );
    let adopted = model + "\n[identified]\nbase = [{ expression = \"Fv_q_drive\", value = 0.25 }]\n";
    let exported = export(&mechanism(&adopted), ExportFormat::Mjcf).unwrap();
    assert!(exported.text.contains(r#"damping="0.25""#), "{}", exported.text);
    let remarks: Vec<String> = exported.remarks.iter().map(Message::in_library_words).collect();
    assert!(!remarks.iter().any(|one| one.contains("[identified]")), "{remarks:?}");
}
