//! Emitted Julia, run by an interpreter of its own: reference tables, loops by Newton's method, and refused states.
//!
//! The grammar is checked by tree-sitter where a Python has it, because the interpreter shares our view of Julia.

use std::path::Path;
use std::process::Command;

use modelmill_codegen::{Derivation, derive};

use super::interpreter::{JuliaExit, JuliaProgram, JuliaValue as V};
use crate::language::EmissionRequest;

fn derivation_from(path: &Path) -> Derivation {
    let loaded = modelmill_spec::load_file(path).unwrap_or_else(|failure| panic!("{failure}"));
    derive(&loaded.mechanism).unwrap_or_else(|error| panic!("{error}"))
}

/// The module of a bundled model with its equation of motion.
fn module_text(model: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
    emit(&derivation_from(&folder.join(format!("{model}.toml"))))
}

fn emit(derivation: &Derivation) -> String {
    let dynamics = derivation.dynamics().unwrap_or_else(|error| panic!("{error}"));
    let request = EmissionRequest {
        derivation,
        dynamics: Some(&dynamics),
        reactions: None,
        self_test: false,
    };
    super::emit_module(&request).remove(0).text
}

/// Rows of a reference table.
fn table(name: &str) -> Vec<Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/fixtures/reference")
        .join(name);
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text
        .lines()
        .filter_map(|line| line.split(',').map(|cell| cell.trim().parse().ok()).collect());
    rows.collect()
}

/// A module with a prepared model.
struct PreparedJulia {
    program: JuliaProgram,
    base: Vec<f64>,
    dynamics: V,
}

impl PreparedJulia {
    fn new(text: &str, parameters: Vec<V>) -> Self {
        let program = JuliaProgram::parse(text);
        let call = |name: &str, values| {
            program
                .call(name, values)
                .unwrap_or_else(|exit| panic!("{name}: {exit:?}"))
        };
        let geometry = call("Geometry", vec![]);
        let parameters = call("Parameters", parameters);
        let base = call("base_parameters", vec![geometry.clone(), parameters]);
        let dynamics = call("prepare", vec![geometry, base.clone()]);
        Self {
            base: base.numbers(),
            dynamics,
            program,
        }
    }

    fn try_call(&self, name: &str, arrays: &[&[f64]]) -> Result<V, JuliaExit> {
        let arrays = arrays.iter().map(|values| V::array(values));
        self.program
            .call(name, [self.dynamics.clone()].into_iter().chain(arrays).collect())
    }

    fn call(&self, name: &str, arrays: &[&[f64]]) -> V {
        self.try_call(name, arrays)
            .unwrap_or_else(|exit| panic!("{name}: {exit:?}"))
    }

    /// The largest difference of what the functions return from given forces, and whether forward dynamics returns the
    /// accelerations.
    fn largest_difference(&self, [q, qd, qdd]: [&[f64]; 3], expected: &[f64]) -> f64 {
        let state = [q, qd, qdd];
        let forces = self.call("inverse_dynamics", &state).numbers();
        let h = self.call("regressor", &state).numbers();
        let of_regressor = h.chunks(self.base.len()).map(|row| dot(row, &self.base));
        let drives = self.call("drives", &state);
        let jacobian = drives.field("jacobian").numbers();
        // M q'' + bias = J' f
        let matrix = self.call("mass_matrix", &state).numbers();
        let terms = self.call("bias_and_drives", &state);
        for (a, b) in terms.field("jacobian").numbers().iter().zip(&jacobian) {
            assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{a} {b}");
        }
        let bias = terms.field("bias").numbers();
        let parts = ["coriolis", "gravity", "effects"].map(|name| self.call(name, &state).numbers());
        let mut worst = 0.0_f64;
        for (force, expected) in forces
            .iter()
            .chain(&of_regressor.collect::<Vec<f64>>())
            .zip([expected, expected].concat())
        {
            worst = worst.max((force - expected).abs());
        }
        for (i, bias) in bias.iter().enumerate() {
            let total = dot(&matrix[i * qdd.len()..][..qdd.len()], qdd) + bias;
            let column: Vec<f64> = jacobian.iter().copied().skip(i).step_by(qdd.len()).collect();
            worst = worst.max((total - dot(&column, expected)).abs());
            worst = worst.max((parts.iter().map(|part| part[i]).sum::<f64>() - bias).abs());
        }
        let found = self.call("forward", &[q, qd, qdd, &forces]).numbers();
        for (found, qdd) in found.iter().zip(qdd) {
            assert!((found - qdd).abs() < 1e-8 * (1.0 + qdd.abs()), "{found} {qdd}");
        }
        worst
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The constant that an error states.
fn status_name(program: &JuliaProgram, exit: JuliaExit) -> &'static str {
    let JuliaExit::Throw(value @ V::Record(_)) = exit else {
        panic!("{exit:?}");
    };
    let names = ["OUT_OF_REACH", "SINGULAR", "UNDEFINED", "NOT_FINITE", "SPECIAL"];
    names
        .into_iter()
        .find(|name| program.constant(name) == value.field("status"))
        .unwrap()
}

#[test]
fn an_arm_has_the_torques_of_the_table() {
    let parameters = table("pinocchio-panda-parameters.csv").remove(0);
    let parameters = parameters.into_iter().map(V::Float).collect();
    let panda = PreparedJulia::new(&module_text("panda"), parameters);
    let rows = table("pinocchio-panda.csv");
    assert!(rows.len() >= 40);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for row in &rows[..10] {
        worst = worst.max(panda.largest_difference([&row[..7], &row[7..14], &row[14..21]], &row[21..28]));
        largest = row[21..28].iter().fold(largest, |a, b| a.max(b.abs()));
    }
    assert!(largest > 1.0 && worst < 1e-12 * largest, "{worst} of {largest}");
    // What has no value is refused, with the reason.
    let zero = [0.0; 7];
    let refused = |q: &[f64], qd: &[f64]| panda.try_call("inverse_dynamics", &[q, qd, &zero]).unwrap_err();
    let mut bad = zero;
    bad[3] = f64::NAN;
    assert_eq!(status_name(&panda.program, refused(&bad, &zero)), "NOT_FINITE");
    bad[3] = 1e61;
    assert_eq!(status_name(&panda.program, refused(&zero, &bad)), "NOT_FINITE");
    assert!(format!("{:?}", refused(&zero[..6], &zero)).contains("DimensionMismatch"));
}

#[test]
fn loops_in_closed_form_have_the_forces_of_the_table() {
    let mill = PreparedJulia::new(&module_text("spidermill-paper"), vec![]);
    // Columns of the first drive that are retained.
    let retained = [8, 9, 12, 14, 16];
    assert_eq!(mill.base.len(), retained.len());
    let rows = table("spidermill-paper-H.csv");
    assert!(rows.len() >= 40);
    for row in &rows[..20] {
        let (q, qd, qdd) = (&row[..2], &row[2..4], &row[4..6]);
        let passive = mill.call("passive", &[q, qd, qdd]).field("position").numbers();
        let h = mill.call("regressor", &[q, qd, qdd]).numbers();
        for d in 0..2 {
            assert!((passive[d] - row[6 + d]).abs() < 1e-11);
            for (b, at) in retained.iter().enumerate() {
                let expected = row[at + 11 * d];
                assert!((h[d * retained.len() + b] - expected).abs() < 1e-11 * (100.0 + expected.abs()));
            }
        }
        assert!(mill.largest_difference([q, qd, qdd], &row[30..32]) < 1e-10 * 1000.0);
    }
    let refused = mill
        .try_call("inverse_dynamics", &[&[3.1, 0.0], &[0.0; 2], &[0.0; 2]])
        .unwrap_err();
    assert_eq!(status_name(&mill.program, refused), "OUT_OF_REACH");
}

#[test]
fn loops_by_newtons_method_agree_with_themselves_and_with_nearby_poses() {
    let robot = PreparedJulia::new(&module_text("three_rrr"), vec![]);
    let nominal = [-0.37568, 1.70899, -2.37896];
    let mut near: Option<V> = None;
    for i in 0..6 {
        let of = |f: &dyn Fn(f64, usize) -> f64| [0, 1, 2].map(|k| f(0.4 * f64::from(i) + 2.0 * k as f64, k));
        let q = of(&|phase, k| nominal[k] + 0.1 * phase.sin());
        let qd = of(&|phase, _| (1.3 * phase).cos());
        let qdd = of(&|phase, _| 3.0 * (0.7 * phase).sin());
        let plain = robot.call("passive_position", &[&q]);
        // From the passive coordinates of the pose before, which are replaced.
        let guess = near.take().unwrap_or_else(|| plain.clone());
        let arguments = vec![robot.dynamics.clone(), V::array(&q), guess.clone()];
        robot.program.call("passive_position", arguments).unwrap();
        for (a, b) in guess.numbers().iter().zip(plain.numbers()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
        near = Some(guess);
        let forces = robot.call("inverse_dynamics", &[&q, &qd, &qdd]).numbers();
        let largest = forces.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let worst = robot.largest_difference([&q, &qd, &qdd], &forces);
        assert!(largest > 1.0 && worst < 1e-11 * largest, "{worst} of {largest}");
    }
}

/// Names that are words of Julia, end a text or hide a function of the module.
#[test]
fn names_of_the_model_file_stay_names() {
    let folder = std::env::temp_dir().join(format!("modelmill-julia-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for name in ["end", "module", "regressor", "Base", "matrix", "plain"] {
        let file = folder.join("model.toml");
        let text = format!(
            "schema = 1\nname = \"{name}\"\ntitle = \"$(1) \\\"\\\"\\\" =# end\"\ngravity = [0, -9.81, 0]\n[constants]\n\
             zeros = {{ value = 0.5, unit = \"m\" }}\n[parameters]\nvcat = {{ nominal = 2, unit = \"kg\" }}\n\
             [coordinates]\nfunction = {{}}\n[[frame]]\nname = \"arm\"\non = \"base\"\n\
             modified_dh = {{ theta = \"function\" }}\n[[lumped_mass]]\nmass = \"vcat\"\non = \"arm\"\n\
             at = [\"zeros\", 0]\n[[drive]]\nname = \"outputs\"\njoint = \"function\"\n"
        );
        std::fs::write(&file, text).unwrap();
        let pendulum = PreparedJulia::new(&emit(&derivation_from(&file)), vec![]);
        let force = pendulum.call("inverse_dynamics", &[&[0.3], &[0.1], &[0.7]]).numbers()[0];
        let expected = 2.0 * (0.25 * 0.7 + 0.5 * 9.81 * 0.3_f64.cos());
        assert!((force - expected).abs() < 1e-12, "{name}: {force} {expected}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// The interpreter refuses what Julia refuses.
#[test]
fn the_interpreter_has_the_rules_of_julia() {
    let result = |body: &str| {
        let text = format!("module m\nfunction f()\n{body}\nend\nfunction g(x)\nreturn x\nend\nend\n");
        JuliaProgram::parse(&text).call("f", vec![])
    };
    assert_eq!(result("a = 1:3\nreturn zeros(3)[1] + 2 * 3 - 1 / 2"), Ok(V::Float(5.5)));
    assert_eq!(result("s = 0\nfor i in 3:-1:1\ns += i\nend\nreturn s"), Ok(V::Int(6)));
    assert_eq!(result("return 1 > 2 ? 1 : 2 == 2 ? 3 : 4"), Ok(V::Int(3)));
    for (body, says) in [
        ("for i in 1:2\nx = i\nend\nreturn x", "UndefVarError: x"),
        ("g = 1\nreturn g(2)", "g is a variable"),
        ("return zeros(2)[0]", "BoundsError"),
        ("return sqrt(-1.0)", "DomainError"),
        ("return unknown(1)", "UndefVarError"),
        ("if 1\nreturn 2\nend", "no condition"),
    ] {
        let exit = result(body).unwrap_err();
        assert!(format!("{exit:?}").contains(says), "{body}: {exit:?}");
    }
}

#[test]
fn the_grammar_of_julia_accepts_the_modules() {
    let python = std::env::var("MODELMILL_PEERS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let script = "import sys, tree_sitter, tree_sitter_julia\n\
                  parser = tree_sitter.Parser(tree_sitter.Language(tree_sitter_julia.language()))\n\
                  tree = parser.parse(sys.stdin.buffer.read())\n\
                  print('error' if tree.root_node.has_error else 'accepted')\n";
    let probe = Command::new(&python)
        .args(["-c", "import tree_sitter, tree_sitter_julia"])
        .output();
    if !probe.is_ok_and(|output| output.status.success()) {
        println!("skipped: {python} has no tree_sitter_julia; MODELMILL_PEERS_PYTHON names another one");
        return;
    }
    let accepts = |text: &str| {
        use std::io::Write as _;
        let mut command = Command::new(&python);
        command.args(["-c", script]).stdin(std::process::Stdio::piped());
        let mut child = command.stdout(std::process::Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
        child.wait_with_output().unwrap().stdout == b"accepted\n"
    };
    for model in ["two_link", "spidermill-paper", "three_rrr", "panda"] {
        let text = module_text(model);
        assert!(accepts(&text), "{model}");
        // The parser does find faults.
        assert!(
            !accepts(&text.replacen("return OK\nend", "return OK\n", 1)),
            "{model} without an end"
        );
    }
}
