//! Chapter 11 of the page: the paper part by part, with the verdict and the place where it is answered.

use crate::page::ExperimentPage;

/// Part of the paper, verdict, and place of the answer.
const STATEMENTS: [[&str; 3]; 54] = [
    [
        "Section 1: Newton-Euler gives a form that is linear in the parameters",
        "right",
        "`equations`, products of parameters",
    ],
    [
        "Section 1: for parallel robots the non-recursive form is more appropriate",
        "not confirmed: the recursion along a tree, with loops cut open, gives the same balances",
        "guide, benchmarks: operations and run time",
    ],
    [
        "Section 1: to halve the mass of links and put it at the joints does not suit heavy links",
        "confirmed: mass and centre stay, but the inertia of S1 becomes 2.6 times and that of S3 2.4 times that of Table 1",
        "eq. (1), with the lengths assumed here",
    ],
    [
        "Section 1: direct identification, all parameters in one step",
        "right; also used here",
        "guide, identification",
    ],
    [
        "Section 1: friction is neglected, because the multibody model has none",
        "right for that model; a robot has friction",
        "guide, diagnosis",
    ],
    [
        "Fig. 1: multibody model as the reference",
        "reproduced twice: 11 groups with the masses of Table 1, and 17 bodies",
        "section 1; guide, rigs: from CAD to a model",
    ],
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
        "Step 1, Fig. 2: groups of symmetric elements; 3 * 11 = 33 equations",
        "right; the rig has these 11 groups as bodies",
        "section 1; guide, rigs: plans",
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
        "Step 2, Fig. 3: the axis of a substitution part goes through the common centre of mass",
        "right; `reduce` also describes a centre beside the axis",
        "guide, rigs: `off_axis` of a plan",
    ],
    [
        "Step 2: with seven substitution parts the other elements can move while S1 and S7 rest",
        "right: 3 * 7 - 2 * 8 = 5 degrees of freedom for two drives; that S2, S4 and S6 do not rotate removes three",
        "guide, rigs: the report of `reduce`",
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
        "Step 3: with principal axes along the link and across the plane, one moment of inertia per part is enough",
        "right, and more: for motion in the plane it is enough with any principal axes",
        "`equations --balances crank_left`: three equations",
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
        "Section 3: the kinematics agrees with the multibody model to rounding",
        "confirmed: otherwise the forces could not agree to a part in 10^8",
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
        "Section 3: a well chosen centre of rotation removes forces from the balance of moments",
        "right: moments about the joint do not contain its force",
        "`equations --balances crank_left`",
    ],
    [
        "Eq. (4), (5): linear in eleven parameters",
        "right, term by term",
        "`equations`, products of parameters",
    ],
    [
        "Section 4.1: parameters whose column is zero are eliminated",
        "right; none of the eleven is one, and m1 alone does not occur in eq. (5) for this reason",
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
        "Fig. 6 and 7, e and f: line styles",
        "text and captions contradict each other: dashed is MSC.ADAMS in the captions and where the text first names the figure, estimated in the later text",
        "section 1, with named curves",
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
        "agrees with Table 2, 1 - 3.56 / 10.20; larger on the rig without other errors",
        "section 2",
    ],
    [
        "Identification lowers the errors along both trajectories",
        "confirmed",
        "section 2",
    ],
    [
        "Peaks of the relative error where a force is close to zero",
        "confirmed",
        "section 5",
    ],
    ["Table 1: inertias in kgm", "a misprint: kg m^2 is meant", "section 7"],
    [
        "Section 5: eight parameters from five, so three must be known",
        "right",
        "section 7",
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
        "Section 5: adjusted inertias, m2 and m4 and a displaced m3 adapt the reduced model",
        "right as a fit; the adjustment replaces the correct place of m4",
        "sections 3, 6 and 7",
    ],
    [
        "Section 6: the compact form can be calculated with limited hardware",
        "confirmed: 64 additions, 123 multiplications, 6 divisions, 3 square roots and 2 pairs of sine and cosine for both forces at one state",
        "guide, benchmarks",
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
