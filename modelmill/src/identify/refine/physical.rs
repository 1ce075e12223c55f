//! Refinement: physical consistency of bodies. Pseudo-inertias and positive effect parameters are constrained to be
//! positive definite, and base parameters are functions of the physical ones.

use modelmill_identify::estimate::{
    BaseMap, BodyMatrix, PhysicalParameters, WeightedEstimate, physical_parameters, planar_pseudo_inertia,
    pseudo_inertia,
};
use modelmill_identify::{ParameterUncertainty, RFactor, RegressionSolution};
use modelmill_spec::{ExactExpression, Mechanism, ModelSymbol, PartInertia, Sign};
use nalgebra::{DMatrix, DVector};

use super::RefinementResult;
use crate::error::{Error, Outcome};
use crate::model::Model;

/// Takes the physical parameters that bodies can have and that fit the recordings best.
///
/// Fails when no consistent parameters are found.
pub(super) fn refine(model: &Model, found: &mut WeightedEstimate, unknown: &[usize]) -> Outcome<RefinementResult> {
    let WeightedEstimate {
        solution,
        uncertainty,
        r_factor,
        ..
    } = found;
    // The residual without constraints is kept for comparison.
    let before = solution.residual_norm;
    let (physical, bodies) = solve_physical(model, r_factor, solution, uncertainty, unknown)?;
    solution.values.clone_from(&physical.base);
    solution.residual_norm = physical.residual_norm;
    uncertainty.std.clone_from(&physical.base_std);
    // Directions that the recordings do not determine are fixed by nominal values.
    solution.undetermined.clear();
    solution.determined = physical.base.iter().map(|_| true).collect();
    Ok(RefinementResult::Physical(Box::new(physical), bodies, before))
}

/// Solves for physical parameters that bodies can have; also returns the names of the bodies.
///
/// Fails when no consistent parameters are found.
fn solve_physical(
    model: &Model,
    r_factor: &RFactor,
    solution: &RegressionSolution,
    uncertainty: &ParameterUncertainty,
    unknown: &[usize],
) -> Outcome<(PhysicalParameters, Vec<String>)> {
    let mechanism = &model.derivation.mechanism;
    let start = start_values(model, solution, uncertainty, unknown);
    // Bodies are constrained as matrices, effect parameters as matrices of one entry.
    let mut bodies = bodies(mechanism);
    for p in model.positive_effects() {
        // A parameter without a start value, whose column repeats another's, is not constrained.
        if start[p] > 0.0 {
            bodies.push(BodyMatrix {
                name: mechanism.parameters[p].name.clone(),
                matrix: Box::new(move |x: &[f64]| scalar_matrix(x[p])),
                copies: 1.0,
            });
        }
    }
    // Base parameters are polynomials of the physical ones.
    let base = |x: &[f64]| base_map(model, unknown, x);
    let base: &BaseMap<'_> = &base;
    let found = physical_parameters(r_factor, solution, uncertainty, &start, base, &bodies)
        .map_err(|error| Error::input(format!("{}: {error}", model.path)))?;
    Ok((found, bodies.into_iter().map(|body| body.name).collect()))
}

/// Start values: nominal ones; for positive effect parameters without a nominal value, the least-squares estimate.
fn start_values(
    model: &Model,
    solution: &RegressionSolution,
    uncertainty: &ParameterUncertainty,
    unknown: &[usize],
) -> Vec<f64> {
    // All parameters of bodies have nominal values, those of effects often have none.
    let parameters = &model.derivation.mechanism.parameters;
    let mut start: Vec<f64> = parameters.iter().map(|p| p.nominal).collect();
    // The estimate exists only if the parameter is a base parameter of its own.
    for p in model.positive_effects() {
        if start[p] > 0.0 {
            continue;
        }
        for (i, k) in unknown.iter().enumerate() {
            if let [(product, factor)] = model.products_of(*k).as_slice()
                && product.0 == [(p, 1)]
            {
                // The start is at least one standard deviation above zero.
                let deviation = if uncertainty.std[i].is_finite() {
                    uncertainty.std[i]
                } else {
                    0.0
                };
                start[p] = (solution.values[i] / factor).max(deviation / factor.abs());
            }
        }
    }
    start
}

/// The base parameters `unknown` at the physical parameters `x`, and their Jacobian.
fn base_map(model: &Model, unknown: &[usize], x: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
    // A base parameter is a sum of products of powers.
    let mut values = DVector::zeros(unknown.len());
    let mut slopes = DMatrix::zeros(unknown.len(), x.len());
    for (row, k) in unknown.iter().enumerate() {
        for (product, factor) in model.products_of(*k) {
            let powers: Vec<(usize, i32)> = product
                .0
                .iter()
                .map(|(p, n)| (*p, i32::try_from(*n).unwrap_or(i32::MAX)))
                .collect();
            values[row] += factor * powers.iter().map(|(p, n)| x[*p].powi(*n)).product::<f64>();
            // The derivative of a product of powers, factor by factor.
            for (at, (p, n)) in powers.iter().enumerate() {
                let others = powers.iter().enumerate().filter(|(other, _)| *other != at);
                let others: f64 = others.map(|(_, (q, m))| x[*q].powi(*m)).product();
                slopes[(row, *p)] += factor * f64::from(*n) * x[*p].powi(n - 1) * others;
            }
        }
    }
    (values, slopes)
}

/// A scalar as a matrix of one entry.
fn scalar_matrix(value: f64) -> DMatrix<f64> {
    DMatrix::from_element(1, 1, value)
}

/// The matrices that must be positive definite: the pseudo-inertia of a part with all three moments; mass and inertia
/// about the centre for a part with one moment; the mass of a lumped mass.
fn bodies(mechanism: &Mechanism) -> Vec<BodyMatrix<'_>> {
    let mut bodies = Vec::new();
    for part in &mechanism.parts {
        add_part(mechanism, &part.name, &part.inertial, &mut bodies);
    }
    // Lumped masses without a parameter are numbers of the file.
    for (k, lump) in mechanism.lumped_masses.iter().enumerate() {
        if has_parameter(&lump.mass) {
            bodies.push(BodyMatrix {
                name: format!("lumped mass {} on {}", k + 1, mechanism.frames[lump.frame.0].name),
                matrix: Box::new(|x: &[f64]| scalar_matrix(value(mechanism, &lump.mass, x))),
                copies: 1.0,
            });
        }
    }
    bodies
}

/// Adds the constraints of one part; none if it has no parameter.
fn add_part<'a>(mechanism: &'a Mechanism, name: &str, inertial: &'a PartInertia, bodies: &mut Vec<BodyMatrix<'a>>) {
    // Both ways of giving the inertia have a mass, a vector and a tensor.
    let (PartInertia::AboutCentre {
        mass,
        centre: place,
        inertia,
    }
    | PartInertia::Linear {
        mass,
        first_moment: place,
        inertia,
    }) = inertial;
    // A part of numbers only cannot be inconsistent with a fit.
    let all = std::iter::once(mass).chain(place).chain(inertia);
    if !all.clone().any(has_parameter) {
        return;
    }
    // Bodies are named in the result, since their margin is reported.
    let name = if name.is_empty() {
        "a part".to_owned()
    } else {
        format!("part {name}")
    };
    let about = |which: &str| format!("{name}, {which}");
    let has_mass = !mass.is_zero();
    let diagonal = [0, 3, 5];
    // Axes with a moment of inertia that is not zero.
    let moments: Vec<usize> = (0..3).filter(|axis| !inertia[diagonal[*axis]].is_zero()).collect();
    // The number of moments of inertia decides which constraint applies.
    match moments.as_slice() {
        // A point mass.
        [] if has_mass => bodies.push(BodyMatrix {
            name,
            matrix: Box::new(move |x: &[f64]| scalar_matrix(value(mechanism, mass, x))),
            copies: 1.0,
        }),
        // A planar body: mass, two first moments and one moment of inertia, in a 3 x 3 matrix.
        [axis] if has_mass => {
            let axis = *axis;
            bodies.push(BodyMatrix {
                name,
                matrix: Box::new(move |x: &[f64]| {
                    let (m, h, i) = about_origin(mechanism, inertial, x);
                    planar_pseudo_inertia(m, [h[(axis + 1) % 3], h[(axis + 2) % 3]], i[diagonal[axis]])
                }),
                copies: 2.0,
            });
        }
        // A spatial body: the pseudo-inertia is a 4 x 4 matrix.
        [_, _, _] if has_mass => bodies.push(BodyMatrix {
            name,
            matrix: Box::new(move |x: &[f64]| {
                let (m, h, i) = about_origin(mechanism, inertial, x);
                pseudo_inertia(m, h, i)
            }),
            copies: 1.0,
        }),
        // Two moments, or no mass: each value is only constrained to be positive.
        axes => {
            for axis in axes {
                let moment = &inertia[diagonal[*axis]];
                bodies.push(BodyMatrix {
                    name: about(["inertia about x", "inertia about y", "inertia about z"][*axis]),
                    matrix: Box::new(move |x: &[f64]| scalar_matrix(value(mechanism, moment, x))),
                    copies: 1.0,
                });
            }
            if has_mass {
                bodies.push(BodyMatrix {
                    name: about("mass"),
                    matrix: Box::new(move |x: &[f64]| scalar_matrix(value(mechanism, mass, x))),
                    copies: 1.0,
                });
            }
        }
    }
}

/// Mass, first moment and inertia about the frame's origin, at the parameters `x`.
fn about_origin(mechanism: &Mechanism, inertial: &PartInertia, x: &[f64]) -> (f64, [f64; 3], [f64; 6]) {
    // Both cases give the quantities about the origin of the frame.
    let get = |exact: &ExactExpression| value(mechanism, exact, x);
    match inertial {
        PartInertia::Linear {
            mass,
            first_moment,
            inertia,
        } => (
            get(mass),
            std::array::from_fn(|i| get(&first_moment[i])),
            std::array::from_fn(|i| get(&inertia[i])),
        ),
        PartInertia::AboutCentre { mass, centre, inertia } => {
            let m = get(mass);
            let [a, b, c]: [f64; 3] = std::array::from_fn(|i| get(&centre[i]));
            // Steiner's rule; off-diagonal entries are elements of the matrix.
            let steiner = [b * b + c * c, -a * b, -a * c, a * a + c * c, -b * c, a * a + b * b];
            (
                m,
                [m * a, m * b, m * c],
                std::array::from_fn(|i| get(&inertia[i]) + m * steiner[i]),
            )
        }
    }
}

/// The value of an expression at the parameters `x` and the constants of the file.
fn value(mechanism: &Mechanism, exact: &ExactExpression, x: &[f64]) -> f64 {
    // Other symbols, such as coordinates, do not occur in inertias.
    exact.evaluate(&|symbol| match symbol {
        ModelSymbol::Parameter(p) => x[p.0],
        ModelSymbol::Constant(c) => mechanism.constants[c.0].value,
        _ => 0.0,
    })
}

/// Whether an expression contains a parameter.
fn has_parameter(exact: &ExactExpression) -> bool {
    exact.mentions(&|symbol| matches!(symbol, ModelSymbol::Parameter(_)))
}

impl Model {
    /// Indices of the effect parameters that must be positive, ascending.
    fn positive_effects(&self) -> Vec<usize> {
        let effects = &self.derivation.mechanism.effects;
        let mut found: Vec<usize> = effects
            .iter()
            .flat_map(|effect| effect.terms.iter().map(|term| term.parameter.0))
            .filter(|p| self.sign_of_parameter(*p) == Sign::Positive)
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}
