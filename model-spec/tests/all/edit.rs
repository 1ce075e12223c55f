//! Effects that are added to model files: everything else stays, and the result means what was asked for.

use std::path::{Path, PathBuf};

use modelmill_boundary::files::{DiskFiles, MemoryFiles};
use modelmill_spec::edit::{EditFailure, NewEffect, NewParameter, add_effect, add_to_model};
use modelmill_spec::{LoadedModel, Mechanics, library, load};
use proptest::prelude::*;

fn folder(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn text_of(model: &str) -> String {
    std::fs::read_to_string(folder("models").join(model)).unwrap()
}

fn effect(kind: &str, at: &[&str]) -> NewEffect {
    NewEffect {
        kind: kind.to_owned(),
        at: at.iter().map(|&name| name.to_owned()).collect(),
        ..NewEffect::default()
    }
}

/// Adds an effect to a text that stands beside the bundled models.
fn add(text: &str, effect: &NewEffect) -> Result<(String, LoadedModel), String> {
    let path = folder("models/here.toml");
    add_to_model(&path.to_string_lossy(), text, effect, &[], &DiskFiles::default())
        .map(|edited| (edited.text, edited.loaded))
        .map_err(|failure| failure.to_string())
}

/// Whether `new` is `old` with something put in at one place.
fn is_insertion(old: &str, new: &str) -> bool {
    let (old, new) = (old.as_bytes(), new.as_bytes());
    let before = old.iter().zip(new).take_while(|(a, b)| a == b).count();
    let behind = old.iter().rev().zip(new.iter().rev());
    let behind = behind.take_while(|(a, b)| a == b).count();
    new.len() > old.len() && before + behind >= old.len()
}

const ARM: &str = r#"schema = 1 # the format
name = "arm"

[coordinates]
q = {}

[constants]
g = { value = 9.81, unit = "m/s^2" }
"#;

const REST: &str = r#"
[[frame]]
name = "link"
on = "base"
modified_dh = { theta = "q" }

[[part]]
on = "link"
linear = { planar = "1" }

[[drive]]
name = "motor"
joint = "q"
"#;

fn with_effects(effects: &str) -> String {
    // The gravity of a planar arm, so that all names are used.
    format!("gravity = [0, \"-g\"]\n{effects}\n{ARM}{REST}")
}

#[test]
fn behind_the_last_effect_or_at_the_end() {
    let plain = with_effects("");
    let (once, loaded) = add(&plain, &effect("viscous_friction", &["motor"])).unwrap();
    assert!(once.starts_with(&plain));
    assert_eq!(loaded.mechanism.effects.len(), 1);
    let more = format!("{once}# the last words\n[limits]\nsingularity = 0.2 # kept\n");
    let (twice, loaded) = add(&more, &effect("coulomb_friction", &["motor"])).unwrap();
    assert!(is_insertion(&more, &twice), "{twice}");
    assert!(twice.ends_with("# the last words\n[limits]\nsingularity = 0.2 # kept\n"));
    assert_eq!(loaded.mechanism.effects[1].kind, "coulomb_friction");
}

#[test]
fn what_an_effect_has_behind_its_header_stays_with_it() {
    let text = with_effects("")
        + "\n[[effect]]\nkind = \"stribeck_friction\"\nat = \"motor\"\n[effect.constants] # how\nvs = 0.1 # slow\n# end\n";
    let (new, loaded) = add(&text, &effect("spring", &["q"])).unwrap();
    assert!(is_insertion(&text, &new));
    let vs = loaded.mechanism.effects[0].constant("vs", &loaded.mechanism);
    assert_eq!(vs, Some(0.1));
    assert_eq!(loaded.mechanism.effects[1].kind, "spring");
}

#[test]
fn inline_lists_of_effects() {
    let friction = effect("coulomb_friction", &["motor"]);
    for (old, new) in [
        ("effect = []", "effect = [{ N }]"),
        (
            "effect = [{ kind = \"spring\", at = \"q\" }]",
            "effect = [{ kind = \"spring\", at = \"q\" }, { N }]",
        ),
        (
            "effect = [\n  { kind = \"spring\", at = \"q\" } # soft\n]",
            "effect = [\n  { kind = \"spring\", at = \"q\" }, # soft\n  { N }\n]",
        ),
        (
            "effect = [\n  { kind = \"spring\", at = \"q\" }, # soft\n  # end\n]",
            "effect = [\n  { kind = \"spring\", at = \"q\" }, # soft\n  { N },\n  # end\n]",
        ),
    ] {
        let (text, loaded) = add(&with_effects(old), &friction).unwrap();
        let new = new.replace(
            "{ N }",
            "{ name = \"coulomb_friction_motor\", kind = \"coulomb_friction\", at = [\"motor\"] }",
        );
        assert_eq!(text, with_effects(&new));
        assert_eq!(loaded.mechanism.effects.last().unwrap().kind, "coulomb_friction");
    }
}

#[test]
fn line_ends_of_other_systems_and_none_at_all() {
    let text = with_effects("").replace('\n', "\r\n");
    let (new, _) = add(&text, &effect("spring", &["q"])).unwrap();
    assert!(is_insertion(&text, &new));
    assert_eq!(new.matches('\n').count(), new.matches("\r\n").count());
    let text = with_effects("").trim_end().to_owned() + " # é, 中";
    let (new, _) = add(&text, &effect("spring", &["q"])).unwrap();
    assert!(new.starts_with(&text) && is_insertion(&text, &new));
}

#[test]
fn a_variant_gets_the_effect_itself() {
    let text = text_of("spidermill-paper.toml");
    let mut placement = effect("lumped_mass_placement", &["R3m", "R3m_right"]);
    placement.parameters.push(NewParameter {
        symbol: "m".to_owned(),
        name: Some("m4".to_owned()),
        nominal: None,
    });
    placement.comment = Some("as a scale would see it\n\u{7}".to_owned());
    let (new, loaded) = add(&text, &placement).unwrap();
    assert!(new.starts_with(&text));
    assert!(new.contains("\n# as a scale would see it\n"));
    assert_eq!(loaded.mechanism.parameters.len(), 8);
    // What stands in the extended file is known as well.
    let tx40 = "schema = 1\nname = \"mine\"\nextends = \"emps.toml\"\n";
    let says = add(tx40, &effect("viscous_friction", &["motor"])).unwrap_err();
    assert!(says.contains("acts at `motor` already"), "{says}");
}

#[test]
fn a_drive_may_be_coupled_with_two_others() {
    let arm = "schema = 1\nname = \"mine\"\nextends = \"puma560.toml\"\n";
    let (text, _) = add(arm, &effect("coupled_drive", &["joint4", "joint5"])).unwrap();
    let (_, loaded) = add(&text, &effect("coupled_drive", &["joint5", "joint6"])).unwrap();
    assert_eq!(loaded.mechanism.effects.len(), 2);
    assert!(loaded.warnings.is_empty());
    let says = add(&text, &effect("coupled_drive", &["joint5", "joint4"])).unwrap_err();
    assert!(says.contains("already"), "{says}");
    // A pair that is written down twice is warned of, whichever comes first.
    let twice = format!("{text}\n[[effect]]\nkind = \"coupled_drive\"\nat = [\"joint5\", \"joint4\"]\n");
    let (_, loaded) = add(&twice, &effect("viscous_friction", &["joint1"])).unwrap();
    let warned = loaded.warnings.iter().any(|w| format!("{w:?}").contains("acts twice"));
    assert!(warned);
}

#[test]
fn a_second_ripple_gets_names_of_its_own() {
    let mut ripple = effect("force_ripple", &["motor"]);
    ripple.constants.push(("pitch".to_owned(), 0.1));
    let (text, _) = add(&with_effects(""), &ripple).unwrap();
    let says = add(&text, &ripple).unwrap_err();
    assert!(says.contains("`force_ripple` acts at `motor` already"), "{says}");
    ripple.constants[0].1 = 0.25;
    let (_, loaded) = add(&text, &ripple).unwrap();
    let names: Vec<&str> = (loaded.mechanism.parameters.iter())
        .map(|one| one.name.as_str())
        .collect();
    assert!(
        names.ends_with(&["As_motor", "Ac_motor", "As_motor_2", "Ac_motor_2"]),
        "{names:?}"
    );
}

#[test]
fn what_cannot_be_is_said() {
    let plain = with_effects("");
    for (new, says) in [
        (
            effect("vicsous_friction", &["motor"]),
            "did you mean `viscous_friction`?",
        ),
        (effect("viscous_friction", &["motr"]), "did you mean `motor`?"),
        (effect("viscous_friction", &["mo\"tor"]), "cannot be a name"),
        (effect("force_ripple", &["motor"]), "needs a value for `pitch`"),
        (effect("viscous_friction", &[]), "acts nowhere"),
        (effect("coupled_drive", &["motor"]), "takes two places"),
        (effect("rod_inertia", &["motor"]), "cannot act here"),
        (effect("point_mass", &["motor"]), "cannot act here"),
        (effect("gravity_tilt", &["motor"]), "acts on `base`"),
        (effect("time_delay", &["base"]), "acts on `force`"),
        (effect("untied_part", &["lnk"]), "did you mean `link`?"),
    ] {
        let found = add(&plain, &new).unwrap_err();
        assert!(found.contains(says), "{found}");
    }
    let mut new = effect("viscous_friction", &["motor"]);
    new.constants.push(("vs".to_owned(), 0.1));
    assert!(
        add(&plain, &new)
            .unwrap_err()
            .contains("unknown constant `vs` of `viscous_friction`")
    );
    new.constants.clear();
    new.parameters.push(NewParameter {
        symbol: "Fv".to_owned(),
        nominal: Some(f64::NAN),
        ..NewParameter::default()
    });
    assert!(add(&plain, &new).unwrap_err().contains("a finite number is expected"));
    let broken = add_effect("effect = 3", &effect("spring", &["q"])).unwrap_err();
    assert!(matches!(broken, EditFailure::Effect(says) if says.contains("not a list of tables")));
    assert!(add_effect("a = [", &effect("spring", &["q"])).is_err());
}

/// A fault of an effect that is in no file yet has no line there: it is shown in the effect's own text, and what the file
/// holds stays in its lines.
#[test]
fn faults_of_a_new_effect_are_shown_in_its_own_text() {
    let inline = ARM.replace(
        "name = \"arm\"\n",
        "name = \"arm\"\neffect = [{ kind = \"viscous_friction\", at = [\"motor\"] }]\n",
    );
    let inline = format!("{inline}{REST}");
    let table = format!("{ARM}{REST}\n[[effect]]\nkind = \"viscous_friction\"\nat = [\"motor\"]\n\n# the end\n");
    for text in [format!("{ARM}{REST}"), inline, table] {
        let lines = text.lines().count();
        let says = add(&text, &effect("spring", &["nowhere"])).unwrap_err();
        assert!(
            says.contains("--> the effect to be added:") && !says.contains("here.toml:"),
            "{says}"
        );
        let mut shared = effect("coulomb_friction", &["motor"]);
        shared.parameters.push(NewParameter {
            symbol: "Fc".to_owned(),
            name: Some("g".to_owned()),
            nominal: None,
        });
        let says = add(&text, &shared).unwrap_err();
        assert!(says.contains("--> the effect to be added:"), "{says}");
        // Where `g` is defined is a line of the file, and holds it.
        let place = says.split("here.toml:").nth(1).expect("the other place");
        let line: usize = place.split(':').next().unwrap().parse().unwrap();
        assert!(line <= lines, "{says}");
        assert!(text.lines().nth(line - 1).unwrap().starts_with("g = "), "{says}");
    }
}

/// Every kind of the library can be written into a model where there is a place for it.
#[test]
fn every_kind_can_be_added() {
    let spidermill = text_of("spidermill.toml");
    for kind in library() {
        let at: &[&str] = match kind.mechanics {
            Some(Mechanics::Placement) => &["R3m"],
            Some(Mechanics::Strut) => &["B_left", "R3m"],
            Some(Mechanics::Part) => &["crank_left"],
            Some(Mechanics::Tilt) => &["base"],
            Some(Mechanics::Delay) => &["force"],
            None if kind.name == "point_mass" => &["R2m"],
            None if kind.name == "counterbalance" => &["theta1"],
            Some(Mechanics::Rod) | None => &["spindle_left", "spindle_right"],
        };
        let mut new = effect(&kind.name, at);
        for constant in kind.constants.iter().filter(|one| one.value.is_none()) {
            new.constants.push((constant.symbol.clone(), 0.05));
        }
        let text = if kind.mechanics == Some(Mechanics::Placement) {
            text_of("spidermill-paper.toml")
        } else {
            spidermill.clone()
        };
        let (edited, loaded) = add(&text, &new).unwrap_or_else(|says| panic!("{}: {says}", kind.name));
        assert!(is_insertion(&text, &edited));
        assert_eq!(loaded.mechanism.effects.len(), 1, "{}", kind.name);
    }
}

/// A library explains itself: what it is, how it is told from its doubles, in words that fit a terminal.
#[test]
fn every_kind_explains_itself() {
    for kind in library() {
        assert!(
            kind.explains.len() > 100 && kind.confused_with.len() > 60,
            "{}",
            kind.name
        );
        for constant in &kind.constants {
            assert!(constant.search.is_some(), "{} {}", kind.name, constant.symbol);
        }
        assert!(
            !kind.explains.contains('\n') && !kind.confused_with.contains('\n'),
            "{}",
            kind.name
        );
    }
}

#[test]
fn libraries_of_ones_own() {
    let seal = "[[effect_kind]]\nname = \"lip_seal\"\non = \"drive\"\nexpression = \"Fl*tanh(rate/v0)\"\n\
                parameters = { Fl = { unit = { torque = \"N m\" }, sign = \"positive\" } }\n\
                constants = { v0 = { unit = { torque = \"rad/s\" }, value = 0.01 } }\nsays = \"A seal.\"\n";
    let text = with_effects("library = \"kinds/mine.toml\"\neffect = [{ kind = \"lip_seal\", at = \"motor\" }]");
    let library = |text: &str| MemoryFiles::default().with_file("some/kinds/mine.toml", text);
    let loaded = load("some/arm.toml", &text, &library(seal)).unwrap();
    assert!(loaded.kinds.iter().any(|kind| kind.name == "lip_seal" && kind.is_own));
    assert_eq!(loaded.sources.paths().count(), 2, "a build script must know it");
    // Faults have their place in the library.
    let faulty = seal.replace("tanh(rate/v0)", "tanh(rte/v0)");
    let failure = load("some/arm.toml", &text, &library(&faulty)).unwrap_err();
    let says = failure.render(false);
    assert!(
        says.contains("some/kinds/mine.toml:4") && says.contains("did you mean `rate`?"),
        "{says}"
    );
    let failure = load("some/arm.toml", &text, &MemoryFiles::default());
    let says = failure.unwrap_err().render(false);
    assert!(
        says.contains("cannot read `some/kinds/mine.toml`") && !says.contains("unknown kind"),
        "{says}"
    );
}

proptest! {
    /// Wherever comments, blanks and line ends stand, the file keeps them, and the effect is there.
    #[test]
    fn all_else_is_kept(
        remarks in prop::collection::vec("[ \\t]{0,3}(#[^\\p{C}]{0,12})?", 30),
        n_effects in 0_usize..3,
        crlf in any::<bool>(),
        open_end in any::<bool>(),
        nominal in prop::option::of(prop::num::f64::NORMAL),
    ) {
        let kinds = ["viscous_friction", "drive_inertia", "force_offset"];
        let mut text = with_effects("");
        for kind in &kinds[..n_effects] {
            text += &["\n[[effect]]\nkind = \"", kind, "\"\nat = [\"motor\"]\n"].concat();
        }
        text.push_str("\n[limits]\n");
        let mut commented = String::new();
        for (line, remark) in text.lines().zip(remarks.iter().cycle()) {
            commented.push_str(line);
            commented.push_str(remark);
            commented.push_str(if crlf { "\r\n" } else { "\n" });
        }
        if open_end {
            commented = commented.trim_end_matches(['\r', '\n']).to_owned();
        }
        let mut new = effect("coulomb_friction", &["motor"]);
        new.parameters.push(NewParameter { symbol: "Fc".to_owned(), name: None, nominal });
        let (edited, loaded) = add(&commented, &new).map_err(TestCaseError::fail)?;
        prop_assert!(is_insertion(&commented, &edited));
        let effects = &loaded.mechanism.effects;
        prop_assert_eq!(effects.len(), n_effects + 1);
        let last = effects.last().unwrap();
        prop_assert_eq!(&last.kind, "coulomb_friction");
        let found = loaded.mechanism.parameters[last.terms[0].parameter.0].nominal;
        prop_assert_eq!(found.to_bits(), nominal.unwrap_or(0.0).to_bits());
    }
}

/// Where places share a value, an effect at some of them is the difference of their values; it is no twin.
#[test]
fn a_place_that_shares_a_value_may_get_its_difference() {
    let shared = "schema = 1\nname = \"mine\"\nextends = \"puma560.toml\"\n\n[[effect]]\nkind = \"viscous_friction\"\n\
                  at = [\"joint1\", \"joint2\", \"joint3\"]\n";
    let (text, loaded) = add(shared, &effect("viscous_friction", &["joint2"])).unwrap();
    assert_eq!(loaded.mechanism.effects.len(), 2);
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    // A second difference at the same place, and one at all places, would have a column that the model has.
    for places in [&["joint2"][..], &["joint1", "joint2", "joint3"][..]] {
        let says = add(&text, &effect("viscous_friction", places)).unwrap_err();
        assert!(says.contains("acts at `joint"), "{says}");
    }
    // Separate effects that name one parameter share it as well.
    let alike = |place: &str| {
        format!(
            "\n[[effect]]\nkind = \"viscous_friction\"\nat = \"{place}\"\nparameters = {{ Fv = {{ name = \"Fv\" }} }}\n"
        )
    };
    let shared = format!(
        "schema = 1\nname = \"mine\"\nextends = \"puma560.toml\"\n{}{}",
        alike("joint1"),
        alike("joint2")
    );
    let (_, loaded) = add(&shared, &effect("viscous_friction", &["joint2"])).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
}

#[test]
fn an_effect_may_lack_parameters_and_has_a_name() {
    let mut spring = effect("two_point_element", &["C", "D"]);
    spring.without = vec!["Fv".to_owned()];
    let text = format!(
        "{ARM}{REST}\n[[point]]\nname = \"C\"\non = \"base\"\nat = [1, 0, 0]\n\n[[point]]\nname = \"D\"\non = \"link\"\nat = [1, 0, 0]\n"
    );
    let (text, loaded) = add(&text, &spring).unwrap();
    assert!(text.contains("name = \"two_point_element_C_D\""), "{text}");
    let symbols: Vec<&str> = loaded.mechanism.effects[0]
        .terms
        .iter()
        .map(|term| term.symbol.as_str())
        .collect();
    assert_eq!(symbols, ["F0", "k"]);
    // A second effect gets a name of its own.
    let (text, _) = add(&text, &effect("two_point_element", &["C", "D"])).err().map_or_else(
        || panic!("the same effect twice"),
        |says| {
            assert!(says.contains("acts at"), "{says}");
            add(&text, &effect("spring", &["q"])).unwrap()
        },
    );
    assert!(text.contains("name = \"spring_q\""));
    for (without, says) in [
        (&["c"][..], "unknown parameter"),
        (&["F0", "k", "Fv"][..], "no parameter"),
    ] {
        let mut wrong = spring.clone();
        wrong.without = without.iter().map(|&name| name.to_owned()).collect();
        let fault = add(
            &format!(
                "{ARM}{REST}\n[[point]]\nname = \"C\"\non = \"base\"\nat = [1, 0, 0]\n\n[[point]]\nname = \"D\"\non = \"link\"\nat = [1, 0, 0]\n"
            ),
            &wrong,
        );
        assert!(
            fault.clone().is_err_and(|fault| fault.contains(says)),
            "{says}: {fault:?}"
        );
    }
}
