"""Compares imported URDF and SDF descriptions with Drake: forces at random states, closures, and limits.

usage: judge_tree.py MODELMILL {urdf,sdf} [--seeds N] [--feature NAME] [--keep FOLDER]

The exit status is 1 if a verdict is SILENT.
Verdicts: right; named (a remark names what the import omits); refused; SILENT (forces, closure or limits differ without a remark).
"""

import argparse
import collections
import logging
import sys
import tempfile
from pathlib import Path

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces, RotationalInertia  # noqa: F401
from scipy.spatial.transform import Rotation

import tree_grammar
from imported import EmittedModel, import_description

logging.getLogger("drake").setLevel(logging.ERROR)
WORST = 1e-8


def drake_plant(kind, text, is_floating):
    """The plant of a description; the root of a URDF is welded to the world."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, kind)
    if kind == "urdf" and not is_floating:
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant


class Joints:
    """Positions, rates and accelerations of Drake's joints from the coordinates of the model."""

    def __init__(self, model, plant, description, said):
        self.model, self.plant, self.description = model, plant, description
        self.lines = said.splitlines()
        self.frames = {f["name"]: f.get("joint", {}) for f in model.model["frame"]}

    def value(self, name, levels):
        """Position, rate and acceleration of a joint by its name."""
        known = name.replace(" ", "_").replace("-", "_")
        for candidate in (name, known, f"{known}_2"):
            if candidate in levels[0]:
                return np.array([level[candidate] for level in levels])
        if name in self.description.mimics:
            leader, ratio, offset = self.description.mimics[name]
            if leader is None:
                return np.array([offset, 0.0, 0.0])
            return ratio * self.value(leader, levels) + np.array([offset, 0.0, 0.0])
        fixed = [line for line in self.lines if f"`{name}` is fixed at" in line]
        if fixed:
            return np.array([float(fixed[0].split("is fixed at")[1].split()[0].rstrip(".;")), 0.0, 0.0])
        raise ValueError(f"the joint `{name}` is lost")

    def motion(self, q, qd, qdd):
        levels = self.model.coordinate_motion(q, qd, qdd)
        plant = self.plant
        position, rate, acceleration = (np.zeros(plant.num_positions()), np.zeros(plant.num_velocities()), np.zeros(plant.num_velocities()))
        for index in plant.GetJointIndices():
            joint = plant.get_joint(index)
            a, d, n = joint.position_start(), joint.velocity_start(), joint.num_velocities()
            kind = joint.type_name()
            if n == 0:
                continue
            if kind in ("revolute", "prismatic", "screw"):
                values = self.value(joint.name(), levels)
                position[a], rate[d], acceleration[d] = values
            elif kind == "universal":
                names = (joint.name(), f"{joint.name()}_2")
                if names[1] not in levels[0]:
                    names = tuple(f"{joint.name()}_{letter}" for letter in "XY")
                for k, name in enumerate(names):
                    position[a + k], rate[d + k], acceleration[d + k] = self.value(name, levels)
            elif kind == "ball_rpy":
                names = next(f for f in self.frames.values() if "spherical" in f)
                turn, w, alpha = Rotation.identity(), np.zeros(3), np.zeros(3)
                for name, letter in zip(names["spherical"], names["axes"]):
                    axis = turn.apply(np.eye(3)["xyz".index(letter)])
                    # In the axes of the parent.
                    alpha = alpha + np.cross(w, axis) * levels[1][name] + axis * levels[2][name]
                    w = w + axis * levels[1][name]
                    turn = turn * Rotation.from_rotvec(levels[0][name] * np.eye(3)["xyz".index(letter)])
                # The model has the axes of the link, Drake those of the joint.
                own = joint.frame_on_child().GetFixedPoseInBodyFrame().rotation().matrix()
                turn = Rotation.from_matrix(own.T @ turn.as_matrix() @ own)
                position[a : a + 3], rate[d : d + 3], acceleration[d : d + 3] = turn.as_euler("xyz"), own.T @ w, own.T @ alpha
            elif kind in ("quaternion_floating",):
                names = next(f for f in self.frames.values() if "free" in f)["free"]
                values = [[level.get(n, 0.0) for n in names] for level in levels]
                turn = Rotation.from_quat([*values[0][4:], values[0][3]])
                position[a : a + 4], position[a + 4 : a + 7] = values[0][3:], values[0][:3]
                # The model has body axes, Drake those of the world.
                rate[d : d + 3], rate[d + 3 : d + 6] = turn.apply(values[1][4:]), values[1][:3]
                acceleration[d : d + 3], acceleration[d + 3 : d + 6] = turn.apply(values[2][4:]), values[2][:3]
            else:
                raise ValueError(f"joint type {kind} of the judge")
        return position, rate, acceleration


def joint_forces(plant, description, position, rate, acceleration, gravity):
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, position)
    plant.SetVelocities(context, rate)
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    total = plant.CalcInverseDynamics(context, acceleration, forces)
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.name() in description.friction:
            d = joint.velocity_start()
            total[d] += description.friction[joint.name()] * np.sign(rate[d])
    return total, context


def limit_faults(description, model):
    """Limits that the model does not have."""
    limits = model.model.get("limits", {})
    out = []
    for name, wanted in description.limits.items():
        found = dict(limits.get("coordinates", {}).get(name, {}))
        found |= limits.get("drives", {}).get(f"{name}_drive", {})
        for key, value in wanted.items():
            given = found.get(key)
            if given is None or None in np.atleast_1d(value) or not np.allclose(given, value):
                out.append(f"{key} of {name}: {given}, not {value}")
    return out


def compare(program, kind, path, description):
    """The verdict on one description: what differs, and what was said."""
    path.write_text(description.text)
    options = []
    if description.closures_file:
        path.with_suffix(".yaml").write_text(description.closures_file)
        options = ["--closures", path.with_suffix(".yaml")]
    out, said = import_description(program, path, options)
    if out is None:
        return "refused", said.strip(), said
    try:
        plant = drake_plant(kind, description.judged or description.text, False)
    except RuntimeError as fault:
        return "unjudged", str(fault)[:200], said
    try:
        model = EmittedModel(program, out)
    except ValueError as fault:
        return "refused", f"the import has no model: {fault}", said
    joints = Joints(model, plant, description, said)
    rng = np.random.default_rng(1)
    worst = closure = 0.0
    n = len(model.coordinates)
    free = [f["free"] for f in joints.frames.values() if "free" in f]
    real = [c for c in model.coordinates if not any(c == names[3] for names in free)]
    gravity = model.model["gravity"]
    plant.mutable_gravity_field().set_gravity_vector(
        np.array([model.evaluate(str(g).replace('"', ""), {}) for g in gravity]))
    done, stated = 0, set()
    for _ in range(20):
        q = model.nominal() + rng.uniform(-0.3, 0.3, n)
        for names in free:
            at = [model.coordinates.index(c) for c in names[3:]]
            q[at] /= np.linalg.norm(q[at])
        qd, qdd = rng.uniform(-1, 1, n), rng.uniform(-1, 1, n)
        try:
            motion = joints.motion(q, qd, qdd)
            forces = model.forces(q, qd, qdd)
        except ArithmeticError as fault:
            stated.add(str(fault))
            continue
        expected, context = joint_forces(plant, description, *motion, gravity)
        columns = []
        for c in real:
            unit = np.array([float(c == other) for other in model.coordinates])
            columns.append(joints.motion(q, unit, 0 * unit)[1])
        expected = np.array(columns) @ expected
        if free:
            rows = np.zeros((len(model.drives), len(real)))
            for k, drive in enumerate(model.drives):
                rows[k, real.index(drive.removeprefix("on_").removesuffix("_drive"))] = 1.0
        else:
            rows = model.drive_motion(q, qd, qdd)[2]
        driven = np.abs(rows).max(axis=0) > 1e-12
        worst = max(worst, np.abs((rows.T @ forces - expected)[driven]).max(initial=0.0) / max(1.0, np.abs(expected).max()))
        for (one, p), (other, r) in description.closures:
            points = [plant.GetBodyByName(name).EvalPoseInWorld(context).multiply(np.array(at)) for name, at in ((one, p), (other, r)) if at is not None]
            if len(points) == 2:
                closure = max(closure, np.abs(points[0] - points[1]).max())
        done += 1
        if done == 4:
            break
    faults = []
    if done == 0:
        faults.append(f"no state could be evaluated: {stated}")
    freedoms = plant.num_velocities() - description.removed - len(description.mimics)
    if freedoms != len(real):
        faults.append(f"{freedoms} degrees of freedom, {len(real)} in the model")
    if worst > WORST:
        faults.append(f"forces differ by {worst:.2g}")
    if closure > 1e-7:
        faults.append(f"a closure is open by {closure:.2g}")
    faults += limit_faults(description, model)
    return ("right" if not faults else "differs"), "; ".join(faults), said


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("kind", choices=["urdf", "sdf"])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--feature")
    parser.add_argument("--keep")
    chosen = parser.parse_args()
    folder = Path(chosen.keep or tempfile.mkdtemp())
    folder.mkdir(exist_ok=True, parents=True)
    count = collections.Counter()
    for name in tree_grammar.FEATURES[chosen.kind]:
        if chosen.feature and chosen.feature != name:
            continue
        for seed in range(chosen.first, chosen.first + chosen.seeds):
            description = tree_grammar.describe(chosen.kind, name, seed)
            try:
                verdict, why, said = compare(chosen.program, chosen.kind, folder / f"{name}-{seed}.{chosen.kind}", description)
            except ValueError as fault:
                verdict, why, said = "differs", str(fault), ""
            said = "\n".join(line for line in said.splitlines() if line.startswith("warning:"))
            if verdict == "differs":
                verdict = "named" if any(word in said for word in description.words) else "SILENT"
            count[verdict] += 1
            if verdict != "right" or chosen.feature:
                print(f"{verdict:9} {name}-{seed}: {why}", flush=True)
                if chosen.feature or verdict in ("named", "SILENT", "unjudged"):
                    print("          " + said.replace("\n", "\n          "), flush=True)
    print(dict(count))
    sys.exit(1 if count["SILENT"] else 0)


if __name__ == "__main__":
    main()
