use crate::support::Bench;

/// Writes an image of one colour.
fn image(bench: &Bench, name: &str, [width, height]: [u32; 2], value: u8) {
    let file = std::fs::File::create(bench.path(name)).unwrap();
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![value; (3 * width * height) as usize]).unwrap();
}

#[test]
fn images_without_content_have_no_objects() {
    let bench = Bench::new();
    image(&bench, "dot.png", [1, 1], 255);
    image(&bench, "black.png", [160, 120], 0);
    image(&bench, "white.png", [97, 61], 255);
    let names = ["dot.png", "black.png", "white.png"];
    for rung in ["fastest", "full"] {
        let rest = ["--detector", "street", "--rung", rung, "--fov", "70", "--json", "--out", "boxes"];
        let said = bench.good(&[&["look"], &names[..], &rest[..]].concat());
        let expected = names.map(|name| format!("{{\"image\":\"{name}\",\"objects\":[]}}\n")).concat();
        assert_eq!(said, expected, "{rung}");
    }
    assert!(bench.path("boxes/white.png").exists());
}

#[test]
fn images_without_content_have_no_lines_no_lamps_and_no_depth() {
    let bench = Bench::new();
    image(&bench, "dot.png", [1, 1], 255);
    image(&bench, "black.png", [160, 120], 0);
    let nothing =
        |name: &str| format!("{{\"image\":\"{name}\",\"pitch_deg\":0.0,\"left\":null,\"right\":null}}\n");
    for lanes in ["--lanes", "--lanes=hough"] {
        let said =
            bench.good(&["look", "dot.png", "black.png", lanes, "--fov", "70", "--json", "--out", "drawn"]);
        assert_eq!(said, nothing("dot.png") + &nothing("black.png"), "{lanes}");
    }
    assert!(bench.path("drawn/black.png").exists());
    let said = bench.good(&["look", "dot.png", "--traffic-light", "--json"]);
    assert_eq!(said, "{\"image\":\"dot.png\",\"lamp\":null,\"share\":0.0,\"probability\":0.0}\n");
    let said = bench.good(&["look", "--stereo", "black.png", "black.png", "--out", "d.pfm", "--json"]);
    assert!(said.contains("\"known\":0.0,\"median_px\":null"), "{said}");
    let file = std::fs::read(bench.path("d.pfm")).unwrap();
    let head = b"Pf\n160 120\n-1.0\n";
    assert!(file.starts_with(head) && file.len() == head.len() + 4 * 160 * 120);
    assert!(file[head.len()..].chunks(4).all(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).is_infinite()));
}

#[test]
fn every_pixel_has_a_class() {
    let bench = Bench::new();
    let names = ["dot.png", "black.png", "white.png"];
    for (name, size, value) in [(names[0], [1, 1], 255), (names[1], [160, 120], 0), (names[2], [97, 61], 255)]
    {
        image(&bench, name, size, value);
    }
    let rest = ["--segmentation", "street", "--fov", "70", "--json", "--out", "labelled"];
    let said = bench.good(&[&["look"], &names[..], &rest[..]].concat());
    for (line, name) in said.lines().zip(names) {
        let seen: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(seen["image"], name);
        let shares = seen["shares"].as_object().unwrap();
        let sum: f64 = shares.values().map(|share| share.as_f64().unwrap()).sum();
        assert!(shares.len() == 8 && (sum - 1.0).abs() < 1e-3, "{line}");
        assert!(bench.path(&format!("labelled/{name}")).exists());
    }
    assert_eq!(said.lines().count(), 3);
    assert!(said.starts_with("{\"image\":\"dot.png\",\"shares\":{\"building\":0.0,\"other\":1.0,"), "{said}");
}

#[test]
fn folder_is_processed_whole_and_no_picture_is_lost() {
    let bench = Bench::new();
    for name in ["a/b.png", "a/a.png", "c/a.png"] {
        std::fs::create_dir_all(bench.path(name).parent().unwrap()).unwrap();
        image(&bench, name, [20, 10], 0);
    }
    bench.write("a/notes.txt", "no image");
    let said = bench.good(&["look", "a", "c/a.png", "--signs", "--json", "--out", "drawn"]);
    let images: Vec<&str> = said.lines().map(|line| line.split('"').nth(3).unwrap()).collect();
    assert_eq!(images, ["a/a.png", "a/b.png", "c/a.png"]);
    for name in ["a.png", "b.png", "a-2.png"] {
        assert!(bench.path("drawn").join(name).exists(), "{name}");
    }
    // Inputs are never overwritten, neither by their own nor by another image's output.
    let before = std::fs::read(bench.path("a/a.png")).unwrap();
    bench.write("det.txt", "1,-1,1,1,5,5,0.9\n");
    std::fs::create_dir(bench.path("empty")).unwrap();
    for (args, expected) in [
        (&["look", "a", "--signs", "--out", "a"][..], "a/a.png: is read, and would be written over"),
        (&["look", "c/a.png", "a/b.png", "a/a.png", "--signs", "--out", "a"], "is read, and would be"),
        (&["look", "--stereo", "a/a.png", "a/b.png", "--out", "a/a.png"], "is read, and would be"),
        (&["track", "det.txt", "--tracker", "sort", "--out", "det.txt"], "is read, and would be"),
        (&["look", "empty", "--signs"], "empty: expected PNG or JPEG files in it"),
        (&["look", "det.txt", "--signs"], "neither a PNG nor a JPEG image"),
        (&["look", "a/a.png", "--signs", "--least", "1.5"], "expected 0 to 1"),
    ] {
        let said = bench.swerve(args);
        assert!(said.code != Some(0) && said.stderr.contains(expected), "{args:?}: {said:?}");
    }
    assert_eq!(std::fs::read(bench.path("a/a.png")).unwrap(), before);
}

#[test]
fn what_cannot_be_looked_with_is_told() {
    let bench = Bench::new();
    image(&bench, "dot.png", [1, 1], 255);
    bench.write("text.weights", "no weights");
    bench.write("text.png", "no image");
    std::fs::write(bench.path("cut.jpg"), [0xff, 0xd8, 0xff, 0xe0, 0]).unwrap();
    for (args, expected) in [
        (&["dot.png", "--detector", "stret"][..], "no detector `stret`; did you mean `street`?"),
        (&["dot.png", "--detector", "text.weights"], "text.weights: no weights of a detector"),
        (&["dot.png", "--detector", "street", "--rung", "fasst"], "no rung `fasst`; did you mean `fast`?"),
        (
            &["dot.png", "--detector", "street", "--rung", "fast"],
            "rung `fast` needs the camera: expected --fov",
        ),
        (&["dot.png", "--detector", "street", "--fov", "180"], "expected 1 to 170 degrees"),
        (
            &["dot.png", "--lanes"],
            "--lanes needs the camera: expected --fov, or --calibration with 4 to 9 numbers",
        ),
        (&["dot.png", "--lanes=rige", "--fov", "70"], "did you mean `ridge`?"),
        (
            &["dot.png", "--lanes", "--calibration", "nan,1,0.5,1"],
            "`focal length across` is NaN, expected 0.001",
        ),
        (
            &["dot.png", "--lanes", "--calibration", "900,900,1,0.5"],
            "its optical axis is at column 1 of an image of 1 x 1 pixels, far from the middle",
        ),
        (&["dot.png", "--lanes", "--fov", "70", "--height", "0"], "expected metres above 0 and at most 100"),
        (&["dot.png", "--lanes", "--traffic-light"], "cannot be used with"),
        (&["dot.png"], "--detector <NAME>"),
        (&["--stereo", "dot.png", "dot.png", "--out", "d.pfm"], "expected at least 7 x 7"),
        (&["cut.jpg", "--lanes", "--fov", "70"], "reading cut.jpg: "),
        (&["text.png", "--detector", "street"], "reading text.png: "),
        (&["dot.png"], "--detector <NAME>"),
        (&["dot.png", "--segmentation", "street"], "--fov <DEG>"),
        (
            &["dot.png", "--segmentation", "stret", "--fov", "70"],
            "no segmentation `stret`; did you mean `street`?",
        ),
        (
            &["dot.png", "--segmentation", "text.weights", "--fov", "70"],
            "text.weights: no weights of a segmentation",
        ),
        (&["absent.png", "--detector", "street"], "reading absent.png: "),
    ] {
        let said = bench.swerve(&[&["look"], args].concat());
        assert!(said.code != Some(0) && said.stderr.contains(expected), "{args:?}: {said:?}");
    }
}
