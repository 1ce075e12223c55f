//! The mill against laws, published tables and other programs' numbers; and what the workspace holds itself to.

/// Modules of random mechanisms, see `build.rs`.
#[macro_use]
#[expect(unreachable_pub, dead_code, reason = "emitted for a crate of its own")]
mod random_models {
    include!(concat!(env!("OUT_DIR"), "/random_models.rs"));
}

/// Modules of fixtures, see `build.rs`.
#[expect(unreachable_pub, dead_code, reason = "emitted for a crate of its own")]
#[allow(
    clippy::struct_field_names,
    clippy::used_underscore_binding,
    reason = "names of a model that is made to be awkward"
)]
mod fixture_models {
    include!(concat!(env!("OUT_DIR"), "/fixture_models.rs"));
}

mod awkward_mechanisms;
mod balances;
mod benchmark_page;
mod blocks;
mod build_graph;
mod couplings;
mod dynamics;
mod effects;
mod emitted;
mod floating;
mod flow;
mod loops_in_space;
mod many_states;
mod many_twists;
mod names;
mod near_coincidence;
mod no_numbers;
mod on_request;
mod operation_counts;
mod packages;
mod pinocchio;
mod poses;
mod published_groupings;
mod published_ranks;
mod random_mechanisms;
mod reactions;
mod snapshots;
mod special_values;
mod spidermill;
mod unseen_mechanisms;
