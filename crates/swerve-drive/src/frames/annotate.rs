//! Lines and text over a rendered image.

use core::convert::Infallible;

use embedded_graphics::mono_font::ascii::{FONT_9X18_BOLD, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor as _};
use embedded_graphics::prelude::{
    DrawTarget, Drawable as _, OriginDimensions, Pixel, Point as At, Primitive as _, Size,
};
use embedded_graphics::primitives::{Line, PrimitiveStyle, Rectangle};
use embedded_graphics::text::Text;
use swerve_camera::{Camera, Frame};
use swerve_core::Time;
use swerve_geom::{Ego, Map, Point, Transform};
use swerve_msg::truth::WorldState;
use swerve_msg::{
    ActorKind, ActorNames, Detections, Lanes, Obstacle, ObstacleList, Plan, Signal, TrafficLights,
};

use super::overlay::Sheet;

const PLAN: Rgb888 = Rgb888::new(60, 230, 120);
const FALLBACK: Rgb888 = Rgb888::new(255, 170, 40);
const BOX: Rgb888 = Rgb888::new(80, 190, 255);
const PERSON: Rgb888 = Rgb888::new(255, 90, 200);
const FOUND: Rgb888 = Rgb888::new(255, 235, 60);
const LANE: Rgb888 = Rgb888::new(40, 220, 255);
const ALARM: Rgb888 = Rgb888::new(225, 40, 40);
/// Height at which the plan is drawn over the road, metres.
const PLAN_UP_M: f64 = 0.05;
/// Longest straight piece of a line over the ground, metres, so that lines are clipped at the image border.
const PIECE_M: f64 = 1.0;

/// An image and its camera.
pub(super) struct Canvas<'a> {
    frame: &'a mut Frame,
    camera: &'a Camera,
    camera_from_map: Transform<swerve_geom::Camera, Map>,
    /// Rectangles of the labels drawn so far.
    taken: Vec<Rectangle>,
}

impl<'a> Canvas<'a> {
    pub(super) fn new(
        frame: &'a mut Frame,
        camera: &'a Camera,
        camera_from_map: Transform<swerve_geom::Camera, Map>,
    ) -> Self {
        Self { frame, camera, camera_from_map, taken: Vec::new() }
    }

    /// Draws the rest of a plan over the road; orange for a fallback plan.
    pub(super) fn plan(&mut self, plan: &Plan, now: Time) {
        let colour = if plan.status.is_fallback() { FALLBACK } else { PLAN };
        let ahead: Vec<_> = plan.points.iter().filter(|p| p.at >= now).map(|p| p.pose).collect();
        for pair in ahead.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|p| [p.x_m, p.y_m, PLAN_UP_M]);
            self.segment(a, b, (colour, 4));
        }
    }

    /// Draws the lane lines over the road, over the range in which they were detected.
    pub(super) fn lanes(&mut self, lanes: &Lanes, map_from_ego: Transform<Map, Ego>) {
        for line in [lanes.left, lanes.right].into_iter().flatten() {
            let place = |[x, y]: [f64; 2]| (map_from_ego * Point::new(x, y, PLAN_UP_M)).coords.into();
            let places: Vec<[f64; 3]> = line.places().map(place).collect();
            places.windows(2).for_each(|pair| self.segment(pair[0], pair[1], (LANE, 3)));
        }
    }

    /// Draws the obstacle sensor's report as boxes with name and distance.
    pub(super) fn obstacles(&mut self, list: &ObstacleList, world: &WorldState, names: &ActorNames) {
        for obstacle in &list.obstacles {
            let colour = if obstacle.kind == ActorKind::Pedestrian { PERSON } else { BOX };
            let corners = corners(obstacle);
            for k in 0..4 {
                let next = (k + 1) % 4;
                self.segment(corners[k], corners[next], (colour, 2));
                self.segment(corners[4 + k], corners[4 + next], (colour, 2));
                self.segment(corners[k], corners[4 + k], (colour, 2));
            }
            let ego = world.ego.state.pose.point();
            let name = names.get(&obstacle.id).cloned();
            let name = name.unwrap_or_else(|| format!("{:?}", obstacle.kind).to_lowercase());
            let words = format!("{name} {:.0} m", ego.distance(obstacle.pose.point()));
            let top = [obstacle.pose.x_m, obstacle.pose.y_m, obstacle.extent.height_m + 0.25];
            if let Some([x, y]) = self.pixel(top) {
                self.label(At::new(x as i32 - (9 * words.len() / 2) as i32, y as i32), &words, colour);
            }
        }
    }

    /// Draws the detections in this image as rectangles with class and score.
    pub(super) fn found(&mut self, found: &Detections) {
        for one in &found.boxes {
            let Some(edges) = one.image_px else { continue };
            self.rectangle(edges, &format!("{:?} {:.2}", one.kind, one.score).to_lowercase(), FOUND);
        }
    }

    /// Draws the traffic lights in this image as rectangles with score and distance.
    pub(super) fn lights(&mut self, seen: &TrafficLights) {
        for light in &seen.lights {
            let [r, g, b] = light.signal.map_or([255; 3], Signal::rgb);
            self.rectangle(light.image_px, &light.words(), Rgb888::new(r, g, b));
        }
    }

    /// Draws a rectangle, edges in pixels, with a label.
    fn rectangle(&mut self, edges: [f64; 4], words: &str, colour: Rgb888) {
        let [left, top, right, bottom] = edges.map(|px| px.round() as i32);
        let size = Size::new((right - left).max(1) as u32, (bottom - top).max(1) as u32);
        let style = PrimitiveStyle::with_stroke(colour, 2);
        let Ok(()) = Rectangle::new(At::new(left, top), size).into_styled(style).draw(self);
        self.label(At::new(left, top - 4), words, colour);
    }

    /// Draws the header: title, time, speed and events.
    pub(super) fn head(&mut self, title: &str, world: &WorldState, plan: Option<&Plan>) {
        let speed = world.ego.state.speed_mps;
        let status = plan.map_or_else(String::new, |plan| format!("  plan {:?}", plan.status).to_lowercase());
        let now = format!("{:5.2} s  {speed:4.1} m/s{status}", world.stamp.as_secs());
        self.words(At::new(14, 30), title, Rgb888::WHITE);
        self.words(At::new(14, 54), &now, Rgb888::WHITE);
        if let Some((_, collision)) = world.collisions_of_ego().next() {
            let words = format!("COLLISION at {:.1} m/s", collision.speeds_mps[0]);
            self.words(At::new(14, 78), &words, ALARM);
        } else if !world.infractions.is_empty() {
            self.words(At::new(14, 78), "LEFT THE ROAD", ALARM);
        }
    }

    /// Draws text on a dark plate, readable on any background; the position is the left end of the baseline.
    fn words(&mut self, at: At, text: &str, colour: Rgb888) {
        self.plate(at, text, (&FONT_10X20, colour));
    }

    /// Draws a label over a box, above existing labels.
    fn label(&mut self, mut at: At, text: &str, colour: Rgb888) {
        let font = &FONT_9X18_BOLD;
        while let Some(other) = self.taken.iter().find(|other| meet(**other, plate_of(at, text, font))) {
            let above =
                other.top_left.y - plate_of(at, text, font).bottom_right().map_or(at.y, |end| end.y) - 1;
            at.y += above.min(-1);
        }
        self.taken.push(plate_of(at, text, font));
        self.plate(at, text, (font, colour));
    }

    fn plate(&mut self, at: At, text: &str, (font, colour): (&MonoFont<'_>, Rgb888)) {
        let plate = plate_of(at, text, font);
        let (width, height) = (self.frame.width_px as i32, self.frame.height_px as i32);
        let within =
            |from: i32, size: u32, most: i32| from.clamp(0, most)..(from + size as i32).clamp(0, most);
        for y in within(plate.top_left.y, plate.size.height, height) {
            for x in within(plate.top_left.x, plate.size.width, width) {
                let start = 3 * (y * width + x) as usize;
                self.frame.rgb[start..start + 3].iter_mut().for_each(|c| *c /= 5);
            }
        }
        let Ok(_) = Text::new(text, at, MonoTextStyle::new(font, colour)).draw(self);
    }

    /// Projects a point of the map to the image, pixels.
    fn pixel(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 2]> {
        let [column, row] = self.camera.project(self.camera_from_map * Point::new(x, y, z))?;
        let near = |value: f64, size: usize| value.abs() < 4.0 * size as f64;
        (near(column, self.frame.width_px) && near(row, self.frame.height_px)).then_some([column, row])
    }

    /// Draws a straight line in the map, in pieces, so that the parts behind the camera are left out.
    fn segment(&mut self, a: [f64; 3], b: [f64; 3], (colour, width): (Rgb888, u32)) {
        let length = swerve_geom::math::hypot(b[0] - a[0], b[1] - a[1]).max((b[2] - a[2]).abs());
        let n = (length / PIECE_M).ceil().clamp(1.0, 200.0) as usize;
        let at = |k: usize| {
            let u = k as f64 / n as f64;
            [0, 1, 2].map(|i| a[i] + u * (b[i] - a[i]))
        };
        for k in 0..n {
            if let (Some(from), Some(to)) = (self.pixel(at(k)), self.pixel(at(k + 1))) {
                let [from, to] = [from, to].map(|[x, y]| At::new(x as i32, y as i32));
                let Ok(()) =
                    Line::new(from, to).into_styled(PrimitiveStyle::with_stroke(colour, width)).draw(self);
            }
        }
    }
}

/// Plate behind text whose baseline starts at a position.
fn plate_of(at: At, text: &str, font: &MonoFont<'_>) -> Rectangle {
    const AROUND: i32 = 3;
    let letter = font.character_size;
    let width = letter.width * text.chars().count() as u32;
    let top_left = At::new(at.x - AROUND, at.y - font.baseline as i32 - AROUND);
    Rectangle::new(top_left, Size::new(width, letter.height) + Size::new_equal(2 * AROUND as u32))
}

fn meet(a: Rectangle, b: Rectangle) -> bool {
    !a.intersection(&b).is_zero_sized()
}

/// Corners of a box: four on the ground, then the four above them.
fn corners(obstacle: &Obstacle) -> [[f64; 3]; 8] {
    let footprint = obstacle.extent.footprint(obstacle.pose).corners();
    core::array::from_fn(|k| {
        let corner = footprint[k % 4];
        [corner.x_m, corner.y_m, if k < 4 { 0.0 } else { obstacle.extent.height_m }]
    })
}

impl OriginDimensions for Canvas<'_> {
    fn size(&self) -> Size {
        Size::new(self.frame.width_px as u32, self.frame.height_px as u32)
    }
}

impl DrawTarget for Canvas<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        let size = self.size();
        Sheet { rgb: &mut self.frame.rgb, size }.draw_iter(pixels)
    }
}
