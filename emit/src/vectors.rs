//! A program as C for many states at once, in the vectors of GCC and Clang: what a process compiles for itself and calls at once.
//!
//! It is the evaluator made fast, not a face for users: states are read where they lie, with any strides, and where anything is
//! irregular (a pose without an answer, a number that is none, an angle of many turns) it says so and leaves the rest to the
//! evaluator.

//!
//! Decision: C vectors need no crates, no Rust toolchain and two seconds; the generated Rust module would need all
//! of these. Some 64 states are turned into columns in the fastest cache while the next ones are prefetched;
//! without that, states stored row by row took half as long again.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use modelmill_codegen::expr::{Atom, Unary};
use modelmill_codegen::{
    Derivation, PoseGuard, ProgramOp, ProgramStage, SINGULAR, StraightLineProgram, ValueId,
};
use modelmill_spec::Mechanism;

use super::tree::in_order;

/// What does not depend on the program: vectors, sines and cosines.
const SUPPORT: &str = include_str!("vectors.c");

/// The source of `int run(n, arrays, by_state, by_column, base, out)`. `arrays` are positions, rates, accelerations and loads,
/// whose numbers are so many doubles apart from state to state and from column to column; those that are not given are null.
/// `base` are the base parameters; `out` gets `width` numbers for each state, one state after the other. It returns 0, or 1 where
/// a state is irregular or something that is read is not given.
///
/// Some states at once are turned into columns in the cache, where the program reads them, and its results are turned back into
/// rows; its statements stand in the order in which the emitted Rust has them.
///
/// The program is one of the derivation's; passive coordinates must have a closed form.
pub fn vectors_c(derivation: &Derivation, program: &StraightLineProgram, width: usize) -> String {
    let mechanism = &derivation.mechanism;
    let (active, _) = derivation.coordinates();
    let n_active = active.len();
    let place = |coordinate: usize| {
        let place = active.iter().position(|a| *a == coordinate);
        place.expect("passive coordinates are put in place")
    };
    // Where a line of an input stands, and of which array it is.
    let input = |atom: Atom| match atom {
        Atom::Coordinate(c) => Some((0, place(c))),
        Atom::Rate(c) => Some((1, n_active + place(c))),
        Atom::Acceleration(c) => Some((2, 2 * n_active + place(c))),
        Atom::Load(d) => Some((3, 3 * n_active + d)),
        _ => None,
    };
    let is_fixed = |value: ValueId| program.stages[value.index()] == ProgramStage::Fixed;
    let read = program.ops.iter().filter_map(|op| match op {
        ProgramOp::Input(atom) => input(*atom),
        _ => None,
    });
    let (parts, places): (BTreeSet<usize>, Vec<usize>) = read.unzip();
    let loads = places.iter().map(|k| (k + 1).saturating_sub(3 * n_active));
    let widths = [n_active, n_active, n_active, loads.max().unwrap_or(0)];

    let (mut fixed, mut of_state) = (String::new(), String::new());
    let n = program.ops.len();
    for i in in_order(program, &vec![false; n], &vec![false; n], &vec![0; n]) {
        let op = &program.ops[i];
        let _ = match program.stages[i] {
            ProgramStage::Fixed => writeln!(
                fixed,
                "    const double x{i} = {};",
                scalar_operation(op, mechanism)
            ),
            ProgramStage::State => {
                let statement =
                    vector_statement(i, op, &|atom| input(atom).map(|(_, k)| k), &is_fixed);
                writeln!(of_state, "            {statement}")
            }
        };
    }
    for guard in &program.guards {
        let value = vector_operand(guard.value(), &is_fixed);
        let _ = match guard {
            PoseGuard::Reachable(_) => writeln!(of_state, "            bad |= ~({value} >= 0.0);"),
            PoseGuard::Regular(_, size) => {
                let size = vector_operand(*size, &is_fixed);
                let holds = format!("absolute({value}) > {SINGULAR:e} * {size}");
                writeln!(of_state, "            bad |= ~({holds});")
            }
            PoseGuard::Finite(_) => writeln!(of_state, "            look_at({value}, &none);"),
        };
    }
    for (k, output) in program.outputs.iter().take(width).enumerate() {
        let value = vector_operand(*output, &is_fixed);
        let _ = writeln!(of_state, "            found[{k} * LINES] = {value};");
    }
    let [mut given, mut reads, mut fetches] = [const { String::new() }; 3];
    for part in 0..widths.len() {
        if parts.contains(&part) {
            let _ = writeln!(given, "    if (!arrays[{part}]) return 1;");
        }
        // A number that is none is a fault also where the program does not read it; loads are looked at where they are read.
        if part < 3 || parts.contains(&part) {
            let _ = writeln!(
                reads,
                "        read(arrays[{part}], i, by_state[{part}], by_column[{part}], {}, m, lines + {} * LINES, &none);",
                widths[part],
                part * n_active
            );
            let _ = writeln!(
                fetches,
                "                fetch(arrays[{part}], ahead, by_state[{part}], by_column[{part}], {}, 0);",
                widths[part]
            );
        }
    }
    format!(
        "#define READ {}
#define WIDTH {width}
{SUPPORT}
int run(long n, const double *const *arrays, const long *by_state, const long *by_column, const double *base, double *out)
{{
    (void)base;
{given}{fixed}
    V lines[READ * LINES], results[WIDTH * LINES];
    V none = {{0}};
    W bad = {{0}};
    for (long i = 0; i < n; i += LINES * LANES) {{
        const long m = n - i < LINES * LANES ? n - i : LINES * LANES;
{reads}        for (long line = 0; line * LANES < m; line++) {{
            const V *const in = lines + line;
            V *const found = results + line;
            if (line * LANES % CACHE_LINE == 0) {{
                const long ahead = i + line * LANES + AHEAD;
                fetch(out, ahead, WIDTH, 1, WIDTH, 1);
{fetches}            }}
{of_state}        }}
        write(results, m, out + i * WIDTH, &none);
    }}
    return is_irregular(none, bad);
}}
",
        widths.iter().sum::<usize>()
    )
}

/// A value as a vector.
fn vector_operand(value: ValueId, is_fixed: &dyn Fn(ValueId) -> bool) -> String {
    let i = value.index();
    if is_fixed(value) {
        format!("all(x{i})")
    } else {
        format!("x{i}")
    }
}

fn number_literal(value: f64) -> String {
    format!("{value:e}")
}

fn binary_operator(op: &ProgramOp) -> Option<(usize, char, usize)> {
    Some(match op {
        ProgramOp::Add(a, b) => (a.index(), '+', b.index()),
        ProgramOp::Sub(a, b) => (a.index(), '-', b.index()),
        ProgramOp::Mul(a, b) => (a.index(), '*', b.index()),
        ProgramOp::Div(a, b) => (a.index(), '/', b.index()),
        _ => return None,
    })
}

fn function_name(unary: Unary) -> &'static str {
    match unary {
        Unary::Sqrt => "sqrt",
        Unary::Sign => "sign",
        Unary::Abs => "fabs",
        Unary::Tanh => "tanh",
        Unary::Exp => "exp",
        Unary::Sin => "sin",
        Unary::Cos => "cos",
    }
}

/// An operation whose value is the same for all states.
fn scalar_operation(op: &ProgramOp, mechanism: &Mechanism) -> String {
    if let Some((a, sign, b)) = binary_operator(op) {
        return format!("x{a} {sign} x{b}");
    }
    match op {
        ProgramOp::Number(value) => number_literal(value.to_f64()),
        ProgramOp::Input(Atom::Pi) => number_literal(std::f64::consts::PI),
        ProgramOp::Input(Atom::Constant(i)) => number_literal(mechanism.constants[*i].value),
        ProgramOp::Input(Atom::Parameter(i)) => number_literal(mechanism.parameters[*i].nominal),
        ProgramOp::Input(Atom::Base(k)) => format!("base[{k}]"),
        ProgramOp::Neg(a) => format!("-x{}", a.index()),
        ProgramOp::Sin(a) => format!("sin(x{})", a.index()),
        ProgramOp::Cos(a) => format!("cos(x{})", a.index()),
        ProgramOp::Atan2(y, x) => format!("atan2(x{}, x{})", y.index(), x.index()),
        ProgramOp::Unary(unary, a) => format!("{}(x{})", function_name(*unary), a.index()),
        other => unreachable!("{other:?} is an operation of a state"),
    }
}

/// The statement of an operation on the states of a line.
fn vector_statement(
    i: usize,
    op: &ProgramOp,
    line: &dyn Fn(Atom) -> Option<usize>,
    is_fixed: &dyn Fn(ValueId) -> bool,
) -> String {
    if let Some((a, sign, b)) = binary_operator(op) {
        return format!("const V x{i} = x{a} {sign} x{b};");
    }
    let wide = |value: &ValueId| self::vector_operand(*value, is_fixed);
    if let ProgramOp::Input(atom) = op
        && let Some(k) = line(*atom)
    {
        return format!("const V x{i} = in[{k} * LINES];");
    }
    match op {
        ProgramOp::Neg(a) => format!("const V x{i} = -x{};", a.index()),
        ProgramOp::Sin(a) => format!("const V x{i} = sine({}, &bad);", wide(a)),
        ProgramOp::Cos(a) => format!("const V x{i} = cosine({}, &bad);", wide(a)),
        ProgramOp::Atan2(y, x) => format!("const V x{i} = angle({}, {});", wide(y), wide(x)),
        ProgramOp::Unary(Unary::Abs, a) => format!("const V x{i} = absolute({});", wide(a)),
        ProgramOp::Unary(unary, a) => {
            format!(
                "V x{i} = {}; EACH(x{i}, {});",
                wide(a),
                function_name(*unary)
            )
        }
        other => unreachable!("{other:?} is the same for all states"),
    }
}
