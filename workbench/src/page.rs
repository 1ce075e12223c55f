//! The page: one file that needs no other, in the style of all pages.

use modelmill::report;

/// The page's text; `nonce` is what lets its scripts run, and no other.
pub(crate) fn page(nonce: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>modelmill</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n{}{}</style>\n</head>\n\
         {}\n<script nonce=\"{nonce}\">\n{}</script>\n<script nonce=\"{nonce}\">\n{}</script>\n</body>\n</html>\n",
        report::style(),
        include_str!("page.css"),
        include_str!("page.html"),
        report::SCRIPT,
        include_str!("page.js"),
    )
}
