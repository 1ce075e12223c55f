//! Options for reading and preparing recordings, shared by all commands that read them.

use std::fmt::Write as _;
use std::path::Path;

use clap::{Args, ValueEnum};
use modelmill::Host;
use modelmill::recording::{
    DerivativeSource, MAX_FILTER_ORDER, RecordingOptions, SmoothingMethod, StandstillRule, StatePreparation,
};

use crate::flags::{FlagSpelling, quote_word};

/// Order of the low-pass without `--order`.
const USUAL_ORDER: usize = 4;

/// How recordings are read and states are prepared.
#[derive(Debug, Clone, PartialEq, Args)]
#[command(next_help_heading = "Reading and preparing recordings")]
pub(crate) struct PreparationArgs {
    /// Column of the recording for a name of the model, e.g. `--map theta1=pos_left`, or a sum of columns with a unit
    /// if it is not SI: `--map "q6=(pos6 - pos5)/32 - 90 [deg]"`; may be repeated. Names of the model are `t`, a
    /// coordinate, a coordinate with `_d` or `_dd`, a drive, and a drive with `_var` for the variance of its force
    #[arg(long, value_name = "NAME=COLUMN", value_parser = parse_map)]
    pub(crate) map: Vec<(String, String)>,
    /// Columns of the recording from a file with the table `[recording.columns]`, which `modelmill recordings --model`
    /// prints; `--map` has priority
    #[arg(long, value_name = "FILE.toml", value_parser = read_mapping)]
    pub(crate) mapping: Option<MappingFile>,
    /// Cut-off of the low-pass on positions, Hz. Default: chosen by cross-validation on the forces; without forces,
    /// from the positions
    #[arg(long, value_name = "HZ", value_parser = parse_cutoff, allow_negative_numbers = true)]
    pub(crate) cutoff: Option<f64>,
    /// Order of the Butterworth low-pass, which runs forwards and backwards [default: 4]
    #[arg(long, value_name = "N", value_parser = parse_order, allow_negative_numbers = true)]
    pub(crate) order: Option<usize>,
    /// Samples dropped at the start and at the end, after derivatives are computed; a single number applies to both
    /// ends
    #[arg(long, value_name = "N[,N]", value_parser = parse_trim, allow_hyphen_values = true)]
    pub(crate) trim: Option<(usize, usize)>,
    /// Keep every n-th sample, after an anti-aliasing low-pass on forces and regressor. Default: chosen together with
    /// the cut-off; 1 if --cutoff or --smoothing is given
    #[arg(long, value_name = "N", default_value_t = 1, hide_default_value = true, value_parser = parse_decimate, allow_negative_numbers = true)]
    pub(crate) decimate: usize,
    /// Source of rates and accelerations
    #[arg(long, value_enum, default_value = "recorded")]
    pub(crate) derivatives: DerivativesArg,
    /// How positions are smoothed and differentiated
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) smoothing: SmoothingArg,
    /// Period of the motion, s; selects `--smoothing fourier`. Determined from the positions if not given
    #[arg(long, value_name = "S", value_parser = parse_period)]
    pub(crate) period: Option<f64>,
    /// Frequency up to which measured and model force are also compared, Hz, in addition to the unfiltered figures.
    /// Default: the cut-off, or the highest frequency of the motion
    #[arg(long, value_name = "HZ", value_parser = parse_cutoff, allow_negative_numbers = true)]
    pub(crate) band: Option<f64>,
    /// Leave out samples with NaN, infinite or empty fields instead of refusing the recording
    #[arg(long)]
    pub(crate) skip_bad_samples: bool,
    /// Leave out the forces of contacts and pushes: intervals in which no parameters explain the forces
    #[arg(long)]
    pub(crate) leave_out_events: bool,
    /// Read only the samples between these times, s
    #[arg(long, value_name = "FROM,TO", value_parser = parse_between, allow_hyphen_values = true)]
    pub(crate) between: Option<(f64, f64)>,
    /// Sampling rate of recordings without a column of times, Hz
    #[arg(long, value_name = "HZ", value_parser = parse_cutoff, allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Leave out a force while its drive is slower than this fraction of its maximum speed, where static friction is
    /// unknown; 0.01 is usual, and 0 leaves out none. Default: where the forces show that the drive sticks
    #[arg(long, value_name = "PART", value_parser = parse_fraction, allow_negative_numbers = true)]
    pub(crate) standstill: Option<f64>,
}

/// A mapping file that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct MappingFile {
    /// The argument.
    path: String,
    /// Names of the model with their columns.
    columns: Vec<(String, String)>,
}

/// Where derivatives come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DerivativesArg {
    /// Recorded columns if the file has them; the others are computed from positions
    Recorded,
    /// All computed from positions, even if the file has columns for them
    Positions,
}

/// How positions are smoothed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SmoothingArg {
    /// A Fourier series if the run is periodic and only noise remains as residual, unless --cutoff is given; otherwise
    /// a Butterworth low-pass
    Auto,
    /// A Butterworth low-pass, forwards and backwards, then central differences
    Butterworth,
    /// Polynomials of degree 4 over windows that match the cut-off
    SavitzkyGolay,
    /// A Fourier series up to the cut-off, for periodic motions
    Fourier,
}

impl PreparationArgs {
    /// The same as options of the library.
    pub(crate) fn reading(&self) -> RecordingOptions {
        RecordingOptions {
            columns: self.columns(),
            preparation: self.preparation(),
            skip_bad_samples: self.skip_bad_samples,
            leave_out_events: self.leave_out_events,
            between: self.between,
            rate: self.rate,
            standstill: match self.standstill {
                None => StandstillRule::Automatic,
                Some(part) if part > 0.0 => StandstillRule::Below(part),
                Some(_) => StandstillRule::KeepAll,
            },
        }
    }

    /// Columns by `--map`, then those of the mapping file for other names.
    fn columns(&self) -> Vec<(String, String)> {
        let of_file = self.mapping.iter().flat_map(|file| &file.columns);
        let is_free = |(ours, _): &&(String, String)| self.map.iter().all(|(mine, _)| mine != ours);
        self.map.iter().chain(of_file.filter(is_free)).cloned().collect()
    }

    /// The options that differ from their defaults, as text for a command line, each with a space before it.
    #[cfg_attr(
        not(feature = "workbench"),
        expect(dead_code, reason = "only the workbench prints them")
    )]
    pub(crate) fn to_flags(&self) -> String {
        let mut all = String::new();
        let mut option = |name: &str, value: Option<String>| {
            if let Some(value) = value {
                let _ = write!(all, " --{name} {}", quote_word(&value));
            }
        };
        for (ours, theirs) in &self.map {
            option("map", Some(format!("{ours}={theirs}")));
        }
        option("mapping", self.mapping.as_ref().map(|file| file.path.clone()));
        let number = |value: Option<f64>| value.map(|value| value.to_string());
        option("cutoff", number(self.cutoff));
        option("order", self.order.map(|order| order.to_string()));
        option("trim", self.trim.map(|(start, end)| format!("{start},{end}")));
        option("decimate", (self.decimate > 1).then(|| self.decimate.to_string()));
        // Values of enumerations by their names, except the defaults.
        let choice = |value: Option<clap::builder::PossibleValue>, usual: &str| {
            let name = value.map(|value| value.get_name().to_owned());
            name.filter(|name| name != usual)
        };
        option("derivatives", choice(self.derivatives.to_possible_value(), "recorded"));
        option("smoothing", choice(self.smoothing.to_possible_value(), "auto"));
        option("period", number(self.period));
        option("band", number(self.band));
        option("between", self.between.map(|(from, to)| format!("{from},{to}")));
        option("rate", number(self.rate));
        option("standstill", number(self.standstill));
        if self.skip_bad_samples {
            all.push_str(" --skip-bad-samples");
        }
        if self.leave_out_events {
            all.push_str(" --leave-out-events");
        }
        all
    }

    /// Filters and derivatives as the library's options.
    fn preparation(&self) -> StatePreparation {
        StatePreparation {
            cutoff_hz: self.cutoff,
            order: self.order.unwrap_or(USUAL_ORDER),
            trim: self.trim,
            decimate: self.decimate,
            band_hz: self.band,
            source: match self.derivatives {
                DerivativesArg::Recorded => DerivativeSource::RecordedFirst,
                DerivativesArg::Positions => DerivativeSource::Positions,
            },
            smoothing: match self.smoothing {
                // A given period implies a Fourier series.
                SmoothingArg::Auto => match self.period {
                    None => SmoothingMethod::Automatic,
                    period => SmoothingMethod::Fourier { period },
                },
                SmoothingArg::Butterworth => SmoothingMethod::Butterworth,
                SmoothingArg::SavitzkyGolay => SmoothingMethod::SavitzkyGolay,
                SmoothingArg::Fourier => SmoothingMethod::Fourier { period: self.period },
            },
            ..StatePreparation::default()
        }
    }
}

/// Reads a mapping file.
fn read_mapping(path: &str) -> Result<MappingFile, String> {
    let columns = Host::new().column_mapping(Path::new(path));
    Ok(MappingFile {
        path: path.to_owned(),
        columns: columns.map_err(|error| error.spell(&FlagSpelling))?,
    })
}

/// Reads `NAME=COLUMN`: a name of the model and an expression of columns.
pub(crate) fn parse_map(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((ours, theirs)) if !ours.trim().is_empty() && !theirs.trim().is_empty() => {
            Ok((ours.trim().to_owned(), theirs.trim().to_owned()))
        }
        _ => Err("expected NAME=COLUMN, such as theta1=pos_left".to_owned()),
    }
}

/// Reads a number from 0 to below 1.
fn parse_fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(part) if (0.0..1.0).contains(&part) => Ok(part),
        _ => Err("expected a number between 0 and 1, such as 0.01".to_owned()),
    }
}

/// Reads a frequency above 0 in Hz.
fn parse_cutoff(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a frequency above 0 in Hz, such as 25".to_owned()),
    }
}

/// Reads a period above 0 in s.
fn parse_period(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a time above 0 in s, such as 7.29".to_owned()),
    }
}

/// Reads the order of a low-pass, from 1 to `MAX_FILTER_ORDER`.
fn parse_order(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(order) if (1..=MAX_FILTER_ORDER).contains(&order) => Ok(order),
        _ => Err(format!("expected an order from 1 to {MAX_FILTER_ORDER}; 4 is usual")),
    }
}

/// Reads `N` for both ends or `START,END`, numbers of samples.
fn parse_trim(text: &str) -> Result<(usize, usize), String> {
    let count = |text: &str| {
        text.trim()
            .parse::<usize>()
            .map_err(|_| "expected a number of samples, such as 49, or two of them, such as 49,10".to_owned())
    };
    match text.split_once(',') {
        Some((start, end)) => Ok((count(start)?, count(end)?)),
        None => count(text).map(|both| (both, both)),
    }
}

/// Reads `FROM,TO`, two increasing times in s.
fn parse_between(text: &str) -> Result<(f64, f64), String> {
    let times = text.split_once(',').map(|(from, to)| {
        let time = |text: &str| text.trim().parse::<f64>().ok().filter(|t| t.is_finite());
        (time(from), time(to))
    });
    match times {
        Some((Some(from), Some(to))) if from < to => Ok((from, to)),
        _ => Err("expected two times in s, the first before the second, such as 10,60".to_owned()),
    }
}

/// Reads a decimation factor, at least 1.
fn parse_decimate(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(value) if value > 0 => Ok(value),
        _ => Err("expected an integer of at least 1; 1 keeps all samples".to_owned()),
    }
}
