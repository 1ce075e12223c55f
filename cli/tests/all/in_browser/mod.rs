//! The mill as WebAssembly, in a page that is opened from the disk and under Node: it derives, diagnoses and adds with the
//! figures of the program.

mod node;

use std::path::PathBuf;

use modelmill_in_browser::make;
use serde_json::Value;

use crate::common::browser::{Browser, Window};
use crate::common::{self, model, number, run, scratch};

/// The module, built now; `None`, with the reason, where this machine has no compiler for it.
fn module() -> Option<PathBuf> {
    if let Some(why) = make::missing_target() {
        assert!(std::env::var_os("MODELMILL_WASM_REQUIRED").is_none(), "{why}");
        eprintln!("skipped: {why}");
        return None;
    }
    let program = PathBuf::from(env!("CARGO_BIN_EXE_modelmill"));
    let builds = program.ancestors().nth(2).expect("a folder of builds");
    Some(make::build_module("page-test", builds).unwrap_or_else(|says| panic!("{says}")))
}

/// The page around the module; `None`, with the reason, where none can be built. `MODELMILL_PAGE` names a page to look at
/// in its place, such as one that was made for size.
fn page() -> Option<String> {
    if let Some(own) = std::env::var_os("MODELMILL_PAGE") {
        return Some(own.into_string().expect("a path of plain text"));
    }
    let made = make::build_page(&module()?).unwrap_or_else(|says| panic!("{says}"));
    let path = scratch("try.html");
    std::fs::write(&path, made).expect("the page");
    Some(path)
}

#[test]
fn the_mill_in_a_page_gives_the_figures_of_the_program() {
    let folder = scratch("page-browser");
    if crate::common::browser::found().is_none() {
        return;
    }
    let Some(page) = page() else { return };
    let Some(mut browser) = Browser::start(&folder) else {
        return;
    };
    let window = browser.open(&format!("file://{page}#spidermill"));
    browser.front(&window);
    browser.run(
        &window,
        "await until('equations', () => at('base').tBodies[0].rows.length === 4, 120000);
         await until('the picture', () => at('picture').querySelector('svg .joint'));
         await until('errors', () => at('comparison').dataset.revision === at('equations').dataset.revision, 120000);",
    );

    // A fault at its line, and mended.
    browser.run(&window, "select('m2 = {');");
    browser.write(&window, "m2 = [");
    let line = browser.run(
        &window,
        "await until('a fault', () => at('faults').querySelector('.error'));
         const line = [...at('lines').children].findIndex((one) => one.className === 'error') + 1;
         const text = at('text').value.split('\\n')[line - 1];
         at('text').focus(); document.execCommand('undo');
         await until('mended', () => !at('faults').querySelector('.error') && !document.querySelector('.pane.stale'));
         return text;",
    );
    assert!(line.as_str().is_some_and(|line| line.starts_with("m2 = [")), "{line}");

    // What is found, beside the program; the text can be edited meanwhile, and a diagnosis ended.
    let found = browser.run(
        &window,
        "tab('diagnosis'); at('diagnose').click();
         await until('it goes on', () => !at('cancel').hidden && at('going').textContent);
         at('cancel').click();
         await until('its end', () => at('cancel').hidden && at('found').textContent.includes('cancelled'));
         const start = performance.now();
         at('diagnose').click();
         await until('a finding', () => at('found').querySelector('.finding'), 600000);
         const seconds = (performance.now() - start) / 1000;
         const told = await window.mill.ask('diagnosis', {});
         return { ...told.found, seconds };",
    );
    let (fit, check) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let own = model("spidermill.toml");
    let expected = common::json(&["diagnose", &own, "--data", &fit, "--check", &check, "--json"]);
    let mut numbers = 0;
    for part in ["verdict", "noise_floor", "budget", "steps", "effects"] {
        numbers += alike(&expected[part], &found[part], part);
    }
    assert!(numbers > 20, "{numbers} numbers were compared");
    eprintln!("try.html diagnoses the robot in {:.1} s", number(&found, "/seconds"));

    // Added, the error falls.
    let errors = browser.run(
        &window,
        "at('found').querySelector('.finding button').click();
         await until('the effect', () => at('text').value.includes('rod_inertia'));
         tab('steps');
         await until('a step', () => [...at('step-errors').tBodies[0].rows].some((row) => row.cells[0].textContent.includes('rod inertia')), 120000);
         return [...at('step-errors').tBodies[0].rows].map((row) => [row.cells[0].textContent, parseFloat(row.cells[4].textContent)]);",
    );
    assert!(
        errors[1][0].as_str().is_some_and(|what| what.contains("rod inertia")),
        "{errors}"
    );
    assert!(number(&errors, "/1/1") < 1e-3 * number(&errors, "/0/1"), "{errors}");

    tells_what_the_addition_costs(&mut browser, &window);
    crate::pages::check(&mut browser, &window, "the page with the mill");

    // Another model from the list.
    let seconds = browser.run(
        &window,
        "window.confirm = () => true;
         at('bundled').value = 'panda.toml'; at('bundled').dispatchEvent(new Event('change'));
         await until('the Panda', () => at('file').textContent === 'panda.toml' && at('base').tBodies[0].rows.length > 30, 120000);
         return parseFloat(at('state').textContent.match(/derived in ([0-9.]+) ms/)[1]) / 1000;",
    );
    let base = browser.run(
        &window,
        "return [...at('base').tBodies[0].rows].map((row) => row.cells[1].textContent);",
    );
    let checked = common::json(&["check", &model("panda.toml"), "--json"]);
    let rows = base.as_array().expect("rows").len();
    assert_eq!(checked["base_parameters"], rows);
    eprintln!("try.html derives the Panda in {seconds} s");
    assert_eq!(browser.heard, Vec::<String>::new());
}

/// The pane of variants: the text with what was added, beside the file as it was.
fn tells_what_the_addition_costs(browser: &mut Browser, window: &Window) {
    let costs = browser.run(
        window,
        "tab('variant');
         await until('costs', () => at('costs').textContent.includes('What makes the difference') && at('both').querySelector('svg .joint'), 120000);
         const { along, entries } = await window.mill.ask('variant', { beside: null });
         const shares = along.drives.map((one) => one.products.reduce((sum, product) => sum + product.share, 0));
         return { shares, errors: along.errors, entries, models: [...at('beside').options].map((one) => one.value) };",
    );
    for k in 0..2 {
        let share = number(&costs, &format!("/shares/{k}"));
        assert!((share - 1.0).abs() < 1e-6, "{costs}");
    }
    assert!(costs["entries"].to_string().contains("rod_inertia"), "{costs}");
    assert!(costs["models"].to_string().contains("spidermill-paper.toml"), "{costs}");
}

/// Compares numbers and texts, and counts the numbers: sines come from another library in the page, and what is told of a rest
/// of 4e-7 of the forces has seven digits fewer.
fn alike(here: &Value, there: &Value, place: &str) -> usize {
    match (here, there) {
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => (a.iter().zip(b).enumerate())
            .map(|(k, (a, b))| alike(a, b, &format!("{place}[{k}]")))
            .sum(),
        (Value::Object(a), Value::Object(b)) => (a.iter())
            .filter(|(name, _)| !name.contains("command") && *name != "separate_by")
            .map(|(name, a)| alike(a, &b[name], &format!("{place}.{name}")))
            .sum(),
        (Value::Number(a), Value::Number(b)) => {
            let [a, b] = [a, b].map(|n| n.as_f64().expect("a number fits"));
            assert!(
                (a - b).abs() <= 1e-7 * a.abs().max(b.abs()),
                "{place}: {a} by the program, {b} in the page"
            );
            1
        }
        _ => {
            assert_eq!(here, there, "{place}");
            0
        }
    }
}
