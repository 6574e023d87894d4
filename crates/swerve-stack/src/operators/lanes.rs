//! Lines of the ego's lane in a camera's images.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::{CameraInfo, Image, LaneLine, Lanes, Pixels};
use swerve_vision::Rgb;
use swerve_vision::lanes::{LaneFinder, LaneSettings, Method, RoadCamera};

use crate::kind::{Heavy, Kind, Node};
use crate::problems::KeyProblems;
use crate::site::Site;

/// Detects lines in each image, without neural networks.
pub(super) struct LaneLines {
    settings: LaneSettings,
    /// Finder for the camera of the images.
    finder: Option<([u32; 2], CameraInfo, LaneFinder)>,
}

/// Its keys in `[operator.NAME]`.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Table {
    method: MethodName,
    mark_m: f64,
    reach_m: f64,
    pitch_deviation_deg: f64,
    width_m: [f64; 2],
}

/// Method of detecting marks.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum MethodName {
    Hough,
    Ridge,
}

impl Default for Table {
    fn default() -> Self {
        let LaneSettings { mark_m, reach_m, pitch_deviation_rad, width_m, .. } = LaneSettings::default();
        let pitch_deviation_deg = (pitch_deviation_rad.to_degrees() * 100.0).round() / 100.0;
        Self { method: MethodName::Ridge, mark_m, reach_m, pitch_deviation_deg, width_m }
    }
}

impl Table {
    fn settings(&self) -> LaneSettings {
        LaneSettings {
            method: match self.method {
                MethodName::Hough => Method::Hough,
                MethodName::Ridge => Method::Ridge,
            },
            mark_m: self.mark_m,
            reach_m: self.reach_m,
            pitch_deviation_rad: self.pitch_deviation_deg.to_radians(),
            width_m: self.width_m,
        }
    }
}

/// Image to process.
#[derive(Inputs)]
pub(super) struct In {
    /// Colour image.
    image: At<Image>,
}

impl Kind for LaneLines {
    const NODE: Node =
        Node::new("lanes", "the lines of the ego's lane in a camera's images").heavy(Heavy::Yes);
    type Table = Table;

    fn problems(table: &Table) -> KeyProblems {
        let told = table.settings().validate().err();
        let problem = |e: swerve_core::ParamError| match &*e.key {
            "pitch_deviation_rad" => (
                "pitch_deviation_deg".to_owned(),
                format!("expected 0.006 to 2.8 degrees, found {}", table.pitch_deviation_deg),
            ),
            key => (key.to_owned(), format!("expected {}, found {}", e.expected, e.value)),
        };
        told.map(problem).into_iter().collect()
    }

    fn new(table: Table, _: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self { settings: table.settings(), finder: None })
    }
}

impl Operator for LaneLines {
    type In = In;
    type Out = Port<Lanes>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Port<Lanes>) {
        let Some(image) = input.image.get() else { return };
        match self.find(image) {
            Ok(lanes) => out.send(lanes),
            Err(why) => cx.stop_run(format!("operator.{}: {why}", cx.name())),
        }
    }
}

impl LaneLines {
    fn find(&mut self, image: &Image) -> Result<Lanes, String> {
        let Pixels::Rgb8(bytes) = &image.pixels else {
            return Err(format!("expected images in colours, found {:?}", image.encoding()));
        };
        let size_px = [image.width_px, image.height_px];
        if self.finder.as_ref().is_none_or(|(of, camera, _)| (*of, *camera) != (size_px, image.camera)) {
            let finder = LaneFinder::new(road_camera(size_px, &image.camera)?, self.settings);
            self.finder = Some((size_px, image.camera, finder.map_err(|e| e.to_string())?));
        }
        let rgb = Rgb::new(size_px[0] as usize, size_px[1] as usize, bytes).map_err(|e| e.to_string())?;
        let Some((.., finder)) = &mut self.finder else { return Ok(Lanes::default()) };
        let found = finder.find(rgb).map_err(|e| e.to_string())?;
        let line = |line: swerve_vision::lanes::LaneLine| LaneLine {
            coefficients: line.coefficients,
            covariance: line.covariance,
            seen_m: line.seen_m,
        };
        let (left, right) = (found.left.map(line), found.right.map(line));
        Ok(Lanes { stamp: image.stamp, left, right, pitch_rad: found.pitch_rad })
    }
}

fn road_camera(size_px: [u32; 2], camera: &CameraInfo) -> Result<RoadCamera, String> {
    let lens = camera.intrinsics;
    if lens.is_parallel {
        return Err("expected a camera with a lens, found parallel rays".to_owned());
    }
    Ok(RoadCamera {
        size_px: size_px.map(|px| px as usize),
        focal_px: [lens.fx_px, lens.fy_px],
        center_px: [lens.cx_px, lens.cy_px],
        distortion: lens.distortion,
        ego_from_camera: camera.ego_from_camera,
    })
}

#[cfg(test)]
mod tests {
    use swerve_msg::{Encoding, Intrinsics};

    use super::*;

    fn found(image: &Image) -> Result<Lanes, String> {
        LaneLines { settings: LaneSettings::default(), finder: None }.find(image)
    }

    #[test]
    fn lane_finder_reports_unusable_images() {
        let mut image = Image::new(64, 48, Encoding::Rgb8);
        let lens = Intrinsics { fx_px: 50.0, fy_px: 50.0, cx_px: 32.0, cy_px: 24.0, ..Intrinsics::default() };
        image.camera.intrinsics = lens;
        assert!(found(&image).unwrap_err().starts_with("`camera height` is 0, expected 0.1 to 100 m"));
        image.camera.ego_from_camera = RoadCamera::looking_ahead(1.3, 0.0);
        let nothing = Lanes { stamp: image.stamp, ..Lanes::default() };
        assert_eq!(found(&image), Ok(nothing));
        image.camera.intrinsics.is_parallel = true;
        assert_eq!(found(&image).unwrap_err(), "expected a camera with a lens, found parallel rays");
        image.camera.intrinsics = Intrinsics { fx_px: f64::NAN, ..lens };
        assert!(found(&image).unwrap_err().starts_with("`focal length across` is NaN"));
        image.camera.intrinsics = lens;
        image.width_px = 65;
        assert_eq!(found(&image).unwrap_err(), "9216 numbers for an image of 65 x 48 pixels, expected 9360");
        image.reset(64, 48, Encoding::DepthF32M);
        assert_eq!(found(&image).unwrap_err(), "expected images in colours, found DepthF32M");
    }

    #[test]
    fn keys_out_of_range_are_reported_in_their_unit() {
        let table = Table { pitch_deviation_deg: 5.0, ..Table::default() };
        let told = LaneLines::problems(&table);
        assert_eq!(told[0].1, "expected 0.006 to 2.8 degrees, found 5");
        assert!(LaneLines::problems(&Table::default()).is_empty());
    }
}
