//! The same test motion for other distances of the base joints, a length that the paper does not print. The size of the
//! error of the paper's treatment relative to the forces depends on it.
//!
//! The consistent treatment represents the rig here, since both agree up to rounding.

use modelmill_identify::PreparedRun;
use modelmill_identify::excite::{ExcitationMotion, FourierSeries};

use crate::bundled;
use crate::study::{DriveErrors, TreatmentRun};
use modelmill::along;
use modelmill::segment::RecordingSegment;
use modelmill::{Host, Outcome};

/// Number of samples of the period.
const SAMPLES: usize = 1000;
/// Distances of the base joints, cm.
const DISTANCES: [i32; 10] = [10, 20, 30, 40, 50, 60, 70, 80, 90, 100];

/// Errors of the paper's treatment for one distance of the base joints.
pub(crate) struct DistanceErrors {
    /// The distance b, m.
    pub(crate) distance: f64,
    /// Errors of each drive.
    pub(crate) errors: Vec<DriveErrors>,
}

/// The errors for every distance at which the loops close along the complete motion.
///
/// Fails only if the user cancels it.
pub(crate) fn scan(host: &Host, series: &[FourierSeries]) -> Outcome<Vec<DistanceErrors>> {
    host.run_job("comparing other distances", DISTANCES.len(), |job| {
        let distances = DISTANCES.iter().map(|cm| f64::from(*cm) / 100.0);
        distances
            .filter_map(|distance| {
                job.add(1);
                errors_at(host, series, distance).ok()
            })
            .collect()
    })
}

/// The errors at one distance; fails if the loops do not close.
fn errors_at(host: &Host, series: &[FourierSeries], distance: f64) -> Outcome<DistanceErrors> {
    // A variant of a bundled model with another constant b.
    let variant = |of: &str| {
        let text = format!(
            "schema = 1\nname = \"other_length\"\nextends = \"{of}\"\n[constants]\nb = {{ value = {distance}, unit = \"m\" }}\n"
        );
        bundled::variant(host, of, "other-length.toml", &text)
    };
    // One period of the motion as a recording without forces.
    let motion = ExcitationMotion::sample(series, SAMPLES);
    let period = series.first().map_or(0.0, FourierSeries::period);
    let time: Vec<f64> = (0..SAMPLES).map(|i| i as f64 * period / SAMPLES as f64).collect();
    let name = format!("the test motion for b = {distance} m");
    let states = [motion.q, motion.qd, motion.qdd];
    let data = RecordingSegment::from(PreparedRun::from_states(name, time, states, None));
    let (paper, consistent) = (variant("spidermill-paper.toml")?, variant("spidermill.toml")?);
    let forces = [
        along::forces(&paper, &data, &paper.values)?,
        along::forces(&consistent, &data, &consistent.values)?,
    ];
    let along = TreatmentRun {
        time: data.time(),
        measured: forces[1].clone(),
        printed: forces[0].clone(),
        calculated: forces.clone(),
        estimated: forces,
    };
    Ok(DistanceErrors {
        distance,
        errors: (0..along.measured.len())
            .map(|d| along.errors(d, &along.calculated[0]))
            .collect(),
    })
}
