//! Vision without neural networks on one thread, on rendered streets and on real images beside the repository, compared
//! with OpenCV in the same run if the Python of `SWERVE_PYTHON` has it; and the time of each rung of the camera
//! detector.

mod street;

use std::collections::BTreeMap;
use std::path::Path;

use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, named, now, print, python};
use swerve_camera::{
    Camera, CameraSpec, Frame, FrameMut, Intrinsics, Outputs, RenderOptions, Renderer, View, mount,
};
use swerve_geom::{Ego, Map, Point, Pose2, Transform, Vector2};
use swerve_msg::{ActorId, CameraInfo, DetectedBox, Detections, Encoding, Image, Pixels, Track, TrackList};
use swerve_perception::CameraObjects;
use swerve_perception::camera::Shot;
use swerve_scene::WeatherPreset;
use swerve_scene::town::town;
use swerve_stack::street::EGO_INSTANCE;
use swerve_vehicle::VehicleParams;
use swerve_vision::acf::Ground;
use swerve_vision::hog::{HogDetector, LinearHog};
use swerve_vision::lanes::{LaneFinder, LaneSettings, Method, RoadCamera};
use swerve_vision::segmentation::Segmenter;
use swerve_vision::stereo::{PathCount, Stereo, StereoSettings};
use swerve_vision::{Plane, Rgb, shipped};
use zune_jpeg::zune_core::bytestream::ZCursor;

const ROUNDS: usize = 15;

/// Milliseconds of `work`.
fn ms(mut work: impl FnMut()) -> Sample {
    work();
    let figures = (0..ROUNDS).map(|_| {
        let began = now();
        work();
        1e3 * began.elapsed().as_secs_f64()
    });
    Sample::new(figures.collect())
}

fn gray(path: &Path) -> Plane<u8> {
    let file = std::fs::read(path).expect("the folder is there");
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG file");
    let mut bytes = vec![0; reader.output_buffer_size().expect("a small one")];
    let info = reader.next_frame(&mut bytes).expect("a whole one");
    let mut gray = Plane::default();
    Rgb::new(info.width as usize, info.height as usize, &bytes).expect("three colours").gray(&mut gray);
    gray
}

/// File to which OpenCV writes a frame of its video, 768 x 576 pixels.
const FRAME: &str = concat!(env!("CARGO_TARGET_TMPDIR"), "/vtest.rgb");

/// Milliseconds of OpenCV in this run, by task; empty if this Python (`SWERVE_PYTHON`) does not have it.
fn of_opencv(folder: &Path) -> BTreeMap<String, f64> {
    named(&python("vision/speed.py", &[&folder.join("perception"), Path::new(FRAME)]))
}

/// Speed relative to OpenCV, both in this run.
fn beside(rows: &mut Rows, what: &str, opencv: Option<&f64>, took: &Sample, goal: f64) {
    let what = format!("{what}, times as fast as OpenCV");
    match opencv {
        Some(theirs) => {
            let times = theirs / took.median();
            rows.row(&what, times, &format!("{times:.2} ({theirs:.1} ms)"), Goal::Least(goal));
        }
        None => rows.skipped(&what, "needs a Python with OpenCV (SWERVE_PYTHON)"),
    }
}

/// OpenCV's people detector on a frame of its video.
fn hog(opencv: &BTreeMap<String, f64>, rows: &mut Rows) {
    let what = "people by HOG, 768 x 576";
    let Some(bytes) = std::fs::read(FRAME).ok().filter(|_| opencv.contains_key("hog")) else {
        return rows.skipped(what, "needs a Python with OpenCV (SWERVE_PYTHON)");
    };
    let image = Rgb::new(768, 576, &bytes).expect("three colours");
    let (mut detector, mut found) = (HogDetector::new(LinearHog::people()), Vec::new());
    let took = ms(|| detector.detect(image, 0.0, &mut found));
    rows.row(what, took.median(), &took.text(1, "ms"), Goal::None);
    beside(rows, what, opencv.get("hog"), &took, 1.5);
}

/// Stereo pairs, compared with OpenCV's 3WAY.
fn stereo(folder: &Path, opencv: &BTreeMap<String, f64>, rows: &mut Rows) {
    let pairs = [
        ("cones", ["middlebury_2003/cones/im2.png", "middlebury_2003/cones/im6.png"], 64),
        ("teddy", ["middlebury_2003/teddy/im2.png", "middlebury_2003/teddy/im6.png"], 64),
        (
            "motorcycle",
            ["middlebury_motorcycle/motorcycle_left.png", "middlebury_motorcycle/motorcycle_right.png"],
            80,
        ),
    ];
    for (name, images, disparities) in pairs {
        let [left, right] = images.map(|image| gray(&folder.join("perception").join(image)));
        for paths in [PathCount::Four, PathCount::Eight] {
            let settings = StereoSettings { disparities, paths, ..StereoSettings::default() };
            let mut stereo = Stereo::new(settings).expect("settings in their range");
            let mut found = Plane::default();
            let took = ms(|| stereo.disparities(&left, &right, &mut found).expect("a pair"));
            let what = format!("stereo {name}, {paths:?} paths");
            rows.row(&what, took.median(), &took.text(1, "ms"), Goal::None);
            if paths == PathCount::Four {
                beside(rows, &what, opencv.get(name), &took, 1.0);
            }
        }
    }
}

/// Images of the camera of `configs/camera_objects.toml` along a street, 800 x 600 pixels: the ego is placed every 4 m,
/// the others stay at their start.
fn street_images() -> Vec<Image> {
    let (_, street) = street::at_start(&VehicleParams::default());
    let intrinsics = Intrinsics::HorizontalFovRad(70.0_f64.to_radians());
    let spec = CameraSpec { width_px: 800, height_px: 600, intrinsics, ..CameraSpec::default() };
    let camera = Camera::new(spec).expect("a camera");
    let ego_from_camera = mount([1.75, 0.0, 1.35], 0.0, 0.0, 0.0);
    let (fx_px, fy_px, cx_px, cy_px) = camera.focal_px();
    let lens =
        swerve_msg::Intrinsics { fx_px, fy_px, cx_px, cy_px, distortion: [0.0; 5], is_parallel: false };
    let mut renderer =
        Renderer::new(RenderOptions { threads: 1, ..RenderOptions::default() }).expect("the CPU");
    let take = |k: usize| {
        let at = Point::new(4.0 * k as f64, 0.0, 0.0);
        let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(at, 0.0, 0.0, 0.0);
        let mut view = View::new(&camera, map_from_ego * ego_from_camera);
        view.hidden_instance = Some(EGO_INSTANCE);
        let mut image = Image::new(800, 600, Encoding::Rgb8);
        image.camera = CameraInfo { intrinsics: lens, ego_from_camera };
        let Pixels::Rgb8(rgb) = &mut image.pixels else { unreachable!("it was made so") };
        let frame = FrameMut { rgb: Some(&mut rgb[..]), depth_m: None, semantic: None, instance: None };
        renderer.render(street.scene(), &view, frame).expect("an image of that size");
        image
    };
    (0..25).map(take).collect()
}

/// Detections as tracks predicted to the next image: the ego is 4 m further on.
fn followed(found: &Detections) -> TrackList {
    let track = |(k, one): (usize, &DetectedBox)| Track {
        id: ActorId(k as u32),
        kind: one.kind,
        pose: Pose2::new(one.pose.x_m - 4.0, one.pose.y_m, one.pose.heading_rad),
        extent: one.extent,
        velocity_mps: Vector2::default(),
        history: Vec::new(),
    };
    TrackList { stamp: found.stamp, tracks: found.boxes.iter().enumerate().map(track).collect() }
}

/// Milliseconds per image of each rung of the camera detectors, boxes placed on the ground: one thread, images in turn.
fn rungs(rows: &mut Rows) {
    let images = street_images();
    for detector in ["street", "hog_street"] {
        let weights = shipped::detector(detector).expect("it is in the program").expect("whole");
        print(&format!("  [{detector}]"));
        let mut medians = BTreeMap::new();
        for rung in &weights.rungs {
            let mut objects =
                CameraObjects::new(weights.clone(), rung.clone(), 0.3).expect("a detector of a street");
            let (mut found, mut tracks) = (Detections::default(), TrackList::default());
            let mut look = |image: &Image| {
                let shot = Shot { image, ego: Pose2::default(), pitch_rad: 0.0, route: None };
                let began = now();
                objects.detect(&shot, Some(&tracks), &mut found).expect("an image");
                let took_ms = 1e3 * began.elapsed().as_secs_f64();
                tracks = followed(&found);
                took_ms
            };
            look(&images[0]);
            let took = Sample::new((0..12).flat_map(|_| images.iter()).map(&mut look).collect());
            let goal = match (detector, rung.name.as_str()) {
                ("street", "full") => Goal::Most(60.0),
                ("street", "fastest") => Goal::Most(6.0),
                _ => Goal::None,
            };
            let what = format!("camera objects, {detector}, rung {}", rung.name);
            rows.row(&what, took.median(), &took.text(1, "ms"), goal);
            let at = [0.0, 0.5, 0.9, 0.99].map(|share| format!("[{}, {:.1}]", 100.0 * share, took.at(share)));
            print(&format!("  {} = [{}]", rung.name, at.join(", ")));
            medians.insert(rung.name.clone(), took.median());
        }
        let times = medians["full"] / medians["fastest"];
        let goal = if detector == "street" { Goal::Least(8.0) } else { Goal::None };
        rows.row(
            &format!("camera objects, {detector}, full over fastest"),
            times,
            &format!("{times:.1}"),
            goal,
        );
    }
}

/// A photograph of a road with an approximate camera model.
fn lanes(folder: &Path, rows: &mut Rows) {
    let path = folder.join("lanes_real/solidWhiteRight.jpg");
    let file = std::fs::read(path).expect("the folder is there");
    let mut decoder = zune_jpeg::JpegDecoder::new(ZCursor::new(&file[..]));
    let bytes = decoder.decode().expect("a JPEG file");
    let image = Rgb::new(960, 540, &bytes).expect("three colours");
    let camera = RoadCamera::pinhole([960, 540], 1.01, RoadCamera::looking_ahead(1.2, -0.044));
    for method in Method::ALL {
        let settings = LaneSettings { method, ..LaneSettings::default() };
        let mut finder = LaneFinder::new(camera, settings).expect("a camera on a car");
        let took = ms(|| assert!(finder.find(image).is_ok_and(|lanes| lanes.left.is_some())));
        let what = format!("lanes, {}, 960 x 540", method.name());
        rows.row(&what, took.least(), &took.text(1, "ms"), Goal::None);
    }
}

/// A simulated street as seen by a camera.
fn street([width_px, height_px]: [u32; 2], fov_deg: f64) -> (Frame, Ground) {
    let intrinsics = Intrinsics::HorizontalFovRad(fov_deg.to_radians());
    let spec = CameraSpec { width_px, height_px, intrinsics, ..CameraSpec::default() };
    let camera = Camera::new(spec).expect("the camera is fine");
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let view = View::new(&camera, map_from_ego * mount([0.0, -1.9, 1.35], 0.0, 0.0, 0.0));
    let mut frame = Frame::new(&camera, Outputs::RGB);
    let mut renderer = Renderer::new(RenderOptions::default()).expect("the CPU draws");
    let scene = town(WeatherPreset::ClearNoon, 7, 100.0);
    renderer.render(&scene, &view, frame.as_mut()).expect("scene and view are fine");
    (frame, Ground { horizon_px: 0.5 * f64::from(height_px), focal_px: camera.focal_px().0, height_m: 1.35 })
}

/// Pixel labels: with the camera of the recipe, and with that of `configs/studies/timely_segmentation.toml`.
fn segmentation(rows: &mut Rows) {
    segmentation_of(rows, [800, 600], 70.0, Goal::Most(30.0));
    segmentation_of(rows, [1280, 720], 90.0, Goal::None);
}

fn segmentation_of(rows: &mut Rows, size: [u32; 2], fov_deg: f64, goal: Goal) {
    let (frame, ground) = street(size, fov_deg);
    let rgb = Rgb::new(frame.width_px, frame.height_px, &frame.rgb).expect("three colours");
    let weights = shipped::segmentation("street").expect("it is in the program").expect("it is whole");
    let mut segmenter = Segmenter::new(weights, [frame.width_px, frame.height_px], ground);
    let mut labels = vec![0; frame.width_px * frame.height_px];
    let took = ms(|| segmenter.segment(rgb, &mut labels).expect("it is of that size"));
    let what = format!("segmentation street, {} x {} pixels", size[0], size[1]);
    rows.row(&what, took.least(), &took.text(1, "ms"), goal);
}

fn main() {
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "vision");
    let all = !std::env::args().any(|argument| argument == "rungs");
    if all && is_asked_to_measure() {
        segmentation(&mut rows);
    }
    let sets = ["lanes_real", "perception/middlebury_2003", "perception/middlebury_motorcycle"];
    let has_data = sets.into_iter().all(|set| swerve_tests::data(set).is_some());
    match swerve_tests::data("").filter(|_| all && has_data && is_asked_to_measure()) {
        Some(folder) => {
            let opencv = of_opencv(&folder);
            stereo(&folder, &opencv, &mut rows);
            hog(&opencv, &mut rows);
            lanes(&folder, &mut rows);
        }
        None => rows.skipped("vision", "not asked to measure, or no test data"),
    }
    // `-- rungs` measures them alone.
    if is_asked_to_measure() {
        rungs(&mut rows);
    }
    rows.finish();
}
