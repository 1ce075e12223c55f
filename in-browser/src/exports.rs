//! What the host calls by name, and what it lends. Bytes go in through memory that [`reserve`] gives; what is answered stays
//! where it is until the next question.
//!
//! Decision: four functions that pass bytes replace a generator of bindings with its own tool. Ending a worker is
//! the only way to stop a computation; a second worker for diagnoses keeps the text alive.

use std::cell::RefCell;

use modelmill_workbench::Desk;

#[link(wasm_import_module = "mill")]
unsafe extern "C" {
    /// Seconds since some moment.
    safe fn seconds() -> f64;
    /// Hears how far long work is: JSON that begins there and is that long.
    safe fn goes(start: *const u8, length: usize);
}

struct State {
    desk: Desk,
    given: Vec<u8>,
    answer: String,
}

thread_local! {
    static STATE: RefCell<State> = RefCell::new(State {
        desk: Desk::new(|| seconds(), |told| {
            let told = told.to_string();
            goes(told.as_ptr(), told.len());
        }),
        given: Vec::new(),
        answer: String::new(),
    });
}

/// Where the host may write that many bytes before it asks.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(length: usize) -> *mut u8 {
    STATE.with_borrow_mut(|state| {
        state.given = vec![0; length];
        state.given.as_mut_ptr()
    })
}

/// Puts a file on the desk: its name, which is that long, and its bytes.
#[unsafe(no_mangle)]
pub extern "C" fn put(name: usize) {
    STATE.with_borrow_mut(|state| {
        let (name, bytes) = split(&state.given, name);
        state.desk.put(&name, bytes);
    });
}

/// Answers a question, which is that long, and has its body behind it; the length of the answer in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn ask(question: usize) -> usize {
    STATE.with_borrow_mut(|state| {
        let (question, body) = split(&state.given, question);
        state.answer = state.desk.ask(&question, body);
        state.answer.len()
    })
}

/// Where the answer begins: JSON.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    STATE.with_borrow(|state| state.answer.as_ptr())
}

fn split(given: &[u8], head: usize) -> (String, &[u8]) {
    let (head, rest) = given.split_at(head.min(given.len()));
    (String::from_utf8_lossy(head).into_owned(), rest)
}
