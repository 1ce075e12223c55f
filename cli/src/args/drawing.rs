//! Options of `check` and `diff` for a picture of the mechanism.

use std::path::{Path, PathBuf};

use clap::Args;
use modelmill::Model;
use modelmill::picture::{DrawingStyle, PictureOptions};

use crate::failure::CommandOutcome;
use crate::output::OutputFile;

/// Options for the picture: target file, pose and view.
#[derive(Debug, Args)]
#[command(next_help_heading = "Picture")]
pub(crate) struct DrawingArgs {
    /// Draw the mechanism as SVG: links, joints (filled where driven), loops, drives, centres of mass
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) picture: Option<PathBuf>,
    /// Values of active coordinates, rad or m; the others are nominal. Passive coordinates are determined by loop
    /// closure
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = parse_value, value_delimiter = ',', requires = "picture",
          allow_hyphen_values = true)]
    at: Vec<(String, f64)>,
    /// Look from this azimuth and elevation, degrees, e.g. 30,20; without it planar mechanisms are drawn in their plane
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = parse_view, requires = "picture",
          allow_hyphen_values = true)]
    view: Option<[f64; 2]>,
    /// Show the axes of all frames
    #[arg(long, requires = "picture")]
    frames: bool,
}

impl DrawingArgs {
    /// The target of `--picture`, if given. Refuses a path that is one of `inputs`, the files that the command reads.
    pub(crate) fn target<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>) -> CommandOutcome<Option<OutputFile>> {
        let path = self.picture.as_ref();
        path.map(|path| OutputFile::for_flag("--picture", path, inputs))
            .transpose()
    }

    /// Draws a model and writes the SVG; with `before`, this other model is drawn as well.
    pub(crate) fn draw(&self, target: &OutputFile, model: &Model, before: Option<&Model>) -> CommandOutcome {
        // Angles are in degrees on the command line and in rad in the library.
        let drawing = PictureOptions {
            at: self.at.clone(),
            from: self
                .view
                .map(|[azimuth, elevation]| [azimuth.to_radians(), elevation.to_radians()]),
            style: DrawingStyle {
                frames: self.frames,
                ..DrawingStyle::default()
            },
            ..PictureOptions::default()
        };
        target.write(&model.picture(&drawing, before)?)
    }
}

/// Reads `NAME=VALUE`, with a finite value in rad or m.
pub(super) fn parse_value(text: &str) -> Result<(String, f64), String> {
    let expected = "expected a coordinate and its value, such as theta1=1.7";
    let (name, value) = text.split_once('=').ok_or(expected)?;
    let value: f64 = value.trim().parse().map_err(|_| expected.to_owned())?;
    if !value.is_finite() {
        return Err("the value must be finite".to_owned());
    }
    Ok((name.trim().to_owned(), value))
}

/// Reads `AZIMUTH,ELEVATION`, two angles in degrees.
fn parse_view(text: &str) -> Result<[f64; 2], String> {
    let expected = || "expected two angles in degrees, such as 30,20".to_owned();
    let (azimuth, elevation) = text.split_once(',').ok_or_else(expected)?;
    let angle = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    Ok([
        angle(azimuth).ok_or_else(expected)?,
        angle(elevation).ok_or_else(expected)?,
    ])
}
