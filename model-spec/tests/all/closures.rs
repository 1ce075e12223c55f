//! Loops and coordinates that follow others: folds, welds, tables, tendons and surplus drives.

use modelmill_boundary::files::MemoryFiles;
use modelmill_spec::{DriveKind, Mechanism, load};

fn mechanism(text: &str) -> (Mechanism, String) {
    match load("model.toml", text, &MemoryFiles::default()) {
        Ok(loaded) => {
            let said = loaded.render(false);
            (loaded.mechanism, said)
        }
        Err(failure) => panic!("{}", failure.render(false)),
    }
}

fn refusal(text: &str) -> String {
    match load("model.toml", text, &MemoryFiles::default()) {
        Ok(_) => panic!("a faulty file was read"),
        Err(failure) => failure.render(false),
    }
}

/// A four-bar with the crank `before` the angle at which coupler and rocker are in line.
fn four_bar(before: f64, closure: &str) -> String {
    let [crank, coupler, rocker, ground] = [0.3, 0.35, 0.3, 0.6_f64];
    let reach = coupler + rocker;
    let fold = ((crank * crank + ground * ground - reach * reach) / (2.0 * crank * ground)).acos();
    let q: f64 = fold - before;
    let (x, y) = (crank * q.cos(), crank * q.sin());
    let distance = (ground - x).hypot(y);
    let opening = (coupler * coupler + distance * distance - rocker * rocker) / (2.0 * coupler * distance);
    let absolute = (-y).atan2(ground - x) + opening.acos();
    let end = [x + coupler * absolute.cos(), y + coupler * absolute.sin()];
    let follower = end[1].atan2(end[0] - ground);
    let relative = absolute - q;
    format!(
        "schema = 1\nname = \"bar\"\n[coordinates]\nq = {{ nominal = {q} }}\np = {{ nominal = {relative}, passive = true }}\n\
         r = {{ nominal = {follower}, passive = true }}\n\
         [[frame]]\nname = \"crank\"\non = \"base\"\nmodified_dh = {{ theta = \"q\" }}\n\
         [[frame]]\nname = \"coupler\"\non = \"crank\"\nmodified_dh = {{ a = {crank}, theta = \"p\" }}\n\
         [[frame]]\nname = \"rocker\"\non = \"base\"\nmodified_dh = {{ a = {ground}, theta = \"r\" }}\n\
         [[part]]\non = \"crank\"\nlinear = {{ planar = \"1\" }}\n\
         [[drive]]\nname = \"d\"\njoint = \"q\"\n\
         [[point]]\nname = \"A\"\non = \"coupler\"\nat = [{coupler}, 0]\n\
         [[point]]\nname = \"B\"\non = \"rocker\"\nat = [{rocker}, 0]\n{closure}"
    )
}

const PIN: &str = "[[loop]]\nname = \"l\"\njoins = [\"A\", \"B\"]\n";

/// The distance is that of the construction, to the second order in it.
#[test]
fn a_nominal_pose_next_to_a_fold_is_reported_with_its_distance() {
    for before in [0.001, 0.004, 0.008] {
        let (_, said) = mechanism(&four_bar(before, PIN));
        let label = said
            .split_once("about ")
            .unwrap_or_else(|| panic!("{before}: {said}"))
            .1;
        let printed: f64 = label.split_once(' ').expect("a number").0.parse().expect("a number");
        assert!(
            (printed - before).abs() < 0.06 * before,
            "{printed} instead of {before}"
        );
        assert!(label.contains("rad above"), "{said}");
    }
    for before in [0.03, 0.3, 0.8] {
        let (_, said) = mechanism(&four_bar(before, PIN));
        assert!(!said.contains("fold"), "{said}");
    }
}

/// A second motor on the rocker is one drive more than degrees of freedom: both share the row of the crank.
#[test]
fn surplus_drives_share_the_rows_of_the_independent_coordinates() {
    let (mechanism, _) = mechanism(&four_bar(
        0.5,
        &format!("{PIN}[[drive]]\nname = \"helper\"\njoint = \"r\"\n"),
    ));
    let names = |drives: &[modelmill_spec::ModelDrive]| drives.iter().map(|d| d.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&mechanism.drives), ["on_q"]);
    assert_eq!(names(&mechanism.shared_drives), ["d", "helper"]);
    assert!(
        mechanism
            .drives
            .iter()
            .all(|row| !row.is_driven && matches!(row.kind, DriveKind::Joint(_)))
    );
}

/// A weld of two frames is three pairs of points: here of the rocker's frame and one on a further hinge of the coupler.
#[test]
fn a_weld_is_one_entry() {
    let weld = "[[frame]]\nname = \"hinge\"\non = \"coupler\"\ntransform = { xyz = [0.35, 0, 0] }\njoint = { revolute = \"w\" }\n\
                [[frame]]\nname = \"end\"\non = \"rocker\"\ntransform = { xyz = [0.3, 0, 0] }\n\
                [[loop]]\nname = \"weld\"\nwelds = [\"hinge\", \"end\"]\n";
    let text = four_bar(0.5, weld);
    let (pinned, _) = mechanism(&four_bar(0.5, PIN));
    let value = |mechanism: &Mechanism, name: &str| {
        let found = mechanism.coordinates.iter().find(|c| c.name == name);
        found.expect("a coordinate").nominal
    };
    let turned = value(&pinned, "r") - value(&pinned, "q") - value(&pinned, "p");
    let text = text.replace(
        "[coordinates]\n",
        &format!("[coordinates]\nw = {{ nominal = {turned}, passive = true }}\n"),
    );
    let (welded, _) = mechanism(&text);
    let names: Vec<&str> = welded.loops.iter().map(|one| one.name.as_str()).collect();
    assert_eq!(names, ["weld", "weld_x", "weld_y"]);
    for name in ["p", "r"] {
        assert!((value(&welded, name) - value(&pinned, name)).abs() < 1e-12, "{name}");
    }
    let both = refusal(&text.replace("welds =", "joins = [\"A\", \"B\"]\nwelds ="));
    assert!(both.contains("does not specify what it joins"), "{both}");
    let same = refusal(&text.replace("[\"hinge\", \"end\"]", "[\"rocker\", \"end\"]"));
    assert!(same.contains("fixed to the same body"), "{same}");
    // The weld's loops take names, as loops without a name do.
    for name in ["weld", "weld_x", "weld_y"] {
        let twice = refusal(&format!("{text}[[loop]]\nname = \"{name}\"\njoins = [\"A\", \"B\"]\n"));
        assert!(
            twice.contains(&format!("the loop `{name}` is defined twice")),
            "{twice}"
        );
    }
    let joins = "[[loop]]\njoins = [\"A\", \"B\"]\n";
    let twice = refusal(&four_bar(0.5, &format!("{joins}{joins}")));
    assert!(twice.contains("the loop `A_B` is defined twice"), "{twice}");
}

/// A crank with a coordinate that follows it.
fn follower(follows: &str, rest: &str) -> String {
    format!(
        "schema = 1\nname = \"cam\"\n[coordinates]\nq = {{ nominal = 0.4 }}\ns = {{ follows = \"{follows}\"{rest} }}\n\
         [[frame]]\nname = \"crank\"\non = \"base\"\nmodified_dh = {{ theta = \"q\" }}\n\
         [[frame]]\nname = \"slide\"\non = \"base\"\njoint = {{ prismatic = \"s\", axis = \"x\" }}\n\
         [[part]]\non = \"crank\"\nlinear = {{ planar = \"1\" }}\n[[part]]\non = \"slide\"\nlinear = {{ M = 1 }}\n\
         [[drive]]\nname = \"d\"\njoint = \"q\"\n[constants]\nr = {{ value = 0.1, unit = \"m\" }}\n"
    )
}

#[test]
fn functions_with_jumps_and_faulty_tables_are_refused() {
    for (follows, rest, reason) in [
        ("r*abs(sin(q))", "", "jumps or kinks"),
        ("r*sign(q)", "", "jumps or kinks"),
        ("r*cos(q)^2 + q", "", "cannot be added"),
        ("q", ", table = [[0, 0], [1, 0.1], [1, 0.2], [3, 0.3]]", "must increase"),
        ("q", ", table = [[0, 0], [1, 0.1], [2, 0.2]]", "3 points"),
        (
            "q",
            ", periodic = true, table = [[0, 0], [2, 0.1], [4, 0.2], [6.2831, 0]]",
            "covers one turn",
        ),
        (
            "q",
            ", periodic = true, table = [[0, 0], [1, 0.1], [2, 0.2], [3, 0.1]]",
            "very different distances",
        ),
    ] {
        let said = refusal(&follower(follows, rest));
        assert!(said.contains(reason), "{follows}{rest}: {said}");
    }
    let alone = refusal(
        &follower("r", ", table = [[0, 0], [1, 0.1], [2, 0.2], [3, 0.3]]")
            .replace("follows = \"r\", ", "nominal = 0, "),
    );
    assert!(alone.contains("needs `follows`"), "{alone}");
}

/// The value of a coordinate that follows by a function is that of the function at the nominal pose.
#[test]
fn followers_start_on_their_function() {
    let value = |text: &str| mechanism(text).0.coordinates[1].nominal;
    assert!((value(&follower("r*cos(q)", "")) - 0.1 * 0.4_f64.cos()).abs() < 1e-15);
    // A straight line is reproduced by its table.
    let table = ", table = [[-1, -0.2], [0, 0], [0.5, 0.1], [2, 0.4], [3, 0.6]]";
    assert!((value(&follower("q", table)) - 0.08).abs() < 1e-15);
}
