//! `effects` and `add`, libraries of one's own, and forces that are read late.

use crate::common::{printed, ran, run, scratch, workspace};
use serde_json::Value;

fn model(name: &str) -> String {
    crate::common::model(name)
}

fn json(args: &[&str]) -> Value {
    let ran = ran(args);
    assert_eq!(ran.status, 0, "{}", ran.err);
    serde_json::from_str(&ran.out).expect("one JSON object")
}

#[test]
fn the_library_is_listed_and_explained() {
    let all = json(&["effects", "--json"]);
    let kinds = all["kinds"].as_array().expect("kinds");
    // The contract's kinds; a library may have more.
    for kind in "viscous_friction coulomb_friction stribeck_friction load_friction drive_inertia force_offset spring \
                 force_ripple rod_inertia point_mass gravity_tilt time_delay directional_viscous_friction \
                 directional_coulomb_friction coupled_drive lumped_mass_placement"
        .split_whitespace()
    {
        assert!(kinds.iter().any(|one| one["name"] == kind), "{kind}");
        let says = ran(&["effects", kind]);
        assert_eq!(says.status, 0, "{}", says.err);
        assert!(says.out.contains("what it can be confused with"), "{kind}");
    }
    let unknown = ran(&["effects", "magic"]);
    assert_eq!(unknown.status, 1);
    assert!(unknown.err.contains("no kind of effect `magic`"));
}

#[test]
fn adding_shows_the_difference_and_writes_only_when_asked() {
    let file = scratch("add.toml");
    let original = std::fs::read_to_string(model("two_link.toml")).expect("a model");
    std::fs::write(&file, &original).expect("a file");
    let coordinate = "--at";
    let drive = json(&["check", &file, "--json"]);
    assert_eq!(drive["valid"], true);
    let text = |path: &str| std::fs::read_to_string(path).expect("a file");
    let place = first_drive(&original);
    let shown = ran(&["add", &file, "coulomb_friction", coordinate, &place, "--set", "Fc=25.9"]);
    assert_eq!(shown.status, 0, "{}", shown.err);
    assert!(shown.out.contains("\n+kind = \"coulomb_friction\"\n"), "{}", shown.out);
    assert!(shown.err.contains("nothing is written"));
    assert_eq!(text(&file), original);
    let args = ["add", &file, "stribeck_friction", "--at", &place, "--set", "vs=0.05"];
    let more = ["--set", "Fs.name=Fs_here", "--set", "Fs=3", "--in-place"];
    let written = ran(&[&args[..], &more[..]].concat());
    assert_eq!(written.status, 0, "{}", written.err);
    let new = text(&file);
    assert!(new.starts_with(original.trim_end()));
    assert!(new.contains("parameters = { Fs = { name = \"Fs_here\", nominal = 3.0 } }\nconstants = { vs = 0.05 }\n"));
    let again = ran(&[&args[..], &more[..]].concat());
    assert_eq!(again.status, 1);
    assert!(
        again.err.contains("acts at") && again.err.contains("already"),
        "{}",
        again.err
    );
    assert_eq!(text(&file), new);
}

fn first_drive(text: &str) -> String {
    let drive = text.split("[[drive]]").nth(1).expect("a drive");
    drive.split('"').nth(1).expect("its name").to_owned()
}

#[test]
fn adding_what_cannot_be_is_refused() {
    let spidermill = model("spidermill.toml");
    for (args, status, says) in [
        (
            &["coulomb_friction", "--at", "spindle"][..],
            1,
            "known places: `spindle_left`",
        ),
        (&["magic", "--at", "spindle_left"][..], 1, "unknown kind"),
        (
            &["force_ripple", "--at", "spindle_left"][..],
            1,
            "needs a value for `pitch`",
        ),
        (
            &["spring", "--at", "spindle_left", "--set", "c=1"][..],
            1,
            "has no `c`; it has k, rest",
        ),
        (
            &["spring", "--at", "spindle_left", "--set", "k=stiff"][..],
            2,
            "not a finite number",
        ),
        (&["spring", "--at", "spindle_left", "--set", "k"][..], 2, "NAME=VALUE"),
        (&["spring"][..], 2, "--at"),
        (&["lumped_mass_placement", "--at", "R3m"][..], 1, "no lumped mass here"),
        (
            &["spring", "--at", "spindle_left", "--in-place", "--out", "x.toml"][..],
            2,
            "cannot be used with",
        ),
    ] {
        let found = ran(&[&["add", &spidermill][..], args].concat());
        assert_eq!(found.status, status, "{args:?}: {}", found.err);
        assert!(found.err.contains(says), "{args:?}: {}", found.err);
    }
    let own = ran(&[
        "add",
        &spidermill,
        "spring",
        "--at",
        "spindle_left",
        "--out",
        &spidermill,
    ]);
    assert_eq!(own.status, 2, "an input is not overwritten by --out");
}

#[test]
fn a_library_of_ones_own_is_tried_and_kept() {
    let library = scratch("seals.toml");
    let seal = "[[effect_kind]]\nname = \"lip_seal\"\non = \"drive\"\nexpression = \"Fl*tanh(rate/v0)\"\n\
                parameters = { Fl = { unit = { force = \"N\", torque = \"N m\" } } }\n\
                constants = { v0 = { unit = { force = \"m/s\", torque = \"rad/s\" }, value = 0.01 } }\nsays = \"A seal.\"\n";
    std::fs::write(&library, seal).expect("a file");
    let spidermill = model("spidermill.toml");
    let out = scratch("sealed.toml");
    let text = std::fs::read_to_string(&spidermill).expect("a model");
    let add = |library: &[&str], to: &str| {
        let args = ["add", to, "lip_seal", "--at", "spindle_left", "--out", &out];
        ran(&[&args[..], library].concat())
    };
    assert!(add(&[], &spidermill).err.contains("unknown kind"));
    let tried = add(&["--library", &library], &spidermill);
    assert_eq!(tried.status, 0, "{}", tried.err);
    assert_eq!(ran(&["check", &out]).status, 1, "the kind is not in the file");
    assert_eq!(ran(&["check", &out, "--library", &library]).status, 0);
    // Named by the model file itself, relative to it, no option is needed.
    let named = scratch("named.toml");
    let with_key = text.replacen("schema = 1", "schema = 1\nlibrary = \"seals.toml\"", 1);
    std::fs::write(&named, with_key).expect("a file");
    assert_eq!(add(&[], &named).status, 0);
    let checked = ran(&["generate", &out]);
    assert_eq!(checked.status, 0, "{}", checked.err);
    let listed = json(&["effects", "lip_seal", "--model", &out, "--json"]);
    assert_eq!(listed["kinds"][0]["own"], true);
    let broken = scratch("broken.toml");
    std::fs::write(&broken, seal.replace("tanh", "tan")).expect("a file");
    let says = ran(&["effects", "--library", &broken]);
    assert_eq!(says.status, 1);
    assert!(says.err.contains("broken.toml:4"), "{}", says.err);
}

/// The rig's forces come late; the model that says so explains them, and its own force is that of the moment.
#[test]
fn late_forces_are_held_against_earlier_states() {
    let rig = scratch("late-rig.toml");
    let whole = workspace("model-spec/rigs/spidermill-full.toml");
    let late = "[[effect]]\nkind = \"time_delay\"\nat = [\"force\"]\n";
    let head = |base: &str| format!("schema = 1\nname = \"late\"\nextends = {base:?}\n{late}");
    let text = head(whole.to_str().expect("a path")) + "values = { T = 0.0053 }\n";
    std::fs::write(&rig, text).expect("a file");
    let (data, trajectory) = (scratch("late.csv"), run("plain-check.csv"));
    let made = ran(&["simulate", &rig, "--trajectory", &trajectory, "--out", &data]);
    assert_eq!(made.status, 0, "{}", made.err);
    let file = scratch("late.toml");
    let text = head(&model("spidermill.toml")) + "constants = { T = 0.0053 }\n";
    std::fs::write(&file, text).expect("a file");
    let error = |model: &str| {
        let found = json(&["compare", model, "--data", &data, "--json"]);
        let notes = found["data"].to_string();
        (
            found["nrms"].as_f64().expect("a figure"),
            found["samples"].as_u64(),
            notes,
        )
    };
    let (without, samples, _) = error(&model("spidermill.toml"));
    let (with, fewer, notes) = error(&file);
    assert!(without > 0.01 && with < 4e-4, "{without} {with}");
    assert_eq!(fewer, samples.map(|n| n - 3), "three samples at 500 Hz");
    assert!(notes.contains("the first 3 samples have no states"), "{notes}");
    let forces = |model: &str, name: &str| {
        let out = scratch(name);
        assert_eq!(ran(&["evaluate", model, "--data", &data, "--out", &out]).status, 0);
        std::fs::read_to_string(out).expect("forces")
    };
    assert_eq!(forces(&file, "a.csv"), forces(&model("spidermill.toml"), "b.csv"));
}

/// What the recordings with swinging rods need: found from the data, with rods as one effect on both drives.
#[test]
fn rods_are_identified_from_a_recording_with_rods() {
    let file = scratch("rods.toml");
    let both = "spindle_left,spindle_right";
    let spidermill = model("spidermill.toml");
    let added = ran(&["add", &spidermill, "rod_inertia", "--at", both, "--out", &file]);
    // The model extends nothing, so that it may stand anywhere.
    assert_eq!(added.status, 0, "{}", added.err);
    let (fit, check) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let error = |model: &str| {
        let found = json(&["identify", model, "--data", &fit, "--check", &check, "--json"]);
        found["check"]["nrms"].as_f64().expect("a figure")
    };
    let (without, with) = (error(&spidermill), error(&file));
    assert!(with < 1e-5 && without > 20.0 * with, "{without} {with}");
}

#[test]
fn an_effect_at_each_drive_is_one_entry() {
    let out = scratch("each.toml");
    let (arm, kind) = (model("puma560.toml"), "stribeck_friction");
    let added = ran(&[
        "add",
        &arm,
        kind,
        "--at-each",
        "drives",
        "--set",
        "vs=0.1",
        "--set",
        "Fs=2",
        "--out",
        &out,
    ]);
    assert_eq!(added.status, 0, "{}", added.err);
    let text = std::fs::read_to_string(&out).expect("a model");
    assert_eq!(text.matches(kind).count(), 2, "the name and the kind: {text}");
    assert!(text.contains("at_each = \"drives\""), "{text}");
    // The same model as with an entry for each drive.
    let mut single = arm.clone();
    for k in 1..=6 {
        let to = scratch(&format!("single-{k}.toml"));
        let place = format!("joint{k}");
        let added = ran(&[
            "add", &single, kind, "--at", &place, "--set", "vs=0.1", "--set", "Fs=2", "--out", &to,
        ]);
        assert_eq!(added.status, 0, "{}", added.err);
        single = to;
    }
    let told = json(&["diff", &single, &out, "--json"]);
    for key in ["entries", "parameters", "base", "values"] {
        assert_eq!(told[key], serde_json::json!([]), "{key}");
    }
    // It acts there now.
    let again = ran(&["add", &out, kind, "--at", "joint2", "--set", "vs=0.1"]);
    assert!(
        again.status == 1 && again.err.contains("acts at `joint2` already"),
        "{}",
        again.err
    );
    let named = ran(&["add", &arm, "spring", "--at-each", "joint2,joint3", "--set", "k.name=k"]);
    assert!(named.status == 1 && named.err.contains("one name"), "{}", named.err);
}

#[test]
fn a_spring_between_points_is_found_under_spring() {
    let spring = printed(&["effects", "spring"]);
    assert!(spring.contains("see also two_point_element"), "{spring}");
    let unknown = ran(&["effects", "strut"]);
    assert_eq!(unknown.status, 1);
    assert!(
        unknown.err.contains("description of `two_point_element`"),
        "{}",
        unknown.err
    );
}
