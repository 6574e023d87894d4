//! Conversion of images and camera calibration.

use swerve_geom::{Camera, Ego, Transform};
use swerve_msg::{CameraInfo, Encoding, Image, Intrinsics, Pixels};

use super::{ConvertError, Epoch};
use crate::msg::sensor_msgs as sm;
use crate::msg::sensor_msgs::bytes_per_pixel;
use crate::msg::{Matrix, std_msgs::Header};

/// Half a pixel: from the centre of the first pixel (the origin in ROS) to its corner (the origin here).
const HALF_PX: f64 = 0.5;

/// Converts an image to `sensor_msgs/Image`: colour as `rgb8`, depth as `32FC1` in metres (REP 118), classes as
/// `mono8`, instances as `32SC1`.
pub fn image_to_ros(image: &Image, epoch: Epoch, frame_id: &str) -> sm::Image {
    let encoding = match image.encoding() {
        Encoding::Rgb8 => "rgb8",
        Encoding::DepthF32M => "32FC1",
        Encoding::ClassU8 => "mono8",
        Encoding::InstanceU32 => "32SC1",
    };
    sm::Image {
        header: epoch.header(image.stamp, frame_id),
        height: image.height_px,
        width: image.width_px,
        encoding: encoding.to_owned(),
        is_bigendian: 0,
        step: image.width_px * image.encoding().bytes_per_pixel() as u32,
        data: image.pixels.bytes().to_vec(),
    }
}

/// Converts a validated colour (`mono8` as grey) or depth image. The message does not contain the camera's
/// calibration.
///
/// # Errors
/// If the encoding is not supported.
pub fn image_from_ros(image: &sm::Image, epoch: Epoch, camera: CameraInfo) -> Result<Image, ConvertError> {
    let encoding = image.encoding.as_str();
    // Byte of the pixel for each of red, green, blue.
    let channels = match encoding {
        "rgb8" | "rgba8" | "8UC3" => Some([0, 1, 2]),
        "bgr8" | "bgra8" => Some([2, 1, 0]),
        "mono8" | "8UC1" => Some([0, 0, 0]),
        "32FC1" => None,
        other => return Err(ConvertError::Encoding(other.to_owned())),
    };
    let size = bytes_per_pixel(encoding).expect("all of these are in the table") as usize;
    let (width, step) = (image.width as usize, (image.step as usize).max(1));
    let rows = image.data.chunks_exact(step).take(image.height as usize);
    let pixels = rows.flat_map(|row| row.chunks_exact(size).take(width));
    let pixels = match channels {
        Some(channels) => {
            Pixels::Rgb8(pixels.flat_map(|p| channels.map(|c| p[c])).collect::<Vec<_>>().into())
        }
        None => {
            Pixels::DepthF32M(pixels.map(|p| depth(p, image.is_bigendian != 0)).collect::<Vec<_>>().into())
        }
    };
    Ok(Image {
        stamp: epoch.time(image.header.stamp),
        width_px: image.width,
        height_px: image.height,
        camera,
        pixels,
    })
}

fn depth(pixel: &[u8], big_endian: bool) -> f32 {
    let bytes = [pixel[0], pixel[1], pixel[2], pixel[3]];
    if big_endian { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) }
}

/// Converts a camera to `sensor_msgs/CameraInfo`: `plumb_bob`, not rectified.
pub fn camera_to_ros(camera: &CameraInfo, width_px: u32, height_px: u32, header: Header) -> sm::CameraInfo {
    let Intrinsics { fx_px, fy_px, cx_px, cy_px, distortion, is_parallel: _ } = camera.intrinsics;
    let (cx, cy) = (cx_px - HALF_PX, cy_px - HALF_PX);
    sm::CameraInfo {
        header,
        height: height_px,
        width: width_px,
        distortion_model: "plumb_bob".to_owned(),
        d: distortion.to_vec(),
        k: Matrix([fx_px, 0.0, cx, 0.0, fy_px, cy, 0.0, 0.0, 1.0]),
        r: Matrix([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        p: Matrix([fx_px, 0.0, cx, 0.0, 0.0, fy_px, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
        ..sm::CameraInfo::default()
    }
}

/// Converts a calibration, given the mounting pose.
///
/// # Errors
/// If the lens model is not `plumb_bob`.
pub fn camera_from_ros(
    info: &sm::CameraInfo,
    ego_from_camera: Transform<Ego, Camera>,
) -> Result<CameraInfo, ConvertError> {
    let straight = info.d.iter().all(|d| *d == 0.0);
    if info.distortion_model != "plumb_bob" && !straight {
        return Err(ConvertError::Lens(info.distortion_model.clone()));
    }
    let mut distortion = [0.0; 5];
    for (ours, theirs) in distortion.iter_mut().zip(&info.d) {
        *ours = *theirs;
    }
    let k = &info.k.0;
    let intrinsics = Intrinsics {
        fx_px: k[0],
        fy_px: k[4],
        cx_px: k[2] + HALF_PX,
        cy_px: k[5] + HALF_PX,
        distortion,
        is_parallel: false,
    };
    Ok(CameraInfo { intrinsics, ego_from_camera })
}
