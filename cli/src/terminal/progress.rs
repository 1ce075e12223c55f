//! Progress on standard error for whatever takes longer than a second, on a terminal only; remarks as they come up.

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

/// How long the program may be silent before anything is shown.
const PATIENCE: Duration = Duration::from_secs(1);
/// How long a single job may be silent once the program's patience is over.
const SHORT_PATIENCE: Duration = Duration::from_millis(300);
const TICK: Duration = Duration::from_millis(100);

/// Watches the library's jobs: once the program has been busy for a second on a terminal, a line says what is going on, with
/// a bar if the job counts its steps and a spinner if it does not.
pub(crate) struct TerminalProgress {
    start: Instant,
    watchers: Mutex<Vec<Option<JobWatcher>>>,
}

/// A thread that looks at a job until it is told to stop.
struct JobWatcher {
    /// Dropped when the job ends.
    keep_alive: Sender<()>,
    thread: JoinHandle<()>,
}

impl TerminalProgress {
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
        // Of jobs within jobs the outer one has its line.
        let is_watched = watchers.iter().any(Option::is_some);
        if is_watched || !std::io::stderr().is_terminal() {
            watchers.push(None);
            return;
        }
        let first_look = PATIENCE
            .saturating_sub(self.start.elapsed())
            .max(SHORT_PATIENCE);
        let (going_on, waiting) = channel::<()>();
        let (what, job) = (what.to_owned(), Arc::clone(job));
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
            // A watcher that panicked has shown nothing that is missed.
            let _ = thread.join();
        }
    }

    fn on_note(&self, note: &RecordingNote) {
        terminal::remark(note);
    }
}

/// As [`TerminalProgress`], for whoever tells remarks at another time.
pub(crate) struct ProgressWithoutRemarks(TerminalProgress);

impl ProgressWithoutRemarks {
    pub(crate) fn new() -> Self {
        Self(TerminalProgress::new())
    }
}

impl ProgressListener for ProgressWithoutRemarks {
    fn on_job_start(&self, what: &str, total: usize, job: &Arc<JobHandle>) {
        self.0.on_job_start(what, total, job);
    }

    fn on_job_end(&self) {
        self.0.on_job_end();
    }
}

fn new_bar(message: &str, total: usize) -> ProgressBar {
    let target = ProgressDrawTarget::stderr();
    let (bar, template) = if total > 0 {
        let bar = ProgressBar::with_draw_target(Some(total as u64), target);
        (bar, "{msg} [{bar:30}] {percent} %, {eta} left")
    } else {
        let bar = ProgressBar::with_draw_target(None, target);
        (bar, "{spinner} {msg}, {elapsed}")
    };
    let style =
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner());
    bar.with_style(style)
        .with_message(text::plain(message).into_owned())
}
