//! Options for reading and preparing recordings, shared by all commands that read them.

use std::path::Path;

use clap::Args;
use modelmill::Host;
use modelmill::recording::{RecordingOptions, StandstillRule};

use crate::args::declared::DeclaredArgs;
use crate::flags::{FlagWording, quote_word};

/// How recordings are read and states are prepared.
#[derive(Debug, Clone, PartialEq, Args)]
#[command(next_help_heading = "Reading and preparing recordings")]
pub(crate) struct PreparationArgs {
    #[command(flatten)]
    declared: DeclaredArgs<RecordingOptions>,
    /// Columns of the recording from a file with the table `[recording.columns]`, which `modelmill recordings --model`
    /// prints; `--map` has priority
    #[arg(long, value_name = "FILE.toml", value_parser = read_mapping)]
    mapping: Option<MappingFile>,
}

/// A mapping file that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
struct MappingFile {
    /// The argument.
    path: String,
    /// Names of the model with their columns.
    columns: Vec<(String, String)>,
}

impl PreparationArgs {
    /// The same as options of the library. Columns of `--map` come before those of the mapping file for other names.
    pub(crate) fn reading(&self) -> RecordingOptions {
        let mut options = self.declared.options.clone();
        let of_file = self.mapping.iter().flat_map(|file| &file.columns);
        let is_free = |(ours, _): &&(String, String)| options.columns.iter().all(|(mine, _)| mine != ours);
        let added: Vec<_> = of_file.filter(is_free).cloned().collect();
        options.columns.extend(added);
        options
    }

    /// The rule of `--standstill`.
    pub(crate) fn standstill(&self) -> StandstillRule {
        self.declared.options.standstill
    }

    /// The options that differ from their defaults, as text for a command line, each with a space before it.
    #[cfg_attr(
        not(feature = "workbench"),
        expect(dead_code, reason = "only the workbench prints them")
    )]
    pub(crate) fn to_flags(&self) -> String {
        let mapping = self
            .mapping
            .iter()
            .map(|file| format!(" --mapping {}", quote_word(&file.path)));
        self.declared.to_flags() + &mapping.collect::<String>()
    }
}

/// Reads a mapping file.
fn read_mapping(path: &str) -> Result<MappingFile, String> {
    let columns = Host::new().column_mapping(Path::new(path));
    Ok(MappingFile {
        path: path.to_owned(),
        columns: columns.map_err(|error| error.format_for(&FlagWording))?,
    })
}
