//! Folders of recordings: a folder goes in, its recordings by robot and day come out. The path of a file determines
//! both.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use modelmill::recording::has_recording_extension;

use crate::FleetFault;

/// A recording that is a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FleetFile {
    /// Its path below the folder, with `/`; its name in messages.
    pub name: String,
    /// The path to open.
    pub path: PathBuf,
    /// Its day, as the path states it.
    pub day: String,
    /// Name, size and time of change. A file that was written again thus counts as another recording.
    pub key: String,
}

/// Recordings below a folder by robot, each sorted by day and name.
///
/// Fails if the folder cannot be read, or has no recording, or a path names no robot.
pub fn robots(folder: &Path) -> Result<BTreeMap<String, Vec<FleetFile>>, FleetFault> {
    let mut paths = Vec::new();
    walk(folder, &mut paths)?;
    let mut found = Vec::new();
    for path in paths {
        let below = path.strip_prefix(folder).unwrap_or(&path);
        let parts: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
        // Size and time of change distinguish versions of a file.
        let about = fs::metadata(&path).map_err(|error| read_fault(&path, &error))?;
        let changed = about.modified().ok();
        let changed = changed.and_then(|at| at.duration_since(std::time::UNIX_EPOCH).ok());
        found.push(FolderEntry {
            name: parts.join("/"),
            version: format!("{} {}", about.len(), changed.map_or(0, |at| at.as_nanos())),
            path,
        });
    }
    group_by_robot(&folder.display(), found)
}

/// A file of a folder, or an object of a store.
#[derive(Clone, Debug)]
pub struct FolderEntry {
    /// Its path below the folder, with `/`.
    pub name: String,
    /// The path to open.
    pub path: PathBuf,
    /// A text that changes when the file is written again, such as its size and time.
    pub version: String,
}

/// Groups recordings by robot, each sorted by day and name. `folder` is the name of the place in messages. Files
/// without the ending of a recording are ignored.
///
/// Fails if there is no recording, or the path of one names no robot.
pub fn group_by_robot(
    folder: &dyn std::fmt::Display,
    found: impl IntoIterator<Item = FolderEntry>,
) -> Result<BTreeMap<String, Vec<FleetFile>>, FleetFault> {
    let mut robots: BTreeMap<String, Vec<FleetFile>> = BTreeMap::new();
    for one in found {
        if !has_recording_extension(&one.path) {
            continue;
        }
        let parts: Vec<String> = one.name.split('/').map(str::to_owned).collect();
        let Some((robot, day)) = robot_and_day(&parts) else {
            return Err(FleetFault::new(format!(
                "{folder}: the path of {} names no robot; put recordings into folders such as `robot=R1/day=2026-03-01`, or \
                 `R1/2026-03-01`",
                one.name
            )));
        };
        robots.entry(robot).or_default().push(FleetFile {
            key: format!("{} {}", one.name, one.version),
            name: one.name,
            path: one.path,
            day,
        });
    }
    if robots.is_empty() {
        return Err(FleetFault::new(format!(
            "{folder} has no recordings (Parquet, CSV, MATLAB, HDF5, MCAP); give the folder that contains those of the robots"
        )));
    }
    for files in robots.values_mut() {
        files.sort_by(|a, b| (&a.day, &a.name).cmp(&(&b.day, &b.name)));
    }
    Ok(robots)
}

/// The fault of a path that cannot be read.
fn read_fault(path: &Path, error: &std::io::Error) -> FleetFault {
    FleetFault::new(format!(
        "{} cannot be read: {error}; check the path and its permissions",
        path.display()
    ))
}

/// Adds all files below a folder to `found`, in the order of their names.
fn walk(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), FleetFault> {
    let entries = fs::read_dir(folder).map_err(|error| read_fault(folder, &error))?;
    let mut entries: Vec<PathBuf> = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()
        .map_err(|error| read_fault(folder, &error))?;
    entries.sort();
    for path in entries {
        if path.is_dir() {
            walk(&path, found)?;
        } else {
            found.push(path);
        }
    }
    Ok(())
}

/// Robot and day of a path: from `robot=` and `day=`, else from the first and the second folder, or from the date at
/// the start of the file name.
fn robot_and_day(parts: &[String]) -> Option<(String, String)> {
    let named = |key: &str| parts.iter().find_map(|part| part.strip_prefix(key).map(str::to_owned));
    if let (Some(robot), Some(day)) = (named("robot="), named("day=")) {
        return Some((robot, day));
    }
    // Otherwise folders have the names of robots, and days are folders or part of the file name.
    let (file, folders) = parts.split_last()?;
    let robot = folders.first()?.clone();
    let day = folders.get(1).cloned().unwrap_or_else(|| {
        let digits: String = file
            .chars()
            .take_while(|c| c.is_ascii_digit() || "-_".contains(*c))
            .take(10)
            .collect();
        let digits = digits.trim_matches(['-', '_']);
        if digits.is_empty() {
            Path::new(file)
                .file_stem()
                .map_or_else(|| file.clone(), |stem| stem.to_string_lossy().into_owned())
        } else {
            digits.to_owned()
        }
    });
    Some((robot, day))
}

/// Writes a file atomically: to a file next to it, which then replaces it. Fails if the folder cannot be written to.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FleetFault> {
    let beside = path.with_extension("part");
    let written = fs::write(&beside, bytes).and_then(|()| fs::rename(&beside, path));
    written.map_err(|error| {
        FleetFault::new(format!(
            "{} cannot be written: {error}; choose another place, or make room",
            path.display()
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::robot_and_day;

    #[track_caller]
    fn check(path: &str, expected: Option<(&str, &str)>) {
        let parts: Vec<String> = path.split('/').map(str::to_owned).collect();
        let expected = expected.map(|(robot, day)| (robot.to_owned(), day.to_owned()));
        assert_eq!(robot_and_day(&parts), expected);
    }

    #[test]
    fn a_path_names_robot_and_day() {
        check(
            "robot=R1/day=2026-03-01/recording=0/data.parquet",
            Some(("R1", "2026-03-01")),
        );
        check("site/robot=R1/day=3/x.csv", Some(("R1", "3")));
        check("R1/2026-03-01/a.csv", Some(("R1", "2026-03-01")));
        check("R1/2026-03-01_0815.csv", Some(("R1", "2026-03-01")));
        check("R1/20260301-early.parquet", Some(("R1", "20260301")));
        check("R1/monday.csv", Some(("R1", "monday")));
        check("a.csv", None);
    }
}
