use std::path::Path;

use swerve_core::digest_of;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;

use super::*;
use crate::drive_pipeline;

fn scenario() -> Scenario {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/person_behind_truck.toml");
    Scenario::read(&file).unwrap()
}

fn into(folder: &Path) -> Sinks<'_> {
    Sinks { folder: Some(folder), video: None }
}

/// Drives the first tenth of a second with pictures; returns the run's digest and the pictures.
fn pictures(folder: &Path, threads: usize) -> (swerve_core::Digest, Vec<Vec<u8>>) {
    let (config, scenario) = (Setup::default(), scenario());
    let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
    pipeline.until = Time::ZERO + Span::from_ms(100);
    let mut frames = Frames::create(into(folder), "a drive".into(), &pipeline.scenario, &config).unwrap();
    let outcome = drive_pipeline(pipeline, config.seed, threads, &mut [&mut frames]).unwrap();
    let count = frames.finish().unwrap();
    let read = |k: usize| std::fs::read(folder.join(format!("{k:05}.png"))).unwrap();
    (outcome.digest, (0..count).map(read).collect())
}

#[test]
fn pictures_are_identical_on_any_number_of_threads_and_do_not_affect_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (digest, one) = pictures(folder.path(), 1);
    assert_eq!(one.len(), 3);
    assert_ne!(digest_of(&one[0]), digest_of(&one[2]), "the ego moves");
    let (again, two) = pictures(folder.path(), 2);
    assert!(one == two);
    assert_eq!(digest, again);
    let mut pipeline = Pipeline::build(&Setup::default(), &scenario()).unwrap();
    pipeline.until = Time::ZERO + Span::from_ms(100);
    assert_eq!(drive_pipeline(pipeline, 1, 1, &mut []).unwrap().digest, digest);
}

#[test]
fn pictures_of_an_earlier_run_are_deleted_and_foreign_files_refused() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    pictures(folder.path(), 1);
    std::fs::create_dir_all(place("eye/rgb")).unwrap();
    for earlier in ["00099.png", "eye/rgb/00000.png"] {
        std::fs::copy(place("00000.png"), place(earlier)).unwrap();
    }
    std::fs::write(place(".DS_Store"), "of a file manager").unwrap();
    let create = || Frames::create(into(folder.path()), String::new(), &scenario(), &Setup::default());
    // A run refused for another reason deletes nothing.
    drop(create().unwrap());
    assert!(place("00099.png").exists());
    assert_eq!(pictures(folder.path(), 1).1.len(), 3);
    assert!(!place("00099.png").exists() && !place("eye/rgb/00000.png").exists());
    assert!(place(".DS_Store").exists());
    let png = (png::ColorType::Grayscale, png::BitDepth::Eight);
    swerve_report::files::write_png(&place("00002.png"), (1, 1), png, &[0]).unwrap();
    for others in ["00002.png", "notes.txt", "eye/rgb/00000.png"] {
        if others != "00002.png" {
            std::fs::write(place(others), "mine").unwrap();
        }
        let told = create().err().unwrap().to_string();
        assert!(
            told.contains(&format!("{} is not a picture written by --frames", place(others).display())),
            "{told}"
        );
        assert!(place("00001.png").exists());
        std::fs::remove_file(place(others)).unwrap();
    }
}

#[test]
fn picture_that_cannot_be_written_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("frames");
    let (config, scenario) = (Setup::default(), scenario());
    let mut frames = Frames::create(into(&inside), String::new(), &scenario, &config).unwrap();
    std::fs::remove_dir(&inside).unwrap();
    let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
    pipeline.until = Time::ZERO;
    drive_pipeline(pipeline, 1, 1, &mut [&mut frames]).unwrap();
    let error = format!("{:#}", frames.finish().unwrap_err());
    assert!(error.contains("00000.png"), "{error}");
}

/// Camera images wait for the detector that reads them; all are written, in order.
#[test]
fn images_read_by_a_detector_are_written_with_its_detections() {
    let text = "[camera.eye]\nwidth_px = 160\nheight_px = 120\nperiod_ms = 50\n\
                [operator.objects]\nkind = \"camera_objects\"\nrung = \"fastest\"\n";
    let document = swerve_text::Document::parse("c.toml", text).unwrap();
    let config = Setup::from_document(&document, &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut pipeline = Pipeline::build(&config, &scenario()).unwrap();
    pipeline.until = Time::ZERO + Span::from_ms(220);
    let mut frames = Frames::create(into(folder.path()), String::new(), &pipeline.scenario, &config).unwrap();
    drive_pipeline(pipeline, config.seed, 1, &mut [&mut frames]).unwrap();
    let found = swerve_msg::DetectedBox {
        kind: swerve_msg::ActorKind::Pedestrian,
        score: 0.9,
        pose: swerve_geom::Pose2::new(10.0, 0.0, 0.0),
        bottom_m: 0.0,
        extent: swerve_msg::Extent { length_m: 0.5, width_m: 0.5, height_m: 1.7 },
        image_px: Some([40.0, 30.0, 60.0, 90.0]),
        covariance_m2: None,
        radial_speed_mps: None,
    };
    // One more image after the end of the run, with its detections.
    assert!(frames.waiting.is_empty(), "each image had its report");
    let mut image = Image::new(160, 120, swerve_msg::Encoding::Rgb8);
    image.stamp = Time::from_ms(250);
    frames.camera("eye", "eye.rgb", &image).unwrap();
    let (stream, stamp) = ("eye.rgb".to_owned(), image.stamp);
    let pixel = |frame: &Frame| frame.rgb[3 * (60 * 160 + 40)..][..3].to_vec();
    let before = frames.waiting[&stream].2.clone();
    let late = Detections { stamp: stamp + Span::from_ms(1), boxes: vec![found] };
    frames.found("objects", &late).unwrap();
    assert_eq!(pixel(&frames.waiting[&stream].2), pixel(&before), "of another image");
    frames.found("objects", &Detections { stamp, boxes: vec![found] }).unwrap();
    assert!(frames.waiting.is_empty());
    frames.finish().unwrap();
    let (published, seen) = ("eye/rgb", "eye/rgb_seen");
    let count = |name: &str| std::fs::read_dir(folder.path().join(name)).unwrap().count();
    assert!(count(published) >= 4 && count(seen) == count(published));
    let last = |name: &str| {
        let file = folder.path().join(name).join(format!("{:05}.png", count(name) - 1));
        let file = std::io::BufReader::new(std::fs::File::open(file).unwrap());
        let mut rgb = vec![0; 3 * 160 * 120];
        png::Decoder::new(file).read_info().unwrap().next_frame(&mut rgb).unwrap();
        rgb
    };
    assert_ne!(last(seen)[3 * (60 * 160 + 40)..][..3], pixel(&before)[..], "the box's edge");
    // The published image is not annotated, or a detector tried on it would see the boxes.
    assert_eq!(last(published), colours::of(&image.pixels));
}

/// A camera that sees the scenario's truck; the obstacle sensor's boxes are not drawn into its images.
#[test]
fn images_of_cameras_are_as_published() {
    let text = "[camera.eye]\nwidth_px = 160\nheight_px = 120\nperiod_ms = 50\n\
                [operator.objects]\nkind = \"camera_objects\"\nrung = \"fastest\"\n";
    let document = swerve_text::Document::parse("c.toml", text).unwrap();
    let config = Setup::from_document(&document, &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut pipeline = Pipeline::build(&config, &scenario()).unwrap();
    pipeline.until = Time::ZERO + Span::from_ms(320);
    let mut frames = Frames::create(into(folder.path()), String::new(), &pipeline.scenario, &config).unwrap();
    let mut published = Published::default();
    drive_pipeline(pipeline, config.seed, 1, &mut [&mut frames, &mut published]).unwrap();
    frames.finish().unwrap();
    assert!(published.0.len() >= 2, "{}", published.0.len());
    for (k, expected) in published.0.iter().enumerate() {
        let file = std::fs::File::open(folder.path().join(format!("eye/rgb/{k:05}.png"))).unwrap();
        let mut rgb = vec![0; 3 * 160 * 120];
        let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
        reader.next_frame(&mut rgb).unwrap();
        assert!(rgb == *expected, "image {k}");
    }
}

/// The published images, in colours.
#[derive(Default)]
struct Published(Vec<Vec<u8>>);

impl Observer for Published {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event
            && let Some(image) = publication.payload.and_then(|payload| payload.downcast_ref::<Image>())
        {
            self.0.push(colours::of(&image.pixels));
        }
    }
}

/// Labels do not overlap, and are light on dark against a white wall and in fog.
#[test]
fn labels_in_pictures_are_legible() {
    let camera = Camera::new(CameraSpec { width_px: 320, height_px: 120, ..CameraSpec::default() }).unwrap();
    let mut frame = sheet((320, 120));
    frame.rgb.fill(230);
    let mut canvas = Canvas::new(&mut frame, &camera, nowhere());
    let found = |left: f64| swerve_msg::DetectedBox {
        kind: swerve_msg::ActorKind::Truck,
        score: 0.5,
        pose: swerve_geom::Pose2::default(),
        bottom_m: 0.0,
        extent: swerve_msg::Extent::default(),
        image_px: Some([left, 90.0, left + 40.0, 110.0]),
        covariance_m2: None,
        radial_speed_mps: None,
    };
    canvas.found(&Detections { boxes: vec![found(100.0), found(110.0)], ..Detections::default() });
    let dark = |row: usize| (0..320).filter(|x| frame.rgb[3 * (320 * row + x)] < 60).count();
    // Two plates of ten letters (9 x 18 pixels), one below the other.
    let rows: Vec<usize> = (0..96).filter(|row| dark(*row) > 40).collect();
    assert!((44..=52).contains(&rows.len()), "{rows:?}");
    let widest = rows.iter().map(|row| dark(*row)).max().unwrap();
    assert!(widest <= 10 * 9 + 6, "{widest}: one over the other, not beside");
}
