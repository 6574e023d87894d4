//! Tests of image and point cloud conversions.

use super::*;

#[test]
fn image_conversion_removes_padding_and_reorders_channels() {
    let bgr = sm::Image {
        header: EPOCH.header(Time::from_ms(50), "camera"),
        height: 2,
        width: 2,
        encoding: "bgr8".to_owned(),
        step: 8,
        data: vec![1, 2, 3, 4, 5, 6, 99, 99, 7, 8, 9, 10, 11, 12, 99, 99],
        ..sm::Image::default()
    };
    passes(&bgr);
    let image = image_from_ros(&bgr, EPOCH, CameraInfo::default()).unwrap();
    assert_eq!(image.pixels, Pixels::Rgb8(vec![3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10].into()));
    assert_eq!((image.stamp, image.check()), (Time::from_ms(50), Ok(())));
    let back = image_to_ros(&image, EPOCH, "camera");
    passes(&back);
    assert_eq!((back.encoding.as_str(), back.step, back.data[0]), ("rgb8", 6, 3));

    let grey = sm::Image {
        encoding: "mono8".to_owned(),
        width: 1,
        height: 1,
        step: 1,
        data: vec![7],
        ..bgr.clone()
    };
    let grey = image_from_ros(&grey, EPOCH, CameraInfo::default()).unwrap();
    assert_eq!(grey.pixels, Pixels::Rgb8(vec![7, 7, 7].into()));
    let other = sm::Image { encoding: "mono16".to_owned(), ..bgr };
    assert_eq!(
        image_from_ros(&other, EPOCH, CameraInfo::default()),
        Err(ConvertError::Encoding("mono16".to_owned()))
    );
}

#[test]
fn depth_images_convert_in_both_byte_orders() {
    let mut image = Image::new(2, 1, Encoding::DepthF32M);
    image.pixels = Pixels::DepthF32M(vec![1.5, f32::INFINITY].into());
    let ros = image_to_ros(&image, EPOCH, "camera");
    passes(&ros);
    assert_eq!((ros.encoding.as_str(), ros.step), ("32FC1", 8));
    let swapped: Vec<u8> = ros.data.chunks(4).flat_map(|n| n.iter().rev().copied()).collect();
    let big = sm::Image { is_bigendian: 1, data: swapped, ..ros.clone() };
    for one in [ros, big] {
        assert_eq!(image_from_ros(&one, EPOCH, CameraInfo::default()).unwrap().pixels, image.pixels);
    }
}

#[test]
fn camera_conversion_shifts_the_principal_point_by_half_a_pixel() {
    let intrinsics = Intrinsics {
        fx_px: 400.0,
        fy_px: 410.0,
        cx_px: 320.0,
        cy_px: 240.0,
        distortion: [0.1, -0.2, 0.001, 0.002, 0.03],
        is_parallel: false,
    };
    let camera = CameraInfo { intrinsics, ..CameraInfo::default() };
    let ros = camera_to_ros(&camera, 640, 480, EPOCH.header(Time::ZERO, "camera"));
    passes(&ros);
    assert_eq!((ros.k.0[2], ros.k.0[5], ros.p.0[2]), (319.5, 239.5, 319.5));
    assert_eq!(camera_from_ros(&ros, camera.ego_from_camera), Ok(camera));
    let fisheye = sm::CameraInfo { distortion_model: "equidistant".to_owned(), ..ros };
    assert_eq!(
        camera_from_ros(&fisheye, camera.ego_from_camera),
        Err(ConvertError::Lens("equidistant".to_owned()))
    );
}

fn cloud() -> PointCloud {
    let mut cloud = PointCloud { stamp: Time::from_ms(100), ..PointCloud::default() };
    for i in 1..50_u16 {
        let x = f32::from(i);
        let time_offset_s = -0.0625 + x / 1024.0;
        cloud.push(LidarPoint { place_m: [x, -0.5 * x, 0.25], intensity: 0.6, ring: i % 4, time_offset_s });
    }
    cloud
}

#[test]
fn point_clouds_round_trip_through_ros() {
    let cloud = cloud();
    let ros = cloud_to_ros(&cloud, EPOCH, "lidar");
    passes(&ros);
    assert_eq!((ros.width, ros.point_step, ros.data.len()), (49, 24, 49 * 24));
    // The first point, calculated by hand: 1, -0.5, 0.25, 0.6 * 255 = 153.
    assert_eq!(ros.data[..16], [1.0_f32, -0.5, 0.25, 153.0].map(f32::to_le_bytes).concat());
    let mut back = cloud_from_ros(&ros, EPOCH).unwrap();
    for (found, wanted) in back.intensity.iter_mut().zip(&*cloud.intensity) {
        assert!((*found - wanted).abs() < 1e-6);
        *found = *wanted;
    }
    assert_eq!(back, cloud);
}

/// Fields in any order and of any type, both byte orders, absolute times, points without coordinates.
#[test]
fn point_clouds_of_other_drivers_are_read() {
    let field =
        |name: &str, offset, datatype| PointField { name: name.to_owned(), offset, datatype, count: 1 };
    let mut data = Vec::new();
    for (x, t) in [(4.0_f64, 0.01_f64), (f64::NAN, 0.02), (6.0, 0.03), (0.0, 0.03)] {
        data.push(255); // intensity
        data.extend_from_slice(&7_u16.to_be_bytes());
        for axis in [x, 0.0, 0.5 * x] {
            data.extend_from_slice(&axis.to_be_bytes());
        }
        data.extend_from_slice(&(EPOCH.ns as f64 * 1e-9 + t).to_be_bytes());
    }
    let ros = sm::PointCloud2 {
        header: EPOCH.header(Time::ZERO, "lidar"),
        height: 2,
        width: 2,
        fields: vec![
            field("intensity", 0, PointField::UINT8),
            field("channel", 1, PointField::UINT16),
            field("x", 3, PointField::FLOAT64),
            field("y", 11, PointField::FLOAT64),
            field("z", 19, PointField::FLOAT64),
            field("timestamp", 27, PointField::FLOAT64),
        ],
        is_bigendian: true,
        point_step: 35,
        row_step: 70,
        data,
        is_dense: false,
    };
    passes(&ros);
    let cloud = cloud_from_ros(&ros, EPOCH).unwrap();
    assert_eq!(cloud.len(), 2);
    let last = cloud.get(1).unwrap();
    assert_eq!((last.place_m, last.intensity, last.ring), ([6.0, 0.0, 3.0], 1.0, 7));
    assert!((last.time_offset_s - 0.03).abs() < 1e-5, "{}", last.time_offset_s);
    let mut flat = ros;
    flat.fields.remove(4);
    assert_eq!(cloud_from_ros(&flat, EPOCH), Err(ConvertError::Field("z")));
}
