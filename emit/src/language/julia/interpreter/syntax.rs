//! The syntax of the part of Julia that the emitted modules use: a text goes in, terms, statements and functions come out.

use std::collections::HashMap;

use super::{JuliaProgram, JuliaValue as V};

#[derive(Clone, Debug, PartialEq)]
pub(super) enum JuliaToken {
    Number(V),
    Text(String),
    Name(String),
    Mark(&'static str),
    Line,
    End,
}

/// Operators and brackets, longer ones first.
const MARKS: [&str; 38] = [
    "===", "!==", "==", "!=", "<=", ">=", "<:", "&&", "||", "+=", "-=", "*=", "/=", "::", "(", ")", "[", "]", "{", "}",
    ",", ";", "=", "<", ">", "+", "-", "*", "/", ":", "?", "!", ".", "@", "%", "^", "|", "&",
];

pub(super) fn tokens(text: &str) -> Vec<JuliaToken> {
    let mut found = Vec::new();
    let mut open = 0;
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let len = |test: fn(char) -> bool| rest.find(|c| !test(c)).unwrap_or(rest.len());
        let mut n = c.len_utf8();
        if c == '#' {
            n = rest.find('\n').unwrap_or(rest.len());
        } else if c == '\n' {
            if open == 0 {
                found.push(JuliaToken::Line);
            }
        } else if c == '"' {
            let quote = if rest.starts_with("\"\"\"") { "\"\"\"" } else { "\"" };
            let mut at = quote.len();
            while !rest[at..].starts_with(quote) {
                at += if rest[at..].starts_with('\\') {
                    2
                } else {
                    rest[at..].chars().next().map_or(1, char::len_utf8)
                };
            }
            let inner = &rest[quote.len()..at];
            assert!(!inner.replace("\\$", "").contains('$'), "an interpolation: {inner}");
            found.push(JuliaToken::Text(inner.to_owned()));
            n = at + quote.len();
        } else if c.is_ascii_digit() {
            n = len(|c| c.is_ascii_digit());
            let is_dot = rest[n..].starts_with('.') && rest[n + 1..].starts_with(|c: char| c.is_ascii_digit());
            let mut is_float = is_dot;
            if is_dot {
                n += 1 + rest[n + 1..]
                    .find(|c: char| !c.is_ascii_digit())
                    .unwrap_or(rest.len() - n - 1);
            }
            if rest[n..].starts_with('e') {
                is_float = true;
                let from = n + 1 + usize::from(rest[n + 1..].starts_with('-'));
                n = from
                    + rest[from..]
                        .find(|c: char| !c.is_ascii_digit())
                        .unwrap_or(rest.len() - from);
            }
            let number = &rest[..n];
            found.push(JuliaToken::Number(if is_float {
                V::Float(number.parse().expect("a number"))
            } else {
                V::Int(number.parse().expect("an integer"))
            }));
            // `2x` is a product in Julia, which no module should contain by accident.
            assert!(
                !rest[n..].starts_with(|c: char| c.is_alphabetic() || c == '('),
                "{number} and a factor"
            );
        } else if c.is_alphabetic() || c == '_' {
            n = len(|c| c.is_alphanumeric() || c == '_');
            // Names of functions that change their arguments end with an exclamation mark.
            n += usize::from(rest[n..].starts_with("!("));
            found.push(JuliaToken::Name(rest[..n].to_owned()));
        } else if !c.is_whitespace() {
            let mark = MARKS.iter().find(|mark| rest.starts_with(**mark));
            let mark = mark.unwrap_or_else(|| panic!("unknown character {c:?}"));
            match *mark {
                "(" | "[" | "{" => open += 1,
                ")" | "]" | "}" => open -= 1,
                _ => {}
            }
            found.push(JuliaToken::Mark(mark));
            n = mark.len();
        }
        rest = &rest[n..];
    }
    found.push(JuliaToken::End);
    found
}

#[derive(Clone, Debug)]
pub(super) enum JuliaTerm {
    Value(V),
    Name(String),
    Unary(&'static str, Box<JuliaTerm>),
    Binary(&'static str, Box<JuliaTerm>, Box<JuliaTerm>),
    Choice(Box<[JuliaTerm; 3]>),
    Range(Box<JuliaTerm>, Option<Box<JuliaTerm>>, Box<JuliaTerm>),
    Call(String, Vec<JuliaTerm>, Vec<(String, JuliaTerm)>),
    Index(Box<JuliaTerm>, Vec<JuliaTerm>),
    Field(Box<JuliaTerm>, String),
    List(Vec<JuliaTerm>),
    Tuple(Vec<JuliaTerm>),
    Named(Vec<(String, JuliaTerm)>),
    Return(Box<JuliaTerm>),
}

#[derive(Clone, Debug)]
pub(super) enum JuliaStatement {
    Evaluate(JuliaTerm),
    /// Targets, the operator before the equals sign, and the value.
    Assign(Vec<JuliaTerm>, Option<&'static str>, JuliaTerm),
    If(Vec<(Option<JuliaTerm>, Vec<JuliaStatement>)>),
    For(String, JuliaTerm, Vec<JuliaStatement>),
}

#[derive(Clone, Debug)]
pub(super) struct JuliaFunction {
    pub(super) parameters: Vec<(String, Option<JuliaTerm>)>,
    pub(super) body: Vec<JuliaStatement>,
}

pub(super) struct JuliaParser {
    pub(super) tokens: Vec<JuliaToken>,
    pub(super) at: usize,
}

impl JuliaParser {
    fn peek(&self) -> &JuliaToken {
        &self.tokens[self.at]
    }

    fn take_next(&mut self) -> JuliaToken {
        self.at += 1;
        self.tokens[self.at - 1].clone()
    }

    fn takes(&mut self, mark: &str) -> bool {
        let is_next = matches!(self.peek(), JuliaToken::Mark(m) if *m == mark);
        self.at += usize::from(is_next);
        is_next
    }

    fn expect(&mut self, mark: &str) {
        assert!(
            self.takes(mark),
            "{mark} expected, found {:?} {:?}",
            self.peek(),
            &self.tokens[self.at..self.at + 6]
        );
    }

    fn takes_word(&mut self, word: &str) -> bool {
        let is_next = matches!(self.peek(), JuliaToken::Name(name) if name == word);
        self.at += usize::from(is_next);
        is_next
    }

    fn name(&mut self) -> String {
        match self.take_next() {
            JuliaToken::Name(name) => name,
            other => panic!("a name expected, found {other:?}"),
        }
    }

    fn lines(&mut self) {
        while matches!(self.peek(), JuliaToken::Line) || self.takes(";") {
            self.at += usize::from(matches!(self.peek(), JuliaToken::Line));
        }
    }

    /// Skips `::Type{...}` and `<: Type`.
    fn skip_type(&mut self) {
        while self.takes("::") || self.takes("<:") {
            self.name();
            self.skip_braces();
        }
    }

    fn skip_braces(&mut self) {
        if self.takes("{") {
            while !self.takes("}") {
                self.take_next();
            }
        }
    }

    pub(super) fn module(&mut self, program: &mut JuliaProgram) {
        self.lines();
        assert!(self.takes_word("module"), "no module");
        self.name();
        loop {
            self.lines();
            if self.takes_word("end") {
                break;
            } else if self.takes_word("function") {
                let mut name = self.name();
                while self.takes(".") {
                    name = format!("{name}.{}", self.name());
                }
                self.expect("(");
                let mut parameters = Vec::new();
                while !self.takes(")") {
                    let parameter = self.name();
                    self.skip_type();
                    parameters.push((parameter, self.takes("=").then(|| self.choice())));
                    self.takes(",");
                }
                let body = self.block();
                assert!(self.takes_word("end"), "a function has no end");
                let known = program
                    .functions
                    .insert(name.clone(), JuliaFunction { parameters, body });
                assert!(known.is_none(), "two functions {name}");
            } else if self.takes_word("Base") {
                self.expect(".");
                self.expect("@");
                assert_eq!(self.name(), "kwdef");
                assert!(self.takes_word("struct"));
                self.record(program);
            } else if self.takes_word("struct") {
                self.record(program);
            } else if self.takes_word("const") {
                let name = self.name();
                self.expect("=");
                let value = self.choice();
                let value = program.evaluate(&value, &mut vec![HashMap::new()]).unwrap();
                assert!(
                    program.globals.insert(name.clone(), value).is_none(),
                    "two constants {name}"
                );
            } else {
                assert!(
                    matches!(self.take_next(), JuliaToken::Text(_)),
                    "{:?} between functions",
                    self.tokens[self.at - 1]
                );
            }
        }
        self.lines();
        assert_eq!(*self.peek(), JuliaToken::End);
    }

    fn record(&mut self, program: &mut JuliaProgram) {
        let name = self.name();
        self.skip_type();
        let mut fields = Vec::new();
        loop {
            self.lines();
            if self.takes_word("end") {
                break;
            }
            let field = self.name();
            assert!(fields.iter().all(|(other, _)| *other != field), "two fields {field}");
            self.skip_type();
            fields.push((field, self.takes("=").then(|| self.choice())));
        }
        program.records.insert(name, fields);
    }

    /// Statements up to `end`, `else` or `elseif`.
    fn block(&mut self) -> Vec<JuliaStatement> {
        let mut statements = Vec::new();
        loop {
            self.lines();
            match self.peek() {
                JuliaToken::Name(word) if ["end", "else", "elseif"].contains(&word.as_str()) => return statements,
                _ => statements.push(self.statement()),
            }
            let is_end = matches!(self.peek(), JuliaToken::Line | JuliaToken::Name(_)) || self.takes(";");
            assert!(
                is_end,
                "a statement goes on with {:?}: {:?}",
                self.peek(),
                statements.last()
            );
        }
    }

    fn statement(&mut self) -> JuliaStatement {
        if self.takes_word("if") {
            let mut branches = vec![(Some(self.choice()), self.block())];
            while !self.takes_word("end") {
                let condition = self.takes_word("elseif").then(|| self.choice());
                assert!(condition.is_some() || self.takes_word("else"));
                branches.push((condition, self.block()));
            }
            return JuliaStatement::If(branches);
        }
        if self.takes_word("for") {
            let name = self.name();
            assert!(self.takes_word("in"), "a loop without in");
            let over = self.choice();
            let body = self.block();
            assert!(self.takes_word("end"));
            return JuliaStatement::For(name, over, body);
        }
        let mut targets = vec![self.choice()];
        while self.takes(",") {
            targets.push(self.choice());
        }
        for (mark, operator) in [
            ("=", None),
            ("+=", Some("+")),
            ("-=", Some("-")),
            ("*=", Some("*")),
            ("/=", Some("/")),
        ] {
            if self.takes(mark) {
                let mut values = vec![self.choice()];
                while self.takes(",") {
                    values.push(self.choice());
                }
                let value = if values.len() == 1 {
                    values.remove(0)
                } else {
                    JuliaTerm::Tuple(values)
                };
                return JuliaStatement::Assign(targets, operator, value);
            }
        }
        assert_eq!(targets.len(), 1, "a list without an assignment");
        JuliaStatement::Evaluate(targets.remove(0))
    }

    /// `a ? b : c`, and everything that binds more strongly.
    fn choice(&mut self) -> JuliaTerm {
        let condition = self.binary(0, true);
        if !self.takes("?") {
            return condition;
        }
        let first = self.binary(0, false);
        self.expect(":");
        let second = self.choice();
        JuliaTerm::Choice(Box::new([condition, first, second]))
    }

    fn binary(&mut self, level: usize, ranges: bool) -> JuliaTerm {
        const LEVELS: [&[&str]; 5] = [
            &["||"],
            &["&&"],
            &["===", "!==", "==", "!=", "<=", ">=", "<", ">"],
            &["+", "-"],
            &["*", "/"],
        ];
        // Ranges bind less strongly than sums.
        let operand = |parser: &mut Self| match level {
            4 => parser.unary(),
            2 if ranges => parser.range(),
            _ => parser.binary(level + 1, ranges),
        };
        let mut left = operand(self);
        let mut n_compared = 0;
        while let Some(operator) = LEVELS[level]
            .iter()
            .find(|mark| matches!(self.peek(), JuliaToken::Mark(m) if m == *mark))
        {
            self.at += 1;
            n_compared += 1;
            assert!(level != 2 || n_compared == 1, "a chain of comparisons");
            let right = operand(self);
            left = JuliaTerm::Binary(operator, Box::new(left), Box::new(right));
        }
        left
    }

    fn range(&mut self) -> JuliaTerm {
        let first = self.binary(3, true);
        if !self.takes(":") {
            return first;
        }
        let second = self.binary(3, true);
        if self.takes(":") {
            let third = self.binary(3, true);
            return JuliaTerm::Range(Box::new(first), Some(Box::new(second)), Box::new(third));
        }
        JuliaTerm::Range(Box::new(first), None, Box::new(second))
    }

    fn unary(&mut self) -> JuliaTerm {
        for mark in ["-", "!"] {
            if self.takes(mark) {
                return JuliaTerm::Unary(if mark == "-" { "-" } else { "!" }, Box::new(self.unary()));
            }
        }
        self.postfix()
    }

    fn list(&mut self, end: &str) -> Vec<JuliaTerm> {
        let mut terms = Vec::new();
        while !self.takes(end) {
            terms.push(self.choice());
            assert!(
                self.takes(",") || matches!(self.peek(), JuliaToken::Mark(m) if *m == end),
                "{:?}",
                self.peek()
            );
        }
        terms
    }

    fn is_keyword(&self) -> bool {
        matches!(
            (self.peek(), self.tokens.get(self.at + 1)),
            (JuliaToken::Name(_), Some(JuliaToken::Mark("=")))
        )
    }

    fn postfix(&mut self) -> JuliaTerm {
        let mut term = match self.take_next() {
            JuliaToken::Number(value) => JuliaTerm::Value(value),
            JuliaToken::Text(text) => JuliaTerm::Value(V::Text(text)),
            JuliaToken::Name(word) => match word.as_str() {
                "true" | "false" => JuliaTerm::Value(V::Bool(word == "true")),
                "nothing" => JuliaTerm::Value(V::Nothing),
                "return" => return JuliaTerm::Return(Box::new(self.choice())),
                _ => {
                    self.skip_braces();
                    JuliaTerm::Name(word)
                }
            },
            JuliaToken::Mark("(") if self.is_keyword() => JuliaTerm::Named(self.keywords()),
            JuliaToken::Mark("(") => {
                let inner = self.choice();
                if self.takes(")") {
                    inner
                } else {
                    self.expect(",");
                    let mut terms = vec![inner];
                    terms.extend(self.list(")"));
                    JuliaTerm::Tuple(terms)
                }
            }
            JuliaToken::Mark("[") => JuliaTerm::List(self.list("]")),
            other => panic!("{other:?} begins a term"),
        };
        loop {
            if self.takes("(") {
                let JuliaTerm::Name(name) = term else {
                    panic!("a call of {term:?}")
                };
                let (mut values, mut named) = (Vec::new(), Vec::new());
                while !self.is_keyword() && !self.takes(")") {
                    values.push(self.choice());
                    assert!(
                        self.takes(",") || matches!(self.peek(), JuliaToken::Mark(")")),
                        "{:?}",
                        self.peek()
                    );
                }
                if self.is_keyword() {
                    named = self.keywords();
                }
                term = JuliaTerm::Call(name, values, named);
            } else if self.takes("[") {
                let inner = self.list("]");
                term = match term {
                    JuliaTerm::Name(name) if ["Float64", "String", "NTuple"].contains(&name.as_str()) => {
                        JuliaTerm::List(inner)
                    }
                    term => JuliaTerm::Index(Box::new(term), inner),
                };
            } else if self.takes(".") {
                term = JuliaTerm::Field(Box::new(term), self.name());
            } else {
                return term;
            }
        }
    }

    fn keywords(&mut self) -> Vec<(String, JuliaTerm)> {
        let mut named = Vec::new();
        while !self.takes(")") {
            let name = self.name();
            self.expect("=");
            named.push((name, self.choice()));
            self.takes(",");
        }
        named
    }
}
