//! Pushes on bundled arms, as the weight of a body that is there for a while: told as events with their times and drives, and left
//! out on request; nothing is told where nothing happened.

#[allow(dead_code, reason = "other tests draw more")]
mod draws;
#[allow(dead_code, reason = "other tests do more to runs")]
mod made;

use made::{Made, STEP, bundled, run};
use modelmill::Model;
use modelmill::recording::Reading;

/// Events that are told of a run: from, to and the sentence.
fn told(name: &str, seed: u64, made: Made, reading: &Reading) -> Vec<(f64, f64, String)> {
    let model = Model::open(bundled(name)).expect("the model");
    let recording = model
        .recording(run(name, seed, made), reading)
        .expect("the recording");
    let events = recording
        .notes()
        .filter(|note| note.says.contains("as in a contact or a push"));
    events
        .map(|note| {
            let words: Vec<&str> = note.says.split(' ').collect();
            let number = |at: usize| words[at].parse().expect("a time");
            (number(1), number(3), note.says.clone())
        })
        .collect()
}

#[test]
fn pushes_are_told_with_their_times() {
    let (mut found, mut wrong) = (0, Vec::new());
    for seed in 0..20 {
        let kilograms = 2.0 + 0.3 * seed as f64;
        let link = 4 + seed % 3;
        let part = format!(
            "\n[[part]]\nname = \"push\"\non = \"link{link}\"\nmass = {kilograms}\ncentre = [0.03, -0.02, 0.08]\n"
        );
        let from = 200 + 70 * usize::try_from(seed).expect("small");
        let to = from + 40 + 4 * usize::try_from(seed).expect("small");
        let events = told(
            "puma560",
            500 + seed,
            Made::Push(&part, from, to),
            &Reading::default(),
        );
        let [starts, ends] = [from, to].map(|k| STEP * k as f64);
        let is_it = |event: &&(f64, f64, String)| event.0 < ends && event.1 > starts;
        let near = events.iter().filter(is_it).any(|(a, b, _)| {
            (a - starts).abs() < 0.25 * (ends - starts) + 0.1
                && (b - ends).abs() < 0.25 * (ends - starts) + 0.1
        });
        found += usize::from(near);
        if events.iter().any(|event| !is_it(&event)) || !near {
            wrong.push((seed, starts, ends, events));
        }
    }
    assert!(found >= 18 && wrong.len() <= 2, "{found} {wrong:#?}");
}

#[test]
fn nothing_is_told_where_nothing_happened() {
    for (k, name) in ["puma560", "scara", "five_bar", "spidermill"]
        .iter()
        .enumerate()
    {
        for seed in 0..5 {
            let events = told(
                name,
                900 + 10 * k as u64 + seed,
                Made::Nothing,
                &Reading::default(),
            );
            assert!(events.is_empty(), "{name} {seed}: {events:?}");
        }
    }
}

/// What is left out on request moves no parameter any more.
#[test]
fn a_push_is_left_out_on_request() {
    let part = "\n[[part]]\nname = \"push\"\non = \"link4\"\nmass = 6\ncentre = [0.1, 0, 0.08]\n";
    let model = Model::open(bundled("puma560")).expect("the model");
    let error = |made: Made, leave_out_events: bool| {
        let reading = Reading {
            leave_out_events,
            ..Reading::default()
        };
        let recording = model
            .recording(run("puma560", 77, made), &reading)
            .expect("the recording");
        let found = model.identify(
            &[&recording],
            &[],
            &modelmill::identify::Estimation::default(),
        );
        let figures = found.expect("a fit").fit.fit;
        figures
            .channels
            .iter()
            .map(|(_, one)| one.nrms.unwrap_or(f64::NAN))
            .collect::<Vec<f64>>()
    };
    let clean = error(Made::Nothing, false);
    let pushed = error(Made::Push(part, 900, 1000), false);
    let left_out = error(Made::Push(part, 900, 1000), true);
    assert!(pushed[1] > 1.5 * clean[1], "{clean:?} {pushed:?}");
    for (clean, left_out) in clean.iter().zip(&left_out) {
        assert!(*left_out < 1.15 * clean, "{clean} {left_out}");
    }
}
