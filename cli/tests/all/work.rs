//! The workbench: who may ask, what happens to the file, and a whole sitting in a browser, with the figures that the commands give.

use serde_json::json;

use crate::common::browser::{Browser, Window};
use crate::common::workbench::Workbench;
use crate::common::{self, number, printed, refused, run, scratch};

#[test]
fn only_its_own_page_is_answered() {
    let bench = Workbench::open("guard", "two_link.toml", &[]);
    let host = format!("Host: 127.0.0.1:{}", bench.port);
    let token = format!("X-Modelmill-Token: {}", bench.token);
    let page = format!("GET /?token={}", bench.token);
    let status = |head: &str, headers: &[&str]| {
        let headers: Vec<String> = headers.iter().map(|h| (*h).to_owned()).collect();
        bench.request(head, &headers, "").0
    };
    assert_eq!(status(&page, &[&host]), 200);
    assert_eq!(status("GET /api/view?since=0", &[&host, &token]), 200);
    let origin = format!("Origin: http://127.0.0.1:{}", bench.port);
    assert_eq!(
        status("GET /api/view?since=0", &[&host, &token, &origin]),
        200
    );
    // Without the token, or with another one.
    let other = format!("X-Modelmill-Token: {}", "0".repeat(bench.token.len()));
    assert_eq!(status("GET /", &[&host]), 403);
    assert_eq!(status("GET /?token=", &[&host]), 403);
    assert_eq!(status("GET /api/view?since=0", &[&host]), 403);
    assert_eq!(status("GET /api/view?since=0", &[&host, &other]), 403);
    // Not even to be told that there is nothing.
    assert_eq!(status("GET /nothing", &[&host]), 403);
    // A site whose name was made to lead here, and one that asks openly.
    for name in ["evil.example", "127.0.0.1", "127.0.0.1.evil.example"] {
        let host = format!("Host: {name}");
        assert_eq!(status(&page, &[&host]), 403, "{name}");
        assert_eq!(status("GET /api/view?since=0", &[&host, &token]), 403);
        let origin = format!("Origin: http://{name}");
        assert_eq!(
            status("GET /api/view?since=0", &[&host, &token, &origin]),
            403
        );
    }
    for path in ["edit", "save", "choose", "diagnose", "add"] {
        let head = format!("POST /api/{path}");
        assert_eq!(status(&head, &[&host, &token, "Origin: null"]), 403);
    }
}

#[test]
fn a_text_reaches_no_file_outside() {
    let bench = Workbench::open("fence", "two_link.toml", &[]);
    let outside = bench
        .model
        .parent()
        .expect("a folder")
        .with_file_name("fence-outside.toml");
    std::fs::write(&outside, "secret_of_another = 3\n").expect("a file");
    let text = bench.text();
    for path in [
        "../fence-outside.toml",
        outside.to_str().expect("plain text"),
    ] {
        let words = format!("extends = \"{path}\"\n{text}");
        let base = bench.view()["revision"].clone();
        let (status, told) = bench.ask("edit", &json!({ "base": base, "text": words }));
        assert_eq!((status, &told["valid"]), (200, &json!(false)), "{told:#}");
        let says = told["diagnostics"].to_string();
        assert!(
            says.contains("outside of") && !says.contains("secret_of"),
            "{says}"
        );
    }
    // Nothing was written by all that.
    assert_eq!(bench.text(), text);
}

#[test]
fn nothing_is_overwritten_unseen() {
    let bench = Workbench::open("conflict", "two_link.toml", &[]);
    let old = bench.text();
    let edit = |words: &str| {
        let base = bench.view()["revision"].clone();
        let (status, told) = bench.ask("edit", &json!({ "base": base, "text": words }));
        assert_eq!(status, 200, "{told}");
        told
    };
    // Nothing is written before it is asked for, then all of it.
    let mine = format!("# mine\n{old}");
    assert_eq!(edit(&mine)["changed"], true);
    assert_eq!(bench.text(), old);
    assert_eq!(bench.ask("save", &json!({})).0, 200);
    assert_eq!(bench.text(), mine);
    // An edit that was made of another text is refused.
    let (status, _) = bench.ask("edit", &json!({ "base": 1, "text": "late" }));
    assert_eq!(status, 409);
    // Both change: saving is refused even before the disk was looked at by itself.
    let second = format!("# second\n{mine}");
    edit(&second);
    let theirs = format!("# theirs\n{mine}");
    std::fs::write(&bench.model, &theirs).expect("another program");
    let (status, told) = bench.ask("save", &json!({}));
    assert!(
        status == 422 && told["says"].to_string().contains("another program"),
        "{told}"
    );
    assert_eq!(bench.text(), theirs);
    assert_eq!(bench.view()["conflict"], true);
    let (_, told) = bench.ask("choose", &json!({ "theirs": false }));
    assert_eq!(
        (&told["conflict"], &told["text"]),
        (&json!(false), &json!(second))
    );
    assert_eq!(bench.ask("save", &json!({})).0, 200);
    assert_eq!(bench.text(), second);
    // The other way round.
    edit(&format!("# third\n{second}"));
    std::fs::write(&bench.model, &theirs).expect("another program");
    assert_eq!(bench.ask("save", &json!({})).0, 422);
    let (_, told) = bench.ask("choose", &json!({ "theirs": true }));
    assert_eq!(
        (&told["text"], &told["changed"]),
        (&json!(theirs), &json!(false))
    );
    assert_eq!(bench.text(), theirs);
}

#[test]
fn what_cannot_be_opened_is_said() {
    let says = refused(1, &["work", "no-such-model.toml"]);
    assert!(says.contains("no-such-model.toml"), "{says}");
    let model = common::model("two_link.toml");
    let says = refused(1, &["work", &model, "--data", "no-such-run.csv"]);
    assert!(says.contains("no-such-run.csv"), "{says}");
    let says = refused(2, &["work", &model, "--check", "run.csv"]);
    assert!(says.contains("--data"), "{says}");
}

/// A figure as the page shows it.
fn percent(value: f64) -> String {
    let digits = format!("{:.2e}", 100.0 * value);
    format!("{} %", digits.parse::<f64>().expect("a number"))
}

fn row(browser: &mut Browser, window: &Window, table: &str, row: usize) -> Vec<String> {
    let script = format!(
        "return [...at('{table}').querySelectorAll('tbody tr')[{row}].cells].map((one) => one.textContent);"
    );
    let cells = browser.run(window, &script);
    serde_json::from_value(cells).expect("texts")
}

#[test]
fn a_sitting_from_a_wrong_text_to_the_completed_model() {
    let Some(mut browser) = Browser::start(&scratch("sitting-browser")) else {
        return;
    };
    let (fit, check) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let recordings = ["--data", &*fit, "--check", &*check];
    let bench = Workbench::open("sitting", "spidermill.toml", &recordings);
    let original = bench.text();
    let window = browser.open(&bench.link);
    browser.run(
        &window,
        "await until('equations', () => at('base').tBodies[0].rows.length === 4);
         await until('the picture', () => at('picture').querySelector('svg .joint'));
         await until('errors', () => at('comparison').dataset.revision === at('equations').dataset.revision);",
    );

    let before = compares(&mut browser, &window, &bench, recordings);
    marks_faults_and_changes(&mut browser, &window, &original);
    let command = diagnoses(&mut browser, &window);
    adds_as_the_command_does(&mut browser, &window, &bench, &command, &before);
    assert_eq!(browser.heard, Vec::<String>::new());
}

/// The same figures as the command that is shown, and curves; the error of the identified model on the check run.
fn compares(
    browser: &mut Browser,
    window: &Window,
    bench: &Workbench,
    recordings: [&str; 4],
) -> String {
    let mut command = vec!["identify", bench.path(), "--json"];
    command.extend(recordings);
    let identified = common::json(&command);
    browser.run(window, "tab('comparison');");
    let pointers = ["/nominal/fit", "/nominal/check", "/fit", "/check"];
    let expected = pointers.map(|p| percent(number(&identified, &format!("{p}/nrms"))));
    let shown = row(browser, window, "errors", 0);
    assert_eq!(shown[1..], expected);
    let command = browser.run(window, "return at('command').textContent;");
    let words = command.as_str().expect("a command");
    assert!(
        words.starts_with("modelmill compare ") && words.contains(recordings[1]),
        "{words}"
    );
    // Curves with something in them.
    let longest = browser.run(
        window,
        "at('draw').click();
         await until('curves', () => at('curves').querySelectorAll('svg .curve').length >= 4);
         return Math.min(...[...at('curves').querySelector('details').querySelectorAll('svg .curve')].map((c) => c.getAttribute('d').length));",
    );
    assert!(longest.as_f64().expect("a number") > 500.0, "{longest}");
    expected[3].clone()
}

/// A fault is seen at its line, the last sound model stays in sight, and undoing mends it; what changes is marked.
fn marks_faults_and_changes(browser: &mut Browser, window: &Window, original: &str) {
    browser.run(window, "tab('equations'); select('m2 = {');");
    browser.write(window, "m2 = [");
    let line = 1 + original
        .lines()
        .position(|line| line.starts_with("m2 = {"))
        .expect("m2");
    let marked = browser.run(
        window,
        "await until('a fault', () => at('faults').querySelector('.error'));
         return [[...at('lines').children].findIndex((one) => one.className === 'error') + 1, at('faults').textContent];",
    );
    assert_eq!(marked[0], line, "{marked}");
    assert!(
        marked[1].to_string().contains(&format!("line {line}:")),
        "{marked}"
    );
    browser.run(
        window,
        "at('text').focus(); document.execCommand('undo');
         await until('mended', () => !at('faults').querySelector('.error') && !document.querySelector('.pane.stale'));",
    );
    // A value is changed: what it changes is marked, and the error follows.
    browser.run(window, "select('nominal = 12.4560');");
    browser.write(window, "nominal = 22.4560");
    let changed = browser.run(
        window,
        "await until('changes', () => at('base').querySelectorAll('tr.changed').length === 4);
         await until('errors', () => at('comparison').dataset.revision === at('equations').dataset.revision);
         const values = [...at('base').querySelectorAll('tr.changed td:last-child')].map((one) => one.textContent);
         at('text').focus(); document.execCommand('undo');
         await until('no changes', () => !at('base').querySelector('tr.changed'));
         return values;",
    );
    assert_eq!(changed[0], "61.29", "{changed}");
    let worse = row(browser, window, "errors", 0);
    assert_ne!(worse[1], "", "{worse:?}");
}

/// A diagnosis is cancelled, then runs to its end; the command that adds what it found.
fn diagnoses(browser: &mut Browser, window: &Window) -> String {
    let cancelled = browser.run(
        window,
        "tab('diagnosis'); at('diagnose').click();
         await until('the diagnosis', () => !at('cancel').hidden && at('going').textContent);
         at('cancel').click();
         await until('its end', () => at('cancel').hidden && at('found').textContent);
         return at('found').textContent;",
    );
    assert_eq!(cancelled, "The diagnosis was cancelled.");
    let finding = browser.run(
        window,
        "at('diagnose').click();
         await until('a finding', () => at('found').querySelector('.finding'), 300000);
         return [at('found').querySelectorAll('.finding').length, at('found').querySelector('.finding code').textContent,
                 at('found').querySelectorAll('figure svg .dot').length];",
    );
    assert_eq!(finding[0], 1, "{finding}");
    assert!(
        number(&finding, "/2") >= 4.0,
        "the ladder has its dots: {finding}"
    );
    let command = finding[1].as_str().expect("a command").to_owned();
    assert!(
        command.contains("rod_inertia --at spindle_left,spindle_right"),
        "{command}"
    );
    command
}

/// Added, the text is what the command makes of the file, and the error falls.
fn adds_as_the_command_does(
    browser: &mut Browser,
    window: &Window,
    bench: &Workbench,
    command: &str,
    expected: &str,
) {
    let original = bench.text();
    let added = browser.run(
        window,
        "at('found').querySelector('.finding button').click();
         await until('the effect', () => at('text').value.includes('rod_inertia'));
         tab('ladder');
         await until('a rung', () => at('rungs').tBodies[0].rows.length >= 2 &&
           at('rungs').tBodies[0].rows[1].cells[0].textContent.includes('rod inertia'));
         return at('text').value;",
    );
    assert_eq!(bench.text(), original, "nothing is saved yet");
    let copy = scratch("by-command.toml");
    std::fs::write(&copy, &original).expect("a copy");
    let command = command.replace(bench.path(), &copy);
    let words: Vec<&str> = command.split(' ').skip(1).collect();
    printed(&words);
    let by_command = std::fs::read_to_string(&copy).expect("the copy");
    assert_eq!(added, json!(by_command));
    let rungs: Vec<Vec<String>> = [0, 1].map(|k| row(browser, window, "rungs", k)).into();
    let value = |text: &str| -> f64 { text.trim_end_matches(" %").parse().expect("a percentage") };
    let [before, after] = [0, 1].map(|k| value(&rungs[k][4]));
    assert_eq!(rungs[0][4], expected);
    assert!(after < 1e-3 * before, "{rungs:?}");

    // Undone and done again, then saved by the key.
    browser.run(
        window,
        "at('text').focus(); document.execCommand('undo');
         await until('undone', () => !at('text').value.includes('rod_inertia') && at('base').tBodies[0].rows.length === 4);
         document.execCommand('redo');
         await until('done again', () => at('base').tBodies[0].rows.length > 4);
         document.dispatchEvent(new KeyboardEvent('keydown', { key: 's', ctrlKey: true, cancelable: true }));
         await until('saved', () => at('save').disabled && at('state').textContent.startsWith('saved'));",
    );
    assert_eq!(bench.text(), by_command);
}

#[test]
fn windows_follow_each_other_and_the_disk() {
    let Some(mut browser) = Browser::start(&scratch("windows-browser")) else {
        return;
    };
    let bench = Workbench::open("windows", "two_link.toml", &[]);
    let [one, other] = [(); 2].map(|()| browser.open(&bench.link));
    for window in [&one, &other] {
        browser.run(
            window,
            "await until('equations', () => at('base').tBodies[0].rows.length > 0);",
        );
    }
    // From one window to the other.
    browser.front(&one);
    browser.run(
        &one,
        "at('text').focus(); at('text').setSelectionRange(0, 0);",
    );
    browser.write(&one, "# from one window\n");
    browser.run(
        &other,
        "await until('the edit', () => at('text').value.startsWith('# from one window'));",
    );
    browser.run(
        &one,
        "at('save').click(); await until('saved', () => at('save').disabled);",
    );
    // From the disk to both.
    let theirs = format!("# from outside\n{}", bench.text());
    std::fs::write(&bench.model, &theirs).expect("another program");
    for window in [&one, &other] {
        browser.run(
            window,
            "await until('the change', () => at('text').value.startsWith('# from outside'));
             await until('saved', () => at('state').textContent.startsWith('saved'));",
        );
    }
    // Both change: neither is lost, and it is said.
    browser.run(
        &one,
        "at('text').focus(); at('text').setSelectionRange(0, 0);",
    );
    browser.write(&one, "# mine\n");
    browser.run(
        &one,
        "await until('not saved', () => !at('save').disabled);",
    );
    let again = format!("# again\n{theirs}");
    std::fs::write(&bench.model, &again).expect("another program");
    for window in [&one, &other] {
        browser.run(
            window,
            "await until('a word of it', () => !at('banner').hidden);",
        );
    }
    assert_eq!(bench.text(), again);
    browser.run(
        &one,
        "at('save').click();
         await until('a refusal', () => at('says').textContent.includes('another program'));",
    );
    assert_eq!(bench.text(), again);
    browser.run(
        &one,
        "at('mine').click(); await until('a choice', () => at('banner').hidden);
         at('save').click(); await until('saved', () => at('save').disabled);",
    );
    assert_eq!(bench.text(), format!("# mine\n{theirs}"));
    // The answer that a conflict gets is no success, and the browser says so; nothing else may be heard.
    let heard = browser.heard.iter().filter(|says| !says.contains("422"));
    assert_eq!(heard.collect::<Vec<_>>(), Vec::<&String>::new());
}

/// From a keystroke to new equations and p_min, and to the error on a recording of 7 s, as a browser sees it.
#[test]
fn equations_follow_while_one_types() {
    let Some(mut browser) = Browser::start(&scratch("typing-browser")) else {
        return;
    };
    let fit = run("with-rods-fit.csv");
    // Bounds hold for a program that was optimised.
    let cases = [
        (
            "spidermill.toml",
            vec!["--data", &*fit],
            "nominal = 12.4560",
            100.0,
        ),
        ("panda.toml", vec![], "MX = 0.019261", 400.0),
    ];
    for (model, recordings, place, bound) in cases {
        let bench = Workbench::open("typing", model, &recordings);
        let window = browser.open(&bench.link);
        browser.front(&window);
        let has_data = !recordings.is_empty();
        let waits = format!(
            "const done = (before) => at('equations').dataset.revision !== before && !at('equations').classList.contains('stale');
             const compared = () => {} || at('comparison').dataset.revision === at('equations').dataset.revision;",
            !has_data
        );
        browser.run(
            &window,
            &format!("{waits} await until('all', () => at('equations').dataset.revision && compared(), 120000); tab('equations');"),
        );
        let times = browser.run(
            &window,
            &format!(
                "{waits}
                 select('{place}');
                 const end = at('text').selectionEnd;
                 at('text').setSelectionRange(end, end);
                 const times = [[], []];
                 for (let k = 0; k < 40; k++) {{
                   const before = at('equations').dataset.revision;
                   const start = performance.now();
                   if (k % 2) document.execCommand('delete'); else document.execCommand('insertText', false, String(1 + k % 9));
                   await until('equations', () => done(before));
                   times[0].push(performance.now() - start);
                   await until('errors', compared);
                   times[1].push(performance.now() - start);
                 }}
                 return times.map((all) => all.sort((a, b) => a - b)[37]);"
            ),
        );
        eprintln!("{model}: equations and error within {times} ms (p95 of 40 keystrokes)");
        let most = number(&times, "/0").max(number(&times, "/1"));
        assert!(
            cfg!(debug_assertions) || most < bound,
            "{model}: {times} ms"
        );
    }
}
