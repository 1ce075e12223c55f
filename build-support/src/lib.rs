//! Generates models from a build script, as people use prost-build.
//!
//! In `build.rs`:
//!
//! ```no_run
//! modelmill_build::generate("models/*.toml");
//! ```
//!
//! and in the crate, `include!(concat!(env!("OUT_DIR"), "/models.rs"));`, which brings one module per model file.
//! The crate needs `modelmill-runtime` as a dependency and `modelmill-build` as a build dependency.
//!
//! Decision: this is a crate of its own, because `modelmill-codegen` must not read files. Reading files, telling
//! Cargo when to run again and printing diagnostics belong together, so they have one place.

mod module_cache;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use module_cache::ModuleCache;

/// Why models could not be generated: the model files' own diagnostics, rendered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BuildError(String);

impl std::fmt::Display for BuildError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BuildError {}

/// What is generated in addition to regressor and inverse dynamics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Options {
    /// The equation of motion (`Dynamics`): mass matrix, velocity terms, gravity, forward dynamics. It nearly doubles the
    /// code, so that it is made on demand.
    pub dynamics: bool,
    /// What the joints transmit (`Reactions`): forces and moments in all joints, and the forces that close loops.
    pub reactions: bool,
    /// A test of the base parameters (`self_test()`), to be called in a test of the crate.
    pub self_test: bool,
}

impl Options {
    /// With the equation of motion.
    #[must_use]
    pub fn with_dynamics(mut self) -> Self {
        self.dynamics = true;
        self
    }

    /// With reactions.
    #[must_use]
    pub fn with_reactions(mut self) -> Self {
        self.reactions = true;
        self
    }

    /// With a test of the base parameters.
    #[must_use]
    pub fn with_self_test(mut self) -> Self {
        self.self_test = true;
        self
    }
}

/// Generates a module for every model file that `pattern` names: a file, or a folder with `/*.toml`.
///
/// Writes `models.rs` to the build's output folder, and derives only models that changed since the last build. Reruns when
/// a model file or one that it extends changes, and ends the build with the model's own diagnostics if one is at fault.
pub fn generate(pattern: &str) {
    generate_with(pattern, Options::default());
}

/// Generates like [`generate`], with `options`.
pub fn generate_with(pattern: &str, options: Options) {
    println!("cargo::rerun-if-changed=build.rs");
    let out = std::env::var_os("OUT_DIR").map(PathBuf::from);
    let result = match out {
        Some(out) => try_generate_with(pattern, options, &out.join("models.rs")),
        None => Err(BuildError(
            "OUT_DIR is not set: call this from a build script".to_owned(),
        )),
    };
    if let Err(error) = result {
        for line in error.0.lines() {
            println!("cargo::error={line}");
        }
        std::process::exit(1);
    }
}

/// Generates like [`generate`] into a given file, and returns what is wrong instead of ending the process.
///
/// # Errors
/// Diagnostics of all faulty model files together.
pub fn try_generate(pattern: &str, out: &Path) -> Result<(), BuildError> {
    try_generate_with(pattern, Options::default(), out)
}

/// Generates like [`try_generate`], with `options`.
///
/// # Errors
/// Diagnostics of all faulty model files together.
pub fn try_generate_with(pattern: &str, options: Options, out: &Path) -> Result<(), BuildError> {
    let files = matching_model_files(pattern)?;
    let mut text = String::new();
    let mut faults = String::new();
    let mut names = BTreeSet::new();
    let cache = ModuleCache::in_folder_of(out);
    for file in &files {
        match generate_module(file, options, cache.as_ref()) {
            Ok((name, module)) if names.insert(name.clone()) => text.push_str(&module),
            Ok((name, _)) => {
                _ = writeln!(
                    faults,
                    "{}: another model is called `{name}` too; change `name` in one of them",
                    file.display()
                );
            }
            Err(error) => faults.push_str(&error.0),
        }
    }
    if !faults.is_empty() {
        return Err(BuildError(faults));
    }
    // An unchanged file keeps its date, so that nothing behind it is built again.
    if std::fs::read_to_string(out).is_ok_and(|old| old == text) {
        return Ok(());
    }
    modelmill_boundary::files::write(out, text.as_bytes()).map_err(|error| BuildError(format!("cannot write {error}")))
}

fn matching_model_files(pattern: &str) -> Result<Vec<PathBuf>, BuildError> {
    let Some(folder) = pattern.strip_suffix("/*.toml") else {
        return Ok(vec![PathBuf::from(pattern)]);
    };
    println!("cargo::rerun-if-changed={folder}");
    let entries =
        std::fs::read_dir(folder).map_err(|error| BuildError(format!("cannot read folder `{folder}`: {error}")))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    if files.is_empty() {
        return Err(BuildError(format!("no model file `*.toml` in folder `{folder}`")));
    }
    Ok(files)
}

/// Name and text of the module of a model file. A module that was generated from the same texts before is taken from
/// the cache.
fn generate_module(file: &Path, options: Options, cache: Option<&ModuleCache>) -> Result<(String, String), BuildError> {
    let loaded = modelmill_spec::load_file(file);
    let sources = match &loaded {
        Ok(loaded) => &loaded.sources,
        Err(failure) => &failure.sources,
    };
    println!("cargo::rerun-if-changed={}", file.display());
    for source in sources.paths() {
        println!("cargo::rerun-if-changed={}", source.display());
    }
    let loaded = loaded.map_err(|failure| BuildError(failure.render(false)))?;
    for line in loaded.render(false).lines() {
        println!("cargo::warning={line}");
    }
    let name = loaded.mechanism.name.clone();
    let key = cache.map(|cache| cache.key(&loaded.sources, options));
    if let (Some(cache), Some(key)) = (cache, key)
        && let Some(module) = cache.find_module(&name, key)
    {
        return Ok((name, module));
    }
    let derivation = modelmill_codegen::derive(&loaded.mechanism)
        .map_err(|error| BuildError(format!("{}: {error}\n", file.display())))?;
    let fault = |error| BuildError(format!("{}: {error}\n", file.display()));
    let mut emitted = modelmill_emit::emit(&derivation);
    if options.dynamics {
        let dynamics = derivation.dynamics().map_err(fault)?;
        emitted = emitted.with_dynamics(&derivation, &dynamics);
    }
    if options.reactions {
        let reactions = derivation.reactions().map_err(fault)?;
        emitted = emitted.with_reactions(&derivation, &reactions);
    }
    if options.self_test {
        emitted = emitted.with_self_test(&derivation);
    }
    let module = emitted.module();
    if let (Some(cache), Some(key)) = (cache, key) {
        cache.keep_module(&name, key, &module);
    }
    Ok((name, module))
}
