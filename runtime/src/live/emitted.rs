//! What an emitted module offers of a watch.

/// The struct `Watch` of an emitted module: its own model, and [`Watch`](crate::live::ParameterWatch) of its own size.
///
/// In scope are `Model`, `Geometry`, `State`, `N_BASE` and `N_DRIVES`.
#[macro_export]
macro_rules! watch {
    () => {
        /// A watch over the base parameters in use: it learns how this machine moves, and names the one that changes.
        ///
        /// `BASE_PARAMETERS[change.parameter]` is what changed.
        #[derive(Clone, Copy, Debug)]
        pub struct Watch<T> {
            model: Model<T>,
            /// The estimators and the test, whatever the model is.
            pub live: $crate::live::ParameterWatch<T, N_BASE, N_DRIVES>,
        }

        impl<T: Real> Watch<T> {
            /// A watch that begins to learn; `base` are the base parameters in use.
            pub fn new(
                geometry: &Geometry<T>,
                base: &[T; N_BASE],
                options: &$crate::live::Options,
            ) -> Self {
                Self {
                    model: Model::new(geometry),
                    live: $crate::live::ParameterWatch::new(base, options),
                }
            }

            /// Takes the motion of a sample and the forces of the drives at that time, N or N m; `NAN` for a drive that is
            /// to be left out, as where it stands still.
            ///
            /// Motion and forces must have gone through the same filter.
            ///
            /// # Errors
            /// A state without an answer; it is not taken.
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
