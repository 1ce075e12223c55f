//! A request to stop a derivation, which takes minutes for some mechanisms: the caller's condition goes in, and an error
//! comes out at the next step.

use std::fmt;

use crate::DeriveError;

/// The condition under which a derivation stops. It is evaluated between steps, each of which usually takes less than a
/// second.
#[derive(Clone, Copy)]
pub struct StopRequest<'a>(Option<&'a (dyn Fn() -> bool + 'a)>);

impl<'a> StopRequest<'a> {
    /// A derivation that does not stop.
    pub const NEVER: Self = Self(None);

    /// A derivation that stops once `is_requested` is true.
    pub fn new(is_requested: &'a (dyn Fn() -> bool + 'a)) -> Self {
        Self(Some(is_requested))
    }

    /// Fails with [`DeriveError::Stopped`] once the derivation is to stop.
    pub(crate) fn check(self) -> Result<(), DeriveError> {
        match self.0 {
            Some(is_requested) if is_requested() => Err(DeriveError::Stopped),
            _ => Ok(()),
        }
    }
}

impl fmt::Debug for StopRequest<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("StopRequest")
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::path::Path;

    use super::*;
    use crate::derive_until;

    /// A derivation stops at whichever step this is requested, and never without a request. Mechanisms with a tree, with
    /// loops in closed form, and with loops whose factors are found in floating point take all paths.
    #[test]
    fn a_derivation_stops_at_every_step() {
        for name in ["puma560", "five_bar", "gough_stewart"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../model-spec/models/{name}.toml"));
            let mechanism = modelmill_spec::load_file(&path).unwrap().mechanism;
            // The number of steps, without a request.
            let steps = Cell::new(0);
            let count = || {
                steps.set(steps.get() + 1);
                false
            };
            derive_until(&mechanism, StopRequest::new(&count)).unwrap();
            let n = steps.get();
            assert!(n > 10, "{name} has {n} steps");
            for last in [1, n / 2] {
                steps.set(0);
                let is_requested = || {
                    steps.set(steps.get() + 1);
                    steps.get() >= last
                };
                let stopped = derive_until(&mechanism, StopRequest::new(&is_requested));
                assert!(matches!(stopped, Err(DeriveError::Stopped)), "{name}, step {last}");
                // Another way that is tried first asks once more.
                assert!(steps.get() <= last + 1, "{name}, step {last}: {} requests", steps.get());
            }
        }
    }
}
