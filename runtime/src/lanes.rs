//! Sine and cosine of many angles at once: arrays in, arrays out, without a branch or a call inside the loop, so that
//! the compiler can vectorise it for any width.
//!
//! Argument reduction in three parts of pi/2 and polynomials on [-pi/4, pi/4] after K. C. Ng's `k_sin.c`, `k_cos.c` and
//! `e_rem_pio2.c` of FDLIBM 5.3 (Sun Microsystems, 1993; freely distributable). The error stays below 1 ulp for angles
//! up to [`LARGEST_ANGLE`]; arrays with a larger or non-finite angle go through [`Real::sin_cos`](crate::Real::sin_cos)
//! one by one.
//!
//! Decision: one sine and cosine serve single numbers and vectors, with and without the standard library.
//! Polynomials are summed in pairs of terms (G. Estrin), which shortens the dependent chain. One state computes
//! those of all its angles at once, which makes the Panda's inverse dynamics a fifth faster with the same bits;
//! vectors compute each at its place, because the results of all would not fit into registers.

use crate::Real;
use crate::arithmetic::ProgramValue;

/// Largest angle, rad, for which the reduction in three parts is exact enough: 2^16 quarters of a turn.
pub const LARGEST_ANGLE: f64 = 102_943.0;

/// Sine and cosine of each angle, rad; the same on every machine.
#[allow(
    clippy::inline_always,
    reason = "a function of its own would be compiled for the narrowest vectors"
)]
#[inline(always)]
pub fn sin_cos_lanes<const N: usize>(angle: &[f64; N], sin: &mut [f64; N], cos: &mut [f64; N]) {
    let mut regular = true;
    for x in angle {
        regular &= Real::abs(*x) < LARGEST_ANGLE;
    }
    if regular {
        for k in 0..N {
            (sin[k], cos[k]) = reduced_sin_cos(angle[k]);
        }
    } else {
        for k in 0..N {
            (sin[k], cos[k]) = Real::sin_cos(angle[k]);
        }
    }
}

/// Sines and cosines of several angles, rad: one branch for all of them, and pairs in the vectors that every machine
/// has.
#[inline]
pub(crate) fn sin_cos_each<const N: usize>(angles: [f64; N]) -> ([f64; N], [f64; N]) {
    let (mut sin, mut cos) = ([0.0; N], [0.0; N]);
    sin_cos_lanes(&angles, &mut sin, &mut cos);
    (sin, cos)
}

/// Sine and cosine of one angle, rad; the same on every machine, and in constant time below [`LARGEST_ANGLE`].
#[inline]
pub(crate) fn sin_cos_once(angle: f64) -> (f64, f64) {
    if Real::abs(angle) < LARGEST_ANGLE {
        reduced_sin_cos(angle)
    } else {
        libm::sincos(angle)
    }
}

/// A number, or a vector of numbers, that the kernel below works on.
pub(crate) trait LaneAngle: ProgramValue {
    /// Sine and cosine after a rotation by the number of quarter turns in the lowest bits of `shifted`.
    fn rotate_by_quarters(shifted: Self, sin: Self, cos: Self) -> (Self, Self);
}

#[allow(clippy::inline_always, reason = "as above")]
impl LaneAngle for f64 {
    #[inline(always)]
    fn rotate_by_quarters(shifted: Self, sin: Self, cos: Self) -> (Self, Self) {
        let quarter = shifted.to_bits();
        let swap = 0u64.wrapping_sub(quarter & 1);
        let (s, c) = (sin.to_bits(), cos.to_bits());
        let sin = (s & !swap) | (c & swap);
        let cos = (c & !swap) | (s & swap);
        let sin_sign = (quarter & 2) << 62;
        let cos_sign = (quarter.wrapping_add(1) & 2) << 62;
        (Self::from_bits(sin ^ sin_sign), Self::from_bits(cos ^ cos_sign))
    }
}

/// Angles below [`LARGEST_ANGLE`], without branches.
#[allow(clippy::inline_always, reason = "as above")]
#[allow(
    clippy::excessive_precision,
    reason = "as printed in the sources; the nearest doubles are meant"
)]
#[inline(always)]
pub(crate) fn reduced_sin_cos<A: LaneAngle>(x: A) -> (A, A) {
    // Adding and subtracting 1.5 * 2^52 rounds to an integer, which is then in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const PIO2_1: f64 = 1.570_796_326_734_125_614_17;
    const PIO2_2: f64 = 6.077_100_506_303_965_976_60e-11;
    const PIO2_2T: f64 = 2.022_266_248_795_950_631_54e-21;
    let shifted = x
        .number_like(ROUND)
        .plus_product(x, x.number_like(core::f64::consts::FRAC_2_PI));
    let turns = shifted - x.number_like(ROUND);
    // The first product is exact, and so is the difference; what the second one loses goes into the tail.
    let first = x.less_product(turns, x.number_like(PIO2_1));
    let y = first.less_product(turns, x.number_like(PIO2_2));
    let lost = (first - y).less_product(turns, x.number_like(PIO2_2));
    let tail = lost.less_product(turns, x.number_like(PIO2_2T));
    let (s, c) = sin_cos_kernel(y, tail);
    A::rotate_by_quarters(shifted, s, c)
}

/// Sine and cosine of `x + tail` within an eighth of a turn.
#[allow(clippy::inline_always, reason = "as above")]
#[allow(clippy::excessive_precision, reason = "as above")]
#[inline(always)]
fn sin_cos_kernel<A: LaneAngle>(x: A, tail: A) -> (A, A) {
    const S1: f64 = -1.666_666_666_666_663_243_48e-1;
    const S2: f64 = 8.333_333_333_322_489_461_24e-3;
    const S3: f64 = -1.984_126_982_985_794_931_34e-4;
    const S4: f64 = 2.755_731_370_707_006_767_89e-6;
    const S5: f64 = -2.505_076_025_340_686_341_95e-8;
    const S6: f64 = 1.589_690_995_211_550_102_21e-10;
    const C1: f64 = 4.166_666_666_666_660_190_37e-2;
    const C2: f64 = -1.388_888_888_887_410_957_49e-3;
    const C3: f64 = 2.480_158_728_947_672_941_78e-5;
    const C4: f64 = -2.755_731_435_139_066_330_35e-7;
    const C5: f64 = 2.087_572_321_298_174_827_90e-9;
    const C6: f64 = -1.135_964_755_778_819_482_65e-11;
    let z = x * x;
    let half = x.number_like(0.5) * z;
    let one = x.number_like(1.0);
    let lead = one - half;

    // Terms in pairs, as G. Estrin adds them up: half of the operations wait for no other.
    let (zz, zx) = (z * z, z * x);
    let zzzz = zz * zz;
    let s1 = x.number_like(S1).plus_product(z, x.number_like(S2));
    let s3 = x.number_like(S3).plus_product(z, x.number_like(S4));
    let s5 = x.number_like(S5).plus_product(z, x.number_like(S6));
    let s = s1.plus_product(zz, s3).plus_product(zzzz, s5);
    let sin = x + (tail * lead).plus_product(zx, s);

    let c1 = x.number_like(C1).plus_product(z, x.number_like(C2));
    let c3 = x.number_like(C3).plus_product(z, x.number_like(C4));
    let c5 = x.number_like(C5).plus_product(z, x.number_like(C6));
    let c = c1.plus_product(zz, c3).plus_product(zzzz, c5);
    let rest = ((one - lead) - half).less_product(x, tail);
    let cos = lead + rest.plus_product(zz, c);
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance in units of the last place of the larger one.
    fn ulps(a: f64, b: f64) -> f64 {
        let size = a.abs().max(b.abs()).max(f64::MIN_POSITIVE);
        let ulp = f64::from_bits(size.to_bits() + 1) - size;
        (a - b).abs() / ulp
    }

    #[track_caller]
    fn check(angles: [f64; 8]) -> f64 {
        let (mut s, mut c) = ([0.0; 8], [0.0; 8]);
        sin_cos_lanes(&angles, &mut s, &mut c);
        let mut worst: f64 = 0.0;
        for k in 0..8 {
            let (sin, cos) = libm::sincos(angles[k]);
            worst = worst.max(ulps(s[k], sin)).max(ulps(c[k], cos));
        }
        assert!(worst <= 1.0, "{worst} ulp at {angles:?}");
        worst
    }

    /// Both are within 1 ulp of the truth, and neighbouring doubles at most where they differ.
    #[test]
    fn lanes_agree_with_the_library_to_the_last_place() {
        let mut x: u64 = 1;
        for scale in [1e-9, 0.5, 3.0, 50.0, 1e3, 1e4, 1.02e5] {
            for _ in 0..20_000 {
                let angles = core::array::from_fn(|_| {
                    x = x
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    ((x >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 2.0 * scale
                });
                check(angles);
            }
        }
    }

    /// Where sine or cosine nearly vanishes, all digits come from the reduction.
    #[test]
    fn near_multiples_of_a_quarter_turn_the_reduction_keeps_its_digits() {
        for quarter in [1_u32, 2, 3, 4, 101, 1002, 4097, 40_000, 65_000] {
            let angle = f64::from(quarter) * core::f64::consts::FRAC_PI_2;
            let up = |n: u64| f64::from_bits(angle.to_bits() + n);
            check([angle, up(1), up(2), up(3), -angle, -up(1), -up(2), -up(5)]);
        }
    }

    /// Several at once are one by one, to the bit, wherever they lie.
    #[test]
    fn several_angles_are_one_by_one() {
        for scale in [1e-3, 3.0, 1e3, 1e5, 1e7] {
            let angles: [f64; 7] =
                core::array::from_fn(|k| scale * (0.37 + 0.21 * f64::from(u8::try_from(k).unwrap_or(0))));
            let (sin, cos) = Real::sin_cos_all(angles);
            let single: [f32; 7] = angles.map(Real::from_f64);
            let (sin32, cos32) = Real::sin_cos_all(single);
            for k in 0..7 {
                let (s, c) = Real::sin_cos(angles[k]);
                assert_eq!((sin[k].to_bits(), cos[k].to_bits()), (s.to_bits(), c.to_bits()));
                let (s, c) = Real::sin_cos(single[k]);
                assert_eq!((sin32[k].to_bits(), cos32[k].to_bits()), (s.to_bits(), c.to_bits()));
            }
        }
    }

    #[test]
    fn huge_angles_and_what_is_no_number_go_through_the_library() {
        let (mut s, mut c) = ([0.0; 4], [0.0; 4]);
        sin_cos_lanes(&[1e20, 0.3, f64::NAN, f64::INFINITY], &mut s, &mut c);
        let (sin, cos) = Real::sin_cos(1e20_f64);
        assert_eq!((s[0].to_bits(), c[0].to_bits()), (sin.to_bits(), cos.to_bits()));
        assert!(s[2].is_nan() && c[3].is_nan() && ulps(s[1], Real::sin_cos(0.3_f64).0) <= 1.0);
    }
}
