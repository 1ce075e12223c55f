//! Newton's method on loops that have no closed form: passive coordinates of a pose, followed from a known one.
//!
//! Every step must shrink to a quarter of the one before; where that fails, the motion from the known pose is divided
//! into shorter strides, which keeps to the assembly mode (Deuflhard 2004, "Newton Methods for Nonlinear Problems",
//! sections 2.1 and 5.1). Residuals and steps are compared with scales that the loops provide, so that a mechanism in
//! millimetres is treated like one in kilometres. Emitted models and the block evaluator share this code.
//!
//! Decision: there is one Newton's method. The block evaluator of `modelmill-codegen` depends on this crate for it,
//! so that evaluator and emitted code have one rule for when a loop is closed.

use crate::{PoseError, Real, solve};

/// Residuals count as zero below this many units of rounding of their scale.
const ROUNDING: f64 = 64.0;
/// Longest stride of an active coordinate and longest step of a passive one, as a share of its scale (1 for an angle).
const LONGEST: f64 = 0.5;
/// After a first contraction better than this, strides grow.
const FAST_CONTRACTION: f64 = 0.0625;
/// Strides for a motion: some ten thousand turns of a crank.
const STRIDES: u32 = 200_000;

/// The loops of a mechanism, which have as many equations as there are passive coordinates.
pub trait Loops {
    /// The numbers.
    type Number: Real;
    /// One number per active coordinate: an array or a vector.
    type Active: Clone + AsRef<[Self::Number]> + AsMut<[Self::Number]>;
    /// One number per passive coordinate.
    type Passive: Clone + AsRef<[Self::Number]> + AsMut<[Self::Number]>;
    /// As many of these as there are passive coordinates.
    type Matrix: AsRef<[Self::Passive]> + AsMut<[Self::Passive]>;

    /// Residuals of the loops, and their derivatives by the passive coordinates: one row per residual.
    fn linearise(&self, active: &Self::Active, passive: &Self::Passive) -> (Self::Passive, Self::Matrix);

    /// Scales at a pose with which residuals and coordinates are compared.
    fn scales(&self, active: &Self::Active, passive: &Self::Passive) -> Scales<Self::Active, Self::Passive>;
}

/// Magnitudes at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales<A, P> {
    /// Per residual: sum of the magnitudes of its terms.
    pub residual: P,
    /// Per passive coordinate: 1 for a revolute joint (rad), a length of its loops (m) for a prismatic one.
    pub passive: P,
    /// The same for the active coordinates; 0 if no loop depends on the coordinate.
    pub active: A,
}

/// Passive coordinates that close the loops, from a guess that need not be near: for the first pose of a mechanism.
///
/// # Errors
/// [`PoseError::OutOfReach`] if the loops do not close to rounding, [`PoseError::Singular`] if the passive coordinates
/// are not determined.
pub fn solve_passive<L: Loops>(loops: &L, active: &L::Active, guess: &L::Passive) -> Result<L::Passive, PoseError> {
    newton(loops, active, guess, &FIRST_POSE).map(|found| found.passive)
}

/// Passive coordinates that close the loops, from those of a pose near by.
///
/// # Errors
/// As [`solve_passive`]; also [`PoseError::OutOfReach`] if the guess is so far away that another assembly might be
/// found.
pub fn correct<L: Loops>(loops: &L, active: &L::Active, guess: &L::Passive) -> Result<L::Passive, PoseError> {
    newton(loops, active, guess, &NEARBY_POSE).map(|found| found.passive)
}

/// Passive coordinates that close the loops at `to`, followed in a straight line from those at `from`.
///
/// # Errors
/// As [`solve_passive`], if the loops cannot close at some pose on the way.
pub fn follow<L: Loops>(
    loops: &L,
    from: &L::Active,
    passive: &L::Passive,
    to: &L::Active,
) -> Result<L::Passive, PoseError> {
    let number = L::Number::from_f64;
    let (zero, one) = (number(0.0), number(1.0));
    let distance = distance::<L>(from, to, &loops.scales(from, passive).active);
    if distance > number(LONGEST * f64::from(STRIDES)) {
        return Err(PoseError::OutOfReach);
    }
    let longest = if distance > number(LONGEST) {
        number(LONGEST) / distance
    } else {
        one
    };
    let (mut done, mut stride, mut passive) = (zero, longest, passive.clone());
    // The last two poses reached extrapolate the guess for the next one.
    let mut before = None;
    for _ in 0..STRIDES {
        // A remainder of about the length of rounding is added to the last stride.
        let remains = one - done;
        let last = stride * number(1.001) >= remains;
        let (next, way) = if last { (one, remains) } else { (done + stride, stride) };
        let mut active = to.clone();
        if !last {
            // `active` starts as `to` and becomes the point on the way there.
            for (x, a) in active.as_mut().iter_mut().zip(from.as_ref()) {
                *x = *a + next * (*x - *a);
            }
        }
        let mut guess = passive.clone();
        if let Some((at, earlier)) = &before {
            extrapolate::<L>(&mut guess, earlier, way / (done - *at));
        }
        let rule = if last { NEARBY_POSE } else { INTERMEDIATE_POSE };
        match newton(loops, &active, &guess, &rule) {
            Ok(found) if last => return Ok(found.passive),
            Ok(found) => {
                before = Some((done, passive));
                (passive, done) = (found.passive, next);
                let twice = stride + stride;
                if found.contraction < number(FAST_CONTRACTION) {
                    stride = if twice < longest { twice } else { longest };
                }
            }
            // Newton's method failed or contracted too slowly: half the stride, from the pose reached before.
            Err(error) => {
                stride = way * number(0.5);
                if stride <= L::Number::epsilon().sqrt() * longest {
                    return Err(error);
                }
            }
        }
    }
    Err(PoseError::OutOfReach)
}

/// Extrapolates the line from `earlier` to `passive` by `share` of its length.
fn extrapolate<L: Loops>(passive: &mut L::Passive, earlier: &L::Passive, share: L::Number) {
    for (x, earlier) in passive.as_mut().iter_mut().zip(earlier.as_ref()) {
        *x = *x + share * (*x - *earlier);
    }
}

/// Largest displacement of an active coordinate, relative to its scale.
fn distance<L: Loops>(from: &L::Active, to: &L::Active, scales: &L::Active) -> L::Number {
    let zero = L::Number::from_f64(0.0);
    let ways = from.as_ref().iter().zip(to.as_ref());
    let mut distance = zero;
    for ((a, b), scale) in ways.zip(scales.as_ref()) {
        let way = (*b - *a).abs();
        if way > distance * *scale && *scale > zero {
            distance = way / *scale;
        }
    }
    distance
}

/// Parameters of Newton's method.
struct NewtonRule {
    /// Maximum number of steps.
    steps: u32,
    /// Ratio to the previous step that each step must stay below; without it, steps are only limited to the longest.
    contraction: Option<f64>,
    /// Step size, relative to the scales, below which the iteration ends even if the residuals are not zero.
    enough: f64,
}

/// For the first pose, from a guess that may be far away.
const FIRST_POSE: NewtonRule = NewtonRule {
    steps: 50,
    contraction: None,
    enough: 0.0,
};
/// From a pose near by; if each step contracts as required, half of these steps suffice.
const NEARBY_POSE: NewtonRule = NewtonRule {
    steps: 12,
    contraction: Some(0.25),
    enough: 0.0,
};
/// Between two poses, where only the assembly mode matters.
const INTERMEDIATE_POSE: NewtonRule = NewtonRule {
    enough: 1e-3,
    ..NEARBY_POSE
};

/// Result of Newton's method.
struct NewtonResult<P, T> {
    /// Passive coordinates that close the loops, rad or m.
    passive: P,
    /// The second step as a share of the first; 0 if there was none.
    contraction: T,
}

/// Newton's method from a guess. It ends when the loops are closed to rounding and the step is small.
///
/// # Errors
/// [`PoseError::Singular`] if the passive coordinates are not determined, else [`PoseError::OutOfReach`].
fn newton<L: Loops>(
    loops: &L,
    active: &L::Active,
    guess: &L::Passive,
    rule: &NewtonRule,
) -> Result<NewtonResult<L::Passive, L::Number>, PoseError> {
    let number = L::Number::from_f64;
    let (zero, one) = (number(0.0), number(1.0));
    let tiny = L::Number::epsilon().sqrt();
    let (mut passive, mut longest) = (guess.clone(), number(LONGEST));
    let (mut first, mut contraction) = (zero, zero);
    for k in 0..rule.steps {
        let scales = loops.scales(active, &passive);
        let (mut step, mut jacobian) = loops.linearise(active, &passive);
        let closed = is_closed::<L>(active, &passive, &step, &scales);
        solve(jacobian.as_mut(), step.as_mut())?;
        let mut size = zero;
        // The size of the step is that of its largest entry relative to the scale of the coordinate.
        for (dx, scale) in step.as_ref().iter().zip(scales.passive.as_ref()) {
            if !dx.is_finite() {
                return Err(PoseError::Singular);
            }
            if dx.abs() > size * *scale {
                size = dx.abs() / *scale;
            }
        }
        match k {
            0 => first = size,
            1 => contraction = size / first,
            _ => {}
        }
        let cut = if rule.contraction.is_none() && size > longest {
            longest / size
        } else {
            one
        };
        if cut * size > longest {
            // The loops are closed, but the steps do not shrink: the passive coordinates are not determined.
            return Err(if closed {
                PoseError::Singular
            } else {
                PoseError::OutOfReach
            });
        }
        for (x, dx) in passive.as_mut().iter_mut().zip(step.as_ref()) {
            *x = *x - cut * *dx;
        }
        if closed && size <= tiny || size < number(rule.enough) {
            return Ok(NewtonResult { passive, contraction });
        }
        if let Some(contraction) = rule.contraction {
            longest = size * number(contraction);
        }
    }
    Err(PoseError::OutOfReach)
}

/// Whether all residuals are zero to rounding.
fn is_closed<L: Loops>(
    active: &L::Active,
    passive: &L::Passive,
    residuals: &L::Passive,
    scales: &Scales<L::Active, L::Passive>,
) -> bool {
    // Rounding errors grow with the magnitude of the coordinates, as for angles of many turns.
    let mut turns = L::Number::from_f64(1.0);
    for (xs, scales) in [
        (active.as_ref(), scales.active.as_ref()),
        (passive.as_ref(), scales.passive.as_ref()),
    ] {
        for (x, scale) in xs.iter().zip(scales) {
            if x.abs() > turns * *scale && *scale > L::Number::from_f64(0.0) {
                turns = x.abs() / *scale;
            }
        }
    }
    let rounding = L::Number::epsilon() * L::Number::from_f64(ROUNDING) * turns;
    let mut residuals = residuals.as_ref().iter().zip(scales.residual.as_ref());
    residuals.all(|(residual, scale)| residual.abs() <= rounding * *scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crank and a slider: the passive coordinates are the rod's angle and the slider's position.
    struct Slider {
        crank: f64,
        rod: f64,
    }

    impl Loops for Slider {
        type Number = f64;
        type Active = [f64; 1];
        type Passive = [f64; 2];
        type Matrix = [[f64; 2]; 2];

        fn linearise(&self, [q]: &[f64; 1], [phi, x]: &[f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
            let ((s, c), (sp, cp)) = (q.sin_cos(), phi.sin_cos());
            let residual = [self.crank * c + self.rod * cp - x, self.crank * s + self.rod * sp];
            (residual, [[-self.rod * sp, -1.0], [self.rod * cp, 0.0]])
        }

        fn scales(&self, _: &[f64; 1], [_, x]: &[f64; 2]) -> Scales<[f64; 1], [f64; 2]> {
            let lengths = self.crank + self.rod;
            Scales {
                residual: [lengths + x.abs(), lengths],
                passive: [1.0, lengths + x.abs()],
                active: [1.0],
            }
        }
    }

    fn first(slider: &Slider) -> [f64; 2] {
        let guess = [0.2, slider.rod];
        solve_passive(slider, &[0.0], &guess).unwrap()
    }

    #[test]
    fn lengths_in_any_unit_make_the_same_angles() {
        let angle = |unit: f64| {
            let slider = Slider {
                crank: 0.4 * unit,
                rod: 0.9 * unit,
            };
            let [phi, x] = follow(&slider, &[0.0], &first(&slider), &[40.0]).unwrap();
            let expected = (-0.4 / 0.9 * 40.0_f64.sin()).asin();
            assert!((phi - expected).abs() < 1e-14);
            let expected = unit * (0.4 * 40.0_f64.cos() + 0.9 * phi.cos());
            assert!((x - expected).abs() < 1e-14 * unit);
            phi.to_bits()
        };
        // Powers of two round alike, so that nothing but the unit differs.
        let one = angle(1.0);
        assert_eq!([angle(1.0 / 1024.0), angle(1024.0)], [one, one]);
    }

    #[test]
    fn a_pose_out_of_reach_is_an_error() {
        let slider = Slider { crank: 0.9, rod: 0.4 };
        let farthest = (0.4_f64 / 0.9).asin();
        let start = first(&slider);
        let to = |q: f64| follow(&slider, &[0.0], &start, &[q]);
        assert!(to(farthest - 1e-6).is_ok());
        for q in [farthest + 1e-9, farthest + 1e-3, 1.5, 3.0] {
            assert!(to(q).is_err(), "{q}");
        }
        assert!(solve_passive(&slider, &[1.5], &start).is_err());
        assert!(correct(&slider, &[1.5], &start).is_err());
    }

    #[test]
    fn a_guess_leads_to_its_own_assembly_or_nowhere() {
        let slider = Slider { crank: 0.4, rod: 0.9 };
        let (mut found, mut refused) = (0, 0);
        for q in (0..60).map(|k| 0.1 * f64::from(k)) {
            // The rod stands upright at pi/2, where the assemblies meet.
            for guess in (-15..=15).map(|k| 0.1 * f64::from(k)) {
                let x = 0.4 * q.cos() + 0.9 * guess.cos();
                match correct(&slider, &[q], &[guess, x]) {
                    Ok([phi, _]) => {
                        assert!(phi.cos() > 0.0, "from {guess} to {phi} at {q}");
                        found += 1;
                    }
                    Err(_) => refused += 1,
                }
            }
        }
        assert!(found > 500 && refused > 100, "{found} and {refused}");
        assert!(correct(&slider, &[1.0], &[f64::NAN, 1.0]).is_err());
        assert!(correct(&slider, &[f64::NAN], &first(&slider)).is_err());
    }
}
