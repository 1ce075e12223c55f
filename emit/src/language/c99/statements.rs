//! Statements and expressions as lines of C.

use modelmill_codegen::expr::Unary;

use crate::identifier::spell_plain;
use crate::language::syntax::LanguageSyntax;
use crate::tree::{CodeStatement, PoseCheck};

/// The syntax of C with the prefixes of one unit.
pub(super) struct CSyntax<'a> {
    /// Prefix of functions, and of the status.
    pub(super) name: &'a str,
    /// Prefix of constants and status codes.
    pub(super) upper: &'a str,
}

/// Words of C and C++, names of the included headers, and names of the emitted functions, which no variable may have.
const RESERVED_NAMES: [&str; 83] = [
    "sines",
    "cosines",
    "SINGULAR_SHARE",
    "LARGEST_INPUT",
    "DBL_MAX",
    "auto",
    "break",
    "case",
    "char",
    "const",
    "continue",
    "default",
    "do",
    "double",
    "else",
    "enum",
    "extern",
    "float",
    "for",
    "goto",
    "if",
    "inline",
    "int",
    "long",
    "register",
    "restrict",
    "return",
    "short",
    "signed",
    "sizeof",
    "static",
    "struct",
    "switch",
    "typedef",
    "union",
    "unsigned",
    "void",
    "volatile",
    "while",
    "asm",
    "typeof",
    "unix",
    "linux",
    "i386",
    "sin",
    "cos",
    "sqrt",
    "fabs",
    "tanh",
    "exp",
    "atan2",
    "isnan",
    "isinf",
    "isfinite",
    "NAN",
    "INFINITY",
    "HUGE_VAL",
    "NULL",
    "memcpy",
    "memset",
    "size_t",
    "errno",
    "self",
    "status",
    "k",
    "bool",
    "true",
    "false",
    "and",
    "or",
    "not",
    "xor",
    "class",
    "new",
    "delete",
    "this",
    "template",
    "private",
    "public",
    "protected",
    "namespace",
    "try",
    "catch",
];

/// Whether a name has another meaning in C, C++ or the emitted source.
pub(super) fn is_reserved(name: &str) -> bool {
    RESERVED_NAMES.contains(&name)
}

impl LanguageSyntax for CSyntax<'_> {
    fn name(&self, name: &str) -> String {
        // Names with the prefix of the unit could collide with its functions and constants.
        // Letters first, then letters, digits and underscores.
        let plain = name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && !is_reserved(name)
            && !name.starts_with(&format!("{}_", self.name))
            && !name.starts_with(&format!("{}_", self.upper));
        if plain {
            return name.to_owned();
        }
        spell_plain(name)
    }

    fn call(&self, function: Unary, argument: &str) -> String {
        // The argument may have parentheses of its own, which the call replaces.
        let bare = argument
            .strip_prefix('(')
            .and_then(|rest| rest.strip_suffix(')'))
            .filter(|inner| is_balanced(inner));
        let argument = bare.unwrap_or(argument);
        let name = match function {
            Unary::Sqrt => "sqrt",
            Unary::Sign => return format!("{}_sign({argument})", self.name),
            Unary::Abs => "fabs",
            Unary::Tanh => "tanh",
            Unary::Exp => "exp",
            Unary::Sin => "sin",
            Unary::Cos => "cos",
        };
        format!("{name}({argument})")
    }

    fn atan2(&self, y: &str, x: &str) -> String {
        format!("atan2({y}, {x})")
    }
}

/// Whether every parenthesis in the text is closed within it.
fn is_balanced(text: &str) -> bool {
    let mut depth = 0_i32;
    // A closing parenthesis before its opening one belongs to the surrounding text.
    for c in text.chars() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        if depth < 0 {
            return false;
        }
    }
    depth == 0
}

impl CSyntax<'_> {
    /// Appends the statements as lines. An array `outputs` for the results must be in scope.
    pub(super) fn statements(&self, statements: &[CodeStatement], lines: &mut Vec<String>) {
        for statement in statements {
            self.statement(statement, lines);
        }
    }

    /// Appends one statement.
    fn statement(&self, statement: &CodeStatement, lines: &mut Vec<String>) {
        match statement {
            CodeStatement::Section(text) => lines.push(format!("/* {} */", comment(text))),
            // A named value, with its comment.
            CodeStatement::Let { name, value, note } => {
                let note = note
                    .as_ref()
                    .map_or(String::new(), |note| format!(" /* {} */", comment(note)));
                lines.push(format!(
                    "const double {} = {};{note}",
                    self.name(name),
                    self.operand_text(value)
                ));
            }
            // Sines and cosines of all angles of a program are computed together.
            CodeStatement::Angles(angles) => {
                let mut values: Vec<String> = angles.iter().map(|a| self.operand_text(&a.value)).collect();
                // They are computed in pairs, so the last angle of an odd number is repeated.
                if values.len() % 2 == 1 {
                    values.extend(values.last().cloned());
                }
                let n = values.len();
                lines.push(format!("double sines[{n}], cosines[{n}];"));
                lines.push(format!("const double angles[{n}] = {{{}}};", values.join(", ")));
                lines.push(format!("{}_sin_cos_all({n}, angles, sines, cosines);", self.name));
            }
            CodeStatement::SinCos {
                sine,
                cosine,
                requested: Some(k),
                ..
            } => {
                // Values of an angle that is part of that list.
                for (name, all) in [(sine, "sines"), (cosine, "cosines")] {
                    if let Some(name) = name {
                        lines.push(format!("const double {} = {all}[{k}];", self.name(name)));
                    }
                }
            }
            CodeStatement::SinCos {
                sine,
                cosine,
                angle,
                requested: None,
            } => {
                // A single angle; the number of the line makes the name of an unused value unique.
                let place = lines.len();
                let [sine, cosine] = [(sine, "s"), (cosine, "c")].map(|(name, letter)| match name {
                    Some(name) => self.name(name),
                    None => format!("unused_{letter}{place}"),
                });
                lines.push(format!("double {sine}, {cosine};"));
                lines.push(format!(
                    "{}_sin_cos({}, &{sine}, &{cosine});",
                    self.name,
                    self.operand_text(angle)
                ));
            }
            // A check that fails ends the program with its status.
            // The condition is negated, so that NaN fails it.
            CodeStatement::Guard(check) => lines.push(match check {
                PoseCheck::Reachable(value) => format!(
                    "if (!({} >= 0.0)) return {}_OUT_OF_REACH;",
                    self.operand_text(value),
                    self.upper
                ),
                PoseCheck::Regular(value, size) => format!(
                    "if (!(fabs({}) > SINGULAR_SHARE * {})) return {}_SINGULAR;",
                    self.operand_text(value),
                    self.grouped_text(size),
                    self.upper
                ),
                PoseCheck::Finite(value) => format!(
                    "if (!(fabs({}) <= DBL_MAX)) return {}_UNDEFINED;",
                    self.operand_text(value),
                    self.upper
                ),
            }),
            // Outputs are elements of the caller's array.
            CodeStatement::Put { output, value, entry } => {
                let note = if entry.is_empty() {
                    String::new()
                } else {
                    format!(" /* {} */", comment(entry))
                };
                lines.push(format!("outputs[{output}] = {};{note}", self.operand_text(value)));
            }
            // C needs no blocks, so groups are printed in place.
            CodeStatement::Group { statements, .. } => self.statements(statements, lines),
        }
    }
}

/// Text of the model file for use inside a comment.
pub(super) fn comment(text: &str) -> String {
    let text = modelmill_boundary::text::comment(text);
    // Trigraphs, which old compilers replace, and a backslash, which would continue the line.
    text.replace("??", "? ?").replace('\\', "/")
}
