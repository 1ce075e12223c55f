//! The vectors of the balances: names that nothing else has, and components as formulas.
//!
//! Known vectors are expressions. Those that are not a single name or number become equations of a listing.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::Mechanism;

use crate::expr::print::{FormulaSymbol, PrintedFormula, formula};
use crate::expr::vector::SymbolicVector;
use crate::expr::{ExprId, Graph, Node};
use crate::lower::{LoweringRequest, lower_with_passes};
use crate::names::reserved_names;
use crate::review::document::PageEquation;
use crate::review::listing;

/// Names of the three axes.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// Index of a vector in [`VectorTable`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct VectorId(pub(super) usize);

/// The components of a vector.
#[derive(Clone, Copy, Debug)]
pub(super) enum VectorComponents {
    /// Functions of the state.
    Known(SymbolicVector),
    /// Unknowns of the balances; components that are false are zero.
    Unknown([bool; 3]),
}

/// A vector with its name.
#[derive(Clone, Debug)]
pub(super) struct NamedVector {
    /// Its symbol.
    pub(super) symbol: String,
    /// What it is.
    pub(super) meaning: String,
    /// Its unit.
    pub(super) unit: &'static str,
    /// The joint or loop that transmits it.
    pub(super) transmitted_by: Option<String>,
    /// Its components.
    pub(super) components: VectorComponents,
    /// Axes along which its components are needed.
    axes: Vec<usize>,
}

/// All vectors of a body.
pub(super) struct VectorTable {
    /// The vectors.
    pub(super) vectors: Vec<NamedVector>,
    /// Names that are taken.
    taken: BTreeSet<String>,
    /// Axes along which forces are balanced.
    force_axes: Vec<usize>,
    /// Axes about which moments are balanced.
    moment_axes: Vec<usize>,
}

impl VectorTable {
    /// An empty table next to the names of the model file.
    pub(super) fn new(mechanism: &Mechanism, force_axes: Vec<usize>, moment_axes: Vec<usize>) -> Self {
        Self {
            vectors: Vec::new(),
            taken: reserved_names(mechanism),
            force_axes,
            moment_axes,
        }
    }

    /// A name that nothing else has; neither have its components.
    pub(super) fn unique_name(&mut self, wanted: &str) -> String {
        let plain = |c: char| if c.is_alphanumeric() { c } else { '_' };
        let mut name: String = wanted.chars().map(plain).collect();
        let with_axes = |name: &str| {
            [name.to_owned()]
                .into_iter()
                .chain(AXES.map(|axis| format!("{name}_{axis}")))
        };
        while with_axes(&name).any(|one| self.taken.contains(&one)) {
            name.push_str("_v");
        }
        self.taken.extend(with_axes(&name));
        name
    }

    /// Adds a vector whose components along the axes of forces are needed.
    pub(super) fn add(
        &mut self,
        wanted: &str,
        unit: &'static str,
        components: VectorComponents,
        meaning: String,
    ) -> VectorId {
        let axes = self.force_axes.clone();
        self.add_along(wanted, unit, components, meaning, axes)
    }

    /// Adds a vector whose components along the axes of moments are needed.
    pub(super) fn add_moment(&mut self, wanted: &str, components: VectorComponents, meaning: String) -> VectorId {
        let axes = self.moment_axes.clone();
        self.add_along(wanted, "N m", components, meaning, axes)
    }

    /// Adds a vector with the axes along which it is needed.
    fn add_along(
        &mut self,
        wanted: &str,
        unit: &'static str,
        components: VectorComponents,
        meaning: String,
        axes: Vec<usize>,
    ) -> VectorId {
        let symbol = self.unique_name(wanted);
        self.vectors.push(NamedVector {
            symbol,
            meaning,
            unit,
            transmitted_by: None,
            components,
            axes,
        });
        VectorId(self.vectors.len() - 1)
    }

    /// The symbol of a vector as a formula.
    pub(super) fn symbol(&self, id: VectorId) -> PrintedFormula {
        PrintedFormula::name(&*self.vectors[id.0].symbol)
    }

    /// Whether a vector is zero along all axes.
    pub(super) fn is_zero(&self, id: VectorId) -> bool {
        match self.vectors[id.0].components {
            VectorComponents::Known(v) => v.iter().all(|x| *x == Graph::ZERO),
            VectorComponents::Unknown(which) => !self.vectors[id.0].axes.iter().any(|k| which[*k]),
        }
    }

    /// Components of all vectors as formulas, and the equations that define those that are no single name or number.
    pub(super) fn write_components(
        &self,
        graph: &Graph,
        mechanism: &Mechanism,
    ) -> (Vec<[PrintedFormula; 3]>, Vec<PageEquation>) {
        let mut formulas = Vec::new();
        let (mut outputs, mut symbols): (Vec<ExprId>, Vec<FormulaSymbol>) = (Vec::new(), Vec::new());
        for vector in &self.vectors {
            let component = |k: usize| PrintedFormula::name(format!("{}_{}", vector.symbol, AXES[k]));
            let mut of_vector = [0; 3].map(PrintedFormula::integer);
            for &k in &vector.axes {
                of_vector[k] = match vector.components {
                    VectorComponents::Unknown(which) if which[k] => component(k),
                    VectorComponents::Unknown(_) => PrintedFormula::integer(0),
                    VectorComponents::Known(v) if is_short(graph, v[k]) => formula(graph, mechanism, v[k]),
                    VectorComponents::Known(v) => {
                        outputs.push(v[k]);
                        symbols.push(FormulaSymbol::new(format!("{}_{}", vector.symbol, AXES[k])));
                        component(k)
                    }
                };
            }
            formulas.push(of_vector);
        }
        let request = LoweringRequest {
            outputs: &outputs,
            reachable: &[],
            regular: &[],
            may_be_undefined: false,
            definitions: &[],
        };
        // Without the passes the expressions stay in the form of a textbook.
        let program = lower_with_passes(graph, &[], &request);
        let listed = listing::list_program(&program, mechanism, &BTreeMap::new(), &self.taken, &symbols, "K");
        let definitions = listed.fixed.into_iter().chain(listed.state).collect();
        (formulas, definitions)
    }
}

/// Whether an expression is a number, a name, or one of these with a factor.
fn is_short(graph: &Graph, id: ExprId) -> bool {
    let (base, _) = graph.split_factor(id);
    matches!(graph.node(base), Node::Rational(_) | Node::Atom(_))
}
