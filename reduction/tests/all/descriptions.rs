//! Planar mechanisms as robot descriptions: the rig of a description has the forces of the model from which the description
//! was written, and so has the model to which it is reduced. Rigs and models share no mechanics.

use std::path::Path;

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_reduction::{
    ExportFormat, ImportOptions, default_plan, export, propose_plan, reduce, rig_of_description, sampled_forces,
};
use modelmill_rig::{Rig, RigState};
use modelmill_spec::{DriveKind, Mechanism};

fn bundled(name: &str) -> Mechanism {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
    let loaded = modelmill_spec::load_file(&folder.join(format!("{name}.toml")));
    loaded.unwrap_or_else(|failure| panic!("{failure}")).mechanism
}

fn rig_of(text: &str) -> Rig {
    let made = rig_of_description(text, &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let loaded = modelmill_rig::load("robot.xml", &made.text, &MemoryFiles::default());
    loaded.unwrap_or_else(|failure| panic!("{failure}\n{}", made.text)).rig
}

fn derived(text: &str) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", text, &MemoryFiles::default()).expect("a model");
    modelmill_codegen::derive(&loaded.mechanism).expect("a derivation")
}

/// The largest error of a model's forces at sampled motions of the rig, relative to the largest force.
fn largest_error(rig: &Rig, derivation: &Derivation) -> f64 {
    let sampled = sampled_forces(rig, 20, 0.1).expect("motions");
    let mechanism = &derivation.mechanism;
    let order: Vec<usize> = mechanism
        .coordinates
        .iter()
        .filter(|c| !c.passive)
        .map(|c| {
            rig.coordinates
                .iter()
                .position(|known| known.name == c.name)
                .expect("a coordinate")
        })
        .collect();
    let columns = |of: fn(&RigState) -> &Vec<f64>| -> Vec<Vec<f64>> {
        order
            .iter()
            .map(|k| sampled.iter().map(|(state, _)| of(state)[*k]).collect())
            .collect()
    };
    let (q, qd, qdd) = (columns(|s| &s.q), columns(|s| &s.qd), columns(|s| &s.qdd));
    let states = MotionStates {
        q: q.iter().map(Vec::as_slice).collect(),
        qd: qd.iter().map(Vec::as_slice).collect(),
        qdd: qdd.iter().map(Vec::as_slice).collect(),
        load: Vec::new(),
    };
    let found = ModelEvaluator::new(derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .expect("forces");
    let (mut most, mut error) = (0.0_f64, 0.0_f64);
    for (drive, forces) in mechanism.drives.iter().zip(found) {
        let DriveKind::Joint(c) = drive.kind else {
            panic!("a drive of a joint")
        };
        let name = &mechanism.coordinates[c.0].name;
        let k = rig
            .coordinates
            .iter()
            .position(|known| &known.name == name)
            .expect("a coordinate");
        for (force, (_, truth)) in forces.iter().zip(&sampled) {
            most = most.max(truth[k].abs());
            error = error.max((force - truth[k]).abs());
        }
    }
    error / most
}

#[test]
fn descriptions_of_planar_mechanisms_reduce_to_their_models() {
    for name in ["two_link", "five_bar", "four_bar"] {
        let mechanism = bundled(name);
        let exported = export(&mechanism, ExportFormat::Mjcf).expect("a description");
        let rig = rig_of(&exported.text);
        let original = modelmill_codegen::derive(&mechanism).expect("a derivation");
        let error = largest_error(&rig, &original);
        assert!(error < 1e-6, "{name}: the rig differs by {error}\n{}", exported.text);
        // Every body a part, and the proposed plan.
        let plan = default_plan(&rig).unwrap_or_else(|says| panic!("{}", says.in_library_words()));
        let reduced = reduce(plan.rig(&rig), &plan).unwrap_or_else(|failure| panic!("{name}: {failure}"));
        let derivation = derived(&reduced.model);
        let error = largest_error(&rig, &derivation);
        assert!(
            error < 1e-6,
            "{name}: the reduced model differs by {error}\n{}",
            reduced.model
        );
        let proposal = propose_plan(&rig).unwrap_or_else(|says| panic!("{name}: {says}"));
        let plan = modelmill_reduction::plan("plan.toml", &proposal.text).unwrap_or_else(|failure| panic!("{failure}"));
        let reduced = reduce(&rig, &plan).unwrap_or_else(|failure| panic!("{name}: {failure}\n{}", proposal.text));
        let error = largest_error(&rig, &derived(&reduced.model));
        assert!(
            error < 1e-6,
            "{name}: the proposed model differs by {error}\n{}",
            reduced.model
        );
    }
}

/// A URDF in the plane x-z, with a sensor that is fixed to a link.
#[test]
fn mechanisms_in_another_plane_are_recognised() {
    let link = |name: &str, mass: f64| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0.2 0 0.03\"/><mass value=\"{mass}\"/><inertia ixx=\"0.01\" \
             iyy=\"0.03\" izz=\"0.035\" ixy=\"0\" ixz=\"0.002\" iyz=\"0\"/></inertial></link>"
        )
    };
    let text = format!(
        "<robot name=\"arm\"><link name=\"base\"/>{}{}{}<joint name=\"shoulder\" type=\"revolute\"><parent link=\"base\"/><child \
         link=\"upper\"/><origin xyz=\"0 0.1 0.3\"/><axis xyz=\"0 1 0\"/><limit effort=\"10\" velocity=\"1\" lower=\"-1\" \
         upper=\"1\"/></joint><joint name=\"elbow\" type=\"revolute\"><parent link=\"upper\"/><child \
         link=\"lower\"/><origin xyz=\"0.4 0.05 0\" rpy=\"0 0.7 0\"/><axis xyz=\"0 -1 0\"/><limit effort=\"10\" velocity=\"1\" \
         lower=\"-1\" upper=\"1\"/></joint><joint name=\"mount\" type=\"fixed\"><parent link=\"lower\"/><child \
         link=\"sensor\"/><origin xyz=\"0.3 0 0\" rpy=\"0 0 0.4\"/></joint></robot>",
        link("upper", 3.0),
        link("lower", 2.0),
        link("sensor", 0.4)
    );
    let rig = rig_of(&text);
    assert_eq!(rig.bodies.len(), 2);
    let plan = default_plan(&rig).unwrap_or_else(|says| panic!("{}", says.in_library_words()));
    let reduced = reduce(plan.rig(&rig), &plan).unwrap_or_else(|failure| panic!("{failure}"));
    let error = largest_error(&rig, &derived(&reduced.model));
    assert!(error < 1e-9, "{error}\n{}", reduced.model);
}

/// Effects of rigs act at drives; what a joint without drive has is named.
#[test]
fn losses_of_joints_without_drive_are_remarked() {
    let text = "<mujoco model='arm'><worldbody><body name='upper'>\
        <joint name='shoulder' axis='0 1 0' damping='0.3' frictionloss='0.2' armature='0.1'/>\
        <inertial pos='0.2 0 0' mass='2' diaginertia='0.02 0.02 0.01'/><body name='lower' pos='0.4 0 0'>\
        <joint name='elbow' axis='0 1 0' damping='0.3' frictionloss='0.2' armature='0.1' stiffness='4'/>\
        <inertial pos='0.2 0 0' mass='1' diaginertia='0.01 0.01 0.01'/></body></body></worldbody>\
        <actuator><motor joint='shoulder'/></actuator></mujoco>";
    let made = rig_of_description(text, &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let remarks = made.remarks.join("\n");
    for what in ["spring", "viscous friction", "Coulomb friction", "rotor inertia"] {
        let says = format!("the {what} of the joint `elbow` is left out");
        assert!(remarks.contains(&says), "{remarks}");
    }
    // At a drive they are effects.
    assert!(!remarks.contains("`shoulder`"), "{remarks}");
    assert_eq!(made.text.matches("[[effect]]").count(), 3, "{}", made.text);
}
