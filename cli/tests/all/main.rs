//! The program as its users meet it: every command run as a process of its own, its text, its JSON and its files.
//!
//! One target for all of them, since each target links the whole program anew.

mod advice_in_sources;
mod atlas;
#[cfg(target_os = "linux")]
mod bombs;
#[cfg(unix)]
mod boundary;
mod cloos;
mod columns;
mod common;
mod completed;
mod damaged_recordings;
mod diagnose;
mod diagnose_harsh;
mod diagnose_made;
mod doctor;
mod effects;
mod emps;
mod estimators;
mod excite;
mod excited_rig;
mod experiment;
mod export;
mod faulty_recordings;
mod figures;
mod formats;
mod guide;
mod hidden_cases;
#[cfg(unix)]
mod hostile;
mod in_browser;
mod interpret;
mod json;
mod languages;
mod measured;
mod next_step;
mod pages;
mod pictures;
mod plausible;
mod preparation;
mod recordings;
mod reduce;
mod remedies;
mod report;
mod runs;
mod separate;
mod simulate;
mod skills;
mod sound;
mod time_limit;
mod tx40;
mod usage;
mod variants;
mod verify;
mod weights;
mod work;
mod work_truth;
#[cfg(target_os = "linux")]
mod write_faults;
