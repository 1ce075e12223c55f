//! Chapters 8 to 10 of the page and its end: differences to the paper's numbers with their reasons, the condition number,
//! lengths that would give Table 2, and the coefficients of the trajectories.

use std::fmt::Write as _;

use modelmill::text::table::significant;

use crate::conditions::ConditionRow;
use crate::page::ExperimentPage;
use crate::wording::{decimals, largest, least, percent};
use crate::{PaperExperiment, figures, printed};

/// Least and largest of the paper's errors with calculated parameters, from Table 2, as shares.
const PAPER_ERRORS: [f64; 2] = [0.0782, 0.1020];

impl ExperimentPage {
    /// Chapter 8: reasons for other numbers than the paper's, and the influence of one length.
    pub(crate) fn differences(&mut self, experiment: &PaperExperiment) {
        self.heading("8  Where our numbers differ from the paper's, and why");
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
            "The paper's errors after identification, 3.3 to 3.6 %, have no counterpart on the rig without rods, where \
             the residual is zero. Contact points beside the axes of the cranks leave such errors (section 4), and so do \
             spindles with mass. Which of them its multibody model has, the paper does not print; it names the first.",
        );
    }

    /// Chapter 9: the condition number, and what each assumption does to it.
    pub(crate) fn conditions(&mut self, experiment: &PaperExperiment) {
        let ours = experiment.trajectories[0].condition_number;
        self.heading("9  The condition number: why it is not the paper's");
        let shown: Vec<Vec<String>> = experiment
            .conditions
            .rows
            .iter()
            .map(|row| {
                vec![
                    row.change.clone(),
                    row.harmonics.to_string(),
                    significant(row.period, 4),
                    significant(row.condition_number, 4),
                ]
            })
            .collect();
        self.paragraph(&format!(
            "The paper reports {} with {} harmonics and {} s, ours is {} with the same. The condition number depends on \
             limits and lengths that the paper does not print, and on the period, which is one of its variables in eq. \
             (17). The table has one search per assumption, all else as in section 1 but with a quarter of the random \
             trajectories and one start.",
            printed::CONDITION_NUMBER,
            printed::EXCITATION.0,
            printed::EXCITATION.1,
            significant(ours, 4),
        ));
        self.table(&["assumption", "harmonics", "period, s", "condition number"], &shown);
        self.paragraph(&condition_words(experiment));
        for [change, reason] in &experiment.conditions.without {
            self.paragraph(&format!(
                "No excitation was found with this assumption: {change}. {reason}"
            ));
        }
    }

    /// Chapter 10: lengths and limits for which Table 2 would be the paper's.
    pub(crate) fn replica(&mut self, experiment: &PaperExperiment) {
        let found = &experiment.replica;
        self.heading("10  Lengths and limits that would give Table 2");
        self.paragraph(&format!(
            "With which lengths and motions would the errors be the paper's? A random search with {} trials varies the \
             lengths, the distance eA of the contact points from the axes, and pose, size and duration of both motions. \
             The masses are those of Table 1, and the model neglects eA. The result shows how far the paper's figures \
             can be explained by these two causes alone. It is not the geometry of the real robot: other lengths give \
             similar figures. The largest factor between an error and the paper's is {}.",
            found.evaluations,
            significant(found.largest_factor(), 3),
        ));
        let mut rows = Vec::new();
        for (s, stage) in ["calculated", "estimated"].into_iter().enumerate() {
            for (d, name) in ["fe1, left", "fe10, right"].into_iter().enumerate() {
                for (k, run) in ["identification", "verification"].into_iter().enumerate() {
                    rows.push(vec![
                        format!("{run}, {stage}, {name}"),
                        format!("{:.2} %", printed::TABLE_2[s][d][k]),
                        percent(found.errors[1][s][d][k]),
                        percent(found.errors[0][s][d][k]),
                    ]);
                }
            }
        }
        let head = [
            "mean relative error",
            "*paper",
            "with these lengths and limits",
            "assumptions of this page, eA = 20 mm",
        ];
        self.table(&head, &rows);
        let lengths: Vec<String> = (found.lengths.iter())
            .map(|(name, value)| format!("{name} = {} m", significant(*value, 3)))
            .collect();
        self.paragraph(&format!("Lengths: {}.", lengths.join(", ")));
        // The limits are the extremes of the motions.
        let mut rows = Vec::new();
        for (series, run) in found.motions.iter().zip(["identification", "verification"]) {
            for (one, name) in series.iter().zip(experiment.paper.active_coordinates()) {
                let [positions, rates, accelerations] = [0, 1, 2].map(|derivative| one.extremes(derivative));
                let largest = |[low, high]: [f64; 2]| significant(high.max(-low), 3);
                rows.push(vec![
                    format!("{run}, {name}"),
                    format!("{} to {}", significant(positions[0], 3), significant(positions[1], 3)),
                    largest(rates),
                    largest(accelerations),
                    significant(one.period(), 3),
                ]);
            }
        }
        let head = [
            "motion",
            "angles, rad",
            "rate up to, rad/s",
            "acceleration up to, rad/s^2",
            "period, s",
        ];
        self.table(&head, &rows);
    }

    /// Coefficients of both trajectories, so that the runs can be repeated.
    pub(crate) fn coefficients(&mut self, experiment: &PaperExperiment) {
        self.heading("12  Coefficients of the trajectories");
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

/// What the period as a variable and more harmonics gain, and which assumption reaches the paper's condition number.
fn condition_words(experiment: &PaperExperiment) -> String {
    let rows = &experiment.conditions.rows;
    let find = |harmonics: usize, is_free: bool| {
        let wanted = |row: &&ConditionRow| {
            row.harmonics == harmonics
                && row.change.starts_with(&harmonics.to_string())
                && row.change.contains("best period") == is_free
        };
        rows.iter().find(wanted)
    };
    let mut words = Vec::new();
    if let (Some(fixed), Some(free)) = (find(7, false), find(7, true)) {
        let ratio = fixed.condition_number / free.condition_number;
        words.push(format!(
            "The period as a variable improves it by a factor of {} (7 harmonics, {} s instead of {} s).",
            significant(ratio, 3),
            significant(free.period, 3),
            fixed.period,
        ));
    }
    if let (Some(few), Some(many)) = (find(3, true), find(9, true)) {
        words.push(format!(
            "From 3 to 9 harmonics, each with its best period, the condition number goes from {} to {}. The searches are \
             local: two of them that differ by less than a tenth are not distinguishable.",
            significant(few.condition_number, 3),
            significant(many.condition_number, 3),
        ));
    }
    let reached: Vec<&str> = rows
        .iter()
        .filter(|row| row.condition_number <= printed::CONDITION_NUMBER)
        .map(|row| row.change.as_str())
        .collect();
    words.push(match reached.as_slice() {
        [] => format!(
            "No single change reaches the paper's {}; its robot differs in several of them.",
            printed::CONDITION_NUMBER
        ),
        reached => format!(
            "The paper's {} is reached by: {}.",
            printed::CONDITION_NUMBER,
            reached.join("; ")
        ),
    });
    words.join(" ")
}
