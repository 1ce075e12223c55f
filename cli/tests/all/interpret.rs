//! `interpret` gives back Table 1 of the paper, says what is not determined, and refuses nonsense.

use crate::common::{json, model, number, printed, refused, run, scratch};
use serde_json::{Value, json};

/// Names and values: the estimated column of Table 1, with what it holds as known.
const TABLE_1: [(&str, f64); 8] = [
    ("m1", 50.9597),
    ("m2", 15.9794),
    ("m3", 14.5773),
    ("m4", 5.9203),
    ("dc1", 0.565),
    ("dc3", 0.833),
    ("Ic12", 4.9733),
    ("Ic32", 0.2162),
];

/// A fit as `identify` writes it, with base parameters as eq. (16) of the paper yields them for Table 1.
fn table_1(name: &str) -> String {
    let value = |name: &str| TABLE_1.iter().find(|(n, _)| *n == name).unwrap().1;
    let [m1, m2, m3, m4, dc1, dc3, ic12, ic32] = TABLE_1.map(|(name, _)| value(name));
    let (d1, d3) = (1.13, 1.03);
    let lumped = m2 + m3 + dc3 / (2.0 * d3) * m4;
    let eq_16 = [
        d1 * lumped + dc1 * m1,
        d1 * d1 * lumped + dc1 * dc1 * m1 + ic12,
        dc3 * m3 + dc3 / 2.0 * m4,
        m4 - dc3 / d3 * m4,
        2.0 * dc3 * dc3 * m3 + dc3 * dc3 * m4 + 2.0 * ic32,
    ];
    let equations = json(&["equations", &model("spidermill-paper.toml"), "--json"]);
    let parameters: Vec<Value> = equations["base"]
        .as_array()
        .unwrap()
        .iter()
        .zip(eq_16)
        .map(|(base, value)| {
            json!({ "name": base["name"], "expression": base["expression"], "value": value, "std": 0.01, "unit": "" })
        })
        .collect();
    let fit = json!({
        "model": "spidermill-paper",
        "samples": 1,
        "condition_number": 1.0,
        "parameters": parameters,
        "fit": { "nrms": 0.0, "rms": 0.0, "samples": 1, "channels": {} },
        "check": null,
    });
    let path = scratch(name);
    std::fs::write(&path, fit.to_string()).unwrap();
    path
}

fn interpret(fit: &str, unknown: &str) -> Value {
    let model = model("spidermill-paper.toml");
    json(&["interpret", &model, "--fit", fit, "--unknown", unknown, "--json"])
}

#[test]
fn table_1_comes_back_with_the_second_real_solution_beside_it() {
    let found = interpret(&table_1("table-1.json"), "m2,m4,dc3,Ic12,Ic32");
    assert_eq!(found["identifiable"], true);
    let solutions = found["solutions"].as_array().unwrap();
    assert_eq!(solutions.len(), 2);
    for (name, expected) in TABLE_1 {
        if let Some(one) = solutions[0].get(name) {
            let value = one["value"].as_f64().unwrap();
            assert!((value - expected).abs() < 1e-9 * expected, "{name} = {value}");
            assert_eq!(one["plausible"], true);
            assert!(one["std"].as_f64().unwrap() > 0.0);
        }
    }
    // p3 = dc3 (m3 + m4/2) and p4 = m4 (1 - dc3/d3) give 2 m3 x^2 - (2 d3 m3 + d3 p4 + 2 p3) x + 2 d3 p3 = 0 for dc3;
    // the product of its roots is d3 p3 / m3.
    let p3 = 0.833 * (14.5773 + 5.9203 / 2.0);
    let second = 1.03 * p3 / 14.5773 / 0.833;
    let dc3 = number(&found, "/solutions/1/dc3/value");
    assert!((dc3 - second).abs() < 1e-9, "{dc3}");
    assert_eq!(found["solutions"][1]["m4"]["plausible"], false);
    for residual in found["fit"][1]["residuals"].as_object().unwrap().values() {
        assert!(residual.as_f64().unwrap().abs() < 1e-12);
    }
}

#[test]
fn what_is_not_determined_is_named() {
    let fit = table_1("table-1-undetermined.json");
    let found = interpret(&fit, "m1,dc1,Ic12,Ic32");
    assert_eq!(found["identifiable"], false);
    assert_eq!(found["solutions"], json!([]));
    assert_eq!(found["determined"], json!(["Ic32"]));
    let says = found["undetermined"][0].as_str().unwrap();
    for name in ["m1", "dc1", "Ic12"] {
        assert!(says.contains(name), "{says}");
    }
    let text = printed(&[
        "interpret",
        &model("spidermill-paper.toml"),
        "--fit",
        &fit,
        "--unknown",
        "m1,dc1,Ic12",
    ]);
    assert!(
        text.contains("do not determine") && text.contains("leave it out"),
        "{text}"
    );
}

#[test]
fn fewer_unknowns_than_equations_are_fitted_with_their_residuals() {
    let found = interpret(&table_1("table-1-few.json"), "m2,m4,dc3");
    assert_eq!(found["method"], "least_squares");
    assert!(number(&found, "/fit/0/chi_squared") > 100.0);
    // All five values come from Table 1, so with the two inertias true the fit is exact; held at CAD values it is not.
    let model = model("spidermill-paper.toml");
    let text = std::fs::read_to_string(&model).unwrap();
    assert!(text.contains("extends"));
    let variant = scratch("table-1-variant.toml");
    std::fs::write(
        &variant,
        format!(
            "schema = 1\nname = \"variant\"\nextends = {model:?}\n[parameters]\n\
             Ic12 = {{ nominal = 4.9733, unit = \"kg m^2\" }}\nIc32 = {{ nominal = 0.2162, unit = \"kg m^2\" }}\n"
        ),
    )
    .unwrap();
    let fit = table_1("table-1-exact.json");
    let found = json(&["interpret", &variant, "--fit", &fit, "--unknown", "m2,m4,dc3", "--json"]);
    assert!(number(&found, "/fit/0/chi_squared") < 1e-12);
    for (name, expected) in [("m2", 15.9794), ("m4", 5.9203), ("dc3", 0.833)] {
        let value = number(&found, &format!("/solutions/0/{name}/value"));
        assert!((value - expected).abs() < 1e-6 * expected, "{name} = {value}");
    }
}

#[test]
fn an_identified_covariance_is_propagated() {
    let fit = scratch("interpret-identified.json");
    printed(&[
        "identify",
        &model("spidermill.toml"),
        "--data",
        &run("plain-fit.csv"),
        "--out",
        &fit,
    ]);
    let ran = crate::common::ran(&[
        "interpret",
        &model("spidermill.toml"),
        "--fit",
        &fit,
        "--unknown",
        "m2,dc3,Ic12,Ic32",
        "--json",
    ]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(!ran.err.contains("no covariance"), "{}", ran.err);
    let found: Value = serde_json::from_str(&ran.out).unwrap();
    // The recording was made with the nominal parameters by another program.
    for (name, expected) in [("m2", 7.9538), ("dc3", 0.515), ("Ic12", 6.3195), ("Ic32", 1.6173)] {
        let value = number(&found, &format!("/solutions/0/{name}/value"));
        assert!((value - expected).abs() < 2e-3 * expected, "{name} = {value}");
    }
}

#[test]
fn nonsense_is_refused() {
    let fit = table_1("table-1-refused.json");
    let paper = model("spidermill-paper.toml");
    let says = refused(1, &["interpret", &paper, "--fit", &fit, "--unknown", "m2,mass"]);
    assert!(says.contains("mass") && says.contains("m1, m2"), "{says}");
    refused(2, &["interpret", &paper, "--fit", &fit, "--unknown", "m2,m2"]);
    refused(2, &["interpret", &paper, "--fit", &fit]);
    let other = model("spidermill.toml");
    let says = refused(1, &["interpret", &other, "--fit", &fit, "--unknown", "m2"]);
    assert!(says.contains("identify"), "{says}");
}
