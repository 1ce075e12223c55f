//! The workbench: who may ask, what happens to the file, and a whole sitting in a browser, with the figures that the commands give.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Stdio};

use serde_json::{Value, json};

use crate::common::browser::{Browser, Window};
use crate::common::{self, modelmill, number, printed, refused, run, scratch};

/// A workbench that serves a copy of a bundled model. It ends with this value.
struct Workbench {
    child: Child,
    link: String,
    port: u16,
    token: String,
    model: PathBuf,
}

impl Workbench {
    #[track_caller]
    fn open(name: &str, model: &str, recordings: &[&str]) -> Self {
        let folder = PathBuf::from(scratch(name));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a folder");
        let file = folder.join(model);
        std::fs::copy(common::model(model), &file).expect("a copy");
        let path = file.to_str().expect("plain text");
        let mut child = modelmill(&["work", path, "--json"])
            .args(recordings)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut told = String::new();
        while !told.contains('}') {
            assert!(out.read_line(&mut told).expect("a line") > 0, "{told}");
        }
        let told: Value = serde_json::from_str(&told).expect("JSON");
        let link = told["url"].as_str().expect("a link").to_owned();
        let rest = link.strip_prefix("http://127.0.0.1:").expect("loopback");
        let (port, token) = rest.split_once("/?token=").expect("a token");
        Self {
            port: port.parse().expect("a port"),
            token: token.to_owned(),
            child,
            link,
            model: file,
        }
    }

    fn path(&self) -> &str {
        self.model.to_str().expect("plain text")
    }

    fn text(&self) -> String {
        std::fs::read_to_string(&self.model).expect("the model")
    }

    /// Status and text of a bare request.
    fn request(&self, head: &str, headers: &[String], body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        let mut text =
            format!("{head} HTTP/1.1\r\nConnection: close\r\nContent-Type: application/json\r\n");
        let _ = write!(text, "Content-Length: {}\r\n", body.len());
        for header in headers {
            text.push_str(header);
            text.push_str("\r\n");
        }
        stream
            .write_all(format!("{text}\r\n{body}").as_bytes())
            .expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("it answers");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
        let status = head.split(' ').nth(1).expect("a status");
        (status.parse().expect("a number"), body.to_owned())
    }

    fn own(&self) -> [String; 2] {
        let host = format!("Host: 127.0.0.1:{}", self.port);
        [host, format!("X-Modelmill-Token: {}", self.token)]
    }

    /// What the page would be told.
    #[track_caller]
    fn ask(&self, path: &str, body: &Value) -> (u16, Value) {
        let head = format!("POST /api/{path}");
        let (status, text) = self.request(&head, &self.own(), &body.to_string());
        let told = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{path}: {text}"));
        (status, told)
    }

    fn view(&self) -> Value {
        let (status, text) = self.request("GET /api/view?since=0", &self.own(), "");
        assert_eq!(status, 200);
        serde_json::from_str(&text).expect("JSON")
    }
}

impl Drop for Workbench {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

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

/// The text beside the file as saved, beside a model that was named, and beside one of its folder.
#[test]
fn two_variants_stand_side_by_side() {
    let Some(mut browser) = Browser::start(&scratch("variants-browser")) else {
        return;
    };
    let (fit, check) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let paper = common::model("spidermill-paper.toml");
    let given = ["--data", &*fit, "--check", &*check, "--beside", &*paper];
    let bench = Workbench::open("variants", "spidermill.toml", &given);
    let original = bench.text();
    let heavy = bench.model.with_file_name("heavy.toml");
    let heavier = original.replace("12.4560", "92.4560");
    std::fs::write(&heavy, &heavier).expect("a variant");
    // What is no model is no choice.
    std::fs::write(bench.model.with_file_name("notes.toml"), "a = 1\n").expect("a file");

    // No other file is read for it.
    for name in ["../../variants.toml", "/etc/hostname", "none.toml"] {
        let (status, told) = bench.ask("variant", &json!({ "beside": name }));
        assert_eq!(status, 422, "{told}");
    }

    let window = browser.open(&bench.link);
    browser.front(&window);
    // The one that was named comes first.
    let chosen = browser.run(
        &window,
        "await until('equations', () => at('base').tBodies[0].rows.length === 4);
         tab('variant');
         await until('costs', () => at('costs').dataset.revision);
         return [at('beside').value, [...at('beside').options].map((one) => one.value), at('both').querySelectorAll('svg .shadow').length];",
    );
    assert_eq!(chosen[0], paper.as_str());
    assert_eq!(chosen[1], json!(["", paper, "heavy.toml"]));
    assert!(
        number(&chosen, "/2") > 0.0,
        "the other one lies below: {chosen}"
    );
    shows_what_the_command_says(&mut browser, &window);

    // As saved and as edited: nothing at first, then what the edit costs.
    let edited = browser.run(
        &window,
        "const choose = (name) => { at('beside').value = name; at('beside').dispatchEvent(new Event('change')); };
         choose('');
         await until('no difference', () => at('costs').textContent.includes('Both texts are the same'));
         select('12.4560');
         document.execCommand('insertText', false, '92.4560');
         await until('the cost', () => at('costs').textContent.includes('1/2*d3*m4') && at('costs').textContent.includes('now exceeded'));
         const told = await window.mill.ask('variant', { beside: null });
         const rows = [...at('costs').querySelectorAll('table')].find((t) => t.caption.textContent === 'spindle_left').tBodies[0].rows;
         return [told.along, [...rows[0].cells].map((one) => one.textContent), at('command').parentElement.hidden];",
    );
    let told = common::json(&[
        "diff",
        bench.path(),
        heavy.to_str().expect("plain text"),
        "--data",
        &fit,
        &check,
        "--json",
    ]);
    for pointer in [
        "/drives/0/after/peak",
        "/drives/1/difference/rms",
        "/errors/after/nrms",
    ] {
        let [here, there] = [number(&told["along"], pointer), number(&edited[0], pointer)];
        assert!(
            (here - there).abs() <= 1e-12 * here.abs(),
            "{pointer}: {here}, {there}"
        );
    }
    let cells: Vec<String> = serde_json::from_value(edited[1].clone()).expect("texts");
    let shown = |k: usize| cells[k].parse::<f64>().expect("a number");
    let peak = |side: &str| number(&told["along"], &format!("/drives/0/{side}/peak"));
    assert_eq!(cells[0], "peak force, N");
    for (k, side) in [(1, "before"), (2, "after")] {
        assert!(
            (shown(k) - peak(side)).abs() < 1e-3 * peak(side),
            "{cells:?}"
        );
    }
    assert!(cells[3].starts_with('+'), "{cells:?}");
    assert_eq!(edited[2], true, "no command reads what is not saved");

    // The one of the folder is what was typed, by another name.
    browser.run(
        &window,
        "at('beside').value = 'heavy.toml'; at('beside').dispatchEvent(new Event('change'));
         await until('the other', () => at('costs').dataset.beside === 'heavy.toml');
         if (!at('costs').textContent.includes('Both texts are the same')) throw new Error(at('costs').textContent);",
    );
    browser.run(
        &window,
        "at('text').focus(); document.execCommand('undo');
         await until('the difference', () => !at('costs').textContent.includes('Both texts are the same') && !at('costs').classList.contains('stale'));",
    );
    shows_what_the_command_says(&mut browser, &window);

    // A text without a meaning leaves the last figures in sight; a model that moves otherwise is refused with a word.
    let panda = bench.model.with_file_name("panda.toml");
    std::fs::copy(common::model("panda.toml"), panda).expect("a copy");
    let (status, told) = bench.ask("variant", &json!({ "beside": "panda.toml" }));
    assert_eq!(status, 200, "{told}");
    assert!(
        told["refused"].to_string().contains("no active coordinate"),
        "{told}"
    );
    assert_eq!(bench.text(), original, "nothing was saved");
    assert_eq!(browser.heard, Vec::<String>::new());
}

/// The pane's errors and shares are those of the command at its foot.
fn shows_what_the_command_says(browser: &mut Browser, window: &Window) {
    let shown = browser.run(
        window,
        "await until('the command', () => at('command').textContent.startsWith('modelmill diff '));
         const table = (name) => [...at('costs').querySelectorAll('table')].find((t) => t.caption.textContent.startsWith(name));
         const cells = (t, k) => [...t.tBodies[0].rows[k].cells].map((one) => one.textContent);
         return [at('command').textContent, cells(table('Error'), 0), table('What makes').tBodies[0].rows[0].cells[0].firstChild.textContent];",
    );
    let command = shown[0].as_str().expect("a command");
    let mut words: Vec<&str> = command.split(' ').skip(1).collect();
    words.push("--json");
    let told = common::json(&words);
    let errors = ["before", "after"]
        .map(|side| percent(number(&told["along"], &format!("/errors/{side}/nrms"))));
    assert_eq!(shown[1], json!(["all drives", errors[0], errors[1]]));
    let products = told["along"]["drives"][0]["products"]
        .as_array()
        .expect("products");
    let terms = products
        .iter()
        .flat_map(|one| one["terms"].as_array().expect("terms"));
    let largest = terms.max_by(|a, b| {
        number(a, "/share")
            .abs()
            .total_cmp(&number(b, "/share").abs())
    });
    assert_eq!(shown[2], largest.expect("a summand")["term"]);
}
