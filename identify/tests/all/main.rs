//! Recordings, filters, estimators and the search for effects, by themselves.

mod diagnose;
mod emps;
mod filters;
mod formats;
mod logs;
mod many_drives;
mod preparation;
mod readers;
mod recordings;
mod separate;
mod synthetic;
