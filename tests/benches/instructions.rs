//! How many instructions the processor carries out: generation per model, emitted functions per call, block evaluation
//! per sample.
//!
//! `cargo bench -p modelmill-tests --bench instructions`, or with `-- panda` for one model. Valgrind counts (callgrind),
//! so that the figures hardly depend on the machine's load; without valgrind nothing is measured, and it says so.
//! Each figure is the difference of two numbers of calls, less what an empty call costs in the same loop.

use std::hint::black_box;
use std::process::ExitCode;

use modelmill_codegen::{ModelEvaluator, ProgramStage, StraightLineProgram};
use modelmill_tests::fixtures::{derive, derived, model};
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;
use modelmill_tests::{base_parameters, callgrind, drawn_states};

/// States that calls go through in turn; a block evaluation takes all of them.
const STATES: usize = 128;

/// What is measured, the two numbers of calls, and the number of states per call.
const FUNCTIONS: [(&str, [usize; 2], usize); 5] = [
    ("H_min", [128, 640], 1),
    ("inverse dynamics", [128, 640], 1),
    ("H_min, block", [1, 3], STATES),
    ("inverse dynamics, block", [1, 3], STATES),
    ("generation", [1, 2], 1),
];

/// Of models whose loops are followed by Newton's method, with the passive coordinates of the state before.
const NEAR: (&str, [usize; 2], usize) = ("inverse dynamics, near", [128, 640], 1);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [measure, name, function, calls] = arguments.as_slice()
        && measure == "--measure"
    {
        measured_by_name(name, function, calls.parse().expect("a number of calls"));
        return ExitCode::SUCCESS;
    }
    let wanted = arguments.iter().find(|a| !a.starts_with('-'));
    report(wanted.map(String::as_str))
}

/// Prints the table, running this program under valgrind for every figure.
fn report(wanted: Option<&str>) -> ExitCode {
    if !callgrind::is_available() {
        println!("instruction counts need valgrind, which is not on this machine: nothing was measured");
        return ExitCode::SUCCESS;
    }
    println!("instructions per call, per sample of a block, or per model generated (valgrind, callgrind)");
    println!("additions + multiplications (divisions, roots, sine-cosine pairs) as printed with the model");
    println!(
        "{:<18} {:<24} {:>20} {:>15}",
        "model", "function", "operations", "instructions"
    );
    let mut empty = None;
    for name in MODELS.iter().filter(|name| wanted.is_none_or(|w| name.contains(w))) {
        let programs = derived(name).programs;
        let near = (*name == "three_rrr").then_some(NEAR);
        for (function, calls, states) in FUNCTIONS.into_iter().chain(near) {
            let operations = match function {
                "generation" => "-".to_owned(),
                f if f.starts_with("H_min") => operations(&programs.regressor),
                _ => operations(&programs.inverse_dynamics),
            };
            let difference = |function: &str| -> Result<f64, String> {
                let [few, many] =
                    calls.map(|n| callgrind::count_instructions(&["--measure", name, function, &n.to_string()]));
                Ok((many? - few?) / (calls[1] - calls[0]) as f64)
            };
            let overhead = if calls[0] > 1 {
                *empty.get_or_insert_with(|| difference("nothing").unwrap_or(0.0))
            } else {
                0.0
            };
            let each = match difference(function) {
                Ok(each) => each,
                Err(says) => {
                    println!("{name}, {function}: {says}");
                    return ExitCode::FAILURE;
                }
            };
            let each = (each - overhead) / states as f64;
            println!("{name:<18} {function:<24} {operations:>20} {each:>15.0}");
        }
    }
    ExitCode::SUCCESS
}

fn operations(program: &StraightLineProgram) -> String {
    let c = program.count_operations(ProgramStage::State);
    format!("{} ({}, {}, {})", c.add + c.mul, c.div, c.sqrt, c.sincos)
}

/// Calls a function with the numbers of states in turn; only this is counted.
fn repeat_states(calls: usize, call: &mut dyn FnMut(usize)) {
    callgrind::repeat_calls(calls, &mut |k| call(k % STATES));
}

fn measured_by_name(name: &str, function: &str, calls: usize) {
    match function {
        "generation" => {
            let mechanism = model(name);
            repeat_states(calls, &mut |_| {
                let derivation = derive(black_box(&mechanism));
                black_box(modelmill_emit::emit(&derivation).module());
            });
        }
        "H_min, block" | "inverse dynamics, block" => {
            let derivation = derived(name);
            let evaluator = ModelEvaluator::new(&derivation);
            let sample = Sample::random(&derivation.mechanism, 4 * STATES, 0.2, &mut Stream::new(5));
            let sample = sample.reachable(&evaluator).filtered(|i| i < STATES);
            assert_eq!(sample.len(), STATES);
            let states = sample.states();
            let nominal = base_parameters::nominal(&derivation.mechanism);
            let base = base_parameters::base(&derivation, &nominal);
            repeat_states(calls, &mut |_| {
                let states = black_box(&states);
                if function == "H_min, block" {
                    _ = black_box(evaluator.regressor(states));
                } else {
                    _ = black_box(evaluator.inverse_dynamics(states, black_box(&base)));
                }
            });
        }
        _ => emitted(name, function, calls),
    }
}

/// Calls the functions of a model's module.
macro_rules! models {
    ($($model:ident $name:literal $(near $near:ident)?,)+) => {
        const MODELS: &[&str] = &[$($name),+];

        fn emitted(name: &str, function: &str, calls: usize) {
            match name {
                $($name => {
                    use modelmill_generated::$model as module;
                    let geometry = module::Geometry::<f64>::default();
                    let model = module::Model::new(&geometry);
                    let base = module::base_parameters(&geometry, &module::Parameters::default()).unwrap();
                    let dynamics = module::InverseDynamics::new(&geometry, &base);
                    let states = drawn_states!(module, dynamics, &modelmill_tests::fixtures::model($name), STATES);
                    match function {
                        "nothing" => repeat_states(calls, &mut |k| _ = black_box(black_box(&states[k]))),
                        "H_min" => repeat_states(calls, &mut |k| {
                            _ = black_box(model.regressor(black_box(&states[k])));
                        }),
                        "inverse dynamics" => repeat_states(calls, &mut |k| {
                            _ = black_box(dynamics.forces(black_box(&states[k])));
                        }),
                        $("inverse dynamics, near" => {
                            // A motion of a few thousandths of a radian per call, as in control.
                            let mut state = states[0];
                            let centre = state.q;
                            let mut $near = model.passive_position(&centre).expect("within reach");
                            repeat_states(calls, &mut |k| {
                                let x = k as f64 / STATES as f64;
                                let shift = 0.5 * x * (1.0 - x);
                                state.q = centre.map(|q| q + shift);
                                _ = black_box(dynamics.forces_near(black_box(&state), &mut $near));
                            });
                        })?
                        other => panic!("no function {other}"),
                    }
                })+
                other => panic!("no model {other}"),
            }
        }
    };
}

models! {
    spidermill "spidermill",
    spidermill_paper "spidermill-paper",
    two_link "two_link",
    four_bar "four_bar",
    parallelogram "parallelogram",
    five_bar "five_bar",
    three_rrr "three_rrr" near passive,
    scara "scara",
    stanford "stanford",
    puma560 "puma560",
    rx90 "rx90",
    panda "panda",
    emps "emps",
}
