//! A program as C for many states at once, in the vectors of GCC and Clang: what a process compiles for itself and calls at once.
//!
//! It is the evaluator made fast, not a face for users: states are read where they lie, with any strides, and where anything is
//! irregular (a pose without an answer, a number that is none, an angle of many turns) it says so and leaves the rest to the
//! evaluator.

use std::fmt::Write as _;

use modelmill_spec::Mechanism;

use crate::expr::{Atom, Unary};
use crate::lower::{Guard, Op, Program, SINGULAR, Stage};
use crate::{Derivation, ValueId};

/// What does not depend on the program: vectors, sines and cosines.
const SUPPORT: &str = include_str!("vectors.c");

/// The source of `int run(n, arrays, by_state, by_column, base, out)`. `arrays` are positions, rates, accelerations and loads,
/// whose numbers are so many doubles apart from state to state and from column to column; `base` are the base parameters; `out`
/// gets `width` numbers for each state, one state after the other. It returns 0, or 1 where a state is irregular; there must be
/// at least 8 states.
///
/// The program is one of the derivation's; passive coordinates must have a closed form.
pub fn vectors_c(derivation: &Derivation, program: &Program, width: usize) -> String {
    let mechanism = &derivation.mechanism;
    let active = &derivation.equations.projection.loops.active;
    let column = |coordinate: usize| {
        let place = active.iter().position(|a| *a == coordinate);
        place.expect("passive coordinates are put in place")
    };
    let is_fixed = |value: ValueId| program.stages[value.index()] == Stage::Fixed;
    let (mut fixed, mut of_state) = (String::new(), String::new());
    for (i, (op, stage)) in program.ops.iter().zip(&program.stages).enumerate() {
        match stage {
            Stage::Fixed => {
                let _ = writeln!(fixed, "    const double x{i} = {};", scalar(op, mechanism));
            }
            Stage::State => {
                let _ = writeln!(of_state, "        {}", vector(i, op, &column, &is_fixed));
            }
        }
    }
    for guard in &program.guards {
        let value = wide(guard.value(), &is_fixed);
        let fails = match guard {
            Guard::Reachable(_) => format!("~({value} >= 0.0)"),
            Guard::Regular(_, size) => {
                let size = wide(*size, &is_fixed);
                format!("~(absolute({value}) > {SINGULAR:e} * {size})")
            }
            Guard::Finite(_) => format!("irregular({value})"),
        };
        let _ = writeln!(of_state, "        bad |= {fails};");
    }
    for (k, output) in program.outputs.iter().take(width).enumerate() {
        let value = wide(*output, &is_fixed);
        let _ = writeln!(
            of_state,
            "        {{ const V y = {value}; bad |= irregular(y); \
             for (int k = 0; k < LANES; k++) out[(at + k) * {width} + {k}] = y[k]; }}"
        );
    }
    // A number that is none is a fault also where the program does not read it.
    let mut unread = String::new();
    for (k, coordinate) in active.iter().enumerate() {
        let atoms = [
            Atom::Coordinate(*coordinate),
            Atom::Rate(*coordinate),
            Atom::Acceleration(*coordinate),
        ];
        for (part, atom) in atoms.into_iter().enumerate() {
            let is_read = |op: &Op| matches!(op, Op::Input(input) if *input == atom);
            if !program.ops.iter().any(is_read) {
                let column = read_column(part, k);
                let _ = writeln!(
                    unread,
                    "        if (arrays[{part}]) bad |= irregular({column});"
                );
            }
        }
    }
    format!(
        "{SUPPORT}
int run(long n, const double *const *arrays, const long *by_state, const long *by_column, const double *base, double *out)
{{
    (void)base;
{fixed}
    W bad = {{0}};
    for (long i = 0; i < n; i += LANES) {{
        /* The last states are computed together with some before them. */
        const long at = i + LANES > n ? n - LANES : i;
{unread}{of_state}    }}
    long long any = 0;
    for (int k = 0; k < LANES; k++)
        any |= bad[k];
    return any != 0;
}}
"
    )
}

/// Eight numbers of a column of an array.
fn read_column(part: usize, k: usize) -> String {
    format!(
        "read_column(arrays[{part}] + at * by_state[{part}] + {k} * by_column[{part}], by_state[{part}])"
    )
}

/// A value as a vector.
fn wide(value: ValueId, is_fixed: &dyn Fn(ValueId) -> bool) -> String {
    let i = value.index();
    if is_fixed(value) {
        format!("all(x{i})")
    } else {
        format!("x{i}")
    }
}

fn number(value: f64) -> String {
    format!("{value:e}")
}

fn binary(op: &Op) -> Option<(usize, char, usize)> {
    Some(match op {
        Op::Add(a, b) => (a.index(), '+', b.index()),
        Op::Sub(a, b) => (a.index(), '-', b.index()),
        Op::Mul(a, b) => (a.index(), '*', b.index()),
        Op::Div(a, b) => (a.index(), '/', b.index()),
        _ => return None,
    })
}

fn function(unary: Unary) -> &'static str {
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
fn scalar(op: &Op, mechanism: &Mechanism) -> String {
    if let Some((a, sign, b)) = binary(op) {
        return format!("x{a} {sign} x{b}");
    }
    match op {
        Op::Number(value) => number(value.to_f64()),
        Op::Input(Atom::Pi) => number(std::f64::consts::PI),
        Op::Input(Atom::Constant(i)) => number(mechanism.constants[*i].value),
        Op::Input(Atom::Parameter(i)) => number(mechanism.parameters[*i].nominal),
        Op::Input(Atom::Base(k)) => format!("base[{k}]"),
        Op::Neg(a) => format!("-x{}", a.index()),
        Op::Sin(a) => format!("sin(x{})", a.index()),
        Op::Cos(a) => format!("cos(x{})", a.index()),
        Op::Atan2(y, x) => format!("atan2(x{}, x{})", y.index(), x.index()),
        Op::Unary(unary, a) => format!("{}(x{})", function(*unary), a.index()),
        other => unreachable!("{other:?} is an operation of a state"),
    }
}

/// The statement of an operation on eight states.
fn vector(
    i: usize,
    op: &Op,
    column: &dyn Fn(usize) -> usize,
    is_fixed: &dyn Fn(ValueId) -> bool,
) -> String {
    if let Some((a, sign, b)) = binary(op) {
        return format!("const V x{i} = x{a} {sign} x{b};");
    }
    let wide = |value: &ValueId| self::wide(*value, is_fixed);
    let input = |part: usize, k: usize| {
        let column = read_column(part, k);
        format!("const V x{i} = {column}; bad |= irregular(x{i});")
    };
    match op {
        Op::Input(Atom::Coordinate(c)) => input(0, column(*c)),
        Op::Input(Atom::Rate(c)) => input(1, column(*c)),
        Op::Input(Atom::Acceleration(c)) => input(2, column(*c)),
        Op::Input(Atom::Load(d)) => input(3, *d),
        Op::Neg(a) => format!("const V x{i} = -x{};", a.index()),
        Op::Sin(a) => format!("const V x{i} = sine({}, &bad);", wide(a)),
        Op::Cos(a) => format!("const V x{i} = cosine({}, &bad);", wide(a)),
        Op::Atan2(y, x) => format!("const V x{i} = angle({}, {});", wide(y), wide(x)),
        Op::Unary(Unary::Abs, a) => format!("const V x{i} = absolute({});", wide(a)),
        Op::Unary(unary, a) => {
            format!("V x{i} = {}; EACH(x{i}, {});", wide(a), function(*unary))
        }
        other => unreachable!("{other:?} is the same for all states"),
    }
}
