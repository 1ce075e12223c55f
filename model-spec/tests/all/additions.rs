//! Effects that join a model as entries mean what the same effects mean in a file.

use std::path::Path;

use modelmill_boundary::files::DiskFiles;
use modelmill_spec::{AddedEffect, ConstantValue, LoadedModel, ModelConstant, load, load_file};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models");

fn paper() -> LoadedModel {
    load_file(&Path::new(FOLDER).join("spidermill-paper.toml")).unwrap()
}

fn constant(name: &str, value: f64, unit: &str) -> ModelConstant {
    ModelConstant {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        is_angle: unit == "rad",
        note: Some(format!("as {name} is")),
    }
}

fn effect(kind: &str, at: &[&str], constants: &[(&str, ConstantValue)]) -> AddedEffect {
    let constants = constants.iter();
    AddedEffect {
        kind: kind.to_owned(),
        at: at.iter().map(|place| (*place).to_owned()).collect(),
        constants: constants
            .map(|(symbol, value)| ((*symbol).to_owned(), value.clone()))
            .collect(),
        ..AddedEffect::default()
    }
}

/// The entry as a variant of the model would write it.
fn text(effect: &AddedEffect) -> String {
    let parameters = effect.parameters.iter();
    let parameters: Vec<String> = parameters
        .map(|(symbol, name)| format!("{symbol} = {{ name = {name:?} }}"))
        .collect();
    let constants: Vec<String> = (effect.constants.iter())
        .map(|(symbol, value)| match value {
            ConstantValue::Number(value) => format!("{symbol} = {value:?}"),
            ConstantValue::Named(name) => format!("{symbol} = {name:?}"),
        })
        .collect();
    let constants = if constants.is_empty() {
        String::new()
    } else {
        format!("constants = {{ {} }}\n", constants.join(", "))
    };
    format!(
        "[[effect]]\nkind = {:?}\nat = {:?}\nparameters = {{ {} }}\n{constants}",
        effect.kind,
        effect.at,
        parameters.join(", ")
    )
}

#[test]
fn mean_what_a_file_means() {
    let named = |name: &str| ConstantValue::Named(name.to_owned());
    let constants = [constant("slow", 0.02, "m/s"), constant("tipped", 0.03, "rad")];
    let mut stribeck = effect("stribeck_friction", &["spindle_left"], &[("vs", named("slow"))]);
    stribeck.parameters = vec![("Fs".to_owned(), "mine".to_owned())];
    let effects = [
        stribeck,
        effect("rod_inertia", &["spindle_left", "spindle_right"], &[]),
        effect("lumped_mass_placement", &["R3m"], &[]),
        effect("untied_part", &["crank_left"], &[]),
        effect(
            "gravity_tilt",
            &["base"],
            &[("tz", named("tipped")), ("tx", ConstantValue::Number(-0.1))],
        ),
        effect("time_delay", &["force"], &[("T", ConstantValue::Number(2.5e-7))]),
    ];
    let mut variant = "schema = 1\nname = \"spidermill_paper\"\nextends = \"spidermill-paper.toml\"\n".to_owned();
    variant.extend(effects.iter().map(text));
    variant.push_str("[constants]\n");
    variant.extend(constants.iter().map(|one| {
        let ModelConstant {
            name,
            value,
            unit,
            note,
            ..
        } = one;
        format!(
            "{name} = {{ value = {value:?}, unit = {unit:?}, note = {:?} }}\n",
            note.as_deref().unwrap_or_default()
        )
    }));
    let written = load(&format!("{FOLDER}/variant.toml"), &variant, &DiskFiles::default()).unwrap();
    let mut joined = paper().with_additions(&constants, &effects).unwrap();
    assert_eq!(joined.effects.len(), paper().mechanism.effects.len() + effects.len());
    joined.name.clone_from(&written.mechanism.name);
    assert_eq!(format!("{joined:#?}"), format!("{:#?}", written.mechanism));
}

#[test]
fn what_cannot_be_is_said() {
    let refused = |constants: &[ModelConstant], effect: AddedEffect| {
        let failure = paper().with_additions(constants, &[effect]).unwrap_err();
        failure.render(false)
    };
    let friction = || effect("coulomb_friction", &["spindle_left"], &[]);
    let mut shared = effect("stribeck_friction", &["spindle_left"], &[]);
    shared.parameters = vec![("Fs".to_owned(), "d1".to_owned())];
    for (constants, effect, expected) in [
        (
            vec![],
            effect("coulomb_friction", &["nowhere"], &[]),
            "unknown place `nowhere`",
        ),
        (vec![], effect("no_friction", &["spindle_left"], &[]), "unknown kind"),
        (vec![constant("d1", 1.0, "m")], friction(), "`d1`"),
        (vec![constant("further", 1.0, "mm")], friction(), "`mm`"),
        (vec![], shared, "`d1`"),
    ] {
        let says = refused(&constants, effect);
        assert!(says.contains(expected), "{says}");
    }
}
