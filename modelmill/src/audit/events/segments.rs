//! Segments in motion in which the residual of one drive stands out from its level, with start and end.

use super::levels::DriveResidual;
use super::smoothing::{sample_quantile, true_ranges};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    EVENT_CLOSING_DEVIATIONS, EVENT_LEAST_FORCE_SHARE, EVENT_LONGEST_BRIDGE_S, EVENT_LONGEST_LULL_S,
    EVENT_OPENING_DEVIATIONS,
};

/// A segment of a run in which the residual of one drive stands out.
#[derive(Clone, Debug)]
pub(super) struct DriveSegment {
    /// Index of the drive.
    pub(super) drive: usize,
    /// First sample.
    pub(super) start: usize,
    /// Sample after the last one.
    pub(super) end: usize,
    /// Typical force, with its sign, N or N m.
    pub(super) force: f64,
    /// Force in units of its level, in the form in which it stands out most (1).
    pub(super) deviations: f64,
    /// Whether the residual is not there at similar states.
    pub(super) is_confirmed: bool,
    /// Whether another drive must confirm it.
    pub(super) needs_support: bool,
    /// Whether it lies at standstill and consists of two opposite steps.
    pub(super) is_at_standstill: bool,
}

/// The segments of one drive in motion.
pub(super) fn segments_in_motion(trace: &ResidualTrace, rest: &DriveResidual) -> Vec<DriveSegment> {
    let least = EVENT_LEAST_FORCE_SHARE * rest.force_rms;
    let stands_out: Vec<bool> = (0..trace.samples())
        .map(|i| {
            [&rest.short, &rest.long]
                .iter()
                .any(|form| form.values[i].abs() > (EVENT_OPENING_DEVIATIONS * form.level).max(least))
        })
        .collect();
    let mut segments: Vec<DriveSegment> = Vec::new();
    for core in true_ranges(&stands_out) {
        // A core within the segment of an earlier one is part of it.
        if segments.last().is_some_and(|last| core.end <= last.end) {
            continue;
        }
        segments.extend(grow_segment(trace, rest, core));
    }
    segments
}

/// Extends the core of a segment to its start and end: as far as the residual has its sign and a part of its size.
fn grow_segment(trace: &ResidualTrace, rest: &DriveResidual, core: std::ops::Range<usize>) -> Option<DriveSegment> {
    let largest = |values: &[f64]| -> f64 {
        let all = values[core.clone()].iter();
        all.fold(0.0, |most: f64, x| if x.abs() > most.abs() { *x } else { most })
    };
    let peaks = [largest(&rest.short.values), largest(&rest.long.values)];
    let sign = if peaks[0].abs() > peaks[1].abs() {
        peaks[0]
    } else {
        peaks[1]
    }
    .signum();
    let signed: Vec<f64> = rest.short.values.iter().map(|x| sign * x).collect();
    let shown = core.clone().filter(|i| !rest.is_masked[*i]);
    let height = sample_quantile(shown.map(|i| signed[i]).collect(), 0.7);
    if height <= 0.0 {
        return None;
    }
    let bound = (EVENT_CLOSING_DEVIATIONS * rest.short.level)
        .min(0.5 * height)
        .max(0.2 * height);
    // Where a switch of friction may add to it, half of the height is needed.
    let belongs: Vec<bool> = (0..trace.samples())
        .map(|i| {
            let masked = rest.is_masked[i] && sign * rest.smooth[i] > bound.max(0.5 * height);
            masked || signed[i] > bound
        })
        .collect();
    let lull = trace.sample_count(EVENT_LONGEST_LULL_S, 1);
    let bridge = trace.sample_count(EVENT_LONGEST_BRIDGE_S, 2);
    // The last sample of the segment on the way from the core to one end of the run.
    let extend = |from: usize, way: &mut dyn Iterator<Item = usize>| -> usize {
        let (mut last, mut lulls) = (from, 0);
        for at in way {
            if belongs[at] {
                (last, lulls) = (at, 0);
            } else if rest.is_masked[at] {
                if at.abs_diff(last) > bridge {
                    break;
                }
            } else {
                lulls += 1;
                if lulls > lull {
                    break;
                }
            }
        }
        last
    };
    let start = extend(core.start, &mut (0..core.start).rev());
    let end = extend(core.end - 1, &mut (core.end..belongs.len())) + 1;
    let within = (start..end).filter(|i| belongs[*i] && !rest.is_masked[*i]);
    let typical = sample_quantile(within.map(|i| signed[i]).collect(), 0.5);
    let deviations = [&rest.short, &rest.long].map(|form| {
        let values = form.values[start..end].iter();
        values.fold(0.0_f64, |most, x| most.max(sign * x)) / form.level
    });
    Some(DriveSegment {
        drive: rest.drive,
        start,
        end,
        force: sign * if typical > 0.0 { typical } else { height },
        deviations: deviations[0].max(deviations[1]),
        is_confirmed: false,
        needs_support: false,
        is_at_standstill: false,
    })
}
