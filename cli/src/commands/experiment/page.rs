//! The page: words, tables and figures in the order in which they are told; one file without links to others.

use std::fmt::Write as _;

use super::study::{self, Along, Columns, UNKNOWN};
use super::{Experiment, figures, printed};
use crate::svg::escape;
use crate::table::significant;

/// Below this, an error is rounding; its digits differ from machine to machine and say nothing.
const ROUNDING: f64 = 1e-8;
/// Least and largest of the paper's errors with calculated parameters, Table 2.
const PAPER_ERRORS: [f64; 2] = [0.0782, 0.1020];
/// Forces below this share of their root mean square count as near zero.
const NEAR_ZERO: f64 = 0.1;

/// The page's text.
pub(super) fn render(experiment: &Experiment) -> String {
    let mut page = Page(String::new());
    page.0.push_str(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>The paper's experiment, reproduced and explained</title>\n<style>\n",
    );
    page.0.push_str(include_str!("page.css"));
    page.0.push_str("</style>\n</head>\n<body>\n<main>\n<h1>The paper's experiment, reproduced and explained</h1>\n");
    page.summary(experiment);
    page.setting(experiment);
    page.table_2(experiment);
    page.placement(experiment);
    page.peaks(experiment);
    page.base_parameters(experiment);
    page.table_1(experiment);
    page.differences(experiment);
    page.coefficients(experiment);
    page.0.push_str("</main>\n</body>\n</html>\n");
    page.0
}

struct Page(String);

impl Page {
    fn heading(&mut self, text: &str) {
        let _ = writeln!(self.0, "<h2>{}</h2>", escape(text));
    }

    fn say(&mut self, text: &str) {
        let _ = writeln!(self.0, "<p>{}</p>", escape(text));
    }

    fn figure(&mut self, svg: &str, caption: &str) {
        let _ = writeln!(
            self.0,
            "<figure>\n{svg}<figcaption>{}</figcaption>\n</figure>",
            escape(caption)
        );
    }

    /// Rows under a head; columns whose head begins with `*` are the paper's.
    fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        let class = |k: usize| match head.get(k) {
            Some(name) if name.starts_with('*') => " class=\"paper\"",
            _ => "",
        };
        self.0.push_str("<div class=\"wide\"><table>\n<thead><tr>");
        for (k, name) in head.iter().enumerate() {
            let _ = write!(
                self.0,
                "<th{}>{}</th>",
                class(k),
                escape(name.trim_start_matches('*'))
            );
        }
        self.0.push_str("</tr></thead>\n<tbody>\n");
        for row in rows {
            self.0.push_str("<tr>");
            for (k, cell) in row.iter().enumerate() {
                let _ = write!(self.0, "<td{}>{}</td>", class(k), escape(cell));
            }
            self.0.push_str("</tr>\n");
        }
        self.0.push_str("</tbody>\n</table></div>\n");
    }

    fn summary(&mut self, experiment: &Experiment) {
        let plain = &experiment.benches[0].runs;
        let rods = &experiment.benches[1].runs;
        let [calculated, consistent, estimated] = &experiment.base;
        self.0.push_str("<div class=\"short\">\n");
        self.say(&format!(
            "In short. The paper's reduced model misses the forces of its multibody model by 8 to 10 % before identification, \
             and the paper blames the places of the lumped masses in general. Here the whole robot, 11 groups with true parallel \
             cranks, is simulated by a program that shares no mechanics with the model. A reduced model that lets the platform's \
             mass m4 act at one place agrees with it to {} without any identification: nothing is lost by the reduction. The \
             paper's treatment, with the same masses, misses it by {} to {} (nrms), and {} of that error is the force of the one \
             mass that the balance of moments sees elsewhere than the balance of forces. The size is not the paper's, for it depends on \
             lengths and motions that the paper does not print (section 7); the cause is.",
            rounding(largest(plain, |along, d| along.errors(d, &along.calculated[1]).nrms)),
            percent(least(plain, |along, d| along.errors(d, &along.calculated[0]).nrms)),
            percent(largest(plain, |along, d| along.errors(d, &along.calculated[0]).nrms)),
            explained(plain),
        ));
        self.say(&format!(
            "The paper's own Table 1 says the same: p4,min = m4 (1 - dc3/d3), which is zero for a mass in one place, falls from \
             {} kg to {} kg by identification (with d3 = 1.03 m; whatever d3 is, by more than {}), and p3,min and p5,min arrive \
             within {} and {} of the consistent values.",
            significant(calculated[3], 3),
            significant(estimated[3], 3),
            percent(1.0 - printed::ESTIMATED[1].1 / nominal(experiment, "m4")),
            percent((estimated[2] / consistent[2] - 1.0).abs()),
            percent((estimated[4] / consistent[4] - 1.0).abs()),
        ));
        self.say(&format!(
            "With spindles that have mass (rods of 8 kg), {} of the error of the paper's treatment (2-norm, verification run) is \
             not m4, and that is the rods.",
            percent(rods[1].explained().remains)
        ));
        self.0.push_str("</div>\n");
    }

    fn setting(&mut self, experiment: &Experiment) {
        let [excitation, test] = &experiment.trajectories;
        self.heading("1  What was done");
        self.say(&format!(
            "Excitation, eq. (14), (15) and (17): {} harmonics and a period of {} s, as in the paper, within the limits of \
             spidermill.toml. The best of {} random trajectories has condition number {}, the one found {} (paper: {}). The test \
             run is another, random series of {} harmonics and {} s. Coefficients are rounded to four decimals and printed at the \
             end, so that the runs can be repeated without the search.",
            excitation.series.first().map_or(0, |s| s.mu.len()),
            excitation.period,
            excitation.random,
            significant(excitation.start, 4),
            significant(excitation.condition_number, 4),
            printed::CONDITION_NUMBER,
            test.series.first().map_or(0, |s| s.mu.len()),
            test.period,
        ));
        self.say(&format!(
            "Both are run at {} Hz on two rigs: spidermill-full.toml, whose 11 groups sum up to Table 1, and \
             spidermill-with-rods.toml, the same with a rod of 8 kg and 0.9 m in each spindle. The sensors are perfect, so \
             whatever separates rig and model is the model's doing. Two reduced models are held against them: \
             spidermill-paper.toml, which is eq. (5) and eq. (16) to the letter, and spidermill.toml, the consistent one.",
            experiment.rate
        ));
        self.say(
            "What the paper does: half of m4 goes to each coupler. The coupler's balance of forces sees it at the joint R3m. The \
             balance of moments about the elbow sees it at the coupler's centre of mass, as if it sat there. That is where the \
             products m4 dc3 and m4 dc3^2 of eq. (5) come from; a mass at one place gives four base parameters instead of five.",
        );
        let drives = experiment.paper.drives();
        let runs = &experiment.benches[0].runs;
        for (k, title) in ["Identification run", "Verification run"]
            .into_iter()
            .enumerate()
        {
            let svg = figures::motion(title, &experiment.trajectories[k], &runs[k], &drives);
            self.figure(
                &svg,
                "Compare Fig. 6 and 7 of the paper, a to d. Rig without rods.",
            );
        }
    }

    fn table_2(&mut self, experiment: &Experiment) {
        self.heading("2  Table 2, beside the paper's");
        self.say(
            "The paper's measure is the mean of |error| / |force|. It is dominated by the moments at which a force passes through \
             zero (section 4), so the median of the same quotient and the nrms (2-norm of the error by that of the force) stand \
             beside it.",
        );
        let names = ["fe1, left", "fe10, right"];
        for (t, title) in ["The paper's treatment", "The consistent treatment"]
            .into_iter()
            .enumerate()
        {
            self.say(&format!("{title}:"));
            let mut rows = Vec::new();
            for (k, run) in ["identification", "verification"].into_iter().enumerate() {
                for (s, stage) in ["calculated", "estimated"].into_iter().enumerate() {
                    for (d, name) in names.into_iter().enumerate() {
                        let mut row = vec![format!("{run}, {stage}, {name}")];
                        if t == 0 {
                            row.push(format!("{:.2} %", printed::TABLE_2[s][d][k]));
                        }
                        for bench in &experiment.benches {
                            let along = &bench.runs[k];
                            let modelled: &Columns = match s {
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
            let columns = [
                "rig: mean",
                "median",
                "nrms",
                "with rods: mean",
                "median",
                "nrms",
            ];
            let mut head = vec!["run"];
            if t == 0 {
                head.push("*paper: mean");
            }
            head.extend(columns);
            self.table(&head, &rows);
        }
        let drives = experiment.paper.drives();
        self.figure(
            &figures::errors(
                "Forces and errors, verification run, rig as in Table 1",
                &experiment.benches[0].runs[1],
                &drives,
            ),
            "All errors have one scale. Calculated: parameters of Table 1, left column; estimated: by least squares from the \
             identification run. The consistent treatment has no error that could be seen.",
        );
        self.figure(
            &figures::errors(
                "Forces and errors, verification run, rig with spindle rods",
                &experiment.benches[1].runs[1],
                &drives,
            ),
            "What the spindles add: an error that the consistent treatment has too, and that identification lowers but cannot \
             remove, for no base parameter is a rod.",
        );
    }

    fn placement(&mut self, experiment: &Experiment) {
        self.heading("3  The error of the paper's treatment is the force of the misplaced m4");
        self.say(
            "Take the forces of both reduced models with the parameters of Table 1 and subtract: what remains is what m4 makes at \
             R3m and does not make where the paper's balance of moments has it. This needs no rig. The error of the paper's \
             treatment needs the rig, which knows nothing of either model. Both are the same curve:",
        );
        let mut rows = Vec::new();
        for (bench, name) in experiment.benches.iter().zip(["rig", "rig with rods"]) {
            for (along, run) in bench.runs.iter().zip(["identification", "verification"]) {
                let explained = along.explained();
                rows.push(vec![
                    format!("{name}, {run}"),
                    format!("{:.6}", explained.correlation),
                    percent(explained.remains),
                    share(1.0 - explained.remains * explained.remains),
                ]);
            }
        }
        self.table(
            &[
                "run",
                "correlation",
                "left of the error (2-norm)",
                "explained (squares)",
            ],
            &rows,
        );
        let drives = experiment.paper.drives();
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

    fn peaks(&mut self, experiment: &Experiment) {
        self.heading("4  The peaks of the relative error");
        let along = &experiment.benches[0].runs[1];
        let drives = experiment.paper.drives();
        let modelled = &along.calculated[0];
        let [samples, part] = along.near_zero(0, modelled, NEAR_ZERO);
        let errors = along.errors(0, modelled);
        self.say(&format!(
            "The paper remarks that peaks of the relative error arise where the force is close to zero. So it is: the force of the \
             left spindle passes through zero {} times in this run, the error does not, and their quotient has no bound there. The \
             {} of the samples with a force below {} of its root mean square make {} of the mean relative error. Without peaks, \
             the typical error is the median, {}, against a mean of {}.",
            along.zeros(0).len(),
            percent(samples),
            percent(NEAR_ZERO),
            percent(part),
            percent(errors.median_relative),
            percent(errors.mean_relative),
        ));
        let name = drives.first().map_or("", String::as_str);
        self.figure(
            &figures::peaks(
                "Left spindle, verification run, rig as in Table 1",
                along,
                0,
                name,
            ),
            "Compare Fig. 6 e of the paper.",
        );
    }

    fn base_parameters(&mut self, experiment: &Experiment) {
        self.heading("5  Base parameters: identification takes the mass back");
        let [calculated, consistent, estimated] = &experiment.base;
        self.say(
            "The consistent treatment is a special case of eq. (16): the five values in column two make exactly its forces, with \
             p4,min = 0. Identification under the paper's treatment finds them on the rig. The paper's own estimate, computed from \
             the right column of its Table 1 with the lengths assumed here, goes the same way with all five. It overshoots in \
             p1,min and p2,min, as ours does when the spindles are rods, which add to the inertia of the cranks; whether the paper's \
             multibody model has such spindles it does not say.",
        );
        let ours = [0, 1].map(|k| experiment.benches[k].fits[0].values());
        let units: Vec<&str> = experiment
            .paper
            .base
            .iter()
            .map(|b| b.unit.as_str())
            .collect();
        let value = |x: f64| {
            if x.abs() < 1e-6 {
                "0.000".to_owned()
            } else {
                format!("{x:.3}")
            }
        };
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
        let runs = &experiment.benches[0].runs;
        let changes =
            [0, 1].map(|k| study::explained(&runs[k].printed_change(), &runs[k].placement()));
        self.figure(
            &figures::on_the_way(experiment),
            "0 is what the paper calculates from Table 1, 1 what the same masses give in one place. Values beyond 3 or below -0.1 \
             stand at the edge.",
        );
        self.say(&format!(
            "In forces: the difference that the paper's identification makes, its estimated against its calculated parameters put \
             into eq. (16) along our runs, is for {} (identification run) and {} (verification run) the force of the misplaced m4, \
             nothing fitted (squares; correlation {:.2} and {:.2}). No rig of ours takes part in this. The rest is that the paper's values do not \
             stop at the consistent ones.",
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
            "Estimated less calculated parameters of the paper's Table 1, in its own treatment.",
        );
    }

    fn table_1(&mut self, experiment: &Experiment) {
        self.heading("6  Table 1, beside the paper's");
        self.say(
            "As in the paper, m1, m3 and dc1 are known and the others are solved from the five estimated base parameters; all real \
             solutions are given.",
        );
        let parameters = &experiment.paper.derivation.mechanism.parameters;
        let mut head = vec![
            String::new(),
            "nominal".to_owned(),
            "*paper's estimate".to_owned(),
        ];
        let names = ["rig", "with rods"];
        let mut columns: Vec<&[f64]> = Vec::new();
        for (bench, name) in experiment.benches.iter().zip(names) {
            for (k, one) in bench.physical.iter().enumerate() {
                head.push(format!("{name}, solution {}", k + 1));
                columns.push(&one.values);
            }
        }
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
        for (bench, name) in experiment.benches.iter().zip(names) {
            if bench.physical.is_empty() {
                let p4 = bench.fits[0].values()[3];
                self.say(&format!(
                    "{name}: no real values of these five give the estimated base parameters. p4,min comes out as {p4:.2} kg; a \
                     reduced model that lacks the rods puts what they do where it can.",
                ));
            }
        }
        self.say(
            "With p4,min = 0 the printed treatment allows m4 = 0 or dc3 = d3 only: the two solutions for the rig. Neither is the \
             robot, whose m4 is 12.456 kg and dc3 0.515 m, and negative values show it. The equations are solved rightly; it is the \
             treatment that has no place for the true masses. That fits the paper's remark that its \
             estimates are not the real physical parameters (its dc3 moves from 0.515 m to 0.833 m, towards d3).",
        );
    }

    fn differences(&mut self, experiment: &Experiment) {
        self.heading("7  Where our numbers differ from the paper's, and why");
        let plain = &experiment.benches[0].runs;
        self.say(&format!(
            "The paper prints masses but no lengths, limits or coefficients. The lengths of spidermill.toml (d1, d3, b, dA, Bx, By) \
             and both trajectories are assumptions, and they decide how large the errors are in per cent: before identification \
             ours are {} to {} (nrms), and the mean relative error is {} to {}, far above the paper's 8 to 10 %: with these \
             lengths the misplaced m4 is a larger part of the spindle forces, and these pass through zero often. So the size of the paper's errors is not reproduced here; \
             what is reproduced is their cause.",
            percent(least(plain, |a, d| a.errors(d, &a.calculated[0]).nrms)),
            percent(largest(plain, |a, d| a.errors(d, &a.calculated[0]).nrms)),
            percent(least(plain, |a, d| a.errors(d, &a.calculated[0]).mean_relative)),
            percent(largest(plain, |a, d| a.errors(d, &a.calculated[0]).mean_relative)),
        ));
        self.say(
            "How much one unprinted length changes: the same test motion with other distances b of the base joints (all else \
             as it is), held against the consistent treatment, which stands for the rig. The error is the same force of the \
             misplaced m4 at every b; what changes is how large it is beside the others.",
        );
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
            "The paper's band is a mean relative error, ours the nrms, which has no peaks. At every instant the spindle \
             mounts (dA, Bx, By) scale error and force alike.",
        );
        if !reached.is_empty() {
            self.say(&format!(
                "At b = {} the nrms of both spindles is within the paper's band (the mean relative error still is not: {}). Which \
                 b the real robot has we do not know.",
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
        self.say(
            "The paper's errors after identification, 3.3 to 3.6 %, have no counterpart on the rig without rods, where nothing is \
             left: they must come from something that its multibody model has beyond a planar rigid M structure, perhaps spindles \
             with mass and their offset at the cranks. The rig with rods shows that kind of remainder; its size depends on the rods, whose mass is made \
             up.",
        );
    }

    fn coefficients(&mut self, experiment: &Experiment) {
        self.say("Coefficients of the trajectories, eq. (15), rad and rad/s:");
        let names = experiment.paper.active();
        for (periodic, run) in experiment
            .trajectories
            .iter()
            .zip(["Identification", "Verification"])
        {
            let means: Vec<String> = periodic
                .series
                .iter()
                .zip(&names)
                .map(|(series, name)| format!("mean of {name} {:.4}", series.offset))
                .collect();
            self.say(&format!(
                "{run}, period {} s, {}:",
                periodic.period,
                means.join(", ")
            ));
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

/// A parameter's value in the left column of Table 1.
fn nominal(experiment: &Experiment, name: &str) -> f64 {
    let parameters = &experiment.paper.derivation.mechanism.parameters;
    let found = parameters.iter().find(|p| p.name == name);
    found.map_or(f64::NAN, |p| p.nominal)
}

/// The largest of a figure over runs and drives.
fn largest(runs: &[Along], of: impl Fn(&Along, usize) -> f64) -> f64 {
    over(runs, of).fold(f64::NEG_INFINITY, f64::max)
}

/// The least.
fn least(runs: &[Along], of: impl Fn(&Along, usize) -> f64) -> f64 {
    over(runs, of).fold(f64::INFINITY, f64::min)
}

fn over<'a>(
    runs: &'a [Along],
    of: impl Fn(&Along, usize) -> f64 + 'a,
) -> impl Iterator<Item = f64> + 'a {
    let pairs = runs
        .iter()
        .flat_map(|along| (0..along.measured.len()).map(move |d| (along, d)));
    pairs.map(move |(along, d)| of(along, d))
}

/// How much of the error the placement explains, in squares, at least over all runs.
fn explained(runs: &[Along]) -> String {
    let most = runs
        .iter()
        .map(|along| along.explained().remains)
        .fold(0.0, f64::max);
    share(1.0 - most * most)
}

/// A share near one.
fn share(value: f64) -> String {
    if 1.0 - value < 1e-6 {
        return "more than 99.9999 %".to_owned();
    }
    format!("{:.2} %", 100.0 * value)
}

/// An error that is nothing but rounding, or its size.
fn rounding(value: f64) -> String {
    if value < ROUNDING {
        "better than a part in 10^8".to_owned()
    } else {
        percent(value)
    }
}

fn percent(value: f64) -> String {
    if value < ROUNDING {
        return "0.0000 %".to_owned();
    }
    format!("{} %", significant(100.0 * value, 3))
}

/// Four decimals, without the sign of a rounded zero.
fn decimals(value: f64) -> String {
    let rounded = (1e4 * value).round() / 1e4;
    format!("{:.4}", if rounded == 0.0 { 0.0 } else { rounded })
}
