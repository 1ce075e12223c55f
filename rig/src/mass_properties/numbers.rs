//! Numbers as CAD programs print them: a word goes in, its value and its last printed place come out.
//!
//! Programs use the decimal sign and the separator of thousands of the user's language. Where a word can be two numbers
//! that differ by a factor of a thousand, it is refused.

/// A number as it is printed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PrintedNumber {
    /// Its value.
    pub(super) value: f64,
    /// The value of one unit of its last digit: 0.01 for `7.85`.
    pub(super) place: f64,
}

/// Why a word is no usable number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PrintedNumberFault {
    /// It is another word.
    NoNumber,
    /// It can be two numbers: its separators are decimal signs or separate thousands.
    Unclear,
    /// It is infinite.
    Infinite,
}

/// What to write in place of an unclear number.
pub(super) const CLEAR_NUMBERS: &str = "numbers with a decimal point and without separators of thousands";

/// Reads a number. `has_decimal_comma` says that other numbers of the file prove a decimal comma.
pub(super) fn read_number(word: &str, has_decimal_comma: bool) -> Result<PrintedNumber, PrintedNumberFault> {
    if !is_numeric(word) {
        return Err(PrintedNumberFault::NoNumber);
    }
    let plain = with_decimal_point(word, has_decimal_comma).ok_or(PrintedNumberFault::Unclear)?;
    match plain.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(PrintedNumber {
            value,
            place: last_place(&plain),
        }),
        Ok(_) => Err(PrintedNumberFault::Infinite),
        Err(_) => Err(PrintedNumberFault::NoNumber),
    }
}

/// Whether a word can only be a number with a decimal comma, such as `0,25` or `12,5`.
pub(super) fn proves_decimal_comma(word: &str) -> bool {
    let is_one = word.matches(',').count() == 1 && !word.contains('.');
    is_one && is_numeric(word) && !may_separate_thousands(word) && word.replace(',', ".").parse::<f64>().is_ok()
}

/// Whether a word has a digit, and no other characters than numbers have.
fn is_numeric(word: &str) -> bool {
    word.contains(|c: char| c.is_ascii_digit())
        && word
            .chars()
            .all(|c| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | ',' | 'e' | 'E'))
}

/// Whether all commas of a word can separate thousands.
fn may_separate_thousands(word: &str) -> bool {
    let whole = word.trim_start_matches(['-', '+']);
    let mut groups = whole.split('.').next().unwrap_or_default().split(',');
    let first = groups.next().unwrap_or_default();
    let is_first = (1..=3).contains(&first.len()) && first != "0";
    is_first && groups.all(|group| group.len() == 3 && group.bytes().all(|c| c.is_ascii_digit()))
}

/// The word with a decimal point and without separators of thousands; none if it is unclear which is which.
fn with_decimal_point(word: &str, has_decimal_comma: bool) -> Option<String> {
    let (commas, points) = (word.matches(',').count(), word.matches('.').count());
    match (commas, points) {
        (0, 0) => Some(word.to_owned()),
        // Beside decimal commas, a point separates thousands.
        (0, 1) => (!has_decimal_comma).then(|| word.to_owned()),
        (1, 0) => (has_decimal_comma || !may_separate_thousands(word)).then(|| word.replace(',', ".")),
        (_, 1) => {
            let is_clear = !has_decimal_comma && word.rfind(',') < word.rfind('.') && may_separate_thousands(word);
            is_clear.then(|| word.replace(',', ""))
        }
        _ => None,
    }
}

/// The value of one unit of the last digit.
fn last_place(plain: &str) -> f64 {
    let (mantissa, exponent) = plain.split_once(['e', 'E']).unwrap_or((plain, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let exponent: i32 = exponent.parse().unwrap_or(0);
    10_f64.powi(exponent.saturating_sub(i32::try_from(decimals).unwrap_or(i32::MAX)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_can_be_two_numbers_are_refused() {
        let value = |word| read_number(word, false).map(|number| number.value);
        for (word, truth) in [
            ("1.25", 1.25),
            ("-1,234.5", -1234.5),
            ("0,125", 0.125),
            ("12,5", 12.5),
            ("12345,678", 12_345.678),
            ("1,234567e-3", 1.234_567e-3),
        ] {
            assert_eq!(value(word), Ok(truth), "{word}");
        }
        for word in ["1.234,56", "1,234", "1,234,567", "1.234.567", "1,23.4", "-1.234.567,8"] {
            assert_eq!(value(word), Err(PrintedNumberFault::Unclear), "{word}");
        }
        assert_eq!(read_number("1,234", true).map(|number| number.value), Ok(1.234));
        assert_eq!(read_number("1.234", true), Err(PrintedNumberFault::Unclear));
        assert_eq!(value("g/cm"), Err(PrintedNumberFault::NoNumber));
        assert_eq!(value("1e999"), Err(PrintedNumberFault::Infinite));
        assert!(proves_decimal_comma("0,5") && !proves_decimal_comma("1,234") && !proves_decimal_comma("1.5"));
    }

    #[test]
    fn the_last_place_is_that_of_the_last_digit() {
        for (word, place) in [("7.85", 1e-2), ("4000", 1.0), ("0,5", 0.1), ("1.20e-3", 1e-5)] {
            let found = read_number(word, false).expect("a number").place;
            assert!((found / place - 1.0).abs() < 1e-12, "{word} {found}");
        }
    }
}
