//! Digits lost by the base: forces from p_min are compared with those from p_g, both in floating point and with the
//! model file's values. They are equal in exact arithmetic.
//!
//! Retained columns are independent for general constants. At the file's values they may be almost dependent. Then the
//! factors of eq. (6) are very large, and digits of the forces are lost when large terms cancel. If the terms are `g`
//! times larger than their sum, the relative error of the forces is about `g` roundings of 1.1e-16 (N. J. Higham,
//! "Accuracy and Stability of Numerical Algorithms", 2nd ed. 2002, 4.2).

use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::{ModelEvaluator, MotionStates};
use crate::loops::numeric_poses::uniform_symmetric;
use crate::{Derivation, DeriveError};
use modelmill_algebra::field::RandomStream;

/// Largest accepted error of a drive's force, relative to the sum of the magnitudes of its terms. Elsewhere, errors of
/// a millionth count as rounding of a recording's numbers; here up to ten of sixteen digits may be lost.
const MOST_LOST: f64 = 1e-6;

/// Number of states at which forces are compared.
const STATES: usize = 8;
/// Number of random states that are tried to find them.
const TRIES: usize = 100;

/// Distance of the states from the nominal pose, in rad and relative to the nominal length.
const REACH: f64 = 0.5;
/// Factor by which the distance shrinks after a state without a solution.
const SHRINK_FACTOR: f64 = 0.8;

/// Products whose terms are larger than this part of the largest one are named in the message.
const NEARLY_LARGEST: f64 = 1e-3;

/// Returns an error if forces from p_min differ from those from p_g. If no state has a solution, the base is accepted.
pub(crate) fn check_lost_digits(derivation: &Derivation) -> Result<(), DeriveError> {
    match largest_digit_loss(derivation)? {
        // NaN means that all digits are lost.
        Some(lost) if lost.error.is_nan() || lost.error > MOST_LOST => Err(lost_digits_error(derivation, &lost)),
        _ => Ok(()),
    }
}

/// The drive with the largest error.
struct DigitLoss {
    /// Error of its force, relative to the sum of the magnitudes of its terms.
    error: f64,
    /// Its rows of H, one per state.
    h: DMatrix<f64>,
    /// Values of the products.
    values: Vec<f64>,
}

/// Compares forces from p_min with those from p_g; `None` if nothing was regrouped or no state has a solution.
fn largest_digit_loss(derivation: &Derivation) -> Result<Option<DigitLoss>, DeriveError> {
    if derivation.reduction.dependencies.is_empty() {
        return Ok(None);
    }
    // Products without a nominal value would hide the loss of their column.
    let mechanism = with_all_parameters(&derivation.mechanism);
    let parameters: Vec<f64> = mechanism.parameters.iter().map(|p| p.nominal).collect();
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let products = &derivation.reduction.products;
    let values: Vec<f64> = products.iter().map(|p| p.value(&parameters)).collect();
    let evaluator = ModelEvaluator::new(derivation).with_parameters(&mechanism);
    // Evaluator and emitted code sum eq. (7) in different orders, so both are compared.
    let both = [
        derivation.base_values(&parameters, &constants),
        evaluator.base_parameters(),
    ];
    let Some(sampled) = ForceSamples::new(&mechanism, &evaluator, &both)? else {
        return Ok(None);
    };
    let n_drives = mechanism.drives.len();
    // The largest error of all drives decides.
    let errors = (0..n_drives).map(|d| (d, sampled.relative_force_error(d, n_drives, &values)));
    let worst = errors.max_by(|a, b| a.1.total_cmp(&b.1));
    Ok(worst.map(|(drive, error)| DigitLoss {
        error,
        h: DMatrix::from_fn(sampled.n_states(), products.len(), |s, k| {
            sampled.full[(s * n_drives + drive, k)]
        }),
        values,
    }))
}

/// The mechanism with a value for every parameter: one without gets the largest value of the same unit, or 1.
fn with_all_parameters(mechanism: &Mechanism) -> Mechanism {
    let mut all = mechanism.clone();
    for parameter in all.parameters.iter_mut().filter(|p| p.nominal == 0.0) {
        let alike = mechanism.parameters.iter().filter(|p| p.unit == parameter.unit);
        let largest = alike.map(|p| p.nominal.abs()).fold(0.0, f64::max);
        parameter.nominal = if largest > 0.0 { largest } else { 1.0 };
    }
    all
}

/// H and forces at some states near the nominal pose.
struct ForceSamples {
    /// H, with one row per state and drive, states outermost.
    full: DMatrix<f64>,
    /// Forces from p_min, `[order of summation][drive][state]`.
    forces: [Vec<Vec<f64>>; 2],
}

impl ForceSamples {
    /// Samples up to `STATES` states. `None` if none has a solution; an error if forces are not finite at any of them.
    fn new(
        mechanism: &Mechanism,
        evaluator: &ModelEvaluator<'_>,
        base: &[Vec<f64>; 2],
    ) -> Result<Option<Self>, DeriveError> {
        let mut stream = RandomStream::new(0x6C6F_7374);
        let n_drives = mechanism.drives.len();
        let mut rows: Vec<f64> = Vec::new();
        let mut forces = [vec![Vec::new(); n_drives], vec![Vec::new(); n_drives]];
        // Numbers of usable states and of states with infinite forces, and the current distance.
        let (mut n_states, mut n_infinite, mut reach) = (0, 0, REACH);
        for _ in 0..TRIES {
            // Enough states have been found.
            if n_states == STATES {
                break;
            }
            // H and both forces at the same state.
            let state = NearbyState::random_near_nominal(mechanism, reach, &mut stream);
            let states = state.as_motion_states();
            let found = evaluator.full_regressor(&states).and_then(|h| {
                let [a, b] = base;
                let forces = [
                    evaluator.inverse_dynamics(&states, a)?,
                    evaluator.inverse_dynamics(&states, b)?,
                ];
                Ok((h, forces))
            });
            // Closer to the nominal pose, loops are more likely to close.
            let Ok((h, found)) = found else {
                reach *= SHRINK_FACTOR;
                continue;
            };
            if h.iter().any(|x| !x.is_finite()) {
                n_infinite += 1;
                continue;
            }
            rows.extend(h.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>()));
            for (all, found) in forces.iter_mut().zip(found) {
                for (all, found) in all.iter_mut().zip(found) {
                    all.extend(found);
                }
            }
            n_states += 1;
        }
        // Without a usable state the reason decides.
        if n_states == 0 {
            return if n_infinite == 0 {
                Ok(None)
            } else {
                Err(DeriveError::NotFinite {
                    what: "with the model file's values, the force of a drive".to_owned(),
                    todo: "check for constants that are too large to be squared, such as lengths above 1e150",
                })
            };
        }
        let n_rows = n_states * n_drives;
        let full = DMatrix::from_row_slice(n_rows, rows.len() / n_rows, &rows);
        Ok(Some(Self { full, forces }))
    }

    /// Number of states.
    fn n_states(&self) -> usize {
        self.forces[0].first().map_or(0, Vec::len)
    }

    /// Error of a drive's force over all states, relative to the sum of the magnitudes of its terms.
    fn relative_force_error(&self, drive: usize, n_drives: usize, values: &[f64]) -> f64 {
        let (mut errors, mut size) = ([0.0; 2], 0.0);
        for state in 0..self.n_states() {
            // The force from p_g, as a sum of terms.
            let row = self.full.row(state * n_drives + drive);
            let terms = row.iter().zip(values).map(|(h, p)| h * p);
            let (sum, sizes) = terms.fold((0.0, 0.0), |(sum, size), term| (sum + term, size + term.abs()));
            size += sizes * sizes;
            for (error, forces) in errors.iter_mut().zip(&self.forces) {
                *error += (forces[drive][state] - sum).powi(2);
            }
        }
        let [a, b] = errors;
        // `f64::max` would ignore NaN.
        let worst = if a > b || a.is_nan() { a } else { b };
        if worst == 0.0 {
            return 0.0;
        }
        (worst / size).sqrt()
    }
}

/// A random state near the nominal pose.
struct NearbyState {
    /// Active coordinates, rad or m.
    q: Vec<f64>,
    /// Rates, rad/s or m/s.
    qd: Vec<f64>,
    /// Accelerations, rad/s^2 or m/s^2.
    qdd: Vec<f64>,
    /// Forces of the drives, N or N m.
    load: Vec<f64>,
}

impl NearbyState {
    /// Draws a state; lengths scale with their nominal value.
    fn random_near_nominal(mechanism: &Mechanism, reach: f64, stream: &mut RandomStream) -> Self {
        // Passive coordinates follow from the loops.
        let active: Vec<_> = (mechanism.coordinates.iter()).filter(|c| !c.passive).collect();
        let q = active.iter().map(|c| {
            let one = if c.motion.is_angle() || c.nominal == 0.0 {
                1.0
            } else {
                c.nominal.abs()
            };
            c.nominal + reach * one * uniform_symmetric(stream)
        });
        let q = q.collect();
        let mut moving = |n: usize, most: f64| (0..n).map(|_| most * uniform_symmetric(stream)).collect();
        Self {
            q,
            qd: moving(active.len(), 2.0),
            qdd: moving(active.len(), 5.0),
            load: moving(mechanism.drives.len(), 100.0),
        }
    }

    /// The state as arrays of length one.
    fn as_motion_states(&self) -> MotionStates<'_> {
        MotionStates {
            q: self.q.chunks(1).collect(),
            qd: self.qd.chunks(1).collect(),
            qdd: self.qdd.chunks(1).collect(),
            load: self.load.chunks(1).collect(),
        }
    }
}

/// The error for a base that loses digits, with the products whose terms are largest.
fn lost_digits_error(derivation: &Derivation, found: &DigitLoss) -> DeriveError {
    let constants = derivation.mechanism.constants.iter();
    let constants: Vec<f64> = constants.map(|c| c.value).collect();
    let reduction = &derivation.reduction;
    let name = |product: usize| reduction.products[product].text(&derivation.mechanism);
    let norm = |product: usize| found.h.column(product).norm();
    // Magnitudes of the terms of each dependent product, by retained column.
    let lines: Vec<(usize, Vec<(usize, f64)>)> = reduction
        .dependencies
        .iter()
        .zip(reduction.factors(&constants))
        .map(|(line, factors)| {
            let terms = factors.iter().map(|(k, factor)| {
                let retained = reduction.retained[*k];
                let term = factor * found.values[line.product] * norm(retained);
                // NaN counts as infinite.
                (retained, if term.is_nan() { f64::INFINITY } else { term.abs() })
            });
            (line.product, terms.collect())
        })
        .collect();
    // Lines with the largest terms, and the retained products in them.
    let largest = |terms: &[(usize, f64)]| terms.iter().map(|t| t.1).fold(0.0, f64::max);
    let all = lines.iter().map(|(_, terms)| largest(terms)).fold(0.0, f64::max);
    let worst = lines.iter().filter(|(_, terms)| largest(terms) >= NEARLY_LARGEST * all);
    // Names for the message.
    let dependent: Vec<String> = worst.clone().map(|(product, _)| name(*product)).collect();
    let mut retained: Vec<usize> = worst
        .flat_map(|(_, terms)| terms)
        .filter(|(_, term)| *term >= NEARLY_LARGEST * all)
        .map(|(retained, _)| *retained)
        .collect();
    retained.sort_unstable();
    retained.dedup();
    DeriveError::DigitsLost {
        lost: format!("{:.0e}", found.error),
        retained: retained.into_iter().map(name).collect(),
        dependent,
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::StopRequest;
    use crate::expr::Rational;
    use crate::{RationalFunction, derive};

    fn model(name: &str) -> Mechanism {
        let folder = env!("CARGO_MANIFEST_DIR");
        let path = format!("{folder}/../model-spec/models/{name}.toml");
        let loaded = modelmill_spec::load_file(path.as_ref());
        loaded.unwrap_or_else(|failure| panic!("{failure}")).mechanism
    }

    fn read(text: &str) -> Mechanism {
        let files = modelmill_boundary::files::MemoryFiles::default();
        let loaded = modelmill_spec::load("made.toml", text, &files);
        loaded.unwrap_or_else(|failure| panic!("{failure}")).mechanism
    }

    /// A line of the model file that retains the masses instead of the body's own products.
    const MASSES: &str = "retain = [\"m1\", \"m2\"]";

    /// A pendulum whose masses at `a` and `a + gap` are declared before the body that carries them.
    fn pendulum(gap: f64, head: &str) -> Mechanism {
        pendulum_at(0.3, 0.3 + gap, head)
    }

    fn pendulum_at(a: f64, b: f64, head: &str) -> Mechanism {
        read(&format!(
            r#"
            schema = 1
            name = "pendulum"
            gravity = [0, "-g", 0]
            {head}
            [constants]
            a = {{ value = {a:?}, unit = "m" }}
            b = {{ value = {b:?}, unit = "m" }}
            g = {{ value = 9.81, unit = "m/s^2" }}
            [parameters]
            m1 = {{ nominal = 1.0, unit = "kg" }}
            m2 = {{ nominal = 2.0, unit = "kg" }}
            [coordinates]
            q = {{ nominal = 0.4 }}
            [[frame]]
            name = "arm"
            on = "base"
            modified_dh = {{ theta = "q" }}
            [[lumped_mass]]
            mass = "m1"
            on = "arm"
            at = ["a", 0, 0]
            [[lumped_mass]]
            mass = "m2"
            on = "arm"
            at = ["b", 0, 0]
            [[part]]
            on = "arm"
            linear = {{ planar = 1, nominal = {{ ZZ = 0.35, MX = 1.05, MY = 0.2, M = 4.2 }} }}
            [[drive]]
            name = "motor"
            joint = "q"
            "#
        ))
    }

    /// Error of the pendulum's torque from p_min compared with the textbook formula, relative to its size. p_min is
    /// summed as in the evaluator and as in emitted code.
    fn errors_by_hand(derivation: &Derivation) -> [f64; 2] {
        let [a, b] = [0, 1].map(|k| derivation.mechanism.constants[k].value);
        let evaluator = ModelEvaluator::new(derivation);
        [derivation.nominal_base_values(), evaluator.base_parameters()].map(|base| {
            let (mut error, mut size) = (0.0_f64, 0.0_f64);
            for k in 0..40 {
                let (q, qdd) = (0.13 * f64::from(k), 3.0 - 0.4 * f64::from(k % 17));
                let state = NearbyState {
                    q: vec![q],
                    qd: vec![0.7],
                    qdd: vec![qdd],
                    load: vec![0.0],
                };
                let found = evaluator.inverse_dynamics(&state.as_motion_states(), &base).unwrap()[0][0];
                let inertia = a * a + 2.0 * b * b + 0.35;
                let moment = a + 2.0 * b + 1.05;
                let expected = inertia * qdd + 9.81 * (moment * q.cos() - 0.2 * q.sin());
                error = error.max((found - expected).abs());
                size = size.max(expected.abs());
            }
            error / size
        })
    }

    /// From gaps without loss to gaps that lose all digits: a base that loses more than a millionth is refused. The
    /// formula of the comparison does not use the reduction.
    #[test]
    fn a_base_is_refused_where_its_forces_are_wrong_and_only_there() {
        for exponent in 1..=16 {
            let mechanism = pendulum(10_f64.powi(-exponent), MASSES);
            match derive(&mechanism) {
                Ok(derivation) => {
                    let [error, emitted] = errors_by_hand(&derivation);
                    assert!(error < 10.0 * MOST_LOST, "1e-{exponent}: {error:e}");
                    assert!(emitted < 10.0 * MOST_LOST, "1e-{exponent}: {emitted:e}");
                    assert!(exponent <= 9, "1e-{exponent} leaves too few digits");
                }
                Err(DeriveError::DigitsLost { .. }) => {
                    let derivation = crate::derive::derive(&mechanism, StopRequest::NEVER).unwrap();
                    let [error, emitted] = errors_by_hand(&derivation);
                    let worst = error.max(emitted);
                    assert!(worst > 0.1 * MOST_LOST, "1e-{exponent}: {worst:e}");
                    assert!(exponent >= 6, "1e-{exponent} leaves enough digits");
                }
                // Equal to rounding: a denominator is zero.
                Err(DeriveError::NotFinite { .. }) => assert!(exponent >= 16),
                Err(error) => panic!("1e-{exponent}: {error}"),
            }
        }
    }

    /// The evaluator's base parameters lose one rounding per growth of the factors, not two: the differences that they
    /// are divided by are exact.
    #[test]
    fn differences_in_denominators_are_exact() {
        for exponent in [4, 6, 8] {
            let derivation =
                crate::derive::derive(&pendulum(10_f64.powi(-exponent), MASSES), StopRequest::NEVER).unwrap();
            let [error, _] = errors_by_hand(&derivation);
            assert!(error < 10_f64.powi(exponent - 15), "1e-{exponent}: {error:e}");
        }
    }

    #[test]
    fn the_refusal_names_the_products_that_should_not_be_retained() {
        let mechanism = pendulum(1e-14, MASSES);
        let Err(DeriveError::DigitsLost {
            retained, dependent, ..
        }) = derive(&mechanism)
        else {
            panic!("refused");
        };
        assert_eq!(retained, ["m1", "m2"]);
        assert_eq!(dependent, ["ZZ1", "MX1"]);
    }

    /// The body's own products are retained, and those of masses depend on them without quotients. So it is with
    /// numbers that differ only by rounding, such as 0.3 and 3 * 0.1.
    #[test]
    fn masses_that_coincide_do_not_stand_for_their_body() {
        for b in [0.3, 0.300_000_000_000_000_04, 0.3 + 1e-9, 0.31, 0.9] {
            let derivation = derive(&pendulum_at(b, 0.3, "")).unwrap();
            let errors = errors_by_hand(&derivation);
            assert!(errors.iter().all(|error| *error < 1e-14), "{b}: {errors:?}");
        }
    }

    /// Masses at `places` along a pendulum, and nothing else.
    fn masses(places: &[f64]) -> Mechanism {
        let (mut constants, mut parameters, mut lumps) = (String::new(), String::new(), String::new());
        for (i, x) in places.iter().enumerate() {
            let _ = writeln!(constants, "a{i} = {{ value = {x:?}, unit = \"m\" }}");
            let _ = writeln!(parameters, "m{i} = {{ nominal = {}.0, unit = \"kg\" }}", i + 1);
            let _ = writeln!(
                lumps,
                "[[lumped_mass]]\nmass = \"m{i}\"\non = \"arm\"\nat = [\"a{i}\", 0, 0]"
            );
        }
        read(&format!(
            "schema = 1\nname = \"masses\"\ngravity = [0, \"-9.81\", 0]\n[constants]\n{constants}[parameters]\n{parameters}\
             [coordinates]\nq = {{ nominal = 0.4 }}\n[[frame]]\nname = \"arm\"\non = \"base\"\nmodified_dh = {{ theta = \"q\" }}\n\
             [[drive]]\nname = \"motor\"\njoint = \"q\"\n{lumps}"
        ))
    }

    /// All masses depend on two of them: two whose positions differ are retained.
    #[test]
    fn columns_that_coincide_are_not_retained_together() {
        for gap in [0.0, 1e-16, 1e-12, 1e-7, 1e-3] {
            let places = [0.3, 0.3 + gap, 0.3 - 0.7 * gap, 0.8];
            let derivation = derive(&masses(&places)).unwrap_or_else(|e| panic!("{gap:e}: {e}"));
            assert_eq!(derivation.reduction.retained.len(), 2);
            let base = derivation.nominal_base_values();
            let state = NearbyState {
                q: vec![0.5],
                qd: vec![0.7],
                qdd: vec![2.0],
                load: vec![0.0],
            };
            let evaluator = ModelEvaluator::new(&derivation);
            let found = evaluator.inverse_dynamics(&state.as_motion_states(), &base).unwrap()[0][0];
            let terms = places.iter().zip([1.0, 2.0, 3.0, 4.0]);
            let expected: f64 = terms.map(|(x, m)| m * x * (2.0 * x + 9.81 * 0.5_f64.cos())).sum();
            let error = (found - expected).abs() / expected;
            assert!(error < 1e-12, "{gap:e}: {error:e}");
        }
    }

    /// A body that moves freely, with four rotors at the height `z` each that are declared before it.
    fn drone(z: [f64; 4]) -> Mechanism {
        let joints = [
            ("x", "d = \"x\""),
            ("y", "alpha = \"pi/2\", theta = \"pi/2\", d = \"y\""),
            ("z", "alpha = \"pi/2\", d = \"z\""),
            ("a", "theta = \"a\""),
            ("b", "alpha = \"pi/2\", theta = \"b\""),
            ("c", "alpha = \"pi/2\", theta = \"c\""),
        ];
        let mut text = "schema = 1\nname = \"drone\"\ngravity = [0, 0, \"-g\"]\n\
                        [constants]\ng = { value = 9.81, unit = \"m/s^2\" }\nl = { value = 0.2, unit = \"m\" }\n"
            .to_owned();
        for (i, z) in z.iter().enumerate() {
            let _ = writeln!(text, "h{i} = {{ value = {z:?}, unit = \"m\" }}");
        }
        text += "[parameters]\n";
        for i in 0..z.len() {
            let _ = writeln!(text, "m{i} = {{ nominal = 0.1, unit = \"kg\" }}");
        }
        text += "[coordinates]\n";
        for (k, (q, _)) in joints.iter().enumerate() {
            let _ = writeln!(text, "{q} = {{ nominal = {} }}", 0.3 + 0.1 * k as f64);
        }
        let mut on = "base".to_owned();
        for (q, dh) in &joints {
            let _ = writeln!(
                text,
                "[[frame]]\nname = \"f{q}\"\non = \"{on}\"\nmodified_dh = {{ {dh} }}"
            );
            let _ = writeln!(text, "[[drive]]\nname = \"d{q}\"\njoint = \"{q}\"");
            on = format!("f{q}");
        }
        for (i, at) in ["[\"l\", 0", "[0, \"l\"", "[\"-l\", 0", "[0, \"-l\""]
            .iter()
            .enumerate()
        {
            let _ = writeln!(
                text,
                "[[lumped_mass]]\nmass = \"m{i}\"\non = \"fc\"\nat = {at}, \"h{i}\"]"
            );
        }
        text += "[[part]]\non = \"fc\"\nlinear = { all = 1, nominal = { XX = 0.02, YY = 0.02, ZZ = 0.03, M = 1.5 } }\n";
        read(&text)
    }

    /// Four points span all moments of a body, unless they lie in one plane; the body's own products do so anywhere.
    #[test]
    fn a_body_is_not_written_by_its_rotors() {
        for z in [[0.05, -0.05, 0.1, 0.02], [0.05; 4]] {
            let derivation = derive(&drone(z)).unwrap_or_else(|error| panic!("{error}"));
            let lost = largest_digit_loss(&derivation).unwrap().unwrap().error;
            assert!(lost < 1e-13, "{z:?}: {lost:e}");
            let lines = derivation.reduction.dependencies.iter();
            let has_quotients = lines
                .flat_map(|line| &line.equals)
                .any(|(_, factor)| factor.denominator != RationalFunction::constant(Rational::ONE).denominator);
            assert!(!has_quotients);
        }
    }

    /// Values of parameters do not hide the digits that factors lose.
    #[test]
    fn parameters_without_values_stand_for_those_of_their_unit() {
        let mut mechanism = pendulum(1e-14, MASSES);
        for parameter in &mut mechanism.parameters {
            parameter.nominal = 0.0;
        }
        let found = derive(&mechanism).map(|_| ());
        assert!(matches!(found, Err(DeriveError::DigitsLost { .. })), "{found:?}");
    }

    /// Consistent models lose almost no digits.
    #[test]
    fn sound_models_are_far_from_the_threshold() {
        for name in ["two_link", "spidermill-paper", "four_bar", "stanford", "tx40"] {
            let derivation = derive(&model(name)).unwrap();
            let lost = largest_digit_loss(&derivation).unwrap().unwrap().error;
            assert!(lost < 1e-11, "{name}: {lost:e}");
        }
    }
}
