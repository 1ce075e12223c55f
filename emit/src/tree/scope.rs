//! Names of the variables of a module: those of the model file where possible, all different.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;
use modelmill_codegen::names::NamedQuantities;
use modelmill_codegen::{Derivation, ProgramOp, StraightLineProgram};

use modelmill_spec::DriveKind;

use super::CodeExpression;
use super::pose::SharedPose;
use super::sections::CodeSections;

/// Words that occur in the routines of any language, and names of items that a variable would shadow or match.
const WORDS: [&str; 42] = [
    "n",
    "angles",
    "outputs",
    "input",
    "inputs",
    "passive",
    "self",
    "state",
    "model",
    "geometry",
    "parameters",
    "base",
    "pi",
    "PI",
    "INPUTS",
    "ACTIVE",
    "PASSIVE",
    "DRIVES",
    "JOINTS",
    "LOOPS",
    "CONSTANTS",
    "PARAMETERS",
    "BASE_PARAMETERS",
    "N_ACTIVE",
    "N_PASSIVE",
    "N_DRIVES",
    "N_BASE",
    "N_INPUTS",
    "N_JOINTS",
    "N_LOOPS",
    "N_PRODUCTS",
    "Var",
    "DeferredProduct",
    "ScalarNumbers",
    "Angle",
    "ContinuationProgram",
    "Some",
    "None",
    "Ok",
    "Err",
    "Real",
    "T",
];

/// The names of a model's variables, and what is known of them.
#[derive(Clone, Debug)]
pub(crate) struct NameScope {
    /// Names of inputs.
    atoms: BTreeMap<Atom, String>,
    /// Names that are taken in every program.
    taken: BTreeSet<String>,
    /// Comments on named values.
    notes: BTreeMap<String, String>,
    /// Known quantities, by which values of programs are named.
    pub(crate) meanings: NamedQuantities,
    /// Inputs whose name stands for the negative.
    turned: BTreeSet<Atom>,
    /// Sections of names, for headings.
    pub(super) sections: CodeSections,
    /// The shared part of the pose, if it is a struct of its own.
    pub(crate) pose: Option<Box<SharedPose>>,
}

impl NameScope {
    /// Names of all inputs, without a shared pose.
    pub(crate) fn new(derivation: &Derivation) -> Self {
        let mechanism = &derivation.mechanism;
        let mut scope = Self {
            atoms: BTreeMap::new(),
            taken: WORDS.into_iter().map(str::to_owned).collect(),
            notes: value_notes(derivation),
            meanings: NamedQuantities::new(derivation),
            turned: BTreeSet::new(),
            sections: CodeSections::new(derivation),
            pose: None,
        };
        // Names of the model file come first, so that generated ones give way.
        let coordinates = || mechanism.coordinates.iter().enumerate();
        for (i, c) in mechanism.constants.iter().enumerate() {
            scope.add_name(Atom::Constant(i), &c.name);
        }
        for (i, p) in mechanism.parameters.iter().enumerate() {
            scope.add_name(Atom::Parameter(i), &p.name);
        }
        for (i, c) in coordinates() {
            scope.add_name(Atom::Coordinate(i), &c.name);
        }
        for (i, c) in coordinates() {
            scope.add_name(Atom::Rate(i), &format!("{}_d", c.name));
            scope.add_name(Atom::Acceleration(i), &format!("{}_dd", c.name));
        }
        // Base parameters are called as on the page.
        for k in 0..derivation.reduction.retained.len() {
            scope.add_name(Atom::Base(k), &format!("p{}_min", k + 1));
        }
        for (d, drive) in mechanism.drives.iter().enumerate() {
            scope.add_name(Atom::Load(d), &format!("load_{}", drive.name));
        }
        scope.atoms.insert(Atom::Pi, "pi".to_owned());
        scope
    }

    /// Adds an input under the wanted name or a similar one.
    fn add_name(&mut self, atom: Atom, name: &str) {
        let name = unique_name(name, &mut self.taken);
        self.atoms.insert(atom, name);
    }

    /// As `new`, with the shared part of the pose as a struct of its own.
    pub(crate) fn with_pose(derivation: &Derivation) -> Self {
        let mut scope = Self::new(derivation);
        scope.pose = SharedPose::new(derivation, &mut scope).map(Box::new);
        scope
    }

    /// Adds a shared value as an input of programs; `number` is its value at the state of [`Self::meanings`], by which
    /// it is recognised.
    pub(super) fn add_shared(&mut self, atom: Atom, value: &CodeExpression, number: f64) {
        // The name may stand for the negative.
        let (name, turned) = match value {
            CodeExpression::Neg(a) => (&**a, true),
            a => (a, false),
        };
        let CodeExpression::Name(name) = name else {
            panic!("what is shared has a name: {value:?}");
        };
        self.atoms.insert(atom, name.clone());
        if turned {
            self.turned.insert(atom);
        }
        self.meanings.insert(atom, number);
    }

    /// The expression of an input, with its sign.
    pub(super) fn input_expression(&self, atom: Atom) -> CodeExpression {
        let name = CodeExpression::name(self.input_name(atom));
        if self.turned.contains(&atom) {
            CodeExpression::neg(name)
        } else {
            name
        }
    }

    /// The name of an input; empty if it has none.
    pub(crate) fn input_name(&self, atom: Atom) -> &str {
        self.atoms.get(&atom).map_or("", String::as_str)
    }

    /// Whether a name is that of a coordinate, a rate or an acceleration.
    pub(super) fn is_input(&self, name: &str) -> bool {
        self.atoms.iter().any(|(atom, other)| {
            // Inputs of the state only.
            let of_state = matches!(atom, Atom::Coordinate(_) | Atom::Rate(_) | Atom::Acceleration(_));
            of_state && other == name
        })
    }

    /// The comment on a named value.
    pub(super) fn value_note(&self, name: &str) -> Option<String> {
        self.notes.get(name).cloned()
    }

    /// Names that are taken in a program; those of the shared pose only if the program reads any of it.
    pub(super) fn reserved_names_in(&self, program: &StraightLineProgram) -> BTreeSet<String> {
        let mut taken = self.taken.clone();
        let is_shared = |op: &ProgramOp| matches!(op, ProgramOp::Input(Atom::Shared(_)));
        if program.ops.iter().any(is_shared) {
            let shared = self.atoms.iter();
            let shared = shared.filter(|(atom, _)| matches!(atom, Atom::Shared(_)));
            taken.extend(shared.map(|(_, name)| name.clone()));
        }
        taken
    }

    /// Names that are taken in every program.
    pub(super) fn reserved_names(&self) -> &BTreeSet<String> {
        &self.taken
    }
}

/// Comments on named values: the number of their equation on the page of the model.
fn value_notes(derivation: &Derivation) -> BTreeMap<String, String> {
    let mechanism = &derivation.mechanism;
    let mut notes = BTreeMap::new();
    // Tags count as on the page: closure equations first, then determinants.
    let n_gaps = derivation.loop_gap_count();
    for k in 0..derivation.loop_determinant_count() {
        let tag = format!("eq. (L{})", n_gaps + k + 1);
        notes.insert(format!("Delta_{}", k + 1), tag);
    }
    // Per linear drive: its length, then the entries of its Jacobian that are not zero.
    let mut tag = 0;
    for (d, drive) in mechanism.drives.iter().enumerate() {
        if !matches!(drive.kind, DriveKind::Linear { .. }) {
            continue;
        }
        tag += 1;
        notes.insert(format!("l_{}", drive.name), format!("eq. (D{tag})"));
        for a in derivation.coordinates_that_move(d) {
            tag += 1;
            let name = format!("J_{}_{}", drive.name, mechanism.coordinates[a].name);
            notes.insert(name, format!("eq. (D{tag})"));
        }
    }
    notes
}

/// The wanted name with underscores appended until it is free.
pub(super) fn unique_name(wanted: &str, taken: &mut BTreeSet<String>) -> String {
    let mut name = wanted.to_owned();
    while !taken.insert(name.clone()) {
        name.push('_');
    }
    name
}
