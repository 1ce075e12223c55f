//! The peers: what can be installed of them is compiled here, and run like our own code.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Generators of code, in the order of the page's columns; the first is Pinocchio's own way through CasADi.
pub(crate) const GENERATORS: [&str; 4] = ["Pinocchio's CasADi", "CasADi", "wrenfold", "sympy"];

/// What is there of the peers, and what is not and why.
pub(crate) struct Peers {
    folder: PathBuf,
    python: String,
    /// Times Pinocchio on a chain.
    pinocchio: Option<PathBuf>,
    /// Writes Pinocchio's inverse dynamics as C by way of CasADi.
    by_pinocchio: Option<PathBuf>,
    /// Versions for the page.
    pub(crate) versions: Vec<(String, String)>,
    /// What is left out.
    pub(crate) missing: Vec<String>,
}

/// A program of a peer for one chain, and how many milliseconds of processor time its generation took.
pub(crate) struct Contestant {
    pub(crate) name: &'static str,
    pub(crate) program: PathBuf,
    pub(crate) generation: Option<f64>,
}

/// Output of a program that succeeds.
fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    output.status.success().then_some(text)
}

fn sources() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/page/peer")
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

impl Peers {
    /// Looks for the peers and compiles what does not depend on the model.
    pub(crate) fn find() -> Self {
        let python = std::env::var("MODELMILL_PEERS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let mut peers = Self {
            folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("peers"),
            python,
            pinocchio: None,
            by_pinocchio: None,
            versions: Vec::new(),
            missing: Vec::new(),
        };
        if let Err(error) = std::fs::create_dir_all(&peers.folder) {
            let folder = peers.folder.display();
            peers.missing.push(format!("all peers: {folder}: {error}"));
            return peers;
        }
        let Some(compiler) = output("g++", &["--version"]) else {
            peers.missing.push("all peers: `g++` is not installed".to_owned());
            return peers;
        };
        let first = compiler.lines().next().unwrap_or_default().to_owned();
        peers.versions.push(("g++".to_owned(), first));
        for (name, module) in [("CasADi", "casadi"), ("wrenfold", "wrenfold"), ("sympy", "sympy")] {
            let script = format!("import {module}");
            if output(&peers.python, &["-c", &script]).is_none() {
                peers.missing.push(format!("{name}: not installed"));
                continue;
            }
            let version = format!("import importlib.metadata as m; print(m.version('{module}'))");
            let version = output(&peers.python, &["-c", &version]).unwrap_or_default();
            peers.versions.push((name.to_owned(), version));
        }
        peers.find_pinocchio();
        peers
    }

    /// Headers and libraries of Pinocchio and CasADi lie beside their Python modules.
    fn find_pinocchio(&mut self) {
        let script = "import pinocchio, pathlib; \
            print(pathlib.Path(pinocchio.__file__).resolve().parents[4]); print(pinocchio.__version__)";
        let found = output(&self.python, &["-c", script]);
        let Some((prefix, version)) = found.as_deref().and_then(|f| f.split_once('\n')) else {
            self.missing.push("Pinocchio: not installed".to_owned());
            return;
        };
        let version = version.trim().to_owned();
        self.versions.push(("Pinocchio".to_owned(), version));
        // Pinocchio has more kinds of joints than Boost's lists hold by default.
        let mut arguments: Vec<String> = [
            "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
            "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
            "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
            "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
        ]
        .map(str::to_owned)
        .to_vec();
        arguments.extend([
            format!("-I{prefix}/include"),
            format!("-I{prefix}/include/eigen3"),
            format!("-L{prefix}/lib"),
            format!("-Wl,-rpath,{prefix}/lib"),
        ]);
        let library = "-lpinocchio_default".to_owned();
        let mut timed = arguments.clone();
        timed.extend([text(&sources().join("rnea.cpp")), library.clone()]);
        eprintln!("compiling Pinocchio's programs, which takes minutes at the first time");
        self.pinocchio = self.compiled("pinocchio", "-O3", &timed);
        let script = "import casadi, pathlib; print(pathlib.Path(casadi.__file__).resolve().parent)";
        if let Some(casadi) = output(&self.python, &["-c", script]) {
            // Only the code that it writes is timed.
            arguments.extend([
                format!("-I{casadi}/include"),
                text(&sources().join("by_pinocchio.cpp")),
                library,
                format!("-L{casadi}"),
                format!("-Wl,-rpath,{casadi}"),
                "-lcasadi".to_owned(),
            ]);
            self.by_pinocchio = self.compiled("by_pinocchio", "-O1", &arguments);
        }
    }

    /// Whether a peer is there at all.
    pub(crate) fn installed(&self, name: &str) -> bool {
        match name {
            "Pinocchio" => self.pinocchio.is_some(),
            name if name == GENERATORS[0] => self.by_pinocchio.is_some(),
            name => self.versions.iter().any(|(found, _)| found == name),
        }
    }

    /// A program from C++ sources; one that is newer than these is kept.
    fn compiled(&mut self, name: &str, level: &str, arguments: &[String]) -> Option<PathBuf> {
        let program = self.folder.join(name);
        let made = |path: &Path| path.metadata().and_then(|m| m.modified()).ok();
        let given = arguments
            .iter()
            .map(Path::new)
            .filter(|a| a.extension().is_some_and(|e| e == "cpp"));
        let headers = ["chain.hpp", "arm.hpp"].map(|h| sources().join(h));
        let newest = given
            .filter_map(made)
            .chain(headers.iter().filter_map(|h| made(h)))
            .max();
        if made(&program) > newest {
            return Some(program);
        }
        let mut command = Command::new("g++");
        command.args(["-std=c++17", level, "-march=native", "-DNDEBUG", "-o"]);
        let include = format!("-I{}", sources().display());
        let output = command.arg(&program).arg(include).args(arguments).output();
        let reason = match output {
            Ok(output) if output.status.success() => return Some(program),
            Ok(output) => {
                let errors = String::from_utf8_lossy(&output.stderr).into_owned();
                let first = errors.lines().find(|line| line.contains("error"));
                first.unwrap_or("no message").to_owned()
            }
            Err(error) => error.to_string(),
        };
        self.missing.push(format!("{name}: does not compile: {reason}"));
        None
    }

    /// All peers that take this chain, compiled.
    pub(crate) fn on(&mut self, model: &str, chain: &str) -> (PathBuf, Vec<Contestant>) {
        let file = self.folder.join(format!("{model}.txt"));
        if let Err(error) = std::fs::write(&file, chain) {
            self.missing.push(format!("{model}: {error}"));
            return (file, Vec::new());
        }
        let mut contestants = Vec::new();
        if let Some(program) = self.pinocchio.clone() {
            contestants.push(Contestant {
                name: "Pinocchio",
                program,
                generation: None,
            });
        }
        let mut generated: BTreeMap<&str, f64> = BTreeMap::new();
        let start = self.folder.join(format!("{model} "));
        let old = |name: &str| std::fs::read(format!("{}{name}.cpp", start.display())).ok();
        let before: BTreeMap<&str, Option<Vec<u8>>> = GENERATORS.iter().map(|name| (*name, old(name))).collect();
        let script = text(&sources().join("generated.py"));
        let (from, to) = (text(&file), text(&start));
        let arguments = [&script[..], &from, &to];
        let lines = output(&self.python, &arguments).unwrap_or_default();
        for line in lines.lines() {
            if let Some((name, took)) = line.split_once('\t')
                && let Some(name) = GENERATORS.iter().find(|g| **g == name)
                && let Ok(took) = took.parse()
            {
                generated.insert(name, took);
            }
        }
        if let Some(program) = &self.by_pinocchio {
            let to = format!("{}{}.cpp", start.display(), GENERATORS[0]);
            let took = output(&text(program), &[&text(&file), &to]);
            if let Some(took) = took.and_then(|t| t.parse().ok()) {
                generated.insert(GENERATORS[0], took);
            }
        }
        for name in GENERATORS {
            let Some(took) = generated.get(name) else {
                continue;
            };
            // Code that has not changed is not compiled again.
            let code = PathBuf::from(format!("{}{name}.cpp", start.display()));
            let program = format!("{model} {name}");
            let same = before.get(name).is_some_and(|old| *old == std::fs::read(&code).ok());
            let kept = self.folder.join(&program);
            let program = if same && kept.exists() {
                Some(kept)
            } else {
                _ = std::fs::remove_file(&kept);
                let arguments = [text(&code), text(&sources().join("timed.cpp"))];
                self.compiled(&program, "-O3", &arguments)
            };
            contestants.extend(program.map(|program| Contestant {
                name,
                program,
                generation: Some(*took),
            }));
        }
        (file, contestants)
    }
}
