//! Constants, parameters and coordinates: the names that expressions may use.

use std::cell::Cell;

use crate::build::Places;
use crate::diagnostic::{Diagnostic, Log, Span};
use crate::exact::{ConstantIdx, CoordinateIdx, Exact, ParameterIdx, Symbol};
use crate::formula::{Ast, AstKind, Formula};
use crate::joint_motion::Motion;
use crate::mechanism::{Constant, Coordinate, Parameter};
use crate::schema::{LinearEntry, LinearNominalEntry, ModelEntry};
use crate::scope::{Meaning, Scope, Sort, Wanted, meaning};
use crate::unit::Dimension;
use crate::values::Vector;

/// Most coordinates of a mechanism.
const MOST_COORDINATES: usize = 100;
/// Further ones that are looked at although the file has too many.
const DECLARED_AT_MOST: usize = 1000;

/// What the names of a file stand for.
pub(crate) struct Symbols {
    pub(crate) scope: Scope,
    pub(crate) constants: Vec<Constant>,
    pub(super) parameters: Vec<Parameter>,
    /// Where each parameter got its nominal value; those of effects and shorthands may get one later.
    pub(super) nominal_given: Vec<Option<Span>>,
    pub(super) coordinates: Vec<Coordinate>,
    /// Coordinates that no frame mentions.
    still: Vec<CoordinateIdx>,
}

/// What became of a parameter's name that may be declared already.
pub(super) enum Shared {
    /// No one has declared it yet.
    New,
    /// It is this parameter.
    Known(ParameterIdx),
    /// It is something else, which is reported.
    Faulty,
}

/// The linear parameters in the order in which a shorthand declares them, with their dimensions.
pub(super) const LINEAR: [(&str, Dimension); 10] = [
    ("XX", Dimension::INERTIA),
    ("XY", Dimension::INERTIA),
    ("XZ", Dimension::INERTIA),
    ("YY", Dimension::INERTIA),
    ("YZ", Dimension::INERTIA),
    ("ZZ", Dimension::INERTIA),
    ("MX", Dimension::FIRST_MOMENT),
    ("MY", Dimension::FIRST_MOMENT),
    ("MZ", Dimension::FIRST_MOMENT),
    ("M", Dimension::MASS),
];
/// Those of a body in the x-y plane.
const PLANAR: [&str; 4] = ["ZZ", "MX", "MY", "M"];

/// Declares all names of a file.
pub(super) fn declare(model: &ModelEntry, places: &mut Places, log: &mut Log) -> Symbols {
    let mut symbols = Symbols {
        scope: Scope::default(),
        constants: Vec::new(),
        parameters: Vec::new(),
        nominal_given: Vec::new(),
        coordinates: Vec::new(),
        still: Vec::new(),
    };
    for (key, entry) in model.constants.iter().flat_map(|table| &table.entries) {
        let symbol = Symbol::Constant(ConstantIdx(symbols.constants.len()));
        let unit = entry.unit.as_ref();
        let unit_text = unit.map_or("?", |unit| unit.text.as_str());
        let dimension = unit.map(|unit| unit.dimension);
        let meaning = Meaning {
            value: entry.value.map(|number| number.value),
            ..meaning(Sort::Constant, symbol, dimension, unit_text, Some(key.span))
        };
        if symbols.scope.declare(&key.name, meaning, log) {
            symbols.constants.push(Constant {
                name: key.name.clone(),
                value: entry.value.map_or(1.0, |number| number.value),
                unit: unit_text.to_owned(),
                is_angle: unit.is_some_and(crate::unit::Unit::is_angle),
                note: entry.note.as_ref().map(|note| note.text.clone()),
            });
        }
    }
    for (key, entry) in model.parameters.iter().flat_map(|table| &table.entries) {
        let unit = entry.unit.as_ref();
        symbols.declare_parameter(
            Parameter {
                name: key.name.clone(),
                nominal: entry.nominal.map_or(0.0, |number| number.value),
                unit: unit.map_or_else(|| "?".to_owned(), |unit| unit.text.clone()),
                note: entry.note.as_ref().map(|note| note.text.clone()),
            },
            unit.map(|unit| unit.dimension),
            key.span,
            entry.nominal.map(|number| number.span),
            log,
        );
    }
    declare_shorthands(model, &mut symbols, log);
    declare_coordinates(model, &mut symbols, places, log);
    declare_faulty(model, &mut symbols, log);
    symbols
}

/// Declares the names whose entries could not be read, with a meaning that fits anything:
/// what is wrong with them is reported, and they are not unknown.
fn declare_faulty(model: &ModelEntry, symbols: &mut Symbols, log: &mut Log) {
    let constants = model.constants.iter().flat_map(|table| &table.faulty);
    let parameters = model.parameters.iter().flat_map(|table| &table.faulty);
    let coordinates = model.coordinates.iter().flat_map(|table| &table.faulty);
    let all = constants
        .map(|key| (key, Sort::Constant))
        .chain(parameters.map(|key| (key, Sort::Parameter)))
        .chain(coordinates.map(|key| (key, Sort::Coordinate)));
    for (key, sort) in all {
        let meaning = Meaning {
            sort,
            exact: Exact::zero(),
            dimension: None,
            unit: "?".to_owned(),
            value: None,
            declared: Some(key.span),
            used: Cell::new(false),
        };
        symbols.scope.declare(&key.name, meaning, log);
    }
}

/// Reports coordinates that no joint moves by, and a mechanism without any.
pub(super) fn check_coordinates_move(
    model: &ModelEntry,
    symbols: &Symbols,
    places: &Places,
    log: &mut Log,
) {
    if log.syntax_broken || model.frame.as_ref().is_some_and(|list| list.faulty) {
        return; // A faulty frame may be the one that moves.
    }
    for &CoordinateIdx(idx) in &symbols.still {
        log.push(
            Diagnostic::error(
                places.coordinates[idx],
                format!("no joint moves by `{}`", symbols.coordinates[idx].name),
            )
            .label("expected in `theta` or `d` of a frame, or in its `joint`")
            .help("use the coordinate in a frame, or delete it"),
        );
    }
    let faulty = model
        .coordinates
        .as_ref()
        .is_some_and(|table| !table.faulty.is_empty());
    if symbols.coordinates.is_empty() && !faulty {
        log.push(
            Diagnostic::error(model.span, "this mechanism cannot move")
                .label("expected at least one coordinate")
                .help("declare it, `[coordinates]` with `q1 = { nominal = 0 }`, and use it in a frame"),
        );
    }
}

impl Symbols {
    /// Adds a parameter; false if its name is taken.
    pub(super) fn declare_parameter(
        &mut self,
        parameter: Parameter,
        dimension: Option<Dimension>,
        declared: Span,
        nominal_given: Option<Span>,
        log: &mut Log,
    ) -> bool {
        let symbol = Symbol::Parameter(ParameterIdx(self.parameters.len()));
        let meaning = meaning(
            Sort::Parameter,
            symbol,
            dimension,
            &parameter.unit,
            Some(declared),
        );
        let fine = self.scope.declare(&parameter.name, meaning, log);
        if fine {
            self.parameters.push(parameter);
            self.nominal_given.push(nominal_given);
        }
        fine
    }

    /// The parameter of a name that a second place shares; its dimension must agree, and its nominal value if both give one.
    pub(super) fn share_parameter(
        &mut self,
        name: &str,
        dimension: Option<Dimension>,
        span: Span,
        nominal: Option<crate::values::Number>,
        log: &mut Log,
    ) -> Shared {
        let Some(meaning) = self.scope.get(name) else {
            return Shared::New;
        };
        let Exact::Symbol(Symbol::Parameter(idx)) = meaning.exact else {
            let diagnostic = Diagnostic::error(span, format!("`{name}` is not a parameter"))
                .label("expected the name of a parameter, or a new name");
            log.push(match meaning.declared {
                Some(declared) => diagnostic.related(declared, "defined here"),
                None => diagnostic,
            });
            return Shared::Faulty;
        };
        if let (Some(wanted), Some(found)) = (dimension, meaning.dimension)
            && wanted != found
        {
            let diagnostic = Diagnostic::error(
                span,
                format!("`{name}` would be {} here", wanted.describe()),
            )
            .label(format!("but `{name}` is {}", found.describe()))
            .help("give one of the two another name");
            log.push(match meaning.declared {
                Some(declared) => diagnostic.related(declared, "defined here"),
                None => diagnostic,
            });
            return Shared::Faulty;
        }
        if let Some(nominal) = nominal {
            match self.nominal_given[idx.0] {
                #[allow(clippy::float_cmp)] // The same number twice is the same text.
                Some(first) if self.parameters[idx.0].nominal != nominal.value => {
                    log.push(
                        Diagnostic::error(
                            nominal.span,
                            format!("`{name}` has two different nominal values"),
                        )
                        .label("this parameter is shared")
                        .related(first, "the first value stands here")
                        .help("give the value once"),
                    );
                }
                Some(_) => {}
                None => {
                    self.parameters[idx.0].nominal = nominal.value;
                    self.nominal_given[idx.0] = Some(nominal.span);
                }
            }
        }
        Shared::Known(idx)
    }
}

/// Declares the parameters that `linear = { all = "1" }` stands for.
fn declare_shorthands(model: &ModelEntry, symbols: &mut Symbols, log: &mut Log) {
    for part in model.part.iter().flat_map(|list| &list.entries) {
        let Some(linear) = &part.linear else {
            continue;
        };
        let Some((suffix, members)) = shorthand(linear) else {
            continue;
        };
        for (symbol, dimension) in LINEAR {
            let nominal = linear
                .nominal
                .as_ref()
                .and_then(|nominal| nominal_of(nominal, symbol));
            let own = explicit(linear, symbol);
            if !members.contains(&symbol) || own.is_some() {
                if let Some(nominal) = nominal {
                    log.push(
                        Diagnostic::error(
                            nominal.span,
                            format!(
                                "the shorthand declares no {symbol} that could have a nominal value"
                            ),
                        )
                        .label(if own.is_some() {
                            "this entry is given by an expression"
                        } else {
                            "`planar` declares ZZ, MX, MY and M"
                        })
                        .help("declare the parameter in `[parameters]`, with its nominal value"),
                    );
                }
                continue;
            }
            let name = format!("{symbol}{}", suffix.text);
            let shared = symbols.share_parameter(&name, Some(dimension), suffix.span, nominal, log);
            if matches!(shared, Shared::New) {
                symbols.declare_parameter(
                    Parameter {
                        name,
                        nominal: nominal.map_or(0.0, |number| number.value),
                        unit: dimension.to_string(),
                        note: None,
                    },
                    Some(dimension),
                    suffix.span,
                    nominal.map(|number| number.span),
                    log,
                );
            }
        }
    }
}

/// The suffix of a shorthand and the symbols that it stands for.
pub(super) fn shorthand(
    linear: &LinearEntry,
) -> Option<(&crate::values::Suffix, &'static [&'static str])> {
    const ALL: [&str; 10] = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"];
    match (&linear.all, &linear.planar) {
        (Some(suffix), _) => Some((suffix, &ALL)),
        (None, Some(suffix)) => Some((suffix, &PLANAR)),
        (None, None) => None,
    }
}

/// The entry that a body gives for one of the linear parameters.
pub(super) fn explicit<'a>(linear: &'a LinearEntry, symbol: &str) -> Option<&'a Formula> {
    match symbol {
        "XX" => linear.xx.as_ref(),
        "XY" => linear.xy.as_ref(),
        "XZ" => linear.xz.as_ref(),
        "YY" => linear.yy.as_ref(),
        "YZ" => linear.yz.as_ref(),
        "ZZ" => linear.zz.as_ref(),
        "MX" => linear.mx.as_ref(),
        "MY" => linear.my.as_ref(),
        "MZ" => linear.mz.as_ref(),
        _ => linear.m.as_ref(),
    }
}

fn nominal_of(nominal: &LinearNominalEntry, symbol: &str) -> Option<crate::values::Number> {
    match symbol {
        "XX" => nominal.xx,
        "XY" => nominal.xy,
        "XZ" => nominal.xz,
        "YY" => nominal.yy,
        "YZ" => nominal.yz,
        "ZZ" => nominal.zz,
        "MX" => nominal.mx,
        "MY" => nominal.my,
        "MZ" => nominal.mz,
        _ => nominal.m,
    }
}

/// Declares the coordinates; whether one is an angle or a length follows from the frames.
fn declare_coordinates(
    model: &ModelEntry,
    symbols: &mut Symbols,
    places: &mut Places,
    log: &mut Log,
) {
    let Formulas {
        angles,
        lengths,
        quaternions,
    } = joint_formulas(model);
    let entries = model
        .coordinates
        .as_ref()
        .map_or(&[][..], |table| table.entries.as_slice());
    if let Some((key, _)) = entries.get(MOST_COORDINATES) {
        log.push(
            Diagnostic::error(key.span, "there are too many coordinates")
                .label(format!("at most {MOST_COORDINATES}"))
                .help("fix joints that the recordings do not move, such as those of fingers: a frame without a joint stands still"),
        );
    }
    // Some of those above are known as well, so that few other places of the file have a fault by them.
    for (key, entry) in entries.iter().take(DECLARED_AT_MOST) {
        let turns = angles.iter().find_map(|ast| find(ast, &key.name));
        let slides = lengths.iter().find_map(|ast| find(ast, &key.name));
        let of_quaternion = quaternions
            .iter()
            .find_map(|(ast, motion)| find(ast, &key.name).map(|span| (span, *motion)));
        if let (Some((span, _)), Some(other)) = (of_quaternion, turns.or(slides)) {
            log.push(
                Diagnostic::error(
                    other,
                    format!("`{}` is a component of a quaternion", key.name),
                )
                .label("used as an angle or a length here")
                .related(span, "used in a quaternion here")
                .help("declare a coordinate for each joint"),
            );
        }
        let of_quaternion = of_quaternion.map(|(_, motion)| motion);
        let motion = match (turns, slides) {
            (Some(turns), Some(slides)) => {
                log.push(
                    Diagnostic::error(
                        slides,
                        format!("`{}` is both an angle and a length", key.name),
                    )
                    .label("used as a length here")
                    .related(turns, "used as an angle here")
                    .help("declare a coordinate for each joint"),
                );
                None
            }
            (None, None) if of_quaternion.is_some() => of_quaternion,
            (None, Some(_)) => Some(Motion::Prismatic),
            (Some(_), None) => Some(Motion::Revolute),
            (None, None) => {
                let next = CoordinateIdx(symbols.coordinates.len());
                symbols.still.push(next);
                None
            }
        };
        // Without values a quaternion turns nothing.
        let at_rest = f64::from(u8::from(motion == Some(Motion::QuaternionScalar)));
        let dimension = motion.map(Motion::dimension);
        let motion = motion.unwrap_or(Motion::Revolute);
        let symbol = Symbol::Coordinate(CoordinateIdx(symbols.coordinates.len()));
        let meaning = meaning(
            Sort::Coordinate,
            symbol,
            dimension,
            motion.unit(),
            Some(key.span),
        );
        if symbols.scope.declare(&key.name, meaning, log) {
            places.coordinates.push(key.span);
            symbols.coordinates.push(Coordinate {
                name: key.name.clone(),
                motion,
                passive: entry.passive.is_some_and(|flag| flag.0) || entry.follows.is_some(),
                nominal: entry.nominal.map_or(at_rest, |number| number.value),
            });
        } else {
            let n_coordinates = symbols.coordinates.len();
            symbols.still.retain(|idx| idx.0 < n_coordinates);
        }
    }
}

/// The expressions of all frames by what they are.
struct Formulas<'a> {
    angles: Vec<&'a Ast>,
    lengths: Vec<&'a Ast>,
    quaternions: Vec<(&'a Ast, Motion)>,
}

fn joint_formulas(model: &ModelEntry) -> Formulas<'_> {
    let mut angles: Vec<&Ast> = Vec::new();
    let mut lengths: Vec<&Ast> = Vec::new();
    let mut quaternions = Vec::new();
    for frame in model.frame.iter().flat_map(|list| &list.entries) {
        for dh in frame.modified_dh.iter().chain(&frame.standard_dh) {
            angles.extend(dh.alpha.iter().chain(&dh.theta).map(|formula| &formula.ast));
            lengths.extend(dh.a.iter().chain(&dh.d).map(|formula| &formula.ast));
        }
        if let Some(joint) = &frame.joint {
            angles.extend(joint.revolute.iter().map(|formula| &formula.ast));
            lengths.extend(joint.prismatic.iter().map(|formula| &formula.ast));
            for (formula, motion) in crate::build::joints::coordinates(joint) {
                match motion {
                    Motion::Revolute => angles.push(&formula.ast),
                    Motion::Prismatic => lengths.push(&formula.ast),
                    Motion::Quaternion | Motion::QuaternionScalar => {
                        quaternions.push((&formula.ast, motion));
                    }
                }
            }
        }
    }
    Formulas {
        angles,
        lengths,
        quaternions,
    }
}

/// The place of a name in an expression.
fn find(ast: &Ast, name: &str) -> Option<Span> {
    match &ast.kind {
        AstKind::Name(found) => (found == name).then_some(ast.span),
        AstKind::Sum(inner) | AstKind::Product(inner) => {
            inner.iter().find_map(|one| find(one, name))
        }
        AstKind::Quotient(above, below) => find(above, name).or_else(|| find(below, name)),
        AstKind::Negative(inner) | AstKind::Power(inner, _) | AstKind::Apply(_, inner) => {
            find(inner, name)
        }
        AstKind::Rational(_) | AstKind::Pi => None,
    }
}

/// Gravity in the base frame; zero if the file gives none.
pub(super) fn gravity(model: &ModelEntry, scope: &Scope, log: &mut Log) -> [Exact; 3] {
    model.gravity.as_ref().map_or_else(
        || std::array::from_fn(|_| Exact::zero()),
        |gravity| {
            vector(
                gravity,
                scope,
                Wanted {
                    sorts: &[Sort::Constant],
                    dimension: Dimension::ACCELERATION,
                    what: "gravity",
                },
                log,
            )
        },
    )
}

/// The entries of a vector; zero where one is absent or faulty.
pub(super) fn vector(
    vector: &Vector,
    scope: &Scope,
    wanted: Wanted<'_>,
    log: &mut Log,
) -> [Exact; 3] {
    std::array::from_fn(|i| {
        vector
            .entries
            .get(i)
            .and_then(Option::as_ref)
            .and_then(|formula| scope.resolve(formula, wanted, log))
            .unwrap_or_else(Exact::zero)
    })
}

/// Warns of constants and parameters that nothing uses.
pub(super) fn warn_of_unused(symbols: &Symbols, log: &mut Log) {
    for (name, meaning) in symbols.scope.iter() {
        let Some(declared) = meaning.declared.filter(|_| !meaning.used.get()) else {
            continue;
        };
        let what = match meaning.sort {
            Sort::Constant => "constant",
            Sort::Parameter => "parameter",
            Sort::Coordinate | Sort::Place => continue,
        };
        log.push(
            Diagnostic::warning(declared, format!("nothing uses the {what} `{name}`"))
                .label("without effect")
                .help(format!(
                    "use it or delete it; a variant drops it by `remove = [\"{what}s.{name}\"]`"
                )),
        );
    }
}
