//! `swerve look --detector`: detects objects with a camera detector.

use std::path::Path;

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use swerve_geom::math;
use swerve_measure::picture::{Picture, Pictures};
use swerve_report::output;
use swerve_stack::config::camera_detectors;
use swerve_vision::acf::{Detection, Ground, Rung, Scanner, Weights};

use super::LookArgs;

/// Printed result for an image.
#[derive(Serialize)]
struct Report<'a> {
    image: String,
    objects: Vec<Object<'a>>,
}

#[derive(Serialize)]
struct Object<'a> {
    class: &'a str,
    /// Left, top, width and height, pixels.
    #[serde(rename = "box")]
    bbox: [f64; 4],
    score: f64,
}

/// Detects objects in each image.
pub(super) fn run(args: &LookArgs, detector: &str) -> anyhow::Result<()> {
    let weights = camera_detectors::weights(detector).map_err(|message| anyhow!(message))?;
    let rung = rung(&weights, args)?;
    // Scores of third-party detectors are sums without an upper bound.
    let least = if rung.calibrations.is_empty() { f64::NEG_INFINITY } else { args.least };
    let mut scanner: Option<([usize; 2], Scanner)> = None;
    for (path, drawing) in Pictures::new(&args.images, args.out.as_deref(), args.overwrite)?.iter() {
        let mut picture = Picture::read(path, args.megapixels)?;
        let size = picture.size;
        if scanner.as_ref().is_none_or(|(of, _)| *of != size) {
            scanner = Some((size, Scanner::new(weights.clone(), rung.clone(), size, ground(args, size))));
        }
        let mut found = Vec::new();
        if let Some((_, scanner)) = &mut scanner {
            scanner.detect(picture.rgb()?, &mut found)?;
        }
        found.retain(|one| one.score >= least);
        tell(path, &weights, &found, args.json)?;
        if let Some(drawing) = drawing {
            found.iter().for_each(|one| draw(&mut picture, one));
            picture.write(drawing)?;
        }
    }
    Ok(())
}

/// Requested rung; by default the last one that needs no camera, or, where the camera is known, the last that uses it.
fn rung(weights: &Weights, args: &LookArgs) -> anyhow::Result<Rung> {
    let grounded = |rung: &&Rung| rung.tolerance_rad.is_some() == args.fov.is_some();
    let Some(name) = &args.rung else {
        let rung = weights.rungs.iter().rfind(grounded).or(weights.rungs.last());
        return rung.cloned().context("weights without a rung");
    };
    let rung = camera_detectors::rung(weights, name).map_err(|message| anyhow!(message))?;
    anyhow::ensure!(
        rung.tolerance_rad.is_none() || args.fov.is_some(),
        "rung `{name}` needs the camera: expected --fov"
    );
    Ok(rung.clone())
}

/// Ground in front of the camera, if the field of view is known.
pub(super) fn ground(args: &LookArgs, [width, height]: [usize; 2]) -> Option<Ground> {
    let fov_deg = args.fov?;
    let focal_px = 0.5 * width as f64 / math::tan(0.5 * fov_deg.to_radians());
    Some(Ground { horizon_px: 0.5 * height as f64, focal_px, height_m: args.height })
}

fn tell(path: &Path, weights: &Weights, found: &[Detection], json: bool) -> anyhow::Result<()> {
    let object = |one: &Detection| Object {
        class: &weights.classes[one.class],
        bbox: one.bbox.map(|px| (px * 10.0).round() / 10.0),
        score: (one.score * 1000.0).round() / 1000.0,
    };
    let seen = Report { image: path.display().to_string(), objects: found.iter().map(object).collect() };
    if json {
        return output::print(&(serde_json::to_string(&seen)? + "\n"));
    }
    let mut lines = vec![["class", "left", "top", "width", "height", "score"].map(str::to_owned).to_vec()];
    lines.extend(seen.objects.iter().map(|one| {
        let numbers = one.bbox.iter().map(|px| format!("{px:.1}")).chain([format!("{:.3}", one.score)]);
        [one.class.to_owned()].into_iter().chain(numbers).collect()
    }));
    output::print(&format!("{}\n{}", seen.image, output::align(&lines)))
}

/// Draws the edges of a box in the colour of its class.
fn draw(picture: &mut Picture, one: &Detection) {
    const COLOURS: [[u8; 3]; 4] = [[255, 64, 64], [64, 200, 255], [255, 210, 0], [80, 255, 80]];
    let colour = COLOURS[one.class % COLOURS.len()];
    picture.frame(one.bbox, colour);
}
