//! Bodies that move alike. Samples of the rig's motion go in; the rotation of each part as a sum of coordinates comes
//! out, and the loops that these rotations close already.
//!
//! A part that rotates as another one does gets no coordinate of its own, so that parallel cranks and bodies that only
//! translate are exact in the model, whatever the rounding of their lengths. Otherwise their loops would be solved from
//! rounded lengths, and the base parameters would depend on the order in which they are solved.
//!
//! The position of a point is a sum of vectors, each rotated by a sum of coordinates. A loop closes for all values of
//! the coordinates if the vectors with equal sums cancel; it follows from other loops if its vectors are combinations of
//! theirs.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use modelmill_rig::BodyAnchor;
use nalgebra::{Complex, Vector2};

use crate::drive::ContactPlace;
use crate::part::{SubstitutionPart, rotation, wrap_angle};
use crate::reduce::ReductionState;
use crate::tolerance::{angle_tolerance, distance_tolerance};

/// A sum of coordinates with integer factors: the rotation of a part since the nominal configuration.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct RotationSum(BTreeMap<String, i32>);

impl RotationSum {
    /// The sum with a multiple of one coordinate added.
    pub(crate) fn plus(&self, coordinate: &str, factor: i32) -> Self {
        let mut sum = self.clone();
        *sum.0.entry(coordinate.to_owned()).or_default() += factor;
        sum.0.retain(|_, factor| *factor != 0);
        sum
    }

    /// This sum minus another.
    pub(crate) fn minus(&self, other: &Self) -> Self {
        other
            .0
            .iter()
            .fold(self.clone(), |sum, (name, factor)| sum.plus(name, -factor))
    }

    /// Its value; `value` gives those of the coordinates.
    pub(crate) fn value(&self, value: &BTreeMap<String, f64>) -> f64 {
        let terms = self.0.iter();
        terms
            .map(|(name, factor)| f64::from(*factor) * value.get(name).copied().unwrap_or(0.0))
            .sum()
    }

    /// The sum as an expression, such as `theta1 - 2*gamma`; empty if it has no terms.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for (name, factor) in &self.0 {
            let sign = match (*factor < 0, text.is_empty()) {
                (true, true) => "-",
                (true, false) => " - ",
                (false, true) => "",
                (false, false) => " + ",
            };
            text.push_str(sign);
            if factor.abs() != 1 {
                let _ = write!(text, "{}*", factor.abs());
            }
            text.push_str(name);
        }
        text
    }
}

/// A position in the plane as a sum of vectors (complex numbers, m) that rotate by sums of coordinates.
type RotatingVectors = BTreeMap<RotationSum, Complex<f64>>;

/// What a part rotates like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RotationReference {
    /// It does not rotate.
    Base,
    /// It rotates as an earlier part, by its index.
    Part(usize),
}

impl ReductionState<'_> {
    /// The earlier part, or the base, whose rotation a part has at all samples; `None` if there is none. Only generated
    /// plans leave the coordinates open.
    pub(crate) fn find_same_rotation(&self, part: &SubstitutionPart) -> Option<RotationReference> {
        if !self.is_generated {
            return None;
        }
        let (plane, samples) = (&self.plane, &self.samples);
        let tolerance = angle_tolerance(self.names.rig, part.bodies[0]);
        let differs = |other: RotationReference| {
            let most = samples.largest(|moment| {
                let other = match other {
                    RotationReference::Base => 0.0,
                    RotationReference::Part(k) => self.parts[k].rotation_angle(moment, plane, samples),
                };
                let difference = part.rotation_angle(moment, plane, samples) - other;
                difference.sin().atan2(difference.cos())
            });
            most.is_nan() || most > tolerance
        };
        let earlier = (0..self.rotations.len()).map(RotationReference::Part);
        std::iter::once(RotationReference::Base)
            .chain(earlier)
            .find(|other| !differs(*other))
    }

    /// The rotation of a reference since the nominal configuration.
    pub(crate) fn rotation_of(&self, other: RotationReference) -> RotationSum {
        match other {
            RotationReference::Base => RotationSum::default(),
            RotationReference::Part(k) => self.rotations[k].clone(),
        }
    }

    /// The angle of a part that needs no coordinate, as an expression: a sum of coordinates and perhaps a constant. It is
    /// reported in step 2. `coordinate` would be its own one, `nominal` is the angle in the nominal configuration (rad),
    /// `carried` the rotation of its carrier.
    pub(crate) fn tied_angle(
        &mut self,
        part: &SubstitutionPart,
        other: RotationReference,
        coordinate: &str,
        nominal: f64,
        carried: &RotationSum,
    ) -> String {
        let relative = self.rotation_of(other).minus(carried);
        let offset = wrap_angle(nominal - relative.value(&self.nominal));
        let mut expression = format!("{}{}", relative.text(), self.angle_offset(coordinate, offset));
        // A constant angle stands alone.
        if relative.text().is_empty() {
            expression = match expression.trim_start() {
                "" => "0".to_owned(),
                sum => sum.trim_start_matches("+ ").replacen("- ", "-", 1),
            };
        }
        let says = match other {
            RotationReference::Base => "does not rotate, and needs no coordinate".to_owned(),
            RotationReference::Part(k) => format!("rotates as {}, and needs no coordinate", self.parts[k].name),
        };
        self.report.add(2, &part.name, says, Vec::new());
        expression
    }

    /// The end of a part's longitudinal axis, 1 m from its joint, if the axis has the direction of another part's, or of
    /// the plane's x axis.
    pub(crate) fn axis_end_along(&self, part: &SubstitutionPart, other: RotationReference) -> BodyAnchor {
        let (plane, samples) = (&self.plane, &self.samples);
        let angle = match other {
            RotationReference::Base => 0.0,
            RotationReference::Part(k) => self.parts[k].nominal_angle(plane, samples),
        };
        let direction = plane.x * angle.cos() + plane.normal.cross(&plane.x) * angle.sin();
        let body = samples.nominal.motion.bodies[part.bodies[0]].R_WB;
        BodyAnchor {
            at: part.joint[1].at + body.transpose() * direction,
            ..part.joint[1]
        }
    }

    /// Whether a loop closes by the rotations of the parts alone, or follows from the loops so far.
    pub(crate) fn is_loop_implied(&mut self, ends: [ContactPlace; 2]) -> bool {
        let [one, two] = ends.map(|end| self.rotating_vectors(end));
        let mut gap = one;
        for (sum, vector) in two {
            *gap.entry(sum).or_default() -= vector;
        }
        // What remains of the gap after the loops so far; these have length 1 and are orthogonal.
        for known in &self.loop_directions {
            let share: Complex<f64> = known
                .iter()
                .map(|(sum, k)| k.conj() * gap.get(sum).copied().unwrap_or_default())
                .sum();
            for (sum, k) in known {
                *gap.entry(sum.clone()).or_default() -= share * k;
            }
        }
        let size = gap.values().map(Complex::norm_sqr).sum::<f64>().sqrt();
        if size <= distance_tolerance(self.names.rig) {
            return true;
        }
        self.loop_directions
            .push(gap.into_iter().map(|(sum, vector)| (sum, vector / size)).collect());
        false
    }

    /// The position of a point of the model, from the base outwards.
    fn rotating_vectors(&self, point: ContactPlace) -> RotatingVectors {
        let (plane, samples) = (&self.plane, &self.samples);
        let mut vectors = RotatingVectors::new();
        let mut add = |sum: RotationSum, vector: Vector2<f64>| {
            *vectors.entry(sum).or_default() += Complex::new(vector.x, vector.y);
        };
        let (mut part, mut at) = (point.part, point.at);
        while let Some(k) = part {
            let here = &self.parts[k];
            add(
                self.rotations[k].clone(),
                rotation(here.nominal_angle(plane, samples)) * at,
            );
            // The origin of its frame is a point of its carrier.
            part = here.parent;
            let origin = self.contact_place(&here.joint[0], part);
            at = origin.at;
        }
        add(RotationSum::default(), at);
        vectors
    }
}
