//! A straight-line program as numbered equations: what is used once is put in place, what is shared gets a name.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::Mechanism;

use super::document::Equation;
use crate::expr::Rational;
use crate::expr::print::{Formula, Function, Symbol, atom};
use crate::lower::{Op, Program, Stage};
use crate::names::Meaning;

/// Equations of a program.
pub(super) struct Listing {
    /// What is computed once per geometry.
    pub(super) fixed: Vec<Equation>,
    /// What is computed at every state, outputs at the end.
    pub(super) state: Vec<Equation>,
}

/// Formulas with more leaves get lines of their own.
const MOST_LEAVES: usize = 16;

/// Lists a program. `names` are those of values that mean something, `reserved` those that are taken,
/// `outputs` those of the outputs, `prefix` begins every tag.
pub(super) fn list(
    program: &Program,
    mechanism: &Mechanism,
    names: &BTreeMap<usize, Meaning>,
    reserved: &BTreeSet<String>,
    outputs: &[Symbol],
    prefix: &str,
) -> Listing {
    let uses = uses(program);
    let mut lister = Lister {
        mechanism,
        taken: reserved.clone(),
        formulas: Vec::with_capacity(program.ops.len()),
        angles: BTreeMap::new(),
        next: [0; 2],
        listing: Listing {
            fixed: Vec::new(),
            state: Vec::new(),
        },
    };
    lister.taken.extend(names.values().map(|m| m.symbol.text()));
    lister.taken.extend(outputs.iter().map(Symbol::text));
    let is_output = |i: usize| program.outputs.iter().any(|o| o.index() == i);
    for (i, op) in program.ops.iter().enumerate() {
        if uses[i].count == 0 {
            lister.formulas.push(Formula::integer(0));
            continue;
        }
        let formula = lister.formula(op);
        let simple = leaves(&formula) < 2;
        let wanted = match op {
            Op::Number(_) | Op::Input(_) | Op::Neg(_) => None,
            _ if names.contains_key(&i) => Some(names[&i].symbol.clone()),
            Op::Sin(a) | Op::Cos(a) => Some(lister.sine(op, a.index())),
            _ if simple => None,
            // An output used nowhere else is written where the outputs are.
            _ if is_output(i) && uses[i].count == 1 => None,
            Op::Atan2(..) | Op::Unary(..) => Some(lister.fresh(program.stages[i])),
            _ if uses[i].count > 1
                || leaves(&formula) > MOST_LEAVES
                || (program.stages[i] == Stage::Fixed && uses[i].by_state) =>
            {
                Some(lister.fresh(program.stages[i]))
            }
            _ => None,
        };
        match wanted {
            Some(symbol) => {
                let negative = names.get(&i).is_some_and(|m| m.negative);
                let turned = |f: Formula| if negative { f.negated() } else { f };
                lister.line(program.stages[i], symbol.clone(), turned(formula));
                lister.formulas.push(turned(Formula::Symbol(symbol)));
            }
            None => lister.formulas.push(formula),
        }
    }
    for (symbol, value) in outputs.iter().zip(&program.outputs) {
        let formula = lister.formulas[value.index()].clone();
        if formula != Formula::Symbol(symbol.clone()) {
            lister.line(Stage::State, symbol.clone(), formula);
        }
    }
    let Listing { fixed, state } = &mut lister.listing;
    for (i, equation) in fixed.iter_mut().chain(state).enumerate() {
        equation.tag = format!("{prefix}{}", i + 1);
    }
    lister.listing
}

#[derive(Clone, Copy, Default)]
struct Uses {
    count: usize,
    /// Whether something that is computed at every state uses it.
    by_state: bool,
}

/// How often each value is used by what is needed.
fn uses(program: &Program) -> Vec<Uses> {
    let mut uses = vec![Uses::default(); program.ops.len()];
    for output in &program.outputs {
        uses[output.index()].count += 1;
    }
    for i in (0..program.ops.len()).rev() {
        if uses[i].count == 0 {
            continue;
        }
        let by_state = program.stages[i] == Stage::State;
        program.ops[i].for_each_operand(|operand| {
            let used = &mut uses[operand.index()];
            used.count += 1;
            used.by_state |= by_state;
        });
    }
    uses
}

struct Lister<'a> {
    mechanism: &'a Mechanism,
    taken: BTreeSet<String>,
    /// Per operation what stands for its value.
    formulas: Vec<Formula>,
    /// Names of angles whose sine or cosine was taken.
    angles: BTreeMap<usize, String>,
    /// Numbers given to nameless values of either stage.
    next: [usize; 2],
    listing: Listing,
}

impl Lister<'_> {
    fn line(&mut self, stage: Stage, left: Symbol, right: Formula) {
        let equation = Equation {
            left: Formula::Symbol(left),
            right,
            tag: String::new(),
            unit: None,
        };
        match stage {
            Stage::Fixed => self.listing.fixed.push(equation),
            Stage::State => self.listing.state.push(equation),
        }
    }

    /// A name for a value without a meaning of its own: k1, k2, ... once per geometry, x1, x2, ... at every state.
    fn fresh(&mut self, stage: Stage) -> Symbol {
        let (letter, counter) = match stage {
            Stage::Fixed => ("k", 0),
            Stage::State => ("x", 1),
        };
        loop {
            self.next[counter] += 1;
            let name = format!("{letter}{}", self.next[counter]);
            if self.taken.insert(name.clone()) {
                return Symbol::new(name);
            }
        }
    }

    /// `s_theta1`, `c_theta1`, ...
    fn sine(&mut self, op: &Op, angle: usize) -> Symbol {
        let letter = if matches!(op, Op::Sin(_)) { "s" } else { "c" };
        if !self.angles.contains_key(&angle) {
            let name = angle_name(&self.formulas[angle])
                .unwrap_or_else(|| format!("angle{}", self.angles.len() + 1));
            self.angles.insert(angle, name);
        }
        let mut name = format!("{letter}_{}", self.angles[&angle]);
        while !self.taken.insert(name.clone()) {
            name.push_str("_v");
        }
        Symbol::new(name)
    }

    fn formula(&self, op: &Op) -> Formula {
        let at = |v: &crate::ValueId| self.formulas[v.index()].clone();
        match op {
            Op::Number(n) => Formula::Number(n.clone()),
            Op::Input(a) => Formula::Symbol(atom(self.mechanism, *a)),
            Op::Add(a, b) if a == b => Formula::product(Rational::integer(2), [at(a)]),
            Op::Add(a, b) => Formula::sum([at(a), at(b)]),
            Op::Sub(a, b) => Formula::sum([at(a), at(b).negated()]),
            Op::Mul(a, b) => Formula::product(Rational::ONE, [at(a), at(b)]),
            Op::Div(a, b) => Formula::quotient(at(a), at(b)),
            Op::Neg(a) => at(a).negated(),
            Op::Unary(function, a) => Formula::apply((*function).into(), at(a)),
            Op::Sin(a) => Formula::apply(Function::Sin, at(a)),
            Op::Cos(a) => Formula::apply(Function::Cos, at(a)),
            Op::Atan2(y, x) => Formula::Apply(Function::Atan2, vec![at(y), at(x)]),
        }
    }
}

/// How many names and numbers a formula has.
fn leaves(formula: &Formula) -> usize {
    match formula {
        Formula::Number(_) | Formula::Symbol(_) | Formula::Indexed(..) => 1,
        Formula::Sum(terms) => terms.iter().map(leaves).sum(),
        Formula::Term {
            factor,
            above,
            below,
        } => {
            let number = usize::from(!factor.abs().is_one());
            number + above.iter().chain(below).map(leaves).sum::<usize>()
        }
        Formula::Power(base, _) => leaves(base) + 1,
        Formula::Apply(_, operands) => operands.iter().map(leaves).sum::<usize>() + 1,
    }
}

/// The names of an angle's summands in a row; `None` if it is no sum of names.
fn angle_name(formula: &Formula) -> Option<String> {
    match formula {
        Formula::Symbol(symbol) => Some(symbol.text()),
        Formula::Sum(terms) => {
            let names: Option<Vec<String>> = terms.iter().map(angle_name).collect();
            Some(names?.join("_"))
        }
        Formula::Term {
            factor,
            above,
            below,
        } if below.is_empty() => {
            let [Formula::Symbol(symbol)] = above.as_slice() else {
                return None;
            };
            let (n, d) = factor.as_small()?;
            let sign = if n < 0 { "m" } else { "" };
            let count = match n.unsigned_abs() {
                1 => String::new(),
                n => n.to_string(),
            };
            (d == 1).then(|| format!("{sign}{count}{}", symbol.text()))
        }
        _ => None,
    }
}
