//! A program as C source for many states at once, with the vector types of GCC and Clang. The process compiles it for
//! its own use and calls it.
//!
//! It is a fast evaluator and no interface for users. States are read from their arrays with any strides. If any state
//! is irregular (a pose without a solution, a NaN, an angle of many turns), the code reports it and the evaluator takes
//! over.
//!
//! Decision: C vectors need no crates, no Rust toolchain and two seconds; the generated Rust module would need all
//! of these. Some 64 states are turned into columns in the fastest cache while the next ones are prefetched;
//! without that, states stored row by row took half as long again.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use modelmill_codegen::expr::{Atom, Unary};
use modelmill_codegen::{Derivation, PoseGuard, ProgramOp, ProgramStage, SINGULAR, StraightLineProgram, ValueId};
use modelmill_spec::Mechanism;

use super::tree::in_order;

/// The part that is the same for all programs: vector types, transposition, sine and cosine.
const SUPPORT: &str = include_str!("vectors.c");

/// The source of `int run(n, arrays, by_state, by_column, base, out)` for one of the derivation's programs.
///
/// `arrays` are positions, rates, accelerations and loads; a missing one is null. `by_state` and `by_column` are the
/// distances between states and between columns, in doubles. `base` are the base parameters, and `out` receives `width`
/// numbers per state, one state after the other. `run` returns 0, or 1 if a state is irregular or an array that is read
/// is missing.
/// a state is irregular or something that is read is not given.
///
/// A block of states is transposed into columns in the cache, where the program reads them, and its results are
/// transposed back into rows. The statements are in the order of the emitted Rust.
///
/// Passive coordinates must have a closed form.
pub fn vectors_c(derivation: &Derivation, program: &StraightLineProgram, width: usize) -> String {
    let mechanism = &derivation.mechanism;
    let (active, _) = derivation.coordinates();
    let n_active = active.len();
    // Position of a coordinate among the active ones.
    let place = |coordinate: usize| {
        let place = active.iter().position(|a| *a == coordinate);
        place.expect("passive coordinates are replaced by their closed form")
    };
    // Array and line of an input: positions, rates, accelerations and loads follow each other.
    let input = |atom: Atom| match atom {
        Atom::Coordinate(c) => Some((0, place(c))),
        Atom::Rate(c) => Some((1, n_active + place(c))),
        Atom::Acceleration(c) => Some((2, 2 * n_active + place(c))),
        Atom::Load(d) => Some((3, 3 * n_active + d)),
        _ => None,
    };
    // Values that do not depend on the state are scalars in front of the loop.
    let is_fixed = |value: ValueId| program.stages[value.index()] == ProgramStage::Fixed;
    // Which arrays the program reads, and up to which line; of the loads only those up to the last one that is read.
    let read = program.ops.iter().filter_map(|op| match op {
        ProgramOp::Input(atom) => input(*atom),
        _ => None,
    });
    let (parts, places): (BTreeSet<usize>, Vec<usize>) = read.unzip();
    // Columns per array: one per active coordinate, and the loads up to the last one that is read.
    let loads = places.iter().map(|k| (k + 1).saturating_sub(3 * n_active));
    let widths = [n_active, n_active, n_active, loads.max().unwrap_or(0)];

    // One statement per operation: fixed values in front of the loop, values of a state inside it.
    let (mut fixed, mut of_state) = (String::new(), String::new());
    let n = program.ops.len();
    // The order of the emitted Rust, without names and sections.
    for i in in_order(program, &vec![false; n], &vec![false; n], &vec![0; n]) {
        let op = &program.ops[i];
        let _ = match program.stages[i] {
            ProgramStage::Fixed => writeln!(fixed, "    const double x{i} = {};", scalar_operation(op, mechanism)),
            ProgramStage::State => {
                let statement = vector_statement(i, op, &|atom| input(atom).map(|(_, k)| k), &is_fixed);
                writeln!(of_state, "            {statement}")
            }
        };
    }
    // Guards set bits of `bad` or make `none` NaN; both are checked once per call.
    for guard in &program.guards {
        let value = vector_operand(guard.value(), &is_fixed);
        let _ = match guard {
            // The complement is taken, so that NaN sets the bits.
            PoseGuard::Reachable(_) => writeln!(of_state, "            bad |= ~({value} >= 0.0);"),
            PoseGuard::Regular(_, size) => {
                let size = vector_operand(*size, &is_fixed);
                // A determinant is compared with the magnitude of its terms.
                let holds = format!("absolute({value}) > {SINGULAR:e} * {size}");
                writeln!(of_state, "            bad |= ~({holds});")
            }
            // NaN and infinity are collected in `none`.
            PoseGuard::Finite(_) => writeln!(of_state, "            look_at({value}, &none);"),
        };
    }
    // Results go to lines like those of the inputs.
    // The caller may want the first outputs only.
    for (k, output) in program.outputs.iter().take(width).enumerate() {
        let value = vector_operand(*output, &is_fixed);
        let _ = writeln!(of_state, "            found[{k} * LINES] = {value};");
    }
    // Checks for missing arrays, transposition of inputs, and prefetching, one line per array.
    let [mut given, mut reads, mut fetches] = [const { String::new() }; 3];
    for part in 0..widths.len() {
        // An array that is read must be given.
        if parts.contains(&part) {
            let _ = writeln!(given, "    if (!arrays[{part}]) return 1;");
        }
        // A NaN is a fault even in an array that the program does not read; loads are checked only if they are read.
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
    // The frame: blocks of LINES * LANES states, a loop over lines of LANES states, and the results.
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

/// The name of a value as a vector; a fixed scalar is broadcast.
fn vector_operand(value: ValueId, is_fixed: &dyn Fn(ValueId) -> bool) -> String {
    let i = value.index();
    if is_fixed(value) {
        format!("all(x{i})")
    } else {
        format!("x{i}")
    }
}

/// A number with as many digits as are needed to read the same number back.
fn number_literal(value: f64) -> String {
    format!("{value:e}")
}

/// Operands and sign of an arithmetic operation; `None` for all others.
fn binary_operator(op: &ProgramOp) -> Option<(usize, char, usize)> {
    Some(match op {
        ProgramOp::Add(a, b) => (a.index(), '+', b.index()),
        ProgramOp::Sub(a, b) => (a.index(), '-', b.index()),
        ProgramOp::Mul(a, b) => (a.index(), '*', b.index()),
        ProgramOp::Div(a, b) => (a.index(), '/', b.index()),
        _ => return None,
    })
}

/// The C function of one operand.
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

/// The right side of a fixed value, computed in scalars.
fn scalar_operation(op: &ProgramOp, mechanism: &Mechanism) -> String {
    // Arithmetic is the same for scalars.
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

/// The statement that computes value `i` at the LANES states of a line. `line` maps an input to its position among the
/// lines.
fn vector_statement(
    i: usize,
    op: &ProgramOp,
    line: &dyn Fn(Atom) -> Option<usize>,
    is_fixed: &dyn Fn(ValueId) -> bool,
) -> String {
    // Arithmetic on vectors; the compiler broadcasts scalars.
    if let Some((a, sign, b)) = binary_operator(op) {
        return format!("const V x{i} = x{a} {sign} x{b};");
    }
    // Operands of functions may be fixed, and are broadcast then.
    let wide = |value: &ValueId| self::vector_operand(*value, is_fixed);
    // Inputs of a state are read from the lines.
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
        // Functions without a vector form are applied lane by lane.
        ProgramOp::Unary(unary, a) => {
            format!("V x{i} = {}; EACH(x{i}, {});", wide(a), function_name(*unary))
        }
        other => unreachable!("{other:?} is the same for all states"),
    }
}
