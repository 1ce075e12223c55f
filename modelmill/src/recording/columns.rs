//! Assigns columns of a recording to the names of the model: first by the user's options, then by the model file, then
//! by names of joints in the names of columns.

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use modelmill_identify::RecordingNote;
use modelmill_identify::{ComputedColumn, NonFinitePolicy, ReadOptions};
use modelmill_spec::{ColumnFault, ColumnQuantity, ColumnSum, read_column, split_header_unit, unit_factor};

use super::joint_columns::{JointColumn, JointColumns};
use super::options::RecordingOptions;
use crate::error::{Error, Outcome};
use crate::model::Model;

/// Options for reading a recording with the columns `header`, and notes on the assignment; `file` is its name in
/// messages.
///
/// Fails when a mapping is not possible for this model, or uses columns that do not exist.
pub(crate) fn read_options(
    model: &Model,
    args: &RecordingOptions,
    header: &[String],
    file: &str,
) -> Outcome<(ReadOptions, Vec<RecordingNote>)> {
    let mechanism = &model.derivation.mechanism;
    let known = mechanism.columns();
    // Options of the user come first, since they override the model file.
    let mut mapping = ColumnMapping::default();
    // All faults are collected and reported together.
    let mut faults = Vec::new();
    for (k, (ours, text)) in args.columns.iter().enumerate() {
        let Some(quantity) = quantity_of(&known, ours) else {
            faults.push(unknown_column_error(model, &known, ours));
            continue;
        };
        // A name with two columns is ambiguous.
        if args.columns[..k].iter().any(|(other, _)| other == ours) {
            faults.push(Error::options(message!(
                "{}: `{ours}` is mapped twice; give each name one mapping",
                map(ours, "...")
            )));
            continue;
        }
        // A rate replaces the times of the file.
        if ours == "t" && args.rate.is_some() {
            faults.push(Error::options(message!(
                "{}: the times also follow from {}; give one of the two",
                map(ours, text),
                Remedy::option(OptionName::Rate)
            )));
            continue;
        }
        match parse_column_sum(model, text, quantity, header) {
            Ok(sum) => mapping.add(ours, sum),
            // The reader of the recording reports the missing column and lists the existing ones.
            Err(ColumnFault::Missing { column, .. }) if column == *text => {
                mapping.renames.push((ours.clone(), text.clone()));
            }
            Err(fault @ ColumnFault::Missing { .. }) => {
                faults.push(Error::input(message!(
                    "{file}: {}: {fault} {}",
                    map(ours, text),
                    column_list_text(header)
                )));
            }
            Err(fault) => {
                faults.push(Error::options(message!("{}: {fault}", map(ours, text))));
            }
        }
    }
    // Mappings of the model file follow; those of the user have priority.
    for (ours, text) in &mechanism.recording.columns {
        if args.columns.iter().any(|(mine, _)| mine == ours) || (ours == "t" && args.rate.is_some()) {
            continue;
        }
        // Names that the model does not read are ignored in its own list.
        let Some(quantity) = quantity_of(&known, ours) else {
            continue;
        };
        match parse_column_sum(model, text, quantity, header) {
            Ok(sum) => mapping.add(ours, sum),
            // A recording may use the names of the model, or lack optional columns.
            Err(ColumnFault::Missing { .. }) if header.contains(ours) || is_optional(model, ours, quantity) => {}
            Err(fault) => {
                faults.push(Error::input(message!(
                    "{file}: the model file takes `{ours}` from `{text}`, but {fault} {} \
                     Assign one of them with {}",
                    column_list_text(header),
                    map(ours, "COLUMN")
                )));
            }
        }
    }
    let is_given = |ours: &str, mapping: &ColumnMapping| {
        header.iter().any(|name| name == ours) || mapping.has(ours) || (ours == "t" && args.rate.is_some())
    };
    map_header_units(model, &known, header, &mut mapping, &is_given);
    let by_joint = map_joint_columns(model, &known, header, &mut mapping, &is_given);
    let mut notes = mapping.notes(&known, &mechanism.recording.torque, file);
    notes.extend(
        by_joint
            .into_iter()
            .map(|says| RecordingNote::info(message!("{file}: {}", says))),
    );
    // Motor torques are scaled to the drive, their variances by the square.
    for (drive, factor) in &mechanism.recording.torque {
        mapping.scale(drive, *factor, header);
        mapping.scale(&format!("{drive}_var"), factor * factor, header);
    }
    if let Some(fault) = combined_error(faults) {
        return Err(fault);
    }
    // Only columns that the model needs are read.
    let options = ReadOptions {
        renames: mapping.renames,
        computed: mapping.computed,
        not_finite: if args.skip_bad_samples {
            NonFinitePolicy::LeaveOut
        } else {
            NonFinitePolicy::Refuse
        },
        wanted: Some(known.into_iter().map(|(name, _)| name).collect()),
        may_be_missing: optional_forces(model),
        time_interval: args.between,
        rate: args.rate,
        ..ReadOptions::default()
    };
    Ok((options, notes))
}

/// Whether a name of the model has a column without further assignments.
type IsGiven<'a> = dyn Fn(&str, &ColumnMapping) -> bool + 'a;

/// Assigns columns with the name of the model and a unit, such as `q1 [deg]`.
fn map_header_units(
    model: &Model,
    known: &[(String, ColumnQuantity)],
    header: &[String],
    mapping: &mut ColumnMapping,
    is_given: &IsGiven<'_>,
) {
    for (ours, quantity) in known {
        let is_unit_only = |name: &String| split_header_unit(name).is_some_and(|(base, _)| base == ours);
        if is_given(ours, mapping) || header.iter().filter(|name| is_unit_only(name)).count() != 1 {
            continue;
        }
        if let Ok(sum) = parse_column_sum(model, ours, *quantity, header) {
            mapping.add(ours, sum);
        }
    }
}

/// Most columns that a remark names.
const MOST_NAMED: usize = 4;

/// Assigns columns that name joints, such as `joint_states.position.elbow`, to names of the model that have no column.
/// Returns remarks for the user.
fn map_joint_columns(
    model: &Model,
    known: &[(String, ColumnQuantity)],
    header: &[String],
    mapping: &mut ColumnMapping,
    is_given: &IsGiven<'_>,
) -> Vec<Message> {
    let joints = JointColumns::new(&model.derivation.mechanism, known, header);
    let (mut pairs, mut remarks) = (Vec::new(), Vec::new());
    for (ours, quantity) in known {
        if is_given(ours, mapping) {
            continue;
        }
        match joints.find(ours, *quantity) {
            Some(JointColumn::Unique(text)) => {
                if let Ok(sum) = parse_column_sum(model, &text, *quantity, header) {
                    // A column that the user assigned to another name is that.
                    if sum.terms.iter().any(|(theirs, _)| mapping.is_source(theirs)) {
                        continue;
                    }
                    mapping.add(ours, sum);
                    pairs.push(format!("`{ours}` from `{text}`"));
                }
            }
            Some(JointColumn::Ambiguous(names)) => {
                let more = names.len().saturating_sub(MOST_NAMED);
                let more = if more > 0 {
                    format!(" and {more} more")
                } else {
                    String::new()
                };
                let names: Vec<String> = names.iter().take(MOST_NAMED).map(|name| format!("`{name}`")).collect();
                remarks.push(message!(
                    "the columns {}{more} may all be `{ours}`, and none is used; map one with {}.",
                    names.join(", "),
                    map(ours, "THEIRS")
                ));
            }
            None => {}
        }
    }
    if !pairs.is_empty() {
        let says = message!("columns are assigned by the names of joints: {}.", pairs.join(", "));
        remarks.insert(0, says);
    }
    remarks
}

/// Forces with samples that may be missing. None if drives share rows, since their forces are added before samples are
/// repaired.
fn optional_forces(model: &Model) -> Vec<String> {
    if model.derivation.mechanism.shared_drives.is_empty() {
        model.row_names()
    } else {
        Vec::new()
    }
}

/// Several faults as one error, one line each; a wrong option outweighs a fault of the recording.
fn combined_error(mut faults: Vec<Error>) -> Option<Error> {
    if faults.len() < 2 {
        return faults.pop();
    }
    let is_wrong_option = faults.iter().any(|fault| matches!(fault, Error::Options(_)));
    // A single fault is returned as it is.
    let lines = faults.iter().map(|fault| message!("- {}", fault.message()));
    let says = message!(
        "{} mappings of columns are at fault:\n{}",
        faults.len(),
        Message::join(lines, "\n")
    );
    Some(if is_wrong_option {
        Error::options(says)
    } else {
        Error::input(says)
    })
}

/// The assignments that were found.
#[derive(Default)]
struct ColumnMapping {
    /// Names of the model with the column that is read for each.
    renames: Vec<(String, String)>,
    /// Names of the model with a sum of columns.
    computed: Vec<ComputedColumn>,
}

impl ColumnMapping {
    /// Adds an assignment: a rename if the sum is a single column without factor and offset.
    fn add(&mut self, ours: &str, sum: ColumnSum) {
        // A rename keeps the numbers of the file unchanged. A second name for one column is a copy of it.
        match sum.terms.as_slice() {
            [(theirs, factor)] if factor.total_cmp(&1.0).is_eq() && sum.offset == 0.0 && !self.is_renamed(theirs) => {
                self.renames.push((ours.to_owned(), theirs.clone()));
            }
            _ => self.computed.push(ComputedColumn {
                name: ours.to_owned(),
                terms: sum.terms,
                offset: sum.offset,
            }),
        }
    }

    /// Whether a column of the file already has another name.
    fn is_renamed(&self, theirs: &str) -> bool {
        self.renames.iter().any(|(_, other)| other == theirs)
    }

    /// Whether a column of the file is read for any name of the model.
    fn is_source(&self, theirs: &str) -> bool {
        let mut terms = self.computed.iter().flat_map(|one| &one.terms);
        self.is_renamed(theirs) || terms.any(|(name, _)| name == theirs)
    }

    /// Whether a name of the model has a column.
    fn has(&self, ours: &str) -> bool {
        let is_renamed = self.renames.iter().any(|(name, _)| name == ours);
        is_renamed || self.computed.iter().any(|one| one.name == ours)
    }

    /// The only column that a name of the model is read from; `None` for sums.
    fn single_columns(&self) -> impl Iterator<Item = (&str, &str)> {
        let computed = self.computed.iter().filter_map(|one| match one.terms.as_slice() {
            [(theirs, _)] => Some((one.name.as_str(), theirs.as_str())),
            _ => None,
        });
        let renames = self
            .renames
            .iter()
            .map(|(ours, theirs)| (ours.as_str(), theirs.as_str()));
        renames.chain(computed)
    }

    /// Notes on columns that two names share, and on units that do not fit.
    fn notes(&self, known: &[(String, ColumnQuantity)], torque: &[(String, f64)], file: &str) -> Vec<RecordingNote> {
        let mut notes = Vec::new();
        let all: Vec<(&str, &str)> = self.single_columns().collect();
        for (k, (ours, theirs)) in all.iter().enumerate() {
            if let Some((other, _)) = all[..k].iter().find(|(_, earlier)| earlier == theirs) {
                notes.push(RecordingNote::info(format!(
                    "`{other}` and `{ours}` are both read from the column `{theirs}` of {file}."
                )));
            }
        }
        // A motor current becomes a torque by the constant in the model file.
        for (ours, theirs) in self
            .renames
            .iter()
            .filter(|(ours, _)| !torque.iter().any(|(drive, _)| drive == ours))
        {
            let unit = split_header_unit(theirs).map(|(_, unit)| unit);
            if let (Some(unit), Some(quantity)) = (unit, quantity_of(known, ours))
                && unit_factor(unit, quantity).is_none()
            {
                notes.push(RecordingNote::warning(format!(
                    "The column `{theirs}` of {file} has the unit {unit}, which is no unit of `{ours}`; its numbers are used as \
                     they are. Give the factor to the SI unit in the model file: `[recording.torque]` for a drive, \
                     `[recording.columns]` for any other column."
                )));
            }
        }
        notes
    }

    /// Multiplies the values of a column of the model by a factor.
    fn scale(&mut self, ours: &str, factor: f64, header: &[String]) {
        // A sum is scaled in all its terms.
        if let Some(known) = self.computed.iter_mut().find(|one| one.name == ours) {
            known.offset *= factor;
            known.terms.iter_mut().for_each(|(_, term)| *term *= factor);
            return;
        }
        // A rename becomes a sum with one term.
        let renamed = self.renames.iter().position(|(name, _)| name == ours);
        let theirs = match renamed {
            Some(place) => self.renames.remove(place).1,
            None if header.iter().any(|name| name == ours) => ours.to_owned(),
            None => return,
        };
        self.computed.push(ComputedColumn {
            name: ours.to_owned(),
            terms: vec![(theirs, factor)],
            offset: 0.0,
        });
    }
}

/// Reads a sum of columns; names of constants of the model are known in it.
fn parse_column_sum(
    model: &Model,
    text: &str,
    quantity: ColumnQuantity,
    header: &[String],
) -> Result<ColumnSum, ColumnFault> {
    let constants = &model.derivation.mechanism.constants;
    read_column(text, quantity, header, &|name| {
        constants.iter().find(|c| c.name == name).map(|c| c.value)
    })
}

/// The quantity of a column of the model; `None` if there is no such column.
fn quantity_of(known: &[(String, ColumnQuantity)], ours: &str) -> Option<ColumnQuantity> {
    let found = known.iter().find(|(name, _)| name == ours);
    found.map(|(_, quantity)| *quantity)
}

/// Derivatives, forces and variances may be missing: they are computed, or requested when they are needed. A recording with
/// forces may lack signals of actuators; the equations of servos need them.
fn is_optional(model: &Model, ours: &str, quantity: ColumnQuantity) -> bool {
    let mechanism = &model.derivation.mechanism;
    if mechanism.actuators.iter().any(|actuator| actuator.signal == ours) {
        return mechanism.servo_forces.is_empty();
    }
    match quantity {
        ColumnQuantity::Time | ColumnQuantity::Number => false,
        ColumnQuantity::Angle(order) | ColumnQuantity::Length(order) => order > 0,
        _ => true,
    }
}

/// The error of a name that is no column of the model.
fn unknown_column_error(model: &Model, known: &[(String, ColumnQuantity)], ours: &str) -> Error {
    // Passive coordinates are a frequent mistake.
    let why = if model.passive_coordinates().iter().any(|name| name == ours) {
        "is passive: it is computed from the loops and not read"
    } else {
        "is no name of this model"
    };
    let known: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
    Error::options(message!(
        "{}: `{ours}` {why}; expected one of {}",
        map(ours, "..."),
        known.join(", ")
    ))
}

/// The option that assigns a column of the recording to one of the model.
fn map(ours: &str, theirs: &str) -> Remedy {
    Remedy::option(OptionName::Columns).with_value(format!("{ours}={theirs}"))
}

/// The columns of the recording as text, at most 40 of them.
fn column_list_text(header: &[String]) -> String {
    // Long lists are cut off, with their number.
    let shown: Vec<String> = header.iter().take(40).map(|name| format!("`{name}`")).collect();
    let more = if header.len() > 40 {
        format!(" and {} more", header.len() - 40)
    } else {
        String::new()
    };
    format!("The columns are: {}{more}.", shown.join(", "))
}
