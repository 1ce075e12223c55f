//! Pictures of a model: its mechanism at a pose, as SVG, optionally over a second model.

use modelmill_codegen::ModelEvaluator;
use modelmill_draw::{MechanismScene, ViewDirection, loaded_svg};

pub use modelmill_draw::{DrawingStyle, DriveArrow, ERROR_SHADES};

use crate::error::{Error, Outcome};
use crate::model::{Model, state_at_standstill};

/// Options of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PictureOptions {
    /// Values of active coordinates, rad or m, with their names. Other coordinates are nominal; loops are closed.
    pub at: Vec<(String, f64)>,
    /// View direction, rad: azimuth around the vertical from the base's x axis, and elevation above the horizontal
    /// plane. Without it, planar mechanisms are viewed normal to their plane, others obliquely from above.
    pub from: Option<[f64; 2]>,
    /// Size, names and frames.
    pub style: DrawingStyle,
    /// Forces of drives that are drawn as arrows.
    pub loads: Vec<DriveArrow>,
}

impl Model {
    /// The mechanism at values of its active coordinates, rad or m; coordinates that are not named are nominal.
    ///
    /// Fails when a name is not an active coordinate, and when the loops cannot close.
    pub fn scene(&self, at: &[(String, f64)]) -> Outcome<MechanismScene> {
        let mechanism = &self.derivation.mechanism;
        let mut pose: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
        // The nominal pose closes its loops already.
        if at.is_empty() {
            return Ok(MechanismScene::new(mechanism, &pose));
        }
        for (name, value) in at {
            let mut coordinates = mechanism.coordinates.iter();
            let place = coordinates.position(|c| !c.passive && c.name == *name);
            let place = place.ok_or_else(|| {
                let known = self.active_coordinates().join(", ");
                Error::options(format!(
                    "`{name}` is no active coordinate of {}; these are: {known}",
                    self.name
                ))
            })?;
            pose[place] = *value;
        }
        // Passive coordinates are solved for by loop closure at the requested pose, with zero rates.
        let places = |passive: bool| {
            let all = mechanism.coordinates.iter().enumerate();
            all.filter(move |(_, c)| c.passive == passive).map(|(i, _)| i)
        };
        let active: Vec<f64> = places(false).map(|i| pose[i]).collect();
        if places(true).next().is_some() {
            let passive = ModelEvaluator::new(&self.derivation).passive_motion(&state_at_standstill(&active));
            let passive =
                passive.map_err(|_| Error::options(format!("the loops of {} cannot close at that pose", self.name)))?;
            for (i, column) in places(true).zip(passive) {
                pose[i] = column[0];
            }
        }
        Ok(MechanismScene::new(mechanism, &pose))
    }

    /// The model as SVG: links, joints, loops, drives and masses. `before`, if given, is a second model that is drawn
    /// behind it as a shadow, at the same scale and pose.
    ///
    /// Fails when a name is not an active coordinate, and when the loops cannot close.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::picture::PictureOptions;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// let options = PictureOptions { at: vec![("q1".to_owned(), 0.8)], ..PictureOptions::default() };
    /// assert!(arm.picture(&options, None)?.contains("<svg"));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn picture(&self, drawing: &PictureOptions, before: Option<&Self>) -> Outcome<String> {
        let scene = self.scene(&drawing.at)?;
        let view = match drawing.from {
            Some([azimuth, elevation]) => ViewDirection::from_angles(&scene, azimuth, elevation),
            None => scene.best_view(),
        };
        // Both models are drawn in one view, so that their geometry can be compared.
        let shadow = before.map(|model| model.scene(&drawing.at)).transpose()?;
        let scenes: Vec<&MechanismScene> = shadow.iter().chain(Some(&scene)).collect();
        Ok(loaded_svg(&scenes, &view, &drawing.style, &drawing.loads))
    }
}
