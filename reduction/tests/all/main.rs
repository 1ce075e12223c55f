//! From a rig and a plan, or from a URDF, to a model file.

mod approximations;
mod couplings;
mod export;
mod faulty;
mod mjcf;
mod spidermill;
mod urdf;
mod welds;
mod zoo;
