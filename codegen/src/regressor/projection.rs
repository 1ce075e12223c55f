//! The projection from the open tree to the mechanism: constraint forces are eliminated by virtual power, and forces of
//! the drives are solved for.
//!
//! Let `y` be the rates in which the loops are simplest (for a passive joint the absolute angular rate where axes are
//! parallel). The differentiated loops are `J_p y_p + J_a y_a = 0`. Then `tau_z = tau_a + G' tau_p` with `G = -J_p^-1
//! J_a`, and the forces f of the drives follow from `(d l / d z)' f = tau_z`.
//!
//! Decision: virtual power is written with generalised forces of the open tree, projected with the passive rates, and
//! not body by body. The recursion of an open chain is the cheapest one, and the same rows serve every projection.
//! Terms that would cancel are never built, because the unknown of a passive joint whose axis is parallel to its
//! parent's is the absolute angular rate.

use modelmill_spec::{DriveKind, Mechanism};

use crate::DeriveError;
use crate::expr::linear::{self, LinearSolution};
use crate::expr::{Atom, ExprId, Graph, Node, Rational, Unary, nominal_value};
use crate::loops::KinematicLoops;
use crate::loops::segment::distance_squared;
use crate::tree::KinematicTree;

/// Kinematics of one drive.
#[derive(Clone, Debug)]
pub(crate) struct DriveMotion {
    /// Its length (m) or angle (rad).
    pub(crate) coordinate: ExprId,
    /// First time derivative.
    pub(crate) rate: ExprId,
    /// Second time derivative.
    pub(crate) acceleration: ExprId,
}

/// Kinematics of loops and drives, and the projection on the independent coordinates.
#[derive(Clone, Debug)]
pub(crate) struct LoopProjection {
    /// The closed loops.
    pub(crate) loops: KinematicLoops,
    /// Positions among the independent coordinates of those that have a rate.
    pub(crate) freedoms: Vec<usize>,
    /// Rate of each passive coordinate, in the order of `loops.passive`.
    pub(crate) passive_rates: Vec<ExprId>,
    /// Acceleration of each passive coordinate, in the same order.
    pub(crate) passive_accelerations: Vec<ExprId>,
    /// Derivatives of the residuals by the passive coordinates, `[residual][passive]`.
    pub(crate) residual_jacobian: Vec<Vec<ExprId>>,
    /// Kinematics of each drive.
    pub(crate) drives: Vec<DriveMotion>,
    /// `drive_jacobian[d][a]`: derivative of the length of drive `d` by active coordinate `a`.
    pub(crate) drive_jacobian: Vec<Vec<ExprId>>,
    /// Determinants that must not be zero.
    pub(crate) determinants: Vec<ExprId>,
    /// `rates_of[i]`: rate of coordinate `i` as an integer combination of the rates `y`.
    rates_of: Vec<Vec<i64>>,
    /// `transmission[p][a]`: derivative `d y_p / d z_a`.
    transmission: Vec<Vec<ExprId>>,
}

impl LoopProjection {
    /// Solves the differentiated loops for the passive motion and adds the drives.
    pub(crate) fn new(graph: &mut Graph, mechanism: &Mechanism, tree: &KinematicTree) -> Result<Self, DeriveError> {
        let n = mechanism.coordinates.len();
        // Derivatives of the residuals by all coordinates.
        let loops = KinematicLoops::new(graph, mechanism, tree)?;
        let (active, passive, residual) = (&loops.active, &loops.passive, &loops.residual);
        let rates_of = passive_rate_map(tree, passive, n);
        let by_coordinate: Vec<Vec<ExprId>> = (0..n)
            .map(|i| graph.differentiate(residual, Atom::Coordinate(i)))
            .collect();
        // Derivative of a residual by the rate `y_j`.
        let in_y = |graph: &mut Graph, by_coordinate: &[Vec<ExprId>], row: usize, j: usize| {
            let terms: Vec<_> = (0..n)
                .filter(|i| rates_of[*i][j] != 0)
                .map(|i| (by_coordinate[i][row], Rational::integer(rates_of[i][j])))
                .collect();
            graph.sum(&terms)
        };
        // Columns of the Jacobian in the rates `y`.
        let pick = |graph: &mut Graph, columns: &[usize]| -> Vec<Vec<ExprId>> {
            (0..residual.len())
                .map(|r| columns.iter().map(|j| in_y(graph, &by_coordinate, r, *j)).collect())
                .collect()
        };
        let (loop_p, loop_a) = (pick(graph, passive), pick(graph, active));
        // Right-hand sides: the columns of the active rates, then the drift, which only accelerations have.
        let drift = Self::residual_drift(graph, residual);
        let rhs: Vec<Vec<ExprId>> = loop_a
            .iter()
            .zip(&drift)
            .map(|(row, drift)| {
                let mut row: Vec<ExprId> = row.iter().map(|x| graph.neg(*x)).collect();
                row.push(graph.neg(*drift));
                row
            })
            .collect();
        let solution = linear::solve(graph, &loop_p, &rhs, "the passive rates")?;
        // The solution: passive rates per active rate, and the drift of the accelerations.
        let transmission: Vec<Vec<ExprId>> = solution.values.iter().map(|row| row[..active.len()].to_vec()).collect();
        let residual_jacobian = (0..residual.len())
            .map(|r| passive.iter().map(|p| by_coordinate[*p][r]).collect())
            .collect();
        let has_rate = |a: &usize| mechanism.coordinates[loops.active[*a]].motion.has_rate();
        let freedoms = (0..loops.active.len()).filter(has_rate).collect();
        // Quaternions must not be zero either.
        let mut determinants = solution.determinants.clone();
        determinants.extend(tree.quaternion_squares(graph));
        let mut projection = Self {
            loops,
            freedoms,
            passive_rates: Vec::new(),
            passive_accelerations: Vec::new(),
            residual_jacobian,
            drives: Vec::new(),
            drive_jacobian: Vec::new(),
            determinants,
            rates_of,
            transmission,
        };
        // Rates have no drift.
        projection.passive_rates = projection.passive_motion(graph, Atom::Rate, None);
        let drift: Vec<ExprId> = solution
            .values
            .iter()
            .map(|row| row.last().copied().unwrap_or(Graph::ZERO))
            .collect();
        projection.passive_accelerations = projection.passive_motion(graph, Atom::Acceleration, Some(&drift));
        projection.add_drives(graph, mechanism, tree)?;
        Ok(projection)
    }

    /// Second time derivative of the residuals at zero acceleration.
    fn residual_drift(graph: &mut Graph, residual: &[ExprId]) -> Vec<ExprId> {
        // The derivative of the velocities along the rates only.
        let velocity = graph.time_derivative(residual);
        let only_rates = |graph: &mut Graph, atom: Atom| match atom {
            Atom::Coordinate(i) => graph.atom(Atom::Rate(i)),
            _ => Graph::ZERO,
        };
        graph.directional(&velocity, only_rates)
    }

    /// Rates or accelerations of the passive coordinates from those of the active ones; `drift` is added to
    /// accelerations.
    fn passive_motion(&self, graph: &mut Graph, order: fn(usize) -> Atom, drift: Option<&[ExprId]>) -> Vec<ExprId> {
        let n = self.rates_of.len();
        // Active rates are inputs, passive ones follow by the transmission.
        let mut y = vec![Graph::ZERO; n];
        for a in &self.loops.active {
            y[*a] = graph.atom(order(*a));
        }
        for (k, p) in self.loops.passive.iter().enumerate() {
            let mut terms: Vec<ExprId> = self
                .loops
                .active
                .iter()
                .enumerate()
                .map(|(j, a)| graph.mul(self.transmission[k][j], y[*a]))
                .collect();
            terms.extend(drift.map(|d| d[k]));
            y[*p] = graph.add_all(&terms);
        }
        // From the rates `y` back to the coordinates.
        self.loops
            .passive
            .iter()
            .map(|p| {
                let terms: Vec<_> = (0..n)
                    .map(|j| (y[j], Rational::integer(self.rates_of[*p][j])))
                    .collect();
                graph.sum(&terms)
            })
            .collect()
    }

    /// Generalised forces of all coordinates of the open tree, projected on the active ones.
    pub(crate) fn project(&self, graph: &mut Graph, forces: &[ExprId]) -> Vec<ExprId> {
        let n = self.rates_of.len();
        // Forces on the rates `y`.
        let in_y: Vec<ExprId> = (0..n)
            .map(|j| {
                let terms: Vec<_> = (0..n)
                    .filter(|i| self.rates_of[*i][j] != 0)
                    .map(|i| (forces[i], Rational::integer(self.rates_of[i][j])))
                    .collect();
                graph.sum(&terms)
            })
            .collect();
        self.loops
            .active
            .iter()
            .enumerate()
            .map(|(j, a)| {
                let mut terms = vec![in_y[*a]];
                for (k, p) in self.loops.passive.iter().enumerate() {
                    terms.push(graph.mul(self.transmission[k][j], in_y[*p]));
                }
                graph.add_all(&terms)
            })
            .collect()
    }

    /// Forces of the drives that balance generalised forces of all coordinates of the open tree.
    pub(crate) fn drive_forces(&self, graph: &mut Graph, forces: &[ExprId]) -> Result<Vec<ExprId>, DeriveError> {
        // Generalised forces on the active coordinates, which the drives have to balance.
        let projected = self.project(graph, forces);
        let n_drives = self.drive_jacobian.len();
        let transposed: Vec<Vec<ExprId>> = self
            .freedoms
            .iter()
            .map(|a| (0..n_drives).map(|d| self.drive_jacobian[d][*a]).collect())
            .collect();
        // If each drive moves one coordinate, no linear system is solved: its symbolic solution takes long for a large tree.
        if let Some(coordinates) = find_permutation(&transposed) {
            return Ok(coordinates
                .into_iter()
                .map(|row| projected[self.freedoms[row]])
                .collect());
        }
        let rhs: Vec<Vec<ExprId>> = self.freedoms.iter().map(|a| vec![projected[*a]]).collect();
        let solution = linear::solve(graph, &transposed, &rhs, "the drives' forces")?;
        Ok(solution.values.into_iter().map(|row| row[0]).collect())
    }

    /// Multipliers of some closure equations, as many as there are passive coordinates: the force of each gap, for
    /// given generalised forces of the open tree minus those of the drives. A positive force widens its gap.
    pub(crate) fn multipliers(
        &self,
        graph: &mut Graph,
        gaps: &[ExprId],
        forces: &[ExprId],
    ) -> Result<LinearSolution, DeriveError> {
        let n = self.loops.passive.len();
        let by_passive: Vec<Vec<ExprId>> = self
            .loops
            .passive
            .iter()
            .map(|p| graph.differentiate(gaps, Atom::Coordinate(*p)))
            .collect();
        // Derivatives by the passive rates `y`, which move only passive coordinates.
        let jacobian: Vec<Vec<ExprId>> = (0..gaps.len())
            .map(|row| {
                let by = |j: &usize| {
                    let terms = self.loops.passive.iter().zip(&by_passive);
                    let terms = terms.filter(|(i, _)| self.rates_of[**i][*j] != 0);
                    let terms: Vec<_> = terms
                        .map(|(i, slopes)| (slopes[row], Rational::integer(self.rates_of[*i][*j])))
                        .collect();
                    graph.sum(&terms)
                };
                self.loops.passive.iter().map(by).collect()
            })
            .collect();
        let in_y: Vec<ExprId> = self
            .loops
            .passive
            .iter()
            .map(|j| {
                let terms: Vec<_> = (0..forces.len())
                    .filter(|i| self.rates_of[*i][*j] != 0)
                    .map(|i| (forces[i], Rational::integer(self.rates_of[i][*j])))
                    .collect();
                graph.sum(&terms)
            })
            .collect();
        let what = "the forces of the loops";
        let transposed: Vec<Vec<ExprId>> = (0..n).map(|p| jacobian.iter().map(|row| row[p]).collect()).collect();
        // The transposed system is solved directly if it is small enough.
        let rhs: Vec<Vec<ExprId>> = in_y.iter().map(|x| vec![*x]).collect();
        match linear::solve(graph, &transposed, &rhs, what) {
            // Systems of independent legs can be split by columns only, so the inverse of the untransposed matrix is
            // used instead.
            Err(DeriveError::TooLarge { .. }) => {}
            found => return found,
        }
        let identity: Vec<Vec<ExprId>> = (0..n)
            .map(|i| {
                let one = |j| if i == j { Graph::ONE } else { Graph::ZERO };
                (0..n).map(one).collect()
            })
            .collect();
        // The inverse, multiplied by the forces.
        let mut solution = linear::solve(graph, &jacobian, &identity, what)?;
        let inverse = std::mem::take(&mut solution.values);
        solution.values = (0..n)
            .map(|r| {
                let terms: Vec<ExprId> = inverse
                    .iter()
                    .zip(&in_y)
                    .map(|(row, force)| graph.mul(row[r], *force))
                    .collect();
                vec![graph.add_all(&terms)]
            })
            .collect();
        Ok(solution)
    }

    /// Adds kinematics and Jacobian of all drives, and the determinant of the Jacobian.
    fn add_drives(
        &mut self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        tree: &KinematicTree,
    ) -> Result<(), DeriveError> {
        let n = mechanism.coordinates.len();
        for drive in &mechanism.drives {
            let coordinate = match drive.kind {
                DriveKind::Joint(i) => graph.atom(Atom::Coordinate(i.0)),
                DriveKind::Linear { from, to } => {
                    // The length of a linear drive.
                    let square = distance_squared(graph, mechanism, tree, [to.0, from.0])?;
                    let length = graph.unary(Unary::Sqrt, square);
                    signed_length(graph, mechanism, length)
                }
            };
            // The row of the Jacobian by virtual power.
            let by_coordinate: Vec<ExprId> = (0..n)
                .map(|i| graph.differentiate(&[coordinate], Atom::Coordinate(i))[0])
                .collect();
            let row = self.project(graph, &by_coordinate);
            let mut rate_terms = Vec::new();
            for (a, slope) in self.loops.active.iter().zip(&row) {
                let rate = graph.atom(Atom::Rate(*a));
                rate_terms.push(graph.mul(*slope, rate));
            }
            let rate = graph.add_all(&rate_terms);
            // The acceleration is written with the rates of the tree, which are closed later.
            let tree_rate = graph.time_derivative(&[coordinate]);
            let acceleration = graph.time_derivative(&tree_rate)[0];
            // Kinematics and row of the Jacobian.
            self.drives.push(DriveMotion {
                coordinate,
                rate,
                acceleration,
            });
            self.drive_jacobian.push(row);
        }
        // The Jacobian must be square.
        let n = self.freedoms.len();
        if self.drives.len() != n {
            return Err(DeriveError::DriveCount {
                drives: self.drives.len(),
                freedoms: n,
            });
        }
        // The system is solved only for its determinants, which must not be zero.
        let identity: Vec<Vec<ExprId>> = (0..n)
            .map(|i| (0..n).map(|j| if i == j { Graph::ONE } else { Graph::ZERO }).collect())
            .collect();
        let square: Vec<Vec<ExprId>> = self
            .drive_jacobian
            .iter()
            .map(|row| self.freedoms.iter().map(|a| row[*a]).collect())
            .collect();
        let solution = linear::solve(graph, &square, &identity, "the inverse of the drives' Jacobian")?;
        self.determinants.extend(solution.determinants);
        Ok(())
    }
}

/// The length of a drive without the absolute value that it has along a prismatic joint. A drive does not pass through
/// its own point, so the sign is that of the nominal pose.
fn signed_length(graph: &mut Graph, mechanism: &Mechanism, length: ExprId) -> ExprId {
    let (base, factor) = graph.split_factor(length);
    let Node::Unary(Unary::Abs, inner) = *graph.node(base) else {
        return length;
    };
    // The sign at the nominal pose.
    let positive = nominal_value(graph, mechanism, inner).is_none_or(|x| x >= 0.0);
    graph.scale(inner, &if positive { factor } else { -&factor })
}

/// Rates of all coordinates as integer combinations of the rates `y`. For a passive revolute joint `y` is the absolute
/// rate of its link about the axes that are parallel to its own.
fn passive_rate_map(tree: &KinematicTree, passive: &[usize], n: usize) -> Vec<Vec<i64>> {
    let mut rates_of: Vec<Vec<i64>> = (0..n).map(|i| (0..n).map(|j| i64::from(i == j)).collect()).collect();
    // Passive coordinates that have been treated; a coordinate may move several links.
    let mut done = Vec::new();
    for link in &tree.links {
        let sum = &link.absolute.sum;
        let [(p, sign @ (1 | -1))] = link.turns[..] else {
            continue;
        };
        if !passive.contains(&p) || done.contains(&p) {
            continue;
        }
        // q_p = sign (y_p - rest), where the rest consists of coordinates closer to the base.
        let mut row = vec![0; n];
        row[p] = i64::from(sign);
        for (atom, factor) in sum.terms() {
            if let Atom::Coordinate(i) = atom
                && *i != p
            {
                for j in 0..n {
                    row[j] -= i64::from(sign) * i64::from(*factor) * rates_of[*i][j];
                }
            }
        }
        rates_of[p] = row;
        done.push(p);
    }
    rates_of
}

/// The row of the one in each column of a square matrix that permutes entries; `None` for other matrices.
fn find_permutation(matrix: &[Vec<ExprId>]) -> Option<Vec<usize>> {
    let mut rows = vec![None; matrix.len()];
    for (row, entries) in matrix.iter().enumerate() {
        let mut nonzero = entries.iter().enumerate().filter(|(_, entry)| **entry != Graph::ZERO);
        let (Some((column, &Graph::ONE)), None) = (nonzero.next(), nonzero.next()) else {
            return None;
        };
        rows.get_mut(column)?.get_or_insert(row);
    }
    rows.into_iter().collect()
}
