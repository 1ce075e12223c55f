//! The watch of an emitted module.

/// The struct `Watch` of an emitted module: its model, and a [`ParameterWatch`](crate::live::ParameterWatch) of its
/// size.
///
/// In scope are `Model`, `Geometry`, `State`, `N_BASE` and `N_DRIVES`.
#[macro_export]
macro_rules! watch {
    () => {
        /// A watch over the base parameters in use: it learns how this machine moves, and identifies the parameter that
        /// changes.
        ///
        /// `BASE_PARAMETERS[change.parameter]` is what changed.
        #[derive(Clone, Copy, Debug)]
        pub struct Watch<T> {
            model: Model<T>,
            /// The estimators and the test, which do not depend on the model.
            pub live: $crate::live::ParameterWatch<T, N_BASE, N_DRIVES>,
        }

        impl<T: Real> Watch<T> {
            /// A watch that starts to learn; `base` are the base parameters in use.
            pub fn new(geometry: &Geometry<T>, base: &[T; N_BASE], options: &$crate::live::Options) -> Self {
                Self {
                    model: Model::new(geometry),
                    live: $crate::live::ParameterWatch::new(base, options),
                }
            }

            /// Adds the motion of a sample and the forces of the drives at that time, N or N m. Use `NAN` to exclude a
            /// drive, for instance at standstill.
            ///
            /// Motion and forces must have passed through the same filter.
            ///
            /// # Errors
            /// A state without an answer; the sample is not added.
            pub fn step(
                &mut self,
                state: &State<T>,
                forces: &[T; N_DRIVES],
            ) -> Result<&$crate::live::WatchVerdict<T, N_BASE>, PoseError> {
                let rows = self.model.regressor(state)?;
                Ok(self.live.step(&rows, forces))
            }
        }
    };
}
