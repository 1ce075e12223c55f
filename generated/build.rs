//! Generates one module for every bundled model file.

fn main() {
    modelmill_build::generate("../model-spec/models/*.toml");
}
