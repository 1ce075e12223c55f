//! Converts the entries of encoders and force sensors to the channels of a rig.

use crate::file::{RigName, SensorEntry};
use crate::load::source_span;
use crate::log::{FileItem, RigLog, above_zero, not_negative};
use crate::sensor::SensorChannel;

/// One channel per name; ideal if no sensor is described. A later sensor replaces an earlier one.
pub(crate) fn channels<'a>(
    items: &[FileItem<SensorEntry>],
    what: &str,
    names: impl Iterator<Item = &'a RigName>,
    log: &mut RigLog,
) -> Vec<SensorChannel> {
    let names: Vec<&str> = names.map(|name| name.get_ref().as_str()).collect();
    // Without a sensor a channel is ideal: no noise, no quantisation, no delay.
    let mut channels = vec![SensorChannel::default(); names.len()];
    for item in items {
        let channel = channel(item, what, log);
        for name in item.entry.of.get_ref() {
            match names.iter().position(|known| known == name.get_ref()) {
                Some(at) => channels[at] = channel,
                None => log.unknown_name(item.file, name, what, &names),
            }
        }
    }
    channels
}

/// The channel of one entry; `what` is `coordinate` for encoders.
fn channel(item: &FileItem<SensorEntry>, what: &str, log: &mut RigLog) -> SensorChannel {
    let (file, entry) = (item.file, &item.entry);
    let mut resolution = not_negative(file, entry.resolution.as_ref(), "a resolution", log);
    // A resolution is given directly, by the bits of an encoder, or by that of a current.
    let ways = usize::from(entry.resolution.is_some())
        + usize::from(entry.bits.is_some())
        + usize::from(entry.current.is_some());
    if ways > 1 {
        log.error(
            source_span(file, &entry.of.span()),
            "this sensor has two resolutions".to_owned(),
            "",
            "give one of `resolution`, `bits` (encoders) and `current` (force sensors)",
        );
    }
    if let Some(bits) = &entry.bits {
        if what != "coordinate" || !(1..=52).contains(bits.get_ref()) {
            log.error(
                source_span(file, &bits.span()),
                "`bits` is not valid here".to_owned(),
                "expected 1 to 52 bits, for an encoder",
                "an encoder with `bits = 20` resolves 2^20 angles per revolution",
            );
        } else {
            // A full revolution, in rad, divided into 2^bits steps.
            resolution = 2.0 * std::f64::consts::PI / (1_u64 << bits.get_ref()) as f64;
        }
    }
    if let Some(current) = &entry.current {
        if what == "coordinate" {
            log.error(
                source_span(file, &entry.of.span()),
                "an encoder does not measure a current".to_owned(),
                "",
                "`current` belongs to a `[[force_sensor]]`",
            );
        }
        // Resolution of a current in A times the force per ampere, N/A or N m/A.
        resolution = above_zero(file, &current.force_per_ampere, "a force per ampere", log)
            * above_zero(file, &current.resolution, "a resolution", log);
    }
    SensorChannel {
        noise: not_negative(file, entry.noise.as_ref(), "a standard deviation of noise", log),
        resolution,
        delay: not_negative(file, entry.delay.as_ref(), "a delay", log),
    }
}
