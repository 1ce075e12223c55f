//! The report of a reduction: assumptions with their sizes, and their text.

use std::fmt::Write as _;

/// All assumptions of a reduction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReductionReport {
    /// The findings, in the order in which they were made; the text sorts them by step.
    pub findings: Vec<ReductionFinding>,
}

/// One assumption with its size, or one remark.
#[derive(Clone, Debug, PartialEq)]
pub struct ReductionFinding {
    /// Step of the strategy: 1 planar reduction, 2 substitution parts and lumped masses, 3 symmetry, 4 drives.
    pub step: u8,
    /// Name of the group, part, symbol or drive.
    pub about: String,
    /// The assumption, as a text after the name.
    pub says: String,
    /// Sizes of the neglected quantities; zero up to rounding if the assumption is exact.
    pub sizes: Vec<AssumptionSize>,
}

/// The size of a neglected quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct AssumptionSize {
    /// Name of the quantity.
    pub quantity: &'static str,
    /// Its magnitude, not negative.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

/// Sizes below this are rounding.
const ROUNDING: f64 = 1e-9;

impl AssumptionSize {
    /// The magnitude of a value, with its name and unit.
    pub(crate) fn new(of: &'static str, value: f64, unit: &'static str) -> Self {
        Self {
            quantity: of,
            value: value.abs(),
            unit,
        }
    }

    /// Whether it is more than rounding.
    pub fn is_significant(&self) -> bool {
        self.value > ROUNDING
    }
}

impl ReductionReport {
    /// Adds a finding.
    pub(crate) fn add(&mut self, step: u8, about: &str, says: impl Into<String>, sizes: Vec<AssumptionSize>) {
        self.findings.push(ReductionFinding {
            step,
            about: about.to_owned(),
            says: says.into(),
            sizes,
        });
    }

    /// The report as text, one paragraph per step.
    pub fn text(&self) -> String {
        let titles = [
            "Step 1 - Planar reduction",
            "Step 2 - Substitution parts and lumped masses, eq. (1)",
            "Step 3 - Symmetry: shared symbols",
            "Step 4 - Drives",
        ];
        let mut text = String::new();
        for (step, title) in (1..).zip(titles) {
            // Steps without findings have no title.
            let findings: Vec<&ReductionFinding> =
                self.findings.iter().filter(|finding| finding.step == step).collect();
            if findings.is_empty() {
                continue;
            }
            let _ = writeln!(text, "{title}");
            // Consecutive exact findings with the same text are printed once, with all names.
            for alike in findings.chunk_by(|a, b| a.is_same_exact(b)) {
                let one = alike[0];
                if alike.len() > 1 {
                    let names: Vec<&str> = alike.iter().map(|f| f.about.as_str()).collect();
                    let _ = writeln!(text, "  {}\n  {:<16}{}", names.join(", "), "", one.says);
                } else {
                    let _ = writeln!(text, "  {:<15} {}", one.about, one.says);
                }
                if !one.sizes.is_empty() {
                    let sizes: Vec<String> = one.sizes.iter().map(ToString::to_string).collect();
                    let _ = writeln!(text, "  {:<16}  {}", "", sizes.join(", "));
                }
            }
        }
        text
    }
}

impl ReductionFinding {
    /// Whether both findings have the same text and are exact.
    fn is_same_exact(&self, other: &Self) -> bool {
        let is_exact = |finding: &Self| !finding.sizes.iter().any(AssumptionSize::is_significant);
        self.says == other.says && is_exact(self) && is_exact(other)
    }
}

impl std::fmt::Display for AssumptionSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // One digit is enough for rounding, whose exponent shows what it is.
        let n_digits = if self.is_significant() { 4 } else { 1 };
        let value = crate::write::significant_digits(self.value, n_digits);
        write!(f, "{} {value} {}", self.quantity, self.unit)
    }
}
