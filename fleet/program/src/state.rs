//! Stored summaries, next to the results: one file per robot, to which the summary of each recording is appended at
//! once. A job that is killed leaves at most an incomplete entry, which is cut off.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use modelmill_fleet::{FleetFault, FleetSummary};

/// The file with the summaries of a robot.
pub(crate) struct SummaryStore {
    /// Its path.
    path: PathBuf,
    /// The file, open for appending.
    file: Mutex<File>,
}

impl SummaryStore {
    /// Opens the file of a robot. Returns its summaries by the keys of their recordings; those of another plan are
    /// ignored.
    pub(crate) fn open(
        folder: &Path,
        robot: &str,
        mark: u64,
    ) -> Result<(Self, HashMap<String, FleetSummary>), FleetFault> {
        // A file name that is valid on all systems.
        let name: String = robot
            .chars()
            .map(|c| {
                if c.is_alphanumeric() || "-_.".contains(c) {
                    c
                } else {
                    '_'
                }
            })
            .collect();
        // Different names may give the same file name; a checksum distinguishes them.
        let number = robot
            .bytes()
            .fold(0_u32, |n, b| n.wrapping_mul(31).wrapping_add(u32::from(b)));
        let path = folder.join(format!("{name}-{number:08x}.sums"));
        let fault = |error: std::io::Error| {
            FleetFault::new(format!(
                "{} cannot be opened or written: {error}; choose another folder, or free disk space",
                path.display()
            ))
        };
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(fault(error)),
        };
        let mut kept = HashMap::new();
        // The file is valid up to here; the rest is an incomplete entry.
        let mut sound = 0;
        while let Some((key, summary, end)) = entry(&bytes, sound) {
            if summary.mark == mark {
                kept.insert(key, summary);
            }
            sound = end;
        }
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .map_err(fault)?;
        // Remove the incomplete entry.
        if sound < bytes.len() {
            file.set_len(sound as u64).map_err(fault)?;
        }
        let file = Mutex::new(file);
        Ok((Self { path, file }, kept))
    }

    /// Appends the summary of a recording.
    pub(crate) fn append(&self, key: &str, summary: &FleetSummary) -> Result<(), FleetFault> {
        // Length and bytes of the key, then of the summary, written together.
        let bytes = summary.bytes();
        let mut entry = Vec::with_capacity(key.len() + bytes.len() + 16);
        for part in [key.as_bytes(), &bytes] {
            entry.extend_from_slice(&(part.len() as u64).to_le_bytes());
            entry.extend_from_slice(part);
        }
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(&entry).map_err(|error| {
            FleetFault::new(format!(
                "{} cannot be written: {error}; free disk space and start again; the job continues where it stopped",
                self.path.display()
            ))
        })
    }
}

/// Key and summary of the entry at a position, and the position of its end; `None` if there is none or it is
/// incomplete.
fn entry(bytes: &[u8], at: usize) -> Option<(String, FleetSummary, usize)> {
    let part = |at: usize| -> Option<(&[u8], usize)> {
        // A length of eight bytes, then the bytes themselves.
        let length = bytes.get(at..at.checked_add(8)?)?;
        let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
        let end = (at + 8).checked_add(length)?;
        Some((bytes.get(at + 8..end)?, end))
    };
    let (key, end) = part(at)?;
    let (summary, end) = part(end)?;
    let key = String::from_utf8(key.to_vec()).ok()?;
    Some((key, FleetSummary::from_bytes(summary).ok()?, end))
}
