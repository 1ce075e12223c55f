//! Models as robot descriptions: read back, they have the forces that they had.

use std::path::Path;

use modelmill_boundary::files::DiskFiles;
use modelmill_boundary::text::Message;
use modelmill_codegen::{ModelEvaluator, MotionStates, derive};
use modelmill_reduction::{ExportFormat, ImportOptions, export, import};
use modelmill_spec::{DriveKind, LoadedModel, Mechanism};

use crate::lines;

fn bundled(name: &str) -> Mechanism {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
    let loaded = modelmill_spec::load_file(&folder.join(format!("{name}.toml")));
    loaded.unwrap_or_else(|failure| panic!("{failure}")).mechanism
}

fn loaded(name: &str, text: &str) -> LoadedModel {
    modelmill_spec::load(name, text, &DiskFiles::default())
        .unwrap_or_else(|failure| panic!("{name}: {failure}\n{text}"))
}

/// Values of the independent coordinates along a motion around the nominal pose, by name: position, rate, acceleration.
fn motion(mechanism: &Mechanism, samples: usize) -> Vec<(String, [Vec<f64>; 3])> {
    let independent = mechanism.coordinates.iter().filter(|one| !one.passive);
    independent
        .enumerate()
        .map(|(k, one)| {
            let size = if one.motion.is_length() { 0.05 } else { 0.15 };
            let pace = 0.3 + 0.11 * k as f64;
            let of = |f: fn(f64) -> f64, size: f64| -> Vec<f64> {
                (0..samples).map(|i| size * f(pace * i as f64)).collect()
            };
            let position = of(f64::sin, size).iter().map(|x| one.nominal + x).collect();
            let name = one.name.clone();
            (name, [position, of(f64::cos, 1.3), of(f64::sin, -2.1)])
        })
        .collect()
}

/// Forces of the drives along a motion, by the coordinates of joints or by their own names.
fn forces(mechanism: &Mechanism, motion: &[(String, [Vec<f64>; 3])]) -> Vec<(String, Vec<f64>)> {
    let derivation = derive(mechanism).expect("a derivation");
    let evaluator = ModelEvaluator::new(&derivation);
    let active = mechanism.coordinates.iter().filter(|one| !one.passive);
    let names: Vec<&str> = active.map(|one| one.name.as_str()).collect();
    let column = |k: usize| -> Vec<&[f64]> {
        let of = |name: &&str| {
            let found = motion.iter().find(|(known, _)| known == name);
            found.unwrap_or_else(|| panic!("no motion of {name}")).1[k].as_slice()
        };
        names.iter().map(of).collect()
    };
    let states = MotionStates {
        q: column(0),
        qd: column(1),
        qdd: column(2),
        load: Vec::new(),
    };
    let found = evaluator
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .expect("forces");
    let drives = mechanism.drives.iter().zip(found);
    drives
        .map(|(drive, force)| match drive.kind {
            DriveKind::Joint(i) => (mechanism.coordinates[i.0].name.clone(), force),
            DriveKind::Linear { .. } => (drive.name.clone(), force),
        })
        .collect()
}

/// Writes a model in a format, reads it back, and holds forces along a motion against each other.
fn there_and_back(mechanism: &Mechanism, format: ExportFormat) -> String {
    let exported = export(mechanism, format).expect("a description");
    let imported =
        import(&exported.text, &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}\n{}", exported.text));
    let back = loaded("back.toml", &imported.model).mechanism;
    let moved = motion(mechanism, 25);
    // The importer may count a coordinate from elsewhere, or the other way.
    let of_joint = |name: &str| {
        let mut joints = imported.joints.iter();
        joints.find(|joint| joint.coordinates.iter().any(|one| one == name))
    };
    let named = back.coordinates.iter().filter(|one| !one.passive);
    let mut signs = Vec::new();
    let moved_back: Vec<(String, [Vec<f64>; 3])> = named
        .map(|one| {
            let joint = of_joint(&one.name).expect("a joint");
            let (_, motion) = (moved.iter().find(|(name, _)| *name == joint.name))
                .unwrap_or_else(|| panic!("{} moves by itself", joint.name));
            let map = |k: usize| -> Vec<f64> {
                let offset = if k == 0 { joint.offset } else { 0.0 };
                let values = motion[k].iter();
                values.map(|x| (x - offset) / joint.ratio).collect()
            };
            signs.push((one.name.clone(), joint.name.clone(), joint.ratio));
            (one.name.clone(), [map(0), map(1), map(2)])
        })
        .collect();
    let expected = forces(mechanism, &moved);
    let found = forces(&back, &moved_back);
    let size = expected.iter().flat_map(|(_, force)| force);
    let size = size.fold(0.0_f64, |most, f| most.max(f.abs()));
    for (name, joint, ratio) in &signs {
        let Some((_, expected)) = expected.iter().find(|(one, _)| one == joint) else {
            continue;
        };
        let (_, found) = found.iter().find(|(one, _)| one == name).expect("a drive");
        for (x, y) in found.iter().zip(expected) {
            assert!((x / ratio - y).abs() < 1e-9 * size, "{joint}: {x} {y}");
        }
    }
    for drive in &mechanism.drives {
        if !matches!(drive.kind, DriveKind::Linear { .. }) {
            continue;
        }
        let [expected, found] = [&expected, &found].map(|forces| {
            let found = forces.iter().find(|(name, _)| *name == drive.name);
            &found.unwrap_or_else(|| panic!("no drive {}", drive.name)).1
        });
        for (x, y) in found.iter().zip(expected) {
            assert!((x - y).abs() < 1e-9 * size, "{}: {x} {y}", drive.name);
        }
    }
    assert_eq!(signs.len(), moved.len());
    lines(&exported.remarks)
}

#[test]
fn arms_keep_their_forces() {
    for name in ["puma560", "scara", "stanford", "two_link"] {
        let mechanism = bundled(name);
        there_and_back(&mechanism, ExportFormat::Mjcf);
    }
    // URDF does not say gravity: what reads it takes that along -z.
    for name in ["puma560", "stanford"] {
        let remarks = there_and_back(&bundled(name), ExportFormat::Urdf);
        assert!(remarks.contains("0 0 -9.8"), "{remarks}");
    }
}

/// Loops are closed at the pose of the file, and a coordinate that moves two joints is one.
#[test]
fn loops_keep_their_forces() {
    for name in ["five_bar", "four_bar", "arm_parallelogram"] {
        let remarks = there_and_back(&bundled(name), ExportFormat::Mjcf);
        assert!(remarks.contains("soft constraints"), "{remarks}");
    }
}

/// Drives between two points are tendons there, and drives again here.
#[test]
fn drives_between_points_keep_their_forces() {
    there_and_back(&bundled("spidermill"), ExportFormat::Mjcf);
}

/// Friction, inertia of drives and springs stand where the format has them; what it has not is said.
#[test]
fn effects_are_said_or_told() {
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models/two_link.toml"))
            .expect("a model");
    let mechanism = loaded("two_link.toml", &text).mechanism;
    let drive = &mechanism.drives[0].name;
    let effect = |kind: &str, values: &str| {
        format!("\n[[effect]]\nkind = \"{kind}\"\nat = \"{drive}\"\nparameters = {{ {values} }}\n")
    };
    let more = [
        effect("viscous_friction", "Fv = { nominal = 0.5 }"),
        effect("coulomb_friction", "Fc = { nominal = 1.5 }"),
        effect("drive_inertia", "Ia = { nominal = 0.25 }"),
        effect("load_friction", "mu = { nominal = 0.1 }"),
    ];
    let mechanism = loaded("two_link.toml", &(text + &more.concat())).mechanism;
    let mjcf = export(&mechanism, ExportFormat::Mjcf).expect("a description");
    for said in ["damping=\"0.5\"", "frictionloss=\"1.5\"", "armature=\"0.25\""] {
        assert_eq!(mjcf.text.matches(said).count(), 1, "{}", mjcf.text);
    }
    let urdf = export(&mechanism, ExportFormat::Urdf).expect("a description");
    let said = "<dynamics damping=\"0.5\" friction=\"1.5\"/>";
    assert_eq!(urdf.text.matches(said).count(), 1, "{}", urdf.text);
    let told = |remarks: &[Message], kind: &str| {
        let mut all = remarks.iter().map(Message::in_library_words);
        all.any(|one| one.contains(kind) && one.contains("left out"))
    };
    assert!(told(&mjcf.remarks, "load_friction") && told(&urdf.remarks, "load_friction"));
    assert!(told(&urdf.remarks, "drive_inertia") && !told(&mjcf.remarks, "drive_inertia"));
}

/// Bodies that nothing can be are told, and moments that nothing feels are not asked for.
#[test]
fn bodies_can_be() {
    let planar = export(&bundled("five_bar"), ExportFormat::Mjcf).expect("a description");
    let remarks = lines(&planar.remarks);
    assert!(remarks.contains("without effect on any motion"), "{remarks}");
    assert!(!remarks.contains("impossible for a body"), "{remarks}");
    let mut arm = bundled("puma560");
    let mass = arm.parameters.iter_mut().find(|one| one.unit == "kg");
    mass.expect("a mass").nominal = -1.0;
    let remarks = export(&arm, ExportFormat::Urdf).expect("a description").remarks;
    let remarks = lines(&remarks);
    assert!(remarks.contains("has no mass above zero"), "{remarks}");
}

/// A mass that sits at different places for forces and moments is no body.
#[test]
fn what_no_body_is_is_refused() {
    let says = export(&bundled("spidermill-paper"), ExportFormat::Mjcf).unwrap_err();
    assert!(says.to_string().contains("different places"), "{says}");
}

/// Joints that follow others by any ratio are written as such in both formats.
#[test]
fn couplings_are_kept() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/coupled");
    for name in ["geared_arm_any_ratio", "ball_screw", "helical_joint"] {
        let text = std::fs::read_to_string(folder.join(format!("{name}.toml")));
        // A URDF knows no gravity but that of the earth, downwards.
        let text = text
            .expect("a fixture")
            .replace("[\"gx\", 0, \"-g\"]", "[0, 0, \"-g\"]");
        let mechanism = loaded(name, &text).mechanism;
        for format in [ExportFormat::Urdf, ExportFormat::Mjcf] {
            there_and_back(&mechanism, format);
        }
    }
}
