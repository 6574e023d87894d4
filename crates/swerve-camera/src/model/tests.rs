use super::*;

fn refused(change: impl Fn(&mut CameraSpec)) -> ParamError {
    let mut spec = CameraSpec::default();
    change(&mut spec);
    Camera::new(spec).expect_err("the camera is refused")
}

#[test]
fn camera_rejects_invalid_specs_by_key() {
    let fov = |rad: f64| refused(move |s| s.intrinsics = Intrinsics::HorizontalFovRad(rad)).key;
    let matrix = |m: [[f64; 3]; 3]| refused(move |s| s.intrinsics = Intrinsics::Matrix(m)).key;
    let nan = f64::NAN;
    assert_eq!(refused(|s| s.width_px = 0).key, "width_px");
    assert_eq!(refused(|s| s.height_px = 0).key, "height_px");
    assert_eq!(refused(|s| s.height_px = 100_000).key, "height_px");
    assert_eq!(refused(|s| (s.width_px, s.height_px) = (8192, 8192)).key, "width_px x height_px");
    for rad in [0.0, core::f64::consts::PI, -1.0, 4.0, nan, f64::INFINITY] {
        assert_eq!(fov(rad), "intrinsics.horizontal_fov_rad");
    }
    let good = [[400.0, 0.0, 400.0], [0.0, 400.0, 300.0], [0.0, 0.0, 1.0]];
    for (row, column, value) in [
        (0, 0, 0.0),
        (1, 1, -5.0),
        (0, 1, 0.1),
        (1, 0, 0.1),
        (2, 2, 2.0),
        (0, 2, nan),
        (1, 2, 1e9),
        (0, 0, nan),
    ] {
        let mut bad = good;
        bad[row][column] = value;
        assert_eq!(matrix(bad), "intrinsics.matrix", "{bad:?}");
    }
    for scale in [0.0, -1.0, nan, 1e9] {
        let field = refused(|s| s.intrinsics = Intrinsics::OrthographicMPerPx(scale)).key;
        assert_eq!(field, "intrinsics.orthographic_m_per_px");
    }
    let map = Intrinsics::OrthographicMPerPx(0.1);
    assert_eq!(refused(|s| (s.intrinsics, s.vignetting) = (map, 0.1)).key, "vignetting");
    assert_eq!(refused(|s| (s.intrinsics, s.distortion.k1) = (map, 0.1)).key, "distortion");
    assert_eq!(refused(|s| s.near_m = 0.0).key, "near_m");
    assert_eq!(refused(|s| s.far_m = 0.05).key, "far_m");
    assert_eq!(refused(|s| s.vignetting = nan).key, "vignetting");
    assert_eq!(refused(|s| s.noise.read = -0.1).key, "noise.read");
    assert_eq!(refused(|s| s.noise.shot = nan).key, "noise.shot");
    assert_eq!(refused(|s| s.exposure = Exposure::Factor(0.0)).key, "exposure.factor");
    assert_eq!(refused(|s| s.exposure = Exposure::Stops(nan)).key, "exposure.stops");
    assert_eq!(refused(|s| s.shutter.exposure_s = -0.1).key, "shutter.exposure_s");
    assert_eq!(refused(|s| s.shutter.readout_s = 5.0).key, "shutter.readout_s");
    assert_eq!(refused(|s| s.shutter.blur_samples = 0).key, "shutter.blur_samples");
    assert_eq!(refused(|s| s.shutter.readout_slabs = 1000).key, "shutter.readout_slabs");
    assert_eq!(refused(|s| s.distortion.k2 = nan).key, "distortion.k2");
    assert_eq!(refused(|s| s.distortion.k1 = -0.9).key, "distortion");
    let text = refused(|s| s.width_px = 0).to_string();
    assert_eq!(text, "`width_px` is 0, expected 1 to 8192");
}

#[test]
fn field_of_view_spans_the_image_edges() {
    let camera = Camera::new(CameraSpec::default()).unwrap();
    let [left, top] = camera.project(Point::new(-5.0, 0.0, 5.0)).unwrap();
    assert!(left.abs() < 1e-9 && (top - 300.0).abs() < 1e-9);
    assert_eq!(camera.project(Point::new(0.0, 0.0, -1.0)), None);
}

#[test]
fn undistort_inverts_distort() {
    let distortion = Distortion { k1: -0.28, k2: 0.09, p1: 0.0008, p2: -0.0006, k3: -0.01 };
    let camera = Camera::new(CameraSpec { distortion, ..CameraSpec::default() }).unwrap();
    for row in 0..=12 {
        for column in 0..=16 {
            let pixel = [50.0 * f64::from(column), 50.0 * f64::from(row)];
            let [x, y] = camera.ray(pixel);
            let back = camera.project(Point::new(7.0 * x, 7.0 * y, 7.0)).unwrap();
            assert!(
                (back[0] - pixel[0]).abs() < 1e-6 && (back[1] - pixel[1]).abs() < 1e-6,
                "{pixel:?} {back:?}"
            );
        }
    }
}

#[test]
fn mount_follows_pitch_and_yaw() {
    let ahead = mount([1.5, 0.2, 1.4], 0.0, 0.0, 0.0);
    let p = ahead * Point::new(0.5, 0.25, 2.0);
    assert!((p - Point::new(3.5, -0.3, 1.15)).norm() < 1e-12, "{p:?}");
    let down = mount([0.0; 3], 0.0, 0.1, 0.0) * Point::new(0.0, 0.0, 1.0);
    assert!(down.coords.z < -0.09 && down.coords.x > 0.99);
    let left = mount([0.0; 3], 0.0, 0.0, 0.1) * Point::new(0.0, 0.0, 1.0);
    assert!(left.coords.y > 0.09);
}
