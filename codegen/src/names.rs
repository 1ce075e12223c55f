//! Names for intermediate values of a program: a value is called what it is, an angular velocity, a position, a rate.
//!
//! Lowering rewrites expressions freely, so a value is recognised by its number at a random state of a slightly changed
//! geometry: quantities with a meaning are evaluated there, and a value of the program that agrees gets the name.

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

/// A state with all its atoms' values, and the quantities with a meaning there.
#[derive(Clone, Debug)]
pub struct NamedQuantities {
    pub(crate) atoms: BTreeMap<Atom, f64>,
    known: Vec<(FormulaSymbol, f64)>,
}

/// What a value of a program is: a quantity with a name, or its negative.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QuantityName {
    /// Its name.
    pub symbol: FormulaSymbol,
    /// Whether the value is the negative of what the name means.
    pub negative: bool,
}

/// Relative agreement that counts as equality.
const RELATIVE_AGREEMENT: f64 = 1e-10;

impl NamedQuantities {
    /// Evaluates the quantities that have a meaning; none where no state is found.
    pub fn new(derivation: &Derivation) -> Self {
        let mut stream = RandomStream::new(0x6E61_6D65);
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

    /// What a program's values are, by position; each name is given once.
    pub fn name_values(&self, program: &StraightLineProgram) -> BTreeMap<usize, QuantityName> {
        let mut names = BTreeMap::new();
        if self.known.is_empty() {
            return names;
        }
        let values = self.values(program);
        let mut free: Vec<&(FormulaSymbol, f64)> = self.known.iter().collect();
        for (i, (op, value)) in program.ops.iter().zip(&values).enumerate() {
            if matches!(
                op,
                ProgramOp::Number(_) | ProgramOp::Input(_) | ProgramOp::Neg(_)
            ) {
                continue;
            }
            let found = free
                .iter()
                .position(|(_, v)| (value.abs() - v.abs()).abs() <= RELATIVE_AGREEMENT * v.abs());
            if let Some(k) = found {
                let (symbol, v) = free.remove(k).clone();
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

/// Uniform in `[-1, 1)`.
fn uniform(stream: &mut RandomStream) -> f64 {
    stream.next_bits() as f64 / (1u64 << 63) as f64 - 1.0
}

/// A state near the nominal pose of a mechanism whose constants differ a little from the file's.
fn generic_state(
    derivation: &Derivation,
    scale: f64,
    stream: &mut RandomStream,
) -> Option<BTreeMap<Atom, f64>> {
    let mechanism = &derivation.mechanism;
    let (active, passive) = derivation.coordinates();
    let constants: Vec<f64> = mechanism
        .constants
        .iter()
        .map(|c| c.value * (1.0 + scale * uniform(stream)))
        .collect();
    let near = |i: &usize, stream: &mut RandomStream| {
        mechanism.coordinates[*i].nominal + scale * uniform(stream)
    };
    let q: Vec<f64> = active.iter().map(|i| near(i, stream)).collect();
    let [qd, qdd] = [(); 2].map(|()| {
        active
            .iter()
            .map(|_| 1.3 + uniform(stream))
            .collect::<Vec<f64>>()
    });
    let load: Vec<f64> = mechanism
        .drives
        .iter()
        .map(|_| 1.7 + uniform(stream))
        .collect();
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
    let mut atoms = BTreeMap::new();
    for (i, value) in constants.iter().enumerate() {
        atoms.insert(Atom::Constant(i), *value);
    }
    for (k, i) in active.iter().enumerate() {
        atoms.insert(Atom::Coordinate(*i), q[k]);
        atoms.insert(Atom::Rate(*i), qd[k]);
        atoms.insert(Atom::Acceleration(*i), qdd[k]);
    }
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
            ProgramOp::Unary(function, a) => FloatDomain(|_| 0.0)
                .unary(*function, &at(a))
                .unwrap_or(f64::NAN),
            ProgramOp::Sin(a) => at(a).sin(),
            ProgramOp::Cos(a) => at(a).cos(),
            ProgramOp::Atan2(y, x) => at(y).atan2(at(x)),
        };
        values.push(value);
    }
    values
}

/// Quantities with a meaning and their values; the first of several equal ones gives the name.
fn evaluate_quantities(
    derivation: &Derivation,
    atoms: &BTreeMap<Atom, f64>,
) -> Vec<(FormulaSymbol, f64)> {
    let mut graph = derivation.graph.clone();
    let mut named = trigonometric_quantities(&mut graph, derivation);
    named.extend(motion_quantities(&mut graph, derivation));
    named.extend(link_quantities(&mut graph, derivation));
    named.extend(point_quantities(&mut graph, derivation));
    named.extend(wrench_quantities(&mut graph, derivation));
    let atom = |a: Atom| atoms.get(&a).copied().unwrap_or(f64::NAN);
    let reserved = reserved_names(&derivation.mechanism);
    let mut known: Vec<(FormulaSymbol, f64)> = Vec::new();
    let ids: Vec<ExprId> = named.iter().map(|(_, id)| *id).collect();
    let together = EvaluationTape::new(&graph, &ids).evaluate(&FloatDomain(atom));
    for (k, (symbol, id)) in named.into_iter().enumerate() {
        // Numbers and inputs have names already; so have the negatives of what is named.
        if matches!(graph.node(id), Node::Rational(_) | Node::Atom(_)) {
            continue;
        }
        // One that has no value takes it from all others.
        let value = match &together {
            Some(values) => Some(values[k]),
            None => EvaluationTape::new(&graph, &[id])
                .evaluate(&FloatDomain(atom))
                .map(|v| v[0]),
        };
        let Some(value) = value else {
            continue;
        };
        let taken = known.iter().any(|(s, v)| {
            *s == symbol || (value.abs() - v.abs()).abs() <= RELATIVE_AGREEMENT * v.abs()
        });
        if value.is_finite() && value != 0.0 && !taken && !reserved.contains(&symbol.text()) {
            known.push((symbol, value));
        }
    }
    known
}

/// Names that the model file has taken.
pub(crate) fn reserved_names(mechanism: &Mechanism) -> BTreeSet<String> {
    let mut names: BTreeSet<String> = BTreeSet::new();
    names.extend(mechanism.constants.iter().map(|c| c.name.clone()));
    names.extend(mechanism.parameters.iter().map(|p| p.name.clone()));
    names.extend(mechanism.coordinates.iter().map(|c| c.name.clone()));
    names
}

/// Sines and cosines of sums of angles: `c_theta1_gamma1`.
fn trigonometric_quantities(
    graph: &mut Graph,
    derivation: &Derivation,
) -> Vec<(FormulaSymbol, ExprId)> {
    let projection = &derivation.equations.projection;
    let mechanism = &derivation.mechanism;
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
fn trigonometric_name(
    mechanism: &Mechanism,
    letter: &str,
    angle: &crate::expr::AtomAngleSum,
) -> FormulaSymbol {
    let mut name = letter.to_owned();
    for (atom, n) in angle.terms() {
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

/// Motion of passive coordinates and drives.
fn motion_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let mechanism = &derivation.mechanism;
    let projection = &derivation.equations.projection;
    let mut named = Vec::new();
    for (k, p) in projection.loops.passive.iter().enumerate() {
        let name = &*mechanism.coordinates[*p].name;
        named.push((
            FormulaSymbol::time_derivative(name, 1),
            projection.passive_rates[k],
        ));
        named.push((
            FormulaSymbol::time_derivative(name, 2),
            projection.passive_accelerations[k],
        ));
    }
    for (d, drive) in mechanism.drives.iter().enumerate() {
        if matches!(drive.kind, DriveKind::Joint(_)) {
            continue;
        }
        let motion = &projection.drives[d];
        let name = format!("l_{}", drive.name);
        named.push((FormulaSymbol::new(&*name), motion.coordinate));
        named.push((FormulaSymbol::time_derivative(&*name, 1), motion.rate));
        named.push((
            FormulaSymbol::time_derivative(&*name, 2),
            motion.acceleration,
        ));
        for (a, slope) in projection
            .loops
            .active
            .iter()
            .zip(&projection.drive_jacobian[d])
        {
            let coordinate = &mechanism.coordinates[*a].name;
            named.push((
                FormulaSymbol::new(format!("J_{}_{coordinate}", drive.name)),
                *slope,
            ));
        }
    }
    for (k, id) in projection.determinants.iter().enumerate() {
        named.push((FormulaSymbol::new(format!("Delta_{}", k + 1)), *id));
        let inverse = graph.pow(*id, -1);
        named.push((FormulaSymbol::new(format!("Delta_inv_{}", k + 1)), inverse));
    }
    named
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Angular velocity and acceleration of every frame and the acceleration of its origin, gravity taken off.
fn link_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let mechanism = &derivation.mechanism;
    let tree = &derivation.equations.tree;
    let Ok(gravity) = mechanism
        .gravity
        .iter()
        .map(|g| crate::tree::expressions::expression(graph, g))
        .collect::<Result<Vec<_>, _>>()
    else {
        return Vec::new();
    };
    let still = (
        vector::ZERO,
        vector::ZERO,
        std::array::from_fn(|i| graph.neg(gravity[i])),
    );
    let mut motions: Vec<(SymbolicVector, SymbolicVector, SymbolicVector)> = Vec::new();
    // Acceleration of the place where the joint acts, along the axes of the parent.
    let mut before: Vec<SymbolicVector> = Vec::new();
    for (i, link) in tree.links.iter().enumerate() {
        let (omega_p, alpha_p, a_p) = link.parent.map_or(still, |p| motions[p]);
        let swing = graph.cross(&omega_p, &link.position);
        let centripetal = graph.cross(&omega_p, &swing);
        let tangential = graph.cross(&alpha_p, &link.position);
        let a = graph.add_vectors(&[a_p, tangential, centripetal]);
        before.push(a);
        let mut omega = tree.to_link(graph, i, &omega_p);
        let mut alpha = tree.to_link(graph, i, &alpha_p);
        let mut a = tree.to_link(graph, i, &a);
        for (coordinate, n) in &link.turns {
            let n = crate::expr::Rational::integer(i64::from(*n));
            let [rate, acceleration] = [Atom::Rate(*coordinate), Atom::Acceleration(*coordinate)]
                .map(|atom| graph.atom(atom));
            let turn = [vector::ZERO[0], vector::ZERO[1], graph.scale(rate, &n)];
            let coupled = graph.cross(&omega, &turn);
            alpha = graph.add_vectors(&[alpha, coupled]);
            omega = graph.add_vectors(&[omega, turn]);
            let about = graph.scale(acceleration, &n);
            alpha[2] = graph.add(alpha[2], about);
        }
        for (coordinate, k) in &link.slides {
            let [rate, acceleration] = [Atom::Rate(*coordinate), Atom::Acceleration(*coordinate)]
                .map(|atom| graph.atom(atom));
            let twice = crate::expr::Rational::integer(2);
            let slide = [
                vector::ZERO[0],
                vector::ZERO[1],
                graph.scale(rate, &(k * &twice)),
            ];
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
        for (axis, name) in AXES.iter().enumerate() {
            let of = |letter: &str| format!("{letter}_{}_{name}", frame.name);
            named.push((FormulaSymbol::new(of("omega")), omega[axis]));
            named.push((FormulaSymbol::time_derivative(of("omega"), 1), alpha[axis]));
            named.push((FormulaSymbol::new(of("a")), a[axis]));
        }
        for axis in 0..3 {
            // The matrix that takes a place of the frame to its acceleration: [alpha]x + [omega]x [omega]x.
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            let entry = |i: usize, j: usize| format!("U_{}_{}{}", frame.name, AXES[i], AXES[j]);
            let squares = [j, k].map(|x| graph.mul(omega[x], omega[x]));
            let both = graph.add(squares[0], squares[1]);
            named.push((FormulaSymbol::new(entry(axis, axis)), graph.neg(both)));
            let product = graph.mul(omega[axis], omega[j]);
            named.push((
                FormulaSymbol::new(entry(axis, j)),
                graph.sub(product, alpha[k]),
            ));
            named.push((
                FormulaSymbol::new(entry(j, axis)),
                graph.add(product, alpha[k]),
            ));
        }
        let parent = &mechanism.frames[frame.parent.0].name;
        for (axis, id) in AXES.iter().zip(before[*link]) {
            let name = format!("a_{}_{parent}_{axis}", frame.name);
            named.push((FormulaSymbol::new(name), id));
        }
    }
    named
}

/// What moves every link and all beyond it, with base parameters for the inertia, as its joint transmits it: the force, and
/// the moment about its origin, along its own axes and those from which it turns; and the generalised forces.
fn wrench_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let (mechanism, equations) = (&derivation.mechanism, &derivation.equations);
    let tree = &equations.tree;
    let base = crate::programs::base_parameter_atoms(graph, &derivation.reduction);
    let value = |product: &ParameterMonomial| base.get(product).copied().unwrap_or(Graph::ZERO);
    let plain = TotalForm::PLAIN;
    let frames = RecursionFrames::new(graph, tree, &equations.gravity, plain.style, false);
    let wrenches = plain.wrenches(graph, &equations.inertia, tree, &frames, &value);
    let loads = wrenches.into_iter().map(|(link, _, wrench)| JointLoad {
        link,
        wrench,
        until: None,
    });
    let through = joint_wrenches(graph, tree, loads.collect());
    let mut named = Vec::new();
    for (frame, link) in mechanism.frames.iter().zip(&tree.of_frame) {
        let Some(link) = link else { continue };
        let SymbolicWrench { force, moment } = through[*link];
        let turn = tree.links[*link].absolute.clone();
        let first = tree.links[tree.links[*link].first_parallel].parent;
        let carries = (0..mechanism.frames.len()).rfind(|f| tree.of_frame[*f] == first);
        let carries = carries.map_or("base", |f| mechanism.frames[f].name.as_str());
        for (letter, own) in [("F", force), ("M", moment)] {
            let turned = graph.rotate_out(&turn, &own);
            for (k, axis) in AXES.iter().enumerate() {
                named.push((
                    FormulaSymbol::new(format!("{letter}_{}_{axis}", frame.name)),
                    own[k],
                ));
                let along = format!("{letter}_{}_{carries}_{axis}", frame.name);
                named.push((FormulaSymbol::new(along), turned[k]));
            }
        }
    }
    named
}

/// Places of the points in the base frame, from its origin, from that of their frame, and along the linear drives.
fn point_quantities(graph: &mut Graph, derivation: &Derivation) -> Vec<(FormulaSymbol, ExprId)> {
    let mut mechanism = derivation.mechanism.clone();
    let tree = &derivation.equations.tree;
    let n_points = mechanism.points.len();
    // The origins of the frames are points like others.
    for i in 0..mechanism.frames.len() {
        mechanism.points.push(modelmill_spec::FramePoint {
            name: mechanism.frames[i].name.clone(),
            frame: modelmill_spec::FrameIdx(i),
            at: std::array::from_fn(|_| modelmill_spec::ExactExpression::zero()),
        });
    }
    let places: Option<Vec<SymbolicVector>> = (0..mechanism.points.len())
        .map(|i| crate::loops::stretch::position_in_base(graph, &mechanism, tree, i).ok())
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
    for (point, place) in mechanism.points.iter().zip(&places) {
        name(format!("r_{}", point.name), *place);
    }
    for (point, place) in mechanism.points.iter().zip(&places).take(n_points) {
        let frame = &mechanism.frames[point.frame.0];
        let from = graph.sub_vectors(place, &places[n_points + point.frame.0]);
        name(format!("r_{}_{}", frame.name, point.name), from);
    }
    for joined in &mechanism.loops {
        let [a, b] = joined.joins.map(|p| mechanism.points[p.0].frame.0);
        let between = graph.sub_vectors(&places[n_points + b], &places[n_points + a]);
        let names = [a, b].map(|f| &*mechanism.frames[f].name);
        name(format!("r_{}_{}", names[0], names[1]), between);
    }
    for drive in &mechanism.drives {
        if let DriveKind::Linear { from, to } = drive.kind {
            let along = graph.sub_vectors(&places[to.0], &places[from.0]);
            name(format!("e_{}", drive.name), along);
        }
    }
    named
}
