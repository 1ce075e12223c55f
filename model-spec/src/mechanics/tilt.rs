//! A base that is rotated by Rz(tz) Ry(ty) Rx(tx) relative to the frame in which gravity is given.
//!
//! Gravity is rotated instead of the base, so that all frames stay as they are.

use crate::build::symbols::SymbolTable as Names;
use crate::diagnostic::DiagnosticLog;
use crate::exact::{ConstantIdx, ExactExpression, ExactFunction, ModelSymbol};
use crate::kinds::ActsOn;
use crate::mechanics::{MechanicsEntry, MechanicsSymbols};
use crate::mechanism::{ModelConstant, ModelEffect};
use crate::scope::{SymbolSort, symbol_meaning};
use crate::unit::UnitDimension;
use crate::values::SpannedName;

/// The entry of [`crate::Mechanics::Tilt`]: three constant angles, rad, and no parameters.
pub(crate) struct TiltMechanics;

impl MechanicsEntry for TiltMechanics {
    fn description(&self) -> &'static str {
        "gravity rotated back by Rz(tz) Ry(ty) Rx(tx)"
    }

    fn introduction(&self) -> &'static str {
        "rotates the base by "
    }

    fn constant_label(&self, symbol: &str) -> &'static str {
        match symbol {
            "tx" => "x: ",
            "ty" => "y: ",
            _ => "z: ",
        }
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::Base
    }

    fn constants(&self) -> MechanicsSymbols {
        &[
            ("tx", UnitDimension::ONE),
            ("ty", UnitDimension::ONE),
            ("tz", UnitDimension::ONE),
        ]
    }

    /// Each angle becomes a named constant, so that its sine and cosine stay exact and generated code can change it.
    /// Angles of zero are dropped.
    fn named_constants(
        &self,
        values: Vec<(String, ExactExpression)>,
        kind: &SpannedName,
        names: &mut Names,
        log: &mut DiagnosticLog,
    ) -> Option<Vec<(String, ExactExpression)>> {
        let mut named = Vec::new();
        // Zero angles would only lengthen the expressions of gravity.
        for (symbol, angle) in values {
            if angle.is_zero() {
                continue;
            }
            // An angle that is an expression over constants of the file needs no name of its own.
            if angle.mentions(&|_| true) {
                named.push((symbol, angle));
                continue;
            }
            // A number becomes the constant `tx_base`, `ty_base` or `tz_base`.
            let name = format!("{symbol}_base");
            let idx = ConstantIdx(names.constants.len());
            let value = angle.evaluate(&|_| 0.0);
            // The name must be new in the model; a clash is reported at the kind of the effect.
            let mut meaning = symbol_meaning(
                SymbolSort::Constant,
                ModelSymbol::Constant(idx),
                Some(UnitDimension::ONE),
                "rad",
                Some(kind.span),
            );
            meaning.value = Some(value);
            meaning.used.set(true);
            if !names.scope.declare(&name, meaning, log) {
                return None;
            }
            names.constants.push(ModelConstant {
                name,
                value,
                unit: "rad".to_owned(),
                is_angle: true,
                note: Some("tilt of the base".to_owned()),
            });
            named.push((symbol, ExactExpression::Symbol(ModelSymbol::Constant(idx))));
        }
        Some(named)
    }

    /// Applies the transposed rotations, the outermost first: with R = Rz(tz) Ry(ty) Rx(tx) this is R' g = Rx' Ry' Rz' g.
    fn gravity(&self, effect: &ModelEffect, mut gravity: [ExactExpression; 3]) -> [ExactExpression; 3] {
        // Each rotation mixes the two components that are not along its axis.
        for (symbol, [from, to]) in [("tz", [0, 1]), ("ty", [2, 0]), ("tx", [1, 2])] {
            // An angle of zero was dropped, so its rotation is skipped.
            let Some((_, angle)) = effect.constants.iter().find(|(name, _)| name == symbol) else {
                continue;
            };
            let [a, b] = [from, to].map(|i| gravity[i].clone());
            let cos = ExactExpression::Apply(ExactFunction::Cos, Box::new(angle.clone()));
            let sin = ExactExpression::Apply(ExactFunction::Sin, Box::new(angle.clone()));
            gravity[from] = sum([times(&cos, &a), times(&sin, &b)]);
            gravity[to] = sum([times(&cos, &b), negative(times(&sin, &a))]);
        }
        gravity
    }
}

/// A product, or zero if the second factor is zero.
fn times(a: &ExactExpression, b: &ExactExpression) -> ExactExpression {
    if b.is_zero() {
        return ExactExpression::zero();
    }
    ExactExpression::Product(vec![a.clone(), b.clone()])
}

/// The negative; zero stays zero.
fn negative(a: ExactExpression) -> ExactExpression {
    if a.is_zero() {
        return a;
    }
    ExactExpression::Negative(Box::new(a))
}

/// A sum without terms that are zero.
fn sum([a, b]: [ExactExpression; 2]) -> ExactExpression {
    match (a.is_zero(), b.is_zero()) {
        (true, _) => b,
        (_, true) => a,
        _ => ExactExpression::Sum(vec![a, b]),
    }
}
