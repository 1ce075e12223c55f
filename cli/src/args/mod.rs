//! The command line: names, options and help of every command.

pub(crate) mod drawing;
pub(crate) mod effects;
pub(crate) mod estimation;
pub(crate) mod preparation;
pub(crate) mod runs;
pub(crate) mod separate;

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use modelmill::excite::Limit;
use modelmill::generate::{Language, LanguageForm};
use modelmill::{Host, Model};

use crate::failure::Outcome;
use crate::terminal;

use drawing::DrawingArgs;
use effects::{AddArgs, EffectsArgs};
use estimation::{EstimatorArgs, StandstillArgs};
use preparation::PreparationArgs;
use runs::RunsArgs;
use separate::SeparateArgs;

/// From a model file to base parameters, equations, fast Rust, and parameters from measurements.
#[derive(Debug, Parser)]
#[command(
    name = "modelmill",
    version,
    about,
    after_help = "Start here:\n  \
        modelmill tour                              the whole story on bundled recordings\n  \
        modelmill help COMMAND                       options and examples of one command\n\n\
        Exit status: 0 done, 1 the input is at fault (with the place and what to do), 2 wrong usage."
)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// A library of further kinds of effects (TOML), for every model that is read; may be repeated
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) library: Vec<PathBuf>,
    /// Derive models for their files' values alone: constants stand as numbers, so that fewer base parameters remain where
    /// lengths are zero or equal, and emitted code has no geometry to change
    #[arg(long, global = true)]
    pub(crate) at_values: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Validate a model file and print a summary
    #[command(
        after_help = "The numeric rank, eq. (9), is that of the regressor at random states with the file's values. Its gap is the \
        ratio of the last singular value that counts to the next, or to the level of rounding; below 1000 the rank is a matter \
        of opinion, and a warning says so.\n\n\
        Examples (from the project's root):\n  modelmill check model-spec/models/spidermill.toml\n  \
        modelmill check model-spec/models/spidermill.toml --json\n  \
        modelmill check model-spec/models/panda.toml --picture panda.svg --at q2=0.6,q4=-1.2 --view 60,20"
    )]
    Check(CheckArgs),
    /// Say what a variant changes: entries, p_g, dependencies, p_min, operation counts
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill diff model-spec/models/spidermill.toml model-spec/models/spidermill-paper.toml\n  \
        modelmill diff model-spec/models/arm_four_bar.toml model-spec/models/arm_parallelogram.toml --picture both.svg")]
    Diff(DiffArgs),
    /// List the effects that a model may have, or explain one of them
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill effects\n  \
        modelmill effects rod_inertia\n  \
        modelmill effects --library my_effects.toml --json")]
    Effects(EffectsArgs),
    /// Add an effect to a model file, keeping its comments and layout, and print the difference
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill add model-spec/models/spidermill.toml coulomb_friction --at spindle_left --set Fc=25.9\n  \
        modelmill add model-spec/models/spidermill.toml rod_inertia --at spindle_left,spindle_right --out rods.toml\n  \
        modelmill add model-spec/models/spidermill-paper.toml lumped_mass_placement \\\n      \
        --at R3m,R3m_right --set m.name=m4\n\n\
        Places in one --at share the effect's parameters. Without --in-place or --out nothing is written.")]
    Add(AddArgs),
    /// Write a fit into a model file, in the place of its nominal values, and print the difference
    #[command(after_help = "Examples:\n  \
        modelmill identify arm.toml --data run.csv --physical --out fit.json\n  \
        modelmill adopt arm.toml fit.json --in-place\n\n\
        A fit of --physical becomes values of parameters, which bodies can have; any other one values of base parameters, \
        which say nothing of single bodies. Without --in-place or --out nothing is written.")]
    Adopt(AdoptArgs),
    /// Print the reduced model as equations: p_g, dependencies, p_min, intermediate variables, counts
    #[command(
        after_help = "Examples (from the project's root):\n  modelmill equations model-spec/models/spidermill-paper.toml\n  \
        modelmill equations model-spec/models/panda.toml --format html --out panda.html\n  \
        modelmill equations model-spec/models/panda.toml --format json | jq .rank"
    )]
    Equations(EquationsArgs),
    /// Write the model as Rust source, the same that `cargo build` makes, or as a crate for C or Python
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill generate model-spec/models/scara.toml --out scara.rs\n  \
        modelmill generate model-spec/models/panda.toml --language c99 --out panda-c99\n  \
        modelmill generate model-spec/models/panda.toml --language c --out panda-c\n  \
        modelmill generate model-spec/models/panda.toml --language python --dynamics --out panda-python")]
    Generate(GenerateArgs),
    /// Compute the model's forces along a recording
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill evaluate model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/plain-check.csv --out forces.csv\n  \
        modelmill evaluate model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/plain-check.csv --parameters fit.json --out forces.csv\n  \
        modelmill evaluate model-spec/models/spidermill.toml --reactions \\\n      \
        --data recordings/spidermill-mbs/plain-check.csv --out reactions.csv")]
    Evaluate(EvaluateArgs),
    /// Find the base parameters from recordings by least squares
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill identify model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
        --check recordings/spidermill-mbs/with-rods-check.csv --out fit.json\n  \
        modelmill identify model-spec/models/emps.toml --data emps_train.csv \\\n      \
        --order 4 --cutoff 100 --trim 49 --decimate 10\n  \
        modelmill identify arm.toml --data a.csv --data b.csv --map t=time_s --map q1=pos_1\n\n\
        Estimating (see the options below --weights):\n  \
        modelmill identify arm.toml --data run.csv --weights channels --robust\n  \
        modelmill identify arm.toml --data mean.csv --weights variance --map shoulder_var=var_tau1 --map elbow_var=var_tau2\n  \
        modelmill identify arm.toml --data run.csv --prior 0.2        nominal values count, to 20 % each\n  \
        modelmill identify arm.toml --data run.csv --physical         only what bodies can have\n  \
        modelmill identify arm.toml --data run.csv --essential        only what the recording supports\n  \
        modelmill identify arm.toml --data run.csv --instruments run.csv --instrument-map q1=q1_reference\n  \
        modelmill identify arm.toml --data run.csv --instruments period=7.29")]
    Identify(IdentifyArgs),
    /// List what recordings hold: tables or topics, columns, types, samples, rates
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill recordings recordings/spidermill-mbs/plain-fit.csv\n  \
        modelmill recordings run.mcap --json\n\n\
        A joint of sensor_msgs/JointState is read as, for example, --map q1=joint_states.position.shoulder \
        --map motor1=joint_states.effort.shoulder.")]
    Recordings(RecordingsArgs),
    /// Hold the model against recordings: error figures, and where the error lives
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill compare model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-check.csv\n  \
        modelmill compare model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-check.csv --parameters fit.json --json")]
    Compare(CompareArgs),
    /// Find which physical effect the model lacks, from recordings
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill diagnose model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
        --check recordings/spidermill-mbs/with-rods-check.csv")]
    Diagnose(DiagnoseArgs),
    /// Tell what a model lacks as one self-contained page: ladder, curves, error maps, candidates, parameters, equations
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill report model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
        --check recordings/spidermill-mbs/with-rods-check.csv --out report")]
    Report(ReportArgs),
    /// Drive a full-body rig along a trajectory and record what its sensors read
    #[command(
        after_help = "The trajectory (CSV) has a column t and one per coordinate of the rig; its rates and \
        accelerations are taken from columns with _d and _dd, or else found by differences over five samples. \
        Effects, noise, resolution, delay and sampling rate are those of the rig file.\n\n\
        Examples (from the project's root):\n  \
        modelmill simulate model-spec/rigs/spidermill-full.toml \\\n      \
        --trajectory recordings/spidermill-mbs/plain-fit.csv --out run.csv\n  \
        modelmill simulate rig.toml --trajectory traj.csv --out run.csv --seed 7"
    )]
    Simulate(SimulateArgs),
    /// Reduce a full-body rig to a planar model file, and say the size of every approximation
    #[command(
        after_help = "The plan (TOML) names the plane, the bodies that become one part, those that become point \
        masses, and the symbols that parts share; without one every body becomes a part of its own. Every claim is \
        measured along sampled motions of the rig, and the model's forces are held against the rig's.\n\n\
        Examples (from the project's root):\n  \
        modelmill reduce model-spec/rigs/spidermill-full.toml \\\n      \
        --plan model-spec/rigs/spidermill-plan.toml --out reduced.toml\n  \
        modelmill reduce linkage.toml --out model.toml --json"
    )]
    Reduce(ReduceArgs),
    /// Make a model file of a URDF, as a starting point
    #[command(
        after_help = "Macros (xacro) must be expanded first. Links behind fixed joints join the body that carries \
        them; every body gets its ten linear parameters.\n\n\
        Examples:\n  \
        modelmill import robot.urdf --out robot.toml\n  \
        modelmill check robot.toml"
    )]
    Import(ImportArgs),
    /// Say what changed between runs of one machine: load, friction, offset, scale of a force, clock, encoders, pushes
    #[command(after_help = runs::HELP)]
    Runs(RunsArgs),
    /// Solve identified base parameters for physical ones, as in Table 1 of the paper: all real solutions
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill interpret model-spec/models/spidermill-paper.toml --fit fit.json \\\n      \
        --unknown m2,m4,dc3,Ic12,Ic32")]
    Interpret(InterpretArgs),
    /// Search for the periodic trajectory, within limits, that tells the base parameters apart best
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill excite model-spec/models/spidermill.toml --out trajectory.csv\n  \
        modelmill excite model-spec/models/two_link.toml --harmonics 5 --period 10 \\\n      \
        --limits q1=-1:1 --limits q1_d=2 --limits q2=-1.5:1.5 --limits q2_d=3 --out trajectory.csv\n  \
        modelmill excite model-spec/models/spidermill.toml --separate coulomb_friction@spindle_left:Fc=12 \\\n      \
        --from load_friction@spindle_left --noise 1 --out separate.csv   motion that tells two effects apart\n\n\
        Limits stand in the model file's `[limits]`; --limits adds to them or replaces them. `diagnose` prints the \
        command that separates what its recordings cannot tell apart.")]
    Excite(ExciteArgs),
    /// Reproduce the experiment of the paper on the bundled rig, and explain its errors, as one page
    #[command(
        after_help = "Writes experiment.html: excitation, runs of the whole robot, Tables 1 and 2 beside the paper's, \
        and where the errors come from. Needs no files; the same options give the same bytes.\n\n\
        Examples:\n  modelmill experiment --out docs                     the page that comes with the project\n  \
        modelmill experiment --out /tmp --random 100 --starts 1 --json"
    )]
    Experiment(ExperimentArgs),
    /// Print a completion script for a shell
    #[command(after_help = "Examples:\n  \
        modelmill completions bash > ~/.local/share/bash-completion/completions/modelmill\n  \
        modelmill completions zsh > ~/.zfunc/_modelmill\n  \
        modelmill completions fish > ~/.config/fish/completions/modelmill.fish")]
    Completions(CompletionsArgs),
    /// Tell the whole story on bundled recordings: derive, compare, find what is missing, add it, watch the error fall
    #[command(
        after_help = "Examples:\n  modelmill tour\n  modelmill tour --out tour\n\n\
        Models, recordings and pages are written into the folder, so that each command of the story can be repeated."
    )]
    Tour(TourArgs),
}

/// `check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    #[command(flatten)]
    pub(crate) drawing: DrawingArgs,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `diff`.
#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// Model file as it was
    pub(crate) before: PathBuf,
    /// Model file as it is now
    pub(crate) after: PathBuf,
    #[command(flatten)]
    pub(crate) drawing: DrawingArgs,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// How equations are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EquationsFormat {
    /// Plain text for the terminal
    Text,
    /// Markdown with TeX formulas
    Markdown,
    /// A LaTeX document
    Latex,
    /// One self-contained page with MathML
    Html,
    /// One JSON object
    Json,
}

/// `equations`.
#[derive(Debug, Args)]
pub(crate) struct EquationsArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Form of the equations
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: EquationsFormat,
    /// The same as --format json
    #[arg(long, conflicts_with = "format")]
    pub(crate) json: bool,
    /// Write to this file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// `generate`.
#[derive(Debug, Args)]
pub(crate) struct GenerateArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Write the source to this file instead of standard output; with --language c99, c or python, files to this folder
    #[arg(long, value_name = "FILE.rs|DIR", required_if_eq_any(in_folders()))]
    pub(crate) out: Option<PathBuf>,
    /// With the equation of motion: mass matrix, velocity terms, gravity, forward dynamics
    #[arg(long)]
    pub(crate) dynamics: bool,
    /// With what the joints transmit: forces and moments in all joints, and the forces that close loops
    #[arg(long)]
    pub(crate) reactions: bool,
    /// With a function `self_test` that holds base parameters against all parameters, for a test of your own
    #[arg(long)]
    pub(crate) self_test: bool,
    /// What to make: a Rust module, sources of plain C99, or a crate that builds a C library with its header or a Python module
    #[arg(long, value_parser = languages(), default_value = Language::default().name())]
    pub(crate) language: Language,
}

/// The languages by their names.
fn languages() -> impl TypedValueParser<Value = Language> {
    let all = Language::all();
    let values = all.map(|language| PossibleValue::new(language.name()).help(language.about()));
    let parser = PossibleValuesParser::new(values);
    parser.map(|name| Language::named(&name).expect("the parser knows these names alone"))
}

/// Languages whose files need a folder.
fn in_folders() -> Vec<(&'static str, &'static str)> {
    let others = Language::all().filter(|language| language.form() != LanguageForm::Module);
    others
        .map(|language| ("language", language.name()))
        .collect()
}

/// Where the values of the base parameters come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ParameterSource {
    /// The model file's nominal values.
    Nominal,
    /// A file that `identify` wrote.
    Fit(PathBuf),
}

impl ParameterSource {
    /// Reads the argument of `--parameters`.
    fn parse(text: &str) -> Result<Self, String> {
        match text {
            "" => Err("expected `nominal` or the path of a fit".to_owned()),
            "nominal" => Ok(Self::Nominal),
            path => Ok(Self::Fit(PathBuf::from(path))),
        }
    }

    /// The file, if there is one.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::Nominal => None,
            Self::Fit(path) => Some(path),
        }
    }

    /// The values of the base parameters of a model, with remarks.
    pub(crate) fn values(&self, host: &Host, model: &Model) -> Outcome<Vec<f64>> {
        let values = match self {
            Self::Nominal => model.nominal_values(),
            Self::Fit(path) => {
                let fit = host.fit(path)?;
                model.values_of(&fit, &path.display().to_string())?
            }
        };
        for note in &values.notes {
            terminal::remark(note);
        }
        Ok(values.values)
    }

    /// The model with these values in the place of the file's.
    pub(crate) fn in_model(&self, host: &Host, model: Model) -> Outcome<Model> {
        Ok(match self {
            Self::Nominal => model,
            Self::Fit(_) => model.with_values(&self.values(host, &model)?),
        })
    }

    /// What the JSON calls it.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Nominal => "nominal".to_owned(),
            Self::Fit(path) => path.display().to_string(),
        }
    }
}

/// `evaluate`.
#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recording whose states are taken
    #[arg(long, value_name = "RUN")]
    pub(crate) data: PathBuf,
    /// Values of the base parameters: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// What the joints transmit instead of the drives' forces: forces (N) and moments (N m) in all joints, and the forces
    /// that close loops; for the nominal values of all parameters, since base parameters do not say
    #[arg(long)]
    pub(crate) reactions: bool,
    /// Write the forces to this file instead of standard output
    #[arg(long, value_name = "OUT.csv")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// `identify`.
#[derive(Debug, Args)]
pub(crate) struct IdentifyArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2) to identify from; may be repeated; files of one run that are to be
    /// joined on time have a `+` between them
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Recordings to check the result on, which the fit does not see; may be repeated
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(crate) check: Vec<PathBuf>,
    /// Write the result as JSON to this file, for `--parameters`
    #[arg(long, value_name = "FIT.json")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) estimators: EstimatorArgs,
    #[command(flatten)]
    pub(crate) standstill: StandstillArgs,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// `adopt`.
#[derive(Debug, Args)]
pub(crate) struct AdoptArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// A file that `identify` wrote
    pub(crate) fit: PathBuf,
    /// Change the model file
    #[arg(long, conflicts_with = "out")]
    pub(crate) in_place: bool,
    /// Write the model with the fit to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `recordings`.
#[derive(Debug, Args)]
pub(crate) struct RecordingsArgs {
    /// Recordings (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2)
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `compare`.
#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2); may be repeated; `a.csv+b.csv` joins files of one run on time
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Values of the base parameters: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// What is diagnosed, for the commands that do.
#[derive(Debug, Args)]
pub(crate) struct AskArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings to find it in (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2); may be repeated
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Recordings that decide what is believed; without any, blocks of --data take turns
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(crate) check: Vec<PathBuf>,
    /// Hold all parameters at their nominal values, so that what is wrong with them shows too
    #[arg(long)]
    pub(crate) held: bool,
    /// What takes the place of the nominal values: a file that `identify` wrote; with --held it is what is held
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// `diagnose`.
#[derive(Debug, Args)]
pub(crate) struct DiagnoseArgs {
    #[command(flatten)]
    pub(crate) ask: AskArgs,
    /// Print one JSON object on standard output
    #[arg(long, help_heading = None)]
    pub(crate) json: bool,
}

/// `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    #[command(flatten)]
    pub(crate) ask: AskArgs,
    /// Write the page `report.html` into this folder
    #[arg(long, value_name = "DIR", help_heading = None)]
    pub(crate) out: PathBuf,
}

/// `simulate`.
#[derive(Debug, Args)]
pub(crate) struct SimulateArgs {
    /// Rig file (TOML)
    pub(crate) rig: PathBuf,
    /// Trajectory (CSV): t and the coordinates, with or without derivatives
    #[arg(long, value_name = "TRAJ.csv")]
    pub(crate) trajectory: PathBuf,
    /// Write the recording to this file
    #[arg(long, value_name = "RUN.csv")]
    pub(crate) out: PathBuf,
    /// Seed of the noise; the rig's own if not given
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// The trajectory calls our column by another name, e.g. `--map theta1=pos_left`; may be repeated
    #[arg(long, value_name = "OURS=THEIRS", value_parser = preparation::parse_map)]
    pub(crate) map: Vec<(String, String)>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `interpret`.
#[derive(Debug, Args)]
pub(crate) struct InterpretArgs {
    /// Model file (TOML); all parameters that are not unknown keep its nominal values
    pub(crate) model: PathBuf,
    /// Identified base parameters: a file that `identify` wrote
    #[arg(long, value_name = "FIT.json")]
    pub(crate) fit: PathBuf,
    /// Parameters of the model file to solve for, separated by commas
    #[arg(long, value_name = "NAME,...", required = true, value_delimiter = ',')]
    pub(crate) unknown: Vec<String>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// What excitation makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CriterionArg {
    /// The condition number of the regressor in SI units, as in eq. (13) of the paper
    Condition,
    /// The logarithm of the determinant of W'W/N, negative: the volume of the parameters' uncertainty
    LogDet,
}

/// `excite`.
#[derive(Debug, Args)]
pub(crate) struct ExciteArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Harmonics of the Fourier series of each active coordinate
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = parse_harmonics)]
    pub(crate) harmonics: usize,
    /// Period of the trajectory, s
    #[arg(long, value_name = "S", default_value_t = 7.29, value_parser = parse_period)]
    pub(crate) period: f64,
    /// Limits beside those of the model file, or in their place: a coordinate (`theta1=1.5:2.1`), its rate
    /// (`theta1_d=1.2`) or acceleration (`theta1_dd=4`), the force of a drive (`spindle_left=1500`), a point
    /// (`R3m.x=0.2:0.7`), or `singularity=0.3`; may be repeated
    #[arg(long, value_name = "NAME=RANGE", value_delimiter = ',', value_parser = Limit::parse, allow_hyphen_values = true)]
    pub(crate) limits: Vec<Limit>,
    /// What is made small
    #[arg(long, value_enum, default_value = "condition")]
    pub(crate) criterion: CriterionArg,
    /// Values of the base parameters, from which forces along the motion follow: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// Random trajectories within the limits that are tried first
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = parse_count)]
    pub(crate) random: usize,
    /// How many of the best random trajectories the search starts from
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = parse_count)]
    pub(crate) starts: usize,
    /// The same seed gives the same trajectory
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Samples per second in the file
    #[arg(long, value_name = "HZ", default_value_t = 500.0, value_parser = parse_rate)]
    pub(crate) rate: f64,
    /// Write one period of the trajectory to this file: `t`, coordinates, rates, accelerations
    #[arg(long, value_name = "TRAJ.csv")]
    pub(crate) out: PathBuf,
    /// Write its picture to this file; beside the trajectory if not given
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) figure: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) separate: SeparateArgs,
}

/// `experiment`.
#[derive(Debug, Args)]
pub(crate) struct ExperimentArgs {
    /// Write the page `experiment.html` into this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Random trajectories within the limits that the search for the excitation tries first
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = parse_count)]
    pub(crate) random: usize,
    /// How many of the best random trajectories the search starts from
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = parse_count)]
    pub(crate) starts: usize,
    /// Seed of the search and of the test trajectory
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Samples per second of the runs
    #[arg(long, value_name = "HZ", default_value_t = 200.0, value_parser = parse_rate)]
    pub(crate) rate: f64,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `reduce`.
#[derive(Debug, Args)]
pub(crate) struct ReduceArgs {
    /// Rig file (TOML)
    pub(crate) rig: PathBuf,
    /// Plan of the reduction (TOML); every body a part of its own if not given
    #[arg(long, value_name = "PLAN.toml")]
    pub(crate) plan: Option<PathBuf>,
    /// Write the model to this file
    #[arg(long, value_name = "MODEL.toml")]
    pub(crate) out: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `import`.
#[derive(Debug, Args)]
pub(crate) struct ImportArgs {
    /// Robot description (URDF)
    pub(crate) urdf: PathBuf,
    /// Write the model to this file
    #[arg(long, value_name = "MODEL.toml")]
    pub(crate) out: PathBuf,
}

fn parse_harmonics(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(value) if (1..=50).contains(&value) => Ok(value),
        _ => Err("expected a whole number from 1 to 50".to_owned()),
    }
}

fn parse_count(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(value) if (1..=1_000_000).contains(&value) => Ok(value),
        _ => Err("expected a whole number from 1 to 1000000".to_owned()),
    }
}

fn parse_period(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1e-3..=1e4).contains(&value) => Ok(value),
        _ => Err("expected a time in s between 0.001 and 10000, such as 7.29".to_owned()),
    }
}

fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1.0..=1e5).contains(&value) => Ok(value),
        _ => Err("expected samples per second between 1 and 100000, such as 500".to_owned()),
    }
}

/// `completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// Shell
    pub(crate) shell: clap_complete::Shell,
}

/// `tour`.
#[derive(Debug, Args)]
pub(crate) struct TourArgs {
    /// Write models, recordings and pages into this folder; `modelmill-tour` in the folder for temporary files if not given
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}
