//! Chapters 1 to 3 and 5 of the page: the simulated runs, the errors of the forces, and the cause of these errors.

use crate::page::ExperimentPage;
use crate::study::{DriveColumns, TreatmentRun};
use crate::wording::{change, explained_text, largest, least, millimetres, nominal, percent, range, rounding, share};
use crate::{PaperExperiment, causes, figures, printed};
use modelmill::text::table::significant;

/// Forces below this share of their root mean square count as near zero.
const NEAR_ZERO: f64 = 0.1;

impl ExperimentPage {
    /// The summary at the top of the page.
    pub(crate) fn summary(&mut self, experiment: &PaperExperiment) {
        let plain = &experiment.benches[0].runs;
        let rods = &experiment.benches[1].runs;
        let [calculated, consistent, estimated] = &experiment.base;
        self.0.push_str("<div class=\"short\">\n");
        // The result of the page: the reduction is exact, and the paper's error has one cause.
        self.paragraph(&format!(
            "This page repeats the experiment of the paper \"{}\" (its authors and year are not printed in the copy \
             that this project has). Before identification, the forces of the paper's reduced model differ from those \
             of its multibody model by 8 to 10 %; after it, by 3.3 to 3.6 %. The authors name two causes: mainly the \
             places of the point masses for the coupling elements and the platform, because the true lever arms are \
             longer, and in addition the contact points of the spindles. Section 4 examines both. Here the complete \
             robot, 11 groups with true parallel cranks, is simulated by a program that shares no \
             mechanics with the model. A reduced model in which the platform's mass m4 acts at one place agrees with \
             it to {} without any identification: the reduction loses nothing. The paper's treatment, with the same \
             masses, has an error of {} to {} (nrms). Of that error, {} is the force of one mass, m4, which the \
             balance of moments places elsewhere than the balance of forces. The cause is that of the paper's error. \
             The size differs, because it depends on lengths and motions that the paper does not print (sections 8 \
             to 10).",
            printed::TITLE,
            rounding(largest(plain, |along, d| along.errors(d, &along.calculated[1]).nrms)),
            percent(least(plain, |along, d| along.errors(d, &along.calculated[0]).nrms)),
            percent(largest(plain, |along, d| along.errors(d, &along.calculated[0]).nrms)),
            explained_text(plain),
        ));
        // The same conclusion from the paper's own numbers.
        self.paragraph(&format!(
            "The paper's own Table 1 agrees: p4,min = m4 (1 - dc3/d3), which is zero for a mass in one place, falls \
             from {} kg to {} kg by identification (with d3 = 1.03 m; for any d3, by more than {}). p3,min and p5,min \
             come within {} and {} of the consistent values.",
            significant(calculated[3], 3),
            significant(estimated[3], 3),
            percent(1.0 - printed::ESTIMATED[1].1 / nominal(experiment, "m4")),
            percent((estimated[2] / consistent[2] - 1.0).abs()),
            percent((estimated[4] / consistent[4] - 1.0).abs()),
        ));
        // Both causes that the authors name, with their figures.
        let causes = &experiment.causes;
        self.paragraph(&format!(
            "Of the authors' two causes, the first is refuted and the second confirmed. Lever arms: G2, G6 and the \
             platform only translate, so their centres of mass have no effect on any force (moved by {} mm along x and \
             y, the forces change by {}). The point masses are right; one of them, m4, is placed differently in the \
             two balances. Contact points: with {} mm between contact point and axis of the crank, the paper's model \
             has mean relative errors of {} after identification, with {} mm {} (paper: 3.3 to 3.6 %).",
            millimetres(causes::SHIFT),
            change(causes.moved_centres),
            millimetres(causes.contacts[0].offset),
            range(&causes.contacts[0].study.runs, |a, d| a
                .errors(d, &a.estimated[0])
                .mean_relative),
            millimetres(causes.contacts[1].offset),
            range(&causes.contacts[1].study.runs, |a, d| a
                .errors(d, &a.estimated[0])
                .mean_relative),
        ));
        // The part of the error that has another cause.
        self.paragraph(&format!(
            "With spindles that have mass (rods of 8 kg), {} of the error of the paper's treatment (2-norm, \
             verification run) is not caused by m4. This part comes from the rods.",
            percent(rods[1].explained_error().remains)
        ));
        self.0.push_str("</div>\n");
    }

    /// Chapter 1: excitation, rigs and models.
    pub(crate) fn method(&mut self, experiment: &PaperExperiment) {
        let [excitation, test] = &experiment.trajectories;
        self.heading("1  Method");
        // The trajectories, so that the experiment can be repeated.
        self.paragraph(&format!(
            "Excitation, eq. (14), (15) and (17): {} harmonics and a period of {} s, as in the paper, within the \
             limits of spidermill.toml. The best of {} random trajectories has condition number {}, the optimised one \
             {} (paper: {}). The test run is another random series, with {} harmonics and a period of {} s. \
             Coefficients are rounded to four decimals and printed at the end, so that the runs can be repeated \
             without the search.",
            excitation.series.first().map_or(0, |s| s.mu.len()),
            excitation.period,
            excitation.random,
            significant(excitation.start, 4),
            significant(excitation.condition_number, 4),
            printed::CONDITION_NUMBER,
            test.series.first().map_or(0, |s| s.mu.len()),
            test.period,
        ));
        // The rigs in the place of the paper's multibody model, and the two reduced models.
        self.paragraph(&format!(
            "Both are simulated at {} Hz on two rigs: spidermill-full.toml, whose 11 groups sum up to Table 1, and \
             spidermill-with-rods.toml, the same with a rod of 8 kg and 0.9 m in each spindle. The sensors are \
             perfect, so every difference between rig and model is a model error. Two reduced models are compared \
             with them: spidermill-paper.toml, which is exactly eq. (5) and eq. (16), and spidermill.toml, the \
             consistent one.",
            experiment.rate
        ));
        // The difference between the two models.
        self.paragraph(
            "The paper assigns half of m4 to each coupler. In the coupler's balance of forces it acts at the joint \
             R3m. In the balance of moments about the elbow it acts at the coupler's centre of mass. This is the \
             origin of the products m4 dc3 and m4 dc3^2 of eq. (5). A mass at one place gives four base parameters \
             instead of five.",
        );
        // All panels of Fig. 6 and 7. As the paper's multibody model, this rig has an error that identification leaves.
        let contact = &experiment.causes.contacts[0];
        let offset = millimetres(contact.offset);
        for (k, title, caption) in [
            (
                1,
                "Fig. 6: verification (test) trajectories",
                "Compare Fig. 6 of the paper, a to f.",
            ),
            (
                0,
                "Fig. 7: identification trajectories",
                "Compare Fig. 7 of the paper, a to f.",
            ),
        ] {
            let svg = figures::panels(title, &experiment.trajectories[k], &contact.study.runs[k]);
            self.figure(
                &svg,
                &format!(
                    "{caption} Rig with contact points {offset} mm beside the axes of the cranks (section 4), the paper's \
                     treatment. Calculated: parameters of the CAD column of Table 1; estimated: identified. At this scale the forces \
                     of the rig and the estimated ones are one curve."
                ),
            );
        }
    }

    /// Chapter 2: errors of both treatments, compared with Table 2 of the paper.
    pub(crate) fn table_2(&mut self, experiment: &PaperExperiment) {
        self.heading("2  Table 2, compared with the paper's");
        // The measures of error: the paper's, and two without its peaks.
        self.paragraph(
            "The paper's measure is the mean of |error| / |force|. It is dominated by the times at which a force \
             passes through zero (section 5). The tables therefore also show the median of the same quotient and the \
             nrms (2-norm of the error divided by that of the force).",
        );
        let names = ["fe1, left", "fe10, right"];
        // One table per treatment; only the first one has numbers of the paper.
        for (t, title) in ["The paper's treatment", "The consistent treatment"]
            .into_iter()
            .enumerate()
        {
            self.paragraph(&format!("{title}:"));
            // One row per run, stage of identification, and drive.
            let mut rows = Vec::new();
            for (k, run) in ["identification", "verification"].into_iter().enumerate() {
                for (s, stage) in ["calculated", "estimated"].into_iter().enumerate() {
                    for (d, name) in names.into_iter().enumerate() {
                        // The paper's number first, then the errors on both rigs.
                        let mut row = vec![format!("{run}, {stage}, {name}")];
                        if t == 0 {
                            row.push(format!("{:.2} %", printed::TABLE_2[s][d][k]));
                        }
                        for bench in &experiment.benches {
                            let along = &bench.runs[k];
                            let modelled: &DriveColumns = match s {
                                0 => &along.calculated[t],
                                _ => &along.estimated[t],
                            };
                            let e = along.errors(d, modelled);
                            row.extend([e.mean_relative, e.median_relative, e.nrms].map(percent));
                        }
                        rows.push(row);
                    }
                }
            }
            // Three measures of error for each of the two rigs.
            let columns = ["rig: mean", "median", "nrms", "with rods: mean", "median", "nrms"];
            let mut head = vec!["run"];
            if t == 0 {
                head.push("*paper: mean");
            }
            head.extend(columns);
            self.table(&head, &rows);
        }
        self.improvement(experiment);
        // Errors over time on both rigs.
        let drives = experiment.paper.row_names();
        self.figure(
            &figures::errors(
                "Forces and errors, verification run, rig as in Table 1",
                &experiment.benches[0].runs[1],
                &drives,
            ),
            "All errors have one scale. Calculated: parameters of Table 1, left column; estimated: by least squares \
             from the identification run. The consistent treatment has no visible error.",
        );
        self.figure(
            &figures::errors(
                "Forces and errors, verification run, rig with spindle rods",
                &experiment.benches[1].runs[1],
                &drives,
            ),
            "The spindles add an error that the consistent treatment has as well. Identification lowers it but cannot \
             remove it, because no base parameter represents a rod.",
        );
    }

    /// The improvement of fe1 by identification, compared with the paper's.
    fn improvement(&mut self, experiment: &PaperExperiment) {
        let improvement = |runs: &[TreatmentRun; 2]| {
            let [before, after] = [&runs[1].calculated[0], &runs[1].estimated[0]].map(|m| runs[1].errors(0, m));
            let share = |after: f64, before: f64| percent(1.0 - after / before);
            [
                share(after.mean_relative, before.mean_relative),
                share(after.nrms, before.nrms),
            ]
        };
        let mut rows = Vec::new();
        let benches = experiment.benches.iter().map(|bench| &bench.runs);
        for (runs, name) in benches.zip(["rig", "rig with rods"]) {
            rows.push((name.to_owned(), improvement(runs)));
        }
        for contact in &experiment.causes.contacts {
            let name = format!("contact points {} mm beside the axes", millimetres(contact.offset));
            rows.push((name, improvement(&contact.study.runs)));
        }
        self.paragraph(&format!(
            "The paper states an improvement of {} % for fe1 by identification, along the test trajectory: 1 minus the \
             ratio of the mean relative errors after and before. Ours, in the paper's treatment:",
            printed::IMPROVEMENT
        ));
        let rows: Vec<Vec<String>> = rows
            .into_iter()
            .map(|(name, [mean, nrms])| vec![name, format!("{} %", printed::IMPROVEMENT), mean, nrms])
            .collect();
        self.table(&["rig", "*paper", "mean relative error", "nrms"], &rows);
    }

    /// Chapter 3: the error of the paper's treatment compared with the force of the misplaced mass.
    pub(crate) fn placement(&mut self, experiment: &PaperExperiment) {
        self.heading("3  The error of the paper's treatment is the force of the misplaced m4");
        // Two independent ways to the same curve.
        self.paragraph(
            "Subtract the forces of the two reduced models with the parameters of Table 1: the difference is the \
             force of m4 at R3m minus its force where the paper's balance of moments places it. This needs no rig. \
             The error of the paper's treatment needs the rig, which is independent of both models. Both are the same \
             curve:",
        );
        // Correlation and residual for each rig and run.
        let mut rows = Vec::new();
        for (bench, name) in experiment.benches.iter().zip(["rig", "rig with rods"]) {
            for (along, run) in bench.runs.iter().zip(["identification", "verification"]) {
                let explained = along.explained_error();
                rows.push(vec![
                    format!("{name}, {run}"),
                    format!("{:.6}", explained.correlation),
                    percent(explained.remains),
                    share(1.0 - explained.remains * explained.remains),
                    share(explained.variation),
                ]);
            }
        }
        self.table(
            &[
                "run",
                "correlation coefficient (Pearson)",
                "residual error (2-norm)",
                "explained (squares)",
                "explained variation about the mean",
            ],
            &rows,
        );
        // Error, explanation and residual over time.
        let drives = experiment.paper.row_names();
        for (bench, title) in experiment.benches.iter().zip([
            "Verification run, rig as in Table 1",
            "Verification run, rig with spindle rods",
        ]) {
            self.figure(
                &figures::decomposition(title, &bench.runs[1], &drives),
                "Calculated parameters. One scale for all panels.",
            );
        }
    }

    /// Chapter 5: the relative error where a force passes through zero.
    pub(crate) fn peaks(&mut self, experiment: &PaperExperiment) {
        self.heading("5  The peaks of the relative error");
        // The left spindle in the verification run, since its force often passes through zero.
        let along = &experiment.benches[0].runs[1];
        let drives = experiment.paper.row_names();
        let modelled = &along.calculated[0];
        // Samples near zero, and their contribution to the mean relative error.
        let [samples, part] = along.near_zero(0, modelled, NEAR_ZERO);
        let errors = along.errors(0, modelled);
        self.paragraph(&format!(
            "The paper remarks that peaks of the relative error arise where the force is close to zero. This is \
             confirmed: the force of the left spindle passes through zero {} times in this run. The error does not, \
             so their quotient is unbounded there. The {} of the samples with a force below {} of its root mean \
             square cause {} of the mean relative error. The median, {}, is not affected by peaks; the mean is {}. The mean \
             also depends on how near to these zeros samples happen to be: of every second sample alone it is {}.",
            along.zeros(0).len(),
            percent(samples),
            percent(NEAR_ZERO),
            percent(part),
            percent(errors.median_relative),
            percent(errors.mean_relative),
            percent(along.errors_of_every(2, 0, modelled).mean_relative),
        ));
        let name = drives.first().map_or("", String::as_str);
        self.figure(
            &figures::peaks("Left spindle, verification run, rig as in Table 1", along, 0, name),
            "Compare Fig. 6 e of the paper.",
        );
    }
}
