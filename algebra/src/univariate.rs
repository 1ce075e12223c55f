//! Polynomials and rational functions of one variable, from their values at points of the prime field.

use crate::field::FieldElement;

/// Degrees of numerator and denominator of the rational function of least degree through the points, if the points
/// confirm it: at least two more than it has coefficients. The abscissae must differ.
pub fn interpolant_degrees(x: &[FieldElement], y: &[FieldElement]) -> Option<(usize, usize)> {
    // A constant function has degree zero in both polynomials.
    let n = x.len();
    if y.iter().all(|v| *v == y[0]) {
        return Some((0, 0));
    }
    // Extended Euclid on the node polynomial and the interpolant (von zur Gathen and Gerhard, Modern Computer
    // Algebra, 5.8): every remainder r = t f modulo the nodes is a candidate r / t.
    let nodes = x.iter().fold(vec![FieldElement::ONE], |p, xi| {
        multiply(&p, &[-*xi, FieldElement::ONE])
    });
    let (mut r0, mut r1) = (nodes, interpolate(x, y));
    let (mut t0, mut t1) = (vec![], vec![FieldElement::ONE]);
    // The candidate with the least sum of degrees so far.
    let mut best = None;
    loop {
        trim(&mut r1);
        if r1.is_empty() {
            break;
        }
        // The candidate with the least sum of degrees is the function, if it exists.
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

/// Removes leading coefficients that are zero.
fn trim(p: &mut Vec<FieldElement>) {
    // The last coefficient is that of the highest power.
    while p.last() == Some(&FieldElement::ZERO) {
        p.pop();
    }
}

/// The product of two polynomials, lowest power first.
fn multiply(a: &[FieldElement], b: &[FieldElement]) -> Vec<FieldElement> {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let mut product = vec![FieldElement::ZERO; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] = product[i + j] + *x * *y;
        }
    }
    product
}

/// The difference of two polynomials.
fn subtract(a: &[FieldElement], b: &[FieldElement]) -> Vec<FieldElement> {
    let at = |p: &[FieldElement], i: usize| p.get(i).copied().unwrap_or(FieldElement::ZERO);
    (0..a.len().max(b.len())).map(|i| at(a, i) - at(b, i)).collect()
}

/// Quotient and remainder; the divisor must be trimmed and not zero.
fn divide(a: &[FieldElement], b: &[FieldElement]) -> (Vec<FieldElement>, Vec<FieldElement>) {
    // A dividend of lower degree is the remainder.
    let mut rest = a.to_vec();
    trim(&mut rest);
    if rest.len() < b.len() {
        return (Vec::new(), rest);
    }
    let inverse = b[b.len() - 1]
        .inverse()
        .expect("a trimmed polynomial has a leading coefficient");
    let mut quotient = vec![FieldElement::ZERO; rest.len() - b.len() + 1];
    // From the highest power down.
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

/// The polynomial of least degree through some points, lowest power first, by Newton's divided differences. The
/// abscissae must differ.
pub fn interpolate(x: &[FieldElement], y: &[FieldElement]) -> Vec<FieldElement> {
    let n = x.len();
    // Divided differences, in place.
    let mut table = y.to_vec();
    for level in 1..n {
        for i in (level..n).rev() {
            let gap = (x[i] - x[i - level]).inverse().expect("abscissae differ");
            table[i] = (table[i] - table[i - 1]) * gap;
        }
    }
    // Newton's form is multiplied out from the highest difference.
    let mut polynomial = vec![table[n - 1]];
    for i in (0..n - 1).rev() {
        polynomial = multiply(&polynomial, &[-x[i], FieldElement::ONE]);
        polynomial[0] = polynomial[0] + table[i];
    }
    trim(&mut polynomial);
    polynomial
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::RandomStream;

    #[test]
    fn degrees_of_a_known_function_are_found() {
        let mut stream = RandomStream::new(3);
        for (a, b) in [(0, 0), (1, 0), (2, 0), (0, 1), (2, 1), (3, 2), (0, 3)] {
            let mut coefficients = |n: usize| (0..=n).map(|_| stream.next_element()).collect::<Vec<_>>();
            let (p, q) = (coefficients(a), coefficients(b));
            let value =
                |c: &[FieldElement], x: FieldElement| c.iter().rev().fold(FieldElement::ZERO, |s, k| s * x + *k);
            let x: Vec<FieldElement> = (0..a + b + 4).map(|_| stream.next_element()).collect();
            let y: Vec<FieldElement> = x
                .iter()
                .map(|x| value(&p, *x) * value(&q, *x).inverse().unwrap())
                .collect();
            assert_eq!(interpolant_degrees(&x, &y), Some((a, b)));
            if a + b > 0 {
                let few = a + b + 2;
                assert_eq!(
                    interpolant_degrees(&x[..few], &y[..few]),
                    None,
                    "two points must confirm"
                );
            }
        }
    }
}
