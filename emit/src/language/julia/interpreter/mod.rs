//! An interpreter of the part of Julia that the emitted modules use, for tests: the text of a module goes in, values of
//! its functions come out.
//!
//! It follows Julia where a program could go wrong: arrays begin at 1, names that a loop binds end with the loop, a
//! variable hides a function of the same name, and the root of a negative number is an error. Whatever it does not know
//! is a fault.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::needless_pass_by_value,
    reason = "an interpreter for tests: its arrays are short, Julia compares numbers exactly, and arguments are values"
)]

mod syntax;

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use syntax::{JuliaFunction, JuliaParser, JuliaStatement, JuliaTerm, tokens};

/// A value of Julia.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum JuliaValue {
    Nothing,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    Array(Rc<RefCell<Vec<JuliaValue>>>),
    /// Number of rows, and the entries column by column.
    Matrix(Rc<RefCell<(usize, Vec<JuliaValue>)>>),
    Tuple(Vec<JuliaValue>),
    /// Name of the type, empty for a named tuple, and the fields.
    Record(Rc<(String, Vec<(String, JuliaValue)>)>),
    /// First number, step and last number.
    Range(i64, i64, i64),
}

use JuliaValue as V;

impl JuliaValue {
    pub(super) fn array(values: &[f64]) -> Self {
        V::Array(Rc::new(RefCell::new(values.iter().map(|x| V::Float(*x)).collect())))
    }

    /// The numbers of an array, or of a matrix row by row.
    pub(super) fn numbers(&self) -> Vec<f64> {
        match self {
            V::Array(values) => values.borrow().iter().map(V::number).collect(),
            V::Matrix(matrix) => {
                let (n_rows, values) = &*matrix.borrow();
                let rows = (0..*n_rows).flat_map(|row| values.iter().skip(row).step_by(*n_rows));
                rows.map(V::number).collect()
            }
            other => panic!("{other:?} has no list of numbers"),
        }
    }

    pub(super) fn field(&self, name: &str) -> Self {
        let V::Record(record) = self else {
            panic!("{self:?} has no fields")
        };
        let found = record.1.iter().find(|(field, _)| field == name);
        found
            .unwrap_or_else(|| panic!("{self:?} has no field {name}"))
            .1
            .clone()
    }

    fn number(&self) -> f64 {
        match self {
            V::Float(x) => *x,
            V::Int(x) => *x as f64,
            other => panic!("{other:?} is no number"),
        }
    }
}

/// How the evaluation of an expression ends early.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum JuliaExit {
    Return(JuliaValue),
    Throw(JuliaValue),
}

type JuliaOutcome<T> = Result<T, JuliaExit>;

fn fault<T>(says: impl Into<String>) -> JuliaOutcome<T> {
    Err(JuliaExit::Throw(V::Text(says.into())))
}

/// A module that was read.
#[derive(Default)]
pub(super) struct JuliaProgram {
    functions: HashMap<String, JuliaFunction>,
    /// Fields of the types with their default values.
    records: HashMap<String, Vec<(String, Option<JuliaTerm>)>>,
    globals: HashMap<String, V>,
}

/// Variables by scope, the innermost one last.
type Scopes = Vec<HashMap<String, V>>;

impl JuliaProgram {
    /// Reads a file that is one module.
    pub(super) fn parse(text: &str) -> Self {
        let mut program = Self::default();
        let mut parser = JuliaParser {
            tokens: tokens(text),
            at: 0,
        };
        parser.module(&mut program);
        program
    }

    pub(super) fn constant(&self, name: &str) -> V {
        self.globals[name].clone()
    }

    /// The result of a function or a constructor.
    pub(super) fn call(&self, name: &str, values: Vec<V>) -> JuliaOutcome<V> {
        self.apply(name, values, Vec::new())
    }

    fn apply(&self, name: &str, values: Vec<V>, named: Vec<(String, V)>) -> JuliaOutcome<V> {
        if let Some(fields) = self.records.get(name) {
            let mut made = Vec::new();
            assert!(
                values.is_empty() || values.len() == fields.len(),
                "{name} of {} values",
                values.len()
            );
            for (k, (field, default)) in fields.iter().enumerate() {
                let given = values
                    .get(k)
                    .or_else(|| named.iter().find(|(n, _)| n == field).map(|(_, v)| v));
                let value = match (given, default) {
                    (Some(value), _) => value.clone(),
                    (None, Some(default)) => self.evaluate(default, &mut vec![HashMap::new()])?,
                    (None, None) => return fault(format!("{name} without {field}")),
                };
                made.push((field.clone(), value));
            }
            return Ok(V::Record(Rc::new((name.to_owned(), made))));
        }
        let Some(function) = self.functions.get(name) else {
            return built_in(name, &values);
        };
        let mut scopes: Scopes = vec![HashMap::new()];
        for (k, (parameter, default)) in function.parameters.iter().enumerate() {
            let value = match (values.get(k), default) {
                (Some(value), _) => value.clone(),
                (None, Some(default)) => self.evaluate(default, &mut vec![HashMap::new()])?,
                (None, None) => return fault(format!("{name} without {parameter}")),
            };
            scopes[0].insert(parameter.clone(), value);
        }
        assert!(
            values.len() <= function.parameters.len(),
            "{name} of {} values",
            values.len()
        );
        match self.run(&function.body, &mut scopes) {
            Err(JuliaExit::Return(value)) => Ok(value),
            Err(exit) => Err(exit),
            Ok(()) => Ok(V::Nothing),
        }
    }

    fn run(&self, statements: &[JuliaStatement], scopes: &mut Scopes) -> JuliaOutcome<()> {
        for statement in statements {
            match statement {
                JuliaStatement::Evaluate(term) => _ = self.evaluate(term, scopes)?,
                JuliaStatement::Assign(targets, operator, term) => {
                    let mut value = self.evaluate(term, scopes)?;
                    if let [target] = targets.as_slice() {
                        if let Some(operator) = operator {
                            value = binary(operator, &self.evaluate(target, scopes)?, &value)?;
                        }
                        self.assign(target, value, scopes)?;
                        continue;
                    }
                    let V::Tuple(values) = value else {
                        return fault("no tuple");
                    };
                    assert_eq!(values.len(), targets.len());
                    for (target, value) in targets.iter().zip(values) {
                        self.assign(target, value, scopes)?;
                    }
                }
                JuliaStatement::If(branches) => {
                    for (condition, body) in branches {
                        let holds = condition
                            .as_ref()
                            .map_or(Ok(V::Bool(true)), |c| self.evaluate(c, scopes))?;
                        if truth(&holds)? {
                            self.run(body, scopes)?;
                            break;
                        }
                    }
                }
                JuliaStatement::For(name, over, body) => {
                    let items: Vec<V> = match self.evaluate(over, scopes)? {
                        V::Range(first, step, last) => {
                            let n = ((last - first) / step + 1).max(0);
                            let n = if (last - first) * step.signum() < 0 { 0 } else { n };
                            (0..n).map(|k| V::Int(first + k * step)).collect()
                        }
                        V::Array(values) => values.borrow().clone(),
                        // A number is a list of itself.
                        value @ (V::Float(_) | V::Int(_)) => vec![value],
                        other => return fault(format!("a loop over {other:?}")),
                    };
                    for item in items {
                        scopes.push(HashMap::from([(name.clone(), item)]));
                        let outcome = self.run(body, scopes);
                        scopes.pop();
                        outcome?;
                    }
                }
            }
        }
        Ok(())
    }

    fn assign(&self, target: &JuliaTerm, value: V, scopes: &mut Scopes) -> JuliaOutcome<()> {
        match target {
            JuliaTerm::Name(name) => {
                let known = scopes.iter().rposition(|scope| scope.contains_key(name));
                let at = known.unwrap_or(scopes.len() - 1);
                scopes[at].insert(name.clone(), value);
            }
            JuliaTerm::Index(of, places) => {
                let of = self.evaluate(of, scopes)?;
                let places = self.all(places, scopes)?;
                match (&of, places.as_slice()) {
                    (V::Array(values), [V::Int(k)]) => match values.borrow_mut().get_mut((*k as usize).wrapping_sub(1))
                    {
                        Some(entry) => *entry = value,
                        None => return fault("BoundsError"),
                    },
                    (V::Matrix(matrix), [V::Int(row), V::Int(column)]) => {
                        let n_rows = matrix.borrow().0;
                        assert!((1..=n_rows as i64).contains(row), "row {row} of {n_rows}");
                        let k = (*column as usize - 1) * n_rows + *row as usize - 1;
                        matrix.borrow_mut().1[k] = value;
                    }
                    other => return fault(format!("an entry of {other:?}")),
                }
            }
            other => return fault(format!("an assignment to {other:?}")),
        }
        Ok(())
    }

    fn all(&self, terms: &[JuliaTerm], scopes: &mut Scopes) -> JuliaOutcome<Vec<V>> {
        terms.iter().map(|term| self.evaluate(term, scopes)).collect()
    }

    fn evaluate(&self, term: &JuliaTerm, scopes: &mut Scopes) -> JuliaOutcome<V> {
        let local = |name: &str, scopes: &Scopes| scopes.iter().rev().find_map(|scope| scope.get(name).cloned());
        Ok(match term {
            JuliaTerm::Value(value) => value.clone(),
            JuliaTerm::Name(name) => match local(name, scopes).or_else(|| self.globals.get(name).cloned()) {
                Some(value) => value,
                None => return fault(format!("UndefVarError: {name}")),
            },
            JuliaTerm::Unary("!", a) => V::Bool(!truth(&self.evaluate(a, scopes)?)?),
            JuliaTerm::Unary(_, a) => match self.evaluate(a, scopes)? {
                V::Int(x) => V::Int(-x),
                value => V::Float(-value.number()),
            },
            JuliaTerm::Binary("||", a, b) => match self.evaluate(a, scopes)? {
                V::Bool(false) => self.evaluate(b, scopes)?,
                holds => V::Bool(truth(&holds)?),
            },
            JuliaTerm::Binary("&&", a, b) => match self.evaluate(a, scopes)? {
                V::Bool(true) => self.evaluate(b, scopes)?,
                holds => V::Bool(truth(&holds)?),
            },
            JuliaTerm::Binary(operator, a, b) => {
                binary(operator, &self.evaluate(a, scopes)?, &self.evaluate(b, scopes)?)?
            }
            JuliaTerm::Choice(parts) => {
                let holds = truth(&self.evaluate(&parts[0], scopes)?)?;
                self.evaluate(&parts[if holds { 1 } else { 2 }], scopes)?
            }
            JuliaTerm::Range(first, step, last) => {
                let step = step
                    .as_ref()
                    .map_or(Ok(V::Int(1)), |step| self.evaluate(step, scopes))?;
                match (self.evaluate(first, scopes)?, step, self.evaluate(last, scopes)?) {
                    (V::Int(first), V::Int(step), V::Int(last)) => V::Range(first, step, last),
                    other => return fault(format!("a range of {other:?}")),
                }
            }
            JuliaTerm::Call(name, values, named) => {
                // A variable hides a function.
                if local(name, scopes).is_some() {
                    return fault(format!("{name} is a variable"));
                }
                let values = self.all(values, scopes)?;
                let mut by_name = Vec::new();
                for (name, term) in named {
                    by_name.push((name.clone(), self.evaluate(term, scopes)?));
                }
                self.apply(name, values, by_name)?
            }
            JuliaTerm::Index(of, places) => {
                let of = self.evaluate(of, scopes)?;
                let places = self.all(places, scopes)?;
                match (&of, places.as_slice()) {
                    (V::Array(values), [V::Int(k)]) => match values.borrow().get((*k as usize).wrapping_sub(1)) {
                        Some(value) => value.clone(),
                        None => return fault("BoundsError"),
                    },
                    (V::Array(values), [V::Range(first, 1, last)]) => {
                        let part = values.borrow()[*first as usize - 1..*last as usize].to_vec();
                        V::Array(Rc::new(RefCell::new(part)))
                    }
                    (V::Matrix(matrix), [V::Int(row), V::Int(column)]) => {
                        let (n_rows, values) = &*matrix.borrow();
                        assert!((1..=*n_rows as i64).contains(row), "row {row} of {n_rows}");
                        values[(*column as usize - 1) * n_rows + *row as usize - 1].clone()
                    }
                    other => return fault(format!("an entry of {other:?}")),
                }
            }
            JuliaTerm::Field(of, name) => match self.evaluate(of, scopes)? {
                V::Record(record) => match record.1.iter().find(|(field, _)| field == name) {
                    Some((_, value)) => value.clone(),
                    None => return fault(format!("no field {name}")),
                },
                other => return fault(format!("a field of {other:?}")),
            },
            JuliaTerm::List(terms) => V::Array(Rc::new(RefCell::new(self.all(terms, scopes)?))),
            JuliaTerm::Tuple(terms) => V::Tuple(self.all(terms, scopes)?),
            JuliaTerm::Named(fields) => {
                let mut values = Vec::new();
                for (name, term) in fields {
                    values.push((name.clone(), self.evaluate(term, scopes)?));
                }
                V::Record(Rc::new((String::new(), values)))
            }
            JuliaTerm::Return(value) => return Err(JuliaExit::Return(self.evaluate(value, scopes)?)),
        })
    }
}

fn truth(value: &V) -> JuliaOutcome<bool> {
    match value {
        V::Bool(holds) => Ok(*holds),
        other => fault(format!("{other:?} is no condition")),
    }
}

fn binary(operator: &str, a: &V, b: &V) -> JuliaOutcome<V> {
    Ok(match (operator, a, b) {
        ("===", a, b) => V::Bool(a == b),
        ("!==", a, b) => V::Bool(a != b),
        ("+", V::Int(a), V::Int(b)) => V::Int(a + b),
        ("-", V::Int(a), V::Int(b)) => V::Int(a - b),
        ("*", V::Int(a), V::Int(b)) => V::Int(a * b),
        (_, V::Int(_) | V::Float(_), V::Int(_) | V::Float(_)) => {
            let (a, b) = (a.number(), b.number());
            match operator {
                "+" => V::Float(a + b),
                "-" => V::Float(a - b),
                "*" => V::Float(a * b),
                "/" => V::Float(a / b),
                "==" => V::Bool(a == b),
                "!=" => V::Bool(a != b),
                "<" => V::Bool(a < b),
                "<=" => V::Bool(a <= b),
                ">" => V::Bool(a > b),
                ">=" => V::Bool(a >= b),
                other => return fault(format!("unknown operator {other}")),
            }
        }
        other => return fault(format!("no operation {other:?}")),
    })
}

/// Functions of Julia's own library.
fn built_in(name: &str, values: &[V]) -> JuliaOutcome<V> {
    let array = |values| V::Array(Rc::new(RefCell::new(values)));
    Ok(match (name, values) {
        ("sqrt", [x]) if x.number() < 0.0 => return fault("DomainError"),
        ("sqrt", [x]) => V::Float(x.number().sqrt()),
        ("abs", [x]) => V::Float(x.number().abs()),
        ("sign", [x]) if x.number() == 0.0 || x.number().is_nan() => x.clone(),
        ("sign", [x]) => V::Float(x.number().signum()),
        ("tanh", [x]) => V::Float(x.number().tanh()),
        ("exp", [x]) => V::Float(x.number().exp()),
        ("sin", [x]) => V::Float(x.number().sin()),
        ("cos", [x]) => V::Float(x.number().cos()),
        ("sincos", [x]) => V::Tuple(vec![V::Float(x.number().sin()), V::Float(x.number().cos())]),
        ("atan", [y, x]) => V::Float(y.number().atan2(x.number())),
        ("min", [a, b]) => V::Float(a.number().min(b.number())),
        ("isfinite", [x]) => V::Bool(x.number().is_finite()),
        ("eps", []) => V::Float(f64::EPSILON),
        ("zeros", [V::Int(n)]) => array(vec![V::Float(0.0); *n as usize]),
        ("length", [V::Array(values)]) => V::Int(values.borrow().len() as i64),
        ("copy", [V::Array(values)]) => array(values.borrow().clone()),
        ("vcat", arrays) => {
            let mut all = Vec::new();
            for part in arrays {
                let V::Array(part) = part else {
                    return fault(format!("vcat of {part:?}"));
                };
                all.extend(part.borrow().iter().cloned());
            }
            array(all)
        }
        ("reshape", [V::Array(values), V::Int(n_rows), V::Int(n_columns)]) => {
            let values = values.borrow().clone();
            if values.len() as i64 != n_rows * n_columns {
                return fault("DimensionMismatch");
            }
            V::Matrix(Rc::new(RefCell::new((*n_rows as usize, values))))
        }
        ("permutedims", [matrix @ V::Matrix(inner)]) => {
            let n_rows = inner.borrow().1.len() / inner.borrow().0.max(1);
            let values = matrix.numbers().into_iter().map(V::Float).collect();
            V::Matrix(Rc::new(RefCell::new((n_rows, values))))
        }
        ("throw", [value]) => return Err(JuliaExit::Throw(value.clone())),
        ("DimensionMismatch", [V::Text(says)]) => V::Text(format!("DimensionMismatch: {says}")),
        (name, values) => return fault(format!("UndefVarError: {name} of {values:?}")),
    })
}
