//! Effects that are added to a loaded model, as if its file had the same entries.
//!
//! No file is written, and no file is read again: the entries of the loaded model are copied, extended and built
//! anew.

use crate::build::build;
use crate::diagnostic::{DiagnosticLog, SourceSpan};
use crate::document::TomlKey;
use crate::formula::{FormulaAst, FormulaAstKind, SourceFormula};
use crate::load::{LoadFailure, LoadedModel};
use crate::mechanism::{Mechanism, ModelConstant};
use crate::parser::parse;
use crate::record::{EntryList, NamedEntries, OneOrMany};
use crate::schema::{ConstantEntry, EffectEntry, EffectParameterEntry};
use crate::unit::ModelUnit;
use crate::values::{SpannedName, SpannedNumber, SpannedText};

/// An effect to be added to a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AddedEffect {
    /// Name of the kind.
    pub kind: String,
    /// Names of the places on which it acts.
    pub at: Vec<String>,
    /// Symbols of parameters with the names that they get; the names of all others are `symbol_place`.
    pub parameters: Vec<(String, String)>,
    /// Symbols of constants with their values; all others have the defaults of the kind.
    pub constants: Vec<(String, ConstantValue)>,
}

/// The value of a constant of an effect.
#[derive(Clone, Debug, PartialEq)]
pub enum ConstantValue {
    /// A number, in SI units.
    Number(f64),
    /// A constant of the model, by its name.
    Named(String),
}

/// The place of entries that are in no file.
const NOWHERE: SourceSpan = SourceSpan {
    file: usize::MAX,
    start: 0,
    end: 0,
};

impl LoadedModel {
    /// The mechanism with further constants and effects, which follow those that it has.
    ///
    /// Fails with the findings that a file with these entries would have: a name that is taken, an unknown kind or
    /// place, or a missing value.
    pub fn with_additions(
        &self,
        constants: &[ModelConstant],
        effects: &[AddedEffect],
    ) -> Result<Mechanism, LoadFailure> {
        let mut log = DiagnosticLog::default();
        // The loaded model stays unchanged; its entries are copied.
        let mut model = self.entries.model.clone();
        let table = model.constants.get_or_insert_with(|| NamedEntries {
            entries: Vec::new(),
            faulty: Vec::new(),
        });
        let further = constants.iter().map(|one| (key(&one.name), constant(one, &mut log)));
        table.entries.extend(further);
        let list = model.effect.get_or_insert_with(|| EntryList {
            entries: Vec::new(),
            span: NOWHERE,
            faulty: false,
        });
        for added in effects {
            list.entries.push(effect(added, &mut log));
        }
        // The same checks as for a file, with the libraries that were read for it.
        let (mechanism, _) = build(&model, &self.entries.libraries, &mut log);
        mechanism.ok_or_else(|| LoadFailure {
            diagnostics: log.finish(),
            sources: self.sources.clone(),
        })
    }
}

/// A key that is in no file.
fn key(text: &str) -> TomlKey {
    TomlKey {
        name: text.to_owned(),
        span: NOWHERE,
    }
}

/// A name that is in no file.
fn name(text: &str) -> SpannedName {
    SpannedName {
        text: text.to_owned(),
        span: NOWHERE,
    }
}

/// The entry of a constant; a unit that cannot be parsed is reported.
fn constant(constant: &ModelConstant, log: &mut DiagnosticLog) -> ConstantEntry {
    ConstantEntry {
        span: NOWHERE,
        value: Some(SpannedNumber {
            value: constant.value,
            span: NOWHERE,
        }),
        unit: ModelUnit::from_text(&constant.unit, NOWHERE, None, log),
        note: constant.note.clone().map(|text| SpannedText { text, span: NOWHERE }),
        faulty: false,
    }
}

/// The entry of an effect.
fn effect(added: &AddedEffect, log: &mut DiagnosticLog) -> EffectEntry {
    // Parameters get names only; their nominal values stay zero.
    let named = |name_of: &str| EffectParameterEntry {
        span: NOWHERE,
        name: Some(name(name_of)),
        nominal: None,
        faulty: false,
    };
    let parameters = added.parameters.iter();
    let constants = added.constants.iter();
    EffectEntry {
        span: NOWHERE,
        name: None,
        kind: Some(name(&added.kind)),
        at: Some(OneOrMany {
            entries: added.at.iter().map(|place| name(place)).collect(),
            span: NOWHERE,
        }),
        at_each: None,
        without: None,
        parameters: Some(NamedEntries {
            entries: parameters.map(|(symbol, name)| (key(symbol), named(name))).collect(),
            faulty: Vec::new(),
        }),
        // Without values of its own the effect has no table of constants, so that it is compared with its twins.
        constants: (!added.constants.is_empty()).then(|| NamedEntries {
            entries: constants
                .filter_map(|(symbol, value)| Some((key(symbol), formula(value, log)?)))
                .collect(),
            faulty: Vec::new(),
        }),
        note: None,
        faulty: false,
    }
}

/// The formula of a constant's value; `None` if a number cannot be parsed, which is reported.
fn formula(value: &ConstantValue, log: &mut DiagnosticLog) -> Option<SourceFormula> {
    Some(match value {
        ConstantValue::Named(name) => SourceFormula {
            text: name.clone(),
            ast: FormulaAst {
                span: NOWHERE,
                kind: FormulaAstKind::Name(name.clone()),
            },
        },
        ConstantValue::Number(value) => {
            // The decimal that a file would contain, so that both give the same rational number.
            let text = format!("{value:?}");
            let ast = parse(&text, NOWHERE, None, log)?;
            SourceFormula { text, ast }
        }
    })
}
