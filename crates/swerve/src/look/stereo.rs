//! `swerve look --stereo`: computes the disparities of a rectified pair.

use std::path::PathBuf;

use anyhow::Context as _;
use serde::Serialize;
use swerve_measure::picture::Picture;
use swerve_report::files::{refuse_to_replace, write_whole};
use swerve_report::output;
use swerve_vision::Plane;
use swerve_vision::stereo::{Stereo, StereoSettings};

use super::LookArgs;

/// Printed result for a pair.
#[derive(Serialize)]
struct Report {
    left: String,
    right: String,
    out: String,
    /// Share of the pixels with a known disparity, 0 to 1.
    known: f64,
    /// Median of the known disparities, pixels.
    median_px: Option<f32>,
}

/// Computes and writes the disparities.
pub(super) fn run(args: &LookArgs, pair: &[PathBuf]) -> anyhow::Result<()> {
    let out = args.out.as_ref().context("expected --out with the file to be written")?;
    refuse_to_replace([out.as_path()], pair)?;
    args.overwrite.check([out.as_path()])?;
    let mut planes = [Plane::default(), Plane::default()];
    for (plane, path) in planes.iter_mut().zip(pair) {
        Picture::read(path, args.megapixels)?.rgb().with_context(|| path.display().to_string())?.gray(plane);
    }
    let settings = StereoSettings { disparities: args.disparities, ..StereoSettings::default() };
    let mut found = Plane::default();
    Stereo::new(settings)?.disparities(&planes[0], &planes[1], &mut found)?;
    write_whole(out, &pfm(&found))?;
    let mut known: Vec<f32> = found.pixels().iter().copied().filter(|d| !d.is_nan()).collect();
    known.sort_by(f32::total_cmp);
    let share = known.len() as f64 / found.pixels().len() as f64;
    let seen = Report {
        left: pair[0].display().to_string(),
        right: pair[1].display().to_string(),
        out: out.display().to_string(),
        known: (share * 1000.0).round() / 1000.0,
        median_px: known.get(known.len() / 2).copied(),
    };
    if args.json {
        return output::print(&(serde_json::to_string(&seen)? + "\n"));
    }
    let median = seen.median_px.map_or_else(String::new, |px| format!(", half of them below {px:.1} px"));
    output::print(&format!("{}: {:.1} % of the pixels{median}\n", seen.out, 100.0 * share))
}

/// Encodes disparities as PFM, one float per pixel: rows from the bottom, little-endian, infinite where unknown, as in
/// the Middlebury data sets.
fn pfm(disparities: &Plane<f32>) -> Vec<u8> {
    let mut bytes = format!("Pf\n{} {}\n-1.0\n", disparities.width(), disparities.height()).into_bytes();
    for row in (0..disparities.height()).rev() {
        let known = disparities.row(row).iter().map(|d| if d.is_nan() { f32::INFINITY } else { *d });
        bytes.extend(known.flat_map(f32::to_le_bytes));
    }
    bytes
}
