//! The workbench shows nothing that is not so: alerts end with their cause, windows show what is saved, a picture that does not
//! follow is marked, arrows have a scale.

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use serde_json::{Value, json};

use crate::common::browser::{Browser, Window};
use crate::common::workbench::Workbench;
use crate::common::{model, modelmill, number, run, scratch};

/// Waits for equations and, if there is a recording, for its motion.
fn wait_for_page(browser: &mut Browser, window: &Window, has_data: bool) {
    let script = format!(
        "await until('equations', () => at('base').tBodies[0].rows.length > 0);
         await until('a recording', () => {} || !at('motion').hidden);",
        !has_data
    );
    browser.run(window, &script);
}

/// A text that has faults while work on it is under way leaves no alert once it is valid again.
#[test]
fn an_alert_ends_with_its_cause() {
    let Some(mut browser) = Browser::start(&scratch("alert-browser")) else {
        return;
    };
    let fit = run("with-rods-fit.csv");
    let bench = Workbench::open("alert", "spidermill.toml", &["--data", &fit]);
    let window = browser.open(&bench.link);
    browser.front(&window);
    wait_for_page(&mut browser, &window, true);
    let says = browser.run(
        &window,
        "const rest = (ms) => new Promise((done) => setTimeout(done, ms));
         const type = (words) => { at('text').focus(); document.execCommand('insertText', false, words); };
         at('text').setSelectionRange(at('text').value.length, at('text').value.length);
         for (const pause of [150, 250, 300, 350]) {
           const before = at('equations').dataset.revision;
           type('\\n# a comment\\n');
           await until('the comment', () => at('equations').dataset.revision !== before);
           await rest(pause);
           type('x = [');
           await rest(250);
           for (let k = 0; k < 5; k++) document.execCommand('delete');
           await until('a valid text', () => !document.querySelector('.pane.stale'));
           await rest(300);
         }
         await rest(1500);
         return at('says').hidden ? '' : at('says').textContent;",
    );
    assert_eq!(says, "");
}

/// The text that a window shows.
fn shown(browser: &mut Browser, window: &Window) -> String {
    let text = browser.run(window, "return at('text').value;");
    text.as_str().expect("a text").to_owned()
}

/// Waits until all windows and the program have one text; returns it.
fn wait_for_one_text(browser: &mut Browser, windows: [&Window; 2], bench: &Workbench) -> String {
    for _ in 0..200 {
        let server = bench.view()["text"].as_str().expect("a text").to_owned();
        if windows.iter().all(|window| shown(browser, window) == server) {
            return server;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    panic!("the windows show different texts");
}

/// Types in a window at the place after `piece`, without waiting for the program.
fn type_after(browser: &mut Browser, window: &Window, piece: &str, words: &str) {
    let script = format!(
        "const text = at('text'), end = text.value.indexOf('{piece}') + '{piece}'.length;
         text.focus(); text.setSelectionRange(end, end);
         document.execCommand('insertText', false, '{words}');"
    );
    browser.run(window, &script);
}

/// Two windows in which somebody types at the same time end with one text, which has both edits; what is saved is what is shown.
#[test]
fn two_windows_show_one_text() {
    let Some(mut browser) = Browser::start(&scratch("merging-browser")) else {
        return;
    };
    let bench = Workbench::open("merging", "two_link.toml", &[]);
    let [one, other] = [(); 2].map(|()| browser.open(&bench.link));
    for window in [&one, &other] {
        wait_for_page(&mut browser, window, false);
    }
    // Different lines: both edits are kept, digit by digit.
    for digit in 1..=9 {
        type_after(&mut browser, &one, "value = 0.5", &digit.to_string());
        type_after(&mut browser, &other, "q2 = { nominal = 0.8", &(10 - digit).to_string());
    }
    let text = wait_for_one_text(&mut browser, [&one, &other], &bench);
    for piece in ["value = 0.5987654321", "nominal = 0.8123456789"] {
        assert!(text.contains(piece), "{piece}\n{text}");
    }
    // The same line: no number that nobody typed, one text, and a sentence in the window whose edit is not in it.
    type_after(&mut browser, &one, "q1 = { nominal = 0.4", "1");
    type_after(&mut browser, &other, "q1 = { nominal = 0.4", "2");
    let text = wait_for_one_text(&mut browser, [&one, &other], &bench);
    // The edit that arrives first stays. If it arrived in the other window before the second digit was typed there, the
    // second edit is one of the new text.
    if !text.contains("nominal = 0.421 }") {
        let is_first = text.contains("nominal = 0.41 }");
        assert!(is_first || text.contains("nominal = 0.42 }"), "{text}");
        let loser = if is_first { &other } else { &one };
        let told = browser.run(loser, "return at('says').textContent;");
        assert!(told.to_string().contains("Undo"), "{told}");
    }
    // Saved at the moment of an edit in the other window: the file has what the window shows when it says so.
    type_after(&mut browser, &one, "M = 4.2", "5");
    type_after(&mut browser, &other, "M = 2.1", "7");
    let saved = browser.run(
        &other,
        "at('save').click();
         await until('an answer', () => at('state').textContent.startsWith('saved') || !at('says').hidden && at('says').textContent.startsWith('Nothing is saved'));
         if (!at('state').textContent.startsWith('saved')) {
           at('save').click();
           await until('saved', () => at('state').textContent.startsWith('saved'));
         }
         return at('text').value;",
    );
    assert_eq!(saved.as_str(), Some(&*bench.text()));
    // A save of a text that is not the current one is refused.
    let (status, _) = bench.ask("save", &json!({ "base": 1 }));
    assert_eq!(status, 409);
}

/// A pose that was set by hand survives an edit, the sliders have the limits of the file, and a picture of another pose is marked.
#[test]
fn a_pose_is_kept_and_its_limits_are_those_of_the_file() {
    let Some(mut browser) = Browser::start(&scratch("pose-browser")) else {
        return;
    };
    let fit = run("with-rods-fit.csv");
    let bench = Workbench::open("pose", "spidermill.toml", &["--data", &fit]);
    let window = browser.open(&bench.link);
    browser.front(&window);
    wait_for_page(&mut browser, &window, true);
    let found = browser.run(
        &window,
        "const limits = await window.mill.ask('limits', {});
         const inputs = [...at('coordinates').querySelectorAll('input')];
         const ranges = inputs.map((one) => [Number(one.min), Number(one.max)]);
         const drawn = async (work) => {
           const before = at('picture').dataset.drawn;
           work();
           await until('a picture', () => at('picture').dataset.drawn !== before);
         };
         await until('a picture', () => at('picture').dataset.drawn);
         const set = (input, value) => { input.value = value; input.dispatchEvent(new Event('input')); };
         await drawn(() => set(inputs[0], Number(inputs[0].value) + 0.05));
         // An answer to an earlier request may be drawn first, so the picture is that which stays.
         const settled = async () => {
           for (;;) {
             const shown = at('picture').innerHTML;
             await new Promise((done) => setTimeout(done, 500));
             if (at('picture').innerHTML === shown) { return shown; }
           }
         };
         const value = inputs[0].value, picture = await settled();
         select('nominal = 12.4560');
         document.execCommand('insertText', false, 'nominal = 12.5560');
         await until('the edit', () => at('base').querySelectorAll('tr.changed').length);
         await new Promise((done) => setTimeout(done, 1500));
         const kept = at('coordinates').querySelector('input').value === value;
         document.execCommand('undo');
         await until('no edit', () => !at('base').querySelector('tr.changed'));
         await drawn(() => at('names').dispatchEvent(new Event('change')));
         // An answer that was under way may be drawn before the last one.
         let isSame = false;
         for (let k = 0; k < 200 && !isSame; k++) {
           isSame = at('picture').innerHTML === picture;
           await new Promise((done) => setTimeout(done, 50));
         }
         // Beyond reach the picture is of another pose and looks so.
         const input = at('coordinates').querySelector('input');
         Object.assign(input, { min: -100, max: 100 });
         let isMarked = false;
         for (let k = 0; k < 40 && !isMarked; k++) {
           set(input, Number(value) + 0.1 * k);
           await new Promise((done) => setTimeout(done, 60));
           isMarked = at('picture').classList.contains('stale') && at('says').textContent.includes('last pose');
         }
         await drawn(() => set(input, Number(value)));
         return { limits: limits.map((one) => one.position), ranges, kept, isSame, isMarked,
                  isStillMarked: at('picture').classList.contains('stale') || !at('says').hidden };",
    );
    for k in 0..2 {
        for end in ["0", "1"] {
            let [range, limit] = ["ranges", "limits"].map(|name| number(&found, &format!("/{name}/{k}/{end}")));
            assert!((range - limit).abs() < 1e-9, "{found}");
        }
    }
    for (what, expected) in [
        ("kept", true),
        ("isSame", true),
        ("isMarked", true),
        ("isStillMarked", false),
    ] {
        assert_eq!(found[what], expected, "{what}: {found}");
    }
}

/// The key of the arrows has the largest force with its unit, and the colour of each arrow is that of its error in the key.
#[test]
fn arrows_of_forces_have_a_scale() {
    let Some(mut browser) = Browser::start(&scratch("arrows-browser")) else {
        return;
    };
    let fit = run("with-rods-fit.csv");
    let bench = Workbench::open("arrows", "spidermill.toml", &["--data", &fit]);
    let window = browser.open(&bench.link);
    browser.front(&window);
    wait_for_page(&mut browser, &window, true);
    let found = browser.run(
        &window,
        "const told = await window.mill.ask('motion', {});
         const colour = (one, what) => getComputedStyle(one)[what];
         const seen = [];
         for (const k of [40, 150, 250, 333, 420]) {
           const before = at('picture').dataset.drawn;
           at('time').value = k;
           at('time').dispatchEvent(new Event('input'));
           await until('a picture', () => at('picture').dataset.drawn !== before && at('picture').querySelector('.load'));
           const groups = [...at('picture').querySelectorAll('.load')];
           seen.push({ k, groups: groups.map((one) => [one.getAttribute('class'), one.querySelector('path') && colour(one.querySelector('path'), 'stroke')]) });
         }
         const keys = [...at('load-key').querySelectorAll('span')].map((one) => [one.className, one.textContent, colour(one.firstChild, 'backgroundColor')]);
         return { told, seen, keys, words: at('load-key').textContent, isShown: !at('load-key').hidden };",
    );
    assert_eq!(found["isShown"], true);
    let forces = &found["told"]["runs"][0]["forces"];
    let values = |name: &str, d: usize| -> Vec<f64> {
        let all = forces[name][d].as_array().expect("values");
        all.iter().map(|v| v.as_f64().expect("a number")).collect()
    };
    let largest = (0..2)
        .flat_map(|d| values("measured", d))
        .fold(0.0, |most: f64, v| most.max(v.abs()));
    let words = found["words"].as_str().expect("words");
    let rounded = format!("{largest:.3e}").parse::<f64>().expect("a number");
    assert!(
        words.contains(&format!("The longest arrow is {rounded} N,")),
        "{words} {largest}"
    );
    let keys = found["keys"].as_array().expect("keys");
    assert_eq!(keys.len(), 6, "{keys:?}");
    assert!(keys[1][1].as_str().is_some_and(|says| says == "1 % to 2 %"), "{keys:?}");
    let mut different = Vec::new();
    for moment in found["seen"].as_array().expect("moments") {
        let k = usize::try_from(moment["k"].as_u64().expect("an index")).expect("small");
        let groups = moment["groups"].as_array().expect("arrows");
        for (d, group) in groups.iter().enumerate() {
            let share = values("error", d)[k].abs() / largest;
            let bounds = [0.01, 0.02, 0.05, 0.1, 0.2];
            let shade = bounds.iter().filter(|bound| share >= **bound).count();
            assert_eq!(group[0], format!("load e{shade}"), "{share} {group}");
            if group[1] != Value::Null {
                assert_eq!(group[1], keys[shade][2], "{group} {keys:?}");
            }
            different.push(shade);
        }
    }
    assert!(different.iter().any(|shade| *shade != different[0]), "{different:?}");
}

/// A program that has ended leaves the text in the page, with a sentence that states what to do.
#[test]
fn a_program_that_ended_is_named() {
    let Some(mut browser) = Browser::start(&scratch("ended-browser")) else {
        return;
    };
    let mut bench = Workbench::open("ended", "two_link.toml", &[]);
    let window = browser.open(&bench.link);
    browser.front(&window);
    wait_for_page(&mut browser, &window, false);
    bench.child.kill().expect("a signal");
    bench.child.wait().expect("its end");
    let found = browser.run(
        &window,
        "at('text').focus(); at('text').setSelectionRange(0, 0);
         document.execCommand('insertText', false, '# mine');
         await until('a sentence', () => !at('says').hidden);
         await until('another', () => at('state').textContent.includes('Keep this page open'));
         const blobs = [], create = URL.createObjectURL;
         URL.createObjectURL = (blob) => { blobs.push(blob); return create(blob); };
         at('says').querySelector('button').click();
         const text = await blobs[0].text();
         return [at('says').textContent, at('state').textContent, at('text').value.slice(0, 6), text === at('text').value];",
    );
    for says in [&found[0], &found[1]] {
        let says = says.as_str().expect("a sentence");
        assert!(says.contains("does not answer") && !says.contains("fetch"), "{says}");
    }
    assert_eq!((&found[2], &found[3]), (&json!("# mine"), &json!(true)));
}

/// Named with `--beside`, the other model is what the page shows first. Until the first comparison, its buttons wait.
#[test]
fn the_first_pane_is_the_one_that_was_requested() {
    let Some(mut browser) = Browser::start(&scratch("beside-browser")) else {
        return;
    };
    let (fit, paper) = (run("with-rods-fit.csv"), model("spidermill-paper.toml"));
    let bench = Workbench::open("beside", "spidermill.toml", &["--data", &fit, "--beside", &paper]);
    let window = browser.open(&bench.link);
    browser.front(&window);
    let found = browser.run(
        &window,
        "await until('equations', () => at('base').tBodies[0].rows.length > 0);
         const pane = document.querySelector('#tabs [aria-selected=\"true\"]').dataset.pane;
         const isCompared = Boolean(at('comparison').dataset.revision);
         const waits = at('draw').disabled && at('places').disabled && at('errors').textContent.startsWith('Reading');
         await until('errors', () => at('comparison').dataset.revision);
         return { pane, isHonest: isCompared || waits, isReady: !at('draw').disabled && !at('places').disabled };",
    );
    assert_eq!(found, json!({ "pane": "variant", "isHonest": true, "isReady": true }));
}

/// A derivation that takes long is announced.
#[test]
fn a_long_derivation_is_announced() {
    let path = model("gough_stewart.toml");
    let mut child = modelmill(&["work", &path])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut says = String::new();
    let mut out = BufReader::new(child.stderr.take().expect("a pipe"));
    out.read_line(&mut says).expect("a line");
    child.kill().expect("a signal");
    child.wait().expect("its end");
    assert!(
        says.contains("Deriving the equations of") && says.contains("gough_stewart.toml"),
        "{says}"
    );
}
