//! Julia: one module in one file, which needs nothing but Julia's own library.
//!
//! The functions and their statements are those of the C99; `support.jl`, `solve.jl` and `loops.jl` are copied into the
//! file where a model needs them.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use modelmill_codegen::expr::print::FormulaFunction;
use modelmill_codegen::expr::{Atom, Unary};
use modelmill_codegen::{PassivePosition, ProgramStage};

use super::syntax::LanguageSyntax;
use super::{EmissionRequest, EmittedFile};
use crate::identifier::spell_plain;
use crate::tree::{
    BaseParameterCode, CodeStatement, NameScope, PoseCheck, PrecomputedValues, ProgramFunction, StatementRoutine,
    base_parameters, model_functions, uses_load,
};

/// Words of Julia, names of its library that the file calls, and names of the file that a variable would hide.
const RESERVED_NAMES: &str = "\
    baremodule begin break catch const continue do else elseif end export false finally for function \
    global if import let local macro module quote return struct true try using while in isa where \
    abstract mutable primitive type nothing missing Base Core Main Int Float64 Vector AbstractVector \
    sqrt sign abs tanh exp sin cos sincos atan isfinite zeros copy vcat throw eps length eval check_fine check_divisor include \
    ans im NaN Inf once dynamics check matrix OK OUT_OF_REACH SINGULAR UNDEFINED NOT_FINITE SPECIAL \
    SINGULAR_SHARE LARGEST_INPUT MESSAGES ModelError Geometry Parameters Dynamics all_fine check_length \
    solve forward near scale status loop_scale finish_preparation";

/// Appends a line, indented by some levels, to the text of a module.
macro_rules! put {
    ($module:expr, $depth:expr, $($line:tt)*) => {{
        let line = format!($($line)*);
        _ = writeln!($module.text, "{}{line}", "    ".repeat($depth));
    }};
}

#[cfg(test)]
mod interpreter;
#[cfg(test)]
mod tests;

/// The syntax of Julia.
struct JuliaSyntax;

impl LanguageSyntax for JuliaSyntax {
    fn name(&self, name: &str) -> String {
        let is_plain = name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && !RESERVED_NAMES.split_whitespace().any(|word| word == name);
        if is_plain { name.to_owned() } else { spell_plain(name) }
    }

    fn call(&self, function: Unary, argument: &str) -> String {
        format!("{}({argument})", FormulaFunction::from(function).name())
    }

    fn atan2(&self, y: &str, x: &str) -> String {
        format!("atan({y}, {x})")
    }
}

/// The module of a model in a file of its own.
pub(crate) fn emit_module(source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
    let name = module_name(&source.derivation.mechanism.name);
    let path = format!("{name}.jl");
    let text = JuliaModule::new(source).text(&name);
    vec![EmittedFile { path, text }]
}

/// The name of the module: that of the model, with a suffix where Julia or the module has this name.
fn module_name(model: &str) -> String {
    let name = JuliaSyntax.name(model);
    let in_module = "regressor inverse_dynamics drives passive bias base_parameters prepare";
    let is_taken = name != model || in_module.split(' ').any(|word| word == model);
    if is_taken || !model.contains(|c: char| c.is_ascii_lowercase()) {
        format!("{}_model", name.trim_start_matches('_'))
    } else {
        name
    }
}

/// All that the file is printed from.
struct JuliaModule<'a> {
    /// The request, with the derivation.
    source: &'a EmissionRequest<'a>,
    /// Names of all values.
    scope: NameScope,
    /// The functions of the model.
    functions: Vec<ProgramFunction<'a>>,
    /// Their common precomputed values.
    once: PrecomputedValues,
    /// Whether the passive coordinates are solved for by Newton's method.
    newton: bool,
    /// The arrays of a state.
    state: &'static str,
    /// The file so far.
    text: String,
}

impl<'a> JuliaModule<'a> {
    fn new(source: &'a EmissionRequest<'a>) -> Self {
        let derivation = source.derivation;
        let scope = NameScope::new(derivation);
        let mut functions = model_functions(derivation, source.dynamics, &scope);
        let mut once = PrecomputedValues::new(&scope);
        for function in &mut functions {
            once.absorb(&mut function.routine);
        }
        Self {
            source,
            functions,
            once,
            newton: matches!(derivation.programs.passive_position, PassivePosition::Newton(_)),
            state: ["q, qd, qdd", "q, qd, qdd, load"][usize::from(uses_load(derivation))],
            scope,
            text: String::new(),
        }
    }

    /// The complete file.
    fn text(mut self, name: &str) -> String {
        self.write_head(name);
        self.text.push_str(include_str!("support.jl"));
        let has_systems = self.newton || self.source.dynamics.is_some();
        if has_systems {
            self.text.push('\n');
            self.text.push_str(include_str!("solve.jl"));
        }
        self.write_records();
        self.write_base_parameters();
        for k in 0..self.functions.len() {
            self.write_program(k);
        }
        if self.newton {
            self.write_nominal_pose();
            self.text.push('\n');
            self.text.push_str(include_str!("loops.jl"));
        }
        self.write_preparation();
        for k in 0..self.functions.len() {
            if self.functions[k].is_public {
                self.write_public_function(k);
            }
        }
        if self.source.dynamics.is_some() {
            self.write_forward_dynamics();
        }
        self.text += "\nend\n";
        self.text
    }

    /// Title, cautions, sizes and names.
    fn write_head(&mut self, name: &str) {
        let derivation = self.source.derivation;
        let mechanism = &derivation.mechanism;
        let title = comment(mechanism.title.as_deref().unwrap_or(&mechanism.name));
        let head = include_str!("head.jl")
            .replace("MODULE_NAME", name)
            .replace("STATE", self.state);
        self.text.push_str(&head.replace("TITLE", &title));
        if let Some(caution) = derivation.reduction.method.caution() {
            put!(self, 0, "# Caution: {caution}.");
        }
        put!(self, 0, "module {name}\n");
        let (active, passive) = derivation.coordinates();
        let coordinate = |i: &usize| mechanism.coordinates[*i].name.as_str();
        let names_of = |indices: &[usize]| indices.iter().map(coordinate).collect();
        let drives = mechanism.drives.iter().map(|d| d.name.as_str()).collect();
        let tables: [(&str, &str, Vec<&str>); 3] = [
            ("ACTIVE", "Independent coordinates, in order.", names_of(&active)),
            ("PASSIVE", "Passive coordinates, in order.", names_of(&passive)),
            ("DRIVES", "Drives, in the order of the rows of H.", drives),
        ];
        for (table, says, names) in tables {
            let quoted: Vec<String> = names.iter().map(|name| quoted(name)).collect();
            put!(self, 0, "\"{says}\"");
            put!(self, 0, "const {table} = String[{}]", quoted.join(", "));
            put!(self, 0, "const N_{table} = {}", names.len());
        }
        self.text += "\"Base parameters in order: name, unit, expression, eq. (16).\"\n";
        self.text += "const BASE_PARAMETERS = NTuple{3,String}[\n";
        let entries = derivation.base_parameters();
        for base in &entries {
            let [name, unit, expression] = [&base.name, &base.unit, &base.expression].map(|text| quoted(text));
            put!(self, 1, "({name}, {unit}, {expression}),");
        }
        put!(self, 0, "]\nconst N_BASE = {}\n", entries.len());
    }

    /// Geometry and parameters with the values of the file.
    fn write_records(&mut self) {
        let mechanism = &self.source.derivation.mechanism;
        let constants = mechanism.constants.iter().map(|c| (&c.name, c.value, &c.unit));
        let parameters = mechanism.parameters.iter().map(|p| (&p.name, p.nominal, &p.unit));
        let (constants, parameters): (Vec<_>, Vec<_>) = (constants.collect(), parameters.collect());
        for (record, says, fields) in [
            ("Geometry", "Known quantities, by default the model file's.", constants),
            ("Parameters", "Dynamic parameters, by default nominal.", parameters),
        ] {
            put!(self, 0, "\n\"{says}\"\nBase.@kwdef struct {record}");
            for (field, value, unit) in fields {
                let field = JuliaSyntax.name(field);
                put!(self, 1, "{field}::Float64 = {value:?} # {}", comment(unit));
            }
            self.text += "end\n";
        }
        let newton = if self.newton {
            "\n    scale::Float64\n    nominal::Vector{Float64}\n    nominal_status::Int"
        } else {
            ""
        };
        self.text += "\n\"Values that depend only on geometry and base parameters.\"\n";
        self.text += "struct Dynamics\n    geometry::Geometry\n";
        put!(
            self,
            0,
            "    base::Vector{{Float64}}\n    once::Vector{{Float64}}{newton}\nend"
        );
    }

    /// Appends bindings of the constants, parameters and base parameters that are read.
    fn write_bindings(&mut self, read: &BTreeSet<Atom>, owner: &str) {
        let mechanism = &self.source.derivation.mechanism;
        for atom in read {
            let value = match atom {
                Atom::Constant(i) => format!("{owner}geometry.{}", JuliaSyntax.name(&mechanism.constants[*i].name)),
                Atom::Parameter(i) => format!("parameters.{}", JuliaSyntax.name(&mechanism.parameters[*i].name)),
                Atom::Base(k) => format!("{owner}base[{}]", k + 1),
                Atom::Pi => format!("{:?}", std::f64::consts::PI),
                _ => continue,
            };
            let name = JuliaSyntax.name(self.scope.input_name(*atom));
            put!(self, 1, "{name} = {value}");
        }
    }

    /// The function `base_parameters`, eq. (16).
    fn write_base_parameters(&mut self) {
        let BaseParameterCode {
            sums,
            values,
            divisors,
            read,
        } = base_parameters(self.source.derivation, &self.scope);
        self.text += "\n\"Base parameters from physical parameters, eq. (16).\"\n";
        self.text += "function base_parameters(geometry, parameters)\n";
        self.write_bindings(&read, "");
        for divisor in &divisors {
            let value = JuliaSyntax.operand_text(&divisor.value);
            let size = JuliaSyntax.grouped_text(&divisor.size);
            put!(self, 1, "check_divisor({value}, {size}) # {}", comment(&divisor.text));
        }
        for (name, value) in &sums {
            let value = JuliaSyntax.operand_text(value);
            put!(self, 1, "{} = {value}", JuliaSyntax.name(name));
        }
        self.text += "    base = zeros(N_BASE)\n";
        for (k, value) in values.iter().enumerate() {
            put!(self, 1, "base[{}] = {}", k + 1, JuliaSyntax.operand_text(value));
        }
        self.text += "    return base\nend\n";
    }

    /// Appends the statements of a program.
    fn write_statements(&mut self, statements: &[CodeStatement]) {
        for statement in statements {
            let text = |value| JuliaSyntax.operand_text(value);
            match statement {
                CodeStatement::Section(heading) => put!(self, 1, "# {}", comment(heading)),
                CodeStatement::Let { name, value, note } => {
                    let note = remark(note.as_deref().unwrap_or_default());
                    put!(self, 1, "{} = {}{note}", JuliaSyntax.name(name), text(value));
                }
                // Each sine is computed where it is bound.
                CodeStatement::Angles(_) => {}
                CodeStatement::SinCos {
                    sine, cosine, angle, ..
                } => {
                    let name = |name: &Option<String>| name.as_ref().map_or("_".to_owned(), |n| JuliaSyntax.name(n));
                    put!(self, 1, "{}, {} = sincos({})", name(sine), name(cosine), text(angle));
                }
                // A comparison with NaN is false, so that NaN fails each check.
                CodeStatement::Guard(check) => {
                    let line = match check {
                        PoseCheck::Reachable(value) => format!("{} >= 0.0 || return OUT_OF_REACH", text(value)),
                        PoseCheck::Regular(value, size) => {
                            let size = JuliaSyntax.grouped_text(size);
                            format!("abs({}) > SINGULAR_SHARE * {size} || return SINGULAR", text(value))
                        }
                        PoseCheck::Finite(value) => format!("isfinite({}) || return UNDEFINED", text(value)),
                    };
                    put!(self, 1, "{line}");
                }
                CodeStatement::Put { output, value, entry } => {
                    put!(self, 1, "outputs[{}] = {}{}", output + 1, text(value), remark(entry));
                }
                CodeStatement::Group { statements, .. } => self.write_statements(statements),
            }
        }
    }

    /// A program as a function from `inputs` to `outputs`, which returns a status.
    fn write_program(&mut self, k: usize) {
        let routine = self.functions[k].routine.clone();
        let name = self.functions[k].name;
        put!(self, 0, "\nfunction {name}_program!(outputs, dynamics, inputs)");
        self.write_bindings(&routine.read, "dynamics.");
        for (place, kept) in self.once.kept.clone().iter().enumerate() {
            if routine.kept.contains(kept) {
                put!(self, 1, "{} = dynamics.once[{}]", JuliaSyntax.name(kept), place + 1);
            }
        }
        for (place, atom) in self.functions[k].inputs.clone().iter().enumerate() {
            if routine.read.contains(atom) {
                let name = JuliaSyntax.name(self.scope.input_name(*atom));
                put!(self, 1, "{name} = inputs[{}]", place + 1);
            }
        }
        for output in routine.zero_outputs() {
            put!(self, 1, "outputs[{}] = 0.0", output + 1);
        }
        self.write_statements(&routine.state);
        self.text += "    return OK\nend\n";
    }

    /// The pose from which Newton's method follows all others.
    fn write_nominal_pose(&mut self) {
        let derivation = self.source.derivation;
        let (active, passive) = derivation.coordinates();
        let in_loops = derivation.coordinates_in_loops();
        for (function, says, coordinates) in [
            ("nominal_active", "independent coordinates", active),
            ("nominal_passive", "passive coordinates", passive),
        ] {
            let values = coordinates.iter().map(|i| {
                // Lengths in loops are scaled with the geometry.
                let coordinate = &derivation.mechanism.coordinates[*i];
                let is_scaled = coordinate.motion.is_length() && in_loops.contains(i);
                let factor = if is_scaled { "scale * " } else { "" };
                format!("{factor}{:?}", coordinate.nominal)
            });
            let values: Vec<String> = values.collect();
            let values = values.join(", ");
            put!(self, 0, "\n# The nominal pose of the {says}.");
            put!(self, 0, "function {function}(scale)\n    return Float64[{values}]\nend");
        }
    }

    /// The function `prepare`.
    fn write_preparation(&mut self) {
        self.text += "\n\"Computes what depends only on geometry and base parameters.\"\n";
        self.text += "function prepare(geometry, base)\n    check_length(base, N_BASE)\n";
        self.text += "    check_fine(base)\n";
        let constants = &self.source.derivation.mechanism.constants;
        let constants: Vec<String> = constants.iter().map(|c| JuliaSyntax.name(&c.name)).collect();
        for constant in constants {
            put!(self, 1, "check_fine(geometry.{constant})");
        }
        let read = self.once.read.clone();
        self.write_bindings(&read, "");
        self.write_statements(&self.once.statements());
        let kept: Vec<String> = self.once.kept.iter().map(|name| JuliaSyntax.name(name)).collect();
        put!(self, 1, "once = Float64[{}]", kept.join(", "));
        if !self.newton {
            self.text += "    return Dynamics(geometry, copy(base), once)\nend\n";
            return;
        }
        // The scale of the geometry relative to the file's, or 1 if no coordinate of the loops is a length.
        if let Some(program) = &self.source.derivation.programs.scale {
            let routine = StatementRoutine::new(program, &self.scope, &[]);
            self.text += "    return finish_preparation(geometry, base, once, loop_scale(geometry))\nend\n";
            self.text += "\n# Size of the loops relative to those of the model file.\nfunction loop_scale(geometry)\n";
            let read = routine.read_once.union(&routine.read).copied().collect();
            self.write_bindings(&read, "");
            self.write_statements(&routine.once);
            let result = routine.results.first().map(|result| JuliaSyntax.operand_text(result));
            put!(self, 0, "    return {}\nend", result.unwrap_or_default());
        } else {
            self.text += "    return finish_preparation(geometry, base, once, 1.0)\nend\n";
        }
    }

    /// A public function of a state.
    fn write_public_function(&mut self, k: usize) {
        let function = &self.functions[k];
        let (name, n_outputs, follows) = (function.name, function.routine.n_outputs, function.follows);
        let count = function.program.count_operations(ProgramStage::State);
        let doc = function.doc.clone();
        let parts = function.parts.clone();
        let near = if follows { ", near = nothing" } else { "" };
        put!(self, 0, "\n\"\"\"\n{doc}. {count}.");
        if follows {
            self.text += "`near`: passive coordinates of a nearby pose, which are replaced by those of this state.\n";
        }
        put!(self, 0, "\"\"\"\nfunction {name}(dynamics, {}{near})", self.state);
        for array in self.state.split(", ") {
            let n = if array == "load" { "N_DRIVES" } else { "N_ACTIVE" };
            put!(self, 1, "check_length({array}, {n})");
        }
        put!(self, 1, "inputs = vcat({})", self.state);
        self.text += "    check_fine(inputs)\n";
        if follows {
            self.text += "    inputs = vcat(inputs, passive_position(dynamics, q, near))\n";
        }
        put!(self, 1, "outputs = zeros({n_outputs})");
        put!(self, 1, "check({name}_program!(outputs, dynamics, inputs))");
        // A single part is returned as it is, several parts by name.
        let mut at = 0;
        let mut values = Vec::new();
        for part in &parts {
            let value = match part.n_columns {
                Some(n_columns) => format!("matrix(outputs, {at}, {}, {n_columns})", part.n_rows),
                None if part.n_outputs() == n_outputs => "outputs".to_owned(),
                None => format!("outputs[{}:{}]", at + 1, at + part.n_rows),
            };
            at += part.n_outputs();
            values.push((part.name, value));
        }
        let result = match values.as_slice() {
            [(_, value)] => value.clone(),
            several => {
                let fields: Vec<String> = several
                    .iter()
                    .map(|(name, value)| format!("{name} = {value}"))
                    .collect();
                format!("({})", fields.join(", "))
            }
        };
        put!(self, 0, "    return {result}\nend");
    }

    /// The function `forward`: solves `M q'' = J' f - bias` for the accelerations.
    fn write_forward_dynamics(&mut self) {
        let follows = |name: &str| self.functions.iter().any(|f| f.name == name && f.follows);
        let [of_matrix, of_bias] =
            ["mass_matrix", "bias_and_drives"].map(|name| if follows(name) { ", near" } else { "" });
        let near = if of_matrix.len() + of_bias.len() > 0 {
            ", near = nothing"
        } else {
            ""
        };
        let text = include_str!("forward.jl")
            .replace("NEAR_MATRIX", of_matrix)
            .replace("NEAR_BIAS", of_bias);
        self.text.push('\n');
        self.text
            .push_str(&text.replace("NEAR_DEFAULT", near).replace("STATE", self.state));
    }
}

/// A comment behind a statement; nothing if it is empty.
fn remark(text: &str) -> String {
    let text = comment(text);
    if text.is_empty() { text } else { format!(" # {text}") }
}

/// Text of the model file for use inside a comment of one line.
fn comment(text: &str) -> String {
    modelmill_boundary::text::comment(text).into_owned()
}

/// A text as a literal.
fn quoted(text: &str) -> String {
    let text = comment(text).replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", text.replace('$', "\\$"))
}
