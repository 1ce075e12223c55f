//! Programs over many states at once: structure of arrays in, structure of arrays out.
//!
//! States are processed in lines of one cache line each (8 `f64`, 16 `f32`). With the feature `std` the program runs in
//! the widest vectors of the machine, which are detected at run time (`wide`); without it, one state at a time. If a
//! line contains an exception, such as NaN, a pose out of reach or an angle of more than 16 000 turns, its states are
//! evaluated again one by one. So there is one definition of an error, that of a single state.

use core::fmt;

use crate::{OutputSink, PoseError, Real, ScalarNumbers, Var, check_finite};

/// A straight-line program of a model, for states given as `INPUTS` numbers each.
pub trait StateProgram<T: Real, const INPUTS: usize, const OUTPUTS: usize> {
    /// Names of the inputs.
    const NAMES: [&'static str; INPUTS];

    /// Runs the program for as many states as a value of `numbers` contains.
    ///
    /// # Errors
    /// A pose error of the model.
    fn run<N: crate::Numbers<Scalar = T>>(
        &self,
        numbers: &N,
        inputs: [Var<N::Value>; INPUTS],
        outputs: &mut impl OutputSink<N::Value>,
    ) -> Result<(), PoseError>;

    /// Computes inputs that depend on the others, for one state after the other; `last` are those of the previous
    /// state.
    ///
    /// # Errors
    /// A pose error of the model.
    fn complete(&self, _inputs: &mut [T; INPUTS], _last: Option<&[T; INPUTS]>) -> Result<(), PoseError> {
        Ok(())
    }

    /// How many of the last inputs [`Self::complete`] computes; their slices are passed in empty.
    const COMPLETED: usize = 0;
}

/// A line of numbers as long as a cache line.
pub trait CacheLine<T>: Copy + AsRef<[T]> + AsMut<[T]> {
    /// How many numbers.
    const LENGTH: usize;
    /// A line in which all numbers are `x`.
    fn splat(x: T) -> Self;
}

macro_rules! line {
    ($name:ident, $float:ty, $length:literal) => {
        #[doc = concat!("A cache line of `", stringify!($float), "`.")]
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[repr(C, align(64))]
        pub struct $name(pub [$float; $length]);

        impl AsRef<[$float]> for $name {
            #[inline]
            fn as_ref(&self) -> &[$float] {
                &self.0
            }
        }

        impl AsMut<[$float]> for $name {
            #[inline]
            fn as_mut(&mut self) -> &mut [$float] {
                &mut self.0
            }
        }

        impl CacheLine<$float> for $name {
            const LENGTH: usize = $length;
            #[inline]
            fn splat(x: $float) -> Self {
                Self([x; $length])
            }
        }
    };
}
line!(Line64, f64, 8);
line!(Line32, f32, 16);

/// Scalar types that programs can process in blocks; implemented for `f32` and `f64`.
pub trait BlockScalar: Real {
    /// A cache line of these numbers.
    type Line: CacheLine<Self>;

    /// Runs a job in the widest vectors of the machine.
    ///
    /// # Errors
    /// The error of the job.
    fn run_job<J: VectorJob<Self>>(job: J) -> Result<(), BlockError>;
}

/// A job that runs with vectors of one width.
pub trait VectorJob<T: BlockScalar> {
    /// Runs the job; `vectors` runs a program over a line.
    ///
    /// # Errors
    /// The error of the job.
    fn run_vectors<V: VectorWidth<T>>(self, vectors: V) -> Result<(), BlockError>;
}

/// Vectors of one width, and the instructions for them.
pub trait VectorWidth<T: BlockScalar>: Copy {
    /// Runs a program over the line of states that starts at index `at` of the inputs; returns whether every lane was
    /// regular.
    fn run_line<P: StateProgram<T, INPUTS, OUTPUTS>, const INPUTS: usize, const OUTPUTS: usize>(
        self,
        program: &P,
        inputs: &[&[T]; INPUTS],
        at: usize,
        outputs: &mut [T::Line; OUTPUTS],
    ) -> bool;
}

/// No vectors: one state after the other.
#[derive(Clone, Copy, Debug)]
pub struct ScalarWidth;

impl<T: BlockScalar> VectorWidth<T> for ScalarWidth {
    #[inline]
    fn run_line<P: StateProgram<T, INPUTS, OUTPUTS>, const INPUTS: usize, const OUTPUTS: usize>(
        self,
        _program: &P,
        _inputs: &[&[T]; INPUTS],
        _at: usize,
        _outputs: &mut [T::Line; OUTPUTS],
    ) -> bool {
        // Reported as irregular, so that every line is evaluated one by one.
        false
    }
}

#[cfg(not(feature = "std"))]
mod singly {
    use super::{BlockError, BlockScalar, Line32, Line64, ScalarWidth, VectorJob};

    impl BlockScalar for f64 {
        type Line = Line64;
        fn run_job<J: VectorJob<Self>>(job: J) -> Result<(), BlockError> {
            job.run_vectors(ScalarWidth)
        }
    }

    impl BlockScalar for f32 {
        type Line = Line32;
        fn run_job<J: VectorJob<Self>>(job: J) -> Result<(), BlockError> {
            job.run_vectors(ScalarWidth)
        }
    }
}

/// Why an evaluation over many states failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockError {
    /// The first state without an answer.
    At {
        /// Index of the state.
        sample: usize,
        /// The pose error at this state.
        reason: PoseError,
    },
    /// Arrays of different lengths.
    Length {
        /// Name of the input, or `output`.
        array: &'static str,
        /// Its length.
        found: usize,
        /// The length that it should have.
        expected: usize,
    },
}

impl fmt::Display for BlockError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::At { sample, reason } => write!(f, "at sample {sample}: {reason}"),
            Self::Length { array, found, expected } => write!(
                f,
                "the array of `{array}` has {found} numbers where {expected} are expected"
            ),
        }
    }
}

impl core::error::Error for BlockError {}

/// The states of one line, and the outputs of a program for them.
#[derive(Clone, Copy, Debug)]
pub struct StateBlock<'a, L, const OUTPUTS: usize> {
    /// Number of the first state.
    pub first: usize,
    /// How many states; entries of a line beyond this number have no meaning.
    pub len: usize,
    /// One line per output.
    pub outputs: &'a [L; OUTPUTS],
}

/// Consumer of the results of a line.
trait BlockVisitor<L, const OUTPUTS: usize> {
    fn visit(&mut self, block: StateBlock<'_, L, OUTPUTS>);
}

/// A function that receives the results.
struct FunctionVisitor<F>(F);

impl<L, F: FnMut(StateBlock<'_, L, OUTPUTS>), const OUTPUTS: usize> BlockVisitor<L, OUTPUTS> for FunctionVisitor<F> {
    #[inline]
    fn visit(&mut self, block: StateBlock<'_, L, OUTPUTS>) {
        (self.0)(block);
    }
}

/// Columns that the results are written to.
struct ColumnVisitor<'a, 'b, T, const OUTPUTS: usize>(&'a mut [&'b mut [T]; OUTPUTS]);

impl<T: Copy, L: CacheLine<T>, const OUTPUTS: usize> BlockVisitor<L, OUTPUTS> for ColumnVisitor<'_, '_, T, OUTPUTS> {
    #[allow(
        clippy::inline_always,
        reason = "a function of its own would copy with the narrowest vectors"
    )]
    #[inline(always)]
    fn visit(&mut self, block: StateBlock<'_, L, OUTPUTS>) {
        for (column, line) in self.0.iter_mut().zip(block.outputs) {
            let to = column.get_mut(block.first..block.first + block.len);
            let (Some(to), line) = (to, line.as_ref()) else {
                continue;
            };
            if to.len() == line.len() {
                to.copy_from_slice(line);
            } else {
                for (to, from) in to.iter_mut().zip(line) {
                    *to = *from;
                }
            }
        }
    }
}

/// Runs a program over states, one slice per input, and passes the outputs on line by line.
///
/// # Errors
/// Slices of different lengths, before anything runs; else the first state without an answer, after all lines before it
/// have been passed on.
pub fn visit_blocks<T: BlockScalar, P, const INPUTS: usize, const OUTPUTS: usize>(
    program: &P,
    inputs: &[&[T]; INPUTS],
    visit: impl FnMut(StateBlock<'_, T::Line, OUTPUTS>),
) -> Result<(), BlockError>
where
    P: StateProgram<T, INPUTS, OUTPUTS>,
{
    let n = n_states(program, inputs)?;
    T::run_job(LineJob::<T, P, _, INPUTS, OUTPUTS> {
        program,
        inputs,
        n,
        visit: FunctionVisitor(visit),
    })
}

/// Runs a program over states and writes each output to a slice of its own.
///
/// # Errors
/// Slices of different lengths, before anything runs; else the first state without an answer, with the results of all
/// before it in place.
pub fn fill_columns<T: BlockScalar, P, const INPUTS: usize, const OUTPUTS: usize>(
    program: &P,
    inputs: &[&[T]; INPUTS],
    outputs: &mut [&mut [T]; OUTPUTS],
) -> Result<(), BlockError>
where
    P: StateProgram<T, INPUTS, OUTPUTS>,
{
    let n = n_states(program, inputs)?;
    same_length("output", outputs.iter().map(|o| o.len()), n)?;
    T::run_job(LineJob::<T, P, _, INPUTS, OUTPUTS> {
        program,
        inputs,
        n,
        visit: ColumnVisitor(outputs),
    })
}

/// [`fill_columns`] on all cores if the feature `rayon` is on, else on one.
///
/// # Errors
/// As [`fill_columns`]; of the results, all before the first state without an answer are in place.
pub fn fill_columns_in_parallel<T, P, const INPUTS: usize, const OUTPUTS: usize>(
    program: &P,
    inputs: &[&[T]; INPUTS],
    outputs: &mut [&mut [T]; OUTPUTS],
) -> Result<(), BlockError>
where
    T: BlockScalar + Send + Sync,
    P: StateProgram<T, INPUTS, OUTPUTS> + Sync,
{
    #[cfg(feature = "rayon")]
    {
        let n = n_states(program, inputs)?;
        same_length("output", outputs.iter().map(|o| o.len()), n)?;
        crate::parallel::fill_in_parallel(program, inputs, outputs, n)
    }
    #[cfg(not(feature = "rayon"))]
    fill_columns(program, inputs, outputs)
}

/// Cuts an array into columns of equal length, one per output.
///
/// # Errors
/// An array whose length is not `OUTPUTS` times that of the first input.
pub fn columns_of<T, const OUTPUTS: usize>(array: &mut [T], n: usize) -> Result<[&mut [T]; OUTPUTS], BlockError> {
    let expected = OUTPUTS * n;
    same_length("output", core::iter::once(array.len()), expected)?;
    let mut rest = array;
    Ok(core::array::from_fn(|_| {
        let (column, after) = core::mem::take(&mut rest).split_at_mut_checked(n).unwrap_or_default();
        rest = after;
        column
    }))
}

/// The common length of all inputs: how many states there are.
///
/// # Errors
/// Slices of different lengths: the first that is shorter than another.
pub fn n_states<T: BlockScalar, P, const INPUTS: usize, const OUTPUTS: usize>(
    _program: &P,
    inputs: &[&[T]; INPUTS],
) -> Result<usize, BlockError>
where
    P: StateProgram<T, INPUTS, OUTPUTS>,
{
    let n = inputs.iter().map(|i| i.len()).max().unwrap_or(0);
    let given = INPUTS.saturating_sub(P::COMPLETED);
    for (input, array) in inputs.iter().zip(P::NAMES).take(given) {
        same_length(array, core::iter::once(input.len()), n)?;
    }
    Ok(n)
}

fn same_length(
    array: &'static str,
    mut lengths: impl Iterator<Item = usize>,
    expected: usize,
) -> Result<(), BlockError> {
    let other = lengths.find(|found| *found != expected);
    other.map_or(Ok(()), |found| Err(BlockError::Length { array, found, expected }))
}

/// Evaluates all states, line by line.
struct LineJob<'a, T, P, F, const INPUTS: usize, const OUTPUTS: usize> {
    program: &'a P,
    inputs: &'a [&'a [T]; INPUTS],
    n: usize,
    visit: F,
}

impl<'a, T: BlockScalar, P, F, const INPUTS: usize, const OUTPUTS: usize> VectorJob<T>
    for LineJob<'a, T, P, F, INPUTS, OUTPUTS>
where
    P: StateProgram<T, INPUTS, OUTPUTS>,
    F: BlockVisitor<T::Line, OUTPUTS>,
{
    #[allow(
        clippy::inline_always,
        reason = "a function of its own would be compiled for the narrowest vectors"
    )]
    #[inline(always)]
    fn run_vectors<V: VectorWidth<T>>(mut self, vectors: V) -> Result<(), BlockError> {
        let zero = T::Line::splat(T::from_f64(0.0));
        let (mut lines, mut outputs) = ([zero; INPUTS], [zero; OUTPUTS]);
        let mut last = None;
        let mut first = 0;
        while first < self.n {
            let mut fault = None;
            let left = self.n - first;
            // Full lines are read in place. The last one is filled up in a buffer, as are lines whose inputs are
            // completed.
            let (inputs, len): ([&[T]; INPUTS], usize) = if P::COMPLETED == 0 && left >= T::Line::LENGTH {
                let len = left - left % T::Line::LENGTH;
                let part = |array: &'a [T]| array.get(first..first + len).unwrap_or_default();
                (self.inputs.map(part), len)
            } else {
                let mut len = T::Line::LENGTH.min(left);
                for (line, array) in lines.iter_mut().zip(self.inputs) {
                    load_line(line, array, first, len);
                }
                if P::COMPLETED > 0
                    && let Err((k, reason)) = complete_line(self.program, &mut lines, len, &mut last)
                {
                    (len, fault) = (k, Some(reason));
                }
                (lines.each_ref().map(AsRef::as_ref), len)
            };
            let mut at = 0;
            while at < len || fault.is_some() {
                let mut done = T::Line::LENGTH.min(len - at);
                let regular = fault.is_none() && vectors.run_line(self.program, &inputs, at, &mut outputs);
                if !regular && let Err((k, reason)) = run_each_state(self.program, &inputs, at, done, &mut outputs) {
                    (done, fault) = (k, Some(reason));
                }
                self.visit.visit(StateBlock {
                    first: first + at,
                    len: done,
                    outputs: &outputs,
                });
                if let Some(reason) = fault {
                    let sample = first + at + done;
                    return Err(BlockError::At { sample, reason });
                }
                at += T::Line::LENGTH;
            }
            first += len;
        }
        Ok(())
    }
}

/// Fills a line with `len` numbers of an array; the last one is repeated up to the line's end.
#[allow(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn load_line<T: BlockScalar>(line: &mut T::Line, array: &[T], first: usize, len: usize) {
    let line = line.as_mut();
    let Some(from) = array.get(first..first + len) else {
        return;
    };
    if from.len() == line.len() {
        line.copy_from_slice(from);
    } else if let Some(last) = from.last() {
        for (k, to) in line.iter_mut().enumerate() {
            *to = *from.get(k).unwrap_or(last);
        }
    }
}

/// State `k`: one entry of each input.
fn state_at<T: BlockScalar, const INPUTS: usize>(inputs: &[&[T]; INPUTS], k: usize) -> [T; INPUTS] {
    inputs.map(|input| input.get(k).copied().unwrap_or(T::from_f64(0.0)))
}

/// Completes the inputs of a line; on failure returns which state failed, and why.
#[inline(never)]
fn complete_line<T: BlockScalar, P, const INPUTS: usize, const OUTPUTS: usize>(
    program: &P,
    inputs: &mut [T::Line; INPUTS],
    len: usize,
    last: &mut Option<[T; INPUTS]>,
) -> Result<(), (usize, PoseError)>
where
    P: StateProgram<T, INPUTS, OUTPUTS>,
{
    for k in 0..len {
        let mut state = state_at(&inputs.each_ref().map(AsRef::as_ref), k);
        if let Err(reason) = program.complete(&mut state, last.as_ref()) {
            return Err((k, reason));
        }
        let given = INPUTS.saturating_sub(P::COMPLETED);
        for (line, value) in inputs.iter_mut().zip(&state).skip(given) {
            // Lanes behind the last state repeat it, so that they raise no error.
            for to in line.as_mut().iter_mut().skip(k) {
                *to = *value;
            }
        }
        *last = Some(state);
    }
    Ok(())
}

/// Evaluates the `len` states of a line that starts at index `at`, one after the other; returns which one fails, and
/// why.
#[cold]
#[inline(never)]
fn run_each_state<T: BlockScalar, P, const INPUTS: usize, const OUTPUTS: usize>(
    program: &P,
    inputs: &[&[T]; INPUTS],
    at: usize,
    len: usize,
    outputs: &mut [T::Line; OUTPUTS],
) -> Result<(), (usize, PoseError)>
where
    P: StateProgram<T, INPUTS, OUTPUTS>,
{
    for k in 0..len {
        let state = state_at(inputs, at + k);
        let mut found = [T::from_f64(0.0); OUTPUTS];
        check_finite(&state, &P::NAMES)
            .and_then(|()| program.run(&ScalarNumbers::new(), state.map(Var), &mut found))
            .map_err(|reason| (k, reason))?;
        for (line, value) in outputs.iter_mut().zip(&found) {
            if let Some(to) = line.as_mut().get_mut(k) {
                *to = *value;
            }
        }
    }
    Ok(())
}
