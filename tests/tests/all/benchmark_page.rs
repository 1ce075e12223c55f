//! The page of benchmarks says what the code counts now; without timing anything.
//!
//! With `MODELMILL_WRITE_COUNTS=1` the table of operations is written anew, where counts have changed and times need not be
//! measured again.

use std::path::Path;

use modelmill_tests::counts::{self, HEADINGS};
use modelmill_tests::fixtures::derived;

#[test]
fn the_page_of_benchmarks_has_the_operations_that_are_counted_now() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide/src/benchmarks.md");
    let page = std::fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let models = counts::bundled();
    if std::env::var_os("MODELMILL_WRITE_COUNTS").is_some() {
        let rows = models.iter().map(|name| counts::row(name, &derived(name)));
        std::fs::write(&file, with_rows(&page, rows)).expect("the page is written");
        return;
    }
    let rows = counts::read(&page, &HEADINGS);
    let on_page: Vec<&String> = rows.keys().collect();
    assert_eq!(
        on_page,
        models.iter().collect::<Vec<_>>(),
        "the models of the page, and those that are bundled; `cargo bench -p modelmill-tests --bench page` writes it"
    );
    let stale: Vec<String> = models
        .iter()
        .filter_map(|name| {
            let now = counts::row(name, &derived(name));
            let page = &rows[name];
            (*page != now).then(|| format!("{name}:\n  page {page:?}\n  now  {now:?}"))
        })
        .collect();
    assert!(
        stale.is_empty(),
        "`cargo bench -p modelmill-tests --bench page` writes the page anew:\n{}",
        stale.join("\n")
    );
}

/// The page with other rows in its table of operations.
fn with_rows(page: &str, rows: impl Iterator<Item = Vec<String>>) -> String {
    let head = format!("| {} |\n", HEADINGS.join(" | "));
    let (before, rest) = page.split_once(&head).expect("the table of operations");
    let (table, after) = rest.split_once("\n\n").expect("something follows the table");
    let alignment = table.lines().next().expect("a line below the headings");
    let rows: Vec<String> = rows.map(|row| format!("| {} |", row.join(" | "))).collect();
    format!("{before}{head}{alignment}\n{}\n\n{after}", rows.join("\n"))
}
