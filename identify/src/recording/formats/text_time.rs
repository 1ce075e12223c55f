//! Time stamps in text, as ISO 8601 writes them: `2024-05-01T12:00:00.25+02:00` goes in, nanoseconds since 1970 come out.
//!
//! The date and the time of day are separated by `T` or a blank. A fraction of a second may follow a point or a comma.
//! Without a time zone all stamps of a column have the same one, so differences are right.

/// Most digits of the fraction that count; further ones are below a nanosecond.
const FRACTION_DIGITS: usize = 9;

/// Nanoseconds since 1970 of a time stamp; `None` if the text is none, or has a field out of range.
pub(super) fn parse_time_stamp(text: &str) -> Option<i64> {
    let (date, time) = text.trim().split_once(['T', 't', ' '])?;
    let days = parse_date(date)?;
    let (time, zone) = split_zone(time.trim())?;
    let (seconds, nanoseconds) = parse_time_of_day(time)?;
    // Overflow is possible for years beyond 2262 only.
    let whole = days.checked_mul(86_400)?.checked_add(seconds - zone)?;
    whole.checked_mul(1_000_000_000)?.checked_add(nanoseconds)
}

/// Days since 1970 of a date `YYYY-MM-DD`.
fn parse_date(text: &str) -> Option<i64> {
    let parts: Vec<&str> = text.split('-').collect();
    let [year, month, day] = parts.as_slice() else {
        return None;
    };
    if year.len() != 4 {
        return None;
    }
    let (year, month, day) = (digits(year)?, digits(month)?, digits(day)?);
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let longest = match month {
        4 | 6 | 9 | 11 => 30,
        2 if is_leap => 29,
        2 => 28,
        1..=12 => 31,
        _ => return None,
    };
    if !(1..=longest).contains(&day) {
        return None;
    }
    // Years begin in March, so that the leap day is the last one (H. Hinnant, chrono-compatible date algorithms).
    let (year, month) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let day_of_year = (153 * month + 2) / 5 + day - 1;
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    Some(era * 146_097 + day_of_era - 719_468)
}

/// The time of day without its zone, and the zone as seconds ahead of universal time.
fn split_zone(text: &str) -> Option<(&str, i64)> {
    if let Some(time) = text.strip_suffix(['Z', 'z']) {
        return Some((time, 0));
    }
    let Some(at) = text.rfind(['+', '-']) else {
        return Some((text, 0));
    };
    let sign = if text[at..].starts_with('-') { -1 } else { 1 };
    let zone = text[at + 1..].replace(':', "");
    let (hours, minutes) = match zone.len() {
        2 => (digits(&zone)?, 0),
        4 => (digits(zone.get(..2)?)?, digits(zone.get(2..)?)?),
        _ => return None,
    };
    (hours < 24 && minutes < 60).then_some((text[..at].trim_end(), sign * (3600 * hours + 60 * minutes)))
}

/// Whole seconds and nanoseconds of a time of day `HH:MM[:SS[.fraction]]`.
fn parse_time_of_day(text: &str) -> Option<(i64, i64)> {
    let mut parts = text.split(':');
    let (hours, minutes) = (digits(parts.next()?)?, digits(parts.next()?)?);
    let (seconds, fraction) = match parts.next() {
        None => ("0", ""),
        Some(last) => last.split_once(['.', ',']).unwrap_or((last, "")),
    };
    let seconds = digits(seconds)?;
    if parts.next().is_some() || hours > 23 || minutes > 59 || seconds > 59 {
        return None;
    }
    let mut nanoseconds = 0;
    if !fraction.is_empty() {
        if !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
            return None;
        }
        // Zeros fill a shorter fraction up to nanoseconds.
        for place in 0..FRACTION_DIGITS {
            let digit = fraction.as_bytes().get(place).map_or(0, |byte| i64::from(byte - b'0'));
            nanoseconds = 10 * nanoseconds + digit;
        }
    }
    Some((3600 * hours + 60 * minutes + seconds, nanoseconds))
}

/// A number that consists of digits only.
fn digits(text: &str) -> Option<i64> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::parse_time_stamp;

    #[test]
    fn stamps_of_one_instant_are_equal() {
        let expected = Some(1_714_557_600_250_000_000);
        for text in [
            "2024-05-01T10:00:00.25Z",
            "2024-05-01 10:00:00.250000",
            "2024-05-01T12:00:00,25+02:00",
            "2024-05-01T04:30:00.250000000-0530",
        ] {
            assert_eq!(parse_time_stamp(text), expected, "{text}");
        }
        assert_eq!(parse_time_stamp("1970-01-01T00:00"), Some(0));
        assert_eq!(parse_time_stamp("2000-03-01 00:00:00"), Some(951_868_800_000_000_000));
    }

    #[test]
    fn other_texts_are_no_stamps() {
        for text in [
            "",
            "2024-05-01",
            "12:00:00",
            "2023-02-29T00:00:00",
            "2024-13-01T00:00:00",
            "2024-05-01T24:00:00",
            "2024-05-01T10:61:00",
            "2024-05-01T10:00:0x",
            "2024-05-01T10:00:00.2é",
            "1.5 2",
        ] {
            assert_eq!(parse_time_stamp(text), None, "{text}");
        }
    }
}
