use std::collections::BTreeMap;
use std::path::Path;

use super::*;

/// Data set of a drive of 9 s, one frame every 2 s.
fn data_set(out: &Path, set: &[&str]) -> anyhow::Result<()> {
    data_set_of("person_behind_truck.toml", 2000, out, set)
}

/// Data set of a shipped scenario with a camera whose focal length is 160 pixels.
fn data_set_of(scenario: &str, period_ms: u32, out: &Path, set: &[&str]) -> anyhow::Result<()> {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios").join(scenario);
    let file = out.with_extension("toml");
    std::fs::write(
        &file,
        format!(
            "[camera.eye]\nwidth_px = 320\nheight_px = 120\nat_m = [1.7, 0.0, 1.6]\nperiod_ms = {period_ms}\n\
             outputs = ['rgb', 'depth', 'semantic', 'instance']\n"
        ),
    )?;
    run(
        &DatasetArgs {
            code: Default::default(),
            scenarios: vec![scenario],
            out: out.to_owned(),
            config: vec![file],
            set: set.iter().map(|s| (*s).to_owned()).collect(),
            seeds: vec![1],
            weathers: vec![WeatherPreset::default()],
            tracks: false,
            crossing: None,
        },
        &swerve_stack::Registry::standard(),
    )
}

#[test]
fn labels_boxes_and_masks_agree_with_the_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set");
    data_set(&out, &[]).unwrap();
    let kitti = out.join("kitti/training");
    let index = std::fs::read_to_string(out.join("index.csv")).unwrap();
    let samples = index.lines().count() - 1;
    assert!((4..=5).contains(&samples), "{index}");
    let coco: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("coco/instances.json")).unwrap()).unwrap();
    assert_eq!(coco["images"].as_array().unwrap().len(), samples);
    let annotations = coco["annotations"].as_array().unwrap();
    assert!(!annotations.is_empty(), "the truck is in sight");
    for annotation in annotations {
        let counts: Vec<u64> = annotation["segmentation"]["counts"]
            .as_array()
            .unwrap()
            .iter()
            .map(|n| n.as_u64().unwrap())
            .collect();
        assert_eq!(counts.iter().sum::<u64>(), 320 * 120);
        let inside: u64 = counts.iter().skip(1).step_by(2).sum();
        assert_eq!(inside, annotation["area"].as_u64().unwrap());
    }
    let mut labels = 0;
    for k in 0..samples {
        let text = std::fs::read_to_string(kitti.join(format!("label_2/{k:06}.txt"))).unwrap();
        for line in text.lines() {
            labels += 1;
            let words: Vec<&str> = line.split(' ').collect();
            assert_eq!(words.len(), 15, "{line}");
            let numbers: Vec<f64> = words[1..].iter().map(|word| word.parse().unwrap()).collect();
            assert!((0.0..=1.0).contains(&numbers[0]) && (0.0..=2.0).contains(&numbers[1]), "{line}");
            // The image box is the projection of the 3D box.
            let [height_m, x_m, y_m, z_m] = [numbers[7], numbers[10], numbers[11], numbers[12]];
            let focal_px = 160.0;
            let middle_px = 160.0 + focal_px * x_m / z_m;
            assert!(
                numbers[3] - 1.0 <= middle_px.clamp(0.0, 320.0)
                    && middle_px.clamp(0.0, 320.0) <= numbers[5] + 1.0,
                "{line}"
            );
            let bottom_px = 60.0 + focal_px * y_m / z_m;
            assert!(bottom_px - focal_px * height_m / z_m > numbers[4] - 8.0, "{line}");
        }
        for name in ["image_2", "depth", "semantic", "instance"] {
            assert!(kitti.join(format!("{name}/{k:06}.png")).exists());
        }
        let calibration = std::fs::read_to_string(kitti.join(format!("calib/{k:06}.txt"))).unwrap();
        let p2 = calibration.lines().find_map(|line| line.strip_prefix("P2: ")).unwrap();
        let p2: Vec<f64> = p2.split(' ').map(|word| word.parse().unwrap()).collect();
        let wanted = [160.0, 0.0, 160.0, 0.0, 0.0, 160.0, 60.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        assert!(p2.len() == 12 && p2.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{calibration}");
    }
    assert_eq!(labels, annotations.len());
    let error = data_set(&out, &["camera.eye.period_ms=4000"]).unwrap_err().to_string();
    assert!(error.contains("holds a data set of other scenarios"), "{error}");
    std::fs::remove_file(out.join(".dataset.json")).unwrap();
    let error = data_set(&out, &[]).unwrap_err().to_string();
    assert!(error.contains("expected an empty folder"), "{error}");
}

/// Classes of the pixels of an image of `data_set_of`, by rows.
fn classes(out: &Path, sample: usize) -> Vec<u8> {
    let file = std::fs::File::open(out.join(format!("kitti/training/semantic/{sample:06}.png"))).unwrap();
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
    let mut pixels = vec![0; 320 * 120];
    assert_eq!(reader.next_frame(&mut pixels).unwrap().buffer_size(), pixels.len(), "8 bits each");
    pixels
}

#[test]
fn lanes_lights_and_cars_of_a_map_have_their_labels() {
    let [road, pavement, light, car] = [7, 8, 19, 26];
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set");
    data_set_of("maps/left_turn.toml", 1000, &out, &[]).unwrap();
    let index = std::fs::read_to_string(out.join("index.csv")).unwrap();
    let images: Vec<Vec<u8>> = (0..index.lines().count() - 1).map(|sample| classes(&out, sample)).collect();
    assert!((19..=30).contains(&images.len()), "{index}");
    // Row 118 is 4.4 m before the camera, and 140 columns from the middle are 3.9 m: lanes are 3.5 m wide, with a pavement
    // on the right. The junction begins after 98 m, more than 7 s.
    let near = |image: &[u8], column: usize| image[118 * 320 + column];
    assert!(images.iter().all(|image| near(image, 160) == road), "the ego is on its lane");
    for image in &images[..6] {
        assert_eq!([20, 300].map(|column| near(image, column)), [road, pavement]);
    }
    // Lamps come nearer, and are behind the ego after the turn.
    let count = |image: &[u8], class: u8| image.iter().filter(|pixel| **pixel == class).count();
    let lamps: Vec<usize> = images.iter().map(|image| count(image, light)).collect();
    assert!(lamps[..7].iter().all(|pixels| *pixels > 0) && lamps[6] > 4 * lamps[2], "{lamps:?}");
    assert_eq!(lamps.last(), Some(&0), "{lamps:?}");
    // A car of 1.8 x 1.5 m has 10 pixels at 83 m. The first is as near after 4.7 s, and passes after 10 s; the second
    // follows 30 m behind, slower relative to the waiting ego.
    let coco = std::fs::read_to_string(out.join("coco/instances.json")).unwrap();
    let coco: serde_json::Value = serde_json::from_str(&coco).unwrap();
    let mut of_cars = BTreeMap::<u64, usize>::new();
    for annotation in coco["annotations"].as_array().unwrap() {
        *of_cars.entry(annotation["track_id"].as_u64().unwrap()).or_default() += 1;
    }
    assert!(of_cars.keys().eq(&[1, 2]) && of_cars.values().all(|n| (4..=7).contains(n)), "{of_cars:?}");
    let mut labels = 0;
    for (sample, image) in images.iter().enumerate() {
        let text =
            std::fs::read_to_string(out.join(format!("kitti/training/label_2/{sample:06}.txt"))).unwrap();
        assert!(text.lines().all(|line| line.starts_with("Car ")), "{text}");
        assert!(text.is_empty() || count(image, car) >= 10 * text.lines().count(), "{sample}: {text}");
        labels += text.lines().count();
    }
    assert_eq!(labels, of_cars.values().sum::<usize>());
}

#[test]
fn data_set_refuses_unsuitable_configurations() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set");
    let told = |set: &[&str]| data_set(&out, set).unwrap_err().to_string();
    assert!(told(&["camera.eye.outputs=[\"rgb\"]"]).contains("`depth` is missing"));
    assert!(told(&["camera.eye.distortion.k1=0.1"]).contains("rectified"));
    assert!(told(&["camera.other.fov_deg=80"]).contains("of one camera"));
    assert!(!out.exists());
}

/// Contents of all files below a folder.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for path in swerve_report::files::entries(folder).unwrap() {
        if path.is_dir() {
            all.extend(contents(&path));
        } else {
            all.insert(path.clone(), std::fs::read(&path).unwrap());
        }
    }
    all
}

#[test]
fn interrupted_data_set_is_continued_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (out, config) = (folder.path().join("set"), folder.path().join("eye.toml"));
    std::fs::write(
        &config,
        "[camera.eye]\nwidth_px = 96\nheight_px = 64\nat_m = [1.7, 0.0, 1.6]\nperiod_ms = 3000\n\
         outputs = ['rgb', 'depth', 'semantic', 'instance']\n",
    )
    .unwrap();
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/person_crossing.toml");
    let args = DatasetArgs {
        code: Default::default(),
        scenarios: vec![scenario],
        out: out.clone(),
        config: vec![config],
        set: vec![],
        seeds: vec![1, 2],
        weathers: vec![WeatherPreset::default()],
        tracks: false,
        crossing: None,
    };
    let registry = swerve_stack::Registry::standard();
    make(&args, &registry).unwrap();
    let whole = contents(&out);
    let rows = String::from_utf8(whole[&out.join(INDEX)].clone()).unwrap();
    let first = rows.lines().filter(|row| row.contains(",1,")).count();
    let samples = rows.lines().count() - 1;
    assert!(first > 0 && first < samples, "{rows}");
    // State after a kill in the second drive: its first sample exists, and COCO's list covers the first drive.
    let mut state: State = serde_json::from_slice(&whole[&out.join(".dataset.json")]).unwrap();
    assert!(is_complete(&out) && state.samples == samples);
    (state.drives, state.samples, state.is_complete) = (1, first, false);
    state.write(&out).unwrap();
    assert!(!is_complete(&out));
    let torn: String = rows.split_inclusive('\n').take(2 + first).collect();
    std::fs::write(out.join(INDEX), &torn[..torn.len() - 3]).unwrap();
    for k in first + 1..samples {
        std::fs::remove_file(out.join(format!("kitti/training/image_2/{k:06}.png"))).unwrap();
    }
    make(&args, &registry).unwrap();
    let again = contents(&out);
    let differing: Vec<_> = whole.iter().filter(|(path, bytes)| again.get(*path) != Some(bytes)).collect();
    assert!(
        again.len() == whole.len() && differing.is_empty(),
        "{:?}",
        differing.first().map(|(path, _)| path)
    );
    // A finished data set is left unchanged.
    make(&args, &registry).unwrap();
    assert_eq!(contents(&out), whole);
}

#[test]
fn written_tracks_of_drives_and_crossings_can_be_read() {
    use swerve_prediction::recorded::commonroad_csv;
    let folder = tempfile::tempdir().unwrap();
    let args = DatasetArgs {
        code: Default::default(),
        scenarios: vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/person_crossing.toml")],
        out: folder.path().join("set"),
        config: vec![],
        set: vec![],
        seeds: vec![3, 4],
        weathers: vec![WeatherPreset::default()],
        tracks: true,
        crossing: Some(2),
    };
    run(&args, &swerve_stack::Registry::standard()).unwrap();
    let read = |name: &str| {
        let text = std::fs::read_to_string(args.out.join(name)).unwrap();
        commonroad_csv(&text).unwrap().into_values().collect::<Vec<_>>()
    };
    let (drives, minutes) = (read("person_crossing.csv"), read("crossing.csv"));
    assert_eq!((drives.len(), minutes.len()), (2, 2));
    for drive in &drives {
        let [ego, person, ..] = &drive.tracks[..] else { panic!("{drive:?}") };
        assert_eq!((ego.id.0, person.kind), (0, swerve_msg::ActorKind::Pedestrian));
        assert_eq!(ego.samples.len(), person.samples.len());
        let gone_m = ego.samples[0].1.distance(ego.samples[ego.samples.len() - 1].1);
        assert!(gone_m > 30.0, "{gone_m}");
    }
    assert!(minutes[0].tracks.len() > 5 && minutes[0].tracks != minutes[1].tracks);
    let before = contents(&args.out);
    run(&args, &swerve_stack::Registry::standard()).unwrap();
    assert_eq!(contents(&args.out), before);
    let other = DatasetArgs { seeds: vec![3], ..args };
    let told = run(&other, &swerve_stack::Registry::standard()).unwrap_err().to_string();
    assert!(told.contains("holds a data set of other scenarios"), "{told}");
}
