//! A constant of the model with a wrong value, such as a length. Its effect on the forces is described by their first
//! and second derivatives.

use super::column::ForceColumn;
use super::tilt::ForceSensitivity;

/// A constant whose value may be wrong; its parameter is the true value minus the value of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct ConstantCorrection {
    /// First derivative of the forces with respect to it.
    pub first_derivative: ForceSensitivity,
    /// Second derivative of the forces with respect to it.
    pub second_derivative: ForceSensitivity,
}

impl ConstantCorrection {
    /// Change of the forces per unit of the error, between no error and `error`: times the error it is the complete
    /// change up to the third power. `base` are the factors of the base columns.
    pub(crate) fn secant_column(&self, error: f64, base: &[f64], channels: usize) -> ForceColumn {
        let mut sum = ForceColumn(vec![None; channels]);
        let mut parts: Vec<(f64, &ForceColumn)> = Vec::new();
        for (part, share) in [(&self.first_derivative, 1.0), (&self.second_derivative, 0.5 * error)] {
            if share == 0.0 {
                continue;
            }
            parts.push((share, &part.fixed));
            parts.extend(base.iter().map(|factor| share * factor).zip(&part.base));
        }
        sum.add_all(&parts);
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The square of a number, of which the base column and the force of a fixed parameter each have a part.
    #[test]
    fn the_column_times_the_error_is_the_change() {
        let one = |value: f64| ForceColumn(vec![Some(vec![value])]);
        let (constant, factor) = (3.0, 5.0);
        let held = |value: f64| ForceSensitivity {
            base: vec![one(value)],
            fixed: one(2.0 * value),
        };
        let square = ConstantCorrection {
            first_derivative: held(2.0 * constant),
            second_derivative: held(2.0),
        };
        let error = 0.4_f64;
        let column = square.secant_column(error, &[factor], 1);
        let change = error * column.0[0].as_deref().unwrap_or_default()[0];
        let expected = (factor + 2.0) * ((constant + error).powi(2) - constant.powi(2));
        assert!((change - expected).abs() < 1e-12, "{change} {expected}");
    }
}
