//! Calm: recordings of a machine without missing effects, drawn from a seed, with white or coloured force noise. Prints
//! how often `diagnose` reports that the model is adequate, and each other answer.
//!
//! `cargo bench -p modelmill-lab --bench calm -- [--seeds 10] [--first 1] [--corners white,60,30,15,8,3,1] [--program
//! PATH]`. Noise has 0.5 to 3 N. The low-pass has first order for odd seeds and second order for even ones. Masses
//! differ from the file for two seeds of three. Figures go to standard output, progress to standard error.

use std::fmt::Write as _;
use std::process::ExitCode;

use modelmill_lab::answer::ProgramAnswer;
use modelmill_lab::case::{DrawnMasses, RATE, with_masses};
use modelmill_lab::coloured::{SpectrumFall, noise};
use modelmill_lab::course::{CourseRepeats, DrawnCourse};
use modelmill_lab::harness::{BenchmarkOptions, BenchmarkUsage, WORKERS, run_benchmark, work_off, write};
use modelmill_lab::plant::{DRIVES, PlantMotion, SpidermillPlant};
use modelmill_lab::random::{CaseRandom, three_digits};
use modelmill_lab::record::{FILES, RecordedSamples};

/// Range of the standard deviation of the noise, N.
const NOISE: [f64; 2] = [0.5, 3.0];
const REPEATS: [CourseRepeats; 3] = [CourseRepeats::Once, CourseRepeats::Thrice, CourseRepeats::Never];

/// A pair of recordings without missing effects; `corner` is that of the noise, Hz, `None` if it is white.
struct Calm {
    seed: u64,
    corner: Option<f64>,
    repeats: CourseRepeats,
}

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "cargo bench -p modelmill-lab --bench calm -- [--seeds 10] [--first 1] [--corners white,60,30,15,8,3,1] \
           [--program PATH]",
    values: &[("seeds", "10"), ("first", "1"), ("corners", "white,60,30,15,8,3,1")],
    switches: &[],
    takes_folder: false,
};

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let [seeds, first] = [options.number::<u64>("seeds")?, options.number("first")?];
    let corners = options.text("corners").split(',').map(|corner| match corner {
        "white" => Ok(None),
        number => number
            .parse()
            .map(Some)
            .map_err(|_| format!("--corners: `{number}` is neither a number nor `white`")),
    });
    let corners: Vec<Option<f64>> = corners.collect::<Result<_, String>>()?;
    let plant = SpidermillPlant::load()?;
    let mut cases = Vec::new();
    for corner in &corners {
        for repeats in REPEATS {
            let of_seed = |seed| Calm {
                seed,
                corner: *corner,
                repeats,
            };
            cases.extend((first..first + seeds).map(of_seed));
        }
    }
    let program = options.program()?;
    let answers = work_off(&cases, WORKERS, |case, folder| {
        let files = FILES.map(|file| folder.join(file));
        for (which, file) in files.iter().enumerate() {
            write(file, &case.record(&plant, which)?)?;
        }
        Ok(program.diagnose(&plant.model, &files).0)
    })?;
    println!(
        "{:<10}{:>16}{:>16}{:>16}",
        "noise", "one period", "three periods", "not periodic"
    );
    let is_calm = |answer: &Result<ProgramAnswer, String>| {
        answer
            .as_ref()
            .is_ok_and(|a| a.verdict == "adequate" && a.effects.is_empty())
    };
    let (mut calm, mut says) = (0, String::new());
    for corner in &corners {
        let name = corner.map_or_else(|| "white".to_owned(), |hz| format!("{hz} Hz"));
        let mut line = format!("{name:<10}");
        for repeats in REPEATS {
            let of = cases.iter().zip(&answers).filter(|(case, _)| {
                case.repeats == repeats && case.corner.map(f64::to_bits) == corner.map(f64::to_bits)
            });
            let mut right = 0;
            for (case, answer) in of {
                right += u64::from(is_calm(answer));
                if !is_calm(answer) {
                    let _ = writeln!(
                        says,
                        "- {name}, {}, seed {}: {}",
                        repeats.word(),
                        case.seed,
                        told(answer)
                    );
                }
            }
            calm += right;
            let _ = write!(line, "{:>16}", format!("{right} of {seeds}"));
        }
        println!("{line}");
    }
    let all = cases.len().max(1);
    println!(
        "\n{:.1} % adequate, {calm} of {all}; target 95 %\n{says}",
        100.0 * calm as f64 / all as f64
    );
    Ok(())
}

/// A wrong answer as text: verdict, effects and disturbances, or the failure.
fn told(answer: &Result<ProgramAnswer, String>) -> String {
    match answer {
        Err(why) => why.clone(),
        Ok(answer) => {
            let claims: Vec<String> = answer.effects.iter().map(|c| c.effect.to_string()).collect();
            format!(
                "{} {} | {}",
                answer.verdict,
                claims.join(", "),
                answer.disturbances.join(", ")
            )
        }
    }
}

impl Calm {
    /// The fit (0) or the validation run (1) as CSV text.
    fn record(&self, plant: &SpidermillPlant, which: usize) -> Result<String, String> {
        let number = self.corner.map_or(0, f64::to_bits);
        let stream = |purpose: u64| CaseRandom::new(self.seed, number, purpose + 1000 * self.repeats as u64);
        let mut random = stream(0);
        let deviation = three_digits(random.log_between(NOISE[0], NOISE[1]));
        let masses = (!self.seed.is_multiple_of(3)).then(|| DrawnMasses::draw(&mut random));
        let rig = with_masses(&plant.rig, masses);
        let courses = [(); 2].map(|()| DrawnCourse::draw(&mut random, plant.limits(), self.repeats));
        let course = &courses[which];
        let along = PlantMotion::new(&rig, course, course.times(RATE))?;
        let fall = if self.seed.is_multiple_of(2) {
            SpectrumFall::Steep
        } else {
            SpectrumFall::Gentle
        };
        let of_channel = |channel: usize| stream(10 + 10 * which as u64 + channel as u64);
        let noise = (0..DRIVES.len()).map(|k| {
            let corner = self.corner.map(|corner| (corner, fall));
            noise(
                &mut of_channel(DRIVES.len() + k),
                along.times.len(),
                RATE,
                deviation,
                corner,
            )
        });
        Ok(
            RecordedSamples::new(&along, &along.plain, noise.collect(), of_channel, false)
                .recorded()
                .csv,
        )
    }
}
