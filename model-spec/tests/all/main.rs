//! Model files: what is read, what is refused and with which words, and what is written back.

mod additions;
mod closures;
mod edit;
mod faulty;
mod fuzz;
mod mistakes;
mod models;
