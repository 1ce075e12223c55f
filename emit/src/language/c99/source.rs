//! The C source: programs as static functions, and the public functions that call them.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use modelmill_codegen::expr::Atom;
use modelmill_codegen::{OperationCount, ProgramStage};

use super::header::{forward_dynamics_declaration, signature};
use super::statements::{CSyntax, comment};
use super::{TranslationUnit, newton, self_test};
use crate::fingerprint::Fingerprint;
use crate::language::syntax::LanguageSyntax;
use crate::tree::{BaseParameterCode, CodeExpression, PrecomputedValues, ProgramFunction};

/// Operations per state of a function.
pub(super) fn operation_count(function: &ProgramFunction<'_>) -> OperationCount {
    function.program.count_operations(ProgramStage::State)
}

/// The source file: it compiles only with the header of the same fingerprint.
pub(super) fn complete_source(unit: &TranslationUnit<'_>, body: &str, fingerprint: Fingerprint) -> String {
    let TranslationUnit { name, upper, .. } = unit;
    format!(
        "/* Written by modelmill; do not edit. See {name}.h. */
#include \"{name}.h\"

#if !defined({upper}_FINGERPRINT) || {upper}_FINGERPRINT != {fingerprint}ULL
#error \"{name}.h and {name}.c belong to different models or options; generate both again\"
#endif

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

{body}"
    )
}

/// The text of the source file after its includes. Helpers that no statement calls are left out, so that no compiler
/// warns of them.
pub(super) fn source_body(unit: &TranslationUnit<'_>) -> String {
    let name = &unit.name;
    let mut text = String::new();
    // Helpers: checks of inputs, sines and cosines, signs, linear systems.
    text.push_str(&unit.expand_template(include_str!("support.c")));
    if has_call(unit, "_sin_cos") {
        text.push('\n');
        text.push_str(&unit.expand_template(include_str!("sin_cos.c")));
    }
    if has_call(unit, "_sign(") {
        _ = writeln!(
            text,
            "\nstatic double {name}_sign(double x)\n{{\n    return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x;\n}}"
        );
    }
    // Newton's method and forward dynamics solve linear systems.
    if unit.newton || unit.source.dynamics.is_some() {
        text.push('\n');
        text.push_str(&unit.expand_template(include_str!("solve.c")));
    }
    // Default values and base parameters.
    write_records(unit, &mut text);
    write_base_parameters(unit, &mut text);
    // Programs first, then preparation and inputs, then the public functions that use them.
    for function in &unit.functions {
        write_program(unit, function, &unit.once, "dynamics", &mut text);
    }
    // The solution for the passive coordinates needs the programs above.
    if unit.newton {
        newton::newton(unit, &mut text);
    }
    write_preparation(unit, &mut text);
    write_state_inputs(unit, &mut text);
    for function in unit.functions.iter().filter(|f| f.is_public) {
        write_public_function(unit, function, "dynamics", &mut text);
    }
    if unit.source.dynamics.is_some() {
        write_bias(unit, &mut text);
        write_forward_dynamics(unit, &mut text);
    }
    // Reactions are a struct of their own.
    if let Some((function, once)) = &unit.reactions {
        write_program(unit, function, once, "reactions", &mut text);
        write_reaction_preparation(unit, function, once, &mut text);
        write_public_function(unit, function, "reactions", &mut text);
    }
    // The self-test is last, because it calls public functions.
    if unit.columns.is_some() {
        self_test::self_test(unit, &mut text);
    }
    text
}

/// Whether any statement calls a function whose name is that of the unit followed by `what`.
fn has_call(unit: &TranslationUnit<'_>, what: &str) -> bool {
    let c = unit.syntax();
    // All statements as they will be printed.
    let mut lines = Vec::new();
    // Programs with precomputed values of their own.
    let others = unit.reactions.iter().chain(&unit.columns);
    c.statements(&unit.once.statements(), &mut lines);
    for (function, once) in others {
        c.statements(&once.statements(), &mut lines);
        c.statements(&function.routine.state, &mut lines);
    }
    for function in &unit.functions {
        c.statements(&function.routine.state, &mut lines);
    }
    lines.iter().any(|line| line.contains(&format!("{}{what}", unit.name)))
}

impl TranslationUnit<'_> {
    /// The syntax of C with the names of this unit.
    pub(super) fn syntax(&self) -> CSyntax<'_> {
        CSyntax {
            name: &self.name,
            upper: &self.upper,
        }
    }
}

/// The functions that fill geometry and parameters with the values of the model file.
fn write_records(unit: &TranslationUnit<'_>, text: &mut String) {
    let (name, c) = (&unit.name, unit.syntax());
    let mechanism = &unit.source.derivation.mechanism;
    let constants = mechanism.constants.iter().map(|x| (x.name.as_str(), x.value));
    let parameters = mechanism.parameters.iter().map(|x| (x.name.as_str(), x.nominal));
    // A struct without fields has one that is not used, because C allows no empty struct.
    let mut record = |function: &str, of: &str, values: Vec<(&str, f64)>| {
        _ = writeln!(text, "\nvoid {name}_{function}({name}_{of} *{of})\n{{");
        // One assignment per field.
        for (field, value) in &values {
            _ = writeln!(text, "    {of}->{} = {};", c.name(field), c.number(*value));
        }
        if values.is_empty() {
            _ = writeln!(text, "    {of}->nothing = 0.0;");
        }
        text.push_str("}\n");
    };
    record("default_geometry", "geometry", constants.collect());
    record("nominal_parameters", "parameters", parameters.collect());
}

/// The function that computes base parameters from physical parameters, eq. (16).
fn write_base_parameters(unit: &TranslationUnit<'_>, text: &mut String) {
    let (name, c) = (&unit.name, unit.syntax());
    let derivation = unit.source.derivation;
    let BaseParameterCode {
        sums,
        values,
        divisors,
        read,
    } = crate::tree::base_parameters(derivation, &unit.scope);
    _ = writeln!(
        text,
        "\nint {name}_base_parameters(const {name}_geometry *geometry, const {name}_parameters *parameters, double *base)\n{{"
    );
    let mut lines = Vec::new();
    parameter_bindings(unit, &read, "geometry->", "parameters->", "", &mut lines);
    // Unread arguments are marked, so that compilers do not warn.
    if !read.iter().any(|atom| matches!(atom, Atom::Constant(_))) {
        lines.push("(void)geometry;".to_owned());
    }
    if !read.iter().any(|atom| matches!(atom, Atom::Parameter(_))) {
        lines.push("(void)parameters;".to_owned());
    }
    // A denominator that is zero at this geometry is reported by its text.
    for divisor in &divisors {
        lines.push(format!(
            "if (!(fabs({}) > SINGULAR_SHARE * {})) return {}_SPECIAL; /* {} is zero */",
            c.operand_text(&divisor.value),
            c.grouped_text(&divisor.size),
            unit.upper,
            comment(&divisor.text)
        ));
    }
    // Sums before the base parameters that refer to them.
    for (name, value) in &sums {
        lines.push(format!("const double {name} = {};", c.operand_text(value)));
    }
    for (k, value) in values.iter().enumerate() {
        lines.push(format!("base[{k}] = {};", c.operand_text(value)));
    }
    if values.is_empty() {
        lines.push("(void)base;".to_owned());
    }
    lines.push(format!("return {}_OK;", unit.upper));
    write_body(&lines, text);
    text.push_str("}\n");
}

/// Declarations of the constants, parameters and base parameters that are read. `geometry`, `parameters` and `base` are
/// the expressions in front of a field or an index.
pub(super) fn parameter_bindings(
    unit: &TranslationUnit<'_>,
    read: &BTreeSet<Atom>,
    geometry: &str,
    parameters: &str,
    base: &str,
    lines: &mut Vec<String>,
) {
    let c = unit.syntax();
    let mechanism = &unit.source.derivation.mechanism;
    for atom in read {
        // Where the value comes from.
        let value = match atom {
            Atom::Constant(i) => format!("{geometry}{}", c.name(&mechanism.constants[*i].name)),
            Atom::Parameter(i) => {
                format!("{parameters}{}", c.name(&mechanism.parameters[*i].name))
            }
            Atom::Base(k) => format!("{base}[{k}]"),
            Atom::Pi => format!("{:?}", std::f64::consts::PI),
            _ => continue,
        };
        lines.push(format!(
            "const double {} = {value};",
            c.name(unit.scope.input_name(*atom))
        ));
    }
}

/// Appends the lines of a function body, indented.
pub(super) fn write_body(lines: &[String], text: &mut String) {
    for line in lines {
        _ = writeln!(text, "    {line}");
    }
}

/// A program as a static function from `inputs` to `outputs`. `owner` is the struct with the precomputed values.
pub(super) fn write_program(
    unit: &TranslationUnit<'_>,
    function: &ProgramFunction<'_>,
    once: &PrecomputedValues,
    owner: &str,
    text: &mut String,
) {
    let (name, c) = (&unit.name, unit.syntax());
    // Statements and inputs of the program.
    let routine = &function.routine;
    _ = writeln!(
        text,
        "\nstatic int {name}_{}_program(const {name}_{owner} *restrict self, const double *restrict inputs, double *restrict outputs)\n{{",
        function.name
    );
    let mut lines = Vec::new();
    // Reactions contain a prepared model; its geometry is one level deeper.
    let within = if owner == "reactions" { "dynamics." } else { "" };
    parameter_bindings(
        unit,
        &routine.read,
        &format!("self->{within}geometry."),
        "self->parameters.",
        "self->base",
        &mut lines,
    );
    // Precomputed values that this program reads.
    for (k, kept) in once.kept.iter().enumerate() {
        if routine.kept.contains(kept) {
            lines.push(format!("const double {} = self->once[{k}];", c.name(kept)));
        }
    }
    // Inputs that this program reads, by name.
    for (k, atom) in function.inputs.iter().enumerate() {
        if routine.read.contains(atom) {
            lines.push(format!(
                "const double {} = inputs[{k}];",
                c.name(unit.scope.input_name(*atom))
            ));
        }
    }
    // A program may read none of its arguments.
    for unused in ["self", "inputs", "outputs"] {
        lines.push(format!("(void){unused};"));
    }
    // Outputs that are always zero have no statement.
    for k in routine.zero_outputs() {
        lines.push(format!("outputs[{k}] = 0.0;"));
    }
    // All other outputs are written by the statements.
    c.statements(&routine.state, &mut lines);
    lines.push(format!("return {}_OK;", unit.upper));
    write_body(&lines, text);
    text.push_str("}\n");
}

/// Statements that compute the precomputed values and store them in `self->once`.
pub(super) fn once_lines(
    unit: &TranslationUnit<'_>,
    once: &PrecomputedValues,
    geometry: &str,
    parameters: &str,
    base: &str,
) -> Vec<String> {
    let c = unit.syntax();
    let mut lines = Vec::new();
    parameter_bindings(unit, &once.read, geometry, parameters, base, &mut lines);
    c.statements(&once.statements(), &mut lines);
    for (k, kept) in once.kept.iter().enumerate() {
        lines.push(format!("self->once[{k}] = {};", c.name(kept)));
    }
    lines
}

/// The function `prepare`: computes what depends only on geometry and base parameters, and checks both.
fn write_preparation(unit: &TranslationUnit<'_>, text: &mut String) {
    let TranslationUnit { name, upper, .. } = unit;
    let c = unit.syntax();
    let constants = &unit.source.derivation.mechanism.constants;
    _ = writeln!(
        text,
        "\nint {name}_prepare({name}_dynamics *dynamics, const {name}_geometry *geometry, const double *base)\n{{\n    \
         {name}_dynamics *self = dynamics;"
    );
    // Precomputed values.
    let mut lines = once_lines(unit, &unit.once, "geometry->", "", "base");
    lines.push("self->geometry = *geometry;".to_owned());
    lines.push(format!("self->input = {upper}_OK;"));
    for k in 0..unit.n_base() {
        lines.push(format!("self->base[{k}] = base[{k}];"));
    }
    // C has no arrays of length zero.
    if unit.n_base() == 0 {
        lines.push("(void)base;".to_owned());
        lines.push("self->base[0] = 0.0;".to_owned());
    }
    // Inputs that are NaN or too large are reported by every later call.
    for constant in constants {
        lines.push(format!(
            "if (!{name}_all_fine(&geometry->{}, 1)) self->input = {upper}_NOT_FINITE;",
            c.name(&constant.name)
        ));
    }
    lines.push(format!(
        "if (!{name}_all_fine(base, {upper}_N_BASE)) self->input = {upper}_NOT_FINITE;"
    ));
    if unit.newton {
        lines.push(format!("{name}_settle(self);"));
    }
    lines.push("return self->input;".to_owned());
    write_body(&lines, text);
    text.push_str("}\n");
}

/// The function that copies a state into the inputs of programs and checks it.
fn write_state_inputs(unit: &TranslationUnit<'_>, text: &mut String) {
    let TranslationUnit { name, upper, .. } = unit;
    let mut lines = Vec::new();
    // Index of the next input.
    let mut next = 0;
    // The parts of the state follow each other in the inputs.
    for (part, n) in unit.state_parts() {
        for k in 0..n {
            lines.push(format!("inputs[{next}] = {part}[{k}];"));
            next += 1;
        }
    }
    lines.push(format!(
        "return {name}_all_fine(inputs, {next}) ? {upper}_OK : {upper}_NOT_FINITE;"
    ));
    _ = writeln!(
        text,
        "\nstatic int {name}_inputs({}, double *inputs)\n{{",
        unit.state_parameters()
    );
    write_body(&lines, text);
    text.push_str("}\n");
}

/// A public function, and a second one with a guess if it follows the loops.
fn write_public_function(unit: &TranslationUnit<'_>, function: &ProgramFunction<'_>, owner: &str, text: &mut String) {
    let TranslationUnit { name, upper, .. } = unit;
    let n_state: usize = unit.state_parts().iter().map(|(_, n)| n).sum();
    // The state, and passive coordinates behind it.
    let n_inputs = n_state + if function.follows { unit.n_passive() } else { 0 };
    // Length of the result.
    let n_outputs = function.routine.n_outputs;
    // The prepared model inside the struct.
    let model = if owner == "reactions" {
        "&reactions->dynamics"
    } else {
        "dynamics"
    };
    // The status of the preparation.
    let input = if owner == "reactions" {
        "reactions->dynamics.input"
    } else {
        "dynamics->input"
    };
    // A program that can fail writes to a local array first, so that results change only if the status is OK.
    let can_fail = function.routine.can_fail();
    let ways: &[bool] = if function.follows { &[false, true] } else { &[false] };
    // The statements of both forms differ in how the passive coordinates are found.
    for near in ways {
        let mut lines = vec![
            format!("double inputs[{}];", n_inputs.max(1)),
            format!("int status = {input};"),
        ];
        // Outputs of a program that may fail.
        if can_fail {
            lines.push(format!("double outputs[{}];", n_outputs.max(1)));
        }
        // The guess is copied, so that it changes only if the status is OK.
        if *near {
            lines.push("int i;".to_owned());
            lines.push(format!("double found[{upper}_N_PASSIVE];"));
        }
        lines.push(format!(
            "if (status == {upper}_OK) status = {name}_inputs({}, inputs);",
            unit.state_arguments()
        ));
        // Passive coordinates follow the state in the inputs.
        match (function.follows, near) {
            (false, _) => {}
            (true, false) => lines.push(format!(
                "if (status == {upper}_OK) status = {name}_passive_position({model}, q, inputs + {n_state});"
            )),
            (true, true) => {
                lines.push(format!(
                    "for (i = 0; i < {upper}_N_PASSIVE; i++) found[i] = passive[i];"
                ));
                lines.push(format!(
                    "if (status == {upper}_OK) status = {name}_passive_position_near({model}, q, found);"
                ));
                lines.push(format!(
                    "for (i = 0; i < {upper}_N_PASSIVE; i++) inputs[{n_state} + i] = found[i];"
                ));
            }
        }
        lines.push(format!("if (status != {upper}_OK) return status;"));
        // A program that cannot fail writes to the caller's array.
        let results = if can_fail { "outputs" } else { function.result };
        lines.push(format!(
            "status = {name}_{}_program({owner}, inputs, {results});",
            function.name
        ));
        lines.push(format!("if (status != {upper}_OK) return status;"));
        // The passive coordinates of this state replace the guess.
        if *near {
            lines.push(format!(
                "for (i = 0; i < {upper}_N_PASSIVE; i++) passive[i] = found[i];"
            ));
        }
        if can_fail {
            lines.push(format!(
                "memcpy({results}, outputs, {n_outputs} * sizeof(double));",
                results = function.result
            ));
        }
        lines.push("return status;".to_owned());
        _ = writeln!(text, "\n{}\n{{", signature(unit, function, owner, *near));
        write_body(&lines, text);
        text.push_str("}\n");
    }
}

/// The function `bias`: the bias forces without the Jacobian of the drives, which is in the same program.
fn write_bias(unit: &TranslationUnit<'_>, text: &mut String) {
    let TranslationUnit { name, upper, .. } = unit;
    let arguments = unit.state_arguments();
    // With and without a guess.
    for near in super::header::bias_variants(unit) {
        let (suffix, passive) = if *near { ("_near", ", passive") } else { ("", "") };
        _ = writeln!(
            text,
            "
{}
{{
    double all[{upper}_N_ACTIVE + {upper}_N_DRIVES * {upper}_N_ACTIVE];
    int status = {name}_bias_and_drives{suffix}(dynamics, {arguments}{passive}, all);
    if (status == {upper}_OK)
        memcpy(bias, all, {upper}_N_ACTIVE * sizeof *bias);
    return status;
}}",
            super::header::bias_declaration(unit, *near)
        );
    }
}

/// The function `forward`: solves `M q'' = J' f - bias` for the accelerations.
fn write_forward_dynamics(unit: &TranslationUnit<'_>, text: &mut String) {
    let TranslationUnit { name, upper, .. } = unit;
    let arguments = unit.state_arguments();
    _ = writeln!(
        text,
        "
{}
{{
    double matrix[{upper}_N_ACTIVE * {upper}_N_ACTIVE], bias[{upper}_N_ACTIVE + {upper}_N_DRIVES * {upper}_N_ACTIVE];
    double found[{upper}_N_ACTIVE];
    int i, d, status = {name}_mass_matrix(dynamics, {arguments}, matrix);
    if (status == {upper}_OK)
        status = {name}_bias_and_drives(dynamics, {arguments}, bias);
    if (status == {upper}_OK && !{name}_all_fine(forces, {upper}_N_DRIVES))
        status = {upper}_NOT_FINITE;
    if (status != {upper}_OK)
        return status;
    for (i = 0; i < {upper}_N_ACTIVE; i++) {{
        found[i] = -bias[i];
        for (d = 0; d < {upper}_N_DRIVES; d++)
            found[i] += bias[{upper}_N_ACTIVE + d * {upper}_N_ACTIVE + i] * forces[d];
    }}
    status = {name}_solve(matrix, found, {upper}_N_ACTIVE);
    for (i = 0; i < {upper}_N_ACTIVE; i++)
        if (status == {upper}_OK && !(fabs(found[i]) <= DBL_MAX))
            status = {upper}_SINGULAR;
    if (status == {upper}_OK)
        memcpy(accelerations, found, sizeof found);
    return status;
}}",
        forward_dynamics_declaration(unit)
    );
}

/// The function `prepare_reactions`: base parameters, the prepared model, and the precomputed values of the reactions.
fn write_reaction_preparation(
    unit: &TranslationUnit<'_>,
    function: &ProgramFunction<'_>,
    once: &PrecomputedValues,
    text: &mut String,
) {
    let TranslationUnit { name, upper, .. } = unit;
    let c = unit.syntax();
    _ = function;
    _ = writeln!(
        text,
        "
int {name}_prepare_reactions({name}_reactions *reactions, const {name}_geometry *geometry, const {name}_parameters *parameters)
{{
    {name}_reactions *self = reactions;
    double base[{}];",
        unit.n_base().max(1)
    );
    // Precomputed values first, because they do not depend on the base parameters.
    let mut lines = once_lines(unit, once, "geometry->", "parameters->", "base");
    lines.push(format!(
        "if ({name}_base_parameters(geometry, parameters, base) != {upper}_OK)\n        return self->dynamics.input = {upper}_SPECIAL;"
    ));
    lines.push(format!("(void){name}_prepare(&self->dynamics, geometry, base);"));
    lines.push("self->parameters = *parameters;".to_owned());
    // Checks of all parameters.
    for parameter in &unit.source.derivation.mechanism.parameters {
        lines.push(format!(
            "if (!{name}_all_fine(&parameters->{}, 1)) self->dynamics.input = {upper}_NOT_FINITE;",
            c.name(&parameter.name)
        ));
    }
    lines.push("return self->dynamics.input;".to_owned());
    write_body(&lines, text);
    text.push_str("}\n");
}

/// The expression of a program's single result.
pub(super) fn single_value(unit: &TranslationUnit<'_>, result: &CodeExpression) -> String {
    unit.syntax().operand_text(result)
}
