//! A job of the library as the page sees it: what goes on, how far it is, and that it is to stop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use modelmill::progress::{Job, Progress};
use serde_json::{Value, json};

use crate::surroundings::Surroundings;

/// Watches the jobs of one verb.
pub(crate) struct Watch {
    surroundings: Arc<dyn Surroundings>,
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
    /// Nothing goes on yet; the surroundings hear of every job.
    pub(crate) fn new(surroundings: Arc<dyn Surroundings>) -> Self {
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
        drop(jobs);
        self.surroundings.goes_on(&self.told());
    }

    fn ends(&self) {
        self.jobs().pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shelf::Shelf;

    #[test]
    fn what_is_cancelled_stops_every_job() {
        let watch = Watch::new(Arc::new(Shelf::new(|| 0.0, |_| {})));
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
