//! Data sets of LeRobot: a folder with Parquet files and `meta/info.json`, which names the elements of their lists.
//!
//! Version 2 has one file for each episode (`data/chunk-000/episode_000000.parquet`), version 3 several episodes in one
//! file (`data/chunk-000/file-000.parquet`). All files of a folder are read as one recording with gaps of time between
//! its episodes, because each episode counts its time from zero.
//!
//! Decision: files are opened one at a time. Data sets of version 2 have thousands of files, and systems allow a process
//! some hundred open ones.

use std::fs::File;
use std::path::{Path, PathBuf};

use indexmap::IndexMap;
use modelmill_boundary::files::{FileError, FileSource, OpenFile, PathKind};
use serde_json::Value;

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::thresholds::EPISODE_GAP_STEPS;

/// Most bytes of the description of a data set.
const LONGEST_DESCRIPTION: u64 = 64 << 20;
/// Most folders between a file of samples and the folder of its data set.
const DEEPEST: usize = 3;
/// The description of a data set within its folder.
const DESCRIPTION: &str = "meta/info.json";
/// The column that numbers the episodes.
pub(super) const EPISODE: &str = "episode_index";
/// Columns that count the time within an episode, or over all episodes without gaps.
const CLOCKS: [(&str, f64); 3] = [("timestamp", 0.1), ("frame_index", 1.0), ("index", 1.0)];

/// Names of the elements of lists, by the name of their column.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct ElementNames(IndexMap<String, Vec<String>>);

/// The files of a data set, and the names in its description.
pub(crate) struct DataSetFiles {
    /// Paths of the files of samples, in the order of their names; at least one.
    pub(crate) paths: Vec<PathBuf>,
    /// Names of elements.
    pub(crate) names: ElementNames,
}

impl DataSetFiles {
    /// Finds the files of a data set from its folder, or from a single file in it; `None` if the path leads to anything
    /// else.
    ///
    /// Fails when the description is not valid, or a file cannot be opened.
    pub(crate) fn open(files: &dyn FileSource, path: &Path) -> Result<Option<Self>, RecordingFault> {
        let is_folder = files.kind(path) == PathKind::Folder;
        let folder = if is_folder {
            path.to_owned()
        } else {
            let is_parquet = |extension: &std::ffi::OsStr| extension == "parquet" || extension == "pq";
            if !path.extension().is_some_and(is_parquet) {
                return Ok(None);
            }
            let mut above = path.ancestors().skip(1).take(DEEPEST);
            let Some(folder) = above.find(|folder| files.kind(&folder.join(DESCRIPTION)) == PathKind::File) else {
                return Ok(None);
            };
            folder.to_owned()
        };
        let description = folder.join(DESCRIPTION);
        if files.kind(&description) != PathKind::File {
            return Ok(None);
        }
        let text = files.read(&description, LONGEST_DESCRIPTION);
        let text = text.map_err(|error| description_fault(&description, &error.fault.to_string()))?;
        let Some(names) = ElementNames::parse(&text).map_err(|says| description_fault(&description, &says))? else {
            return Ok(None);
        };
        let paths = if is_folder {
            sample_files(files, &folder)?
        } else {
            vec![path.to_owned()]
        };
        // Each file is opened once and closed again: faults are reported early, and the source of files knows what is read.
        for path in &paths {
            match files.open(path, 0) {
                Ok(OpenFile::File(_)) => {}
                // Files in memory have no folder around them.
                Ok(OpenFile::Memory(_)) => return Ok(None),
                Err(error) => return Err(unreadable_file(&error)),
            }
        }
        Ok(Some(Self { paths, names }))
    }

    /// Opens the file at a position. Fails when it cannot be opened any more.
    pub(super) fn open_file(&self, place: usize) -> Result<File, RecordingFault> {
        let path = &self.paths[place];
        File::open(path).map_err(|error| unreadable_file(&FileError::from_io_error(path, &error)))
    }
}

/// The fault of a file of a data set that cannot be opened.
fn unreadable_file(error: &FileError) -> RecordingFault {
    RecordingFault::Unreadable {
        reason: format!("{}: {}", error.path.display(), error.fault),
    }
}

/// The files of samples in a data set, in the order of their names.
fn sample_files(files: &dyn FileSource, folder: &Path) -> Result<Vec<PathBuf>, RecordingFault> {
    let fault = |says: String| RecordingFault::Format {
        format: "the folder of a LeRobot data set",
        message: says,
    };
    let list = |folder: &Path| files.list(folder).map_err(|error| fault(error.fault.to_string()));
    let mut found = Vec::new();
    for chunk in list(&folder.join("data"))? {
        if files.kind(&chunk) == PathKind::Folder {
            let inside = list(&chunk)?;
            found.extend(
                inside
                    .into_iter()
                    .filter(|path| path.extension().is_some_and(|e| e == "parquet")),
            );
        }
    }
    if found.is_empty() {
        return Err(fault(
            "it has no files such as `data/chunk-000/episode_000000.parquet`; copy the data of the set as well"
                .to_owned(),
        ));
    }
    Ok(found)
}

/// The fault of a description that cannot be used.
fn description_fault(path: &Path, says: &str) -> RecordingFault {
    RecordingFault::Format {
        format: "part of a LeRobot data set",
        message: format!(
            "its description {} cannot be read: {says}; repair it, because it names the elements of lists",
            path.display()
        ),
    }
}

impl ElementNames {
    /// The names in a description; `None` if it describes something else. Fails when it is no JSON.
    fn parse(text: &[u8]) -> Result<Option<Self>, String> {
        let value: Value = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        let Some(features) = value.get("features").and_then(Value::as_object) else {
            return Ok(None);
        };
        let named = features.iter().filter_map(|(column, feature)| {
            let names = element_names(feature.get("names")?)?;
            Some((column.clone(), names))
        });
        Ok(Some(Self(named.collect())))
    }

    /// Names of the elements of a column with lists of this length, if they are known and differ.
    pub(super) fn names_of(&self, column: &str, width: usize) -> Option<&[String]> {
        let names = self.0.get(column)?;
        let differ = (0..names.len()).all(|i| !names[i].is_empty() && !names[..i].contains(&names[i]));
        (names.len() == width && differ).then_some(names.as_slice())
    }
}

/// Names in one of the forms that versions of LeRobot wrote: a list, a list below one key, or positions by name.
fn element_names(value: &Value) -> Option<Vec<String>> {
    match value {
        Value::Array(names) => names.iter().map(|name| Some(name.as_str()?.to_owned())).collect(),
        Value::Object(map) => {
            let positions: Option<Vec<(u64, &String)>> =
                map.iter().map(|(name, place)| Some((place.as_u64()?, name))).collect();
            if let Some(mut positions) = positions {
                positions.sort_unstable();
                return Some(positions.into_iter().map(|(_, name)| name.clone()).collect());
            }
            let mut values = map.values();
            let inner = values.next()?;
            // Several groups have no order among each other.
            if values.next().is_some() {
                None
            } else {
                element_names(inner)
            }
        }
        _ => None,
    }
}

/// Moves the times of later episodes behind those of earlier ones.
pub(super) struct EpisodeClock {
    /// Position of the column of episodes.
    episode: usize,
    /// The columns that count the time.
    clocks: Vec<ClockColumn>,
    /// The current episode.
    current: Option<f64>,
    /// Number of episodes so far.
    pub(super) episodes: usize,
}

/// A column that counts the time.
struct ClockColumn {
    /// Its position.
    place: usize,
    /// The last time, after the shift.
    last: Option<f64>,
    /// The last step of time.
    step: f64,
    /// The shift of the current episode.
    shift: f64,
}

impl EpisodeClock {
    /// A clock for a file with these columns; `None` if it has no episodes.
    pub(super) fn new(names: &[String]) -> Option<Self> {
        let place = |wanted: &str| names.iter().position(|name| name == wanted);
        let clocks = CLOCKS.iter().filter_map(|(name, step)| {
            Some(ClockColumn {
                place: place(name)?,
                last: None,
                step: *step,
                shift: 0.0,
            })
        });
        Some(Self {
            episode: place(EPISODE)?,
            clocks: clocks.collect(),
            current: None,
            episodes: 0,
        })
    }

    /// Position of the column of episodes, which must be read.
    pub(super) fn place(&self) -> usize {
        self.episode
    }

    /// Shifts the times of a sample; true if it begins another episode than the first.
    pub(super) fn shift_sample(&mut self, sample: &mut [SampleField]) -> bool {
        let SampleField::Number(episode) = sample[self.episode] else {
            return false;
        };
        let begins = self.current.is_none_or(|current| current.total_cmp(&episode).is_ne());
        let is_later = begins && self.current.is_some();
        self.current = Some(episode);
        self.episodes += usize::from(begins);
        for clock in &mut self.clocks {
            let SampleField::Number(time) = sample[clock.place] else {
                continue;
            };
            if let (true, Some(last)) = (is_later, clock.last) {
                clock.shift = last + EPISODE_GAP_STEPS as f64 * clock.step - time;
            }
            let shifted = time + clock.shift;
            if let (false, Some(last)) = (begins, clock.last)
                && shifted > last
            {
                clock.step = shifted - last;
            }
            clock.last = Some(shifted);
            sample[clock.place] = SampleField::Number(shifted);
        }
        is_later
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::path::Path;
    use std::process::Command;

    use modelmill_boundary::files::DiskFiles;

    use crate::{ReadOptions, RecordingFile};

    /// The variable by which the test calls itself with few handles; its value is the folder.
    const FOLDER: &str = "MODELMILL_TEST_OF_HANDLES";

    #[test]
    fn data_sets_may_have_more_files_than_a_process_may_open() {
        const FILES: usize = 80;
        if let Some(folder) = std::env::var_os(FOLDER) {
            let set = RecordingFile::open(&DiskFiles::default(), Path::new(&folder)).unwrap();
            assert_eq!(set.tables().unwrap()[0].samples, 25 * FILES);
            let read = set.read(&ReadOptions::single_column("timestamp")).unwrap();
            assert_eq!(read.samples(), 25 * FILES);
            return;
        }
        let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/readers/lerobot-v2");
        let folder = std::env::temp_dir().join(format!("modelmill-handles-{}", std::process::id()));
        let chunk = folder.join("data/chunk-000");
        std::fs::create_dir_all(&chunk).unwrap();
        std::fs::create_dir_all(folder.join("meta")).unwrap();
        std::fs::copy(fixtures.join("meta/info.json"), folder.join("meta/info.json")).unwrap();
        for k in 0..FILES {
            let episode = fixtures.join("data/chunk-000/episode_000000.parquet");
            std::fs::copy(episode, chunk.join(format!("episode_{k:06}.parquet"))).unwrap();
        }
        let (_, module) = module_path!().split_once("::").unwrap();
        let child = Command::new("sh")
            .args(["-c", "ulimit -n 48 && exec \"$0\" --exact \"$1\""])
            .arg(std::env::current_exe().unwrap())
            .arg(format!(
                "{module}::data_sets_may_have_more_files_than_a_process_may_open"
            ))
            .env(FOLDER, &folder)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&child.stdout).into_owned();
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(child.status.success() && text.contains("1 passed"), "{text}");
    }
}
