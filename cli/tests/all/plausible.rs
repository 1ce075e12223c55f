//! What can be read but makes no sense is said: of recordings, of models, and of what identification finds.

use std::fmt::Write as _;

use crate::common::{Ran, json, model, number, printed, ran, refused, run, scratch};
use serde_json::Value;

/// A cart on a rail, with further lines of its model file.
fn cart(name: &str, mass: &str, more: &str) -> String {
    let file = scratch(&format!("{name}.toml"));
    let text = format!(
        r#"schema = 1
name = "cart"
{more}
[coordinates]
x = {{ nominal = 0 }}

[[frame]]
name = "body"
on = "base"
transform = {{}}
joint = {{ prismatic = "x", axis = "x" }}

[[part]]
on = "body"
mass = {mass}

[[drive]]
name = "motor"
joint = "x"

[[effect]]
name = "viscous"
kind = "viscous_friction"
at = "motor"
parameters = {{ Fv = {{ name = "Fv", nominal = 4 }} }}
"#
    );
    std::fs::write(&file, text).expect("written");
    file
}

const MASS: &str = "[parameters]\nM = { nominal = 3, unit = \"kg\" }";

/// Time, position, rate, acceleration.
fn motion(samples: u32) -> impl Iterator<Item = [f64; 4]> {
    (0..samples).map(|i| {
        let t = f64::from(i) * 0.004;
        let (a, b) = (2.1 * t, 5.3 * t);
        [
            t,
            0.4 * a.sin() + 0.1 * b.cos(),
            0.84 * a.cos() - 0.53 * b.sin(),
            -1.764 * a.sin() - 2.809 * b.cos(),
        ]
    })
}

/// A recording of some of the columns `t`, `x`, `x_d`, `x_dd`, `motor`.
fn recording(name: &str, columns: &str, samples: u32, of: impl Fn([f64; 4]) -> Vec<f64>) -> String {
    let file = scratch(&format!("{name}.csv"));
    let mut text = format!("{columns}\n");
    for state in motion(samples) {
        let fields: Vec<String> = of(state).iter().map(f64::to_string).collect();
        let _ = writeln!(text, "{}", fields.join(","));
    }
    std::fs::write(&file, text).expect("written");
    file
}

const ALL: &str = "t,x,x_d,x_dd,motor";

/// A recording of all columns with the force of a mass, friction, and something that no model knows.
fn whole(name: &str, samples: u32, mass: f64, friction: f64) -> String {
    recording(name, ALL, samples, |[t, x, v, a]| {
        let force = mass * a + friction * v + 0.01 * (40.0 * t).sin();
        vec![t, x, v, a, force]
    })
}

/// Both outputs of a run with `--json` that must succeed: warnings and the object.
#[track_caller]
fn both(args: &[&str]) -> (String, Value) {
    let args: Vec<&str> = args.iter().copied().chain(["--json"]).collect();
    let Ran { status, out, err } = ran(&args);
    assert_eq!(status, 0, "{err}");
    (err, serde_json::from_str(&out).expect("one JSON value"))
}

/// A remark must stand on standard error and in the JSON.
#[track_caller]
fn remarked(args: &[&str], expected: &[&str]) {
    let (err, object) = both(args);
    let notes = object["data"].to_string();
    for part in expected {
        assert!(err.contains(part), "{part} in {err}");
        assert!(notes.contains(part), "{part} in {notes}");
    }
}

/// A mass of 2 kg is no unknown: its force is taken off, also where the truth is another.
#[test]
fn numbers_of_the_model_file_are_not_identified() {
    let known = cart("known", "2.0", "");
    for (truth, fits) in [(2.0, true), (2.5, false)] {
        let data = whole("known", 1500, truth, 3.0);
        let (err, fit) = both(&["identify", &known, "--data", &data]);
        assert!(err.contains("It is known and not identified"), "{err}");
        let parameters = fit["parameters"].as_array().expect("parameters");
        let [one, friction] = parameters.as_slice() else {
            panic!("{fit:#}");
        };
        assert_eq!((&one["status"], &one["std"]), (&"known".into(), &Value::Null));
        assert_eq!(one["value"], 1.0);
        assert!((number(friction, "/value") - 3.0).abs() < 0.05, "{friction}");
        assert_eq!(number(&fit, "/fit/nrms") < 0.01, fits, "{fit:#}");
    }
    // The same file serves `--parameters`, and a known summand does not hide what is unknown.
    let fit = scratch("known.json");
    let data = whole("known-fit", 1500, 2.0, 3.0);
    let text = printed(&["identify", &known, "--data", &data, "--out", &fit]);
    assert!(
        text.contains("1 base parameter from") && text.contains("known"),
        "{text}"
    );
    let compared = json(&["compare", &known, "--data", &data, "--parameters", &fit, "--json"]);
    assert!(number(&compared, "/nrms") < 0.01);
    let mixed = cart("mixed", "\"M + 1\"", MASS);
    let fit = json(&["identify", &mixed, "--data", &data, "--json"]);
    assert!((number(&fit, "/parameters/0/value") - 2.0).abs() < 0.01, "{fit:#}");
    assert!(fit["parameters"][0].get("status").is_none());
    let only = cart("only", "2.0", "remove = []");
    let text = std::fs::read_to_string(&only).expect("a model");
    let text = text.split("[[effect]]").next().unwrap_or("").replace("remove = []", "");
    std::fs::write(&only, text).expect("written");
    let says = refused(1, &["identify", &only, "--data", &data]);
    assert!(says.contains("nothing to identify"), "{says}");
}

#[test]
fn no_deviation_without_a_degree_of_freedom() {
    let model = cart("freedom", "\"M\"", MASS);
    let two = whole("two", 2, 3.0, 4.0);
    let (err, fit) = both(&["identify", &model, "--data", &two]);
    assert!(
        err.contains("2 equations") && err.contains("no degree of freedom"),
        "{err}"
    );
    for k in 0..2 {
        assert_eq!(fit["parameters"][k]["std"], Value::Null);
    }
    let text = printed(&["identify", &model, "--data", &two]);
    assert!(text.contains('—') && !text.contains("not determined"), "{text}");
    let one = whole("one", 1, 3.0, 4.0);
    let says = refused(1, &["identify", &model, "--data", &one]);
    assert!(says.contains("1 equation for 2 unknown base parameters"), "{says}");
}

#[test]
fn impossible_values_are_pointed_out() {
    let model = cart("negative", "\"M\"", MASS);
    let data = whole("negative", 1500, 3.0, -0.5);
    remarked(
        &["identify", &model, "--data", &data],
        &["p2_min = Fv is estimated as -0.", "must be positive"],
    );
    let data = whole("heavy", 1500, -3.0, 0.5);
    remarked(
        &["identify", &model, "--data", &data],
        &["p1_min = M is estimated as -", "must be positive"],
    );
    let (err, _) = both(&["identify", &model, "--data", &whole("fine", 1500, 3.0, 0.5)]);
    assert!(!err.contains("physically possible"), "{err}");
    let model = cart("light", "\"M\"", &MASS.replace('3', "-3"));
    // A mass below zero is no valid value, although the equations are right.
    let ended = ran(&["check", &model, "--json"]);
    let checked: Value = serde_json::from_str(&ended.out).expect("JSON");
    assert_eq!(
        (ended.status, &checked["valid"]),
        (1, &Value::Bool(false)),
        "{checked:#}"
    );
    assert!(checked["diagnostics"].to_string().contains("is -3 kg"), "{checked:#}");
    let text = ran(&["check", &model]);
    assert!(
        text.status == 1 && text.out.contains(": not valid: with nominal values the mass of"),
        "{}",
        text.out
    );
}

#[test]
fn slips_of_a_recording_are_said() {
    let model = cart("slips", "\"M\"", MASS);
    let milliseconds = recording("ms", ALL, 1500, |[t, x, v, a]| {
        vec![1e3 * t, x, v, a, 3.0 * a + 4.0 * v]
    });
    remarked(
        &["compare", &model, "--data", &milliseconds],
        &["about 1000 times", "time seems to be in ms", "`x_d`, `x_dd`"],
    );
    let turned = recording("turned", ALL, 1500, |[t, x, v, a]| {
        vec![t, x, -v, -a, 3.0 * a + 4.0 * v]
    });
    remarked(&["compare", &model, "--data", &turned], &["`x_d`", "the signs differ"]);
    let bundled = ran(&[
        "compare",
        &crate::common::model("spidermill.toml"),
        "--data",
        &run("with-rods-fit.csv"),
    ]);
    assert_eq!(bundled.err, "");
}

#[test]
fn a_recording_given_twice_is_said() {
    let model = cart("twins", "\"M\"", MASS);
    let (data, other) = (whole("twin", 1500, 3.0, 4.0), whole("other", 1400, 3.0, 4.0));
    let copy = scratch("copy.csv");
    std::fs::copy(&data, &copy).expect("a copy");
    remarked(
        &["identify", &model, "--data", &data, "--data", &copy],
        &["copy.csv are the same recording", "it has double weight"],
    );
    remarked(
        &["identify", &model, "--data", &data, "--check", &data],
        &["such a validation proves nothing"],
    );
    let (err, _) = both(&["identify", &model, "--data", &data, "--check", &other]);
    assert_eq!(err, "");
}

/// Positions jump across a gap; with a filter across it the error would be huge.
#[test]
fn stretches_between_gaps_are_prepared_each_on_its_own() {
    let model = cart("gap", "\"M\"", MASS);
    let data = recording("gap", "t,x,motor", 3000, |[t, x, v, a]| {
        let (t, x) = if t < 6.0 { (t, x) } else { (t + 2.0, x + 3.0) };
        vec![t, x, 3.0 * a + 4.0 * v]
    });
    remarked(
        &["compare", &model, "--data", &data],
        &[
            "1 gap in time",
            "the 2 segments are filtered and differentiated separately",
        ],
    );
    let compared = json(&["compare", &model, "--data", &data, "--json"]);
    assert!(number(&compared, "/nrms") < 5e-3, "{compared:#}");
    let forces = printed(&["evaluate", &model, "--data", &data]);
    let samples = usize::try_from(compared["samples"].as_u64().expect("a count")).expect("small");
    assert_eq!(forces.lines().count(), samples + 1);
}

#[test]
fn undetermined_parameters_stay_where_it_is_said() {
    let model = cart("still", "\"M\"", MASS);
    let data = recording("still", ALL, 300, |[t, x, _, a]| vec![t, x, 0.0, a, 3.0 * a]);
    let (err, fit) = both(&["identify", &model, "--data", &data]);
    assert!(
        err.contains("Fv has no effect on these samples; it stays at p2_min = 4.00000 N s/m (its nominal value)"),
        "{err}"
    );
    assert_eq!(fit["parameters"][1]["status"], "undetermined");
    let data = recording("tied", ALL, 300, |[t, x, v, _]| vec![t, x, v, 2.0 * v, 14.0 * v]);
    let (err, _) = both(&["identify", &model, "--data", &data]);
    assert!(
        err.contains("nearest to the nominal ones are used: p1_min = ") && err.contains("(nominal 3.00000)"),
        "{err}"
    );
}

#[test]
fn a_fit_knows_the_constants_it_was_made_with() {
    let constants = |k: f64, unused: f64| {
        format!(
            "[constants]\nk = {{ value = {k}, unit = \"1\" }}\ng = {{ value = {unused}, unit = \"m/s^2\" }}\n{MASS}\n\
             m = {{ nominal = 1, unit = \"kg\" }}\n"
        )
    };
    let gravity = |name: &str, k: f64, g: f64| {
        cart(
            name,
            "\"M + k*m\"",
            &format!("gravity = [0, \"-g\", 0]\n{}", constants(k, g)),
        )
    };
    let model = gravity("constants", 2.0, 9.81);
    let data = whole("constants", 1500, 5.0, 4.0);
    let fit = scratch("constants.json");
    printed(&["identify", &model, "--data", &data, "--out", &fit]);
    let compare = |model: &str| ran(&["compare", model, "--data", &data, "--parameters", &fit]);
    assert_eq!(compare(&model).err, "");
    let elsewhere = compare(&gravity("elsewhere", 2.0, 1.62));
    assert!(
        elsewhere.status == 0 && elsewhere.err.contains("g = 9.81") && elsewhere.err.contains("g = 1.62"),
        "{}",
        elsewhere.err
    );
    let other = compare(&gravity("other", 2.5, 9.81));
    assert!(
        other.status == 1 && other.err.contains("k = 2") && other.err.contains("identify again"),
        "{}",
        other.err
    );
}

#[test]
fn columns_of_one_letter_are_not_proposed_for_one_another() {
    let model = cart("letters", "\"M\"", MASS);
    for columns in ["t,y,motor", "s,x,motor", "t,s,motor"] {
        let data = recording("letters", columns, 50, |[t, x, ..]| vec![t, x, 0.0]);
        let says = refused(1, &["compare", &model, "--data", &data]);
        assert!(!says.contains("did you mean") && says.contains("--map"), "{says}");
    }
    // A column that the model itself wants is not proposed for another one.
    let data = recording("theta", "t,theta1,motor", 50, |[t, x, ..]| vec![t, x, 0.0]);
    let says = refused(
        1,
        &["compare", &crate::common::model("spidermill.toml"), "--data", &data],
    );
    assert!(
        says.contains("there is no column `theta2`. The columns are") && !says.contains("did you mean"),
        "{says}"
    );
}

#[test]
fn effects_are_told_in_the_names_of_the_model() {
    let (before, after) = (cart("plain", "\"M\"", MASS), scratch("dry.toml"));
    let text = std::fs::read_to_string(&before).expect("a model");
    std::fs::write(
        &after,
        text.replace("viscous_friction", "coulomb_friction").replace("Fv", "Fc"),
    )
    .expect("written");
    let diff = printed(&["diff", &before, &after]);
    assert!(
        diff.contains("viscous_friction at motor: Fv*x_d") && diff.contains("Fc*sign(x_d)"),
        "{diff}"
    );
}

#[cfg(unix)]
#[test]
fn an_input_is_not_overwritten_through_a_link() {
    let model = cart("linked", "\"M\"", MASS);
    let before = std::fs::read_to_string(&model).expect("a model");
    let (hard, soft) = (scratch("hard.rs"), scratch("soft.rs"));
    std::fs::hard_link(&model, &hard).expect("a link");
    std::os::unix::fs::symlink(&model, &soft).expect("a link");
    for out in [hard, soft] {
        let says = refused(2, &["generate", &model, "--out", &out]);
        assert!(says.contains("overwrite"), "{says}");
    }
    assert_eq!(std::fs::read_to_string(&model).expect("a model"), before);
}

#[test]
fn a_product_that_cannot_be_retained_is_said() {
    let model = cart("retain", "\"M\"", &format!("retain = [\"M^2\", \"M\"]\n{MASS}"));
    let says = ran(&["check", &model]);
    assert!(
        says.status == 0
            && says
                .err
                .contains("`M^2` of `retain` cannot be retained: there is no such product")
            && !says.err.contains("`M` of")
            && says.err.contains("retain.toml:"),
        "{}",
        says.err
    );
    let file = scratch("no-effect.toml");
    let text = std::fs::read_to_string(crate::common::model("spidermill.toml")).expect("a model");
    let head = text.find("\n[").expect("a table");
    let (top, tables) = text.split_at(head);
    std::fs::write(&file, format!("{top}\nretain = [\"m1\"]\n{tables}")).expect("written");
    let checked = json(&["check", &file, "--json"]);
    assert!(
        checked["diagnostics"].to_string().contains("its column is zero"),
        "{checked:#}"
    );
}

/// A crank of no length: the slider stands still, whatever the exact reduction for general lengths says.
#[test]
fn special_values_that_lower_the_rank_are_said_by_check() {
    let text = r#"
schema = 1
name = "slider_crank"
constants = { r = { value = 0.1, unit = "m" }, l = { value = 0.3, unit = "m" } }
coordinates = { q = { nominal = 0.5 }, b = { nominal = -0.66, passive = true }, x = { nominal = 0.38, passive = true } }
frame = [
    { name = "crank", on = "base", modified_dh = { theta = "q" } },
    { name = "rod", on = "crank", modified_dh = { a = "r", theta = "b" } },
    { name = "slider", on = "base", joint = { prismatic = "x", axis = "x" } },
]
point = [{ name = "end", on = "rod", at = ["l", 0] }, { name = "pin", on = "slider", at = [0, 0] }]
part = [
    { on = "crank", linear = { planar = 1 } },
    { on = "rod", linear = { planar = 2 } },
    { on = "slider", linear = { planar = 3 } },
]
loop = [{ joins = ["end", "pin"] }]
drive = [{ name = "motor", joint = "q" }]
"#;
    let file = scratch("slider.toml");
    std::fs::write(&file, text).expect("written");
    let sound = ran(&["check", &file]);
    assert!(sound.status == 0 && sound.err.is_empty(), "{}", sound.err);
    assert!(sound.out.contains("slider_crank (the file's `name`)"), "{}", sound.out);
    let special = text
        .replace("r = { value = 0.1,", "r = { value = 0,")
        .replace("nominal = 0.38", "nominal = 0.3")
        .replace("-0.66", "-0.5");
    std::fs::write(&file, special).expect("written");
    let checked = ran(&["check", &file]);
    assert!(
        checked.status == 0 && checked.err.contains("with the file's values the numeric rank is"),
        "{}",
        checked.err
    );
    let object = json(&["check", &file, "--json"]);
    assert_eq!(object["model"], "slider");
    assert_eq!(object["module"], "slider_crank");
    assert!(object["diagnostics"].to_string().contains("numeric rank"), "{object:#}");
}

/// The numbers of a recording are rounded; where that shows says nothing of the robot.
#[test]
fn errors_of_rounding_have_no_place() {
    let args = ["compare", &model("spidermill.toml"), "--data", &run("plain-check.csv")];
    let (_, compared) = both(&args);
    assert!(number(&compared, "/nrms") < 1e-6);
    assert_eq!(compared["where"], Value::Array(Vec::new()));
    assert!(printed(&args).contains("there is nothing to find"));
}

/// In the plane of an arm that lies flat nothing weighs; the cosine of a right angle is no zero but rounding, which must
/// not count as a column.
#[test]
fn special_values_are_told_by_the_numeric_rank() {
    let text = std::fs::read_to_string(model("two_link.toml")).expect("a model");
    let tilted = text.replace("\"-g\"", "\"-g*cos(tilt)\"").replace(
        "[constants]",
        "[constants]\ntilt = { value = 1.5707963267948966, unit = \"rad\" }",
    );
    assert_ne!(text, tilted);
    let file = scratch("flat.toml");
    std::fs::write(&file, tilted).expect("written");
    let ran = ran(&["equations", &file, "--json"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    let equations: Value = serde_json::from_str(&ran.out).expect("one JSON value");
    assert_eq!(equations["rank"]["exact"], 6);
    assert_eq!(equations["rank"]["numeric"], 4);
    assert!(
        ran.err.contains("the numeric rank is 4, below the exact 6") && ran.err.contains("2 directions undetermined"),
        "{}",
        ran.err
    );
}

/// Two folding legs in planes at right angles hold a platform so that it only rises: Sarrus's linkage.
const SARRUS: &str = r#"
schema = 1
name = "sarrus"
gravity = [0, 0, "-g"]
constants = { L = { value = 0.4, unit = "m" }, a = { value = 0.2, unit = "m" }, g = { value = 9.81, unit = "m/s^2" } }

frame = [
    { name = "plat", on = "base", joint = { prismatic = "z", axis = "z" } },
    { name = "p0", on = "base", transform = { xyz = ["a", 0, 0] }, joint = { revolute = "q0", axis = "y" } },
    { name = "d0", on = "p0", transform = { xyz = ["L", 0, 0] }, joint = { revolute = "e0", axis = "y" } },
    { name = "s1", on = "base", transform = { rpy = [0, 0, "pi/2"] } },
    { name = "p1", on = "s1", transform = { xyz = ["a", 0, 0] }, joint = { revolute = "q1", axis = "y" } },
    { name = "d1", on = "p1", transform = { xyz = ["L", 0, 0] }, joint = { revolute = "e1", axis = "y" } },
]
point = [
    { name = "P1", on = "d0", at = ["L", 0, 0] },
    { name = "P2", on = "plat", at = ["a", 0, 0] },
    { name = "P3", on = "d1", at = ["L", 0, 0] },
    { name = "P4", on = "plat", at = [0, "a", 0] },
]
part = [
    { on = "plat", linear = { M = "M_plat" } },
    { on = "p0", linear = { all = "_p0" } },
    { on = "d0", linear = { all = "_d0" } },
    { on = "p1", linear = { all = "_p1" } },
    { on = "d1", linear = { all = "_d1" } },
]
parameters = { M_plat = { unit = "kg" } }
loop = [{ joins = ["P1", "P2"] }, { joins = ["P3", "P4"] }]
drive = [{ name = "motor", joint = "q0" }]

[coordinates]
z = { nominal = 0.451714, passive = true }
q0 = { nominal = -0.6 }
e0 = { nominal = -1.941593, passive = true }
q1 = { nominal = -0.6, passive = true }
e1 = { nominal = -1.941593, passive = true }
"#;

/// Random states are no neighbours: followed from one to the next, Newton's method ends at singular poses, although each
/// state has its answer. That took the whole rank away.
#[test]
fn a_numeric_rank_survives_states_that_have_no_answer() {
    let file = scratch("sarrus.toml");
    std::fs::write(&file, SARRUS).expect("written");
    let checked = ran(&["check", &file]);
    // All that there is to say is how the base was found.
    assert!(
        checked.status == 0 && checked.err.lines().count() == 1 && checked.err.contains("were computed numerically"),
        "{}",
        checked.err
    );
    assert!(checked.out.contains("numeric rank        5 over"), "{}", checked.out);
    let object = json(&["check", &file, "--json"]);
    assert_eq!(object["numeric_rank"]["rank"], 5);
    assert!(number(&object, "/numeric_rank/gap") > 1e6, "{object:#}");
    let equations = json(&["equations", &file, "--json"]);
    // What was found in numbers is not called exact.
    assert!(equations["rank"]["exact"].is_null());
    assert_eq!(equations["rank"]["numeric"], 5);
    // Where a term has no value at some rates, those states are left out, counted, and said.
    let slip = of_joint1("c*sqrt(1 + rate/v)", &["c"]);
    let text = std::fs::read_to_string(model("two_link.toml")).expect("a model");
    std::fs::write(&file, text + &slip).expect("written");
    let object = json(&["check", &file, "--json"]);
    assert_eq!(object["numeric_rank"]["samples"], 40);
    assert!(number(&object, "/numeric_rank/left_out") > 0.0, "{object:#}");
    let checked = printed(&["check", &file]);
    assert!(
        checked.contains("more left out, where the model is singular or undefined"),
        "{checked}"
    );
    let said = ran(&["equations", &file]).err;
    assert!(said.contains("note: ") && said.contains("more left out"), "{said}");
}

/// A kind of effect of its own at the first joint of the two-link arm.
fn of_joint1(expression: &str, parameters: &[&str]) -> String {
    let unit = "{ unit = { force = \"N\", torque = \"N m\" } }";
    let parameters: Vec<String> = parameters.iter().map(|p| format!("{p} = {unit}")).collect();
    format!(
        r#"
[[effect]]
kind = "slip"
at = ["joint1"]

[[effect_kind]]
name = "slip"
on = "drive"
expression = "{expression}"
parameters = {{ {} }}
constants = {{ v = {{ unit = {{ force = "m/s", torque = "rad/s" }}, value = 1.2 }} }}
says = "A term of a test."
"#,
        parameters.join(", ")
    )
}

/// Terms that hardly differ spread the singular values so evenly that none of their gaps stands out.
#[test]
fn a_rank_without_a_clear_gap_is_said_to_be_none() {
    let names = ["c0", "c1", "c2", "c3", "c4", "c5", "c6"];
    let terms: Vec<String> = names
        .iter()
        .enumerate()
        .map(|(k, c)| format!("{c}*tanh({}*rate/v)", 1.0 + 0.01 * k as f64))
        .collect();
    let text = std::fs::read_to_string(model("two_link.toml")).expect("a model");
    let file = scratch("near.toml");
    std::fs::write(&file, text + &of_joint1(&terms.join(" + "), &names)).expect("written");
    let gap = number(&json(&["check", &file, "--json"]), "/numeric_rank/gap");
    assert!(gap > 1.0 && gap < 1e3, "{gap}");
    for command in ["check", "equations"] {
        let said = ran(&[command, &file]).err;
        assert!(said.contains("is based on a small gap of"), "{said}");
    }
    // The condition of the columns that are retained is poor, and the note beside the page says what the rank is worth.
    let said = ran(&["equations", &file]).err;
    assert!(said.contains("note: ") && said.contains("condition number"), "{said}");
    let sound = ran(&["equations", &model("two_link.toml")]);
    assert_eq!(sound.err, "");
}

/// Wrong signs and units of a file show in three figures: gravity, mass and size.
#[test]
fn magnitudes_show_wrong_signs_and_units() {
    let arm = std::fs::read_to_string(model("two_link.toml")).expect("a model");
    let file = scratch("magnitudes.toml");
    let checked = |text: &str| {
        std::fs::write(&file, text).expect("written");
        json(&["check", &file, "--json"])["magnitudes"].clone()
    };
    let found = checked(&arm);
    assert!((number(&found, "/gravity/vector/1") + 9.81).abs() < 1e-12, "{found:#}");
    assert!(found["gravity"]["remark"].is_null(), "{found:#}");
    assert!((number(&found, "/total_mass") - 6.3).abs() < 1e-12, "{found:#}");
    // All frames and points are within the first link of 0.5 m, in the plane.
    for (axis, least, most) in [(0, 0.3, 1.0), (1, 0.2, 1.0), (2, 0.0, 0.0)] {
        let [low, high] = [0, 1].map(|end| number(&found, &format!("/extent/{axis}/{end}")));
        assert!(
            (least..=most).contains(&(high - low)) && low >= -0.5 && high <= 0.5,
            "{found:#}"
        );
    }
    let up = checked(&arm.replace("\"-g\"", "\"g\""));
    assert!(up["gravity"]["remark"].to_string().contains("points up"), "{up:#}");
    let strong = checked(&arm.replace("9.81", "981"));
    assert!(
        strong["gravity"]["remark"]
            .to_string()
            .contains("not the gravity of the Earth"),
        "{strong:#}"
    );
    // A length in millimetres is a thousand times as large.
    let large = checked(&arm.replace("L = { value = 0.5", "L = { value = 500"));
    let ratio = number(&large, "/extent/0/1") / number(&found, "/extent/0/1");
    assert!((ratio - 1000.0).abs() < 1e-6, "{ratio}");
    // A mass that the file does not give makes the sum unknown.
    let partly = checked(&arm.replace(", M = 2.1", ""));
    assert!(partly["total_mass"].is_null(), "{partly:#}");
}

/// An angle of a quarter turn is a rounded number: the arm stays in its plane, and the text states a size of 0 across it.
#[test]
fn rounded_angles_leave_no_size_across_a_plane() {
    let [robot, file] = ["quarter_turn.urdf", "quarter_turn.toml"].map(scratch);
    let inertial = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    let joint = |name: &str, parent: &str, child: &str, origin: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin {origin}/><axis xyz=\"0 0 1\"/></joint>"
        )
    };
    let text = format!(
        "<robot name=\"r\"><link name=\"base\"/><link name=\"a\">{inertial}</link><link name=\"b\">{inertial}</link>{}{}</robot>",
        joint("ja", "base", "a", "rpy=\"1.5707963267948966 0 0\""),
        joint("jb", "a", "b", "xyz=\"0.3 0 0\"")
    );
    std::fs::write(&robot, text).expect("written");
    printed(&["import", &robot, "--out", &file]);
    let text = printed(&["check", &file]);
    let size = text
        .lines()
        .find(|line| line.contains(" m along x, y, z"))
        .expect("a size");
    let sides: Vec<f64> = size
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .take(3)
        .collect();
    assert!(sides[0] > 0.1 && sides[2] > 0.1 && sides[1].abs() == 0.0, "{size}");
}
