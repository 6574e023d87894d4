//! Sensor parameters: exposure, vignetting, rain and noise of one camera in one frame.

use std::sync::OnceLock;

use swerve_scene::hash;

use super::light::Environment;
use crate::Camera;

/// Table of 1024 quantiles of the normal distribution.
struct Normal(Vec<f32>);

impl Normal {
    fn get() -> &'static Self {
        static NORMAL: OnceLock<Normal> = OnceLock::new();
        NORMAL
            .get_or_init(|| Self((0..1024).map(|k| quantile((f64::from(k) + 0.5) / 1024.0) as f32).collect()))
    }
}

/// Quantile of the standard normal distribution at probability `p`, by bisection on the error function.
fn quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-6.0, 6.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if 0.5 * (1.0 + libm::erf(middle * core::f64::consts::FRAC_1_SQRT_2)) < p {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Sensor of one camera for one frame.
pub(crate) struct Sensor<'a> {
    pub(crate) exposure: f32,
    pub(crate) vignetting: f32,
    /// Slope and offset of `x` and `y` over focal length.
    pub(crate) across: [f32; 2],
    pub(crate) down: [f32; 2],
    pub(crate) read: f32,
    pub(crate) shot: f32,
    pub(crate) normal: &'a [f32],
    pub(crate) key: u32,
    pub(crate) rain: [f32; 3],
    pub(crate) rain_key: u32,
    pub(crate) tiles: &'a [u32],
}

impl Sensor<'_> {
    /// 1024 quantiles of the normal distribution, from which noise is drawn.
    pub(crate) fn quantiles() -> &'static [f32] {
        &Normal::get().0
    }
}

impl<'a> Sensor<'a> {
    pub(crate) fn new(camera: &Camera, environment: &Environment, frame: u64, tiles: &'a [u32]) -> Self {
        let spec = camera.spec();
        let (fx, fy, cx, cy) = camera.focal_px();
        let drop = 0.16 * environment.rain;
        Self {
            exposure: environment.exposure,
            vignetting: spec.vignetting as f32,
            across: [(1.0 / fx) as f32, ((0.5 - cx) / fx) as f32],
            down: [(1.0 / fy) as f32, ((0.5 - cy) / fy) as f32],
            read: spec.noise.read as f32,
            shot: spec.noise.shot as f32,
            normal: &Normal::get().0,
            key: hash::keyed(spec.noise.seed, hash::fold(frame)),
            rain: environment.horizon.map(|c| (c + 0.02) * drop),
            rain_key: hash::fold(frame ^ 0x7a1d_0000_0000),
            tiles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_quantiles_are_normal() {
        let table = &Normal::get().0;
        let mean = table.iter().sum::<f32>() / 1024.0;
        let variance = table.iter().map(|x| x * x).sum::<f32>() / 1024.0;
        assert!(mean.abs() < 1e-4 && (variance - 1.0).abs() < 0.01, "{mean} {variance}");
    }
}
