//! The elements of SDF 1.12, and the extensions of Drake that are read.

use super::{BALL_CONSTRAINT, ElementRule};

/// The table of SDF. Entries of a matrix and similar elements have only text, and need no rule.
pub(super) const RULES: [ElementRule; 19] = [
    ElementRule {
        element: "sdf",
        attributes: "version schemaLocation noNamespaceSchemaLocation",
        inner: "world model",
        ignored: "",
    },
    ElementRule {
        element: "world",
        attributes: "name",
        inner: "model gravity",
        ignored: "light physics scene gui audio atmosphere magnetic_field spherical_coordinates state population road \
                  plugin",
    },
    ElementRule {
        element: "model",
        attributes: "name canonical_link",
        inner: "link joint frame pose ball_constraint weld_constraint",
        ignored: "static self_collide allow_auto_disable enable_wind=false,0 gripper collision_filter_group",
    },
    ElementRule {
        element: "link",
        attributes: "name",
        inner: "inertial pose",
        ignored: "visual collision sensor light audio_sink audio_source battery projector particle_emitter self_collide \
                  must_be_base_link gravity=true,1 enable_wind=false,0 kinematic=false,0",
    },
    ElementRule {
        element: "inertial",
        attributes: "auto=false,0",
        inner: "mass pose inertia",
        ignored: "density auto_inertia_params",
    },
    ElementRule {
        element: "inertia",
        attributes: "",
        inner: "ixx iyy izz ixy ixz iyz",
        ignored: "",
    },
    ElementRule {
        element: "inertial/pose",
        attributes: "relative_to frame= degrees rotation_format",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "model/pose",
        attributes: "relative_to=,world,__root__ frame=,world degrees rotation_format",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "pose",
        attributes: "relative_to frame degrees rotation_format",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "frame",
        attributes: "name attached_to",
        inner: "pose",
        ignored: "",
    },
    ElementRule {
        element: "joint",
        attributes: "name type",
        inner: "parent child pose axis axis2 screw_thread_pitch rotor_inertia gear_ratio \
                gearbox_ratio gearbox_reference_body",
        // The pitch of other kinds of joints has no meaning; sensors and physics have a remark of their own.
        ignored: "thread_pitch sensor physics controller_gains",
    },
    ElementRule {
        element: "axis",
        attributes: "",
        inner: "xyz use_parent_model_frame dynamics limit mimic",
        ignored: "initial_position",
    },
    ElementRule {
        element: "axis2",
        attributes: "",
        inner: "xyz use_parent_model_frame dynamics limit mimic",
        ignored: "initial_position",
    },
    ElementRule {
        element: "xyz",
        attributes: "expressed_in",
        inner: "",
        ignored: "",
    },
    ElementRule {
        element: "dynamics",
        attributes: "",
        inner: "damping friction spring_stiffness spring_reference",
        ignored: "",
    },
    ElementRule {
        element: "limit",
        attributes: "",
        inner: "lower upper effort velocity",
        // The stiffness of the stop acts at the limits only.
        ignored: "stiffness dissipation",
    },
    ElementRule {
        element: "mimic",
        attributes: "joint axis",
        inner: "multiplier offset reference",
        ignored: "",
    },
    BALL_CONSTRAINT,
    ElementRule {
        element: "weld_constraint",
        attributes: "name",
        inner: "parent child",
        ignored: "",
    },
];
