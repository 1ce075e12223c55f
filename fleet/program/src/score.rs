//! Compares results with the known changes of a simulated fleet: `results.json` and `truth.json` go in, a table of
//! detection rates comes out.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use modelmill_fleet::FleetFault;
use serde_json::Value;

/// Reads a JSON file.
fn read(path: &Path) -> Result<Value, FleetFault> {
    let text = fs::read_to_string(path).map_err(|error| {
        FleetFault::new(format!(
            "{} cannot be read: {error}; give a file or folder that `identify` or `make` wrote",
            path.display()
        ))
    })?;
    serde_json::from_str(&text).map_err(|error| FleetFault::new(format!("{}: {error}", path.display())))
}

/// Counts for one kind of change.
#[derive(Default)]
struct ScoreTally {
    /// Number of simulated changes.
    planted: usize,
    /// Number of changes that were detected.
    found: usize,
    /// Number of changes that were detected within one day of the right day.
    in_time: usize,
    /// Number of changes that were detected with the right name.
    named: usize,
    /// Changes with a miss in any of these, one line each.
    missed: Vec<String>,
}

/// Compares results, in a folder that [`crate::identify`] wrote, with the known changes.
///
/// Fails if either cannot be read, or they belong to different fleets.
pub fn score(found: &Path, truth: &Path) -> Result<String, FleetFault> {
    let results = read(&found.join("results.json"))?;
    let truth = read(truth)?;
    // Days by name, so that distances between days can be counted.
    let days: Vec<String> = list(&truth["days"]).iter().map(text).collect();
    let place = |day: &Value| days.iter().position(|one| Some(one.as_str()) == day.as_str());
    // Results by the name of the robot.
    let robots: BTreeMap<String, Value> = list(&results["robots"])
        .into_iter()
        .map(|robot| (text(&robot["robot"]), robot))
        .collect();
    let differ: BTreeMap<String, Value> = list(&results["fleet"]["differ"])
        .into_iter()
        .map(|one| (text(&one["robot"]), one))
        .collect();
    let mut tallies: BTreeMap<String, ScoreTally> = BTreeMap::new();
    let (mut sound, mut alarms) = (0_u32, Vec::new());
    // Compare each robot with what was simulated for it.
    for one in list(&truth["robots"]) {
        let (name, planted) = (text(&one["robot"]), &one["planted"]);
        let Some(robot) = robots.get(&name) else {
            return Err(FleetFault::new(format!(
                "{} has no robot {name}; `truth.json` belongs to another fleet",
                found.display()
            )));
        };
        let (since, dead) = (list(&robot["since"]), list(&robot["dead_sensors"]));
        let kind = text(&planted["kind"]);
        let tally = tallies.entry(kind.clone()).or_default();
        let at = planted["place"].as_u64().and_then(|day| usize::try_from(day).ok());
        // A day counts as right if it is at most one day off.
        let is_near = |day: &Value| {
            place(day)
                .zip(at)
                .is_some_and(|(found, planted)| found.abs_diff(planted) <= 1)
        };
        let (is_found, in_time, is_named) = match kind.as_str() {
            "none" => {
                // Any result for an unchanged robot is a false alarm.
                sound += 1;
                if !since.is_empty() || !dead.is_empty() || differ.contains_key(&name) {
                    let changes = since
                        .first()
                        .map(|one| &one["changes"])
                        .or(differ.get(&name).map(|one| &one["changes"]));
                    alarms.push(format!(
                        "{name}: {} {}",
                        since.first().map(|one| text(&one["day"])).unwrap_or_default(),
                        changes
                            .and_then(|changes| changes[0]["says"].as_str())
                            .unwrap_or("a parameter changed")
                    ));
                }
                continue;
            }
            "dead_sensor" => {
                // The sensor itself must be reported, not only any sensor.
                let own: Vec<&Value> = dead.iter().filter(|one| one["sensor"] == planted["at"]).collect();
                let near = own.iter().any(|one| is_near(&one["day"]));
                (!own.is_empty(), near, !own.is_empty())
            }
            "odd" => {
                // It differs on all days, so that a change on some day would be wrong.
                let own = differ.get(&name);
                let is_named = own.is_some_and(|one| has_change(&one["changes"], "payload", None));
                (own.is_some(), own.is_some() && since.is_empty(), is_named)
            }
            _ => {
                // Wear and loads begin on a day.
                let near = since.iter().any(|one| is_near(&one["day"]));
                let is_named = since.iter().any(|one| match kind.as_str() {
                    "wear" => has_change(&one["changes"], "friction", planted["at"].as_str()),
                    _ => has_change(&one["changes"], "payload", None),
                });
                (!since.is_empty(), near, is_named)
            }
        };
        // Count the result, and describe it if anything is wrong.
        tally.planted += 1;
        tally.found += usize::from(is_found);
        tally.in_time += usize::from(is_found && in_time);
        tally.named += usize::from(is_named);
        if !(is_found && in_time && is_named) {
            let days: Vec<String> = since.iter().map(|one| text(&one["day"])).collect();
            let says = since
                .iter()
                .flat_map(|one| list(&one["changes"]))
                .map(|one| text(&one["says"]))
                .collect::<Vec<_>>();
            tally
                .missed
                .push(format!("{name} simulated {planted}, found {days:?} {says:?}"));
        }
    }
    let mut says = score_text(&tallies, sound, &alarms);
    says.push_str(&bad_recordings_text(&results, &truth));
    Ok(says)
}

/// Whether one of the changes is of a kind, at a place if one is named.
fn has_change(changes: &Value, kind: &str, at: Option<&str>) -> bool {
    list(changes).iter().any(|change| {
        let is_there = at.is_none_or(|at| list(&change["at"]).iter().any(|one| one.as_str() == Some(at)));
        change["kind"].as_str() == Some(kind) && is_there
    })
}

/// The elements of a JSON array; none for other values.
fn list(value: &Value) -> Vec<Value> {
    value.as_array().cloned().unwrap_or_default()
}

/// The text of a JSON value; empty for other values.
fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

/// Detection rates of each kind, and the unchanged robots with a false alarm.
fn score_text(tallies: &BTreeMap<String, ScoreTally>, sound: u32, alarms: &[String]) -> String {
    let mut says = String::new();
    for (kind, tally) in tallies.iter().filter(|(_, tally)| tally.planted > 0) {
        let _ = writeln!(
            says,
            "{kind}: {} simulated, {} found, {} with the day within one day, {} with the right name",
            tally.planted, tally.found, tally.in_time, tally.named
        );
        for missed in &tally.missed {
            let _ = writeln!(says, "  {missed}");
        }
    }
    let _ = writeln!(
        says,
        "unchanged robots: {sound}, of which {} raised an alarm ({:.2} %)",
        alarms.len(),
        100.0 * alarms.len() as f64 / f64::from(sound.max(1))
    );
    for alarm in alarms {
        let _ = writeln!(says, "  {alarm}");
    }
    says
}

/// How many of the recordings that were cut off are reported, and how many others.
///
/// Names in `truth.json` begin in the folder of the fleet, those of results in the folder that was read, which may be
/// one of its parents.
fn bad_recordings_text(results: &Value, truth: &Value) -> String {
    let planted: BTreeSet<String> = list(&truth["bad"]).iter().map(text).collect();
    let mut reported: BTreeSet<&String> = BTreeSet::new();
    let mut further = 0;
    for one in list(&results["bad"]) {
        let name = text(&one["recording"]);
        let known = path_ends(&name).find_map(|end| planted.get(end));
        match known {
            Some(known) => drop(reported.insert(known)),
            None => further += 1,
        }
    }
    format!(
        "bad recordings: {} simulated, {} not reported, {further} others reported\n",
        planted.len(),
        planted.len() - reported.len()
    )
}

/// A path, and what remains of it without its first folder, its first two folders, and so on.
fn path_ends(path: &str) -> impl Iterator<Item = &str> {
    let below = path.match_indices('/').map(|(at, _)| &path[at + 1..]);
    std::iter::once(path).chain(below)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn bad_recordings_are_counted_from_any_parent_folder() {
        let truth = json!({ "bad": ["robot=R1/day=1/a.parquet", "robot=R2/day=1/a.parquet"] });
        for parent in ["", "fleet/", "data/fleet/"] {
            let name = |path: &str| json!({ "recording": format!("{parent}{path}") });
            let results = json!({ "bad": [name("robot=R1/day=1/a.parquet"), name("robot=R3/day=1/a.parquet")] });
            assert_eq!(
                bad_recordings_text(&results, &truth),
                "bad recordings: 2 simulated, 1 not reported, 1 others reported\n",
                "{parent}"
            );
        }
    }
}
