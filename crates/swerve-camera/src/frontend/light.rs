//! Light of a weather: sun, sky, haze, and metered exposure.

use swerve_scene::Scene;
use swerve_scene::vector::{add, dot, mix, normalized, scale};

use crate::model::Exposure;

/// Lighting parameters. Radiances are relative to white paper in full sun; colours are linear.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Environment {
    /// Direction towards the sun, map frame.
    pub(crate) sun: [f32; 3],
    /// Radiance of white paper facing the sun, from the sun only.
    pub(crate) sunlight: [f32; 3],
    pub(crate) zenith: [f32; 3],
    pub(crate) horizon: [f32; 3],
    /// Glow around the sun.
    pub(crate) glow: [f32; 3],
    pub(crate) cloud: [f32; 3],
    /// Radiance of white paper from the sky only, facing up, and from the ground only, facing down.
    pub(crate) ambient: [f32; 3],
    pub(crate) bounce: [f32; 3],
    pub(crate) fog: [f32; 3],
    pub(crate) fog_1pm: f32,
    pub(crate) cloudiness: f32,
    pub(crate) wetness: f32,
    pub(crate) puddles: f32,
    pub(crate) rain: f32,
    pub(crate) lamps_on: bool,
    /// Factor from radiance to the sensor's scale.
    pub(crate) exposure: f32,
}

/// Horizon colour of a clear evening.
const EVENING_SKY: [f32; 3] = [0.62, 0.24, 0.06];
/// Sky colour in heavy rain with a low sun.
const BELOW_THE_CLOUDS: [f32; 3] = [0.20, 0.105, 0.055];
/// Light of street lamps scattered by walls and ground: a seventh of that on the road between them.
const SCATTERED_LAMPLIGHT: [f32; 3] = [0.018, 0.015, 0.0105];

const WHITE: [f32; 3] = [0.2126, 0.7152, 0.0722];

fn smooth(x: f32, low: f32, high: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl Environment {
    /// Lighting of a scene for a camera with this exposure.
    pub(crate) fn new(scene: &Scene, exposure: Exposure) -> Self {
        let (weather, sun) = (&scene.weather, scene.sun.direction().map(|x| x as f32));
        let sun = normalized(sun);
        let height = sun[2];
        let (cloudiness, direct) = (weather.cloudiness as f32, weather.direct_share() as f32);
        // Light of a low sun has a longer path through the air and loses its blue.
        let low = smooth(height, 0.0, 0.5);
        let up = smooth(height, -0.03, 0.06);
        let colour = mix([0.95, 0.42, 0.13], [1.0, 0.95, 0.85], low.sqrt());
        let sunlight = scale(colour, up * direct);
        let day = smooth(height, -0.16, 0.20);
        let clear_zenith = scale(mix([0.09, 0.14, 0.30], [0.10, 0.25, 0.62], low), day);
        let clear_horizon = scale(mix([0.58, 0.34, 0.19], [0.50, 0.66, 0.86], low), day);
        let grey =
            scale(mix([0.40, 0.37, 0.36], [0.60, 0.62, 0.65], low), day * (1.0 - 0.25 * weather.rain as f32));
        // The clear sky around a low sun is orange. Clouds hide that, but under heavy rain clouds little light passes
        // from above, and most comes in below their edge, dim and reddened. At noon both shares are zero.
        let dusk = 1.0 - low;
        let open = dusk * (1.0 - smooth(cloudiness, 0.2, 0.85));
        let heavy = dusk * smooth(weather.rain as f32, 0.25, 1.0);
        let clear_horizon = mix(clear_horizon, scale(EVENING_SKY, day), open);
        let grey = scale(mix(grey, scale(BELOW_THE_CLOUDS, day), heavy), 1.0 - 0.7 * heavy);
        let night = [0.0016, 0.0022, 0.0042];
        let cover = smooth(cloudiness, 0.3, 1.0);
        let zenith = add(mix(clear_zenith, scale(grey, 0.75), cover), night);
        let horizon = add(mix(clear_horizon, grey, cover), scale(night, 2.0));
        let glow = scale(mix([1.1, 0.50, 0.16], [0.55, 0.52, 0.48], low), up * direct);
        // Cloud colour: near the sun's in clear weather, grey in bad weather.
        let cloud = add(mix(scale(add(sunlight, clear_horizon), 0.62), grey, cover), night);
        let ambient = scale(add(scale(zenith, 0.45), scale(horizon, 0.33)), 1.0 - 0.1 * cover);
        // Light between lamps, scattered by walls and ground.
        let scattered = if weather.lamps_on { 1.0 - day } else { 0.0 };
        let ambient = add(ambient, scale(SCATTERED_LAMPLIGHT, scattered));
        let lit = add(scale(sunlight, height.max(0.0)), ambient);
        let bounce = scale(lit, 0.16);
        // A low sun lights little of the ground, but the bright sky is in the image too.
        let metered = dot(lit, WHITE) + 0.25 * dot(horizon, WHITE);
        let meter = 0.82 / metered.max(0.14);
        let exposure = match exposure {
            Exposure::Metered => meter,
            Exposure::Stops(stops) => meter * libm::exp2(stops) as f32,
            Exposure::Factor(factor) => factor as f32,
        };
        Self {
            sun,
            sunlight,
            zenith,
            horizon,
            glow,
            cloud,
            ambient,
            bounce,
            fog: mix(horizon, scale(zenith, 0.9), 0.15),
            fog_1pm: weather.fog_1pm as f32,
            cloudiness,
            wetness: weather.wetness as f32,
            puddles: weather.puddles as f32,
            rain: weather.rain as f32,
            lamps_on: weather.lamps_on,
            exposure,
        }
    }

    /// Returns true if the sun is strong enough to cast visible shadows.
    pub(crate) fn has_shadows(&self) -> bool {
        dot(self.sunlight, WHITE) > 0.01 * dot(self.ambient, WHITE)
    }

    /// Direction towards the sun if it casts shadows.
    pub(crate) fn shadow_sun(&self) -> Option<[f32; 3]> {
        self.has_shadows().then_some(self.sun)
    }
}

#[cfg(test)]
mod tests {
    use swerve_scene::WeatherPreset;

    use super::*;

    /// Red over blue at the horizon: blue sky at noon; orange at sunset where the sun is visible, and also below heavy
    /// rain clouds, hardly brighter than street lamps there.
    #[test]
    fn horizon_is_warm_at_sunset_and_cold_at_noon() {
        let light = |preset| Environment::new(&Scene::new(preset), Exposure::Metered);
        let warmth = |preset| {
            let light = light(preset);
            light.horizon[0] / light.horizon[2]
        };
        for preset in [WeatherPreset::ClearSunset, WeatherPreset::WetSunset, WeatherPreset::HardRainSunset] {
            assert!(warmth(preset) > 1.5, "{preset:?}: {}", warmth(preset));
        }
        for preset in [WeatherPreset::ClearNoon, WeatherPreset::HardRainNoon] {
            assert!(warmth(preset) < 1.0, "{preset:?}: {}", warmth(preset));
        }
        let sky = |preset| dot(light(preset).horizon, WHITE);
        assert!(sky(WeatherPreset::HardRainSunset) < 0.4 * sky(WeatherPreset::HardRainNoon));
    }

    /// Light of lamps scattered between houses is present at night only.
    #[test]
    fn lamps_scatter_light_only_at_night() {
        let ambient = |preset, lamps_on| {
            let mut scene = Scene::new(preset);
            scene.weather.lamps_on = lamps_on;
            Environment::new(&scene, Exposure::Metered).ambient
        };
        let night = WeatherPreset::ClearNight;
        assert!(dot(ambient(night, true), WHITE) > 3.0 * dot(ambient(night, false), WHITE));
        assert_eq!(ambient(WeatherPreset::ClearNoon, true), ambient(WeatherPreset::ClearNoon, false));
    }
}
