//! An additional body (payload). Forces are linear in its mass, first moments and inertia, and the inertia depends on
//! the position of its mass. So its parameters are a mass at a position and the spread about it; the body is physically
//! possible if these are positive.
//!
//! Decision: ten independent parameters span what a spring, a weight or a gear does, and most of their values are no
//! possible body. Mass and first moments with the inertia that follows from them are four, possible by one sign; the
//! spread of the mass is three more, tried afterwards. Forces are homogeneous of degree one in all of them, so columns
//! that are derivatives add up to the complete force (Euler), and a few iterations find the position. With estimated
//! base parameters a payload adds nothing, exactly, and is not tried.

use super::column::ForceColumn;

/// Entries of an inertia matrix in the order of columns, by axes.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// A body that is attached to a body of the model. Its parameters are the mass (kg), the first moments along x, y and z
/// (kg m), and the second moments about its centre along x, y and z (kg m^2); `estimated` selects some of them.
#[derive(Clone, Debug, PartialEq)]
pub struct AttachedBody {
    /// Columns of its ten inertial parameters about the frame's origin: mass, first moments x, y, z, entries of the
    /// inertia matrix xx, xy, xz, yy, yz, zz.
    pub inertial_columns: [ForceColumn; 10],
    /// Which of the seven parameters are estimated, in order.
    pub estimated: Vec<usize>,
    /// Largest distance of its centre from the frame's origin, m.
    pub max_distance: f64,
}

impl AttachedBody {
    /// Position of the centre in the frame, m, for values of the estimated parameters; the origin if the mass is not
    /// estimated or not positive.
    pub(crate) fn centre(&self, values: &[f64]) -> [f64; 3] {
        let value = |of: usize| {
            let at = self.estimated.iter().position(|free| *free == of);
            at.map_or(0.0, |at| values[at])
        };
        let mass = value(0);
        if mass <= 0.0 {
            return [0.0; 3];
        }
        let centre = [1, 2, 3].map(|k| value(k) / mass);
        let far = centre.iter().map(|c| c * c).sum::<f64>().sqrt();
        // A very small mass has an ill-determined centre, which is limited to the largest distance.
        centre.map(|c| c * (self.max_distance / far.max(f64::MIN_POSITIVE)).min(1.0))
    }

    /// Whether values of the estimated parameters put the centre beyond the largest distance.
    pub(crate) fn is_out_of_reach(&self, values: &[f64]) -> bool {
        let of = |quantity: usize| self.estimated.iter().position(|free| *free == quantity);
        let Some(mass) = of(0).map(|at| values[at]) else {
            return false;
        };
        let moments = [1, 2, 3].map(|k| of(k).map_or(0.0, |at| values[at]));
        moments.iter().map(|h| h * h).sum::<f64>().sqrt() > self.max_distance * mass
    }

    /// Columns of the estimated parameters: derivatives of the forces at a position of the centre, m. Times the
    /// parameters they add up to the complete force, since the inertia is homogeneous of degree one in mass and first
    /// moments (Euler).
    pub(crate) fn columns(&self, centre: [f64; 3]) -> Vec<ForceColumn> {
        let squares: f64 = centre.iter().map(|c| c * c).sum();
        let one = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let of = |free: &usize| {
            let entry = |i: usize, j: usize| match *free {
                // The inertia of a mass at c is (|h|^2 - h h') / m with h = m c.
                0 => centre[i] * centre[j] - squares * one(i, j),
                k @ 1..=3 => {
                    let k = k - 1;
                    2.0 * centre[k] * one(i, j) - one(k, i) * centre[j] - centre[i] * one(k, j)
                }
                k => one(i, j) * (1.0 - one(k - 4, i)),
            };
            let mut column = match *free {
                k @ 0..=3 => self.inertial_columns[k].clone(),
                _ => ForceColumn(vec![None; self.inertial_columns[0].0.len()]),
            };
            for (inertia, (i, j)) in self.inertial_columns[4..].iter().zip(ENTRIES) {
                let factor = entry(i, j);
                if factor != 0.0 {
                    column.add(factor, inertia);
                }
            }
            column
        };
        self.estimated.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten columns that distinguish the ten parameters.
    fn planted_columns() -> [ForceColumn; 10] {
        std::array::from_fn(|k| {
            let mut values = vec![0.0; 10];
            values[k] = 1.0;
            ForceColumn(vec![Some(values)])
        })
    }

    /// At the body's own centre the columns give its inertia about the origin by Steiner's theorem.
    #[test]
    fn columns_add_up_to_the_ten_parameters_of_the_body() {
        let body = AttachedBody {
            inertial_columns: planted_columns(),
            estimated: (0..7).collect(),
            max_distance: 2.0,
        };
        let (mass, centre, spread) = (2.8, [0.1, -0.2, 0.4], [0.01, 0.02, 0.03]);
        let values = [
            mass,
            mass * centre[0],
            mass * centre[1],
            mass * centre[2],
            spread[0],
            spread[1],
            spread[2],
        ];
        let found = body.centre(&values);
        assert!(found.iter().zip(centre).all(|(a, b)| (a - b).abs() < 1e-14));
        let mut sum = ForceColumn(vec![None]);
        for (column, value) in body.columns(found).iter().zip(values) {
            sum.add(value, column);
        }
        let [x, y, z] = centre;
        let [xx, yy, zz] = [x, y, z].map(|c| mass * c * c);
        let expected = [
            mass,
            mass * x,
            mass * y,
            mass * z,
            yy + zz + 0.05,
            -mass * x * y,
            -mass * x * z,
            xx + zz + 0.04,
            -mass * y * z,
            xx + yy + 0.03,
        ];
        let sum = sum.0[0].as_deref().unwrap_or_default();
        for (found, expected) in sum.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }

    /// Columns are derivatives of the forces: differences of the complete force agree with them.
    #[test]
    fn columns_are_derivatives() {
        let body = AttachedBody {
            inertial_columns: planted_columns(),
            estimated: (0..4).collect(),
            max_distance: 2.0,
        };
        let force = |values: &[f64]| {
            let mut sum = ForceColumn(vec![Some(vec![0.0; 10])]);
            for (column, value) in body.columns(body.centre(values)).iter().zip(values) {
                sum.add(*value, column);
            }
            sum.0[0].clone().unwrap_or_default()
        };
        let at = [1.5, 0.3, -0.6, 0.2];
        let columns = body.columns(body.centre(&at));
        for k in 0..4 {
            let moved = |by: f64| {
                let mut values = at;
                values[k] += by;
                force(&values)
            };
            let (back, ahead) = (moved(-1e-5), moved(1e-5));
            let column = columns[k].0[0].as_deref().unwrap_or_default();
            for (i, slope) in column.iter().enumerate() {
                assert!(((ahead[i] - back[i]) / 2e-5 - slope).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn a_centre_beyond_reach_is_no_place() {
        let body = AttachedBody {
            inertial_columns: planted_columns(),
            estimated: vec![0, 1],
            max_distance: 1.0,
        };
        assert!(!body.is_out_of_reach(&[1.0, 0.9]) && body.is_out_of_reach(&[1.0, -1.1]));
        assert!(body.is_out_of_reach(&[-1.0, 0.1]));
    }
}
