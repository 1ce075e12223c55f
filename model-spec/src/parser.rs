//! Parser of exact expressions: `"2*r3 + d4"` becomes a tree in which every node has its place in the file.
//!
//! The grammar is that of everyday formulas: `+ - * / ^`, parentheses, `pi`, names, decimals,
//! and the functions `sin cos sqrt abs sign tanh exp`. Nothing is rounded.
//!
//! Recursive descent: a sum contains products, a product contains powers, a power contains atoms.

use modelmill_boundary::nesting::NestingLevel;
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, Pow, Zero};

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::quote;
use crate::formula::{FUNCTIONS, FormulaAst, FormulaAstKind, LONGEST_FORMULA};
use crate::suggest;

/// Deepest nesting of parentheses, functions and powers.
const DEEPEST: usize = 48;
/// Most digits of one number, before and after the point together.
const MOST_DIGITS: usize = 40;
/// Largest exponent of a power. Exponents of ten in a decimal may be twice as large.
const LARGEST_EXPONENT: i32 = 16;
/// Largest product of exponents of powers of powers.
const LARGEST_DEGREE: i32 = 64;

/// Parses `text`, which stands in the file at `outer`. Its characters start at byte `inner`, if that is known.
///
/// A fault goes to the log and gives `None`.
pub(crate) fn parse(
    text: &str,
    outer: SourceSpan,
    inner: Option<usize>,
    log: &mut DiagnosticLog,
) -> Option<FormulaAst> {
    // Very long texts are refused before anything is allocated for them.
    if text.len() > LONGEST_FORMULA {
        log.push(
            Diagnostic::error(outer, "this expression is too long")
                .label(format!("at most {LONGEST_FORMULA} characters"))
                .help("name parts of it as constants"),
        );
        return None;
    }
    let mut parser = FormulaParser {
        text,
        at: 0,
        level: NestingLevel::top(DEEPEST),
        outer,
        inner,
    };
    let parsed = parser.parse_complete();
    match parsed {
        Ok(ast) => Some(ast),
        Err(diagnostic) => {
            log.push(*diagnostic);
            None
        }
    }
}

/// The state of the parser.
struct FormulaParser<'a> {
    /// The text of the expression.
    text: &'a str,
    /// Position of the next character, in bytes.
    at: usize,
    /// The level of the sum that is open now.
    level: NestingLevel,
    /// The place of the complete expression in the file.
    outer: SourceSpan,
    /// Byte in the file at which the text starts, if it stands there without escapes.
    inner: Option<usize>,
}

/// A result of the parser; the error is boxed because it is large.
type ParseResult<T> = Result<T, Box<Diagnostic>>;

impl FormulaParser<'_> {
    /// Parses the complete text; characters behind the expression are an error.
    fn parse_complete(&mut self) -> ParseResult<FormulaAst> {
        // An empty text has no first character that could be marked.
        self.skip_blanks();
        if self.at == self.text.len() {
            return Err(Box::new(
                Diagnostic::error(self.outer, "this expression is empty")
                    .label("expected a number, a name or a formula")
                    .help("write `\"0\"` for zero"),
            ));
        }
        // The degree is needed only inside of the parser.
        let (ast, _) = self.sum()?;
        self.skip_blanks();
        if let Some(found) = self.peek() {
            return Err(self.unexpected_character(found));
        }
        Ok(ast)
    }

    /// Parses terms joined by `+` and `-`.
    ///
    /// Like all rules, it returns the tree and its degree: the largest product of nested exponents in it.
    fn sum(&mut self) -> ParseResult<(FormulaAst, i32)> {
        // Each level of parentheses enters one sum, so depth is counted here.
        self.enter_level()?;
        let start = self.at;
        let (first, mut degree) = self.product()?;
        let mut terms = vec![first];
        // Terms until something else than a sign follows.
        loop {
            self.skip_blanks();
            let sign = self.peek();
            if !matches!(sign, Some('+' | '-')) {
                break;
            }
            let sign_at = self.at;
            self.at += 1;
            // The degree of a sum is the largest one of its terms.
            let (term, term_degree) = self.product()?;
            degree = degree.max(term_degree);
            terms.push(if sign == Some('-') {
                negative(term, self.span(sign_at, self.at))
            } else {
                term
            });
        }
        self.level = self.level.leave();
        // A single term is returned without a sum around it.
        let ast = match <[FormulaAst; 1]>::try_from(terms) {
            Ok([only]) => only,
            Err(terms) => FormulaAst {
                span: self.span(start, self.at),
                kind: FormulaAstKind::Sum(terms),
            },
        };
        Ok((ast, degree))
    }

    /// Parses signs, then factors joined by `*` and `/`.
    fn product(&mut self) -> ParseResult<(FormulaAst, i32)> {
        self.skip_blanks();
        let start = self.at;
        let mut minus = false;
        // Up to two signs before a factor are accepted, in addition to the sign of a term.
        let mut signs = 0;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            signs += 1;
            if signs > 2 {
                return Err(self.unexpected_character(sign));
            }
            minus ^= sign == '-';
            self.at += 1;
            self.skip_blanks();
        }
        // The first factor; all further ones follow an operator.
        let (first, mut degree) = self.power()?;
        // `a/b*c/d` is collected into one numerator and one denominator.
        let mut above = vec![first];
        let mut below = Vec::new();
        loop {
            self.skip_blanks();
            let operator = self.peek();
            if !matches!(operator, Some('*' | '/')) {
                break;
            }
            self.at += 1;
            // `**` is the power of other languages, so it gets a message of its own.
            if operator == Some('*') && self.peek() == Some('*') {
                let span = self.span(self.at - 1, self.at + 1);
                return Err(Box::new(
                    Diagnostic::error(span, "`**` is not an operator here").label("powers are written `^`"),
                ));
            }
            let (factor, factor_degree) = self.power()?;
            degree = degree.max(factor_degree);
            // Factors and divisors are collected separately.
            if operator == Some('*') {
                above.push(factor);
            } else {
                below.push(factor);
            }
        }
        // A single factor stands for itself, without a product around it.
        let span = self.span(start, self.at);
        let mut ast = if above.len() == 1 && below.is_empty() {
            above.swap_remove(0)
        } else {
            fraction(above, below, span)?
        };
        // The sign of the term is applied to the complete product.
        if minus {
            ast = negative(ast, span);
        }
        Ok((ast, degree))
    }

    /// Parses an atom with an optional integer exponent, such as `x^2` or `x^(-1)`.
    fn power(&mut self) -> ParseResult<(FormulaAst, i32)> {
        self.skip_blanks();
        let start = self.at;
        // The base, then an optional `^`.
        let (base, degree) = self.atom()?;
        self.skip_blanks();
        if self.peek() != Some('^') {
            return Ok((base, degree));
        }
        self.at += 1;
        self.skip_blanks();
        // The exponent is an integer, optionally in parentheses and with a sign.
        let exponent_start = self.at;
        let bracket = self.peek() == Some('(');
        if bracket {
            self.at += 1;
            self.skip_blanks();
        }
        let minus = self.peek() == Some('-');
        if minus {
            self.at += 1;
            self.skip_blanks();
        }
        let digits_start = self.at;
        while self.peek().is_some_and(|found| found.is_ascii_digit()) {
            self.at += 1;
        }
        // An empty text of digits fails below.
        let digits = &self.text[digits_start..self.at];
        // A parenthesis of the exponent must be closed.
        if bracket {
            self.skip_blanks();
            if self.peek() == Some(')') {
                self.at += 1;
            } else {
                return Err(self.bad_exponent(exponent_start));
            }
        }
        // `x^2.5` and `x^2a` are reported as exponents, not as text behind an expression.
        let after = self.peek();
        if matches!(after, Some('.')) || after.is_some_and(char::is_alphabetic) {
            return Err(self.bad_exponent(exponent_start));
        }
        // Exponents are limited, because powers are expanded later.
        let exponent = match digits.parse::<i32>() {
            Ok(value) if value <= LARGEST_EXPONENT => {
                if minus {
                    -value
                } else {
                    value
                }
            }
            _ => return Err(self.bad_exponent(exponent_start)),
        };
        // Nested powers multiply their exponents; the limit keeps expanded polynomials small.
        let degree = degree.saturating_mul(exponent.abs().max(1));
        if degree > LARGEST_DEGREE {
            return Err(Box::new(
                Diagnostic::error(self.span(start, self.at), "this power of powers is too high")
                    .label(format!("exponents multiply to at most {LARGEST_DEGREE}")),
            ));
        }
        // Zero to a negative power is found here if the base is a number; other cases are found with values.
        if exponent < 0 && matches!(&base.kind, FormulaAstKind::Rational(value) if value.is_zero()) {
            return Err(Box::new(Diagnostic::error(
                self.span(start, self.at),
                "this divides by zero",
            )));
        }
        let span = self.span(start, self.at);
        Ok((
            FormulaAst {
                span,
                kind: FormulaAstKind::Power(Box::new(base), exponent),
            },
            degree,
        ))
    }

    /// Parses a number, a name, a function call or an expression in parentheses.
    fn atom(&mut self) -> ParseResult<(FormulaAst, i32)> {
        self.skip_blanks();
        // The first character decides the rule.
        let start = self.at;
        match self.peek() {
            Some('(') => {
                // The expression in parentheses gets the place of the parentheses.
                self.at += 1;
                let (mut inner, degree) = self.sum()?;
                self.close_parenthesis(start)?;
                inner.span = self.span(start, self.at);
                Ok((inner, degree))
            }
            Some(found) if found.is_ascii_digit() || found == '.' => {
                let value = self.number()?;
                let span = self.span(start, self.at);
                Ok((
                    FormulaAst {
                        span,
                        kind: FormulaAstKind::Rational(value),
                    },
                    1,
                ))
            }
            Some(found) if found.is_ascii_alphabetic() || found == '_' => self.name_or_function(),
            Some(found) => Err(self.unexpected_character(found)),
            // The text ends where an operand must follow.
            None => {
                let span = self.span(self.at.saturating_sub(1), self.at);
                Err(Box::new(
                    Diagnostic::error(span, "this expression breaks off")
                        .label("expected a number, a name or `(` after this"),
                ))
            }
        }
    }

    /// Parses a name, `pi`, or a function with its operand in parentheses.
    fn name_or_function(&mut self) -> ParseResult<(FormulaAst, i32)> {
        let start = self.at;
        // A name: a letter or `_`, then letters, digits and `_`.
        while self
            .peek()
            .is_some_and(|found| found.is_ascii_alphanumeric() || found == '_')
        {
            self.at += 1;
        }
        let name = self.text[start..self.at].to_owned();
        let span = self.span(start, self.at);
        self.skip_blanks();
        // Without a parenthesis it is a name, or a function without its operand.
        if self.peek() != Some('(') {
            if FUNCTIONS.iter().any(|(function, _)| *function == name) {
                return Err(Box::new(
                    Diagnostic::error(span, format!("the function `{name}` has no operand"))
                        .label(format!("expected `{name}(...)`")),
                ));
            }
            let kind = if name == "pi" {
                FormulaAstKind::Pi
            } else {
                FormulaAstKind::Name(name)
            };
            return Ok((FormulaAst { span, kind }, 1));
        }
        // A name before a parenthesis must be a function.
        let known = FUNCTIONS.iter().map(|(function, _)| *function);
        let Some(&(_, function)) = FUNCTIONS.iter().find(|(function, _)| *function == name) else {
            let diagnostic = Diagnostic::error(span, format!("`{}` is not a function", quote(&name)))
                .label("expected an operator, such as `*`, before `(`, or a function");
            return Err(Box::new(diagnostic.help(suggest::advice(&name, "functions", known))));
        };
        // The operand is a complete expression.
        let open = self.at;
        self.at += 1;
        let (inner, degree) = self.sum()?;
        self.close_parenthesis(open)?;
        let span = self.span(start, self.at);
        Ok((
            FormulaAst {
                span,
                kind: FormulaAstKind::Apply(function, Box::new(inner)),
            },
            degree,
        ))
    }

    /// Parses a decimal as an exact rational, such as `0.316` or `2.5e-3`.
    fn number(&mut self) -> ParseResult<BigRational> {
        let start = self.at;
        let mut digits = String::new();
        // The digits are read as one integer; the decimals and the exponent give a power of ten.
        let mut n_decimals = 0_i32;
        let mut point = false;
        while let Some(found) = self.peek() {
            match found {
                '0'..='9' => {
                    digits.push(found);
                    n_decimals += i32::from(point);
                }
                '.' if !point => point = true,
                _ => break,
            }
            // Digits are limited, because exact numbers grow without bound.
            if digits.len() > MOST_DIGITS {
                return Err(Box::new(
                    Diagnostic::error(self.span(start, self.at + 1), "this number has too many digits")
                        .label(format!("at most {MOST_DIGITS} digits")),
                ));
            }
            self.at += 1;
        }
        let mut ten_power = -n_decimals;
        // An `e` counts as an exponent only if digits follow it.
        if let Some('e' | 'E') = self.peek() {
            let rest = &self.text[self.at + 1..];
            let signed = rest.trim_start_matches(['+', '-']);
            let n_signs = rest.len() - signed.len();
            let n_digits = signed.bytes().take_while(u8::is_ascii_digit).count();
            if n_digits > 0 && n_signs <= 1 {
                let exponent = rest[..n_signs + n_digits].parse::<i32>();
                self.at += 1 + n_signs + n_digits;
                // An exponent that does not fit an integer is out of range, too.
                match exponent {
                    Ok(exponent) if exponent.abs() <= 2 * LARGEST_EXPONENT => {
                        ten_power += exponent;
                    }
                    _ => {
                        return Err(Box::new(
                            Diagnostic::error(self.span(start, self.at), "the exponent of this number is out of range")
                                .label(format!("between e-{0} and e{0}", 2 * LARGEST_EXPONENT)),
                        ));
                    }
                }
            }
        }
        // A lone point has no digits.
        let Ok(value) = digits.parse::<BigInt>() else {
            return Err(Box::new(
                Diagnostic::error(self.span(start, self.at), "this is not a number").label("expected digits"),
            ));
        };
        // The exact value: an integer times or over a power of ten.
        let ten = BigInt::from(10);
        Ok(if ten_power >= 0 {
            BigRational::from_integer(value * Pow::pow(ten, ten_power.unsigned_abs()))
        } else {
            BigRational::new(value, Pow::pow(ten, ten_power.unsigned_abs()))
        })
    }

    /// Expects `)`; `open` is the position of the parenthesis that it closes.
    fn close_parenthesis(&mut self, open: usize) -> ParseResult<()> {
        self.skip_blanks();
        if self.peek() == Some(')') {
            self.at += 1;
            return Ok(());
        }
        // Another character stands where the parenthesis should be closed.
        if let Some(found) = self.peek() {
            return Err(self.unexpected_character(found));
        }
        // The text ends; the mark is on the opening parenthesis.
        Err(Box::new(
            Diagnostic::error(self.span(open, open + 1), "this parenthesis is never closed")
                .label("expected a `)` further on"),
        ))
    }

    /// Counts a level of nesting and fails if there are too many.
    fn enter_level(&mut self) -> ParseResult<()> {
        self.level = self.level.enter().map_err(|_| {
            Diagnostic::error(
                self.span(self.at.saturating_sub(1), self.at),
                "this expression is nested too deeply",
            )
            .label(format!("at most {DEEPEST} levels of parentheses"))
            .help("name parts of it as constants")
        })?;
        Ok(())
    }

    /// The fault of a character that cannot stand at the current position.
    fn unexpected_character(&self, found: char) -> Box<Diagnostic> {
        let span = self.span(self.at, self.at + found.len_utf8());
        let shown = found.escape_debug();
        let diagnostic = Diagnostic::error(span, format!("unexpected `{shown}` in an expression"));
        // Frequent mistakes get their own message.
        Box::new(match found {
            ')' => diagnostic.label("no parenthesis is open here, or its content is missing"),
            '=' | '<' | '>' => diagnostic.label("expressions have no comparisons"),
            '\u{2212}' => diagnostic
                .label("this is a typographic minus")
                .help("write the plain `-`"),
            '\u{b7}' | '\u{d7}' => diagnostic
                .label("this is a typographic product sign")
                .help("write the plain `*`"),
            ',' => diagnostic
                .label("a comma cannot stand here: decimals have a point, functions have one operand")
                .help("write decimals with a point (`0.5`), one expression per entry: `[\"ax\", \"-ay\"]`"),
            _ if found.is_alphanumeric() || found == '(' => {
                diagnostic.label("expected an operator: `+ - * / ^`").help_if(
                    self.spaced_name()
                        .map(|(text, name)| format!("names have no blanks: if `{text}` is one name, call it `{name}`")),
                )
            }
            _ => diagnostic.label("expected a number, a name or a parenthesis"),
        })
    }

    /// Two words with a blank between them around the current position, and the name that they could be: `my mass` and
    /// `my_mass`.
    fn spaced_name(&self) -> Option<(String, String)> {
        let is_letter = |found: char| found.is_ascii_alphanumeric() || found == '_';
        let before = self.text[..self.at].trim_end();
        let first = before.rsplit(|found| !is_letter(found)).next()?;
        let second = self.text[self.at..].split(|found| !is_letter(found)).next()?;
        let both = [first, second];
        let is_word = |word: &&str| word.starts_with(|found: char| found.is_ascii_alphabetic());
        both.iter().all(is_word).then(|| (both.join(" "), both.join("_")))
    }

    /// The fault of an exponent that starts at `start`; the mark extends to the end of the word.
    fn bad_exponent(&self, start: usize) -> Box<Diagnostic> {
        // Extend the mark over letters, digits and points.
        let mut end = self.at;
        while self
            .text
            .get(end..)
            .and_then(|rest| rest.chars().next())
            .is_some_and(|found| found.is_alphanumeric() || found == '.')
        {
            end += self.text[end..].chars().next().map_or(1, char::len_utf8);
        }
        Box::new(
            Diagnostic::error(self.span(start, end.max(start + 1)), "this exponent is not allowed")
                .label(format!(
                    "expected an integer between -{LARGEST_EXPONENT} and {LARGEST_EXPONENT}"
                ))
                .help("write `sqrt(x)` for a square root"),
        )
    }

    /// The next character, or `None` at the end.
    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    /// Skips blanks, tabs and line ends.
    fn skip_blanks(&mut self) {
        while let Some(' ' | '\t' | '\n' | '\r') = self.peek() {
            self.at += 1;
        }
    }

    /// The place in the file of the bytes from `start` to `end` of the text.
    fn span(&self, start: usize, end: usize) -> SourceSpan {
        // Without known positions the complete value is marked.
        match self.inner {
            Some(inner) => SourceSpan {
                file: self.outer.file,
                start: (inner + start).min(self.outer.end),
                end: (inner + end).min(self.outer.end),
            },
            None => self.outer,
        }
    }
}

/// The negative of an expression; a number changes its sign instead.
fn negative(ast: FormulaAst, span: SourceSpan) -> FormulaAst {
    let kind = match ast.kind {
        FormulaAstKind::Rational(value) => FormulaAstKind::Rational(-value),
        kind => FormulaAstKind::Negative(Box::new(FormulaAst { span: ast.span, kind })),
    };
    FormulaAst { span, kind }
}

/// Makes `a*c/(b*d)` of the chain `a/b*c/d` and collects its numbers into one, so that the tree is not deep.
fn fraction(above: Vec<FormulaAst>, below: Vec<FormulaAst>, span: SourceSpan) -> ParseResult<FormulaAst> {
    let mut number = BigRational::one();
    let mut numerator = Vec::new();
    let mut denominator = Vec::new();
    // Numeric factors are multiplied exactly; the others keep their order.
    for factor in above {
        match factor.kind {
            FormulaAstKind::Rational(value) => number *= value,
            _ => numerator.push(factor),
        }
    }
    // Division by the number zero is found here, by other expressions when values are known.
    for factor in below {
        match factor.kind {
            FormulaAstKind::Rational(value) if value.is_zero() => {
                return Err(Box::new(
                    Diagnostic::error(factor.span, "this divides by zero").label("must not be zero"),
                ));
            }
            FormulaAstKind::Rational(value) => number /= value,
            _ => denominator.push(factor),
        }
    }
    // A numeric factor of one is dropped, unless nothing else is above.
    if !number.is_one() || numerator.is_empty() {
        numerator.insert(
            0,
            FormulaAst {
                span,
                kind: FormulaAstKind::Rational(number),
            },
        );
    }
    let numerator = product(numerator, span);
    if denominator.is_empty() {
        return Ok(numerator);
    }
    let denominator = product(denominator, span);
    Ok(FormulaAst {
        span,
        kind: FormulaAstKind::Quotient(Box::new(numerator), Box::new(denominator)),
    })
}

/// A product of factors; a single factor stands for itself.
fn product(mut factors: Vec<FormulaAst>, span: SourceSpan) -> FormulaAst {
    if factors.len() == 1 {
        return factors.swap_remove(0);
    }
    FormulaAst {
        span,
        kind: FormulaAstKind::Product(factors),
    }
}
