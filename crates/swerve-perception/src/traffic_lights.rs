//! Traffic lights in the images of one camera: classified at known map positions, else detected by colour and shape.

#[cfg(test)]
mod tests;

use swerve_geom::{Ego, Point, Point2, Pose2, Transform, angle_between};
use swerve_msg::{CameraInfo, Extent, Image, Pixels, Signal, TrafficLight, TrafficLights};
use swerve_vision::Rgb;
use swerve_vision::traffic_light::{Head, Lamp, Light, LightFinder, LightSettings, Looker};

use crate::camera::{Shot, ShotError};
use crate::image_box::ImageCamera;

/// Traffic light of a map.
#[derive(Clone, PartialEq, Debug)]
pub struct LightPlace {
    /// Name of the light.
    pub name: String,
    /// Position; the heading is the driving direction of the traffic that it faces.
    pub pose: Pose2,
    /// Position of its stop line along the route, metres.
    pub stop_s_m: f64,
}

/// Geometry of traffic light heads, and filtering of their states.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Params {
    /// Width and height of a head, metres.
    pub head_m: [f64; 2],
    /// Height of the top of a head above the road, metres.
    pub top_m: f64,
    /// Detection range, metres.
    pub within_m: f64,
    /// Largest distance of a head from its place on the map, across the line of sight and in height, metres; 0: heads
    /// are at their places. Above 0, heads are searched, as without a map, and the nearest one belongs to the place.
    pub search_m: f64,
    /// Filtering of the state over frames.
    pub light: LightSettings,
}

impl Default for Params {
    fn default() -> Self {
        let light = LightSettings::default();
        Self { head_m: [0.34, 1.0], top_m: 3.4, within_m: 60.0, search_m: 0.0, light }
    }
}

impl Params {
    /// Validation errors: key, and expected range.
    pub fn problems(&self) -> Vec<(String, String)> {
        let [width_m, height_m] = self.head_m;
        let ranges = [
            ("head_m", width_m, [0.05, 5.0]),
            ("head_m", height_m, [0.05, 5.0]),
            ("top_m", self.top_m, [height_m, 20.0]),
            ("within_m", self.within_m, [1.0, 200.0]),
            ("search_m", self.search_m, [0.0, 30.0]),
            ("confirm_frames", f64::from(self.light.confirm_frames), [1.0, 1000.0]),
            ("forget_frames", f64::from(self.light.forget_frames), [1.0, 1000.0]),
        ];
        let wrong = ranges.into_iter().filter(|(_, value, [least, most])| !(*least..=*most).contains(value));
        wrong
            .map(|(key, value, [least, most])| {
                (key.to_owned(), format!("expected {least} to {most}, found {value}"))
            })
            .collect()
    }
}

/// Depth of a head, metres.
const DEEP_M: f64 = 0.2;
/// Smallest height of a head in the image, pixels.
const ROWS_MIN_PX: f64 = 6.0;
/// Range of the height of a head that is searched, relative to that of a head at its place.
const TALL: [f64; 2] = [0.5, 2.0];

/// Reports the states of traffic lights, image by image.
#[derive(Clone, Debug)]
pub struct LightWatch {
    params: Params,
    places: Vec<LightPlace>,
    /// State filter of each map position.
    lights: Vec<Light>,
    finder: LightFinder,
    looker: Looker,
    heads: Vec<Head>,
    /// Without a map: tracked lights with their last image box, and the number of images since then.
    followed: Vec<(Light, [f64; 4], u32)>,
}

impl LightWatch {
    /// Detector for the lights of a map; if the map has none, images are searched.
    pub fn new(params: Params, places: Vec<LightPlace>) -> Self {
        let lights = places.iter().map(|_| Light::new(params.light)).collect();
        let (finder, looker) = (LightFinder::default(), Looker::default());
        Self { params, places, lights, finder, looker, heads: Vec::new(), followed: Vec::new() }
    }

    /// Classifies the lights in an image and replaces the content of `out`.
    ///
    /// # Errors
    /// If the image has no colours, a size that does not match its bytes, or parallel rays.
    pub fn look(&mut self, shot: &Shot<'_>, out: &mut TrafficLights) -> Result<(), ShotError> {
        let Pixels::Rgb8(bytes) = &shot.image.pixels else { return Err(ShotError::NoColour) };
        if shot.image.camera.intrinsics.is_parallel {
            return Err(ShotError::Parallel);
        }
        let rgb = Rgb::new(shot.image.width_px as usize, shot.image.height_px as usize, bytes)?;
        out.stamp = shot.image.stamp;
        out.lights.clear();
        if self.places.is_empty() {
            self.search(rgb, &shot.image.camera, out);
        } else {
            self.look_at_places(rgb, shot, out);
        }
        Ok(())
    }

    fn look_at_places(&mut self, rgb: Rgb<'_>, shot: &Shot<'_>, out: &mut TrafficLights) {
        let camera = camera(shot.image, shot.pitch_rad);
        let searches = self.params.search_m > 0.0;
        if searches {
            self.heads.clear();
            self.finder.find(rgb, &mut self.heads);
        }
        for (place, light) in self.places.iter().zip(&mut self.lights) {
            let (image_px, seen) = if searches {
                self.params.nearest(&camera, shot.ego, place, &self.heads)
            } else {
                let image_px = self.params.picture(&camera, shot.ego, place);
                (image_px, image_px.and_then(|edges| self.looker.lit(rgb, edges)))
            };
            let shown = light.see(seen.map(|(lamp, _)| lamp));
            let Some(image_px) = image_px else { continue };
            out.lights.push(TrafficLight {
                name: Some(place.name.clone()),
                signal: shown.map(signal),
                seen: seen.map(|(lamp, _)| signal(lamp)),
                score: seen.map_or(0.0, |(_, share)| share),
                distance_m: shot.ego.point().distance(place.pose.point()),
                stop_s_m: Some(place.stop_s_m),
                image_px,
            });
        }
    }

    fn search(&mut self, rgb: Rgb<'_>, camera: &CameraInfo, out: &mut TrafficLights) {
        self.heads.clear();
        self.finder.find(rgb, &mut self.heads);
        self.followed.iter_mut().for_each(|(.., gone)| *gone += 1);
        for head in &self.heads {
            let height_px = head.edges_px[3] - head.edges_px[1];
            let distance_m = camera.ego_from_camera.origin().coords.x
                + camera.intrinsics.fy_px * self.params.head_m[1] / height_px;
            if height_px < ROWS_MIN_PX || distance_m > self.params.within_m {
                continue;
            }
            let is_same = |(_, last, gone): &(Light, [f64; 4], u32)| {
                *gone > 0 && middle(*last).distance(middle(head.edges_px)) < height_px
            };
            let known = self.followed.iter().position(is_same).unwrap_or_else(|| {
                self.followed.push((Light::new(self.params.light), head.edges_px, 0));
                self.followed.len() - 1
            });
            let (light, last, gone) = &mut self.followed[known];
            (*last, *gone) = (head.edges_px, 0);
            out.lights.push(TrafficLight {
                name: None,
                signal: light.see(Some(head.lamp)).map(signal),
                seen: Some(signal(head.lamp)),
                score: head.score,
                distance_m,
                stop_s_m: None,
                image_px: head.edges_px,
            });
        }
        let forget = self.params.light.forget_frames;
        self.followed.retain(|(.., gone)| *gone < forget);
    }
}

impl Params {
    /// Edges of the head nearest to a place in the image, with its lamp and score; without such a head, the edges of the
    /// part of the image in which it is searched. `None` if that is outside the image or too far away.
    fn nearest(
        &self,
        camera: &ImageCamera,
        ego: Pose2,
        place: &LightPlace,
        heads: &[Head],
    ) -> (Option<[f64; 4]>, Option<(Lamp, f64)>) {
        let far_m = ego.point().distance(place.pose.point());
        let at: Point2<Ego> = ego.to_local(place.pose.point());
        if far_m.is_nan() || far_m > self.within_m {
            return (None, None);
        }
        let middle_m = self.top_m - 0.5 * self.head_m[1];
        let part = |half_m: f64| {
            let extent = Extent { length_m: DEEP_M, width_m: 2.0 * half_m, height_m: 2.0 * half_m };
            // A head that is searched may face any way: the part of the image is across the line of sight.
            camera.image_px(Pose2::new(at.x_m, at.y_m, 0.0), middle_m - half_m, extent)
        };
        let Some(around) = part(self.search_m) else { return (None, None) };
        let expected_px = camera.info.intrinsics.fy_px * self.head_m[1] / far_m.max(1.0);
        let center = middle(part(0.01).unwrap_or(around));
        let may_be = |head: &&Head| {
            let (at, height_px) = (middle(head.edges_px), head.edges_px[3] - head.edges_px[1]);
            let is_around =
                (around[0]..=around[2]).contains(&at.x_m) && (around[1]..=around[3]).contains(&at.y_m);
            let [least, most] = TALL.map(|share| share * expected_px);
            is_around && height_px >= ROWS_MIN_PX && (least..=most).contains(&height_px)
        };
        let off_px = |head: &Head| middle(head.edges_px).distance(center);
        let found = heads.iter().filter(may_be).min_by(|a, b| off_px(a).total_cmp(&off_px(b)));
        let seen = found.map(|head| (head.lamp, head.score));
        (Some(found.map_or(around, |head| head.edges_px)), seen)
    }

    /// Left, top, right and bottom edge of a light's head in an image; `None` if it is too far away, too small,
    /// clipped, or seen from behind.
    fn picture(&self, camera: &ImageCamera, ego: Pose2, place: &LightPlace) -> Option<[f64; 4]> {
        let far_m = ego.point().distance(place.pose.point());
        if far_m.is_nan() || far_m > self.within_m {
            return None;
        }
        let at: Point2<Ego> = ego.to_local(place.pose.point());
        let there = Pose2::new(at.x_m, at.y_m, angle_between(ego.heading_rad, place.pose.heading_rad));
        let [width_m, height_m] = self.head_m;
        let extent = Extent { length_m: DEEP_M, width_m, height_m };
        let [left, top, right, bottom] = camera.image_px(there, self.top_m - height_m, extent)?;
        let is_whole = left > 0.0
            && top > 0.0
            && right < f64::from(camera.width_px)
            && bottom < f64::from(camera.height_px);
        let faces_us = there.heading_rad.abs() < core::f64::consts::FRAC_PI_2;
        (is_whole && faces_us && bottom - top >= ROWS_MIN_PX).then_some([left, top, right, bottom])
    }
}

/// Camera of an image on a body with this pitch, nose down positive.
fn camera(image: &Image, pitch_rad: f64) -> ImageCamera {
    let tilt: Transform<Ego, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, pitch_rad, 0.0);
    let mount = image.camera.ego_from_camera;
    let ego_from_camera = Transform::new(mount.origin(), (tilt * mount).rotation());
    let info = CameraInfo { ego_from_camera, ..image.camera };
    ImageCamera { info, width_px: image.width_px, height_px: image.height_px }
}

fn middle([left, top, right, bottom]: [f64; 4]) -> Point2 {
    Point2::new(0.5 * (left + right), 0.5 * (top + bottom))
}

fn signal(lamp: Lamp) -> Signal {
    match lamp {
        Lamp::Green => Signal::Green,
        Lamp::Yellow => Signal::Yellow,
        Lamp::Red => Signal::Red,
    }
}
