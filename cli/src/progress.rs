//! Progress on standard error for whatever takes longer than a second, on a terminal only.

use std::io::IsTerminal;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// How long the program may be silent before anything is shown.
const PATIENCE: Duration = Duration::from_secs(1);
/// How long a single job may be silent once the program's patience is over.
const SHORT_PATIENCE: Duration = Duration::from_millis(300);
const TICK: Duration = Duration::from_millis(100);

/// When the first job began.
static START: OnceLock<Instant> = OnceLock::new();

/// How far a job has come.
#[derive(Debug, Default)]
pub(crate) struct Done(AtomicU64);

impl Done {
    /// Some more is done.
    pub(crate) fn add(&self, count: usize) {
        self.0.fetch_add(count as u64, Ordering::Relaxed);
    }
}

/// Runs a job; once the program has been busy for a second on a terminal, a line says what is
/// going on: a bar if the job has `total` steps and counts them, a spinner if it is 0.
pub(crate) fn watched<T>(message: &str, total: usize, job: impl FnOnce(&Done) -> T) -> T {
    let done = Done::default();
    if !std::io::stderr().is_terminal() {
        return job(&done);
    }
    let (finished, waiting) = channel::<()>();
    let start = *START.get_or_init(Instant::now);
    let first_look = PATIENCE.saturating_sub(start.elapsed()).max(SHORT_PATIENCE);
    let counter = &done;
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let mut bar: Option<ProgressBar> = None;
            loop {
                let patience = if bar.is_none() { first_look } else { TICK };
                match waiting.recv_timeout(patience) {
                    Err(RecvTimeoutError::Timeout) => {
                        let bar = bar.get_or_insert_with(|| new_bar(message, total));
                        bar.set_position(counter.0.load(Ordering::Relaxed));
                        bar.tick();
                    }
                    Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
                }
            }
            if let Some(bar) = bar {
                bar.finish_and_clear();
            }
        });
        // Dropped on the way out, also by a panic, so that the watcher ends.
        let _finished = finished;
        job(counter)
    })
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
    bar.with_style(style).with_message(message.to_owned())
}
