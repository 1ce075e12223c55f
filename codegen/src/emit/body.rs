//! Bodies of functions: straight-line programs as `let` statements.

use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};

use crate::expr::{Atom, Rational, Unary};
use crate::lower::{Guard, Op, Program, Stage, ValueId};

/// A program as two functions' bodies: what is fixed, and what is computed at every state.
pub(super) struct Body<'a> {
    program: &'a Program,
    /// How an input is written.
    input: &'a dyn Fn(Atom) -> TokenStream,
    names: Vec<Ident>,
    /// Fixed values that the state stage needs, with their place in the array that hands them over.
    handed: Vec<ValueId>,
}

impl<'a> Body<'a> {
    pub(super) fn new(program: &'a Program, input: &'a dyn Fn(Atom) -> TokenStream) -> Self {
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
            .chain(program.guards.iter().map(|g| g.value()))
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
            handed,
        }
    }

    /// How many values the fixed stage hands over.
    pub(super) fn n_fixed(&self) -> usize {
        self.handed.len()
    }

    /// Statements and final expression of the fixed stage: an array.
    pub(super) fn fixed(&self) -> TokenStream {
        let statements = self.statements(Stage::Fixed);
        let values = self.handed.iter().map(|v| &self.names[v.index()]);
        quote! { #(#statements)* [#(#values),*] }
    }

    /// Statements of the state stage, with guards as early returns; `fixed` is the array of [`Self::fixed`].
    pub(super) fn state(&self) -> TokenStream {
        let statements = self.statements(Stage::State);
        quote! { #(#statements)* }
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
        let statements = self.statements(Stage::Fixed);
        quote! { #(#statements)* }
    }

    fn statements(&self, stage: Stage) -> Vec<TokenStream> {
        let mut statements = Vec::new();
        let mut guards: Vec<&Guard> = self.program.guards.iter().collect();
        let emit_guards =
            |upto: usize, statements: &mut Vec<TokenStream>, guards: &mut Vec<&Guard>| {
                guards.retain(|guard| {
                    let ready = guard.value().index() <= upto;
                    if ready {
                        statements.push(self.guard(**guard));
                    }
                    !ready
                });
            };
        for (i, op) in self.program.ops.iter().enumerate() {
            if self.program.stages[i] == stage && !matches!(op, Op::Number(_)) {
                statements.extend(self.statement(stage, i, op));
            }
            if stage == Stage::State {
                emit_guards(i, &mut statements, &mut guards);
            }
        }
        statements
    }

    fn statement(&self, stage: Stage, i: usize, op: &Op) -> Option<TokenStream> {
        let name = &self.names[i];
        let get = |v: &ValueId| self.operand(stage, *v);
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
                    Unary::Sqrt => quote! { #a.sqrt() },
                    Unary::Sign => quote! { #a.sign() },
                    Unary::Abs => quote! { #a.abs() },
                    Unary::Tanh => quote! { #a.tanh() },
                    Unary::Exp => quote! { #a.exp() },
                    Unary::Sin => quote! { #a.sin_cos().0 },
                    Unary::Cos => quote! { #a.sin_cos().1 },
                }
            }
            Op::Atan2(y, x) => {
                let (y, x) = (get(y), get(x));
                quote! { #y.atan2(#x) }
            }
            // The sine is written together with its cosine, which stands right before it if both are needed.
            Op::Sin(a) if i > 0 && self.program.ops[i - 1] == Op::Cos(*a) => {
                let (a, cosine) = (get(a), &self.names[i - 1]);
                return Some(quote! { let (#name, #cosine) = #a.sin_cos(); });
            }
            Op::Sin(a) => {
                let a = get(a);
                quote! { #a.sin_cos().0 }
            }
            Op::Cos(a) => {
                if matches!(self.program.ops.get(i + 1), Some(Op::Sin(b)) if b == a) {
                    return None;
                }
                let a = get(a);
                quote! { #a.sin_cos().1 }
            }
        };
        Some(quote! { let #name = #value; })
    }

    fn guard(&self, guard: Guard) -> TokenStream {
        let value = self.operand(Stage::State, guard.value());
        match guard {
            // Written so that what is no number fails as well.
            Guard::Reachable(_) => {
                quote! { if !(#value >= T::from_f64(0.0)) { return Err(PoseError::OutOfReach); } }
            }
            Guard::Regular(_, limit) => {
                let limit = Literal::f64_unsuffixed(limit);
                quote! { if !(#value.abs() > T::from_f64(#limit)) { return Err(PoseError::Singular); } }
            }
        }
    }

    fn operand(&self, stage: Stage, v: ValueId) -> TokenStream {
        if let Op::Number(value) = &self.program.ops[v.index()] {
            return number(value);
        }
        if stage == Stage::State && self.program.stages[v.index()] == Stage::Fixed {
            let place = self
                .handed
                .iter()
                .position(|h| *h == v)
                .expect("a fixed value that is used is handed over");
            return quote! { fixed[#place] };
        }
        let name = &self.names[v.index()];
        quote! { #name }
    }
}

fn binary(a: &TokenStream, operator: &TokenStream, b: &TokenStream) -> TokenStream {
    quote! { #a #operator #b }
}

/// A number as a value of the type parameter.
pub(super) fn number(value: &Rational) -> TokenStream {
    let magnitude = Literal::f64_unsuffixed(value.to_f64().abs());
    if value.is_negative() {
        quote! { T::from_f64(-#magnitude) }
    } else {
        quote! { T::from_f64(#magnitude) }
    }
}
