//! Sensitivity: the size at which half of the effects of a kind are found, compared with an oracle that knows their
//! shape.
//!
//! `cargo bench -p modelmill-lab --bench sensitivity -- [--seeds 6] [--calm 200] [--figure FILE.svg] [--only KIND]
//! [--program PATH]`.
//!
//! The size of an effect is d': the 2-norm of its residual in both recordings when the base parameters are fitted, in
//! units of the white noise. If the kind contains a simpler one, that one is fitted as well. The oracle is a matched
//! filter (W. Peterson, T. Birdsall, W. Fox 1954) at the false-alarm rate of `diagnose` on `--calm` recordings without
//! effects. It finds half of the effects whose d' is the two-sided quantile of that rate.
//!
//! For each seed, motion and noise, bisection finds the size from which `diagnose` names the effect, as a claim or as
//! an alias. Half of the effects are found at the median over the seeds.

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

use modelmill_lab::answer::ProgramAnswer;
use modelmill_lab::case::RATE;
use modelmill_lab::columns::columns;
use modelmill_lab::course::{CourseRepeats, DrawnCourse};
use modelmill_lab::harness::{
    BenchmarkOptions, BenchmarkUsage, TestedProgram, WORKERS, run_benchmark, work_off, write,
};
use modelmill_lab::hidden::{HiddenChoice, HiddenEffect, choices};
use modelmill_lab::placed::{PlacedEffect, atoms};
use modelmill_lab::plant::{DRIVES, PlantMotion, SpidermillPlant};
use modelmill_lab::random::CaseRandom;
use modelmill_lab::record::{FILES, RecordedSamples};
use modelmill_lab::span::{ColumnSpan, norm};

/// Standard deviation of the noise, N.
const NOISE: f64 = 1.0;
/// Range of the search, d'.
const SIZES: [f64; 2] = [1.5, 60.0];
/// Number of bisections of the range.
const HALVINGS: usize = 6;
/// Largest ratio to the oracle's size that counts as good.
const TWICE: f64 = 2.0;
/// Half the distance of the central difference for a delay, s.
const SHORT: f64 = 1e-4;

/// A kind with one motion and one noise; without a kind, nothing is hidden.
struct Case {
    kind: Option<HiddenChoice>,
    seed: u64,
}

/// Result of a case.
struct Done {
    /// Least d' at which the effect is named, infinite if it never is. Without an effect, 1 for a false alarm, else 0.
    size: f64,
    /// The effect with its values at that size.
    value: String,
}

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "cargo bench -p modelmill-lab --bench sensitivity -- [--seeds 6] [--calm 200] [--figure FILE.svg] [--only KIND] \
           [--program PATH]",
    values: &[("seeds", "6"), ("calm", "200"), ("figure", ""), ("only", "")],
    switches: &[],
    takes_folder: false,
};

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let [seeds, calm]: [u64; 2] = [options.number("seeds")?, options.number("calm")?];
    let plant = SpidermillPlant::load()?;
    // The first place of each kind.
    let mut kinds: Vec<HiddenChoice> = Vec::new();
    for choice in choices() {
        if choice.kind.contains(options.text("only")) && kinds.iter().all(|k| k.kind != choice.kind) {
            kinds.push(choice);
        }
    }
    let mut cases: Vec<Case> = (1..=calm).map(|seed| Case { kind: None, seed }).collect();
    for kind in &kinds {
        cases.extend((1..=seeds).map(|seed| Case {
            kind: Some(kind.clone()),
            seed,
        }));
    }
    let program = options.program()?;
    let done = work_off(&cases, WORKERS, |case, folder| case.measure(&plant, folder, &program))?;
    let quiet = cases.iter().zip(&done).filter(|(case, _)| case.kind.is_none());
    let alarms = quiet.filter(|(_, done)| done.size > 0.0).count();
    // Half an alarm is added, so that the estimated rate is positive even without alarms.
    let rate = (alarms as f64 + 0.5) / (calm as f64 + 1.0);
    let oracle = quantile(1.0 - 0.5 * rate);
    println!(
        "{alarms} alarms on {calm} recordings without effects, a rate of {:.2} %. \
         At this rate an oracle finds half of the effects with d' = {oracle:.2}.\n\n{:<32}{:>8}{:>18}{:>10}  about",
        100.0 * rate,
        "kind",
        "d'",
        "25 - 75 %",
        "x oracle"
    );
    let mut rows = Vec::new();
    for kind in &kinds {
        let of = cases.iter().zip(&done);
        let of = of.filter(|(case, _)| case.kind.as_ref() == Some(kind));
        let mut found: Vec<&Done> = of.map(|(_, done)| done).collect();
        found.sort_by(|a, b| a.size.total_cmp(&b.size));
        let at = |share: f64| {
            let place = share * (found.len() - 1) as f64;
            let (low, high) = (place.floor(), place.ceil());
            let of = |place: f64| found.iter().zip(0..).find(|(_, k)| f64::from(*k) >= place);
            [of(low), of(high)].map(|one| one.map_or(f64::INFINITY, |(done, _)| done.size))
        };
        // Geometric mean of two neighbours; an infinite size stays infinite.
        let sizes = [0.25, 0.5, 0.75].map(|share| {
            let [low, high] = at(share);
            (low * high).sqrt()
        });
        let value = &found[found.len() / 2].value;
        println!(
            "{:<32}{:>8.1}{:>18}{:>10.2}  {}",
            kind.kind,
            sizes[1],
            format!("{:.1} - {:.1}", sizes[0], sizes[2]),
            sizes[1] / oracle,
            value
        );
        rows.push((kind.kind, sizes));
    }
    let good = rows.iter().filter(|(_, sizes)| sizes[1] <= TWICE * oracle).count();
    println!(
        "\n{good} of {} kinds within {TWICE} times the size of the oracle; target 12 of 15",
        rows.len()
    );
    match options.path("figure") {
        None => Ok(()),
        Some(path) => write(path, &figure(&rows, oracle)),
    }
}

impl Case {
    fn measure(&self, plant: &SpidermillPlant, folder: &Path, program: &TestedProgram) -> Result<Done, String> {
        let name = self.kind.as_ref().map_or("nothing", |kind| kind.kind);
        let number = name
            .bytes()
            .fold(0, |n: u64, b| n.wrapping_mul(131).wrapping_add(b.into()));
        let mut random = CaseRandom::new(self.seed, number, 0);
        let courses = [(); 2].map(|()| DrawnCourse::draw(&mut random, plant.limits(), CourseRepeats::Once));
        let mut alongs = Vec::new();
        for course in &courses {
            alongs.push(PlantMotion::new(&plant.rig, course, course.times(RATE))?);
        }
        let hidden = self.kind.as_ref().map_or_else(Vec::new, |kind| kind.draw(&mut random));
        let mut added = Vec::new();
        for (along, course) in alongs.iter().zip(&courses) {
            added.push(added_by(&hidden, along, course)?);
        }
        let unit = shown(plant, &alongs, &hidden, &added.concat())?;
        let noises: Vec<Vec<Vec<f64>>> = (0..2)
            .map(|which| {
                let of = |k: u64| {
                    let mut random = CaseRandom::new(self.seed, number, 100 + 10 * which + k);
                    let normal = (0..alongs[0].times.len()).map(|_| NOISE * random.normal());
                    normal.collect()
                };
                (0..DRIVES.len() as u64).map(of).collect()
            })
            .collect();
        let ask = |factor: f64| -> Result<ProgramAnswer, String> {
            let files = FILES.map(|file| folder.join(file));
            for which in 0..2 {
                let forces = alongs[which].plain.iter().zip(&added[which]);
                let forces: Vec<f64> = forces.map(|(f, a)| f + factor * a).collect();
                let encoder = |k: usize| CaseRandom::new(self.seed, number, 200 + 10 * which as u64 + k as u64);
                let samples = RecordedSamples::new(&alongs[which], &forces, noises[which].clone(), encoder, false);
                write(&files[which], &samples.recorded().csv)?;
            }
            program.diagnose(&plant.model, &files).0
        };
        if hidden.is_empty() {
            let named = !ask(0.0)?.effects.is_empty();
            return Ok(Done {
                size: f64::from(u8::from(named)),
                value: String::new(),
            });
        }
        let truth = atoms(hidden.iter().map(|one| &one.placed));
        let is_found = |size: f64| -> Result<bool, String> {
            let answer = ask(size / unit)?;
            let claims = answer.effects.iter();
            // Aliases count like claims, because they are alternatives to them.
            let named = claims
                .flat_map(|c| c.aliases.iter().chain([&c.effect]))
                .flat_map(|one| atoms([one]))
                .collect();
            Ok(truth.is_subset(&named))
        };
        let [mut low, mut high] = SIZES;
        if !is_found(high)? {
            let claims = ask(high / unit)?.effects;
            let claims: Vec<String> = claims.iter().map(|c| c.effect.to_string()).collect();
            return Ok(Done {
                size: f64::INFINITY,
                value: format!("never named at the largest size; claimed: {}", claims.join(", ")),
            });
        }
        for _ in 0..HALVINGS {
            let middle = (low * high).sqrt();
            if is_found(middle)? {
                high = middle;
            } else {
                low = middle;
            }
        }
        let size = (low * high).sqrt();
        let sized: Vec<String> = hidden.iter().map(|one| one.times(size / unit).to_string()).collect();
        Ok(Done {
            size,
            value: sized.join(", "),
        })
    }
}

/// The size d' of effects: the 2-norm of their residual when the base parameters and simpler kinds are fitted to both
/// recordings, in standard deviations of the noise.
fn shown(
    plant: &SpidermillPlant,
    alongs: &[PlantMotion],
    hidden: &[HiddenEffect],
    total: &[f64],
) -> Result<f64, String> {
    let mut base = alongs[0].base(&plant.derivation)?;
    extend(&mut base, alongs[1].base(&plant.derivation)?);
    let span = ColumnSpan::from_columns(base);
    let mut least = norm(&span.rest(total)) / NOISE;
    for lesser in lesser(hidden) {
        let of = |along: &PlantMotion| columns(along, &lesser, constant(hidden), &[]);
        if let (Some(mut both), Some(more)) = (of(&alongs[0]), of(&alongs[1])) {
            extend(&mut both, more);
            let mut span = span.clone();
            span.extend(both);
            least = least.min(norm(&span.rest(total)) / NOISE);
        }
    }
    Ok(least)
}

/// Appends the columns of one recording to those of another.
fn extend(columns: &mut [Vec<f64>], more: Vec<Vec<f64>>) {
    for (column, more) in columns.iter_mut().zip(more) {
        column.extend(more);
    }
}

/// Simpler kinds that the hidden effect contains, one by one; the effect must be visible relative to each.
fn lesser(hidden: &[HiddenEffect]) -> Vec<PlacedEffect> {
    let Some(first) = hidden.first() else {
        return Vec::new();
    };
    let kinds: &[&str] = match first.placed.kind.as_str() {
        "directional_viscous_friction" => &["viscous_friction"],
        "directional_coulomb_friction" => &["coulomb_friction", "force_offset"],
        "spring" => &["force_offset"],
        _ if hidden.len() > 1 => &["coulomb_friction", "stribeck_friction"],
        _ => &[],
    };
    let of = |kind: &&str| PlacedEffect {
        kind: (*kind).to_owned(),
        at: first.placed.at.clone(),
    };
    kinds.iter().map(of).collect()
}

/// The shape parameter of the hidden effects; 1 if they have none.
fn constant(hidden: &[HiddenEffect]) -> f64 {
    hidden.iter().find_map(HiddenEffect::constant).unwrap_or(1.0)
}

/// Forces that effects of unit size add, N; for a delay, the derivative with respect to the delay, N/s.
fn added_by(hidden: &[HiddenEffect], along: &PlantMotion, course: &DrawnCourse) -> Result<Vec<f64>, String> {
    if hidden.iter().any(|one| one.delay() > 0.0) {
        let at = |by: f64| {
            let times = along.times.iter().map(|t| t - by).collect();
            Ok::<_, String>(PlantMotion::new(along.rig(), course, times)?.plain)
        };
        let (later, earlier) = (at(SHORT)?, at(-SHORT)?);
        return Ok(later
            .iter()
            .zip(&earlier)
            .map(|(a, b)| (a - b) / (2.0 * SHORT))
            .collect());
    }
    let effects: Result<Vec<_>, String> = hidden.iter().map(|one| one.effect(along.rig())).collect();
    along.added(&effects?)
}

/// The quantile of the normal distribution for a probability of at least one half, by bisection.
fn quantile(probability: f64) -> f64 {
    let below = |x: f64| 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2);
    let (mut low, mut high) = (0.0, 10.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// An SVG with one row per kind: median and quartiles of d', with lines for the oracle's size and twice this size.
fn figure(rows: &[(&str, [f64; 3])], oracle: f64) -> String {
    let (left, step, width) = (230.0, 24.0, 460.0);
    let height = step * rows.len() as f64;
    let most = rows.iter().map(|(_, s)| s[2]).filter(|s| s.is_finite());
    let most = most.fold(3.0 * oracle, f64::max);
    let x = |size: f64| left + width * (size.min(most) / most);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        left + width + 40.0,
        height + 60.0
    );
    for (k, (name, [low, middle, high])) in rows.iter().enumerate() {
        let y = step * (k as f64 + 1.0);
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>\n\
             <line x1=\"{:.1}\" y1=\"{y}\" x2=\"{:.1}\" y2=\"{y}\" stroke=\"#8aa\" stroke-width=\"6\"/>\n\
             <circle cx=\"{:.1}\" cy=\"{y}\" r=\"5\" fill=\"#135\"/>",
            left - 10.0,
            y + 4.0,
            name.replace('_', " "),
            x(*low),
            x(*high),
            x(*middle)
        );
    }
    for (size, says) in [(oracle, "oracle"), (TWICE * oracle, "twice")] {
        let _ = writeln!(
            svg,
            "<line x1=\"{0:.1}\" y1=\"10\" x2=\"{0:.1}\" y2=\"{1}\" stroke=\"#b40\" stroke-dasharray=\"4 3\"/>\n\
             <text x=\"{0:.1}\" y=\"{2}\" text-anchor=\"middle\" fill=\"#b40\">{says} {size:.1}</text>",
            x(size),
            height + 16.0,
            height + 30.0
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">size d' at which half of the effects are found</text>\n</svg>",
        left + 0.5 * width,
        height + 50.0
    );
    svg
}
