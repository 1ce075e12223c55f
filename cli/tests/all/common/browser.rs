//! A browser of the machine, and how a test asks it for things: by the protocol of its developer tools, over a pair of pipes.
//!
//! Decision: latencies, two windows and files that change need real time, which a dumped document does not have.
//! The protocol takes some hundred lines and needs no driver program; any Chromium will do.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

/// The browser's path; `None`, with a word about it, where there is none and none is required.
pub(crate) fn found() -> Option<PathBuf> {
    let names = [
        "chromium",
        "chromium-browser",
        "google-chrome",
        "google-chrome-stable",
        "chrome",
    ];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let own = std::env::var_os("MODELMILL_BROWSER").map(PathBuf::from);
    let browser = own
        .into_iter()
        .chain(std::env::split_paths(&folders).flat_map(|folder| names.map(|name| folder.join(name))))
        .find(|path| path.is_file());
    if browser.is_none() {
        assert!(
            std::env::var_os("MODELMILL_BROWSER_REQUIRED").is_none(),
            "a browser is required and there is none"
        );
        eprintln!("The page is not opened: there is no chromium or chrome on the path, nor one in MODELMILL_BROWSER.");
    }
    browser
}

/// A browser that runs, in real time. It ends with this value.
pub(crate) struct Browser {
    child: Child,
    to: File,
    from: BufReader<File>,
    asked: u64,
    /// Faults of pages: exceptions, messages on the console, what a policy forbade.
    pub(crate) heard: Vec<String>,
}

/// A window of the browser.
#[derive(Clone, Debug)]
pub(crate) struct Window(String);

/// What a page is shown on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Medium {
    Light,
    Dark,
    Paper,
}

impl Browser {
    /// Starts a browser that keeps its files in a fresh folder; `None` where there is none.
    pub(crate) fn start(folder: &str) -> Option<Self> {
        let browser = found()?;
        let _ = std::fs::remove_dir_all(folder);
        std::fs::create_dir_all(folder).expect("a folder for the browser");
        let [to, from] = ["to", "from"].map(|name| Path::new(folder).join(name));
        for pipe in [&to, &from] {
            let made = Command::new("mkfifo").arg(pipe).status();
            assert!(made.expect("mkfifo starts").success());
        }
        let child = Command::new("sh")
            .arg("-c")
            .arg(
                "exec \"$0\" --headless --no-sandbox --disable-gpu --disable-dev-shm-usage --no-first-run \
                 --window-size=1400,900 --remote-debugging-pipe --user-data-dir=\"$1/profile\" about:blank \
                 3<\"$1/to\" 4>\"$1/from\"",
            )
            .arg(browser)
            .arg(folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the browser starts");
        let to = File::options().write(true).open(to).expect("a pipe");
        let from = BufReader::new(File::open(from).expect("a pipe"));
        Some(Self {
            child,
            to,
            from,
            asked: 0,
            heard: Vec::new(),
        })
    }

    /// Asks for something and waits for the answer.
    fn ask(&mut self, window: Option<&Window>, method: &str, params: &Value) -> Value {
        self.asked += 1;
        let mut message = json!({ "id": self.asked, "method": method, "params": params });
        if let Some(Window(session)) = window {
            message["sessionId"] = json!(session);
        }
        let text = format!("{message}\0");
        self.to.write_all(text.as_bytes()).expect("the browser listens");
        loop {
            let mut bytes = Vec::new();
            self.from.read_until(0, &mut bytes).expect("the browser answers");
            assert!(bytes.pop().is_some(), "the browser ended");
            let answer: Value = serde_json::from_slice(&bytes).expect("JSON");
            if answer["id"] == self.asked {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
            let event = answer["method"].as_str().unwrap_or_default();
            let params = &answer["params"];
            match event {
                "Runtime.exceptionThrown" => {
                    self.heard.push(params["exceptionDetails"].to_string());
                }
                "Log.entryAdded" if params["entry"]["level"] == "error" => {
                    self.heard.push(params["entry"].to_string());
                }
                _ => {}
            }
        }
    }

    /// Opens a window with a page.
    pub(crate) fn open(&mut self, link: &str) -> Window {
        let target = self.ask(None, "Target.createTarget", &json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let attached = self.ask(None, "Target.attachToTarget", &attach);
        let session = attached["sessionId"].as_str().expect("a session");
        let window = Window(session.to_owned());
        for domain in ["Runtime.enable", "Log.enable", "Page.enable"] {
            self.ask(Some(&window), domain, &json!({}));
        }
        for helpers in [
            include_str!("../../browser/wait.js"),
            include_str!("../../browser/measure.js"),
        ] {
            let script = json!({ "source": helpers });
            let method = "Page.addScriptToEvaluateOnNewDocument";
            self.ask(Some(&window), method, &script);
        }
        self.ask(Some(&window), "Page.navigate", &json!({ "url": link }));
        self.run(
            &window,
            "await until('the page', () => document.readyState === 'complete');",
        );
        window
    }

    /// Shows a window at a width, on a screen that is light or dark or on paper.
    pub(crate) fn show(&mut self, window: &Window, width: u32, medium: Medium) {
        let size = json!({ "width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false });
        self.ask(Some(window), "Emulation.setDeviceMetricsOverride", &size);
        let (media, scheme) = match medium {
            Medium::Light => ("screen", "light"),
            Medium::Dark => ("screen", "dark"),
            Medium::Paper => ("print", "light"),
        };
        let scheme = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        let media = json!({ "media": media, "features": scheme });
        self.ask(Some(window), "Emulation.setEmulatedMedia", &media);
    }

    /// Presses a key of a name, such as `Enter`, with letters that it types.
    pub(crate) fn press(&mut self, window: &Window, key: &str, ctrl: bool) {
        let code = match key {
            "Enter" => 13,
            "Escape" => 27,
            "ArrowUp" => 38,
            "ArrowDown" => 40,
            " " => 32,
            "Tab" => 9,
            _ => 0,
        };
        for kind in ["rawKeyDown", "keyUp"] {
            let event = json!({
                "type": kind, "key": key, "code": if key == " " { "Space" } else { key },
                "windowsVirtualKeyCode": code, "modifiers": if ctrl { 2 } else { 0 },
            });
            self.ask(Some(window), "Input.dispatchKeyEvent", &event);
        }
    }

    /// Brings a window to the front.
    pub(crate) fn front(&mut self, window: &Window) {
        self.ask(Some(window), "Page.bringToFront", &json!({}));
    }

    /// What a piece of script gives in a window, once it is settled.
    #[track_caller]
    pub(crate) fn run(&mut self, window: &Window, script: &str) -> Value {
        let expression = format!("(async () => {{ {script} }})()");
        let asked =
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true, "userGesture": true });
        let answer = self.ask(Some(window), "Runtime.evaluate", &asked);
        let fault = &answer["exceptionDetails"];
        assert!(fault.is_null(), "{script}\n{fault:#}");
        answer["result"]["value"].clone()
    }

    /// Types a text where the caret is.
    pub(crate) fn write(&mut self, window: &Window, text: &str) {
        self.ask(Some(window), "Input.insertText", &json!({ "text": text }));
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
