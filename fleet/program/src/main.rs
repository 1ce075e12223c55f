//! `modelmill-fleet`: recordings of many machines of one kind, on one computer.
//!
//! `make` makes a fleet with a truth, `plan` settles how recordings are summed up, `identify` sums them up and says what every
//! robot is and what changed, and `score` holds that against a truth.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use modelmill::print::{CommandName, LibrarySpelling, OptionName, OptionSetting, RemedySpelling};
use modelmill::recording::{Preparation, Reading};
use modelmill_fleet::{Fault, folder};
use modelmill_fleet_program::{generate, identify, score};

/// Recordings of many machines of one kind: parameters per robot and day, what changed and when, and who differs.
#[derive(Parser)]
#[command(name = "modelmill-fleet", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Make a fleet of five-bars with a truth, as Parquet.
    Make(Make),
    /// Settle how every recording is summed up, from a few of sound machines.
    Plan(PlanArgs),
    /// Sum up a folder of recordings and say what is different.
    Identify(Identify),
    /// Hold what `identify` found against the truth of `make`.
    Score {
        /// The folder that `identify` wrote.
        found: PathBuf,
        /// `truth.json`.
        truth: PathBuf,
    },
}

#[derive(clap::Args)]
struct Make {
    /// Where it goes.
    folder: PathBuf,
    /// How many robots.
    #[arg(long, default_value_t = 100)]
    robots: usize,
    /// On how many days.
    #[arg(long, default_value_t = 10)]
    days: usize,
    /// Recordings of a robot on a day.
    #[arg(long, default_value_t = 2)]
    per_day: usize,
    /// How long each is, s.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Samples a second.
    #[arg(long, default_value_t = 250.0)]
    rate: f64,
    /// Another seed makes another fleet.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How many recordings are cut off.
    #[arg(long, default_value_t = 2)]
    bad: usize,
    /// How large the changes of friction and load are; 1 as in the guide, 0.5 for half of that.
    #[arg(long, default_value_t = 1.0)]
    changes: f64,
}

/// How recordings are read, where no plan says it.
#[derive(clap::Args, Clone)]
struct ReadingArgs {
    /// Our column and what recordings call it, such as `q1=pos_left`; may be given again.
    #[arg(long = "map", value_name = "OURS=THEIRS")]
    map: Vec<String>,
    /// Cut-off of the low-pass on positions, Hz; chosen by the first reference recording where it is not given.
    #[arg(long)]
    cutoff: Option<f64>,
    /// Every how many samples one is kept; chosen likewise.
    #[arg(long, default_value_t = 1)]
    decimate: usize,
    /// Leave out samples with NaN or empty fields.
    #[arg(long)]
    skip_bad_samples: bool,
}

impl ReadingArgs {
    fn reading(&self) -> Result<Reading, Fault> {
        let columns = self.map.iter().map(|text| {
            let (ours, theirs) = text.split_once('=').ok_or_else(|| {
                Fault::new(format!(
                    "`--map {text}` names no column; write it as `--map q1=pos_left`"
                ))
            })?;
            Ok((ours.to_owned(), theirs.to_owned()))
        });
        Ok(Reading {
            columns: columns.collect::<Result<_, Fault>>()?,
            preparation: Preparation {
                cutoff_hz: self.cutoff,
                decimate: self.decimate.max(1),
                ..Preparation::default()
            },
            skip_bad_samples: self.skip_bad_samples,
            ..Reading::default()
        })
    }
}

#[derive(clap::Args)]
struct PlanArgs {
    /// The model file.
    model: PathBuf,
    /// Recordings of sound machines; the first decides how all are prepared.
    #[arg(required = true)]
    reference: Vec<PathBuf>,
    /// Where the plan goes.
    #[arg(long, default_value = "plan.json")]
    out: PathBuf,
    #[command(flatten)]
    reading: ReadingArgs,
}

#[derive(clap::Args)]
struct Identify {
    /// The model file.
    model: PathBuf,
    /// The folder: `robot=R/day=D/.../FILE`, `R/D/FILE`, or `R/FILE` with the day at the front of the file's name.
    recordings: PathBuf,
    /// Where states, results and page go. Called again with the same folder, it goes on from the recordings that are done.
    #[arg(long)]
    out: PathBuf,
    /// The plan; made from recordings of eight robots where it is not given.
    #[arg(long)]
    plan: Option<PathBuf>,
    /// Threads; all cores where it is not given.
    #[arg(long)]
    threads: Option<usize>,
    #[command(flatten)]
    reading: ReadingArgs,
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
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
            eprintln!("error: {}", fault.message().spell(&FleetSpelling));
            ExitCode::from(1)
        }
    }
}

/// Options that this program has, as its flags; commands as those of `modelmill`.
struct FleetSpelling;

impl RemedySpelling for FleetSpelling {
    fn spell_options(&self, settings: &[OptionSetting]) -> String {
        let one = |setting: &OptionSetting| {
            let flag = match setting.name {
                OptionName::Columns => "--map",
                OptionName::CutoffHz => "--cutoff",
                OptionName::Decimate => "--decimate",
                OptionName::SkipBadSamples => "--skip-bad-samples",
                _ => return LibrarySpelling.spell_options(std::slice::from_ref(setting)),
            };
            match &setting.value {
                None => format!("`{flag}`"),
                Some(value) => format!("`{flag} \"{value}\"`"),
            }
        };
        settings.iter().map(one).collect::<Vec<_>>().join(" ")
    }

    fn spell_command(&self, command: CommandName) -> String {
        format!("`modelmill {}`", command.name())
    }
}

fn run(command: Command) -> Result<String, Fault> {
    match command {
        Command::Make(args) => {
            let size = generate::Size {
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
        Command::Plan(args) => {
            let reference: Vec<&std::path::Path> =
                args.reference.iter().map(PathBuf::as_path).collect();
            let plan =
                modelmill_fleet::Plan::make(&args.model, &args.reading.reading()?, &reference)?;
            folder::write(&args.out, plan.json().as_bytes())?;
            Ok(format!(
                "{} from {} reference recordings: cut-off {} Hz, one in {} samples kept\n",
                args.out.display(),
                plan.reference.recordings.len(),
                plan.preparation
                    .cutoff_hz
                    .map_or("none".to_owned(), |hz| format!("{hz:.3}")),
                plan.preparation.decimate
            ))
        }
        Command::Identify(args) => {
            if let Some(threads) = args.threads {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build_global();
                pool.map_err(Fault::new)?;
            }
            identify::identify(&identify::Asked {
                model: &args.model,
                recordings: &args.recordings,
                out: &args.out,
                plan: args.plan.as_deref(),
                reading: &args.reading.reading()?,
            })
        }
        Command::Score { found, truth } => score::score(&found, &truth),
    }
}
