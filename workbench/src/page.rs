//! The page: one self-contained HTML file in the style of all pages. It sends requests to a server, or to the program
//! that it contains as WebAssembly.
//!
//! Decision: the editor is a plain text field. Undo, selection and input methods are the browser's own, and findings
//! are inserted by an edit that it can undo. An editor in JavaScript would need a bundler.

use std::fmt::Write as _;
use std::io::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use modelmill::report;
use serde::Serialize;

/// Models and recordings that a page contains.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PageBundle {
    /// Model files: names and texts. They may include each other.
    pub models: Vec<(String, String)>,
    /// Recordings of a model: name of the model, name and text of the recording, and whether it is a validation run.
    pub recordings: Vec<(String, String, String, bool)>,
}

/// The page that a server sends; only scripts with `nonce` run.
pub(crate) fn served_page(nonce: &str) -> String {
    let who = include_str!("served.js");
    render_page("", &format!(" nonce=\"{nonce}\""), "", who)
}

/// The page that contains the program and needs neither server nor network. `module` is the program as WebAssembly,
/// with the exports and imports of `in-browser`. The page's policy forbids all connections, so no data leave it.
pub fn standalone_page(module: &[u8], bundle: &PageBundle) -> String {
    let policy = "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
                  script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; worker-src blob:; style-src 'unsafe-inline'; \
                  img-src data:; base-uri 'none'; form-action 'none'\">\n";
    let bundle = serde_json::to_vec(bundle).unwrap_or_default();
    let mut carried = String::new();
    for (id, bytes) in [("module", module), ("bundle", &bundle)] {
        let _ = writeln!(
            carried,
            "<script type=\"application/gzip\" id=\"{id}\">{}</script>",
            compress_to_base64(bytes)
        );
    }
    let worker = include_str!("worker.js");
    let _ = write!(
        carried,
        "<script type=\"text/plain\" id=\"worker\">\n{worker}</script>\n"
    );
    render_page(policy, "", &carried, include_str!("alone.js"))
}

/// Compresses with gzip and encodes in Base64.
fn compress_to_base64(bytes: &[u8]) -> String {
    let mut packer = GzEncoder::new(Vec::new(), Compression::best());
    // Writing to memory does not fail.
    let _ = packer.write_all(bytes);
    STANDARD.encode(packer.finish().unwrap_or_default())
}

/// Scripts that only the workbench has, in the order in which they run.
const SCRIPTS: [&str; 6] = [
    include_str!("merge.js"),
    include_str!("page.js"),
    include_str!("diagnosis.js"),
    include_str!("completion.js"),
    include_str!("excitation.js"),
    include_str!("variant.js"),
];

/// Assembles the page. `who` is the script that sends requests: to a server, or to a worker. `attributes` go into each
/// script tag, `carried` is data inside the page.
fn render_page(head: &str, attributes: &str, carried: &str, who: &'static str) -> String {
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
