//! What the figures were measured on.

use std::process::Command;

/// Processor, its widest vectors, and the compiler.
pub(crate) fn described() -> Vec<(&'static str, String)> {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let of = |key: &str| {
        let mut lines = cpu.lines().filter_map(|line| line.split_once(':'));
        lines
            .find(|(name, _)| name.trim() == key)
            .map(|(_, value)| value.trim().to_owned())
    };
    let flags = of("flags").unwrap_or_default();
    let has = |flag: &str| flags.split(' ').any(|f| f == flag);
    let sets = ["sse2", "avx", "avx2", "fma", "avx512f", "avx512dq", "avx512vl"];
    let sets: Vec<&str> = sets.into_iter().filter(|s| has(s)).collect();
    let numbers = ["cpu family", "model"].map(|key| of(key).unwrap_or_default());
    let processor = match of("model name") {
        Some(name) => format!("{name}, family {} model {}", numbers[0], numbers[1]),
        None => "not told by the system".to_owned(),
    };
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let rustc = Command::new(rustc).arg("--version").output();
    let rustc = rustc.map_or_else(
        |_| "not told".to_owned(),
        |o| String::from_utf8_lossy(&o.stdout).trim().to_owned(),
    );
    vec![
        (
            "system",
            format!("{}, {}", std::env::consts::OS, std::env::consts::ARCH),
        ),
        ("processor", processor),
        ("instruction sets", sets.join(", ")),
        ("Rust", rustc),
    ]
}
