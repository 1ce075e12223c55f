//! Tidies finished statements: what nothing reads is removed, and long programs are divided into groups.

use std::collections::{BTreeMap, BTreeSet};

use super::build::ANGLES;
use super::{CodeExpression, CodeStatement, PoseCheck};

/// Number of statements above which a function is divided into groups.
const LONG: usize = 2000;
/// Number of statements of a group.
const GROUP: usize = 250;

/// Removes named statements that nothing reads: all their uses may have been inlined with another sign.
pub(super) fn without_unread(statements: Vec<CodeStatement>, results: &[CodeExpression]) -> Vec<CodeStatement> {
    let mut read = BTreeSet::new();
    for result in results {
        result.for_each_name(&mut |name| {
            read.insert(name.to_owned());
        });
    }
    // Backwards, so that a removed statement does not count as a reader.
    let mut kept = Vec::with_capacity(statements.len());
    for statement in statements.into_iter().rev() {
        if matches!(&statement, CodeStatement::Let { name, .. } if !read.contains(name)) {
            continue;
        }
        statement.for_each_name_read(&mut |name| {
            // Names that the kept statement reads.
            read.insert(name.to_owned());
        });
        kept.push(statement);
    }
    kept.reverse();
    kept
}

/// Removes headings without statements.
pub(super) fn without_empty(statements: Vec<CodeStatement>) -> Vec<CodeStatement> {
    let is_heading = |statement: &CodeStatement| matches!(statement, CodeStatement::Section(_));
    let mut kept: Vec<CodeStatement> = Vec::with_capacity(statements.len());
    for statement in statements {
        if is_heading(&statement) && kept.last().is_some_and(is_heading) {
            kept.pop();
        }
        kept.push(statement);
    }
    if kept.last().is_some_and(is_heading) {
        kept.pop();
    }
    kept
}

/// Divides a long program into groups. Each group is a block that exports the names which later groups or `kept` need.
///
/// Every `let` opens a scope inside the previous one. A compiler that writes nested debug scopes recursively runs out
/// of stack with many thousands of them.
pub(super) fn group_statements(statements: Vec<CodeStatement>, kept: &[String]) -> Vec<CodeStatement> {
    // Short programs stay flat.
    if statements.len() <= LONG {
        return statements;
    }
    // The last group that reads each name.
    let mut last_need: BTreeMap<String, usize> = BTreeMap::new();
    for (k, statement) in statements.iter().enumerate() {
        statement.for_each_name_read(&mut |name| {
            last_need.insert(name.to_owned(), k / GROUP);
        });
    }
    // Precomputed values are read after the last group.
    for name in kept {
        last_need.insert(name.clone(), usize::MAX);
    }
    let mut groups = Vec::new();
    let mut statements = statements.into_iter().peekable();
    while statements.peek().is_some() {
        let part: Vec<CodeStatement> = statements.by_ref().take(GROUP).collect();
        // Names of this group that a later group reads.
        let mut handed = Vec::new();
        for statement in &part {
            statement.for_each_name_defined(&mut |name| {
                if last_need.get(name).is_some_and(|last| *last > groups.len()) {
                    handed.push(name.to_owned());
                }
            });
        }
        groups.push(CodeStatement::Group {
            statements: part,
            exported: handed,
        });
    }
    groups
}

impl CodeStatement {
    /// Calls `visit` for every name that the statement reads. Groups are built after this analysis.
    fn for_each_name_read(&self, visit: &mut dyn FnMut(&str)) {
        match self {
            Self::Section(_) | Self::Group { .. } => {}
            Self::Let { value, .. } | Self::Put { value, .. } => value.for_each_name(visit),
            Self::SinCos {
                angle,
                requested: asked,
                ..
            } => match asked {
                Some(_) => visit(ANGLES),
                None => angle.for_each_name(visit),
            },
            Self::Angles(angles) => {
                for angle in angles {
                    angle.value.for_each_name(visit);
                }
            }
            Self::Guard(check) => match check {
                PoseCheck::Reachable(a) | PoseCheck::Finite(a) => a.for_each_name(visit),
                PoseCheck::Regular(a, size) => {
                    a.for_each_name(visit);
                    size.for_each_name(visit);
                }
            },
        }
    }

    /// Calls `visit` for every name that the statement defines.
    fn for_each_name_defined(&self, visit: &mut dyn FnMut(&str)) {
        match self {
            Self::Angles(_) => visit(ANGLES),
            Self::Section(_) | Self::Group { .. } | Self::Put { .. } | Self::Guard(_) => {}
            Self::Let { name, .. } => visit(name),
            Self::SinCos { sine, cosine, .. } => {
                for name in sine.iter().chain(cosine) {
                    visit(name);
                }
            }
        }
    }
}
