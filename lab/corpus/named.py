"""What the program says that it leaves out, and how the same is left out of MuJoCo."""

import mujoco
import numpy as np


def _without_gravcomp(mj):
    """Removes the compensation of gravity."""
    mj.body_gravcomp[:] = 0


def _without_fluid(mj):
    """Removes the surrounding fluid."""
    mj.opt.density = mj.opt.viscosity = 0
    mj.opt.wind[:] = 0


def _with_gravity(mj):
    """Enables gravity."""
    mj.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)


def _without_losses_of(mj, kind):
    """Removes damping, friction, armature and springs of ball joints or free joints."""
    for j in np.flatnonzero(mj.jnt_type == kind):
        mj.jnt_stiffness[j] = 0
        n = 3 if kind == mujoco.mjtJoint.mjJNT_BALL else 6
        dofs = slice(mj.jnt_dofadr[j], mj.jnt_dofadr[j] + n)
        for values in (mj.dof_damping, mj.dof_frictionloss, mj.dof_armature):
            values[dofs] = 0


def _without_ball_losses(mj):
    """Removes losses of ball joints."""
    _without_losses_of(mj, mujoco.mjtJoint.mjJNT_BALL)


def _without_free_losses(mj):
    """Removes losses of free joints."""
    _without_losses_of(mj, mujoco.mjtJoint.mjJNT_FREE)


def _without_tendon_forces(mj):
    """Removes springs, losses and inertia of tendons."""
    for values in (mj.tendon_stiffness, mj.tendon_damping, mj.tendon_frictionloss, mj.tendon_armature):
        values[:] = 0


def _without_mocap_equalities(mj):
    """Disables equalities with a mocap body."""
    site, body = (int(mujoco.mjtObj.mjOBJ_SITE), int(mujoco.mjtObj.mjOBJ_BODY))
    for e in range(mj.neq):
        ends = (mj.eq_obj1id[e], mj.eq_obj2id[e])
        if mj.eq_objtype[e] in (site, body):
            bodies = [mj.site_bodyid[end] if mj.eq_objtype[e] == site else end for end in ends]
            if any(mj.body_mocapid[one] >= 0 for one in bodies):
                mj.eq_active0[e] = 0


def _with_first_numbers(mj):
    """Removes the further numbers of polynomial springs and dampers."""
    for name in ("jnt_stiffnesspoly", "dof_dampingpoly", "tendon_stiffnesspoly", "tendon_dampingpoly", "actuator_dampingpoly"):
        if hasattr(mj, name):
            getattr(mj, name)[:] = 0


# Words of a remark, a short name, and the function that leaves the same out.
NAMED = (
    ("gravcomp", "gravity compensation", _without_gravcomp),
    ("fluid forces are left out", "fluid forces", _without_fluid),
    ("flag disables gravity", "gravity that a flag disables", _with_gravity),
    ("of the ball joint", "losses of ball joints", _without_ball_losses),
    ("of the free joint", "losses of free joints", _without_free_losses),
    ("of this tendon: left out", "forces of tendons", _without_tendon_forces),
    ("which is moved from outside; this equality is left out", "equalities with mocap bodies", _without_mocap_equalities),
    ("only the first number of", "polynomial springs and dampers", _with_first_numbers),
)


def leave_out(mj, said):
    """Leaves out of MuJoCo's model what the remarks name, and returns the short names."""
    short = []
    for words, name, change in NAMED:
        if words in said:
            change(mj)
            short.append(name)
    return short
