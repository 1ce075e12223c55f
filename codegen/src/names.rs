//! Names for intermediate values of a program: an angular velocity, a position, a rate.
//!
//! Lowering rewrites expressions freely, so a value is recognised numerically. Known quantities are evaluated at a
//! random state of a slightly changed geometry, and a value of the program that agrees gets the name.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_algebra::field::RandomStream;
use modelmill_spec::{DriveKind, Mechanism};

use crate::expr::print::FormulaSymbol;
use crate::expr::vector::{self, SymbolicVector};
use crate::expr::{Atom, EvaluationTape, ExprId, FloatDomain, Graph, Node};
use crate::lower::{ProgramOp, StraightLineProgram};
use crate::newton_euler::{JointLoad, SymbolicWrench, joint_wrenches};
use crate::regressor::form::{RecursionFrames, TotalForm};
use crate::tree::expressions::ParameterMonomial;
use crate::{Derivation, ModelEvaluator, MotionStates};

/// A state with the values of all inputs, and the known quantities at this state.
#[derive(Clone, Debug)]
pub struct NamedQuantities {
    /// Values of the inputs.
    pub(crate) atoms: BTreeMap<Atom, f64>,
    /// Symbols of known quantities with their values; no two have the same magnitude.
    known: Vec<(FormulaSymbol, f64)>,
}

/// A known quantity that a value of a program equals, up to its sign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QuantityName {
    /// Its symbol.
    pub symbol: FormulaSymbol,
    /// Whether the value is minus the quantity.
    pub negative: bool,
}

/// Relative agreement that counts as equality.
const RELATIVE_AGREEMENT: f64 = 1e-10;

impl NamedQuantities {
    /// Evaluates the known quantities at a random state; without any if no state has a solution.
    pub fn new(derivation: &Derivation) -> Self {
        // A fixed seed, so that names are always the same.
        let mut stream = RandomStream::new(0x6E61_6D65);
        // The state comes closer to the nominal pose until the loops close.
        for scale in [0.05, 0.02, 0.005, 0.001, 0.0002] {
            if let Some(atoms) = generic_state(derivation, scale, &mut stream) {
                let known = evaluate_quantities(derivation, &atoms);
                return Self { atoms, known };
            }
        }
        Self {
            atoms: BTreeMap::new(),
            known: Vec::new(),
        }
    }

    /// Names for the values of a program, by index. Each name is used once.
    pub fn name_values(&self, program: &StraightLineProgram) -> BTreeMap<usize, QuantityName> {
        let mut names = BTreeMap::new();
        if self.known.is_empty() {
            return names;
        }
        let values = self.values(program);
        // Quantities that have not been used as a name yet.
        let mut free: Vec<&(FormulaSymbol, f64)> = self.known.iter().collect();
        for (i, (op, value)) in program.ops.iter().zip(&values).enumerate() {
            if matches!(op, ProgramOp::Number(_) | ProgramOp::Input(_) | ProgramOp::Neg(_)) {
                continue;
            }
            // Values agree up to sign and rounding.
            let found = free
                .iter()
                .position(|(_, v)| (value.abs() - v.abs()).abs() <= RELATIVE_AGREEMENT * v.abs());
            if let Some(k) = found {
                let (symbol, v) = free.remove(k).clone();
                // The sign of the value decides how it is written.
                let negative = (value < &0.0) != (v < 0.0);
                names.insert(i, QuantityName { symbol, negative });
            }
        }
        names
    }

    /// Values of all operations of a program at the state.
    pub fn values(&self, program: &StraightLineProgram) -> Vec<f64> {
        operation_values(program, &self.atoms)
    }

    /// Takes a further input with its value at the state.
    pub fn insert(&mut self, atom: Atom, value: f64) {
        self.atoms.insert(atom, value);
    }
}

/// A random number, uniform in -1 to 1.
fn uniform(stream: &mut RandomStream) -> f64 {
    stream.next_bits() as f64 / (1u64 << 63) as f64 - 1.0
}

/// A random state near the nominal pose, for constants that differ slightly from the file's. `scale` is the size of the
/// differences; `None` if the loops cannot close there.
fn generic_state(derivation: &Derivation, scale: f64, stream: &mut RandomStream) -> Option<BTreeMap<Atom, f64>> {
    let mechanism = &derivation.mechanism;
    let (active, passive) = derivation.coordinates();
    // Changed constants separate quantities that are equal only for the file's values.
    let constants: Vec<f64> = mechanism
        .constants
        .iter()
        .map(|c| c.value * (1.0 + scale * uniform(stream)))
        .collect();
    // Positions close to the nominal pose.
    let near = |i: &usize, stream: &mut RandomStream| mechanism.coordinates[*i].nominal + scale * uniform(stream);
    let q: Vec<f64> = active.iter().map(|i| near(i, stream)).collect();
    // Rates, accelerations, loads and parameters are away from zero, so that no quantity vanishes by chance.
    // Rates and accelerations between 0.3 and 2.3.
    let [qd, qdd] = [(); 2].map(|()| active.iter().map(|_| 1.3 + uniform(stream)).collect::<Vec<f64>>());
    let load: Vec<f64> = mechanism.drives.iter().map(|_| 1.7 + uniform(stream)).collect();
    // Passive motion from the evaluator.
    let motion = {
        fn slices(values: &[f64]) -> Vec<&[f64]> {
            values.iter().map(std::slice::from_ref).collect()
        }
        let states = MotionStates {
            q: slices(&q),
            qd: slices(&qd),
            qdd: slices(&qdd),
            load: slices(&load),
        };
        ModelEvaluator::with_constants(derivation, constants.clone())
            .passive_motion(&states)
            .ok()?
    };
    // Values of all inputs that a program may read.
    let mut atoms = BTreeMap::new();
    for (i, value) in constants.iter().enumerate() {
        atoms.insert(Atom::Constant(i), *value);
    }
    for (k, i) in active.iter().enumerate() {
        atoms.insert(Atom::Coordinate(*i), q[k]);
        atoms.insert(Atom::Rate(*i), qd[k]);
        atoms.insert(Atom::Acceleration(*i), qdd[k]);
    }
    // Passive motion comes as coordinates, rates, accelerations.
    let n = passive.len();
    for (k, i) in passive.iter().enumerate() {
        atoms.insert(Atom::Coordinate(*i), motion[k][0]);
        atoms.insert(Atom::Rate(*i), motion[n + k][0]);
        atoms.insert(Atom::Acceleration(*i), motion[2 * n + k][0]);
    }
    for (d, value) in load.iter().enumerate() {
        atoms.insert(Atom::Load(d), *value);
    }
    for k in 0..derivation.reduction.retained.len() {
        atoms.insert(Atom::Base(k), 1.9 + uniform(stream));
    }
    for i in 0..mechanism.parameters.len() {
        atoms.insert(Atom::Parameter(i), 1.9 + uniform(stream));
    }
    Some(atoms)
}

/// Values of all operations of a program at a state.
fn operation_values(program: &StraightLineProgram, atoms: &BTreeMap<Atom, f64>) -> Vec<f64> {
    use crate::expr::{EvaluationDomain, Unary};
    let mut values: Vec<f64> = Vec::with_capacity(program.ops.len());
    for op in &program.ops {
        let at = |v: &crate::ValueId| values[v.index()];
        let value = match op {
            ProgramOp::Number(n) => n.to_f64(),
            ProgramOp::Input(Atom::Pi) => std::f64::consts::PI,
            ProgramOp::Input(atom) => atoms.get(atom).copied().unwrap_or(f64::NAN),
            ProgramOp::Add(a, b) => at(a) + at(b),
            ProgramOp::Sub(a, b) => at(a) - at(b),
            ProgramOp::Mul(a, b) => at(a) * at(b),
            ProgramOp::Div(a, b) => at(a) / at(b),
            ProgramOp::Neg(a) => -at(a),
            ProgramOp::Unary(Unary::Sqrt, a) => at(a).sqrt(),
            // The same functions as for expressions, so that the values agree.
            ProgramOp::Unary(function, a) => FloatDomain(|_| 0.0).unary(*function, &at(a)).unwrap_or(f64::NAN),
            ProgramOp::Sin(a) => at(a).sin(),
            ProgramOp::Cos(a) => at(a).cos(),
            ProgramOp::Atan2(y, x) => at(y).atan2(at(x)),
        };
        values.push(value);
    }
    values
}

/// Symbols and values of the known quantities; of several with equal magnitude the first one is used.
fn evaluate_quantities(derivation: &Derivation, atoms: &BTreeMap<Atom, f64>) -> Vec<(FormulaSymbol, f64)> {
    // Quantities are built in a copy of the graph.
    let mut graph = derivation.graph.clone();
    // In order of precedence.
    let mut named = trigonometric_quantities(&mut graph, derivation);
    named.extend(motion_quantities(&mut graph, derivation));
    named.extend(link_quantities(&mut graph, derivation));
    named.extend(point_quantities(&mut graph, derivation));
    named.extend(wrench_quantities(&mut graph, derivation));
    let atom = |a: Atom| atoms.get(&a).copied().unwrap_or(f64::NAN);
    // A name of the model file is not used for another quantity.
    let reserved = reserved_names(&derivation.mechanism);
    // Quantities with a value of their own.
    let mut known: Vec<(FormulaSymbol, f64)> = Vec::new();
    let ids: Vec<ExprId> = named.iter().map(|(_, id)| *id).collect();
    let together = EvaluationTape::new(&graph, &ids).evaluate(&FloatDomain(atom));
    for (k, (symbol, id)) in named.into_iter().enumerate() {
        // Numbers and inputs have names already.
        if matches!(graph.node(id), Node::Rational(_) | Node::Atom(_)) {
            continue;
        }
        // One undefined quantity makes the joint evaluation fail; then each is evaluated alone.
        let value = match &together {
            Some(values) => Some(values[k]),
            None => EvaluationTape::new(&graph, &[id])
                .evaluate(&FloatDomain(atom))
                .map(|v| v[0]),
        };
        let Some(value) = value else {
            continue;
        };
        let taken = known
            .iter()
            .any(|(s, v)| *s == symbol || (value.abs() - v.abs()).abs() <= RELATIVE_AGREEMENT * v.abs());
        if value.is_finite() && value != 0.0 && !taken && !reserved.contains(&symbol.text()) {
            known.push((symbol, value));
        }
    }
    known
}

/// Names of constants, parameters and coordinates of the model file.
pub(crate) fn reserved_names(mechanism: &Mechanism) -> BTreeSet<String> {
    let mut names: BTreeSet<String> = BTreeSet::new();
    names.extend(mechanism.constants.iter().map(|c| c.name.clone()));
    names.extend(mechanism.parameters.iter().map(|p| p.name.clone()));
    names.extend(mechanism.coordinates.iter().map(|c| c.name.clone()));
    names
}

/// Sines and cosines of sums of angles: `c_theta1_gamma1`.
fn trigonometric_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let projection = &derivation.equations.projection;
    let mechanism = &derivation.mechanism;
    // All sines and cosines in the closure equations, then those of the passive coordinates.
    let seen = graph.reachable(&projection.loops.residual);
    let mut named = Vec::new();
    for (i, _) in seen.into_iter().enumerate().filter(|(_, seen)| *seen) {
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        let (letter, angle) = match graph.node(id) {
            Node::Cos(angle) => ("c", angle),
            Node::Sin(angle) => ("s", angle),
            _ => continue,
        };
        named.push((trigonometric_name(mechanism, letter, angle), id));
    }
    for p in &projection.loops.passive {
        let angle = crate::expr::AtomAngleSum::new([(Atom::Coordinate(*p), 1)]);
        let (cosine, sine) = graph.cos_sin(&angle, 0);
        named.push((trigonometric_name(mechanism, "c", &angle), cosine));
        named.push((trigonometric_name(mechanism, "s", &angle), sine));
    }
    named
}

/// Name of a sine or cosine.
fn trigonometric_name(mechanism: &Mechanism, letter: &str, angle: &crate::expr::AtomAngleSum) -> FormulaSymbol {
    let mut name = letter.to_owned();
    for (atom, n) in angle.terms() {
        // Factors other than one are part of the name.
        let factor = match n {
            1 => String::new(),
            -1 => "m".to_owned(),
            n if *n < 0 => format!("m{}", n.unsigned_abs()),
            n => n.to_string(),
        };
        name.push('_');
        name.push_str(&factor);
        name.push_str(&crate::expr::print::atom(mechanism, *atom).name);
    }
    FormulaSymbol::new(name)
}

/// Rates and accelerations of passive coordinates, lengths of linear drives with derivatives and Jacobian, and
/// determinants.
fn motion_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let mechanism = &derivation.mechanism;
    let projection = &derivation.equations.projection;
    let mut named = Vec::new();
    // Passive coordinates.
    for (k, p) in projection.loops.passive.iter().enumerate() {
        let name = &*mechanism.coordinates[*p].name;
        named.push((FormulaSymbol::time_derivative(name, 1), projection.passive_rates[k]));
        named.push((
            FormulaSymbol::time_derivative(name, 2),
            projection.passive_accelerations[k],
        ));
    }
    // Linear drives; joint drives have the names of their coordinates.
    for (d, drive) in mechanism.drives.iter().enumerate() {
        if matches!(drive.kind, DriveKind::Joint(_)) {
            continue;
        }
        // Length, rate and acceleration of the drive.
        let motion = &projection.drives[d];
        let name = format!("l_{}", drive.name);
        named.push((FormulaSymbol::new(&*name), motion.coordinate));
        named.push((FormulaSymbol::time_derivative(&*name, 1), motion.rate));
        named.push((FormulaSymbol::time_derivative(&*name, 2), motion.acceleration));
        for (a, slope) in projection.loops.active.iter().zip(&projection.drive_jacobian[d]) {
            let coordinate = &mechanism.coordinates[*a].name;
            named.push((FormulaSymbol::new(format!("J_{}_{coordinate}", drive.name)), *slope));
        }
    }
    // Determinants and their inverses, which linear systems use.
    for (k, id) in projection.determinants.iter().enumerate() {
        named.push((FormulaSymbol::new(format!("Delta_{}", k + 1)), *id));
        let inverse = graph.pow(*id, -1);
        named.push((FormulaSymbol::new(format!("Delta_inv_{}", k + 1)), inverse));
    }
    named
}

/// Ends of the names of components.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Per frame: angular velocity and acceleration, acceleration of the origin minus gravity, and the matrix U.
/// These are the equations of the forward recursion (Newton and Euler), in the axes of the frame.
fn link_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let mechanism = &derivation.mechanism;
    // The links of the open tree.
    let tree = &derivation.equations.tree;
    let Ok(gravity) = mechanism
        .gravity
        .iter()
        .map(|g| crate::tree::expressions::expression(graph, g))
        .collect::<Result<Vec<_>, _>>()
    else {
        return Vec::new();
    };
    // The base stands still and accelerates against gravity.
    let still = (
        vector::ZERO,
        vector::ZERO,
        std::array::from_fn(|i| graph.neg(gravity[i])),
    );
    // Angular velocity, angular acceleration and acceleration of each link.
    let mut motions: Vec<(SymbolicVector, SymbolicVector, SymbolicVector)> = Vec::new();
    // Acceleration of the point where the joint acts, in the axes of the parent.
    let mut before: Vec<SymbolicVector> = Vec::new();
    for (i, link) in tree.links.iter().enumerate() {
        // First the motion of the parent at the joint, then that of the joint itself.
        let (omega_p, alpha_p, a_p) = link.parent.map_or(still, |p| motions[p]);
        let swing = graph.cross(&omega_p, &link.position);
        let centripetal = graph.cross(&omega_p, &swing);
        let tangential = graph.cross(&alpha_p, &link.position);
        let a = graph.add_vectors(&[a_p, tangential, centripetal]);
        before.push(a);
        // The motion of the parent in the axes of the link.
        let mut omega = tree.to_link(graph, i, &omega_p);
        let mut alpha = tree.to_link(graph, i, &alpha_p);
        let mut a = tree.to_link(graph, i, &a);
        // Revolute joints add to the angular velocity about z.
        for (coordinate, n) in &link.turns {
            let n = crate::expr::Rational::integer(i64::from(*n));
            let [rate, acceleration] =
                [Atom::Rate(*coordinate), Atom::Acceleration(*coordinate)].map(|atom| graph.atom(atom));
            let turn = [vector::ZERO[0], vector::ZERO[1], graph.scale(rate, &n)];
            let coupled = graph.cross(&omega, &turn);
            alpha = graph.add_vectors(&[alpha, coupled]);
            omega = graph.add_vectors(&[omega, turn]);
            let about = graph.scale(acceleration, &n);
            alpha[2] = graph.add(alpha[2], about);
        }
        // Prismatic joints add the Coriolis term and the acceleration along z.
        for (coordinate, k) in &link.slides {
            let [rate, acceleration] =
                [Atom::Rate(*coordinate), Atom::Acceleration(*coordinate)].map(|atom| graph.atom(atom));
            let twice = crate::expr::Rational::integer(2);
            let slide = [vector::ZERO[0], vector::ZERO[1], graph.scale(rate, &(k * &twice))];
            let coriolis = graph.cross(&omega, &slide);
            a = graph.add_vectors(&[a, coriolis]);
            let along = graph.scale(acceleration, k);
            a[2] = graph.add(a[2], along);
        }
        motions.push((omega, alpha, a));
    }
    let mut named = Vec::new();
    for (frame, link) in mechanism.frames.iter().zip(&tree.of_frame) {
        let Some(link) = link else { continue };
        let (omega, alpha, a) = &motions[*link];
        // Components of angular velocity and accelerations.
        for (axis, name) in AXES.iter().enumerate() {
            let of = |letter: &str| format!("{letter}_{}_{name}", frame.name);
            named.push((FormulaSymbol::new(of("omega")), omega[axis]));
            named.push((FormulaSymbol::time_derivative(of("omega"), 1), alpha[axis]));
            named.push((FormulaSymbol::new(of("a")), a[axis]));
        }
        for axis in 0..3 {
            // The matrix that maps a point of the frame to its acceleration: [alpha]x + [omega]x [omega]x.
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            let entry = |i: usize, j: usize| format!("U_{}_{}{}", frame.name, AXES[i], AXES[j]);
            let squares = [j, k].map(|x| graph.mul(omega[x], omega[x]));
            let both = graph.add(squares[0], squares[1]);
            named.push((FormulaSymbol::new(entry(axis, axis)), graph.neg(both)));
            let product = graph.mul(omega[axis], omega[j]);
            named.push((FormulaSymbol::new(entry(axis, j)), graph.sub(product, alpha[k])));
            named.push((FormulaSymbol::new(entry(j, axis)), graph.add(product, alpha[k])));
        }
        let parent = &mechanism.frames[frame.parent.0].name;
        for (axis, id) in AXES.iter().zip(before[*link]) {
            let name = format!("a_{}_{parent}_{axis}", frame.name);
            named.push((FormulaSymbol::new(name), id));
        }
    }
    named
}

/// Per frame: force and moment that its joint transmits, with base parameters for the inertia. The moment is about the
/// origin of the frame; both are given in the axes of the frame, and in those of the last frame before the parallel
/// axes begin.
fn wrench_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let (mechanism, equations) = (&derivation.mechanism, &derivation.equations);
    let tree = &equations.tree;
    let base = crate::programs::base_parameter_atoms(graph, &derivation.reduction);
    let value = |product: &ParameterMonomial| base.get(product).copied().unwrap_or(Graph::ZERO);
    // The plain form of the recursion.
    let plain = TotalForm::PLAIN;
    let frames = RecursionFrames::new(graph, tree, &equations.gravity, plain.style, false);
    let wrenches = plain.wrenches(graph, &equations.inertia, tree, &frames, &value);
    let loads = wrenches.into_iter().map(|(link, _, wrench)| JointLoad {
        link,
        wrench,
        until: None,
    });
    // Sums of the wrenches from the ends to the base.
    let through = joint_wrenches(graph, tree, loads.collect());
    let mut named = Vec::new();
    for (frame, link) in mechanism.frames.iter().zip(&tree.of_frame) {
        let Some(link) = link else { continue };
        let SymbolicWrench { force, moment } = through[*link];
        // Rotation to the axes before the parallel ones.
        let turn = tree.links[*link].absolute.clone();
        // Links with parallel axes share axes up to a rotation about z; the last frame of the parent names the axes.
        let first = tree.links[tree.links[*link].first_parallel].parent;
        let carries = (0..mechanism.frames.len()).rfind(|f| tree.of_frame[*f] == first);
        let carries = carries.map_or("base", |f| mechanism.frames[f].name.as_str());
        for (letter, own) in [("F", force), ("M", moment)] {
            let turned = graph.rotate_out(&turn, &own);
            for (k, axis) in AXES.iter().enumerate() {
                named.push((FormulaSymbol::new(format!("{letter}_{}_{axis}", frame.name)), own[k]));
                let along = format!("{letter}_{}_{carries}_{axis}", frame.name);
                named.push((FormulaSymbol::new(along), turned[k]));
            }
        }
    }
    named
}

/// Positions of the points in the axes of the base: from the base's origin, from the origin of their frame, and along
/// linear drives.
fn point_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let mut mechanism = derivation.mechanism.clone();
    let tree = &derivation.equations.tree;
    let n_points = mechanism.points.len();
    // The origins of the frames are added as points.
    for i in 0..mechanism.frames.len() {
        mechanism.points.push(modelmill_spec::FramePoint {
            name: mechanism.frames[i].name.clone(),
            frame: modelmill_spec::FrameIdx(i),
            at: std::array::from_fn(|_| modelmill_spec::ExactExpression::zero()),
        });
    }
    // A point whose position has no expression leaves all positions without names.
    let places: Option<Vec<SymbolicVector>> = (0..mechanism.points.len())
        .map(|i| crate::loops::segment::position_in_base(graph, &mechanism, tree, i).ok())
        .collect();
    let Some(places) = places else {
        return Vec::new();
    };
    let mut named = Vec::new();
    let mut name = |start: String, at: SymbolicVector| {
        for (axis, id) in AXES.iter().zip(at) {
            named.push((FormulaSymbol::new(format!("{start}_{axis}")), id));
        }
    };
    // From the origin of the base.
    for (point, place) in mechanism.points.iter().zip(&places) {
        name(format!("r_{}", point.name), *place);
    }
    // From the origin of the frame.
    for (point, place) in mechanism.points.iter().zip(&places).take(n_points) {
        let frame = &mechanism.frames[point.frame.0];
        let from = graph.sub_vectors(place, &places[n_points + point.frame.0]);
        name(format!("r_{}_{}", frame.name, point.name), from);
    }
    // For each loop, the vector between the origins of the frames that it joins.
    for joined in &mechanism.loops {
        let [a, b] = joined.joins.map(|p| mechanism.points[p.0].frame.0);
        let between = graph.sub_vectors(&places[n_points + b], &places[n_points + a]);
        let names = [a, b].map(|f| &*mechanism.frames[f].name);
        name(format!("r_{}_{}", names[0], names[1]), between);
    }
    // Along the linear drives.
    for drive in &mechanism.drives {
        if let DriveKind::Linear { from, to } = drive.kind {
            let along = graph.sub_vectors(&places[to.0], &places[from.0]);
            name(format!("e_{}", drive.name), along);
        }
    }
    named
}
