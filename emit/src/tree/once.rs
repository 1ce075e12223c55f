//! Precomputed values of several programs: values that two programs have in common are computed once.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;

use super::regroup::group_statements;
use super::scope::{NameScope, unique_name};
use super::{CodeStatement, PoseCheck, StatementRoutine};
/// What all programs of one struct compute once per geometry and parameters.
#[derive(Clone, Debug)]
pub(crate) struct PrecomputedValues {
    /// The statements, in order.
    statements: Vec<CodeStatement>,
    /// Names of the values that programs read at every state, in the order in which they are stored.
    pub(crate) kept: Vec<String>,
    /// Inputs that the statements read.
    pub(crate) read: BTreeSet<Atom>,
    /// Names that may not be used again.
    taken: BTreeSet<String>,
    /// Counter of generated names.
    next: usize,
}

impl PrecomputedValues {
    /// No values; names of the scope are taken.
    pub(crate) fn new(scope: &NameScope) -> Self {
        Self {
            statements: Vec::new(),
            kept: Vec::new(),
            read: BTreeSet::new(),
            taken: scope.reserved_names().clone(),
            next: 0,
        }
    }

    /// Moves the precomputed statements of a program here. Statements with an equal value are shared, and names in the
    /// program are replaced by the ones chosen here.
    pub(crate) fn absorb(&mut self, routine: &mut StatementRoutine) {
        // New names by old names of this program.
        let mut renamed: BTreeMap<String, String> = BTreeMap::new();
        for mut statement in std::mem::take(&mut routine.once) {
            statement.rename(&|name| replace_name(&renamed, name));
            match statement {
                // The same value under another name is reused.
                CodeStatement::Let { name, value, note } => {
                    // A statement with the same value.
                    let known = self.statements.iter().find_map(|other| match other {
                        CodeStatement::Let { name, value: v, .. } if *v == value => Some(name.clone()),
                        _ => None,
                    });
                    let new = known.unwrap_or_else(|| {
                        let new = self.unique_name(&name);
                        self.statements.push(CodeStatement::Let {
                            name: new.clone(),
                            value,
                            note,
                        });
                        new
                    });
                    renamed.insert(name, new);
                }
                CodeStatement::SinCos {
                    sine,
                    cosine,
                    angle,
                    requested: asked,
                } => {
                    // Sines and cosines are not compared with earlier ones.
                    let [sine, cosine] = [sine, cosine].map(|name| {
                        name.map(|name| {
                            let new = self.unique_name(&name);
                            renamed.insert(name, new.clone());
                            new
                        })
                    });
                    self.statements.push(CodeStatement::SinCos {
                        sine,
                        cosine,
                        angle,
                        requested: asked,
                    });
                }
                other => self.statements.push(other),
            }
        }
        // The rest of the program follows the renaming.
        for name in &mut routine.kept {
            replace_name(&renamed, name);
            if !self.kept.contains(name) {
                self.kept.push(name.clone());
            }
        }
        routine.kept.dedup();
        for statement in &mut routine.state {
            statement.rename(&|name| replace_name(&renamed, name));
        }
        for result in &mut routine.results {
            result.rename(&|name| replace_name(&renamed, name));
        }
        self.read.extend(&routine.read_once);
    }

    /// All statements, in groups if they are many.
    pub(crate) fn statements(&self) -> Vec<CodeStatement> {
        group_statements(self.statements.clone(), &self.kept)
    }

    /// The wanted name, or a similar one that is free. Generated names are numbered anew.
    fn unique_name(&mut self, name: &str) -> String {
        // Whether the name was generated.
        let numbered = name
            .strip_prefix('k')
            .is_some_and(|rest| rest.chars().all(|c| c.is_ascii_digit()));
        if !numbered {
            return unique_name(name, &mut self.taken);
        }
        loop {
            self.next += 1;
            let name = format!("k{}", self.next);
            if self.taken.insert(name.clone()) {
                return name;
            }
        }
    }
}

/// Replaces a name if it has a new one.
fn replace_name(renamed: &BTreeMap<String, String>, name: &mut String) {
    if let Some(new) = renamed.get(name) {
        new.clone_into(name);
    }
}

impl CodeStatement {
    /// Calls `change` for every name that the statement reads.
    fn rename(&mut self, change: &dyn Fn(&mut String)) {
        match self {
            Self::Section(_) => {}
            Self::Let { value, .. } | Self::Put { value, .. } => value.rename(change),
            Self::SinCos { angle, .. } => angle.rename(change),
            Self::Angles(angles) => {
                for angle in angles {
                    angle.value.rename(change);
                }
            }
            Self::Guard(check) => match check {
                PoseCheck::Reachable(a) | PoseCheck::Finite(a) => a.rename(change),
                PoseCheck::Regular(a, size) => {
                    a.rename(change);
                    size.rename(change);
                }
            },
            Self::Group { statements, .. } => {
                for statement in statements {
                    statement.rename(change);
                }
            }
        }
    }
}
