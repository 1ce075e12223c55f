//! What faces offer of one state: one list for all languages.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::LanguageBinding;
use crate::tree::reads_passive;

/// A function of a state: what it is called, which method of the emitted module it stands for, and what it returns.
pub(super) struct WrappedFunction {
    pub(super) name: &'static str,
    /// Which emitted struct has it: `model`, `dynamics` for inverse dynamics, or `equation` of motion.
    pub(super) owner: &'static str,
    pub(super) method: &'static str,
    pub(super) doc: &'static str,
    /// Whether accelerations of the state are read.
    pub(super) reads_accelerations: bool,
    /// Whether forces of the drives are given besides the state.
    pub(super) takes_forces: bool,
    /// Whether Newton's method finds the passive coordinates for it.
    pub(super) follows: bool,
    pub(super) parts: Vec<ResultPart>,
}

/// A part of a result: an array, and the field of the emitted module's result in which it stands if there are several.
pub(super) struct ResultPart {
    pub(super) name: &'static str,
    pub(super) shape: Vec<ArrayDimension>,
}

/// How many numbers there are of something.
#[derive(Clone, Copy)]
pub(super) struct ArrayDimension {
    /// The end of its name in a header.
    pub(super) name: &'static str,
    pub(super) n: usize,
}

impl WrappedFunction {
    /// How many numbers it returns.
    pub(super) fn n_results(&self) -> usize {
        self.parts.iter().map(ResultPart::n_entries).sum()
    }

    /// What a part is of the result that is called `found`.
    pub(super) fn part_tokens(&self, part: &ResultPart) -> TokenStream {
        if self.parts.len() == 1 {
            return quote! { found };
        }
        let field = format_ident!("{}", part.name);
        quote! { found.#field }
    }
}

impl ResultPart {
    fn new(name: &'static str, shape: &[ArrayDimension]) -> Self {
        Self {
            name,
            shape: shape.to_vec(),
        }
    }

    /// How many numbers it has.
    pub(super) fn n_entries(&self) -> usize {
        self.shape.iter().map(|count| count.n).product()
    }
}

/// All functions of a state that a model has.
#[allow(
    clippy::too_many_lines,
    reason = "a list of functions, one after the other"
)]
pub(super) fn wrapped_functions(face: &LanguageBinding<'_>) -> Vec<WrappedFunction> {
    let count = |name, n| ArrayDimension { name, n };
    let active = count("ACTIVE", face.n_active());
    let passive = count("PASSIVE", face.n_passive());
    let drives = count("DRIVES", face.n_drives());
    let base = count("BASE", face.n_base());
    let programs = &face.derivation.programs;
    let follows = |program| reads_passive(face.derivation, program);
    let mut all = vec![
        WrappedFunction {
            name: "inverse_dynamics",
            owner: "dynamics",
            method: "forces",
            doc: "Forces of the drives, N or N m",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.inverse_dynamics),
            parts: vec![ResultPart::new("forces", &[drives])],
        },
        WrappedFunction {
            name: "regressor",
            owner: "model",
            method: "regressor",
            doc: "H_min: one row per drive, one column per base parameter",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.regressor),
            parts: vec![ResultPart::new("regressor", &[drives, base])],
        },
        WrappedFunction {
            name: "drives",
            owner: "model",
            method: "drives",
            doc: "Motion of the drives, rad or m and seconds: lengths or angles, their rates, and their Jacobian J, one row per \
                  drive and one column per coordinate",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.drives),
            parts: vec![
                ResultPart::new("coordinate", &[drives]),
                ResultPart::new("rate", &[drives]),
                ResultPart::new("jacobian", &[drives, active]),
            ],
        },
    ];
    if passive.n > 0 {
        all.push(WrappedFunction {
            name: "passive",
            owner: "model",
            method: "passive",
            doc: "Motion of the passive coordinates, rad or m and seconds: coordinates, rates, accelerations",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.passive),
            parts: ["q", "qd", "qdd"]
                .map(|name| ResultPart::new(name, &[passive]))
                .into(),
        });
    }
    let Some(dynamics) = face.dynamics else {
        return all;
    };
    let matrix = || vec![ResultPart::new("matrix", &[active, active])];
    let forces = || vec![ResultPart::new("forces", &[active])];
    let equation = [
        (
            "mass_matrix",
            "M(q) of J' f = M q'' + c + g + e, row by row: generalised force per acceleration of the coordinates",
            &dynamics.mass_matrix,
            matrix(),
        ),
        (
            "coriolis",
            "c: generalised forces that rates alone ask for, centrifugal and Coriolis",
            &dynamics.coriolis,
            forces(),
        ),
        (
            "gravity",
            "g: generalised forces that weight alone asks for",
            &dynamics.gravity,
            forces(),
        ),
        (
            "effects",
            "e: generalised forces that effects ask for where the coordinates do not accelerate, such as friction and springs",
            &dynamics.effects,
            forces(),
        ),
        (
            "bias",
            "c + g + e: generalised forces without accelerations",
            &dynamics.bias,
            forces(),
        ),
    ];
    all.extend(equation.map(|(name, doc, program, parts)| WrappedFunction {
        name,
        owner: "equation",
        method: name,
        doc,
        reads_accelerations: false,
        takes_forces: false,
        follows: follows(program),
        parts,
    }));
    all.push(WrappedFunction {
        name: "forward",
        owner: "equation",
        method: "forward",
        doc: "Forward dynamics: accelerations of the coordinates under given forces of the drives, N or N m",
        reads_accelerations: false,
        takes_forces: true,
        follows: follows(&dynamics.mass_matrix) || follows(&dynamics.bias),
        parts: vec![ResultPart::new("accelerations", &[active])],
    });
    all
}
