//! Degrees of a rational function of one variable, from its values.

use crate::field::Element;

/// Degrees of numerator and denominator of the rational function of least degree through the points, if the points
/// confirm it: at least two more than it has coefficients. The abscissae must differ.
pub fn degrees(x: &[Element], y: &[Element]) -> Option<(usize, usize)> {
    let n = x.len();
    if y.iter().all(|v| *v == y[0]) {
        return Some((0, 0));
    }
    // Extended Euclid on the node polynomial and the interpolant (von zur Gathen and Gerhard, Modern Computer
    // Algebra, 5.8): every remainder r = t f modulo the nodes is a candidate r / t.
    let nodes = x.iter().fold(vec![Element::ONE], |p, xi| {
        multiply(&p, &[-*xi, Element::ONE])
    });
    let (mut r0, mut r1) = (nodes, interpolate(x, y));
    let (mut t0, mut t1) = (vec![], vec![Element::ONE]);
    let mut best = None;
    loop {
        trim(&mut r1);
        if r1.is_empty() {
            break;
        }
        let (numerator, denominator) = (r1.len() - 1, t1.len() - 1);
        if best.is_none_or(|(a, b)| numerator + denominator < a + b) {
            best = Some((numerator, denominator));
        }
        let (quotient, remainder) = divide(&r0, &r1);
        let mut next = subtract(&t0, &multiply(&quotient, &t1));
        trim(&mut next);
        (t0, t1) = (t1, next);
        (r0, r1) = (r1, remainder);
    }
    best.filter(|(a, b)| a + b + 1 + 2 <= n)
}

fn trim(p: &mut Vec<Element>) {
    while p.last() == Some(&Element::ZERO) {
        p.pop();
    }
}

fn multiply(a: &[Element], b: &[Element]) -> Vec<Element> {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let mut product = vec![Element::ZERO; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] = product[i + j] + *x * *y;
        }
    }
    product
}

fn subtract(a: &[Element], b: &[Element]) -> Vec<Element> {
    let at = |p: &[Element], i: usize| p.get(i).copied().unwrap_or(Element::ZERO);
    (0..a.len().max(b.len()))
        .map(|i| at(a, i) - at(b, i))
        .collect()
}

fn divide(a: &[Element], b: &[Element]) -> (Vec<Element>, Vec<Element>) {
    let mut rest = a.to_vec();
    trim(&mut rest);
    if rest.len() < b.len() {
        return (Vec::new(), rest);
    }
    let inverse = b[b.len() - 1]
        .inverse()
        .expect("a trimmed polynomial has a leading coefficient");
    let mut quotient = vec![Element::ZERO; rest.len() - b.len() + 1];
    for k in (0..quotient.len()).rev() {
        let factor = rest[k + b.len() - 1] * inverse;
        quotient[k] = factor;
        for (i, y) in b.iter().enumerate() {
            rest[k + i] = rest[k + i] - factor * *y;
        }
    }
    trim(&mut rest);
    (quotient, rest)
}

/// The polynomial of least degree through some points, lowest power first, by Newton's divided differences.
pub fn interpolate(x: &[Element], y: &[Element]) -> Vec<Element> {
    let n = x.len();
    let mut table = y.to_vec();
    for level in 1..n {
        for i in (level..n).rev() {
            let gap = (x[i] - x[i - level]).inverse().expect("abscissae differ");
            table[i] = (table[i] - table[i - 1]) * gap;
        }
    }
    let mut polynomial = vec![table[n - 1]];
    for i in (0..n - 1).rev() {
        polynomial = multiply(&polynomial, &[-x[i], Element::ONE]);
        polynomial[0] = polynomial[0] + table[i];
    }
    trim(&mut polynomial);
    polynomial
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Stream;

    #[test]
    fn degrees_of_a_known_function_are_found() {
        let mut stream = Stream::new(3);
        for (a, b) in [(0, 0), (1, 0), (2, 0), (0, 1), (2, 1), (3, 2), (0, 3)] {
            let mut coefficients = |n: usize| (0..=n).map(|_| stream.element()).collect::<Vec<_>>();
            let (p, q) = (coefficients(a), coefficients(b));
            let value =
                |c: &[Element], x: Element| c.iter().rev().fold(Element::ZERO, |s, k| s * x + *k);
            let x: Vec<Element> = (0..a + b + 4).map(|_| stream.element()).collect();
            let y: Vec<Element> = x
                .iter()
                .map(|x| value(&p, *x) * value(&q, *x).inverse().unwrap())
                .collect();
            assert_eq!(degrees(&x, &y), Some((a, b)));
            if a + b > 0 {
                let few = a + b + 2;
                assert_eq!(
                    degrees(&x[..few], &y[..few]),
                    None,
                    "two points must confirm"
                );
            }
        }
    }
}
