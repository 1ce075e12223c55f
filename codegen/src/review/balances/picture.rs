//! The picture of a free body at the nominal pose: its shape, its axes, and the forces and moments at its cuts.

use modelmill_draw::{CutArrow, CutArrowKind, DrawingStyle, FreeBodyDrawing, MechanismScene, free_body_svg};
use modelmill_spec::{FrameIdx, Kinematics};
use nalgebra::{Matrix3, Vector3};

use super::equations::BalanceEquations;
use super::vectors::{AXES, VectorComponents, VectorId};
use crate::Derivation;
use crate::expr::vector::{self, SymbolicVector};
use crate::expr::{Graph, nominal_value};

/// What the arrows mean.
const CAPTION: &str = "<figcaption>The body cut free, at the nominal pose. Unknown forces and moments are red: their \
                       arrows show place and sign, not direction. Forces of known line of action are green, weights \
                       are yellow.</figcaption>";

/// The axes of components in the base frame, and the origin of the body.
struct CutBodyPose {
    /// Axes by columns.
    axes: Matrix3<f64>,
    /// The origin, m.
    origin: Vector3<f64>,
}

impl CutBodyPose {
    /// A place in the base frame, m, from a lever arm in the axes of components.
    fn place(&self, arm: Vector3<f64>) -> Vector3<f64> {
        self.origin + self.axes * arm
    }
}

impl BalanceEquations<'_> {
    /// The body as an inline SVG; empty if its pose has no finite value.
    pub(super) fn picture(&mut self, derivation: &Derivation) -> String {
        let mechanism = &derivation.mechanism;
        let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
        let scene = MechanismScene::new(mechanism, &nominal);
        let Some(frame) = self.geometry.frames().first().copied() else {
            return String::new();
        };
        let Some(pose) = self.body_pose(frame, &nominal) else {
            return String::new();
        };
        let mut arrows = Vec::new();
        for cut in &self.cuts {
            let Some(arm) = self.numeric(&cut.at) else { continue };
            for (id, is_opposite) in &cut.forces {
                arrows.push(self.cut_arrow(&pose, pose.place(arm), *id, *is_opposite));
            }
        }
        arrows.extend(self.weight_arrows(&pose));
        let shown = self.geometry.force_axes();
        let axes = [0, 1, 2].map(|k| {
            let axis: Vector3<f64> = pose.axes.column(k).into_owned();
            (axis, if shown.contains(&k) { AXES[k] } else { "" })
        });
        let drawing = FreeBodyDrawing {
            frame: &mechanism.frames[frame].name,
            origin: pose.origin,
            axes,
            arrows: &arrows,
        };
        let picture = free_body_svg(&scene, &scene.best_view(), &DrawingStyle::default(), &drawing);
        format!("{picture}{CAPTION}")
    }

    /// The pose of the axes of components, from that of a frame of the body.
    fn body_pose(&mut self, frame: usize, nominal: &[f64]) -> Option<CutBodyPose> {
        let kinematics = Kinematics::new(self.geometry.mechanism);
        let poses = kinematics.poses(nominal);
        let placed = &poses.frames()[frame];
        let of_frame = Matrix3::from_fn(|i, j| placed.rotation[i][j]);
        let link = self.geometry.tree().link_of(FrameIdx(frame));
        // The axes of the frame in the axes of components, by columns.
        let mut seen = Matrix3::zeros();
        for k in 0..3 {
            let mut axis = vector::ZERO;
            axis[k] = Graph::ONE;
            let axis = self.geometry.express_in_body_axes(&axis, link);
            seen.set_column(k, &self.numeric(&axis)?);
        }
        let axes = of_frame * seen.transpose();
        let arm = self.geometry.lever_arm(link, &vector::ZERO);
        let origin = Vector3::from(placed.origin) - axes * self.numeric(&arm)?;
        Some(CutBodyPose { axes, origin })
    }

    /// The arrow of a vector at a cut.
    fn cut_arrow(&self, pose: &CutBodyPose, at: Vector3<f64>, id: VectorId, is_opposite: bool) -> CutArrow {
        let named = &self.vectors.vectors[id.0];
        let sign = if is_opposite { "\u{2212}" } else { "" };
        let kind = match named.components {
            VectorComponents::Known(v) => {
                let direction = self.numeric(&v).unwrap_or_default();
                let direction = pose.axes * if is_opposite { -direction } else { direction };
                CutArrowKind::Force(direction)
            }
            VectorComponents::Unknown(_) if named.unit == "N" => CutArrowKind::UnknownForce,
            VectorComponents::Unknown(_) => CutArrowKind::UnknownMoment,
        };
        // A drive acts along its unit vector with an unknown force.
        let scalar = self.scalars.iter().find(|scalar| scalar.along == id);
        let factor = scalar.map_or(String::new(), |scalar| format!("{}\u{b7}", scalar.symbol));
        CutArrow {
            at,
            kind,
            name: format!("{sign}{factor}{}", named.symbol),
        }
    }

    /// Arrows of the weights.
    fn weight_arrows(&self, pose: &CutBodyPose) -> Vec<CutArrow> {
        let Some(gravity) = self.gravity else { return Vec::new() };
        let VectorComponents::Known(direction) = self.vectors.vectors[gravity.0].components else {
            return Vec::new();
        };
        let Some(direction) = self.numeric(&direction) else {
            return Vec::new();
        };
        let arrows = self.weights.iter().filter_map(|(mass, arm)| {
            let VectorComponents::Known(arm) = self.vectors.vectors[arm.0].components else {
                return None;
            };
            Some(CutArrow {
                at: pose.place(self.numeric(&arm)?),
                kind: CutArrowKind::Weight(pose.axes * direction),
                name: format!("{}\u{b7}{}", mass.text(), self.vectors.vectors[gravity.0].symbol),
            })
        });
        arrows.collect()
    }

    /// The value of a vector at the nominal pose; `None` if it is not finite.
    fn numeric(&self, v: &SymbolicVector) -> Option<Vector3<f64>> {
        let mut value = Vector3::zeros();
        for k in 0..3 {
            value[k] = nominal_value(&self.geometry.graph, self.geometry.mechanism, v[k]).filter(|x| x.is_finite())?;
        }
        Some(value)
    }
}
