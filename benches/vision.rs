//! Vision without neural networks on one thread, on real images beside the repository, and what OpenCV and dlib
//! take for the same: their figures are those that `tests/reference/vision` measured and stored.

use std::path::{Path, PathBuf};

use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now};
use swerve_vision::lanes::{LaneFinder, LaneSettings, Method, RoadCamera};
use swerve_vision::stereo::{PathCount, Stereo, StereoSettings};
use swerve_vision::{Plane, Rgb};
use zune_jpeg::zune_core::bytestream::ZCursor;

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

/// A photograph of a road with a camera about as it was.
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

fn main() {
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "vision");
    match data().filter(|_| is_asked_to_measure()) {
        Some(folder) => {
            stereo(&folder, &mut rows);
            lanes(&folder, &mut rows);
        }
        None => rows.skipped("vision", "not asked to measure, or no shared/data beside the repository"),
    }
    rows.finish();
}
