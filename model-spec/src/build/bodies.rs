//! Parts and lumped masses: everything that has inertia.
//!
//! The tables `part` and `lumped_mass` go in; masses, centres and inertias as exact expressions come out. All of them
//! are polynomials in the parameters, as the regressor requires.

use num_rational::BigRational;
use num_traits::One;

use crate::angle::rational_value;
use crate::build::frames::{FrameTree, PointTable, duplicate_name};
use crate::build::symbols::{LINEAR, SymbolTable, explicit_entry, shorthand, vector};
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::{ExactExpression, ModelSymbol};
use crate::formula::SourceFormula;
use crate::mechanism::{FrameIdx, LumpedMass, Mechanism, ModelPart, PartInertia};
use crate::schema::{LinearEntry, LumpedMassEntry, ModelEntry, PartEntry};
use crate::scope::{FormulaRequirement, SymbolSort};
use crate::unit::UnitDimension;
use crate::values::SpannedName;
use crate::values::{FormulaVector, LumpedMassPlace};

/// Sorts of names in masses and inertias.
const SORTS: [SymbolSort; 2] = [SymbolSort::Constant, SymbolSort::Parameter];

/// Reads the parts. A part without a name has that of its frame; an unknown frame is reported and replaced by the
/// base.
pub(super) fn parts(
    model: &ModelEntry,
    symbols: &SymbolTable,
    tree: &FrameTree,
    log: &mut DiagnosticLog,
) -> Vec<ModelPart> {
    let entries = model.part.iter().flat_map(|list| &list.entries);
    check_unique("part", entries.clone().filter_map(|entry| entry.name.as_ref()), log);
    entries
        .map(|entry| {
            let frame = entry.on.as_ref().and_then(|on| tree.find(on, log));
            let frame = frame.unwrap_or(FrameIdx(0));
            ModelPart {
                // Without a name of its own a part is called after its frame.
                name: entry
                    .name
                    .as_ref()
                    .map_or_else(|| tree.frames[frame.0].name.clone(), |name| name.text.clone()),
                frame,
                inertial: inertial(entry, symbols, log),
            }
        })
        .collect()
}

/// Reports names that occur twice in a list.
/// `what` names the list in messages.
pub(super) fn check_unique<'a>(what: &str, names: impl Iterator<Item = &'a SpannedName>, log: &mut DiagnosticLog) {
    // Maps each name to the place of its last occurrence.
    let mut seen = std::collections::BTreeMap::new();
    for name in names {
        if let Some(first) = seen.insert(&name.text, name.span) {
            log.push(duplicate_name(what, name, first));
        }
    }
}

/// The inertia of a part, from `linear` or from `mass`, `centre` and `inertia`.
/// A part with both descriptions is reported, and `linear` is used.
fn inertial(entry: &PartEntry, symbols: &SymbolTable, log: &mut DiagnosticLog) -> PartInertia {
    let about_centre = entry.mass.is_some() || entry.centre.is_some() || entry.inertia.is_some();
    if let Some(linear) = &entry.linear {
        if about_centre {
            log.push(
                Diagnostic::error(linear.span, "this part is described in two ways")
                    .label("expected either `linear`, or `mass`, `centre` and `inertia`"),
            );
        }
        return linear_inertial(linear, symbols, log);
    }
    // A part with nothing at all is a mistake, unless its entries could not be read.
    if !about_centre && !log.syntax_broken && !entry.faulty {
        log.push(
            Diagnostic::error(entry.span, "this part has neither mass nor inertia")
                .label("expected `mass`, `centre` and `inertia`, or `linear`")
                .help("for example `mass = \"m1\"`, `centre = [\"dc1\", 0, 0]`, `inertia = { zz = \"Ic12\" }`; or `linear = { planar = \"1\" }`"),
        );
    }
    // The six entries in the order xx, xy, xz, yy, yz, zz; omitted ones are zero.
    let inertia = entry.inertia.as_ref();
    let entries = [
        inertia.and_then(|inertia| inertia.xx.as_ref()),
        inertia.and_then(|inertia| inertia.xy.as_ref()),
        inertia.and_then(|inertia| inertia.xz.as_ref()),
        inertia.and_then(|inertia| inertia.yy.as_ref()),
        inertia.and_then(|inertia| inertia.yz.as_ref()),
        inertia.and_then(|inertia| inertia.zz.as_ref()),
    ];
    // All entries are resolved even if some are faulty, so that all faults are reported.
    PartInertia::AboutCentre {
        mass: quantity(entry.mass.as_ref(), symbols, UnitDimension::MASS, "the mass", log),
        centre: position(entry.centre.as_ref(), symbols, "the centre of mass", log),
        inertia: entries.map(|entry| quantity(entry, symbols, UnitDimension::INERTIA, "the inertia", log)),
    }
}

/// The ten linear parameters of a part: single entries first, then those of the shorthand, else zero.
fn linear_inertial(linear: &LinearEntry, symbols: &SymbolTable, log: &mut DiagnosticLog) -> PartInertia {
    if let (Some(_), Some(planar)) = (&linear.all, &linear.planar) {
        log.push(
            Diagnostic::error(planar.span, "a body is either planar or has all ten parameters")
                .label("expected only one of `all` and `planar`"),
        );
    }
    // The shorthand `all` or `planar`, if the part has one.
    let short = shorthand(linear);
    // An explicit expression replaces the parameter of the shorthand.
    let entry = |symbol: &str, dimension: UnitDimension, log: &mut DiagnosticLog| {
        if let Some(formula) = explicit_entry(linear, symbol) {
            let what = format!("{symbol} of a part");
            return quantity(Some(formula), symbols, dimension, &what, log);
        }
        // Without either, the entry is exactly zero, so that its column never appears.
        let Some((suffix, _)) = short.filter(|(_, members)| members.contains(&symbol)) else {
            return ExactExpression::zero();
        };
        let name = format!("{symbol}{}", suffix.text);
        // The shorthand was declared before; if that failed, the fault is reported already.
        let Some(meaning) = symbols.scope.get(&name) else {
            return ExactExpression::zero();
        };
        // A parameter of a shorthand counts as used, because the part contains it.
        meaning.used.set(true);
        meaning.exact.clone()
    };
    let mut values = LINEAR.map(|(symbol, dimension)| entry(symbol, dimension, log));
    // The order of LINEAR: six entries of the inertia, three first moments, the mass.
    let mut take = |i: usize| std::mem::replace(&mut values[i], ExactExpression::zero());
    PartInertia::Linear {
        inertia: std::array::from_fn(&mut take),
        first_moment: std::array::from_fn(|i| take(i + 6)),
        mass: take(9),
    }
}

/// Resolves an expression over constants and parameters, polynomial in the parameters; zero if absent or faulty.
/// `what` names the quantity in messages.
fn quantity(
    formula: Option<&SourceFormula>,
    symbols: &SymbolTable,
    dimension: UnitDimension,
    what: &str,
    log: &mut DiagnosticLog,
) -> ExactExpression {
    let Some(formula) = formula else {
        return ExactExpression::zero();
    };
    let wanted = FormulaRequirement {
        sorts: &SORTS,
        dimension,
        what,
    };
    // The scope reports unknown names and wrong units.
    let Some(exact) = symbols.scope.resolve(formula, wanted, log) else {
        return ExactExpression::zero();
    };
    check_polynomial(&exact, formula.ast.span, log);
    exact
}

/// Resolves a position in a frame, m; zero if absent or faulty.
/// `what` names the position in messages.
fn position(
    vector_entry: Option<&FormulaVector>,
    symbols: &SymbolTable,
    what: &str,
    log: &mut DiagnosticLog,
) -> [ExactExpression; 3] {
    let Some(entry) = vector_entry else {
        return std::array::from_fn(|_| ExactExpression::zero());
    };
    let wanted = FormulaRequirement {
        sorts: &SORTS,
        dimension: UnitDimension::LENGTH,
        what,
    };
    // Entries are resolved first; each one must also be polynomial in the parameters.
    let position = vector(entry, &symbols.scope, wanted, log);
    for (exact, formula) in position.iter().zip(&entry.entries) {
        if let Some(formula) = formula {
            check_polynomial(exact, formula.ast.span, log);
        }
    }
    position
}

/// Reports an expression that is not a polynomial in the parameters.
/// Division by a parameter is the usual cause; a quantity in a divisor must be a constant.
fn check_polynomial(exact: &ExactExpression, span: SourceSpan, log: &mut DiagnosticLog) {
    if !is_polynomial(exact) {
        log.push(
            Diagnostic::error(span, "this is not a polynomial in the parameters")
                .label("parameters may be added and multiplied, with constant factors")
                .help("a quantity by which something is divided is a constant: declare it in `[constants]`"),
        );
    }
}

/// Whether an expression is a polynomial in the parameters; constants may occur anywhere.
fn is_polynomial(exact: &ExactExpression) -> bool {
    // Subexpressions without parameters are unrestricted.
    let free = |exact: &ExactExpression| !exact.mentions(&|symbol| matches!(symbol, ModelSymbol::Parameter(_)));
    // Sums, products and non-negative powers of polynomials are polynomials.
    match exact {
        ExactExpression::Rational(_) | ExactExpression::Pi | ExactExpression::Symbol(_) => true,
        ExactExpression::Sum(inner) | ExactExpression::Product(inner) => inner.iter().all(is_polynomial),
        ExactExpression::Negative(inner) => is_polynomial(inner),
        // Divisors and operands of functions must be free of parameters.
        ExactExpression::Quotient(above, below) => is_polynomial(above) && free(below),
        // A negative exponent divides by the base.
        ExactExpression::Power(base, exponent) => {
            if *exponent >= 0 {
                is_polynomial(base)
            } else {
                free(base)
            }
        }
        ExactExpression::Apply(_, inner) => free(inner),
    }
}

/// Reads the lumped masses.
pub(super) fn lumped_masses(
    model: &ModelEntry,
    symbols: &SymbolTable,
    tree: &FrameTree,
    points: &PointTable,
    log: &mut DiagnosticLog,
) -> Vec<LumpedMass> {
    // A name is needed only to override a lumped mass in a variant, but it must be unique.
    let entries = model.lumped_mass.iter().flat_map(|list| &list.entries);
    check_unique(
        "lumped mass",
        entries.clone().filter_map(|entry| entry.name.as_ref()),
        log,
    );
    entries
        .map(|entry| lumped_mass(entry, symbols, tree, points, log))
        .collect()
}

/// Reads one lumped mass; its frame is that of `on`, or that of the first point it names.
/// Its place may differ between the two balances, `force_at` and `moment_at`.
fn lumped_mass(
    entry: &LumpedMassEntry,
    symbols: &SymbolTable,
    tree: &FrameTree,
    points: &PointTable,
    log: &mut DiagnosticLog,
) -> LumpedMass {
    // Any of the three places may name the point that decides the frame.
    let spots = [&entry.at, &entry.force_at, &entry.moment_at];
    // The frame of a named point is used where `on` is absent.
    let named = spots.iter().find_map(|spot| match spot {
        Some(LumpedMassPlace::Point(name)) => points.get(&name.text),
        _ => None,
    });
    let frame = match (&entry.on, named) {
        (Some(on), _) => tree.find(on, log).unwrap_or(FrameIdx(0)),
        (None, Some(point)) => points.points[point.0].frame,
        (None, None) => {
            // An unknown point is reported where its position is read.
            if !log.syntax_broken
                && !entry.faulty
                && !spots.iter().any(|spot| matches!(spot, Some(LumpedMassPlace::Point(_))))
            {
                log.push(
                    Diagnostic::error(entry.span, "this lumped mass sits on no frame")
                        .label("expected `on`, the name of a frame, together with a position")
                        .help("add `on = \"...\"`, or name a point in `at`"),
                );
            }
            FrameIdx(0)
        }
    };
    // Both balances need a place; `at` serves as the default of both.
    let lacking = match (&entry.at, &entry.force_at, &entry.moment_at) {
        (None, None, None) => Some("at"),
        (None, None, Some(_)) => Some("force_at"),
        (None, Some(_), None) => Some("moment_at"),
        _ => None,
    };
    if let Some(key) = lacking.filter(|_| !log.syntax_broken && !entry.faulty) {
        log.push(
            Diagnostic::error(entry.span, "this lumped mass has no place")
                .label(format!("expected `{key}`, the name of a point or a vector"))
                .help("`at` is the place in both balances; `force_at` and `moment_at` replace it in one of them"),
        );
    }
    // Each balance has its own place, else the common one.
    let force_at = entry.force_at.as_ref().or(entry.at.as_ref());
    let moment_at = entry.moment_at.as_ref().or(entry.at.as_ref());
    LumpedMass {
        mass: quantity(entry.mass.as_ref(), symbols, UnitDimension::MASS, "the mass", log),
        share: mass_share(entry.share.as_ref(), log),
        frame,
        force_at: lumped_mass_position(force_at, frame, symbols, tree, points, log),
        moment_at: lumped_mass_position(moment_at, frame, symbols, tree, points, log),
    }
}

/// Warns of masses and moments of inertia whose values are negative at the nominal parameters.
/// These are warnings only, because the equations are right for all values; `check` calls such values not valid.
pub(super) fn warn_of_negative(model: &ModelEntry, mechanism: &Mechanism, log: &mut DiagnosticLog) {
    // Evaluates a quantity and reports it with its value if it is negative.
    let mut look = |exact: &ExactExpression, what: &str, unit: &str, span: SourceSpan, is_impossible: bool| {
        let value = exact.evaluate(&|symbol| mechanism.symbol_nominal(symbol));
        if value < 0.0 {
            log.push(
                Diagnostic::warning(span, format!("with nominal values {what} is {value} {unit}"))
                    .label("expected a positive value")
                    .help("check the sign of this entry and of the nominal values of the names in it")
                    .impossible_if(is_impossible),
            );
        }
    };
    // The mark is on the formula if there is one, else on the place given instead.
    let place = |formula: Option<&SourceFormula>, or: SourceSpan| formula.map_or(or, |f| f.ast.span);
    let parts = model.part.iter().flat_map(|list| &list.entries);
    // Find the formulas of the mass and of the three moments of inertia, for the place of the warning.
    for (entry, part) in parts.zip(&mechanism.parts) {
        let (mass, inertia, formulas, or) = match (&part.inertial, &entry.linear) {
            (PartInertia::Linear { mass, inertia, .. }, Some(linear)) => {
                let nominal = linear.nominal.as_ref().map_or(linear.span, |n| n.span);
                let formulas = ["M", "XX", "YY", "ZZ"].map(|symbol| explicit_entry(linear, symbol));
                (mass, inertia, formulas, nominal)
            }
            (PartInertia::AboutCentre { mass, inertia, .. } | PartInertia::Linear { mass, inertia, .. }, _) => {
                // A part about its centre has formulas in `mass` and `inertia`.
                let axes = entry.inertia.as_ref();
                let formulas = [
                    entry.mass.as_ref(),
                    axes.and_then(|axes| axes.xx.as_ref()),
                    axes.and_then(|axes| axes.yy.as_ref()),
                    axes.and_then(|axes| axes.zz.as_ref()),
                ];
                (mass, inertia, formulas, entry.span)
            }
        };
        let [m, x, y, z] = formulas.map(|formula| place(formula, or));
        let part = &part.name;
        look(mass, &format!("the mass of `{part}`"), "kg", m, true);
        // Moments of linear parameters may be regrouped: moved to a neighbouring body, since only their sum has effect.
        let is_regrouped = entry.linear.is_some();
        // Positions of the diagonal in xx, xy, xz, yy, yz, zz.
        for (axis, i, span) in [("x", 0, x), ("y", 3, y), ("z", 5, z)] {
            let what = format!("the moment of inertia of `{part}` about {axis}");
            look(&inertia[i], &what, "kg m^2", span, !is_regrouped);
        }
    }
    // Lumped masses have no names that are always there, so the place in the file identifies them.
    let lumped = model.lumped_mass.iter().flat_map(|list| &list.entries);
    for (entry, lumped) in lumped.zip(&mechanism.lumped_masses) {
        let span = place(entry.mass.as_ref(), entry.span);
        // A hole may be a negative mass in a full body; only the body must have a positive mass.
        let is_impossible = mechanism
            .nominal_mass_of_body(lumped.frame)
            .is_some_and(|mass| mass < 0.0);
        look(&lumped.mass, "this lumped mass", "kg", span, is_impossible);
    }
}

/// The share of a lumped mass as a rational number; 1 if absent or faulty.
/// Factors of any other kind belong into `mass`.
fn mass_share(formula: Option<&SourceFormula>, log: &mut DiagnosticLog) -> BigRational {
    let Some(formula) = formula else {
        return BigRational::one();
    };
    rational_value(&formula.ast).unwrap_or_else(|| {
        log.push(
            Diagnostic::error(formula.ast.span, "a share must be a rational number")
                .label("expected for example `1/2`")
                .help("put other factors into `mass`, such as `mass = \"k*m4\"`"),
        );
        BigRational::one()
    })
}

/// The position of a lumped mass in its frame, m, from a vector or a point; zero if absent or faulty.
/// A named point must be fixed to the frame of the mass.
fn lumped_mass_position(
    spot: Option<&LumpedMassPlace>,
    frame: FrameIdx,
    symbols: &SymbolTable,
    tree: &FrameTree,
    points: &PointTable,
    log: &mut DiagnosticLog,
) -> [ExactExpression; 3] {
    let nowhere = || std::array::from_fn(|_| ExactExpression::zero());
    let Some(spot) = spot else {
        return nowhere();
    };
    match spot {
        LumpedMassPlace::Vector(vector) => position(Some(vector), symbols, "the place of a lumped mass", log),
        LumpedMassPlace::Point(name) => {
            // An unknown point is reported by the lookup.
            let Some(idx) = points.find(name, log) else {
                return nowhere();
            };
            let point = &points.points[idx.0];
            if point.frame != frame {
                log.push(
                    Diagnostic::error(
                        spot.span(),
                        format!("the point `{}` is not fixed to this mass's frame", name.text),
                    )
                    .label(format!("it is on `{}`", tree.frames[point.frame.0].name))
                    .help("name a point on the same frame, or give the position as a vector"),
                );
            }
            point.at.clone()
        }
    }
}
