//! The bundled models' emitted code, called by their names.

use std::hint::black_box;
use std::time::{Duration, Instant};

use modelmill_spec::Mechanism;

/// States that calls go through in turn: some of a smooth motion.
pub(crate) const STATES: usize = 480;
/// How long a function is called before its turn is over.
const TURN: Duration = Duration::from_millis(50);

/// A smooth motion of the active coordinates: one array per coordinate.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pub(crate) q: Vec<Vec<f64>>,
    pub(crate) qd: Vec<Vec<f64>>,
    pub(crate) qdd: Vec<Vec<f64>>,
}

impl Motion {
    /// Two seconds of a sine of its own for each coordinate, `reach` (rad or m) around the nominal pose.
    pub(crate) fn around(mechanism: &Mechanism, reach: f64) -> Self {
        let mut motion = Self {
            q: Vec::new(),
            qd: Vec::new(),
            qdd: Vec::new(),
        };
        let active = mechanism.coordinates.iter().filter(|c| !c.passive);
        for (i, coordinate) in active.enumerate() {
            let i = i as f64;
            let (speed, start) = (2.0 + 0.7 * i, 0.4 * i * i);
            let of = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
                let time = (0..STATES).map(|k| 2.0 * k as f64 / STATES as f64);
                time.map(|t| f(speed * t + start)).collect()
            };
            let centre = coordinate.nominal;
            motion.q.push(of(&|x| centre + reach * x.sin()));
            motion.qd.push(of(&|x| reach * speed * x.cos()));
            motion.qdd.push(of(&|x| -reach * speed * speed * x.sin()));
        }
        motion
    }
}

/// Nanoseconds per state of a function that goes through all states: the best of all rounds of a turn.
fn best(mut all: impl FnMut()) -> f64 {
    let (start, mut best) = (Instant::now(), f64::INFINITY);
    let mut rounds = 0;
    while rounds < 10 || start.elapsed() < TURN {
        let round = Instant::now();
        all();
        best = best.min(round.elapsed().as_secs_f64());
        rounds += 1;
    }
    best * 1e9 / STATES as f64
}

macro_rules! models {
    ($($model:ident $name:literal,)+) => {
        /// All bundled models, by the names of their files.
        pub(crate) const MODELS: &[&str] = &[$($name),+];

        /// Forces of the drives along a motion, one array for each; with which state there is none, and why.
        pub(crate) fn forces(name: &str, motion: &Motion, base: Option<&[f64]>) -> Result<Vec<Vec<f64>>, String> {
            match name {
                $($name => {
                    use modelmill_generated::$model as module;
                    let geometry = module::Geometry::<f64>::default();
                    let base: [f64; module::N_BASE] = match base {
                        Some(base) => base.try_into().map_err(|_| "wrong number of base parameters".to_owned())?,
                        None => module::base_parameters(&geometry, &module::Parameters::default()).unwrap(),
                    };
                    let dynamics = module::InverseDynamics::new(&geometry, &base);
                    let mut forces = vec![Vec::new(); module::N_DRIVES];
                    for i in 0..STATES {
                        let state = module::State {
                            q: std::array::from_fn(|k| motion.q[k][i]),
                            qd: std::array::from_fn(|k| motion.qd[k][i]),
                            qdd: std::array::from_fn(|k| motion.qdd[k][i]),
                        };
                        let found = dynamics.forces(&state).map_err(|e| format!("state {i}: {e}"))?;
                        for (column, force) in forces.iter_mut().zip(found) {
                            column.push(force);
                        }
                    }
                    Ok(forces)
                })+
                other => Err(format!("there is no bundled model {other}")),
            }
        }

        /// Nanoseconds per state of inverse dynamics and regressor, one state at a time or in blocks.
        pub(crate) fn measured(name: &str, in_blocks: bool, motion: &Motion) -> Result<[f64; 2], String> {
            match name {
                $($name => {
                    use modelmill_generated::$model as module;
                    let geometry = module::Geometry::<f64>::default();
                    let base = module::base_parameters(&geometry, &module::Parameters::default()).unwrap();
                    let model = module::Model::new(&geometry);
                    let dynamics = module::InverseDynamics::new(&geometry, &base);
                    let states = module::States::<f64> {
                        q: std::array::from_fn(|k| &motion.q[k][..]),
                        qd: std::array::from_fn(|k| &motion.qd[k][..]),
                        qdd: std::array::from_fn(|k| &motion.qdd[k][..]),
                    };
                    if in_blocks {
                        let mut forces = vec![vec![0.0; STATES]; module::N_DRIVES];
                        let mut fault = None;
                        let of_forces = best(|| {
                            let mut rest = forces.iter_mut();
                            let mut columns: [&mut [f64]; module::N_DRIVES] =
                                std::array::from_fn(|_| &mut rest.next().expect("one for each drive")[..]);
                            let done = dynamics.forces_of_many(black_box(&states), &mut columns);
                            fault = done.err().or(fault);
                            black_box(&columns);
                        });
                        let of_columns = best(|| {
                            let done = model.regressor_in_blocks(black_box(&states), |block| {
                                black_box(block.outputs);
                            });
                            fault = done.err().or(fault);
                        });
                        return fault.map_or(Ok([of_forces, of_columns]), |fault| Err(fault.to_string()));
                    }
                    let each: Vec<module::State<f64>> = (0..STATES)
                        .map(|i| module::State {
                            q: states.q.map(|c| c[i]),
                            qd: states.qd.map(|c| c[i]),
                            qdd: states.qdd.map(|c| c[i]),
                        })
                        .collect();
                    let of_forces = best(|| {
                        for state in &each {
                            _ = black_box(dynamics.forces(black_box(state)));
                        }
                    });
                    let of_columns = best(|| {
                        for state in &each {
                            _ = black_box(model.regressor(black_box(state)));
                        }
                    });
                    Ok([of_forces, of_columns])
                })+
                other => Err(format!("there is no bundled model {other}")),
            }
        }
    };
}

models! {
    arm_four_bar "arm_four_bar",
    arm_parallelogram "arm_parallelogram",
    cloos "cloos",
    delta "delta",
    delta_tied "delta_tied",
    drone "drone",
    emps "emps",
    emps_directional "emps-directional",
    five_bar "five_bar",
    four_bar "four_bar",
    gough_stewart "gough_stewart",
    gough_stewart_tied "gough_stewart_tied",
    humanoid "humanoid",
    panda "panda",
    parallelogram "parallelogram",
    puma560 "puma560",
    quadruped "quadruped",
    rx90 "rx90",
    scara "scara",
    slider_crank "slider_crank",
    spidermill "spidermill",
    spidermill_paper "spidermill-paper",
    stanford "stanford",
    three_rpr "three_rpr",
    three_rrr "three_rrr",
    two_link "two_link",
    tx40 "tx40",
}

/// A motion at whose states the model has an answer: as wide as that allows.
pub(crate) fn motion(name: &str, mechanism: &Mechanism) -> Result<Motion, String> {
    let mut reach = if mechanism.loops.is_empty() { 1.0 } else { 0.2 };
    loop {
        let motion = Motion::around(mechanism, reach);
        match forces(name, &motion, None) {
            Ok(_) => return Ok(motion),
            Err(fault) if reach < 1e-3 => return Err(fault),
            Err(_) => reach *= 0.5,
        }
    }
}
