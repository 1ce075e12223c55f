//! Formats that this build does not read, because their Cargo feature is off: files are recognised and refused by name.

use crate::recording::error::RecordingFault;
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo};
use crate::recording::{ReadOptions, SignalRecording};

/// A format whose feature is off.
pub(crate) struct DisabledFormat {
    /// Name in messages, with its article.
    name: &'static str,
    /// Extensions of such files, without the point.
    extensions: &'static [&'static str],
    /// First bytes of such files, any of these.
    signatures: &'static [&'static [u8]],
    /// The feature that switches it on.
    feature: &'static str,
}

#[cfg(not(feature = "parquet"))]
pub(crate) const PARQUET: DisabledFormat = DisabledFormat {
    name: "a Parquet file",
    extensions: &["parquet", "pq"],
    signatures: &[b"PAR1"],
    feature: "parquet",
};

#[cfg(not(feature = "hdf5"))]
pub(crate) const HDF5: DisabledFormat = DisabledFormat {
    name: "an HDF5 file",
    extensions: &["h5", "hdf5", "hdf"],
    signatures: &[b"MATLAB 7.3 MAT-file", b"\x89HDF"],
    feature: "hdf5",
};

#[cfg(not(feature = "logs"))]
pub(crate) const MCAP: DisabledFormat = DisabledFormat {
    name: "an MCAP file",
    extensions: &["mcap"],
    signatures: &[b"\x89MCAP0\r\n"],
    feature: "logs",
};

#[cfg(not(feature = "logs"))]
pub(crate) const ROSBAG2: DisabledFormat = DisabledFormat {
    name: "a rosbag2 file",
    extensions: &["db3"],
    signatures: &[b"SQLite format 3\0"],
    feature: "logs",
};

#[cfg(not(feature = "logs"))]
pub(crate) const ROSBAG1: DisabledFormat = DisabledFormat {
    name: "a bag of ROS 1",
    extensions: &["bag"],
    signatures: &[b"#ROSBAG V"],
    feature: "logs",
};

impl DisabledFormat {
    fn fault(&self) -> RecordingFault {
        RecordingFault::Format {
            format: self.name,
            message: format!(
                "this build does not read such files; build it with the Cargo feature `{}`, or convert the file to CSV",
                self.feature
            ),
        }
    }
}

impl RecordingFormat for DisabledFormat {
    fn extensions(&self) -> &'static [&'static str] {
        self.extensions
    }

    fn has_signature(&self, first: &[u8]) -> bool {
        self.signatures.iter().any(|signature| first.starts_with(signature))
    }

    fn read(&self, _: RecordingInput<'_>, _: &str, _: &ReadOptions) -> Result<SignalRecording, RecordingFault> {
        Err(self.fault())
    }

    fn names(&self, _: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        Err(self.fault())
    }

    fn tables(&self, _: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        Err(self.fault())
    }
}
