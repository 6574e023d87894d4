//! Labels of simulated frames: boxes of objects, and classes of pixels.

use serde::Deserialize;
use swerve_geom::{Ego, Point2, Pose2};
use swerve_msg::truth::Surroundings;
use swerve_msg::{DetectedBox, Obstacle};
use swerve_perception::image_box::ImageCamera;
use swerve_scene::SemanticClass;

/// Minimum visible share of an object for which a detection is expected (KITTI: partly occluded).
pub const VISIBLE_SHARE_MIN: f64 = 1.0 / 3.0;

/// Box that a perfect detector would report.
pub fn true_box(obstacle: &Obstacle, seen: &Surroundings, camera: Option<&ImageCamera>) -> DetectedBox {
    let at: Point2<Ego> = seen.ego.to_local(obstacle.pose.point());
    let pose = Pose2::new(at.x_m, at.y_m, obstacle.pose.heading_rad - seen.ego.heading_rad);
    let image_px = camera.and_then(|camera| camera.image_px(pose, 0.0, obstacle.extent));
    DetectedBox {
        kind: obstacle.kind,
        score: 1.0,
        pose,
        bottom_m: 0.0,
        extent: obstacle.extent,
        image_px,
        covariance_m2: None,
        radial_speed_mps: None,
    }
}

/// Class of pixels in the recipe of a segmentation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PixelClass {
    /// Name of the class.
    pub name: String,
    /// Cityscapes names of its labels; masks have the id of the first.
    pub labels: Vec<String>,
}

impl PixelClass {
    /// Cityscapes ids of its labels.
    pub fn ids(&self) -> impl Iterator<Item = u8> {
        self.labels.iter().filter_map(|name| cityscapes_id(name))
    }
}

/// Cityscapes id of a class by its name.
pub fn cityscapes_id(name: &str) -> Option<u8> {
    SemanticClass::ALL.iter().find(|class| class.name() == name).map(|class| *class as u8)
}

/// For each Cityscapes id, the id in masks of the built-in segmentation `street`; 0 for ids without a class.
pub fn street_mask_of() -> [u8; 256] {
    #[derive(Deserialize)]
    struct Classes {
        class: Vec<PixelClass>,
    }
    let mut mask_of = [0; 256];
    for class in &swerve_text::built_in::<Classes>(swerve_vision::shipped::STREET_CLASSES).class {
        let mask = class.ids().next().unwrap_or_default();
        class.ids().for_each(|id| mask_of[usize::from(id)] = mask);
    }
    mask_of
}
