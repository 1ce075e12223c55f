"""The verdict on one description: imports it with the program and compares forces, freedoms, closures and limits with a peer."""

import re
import sys
import time
import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

import limits
import named
import peers

sys.path.insert(0, str(Path(__file__).parent.parent / "random-descriptions"))
from imported import EmittedModel, run  # noqa: E402

WORST = 1e-8
OPEN = 1e-7
N_STATES = 4
NO_MOTION = ("no joint that moves", "static, so nothing moves")
# Words of refusals that were read: what models cannot express, so that the reason is true.
TRUE_LIMITS = (
    "not expanded here",
    "models have couplings of two joints only",
    "the file has a second model",
    "too many coordinates",
    "models support loops within one free body only",
    "a coupling by a polynomial of higher degree",
)
BOTH = "the peer refuses it as well"
NO_MODEL = "the import wrote a file that is no model"


class Report(dict):
    """What is known of one description so far; `stage` sends it on, so that it survives a time limit."""

    def __init__(self, send):
        super().__init__(verdict="time", why="", said="", seconds={}, stage="")
        self.send, self.since = send, time.monotonic()

    def start(self, stage):
        """Ends the stage before and starts another."""
        now = time.monotonic()
        if self["stage"]:
            self["seconds"][self["stage"]] = self["seconds"].get(self["stage"], 0) + now - self.since
        self["stage"], self.since = stage, now
        self.send(dict(self))

    def end(self, verdict, why=""):
        """The last message."""
        self.start("end")
        self["verdict"], self["why"] = verdict, why
        self.send(dict(self))


def import_to(program, path, out, options=()):
    """Imports a description into the file `out`. Returns whether that was possible, and the messages."""
    status, said = run(program, "import", path, "--out", out, *options)
    return status == 0 and out.exists(), said


def add_drives(file):
    """Gives a drive to each coordinate of a model without one, so that the forces of all are compared."""
    text = file.read_text()
    model = tomllib.loads(text)
    free = [name for name, entry in model.get("coordinates", {}).items() if entry.get("driven") is False]
    # Drives between two points count as drives of coordinates, so that more of them would be too many.
    if any("linear" in drive for drive in model.get("drive", [])):
        return
    text = text.replace(", driven = false", "")
    text += "".join(f'\n[[drive]]\nname = "{name}_drive"\njoint = "{name}"\n' for name in free)
    file.write_text(text)


def drive_rows(model, real, peer, state):
    """Forces of the drives to forces at the coordinates `real`: one row for each drive."""
    if not peer.free:
        return model.drive_motion(*state)[2]
    rows = np.zeros((len(model.drives), len(real)))
    for k, drive in enumerate(model.drives):
        rows[k, real.index(drive.removeprefix("on_").removesuffix("_drive"))] = 1.0
    return rows


def random_state(model, peer, rng):
    """Positions near the nominal ones, rates and accelerations of the coordinates."""
    n = len(model.coordinates)
    q = model.nominal() + rng.uniform(-0.3, 0.3, n)
    for names in peer.free:
        at = [model.coordinates.index(name) for name in names[3:]]
        q[at] /= np.linalg.norm(q[at])
    return q, rng.uniform(-1, 1, n), rng.uniform(-1, 1, n)


def force_error(model, peer, state):
    """Largest difference of the forces relative to the largest force, the name of its coordinate, and the peer's motion."""
    motion, forces = peer.motion(*state), model.forces(*state)
    real = [name for name in model.coordinates if not any(name == names[3] for names in peer.free)]
    units = [np.array([float(name == other) for other in model.coordinates]) for name in real]
    # Rates of the peer's joints for one unit of each rate.
    columns = np.array([peer.motion(state[0], unit, 0 * unit)[1] for unit in units])
    expected = columns @ peer.forces(motion)
    rows = drive_rows(model, real, peer, state)
    driven = np.abs(rows).max(axis=0, initial=0.0) > 1e-12
    difference = np.where(driven, np.abs(rows.T @ forces - expected), 0.0)
    # What is no number counts as a difference.
    difference[np.isnan(difference)] = np.inf
    at = int(np.argmax(difference)) if len(difference) else 0
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    return difference[at] / scale, real[at], motion, int(driven.sum())


def faults(model, peer):
    """What differs at random states; empty if nothing does. Second, the number of coordinates with a compared force."""
    rng = np.random.default_rng(1)
    worst, name, opened, done, compared, left = 0.0, "", 0.0, 0, 0, 0
    for _ in range(5 * N_STATES):
        state = random_state(model, peer, rng)
        try:
            error, own, motion, compared = force_error(model, peer, state)
        except ArithmeticError:
            # The loops cannot be closed at this state.
            continue
        violation, left = peer.closure(motion)
        worst, name = max((worst, name), (error, own))
        opened, done = max(opened, violation), done + 1
        if done == N_STATES:
            break
    n = len(model.coordinates) - len(peer.free)
    out = [] if done else ["no state could be evaluated"]
    out += [f"forces differ by {worst:.2g} at {name}"] if worst > WORST else []
    out += [f"{left} degrees of freedom, {n} in the model"] if done and left != n else []
    out += [f"a closure is open by {opened:.2g}"] if opened > OPEN else []
    return out, compared


def mujoco_faults(model, said, path):
    """Faults against MuJoCo with what the remarks name left out, its names, faults of limits, and the number of forces."""
    peer = peers.MujocoPeer(peers.load_mujoco(path), model, said)
    found, compared = faults(model, peer)
    has_springdampers = "`springdamper` of <joint>" not in said
    mj = peers.load_mujoco(path, has_springdampers)
    short = named.leave_out(mj, said) + ["spring-dampers"] * (not has_springdampers) if found else []
    found = faults(model, peers.MujocoPeer(mj, model, said))[0] if short else found
    return found, short, peer.limit_faults(model), compared


def tree_faults(kind, model, said, path, folder, is_floating):
    """The same against Pinocchio or Drake."""
    try:
        if kind == "sdf":
            peer = peers.DrakePeer(path, model, said, folder)
        else:
            peer = peers.PinocchioPeer(path, model, said, is_floating)
    except peers.NotRead:
        if kind == "sdf" or is_floating:
            raise
        peer = peers.DrakePeer(path, model, said, folder)
    found, compared = faults(model, peer)
    return found, [], peer.limit_faults(model), compared


def check_peer(description, path):
    """Loads a description with its peer alone; returns the fault, or the number of degrees of freedom."""
    try:
        if description.kind == "mjcf":
            return None, peers.load_mujoco(path).nv
        if description.kind == "urdf":
            return None, peers.load_pinocchio(path, False).nv
        return None, peers.load_drake(path).num_velocities()
    except peers.NotRead as fault:
        return str(fault), 0


def saved_by_mujoco(path, folder):
    """The description as MuJoCo saves it, with all inertias and without meshes; none if MuJoCo cannot read it again."""
    import mujoco

    try:
        spec = mujoco.MjSpec.from_file(str(path))
        first = spec.compile()
        spec.compiler.saveinertial = True
        out = folder / "saved.xml"
        out.write_text(without_meshes(spec.to_xml()))
        again = mujoco.MjModel.from_xml_path(str(out))
    except (ValueError, mujoco.FatalError) as fault:
        print(f"{path}: not saved: {fault}", file=sys.stderr)
        return None
    is_same = (first.nv, first.nbody) == (again.nv, again.nbody) and np.allclose(first.body_mass, again.body_mass, rtol=1e-4)
    return out if is_same else None


def without_meshes(text):
    """An MJCF without its assets, the shapes made from them, and what refers to shapes. Inertias must be given."""
    root = ElementTree.fromstring(text)
    for parent in list(root.iter()):
        for node in list(parent):
            refers = any(node.get(key) for key in ("mesh", "hfield")) or node.get("type") in ("mesh", "sdf", "hfield")
            if node.tag in ("asset", "sensor", "contact", "skin") or node.tag == "geom" and refers:
                parent.remove(node)
            node.attrib.pop("material", None)
    return ElementTree.tostring(root, encoding="unicode")


def is_true_refusal(message, path, freedoms, fault):
    """Whether the reason of a refusal is true, as far as the peer tells."""
    if fault is not None:
        return BOTH
    if any(words in message for words in NO_MOTION):
        return "true" if freedoms == 0 or "static" in message else "FALSE: the peer has joints"
    if "inertia of a mesh" in message:
        return "true" if meshes_move(path) else "FALSE: only bodies that do not move have inertia from a mesh"
    return "true" if any(words in message for words in TRUE_LIMITS) else "to be read"


def meshes_move(path):
    """Whether a body that moves gets its inertia from a mesh."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path))
    mj = spec.compile()
    from_shapes = [body for body in spec.bodies if spec.compiler.inertiafromgeom == 1 or not body.explicitinertial]
    heavy = [body for body in from_shapes if any(has_mesh_mass(geom) for geom in body.geoms)]
    return any(mj.body_weldid[body.id] != 0 for body in heavy)


def has_mesh_mass(geom):
    """Whether a shape of MuJoCo is a mesh with mass; a mass that is not given is no number."""
    import mujoco

    return geom.type == mujoco.mjtGeom.mjGEOM_MESH and geom.mass != 0 and (geom.mass > 0 or geom.density > 0)


def short_message(said):
    """The message of a refusal without place and names, to count equal ones."""
    lines = said.strip().splitlines() or [""]
    line = next((line for line in lines if line.startswith("error")), lines[0])
    line = re.sub(r"^error: \S+?: ", "", line)
    return re.sub(r"line \d+", "line N", re.sub(r"`[^`]*`", "`..`", line))


def compare(program, description, path, folder, report, options=()):
    """Imports and judges one file; returns verdict and reason."""
    report.start("import")
    out = folder / "model.toml"
    out.unlink(missing_ok=True)
    is_read, said = import_to(program, path, out, options)
    report["said"] = said
    if not is_read:
        report.start("peer")
        fault, freedoms = check_peer(description, path)
        report["reason"] = is_true_refusal(said, path, freedoms, fault)
        return "refused", said.strip()
    add_drives(out)
    report.start("generate")
    try:
        model = EmittedModel(program, out)
    except ValueError as fault:
        report["reason"] = NO_MODEL
        return "refused", f"the import has no model: {fault}"
    report.start("check")
    try:
        if description.kind == "mjcf":
            found, short, of_limits, compared = mujoco_faults(model, said, path)
        else:
            is_floating = "--floating" in options
            found, short, of_limits, compared = tree_faults(description.kind, model, said, path, folder, is_floating)
    except peers.NotRead as fault:
        return "not judged", str(fault)
    except (ValueError, KeyError) as fault:
        return "wrong", f"{type(fault).__name__}: {fault}"
    report["compared"], report["coordinates"] = compared, len(model.coordinates)
    return verdict_of(found, short, of_limits, said)


def verdict_of(found, short, of_limits, said):
    """The verdict and its reason, from the faults that remain, the names of what was left out, and the faults of limits."""
    unnamed = [fault for fault in of_limits if not limits.is_named(fault, said)]
    if found or unnamed:
        return "wrong", "; ".join([*found, *unnamed])
    short = short + ["limits"] * bool(of_limits)
    return ("left out" if short else "right"), ", ".join(short)


def judge(program, description, folder, report, floats=False):
    """The whole verdict, sent with `report`. What does not move is judged as a free body, what needs MuJoCo as it saves it."""
    path = description.path
    if description.kind == "mjcf" and description.is_included and check_peer(description, path)[0] is not None:
        return report.end("part", "another file includes it, and MuJoCo does not read it alone")
    options = ("--floating",) if floats and description.kind == "urdf" else ()
    verdict, why = compare(program, description, path, folder, report, options)
    if verdict == "refused" and description.kind == "urdf" and NO_MOTION[0] in why:
        verdict, why = compare(program, description, path, folder, report, ("--floating",))
    elif verdict == "refused" and "mj_saveLastXML" in why and (saved := saved_by_mujoco(path, folder)):
        reason = report["reason"]
        report["saved"], report["saved why"] = compare(program, description, saved, folder, report)
        report["reason"] = reason
    report.end(final_verdict(verdict, why, report), why)


def final_verdict(verdict, why, report):
    """Refusals by kind: nothing moves, both programs refuse, or only the import; and what is wrong as MuJoCo saves it."""
    if verdict != "refused":
        return verdict
    report["short"] = short_message(why)
    whys = (why, report.get("saved why", "")) if report.get("saved") == "refused" else (why,)
    if report["reason"] != BOTH and any(words in one for words in NO_MOTION for one in whys):
        return "no motion"
    return "both refuse" if report["reason"] == BOTH else "refused"
