//! Page and JSON agree with the derivation: their text, parsed again, has the values of the reduction and of the
//! programs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use modelmill_spec::Mechanism;

use super::{NumericRank, PageFormat, ReducedEquations, base_expression, factored_base_expression, page, programs};
use crate::expr::Atom;
use crate::expr::print::parse::parse;
use crate::expr::print::tests::{latex_is_balanced, markup_is_balanced};
use crate::expr::print::{PrintedFormula, atom};
use crate::names::NamedQuantities;
use crate::{Derivation, derive};

const MODELS: [&str; 8] = [
    "spidermill-paper",
    "spidermill",
    "two_link",
    "four_bar",
    "five_bar",
    "three_rrr",
    "stanford",
    "emps",
];

pub(crate) fn model(name: &str) -> Mechanism {
    let path: PathBuf = [
        env!("CARGO_MANIFEST_DIR"),
        "../model-spec/models",
        &format!("{name}.toml"),
    ]
    .iter()
    .collect();
    modelmill_spec::load_file(&path)
        .unwrap_or_else(|failure| panic!("{failure}"))
        .mechanism
}

fn derivation(name: &str) -> Derivation {
    derive(&model(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Arbitrary values of constants and parameters.
fn values(derivation: &Derivation) -> (Vec<f64>, Vec<f64>, BTreeMap<String, f64>) {
    let odd = |i: usize| 0.7 + ((i * 37 + 11) % 29) as f64 / 17.0;
    let mechanism = &derivation.mechanism;
    let constants: Vec<f64> = (0..mechanism.constants.len()).map(odd).collect();
    let parameters: Vec<f64> = (0..mechanism.parameters.len()).map(|i| odd(i + 5)).collect();
    let mut names = BTreeMap::new();
    for (c, v) in mechanism.constants.iter().zip(&constants) {
        names.insert(c.name.clone(), *v);
    }
    for (p, v) in mechanism.parameters.iter().zip(&parameters) {
        names.insert(p.name.clone(), *v);
    }
    (constants, parameters, names)
}

fn assert_close(a: f64, b: f64, what: &str) {
    assert!((a - b).abs() <= 1e-9 * (1.0 + b.abs()), "{what}: {a} {b}");
}

#[test]
fn base_parameters_read_again_have_the_values_of_the_reduction() {
    for name in MODELS {
        let derivation = derivation(name);
        let (constants, parameters, names) = values(&derivation);
        let expected = derivation.base_values(&parameters, &constants);
        let equations = ReducedEquations::new(&derivation, None);
        for (k, expected) in expected.iter().enumerate() {
            let expanded = &equations.base[k].expression;
            assert_close(parse(expanded).value_f64(&names), *expected, expanded);
            assert_eq!(*expanded, base_expression(&derivation, k).text());
            let grouped = factored_base_expression(&derivation, k).text();
            assert_close(parse(&grouped).value_f64(&names), *expected, &grouped);
        }
    }
}

#[test]
fn factors_read_again_have_the_values_of_the_reduction() {
    for name in MODELS {
        let derivation = derivation(name);
        let (constants, _, names) = values(&derivation);
        let equations = ReducedEquations::new(&derivation, None);
        let lines = &derivation.reduction.dependencies;
        assert_eq!(
            equations.dependencies.len(),
            lines.len() + equations.without_effect.len()
        );
        for (line, printed) in lines.iter().zip(&equations.dependencies) {
            assert_eq!(line.equals.len(), printed.equals.len());
            for ((_, factor), (_, text)) in line.equals.iter().zip(&printed.equals) {
                let expected = factor.value_f64(&constants);
                assert_close(parse(text).value_f64(&names), expected, text);
                let factored = factor.formula(&derivation.mechanism).text();
                assert_close(parse(&factored).value_f64(&names), expected, &factored);
            }
        }
    }
}

#[test]
fn every_product_is_retained_or_depends_on_retained_ones() {
    for name in MODELS {
        let equations = ReducedEquations::new(&derivation(name), None);
        let retained: BTreeSet<&String> = equations.base.iter().map(|b| &b.retained).collect();
        let dependent: BTreeSet<&String> = equations.dependencies.iter().map(|d| &d.parameter).collect();
        for product in &equations.parameters {
            assert!(retained.contains(product) != dependent.contains(product));
        }
        for line in &equations.dependencies {
            let vanishes = equations.without_effect.contains(&line.parameter);
            assert_eq!(vanishes, line.equals.is_empty());
            assert!(line.equals.iter().all(|(r, _)| retained.contains(r)));
        }
        assert_eq!(equations.rank.exact, Some(equations.base.len()));
    }
}

/// The equations of the listings, evaluated line by line, have the values of the programs.
#[test]
fn listed_programs_compute_what_the_programs_compute() {
    for name in MODELS {
        let derivation = derivation(name);
        let mechanism = &derivation.mechanism;
        let meanings = NamedQuantities::new(&derivation);
        assert!(!meanings.atoms.is_empty(), "{name}: no state was found");
        for (title, outputs, program, listing) in programs::listings(&derivation) {
            let mut known: BTreeMap<String, f64> = meanings
                .atoms
                .iter()
                // Passive motion is computed; where it is not, it is an input.
                .filter(|(a, _)| program.ops.contains(&crate::ProgramOp::Input(**a)))
                .map(|(a, v)| (atom(mechanism, *a).text(), *v))
                .collect();
            for line in listing.fixed.iter().chain(&listing.state) {
                let PrintedFormula::Symbol(left) = &line.left else {
                    panic!("{}", line.left)
                };
                let value = parse(&line.right.text()).value_f64(&known);
                let before = known.insert(left.text(), value);
                assert_eq!(before, None, "{name}, {title}: {} twice", left.text());
            }
            let expected = meanings.values(program);
            for (symbol, value) in outputs.iter().zip(&program.outputs) {
                let found = known[&symbol.text()];
                assert_close(found, expected[value.index()], &symbol.text());
            }
        }
    }
}

/// A named value equals the quantity of its name.
#[test]
fn named_values_are_what_they_are_called() {
    let derivation = derivation("spidermill");
    let meanings = NamedQuantities::new(&derivation);
    let (_, _, program, listing) = programs::listings(&derivation).pop().expect("the regressor is last");
    let lines: BTreeSet<String> = listing.state.iter().map(|e| e.left.text()).collect();
    for wanted in ["c_theta1", "omega_S3_z", "omega_S3_z_d", "c_gamma1", "l_spindle_left"] {
        assert!(lines.contains(wanted), "{wanted} in {lines:?}");
    }
    let values = meanings.values(program);
    let rate = |i: usize| meanings.atoms[&Atom::Rate(i)];
    let names = meanings.name_values(program);
    let (at, meaning) = names
        .iter()
        .find(|(_, m)| m.symbol.text() == "omega_S3_z")
        .expect("a name in the listing");
    let sign = if meaning.negative { -1.0 } else { 1.0 };
    let (theta1, gamma1) = (0, 2);
    assert_close(sign * values[*at], rate(theta1) + rate(gamma1), "omega_S3_z");
}

#[test]
fn pages_are_whole_and_the_same_every_time() {
    let numeric = NumericRank {
        rank: 5,
        samples: 40,
        condition: Some(12.5),
    };
    for name in ["spidermill-paper", "two_link", "three_rrr"] {
        let (one, two) = (derivation(name), derivation(name));
        for format in [
            PageFormat::Text,
            PageFormat::Markdown,
            PageFormat::Latex,
            PageFormat::Html,
            PageFormat::Json,
        ] {
            let text = page(&one, format, Some(&numeric));
            assert_eq!(text, page(&two, format, Some(&numeric)), "{name} {format:?}");
            assert!(text.ends_with('\n'));
        }
        let html = page(&one, PageFormat::Html, None);
        let without_scripts: String = html
            .split("<script>")
            .map(|piece| piece.split_once("</script>").map_or(piece, |(_, rest)| rest))
            .collect();
        assert!(markup_is_balanced(&without_scripts), "{name}");
        // The page loads no other file.
        assert!(!html.contains("src=") && !html.contains("http") && !html.contains("url("));
        let latex = page(&one, PageFormat::Latex, None);
        assert!(latex_is_balanced(&latex.replace("\\{", "").replace("\\}", "")));
        let count = |what: &str| latex.matches(what).count();
        assert_eq!(count("\\begin{"), count("\\end{"));
    }
}

#[test]
fn json_has_the_fields_of_the_contract() {
    let numeric = NumericRank {
        rank: 5,
        samples: 40,
        condition: None,
    };
    let text = ReducedEquations::new(&derivation("spidermill-paper"), Some(&numeric)).json();
    let json: serde_json::Value = serde_json::from_str(&text).expect("valid JSON");
    let keys: Vec<&String> = json.as_object().expect("an object").keys().collect();
    assert_eq!(
        keys,
        [
            "model",
            "parameters",
            "without_effect",
            "dependencies",
            "base",
            "rank",
            "operations"
        ]
    );
    assert_eq!(
        json["rank"],
        serde_json::json!({"exact": 5, "numeric": 5, "samples": 40})
    );
    for program in ["regressor", "inverse_dynamics"] {
        for operation in ["add", "mul", "div", "sqrt", "sincos"] {
            assert!(json["operations"][program][operation].is_u64());
        }
    }
    let last = json["dependencies"].as_array().and_then(|d| d.last());
    assert_eq!(last, Some(&serde_json::json!({"parameter": "m1", "equals": {}})));
}

/// Eq. (5), (6) and (16) in a few lines.
fn summary(name: &str) -> String {
    let derivation = derivation(name);
    let equations = ReducedEquations::new(&derivation, None);
    let mut lines = vec![
        format!("p_g: {}", equations.parameters.join(", ")),
        format!("without effect: {}", equations.without_effect.join(", ")),
    ];
    for line in equations.dependencies.iter().filter(|d| !d.equals.is_empty()) {
        let right: Vec<String> = line.equals.iter().map(|(r, k)| format!("({k}) h[{r}]")).collect();
        lines.push(format!("h[{}] = {}", line.parameter, right.join(" + ")));
    }
    for (k, base) in equations.base.iter().enumerate() {
        lines.push(format!("{} = {}", base.name, base.expression));
        let grouped = factored_base_expression(&derivation, k).text();
        if grouped != base.expression {
            lines.push(format!("       = {grouped}"));
        }
    }
    lines.join("\n")
}

#[test]
fn equations_of_the_spidermill_paper() {
    insta::assert_snapshot!(summary("spidermill-paper"), @r"
    p_g: m1*dc1, m1*dc1^2, m2, m3, m3*dc3, m3*dc3^2, m4, m4*dc3, m4*dc3^2, Ic12, Ic32
    without effect: m1
    h[m2] = (d1) h[m1*dc1] + (d1^2) h[m1*dc1^2]
    h[m3] = (d1) h[m1*dc1] + (d1^2) h[m1*dc1^2]
    h[m3*dc3^2] = (2) h[m4*dc3^2]
    h[m4*dc3] = (1/2*d1/d3) h[m1*dc1] + (1/2*d1^2/d3) h[m1*dc1^2] + (1/2) h[m3*dc3] + (-1/d3) h[m4]
    h[Ic12] = (1) h[m1*dc1^2]
    h[Ic32] = (2) h[m4*dc3^2]
    p1_min = m1*dc1 + d1*m2 + d1*m3 + 1/2*d1*m4*dc3/d3
           = m1*dc1 + d1*(m2 + m3) + 1/2*d1*m4*dc3/d3
    p2_min = m1*dc1^2 + d1^2*m2 + d1^2*m3 + 1/2*d1^2*m4*dc3/d3 + Ic12
           = m1*dc1^2 + d1^2*(m2 + m3) + 1/2*d1^2*m4*dc3/d3 + Ic12
    p3_min = m3*dc3 + 1/2*m4*dc3
    p4_min = m4 - m4*dc3/d3
    p5_min = m4*dc3^2 + 2*m3*dc3^2 + 2*Ic32
           = m4*dc3^2 + 2*(m3*dc3^2 + Ic32)
    ");
}

#[test]
fn equations_of_the_two_link_arm() {
    insta::assert_snapshot!(summary("two_link"), @r"
    p_g: ZZ1, MX1, MY1, ZZ2, MX2, MY2, M2
    without effect: M1
    h[M2] = (L^2) h[ZZ1] + (L) h[MX1]
    p1_min = ZZ1 + L^2*M2
    p2_min = MX1 + L*M2
    p3_min = MY1
    p4_min = ZZ2
    p5_min = MX2
    p6_min = MY2
    ");
}

/// A number in a comment of emitted code or in a text stands for one equation of the page.
#[test]
fn numbers_of_equations_are_unique() {
    for name in MODELS {
        let text = page(&derivation(name), PageFormat::Text, None);
        let mut seen = BTreeSet::new();
        for line in text.lines() {
            let tag = line
                .trim_start()
                .strip_prefix('(')
                .and_then(|rest| rest.split_once(')'));
            let Some((tag, _)) = tag.filter(|(tag, _)| tag.ends_with(|c: char| c.is_ascii_digit())) else {
                continue;
            };
            if tag.chars().all(|c| c.is_ascii_alphanumeric() || c == '.') {
                assert!(seen.insert(tag.to_owned()), "{name}: two equations ({tag})");
            }
        }
        assert!(seen.contains("16.1") && seen.contains("H1"), "{name}: {seen:?}");
    }
}

/// Decimal factors stand in their terms, and a factor that all terms share stands in front.
#[test]
fn numbers_stand_where_they_are_short() {
    let folder = std::env::temp_dir().join(format!("modelmill-factors-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("arm.toml");
    // Without gravity only moments of inertia count: `I2 + 3.61*mb`.
    let text = "schema = 1\nname = \"arm\"\ngravity = [0, 0, 0]\n[parameters]\nI2 = { nominal = 1, unit = \"kg m^2\" }\n\
                m2 = { nominal = 2, unit = \"kg\" }\nmb = { nominal = 3, unit = \"kg\" }\n[coordinates]\nq1 = {}\n\
                [[frame]]\nname = \"one\"\non = \"base\"\nmodified_dh = { theta = \"q1\" }\n\
                [[part]]\nname = \"link\"\non = \"one\"\nmass = \"m2\"\ncentre = [0, 0]\ninertia = { zz = \"I2\" }\n\
                [[lumped_mass]]\nmass = \"mb\"\non = \"one\"\nat = [1.9, 0]\n\
                [[drive]]\nname = \"d1\"\njoint = \"q1\"\n";
    std::fs::write(&file, text).unwrap();
    let loaded = modelmill_spec::load_file(&file).unwrap_or_else(|failure| panic!("{failure}"));
    let derivation = derive(&loaded.mechanism).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    for k in 0..derivation.reduction.retained.len() {
        let text = factored_base_expression(&derivation, k).text();
        let expanded = base_expression(&derivation, k).text();
        assert!(!text.contains("100*") && !text.contains("0.01*"), "{text}");
        assert!(text.len() <= expanded.len(), "{text} is longer than {expanded}");
    }
    let all: Vec<String> = (0..derivation.reduction.retained.len())
        .map(|k| factored_base_expression(&derivation, k).text())
        .collect();
    assert!(all.iter().any(|text| text.contains("3.61*mb")), "{all:?}");
}
