"""The other programs: forces of a motion of the imported model's coordinates, computed by MuJoCo, Pinocchio or Drake.

A peer has `motion`, which turns positions, rates and accelerations of the coordinates into those of its own joints, and
`forces`, the generalized forces of such a motion. `closure` tells how far loops are open and how many degrees of freedom remain.
"""

import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import limits

sys.path.insert(0, str(Path(__file__).parent.parent / "random-descriptions"))


MASSLESS = "1e-15"


def root_of(path):
    """The root of an XML file. Prefixes that the file does not declare are declared, since other readers accept them."""
    text = Path(path).read_bytes().decode(errors="replace")
    try:
        return ElementTree.fromstring(text.encode())
    except ElementTree.ParseError:
        prefixes = sorted(set(re.findall(r"[<\s]([\w-]+):[\w-]+(?=[\s=>/])", text)) - set(re.findall(r"xmlns:([\w-]+)", text)))
        declared = "".join(f' xmlns:{prefix}="{prefix}"' for prefix in prefixes)
        return ElementTree.fromstring(re.sub(r"<robot\b", f"<robot{declared}", text, count=1).encode())


class NotRead(Exception):
    """The other program does not read the description."""


def fixed_joints(said):
    """Joints that the import fixes by a coupling, with their values."""
    lines = [line for line in said.splitlines() if "` is fixed at " in line]
    return {line.split("`")[1]: float(line.split("is fixed at")[1].split()[0].rstrip(".;")) for line in lines}


def joint_frames(model):
    """The frames of a model that move, in their order."""
    return [frame for frame in model.model["frame"] if "joint" in frame]


def value_of(model, joint, levels):
    """Value, rate and acceleration of a joint with one coordinate."""
    text = joint.get("revolute", joint.get("prismatic"))
    constant = model.evaluate(text, {name: 0.0 for name in levels[0]})
    own = [model.evaluate(text, level) for level in levels]
    return own[0], own[1] - constant, own[2] - constant


class MujocoPeer:
    """MuJoCo, for MJCF."""

    def __init__(self, mj, model, said):
        import judge_mjcf

        self.judge, self.mj = judge_mjcf, mj
        self.map = judge_mjcf.JointMap(model, mj, said)
        self.free = [frame["free"] for _, frame in self.map.pairs if "free" in frame]

    def motion(self, q, qd, qdd):
        return self.map.motion(q, qd, qdd)

    def forces(self, motion):
        import mujoco

        data = mujoco.MjData(self.mj)
        data.qpos[:], data.qvel[:], data.qacc[:] = motion
        return self.judge.joint_forces(self.mj, data)

    def closure(self, motion):
        return self.judge.closure_error(self.mj, motion[0])

    def limit_faults(self, model):
        return limits.mujoco_faults(self.judge, self.mj, model, self.map.pairs)


def load_mujoco(path, has_springdampers=True):
    """MuJoCo's model of a file, with or without the springs and dampers that it computes for `springdamper`."""
    import mujoco

    try:
        if not has_springdampers:
            spec = mujoco.MjSpec.from_file(str(path))
            for joint in spec.joints:
                joint.springdamper = [0, 0]
            return spec.compile()
        return mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError) as fault:
        raise NotRead(str(fault).splitlines()[0]) from fault


class PinocchioPeer:
    """Pinocchio, for URDF. Joints are matched with the frames of the model by the order breadth first from the root."""

    def __init__(self, path, model, said, is_floating):
        import pinocchio

        self.pin, self.model = pinocchio, model
        self.robot = load_pinocchio(path, is_floating)
        self.data = self.robot.createData()
        fixed = fixed_joints(said)
        names = ["root_joint"] * is_floating + [name for name in moving_joints(path) if name not in fixed]
        frames = joint_frames(model)
        if len(names) != len(frames):
            raise ValueError(f"{len(names)} joints move in the URDF, {len(frames)} in the model")
        self.pairs = [(self.robot.joints[self.robot.getJointId(name)], frame["joint"]) for name, frame in zip(names, frames)]
        self.fixed = [(self.robot.joints[self.robot.getJointId(name)], value) for name, value in fixed.items()]
        self.free = [joint["free"] for _, joint in self.pairs if "free" in joint]
        self.names = [(name, frame["joint"]) for name, frame in zip(names, frames)]
        self.path = path

    def motion(self, q, qd, qdd):
        levels = self.model.coordinate_motion(q, qd, qdd)
        out = self.pin.neutral(self.robot), np.zeros(self.robot.nv), np.zeros(self.robot.nv)
        for own, value in self.fixed:
            self.set_one(out, own, (value, 0.0, 0.0))
        for own, joint in self.pairs:
            if "free" in joint:
                self.set_free(out, own, [[level[name] for name in joint["free"]] for level in levels])
            else:
                self.set_one(out, own, value_of(self.model, joint, levels))
        return out

    def set_one(self, out, own, values):
        """Writes a joint with one degree of freedom; one without limits has cosine and sine as its position."""
        if own.nq == 2:
            out[0][own.idx_q : own.idx_q + 2] = np.cos(values[0]), np.sin(values[0])
        else:
            out[0][own.idx_q] = values[0]
        out[1][own.idx_v], out[2][own.idx_v] = values[1:]

    def set_free(self, out, own, values):
        """Writes a free joint. The model has the velocity in the axes of the world, Pinocchio in those of the body."""
        (*p, w, x, y, z), (*v, _, wx, wy, wz), (*a, _, ax, ay, az) = values
        turn = self.pin.Quaternion(w, x, y, z).normalized().toRotationMatrix().T
        rate = np.array([wx, wy, wz])
        out[0][own.idx_q : own.idx_q + 7] = [*p, x, y, z, w]
        out[1][own.idx_v : own.idx_v + 6] = [*(turn @ v), *rate]
        out[2][own.idx_v : own.idx_v + 6] = [*(turn @ a - np.cross(rate, turn @ v)), ax, ay, az]

    def forces(self, motion):
        """Pinocchio reads damping and friction of a URDF, but has them in no force."""
        rate = motion[1]
        force = self.pin.rnea(self.robot, self.data, *motion)
        return force + self.robot.damping * rate + self.friction() * np.sign(rate)

    def friction(self):
        """The friction of each degree of freedom, which versions of Pinocchio name differently."""
        return self.robot.upperDryFrictionLimit if hasattr(self.robot, "upperDryFrictionLimit") else self.robot.friction

    def closure(self, _motion):
        return 0.0, self.robot.nv - len(self.fixed) - len(mimic_joints(self.path))

    def limit_faults(self, model):
        import judge_tree

        return limits.urdf_faults(judge_tree, model, self.names, stated_limits(self.path))


def load_pinocchio(path, is_floating):
    """Pinocchio's model of a URDF, with its root fixed or free."""
    import pinocchio

    try:
        root = [pinocchio.JointModelFreeFlyer()] if is_floating else []
        return pinocchio.buildModelFromUrdf(str(path), *root)
    except (ValueError, RuntimeError) as fault:
        raise NotRead(str(fault).splitlines()[0]) from fault


def moving_joints(path):
    """Names of the joints of a URDF that move, breadth first from the root, as the import has them."""
    joints = [joint for joint in root_of(path).findall("joint")]
    below, children = {}, set()
    for joint in joints:
        below.setdefault(joint.find("parent").get("link"), []).append(joint)
        children.add(joint.find("child").get("link"))
    waiting = [link for link in below if link not in children]
    names = []
    while waiting:
        for joint in below.get(waiting.pop(0), []):
            waiting.append(joint.find("child").get("link"))
            if joint.get("type") != "fixed":
                names.append(joint.get("name"))
    return names


def mimic_joints(path):
    """Names of the joints of a URDF that follow others that move."""
    joints = root_of(path).findall("joint")
    moving = {joint.get("name") for joint in joints if joint.get("type") != "fixed"}
    follows = {joint.get("name"): joint.find("mimic").get("joint") for joint in joints if joint.find("mimic") is not None}
    return [name for name, leader in follows.items() if name in moving and leader in moving]


def stated_limits(path):
    """Limits of the joints of a URDF by name; of coupled joints the range only."""
    root = root_of(path)
    coupled = {joint.get("joint") for joint in root.iter("mimic")} | set(mimic_joints(path))
    out = {}
    for joint in root.findall("joint"):
        name, limit = joint.get("name"), joint.find("limit")
        if limit is None or joint.get("type") not in ("revolute", "prismatic", "continuous"):
            continue
        low, high = float(limit.get("lower", 0)), float(limit.get("upper", 0))
        effort, rate = float(limit.get("effort", 0)), float(limit.get("velocity", 0))
        out[name] = {"position": [low, high]} if low < high and joint.get("type") != "continuous" else {}
        if name not in coupled:
            out[name] |= ({"rate": rate} if rate > 0 else {}) | ({"force": [-effort, effort]} if effort > 0 else {})
    return out


class DrakePeer:
    """Drake, for SDF, and for a URDF that Pinocchio does not read. It reads trees only; `cut` are joints that close loops."""

    def __init__(self, path, model, said, folder):
        import judge_tree

        self.judge, self.model = judge_tree, model
        frames = [frame for frame in joint_frames(model) if "free" in frame["joint"]]
        self.free = [frame["joint"]["free"] for frame in frames]
        tree, self.cut = plain_tree(path, model, folder) if path.suffix.lower() == ".sdf" else (path, [])
        self.plant = load_drake(tree, [frame["name"] for frame in frames])
        self.description = SimpleNamespace(mimics=stated_mimics(path), friction=stated_friction(path))
        self.joints = judge_tree.Joints(model, self.plant, self.description, said)
        gravity = [model.evaluate(str(g).replace('"', ""), {}) for g in model.model["gravity"]]
        self.plant.mutable_gravity_field().set_gravity_vector(np.array(gravity))

    def motion(self, q, qd, qdd):
        motion, levels = self.joints.motion(q, qd, qdd), self.model.coordinate_motion(q, qd, qdd)
        for k, names in enumerate(self.free):
            self.set_free(motion, self.plant.GetJointByName(f"free_{k}"), [[level[name] for name in names] for level in levels])
        return motion

    def set_free(self, motion, joint, values):
        """Writes a free joint. The model has the angular velocity in the axes of the body, Drake in those of the world."""
        from scipy.spatial.transform import Rotation

        a, d = joint.position_start(), joint.velocity_start()
        turn = Rotation.from_quat([*values[0][4:], values[0][3]])
        motion[0][a : a + 7] = [*values[0][3:], *values[0][:3]]
        for own, level in zip(motion[1:], values[1:]):
            own[d : d + 6] = [*turn.apply(level[4:]), *level[:3]]

    def forces(self, motion):
        return self.judge.joint_forces(self.plant, self.description, *motion, None)[0]

    def closure(self, motion):
        """How far the cut joints are apart, and the degrees of freedom that they leave."""
        freedoms = self.plant.num_velocities() - len(self.description.mimics)
        if not self.cut:
            return 0.0, freedoms
        gap = self.gap(motion[0])
        steps = 1e-6 * np.eye(len(motion[0]))
        slopes = np.array([(self.gap(motion[0] + step) - self.gap(motion[0] - step)) / 2e-6 for step in steps])
        return np.abs(gap).max(), freedoms - np.linalg.matrix_rank(slopes, tol=1e-5)

    def gap(self, position):
        """The conditions of all cut joints at a position; zero if the loops are closed."""
        context, start = self.plant.CreateDefaultContext(), self.plant.CreateDefaultContext()
        self.plant.SetPositions(context, position)
        out = []
        for joint in self.cut:
            bodies = [self.plant.GetBodyByName(joint.findtext(end).strip()) for end in ("parent", "child")]
            ends = [body.EvalPoseInWorld(start) for body in bodies]
            place = ends[1].multiply(pose_of(joint))
            now = [body.EvalPoseInWorld(context).multiply(end.inverse().multiply(place)) for body, end in zip(bodies, ends)]
            out += conditions(joint, *now)
        return np.array(out)

    def limit_faults(self, _model):
        return []


def pose_of(node):
    """The `<pose>` of an element of SDF."""
    from pydrake.math import RigidTransform, RollPitchYaw

    x, y, z, *angles = [float(word) for word in node.findtext("pose", "0 0 0 0 0 0").split()]
    return RigidTransform(RollPitchYaw(angles), [x, y, z])


def conditions(joint, one, other):
    """What is zero if a joint holds both frames together: points for a ball, an axis for a hinge, all for a fixed joint."""
    out = list(one.translation() - other.translation())
    turn = one.rotation().matrix().T @ other.rotation().matrix()
    if joint.get("type") == "fixed":
        return out + [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    if joint.get("type") in ("revolute", "continuous"):
        axis = np.array([float(word) for word in joint.findtext("axis/xyz").split()])
        return out + list(np.cross(axis, turn @ axis))
    return out


def plain_tree(path, model, folder):
    """An SDF without shapes and without the joints that close loops: the file, and these joints. Joints of the model stay."""
    document = ElementTree.parse(path)
    named = {name.lower() for name in (*model.coordinates, *model.passive, *model.followers())}
    in_model = lambda joint: re.sub(r"\W", "_", joint.get("name")).lower() in named  # noqa: E731
    group, cut = {}, []

    def find(link):
        while group.get(link, link) != link:
            link = group[link]
        return link

    for robot in [document.getroot(), *document.getroot().iter("model")]:
        for joint in sorted(robot.findall("joint"), key=lambda joint: not in_model(joint)):
            one, other = (find(joint.findtext(end).strip()) for end in ("parent", "child"))
            if one == other:
                robot.remove(joint)
                cut.append(joint)
            group[one] = other
        for link in robot.findall("link"):
            for node in [node for node in link if node.tag not in ("pose", "inertial")]:
                link.remove(node)
            # A massless link would get one kilogram, which is the default of the format.
            for mass in [node for node in link.findall("inertial/mass") if float(node.text) == 0]:
                mass.text = MASSLESS
    document.write(out := folder / "tree.sdf")
    return out, cut


def load_drake(path, free=()):
    """Drake's plant of a file. The bodies `free` get a free joint; the root of a URDF is fixed."""
    import logging

    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import QuaternionFloatingJoint

    logging.getLogger("drake").setLevel(logging.ERROR)
    plant = MultibodyPlant(0.0)
    try:
        Parser(plant).AddModels(str(path))
        root = root_link(path) if path.suffix.lower() == ".urdf" else None
        if root is not None and root != "world":
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))
        for k, name in enumerate(free):
            plant.AddJoint(QuaternionFloatingJoint(f"free_{k}", plant.world_frame(), body_named(plant, name).body_frame()))
        plant.Finalize()
    except RuntimeError as fault:
        raise NotRead(str(fault).splitlines()[0][:300]) from fault
    return plant


def body_named(plant, frame):
    """Drake's body of a frame of the model, in whose name some characters are replaced."""
    from pydrake.multibody.tree import BodyIndex

    bodies = [plant.get_body(BodyIndex(k)) for k in range(plant.num_bodies())]
    return next(body for body in bodies if re.sub(r"\W", "_", body.name()) in (frame, re.sub(r"_\d+$", "", frame)))


def root_link(path):
    """The link of a URDF that is no child; none if it is the world, which needs no element."""
    root = root_of(path)
    children = {joint.find("child").get("link") for joint in root.findall("joint")}
    return next((link.get("name") for link in root.findall("link") if link.get("name") not in children), None)


def stated_mimics(path):
    """Couplings of joints as the file states them: the leader, ratio and offset by the follower's name."""
    out = {}
    for joint in root_of(path).iter("joint"):
        own, inner = joint.find("mimic"), joint.find("axis/mimic")
        if own is not None:
            out[joint.get("name")] = own.get("joint"), float(own.get("multiplier", 1)), float(own.get("offset", 0))
        elif inner is not None:
            number = {key: float(inner.findtext(key, "0")) for key in ("multiplier", "offset", "reference")}
            offset = number["offset"] - number["multiplier"] * number["reference"]
            out[joint.get("name")] = inner.get("joint"), number["multiplier"], offset
    return out


def stated_friction(path):
    """Coulomb friction of the joints of a file, which Drake does not read."""
    out = {}
    for joint in root_of(path).iter("joint"):
        own, inner = joint.find("dynamics"), joint.findtext("axis/dynamics/friction")
        if joint.get("type") in ("revolute", "prismatic", "continuous"):
            out[joint.get("name")] = float(inner or (own.get("friction", 0) if own is not None else 0))
    return out
