//! Half floats (IEEE 754-2019, binary16): 1 bit sign, 5 bits exponent with bias 15, 10 bits fraction.

/// The value of a half float; exact, because a double has all these values.
pub(crate) fn decode_half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    let size = match exponent {
        // Numbers near zero have no leading one.
        0 => fraction * 2_f64.powi(-24),
        0x1f if fraction == 0.0 => f64::INFINITY,
        0x1f => f64::NAN,
        exponent => (1024.0 + fraction) * 2_f64.powi(exponent - 25),
    };
    sign * size
}

#[cfg(test)]
mod tests {
    use super::decode_half;

    #[test]
    fn values_are_those_of_the_standard() {
        // Bits and values of the table "Half precision examples" in Wikipedia, from IEEE 754.
        for (bits, value) in [
            (0x0000, 0.0),
            (0x0001, 0.000_000_059_604_645),
            (0x03ff, 0.000_060_975_552),
            (0x0400, 0.000_061_035_156),
            (0x3555, 0.333_251_95),
            (0x3bff, 0.999_511_7),
            (0x3c00, 1.0),
            (0x3c01, 1.000_976_6),
            (0x7bff, 65504.0),
            (0xc000, -2.0),
        ] {
            let found = decode_half(bits);
            assert!((found - value).abs() <= 1e-6 * value.abs(), "{bits:#06x}: {found}");
        }
        assert!(decode_half(0x7c00).is_infinite() && decode_half(0x7e00).is_nan());
        // Neighbours differ by one unit everywhere below infinity.
        assert!((0..0x7bff).all(|bits| decode_half(bits) < decode_half(bits + 1)));
    }
}
