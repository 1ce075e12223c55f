//! Progress and cancellation: the caller of a method receives the name and progress of each job, and can stop it.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use modelmill_identify::RecordingNote;

use crate::error::{Error, Outcome};

/// Receives progress and notes of a method. All methods have empty default implementations.
pub trait ProgressListener: Send + Sync {
    /// A job starts. `what` is its name, `total` its number of steps, 0 if that is unknown. A listener may keep a clone
    /// of `job` to read the progress or cancel the job later.
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        let _ = (what, total, job);
    }

    /// The job that started last has ended, with or without success.
    fn on_job_end(&self) {}

    /// A note was issued. The result of the method contains it as well.
    fn on_note(&self, note: &RecordingNote) {
        let _ = note;
    }
}

/// A listener that ignores everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct SilentProgress;

impl ProgressListener for SilentProgress {}

/// A listener that receives the jobs of another one, and no notes: those of models that repeat another model.
pub(crate) struct ProgressWithoutNotes(pub(crate) Arc<dyn ProgressListener>);

impl ProgressListener for ProgressWithoutNotes {
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        self.0.on_job_start(what, total, job);
    }

    fn on_job_end(&self) {
        self.0.on_job_end();
    }
}

/// A running job: its progress, and whether it has been cancelled. Shared between the job and its listener.
#[derive(Debug, Default)]
pub struct JobHandle {
    /// Finished steps.
    done: AtomicU64,
    is_cancelled: AtomicBool,
    /// When the job ends by itself.
    deadline: Option<Instant>,
}

impl JobHandle {
    /// Number of finished steps.
    pub fn done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Requests that the job stop; it ends with [`Error::Cancelled`] at its next step.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the job has been requested to stop, or its time is over.
    pub fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed) || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Adds finished steps.
    pub fn add(&self, steps: usize) {
        self.done.fetch_add(steps as u64, Ordering::Relaxed);
    }

    /// Adds finished steps, and returns whether to continue.
    pub fn flow(&self, steps: usize) -> ControlFlow<()> {
        match self.step(steps) {
            Ok(()) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        }
    }

    /// Adds finished steps.
    ///
    /// Fails with [`Error::Cancelled`] once the job has been requested to stop, or its time is over.
    pub fn step(&self, steps: usize) -> Outcome {
        self.add(steps);
        if self.is_cancelled() {
            return Err(Error::Cancelled);
        }
        Ok(())
    }
}

/// Reports the end of a job when it goes out of scope, also after an early return or a panic.
struct JobGuard<'a>(&'a dyn ProgressListener);

impl Drop for JobGuard<'_> {
    fn drop(&mut self) {
        self.0.on_job_end();
    }
}

/// Runs a job that `progress` observes, until `deadline` if there is one.
///
/// Fails with [`Error::Cancelled`] if the job was requested to stop or its time is over, even if it has a result.
pub(crate) fn run_job<T>(
    progress: &dyn ProgressListener,
    deadline: Option<Instant>,
    what: &str,
    total: usize,
    work: impl FnOnce(&JobHandle) -> T,
) -> Outcome<T> {
    let job = Arc::new(JobHandle {
        deadline,
        ..JobHandle::default()
    });
    progress.on_job_start(what, total, &job);
    let ending = JobGuard(progress);
    // A listener may cancel the job as soon as it starts.
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

        fn on_note(&self, note: &RecordingNote) {
            self.heard.lock().unwrap().push(format!("{note:?}"));
        }
    }

    #[test]
    fn a_job_that_is_cancelled_ends_with_an_error_and_is_told_to_end() {
        let listener = Listener {
            stops: "long",
            ..Listener::default()
        };
        assert!(matches!(run_job(&listener, None, "short", 2, JobHandle::done), Ok(0)));
        let found = run_job(&listener, None, "long", 0, |_| unreachable!("it was cancelled"));
        assert!(matches!(found, Err::<(), _>(Error::Cancelled)));
        assert_eq!(*listener.heard.lock().unwrap(), ["short 2", "end", "long 0", "end"]);
    }

    /// A second model whose notes repeat those of the first one is still seen to be derived, and can be stopped.
    #[test]
    fn jobs_without_notes_reach_the_listener_and_can_be_cancelled() {
        let listener = Arc::new(Listener {
            stops: "deriving",
            ..Listener::default()
        });
        let quiet = ProgressWithoutNotes(Arc::clone(&listener) as Arc<_>);
        quiet.on_note(&RecordingNote::warning("again"));
        let found = run_job(&quiet, None, "deriving", 0, |_| unreachable!("it was cancelled"));
        assert!(matches!(found, Err::<(), _>(Error::Cancelled)));
        assert_eq!(*listener.heard.lock().unwrap(), ["deriving 0", "end"]);
    }

    #[test]
    fn a_job_ends_with_an_error_once_its_time_is_over() {
        let listener = Listener::default();
        let now = Some(Instant::now());
        let found = run_job(&listener, now, "late", 0, |_| unreachable!("its time is over"));
        assert!(matches!(found, Err::<(), _>(Error::Cancelled)));
        let soon = Some(Instant::now() + std::time::Duration::from_millis(20));
        let found = run_job(&listener, soon, "endless", 0, |job| while job.step(1).is_ok() {});
        assert!(matches!(found, Err(Error::Cancelled)));
    }
}
