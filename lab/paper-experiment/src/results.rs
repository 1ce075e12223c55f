//! The figures of the experiment as text for people and as JSON for scripts.

use modelmill::text::TerminalStyle;
use modelmill::text::table::{ColumnAlignment, number, percent, table};
use serde_json::json;

use crate::causes::ContactStudy;
use crate::study::{DriveColumns, TreatmentRun, TreatmentStudy};
use crate::{PaperExperiment, printed, study};

impl PaperExperiment {
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
                        "explained_variation": explained.variation,
                    },
                    "paper_change": {
                        "remains": printed.remains,
                        "correlation": printed.correlation,
                        "explained_variation": printed.variation,
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
            "causes": self.causes_json(),
            "table_1_of_the_paper": self.printed_solutions.iter().map(|one| &one.values).collect::<Vec<_>>(),
            "lengths_for_table_2": {
                "lengths": self.replica.lengths.iter().map(|(name, value)| ((*name).to_owned(), json!(value)))
                    .collect::<serde_json::Map<_, _>>(),
                "mean_relative": self.replica.errors[1],
                "largest_factor": self.replica.largest_factor(),
            },
            "conditions_without_result": self.conditions.without,
            "conditions": self.conditions.rows.iter().map(|row| {
                json!({
                    "change": row.change,
                    "harmonics": row.harmonics,
                    "period": row.period,
                    "condition_number": row.condition_number,
                })
            }).collect::<Vec<_>>(),
            "p_min": {
                "calculated": self.base[0],
                "consistent": self.base[1],
                "paper_estimated": self.base[2],
            },
        })
    }

    /// The study of the authors' causes: forces with moved centres, contact points, and the diagnosis with fixed
    /// parameters.
    fn causes_json(&self) -> serde_json::Value {
        let causes = &self.causes;
        let contact = |one: &ContactStudy| {
            let run = |along: &TreatmentRun| {
                let errors = |modelled: &DriveColumns| -> Vec<f64> {
                    let drives = 0..modelled.len();
                    drives.map(|d| along.errors(d, modelled).mean_relative).collect()
                };
                json!({ "calculated": errors(&along.calculated[0]), "estimated": errors(&along.estimated[0]) })
            };
            let [identification, verification] = &one.study.runs;
            json!({
                "offset": one.offset,
                "identification": run(identification),
                "verification": run(verification),
            })
        };
        json!({
            "moved_centres": causes.moved_centres,
            "contacts": causes.contacts.iter().map(contact).collect::<Vec<_>>(),
            "held": {
                "offset": causes.held.offset,
                "m4_and_offset": causes.held.first,
                "m4_with_offset": causes.held.second,
                "nrms": causes.held.errors,
                "alternatives": causes.held.alternatives,
            },
        })
    }
}
