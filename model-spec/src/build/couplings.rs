//! Coordinates that follow others: gears, belts, screws, differentials, cams.
//!
//! The entries `follows` and `table` of a coordinate go in; a function of other coordinates comes out. Affine functions are
//! split into factors and offset, because later stages solve them without derivatives.

use std::collections::{BTreeMap, BTreeSet};

use crate::build::MechanismSpans;
use crate::build::symbols::SymbolTable;
use crate::build::tables::table_function;
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::{CoordinateIdx, ExactExpression, ExactFunction, ModelSymbol};
use crate::formula::SourceFormula;
use crate::joint_motion::CoordinateMotion;
use crate::mechanism::{CoordinateCoupling, CouplingFunction, TableInterval};
use crate::schema::{CoordinateEntry, ModelEntry};
use crate::scope::{FormulaRequirement, SymbolSort};
use crate::unit::UnitDimension;

/// Reads the couplings and sets the nominal value of each coordinate that follows others.
pub(super) fn couplings(
    model: &ModelEntry,
    symbols: &mut SymbolTable,
    places: &MechanismSpans,
    log: &mut DiagnosticLog,
) -> Vec<CoordinateCoupling> {
    let mut found: Vec<(CoordinateCoupling, SourceSpan)> = Vec::new();
    // Coordinates that could not be declared are reported already.
    for (key, entry) in model.coordinates.iter().flat_map(|table| &table.entries) {
        let Some(follows) = &entry.follows else {
            reject_table_alone(entry, key.span, log);
            continue;
        };
        let Some(i) = symbols.coordinates.iter().position(|c| c.name == key.name) else {
            continue;
        };
        // The value and the drive of such a coordinate cannot be chosen.
        reject_unused_fields(entry, key.span, log);
        if let Some(coupling) = coupling(entry, follows, CoordinateIdx(i), symbols, log) {
            found.push((coupling, follows.ast.span));
        }
    }
    // Nominal values are computed only if all couplings are valid.
    if log.n_errors() == 0 {
        set_nominal(&found, symbols, places, log);
    }
    found.into_iter().map(|(coupling, _)| coupling).collect()
}

/// Reports entries of a coordinate that `follows` determines already.
fn reject_unused_fields(entry: &CoordinateEntry, span: SourceSpan, log: &mut DiagnosticLog) {
    let given = [
        (entry.nominal.is_some(), "nominal"),
        (entry.passive.is_some(), "passive"),
        (entry.driven.is_some(), "driven"),
    ];
    for (is_given, name) in given {
        if is_given {
            log.push(
                Diagnostic::error(
                    span,
                    format!("`{name}` has no effect on a coordinate that follows others"),
                )
                .label(format!("delete `{name}`")),
            );
        }
    }
}

/// Reports a table of a coordinate that follows nothing.
fn reject_table_alone(entry: &CoordinateEntry, span: SourceSpan, log: &mut DiagnosticLog) {
    if entry.table.is_some() || entry.periodic.is_some() {
        log.push(
            Diagnostic::error(span, "a table needs `follows`, the argument of the table")
                .label("expected `follows` here")
                .help("for example `lift = { follows = \"cam\", table = [[0, 0], [1, 0.01], [2, 0.02], [3, 0.01]] }`"),
        );
    }
}

/// The coupling of one coordinate; reports an expression that is not smooth or contains a quaternion.
/// The dimension of the expression must be that of the coordinate, an angle or a length, unless it is the argument of a
/// table.
fn coupling(
    entry: &CoordinateEntry,
    follows: &SourceFormula,
    coordinate: CoordinateIdx,
    symbols: &SymbolTable,
    log: &mut DiagnosticLog,
) -> Option<CoordinateCoupling> {
    let own = &symbols.coordinates[coordinate.0];
    // The argument of a table may be an angle or a length, as that of its joint is.
    let is_table = entry.table.is_some();
    let dimension = match (is_table, table_argument_dimension(follows, symbols)) {
        (true, Some(dimension)) => dimension,
        _ => own.motion.dimension(),
    };
    let wanted = FormulaRequirement {
        sorts: &[SymbolSort::Constant, SymbolSort::Coordinate],
        dimension,
        what: "what this coordinate follows",
    };
    // The scope reports unknown names and wrong units; the shape is checked below.
    let exact = symbols.scope.resolve(follows, wanted, log)?;
    let span = follows.ast.span;
    let leaders = coordinates_in(&exact);
    // An expression without coordinates would fix the coordinate.
    if leaders.is_empty() {
        log.push(
            Diagnostic::error(span, "this follows no coordinate")
                .label("expected the name of a coordinate in it")
                .help("a constant needs no coordinate: write it into the frame"),
        );
        return None;
    }
    // Components of a unit quaternion are not independent of each other.
    let mut all = leaders.iter().copied().chain([coordinate]);
    if let Some(i) = all.find(|i| symbols.coordinates[i.0].motion.is_quaternion()) {
        let name = &symbols.coordinates[i.0].name;
        log.push(
            Diagnostic::error(span, format!("`{name}` is a component of a quaternion"))
                .label("only angles and lengths of joints follow each other"),
        );
        return None;
    }
    if entry.periodic.is_some() && entry.table.is_none() {
        log.push(
            Diagnostic::error(span, "`periodic` needs a `table`")
                .label("expected `table` with it")
                .help("delete `periodic`, or give points: `table = [[x1, y1], ...]`"),
        );
        return None;
    }
    if let Some(table) = &entry.table {
        let is_periodic = entry.periodic.is_some_and(|flag| flag.0);
        if is_periodic && dimension != CoordinateMotion::Revolute.dimension() {
            log.push(
                Diagnostic::error(
                    span,
                    "a periodic table repeats after one turn, so its argument is an angle",
                )
                .label("this is a length")
                .help("delete `periodic`"),
            );
            return None;
        }
        let value = table_function(table, &exact, is_periodic, log)?;
        let ends = [table.entries.first()?.values[0], table.entries.last()?.values[0]];
        let interval = TableInterval { argument: exact, ends };
        return Some(CoordinateCoupling {
            coordinate,
            terms: Vec::new(),
            offset: ExactExpression::zero(),
            function: Some(CouplingFunction {
                value,
                leaders,
                table: (!is_periodic).then_some(interval),
            }),
        });
    }
    if let Some(CoordinateSum { terms, offset }) = coordinate_sum(&exact) {
        return Some(CoordinateCoupling {
            coordinate,
            terms: terms.into_iter().collect(),
            offset,
            function: None,
        });
    }
    if has_kink(&exact) {
        log.push(
            Diagnostic::error(span, "this function has jumps or kinks")
                .label("at a kink the velocity jumps, and no finite force does that")
                .help("use a smooth function, or points of it: `table = [[x1, y1], [x2, y2], ...]`"),
        );
        return None;
    }
    Some(CoordinateCoupling {
        coordinate,
        terms: Vec::new(),
        offset: ExactExpression::zero(),
        function: Some(CouplingFunction {
            value: exact,
            leaders,
            table: None,
        }),
    })
}

/// The dimension of the argument of a table: that of the first coordinate of an expression that is no pure number.
fn table_argument_dimension(follows: &SourceFormula, symbols: &SymbolTable) -> Option<UnitDimension> {
    // Faults are reported where the expression is resolved.
    let mut unseen = DiagnosticLog::default();
    let sorts = [SymbolSort::Constant, SymbolSort::Coordinate];
    let (_, dimension) = symbols.scope.resolve_ast(&follows.ast, &sorts, &mut unseen)?;
    let possible = [CoordinateMotion::Revolute, CoordinateMotion::Prismatic].map(CoordinateMotion::dimension);
    dimension.filter(|one| possible.contains(one))
}

/// The coordinates of an expression, sorted.
fn coordinates_in(exact: &ExactExpression) -> Vec<CoordinateIdx> {
    let mut found = BTreeSet::new();
    exact.for_each_symbol(&mut |symbol| {
        if let ModelSymbol::Coordinate(i) = symbol {
            found.insert(i);
        }
    });
    found.into_iter().collect()
}

/// Whether an expression contains the sign or the absolute value of an expression with coordinates.
fn has_kink(exact: &ExactExpression) -> bool {
    match exact {
        ExactExpression::Rational(_) | ExactExpression::Pi | ExactExpression::Symbol(_) => false,
        ExactExpression::Sum(inner) | ExactExpression::Product(inner) => inner.iter().any(has_kink),
        ExactExpression::Quotient(above, below) => has_kink(above) || has_kink(below),
        ExactExpression::Apply(ExactFunction::Abs | ExactFunction::Sign, inner) => {
            inner.mentions(&|symbol| matches!(symbol, ModelSymbol::Coordinate(_)))
        }
        ExactExpression::Negative(inner) | ExactExpression::Power(inner, _) | ExactExpression::Apply(_, inner) => {
            has_kink(inner)
        }
    }
}

/// Computes nominal values in the order of dependence; a coordinate that follows itself is reported.
/// `found` has the couplings with their places.
fn set_nominal(
    found: &[(CoordinateCoupling, SourceSpan)],
    symbols: &mut SymbolTable,
    places: &MechanismSpans,
    log: &mut DiagnosticLog,
) {
    // Each pass takes one coupling whose coordinates all have their values; if there is none, there is a cycle.
    let mut left: Vec<&(CoordinateCoupling, SourceSpan)> = found.iter().collect();
    while !left.is_empty() {
        // A coupling waits while one of its coordinates has no value yet.
        let waits = |coupling: &CoordinateCoupling| {
            let mut leaders = coupling.leaders().into_iter();
            leaders.any(|i| left.iter().any(|(other, _)| other.coordinate == i))
        };
        let Some(next) = left.iter().position(|(coupling, _)| !waits(coupling)) else {
            let (coupling, span) = left[0];
            log.push(
                Diagnostic::error(
                    places.coordinates[coupling.coordinate.0],
                    format!("`{}` follows itself", symbols.coordinates[coupling.coordinate.0].name),
                )
                .label("through the coordinates that it follows")
                .related(*span, "it follows this")
                .help("one of these coordinates must be independent"),
            );
            return;
        };
        // All coordinates of this coupling have their values now.
        let (coupling, _) = left.remove(next);
        let value = |symbol: ModelSymbol| match symbol {
            ModelSymbol::Coordinate(i) => symbols.coordinates[i.0].nominal,
            ModelSymbol::Constant(i) => symbols.constants[i.0].value,
            ModelSymbol::Parameter(_) | ModelSymbol::Place(_) => f64::NAN,
        };
        symbols.coordinates[coupling.coordinate.0].nominal = coupling.value(&value);
    }
}

/// An expression as a sum of multiples of coordinates, and a term without coordinates.
struct CoordinateSum {
    /// Factor of each coordinate.
    terms: BTreeMap<CoordinateIdx, ExactExpression>,
    /// The term without coordinates.
    offset: ExactExpression,
}

impl CoordinateSum {
    /// A value that contains no coordinate.
    fn without_coordinates(offset: ExactExpression) -> Self {
        Self {
            terms: BTreeMap::new(),
            offset,
        }
    }

    /// Applies a linear function to every factor and to the offset; an offset of zero stays zero.
    /// `f` must map zero to zero.
    fn map(self, f: impl Fn(ExactExpression) -> ExactExpression) -> Self {
        let terms = self.terms.into_iter();
        Self {
            terms: terms.map(|(i, factor)| (i, f(factor))).collect(),
            offset: if self.offset.is_zero() {
                self.offset
            } else {
                f(self.offset)
            },
        }
    }
}

/// Splits an expression into multiples of coordinates; `None` if it is not affine in them.
fn coordinate_sum(exact: &ExactExpression) -> Option<CoordinateSum> {
    // Subexpressions without coordinates are kept as they are.
    let mut moves = false;
    exact.for_each_symbol(&mut |symbol| moves |= matches!(symbol, ModelSymbol::Coordinate(_)));
    if !moves {
        return Some(CoordinateSum::without_coordinates(exact.clone()));
    }
    // The rules of an affine function: linear in each term, and products with at most one moving factor.
    match exact {
        ExactExpression::Symbol(ModelSymbol::Coordinate(i)) => Some(CoordinateSum {
            terms: BTreeMap::from([(*i, ExactExpression::unity())]),
            offset: ExactExpression::zero(),
        }),
        // A sign applies to all factors and to the offset.
        ExactExpression::Negative(inner) => {
            Some(coordinate_sum(inner)?.map(|x| ExactExpression::Negative(Box::new(x))))
        }
        ExactExpression::Quotient(above, below) => {
            // A divisor must be free of coordinates.
            let fixed = coordinate_sum(below).filter(|below| below.terms.is_empty())?;
            let divided = |x| ExactExpression::Quotient(Box::new(x), Box::new(fixed.offset.clone()));
            Some(coordinate_sum(above)?.map(divided))
        }
        ExactExpression::Product(factors) => {
            // At most one factor may contain coordinates; all others multiply its terms.
            let mut moving: Option<CoordinateSum> = None;
            let mut others = Vec::new();
            for factor in factors {
                let found = coordinate_sum(factor)?;
                if found.terms.is_empty() {
                    others.push(found.offset);
                } else if moving.replace(found).is_some() {
                    return None;
                }
            }
            let times = |x: ExactExpression| {
                // Factors of one are dropped to keep the expression short.
                let one = (x != ExactExpression::unity()).then_some(x);
                let mut all: Vec<ExactExpression> = others.iter().cloned().chain(one).collect();
                match all.len() {
                    0 => ExactExpression::unity(),
                    1 => all.remove(0),
                    _ => ExactExpression::Product(all),
                }
            };
            Some(moving?.map(times))
        }
        // Terms without coordinates are collected into the offset.
        ExactExpression::Sum(terms) => {
            let mut sum = CoordinateSum::without_coordinates(ExactExpression::zero());
            let mut fixed = Vec::new();
            for term in terms {
                let found = coordinate_sum(term)?;
                for (i, factor) in found.terms {
                    // Factors of the same coordinate are added.
                    let all = match sum.terms.remove(&i) {
                        Some(before) => ExactExpression::Sum(vec![before, factor]),
                        None => factor,
                    };
                    sum.terms.insert(i, all);
                }
                if !found.offset.is_zero() {
                    fixed.push(found.offset);
                }
            }
            // The offset is a sum only if it has at least two terms.
            sum.offset = match fixed.len() {
                0 => ExactExpression::zero(),
                1 => fixed.remove(0),
                _ => ExactExpression::Sum(fixed),
            };
            Some(sum)
        }
        _ => None,
    }
}
