//! The plan of a fleet: model, preparation of recordings, and the reference values that define the columns. Reference
//! recordings go in, one JSON document comes out. Summaries of different plans cannot be added.

use std::path::Path;
use std::sync::Arc;

use modelmill::files::{DiskFiles, MemoryFiles};
use modelmill::recording::{PreparedRecording, RecordingOptions, SmoothingMethod, StatePreparation};
use modelmill::runs::ReferenceFit;
use modelmill::{Host, Model};
use modelmill_identify::changes::NormalEquations;
use serde::{Deserialize, Serialize};

use crate::files::PlanFiles;
use crate::sensors::FrozenReading;
use crate::{FleetFault, FleetModel};

/// Version of the document and of the summaries.
pub(crate) const VERSION: u32 = 1;

/// How every recording is prepared and summed up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetPlan {
    /// Version of the document, 1.
    pub version: u32,
    /// Path of the model file, for messages.
    pub model: String,
    /// Name and text of the model file and, after it, of the files that it extends.
    pub files: Vec<(String, String)>,
    /// Names of the model with the columns of the recordings, as in [`RecordingOptions::columns`].
    #[serde(default)]
    pub columns: Vec<(String, String)>,
    /// How states are prepared; all values are fixed, so that all recordings are prepared in the same way.
    pub preparation: StatePreparation,
    /// Whether samples with NaN or empty fields are left out; otherwise a recording with such samples is bad.
    #[serde(default)]
    pub skip_bad_samples: bool,
    /// Results of the reference recordings.
    pub reference: FleetReference,
}

/// Results of the reference recordings, which define all columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetReference {
    /// Names of the recordings.
    pub recordings: Vec<String>,
    /// Values of the estimated base parameters, in the order and units of the model.
    pub values: Vec<f64>,
    /// For each drive, sums over its rows.
    pub sizes: Vec<ReferenceSums>,
    /// For each coordinate and drive the longest interval with a constant reading, as a share of the recording.
    pub still: Vec<(String, f64)>,
}

/// Normal equations over rows, without columns that are zero in all rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSums {
    /// Number of all columns.
    columns: usize,
    /// Number of rows.
    rows: usize,
    /// Sum of the squares of the measured forces.
    total: f64,
    /// Indices of the columns that are not zero.
    kept: Vec<usize>,
    /// For each kept column its products with itself and the kept ones after it, then with the measured force.
    products: Vec<Vec<f64>>,
}

impl ReferenceSums {
    /// The compact form of normal equations.
    fn from_moments(sums: &NormalEquations) -> Self {
        let n = sums.rhs.len();
        // A column that is zero in all rows has a zero on the diagonal.
        let kept: Vec<usize> = (0..n).filter(|k| sums.gram[(*k, *k)] != 0.0).collect();
        let products = (0..kept.len()).map(|i| {
            let a = kept[i];
            let with = kept[i..].iter().map(|b| sums.gram[(a, *b)]);
            with.chain([sums.rhs[a]]).collect()
        });
        Self {
            columns: n,
            rows: sums.rows,
            total: sums.total,
            products: products.collect(),
            kept,
        }
    }

    /// The normal equations; `None` if the numbers of products and columns do not match.
    fn moments(&self) -> Option<NormalEquations> {
        let mut sums = NormalEquations::new(self.columns);
        (sums.total, sums.rows) = (self.total, self.rows);
        if self.products.len() != self.kept.len() || self.kept.iter().any(|k| *k >= self.columns) {
            return None;
        }
        for (i, products) in self.products.iter().enumerate() {
            let (rhs, with) = products.split_last()?;
            if with.len() != self.kept.len() - i {
                return None;
            }
            let a = self.kept[i];
            for (b, x) in self.kept[i..].iter().zip(with) {
                sums.gram[(a, *b)] = *x;
                sums.gram[(*b, a)] = *x;
            }
            sums.rhs[a] = *rhs;
        }
        Some(sums)
    }
}

impl FleetPlan {
    /// Makes a plan from reference recordings, which should be of faultless machines. The best preparation of the first
    /// recording is used for all, and the columns are defined by the parameters of all of them. Options that `reading`
    /// does not specify are fixed here. Recordings that cannot be read are left out; [`FleetReference::recordings`]
    /// names the others.
    ///
    /// Fails if the model has faults, or none of the recordings can be read and evaluated.
    pub fn from_recordings(model: &Path, reading: &RecordingOptions, reference: &[&Path]) -> Result<Self, FleetFault> {
        // The model with its files, so that the plan needs no other file.
        let host = Host::new();
        let derived = host.model(model)?;
        let files = derived.loaded.sources.files.iter();
        let files: Vec<(String, String)> = files
            .map(|file| (file.path.display().to_string(), file.text.clone()))
            .collect();
        let path = model.display().to_string();
        let mut last = FleetFault::new("there is no reference recording; give one or more of faultless machines");
        // The first recording that can be read determines the preparation.
        let mut readable = reference.iter().filter_map(|path| {
            let read = derived.recording(path, reading);
            read.map_err(|error| last = error.into()).ok()
        });
        let chosen = readable.next();
        drop(readable);
        let chosen = chosen.ok_or(last)?;
        let settled = fixed_preparation(&chosen, reading)?;
        let mut plan = Self {
            version: VERSION,
            model: path,
            files,
            columns: reading.columns.clone(),
            preparation: settled,
            skip_bad_samples: reading.skip_bad_samples,
            reference: FleetReference {
                recordings: Vec::new(),
                values: Vec::new(),
                sizes: Vec::new(),
                still: Vec::new(),
            },
        };
        // Read all reference recordings with the fixed preparation.
        let reading = plan.reading();
        let recordings: Vec<PreparedRecording> = reference
            .iter()
            .filter_map(|path| derived.recording(path, &reading).ok())
            .collect();
        let all: Vec<&PreparedRecording> = recordings.iter().collect();
        let ground = ReferenceFit::from_reference_runs(&derived, &all)?;
        plan.reference = FleetReference {
            recordings: recordings.iter().map(|one| one.file().to_owned()).collect(),
            values: ground.values().to_vec(),
            sizes: ground.sizes().iter().map(ReferenceSums::from_moments).collect(),
            still: standstill_shares(&derived, &recordings),
        };
        Ok(plan)
    }

    /// Reads a plan from JSON; `name` is its name in messages.
    ///
    /// Fails if the text is not a plan, or has another version.
    pub fn parse(name: &str, text: &str) -> Result<Self, FleetFault> {
        let plan: Self = serde_json::from_str(text).map_err(|error| {
            FleetFault::new(format!(
                "{name} is not a plan of a fleet: {error}; make one with `modelmill-fleet plan`"
            ))
        })?;
        if plan.version != VERSION {
            return Err(FleetFault::new(format!(
                "{name} is a plan of version {}, but this program reads version {VERSION}; make the plan again with \
                 `modelmill-fleet plan`",
                plan.version
            )));
        }
        Ok(plan)
    }

    /// The plan as JSON.
    pub fn json(&self) -> String {
        // Serialisation cannot fail: all keys are texts.
        let mut text = serde_json::to_string(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// The options for reading recordings. Recordings of a fleet are read without the audit.
    pub fn reading(&self) -> RecordingOptions {
        RecordingOptions {
            columns: self.columns.clone(),
            preparation: StatePreparation {
                unexamined: true,
                ..self.preparation.clone()
            },
            skip_bad_samples: self.skip_bad_samples,
            ..RecordingOptions::default()
        }
    }

    /// The checksum of the plan. Every summary has it, so that summaries of different plans are not added.
    pub fn mark(&self) -> u64 {
        crate::bytes::checksum(self.json().as_bytes())
    }

    /// Derives the model of the plan, and computes everything that recordings share.
    ///
    /// Fails if the model has faults, or the reference belongs to another model.
    pub fn derive_model(&self) -> Result<FleetModel, FleetFault> {
        // The model comes from the plan, not from disk.
        let mut files = PlanFiles {
            memory: MemoryFiles::default(),
            disk: DiskFiles::default(),
        };
        for (name, text) in &self.files {
            files.memory.insert(name, text.as_bytes());
        }
        let host = Host::new().with_files(Arc::new(files));
        let model = host.model(&self.model)?;
        let sizes: Option<Vec<NormalEquations>> = self.reference.sizes.iter().map(ReferenceSums::moments).collect();
        let sizes = sizes.ok_or_else(|| {
            FleetFault::new("the reference of the plan is inconsistent: its sums lack products; make the plan again with `modelmill-fleet plan`")
        })?;
        let ground = ReferenceFit::from_parts(&model, &self.reference.values, sizes)?;
        Ok(FleetModel::new(self.clone(), ground))
    }
}

/// Ratio of the cut-off to the highest harmonic of a motion, so that the low-pass does not change that harmonic.
const CUTOFF_RATIO: f64 = 3.5;
/// Samples per period of the cut-off that remain after decimation.
const DECIMATION_RATIO: f64 = 8.0;

/// A preparation with all values fixed: cut-off and decimation of the first recording, with a filter that can be
/// applied to all. If a Fourier series is best for the first recording, others need not be periodic; then a low-pass
/// well above its highest harmonic is used instead.
fn fixed_preparation(chosen: &PreparedRecording, reading: &RecordingOptions) -> Result<StatePreparation, FleetFault> {
    let run = chosen
        .segments
        .first()
        .map(|segment| &segment.run)
        .ok_or_else(|| FleetFault::new(format!("{} has no samples", chosen.file())))?;
    // Values that are specified have priority over those of the first recording.
    let (prepared, asked) = (&run.prepared, &reading.preparation);
    let mut cutoff_hz = asked.cutoff_hz.or(prepared.cutoff_hz);
    let mut decimate = prepared.decimate.max(asked.decimate).max(1);
    if let (None, Some(_), Some(highest)) = (asked.cutoff_hz, prepared.period, prepared.cutoff_hz) {
        let rate = match run.time.as_slice() {
            [first, .., last] => (run.time.len() - 1) as f64 / (last - first),
            _ => 0.0,
        };
        let cutoff = CUTOFF_RATIO * highest;
        // The cut-off stays below a quarter of the sampling rate, where the filter can be designed; motion has lower
        // frequencies.
        let cutoff = cutoff.min(0.2 * rate);
        let every = (1..=1_000_000)
            .take_while(|every| DECIMATION_RATIO * cutoff * f64::from(*every) <= rate)
            .last();
        decimate = decimate.max(every.and_then(|every: u32| usize::try_from(every).ok()).unwrap_or(1));
        cutoff_hz = Some(cutoff);
    }
    Ok(StatePreparation {
        cutoff_hz,
        decimate,
        smoothing: match asked.smoothing {
            SmoothingMethod::SavitzkyGolay => SmoothingMethod::SavitzkyGolay,
            _ => SmoothingMethod::Butterworth,
        },
        ..asked.clone()
    })
}

/// For each coordinate and drive the longest interval with a constant reading in any recording, as a share of that
/// recording.
fn standstill_shares(model: &Model, recordings: &[PreparedRecording]) -> Vec<(String, f64)> {
    let names = model.active_coordinates().into_iter().chain(model.row_names());
    names
        .map(|name| {
            let of = |one: &PreparedRecording| one.raw_column(&name).map_or(0.0, FrozenReading::longest_share);
            let most = recordings.iter().map(of).fold(0.0, f64::max);
            (name, most)
        })
        .collect()
}
