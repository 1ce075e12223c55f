//! What all emitted models have in common: states, motion, and how a program is called.

use crate::blocks::{BlockError, StateProgram};
use crate::{
    Loops, OutputSink, PoseError, Real, Scales, Term, Var, ZeroedOutputs, check_finite, correct, follow, solve,
};

/// Motion of the independent coordinates, rad or m, and seconds.
///
/// Of many states, each entry is a slice with one number per state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<V, const ACTIVE: usize> {
    /// Coordinates.
    pub q: [V; ACTIVE],
    /// Rates.
    pub qd: [V; ACTIVE],
    /// Accelerations.
    pub qdd: [V; ACTIVE],
}

/// Motion of the independent coordinates, for models whose friction depends on the load of the drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadedState<V, const ACTIVE: usize, const DRIVES: usize> {
    /// Coordinates.
    pub q: [V; ACTIVE],
    /// Rates.
    pub qd: [V; ACTIVE],
    /// Accelerations.
    pub qdd: [V; ACTIVE],
    /// Force or torque that each drive carries.
    pub load: [V; DRIVES],
}

/// Motion of the drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drives<T, const ACTIVE: usize, const DRIVES: usize> {
    /// Lengths or angles.
    pub coordinate: [T; DRIVES],
    /// Their rates.
    pub rate: [T; DRIVES],
    /// Derivatives of the drive coordinates by the independent coordinates.
    pub jacobian: [[T; ACTIVE]; DRIVES],
}

/// Motion of the passive coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passive<T, const PASSIVE: usize> {
    /// Coordinates.
    pub q: [T; PASSIVE],
    /// Rates.
    pub qd: [T; PASSIVE],
    /// Accelerations.
    pub qdd: [T; PASSIVE],
}

/// Some values with a Jacobian: generalised forces with that of the drives, or the gaps of loops with their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearisation<T, const VALUES: usize, const ROWS: usize> {
    /// The values.
    pub values: [T; VALUES],
    /// The Jacobian.
    pub jacobian: [[T; VALUES]; ROWS],
}

#[allow(clippy::inline_always, reason = "one store")]
impl<T, const ACTIVE: usize, const DRIVES: usize> OutputSink<T> for Drives<T, ACTIVE, DRIVES> {
    #[inline(always)]
    fn put(&mut self, k: usize, value: impl Term<T>) {
        if k < DRIVES {
            self.coordinate.put(k, value);
        } else if k < 2 * DRIVES {
            self.rate.put(k - DRIVES, value);
        } else {
            self.jacobian.put(k - 2 * DRIVES, value);
        }
    }
}

impl<T: Real, const ACTIVE: usize, const DRIVES: usize> ZeroedOutputs<T> for Drives<T, ACTIVE, DRIVES> {
    fn zeros() -> Self {
        Self {
            coordinate: ZeroedOutputs::zeros(),
            rate: ZeroedOutputs::zeros(),
            jacobian: ZeroedOutputs::zeros(),
        }
    }
}

#[allow(clippy::inline_always, reason = "one store")]
impl<T, const PASSIVE: usize> OutputSink<T> for Passive<T, PASSIVE> {
    #[inline(always)]
    fn put(&mut self, k: usize, value: impl Term<T>) {
        if k < PASSIVE {
            self.q.put(k, value);
        } else if k < 2 * PASSIVE {
            self.qd.put(k - PASSIVE, value);
        } else {
            self.qdd.put(k - 2 * PASSIVE, value);
        }
    }
}

impl<T: Real, const PASSIVE: usize> ZeroedOutputs<T> for Passive<T, PASSIVE> {
    fn zeros() -> Self {
        Self {
            q: ZeroedOutputs::zeros(),
            qd: ZeroedOutputs::zeros(),
            qdd: ZeroedOutputs::zeros(),
        }
    }
}

#[allow(clippy::inline_always, reason = "one store")]
impl<T, const VALUES: usize, const ROWS: usize> OutputSink<T> for Linearisation<T, VALUES, ROWS> {
    #[inline(always)]
    fn put(&mut self, k: usize, value: impl Term<T>) {
        if k < VALUES {
            self.values.put(k, value);
        } else {
            self.jacobian.put(k - VALUES, value);
        }
    }
}

impl<T: Real, const VALUES: usize, const ROWS: usize> ZeroedOutputs<T> for Linearisation<T, VALUES, ROWS> {
    fn zeros() -> Self {
        Self {
            values: ZeroedOutputs::zeros(),
            jacobian: ZeroedOutputs::zeros(),
        }
    }
}

#[allow(clippy::inline_always, reason = "one store")]
impl<T, const ACTIVE: usize, const PASSIVE: usize> OutputSink<T> for Scales<[T; ACTIVE], [T; PASSIVE]> {
    #[inline(always)]
    fn put(&mut self, k: usize, value: impl Term<T>) {
        if k < PASSIVE {
            self.residual.put(k, value);
        } else if k < 2 * PASSIVE {
            self.passive.put(k - PASSIVE, value);
        } else {
            self.active.put(k - 2 * PASSIVE, value);
        }
    }
}

impl<T: Real, const ACTIVE: usize, const PASSIVE: usize> ZeroedOutputs<T> for Scales<[T; ACTIVE], [T; PASSIVE]> {
    fn zeros() -> Self {
        Self {
            residual: ZeroedOutputs::zeros(),
            passive: ZeroedOutputs::zeros(),
            active: ZeroedOutputs::zeros(),
        }
    }
}

/// Runs a program for one state.
///
/// # Errors
/// An input that is NaN or too large, or a pose error of the model.
#[inline]
pub fn run_checked<T, P, R, const INPUTS: usize, const OUTPUTS: usize>(
    program: &P,
    inputs: [T; INPUTS],
) -> Result<R, PoseError>
where
    T: Real,
    P: StateProgram<T, INPUTS, OUTPUTS>,
    R: ZeroedOutputs<T>,
{
    check_finite(&inputs, &P::NAMES)?;
    let mut results = R::zeros();
    program.run(&crate::ScalarNumbers::new(), inputs.map(Var), &mut results)?;
    Ok(results)
}

/// Runs a program that does not check its inputs.
#[inline]
pub fn run_unchecked<T, P, R, const INPUTS: usize, const OUTPUTS: usize>(program: &P, inputs: [T; INPUTS]) -> R
where
    T: Real,
    P: StateProgram<T, INPUTS, OUTPUTS>,
    R: ZeroedOutputs<T>,
{
    let mut results = R::zeros();
    // Nothing in such a program can fail.
    _ = program.run(&crate::ScalarNumbers::new(), inputs.map(Var), &mut results);
    results
}

/// Interface of the runtime to a program: its inputs, its arithmetic, and the destination of its results.
pub trait Run<T: Real, const INPUTS: usize>: crate::Numbers<Scalar = T> {
    /// The inputs.
    fn inputs(&self) -> [Var<Self::Value>; INPUTS];
    /// Takes result `k`; results begin as zeros.
    fn put(&mut self, k: usize, value: impl Term<Self::Value>);
}

/// Inputs, arithmetic and destination of one run of a program.
#[derive(Debug)]
pub struct ProgramRun<'a, N: crate::Numbers, O, const INPUTS: usize> {
    /// The arithmetic.
    pub numbers: &'a N,
    /// The inputs.
    pub inputs: [Var<N::Value>; INPUTS],
    /// Where results go.
    pub outputs: &'a mut O,
}

#[allow(clippy::inline_always, reason = "as the arithmetic itself")]
impl<N: crate::Numbers, O, const INPUTS: usize> crate::Numbers for ProgramRun<'_, N, O, INPUTS> {
    type Scalar = N::Scalar;
    type Value = N::Value;

    #[inline(always)]
    fn broadcast(&self, x: N::Scalar) -> Var<N::Value> {
        self.numbers.broadcast(x)
    }
    #[inline(always)]
    fn sin_cos(&self, angle: impl Term<N::Value>) -> (Var<N::Value>, Var<N::Value>) {
        self.numbers.sin_cos(angle)
    }
    #[inline(always)]
    fn angles<const K: usize>(&self, angles: [Var<N::Value>; K]) -> crate::AngleBatch<N::Value, K> {
        self.numbers.angles(angles)
    }
    #[inline(always)]
    fn sin_cos_of<const K: usize>(
        &self,
        angles: &crate::AngleBatch<N::Value, K>,
        k: usize,
    ) -> (Var<N::Value>, Var<N::Value>) {
        self.numbers.sin_cos_of(angles, k)
    }
    #[inline(always)]
    fn reachable(&self, x: impl Term<N::Value>) -> Result<(), PoseError> {
        self.numbers.reachable(x)
    }
    #[inline(always)]
    fn regular(&self, x: impl Term<N::Value>, size: impl Term<N::Value>) -> Result<(), PoseError> {
        self.numbers.regular(x, size)
    }
    #[inline(always)]
    fn finite(&self, x: impl Term<N::Value>) -> Result<(), PoseError> {
        self.numbers.finite(x)
    }
}

#[allow(clippy::inline_always, reason = "as the arithmetic itself")]
impl<T, N, O, const INPUTS: usize> Run<T, INPUTS> for ProgramRun<'_, N, O, INPUTS>
where
    T: Real,
    N: crate::Numbers<Scalar = T>,
    O: OutputSink<N::Value>,
{
    #[inline(always)]
    fn inputs(&self) -> [Var<N::Value>; INPUTS] {
        self.inputs
    }
    #[inline(always)]
    fn put(&mut self, k: usize, value: impl Term<N::Value>) {
        self.outputs.put(k, value);
    }
}

/// Makes a method of an emitted struct a program that the runtime can run.
#[macro_export]
macro_rules! program {
    ($item:ident, $owner:ident, $method:ident, $names:expr, $inputs:expr, $outputs:expr) => {
        struct $item<'a, T>(&'a $owner<T>);

        impl<T: $crate::Real> $crate::blocks::StateProgram<T, $inputs, $outputs> for $item<'_, T> {
            const NAMES: [&'static str; $inputs] = $names;

            #[inline(always)]
            fn run<N: $crate::Numbers<Scalar = T>>(
                &self,
                numbers: &N,
                inputs: [$crate::Var<N::Value>; $inputs],
                outputs: &mut impl $crate::OutputSink<N::Value>,
            ) -> Result<(), $crate::PoseError> {
                self.0.$method(&mut $crate::ProgramRun {
                    numbers,
                    inputs,
                    outputs,
                })
            }
        }
    };
}

/// A struct of named quantities with the table of their names, units and values in the model file, which are its
/// default.
///
/// `as` gives the name in the model file where that name is not a valid Rust identifier.
#[macro_export]
macro_rules! record {
    ($(#[$doc:meta])* $record:ident, $table:ident:) => {
        /// Names, units, and the model file's values: none.
        pub const $table: [$crate::Quantity; 0] = [];

        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $record<T> {
            nothing: ::core::marker::PhantomData<T>,
        }

        impl<T: $crate::Real> Default for $record<T> {
            fn default() -> Self {
                Self { nothing: ::core::marker::PhantomData }
            }
        }

        #[allow(dead_code)]
        impl<T: $crate::Real> $record<T> {
            fn check(&self) -> Result<(), $crate::PoseError> {
                Ok(())
            }
        }
    };
    ($(#[$doc:meta])* $record:ident, $table:ident: $($field:ident $(as $name:literal)?: $unit:literal = $value:expr),+ $(,)?) => {
        /// Names, units, and the model file's values.
        pub const $table: [$crate::Quantity; [$($unit),+].len()] = [
            $($crate::Quantity::new($crate::record!(@name $field $($name)?), $unit, $value)),+
        ];

        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $record<T> {
            $(#[doc = concat!("Unit: ", $unit, ".")] pub $field: T),+
        }

        impl<T: $crate::Real> Default for $record<T> {
            fn default() -> Self {
                Self { $($field: T::from_f64($value)),+ }
            }
        }

        #[allow(dead_code)]
        impl<T: $crate::Real> $record<T> {
            /// Returns an error with the name of the first value that is NaN or too large to compute with.
            fn check(&self) -> Result<(), $crate::PoseError> {
                $crate::check_finite(&[$(self.$field),+], &$table.map(|quantity| quantity.name))
            }

            /// The same as variables of a program.
            #[inline(always)]
            fn as_variables<N: $crate::Numbers<Scalar = T>>(&self, n: &N) -> $record<$crate::Var<N::Value>> {
                $record { $($field: n.broadcast(self.$field)),+ }
            }
        }
    };
    (@name $field:ident) => {
        stringify!($field)
    };
    (@name $field:ident $name:literal) => {
        $name
    };
}

/// Entries of an array that are the same at every state, as variables.
#[macro_export]
macro_rules! read {
    ($n:ident, $array:expr; $($name:ident = $k:literal),+ $(,)?) => {
        $(let $name = $n.broadcast($array[$k]);)+
    };
}

/// Values of variables, in an array.
#[macro_export]
macro_rules! values {
    ($($variable:expr),* $(,)?) => {
        [$($variable.get()),*]
    };
}

/// Variables of computed values, in an array.
#[macro_export]
macro_rules! variables {
    ($($term:expr),* $(,)?) => {
        [$($term.var()),*]
    };
}

/// Accelerations of the independent coordinates: `M q'' = J' f - bias`.
///
/// # Errors
/// A force that is NaN or too large, or a mass matrix that is singular.
pub fn accelerations<T: Real, const ACTIVE: usize, const DRIVES: usize>(
    mut mass_matrix: [[T; ACTIVE]; ACTIVE],
    bias: &Linearisation<T, ACTIVE, DRIVES>,
    forces: &[T; DRIVES],
    drives: &[&'static str; DRIVES],
) -> Result<[T; ACTIVE], PoseError> {
    check_finite(forces, drives)?;
    let mut accelerations = bias.values.map(|x| -x);
    for (row, force) in bias.jacobian.iter().zip(forces) {
        for (sum, slope) in accelerations.iter_mut().zip(row) {
            *sum = *sum + *slope * *force;
        }
    }
    solve(&mut mass_matrix, &mut accelerations)?;
    if !accelerations.iter().all(|x| x.is_finite()) {
        return Err(PoseError::Singular);
    }
    Ok(accelerations)
}

/// A model whose passive coordinates are computed by Newton's method.
pub trait Assembly: Loops {
    /// How many passive coordinates there are.
    const N_PASSIVE: usize;

    /// Independent coordinates of the nominal pose.
    fn nominal_active(&self) -> Self::Active;

    /// Passive coordinates of the nominal pose.
    ///
    /// # Errors
    /// A geometry that is not finite, or whose loops cannot be closed.
    fn nominal_passive(&self) -> Result<Self::Passive, PoseError>;

    /// Names of the independent coordinates.
    fn names(&self) -> &'static [&'static str];

    /// Passive coordinates of a pose, in the assembly mode of the nominal pose. They are followed from there along a
    /// straight line of the independent coordinates, with three to five steps of Newton's method for every half radian.
    ///
    /// # Errors
    /// A pose that is out of reach, that cannot be followed from the nominal one, that is singular, or that is not
    /// finite.
    fn passive_position(&self, q: &Self::Active) -> Result<Self::Passive, PoseError>
    where
        Self: Sized,
    {
        let nominal = self.nominal_passive()?;
        check_finite(q.as_ref(), self.names())?;
        follow(self, &self.nominal_active(), &nominal, q)
    }

    /// Passive coordinates of a pose, starting from those of a pose near by; in a controller, from those of the last
    /// cycle. A motion of some hundredths of a radian takes two or three steps of Newton's method. If the guess is too
    /// far away to guarantee the assembly mode, the pose is followed from the nominal one.
    ///
    /// # Errors
    /// As [`Self::passive_position`].
    fn passive_position_near(&self, q: &Self::Active, guess: &Self::Passive) -> Result<Self::Passive, PoseError>
    where
        Self: Sized,
    {
        self.nominal_passive()?;
        check_finite(q.as_ref(), self.names())?;
        correct(self, q, guess).or_else(|_| self.passive_position(q))
    }
}

/// A program whose last inputs are the passive coordinates of a model, which are followed from state to state.
#[derive(Clone, Copy, Debug)]
pub struct ContinuationProgram<'a, P, M>(pub P, pub &'a M);

impl<T, P, M, const INPUTS: usize, const OUTPUTS: usize> StateProgram<T, INPUTS, OUTPUTS>
    for ContinuationProgram<'_, P, M>
where
    T: Real,
    P: StateProgram<T, INPUTS, OUTPUTS>,
    M: Assembly<Number = T>,
{
    const NAMES: [&'static str; INPUTS] = P::NAMES;
    const COMPLETED: usize = M::N_PASSIVE;

    #[allow(clippy::inline_always, reason = "as the program itself")]
    #[inline(always)]
    fn run<N: crate::Numbers<Scalar = T>>(
        &self,
        numbers: &N,
        inputs: [Var<N::Value>; INPUTS],
        outputs: &mut impl OutputSink<N::Value>,
    ) -> Result<(), PoseError> {
        self.0.run(numbers, inputs, outputs)
    }

    fn complete(&self, inputs: &mut [T; INPUTS], last: Option<&[T; INPUTS]>) -> Result<(), PoseError> {
        let model = self.1;
        let active = |from: &[T; INPUTS]| {
            let mut q = model.nominal_active();
            for (to, from) in q.as_mut().iter_mut().zip(from) {
                *to = *from;
            }
            q
        };
        let given = INPUTS.saturating_sub(M::N_PASSIVE);
        let q = active(inputs);
        // Followed from the previous state in a straight line; if that fails, from the nominal pose.
        let near = last.and_then(|last| {
            let mut passive = model.nominal_passive().ok()?;
            for (to, from) in passive.as_mut().iter_mut().zip(last.iter().skip(given)) {
                *to = *from;
            }
            follow(model, &active(last), &passive, &q).ok()
        });
        let passive = match near {
            Some(passive) => passive,
            None => model.passive_position(&q)?,
        };
        for (to, from) in inputs.iter_mut().skip(given).zip(passive.as_ref()) {
            *to = *from;
        }
        Ok(())
    }
}

/// Checks base parameters.
///
/// # Errors
/// [`PoseError::NotFinite`] with the name of the first that is NaN or too large to compute with.
pub fn check_base<T: Real, const N: usize>(
    values: &[T; N],
    parameters: &[crate::BaseParameter; N],
) -> Result<(), PoseError> {
    check_finite(values, &parameters.map(|parameter| parameter.name))
}

/// Converts an input error of a model into the error of an evaluation over many states.
///
/// # Errors
/// The same error, reported at the first state.
pub fn check_block_input(input: Result<(), PoseError>) -> Result<(), BlockError> {
    input.map_err(|reason| BlockError::At { sample: 0, reason })
}

/// The methods of an emitted `InverseDynamics` over many states.
///
/// In scope are `States`, `inputs`, `N_DRIVES` and the program `Forces`. With `followed`, passive coordinates are
/// computed first.
#[macro_export]
macro_rules! forces_of_many {
    () => {
        $crate::forces_of_many!(@ |model| Forces(model), inputs);
    };
    (followed) => {
        $crate::forces_of_many!(@ |model| $crate::ContinuationProgram(Forces(model), &model.model), {
            |states: &States<'a, T>| inputs_with_passive(states, &[&[]; N_PASSIVE])
        });
    };
    (@ |$model:ident| $program:expr, $inputs:tt) => {
        impl<T: $crate::blocks::BlockScalar> InverseDynamics<T> {
            /// [`Self::forces`] at many states, in the widest vectors of the machine if the runtime has its feature
            /// `std`.
            ///
            /// One array per drive, as long as those of the states.
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer, with the results of all before it
            /// in place.
            pub fn forces_of_many<'a>(
                &self,
                states: &States<'a, T>,
                outputs: &mut [&mut [T]; N_DRIVES],
            ) -> Result<(), $crate::blocks::BlockError> {
                $crate::check_block_input(self.input)?;
                let $model = self;
                $crate::blocks::fill_columns(&$program, &$inputs(states), outputs)
            }

            /// [`Self::forces_of_many`] on all cores, if the runtime has its feature `rayon`.
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer.
            pub fn forces_of_many_in_parallel<'a>(
                &self,
                states: &States<'a, T>,
                outputs: &mut [&mut [T]; N_DRIVES],
            ) -> Result<(), $crate::blocks::BlockError>
            where
                T: Send + Sync,
            {
                $crate::check_block_input(self.input)?;
                let $model = self;
                $crate::blocks::fill_columns_in_parallel(&$program, &$inputs(states), outputs)
            }

            /// [`Self::forces`] at many states, passed on block by block; nothing is kept between blocks.
            ///
            /// Output `d` of a block belongs to drive `d`.
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer, after all blocks before it have
            /// been passed on.
            pub fn forces_in_blocks<'a>(
                &self,
                states: &States<'a, T>,
                visit: impl FnMut($crate::blocks::StateBlock<'_, T::Line, N_DRIVES>),
            ) -> Result<(), $crate::blocks::BlockError> {
                $crate::check_block_input(self.input)?;
                let $model = self;
                $crate::blocks::visit_blocks(&$program, &$inputs(states), visit)
            }
        }
    };
}

/// The methods of an emitted `Model` over many states.
///
/// In scope are `States`, `inputs`, `N_DRIVES`, `N_BASE` and the program `Regressor`. With `followed`, passive
/// coordinates are computed first.
#[macro_export]
macro_rules! regressor_of_many {
    () => {
        $crate::regressor_of_many!(@ |model| Regressor(model), inputs);
    };
    (followed) => {
        $crate::regressor_of_many!(@ |model| $crate::ContinuationProgram(Regressor(model), model), {
            |states: &States<'a, T>| inputs_with_passive(states, &[&[]; N_PASSIVE])
        });
    };
    (@ |$model:ident| $program:expr, $inputs:tt) => {
        impl<T: $crate::blocks::BlockScalar> Model<T> {
            /// [`Self::regressor`] at many states, in the widest vectors of the machine if the runtime has its feature
            /// `std`.
            ///
            /// One column of all states after the other: first those of the first drive, one per base parameter.
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer, with the results of all before it
            /// in place.
            pub fn regressor_of_many<'a>(
                &self,
                states: &States<'a, T>,
                outputs: &mut [T],
            ) -> Result<(), $crate::blocks::BlockError> {
                $crate::check_block_input(self.input)?;
                let ($model, inputs) = (self, $inputs(states));
                let n = $crate::blocks::n_states(&$program, &inputs)?;
                let mut columns = $crate::blocks::columns_of(outputs, n)?;
                $crate::blocks::fill_columns(&$program, &inputs, &mut columns)
            }

            /// [`Self::regressor_of_many`] on all cores, if the runtime has its feature `rayon`.
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer.
            pub fn regressor_of_many_in_parallel<'a>(
                &self,
                states: &States<'a, T>,
                outputs: &mut [T],
            ) -> Result<(), $crate::blocks::BlockError>
            where
                T: Send + Sync,
            {
                $crate::check_block_input(self.input)?;
                let ($model, inputs) = (self, $inputs(states));
                let n = $crate::blocks::n_states(&$program, &inputs)?;
                let mut columns = $crate::blocks::columns_of(outputs, n)?;
                $crate::blocks::fill_columns_in_parallel(&$program, &inputs, &mut columns)
            }

            /// [`Self::regressor`] at many states, passed on block by block; nothing is kept between blocks.
            ///
            /// Output `d * N_BASE + b` of a block belongs to drive `d` and base parameter `b`.
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer, after all blocks before it have
            /// been passed on.
            pub fn regressor_in_blocks<'a>(
                &self,
                states: &States<'a, T>,
                visit: impl FnMut($crate::blocks::StateBlock<'_, T::Line, { N_DRIVES * N_BASE }>),
            ) -> Result<(), $crate::blocks::BlockError> {
                $crate::check_block_input(self.input)?;
                let $model = self;
                $crate::blocks::visit_blocks(&$program, &$inputs(states), visit)
            }
        }
    };
}
