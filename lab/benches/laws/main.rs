//! Laws: recordings of machines with laws that the library lacks, drawn from a seed, with white or coloured noise.
//! Prints how often `diagnose` proposes the law with its place, first or in a near-tie.
//!
//! `cargo bench -p modelmill-lab --bench laws -- [--seed 1] [--seeds 1] [--only TEXT] [--keep DIR] [--program PATH]`.
//! Figures go to standard output, progress to standard error. A proposal is right if it has the place and the variables
//! of the law. Added to a library as printed, it must also explain nine tenths of the law's squares along another
//! motion without noise.

mod judge;
mod planted;
mod scene;

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

use judge::{Marked, Wanted, judge};
use modelmill_lab::coloured::{SpectrumFall, noise};
use modelmill_lab::course::{CourseRepeats, DrawnCourse};
use modelmill_lab::harness::{
    BenchmarkOptions, BenchmarkUsage, TestedProgram, WORKERS, folder_of_case, run_benchmark, work_off, write,
};
use modelmill_lab::random::{CaseRandom, three_digits};
use modelmill_lab::record::{ENCODER_NOISE, encoder_step};
use modelmill_lab::span::{ColumnSpan, rms};
use planted::{Law, Planted};
use scene::{Machine, Scene};

/// Samples per second of the recordings, Hz.
const RATE: f64 = 250.0;
/// Samples per second of the motions on which sizes are computed, Hz.
const COARSE: f64 = 50.0;
/// Range of the error of a model without the law, relative to the force.
const ERRORS: [f64; 2] = [0.05, 0.25];
/// Least residual of the law relative to the noise, when base parameters and library are fitted.
const LEAST_OUTSIDE: f64 = 2.5;
/// Range of the noise of a force relative to its rms.
const NOISE: [f64; 2] = [0.002, 0.006];
/// Range of the corner frequency of coloured noise, Hz.
const CORNERS: [f64; 2] = [20.0, 60.0];
/// Draws of place and shape before a case is skipped.
const ATTEMPTS: u64 = 60;

/// The machine of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum On {
    SpiderMill,
    Arm,
}

/// Places of which one is drawn, each with the other place on which the law depends, if any.
type Places = &'static [(&'static str, &'static str)];

/// Laws with their machines and places.
const PLANTED: [(Law, On, Places); 22] = {
    use Law as L;
    use On::{Arm, SpiderMill};
    const CROSSED: &[(&str, &str)] = &[("spindle_right", "theta1"), ("spindle_left", "theta2")];
    const DRIVES: &[(&str, &str)] = &[("spindle_left", "spindle_right"), ("spindle_right", "spindle_left")];
    const PASSIVE: &[(&str, &str)] = &[("gamma1", ""), ("gamma2", "")];
    const SINGLE: &[(&str, &str)] = &[("spindle_left", ""), ("spindle_right", "")];
    const JOINTS: &[(&str, &str)] = &[("joint1", ""), ("joint2", ""), ("joint3", "")];
    const PAIRS: &[(&str, &str)] = &[("joint2", "joint3"), ("joint3", "joint2"), ("joint1", "joint2")];
    [
        (L::Coupling, SpiderMill, CROSSED),
        (L::ProductOfRates, SpiderMill, DRIVES),
        (L::RubsWithOther, SpiderMill, DRIVES),
        (L::DragByPlace, SpiderMill, PASSIVE),
        (L::PreloadByPlace, SpiderMill, SINGLE),
        (L::Stop, SpiderMill, SINGLE),
        (L::CubicSpring, SpiderMill, PASSIVE),
        (L::Magnet, SpiderMill, SINGLE),
        (L::Hertz, SpiderMill, SINGLE),
        (L::OilUnderLoad, SpiderMill, SINGLE),
        (L::Fan, SpiderMill, SINGLE),
        (L::Hysteresis, SpiderMill, PASSIVE),
        (L::Film, SpiderMill, PASSIVE),
        (L::Coupling, Arm, PAIRS),
        (L::Hose, Arm, PAIRS),
        (L::Bumper, Arm, JOINTS),
        (L::CubicSpring, Arm, JOINTS),
        (L::Saturation, Arm, JOINTS),
        (L::Valve, Arm, JOINTS),
        (L::Thickening, Arm, JOINTS),
        (L::WoundUp, Arm, JOINTS),
        (L::DragByPlace, Arm, JOINTS),
    ]
};

/// A case: seed and index into [`PLANTED`].
struct Case {
    seed: u64,
    number: usize,
}

/// Result of a case.
struct Done {
    truth: String,
    how: String,
    marked: Result<Marked, String>,
    is_shown: bool,
}

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "cargo bench -p modelmill-lab --bench laws -- [--seed 1] [--seeds 1] [--only TEXT] [--keep DIR] [--program PATH]",
    values: &[("seed", "1"), ("seeds", "1"), ("only", ""), ("keep", "")],
    switches: &[],
    takes_folder: false,
};

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let [first, seeds] = [options.number::<u64>("seed")?, options.number("seeds")?];
    let spidermill = Machine::spidermill()?;
    let arm = Machine::arm(ARM)?;
    let machine = |on: On| match on {
        On::SpiderMill => &spidermill,
        On::Arm => &arm,
    };
    let wanted = |number: &usize| {
        let (law, on, _) = PLANTED[*number];
        format!("{} {on:?}", law.name()).contains(options.text("only"))
    };
    let mut cases = Vec::new();
    for seed in first..first + seeds {
        let all = (0..PLANTED.len()).filter(wanted);
        cases.extend(all.map(|number| Case { seed, number }));
    }
    let program = options.program()?;
    let done = work_off(&cases, WORKERS, |case, folder| {
        let name = format!("{}-{}", case.seed, case.number + 1);
        let folder = folder_of_case(options.path("keep"), &name, folder)?;
        one(case, machine(PLANTED[case.number].1), &program, &folder)
    })?;
    print!("{}", report(&cases, &done));
    Ok(())
}

/// Model file of the serial arm.
const ARM: &str = "puma560.toml";

fn report(cases: &[Case], done: &[Done]) -> String {
    let mut text = String::new();
    let (mut shown, mut unexplained, mut first, mut right, mut ties, mut proposals) = (0, 0, 0, 0, 0, 0);
    for (case, done) in cases.iter().zip(done) {
        let _ = writeln!(
            text,
            "{:>3}-{:<2} {} | {}",
            case.seed,
            case.number + 1,
            done.truth,
            done.how
        );
        if !done.is_shown {
            text.push_str("       skipped: the library represents the law\n");
            continue;
        }
        shown += 1;
        match &done.marked {
            Err(why) => {
                let _ = writeln!(text, "       failed: {why}");
            }
            Ok(marked) => {
                unexplained += usize::from(marked.verdict == "unexplained");
                first += usize::from(marked.rank == Some(0));
                right += usize::from(marked.rank.is_some());
                proposals += usize::from(!marked.says.is_empty());
                ties += marked.ties;
                let rank = match marked.rank {
                    Some(0) => "first".to_owned(),
                    Some(k) => format!("near-tie {k} of {}", marked.ties),
                    None => "WRONG".to_owned(),
                };
                let _ = writeln!(
                    text,
                    "       {rank}: {}, {} near-ties: {}",
                    marked.verdict, marked.ties, marked.says
                );
            }
        }
    }
    let mean = ties as f64 / proposals.max(1) as f64;
    let _ = writeln!(
        text,
        "\n{right} of {shown} laws proposed first or in a near-tie with their place, {first} of them first; {mean:.1} near-ties each; \
         {unexplained} of {shown} unexplained; target 10 of 13"
    );
    text
}

/// Draws a case, records it, runs the diagnosis and marks the answer.
fn one(case: &Case, machine: &Machine, program: &TestedProgram, folder: &Path) -> Result<Done, String> {
    let (law, _, places) = PLANTED[case.number];
    let stream = |purpose: u64| CaseRandom::new(case.seed, 7000 + case.number as u64, purpose);
    let mut random = stream(0);
    let repeats = match random.below(3) {
        0 => CourseRepeats::Once,
        1 => CourseRepeats::Twice,
        _ => CourseRepeats::Never,
    };
    let full = random.chance(0.3);
    let limits = machine.limits();
    let courses = [(); 3].map(|()| DrawnCourse::draw(&mut random, &limits, repeats));
    let corner = random.chance(0.5).then(|| {
        (
            three_digits(random.log_between(CORNERS[0], CORNERS[1])),
            SpectrumFall::Gentle,
        )
    });
    let share = three_digits(random.log_between(NOISE[0], NOISE[1]));
    let coarse = machine.along(&courses[0], COARSE)?;
    let deviations: Vec<f64> = coarse.plain.iter().map(|f| share * rms(f)).collect();
    let spans = spans(&coarse, &deviations);
    let mut planted = None;
    for attempt in 0..ATTEMPTS {
        let mut random = stream(100 + attempt);
        let (at, other) = places[random.below(places.len())];
        let other = (!other.is_empty()).then_some(other);
        let unit = Planted::draw(law, at, other, &mut random);
        // If the library represents most of the law, its size may be larger.
        let error = random.log_between(ERRORS[0], ERRORS[1]) * (1.0 + attempt as f64 / 40.0);
        if let Some(sized) = sized(&unit, &coarse, &deviations, &spans, error, random.sign())? {
            planted = Some(sized);
            break;
        }
    }
    let colour = corner.map_or_else(|| "white".to_owned(), |(hz, _)| format!("{hz} Hz"));
    let how = format!(
        "{}, {}, noise {:.2} % {colour}",
        repeats.word(),
        if full { "full states" } else { "positions only" },
        100.0 * share
    );
    let Some((planted, error)) = planted else {
        return Ok(Done {
            truth: law.name().to_owned(),
            how,
            marked: Err(String::new()),
            is_shown: false,
        });
    };
    let truth = format!("{planted}, error {:.1} %", 100.0 * error);
    let files = ["fit.csv", "check.csv", "probe.csv"].map(|file| folder.join(file));
    let reference = &coarse;
    for (which, file) in files.iter().enumerate() {
        let scene = machine.along(&courses[which], RATE)?;
        let noises: Vec<Vec<f64>> = (deviations.iter().enumerate())
            .map(|(d, deviation)| {
                let size = if which == 2 { 0.0 } else { *deviation };
                let mut random = stream(10 + 20 * which as u64 + d as u64);
                noise(&mut random, scene.times.len(), RATE, size, corner)
            })
            .collect();
        let mut random = stream(500 + which as u64);
        let csv = recorded(
            machine,
            &scene,
            &planted,
            reference,
            &noises,
            &mut random,
            full || which == 2,
        )?;
        write(file, &csv)?;
    }
    let words = planted.words(&coarse)?;
    let (answer, _) = program.diagnose_for_json(machine.file(), &files[..1], &files[1..2]);
    let answer = answer.map_err(|fault| fault.whole_complaint());
    let marked = answer.and_then(|answer| {
        let wanted = Wanted {
            at: &planted.at,
            words: &words,
            remembers: planted.law.remembers(),
        };
        judge(program, machine.file(), folder, &files[2], &answer, &wanted)
    });
    Ok(Done {
        truth,
        how,
        marked,
        is_shown: true,
    })
}

/// Columns of all drives divided by their noise, so that all drives have the same weight.
fn scaled(scene: &Scene, deviations: &[f64], columns: &[f64]) -> Vec<f64> {
    let n = scene.times.len();
    let each = columns.iter().enumerate();
    each.map(|(i, x)| x / deviations[i / n]).collect()
}

/// The spans of the base parameters, and of base parameters and library together.
fn spans(scene: &Scene, deviations: &[f64]) -> [ColumnSpan; 2] {
    let of = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let each = columns.iter().map(|one| scaled(scene, deviations, one));
        each.collect()
    };
    let base = ColumnSpan::from_columns(of(&scene.base));
    let mut all = base.clone();
    all.extend(of(&scene.library));
    [base, all]
}

/// A law with a visible size, and the error of a model without it; `None` if base parameters or library represent it.
fn sized(
    unit: &Planted,
    scene: &Scene,
    deviations: &[f64],
    [base, all]: &[ColumnSpan; 2],
    error: f64,
    sign: f64,
) -> Result<Option<(Planted, f64)>, String> {
    let has_any_sign = [Law::Coupling, Law::ProductOfRates, Law::Hose].contains(&unit.law);
    let sign = if has_any_sign { sign } else { 1.0 };
    let added = unit.added(scene, scene)?;
    let felt: Vec<usize> = (0..added.len()).filter(|d| rms(&added[*d]) > 0.0).collect();
    let on_felt = |columns: &[f64]| -> f64 {
        let n = scene.times.len();
        let parts = felt.iter().flat_map(|d| columns[d * n..(d + 1) * n].to_vec());
        rms(&parts.collect::<Vec<f64>>())
    };
    let of_law = scaled(scene, deviations, &added.concat());
    let force = on_felt(&scaled(scene, deviations, &scene.plain.concat()));
    let shown = on_felt(&base.rest(&of_law));
    if shown.is_nan() || shown <= 0.0 {
        return Ok(None);
    }
    let left = on_felt(&all.rest(&of_law));
    let factor = error * force / shown;
    if factor * left < LEAST_OUTSIDE {
        return Ok(None);
    }
    let planted = Planted {
        size: three_digits(sign * factor),
        ..unit.clone()
    };
    Ok(Some((planted, error)))
}

/// A recording as CSV text; without noise, the positions are exact as well.
fn recorded(
    machine: &Machine,
    scene: &Scene,
    planted: &Planted,
    reference: &Scene,
    noises: &[Vec<f64>],
    random: &mut CaseRandom,
    full: bool,
) -> Result<String, String> {
    let added = planted.added(scene, reference)?;
    let exact = noises.iter().flatten().all(|e| *e == 0.0);
    let mut names = vec!["t".to_owned()];
    let mut columns = vec![scene.times.clone()];
    for (k, (name, values)) in scene.states.iter().enumerate() {
        if k % 3 == 0 && !exact {
            let mut read = |q: &f64| encoder_step(q + ENCODER_NOISE * random.normal());
            columns.push(values.iter().map(&mut read).collect());
        } else if k % 3 == 0 || full {
            columns.push(values.clone());
        } else {
            continue;
        }
        names.push(name.clone());
    }
    for (d, drive) in machine.drives().into_iter().enumerate() {
        let sum = |i: usize| scene.plain[d][i] + added[d][i] + noises[d][i];
        columns.push((0..scene.times.len()).map(sum).collect());
        names.push(drive);
    }
    let mut csv = names.join(",") + "\n";
    for i in 0..scene.times.len() {
        let row: Vec<String> = columns.iter().map(|c| format!("{:.9}", c[i])).collect();
        csv += &row.join(",");
        csv.push('\n');
    }
    Ok(csv)
}
