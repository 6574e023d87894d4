//! Camera images: pixels, calibration, and overlays of the stack's estimates.
//!
//! Pixel coordinates start at the upper left corner of the upper left pixel, both in Foxglove and in
//! [`Intrinsics`].

use foxglove::Decode as _;
use foxglove::messages::points_annotation::Type as Points;
use foxglove::messages::{
    CameraCalibration, Color, CompressedImage, ImageAnnotations, Point2, PointsAnnotation, RawImage,
    TextAnnotation,
};
use jpeg_encoder::{ColorType, Encoder};
use swerve_core::Time;
use swerve_geom::{Camera, Map, Point, Pose2, Transform};
use swerve_msg::{ActorKind, CameraInfo, Detections, Extent, Intrinsics, Signal, TrafficLights};

use crate::form::{colour, colour_of, frame_of, name_of, timestamp};
use crate::scene::box_edges;
use crate::setup::ImageForm;

/// Near plane of overlays, metres.
const NEAR_M: f64 = 0.1;
/// Number of segments that approximate a straight edge under lens distortion.
const PIECES: usize = 8;

/// Metadata of an image.
#[derive(Clone, Debug)]
pub(crate) struct Header {
    pub(crate) camera: String,
    pub(crate) stamp: Time,
    pub(crate) width_px: u32,
    pub(crate) height_px: u32,
    pub(crate) info: CameraInfo,
}

/// Encodes an RGB image, three bytes per pixel.
pub(crate) fn colours(header: &Header, rgb: &[u8], form: ImageForm) -> Option<CompressedImage> {
    let (data, format) = match form {
        ImageForm::Jpeg(quality) => (jpeg(rgb, header.width_px, header.height_px, quality)?, "jpeg"),
        ImageForm::Png => (png(header, rgb)?, "png"),
    };
    Some(CompressedImage {
        timestamp: Some(timestamp(header.stamp)),
        frame_id: frame_of(&header.camera),
        data: data.into(),
        format: format.into(),
    })
}

/// Stamp and file content (JPEG or PNG) of a logged `foxglove.CompressedImage`; `None` for other messages.
pub fn logged_image(message: &[u8]) -> Option<(Time, Vec<u8>)> {
    let image = CompressedImage::decode(message).ok()?;
    let at = image.timestamp?;
    let ns = i64::from(at.sec()).checked_mul(1_000_000_000)?.checked_add(i64::from(at.nsec()))?;
    Some((Time::from_ns(ns), image.data.into()))
}

/// Encodes an RGB image, three bytes per pixel, as JPEG with a quality from 1 to 100; `None` if it is too large for
/// JPEG or has the wrong number of bytes.
pub fn jpeg(rgb: &[u8], width_px: u32, height_px: u32, quality: u8) -> Option<Vec<u8>> {
    let (width, height) = (u16::try_from(width_px).ok()?, u16::try_from(height_px).ok()?);
    let mut data = Vec::with_capacity(rgb.len() / 8);
    Encoder::new(&mut data, quality).encode(rgb, width, height, ColorType::Rgb).ok()?;
    Some(data)
}

fn png(header: &Header, rgb: &[u8]) -> Option<Vec<u8>> {
    let mut data = Vec::with_capacity(rgb.len() / 2);
    let mut encoder = png::Encoder::new(&mut data, header.width_px, header.height_px);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(rgb).ok()?;
    writer.finish().ok()?;
    Some(data)
}

/// Raw image with one value per pixel; `encoding` is Foxglove's name.
pub(crate) fn raw(header: &Header, encoding: &str, bytes: Vec<u8>) -> RawImage {
    let rows = header.height_px.max(1) as usize;
    RawImage {
        timestamp: Some(timestamp(header.stamp)),
        frame_id: frame_of(&header.camera),
        width: header.width_px,
        height: header.height_px,
        encoding: encoding.into(),
        step: (bytes.len() / rows) as u32,
        data: bytes.into(),
    }
}

/// Calibration with the distortion model "plumb_bob", which is that of [`Intrinsics`]; `None` for an orthographic
/// camera.
pub(crate) fn calibration(header: &Header) -> Option<CameraCalibration> {
    let Intrinsics { fx_px, fy_px, cx_px, cy_px, distortion, is_parallel } = header.info.intrinsics;
    (!is_parallel).then(|| CameraCalibration {
        timestamp: Some(timestamp(header.stamp)),
        frame_id: frame_of(&header.camera),
        width: header.width_px,
        height: header.height_px,
        distortion_model: "plumb_bob".into(),
        d: distortion.to_vec(),
        k: vec![fx_px, 0.0, cx_px, 0.0, fy_px, cy_px, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx_px, 0.0, cx_px, 0.0, 0.0, fy_px, cy_px, 0.0, 0.0, 0.0, 1.0, 0.0],
    })
}

/// A road user as estimated by the stack at an image's stamp.
#[derive(Clone, Debug)]
pub(crate) struct Believed {
    /// Label.
    pub(crate) name: String,
    pub(crate) kind: ActorKind,
    pub(crate) pose: Pose2,
    pub(crate) extent: Extent,
    pub(crate) distance_m: f64,
}

/// Bounding boxes over an image, labelled with name and distance.
pub(crate) fn annotations(
    header: &Header,
    camera_from_map: &Transform<Camera, Map>,
    believed: &[Believed],
) -> ImageAnnotations {
    let stamp = Some(timestamp(header.stamp));
    let lens = Lens::new(header);
    let mut shown = ImageAnnotations { timestamp: stamp, ..ImageAnnotations::default() };
    for one in believed {
        let at = |[x, y, z]: [f64; 3]| {
            let p = *camera_from_map * Point::<Map>::new(x, y, z);
            // In an orthographic projection, every point is treated as 1 m away.
            let is_ahead = header.info.intrinsics.is_parallel && p.coords.z > 0.0;
            if is_ahead { Point::new(p.coords.x, p.coords.y, 1.0) } else { p }
        };
        let points: Vec<Point2> =
            box_edges(one.pose, one.extent).into_iter().flat_map(|[a, b]| lens.line(at(a), at(b))).collect();
        if points.is_empty() {
            continue;
        }
        shown.points.push(PointsAnnotation {
            timestamp: stamp,
            r#type: Points::LineList as i32,
            points,
            outline_color: Some(colour_of(one.kind, 255)),
            thickness: 2.0,
            ..PointsAnnotation::default()
        });
        let above = at([one.pose.x_m, one.pose.y_m, one.extent.height_m]);
        if let Some([a, _]) = lens.clipped(above.coords.into(), above.coords.into()) {
            shown.texts.push(TextAnnotation {
                timestamp: stamp,
                position: Some(lens.pixel(a)),
                text: format!("{} {:.0} m", one.name, one.distance_m),
                font_size: 14.0,
                text_color: Some(colour([255, 255, 255, 255])),
                background_color: Some(colour([0, 0, 0, 120])),
                ..TextAnnotation::default()
            });
        }
    }
    shown
}

/// Bounding boxes of a detector in an image, labelled with kind and score.
pub(crate) fn detections(found: &Detections) -> ImageAnnotations {
    let one = |one: &swerve_msg::DetectedBox| {
        let words = format!("{} {:.2}", name_of(one.kind), one.score);
        one.image_px.map(|edges| (edges, words, colour_of(one.kind, 255)))
    };
    rectangles(found.stamp, found.boxes.iter().filter_map(one))
}

/// Bounding boxes of traffic lights in an image, labelled with signal and distance.
pub(crate) fn traffic_lights(seen: &TrafficLights) -> ImageAnnotations {
    let one = |light: &swerve_msg::TrafficLight| {
        let [r, g, b] = light.signal.map_or([235; 3], Signal::rgb);
        (light.image_px, light.words(), colour([r, g, b, 255]))
    };
    rectangles(seen.stamp, seen.lights.iter().map(one))
}

/// Labelled rectangles (left, top, right and bottom edge).
fn rectangles(at: Time, all: impl Iterator<Item = ([f64; 4], String, Color)>) -> ImageAnnotations {
    let stamp = Some(timestamp(at));
    let mut shown = ImageAnnotations { timestamp: stamp, ..ImageAnnotations::default() };
    for ([left, top, right, bottom], text, outline) in all {
        let corner = |x, y| Point2 { x, y };
        shown.points.push(PointsAnnotation {
            timestamp: stamp,
            r#type: Points::LineLoop as i32,
            points: vec![corner(left, top), corner(right, top), corner(right, bottom), corner(left, bottom)],
            outline_color: Some(outline),
            thickness: 2.0,
            ..PointsAnnotation::default()
        });
        shown.texts.push(TextAnnotation {
            timestamp: stamp,
            position: Some(corner(left, top)),
            text,
            font_size: 12.0,
            text_color: Some(colour([255, 255, 255, 255])),
            background_color: Some(colour([0, 0, 0, 120])),
            ..TextAnnotation::default()
        });
    }
    shown
}

/// Projection of points in front of the camera into the image, with clipping.
struct Lens {
    intrinsics: Intrinsics,
    bends: bool,
    /// Ranges of `x/z` and `y/z` of the rays through the image borders.
    x: [f64; 2],
    y: [f64; 2],
}

impl Lens {
    fn new(header: &Header) -> Self {
        let intrinsics = header.info.intrinsics;
        let bends = intrinsics.distortion.iter().any(|k| *k != 0.0);
        let mut lens = Self { intrinsics, bends, x: [f64::INFINITY, -f64::INFINITY], y: [0.0; 2] };
        lens.y = lens.x;
        let (width, height) = (f64::from(header.width_px), f64::from(header.height_px));
        for k in 0..=8 {
            let share = f64::from(k) / 8.0;
            let (along, down) = (share * width, share * height);
            for pixel in [[along, 0.0], [along, height], [0.0, down], [width, down]] {
                let [x, y] = lens.ray(pixel);
                lens.x = [lens.x[0].min(x), lens.x[1].max(x)];
                lens.y = [lens.y[0].min(y), lens.y[1].max(y)];
            }
        }
        lens
    }

    /// Ray `(x/z, y/z)` through a point of the image: inverts the distortion by fixed-point iteration.
    fn ray(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let Intrinsics { fx_px, fy_px, cx_px, cy_px, .. } = self.intrinsics;
        let wanted = [(u - cx_px) / fx_px, (v - cy_px) / fy_px];
        let mut ray = wanted;
        for _ in 0..30 {
            let bent = self.bent(ray);
            ray = [ray[0] + wanted[0] - bent[0], ray[1] + wanted[1] - bent[1]];
        }
        ray
    }

    /// Applies the lens distortion of [`Intrinsics`] to a ray.
    fn bent(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [k1, k2, p1, p2, k3] = self.intrinsics.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let across = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let down = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        [across, down]
    }

    fn pixel(&self, [x, y, z]: [f64; 3]) -> Point2 {
        let Intrinsics { fx_px, fy_px, cx_px, cy_px, .. } = self.intrinsics;
        let [x, y] = self.bent([x / z, y / z]);
        Point2 { x: fx_px * x + cx_px, y: fy_px * y + cy_px }
    }

    /// Part of a line segment in space that is inside the image.
    fn clipped(&self, a: [f64; 3], b: [f64; 3]) -> Option<[[f64; 3]; 2]> {
        let inside = |p: [f64; 3]| {
            let [x, y, z] = p;
            [z - NEAR_M, x - self.x[0] * z, self.x[1] * z - x, y - self.y[0] * z, self.y[1] * z - y]
        };
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for (at_a, at_b) in inside(a).into_iter().zip(inside(b)) {
            if at_a < 0.0 && at_b < 0.0 {
                return None;
            }
            if at_a < 0.0 {
                from = from.max(at_a / (at_a - at_b));
            } else if at_b < 0.0 {
                to = to.min(at_a / (at_a - at_b));
            }
        }
        let on = |t: f64| core::array::from_fn(|k| a[k] + (b[k] - a[k]) * t);
        (from <= to).then(|| [on(from), on(to)])
    }

    /// Projects a line segment in space to pairs of points in the image.
    fn line(&self, a: Point<Camera>, b: Point<Camera>) -> Vec<Point2> {
        let Some([a, b]) = self.clipped(a.coords.into(), b.coords.into()) else { return Vec::new() };
        let n = if self.bends { PIECES } else { 1 };
        let on = |k: usize| {
            let t = k as f64 / n as f64;
            self.pixel(core::array::from_fn(|i| a[i] + (b[i] - a[i]) * t))
        };
        (0..n).flat_map(|k| [on(k), on(k + 1)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(distortion: [f64; 5]) -> Header {
        let intrinsics = Intrinsics {
            fx_px: 320.0,
            fy_px: 320.0,
            cx_px: 320.0,
            cy_px: 180.0,
            distortion,
            is_parallel: false,
        };
        let info = CameraInfo { intrinsics, ..CameraInfo::default() };
        Header { camera: "eye".into(), stamp: Time::from_ms(1500), width_px: 640, height_px: 360, info }
    }

    /// A camera 1 m above the map origin, looking along x.
    fn camera_from_map() -> Transform<Camera, Map> {
        let quarter = core::f64::consts::FRAC_PI_2;
        Transform::<Map, Camera>::from_roll_pitch_yaw(Point::new(0.0, 0.0, 1.0), -quarter, 0.0, -quarter)
            .inverse()
    }

    fn believed(x_m: f64, y_m: f64) -> Believed {
        let extent = Extent { length_m: 2.0, width_m: 2.0, height_m: 2.0 };
        let name = "parked car".into();
        Believed { name, kind: ActorKind::Car, pose: Pose2::new(x_m, y_m, 0.0), extent, distance_m: x_m }
    }

    fn bounds(shown: &ImageAnnotations) -> [f64; 4] {
        let points = || shown.points.iter().flat_map(|one| &one.points);
        let (x, y) = (|| points().map(|p| p.x), || points().map(|p| p.y));
        let (low, high) = (f64::INFINITY, -f64::INFINITY);
        [x().fold(low, f64::min), x().fold(high, f64::max), y().fold(low, f64::min), y().fold(high, f64::max)]
    }

    #[test]
    fn annotation_matches_the_pinhole_projection() {
        let shown = annotations(&header([0.0; 5]), &camera_from_map(), &[believed(11.0, 0.0)]);
        // The near face is 10 m away and extends 1 m to each side of the axis.
        assert_eq!(bounds(&shown).map(|px| px.round()), [288.0, 352.0, 148.0, 212.0]);
        assert_eq!((shown.points[0].points.len(), shown.texts.len()), (24, 1));
        assert_eq!(
            (shown.texts[0].text.as_str(), shown.timestamp.unwrap().nsec()),
            ("parked car 11 m", 500_000_000)
        );
    }

    #[test]
    fn detections_are_drawn_at_their_image_coordinates() {
        let in_image = swerve_msg::DetectedBox {
            kind: ActorKind::Pedestrian,
            score: 0.876,
            pose: Pose2::new(11.0, 0.0, 0.0),
            bottom_m: 0.0,
            extent: Extent::default(),
            image_px: Some([10.0, 20.0, 30.0, 80.0]),
            covariance_m2: None,
            radial_speed_mps: None,
        };
        let elsewhere = swerve_msg::DetectedBox { image_px: None, ..in_image };
        let shown = detections(&Detections { stamp: Time::from_ms(1500), boxes: vec![in_image, elsewhere] });
        assert_eq!(bounds(&shown), [10.0, 30.0, 20.0, 80.0]);
        assert_eq!((shown.points.len(), shown.texts[0].text.as_str()), (1, "pedestrian 0.88"));
    }

    #[test]
    fn annotations_are_clipped_to_the_image() {
        for distortion in [[0.0; 5], [-0.25, 0.06, 0.001, -0.001, -0.005]] {
            let header = header(distortion);
            for (x_m, y_m) in [(0.5, 0.0), (1.2, 1.0), (5.0, 6.0), (8.0, -7.5), (30.0, 0.0)] {
                let shown = annotations(&header, &camera_from_map(), &[believed(x_m, y_m)]);
                let [left, right, top, bottom] = bounds(&shown);
                // With distortion, lines may exceed the curved border slightly.
                let margin = if distortion == [0.0; 5] { 1e-6 } else { 80.0 };
                assert!(left >= -margin && right <= 640.0 + margin, "{x_m} {y_m}: {left} {right}");
                assert!(top >= -margin && bottom <= 360.0 + margin, "{x_m} {y_m}: {top} {bottom}");
            }
            let behind =
                annotations(&header, &camera_from_map(), &[believed(-5.0, 0.0), believed(3.0, 40.0)]);
            assert_eq!((behind.points.len(), behind.texts.len()), (0, 0));
        }
    }

    #[test]
    fn lens_undistortion_inverts_the_distortion() {
        let lens = Lens::new(&header([-0.2, 0.05, 0.001, -0.002, 0.0]));
        for pixel in [[0.0, 0.0], [640.0, 200.0], [100.0, 350.0]] {
            let [x, y] = lens.ray(pixel);
            let back = lens.pixel([x, y, 1.0]);
            assert!(
                (back.x - pixel[0]).abs() < 1e-6 && (back.y - pixel[1]).abs() < 1e-6,
                "{back:?} {pixel:?}"
            );
        }
    }

    #[test]
    fn compressed_images_keep_their_size_and_png_its_bytes() {
        let header = Header { width_px: 37, height_px: 21, ..header([0.0; 5]) };
        let rgb: Vec<u8> = (0..3 * 37 * 21).map(|k| (k * 7 % 251) as u8).collect();
        let png = colours(&header, &rgb, ImageForm::Png).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&png.data[..])).read_info().unwrap();
        let mut back = vec![0; 3 * 37 * 21];
        reader.next_frame(&mut back).unwrap();
        assert_eq!((back, png.format.as_str()), (rgb.clone(), "png"));
        let jpeg = colours(&header, &rgb, ImageForm::Jpeg(80)).unwrap();
        assert_eq!(jpeg.data[..2], [0xff, 0xd8]);
        assert!(colours(&Header { height_px: 70_000, ..header }, &rgb, ImageForm::Jpeg(80)).is_none());
    }
}
