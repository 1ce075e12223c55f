//! The function `self_test` of the C source, which compares base parameters with all parameters at random states.

use std::fmt::Write as _;

use super::TranslationUnit;
use super::source::{parameter_bindings, single_value};
use crate::language::syntax::LanguageSyntax;
use crate::tree::StatementRoutine;

/// Appends the test: the regressor H for all products, the numeric helpers, and the function itself.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn self_test(unit: &TranslationUnit<'_>, text: &mut String) {
    let TranslationUnit { name, upper, .. } = unit;
    // Only if the self-test is requested.
    let Some((function, once)) = &unit.columns else {
        return;
    };
    let derivation = unit.source.derivation;
    let mechanism = &derivation.mechanism;
    let c = unit.syntax();
    let n_products = derivation.reduction.products.len();
    let kept = once.kept.len().max(1);
    _ = writeln!(
        text,
        // H has precomputed values of its own, in a struct of its own.
        "\n#define {upper}_N_PRODUCTS {n_products}
typedef struct {{
    {name}_geometry geometry;
    double once[{kept}];
}} {name}_all_columns;"
    );
    super::source::write_program(unit, function, once, "all_columns", text);
    _ = writeln!(
        text,
        "\nstatic void {name}_prepare_columns({name}_all_columns *self, const {name}_geometry *geometry)\n{{"
    );
    let lines = super::source::once_lines(unit, once, "geometry->", "", "");
    super::source::write_body(&lines, text);
    _ = writeln!(text, "    self->geometry = *geometry;\n}}\n");
    text.push_str(&unit.expand_template(include_str!("self_test.c")));

    let (active, _) = derivation.coordinates();
    // Lengths are scaled with the geometry, so that the states stay near the nominal pose of a larger machine.
    // Whether lengths are in the loops.
    let has_scale = derivation.programs.scale.is_some();
    let is_length = |i: &usize| mechanism.coordinates[*i].motion.is_length();
    let scaled = |i: &usize, value: f64| {
        if has_scale && is_length(i) {
            format!("scale * {value:?}")
        } else {
            format!("{value:?}")
        }
    };
    // Inputs of H: a state, followed by the passive coordinates if Newton's method solves for them.
    let n_active = unit.n_active();
    let n_state: usize = unit.state_parts().iter().map(|(_, n)| n).sum();
    let n_inputs = n_state + if function.follows { unit.n_passive() } else { 0 };
    // Declarations of the function's variables come first.
    let mut lines = vec![
        format!("{name}_all_columns all;"),
        format!("{name}_parameters parameters;"),
        format!("{name}_dynamics dynamics;"),
        format!(
            "double products[{n_products}], base[{}], forces[{upper}_N_DRIVES];",
            unit.n_base().max(1)
        ),
        format!(
            "double h[{upper}_N_DRIVES * {n_products}], h_min[{}], inputs[{n_inputs}];",
            (unit.n_drives() * unit.n_base()).max(1)
        ),
        format!(
            "double all_triangle[{n_products} * {n_products}], few_triangle[{0} * {0}];",
            unit.n_base().max(1)
        ),
        format!("double nominal[{n_active}], reach_of[{n_active}], unit_of[{n_active}], reach = 1.0;"),
        "uint64_t draw = 2, random = 1;".to_owned(),
        format!("int halving, k, i, d, found = 0, worst = 0; const int needed = 2 * {n_products} + 20;"),
    ];
    // The scale is computed in a block of its own, because its names may repeat.
    if let Some(program) = &derivation.programs.scale {
        let routine = StatementRoutine::new(program, &unit.scope, &[]);
        let read = routine.read_once.union(&routine.read).copied().collect();
        lines.push("double scale;".to_owned());
        lines.push("{".to_owned());
        parameter_bindings(unit, &read, "geometry->", "", "", &mut lines);
        c.statements(&routine.once, &mut lines);
        if let Some(result) = routine.results.first() {
            lines.push(format!("scale = {};", single_value(unit, result)));
        }
        lines.push("}".to_owned());
        lines.push("(void)scale;".to_owned());
    }
    let self_test_reach = derivation.self_test_reaches();
    // Centre, reach and unit of each coordinate's random values.
    for (k, (i, reach)) in active.iter().zip(self_test_reach).enumerate() {
        lines.push(format!(
            "nominal[{k}] = {}; reach_of[{k}] = {}; unit_of[{k}] = {};",
            scaled(i, mechanism.coordinates[*i].nominal),
            scaled(i, reach),
            scaled(i, 1.0)
        ));
    }
    // Start from the nominal parameters.
    lines.push(format!("{name}_nominal_parameters(&parameters);"));
    // Parameters are random around their nominal values; a zero is replaced, so that every product counts.
    for parameter in &mechanism.parameters {
        let field = c.name(&parameter.name);
        lines.push(format!(
            "parameters.{field} = {name}_between(&draw, 0.5, 1.5) * (parameters.{field} == 0.0 ? 1.0 : parameters.{field});"
        ));
    }
    // Values of the products p_g.
    for (k, product) in derivation.reduction.products.iter().enumerate() {
        let mut value = "1.0".to_owned();
        // A power is a repeated product.
        for (p, n) in &product.0 {
            for _ in 0..*n {
                _ = write!(value, " * parameters.{}", c.name(&mechanism.parameters[*p].name));
            }
        }
        lines.push(format!("products[{k}] = {value};"));
    }
    lines.push(format!(
        "if ({name}_base_parameters(geometry, &parameters, base) != {upper}_OK)\n        return 6;"
    ));
    lines.push(format!("(void){name}_prepare(&dynamics, geometry, base);"));
    lines.push(format!("{name}_prepare_columns(&all, geometry);"));
    lines.push(format!(
        "memset(all_triangle, 0, {n_products} * {n_products} * sizeof(double));"
    ));
    lines.push(format!(
        "memset(few_triangle, 0, {upper}_N_BASE * {upper}_N_BASE * sizeof(double));"
    ));
    // The parts of the state are ranges of the inputs.
    let mut at = 0;
    let mut parts = Vec::new();
    for (part, n) in unit.state_parts() {
        parts.push(format!("inputs + {at}"));
        at += n;
        _ = part;
    }
    // The state as arguments of the public functions.
    let arguments = parts.join(", ");
    // Random loads if an effect depends on them.
    let load = if unit.load {
        format!(
            "\n            for (d = 0; d < {upper}_N_DRIVES; d++)\n                inputs[3 * {n_active} + d] = {name}_between(&random, -50.0, 50.0);"
        )
    } else {
        String::new()
    };
    // A pose without a solution is skipped.
    let follow = if function.follows {
        format!(
            "\n            if ({name}_passive_position(&dynamics, inputs, inputs + {n_state}) != {upper}_OK)\n                continue;"
        )
    } else {
        String::new()
    };
    // The reach is halved when too few states had a solution.
    _ = writeln!(text, "\nint {name}_self_test(const {name}_geometry *geometry)\n{{");
    super::source::write_body(&lines, text);
    _ = writeln!(
        text,
        "    for (halving = 0; halving <= 4; halving++) {{
        for (k = 0; k < needed && found < needed; k++) {{
            for (i = 0; i < {n_active}; i++)
                inputs[i] = nominal[i] + reach * reach_of[i] * {name}_between(&random, -1.0, 1.0);
            for (i = 0; i < {n_active}; i++)
                inputs[{n_active} + i] = unit_of[i] * {name}_between(&random, -2.0, 2.0);
            for (i = 0; i < {n_active}; i++)
                inputs[2 * {n_active} + i] = unit_of[i] * {name}_between(&random, -8.0, 8.0);{load}{follow}
            if ({name}_regressor(&dynamics, {arguments}, h_min) != {upper}_OK
                || {name}_inverse_dynamics(&dynamics, {arguments}, forces) != {upper}_OK
                || {name}_columns_program(&all, inputs, h) != {upper}_OK)
                continue;
            found++;
            for (d = 0; d < {upper}_N_DRIVES; d++) {{
                double expected = 0.0, reduced = 0.0, size = 0.0;
                for (i = 0; i < {n_products}; i++) {{
                    expected += h[d * {n_products} + i] * products[i];
                    size += fabs(h[d * {n_products} + i] * products[i]);
                }}
                for (i = 0; i < {upper}_N_BASE; i++) {{
                    reduced += h_min[d * {upper}_N_BASE + i] * base[i];
                    size += fabs(h_min[d * {upper}_N_BASE + i] * base[i]);
                }}
                /* NaN is an error too: every comparison with it is false. */
                if (worst == 0 && !(fabs(reduced - expected) <= NOTHING * size))
                    worst = 4;
                if (worst == 0 && !(fabs(forces[d] - expected) <= NOTHING * size))
                    worst = 5;
                {name}_take_row(all_triangle, h + d * {n_products}, {n_products});
                {name}_take_row(few_triangle, h_min + d * {upper}_N_BASE, {upper}_N_BASE);
            }}
        }}
        reach *= 0.5;
    }}
    if (found < needed)
        return 1;
    if ({name}_rank(few_triangle, {upper}_N_BASE) != {upper}_N_BASE)
        return 2;
    if ({name}_rank(all_triangle, {n_products}) != {upper}_N_BASE)
        return 3;
    return worst;
}}"
    );
}
