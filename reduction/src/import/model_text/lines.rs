//! Drives along straight lines between two points: assigns each to a coordinate that it drives, and writes their
//! points, drives, effects and limits.

use std::fmt::Write as _;

use modelmill_boundary::message;

use super::super::chain::FrameChain;
use super::super::closing::LoopSolution;
use super::super::description::StraightDrive;
use super::{ImportCoordinate, ModelTextBuilder};
use crate::write::toml_float;

/// A straight drive with its names in the model.
pub(super) struct NamedDriveLine<'a> {
    /// The drive of the description.
    pub(super) line: &'a StraightDrive,
    /// Name of the drive.
    pub(super) name: String,
    /// Names of its two points.
    pub(super) points: [String; 2],
}

/// Variables that move two frames relative to each other: those on the paths to their common ancestor.
pub(super) fn relative_variables(chain: &FrameChain, frames: [Option<usize>; 2]) -> Vec<usize> {
    // From each frame up to the base.
    let paths = frames.map(|frame| -> Vec<usize> { std::iter::successors(frame, |k| chain.nodes[*k].on).collect() });
    // Frames above the common ancestor move both ends alike.
    let own = |a: &[usize], b: &[usize]| -> Vec<usize> { a.iter().copied().filter(|k| !b.contains(k)).collect() };
    let [one, other] = [own(&paths[0], &paths[1]), own(&paths[1], &paths[0])];
    let moves = one.iter().chain(&other).flat_map(|k| &chain.nodes[*k].moves);
    moves.filter_map(|motion| motion.variable).collect()
}

/// A largest matching of lines to the coordinates in `wanted`: each line gets at most one, and no two the same. Method
/// of augmenting paths (H. W. Kuhn 1955).
fn match_lines(wanted: &[Vec<usize>]) -> Vec<Option<usize>> {
    /// Whether a coordinate can be assigned to `line`, if necessary by moving other lines to another coordinate.
    fn finds(line: usize, wanted: &[Vec<usize>], tried: &mut Vec<usize>, of: &mut [Option<usize>]) -> bool {
        for k in &wanted[line] {
            if tried.contains(k) {
                continue;
            }
            tried.push(*k);
            // A free coordinate is taken; otherwise its line has to find another one.
            let holder = of.iter().position(|one| *one == Some(*k));
            if holder.is_none_or(|holder| finds(holder, wanted, tried, of)) {
                of[line] = Some(*k);
                return true;
            }
        }
        false
    }
    let mut of = vec![None; wanted.len()];
    for line in 0..wanted.len() {
        finds(line, wanted, &mut Vec::new(), &mut of);
    }
    of
}

impl ModelTextBuilder<'_> {
    /// The frames of both ends of a line; none is the base.
    pub(super) fn frames_of(&self, line: &StraightDrive) -> [Option<usize>; 2] {
        line.ends.map(|(link, _)| link.and_then(|link| self.links[link].0))
    }

    /// Assigns to each line an independent coordinate that has no other drive, and returns the lines that become
    /// drives. Lines without such a coordinate are surplus drives, which are possible in a tree if all coordinates are
    /// driven.
    pub(super) fn assign_coordinates<'l>(
        &mut self,
        lines: &'l [StraightDrive],
        closed: Option<&LoopSolution>,
    ) -> Vec<NamedDriveLine<'l>> {
        // Coordinates that are independent and have no drive.
        let is_open = |one: &ImportCoordinate| {
            let is_passive = |v: usize| closed.is_some_and(|closed| closed.passive[v]);
            !one.is_driven && !one.is_pulled && one.variable.is_some_and(|v| !is_passive(v))
        };
        // Coordinates that a line can drive: first those that move its ends relative to each other. In a loop any
        // coordinate moves all others, so all are possible.
        let drives = |line: &StraightDrive| -> Vec<usize> {
            let near = relative_variables(&self.chain, self.frames_of(line));
            let open = self.coordinates.iter().enumerate();
            let open = open.filter(|(_, one)| is_open(one));
            let (mut on_line, others): (Vec<_>, Vec<_>) =
                open.partition(|(_, one)| one.variable.is_some_and(|v| near.contains(&v)));
            if closed.is_some() {
                on_line.extend(others);
            }
            on_line.into_iter().map(|(k, _)| k).collect()
        };
        // The largest number of lines that can be drives at the same time.
        let wanted: Vec<Vec<usize>> = lines.iter().map(drives).collect();
        let driven = match_lines(&wanted);
        let (mut kept, mut over): (Vec<&StraightDrive>, Vec<&StraightDrive>) = (Vec::new(), Vec::new());
        for (line, driven) in lines.iter().zip(driven) {
            match driven {
                Some(k) => {
                    self.coordinates[k].is_pulled = true;
                    kept.push(line);
                }
                None => over.push(line),
            }
        }
        // In a tree with all coordinates driven, further drives are surplus drives.
        let all_driven = closed.is_none() && (self.coordinates.iter()).all(|one| one.is_driven || one.is_pulled);
        for line in over {
            if all_driven {
                self.has_surplus = true;
                kept.push(line);
            } else {
                self.remarks.push(message!(
                    "line {}: `{}` acts on coordinates that other drives already move, and is left out",
                    line.line,
                    line.name
                ));
            }
        }
        // Names of the drives and their points.
        kept.into_iter()
            .map(|line| {
                // Recordings have the time in the column `t`, so no drive has this name.
                let wanted = if line.name == "t" { "t_drive" } else { &line.name };
                let name = self.unique_name(wanted);
                let points = ["from", "to"].map(|end| self.unique_name(&format!("{name}_{end}")));
                NamedDriveLine { line, name, points }
            })
            .collect()
    }

    /// Writes the points between which the lines act.
    pub(super) fn line_points(&self, lines: &[NamedDriveLine<'_>], text: &mut String) {
        for NamedDriveLine { line, points, .. } in lines {
            for ((link, at), point) in line.ends.iter().zip(points) {
                // The end of the line in the frame that carries its link.
                let (frame, place) = match link {
                    Some(link) => {
                        let (frame, placed) = self.links[*link];
                        (frame, placed.p + placed.r * at)
                    }
                    None => (None, *at),
                };
                self.write_point(text, point, frame, &place);
            }
        }
    }

    /// Adds drives, effects and force limits of the lines to those of the joints. With surplus drives, effects and
    /// limits are left out with a remark.
    pub(super) fn line_forces(&mut self, lines: &[NamedDriveLine<'_>], [drives, effects, forces]: [&mut String; 3]) {
        for NamedDriveLine {
            line,
            name: place,
            points: [from, to],
        } in lines
        {
            let _ = write!(
                drives,
                "\n[[drive]]\nname = \"{place}\"\nlinear = {{ from = \"{from}\", to = \"{to}\" }}\n"
            );
            // Losses and rotor inertia act along the line.
            for (kind, symbol, value) in [
                ("viscous_friction", "Fv", line.damping),
                ("coulomb_friction", "Fc", line.friction),
                ("drive_inertia", "Ia", line.armature),
            ] {
                if value != 0.0 && self.has_surplus {
                    self.remarks.push(message!(
                        "{kind} of `{place}` is left out: there are more drives than degrees of freedom"
                    ));
                } else if value != 0.0 {
                    let _ = write!(
                        effects,
                        "\n[[effect]]\nkind = \"{kind}\"\nat = [\"{place}\"]\nparameters = {{ {symbol} = {{ nominal = {} }} }}\n",
                        toml_float(value)
                    );
                }
            }
            // Limits of the force along the line.
            if let Some([low, high]) = line.force.filter(|[low, high]| low < high) {
                let _ = writeln!(
                    forces,
                    "{place} = {{ force = [{}, {}] }}",
                    toml_float(low),
                    toml_float(high)
                );
            }
        }
        if self.has_surplus && !forces.is_empty() {
            forces.clear();
            self.remarks
                .push("limits of forces are left out: there are more drives than degrees of freedom".into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::match_lines;

    /// A tendon over two joints gets the second one if another tendon has only the first, in any order.
    #[test]
    fn no_line_takes_what_another_alone_can_have() {
        assert_eq!(match_lines(&[vec![0, 1], vec![0]]), [Some(1), Some(0)]);
        assert_eq!(match_lines(&[vec![0], vec![0, 1]]), [Some(0), Some(1)]);
        assert_eq!(
            match_lines(&[vec![0, 1], vec![1, 2], vec![0], vec![0]]),
            [Some(1), Some(2), Some(0), None]
        );
    }
}
