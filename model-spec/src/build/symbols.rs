//! Constants, parameters and coordinates: the names that expressions may use.
//!
//! They are declared before anything else is read, so that every later stage can resolve expressions.

use std::cell::Cell;

use crate::build::MechanismSpans;
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::{ConstantIdx, CoordinateIdx, ExactExpression, ModelSymbol, ParameterIdx};
use crate::formula::{FormulaAst, FormulaAstKind, SourceFormula};
use crate::joint_motion::CoordinateMotion;
use crate::mechanism::{DynamicParameter, JointCoordinate, ModelConstant};
use crate::schema::{CoordinateEntry, LinearEntry, LinearNominalEntry, ModelEntry};
use crate::scope::{FormulaRequirement, FormulaScope, SymbolMeaning, SymbolSort, symbol_meaning};
use crate::unit::UnitDimension;
use crate::values::FormulaVector;

/// Most coordinates of a mechanism.
const MOST_COORDINATES: usize = 100;
/// Most coordinates that are declared although the file has too many, so that uses of them are not reported as
/// unknown.
const DECLARED_AT_MOST: usize = 1000;

/// The quantities that the names of a file stand for.
pub(crate) struct SymbolTable {
    /// All names with sort, dimension and whether they are used.
    pub(crate) scope: FormulaScope,
    /// Constants by index.
    pub(crate) constants: Vec<ModelConstant>,
    /// Parameters by index; effects add further ones.
    pub(super) parameters: Vec<DynamicParameter>,
    /// Where each parameter gets its nominal value. Parameters of effects and shorthands may get one later.
    pub(super) nominal_given: Vec<Option<SourceSpan>>,
    /// Coordinates by index.
    pub(super) coordinates: Vec<JointCoordinate>,
    /// Coordinates that no frame uses.
    still: Vec<CoordinateIdx>,
}

/// The result of looking up a parameter's name that may be declared already.
pub(super) enum ParameterLookup {
    /// The name is not declared yet.
    New,
    /// The name is that of this parameter.
    Known(ParameterIdx),
    /// The name is that of another quantity, or the parameter does not fit; this is reported.
    Faulty,
}

/// The linear parameters in the order in which a shorthand declares them, with their dimensions.
pub(super) const LINEAR: [(&str, UnitDimension); 10] = [
    ("XX", UnitDimension::INERTIA),
    ("XY", UnitDimension::INERTIA),
    ("XZ", UnitDimension::INERTIA),
    ("YY", UnitDimension::INERTIA),
    ("YZ", UnitDimension::INERTIA),
    ("ZZ", UnitDimension::INERTIA),
    ("MX", UnitDimension::FIRST_MOMENT),
    ("MY", UnitDimension::FIRST_MOMENT),
    ("MZ", UnitDimension::FIRST_MOMENT),
    ("M", UnitDimension::MASS),
];
/// The linear parameters of a body in the x-y plane.
const PLANAR: [&str; 4] = ["ZZ", "MX", "MY", "M"];

/// Declares all names of a file: constants, parameters, shorthands of parts, and coordinates.
///
/// The places of coordinates are appended to `places.coordinates`.
pub(super) fn declare(model: &ModelEntry, places: &mut MechanismSpans, log: &mut DiagnosticLog) -> SymbolTable {
    let mut symbols = SymbolTable {
        scope: FormulaScope::default(),
        constants: Vec::new(),
        parameters: Vec::new(),
        nominal_given: Vec::new(),
        coordinates: Vec::new(),
        still: Vec::new(),
    };
    // Constants, with the dimension of their unit; one without a value counts as 1, because the fault is reported.
    for (key, entry) in model.constants.iter().flat_map(|table| &table.entries) {
        let symbol = ModelSymbol::Constant(ConstantIdx(symbols.constants.len()));
        let unit = entry.unit.as_ref();
        // A faulty unit fits any other, so that it is reported once only.
        let unit_text = unit.map_or("?", |unit| unit.text.as_str());
        let dimension = unit.map(|unit| unit.dimension);
        let meaning = SymbolMeaning {
            value: entry.value.map(|number| number.value),
            ..symbol_meaning(SymbolSort::Constant, symbol, dimension, unit_text, Some(key.span))
        };
        if symbols.scope.declare(&key.name, meaning, log) {
            symbols.constants.push(ModelConstant {
                name: key.name.clone(),
                value: entry.value.map_or(1.0, |number| number.value),
                unit: unit_text.to_owned(),
                is_angle: unit.is_some_and(crate::unit::ModelUnit::is_angle),
                note: entry.note.as_ref().map(|note| note.text.clone()),
            });
        }
    }
    // Parameters, whose nominal value is zero if the file gives none.
    for (key, entry) in model.parameters.iter().flat_map(|table| &table.entries) {
        let unit = entry.unit.as_ref();
        symbols.declare_parameter(
            DynamicParameter {
                name: key.name.clone(),
                nominal: entry.nominal.map_or(0.0, |number| number.value),
                has_nominal: entry.nominal.is_some(),
                unit: unit.map_or_else(|| "?".to_owned(), |unit| unit.text.clone()),
                note: entry.note.as_ref().map(|note| note.text.clone()),
            },
            unit.map(|unit| unit.dimension),
            key.span,
            entry.nominal.map(|number| number.span),
            log,
        );
    }
    // Shorthands declare parameters of parts; coordinates need the frames.
    declare_shorthands(model, &mut symbols, log);
    declare_coordinates(model, &mut symbols, places, log);
    declare_faulty(model, &mut symbols, log);
    symbols
}

/// Declares the names whose entries could not be read. They fit any sort of use, so that only their own fault is
/// reported.
fn declare_faulty(model: &ModelEntry, symbols: &mut SymbolTable, log: &mut DiagnosticLog) {
    let constants = model.constants.iter().flat_map(|table| &table.faulty);
    let parameters = model.parameters.iter().flat_map(|table| &table.faulty);
    let coordinates = model.coordinates.iter().flat_map(|table| &table.faulty);
    let all = constants
        .map(|key| (key, SymbolSort::Constant))
        .chain(parameters.map(|key| (key, SymbolSort::Parameter)))
        .chain(coordinates.map(|key| (key, SymbolSort::Coordinate)));
    // A dimension of `None` fits any other, so that uses cause no further findings.
    for (key, sort) in all {
        let meaning = SymbolMeaning {
            sort,
            exact: ExactExpression::zero(),
            dimension: None,
            unit: "?".to_owned(),
            value: None,
            declared: Some(key.span),
            used: Cell::new(false),
        };
        symbols.scope.declare(&key.name, meaning, log);
    }
}

/// Reports coordinates that no joint uses, and a mechanism without any.
///
/// Nothing is reported if a frame is faulty, because it may be the one that uses the coordinate.
pub(super) fn check_coordinates_move(
    model: &ModelEntry,
    symbols: &SymbolTable,
    places: &MechanismSpans,
    log: &mut DiagnosticLog,
) {
    if log.syntax_broken || model.frame.as_ref().is_some_and(|list| list.faulty) {
        return; // A faulty frame may be the one that uses them.
    }
    // An unused coordinate would have a zero column in every Jacobian.
    for &CoordinateIdx(idx) in &symbols.still {
        log.push(
            Diagnostic::error(
                places.coordinates[idx],
                format!("no joint uses `{}`", symbols.coordinates[idx].name),
            )
            .label("expected in `theta` or `d` of a frame, or in its `joint`")
            .help("use the coordinate in a frame, or delete it"),
        );
    }
    // A mechanism whose coordinates are all faulty has reported that already.
    let faulty = model.coordinates.as_ref().is_some_and(|table| !table.faulty.is_empty());
    if symbols.coordinates.is_empty() && !faulty {
        log.push(
            Diagnostic::error(model.span, "this mechanism cannot move")
                .label("expected at least one coordinate")
                .help("declare it, `[coordinates]` with `q1 = { nominal = 0 }`, and use it in a frame"),
        );
    }
}

impl SymbolTable {
    /// Adds a parameter; false if its name is taken, which is reported.
    ///
    /// `nominal_given` is the place of its nominal value, if the file gives one.
    pub(super) fn declare_parameter(
        &mut self,
        parameter: DynamicParameter,
        dimension: Option<UnitDimension>,
        declared: SourceSpan,
        nominal_given: Option<SourceSpan>,
        log: &mut DiagnosticLog,
    ) -> bool {
        let symbol = ModelSymbol::Parameter(ParameterIdx(self.parameters.len()));
        let meaning = symbol_meaning(
            SymbolSort::Parameter,
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

    /// Looks up a parameter that a second place may share. Its dimension must agree, and its nominal value if both
    /// give one.
    ///
    /// `span` is the second use, and `nominal` the value that it gives.
    pub(super) fn share_parameter(
        &mut self,
        name: &str,
        dimension: Option<UnitDimension>,
        span: SourceSpan,
        nominal: Option<crate::values::SpannedNumber>,
        log: &mut DiagnosticLog,
    ) -> ParameterLookup {
        // A new name is declared by the caller.
        let Some(meaning) = self.scope.get(name) else {
            return ParameterLookup::New;
        };
        // The name may belong to a constant or a coordinate.
        let ExactExpression::Symbol(ModelSymbol::Parameter(idx)) = meaning.exact else {
            let diagnostic = Diagnostic::error(span, format!("`{name}` is not a parameter"))
                .label("expected the name of a parameter, or a new name");
            log.push(match meaning.declared {
                Some(declared) => diagnostic.related(declared, "defined here"),
                None => diagnostic,
            });
            return ParameterLookup::Faulty;
        };
        // Both uses must have the same dimension.
        if let (Some(wanted), Some(found)) = (dimension, meaning.dimension)
            && wanted != found
        {
            let diagnostic = Diagnostic::error(span, format!("`{name}` would be {} here", wanted.describe()))
                .label(format!("but `{name}` is {}", found.describe()))
                .help("give one of the two another name");
            log.push(match meaning.declared {
                Some(declared) => diagnostic.related(declared, "defined here"),
                None => diagnostic,
            });
            return ParameterLookup::Faulty;
        }
        // At most one nominal value may be given, or the same one twice.
        if let Some(nominal) = nominal {
            match self.nominal_given[idx.0] {
                #[allow(clippy::float_cmp)] // The same number twice is the same text.
                Some(first) if self.parameters[idx.0].nominal != nominal.value => {
                    log.push(
                        Diagnostic::error(nominal.span, format!("`{name}` has two different nominal values"))
                            .label("this parameter is shared")
                            .related(first, "the first value stands here")
                            .help("give the value once"),
                    );
                }
                Some(_) => {}
                None => {
                    self.parameters[idx.0].nominal = nominal.value;
                    self.parameters[idx.0].has_nominal = true;
                    self.nominal_given[idx.0] = Some(nominal.span);
                }
            }
        }
        ParameterLookup::Known(idx)
    }
}

/// Declares the parameters of shorthands such as `linear = { all = "1" }`.
///
/// Parts with the same suffix share these parameters.
fn declare_shorthands(model: &ModelEntry, symbols: &mut SymbolTable, log: &mut DiagnosticLog) {
    for part in model.part.iter().flat_map(|list| &list.entries) {
        let Some(linear) = &part.linear else {
            continue;
        };
        let Some((suffix, members)) = shorthand(linear) else {
            continue;
        };
        // All ten symbols are visited, so that nominal values without a parameter are reported.
        for (symbol, dimension) in LINEAR {
            let nominal = linear.nominal.as_ref().and_then(|nominal| nominal_of(nominal, symbol));
            // An explicit entry replaces the parameter, which then has no nominal value.
            let own = explicit_entry(linear, symbol);
            if !members.contains(&symbol) || own.is_some() {
                if let Some(nominal) = nominal {
                    log.push(
                        Diagnostic::error(
                            nominal.span,
                            format!("the shorthand declares no {symbol} that could have a nominal value"),
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
            // A parameter with this name may exist already, from another part or from the table of parameters.
            let name = format!("{symbol}{}", suffix.text);
            let shared = symbols.share_parameter(&name, Some(dimension), suffix.span, nominal, log);
            if matches!(shared, ParameterLookup::New) {
                symbols.declare_parameter(
                    DynamicParameter {
                        name,
                        nominal: nominal.map_or(0.0, |number| number.value),
                        has_nominal: nominal.is_some(),
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

/// The suffix of a shorthand and the symbols of its parameters; `None` without a shorthand.
///
/// The suffix ends the names of all of them, such as `1` in `ZZ1`.
pub(super) fn shorthand(linear: &LinearEntry) -> Option<(&crate::values::NameSuffix, &'static [&'static str])> {
    const ALL: [&str; 10] = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"];
    match (&linear.all, &linear.planar) {
        (Some(suffix), _) => Some((suffix, &ALL)),
        (None, Some(suffix)) => Some((suffix, &PLANAR)),
        (None, None) => None,
    }
}

/// The explicit expression of a part for one of the linear parameters.
pub(super) fn explicit_entry<'a>(linear: &'a LinearEntry, symbol: &str) -> Option<&'a SourceFormula> {
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

/// The nominal value that a part gives for one of the linear parameters.
fn nominal_of(nominal: &LinearNominalEntry, symbol: &str) -> Option<crate::values::SpannedNumber> {
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

/// Declares the coordinates; their use in the frames decides whether each is an angle or a length.
///
/// The places of coordinates are appended to `places.coordinates`.
fn declare_coordinates(
    model: &ModelEntry,
    symbols: &mut SymbolTable,
    places: &mut MechanismSpans,
    log: &mut DiagnosticLog,
) {
    // Expressions of all frames, sorted by the quantity that they describe.
    let FrameFormulas {
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
                .help("fix joints that the recordings do not move, such as those of fingers: a frame without a joint is fixed"),
        );
    }
    // Coordinates beyond the limit are declared too, so that their uses cause no further findings. Those that move no frame
    // and follow others, such as the length of a tendon, come last: what they follow decides between angle and length.
    let moves_frame = |name: &str| {
        let of_quaternions = quaternions.iter().map(|(ast, _)| *ast);
        let mut all = angles.iter().chain(&lengths).copied().chain(of_quaternions);
        all.any(|ast| find_name(ast, name).is_some())
    };
    let (in_frames, beside): (Vec<_>, Vec<_>) = entries
        .iter()
        .take(DECLARED_AT_MOST)
        .partition(|(key, entry)| entry.follows.is_none() || moves_frame(&key.name) || !is_place(model, &key.name));
    for (key, entry) in in_frames.into_iter().chain(beside) {
        // The first use as an angle, as a length, and in a quaternion.
        let turns = angles.iter().find_map(|ast| find_name(ast, &key.name));
        let slides = lengths.iter().find_map(|ast| find_name(ast, &key.name));
        let of_quaternion = quaternions
            .iter()
            .find_map(|(ast, motion)| find_name(ast, &key.name).map(|span| (span, *motion)));
        if let (Some((span, _)), Some(other)) = (of_quaternion, turns.or(slides)) {
            log.push(
                Diagnostic::error(other, format!("`{}` is a component of a quaternion", key.name))
                    .label("used as an angle or a length here")
                    .related(span, "used in a quaternion here")
                    .help("declare a coordinate for each joint"),
            );
        }
        // A coordinate with conflicting uses, or with none, has no dimension and counts as revolute.
        let of_quaternion = of_quaternion.map(|(_, motion)| motion);
        // Exactly one of the uses decides the kind of motion.
        let motion = match (turns, slides) {
            (Some(turns), Some(slides)) => {
                log.push(
                    Diagnostic::error(slides, format!("`{}` is both an angle and a length", key.name))
                        .label("used as a length here")
                        .related(turns, "used as an angle here")
                        .help("declare a coordinate for each joint"),
                );
                None
            }
            (None, None) if of_quaternion.is_some() => of_quaternion,
            (None, Some(_)) => Some(CoordinateMotion::Prismatic),
            (Some(_), None) => Some(CoordinateMotion::Revolute),
            (None, None) if entry.follows.is_some() && is_place(model, &key.name) => {
                followed_motion(entry, &symbols.scope)
            }
            (None, None) => {
                let next = CoordinateIdx(symbols.coordinates.len());
                symbols.still.push(next);
                None
            }
        };
        // Without nominal values a quaternion is the identity: its scalar part is one.
        let at_rest = f64::from(u8::from(motion == Some(CoordinateMotion::QuaternionScalar)));
        // The dimension is unknown if the kind of motion is; then it fits any use.
        let dimension = motion.map(CoordinateMotion::dimension);
        let motion = motion.unwrap_or(CoordinateMotion::Revolute);
        let symbol = ModelSymbol::Coordinate(CoordinateIdx(symbols.coordinates.len()));
        let meaning = symbol_meaning(SymbolSort::Coordinate, symbol, dimension, motion.unit(), Some(key.span));
        // A name that is taken is reported by the scope.
        if symbols.scope.declare(&key.name, meaning, log) {
            places.coordinates.push(key.span);
            symbols.coordinates.push(JointCoordinate {
                name: key.name.clone(),
                motion,
                passive: entry.passive.is_some_and(|flag| flag.0) || entry.follows.is_some(),
                nominal: entry.nominal.map_or(at_rest, |number| number.value),
            });
        } else {
            // A duplicate was not added, so it must not be reported as unused.
            let n_coordinates = symbols.coordinates.len();
            symbols.still.retain(|idx| idx.0 < n_coordinates);
        }
    }
}

/// Whether a drive or an effect acts on something of this name.
fn is_place(model: &ModelEntry, name: &str) -> bool {
    let drives = model.drive.iter().flat_map(|list| &list.entries);
    let effects = model.effect.iter().flat_map(|list| &list.entries);
    drives.flat_map(|drive| &drive.joint).any(|joint| joint.text == name)
        || effects
            .flat_map(|effect| effect.at.iter().chain(&effect.at_each))
            .any(|places| places.entries.iter().any(|place| place.text == name))
}

/// The motion of a coordinate that moves no frame: that of what it follows, without a table. `None` if that is unknown.
fn followed_motion(entry: &CoordinateEntry, scope: &FormulaScope) -> Option<CoordinateMotion> {
    let follows = entry.follows.as_ref()?;
    // Faults are reported where the expression is resolved.
    let mut unseen = DiagnosticLog::default();
    let sorts = [SymbolSort::Constant, SymbolSort::Coordinate];
    let (_, dimension) = scope.resolve_ast(&follows.ast, &sorts, &mut unseen)?;
    let is_length = dimension == Some(CoordinateMotion::Prismatic.dimension()) && entry.table.is_none();
    Some(if is_length {
        CoordinateMotion::Prismatic
    } else {
        CoordinateMotion::Revolute
    })
}

/// The expressions of all frames, by the quantity that they describe.
struct FrameFormulas<'a> {
    /// Angles of frames and joints.
    angles: Vec<&'a FormulaAst>,
    /// Lengths of frames and joints.
    lengths: Vec<&'a FormulaAst>,
    /// Components of quaternions, each with its kind.
    quaternions: Vec<(&'a FormulaAst, CoordinateMotion)>,
}

/// Collects the expressions of all frames and joints.
///
/// Transforms are not included, because they cannot contain coordinates.
fn joint_formulas(model: &ModelEntry) -> FrameFormulas<'_> {
    let mut angles: Vec<&FormulaAst> = Vec::new();
    let mut lengths: Vec<&FormulaAst> = Vec::new();
    let mut quaternions = Vec::new();
    for frame in model.frame.iter().flat_map(|list| &list.entries) {
        // Both conventions of Denavit and Hartenberg have the same entries.
        for dh in frame.modified_dh.iter().chain(&frame.standard_dh) {
            angles.extend(dh.alpha.iter().chain(&dh.theta).map(|formula| &formula.ast));
            lengths.extend(dh.a.iter().chain(&dh.d).map(|formula| &formula.ast));
        }
        if let Some(joint) = &frame.joint {
            angles.extend(joint.revolute.iter().map(|formula| &formula.ast));
            lengths.extend(joint.prismatic.iter().map(|formula| &formula.ast));
            // Joints with several coordinates state the kind of each of them.
            for (formula, motion) in crate::build::joints::coordinates(joint) {
                match motion {
                    CoordinateMotion::Revolute => angles.push(&formula.ast),
                    CoordinateMotion::Prismatic => lengths.push(&formula.ast),
                    CoordinateMotion::Quaternion | CoordinateMotion::QuaternionScalar => {
                        quaternions.push((&formula.ast, motion));
                    }
                }
            }
        }
    }
    FrameFormulas {
        angles,
        lengths,
        quaternions,
    }
}

/// The place of a name in an expression, if the expression contains it.
fn find_name(ast: &FormulaAst, name: &str) -> Option<SourceSpan> {
    match &ast.kind {
        // Leaves first, then the operands in the order of the text.
        FormulaAstKind::Name(found) => (found == name).then_some(ast.span),
        FormulaAstKind::Sum(inner) | FormulaAstKind::Product(inner) => {
            inner.iter().find_map(|one| find_name(one, name))
        }
        FormulaAstKind::Quotient(above, below) => find_name(above, name).or_else(|| find_name(below, name)),
        FormulaAstKind::Negative(inner) | FormulaAstKind::Power(inner, _) | FormulaAstKind::Apply(_, inner) => {
            find_name(inner, name)
        }
        FormulaAstKind::Rational(_) | FormulaAstKind::Pi => None,
    }
}

/// Gravity in the base frame, m/s^2; zero if the file gives none.
pub(super) fn gravity(model: &ModelEntry, scope: &FormulaScope, log: &mut DiagnosticLog) -> [ExactExpression; 3] {
    model.gravity.as_ref().map_or_else(
        || std::array::from_fn(|_| ExactExpression::zero()),
        |gravity| {
            vector(
                gravity,
                scope,
                FormulaRequirement {
                    sorts: &[SymbolSort::Constant],
                    dimension: UnitDimension::ACCELERATION,
                    what: "gravity",
                },
                log,
            )
        },
    )
}

/// The entries of a vector; zero for each that is absent or faulty.
///
/// `wanted` is what each entry must be, with its name in messages.
pub(super) fn vector(
    vector: &FormulaVector,
    scope: &FormulaScope,
    wanted: FormulaRequirement<'_>,
    log: &mut DiagnosticLog,
) -> [ExactExpression; 3] {
    std::array::from_fn(|i| {
        vector
            .entries
            .get(i)
            .and_then(Option::as_ref)
            .and_then(|formula| scope.resolve(formula, wanted, log))
            .unwrap_or_else(ExactExpression::zero)
    })
}

/// Warns of constants and parameters that no expression uses.
///
/// Parameters of effects and shorthands count as used by these.
pub(super) fn warn_of_unused(symbols: &SymbolTable, log: &mut DiagnosticLog) {
    for (name, meaning) in symbols.scope.iter() {
        let Some(declared) = meaning.declared.filter(|_| !meaning.used.get()) else {
            continue;
        };
        // Unused coordinates are errors, and names of places are declared by the program.
        let what = match meaning.sort {
            SymbolSort::Constant => "constant",
            SymbolSort::Parameter => "parameter",
            SymbolSort::Coordinate | SymbolSort::Place => continue,
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
