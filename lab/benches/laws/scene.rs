//! A machine along a motion: forces without laws, the motion of its places, and columns of base parameters and library.
//!
//! The SpiderMill is simulated by the rig, the arm by its model file.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use modelmill::Model;
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_lab::columns::{columns, library};
use modelmill_lab::course::DrawnCourse;
use modelmill_lab::harness::in_project;
use modelmill_lab::hidden;
use modelmill_lab::placed::PlacedEffect;
use modelmill_lab::plant::{DRIVES, PlantMotion, SpidermillPlant};
use modelmill_spec::{CoordinateBounds, CoordinateIdx, MotionLimits};

/// Prescribed joints of the SpiderMill, then passive ones.
const JOINTS: [&str; 4] = ["theta1", "theta2", "gamma1", "gamma2"];
/// Limits of position (rad), rate (rad/s) and acceleration (rad/s^2) of every joint of the arm.
const REACH: [f64; 3] = [1.3, 2.5, 9.0];

/// A place along the motion.
pub(crate) struct Place {
    pub(crate) name: String,
    /// Names of position, rate and acceleration in laws.
    pub(crate) words: [String; 3],
    pub(crate) position: Vec<f64>,
    pub(crate) rate: Vec<f64>,
    pub(crate) acceleration: Vec<f64>,
    /// Force of its drive without laws; `None` for places without a drive.
    pub(crate) load: Option<Vec<f64>>,
    /// Forces of the drives for a unit force at the place, `[drive][sample]`.
    pub(crate) force: Vec<Vec<f64>>,
}

/// A machine along a motion.
pub(crate) struct Scene {
    /// Times of the samples, s.
    pub(crate) times: Vec<f64>,
    /// Coordinates, rates and accelerations with the names of their columns.
    pub(crate) states: Vec<(String, Vec<f64>)>,
    /// Forces without any law, `[drive][sample]`.
    pub(crate) plain: Vec<Vec<f64>>,
    pub(crate) places: Vec<Place>,
    /// Columns of the base parameters; rows of one drive follow those of another.
    pub(crate) base: Vec<Vec<f64>>,
    /// Columns of the library, in the same order of rows.
    pub(crate) library: Vec<Vec<f64>>,
}

impl Scene {
    pub(crate) fn place(&self, name: &str) -> Result<&Place, String> {
        let found = self.places.iter().find(|place| place.name == name);
        found.ok_or_else(|| format!("no place {name}"))
    }
}

/// A machine.
pub(crate) enum Machine {
    SpiderMill(Box<SpidermillPlant>),
    Arm(Box<Model>, PathBuf),
}

impl Machine {
    pub(crate) fn spidermill() -> Result<Self, String> {
        Ok(Self::SpiderMill(Box::new(SpidermillPlant::load()?)))
    }

    pub(crate) fn arm(file: &str) -> Result<Self, String> {
        let path = in_project("model-spec/models").join(file);
        let model = Model::open(&path).map_err(|error| error.to_string())?;
        Ok(Self::Arm(Box::new(model), path))
    }

    /// Its model file.
    pub(crate) fn file(&self) -> &Path {
        match self {
            Self::SpiderMill(plant) => &plant.model,
            Self::Arm(_, path) => path,
        }
    }

    pub(crate) fn drives(&self) -> Vec<String> {
        match self {
            Self::SpiderMill(_) => DRIVES.map(str::to_owned).to_vec(),
            Self::Arm(model, _) => model.row_names(),
        }
    }

    /// Limits of its motions.
    pub(crate) fn limits(&self) -> MotionLimits {
        match self {
            Self::SpiderMill(plant) => plant.limits().clone(),
            Self::Arm(model, _) => {
                let [position, rate, acceleration] = REACH.map(|reach| Some([-reach, reach]));
                let of_one = CoordinateBounds {
                    position,
                    rate,
                    acceleration,
                };
                let all = (0..model.active_coordinates().len()).map(|i| (CoordinateIdx(i), of_one));
                MotionLimits {
                    coordinates: all.collect(),
                    ..MotionLimits::default()
                }
            }
        }
    }

    /// The machine along a course at a sampling frequency in Hz.
    pub(crate) fn along(&self, course: &DrawnCourse, rate: f64) -> Result<Scene, String> {
        match self {
            Self::SpiderMill(plant) => spidermill(plant, course, rate),
            Self::Arm(model, _) => arm(model, course, rate),
        }
    }
}

/// Splits rows of samples times drives into one column per drive.
fn by_drive(rows: &[f64], drives: usize) -> Vec<Vec<f64>> {
    let of = |d: usize| rows.iter().skip(d).step_by(drives).copied().collect();
    (0..drives).map(of).collect()
}

/// Names of position, rate and acceleration.
fn words(position: &str, base: &str) -> [String; 3] {
    [position.to_owned(), format!("{base}_d"), format!("{base}_dd")]
}

/// The SpiderMill along a course, with places at drives and joints.
fn spidermill(plant: &SpidermillPlant, course: &DrawnCourse, rate: f64) -> Result<Scene, String> {
    let along = PlantMotion::new(&plant.rig, course, course.times(rate))?;
    let plain = by_drive(&along.plain, DRIVES.len());
    let mut places = Vec::new();
    for name in DRIVES.into_iter().chain(JOINTS) {
        let at = PlacedEffect::new("force_offset", &[name]);
        let unit = columns(&along, &at, 1.0, &[]).and_then(|all| all.into_iter().next());
        let force = by_drive(&unit.ok_or(format!("no force at {name}"))?, DRIVES.len());
        let of_rig = hidden::effect(&plant.rig, &at, &[("F0", 1.0)])?;
        let measured = (of_rig.places.first()).and_then(|place| along.of_place(*place));
        let measured = measured.ok_or(format!("{name} has no motion"))?;
        let drive = DRIVES.iter().position(|drive| *drive == name);
        places.push(Place {
            name: name.to_owned(),
            words: match drive {
                Some(_) => words(&format!("{name}_length"), name),
                None => words(name, name),
            },
            position: measured.iter().map(|m| m.value).collect(),
            rate: measured.iter().map(|m| m.rate).collect(),
            acceleration: measured.iter().map(|m| m.acceleration).collect(),
            load: drive.map(|d| plain[d].clone()),
            force,
        });
    }
    let mut states = Vec::new();
    for (k, name) in JOINTS[..2].iter().enumerate() {
        let of = |pick: fn(&modelmill_rig::RigState) -> &Vec<f64>| -> Vec<f64> {
            along.states.iter().map(|state| pick(state)[k]).collect()
        };
        states.push(((*name).to_owned(), of(|s| &s.q)));
        states.push((format!("{name}_d"), of(|s| &s.qd)));
        states.push((format!("{name}_dd"), of(|s| &s.qdd)));
    }
    let stacked = |rows: Vec<f64>| by_drive(&rows, DRIVES.len()).concat();
    let base = along.base(&plant.derivation)?;
    let mut library = library(&along);
    for joint in JOINTS {
        for kind in ["spring", "counterbalance", "drive_inertia", "quadratic_friction"] {
            let at = PlacedEffect::new(kind, &[joint]);
            library.extend(columns(&along, &at, 1.0, &[]).unwrap_or_default());
        }
    }
    for d in 0..DRIVES.len() {
        let own = along.plain.iter().enumerate();
        let own = own.map(|(i, f)| if i % DRIVES.len() == d { *f } else { 0.0 });
        library.push(own.collect());
    }
    Ok(Scene {
        base: base.into_iter().map(stacked).collect(),
        library: library.into_iter().map(stacked).collect(),
        times: along.times.clone(),
        states,
        plain,
        places,
    })
}

/// The arm along a course; its places are the drives, and each drive has its own columns of the library.
fn arm(model: &Model, course: &DrawnCourse, rate: f64) -> Result<Scene, String> {
    let times = course.times(rate);
    let all: Vec<modelmill_rig::RigState> = times.iter().map(|t| course.state_at(*t)).collect();
    let names = model.active_coordinates();
    let track = |pick: fn(&modelmill_rig::RigState) -> &Vec<f64>| -> Vec<Vec<f64>> {
        let of = |k: usize| all.iter().map(|state| pick(state)[k]).collect();
        (0..names.len()).map(of).collect()
    };
    let [q, qd, qdd] = [track(|s| &s.q), track(|s| &s.qd), track(|s| &s.qdd)];
    let states = MotionStates {
        q: q.iter().map(Vec::as_slice).collect(),
        qd: qd.iter().map(Vec::as_slice).collect(),
        qdd: qdd.iter().map(Vec::as_slice).collect(),
        load: Vec::new(),
    };
    let evaluator = ModelEvaluator::new(&model.derivation);
    let fault = |fault| format!("{fault:?}");
    let plain = evaluator.inverse_dynamics(&states, &model.values).map_err(fault)?;
    let regressor = evaluator.regressor(&states).map_err(fault)?;
    let drives = model.row_names();
    let base = (0..regressor.ncols()).map(|k| {
        let rows: Vec<f64> = regressor.column(k).iter().copied().collect();
        by_drive(&rows, drives.len()).concat()
    });
    let base = base.collect();
    let n = times.len();
    let mut places = Vec::new();
    let mut library = Vec::new();
    for (d, drive) in drives.iter().enumerate() {
        let mut force = vec![vec![0.0; n]; drives.len()];
        force[d] = vec![1.0; n];
        let mut put = |of: &dyn Fn(usize) -> f64| {
            let mut column = vec![0.0; n * drives.len()];
            for i in 0..n {
                column[d * n + i] = of(i);
            }
            library.push(column);
        };
        let (x, v, a, load) = (&q[d], &qd[d], &qdd[d], &plain[d]);
        let sign = |z: f64| if z == 0.0 { 0.0 } else { z.signum() };
        put(&|i| x[i]);
        put(&|_| 1.0);
        put(&|i| v[i]);
        put(&|i| v[i].abs());
        put(&|i| sign(v[i]));
        put(&|i| v[i] * v[i].abs());
        put(&|i| a[i]);
        put(&|i| load[i]);
        put(&|i| load[i].abs() * sign(v[i]));
        for scale in [0.03, 0.1, 0.3] {
            put(&|i| sign(v[i]) * libm::exp(-(v[i] / scale).powi(2)));
        }
        for pitch in [0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 2.0 * PI] {
            put(&|i| libm::sin(2.0 * PI * x[i] / pitch));
            put(&|i| libm::cos(2.0 * PI * x[i] / pitch));
        }
        places.push(Place {
            name: drive.clone(),
            words: words(&names[d], &names[d]),
            position: q[d].clone(),
            rate: qd[d].clone(),
            acceleration: qdd[d].clone(),
            load: Some(plain[d].clone()),
            force,
        });
    }
    let mut columns = Vec::new();
    for (k, name) in names.iter().enumerate() {
        columns.push((name.clone(), q[k].clone()));
        columns.push((format!("{name}_d"), qd[k].clone()));
        columns.push((format!("{name}_dd"), qdd[k].clone()));
    }
    Ok(Scene {
        times,
        states: columns,
        plain,
        places,
        base,
        library,
    })
}
