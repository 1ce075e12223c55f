//! One recording, or many, as sums: what a robot, a day or a part says, in some kB.

use modelmill_identify::RFactor;
use modelmill_identify::changes::NormalEquations;

use crate::FleetFault;
use crate::bytes::{SummaryReader, SummaryWriter};
use crate::sensors::SensorFault;

/// The first bytes of a summary, then its version.
const BEGIN: &[u8; 4] = b"MMFS";
const VERSION: u64 = 1;

/// A recording that gave no answer.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BadRecording {
    /// What messages call it.
    pub recording: String,
    /// Why.
    pub says: String,
}

/// Sums over the rows of recordings. [`FleetSummary::merge`] adds them.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetSummary {
    /// [`FleetPlan::mark`](crate::Plan::mark) of the plan by which it was made.
    pub mark: u64,
    /// Recordings that gave an answer.
    pub recordings: u64,
    /// Their samples, as they were recorded.
    pub samples: u64,
    /// How long they are, s.
    pub seconds: f64,
    /// Products of all columns, over rows of variance 1.
    pub all_columns: NormalEquations,
    /// The triangle of the base columns over the same rows; `None` without recordings.
    pub base: Option<RFactor>,
    /// By what parts of one recording differ among themselves, at most.
    pub within: f64,
    /// For each drive the sum over samples of the square of what the recording's own parameters leave of its force, as a part of
    /// it.
    pub residual_squares: Vec<f64>,
    /// Sensors that died, by recording and name.
    pub sensors: Vec<SensorFault>,
    /// Remarks, such as contacts and pushes, each with its recording.
    pub remarks: Vec<(String, String)>,
    /// Recordings that gave none, by name.
    pub bad: Vec<BadRecording>,
}

impl FleetSummary {
    /// Of no recordings, for so many columns and drives.
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

    /// Adds the recordings of another one. The order in which summaries are added changes nothing but the last digits.
    ///
    /// Fails where the other is of another plan.
    pub fn merge(&mut self, other: &Self) -> Result<(), FleetFault> {
        if self.mark != other.mark || self.all_columns.rhs.len() != other.all_columns.rhs.len() {
            return Err(FleetFault::new(
                "summaries of two plans do not add: their columns mean different things; make all of them with one plan",
            ));
        }
        self.base = match (self.base.take(), &other.base) {
            (Some(mine), Some(theirs)) => Some(mine.merge_with(theirs).map_err(FleetFault::new)?),
            (mine, theirs) => mine.or_else(|| theirs.clone()),
        };
        self.recordings += other.recordings;
        self.samples += other.samples;
        self.seconds += other.seconds;
        self.all_columns.merge(&other.all_columns);
        self.within = self.within.max(other.within);
        for (mine, theirs) in self
            .residual_squares
            .iter_mut()
            .zip(&other.residual_squares)
        {
            *mine += theirs;
        }
        self.sensors.extend(other.sensors.iter().cloned());
        self.sensors
            .sort_by(|a, b| (&a.recording, &a.of).cmp(&(&b.recording, &b.of)));
        self.remarks.extend(other.remarks.iter().cloned());
        self.remarks.sort();
        self.bad.extend(other.bad.iter().cloned());
        self.bad.sort();
        Ok(())
    }

    /// What the recordings' own parameters leave of the force of a drive, as a part of it: the effective value over all samples.
    pub fn residual_share(&self, drive: usize) -> f64 {
        let squares = self.residual_squares.get(drive).copied().unwrap_or(0.0);
        (squares / (self.samples as f64).max(1.0)).sqrt()
    }

    /// The summary as bytes; what [`FleetSummary::from_bytes`] reads of them has the same bytes again.
    pub fn bytes(&self) -> Vec<u8> {
        let mut to = SummaryWriter::default();
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

    /// Reads what [`FleetSummary::bytes`] wrote.
    ///
    /// Fails where bytes are missing or were changed, and where another version wrote them.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FleetFault> {
        let what = "a summary";
        if !bytes.starts_with(BEGIN) {
            return Err(FleetFault::new(
                "these bytes are no summary of recordings; give what `modelmill_summarise` or `summarise` made",
            ));
        }
        let mut from = SummaryReader::new(bytes, what)?;
        let _: [u8; 4] = from.array()?;
        let version = from.integer()?;
        if version != VERSION {
            return Err(FleetFault::new(format!(
                "this summary is of version {version}, and this program knows version {VERSION}; summarise the recordings again"
            )));
        }
        let mark = from.integer()?;
        let recordings = from.integer()?;
        let samples = from.integer()?;
        let seconds = from.float()?;
        let columns = from.size()?;
        // A column costs bytes only where it is not zero; no model has more than this.
        if columns > 100_000 {
            return Err(FleetFault::new(format!(
                "{what} claims {columns} columns, which no model has; make it again"
            )));
        }
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
