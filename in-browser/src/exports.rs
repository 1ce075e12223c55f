//! The functions that the host calls by name, and those that it provides. Bytes go in through the memory of
//! [`reserve`]. A response stays in place until the next request.
//!
//! Decision: four functions that pass bytes replace a generator of bindings with its own tool. Ending a worker is the
//! only way to stop a computation; with a second worker for diagnoses the editor stays responsive.

use std::cell::RefCell;

use modelmill_workbench::RequestHandler;

#[link(wasm_import_module = "mill")]
unsafe extern "C" {
    /// Seconds since a fixed but unspecified moment.
    safe fn seconds() -> f64;
    /// Receives the progress of long work: `length` bytes of JSON at `start`.
    safe fn goes(start: *const u8, length: usize);
}

/// The state between calls.
struct BrowserState {
    /// Answers requests; it has the files and the session.
    request_handler: RequestHandler,
    /// Memory for the input of the next call.
    given: Vec<u8>,
    /// The last response.
    answer: String,
}

thread_local! {
    // A worker is single-threaded, so one state per thread is one state per module.
    static STATE: RefCell<BrowserState> = RefCell::new(BrowserState {
        request_handler: RequestHandler::new(|| seconds(), |response| {
            let response = response.to_string();
            goes(response.as_ptr(), response.len());
        }),
        given: Vec::new(),
        answer: String::new(),
    });
}

/// Reserves memory into which the host writes the input of the next call; returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(length: usize) -> *mut u8 {
    STATE.with_borrow_mut(|state| {
        state.given = vec![0; length];
        state.given.as_mut_ptr()
    })
}

/// Adds a file. The input is its name, of `name` bytes, and its contents.
#[unsafe(no_mangle)]
pub extern "C" fn put(name: usize) {
    STATE.with_borrow_mut(|state| {
        let (name, bytes) = split_input(&state.given, name);
        state.request_handler.add_file(&name, bytes);
    });
}

/// Answers a request. The input is the name of the request, of `question` bytes, and its body. Returns the length of
/// the response in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn ask(question: usize) -> usize {
    STATE.with_borrow_mut(|state| {
        let (question, body) = split_input(&state.given, question);
        state.answer = state.request_handler.answer_request(&question, body);
        state.answer.len()
    })
}

/// The address of the response, as JSON.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    STATE.with_borrow(|state| state.answer.as_ptr())
}

/// Splits the input into its head of `head` bytes, as text, and the rest.
fn split_input(given: &[u8], head: usize) -> (String, &[u8]) {
    let (head, rest) = given.split_at(head.min(given.len()));
    (String::from_utf8_lossy(head).into_owned(), rest)
}
