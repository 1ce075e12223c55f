//! Model and rig files of the paper's robot as texts, compiled into the program: name and text of each.

/// Models of the robot: with its true lengths, and as the paper has them.
pub const MODELS: [(&str, &str); 2] = [
    ("spidermill.toml", include_str!("../models/spidermill.toml")),
    ("spidermill-paper.toml", include_str!("../models/spidermill-paper.toml")),
];

/// Rigs, the robot with numeric values for simulation: the complete robot, and the same with rods along its drives.
pub const RIGS: [(&str, &str); 2] = [
    ("spidermill-full.toml", include_str!("../rigs/spidermill-full.toml")),
    (
        "spidermill-with-rods.toml",
        include_str!("../rigs/spidermill-with-rods.toml"),
    ),
];
