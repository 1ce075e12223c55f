//! Equations at standstill: while a drive hardly moves its friction takes any value, and the sign of its rate is noise,
//! so that they may be left out of a fit.

use clap::Args;
use modelmill_codegen::Evaluator;
use modelmill_identify::Note;
use modelmill_spec::DriveKind;

use crate::along;
use crate::data::Data;
use crate::failure::{Failure, Outcome};
use crate::model::Model;
use crate::table::count;

/// What is left out of a fit.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Leaving out equations")]
pub(crate) struct StandstillArgs {
    /// Leave an equation out of the fit while its drive is slower than this part of its fastest, for at rest the
    /// friction takes any value; 0.01 is usual
    #[arg(long, value_name = "PART", value_parser = parse_part)]
    pub(crate) standstill: Option<f64>,
}

fn parse_part(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(part) if part > 0.0 && part < 1.0 => Ok(part),
        _ => Err("expected a number between 0 and 1, such as 0.01".to_owned()),
    }
}

/// Gives equations at standstill the weight 0, and says how many there are.
pub(crate) fn leave_out(model: &Model, data: &mut [Data], args: &StandstillArgs) -> Outcome {
    let Some(part) = args.standstill else {
        return Ok(());
    };
    let drives = model.drives();
    let rates: Vec<Vec<Vec<f64>>> = data
        .iter()
        .map(|one| {
            let rates = drive_rates(model, one)?;
            let pick = |rate: Vec<f64>| rate.into_iter().step_by(one.decimation()).collect();
            Ok(rates.into_iter().map(pick).collect())
        })
        .collect::<Outcome<_>>()?;
    let fastest: Vec<f64> = (0..drives.len())
        .map(|d| {
            let all = rates.iter().flat_map(|run| &run[d]);
            all.map(|rate| rate.abs()).fold(0.0, f64::max)
        })
        .collect();
    let mut out = vec![0; drives.len()];
    let mut of = 0;
    for (one, run) in data.iter_mut().zip(&rates) {
        let samples = run.first().map_or(0, Vec::len);
        of += samples;
        let weights = one
            .weights
            .get_or_insert_with(|| vec![1.0; samples * drives.len()]);
        for (k, row) in weights.chunks_exact_mut(drives.len()).enumerate() {
            for (d, weight) in row.iter_mut().enumerate() {
                if run[d][k].abs() <= part * fastest[d] {
                    *weight = 0.0;
                    out[d] += 1;
                }
            }
        }
    }
    for (drive, out) in drives.iter().zip(out) {
        if out == of {
            return Err(Failure::Input(format!(
                "`{drive}` stands still in all recordings of the fit, so --standstill leaves nothing of it; \
                 use a recording in which it moves, or leave --standstill out"
            )));
        }
        if out > 0 {
            data[0].note(Note::info(format!(
                "Of the {} of `{drive}` {out} are left out of the fit: it is slower there than {part} of its fastest \
                 (--standstill). Error figures count them.",
                count(of, "equation", "equations"),
            )));
        }
    }
    Ok(())
}

/// Rates of the drives, `[drive][sample]`, before decimation.
pub(crate) fn drive_rates(model: &Model, data: &Data) -> Outcome<Vec<Vec<f64>>> {
    let mechanism = &model.derivation.mechanism;
    let active = model.active();
    let is_linear = |kind: &DriveKind| matches!(kind, DriveKind::Linear { .. });
    let lengths = if mechanism.drives.iter().any(|drive| is_linear(&drive.kind)) {
        let evaluator = Evaluator::new(&model.derivation);
        along::columns(model, data, |states| evaluator.drives(states))?
    } else {
        Vec::new()
    };
    let n = mechanism.drives.len();
    let rates = mechanism.drives.iter().enumerate().map(|(d, drive)| {
        let rate = match &drive.kind {
            DriveKind::Joint(coordinate) => {
                let name = &mechanism.coordinates[coordinate.0].name;
                let place = active.iter().position(|other| other == name);
                place.and_then(|place| data.run.qd.get(place))
            }
            DriveKind::Linear { .. } => lengths.get(n + d),
        };
        rate.cloned().unwrap_or_default()
    });
    Ok(rates.collect())
}
