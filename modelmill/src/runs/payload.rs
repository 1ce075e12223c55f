//! Columns of loads: the force of a further body on each body of a mechanism, ten columns each, linear in its mass,
//! first moments and inertia about the frame's origin.

use modelmill_codegen::{Derivation, derive_columns};
use modelmill_spec::{
    DynamicParameter, ExactExpression, FrameIdx, Mechanism, ModelPart, ModelSymbol, ParameterIdx, PartInertia,
};

use crate::error::{Error, Outcome};
use crate::model::Model;

/// Number of parameters of a body: mass, first moments x, y, z, and inertia xx, xy, xz, yy, yz, zz.
pub(crate) const TEN: usize = 10;

/// Columns of loads on all bodies.
pub(crate) struct PayloadColumns {
    /// Names of the frames that may carry a load, one after the other.
    pub(crate) frames: Vec<String>,
    /// For each frame, the columns of the derivation that belong to its ten parameters; `None` if a parameter has
    /// no effect.
    pub(crate) columns: Vec<[Option<usize>; TEN]>,
    /// The derivation of H for these parameters alone.
    pub(crate) derivation: Derivation,
}

impl PayloadColumns {
    /// The columns for all frames that carry parts or lumped masses.
    pub(crate) fn new(model: &Model) -> Outcome<Self> {
        Self::of_frames(model, &loaded_frames(&model.derivation.mechanism))
    }

    /// The columns for the last bodies only: those that carry no other body, such as the flange of an arm.
    pub(crate) fn of_last_bodies(model: &Model) -> Outcome<Self> {
        Self::of_frames(model, &last_frames(&model.derivation.mechanism))
    }

    /// The columns for some frames.
    fn of_frames(model: &Model, frames: &[FrameIdx]) -> Outcome<Self> {
        let mechanism = &model.derivation.mechanism;
        let (variant, own) = with_bodies(mechanism, frames);
        // Only products of a single new parameter are derived.
        let is_wanted = |product: &modelmill_codegen::ParameterMonomial| matches!(product.0[..], [(p, 1)] if p >= own);
        let derivation = derive_columns(&variant, &is_wanted).map_err(|error| Error::derivation(&model.path, error))?;
        let reduction = &derivation.reduction;
        // Parameters without effect on the drives have no column.
        let products: Vec<usize> = reduction
            .retained
            .iter()
            .filter_map(|k| reduction.products[*k].0.first().map(|(p, _)| *p))
            .collect();
        let column = |parameter: usize| products.iter().position(|p| *p == parameter);
        Ok(Self {
            columns: (0..frames.len())
                .map(|f| std::array::from_fn(|i| column(own + TEN * f + i)))
                .collect(),
            frames: frames
                .iter()
                .map(|frame| mechanism.frames[frame.0].name.clone())
                .collect(),
            derivation,
        })
    }
}

/// Frames that carry parts or lumped masses, without the base, in their order.
fn loaded_frames(mechanism: &Mechanism) -> Vec<FrameIdx> {
    let mut frames: Vec<FrameIdx> = Vec::new();
    let parts = mechanism.parts.iter().map(|part| part.frame);
    for frame in parts.chain(mechanism.lumped_masses.iter().map(|mass| mass.frame)) {
        // The base frame has the index 0 and cannot carry a load.
        if frame.0 > 0 && !frames.contains(&frame) {
            frames.push(frame);
        }
    }
    frames.sort_by_key(|frame| frame.0);
    frames
}

/// Those of them on which no other of them stands.
fn last_frames(mechanism: &Mechanism) -> Vec<FrameIdx> {
    let all = loaded_frames(mechanism);
    let carries = |lower: FrameIdx| {
        all.iter().any(|frame| {
            let mut at = *frame;
            // The parent of the base is the base itself.
            while at.0 > 0 && at != lower {
                at = mechanism.frames[at.0].parent;
            }
            at == lower && *frame != lower
        })
    };
    all.iter().copied().filter(|frame| !carries(*frame)).collect()
}

/// The mechanism with a further body on each of some frames, and the index of the first of their parameters.
fn with_bodies(mechanism: &Mechanism, frames: &[FrameIdx]) -> (Mechanism, usize) {
    let mut variant = mechanism.clone();
    let own = variant.parameters.len();
    for frame in frames {
        let first = variant.parameters.len();
        let value = |i: usize| ExactExpression::Symbol(ModelSymbol::Parameter(ParameterIdx(first + i)));
        variant.parts.push(ModelPart {
            name: format!("payload of {}", variant.frames[frame.0].name),
            frame: *frame,
            inertial: PartInertia::Linear {
                mass: value(0),
                first_moment: std::array::from_fn(|i| value(1 + i)),
                inertia: std::array::from_fn(|i| value(4 + i)),
            },
        });
        // Nominal values are 0: only the columns are used.
        for i in 0..TEN {
            let unit = match i {
                0 => "kg",
                1..=3 => "kg m",
                _ => "kg m^2",
            };
            variant.parameters.push(DynamicParameter {
                name: format!("payload{first}_{i}"),
                nominal: 0.0,
                has_nominal: false,
                unit: unit.to_owned(),
                note: None,
            });
        }
    }
    (variant, own)
}
