//! What several programs compute once, computed once for all of them.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;

use super::build::in_groups;
use super::scope::{Scope, unique};
use super::{Check, Routine, Statement};

/// What is computed once for a geometry and its parameters, by all programs of one struct.
#[derive(Clone, Debug)]
pub(crate) struct Once {
    statements: Vec<Statement>,
    /// Names of the values that programs need at every state.
    pub(crate) kept: Vec<String>,
    /// Inputs that are read.
    pub(crate) read: BTreeSet<Atom>,
    taken: BTreeSet<String>,
    next: usize,
}

impl Once {
    pub(crate) fn new(scope: &Scope) -> Self {
        Self {
            statements: Vec::new(),
            kept: Vec::new(),
            read: BTreeSet::new(),
            taken: scope.taken().clone(),
            next: 0,
        }
    }

    /// Takes over what a program computes once; values that are there already are not computed again.
    pub(crate) fn absorb(&mut self, routine: &mut Routine) {
        let mut renamed: BTreeMap<String, String> = BTreeMap::new();
        for mut statement in std::mem::take(&mut routine.once) {
            statement.rename(&|name| replace(&renamed, name));
            match statement {
                Statement::Let { name, value, note } => {
                    let known = self.statements.iter().find_map(|other| match other {
                        Statement::Let { name, value: v, .. } if *v == value => Some(name.clone()),
                        _ => None,
                    });
                    let new = known.unwrap_or_else(|| {
                        let new = self.called(&name);
                        self.statements.push(Statement::Let {
                            name: new.clone(),
                            value,
                            note,
                        });
                        new
                    });
                    renamed.insert(name, new);
                }
                Statement::SinCos {
                    sine,
                    cosine,
                    angle,
                    asked,
                } => {
                    let [sine, cosine] = [sine, cosine].map(|name| {
                        name.map(|name| {
                            let new = self.called(&name);
                            renamed.insert(name, new.clone());
                            new
                        })
                    });
                    self.statements.push(Statement::SinCos {
                        sine,
                        cosine,
                        angle,
                        asked,
                    });
                }
                other => self.statements.push(other),
            }
        }
        for name in &mut routine.kept {
            replace(&renamed, name);
            if !self.kept.contains(name) {
                self.kept.push(name.clone());
            }
        }
        routine.kept.dedup();
        for statement in &mut routine.state {
            statement.rename(&|name| replace(&renamed, name));
        }
        for result in &mut routine.results {
            result.rename(&|name| replace(&renamed, name));
        }
        self.read.extend(&routine.read_once);
    }

    /// All statements.
    pub(crate) fn statements(&self) -> Vec<Statement> {
        in_groups(self.statements.clone(), &self.kept)
    }

    fn called(&mut self, name: &str) -> String {
        let numbered = name
            .strip_prefix('k')
            .is_some_and(|rest| rest.chars().all(|c| c.is_ascii_digit()));
        if !numbered {
            return unique(name, &mut self.taken);
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

fn replace(renamed: &BTreeMap<String, String>, name: &mut String) {
    if let Some(new) = renamed.get(name) {
        new.clone_into(name);
    }
}

impl Statement {
    /// Calls `change` for every name that it reads.
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
                Check::Reachable(a) | Check::Finite(a) => a.rename(change),
                Check::Regular(a, size) => {
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
