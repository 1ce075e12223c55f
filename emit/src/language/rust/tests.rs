//! What is printed as cost equals a recount of the source.

use std::path::Path;

use modelmill_codegen::{Derivation, ProgramOp, ProgramStage, derive};
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens as _;

fn derivation(model: &str) -> Derivation {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../model-spec/models")
        .join(model);
    let loaded = modelmill_spec::load_file(&path).unwrap_or_else(|failure| panic!("{failure}"));
    derive(&loaded.mechanism).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_printed_count_equals_a_recount_of_the_emitted_source() {
    for model in ["two_link.toml", "spidermill.toml", "panda.toml"] {
        let derivation = derivation(model);
        let source = super::emit(&derivation).file();
        let file = syn::parse_file(&source).unwrap_or_else(|error| panic!("{error}"));
        for (method, program) in [
            ("regressor", &derivation.programs.regressor),
            ("forces", &derivation.programs.inverse_dynamics),
        ] {
            // What closes loops stands once, in a function of its own, for all programs.
            let [own, pose] = [&format!("{method}_program"), "evaluate_at"].map(|m| recount(&file, m));
            let recount = (own.0 + pose.0, own.1 + pose.1, own.2 + pose.2);
            let count = program.count_operations(ProgramStage::State);
            assert_eq!(recount, (count.add, count.mul, count.div), "{method} of {model}");
        }
        for program in [&derivation.programs.regressor, &derivation.programs.inverse_dynamics] {
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

/// The lines of a method, without indentation.
fn method_lines<'a>(source: &'a str, method: &str) -> Vec<&'a str> {
    let from = source.find(&format!("fn {method}<")).expect("the method");
    let lines = source[from..].lines().map(str::trim);
    lines.take_while(|line| *line != "Ok(())").collect()
}

/// Comments of stored values name the entry of the matrix, and scales of tests are named after what is tested.
#[test]
fn stored_values_and_scales_say_what_they_are() {
    for model in ["two_link.toml", "spidermill.toml", "panda.toml"] {
        let derivation = derivation(model);
        let n_base = derivation.reduction.retained.len();
        let source = super::emit(&derivation).file();
        let mut n_named = 0;
        for line in method_lines(&source, "regressor_program") {
            let Some(rest) = line.strip_prefix("n.put(") else {
                continue;
            };
            let place: usize = rest.split(',').next().unwrap().parse().unwrap();
            let entry = format!("// H_{}_{}", place / n_base + 1, place % n_base + 1);
            assert!(line.ends_with(&entry), "{line} is {entry}");
            n_named += 1;
        }
        assert!(n_named > n_base, "{model}");
        for line in source.lines().filter_map(|line| line.trim().strip_prefix("n.regular(")) {
            let (value, scale) = line.strip_suffix(")?;").unwrap().split_once(", ").unwrap();
            assert_eq!(
                scale.trim_end_matches('_'),
                format!("scale_{}", value.trim_end_matches('_'))
            );
        }
    }
}

/// The wrench of a link stands below the heading of its balances.
#[test]
fn headings_stand_where_their_statements_are() {
    let source = super::emit(&derivation("spidermill.toml")).file();
    let mut heading = "";
    let mut n_found = 0;
    for line in method_lines(&source, "forces_program") {
        heading = if line.starts_with("// ") { line } else { heading };
        for link in ["S3", "S5"] {
            if line.starts_with(&format!("let M_{link}_z =")) {
                assert_eq!(heading, format!("// Link {link}: balances of forces and moments."));
                n_found += 1;
            }
        }
        if line.starts_with("let omega_S3_z =") {
            assert_eq!(heading, "// Rates of the links.");
        }
    }
    assert_eq!(n_found, 2);
}

/// Additions with subtractions, multiplications and divisions in a method of the source.
fn recount(file: &syn::File, method: &str) -> (usize, usize, usize) {
    let mut count = (0, 0, 0);
    let methods = file
        .items
        .iter()
        .filter_map(|item| if let syn::Item::Impl(i) = item { Some(i) } else { None });
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
