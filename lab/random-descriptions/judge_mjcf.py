"""Compares imported MJCF descriptions with MuJoCo: forces at random states, closures, and limits.

usage: judge_mjcf.py MODELMILL [--seeds N] [--feature NAME] [--keep FOLDER]

The exit status is 1 if a verdict is SILENT.
Verdicts: right; named (a remark names what the import omits); refused; SILENT (forces, closure or limits differ without a remark).
"""

import argparse
import collections
import math
import os
import random
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np

import mjcf_grammar
from imported import EmittedModel, import_description

WORST = 1e-8


class JointMap:
    """Positions, rates and accelerations of MuJoCo's joints from those of the model's coordinates."""

    def __init__(self, model, mj, said):
        self.model, self.mj = model, mj
        frames = [f["joint"] for f in model.model["frame"] if "joint" in f]
        self.fixed = {}
        moving = []
        for j in range(mj.njnt):
            name = mj.joint(j).name
            words = [line for line in said.splitlines() if name and f"`{name}` is fixed at" in line]
            if words:
                self.fixed[j] = float(words[0].split("is fixed at")[1].split()[0].rstrip(".;"))
            else:
                moving.append(j)
        if len(moving) != len(frames):
            raise ValueError(f"{len(moving)} joints move in MuJoCo, {len(frames)} in the model")
        self.pairs = list(zip(moving, frames))

    def motion(self, q, qd, qdd):
        """qpos, qvel and qacc."""
        levels = self.model.coordinate_motion(q, qd, qdd)
        mj = self.mj
        qpos, qvel, qacc = mj.qpos0.copy(), np.zeros(mj.nv), np.zeros(mj.nv)
        for j, value in self.fixed.items():
            qpos[mj.jnt_qposadr[j]] = value
        for j, frame in self.pairs:
            a, d = mj.jnt_qposadr[j], mj.jnt_dofadr[j]
            text = frame.get("revolute", frame.get("prismatic"))
            if text is not None:
                zero = {name: 0.0 for name in levels[0]}
                constant = self.model.evaluate(text, zero)
                qpos[a] = self.model.evaluate(text, levels[0]) + mj.qpos0[a]
                qvel[d] = self.model.evaluate(text, levels[1]) - constant
                qacc[d] = self.model.evaluate(text, levels[2]) - constant
            elif "spherical" in frame:
                quat = np.array([1.0, 0, 0, 0])
                w, alpha = np.zeros(3), np.zeros(3)
                for name, letter in zip(frame["spherical"], frame["axes"]):
                    axis = np.eye(3)["xyz".index(letter)]
                    turn = np.r_[math.cos(levels[0][name] / 2), math.sin(levels[0][name] / 2) * axis]
                    r = np.zeros(9); mujoco.mju_quat2Mat(r, turn); r = r.reshape(3, 3)
                    w = r.T @ w
                    alpha = r.T @ alpha + np.cross(w, axis * levels[1][name]) + axis * levels[2][name]
                    w = w + axis * levels[1][name]
                    product = np.zeros(4); mujoco.mju_mulQuat(product, quat, turn); quat = product
                qpos[a : a + 4], qvel[d : d + 3], qacc[d : d + 3] = quat, w, alpha
            else:
                names = frame["free"]
                qpos[a : a + 7] = [levels[0][n] for n in names]
                for k, n in enumerate(names[:3] + names[4:]):
                    qvel[d + k], qacc[d + k] = levels[1][n], levels[2][n]
        return qpos, qvel, qacc


def joint_forces(mj, data):
    """Generalized forces of a motion without constraints, with Coulomb friction."""
    flags = mj.opt.disableflags
    mj.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    mujoco.mj_inverse(mj, data)
    mj.opt.disableflags = flags
    force = data.qfrc_inverse.copy()
    force += mj.dof_frictionloss * np.sign(data.qvel)
    if mj.ntendon:
        jacobian = np.zeros((mj.ntendon, mj.nv))
        # By finite differences: the sparse form differs between versions.
        own = mujoco.MjData(mj)
        own.qpos[:] = data.qpos
        for d in range(mj.nv):
            ends = []
            for step in (1e-6, -1e-6):
                dq = np.zeros(mj.nv); dq[d] = step
                own.qpos[:] = data.qpos; mujoco.mj_integratePos(mj, own.qpos, dq, 1.0)
                mujoco.mj_kinematics(mj, own); mujoco.mj_comPos(mj, own); mujoco.mj_tendon(mj, own)
                ends.append(own.ten_length.copy())
            jacobian[:, d] = (ends[0] - ends[1]) / 2e-6
        force += jacobian.T @ (mj.tendon_frictionloss * np.sign(jacobian @ data.qvel))
    return force


def closure_error(mj, qpos):
    """Largest violation of the equalities that are active, and the degrees of freedom that they leave."""
    data = mujoco.MjData(mj)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(mj, data)
    rows = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    violation = float(np.abs(data.efc_pos[: data.nefc][rows]).max(initial=0.0))
    jacobian = np.zeros((data.nefc, mj.nv))
    for row in range(data.nefc):
        if mujoco.mj_isSparse(mj):
            start, n = data.efc_J_rowadr[row], data.efc_J_rownnz[row]
            jacobian[row, data.efc_J_colind[start : start + n]] = data.efc_J[start : start + n]
        else:
            jacobian[row] = data.efc_J.reshape(-1, mj.nv)[row]
    rank = np.linalg.matrix_rank(jacobian[rows], tol=1e-8) if rows.any() else 0
    return violation, mj.nv - rank


def limit_faults(mj, model, joints):
    """Limits of MuJoCo that the model does not have."""
    limits = model.model.get("limits", {})
    out = []
    text_of = {}
    for j, frame in joints.pairs:
        text_of[j] = frame.get("revolute", frame.get("prismatic"))
    for j in range(mj.njnt):
        name = mj.joint(j).name
        if mj.jnt_limited[j] and j in text_of:
            used = [c for c in limits.get("coordinates", {}) if text_of[j] and c in text_of[j]]
            if not any("position" in limits["coordinates"][c] for c in used):
                out.append(f"range of {name}")
            elif text_of[j] in used and not np.allclose(limits["coordinates"][text_of[j]]["position"], mj.jnt_range[j], atol=1e-9):
                out.append(f"range of {name} differs")
        if not mj.jnt_limited[j] and text_of.get(j) in limits.get("coordinates", {}) and "position" in limits["coordinates"][text_of[j]]:
            out.append(f"range of {name} without a limit")
    for t in range(mj.ntendon):
        if mj.tendon_limited[t]:
            out.append(f"range of the tendon {mj.tendon(t).name}")
    return out + force_limit_faults(mj, model, text_of)


def clamped(first, then):
    """The limits of a force that is clamped to one range and then to another; none means no limits."""
    if first is None or then is None:
        return then if first is None else first
    return [min(max(end, then[0]), then[1]) for end in first]


def actuator_limits(mj, a):
    """The force limits of an actuator before its gear; none if it has no limits."""
    force = mj.actuator_forcerange[a].tolist() if mj.actuator_forcelimited[a] else None
    # The force is a multiple of the control, which filters keep within its range.
    known = [int(one) for one in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)]
    is_multiple = (mj.actuator_gaintype[a] == mujoco.mjtGain.mjGAIN_FIXED and mj.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_NONE
                   and mj.actuator_dyntype[a] in known)
    control = scaled(mj.actuator_ctrlrange[a].tolist(), mj.actuator_gainprm[a, 0])
    return clamped(control, force) if is_multiple and mj.actuator_ctrllimited[a] else force


def scaled(limits, gear):
    return None if limits is None else sorted(float(gear * end) for end in limits)


def force_limit_faults(mj, model, text_of):
    """Force limits of MuJoCo that the drives of the model do not have, and the reverse."""
    found = {name: entry.get("force") for name, entry in model.model.get("limits", {}).get("drives", {}).items()}
    drives = model.model.get("drive", [])
    at_coordinate = {drive["joint"]: drive["name"] for drive in drives if "joint" in drive}
    lines = {drive["name"] for drive in drives if "linear" in drive}
    kind = {name: [a for a in range(len(mj.actuator_trntype)) if mj.actuator_trntype[a] == value] for name, value in (
        ("joint", mujoco.mjtTrn.mjTRN_JOINT), ("tendon", mujoco.mjtTrn.mjTRN_TENDON))}
    out = []

    def compare_one(what, drive, expected):
        given = found.get(drive)
        if (given is None) != (expected is None) or given is not None and not np.allclose(given, expected, atol=1e-9):
            out.append(f"force of {what}: {given}, not {expected}")

    for j, text in text_of.items():
        own = mj.jnt_actfrcrange[j].tolist() if mj.jnt_actfrclimited[j] else None
        ranges = [scaled(actuator_limits(mj, a), mj.actuator_gear[a, 0]) for a in kind["joint"] if mj.actuator_trnid[a, 0] == j]
        # The limits of several actuators add up, if all have limits.
        total = np.sum(ranges, axis=0).tolist() if ranges and None not in ranges else None
        expected = clamped(total, own)
        name = mj.joint(j).name
        if text in at_coordinate:
            compare_one(name, at_coordinate[text], expected)
        elif expected is not None and (ranges or mj.nu == 0):
            out.append(f"force of {name}, which has no drive: {expected}")
    for t in range(mj.ntendon):
        own = mj.tendon_actfrcrange[t].tolist() if mj.tendon_actfrclimited[t] else None
        acting = [a for a in kind["tendon"] if mj.actuator_trnid[a, 0] == t]
        drive = next((mj.actuator(a).name for a in acting if mj.actuator(a).name in lines), None)
        if drive is not None and len(acting) == 1:
            # The limit of a tendon is that of the force before the gear.
            compare_one(drive, drive, scaled(clamped(actuator_limits(mj, acting[0]), own), mj.actuator_gear[acting[0], 0]))
        elif own is not None or any(actuator_limits(mj, a) is not None for a in acting):
            out.append(f"force of the tendon {mj.tendon(t).name}")
    return out


def compare(program, path, text):
    """The verdict on one description: what differs, and what was said."""
    path.write_text(text)
    mj = mujoco.MjModel.from_xml_string(text)
    out, said = import_description(program, path)
    if out is None:
        return "refused", said.strip(), said
    try:
        model = EmittedModel(program, out)
    except ValueError as fault:
        return "refused", f"the import has no model: {fault}", said
    joints = JointMap(model, mj, said)
    rng = np.random.default_rng(1)
    worst, closure = 0.0, 0.0
    n = len(model.coordinates)
    is_free = np.array([any(c in f.get("free", []) for _, f in joints.pairs) for c in model.coordinates])
    real = [c for c in model.coordinates if not any(c == f["free"][3] for _, f in joints.pairs if "free" in f)]
    done = 0
    for _ in range(20):
        q = model.nominal() + rng.uniform(-0.3, 0.3, n)
        for _, f in joints.pairs:
            if "free" in f:
                at = [model.coordinates.index(c) for c in f["free"][3:]]
                q[at] /= np.linalg.norm(q[at])
        qd, qdd = rng.uniform(-1, 1, n), rng.uniform(-1, 1, n)
        try:
            qpos, qvel, qacc = joints.motion(q, qd, qdd)
            forces = model.forces(q, qd, qdd)
        except ArithmeticError:
            continue
        data = mujoco.MjData(mj)
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, qvel, qacc
        expected = joint_forces(mj, data)
        # Columns: rates of MuJoCo's joints for one unit of each rate.
        columns = []
        for c in real:
            unit = np.array([float(c == other) for other in model.coordinates])
            columns.append(joints.motion(q, unit, 0 * unit)[1])
        expected = np.array(columns) @ expected
        if is_free.any():
            rows = np.zeros((len(model.drives), len(real)))
            for k, drive in enumerate(model.drives):
                rows[k, real.index(drive.removeprefix("on_").removesuffix("_drive"))] = 1.0
        else:
            rows = model.drive_motion(q, qd, qdd)[2]
        driven = np.abs(rows).max(axis=0) > 1e-12
        got = rows.T @ forces
        scale = max(1.0, np.abs(expected).max())
        worst = max(worst, np.abs((got - expected)[driven]).max(initial=0.0) / scale)
        violation, freedoms = closure_error(mj, qpos)
        closure = max(closure, violation)
        done += 1
        if done == 4:
            break
    faults = []
    if done == 0:
        faults.append("no state could be evaluated")
    if worst > WORST:
        faults.append(f"forces differ by {worst:.2g}")
    if done and freedoms != len(real):
        faults.append(f"{freedoms} degrees of freedom, {len(real)} in the model")
    if closure > 1e-7:
        faults.append(f"an equality is open by {closure:.2g}")
    faults += limit_faults(mj, model, joints)
    return ("right" if not faults else "differs"), "; ".join(faults), said


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--feature")
    parser.add_argument("--keep")
    chosen = parser.parse_args()
    folder = Path(chosen.keep or tempfile.mkdtemp())
    folder.mkdir(exist_ok=True, parents=True)
    count = collections.Counter()
    for name in mjcf_grammar.FEATURES:
        if chosen.feature and chosen.feature != name:
            continue
        for seed in range(chosen.first, chosen.first + chosen.seeds):
            text, words = mjcf_grammar.describe(seed, name)
            try:
                verdict, why, said = compare(chosen.program, folder / f"{name}-{seed}.xml", text)
            except mujoco.FatalError as fault:
                verdict, why, said = "not MJCF", str(fault).splitlines()[0], ""
            except ValueError as fault:
                verdict, why, said = ("not MJCF" if "XML" in str(fault) or "Error" in str(fault) else "differs"), str(fault), ""
            said = "\n".join(line for line in said.splitlines() if line.startswith("warning:") and "no actuators" not in line)
            if verdict == "differs":
                verdict = "named" if any(word in said for word in words) else "SILENT"
            count[verdict] += 1
            if verdict != "right" or chosen.feature:
                print(f"{verdict:9} {name}-{seed}: {why}", flush=True)
                if chosen.feature or verdict in ("named", "SILENT"):
                    print("          " + said.replace("\n", "\n          "), flush=True)
    print(dict(count))
    sys.exit(1 if count["SILENT"] else 0)


if __name__ == "__main__":
    main()
