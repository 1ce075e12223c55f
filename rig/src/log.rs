//! Errors in a rig file, and readers of its plain values: each takes an entry with its place and returns a
//! valid value, or a replacement and an error.

use modelmill_boundary::text::Message;
use modelmill_spec::{Diagnostic, SourceSpan};
use nalgebra::Vector3;

use crate::effect_by_name::name_list;
use crate::file::{RigName, SpannedTriple};
use crate::load::{plain_error, source_span};

/// An entry with the file that contains it.
pub(crate) struct FileItem<T> {
    /// Index of the file among the sources.
    pub(crate) file: usize,
    /// The entry.
    pub(crate) entry: T,
}

/// Collects errors in a file.
#[derive(Debug, Default)]
pub struct RigLog(pub Vec<Diagnostic>);

impl RigLog {
    /// Adds an error at a place: what is wrong, what was expected there, what to do. The last two may be empty.
    pub fn error(&mut self, span: SourceSpan, message: String, label: &str, help: &str) {
        let help = Message::from(help);
        self.0.push(Diagnostic {
            label: label.to_owned(),
            help: Some(help).filter(|help| !help.is_empty()).into_iter().collect(),
            ..plain_error(Some(span), message)
        });
    }

    /// Adds an error for a name that does not exist. `what` is the kind of object that it should name, and `known`
    /// lists the names.
    pub fn unknown_name(&mut self, file: usize, name: &RigName, what: &str, known: &[&str]) {
        self.error(
            source_span(file, &name.span()),
            format!("there is no {what} `{}`", name.get_ref()),
            &format!("expected the name of a {what}"),
            &format!("known are {}", name_list(known)),
        );
    }
}

/// A vector of finite numbers; zero if the entry is missing or not finite.
pub(crate) fn vector(file: usize, entry: Option<&SpannedTriple>, log: &mut RigLog) -> Vector3<f64> {
    let Some(entry) = entry else {
        return Vector3::zeros();
    };
    let vector = Vector3::from(*entry.get_ref());
    if !vector.iter().all(|x| x.is_finite()) {
        log.error(
            source_span(file, &entry.span()),
            "this vector is not finite".to_owned(),
            "expected finite numbers",
            "",
        );
        return Vector3::zeros();
    }
    vector
}

/// A finite number above zero; 1 if the entry is anything else, which is an error. `what` names it in the error.
pub(crate) fn above_zero(file: usize, entry: &toml::Spanned<f64>, what: &str, log: &mut RigLog) -> f64 {
    let value = *entry.get_ref();
    if value.is_finite() && value > 0.0 {
        return value;
    }
    log.error(
        source_span(file, &entry.span()),
        format!("{what} cannot be {value}"),
        "expected a finite number above zero",
        "",
    );
    1.0
}

/// A finite number of at least zero; 0 if the entry is missing, or anything else, which is an error.
pub(crate) fn not_negative(file: usize, entry: Option<&toml::Spanned<f64>>, what: &str, log: &mut RigLog) -> f64 {
    let Some(entry) = entry else {
        return 0.0;
    };
    let value = *entry.get_ref();
    if value.is_finite() && value >= 0.0 {
        return value;
    }
    log.error(
        source_span(file, &entry.span()),
        format!("{what} cannot be {value}"),
        "expected a finite number, not below zero",
        "",
    );
    0.0
}
