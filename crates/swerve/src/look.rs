//! `swerve look`: perception on images without neural networks, one file per mode.

mod lamps;
mod lanes;
mod objects;
mod segmentation;
mod signs;
mod stereo;

use std::path::PathBuf;

use clap::ArgGroup;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_measure::picture::MEGAPIXELS_MAX;
use swerve_vision::lanes::Method;

/// `swerve look`.
#[derive(clap::Args, Debug)]
#[command(group = ArgGroup::new("mode").required(true).args(["detector", "lanes", "segmentation", "signs", "stereo", "traffic_light"]))]
pub(crate) struct LookArgs {
    /// Images (PNG, JPEG), or folders of images
    #[arg(required_unless_present = "stereo", conflicts_with = "stereo")]
    images: Vec<PathBuf>,
    /// Detect objects with the built-in detector of this name or with a file of weights
    #[arg(long, value_name = "NAME")]
    detector: Option<String>,
    /// Find the lines of the ego lane, in metres on the road [default method: ridge]
    #[arg(long, value_name = "METHOD", num_args = 0..=1, require_equals = true, default_missing_value = "ridge", value_parser = method)]
    lanes: Option<Method>,
    /// Label all pixels with the built-in weights of this name or with a file of weights [default: street]
    #[arg(long, value_name = "NAME", num_args = 0..=1, default_missing_value = "street", requires = "fov")]
    segmentation: Option<String>,
    /// Find stop signs, no-entry signs and speed limits, and read the limits
    #[arg(long)]
    signs: bool,
    /// Compute the disparity of each pixel of the left image of a rectified pair
    #[arg(long, num_args = 2, value_names = ["LEFT", "RIGHT"], requires = "out")]
    stereo: Option<Vec<PathBuf>>,
    /// Classify the lit lamp in crops around traffic light heads
    #[arg(long)]
    traffic_light: bool,
    /// Detector rung, from fast to good [default: the last that the camera allows]
    #[arg(long, requires = "detector")]
    rung: Option<String>,
    /// Minimum probability of the reported objects, and of a head in the crops of --traffic-light
    #[arg(long, value_name = "0..1", default_value_t = 0.5, allow_negative_numbers = true, value_parser = least)]
    least: f64,
    /// Horizontal field of view, degrees; objects and lines are placed on flat ground
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = fov)]
    fov: Option<f64>,
    /// Height of the camera above the ground, m
    #[arg(long, value_name = "M", default_value_t = 1.35, allow_negative_numbers = true, value_parser = height)]
    height: f64,
    /// Pitch of the camera of --lanes, degrees, positive downwards; a road within 2.6 degrees of it is found [default: not
    /// known, within 6 degrees of level]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = pitch)]
    pitch: Option<f64>,
    /// Calibration for --lanes in place of --fov, as in OpenCV: fx,fy,cx,cy and optionally the lens, k1,k2,p1,p2,k3
    #[arg(
        long,
        value_name = "PX,...",
        value_delimiter = ',',
        allow_negative_numbers = true,
        conflicts_with = "fov"
    )]
    calibration: Vec<f64>,
    /// Number of disparities searched, a multiple of 16
    #[arg(long, value_name = "N", default_value_t = 64)]
    disparities: usize,
    /// Largest image accepted, millions of pixels; a detector needs about 120 bytes per pixel
    #[arg(long, value_name = "MP", default_value_t = MEGAPIXELS_MAX, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    megapixels: u32,
    /// Print one JSON object per image
    #[arg(long)]
    json: bool,
    /// Folder for the annotated images; for --stereo, the file of disparities (PFM)
    #[arg(long, value_name = "PATH", conflicts_with = "traffic_light")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

/// Runs `swerve look`.
pub(crate) fn run(args: &LookArgs) -> anyhow::Result<()> {
    if let Some(detector) = &args.detector {
        objects::run(args, detector)
    } else if let Some(method) = args.lanes {
        lanes::run(args, method)
    } else if let Some(weights) = &args.segmentation {
        segmentation::run(args, weights)
    } else if let Some(pair) = &args.stereo {
        stereo::run(args, pair)
    } else if args.signs {
        signs::run(args)
    } else {
        lamps::run(args)
    }
}

fn method(text: &str) -> Result<Method, String> {
    let names = Method::ALL.map(Method::name);
    let found = Method::ALL.into_iter().find(|method| method.name() == text);
    found.ok_or_else(|| {
        format!("expected {}{}", swerve_text::list(&names), swerve_text::did_you_mean(text, names))
    })
}

fn number(text: &str, least: f64, most: f64, expected: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(value) if (least..=most).contains(&value) => Ok(value),
        _ => Err(format!("expected {expected}")),
    }
}

fn least(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1.0, "0 to 1")
}

fn fov(text: &str) -> Result<f64, String> {
    number(text, 1.0, 170.0, "1 to 170 degrees")
}

fn height(text: &str) -> Result<f64, String> {
    number(text, f64::MIN_POSITIVE, 100.0, "metres above 0 and at most 100")
}

fn pitch(text: &str) -> Result<f64, String> {
    number(text, -45.0, 45.0, "-45 to 45 degrees")
}
