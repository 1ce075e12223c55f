//! From printed values of an inertia to the tensor about the centre of mass: the sign of the products, the point of
//! reference, and whether a real body can have it.
//!
//! Programs print products of inertia either as integrals of `x y dm` or as entries of the tensor, which are the
//! negatives. What else a report states about the same body decides which: the inertia about a second point (Steiner),
//! principal axes, principal moments, and that no body has a negative moment.

use nalgebra::{Matrix3, Vector3};

use super::thresholds::{EXPLAINED_PRODUCT, INERTIA_AGREEMENT, SIGN_CONTRAST, TRIANGLE_SLACK, ZERO_PRODUCT};

/// What products of inertia are printed as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProductSign {
    /// Integrals of `x y dm`: the negatives of the tensor's entries.
    Positive,
    /// Entries of the tensor, integrals of `-x y dm`.
    Negative,
}

/// The point about which an inertia is stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InertiaPoint {
    /// The centre of mass.
    Centre,
    /// The origin of the coordinate system.
    Origin,
}

/// An inertia as it is printed, in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PrintedInertia {
    /// The point of reference.
    pub(super) about: InertiaPoint,
    /// xx, yy, zz, kg m^2.
    pub(super) moments: Vector3<f64>,
    /// xy, xz, yz as printed, kg m^2.
    pub(super) products: Vector3<f64>,
}

impl PrintedInertia {
    /// The axis of the only moment that is stated, as for a planar model; none if there are several or products.
    fn lone_moment(&self) -> Option<usize> {
        let stated: Vec<usize> = (0..3).filter(|k| self.moments[*k] != 0.0).collect();
        match stated[..] {
            [k] if self.products == Vector3::zeros() => Some(k),
            _ => None,
        }
    }
}

/// Principal moments as they are printed, kg m^2, with the unit vectors of their axes if the report has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PrintedPrincipalMoments {
    /// The moments.
    pub(super) moments: Vector3<f64>,
    /// One axis per row.
    pub(super) axes: Option<Matrix3<f64>>,
}

/// All that a file states about one body, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PrintedBody {
    /// Mass, kg.
    pub(super) mass: f64,
    /// Centre of mass, m.
    pub(super) centre: Vector3<f64>,
    /// Inertias about one or two points.
    pub(super) inertias: Vec<PrintedInertia>,
    /// Principal moments about the centre of mass.
    pub(super) principal: Option<PrintedPrincipalMoments>,
    /// The sign convention that the file or the user states.
    pub(super) stated: Option<ProductSign>,
}

/// The tensor of a body about its centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DeterminedInertia {
    /// The tensor, kg m^2.
    pub(super) tensor: Matrix3<f64>,
    /// The convention of the products, and what determines it.
    pub(super) sign: SignEvidence,
}

/// Where the convention of the products comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SignEvidence {
    /// All products are zero.
    NoEffect,
    /// Other values of the same file exclude the other convention.
    Determined(ProductSign),
    /// The file or the user states it.
    Stated(ProductSign),
}

/// Why the inertia of a body cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum InertiaFault {
    /// No inertia is stated.
    Missing,
    /// Nothing determines the sign of the products.
    UnknownSign,
    /// The stated convention contradicts other values of the file.
    ContradictedSign(ProductSign),
    /// The inertias about both points contradict each other.
    ContradictedPoints,
    /// No body has these principal moments, kg m^2.
    Impossible(Vector3<f64>),
}

/// The tensor about the centre of mass of a printed body.
pub(super) fn determine_inertia(body: &PrintedBody) -> Result<DeterminedInertia, InertiaFault> {
    let centre = body.inertias.iter().find(|i| i.about == InertiaPoint::Centre);
    let Some(first) = centre.or(body.inertias.first()) else {
        return Err(InertiaFault::Missing);
    };
    // The moments contain no products, so that they can be compared without a sign.
    let scale = body.inertias.iter().map(|i| i.moments.amax()).fold(0.0, f64::max);
    let moments = |printed| tensor_about_centre(body, printed, ProductSign::Negative).diagonal();
    if body
        .inertias
        .iter()
        .any(|other| (moments(other) - moments(first)).amax() > INERTIA_AGREEMENT * scale)
    {
        return Err(InertiaFault::ContradictedPoints);
    }
    let has_products = body
        .inertias
        .iter()
        .any(|i| i.products.amax() > ZERO_PRODUCT * i.moments.amax());
    let sign = if has_products {
        let evidence = sign_of_points(body)
            .or_else(|| sign_of_principal_moments(body, first))
            .or_else(|| sign_of_possible_bodies(body, first));
        match (evidence, body.stated) {
            (Some(found), Some(stated)) if found != stated => return Err(InertiaFault::ContradictedSign(stated)),
            (Some(found), _) => SignEvidence::Determined(found),
            (None, Some(stated)) => SignEvidence::Stated(stated),
            (None, None) => return Err(InertiaFault::UnknownSign),
        }
    } else {
        SignEvidence::NoEffect
    };
    let convention = match sign {
        SignEvidence::NoEffect => ProductSign::Negative,
        SignEvidence::Determined(sign) | SignEvidence::Stated(sign) => sign,
    };
    let tensor = tensor_about_centre(body, first, convention);
    // All statements must agree in the products too.
    let is_contradicted = body
        .inertias
        .iter()
        .any(|other| (tensor_about_centre(body, other, convention) - tensor).amax() > INERTIA_AGREEMENT * scale);
    if is_contradicted {
        return Err(InertiaFault::ContradictedPoints);
    }
    if !is_possible(&tensor) {
        return Err(InertiaFault::Impossible(tensor.symmetric_eigenvalues()));
    }
    Ok(DeterminedInertia { tensor, sign })
}

/// Whether a real body can have this tensor: no moment is below zero, and none exceeds the sum of the two others. A body
/// of which only one moment is stated, as for a planar model, is accepted.
fn is_possible(tensor: &Matrix3<f64>) -> bool {
    let mut moments: Vec<f64> = tensor.symmetric_eigenvalues().iter().copied().collect();
    moments.sort_by(f64::total_cmp);
    let [least, middle, most] = [moments[0], moments[1], moments[2]];
    let slack = TRIANGLE_SLACK * most.abs().max(least.abs());
    let is_planar = tensor.iter().filter(|x| **x != 0.0).count() <= 1;
    least >= -slack && (is_planar || most <= least + middle + slack)
}

/// The tensor about the centre of mass from one printed inertia.
fn tensor_about_centre(body: &PrintedBody, printed: &PrintedInertia, sign: ProductSign) -> Matrix3<f64> {
    let factor = match sign {
        ProductSign::Positive => -1.0,
        ProductSign::Negative => 1.0,
    };
    let [xy, xz, yz] = [0, 1, 2].map(|k| factor * printed.products[k]);
    let m = printed.moments;
    if let Some(k) = printed.lone_moment() {
        let shift = if printed.about == InertiaPoint::Origin {
            steiner(body)[(k, k)]
        } else {
            0.0
        };
        let mut tensor = Matrix3::zeros();
        tensor[(k, k)] = m[k] - shift;
        return tensor;
    }
    let tensor = Matrix3::new(m.x, xy, xz, xy, m.y, yz, xz, yz, m.z);
    match printed.about {
        InertiaPoint::Centre => tensor,
        InertiaPoint::Origin => tensor - steiner(body),
    }
}

/// The inertia about the origin of the whole mass at its centre, kg m^2.
fn steiner(body: &PrintedBody) -> Matrix3<f64> {
    let c = body.centre;
    body.mass * (Matrix3::identity() * c.norm_squared() - c * c.transpose())
}

/// The convention with which an error is small, if the error with the other one is much larger.
fn choose_sign(scale: f64, error: impl Fn(ProductSign) -> f64) -> Option<ProductSign> {
    let [positive, negative] = [ProductSign::Positive, ProductSign::Negative].map(error);
    let is_clear = |good: f64, bad: f64| {
        good <= EXPLAINED_PRODUCT * scale
            && bad > SIGN_CONTRAST * good.max(ZERO_PRODUCT * scale)
            && bad > 2.0 * EXPLAINED_PRODUCT * scale
    };
    if is_clear(positive, negative) {
        Some(ProductSign::Positive)
    } else if is_clear(negative, positive) {
        Some(ProductSign::Negative)
    } else {
        None
    }
}

/// The largest product of a body, kg m^2.
fn largest_product(body: &PrintedBody) -> f64 {
    body.inertias.iter().map(|i| i.products.amax()).fold(0.0, f64::max)
}

/// Off-diagonal entries of a matrix.
fn off_diagonal(m: &Matrix3<f64>) -> f64 {
    m[(0, 1)].abs().max(m[(0, 2)].abs()).max(m[(1, 2)].abs())
}

/// The convention with which the inertias about centre and origin agree.
fn sign_of_points(body: &PrintedBody) -> Option<ProductSign> {
    let find = |about| body.inertias.iter().find(|i| i.about == about);
    let (centre, origin) = (find(InertiaPoint::Centre)?, find(InertiaPoint::Origin)?);
    choose_sign(largest_product(body), |sign| {
        off_diagonal(&(tensor_about_centre(body, centre, sign) - tensor_about_centre(body, origin, sign)))
    })
}

/// The convention with which an inertia has the stated principal moments and axes.
fn sign_of_principal_moments(body: &PrintedBody, printed: &PrintedInertia) -> Option<ProductSign> {
    let principal = body.principal?;
    let scale = largest_product(body);
    if let Some(axes) = principal.axes {
        let told = axes.transpose() * Matrix3::from_diagonal(&principal.moments) * axes;
        return choose_sign(scale, |sign| {
            off_diagonal(&(tensor_about_centre(body, printed, sign) - told))
        });
    }
    let sorted = |v: Vector3<f64>| {
        let mut all = [v.x, v.y, v.z];
        all.sort_by(f64::total_cmp);
        Vector3::from(all)
    };
    let told = sorted(principal.moments);
    choose_sign(scale, |sign| {
        let moments = tensor_about_centre(body, printed, sign).symmetric_eigenvalues();
        (sorted(moments) - told).amax()
    })
}

/// The convention with which a real body is possible, if it is the only one.
fn sign_of_possible_bodies(body: &PrintedBody, printed: &PrintedInertia) -> Option<ProductSign> {
    let is_possible_with = |sign| is_possible(&tensor_about_centre(body, printed, sign));
    match (
        is_possible_with(ProductSign::Positive),
        is_possible_with(ProductSign::Negative),
    ) {
        (true, false) => Some(ProductSign::Positive),
        (false, true) => Some(ProductSign::Negative),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of three point masses off all planes, seen with one convention.
    fn planted(sign: ProductSign, about: &[InertiaPoint]) -> (PrintedBody, Matrix3<f64>) {
        let masses = [
            (1.0, [0.3, 0.1, -0.2]),
            (2.0, [-0.1, 0.4, 0.15]),
            (1.5, [0.2, -0.2, 0.5]),
            (0.7, [0.6, 0.5, 0.1]),
        ];
        let mass: f64 = masses.iter().map(|(m, _)| m).sum();
        let moment: Vector3<f64> = masses.iter().map(|(m, p)| *m * Vector3::from(*p)).sum();
        let centre = moment / mass;
        let tensor_at = |origin: Vector3<f64>| -> Matrix3<f64> {
            masses
                .iter()
                .map(|(m, p)| {
                    let d = Vector3::from(*p) - origin;
                    *m * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
                })
                .sum()
        };
        let factor = if sign == ProductSign::Positive { -1.0 } else { 1.0 };
        let print = |about: InertiaPoint| {
            let t = tensor_at(if about == InertiaPoint::Centre {
                centre
            } else {
                Vector3::zeros()
            });
            PrintedInertia {
                about,
                moments: t.diagonal(),
                products: Vector3::new(t[(0, 1)], t[(0, 2)], t[(1, 2)]) * factor,
            }
        };
        let body = PrintedBody {
            mass,
            centre,
            inertias: about.iter().map(|a| print(*a)).collect(),
            principal: None,
            stated: None,
        };
        (body, tensor_at(centre))
    }

    #[test]
    fn both_points_determine_the_sign() {
        for sign in [ProductSign::Positive, ProductSign::Negative] {
            let (body, truth) = planted(sign, &[InertiaPoint::Centre, InertiaPoint::Origin]);
            let found = determine_inertia(&body).expect("an inertia");
            assert_eq!(found.sign, SignEvidence::Determined(sign));
            assert!((found.tensor - truth).amax() < 1e-12);
            // A statement to the contrary is refused.
            let other = if sign == ProductSign::Positive {
                ProductSign::Negative
            } else {
                ProductSign::Positive
            };
            let wrong = PrintedBody {
                stated: Some(other),
                ..body
            };
            assert_eq!(determine_inertia(&wrong), Err(InertiaFault::ContradictedSign(other)));
        }
    }

    #[test]
    fn principal_axes_or_moments_determine_the_sign() {
        for sign in [ProductSign::Positive, ProductSign::Negative] {
            for about in [InertiaPoint::Centre, InertiaPoint::Origin] {
                let (mut body, truth) = planted(sign, &[about]);
                let eigen = truth.symmetric_eigen();
                for axes in [Some(eigen.eigenvectors.transpose()), None] {
                    body.principal = Some(PrintedPrincipalMoments {
                        moments: eigen.eigenvalues,
                        axes,
                    });
                    let found = determine_inertia(&body).expect("an inertia");
                    assert_eq!(
                        found.sign,
                        SignEvidence::Determined(sign),
                        "{about:?} {}",
                        axes.is_some()
                    );
                    assert!((found.tensor - truth).amax() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn without_evidence_a_statement_is_needed() {
        let (body, truth) = planted(ProductSign::Positive, &[InertiaPoint::Centre]);
        assert_eq!(determine_inertia(&body), Err(InertiaFault::UnknownSign));
        let stated = PrintedBody {
            stated: Some(ProductSign::Positive),
            ..body
        };
        assert!((determine_inertia(&stated).expect("an inertia").tensor - truth).amax() < 1e-12);
    }

    #[test]
    fn a_lone_moment_is_moved_to_the_centre() {
        // A body of a planar model: its moment about the origin is that about the centre and Steiner's term.
        let (mass, centre, moment) = (2.5, Vector3::new(0.4, -0.3, 0.7), 0.06);
        for k in 0..3 {
            let distance = centre.norm_squared() - centre[k] * centre[k];
            let mut moments = Vector3::zeros();
            moments[k] = moment + mass * distance;
            let body = PrintedBody {
                mass,
                centre,
                inertias: vec![PrintedInertia {
                    about: InertiaPoint::Origin,
                    moments,
                    products: Vector3::zeros(),
                }],
                principal: None,
                stated: None,
            };
            let mut truth = Matrix3::zeros();
            truth[(k, k)] = moment;
            let found = determine_inertia(&body).expect("an inertia").tensor;
            assert!((found - truth).amax() < 1e-12, "{found}");
        }
    }

    #[test]
    fn impossible_and_contradictory_values_are_refused() {
        let (mut body, _) = planted(ProductSign::Negative, &[InertiaPoint::Centre, InertiaPoint::Origin]);
        // The mass in grams: Steiner's term is a thousand times too large.
        body.mass *= 1e3;
        assert!(
            matches!(determine_inertia(&body), Err(InertiaFault::ContradictedPoints)),
            "{:?}",
            determine_inertia(&body)
        );
        let (mut body, _) = planted(ProductSign::Negative, &[InertiaPoint::Centre]);
        body.inertias[0].products *= 0.0;
        body.inertias[0].moments = Vector3::new(1.0, 1.0, 2.5);
        assert!(matches!(determine_inertia(&body), Err(InertiaFault::Impossible(_))));
    }
}
