//! Base parameters from the robot's recording: low-pass filter, emitted regressor in blocks, least squares.

use std::error::Error;

use modelmill_identify::{LeastSquares, filter_and_differentiate};

use crate::control::ControlRecording;
use crate::spidermill_with_friction as model;

/// Cut-off of the low-pass on the readings, Hz.
const CUTOFF: f64 = 20.0;
/// Samples at both ends that are left out, because the filter distorts them.
const ENDS: usize = 150;

/// The base parameters with the least squared error of the forces.
pub(crate) fn identify(recording: &ControlRecording) -> Result<[f64; model::N_BASE], Box<dyn Error>> {
    // Positions are filtered and differentiated twice.
    let mut states = Vec::new();
    for q in &recording.q {
        states.push(filter_and_differentiate(&recording.t, q, CUTOFF, 4)?);
    }
    // The same filter on the forces gives both sides of the equations the same delay.
    let mut forces = Vec::new();
    for force in &recording.forces {
        forces.push(filter_and_differentiate(&recording.t, force, CUTOFF, 4)?.q);
    }
    let n = recording.t.len();
    let inner = ENDS..n - ENDS;
    // Forces are constant during a cycle, so they belong to its middle. There the motion is the mean of two samples.
    let halfway = |x: &[f64]| -> Vec<f64> { inner.clone().map(|i| 0.5 * (x[i] + x[i + 1])).collect() };
    let [q, qd, qdd] =
        [0, 1, 2].map(|what| [0, 1].map(|k| halfway([&states[k].q, &states[k].qd, &states[k].qdd][what])));
    let states = model::States {
        q: q.each_ref().map(|x| &x[..]),
        qd: qd.each_ref().map(|x| &x[..]),
        qdd: qdd.each_ref().map(|x| &x[..]),
    };
    // The regressor is computed for a block of states at once, which uses the vectors of the machine.
    let mut squares = LeastSquares::with_channels(model::N_BASE, model::N_DRIVES);
    let mut fault = None;
    let model = model::Model::new(&model::Geometry::default());
    model.regressor_in_blocks(&states, |block| {
        // Columns of one drive: the factors of every base parameter.
        for (drive, columns) in block.outputs.chunks(model::N_BASE).enumerate() {
            let columns: Vec<&[f64]> = columns.iter().map(|c| &c.0[..block.len]).collect();
            let first = inner.start + block.first;
            let measured = &forces[drive][first..first + block.len];
            if let Err(error) = squares.add_columns(drive, &columns, measured) {
                fault = Some(error);
            }
        }
    })?;
    // An error inside of the closure is returned here.
    if let Some(error) = fault {
        return Err(error.into());
    }
    let values = squares.solve()?.values;
    Ok(std::array::from_fn(|k| values[k]))
}
