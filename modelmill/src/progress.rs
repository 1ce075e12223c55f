//! Progress and cancellation: whoever starts a verb hears what goes on, and may stop it.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use modelmill_identify::RecordingNote;

use crate::error::{Error, Outcome};

/// What a caller wants to hear while a verb works. All methods do nothing unless they are written.
pub trait ProgressListener: Send + Sync {
    /// A job begins. `total` counts its steps; 0 if nobody knows how many there are. `job` lives until the job ends, so
    /// that a watcher may look at it whenever it likes.
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        let _ = (what, total, job);
    }

    /// The last job that began ends, whether it succeeded or not.
    fn on_job_end(&self) {}

    /// A remark that comes up on the way. The verb's result holds it as well.
    fn on_note(&self, note: &RecordingNote) {
        let _ = note;
    }
}

/// Nobody listens.
#[derive(Clone, Copy, Debug, Default)]
pub struct SilentProgress;

impl ProgressListener for SilentProgress {}

/// A job that goes on: how far it has come, and whether it is to stop.
#[derive(Debug, Default)]
pub struct JobHandle {
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl JobHandle {
    /// Steps that are done.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Asks the job to stop; it ends with [`Error::Cancelled`] at its next step.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked the job to stop.
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }

    /// Counts some more steps.
    pub fn add(&self, steps: usize) {
        self.done.fetch_add(steps as u64, Ordering::Relaxed);
    }

    /// Counts some more steps, and says whether to go on.
    pub fn flow(&self, steps: usize) -> ControlFlow<()> {
        match self.step(steps) {
            Ok(()) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        }
    }

    /// Counts some more steps.
    ///
    /// Fails with [`Error::Cancelled`] once somebody asked the job to stop.
    pub fn step(&self, steps: usize) -> Outcome {
        self.add(steps);
        if self.is_cancelled() {
            return Err(Error::Cancelled);
        }
        Ok(())
    }
}

/// Ends a job when it goes out of scope, also by an early return.
struct JobGuard<'a>(&'a dyn ProgressListener);

impl Drop for JobGuard<'_> {
    fn drop(&mut self) {
        self.0.on_job_end();
    }
}

/// Runs a job while `progress` watches it.
///
/// Fails with [`Error::Cancelled`] if somebody asked it to stop, whatever it found until then.
pub(crate) fn run_job<T>(
    progress: &dyn ProgressListener,
    what: &str,
    total: usize,
    work: impl FnOnce(&JobHandle) -> T,
) -> Outcome<T> {
    let job = Arc::new(JobHandle::default());
    progress.on_job_start(what, total, &job);
    let ending = JobGuard(progress);
    if job.is_cancelled() {
        return Err(Error::Cancelled);
    }
    let found = work(&job);
    drop(ending);
    if job.is_cancelled() {
        return Err(Error::Cancelled);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// Writes down what it hears, and stops the jobs whose names it knows.
    #[derive(Default)]
    struct Listener {
        heard: Mutex<Vec<String>>,
        stops: &'static str,
    }

    impl ProgressListener for Listener {
        fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
            self.heard.lock().unwrap().push(format!("{what} {total}"));
            if what == self.stops {
                job.cancel();
            }
        }

        fn on_job_end(&self) {
            self.heard.lock().unwrap().push("end".to_owned());
        }
    }

    #[test]
    fn a_job_that_is_cancelled_ends_with_an_error_and_is_told_to_end() {
        let listener = Listener {
            stops: "long",
            ..Listener::default()
        };
        assert!(matches!(
            run_job(&listener, "short", 2, JobHandle::done),
            Ok(0)
        ));
        let found = run_job(&listener, "long", 0, |_| unreachable!("it was cancelled"));
        assert!(matches!(found, Err::<(), _>(Error::Cancelled)));
        assert_eq!(
            *listener.heard.lock().unwrap(),
            ["short 2", "end", "long 0", "end"]
        );
    }
}
