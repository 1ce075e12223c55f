//! Laws that hold for every mechanism, checked on one; a breach says where and by how much.

use modelmill_codegen::{Derivation, ModelEvaluator};
use modelmill_spec::{
    ConstantIdx, ExactAngle, ExactExpression, ExactFunction, FrameAxis, FrameIdx, FrameStep, Mechanism, ModelConstant,
    ModelSymbol,
};
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::base_parameters::{base, nominal, products};
use crate::mechanics::{Jet, Numbers, along};
use crate::random::regularity_at;
use crate::rank::rank_of_products;
use crate::sample::Sample;
use crate::stream::Stream;

/// Largest relative error between two ways to the same number.
pub const ACCURACY: f64 = 1e-11;

/// Smallest ratio of singular values across which a numeric rank is believed.
pub const BELIEVED_GAP: f64 = 1e4;

/// Least derivative of a drive's length by its joint, and least regularity of a loop, at the states that are used.
const REGULAR: f64 = 0.12;

/// A mechanism with its derivation and states at which it is regular.
pub struct Case {
    /// What the mill made of it.
    pub derivation: Derivation,
    /// Regular states.
    pub sample: Sample,
}

impl Case {
    /// Derives a mechanism and draws `n` regular states.
    pub fn new(mechanism: &Mechanism, n: usize, reach: f64) -> Result<Self, String> {
        let derivation =
            modelmill_codegen::derive(mechanism).map_err(|error| format!("{}: {error}", mechanism.name))?;
        let sample = {
            let evaluator = ModelEvaluator::new(&derivation);
            let mut stream = Stream::new(mechanism.name.len() as u64 + 77);
            let drawn = Sample::random(mechanism, 4 * n, reach, &mut stream).reachable(&evaluator);
            let full: Vec<bool> = (0..drawn.len())
                .map(|i| is_regular(mechanism, &coordinates(&evaluator, mechanism, &drawn.only(i))))
                .collect();
            let regular = drawn.filtered(|i| full[i]);
            regular.filtered(|i| i < n)
        };
        if sample.len() < n / 4 {
            return Err(format!("{}: only {} regular states", mechanism.name, sample.len()));
        }
        Ok(Self { derivation, sample })
    }

    /// Derives a mechanism and draws `n` states near its nominal pose, which must be regular; drives may act on passive
    /// coordinates.
    pub fn near_nominal(mechanism: &Mechanism, n: usize, reach: f64) -> Result<Self, String> {
        let derivation =
            modelmill_codegen::derive(mechanism).map_err(|error| format!("{}: {error}", mechanism.name))?;
        let mut stream = Stream::new(mechanism.name.len() as u64 + 78);
        let drawn = Sample::random(mechanism, n, reach, &mut stream);
        let sample = drawn.reachable(&ModelEvaluator::new(&derivation));
        if sample.len() < n / 2 {
            let n = sample.len();
            return Err(format!("{}: only {n} states in reach", mechanism.name));
        }
        Ok(Self { derivation, sample })
    }

    pub(crate) fn mechanism(&self) -> &Mechanism {
        &self.derivation.mechanism
    }

    pub(crate) fn breach(&self, what: &str) -> String {
        format!("{}: {what}", self.mechanism().name)
    }

    /// The exact rank is the rank of a large sample; returns the gap of the singular values.
    pub fn exact_rank_is_numeric_rank(&self) -> Result<f64, String> {
        let evaluator = ModelEvaluator::new(&self.derivation);
        let exact = self.derivation.reduction.retained.len();
        if self.derivation.reduction.products.is_empty() {
            return Ok(f64::INFINITY);
        }
        let rank = rank_of_products(&evaluator, &self.sample).map_err(|e| self.breach(&e.to_string()))?;
        if rank.rank != exact && rank.gap > BELIEVED_GAP {
            return Err(self.breach(&format!(
                "exact rank {exact}, numeric rank {} with gap {:.1e}: {:?}",
                rank.rank, rank.gap, rank.singular_values
            )));
        }
        if rank.rank != exact {
            return Err(self.breach(&format!(
                "no clear numeric rank beside {exact}: {:?}",
                rank.singular_values
            )));
        }
        Ok(rank.gap)
    }

    /// `H p_g = H_min p_min`, and the inverse dynamics is that force; errors relative to the row's largest terms.
    pub fn reduction_keeps_the_forces(&self) -> Result<f64, String> {
        let evaluator = ModelEvaluator::new(&self.derivation);
        let states = self.sample.states();
        let fault = |e: modelmill_codegen::PoseFault| self.breach(&e.to_string());
        let parameters = nominal(self.mechanism());
        let (p_g, p_min) = (
            products(&self.derivation, &parameters),
            base(&self.derivation, &parameters),
        );
        let (h, h_min) = (
            evaluator.full_regressor(&states).map_err(fault)?,
            evaluator.regressor(&states).map_err(fault)?,
        );
        let forces = evaluator.inverse_dynamics(&states, &p_min).map_err(fault)?;
        let full = &h * DVector::from_vec(p_g.clone());
        let reduced = &h_min * DVector::from_vec(p_min.clone());
        let n_drives = self.mechanism().drives.len();
        let mut worst: f64 = 0.0;
        for row in 0..h.nrows() {
            let magnitude = |matrix: &DMatrix<f64>, p: &[f64]| -> f64 {
                matrix.row(row).iter().zip(p).map(|(a, b)| (a * b).abs()).sum()
            };
            let scale = magnitude(&h, &p_g).max(magnitude(&h_min, &p_min)).max(1e-9);
            let force = forces[row % n_drives][row / n_drives];
            for (what, error) in [
                ("H p_g - H_min p_min", full[row] - reduced[row]),
                ("inverse dynamics - H_min p_min", force - reduced[row]),
            ] {
                let error = error.abs() / scale;
                worst = worst.max(error);
                if error.is_nan() || error > ACCURACY {
                    return Err(self.breach(&format!("{what} = {error:.1e} of {scale} in row {row}")));
                }
            }
        }
        Ok(worst)
    }

    /// The drives supply what d'Alembert's principle asks for, along every independent motion.
    pub fn forces_satisfy_dalembert(&self, n_states: usize) -> Result<f64, String> {
        self.forces_satisfy_dalembert_to(ACCURACY, n_states)
    }

    /// The same to an accuracy of one's own.
    pub fn forces_satisfy_dalembert_to(&self, accuracy: f64, n_states: usize) -> Result<f64, String> {
        let (worst, says) = self.worst_beside_dalembert(n_states)?;
        // What is no number is no accuracy.
        if worst <= accuracy { Ok(worst) } else { Err(says) }
    }

    /// The largest error with where it is, or the first that is no number.
    fn worst_beside_dalembert(&self, n_states: usize) -> Result<(f64, String), String> {
        let mechanism = self.mechanism();
        let evaluator = ModelEvaluator::new(&self.derivation);
        let parameters = nominal(mechanism);
        let p_min = base(&self.derivation, &parameters);
        let numbers = Numbers::new(mechanism, parameters);
        let (mut worst, mut says) = (0.0, String::new());
        for i in 0..self.sample.len().min(n_states) {
            let one = self.sample.only(i);
            let forces = evaluator
                .inverse_dynamics(&one.states(), &p_min)
                .map_err(|e| self.breach(&e.to_string()))?;
            let motion = motion(&evaluator, mechanism, &one);
            let load: Vec<f64> = one.load.iter().map(|l| l[0]).collect();
            for direction in directions(mechanism, &numbers, &motion) {
                let moved: Vec<Jet> = motion
                    .iter()
                    .zip(&direction)
                    .map(|(q, d)| Jet([q.0[0], *d, 0.0]))
                    .collect();
                let rates = numbers.drives(&moved);
                let supplied: Vec<f64> = forces.iter().zip(&rates).map(|(f, l)| f[0] * l.0[1]).collect();
                let needed = numbers.virtual_power(&motion, &direction, &load);
                let scale = needed.magnitude + supplied.iter().map(|x| x.abs()).sum::<f64>() + 1e-9;
                let error = (supplied.iter().sum::<f64>() - needed.value).abs() / scale;
                if error.is_nan() || error > worst {
                    worst = error;
                    says = self.breach(&format!(
                        "along {direction:?} the drives supply {supplied:?}, needed are {needed:?}, error {error:.1e}"
                    ));
                }
                if error.is_nan() {
                    return Ok((worst, says));
                }
            }
        }
        Ok((worst, says))
    }

    /// The points that loops join coincide, and so do their velocities and accelerations.
    pub fn loops_stay_closed(&self) -> Result<f64, String> {
        let mechanism = self.mechanism();
        let evaluator = ModelEvaluator::new(&self.derivation);
        let numbers = Numbers::new(mechanism, nominal(mechanism));
        let mut worst: f64 = 0.0;
        for i in 0..self.sample.len().min(30) {
            let motion = motion(&evaluator, mechanism, &self.sample.only(i));
            for gap in numbers.gaps(&motion) {
                // Positions, velocities and accelerations here are of the order of 1, 5 and 100.
                for (x, scale) in gap.0.iter().zip([1.0, 5.0, 100.0]) {
                    let error = x.abs() / scale;
                    worst = worst.max(error);
                    if error.is_nan() || error > ACCURACY {
                        return Err(self.breach(&format!("a loop is open by {gap:?}")));
                    }
                }
            }
        }
        Ok(worst)
    }

    /// Power of the drives equals the rate of kinetic and potential energy (for mechanisms without effects).
    ///
    /// The rate is a central difference of sixth order along a path of constant acceleration, good to about 1e-8 with
    /// the best of three steps: long ones suffer where the motion bends sharply, short ones from rounding.
    pub fn power_is_the_rate_of_energy(&self) -> Result<f64, String> {
        let mechanism = self.mechanism();
        assert!(mechanism.effects.is_empty(), "friction turns power into heat");
        let evaluator = ModelEvaluator::new(&self.derivation);
        let parameters = nominal(mechanism);
        let p_min = base(&self.derivation, &parameters);
        let numbers = Numbers::new(mechanism, parameters);
        let fault = |e: modelmill_codegen::PoseFault| self.breach(&e.to_string());
        let (mut worst, mut checked): (f64, usize) = (0.0, 0);
        for i in 0..self.sample.len() {
            let one = self.sample.only(i);
            let energy = |t: f64| -> Result<f64, String> {
                let mut later = one.clone();
                for k in 0..one.q.len() {
                    let (q, v, a) = (one.q[k][0], one.qd[k][0], one.qdd[k][0]);
                    later.q[k][0] = q + v * t + 0.5 * a * t * t;
                    later.qd[k][0] = v + a * t;
                }
                evaluator.passive_motion(&later.states()).map_err(fault)?;
                Ok(numbers.energy(&motion(&evaluator, mechanism, &later)))
            };
            let forces = evaluator.inverse_dynamics(&one.states(), &p_min).map_err(fault)?;
            let rates = numbers.drives(&motion(&evaluator, mechanism, &one));
            let powers = || forces.iter().zip(&rates).map(|(f, l)| f[0] * l.0[1]);
            let power: f64 = powers().sum();
            if energy(3e-3).and(energy(-3e-3)).is_err() {
                // The path leaves the reach of the mechanism.
                continue;
            }
            let mut best = f64::INFINITY;
            for step in [1e-3, 2e-4, 4e-5] {
                let mut rate = 0.0;
                let mut scale = 1e-9 + powers().map(f64::abs).sum::<f64>();
                for (k, weight) in [(1.0, 45.0), (2.0, -9.0), (3.0, 1.0)] {
                    let (after, before) = (energy(k * step)?, energy(-k * step)?);
                    rate += weight * (after - before) / (60.0 * step);
                    scale += after.abs();
                }
                best = best.min((power - rate).abs() / scale);
            }
            worst = worst.max(best);
            if best > 1e-6 {
                return Err(self.breach(&format!("power {power} misses the rate of energy by {best:.1e}")));
            }
            checked += 1;
            if checked == 4 {
                return Ok(worst);
            }
        }
        Err(self.breach("too few states have a path around them"))
    }

    /// The mass matrix, taken from the regressor at rest, is symmetric and positive definite.
    pub fn mass_matrix_is_symmetric_and_positive_definite(&self) -> Result<f64, String> {
        let mechanism = self.mechanism();
        let evaluator = ModelEvaluator::new(&self.derivation);
        let p_min = DVector::from_vec(base(&self.derivation, &nominal(mechanism)));
        let numbers = Numbers::new(mechanism, nominal(mechanism));
        let fault = |e: modelmill_codegen::PoseFault| self.breach(&e.to_string());
        let n = mechanism.coordinates.iter().filter(|c| !c.passive).count();
        let mut worst: f64 = 0.0;
        for i in 0..self.sample.len().min(3) {
            let mut rest = self.sample.only(i);
            for rate in &mut rest.qd {
                rate[0] = 0.0;
            }
            // Forces of the drives become forces on the coordinates by the drives' Jacobian.
            let pose = coordinates(&evaluator, mechanism, &rest);
            // Passive coordinates and followers move with the active ones.
            let still: Vec<Jet> = pose.iter().map(|q| Jet([*q, 0.0, 0.0])).collect();
            let ways = directions(mechanism, &numbers, &still);
            let moving = |way: &[f64]| -> Vec<Jet> { pose.iter().zip(way).map(|(q, v)| Jet([*q, *v, 0.0])).collect() };
            // The first direction is the actual motion.
            let jacobian = DMatrix::from_fn(n, n, |d, a| numbers.drives(&moving(&ways[a + 1]))[d].0[1]);
            let mut forces = |accelerated: Option<usize>| -> Result<DVector<f64>, String> {
                for (k, acceleration) in rest.qdd.iter_mut().enumerate() {
                    acceleration[0] = f64::from(u8::from(accelerated == Some(k)));
                }
                let h = evaluator.regressor(&rest.states()).map_err(fault)?;
                Ok(jacobian.transpose() * (h * &p_min))
            };
            let weight = forces(None)?;
            let mut mass = DMatrix::zeros(n, n);
            for k in 0..n {
                mass.set_column(k, &(forces(Some(k))? - &weight));
            }
            let asymmetry = (&mass - mass.transpose()).amax() / (mass.amax() + weight.amax());
            worst = worst.max(asymmetry);
            if asymmetry.is_nan() || asymmetry > ACCURACY {
                return Err(self.breach(&format!("the mass matrix is not symmetric: {mass}")));
            }
            if Cholesky::new(mass.clone()).is_none() {
                return Err(self.breach(&format!("the mass matrix is not positive: {mass}")));
            }
        }
        Ok(worst)
    }

    /// The same forces and the same rank when the base frame is turned, and gravity with it.
    pub fn the_base_frame_does_not_matter(&self) -> Result<f64, String> {
        let turned = with_turned_base(self.mechanism());
        let other = modelmill_codegen::derive(&turned)
            .map_err(|error| self.breach(&format!("with its base turned: {error}")))?;
        if other.reduction.retained.len() != self.derivation.reduction.retained.len() {
            return Err(self.breach("the rank changes with the base frame"));
        }
        let parameters = nominal(self.mechanism());
        let states = self.sample.states();
        let forces = |derivation: &Derivation| {
            ModelEvaluator::new(derivation)
                .inverse_dynamics(&states, &base(derivation, &parameters))
                .map_err(|e| self.breach(&e.to_string()))
        };
        let (here, there) = (forces(&self.derivation)?, forces(&other)?);
        let mut worst: f64 = 0.0;
        for (a, b) in here.iter().zip(&there) {
            let scale = a.iter().fold(1e-6, |m: f64, x| m.max(x.abs()));
            for (x, y) in a.iter().zip(b) {
                let error = (x - y).abs() / scale;
                worst = worst.max(error);
                if error.is_nan() || error > ACCURACY {
                    return Err(self.breach(&format!("{x} becomes {y}, error {error:.1e}")));
                }
            }
        }
        Ok(worst)
    }
}

/// All coordinates at a single state, passive ones from the evaluator.
pub(crate) fn coordinates(evaluator: &ModelEvaluator<'_>, mechanism: &Mechanism, one: &Sample) -> Vec<f64> {
    motion(evaluator, mechanism, one).iter().map(|q| q.0[0]).collect()
}

/// All coordinates with rates and accelerations at a single state, passive ones from the evaluator.
pub fn motion(evaluator: &ModelEvaluator<'_>, mechanism: &Mechanism, one: &Sample) -> Vec<Jet> {
    let passive = evaluator.passive_motion(&one.states()).expect("a reachable state");
    let n_passive = passive.len() / 3;
    let (mut a, mut p) = (0, 0);
    mechanism
        .coordinates
        .iter()
        .map(|coordinate| {
            if coordinate.passive {
                p += 1;
                Jet(std::array::from_fn(|order| passive[order * n_passive + p - 1][0]))
            } else {
                a += 1;
                Jet([one.q[a - 1][0], one.qd[a - 1][0], one.qdd[a - 1][0]])
            }
        })
        .collect()
}

fn is_regular(mechanism: &Mechanism, coordinates: &[f64]) -> bool {
    let numbers = Numbers::new(mechanism, nominal(mechanism));
    let active = (0..coordinates.len()).filter(|i| !mechanism.coordinates[*i].passive);
    let drives_move = active
        .enumerate()
        .all(|(d, i)| numbers.drives(&along(coordinates, i))[d].0[1].abs() > REGULAR);
    drives_move && (mechanism.loops.is_empty() || regularity_at(mechanism, coordinates) > REGULAR)
}

/// One motion per degree of freedom that keeps the loops closed, and the actual one.
pub(crate) fn directions(mechanism: &Mechanism, numbers: &Numbers<'_>, motion: &[Jet]) -> Vec<Vec<f64>> {
    let n = motion.len();
    let position: Vec<f64> = motion.iter().map(|q| q.0[0]).collect();
    let (passive, active): (Vec<usize>, Vec<usize>) = (0..n).partition(|i| mechanism.coordinates[*i].passive);
    let mut directions: Vec<Vec<f64>> = vec![motion.iter().map(|q| q.0[1]).collect()];
    let jacobian = (!passive.is_empty()).then(|| numbers.gap_jacobian(&position));
    for a in &active {
        let mut direction = vec![0.0; n];
        direction[*a] = 1.0;
        if let Some(jacobian) = &jacobian {
            let rates = jacobian
                .select_columns(&passive)
                .svd(true, true)
                .solve(&(-jacobian.column(*a)), 1e-12)
                .expect("both factors were asked for");
            for (p, rate) in passive.iter().zip(rates.iter()) {
                direction[*p] = *rate;
            }
        }
        directions.push(direction);
    }
    directions
}

/// The mechanism on a base that is turned about z by a constant of its own, and for trees about x by pi/2 besides;
/// gravity turns along.
fn with_turned_base(mechanism: &Mechanism) -> Mechanism {
    let mut turned = mechanism.clone();
    turned.name = format!("{}_turned", mechanism.name);
    let angle = ConstantIdx(turned.constants.len());
    turned.constants.push(ModelConstant {
        name: "turn".to_owned(),
        value: 0.7,
        unit: "rad".to_owned(),
        is_angle: true,
        note: None,
    });
    let integer = |n: i64| num_rational::BigRational::from_integer(n.into());
    let half = num_rational::BigRational::new(1.into(), 2.into());
    let mut steps = vec![FrameStep::Rotate(
        FrameAxis::Z,
        ExactAngle {
            pi: integer(0),
            terms: vec![(ModelSymbol::Constant(angle), 1)],
        },
    )];
    let [x, y, z] = mechanism.gravity.clone();
    let (tilted, is_tree) = (
        [x.clone(), ExactExpression::Negative(Box::new(z.clone())), y.clone()],
        mechanism.loops.is_empty(),
    );
    let [x, y, z] = if is_tree { tilted } else { [x, y, z] };
    if is_tree {
        steps.push(FrameStep::Rotate(
            FrameAxis::X,
            ExactAngle {
                pi: half,
                terms: Vec::new(),
            },
        ));
    }
    let symbol = || Box::new(ExactExpression::Symbol(ModelSymbol::Constant(angle)));
    let cos = ExactExpression::Apply(ExactFunction::Cos, symbol());
    let sin = ExactExpression::Apply(ExactFunction::Sin, symbol());
    let times = |a: &ExactExpression, b: &ExactExpression| ExactExpression::Product(vec![a.clone(), b.clone()]);
    turned.gravity = [
        ExactExpression::Sum(vec![
            times(&cos, &x),
            ExactExpression::Negative(Box::new(times(&sin, &y))),
        ]),
        ExactExpression::Sum(vec![times(&sin, &x), times(&cos, &y)]),
        z,
    ];
    // The new frame comes right after the base; everything else moves up by one.
    let moved = |frame: FrameIdx| FrameIdx(frame.0 + 1);
    for frame in &mut turned.frames[1..] {
        frame.parent = moved(frame.parent);
    }
    let mut base_frame = turned.frames[0].clone();
    "turned_base".clone_into(&mut base_frame.name);
    base_frame.steps = steps;
    turned.frames.insert(1, base_frame);
    for part in &mut turned.parts {
        part.frame = moved(part.frame);
    }
    for lump in &mut turned.lumped_masses {
        lump.frame = moved(lump.frame);
    }
    for point in &mut turned.points {
        point.frame = moved(point.frame);
    }
    turned
}
