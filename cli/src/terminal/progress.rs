//! Progress on standard error for jobs that take longer than a second, on a terminal only. Remarks are printed as they
//! occur.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use modelmill::RecordingNote;
use modelmill::progress::{JobHandle, ProgressListener};
use modelmill_boundary::text;

use crate::terminal;

/// Time after the start of the program before the first progress line.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time after the start of a job before its line, once [`PATIENCE`] is over.
const SHORT_PATIENCE: Duration = Duration::from_millis(300);
/// Interval between updates of the line.
const TICK: Duration = Duration::from_millis(100);

/// Shows the library's jobs on a terminal once the program has run for a second: a line with the name of the job and a
/// bar, or a spinner if the job does not count its steps.
pub(crate) struct TerminalProgress {
    /// Start of the program.
    start: Instant,
    /// One entry per running job, outer jobs first; `None` for jobs without a line.
    watchers: Mutex<Vec<Option<JobWatcher>>>,
}

/// A thread that shows a job until it ends.
struct JobWatcher {
    /// Dropped when the job ends, which stops the thread.
    keep_alive: Sender<()>,
    /// The thread, joined when the job ends.
    thread: JoinHandle<()>,
}

impl TerminalProgress {
    /// Starts the clock of the program.
    pub(crate) fn new() -> Self {
        Self {
            start: Instant::now(),
            watchers: Mutex::new(Vec::new()),
        }
    }
}

impl ProgressListener for TerminalProgress {
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        let mut watchers = self.watchers.lock().unwrap_or_else(PoisonError::into_inner);
        // If jobs are nested, only the outer one has a line.
        let is_watched = watchers.iter().any(Option::is_some);
        if is_watched || !std::io::stderr().is_terminal() {
            watchers.push(None);
            return;
        }
        // The first job waits for the rest of the program's patience, later ones only for the short one.
        let first_look = PATIENCE.saturating_sub(self.start.elapsed()).max(SHORT_PATIENCE);
        let (going_on, waiting) = channel::<()>();
        let (what, job) = (what.to_owned(), Arc::clone(job));
        // The thread polls the job; the end of the channel is the end of the job.
        let thread = std::thread::spawn(move || {
            let mut bar: Option<ProgressBar> = None;
            loop {
                let patience = if bar.is_none() { first_look } else { TICK };
                match waiting.recv_timeout(patience) {
                    Err(RecvTimeoutError::Timeout) => {
                        let bar = bar.get_or_insert_with(|| new_bar(&what, total));
                        bar.set_position(job.done());
                        bar.tick();
                    }
                    Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
                }
            }
            if let Some(bar) = bar {
                bar.finish_and_clear();
            }
        });
        watchers.push(Some(JobWatcher {
            keep_alive: going_on,
            thread,
        }));
    }

    fn on_job_end(&self) {
        let mut watchers = self.watchers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Some(JobWatcher {
            keep_alive: going_on,
            thread,
        })) = watchers.pop()
        {
            drop(going_on);
            // A panic of the watcher concerns the line only, not the result.
            let _ = thread.join();
        }
    }

    fn on_note(&self, note: &RecordingNote) {
        terminal::remark(note);
    }
}

/// A bar if the number of steps is known, else a spinner.
fn new_bar(message: &str, total: usize) -> ProgressBar {
    let target = ProgressDrawTarget::stderr();
    let (bar, template) = if total > 0 {
        let bar = ProgressBar::with_draw_target(Some(total as u64), target);
        (bar, "{msg} [{bar:30}] {percent} %, {eta} left")
    } else {
        let bar = ProgressBar::with_draw_target(None, target);
        (bar, "{spinner} {msg}, {elapsed}")
    };
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner());
    bar.with_style(style).with_message(text::plain(message).into_owned())
}
