//! `experiment`: the paper's experiment, its Section 5, on the bundled rig. One page has the excitation, the runs, both
//! treatments of m4, Tables 1 and 2 compared with the paper's, and the cause of the errors.
//!
//! Decision: every number and figure of `docs/experiment.html` comes from a run of the command. Coefficients of
//! trajectories are rounded to four decimals before the simulation, so that the page can print what was used.
//! Errors that are rounding are shown as zero, because their digits differ between machines.

mod bundled;
mod causes;
mod conditions;
mod figures;
mod held;
mod lengths;
mod page;
mod page_causes;
mod page_differences;
mod page_forces;
mod page_parameters;
mod page_statements;
mod printed;
mod replica;
mod results;
mod runs;
mod study;
mod wording;

use modelmill::{Host, Model, Outcome};
use modelmill_identify::excite::Options;
use modelmill_identify::interpret::PhysicalSolution;

use causes::AuthorCauses;
use conditions::ConditionComparison;
use replica::LengthSearch;
use runs::PeriodicTrajectory;
use study::TreatmentStudy;

/// Options of the experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExperimentRequest {
    /// Random trajectories within the limits that the search for the excitation tries first.
    pub random: usize,
    /// Number of the best random trajectories from which the search starts.
    pub starts: usize,
    /// Seed of the search and of the test trajectory.
    pub seed: u64,
    /// Samples per second, Hz.
    pub rate: f64,
}

/// All results that the page shows.
pub struct PaperExperiment {
    /// The model with the paper's treatment of m4.
    paper: Model,
    /// Excitation for identification, and the test trajectory for verification.
    trajectories: [PeriodicTrajectory; 2],
    /// Without and with spindle rods.
    benches: [TreatmentStudy; 2],
    /// The paper's base parameters: calculated, of the consistent treatment, and the paper's estimate.
    base: [Vec<f64>; 3],
    /// The two causes that the authors name.
    causes: AuthorCauses,
    /// Table 1 from the paper's own estimates: all real solutions.
    printed_solutions: Vec<PhysicalSolution>,
    /// The error for other distances of the base joints.
    lengths: Vec<lengths::DistanceErrors>,
    /// Lengths and limits with which Table 2 comes closest to the paper's.
    replica: LengthSearch,
    /// The best condition numbers under other assumptions.
    conditions: ConditionComparison,
    /// Samples per second, Hz.
    rate: f64,
}

impl PaperExperiment {
    /// Runs the experiment.
    ///
    /// Fails only if the user cancels it, or if no trajectory within the limits is found.
    pub fn new(host: &Host, args: &ExperimentRequest) -> Outcome<Self> {
        // Both models come from the bundled files.
        let load = |name: &str| bundled::model(host, name);
        let paper = load("spidermill-paper.toml")?;
        let consistent = load("spidermill.toml")?;
        // The excitation has as many harmonics and the same period as the paper's.
        let (harmonics, period) = printed::EXCITATION;
        let excitation = Options {
            harmonics,
            period,
            random: args.random,
            starts: args.starts,
            seed: args.seed,
            ..Options::default()
        };
        // Any motion with several harmonics is a test; the best of a few random ones is sufficient.
        let test = Options {
            harmonics: 5,
            period: 5.0,
            random: 40,
            starts: 0,
            seed: args.seed.wrapping_add(1),
            ..Options::default()
        };
        // Both trajectories are within the limits of the paper's model.
        let trajectories = [
            runs::search(&paper, &excitation, "searching for the excitation")?,
            runs::search(&paper, &test, "drawing the test trajectory")?,
        ];
        // Both treatments on one rig: identified on one run and verified on the other.
        let bench = |name: &str| -> Outcome<TreatmentStudy> {
            let rig = bundled::rig(name)?;
            let [identification, verification] = &trajectories;
            TreatmentStudy::new(
                [&paper, &consistent],
                runs::run(&rig, &paper, identification, args.rate)?,
                runs::run(&rig, &paper, verification, args.rate)?,
            )
        };
        let benches = [bench("spidermill-full.toml")?, bench("spidermill-with-rods.toml")?];
        // The consistent parameters of the paper's model are determined along the identification run.
        let rig = bundled::rig("spidermill-full.toml")?;
        let data = runs::run(&rig, &paper, &trajectories[0], args.rate)?;
        let base = [
            paper.values.clone(),
            study::consistent_values(&paper, &consistent, &data)?,
            study::values_with(&paper, &printed::ESTIMATED),
        ];
        // The test motion once more, with other distances of the base joints.
        let lengths = lengths::scan(host, &trajectories[1].series)?;
        // A smaller search is enough to compare assumptions.
        let smaller = Options {
            random: args.random.div_ceil(4),
            starts: 1,
            steps: args.random.div_ceil(10).min(100),
            ..excitation
        };
        Ok(Self {
            causes: AuthorCauses::new([&paper, &consistent], &trajectories, args.rate)?,
            printed_solutions: study::printed_solutions(&paper, &benches[0].fits[0].fit)?,
            lengths,
            replica: LengthSearch::new(host, &trajectories, 4 * args.random, args.seed)?,
            conditions: conditions::compare(host, &smaller)?,
            paper,
            trajectories,
            benches,
            base,
            rate: args.rate,
        })
    }

    /// The page.
    pub fn page(&self) -> String {
        page::render(self)
    }
}
