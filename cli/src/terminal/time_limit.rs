//! `--time-limit`: ends the program with a message and an exit status of its own once its time is over.
//!
//! Some stages of a derivation are single computations of minutes, which cannot stop between steps. Therefore the program
//! ends as a whole, from a thread that waits. A write that has begun is finished first, so that a file is complete or
//! unchanged.

use std::process;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use modelmill::RecordingNote;
use modelmill::progress::{JobHandle, ProgressListener};

use crate::terminal;

/// Exit status of a program whose time is over.
const TIME_IS_OVER: i32 = 3;

/// Held while a command writes files.
static FILES: Mutex<()> = Mutex::new(());

/// Names of the running jobs, outer jobs first.
type JobNames = Arc<Mutex<Vec<String>>>;

/// Keeps the program from ending while files are written.
pub(crate) fn begin_write() -> MutexGuard<'static, ()> {
    FILES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Seconds of a time limit. Fails with what was expected.
pub(crate) fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| *seconds > 0.0);
    seconds
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .ok_or_else(|| "expected a positive number of seconds".to_owned())
}

/// A listener that knows which job runs when the time is over, and passes everything on.
pub(crate) struct TimeLimit {
    inner: Arc<dyn ProgressListener>,
    names: JobNames,
}

impl TimeLimit {
    /// Starts the clock.
    pub(crate) fn start(limit: Duration, inner: Arc<dyn ProgressListener>) -> Self {
        let names = JobNames::default();
        let running = Arc::clone(&names);
        thread::spawn(move || {
            thread::sleep(limit);
            end_program(limit, &running);
        });
        Self { inner, names }
    }
}

/// Prints what was running, and ends the program.
fn end_program(limit: Duration, running: &JobNames) {
    let _finished = begin_write();
    let names = running.lock().unwrap_or_else(PoisonError::into_inner);
    let during = names.last().map_or_else(String::new, |name| format!(" while {name}"));
    terminal::error(&format!(
        "the time limit of {} s was reached{during}; the result is not complete, and files that are not written yet keep \
         their old contents; allow more time with `--time-limit`",
        limit.as_secs_f64()
    ));
    process::exit(TIME_IS_OVER);
}

impl ProgressListener for TimeLimit {
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        let mut names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        names.push(what.to_owned());
        drop(names);
        self.inner.on_job_start(what, total, job);
    }

    fn on_job_end(&self) {
        self.inner.on_job_end();
        self.names.lock().unwrap_or_else(PoisonError::into_inner).pop();
    }

    fn on_note(&self, note: &RecordingNote) {
        self.inner.on_note(note);
    }
}
