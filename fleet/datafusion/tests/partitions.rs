//! The same query gives the same numbers however the samples are spread and wherever they lie, and the same as the summaries of the
//! files.

use std::collections::BTreeMap;
use std::sync::Arc;

use datafusion::arrow::array::{Array, AsArray};
use datafusion::arrow::datatypes::{Float64Type, UInt64Type};
use datafusion::object_store::memory::InMemory;
use datafusion::object_store::{ObjectStore, ObjectStoreExt};
use datafusion::prelude::{SessionConfig, SessionContext};
use modelmill::recording::RecordingOptions;
use modelmill_fleet::folder::{FleetFile, robots};
use modelmill_fleet::{FleetModel, FleetPlan};
use modelmill_fleet_datafusion::register;
use modelmill_fleet_program::generate::{FleetSize, generate};

/// Values by robot and day.
type Answer = BTreeMap<(String, String), Vec<Option<f64>>>;

async fn answer(session: &SessionContext, sql: &str) -> Answer {
    let batches = session.sql(sql).await.unwrap().collect().await.unwrap();
    let mut all = BTreeMap::new();
    for batch in batches {
        let [robot, day] = [0, 1].map(|k| {
            datafusion::arrow::compute::cast(batch.column(k), &datafusion::arrow::datatypes::DataType::Utf8).unwrap()
        });
        let fits = batch.column(2).as_struct();
        for row in 0..batch.num_rows() {
            let key = [&robot, &day].map(|column| column.as_string::<i32>().value(row).to_owned());
            let counts = fits.columns()[..2]
                .iter()
                .map(|one| Some(one.as_primitive::<UInt64Type>().value(row) as f64));
            let values = fits.columns()[2..].iter().map(|one| {
                let one = one.as_primitive::<Float64Type>();
                one.is_valid(row).then(|| one.value(row))
            });
            all.insert(key.into(), counts.chain(values).collect());
        }
    }
    all
}

/// All files of a fleet as objects of a store, below `site/recordings`, and one elsewhere that is no recording.
async fn stored(files: &BTreeMap<String, Vec<FleetFile>>) -> Arc<dyn ObjectStore> {
    let store = InMemory::new();
    for file in files.values().flatten() {
        let place = format!("site/recordings/{}", file.name).into();
        let bytes = std::fs::read(&file.path).unwrap();
        store.put(&place, bytes.into()).await.unwrap();
    }
    let note = "site/elsewhere/notes.md".into();
    store.put(&note, "not a recording".into()).await.unwrap();
    Arc::new(store)
}

/// The answer that files give, one after the other.
fn of_files(ground: &FleetModel, files: &BTreeMap<String, Vec<FleetFile>>) -> Answer {
    let mut expected = Answer::new();
    for (robot, files) in files {
        for day in files.chunk_by(|a, b| a.day == b.day) {
            let mut sum = ground.empty_summary();
            for file in day {
                sum.merge(&ground.summarise_file(&file.name, &file.path)).unwrap();
            }
            let fit = ground.solve(&sum).unwrap();
            let values = fit.parameters.iter().flat_map(|one| [Some(one.value), one.std]);
            let counts = [sum.recordings as f64, sum.bad.len() as f64].map(Some);
            expected.insert(
                (robot.clone(), day[0].day.clone()),
                counts.into_iter().chain(values).collect(),
            );
        }
    }
    expected
}

async fn faults_are_told(ground: &Arc<FleetModel>, store: Arc<dyn ObjectStore>) {
    let session = SessionContext::new();
    register(&session, ground);
    session.register_object_store(&"s3://fleet".parse().unwrap(), store);
    let faults = [
        (
            "SELECT modelmill_identify(arrow_cast('no summary', 'Binary'))",
            "not a summary of recordings",
        ),
        (
            "SELECT * FROM modelmill_recordings('s3://fleet/site/elsewhere')",
            "has no recordings",
        ),
        (
            "SELECT * FROM modelmill_recordings('s3://unknown/recordings')",
            "s3://unknown",
        ),
    ];
    for (query, says) in faults {
        let frame = session.sql(query).await.unwrap();
        let fault = frame.collect().await.unwrap_err().to_string();
        assert!(fault.contains(says), "{query}: {fault}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn partitions_change_nothing() {
    let folder = std::env::temp_dir().join(format!("modelmill-partitions-{}", std::process::id()));
    let size = FleetSize {
        robots: 3,
        days: 6,
        per_day: 2,
        seconds: 12.0,
        rate: 100.0,
        seed: 9,
        bad: 0,
        changes: 1.0,
    };
    generate(&folder, &size).unwrap();
    let data = folder.join("recordings");
    let first = data.join("robot=R00000/day=2026-03-01/recording=0/data.parquet");
    let plan = FleetPlan::from_recordings(&folder.join("model.toml"), &RecordingOptions::default(), &[&first]).unwrap();
    let ground: Arc<FleetModel> = Arc::new(plan.derive_model().unwrap());
    let files = robots(&data).unwrap();
    let store = stored(&files).await;
    let expected = of_files(&ground, &files);
    assert_eq!(expected.len(), 18);
    let samples = "recording, t, q1, q3, motor_left, motor_right";
    let queries = [
        format!(
            "SELECT robot, day, modelmill_identify({samples}) FROM samples GROUP BY robot, day"
        ),
        format!(
            "SELECT robot, day, modelmill_identify(s) FROM (SELECT robot, day, modelmill_summarise({samples}) AS s FROM samples \
             GROUP BY robot, day, recording) GROUP BY robot, day"
        ),
        // Samples backwards, and of all robots among each other.
        format!(
            "SELECT robot, day, modelmill_identify({samples}) FROM (SELECT * FROM samples ORDER BY q1) GROUP BY robot, day"
        ),
        format!(
            "SELECT robot, day, modelmill_identify(modelmill_merge) FROM (SELECT robot, day, modelmill_merge(summary) AS modelmill_merge \
             FROM modelmill_recordings('{}') GROUP BY robot, day) GROUP BY robot, day",
            data.display()
        ),
        "SELECT robot, day, modelmill_identify(summary) FROM modelmill_recordings('s3://fleet/site/recordings') GROUP BY robot, day"
            .to_owned(),
        format!(
            "SELECT robot, day, modelmill_identify({samples}) FROM stored_samples GROUP BY robot, day"
        ),
    ];
    for partitions in [1, 2, 7] {
        for batch in [100, 8192] {
            let config = SessionConfig::new()
                .with_target_partitions(partitions)
                .with_batch_size(batch);
            let session = SessionContext::new_with_config(config);
            register(&session, &ground);
            session.register_object_store(&"s3://fleet".parse().unwrap(), store.clone());
            let places = [
                ("samples", data.display().to_string()),
                ("stored_samples", "s3://fleet/site/recordings".to_owned()),
            ];
            for (name, place) in places {
                let table = format!(
                    "CREATE EXTERNAL TABLE {name} STORED AS PARQUET PARTITIONED BY (robot, day, recording) LOCATION '{place}/'"
                );
                session.sql(&table).await.unwrap().collect().await.unwrap();
            }
            for query in &queries {
                let found = answer(&session, query).await;
                assert!(found.keys().eq(expected.keys()), "{query}");
                for (key, values) in &found {
                    for (a, b) in values.iter().zip(&expected[key]) {
                        let is_same = match (a, b) {
                            (Some(a), Some(b)) => (a - b).abs() <= 1e-9 * b.abs().max(1e-3),
                            (a, b) => a == b,
                        };
                        assert!(is_same, "{query}: {key:?} {a:?} {b:?}");
                    }
                }
            }
        }
    }
    faults_are_told(&ground, store).await;
    std::fs::remove_dir_all(&folder).unwrap();
}
