//! `diff`: the differences of two models, for reviewers.

use modelmill_codegen::review::ReducedEquations;
use modelmill_codegen::{BaseParameterEntry, OperationCount, ProgramStage};

use crate::model::Model;
use crate::model::entries::entries;
use crate::model::thresholds::EQUAL_VALUES;

/// A named entry before and after a change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EntryChange {
    /// Name of the entry. An entry of a model file is named by its table and its own name. Entries of the derived
    /// equations are named by a product of parameters.
    pub name: String,
    /// Its text before; `None` if it is new.
    pub before: Option<String>,
    /// Its text after; `None` if it was removed.
    pub after: Option<String>,
}

/// The nominal value of a base parameter before and after a change, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseValueChange {
    /// The retained product, by which both models name the base parameter.
    pub retained: String,
    /// Its unit.
    pub unit: String,
    /// Its value before. `None` if that model has no such base parameter, or lacks the value of a parameter in its
    /// expression.
    pub before: Option<f64>,
    /// Its value after, likewise.
    pub after: Option<f64>,
}

/// Nominal values of base parameters that differ, in the order of the first model, then of the second.
fn changed_values(before: &Model, after: &Model) -> Vec<BaseValueChange> {
    let value = |model: &Model, retained: &str| {
        let k = model.base.iter().position(|base| base.retained == retained)?;
        model.has_values(k).then(|| model.values[k])
    };
    let is_new = |base: &&BaseParameterEntry| before.base.iter().all(|other| other.retained != base.retained);
    (before.base.iter().chain(after.base.iter().filter(is_new)))
        .map(|base| BaseValueChange {
            retained: base.retained.clone(),
            unit: base.unit.clone(),
            before: value(before, &base.retained),
            after: value(after, &base.retained),
        })
        .filter(|change| match (change.before, change.after) {
            (Some(a), Some(b)) => (a - b).abs() > EQUAL_VALUES * a.abs().max(b.abs()),
            (a, b) => a != b,
        })
        .collect()
}

/// Named entries that differ, in the order of the first list, then of the second.
fn changed_entries(before: &[(String, String)], after: &[(String, String)]) -> Vec<EntryChange> {
    let find =
        |list: &[(String, String)], name: &str| list.iter().find(|(n, _)| n == name).map(|(_, text)| text.clone());
    let added = after.iter().filter(|(name, _)| find(before, name).is_none());
    before
        .iter()
        .chain(added)
        .map(|(name, _)| EntryChange {
            name: name.clone(),
            before: find(before, name),
            after: find(after, name),
        })
        // Constants in numeric form may differ by rounding, which is no change.
        .filter(|change| match (&change.before, &change.after) {
            (Some(before), Some(after)) => !is_equal_but_for_rounding(before, after),
            (before, after) => before != after,
        })
        .collect()
}

/// Whether two texts are equal apart from rounding in the last digits of their numbers.
fn is_equal_but_for_rounding(a: &str, b: &str) -> bool {
    /// Relative tolerance: a few roundings of double precision.
    const ROUNDING: f64 = 2e-15;
    let (mut a, mut b) = (pieces(a), pieces(b));
    loop {
        match (a.next(), b.next()) {
            (None, None) => return true,
            (Some(a), Some(b)) if a == b => {}
            (Some(a), Some(b)) => match (a.parse::<f64>(), b.parse::<f64>()) {
                (Ok(a), Ok(b)) if (a - b).abs() <= ROUNDING * a.abs().max(b.abs()) => {}
                _ => return false,
            },
            _ => return false,
        }
    }
}

/// The text split into numbers and the pieces between them.
fn pieces(text: &str) -> impl Iterator<Item = &str> {
    let is_of_number = |c: char| c.is_ascii_digit() || c == '.';
    let mut rest = text;
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let is_number = is_of_number(first);
        let end = rest.find(|c| is_of_number(c) != is_number);
        let (piece, after) = rest.split_at(end.unwrap_or(rest.len()));
        rest = after;
        Some(piece)
    })
}

/// The differences of two models.
#[derive(Clone, Debug)]
pub struct ModelChanges {
    /// Entries of the model files.
    pub entries: Vec<EntryChange>,
    /// Products of parameters in p_g, eq. (5), that differ. The text is `in p_g`, or `without effect` if the forces do
    /// not depend on the product.
    pub products: Vec<EntryChange>,
    /// Linear dependencies of the regressor columns, eq. (6), named by the dependent column.
    pub dependencies: Vec<EntryChange>,
    /// p_min, eq. (16), named by retained products.
    pub base: Vec<EntryChange>,
    /// Nominal values of p_min that differ.
    pub values: Vec<BaseValueChange>,
    /// Numbers of operations of a call, by the name of the function, before and after.
    pub operations: Vec<(&'static str, OperationCount, OperationCount)>,
}

impl ModelChanges {
    /// The differences of `after` relative to `before`.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::model::ModelChanges;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// let same = ModelChanges::from_models(&arm, &arm);
    /// assert!(same.entries.is_empty() && same.base.is_empty());
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn from_models(before: &Model, after: &Model) -> Self {
        // Each list becomes pairs of a name and a text, which are compared by name.
        let products = |model: &Model| -> Vec<(String, String)> {
            let reduction = &model.derivation.reduction;
            let mechanism = &model.derivation.mechanism;
            let with = reduction.products.iter().map(|p| (p, "in p_g"));
            let without = reduction.without_effect.iter().map(|p| (p, "without effect"));
            with.chain(without)
                .map(|(p, text)| (p.text(mechanism), text.to_owned()))
                .collect()
        };
        let base = |model: &Model| -> Vec<(String, String)> {
            let list = model.base.iter();
            list.map(|b| (b.retained.clone(), b.expression.clone())).collect()
        };
        let count = |pick: &dyn Fn(&Model) -> OperationCount| (pick(before), pick(after));
        let regressor = count(&|m| m.derivation.programs.regressor.count_operations(ProgramStage::State));
        let dynamics = count(&|m| {
            m.derivation
                .programs
                .inverse_dynamics
                .count_operations(ProgramStage::State)
        });
        Self {
            entries: changed_entries(
                &entries(&before.derivation.mechanism),
                &entries(&after.derivation.mechanism),
            ),
            products: changed_entries(&products(before), &products(after)),
            dependencies: changed_entries(&dependencies(before), &dependencies(after)),
            base: changed_entries(&base(before), &base(after)),
            values: changed_values(before, after),
            operations: vec![
                ("regressor", regressor.0, regressor.1),
                ("inverse dynamics", dynamics.0, dynamics.1),
            ],
        }
    }
}

/// The dependencies, eq. (6), named by product: `d1*h[m1*dc1] + d1^2*h[m1*dc1^2]`.
fn dependencies(model: &Model) -> Vec<(String, String)> {
    let equations = ReducedEquations::new(&model.derivation, None);
    equations
        .dependencies
        .into_iter()
        .filter(|line| !line.equals.is_empty())
        .map(|line| {
            let terms: Vec<String> = line
                .equals
                .iter()
                // Factors of one are omitted, sums are put in brackets.
                .map(|(retained, factor)| match factor.as_str() {
                    "1" => format!("h[{retained}]"),
                    "-1" => format!("-h[{retained}]"),
                    factor if factor.contains(" + ") || factor.contains(" - ") => {
                        format!("({factor})*h[{retained}]")
                    }
                    factor => format!("{factor}*h[{retained}]"),
                })
                .collect();
            let right = terms.join(" + ").replace("+ -", "- ");
            (format!("h[{}]", line.parameter), right)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::is_equal_but_for_rounding;

    #[test]
    fn rounding_is_no_change() {
        assert!(is_equal_but_for_rounding(
            "link: -2.138038093018084",
            "link: -2.1380380930180856"
        ));
        assert!(!is_equal_but_for_rounding(
            "link: -2.138038093018084",
            "link: -2.13803809301"
        ));
        assert!(!is_equal_but_for_rounding("a: 1", "b: 1"));
        assert!(!is_equal_but_for_rounding("a: 1", "a: -1"));
        assert!(!is_equal_but_for_rounding("a: 1", "a: 1 m"));
        assert!(!is_equal_but_for_rounding("p = d1*m2", "p = d1*m3"));
    }
}
