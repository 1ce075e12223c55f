//! Prints warnings and errors of the engines on standard error, such as the loss of an executor, and no other messages.

use log::{LevelFilter, Log, Metadata, Record};

/// A logger that prints level and text.
struct WarningLogger;

impl Log for WarningLogger {
    fn enabled(&self, about: &Metadata<'_>) -> bool {
        about.level() <= log::max_level()
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            eprintln!("{}: {}", record.level().as_str().to_lowercase(), record.args());
        }
    }

    fn flush(&self) {}
}

/// Shows warnings from now on.
pub(crate) fn show_warnings() {
    // Setting the logger fails only at a second call, and then it is set already.
    if log::set_logger(&WarningLogger).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
}
