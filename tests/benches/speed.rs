//! How long it takes to make a model and to call it.
//!
//! `cargo bench -p modelmill-tests`, or `cargo bench -p modelmill-tests -- panda` for one model. Operation counts are
//! printed first, beside the best known ones. What is compared stands in the same run: the block evaluator beside the
//! emitted code, in time per sample. `--bench page` times other programs on the same models, and blocks of states.

use std::hint::black_box;

use divan::Bencher;
use divan::counter::ItemsCount;
use modelmill_codegen::{Derivation, ModelEvaluator, ProgramStage};
use modelmill_tests::base_parameters;
use modelmill_tests::fixtures::{derive, derived, model, model_file};
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

const MODELS: [&str; 13] = [
    "spidermill",
    "spidermill-paper",
    "two_link",
    "four_bar",
    "parallelogram",
    "five_bar",
    "three_rrr",
    "scara",
    "stanford",
    "puma560",
    "rx90",
    "panda",
    "emps",
];

/// States per round.
const STATES: usize = 512;

fn main() {
    print_counts();
    divan::main();
}

fn print_counts() {
    let best_known = |name: &str| match name {
        "two_link" => "38, 26",
        "puma560" => "539, 909",
        "panda" => "648, 1256",
        "rx90" => "521, 887",
        _ => "",
    };
    println!("additions + multiplications (divisions, roots, sine-cosine pairs) per call");
    println!(
        "{:<18} {:>30} {:>30}   best known",
        "model", "inverse dynamics", "regressor"
    );
    for name in MODELS {
        let programs = derived(name).programs;
        let text = |program: &modelmill_codegen::StraightLineProgram| {
            let c = program.count_operations(ProgramStage::State);
            let total = c.add + c.mul;
            format!("{total} ({}, {}, {})", c.div, c.sqrt, c.sincos)
        };
        let (dynamics, regressor) = (text(&programs.inverse_dynamics), text(&programs.regressor));
        println!("{name:<18} {dynamics:>30} {regressor:>30}   {}", best_known(name));
    }
}

/// States near the nominal pose.
fn states(derivation: &Derivation) -> Sample {
    let drawn = Sample::random(&derivation.mechanism, 2 * STATES, 0.25, &mut Stream::new(5));
    let reachable = drawn.reachable(&ModelEvaluator::new(derivation));
    let sample = reachable.filtered(|i| i < STATES);
    assert_eq!(sample.len(), STATES);
    sample
}

mod generation {
    use super::{Bencher, MODELS, black_box, derive, model, model_file};

    #[divan::bench(args = MODELS, sample_count = 20)]
    fn load(name: &str) -> usize {
        let loaded = modelmill_spec::load_file(&model_file(name));
        black_box(loaded.map_or(0, |l| l.mechanism.parameters.len()))
    }

    #[divan::bench(args = MODELS, sample_count = 10)]
    fn derive_and_reduce(bencher: Bencher, name: &str) {
        let mechanism = model(name);
        bencher.bench_local(|| black_box(derive(&mechanism)).reduction.retained.len());
    }

    #[divan::bench(args = MODELS, sample_count = 10)]
    fn from_file_to_source(name: &str) -> usize {
        let derivation = derive(&model(name));
        black_box(modelmill_emit::emit(&derivation).module()).len()
    }
}

mod evaluator {
    use super::{Bencher, ItemsCount, MODELS, ModelEvaluator, STATES, base_parameters, black_box, derived, states};

    #[divan::bench(args = MODELS, sample_count = 20)]
    fn regressor(bencher: Bencher, name: &str) {
        let derivation = derived(name);
        let (evaluator, sample) = (ModelEvaluator::new(&derivation), states(&derivation));
        let states = sample.states();
        bencher
            .counter(ItemsCount::new(STATES))
            .bench_local(|| black_box(evaluator.regressor(black_box(&states))));
    }

    #[divan::bench(args = MODELS, sample_count = 20)]
    fn inverse_dynamics(bencher: Bencher, name: &str) {
        let derivation = derived(name);
        let (evaluator, sample) = (ModelEvaluator::new(&derivation), states(&derivation));
        let base = base_parameters::base(&derivation, &base_parameters::nominal(&derivation.mechanism));
        let states = sample.states();
        bencher
            .counter(ItemsCount::new(STATES))
            .bench_local(|| black_box(evaluator.inverse_dynamics(black_box(&states), &base)));
    }
}

/// Times the emitted code of a module, one call per state.
macro_rules! emitted {
    ($($model:ident $name:literal,)+) => {
        mod emitted {
            $(mod $model {
                use super::super::{Bencher, ItemsCount, STATES, black_box, derived, states};
                use modelmill_generated::$model as module;

                fn each_state() -> Vec<module::State<f64>> {
                    let sample = states(&derived($name));
                    (0..STATES)
                        .map(|i| module::State {
                            q: std::array::from_fn(|k| sample.q[k][i]),
                            qd: std::array::from_fn(|k| sample.qd[k][i]),
                            qdd: std::array::from_fn(|k| sample.qdd[k][i]),
                        })
                        .collect()
                }

                #[divan::bench(sample_count = 50)]
                fn regressor(bencher: Bencher) {
                    let states = each_state();
                    let model = module::Model::new(&module::Geometry::default());
                    bencher.counter(ItemsCount::new(STATES)).bench_local(|| {
                        for state in &states {
                            _ = black_box(model.regressor(black_box(state)));
                        }
                    });
                }

                /// A step of the watch that has learned its noise, regressor included: beside `regressor`.
                #[divan::bench(sample_count = 50)]
                fn watch(bencher: Bencher) {
                    let states = each_state();
                    let geometry = module::Geometry::default();
                    let base = [0.0; module::N_BASE];
                    let options = modelmill_runtime::live::Options::at_rate(1000.0);
                    let mut watch = module::Watch::new(&geometry, &base, &options);
                    let mut stream = super::super::Stream::new(3);
                    let mut round = || {
                        for state in &states {
                            let forces = std::array::from_fn(|_| stream.between(-1.0, 1.0));
                            _ = black_box(watch.step(black_box(state), &forces));
                        }
                    };
                    for _ in 0..200 {
                        round();
                    }
                    bencher.counter(ItemsCount::new(STATES)).bench_local(round);
                }

                #[divan::bench(sample_count = 50)]
                fn inverse_dynamics(bencher: Bencher) {
                    let states = each_state();
                    let geometry = module::Geometry::default();
                    let base = module::base_parameters(&geometry, &module::Parameters::default()).unwrap();
                    let dynamics = module::InverseDynamics::new(&geometry, &base);
                    bencher.counter(ItemsCount::new(STATES)).bench_local(|| {
                        for state in &states {
                            _ = black_box(dynamics.forces(black_box(state)));
                        }
                    });
                }
            })+
        }
    };
}

emitted! {
    spidermill "spidermill",
    spidermill_paper "spidermill-paper",
    two_link "two_link",
    four_bar "four_bar",
    parallelogram "parallelogram",
    five_bar "five_bar",
    three_rrr "three_rrr",
    scara "scara",
    stanford "stanford",
    puma560 "puma560",
    rx90 "rx90",
    panda "panda",
    emps "emps",
}
