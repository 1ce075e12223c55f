//! Every pass keeps the value of each output, and printed numbers of operations equal a count in the source.

use std::path::Path;

use modelmill_algebra::field::{FieldElement, RandomStream};
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens as _;

use super::{PASSES, ProgramOp, ProgramStage, cost};
use crate::expr::{Atom, EvaluationTape, ExprId, FieldPoint, Graph};
use crate::{Derivation, derive};

fn derivation(model: &str) -> Derivation {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../model-spec/models")
        .join(model);
    let loaded = modelmill_spec::load_file(&path).unwrap_or_else(|failure| panic!("{failure}"));
    derive(&loaded.mechanism).unwrap_or_else(|error| panic!("{error}"))
}

/// Values of some expressions at a random point of the field, with independent values of all atoms.
fn values(graph: &Graph, roots: &[ExprId], seed: u64) -> Vec<FieldElement> {
    let mut stream = RandomStream::new(seed);
    loop {
        let mut point = FieldPoint {
            root_seed: seed,
            seed,
            ..FieldPoint::default()
        };
        // One draw per possible atom, so that different roots see the same point.
        for kind in [
            Atom::Constant,
            Atom::Parameter,
            Atom::Base,
            Atom::Coordinate,
            Atom::Rate,
            Atom::Acceleration,
        ] {
            for i in 0..80 {
                point.values.insert(kind(i), stream.next_element());
                point.angles.insert(kind(i), stream.next_circle_point());
            }
        }
        if let Some(values) = EvaluationTape::new(graph, roots).evaluate(&point) {
            return values;
        }
    }
}

#[test]
fn every_pass_keeps_the_value_of_each_output() {
    for model in ["spidermill-paper.toml", "puma560.toml", "three_rrr.toml"] {
        let derivation = derivation(model);
        let roots: Vec<ExprId> = derivation
            .equations
            .columns
            .iter()
            .flatten()
            .copied()
            .collect();
        let expected = values(&derivation.graph, &roots, 11);
        let (mut graph, mut now) = derivation.graph.compacted(&roots);
        assert!(
            values(&graph, &now, 11) == expected,
            "compacting changes a value of {model}"
        );
        // Twice, because each pass also meets the results of the others.
        for pass in PASSES.iter().chain(&PASSES) {
            (graph, now) = (pass.run)(graph, &now);
            assert!(
                values(&graph, &now, 11) == expected,
                "{} changes a value of {model}",
                pass.name
            );
        }
    }
}

#[test]
fn the_estimated_cost_is_what_the_program_counts() {
    let derivation = derivation("panda.toml");
    let roots: Vec<ExprId> = derivation
        .equations
        .columns
        .iter()
        .flatten()
        .copied()
        .collect();
    let estimate = cost::cost(&derivation.graph, &roots);
    let program = super::schedule::schedule(
        &derivation.graph,
        &roots,
        &super::LoweringRequest {
            may_be_undefined: false,
            outputs: &roots,
            reachable: &[],
            regular: &[],
            definitions: &[],
        },
    );
    let weight = program.weight();
    assert!(
        estimate.abs_diff(weight) * 50 < weight,
        "the estimate {estimate} is off by more than 2 % from {weight}"
    );
}

#[test]
fn the_printed_count_equals_a_recount_of_the_emitted_source() {
    for model in ["two_link.toml", "spidermill.toml", "panda.toml"] {
        let derivation = derivation(model);
        let source = crate::emit(&derivation).file();
        let file = syn::parse_file(&source).unwrap_or_else(|error| panic!("{error}"));
        for (method, program) in [
            ("regressor", &derivation.programs.regressor),
            ("forces", &derivation.programs.inverse_dynamics),
        ] {
            // Loop closure is a function of its own, shared by all programs.
            let [own, pose] = [&format!("{method}_program"), "at"].map(|m| recount(&file, m));
            let recount = (own.0 + pose.0, own.1 + pose.1, own.2 + pose.2);
            let count = program.count_operations(ProgramStage::State);
            assert_eq!(
                recount,
                (count.add, count.mul, count.div),
                "{method} of {model}"
            );
        }
        for program in [
            &derivation.programs.regressor,
            &derivation.programs.inverse_dynamics,
        ] {
            assert_eq!(program.ops.len(), program.stages.len());
            let numbers = program
                .ops
                .iter()
                .filter(|op| matches!(op, ProgramOp::Number(_)))
                .count();
            assert!(numbers < program.ops.len());
        }
    }
}

/// Additions with subtractions, multiplications and divisions in a method of the source.
fn recount(file: &syn::File, method: &str) -> (usize, usize, usize) {
    let mut count = (0, 0, 0);
    let methods = file.items.iter().filter_map(|item| {
        if let syn::Item::Impl(i) = item {
            Some(i)
        } else {
            None
        }
    });
    for item in methods.flat_map(|i| &i.items) {
        if let syn::ImplItem::Fn(function) = item
            && function.sig.ident == method
        {
            recount_tokens(function.block.to_token_stream(), &mut count);
        }
    }
    count
}

/// An operator between two operands counts; a sign in front of one does not.
fn recount_tokens(tokens: TokenStream, count: &mut (usize, usize, usize)) {
    let mut after_operand = false;
    for token in tokens {
        match token {
            TokenTree::Group(group) => {
                recount_tokens(group.stream(), count);
                after_operand = group.delimiter() != Delimiter::Brace;
            }
            TokenTree::Ident(_) | TokenTree::Literal(_) => after_operand = true,
            TokenTree::Punct(punct) => {
                let counted = match punct.as_char() {
                    '+' | '-' => &mut count.0,
                    '*' => &mut count.1,
                    '/' => &mut count.2,
                    _ => {
                        after_operand = false;
                        continue;
                    }
                };
                *counted += usize::from(after_operand);
                after_operand = false;
            }
        }
    }
}
