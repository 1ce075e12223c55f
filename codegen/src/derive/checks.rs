//! Checks for numbers that a derivation must not contain: factors beyond the range of floating point, and base
//! parameters whose denominator is zero for the file's constants.

use crate::lower::{ProgramOp, StraightLineProgram};
use crate::programs::PassivePosition;
use crate::{Derivation, DeriveError};

/// Returns an error if a program or a nominal base parameter contains a number that is not finite.
pub(crate) fn check_results(derivation: &Derivation) -> Result<(), DeriveError> {
    let programs = &derivation.programs;
    let mut all = vec![
        &programs.passive,
        &programs.full_regressor,
        &programs.regressor,
        &programs.inverse_dynamics,
        &programs.base_parameters,
        &programs.drives,
    ];
    if let PassivePosition::Newton(loops) = &programs.passive_position {
        all.extend([&loops.residual, &loops.scales]);
    }
    // Exact factors may be beyond the range of floating point.
    if let Some(number) = all.into_iter().find_map(oversized_number) {
        return Err(DeriveError::NotFinite {
            what: format!("the factor {number} of the equations"),
            todo: "use factors of reasonable size in the model file",
        });
    }
    // A denominator may be zero at the file's values only.
    let nominal = derivation.nominal_base_values();
    let Some(k) = nominal.iter().position(|value| !value.is_finite()) else {
        return Ok(());
    };
    let base = &derivation.base_parameters()[k];
    Err(DeriveError::NotFinite {
        what: format!(
            "with the model file's values, the base parameter {} = {}",
            base.name, base.expression
        ),
        todo: "check whether a constant in a denominator is zero (then retain other products) or values are too large",
    })
}

/// A number of a program that is infinite in floating point, as text.
fn oversized_number(program: &StraightLineProgram) -> Option<String> {
    program.ops.iter().find_map(|op| match op {
        ProgramOp::Number(number) if !number.to_f64().is_finite() => Some(number.to_big().to_string()),
        _ => None,
    })
}
