//! Why the condition number of the excitation is not the paper's: the search once more, with one assumption changed
//! at a time. Also what the period as a variable and other numbers of harmonics buy, eq. (17).

use modelmill::{Error, Host, Outcome};
use modelmill_identify::excite::Options;

use crate::bundled;
use crate::runs::{self, LimitFactors};

/// The best condition number under one set of assumptions.
pub(crate) struct ConditionRow {
    /// What differs from the excitation of this page.
    pub(crate) change: String,
    /// Number of harmonics.
    pub(crate) harmonics: usize,
    /// Period, s.
    pub(crate) period: f64,
    /// Condition number.
    pub(crate) condition_number: f64,
}

/// The comparison of all assumptions.
pub(crate) struct ConditionComparison {
    /// Assumptions with their best condition numbers.
    pub(crate) rows: Vec<ConditionRow>,
    /// Assumptions under which there is none, each with the reason.
    pub(crate) without: Vec<[String; 2]>,
}

/// Bounds of the period where it is a variable, s.
pub(crate) const PERIODS: [f64; 2] = [3.0, 15.0];
/// Numbers of harmonics that are compared.
const HARMONICS: [usize; 4] = [3, 5, 7, 9];
/// Other distances of the base joints, m.
const DISTANCES: [f64; 2] = [0.5, 0.2];
/// Factors of the limits.
const FACTORS: [f64; 2] = [1.5, 2.0];

/// Searches with each change.
///
/// Fails only if the user cancels it.
pub(crate) fn compare(host: &Host, base: &Options) -> Outcome<ConditionComparison> {
    let paper = bundled::model(host, "spidermill-paper.toml")?;
    let mut rows = Vec::new();
    let mut without = Vec::new();
    let mut search =
        |change: String, model: &modelmill::Model, options: &Options, factors: LimitFactors| -> Outcome<()> {
            match runs::search_within(model, options, factors, "comparing excitations")? {
                Ok(found) => rows.push(ConditionRow {
                    change,
                    harmonics: options.harmonics,
                    period: found.period,
                    condition_number: found.condition_number,
                }),
                Err(reason) => without.push([change, reason]),
            }
            Ok(())
        };
    // One number of harmonics after the other, with the paper's period and with the best one.
    for harmonics in HARMONICS {
        for period_range in [None, Some(PERIODS)] {
            let options = Options {
                harmonics,
                period_range,
                ..base.clone()
            };
            let change = match period_range {
                None => format!("{harmonics} harmonics"),
                Some([low, high]) => format!("{harmonics} harmonics, best period between {low} and {high} s"),
            };
            search(change, &paper, &options, LimitFactors::default())?;
        }
    }
    for factor in FACTORS {
        let rates = LimitFactors {
            rates: factor,
            ..LimitFactors::default()
        };
        search(
            format!("limits of rates and accelerations times {factor}"),
            &paper,
            base,
            rates,
        )?;
    }
    let wider = LimitFactors {
        positions: 1.25,
        ..LimitFactors::default()
    };
    search("ranges of the crank angles times 1.25".to_owned(), &paper, base, wider)?;
    let mut failures = Vec::new();
    for distance in DISTANCES {
        let text = format!(
            "schema = 1\nname = \"other_length\"\nextends = \"spidermill-paper.toml\"\n\
             [constants]\nb = {{ value = {distance}, unit = \"m\" }}\n"
        );
        let change = format!("distance of the base joints b = {distance} m");
        // The loops may not close at the nominal pose of another length.
        match bundled::variant(host, "the paper's model", "other-length.toml", &text) {
            Ok(model) => search(change, &model, base, LimitFactors::default())?,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => failures.push([change, error.to_string()]),
        }
    }
    without.extend(failures);
    Ok(ConditionComparison { rows, without })
}
