//! What a build script sees: modules for sound models, the models' own diagnostics for faulty ones.

use std::path::{Path, PathBuf};

use modelmill_build::{Options, try_generate, try_generate_with};

const PENDULUM: &str = r#"
schema = 1
name = "pendulum"
gravity = [0, "-g", 0]
constants = { g = { value = 9.81, unit = "m/s^2" } }
coordinates = { q = {} }
frame = [{ name = "arm", on = "base", modified_dh = { theta = "q" } }]
part = [{ on = "arm", linear = { planar = "1" } }]
drive = [{ name = "motor", joint = "q" }]
"#;

/// A fresh folder with some files in it.
fn folder(name: &str, files: &[(&str, &str)]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    for (file, text) in files {
        std::fs::write(folder.join(file), text).unwrap();
    }
    folder
}

fn generate(folder: &Path) -> Result<String, String> {
    let out = folder.join("models.rs");
    try_generate(&format!("{}/*.toml", folder.display()), &out).map_err(|error| error.to_string())?;
    Ok(std::fs::read_to_string(out).unwrap())
}

#[test]
fn a_sound_model_becomes_a_module_and_the_same_one_every_time() {
    let folder = folder("sound", &[("pendulum.toml", PENDULUM)]);
    let first = generate(&folder).unwrap();
    assert!(first.contains("pub mod pendulum {"));
    assert!(first.contains(r#"BaseParameter::new("p1_min", "ZZ1""#), "{first}");
    assert_eq!(generate(&folder).unwrap(), first);
}

#[test]
fn an_unchanged_module_keeps_its_date() {
    let folder = folder("unchanged", &[("pendulum.toml", PENDULUM)]);
    generate(&folder).unwrap();
    let date = |folder: &Path| std::fs::metadata(folder.join("models.rs")).unwrap().modified().unwrap();
    let before = date(&folder);
    generate(&folder).unwrap();
    assert_eq!(date(&folder), before);
}

#[test]
fn faults_of_all_models_come_together_with_their_places() {
    let typing_error = PENDULUM.replace("joint = \"q\"", "joint = \"p\"");
    let wrong_unit = PENDULUM.replace("m/s^2", "kg");
    let folder = folder("faulty", &[("a.toml", &typing_error), ("b.toml", &wrong_unit)]);
    let error = generate(&folder).unwrap_err();
    assert!(error.contains("a.toml:9:"), "{error}");
    assert!(error.contains("known names: `q`"), "{error}");
    assert!(error.contains("b.toml:"), "{error}");
    assert!(
        !folder.join("models.rs").exists(),
        "nothing is written for faulty models"
    );
}

#[test]
fn two_models_of_one_name_are_refused() {
    let folder = folder("twice", &[("a.toml", PENDULUM), ("b.toml", PENDULUM)]);
    let error = generate(&folder).unwrap_err();
    assert!(error.contains("another model is called `pendulum` too"), "{error}");
}

#[test]
fn an_empty_or_missing_folder_is_said() {
    let folder = folder("empty", &[]);
    assert!(generate(&folder).unwrap_err().contains("no model file"));
    assert!(
        generate(&folder.join("missing"))
            .unwrap_err()
            .contains("cannot read folder")
    );
}

fn with_dynamics(folder: &Path) -> Result<String, String> {
    with(folder, Options::default().with_dynamics())
}

fn with(folder: &Path, options: Options) -> Result<String, String> {
    let out = folder.join("models.rs");
    let pattern = format!("{}/*.toml", folder.display());
    try_generate_with(&pattern, options, &out).map_err(|error| error.to_string())?;
    Ok(std::fs::read_to_string(out).unwrap())
}

#[test]
fn reactions_and_the_self_test_come_on_demand() {
    let folder = folder("on_demand", &[("pendulum.toml", PENDULUM)]);
    let plain = generate(&folder).unwrap();
    let (transmitted, self_test) = ("pub fn transmitted(", "pub fn self_test(");
    assert!(!plain.contains(transmitted) && !plain.contains(self_test));
    let text = with(&folder, Options::default().with_reactions()).unwrap();
    assert!(text.contains(transmitted) && !text.contains(self_test));
    let text = with(&folder, Options::default().with_self_test()).unwrap();
    assert!(!text.contains(transmitted) && text.contains(self_test));
}

#[test]
fn the_equation_of_motion_comes_on_demand() {
    let folder = folder("dynamics", &[("pendulum.toml", PENDULUM)]);
    assert!(!generate(&folder).unwrap().contains("pub fn mass_matrix"));
    let text = with_dynamics(&folder).unwrap();
    for method in ["mass_matrix", "coriolis", "gravity", "effects", "bias", "forward"] {
        assert!(text.contains(&format!("pub fn {method}(")), "{method}");
    }
}

#[test]
fn an_effect_that_is_not_affine_in_accelerations_has_no_equation_of_motion() {
    let effect = r#"
effect = [{ kind = "odd", at = ["q"] }]

[[effect_kind]]
name = "odd"
on = ["coordinate"]
expression = "k*abs(acceleration)"
says = "for a test"

[effect_kind.parameters]
k = { unit = { torque = "kg m^2" }, sign = "any" }
"#;
    let text = format!("{PENDULUM}{effect}");
    let folder = folder("odd", &[("pendulum.toml", &text)]);
    generate(&folder).unwrap_or_else(|error| panic!("the inverse dynamics holds: {error}"));
    let error = with_dynamics(&folder).unwrap_err();
    assert!(
        error.contains("the effect `odd` is not affine in the accelerations"),
        "{error}"
    );
}

/// The number of modules that come from the cache, by a mark that is written into every module in it.
#[test]
fn a_change_of_one_model_derives_that_model_alone() {
    let other = PENDULUM.replace("\"pendulum\"", "\"other\"");
    let folder = folder("cached", &[("a.toml", PENDULUM), ("b.toml", &other)]);
    let first = generate(&folder).unwrap();
    let marked = || {
        for entry in std::fs::read_dir(folder.join("modelmill-modules")).unwrap() {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap().replace("// kept\n", "");
            std::fs::write(path, text + "// kept\n").unwrap();
        }
    };
    let n_kept = |text: &str| text.matches("// kept").count();
    assert_eq!(n_kept(&first), 0);
    // Nothing has changed: both modules are taken from the cache.
    marked();
    assert_eq!(n_kept(&generate(&folder).unwrap()), 2);
    // One model has changed.
    std::fs::write(folder.join("b.toml"), other.replace("9.81", "1.62")).unwrap();
    let changed = generate(&folder).unwrap();
    assert_eq!(n_kept(&changed), 1);
    assert!(changed.contains("1.62"));
    // Other options need other modules.
    let out = folder.join("models.rs");
    let with_test = Options::default().with_self_test();
    try_generate_with(&format!("{}/*.toml", folder.display()), with_test, &out).unwrap();
    assert_eq!(n_kept(&std::fs::read_to_string(out).unwrap()), 0);
}

/// What a model extends is part of it.
#[test]
fn a_change_of_an_extended_model_derives_its_variants() {
    let variant = "schema = 1\nname = \"variant\"\nextends = \"../base-of-variant/pendulum.toml\"\n";
    let base = folder("base-of-variant", &[("pendulum.toml", PENDULUM)]);
    let folder = folder("variant", &[("v.toml", variant)]);
    let first = generate(&folder).unwrap();
    std::fs::write(base.join("pendulum.toml"), PENDULUM.replace("9.81", "1.62")).unwrap();
    let second = generate(&folder).unwrap();
    assert!(!first.contains("1.62") && second.contains("1.62"));
}
