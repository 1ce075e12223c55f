//! Findings about a rig file, and the readers of its plain values: each takes an entry with its place and gives a
//! sound value, or a stand-in and a finding.

use modelmill_boundary::text::Message;
use modelmill_spec::{Diagnostic, SourceSpan};
use nalgebra::Vector3;

use crate::effect_by_name::name_list;
use crate::file::{RigName, SpannedTriple};
use crate::load::{plain_error, source_span};

/// An entry with the file that it stands in.
pub(crate) struct FileItem<T> {
    pub(crate) file: usize,
    pub(crate) entry: T,
}

/// Collects findings about a file.
#[derive(Debug, Default)]
pub struct RigLog(pub Vec<Diagnostic>);

impl RigLog {
    /// Takes an error at a place: what is wrong, what was expected there, what to do; the last two may be empty.
    pub fn error(&mut self, span: SourceSpan, message: String, label: &str, help: &str) {
        let help = Message::from(help);
        self.0.push(Diagnostic {
            label: label.to_owned(),
            help: Some(help)
                .filter(|help| !help.is_empty())
                .into_iter()
                .collect(),
            ..plain_error(Some(span), message)
        });
    }

    /// Takes a name that leads nowhere; `what` says what it should name, `known` what there is.
    pub fn unknown_name(&mut self, file: usize, name: &RigName, what: &str, known: &[&str]) {
        self.error(
            source_span(file, &name.span()),
            format!("there is no {what} `{}`", name.get_ref()),
            &format!("expected the name of a {what}"),
            &format!("known are {}", name_list(known)),
        );
    }
}

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

pub(crate) fn above_zero(
    file: usize,
    entry: &toml::Spanned<f64>,
    what: &str,
    log: &mut RigLog,
) -> f64 {
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

pub(crate) fn not_negative(
    file: usize,
    entry: Option<&toml::Spanned<f64>>,
    what: &str,
    log: &mut RigLog,
) -> f64 {
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
