//! The page of benchmarks says what the code counts now; without timing anything.

use std::path::Path;

use modelmill_tests::counts::{self, HEADINGS};
use modelmill_tests::fixtures::derived;

#[test]
fn the_page_of_benchmarks_has_the_operations_that_are_counted_now() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide/src/benchmarks.md");
    let page = std::fs::read_to_string(&file)
        .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let rows = counts::read(&page, &HEADINGS);
    let models = counts::bundled();
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
