//! The elements of MJCF (MuJoCo 4). Elements that have a remark or an error of their own are read in this sense.

use super::ElementRule;

/// How an actuator computes its force. A drive of a model has any force, so none of these has an effect.
macro_rules! actuator {
    ($element:literal, $own:literal) => {
        ElementRule {
            element: $element,
            attributes: concat!(
                "name class group nsample interp delay ctrllimited forcelimited actlimited ctrlrange forcerange actrange ",
                "lengthrange gear cranklength joint jointinparent tendon cranksite slidersite site refsite body user ",
                "armature damping actdim actearly dyntype gaintype biastype dynprm gainprm biasprm plugin instance ",
                $own
            ),
            inner: "",
            ignored: "config",
        }
    };
}

/// An element with attributes only.
const fn leaf(element: &'static str, attributes: &'static str) -> ElementRule {
    ElementRule {
        element,
        attributes,
        inner: "",
        ignored: "",
    }
}

/// The table of MJCF.
pub(super) const RULES: [ElementRule; 41] = [
    ElementRule {
        element: "mujoco",
        attributes: "model",
        inner: "compiler option default worldbody equality tendon actuator",
        // Other sections have a remark of their own.
        ignored: "asset visual statistic contact sensor custom size extension keyframe skin include modelmill-remark",
    },
    ElementRule {
        element: "compiler",
        attributes: "autolimits boundmass boundinertia settotalmass balanceinertia strippath coordinate angle fitaabb \
                     eulerseq meshdir texturedir assetdir discardvisual usethread fusestatic inertiafromgeom \
                     inertiagrouprange saveinertial exactmeshinertia convexhull alignfree=false conflict",
        inner: "",
        ignored: "lengthrange",
    },
    ElementRule {
        element: "option",
        attributes: "gravity density viscosity wind timestep apirate impratio tolerance ls_tolerance noslip_tolerance \
                     ccd_tolerance mpr_tolerance sleep_tolerance magnetic o_margin o_solref o_solimp o_friction \
                     integrator collision cone jacobian solver iterations ls_iterations noslip_iterations \
                     ccd_iterations mpr_iterations sdf_iterations sdf_initpoints actuatorgroupdisable",
        inner: "flag",
        ignored: "",
    },
    leaf(
        "flag",
        "constraint=enable equality=enable frictionloss=enable spring=enable damper=enable passive=enable gravity limit \
         contact clampctrl warmstart filterparent actuation refsafe sensor midphase nativeccd eulerdamp autoreset \
         island override energy fwdinv invdiscrete sensornoise multiccd sleep",
    ),
    ElementRule {
        element: "default",
        attributes: "class",
        inner: "default joint geom site equality tendon general motor position velocity intvelocity orientation pid \
                damper cylinder muscle adhesion dcmotor",
        ignored: "mesh material camera light pair",
    },
    ElementRule {
        element: "worldbody",
        attributes: "name childclass pos quat",
        inner: "body frame geom site joint freejoint",
        ignored: "camera light",
    },
    ElementRule {
        element: "body",
        attributes: "name pos quat axisangle xyaxes zaxis euler childclass mocap gravcomp user sleep",
        inner: "body frame inertial joint freejoint geom site",
        ignored: "camera light attach replicate composite flexcomp",
    },
    ElementRule {
        element: "frame",
        attributes: "name pos quat axisangle xyaxes zaxis euler childclass",
        inner: "body frame geom site joint freejoint inertial",
        ignored: "camera light attach replicate composite flexcomp",
    },
    leaf(
        "inertial",
        "pos quat axisangle xyaxes zaxis euler mass diaginertia fullinertia",
    ),
    leaf(
        "joint",
        "name class type group pos axis limited actuatorfrclimited solreflimit solimplimit \
         solreffriction solimpfriction stiffness range actuatorfrcrange actuatorgravcomp margin ref springref armature \
         damping frictionloss user",
    ),
    leaf("freejoint", "name group align"),
    ElementRule {
        element: "geom",
        attributes: "name class type contype conaffinity condim group priority size material friction mass density \
                     shellinertia solmix solref solimp margin gap fromto pos quat axisangle xyaxes zaxis euler hfield \
                     mesh fitscale rgba user fluidshape=none fluidcoef",
        inner: "",
        ignored: "plugin",
    },
    leaf(
        "site",
        "name class type group pos quat axisangle xyaxes zaxis euler material size fromto rgba user",
    ),
    // Equalities: the solver's softness is left out, since closures of a model are exact.
    ElementRule {
        element: "equality",
        attributes: "active solref solimp",
        inner: "connect weld joint tendon",
        ignored: "flex flexvert flexstrain distance",
    },
    leaf(
        "connect",
        "name class active solref solimp body1 body2 anchor site1 site2",
    ),
    leaf(
        "weld",
        "name class active solref solimp body1 body2 relpose anchor site1 site2 torquescale",
    ),
    leaf(
        "equality/joint",
        "name class active solref solimp joint1 joint2 polycoef",
    ),
    leaf(
        "equality/tendon",
        "name class active solref solimp tendon1 tendon2 polycoef",
    ),
    ElementRule {
        element: "tendon",
        attributes: "class group limited range margin solreflimit solimplimit solreffriction solimpfriction frictionloss \
                     springlength width material stiffness damping armature rgba user",
        inner: "spatial fixed",
        ignored: "",
    },
    ElementRule {
        element: "spatial",
        attributes: "name class group limited actuatorfrclimited range actuatorfrcrange margin solreflimit solimplimit \
                     solreffriction solimpfriction frictionloss springlength width material stiffness damping armature \
                     rgba user",
        inner: "site geom pulley",
        ignored: "",
    },
    leaf("spatial/site", "site"),
    leaf("spatial/geom", "geom sidesite"),
    leaf("pulley", "divisor"),
    ElementRule {
        element: "fixed",
        attributes: "name class group limited actuatorfrclimited range actuatorfrcrange margin solreflimit solimplimit \
                     solreffriction solimpfriction frictionloss springlength stiffness damping armature user",
        inner: "joint",
        ignored: "",
    },
    leaf("fixed/joint", "joint coef"),
    ElementRule {
        element: "actuator",
        attributes: "",
        inner: "general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor plugin",
        ignored: "",
    },
    actuator!("general", ""),
    actuator!("motor", ""),
    actuator!("position", "kp kv dampratio timeconst inheritrange"),
    actuator!("velocity", "kv"),
    actuator!("intvelocity", "kp kv dampratio inheritrange"),
    actuator!("orientation", "kp kv dampratio timeconst"),
    actuator!("pid", "kp ki kd kv timeconst inheritrange"),
    actuator!("damper", "kv"),
    actuator!("cylinder", "timeconst area diameter bias"),
    actuator!(
        "muscle",
        "timeconst tausmooth range force scale lmin lmax vmax fpmax fvmax"
    ),
    actuator!("adhesion", "gain"),
    actuator!("dcmotor", ""),
    actuator!("plugin", ""),
    leaf("default/equality", "active solref solimp"),
    ElementRule {
        element: "default/tendon",
        attributes: "group limited range margin solreflimit solimplimit solreffriction solimpfriction frictionloss \
                     springlength width material stiffness damping armature rgba user",
        inner: "",
        ignored: "",
    },
];
