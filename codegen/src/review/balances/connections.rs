//! Forces at the cuts of a body: reactions of its joints and of closed loops, linear drives, struts and rods.

use modelmill_spec::{CoordinateIdx, DriveKind, EffectPlace, PointIdx};

use super::equations::{AxialForce, BalanceEquations, BalanceTerm, CutPlace};
use super::vectors::{VectorComponents, VectorId};
use crate::DeriveError;
use crate::expr::Atom;
use crate::expr::print::PrintedFormula;
use crate::expr::vector::{self, SymbolicVector};
use crate::loops::segment::{PointPairPath, local_position, position_in_base, sum_segments};
use crate::on_request::reactions::cut_loop_names;
use crate::regressor::mechanics::point_forces;

impl BalanceEquations<'_> {
    /// Adds all forces and moments on the body, except for its weight.
    pub(super) fn add_connections(&mut self) -> Result<(), DeriveError> {
        let root = self.geometry.root;
        self.add_own_joint(root);
        self.add_linear_drives()?;
        let tree = self.geometry.tree();
        for link in 0..tree.links.len() {
            let child = &tree.links[link];
            if child.is_moving() && child.free.is_none() && self.geometry.has_link(child.parent) {
                self.add_carried_joint(link);
            }
        }
        self.add_loops()?;
        self.add_effects()
    }

    /// Adds what the body receives through the joint that carries it. Its origin is the origin of all moments.
    fn add_own_joint(&mut self, root: usize) {
        let name = self.geometry.names[root].clone();
        let is_free = self.geometry.tree().links[root].free.is_some();
        let through = if is_free {
            format!("on the free body {name} from outside, such as thrust and contact")
        } else {
            format!("through the joint of {name}, on this body")
        };
        let force_says = format!("force {through}{}", self.force_clause(root));
        let force = self.add_unknown(&format!("f_{name}"), [true; 3], force_says, &name);
        self.load.forces.insert(0, BalanceTerm::force(force));
        let mut marks = vec![(force, false)];
        let transmitted = self.transmitted_moments(root, true);
        if transmitted.iter().any(|k| *k) {
            let says = format!("moment {through}, about O{}", self.moment_clause(root));
            let moment = self.add_unknown_moment(&format!("m_{name}"), transmitted, says, &name);
            self.load.moments.insert(0, BalanceTerm::force(moment));
            marks.push((moment, false));
        }
        self.cuts.push(CutPlace {
            at: vector::ZERO,
            forces: marks,
        });
    }

    /// Adds what the body passes on through the joint of a link that it carries.
    fn add_carried_joint(&mut self, link: usize) {
        let name = self.geometry.names[link].clone();
        let (parent, position) = {
            let child = &self.geometry.tree().links[link];
            (child.parent, child.position)
        };
        let at = self.geometry.lever_arm(parent, &position);
        let arm = self.add_arm(&name, at, &format!("the joint of {name}"));
        let through = format!("through the joint of {name}, on {name}; this body receives the opposite");
        let force_says = format!("force {through}{}", self.force_clause(link));
        let force = self.add_unknown(&format!("f_{name}"), [true; 3], force_says, &name);
        let mut marks = vec![(force, true)];
        self.push_force(BalanceTerm::force(force).negate(), arm);
        let transmitted = self.transmitted_moments(link, false);
        if transmitted.iter().any(|k| *k) {
            let says = format!("moment {through}{}", self.moment_clause(link));
            let moment = self.add_unknown_moment(&format!("m_{name}"), transmitted, says, &name);
            self.load.moments.push(BalanceTerm::force(moment).negate());
            marks.push((moment, true));
        }
        self.cuts.push(CutPlace { at, forces: marks });
    }

    /// Components of the moment that a joint can transmit. A revolute joint without drive, effect and coupling
    /// transmits none about its axis.
    fn transmitted_moments(&self, link: usize, is_own: bool) -> [bool; 3] {
        let mut transmitted = [true; 3];
        let axis = match (self.geometry.normal, is_own) {
            (Some(normal), _) => normal,
            // The axis of the body's own joint is one of the axes of the body.
            (None, true) => self.geometry.tree().links[link].named_axis as usize,
            (None, false) => return transmitted,
        };
        if self.is_idle_revolute(link) {
            transmitted[axis] = false;
        }
        if let Some(normal) = self.geometry.normal {
            for k in (0..3).filter(|k| *k != normal) {
                transmitted[k] = false;
            }
        }
        transmitted
    }

    /// Whether nothing acts on a revolute joint about its axis.
    fn is_idle_revolute(&self, link: usize) -> bool {
        let mechanism = self.geometry.mechanism;
        let links = &self.geometry.tree().links;
        let ([(coordinate, _)], true) = (&links[link].turns[..], links[link].slides.is_empty()) else {
            return false;
        };
        let moves = |i: &usize| {
            let link = &links[*i];
            link.turns.iter().any(|(c, _)| c == coordinate) || link.slides.iter().any(|(c, _)| c == coordinate)
        };
        let is_coupled = mechanism.couplings.iter().any(|coupling| {
            let is_one_of = |c: &CoordinateIdx| c.0 == *coordinate;
            is_one_of(&coupling.coordinate) || coupling.leaders().iter().any(is_one_of)
        });
        (0..links.len()).filter(moves).count() == 1
            && !is_coupled
            && mechanism.shared_drives.is_empty()
            && self.drive_of(*coordinate).is_none()
            && !self.has_effect(*coordinate)
    }

    /// The drive on a coordinate, by index.
    fn drive_of(&self, coordinate: usize) -> Option<usize> {
        let kind = DriveKind::Joint(CoordinateIdx(coordinate));
        self.geometry
            .mechanism
            .drives
            .iter()
            .position(|drive| drive.kind == kind)
    }

    /// Whether an effect acts on a coordinate.
    fn has_effect(&self, coordinate: usize) -> bool {
        let here = EffectPlace::Coordinate(CoordinateIdx(coordinate));
        let mut effects = self.geometry.mechanism.effects.iter();
        effects.any(|effect| effect.places.contains(&here) || effect.other == Some(here))
    }

    /// What is known of the moment of a joint, as a clause that follows it; empty if nothing is.
    fn moment_clause(&self, link: usize) -> String {
        let turns = self.geometry.tree().links[link].turns.iter().map(|(c, _)| *c);
        if self.geometry.tree().links[link].free.is_some() {
            "; it includes every drive on this body".to_owned()
        } else if self.is_idle_revolute(link) {
            "; it acts across the axis of the joint".to_owned()
        } else {
            self.axis_clause(&turns.collect::<Vec<usize>>())
        }
    }

    /// What is known of the force of a joint, as a clause that follows it; empty if nothing is.
    fn force_clause(&self, link: usize) -> String {
        let slides = self.geometry.tree().links[link].slides.iter().map(|(c, _)| *c);
        self.axis_clause(&slides.collect::<Vec<usize>>())
    }

    /// Drives and effects on coordinates of a joint, as a clause; empty if there are none.
    fn axis_clause(&self, coordinates: &[usize]) -> String {
        let drives = coordinates.iter().filter_map(|c| self.drive_of(*c));
        let drives: Vec<&str> = drives
            .map(|d| self.geometry.mechanism.drives[d].name.as_str())
            .collect();
        let mut acting: Vec<String> = Vec::new();
        if !drives.is_empty() {
            acting.push(format!("drive {}", drives.join(", ")));
        }
        if coordinates.iter().any(|c| self.has_effect(*c)) {
            acting.push("friction and other effects on the joint".to_owned());
        }
        if acting.is_empty() {
            return String::new();
        }
        format!(
            "; its component on the axis of the joint contains {}",
            acting.join(", ")
        )
    }

    /// Adds drives between two points, of which one is on the body.
    fn add_linear_drives(&mut self) -> Result<(), DeriveError> {
        let mechanism = self.geometry.mechanism;
        for d in 0..mechanism.drives.len() {
            let drive = &mechanism.drives[d];
            let DriveKind::Linear { from, to } = drive.kind else {
                continue;
            };
            let on_body = [from, to].map(|point| self.carries_point(point));
            // A drive between two points of one body transmits nothing to other bodies.
            if on_body[0] == on_body[1] {
                continue;
            }
            let along = self.vector_between(from, to)?;
            let length = self.geometry.equations.projection.drives[d].coordinate;
            let per_length = self.geometry.graph.pow(length, -1);
            let unit = self.geometry.graph.scale_vector(per_length, &along);
            let name = &drive.name;
            let [a, b] = [from, to].map(|point| mechanism.points[point.0].name.as_str());
            let u = self.vectors.add(
                &format!("u_{name}"),
                "1",
                VectorComponents::Known(unit),
                format!("unit vector along drive {name}, from {a} to {b}"),
            );
            let magnitude = self.vectors.unique_name(&format!("F_{name}"));
            self.scalars.push(AxialForce {
                symbol: magnitude.clone(),
                meaning: format!(
                    "force that drive {name} transmits to its ends: that of the drive less its friction and other \
                     effects; positive if it pushes them apart"
                ),
                drive: name.clone(),
                along: u,
            });
            let term = BalanceTerm::force(u).with_factor(PrintedFormula::name(magnitude));
            let point = if on_body[1] { to } else { from };
            let (at, arm) = self.add_point_arm(point)?;
            self.push_force(if on_body[1] { term } else { term.negate() }, arm);
            self.cuts.push(CutPlace {
                at,
                forces: vec![(u, on_body[0])],
            });
        }
        Ok(())
    }

    /// Adds the forces at the points where loops are cut.
    fn add_loops(&mut self) -> Result<(), DeriveError> {
        let mechanism = self.geometry.mechanism;
        let cuts = cut_loop_names(&mut self.geometry.graph, mechanism, self.geometry.equations)?;
        for closed in &mechanism.loops {
            let on_body = closed.joins.map(|point| self.carries_point(point));
            let Some((name, is_planar)) = cuts.iter().find(|(name, _)| *name == closed.name) else {
                continue;
            };
            if on_body[0] == on_body[1] {
                continue;
            }
            let side = usize::from(on_body[1]);
            let (at, arm) = self.add_point_arm(closed.joins[side])?;
            let [a, b] = closed.joins.map(|point| mechanism.points[point.0].name.as_str());
            let which = ["on this body", "on the other body; this body receives the opposite"][side];
            let says = format!("where loop {name} joins {a} and {b}, {which}");
            let force = self.add_unknown(&format!("f_{name}"), [true; 3], format!("force {says}"), name);
            let signed = |term: BalanceTerm| if side == 0 { term } else { term.negate() };
            self.push_force(signed(BalanceTerm::force(force)), arm);
            let mut marks = vec![(force, side == 1)];
            // Only the pin of a planar loop transmits moments, across the plane.
            if *is_planar && self.geometry.normal.is_none() {
                let says =
                    format!("moment of the pin {says}, across its axis; the equations of motion do not determine it");
                let moment = self.add_unknown_moment(&format!("m_{name}"), [true; 3], says, name);
                self.load.moments.push(signed(BalanceTerm::force(moment)));
                marks.push((moment, side == 1));
            }
            self.cuts.push(CutPlace { at, forces: marks });
        }
        Ok(())
    }

    /// Adds the forces of struts and rods.
    fn add_effects(&mut self) -> Result<(), DeriveError> {
        let (mechanism, equations) = (self.geometry.mechanism, self.geometry.equations);
        let (tree, projection) = (&equations.tree, &equations.projection);
        for effect in &mechanism.effects {
            let terms = effect.terms.iter();
            let values: Vec<_> = terms
                .map(|term| self.geometry.graph.atom(Atom::Parameter(term.parameter.0)))
                .collect();
            let graph = &mut self.geometry.graph;
            let forces = point_forces(graph, mechanism, tree, projection, &equations.gravity, effect, &values)?;
            for (point, force) in forces {
                if !self.carries_point(point) {
                    continue;
                }
                // The effect acts on the body against the force that balances it.
                let force = force.map(|x| self.geometry.graph.neg(x));
                let force = self.geometry.express_in_body_axes(&force, None);
                let name = &mechanism.points[point.0].name;
                let force = self.vectors.add(
                    &format!("f_{}_{name}", effect.kind),
                    "N",
                    VectorComponents::Known(force),
                    format!("force of effect {} at {name}", effect.kind),
                );
                let (at, arm) = self.add_point_arm(point)?;
                self.push_force(BalanceTerm::force(force), arm);
                self.cuts.push(CutPlace {
                    at,
                    forces: vec![(force, false)],
                });
            }
        }
        Ok(())
    }

    /// Adds a force with its moment.
    fn push_force(&mut self, term: BalanceTerm, arm: VectorId) {
        self.load.forces.push(term.clone());
        if !self.vectors.is_zero(arm) {
            self.load.moments.push(term.with_arm(arm));
        }
    }

    /// Adds an unknown force.
    fn add_unknown(&mut self, symbol: &str, which: [bool; 3], says: String, by: &str) -> VectorId {
        let id = self.vectors.add(symbol, "N", VectorComponents::Unknown(which), says);
        self.vectors.vectors[id.0].transmitted_by = Some(by.to_owned());
        id
    }

    /// Adds an unknown moment.
    fn add_unknown_moment(&mut self, symbol: &str, which: [bool; 3], says: String, by: &str) -> VectorId {
        let id = self.vectors.add_moment(symbol, VectorComponents::Unknown(which), says);
        self.vectors.vectors[id.0].transmitted_by = Some(by.to_owned());
        id
    }

    /// Adds a lever arm.
    fn add_arm(&mut self, name: &str, at: SymbolicVector, says: &str) -> VectorId {
        self.vectors.add(
            &format!("r_{name}"),
            "m",
            VectorComponents::Known(at),
            format!("from O to {says}"),
        )
    }

    /// Adds the lever arm of a named point; one that is there already is used again.
    fn add_point_arm(&mut self, point: PointIdx) -> Result<(SymbolicVector, VectorId), DeriveError> {
        let named = &self.geometry.mechanism.points[point.0];
        let local = local_position(&mut self.geometry.graph, named)?;
        let link = self.geometry.tree().link_of(named.frame);
        let at = self.geometry.lever_arm(link, &local);
        if let Some((_, arm)) = self.point_arms.iter().find(|(p, _)| *p == point) {
            return Ok((at, *arm));
        }
        let arm = self.add_arm(&named.name, at, &format!("point {}", named.name));
        self.point_arms.push((point, arm));
        Ok((at, arm))
    }

    /// Whether a point is on the body.
    fn carries_point(&self, point: PointIdx) -> bool {
        let frame = self.geometry.mechanism.points[point.0].frame;
        self.geometry.has_link(self.geometry.tree().link_of(frame))
    }

    /// The vector from one point to another, m.
    fn vector_between(&mut self, from: PointIdx, to: PointIdx) -> Result<SymbolicVector, DeriveError> {
        let (mechanism, tree) = (self.geometry.mechanism, self.geometry.tree());
        if self.geometry.normal.is_some() {
            let a = position_in_base(&mut self.geometry.graph, mechanism, tree, from.0)?;
            let b = position_in_base(&mut self.geometry.graph, mechanism, tree, to.0)?;
            return Ok(self.geometry.graph.sub_vectors(&b, &a));
        }
        // The paths from the last common link.
        let points = [to, from].map(|point| &mechanism.points[point.0]);
        let paths = points.map(|point| tree.path_to(tree.link_of(point.frame)));
        let shared = paths[0].iter().zip(&paths[1]).take_while(|(a, b)| a == b).count();
        let common = shared.checked_sub(1).map(|last| paths[0][last]);
        let graph = &mut self.geometry.graph;
        let at = [local_position(graph, points[0])?, local_position(graph, points[1])?];
        let between = PointPairPath {
            paths: [&paths[0][shared..], &paths[1][shared..]],
            at,
        };
        let segments = between.segments(graph, tree, &[]);
        let along = sum_segments(graph, &segments);
        Ok(self.geometry.express_in_body_axes(&along, common))
    }
}
