//! Actuators of a file.
//!
//! The table `actuator` goes in; actuators with their signals and terms come out.

use std::collections::BTreeMap;

use crate::actuators::{ActuatorGain, ActuatorKind, GainEntry, ModelActuator, SignalQuantity};
use crate::build::actuation::DriveRows;
use crate::build::symbols::SymbolTable;
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::joint_motion::CoordinateMotion;
use crate::kinds::PlaceLoad;
use crate::mechanism::{DriveIdx, DriveKind};
use crate::schema::{ActuatorEntry, ModelEntry};
use crate::scope::{FormulaRequirement, SymbolSort};
use crate::suggest;
use crate::values::SpannedName;

/// Reads the actuators; a faulty one is reported and left out.
pub(super) fn actuators(
    model: &ModelEntry,
    symbols: &SymbolTable,
    drives: &DriveRows,
    log: &mut DiagnosticLog,
) -> Vec<ModelActuator> {
    let entries = model.actuator.iter().flat_map(|list| &list.entries);
    let mut seen: BTreeMap<(usize, Option<&str>), SourceSpan> = BTreeMap::new();
    let mut actuators: Vec<ModelActuator> = Vec::new();
    for entry in entries {
        let Some(drive) = find_drive(entry, drives, log) else {
            continue;
        };
        let span = entry.drive.as_ref().map_or(entry.span, |name| name.span);
        if let Some(first) = seen.insert((drive.0, entry.kind.map(ActuatorKind::name)), span) {
            log.push(
                Diagnostic::error(span, "this drive has two actuators of one kind")
                    .label("the second one")
                    .related(first, "the first one")
                    .help("put both into one actuator; for two cylinders, record the force of the drive"),
            );
            continue;
        }
        actuators.extend(read_actuator(entry, drive, symbols, drives, log));
    }
    check_signals(model, &actuators, symbols, drives, log);
    actuators
}

/// The drive of an actuator.
fn find_drive(entry: &ActuatorEntry, drives: &DriveRows, log: &mut DiagnosticLog) -> Option<DriveIdx> {
    let name = entry.drive.as_ref()?;
    let found = drives.rows.iter().position(|d| d.is_driven && d.name == name.text);
    if found.is_none() {
        let is_shared = drives.shared.iter().any(|d| d.name == name.text);
        let names = drives.rows.iter().filter(|d| d.is_driven).map(|d| d.name.as_str());
        log.push(if is_shared {
            Diagnostic::error(name.span, format!("`{}` shares its row with other drives", name.text))
                .label("an actuator needs a drive with an equation of motion of its own")
                .help("record the force of this drive, and delete the actuator")
        } else {
            Diagnostic::error(name.span, format!("there is no drive `{}`", name.text))
                .label("expected the name of a `[[drive]]`")
                .help(suggest::advice(&name.text, "drives", names))
        });
    }
    found.map(DriveIdx)
}

/// Reads one actuator, with one entry for each of its signals; none after a fault, which is reported.
fn read_actuator(
    entry: &ActuatorEntry,
    drive: DriveIdx,
    symbols: &SymbolTable,
    drives: &DriveRows,
    log: &mut DiagnosticLog,
) -> Vec<ModelActuator> {
    let Some(kind) = entry.kind else {
        return Vec::new();
    };
    let before = log.n_errors();
    let row = &drives.rows[drive.0];
    let gains = read_gains(entry, kind, row.kind.place_load(&symbols.coordinates), symbols, log);
    let delay = entry.delay.as_ref().map(|number| number.value);
    if let Some(number) = entry.delay.as_ref().filter(|number| number.value < 0.0) {
        log.push(Diagnostic::error(number.span, "this delay is negative").label("expected seconds, 0 or more"));
    }
    let [saturation, dead_band, rate_limit] = limits(entry, kind, log);
    let signals = kind.signals();
    if let Some(name) = entry.signal.as_ref().filter(|_| signals.len() > 1) {
        let names: Vec<String> = signals
            .iter()
            .map(|signal| format!("`{}_{signal}`", row.name))
            .collect();
        log.push(
            Diagnostic::error(name.span, format!("`{}` has {} signals", kind.name(), signals.len()))
                .label("one name is not enough")
                .help(format!(
                    "delete it, and name the columns of {} in [recording.columns]",
                    names.join(" and ")
                )),
        );
    }
    if log.n_errors() > before {
        return Vec::new();
    }
    let quantity = kind.entry().quantity();
    let motion = match row.kind {
        DriveKind::Joint(i) if quantity == SignalQuantity::Position => symbols.coordinates[i.0].motion,
        _ => CoordinateMotion::Prismatic,
    };
    let own_name = entry.signal.as_ref();
    let each = signals.iter().enumerate().map(|(at, signal)| ModelActuator {
        drive,
        kind,
        signal: own_name.map_or_else(|| format!("{}_{signal}", row.name), |name| name.text.clone()),
        motion,
        quantity,
        terms: kind.entry().terms(at, &|key| gains.get(key).cloned()),
        delay: delay.or(kind.entry().usual_delay()),
        saturation,
        dead_band,
        rate_limit,
    });
    // A signal that makes no force is not recorded.
    each.filter(|one| !one.terms.is_empty()).collect()
}

/// The gains of an actuator by their keys; faults are reported.
fn read_gains(
    entry: &ActuatorEntry,
    kind: ActuatorKind,
    load: PlaceLoad,
    symbols: &SymbolTable,
    log: &mut DiagnosticLog,
) -> BTreeMap<&'static str, ActuatorGain> {
    let known = kind.entry().gains();
    // A gain of another kind would be ignored without a word.
    for key in GainEntry::KEYS {
        if let Some(formula) = GainEntry::formula(key, entry)
            && !known.iter().any(|one| one.key == key)
        {
            let keys: Vec<&str> = known.iter().map(|one| one.key).collect();
            log.push(
                Diagnostic::error(formula.ast.span, format!("`{}` has no `{key}`", kind.name()))
                    .label(format!("expected one of {}", keys.join(", ")))
                    .help(format!("its force is {}", kind.formula())),
            );
        }
    }
    let mut gains = BTreeMap::new();
    for one in known {
        let Some(formula) = GainEntry::formula(one.key, entry) else {
            if one.is_required && !entry.faulty {
                log.push(
                    Diagnostic::error(entry.span, format!("`{}` needs `{}`", kind.name(), one.key))
                        .label(format!("its force is {}", kind.formula()))
                        .help(if one.may_be_unknown {
                            "give a number if it is known, otherwise the name of a parameter of [parameters]"
                        } else {
                            "give a number or a constant; where it is unknown, give 1: the other gains then include it"
                        }),
                );
            }
            continue;
        };
        let sorts: &[SymbolSort] = if one.may_be_unknown {
            &[SymbolSort::Constant, SymbolSort::Parameter]
        } else {
            &[SymbolSort::Constant]
        };
        let what = format!("`{}`", one.key);
        let wanted = FormulaRequirement {
            sorts,
            dimension: one.dimension(load),
            what: &what,
        };
        let Some(exact) = symbols.scope.resolve(&formula, wanted, log) else {
            continue;
        };
        match ActuatorGain::from_expression(&exact) {
            Some(gain) => {
                gains.insert(one.key, gain);
            }
            None => log.push(
                Diagnostic::error(formula.ast.span, format!("`{}` is no product", one.key))
                    .label("expected a number, an expression in constants, or a parameter times such")
                    .help("declare one parameter for the complete gain"),
            ),
        }
    }
    gains
}

/// The saturation, the dead band and the limit of the rate of an actuator; faults are reported.
fn limits(entry: &ActuatorEntry, kind: ActuatorKind, log: &mut DiagnosticLog) -> [Option<f64>; 3] {
    let has_saturation = kind.signals().len() == 1;
    if let Some(number) = entry.saturation.as_ref().filter(|_| !has_saturation) {
        log.push(
            Diagnostic::error(number.span, format!("`{}` has no `saturation`", kind.name()))
                .label("its pressures are measured, so that limits of the supply are in them")
                .help("delete it"),
        );
    }
    if let Some(number) = &entry.rate_limit {
        if !kind.is_commanded() {
            log.push(
                Diagnostic::error(number.span, format!("`{}` has no `rate_limit`", kind.name()))
                    .label("a limit of the rate belongs to a command")
                    .help("delete it"),
            );
        } else if number.value <= 0.0 {
            log.push(
                Diagnostic::error(number.span, "this limit of the rate is not positive")
                    .label("expected a rate above 0"),
            );
        }
    }
    if let Some(number) = entry
        .saturation
        .as_ref()
        .filter(|number| has_saturation && number.value <= 0.0)
    {
        log.push(Diagnostic::error(number.span, "this saturation is not positive").label("expected a force above 0"));
    }
    if let Some(number) = &entry.dead_band {
        if kind.entry().quantity() != SignalQuantity::Position {
            log.push(
                Diagnostic::error(number.span, format!("`{}` has no `dead_band`", kind.name()))
                    .label("a dead band belongs to the error of a position")
                    .help("delete it"),
            );
        } else if number.value < 0.0 {
            log.push(Diagnostic::error(number.span, "this dead band is negative").label("expected 0 or more"));
        }
    }
    [&entry.saturation, &entry.dead_band, &entry.rate_limit].map(|number| number.as_ref().map(|number| number.value))
}

/// Reports signals with the name of another column, which would be read from the same place of a recording.
fn check_signals(
    model: &ModelEntry,
    actuators: &[ModelActuator],
    symbols: &SymbolTable,
    drives: &DriveRows,
    log: &mut DiagnosticLog,
) {
    let entries = model.actuator.iter().flat_map(|list| &list.entries);
    let spans: Vec<(&SpannedName, SourceSpan)> = entries
        .filter_map(|entry| {
            let drive = entry.drive.as_ref()?;
            Some((drive, entry.signal.as_ref().map_or(drive.span, |name| name.span)))
        })
        .collect();
    for (k, actuator) in actuators.iter().enumerate() {
        let name = &actuator.signal;
        let is_coordinate = symbols.coordinates.iter().any(|c| {
            let stem = name
                .strip_suffix("_dd")
                .or_else(|| name.strip_suffix("_d"))
                .unwrap_or(name);
            c.name == *name || c.name == stem
        });
        let is_drive = drives.rows.iter().any(|d| d.name == *name);
        let is_taken = actuators[..k].iter().any(|other| other.signal == *name);
        if !(is_coordinate || is_drive || is_taken || name == "t") {
            continue;
        }
        let drive = &drives.rows[actuator.drive.0].name;
        let span = spans.iter().find(|(one, _)| one.text == *drive).map(|(_, span)| *span);
        log.push(
            Diagnostic::error(
                span.unwrap_or(model.span),
                format!("`{name}` cannot name the signal of `{drive}`"),
            )
            .label("recordings have another column of this name")
            .help("choose another `signal` or another name of the drive, and name the column of the file in [recording.columns]"),
        );
    }
}
