//! Every model that comes with the program, and every variant that the tests of the workspace use, is sound.

use std::path::{Path, PathBuf};

use modelmill_spec::{LoadedModel, load_file};

fn folder(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn files(path: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder(path))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|end| end == "toml"))
        .collect();
    files.sort();
    files
}

fn model(name: &str) -> LoadedModel {
    load_file(&folder("models").join(name)).unwrap_or_else(|failure| panic!("{failure}"))
}

#[test]
fn every_model_is_sound() {
    let mut faults = String::new();
    let models = files("models");
    let variants = files("../tests/fixtures/variants");
    assert!(models.len() >= 13 && variants.len() >= 20);
    for path in models.iter().chain(&variants) {
        match load_file(path) {
            Ok(loaded) => faults.push_str(&loaded.render(false)),
            Err(failure) => faults.push_str(&failure.render(false)),
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn names_of_the_spidermill() {
    let mechanism = model("spidermill-paper.toml").mechanism;
    let parameters: Vec<&str> = mechanism.parameters.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(parameters, ["m1", "m2", "m3", "m4", "dc1", "dc3", "Ic12", "Ic32"]);
    let frames: Vec<&str> = mechanism.frames.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(frames, ["base", "S1", "S3", "S7", "S5"]);
    assert_eq!(mechanism.retain.len(), 5);
    let platform = &mechanism.lumped_masses[2];
    assert_eq!(mechanism.text_of(&platform.force_at[0]), "d3");
    assert_eq!(mechanism.text_of(&platform.moment_at[0]), "dc3");
    assert_eq!(platform.share.to_string(), "1/2");
}

#[test]
fn loops_are_closed_at_the_nominal_pose() {
    let mechanism = model("spidermill.toml").mechanism;
    // By symmetry, and by NOTES: gamma1 = -2.615 at theta1 = 1.80.
    assert!((mechanism.coordinates[2].nominal + 2.615).abs() < 2e-3);
    assert!((mechanism.coordinates[2].nominal + mechanism.coordinates[3].nominal).abs() < 1e-6);
}

#[test]
fn parameters_of_an_arm_come_link_by_link() {
    let mechanism = model("puma560.toml").mechanism;
    let names: Vec<&str> = mechanism.parameters.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names.len(), 60);
    assert_eq!(
        names[..11],
        [
            "XX1", "XY1", "XZ1", "YY1", "YZ1", "ZZ1", "MX1", "MY1", "MZ1", "M1", "XX2"
        ]
    );
}
