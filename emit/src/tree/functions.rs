//! The functions of a model, the same for every language that prints them: programs with their names, documentation,
//! and the form of their results.

use modelmill_codegen::expr::Atom;
use modelmill_codegen::{Derivation, DynamicsPrograms, PassivePosition, StraightLineProgram};

use super::{NameScope, StatementRoutine, inputs_of_state, matrix_entry_names, reads_passive};

/// A program as a function of a state or of a pose.
pub(crate) struct ProgramFunction<'a> {
    /// The program.
    pub(crate) program: &'a StraightLineProgram,
    /// Name of the function.
    pub(crate) name: &'static str,
    /// Documentation without a full stop; empty for functions that are not public.
    pub(crate) doc: String,
    /// Name of the result.
    pub(crate) result: &'static str,
    /// The parts of the result, in the order of the program's outputs.
    pub(crate) parts: Vec<OutputPart>,
    /// Its statements.
    pub(crate) routine: StatementRoutine,
    /// Inputs of the program, in order.
    pub(crate) inputs: Vec<Atom>,
    /// Whether it reads passive coordinates that Newton's method has to solve for.
    pub(crate) follows: bool,
    /// Whether users call it.
    pub(crate) is_public: bool,
}

/// A vector or a matrix in the outputs of a program; a matrix is stored row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutputPart {
    /// Its name where a result has several parts.
    pub(crate) name: &'static str,
    /// Number of rows, or of entries of a vector.
    pub(crate) n_rows: usize,
    /// Number of columns; `None` for a vector.
    pub(crate) n_columns: Option<usize>,
}

impl OutputPart {
    fn vector(name: &'static str, n_rows: usize) -> Self {
        let n_columns = None;
        Self {
            name,
            n_rows,
            n_columns,
        }
    }

    fn matrix(name: &'static str, n_rows: usize, n_columns: usize) -> Self {
        let n_columns = Some(n_columns);
        Self {
            name,
            n_rows,
            n_columns,
        }
    }

    /// Number of outputs of the program that belong to it.
    pub(crate) fn n_outputs(self) -> usize {
        self.n_rows * self.n_columns.unwrap_or(1)
    }
}

/// The functions of a model that read geometry and base parameters; `dynamics` adds the equation of motion.
#[allow(clippy::too_many_lines, reason = "a list of functions, one after the other")]
pub(crate) fn model_functions<'a>(
    derivation: &'a Derivation,
    dynamics: Option<&'a DynamicsPrograms>,
    scope: &NameScope,
) -> Vec<ProgramFunction<'a>> {
    let mechanism = &derivation.mechanism;
    let programs = &derivation.programs;
    let (active, passive) = derivation.coordinates();
    let (n_active, n_passive, n_drives) = (active.len(), passive.len(), mechanism.drives.len());
    let n_base = derivation.reduction.retained.len();
    let of_coordinate = |i: &usize| mechanism.coordinates[*i].name.clone();
    // A public function of a state; `outputs` name values, `entries` only the places where they are stored.
    let function = |program: &'a StraightLineProgram,
                    name,
                    doc: &str,
                    result,
                    parts: Vec<OutputPart>,
                    outputs: Vec<String>,
                    entries: Vec<String>| {
        let mut routine = StatementRoutine::new(program, scope, &outputs);
        if !entries.is_empty() {
            routine = routine.with_entry_names(&entries);
        }
        let follows = reads_passive(derivation, program);
        ProgramFunction {
            program,
            name,
            doc: doc.to_owned(),
            result,
            parts,
            routine,
            inputs: inputs_of_state(derivation, follows),
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
            "Forces of the drives, N or N m",
            "forces",
            vec![OutputPart::vector("forces", n_drives)],
            each("f", ""),
            Vec::new(),
        ),
        function(
            &programs.regressor,
            "regressor",
            "H_min row by row: one row per drive, one column per base parameter",
            "regressor",
            vec![OutputPart::matrix("regressor", n_drives, n_base)],
            Vec::new(),
            matrix_entry_names("H", n_drives, n_base),
        ),
        function(
            &programs.drives,
            "drives",
            "Lengths or angles of the drives, then their rates, then their Jacobian row by row",
            "motion",
            vec![
                OutputPart::vector("position", n_drives),
                OutputPart::vector("rate", n_drives),
                OutputPart::matrix("jacobian", n_drives, n_active),
            ],
            of_motion,
            Vec::new(),
        ),
    ];
    // Only mechanisms with loops have passive coordinates.
    if n_passive > 0 {
        let names = ["", "_d", "_dd"].iter();
        let names = names.flat_map(|suffix| passive.iter().map(move |p| (p, suffix)));
        functions.push(function(
            &programs.passive,
            "passive",
            "Passive coordinates, then their rates, then their accelerations",
            "motion",
            ["position", "rate", "acceleration"]
                .map(|part| OutputPart::vector(part, n_passive))
                .into(),
            names
                .map(|(p, suffix)| format!("{}{suffix}", of_coordinate(p)))
                .collect(),
            Vec::new(),
        ));
    }
    // The terms of the equation of motion.
    if let Some(dynamics) = dynamics {
        let vector = |name| vec![OutputPart::vector(name, n_active)];
        let bias = vec![
            OutputPart::vector("bias", n_active),
            OutputPart::matrix("jacobian", n_drives, n_active),
        ];
        for (program, name, doc, result, parts) in [
            (
                &dynamics.mass_matrix,
                "mass_matrix",
                "M row by row; accelerations are not read",
                "matrix",
                vec![OutputPart::matrix("matrix", n_active, n_active)],
            ),
            (
                &dynamics.coriolis,
                "coriolis",
                "c, generalised forces that depend on the rates; accelerations are not read",
                "forces",
                vector("forces"),
            ),
            (
                &dynamics.gravity,
                "gravity",
                "g, generalised forces of gravity; rates and accelerations are not read",
                "forces",
                vector("forces"),
            ),
            (
                &dynamics.effects,
                "effects",
                "e, generalised forces of the effects at zero acceleration; accelerations are not read",
                "forces",
                vector("forces"),
            ),
            (
                &dynamics.bias,
                "bias_and_drives",
                "c + g + e, at a lower cost than the three separately, then the Jacobian of the drives row by row; \
                 accelerations are not read",
                "bias",
                bias,
            ),
        ] {
            let entries = match name {
                "mass_matrix" => matrix_entry_names("M", n_active, n_active),
                _ => Vec::new(),
            };
            functions.push(function(program, name, doc, result, parts, Vec::new(), entries));
        }
    }
    // Loops without closed form add residual and scales, which are internal functions of a pose.
    if let PassivePosition::Newton(loops) = &programs.passive_position {
        for (program, name) in [(&loops.residual, "gaps"), (&loops.scales, "scales")] {
            let mut function = function(program, name, "", "values", Vec::new(), Vec::new(), Vec::new());
            let pose = active.iter().chain(&passive);
            function.inputs = pose.map(|i| Atom::Coordinate(*i)).collect();
            (function.is_public, function.follows) = (false, false);
            functions.push(function);
        }
    }
    functions
}
