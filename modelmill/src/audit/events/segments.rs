//! Segments in motion in which the residual of one drive stands out from its level, with start and end.

use std::ops::Range;

use super::levels::SearchedResidual;
use super::smoothing::{sample_quantile, true_ranges};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    ALONE_MOST_MASKED_SHARE, EVENT_CLOSING_DEVIATIONS, EVENT_LEAST_FORCE_SHARE, EVENT_LONGEST_BRIDGE_S,
    EVENT_LONGEST_LULL_S, EVENT_OPENING_DEVIATIONS, GROUP_LEAST_CONTRAST, HUGE_LEAST_DEVIATIONS,
    SHARP_HIDDEN_LEAST_DEVIATIONS, SHARP_LEAST_CONTRAST, SHARP_LEAST_DEVIATIONS,
};

/// Time beyond the smoothed start and end in which the true ones are searched, s.
const EDGE_SEARCH_S: f64 = 0.1;

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
    /// Share of its samples that show no contact (1).
    pub(super) masked_share: f64,
    /// How much the residual changes at its start and its end, in units of its force (1); the smaller one of both.
    pub(super) edge_contrast: f64,
    /// Whether the residual is not there at similar states.
    pub(super) is_confirmed: bool,
    /// Whether another drive must confirm it.
    pub(super) needs_support: bool,
    /// Whether it lies at standstill and consists of two opposite steps.
    pub(super) is_at_standstill: bool,
}

impl DriveSegment {
    /// Whether it begins and ends at once and is shown for the most part: friction that switches does not look so.
    pub(super) fn is_sharp(&self) -> bool {
        let is_shown = self.masked_share < ALONE_MOST_MASKED_SHARE && self.deviations > SHARP_LEAST_DEVIATIONS;
        let is_clear = is_shown || self.deviations > SHARP_HIDDEN_LEAST_DEVIATIONS;
        let is_huge = self.deviations > HUGE_LEAST_DEVIATIONS && self.edge_contrast > GROUP_LEAST_CONTRAST;
        is_huge || (is_clear && self.edge_contrast > SHARP_LEAST_CONTRAST)
    }
}

/// The segments of one drive in motion.
pub(super) fn segments_in_motion(trace: &ResidualTrace, rest: &SearchedResidual) -> Vec<DriveSegment> {
    let least = EVENT_LEAST_FORCE_SHARE * rest.force_rms;
    let stands_out: Vec<bool> = (0..trace.samples())
        .map(|i| {
            rest.forms
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

/// Extends the core of a segment to its start and end: as far as the residual has its sign and a part of its size, in
/// the shortest form in which it stands out.
fn grow_segment(trace: &ResidualTrace, rest: &SearchedResidual, core: Range<usize>) -> Option<DriveSegment> {
    let least = EVENT_LEAST_FORCE_SHARE * rest.force_rms;
    let (form, peak) = rest.forms.iter().find_map(|form| {
        let values = form.values[core.clone()].iter();
        let peak = values.fold(0.0, |most: f64, x| if x.abs() > most.abs() { *x } else { most });
        (peak.abs() > (EVENT_OPENING_DEVIATIONS * form.level).max(least)).then_some((form, peak))
    })?;
    let sign = peak.signum();
    let signed: Vec<f64> = form.values.iter().map(|x| sign * x).collect();
    let shown = core.clone().filter(|i| !rest.is_masked[*i]);
    let height = sample_quantile(shown.map(|i| signed[i]).collect(), 0.7);
    if height <= 0.0 {
        return None;
    }
    let bound = (EVENT_CLOSING_DEVIATIONS * form.level)
        .min(0.5 * height)
        .max(0.2 * height);
    // Where a switch of friction may add to it, half of the height is needed.
    let belongs: Vec<bool> = (0..trace.samples())
        .map(|i| {
            let masked = rest.is_masked[i] && sign * rest.smooth[i] > bound.max(0.5 * height);
            masked || signed[i] > bound
        })
        .collect();
    let wide = extended_range(trace, rest, &core, &belongs);
    let range = sharpened_range(trace, rest, wide, sign);
    let within = range.clone().filter(|i| !rest.is_masked[*i]);
    let typical = sample_quantile(within.map(|i| sign * rest.smooth[i]).collect(), 0.5);
    let deviations = rest.forms.iter().map(|form| {
        let values = form.values[range.clone()].iter();
        values.fold(0.0_f64, |most, x| most.max(sign * x)) / form.level
    });
    Some(DriveSegment {
        drive: rest.drive,
        force: sign * if typical > 0.0 { typical } else { height },
        deviations: deviations.fold(0.0, f64::max),
        start: range.start,
        end: range.end,
        masked_share: 0.0,
        edge_contrast: 0.0,
        is_confirmed: false,
        needs_support: false,
        is_at_standstill: false,
    })
}

/// The range about a core over which the residual belongs to it, with lulls and masked samples of some length.
fn extended_range(
    trace: &ResidualTrace,
    rest: &SearchedResidual,
    core: &Range<usize>,
    belongs: &[bool],
) -> Range<usize> {
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
    start..extend(core.end - 1, &mut (core.end..belongs.len())) + 1
}

/// The range whose start and end are where the residual passes half of its height: of all starts near the given one that
/// with the largest sum of what exceeds the half, and the end alike. Smoothing does not shift them.
fn sharpened_range(trace: &ResidualTrace, rest: &SearchedResidual, wide: Range<usize>, sign: f64) -> Range<usize> {
    let shown = wide.clone().filter(|i| !rest.is_masked[*i]);
    let height = sample_quantile(shown.map(|i| sign * rest.smooth[i]).collect(), 0.6);
    if height <= 0.0 {
        return wide;
    }
    let near = trace.sample_count(EDGE_SEARCH_S, 1);
    let middle = wide.start.midpoint(wide.end);
    let excess = |i: usize| (sign * rest.values[i]).clamp(-height, 2.0 * height) - 0.5 * height;
    let best = |way: &mut dyn Iterator<Item = usize>, from: usize| {
        let (mut sum, mut most, mut at) = (0.0, 0.0, from);
        for i in way {
            sum += excess(i);
            if sum > most {
                (most, at) = (sum, i);
            }
        }
        at
    };
    let first = wide.start.saturating_sub(near);
    let last = (wide.end + near).min(trace.samples());
    let start = best(&mut (first..middle).rev(), middle);
    start..best(&mut (middle..last), middle) + 1
}
