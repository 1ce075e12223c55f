//! Values at the nominal pose, with the constants and parameters of the model file.

use modelmill_spec::Mechanism;

use super::{Atom, EvaluationTape, ExprId, FloatDomain, Graph};

/// `None` where the expression has no value there, such as a division by zero.
/// Value of an expression at the nominal pose, with the file's constants; rates are zero.
pub(crate) fn nominal_value(graph: &Graph, mechanism: &Mechanism, id: ExprId) -> Option<f64> {
    EvaluationTape::new(graph, &[id])
        .evaluate(&FloatDomain(|atom| nominal_of(mechanism, atom)))
        .map(|v| v[0])
}

/// Value of an atom at the nominal pose; rates, accelerations and all atoms that the file has no value of are zero.
pub(crate) fn nominal_of(mechanism: &Mechanism, atom: Atom) -> f64 {
    match atom {
        Atom::Constant(i) => mechanism.constants[i].value,
        Atom::Coordinate(i) => mechanism.coordinates[i].nominal,
        Atom::Parameter(i) => mechanism.parameters[i].nominal,
        Atom::Pi => std::f64::consts::PI,
        _ => 0.0,
    }
}
