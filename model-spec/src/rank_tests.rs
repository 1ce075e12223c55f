//! The bundled models are the mechanisms of the literature: they have the published numbers of base parameters.
//!
//! Counted in a way that shares nothing with the reduction of the generator: parameters whose columns of kinetic and
//! potential energy are dependent up to a constant cannot be told apart (Gautier and Khalil, 1990), on the closed
//! loops as in the open chain.

use std::path::Path;

use crate::exact::{ExactExpression, ModelSymbol, ParameterIdx, PlaceQuantity};
use crate::kinematics::{FramePose, Vec3, frame_poses, position};
use crate::mechanism::{EffectPlace, Mechanism, PartInertia};
use crate::numeric::{DenseRows, least_squares, rank};
use crate::pose::loop_gaps;

/// Numbers between -1 and 1 that are the same everywhere (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn add(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|k| a[k] + b[k])
}

/// A vector of the base frame in a frame.
fn into_frame(pose: &FramePose, v: Vec3) -> Vec3 {
    std::array::from_fn(|j| (0..3).map(|k| pose.rotation[k][j] * v[k]).sum())
}

/// Angular velocity and velocity of the origin of a frame, in the base frame.
fn velocity(mechanism: &Mechanism, poses: &[FramePose], frame: usize, rates: &[f64]) -> (Vec3, Vec3) {
    let at = poses[frame].origin;
    let (mut angular, mut linear) = ([0.0; 3], [0.0; 3]);
    let mut up = frame;
    while up != 0 {
        for moved in &poses[up].motions {
            let rate = moved.factor * rates[moved.coordinate.0];
            let axis = moved.axis.map(|x| x * rate);
            if moved.is_rotation {
                angular = add(angular, axis);
                let arm = std::array::from_fn(|k| at[k] - moved.origin[k]);
                linear = add(linear, cross(axis, arm));
            } else {
                linear = add(linear, axis);
            }
        }
        up = mechanism.frames[up].parent.0;
    }
    (angular, linear)
}

/// A pose and rates that fulfil the loops, somewhere around the nominal pose.
///
/// The pose moves there in small steps, so that it stays on the branch of the nominal assembly.
fn draw(mechanism: &mut Mechanism, nominal: &[f64], random: &mut Random) -> Vec<f64> {
    loop {
        if let Some(rates) = try_draw(mechanism, nominal, random) {
            return rates;
        }
    }
}

/// `None` where the loops cannot follow.
fn try_draw(mechanism: &mut Mechanism, nominal: &[f64], random: &mut Random) -> Option<Vec<f64>> {
    let closed = !mechanism.loops.is_empty();
    let spread = if closed { 0.3 } else { 2.0 };
    let targets: Vec<f64> = nominal.iter().map(|value| value + spread * random.next()).collect();
    let mut rates: Vec<f64> = nominal.iter().map(|_| random.next()).collect();
    let passive: Vec<usize> = (0..nominal.len())
        .filter(|&i| mechanism.coordinates[i].passive)
        .collect();
    for (i, value) in nominal.iter().enumerate() {
        mechanism.coordinates[i].nominal = *value;
    }
    for step in 1..=10 {
        let way = f64::from(step) / 10.0;
        for i in (0..nominal.len()).filter(|i| !passive.contains(i)) {
            mechanism.coordinates[i].nominal = nominal[i] + way * (targets[i] - nominal[i]);
        }
        for _ in 0..6 {
            let found = loop_gaps(mechanism);
            let rows = of_passive(&found.rows, &passive);
            if let Some(change) = least_squares(&rows, &found.values, 0.0) {
                for (&i, change) in passive.iter().zip(change) {
                    mechanism.coordinates[i].nominal -= change;
                }
            }
        }
        if loop_gaps(mechanism).values.iter().any(|gap| gap.abs() > 1e-12) {
            return None;
        }
    }
    let found = loop_gaps(mechanism);
    let driven: Vec<f64> = found
        .rows
        .iter()
        .map(|row| {
            let active = (0..rates.len()).filter(|j| !passive.contains(j));
            -active.map(|j| row[j] * rates[j]).sum::<f64>()
        })
        .collect();
    if let Some(solved) = least_squares(&of_passive(&found.rows, &passive), &driven, 0.0) {
        for (&i, rate) in passive.iter().zip(solved) {
            rates[i] = rate;
        }
    }
    Some(rates)
}

fn of_passive(rows: &DenseRows, passive: &[usize]) -> DenseRows {
    rows.iter()
        .map(|row| passive.iter().map(|&j| row[j]).collect())
        .collect()
}

/// Kinetic plus potential energy per unit of each parameter.
fn energies(mechanism: &Mechanism, rates: &[f64]) -> Vec<f64> {
    let poses = frame_poses(mechanism);
    let gravity: Vec3 =
        std::array::from_fn(|k| mechanism.gravity[k].evaluate(&|symbol| mechanism.symbol_nominal(symbol)));
    let mut row = vec![0.0; mechanism.parameters.len()];
    for (i, energy) in row.iter_mut().enumerate() {
        let unit = |symbol: ModelSymbol| match symbol {
            ModelSymbol::Parameter(idx) => f64::from(u8::from(idx == ParameterIdx(i))),
            other => mechanism.symbol_nominal(other),
        };
        let value = |exact: &ExactExpression| exact.evaluate(&unit);
        let mut body = |frame: usize, mass: f64, first: Vec3, inertia: [f64; 6]| {
            let (angular, linear) = velocity(mechanism, &poses, frame, rates);
            let (w, v) = (into_frame(&poses[frame], angular), into_frame(&poses[frame], linear));
            let [xx, xy, xz, yy, yz, zz] = inertia;
            let momentum = [
                xx * w[0] + xy * w[1] + xz * w[2],
                xy * w[0] + yy * w[1] + yz * w[2],
                xz * w[0] + yz * w[1] + zz * w[2],
            ];
            *energy += 0.5 * mass * dot(v, v) + dot(v, cross(w, first)) + 0.5 * dot(w, momentum)
                - mass * dot(gravity, poses[frame].origin)
                - dot(into_frame(&poses[frame], gravity), first);
        };
        for part in &mechanism.parts {
            let PartInertia::Linear {
                mass,
                first_moment,
                inertia,
            } = &part.inertial
            else {
                panic!("these models have linear parameters");
            };
            let first = std::array::from_fn(|k| value(&first_moment[k]));
            body(
                part.frame.0,
                value(mass),
                first,
                std::array::from_fn(|k| value(&inertia[k])),
            );
        }
        for lumped in &mechanism.lumped_masses {
            let mass = value(&lumped.mass);
            let at: Vec3 = std::array::from_fn(|k| value(&lumped.force_at[k]));
            let [x, y, z] = at;
            let inertia = [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y];
            body(lumped.frame.0, mass, at.map(|x| x * mass), inertia.map(|x| x * mass));
        }
    }
    for effect in &mechanism.effects {
        let acceleration = ExactExpression::Symbol(ModelSymbol::Place(PlaceQuantity::Acceleration));
        for (term, place) in effect.terms.iter().zip(&effect.places) {
            assert_eq!(term.expression, acceleration);
            let coordinate = match *place {
                EffectPlace::Drive(idx) => match mechanism.drives[idx.0].kind {
                    crate::DriveKind::Joint(coordinate) => coordinate,
                    crate::DriveKind::Linear { .. } => panic!("these models drive joints"),
                },
                EffectPlace::Coordinate(coordinate) => coordinate,
                _ => panic!("only drives and coordinates have an inertia here"),
            };
            row[term.parameter.0] += 0.5 * rates[coordinate.0].powi(2);
        }
    }
    row
}

fn n_base_parameters(path: &str) -> usize {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let loaded = crate::load_file(&path).unwrap_or_else(|failure| panic!("{failure}"));
    let mut mechanism = loaded.mechanism;
    let nominal: Vec<f64> = mechanism.coordinates.iter().map(|one| one.nominal).collect();
    let mut random = Random(0x0123_4567_89ab_cdef);
    let n_samples = 2 * mechanism.parameters.len() + 10;
    let mut rows: DenseRows = Vec::new();
    for _ in 0..n_samples {
        let rates = draw(&mut mechanism, &nominal, &mut random);
        let mut row = energies(&mechanism, &rates);
        row.push(1.0); // Energies that are constant have no effect.
        rows.push(row);
    }
    for j in 0..rows[0].len() {
        let size = rows.iter().map(|row| row[j] * row[j]).sum::<f64>().sqrt();
        // Columns of mere rounding stay small.
        for row in &mut rows {
            row[j] /= size.max(1e-2);
        }
    }
    let (strict, lax) = (rank(&rows, 1e-7), rank(&rows, 1e-11));
    assert_eq!(strict, lax, "the rank of {} is not clear", path.display());
    strict - 1
}

#[test]
fn models_have_the_published_numbers_of_base_parameters() {
    let variants = "../tests/fixtures/variants";
    for (path, expected) in [
        ("models/puma560.toml", 36),
        ("models/rx90.toml", 36),
        ("models/stanford.toml", 33),
        ("models/panda.toml", 43),
        ("models/scara.toml", 8),
        ("models/two_link.toml", 6),
        ("models/four_bar.toml", 8),
        ("models/parallelogram.toml", 3),
        ("models/five_bar.toml", 11),
        ("models/three_rrr.toml", 19),
        ("tx40-rigid.toml", 36),
        ("ur5.toml", 36),
        ("tx40-ia.toml", 40),
        ("ur5-ia.toml", 40),
        ("puma560-ia.toml", 40),
        ("rx90-ia.toml", 40),
        ("stanford-ia.toml", 37),
        ("panda-ia.toml", 48),
        ("scara-ia.toml", 11),
        ("two_link-normal.toml", 4),
        ("three_r.toml", 9),
        ("three_r-normal.toml", 7),
        ("four_bar-weightless.toml", 4),
        ("parallelogram-weightless.toml", 1),
        ("parallelogram-loop.toml", 3),
        ("five_bar-weightless.toml", 7),
        ("five_bar-tied.toml", 6),
        ("five_bar-tied-weightless.toml", 4),
        ("five_bar-tied-tool.toml", 5),
        ("five_bar-tied-tool-weightless.toml", 3),
        ("three_rrr-weightless.toml", 13),
        ("three_rrr-tied.toml", 9),
        ("three_rrr-tied-weightless.toml", 7),
    ] {
        let path = if path.starts_with("models/") {
            path.to_owned()
        } else {
            format!("{variants}/{path}")
        };
        assert_eq!(n_base_parameters(&path), expected, "{path}");
    }
}

/// The nominal pose is that of the drawing: the platform hangs below the elbows.
#[test]
fn the_spidermill_has_its_m_shape() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/spidermill.toml");
    let mechanism = crate::load_file(&path).unwrap().mechanism;
    let poses = frame_poses(&mechanism);
    let [elbow, other, platform] = [0, 1, 2].map(|i| position(&mechanism, &poses, crate::PointIdx(i)));
    assert!(platform[1] < elbow[1] && (elbow[1] - other[1]).abs() < 1e-6);
    assert!((platform[0] - 0.45).abs() < 1e-6);
}
