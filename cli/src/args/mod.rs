//! The command line: names, options and help of every command.

mod code;
pub(crate) mod data;
mod declared;
pub(crate) mod drawing;
pub(crate) mod effects;
pub(crate) mod estimation;
#[cfg(feature = "experiment")]
mod experiment;
mod motion;
pub(crate) mod preparation;
mod rig;
pub(crate) mod runs;
pub(crate) mod separate;
mod verify;
#[cfg(feature = "workbench")]
pub(crate) mod work;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};

use drawing::DrawingArgs;
use effects::{AddArgs, EffectsArgs};
use preparation::PreparationArgs;
use runs::RunsArgs;
#[cfg(feature = "workbench")]
use work::WorkArgs;

use crate::terminal::time_limit::parse_seconds;

pub(crate) use code::{AtlasArgs, EquationsArgs, EquationsFormat, GenerateArgs};
pub(crate) use data::{
    AdoptArgs, CompareArgs, DiagnoseArgs, DiagnosisArgs, EvaluateArgs, IdentifyArgs, InterpretArgs, ParameterSource,
    RecordingsArgs, ReportArgs,
};
#[cfg(feature = "experiment")]
pub(crate) use experiment::ExperimentArgs;
pub(crate) use motion::{CriterionArg, ExciteArgs, PeriodArg, SimulateArgs};
pub(crate) use rig::{ExportArgs, ImportArgs, ReduceArgs};
pub(crate) use verify::VerifyArgs;

/// From a model file to base parameters, equations, fast Rust, and parameters from measurements.
#[derive(Debug, Parser)]
#[command(
    name = "modelmill",
    version,
    about,
    after_help = "Start here:\n  \
        modelmill tour                              all main steps on bundled recordings\n  \
        modelmill help COMMAND                       options and examples of one command\n\n\
        Exit status: 0 done, 1 the input is at fault (with the place and what to do) or the model fails `verify`, 2 wrong usage, \
        3 the time limit was reached."
)]
pub(crate) struct CommandLine {
    /// The command to run.
    #[command(subcommand)]
    pub(crate) command: ProgramCommand,
    /// A library of additional kinds of effects (TOML), for every model that is read; may be repeated
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) library: Vec<PathBuf>,
    /// Derive models only for the values of their files: constants become numbers. Fewer base parameters remain if
    /// lengths are zero or equal, and these numbers can no longer be changed in emitted code
    #[arg(long, global = true)]
    pub(crate) at_values: bool,
    /// End with an error and exit status 3 if the command takes longer. Each output file is then either complete or
    /// not touched
    #[arg(long, global = true, value_name = "SECONDS", value_parser = parse_seconds)]
    pub(crate) time_limit: Option<Duration>,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum ProgramCommand {
    /// Validate a model file and print a summary
    #[command(
        after_help = "The numeric rank is that of the regressor at random states with the file's values. Its gap is the \
        ratio of the last nonzero singular value to the next, or to the level of rounding. Below 1000 the rank is uncertain, and a \
        warning is printed.\n\n\
        Examples (from the project's root):\n  modelmill check model-spec/models/spidermill.toml\n  \
        modelmill check model-spec/models/spidermill.toml --json\n  \
        modelmill check model-spec/models/panda.toml --picture panda.svg --at q2=0.6,q4=-1.2 --view 60,20"
    )]
    Check(CheckArgs),
    /// Report what a variant changes: entries, p_g, dependencies, p_min, operation counts; along recordings also
    /// forces, power, work, limits and error
    #[command(
        after_help = "With --data both models follow the motion as the first one reads it, each with the values of its file. \
        A share is the projection of one term of p_min on the total difference of a drive's force. Shares add up to 100 %; a term \
        that reduces the difference has a negative share. A column of the regressor changes if the geometry does. Forces need not \
        be recorded; if they are, each model's error is that of `compare`.\n\n\
        Examples (from the project's root):\n  \
        modelmill diff model-spec/models/spidermill.toml model-spec/models/spidermill-paper.toml\n  \
        modelmill diff model-spec/models/spidermill.toml model-spec/models/spidermill-paper.toml \\\n      \
        --data recordings/spidermill-mbs/plain-check.csv\n  \
        modelmill diff model-spec/models/arm_four_bar.toml model-spec/models/arm_parallelogram.toml \\\n      \
        --picture both.svg"
    )]
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
        modelmill add model-spec/models/spidermill.toml rod_inertia \\\n      \
        --at spindle_left,spindle_right --out rods.toml\n  \
        modelmill add model-spec/models/puma560.toml viscous_friction --at-each drives --out friction.toml\n  \
        modelmill add model-spec/models/spidermill-paper.toml lumped_mass_placement \\\n      \
        --at R3m,R3m_right --set m.name=m4\n\n\
        Without --in-place or --out nothing is written.")]
    Add(AddArgs),
    /// Replace the nominal values of a model file by those of a fit, and print the difference
    #[command(after_help = "Examples:\n  \
        modelmill identify arm.toml --data run.csv --physical --out fit.json\n  \
        modelmill adopt arm.toml fit.json --in-place\n\n\
        A fit of --physical gives the parameters of each body. Any other fit gives base parameters, which do not determine \
        single bodies. Without --in-place or --out nothing is written.")]
    Adopt(AdoptArgs),
    /// Print the reduced model as equations: p_g, dependencies, p_min, intermediate variables, counts
    #[command(
        after_help = "Examples (from the project's root):\n  modelmill equations model-spec/models/spidermill-paper.toml\n  \
        modelmill equations model-spec/models/panda.toml --format html --out panda.html\n  \
        modelmill equations model-spec/models/panda.toml --format json | jq .rank\n  \
        modelmill equations model-spec/models/spidermill-paper.toml --balances crank_left"
    )]
    Equations(EquationsArgs),
    /// Write the model as Rust source, the same that `cargo build` generates, or as a crate for C or Python
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill generate model-spec/models/scara.toml --out scara.rs\n  \
        modelmill generate model-spec/models/panda.toml --language c99 --out panda-c99\n  \
        modelmill generate model-spec/models/panda.toml --language julia --dynamics --out panda.jl\n  \
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
    /// Estimate the base parameters from recordings by least squares
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill identify model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
        --check recordings/spidermill-mbs/with-rods-check.csv --out fit.json\n  \
        modelmill identify model-spec/models/emps.toml --data emps_train.csv \\\n      \
        --order 4 --cutoff 100 --trim 49 --decimate 10\n  \
        modelmill identify arm.toml --data a.csv --data b.csv --map t=time_s --map q1=pos_1\n\n\
        Estimation:\n  \
        modelmill identify arm.toml --data run.csv --weights channels --robust\n  \
        modelmill identify arm.toml --data mean.csv --weights variance \\\n      \
        --map shoulder_var=var_tau1 --map elbow_var=var_tau2\n  \
        modelmill identify arm.toml --data run.csv --prior 0.2\n  \
        modelmill identify arm.toml --data run.csv --physical\n  \
        modelmill identify arm.toml --data run.csv --essential\n  \
        modelmill identify arm.toml --data run.csv --instruments run.csv --instrument-map q1=q1_reference\n  \
        modelmill identify arm.toml --data run.csv --instruments period=7.29")]
    Identify(IdentifyArgs),
    /// List the contents of recordings: tables or topics, columns, types, samples, rates
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill recordings recordings/spidermill-mbs/plain-fit.csv\n  \
        modelmill recordings run.mcap --json\n\n\
        A joint of sensor_msgs/JointState is read as, for example, --map q1=joint_states.position.shoulder \
        --map motor1=joint_states.effort.shoulder.")]
    Recordings(RecordingsArgs),
    /// Compare the model with recordings: error figures, and where the error is largest
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill compare model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-check.csv\n  \
        modelmill compare model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-check.csv --parameters fit.json --json\n  \
        modelmill compare model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-check.csv --forward")]
    Compare(CompareArgs),
    /// Find which physical effect the model lacks, from recordings
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill diagnose model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
        --check recordings/spidermill-mbs/with-rods-check.csv\n  \
        modelmill diagnose model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
        --check recordings/spidermill-mbs/with-rods-check.csv --out completed.toml")]
    Diagnose(DiagnoseArgs),
    /// Test the model against recordings: checks of drives, parameters and effects, with the cause of every failure
    #[command(after_help = verify::HELP)]
    Verify(VerifyArgs),
    /// Write a diagnosis as one self-contained page: error after each step, curves, error maps, candidates,
    /// parameters, equations
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill report model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
        --check recordings/spidermill-mbs/with-rods-check.csv --out report")]
    Report(ReportArgs),
    #[cfg(feature = "workbench")]
    /// Open a workbench in the browser: edit the model file; mechanism, equations, error and findings are updated
    #[command(after_help = work::HELP)]
    Work(WorkArgs),
    /// Simulate a full-body rig along a trajectory and record its sensors, or a model under the forces of a recording
    #[command(
        after_help = "The trajectory (CSV) has a column t and one per coordinate of the rig. Rates and accelerations are read from \
        columns with _d and _dd; if there are none, they are computed by differences over five samples. \
        Effects, noise, resolution, delay and sampling rate are those of the rig file.\n\n\
        Examples (from the project's root):\n  \
        modelmill simulate model-spec/rigs/spidermill-full.toml \\\n      \
        --trajectory recordings/spidermill-mbs/plain-fit.csv --out run.csv\n  \
        modelmill simulate rig.toml --trajectory traj.csv --out run.csv --seed 7\n  \
        modelmill simulate model-spec/models/spidermill.toml \\\n      \
        --data recordings/spidermill-mbs/plain-check.csv --out motion.csv"
    )]
    Simulate(SimulateArgs),
    /// Reduce a full-body rig to a planar model file, and report the size of every approximation
    #[command(
        after_help = "The plan (TOML) names the plane, the bodies that become one part, those that become point \
        masses, and the symbols that parts share. Every approximation is measured along sampled motions of the rig, and the model's forces are compared with the rig's.\n\n\
        Examples (from the project's root):\n  \
        modelmill reduce model-spec/rigs/spidermill-full.toml \\\n      \
        --plan model-spec/rigs/spidermill-plan.toml --out reduced.toml\n  \
        modelmill reduce model-spec/rigs/spidermill-seventeen.toml --propose plan.toml\n  \
        modelmill reduce linkage.toml --out model.toml --json"
    )]
    Reduce(ReduceArgs),
    /// Convert a URDF, MJCF or SDF into a model file, as a starting point
    #[command(
        after_help = "Expand macros (xacro) first. Links with fixed joints are merged into the body that carries \
        them. Every body gets its ten linear parameters.\n\n\
        Examples:\n  \
        modelmill import robot.urdf --out robot.toml\n  \
        modelmill import robot.urdf --out arm.toml --joints shoulder,elbow,wrist\n  \
        modelmill import robot.urdf --out arm.toml --lock torso=0.2,gripper=0.01\n  \
        modelmill check robot.toml"
    )]
    Import(ImportArgs),
    /// Write a model as a URDF or MJCF, for simulators
    #[command(
        after_help = "What the format cannot express is reported: loops and drives between two points need MJCF.\n\n\
        Examples (from the project's root):\n  \
        modelmill export model-spec/models/panda.toml --out panda.urdf\n  \
        modelmill export model-spec/models/five_bar.toml --out five_bar.xml"
    )]
    Export(ExportArgs),
    /// Write an atlas of mechanisms: picture, joints, loops, base parameters with and without gravity, operations
    #[command(
        after_help = "Base parameters are counted for the bodies alone. Each mechanism has a separate page with their expressions.\n\n\
        Example (from the project's root):\n  modelmill atlas model-spec/models/*.toml --out docs"
    )]
    Atlas(AtlasArgs),
    /// Report what changed between runs of one machine: load, friction, offset, scale of a force, clock, encoders,
    /// pushes
    #[command(after_help = runs::HELP)]
    Runs(RunsArgs),
    /// Solve identified base parameters for physical ones, as in Table 1 of the paper: all real solutions
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill interpret model-spec/models/spidermill-paper.toml --fit fit.json \\\n      \
        --unknown m2,m4,dc3,Ic12,Ic32")]
    Interpret(InterpretArgs),
    /// Search for the periodic trajectory, within limits, that determines the base parameters best
    #[command(after_help = "Examples (from the project's root):\n  \
        modelmill excite model-spec/models/spidermill.toml --out trajectory.csv\n  \
        modelmill excite model-spec/models/two_link.toml --harmonics 5 --period 10 \\\n      \
        --limits q1=-1:1 --limits q1_d=2 --limits q2=-1.5:1.5 --limits q2_d=3 --out trajectory.csv\n  \
        modelmill excite model-spec/models/spidermill.toml \\\n      \
        --separate coulomb_friction@spindle_left:Fc=12 --from load_friction@spindle_left \\\n      \
        --noise 1 --out separate.csv\n\n\
        For effects that recordings do not distinguish, `diagnose` prints the command for a motion that does.")]
    Excite(ExciteArgs),
    /// Reproduce the experiment of the paper on the bundled rig, and explain its errors, as one page
    #[cfg(feature = "experiment")]
    #[command(
        after_help = "Writes experiment.html: excitation, runs of the complete robot, Tables 1 and 2 next to the paper's, \
        and the causes of the errors. Needs no files; the same options give the same bytes.\n\n\
        Examples:\n  modelmill experiment --out docs                     the page that comes with the project\n  \
        modelmill experiment --out /tmp --random 100 --starts 1 --json"
    )]
    Experiment(ExperimentArgs),
    /// Report what this computer has of other programs, and which command needs what is missing
    #[command(
        after_help = "Other programs, such as compilers, are needed only for what the last column names. \
        Exit status 1: the program itself does not work.\n\n\
        Examples:\n  modelmill doctor\n  \
        modelmill doctor --json | jq '.requirements[] | select(.state != \"present\") | .name'"
    )]
    Doctor(DoctorArgs),
    /// Print a completion script for a shell
    #[command(after_help = "Examples:\n  \
        modelmill completions bash > ~/.local/share/bash-completion/completions/modelmill\n  \
        modelmill completions zsh > ~/.zfunc/_modelmill\n  \
        modelmill completions fish > ~/.config/fish/completions/modelmill.fish")]
    Completions(CompletionsArgs),
    /// Print the reference of all commands and options as Markdown, or write manual pages (man)
    #[command(after_help = "Examples:\n  modelmill manual > commands.md\n  \
        modelmill manual --out ~/.local/share/man/man1")]
    Manual(ManualArgs),
    /// Show all main steps on bundled recordings: derive, compare, find the missing effect, add it, identify again
    #[command(after_help = "Examples:\n  modelmill tour\n  modelmill tour --out tour")]
    Tour(TourArgs),
}

/// `check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Model file or rig file (TOML)
    pub(crate) model: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) drawing: DrawingArgs,
}

/// `diff`.
#[derive(Debug, Args)]
pub(crate) struct DiffArgs {
    /// Model file as it was
    pub(crate) before: PathBuf,
    /// Model file as it is now
    pub(crate) after: PathBuf,
    /// Recordings along which both models are compared (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags); may be repeated
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) drawing: DrawingArgs,
    /// Print one JSON object on standard output
    #[arg(long, help_heading = None)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// `doctor`.
#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// Shell for which the script is written
    pub(crate) shell: clap_complete::Shell,
}

/// `manual`.
#[derive(Debug, Args)]
pub(crate) struct ManualArgs {
    /// Write manual pages into this folder, one for the program and one for each command, instead of the reference
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// `tour`.
#[derive(Debug, Args)]
pub(crate) struct TourArgs {
    /// Write models, recordings and pages into this folder. Default: `modelmill-tour` in the folder for temporary files
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}
