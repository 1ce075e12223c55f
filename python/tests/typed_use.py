"""How the package is used, for a type checker; nothing of it is run."""

from __future__ import annotations

import numpy as np

import modelmill


def use() -> float:
    m = modelmill.load("arm.toml", name="arm", at_values=True)
    names: list[str] = m.p_min.names
    first: modelmill.BaseParameter = m.p_min[0]
    q = np.zeros((10, m.dof), dtype=np.float32)
    forces = m.inverse_dynamics(q, q, q, parameters={names[0]: 1.0})
    mass = m.mass_matrix([0.0] * m.dof)
    run = m.recording({"t": np.arange(3.0), "q1": [1, 2, 3]}, columns={"q2": "angle [deg]"}, cutoff_hz=20)
    fit = m.identify([run, "other.csv"], check=("a.csv", "b.csv"), robust=1.345, between=(0.0, 3.0))
    values: list[float] = [one.value for one in fit.parameters]
    diagnosis = m.diagnose(run, held=True, progress=lambda what, done, total: print(what))
    better = diagnosis.model or m.with_effect("coulomb_friction", at="motor", Fc=2.0)
    better = better.with_effect("viscous_friction", at_each="drives", without=(), Fv=1.0)
    measured = run.forces
    residual = 0.0 if measured is None else float((measured - run.calculated(fit)).max())
    m.plot(run, parameters=fit, drives=["motor"]).savefig("forces.png")
    better.report(run).save("page.html")
    motion = better.excite(limits={"q1": (-1, 1), "q1_d": 2.0})
    changed = m.runs(["a.csv", "b.csv"], per_run=["friction"])
    adopted = m.adopt(fit)
    masses: list[dict[str, dict[str, object]]] = m.interpret(fit, ["m1"]).solutions
    cost = m.diff(adopted, {"t": [0.0, 1.0], "q1": [0.0, 1.0]}, cutoff_hz=20).along
    description: str = m.export("mjcf", parameters=fit)
    made = modelmill.simulate("rig.toml", motion, seed=1)
    reduced: modelmill.Model = modelmill.reduce("rig.toml", "plan.toml").model
    reduced.compare(made.columns)
    print(masses, cost, description)
    nrms = m.compare(run, parameters=fit).nrms or 0.0
    return residual + float(forces.sum() + mass.sum() + motion.q.max() + len(changed.changes) + len(values) + (first.value or 0.0)) + nrms
