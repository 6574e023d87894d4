//! Vision without neural networks on one thread, on a rendered street and on real images beside the repository, and
//! what OpenCV and dlib take for the same: their figures are those that `tests/reference/vision` measured and stored.

use std::path::{Path, PathBuf};

use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now};
use swerve_camera::{Camera, CameraSpec, Frame, Intrinsics, Outputs, RenderOptions, Renderer, View, mount};
use swerve_geom::{Ego, Map, Point, Transform};
use swerve_scene::WeatherPreset;
use swerve_scene::town::town;
use swerve_vision::acf::Ground;
use swerve_vision::segmentation::Segmenter;
use swerve_vision::stereo::{PathCount, Stereo, StereoSettings};
use swerve_vision::{Plane, Rgb, shipped};

const ROUNDS: usize = 15;

/// Real data, where it lies beside the repository.
fn data() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    folder.exists().then_some(folder)
}

/// Milliseconds that a piece of work takes.
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

/// Pairs with the milliseconds of OpenCV 4.14's 3WAY, one thread of the machine of the rows in docs/performance.md.
fn stereo(folder: &Path, rows: &mut Rows) {
    let pairs = [
        ("cones", ["middlebury_2003/cones/im2.png", "middlebury_2003/cones/im6.png"], 64, 14.3),
        ("teddy", ["middlebury_2003/teddy/im2.png", "middlebury_2003/teddy/im6.png"], 64, 14.3),
        (
            "motorcycle",
            ["middlebury_motorcycle/motorcycle_left.png", "middlebury_motorcycle/motorcycle_right.png"],
            80,
            37.9,
        ),
    ];
    for (name, images, disparities, theirs) in pairs {
        let [left, right] = images.map(|image| gray(&folder.join("perception").join(image)));
        for paths in [PathCount::Four, PathCount::Eight] {
            let settings = StereoSettings { disparities, paths, ..StereoSettings::default() };
            let mut stereo = Stereo::new(settings).expect("settings in their range");
            let mut found = Plane::default();
            let took = ms(|| stereo.disparities(&left, &right, &mut found).expect("a pair"));
            let goal = if paths == PathCount::Four { Goal::Most(theirs) } else { Goal::None };
            let what = format!("stereo {name}, {paths:?} paths (OpenCV 3WAY {theirs} ms)");
            rows.row(&what, took.least(), &took.text(1, "ms"), goal);
        }
    }
}

/// A street of the simulator, as the camera of the segmentation's recipe sees it.
fn street() -> (Frame, Ground) {
    let intrinsics = Intrinsics::HorizontalFovRad(70_f64.to_radians());
    let spec = CameraSpec { width_px: 800, height_px: 600, intrinsics, ..CameraSpec::default() };
    let camera = Camera::new(spec).expect("the camera is fine");
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let view = View::new(&camera, map_from_ego * mount([0.0, -1.9, 1.35], 0.0, 0.0, 0.0));
    let mut frame = Frame::new(&camera, Outputs::RGB);
    let mut renderer = Renderer::new(RenderOptions::default()).expect("the CPU draws");
    let scene = town(WeatherPreset::ClearNoon, 7, 100.0);
    renderer.render(&scene, &view, frame.as_mut()).expect("scene and view are fine");
    (frame, Ground { horizon_px: 300.0, focal_px: camera.focal_px().0, height_m: 1.35 })
}

fn segmentation(rows: &mut Rows) {
    let (frame, ground) = street();
    let rgb = Rgb::new(frame.width_px, frame.height_px, &frame.rgb).expect("three colours");
    let weights = shipped::segmentation("street").expect("it is in the program").expect("it is whole");
    let mut segmenter = Segmenter::new(weights, [frame.width_px, frame.height_px], ground);
    let mut labels = vec![0; frame.width_px * frame.height_px];
    let took = ms(|| segmenter.segment(rgb, &mut labels).expect("it is of that size"));
    let what = "segmentation street, 800 x 600 pixels";
    rows.row(what, took.least(), &took.text(1, "ms"), Goal::Most(30.0));
}

fn main() {
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "vision");
    if is_asked_to_measure() {
        segmentation(&mut rows);
    }
    match data().filter(|_| is_asked_to_measure()) {
        Some(folder) => stereo(&folder, &mut rows),
        None => rows.skipped("vision", "not asked to measure, or no shared/data beside the repository"),
    }
    rows.finish();
}
