//! Model and rig files of the paper's robot as texts, for programs that carry them: name and text of each.

/// The robot with true lengths, and as the paper has it.
pub const MODELS: [(&str, &str); 2] = [
    ("spidermill.toml", include_str!("../models/spidermill.toml")),
    (
        "spidermill-paper.toml",
        include_str!("../models/spidermill-paper.toml"),
    ),
];

/// The whole robot in numbers, and the same with rods along its drives.
pub const RIGS: [(&str, &str); 2] = [
    (
        "spidermill-full.toml",
        include_str!("../rigs/spidermill-full.toml"),
    ),
    (
        "spidermill-with-rods.toml",
        include_str!("../rigs/spidermill-with-rods.toml"),
    ),
];
