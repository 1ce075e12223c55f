//! The targets: one for each format that the program reads.

use crate::budget::ReaderBudget;
use crate::readers::{
    read_closures, read_description, read_fit, read_library, read_mesh, read_model, read_plan, read_recording,
    read_recording_of, read_rig,
};

/// A reader with its corpus.
#[derive(Clone, Copy, Debug)]
pub struct FuzzTarget {
    /// Its name, which is also that of its folder in `fuzz/corpus`.
    pub name: &'static str,
    /// Files of the repository from which mutations start, relative to its root; `*` at the end of a name stands for
    /// any ending.
    pub seeds: &'static [&'static str],
    /// Reads bytes; a panic is a finding.
    pub run: fn(&[u8]),
}

/// All targets.
pub const TARGETS: [FuzzTarget; 20] = [
    target(
        "csv",
        &[
            "identify/tests/fixtures/run.csv",
            "identify/tests/fixtures/readers/*.csv",
            "identify/tests/fixtures/readers/*.txt",
        ],
        csv,
    ),
    target("parquet", &["identify/tests/fixtures/run-*.parquet"], parquet),
    target(
        "matlab",
        &[
            "identify/tests/fixtures/run-v6.mat",
            "identify/tests/fixtures/run-v7.mat",
        ],
        matlab,
    ),
    target(
        "hdf5",
        &[
            "identify/tests/fixtures/run-*.h5",
            "identify/tests/fixtures/run-v73.mat",
        ],
        hdf5,
    ),
    target("mcap", &["identify/tests/fixtures/run-*.mcap"], mcap),
    target(
        "rosbag2",
        &[
            "identify/tests/fixtures/run-*.db3",
            "identify/tests/fixtures/readers/humble.db3",
        ],
        rosbag2,
    ),
    target("rosbag1", &["identify/tests/fixtures/readers/ros1-*.bag"], rosbag1),
    target("gzip", &["identify/tests/fixtures/run.csv.gz"], gzip),
    target("zstd", &["identify/tests/fixtures/run.csv.zst"], zstd),
    target("recording", &["identify/tests/fixtures/run*"], recording),
    target("urdf", &[], urdf),
    target("mjcf", &[], mjcf),
    target("sdf", &[], sdf),
    target("closures", &[], closures),
    target("mesh", &[], mesh),
    target("model", &["model-spec/models/*.toml"], model),
    target("library", &["model-spec/library/*.toml"], library),
    target("rig", &["model-spec/rigs/spidermill-*.toml"], rig),
    target("plan", &["model-spec/rigs/spidermill-plan.toml"], plan),
    target("fit", &[], fit),
];

/// A target.
const fn target(name: &'static str, seeds: &'static [&'static str], run: fn(&[u8])) -> FuzzTarget {
    FuzzTarget { name, seeds, run }
}

/// Memory of formats with pages, chunks or windows of stated sizes, bytes.
const PAGES: usize = 400 << 20;
const USUAL: ReaderBudget = ReaderBudget::USUAL;
const PAGED: ReaderBudget = ReaderBudget::USUAL.with_memory(PAGES);

/// Text.
pub fn csv(input: &[u8]) {
    read_recording(input, USUAL);
}

/// Parquet.
pub fn parquet(input: &[u8]) {
    read_recording_of(b"PAR1", input, PAGED);
}

/// MATLAB up to version 7.
pub fn matlab(input: &[u8]) {
    read_recording_of(b"MATLAB 5.0 MAT-file", input, PAGED);
}

/// HDF5 and MATLAB 7.3.
pub fn hdf5(input: &[u8]) {
    read_recording_of(b"\x89HDF\r\n\x1a\n", input, PAGED);
}

/// MCAP.
pub fn mcap(input: &[u8]) {
    read_recording_of(b"\x89MCAP0\r\n", input, PAGED);
}

/// Bags of ROS 2 in `SQLite`.
pub fn rosbag2(input: &[u8]) {
    read_recording_of(b"SQLite format 3\0", input, PAGED);
}

/// Bags of ROS 1.
pub fn rosbag1(input: &[u8]) {
    read_recording_of(b"#ROSBAG V2.0\n", input, PAGED);
}

/// Text packed by gzip.
pub fn gzip(input: &[u8]) {
    read_recording_of(b"\x1f\x8b\x08", input, PAGED);
}

/// Text packed by Zstandard.
pub fn zstd(input: &[u8]) {
    read_recording_of(b"\x28\xb5\x2f\xfd", input, PAGED);
}

/// A recording of any format.
pub fn recording(input: &[u8]) {
    read_recording(input, PAGED);
}

/// URDF.
pub fn urdf(input: &[u8]) {
    read_description(input, ReaderBudget::DESCRIPTION);
}

/// MJCF.
pub fn mjcf(input: &[u8]) {
    read_description(input, ReaderBudget::DESCRIPTION);
}

/// SDF.
pub fn sdf(input: &[u8]) {
    read_description(input, ReaderBudget::DESCRIPTION);
}

/// A file of closures, `robot.yaml`.
pub fn closures(input: &[u8]) {
    read_closures(input, ReaderBudget::DESCRIPTION);
}

/// A mesh of an MJCF: STL, OBJ or MSH.
pub fn mesh(input: &[u8]) {
    read_mesh(input, ReaderBudget::DESCRIPTION);
}

/// A model file.
pub fn model(input: &[u8]) {
    read_model(input, USUAL);
}

/// A library of kinds of effects.
pub fn library(input: &[u8]) {
    read_library(input, USUAL);
}

/// A rig file.
pub fn rig(input: &[u8]) {
    read_rig(input, USUAL);
}

/// A plan of a reduction.
pub fn plan(input: &[u8]) {
    read_plan(input, USUAL);
}

/// A fit.
pub fn fit(input: &[u8]) {
    read_fit(input, USUAL);
}
