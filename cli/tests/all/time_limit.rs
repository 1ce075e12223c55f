//! `--time-limit`: a command that takes longer ends with an exit status of its own, and leaves files as they were.

use crate::common::{Ran, model, printed, ran, scratch};

#[test]
fn a_command_ends_at_its_time_limit_and_keeps_the_old_file() {
    let out = scratch("time-limit.rs");
    std::fs::write(&out, "old").unwrap();
    let start = std::time::Instant::now();
    let file = model("humanoid.toml");
    let Ran { status, out: text, err } = ran(&["generate", &file, "--out", &out, "--time-limit", "0.1"]);
    assert_eq!(status, 3, "{err}");
    assert!(text.is_empty(), "{text}");
    assert!(err.contains("the time limit of 0.1 s was reached while "), "{err}");
    assert!(err.contains("`--time-limit`"), "{err}");
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "old");
    // The derivation takes many seconds.
    assert!(start.elapsed().as_secs() < 4, "{:?}", start.elapsed());
}

#[test]
fn a_time_limit_that_is_not_reached_changes_nothing() {
    let file = model("two_link.toml");
    let plain = printed(&["check", &file, "--json"]);
    assert_eq!(printed(&["check", &file, "--json", "--time-limit", "1000"]), plain);
    for seconds in ["0", "-1", "nan", "inf", "1e400", "soon"] {
        let option = format!("--time-limit={seconds}");
        let Ran { status, err, .. } = ran(&["check", &file, &option]);
        assert_eq!(status, 2, "{seconds}: {err}");
        assert!(err.contains("a positive number of seconds"), "{err}");
    }
    let Ran { status, err, .. } = ran(&["work", &file, "--time-limit", "5"]);
    assert_eq!(status, 2, "{err}");
    assert!(err.contains("the workbench runs until it is stopped"), "{err}");
}
