//! The summary of one or many recordings: additive statistics of some kB, from which parameters and changes are
//! computed.

use modelmill_identify::RFactor;
use modelmill_identify::changes::NormalEquations;

use crate::FleetFault;
use crate::bytes::{SummaryReader, SummaryWriter};
use crate::sensors::SensorFault;

/// The first bytes of a summary.
const BEGIN: &[u8; 4] = b"MMFS";
/// Version of the binary format, after the first bytes.
const VERSION: u64 = 1;

/// A recording that could not be evaluated.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BadRecording {
    /// Its name.
    pub recording: String,
    /// The reason, one sentence.
    pub says: String,
}

/// Additive statistics over the rows of recordings. [`FleetSummary::merge`] adds them.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetSummary {
    /// The checksum of its plan, [`FleetPlan::mark`](crate::FleetPlan::mark).
    pub mark: u64,
    /// Number of recordings that were evaluated.
    pub recordings: u64,
    /// Number of their samples, before decimation.
    pub samples: u64,
    /// Their total duration, s.
    pub seconds: f64,
    /// Normal equations of all columns, over rows scaled to variance 1.
    pub all_columns: NormalEquations,
    /// The R factor of the base columns over the same rows; `None` without recordings.
    pub base: Option<RFactor>,
    /// The largest scatter between parts of one recording.
    pub within: f64,
    /// For each drive the squared relative residual of its force with the recording's own parameters, times the number
    /// of samples.
    pub residual_squares: Vec<f64>,
    /// Dead sensors, sorted by recording and name.
    pub sensors: Vec<SensorFault>,
    /// Recording and text of each remark, such as contacts and pushes.
    pub remarks: Vec<(String, String)>,
    /// Recordings that could not be evaluated, sorted by name.
    pub bad: Vec<BadRecording>,
}

impl FleetSummary {
    /// The summary of no recordings, for a number of columns and drives.
    pub(crate) fn empty(mark: u64, columns: usize, drives: usize) -> Self {
        Self {
            mark,
            recordings: 0,
            samples: 0,
            seconds: 0.0,
            all_columns: NormalEquations::new(columns),
            base: None,
            within: 0.0,
            residual_squares: vec![0.0; drives],
            sensors: Vec::new(),
            remarks: Vec::new(),
            bad: Vec::new(),
        }
    }

    /// Adds the recordings of another summary. The order of additions changes rounding only.
    ///
    /// Fails if the other summary belongs to another plan.
    pub fn merge(&mut self, other: &Self) -> Result<(), FleetFault> {
        if self.mark != other.mark || self.all_columns.rhs.len() != other.all_columns.rhs.len() {
            return Err(FleetFault::new(
                "summaries of different plans cannot be added, because their columns have different meanings; make all of them \
                 with one plan",
            ));
        }
        // R factors are merged; if one side has none, the other is used.
        self.base = match (self.base.take(), &other.base) {
            (Some(mine), Some(theirs)) => Some(mine.merge_with(theirs).map_err(FleetFault::new)?),
            (mine, theirs) => mine.or_else(|| theirs.clone()),
        };
        self.recordings += other.recordings;
        self.samples += other.samples;
        self.seconds += other.seconds;
        self.all_columns.merge(&other.all_columns);
        self.within = self.within.max(other.within);
        for (mine, theirs) in self.residual_squares.iter_mut().zip(&other.residual_squares) {
            *mine += theirs;
        }
        // Sorted lists do not depend on the order of additions.
        self.sensors.extend(other.sensors.iter().cloned());
        self.sensors
            .sort_by(|a, b| (&a.recording, &a.of).cmp(&(&b.recording, &b.of)));
        self.remarks.extend(other.remarks.iter().cloned());
        self.remarks.sort();
        self.bad.extend(other.bad.iter().cloned());
        self.bad.sort();
        Ok(())
    }

    /// The residual of a drive's force relative to the force, with the parameters of each recording: rms over all
    /// samples.
    pub fn residual_share(&self, drive: usize) -> f64 {
        let squares = self.residual_squares.get(drive).copied().unwrap_or(0.0);
        (squares / (self.samples as f64).max(1.0)).sqrt()
    }

    /// The summary as bytes, for [`FleetSummary::from_bytes`].
    pub fn bytes(&self) -> Vec<u8> {
        let mut to = SummaryWriter::default();
        // Version and plan first, so that other summaries are recognised.
        to.bytes(BEGIN);
        to.integer(VERSION);
        to.integer(self.mark);
        to.integer(self.recordings);
        to.integer(self.samples);
        to.float(self.seconds);
        to.integer(self.all_columns.rhs.len() as u64);
        to.moments(&self.all_columns);
        match &self.base {
            None => to.integer(0),
            Some(base) => {
                to.integer(1);
                to.integer(base.n_parameters() as u64);
                to.integer(base.rows() as u64);
                to.floats(&base.entries());
            }
        }
        to.float(self.within);
        to.floats(&self.residual_squares);
        to.integer(self.sensors.len() as u64);
        for one in &self.sensors {
            to.text(&one.recording);
            to.text(&one.of);
            to.integer(u64::from(one.is_force));
            to.float(one.still);
            to.float(one.since);
        }
        to.integer(self.remarks.len() as u64);
        for (recording, says) in &self.remarks {
            to.text(recording);
            to.text(says);
        }
        to.integer(self.bad.len() as u64);
        for one in &self.bad {
            to.text(&one.recording);
            to.text(&one.says);
        }
        to.finish()
    }

    /// Reads the bytes of [`FleetSummary::bytes`].
    ///
    /// Fails if bytes are missing or were changed, or have another version.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FleetFault> {
        let what = "a summary";
        if !bytes.starts_with(BEGIN) {
            return Err(FleetFault::new(
                "these bytes are not a summary of recordings; give the result of `modelmill_summarise` or `summarise`",
            ));
        }
        let mut from = SummaryReader::new(bytes, what)?;
        let _: [u8; 4] = from.array()?;
        // Another version has other contents.
        let version = from.integer()?;
        if version != VERSION {
            return Err(FleetFault::new(format!(
                "this summary has version {version}, but this program reads version {VERSION}; summarise the recordings again"
            )));
        }
        let mark = from.integer()?;
        let recordings = from.integer()?;
        let samples = from.integer()?;
        let seconds = from.float()?;
        let columns = from.size()?;
        // Zero columns take no bytes, so the number of columns is limited here, to protect memory.
        if columns > 100_000 {
            return Err(FleetFault::new(format!(
                "{what} has {columns} columns, more than any model; make it again"
            )));
        }
        // The same sequence as in `bytes`.
        let whole = from.moments(columns)?;
        let base = match from.integer()? {
            0 => None,
            _ => {
                let n = from.size()?;
                let rows = from.size()?;
                let entries = from.floats()?;
                Some(RFactor::from_entries(n, rows, &entries).map_err(FleetFault::new)?)
            }
        };
        let within = from.float()?;
        let left = from.floats()?;
        let n = from.element_count(40)?;
        let sensors = (0..n).map(|_| {
            Ok(SensorFault {
                recording: from.text()?,
                of: from.text()?,
                is_force: from.integer()? != 0,
                still: from.float()?,
                since: from.float()?,
            })
        });
        let sensors = sensors.collect::<Result<_, FleetFault>>()?;
        let n = from.element_count(16)?;
        let remarks = (0..n).map(|_| Ok((from.text()?, from.text()?)));
        let remarks = remarks.collect::<Result<_, FleetFault>>()?;
        let n = from.element_count(16)?;
        let bad = (0..n).map(|_| {
            Ok(BadRecording {
                recording: from.text()?,
                says: from.text()?,
            })
        });
        let bad = bad.collect::<Result<_, FleetFault>>()?;
        from.finish()?;
        Ok(Self {
            mark,
            recordings,
            samples,
            seconds,
            all_columns: whole,
            base,
            within,
            residual_squares: left,
            sensors,
            remarks,
            bad,
        })
    }
}
