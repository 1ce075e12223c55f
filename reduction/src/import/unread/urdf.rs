//! The elements of URDF 1.2, and the extensions of Drake and Gazebo that have an effect.

use super::{BALL_CONSTRAINT, ElementRule};

/// The table of URDF.
pub(super) const RULES: [ElementRule; 27] = [
    ElementRule {
        element: "robot",
        attributes: "name version schemaLocation",
        inner: "link joint transmission constraint ball_constraint loop_joint gazebo",
        ignored: "material sensor collision_filter_group ignore_self_collision",
    },
    ElementRule {
        element: "link",
        attributes: "name type",
        inner: "inertial",
        ignored: "visual collision self_collision_checking sensor",
    },
    ElementRule {
        element: "inertial",
        attributes: "",
        inner: "origin mass inertia",
        ignored: "",
    },
    ElementRule {
        element: "origin",
        attributes: "xyz rpy quat_xyzw",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "mass",
        attributes: "value",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "inertia",
        attributes: "ixx ixy ixz iyy iyz izz",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "joint",
        attributes: "name type",
        inner: "origin parent child axis limit dynamics mimic",
        ignored: "safety_controller calibration hardwareInterface controller_gains",
    },
    ElementRule {
        element: "parent",
        attributes: "link",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "child",
        attributes: "link",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "axis",
        attributes: "xyz",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "limit",
        attributes: "lower upper effort velocity",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "dynamics",
        attributes: "damping friction",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "mimic",
        attributes: "joint multiplier offset",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "transmission",
        attributes: "name type",
        inner: "type joint actuator leftActuator rightActuator",
        ignored: "role",
    },
    // The reduction scales the forces of an actuator, and has a remark of its own.
    ElementRule {
        element: "transmission/joint",
        attributes: "name",
        inner: "",
        ignored: "hardwareInterface role offset mechanicalReduction",
    },
    ElementRule {
        element: "actuator",
        attributes: "name",
        inner: "rotor_inertia gear_ratio",
        ignored: "hardwareInterface role offset mechanicalReduction motorTorqueConstant",
    },
    ElementRule {
        element: "leftActuator",
        attributes: "name",
        inner: "",
        ignored: "mechanicalReduction",
    },
    ElementRule {
        element: "rightActuator",
        attributes: "name",
        inner: "",
        ignored: "mechanicalReduction",
    },
    ElementRule {
        element: "rotor_inertia",
        attributes: "value",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "gear_ratio",
        attributes: "value",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "constraint",
        attributes: "name type",
        inner: "parent parent_origin parent_axis child child_origin child_axis",
        ignored: "",
    },
    ElementRule {
        element: "parent_origin",
        attributes: "xyz rpy quat_xyzw",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "child_origin",
        attributes: "xyz rpy quat_xyzw",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "parent_axis",
        attributes: "xyz",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "child_axis",
        attributes: "xyz",
        inner: "",
        ignored: "",
    },
    BALL_CONSTRAINT,
    // Settings of Gazebo for pictures, contacts and sensors have no effect.
    ElementRule {
        element: "gazebo",
        attributes: "reference",
        inner: "",
        ignored: "material visual sensor mu1 mu2 fdir1 kp kd minDepth maxVel maxContacts selfCollide self_collide \
                  laserRetro laser_retro max_contacts min_depth max_vel collision static=false,0 turnGravityOff=false,0 \
                  gravity=true,1 provideFeedback provide_feedback stopCfm stopErp preserveFixedJoint \
                  disableFixedJointLumping cfmDamping fudgeFactor",
    },
];
