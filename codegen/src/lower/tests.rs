//! Every pass keeps the value of each output, and printed numbers of operations equal a count in the source.

use std::path::Path;

use super::{PASSES, cost};
use crate::expr::{Atom, EvaluationTape, ExprId, FieldPoint, Graph};
use crate::{Derivation, derive};
use modelmill_algebra::field::{FieldElement, RandomStream};

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
        let roots: Vec<ExprId> = derivation.equations.columns.iter().flatten().copied().collect();
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
    let roots: Vec<ExprId> = derivation.equations.columns.iter().flatten().copied().collect();
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
