//! Chapters 6 and 7 of the page: changes of the parameters by identification, and Table 1.

use crate::page::ExperimentPage;
use crate::study::{self, ExplainedError, TreatmentRun, UNKNOWN};
use crate::wording::{decimals, share};
use crate::{PaperExperiment, figures, printed};

impl ExperimentPage {
    /// Chapter 6: base parameters before and after identification.
    pub(crate) fn base_parameters(&mut self, experiment: &PaperExperiment) {
        self.heading("6  Base parameters: identification corrects the place of the mass");
        let [calculated, consistent, estimated] = &experiment.base;
        // Where the paper's estimate and ours move, compared with the consistent values.
        self.paragraph(
            "The consistent treatment is a special case of eq. (16): the five values in column two give exactly its \
             forces, with p4,min = 0. Identification with the paper's treatment arrives at these values on the rig. \
             The paper's own estimate, computed from the right column of its Table 1 with the lengths assumed here, \
             moves in the same direction for all five. It overshoots in all but p4,min. So does ours when the \
             spindles are rods, which add to the inertia of the cranks. The paper does not state whether its \
             multibody model has such spindles.",
        );
        // Estimates with the paper's treatment, without and with rods.
        let ours = [0, 1].map(|k| experiment.benches[k].fits[0].values());
        let units: Vec<&str> = experiment.paper.base.iter().map(|b| b.unit.as_str()).collect();
        // Values that are zero up to rounding are printed as zero.
        let value = |x: f64| {
            if x.abs() < 1e-6 {
                "0.000".to_owned()
            } else {
                format!("{x:.3}")
            }
        };
        // One row per base parameter.
        let rows: Vec<Vec<String>> = (0..calculated.len())
            .map(|k| {
                vec![
                    format!("p{},min, {}", k + 1, units[k]),
                    value(calculated[k]),
                    value(consistent[k]),
                    value(estimated[k]),
                    value(ours[0][k]),
                    value(ours[1][k]),
                ]
            })
            .collect();
        self.table(
            &[
                "",
                "calculated",
                "consistent",
                "*paper's estimate",
                "estimated, rig",
                "estimated, with rods",
            ],
            &rows,
        );
        // The change by the paper's own identification, explained by the misplaced mass along both runs.
        let runs = &experiment.benches[0].runs;
        let changes = [0, 1].map(|k| study::explain_error(&runs[k].printed_change(), &runs[k].placement()));
        self.figure(
            &figures::base_parameter_positions(experiment),
            "0 is the value that the paper calculates from Table 1; 1 is the value of the same masses at one place. \
             Values above 3 or below -0.1 are drawn at the edge.",
        );
        // The same comparison in forces, which needs neither rig.
        self.paragraph(&format!(
            "In forces: take the paper's estimated and calculated parameters, put both into eq. (16) along our runs, \
             and subtract. This change is compared with the force of the misplaced m4, without any fit and without our \
             rigs. Of its squares, {} (identification run) and {} (verification run) are that force. Most of this is the \
             constant part, which gravity causes. About their means both are less alike; the table has the correlation \
             coefficient (Pearson) and the share of the variation about the mean that is explained, 1 minus the ratio \
             of the squares. The remainder is the amount by which the paper's values go beyond the consistent ones.",
            share(1.0 - changes[0].remains.powi(2)),
            share(1.0 - changes[1].remains.powi(2)),
        ));
        self.table(
            &[
                "run",
                "correlation coefficient (Pearson)",
                "explained variation about the mean",
            ],
            &change_rows(runs, &changes),
        );
        self.figure(
            &figures::printed_change(
                "What the paper's identification changed, verification run",
                &runs[1],
                &experiment.paper.row_names(),
            ),
            "Forces with the estimated parameters of the paper's Table 1 minus forces with its calculated ones, in \
             its own treatment.",
        );
    }

    /// Chapter 7: physical parameters, compared with Table 1 of the paper.
    pub(crate) fn table_1(&mut self, experiment: &PaperExperiment) {
        self.heading("7  Table 1, compared with the paper's");
        // The parameters that are assumed to be known, as in the paper.
        self.paragraph(
            "As in the paper, m1, m3 and dc1 are known and the others are solved from the five estimated base parameters; all real \
             solutions are given.",
        );
        let parameters = &experiment.paper.derivation.mechanism.parameters;
        let mut head = vec![String::new(), "nominal".to_owned(), "*paper's estimate".to_owned()];
        let names = ["rig", "with rods"];
        // One column per rig and real solution.
        let mut columns: Vec<&[f64]> = Vec::new();
        for (bench, name) in experiment.benches.iter().zip(names) {
            for (k, one) in bench.physical.iter().enumerate() {
                head.push(format!("{name}, solution {}", k + 1));
                columns.push(&one.values);
            }
        }
        // One row per parameter that Table 1 determines.
        let rows: Vec<Vec<String>> = UNKNOWN
            .iter()
            .enumerate()
            .map(|(i, name)| {
                let parameter = parameters.iter().find(|p| p.name == *name);
                let mut row = vec![
                    labelled(name, experiment),
                    parameter.map_or_else(String::new, |p| format!("{:.4}", p.nominal)),
                    format!("{:.4}", printed::ESTIMATED[i].1),
                ];
                row.extend(columns.iter().map(|values| decimals(values[i])));
                row
            })
            .collect();
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        self.table(&head, &rows);
        // A rig without a real solution is explained in the text.
        for (bench, name) in experiment.benches.iter().zip(names) {
            if bench.physical.is_empty() {
                let p4 = bench.fits[0].values()[3];
                self.paragraph(&format!(
                    "{name}: no real values of these five give the estimated base parameters. The estimate of p4,min \
                     is {p4:.2} kg: the reduced model has no rods, so their effect goes into other parameters.",
                ));
            }
        }
        self.second_root(experiment);
        // Why no solution is the robot.
        self.paragraph(
            "With p4,min = 0 the printed treatment allows only m4 = 0 or dc3 = d3: the two solutions for the rig. \
             Neither is the robot, which has m4 = 12.456 kg and dc3 = 0.515 m; the negative values show this. The \
             equations are solved correctly, but the treatment cannot represent the true masses. This agrees with the \
             paper's remark that its estimates are not the real physical parameters (its dc3 moves from 0.515 m to \
             0.833 m, towards d3).",
        );
    }

    /// The other solution of the paper's own Table 1, and why it is refused.
    fn second_root(&mut self, experiment: &PaperExperiment) {
        let solutions = &experiment.printed_solutions;
        let d3 = experiment.paper.derivation.mechanism.constants.iter();
        let d3 = d3.into_iter().find(|c| c.name == "d3").map_or(f64::NAN, |c| c.value);
        self.paragraph(&format!(
            "The paper's own Table 1 has a second root. Its equations are quadratic in dc3: the five base parameters of \
             its right column belong to {} real solutions, of which it prints one.",
            solutions.len()
        ));
        let mut head = vec![String::new(), "*paper's estimate".to_owned()];
        head.extend((0..solutions.len()).map(|k| format!("solution {}", k + 1)));
        let rows: Vec<Vec<String>> = UNKNOWN
            .iter()
            .enumerate()
            .map(|(i, name)| {
                let mut row = vec![labelled(name, experiment), format!("{:.4}", printed::ESTIMATED[i].1)];
                row.extend(solutions.iter().map(|one| decimals(one.values[i])));
                row
            })
            .collect();
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        self.table(&head, &rows);
        // The reasons are read from the values, so that they hold for them.
        for (k, one) in solutions.iter().enumerate() {
            let negative: Vec<&str> = (UNKNOWN.iter().zip(&one.values))
                .filter(|(_, value)| **value < 0.0)
                .map(|(name, _)| *name)
                .collect();
            let mut reasons = Vec::new();
            if !negative.is_empty() {
                reasons.push(format!("negative {}", negative.join(", ")));
            }
            if one.values[2] > d3 {
                reasons.push(format!(
                    "a centre of mass beyond the end of the coupler (dc3 > d3 = {d3} m)"
                ));
            }
            let verdict = match reasons.as_slice() {
                [] => {
                    "possible: all masses and inertias are positive and the centre lies within the coupler".to_owned()
                }
                reasons => format!("refused: {}", reasons.join("; ")),
            };
            self.paragraph(&format!("Solution {}: {verdict}.", k + 1));
        }
    }
}

/// The name of a parameter with its unit.
fn labelled(name: &str, experiment: &PaperExperiment) -> String {
    let mut parameters = experiment.paper.derivation.mechanism.parameters.iter();
    let unit = parameters.find(|p| p.name == name).map_or("", |p| p.unit.as_str());
    format!("{name}, {unit}")
}

/// One row per run for all drives, and one per drive: how the paper's change follows the force of the misplaced mass.
fn change_rows(runs: &[TreatmentRun; 2], changes: &[ExplainedError; 2]) -> Vec<Vec<String>> {
    let row = |name: String, one: &ExplainedError| vec![name, format!("{:.2}", one.correlation), share(one.variation)];
    let mut rows = Vec::new();
    for ((along, change), run) in runs.iter().zip(changes).zip(["identification", "verification"]) {
        rows.push(row(format!("{run}, both spindles"), change));
        let (printed, placement) = (along.printed_change(), along.placement());
        let drives = study::single_drives(&printed).zip(study::single_drives(&placement));
        for ((printed, placement), side) in drives.zip(["fe1, left", "fe10, right"]) {
            rows.push(row(
                format!("{run}, {side}"),
                &study::explain_error(&printed, &placement),
            ));
        }
    }
    rows
}
