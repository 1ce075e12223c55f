//! Pairs names of a model with columns of a recording, one kind of signal after another.

use modelmill_spec::{ColumnQuantity, DriveKind, Mechanism, split_header_unit, unit_factor};

use super::fit::{ForceAgreement, compare_forces};
use super::signals::{FileSignal, RateLink, find_rate_link, find_time, suggest_time_unit};
use super::thresholds::{
    FIT_LEAST_SHARE, FIT_MARGIN, LARGEST_ANGLE, NAME_LEAST_SIMILARITY, NAMELESS_LEAST_CORRELATION,
    SIGN_LEAST_CORRELATION, UNIT_TOLERANCE,
};
use super::words::{NameParts, SignalRole, joint_similarity};
use super::{ColumnProposal, ProposedColumn};
use crate::error::Outcome;
use crate::model::Model;

/// Units of rates, with their factor to that of the derivative of a position in SI units.
const RATE_UNITS: [(&str, f64); 3] = [
    ("deg/s", std::f64::consts::PI / 180.0),
    ("rpm", std::f64::consts::TAU / 60.0),
    ("rev/s", std::f64::consts::TAU),
];

/// A name of the model that a column is sought for.
struct ModelColumn {
    /// The name.
    name: String,
    /// Its quantity.
    quantity: ColumnQuantity,
    /// What it is.
    role: SignalRole,
    /// Names of its joint, taken apart; a drive has its own and that of its coordinate.
    parts: Vec<NameParts>,
    /// Position of the column that is paired with it, and the evidence.
    pair: Option<ColumnPair>,
}

/// A pair with its evidence.
#[derive(Clone)]
struct ColumnPair {
    /// Position of the column of the recording.
    signal: usize,
    /// A unit to state, if the name of the column has none that is applied anyway.
    unit: Option<String>,
    /// Whether the column has the opposite sign.
    is_reversed: bool,
    /// The evidence.
    reasons: Vec<String>,
    /// Whether the evidence is weak.
    is_guess: bool,
}

/// The search for pairs.
pub(super) struct ColumnPairing<'a> {
    /// The model.
    model: &'a Model,
    /// Columns of the recording.
    signals: Vec<FileSignal>,
    /// Names of the model.
    ours: Vec<ModelColumn>,
    /// Remarks on the proposal.
    pub(super) remarks: Vec<String>,
}

/// Whether any of these columns is a position, rate or force by its name.
pub(super) fn has_signals(names: &[String]) -> bool {
    names.iter().any(|name| {
        let role = NameParts::new(name).role;
        matches!(role, Some(SignalRole::Position | SignalRole::Rate | SignalRole::Force))
    })
}

impl<'a> ColumnPairing<'a> {
    /// Starts without pairs.
    pub(super) fn new(model: &'a Model, signals: Vec<FileSignal>) -> Self {
        Self {
            ours: model_columns(&model.derivation.mechanism),
            model,
            signals,
            remarks: Vec::new(),
        }
    }

    /// Finds all pairs.
    pub(super) fn pair_all(&mut self) -> Outcome {
        self.pair_equal_names();
        self.pair_time();
        self.find_roles_by_numbers();
        for role in [
            SignalRole::Position,
            SignalRole::Force,
            SignalRole::Rate,
            SignalRole::Acceleration,
        ] {
            self.pair_by_name(role);
        }
        self.pair_by_order(SignalRole::Position);
        self.state_units_of_positions();
        self.pair_forces_by_fit()?;
        self.pair_by_order(SignalRole::Force);
        self.check_rates();
        self.doubt_foreign_units();
        Ok(())
    }

    /// Marks pairs of columns whose header has a unit of something else: their numbers would be used as they are.
    fn doubt_foreign_units(&mut self) {
        for one in &mut self.ours {
            let Some(pair) = &mut one.pair else { continue };
            let unit = split_header_unit(&self.signals[pair.signal].name).map(|(_, unit)| unit);
            // The remark on a current states more.
            if let Some(unit) = unit.filter(|unit| *unit != "A" && unit_factor(unit, one.quantity).is_none()) {
                pair.reasons
                    .push(format!("the unit {unit} is no unit of `{}`", one.name));
                pair.is_guess = true;
            }
        }
    }

    /// The time of the recording, or its number of samples where there is none.
    fn time(&self) -> Vec<f64> {
        let time = self.ours.iter().find(|one| one.role == SignalRole::Time);
        let pair = time.and_then(|one| one.pair.as_ref());
        let n = self.signals.iter().map(|one| one.values.len()).max().unwrap_or(0);
        match pair.map(|pair| (&self.signals[pair.signal].values, pair)) {
            Some((values, pair)) if !values.is_empty() => {
                let unit = pair.unit.as_deref().or(self.signals[pair.signal].parts.unit.as_deref());
                let factor = unit
                    .and_then(|unit| unit_factor(unit, ColumnQuantity::Time))
                    .unwrap_or(1.0);
                values.iter().map(|t| factor * t).collect()
            }
            _ => (0..n).map(|k| k as f64).collect(),
        }
    }

    /// Whether a column is paired already.
    fn is_used(&self, signal: usize) -> bool {
        let mut pairs = self.ours.iter().filter_map(|one| one.pair.as_ref());
        pairs.any(|pair| pair.signal == signal)
    }

    /// Pairs names of the model with columns of the same name.
    fn pair_equal_names(&mut self) {
        for one in &mut self.ours {
            let signal = self.signals.iter().position(|signal| {
                let header = split_header_unit(&signal.name).map(|(base, _)| base);
                signal.name == one.name || header == Some(one.name.as_str())
            });
            one.pair = signal.map(|signal| ColumnPair {
                signal,
                unit: None,
                is_reversed: false,
                reasons: vec!["the same name".to_owned()],
                is_guess: false,
            });
        }
    }

    /// Finds the time, unless it has the name of the model.
    fn pair_time(&mut self) {
        if self
            .ours
            .iter()
            .any(|one| one.role == SignalRole::Time && one.pair.is_some())
        {
            return;
        }
        let Some(signal) = find_time(&self.signals) else {
            self.remarks
                .push("No column increases as times do; give the sampling rate when the recording is read.".to_owned());
            return;
        };
        let one = &self.signals[signal];
        let by_name = one.has_role(SignalRole::Time);
        let mut reasons = vec![
            if by_name {
                "by its name"
            } else {
                "it increases throughout"
            }
            .to_owned(),
        ];
        let mut unit = stated_unit(&one.parts);
        let by_step = suggest_time_unit(&one.values).filter(|_| one.parts.unit.is_none());
        let is_unit_guessed = by_step.is_some();
        if let Some(by_step) = by_step {
            unit = Some(by_step.to_owned());
            reasons.push("unit by the size of its steps".to_owned());
        }
        let pair = ColumnPair {
            signal,
            unit,
            is_reversed: false,
            reasons,
            is_guess: !by_name || is_unit_guessed,
        };
        if let Some(time) = self.ours.iter_mut().find(|one| one.role == SignalRole::Time) {
            time.pair = Some(pair);
        }
    }

    /// Gives roles to columns whose names have none: a column that is the rate of another one makes that a position.
    fn find_roles_by_numbers(&mut self) {
        let time = self.time();
        let is_open = |one: &FileSignal| one.parts.role.is_none() && !one.is_constant();
        let open: Vec<usize> = (0..self.signals.len())
            .filter(|i| is_open(&self.signals[*i]) && !self.is_used(*i))
            .collect();
        let links: Vec<(usize, usize)> = open
            .iter()
            .flat_map(|a| open.iter().map(move |b| (*a, *b)))
            .filter(|(a, b)| {
                let link = find_rate_link(&time, &self.signals[*a].values, &self.signals[*b].values);
                a != b && link.is_some_and(|link| link.correlation >= NAMELESS_LEAST_CORRELATION)
            })
            .collect();
        for (a, b) in &links {
            // Rates have rates too; the first of a chain is the position.
            let role = if links.iter().any(|(_, rate)| rate == a) {
                SignalRole::Rate
            } else {
                SignalRole::Position
            };
            self.signals[*a].parts.role = Some(role);
            if self.signals[*b].parts.role.is_none() {
                self.signals[*b].parts.role = Some(if role == SignalRole::Rate {
                    SignalRole::Acceleration
                } else {
                    SignalRole::Rate
                });
            }
        }
        // A name without a word for its kind, beside others of one joint that have one, is the position.
        let n_positions = self.ours.iter().filter(|one| one.role == SignalRole::Position).count();
        let named = self
            .signals
            .iter()
            .filter(|one| one.has_role(SignalRole::Position) && !one.parts.is_command);
        if named.count() < n_positions {
            let has_others = |parts: &NameParts| {
                self.signals.iter().any(|other| {
                    matches!(other.parts.role, Some(SignalRole::Rate | SignalRole::Force))
                        && other.parts.words == parts.words
                        && other.parts.numbers == parts.numbers
                })
            };
            let bare: Vec<usize> = (0..self.signals.len())
                .filter(|i| {
                    let one = &self.signals[*i];
                    one.parts.role.is_none() && !self.is_used(*i) && has_others(&one.parts)
                })
                .collect();
            for i in bare {
                self.signals[i].parts.role = Some(SignalRole::Position);
            }
        }
    }

    /// Pairs names of one role with columns whose names mean the same joint.
    fn pair_by_name(&mut self, role: SignalRole) {
        let wanted: Vec<usize> = self.open_names(role);
        let found: Vec<usize> = self.candidates(role);
        let shift = self.shift_of_numbers(&wanted, &found);
        // All pairs, the most similar ones first; torques before currents, and the order of the file after that.
        let mut all: Vec<(f64, usize, usize)> = Vec::new();
        for i in &wanted {
            for j in &found {
                let parts = &self.signals[*j].parts;
                let similar = self.ours[*i]
                    .parts
                    .iter()
                    .map(|ours| joint_similarity(ours, parts, shift));
                let similarity = similar.fold(0.0, f64::max);
                if similarity >= NAME_LEAST_SIMILARITY {
                    let is_current = parts.unit.as_deref() == Some("A") || self.signals[*j].name.contains("current");
                    all.push((similarity - if is_current { 0.01 } else { 0.0 }, *i, *j));
                }
            }
        }
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (similarity, i, j) in all {
            if self.ours[i].pair.is_some() || self.is_used(j) {
                continue;
            }
            let reason = if shift == 0 {
                "by its name".to_owned()
            } else {
                // Numbers of the file are larger by one if the model counts from 0.
                format!("by its name; the file counts joints from {}", u8::from(shift > 0))
            };
            self.ours[i].pair = Some(ColumnPair {
                signal: j,
                unit: stated_unit(&self.signals[j].parts),
                is_reversed: false,
                reasons: vec![reason],
                is_guess: similarity < 0.6,
            });
        }
    }

    /// Pairs all names of a role with its columns in their order, if there are as many and no name says more.
    fn pair_by_order(&mut self, role: SignalRole) {
        // Where names say which joint some columns belong to, the others belong to something else.
        if self.ours.iter().any(|one| one.role == role && one.pair.is_some()) {
            return;
        }
        let wanted = self.open_names(role);
        let mut found = self.candidates(role);
        let nameless: Vec<usize> = (0..self.signals.len())
            .filter(|i| self.signals[*i].parts.role.is_none() && !self.is_used(*i))
            .collect();
        // Columns without names: positions come before forces.
        if found.is_empty() {
            let others = if role == SignalRole::Position {
                self.open_names(SignalRole::Force).len()
            } else {
                0
            };
            if nameless.len() == wanted.len() + others {
                found = nameless[..wanted.len()].to_vec();
            }
        }
        if wanted.len() != found.len() {
            return;
        }
        for (i, j) in wanted.into_iter().zip(found) {
            self.ours[i].pair = Some(ColumnPair {
                signal: j,
                unit: stated_unit(&self.signals[j].parts),
                is_reversed: false,
                reasons: vec!["by the order of the columns".to_owned()],
                is_guess: true,
            });
        }
    }

    /// Names of a role without a pair.
    fn open_names(&self, role: SignalRole) -> Vec<usize> {
        let all = 0..self.ours.len();
        all.filter(|i| self.ours[*i].role == role && self.ours[*i].pair.is_none())
            .collect()
    }

    /// Columns of a role without a pair: measured ones, or requested ones if nothing was measured.
    fn candidates(&self, role: SignalRole) -> Vec<usize> {
        let of = |is_command: bool| -> Vec<usize> {
            (0..self.signals.len())
                .filter(|j| {
                    let one = &self.signals[*j];
                    one.has_role(role) && one.parts.is_command == is_command && !self.is_used(*j)
                })
                .collect()
        };
        let measured = of(false);
        if measured.is_empty() && !self.ours.iter().any(|one| one.role == role && one.pair.is_some()) {
            of(true)
        } else {
            measured
        }
    }

    /// What is added to the numbers of the model's joints to get those of the file, which may count from another one.
    fn shift_of_numbers(&self, wanted: &[usize], found: &[usize]) -> i64 {
        let ours = wanted
            .iter()
            .filter_map(|i| self.ours[*i].parts[0].numbers.last().copied());
        let ours: Vec<u64> = ours.collect();
        let theirs = found
            .iter()
            .filter_map(|j| self.signals[*j].parts.numbers.last().copied());
        let theirs: Vec<u64> = theirs.collect();
        let (Some(our_least), Some(our_most)) = (ours.iter().min(), ours.iter().max()) else {
            return 0;
        };
        let (Some(least), Some(most)) = (theirs.iter().min(), theirs.iter().max()) else {
            return 0;
        };
        // Both count without holes, one from 0 and the other from 1.
        let is_shifted = our_least + least == 1 && our_most - our_least == most - least;
        if is_shifted && ours.len() > 1 {
            i64::try_from(*least).unwrap_or(0) - i64::try_from(*our_least).unwrap_or(0)
        } else {
            0
        }
    }

    /// States degrees for angles that are too large for radians.
    fn state_units_of_positions(&mut self) {
        for one in &mut self.ours {
            let Some(pair) = &mut one.pair else { continue };
            let signal = &self.signals[pair.signal];
            let largest = signal.values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            if one.quantity == ColumnQuantity::Angle(0) && signal.parts.unit.is_none() && largest > LARGEST_ANGLE {
                pair.unit = Some("deg".to_owned());
                pair.reasons.push("unit by the size of its numbers".to_owned());
                pair.is_guess = true;
            }
        }
    }

    /// Compares forces with the model, where all positions are known; pairs those that have none by it.
    fn pair_forces_by_fit(&mut self) -> Outcome {
        let drives = self.model.row_names();
        let rows: Vec<Option<usize>> = (0..self.ours.len())
            .map(|i| drives.iter().position(|drive| *drive == self.ours[i].name))
            .collect();
        let candidates: Vec<usize> = (0..self.signals.len())
            .filter(|j| {
                let one = &self.signals[*j];
                let is_paired_force = self.ours.iter().any(|ours| {
                    ours.role == SignalRole::Force && ours.pair.as_ref().is_some_and(|pair| pair.signal == *j)
                });
                let is_open = !self.is_used(*j) && matches!(one.parts.role, None | Some(SignalRole::Force));
                let is_complete = !one.values.is_empty() && one.values.iter().all(|x| x.is_finite());
                (is_paired_force || is_open) && !one.parts.is_command && is_complete && !one.is_constant()
            })
            .collect();
        let Some(motion) = self.motion() else {
            return Ok(());
        };
        let forces: Vec<&[f64]> = candidates.iter().map(|j| self.signals[*j].values.as_slice()).collect();
        let Some(agreement) = compare_forces(self.model, motion, &forces)? else {
            return Ok(());
        };
        self.check_paired_forces(&rows, &candidates, &agreement);
        let shares = agreement.shares;
        // The best explained ones first.
        let mut all: Vec<(f64, usize, usize)> = Vec::new();
        for (i, row) in rows.iter().enumerate() {
            if let (Some(row), None) = (row, &self.ours[i].pair) {
                all.extend((0..candidates.len()).map(|c| (shares[*row][c], i, candidates[c])));
            }
        }
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (share, i, j) in all {
            if share >= FIT_LEAST_SHARE && self.ours[i].pair.is_none() && !self.is_used(j) {
                self.ours[i].pair = Some(ColumnPair {
                    signal: j,
                    unit: stated_unit(&self.signals[j].parts),
                    is_reversed: false,
                    reasons: vec![explained_text(share)],
                    is_guess: true,
                });
            }
        }
        Ok(())
    }

    /// Adds to forces with a pair how much of them the model explains, and names a column that fits better.
    fn check_paired_forces(&mut self, rows: &[Option<usize>], candidates: &[usize], agreement: &ForceAgreement) {
        let shares = &agreement.shares;
        for (one, row) in self.ours.iter_mut().zip(rows) {
            let (Some(row), Some(pair)) = (row, &mut one.pair) else {
                continue;
            };
            let Some(own) = candidates.iter().position(|j| *j == pair.signal) else {
                continue;
            };
            let share = shares[*row][own];
            pair.reasons.push(explained_text(share));
            if agreement.nominal[*row][own] < -SIGN_LEAST_CORRELATION {
                pair.reasons
                    .push("its sign is opposite to the forces of the nominal parameters".to_owned());
                pair.is_guess = true;
            }
            let best = (0..candidates.len()).max_by(|a, b| shares[*row][*a].total_cmp(&shares[*row][*b]));
            if let Some(best) = best.filter(|best| shares[*row][*best] > share + FIT_MARGIN) {
                pair.reasons.push(format!(
                    "but {} of `{}`",
                    percent_text(shares[*row][best]),
                    self.signals[candidates[best]].name
                ));
                pair.is_guess = true;
            }
        }
    }

    /// The time and the positions in SI units by the names of the model; `None` if one has no numbers.
    fn motion(&self) -> Option<Vec<(String, Vec<f64>)>> {
        let mut motion = Vec::new();
        for one in &self.ours {
            if one.role == SignalRole::Time {
                one.pair.as_ref()?;
                motion.push((one.name.clone(), self.time()));
            }
            if one.role == SignalRole::Position {
                let pair = one.pair.as_ref()?;
                let signal = &self.signals[pair.signal];
                let unit = pair.unit.as_deref().or(signal.parts.unit.as_deref());
                let factor = unit.and_then(|unit| unit_factor(unit, one.quantity)).unwrap_or(1.0);
                if signal.values.is_empty() || signal.values.iter().any(|x| !x.is_finite()) {
                    return None;
                }
                motion.push((one.name.clone(), signal.values.iter().map(|x| factor * x).collect()));
            }
        }
        Some(motion)
    }

    /// Compares rates with positions: adds rates that have no pair, states units, and leaves out what is no rate.
    fn check_rates(&mut self) {
        let Some(motion) = self.motion() else {
            return;
        };
        let time = self.time();
        let rates: Vec<usize> = (0..self.ours.len())
            .filter(|i| self.ours[*i].role == SignalRole::Rate)
            .collect();
        for i in rates {
            let position = position_of_rate(&self.ours[i].name);
            let Some((_, position)) = motion.iter().find(|(name, _)| name == position) else {
                continue;
            };
            let paired = self.ours[i].pair.as_ref().map(|pair| pair.signal);
            let choices: Vec<usize> = match paired {
                Some(signal) => vec![signal],
                None => self.candidates(SignalRole::Rate),
            };
            let links = choices.iter().filter_map(|j| {
                let link = find_rate_link(&time, position, &self.signals[*j].values)?;
                Some((*j, link))
            });
            let best = links.max_by(|a, b| a.1.correlation.abs().total_cmp(&b.1.correlation.abs()));
            match best {
                Some((signal, link)) => self.pair_rate(i, signal, link),
                // Without motion nothing is known; otherwise a wrong rate is worse than none.
                None => {
                    if let Some(signal) = paired
                        && !self.signals[signal].is_constant()
                        && !self.signals[signal].values.is_empty()
                    {
                        self.ours[i].pair = None;
                        self.remarks.push(format!(
                            "`{}` is not the rate of `{}` by its numbers and is left out; the rate is computed from positions \
                             then.",
                            self.signals[signal].name,
                            position_of_rate(&self.ours[i].name)
                        ));
                    }
                }
            }
        }
    }

    /// Pairs a rate with the signal that is the derivative of its position.
    fn pair_rate(&mut self, i: usize, signal: usize, link: RateLink) {
        let parts = &self.signals[signal].parts;
        let known = parts
            .unit
            .as_deref()
            .and_then(|unit| unit_factor(unit, self.ours[i].quantity));
        let is_near = |factor: f64| (link.ratio.abs() * factor - 1.0).abs() < UNIT_TOLERANCE;
        let mut unit = stated_unit(parts);
        let mut reasons = vec![format!(
            "the rate of its position (correlation {:.3})",
            link.correlation.abs()
        )];
        if !is_near(known.unwrap_or(1.0)) {
            let is_angle = matches!(self.ours[i].quantity, ColumnQuantity::Angle(_));
            let other = RATE_UNITS
                .iter()
                .find(|(_, factor)| is_angle && known.is_none() && is_near(*factor));
            match other {
                Some((name, _)) => {
                    unit = Some((*name).to_owned());
                    reasons.push("unit by the size of its numbers".to_owned());
                }
                // Another factor has no unit; a wrong rate is worse than one that is computed.
                None => {
                    self.ours[i].pair = None;
                    self.remarks.push(format!(
                        "`{}` is {:.3} times the rate of `{}` and is left out; check the units of both.",
                        self.signals[signal].name,
                        link.ratio,
                        position_of_rate(&self.ours[i].name)
                    ));
                    return;
                }
            }
        }
        if link.ratio < 0.0 {
            reasons.push("with the opposite sign".to_owned());
        }
        self.ours[i].pair = Some(ColumnPair {
            signal,
            unit,
            is_reversed: link.ratio < 0.0,
            reasons,
            is_guess: false,
        });
    }

    /// The pairs as a proposal.
    pub(super) fn into_proposal(self) -> ColumnProposal {
        let is_needed = |one: &&ModelColumn| {
            let is_kind = matches!(one.role, SignalRole::Time | SignalRole::Position | SignalRole::Force);
            is_kind && one.pair.is_none()
        };
        let missing = self.ours.iter().filter(is_needed).map(|one| one.name.clone()).collect();
        let columns = self.ours.iter().filter_map(|one| {
            let pair = one.pair.as_ref()?;
            let sign = if pair.is_reversed { "-" } else { "" };
            let name = &self.signals[pair.signal].name;
            let column = match &pair.unit {
                Some(unit) => format!("{sign}{name} [{unit}]"),
                None => format!("{sign}{name}"),
            };
            Some(ProposedColumn {
                name: one.name.clone(),
                column,
                reason: pair.reasons.join("; "),
                is_guess: pair.is_guess,
            })
        });
        ColumnProposal {
            model: self.model.derivation.mechanism.name.clone(),
            columns: columns.collect(),
            missing,
            remarks: self.remarks,
        }
    }
}

/// The unit that a mapping must state: none if the name of the column has it in brackets, or it is the SI unit.
fn stated_unit(parts: &NameParts) -> Option<String> {
    let unit = parts.unit.clone().filter(|_| !parts.has_header_unit)?;
    let is_si = ["s", "rad", "rad/s", "N m", "N", "m", "A"].contains(&unit.as_str());
    (!is_si).then_some(unit)
}

/// The name of the position of a rate of the model. It may end in `_d` itself.
fn position_of_rate(rate: &str) -> &str {
    rate.strip_suffix("_d").unwrap_or(rate)
}

/// How much of a force the model explains. Friction and an offset are added, since they are often missing in a model.
fn explained_text(share: f64) -> String {
    format!(
        "the model explains {} of it, with friction and an offset added",
        percent_text(share)
    )
}

/// A share in percent.
fn percent_text(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

/// The names of a model that may have columns, in the order of the model.
fn model_columns(mechanism: &Mechanism) -> Vec<ModelColumn> {
    let drives: Vec<_> = mechanism.drives.iter().chain(&mechanism.shared_drives).collect();
    let columns = mechanism.columns().into_iter().filter_map(|(name, quantity)| {
        let role = match quantity {
            ColumnQuantity::Time => SignalRole::Time,
            ColumnQuantity::Angle(0) | ColumnQuantity::Length(0) | ColumnQuantity::Number => SignalRole::Position,
            ColumnQuantity::Angle(1) | ColumnQuantity::Length(1) => SignalRole::Rate,
            ColumnQuantity::Angle(_) | ColumnQuantity::Length(_) => SignalRole::Acceleration,
            ColumnQuantity::Force | ColumnQuantity::Torque => SignalRole::Force,
            // Variances and signals of actuators are never guessed.
            ColumnQuantity::ForceVariance
            | ColumnQuantity::TorqueVariance
            | ColumnQuantity::Current
            | ColumnQuantity::Voltage
            | ColumnQuantity::Pressure => return None,
        };
        let mut names = vec![name.clone()];
        if matches!(role, SignalRole::Rate | SignalRole::Acceleration) {
            let bare = name.strip_suffix("_dd").or_else(|| name.strip_suffix("_d"));
            names = vec![bare.unwrap_or(&name).to_owned()];
        }
        if let Some(drive) = drives.iter().find(|drive| drive.name == name)
            && let DriveKind::Joint(coordinate) = drive.kind
        {
            names.push(mechanism.coordinates[coordinate.0].name.clone());
        }
        Some(ModelColumn {
            parts: names.iter().map(|name| NameParts::new(name)).collect(),
            name,
            quantity,
            role,
            pair: None,
        })
    });
    let undriven = |name: &String| {
        mechanism
            .drives
            .iter()
            .any(|drive| drive.name == *name && !drive.is_driven)
    };
    // Signals of actuators have no relation to motion and force by which they could be recognised.
    let is_signal = |name: &String| mechanism.actuators.iter().any(|actuator| actuator.signal == *name);
    columns
        .filter(|one| !undriven(&one.name) && !is_signal(&one.name))
        .collect()
}

#[cfg(test)]
mod tests;
