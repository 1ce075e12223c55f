//! A workbench that a test opens.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use super::{modelmill, scratch};

/// A workbench that serves a copy of a bundled model. It ends with this value.
pub(crate) struct Workbench {
    pub(crate) child: Child,
    pub(crate) link: String,
    pub(crate) port: u16,
    pub(crate) token: String,
    pub(crate) model: PathBuf,
}

impl Workbench {
    #[track_caller]
    pub(crate) fn open(name: &str, model: &str, recordings: &[&str]) -> Self {
        Self::open_as(name, model, |path| {
            let mut command = modelmill(&["work", path, "--json"]);
            command.args(recordings);
            command
        })
    }

    /// The same with variables of the environment.
    #[track_caller]
    pub(crate) fn open_with(name: &str, model: &str, variables: &[(&str, String)]) -> Self {
        Self::open_as(name, model, |path| {
            let mut command = modelmill(&["work", path, "--json"]);
            command.envs(variables.iter().map(|(name, value)| (name, value)));
            command
        })
    }

    /// The same with at most this number of open files.
    #[track_caller]
    pub(crate) fn open_limited(name: &str, model: &str, most_files: u32) -> Self {
        Self::open_as(name, model, |path| {
            let program = modelmill(&[]).get_program().to_owned();
            let mut command = Command::new("sh");
            command.args(["-c", &format!("ulimit -n {most_files} && exec \"$0\" \"$@\"")]);
            command.arg(program).args(["work", path, "--json"]);
            command
        })
    }

    /// A workbench that the command starts for the path of the model.
    #[track_caller]
    fn open_as(name: &str, model: &str, command: impl FnOnce(&str) -> Command) -> Self {
        let folder = PathBuf::from(scratch(name));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a folder");
        let file = folder.join(model);
        std::fs::copy(super::model(model), &file).expect("a copy");
        let path = file.to_str().expect("plain text");
        let (child, link, port, token) = Self::served(command(path));
        Self {
            port,
            token,
            child,
            link,
            model: file,
        }
    }

    /// Opens the same file once more, after the program has ended.
    pub(crate) fn again(&mut self) {
        let path = self.path().to_owned();
        (self.child, self.link, self.port, self.token) = Self::served(modelmill(&["work", &path, "--json"]));
    }

    /// The program with its link, port and token.
    #[track_caller]
    fn served(mut command: Command) -> (Child, String, u16, String) {
        let mut child = command.stdout(Stdio::piped()).spawn().expect("the program starts");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut told = String::new();
        while !told.contains('}') {
            assert!(out.read_line(&mut told).expect("a line") > 0, "{told}");
        }
        let told: Value = serde_json::from_str(&told).expect("JSON");
        let link = told["url"].as_str().expect("a link").to_owned();
        let rest = link.strip_prefix("http://127.0.0.1:").expect("loopback");
        let (port, token) = rest.split_once("/?token=").expect("a token");
        let (port, token) = (port.parse().expect("a port"), token.to_owned());
        (child, link, port, token)
    }

    /// What a question is answered; `None` where the program ended meanwhile, or says no.
    pub(crate) fn told(port: u16, own: &[String], question: &str, body: &str) -> Option<Value> {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
        let head = format!(
            "POST /api/{question} HTTP/1.1\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: {}\r\n{}\r\n\r\n",
            body.len(),
            own.join("\r\n")
        );
        stream.write_all(head.as_bytes()).ok()?;
        stream.write_all(body.as_bytes()).ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        let (head, body) = answer.split_once("\r\n\r\n")?;
        head.starts_with("HTTP/1.1 200").then_some(())?;
        serde_json::from_str(body).ok()
    }

    pub(crate) fn path(&self) -> &str {
        self.model.to_str().expect("plain text")
    }

    pub(crate) fn text(&self) -> String {
        std::fs::read_to_string(&self.model).expect("the model")
    }

    /// Status and text of a bare request.
    pub(crate) fn request(&self, head: &str, headers: &[String], body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        let mut text = format!("{head} HTTP/1.1\r\nConnection: close\r\nContent-Type: application/json\r\n");
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

    pub(crate) fn own(&self) -> [String; 2] {
        let host = format!("Host: 127.0.0.1:{}", self.port);
        [host, format!("X-Modelmill-Token: {}", self.token)]
    }

    /// What the page would be told.
    #[track_caller]
    pub(crate) fn ask(&self, path: &str, body: &Value) -> (u16, Value) {
        let head = format!("POST /api/{path}");
        let (status, text) = self.request(&head, &self.own(), &body.to_string());
        let told = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{path}: {text}"));
        (status, told)
    }

    pub(crate) fn view(&self) -> Value {
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
