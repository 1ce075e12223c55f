//! One fit of all runs in which base parameters are shared and requested values are separate for each run. Loads of
//! known mass determine the scales of measured forces.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::ParameterInfo;
use modelmill_identify::changes::{JointFit, JointRun, JointValues, fit_jointly};
use modelmill_spec::{FrameStep, Mechanism, ModelSymbol};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::runs::changes::{friction, offset, viscous_unit};
use crate::runs::layout::RunColumnLayout;
use crate::runs::payload::{PayloadColumns, TEN};
use crate::runs::rows::WhitenedRun;
use crate::runs::{ChangeEstimate, FittedValue, PhysicalChange, RunChange, centre};

/// Kinds of values that may be separate for each run.
const KINDS: [&str; 6] = ["payload", "friction", "offset", "gain", "clock", "zero"];
/// Names and units of a body's ten parameters.
const BODY_PARAMETERS: [(&str, &str); TEN] = [
    ("mass", "kg"),
    ("mx", "kg m"),
    ("my", "kg m"),
    ("mz", "kg m"),
    ("xx", "kg m^2"),
    ("xy", "kg m^2"),
    ("xz", "kg m^2"),
    ("yy", "kg m^2"),
    ("yz", "kg m^2"),
    ("zz", "kg m^2"),
];

/// Values that are separate for each run: a kind, and optionally a place.
///
/// ```
/// use modelmill::runs::PerRunSelection;
///
/// assert!(PerRunSelection::parse("payload@flange").is_ok());
/// assert!(PerRunSelection::parse("payload").is_err());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PerRunSelection {
    /// One of [`KINDS`], or the name of a base parameter.
    what: String,
    /// Frame, drive or coordinate; `None` selects all places of the kind.
    at: Option<String>,
}

impl PerRunSelection {
    /// Reads `payload@FRAME`, `friction`, `friction@DRIVE`, `offset`, `offset@DRIVE`, `gain`, `gain@DRIVE`, `clock`,
    /// `zero`, `zero@COORDINATE`, or the name of a base parameter.
    ///
    /// Fails with the expected form, as text.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (what, at) = match text.split_once('@') {
            Some((what, at)) => (what.trim(), Some(at.trim())),
            None => (text.trim(), None),
        };
        // What is no kind may be the name of a base parameter, which is checked with the model.
        let is_kind = KINDS.contains(&what);
        let says = if what.is_empty() || at == Some("") {
            "a kind and a place are expected, such as `payload@flange` or `friction`"
        } else if what == "payload" && at.is_none() {
            "a payload needs its body, as in `payload@flange`"
        } else if what == "clock" && at.is_some() {
            "a run has one clock; use `clock` without a place"
        } else if !is_kind && at.is_some() {
            "kinds are payload, friction, offset, gain, clock, zero"
        } else {
            return Ok(Self {
                what: what.to_owned(),
                at: at.map(str::to_owned),
            });
        };
        Err(format!("`{text}`: {says}"))
    }
}

/// A load of known mass on a body in one of the runs.
///
/// ```
/// use modelmill::runs::KnownLoad;
///
/// let load = KnownLoad::parse("with-tool.csv=2.8@flange").unwrap();
/// assert_eq!((load.mass, load.frame.as_str()), (2.8, "flange"));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct KnownLoad {
    /// The run, as the end of its file name.
    pub run: String,
    /// Mass of the load, kg.
    pub mass: f64,
    /// The frame that carries it.
    pub frame: String,
}

impl KnownLoad {
    /// Reads `RUN=MASS@FRAME`, such as `with-tool.csv=2.8@flange`.
    ///
    /// Fails with the expected form, as text.
    pub fn parse(text: &str) -> Result<Self, String> {
        let expected =
            || format!("`{text}`: a run, its load in kg and the body are expected, as in `with-tool.csv=2.8@flange`");
        let (run, load) = text.rsplit_once('=').ok_or_else(expected)?;
        let (mass, frame) = load.split_once('@').ok_or_else(expected)?;
        let mass: f64 = mass.trim().parse().map_err(|_| expected())?;
        if run.trim().is_empty() || frame.trim().is_empty() || !(mass.is_finite() && mass != 0.0) {
            return Err(expected());
        }
        Ok(Self {
            run: run.trim().to_owned(),
            mass,
            frame: frame.trim().to_owned(),
        })
    }
}

/// A separate value of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunValue {
    /// The quantity, as it was requested: `payload@flange`, `friction@joint1`.
    pub quantity: String,
    /// Its symbol within the quantity.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Whether the value is relative to the first run, where it is zero, and not absolute.
    pub is_against_first: bool,
    /// The value.
    pub value: FittedValue,
}

/// The fit of all runs.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedFit {
    /// Shared base parameters, by index; `None` for those that are separate for each run.
    pub shared: Vec<Option<FittedValue>>,
    /// Names of drives, each with the factor from its measured force to the true force. Empty if no load of known mass
    /// was given.
    pub gains: Vec<(String, FittedValue)>,
    /// The runs, each with its separate values.
    pub runs: Vec<(String, Vec<RunValue>)>,
}

/// Columns of one requested quantity.
struct PerRunColumns {
    /// Its name, as in [`RunValue::quantity`].
    quantity: String,
    /// Indices of its columns.
    columns: Vec<usize>,
    /// Symbols and units of the values.
    names: Vec<(String, String)>,
    /// Whether the first run has none of it.
    is_against_first: bool,
    /// Value without a change: 1 for factors, else 0.
    origin: f64,
}

/// A run of the fit.
struct SharedRun {
    /// Name of the file.
    file: String,
    /// Its sums: one for each drive if there are loads, else one.
    sums: Vec<modelmill_identify::changes::NormalEquations>,
    /// Columns of what was found to differ from the first run.
    changed: Vec<usize>,
}

/// Collects the runs of the fit.
pub(crate) struct SharedFitBuilder<'a> {
    /// The model.
    model: &'a Model,
    /// Order of the columns.
    layout: RunColumnLayout,
    /// Columns that are separate for each run.
    own: Vec<PerRunColumns>,
    /// Loads of known mass.
    loads: &'a [KnownLoad],
    /// First column of each load's body.
    loaded: Vec<usize>,
    /// Names of the frames that may carry a load, in the order of the columns.
    frames: Vec<String>,
    /// Columns that the fit uses, ascending.
    used: Vec<usize>,
    /// The runs in their order.
    runs: Vec<SharedRun>,
}

impl<'a> SharedFitBuilder<'a> {
    /// An empty fit for the requests.
    ///
    /// Fails when a request names something that the model does not have.
    pub(crate) fn new(
        model: &'a Model,
        payloads: &PayloadColumns,
        layout: RunColumnLayout,
        request: &'a super::RunsOptions,
    ) -> Outcome<Self> {
        let infos = model.parameter_infos();
        let mut own: Vec<PerRunColumns> = Vec::new();
        // Two requests of the same columns count once.
        for one in &request.per_run {
            for further in per_run_columns(model, payloads, layout, &infos, one)? {
                if own.iter().all(|other| other.columns != further.columns) {
                    own.push(further);
                }
            }
        }
        let loaded: Outcome<Vec<usize>> = (request.loads.iter())
            .map(|load| Ok(layout.payload(loaded_frame(model, payloads, &load.frame)?)))
            .collect();
        let loaded = loaded?;
        // Of all possible changes, only the requested columns are kept. With loads anything may have changed in a run.
        let further = layout.base..if loaded.is_empty() { layout.base } else { layout.total() };
        let mut used: Vec<usize> = (0..layout.base)
            .chain(own.iter().flat_map(|one| one.columns.iter().copied()))
            .chain(further)
            .collect();
        used.sort_unstable();
        used.dedup();
        Ok(Self {
            model,
            layout,
            own,
            loads: &request.loads,
            loaded,
            frames: payloads.frames.clone(),
            used,
            runs: Vec::new(),
        })
    }

    /// Whether a fit was requested.
    fn is_requested(&self) -> bool {
        !self.own.is_empty() || !self.loads.is_empty()
    }

    /// Adds a run, by the sums of its used columns. `changes` are those that were found relative to the first run.
    pub(crate) fn add_run(&mut self, file: &str, white: &WhitenedRun, changes: &[RunChange]) {
        if !self.is_requested() {
            return;
        }
        // Scales of forces need the sums of each drive, otherwise their total suffices.
        let sums = if self.loads.is_empty() {
            vec![white.total().select_columns(&self.used)]
        } else {
            white.drives.iter().map(|one| one.select_columns(&self.used)).collect()
        };
        self.runs.push(SharedRun {
            file: file.to_owned(),
            sums,
            changed: changes
                .iter()
                .flat_map(|one| self.changed_columns(&one.change))
                .collect(),
        });
    }

    /// The columns of a change.
    fn changed_columns(&self, change: &PhysicalChange) -> Vec<usize> {
        let (layout, drives) = (self.layout, self.model.row_names());
        let at = |names: &[String], name: &String| names.iter().position(|one| one == name);
        let columns = match change {
            PhysicalChange::Payload { frame, .. } => {
                at(&self.frames, frame).map(|k| layout.payload(k)..layout.payload(k) + TEN)
            }
            PhysicalChange::Friction { drive, .. } => {
                at(&drives, drive).map(|d| layout.friction(d)..layout.friction(d) + 2)
            }
            PhysicalChange::Offset { drive, .. } => at(&drives, drive).map(|d| layout.offset(d)..layout.offset(d) + 1),
            PhysicalChange::Scale { drive, .. } => at(&drives, drive).map(|d| layout.scale(d)..layout.scale(d) + 1),
            PhysicalChange::EncoderZero { coordinate, .. } => {
                at(&self.model.active_coordinates(), coordinate).map(|i| layout.zero(i)..layout.zero(i) + 1)
            }
            // A clock is corrected before the sums, and contacts are left out of them.
            PhysicalChange::Clock { .. } | PhysicalChange::ContactEvent { .. } => None,
        };
        columns.map_or_else(Vec::new, Iterator::collect)
    }

    /// The index of a column among the used ones.
    fn place(&self, column: usize) -> usize {
        self.used.partition_point(|other| *other < column)
    }

    /// The fit; `None` if none was requested.
    ///
    /// Fails when the name of a load's run is not unique.
    pub(crate) fn answer(self) -> Outcome<Option<SharedFit>> {
        if !self.is_requested() {
            return Ok(None);
        }
        let loads: Outcome<Vec<usize>> = self.loads.iter().map(|load| self.run_of_load(load)).collect();
        let loads = loads?;
        // Base parameters that are separate for each run are not shared.
        let absolute = (self.own.iter()).filter(|one| !one.is_against_first);
        let not_shared: Vec<usize> = absolute.flat_map(|one| one.columns.clone()).collect();
        let shared: Vec<usize> = (0..self.layout.base).filter(|k| !not_shared.contains(k)).collect();
        let parts: Vec<(JointRun, Vec<&PerRunColumns>)> =
            (0..self.runs.len()).map(|r| self.run_part(r, &loads)).collect();
        let (parts, owns): (Vec<JointRun>, Vec<Vec<&PerRunColumns>>) = parts.into_iter().unzip();
        let places: Vec<usize> = shared.iter().map(|k| self.place(*k)).collect();
        let found = fit_jointly(&parts, &places, !self.loads.is_empty());
        Ok(Some(self.shared_fit(&found, &shared, &parts, &owns)))
    }

    /// The index of the run that carries a load.
    ///
    /// Fails when no run or several runs match its name.
    fn run_of_load(&self, load: &KnownLoad) -> Outcome<usize> {
        let names = self.runs.iter().enumerate();
        // The name must be complete path components at the end of the file name.
        let found: Vec<usize> = names
            .filter(|(_, run)| {
                let before = run.file.strip_suffix(load.run.as_str());
                before.is_some_and(|before| before.is_empty() || before.ends_with(['/', '\\']))
            })
            .map(|(r, _)| r)
            .collect();
        match found[..] {
            [one] => Ok(one),
            _ => Err(Error::options(message!(
                "`{}` of {} matches {} of the runs; give the end of one file name: {}",
                load.run,
                Remedy::option(OptionName::Loads),
                if found.is_empty() { "none" } else { "several" },
                self.runs
                    .iter()
                    .map(|run| run.file.as_str())
                    .collect::<Vec<_>>()
                    .join(", ")
            ))),
        }
    }

    /// The separate columns of a run, with the known mass of its load.
    fn run_part(&self, r: usize, loads: &[usize]) -> (JointRun, Vec<&PerRunColumns>) {
        let owns: Vec<&PerRunColumns> = (self.own.iter()).filter(|one| r > 0 || !one.is_against_first).collect();
        let mut own: Vec<usize> = owns.iter().flat_map(|one| one.columns.clone()).collect();
        let mut known = Vec::new();
        // What else differs from the first run has values of its own: a load of unknown mass would count as none, and make
        // the factors of the forces wrong. Of a run with a known load, the load explains what was found.
        if !self.loads.is_empty() && !loads.contains(&r) {
            let further = self.runs[r].changed.iter().filter(|k| !own.contains(k));
            let further: Vec<usize> = further.copied().collect();
            own.extend(further);
        }
        for ((load, at), _) in (self.loads.iter().zip(&self.loaded))
            .zip(loads)
            .filter(|(_, run)| **run == r)
        {
            // The first of the ten columns is the mass; centre and inertia of the load are unknown.
            known.push((self.place(*at), load.mass));
            let further = (*at + 1..*at + TEN).filter(|k| !own.contains(k));
            let further: Vec<usize> = further.collect();
            own.extend(further);
        }
        let is_known = |k: &usize| known.iter().any(|(at, _)| at == k);
        let own = own.into_iter().map(|k| self.place(k));
        let part = JointRun {
            channels: self.runs[r].sums.clone(),
            own: own.filter(|k| !is_known(k)).collect(),
            known,
        };
        (part, owns)
    }

    /// The result, in the order of the model's base parameters.
    fn shared_fit(
        &self,
        found: &JointFit,
        shared: &[usize],
        parts: &[JointRun],
        owns: &[Vec<&PerRunColumns>],
    ) -> SharedFit {
        let unknown: Vec<usize> = (0..self.model.base.len())
            .filter(|k| !self.model.is_known(*k))
            .collect();
        let of_base = |k: usize| match unknown.iter().position(|one| *one == k) {
            None => Some(FittedValue {
                value: self.model.values[k],
                std: Some(0.0),
            }),
            Some(column) => {
                let at = shared.iter().position(|one| *one == column)?;
                Some(fitted_value(&found.shared, at))
            }
        };
        // The fit has the scale of the measured force; its inverse corrects the force.
        let gain = |(d, drive): (usize, String)| {
            let scale = fitted_value(&found.shared, shared.len() + d);
            let value = scale.value.recip();
            let std = scale.std.map(|one| one * value * value);
            (drive, FittedValue { value, std })
        };
        let drives = self.model.row_names().into_iter().enumerate();
        let runs = self.runs.iter().zip(parts).zip(owns).zip(&found.own);
        SharedFit {
            shared: (0..self.model.base.len()).map(of_base).collect(),
            gains: (drives.filter(|_| !self.loads.is_empty())).map(gain).collect(),
            runs: runs
                .map(|(((run, part), owns), values)| {
                    let own = owns.iter().flat_map(|own| self.values(own, part, values));
                    (run.file.clone(), own.collect())
                })
                .collect(),
        }
    }

    /// The values of one quantity in a run, with the centre of a load.
    fn values(&self, own: &PerRunColumns, part: &JointRun, values: &JointValues) -> Vec<RunValue> {
        let at = |column: &usize| {
            let place = self.place(*column);
            part.own.iter().position(|one| *one == place)
        };
        let places: Vec<Option<usize>> = own.columns.iter().map(at).collect();
        let valued = |name: &str, unit: &str, value: FittedValue| RunValue {
            quantity: own.quantity.clone(),
            name: name.to_owned(),
            unit: unit.to_owned(),
            is_against_first: own.is_against_first,
            value,
        };
        let mut run_values: Vec<RunValue> = (own.names.iter().zip(&places))
            .filter_map(|((name, unit), place)| {
                let mut one = fitted_value(values, (*place)?);
                one.value += own.origin;
                Some(valued(name, unit, one))
            })
            .collect();
        // The centre needs mass and first moments in the fit.
        if let (TEN, Some(places)) = (
            own.columns.len(),
            places.iter().take(4).copied().collect::<Option<Vec<usize>>>(),
        ) {
            let four = JointValues {
                values: values.values.select_rows(&places),
                covariance: values.covariance.select_rows(&places).select_columns(&places),
                determined: places.iter().map(|k| values.determined[*k]).collect(),
            };
            let axes = ["x", "y", "z"].into_iter().zip(centre(&four));
            run_values.extend(axes.filter_map(|(axis, at)| {
                let ChangeEstimate { value, std } = at?;
                let std = Some(std);
                Some(valued(axis, "m", FittedValue { value, std }))
            }));
        }
        run_values
    }
}

/// The value at an index of the fit, with its standard deviation.
fn fitted_value(values: &JointValues, at: usize) -> FittedValue {
    let variance = values.covariance[(at, at)].max(0.0);
    FittedValue {
        value: values.values[at],
        std: values.determined[at].then(|| variance.sqrt()),
    }
}

/// Index of a frame among those that may carry a load.
///
/// Fails when there is no such body; the message lists all.
fn frame(payloads: &PayloadColumns, name: &str) -> Outcome<usize> {
    let at = payloads.frames.iter().position(|frame| frame == name);
    at.ok_or_else(|| unknown_name_error("body", name, &payloads.frames))
}

/// Index of a frame with a known load among those that may carry one: also a frame without a body of its own counts, such
/// as the flange of a link, if it is rigidly connected to one of them.
///
/// Fails when there is no such frame; the message lists those with bodies.
fn loaded_frame(model: &Model, payloads: &PayloadColumns, name: &str) -> Outcome<usize> {
    let mechanism = &model.derivation.mechanism;
    let index = |name: &str| mechanism.frames.iter().position(|frame| frame.name == name);
    let root = |name: &str| index(name).map(|k| rigid_root(mechanism, k));
    let is_connected = |other: &String| root(name).is_some_and(|at| at > 0 && root(other) == Some(at));
    let exact = payloads.frames.iter().position(|frame| frame == name);
    let connected = payloads.frames.iter().position(is_connected);
    exact
        .or(connected)
        .ok_or_else(|| unknown_name_error("body", name, &payloads.frames))
}

/// The first frame on the way to the base to which a frame is rigidly connected.
fn rigid_root(mechanism: &Mechanism, frame: usize) -> usize {
    let mut at = frame;
    while at > 0 && mechanism.frames[at].steps.iter().all(is_fixed_step) {
        at = mechanism.frames[at].parent.0;
    }
    at
}

/// Whether no coordinate moves a step between frames.
fn is_fixed_step(step: &FrameStep) -> bool {
    match step {
        FrameStep::Rotate(_, angle) => {
            let mut symbols = angle.terms.iter().map(|(symbol, _)| symbol);
            !symbols.any(|symbol| matches!(symbol, ModelSymbol::Coordinate(_)))
        }
        FrameStep::Translate(_, length) => length.coordinates.is_empty(),
        FrameStep::Free(_) => false,
    }
}

/// The error of an unknown name.
fn unknown_name_error(what: &str, name: &str, names: &[String]) -> Error {
    Error::options(format!("there is no {what} `{name}`; there are {}", names.join(", ")))
}

/// The columns of a request, one entry for each of its places.
///
/// Fails when the kind or the place is unknown.
fn per_run_columns(
    model: &Model,
    payloads: &PayloadColumns,
    layout: RunColumnLayout,
    infos: &[ParameterInfo],
    request: &PerRunSelection,
) -> Outcome<Vec<PerRunColumns>> {
    let PerRunSelection { what, at } = request;
    // Without a place, all places of the kind are used.
    let places = |what: &str, names: Vec<String>| match at {
        None => Ok((0..names.len()).collect::<Vec<usize>>()),
        Some(at) => match names.iter().position(|name| name == at) {
            Some(k) => Ok(vec![k]),
            None => Err(unknown_name_error(what, at, &names)),
        },
    };
    let named = |all: &[(&str, &str)]| -> Vec<(String, String)> {
        let both = |(name, unit): &(&str, &str)| ((*name).to_owned(), (*unit).to_owned());
        all.iter().map(both).collect()
    };
    let drives = model.row_names();
    Ok(match what.as_str() {
        "payload" => {
            let name = at.as_deref().unwrap_or_default();
            let start = layout.payload(frame(payloads, name)?);
            vec![PerRunColumns {
                quantity: format!("payload@{name}"),
                columns: (start..start + TEN).collect(),
                names: named(&BODY_PARAMETERS),
                is_against_first: true,
                origin: 0.0,
            }]
        }
        "friction" => (places("drive", drives.clone())?.into_iter())
            .map(|d| {
                let unit = model.force_unit(d);
                let start = layout.friction(d);
                // Friction of the model is given as an absolute value.
                let own = friction(model, d);
                let (columns, is_against_first) = match own {
                    [Some(dry), Some(viscous)] => (vec![dry, viscous], false),
                    _ => (vec![start, start + 1], true),
                };
                PerRunColumns {
                    quantity: format!("friction@{}", drives[d]),
                    columns,
                    names: named(&[("Fc", unit), ("Fv", viscous_unit(unit))]),
                    is_against_first,
                    origin: 0.0,
                }
            })
            .collect(),
        "offset" => (places("drive", drives.clone())?.into_iter())
            .map(|d| {
                let own = offset(model, d);
                PerRunColumns {
                    quantity: format!("offset@{}", drives[d]),
                    columns: vec![own.unwrap_or(layout.offset(d))],
                    names: named(&[("F0", model.force_unit(d))]),
                    is_against_first: own.is_none(),
                    origin: 0.0,
                }
            })
            .collect(),
        "gain" => (places("drive", drives.clone())?.into_iter())
            .map(|d| PerRunColumns {
                quantity: format!("gain@{}", drives[d]),
                columns: vec![layout.scale(d)],
                names: named(&[("gain", "1")]),
                is_against_first: true,
                origin: 1.0,
            })
            .collect(),
        "clock" => vec![PerRunColumns {
            quantity: "clock".to_owned(),
            columns: vec![layout.clock()],
            names: named(&[("factor", "1")]),
            is_against_first: true,
            origin: 1.0,
        }],
        "zero" => (places("coordinate", model.active_coordinates())?.into_iter())
            .map(|i| {
                let (name, is_angle) = &model.active_coordinate_types()[i];
                PerRunColumns {
                    quantity: format!("zero@{name}"),
                    columns: vec![layout.zero(i)],
                    names: named(&[("shift", if *is_angle { "rad" } else { "m" })]),
                    is_against_first: true,
                    origin: 0.0,
                }
            })
            .collect(),
        name => vec![base_parameter(model, payloads, infos, name)?],
    })
}

/// The column of an unknown base parameter with a name.
///
/// Fails when there is no such parameter, or when its value is known.
fn base_parameter(
    model: &Model,
    payloads: &PayloadColumns,
    infos: &[ParameterInfo],
    name: &str,
) -> Outcome<PerRunColumns> {
    let unknown: Vec<usize> = (0..model.base.len()).filter(|k| !model.is_known(*k)).collect();
    let Some(column) = unknown.iter().position(|k| infos[*k].name == name) else {
        return Err(Error::options(format!(
            "`{name}` is neither a base parameter whose value is unknown nor a kind; kinds are {}, as in `payload@{}`, \
             `friction` or `gain@{}`",
            KINDS.join(", "),
            payloads.frames.last().map_or("body", String::as_str),
            model.row_names().first().map_or("drive", String::as_str)
        )));
    };
    Ok(PerRunColumns {
        quantity: name.to_owned(),
        columns: vec![column],
        names: vec![(name.to_owned(), infos[unknown[column]].unit.clone())],
        is_against_first: false,
        origin: 0.0,
    })
}
