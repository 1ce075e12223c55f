//! The part of the command line of `check` and `diff` that asks for a picture.

use std::path::{Path, PathBuf};

use clap::Args;
use modelmill::Model;
use modelmill::picture::{DrawingStyle, PictureOptions};

use crate::failure::CommandOutcome;
use crate::output::OutputFile;

/// What is drawn, and where to.
#[derive(Debug, Args)]
#[command(next_help_heading = "Picture")]
pub(crate) struct DrawingArgs {
    /// Draw the mechanism as SVG: links, joints (filled where driven), loops, drives, centres of mass
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) picture: Option<PathBuf>,
    /// Values of active coordinates, rad or m; the others are nominal, and loops are closed
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = parse_value, value_delimiter = ',', requires = "picture",
          allow_hyphen_values = true)]
    at: Vec<(String, f64)>,
    /// Look from this azimuth and elevation, degrees, e.g. 30,20; else planar mechanisms are seen flat
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = parse_view, requires = "picture",
          allow_hyphen_values = true)]
    view: Option<[f64; 2]>,
    /// Show the axes of all frames
    #[arg(long, requires = "picture")]
    frames: bool,
}

impl DrawingArgs {
    /// Where the picture goes, if one is asked for; it must be none of the files that are read.
    pub(crate) fn target<'a>(
        &self,
        inputs: impl IntoIterator<Item = &'a Path>,
    ) -> CommandOutcome<Option<OutputFile>> {
        let path = self.picture.as_ref();
        path.map(|path| OutputFile::for_flag("--picture", path, inputs))
            .transpose()
    }

    /// Draws a model, over another one if there is one.
    pub(crate) fn draw(
        &self,
        target: &OutputFile,
        model: &Model,
        before: Option<&Model>,
    ) -> CommandOutcome {
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

/// Reads `NAME=VALUE`.
pub(super) fn parse_value(text: &str) -> Result<(String, f64), String> {
    let expected = "expected a coordinate and its value, such as theta1=1.7";
    let (name, value) = text.split_once('=').ok_or(expected)?;
    let value: f64 = value.trim().parse().map_err(|_| expected.to_owned())?;
    if !value.is_finite() {
        return Err("the value must be finite".to_owned());
    }
    Ok((name.trim().to_owned(), value))
}

/// Reads two angles.
fn parse_view(text: &str) -> Result<[f64; 2], String> {
    let expected = || "expected two angles in degrees, such as 30,20".to_owned();
    let (azimuth, elevation) = text.split_once(',').ok_or_else(expected)?;
    let angle = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    Ok([
        angle(azimuth).ok_or_else(expected)?,
        angle(elevation).ok_or_else(expected)?,
    ])
}
