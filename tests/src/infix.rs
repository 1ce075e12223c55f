//! Reads printed infix formulas again, with numbers and vectors, and shares no code with the printer.

use std::collections::BTreeMap;

use nalgebra::Vector3;

/// A number or a vector.
#[derive(Clone, Copy, Debug)]
enum Quantity {
    Scalar(f64),
    Vector(Vector3<f64>),
}

/// The value of a formula without vectors.
#[track_caller]
pub fn scalar(text: &str, names: &BTreeMap<String, f64>) -> f64 {
    match evaluate(text, names, &BTreeMap::new()) {
        Quantity::Scalar(value) => value,
        Quantity::Vector(_) => panic!("{text} is a vector"),
    }
}

/// The value of a formula that is a vector; the number 0 is the zero vector.
#[track_caller]
pub fn vector(text: &str, names: &BTreeMap<String, f64>, vectors: &BTreeMap<String, Vector3<f64>>) -> Vector3<f64> {
    match evaluate(text, names, vectors) {
        Quantity::Vector(value) => value,
        Quantity::Scalar(0.0) => Vector3::zeros(),
        Quantity::Scalar(value) => panic!("{text} is the number {value}"),
    }
}

fn evaluate(text: &str, names: &BTreeMap<String, f64>, vectors: &BTreeMap<String, Vector3<f64>>) -> Quantity {
    let mut reader = Reader {
        left: text,
        names,
        vectors,
    };
    let value = reader.sum();
    assert!(reader.left.is_empty(), "{text}: {:?} is left", reader.left);
    value
}

struct Reader<'a> {
    left: &'a str,
    names: &'a BTreeMap<String, f64>,
    vectors: &'a BTreeMap<String, Vector3<f64>>,
}

fn times(a: Quantity, b: Quantity) -> Quantity {
    match (a, b) {
        (Quantity::Scalar(a), Quantity::Scalar(b)) => Quantity::Scalar(a * b),
        (Quantity::Scalar(k), Quantity::Vector(v)) | (Quantity::Vector(v), Quantity::Scalar(k)) => {
            Quantity::Vector(k * v)
        }
        (Quantity::Vector(_), Quantity::Vector(_)) => panic!("product of two vectors"),
    }
}

fn plus(a: Quantity, b: Quantity) -> Quantity {
    match (a, b) {
        (Quantity::Scalar(a), Quantity::Scalar(b)) => Quantity::Scalar(a + b),
        (Quantity::Vector(a), Quantity::Vector(b)) => Quantity::Vector(a + b),
        _ => panic!("sum of a number and a vector"),
    }
}

impl Reader<'_> {
    fn take(&mut self, sign: &str) -> bool {
        let rest = self.left.trim_start().strip_prefix(sign);
        if let Some(rest) = rest {
            self.left = rest.trim_start();
        }
        rest.is_some()
    }

    fn sum(&mut self) -> Quantity {
        let mut value = self.product();
        loop {
            if self.take("+") {
                value = plus(value, self.product());
            } else if self.take("-") {
                value = plus(value, times(Quantity::Scalar(-1.0), self.product()));
            } else {
                return value;
            }
        }
    }

    fn product(&mut self) -> Quantity {
        if self.take("-") {
            return times(Quantity::Scalar(-1.0), self.product());
        }
        let mut value = self.power();
        loop {
            if self.take("*") {
                value = times(value, self.power());
            } else if self.take("/") {
                let Quantity::Scalar(below) = self.power() else {
                    panic!("division by a vector")
                };
                value = times(value, Quantity::Scalar(below.recip()));
            } else {
                return value;
            }
        }
    }

    fn power(&mut self) -> Quantity {
        let value = self.factor();
        if !self.take("^") {
            return value;
        }
        let (Quantity::Scalar(value), Quantity::Scalar(exponent)) = (value, self.factor()) else {
            panic!("power of a vector")
        };
        Quantity::Scalar(value.powf(exponent))
    }

    fn word(&mut self, belongs: impl Fn(char) -> bool) -> String {
        let end = self.left.find(|c| !belongs(c)).unwrap_or(self.left.len());
        let (word, rest) = self.left.split_at(end);
        self.left = rest;
        word.to_owned()
    }

    fn factor(&mut self) -> Quantity {
        if self.take("(") {
            let value = self.sum();
            assert!(self.take(")"), "a parenthesis is open before {:?}", self.left);
            return value;
        }
        if self.left.starts_with(|c: char| c.is_ascii_digit()) {
            let number = self.word(|c| c.is_ascii_digit() || c == '.');
            return Quantity::Scalar(number.parse().expect("a number"));
        }
        let name = self.word(|c| c.is_alphanumeric() || c == '_');
        if !self.take("(") {
            let known = self.vectors.get(&name).map(|v| Quantity::Vector(*v));
            let known = known.or_else(|| self.names.get(&name).map(|x| Quantity::Scalar(*x)));
            return known.unwrap_or_else(|| panic!("{name:?} has no value before {:?}", self.left));
        }
        let mut operands = vec![self.sum()];
        while self.take(",") {
            operands.push(self.sum());
        }
        assert!(self.take(")"), "{name} is open before {:?}", self.left);
        apply(&name, &operands)
    }
}

fn apply(name: &str, operands: &[Quantity]) -> Quantity {
    match (name, operands) {
        ("cross", [Quantity::Vector(a), Quantity::Vector(b)]) => Quantity::Vector(a.cross(b)),
        ("cross", _) => Quantity::Vector(Vector3::zeros()),
        ("atan2", [Quantity::Scalar(y), Quantity::Scalar(x)]) => Quantity::Scalar(y.atan2(*x)),
        (_, [Quantity::Scalar(x)]) => Quantity::Scalar(match name {
            "sin" => x.sin(),
            "cos" => x.cos(),
            "sqrt" => x.sqrt(),
            "abs" => x.abs(),
            "tanh" => x.tanh(),
            "exp" => x.exp(),
            "sign" if *x == 0.0 => 0.0,
            "sign" => x.signum(),
            _ => panic!("unknown function {name}"),
        }),
        _ => panic!("{name} of {} operands", operands.len()),
    }
}
