//! Pages of every kind, held in a hand, in the dark and on paper: nothing is cut, nothing is wider than the screen, nothing
//! scrolls or is folded on paper, and all text can be told from its ground.

use serde_json::Value;

use crate::common::browser::{Browser, Medium, Window};
use crate::common::workbench::Workbench;
use crate::common::{model, printed, run, scratch};
use crate::experiment;

fn texts(value: &Value) -> Vec<String> {
    serde_json::from_value(value.clone()).expect("texts")
}

/// A phone, a screen, and A4 with its margins, in pixels of the style.
const PHONE: u32 = 390;
const SCREEN: u32 = 1400;
const PAPER: u32 = 700;

/// Gives what is wrong with a page once it stands still: pictures are drawn anew some frames after a window changes, and nobody
/// knows when on a busy machine. What stays wrong for some seconds is wrong.
fn settled(asked: &str) -> String {
    format!(
        "const start = performance.now();
         for (;;) {{
           await new Promise((done) => setTimeout(done, 250));
           const wrong = {asked};
           if (!wrong.length || performance.now() - start > 8000) return wrong;
         }}"
    )
}

/// Looks at a page on everything that it may be shown on, with all that is folded open; on paper it opens by itself.
#[track_caller]
pub(crate) fn check(browser: &mut Browser, window: &Window, what: &str) {
    browser.front(window);
    let unfold = "for (const one of document.querySelectorAll('details')) one.open = true;";
    let fold = "for (const one of document.querySelectorAll('details')) one.open = false;";
    for width in [PHONE, SCREEN] {
        for medium in [Medium::Light, Medium::Dark] {
            browser.show(window, width, medium);
            browser.run(window, unfold);
            let wrong = browser.run(window, &settled("window.measure(false)"));
            let none: [&str; 0] = [];
            assert_eq!(texts(&wrong), none, "{what}, {width} wide");
            let counted = browser.run(window, "return window.faint().counted;");
            assert!(counted.as_u64().is_some_and(|n| n > 20), "{what}: {counted}");
            let faint = browser.run(window, &settled("window.faint().found"));
            assert_eq!(texts(&faint), none, "{what}, {medium:?}");
            let nameless = browser.run(window, "return window.nameless();");
            assert_eq!(texts(&nameless), none, "{what}");
        }
    }
    browser.run(window, fold);
    browser.show(window, PAPER, Medium::Paper);
    let wrong = browser.run(window, &settled("window.measure(true)"));
    assert_eq!(texts(&wrong), Vec::<String>::new(), "{what}, on paper");
    browser.show(window, SCREEN, Medium::Light);
}

#[test]
fn written_pages_fit_every_screen_and_paper() {
    let Some(mut browser) = Browser::start(&scratch("pages-browser")) else {
        return;
    };
    let folder = scratch("pages");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = |name: &str| format!("{folder}/{name}");
    let (robot, arm) = (model("spidermill.toml"), model("panda.toml"));
    let (fit, other) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let pages = [
        ("equations of the robot", file("robot.html")),
        ("equations of the arm", file("arm.html")),
        ("atlas", file("atlas.html")),
        ("report", file("report.html")),
        ("runs", file("runs.html")),
        ("experiment", file("experiment.html")),
    ];
    for (model, out) in [(&robot, &pages[0].1), (&arm, &pages[1].1)] {
        printed(&["equations", model, "--format", "html", "--out", out]);
    }
    let delta = model("five_bar.toml");
    printed(&["atlas", &robot, &delta, &arm, "--out", &folder]);
    printed(&["report", &robot, "--data", &fit, "--check", &other, "--out", &folder]);
    printed(&["runs", &robot, "--data", &fit, &other, "--out", &folder]);
    std::fs::write(file("experiment.html"), experiment::page()).expect("the page");
    for (what, path) in &pages {
        let window = browser.open(&format!("file://{path}"));
        check(&mut browser, &window, what);
    }
    assert_eq!(browser.heard, Vec::<String>::new());
}

#[test]
fn the_workbench_fits_every_screen_and_paper() {
    let Some(mut browser) = Browser::start(&scratch("pages-work-browser")) else {
        return;
    };
    let (fit, other) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let bench = Workbench::open("pages-work", "spidermill.toml", &["--data", &fit, "--check", &other]);
    let window = browser.open(&bench.link);
    browser.run(
        &window,
        "await until('equations', () => at('base').tBodies[0].rows.length === 4);
         await until('the picture', () => at('picture').querySelector('svg .joint'));
         await until('errors', () => at('comparison').dataset.revision === at('equations').dataset.revision);
         tab('comparison'); at('draw').click(); at('places').click();
         await until('curves', () => at('curves').querySelector('svg .curve') && at('where').children.length);
         tab('equations'); at('write').click();
         await until('equations written out', () => at('written').querySelector('math'));",
    );
    let panes = browser.run(
        &window,
        "return [...at('tabs').children].map((one) => one.dataset.pane);",
    );
    let panes = texts(&panes);
    assert!(panes.len() >= 5, "{panes:?}");
    for pane in panes {
        // What is being made anew is pale until it is there.
        let ready = "await until('all of it', () => !document.querySelector('#both.stale, #costs.stale'));";
        browser.run(&window, &format!("tab('{pane}'); {ready}"));
        check(&mut browser, &window, &format!("the workbench, {pane}"));
    }
    assert_eq!(browser.heard, Vec::<String>::new());
}
