//! Bodies of functions: straight-line programs as `let` statements.

use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};

use super::angles::{AnglesFirst, both_of};
use super::order::order;
use crate::expr::{Atom, Rational, Unary};
use crate::lower::{Guard, Op, Program, Stage, ValueId};

/// A program as two functions' bodies: what is fixed, and what is computed at every state.
pub(super) struct Body<'a> {
    /// In the order in which it is written.
    program: Program,
    /// How an input is written.
    input: &'a dyn Fn(Atom) -> TokenStream,
    names: Vec<Ident>,
    /// Products that are written inside the only sum or difference that needs them.
    fused: Vec<bool>,
    /// Fixed values that the state stage needs, with their place in the array that hands them over.
    handed: Vec<ValueId>,
    /// Sines and cosines that may be computed at once, before everything else.
    first: AnglesFirst,
}

/// How many statements a function may have before they are put in groups, and how many make a group.
const LONG: usize = 2000;
const GROUP: usize = 250;

/// A statement with the values that it names and those that it reads.
struct Statement {
    tokens: TokenStream,
    defines: Vec<usize>,
    needs: Vec<usize>,
}

impl Statement {
    fn using(tokens: TokenStream, needs: Vec<usize>) -> Self {
        Self {
            tokens,
            defines: Vec::new(),
            needs,
        }
    }
}

impl<'a> Body<'a> {
    pub(super) fn new(program: &Program, input: &'a dyn Fn(Atom) -> TokenStream) -> Self {
        let (inside, first) = (fused(program), AnglesFirst::of(program));
        let order = order(program, &inside, &first.done);
        let program = program.in_order(&order);
        let fused = order.iter().map(|i| inside[*i]).collect();
        let first = first.in_order(&order);
        let names = (0..program.ops.len())
            .map(|i| format_ident!("v{}", i))
            .collect();
        let mut needed = vec![false; program.ops.len()];
        for (i, op) in program.ops.iter().enumerate() {
            if program.stages[i] == Stage::State {
                op.for_each_operand(|v| needed[v.index()] = true);
            }
        }
        for v in program
            .outputs
            .iter()
            .copied()
            .chain(program.guards.iter().flat_map(|g| g.values()))
        {
            needed[v.index()] = true;
        }
        let handed = (0..program.ops.len())
            .filter(|i| needed[*i] && program.stages[*i] == Stage::Fixed)
            .filter(|i| !matches!(program.ops[*i], Op::Number(_)))
            .map(|i| ValueId(u32::try_from(i).expect("program below 4G operations")))
            .collect();
        Self {
            program,
            input,
            names,
            fused,
            handed,
            first,
        }
    }

    /// How many values the fixed stage hands over.
    pub(super) fn n_fixed(&self) -> usize {
        self.handed.len()
    }

    /// Statements and final expression of the fixed stage: an array.
    pub(super) fn fixed(&self) -> TokenStream {
        let statements = self.statements(Stage::Fixed, false, &self.handed);
        let values = self.handed.iter().map(|v| &self.names[v.index()]);
        quote! { let n = &One::<T>::new(); #(#statements)* [#(#values),*] }
    }

    /// Statements of the state stage, with guards as early returns; `fixed` is the array of [`Self::fixed`], and `n` the
    /// arithmetic.
    pub(super) fn state(&self) -> TokenStream {
        let statements = self.statements(Stage::State, false, &self.program.outputs);
        quote! { #(#statements)* }
    }

    /// The same with each output put into `outputs` as soon as it is known, so that none is kept for long; those that are
    /// zero are left as they are.
    pub(super) fn state_with_outputs(&self) -> TokenStream {
        let fixed = self.program.outputs.iter().enumerate().filter(|(_, v)| {
            let op = &self.program.ops[v.index()];
            let zero = matches!(op, Op::Number(x) if x.is_zero());
            self.program.stages[v.index()] == Stage::Fixed && !zero
        });
        let fixed = fixed.map(|(k, v)| self.put(k, *v));
        let statements = self.statements(Stage::State, true, &[]);
        quote! { #(#fixed)* #(#statements)* }
    }

    fn put(&self, k: usize, v: ValueId) -> TokenStream {
        let value = self.operand(Stage::State, v);
        quote! { outputs.put(#k, #value); }
    }

    /// An output, after the statements of the state stage.
    pub(super) fn output(&self, k: usize) -> TokenStream {
        self.operand(Stage::State, self.program.outputs[k])
    }

    /// An output right after the statements of the fixed stage.
    pub(super) fn fixed_output(&self, k: usize) -> TokenStream {
        self.operand(Stage::Fixed, self.program.outputs[k])
    }

    /// Statements of the fixed stage alone.
    pub(super) fn fixed_statements(&self) -> TokenStream {
        let statements = self.statements(Stage::Fixed, false, &self.program.outputs);
        quote! { let n = &One::<T>::new(); #(#statements)* }
    }

    /// All statements of a stage, with those values in scope at the end that are kept.
    fn statements(&self, stage: Stage, put: bool, kept: &[ValueId]) -> Vec<TokenStream> {
        let mut puts: Vec<Vec<usize>> = vec![Vec::new(); self.program.ops.len()];
        for (k, v) in self.program.outputs.iter().enumerate() {
            if put && self.program.stages[v.index()] == stage {
                puts[v.index()].push(k);
            }
        }
        let mut late = Vec::new();
        let mut statements: Vec<Statement> = Vec::new();
        let mut guards: Vec<&Guard> = self.program.guards.iter().collect();
        let emit_guards =
            |upto: usize, statements: &mut Vec<Statement>, guards: &mut Vec<&Guard>| {
                guards.retain(|guard| {
                    let ready = guard.value().index() <= upto;
                    if ready {
                        let needs = self.needed_names(stage, [guard.value()]);
                        statements.push(Statement::using(self.guard(**guard), needs));
                    }
                    !ready
                });
            };
        for (i, op) in self.program.ops.iter().enumerate() {
            // A cosine is written with the sine after it; what needs it comes then.
            let pair =
                |a: &Op, b: Option<&Op>| matches!((a, b), (Op::Cos(a), Some(Op::Sin(b))) if a == b);
            let ops = &self.program.ops;
            let written = stage == Stage::State && self.first.done[i];
            if self.program.stages[i] == stage
                && !matches!(op, Op::Number(_))
                && !written
                && let Some(tokens) = self.statement(stage, i, op)
            {
                let mut operands = Vec::new();
                op.for_each_operand(|v| operands.push(v));
                let mut defines = vec![i];
                if i > 0 && pair(&ops[i - 1], Some(op)) {
                    defines.push(i - 1);
                }
                statements.push(Statement {
                    tokens,
                    defines,
                    needs: self.needed_names(stage, operands),
                });
            }
            if pair(op, ops.get(i + 1)) {
                late.extend(puts[i].iter().map(|k| (*k, i)));
                continue;
            }
            if stage == Stage::State {
                emit_guards(i, &mut statements, &mut guards);
            }
            for (k, i) in late.drain(..).chain(puts[i].iter().map(|k| (*k, i))) {
                let v = ValueId(u32::try_from(i).expect("program below 4G operations"));
                let needs = self.needed_names(stage, [v]);
                statements.push(Statement::using(self.put(k, v), needs));
            }
        }
        let needed = self.needed_names(stage, kept.iter().copied());
        let mut all = match stage {
            Stage::State => self.angles_first(),
            Stage::Fixed => Vec::new(),
        };
        all.extend(self.in_groups(statements, needed));
        all
    }

    /// Names that are read where some values are, products that are written inside sums opened.
    fn needed_names(&self, stage: Stage, values: impl IntoIterator<Item = ValueId>) -> Vec<usize> {
        let mut open: Vec<ValueId> = values.into_iter().collect();
        let mut needed = Vec::new();
        while let Some(v) = open.pop() {
            let i = v.index();
            if self.fused[i] {
                self.program.ops[i].for_each_operand(|v| open.push(v));
            } else if self.program.stages[i] == stage {
                needed.push(i);
            }
        }
        needed
    }

    /// Long programs in groups of statements, each a block that hands on what later ones need: every `let` opens a scope
    /// inside the one before, and the compiler, which writes debug information scope by scope into each other, runs out of
    /// stack where there are many thousands.
    fn in_groups(&self, statements: Vec<Statement>, kept: Vec<usize>) -> Vec<TokenStream> {
        if statements.len() <= LONG {
            return statements.into_iter().map(|s| s.tokens).collect();
        }
        let mut last_need = vec![0; self.program.ops.len()];
        for (k, statement) in statements.iter().enumerate() {
            for v in &statement.needs {
                last_need[*v] = k / GROUP;
            }
        }
        for v in kept {
            last_need[v] = usize::MAX;
        }
        let groups = statements.chunks(GROUP).enumerate();
        groups
            .map(|(g, group)| {
                let tokens = group.iter().map(|s| &s.tokens);
                let defined = group.iter().flat_map(|s| &s.defines);
                let handed = defined.filter(|v| last_need[**v] > g);
                let handed: Vec<&Ident> = handed.map(|v| &self.names[*v]).collect();
                if handed.is_empty() {
                    quote! { { #(#tokens)* } }
                } else {
                    quote! { let [#(#handed),*] = { #(#tokens)* [#(#handed),*] }; }
                }
            })
            .collect()
    }

    /// The angles that come first, and what the arithmetic makes of them all at once.
    fn angles_first(&self) -> Vec<TokenStream> {
        if self.first.sines.is_empty() {
            return Vec::new();
        }
        let ops = self.program.ops.iter().enumerate();
        let made = ops.filter(|(i, op)| {
            self.first.done[*i]
                && self.program.stages[*i] == Stage::State
                && !matches!(op, Op::Number(_))
        });
        let mut statements: Vec<TokenStream> = made
            .filter_map(|(i, op)| self.statement(Stage::State, i, op))
            .collect();
        let name = |name: Ident| quote! { #name };
        let (mut sines, mut cosines): (Vec<TokenStream>, Vec<TokenStream>) =
            (0..self.first.sines.len())
                .map(both_of)
                .map(|(s, c)| (name(s), name(c)))
                .unzip();
        let angles = self.first.sines.iter();
        let angles = angles.filter_map(|i| match &self.program.ops[*i] {
            Op::Sin(angle) => Some(self.operand(Stage::State, *angle)),
            _ => None,
        });
        let mut angles: Vec<TokenStream> = angles.collect();
        // The compiler makes pairs only of a number of angles that is even.
        if angles.len() % 2 == 1 {
            angles.extend(angles.last().cloned());
            sines.push(quote!(_));
            cosines.push(quote!(_));
        }
        statements.push(quote! {
            let ([#(#sines),*], [#(#cosines),*]) = n.angles([#(#angles),*]);
        });
        statements
    }

    fn statement(&self, stage: Stage, i: usize, op: &Op) -> Option<TokenStream> {
        let name = &self.names[i];
        let get = |v: &ValueId| self.operand(stage, *v);
        if self.fused[i] {
            return None;
        }
        if let Some(value) = self.fused_sum(stage, op) {
            return Some(quote! { let #name = #value; });
        }
        let value = match op {
            Op::Number(_) => return None,
            Op::Input(atom) => (self.input)(*atom),
            Op::Add(a, b) => binary(&get(a), &quote!(+), &get(b)),
            Op::Sub(a, b) => binary(&get(a), &quote!(-), &get(b)),
            Op::Mul(a, b) => binary(&get(a), &quote!(*), &get(b)),
            Op::Div(a, b) => binary(&get(a), &quote!(/), &get(b)),
            Op::Neg(a) => {
                let a = get(a);
                quote! { -#a }
            }
            Op::Unary(function, a) => {
                let a = get(a);
                match function {
                    Unary::Sqrt => quote! { n.sqrt(#a) },
                    Unary::Sign => quote! { n.sign(#a) },
                    Unary::Abs => quote! { n.abs(#a) },
                    Unary::Tanh => quote! { n.tanh(#a) },
                    Unary::Exp => quote! { n.exp(#a) },
                    Unary::Sin => quote! { n.sin_cos(#a).0 },
                    Unary::Cos => quote! { n.sin_cos(#a).1 },
                }
            }
            Op::Atan2(y, x) => {
                let (y, x) = (get(y), get(x));
                quote! { n.atan2(#y, #x) }
            }
            // The sine is written together with its cosine, which stands right before it if both are needed.
            Op::Sin(a) if i > 0 && self.program.ops[i - 1] == Op::Cos(*a) => {
                let (a, cosine) = (get(a), &self.names[i - 1]);
                if let Some(k) = self.first.sines.iter().position(|sine| *sine == i) {
                    let (s, c) = both_of(k);
                    return Some(quote! { let (#name, #cosine) = n.sin_cos_of(#s, #c); });
                }
                return Some(quote! { let (#name, #cosine) = n.sin_cos(#a); });
            }
            Op::Sin(a) => {
                let a = get(a);
                quote! { n.sin_cos(#a).0 }
            }
            Op::Cos(a) => {
                if matches!(self.program.ops.get(i + 1), Some(Op::Sin(b)) if b == a) {
                    return None;
                }
                let a = get(a);
                quote! { n.sin_cos(#a).1 }
            }
        };
        Some(quote! { let #name = #value; })
    }

    /// A sum or difference with the product that is written inside it.
    fn fused_sum(&self, stage: Stage, op: &Op) -> Option<TokenStream> {
        let get = |v: &ValueId| self.operand(stage, *v);
        let product = |v: &ValueId| match &self.program.ops[v.index()] {
            Op::Mul(x, y) if self.fused[v.index()] => Some((get(x), get(y))),
            _ => None,
        };
        match op {
            Op::Add(a, b) => {
                let (other, (x, y)) = product(b)
                    .map(|p| (a, p))
                    .or_else(|| Some((b, product(a)?)))?;
                let other = get(other);
                Some(quote! { n.mul_add(#x, #y, #other) })
            }
            Op::Sub(a, b) => {
                if let Some((x, y)) = product(b) {
                    let a = get(a);
                    return Some(quote! { n.sub_mul(#a, #x, #y) });
                }
                let ((x, y), b) = (product(a)?, get(b));
                Some(quote! { n.mul_sub(#x, #y, #b) })
            }
            _ => None,
        }
    }

    fn guard(&self, guard: Guard) -> TokenStream {
        let value = self.operand(Stage::State, guard.value());
        match guard {
            Guard::Reachable(_) => quote! { n.reachable(#value)?; },
            Guard::Regular(_, size) => {
                let size = match &self.program.ops[size.index()] {
                    Op::Number(size) => {
                        let size = Literal::f64_unsuffixed(size.to_f64());
                        quote! { T::from_f64(#size) }
                    }
                    _ => self.handed_over(size),
                };
                quote! { n.regular(#value, #size)?; }
            }
            Guard::Finite(_) => quote! { n.finite(#value)?; },
        }
    }

    /// A value of the fixed stage where the state stage needs it.
    fn handed_over(&self, v: ValueId) -> TokenStream {
        let place = self.handed.iter().position(|h| *h == v);
        let place = place.expect("a fixed value that is used is handed over");
        quote! { fixed[#place] }
    }

    fn operand(&self, stage: Stage, v: ValueId) -> TokenStream {
        if let Op::Number(value) = &self.program.ops[v.index()] {
            return number(value);
        }
        if stage == Stage::State && self.program.stages[v.index()] == Stage::Fixed {
            let value = self.handed_over(v);
            return quote! { n.of(#value) };
        }
        let name = &self.names[v.index()];
        quote! { #name }
    }
}

/// Products of the state stage that one sum or difference needs and nothing else; of two, the later one.
fn fused(program: &Program) -> Vec<bool> {
    let mut uses = vec![0; program.ops.len()];
    for op in &program.ops {
        op.for_each_operand(|v| uses[v.index()] += 1);
    }
    let kept = program.outputs.iter().copied();
    for v in kept.chain(program.guards.iter().flat_map(|g| g.values())) {
        uses[v.index()] += 2;
    }
    let mut fused = vec![false; program.ops.len()];
    for (op, stage) in program.ops.iter().zip(&program.stages) {
        let (Op::Add(a, b) | Op::Sub(a, b)) = op else {
            continue;
        };
        let single = |v: ValueId| {
            let i = v.index();
            *stage == Stage::State
                && uses[i] == 1
                && program.stages[i] == Stage::State
                && matches!(program.ops[i], Op::Mul(..))
        };
        let (early, late) = if a.index() < b.index() {
            (a, b)
        } else {
            (b, a)
        };
        if let Some(product) = [late, early].into_iter().find(|v| single(**v)) {
            fused[product.index()] = true;
        }
    }
    fused
}

fn binary(a: &TokenStream, operator: &TokenStream, b: &TokenStream) -> TokenStream {
    quote! { #a #operator #b }
}

/// A number as a value of the program.
fn number(value: &Rational) -> TokenStream {
    let magnitude = Literal::f64_unsuffixed(value.to_f64().abs());
    if value.is_negative() {
        quote! { n.number(-#magnitude) }
    } else {
        quote! { n.number(#magnitude) }
    }
}
