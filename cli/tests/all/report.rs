//! The page that `report` writes: it holds what `diagnose` says, needs nothing else, and answers to wheel, pointer and
//! keys in a browser.
//!
//! Decision: a page of `report` is tested without the protocol of the developer tools. The test writes a copy with two
//! more scripts: one that collects errors first, and one that uses wheel, pointer and keys last. It reads what they
//! wrote from the dumped document.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::Command;

use crate::common::{browser, html, json, number, printed, refused, run, scratch, workspace};
use serde_json::Value;

fn model(name: &str) -> String {
    crate::common::model(name)
}

/// A folder that is fresh for this test.
fn folder(name: &str) -> String {
    let folder = scratch(name);
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

fn page(arguments: &[&str], out: &str) -> String {
    let mut all = vec!["report"];
    all.extend(arguments);
    all.extend(["--out", out]);
    let says = printed(&all);
    assert!(says.contains(&format!("{out}/report.html")), "{says}");
    std::fs::read_to_string(format!("{out}/report.html")).expect("the page")
}

/// Whether a cell of the page has this number; JSON that was read may be off in the last digit.
fn holds(page: &str, wanted: f64) -> bool {
    let cells = page.split("data-value=\"").skip(1);
    let mut values = cells.filter_map(|cell| cell.split('"').next()?.parse::<f64>().ok());
    values.any(|value| (value - wanted).abs() <= 1e-12 * wanted.abs())
}

#[test]
fn the_page_holds_what_diagnose_says_and_needs_nothing_else() {
    let (file, fit, check) = (
        model("spidermill.toml"),
        run("with-rods-fit.csv"),
        run("with-rods-check.csv"),
    );
    let arguments = [&*file, "--data", &fit, "--check", &check];
    let out = folder("report-rods");
    let page = page(&arguments, &out);
    html::check(&page);
    let mut all = vec!["diagnose"];
    all.extend(arguments);
    all.push("--json");
    let found = json(&all);
    let steps = found["steps"].as_array().expect("steps");
    assert!(steps.len() >= 2, "{found}");
    for step in steps {
        for key in ["/fit", "/check"] {
            assert!(holds(&page, number(step, key)), "{key} of {step}");
        }
    }
    for candidate in found["candidates"].as_array().expect("candidates") {
        // The words of these kinds are not their names.
        let kind = match candidate["kind"].as_str().expect("a kind") {
            "constant_error" => "wrong length or angle".to_owned(),
            "lumped_mass_placement" => "consistent placement of a lumped mass".to_owned(),
            "two_point_element" => "spring or damper between two points".to_owned(),
            "untied_part" => "separate parameters instead of shared ones".to_owned(),
            name => name.replace('_', " "),
        };
        let explained = holds(&page, number(candidate, "/explained"));
        assert!(page.contains(&kind) && explained, "{candidate}");
    }
    for effect in found["effects"].as_array().expect("effects") {
        let kind = effect["kind"].as_str().expect("a kind");
        // Programs of others read these keys.
        let keys: BTreeSet<&str> = effect
            .as_object()
            .expect("an object")
            .keys()
            .map(String::as_str)
            .collect();
        let expected = [
            "kind",
            "at",
            "estimates",
            "probability",
            "support",
            "indistinguishable_from",
            "shared_with",
            "separate_by",
            "separate_command",
        ];
        assert_eq!(keys, BTreeSet::from(expected));
        assert!(page.contains(&format!("modelmill add {file} {kind} --at ")), "{kind}");
    }
    for part in [
        "Error maps",
        "Spectrum of the error",
        "Recordings and their preparation",
        "p_min",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
    // The same input gives the same bytes.
    let again = self::page(&arguments, &folder("report-rods-again"));
    assert_eq!(page, again);
}

#[test]
fn a_long_recording_stays_a_small_page() {
    // The bundled run, with six samples put between each two.
    let text = std::fs::read_to_string(run("with-rods-fit.csv")).expect("the recording");
    let mut lines = text.lines();
    let mut long = format!("{}\n", lines.next().expect("a header"));
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|f| f.parse().expect("a number")).collect())
        .collect();
    for pair in rows.windows(2) {
        for k in 0..7 {
            let share = f64::from(k) / 7.0;
            let between = pair[0].iter().zip(&pair[1]);
            let row: Vec<String> = between.map(|(a, b)| format!("{:e}", a + share * (b - a))).collect();
            long.push_str(&row.join(","));
            long.push('\n');
        }
    }
    let file = scratch("long.csv");
    std::fs::write(&file, long).expect("the recording");
    let page = page(&[&model("spidermill.toml"), "--data", &file], &folder("report-long"));
    html::check(&page);
    assert!(page.contains(">25158<"), "the number of samples");
    assert!(page.len() < 2_000_000, "{} bytes", page.len());
}

#[test]
fn a_folder_that_cannot_be_is_said_before_anything_is_done() {
    let file = scratch("report-in-the-way");
    std::fs::write(&file, "").expect("a file");
    let (model, fit) = (model("spidermill.toml"), run("plain-fit.csv"));
    let says = refused(1, &["report", &model, "--data", &fit, "--out", &format!("{file}/page")]);
    assert!(says.contains("cannot be created") && says.contains("--out"), "{says}");
}

/// Opens a page without a network, lets `exercise.js` use it, and returns what that wrote down; `None` without a
/// browser.
fn used(page: &str, name: &str) -> Option<Value> {
    let browser = browser::found()?;
    let listen = include_str!("../browser/listen.js");
    let exercise = include_str!("../browser/exercise.js");
    let policy = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
                  script-src 'unsafe-inline'; style-src 'unsafe-inline'\">";
    let heard = page
        .replacen("<head>\n", &format!("<head>\n{policy}\n<script>{listen}</script>\n"), 1)
        .replacen(
            "</body>\n</html>",
            &format!("<script>{exercise}</script>\n</body>\n</html>"),
            1,
        );
    assert!(heard.len() > page.len() + listen.len() + exercise.len());
    let file = scratch(&format!("{name}.html"));
    std::fs::write(&file, heard).expect("the page");
    let profile = folder(&format!("{name}-profile"));
    let address = workspace(&file).canonicalize().unwrap_or_else(|_| PathBuf::from(&file));
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        .args(["--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1100,900"])
        .arg(format!("--user-data-dir={profile}"))
        .args(["--virtual-time-budget=60000", "--dump-dom"])
        .arg(format!("file://{}", address.display()))
        .output()
        .expect("the browser starts");
    let text = String::from_utf8_lossy(&output.stdout);
    let result = text
        .rsplit_once("<pre id=\"result\">")
        .and_then(|(_, rest)| rest.split_once("</pre>"))
        .unwrap_or_else(|| {
            panic!(
                "the page wrote nothing down: {}",
                String::from_utf8_lossy(&output.stderr)
            )
        })
        .0;
    let result = result.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    Some(serde_json::from_str(&result).expect("one JSON object"))
}

fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap_or_else(|| panic!("no {key} in {value}"))
}

#[test]
fn plots_are_drawn_and_answer_in_a_browser() {
    let (file, fit, check) = (
        model("spidermill.toml"),
        run("with-rods-fit.csv"),
        run("with-rods-check.csv"),
    );
    let page = page(&[&file, "--data", &fit, "--check", &check], &folder("report-browser"));
    let Some(result) = used(&page, "report-browser-page") else {
        return;
    };
    assert_eq!(list(&result, "heard").len(), 0, "{:?}", result["heard"]);
    // Ladder, curves, regions, maps, spectra: all with something in them.
    let stills = list(&result, "stills");
    assert!(stills.len() >= 10, "{stills:?}");
    for still in stills {
        assert!(
            number(still, "/marks") >= 1.0 && number(still, "/longest") >= 6.0 && number(still, "/height") > 50.0,
            "{still}"
        );
    }
    let runs = list(&result, "runs");
    assert_eq!(runs.len(), 2);
    for run in runs {
        let whole = number(run, "/whole");
        let span = |step: &str| number(run, &format!("/{step}/span"));
        let changed = |step: &str| run[step]["changed"] == true;
        assert!(number(run, "/shortest") > 500.0 && run["curves"] == 3, "{run}");
        assert!(changed("wheel") && span("wheel") < 0.9 * whole, "{run}");
        assert!(changed("drag") && (span("drag") - span("wheel")).abs() < 1e-9, "{run}");
        assert!(number(run, "/drag/from") < number(run, "/wheel/from"), "{run}");
        assert!(
            run["readout"]
                .as_str()
                .is_some_and(|r| r.contains("measured") && r.contains(" s:")),
            "{run}"
        );
        assert!(
            changed("reset") && run["same"] == true && (span("reset") - whole).abs() < 1e-9,
            "{run}"
        );
        assert!(changed("key") && (span("key") - 0.5 * whole).abs() < 1e-9, "{run}");
        assert!(changed("zero") && (span("zero") - whole).abs() < 1e-9, "{run}");
        assert!(changed("mark") && span("mark") < 0.2 * whole, "{run}");
        assert!(changed("button") && (span("button") - whole).abs() < 1e-9, "{run}");
        assert!(changed("hidden") && run["left"] == 2, "{run}");
    }
    let values = |key: &str| -> Vec<f64> {
        list(&result, key)
            .iter()
            .map(|v| v.as_f64().expect("a number"))
            .collect()
    };
    let (falling, rising) = (values("falling"), values("rising"));
    assert!(
        falling.len() > 10 && falling.windows(2).all(|w| w[0] >= w[1]),
        "{falling:?}"
    );
    assert!(rising.windows(2).all(|w| w[0] <= w[1]), "{rising:?}");
    assert!(number(&result, "/wide") <= 0.0, "the page is wider than the window");
}

#[test]
fn the_tour_tells_the_story_and_writes_its_files() {
    let out = folder("tour");
    let story = printed(&["tour", "--out", &out]);
    for part in [
        "p3_min = m3*dc3 + 1/2*d3*m4",
        "Compare: where is the error large?",
        "rod inertia (spindle_left, spindle_right)",
        "+kind = \"rod_inertia\"",
        "Identify again: the error falls",
        "consistent placement of a lumped mass (R3m, R3m_right)",
        "32.1 %",
        "report-paper.html",
    ] {
        assert!(story.contains(part), "{part} in\n{story}");
    }
    // The commands of the story work on the files of the story.
    let edited = format!("{out}/spidermill-completed.toml");
    let fit = format!("{out}/with-rods-fit.csv");
    let check = format!("{out}/with-rods-check.csv");
    let found = json(&["identify", &edited, "--data", &fit, "--check", &check, "--json"]);
    assert!(number(&found, "/check/nrms") < 1e-5, "{found}");
    // 8 kg and 0.9 m: m l^2 / 3 and m l / 2.
    for (expression, truth) in [("Jr", 2.16), ("Sr", 3.6)] {
        let all = list(&found, "parameters");
        let of = |p: &&Value| p["expression"].as_str().is_some_and(|e| e.starts_with(expression));
        let value = number(all.iter().find(of).expect(expression), "/value");
        assert!((value - truth).abs() < 1e-3 * truth, "{expression} {value}");
    }
    for name in ["report.html", "report-paper.html"] {
        let page = std::fs::read_to_string(format!("{out}/{name}")).expect(name);
        html::check(&page);
        if let Some(result) = used(&page, &format!("tour-{name}")) {
            assert_eq!(list(&result, "heard").len(), 0, "{name}: {:?}", result["heard"]);
        }
    }
}
