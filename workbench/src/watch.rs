//! Watches the jobs of the library for a page: their names, their progress, and requests to cancel.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use modelmill::progress::{JobHandle, ProgressListener};
use serde_json::{Value, json};

use crate::surrounding_files::SessionEnvironment;

/// Watches the jobs of one diagnosis or search.
pub(crate) struct JobWatch {
    /// Receives the progress.
    surroundings: Arc<dyn SessionEnvironment>,
    /// The running jobs, outer ones first.
    jobs: Mutex<Vec<RunningJob>>,
    /// Counts the jobs that have started. Most jobs of a diagnosis do not count their steps, so this shows that it goes
    /// on.
    started: AtomicUsize,
    /// Whether the user cancelled; jobs that start later are cancelled at once.
    is_cancelled: AtomicBool,
}

/// A running job.
struct RunningJob {
    /// What the job does, in words.
    what: String,
    /// Number of its steps; 0 if unknown.
    total: usize,
    /// Its progress, and the switch that cancels it.
    job: Arc<JobHandle>,
}

impl JobWatch {
    /// A watch without jobs; `surroundings` gets the progress of each job.
    pub(crate) fn new(surroundings: Arc<dyn SessionEnvironment>) -> Self {
        Self {
            surroundings,
            jobs: Mutex::default(),
            started: AtomicUsize::default(),
            is_cancelled: AtomicBool::default(),
        }
    }

    /// Requests all jobs to stop, also those that have not started.
    pub(crate) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
        for going in self.jobs().iter() {
            going.job.cancel();
        }
    }

    /// View of the progress: of the outermost job that counts its steps, or else of the innermost one.
    pub(crate) fn progress_view(&self) -> Value {
        let jobs = self.jobs();
        let counting = jobs.iter().find(|going| going.total > 0);
        match counting.or(jobs.last()) {
            Some(going) => {
                let step = self.started.load(Ordering::Relaxed);
                json!({ "what": going.what, "done": going.job.done(), "total": going.total, "step": step })
            }
            None => json!({ "what": "starting", "done": 0, "total": 0 }),
        }
    }

    /// The running jobs; a panic of another thread does not lose them.
    fn jobs(&self) -> std::sync::MutexGuard<'_, Vec<RunningJob>> {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ProgressListener for JobWatch {
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        let mut jobs = self.jobs();
        if self.is_cancelled.load(Ordering::Relaxed) {
            job.cancel();
        }
        self.started.fetch_add(1, Ordering::Relaxed);
        jobs.push(RunningJob {
            what: what.to_owned(),
            total,
            job: Arc::clone(job),
        });
        drop(jobs);
        self.surroundings.report_progress(&self.progress_view());
    }

    fn on_job_end(&self) {
        self.jobs().pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory_store::MemoryStore;

    #[test]
    fn what_is_cancelled_stops_every_job() {
        let watch = JobWatch::new(Arc::new(MemoryStore::new(|| 0.0, |_| {})));
        let [outer, inner, later] = [(); 3].map(|()| Arc::new(JobHandle::default()));
        watch.on_job_start("searching", 10, &outer);
        watch.on_job_start("fitting", 0, &inner);
        outer.add(3);
        assert_eq!(
            watch.progress_view(),
            json!({ "what": "searching", "done": 3, "total": 10, "step": 2 })
        );
        watch.cancel();
        watch.on_job_end();
        watch.on_job_start("judging", 0, &later);
        assert!(outer.is_cancelled() && inner.is_cancelled() && later.is_cancelled());
    }
}
