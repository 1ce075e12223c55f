//! The options for reading and preparing recordings.

use crate::options::{ChoiceValue, DeclaredOptions, OptionDeclaration, OptionKind, is_positive};
use crate::recording::{DerivativeSource, MAX_FILTER_ORDER, RecordingOptions, SmoothingMethod, StandstillRule};

impl DeclaredOptions for RecordingOptions {
    const HEADING: &'static str = "Reading and preparing recordings";

    fn declarations() -> &'static [OptionDeclaration<Self>] {
        DECLARATIONS
    }
}

const FREQUENCY: &str = "expected a frequency above 0 in Hz, such as 25";

const DECLARATIONS: &[OptionDeclaration<RecordingOptions>] = &[
    OptionDeclaration {
        name: "columns",
        flag: "map",
        placeholder: "NAME=COLUMN",
        help: "Column of the recording for a name of the model, e.g. `{columns=theta1=pos_left}`, or a sum of columns \
               with a unit if it is not SI: `{columns=q6=(pos6 - pos5)/32 - 90 [deg]}`. Names of the model are `t`, a \
               coordinate, a coordinate with `_d` or `_dd`, a drive, and a drive with `_var` for the variance of its \
               force",
        excludes: &[],
        kind: OptionKind::Columns {
            set: |options, pairs| options.columns = pairs,
        },
    },
    OptionDeclaration {
        name: "cutoff_hz",
        flag: "cutoff",
        placeholder: "HZ",
        help: "Cut-off of the low-pass on positions, Hz. Default: chosen by cross-validation on the forces; without \
               forces, from the positions",
        excludes: &[],
        kind: OptionKind::Number {
            set: |options, cutoff| options.preparation.cutoff_hz = Some(cutoff),
            is_valid: is_positive,
            expected: FREQUENCY,
            implied: None,
        },
    },
    OptionDeclaration {
        name: "order",
        flag: "order",
        placeholder: "N",
        help: "Order of the Butterworth low-pass, which runs forwards and backwards [default: 4]",
        excludes: &[],
        kind: OptionKind::Integer {
            set: |options, order| options.preparation.order = order,
            range: (1, MAX_FILTER_ORDER),
            expected: "expected an order from 1 to 20; 4 is usual",
            default: None,
        },
    },
    OptionDeclaration {
        name: "trim",
        flag: "trim",
        placeholder: "N[,N]",
        help: "Samples dropped at the start and at the end, after derivatives are computed; a single number applies \
               to both ends",
        excludes: &[],
        kind: OptionKind::IntegerPair {
            set: |options, ends| options.preparation.trim = Some(ends),
            expected: "expected a number of samples, such as 49, or two of them, such as 49,10",
        },
    },
    OptionDeclaration {
        name: "decimate",
        flag: "decimate",
        placeholder: "N",
        help: "Keep every n-th sample, after an anti-aliasing low-pass on forces and regressor. Default: n is chosen \
               together with the cut-off, and all samples are kept if {cutoff_hz} or {smoothing} is given; 1 is the same as \
               the default",
        excludes: &[],
        kind: OptionKind::Integer {
            set: |options, factor| options.preparation.decimate = factor,
            range: (1, usize::MAX),
            expected: "expected an integer of at least 1, such as 4",
            default: Some(1),
        },
    },
    OptionDeclaration {
        name: "source",
        flag: "derivatives",
        placeholder: "DERIVATIVES",
        help: "Source of rates and accelerations",
        excludes: &[],
        kind: OptionKind::Choice {
            values: &[
                ChoiceValue {
                    name: "recorded",
                    flag: "recorded",
                    help: "Recorded columns if the file has them; the others are computed from positions",
                    set: |options| options.preparation.source = DerivativeSource::RecordedFirst,
                },
                ChoiceValue {
                    name: "positions",
                    flag: "positions",
                    help: "All computed from positions, even if the file has columns for them",
                    set: |options| options.preparation.source = DerivativeSource::Positions,
                },
            ],
        },
    },
    OptionDeclaration {
        name: "smoothing",
        flag: "smoothing",
        placeholder: "SMOOTHING",
        help: "How positions are smoothed and differentiated",
        excludes: &[],
        kind: OptionKind::Choice {
            values: &[
                ChoiceValue {
                    name: "auto",
                    flag: "auto",
                    help: "A Fourier series if the run is periodic and only noise remains as residual, unless \
                           {cutoff_hz} is given; otherwise a Butterworth low-pass",
                    set: |options| options.preparation.smoothing = SmoothingMethod::Automatic,
                },
                ChoiceValue {
                    name: "butterworth",
                    flag: "butterworth",
                    help: "A Butterworth low-pass, forwards and backwards, then central differences",
                    set: |options| options.preparation.smoothing = SmoothingMethod::Butterworth,
                },
                ChoiceValue {
                    name: "savitzky_golay",
                    flag: "savitzky-golay",
                    help: "Polynomials of degree 4 over windows that match the cut-off",
                    set: |options| options.preparation.smoothing = SmoothingMethod::SavitzkyGolay,
                },
                ChoiceValue {
                    name: "fourier",
                    flag: "fourier",
                    help: "A Fourier series up to the cut-off, for periodic motions",
                    set: |options| options.preparation.smoothing = SmoothingMethod::Fourier { period: None },
                },
            ],
        },
    },
    // After the method of smoothing, which it changes.
    OptionDeclaration {
        name: "period",
        flag: "period",
        placeholder: "S",
        help: "Period of the motion, s; selects `{smoothing=fourier}`. Determined from the positions if not given",
        excludes: &[],
        kind: OptionKind::Number {
            set: |options, period| {
                let smoothing = &mut options.preparation.smoothing;
                if matches!(smoothing, SmoothingMethod::Automatic | SmoothingMethod::Fourier { .. }) {
                    *smoothing = SmoothingMethod::Fourier { period: Some(period) };
                }
            },
            is_valid: is_positive,
            expected: "expected a time above 0 in s, such as 7.29",
            implied: None,
        },
    },
    OptionDeclaration {
        name: "band_hz",
        flag: "band",
        placeholder: "HZ",
        help: "Frequency up to which measured and model force are also compared, Hz, in addition to the unfiltered \
               figures. Default: the cut-off, or the highest frequency of the motion",
        excludes: &[],
        kind: OptionKind::Number {
            set: |options, band| options.preparation.band_hz = Some(band),
            is_valid: is_positive,
            expected: FREQUENCY,
            implied: None,
        },
    },
    OptionDeclaration {
        name: "skip_bad_samples",
        flag: "skip-bad-samples",
        placeholder: "",
        help: "Leave out samples with NaN, infinite or empty fields instead of refusing the recording",
        excludes: &[],
        kind: OptionKind::Switch {
            set: |options| options.skip_bad_samples = true,
        },
    },
    OptionDeclaration {
        name: "leave_out_events",
        flag: "leave-out-events",
        placeholder: "",
        help: "Leave out the forces of contacts and pushes: intervals in which no parameters explain the forces",
        excludes: &[],
        kind: OptionKind::Switch {
            set: |options| options.leave_out_events = true,
        },
    },
    OptionDeclaration {
        name: "between",
        flag: "between",
        placeholder: "FROM,TO",
        help: "Read only the samples between these times, s",
        excludes: &[],
        kind: OptionKind::Interval {
            set: |options, times| options.between = Some(times),
            expected: "expected two times in s, the first before the second, such as 10,60",
        },
    },
    OptionDeclaration {
        name: "rate",
        flag: "rate",
        placeholder: "HZ",
        help: "Sampling rate of recordings without a column of times, Hz",
        excludes: &[],
        kind: OptionKind::Number {
            set: |options, rate| options.rate = Some(rate),
            is_valid: is_positive,
            expected: FREQUENCY,
            implied: None,
        },
    },
    OptionDeclaration {
        name: "standstill",
        flag: "standstill",
        placeholder: "PART",
        help: "Leave out a force while its drive is slower than this fraction of its maximum speed, where static \
               friction is unknown; 0.01 is usual, and 0 leaves out none. Default: where the forces show that the \
               drive sticks",
        excludes: &[],
        kind: OptionKind::Number {
            set: |options, part| {
                options.standstill = if part > 0.0 {
                    StandstillRule::Below(part)
                } else {
                    StandstillRule::KeepAll
                };
            },
            is_valid: |part| (0.0..1.0).contains(&part),
            expected: "expected a number between 0 and 1, such as 0.01",
            implied: None,
        },
    },
];
