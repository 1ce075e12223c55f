//! Crates for other languages: what `generate --language` writes is built and held against the reference tables.
//!
//! The C library also proves that emitted code cannot panic: built without the standard library, it holds no trace of
//! the machinery that a panic needs.

use std::path::{Path, PathBuf};
use std::process::Command;

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A folder of this test for everything that it writes; what was built there once is only checked for changes.
pub(crate) fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("languages").join(name)
}

pub(crate) fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(
        output.status.success(),
        "{command:?}:\n{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub(crate) fn there(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok()
}

/// Writes the crate of a bundled model, with its equation of motion.
fn written(model: &str, language: &str) -> PathBuf {
    let file = project().join(format!("model-spec/models/{model}.toml"));
    written_of(&file, model, language, &["--dynamics"])
}

/// Writes the crate of a model file.
pub(crate) fn written_of(file: &Path, model: &str, language: &str, more: &[&str]) -> PathBuf {
    let out = folder(&format!("{model}-{language}"));
    run(Command::new(env!("CARGO_BIN_EXE_modelmill"))
        .arg("generate")
        .arg(file)
        .args(["--language", language, "--out"])
        .arg(&out)
        .args(more));
    // The versions of the project's own lock file, so that nothing newer is asked for.
    std::fs::copy(project().join("Cargo.lock"), out.join("Cargo.lock")).unwrap();
    out
}

/// Writes the crate of a bundled model and builds it.
fn built(model: &str, language: &str, options: &[&str]) -> PathBuf {
    let out = written(model, language);
    cargo("build", &out, options);
    out
}

/// Lets cargo look at a crate, or build it. Modules of Python are built without optimisation, and in a folder of their own:
/// cargo builds one crate at a time in a folder.
pub(crate) fn cargo(what: &str, at: &Path, options: &[&str]) {
    let (target, profile) = if at.join("pyproject.toml").exists() {
        ("python-target", "dev")
    } else {
        ("target", "release")
    };
    run(Command::new(env!("CARGO"))
        .args([what, "--profile", profile, "--quiet", "--target-dir"])
        .arg(folder(target))
        .args(options)
        .current_dir(at));
}

/// A module of Python that was built.
pub(crate) fn python_library(name: &str) -> PathBuf {
    folder("python-target").join(format!("debug/lib{name}.so"))
}

fn tables() -> PathBuf {
    project().join("tests/fixtures/reference")
}

/// What a program links beside the static library.
const LIBRARIES: [&str; 3] = ["-lm", "-lpthread", "-ldl"];

#[test]
fn the_c_library_gives_the_torques_of_the_table() {
    let guide = project().join("docs/guide/src/generated-code.md");
    let guide = std::fs::read_to_string(guide).unwrap();
    let line = format!("release/libarm.a {}", LIBRARIES.join(" "));
    assert!(guide.contains(&line), "the guide links otherwise");
    if !there("cc") {
        println!("skipped: there is no C compiler `cc` on this machine");
        return;
    }
    for options in [&[][..], &["--no-default-features"]] {
        c_agrees("panda", "panda", "panda", options);
    }
}

/// Builds a C library and holds it against the tables by a program that says so.
fn c_agrees(model: &str, name: &str, test: &str, options: &[&str]) {
    let out = built(model, "c", options);
    let program = folder(&format!("{test}-c-test"));
    run(Command::new("cc")
        .args(["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror", "-I"])
        .arg(out.join("include"))
        .arg(project().join(format!("cli/tests/languages/{test}.c")))
        .arg(folder("target").join(format!("release/lib{name}.a")))
        .args(LIBRARIES)
        .arg("-o")
        .arg(&program));
    assert_eq!(run(Command::new(program).arg(tables())), "agrees\n");
}

/// Loops in closed form beside a table, and loops by Newton's method.
#[test]
fn the_c_library_moves_loops_and_inverts_its_own_dynamics() {
    if !there("cc") {
        println!("skipped: there is no C compiler `cc` on this machine");
        return;
    }
    c_agrees("spidermill-paper", "spidermill_paper", "spidermill", &[]);
    c_agrees("three_rrr", "three_rrr", "three_rrr", &[]);
}

/// Writes the C99 of a bundled model with all that it can have.
fn c99(model: &str) -> PathBuf {
    let out = folder(&format!("{model}-c99"));
    run(Command::new(env!("CARGO_BIN_EXE_modelmill"))
        .arg("generate")
        .arg(project().join(format!("model-spec/models/{model}.toml")))
        .args(["--language", "c99", "--dynamics", "--reactions", "--self-test", "--out"])
        .arg(&out));
    out
}

/// Whether the compiler makes programs for a target.
fn links(target: &str) -> bool {
    let source = folder(&format!("nothing{target}.c"));
    std::fs::create_dir_all(folder("")).unwrap();
    std::fs::write(&source, "#include <math.h>\nint main(void) { return 0; }\n").unwrap();
    let mut command = Command::new("cc");
    command.arg(target).arg(&source).args(["-lm", "-o"]);
    let output = command.arg(folder(&format!("nothing{target}"))).output();
    output.is_ok_and(|output| output.status.success())
}

/// What every compiler must take without a word.
pub(crate) const STRICT: [&str; 6] = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"];

#[test]
fn c99_gives_the_numbers_of_the_tables_and_follows_loops() {
    if !there("cc") {
        println!("skipped: there is no C compiler `cc` on this machine");
        return;
    }
    // The second target computes in numbers of another length, where its libraries are installed.
    for target in ["-m64", "-m32"] {
        if !links(target) {
            println!("skipped: nothing can be linked with {target} here (gcc-multilib has what that needs)");
            continue;
        }
        for (model, name, test) in [
            ("panda", "panda", "panda_c99"),
            ("spidermill-paper", "spidermill_paper", "spidermill_c99"),
            ("three_rrr", "three_rrr", "three_rrr"),
        ] {
            let out = c99(model);
            let program = folder(&format!("{test}{target}"));
            run(Command::new("cc")
                .args(STRICT)
                .args([target, "-DPLAIN_C99", "-I"])
                .arg(&out)
                .arg(project().join(format!("cli/tests/languages/{test}.c")))
                .arg(out.join(format!("{name}.c")))
                .args(["-lm", "-o"])
                .arg(&program));
            assert_eq!(run(Command::new(program).arg(tables())), "agrees\n");
        }
    }
}

/// Loops by Newton's method, and in space: the self-test holds everything against everything.
#[test]
fn c99_of_other_mechanisms_holds_its_own_test() {
    if !there("cc") {
        println!("skipped: there is no C compiler `cc` on this machine");
        return;
    }
    for name in ["three_rrr", "slider_crank", "delta_tied", "emps"] {
        let out = c99(name);
        let main = folder(&format!("{name}-c99.c"));
        std::fs::write(
            &main,
            format!(
                "#include \"{name}.h\"\nint main(void) {{\n  {name}_geometry geometry;\n  \
                 {name}_default_geometry(&geometry);\n  return {name}_self_test(&geometry);\n}}\n"
            ),
        )
        .unwrap();
        let program = folder(&format!("{name}-c99-test"));
        run(Command::new("cc")
            .args(STRICT)
            .arg("-I")
            .arg(&out)
            .arg(&main)
            .arg(out.join(format!("{name}.c")))
            .args(["-lm", "-o"])
            .arg(&program));
        run(&mut Command::new(program));
    }
}

/// Symbols of a library that panicking needs.
fn panics(library: &str) -> Vec<String> {
    let output = Command::new("nm")
        .arg(folder("target").join("release").join(library))
        .output();
    let text = String::from_utf8_lossy(&output.expect("nm ran before").stdout).into_owned();
    let symbols = text
        .lines()
        .filter(|line| line.contains("panic") || line.contains("unwind"));
    symbols.map(str::to_owned).collect()
}

#[test]
fn emitted_code_cannot_panic() {
    if !there("nm") {
        println!("skipped: there is no `nm` on this machine");
        return;
    }
    // Open chains, loops in closed form, and loops by Newton's method.
    for model in ["rx90", "five_bar", "three_rrr"] {
        built(model, "c", &["--no-default-features"]);
        let found = panics(&format!("lib{model}.a"));
        assert!(found.is_empty(), "{model}: {found:?}");
    }
    // The standard library does hold such symbols: the test would see them.
    built("two_link", "c", &[]);
    assert!(!panics("libtwo_link.a").is_empty());
}

/// A Python that has numpy, or at least one without.
pub(crate) fn python() -> Option<String> {
    let named = std::env::var("MODELMILL_PEERS_PYTHON").ok();
    named.or_else(|| there("python3").then(|| "python3".to_owned()))
}

/// Whether the crates that a Python module needs can be had; says so if not.
pub(crate) fn has_its_crates(out: &Path) -> bool {
    let fetched = Command::new(env!("CARGO")).arg("fetch").current_dir(out).output();
    let has = fetched.is_ok_and(|output| output.status.success());
    if !has {
        println!("skipped: the crates pyo3 and numpy cannot be had here");
    }
    has
}

#[test]
fn the_python_module_gives_the_torques_of_the_table() {
    let Some(python) = python() else {
        println!("skipped: there is no python3 on this machine");
        return;
    };
    if !Command::new(&python)
        .args(["-c", "import numpy"])
        .output()
        .is_ok_and(|o| o.status.success())
    {
        println!("skipped: {python} has no numpy; MODELMILL_PEERS_PYTHON names another one");
        return;
    }
    if !cfg!(target_os = "linux") {
        println!("skipped: the module is built by cargo alone, which other systems' linkers need options for");
        return;
    }
    for (model, name, test) in [
        ("panda", "panda", "panda.py"),
        ("spidermill-paper", "spidermill_paper", "spidermill.py"),
    ] {
        if !has_its_crates(&written(model, "python")) {
            return;
        }
        built(model, "python", &[]);
        let module = folder("module");
        std::fs::create_dir_all(&module).unwrap();
        std::fs::copy(python_library(name), module.join(format!("{name}.so"))).unwrap();
        let says = run(Command::new(&python)
            .arg(project().join("cli/tests/languages").join(test))
            .arg(&module)
            .arg(tables()));
        println!("{says}");
        assert!(says.starts_with("agrees with the table"), "{says}");
    }
}

/// A pendulum without constants under a name, as a model file.
fn pendulum(name: &str) -> PathBuf {
    let file = folder(&format!("called-{name}.toml"));
    let text = format!(
        "schema = 1\nname = \"{name}\"\ngravity = [0, -9.81, 0]\n[parameters]\nm = {{ nominal = 2, unit = \"kg\" }}\n\
         [coordinates]\nq = {{}}\n[[frame]]\nname = \"arm\"\non = \"base\"\nmodified_dh = {{ theta = \"q\" }}\n\
         [[lumped_mass]]\nmass = \"m\"\non = \"arm\"\nat = [0.5, 0]\n[[drive]]\nname = \"motor\"\njoint = \"q\"\n"
    );
    std::fs::write(&file, text).unwrap();
    file
}

#[test]
fn c_headers_are_c_whatever_the_model_is_called_and_lacks() {
    if !there("cc") {
        println!("skipped: there is no C compiler `cc` on this machine");
        return;
    }
    for (name, header) in [("plain", "plain"), ("stdint", "stdint_model"), ("loop", "loop")] {
        let out = written_of(&pendulum(name), name, "c", &[]);
        let source = folder(&format!("{name}.c"));
        std::fs::write(&source, format!("#include \"{header}.h\"\n")).unwrap();
        run(Command::new("cc")
            .args([
                "-std=c99",
                "-pedantic-errors",
                "-Wall",
                "-Werror",
                "-fsyntax-only",
                "-I",
            ])
            .arg(out.join("include"))
            .arg(&source));
    }
}

#[test]
fn python_modules_build_whatever_the_model_is_called() {
    for (name, module) in [
        ("regressor", "regressor"),
        ("model", "model"),
        ("loop", "loop"),
        ("class", "class_model"),
    ] {
        let out = written_of(&pendulum(name), name, "python", &[]);
        if !has_its_crates(&out) {
            return;
        }
        let manifest = std::fs::read_to_string(out.join("pyproject.toml")).unwrap();
        assert!(manifest.contains(&format!("module-name = \"{module}\"")), "{manifest}");
        cargo("check", &out, &[]);
    }
}

#[test]
fn what_only_rust_has_is_refused_with_a_word() {
    let two_link = project().join("model-spec/models/two_link.toml");
    let generate = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_modelmill"));
        command.arg("generate").arg(&two_link).args(more);
        command.output().unwrap()
    };
    let out = folder("never");
    let output = generate(&["--reactions", "--language", "c", "--out", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    let says = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        says.contains("--reactions is available with --language rust and c99 only"),
        "{says}"
    );
    assert!(!out.exists());
    assert!(generate(&["--reactions", "--language", "rust"]).status.success());
}

#[test]
fn a_folder_that_holds_something_else_is_left_alone() {
    let out = folder("occupied");
    std::fs::create_dir_all(&out).unwrap();
    std::fs::write(out.join("Cargo.toml"), "[package]\n").unwrap();
    let file = project().join("model-spec/models/two_link.toml");
    let command = |out: &Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_modelmill"));
        command
            .arg("generate")
            .arg(&file)
            .args(["--language", "c", "--out"])
            .arg(out);
        command.output().unwrap()
    };
    let output = command(&out);
    assert_eq!(output.status.code(), Some(2));
    let says = String::from_utf8_lossy(&output.stderr);
    assert!(
        says.contains("the folder has files that modelmill did not write"),
        "{says}"
    );
    assert_eq!(std::fs::read_to_string(out.join("Cargo.toml")).unwrap(), "[package]\n");
}

/// Two models with the same names and sizes, in folders of their own; files of both do not belong together.
#[test]
fn files_of_different_models_do_not_compile_together() {
    if !there("cc") {
        println!("skipped: there is no C compiler `cc` on this machine");
        return;
    }
    let text = std::fs::read_to_string(project().join("model-spec/models/two_link.toml")).unwrap();
    // Gravity along the other axis: only numbers in the source differ, and every name is the same.
    let other = text.replacen("9.81", "1.62", 1);
    assert_ne!(text, other);
    for language in ["c99", "c"] {
        let [first, second] = [("first", &text), ("second", &other)].map(|(name, text)| {
            let file = folder(&format!("mixed-{language}-{name}.toml"));
            std::fs::create_dir_all(folder("")).unwrap();
            std::fs::write(&file, text).unwrap();
            written_of(&file, &format!("mixed-{language}-{name}"), language, &[])
        });
        // Each part of the second set is put beside the others of the first one.
        let parts: &[&str] = match language {
            "c99" => &["two_link.h", "two_link.c"],
            _ => &["include/two_link.h", "src/model.rs", "src/lib.rs"],
        };
        assert!(compiles(&first, language));
        for part in parts {
            let own = std::fs::read(first.join(part)).unwrap();
            std::fs::copy(second.join(part), first.join(part)).unwrap();
            assert!(!compiles(&first, language), "{part} of another model compiled");
            std::fs::write(first.join(part), own).unwrap();
        }
        assert!(compiles(&first, language));
    }
}

/// Whether the sources of `two_link` in a folder compile.
fn compiles(out: &Path, language: &str) -> bool {
    let mut command = if language == "c99" {
        let mut command = Command::new("cc");
        command.args(STRICT).arg("-c").arg(out.join("two_link.c"));
        command.arg("-o").arg(folder("mixed.o"));
        command
    } else {
        let mut command = Command::new(env!("CARGO"));
        command.args(["check", "--offline", "--quiet", "--manifest-path"]);
        command.arg(out.join("Cargo.toml"));
        command.env("CARGO_TARGET_DIR", folder("target"));
        command
    };
    command.output().expect("the compiler runs").status.success()
}
