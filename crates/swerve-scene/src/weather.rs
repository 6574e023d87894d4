//! Weather: fourteen presets modelled on CARLA's, a clear night, and their parameters.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_geom::math;

/// Weather preset.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize, JsonSchema,
)]
#[serde(try_from = "String", into = "&'static str")]
pub enum WeatherPreset {
    /// High sun, few clouds.
    #[default]
    ClearNoon,
    /// High sun behind clouds.
    CloudyNoon,
    /// High sun, wet ground.
    WetNoon,
    /// Clouds, wet ground.
    WetCloudyNoon,
    /// Light rain at noon.
    SoftRainNoon,
    /// Rain at noon.
    MidRainyNoon,
    /// Heavy rain at noon.
    HardRainNoon,
    /// Low sun, few clouds.
    ClearSunset,
    /// Low sun behind clouds.
    CloudySunset,
    /// Low sun, wet ground.
    WetSunset,
    /// Low sun behind clouds, wet ground.
    WetCloudySunset,
    /// Light rain at sunset.
    SoftRainSunset,
    /// Rain at sunset.
    MidRainSunset,
    /// Heavy rain at sunset.
    HardRainSunset,
    /// No sun, lamps on.
    ClearNight,
}

/// Error for an unknown weather.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("unknown weather `{asked}`; the weathers are {}", WeatherPreset::names())]
pub struct UnknownWeather {
    /// The unknown name.
    pub asked: String,
}

impl WeatherPreset {
    /// All presets.
    pub const ALL: [Self; 15] = [
        Self::ClearNoon,
        Self::CloudyNoon,
        Self::WetNoon,
        Self::WetCloudyNoon,
        Self::SoftRainNoon,
        Self::MidRainyNoon,
        Self::HardRainNoon,
        Self::ClearSunset,
        Self::CloudySunset,
        Self::WetSunset,
        Self::WetCloudySunset,
        Self::SoftRainSunset,
        Self::MidRainSunset,
        Self::HardRainSunset,
        Self::ClearNight,
    ];

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::ClearNoon => "clear_noon",
            Self::CloudyNoon => "cloudy_noon",
            Self::WetNoon => "wet_noon",
            Self::WetCloudyNoon => "wet_cloudy_noon",
            Self::SoftRainNoon => "soft_rain_noon",
            Self::MidRainyNoon => "mid_rainy_noon",
            Self::HardRainNoon => "hard_rain_noon",
            Self::ClearSunset => "clear_sunset",
            Self::CloudySunset => "cloudy_sunset",
            Self::WetSunset => "wet_sunset",
            Self::WetCloudySunset => "wet_cloudy_sunset",
            Self::SoftRainSunset => "soft_rain_sunset",
            Self::MidRainSunset => "mid_rain_sunset",
            Self::HardRainSunset => "hard_rain_sunset",
            Self::ClearNight => "clear_night",
        }
    }

    fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }
}

impl From<WeatherPreset> for &'static str {
    fn from(preset: WeatherPreset) -> Self {
        preset.name()
    }
}

impl FromStr for WeatherPreset {
    type Err = UnknownWeather;

    /// Accepts `clear_noon` and, as in CARLA, `ClearNoon`.
    fn from_str(text: &str) -> Result<Self, UnknownWeather> {
        let plain = |name: &str| name.replace('_', "").to_ascii_lowercase();
        Self::ALL
            .into_iter()
            .find(|preset| preset.name() == text || format!("{preset:?}") == text)
            .or_else(|| Self::ALL.into_iter().find(|preset| plain(preset.name()) == plain(text)))
            .ok_or_else(|| UnknownWeather { asked: text.to_owned() })
    }
}

impl TryFrom<String> for WeatherPreset {
    type Error = UnknownWeather;

    fn try_from(text: String) -> Result<Self, UnknownWeather> {
        text.parse()
    }
}

/// Position of the sun, the same everywhere in the map.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sun {
    /// Direction of the sun in the ground plane, counter-clockwise from the map's x axis, radians.
    pub azimuth_rad: f64,
    /// Elevation above the horizon, radians; negative at night.
    pub elevation_rad: f64,
}

impl Sun {
    /// Unit vector towards the sun, map frame.
    pub fn direction(&self) -> [f64; 3] {
        let (sin_azimuth, cos_azimuth) = math::sin_cos(self.azimuth_rad);
        let (sin_elevation, cos_elevation) = math::sin_cos(self.elevation_rad);
        [cos_azimuth * cos_elevation, sin_azimuth * cos_elevation, sin_elevation]
    }
}

/// State of air and ground.
#[derive(Clone, Copy, PartialEq, Debug, Ranges)]
pub struct Weather {
    /// Share of the sky that clouds cover, 0 to 1; at 1 the sun casts no shadow.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub cloudiness: f64,
    /// Rain, 0 (none) to 1 (heavy, about 50 mm/h).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub rain: f64,
    /// Wetness of surfaces, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub wetness: f64,
    /// Share of the ground under standing water, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub puddles: f64,
    /// Extinction of the air, 1/m: contrast is 5 % at a distance of 3 / `fog_1pm`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub fog_1pm: f64,
    /// True if street lamps, lit windows and vehicle lamps are on.
    pub lamps_on: bool,
}

impl Default for Weather {
    fn default() -> Self {
        WeatherPreset::default().weather()
    }
}

impl WeatherPreset {
    /// Position of the sun: 60 degrees high at noon, 9 at sunset; below the horizon at night.
    pub fn sun(self) -> Sun {
        let degrees = core::f64::consts::PI / 180.0;
        let name = self.name();
        let (azimuth, elevation) = if name.ends_with("noon") {
            (205.0, 52.0)
        } else if name.ends_with("sunset") {
            (8.0, 9.0)
        } else {
            (50.0, -20.0)
        };
        Sun { azimuth_rad: azimuth * degrees, elevation_rad: elevation * degrees }
    }

    /// Air and ground of the preset.
    pub fn weather(self) -> Weather {
        let (cloudiness, rain, wetness, puddles, fog_1pm) = match self {
            Self::ClearNoon | Self::ClearSunset => (0.12, 0.0, 0.0, 0.0, 0.0004),
            Self::CloudyNoon | Self::CloudySunset => (0.85, 0.0, 0.0, 0.0, 0.0008),
            Self::WetNoon | Self::WetSunset => (0.2, 0.0, 0.65, 0.45, 0.0006),
            Self::WetCloudyNoon | Self::WetCloudySunset => (0.88, 0.0, 0.7, 0.5, 0.001),
            Self::SoftRainNoon | Self::SoftRainSunset => (0.9, 0.25, 0.75, 0.45, 0.002),
            Self::MidRainyNoon | Self::MidRainSunset => (0.95, 0.55, 0.9, 0.6, 0.004),
            Self::HardRainNoon | Self::HardRainSunset => (1.0, 1.0, 1.0, 0.75, 0.008),
            Self::ClearNight => (0.1, 0.0, 0.0, 0.0, 0.0006),
        };
        let lamps_on = self == Self::ClearNight || matches!(self, Self::HardRainSunset | Self::MidRainSunset);
        Weather { cloudiness, rain, wetness, puddles, fog_1pm, lamps_on }
    }
}

impl Weather {
    /// Checks that every number is in its range.
    ///
    /// # Errors
    /// The first field that is not.
    pub fn check(&self) -> Result<(), ParamError> {
        self.check_ranges()
    }

    /// Share of the direct sunlight that reaches the ground.
    pub fn direct_share(&self) -> f64 {
        let open = 1.0 - self.cloudiness;
        (open * (1.6 - 0.6 * open)).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_in_both_spellings() {
        for preset in WeatherPreset::ALL {
            assert_eq!(preset.name().parse(), Ok(preset));
            assert_eq!(format!("{preset:?}").parse(), Ok(preset));
            assert_eq!(preset.weather().check(), Ok(()));
        }
        let error = "sandstorm".parse::<WeatherPreset>().unwrap_err().to_string();
        assert!(error.contains("`sandstorm`") && error.contains("hard_rain_sunset, clear_night"), "{error}");
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        for (field, change) in [
            ("cloudiness", (|w| w.cloudiness = 1.5) as fn(&mut Weather)),
            ("rain", |w| w.rain = f64::NAN),
            ("wetness", |w| w.wetness = -0.1),
            ("puddles", |w| w.puddles = f64::INFINITY),
            ("fog_1pm", |w| w.fog_1pm = -1.0),
        ] {
            let mut weather = Weather::default();
            change(&mut weather);
            assert_eq!(weather.check().unwrap_err().key, field);
        }
    }

    #[test]
    fn sun_position_matches_its_angles() {
        let sun =
            Sun { azimuth_rad: core::f64::consts::FRAC_PI_2, elevation_rad: core::f64::consts::FRAC_PI_4 };
        let [x, y, z] = sun.direction();
        assert!(x.abs() < 1e-12 && (y - z).abs() < 1e-12 && z > 0.7);
    }
}
