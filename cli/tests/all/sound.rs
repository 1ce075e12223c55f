//! Nothing is called sound that is not: bases that lose the digits, numbers that are none, reductions that hold for one
//! geometry only.

use std::fmt::Write as _;

use crate::common::{json, model, printed, ran, refused, run, scratch, workspace};

/// Two links; the second carries masses at four corners of a rectangle before the body to which they belong. In general
/// four places tell four columns apart, on a circle only three. `retain` is what the file asks to keep.
fn masses_on_a_circle(name: &str, retain: &str) -> String {
    let corners = [(0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)];
    let [mut constants, mut parameters, mut masses] = [(); 3].map(|()| String::new());
    for (k, (x, y)) in corners.into_iter().enumerate() {
        // Off the circle by rounding.
        let x = x * (1.0 + 1e-15 * k as f64);
        let _ = writeln!(constants, "x{k} = {{ value = {x:?}, unit = \"m\" }}");
        let _ = writeln!(constants, "y{k} = {{ value = {y:?}, unit = \"m\" }}");
        let _ = writeln!(parameters, "m{k} = {{ nominal = {k}.5, unit = \"kg\" }}");
        let _ = writeln!(masses, "[[lumped_mass]]\nmass = \"m{k}\"\non = \"link2\"");
        let _ = writeln!(masses, "at = [\"x{k}\", \"y{k}\", 0]");
    }
    let text = std::fs::read_to_string(model("two_link.toml"))
        .expect("a model")
        .replace("[constants]\n", &format!("[constants]\n{constants}"))
        .replace("[coordinates]", &format!("[parameters]\n{parameters}\n[coordinates]"))
        .replace(
            "[[part]]\nname = \"fore\"",
            &format!("{masses}[[part]]\nname = \"fore\""),
        )
        .replace("gravity =", &format!("{retain}\ngravity ="));
    let path = scratch(name);
    std::fs::write(&path, text).expect("a model");
    path
}

/// What cannot be kept together.
const ALL_MASSES: &str = "retain = [\"m0\", \"m1\", \"m2\", \"m3\"]";

/// Left to itself the reduction keeps columns that hold at the file's values.
#[test]
fn a_base_that_would_lose_the_digits_is_not_chosen() {
    let path = masses_on_a_circle("masses_left_alone.toml", "");
    let told = json(&["check", &path, "--json"]);
    assert_eq!(told["valid"], true);
    let condition = told["numeric_rank"]["condition_number"].as_f64();
    assert!(condition.is_some_and(|c| c < 1e3), "{told:#}");
}

#[test]
fn a_base_that_loses_the_digits_is_refused_by_every_command() {
    let path = masses_on_a_circle("masses_on_a_circle.toml", ALL_MASSES);
    let out = scratch("masses_on_a_circle.rs");
    let two_link = model("two_link.toml");
    for args in [
        vec!["check", &path],
        vec!["equations", &path],
        vec!["diff", &two_link, &path],
        vec!["generate", &path, "--out", &out],
        vec!["evaluate", &path, "--data", "none.csv"],
        vec!["identify", &path, "--data", "none.csv"],
        vec!["compare", &path, "--data", "none.csv"],
        vec!["diagnose", &path, "--data", "none.csv"],
    ] {
        let says = refused(1, &args);
        for word in ["m0, m1, m2, m3", "retain = [", "masses_on_a_circle.toml"] {
            assert!(says.contains(word), "{args:?}: {says}");
        }
    }
    assert!(!std::path::Path::new(&out).exists());
    let told = ran(&["check", &path, "--json"]);
    assert_eq!(told.status, 1);
    let told: serde_json::Value = serde_json::from_str(&told.out).expect("JSON");
    assert_eq!(told["valid"], false);
    assert_eq!(told["diagnostics"][0]["severity"], "error");
}

/// What the refusal advises mends the model.
#[test]
fn the_advice_of_the_refusal_holds() {
    let path = masses_on_a_circle("masses_to_be_mended.toml", ALL_MASSES);
    let says = refused(1, &["check", &path]);
    let from = says.find("retain = [").expect("advice");
    let until = from + says[from..].find(']').expect("a list") + 1;
    let advice = says[from..until].replace('\n', " ");
    let text = std::fs::read_to_string(&path).expect("the model");
    let mended = scratch("masses_on_a_circle_mended.toml");
    let text = text.replace(ALL_MASSES, &advice);
    std::fs::write(&mended, text).expect("a model");
    let told = json(&["check", &mended, "--json"]);
    assert_eq!(told["valid"], true);
    assert!(told["numeric_rank"]["condition_number"].is_number(), "{told:#}");
}

/// Words of a text, without what programs call so.
fn words(text: &str) -> impl Iterator<Item = String> + '_ {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    text.split(move |c| !is_part(c)).map(str::to_lowercase)
}

#[test]
fn a_numeric_reduction_says_so_in_every_format() {
    let path = workspace("tests/fixtures/awkward/many_roots.toml")
        .display()
        .to_string();
    let two_link = model("two_link.toml");
    let module = scratch("many_roots.rs");
    let generated = ran(&["generate", &path, "--out", &module]);
    assert_eq!(generated.status, 0, "{}", generated.err);
    let mut texts = vec![
        ("check", printed(&["check", &path])),
        ("diff", printed(&["diff", &two_link, &path])),
        ("generate", std::fs::read_to_string(&module).expect("a module")),
    ];
    for format in ["text", "markdown", "latex", "html"] {
        texts.push((format, printed(&["equations", &path, "--format", format])));
    }
    for (what, text) in &texts {
        assert!(words(text).any(|word| word == "numerically"), "{what}: {text}");
        let exact = words(text).find(|word| word.starts_with("exact"));
        assert_eq!(exact, None, "{what}");
    }
    let equations = json(&["equations", &path, "--json"]);
    assert!(equations["rank"]["exact"].is_null());
    assert_eq!(equations["rank"]["method"]["name"], "numeric");
    let checked = json(&["check", &path, "--json"]);
    assert_eq!(checked["reduction"]["name"], "numeric");
    assert!(checked["reduction"]["because"].is_string());
    let differs = json(&["diff", &two_link, &path, "--json"]);
    assert_eq!(differs["after"]["reduction"]["name"], "numeric");
    assert!(differs["before"]["reduction"].is_null());
}

#[test]
fn a_rig_that_is_too_large_to_reckon_with_writes_nothing() {
    let text = std::fs::read_to_string(workspace("model-spec/rigs/spidermill-full.toml")).expect("a rig");
    let at = text.find("centre = [").expect("a centre");
    let end = at + text[at..].find(']').expect("three numbers") + 1;
    let far = format!("{}centre = [1e200, 0.0, 0.0]{}", &text[..at], &text[end..]);
    let rig = scratch("far_centre.toml");
    std::fs::write(&rig, far).expect("a rig");
    let out = scratch("far_centre.csv");
    let says = refused(
        1,
        &["simulate", &rig, "--trajectory", &run("plain-check.csv"), "--out", &out],
    );
    for word in ["is not finite", "centre of the body", "1e200", "far_centre.toml"] {
        assert!(says.contains(word), "{says}");
    }
    assert!(!std::path::Path::new(&out).exists());
}

/// A kind of one's own that divides by what passes through zero is refused by itself; all others are looked at.
#[test]
fn a_candidate_without_a_finite_value_does_not_stop_a_diagnosis() {
    let run = scratch("through_zero.csv");
    let mut text = String::from("t,q1,q2,q1_d,q2_d,q1_dd,q2_dd\n");
    for k in 0..400 {
        let t = 0.02 * f64::from(k);
        // Starts at zero, where the kind below has no value.
        let [q, qd, qdd] = [(1.3 * t).sin(), 1.3 * (1.3 * t).cos(), -1.69 * (1.3 * t).sin()];
        let [p, pd, pdd] = [(2.1 * t).cos(), -2.1 * (2.1 * t).sin(), -4.41 * (2.1 * t).cos()];
        let _ = writeln!(text, "{t},{q},{p},{qd},{pd},{qdd},{pdd}");
    }
    std::fs::write(&run, &text).expect("a motion");
    let forces = printed(&["evaluate", &model("two_link.toml"), "--data", &run]);
    // Forces go beside the motion.
    let joined: Vec<String> = (text.lines().zip(forces.lines()))
        .map(|(motion, force)| {
            let (_, force) = force.split_once(',').expect("time and forces");
            format!("{motion},{force}")
        })
        .collect();
    std::fs::write(&run, joined.join("\n")).expect("a recording");
    let kinds = scratch("one_over.toml");
    let library = "[[effect_kind]]\nname = \"one_over\"\non = \"drive\"\nexpression = \"K/coordinate\"\n\
                   parameters = { K = { unit = { force = \"N m\", torque = \"N m\" } } }\n\
                   says = \"A force that grows without end near zero.\"\n";
    std::fs::write(&kinds, library).expect("a library");
    let two_link = model("two_link.toml");
    let told = json(&["diagnose", &two_link, "--data", &run, "--library", &kinds, "--json"]);
    assert_eq!(told["verdict"], "adequate", "{told:#}");
    let candidates = told["candidates"].as_array().expect("candidates");
    let of = |kind: &str| -> Vec<&serde_json::Value> { candidates.iter().filter(|c| c["kind"] == kind).collect() };
    let undefined = of("one_over")
        .into_iter()
        .filter(|c| c["refused"].as_str().is_some_and(|why| why.contains("no finite value")));
    assert!(undefined.count() >= 1, "{told:#}");
    assert!(!of("viscous_friction").is_empty());
}
