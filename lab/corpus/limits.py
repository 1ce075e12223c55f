"""Limits of the description that the model does not have."""

import re
from types import SimpleNamespace

import numpy as np

# Words of a fault with its names, and words of a remark that names the same.
NAMED_TOGETHER = (
    ("range of the tendon", "the range of this tendon is left out"),
    ("force of the tendon", "the force limit of this tendon is left out"),
    ("force of the tendon", "force limits of an actuator on a fixed tendon"),
    ("force of the tendon", "acts on a tendon that is not a straight line"),
    ("range of the ball joint", "the range of a ball joint is left out"),
    ("range of the ball joint", "and limits of the ball joint"),
)


def dependence(model, text):
    """The coordinates in an expression that is linear: slopes by name, and the constant. Followers are those of their leader."""
    for name, followed in model.followers().items():
        text = re.sub(rf"\b{name}\b", f"({followed})", text)
    names = [*model.coordinates, *model.passive]
    zero = {name: 0.0 for name in names}
    constant = model.evaluate(text, zero)
    slopes = {name: model.evaluate(text, zero | {name: 1.0}) - constant for name in names if re.search(rf"\b{name}\b", text)}
    return {name: slope for name, slope in slopes.items() if slope}, constant


def expected_ranges(model, joints):
    """The range of each coordinate that those of the joints leave: joints are triples of frame, range and value at zero."""
    out = {}
    for frame, span, shift in joints:
        slopes, constant = dependence(model, frame.get("revolute", frame.get("prismatic")))
        if len(slopes) == 1:
            [(name, slope)] = slopes.items()
            ends = sorted((end - constant - shift) / slope for end in span)
            old = out.get(name, [-np.inf, np.inf])
            out[name] = [max(old[0], ends[0]), min(old[1], ends[1])]
    return out


def range_faults(model, joints):
    """Coordinates whose range differs from that of the joints; a range without an inside counts as none."""
    stated = model.model.get("limits", {}).get("coordinates", {})
    given = {name: entry["position"] for name, entry in stated.items() if "position" in entry}
    wanted = {name: span for name, span in expected_ranges(model, joints).items() if span[0] < span[1]}
    out = []
    for name in sorted(given.keys() | wanted.keys()):
        have, want = given.get(name), wanted.get(name)
        if have is None or want is None or not np.allclose(have, want, rtol=1e-9, atol=1e-9):
            out.append(f"range of `{name}`: {have}, not {want}")
    return out


def mujoco_faults(judge, mj, model, pairs):
    """Ranges of joints and tendons of MuJoCo, and limits of forces."""
    moving = [(j, frame) for j, frame in pairs if "revolute" in frame or "prismatic" in frame]
    joints = [(frame, mj.jnt_range[j], mj.qpos0[mj.jnt_qposadr[j]]) for j, frame in moving if mj.jnt_limited[j]]
    out = range_faults(model, joints)
    out += [f"range of the ball joint `{mj.joint(j).name}`" for j, frame in pairs if "spherical" in frame and mj.jnt_limited[j]]
    out += [f"range of the tendon `{mj.tendon(t).name}`" for t in range(mj.ntendon) if mj.tendon_limited[t]]
    # The forces of joints are found by the coordinates; those that others move have none of their own.
    texts = {}
    for j, frame in moving:
        slopes, _ = dependence(model, frame.get("revolute", frame.get("prismatic")))
        if list(slopes.values()) == [1.0] and list(slopes)[0] not in texts.values():
            texts[j] = list(slopes)[0]
    return out + judge.force_limit_faults(mj, model, texts)


def urdf_faults(judge, model, pairs, stated):
    """Ranges, rates and forces of a URDF; `stated` has them by the name of the joint."""
    joints = [(frame, stated[name]["position"], 0.0) for name, frame in pairs if "position" in stated.get(name, {})]
    # Rates and forces of coupled joints belong to the leader, and are not compared.
    own = {name: {key: one for key, one in entry.items() if key != "position"} for name, entry in stated.items()}
    alone = {name: entry for name, entry in own.items() if name in model.coordinates and not entry.get("coupled")}
    return range_faults(model, joints) + judge.limit_faults(SimpleNamespace(limits=alone), model)


def is_named(fault, said):
    """Whether a remark names what a fault of the limits states."""
    names = re.findall(r"`([^`]*)`", fault) or re.findall(r"of (?:the tendon )?([\w:.-]+)", fault)
    lines = [line for line in said.splitlines() if "left out" in line or "without limits" in line]
    if any(f"`{name}`" in line for name in names for line in lines if "limit" in line or "range" in line):
        return True
    return any(words in fault and remark in said for words, remark in NAMED_TOGETHER)
