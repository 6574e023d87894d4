//! `swerve look --lanes`: finds the lines of the ego lane.

use std::path::Path;

use anyhow::Context as _;
use serde::Serialize;
use swerve_measure::picture::{Picture, Pictures};
use swerve_report::output;
use swerve_vision::lanes::{LaneFinder, LaneLine, LaneSettings, Lanes, Method, RoadCamera};

use super::LookArgs;

const COLOURS: [[u8; 3]; 2] = [[255, 40, 40], [40, 90, 255]];
/// Spacing of the dots of a drawn line, metres.
const STEP_M: f64 = 0.05;

/// Printed result for an image.
#[derive(Serialize)]
struct Report {
    image: String,
    /// Downward pitch of the camera relative to the given one, degrees.
    pitch_deg: f64,
    left: Option<Line>,
    right: Option<Line>,
}

/// `y = c0 + c1 x + c2 x²`, metres, `x` ahead of the camera and `y` to its left.
#[derive(Serialize)]
struct Line {
    coefficients: [f64; 3],
    covariance: [[f64; 3]; 3],
    seen_m: [f64; 2],
}

/// Finds the lane in each image.
pub(super) fn run(args: &LookArgs, method: Method) -> anyhow::Result<()> {
    let mut finder: Option<(RoadCamera, LaneFinder)> = None;
    for (path, drawing) in Pictures::new(&args.images, args.out.as_deref(), args.overwrite)?.iter() {
        let mut picture = Picture::read(path, args.megapixels)?;
        let camera = camera(args, picture.size)?;
        if finder.as_ref().is_none_or(|(of, _)| *of != camera) {
            let mut settings = LaneSettings { method, ..LaneSettings::default() };
            if args.pitch.is_none() {
                settings.pitch_deviation_rad = LaneSettings::PITCH_UNKNOWN_RAD;
            }
            finder = Some((camera, LaneFinder::new(camera, settings)?));
        }
        let Some((_, finder)) = &mut finder else { continue };
        let lanes = finder.find(picture.rgb()?).with_context(|| path.display().to_string())?;
        tell(path, &lanes, args.json)?;
        if let Some(drawing) = drawing {
            draw(&mut picture, &camera, &lanes);
            picture.write(drawing)?;
        }
    }
    Ok(())
}

fn camera(args: &LookArgs, size_px: [usize; 2]) -> anyhow::Result<RoadCamera> {
    let ego_from_camera = RoadCamera::looking_ahead(args.height, args.pitch.unwrap_or(0.0).to_radians());
    if let Some(fov_deg) = args.fov {
        return Ok(RoadCamera::pinhole(size_px, fov_deg.to_radians(), ego_from_camera));
    }
    let &[fx, fy, cx, cy, ref lens @ ..] = &args.calibration[..] else {
        anyhow::bail!("--lanes needs the camera: expected --fov, or --calibration with 4 to 9 numbers");
    };
    anyhow::ensure!(lens.len() <= 5, "--calibration has {} numbers, expected 4 to 9", 4 + lens.len());
    // An image of half or twice the calibrated size puts it a quarter of the width or more from the middle.
    let [width, height] = size_px;
    anyhow::ensure!(
        (cx / width as f64 - 0.5).abs() < 0.25,
        "--calibration: its optical axis is at column {cx} of an image of {width} x {height} pixels, far from the middle: \
         expected the calibration of images of this size"
    );
    let distortion = core::array::from_fn(|k| lens.get(k).copied().unwrap_or(0.0));
    Ok(RoadCamera { size_px, focal_px: [fx, fy], center_px: [cx, cy], distortion, ego_from_camera })
}

fn tell(path: &Path, lanes: &Lanes, json: bool) -> anyhow::Result<()> {
    let line = |line: LaneLine| Line {
        coefficients: line.coefficients,
        covariance: line.covariance,
        seen_m: line.seen_m,
    };
    let image = path.display().to_string();
    if json {
        let pitch_deg = lanes.pitch_rad.to_degrees();
        let seen = Report { image, pitch_deg, left: lanes.left.map(line), right: lanes.right.map(line) };
        return output::print(&(serde_json::to_string(&seen)? + "\n"));
    }
    let heads = ["line", "from m", "to m", "at its start m", "in the middle m", "at its end m"];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for (name, line) in [("left", lanes.left), ("right", lanes.right)] {
        let Some(line) = line else {
            rows.push([name, "-", "-", "-", "-", "-"].map(str::to_owned).to_vec());
            continue;
        };
        let [from, to] = line.seen_m;
        let places = [from, 0.5 * (from + to), to].map(|x_m| {
            line.at(x_m).map_or_else(String::new, |(y_m, deviation_m)| format!("{y_m:.2} ± {deviation_m:.2}"))
        });
        rows.push(
            [name.to_owned(), format!("{from:.1}"), format!("{to:.1}")].into_iter().chain(places).collect(),
        );
    }
    let pitch_deg = lanes.pitch_rad.to_degrees();
    output::print(&format!("{image}, {pitch_deg:.2} degrees further down\n{}", output::align(&rows)))
}

fn draw(picture: &mut Picture, camera: &RoadCamera, lanes: &Lanes) {
    let radius = 1 + picture.size[0] as i64 / 600;
    for (line, colour) in [lanes.left, lanes.right].into_iter().zip(COLOURS) {
        let Some(line) = line else { continue };
        let [from, to] = line.seen_m;
        for k in 0..=((to - from) / STEP_M) as usize {
            let x_m = from + k as f64 * STEP_M;
            let pixel = line.at(x_m).and_then(|(y_m, _)| camera.pixel([x_m, y_m], lanes.pitch_rad));
            if let Some(pixel) = pixel {
                picture.dot(pixel, radius, colour);
            }
        }
    }
}
