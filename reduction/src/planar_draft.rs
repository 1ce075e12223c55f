//! The draft of the planar model file. Exact values with their names go in; each name gets the mean of its values, and
//! step 3 reports how much the values of a shared name differ.

use crate::report::{AssumptionSize, ReductionReport};

/// A symbol of the model with all values that share it.
#[derive(Clone, Debug)]
pub(crate) struct DraftSymbol {
    /// Name in the model.
    pub(crate) name: String,
    /// Unit, such as `kg`.
    pub(crate) unit: &'static str,
    /// Note in the model file; may be empty.
    pub(crate) note: String,
    /// Names of the quantities that it represents, with their exact values.
    pub(crate) stands_for: Vec<(String, f64)>,
}

impl DraftSymbol {
    /// The value in the model: the mean, rounded to twelve digits.
    pub(crate) fn value(&self) -> f64 {
        let sum: f64 = self.stands_for.iter().map(|(_, value)| value).sum();
        round_to_12_digits(sum / self.stands_for.len().max(1) as f64)
    }

    /// The largest difference between an exact value and that of the model.
    fn largest_deviation(&self) -> f64 {
        let value = self.value();
        self.stands_for
            .iter()
            .fold(0.0, |most: f64, (_, x)| most.max((x - value).abs()))
    }
}

/// A value rounded to twelve significant digits; further digits are rounding errors of sums.
pub(crate) fn round_to_12_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Symbols in the order of their first use.
#[derive(Clone, Debug, Default)]
pub(crate) struct DraftSymbols(pub(crate) Vec<DraftSymbol>);

impl DraftSymbols {
    /// Adds a value to the symbol `name`, which is created at its first value. `what` names the quantity.
    pub(crate) fn add_value(&mut self, name: &str, unit: &'static str, note: &str, what: &str, value: f64) {
        // Parts that share a symbol add their values to it.
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

    /// The value of a symbol; zero if there is none with this name.
    pub(crate) fn value(&self, name: &str) -> f64 {
        self.0
            .iter()
            .find(|symbol| symbol.name == name)
            .map_or(0.0, DraftSymbol::value)
    }

    /// Step 3: reports each shared symbol with the largest difference of its values.
    pub(crate) fn report_ties(&self, report: &mut ReductionReport) {
        for symbol in self.0.iter().filter(|symbol| symbol.stands_for.len() > 1) {
            let who: Vec<&str> = symbol.stands_for.iter().map(|(what, _)| what.as_str()).collect();
            report.add(
                3,
                &symbol.name,
                format!("is shared by {}", who.join(" and ")),
                vec![AssumptionSize::new(
                    "largest difference",
                    symbol.largest_deviation(),
                    symbol.unit,
                )],
            );
        }
    }
}

/// A frame with a revolute joint about the normal.
#[derive(Clone, Debug)]
pub(crate) struct DraftFrame {
    /// Name of the frame.
    pub(crate) name: String,
    /// Name of the frame that carries it.
    pub(crate) on: String,
    /// Expressions of its origin in its carrier.
    pub(crate) at: [String; 2],
    /// Expression of its angle.
    pub(crate) angle: String,
    /// Note in the model file; may be empty.
    pub(crate) note: String,
}

/// A point.
#[derive(Clone, Debug)]
pub(crate) struct DraftPoint {
    /// Name of the point.
    pub(crate) name: String,
    /// Name of its frame.
    pub(crate) on: String,
    /// Expressions of its position in the frame.
    pub(crate) at: [String; 2],
}

/// A rigid body. Its mass, centre and inertia are names of symbols, or `0`.
#[derive(Clone, Debug)]
pub(crate) struct DraftPart {
    /// Name of the body.
    pub(crate) name: String,
    /// Name of its frame.
    pub(crate) on: String,
    /// Symbol of the mass.
    pub(crate) mass: String,
    /// Symbols of the centre of mass along and across the longitudinal axis.
    pub(crate) centre: [String; 2],
    /// Symbol of the inertia about the centre of mass.
    pub(crate) inertia: String,
}

/// A coordinate.
#[derive(Clone, Debug)]
pub(crate) struct DraftCoordinate {
    /// Name of the coordinate.
    pub(crate) name: String,
    /// Nominal value, rad.
    pub(crate) nominal: f64,
    /// Whether the loops determine it.
    pub(crate) passive: bool,
}

/// An effect of the rig that the model keeps.
#[derive(Clone, Debug)]
pub(crate) struct DraftEffect {
    /// Kind in the library of effects.
    pub(crate) kind: String,
    /// Names of the drives where it acts.
    pub(crate) at: Vec<String>,
    /// Symbols and nominal values of its parameters, in SI units.
    pub(crate) parameters: Vec<(String, f64)>,
    /// Symbols and values of its constants, in SI units.
    pub(crate) constants: Vec<(String, f64)>,
}

/// The contents of a planar model file.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlanarDraft {
    /// Name of the model.
    pub(crate) name: String,
    /// Title of the model; may be empty.
    pub(crate) title: String,
    /// A sentence on its origin, for the head of the file.
    pub(crate) origin: String,
    /// Expressions of gravity along x and y.
    pub(crate) gravity: [String; 2],
    /// Known quantities: lengths, angles and gravity.
    pub(crate) constants: DraftSymbols,
    /// Masses.
    pub(crate) masses: DraftSymbols,
    /// Components of centres of mass.
    pub(crate) centres: DraftSymbols,
    /// Moments of inertia.
    pub(crate) inertias: DraftSymbols,
    /// Coordinates, in the order of the parts.
    pub(crate) coordinates: Vec<DraftCoordinate>,
    /// Frames, one per part.
    pub(crate) frames: Vec<DraftFrame>,
    /// Points of loops, drives and lumped masses.
    pub(crate) points: Vec<DraftPoint>,
    /// Bodies, one per part.
    pub(crate) parts: Vec<DraftPart>,
    /// Name, symbol, number of shares, point.
    pub(crate) lumped_masses: Vec<(String, String, usize, String)>,
    /// Name, and the two points that coincide.
    pub(crate) loops: Vec<(String, [String; 2])>,
    /// Name, and either a coordinate or two points.
    pub(crate) drives: Vec<(String, Result<String, [String; 2]>)>,
    /// Effects at drives.
    pub(crate) effects: Vec<DraftEffect>,
}
