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
use crate::tree::{NameScope, PrecomputedValues, StatementRoutine, reads_passive, uses_load};

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
    functions: Vec<CFunction<'a>>,
    /// Their common precomputed values.
    once: PrecomputedValues,
    /// The program of the reactions with its own precomputed values.
    reactions: Option<(CFunction<'a>, PrecomputedValues)>,
    /// The regressor H for all products, for the self-test, with its own precomputed values.
    columns: Option<(CFunction<'a>, PrecomputedValues)>,
}

/// A program with the C function that it becomes.
struct CFunction<'a> {
    /// The program; its operations are counted for the header.
    program: &'a StraightLineProgram,
    /// Name without prefix.
    name: &'static str,
    /// Documentation without a full stop; empty for functions that are not public.
    doc: String,
    /// Name of the result in the declaration.
    result: &'static str,
    /// Its statements.
    routine: StatementRoutine,
    /// Whether it reads passive coordinates that Newton's method has to solve for.
    follows: bool,
    /// Whether the header declares it.
    is_public: bool,
}

impl<'a> TranslationUnit<'a> {
    #[allow(clippy::too_many_lines, reason = "a list of functions, one after the other")]
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
        let programs = &derivation.programs;
        let (active, passive) = derivation.coordinates();
        let of_coordinate = |i: &usize| mechanism.coordinates[*i].name.clone();
        // A public function from a program, with names for its outputs.
        let function = |program: &'a StraightLineProgram, name, doc: String, result, outputs: Vec<String>| {
            let routine = StatementRoutine::new(program, &scope, &outputs);
            let follows = reads_passive(derivation, program);
            CFunction {
                program,
                name,
                doc,
                result,
                routine,
                follows,
                is_public: true,
            }
        };
        // Names such as `l_left` and `l_left_d`, one per drive.
        let each = |letter: &str, suffix: &str| -> Vec<String> {
            let drives = mechanism.drives.iter();
            drives.map(|d| format!("{letter}_{}{suffix}", d.name)).collect()
        };
        // Lengths, rates, then the Jacobian row by row: the order of the program's outputs.
        let mut of_motion = each("l", "");
        of_motion.extend(each("l", "_d"));
        for drive in &mechanism.drives {
            of_motion.extend(active.iter().map(|a| format!("J_{}_{}", drive.name, of_coordinate(a))));
        }
        // Functions that every model has.
        let mut functions = vec![
            function(
                &programs.inverse_dynamics,
                "inverse_dynamics",
                "Forces of the drives, N or N m".to_owned(),
                "forces",
                each("f", ""),
            ),
            function(
                &programs.regressor,
                "regressor",
                "H_min row by row: one row per drive, one column per base parameter".to_owned(),
                "regressor",
                Vec::new(),
            ),
            function(
                &programs.drives,
                "drives",
                "Lengths or angles of the drives, then their rates, then their Jacobian row by row".to_owned(),
                "motion",
                of_motion,
            ),
        ];
        // Only mechanisms with loops have passive coordinates.
        if !passive.is_empty() {
            let names = ["", "_d", "_dd"].iter();
            let names = names.flat_map(|suffix| passive.iter().map(move |p| (p, suffix)));
            functions.push(function(
                &programs.passive,
                "passive",
                "Passive coordinates, then their rates, then their accelerations".to_owned(),
                "motion",
                names
                    .map(|(p, suffix)| format!("{}{suffix}", of_coordinate(p)))
                    .collect(),
            ));
        }
        // The terms of the equation of motion.
        if let Some(dynamics) = source.dynamics {
            let accelerations = "accelerations are not read";
            for (program, name, doc, result) in [
                (
                    &dynamics.mass_matrix,
                    "mass_matrix",
                    format!("M row by row; {accelerations}"),
                    "matrix",
                ),
                (
                    &dynamics.coriolis,
                    "coriolis",
                    format!("c, generalised forces that depend on the rates; {accelerations}"),
                    "forces",
                ),
                (
                    &dynamics.gravity,
                    "gravity",
                    "g, generalised forces of gravity; rates and accelerations are not read".to_owned(),
                    "forces",
                ),
                (
                    &dynamics.effects,
                    "effects",
                    format!("e, generalised forces of the effects at zero acceleration; {accelerations}"),
                    "forces",
                ),
                (
                    &dynamics.bias,
                    "bias_and_drives",
                    format!(
                        "c + g + e, at a lower cost than the three separately, then the Jacobian of the drives row by row; {accelerations}"
                    ),
                    "bias",
                ),
            ] {
                functions.push(function(program, name, doc, result, Vec::new()));
            }
        }
        // Loops without closed form add residual and scales, which are internal.
        let newton = match &programs.passive_position {
            PassivePosition::Newton(loops) => {
                for (program, name) in [(&loops.residual, "gaps"), (&loops.scales, "scales")] {
                    let mut function = function(program, name, String::new(), "values", Vec::new());
                    (function.is_public, function.follows) = (false, false);
                    functions.push(function);
                }
                true
            }
            _ => false,
        };
        // A program with precomputed values of its own.
        let alone = |mut function: CFunction<'a>| {
            let mut once = PrecomputedValues::new(&scope);
            once.absorb(&mut function.routine);
            (function, once)
        };
        // Reactions read all parameters, and have precomputed values of their own.
        let reactions = source.reactions.map(|reactions| {
            alone(function(
                &reactions.program,
                "transmitted",
                "Forces and moments in the joints, and forces in the closures of loops".to_owned(),
                "wrenches",
                Vec::new(),
            ))
        });
        // The self-test compares H_min with all columns.
        let columns = source.self_test.then(|| {
            let mut function = function(
                &programs.full_regressor,
                "columns",
                String::new(),
                "columns",
                Vec::new(),
            );
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
