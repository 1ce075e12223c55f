//! Chapter 11 of the page: the paper part by part, with the verdict and the place where it is answered.

use crate::page::ExperimentPage;

/// Part of the paper, verdict, and place of the answer.
const STATEMENTS: [[&str; 3]; 35] = [
    [
        "Section 2.1: 102 equations for 17 bodies cut free",
        "confirmed; not needed, since the derivation is recursive",
        "guide, model files",
    ],
    [
        "Section 2.2, eq. (1): equivalent lumped masses",
        "right",
        "guide, rigs: `reduce` computes with it",
    ],
    [
        "Step 1: planar reduction",
        "right; exact for motion in the plane",
        "guide, rigs: the report of `reduce`",
    ],
    [
        "Step 1: the unsymmetric end effector is negligible",
        "right, and more: it has no effect, because G4 only translates",
        "section 4",
    ],
    [
        "Step 2: substitution parts for groups that move alike",
        "right; exact",
        "guide, rigs",
    ],
    [
        "Step 2: the M structure is kinematically equivalent",
        "right",
        "section 2: the consistent model agrees with the complete robot",
    ],
    [
        "Step 2: point masses at R2m, R3m, R4m are an approximation with good results",
        "better than stated: exact",
        "section 4",
    ],
    [
        "Step 3: symmetric parts share their parameters",
        "right for the masses of Table 1",
        "guide, rigs",
    ],
    [
        "Step 4: contact points on the axes of the cranks; the small offset of the real spindles can be neglected",
        "not confirmed: 20 to 50 mm leave errors of the paper's size after identification",
        "section 4",
    ],
    [
        "Result: 3 * 4 = 12 equations, kinematically exact, dynamically well approximated",
        "right; also dynamically exact with m4 in one place",
        "section 2",
    ],
    [
        "Section 3: mass m2 is added to S1 at R2m, with S1 as its lever arm",
        "right; exact",
        "section 4",
    ],
    [
        "Section 3: m4 is partitioned to S3 and S5",
        "right in the balance of forces, not in that of moments",
        "section 3",
    ],
    [
        "Section 3, Fig. 4: modified Denavit-Hartenberg frames, passive joints",
        "reproduced",
        "the page of `equations` for spidermill-paper.toml",
    ],
    [
        "Eq. (2), (3) and Fig. 5: balances of a part cut free",
        "right, part by part; solved recursively from part to part",
        "`equations --balances crank_left` prints them with the picture of the part; `evaluate --reactions` computes the forces at the cuts",
    ],
    [
        "Eq. (4), (5): linear in eleven parameters",
        "right, term by term",
        "`equations`, products of parameters",
    ],
    [
        "Eq. (6) to (8): dependent columns are merged",
        "right; here in exact arithmetic",
        "`equations`, dependencies",
    ],
    [
        "Eq. (9): numeric rank",
        "right; printed beside the exact rank",
        "`equations`",
    ],
    [
        "A numeric reduction loses the meaning of the parameters",
        "right, and not needed",
        "guide, introduction",
    ],
    [
        "Eq. (10), (16): the minimal form has five parameters",
        "right for the printed treatment; four for a mass in one place",
        "sections 1 and 6",
    ],
    ["Eq. (11), (12): least squares", "right", "guide, identification"],
    [
        "Eq. (13): bound by the condition number",
        "right as a bound; it depends on units",
        "section 9; `excite` also prints the scaled number",
    ],
    [
        "Eq. (14), (15): trajectory within limits",
        "right; the sum starts at k = 1, since k = 0 divides by zero",
        "sections 1 and 9",
    ],
    [
        "Eq. (17): the base frequency is a variable; n_f = 7 is best",
        "the period as a variable: right; n_f = 7: neither confirmed nor refuted, since 7 and 9 differ by less than two searches",
        "section 9; `excite --period LOW:HIGH --harmonics 5,7,9`",
    ],
    [
        "Condition number 21.06",
        "reached with b = 0.2 m; limits and lengths are not printed",
        "section 9",
    ],
    [
        "Fig. 6 and 7, panels a to f",
        "same structure, other scales",
        "section 1",
    ],
    [
        "Table 2, calculated: 8 to 10 %",
        "cause reproduced; size depends on unprinted lengths",
        "sections 2, 3 and 10",
    ],
    [
        "Table 2, estimated: 3.3 to 3.6 %",
        "reproduced by contact points beside the axes, with lengths that are not printed",
        "sections 4 and 10",
    ],
    ["Cause 1: lever arms of G2, G6 and G4", "refuted", "section 4"],
    ["Cause 2: contact points", "confirmed", "section 4"],
    [
        "Improvement of 65.1 % for fe1",
        "right in kind; larger on the rig without other errors",
        "section 2",
    ],
    [
        "Peaks of the relative error where a force is close to zero",
        "confirmed",
        "section 5",
    ],
    [
        "Table 1, estimated column",
        "one of the real solutions; the other is refused",
        "section 7",
    ],
    [
        "Estimates are not the real physical parameters",
        "confirmed, with the reason",
        "section 7",
    ],
    [
        "The identified model suits model-based control",
        "supported",
        "guide, generated code: fast code and forward dynamics",
    ],
    [
        "Outlook: friction is to be considered next",
        "done: friction and other missing effects are found from data",
        "guide, diagnosis",
    ],
];

impl ExperimentPage {
    /// Chapter 11: the parts of the paper with their verdicts.
    pub(crate) fn statements(&mut self) {
        self.heading("11  The paper, part by part");
        let rows: Vec<Vec<String>> = STATEMENTS.iter().map(|row| row.map(str::to_owned).to_vec()).collect();
        self.table(&["part of the paper", "verdict", "where"], &rows);
    }
}
