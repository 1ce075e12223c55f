//! Zeros that a model file writes as coordinates of points, as constants of a model in memory. A zero has no name, so a
//! search for wrong constants could not try it otherwise.

use modelmill_identify::diagnose::{DiagnosisVerdict, IdentifiedEffect};
use modelmill_spec::{ConstantIdx, DriveKind, ExactExpression, Mechanism, ModelConstant, ModelSymbol};

use crate::error::{Error, Outcome};
use crate::model::Model;

use super::constants::CONSTANT_ERROR;
use super::problem::DiagnosisSolution;
use super::thresholds::{MOST_ZEROS, ZEROS_LEAST_RESIDUAL, ZEROS_MOST_PRODUCTS, ZEROS_MOST_RESIDUAL};

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A model with a constant in the place of each zero.
pub(crate) struct NamedZeros {
    /// The model; its constants are those of the file, then one for each zero.
    pub(super) model: Model,
    /// The zeros.
    zeros: Vec<ZeroCoordinate>,
    /// For each base parameter of the given model, the one of this model with the same retained product.
    pub(super) positions: Vec<usize>,
}

/// A coordinate that the model file writes as zero.
pub(super) struct ZeroCoordinate {
    /// The point.
    pub(super) point: String,
    /// The axis of its frame.
    pub(super) axis: &'static str,
}

impl ZeroCoordinate {
    /// Its name in findings.
    pub(super) fn name(&self) -> String {
        format!("{} of {}", self.axis, self.point)
    }
}

impl NamedZeros {
    /// Derives the model with named zeros; `None` if it has no such zero, is too large, or has no derivation with them.
    ///
    /// Fails only when the job is cancelled.
    pub(super) fn new(model: &Model) -> Outcome<Option<Self>> {
        let reduction = &model.derivation.reduction;
        let places = zero_coordinates(&model.derivation.mechanism);
        let is_large = places.len() > MOST_ZEROS || reduction.products.len() > ZEROS_MOST_PRODUCTS;
        if places.is_empty() || is_large {
            return Ok(None);
        }
        let mut loaded = (*model.loaded).clone();
        let mechanism = &mut loaded.mechanism;
        let mut zeros = Vec::new();
        for [point, axis] in places {
            let constant = ConstantIdx(mechanism.constants.len());
            let zero = ZeroCoordinate {
                point: mechanism.points[point].name.clone(),
                axis: AXES[axis],
            };
            mechanism.constants.push(ModelConstant {
                name: zero.name(),
                value: 0.0,
                unit: "m".to_owned(),
                is_angle: false,
                note: None,
            });
            mechanism.points[point].at[axis] = ExactExpression::Symbol(ModelSymbol::Constant(constant));
            zeros.push(zero);
        }
        let host = model.host().clone().without_notes();
        let varied = match host.derive(&model.path, loaded) {
            Ok(varied) => varied,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(_) => return Ok(None),
        };
        // The columns of the given model must be among those of the varied one.
        let retained = &varied.derivation.reduction;
        let position = |k: &usize| {
            let product = &reduction.products[*k];
            retained.retained.iter().position(|j| retained.products[*j] == *product)
        };
        let positions: Option<Vec<usize>> = reduction.retained.iter().map(position).collect();
        Ok(positions.map(|positions| Self {
            model: varied,
            zeros,
            positions,
        }))
    }

    /// Whether a search with these zeros as candidates is better than the one without: it names a zero, and explains as
    /// much with fewer effects, or more with as many, or what was unexplained.
    pub(super) fn is_better(&self, with_zeros: &DiagnosisSolution, without: &DiagnosisSolution) -> bool {
        let [new, old] = [with_zeros, without].map(|one| &one.diagnosis);
        let is_zero = |one: &IdentifiedEffect| self.has_place(&one.effect.at);
        if !new.effects.iter().any(is_zero) {
            return false;
        }
        let ratio = with_zeros.mean_square_residual() / without.mean_square_residual().max(f64::MIN_POSITIVE);
        let [n_new, n_old] = [new, old].map(|one| one.effects.len());
        let unexplained = DiagnosisVerdict::Unexplained;
        let is_solved = old.verdict == unexplained && new.verdict != unexplained;
        (n_new < n_old && ratio < ZEROS_MOST_RESIDUAL)
            || ((n_new <= n_old || is_solved) && ratio < ZEROS_LEAST_RESIDUAL)
    }

    /// Whether one of these places of an effect is a zero.
    pub(super) fn has_place(&self, places: &[String]) -> bool {
        self.zeros.iter().any(|zero| places.contains(&zero.name()))
    }

    /// The zero that a constant of [`Self::model`] stands for; `None` for a constant of the file.
    pub(super) fn zero_of_constant(&self, constant: usize) -> Option<&ZeroCoordinate> {
        let first = self.model.derivation.mechanism.constants.len() - self.zeros.len();
        constant.checked_sub(first).map(|k| &self.zeros[k])
    }
}

/// Whether zeros of the file should be tried after a search: several effects, or wrong constants, may stand for one
/// zero, and what is unexplained may be one.
pub(super) fn needs_search(answer: &DiagnosisSolution) -> bool {
    let diagnosis = &answer.diagnosis;
    let is_constant = |one: &IdentifiedEffect| one.effect.kind == CONSTANT_ERROR;
    diagnosis.verdict == DiagnosisVerdict::Unexplained
        || diagnosis.effects.len() > 1
        || diagnosis.effects.iter().any(is_constant)
}

/// Point and axis of the zero coordinates of all points at which loops close or drives act, along axes on which some
/// point has another coordinate: in a plane, the third axis is none.
fn zero_coordinates(mechanism: &Mechanism) -> Vec<[usize; 2]> {
    let is_zero = |x: &ExactExpression| *x == ExactExpression::zero();
    let has_extent: Vec<bool> = (0..3)
        .map(|axis| mechanism.points.iter().any(|point| !is_zero(&point.at[axis])))
        .collect();
    let of_loops = mechanism.loops.iter().flat_map(|one| one.joins);
    let drives = mechanism.drives.iter().chain(&mechanism.shared_drives);
    let of_drives = drives.flat_map(|drive| match drive.kind {
        DriveKind::Joint(_) => Vec::new(),
        DriveKind::Linear { from, to } => vec![from, to],
    });
    let mut points: Vec<usize> = of_loops.chain(of_drives).map(|point| point.0).collect();
    points.sort_unstable();
    points.dedup();
    let all = points
        .into_iter()
        .flat_map(|point| (0..3).map(move |axis| [point, axis]));
    all.filter(|[point, axis]| has_extent[*axis] && is_zero(&mechanism.points[*point].at[*axis]))
        .collect()
}
