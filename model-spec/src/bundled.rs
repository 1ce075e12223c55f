//! Rig files of the paper's robot as texts, compiled into the program: name and text of each.

/// Rigs, the robot with numeric values for simulation: the complete robot, and the same with rods along its drives.
pub const RIGS: [(&str, &str); 2] = [
    ("spidermill-full.toml", include_str!("../rigs/spidermill-full.toml")),
    (
        "spidermill-with-rods.toml",
        include_str!("../rigs/spidermill-with-rods.toml"),
    ),
];
