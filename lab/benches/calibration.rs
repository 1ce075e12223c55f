//! Calibration: recordings with hidden effects and with disturbances by sensors, drives and different days, drawn from
//! a seed. Prints whether findings are true as often as their `probability` states.
//!
//! `cargo bench -p modelmill-lab --bench calibration -- [--count 300] [--seed 1] [--list FILE] [--program PATH]`.
//! Prints the Brier score (G. Brier, Monthly Weather Review 78, 1950), compared with that of a constant forecast: the
//! share of true findings. The table of reliability compares the number of true findings in each bin with the 95 %
//! interval of the binomial distribution for its mean probability. `--list` writes every finding into a file. A finding
//! is true if its kind is present at all its places.

use std::fmt::Write as _;
use std::process::ExitCode;

use modelmill_lab::case::HiddenCase;
use modelmill_lab::disturbance::DrawnDisturbance;
use modelmill_lab::harness::{BenchmarkOptions, BenchmarkUsage, WORKERS, run_benchmark, work_off, write};
use modelmill_lab::outside::OutsideLaw;
use modelmill_lab::placed::atoms;
use modelmill_lab::plant::{DRIVES, SpidermillPlant};
use modelmill_lab::random::CaseRandom;
use modelmill_lab::record::FILES;

/// Number of bins of the table of reliability.
const BINS: usize = 10;
/// Probability beyond an interval, on each side.
const BEYOND: f64 = 0.025;

/// A claim of the program.
struct Finding {
    probability: f64,
    is_true: bool,
    says: String,
}

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "cargo bench -p modelmill-lab --bench calibration -- [--count 300] [--seed 1] [--list FILE] [--program PATH]",
    values: &[("count", "300"), ("seed", "1"), ("list", "")],
    switches: &[],
    takes_folder: false,
};

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let seed: u64 = options.number("seed")?;
    let plant = SpidermillPlant::load()?;
    let numbers: Vec<u64> = (1..=options.number("count")?).collect();
    let program = options.program()?;
    let all = work_off(&numbers, WORKERS, |number, folder| {
        let case = HiddenCase::draw(&plant, seed, *number)?;
        let disturbance = DrawnDisturbance::draw(&case, &mut CaseRandom::new(seed, *number, 1));
        let files = FILES.map(|file| folder.join(file));
        for (which, file) in files.iter().enumerate() {
            write(file, &disturbance.record(&case, seed, which)?.csv)?;
        }
        let (answer, _) = program.diagnose(&plant.model, &files);
        let mut truth = atoms(&case.placed());
        truth.extend(disturbance.makes_true());
        if truth.iter().any(|(kind, _)| kind == "time_delay") {
            truth.extend(DRIVES.map(|drive| ("time_delay".to_owned(), drive.to_owned())));
        }
        if let Some(outside) = &case.outside {
            // Library effects that describe hysteresis, and the mean of friction that depends on the position.
            let kind = match outside.law {
                OutsideLaw::Hysteresis => "dahl_friction",
                OutsideLaw::FrictionByPlace => "viscous_friction",
                _ => "",
            };
            truth.insert((kind.to_owned(), DRIVES[outside.at].to_owned()));
        }
        let answer = match answer {
            Ok(answer) => answer,
            Err(why) => return Ok(Err(format!("case {number}: {why}"))),
        };
        let findings = answer.effects.iter().map(|claim| Finding {
            probability: claim.probability.unwrap_or(1.0),
            is_true: atoms([&claim.effect]).is_subset(&truth),
            says: format!(
                "case {number}: {} | {} | {} {disturbance:?}",
                claim.effect,
                answer.verdict,
                case.truth()
            ),
        });
        Ok(Ok(findings.collect::<Vec<_>>()))
    })?;
    let mut findings = Vec::new();
    for one in all {
        match one {
            Ok(some) => findings.extend(some),
            Err(says) => println!("- {says}"),
        }
    }
    if let Some(path) = options.path("list") {
        let line = |f: &Finding| format!("{:.4} {} {}\n", f.probability, u8::from(f.is_true), f.says);
        let text: String = findings.iter().map(line).collect();
        write(path, &text)?;
    }
    print!("{}", report(&findings, numbers.len(), seed));
    Ok(())
}

fn report(findings: &[Finding], recordings: usize, seed: u64) -> String {
    let n = findings.len().max(1) as f64;
    let outcome = |f: &Finding| f64::from(u8::from(f.is_true));
    let share = findings.iter().map(outcome).sum::<f64>() / n;
    let brier = findings.iter().map(|f| (f.probability - outcome(f)).powi(2));
    let mut text = format!(
        "seed {seed}, {recordings} pairs of recordings, {} findings, {:.1} % of them true\n\
         Brier score {:.4}; {:.4} for a constant forecast of {share:.3}\n\n{:<12}{:>10}{:>12}{:>8}{:>14}\n",
        findings.len(),
        100.0 * share,
        brier.sum::<f64>() / n,
        share * (1.0 - share),
        "probability",
        "findings",
        "mean prob.",
        "true",
        "95 % interval"
    );
    let mut inside = [0, 0];
    for bin in 0..BINS {
        let [low, high] = [bin, bin + 1].map(|k| k as f64 / BINS as f64);
        let is_in = |f: &&Finding| f.probability >= low && (f.probability < high || bin + 1 == BINS);
        let own: Vec<&Finding> = findings.iter().filter(is_in).collect();
        if own.is_empty() {
            continue;
        }
        let mean = own.iter().map(|f| f.probability).sum::<f64>() / own.len() as f64;
        let right = own.iter().filter(|f| f.is_true).count();
        let [least, most] = binomial(own.len(), mean);
        let holds = (least..=most).contains(&right);
        inside[0] += usize::from(holds);
        inside[1] += 1;
        let _ = writeln!(
            text,
            "{:<12}{:>10}{mean:>12.3}{right:>8}{:>14}{}",
            format!("{low:.1} - {high:.1}"),
            own.len(),
            format!("{least} - {most}"),
            if holds { "" } else { "  outside" }
        );
    }
    text + &format!("{} of {} bins within their binomial intervals\n", inside[0], inside[1])
}

/// Interval of the number of true findings out of `count`, with [`BEYOND`] outside on each side.
fn binomial(count: usize, probability: f64) -> [usize; 2] {
    let p = probability.clamp(1e-9, 1.0 - 1e-9);
    let mut log = count as f64 * (-p).ln_1p();
    let mut sum = 0.0;
    let (mut least, mut most) = (None, count);
    for k in 0..=count {
        sum += log.exp();
        if sum > BEYOND && least.is_none() {
            least = Some(k);
        }
        if sum >= 1.0 - BEYOND {
            most = k;
            break;
        }
        log += ((count - k) as f64 / (k + 1) as f64).ln() + (p / (1.0 - p)).ln();
    }
    [least.unwrap_or(0), most]
}
