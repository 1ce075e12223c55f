//! Numeric simulation of a real machine: a rig file and a trajectory go in, a recording comes out.
//!
//! Rigs replace hardware: complete machines with parallel cranks, rods, friction and sensors, with which reduced
//! models are compared. So they share no mechanics with the derivation: every body moves by itself,
//! joints are equations between bodies, and all numbers are doubles. The pipeline:
//!
//! 1. [`load_file`] - a rig file, checked;
//! 2. [`Trajectory`] - coordinates over time;
//! 3. [`RigTracker`] - poses, rates and accelerations of all bodies, with redundant loops;
//! 4. [`forces`] - forces of the drives, with all effects;
//! 5. [`simulate`] - the readings of the sensors.
//!
//! A [`RigPlant`] is the forward dynamics, for controllers: forces of the drives go in, motion comes out.
#![allow(non_snake_case, reason = "physical quantities carry their frames, as in p_WB_W")]

mod assemble;
mod assemble_sensors;
mod closure;
mod dynamics;
mod effect;
mod effect_by_name;
mod file;
mod joint;
mod kinematics;
mod load;
mod log;
mod mass_properties;
mod massive;
mod merge;
mod noise;
mod pair;
mod plant;
mod plausible;
mod pose;
mod rig;
mod sensor;
mod simulate;
mod trajectory;

pub use closure::JointGap;
pub use dynamics::{ScalarMotion, energy};
pub use effect::{RigEffect, RigLaw, RigPlace, ValueOfKind, ValueSign};
pub use effect_by_name::{EffectFault, EffectPart};
pub use kinematics::{RigMotion, RigPoseError, RigState, RigTracker};
pub use load::{LoadedRig, load, load_file, load_file_with, parse, plain_error, source_span};
pub use log::RigLog;
pub use modelmill_spec::LoadFailure;
pub use noise::GaussianNoise;
pub use pair::{BodyAnchor, PairFunction};
pub use plant::{PlantError, RigPlant};
pub use pose::{BodyMotion, BodyPose};
pub use rig::{Rig, RigBody, RigCoordinate, RigDrive, RigJoint, RigLumpedMass, RigPoint};
pub use sensor::{RigSensors, SensorChannel};
pub use simulate::{
    RigRecording, SimulatedInstant, SimulationError, forces, forces_along, n_instants, place_motion, simulate,
};
pub use trajectory::{CoordinateSamples, Trajectory, TrajectoryError};
