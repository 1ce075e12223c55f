"""Inverse dynamics of a chain of bodies by generators of code: CasADi, wrenfold, sympy. Writes one C++ file for each that
can be imported, and prints how many milliseconds of processor time generation took.

    python generated.py <chain> <start of the files' names>

All three unroll the same recursive Newton-Euler algorithm, body by body, with the numbers of the chain in place, and share
common subexpressions as each of them does. Every file defines `void dynamics(const double *x, double *tau)` with
x = q, q', q''. What a chain is says chain.hpp.
"""

import pathlib
import sys
import time


def exact(text):
    """Zeros and ones as whole numbers, so that every generator knows what to leave out."""
    value = float(text)
    return int(value) if value in (-1, 0, 1) else value


def read(path):
    words = iter(pathlib.Path(path).read_text().split())
    take = lambda n: [exact(next(words)) for _ in range(n)]
    count, _ = int(next(words)), next(words)
    gravity, joints = take(3), []
    for _ in range(count):
        parent, slides, axis = (int(next(words)) for _ in range(3))
        rotation, position = take(9), take(3)
        mass, *rest = take(10)
        joints.append((parent, slides, axis, [rotation[3 * i : 3 * i + 3] for i in range(3)], position, mass, rest[:3], rest[3:]))
    return gravity, joints


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(*terms):
    return [sum(t[i] for t in terms[1:]) + terms[0][i] for i in range(3)]


def times(matrix, v):
    return [sum(matrix[i][k] * v[k] for k in range(3)) for i in range(3)]


def turned(matrix, v):
    return [sum(matrix[k][i] * v[k] for k in range(3)) for i in range(3)]


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def about(axis, s, c):
    j, k = (axis + 1) % 3, (axis + 2) % 3
    turn = [[int(i == m) for m in range(3)] for i in range(3)]
    turn[j][j] = turn[k][k] = c
    turn[j][k], turn[k][j] = -1 * s, s
    return turn


def along(axis, x):
    return [x if i == axis else 0 for i in range(3)]


def dynamics(q, qd, qdd, sin, cos, gravity, joints):
    """Luh, Walker, Paul (1980), forces about the joints' origins, parameters of the bodies about the same."""
    base, bodies = ([0, 0, 0], [0, 0, 0], [-1 * g if g else 0 for g in gravity]), []
    for (parent, slides, axis, rotation, offset, mass, moment, inertia), x, xd, xdd in zip(joints, q, qd, qdd):
        w, dw, a = bodies[parent][2] if parent >= 0 else base
        if slides:
            offset = plus(offset, times(rotation, along(axis, x)))
        else:
            rotation = product(rotation, about(axis, sin(x), cos(x)))
        a = turned(rotation, plus(a, cross(dw, offset), cross(w, cross(w, offset))))
        w, dw = turned(rotation, w), turned(rotation, dw)
        if slides:
            a = plus(a, cross(w, along(axis, 2 * xd)), along(axis, xdd))
        else:
            dw = plus(dw, cross(w, along(axis, xd)), along(axis, xdd))
            w = plus(w, along(axis, xd))
        xx, xy, xz, yy, yz, zz = inertia
        tensor = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        force = plus([mass * x for x in a], cross(dw, moment), cross(w, cross(w, moment)))
        couple = plus(times(tensor, dw), cross(w, times(tensor, w)), cross(moment, a))
        bodies.append((rotation, offset, (w, dw, a), force, couple))
    tau = [0] * len(joints)
    loads = [(body[3], body[4]) for body in bodies]
    for i in reversed(range(len(joints))):
        parent, slides, axis = joints[i][:3]
        rotation, offset = bodies[i][:2]
        f, n = loads[i]
        tau[i] = f[axis] if slides else n[axis]
        if parent >= 0:
            f = times(rotation, f)
            loads[parent] = plus(loads[parent][0], f), plus(loads[parent][1], times(rotation, n), cross(offset, f))
    return tau


def split(x, n):
    return x[:n], x[n : 2 * n], x[2 * n :]


def by_casadi(gravity, joints):
    import casadi

    n = len(joints)
    x = casadi.SX.sym("x", 3 * n)
    tau = dynamics(*split([x[i] for i in range(3 * n)], n), casadi.sin, casadi.cos, gravity, joints)
    function = casadi.Function("chain_torques", [x], [casadi.cse(casadi.vertcat(*tau))])
    generator = casadi.CodeGenerator("code", {"with_header": False, "main": False})
    generator.add(function)
    return f'extern "C" {{\n{generator.dump()}\n}}\n' + (
        "void dynamics(const double *x, double *tau) {\n"
        "  const double *in[1] = {x}; double *out[1] = {tau}; chain_torques(in, out, 0, 0, 0);\n}\n"
    )


def by_sympy(gravity, joints):
    import sympy

    n = len(joints)
    x = sympy.symbols(f"x:{3 * n}")
    tau = dynamics(*split(x, n), sympy.sin, sympy.cos, gravity, joints)
    shared, results = sympy.cse(tau)
    code = lambda e: sympy.ccode(e)
    lines = [f"  const double x{i} = in[{i}];" for i in range(3 * n)]
    names = {name: sympy.Symbol(f"t{k}") for k, (name, _) in enumerate(shared)}
    lines += [f"  const double {names[name]} = {code(e.xreplace(names))};" for name, e in shared]
    lines += [f"  tau[{i}] = {code(sympy.sympify(e).xreplace(names))};" for i, e in enumerate(results)]
    return "#include <cmath>\nusing namespace std;\nvoid dynamics(const double *in, double *tau) {\n" + "\n".join(lines) + "\n}\n"


def by_wrenfold(gravity, joints):
    from wrenfold import code_generation, sym, type_annotations

    n = len(joints)

    def chain(x):
        tau = dynamics(*split(x, n), sym.sin, sym.cos, gravity, joints)
        return [code_generation.OutputArg(expression=t, name=f"tau{i}") for i, t in enumerate(tau)]

    arguments = ", ".join(f"x{i}: Float" for i in range(3 * n))
    names = ", ".join(f"x{i}" for i in range(3 * n))
    scope = {"chain": chain, "Float": type_annotations.FloatScalar}
    exec(f"def torques({arguments}): return chain([{names}])", scope)
    code = code_generation.generate_function(scope["torques"], code_generation.CppGenerator())
    return (
        "#include <cmath>\n#include <cstdint>\n" + code + "\nvoid dynamics(const double *x, double *tau) {\n  torques<double>("
        + ", ".join(f"x[{i}]" for i in range(3 * n)) + ", " + ", ".join(f"tau[{i}]" for i in range(n)) + ");\n}\n"
    )


def main():
    gravity, joints = read(sys.argv[1])
    for name, generate, module in [("CasADi", by_casadi, "casadi"), ("wrenfold", by_wrenfold, "wrenfold"), ("sympy", by_sympy, "sympy")]:
        try:
            __import__(module)
        except ImportError:
            continue
        start = time.process_time()
        code = generate(gravity, joints)
        took = time.process_time() - start
        pathlib.Path(f"{sys.argv[2]}{name}.cpp").write_text(code)
        print(f"{name}\t{1e3 * took:.1f}")


if __name__ == "__main__":
    main()
