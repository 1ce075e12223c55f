//! A straight-line program as numbered equations. Intermediate values used more than once get names; the others are
//! inline.
//! A `StraightLineProgram` and names for known quantities go in, `ProgramListing` comes out.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::Mechanism;

use super::document::PageEquation;
use crate::expr::Rational;
use crate::expr::print::{FormulaFunction, FormulaSymbol, PrintedFormula, atom};
use crate::lower::{ProgramOp, ProgramStage, StraightLineProgram};
use crate::names::QuantityName;

/// Equations of a program by stage, in the order of computation.
pub(super) struct ProgramListing {
    /// Equations that are evaluated once per geometry.
    pub(super) fixed: Vec<PageEquation>,
    /// Equations that are evaluated at every state, outputs at the end.
    pub(super) state: Vec<PageEquation>,
}

/// Formulas with more leaves than this get a line of their own, even if they are used once.
const MOST_LEAVES: usize = 16;

/// Lists a program.
///
/// `names` are the symbols of known quantities by value index, `reserved` are names that may not be used, `outputs` are
/// the symbols of the outputs in order, and `prefix` begins every tag.
pub(super) fn list_program(
    program: &StraightLineProgram,
    mechanism: &Mechanism,
    names: &BTreeMap<usize, QuantityName>,
    reserved: &BTreeSet<String>,
    outputs: &[FormulaSymbol],
    prefix: &str,
) -> ProgramListing {
    // How often a value is used decides whether it gets a name.
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
    // Names of quantities and outputs are taken before any name is generated.
    lister.taken.extend(names.values().map(|m| m.symbol.text()));
    // Symbols of outputs are taken as well.
    lister.taken.extend(outputs.iter().map(FormulaSymbol::text));
    // Whether a value is an output.
    let is_output = |i: usize| program.outputs.iter().any(|o| o.index() == i);
    // Values in order: each becomes a formula, and an equation if it gets a name.
    for (i, op) in program.ops.iter().enumerate() {
        // Unused values keep a place, so that indices stay aligned.
        if uses[i].count == 0 {
            lister.formulas.push(PrintedFormula::integer(0));
            continue;
        }
        // The formula with operands inlined or named.
        let formula = lister.formula(op);
        // A single name or number needs no name of its own.
        let simple = count_leaves(&formula) < 2;
        // Whether the value gets a name, and which: known quantity, sine or cosine, shared, long, or used by a later
        // stage.
        let wanted = match op {
            ProgramOp::Number(_) | ProgramOp::Input(_) | ProgramOp::Neg(_) => None,
            _ if names.contains_key(&i) => Some(names[&i].symbol.clone()),
            ProgramOp::Sin(a) | ProgramOp::Cos(a) => Some(lister.trigonometric_symbol(op, a.index())),
            _ if simple => None,
            // An output used nowhere else is written where the outputs are.
            _ if is_output(i) && uses[i].count == 1 => None,
            // Functions always have a line of their own, because their arguments are long.
            ProgramOp::Atan2(..) | ProgramOp::Unary(..) => Some(lister.next_symbol(program.stages[i])),
            _ if uses[i].count > 1
                || count_leaves(&formula) > MOST_LEAVES
                || (program.stages[i] == ProgramStage::Fixed && uses[i].by_state) =>
            {
                Some(lister.next_symbol(program.stages[i]))
            }
            _ => None,
        };
        // A named value becomes an equation, all others stay formulas.
        match wanted {
            // The named quantity may be the negative of this value; then the equation and its uses change sign.
            Some(symbol) => {
                let negative = names.get(&i).is_some_and(|m| m.negative);
                let turned = |f: PrintedFormula| if negative { f.negate() } else { f };
                lister.add_equation(program.stages[i], symbol.clone(), turned(formula));
                lister.formulas.push(turned(PrintedFormula::Symbol(symbol)));
            }
            None => lister.formulas.push(formula),
        }
    }
    // Outputs that are not yet the left side of an equation get one.
    for (symbol, value) in outputs.iter().zip(&program.outputs) {
        let formula = lister.formulas[value.index()].clone();
        if formula != PrintedFormula::Symbol(symbol.clone()) {
            lister.add_equation(ProgramStage::State, symbol.clone(), formula);
        }
    }
    // Numbers run through both stages.
    let ProgramListing { fixed, state } = &mut lister.listing;
    for (i, equation) in fixed.iter_mut().chain(state).enumerate() {
        equation.tag = format!("{prefix}{}", i + 1);
    }
    lister.listing
}

/// How a value is used.
#[derive(Clone, Copy, Default)]
struct ValueUses {
    /// Number of uses by needed operations and by outputs.
    count: usize,
    /// Whether an operation that is evaluated at every state uses it.
    by_state: bool,
}

/// Uses per value, counted backwards from the outputs; unneeded operations count for nothing.
fn count_uses(program: &StraightLineProgram) -> Vec<ValueUses> {
    let mut uses = vec![ValueUses::default(); program.ops.len()];
    for output in &program.outputs {
        uses[output.index()].count += 1;
    }
    for i in (0..program.ops.len()).rev() {
        // Operations that nothing needs do not count as users.
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

/// State of the listing while values are visited in order.
struct ListingBuilder<'a> {
    /// For the names of inputs.
    mechanism: &'a Mechanism,
    /// Names that may not be generated again.
    taken: BTreeSet<String>,
    /// Per value the formula or the symbol by which later equations refer to it.
    formulas: Vec<PrintedFormula>,
    /// Names of angles whose sine or cosine has been named, by value index.
    angles: BTreeMap<usize, String>,
    /// Counters of generated names: `k1`, `k2`, ... and `x1`, `x2`, ...
    next: [usize; 2],
    /// The equations so far; tags are set at the end.
    listing: ProgramListing,
}

impl ListingBuilder<'_> {
    /// Appends `left = right` to the equations of the stage.
    fn add_equation(&mut self, stage: ProgramStage, left: FormulaSymbol, right: PrintedFormula) {
        // The tag is not known before the listing is complete.
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
        // Numbers of both stages are independent.
        let (letter, counter) = match stage {
            ProgramStage::Fixed => ("k", 0),
            ProgramStage::State => ("x", 1),
        };
        // A number that the model uses as a name is skipped.
        loop {
            self.next[counter] += 1;
            let name = format!("{letter}{}", self.next[counter]);
            if self.taken.insert(name.clone()) {
                return FormulaSymbol::new(name);
            }
        }
    }

    /// A symbol for a sine or cosine: `s_theta1`, `c_theta1`, ... An angle that is no sum of names is numbered.
    fn trigonometric_symbol(&mut self, op: &ProgramOp, angle: usize) -> FormulaSymbol {
        // The same angle may have a sine and a cosine.
        let letter = if matches!(op, ProgramOp::Sin(_)) { "s" } else { "c" };
        // The name of an angle is the same for its sine and cosine.
        if !self.angles.contains_key(&angle) {
            let name = angle_name(&self.formulas[angle]).unwrap_or_else(|| format!("angle{}", self.angles.len() + 1));
            self.angles.insert(angle, name);
        }
        let mut name = format!("{letter}_{}", self.angles[&angle]);
        while !self.taken.insert(name.clone()) {
            name.push_str("_v");
        }
        FormulaSymbol::new(name)
    }

    /// The formula of an operation, with the formulas of its operands in place.
    fn formula(&self, op: &ProgramOp) -> PrintedFormula {
        // Operands as formulas or symbols.
        let at = |v: &crate::ValueId| self.formulas[v.index()].clone();
        match op {
            ProgramOp::Number(n) => PrintedFormula::Number(n.clone()),
            ProgramOp::Input(a) => PrintedFormula::Symbol(atom(self.mechanism, *a)),
            ProgramOp::Add(a, b) if a == b => PrintedFormula::product(Rational::integer(2), [at(a)]),
            ProgramOp::Add(a, b) => PrintedFormula::sum([at(a), at(b)]),
            ProgramOp::Sub(a, b) => PrintedFormula::sum([at(a), at(b).negate()]),
            ProgramOp::Mul(a, b) => PrintedFormula::product(Rational::ONE, [at(a), at(b)]),
            ProgramOp::Div(a, b) => PrintedFormula::quotient(at(a), at(b)),
            ProgramOp::Neg(a) => at(a).negate(),
            ProgramOp::Unary(function, a) => PrintedFormula::apply((*function).into(), at(a)),
            ProgramOp::Sin(a) => PrintedFormula::apply(FormulaFunction::Sin, at(a)),
            ProgramOp::Cos(a) => PrintedFormula::apply(FormulaFunction::Cos, at(a)),
            ProgramOp::Atan2(y, x) => PrintedFormula::Apply(FormulaFunction::Atan2, vec![at(y), at(x)]),
        }
    }
}

/// Number of names, numbers and function calls in a formula: a measure of its length.
fn count_leaves(formula: &PrintedFormula) -> usize {
    match formula {
        PrintedFormula::Number(_) | PrintedFormula::Symbol(_) | PrintedFormula::Indexed(..) => 1,
        PrintedFormula::Sum(terms) => terms.iter().map(count_leaves).sum(),
        PrintedFormula::Term { factor, above, below } => {
            // A factor of one is not printed.
            let number = usize::from(!factor.abs().is_one());
            number + above.iter().chain(below).map(count_leaves).sum::<usize>()
        }
        PrintedFormula::Power(base, _) => count_leaves(base) + 1,
        PrintedFormula::Apply(_, operands) => operands.iter().map(count_leaves).sum::<usize>() + 1,
    }
}

/// The names of an angle's summands, joined by `_`; `None` if the angle is no sum of names with integer factors.
fn angle_name(formula: &PrintedFormula) -> Option<String> {
    match formula {
        PrintedFormula::Symbol(symbol) => Some(symbol.text()),
        PrintedFormula::Sum(terms) => {
            let names: Option<Vec<String>> = terms.iter().map(angle_name).collect();
            Some(names?.join("_"))
        }
        PrintedFormula::Term { factor, above, below } if below.is_empty() => {
            let [PrintedFormula::Symbol(symbol)] = above.as_slice() else {
                return None;
            };
            // An integer factor is part of the name: `2theta1`, `mtheta1` for minus.
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
