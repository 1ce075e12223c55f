//! Writes the page that contains the program: `cargo run -p modelmill-in-browser -- try.html`.

use std::process::ExitCode;

#[cfg(not(target_family = "wasm"))]
fn main() -> ExitCode {
    match run() {
        Ok(says) => {
            println!("{says}");
            ExitCode::SUCCESS
        }
        Err(says) => {
            eprintln!("{says}");
            ExitCode::FAILURE
        }
    }
}

/// Compiles the module and writes the page; returns the text for standard output.
#[cfg(not(target_family = "wasm"))]
fn run() -> Result<String, String> {
    use modelmill_in_browser::make;

    let mut arguments = std::env::args_os().skip(1);
    let (Some(target), None) = (arguments.next(), arguments.next()) else {
        return Err("expected one argument: the path of the page to write, such as `try.html`".to_owned());
    };
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let builds = program.ancestors().nth(2).unwrap_or(&program);
    let module = make::build_module("page", builds)?;
    let page = make::build_page(&module)?;
    std::fs::write(&target, &page).map_err(|e| format!("{}: {e}", target.display()))?;
    let size = std::fs::metadata(&module).map_or(0, |module| module.len());
    Ok(format!(
        "{}: {:.2} MB, contains {:.2} MB of WebAssembly (compressed)",
        target.display(),
        page.len() as f64 / 1e6,
        size as f64 / 1e6
    ))
}

#[cfg(target_family = "wasm")]
fn main() -> ExitCode {
    ExitCode::FAILURE
}
