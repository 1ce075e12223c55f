"""Random URDF and SDF descriptions: a small random tree with one feature of the format.

`describe(format, name, seed)` gives a `Description`: its text, and what a judge that does not read the feature needs to know.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

from drawn_numbers import DrawnNumbers

DRAKE = "https://drake.mit.edu"
ET.register_namespace("drake", DRAKE)


@dataclass
class Description:
    text: str = ""
    # Words of which a remark must contain one if the import leaves the feature out.
    words: list = field(default_factory=list)
    # Joint: (leader, multiplier, offset).
    mimics: dict = field(default_factory=dict)
    # Coulomb friction, springs (stiffness, rest) and rotors by joint.
    friction: dict = field(default_factory=dict)
    # Pairs of (link, point) that coincide, and degrees of freedom that they remove.
    closures: list = field(default_factory=list)
    removed: int = 0
    # What the judge is to read in place of the text.
    judged: str | None = None
    limits: dict = field(default_factory=dict)
    closures_file: str | None = None
    options: tuple = ()


class Tree(DrawnNumbers):
    """Two to four links on a base, with one joint each."""

    def __init__(self, kind, seed):
        super().__init__(seed)
        self.kind = kind
        self.d = Description()
        rng = self.rng
        self.links = []
        self.root = self.top = ET.Element("robot", {"name": "r", "xmlns:drake": DRAKE}) if kind == "urdf" else ET.Element(
            "sdf", {"version": "1.12", "xmlns:drake": DRAKE})
        if kind == "sdf":
            self.top = ET.SubElement(self.root, "model", name="r")
        self.add_link("base")
        if kind == "sdf":
            fix = ET.SubElement(self.top, "joint", name="fix", type="fixed")
            ET.SubElement(fix, "parent").text = "world"; ET.SubElement(fix, "child").text = "base"
        for k in range(rng.randint(2, 4)):
            parent = rng.choice(["base"] + self.links[1:]) if k else "base"
            self.add_link(f"b{k + 1}")
            self.add_joint(f"j{k + 1}", parent, f"b{k + 1}")
        self.joints = [j for j in self.top.findall("joint") if j.get("type") != "fixed"]

    def inertia(self):
        a, b = self.number(0.1, 0.2), self.number(0.1, 0.2)
        return {"ixx": a, "iyy": b, "izz": round((a + b) * 0.8, 4), "ixy": self.signed(0.2) / 10, "ixz": 0.0, "iyz": self.signed(0.2) / 10}

    def add_link(self, name, has_mass=True):
        link = ET.SubElement(self.top, "link", name=name)
        if self.kind == "sdf" and name != "base":
            ET.SubElement(link, "pose").text = self.vec(6)
        if has_mass:
            i = ET.SubElement(link, "inertial")
            values = {k: str(v) for k, v in self.inertia().items()}
            if self.kind == "urdf":
                ET.SubElement(i, "origin", xyz=self.vec(), rpy=self.vec())
                ET.SubElement(i, "mass", value=str(self.number(0.5, 3))); ET.SubElement(i, "inertia", values)
            else:
                ET.SubElement(i, "pose").text = self.vec(6)
                ET.SubElement(i, "mass").text = str(self.number(0.5, 3))
                inertia = ET.SubElement(i, "inertia")
                for k, v in values.items():
                    ET.SubElement(inertia, k).text = v
        self.links.append(name)
        return link

    def add_joint(self, name, parent, child, kind=None):
        kind = kind or self.rng.choice(["revolute", "revolute", "prismatic", "continuous"])
        joint = ET.SubElement(self.top, "joint", name=name, type=kind)
        if self.kind == "urdf":
            ET.SubElement(joint, "origin", xyz=self.vec(), rpy=self.vec())
            ET.SubElement(joint, "parent", link=parent); ET.SubElement(joint, "child", link=child)
            ET.SubElement(joint, "axis", xyz=self.vec())
            if kind in ("revolute", "prismatic"):
                ET.SubElement(joint, "limit", lower="-2", upper="2", effort="50", velocity="4")
        else:
            ET.SubElement(joint, "pose").text = self.vec(6)
            ET.SubElement(joint, "parent").text = parent; ET.SubElement(joint, "child").text = child
            ET.SubElement(ET.SubElement(joint, "axis"), "xyz").text = self.vec()
        return joint

    def joint(self):
        return self.rng.choice(self.joints)

    def link(self):
        name = self.rng.choice(self.links[1:])
        return next(e for e in self.top.findall("link") if e.get("name") == name)

    def two_of_a_kind(self):
        a, b = self.joints[0], self.joints[1]
        for j in (a, b):
            j.set("type", "continuous" if self.kind == "urdf" else "revolute")
            limit = j.find("limit")
            if limit is not None:
                j.remove(limit)
        return a, b

    def set_kind(self, joint, kind):
        joint.set("type", kind)

    def sub(self, parent, path, value=None):
        """Sets nested elements, as `axis/limit/lower`."""
        for tag in path.split("/"):
            found = parent.find(tag)
            parent = found if found is not None else ET.SubElement(parent, tag)
        if value is not None:
            parent.text = str(value)
        return parent


FEATURES = {"urdf": {}, "sdf": {}}


def feature(kind, words=""):
    def add(function):
        for one in kind.split():
            FEATURES[one][function.__name__] = (function, words.split())
        return function
    return add


def dynamics(t, joint, **values):
    """Damping, friction and springs of a joint; friction is added by the judge."""
    if t.kind == "urdf":
        node = joint.find("dynamics")
        node = ET.SubElement(joint, "dynamics") if node is None else node
        for k, v in values.items():
            node.set(k, str(v))
    else:
        for k, v in values.items():
            t.sub(joint, f"axis/dynamics/{k}", v)
    if "friction" in values:
        t.d.friction[joint.get("name")] = values["friction"]


@feature("urdf sdf")
def plain(t):
    pass


@feature("urdf sdf")
def damping(t):
    dynamics(t, t.joint(), damping=t.number())


@feature("urdf sdf")
def friction(t):
    dynamics(t, t.joint(), friction=t.number())


@feature("sdf")
def spring(t):
    dynamics(t, t.joint(), spring_stiffness=t.number(1, 5), spring_reference=t.signed())


@feature("urdf")
def limits(t):
    j = t.joint(); j.set("type", t.rng.choice(["revolute", "prismatic"]))
    limit = j.find("limit")
    limit = ET.SubElement(j, "limit") if limit is None else limit
    low, high, effort, rate = -t.number(), t.number(), t.number(5, 9), t.number(2, 5)
    limit.attrib.update(lower=str(low), upper=str(high), effort=str(effort), velocity=str(rate))
    t.d.limits[j.get("name")] = {"position": [low, high], "rate": rate, "force": [-effort, effort]}


@feature("sdf")
def limits_sdf(t):
    j = t.joint(); j.set("type", t.rng.choice(["revolute", "prismatic"]))
    low, high, effort, rate = -t.number(), t.number(), t.number(5, 9), t.number(2, 5)
    for k, v in {"lower": low, "upper": high, "effort": effort, "velocity": rate}.items():
        t.sub(j, f"axis/limit/{k}", v)
    t.d.limits[j.get("name")] = {"position": [low, high], "rate": rate, "force": [-effort, effort]}


@feature("sdf", "limit range bound lower upper")
def limit_on_one_side(t):
    j = t.joint(); j.set("type", "prismatic"); t.sub(j, "axis/limit/lower", -0.4)
    t.d.limits[j.get("name")] = {"position": [-0.4, None]}


@feature("sdf", "limits")
def limits_equal(t):
    j = t.joint(); j.set("type", "prismatic"); t.sub(j, "axis/limit/lower", 0.3); t.sub(j, "axis/limit/upper", 0.3)
    t.d.limits[j.get("name")] = {"position": [0.3, 0.3]}


@feature("urdf")
def limit_continuous(t):
    j = t.joint(); j.set("type", "continuous")
    limit = j.find("limit")
    limit = ET.SubElement(j, "limit") if limit is None else limit
    limit.attrib.clear(); limit.attrib.update(effort="7", velocity="3")
    t.d.limits[j.get("name")] = {"rate": 3.0, "force": [-7.0, 7.0]}


@feature("urdf", "acceleration")
def limit_acceleration(t):
    j = t.joint(); j.set("type", "revolute")
    limit = j.find("limit")
    limit = ET.SubElement(j, "limit") if limit is None else limit
    limit.attrib.update(lower="-1", upper="1", effort="7", velocity="3", acceleration="5"); t.d.limits[j.get("name")] = {"acceleration": 5}


@feature("urdf")
def default_axis(t):
    j = t.joint(); j.remove(j.find("axis"))


@feature("urdf")
def origin_left_out(t):
    j = t.joint(); j.remove(j.find("origin"))
    inertial = t.link().find("inertial")
    inertial.remove(inertial.find("origin"))


@feature("urdf")
def no_inertial(t):
    l = t.link(); l.remove(l.find("inertial"))


@feature("urdf sdf")
def fixed_links(t):
    parent = t.rng.choice(t.links[1:])
    t.add_link("tool"); j = t.add_joint("weld", parent, "tool", "fixed")
    j.remove(j.find("axis"))


@feature("urdf sdf")
def fixed_in_between(t):
    j = t.joints[0]; j.set("type", "fixed"); j.remove(j.find("axis"))


def mimic(t, follower, leader, multiplier, offset, **more):
    if t.kind == "urdf":
        ET.SubElement(follower, "mimic", joint=leader.get("name"), multiplier=str(multiplier), offset=str(offset))
    else:
        node = t.sub(follower, "axis/mimic"); node.set("joint", leader.get("name"))
        t.sub(node, "multiplier", multiplier); t.sub(node, "offset", offset); t.sub(node, "reference", more.get("reference", 0.0))
    t.d.mimics[follower.get("name")] = (leader.get("name"), multiplier, offset - multiplier * more.get("reference", 0.0))
    t.d.judged = ""


@feature("urdf sdf")
def mimic_any_ratio(t):
    a, b = t.two_of_a_kind(); mimic(t, b, a, t.signed(2), t.signed())


@feature("urdf sdf")
def mimic_integer(t):
    a, b = t.two_of_a_kind(); mimic(t, b, a, t.rng.choice([-2, -1, 1, 2, 3]), t.signed())


@feature("urdf sdf")
def mimic_losses(t):
    a, b = t.two_of_a_kind(); mimic(t, b, a, t.rng.choice([-2, 0.7, 1.5]), t.signed())
    dynamics(t, b, damping=t.number(), friction=t.number()); dynamics(t, a, friction=t.number())


@feature("urdf sdf")
def mimic_kinds(t):
    a, b = t.two_of_a_kind(); b.set("type", "prismatic")
    if t.kind == "urdf":
        ET.SubElement(b, "limit", lower="-2", upper="2", effort="5", velocity="3")
    mimic(t, b, a, t.signed(2), t.signed())


@feature("urdf sdf")
def mimic_chain(t):
    a, b = t.two_of_a_kind()
    t.add_link("bx"); c = t.add_joint("jx", t.rng.choice(t.links[:-1]), "bx", "continuous" if t.kind == "urdf" else "revolute"); t.joints.append(c)
    mimic(t, b, a, t.signed(2), t.signed()); mimic(t, c, b, t.signed(2), t.signed())


@feature("urdf", "effort limit force")
def mimic_limits(t):
    a, b = t.two_of_a_kind(); a.set("type", "revolute"); b.set("type", "revolute")
    ET.SubElement(a, "limit", lower="-2", upper="2", effort="50", velocity="3"); ET.SubElement(b, "limit", lower="-1", upper="0.5", effort="5", velocity="1")
    mimic(t, b, a, -2, 0.1)
    t.d.limits["j1"] = {"position": [-0.2, 0.55], "rate": 0.5, "force": [-10.0, 10.0]}


@feature("sdf")
def mimic_reference(t):
    a, b = t.two_of_a_kind(); mimic(t, b, a, t.signed(2), t.signed(), reference=t.signed())


@feature("urdf", "fixed")
def mimic_of_fixed(t):
    a, b = t.two_of_a_kind(); a.set("type", "fixed"); a.remove(a.find("axis"))
    ET.SubElement(b, "mimic", joint=a.get("name"), multiplier="2", offset="0.3"); t.d.judged = ""
    t.d.mimics[b.get("name")] = (None, 0.0, 0.3)


@feature("urdf")
def quaternion(t):
    o = t.joint().find("origin"); del o.attrib["rpy"]
    import math
    v = [t.signed() for _ in range(4)]; n = math.sqrt(sum(x * x for x in v)); v = [x / n for x in v]
    x, y, z, w = v
    o.set("quat_xyzw", " ".join(map(str, v)))
    rpy = [math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(2 * (w * y - z * x)), math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))]
    text = ET.tostring(t.root, encoding="unicode")
    t.d.judged = text.replace(f'quat_xyzw="{o.get("quat_xyzw")}"', f'rpy="{rpy[0]} {rpy[1]} {rpy[2]}"')


@feature("urdf")
def floating(t):
    j = t.joints[0]; j.set("type", "floating"); j.remove(j.find("axis"))
    if j.find("limit") is not None:
        j.remove(j.find("limit"))


@feature("urdf", "planar")
def planar_joint(t):
    t.joint().set("type", "planar")


@feature("urdf")
def drake_ball(t):
    j = t.joint(); j.tag = "drake:joint"; j.set("type", "ball"); j.remove(j.find("axis"))
    if j.find("limit") is not None:
        j.remove(j.find("limit"))


@feature("urdf", "universal")
def drake_universal(t):
    j = t.joint(); j.tag = "drake:joint"; j.set("type", "universal"); j.remove(j.find("axis"))
    if j.find("limit") is not None:
        j.remove(j.find("limit"))


@feature("urdf", "screw")
def drake_screw(t):
    j = t.joint(); j.tag = "drake:joint"; j.set("type", "screw")
    ET.SubElement(j, "drake:screw_thread_pitch", value="0.1")
    if j.find("limit") is not None:
        j.remove(j.find("limit"))


@feature("urdf")
def rotor(t):
    j = t.joint(); n = ET.SubElement(t.top, "transmission", name="t1")
    ET.SubElement(n, "type").text = "transmission_interface/SimpleTransmission"
    ET.SubElement(n, "joint", name=j.get("name")); a = ET.SubElement(n, "actuator", name="m")
    ET.SubElement(a, "drake:rotor_inertia", value=str(t.number(0.001, 0.01))); ET.SubElement(a, "drake:gear_ratio", value=str(t.number(3, 9)))


@feature("sdf")
def rotor_sdf(t):
    j = t.joint()
    ET.SubElement(j, "drake:rotor_inertia").text = str(t.number(0.001, 0.01)); ET.SubElement(j, "drake:gear_ratio").text = str(t.number(3, 9))


@feature("urdf", "reduction")
def transmission_reduction(t):
    j = t.joint(); n = ET.SubElement(t.top, "transmission", name="t1")
    ET.SubElement(n, "type").text = "transmission_interface/SimpleTransmission"
    ET.SubElement(n, "joint", name=j.get("name")); a = ET.SubElement(n, "actuator", name="m"); ET.SubElement(a, "mechanicalReduction").text = "50"


@feature("urdf", "differential")
def transmission_differential(t):
    n = ET.SubElement(t.top, "transmission", name="t1")
    ET.SubElement(n, "type").text = "transmission_interface/DifferentialTransmission"
    for j in t.joints[:2]:
        ET.SubElement(n, "joint", name=j.get("name"))
    for k in (1, 2):
        ET.SubElement(ET.SubElement(n, "actuator", name=f"m{k}"), "mechanicalReduction").text = "1"


@feature("urdf", "Gravity")
def gazebo_gravity(t):
    g = ET.SubElement(t.top, "gazebo", reference="b1"); ET.SubElement(g, "turnGravityOff").text = "true"; t.d.limits["gravity"] = {"x": 1}


@feature("urdf", "springStiffness")
def gazebo_spring(t):
    g = ET.SubElement(t.top, "gazebo", reference="j1"); ET.SubElement(g, "springStiffness").text = "5"; t.d.limits["spring"] = {"x": 1}


@feature("urdf", "implicitSpringDamper dampingFactor")
def gazebo_damping(t):
    g = ET.SubElement(t.top, "gazebo", reference="b1"); ET.SubElement(g, "dampingFactor").text = "0.01"; t.d.limits["spring"] = {"x": 1}


@feature("urdf", "joint")
def gazebo_joint(t):
    g = ET.SubElement(t.top, "gazebo"); j = ET.SubElement(g, "joint", name="cut", type="revolute"); ET.SubElement(j, "parent").text = "b1"; t.d.limits["cut"] = {"x": 1}


@feature("urdf", "mujoco")
def mujoco_extension(t):
    m = ET.SubElement(t.top, "mujoco"); ET.SubElement(m, "compiler", boundmass="5"); t.d.limits["bound"] = {"x": 1}


@feature("urdf", "bushing")
def drake_bushing(t):
    ET.SubElement(t.top, "frame", name="fa", link="base", xyz="0 0 0", rpy="0 0 0"); ET.SubElement(t.top, "frame", name="fb", link=t.links[-1], xyz="0 0 0", rpy="0 0 0")
    n = ET.SubElement(t.top, "drake:linear_bushing_rpy")
    ET.SubElement(n, "drake:bushing_frameA", name="fa"); ET.SubElement(n, "drake:bushing_frameC", name="fb")
    for k in ("torque_stiffness", "torque_damping", "force_stiffness", "force_damping"):
        ET.SubElement(n, f"drake:bushing_{k}", value="0.1 0.2 0.3")


def planar_chain(t):
    """Replaces the tree by a planar chain of three links."""
    for e in list(t.top):
        if not (e.get("name") in ("base", "fix")):
            t.top.remove(e)
    t.links = ["base"]; t.joints = []
    places = [(0, 0, 0), (0.31, 0, 0.7), (0.52, 0, 0.9)]
    for k, (x, z, turn) in enumerate(places):
        parent = t.links[-1]
        t.add_link(f"b{k + 1}"); j = t.add_joint(f"j{k + 1}", parent, f"b{k + 1}", "continuous" if t.kind == "urdf" else "revolute")
        t.joints.append(j)
        if t.kind == "urdf":
            j.find("origin").attrib.update(xyz=f"{x} 0 {z}", rpy=f"0 {turn} 0"); j.find("axis").set("xyz", "0 1 0")
        else:
            link = t.top.findall("link")[-1]; p = link.find("pose"); p.set("relative_to", parent); p.text = f"{x} 0 {z} 0 {turn} 0"
            j.remove(j.find("pose")); j.find("axis/xyz").text = "0 1 0"


@feature("urdf")
def constraint_revolute(t):
    planar_chain(t)
    n = ET.SubElement(t.top, "constraint", name="cut", type="revolute")
    ET.SubElement(n, "parent", link="base"); ET.SubElement(n, "parent_origin", xyz="0.35 0 -0.75"); ET.SubElement(n, "parent_axis", xyz="0 1 0")
    ET.SubElement(n, "child", link="b3"); ET.SubElement(n, "child_origin", xyz="0.4 0 0"); ET.SubElement(n, "child_axis", xyz="0 1 0")
    t.d.closures = [(("base", [0.35, 0, -0.75]), ("b3", [0.4, 0, 0]))]; t.d.removed = 2
    t.d.judged = ""


@feature("urdf")
def constraint_ball_drake(t):
    planar_chain(t)
    n = ET.SubElement(t.top, "drake:ball_constraint")
    ET.SubElement(n, "drake:ball_constraint_body_A", name="base"); ET.SubElement(n, "drake:ball_constraint_body_B", name="b3")
    ET.SubElement(n, "drake:ball_constraint_p_AP", value="0.35 0 -0.75"); ET.SubElement(n, "drake:ball_constraint_p_BQ", value="0.4 0 0")
    t.d.closures = [(("base", [0.35, 0, -0.75]), ("b3", [0.4, 0, 0]))]; t.d.removed = 2
    t.d.judged = ""


@feature("urdf sdf", "distance tendon constraint")
def constraint_distance_drake(t):
    planar_chain(t)
    n = ET.SubElement(t.top, "drake:distance_constraint")
    ET.SubElement(n, "drake:distance_constraint_body_A", name="base"); t.d.removed = 1; t.d.judged = ""


@feature("urdf")
def closures_file(t):
    planar_chain(t)
    t.add_link("e1", False); t.add_link("e2", False)
    for name, parent, child, xyz in (("w1", "base", "e1", "0.35 0 -0.75"), ("w2", "b3", "e2", "0.4 0 0")):
        j = t.add_joint(name, parent, child, "fixed"); j.remove(j.find("axis")); j.find("origin").attrib.update(xyz=xyz, rpy="0 0 0")
    t.d.closures = [(("base", [0.35, 0, -0.75]), ("b3", [0.4, 0, 0]))]; t.d.removed = 2
    t.d.closures_file = "closed_loop: [[w1, w2]]\ntype: [3d]\nname_mot: [j1]\n"


@feature("urdf")
def closures_file_indented(t):
    closures_file(t)
    t.d.closures_file = "closed_loop:\n  - [w1, w2]\ntype:\n  - '3d'\nname_mot:\n  - j1\n"


@feature("urdf", "constraint_extra")
def closures_file_unknown_key(t):
    closures_file(t); t.d.closures_file += "constraint_extra: [a]\n"; t.d.limits["extra"] = {"x": 1}


@feature("urdf")
def closures_file_6d(t):
    planar_chain(t)
    t.add_link("b4"); j = t.add_joint("j4", "b3", "b4", "continuous"); t.joints.append(j)
    j.find("origin").attrib.update(xyz="0.4 0 0", rpy="0 0 0"); j.find("axis").set("xyz", "0 1 0")
    # Joints with losses are not cut, so that the judge knows their angles.
    for one in t.joints[1:]:
        dynamics(t, one, damping=0.2)
    t.add_link("e1", False); t.add_link("e2", False)
    for name, parent, child, xyz, rpy in (("w1", "base", "e1", "0.35 0 -0.75", "0 0.4 0"), ("w2", "b4", "e2", "0.1 0 0.05", "0 0 0")):
        j = t.add_joint(name, parent, child, "fixed"); j.remove(j.find("axis")); j.find("origin").attrib.update(xyz=xyz, rpy=rpy)
    t.d.closures = [(("base", [0.35, 0, -0.75]), ("b4", [0.1, 0, 0.05]))]; t.d.removed = 3
    t.d.closures_file = "closed_loop: [[w1, w2]]\ntype: [6d]\nname_mot: [j1]\n"


def replaced(t, kind, of_drake):
    """A joint of the URDF is a hinge, and the file of closures gives its true kind."""
    j = t.joint(); j.set("type", "continuous"); name = j.get("name")
    if j.find("limit") is not None:
        j.remove(j.find("limit"))
    t.d.closures_file = f"joint_name: [{name}]\njoint_type: [{kind}]\n"
    other = ET.fromstring(ET.tostring(t.root))
    for one in other.findall("joint"):
        if one.get("name") == name:
            one.remove(one.find("axis")); one.set("type", of_drake)
            if of_drake != "fixed":
                one.tag = f"{{{DRAKE}}}joint"
    t.d.judged = ET.tostring(other, encoding="unicode")
    return j


@feature("urdf")
def closures_file_spherical(t):
    replaced(t, "SPHERICAL", "ball")


@feature("urdf")
def closures_file_universal(t):
    replaced(t, "UJOINT_XY", "universal")


@feature("urdf")
def closures_file_fixed(t):
    replaced(t, "FIXED", "fixed")


@feature("urdf")
def closures_file_drives(t):
    t.d.closures_file = f"name_mot: [{t.joint().get('name')}]\n"


@feature("urdf", "limit")
def closures_file_limits(t):
    j = replaced(t, "UJOINT_XY", "universal"); ET.SubElement(j, "limit", lower="-1", upper="1", effort="5", velocity="3"); j.set("type", "revolute")
    t.d.limits["x"] = {"x": 1}


@feature("urdf", "damping")
def closures_file_losses(t):
    j = replaced(t, "SPHERICAL", "ball"); dynamics(t, j, damping=0.3)


@feature("urdf sdf")
def awkward_names(t):
    names = ["t", "g", "pi", "sin", "left arm", "a-b", "M_b1", "world_joint", "rate", "exp"]
    for j, name in zip(t.joints, t.rng.sample(names, len(t.joints))):
        j.set("name", name)
    t.d.words = ["never"]


@feature("sdf")
def pose_relative(t):
    links = t.top.findall("link")
    links[-1].find("pose").set("relative_to", t.links[-2])


@feature("sdf")
def pose_relative_to_joint(t):
    last = t.top.findall("link")[-1]; j = t.joints[-1]
    last.find("pose").set("relative_to", j.get("name")); j.find("pose").set("relative_to", t.links[1] if len(t.links) > 2 else "base")


@feature("sdf")
def frame_element(t):
    f = ET.SubElement(t.top, "frame", name="f1", attached_to=t.links[1]); ET.SubElement(f, "pose").text = t.vec(6)
    g = ET.SubElement(t.top, "frame", name="f2", attached_to="f1"); ET.SubElement(g, "pose", relative_to="base").text = t.vec(6)
    t.top.findall("link")[-1].find("pose").set("relative_to", "f2")
    t.joints[-1].find("axis/xyz").set("expressed_in", "f1")


@feature("sdf")
def frame_as_parent(t):
    f = ET.SubElement(t.top, "frame", name="f1", attached_to="base"); ET.SubElement(f, "pose").text = t.vec(6)
    t.joints[0].find("parent").text = "f1"


@feature("sdf")
def frame_as_child(t):
    child = t.joints[0].find("child").text
    f = ET.SubElement(t.top, "frame", name="f1", attached_to=child); ET.SubElement(f, "pose").text = t.vec(6)
    t.joints[0].find("child").text = "f1"


@feature("sdf")
def pose_degrees(t):
    p = t.top.findall("link")[-1].find("pose"); p.text = t.vec(3) + " " + t.vec(3, 80); p.set("degrees", "true")


@feature("sdf")
def pose_quaternion(t):
    p = t.top.findall("link")[-1].find("pose"); p.text = t.vec(3) + " 0.5 -0.5 0.5 0.5"; p.set("rotation_format", "quat_xyzw")


@feature("sdf")
def pose_inertial_degrees(t):
    p = t.link().find("inertial/pose"); p.text = t.vec(3) + " " + t.vec(3, 80); p.set("degrees", "true")


@feature("sdf")
def axis_expressed_in(t):
    t.joint().find("axis/xyz").set("expressed_in", t.rng.choice(["__model__", "base", t.links[-1]]))


@feature("sdf")
def axis_left_out(t):
    j = t.joint(); j.find("axis").remove(j.find("axis/xyz"))


@feature("sdf")
def old_version(t):
    t.root.set("version", t.rng.choice(["1.4", "1.5", "1.6"]))


@feature("sdf")
def use_parent_model_frame(t):
    t.root.set("version", "1.5"); t.sub(t.joint(), "axis/use_parent_model_frame", 1)


@feature("sdf")
def universal(t):
    j = t.joint(); j.set("type", "universal"); j.find("axis/xyz").text = "1 0 0"; t.sub(j, "axis2/xyz", "0 1 0")


@feature("sdf")
def universal_losses(t):
    j = t.joint(); j.set("type", "universal"); j.find("axis/xyz").text = "1 0 0"; t.sub(j, "axis2/xyz", "0 1 0")
    t.sub(j, "axis/dynamics/damping", 0.4); t.sub(j, "axis2/dynamics/damping", 0.4)


@feature("sdf")
def ball(t):
    j = t.joint(); j.set("type", "ball"); j.remove(j.find("axis"))


@feature("sdf", "damping axis")
def ball_losses(t):
    j = t.joint(); j.set("type", "ball"); t.sub(j, "axis/dynamics/damping", 0.4)


@feature("sdf", "limits")
def ball_limits(t):
    j = t.joint(); j.set("type", "ball"); t.sub(j, "axis/limit/velocity", 3)
    t.d.limits["x"] = {"x": 1}


@feature("sdf")
def screw(t):
    j = t.joint(); j.set("type", "screw"); t.sub(j, "screw_thread_pitch", t.number(0.05, 0.2))


@feature("sdf", "thread_pitch")
def screw_old(t):
    j = t.joint(); j.set("type", "screw"); t.sub(j, "thread_pitch", t.number(5, 20))


@feature("sdf")
def screw_losses(t):
    j = t.joint(); j.set("type", "screw"); t.sub(j, "screw_thread_pitch", 0.1); dynamics(t, j, damping=t.number(), friction=t.number())


@feature("sdf")
def inertial_left_out(t):
    l = t.link(); l.remove(l.find("inertial"))


@feature("sdf")
def mass_left_out(t):
    l = t.link(); l.find("inertial").remove(l.find("inertial/mass"))


@feature("sdf")
def inertia_left_out(t):
    l = t.link(); i = l.find("inertial"); i.remove(i.find("inertia"))


@feature("sdf", "density")
def inertial_auto(t):
    t.link().find("inertial").set("auto", "true")


@feature("sdf", "added")
def fluid_added_mass(t):
    f = ET.SubElement(t.link().find("inertial"), "fluid_added_mass"); ET.SubElement(f, "xx").text = "1"; t.d.limits["x"] = {"x": 1}


@feature("sdf", "gravity")
def link_gravity(t):
    t.sub(t.link(), "gravity", "false"); t.d.limits["x"] = {"x": 1}


@feature("sdf", "velocity_decay")
def velocity_decay(t):
    t.sub(t.link(), "velocity_decay/linear", 0.1); t.d.limits["x"] = {"x": 1}


@feature("sdf", "kinematic")
def kinematic(t):
    t.sub(t.link(), "kinematic", "true"); t.d.limits["x"] = {"x": 1}


@feature("sdf", "wind")
def wind(t):
    t.sub(t.link(), "enable_wind", "true"); t.d.limits["x"] = {"x": 1}


@feature("sdf")
def in_world(t):
    w = ET.SubElement(t.root, "world", name="w"); t.root.remove(t.top); w.append(t.top)
    ET.SubElement(w, "gravity").text = t.vec(3, 9)


@feature("sdf", "joint")
def joint_of_world(t):
    w = ET.SubElement(t.root, "world", name="w"); t.root.remove(t.top); w.append(t.top)
    fix = t.top.find("joint"); t.top.remove(fix)
    j = ET.SubElement(w, "joint", name="fix", type="fixed"); ET.SubElement(j, "parent").text = "world"; ET.SubElement(j, "child").text = "r::base"


@feature("sdf")
def model_pose(t):
    p = ET.Element("pose"); p.text = t.vec(6); t.top.insert(0, p)


@feature("sdf", "placement_frame")
def placement_frame(t):
    t.top.set("placement_frame", t.links[-1]); p = ET.Element("pose"); p.text = t.vec(6); t.top.insert(0, p)


@feature("sdf")
def canonical_link(t):
    t.top.set("canonical_link", t.links[-1])


@feature("sdf", "nested")
def nested_model(t):
    m = ET.SubElement(t.top, "model", name="inner"); ET.SubElement(m, "pose").text = t.vec(6)
    keep = t.top
    t.top = m; t.add_link("n1"); t.top = keep
    j = ET.SubElement(t.top, "joint", name="jn", type="revolute"); ET.SubElement(j, "parent").text = t.links[-2]; ET.SubElement(j, "child").text = "inner::n1"
    ET.SubElement(ET.SubElement(j, "axis"), "xyz").text = t.vec()
    t.links.pop()


@feature("sdf", "include")
def include(t):
    i = ET.SubElement(t.top, "include"); ET.SubElement(i, "uri").text = "model://x"; t.d.judged = ""


@feature("sdf", "static")
def static(t):
    e = ET.Element("static"); e.text = "true"; t.top.insert(0, e)


@feature("sdf", "plugin")
def plugin(t):
    p = ET.SubElement(t.top, "plugin", name="p", filename="libspring.so"); ET.SubElement(p, "k").text = "4"; t.d.limits["x"] = {"x": 1}


@feature("sdf", "physics")
def joint_physics(t):
    t.sub(t.joint(), "physics/ode/cfm_damping", "true")


@feature("sdf", "physics")
def joint_physics_spring(t):
    t.sub(t.joint(), "physics/ode/implicit_spring_damper", "true")


@feature("sdf")
def loop_of_joints(t):
    planar_chain(t)
    f = ET.SubElement(t.top, "frame", name="tip", attached_to="b3"); ET.SubElement(f, "pose").text = "0.4 0 0 0 0 0"
    j = ET.SubElement(t.top, "joint", name="cut", type="revolute"); ET.SubElement(j, "pose", relative_to="tip")
    ET.SubElement(j, "parent").text = "base"; ET.SubElement(j, "child").text = "b3"; ET.SubElement(ET.SubElement(j, "axis"), "xyz").text = "0 1 0"
    t.d.removed = 2
    t.d.judged = "loop"


@feature("sdf", "cut")
def loop_of_joints_losses(t):
    loop_of_joints(t); t.sub(t.top.findall("joint")[-1], "axis/dynamics/damping", 0.5)
    t.d.limits["x"] = {"x": 1}


@feature("sdf", "cut")
def loop_of_joints_limits(t):
    loop_of_joints(t); t.sub(t.top.findall("joint")[-1], "axis/limit/lower", -0.5); t.sub(t.top.findall("joint")[-1], "axis/limit/upper", 0.5)
    t.d.limits["x"] = {"x": 1}


@feature("sdf", "cut")
def loop_of_joints_rate(t):
    loop_of_joints(t); t.sub(t.top.findall("joint")[-1], f"axis/limit/{t.rng.choice(['velocity', 'effort'])}", 3)
    t.d.limits["x"] = {"x": 1}


@feature("sdf", "cut")
def loop_of_joints_rotor(t):
    loop_of_joints(t); ET.SubElement(t.top.findall("joint")[-1], "drake:rotor_inertia").text = "0.5"
    t.d.limits["x"] = {"x": 1}


@feature("sdf")
def constraint_weld_drake(t):
    planar_chain(t)
    t.add_link("b4"); link = t.top.findall("link")[-1]; p = link.find("pose"); p.set("relative_to", "b3"); p.text = "0.4 0 0 0 0 0"
    j = t.add_joint("j4", "b3", "b4", "revolute"); t.joints.append(j); j.remove(j.find("pose")); j.find("axis/xyz").text = "0 1 0"
    f = ET.SubElement(t.top, "frame", name="tip", attached_to="b4"); ET.SubElement(f, "pose").text = "0.1 0 0.05 0 0 0"
    g = ET.SubElement(t.top, "frame", name="ground", attached_to="base"); ET.SubElement(g, "pose").text = "0.4 0 -0.7 0 0.3 0"
    n = ET.SubElement(t.top, "drake:weld_constraint"); ET.SubElement(n, "drake:weld_constraint_body_A")
    n.clear(); ET.SubElement(n, "parent").text = "ground"; ET.SubElement(n, "child").text = "tip"
    t.d.closures = [(("base", [0.4, 0, -0.7]), ("b4", [0.1, 0, 0.05]))]; t.d.removed = 3; t.d.judged = ""


@feature("sdf")
def constraint_ball_drake_sdf(t):
    planar_chain(t)
    n = ET.SubElement(t.top, "drake:ball_constraint")
    for k, v in {"body_A": "base", "body_B": "b3", "p_AP": "0.35 0 -0.75", "p_BQ": "0.4 0 0"}.items():
        ET.SubElement(n, f"drake:ball_constraint_{k}").text = v
    t.d.closures = [(("base", [0.35, 0, -0.75]), ("b3", [0.4, 0, 0]))]; t.d.removed = 2; t.d.judged = ""


@feature("sdf")
def reversed_joint(t):
    """The child is nearer to the ground."""
    j = t.joints[0]; p, c = j.find("parent"), j.find("child")
    leaf = next(j for j in reversed(t.joints) if not any(o.find("parent").text == j.find("child").text for o in t.joints))
    p, c = leaf.find("parent"), leaf.find("child"); p.text, c.text = c.text, p.text


@feature("sdf")
def floating_model(t):
    t.top.remove(t.top.find("joint"))


@feature("sdf")
def world_as_frame(t):
    j = t.top.find("joint"); j.set("type", "revolute"); ET.SubElement(ET.SubElement(j, "axis"), "xyz").text = "0 1 0"


@feature("sdf", "gearbox")
def gearbox(t):
    pass


del FEATURES["sdf"]["gearbox"]


def describe(kind, name, seed):
    t = Tree(kind, seed)
    function, words = FEATURES[kind][name]
    t.d.words = words
    function(t)
    ET.indent(t.root)
    t.d.text = ET.tostring(t.root, encoding="unicode")
    if t.d.judged == "":
        # The judge reads the tree without the elements that it would make constraints of.
        other = ET.fromstring(t.d.text)
        for parent in list(other.iter()):
            for e in list(parent):
                if e.tag.split("}")[-1] in ("mimic", "constraint", "ball_constraint", "weld_constraint", "distance_constraint", "include"):
                    parent.remove(e)
        t.d.judged = ET.tostring(other, encoding="unicode")
    elif t.d.judged == "loop":
        other = ET.fromstring(t.d.text)
        for parent in list(other.iter()):
            for e in list(parent):
                if e.tag == "joint" and e.get("name") == "cut":
                    parent.remove(e)
        t.d.judged = ET.tostring(other, encoding="unicode")
        t.d.closures = [(("base", None), ("b3", [0.4, 0, 0]))]
    return t.d
