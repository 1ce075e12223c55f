//! One module for every bundled model file, generated at build.
//!
//! `no_std`, no allocation, no unsafe code; nothing symbolic is left at run time.
#![no_std]

include!(concat!(env!("OUT_DIR"), "/models.rs"));
