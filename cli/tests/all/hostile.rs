//! Free text and names that would be code, marks or commands in some output: none of them is, and every crate compiles.
//!
//! The same model is written with harmless texts beside it. What both give may differ in texts and comments only.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::common::{Ran, ran};
use crate::languages::{STRICT, cargo, folder, has_its_crates, python, python_library, run, there, written_of};

/// Each would do something where it is let out: end a comment or a string, begin a line, steer a terminal, be a tag.
const TEXTS: [&str; 34] = [
    "*/ int evil(void); /*",
    "*/\n#error let out\n/*",
    "a\ncompile_error!(\"let out\");\n#error let out\nraise SystemExit(3)\n",
    "a\rcompile_error!(\"let out\");\r#error let out\r",
    "a\u{2028}compile_error!(\"let out\");\u{2029}b",
    "a\u{85}b\u{b}c\u{c}d",
    "\\\n#error let out",
    "joins the next line \\",
    "??/\n#error let out",
    "joins the next line ??/",
    "// /* // */ /**/ //* */",
    "\"\"\" + __import__('os')._exit(3) + \"\"\"",
    "\" + evil() + \"",
    "'); evil(); ('",
    "\"#; evil(); r#\"",
    "{} {0} {evil:?} %s %n %d",
    "nothing\u{0}behind",
    "\u{1b}[31mred\u{1b}[2J\u{1b}]0;title\u{7}",
    "\u{9b}31mred",
    "\u{202e}turned\u{202c}",
    "\u{2066}apart\u{2069}\u{200f}\u{61c}",
    "\u{feff}\u{e0041}\u{fff9}",
    "</script><script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "\" onload=\"alert(1)",
    "<!-- --> ]]> <![CDATA[",
    "[a](javascript:x) ![b](ftp://c) [d]: ftp://e",
    "| cell | `code` **bold** _it_ # head",
    "$x$ \\( y \\) \\input{x} % rest",
    "\\end{document} \\end{verbatim} ^^M ~",
    "&amp; &lt;script&gt; &#60;",
    "=cmd()|' /C calc'!A0",
    "#![feature(evil)] #[path = \"/etc/passwd\"] mod evil;",
    "\t#include </etc/passwd>",
];

/// Words of Rust, C and Python, macros and names of their libraries, of the emitted code itself, and names that differ in
/// case only.
const NAMES: [&str; 59] = [
    "double",
    "Double",
    "DOUBLE",
    "int",
    "Int",
    "restrict",
    "volatile",
    "register",
    "errno",
    "NULL",
    "NAN",
    "INFINITY",
    "M_PI",
    "I",
    "EOF",
    "linux",
    "size_t",
    "fn",
    "crate",
    "self",
    "Self",
    "super",
    "dyn",
    "type",
    "T",
    "Model",
    "Geometry",
    "n",
    "N",
    "q",
    "once",
    "input",
    "prepared",
    "lambda",
    "def",
    "None",
    "True",
    "nonlocal",
    "numpy",
    "p1_min",
    "yield_ok",
    "Err",
    "f64",
    "core",
    "Some",
    "Ok",
    "One",
    "Var",
    "N_BASE",
    "INPUTS",
    "POSE",
    "Gravity",
    "Bias",
    "Forces",
    "Columns",
    "sines",
    "cosines",
    "DBL_MAX",
    "LARGEST_INPUT",
];

/// A text between quotes of TOML.
fn quoted(text: &str) -> String {
    let mut out = "\"".to_owned();
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            ' '..='~' => out.push(c),
            c => _ = write!(out, "\\U{:08x}", u32::from(c)),
        }
    }
    out + "\""
}

/// Two links whose names are words elsewhere, with a text wherever one may stand.
fn model(text: &dyn Fn(usize) -> String) -> String {
    let mut k = 0;
    let mut next = || {
        k += 1;
        quoted(&text(k))
    };
    let all: Vec<String> = (0..TEXTS.len()).map(text).collect();
    let mut out = format!(
        "schema = 1\nname = \"yield\"\ntitle = {}\ngravity = [0, \"-while\", 0]\n[constants]\nwhile = {{ value = 9.81, unit = \
         \"m/s^2\" }}\n",
        quoted(&all.join(" "))
    );
    for (i, name) in NAMES.iter().enumerate() {
        let value = 0.01 * (i + 1) as f64;
        _ = writeln!(out, "{name} = {{ value = {value}, unit = \"m\", note = {} }}", next());
    }
    let lengths = NAMES.join(" + ");
    _ = write!(
        out,
        "[parameters]
struct = {{ nominal = 2.0, unit = \"kg\", note = {} }}
Struct = {{ nominal = 3.0, unit = \"kg\", note = {} }}
[coordinates]
async = {{ nominal = 0.4, note = {} }}
Async = {{ nominal = 0.8, note = {} }}
[[frame]]
name = \"mod\"
on = \"base\"
modified_dh = {{ theta = \"async\" }}
note = {}
[[frame]]
name = \"union\"
on = \"mod\"
modified_dh = {{ a = \"{lengths}\", theta = \"Async\" }}
[[lumped_mass]]
mass = \"struct\"
on = \"union\"
at = [0.5, 0]
note = {}
[[lumped_mass]]
mass = \"Struct\"
on = \"union\"
at = [0, 0.3]
[[part]]
on = \"union\"
linear = {{ planar = \"_if\", nominal = {{ ZZ = 0.1, MX = 0.3, MY = 0.01 }} }}
note = {}
[[part]]
on = \"mod\"
linear = {{ planar = \"_else\", nominal = {{ ZZ = 0.7, MX = 0.2, MY = 0.02 }} }}
[[drive]]
name = \"loop\"
joint = \"async\"
note = {}
[[drive]]
name = \"for\"
joint = \"Async\"
[[effect_kind]]
name = \"import\"
on = [\"drive\"]
expression = \"return*rate\"
says = {}
explains = {}
doubles = {}
parameters = {{ return = {{ unit = {{ force = \"N s/m\", torque = \"N m s/rad\" }}, note = {} }} }}
[[effect]]
kind = \"import\"
at = [\"loop\"]
parameters = {{ return = {{ nominal = 0.3 }} }}
note = {}
",
        next(),
        next(),
        next(),
        next(),
        next(),
        next(),
        next(),
        next(),
        next(),
        next(),
        next(),
        next(),
        next()
    );
    out.replace("mass = \"struct\"", "mass = \"struct\"\nname = \"switch\"")
}

/// The model with hostile texts, or with as many harmless ones.
fn written(hostile: bool) -> PathBuf {
    let out = folder(if hostile { "hostile" } else { "harmless" });
    std::fs::create_dir_all(&out).unwrap();
    let name = if hostile {
        "yield \u{1b}]0;name\u{7}\u{202e}\n#error \"\"\" ??' <script>alert(1)<'script> *.toml"
    } else {
        "yield.toml"
    };
    let path = out.join(name);
    let text: &dyn Fn(usize) -> String = if hostile {
        &|k| TEXTS[k % TEXTS.len()].to_owned()
    } else {
        &|k| format!("remark {k}")
    };
    std::fs::write(&path, model(text)).unwrap();
    path
}

/// Whether a character moves a cursor, turns the direction of writing, or is not to be seen.
fn steers(c: char) -> bool {
    (c.is_control() && c != '\n' && c != '\t')
        || matches!(
            c,
            '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}'
        )
        || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{206f}' | '\u{e0000}'..='\u{e007f}')
}

#[track_caller]
fn steers_nothing(what: &str, text: &str) {
    let found = text.find(steers);
    let line = found.map(|at| {
        text[..at].lines().last().unwrap_or_default().to_owned() + &text[at..].chars().take(20).collect::<String>()
    });
    assert_eq!(line, None, "{what}");
}

/// What a command prints, which must succeed.
#[track_caller]
fn printed(args: &[&str]) -> String {
    let Ran { status, out, err } = ran(args);
    assert_eq!(status, 0, "{args:?}: {err}");
    steers_nothing("standard output", &out);
    steers_nothing("standard error", &err);
    out
}

/// Markdown without what a backslash makes plain text.
fn unescaped(page: &str) -> String {
    let mut out = String::new();
    let mut chars = page.chars();
    while let Some(c) = chars.next() {
        if c == '\\' {
            chars.next();
        } else {
            out.push(c);
        }
    }
    out
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Pieces of a text that begin with one sign and end before another.
fn pieces<'a>(text: &'a str, begins: &str, is_part: fn(char) -> bool) -> Vec<&'a str> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(at) = rest.find(begins) {
        rest = &rest[at + begins.len()..];
        let end = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        found.push(&rest[..end]);
        rest = &rest[end..];
    }
    found
}

#[test]
fn hostile_texts_are_texts_in_every_output() {
    let [hostile, harmless] = [true, false].map(written);
    let [hostile, harmless] = [text(&hostile), text(&harmless)];
    printed(&["check", hostile]);
    let told: serde_json::Value = serde_json::from_str(&printed(&["check", hostile, "--json"])).unwrap();
    assert_eq!(told["valid"], true);
    assert_eq!(told["title"], TEXTS.join(" "), "JSON holds another title");
    printed(&["diff", harmless, hostile]);
    let library = Path::new(hostile).with_file_name("library.toml");
    let text_of = std::fs::read_to_string(hostile).unwrap();
    let kind = text_of
        .split("[[effect_kind]]")
        .nth(1)
        .unwrap()
        .split("[[effect]]")
        .next()
        .unwrap();
    std::fs::write(&library, format!("[[effect_kind]]{kind}")).unwrap();
    for kind in [&[][..], &["import"], &["--json"]] {
        printed(&[&["effects", "--library", text(&library)][..], kind].concat());
    }
    let checked = [hostile, harmless].map(|model| printed(&["check", model]).lines().count());
    assert_eq!(checked[0], checked[1], "a title begins lines of its own");
    let equations = |format: &str| [hostile, harmless].map(|model| printed(&["equations", model, "--format", format]));
    printed(&["equations", hostile, "--json"]);
    equations("text");

    let [bad, good] = equations("html");
    assert_eq!(
        pieces(&bad, "<", |c| c != '>'),
        pieces(&good, "<", |c| c != '>'),
        "other tags"
    );
    let [bad, good] = equations("markdown");
    assert_eq!(bad.lines().count(), good.lines().count());
    for sign in ["](", "![", "<script", "<img", "**", "`", "|"] {
        let [bad, good] = [&bad, &good].map(|page| unescaped(page).matches(sign).count());
        assert_eq!(bad, good, "{sign}");
    }
    let [bad, good] = equations("latex");
    assert_eq!(bad.lines().count(), good.lines().count());
    let commands = |page: &str| {
        let all = pieces(page, "\\", |c| c.is_ascii_alphabetic());
        let commands = all
            .into_iter()
            .filter(|name| !name.is_empty() && !name.starts_with("textascii") && *name != "textbackslash");
        commands.map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(commands(&bad), commands(&good), "other commands of LaTeX");
    assert_eq!(
        bad.matches("\\end{document}").count(),
        good.matches("\\end{document}").count()
    );
}

#[test]
fn hostile_names_of_files_and_columns_are_texts_in_every_output() {
    let model = written(true);
    let (model, place) = (text(&model), model.parent().unwrap());
    let motion = place.join("motion.csv");
    let mut table = "t,async,Async,async_d,Async_d,async_dd,Async_dd\n".to_owned();
    for k in 0..300 {
        let t = 0.01 * f64::from(k);
        let (a, b) = (3.0 * t, 4.1 * t);
        _ = writeln!(
            table,
            "{t},{},{},{},{},{},{}",
            a.sin(),
            b.cos(),
            3.0 * a.cos(),
            -4.1 * b.sin(),
            -9.0 * a.sin(),
            -16.81 * b.cos()
        );
    }
    std::fs::write(&motion, &table).unwrap();
    let forces = printed(&["evaluate", model, "--data", text(&motion)]);
    let joined = table
        .lines()
        .zip(forces.lines())
        .enumerate()
        .map(|(k, (motion, force))| {
            let more = if k == 0 {
                "\"*' \u{1b}[2J\u{202e}</script>, =cmd() \"\"x\"\"\"".to_owned()
            } else {
                format!("{k}")
            };
            format!("{motion},{},{more}", force.split_once(',').unwrap().1)
        });
    let data = place.join("run \u{1b}[2J\u{202e}\n<script>alert(1)<'script> \"\"\" ??' *' .csv");
    std::fs::write(&data, joined.collect::<Vec<_>>().join("\n")).unwrap();
    let data = text(&data);
    let fit = place.join("fit.json");
    printed(&["identify", model, "--data", data, "--out", text(&fit)]);
    serde_json::from_str::<serde_json::Value>(&std::fs::read_to_string(&fit).unwrap()).unwrap();
    printed(&["compare", model, "--data", data, "--parameters", text(&fit)]);
    printed(&["compare", model, "--data", data, "--json"]);
    let out = place.join("report");
    printed(&["report", model, "--data", data, "--out", text(&out)]);
    for file in std::fs::read_dir(&out).unwrap() {
        let path = file.unwrap().path();
        let page = std::fs::read_to_string(&path).unwrap();
        steers_nothing("a page", &page);
        if path.extension().is_some_and(|end| end == "html") {
            crate::common::html::check(&page);
        }
        assert!(!page.contains("<script>alert") && !page.contains("<img"));
    }
    // Names that are none are refused without harm.
    for name in ["a b", "\u{e9}", "1", "_x", "*/", "\u{1b}[31m", "a\nb", ""] {
        let path = place.join("refused.toml");
        let text_of = std::fs::read_to_string(model).unwrap();
        std::fs::write(
            &path,
            text_of.replace("name = \"switch\"", &format!("name = {}", quoted(name))),
        )
        .unwrap();
        let ran = ran(&["check", text(&path)]);
        assert_eq!(ran.status, 1, "{name:?}");
        steers_nothing("a refusal", &ran.err);
    }
}

/// Code without its comments.
fn code(source: &str) -> String {
    let mut out = String::new();
    let mut rest = source;
    while let Some(at) = rest.find("/*") {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        rest = &rest[rest.find("*/").expect("a comment that ends") + 2..];
    }
    out.push_str(rest);
    let lines = out.lines().filter(|line| !line.trim_start().starts_with("//"));
    without_fingerprints(&lines.collect::<Vec<_>>().join("\n"))
}

/// Code without its fingerprints, hexadecimal numbers of 16 digits, which depend on comments too.
fn without_fingerprints(code: &str) -> String {
    let mut parts = code.split("0x");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let digits = part.chars().take_while(char::is_ascii_hexdigit).count();
        out.push_str("0x");
        out.push_str(if digits == 16 { &part[16..] } else { part });
    }
    out
}

#[test]
fn crates_of_hostile_models_compile_and_hold_no_code_of_theirs() {
    let models = [true, false].map(written);
    let all = ["--dynamics", "--reactions", "--self-test"];
    let [bad, good] = [&models[0], &models[1]].map(|model| printed(&[&["generate", text(model)][..], &all].concat()));
    assert_eq!(code(&bad), code(&good), "other code in Rust");
    for sign in ["<script", "](javascript", "<img"] {
        assert!(!bad.contains(sign), "{sign} in documentation of Rust");
    }
    // Texts of the file are in comments of Julia, which begin with `#`, and in literals without `$` only.
    let [bad_julia, good_julia] = [&models[0], &models[1]].map(|model| {
        let file = printed(&["generate", text(model), "--language", "julia", "--dynamics"]);
        let lines = file
            .lines()
            .map(|line| line.split('#').next().unwrap_or_default().trim_end());
        lines.collect::<Vec<_>>().join("\n")
    });
    assert_eq!(bad_julia, good_julia, "other code in Julia");
    let crates = |language: &str, more: &[&str]| {
        let of = |name: &str, model| written_of(model, name, language, more);
        let [bad, good] = [of("hostile", &models[0]), of("harmless", &models[1])];
        let mut compared = 0;
        for path in [
            "src/lib.rs",
            "src/model.rs",
            "include/yield.h",
            "yield.c",
            "yield.h",
            "Cargo.toml",
            "pyproject.toml",
        ] {
            let [bad, good] = [&bad, &good].map(|out| std::fs::read_to_string(out.join(path)).ok());
            assert_eq!(bad.is_some(), good.is_some(), "{path}");
            let (Some(bad), Some(good)) = (bad, good) else {
                continue;
            };
            compared += 1;
            steers_nothing(path, &bad);
            assert_eq!(code(&bad), code(&good), "other code in {path}");
        }
        assert!(compared >= 2, "{language}: {compared} files were compared");
        bad
    };
    let place = models[0].parent().unwrap();

    check_module(place, &bad);
    let compilers =
        [("cc", "c"), ("c++", "c++")].map(|(program, language)| there(program).then_some((program, language)));
    let c99 = crates("c99", &all);
    let c = crates("c", &["--dynamics"]);
    // Symbols are read, and nothing is run.
    let quickly = ["lto='off'", "opt-level=0", "codegen-units=16"].map(|set| format!("profile.release.{set}"));
    let quickly: Vec<&str> = quickly.iter().flat_map(|set| ["--config", set.as_str()]).collect();
    cargo("build", &c, &quickly);
    if compilers[0].is_some() {
        let object = place.join("yield.o");
        run(std::process::Command::new("cc")
            .args(STRICT)
            .args(["-O0", "-c"])
            .arg(c99.join("yield.c"))
            .arg("-o")
            .arg(&object));
        if there("nm") {
            for built in [object, folder("target").join("release/libyield.a")] {
                let symbols = run(std::process::Command::new("nm").arg(built));
                assert!(symbols.contains("yield_forward") && !symbols.contains("evil"));
            }
        }
    }
    let source = place.join("header.c");
    std::fs::write(&source, "#include \"yield.h\"\nextern int harmless;\n").unwrap();
    for (program, language) in compilers.into_iter().flatten() {
        for include in [c.join("include"), c99.clone()] {
            run(std::process::Command::new(program)
                .args([
                    "-Wall",
                    "-Wextra",
                    "-Werror",
                    "-pedantic",
                    "-fsyntax-only",
                    "-x",
                    language,
                ])
                .arg("-I")
                .arg(include)
                .arg(&source));
        }
    }

    let module = crates("python", &["--dynamics"]);
    import(place, &module);
}

/// Compiles a module of Rust with everything in it, where any warning is an error.
fn check_module(place: &Path, module: &str) {
    let rust = place.join("rust");
    std::fs::create_dir_all(rust.join("src")).unwrap();
    std::fs::write(rust.join("src/model.rs"), module).unwrap();
    std::fs::write(
        rust.join("src/lib.rs"),
        "#![no_std]\n#![deny(warnings)]\npub mod model;\n",
    )
    .unwrap();
    let runtime = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../runtime")
        .canonicalize()
        .unwrap();
    std::fs::write(
        rust.join("Cargo.toml"),
        format!(
            "[package]\nname = \"hostile\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[dependencies]\nmodelmill-runtime = {{ path = {} }}\n\
             [workspace]\n",
            quoted(text(&runtime))
        ),
    )
    .unwrap();
    std::fs::copy(runtime.join("../Cargo.lock"), rust.join("Cargo.lock")).unwrap();
    cargo("check", &rust, &[]);
}

/// Builds a Python module and imports it.
fn import(place: &Path, module: &Path) {
    if !cfg!(target_os = "linux") || !has_its_crates(module) {
        return;
    }
    cargo("build", module, &[]);
    let Some(python) = python() else {
        println!("skipped: there is no python3 on this machine");
        return;
    };
    let imported = place.join("module");
    std::fs::create_dir_all(&imported).unwrap();
    std::fs::copy(python_library("yield_model"), imported.join("yield_model.so")).unwrap();
    let script = "import sys; sys.path.insert(0, sys.argv[1]); import yield_model as m; \
                  names = [n for n in dir(m) if 'evil' in n]; assert not names, names; \
                  assert m.CONSTANTS['double'] == 0.01 and m.CONSTANTS['Double'] == 0.02; \
                  assert m.COORDINATES == ['async', 'Async'] and 'H_min' in m.__doc__; print('imported')";
    let says = run(std::process::Command::new(python).args(["-c", script]).arg(&imported));
    assert_eq!(says, "imported\n");
}
