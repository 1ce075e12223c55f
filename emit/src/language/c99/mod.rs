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
use crate::identifier::module_identifier;
use crate::tree::{NameScope, PrecomputedValues, StatementRoutine, reads_passive, uses_load};
/// Names whose headers the C library has itself, and `main`.
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

/// The header and the source.
pub(crate) fn emit_sources(source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
    let unit = TranslationUnit::new(source);
    let file = |suffix: &str, text: String| EmittedFile {
        path: format!("{}.{suffix}", unit.name),
        text,
    };
    vec![
        file("h", header::header(&unit)),
        file("c", source::source(&unit)),
    ]
}

/// What is printed.
struct TranslationUnit<'a> {
    source: &'a EmissionRequest<'a>,
    scope: NameScope,
    /// Prefix of everything, and its capitals.
    name: String,
    upper: String,
    load: bool,
    newton: bool,
    /// Programs of the geometry and the base parameters, and what they compute once.
    functions: Vec<CFunction<'a>>,
    once: PrecomputedValues,
    /// The reactions, and what they compute once.
    reactions: Option<(CFunction<'a>, PrecomputedValues)>,
    /// H for all products, for the self-test.
    columns: Option<(CFunction<'a>, PrecomputedValues)>,
}

/// A program with its statements.
struct CFunction<'a> {
    program: &'a StraightLineProgram,
    name: &'static str,
    doc: String,
    /// What its results are called in declarations.
    result: &'static str,
    routine: StatementRoutine,
    /// Whether it reads passive coordinates that are found first.
    follows: bool,
    /// Whether it may be called from outside.
    is_public: bool,
}

impl<'a> TranslationUnit<'a> {
    #[allow(
        clippy::too_many_lines,
        reason = "a list of functions, one after the other"
    )]
    fn new(source: &'a EmissionRequest<'a>) -> Self {
        let derivation = source.derivation;
        let mechanism = &derivation.mechanism;
        let scope = NameScope::new(derivation);
        let module = module_identifier(&mechanism.name).to_string();
        let mut name = module.trim_start_matches("r#").to_owned();
        if RESERVED.contains(&name.as_str()) || statements::is_reserved(&name) {
            name.push_str("_model");
        }
        let programs = &derivation.programs;
        let (active, passive) = derivation.coordinates();
        let of_coordinate = |i: &usize| mechanism.coordinates[*i].name.clone();
        let function =
            |program: &'a StraightLineProgram, name, doc: String, result, outputs: Vec<String>| {
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
        let each = |letter: &str, suffix: &str| -> Vec<String> {
            let drives = mechanism.drives.iter();
            drives
                .map(|d| format!("{letter}_{}{suffix}", d.name))
                .collect()
        };
        let mut of_motion = each("l", "");
        of_motion.extend(each("l", "_d"));
        for drive in &mechanism.drives {
            of_motion.extend(
                active
                    .iter()
                    .map(|a| format!("J_{}_{}", drive.name, of_coordinate(a))),
            );
        }
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
                "Lengths or angles of the drives, then their rates, then their Jacobian row by row"
                    .to_owned(),
                "motion",
                of_motion,
            ),
        ];
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
        if let Some(dynamics) = source.dynamics {
            let accelerations = "accelerations are not read";
            for (program, name, doc, result) in [
                (&dynamics.mass_matrix, "mass_matrix", format!("M row by row; {accelerations}"), "matrix"),
                (
                    &dynamics.coriolis,
                    "coriolis",
                    format!("c, generalised forces that rates alone ask for; {accelerations}"),
                    "forces",
                ),
                (
                    &dynamics.gravity,
                    "gravity",
                    "g, generalised forces that weight alone asks for; rates and accelerations are not read".to_owned(),
                    "forces",
                ),
                (
                    &dynamics.effects,
                    "effects",
                    format!("e, generalised forces of effects where nothing accelerates; {accelerations}"),
                    "forces",
                ),
                (
                    &dynamics.bias,
                    "bias_and_drives",
                    format!(
                        "c + g + e, at a lower cost than one by one, then the Jacobian of the drives row by row; {accelerations}"
                    ),
                    "bias",
                ),
            ] {
                functions.push(function(program, name, doc, result, Vec::new()));
            }
        }
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
        let alone = |mut function: CFunction<'a>| {
            let mut once = PrecomputedValues::new(&scope);
            once.absorb(&mut function.routine);
            (function, once)
        };
        let reactions = source.reactions.map(|reactions| {
            alone(function(
                &reactions.program,
                "transmitted",
                "Forces and moments in the joints, and forces that close loops".to_owned(),
                "wrenches",
                Vec::new(),
            ))
        });
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
        let mut once = PrecomputedValues::new(&scope);
        for function in &mut functions {
            once.absorb(&mut function.routine);
        }
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

    /// A template with the names of this unit.
    fn expand_template(&self, template: &str) -> String {
        let text = template.replace("NAME_", &format!("{}_", self.name));
        text.replace("UPPER_", &format!("{}_", self.upper))
    }

    fn n_active(&self) -> usize {
        self.source.derivation.coordinates().0.len()
    }

    fn n_passive(&self) -> usize {
        self.source.derivation.coordinates().1.len()
    }

    fn n_drives(&self) -> usize {
        self.source.derivation.mechanism.drives.len()
    }

    fn n_base(&self) -> usize {
        self.source.derivation.reduction.retained.len()
    }

    /// The parts of a state, with how many numbers each has.
    fn state_parts(&self) -> Vec<(&'static str, usize)> {
        let n = self.n_active();
        let mut parts = vec![("q", n), ("qd", n), ("qdd", n)];
        if self.load {
            parts.push(("load", self.n_drives()));
        }
        parts
    }

    /// Declarations of a state.
    fn state_parameters(&self) -> String {
        let parts = self.state_parts().into_iter();
        let parts = parts.map(|(name, _)| format!("const double *{name}"));
        parts.collect::<Vec<String>>().join(", ")
    }

    /// The names of a state as arguments.
    fn state_arguments(&self) -> String {
        let parts = self.state_parts().into_iter().map(|(name, _)| name);
        parts.collect::<Vec<&str>>().join(", ")
    }
}
