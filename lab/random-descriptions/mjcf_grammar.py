"""Random MJCF descriptions: a small random tree with one feature of the format.

`describe(seed)` gives the name of the feature, the text, and the words of which a remark must contain one if the import leaves the
feature out.
"""

import math
import xml.etree.ElementTree as ET

from drawn_numbers import DrawnNumbers


class Tree(DrawnNumbers):
    """A random tree of two to four bodies with one joint each, as an element tree."""

    def __init__(self, seed):
        super().__init__(seed)
        self.root = ET.Element("mujoco", model="m")
        self.compiler = ET.SubElement(self.root, "compiler", angle="radian")
        self.world = ET.SubElement(self.root, "worldbody")
        self.bodies, self.joints = [], []
        for k in range(self.rng.randint(2, 4)):
            parent = self.world if not self.bodies else self.rng.choice(self.bodies)
            self.add_body(parent, f"b{k + 1}")

    def inertial(self, body):
        a, b = self.number(0.05, 0.2), self.number(0.05, 0.2)
        return ET.SubElement(body, "inertial", pos=self.vec(), mass=str(self.number(0.5, 3)),
                             diaginertia=f"{a} {b} {round((a + b) * 0.8, 4)}")

    def add_body(self, parent, name, kind=None):
        body = ET.SubElement(parent, "body", name=name, pos=self.vec())
        if self.rng.random() < 0.6:
            body.set("quat", self.vec(4, 1.0))
        kind = kind or self.rng.choice(["hinge", "hinge", "slide"])
        joint = ET.SubElement(body, "joint", name=f"j{name[1:]}", type=kind, axis=self.vec())
        self.inertial(body)
        self.bodies.append(body)
        self.joints.append(joint)
        return body

    def section(self, tag, **attributes):
        found = self.root.find(tag)
        if found is None:
            found = ET.SubElement(self.root, tag)
            self.root.remove(found)
            self.root.insert(1, found)
        for key, value in attributes.items():
            found.set(key, value)
        return found

    def joint(self):
        return self.rng.choice(self.joints)

    def body(self):
        return self.rng.choice(self.bodies)


FEATURES = {}


def feature(words=""):
    def add(function):
        FEATURES[function.__name__] = (function, words.split())
        return function
    return add


def simple_joint(name, key, low=0.1, high=2.0, words=""):
    def apply(t):
        t.joint().set(key, str(t.number(low, high)))
    FEATURES[name] = (apply, words.split())


for key in ["damping", "frictionloss", "armature"]:
    simple_joint(f"joint_{key}", key)


@feature()
def spring(t):
    j = t.joint(); j.set("stiffness", str(t.number(1, 9))); j.set("springref", str(t.signed()))


@feature()
def ref(t):
    t.joint().set("ref", str(t.signed()))


@feature()
def ref_and_spring(t):
    j = t.joint(); j.set("ref", str(t.signed())); j.set("stiffness", str(t.number(1, 9))); j.set("springref", str(t.signed()))


@feature()
def ref_in_degrees(t):
    del t.compiler.attrib["angle"]
    j = t.joint(); j.set("ref", str(t.signed(40))); j.set("stiffness", "2"); j.set("springref", str(t.signed(30)))


@feature("springdamper")
def springdamper(t):
    t.joint().set("springdamper", f"{t.number(0.1, 1)} {t.number(0.1, 1)}")


@feature("damping")
def damping_polynomial(t):
    t.joint().set("damping", f"{t.number()} {t.number()} {t.number()}")


@feature("stiffness")
def stiffness_polynomial(t):
    t.joint().set("stiffness", f"{t.number(1, 3)} {t.number()} {t.number()}")


@feature("springyield")
def springyield(t):
    j = t.joint(); j.set("stiffness", "3"); j.set("springyield", str(t.number(0.05, 0.1)))


@feature()
def joint_range(t):
    t.joint().set("range", f"{-t.number()} {t.number()}")


@feature()
def joint_not_limited(t):
    j = t.joint(); j.set("range", f"{-t.number()} {t.number()}"); j.set("limited", "false")


@feature()
def no_autolimits(t):
    t.compiler.set("autolimits", "false")
    j = t.joint(); j.set("range", f"{-t.number()} {t.number()}"); j.set("limited", "true")


@feature()
def force_range(t):
    t.joint().set("actuatorfrcrange", f"{-t.number(5, 9)} {t.number(5, 9)}")


@feature()
def joint_pos(t):
    t.joint().set("pos", t.vec())


def orient(t, element):
    kind = t.rng.choice(["quat", "axisangle", "euler", "xyaxes", "zaxis"])
    element.attrib.pop("quat", None)
    element.set(kind, {"quat": t.vec(4), "axisangle": t.vec(4), "euler": t.vec(3), "xyaxes": t.vec(6), "zaxis": t.vec(3)}[kind])


@feature()
def orientation_body(t):
    orient(t, t.body())


@feature()
def orientation_inertial(t):
    orient(t, t.body().find("inertial"))


@feature()
def zaxis_opposite(t):
    b = t.body(); b.attrib.pop("quat", None); b.set("zaxis", "0 0 -1")


@feature()
def eulerseq(t):
    s = t.rng.choice(["xyz", "zyx", "XYZ", "ZXZ", "yzy", "xYz"])
    t.compiler.set("eulerseq", s)
    b = t.body(); b.attrib.pop("quat", None); b.set("euler", t.vec())


@feature()
def degrees(t):
    del t.compiler.attrib["angle"]
    b = t.body(); b.attrib.pop("quat", None); b.set("euler", t.vec(3, 80))
    t.joint().set("range", f"{-t.number(10, 90)} {t.number(10, 90)}")


@feature()
def fullinertia(t):
    i = t.body().find("inertial"); del i.attrib["diaginertia"]
    i.set("fullinertia", f"0.2 0.25 0.3 {t.signed(0.03) / 4} {t.signed(0.03) / 4} {t.signed(0.03) / 4}")


@feature()
def default_joint(t):
    d = t.section("default"); ET.SubElement(d, "joint", damping=str(t.number()), armature=str(t.number()))


@feature()
def default_axis(t):
    d = t.section("default"); ET.SubElement(d, "joint", axis=t.vec(), type="slide", pos=t.vec())
    j = t.joint(); del j.attrib["axis"]; del j.attrib["type"]


@feature()
def default_nested(t):
    d = t.section("default"); ET.SubElement(d, "joint", damping=str(t.number()))
    a = ET.SubElement(d, "default", {"class": "a"}); ET.SubElement(a, "joint", armature=str(t.number()))
    b = ET.SubElement(a, "default", {"class": "c"}); ET.SubElement(b, "joint", damping=str(t.number()), frictionloss="0.3")
    t.joint().set("class", "c"); t.body().set("childclass", "a")


@feature()
def default_childclass_nested(t):
    d = t.section("default"); ET.SubElement(d, "joint", damping=str(t.number()))
    a = ET.SubElement(d, "default", {"class": "a"}); ET.SubElement(a, "joint", armature=str(t.number()))
    b = ET.SubElement(d, "default", {"class": "c"}); ET.SubElement(b, "joint", stiffness=str(t.number()))
    t.bodies[0].set("childclass", "a"); t.bodies[-1].set("childclass", "c")


@feature()
def default_sections_two(t):
    d = t.section("default"); ET.SubElement(d, "joint", damping=str(t.number()))
    e = ET.SubElement(t.root, "default"); t.root.remove(e); t.root.insert(2, e)
    ET.SubElement(e, "joint", armature=str(t.number()))


@feature()
def default_sections_nested(t):
    d = t.section("default"); ET.SubElement(d, "joint", damping=str(t.number()))
    e = ET.SubElement(t.root, "default"); t.root.remove(e); t.root.insert(2, e)
    a = ET.SubElement(e, "default", {"class": "a"}); ET.SubElement(a, "joint", armature=str(t.number()))
    t.joint().set("class", "a")


@feature()
def default_class_main(t):
    d = t.section("default"); ET.SubElement(d, "joint", damping=str(t.number()))
    a = ET.SubElement(d, "default", {"class": "a"}); ET.SubElement(a, "joint", damping=str(t.number()))
    t.bodies[0].set("childclass", "a"); t.joint().set("class", "main")


@feature()
def frame(t):
    b = t.bodies[-1]; parent = t.world if b in list(t.world) else next(p for p in t.bodies if b in list(p))
    parent.remove(b)
    f = ET.SubElement(parent, "frame", pos=t.vec()); orient(t, f); f.append(b)


@feature()
def frame_of_joint(t):
    b = t.body(); j = b.find("joint"); b.remove(j)
    f = ET.Element("frame", pos=t.vec()); orient(t, f); f.append(j); j.set("pos", t.vec()); b.insert(0, f)


@feature()
def frame_of_geom(t):
    b = t.body(); b.remove(b.find("inertial"))
    f = ET.SubElement(b, "frame", pos=t.vec()); orient(t, f)
    g = ET.SubElement(f, "frame", pos=t.vec()); orient(t, g)
    ET.SubElement(g, "geom", type="box", size="0.1 0.2 0.05", pos=t.vec())


@feature()
def frame_childclass(t):
    d = t.section("default"); a = ET.SubElement(d, "default", {"class": "a"}); ET.SubElement(a, "joint", damping="0.7")
    frame(t); t.root.iter("frame").__next__().set("childclass", "a")


@feature()
def frame_inertial(t):
    b = t.body(); i = b.find("inertial"); b.remove(i)
    f = ET.SubElement(b, "frame", pos=t.vec()); orient(t, f); f.append(i)


@feature()
def two_joints(t):
    b = t.body(); k = list(b).index(b.find("joint"))
    b.insert(k + 1, ET.Element("joint", name="extra", type=t.rng.choice(["hinge", "slide"]), axis=t.vec(), pos=t.vec()))


@feature("ball")
def ball(t):
    j = t.joint(); j.set("type", "ball"); j.set("pos", t.vec())


@feature("ball")
def ball_losses(t):
    j = t.joint(); j.set("type", "ball"); j.set(t.rng.choice(["damping", "frictionloss", "armature", "stiffness"]), "0.4")


@feature("range")
def ball_range(t):
    j = t.joint(); j.set("type", "ball"); j.set("range", "0 0.8")


@feature()
def freejoint(t):
    b = t.bodies[0]; b.remove(b.find("joint")); b.insert(0, ET.Element("freejoint", name="float"))


@feature("free")
def free_joint_losses(t):
    j = t.joints[0]; j.set("type", "free"); del j.attrib["axis"]
    j.set(t.rng.choice(["damping", "frictionloss", "armature", "stiffness"]), "0.4")


@feature("free")
def free_joint_default_losses(t):
    j = t.joints[0]; j.set("type", "free"); del j.attrib["axis"]
    d = t.section("default"); ET.SubElement(d, "joint", **{t.rng.choice(["damping", "armature"]): "0.4"})


@feature("free")
def align_free(t):
    freejoint(t); t.compiler.set("alignfree", "true")


@feature()
def geom(t):
    b = t.body(); b.remove(b.find("inertial"))
    for _ in range(t.rng.randint(1, 3)):
        kind = t.rng.choice(["sphere", "box", "capsule", "cylinder", "ellipsoid"])
        g = ET.SubElement(b, "geom", type=kind, size="0.1 0.15 0.07", pos=t.vec())
        orient(t, g)
        if t.rng.random() < 0.5:
            g.set(t.rng.choice(["mass", "density"]), str(t.number(1, 3)))


@feature()
def geom_fromto(t):
    b = t.body(); b.remove(b.find("inertial"))
    kind = t.rng.choice(["box", "capsule", "cylinder", "ellipsoid"])
    ET.SubElement(b, "geom", type=kind, size="0.1", fromto=t.vec(6))


@feature()
def geom_shell(t):
    b = t.body(); b.remove(b.find("inertial"))
    ET.SubElement(b, "geom", type=t.rng.choice(["sphere", "box", "capsule"]), size="0.1 0.2 0.1", shellinertia="true")


@feature()
def geom_default(t):
    b = t.body(); b.remove(b.find("inertial"))
    d = t.section("default"); ET.SubElement(d, "geom", type="capsule", size="0.05 0.2", density="500", pos=t.vec())
    ET.SubElement(b, "geom")


@feature()
def geom_adhesion(t):
    b = t.body(); ET.SubElement(b, "geom", type="sphere", size="0.1", adhesion="1")


@feature()
def inertia_from_geom(t):
    t.compiler.set("inertiafromgeom", "true")
    for b in t.bodies:
        ET.SubElement(b, "geom", type="box", size="0.1 0.2 0.05", pos=t.vec())


@feature()
def inertia_group_range(t):
    t.compiler.set("inertiafromgeom", "true"); t.compiler.set("inertiagrouprange", "1 2")
    for b in t.bodies:
        for g in range(4):
            ET.SubElement(b, "geom", type="box", size="0.1 0.2 0.05", pos=t.vec(), group=str(g))


@feature()
def total_mass(t):
    t.compiler.set("settotalmass", "7")


@feature()
def bound_mass(t):
    t.compiler.set("boundmass", "2"); t.compiler.set("boundinertia", "0.15")


@feature()
def balance_inertia(t):
    t.compiler.set("balanceinertia", "true"); t.body().find("inertial").set("diaginertia", "0.1 0.1 0.5")


@feature("gravcomp")
def gravcomp(t):
    t.body().set("gravcomp", str(t.number()))


@feature("mocap")
def mocap(t):
    b = t.bodies[0]; b.remove(b.find("joint")); b.set("mocap", "true")


@feature()
def gravity(t):
    t.section("option", gravity=t.vec(3, 9))


@feature("gravity")
def flag_gravity(t):
    ET.SubElement(t.section("option"), "flag", gravity="disable")


@feature("spring")
def flag_spring(t):
    ET.SubElement(t.section("option"), "flag", spring="disable"); t.joint().set("stiffness", "3")


@feature("damper")
def flag_damper(t):
    ET.SubElement(t.section("option"), "flag", damper="disable"); t.joint().set("damping", "3")


@feature("density viscosity")
def fluid(t):
    t.section("option", **{t.rng.choice(["density", "viscosity"]): "1.2"})


@feature("density viscosity fluidshape")
def fluid_shape(t):
    t.section("option", density="1.2"); ET.SubElement(t.body(), "geom", type="ellipsoid", size="0.1 0.2 0.3", fluidshape="ellipsoid")


def two_hinges(t):
    """Two joints of the same kind."""
    a, b = t.joints[0], t.joints[1]
    a.set("type", "hinge"); b.set("type", "hinge")
    return a, b


@feature()
def equality_joint(t):
    a, b = two_hinges(t)
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"), polycoef=f"{t.signed()} {t.signed(2)} 0 0 0")


@feature()
def equality_joint_ref(t):
    a, b = two_hinges(t); a.set("ref", str(t.signed())); b.set("ref", str(t.signed()))
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"), polycoef=f"{t.signed()} {t.signed(2)} 0 0 0")


@feature()
def equality_joint_losses(t):
    a, b = two_hinges(t)
    b.set("damping", "0.3"); b.set("armature", "0.2"); b.set("stiffness", "3"); b.set("springref", "0.2"); b.set("frictionloss", "0.4")
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"), polycoef=f"{t.signed()} {t.signed(2)} 0 0 0")


@feature()
def equality_joint_mixed(t):
    a, b = t.joints[0], t.joints[1]; a.set("type", "hinge"); b.set("type", "slide")
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"), polycoef=f"{t.signed()} {t.signed(2)} 0 0 0")


@feature()
def equality_joint_polynomial(t):
    a, b = two_hinges(t)
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"), polycoef="0 1 0.5 0 0")


@feature()
def equality_joint_fixed(t):
    ET.SubElement(t.section("equality"), "joint", joint1=t.joint().get("name"), polycoef=f"{t.signed()} 1 0 0 0")


@feature()
def equality_joint_defaults(t):
    a, b = two_hinges(t)
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"))


@feature("active")
def equality_inactive(t):
    a, b = two_hinges(t)
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"), active="false")


@feature("active")
def equality_inactive_by_default(t):
    a, b = two_hinges(t)
    ET.SubElement(t.section("default"), "equality", active="false")
    ET.SubElement(t.section("equality"), "joint", joint1=b.get("name"), joint2=a.get("name"))


@feature("active")
def equality_inactive_by_class(t):
    a, b = two_hinges(t)
    c = ET.SubElement(t.section("default"), "default", {"class": "off"}); ET.SubElement(c, "equality", active="false")
    ET.SubElement(t.section("equality"), "joint", {"class": "off"}, joint1=b.get("name"), joint2=a.get("name"))


@feature("equality")
def flag_equality(t):
    equality_joint(t)
    ET.SubElement(t.section("option"), "flag", equality="disable")


def planar(t):
    """Replaces the tree by a planar chain of four links that a closure of the last link closes."""
    for b in list(t.world):
        t.world.remove(b)
    t.bodies, t.joints = [], []
    parent = t.world
    for k, x in enumerate([0.0, 0.31, 0.83]):
        b = ET.SubElement(parent, "body", name=f"b{k + 1}", pos=f"{[0, 0.31, 0.52][k]} 0 0")
        t.joints.append(ET.SubElement(b, "joint", name=f"j{k + 1}", axis="0 1 0")); t.inertial(b); t.bodies.append(b); parent = b
    t.bodies[1].set("euler", "0 0.7 0"); t.bodies[2].set("euler", "0 0.9 0")


@feature()
def equality_connect(t):
    planar(t)
    ET.SubElement(t.section("equality"), "connect", body1="b3", anchor="0.4 0 0")


@feature()
def equality_connect_other_way(t):
    planar(t)
    ET.SubElement(t.section("equality"), "connect", body1="world", body2="b3", anchor="0.5 0 -0.8")


@feature()
def equality_connect_sites(t):
    planar(t)
    ET.SubElement(t.world, "site", name="s1", pos="0.35 0 -0.75"); ET.SubElement(t.bodies[2], "site", name="s2", pos="0.4 0 0")
    ET.SubElement(t.section("equality"), "connect", site1="s1", site2="s2")


@feature()
def equality_weld(t):
    planar(t)
    b = ET.SubElement(t.bodies[2], "body", name="b4", pos="0.4 0 0"); ET.SubElement(b, "joint", name="j4", axis="0 1 0"); t.inertial(b)
    ET.SubElement(t.section("equality"), "weld", body1="b4")


@feature()
def equality_weld_relpose(t):
    planar(t)
    b = ET.SubElement(t.bodies[2], "body", name="b4", pos="0.4 0 0"); ET.SubElement(b, "joint", name="j4", axis="0 1 0"); t.inertial(b)
    ET.SubElement(t.section("equality"), "weld", body1="b4", body2="b1", anchor="0.1 0 0.05", relpose="-0.35 0 -0.2 1 0 0.2 0")


@feature()
def equality_tendon(t):
    a, b = two_hinges(t)
    f = ET.SubElement(t.section("tendon"), "fixed", name="tt")
    for j in (a, b):
        ET.SubElement(f, "joint", joint=j.get("name"), coef=str(t.signed(2)))
    ET.SubElement(t.section("equality"), "tendon", tendon1="tt")


@feature()
def equality_two_tendons(t):
    a, b = two_hinges(t)
    for name, j in (("ta", a), ("tb", b)):
        f = ET.SubElement(t.section("tendon"), "fixed", name=name); ET.SubElement(f, "joint", joint=j.get("name"), coef=str(t.signed(2)))
    ET.SubElement(t.section("equality"), "tendon", tendon1="ta", tendon2="tb", polycoef=f"{t.signed()} {t.signed()} 0 0 0")


def fixed_tendon(t, key, value):
    a, b = t.joints[0], t.joints[1]
    f = ET.SubElement(t.section("tendon"), "fixed", {"name": "tt", key: value})
    for j in (a, b):
        ET.SubElement(f, "joint", joint=j.get("name"), coef=str(t.signed(2)))
    return f


for _key, _value in [("damping", "0.4"), ("stiffness", "3"), ("frictionloss", "0.3"), ("armature", "0.2"), ("range", "-1 1"),
                     ("actuatorfrcrange", "-3 3")]:
    FEATURES[f"fixed_tendon_{_key}"] = ((lambda t, k=_key, v=_value: fixed_tendon(t, k, v)), ["tendon", _key])


@feature("tendon")
def fixed_tendon_default(t):
    fixed_tendon(t, "margin", "0.01")
    ET.SubElement(t.section("default"), "tendon", **{t.rng.choice(["damping", "stiffness", "frictionloss", "armature"]): "0.4"})


@feature("tendon")
def fixed_tendon_class(t):
    c = ET.SubElement(t.section("default"), "default", {"class": "tc"})
    ET.SubElement(c, "tendon", **{t.rng.choice(["damping", "stiffness", "frictionloss", "armature"]): "0.4"})
    fixed_tendon(t, "class", "tc")


@feature("tendon")
def fixed_tendon_range_by_default(t):
    fixed_tendon(t, "margin", "0.01"); ET.SubElement(t.section("default"), "tendon", range="-1 1")


def spatial_tendon(t, **attributes):
    ET.SubElement(t.world, "site", name="s1", pos=t.vec(3, 2)); ET.SubElement(t.bodies[-1], "site", name="s2", pos=t.vec())
    f = ET.SubElement(t.section("tendon"), "spatial", name="tt", **attributes)
    ET.SubElement(f, "site", site="s1"); ET.SubElement(f, "site", site="s2")
    return f


for _key, _value in [("damping", "0.4"), ("stiffness", "3"), ("frictionloss", "0.3"), ("armature", "0.2"), ("range", "0 5")]:
    FEATURES[f"spatial_tendon_{_key}"] = ((lambda t, k=_key, v=_value: spatial_tendon(t, **{k: v})), ["tendon", _key])


@feature("tendon")
def spatial_tendon_default(t):
    spatial_tendon(t)
    ET.SubElement(t.section("default"), "tendon", **{t.rng.choice(["damping", "stiffness", "frictionloss", "armature"]): "0.4"})


def actuate(t, tag, joint=None, **attributes):
    """An actuator at one joint, and plain motors at the others."""
    # An element without children counts as false.
    chosen = t.joint() if joint is None else joint
    s = t.section("actuator")
    for j in t.joints:
        if j is chosen:
            ET.SubElement(s, tag, name=f"act_{j.get('name')}", joint=j.get("name"), **attributes)
        else:
            ET.SubElement(s, "motor", name=f"act_{j.get('name')}", joint=j.get("name"))


for _tag, _more in [("motor", {}), ("position", {"kp": "5", "kv": "0.5"}), ("velocity", {"kv": "2"}), ("intvelocity", {"kp": "3", "actrange": "-1 1"}),
                    ("general", {"gaintype": "fixed", "biastype": "affine", "gainprm": "3 0 0", "biasprm": "0 -3 -0.4"}),
                    ("damper", {"kv": "0.4", "ctrlrange": "0 1"}), ("cylinder", {"area": "0.2"}), ("pid", {"kp": "5"})]:
    def _apply(t, tag=_tag, more=_more):
        actuate(t, tag, **more)
    FEATURES[f"actuator_{_tag}"] = (_apply, ["actuator", "drive", "gear"])
    def _apply2(t, tag=_tag, more=_more):
        more = dict(more)
        if tag not in ("dcmotor",):
            more["gear"] = str(t.signed(5))
        more[t.rng.choice(["armature", "damping"])] = str(t.number())
        actuate(t, tag, **more)
    FEATURES[f"actuator_{_tag}_rotor"] = (_apply2, ["armature", "damping"])


@feature("dcmotor")
def actuator_dcmotor(t):
    actuate(t, "dcmotor", motorconst="0.05", resistance="1")


@feature("dcmotor cogging")
def actuator_dcmotor_cogging(t):
    actuate(t, "dcmotor", motorconst="0.05", resistance="1", cogging="0.1 8 0")


@feature("dcmotor lugre")
def actuator_dcmotor_lugre(t):
    actuate(t, "dcmotor", motorconst="0.05", resistance="1", armature="0.1")


@feature("muscle")
def actuator_muscle(t):
    actuate(t, "muscle", lengthrange="0.2 1")


@feature("actuator armature damping")
def actuator_general_default_for_motor(t):
    """All kinds of actuators share one set of defaults."""
    d = t.section("default"); ET.SubElement(d, "general", **{t.rng.choice(["armature", "damping"]): "0.3", "gear": "3"})
    actuate(t, t.rng.choice(["motor", "position", "velocity"]))


@feature("actuator armature damping")
def actuator_position_default_for_motor(t):
    d = t.section("default"); ET.SubElement(d, "position", kp="3", armature="0.3", gear="2")
    actuate(t, "motor")


@feature("actuator armature damping")
def actuator_class(t):
    d = t.section("default"); c = ET.SubElement(d, "default", {"class": "ac"}); ET.SubElement(c, "motor", armature="0.3", gear="2", damping="0.1")
    actuate(t, "motor", **{"class": "ac"})


@feature()
def actuator_force_range(t):
    actuate(t, "motor", forcerange="-3 4", gear=str(t.signed(4)))


@feature()
def actuator_control_range(t):
    actuate(t, "motor", ctrlrange="-3 4", gear=str(t.signed(4)))


@feature()
def actuator_and_joint_range(t):
    """Both limits apply, the wider one at the joint or at its actuator."""
    j = t.joint(); wide = t.rng.choice([1, 20]); j.set("actuatorfrcrange", f"{-wide} {wide}")
    actuate(t, "motor", joint=j, forcerange="-3 4", gear=str(t.signed(4)))


@feature()
def actuator_two_ranges_at_one(t):
    actuate(t, "motor", joint=t.joints[0], forcerange="-3 4")
    ET.SubElement(t.section("actuator"), "motor", name="second", joint=t.joints[0].get("name"), forcerange="-1 3", gear="-2")


@feature("actuator")
def actuator_without_force(t):
    j = t.joint(); j.set("actuatorfrcrange", "-1 1"); actuate(t, "motor", joint=j, forcerange="2 4")


@feature()
def actuator_some(t):
    s = t.section("actuator"); ET.SubElement(s, "motor", name="only", joint=t.joints[0].get("name"))


@feature("actuator")
def actuator_two_at_one(t):
    actuate(t, "motor", joint=t.joints[0], armature="0.2")
    ET.SubElement(t.section("actuator"), "motor", name="second", joint=t.joints[0].get("name"), armature="0.3", gear="2")


@feature("tendon")
def actuator_fixed_tendon(t):
    f = fixed_tendon(t, "margin", "0.01"); del f.attrib["margin"]
    ET.SubElement(t.section("actuator"), "motor", name="mt", tendon="tt", **{t.rng.choice(["armature", "damping"]): "0.3", "gear": "2"})


@feature("tendon")
def actuator_spatial_tendon(t):
    spatial_tendon(t, damping="0.2", armature="0.1", frictionloss="0.3")
    s = t.section("actuator")
    ET.SubElement(s, "motor", name="mt", tendon="tt", armature="0.3", gear="2")
    for j in t.joints[:-1]:
        ET.SubElement(s, "motor", name=f"act_{j.get('name')}", joint=j.get("name"))


@feature("tendon")
def actuator_fixed_tendon_range(t):
    fixed_tendon(t, "margin", "0.01")
    ET.SubElement(t.section("actuator"), "motor", name="mt", tendon="tt", forcerange="-3 4")


@feature()
def actuator_spatial_tendon_range(t):
    """Limits of the tendon and of its actuator, before the gear."""
    wide = t.rng.choice([1, 20]); spatial_tendon(t, actuatorfrcrange=f"{-wide} {wide}")
    s = t.section("actuator")
    ET.SubElement(s, "motor", name="mt", tendon="tt", gear=str(t.signed(4)), **t.rng.choice([{}, {"forcerange": "-3 4"}]))
    for j in t.joints[:-1]:
        ET.SubElement(s, "motor", name=f"act_{j.get('name')}", joint=j.get("name"))


@feature("tendon")
def actuator_two_at_spatial_tendon(t):
    spatial_tendon(t, actuatorfrcrange="-2 2")
    s = t.section("actuator")
    ET.SubElement(s, "motor", name="mt", tendon="tt"), ET.SubElement(s, "motor", name="other", tendon="tt", gear="2")
    for j in t.joints[:-1]:
        ET.SubElement(s, "motor", name=f"act_{j.get('name')}", joint=j.get("name"))


@feature("site")
def actuator_site(t):
    ET.SubElement(t.bodies[-1], "site", name="s2", pos=t.vec())
    actuate(t, "motor"); ET.SubElement(t.section("actuator"), "motor", name="thrust", site="s2", gear="1 0 0 0 0 0")


@feature("slider")
def actuator_slider_crank(t):
    ET.SubElement(t.bodies[-1], "site", name="s2", pos=t.vec()); ET.SubElement(t.world, "site", name="s3", pos=t.vec())
    ET.SubElement(t.section("actuator"), "motor", name="sc", cranksite="s2", slidersite="s3", cranklength="3")


@feature("body")
def actuator_adhesion(t):
    ET.SubElement(t.section("actuator"), "adhesion", name="sc", body="b1", ctrlrange="0 1", gain="2")


@feature()
def replicate(t):
    r = ET.SubElement(t.bodies[-1], "replicate", count="3", offset="0.1 0 0.2", euler="0.3 0 0")
    b = ET.SubElement(r, "body", name="r"); ET.SubElement(b, "joint", name="rj", axis="0 1 0"); t.inertial(b)


@feature()
def replicate_geom(t):
    b = t.body(); b.remove(b.find("inertial"))
    r = ET.SubElement(b, "replicate", count="3", offset="0.1 0 0.2", euler="0.3 0 0")
    ET.SubElement(r, "geom", type="box", size="0.1 0.2 0.05", pos="0.3 0 0")


@feature()
def unnamed(t):
    b = t.bodies[-1]; del b.attrib["name"]; del b.find("joint").attrib["name"]


@feature()
def awkward_names(t):
    for name, j in zip(t.rng.sample(["t", "g", "pi", "sin", "1a", "left/arm", "a-b", "J 1", "é", "M_b1", "base", "world"], len(t.joints)), t.joints):
        j.set("name", name)


@feature()
def body_without_joint(t):
    b = ET.SubElement(t.bodies[-1], "body", name="fixed", pos=t.vec()); orient(t, b); t.inertial(b)


@feature()
def joint_in_default_degrees(t):
    del t.compiler.attrib["angle"]
    ET.SubElement(t.section("default"), "joint", range="-40 50", stiffness="2", springref="20")


@feature()
def compiler_twice(t):
    c = ET.Element("compiler", angle="degree"); t.root.insert(1, c)
    b = t.body(); b.attrib.pop("quat", None); b.set("euler", t.vec(3, 80))


@feature()
def keyframe(t):
    ET.SubElement(ET.SubElement(t.root, "keyframe"), "key", qpos=" ".join(str(t.signed()) for _ in t.joints))


@feature()
def joint_margin(t):
    j = t.joint(); j.set("range", "-1 1"); j.set("margin", "0.1")


@feature("mesh")
def mesh_inertia(t):
    ET.SubElement(t.section("asset"), "mesh", name="m", vertex="0 0 0 1 0 0 0 1 0 0 0 1")
    b = t.body(); b.remove(b.find("inertial")); ET.SubElement(b, "geom", type="mesh", mesh="m")


@feature("surfacevel")
def belt(t):
    ET.SubElement(t.body(), "geom", type="box", size="0.1 0.1 0.1", surfacevel="1 0 0")


@feature()
def quat_not_normalized(t):
    b = t.body(); b.set("quat", "3 1 -2 0.5")


@feature()
def body_simple(t):
    t.bodies[0].set("sleep", "never")


def replicate(t, around, count, **more):
    """Moves the last body into a `<replicate>`."""
    copied = ET.SubElement(around, "replicate", count=str(count), offset=t.vec(), euler=t.vec(), **more)
    parent = {child: one for one in t.root.iter() for child in one}
    moved = t.bodies[-1]
    parent[moved].remove(moved)
    copied.append(moved)
    return copied


@feature()
def replicated_world(t):
    replicate(t, t.world, t.rng.randint(1, 3))


@feature()
def replicated_in_body(t):
    body = ET.SubElement(t.world, "body", name="stand", pos=t.vec()); orient(t, body); t.inertial(body)
    ET.SubElement(body, "joint", name="jstand", axis=t.vec())
    frame = ET.SubElement(body, "frame", pos=t.vec()); orient(t, frame)
    replicate(t, frame, 2, sep="_")


@feature()
def replicated_in_degrees(t):
    t.compiler.set("angle", "degree"); t.compiler.set("eulerseq", t.rng.choice(["zyx", "XYZ", "yzy"]))
    copied = replicate(t, t.world, 3); copied.set("euler", t.vec(3, 80))


@feature()
def replicated_twice(t):
    inner = replicate(t, t.world, 2, sep="a")
    t.world.remove(inner)
    ET.SubElement(t.world, "replicate", count="2", offset=t.vec(), euler=t.vec(), sep="b").append(inner)


@feature()
def replicated_coupling(t):
    b = ET.SubElement(t.bodies[-1], "body", name="tip", pos=t.vec()); t.inertial(b)
    ET.SubElement(b, "joint", name="jtip", type=t.joints[-1].get("type"), axis=t.vec())
    e = t.section("equality"); ET.SubElement(e, "joint", joint1="jtip", joint2=t.joints[-1].get("name"), polycoef="0.1 2 0 0 0")
    replicate(t, t.world, 2)


@feature()
def replicated_motor(t):
    a = t.section("actuator")
    ET.SubElement(a, "motor", name="m", joint=t.joints[-1].get("name"), gear="3", ctrlrange="-2 2", armature="0.2")
    replicate(t, t.world, 2)


@feature()
def replicated_shapes(t):
    b = t.body(); b.remove(b.find("inertial"))
    copied = ET.SubElement(b, "replicate", count="3", offset=t.vec(), euler=t.vec())
    ET.SubElement(copied, "geom", name="shape", type="box", size="0.1 0.2 0.3", pos=t.vec())


@feature()
def own_part_attached(t):
    ET.SubElement(t.section("default"), "joint", damping="0.3")
    frame = ET.SubElement(t.world, "frame", pos=t.vec()); orient(t, frame)
    ET.SubElement(frame, "attach", body=t.body().get("name"), prefix="x_")


@feature()
def own_part_with_motor_attached(t):
    ET.SubElement(t.section("actuator"), "motor", name="m", joint=t.joints[-1].get("name"), gear="3", armature="0.2")
    body = ET.SubElement(t.world, "body", name="stand", pos=t.vec()); orient(t, body); t.inertial(body)
    ET.SubElement(body, "joint", name="jstand", axis=t.vec())
    ET.SubElement(body, "attach", body=t.bodies[-1].get("name"), prefix="x_")


def describe(seed, name):
    tree = Tree(seed)
    function, words = FEATURES[name]
    function(tree)
    ET.indent(tree.root)
    return ET.tostring(tree.root, encoding="unicode"), words
