//! The model in the making: numbers get names, names that several numbers share get their mean.

use crate::report::{AssumptionSize, ReductionReport};

/// A named number and all that it stands for.
#[derive(Clone, Debug)]
pub(crate) struct DraftSymbol {
    pub(crate) name: String,
    pub(crate) unit: &'static str,
    pub(crate) note: String,
    /// What it stands for, with the exact values.
    pub(crate) stands_for: Vec<(String, f64)>,
}

impl DraftSymbol {
    /// The value that the model gets: the mean, at twelve digits.
    pub(crate) fn value(&self) -> f64 {
        let sum: f64 = self.stands_for.iter().map(|(_, value)| value).sum();
        round_to_12_digits(sum / self.stands_for.len().max(1) as f64)
    }

    /// The largest distance from that value.
    fn largest_deviation(&self) -> f64 {
        let value = self.value();
        self.stands_for
            .iter()
            .fold(0.0, |most: f64, (_, x)| most.max((x - value).abs()))
    }
}

/// Twelve significant digits: what follows is rounding of sums.
pub(crate) fn round_to_12_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Named numbers in the order in which they came up.
#[derive(Clone, Debug, Default)]
pub(crate) struct DraftSymbols(pub(crate) Vec<DraftSymbol>);

impl DraftSymbols {
    /// Lets `name` stand for one more value.
    pub(crate) fn add_value(
        &mut self,
        name: &str,
        unit: &'static str,
        note: &str,
        what: &str,
        value: f64,
    ) {
        let known = self.0.iter().position(|symbol| symbol.name == name);
        let at = known.unwrap_or_else(|| {
            self.0.push(DraftSymbol {
                name: name.to_owned(),
                unit,
                note: note.to_owned(),
                stands_for: Vec::new(),
            });
            self.0.len() - 1
        });
        self.0[at].stands_for.push((what.to_owned(), value));
    }

    /// The value of a name.
    pub(crate) fn value(&self, name: &str) -> f64 {
        self.0
            .iter()
            .find(|symbol| symbol.name == name)
            .map_or(0.0, DraftSymbol::value)
    }

    /// Step 3: what shares a name, and by how much it differs.
    pub(crate) fn report_ties(&self, report: &mut ReductionReport) {
        for symbol in self.0.iter().filter(|symbol| symbol.stands_for.len() > 1) {
            let who: Vec<&str> = symbol
                .stands_for
                .iter()
                .map(|(what, _)| what.as_str())
                .collect();
            report.add(
                3,
                &symbol.name,
                format!("stands for {}", who.join(" and ")),
                vec![AssumptionSize::new(
                    "hides",
                    symbol.largest_deviation(),
                    symbol.unit,
                )],
            );
        }
    }
}

/// A frame that turns about the normal.
#[derive(Clone, Debug)]
pub(crate) struct DraftFrame {
    pub(crate) name: String,
    pub(crate) on: String,
    /// Expressions of its origin in its carrier.
    pub(crate) at: [String; 2],
    /// Expression of its angle.
    pub(crate) angle: String,
    pub(crate) note: String,
}

/// A point.
#[derive(Clone, Debug)]
pub(crate) struct DraftPoint {
    pub(crate) name: String,
    pub(crate) on: String,
    pub(crate) at: [String; 2],
}

/// A rigid body.
#[derive(Clone, Debug)]
pub(crate) struct DraftPart {
    pub(crate) name: String,
    pub(crate) on: String,
    pub(crate) mass: String,
    pub(crate) centre: [String; 2],
    pub(crate) inertia: String,
}

/// A coordinate.
#[derive(Clone, Debug)]
pub(crate) struct DraftCoordinate {
    pub(crate) name: String,
    pub(crate) nominal: f64,
    pub(crate) passive: bool,
}

/// An effect of the rig that the model takes over.
#[derive(Clone, Debug)]
pub(crate) struct DraftEffect {
    pub(crate) kind: String,
    pub(crate) at: Vec<String>,
    pub(crate) parameters: Vec<(String, f64)>,
    pub(crate) constants: Vec<(String, f64)>,
}

/// Everything that a planar model file says.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlanarDraft {
    pub(crate) name: String,
    pub(crate) title: String,
    /// Where it comes from, for the head of the file.
    pub(crate) origin: String,
    pub(crate) gravity: [String; 2],
    pub(crate) constants: DraftSymbols,
    pub(crate) masses: DraftSymbols,
    pub(crate) centres: DraftSymbols,
    pub(crate) inertias: DraftSymbols,
    pub(crate) coordinates: Vec<DraftCoordinate>,
    pub(crate) frames: Vec<DraftFrame>,
    pub(crate) points: Vec<DraftPoint>,
    pub(crate) parts: Vec<DraftPart>,
    /// Name, symbol, number of shares, point.
    pub(crate) lumped_masses: Vec<(String, String, usize, String)>,
    pub(crate) loops: Vec<(String, [String; 2])>,
    /// Name, and either a coordinate or two points.
    pub(crate) drives: Vec<(String, Result<String, [String; 2]>)>,
    pub(crate) effects: Vec<DraftEffect>,
}
