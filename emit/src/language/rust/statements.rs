//! Statements and expressions as lines of Rust, and how these lines pass through the token printer.
//!
//! The token printer drops comments and breaks formulas early. Therefore each line of a program travels through it as a
//! string literal, which is replaced by its text afterwards.

use modelmill_codegen::expr::Unary;
use proc_macro2::{Literal, TokenStream};
use quote::quote;

use crate::identifier::field_identifier;
use crate::language::syntax::LanguageSyntax;
use crate::tree::{CodeStatement, PoseCheck};

/// First character of a string literal that stands for a line of source.
const LINE: char = '\u{a7}';

/// Maximal width of a line in a list, without the indentation of the program.
const WIDTH: usize = 88;

/// The syntax of Rust; `n`, the arithmetic of the runtime, must be in scope.
pub(super) struct RustSyntax;

impl LanguageSyntax for RustSyntax {
    fn name(&self, name: &str) -> String {
        field_identifier(name).to_string()
    }

    fn standalone_number(&self, value: f64) -> String {
        format!("n.number({value:?})")
    }

    fn call(&self, function: Unary, argument: &str) -> String {
        // Sine and cosine are computed together; the unused one is dropped by the compiler.
        let name = match function {
            Unary::Sqrt => "sqrt",
            Unary::Sign => "sign",
            Unary::Abs => "abs",
            Unary::Tanh => "tanh",
            Unary::Exp => "exp",
            Unary::Sin => return format!("n.sin_cos({argument}).0"),
            Unary::Cos => return format!("n.sin_cos({argument}).1"),
        };
        format!("{argument}.{name}()")
    }

    fn atan2(&self, y: &str, x: &str) -> String {
        format!("{y}.atan2({x})")
    }
}

/// Statements as tokens that [`restore_lines`] turns into lines.
pub(super) fn statements(statements: &[CodeStatement]) -> TokenStream {
    // Lines first, then tokens.
    let mut written = Vec::new();
    for statement in statements {
        write(statement, 0, &mut written);
    }
    line_tokens(&written)
}

/// Lines of source as string literals.
pub(super) fn line_tokens(written: &[String]) -> TokenStream {
    let texts = written.iter().map(|line| format!("{LINE}{line}"));
    quote! { #(#texts;)* }
}

/// The items of a list between `start` and `end`, filled into lines.
pub(super) fn fill_lines(start: &str, items: impl Iterator<Item = String>, end: &str) -> Vec<String> {
    let mut lines = vec![start.to_owned()];
    let mut items = items.peekable();
    while let Some(mut item) = items.next() {
        item.push_str(if items.peek().is_some() { "," } else { end });
        // The first item follows `start` without a blank.
        let space = if lines.len() == 1 && lines[0] == start { "" } else { " " };
        match lines.last_mut() {
            Some(line) if line.len() + space.len() + item.len() <= WIDTH => {
                line.push_str(space);
                line.push_str(&item);
            }
            _ => lines.push(format!("    {item}")),
        }
    }
    lines
}

/// Source of an expression as a string literal that [`restore_lines`] replaces.
pub(super) fn verbatim_tokens(text: &str) -> TokenStream {
    let text = format!("{LINE}{text}");
    quote! { #text }
}

/// The printed source with all literals of lines replaced by their text.
pub(super) fn restore_lines(source: &str) -> String {
    let start = format!("\"{LINE}");
    let mut text = String::with_capacity(source.len());
    for line in source.lines() {
        let mut rest = line;
        // Each literal that begins with the marker is unescaped and written without quotes.
        while let Some(at) = rest.find(&start) {
            text.push_str(&rest[..at]);
            let literal = &rest[at..at + literal_length(&rest[at..])];
            rest = &rest[at + literal.len()..];
            let value = syn::parse_str::<syn::LitStr>(literal).map(|literal| literal.value());
            let value = value.unwrap_or_default();
            // Further lines of a text get the indentation of the first one.
            let indent = &line[..line.len() - line.trim_start().len()];
            let value = value.trim_start_matches(LINE);
            text.push_str(&value.replace('\n', &format!("\n{indent}")));
            // A statement has its own semicolon.
            if rest == ";" {
                rest = "";
            }
        }
        text.push_str(rest);
        text.push('\n');
    }
    text
}

/// Length in bytes of the string literal at the start of the text.
fn literal_length(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            '\\' if !escaped => escaped = true,
            '"' if !escaped => return at + 1,
            _ => escaped = false,
        }
    }
    text.len()
}

/// Appends a statement as lines, indented by `depth` levels.
fn write(statement: &CodeStatement, depth: usize, lines: &mut Vec<String>) {
    let indent = "    ".repeat(depth);
    let mut line = |text: String| lines.push(format!("{indent}{text}"));
    match statement {
        // Headings become comments.
        CodeStatement::Section(text) => line(format!("// {text}")),
        CodeStatement::Let { name, value, note } => {
            let note = note.as_ref().map_or(String::new(), |note| format!(" // {note}"));
            line(format!(
                "let {} = {};{note}",
                RustSyntax.name(name),
                RustSyntax.operand_text(value)
            ));
        }
        // Sines and cosines of all angles of a program are computed together, in vectors.
        CodeStatement::Angles(angles) => {
            // The list takes variables; an expression is made one first.
            let values = angles.iter().map(|angle| {
                let value = RustSyntax.operand_text(&angle.value);
                if angle.plain { value } else { format!("({value}).var()") }
            });
            let mut values: Vec<String> = values.collect();
            // The compiler pairs the lanes only if the number of angles is even, so the last one is repeated.
            if values.len() % 2 == 1 {
                values.extend(values.last().cloned());
            }
            line(format!("let angles = n.angles([{}]);", values.join(", ")));
        }
        CodeStatement::SinCos {
            sine,
            cosine,
            angle,
            requested: asked,
        } => {
            // A value that is not needed is not bound.
            let name = |name: &Option<String>| match name {
                Some(name) => RustSyntax.name(name),
                None => "_".to_owned(),
            };
            // From the list of angles, or computed here.
            let value = match asked {
                Some(k) => format!("n.sin_cos_of(&angles, {k})"),
                None => format!("n.sin_cos({})", RustSyntax.operand_text(angle)),
            };
            line(format!("let ({}, {}) = {value};", name(sine), name(cosine)));
        }
        CodeStatement::Guard(check) => line(match check {
            PoseCheck::Reachable(value) => {
                format!("n.reachable({})?;", RustSyntax.operand_text(value))
            }
            PoseCheck::Regular(value, size) => {
                format!(
                    "n.regular({}, {})?;",
                    RustSyntax.operand_text(value),
                    RustSyntax.operand_text(size)
                )
            }
            PoseCheck::Finite(value) => format!("n.finite({})?;", RustSyntax.operand_text(value)),
        }),
        CodeStatement::Put { output, value, entry } => {
            let note = if entry.is_empty() {
                String::new()
            } else {
                format!(" // {entry}")
            };
            line(format!("n.put({output}, {});{note}", RustSyntax.operand_text(value)));
        }
        // A block, which returns the values that later statements read.
        CodeStatement::Group {
            statements,
            exported: handed,
        } => {
            // The names that the block returns.
            let names: Vec<String> = handed.iter().map(|name| RustSyntax.name(name)).collect();
            let names = names.join(", ");
            if handed.is_empty() {
                line("{".to_owned());
            } else {
                line(format!("let ({names},) = {{"));
            }
            // The statements of the block.
            for statement in statements {
                write(statement, depth + 1, lines);
            }
            if handed.is_empty() {
                lines.push(format!("{indent}}}"));
            } else {
                lines.push(format!("{indent}    ({names},)"));
                lines.push(format!("{indent}}};"));
            }
        }
    }
}

/// A number as an unsuffixed literal with its sign.
pub(super) fn number_token(value: f64) -> TokenStream {
    let magnitude = Literal::f64_unsuffixed(value.abs());
    if value.is_sign_negative() {
        quote! { -#magnitude }
    } else {
        quote! { #magnitude }
    }
}
