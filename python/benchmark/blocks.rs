//! The Rust side of `states.py`: the emitted blocks over the states of a folder, one column for each coordinate.
//!
//! A line on the standard input is a round, whose nanoseconds of processor time are printed: `kept` writes to columns of forces that are there
//! already, `new` to columns that it allocates. `end` writes the forces to the folder, state by state.

#[allow(dead_code, reason = "inverse dynamics alone is called")]
mod model;

use std::hint::black_box;
use std::io::{BufRead, Write};
use std::path::Path;
use std::time::Instant;

use model::{InverseDynamics, N_ACTIVE, N_DRIVES, States};

fn numbers(file: &Path) -> Vec<f64> {
    let bytes = std::fs::read(file).expect("the file that the Python side wrote");
    let number = |eight: &[u8]| f64::from_le_bytes(eight.try_into().expect("eight bytes"));
    bytes.chunks_exact(8).map(number).collect()
}

fn columns(file: &Path) -> [Vec<f64>; N_ACTIVE] {
    let rows = numbers(file);
    std::array::from_fn(|k| rows.iter().skip(k).step_by(N_ACTIVE).copied().collect())
}

/// Processor time of this thread so far, ns; the clock's where the system does not tell.
fn processor_time(start: &Instant) -> u128 {
    // The kernel brings the figure up to date when a thread offers to stop.
    std::thread::yield_now();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let told = told.and_then(|text| text.split(' ').next()?.parse().ok());
    told.unwrap_or_else(|| start.elapsed().as_nanos())
}

fn main() {
    let folder = std::env::args().nth(1).expect("a folder");
    let folder = Path::new(&folder);
    let [q, qd, qdd] = ["q", "qd", "qdd"].map(|name| columns(&folder.join(name)));
    let base = numbers(&folder.join("base")).try_into().expect("all base parameters");
    let dynamics = InverseDynamics::new(&model::Geometry::default(), &base);
    let n = q[0].len();
    let states = States {
        q: q.each_ref().map(|column| &column[..]),
        qd: qd.each_ref().map(|column| &column[..]),
        qdd: qdd.each_ref().map(|column| &column[..]),
    };
    let round = |forces: &mut [Vec<f64>; N_DRIVES]| {
        let mut columns = forces.each_mut().map(|column| &mut column[..]);
        let done = dynamics.forces_of_many(black_box(&states), &mut columns);
        done.expect("forces of all states");
        black_box(&columns);
    };
    let room = || -> [Vec<f64>; N_DRIVES] { std::array::from_fn(|_| vec![0.0; n]) };
    let mut kept = room();
    round(&mut kept);
    println!("ready");
    let clock = Instant::now();
    for line in std::io::stdin().lock().lines() {
        let start = processor_time(&clock);
        match line.expect("a line").as_str() {
            "kept" => round(&mut kept),
            "new" => round(&mut room()),
            _ => break,
        }
        println!("{}", processor_time(&clock) - start);
    }
    let file = std::fs::File::create(folder.join("forces")).expect("a file");
    let mut file = std::io::BufWriter::new(file);
    for k in 0..n {
        for column in &kept {
            file.write_all(&column[k].to_le_bytes()).expect("forces are written");
        }
    }
}
