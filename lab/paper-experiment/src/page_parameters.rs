//! Chapters 5 to 7 of the page: changes of the parameters, differences to the paper's numbers with their reasons, and
//! the coefficients of the trajectories.

use std::fmt::Write as _;

use crate::page::ExperimentPage;
use crate::study::{self, UNKNOWN};
use crate::wording::{decimals, largest, least, percent, share};
use crate::{PaperExperiment, figures, printed};

/// Least and largest of the paper's errors with calculated parameters, from Table 2, as shares.
const PAPER_ERRORS: [f64; 2] = [0.0782, 0.1020];

impl ExperimentPage {
    /// Chapter 5: base parameters before and after identification.
    pub(crate) fn base_parameters(&mut self, experiment: &PaperExperiment) {
        self.heading("5  Base parameters: identification corrects the place of the mass");
        let [calculated, consistent, estimated] = &experiment.base;
        // Where the paper's estimate and ours move, compared with the consistent values.
        self.paragraph(
            "The consistent treatment is a special case of eq. (16): the five values in column two give exactly its \
             forces, with p4,min = 0. Identification with the paper's treatment arrives at these values on the rig. \
             The paper's own estimate, computed from the right column of its Table 1 with the lengths assumed here, \
             moves in the same direction for all five. It overshoots in p1,min and p2,min. So does ours when the \
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
             and subtract. Of this change, {} (identification run) and {} (verification run) is the force of the \
             misplaced m4, without any fit (squares; correlation {:.2} and {:.2}). This does not use our rigs. The \
             remainder is the amount by which the paper's values go beyond the consistent ones.",
            share(1.0 - changes[0].remains.powi(2)),
            share(1.0 - changes[1].remains.powi(2)),
            changes[0].correlation,
            changes[1].correlation,
        ));
        self.figure(
            &figures::printed_change(
                "What the paper's identification changed, verification run",
                &runs[1],
                &experiment.paper.drives(),
            ),
            "Forces with the estimated parameters of the paper's Table 1 minus forces with its calculated ones, in \
             its own treatment.",
        );
    }

    /// Chapter 6: physical parameters, compared with Table 1 of the paper.
    pub(crate) fn table_1(&mut self, experiment: &PaperExperiment) {
        self.heading("6  Table 1, compared with the paper's");
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
                let unit = parameter.map_or("", |p| p.unit.as_str());
                let mut row = vec![
                    format!("{name}, {unit}"),
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
        // Why no solution is the robot.
        self.paragraph(
            "With p4,min = 0 the printed treatment allows only m4 = 0 or dc3 = d3: the two solutions for the rig. \
             Neither is the robot, which has m4 = 12.456 kg and dc3 = 0.515 m; the negative values show this. The \
             equations are solved correctly, but the treatment cannot represent the true masses. This agrees with the \
             paper's remark that its estimates are not the real physical parameters (its dc3 moves from 0.515 m to \
             0.833 m, towards d3).",
        );
    }

    /// Chapter 7: reasons for other numbers than the paper's, and the influence of one length.
    pub(crate) fn differences(&mut self, experiment: &PaperExperiment) {
        self.heading("7  Where our numbers differ from the paper's, and why");
        let plain = &experiment.benches[0].runs;
        // The size of the errors depends on lengths that the paper does not print.
        self.paragraph(&format!(
            "The paper prints masses but no lengths, limits or coefficients. The lengths of spidermill.toml (d1, d3, \
             b, dA, Bx, By) and both trajectories are assumptions, and they determine how large the errors are in per \
             cent. Before identification ours are {} to {} (nrms), and the mean relative error is {} to {}, far above \
             the paper's 8 to 10 %. With these lengths the misplaced m4 is a larger part of the spindle forces, and \
             these pass through zero often. So this page reproduces the cause of the paper's errors, but not their \
             size.",
            percent(least(plain, |a, d| a.errors(d, &a.calculated[0]).nrms)),
            percent(largest(plain, |a, d| a.errors(d, &a.calculated[0]).nrms)),
            percent(least(plain, |a, d| a.errors(d, &a.calculated[0]).mean_relative)),
            percent(largest(plain, |a, d| a.errors(d, &a.calculated[0]).mean_relative)),
        ));
        // The influence of one of these lengths.
        self.paragraph(
            "The influence of one unprinted length: the same test motion with other distances b of the base joints \
             (all else unchanged), compared with the consistent treatment, which represents the rig. The error is the \
             force of the misplaced m4 at every b. Its size relative to the other forces changes.",
        );
        // Distances at which the errors of both spindles are within the paper's band.
        let reached: Vec<_> = experiment
            .lengths
            .iter()
            .filter(|length| {
                let nrms = length.errors.iter().map(|e| e.nrms);
                nrms.clone().fold(0.0, f64::max) <= PAPER_ERRORS[1]
                    && nrms.fold(f64::INFINITY, f64::min) >= PAPER_ERRORS[0]
            })
            .collect();
        self.figure(
            &figures::lengths(&experiment.lengths, PAPER_ERRORS),
            "The paper's band is a mean relative error; ours is the nrms, which has no peaks. At every instant the \
             spindle mounts (dA, Bx, By) scale error and force by the same factor.",
        );
        if !reached.is_empty() {
            self.paragraph(&format!(
                "At b = {} the nrms of both spindles is within the paper's band (the mean relative error is not: {}). \
                 The b of the real robot is not known.",
                reached
                    .iter()
                    .map(|length| format!("{} m", length.distance))
                    .collect::<Vec<_>>()
                    .join(", "),
                reached
                    .iter()
                    .flat_map(|length| length.errors.iter().map(|e| percent(e.mean_relative)))
                    .collect::<Vec<_>>()
                    .join(", "),
            ));
        }
        // The errors after identification have no counterpart on the rig without rods.
        self.paragraph(
            "The paper's errors after identification, 3.3 to 3.6 %, have no counterpart on the rig without rods, \
             where the residual is zero. They must come from something that its multibody model has in addition to a \
             planar rigid M structure, perhaps spindles with mass and their offset at the cranks. The rig with rods \
             shows such a residual. Its size depends on the rods, whose mass is an assumption.",
        );
    }

    /// Coefficients of both trajectories, so that the runs can be repeated.
    pub(crate) fn coefficients(&mut self, experiment: &PaperExperiment) {
        self.paragraph("Coefficients of the trajectories, eq. (15), rad and rad/s:");
        let names = experiment.paper.active_coordinates();
        // One table per trajectory, with the coefficients as they were used.
        for (periodic, run) in experiment.trajectories.iter().zip(["Identification", "Verification"]) {
            let means: Vec<String> = periodic
                .series
                .iter()
                .zip(&names)
                .map(|(series, name)| format!("mean of {name} {:.4}", series.offset))
                .collect();
            self.paragraph(&format!("{run}, period {} s, {}:", periodic.period, means.join(", ")));
            // Two columns per coordinate: the coefficients mu and nu of every harmonic.
            let mut head = vec!["k".to_owned()];
            for name in &names {
                head.extend([format!("mu, {name}"), format!("nu, {name}")]);
            }
            let harmonics = periodic.series.first().map_or(0, |series| series.mu.len());
            let rows: Vec<Vec<String>> = (0..harmonics)
                .map(|k| {
                    let mut row = vec![(k + 1).to_string()];
                    for series in &periodic.series {
                        row.extend([series.mu[k], series.nu[k]].map(decimals));
                    }
                    row
                })
                .collect();
            let head: Vec<&str> = head.iter().map(String::as_str).collect();
            self.table(&head, &rows);
        }
        let _ = writeln!(
            self.0,
            "<p>This page is written by <code>modelmill experiment --out docs</code>.</p>"
        );
    }
}
