//! Marks of the benchmark of hidden effects: constructed answers, each with its expected mark.

use modelmill_lab::answer::ProgramAnswer;
use modelmill_lab::harness::TestedProgram;
use modelmill_lab::judge::{AnswerMark, CaseClass, SAME, aliases, judge};
use modelmill_lab::placed::PlacedEffect;
use modelmill_lab::table::{CaseScore, report};
use serde_json::{Value, json};

const LEFT: &str = "spindle_left";
const RIGHT: &str = "spindle_right";

/// An answer in the format of `cli.md`, with effects as `(kind, places, aliases)`.
fn said(verdict: &str, effects: &[(&str, &[&str], &[PlacedEffect])]) -> Value {
    let effects: Vec<Value> = effects
        .iter()
        .map(|(kind, at, aliases)| {
            let aliases: Vec<Value> = aliases
                .iter()
                .map(|alias| json!({ "kind": alias.kind, "at": alias.at }))
                .collect();
            json!({ "kind": kind, "at": at, "estimates": [], "indistinguishable_from": aliases,
                    "separate_by": "" })
        })
        .collect();
    json!({
        "verdict": verdict,
        "noise_floor": 0.004,
        "steps": [{ "added": null, "fit": 0.1, "check": 0.11 },
                  { "added": { "kind": "viscous_friction", "at": [LEFT] }, "fit": 0.004, "check": 0.0041 }],
        "effects": effects,
        "candidates": [],
        "parameters_off_nominal": [],
        "data": [],
        "where": [{ "channel": LEFT, "in": "t", "range": [0, 1], "share": 0.6, "says": "" }],
    })
}

/// The mark of an answer if the squared residual of all claims is `excess`.
fn mark(class: CaseClass, hidden: &[(&str, &[&str])], answer: &Value, excess: f64) -> AnswerMark {
    let hidden: Vec<PlacedEffect> = hidden.iter().map(|(k, at)| PlacedEffect::new(k, at)).collect();
    let answer = ProgramAnswer::from_json(answer).expect("the form of cli.md");
    judge(class, &hidden, None, &answer, &mut |_| excess)
}

/// The mark if every wrong claim is clearly distinguishable from the truth.
fn plainly(class: CaseClass, hidden: &[(&str, &[&str])], answer: &Value) -> AnswerMark {
    mark(class, hidden, answer, 1e4)
}

#[test]
fn the_truth_is_right_and_only_with_its_verdict() {
    let hidden: &[(&str, &[&str])] = &[("viscous_friction", &[LEFT])];
    let effects: &[(&str, &[&str], &[PlacedEffect])] = &[("viscous_friction", &[LEFT], &[])];
    let answer = |verdict| plainly(CaseClass::One, hidden, &said(verdict, effects));
    assert_eq!(answer("missing_effect"), AnswerMark::Right);
    assert_eq!(answer("unexplained"), AnswerMark::WrongVerdict);
}

#[test]
fn what_is_wrong_is_told_apart() {
    let hidden: &[(&str, &[&str])] = &[("viscous_friction", &[LEFT])];
    let answer = |effects| plainly(CaseClass::One, hidden, &said("missing_effect", effects));
    assert_eq!(answer(&[]), AnswerMark::Missed);
    assert_eq!(answer(&[("viscous_friction", &[RIGHT], &[])]), AnswerMark::WrongPlace);
    assert_eq!(answer(&[("coulomb_friction", &[LEFT], &[])]), AnswerMark::WrongKind);
    assert_eq!(answer(&[("viscous_friction", &[LEFT, RIGHT], &[])]), AnswerMark::Extra);
    let two: &[(&str, &[&str])] = &[("viscous_friction", &[LEFT]), ("point_mass", &["R2m"])];
    let part = said("missing_effect", &[("point_mass", &["R2m"], &[])]);
    assert_eq!(plainly(CaseClass::Two, two, &part), AnswerMark::Partly);
}

#[test]
fn shared_and_separate_are_alike() {
    let separate: &[(&str, &[&str])] = &[("coulomb_friction", &[LEFT]), ("coulomb_friction", &[RIGHT])];
    let shared = said("missing_effect", &[("coulomb_friction", &[RIGHT, LEFT], &[])]);
    assert_eq!(plainly(CaseClass::One, separate, &shared), AnswerMark::Right);
    let both: &[(&str, &[&str])] = &[("coulomb_friction", &[LEFT, RIGHT])];
    let apart = said(
        "missing_effect",
        &[("coulomb_friction", &[LEFT], &[]), ("coulomb_friction", &[RIGHT], &[])],
    );
    assert_eq!(plainly(CaseClass::One, both, &apart), AnswerMark::Right);
}

#[test]
fn the_same_columns_by_other_names_are_alike() {
    let alike = |hidden: &[(&str, &[&str])], effects| {
        plainly(CaseClass::One, hidden, &said("missing_effect", effects)) == AnswerMark::Right
    };
    assert!(alike(
        &[("directional_coulomb_friction", &[LEFT])],
        &[("coulomb_friction", &[LEFT], &[]), ("force_offset", &[LEFT], &[])]
    ));
    assert!(alike(
        &[("directional_viscous_friction", &[LEFT])],
        &[
            ("viscous_friction", &[LEFT], &[]),
            ("directional_viscous_friction", &[LEFT], &[])
        ]
    ));
    assert!(alike(
        &[("spring", &[LEFT])],
        &[("spring", &[LEFT], &[]), ("force_offset", &[LEFT], &[])]
    ));
    // An offset of the other drive is not part of the spring. Coulomb friction alone is not its directional form.
    assert!(!alike(
        &[("spring", &[LEFT])],
        &[("spring", &[LEFT], &[]), ("force_offset", &[RIGHT], &[])]
    ));
    assert!(!alike(
        &[("coulomb_friction", &[LEFT])],
        &[("directional_coulomb_friction", &[LEFT], &[])]
    ));
}

#[test]
fn an_alias_counts_where_it_is_named_and_nobody_could_do_better() {
    let hidden: &[(&str, &[&str])] = &[("point_mass", &["R2m"])];
    let names_truth: &[PlacedEffect] = &[PlacedEffect::new("point_mass", &["R2m"])];
    let names_other: &[PlacedEffect] = &[PlacedEffect::new("spring", &[LEFT])];
    let answer = |aliases, excess| {
        let said = said("missing_effect", &[("point_mass", &["A_left"], aliases)]);
        mark(CaseClass::One, hidden, &said, excess)
    };
    assert_eq!(answer(names_truth, 0.5 * SAME), AnswerMark::Alias);
    assert_eq!(answer(names_truth, 2.0 * SAME), AnswerMark::WrongPlace);
    assert_eq!(answer(names_other, 0.5 * SAME), AnswerMark::WrongPlace);
    assert_eq!(answer(&[], 0.0), AnswerMark::WrongPlace);
    // A spring contains an offset, so it is the more complex answer.
    let offset: &[(&str, &[&str])] = &[("force_offset", &[LEFT])];
    let spring = said(
        "missing_effect",
        &[("spring", &[LEFT], &[PlacedEffect::new("force_offset", &[LEFT])])],
    );
    assert_eq!(mark(CaseClass::One, offset, &spring, 0.0), AnswerMark::WrongKind);
    // An indistinguishable alias does not excuse an additional wrong effect.
    let more = said(
        "missing_effect",
        &[
            ("point_mass", &["A_left"], names_truth),
            ("force_offset", &[RIGHT], &[]),
        ],
    );
    assert_eq!(mark(CaseClass::One, hidden, &more, 0.0), AnswerMark::WrongKind);
}

#[test]
fn nothing_and_what_is_outside_have_one_right_verdict_each() {
    let nothing = |verdict| said(verdict, &[]);
    let effect = said("missing_effect", &[("spring", &[LEFT], &[])]);
    let adequate_with_effect = said("adequate", &[("spring", &[LEFT], &[])]);
    let of = |class, answer: &Value| plainly(class, &[], answer);
    assert_eq!(of(CaseClass::None, &nothing("adequate")), AnswerMark::Right);
    assert_eq!(of(CaseClass::None, &nothing("unexplained")), AnswerMark::FalseAlarm);
    assert_eq!(of(CaseClass::None, &effect), AnswerMark::FalseAlarm);
    assert_eq!(of(CaseClass::None, &adequate_with_effect), AnswerMark::FalseAlarm);
    assert_eq!(of(CaseClass::Outside, &nothing("unexplained")), AnswerMark::Right);
    assert_eq!(of(CaseClass::Outside, &nothing("adequate")), AnswerMark::Overlooked);
    assert_eq!(of(CaseClass::Outside, &effect), AnswerMark::Guess);
}

#[test]
fn aliases_are_counted_by_what_they_leave() {
    let named: &[PlacedEffect] = &[
        PlacedEffect::new("spring", &[LEFT]),
        PlacedEffect::new("force_offset", &[LEFT]),
    ];
    let answer = said("missing_effect", &[("drive_inertia", &[LEFT], named)]);
    let answer = ProgramAnswer::from_json(&answer).expect("the form of cli.md");
    let mut excess = |claims: &[PlacedEffect]| match claims[0].kind.as_str() {
        "drive_inertia" => 1.0,
        "spring" => 1.0 + 0.5 * SAME,
        _ => 1.0 + 2.0 * SAME,
    };
    assert_eq!(aliases(&answer, &mut excess), [2, 1]);
}

#[test]
fn the_report_counts_what_is_right_and_lists_what_is_not() {
    let score = |number, class, mark, check: f64, floor| {
        let mut answer = said("missing_effect", &[("viscous_friction", &[LEFT], &[])]);
        answer["steps"][1]["check"] = json!(check);
        CaseScore {
            number,
            class,
            label: "viscous_friction".to_owned(),
            truth: format!("truth {number}"),
            recording: "two periods".to_owned(),
            drive: (class == CaseClass::Outside).then_some(LEFT),
            errors: [0.1, 0.1],
            floor,
            answer: Some(ProgramAnswer::from_json(&answer).expect("the form of cli.md")),
            mark,
            aliases: [1, 0],
            took: std::time::Duration::from_millis(number),
        }
    };
    let mut failed = score(
        4,
        CaseClass::None,
        AnswerMark::Failed("no such column".to_owned()),
        0.01,
        0.01,
    );
    failed.answer = None;
    let scores = [
        score(1, CaseClass::One, AnswerMark::Right, 0.0129, 0.01),
        score(2, CaseClass::One, AnswerMark::Alias, 0.0131, 0.01),
        score(3, CaseClass::One, AnswerMark::WrongPlace, 0.01, 0.01),
        failed,
        score(5, CaseClass::Outside, AnswerMark::Guess, 0.01, 0.01),
        score(6, CaseClass::Outside, AnswerMark::Right, 0.01, 0.01),
    ];
    let text = report(&scores, 7);
    for line in [
        "one       66.7 % right, 2 of 3; target 95 %",
        "none       0.0 % right, 0 of 1; target 98 %",
        "outside   50.0 % right, 1 of 2; target 90 %",
        "located  1 of 1 unexplained forces reported first in the drive on which they act",
        "fall      50.0 % of 2 found with a validation error within 1.3 times the noise floor; target 100 %",
        "- seed 7 case 2 (one): the validation error is 1.31 times the noise floor",
        "- seed 7 case 3 (one): wrong place",
        "- seed 7 case 4 (none): failed: no such column",
        "- seed 7 case 5 (outside): effect claimed for a force outside the library",
    ] {
        assert!(text.lines().any(|l| l == line), "no line `{line}` in\n{text}");
    }
    assert!(!text.contains("case 1 ("), "{text}");
}

#[test]
fn json_that_departs_from_the_contract_is_refused() {
    let mut answer = said("missing_effect", &[("spring", &[LEFT], &[])]);
    assert!(ProgramAnswer::from_json(&answer).is_ok());
    answer["effects"][0]["at"] = json!(LEFT);
    assert!(ProgramAnswer::from_json(&answer).is_err());
    let mut answer = said("perhaps", &[]);
    assert!(ProgramAnswer::from_json(&answer).is_err());
    answer["verdict"] = json!("adequate");
    answer["steps"][0]["check"] = Value::Null;
    assert!(ProgramAnswer::from_json(&answer).is_err());
}

/// A script with a fixed output replaces modelmill.
#[cfg(unix)]
#[test]
fn the_program_is_asked_as_the_contract_says() {
    use std::os::unix::fs::PermissionsExt;
    use std::path::{Path, PathBuf};

    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hidden_effects");
    std::fs::create_dir_all(&folder).expect("a folder for the test");
    let program = folder.join("program");
    let asked = folder.join("asked");
    let answer = said("adequate", &[]).to_string();
    let make = |script: &str| {
        std::fs::write(&program, script).expect("the script is written");
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("the script may run");
    };
    let ask = || {
        let recordings = ["fit.csv", "check.csv"].map(PathBuf::from);
        let asked = TestedProgram::new(&program);
        asked.diagnose(Path::new("model.toml"), &recordings).0
    };
    make(&format!(
        "#!/bin/sh\necho \"$@\" > '{}'\necho progress >&2\nprintf '%s' '{answer}'\n",
        asked.display()
    ));
    let read = ask().expect("an answer");
    assert_eq!(read.verdict, "adequate");
    assert_eq!(read.steps.len(), 2);
    assert_eq!(
        read.steps[1].added,
        Some(PlacedEffect::new("viscous_friction", &[LEFT]))
    );
    assert!((read.steps[1].check - 0.0041).abs() < 1e-15);
    let words = std::fs::read_to_string(&asked).expect("the script ran");
    assert_eq!(
        words.trim(),
        "diagnose model.toml --data fit.csv --check check.csv --json"
    );
    make("#!/bin/sh\necho 'error: no such column' >&2\nexit 1\n");
    let refused = ask().expect_err("the program failed");
    assert!(refused.contains("no such column"), "{refused}");
}
