//! Shapes: functions of one variable, with constants. Input: a variable along the recordings; output: one or two
//! columns of numbers.
//!
//! Sources: B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (1994), for friction over speed and
//! load; P. R. Dahl, AIAA Journal 14 (1976), and Y.-K. Wen, J. Eng. Mech. 102 (1976), for states that remember; L.
//! Prandtl 1928 and A. Ishlinskii 1944 for the spring that drags a block.

/// Variable of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LawVariable {
    /// Position of the place on which the law acts, m or rad.
    Position,
    /// Its rate, m/s or rad/s.
    Rate,
    /// Its acceleration, m/s^2 or rad/s^2.
    Acceleration,
    /// Load of its drive, N or N m.
    Load,
    /// Position of another place, m or rad.
    OtherPosition,
    /// Rate of the other place, m/s or rad/s.
    OtherRate,
}

/// A function of one variable `z`. Its constants have the unit of `z`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LawShape {
    /// `|z|^(halves/2)`, with the sign of `z` if it is odd. Powers with a fractional exponent are of `z/scale`.
    Power {
        /// Twice the exponent.
        halves: i32,
        /// Whether it has the sign of `z`.
        is_odd: bool,
        /// Divides `z` if the exponent is fractional.
        scale: f64,
    },
    /// `(z - centre)^power`
    Shifted {
        /// Where it is zero.
        centre: f64,
        /// The exponent.
        power: i32,
    },
    /// `z - from` beyond `from` on one side and zero before, raised to a power: for example an end stop.
    Hinge {
        /// Where it begins.
        from: f64,
        /// 1 if it acts above, -1 if below.
        side: f64,
        /// The exponent.
        power: i32,
    },
    /// `sin(2 pi z/pitch)` and `cos(2 pi z/pitch)`
    Wave {
        /// Period.
        pitch: f64,
    },
    /// `exp(-((z - centre)/width)^2)`
    Bump {
        /// Where it is largest.
        centre: f64,
        /// Where it has fallen to 1/e.
        width: f64,
    },
    /// `(z - centre)/width*exp(-((z - centre)/width)^2)`: attraction to a nearby place, as by a detent.
    Detent {
        /// The place of attraction.
        centre: f64,
        /// Range of the attraction.
        width: f64,
    },
    /// `tanh((z - centre)/width)`
    Step {
        /// Where it changes its sign.
        centre: f64,
        /// Distance over which the sign changes.
        width: f64,
    },
    /// `sign(z)*exp(-(|z|/scale)^(halves/2))`: friction that decreases with speed, after R. Stribeck.
    Fading {
        /// Where it has fallen to 1/e.
        scale: f64,
        /// Twice the exponent.
        halves: i32,
    },
    /// A state between -1 and 1 that approaches the sign of the direction of motion: `dz/dx = (1 - (z sign(x'))^curve
    /// ...)/length`, Dahl's model with `curve` 1, that of Bouc and Wen with 2.
    Memory {
        /// Travel over which it approaches the bound.
        length: f64,
        /// Exponent of the approach: 1 or 2.
        curve: i32,
    },
    /// Elongation of a spring that drags a block, between -1 and 1.
    Slip {
        /// Travel from zero to the largest elongation.
        width: f64,
    },
}

/// Kind of a shape without its constants: number of the variant, exponent, and sign or side.
pub(crate) type LawShapeKind = (u8, i32, bool);

impl LawShape {
    /// `z`
    pub const LINEAR: Self = Self::integer_power(1, true);
    /// `sign(z)`
    pub const SIGN: Self = Self::integer_power(0, true);
    /// `|z|`
    pub const MAGNITUDE: Self = Self::integer_power(1, false);

    /// An integer power of `z`, with its sign if `is_odd`.
    pub const fn integer_power(power: i32, is_odd: bool) -> Self {
        Self::Power {
            halves: 2 * power,
            is_odd,
            scale: 1.0,
        }
    }

    /// Its kind, equal for shapes that differ in their constants only.
    pub(crate) fn shape_kind(self) -> LawShapeKind {
        match self {
            Self::Power { halves, is_odd, .. } => (0, halves, is_odd),
            Self::Shifted { power, .. } => (1, power, true),
            Self::Hinge { side, power, .. } => (2, power, side > 0.0),
            Self::Wave { .. } => (3, 0, true),
            Self::Bump { .. } => (4, 0, false),
            Self::Detent { .. } => (5, 0, true),
            Self::Step { .. } => (6, 0, true),
            Self::Fading { halves, .. } => (7, halves, true),
            Self::Memory { curve, .. } => (8, curve, true),
            Self::Slip { .. } => (9, 0, true),
        }
    }

    /// Whether it depends on the past motion, so that no formula of the present state describes it.
    pub fn has_memory(self) -> bool {
        matches!(self, Self::Memory { .. } | Self::Slip { .. })
    }

    /// Power of the variable's unit in its values.
    pub(crate) fn unit_exponent(self) -> i32 {
        match self {
            Self::Power { halves, .. } if halves % 2 == 0 => halves / 2,
            Self::Shifted { power, .. } | Self::Hinge { power, .. } => power,
            _ => 0,
        }
    }

    /// Number of its constants that are searched.
    pub(crate) fn freedoms(self) -> usize {
        match self {
            Self::Power { .. } => 0,
            Self::Bump { .. } | Self::Detent { .. } => 2,
            Self::Step { centre, .. } => 1 + usize::from(centre != 0.0),
            _ => 1,
        }
    }

    /// Its columns along a variable; segments of samples begin at `starts`.
    pub(crate) fn values(self, z: &[f64], starts: &[usize]) -> Vec<Vec<f64>> {
        let each = |of: &dyn Fn(f64) -> f64| vec![z.iter().map(|z| of(*z)).collect()];
        match self {
            Self::Power { halves, is_odd, scale } => {
                let size = move |z: f64| -> f64 {
                    let z = z.abs() / scale;
                    let whole = z.powi(halves / 2);
                    if halves % 2 == 0 { whole } else { whole * z.sqrt() }
                };
                if is_odd {
                    each(&|z| sign(z) * size(z))
                } else {
                    each(&size)
                }
            }
            Self::Shifted { centre, power } => each(&|z| (z - centre).powi(power)),
            Self::Hinge { from, side, power } => each(&|z| (side * (z - from)).max(0.0).powi(power)),
            Self::Wave { pitch } => {
                let wave = z.iter().map(|z| (std::f64::consts::TAU * z / pitch).sin_cos());
                let (sin, cos) = wave.unzip();
                vec![sin, cos]
            }
            Self::Bump { centre, width } => each(&|z| (-((z - centre) / width).powi(2)).exp()),
            Self::Detent { centre, width } => each(&|z| {
                let near = (z - centre) / width;
                near * (-near * near).exp()
            }),
            Self::Step { centre, width } => each(&|z| ((z - centre) / width).tanh()),
            Self::Fading { scale, halves } => each(&|z| {
                let share = z.abs() / scale;
                let power = match halves {
                    1 => share.sqrt(),
                    2 => share,
                    _ => share.powf(0.5 * f64::from(halves)),
                };
                sign(z) * (-power).exp()
            }),
            Self::Memory { length, curve } => vec![hysteresis_state(z, starts, length, curve)],
            Self::Slip { width } => vec![dragged_spring(z, starts, width)],
        }
    }

    /// The same shape with one of its [`Self::freedoms`] constants changed, by a share `step` of what is usual for a
    /// variable between `low` and `high`.
    pub(crate) fn with_moved_constant(self, which: usize, step: f64, [low, high]: [f64; 2]) -> Self {
        let travel = high - low;
        let along = |x: f64| x + step * travel;
        // A shape that is wider than the range is another shape.
        let widest = travel.max(high.abs()).max(low.abs());
        let times = |x: f64| (x * (4.0 * step).exp()).min(widest);
        match (self, which) {
            (Self::Shifted { centre, power }, _) => Self::Shifted {
                centre: along(centre),
                power,
            },
            (Self::Hinge { from, side, power }, _) => Self::Hinge {
                from: along(from).clamp(low, high),
                side,
                power,
            },
            // Waves differ by how often they fit into the travel.
            (Self::Wave { pitch }, _) => Self::Wave {
                pitch: travel / (travel / pitch + 3.0 * step).max(0.2),
            },
            (Self::Bump { centre, width }, 0) => Self::Bump {
                centre: along(centre),
                width,
            },
            (Self::Bump { centre, width }, _) => Self::Bump {
                centre,
                width: times(width),
            },
            (Self::Detent { centre, width }, 0) => Self::Detent {
                centre: along(centre),
                width,
            },
            (Self::Detent { centre, width }, _) => Self::Detent {
                centre,
                width: times(width),
            },
            (Self::Step { centre, width }, 0) => Self::Step {
                centre,
                width: times(width),
            },
            (Self::Step { centre, width }, _) => Self::Step {
                centre: along(centre),
                width,
            },
            (Self::Fading { scale, halves }, _) => Self::Fading {
                scale: times(scale),
                halves,
            },
            (Self::Memory { length, curve }, _) => Self::Memory {
                length: times(length),
                curve,
            },
            (Self::Slip { width }, _) => Self::Slip { width: times(width) },
            (Self::Power { .. }, _) => self,
        }
    }
}

/// The sign of a number; 0 for 0.
fn sign(z: f64) -> f64 {
    if z == 0.0 { 0.0 } else { z.signum() }
}

/// Integrates a state along a position. `next` gets the state and the change of position; the state starts at zero in
/// each segment.
fn integrate_along(z: &[f64], starts: &[usize], mut next: impl FnMut(f64, f64) -> f64) -> Vec<f64> {
    let mut state = 0.0;
    let mut begins = starts.iter().copied().peekable();
    let mut before = 0.0;
    let step = |(i, x): (usize, &f64)| {
        if begins.next_if_eq(&i).is_some() {
            state = 0.0;
            before = *x;
        }
        state = next(state, x - before);
        before = *x;
        state
    };
    z.iter().enumerate().map(step).collect()
}

/// `dz/dx = (sign(x') - z)/length`, or `(1 - z^2 sign(z x')...)` in the form of Bouc and Wen. In the second form it
/// returns faster after a reversal than it approached, so that loops close.
fn hysteresis_state(z: &[f64], starts: &[usize], length: f64, curve: i32) -> Vec<f64> {
    integrate_along(z, starts, |state, moved| {
        let way = sign(moved);
        let gone = moved.abs() / length;
        if curve == 1 {
            // Exact for a linear motion between samples.
            way + (state - way) * (-gone).exp()
        } else {
            // z' = 1 - z|z| in the direction of motion, integrated in up to 40 steps.
            let mut own = way * state;
            let parts = (4.0 * gone).ceil().clamp(1.0, 40.0);
            let mut left = parts;
            while left > 0.0 {
                own += (1.0 - own * own.abs()) * gone / parts;
                left -= 1.0;
            }
            way * own.min(1.0)
        }
    })
}

/// Elongation of a spring that drags a block, relative to its largest elongation.
fn dragged_spring(z: &[f64], starts: &[usize], width: f64) -> Vec<f64> {
    integrate_along(z, starts, |state, moved| (state + moved / width).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(shape: LawShape, z: f64) -> f64 {
        shape.values(&[z], &[0])[0][0]
    }

    #[test]
    fn shapes_have_their_values() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(at(LawShape::LINEAR, -1.5), -1.5);
        close(at(LawShape::SIGN, -1.5), -1.0);
        close(at(LawShape::integer_power(2, true), -3.0), -9.0);
        close(at(LawShape::integer_power(2, false), -3.0), 9.0);
        let power = LawShape::Power {
            halves: 3,
            is_odd: true,
            scale: 2.0,
        };
        close(at(power, -8.0), -8.0);
        let beyond = LawShape::Hinge {
            from: 1.0,
            side: -1.0,
            power: 2,
        };
        close(at(beyond, 0.5), 0.25);
        close(at(beyond, 1.5), 0.0);
        let fading = LawShape::Fading { scale: 2.0, halves: 4 };
        close(at(fading, -2.0), -(-1.0_f64).exp());
    }

    /// All that remember go to the sign of the way gone and stay there, and back over a length after it reverses.
    #[test]
    fn what_remembers_goes_to_its_bound_and_back() {
        let there = (0..400).map(|i| f64::from(i) * 0.01);
        let back = (0..400).map(|i| 4.0 - f64::from(i) * 0.01);
        let way: Vec<f64> = there.chain(back).collect();
        let shapes = [
            LawShape::Memory { length: 0.2, curve: 1 },
            LawShape::Memory { length: 0.2, curve: 2 },
            LawShape::Slip { width: 0.2 },
        ];
        for shape in shapes {
            let state = &shape.values(&way, &[0])[0];
            assert!((state[399] - 1.0).abs() < 1e-3, "{shape:?}");
            assert!(state[405] > 0.0 && state[405] < 1.0, "{shape:?}");
            assert!((state[799] + 1.0).abs() < 1e-3, "{shape:?}");
            // Another recording knows nothing of it.
            let state = &shape.values(&way, &[0, 400])[0];
            assert!(state[400].abs() < f64::MIN_POSITIVE, "{shape:?}");
        }
    }
}
