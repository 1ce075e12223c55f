//! How every recording of a fleet is summed up: model, preparation, and the reference that columns are built on. A plan is one
//! JSON document; summaries of two plans do not add.

use std::path::Path;
use std::sync::Arc;

use modelmill::files::{DiskFiles, MemoryFiles};
use modelmill::recording::{
    PreparedRecording, RecordingOptions, SmoothingMethod, StatePreparation,
};
use modelmill::runs::ReferenceFit;
use modelmill::{Host, Model};
use modelmill_identify::changes::NormalEquations;
use serde::{Deserialize, Serialize};

use crate::files::PlanFiles;
use crate::sensors::FrozenReading;
use crate::{FleetFault, FleetModel};

/// The version of the document, and of what summaries hold.
pub(crate) const VERSION: u32 = 1;

/// How every recording is summed up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetPlan {
    /// 1.
    pub version: u32,
    /// What messages call the model file.
    pub model: String,
    /// The text of the model file and, behind it, of those that it extends, each with its name.
    pub files: Vec<(String, String)>,
    /// Our columns with what the recordings call them, as in [`RecordingOptions::columns`].
    #[serde(default)]
    pub columns: Vec<(String, String)>,
    /// How states are prepared; everything is settled, so that all recordings are prepared alike.
    pub preparation: StatePreparation,
    /// Whether samples with NaN or empty fields are left out; a recording that has them is a bad one otherwise.
    #[serde(default)]
    pub skip_bad_samples: bool,
    /// What the reference recordings say.
    pub reference: FleetReference,
}

/// What reference recordings say, and all columns are built on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetReference {
    /// What the recordings are called.
    pub recordings: Vec<String>,
    /// Base parameters that are no known numbers, in the order and units of the model.
    pub values: Vec<f64>,
    /// Sums over the rows of each drive.
    pub sizes: Vec<ReferenceSums>,
    /// For each coordinate and drive the longest time for which its reading stood still, as a part of the recording.
    pub still: Vec<(String, f64)>,
}

/// Sums over rows, without the columns that are zero throughout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSums {
    columns: usize,
    rows: usize,
    total: f64,
    kept: Vec<usize>,
    /// Of each kept column its products with itself and all kept ones behind it, then with the measured force.
    products: Vec<Vec<f64>>,
}

impl ReferenceSums {
    fn from_moments(sums: &NormalEquations) -> Self {
        let n = sums.rhs.len();
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
    /// The plan that reference recordings make, which should be of sound machines: how the first is best prepared is how all
    /// are, and columns are built on the parameters that all of them say. What `reading` leaves open is settled here. Those that
    /// cannot be read are left out; [`FleetReference::recordings`] names the others.
    ///
    /// Fails where the model has no meaning, or none of the recordings can be read and evaluated.
    pub fn from_recordings(
        model: &Path,
        reading: &RecordingOptions,
        reference: &[&Path],
    ) -> Result<Self, FleetFault> {
        let host = Host::new();
        let derived = host.model(model)?;
        let files = derived.loaded.sources.files.iter();
        let files: Vec<(String, String)> = files
            .map(|file| (file.path.display().to_string(), file.text.clone()))
            .collect();
        let path = model.display().to_string();
        let mut last =
            FleetFault::new("there is no reference recording; name one or more of sound machines");
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
            sizes: ground
                .sizes()
                .iter()
                .map(ReferenceSums::from_moments)
                .collect(),
            still: standstill_shares(&derived, &recordings),
        };
        Ok(plan)
    }

    /// Reads a plan from its JSON; `name` is what messages call it.
    ///
    /// Fails where it is none, or of another version.
    pub fn parse(name: &str, text: &str) -> Result<Self, FleetFault> {
        let plan: Self = serde_json::from_str(text).map_err(|error| {
            FleetFault::new(format!(
                "{name} is no plan of a fleet: {error}; make one with `modelmill-fleet plan`"
            ))
        })?;
        if plan.version != VERSION {
            return Err(FleetFault::new(format!(
                "{name} is a plan of version {}, and this program knows version {VERSION}; make it anew",
                plan.version
            )));
        }
        Ok(plan)
    }

    /// The plan as JSON.
    pub fn json(&self) -> String {
        // Maps with text keys and finite numbers have a text.
        let mut text = serde_json::to_string(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// How recordings are read.
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

    /// What summaries of this plan bear, so that others are not added to them.
    pub fn mark(&self) -> u64 {
        crate::bytes::checksum(self.json().as_bytes())
    }

    /// The model that is in the plan, derived, and all that is computed once.
    ///
    /// Fails where the model has no meaning or the reference is of another.
    pub fn derive_model(&self) -> Result<FleetModel, FleetFault> {
        let mut files = PlanFiles {
            memory: MemoryFiles::default(),
            disk: DiskFiles::default(),
        };
        for (name, text) in &self.files {
            files.memory.insert(name, text.as_bytes());
        }
        let host = Host::new().with_files(Arc::new(files));
        let model = host.model(&self.model)?;
        let sizes: Option<Vec<NormalEquations>> = self
            .reference
            .sizes
            .iter()
            .map(ReferenceSums::moments)
            .collect();
        let sizes = sizes.ok_or_else(|| {
            FleetFault::new("the plan's reference does not fit itself: its sums lack products; make it anew with `modelmill-fleet plan`")
        })?;
        let ground = ReferenceFit::from_parts(&model, &self.reference.values, sizes)?;
        Ok(FleetModel::new(self.clone(), ground))
    }
}

/// A low-pass that is to leave the highest harmonic of a motion as it is stands so many times higher.
const CUTOFF_RATIO: f64 = 3.5;
/// One sample is kept of so many as leave this many in a period of the cut-off.
const DECIMATION_RATIO: f64 = 8.0;

/// The preparation with nothing left open: the cut-off and decimation that suit the first recording, by the filter that all can be
/// given alike. Where the first is best taken for a Fourier series, which others need not share, a low-pass well above its highest
/// harmonic stands in.
fn fixed_preparation(
    chosen: &PreparedRecording,
    reading: &RecordingOptions,
) -> Result<StatePreparation, FleetFault> {
    let run = chosen
        .segments
        .first()
        .map(|stretch| &stretch.run)
        .ok_or_else(|| FleetFault::new(format!("{} holds no samples", chosen.file())))?;
    let (prepared, asked) = (&run.prepared, &reading.preparation);
    let mut cutoff_hz = asked.cutoff_hz.or(prepared.cutoff_hz);
    let mut decimate = prepared.decimate.max(asked.decimate).max(1);
    if let (None, Some(_), Some(highest)) = (asked.cutoff_hz, prepared.period, prepared.cutoff_hz) {
        let rate = match run.time.as_slice() {
            [first, .., last] => (run.time.len() - 1) as f64 / (last - first),
            _ => 0.0,
        };
        let cutoff = CUTOFF_RATIO * highest;
        // Beyond a quarter of the rate no filter can be designed; motion is there no more.
        let cutoff = cutoff.min(0.2 * rate);
        let every = (1..=1_000_000)
            .take_while(|every| DECIMATION_RATIO * cutoff * f64::from(*every) <= rate)
            .last();
        decimate = decimate.max(
            every
                .and_then(|every: u32| usize::try_from(every).ok())
                .unwrap_or(1),
        );
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

/// For how long the readings of recordings stood still, at most.
fn standstill_shares(model: &Model, recordings: &[PreparedRecording]) -> Vec<(String, f64)> {
    let names = model.active_coordinates().into_iter().chain(model.drives());
    names
        .map(|name| {
            let of = |one: &PreparedRecording| {
                one.raw_column(&name)
                    .map_or(0.0, FrozenReading::longest_share)
            };
            let most = recordings.iter().map(of).fold(0.0, f64::max);
            (name, most)
        })
        .collect()
}
