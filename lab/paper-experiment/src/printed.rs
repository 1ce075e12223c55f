//! Numbers that the paper prints: Tables 1 and 2, and the condition number of its excitation; and its title.

/// Title of the paper. The copy at hand prints neither authors nor year.
pub(crate) const TITLE: &str = "Dynamic Modeling and Identification of a Complex-structured Parallel Robot";

/// Condition number of the paper's excitation.
pub(crate) const CONDITION_NUMBER: f64 = 21.06;
/// Harmonics and period (s) of the paper's excitation.
pub(crate) const EXCITATION: (usize, f64) = (7, 7.29);

/// Estimated column of Table 1, for the parameters that the paper determines; the others are known.
pub(crate) const ESTIMATED: [(&str, f64); 5] = [
    ("m2", 15.9794),
    ("m4", 5.9203),
    ("dc3", 0.833),
    ("Ic12", 4.9733),
    ("Ic32", 0.2162),
];

/// Table 2, per cent: `[calculated, estimated][left, right][identification, verification]`.
pub(crate) const TABLE_2: [[[f64; 2]; 2]; 2] = [[[9.90, 10.20], [9.08, 7.82]], [[3.33, 3.56], [3.30, 3.39]]];

/// The improvement of fe1 by identification along the test trajectory, per cent.
pub(crate) const IMPROVEMENT: f64 = 65.1;
