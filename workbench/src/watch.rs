//! A job of the library as the page sees it: what goes on, how far it is, and that it is to stop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use modelmill::progress::{JobHandle, ProgressListener};
use serde_json::{Value, json};

use crate::surroundings::SessionEnvironment;

/// Watches the jobs of one verb.
pub(crate) struct JobWatch {
    surroundings: Arc<dyn SessionEnvironment>,
    jobs: Mutex<Vec<RunningJob>>,
    is_cancelled: AtomicBool,
}

/// A job that goes on.
struct RunningJob {
    what: String,
    total: usize,
    job: Arc<JobHandle>,
}

impl JobWatch {
    /// Nothing goes on yet; the surroundings hear of every job.
    pub(crate) fn new(surroundings: Arc<dyn SessionEnvironment>) -> Self {
        Self {
            surroundings,
            jobs: Mutex::default(),
            is_cancelled: AtomicBool::default(),
        }
    }

    /// Asks all jobs to stop, those too that have not begun.
    pub(crate) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
        for going in self.jobs().iter() {
            going.job.cancel();
        }
    }

    /// What goes on: the outermost job that counts its steps, or else the innermost one.
    pub(crate) fn progress_view(&self) -> Value {
        let jobs = self.jobs();
        let counting = jobs.iter().find(|going| going.total > 0);
        match counting.or(jobs.last()) {
            Some(going) => {
                json!({ "what": going.what, "done": going.job.done(), "total": going.total })
            }
            None => json!({ "what": "beginning", "done": 0, "total": 0 }),
        }
    }

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
    use crate::shelf::MemoryStore;

    #[test]
    fn what_is_cancelled_stops_every_job() {
        let watch = JobWatch::new(Arc::new(MemoryStore::new(|| 0.0, |_| {})));
        let [outer, inner, later] = [(); 3].map(|()| Arc::new(JobHandle::default()));
        watch.on_job_start("searching", 10, &outer);
        watch.on_job_start("fitting", 0, &inner);
        outer.add(3);
        assert_eq!(
            watch.progress_view(),
            json!({ "what": "searching", "done": 3, "total": 10 })
        );
        watch.cancel();
        watch.on_job_end();
        watch.on_job_start("judging", 0, &later);
        assert!(outer.is_cancelled() && inner.is_cancelled() && later.is_cancelled());
    }
}
