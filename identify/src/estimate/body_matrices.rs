//! Matrices that are positive definite for possible bodies: pseudo-inertias, and their distance from the nominal ones.

use nalgebra::DMatrix;

use crate::estimate::error::PhysicalError;

/// A matrix as a function of the physical parameters.
pub type MatrixMap<'a> = Box<dyn Fn(&[f64]) -> DMatrix<f64> + 'a>;

/// A matrix that is positive definite if a body is possible, as a function of the physical parameters.
pub struct BodyMatrix<'a> {
    /// Name of the body in messages.
    pub name: String,
    /// Symmetric matrix of fixed size; 1 x 1 for a mass or an inertia alone.
    pub matrix: MatrixMap<'a>,
    /// How often the matrix contains each of its numbers: 2 for [`planar_pseudo_inertia`], else 1.
    pub copies: f64,
}

/// Pseudo-inertia of a body in space from mass (kg), first moment (kg m) and inertia about the origin (xx, xy, xz, yy,
/// yz, zz; kg m^2).
pub fn pseudo_inertia(mass: f64, moment: [f64; 3], inertia: [f64; 6]) -> DMatrix<f64> {
    let [xx, xy, xz, yy, yz, zz] = inertia;
    let half = 0.5 * (xx + yy + zz);
    let [x, y, z] = moment;
    DMatrix::from_row_slice(
        4,
        4,
        &[
            half - xx,
            -xy,
            -xz,
            x,
            -xy,
            half - yy,
            -yz,
            y,
            -xz,
            -yz,
            half - zz,
            z,
            x,
            y,
            z,
            mass,
        ],
    )
}

/// The same for a body that rotates about one axis only: positive definite exactly if the mass and the inertia about
/// the axis through the centre are positive. It contains every number twice.
pub fn planar_pseudo_inertia(mass: f64, moment: [f64; 2], inertia: f64) -> DMatrix<f64> {
    let [x, y] = moment;
    DMatrix::from_row_slice(
        4,
        4,
        &[
            inertia, 0.0, x, y, 0.0, inertia, -y, x, x, -y, mass, 0.0, y, x, 0.0, mass,
        ],
    )
}

/// Nominal matrix of a body, stored by its inverse root.
pub(crate) struct NominalBodyMatrix {
    /// `L^-1` of `P0 = L L'`.
    root_inverse: DMatrix<f64>,
    /// How often the matrix contains each of its numbers.
    pub(crate) copies: f64,
}

impl NominalBodyMatrix {
    /// Factors the matrix at the nominal values; fails if the body is impossible there.
    pub(crate) fn new(body: &BodyMatrix<'_>, nominal: &[f64]) -> Result<Self, PhysicalError> {
        let matrix = (body.matrix)(nominal);
        let n = matrix.nrows();
        let impossible = || PhysicalError::NominalImpossible {
            body: body.name.clone(),
            why: impossibility_reason(&matrix),
        };
        let cholesky = matrix.clone().cholesky().ok_or_else(impossible)?;
        let root_inverse = cholesky
            .l()
            .solve_lower_triangular(&DMatrix::identity(n, n))
            .filter(|inverse| inverse.iter().all(|x| x.is_finite()))
            .ok_or_else(impossible)?;
        let copies = body.copies;
        Ok(Self { root_inverse, copies })
    }

    /// `L^-1 P L'^-1`, the identity at the nominal values.
    pub(crate) fn relative(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let relative = &self.root_inverse * matrix * self.root_inverse.transpose();
        0.5 * (&relative + relative.transpose())
    }

    /// The smallest eigenvalue of a body's matrix relative to the nominal one.
    pub(crate) fn margin(&self, matrix: &DMatrix<f64>) -> f64 {
        self.relative(matrix).symmetric_eigenvalues().min()
    }
}

/// Why a matrix is not that of a possible body, as a clause for people.
fn impossibility_reason(matrix: &DMatrix<f64>) -> String {
    let n = matrix.nrows();
    if n == 1 {
        return format!("{} is not positive", matrix[(0, 0)]);
    }
    let mass = matrix[(n - 1, n - 1)];
    if mass.is_nan() || mass <= 0.0 {
        return format!("its mass {mass} kg is not positive");
    }
    "its inertia about the centre of mass is impossible (principal moments must be positive, and each at most the sum of \
     the other two)"
        .to_owned()
}
