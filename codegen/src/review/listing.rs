//! A straight-line program as numbered equations: what is used once is put in place, what is shared gets a name.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::Mechanism;

use super::document::PageEquation;
use crate::expr::Rational;
use crate::expr::print::{FormulaFunction, FormulaSymbol, PrintedFormula, atom};
use crate::lower::{ProgramOp, ProgramStage, StraightLineProgram};
use crate::names::QuantityName;

/// Equations of a program.
pub(super) struct ProgramListing {
    /// What is computed once per geometry.
    pub(super) fixed: Vec<PageEquation>,
    /// What is computed at every state, outputs at the end.
    pub(super) state: Vec<PageEquation>,
}

/// Formulas with more leaves get lines of their own.
const MOST_LEAVES: usize = 16;

/// Lists a program. `names` are those of values that mean something, `reserved` those that are taken,
/// `outputs` those of the outputs, `prefix` begins every tag.
pub(super) fn list_program(
    program: &StraightLineProgram,
    mechanism: &Mechanism,
    names: &BTreeMap<usize, QuantityName>,
    reserved: &BTreeSet<String>,
    outputs: &[FormulaSymbol],
    prefix: &str,
) -> ProgramListing {
    let uses = count_uses(program);
    let mut lister = ListingBuilder {
        mechanism,
        taken: reserved.clone(),
        formulas: Vec::with_capacity(program.ops.len()),
        angles: BTreeMap::new(),
        next: [0; 2],
        listing: ProgramListing {
            fixed: Vec::new(),
            state: Vec::new(),
        },
    };
    lister.taken.extend(names.values().map(|m| m.symbol.text()));
    lister.taken.extend(outputs.iter().map(FormulaSymbol::text));
    let is_output = |i: usize| program.outputs.iter().any(|o| o.index() == i);
    for (i, op) in program.ops.iter().enumerate() {
        if uses[i].count == 0 {
            lister.formulas.push(PrintedFormula::integer(0));
            continue;
        }
        let formula = lister.formula(op);
        let simple = count_leaves(&formula) < 2;
        let wanted = match op {
            ProgramOp::Number(_) | ProgramOp::Input(_) | ProgramOp::Neg(_) => None,
            _ if names.contains_key(&i) => Some(names[&i].symbol.clone()),
            ProgramOp::Sin(a) | ProgramOp::Cos(a) => {
                Some(lister.trigonometric_symbol(op, a.index()))
            }
            _ if simple => None,
            // An output used nowhere else is written where the outputs are.
            _ if is_output(i) && uses[i].count == 1 => None,
            ProgramOp::Atan2(..) | ProgramOp::Unary(..) => {
                Some(lister.next_symbol(program.stages[i]))
            }
            _ if uses[i].count > 1
                || count_leaves(&formula) > MOST_LEAVES
                || (program.stages[i] == ProgramStage::Fixed && uses[i].by_state) =>
            {
                Some(lister.next_symbol(program.stages[i]))
            }
            _ => None,
        };
        match wanted {
            Some(symbol) => {
                let negative = names.get(&i).is_some_and(|m| m.negative);
                let turned = |f: PrintedFormula| if negative { f.negate() } else { f };
                lister.add_equation(program.stages[i], symbol.clone(), turned(formula));
                lister.formulas.push(turned(PrintedFormula::Symbol(symbol)));
            }
            None => lister.formulas.push(formula),
        }
    }
    for (symbol, value) in outputs.iter().zip(&program.outputs) {
        let formula = lister.formulas[value.index()].clone();
        if formula != PrintedFormula::Symbol(symbol.clone()) {
            lister.add_equation(ProgramStage::State, symbol.clone(), formula);
        }
    }
    let ProgramListing { fixed, state } = &mut lister.listing;
    for (i, equation) in fixed.iter_mut().chain(state).enumerate() {
        equation.tag = format!("{prefix}{}", i + 1);
    }
    lister.listing
}

#[derive(Clone, Copy, Default)]
struct ValueUses {
    count: usize,
    /// Whether something that is computed at every state uses it.
    by_state: bool,
}

/// How often each value is used by what is needed.
fn count_uses(program: &StraightLineProgram) -> Vec<ValueUses> {
    let mut uses = vec![ValueUses::default(); program.ops.len()];
    for output in &program.outputs {
        uses[output.index()].count += 1;
    }
    for i in (0..program.ops.len()).rev() {
        if uses[i].count == 0 {
            continue;
        }
        let by_state = program.stages[i] == ProgramStage::State;
        program.ops[i].for_each_operand(|operand| {
            let used = &mut uses[operand.index()];
            used.count += 1;
            used.by_state |= by_state;
        });
    }
    uses
}

struct ListingBuilder<'a> {
    mechanism: &'a Mechanism,
    taken: BTreeSet<String>,
    /// Per operation what stands for its value.
    formulas: Vec<PrintedFormula>,
    /// Names of angles whose sine or cosine was taken.
    angles: BTreeMap<usize, String>,
    /// Numbers given to nameless values of either stage.
    next: [usize; 2],
    listing: ProgramListing,
}

impl ListingBuilder<'_> {
    fn add_equation(&mut self, stage: ProgramStage, left: FormulaSymbol, right: PrintedFormula) {
        let equation = PageEquation {
            left: PrintedFormula::Symbol(left),
            right,
            tag: String::new(),
            unit: None,
        };
        match stage {
            ProgramStage::Fixed => self.listing.fixed.push(equation),
            ProgramStage::State => self.listing.state.push(equation),
        }
    }

    /// A name for a value without a meaning of its own: k1, k2, ... once per geometry, x1, x2, ... at every state.
    fn next_symbol(&mut self, stage: ProgramStage) -> FormulaSymbol {
        let (letter, counter) = match stage {
            ProgramStage::Fixed => ("k", 0),
            ProgramStage::State => ("x", 1),
        };
        loop {
            self.next[counter] += 1;
            let name = format!("{letter}{}", self.next[counter]);
            if self.taken.insert(name.clone()) {
                return FormulaSymbol::new(name);
            }
        }
    }

    /// `s_theta1`, `c_theta1`, ...
    fn trigonometric_symbol(&mut self, op: &ProgramOp, angle: usize) -> FormulaSymbol {
        let letter = if matches!(op, ProgramOp::Sin(_)) {
            "s"
        } else {
            "c"
        };
        if !self.angles.contains_key(&angle) {
            let name = angle_name(&self.formulas[angle])
                .unwrap_or_else(|| format!("angle{}", self.angles.len() + 1));
            self.angles.insert(angle, name);
        }
        let mut name = format!("{letter}_{}", self.angles[&angle]);
        while !self.taken.insert(name.clone()) {
            name.push_str("_v");
        }
        FormulaSymbol::new(name)
    }

    fn formula(&self, op: &ProgramOp) -> PrintedFormula {
        let at = |v: &crate::ValueId| self.formulas[v.index()].clone();
        match op {
            ProgramOp::Number(n) => PrintedFormula::Number(n.clone()),
            ProgramOp::Input(a) => PrintedFormula::Symbol(atom(self.mechanism, *a)),
            ProgramOp::Add(a, b) if a == b => {
                PrintedFormula::product(Rational::integer(2), [at(a)])
            }
            ProgramOp::Add(a, b) => PrintedFormula::sum([at(a), at(b)]),
            ProgramOp::Sub(a, b) => PrintedFormula::sum([at(a), at(b).negate()]),
            ProgramOp::Mul(a, b) => PrintedFormula::product(Rational::ONE, [at(a), at(b)]),
            ProgramOp::Div(a, b) => PrintedFormula::quotient(at(a), at(b)),
            ProgramOp::Neg(a) => at(a).negate(),
            ProgramOp::Unary(function, a) => PrintedFormula::apply((*function).into(), at(a)),
            ProgramOp::Sin(a) => PrintedFormula::apply(FormulaFunction::Sin, at(a)),
            ProgramOp::Cos(a) => PrintedFormula::apply(FormulaFunction::Cos, at(a)),
            ProgramOp::Atan2(y, x) => {
                PrintedFormula::Apply(FormulaFunction::Atan2, vec![at(y), at(x)])
            }
        }
    }
}

/// How many names and numbers a formula has.
fn count_leaves(formula: &PrintedFormula) -> usize {
    match formula {
        PrintedFormula::Number(_) | PrintedFormula::Symbol(_) | PrintedFormula::Indexed(..) => 1,
        PrintedFormula::Sum(terms) => terms.iter().map(count_leaves).sum(),
        PrintedFormula::Term {
            factor,
            above,
            below,
        } => {
            let number = usize::from(!factor.abs().is_one());
            number + above.iter().chain(below).map(count_leaves).sum::<usize>()
        }
        PrintedFormula::Power(base, _) => count_leaves(base) + 1,
        PrintedFormula::Apply(_, operands) => operands.iter().map(count_leaves).sum::<usize>() + 1,
    }
}

/// The names of an angle's summands in a row; `None` if it is no sum of names.
fn angle_name(formula: &PrintedFormula) -> Option<String> {
    match formula {
        PrintedFormula::Symbol(symbol) => Some(symbol.text()),
        PrintedFormula::Sum(terms) => {
            let names: Option<Vec<String>> = terms.iter().map(angle_name).collect();
            Some(names?.join("_"))
        }
        PrintedFormula::Term {
            factor,
            above,
            below,
        } if below.is_empty() => {
            let [PrintedFormula::Symbol(symbol)] = above.as_slice() else {
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
