//! States of emitted modules, whose types differ from model to model.

/// A number of states of an emitted module that its inverse dynamics reaches, drawn about the nominal pose: the module, its
/// `InverseDynamics`, the mechanism and the number.
///
/// Panics if fewer than a quarter of the drawn states can be reached.
#[macro_export]
macro_rules! drawn_states {
    ($module:ident, $dynamics:expr, $mechanism:expr, $count:expr) => {{
        let count: usize = $count;
        let drawn = $crate::sample::Sample::random($mechanism, 4 * count, 0.2, &mut $crate::stream::Stream::new(5));
        let states: Vec<$module::State<f64>> = (0..drawn.len())
            .map(|i| $module::State {
                q: std::array::from_fn(|k| drawn.q[k][i]),
                qd: std::array::from_fn(|k| drawn.qd[k][i]),
                qdd: std::array::from_fn(|k| drawn.qdd[k][i]),
            })
            .filter(|state| $dynamics.forces(state).is_ok())
            .take(count)
            .collect();
        assert_eq!(states.len(), count, "states that can be reached");
        states
    }};
}
