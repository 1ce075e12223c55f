//! `modelmill-fleet`: evaluates recordings of many machines of one kind, on one computer.
//!
//! `make` simulates a fleet with known changes, `plan` fixes how recordings are prepared, `identify` summarises them
//! and reports parameters and changes of every robot, and `score` compares results with the known changes.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use modelmill::print::{CommandName, OptionName, OptionSetting, RemedyWording, RustWording};
use modelmill::recording::{RecordingOptions, StatePreparation};
use modelmill_fleet::{FleetFault, folder};
use modelmill_fleet_program::{generate, identify, score};

/// Evaluate recordings of many machines of one kind: parameters per robot and day, changes and their days, outliers.
#[derive(Parser)]
#[command(name = "modelmill-fleet", version)]
struct FleetCli {
    /// The command to run.
    #[command(subcommand)]
    command: FleetCommand,
}

/// The commands.
#[derive(Subcommand)]
enum FleetCommand {
    /// Simulate a fleet of five-bars with known changes, as Parquet.
    Make(MakeArgs),
    /// Fix how every recording is prepared, from a few recordings of faultless machines.
    Plan(PlanArgs),
    /// Summarise a folder of recordings and report changes, outliers and dead sensors.
    Identify(FleetIdentifyArgs),
    /// Compare the results of `identify` with the known changes of `make`.
    Score {
        /// The folder that `identify` wrote.
        found: PathBuf,
        /// `truth.json`, which `make` wrote.
        truth: PathBuf,
    },
}

/// `make`.
#[derive(clap::Args)]
struct MakeArgs {
    /// Folder for the fleet.
    folder: PathBuf,
    /// Number of robots.
    #[arg(long, default_value_t = 100)]
    robots: usize,
    /// Number of days, at least 6.
    #[arg(long, default_value_t = 10)]
    days: usize,
    /// Recordings per robot and day.
    #[arg(long, default_value_t = 2)]
    per_day: usize,
    /// Duration of each recording, s.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Sampling rate, Hz.
    #[arg(long, default_value_t = 250.0)]
    rate: f64,
    /// Seed; another seed gives another fleet.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of recordings that are cut off.
    #[arg(long, default_value_t = 2)]
    bad: usize,
    /// Size of the changes of friction and load: 1 as in the guide, 0.5 for half of that.
    #[arg(long, default_value_t = 1.0)]
    changes: f64,
}

/// How recordings are read, if there is no plan.
#[derive(clap::Args, Clone)]
struct ReadingArgs {
    /// Column of the recordings for a name of the model, such as `q1=pos_left`; may be repeated.
    #[arg(long = "map", value_name = "NAME=COLUMN")]
    map: Vec<String>,
    /// Cut-off of the low-pass on positions, Hz. Default: chosen from the first reference recording.
    #[arg(long)]
    cutoff: Option<f64>,
    /// Keep every n-th sample; 1 chooses it from the first reference recording.
    #[arg(long, default_value_t = 1)]
    decimate: usize,
    /// Leave out samples with NaN or empty fields.
    #[arg(long)]
    skip_bad_samples: bool,
}

impl ReadingArgs {
    /// The same as options of the library; fails for a `--map` without `=`.
    fn reading(&self) -> Result<RecordingOptions, FleetFault> {
        let columns = self.map.iter().map(|text| {
            let (ours, theirs) = text.split_once('=').ok_or_else(|| {
                FleetFault::new(format!("`--map {text}` has no column; write it as `--map q1=pos_left`"))
            })?;
            Ok((ours.to_owned(), theirs.to_owned()))
        });
        Ok(RecordingOptions {
            columns: columns.collect::<Result<_, FleetFault>>()?,
            preparation: StatePreparation {
                cutoff_hz: self.cutoff,
                decimate: self.decimate.max(1),
                ..StatePreparation::default()
            },
            skip_bad_samples: self.skip_bad_samples,
            ..RecordingOptions::default()
        })
    }
}

/// `plan`.
#[derive(clap::Args)]
struct PlanArgs {
    /// The model file.
    model: PathBuf,
    /// Recordings of faultless machines; the first determines how all are prepared.
    #[arg(required = true)]
    reference: Vec<PathBuf>,
    /// Write the plan to this file.
    #[arg(long, default_value = "plan.json")]
    out: PathBuf,
    #[command(flatten)]
    reading: ReadingArgs,
}

/// `identify`.
#[derive(clap::Args)]
struct FleetIdentifyArgs {
    /// The model file.
    model: PathBuf,
    /// Folder with recordings: `robot=R/day=D/.../FILE`, `R/D/FILE`, or `R/FILE` with the day at the start of the file
    /// name.
    recordings: PathBuf,
    /// Folder for summaries, results and page. With the same folder again, recordings that are summarised already are
    /// not read again.
    #[arg(long)]
    out: PathBuf,
    /// The plan. Default: made from recordings of eight robots.
    #[arg(long)]
    plan: Option<PathBuf>,
    /// Number of threads. Default: all cores.
    #[arg(long)]
    threads: Option<usize>,
    #[command(flatten)]
    reading: ReadingArgs,
}

fn main() -> ExitCode {
    let cli = match FleetCli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let status = u8::try_from(error.exit_code()).unwrap_or(2);
            let _ = error.print();
            return ExitCode::from(status);
        }
    };
    match run(cli.command) {
        Ok(says) => {
            print!("{says}");
            ExitCode::SUCCESS
        }
        Err(fault) => {
            eprintln!("error: {}", fault.message().format_for(&FleetWording));
            ExitCode::from(1)
        }
    }
}

/// Writes options as flags of this program, and commands as those of `modelmill`.
struct FleetWording;

impl RemedyWording for FleetWording {
    fn format_options(&self, settings: &[OptionSetting]) -> String {
        let one = |setting: &OptionSetting| {
            let flag = match setting.name {
                OptionName::Columns => "--map",
                OptionName::CutoffHz => "--cutoff",
                OptionName::Decimate => "--decimate",
                OptionName::SkipBadSamples => "--skip-bad-samples",
                _ => return RustWording.format_options(std::slice::from_ref(setting)),
            };
            match &setting.value {
                None => format!("`{flag}`"),
                Some(value) => format!("`{flag} \"{value}\"`"),
            }
        };
        settings.iter().map(one).collect::<Vec<_>>().join(" ")
    }

    fn format_command(&self, command: CommandName) -> String {
        format!("`modelmill {}`", command.name())
    }
}

/// Runs a command; returns the text for standard output.
fn run(command: FleetCommand) -> Result<String, FleetFault> {
    match command {
        FleetCommand::Make(args) => {
            let size = generate::FleetSize {
                robots: args.robots,
                days: args.days,
                per_day: args.per_day,
                seconds: args.seconds,
                rate: args.rate,
                seed: args.seed,
                bad: args.bad,
                changes: args.changes,
            };
            generate::generate(&args.folder, &size)?;
            Ok(format!(
                "{} recordings of {} samples written to {}\n",
                args.robots * args.days * args.per_day,
                (args.seconds * args.rate).round(),
                args.folder.display()
            ))
        }
        FleetCommand::Plan(args) => {
            let reference: Vec<&std::path::Path> = args.reference.iter().map(PathBuf::as_path).collect();
            let plan = modelmill_fleet::FleetPlan::from_recordings(&args.model, &args.reading.reading()?, &reference)?;
            folder::write_atomic(&args.out, plan.json().as_bytes())?;
            Ok(format!(
                "{} from {} reference recordings: cut-off {} Hz, every {}. sample kept\n",
                args.out.display(),
                plan.reference.recordings.len(),
                plan.preparation
                    .cutoff_hz
                    .map_or("none".to_owned(), |hz| format!("{hz:.3}")),
                plan.preparation.decimate
            ))
        }
        FleetCommand::Identify(args) => {
            if let Some(threads) = args.threads {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
                pool.map_err(FleetFault::new)?;
            }
            identify::identify(&identify::FleetRequest {
                model: &args.model,
                recordings: &args.recordings,
                out: &args.out,
                plan: args.plan.as_deref(),
                reading: &args.reading.reading()?,
            })
        }
        FleetCommand::Score { found, truth } => score::score(&found, &truth),
    }
}
