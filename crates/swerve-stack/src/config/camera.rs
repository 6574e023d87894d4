//! Cameras on the ego vehicle: `[camera.NAME]`.

use anyhow::Context as _;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_camera::{
    Backend, Camera, CameraSpec, Distortion, Exposure, IMAGE_SIDE_MAX_PX, Intrinsics, Outputs, RenderOptions,
    Renderer, SUBFRAMES_MAX, SensorNoise, Shutter, mount,
};
use swerve_core::{ParamError, Ranges};
use swerve_geom::{Ego, Transform, math};
use swerve_gpu::{AdapterKind, Adapters};
use swerve_scene::WeatherPreset;
use swerve_sim::sense::SensorTiming;
use swerve_vehicle::Shape;

use crate::problems::{problem, problems_of_ranges};

/// Rendering of the world.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RenderConfig {
    /// Device that renders the images.
    pub backend: RenderBackend,
    /// Weather and time of day.
    pub weather: WeatherPreset,
}

/// Device that renders images.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RenderBackend {
    /// The processor in virtual time, otherwise a graphics processor if there is one.
    #[default]
    Auto,
    /// The processor: the same images on every machine.
    Cpu,
    /// A graphics processor: its images differ from those of other devices.
    Gpu,
    /// A software driver in place of a graphics processor, for comparison.
    Software,
}

impl RenderBackend {
    /// The back end of a run in virtual time.
    pub fn in_virtual_time(self) -> Backend {
        match self {
            Self::Auto | Self::Cpu => Backend::Cpu,
            Self::Gpu => Backend::Gpu,
            Self::Software => Backend::Software,
        }
    }

    /// Back end on this machine, where images need not be the same on every machine, and the reason.
    pub fn on_this_machine(self, adapters: &Adapters) -> (Self, String) {
        match adapters.choose(AdapterKind::Gpu) {
            _ if self != Self::Auto => {
                (self, format!("render.backend = \"{}\"", self.in_virtual_time().name()))
            }
            Ok(adapter) => (Self::Gpu, adapter.to_string()),
            Err(none) => (Self::Cpu, none.to_string()),
        }
    }
}

impl RenderConfig {
    /// Starts a renderer on as many threads as [`RenderOptions::threads`] gives; the images do not depend on them.
    pub fn renderer(&self, threads: usize) -> anyhow::Result<Renderer> {
        let options = RenderOptions { backend: self.backend.in_virtual_time(), threads };
        Renderer::new(options).context("render.backend")
    }
}

/// Images that a camera publishes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Output {
    /// Colour.
    Rgb,
    /// Distance along the optical axis, metres.
    Depth,
    /// Cityscapes ids.
    Semantic,
    /// Identity of the actor at each pixel.
    Instance,
}

impl Output {
    /// All outputs, in the order of a camera's ports.
    pub const ALL: [Self; 4] = [Self::Rgb, Self::Depth, Self::Semantic, Self::Instance];

    /// Name in files and streams.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Depth => "depth",
            Self::Semantic => "semantic",
            Self::Instance => "instance",
        }
    }
}

/// One camera.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct CameraConfig {
    /// Position in the ego frame (origin: centre of the rear axle on the ground), m.
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub at_m: [f64; 3],
    /// Roll about the optical axis, degrees; positive leans right.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub roll_deg: f64,
    /// Pitch, degrees; positive downwards.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub pitch_deg: f64,
    /// Yaw, degrees; positive to the left.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub yaw_deg: f64,
    /// Width of the image, pixels.
    #[schemars(range(min = 1, max = IMAGE_SIDE_MAX_PX))]
    pub width_px: u32,
    /// Height of the image, pixels.
    #[schemars(range(min = 1, max = IMAGE_SIDE_MAX_PX))]
    pub height_px: u32,
    /// Horizontal field of view, degrees; not with `matrix` or `m_per_px`.
    #[schemars(range(min = 0.1, max = 179.9))]
    pub fov_deg: Option<f64>,
    /// Camera matrix `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`, pixels, fx and fy above 0; instead of `fov_deg`.
    pub matrix: Option<[[f64; 3]; 3]>,
    /// Orthographic projection instead of a lens, metres per pixel: with `pitch_deg = 90` a map from above.
    #[schemars(range(min = 1e-4, max = 100.0))]
    pub m_per_px: Option<f64>,
    /// Lens distortion: k1, k2, p1, p2, k3 (Brown).
    #[ranges(nested)]
    pub distortion: Distortion,
    /// Exposure.
    pub exposure: Exposure,
    /// Noise of the image sensor, keyed by the run's seed and the camera's name.
    #[ranges(nested)]
    pub noise: NoiseConfig,
    /// Fall-off towards the corners: 0 for none, 1 for that of a simple lens.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub vignetting: f64,
    /// Images that it publishes.
    pub outputs: Vec<Output>,
    /// Time between two exposures, ms.
    #[schemars(range(min = 1.0, max = 60_000.0))]
    pub period_ms: f64,
    /// Exposure time, ms; the stamp is its middle.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub exposure_ms: f64,
    /// Instants averaged over the exposure; 1 for a sharp image.
    #[schemars(range(min = 1, max = SUBFRAMES_MAX))]
    pub blur_samples: u32,
    /// Read-out time of the image, ms.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub readout_ms: f64,
    /// Rolling shutter: rows are exposed one after the other as they are read out.
    pub rolling: bool,
    /// Time from the last row to the reader, ms.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub transfer_ms: f64,
}

/// Noise of an image sensor.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseConfig {
    /// Standard deviation of the read-out noise, as a share of full scale.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub read: f64,
    /// Standard deviation of the photon noise at full scale, as a share of it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub shot: f64,
}

impl Default for CameraConfig {
    fn default() -> Self {
        Self {
            at_m: [1.75, 0.0, 1.35],
            roll_deg: 0.0,
            pitch_deg: 0.0,
            yaw_deg: 0.0,
            width_px: 640,
            height_px: 360,
            fov_deg: None,
            matrix: None,
            m_per_px: None,
            distortion: Distortion::default(),
            exposure: Exposure::default(),
            noise: NoiseConfig::default(),
            vignetting: 0.0,
            outputs: vec![Output::Rgb],
            period_ms: 50.0,
            exposure_ms: 0.0,
            blur_samples: 1,
            readout_ms: 0.0,
            rolling: false,
            transfer_ms: 0.0,
        }
    }
}

/// Field of view without `fov_deg` and without a matrix, degrees.
const FOV_DEG: f64 = 90.0;

impl CameraConfig {
    /// Camera with its noise keyed by `noise_seed`.
    pub fn camera(&self, noise_seed: u64) -> Result<Camera, ParamError> {
        let intrinsics = match (self.matrix, self.m_per_px) {
            (Some(matrix), _) => Intrinsics::Matrix(matrix),
            (None, Some(m_per_px)) => Intrinsics::OrthographicMPerPx(m_per_px),
            (None, None) => Intrinsics::HorizontalFovRad(self.fov_deg.unwrap_or(FOV_DEG).to_radians()),
        };
        Camera::new(CameraSpec {
            width_px: self.width_px,
            height_px: self.height_px,
            intrinsics,
            distortion: self.distortion,
            exposure: self.exposure,
            noise: SensorNoise { read: self.noise.read, shot: self.noise.shot, seed: noise_seed },
            vignetting: self.vignetting,
            shutter: Shutter {
                exposure_s: self.exposure_ms * 1e-3,
                blur_samples: self.blur_samples,
                readout_s: if self.rolling { self.readout_ms * 1e-3 } else { 0.0 },
                ..Shutter::default()
            },
            ..CameraSpec::default()
        })
    }

    /// Horizontal field of view, degrees.
    pub fn fov_across_deg(&self) -> f64 {
        let of = |[[fx_px, ..], ..]: [[f64; 3]; 3]| {
            2.0 * math::atan(0.5 * f64::from(self.width_px) / fx_px).to_degrees()
        };
        self.matrix.map_or(self.fov_deg.unwrap_or(FOV_DEG), of)
    }

    /// Pose in the ego frame.
    pub fn ego_from_camera(&self) -> Transform<Ego, swerve_geom::Camera> {
        let [roll, pitch, yaw] = [self.roll_deg, self.pitch_deg, self.yaw_deg].map(f64::to_radians);
        mount(self.at_m, roll, pitch, yaw)
    }

    /// Images that it publishes.
    pub fn wanted(&self) -> Outputs {
        let has = |output| self.outputs.contains(&output);
        Outputs {
            rgb: has(Output::Rgb),
            depth: has(Output::Depth),
            semantic: has(Output::Semantic),
            instance: has(Output::Instance),
        }
    }

    /// Times from exposure to the reader.
    pub fn timing(&self) -> SensorTiming {
        let &Self { exposure_ms, readout_ms, transfer_ms, rolling, .. } = self;
        SensorTiming { exposure_ms, readout_ms, transfer_ms, rolling }
    }

    /// Problems on a vehicle of this shape: keys below the camera's, and messages.
    pub(crate) fn faults(&self, shape: &Shape) -> Vec<(String, String)> {
        let mut faults = problems_of_ranges(self);
        let given = [
            ("fov_deg", self.fov_deg.is_some()),
            ("matrix", self.matrix.is_some()),
            ("m_per_px", self.m_per_px.is_some()),
        ];
        let given: Vec<&str> = given.into_iter().filter(|(_, is)| *is).map(|(key, _)| key).collect();
        if let [first, second, ..] = given[..] {
            let message = format!("expected one of `fov_deg`, `matrix`, `m_per_px`, found `{second}` too");
            faults.push((first.into(), message));
        }
        if self.outputs.is_empty() {
            faults.push(("outputs".into(), "expected at least one of rgb, depth, semantic, instance".into()));
        }
        if is_inside(self.at_m, shape) {
            let message = "expected a place outside the car's body, or behind its windscreen: it would see nothing else";
            faults.push(("at_m".into(), message.into()));
        }
        if faults.is_empty()
            && let Err(error) = self.camera(0)
        {
            let key = match error.key.as_ref() {
                "intrinsics.horizontal_fov_rad" => "fov_deg",
                "intrinsics.matrix" => "matrix",
                "intrinsics.orthographic_m_per_px" => "m_per_px",
                other => other,
            };
            let key = key.to_owned();
            faults.push((key, problem(error).1));
        }
        faults
    }
}

/// Returns true if a position is in the lower part of the car, below its windows, where only the body is visible.
fn is_inside([x, y, z]: [f64; 3], shape: &Shape) -> bool {
    /// Share of the car's height up to the windows.
    const BELT: f64 = 0.6;
    let front_m = shape.length_m - shape.rear_overhang_m;
    let along = x > -shape.rear_overhang_m + 0.05 && x < front_m - 0.05;
    along && y.abs() < 0.5 * shape.width_m - 0.05 && z > 0.2 && z < BELT * shape.height_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_camera_is_refused_by_its_key() {
        let shape = Shape::default();
        let fine = CameraConfig::default();
        assert_eq!(fine.faults(&shape), []);
        let key = |camera: CameraConfig| {
            camera.faults(&shape).iter().map(|(key, _)| key.clone()).collect::<Vec<_>>()
        };
        let with = |change: fn(&mut CameraConfig)| {
            let mut camera = fine.clone();
            change(&mut camera);
            key(camera)
        };
        assert_eq!(with(|c| c.fov_deg = Some(0.0)), ["fov_deg"]);
        assert_eq!(with(|c| c.fov_deg = Some(180.0)), ["fov_deg"]);
        assert_eq!(with(|c| c.fov_deg = Some(f64::NAN)), ["fov_deg"]);
        assert_eq!(with(|c| c.width_px = 0), ["width_px"]);
        assert_eq!(with(|c| c.height_px = 100_000), ["height_px"]);
        assert_eq!(with(|c| c.at_m = [1.0, 0.0, 0.5]), ["at_m"]);
        assert_eq!(with(|c| c.at_m = [f64::INFINITY, 0.0, 0.5]), ["at_m"]);
        assert_eq!(with(|c| c.outputs.clear()), ["outputs"]);
        assert_eq!(with(|c| c.period_ms = 0.0), ["period_ms"]);
        assert_eq!(with(|c| c.transfer_ms = -1.0), ["transfer_ms"]);
        assert_eq!(with(|c| (c.fov_deg, c.matrix) = (Some(90.0), Some([[1.0, 0.0, 0.0]; 3]))), ["fov_deg"]);
    }
}
