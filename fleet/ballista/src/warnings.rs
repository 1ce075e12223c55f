//! Warnings of the engines on standard error, such as that of an executor that is lost; nothing else of what they tell.

use log::{LevelFilter, Log, Metadata, Record};

struct WarningLogger;

impl Log for WarningLogger {
    fn enabled(&self, about: &Metadata<'_>) -> bool {
        about.level() <= log::max_level()
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            eprintln!(
                "{}: {}",
                record.level().as_str().to_lowercase(),
                record.args()
            );
        }
    }

    fn flush(&self) {}
}

/// Shows warnings from now on.
pub(crate) fn show_warnings() {
    // A second logger could only come from a second call.
    if log::set_logger(&WarningLogger).is_ok() {
        log::set_max_level(LevelFilter::Warn);
    }
}
