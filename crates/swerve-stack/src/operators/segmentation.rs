//! Semantic segmentation of a camera's images.

use anyhow::anyhow;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::{Image, Pixels};
use swerve_vision::acf::Ground;
use swerve_vision::segmentation::{Segmenter, Weights};
use swerve_vision::{Rgb, shipped};

use crate::config::camera_detectors::ground;
use crate::config::domain::Domain;
use crate::kind::{Heavy, Kind, Node};
use crate::problems::KeyProblems;
use crate::site::Site;

/// Labels the pixels of each image of a camera, without neural networks.
pub(super) struct Segmentation {
    weights: Weights,
    /// Segmenter for the size and the camera of the last image.
    segmenter: Option<([usize; 2], Ground, Segmenter)>,
}

/// Keys of segmentation.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Table {
    /// Name of built-in weights.
    weights: String,
}

impl Default for Table {
    fn default() -> Self {
        Self { weights: "street".into() }
    }
}

impl Table {
    fn weights(&self) -> Result<Weights, String> {
        let names: Vec<&str> = shipped::segmentations().collect();
        let near = swerve_text::did_you_mean(&self.weights, names.iter().copied());
        let found = shipped::segmentation(&self.weights).ok_or_else(|| {
            format!("expected {}, found `{}`{near}", swerve_text::list(&names), self.weights)
        })?;
        found.map_err(|error| error.to_string())
    }
}

/// Image to process.
#[derive(Inputs)]
pub(super) struct In {
    /// Colour image of the camera.
    image: At<Image>,
}

impl Kind for Segmentation {
    const NODE: Node =
        Node::new("segmentation", "road, sidewalk, buildings, people and more, pixel by pixel")
            .heavy(Heavy::Yes)
            .on_ladder();
    type Table = Table;

    fn problems(table: &Table) -> KeyProblems {
        table.weights().err().map(|message| ("weights".to_owned(), message)).into_iter().collect()
    }

    fn domain(table: &Table) -> Option<Domain> {
        Domain::built_in("segmentation", &table.weights)
    }

    fn new(table: Table, _: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self { weights: table.weights().map_err(|message| anyhow!(message))?, segmenter: None })
    }
}

impl Operator for Segmentation {
    type In = In;
    type Out = Port<Image>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Port<Image>) {
        let Some(image) = input.image.get() else { return };
        match self.labels(image) {
            Ok(labels) => out.send(Image { pixels: Pixels::ClassU8(labels.into()), ..(**image).clone() }),
            Err(message) => cx.stop_run(format!("{}: {message}", cx.name())),
        }
    }
}

impl Segmentation {
    /// Cityscapes id of each pixel.
    fn labels(&mut self, image: &Image) -> Result<Vec<u8>, String> {
        let Pixels::Rgb8(bytes) = &image.pixels else {
            return Err("expected an image in colour; `reads = { image = \"CAMERA.rgb\" }` names one".into());
        };
        let size = [image.width_px as usize, image.height_px as usize];
        let ground = ground(&image.camera);
        if !self.segmenter.as_ref().is_some_and(|(of, seen_by, _)| (*of, *seen_by) == (size, ground)) {
            self.segmenter = Some((size, ground, Segmenter::new(self.weights.clone(), size, ground)));
        }
        let mut labels = vec![0; size[0] * size[1]];
        if let Some((.., segmenter)) = &mut self.segmenter {
            let rgb = Rgb::new(size[0], size[1], bytes).map_err(|error| error.to_string())?;
            segmenter.segment(rgb, &mut labels).map_err(|error| error.to_string())?;
        }
        Ok(labels)
    }
}

#[cfg(test)]
mod tests {
    use swerve_msg::{CameraInfo, Intrinsics};

    use super::*;

    fn image(pixels: Pixels, [width_px, height_px]: [u32; 2], pitch_rad: f64) -> Image {
        let intrinsics =
            Intrinsics { fx_px: 60.0, fy_px: 60.0, cx_px: 32.0, cy_px: 24.0, ..Intrinsics::default() };
        let ego_from_camera = swerve_camera::mount([1.0, 0.0, 1.35], 0.0, pitch_rad, 0.0);
        Image {
            stamp: Default::default(),
            width_px,
            height_px,
            camera: CameraInfo { intrinsics, ego_from_camera },
            pixels,
        }
    }

    #[test]
    fn segmentation_labels_any_size_and_reports_unusable_images() {
        let weights = Table::default().weights().unwrap();
        let mut operator = Segmentation { weights, segmenter: None };
        for size in [[64, 48], [1, 1], [64, 48], [32, 24]] {
            let n = (size[0] * size[1]) as usize;
            let labels = operator.labels(&image(Pixels::Rgb8(vec![90; 3 * n].into()), size, 0.0)).unwrap();
            let known = [7, 8, 11, 21, 23, 24, 26, 0];
            assert!(labels.len() == n && labels.iter().all(|id| known.contains(id)), "{size:?}");
        }
        let told = |pixels| operator.labels(&image(pixels, [2, 1], 0.0)).unwrap_err();
        let mut told = told;
        assert!(told(Pixels::DepthF32M(vec![1.0; 2].into())).starts_with("expected an image in colour"));
        assert!(told(Pixels::Rgb8(vec![0; 5].into())).starts_with("5 numbers for an image of 2 x 1"));
        let table = Table { weights: "stret".into() };
        assert_eq!(
            table.weights().unwrap_err(),
            "expected \"street\", found `stret`; did you mean `street`?"
        );
    }
}
