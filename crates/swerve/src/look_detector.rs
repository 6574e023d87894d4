//! `swerve look`: what a camera's object detector finds in images, or what their pixels are labelled as.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use swerve_geom::math;
use swerve_report::files::write_png;
use swerve_report::output;
use swerve_study::train::read_png;
use swerve_vision::Rgb;
use swerve_vision::acf::{Detection, Ground, Rung, Scanner, Weights, WeightsError};
use swerve_vision::shipped;

use crate::look_segmentation;

/// `swerve look`.
#[derive(clap::Args, Debug)]
pub(crate) struct LookArgs {
    /// Images (PNG)
    #[arg(required = true)]
    pub(crate) images: Vec<PathBuf>,
    /// Find objects: the detector that is in the program, or a file of weights
    #[arg(long, value_name = "NAME", required_unless_present = "segmentation")]
    detector: Option<String>,
    /// Label all pixels: by the weights that are in the program, or a file of them [default: street]
    #[arg(
        long,
        value_name = "NAME",
        num_args = 0..=1,
        default_missing_value = "street",
        conflicts_with = "detector",
        requires = "fov"
    )]
    segmentation: Option<String>,
    /// Way to use a detector, from fast to good [default: the last that the camera allows]
    #[arg(long, requires = "detector")]
    rung: Option<String>,
    /// Horizontal field of view, degrees: objects stand on flat ground then, below a level camera's horizon
    #[arg(long, value_name = "DEG", value_parser = fov)]
    pub(crate) fov: Option<f64>,
    /// Of the camera above that ground, m
    #[arg(long, value_name = "M", default_value_t = 1.35, value_parser = height)]
    height: f64,
    /// Leave out what is less likely
    #[arg(long, value_name = "0..1", default_value_t = 0.5)]
    least: f64,
    /// Print one JSON object an image
    #[arg(long)]
    pub(crate) json: bool,
    /// Write the images with what was found in them into this folder
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: Option<PathBuf>,
}

fn fov(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(degrees) if (1.0..=170.0).contains(&degrees) => Ok(degrees),
        _ => Err("expected 1 to 170 degrees".to_owned()),
    }
}

fn height(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(m) if m > 0.0 && m <= 100.0 => Ok(m),
        _ => Err("expected metres above 0 and at most 100".to_owned()),
    }
}

/// What is printed of an image.
#[derive(Serialize)]
struct Seen<'a> {
    image: String,
    objects: Vec<Object<'a>>,
}

#[derive(Serialize)]
struct Object<'a> {
    class: &'a str,
    /// Left, top, width, height, pixels.
    #[serde(rename = "box")]
    bbox: [f64; 4],
    score: f64,
}

/// Runs `swerve look`.
pub(crate) fn run(args: &LookArgs) -> anyhow::Result<()> {
    let Some(detector) = &args.detector else {
        return look_segmentation::run(args, args.segmentation.as_deref().unwrap_or_default());
    };
    let weights =
        named("detector", detector, shipped::names().collect(), shipped::detector(detector), Weights::read)?;
    let rung = rung(&weights, args)?;
    // Scores of others' detectors are sums, which no probability bounds.
    let least = if rung.calibrations.is_empty() { f64::NEG_INFINITY } else { args.least };
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))?;
    }
    let mut scanner: Option<([usize; 2], Scanner)> = None;
    for path in &args.images {
        let (size, mut bytes) = read_png(path)?;
        if scanner.as_ref().is_none_or(|(of, _)| *of != size) {
            scanner = Some((size, Scanner::new(weights.clone(), rung.clone(), size, ground(args, size))));
        }
        let mut found = Vec::new();
        if let Some((_, scanner)) = &mut scanner {
            scanner.detect(Rgb::new(size[0], size[1], &bytes)?, &mut found)?;
        }
        found.retain(|one| one.score >= least);
        tell(path, &weights, &found, args.json)?;
        if let Some(out) = &args.out {
            found.iter().for_each(|one| draw(&mut bytes, size, one));
            let name = path.file_name().unwrap_or_default();
            let colour = (png::ColorType::Rgb, png::BitDepth::Eight);
            write_png(&out.join(name), (size[0] as u32, size[1] as u32), colour, &bytes)?;
        }
    }
    Ok(())
}

/// Weights that are in the program, if there are some of this name, or of a file.
pub(crate) fn named<T>(
    what: &str,
    name: &str,
    names: Vec<&str>,
    shipped: Option<Result<T, WeightsError>>,
    read: impl Fn(&[u8]) -> Result<T, WeightsError>,
) -> anyhow::Result<T> {
    if let Some(weights) = shipped {
        return Ok(weights?);
    }
    let path = Path::new(name);
    if !path.exists() {
        let near = swerve_text::did_you_mean(name, names.iter().copied());
        return Err(anyhow!(
            "no {what} `{name}`{near}; expected {}, or a file of weights",
            swerve_text::list(&names)
        ));
    }
    let bytes = std::fs::read(path).with_context(|| format!("reading {name}"))?;
    read(&bytes).with_context(|| name.to_owned())
}

/// The rung asked for; else the last that does without the camera, or, where that is known, the last that knows it.
fn rung(weights: &Weights, args: &LookArgs) -> anyhow::Result<Rung> {
    let grounded = |rung: &&Rung| rung.tolerance_rad.is_some() == args.fov.is_some();
    let Some(name) = &args.rung else {
        let rung = weights.rungs.iter().rfind(grounded).or(weights.rungs.last());
        return rung.cloned().context("weights without a rung");
    };
    let names: Vec<&str> = weights.rungs.iter().map(|rung| rung.name.as_str()).collect();
    let rung = weights.rungs.iter().find(|rung| rung.name == *name).ok_or_else(|| {
        let near = swerve_text::did_you_mean(name, names.iter().copied());
        anyhow!("no rung `{name}`{near}; expected {}", swerve_text::list(&names))
    })?;
    anyhow::ensure!(
        rung.tolerance_rad.is_none() || args.fov.is_some(),
        "rung `{name}` needs the camera: expected --fov"
    );
    Ok(rung.clone())
}

/// The ground before the camera, where that is known.
pub(crate) fn ground(args: &LookArgs, [width, height]: [usize; 2]) -> Option<Ground> {
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
    let seen = Seen { image: path.display().to_string(), objects: found.iter().map(object).collect() };
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

/// Draws the edges of a box, one colour a class.
fn draw(bytes: &mut [u8], [width, height]: [usize; 2], one: &Detection) {
    const COLOURS: [[u8; 3]; 4] = [[255, 64, 64], [64, 200, 255], [255, 210, 0], [80, 255, 80]];
    let [left, top, across, down] = one.bbox;
    let within = |px: f64, n: usize| px.round().clamp(0.0, n as f64 - 1.0) as usize;
    let (columns, rows) = (
        within(left, width)..=within(left + across, width),
        within(top, height)..=within(top + down, height),
    );
    let mut dot = |x: usize, y: usize| {
        bytes[3 * (y * width + x)..][..3].copy_from_slice(&COLOURS[one.class % COLOURS.len()]);
    };
    columns.clone().for_each(|x| [*rows.start(), *rows.end()].into_iter().for_each(|y| dot(x, y)));
    rows.for_each(|y| [*columns.start(), *columns.end()].into_iter().for_each(|x| dot(x, y)));
}
