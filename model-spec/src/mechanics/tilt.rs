//! A base that stands turned by Rz(tz) Ry(ty) Rx(tx) against the one in which gravity was given.

use crate::build::symbols::Symbols as Names;
use crate::diagnostic::Log;
use crate::exact::{ConstantIdx, Exact, Function, Symbol};
use crate::kinds::ActsOn;
use crate::mechanics::{Entry, Symbols};
use crate::mechanism::{Constant, Effect};
use crate::scope::{Sort, meaning};
use crate::unit::Dimension;
use crate::values::Name;

pub(crate) struct Tilt;

impl Entry for Tilt {
    fn words(&self) -> &'static str {
        "gravity turned back by Rz(tz) Ry(ty) Rx(tx)"
    }

    fn lead(&self) -> &'static str {
        "turns the base by "
    }

    fn constant_label(&self, symbol: &str) -> &'static str {
        match symbol {
            "tx" => "x: ",
            "ty" => "y: ",
            _ => "z: ",
        }
    }

    fn on(&self) -> ActsOn {
        ActsOn::Base
    }

    fn constants(&self) -> Symbols {
        &[
            ("tx", Dimension::ONE),
            ("ty", Dimension::ONE),
            ("tz", Dimension::ONE),
        ]
    }

    /// Each angle as a constant with a name: their sines and cosines stay exact, and generated code can be given other
    /// ones. Zeros are left out.
    fn named_constants(
        &self,
        values: Vec<(String, Exact)>,
        kind: &Name,
        names: &mut Names,
        log: &mut Log,
    ) -> Option<Vec<(String, Exact)>> {
        let mut named = Vec::new();
        for (symbol, angle) in values {
            if angle.is_zero() {
                continue;
            }
            if angle.mentions(&|_| true) {
                named.push((symbol, angle));
                continue;
            }
            let name = format!("{symbol}_base");
            let idx = ConstantIdx(names.constants.len());
            let value = angle.evaluate(&|_| 0.0);
            let mut meaning = meaning(
                Sort::Constant,
                Symbol::Constant(idx),
                Some(Dimension::ONE),
                "rad",
                Some(kind.span),
            );
            meaning.value = Some(value);
            meaning.used.set(true);
            if !names.scope.declare(&name, meaning, log) {
                return None;
            }
            names.constants.push(Constant {
                name,
                value,
                unit: "rad".to_owned(),
                is_angle: true,
                note: Some("tilt of the base".to_owned()),
            });
            named.push((symbol, Exact::Symbol(Symbol::Constant(idx))));
        }
        Some(named)
    }

    /// The transposed rotations, the outermost first.
    fn gravity(&self, effect: &Effect, mut gravity: [Exact; 3]) -> [Exact; 3] {
        for (symbol, [from, to]) in [("tz", [0, 1]), ("ty", [2, 0]), ("tx", [1, 2])] {
            let Some((_, angle)) = effect.constants.iter().find(|(name, _)| name == symbol) else {
                continue;
            };
            let [a, b] = [from, to].map(|i| gravity[i].clone());
            let cos = Exact::Apply(Function::Cos, Box::new(angle.clone()));
            let sin = Exact::Apply(Function::Sin, Box::new(angle.clone()));
            gravity[from] = sum([times(&cos, &a), times(&sin, &b)]);
            gravity[to] = sum([times(&cos, &b), negative(times(&sin, &a))]);
        }
        gravity
    }
}

fn times(a: &Exact, b: &Exact) -> Exact {
    if b.is_zero() {
        return Exact::zero();
    }
    Exact::Product(vec![a.clone(), b.clone()])
}

fn negative(a: Exact) -> Exact {
    if a.is_zero() {
        return a;
    }
    Exact::Negative(Box::new(a))
}

fn sum([a, b]: [Exact; 2]) -> Exact {
    match (a.is_zero(), b.is_zero()) {
        (true, _) => b,
        (_, true) => a,
        _ => Exact::Sum(vec![a, b]),
    }
}
