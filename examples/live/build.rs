//! Generates the models of this crate.

fn main() {
    modelmill_build::generate("models/*.toml");
}
