//! The page: one file that needs no other, in the style of all pages. It asks a server, or the mill that it carries.
//!
//! Decision: the editor is a plain text field. Undo, selection and input methods are the browser's own, and
//! findings are inserted by an edit that it can undo. An editor in JavaScript would need a bundler.

use std::fmt::Write as _;
use std::io::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use modelmill::report;
use serde::Serialize;

/// Models and recordings that a page brings along.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Bundle {
    /// Model files: names and texts. They may name each other.
    pub models: Vec<(String, String)>,
    /// Recordings that belong to a model: its name, the recording's, its text, and whether it is kept from the fit.
    pub recordings: Vec<(String, String, String, bool)>,
}

/// The page that a server sends; `nonce` is what lets its scripts run, and no other.
pub(crate) fn page(nonce: &str) -> String {
    let who = include_str!("served.js");
    written("", &format!(" nonce=\"{nonce}\""), "", who)
}

/// The page that has the mill in itself and needs neither server nor network. `module` is the mill as WebAssembly, with the
/// functions and the imports of `in-browser`; nothing that the page is given leaves it, which its policy says.
pub fn alone(module: &[u8], bundle: &Bundle) -> String {
    let policy = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
                  script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; worker-src blob:; style-src 'unsafe-inline'; \
                  img-src data:; base-uri 'none'; form-action 'none'\">\n";
    let bundle = serde_json::to_vec(bundle).unwrap_or_default();
    let mut carried = String::new();
    for (id, bytes) in [("module", module), ("bundle", &bundle)] {
        let _ = writeln!(
            carried,
            "<script type=\"application/gzip\" id=\"{id}\">{}</script>",
            packed(bytes)
        );
    }
    let worker = include_str!("worker.js");
    let _ = write!(
        carried,
        "<script type=\"text/plain\" id=\"worker\">\n{worker}</script>\n"
    );
    written(policy, "", &carried, include_str!("alone.js"))
}

/// Gzip in Base64.
fn packed(bytes: &[u8]) -> String {
    let mut packer = GzEncoder::new(Vec::new(), Compression::best());
    // Memory takes whatever is written to it.
    let _ = packer.write_all(bytes);
    STANDARD.encode(packer.finish().unwrap_or_default())
}

/// Scripts of the workbench alone, in the order in which they run.
const SCRIPTS: [&str; 4] = [
    include_str!("page.js"),
    include_str!("completion.js"),
    include_str!("excitation.js"),
    include_str!("variant.js"),
];

/// `who` is the script that knows who answers.
fn written(head: &str, attributes: &str, carried: &str, who: &'static str) -> String {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{head}\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>modelmill</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n{}{}</style>\n</head>\n{}{carried}",
        report::STYLE,
        include_str!("page.css"),
        include_str!("page.html"),
    );
    for script in [who].into_iter().chain(report::scripts()).chain(SCRIPTS) {
        let _ = write!(page, "\n<script{attributes}>\n{script}</script>");
    }
    page.push_str("\n</body>\n</html>\n");
    page
}
