//! Pushes on bundled arms, as the weight of a body that is there for a while: told as events with their times and drives, and left
//! out on request; nothing is told where nothing happened.

use crate::made::{Made, STEP, bundled, run_of, with_part};
use modelmill::Model;
use modelmill::identify::EstimatorOptions;
use modelmill::recording::RecordingOptions;

/// Events that are told of a run: from, to and the sentence.
fn told(model: &Model, name: &str, seed: u64, made: Made) -> Vec<(f64, f64, String)> {
    let file = run_of(model, name, seed, made);
    let recording = model
        .recording(file, &RecordingOptions::default())
        .expect("the recording");
    let notes = recording.notes().map(|note| note.says.in_library_words());
    notes
        .filter(|says| says.contains("as in a contact or a push"))
        .map(|says| {
            let words: Vec<&str> = says.split(' ').collect();
            let number = |at: usize| words[at].parse().expect("a time");
            (number(1), number(3), says.clone())
        })
        .collect()
}

/// The arm with a kilogram on a link.
fn kilogram(link: u64) -> Model {
    let part = format!("\n[[part]]\nname = \"push\"\non = \"link{link}\"\nmass = 1\ncentre = [0.03, -0.02, 0.08]\n");
    with_part("puma560", &part)
}

#[test]
fn pushes_are_told_with_their_times() {
    let model = Model::open(bundled("puma560")).expect("the model");
    let (mut found, mut wrong) = (0, Vec::new());
    for link in 4..6 {
        let weight = kilogram(link);
        for seed in 0..10 {
            let from = 200 + 140 * usize::try_from(seed).expect("small");
            let to = from + 40 + 8 * usize::try_from(seed).expect("small");
            let made = Made::Push(&weight, 2.0 + 0.6 * seed as f64, from, to);
            let events = told(&model, "puma560", 500 + 10 * link + seed, made);
            let [starts, ends] = [from, to].map(|k| STEP * k as f64);
            let is_it = |event: &&(f64, f64, String)| event.0 < ends && event.1 > starts;
            let bearable = 0.25 * (ends - starts) + 0.1;
            let near = (events.iter().filter(is_it))
                .any(|(a, b, _)| (a - starts).abs() < bearable && (b - ends).abs() < bearable);
            found += usize::from(near);
            if !near || !events.iter().all(|event| is_it(&event)) {
                wrong.push((starts, ends, events));
            }
        }
    }
    assert!(found >= 18 && wrong.len() <= 2, "{found} {wrong:#?}");
}

#[test]
fn nothing_is_told_where_nothing_happened() {
    for (k, name) in ["puma560", "scara", "five_bar", "spidermill"].iter().enumerate() {
        let model = Model::open(bundled(name)).expect("the model");
        for seed in 0..5 {
            let events = told(&model, name, 900 + 10 * k as u64 + seed, Made::Nothing);
            assert!(events.is_empty(), "{name} {seed}: {events:?}");
        }
    }
}

/// What is left out on request is in no figure any more.
#[test]
fn a_push_is_left_out_on_request() {
    let model = Model::open(bundled("puma560")).expect("the model");
    let weight = kilogram(4);
    let error = |made: Made, leave_out_events: bool| -> f64 {
        let reading = RecordingOptions {
            leave_out_events,
            ..RecordingOptions::default()
        };
        let file = run_of(&model, "puma560", 77, made);
        let recording = model.recording(file, &reading).expect("the recording");
        let found = model.identify(&[&recording], &[], &EstimatorOptions::default());
        let channels = found.expect("a fit").fit.fit.channels;
        let (_, second) = channels.get_index(1).expect("a drive");
        second.nrms.expect("forces")
    };
    let clean = error(Made::Nothing, false);
    let pushed = error(Made::Push(&weight, 6.0, 900, 1000), false);
    let left_out = error(Made::Push(&weight, 6.0, 900, 1000), true);
    assert!(
        pushed > 1.5 * clean && left_out < 1.15 * clean,
        "{clean} {pushed} {left_out}"
    );
}
