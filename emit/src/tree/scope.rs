//! Names of a module's variables: those of the model file where they can be, and none twice.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;
use modelmill_codegen::names::NamedQuantities;
use modelmill_codegen::{Derivation, ProgramOp, StraightLineProgram};

use modelmill_spec::DriveKind;

use super::CodeExpression;
use super::pose::SharedPose;
use super::sections::CodeSections;

/// Words that stand in every routine, in whatever language, and names of modules that a variable would meet.
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

/// What the variables of a model are called.
#[derive(Clone, Debug)]
pub(crate) struct NameScope {
    atoms: BTreeMap<Atom, String>,
    taken: BTreeSet<String>,
    /// What values with names are, where there is something to say.
    notes: BTreeMap<String, String>,
    /// What values of programs mean.
    pub(crate) meanings: NamedQuantities,
    /// Inputs that stand with the other sign under their names.
    turned: BTreeSet<Atom>,
    /// What names belong to, for headings.
    pub(super) sections: CodeSections,
    /// What the programs share of the pose, if it is written apart.
    pub(crate) pose: Option<Box<SharedPose>>,
}

impl NameScope {
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
        for k in 0..derivation.reduction.retained.len() {
            scope.add_name(Atom::Base(k), &format!("p{}_min", k + 1));
        }
        for (d, drive) in mechanism.drives.iter().enumerate() {
            scope.add_name(Atom::Load(d), &format!("load_{}", drive.name));
        }
        scope.atoms.insert(Atom::Pi, "pi".to_owned());
        scope
    }

    fn add_name(&mut self, atom: Atom, name: &str) {
        let name = unique_name(name, &mut self.taken);
        self.atoms.insert(atom, name);
    }

    /// The same with what the programs share of the pose written apart.
    pub(crate) fn with_pose(derivation: &Derivation) -> Self {
        let mut scope = Self::new(derivation);
        scope.pose = SharedPose::new(derivation, &mut scope).map(Box::new);
        scope
    }

    /// Takes a value that stands for an input, with its number at the state of [`Self::meanings`].
    pub(super) fn add_shared(&mut self, atom: Atom, value: &CodeExpression, number: f64) {
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

    /// What stands for an input.
    pub(super) fn input_expression(&self, atom: Atom) -> CodeExpression {
        let name = CodeExpression::name(self.input_name(atom));
        if self.turned.contains(&atom) {
            CodeExpression::neg(name)
        } else {
            name
        }
    }

    /// What an input is called.
    pub(crate) fn input_name(&self, atom: Atom) -> &str {
        self.atoms.get(&atom).map_or("", String::as_str)
    }

    /// Whether a name is that of a coordinate, rate or acceleration.
    pub(super) fn is_input(&self, name: &str) -> bool {
        self.atoms.iter().any(|(atom, other)| {
            let of_state = matches!(
                atom,
                Atom::Coordinate(_) | Atom::Rate(_) | Atom::Acceleration(_)
            );
            of_state && other == name
        })
    }

    /// What a value with a name is, for the reader.
    pub(super) fn value_note(&self, name: &str) -> Option<String> {
        self.notes.get(name).cloned()
    }

    /// Names that are taken in a program: those of what is shared only where some of that is read.
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

    /// Names that are taken everywhere.
    pub(super) fn reserved_names(&self) -> &BTreeSet<String> {
        &self.taken
    }
}

/// Notes on values with a name: their numbered equations on the page of the model, and the links that they belong to.
fn value_notes(derivation: &Derivation) -> BTreeMap<String, String> {
    let mechanism = &derivation.mechanism;
    let mut notes = BTreeMap::new();
    let n_gaps = derivation.loop_gap_count();
    for k in 0..derivation.loop_determinant_count() {
        let tag = format!("eq. (L{})", n_gaps + k + 1);
        notes.insert(format!("Delta_{}", k + 1), tag);
    }
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

/// A name near the wanted one that nothing else has.
pub(super) fn unique_name(wanted: &str, taken: &mut BTreeSet<String>) -> String {
    let mut name = wanted.to_owned();
    while !taken.insert(name.clone()) {
        name.push('_');
    }
    name
}
