//! Modules of earlier builds, one file for each model, so that a build after a change of one model derives that one alone.
//!
//! Decision: the key is a hash of all texts that a model file reads, of the options, and of the running program, because
//! a build script contains the derivation. So no version needs to be maintained, and no module of another derivation is
//! ever used.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use modelmill_spec::SourceFiles;

use crate::Options;

/// The folder of the cache, in that of the generated file.
const FOLDER: &str = "modelmill-modules";

/// Modules of earlier builds.
pub(crate) struct ModuleCache {
    /// Their folder.
    folder: PathBuf,
    /// Hash of the running program.
    program: u64,
}

/// Hash of everything that a module depends on: two of 64 bits, since one may collide.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct ModuleKey([u64; 2]);

impl ModuleCache {
    /// The cache in the folder of the generated file; `None` if the running program cannot be read.
    pub(crate) fn in_folder_of(out: &Path) -> Option<Self> {
        let program = std::fs::read(std::env::current_exe().ok()?).ok()?;
        let mut hasher = DefaultHasher::new();
        program.hash(&mut hasher);
        Some(Self {
            folder: out.parent()?.join(FOLDER),
            program: hasher.finish(),
        })
    }

    /// The key of a model with these sources.
    pub(crate) fn key(&self, sources: &SourceFiles, options: Options) -> ModuleKey {
        ModuleKey([0, 1].map(|part: u8| {
            let mut hasher = DefaultHasher::new();
            (part, self.program, format!("{options:?}")).hash(&mut hasher);
            for source in &sources.files {
                source.text.hash(&mut hasher);
            }
            hasher.finish()
        }))
    }

    /// The module of a model, if it was generated with this key.
    pub(crate) fn find_module(&self, name: &str, key: ModuleKey) -> Option<String> {
        let text = std::fs::read_to_string(self.file(name)).ok()?;
        let (known, module) = text.split_once('\n')?;
        (known == key.text()).then(|| module.to_owned())
    }

    /// Keeps a module. A cache that cannot be written costs time only, so that this is no fault.
    pub(crate) fn keep_module(&self, name: &str, key: ModuleKey, module: &str) {
        let text = format!("{}\n{module}", key.text());
        if std::fs::create_dir_all(&self.folder).is_ok() {
            _ = modelmill_boundary::files::write(&self.file(name), text.as_bytes());
        }
    }

    /// The file of a model's module. Names of models are identifiers.
    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.txt"))
    }
}

impl ModuleKey {
    /// The key as one line.
    fn text(self) -> String {
        format!("{:016x}{:016x}", self.0[0], self.0[1])
    }
}
