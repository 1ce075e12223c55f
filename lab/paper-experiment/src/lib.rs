//! `experiment`: the paper's experiment, its Section 5, on the bundled rig. One page has the excitation, the runs, both
//! treatments of m4, Tables 1 and 2 compared with the paper's, and the cause of the errors.
//!
//! Decision: every number and figure of `docs/experiment.html` comes from a run of the command. Coefficients of
//! trajectories are rounded to four decimals before the simulation, so that the page can print what was used.
//! Errors that are rounding are shown as zero, because their digits differ between machines.

mod figures;
mod lengths;
mod page;
mod page_forces;
mod page_parameters;
mod printed;
mod runs;
mod study;
mod wording;

mod bundled;

use modelmill::text::TerminalStyle;
use modelmill::text::table::{ColumnAlignment, number, percent, table};
use modelmill::{Host, Model, Outcome};
use modelmill_identify::excite::Options;
use serde_json::json;

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
    /// The error for other distances of the base joints.
    lengths: Vec<lengths::DistanceErrors>,
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
            paper.nominal.clone(),
            study::consistent_values(&paper, &consistent, &data)?,
            study::values_with(&paper, &printed::ESTIMATED),
        ];
        // The test motion once more, with other distances of the base joints.
        let lengths = lengths::scan(host, &trajectories[1].series)?;
        Ok(Self {
            lengths,
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

    /// Error figures of all runs, for people.
    pub fn text(&self, style: TerminalStyle) -> String {
        let mut lines = vec![style.bold(&format!(
            "The paper's experiment: condition number {} (paper {})",
            number(self.trajectories[0].condition_number),
            printed::CONDITION_NUMBER
        ))];
        // One row per rig, run and treatment.
        let mut rows = Vec::new();
        for (bench, rig) in self.benches.iter().zip(["rig", "rig with rods"]) {
            for (along, run) in bench.runs.iter().zip(["identification", "verification"]) {
                for (t, treatment) in ["the paper's", "consistent"].into_iter().enumerate() {
                    let mut row = vec![format!("{rig}, {run}"), treatment.to_owned()];
                    for modelled in [&along.calculated[t], &along.estimated[t]] {
                        row.extend((0..2).map(|d| percent(Some(along.errors(d, modelled).nrms))));
                    }
                    let remains = along.explained_error().remains;
                    row.push(if t == 0 { percent(Some(remains)) } else { String::new() });
                    rows.push(row);
                }
            }
        }
        let columns = [
            ("nrms", ColumnAlignment::Left),
            ("treatment of m4", ColumnAlignment::Left),
            ("calculated fe1", ColumnAlignment::Right),
            ("fe10", ColumnAlignment::Right),
            ("estimated fe1", ColumnAlignment::Right),
            ("fe10", ColumnAlignment::Right),
            ("residual without m4's shift", ColumnAlignment::Right),
        ];
        lines.extend(table(2, &columns, &rows));
        lines.join("\n")
    }

    /// All figures as one JSON object.
    pub fn json(&self) -> serde_json::Value {
        // The same numbers for scripts.
        let bench = |bench: &TreatmentStudy| {
            let run = |k: usize| {
                let along = &bench.runs[k];
                let treatment = |t: usize| {
                    let errors = |modelled: &study::DriveColumns| -> Vec<serde_json::Value> {
                        (0..modelled.len())
                            .map(|d| {
                                let e = along.errors(d, modelled);
                                json!({ "nrms": e.nrms, "mean_relative": e.mean_relative, "median_relative": e.median_relative })
                            })
                            .collect()
                    };
                    json!({
                        "calculated": errors(&along.calculated[t]),
                        "estimated": errors(&along.estimated[t]),
                    })
                };
                let explained = along.explained_error();
                let printed = study::explain_error(&along.printed_change(), &along.placement());
                json!({
                    "paper": treatment(0),
                    "consistent": treatment(1),
                    "explained": {
                        "remains": explained.remains,
                        "correlation": explained.correlation,
                    },
                    "paper_change": {
                        "remains": printed.remains,
                        "correlation": printed.correlation,
                    },
                })
            };
            let solutions: Vec<_> = bench.physical.iter().map(|one| one.values.clone()).collect();
            json!({
                "identification": run(0),
                "verification": run(1),
                "p_min": bench.fits[0].values(),
                "table_1": solutions,
            })
        };
        json!({
            "condition_number": self.trajectories[0].condition_number,
            "rate": self.rate,
            "spidermill_full": bench(&self.benches[0]),
            "spidermill_with_rods": bench(&self.benches[1]),
            "lengths": self.lengths.iter().map(|length| {
                json!({
                    "b": length.distance,
                    "nrms": length.errors.iter().map(|e| e.nrms).collect::<Vec<_>>(),
                })
            }).collect::<Vec<_>>(),
            "p_min": {
                "calculated": self.base[0],
                "consistent": self.base[1],
                "paper_estimated": self.base[2],
            },
        })
    }
}
