//! Programs in the widest vectors of the machine. The crate `pulp` detects the machine at run time and wraps its
//! instructions in a safe interface: 512 bits with AVX-512, 256 with AVX2, 128 with NEON, else one number at a time.
//!
//! Products are fused with the sums that they go into where the machine has an instruction for that, so that results
//! agree with those of one state, and between machines, to rounding.
//!
//! Decision: `pulp` and not arrays. The compiler leaves a loop over an array of eight in memory; values of `pulp`
//! are registers from the start. Products are fused in vectors only: that saves a third of the instructions where
//! the machine has them, while a single state would call a function. So blocks agree with single states to rounding
//! and not to the bit.
#![allow(
    clippy::inline_always,
    reason = "a function of its own would be compiled for the narrowest vectors"
)]

use core::cell::Cell;
use core::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::OnceLock;

use pulp::{Arch, Simd, WithSimd};

use crate::arithmetic::{ProgramValue, Term, Var};
use crate::blocks::{BlockError, BlockScalar, CacheLine, Line32, Line64, StateProgram, VectorJob, VectorWidth};
use crate::lanes::{self, LARGEST_ANGLE, reduced_sin_cos};
use crate::numbers::AngleBatch;
use crate::{Numbers, OutputSink, PoseError, Real};

/// The widest vectors of the machine. The environment variable `MODELMILL_VECTORS` reduces them to `256` bits or
/// `none`, so that the timings of a smaller machine can be measured on this one.
fn widest_vectors() -> Arch {
    /// Selected at the first call.
    static CHOSEN: OnceLock<Arch> = OnceLock::new();
    *CHOSEN.get_or_init(|| match std::env::var("MODELMILL_VECTORS").as_deref() {
        Ok("none") => Arch::Scalar,
        #[cfg(target_arch = "x86_64")]
        Ok("256") => pulp::x86::V3::try_new().map_or(Arch::Scalar, Arch::V3),
        _ => Arch::new(),
    })
}

/// Passes a job on to the vectors that `pulp` selected.
struct DispatchedJob<J, T>(J, core::marker::PhantomData<T>);

// Defines vectors, their arithmetic and the run over a line for one scalar type. Arguments: the scalar, the line, names
// of the types to define, then the names that `pulp` gives to types and instructions for this scalar.
macro_rules! wide {
    (
        $float:ty, $line:ident, $value:ident, $numbers:ident, $put:ident, $vectors:ident,
        $floats:ident, $mask:ident, $lanes:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $neg:ident,
        $fused:ident, $fused_less:ident, $sqrt:ident, $abs:ident, $less:ident, $greater:ident, $at_least:ident, $and:ident, $not:ident, $first:ident,
        $select:ident, $max:ident, $of_slice:ident, $of_slice_mut:ident
    ) => {
        /// One vector register of numbers.
        #[derive(Clone, Copy)]
        struct $value<S: Simd> {
            /// Token that proves that the instructions exist.
            simd: S,
            /// The register.
            v: S::$floats,
        }

        // Plain operators; products that are fused with sums are below.
        wide!(operator $value, Add, add, $add);
        wide!(operator $value, Sub, sub, $sub);
        wide!(operator $value, Mul, mul, $mul);
        wide!(operator $value, Div, div, $div);

        impl<S: Simd> Neg for $value<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self {
                    simd: self.simd,
                    v: self.simd.$neg(self.v),
                }
            }
        }

        /// Arithmetic of a vector, and which of its lanes are regular.
        struct $numbers<S: Simd> {
            /// Token that proves that the instructions exist.
            simd: S,
            /// Mask with true for each lane without an exception so far.
            regular: Cell<S::$mask>,
        }

        impl<S: Simd> $numbers<S> {
            /// All lanes are regular at first: `pulp` has no constant mask, so 0 < 1 makes one.
            #[inline(always)]
            fn new(simd: S) -> Self {
                let (zero, one) = (simd.$splat(0.0), simd.$splat(1.0));
                Self {
                    simd,
                    regular: Cell::new(simd.$less(zero, one)),
                }
            }

            /// A vector as a value of the program.
            #[inline(always)]
            fn value(&self, v: S::$floats) -> $value<S> {
                $value { simd: self.simd, v }
            }

            /// Marks lanes as irregular where the mask is false.
            #[inline(always)]
            fn mask_lanes(&self, mask: S::$mask) {
                self.regular.set(self.simd.$and(self.regular.get(), mask));
            }

            /// Whether no lane is irregular.
            #[inline(always)]
            fn is_all_regular(&self) -> bool {
                let irregular = self.simd.$not(self.regular.get());
                self.simd.$first(irregular) >= S::$lanes
            }
        }

        impl<S: Simd> $value<S> {
            /// Another vector with the same token.
            #[inline(always)]
            fn with_vector(self, v: S::$floats) -> Self {
                Self { simd: self.simd, v }
            }

            /// A function that has no vector form, lane by lane.
            #[inline(always)]
            fn map_lanes(self, f: impl Fn($float) -> $float) -> Self {
                // Lanes go through an array; lanes that the vector does not have stay zero.
                let mut line = [0.0; $line::LENGTH];
                if let Some(to) = S::$of_slice_mut(&mut line).0.first_mut() {
                    *to = self.v;
                }
                for x in line.iter_mut().take(S::$lanes) {
                    *x = f(*x);
                }
                let first = S::$of_slice(&line).0.first();
                first.map_or(self, |v| self.with_vector(*v))
            }
        }

        impl<S: Simd> ProgramValue for $value<S> {
            #[inline(always)]
            fn number_like(self, x: f64) -> Self {
                self.with_vector(self.simd.$splat(<$float as Real>::from_f64(x)))
            }
            #[inline(always)]
            fn plus_product(self, a: Self, b: Self) -> Self {
                self.with_vector(self.simd.$fused(a.v, b.v, self.v))
            }
            #[inline(always)]
            fn product_less(self, a: Self, b: Self) -> Self {
                self.with_vector(self.simd.$fused(a.v, b.v, self.simd.$neg(self.v)))
            }
            #[inline(always)]
            fn less_product(self, a: Self, b: Self) -> Self {
                self.with_vector(self.simd.$fused_less(a.v, b.v, self.v))
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.with_vector(self.simd.$sqrt(self.v))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.with_vector(self.simd.$abs(self.v))
            }
            #[inline(always)]
            fn sign(self) -> Self {
                let simd = self.simd;
                let (zero, one) = (simd.$splat(0.0), simd.$splat(1.0));
                // The first selection returns NaN and 0 unchanged.
                let below = simd.$select(simd.$less(self.v, zero), simd.$splat(-1.0), self.v);
                self.with_vector(simd.$select(simd.$greater(self.v, zero), one, below))
            }
            #[inline(always)]
            fn tanh(self) -> Self {
                self.map_lanes(Real::tanh)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                self.map_lanes(Real::exp)
            }
            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                // The other argument is read from an array, lane after lane.
                let mut line = [0.0; $line::LENGTH];
                if let Some(to) = S::$of_slice_mut(&mut line).0.first_mut() {
                    *to = x.v;
                }
                let at = Cell::new(0);
                self.map_lanes(|y| {
                    let k = at.replace(at.get() + 1);
                    Real::atan2(y, line.get(k).copied().unwrap_or_default())
                })
            }
        }

        impl<S: Simd> Numbers for $numbers<S> {
            type Scalar = $float;
            type Value = $value<S>;

            #[inline(always)]
            fn broadcast(&self, x: $float) -> Var<$value<S>> {
                Var(self.value(self.simd.$splat(x)))
            }
            #[inline(always)]
            fn sin_cos(&self, angle: impl Term<$value<S>>) -> (Var<$value<S>>, Var<$value<S>>) {
                let angle = angle.get();
                let (simd, largest) = (self.simd, <$float as Real>::from_f64(LARGEST_ANGLE));
                // Larger angles need another reduction than the kernel has, so their states are evaluated one by one.
                self.mask_lanes(simd.$less(simd.$abs(angle.v), simd.$splat(largest)));
                let (sin, cos) = angle.sin_cos();
                (Var(sin), Var(cos))
            }
            #[inline(always)]
            fn angles<const N: usize>(&self, angles: [Var<$value<S>>; N]) -> AngleBatch<$value<S>, N> {
                let (simd, largest) = (self.simd, <$float as Real>::from_f64(LARGEST_ANGLE));
                // The maximum of two may drop NaN; inputs are therefore checked before.
                let mut size = simd.$splat(0.0);
                for angle in angles {
                    size = simd.$max(size, simd.$abs(angle.0.v));
                }
                self.mask_lanes(simd.$less(size, simd.$splat(largest)));
                AngleBatch { sines: angles, cosines: angles }
            }
            #[inline(always)]
            fn sin_cos_of<const N: usize>(
                &self,
                angles: &AngleBatch<$value<S>, N>,
                k: usize,
            ) -> (Var<$value<S>>, Var<$value<S>>) {
                let (sin, cos) = angles.sines[k].0.sin_cos();
                (Var(sin), Var(cos))
            }
            #[inline(always)]
            fn reachable(&self, x: impl Term<$value<S>>) -> Result<(), PoseError> {
                self.mask_lanes(self.simd.$at_least(x.get().v, self.simd.$splat(0.0)));
                Ok(())
            }
            #[inline(always)]
            fn regular(&self, x: impl Term<$value<S>>, size: impl Term<$value<S>>) -> Result<(), PoseError> {
                let share = self.simd.$splat(<$float as Real>::singular());
                let limit = self.simd.$mul(share, size.get().v);
                self.mask_lanes(self.simd.$greater(self.simd.$abs(x.get().v), limit));
                Ok(())
            }
            #[inline(always)]
            fn finite(&self, x: impl Term<$value<S>>) -> Result<(), PoseError> {
                let infinite = self.simd.$splat(<$float>::INFINITY);
                self.mask_lanes(self.simd.$less(self.simd.$abs(x.get().v), infinite));
                Ok(())
            }
        }

        /// Writes one vector of each line.
        struct $put<'a, S, const OUTPUTS: usize> {
            /// Lines of all outputs.
            lines: &'a mut [$line; OUTPUTS],
            /// Index of the vector in a line.
            part: usize,
            /// Token that proves that the instructions exist.
            simd: S,
        }

        impl<S: Simd, const OUTPUTS: usize> OutputSink<$value<S>> for $put<'_, S, OUTPUTS> {
            #[inline(always)]
            fn put(&mut self, k: usize, value: impl Term<$value<S>>) {
                let _ = self.simd;
                if let Some(to) = S::$of_slice_mut(&mut self.lines[k].0).0.get_mut(self.part) {
                    *to = value.get().v;
                }
            }
        }

        /// Vectors of the width of the token `S`.
        #[derive(Clone, Copy)]
        struct $vectors<S>(S);

        impl<S: Simd> VectorWidth<$float> for $vectors<S> {
            #[inline(always)]
            fn run_line<P, const INPUTS: usize, const OUTPUTS: usize>(
                self,
                program: &P,
                inputs: &[&[$float]; INPUTS],
                at: usize,
                outputs: &mut [$line; OUTPUTS],
            ) -> bool
            where
                P: StateProgram<$float, INPUTS, OUTPUTS>,
            {
                let simd = self.0;
                let mut regular = true;
                // A line consists of one or several vectors, each of which runs the program once.
                for part in 0..$line::LENGTH / S::$lanes {
                    let numbers = $numbers::new(simd);
                    let zero = simd.$splat(0.0);
                    let mut values = [Var(numbers.value(zero)); INPUTS];
                    // The sum is small if all of them are.
                    let mut sum = zero;
                    for (to, input) in values.iter_mut().zip(inputs) {
                        let Some(line) = input.get(at..at + $line::LENGTH) else {
                            return false;
                        };
                        if let Some(v) = S::$of_slice(line).0.get(part) {
                            to.0.v = *v;
                            sum = simd.$add(sum, simd.$abs(*v));
                        }
                    }
                    // Inputs that are NaN or too large make their lanes irregular.
                    numbers.mask_lanes(simd.$less(sum, simd.$splat(<$float as Real>::largest())));
                    let lines = &mut *outputs;
                    let mut put = $put { lines, part, simd };
                    regular &= program.run(&numbers, values, &mut put).is_ok();
                    regular &= numbers.is_all_regular();
                }
                regular
            }
        }

        impl<J: VectorJob<$float>> WithSimd for DispatchedJob<J, $float> {
            type Output = Result<(), BlockError>;
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
                self.0.run_vectors($vectors(simd))
            }
        }

        impl BlockScalar for $float {
            type Line = $line;
            fn run_job<J: VectorJob<Self>>(job: J) -> Result<(), BlockError> {
                widest_vectors().dispatch(DispatchedJob(job, core::marker::PhantomData))
            }
        }
    };
    (operator $value:ident, $trait:ident, $method:ident, $instruction:ident) => {
        impl<S: Simd> $trait for $value<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self {
                    simd: self.simd,
                    v: self.simd.$instruction(self.v, other.v),
                }
            }
        }
    };
}

wide!(
    f64,
    Line64,
    Wide64,
    Numbers64,
    Put64,
    Vectors64,
    f64s,
    m64s,
    F64_LANES,
    splat_f64s,
    add_f64s,
    sub_f64s,
    mul_f64s,
    div_f64s,
    neg_f64s,
    mul_add_e_f64s,
    negate_mul_add_e_f64s,
    sqrt_f64s,
    abs_f64s,
    less_than_f64s,
    greater_than_f64s,
    greater_than_or_equal_f64s,
    and_m64s,
    not_m64s,
    first_true_m64s,
    select_f64s,
    max_f64s,
    as_simd_f64s,
    as_mut_simd_f64s
);
wide!(
    f32,
    Line32,
    Wide32,
    Numbers32,
    Put32,
    Vectors32,
    f32s,
    m32s,
    F32_LANES,
    splat_f32s,
    add_f32s,
    sub_f32s,
    mul_f32s,
    div_f32s,
    neg_f32s,
    mul_add_e_f32s,
    negate_mul_add_e_f32s,
    sqrt_f32s,
    abs_f32s,
    less_than_f32s,
    greater_than_f32s,
    greater_than_or_equal_f32s,
    and_m32s,
    not_m32s,
    first_true_m32s,
    select_f32s,
    max_f32s,
    as_simd_f32s,
    as_mut_simd_f32s
);

impl<S: Simd> Wide64<S> {
    /// Sine and cosine of angles in rad below [`LARGEST_ANGLE`].
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        reduced_sin_cos(self)
    }

    /// The other value where the mask is set.
    #[inline(always)]
    fn select_lanes(self, mask: S::m64s, other: Self) -> Self {
        Self {
            simd: self.simd,
            v: self.simd.select_f64s(mask, other.v, self.v),
        }
    }

    /// Sign changed in the third and fourth quadrant.
    #[inline(always)]
    fn with_sign(self, quarter: S::u64s) -> Self {
        let (simd, two) = (self.simd, self.simd.splat_u64s(2));
        let negative = simd.equal_u64s(simd.and_u64s(quarter, two), two);
        let sign = simd.select_f64s(negative, simd.splat_f64s(-0.0), simd.splat_f64s(0.0));
        Self {
            simd,
            v: simd.xor_f64s(self.v, sign),
        }
    }
}

impl<S: Simd> lanes::LaneAngle for Wide64<S> {
    #[inline(always)]
    fn rotate_by_quarters(shifted: Self, sin: Self, cos: Self) -> (Self, Self) {
        // In odd quarters sine and cosine change places; the signs depend on the quarter, one later for the cosine.
        let simd = shifted.simd;
        let one = simd.splat_u64s(1);
        let quarter = simd.transmute_u64s_f64s(shifted.v);
        let odd = simd.equal_u64s(simd.and_u64s(quarter, one), one);
        let next = simd.add_u64s(quarter, one);
        (
            sin.select_lanes(odd, cos).with_sign(quarter),
            cos.select_lanes(odd, sin).with_sign(next),
        )
    }
}

impl<S: Simd> Wide32<S> {
    /// Through `f64`, as for one number: the compiler makes vectors of these loops.
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let mut angle = [0.0_f64; Line32::LENGTH];
        let (mut sin, mut cos) = ([0.0_f64; Line32::LENGTH], [0.0_f64; Line32::LENGTH]);
        let mut line = [0.0_f32; Line32::LENGTH];
        let (mut sin32, mut cos32) = (line, line);
        if let Some(to) = S::as_mut_simd_f32s(&mut line).0.first_mut() {
            *to = self.v;
        }
        // One loop per step, so that each can be vectorised.
        for k in 0..S::F32_LANES.min(Line32::LENGTH) {
            angle[k] = f64::from(line[k]);
        }
        for k in 0..S::F32_LANES.min(Line32::LENGTH) {
            (sin[k], cos[k]) = reduced_sin_cos(angle[k]);
        }
        for k in 0..S::F32_LANES.min(Line32::LENGTH) {
            (sin32[k], cos32[k]) = (Real::from_f64(sin[k]), Real::from_f64(cos[k]));
        }
        let read = |line: &[f32; Line32::LENGTH]| {
            let first = S::as_simd_f32s(line).0.first();
            first.map_or(self, |v| Self { simd: self.simd, v: *v })
        };
        (read(&sin32), read(&cos32))
    }
}
