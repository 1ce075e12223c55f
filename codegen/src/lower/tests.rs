//! Every pass keeps the value of each output; what is printed as cost equals a recount.

use std::path::Path;

use modelmill_algebra::field::{Element, Stream};

use super::{Op, PASSES, Stage, cost};
use crate::expr::{Atom, ExprId, FieldPoint, Graph, Tape};
use crate::{Derivation, derive};

fn derivation(model: &str) -> Derivation {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../model-spec/models")
        .join(model);
    let loaded = modelmill_spec::load_file(&path).unwrap_or_else(|failure| panic!("{failure}"));
    derive(&loaded.mechanism).unwrap_or_else(|error| panic!("{error}"))
}

/// Values of some expressions at a random point of the field, with all atoms free.
fn values(graph: &Graph, roots: &[ExprId], seed: u64) -> Vec<Element> {
    let mut stream = Stream::new(seed);
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
                point.values.insert(kind(i), stream.element());
                point.angles.insert(kind(i), stream.circle());
            }
        }
        if let Some(values) = Tape::new(graph, roots).evaluate(&point) {
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
        // Twice, since passes meet what the others have made of the expressions.
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
        &super::Request {
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
            let recount = recount(&file, &format!("{method}_program"));
            let count = program.count(Stage::State);
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
                .filter(|op| matches!(op, Op::Number(_)))
                .count();
            assert!(numbers < program.ops.len());
        }
    }
}

/// Additions with subtractions, multiplications and divisions in the `let` statements of a method.
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
        let syn::ImplItem::Fn(function) = item else {
            continue;
        };
        if function.sig.ident != method {
            continue;
        }
        for statement in &function.block.stmts {
            let syn::Stmt::Local(local) = statement else {
                continue;
            };
            let Some(init) = &local.init else { continue };
            if let syn::Expr::Binary(binary) = &*init.expr {
                match binary.op {
                    syn::BinOp::Add(_) | syn::BinOp::Sub(_) => count.0 += 1,
                    syn::BinOp::Mul(_) => count.1 += 1,
                    syn::BinOp::Div(_) => count.2 += 1,
                    _ => panic!("an operation that no program has"),
                }
            }
            // A product in the only sum that needs it.
            if let syn::Expr::MethodCall(call) = &*init.expr {
                let name = call.method.to_string();
                if ["mul_add", "mul_sub", "sub_mul"].contains(&name.as_str()) {
                    count.0 += 1;
                    count.1 += 1;
                }
            }
        }
    }
    count
}
