//! Runs long work in a separate thread: the interpreter lock is released, an interrupt stops the work, progress is
//! reported, and a panic becomes an exception.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use modelmill::Outcome;
use modelmill::progress::{JobHandle, ProgressListener};
use pyo3::prelude::*;

use crate::errors::{input_error, library_error};

/// Interval at which interrupts are checked and progress is reported.
const TICK: Duration = Duration::from_millis(50);

/// Listens to the running jobs of a model, and cancels them on request.
#[derive(Default)]
pub(crate) struct JobListener(Mutex<ListenerState>);

/// The state of a listener.
#[derive(Default)]
struct ListenerState {
    /// Running jobs, the last one started last: name, number of steps, handle.
    jobs: Vec<(String, usize, Arc<JobHandle>)>,
    /// Whether jobs are cancelled, also those that start later.
    stops: bool,
}

impl ProgressListener for JobListener {
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        let mut heard = self.lock_state();
        if heard.stops {
            job.cancel();
        }
        heard.jobs.push((what.to_owned(), total, Arc::clone(job)));
    }

    fn on_job_end(&self) {
        self.lock_state().jobs.pop();
    }
}

impl JobListener {
    /// Access to the state.
    fn lock_state(&self) -> MutexGuard<'_, ListenerState> {
        // A panic of another thread leaves a valid list of jobs.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Cancels all jobs, also those that start later.
    fn stop(&self) {
        let mut heard = self.lock_state();
        heard.stops = true;
        for (_, _, job) in &heard.jobs {
            job.cancel();
        }
    }

    /// Forgets all jobs and permits new ones.
    fn reset(&self) {
        *self.lock_state() = ListenerState::default();
    }

    /// The job that started last: its name, steps done, number of steps (0 if unknown).
    fn current_job(&self) -> Option<(String, u64, usize)> {
        let heard = self.lock_state();
        let (what, total, job) = heard.jobs.last()?;
        Some((what.clone(), job.done(), *total))
    }
}

/// Runs work in a separate thread, while this one checks for interrupts and reports progress by `progress(what, done,
/// total)`.
pub(crate) fn run_interruptible<T: Send>(
    py: Python<'_>,
    listener: &JobListener,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> Outcome<T> + Send,
) -> PyResult<T> {
    let (sender, mut receiver) = channel::<()>();
    let (found, stopped) = thread::scope(|scope| {
        // The work runs in another thread.
        let worker = scope.spawn(move || {
            // Dropped when the work ends, also by a panic; this wakes the waiting thread.
            let _ends = sender;
            work()
        });
        let mut stopped: Option<PyErr> = None;
        loop {
            let receiver = &mut receiver;
            let Err(RecvTimeoutError::Timeout) = py.detach(move || receiver.recv_timeout(TICK)) else {
                break;
            };
            // Progress is reported until the work is stopped.
            let told = match (progress, listener.current_job()) {
                (Some(progress), Some(now)) if stopped.is_none() => progress.call1(now).map(|_| ()),
                _ => Ok(()),
            };
            if let Err(error) = told.and_then(|()| py.check_signals()) {
                listener.stop();
                stopped.get_or_insert(error);
            }
        }
        (worker.join(), stopped)
    });
    // The next call must not be cancelled.
    if stopped.is_some() {
        listener.reset();
    }
    match (stopped, found) {
        (Some(error), _) => Err(error),
        (None, Ok(found)) => found.map_err(|error| library_error(py, &error)),
        (None, Err(panic)) => Err(panic_error(py, &*panic)),
    }
}

/// Runs short work in this thread.
pub(crate) fn run_blocking<T: Send>(py: Python<'_>, work: impl FnOnce() -> Outcome<T> + Send) -> PyResult<T> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(found) => found.map_err(|error| library_error(py, &error)),
        Err(panic) => Err(panic_error(py, &*panic)),
    }
}

/// The exception for a panic, which is a defect of the library.
fn panic_error(py: Python<'_>, panic: &(dyn Any + Send)) -> PyErr {
    let said = panic.downcast_ref::<&str>().copied();
    let said = said.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    let says = format!(
        "internal error of modelmill: {}. Please report it with the model file and the call.",
        said.unwrap_or("no message")
    );
    input_error(py, &says)
}
