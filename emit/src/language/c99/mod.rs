//! Plain C99: one header and one source, which need nothing but the C library's mathematics.
//!
//! Everything is reentrant and nothing allocates. The equations are those of the Rust module, line by line.

mod header;
mod newton;
mod self_test;
mod source;
mod statements;

use modelmill_codegen::{PassivePosition, StraightLineProgram};

use super::{EmissionRequest, EmittedFile};
use crate::fingerprint::Fingerprint;
use crate::identifier::module_identifier;
use crate::tree::{
    NameScope, PrecomputedValues, ProgramFunction, StatementRoutine, inputs_of_state, model_functions, reads_passive,
    uses_load,
};

/// Names of standard headers, which `#include` would find instead, and `main`.
pub(crate) const RESERVED: [&str; 30] = [
    "assert",
    "complex",
    "ctype",
    "errno",
    "fenv",
    "float",
    "inttypes",
    "iso646",
    "limits",
    "locale",
    "math",
    "setjmp",
    "signal",
    "stdalign",
    "stdarg",
    "stdatomic",
    "stdbool",
    "stddef",
    "stdint",
    "stdio",
    "stdlib",
    "stdnoreturn",
    "string",
    "tgmath",
    "threads",
    "time",
    "uchar",
    "wchar",
    "wctype",
    "main",
];

/// The header and the source, named after the model.
pub(crate) fn emit_sources(source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
    let unit = TranslationUnit::new(source);
    let file = |suffix: &str, text: String| EmittedFile {
        path: format!("{}.{suffix}", unit.name),
        text,
    };
    let (header, source) = (header::header_body(&unit), source::source_body(&unit));
    let fingerprint = Fingerprint::new([header.as_str(), source.as_str()]);
    vec![
        file("h", header::complete_header(&unit, header, fingerprint)),
        file("c", source::complete_source(&unit, &source, fingerprint)),
    ]
}

/// All that header and source are printed from.
struct TranslationUnit<'a> {
    /// The request, with the derivation.
    source: &'a EmissionRequest<'a>,
    /// Names of all values.
    scope: NameScope,
    /// Prefix of functions and structs.
    name: String,
    /// Prefix of constants.
    upper: String,
    /// Whether the forces of the drives are an input.
    load: bool,
    /// Whether the passive coordinates are solved for by Newton's method.
    newton: bool,
    /// Programs that read geometry and base parameters.
    functions: Vec<ProgramFunction<'a>>,
    /// Their common precomputed values.
    once: PrecomputedValues,
    /// The program of the reactions with its own precomputed values.
    reactions: Option<(ProgramFunction<'a>, PrecomputedValues)>,
    /// The regressor H for all products, for the self-test, with its own precomputed values.
    columns: Option<(ProgramFunction<'a>, PrecomputedValues)>,
}

impl<'a> TranslationUnit<'a> {
    fn new(source: &'a EmissionRequest<'a>) -> Self {
        let derivation = source.derivation;
        let mechanism = &derivation.mechanism;
        let scope = NameScope::new(derivation);
        // The unit is named after the model, with a suffix if the name is reserved.
        let module = module_identifier(&mechanism.name).to_string();
        let mut name = module.trim_start_matches("r#").to_owned();
        if RESERVED.contains(&name.as_str()) || statements::is_reserved(&name) {
            name.push_str("_model");
        }
        let mut functions = model_functions(derivation, source.dynamics, &scope);
        let newton = matches!(derivation.programs.passive_position, PassivePosition::Newton(_));
        // A function that is not in this list.
        let function = |program: &'a StraightLineProgram, name, doc: &str, result| {
            let follows = reads_passive(derivation, program);
            ProgramFunction {
                program,
                name,
                doc: doc.to_owned(),
                result,
                parts: Vec::new(),
                routine: StatementRoutine::new(program, &scope, &[]),
                inputs: inputs_of_state(derivation, follows),
                follows,
                is_public: true,
            }
        };
        // A program with precomputed values of its own.
        let alone = |mut function: ProgramFunction<'a>| {
            let mut once = PrecomputedValues::new(&scope);
            once.absorb(&mut function.routine);
            (function, once)
        };
        // Reactions read all parameters, and have precomputed values of their own.
        let reactions = source.reactions.map(|reactions| {
            alone(function(
                &reactions.program,
                "transmitted",
                "Forces and moments in the joints, and forces in the closures of loops",
                "wrenches",
            ))
        });
        // The self-test compares H_min with all columns.
        let columns = source.self_test.then(|| {
            let mut function = function(&derivation.programs.full_regressor, "columns", "", "columns");
            function.is_public = false;
            alone(function)
        });
        // All other programs share theirs.
        let mut once = PrecomputedValues::new(&scope);
        for function in &mut functions {
            once.absorb(&mut function.routine);
        }
        // Constants are in capitals.
        let upper = name.to_uppercase();
        Self {
            source,
            name,
            upper,
            load: uses_load(derivation),
            newton,
            functions,
            once,
            reactions,
            columns,
            scope,
        }
    }

    /// A template with its placeholders replaced by the prefixes of this unit.
    fn expand_template(&self, template: &str) -> String {
        let text = template.replace("NAME_", &format!("{}_", self.name));
        text.replace("UPPER_", &format!("{}_", self.upper))
    }

    /// Number of independent coordinates.
    fn n_active(&self) -> usize {
        self.source.derivation.coordinates().0.len()
    }

    /// Number of passive coordinates.
    fn n_passive(&self) -> usize {
        self.source.derivation.coordinates().1.len()
    }

    /// Number of drives.
    fn n_drives(&self) -> usize {
        self.source.derivation.mechanism.drives.len()
    }

    /// Number of base parameters.
    fn n_base(&self) -> usize {
        self.source.derivation.reduction.retained.len()
    }

    /// The arrays of a state, in order, with their lengths.
    fn state_parts(&self) -> Vec<(&'static str, usize)> {
        let n = self.n_active();
        let mut parts = vec![("q", n), ("qd", n), ("qdd", n)];
        // Loads are part of the state only if an effect reads them.
        if self.load {
            parts.push(("load", self.n_drives()));
        }
        parts
    }

    /// The arrays of a state as parameters of a function.
    fn state_parameters(&self) -> String {
        let parts = self.state_parts().into_iter();
        let parts = parts.map(|(name, _)| format!("const double *{name}"));
        parts.collect::<Vec<String>>().join(", ")
    }

    /// The arrays of a state as arguments of a call.
    fn state_arguments(&self) -> String {
        let parts = self.state_parts().into_iter().map(|(name, _)| name);
        parts.collect::<Vec<&str>>().join(", ")
    }
}
