//! Sections of a program, printed as headings: loops, drives, motion of the links, their wrenches, forces.
//!
//! Names of values decide their sections; a value without a name belongs to the section that needs it first.

use std::collections::BTreeMap;

use modelmill_codegen::{Derivation, PoseGuard, ProgramOp, ProgramStage, StraightLineProgram};

use modelmill_spec::DriveKind;

use super::build::NamedValue;

/// Programs of more statements have no sections: they are ordered for speed, which mixes the parts of the mechanism.
const MOST_STATEMENTS: usize = 150;

/// The headings, and the section of each name.
#[derive(Clone, Debug)]
pub(crate) struct CodeSections {
    /// Heading of each section, in order of the text; the first one is empty.
    headings: Vec<String>,
    /// Section by name.
    names: BTreeMap<String, usize>,
}

/// Index of the section of the loops.
const LOOPS: usize = 1;

/// Ends of the names of components.
const AXES: [&str; 3] = ["x", "y", "z"];

impl CodeSections {
    /// Sections in the order of the recursion, with all names that belong to them.
    pub(super) fn new(derivation: &Derivation) -> Self {
        let mechanism = &derivation.mechanism;
        let mut sections = Self {
            headings: vec![String::new()],
            names: BTreeMap::new(),
        };
        // Loops come first, with the positions of all points.
        let closes = sections.add(closure_heading(derivation));
        for k in 0..derivation.loop_determinant_count() {
            sections.names.insert(format!("Delta_{}", k + 1), closes);
        }
        // Positions of points, from the base and from their frames.
        for point in &mechanism.points {
            let frame = &mechanism.frames[point.frame.0].name;
            for of in [point.name.clone(), format!("{frame}_{}", point.name)] {
                sections.assign_section("r", &of, "", closes);
            }
        }
        // Tags of the drives' equations count as on the page.
        let mut tag = 0;
        for (d, drive) in mechanism.drives.iter().enumerate() {
            let DriveKind::Linear { from, to } = drive.kind else {
                continue;
            };
            // First and last equation of the drive on the page.
            let first = tag + 1;
            tag += 1 + derivation.coordinates_that_move(d).len();
            let along = sections.add(format!("Drive `{}`: eqs. (D{first}) to (D{tag}).", drive.name));
            for point in [from, to] {
                let point = &mechanism.points[point.0];
                let frame = &mechanism.frames[point.frame.0].name;
                for of in [point.name.clone(), format!("{frame}_{}", point.name)] {
                    sections.assign_section("r", &of, "", along);
                }
            }
            sections.assign_section("e", &drive.name, "", along);
            for suffix in ["", "_d"] {
                sections.names.insert(format!("l_{}{suffix}", drive.name), along);
            }
            for coordinate in &mechanism.coordinates {
                let name = format!("J_{}_{}", drive.name, coordinate.name);
                sections.names.insert(name, along);
            }
        }
        // Names of motions, by what they are.
        let rates = sections.add("Rates of the links.".to_owned());
        let accelerations = sections.add("Accelerations of the links, minus gravity.".to_owned());
        // Motion of each frame.
        for frame in &mechanism.frames {
            sections.assign_section("omega", &frame.name, "", rates);
            sections.assign_section("omega", &frame.name, "_sq", rates);
            sections.assign_section("omega", &frame.name, "_d", accelerations);
            sections.assign_section("a", &frame.name, "", accelerations);
            let parent = &mechanism.frames[frame.parent.0].name;
            let along = format!("{}_{parent}", frame.name);
            sections.assign_section("a", &along, "", accelerations);
        }
        // Computed coordinates: positions, sines and cosines with the loops, rates and accelerations with the links.
        for coordinate in &mechanism.coordinates {
            for name in ["", "c_", "s_"].map(|letter| format!("{letter}{}", coordinate.name)) {
                sections.names.insert(name, closes);
            }
            sections.names.insert(format!("{}_d", coordinate.name), rates);
            sections.names.insert(format!("{}_d_sq", coordinate.name), rates);
            sections.names.insert(format!("{}_dd", coordinate.name), accelerations);
        }
        // From the last link to the base, the direction in which wrenches are summed.
        for frame in mechanism.frames.iter().rev() {
            let text = format!("Link {}: balances of forces and moments.", frame.name);
            let wrench = sections.add(text);
            for other in &mechanism.frames {
                for letter in ["F", "M"] {
                    sections.assign_section(letter, &frame.name, "", wrench);
                    let along = format!("{}_{}", frame.name, other.name);
                    sections.assign_section(letter, &along, "", wrench);
                }
            }
        }
        // The forces are the last section.
        sections.add("Forces of the drives.".to_owned());
        sections
    }

    /// Appends a section and returns its index.
    fn add(&mut self, heading: String) -> usize {
        self.headings.push(heading);
        self.headings.len() - 1
    }

    /// Assigns the three components of a vector to a section.
    fn assign_section(&mut self, letter: &str, of: &str, suffix: &str, section: usize) {
        for axis in AXES {
            self.names.insert(format!("{letter}_{of}_{axis}{suffix}"), section);
        }
    }

    /// Index of the section of the drives' forces, the last one.
    pub(super) fn force_section(&self) -> usize {
        self.headings.len() - 1
    }

    /// Heading of a section; `None` for the first one.
    pub(super) fn heading(&self, section: usize) -> Option<&str> {
        let heading = self.headings.get(section)?;
        (!heading.is_empty()).then_some(heading)
    }

    /// The section of each value of a program, with outputs in `last`; `None` if the program is too long.
    pub(super) fn value_sections(
        &self,
        program: &StraightLineProgram,
        inside: &[bool],
        named: &BTreeMap<usize, NamedValue>,
        last: Option<usize>,
    ) -> Option<Vec<usize>> {
        // Long programs are ordered for speed.
        let n = program.ops.len();
        let moving = |i: &usize| program.stages[*i] == ProgramStage::State;
        if (0..n).filter(moving).filter(|i| !inside[*i]).count() > MOST_STATEMENTS {
            return None;
        }
        // Backwards: each value belongs to the earliest section that needs it. A value without users follows its
        // operands. Divisions have a long latency, so they start as early as possible; their operands stay where they
        // belong.
        let mut is_early = vec![false; n];
        let mut sections: Vec<Option<usize>> = vec![None; n];
        // Outputs belong to the last section.
        for value in &program.outputs {
            sections[value.index()] = last;
        }
        for guard in &program.guards {
            // Radicands belong to the loops.
            if let PoseGuard::Reachable(value) = guard {
                sections[value.index()] = Some(LOOPS);
            }
        }
        let earlier = |a: Option<usize>, b: Option<usize>| a.into_iter().chain(b).min();
        for i in (0..n).rev() {
            // The section of its name, if it has one.
            let own = named.get(&i).and_then(|named| self.names.get(&named.name));
            is_early[i] = matches!(program.ops[i], ProgramOp::Div(..))
                && !named.contains_key(&i)
                && !program.outputs.iter().any(|output| output.index() == i);
            sections[i] = earlier(sections[i], own.copied());
            program.ops[i].for_each_operand(|v| {
                sections[v.index()] = earlier(sections[v.index()], sections[i]);
            });
        }
        // Forwards: a value cannot come before its operands.
        let mut sections: Vec<usize> = sections.into_iter().map(Option::unwrap_or_default).collect();
        for (i, op) in program.ops.iter().enumerate() {
            if matches!(op, ProgramOp::Number(_) | ProgramOp::Input(_)) || !moving(&i) {
                sections[i] = 0;
                continue;
            }
            let mut section = if is_early[i] { 0 } else { sections[i] };
            op.for_each_operand(|v| section = section.max(sections[v.index()]));
            sections[i] = section;
        }
        Some(sections)
    }
}

/// The heading of the loops: their names and the tags of their equations; empty without loops.
fn closure_heading(derivation: &Derivation) -> String {
    let n_gaps = derivation.loop_gap_count();
    let names: Vec<String> = (derivation.mechanism)
        .loops
        .iter()
        .map(|l| format!("`{}`", l.name))
        .collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => format!("Loop {one}: eqs. (L1) to (L{n_gaps})."),
        _ => format!("Loops {}: eqs. (L1) to (L{n_gaps}).", names.join(", ")),
    }
}
