//! The whole way on the bench: the best motion within limits, the full robot driven along it, and its base parameters
//! from positions alone.

use crate::common::{json, model, number, scratch, workspace};

/// An encoder of 20 bits, 1 N of noise on the forces, one period at 500 Hz: every base parameter comes out to 0.2 %, and
/// its deviation is honest.
#[test]
fn one_period_of_positions_gives_every_base_parameter_to_a_fifth_of_a_per_cent() {
    let (trajectory, rig) = (scratch("excited.csv"), scratch("encoders.toml"));
    let parent = workspace("model-spec/rigs/spidermill-full.toml");
    std::fs::write(
        &rig,
        format!(
            "schema = 1\nname = \"encoders\"\nextends = '{}'\n\
             [[encoder]]\nof = [\"theta1\", \"theta2\"]\nbits = 20\n\
             [[force_sensor]]\nof = [\"spindle_left\", \"spindle_right\"]\nnoise = 1.0\n",
            parent.canonicalize().expect("the rig").display()
        ),
    )
    .expect("written");
    // A short search will do: a better motion would only make it easier.
    let excited = json(&[
        "excite",
        &model("spidermill.toml"),
        "--random",
        "100",
        "--starts",
        "1",
        "--out",
        &trajectory,
        "--json",
    ]);
    assert_eq!(excited["violations"], 0);
    for seed in ["1", "2"] {
        let run = scratch("excited-run.csv");
        json(&[
            "simulate",
            &rig,
            "--trajectory",
            &trajectory,
            "--out",
            &run,
            "--seed",
            seed,
            "--json",
        ]);
        for more in [&[][..], &["--smoothing", "butterworth"]] {
            let model = model("spidermill.toml");
            let mut args = vec!["identify", &model, "--data", &run, "--json"];
            args.extend(more);
            let fit = json(&args);
            assert!((number(&fit, "/fit/rms") - 1.0).abs() < 0.04);
            for parameter in fit["parameters"].as_array().expect("parameters") {
                let [value, nominal, std] = ["/value", "/nominal", "/std"].map(|name| number(parameter, name));
                println!(
                    "seed {seed} {more:?}: {} off by {:.4} %, deviation {:.4} %",
                    parameter["name"],
                    100.0 * (value / nominal - 1.0),
                    100.0 * std / nominal
                );
                assert!((value / nominal - 1.0).abs() < 2e-3);
                assert!((value - nominal).abs() < 4.0 * std);
            }
        }
    }
}
