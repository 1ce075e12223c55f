//! A job of the library as the page sees it: what goes on, how far it is, and that it is to stop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use modelmill::progress::{Job, Progress};
use serde_json::{Value, json};

/// Watches the jobs of one verb.
#[derive(Default)]
pub(crate) struct Watch {
    jobs: Mutex<Vec<Going>>,
    is_cancelled: AtomicBool,
}

/// A job that goes on.
struct Going {
    what: String,
    total: usize,
    job: Arc<Job>,
}

impl Watch {
    /// Asks all jobs to stop, those too that have not begun.
    pub(crate) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
        for going in self.jobs().iter() {
            going.job.cancel();
        }
    }

    /// What goes on: the outermost job that counts its steps, or else the innermost one.
    pub(crate) fn told(&self) -> Value {
        let jobs = self.jobs();
        let counting = jobs.iter().find(|going| going.total > 0);
        match counting.or(jobs.last()) {
            Some(going) => {
                json!({ "what": going.what, "done": going.job.done(), "total": going.total })
            }
            None => json!({ "what": "beginning", "done": 0, "total": 0 }),
        }
    }

    fn jobs(&self) -> std::sync::MutexGuard<'_, Vec<Going>> {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Watch {
    fn begins(&self, what: &str, total: usize, job: &Arc<Job>) {
        let mut jobs = self.jobs();
        if self.is_cancelled.load(Ordering::Relaxed) {
            job.cancel();
        }
        jobs.push(Going {
            what: what.to_owned(),
            total,
            job: Arc::clone(job),
        });
    }

    fn ends(&self) {
        self.jobs().pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_cancelled_stops_every_job() {
        let watch = Watch::default();
        let [outer, inner, later] = [(); 3].map(|()| Arc::new(Job::default()));
        watch.begins("searching", 10, &outer);
        watch.begins("fitting", 0, &inner);
        outer.add(3);
        assert_eq!(
            watch.told(),
            json!({ "what": "searching", "done": 3, "total": 10 })
        );
        watch.cancel();
        watch.ends();
        watch.begins("judging", 0, &later);
        assert!(outer.is_cancelled() && inner.is_cancelled() && later.is_cancelled());
    }
}
