//! Coordinates that follow others: gears, belts, screws, differentials.

use std::collections::BTreeMap;

use crate::build::Places;
use crate::build::symbols::Symbols;
use crate::diagnostic::{Diagnostic, Log, Span};
use crate::exact::{CoordinateIdx, Exact, Symbol};
use crate::formula::Formula;
use crate::mechanism::Coupling;
use crate::schema::{CoordinateEntry, ModelEntry};
use crate::scope::{Sort, Wanted};

/// Reads the couplings and gives what follows its nominal value.
pub(super) fn couplings(
    model: &ModelEntry,
    symbols: &mut Symbols,
    places: &Places,
    log: &mut Log,
) -> Vec<Coupling> {
    let mut found: Vec<(Coupling, Span)> = Vec::new();
    for (key, entry) in model.coordinates.iter().flat_map(|table| &table.entries) {
        let Some(follows) = &entry.follows else {
            continue;
        };
        let Some(i) = symbols.coordinates.iter().position(|c| c.name == key.name) else {
            continue;
        };
        reject_unused(entry, key.span, log);
        if let Some(coupling) = coupling(follows, CoordinateIdx(i), symbols, log) {
            found.push((coupling, follows.ast.span));
        }
    }
    if log.n_errors() == 0 {
        set_nominal(&found, symbols, places, log);
    }
    found.into_iter().map(|(coupling, _)| coupling).collect()
}

/// Says what else is given that follows already.
fn reject_unused(entry: &CoordinateEntry, span: Span, log: &mut Log) {
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
                    format!("`{name}` says nothing of a coordinate that follows others"),
                )
                .label(format!("delete `{name}`")),
            );
        }
    }
}

fn coupling(
    follows: &Formula,
    coordinate: CoordinateIdx,
    symbols: &Symbols,
    log: &mut Log,
) -> Option<Coupling> {
    let own = &symbols.coordinates[coordinate.0];
    let wanted = Wanted {
        sorts: &[Sort::Constant, Sort::Coordinate],
        dimension: own.motion.dimension(),
        what: "what this coordinate follows",
    };
    let exact = symbols.scope.resolve(follows, wanted, log)?;
    let span = follows.ast.span;
    let Some(Linear { terms, offset }) = linear(&exact) else {
        log.push(
            Diagnostic::error(span, "a coordinate follows others in proportion")
                .label("expected a sum of coordinates, each times constants, and of constants")
                .help("for example `\"n*q1\"`, `\"h*q1 + s0\"` or `\"(q1 + q2)/2\"`"),
        );
        return None;
    };
    let terms: Vec<(CoordinateIdx, Exact)> = terms.into_iter().collect();
    if terms.is_empty() {
        log.push(
            Diagnostic::error(span, "this follows no coordinate")
                .label("expected the name of a coordinate in it")
                .help("what stands still needs no coordinate: write the constant into the frame"),
        );
        return None;
    }
    let all = terms.iter().map(|(i, _)| *i).chain([coordinate]);
    if let Some(i) = all
        .into_iter()
        .find(|i| symbols.coordinates[i.0].motion.is_quaternion())
    {
        let name = &symbols.coordinates[i.0].name;
        log.push(
            Diagnostic::error(span, format!("`{name}` is a component of a quaternion"))
                .label("only angles and lengths of joints follow each other"),
        );
        return None;
    }
    Some(Coupling {
        coordinate,
        terms,
        offset,
    })
}

/// Puts what follows at its nominal value; what follows itself is reported.
fn set_nominal(found: &[(Coupling, Span)], symbols: &mut Symbols, places: &Places, log: &mut Log) {
    let mut left: Vec<&(Coupling, Span)> = found.iter().collect();
    while !left.is_empty() {
        let waits = |coupling: &Coupling| {
            let mut terms = coupling.terms.iter();
            terms.any(|(i, _)| left.iter().any(|(other, _)| other.coordinate == *i))
        };
        let Some(next) = left.iter().position(|(coupling, _)| !waits(coupling)) else {
            let (coupling, span) = left[0];
            log.push(
                Diagnostic::error(
                    places.coordinates[coupling.coordinate.0],
                    format!(
                        "`{}` follows itself",
                        symbols.coordinates[coupling.coordinate.0].name
                    ),
                )
                .label("by way of what it follows")
                .related(*span, "it follows this")
                .help("one of the coordinates has to move by itself"),
            );
            return;
        };
        let (coupling, _) = left.remove(next);
        let value = |symbol: Symbol| match symbol {
            Symbol::Coordinate(i) => symbols.coordinates[i.0].nominal,
            Symbol::Constant(i) => symbols.constants[i.0].value,
            Symbol::Parameter(_) | Symbol::Place(_) => f64::NAN,
        };
        symbols.coordinates[coupling.coordinate.0].nominal = coupling.value(&value);
    }
}

/// An expression as a sum of multiples of coordinates, and what is left.
struct Linear {
    terms: BTreeMap<CoordinateIdx, Exact>,
    offset: Exact,
}

impl Linear {
    fn fixed(offset: Exact) -> Self {
        Self {
            terms: BTreeMap::new(),
            offset,
        }
    }

    /// Does the same to every factor and to the rest.
    fn map(self, f: impl Fn(Exact) -> Exact) -> Self {
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

/// `None` where a coordinate stands otherwise than in proportion.
fn linear(exact: &Exact) -> Option<Linear> {
    let mut moves = false;
    exact.for_each_symbol(&mut |symbol| moves |= matches!(symbol, Symbol::Coordinate(_)));
    if !moves {
        return Some(Linear::fixed(exact.clone()));
    }
    match exact {
        Exact::Symbol(Symbol::Coordinate(i)) => Some(Linear {
            terms: BTreeMap::from([(*i, Exact::one())]),
            offset: Exact::zero(),
        }),
        Exact::Negative(inner) => Some(linear(inner)?.map(|x| Exact::Negative(Box::new(x)))),
        Exact::Quotient(above, below) => {
            let fixed = linear(below).filter(|below| below.terms.is_empty())?;
            let divided = |x| Exact::Quotient(Box::new(x), Box::new(fixed.offset.clone()));
            Some(linear(above)?.map(divided))
        }
        Exact::Product(factors) => {
            let mut moving: Option<Linear> = None;
            let mut others = Vec::new();
            for factor in factors {
                let found = linear(factor)?;
                if found.terms.is_empty() {
                    others.push(found.offset);
                } else if moving.replace(found).is_some() {
                    return None;
                }
            }
            let times = |x: Exact| {
                let one = (x != Exact::one()).then_some(x);
                let mut all: Vec<Exact> = others.iter().cloned().chain(one).collect();
                match all.len() {
                    0 => Exact::one(),
                    1 => all.remove(0),
                    _ => Exact::Product(all),
                }
            };
            Some(moving?.map(times))
        }
        Exact::Sum(terms) => {
            let mut sum = Linear::fixed(Exact::zero());
            let mut fixed = Vec::new();
            for term in terms {
                let found = linear(term)?;
                for (i, factor) in found.terms {
                    let all = match sum.terms.remove(&i) {
                        Some(before) => Exact::Sum(vec![before, factor]),
                        None => factor,
                    };
                    sum.terms.insert(i, all);
                }
                if !found.offset.is_zero() {
                    fixed.push(found.offset);
                }
            }
            sum.offset = match fixed.len() {
                0 => Exact::zero(),
                1 => fixed.remove(0),
                _ => Exact::Sum(fixed),
            };
            Some(sum)
        }
        _ => None,
    }
}
