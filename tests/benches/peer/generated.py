"""Inverse dynamics of the Panda by generators of code: CasADi, wrenfold, sympy. Writes one C++ file for each that can be
imported, and prints what generation took.

    python generated.py <folder of reference tables> <folder for the code>

All three unroll the same recursive Newton-Euler algorithm, link by link, with the numbers of the arm and of the reference
table's bodies in place, and share common subexpressions as each of them does. Every file defines
`void dynamics(const double *x, double *tau)` with x = q, q', q''.
"""

import csv
import math
import pathlib
import sys
import time

# a, alpha / (pi/2), d by modified Denavit-Hartenberg, as in model-spec/models/panda.toml.
DH = [(0, 0, 0.333), (0, -1, 0), (0, 1, 0.316), (0.0825, 1, 0), (-0.0825, -1, 0.384), (0, 1, 0), (0.088, 1, 0)]
ENTRIES = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"]
SIN, COS = {0: 0, 1: 1, -1: -1}, {0: 1, 1: 0, -1: 0}


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(*terms):
    return [sum(t[i] for t in terms[1:]) + terms[0][i] for i in range(3)]


def times(matrix, v):
    return [sum(matrix[i][k] * v[k] for k in range(3)) for i in range(3)]


def turned(matrix, v):
    return [sum(matrix[k][i] * v[k] for k in range(3)) for i in range(3)]


def dynamics(q, qd, qdd, sin, cos, bodies):
    """Luh, Walker, Paul (1980), forces about the frames' origins, links' parameters about their frames."""
    w, dw, a = [0, 0, 0], [0, 0, 0], [0, 0, 9.81]
    links = []
    for (length, quarter, d), x, xd, xdd, p in zip(DH, q, qd, qdd, bodies):
        s, c, sa, ca = sin(x), cos(x), SIN[quarter], COS[quarter]
        zero = 0
        rotation = [
            [c, -1 * s, zero],
            [s * ca if ca else zero, c * ca if ca else zero, -sa if sa else zero],
            [s * sa if sa else zero, c * sa if sa else zero, ca if ca else zero],
        ]
        offset = [length, -sa * d, ca * d]
        a = turned(rotation, plus(a, cross(dw, offset), cross(w, cross(w, offset))))
        turn = turned(rotation, w)
        dw = plus(turned(rotation, dw), cross(turn, [0, 0, xd]), [0, 0, xdd])
        w = plus(turn, [0, 0, xd])
        inertia = [[p["XX"], p["XY"], p["XZ"]], [p["XY"], p["YY"], p["YZ"]], [p["XZ"], p["YZ"], p["ZZ"]]]
        moment = [p["MX"], p["MY"], p["MZ"]]
        force = plus([p["M"] * x for x in a], cross(dw, moment), cross(w, cross(w, moment)))
        couple = plus(times(inertia, dw), cross(w, times(inertia, w)), cross(moment, a))
        links.append((rotation, offset, force, couple))
    tau, f, n = [], [0, 0, 0], [0, 0, 0]
    for rotation, offset, force, couple in reversed(links):
        f, n = plus(force, f), plus(couple, n)
        tau.append(n[2])
        f = times(rotation, f)
        n = plus(times(rotation, n), cross(offset, f))
    return tau[::-1]


def by_casadi(bodies):
    import casadi

    x = casadi.SX.sym("x", 21)
    parts = [x[i] for i in range(21)]
    tau = casadi.vertcat(*dynamics(parts[:7], parts[7:14], parts[14:], casadi.sin, casadi.cos, bodies))
    function = casadi.Function("panda", [x], [casadi.cse(tau)])
    name = "casadi_code.c"
    function.generate(name, {"with_header": False, "main": False})
    code = pathlib.Path(name).read_text()
    pathlib.Path(name).unlink()
    return f'extern "C" {{\n{code}\n}}\n' + (
        "void dynamics(const double *x, double *tau) {\n"
        "  const double *in[1] = {x}; double *out[1] = {tau}; panda(in, out, 0, 0, 0);\n}\n"
    )


def by_sympy(bodies):
    import sympy

    x = sympy.symbols("x:21")
    tau = dynamics(x[:7], x[7:14], x[14:], sympy.sin, sympy.cos, bodies)
    shared, results = sympy.cse(tau)
    code = lambda e: sympy.ccode(e)
    lines = [f"  const double x{i} = in[{i}];" for i in range(21)]
    names = {name: sympy.Symbol(f"t{k}") for k, (name, _) in enumerate(shared)}
    lines += [f"  const double {names[name]} = {code(e.xreplace(names))};" for name, e in shared]
    lines += [f"  tau[{i}] = {code(e.xreplace(names))};" for i, e in enumerate(results)]
    return "#include <cmath>\nusing namespace std;\nvoid dynamics(const double *in, double *tau) {\n" + "\n".join(lines) + "\n}\n"


def by_wrenfold(bodies):
    from wrenfold import code_generation, sym, type_annotations

    def panda(x):
        tau = dynamics(x[:7], x[7:14], x[14:], sym.sin, sym.cos, bodies)
        return [code_generation.OutputArg(expression=t, name=f"tau{i}") for i, t in enumerate(tau)]

    arguments = ", ".join(f"x{i}: Float" for i in range(21))
    names = ", ".join(f"x{i}" for i in range(21))
    scope = {"panda": panda, "Float": type_annotations.FloatScalar}
    exec(f"def arm({arguments}): return panda([{names}])", scope)
    code = code_generation.generate_function(scope["arm"], code_generation.CppGenerator())
    return (
        "#include <cmath>\n#include <cstdint>\n" + code + "\nvoid dynamics(const double *x, double *tau) {\n  arm<double>("
        + ", ".join(f"x[{i}]" for i in range(21)) + ", " + ", ".join(f"tau[{i}]" for i in range(7)) + ");\n}\n"
    )


def main():
    tables, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    with open(tables / "pinocchio-panda-parameters.csv") as file:
        values = next(csv.DictReader(file))
    bodies = [{e: float(values[f"{e}{k}"]) for e in ENTRIES} for k in range(1, 8)]
    for name, generate in [("casadi", by_casadi), ("wrenfold", by_wrenfold), ("sympy", by_sympy)]:
        start = time.perf_counter()
        try:
            code = generate(bodies)
        except ImportError:
            continue
        (out / f"{name}.cpp").write_text(code)
        print(f"{name}\t{1e3 * (time.perf_counter() - start):.0f}")


if __name__ == "__main__":
    main()
