//! Returns of laser pulses: detection, measured range and intensity.
//!
//! The received power follows the lidar equation for targets larger than the beam: reflectance x cosine of incidence /
//! range^2 x exp(-2 extinction x range). The detection probability falls with the ratio of that power to the return of
//! a 10 % target at the sensor's reach, so dropout rises with range, with incidence, and in rain and fog.

use swerve_scene::Weather;
use swerve_scene::vector::dot;

use crate::scene_tree::Hit;
use crate::spec::LidarSpec;

/// Rain of [`Weather::rain`] at 1, mm/h.
const RAIN_FULL_MMPH: f64 = 50.0;
/// Gain of a retro-reflector relative to a matt surface.
const RETRO_GAIN: f32 = 1000.0;
/// Reflectance to which [`LidarSpec::reach_m`] refers.
const REACH_REFLECTANCE: f32 = 0.1;
/// Detection odds at the reach: nine to one.
const REACH_ODDS: f32 = 9.0;

/// Extinction of the air, 1/m.
///
/// Rain: 1.076 R^0.67 dB/km for R in mm/h (Carbonneau and Wisely, "Opportunities and challenges for optical
/// wireless", 1998); fog scatters the near infrared as it does visible light.
pub(crate) fn extinction_1pm(weather: &Weather) -> f32 {
    let rate = weather.rain * RAIN_FULL_MMPH;
    let db_per_km = if rate > 0.0 { 1.076 * swerve_geom::math::pow(rate, 0.67) } else { 0.0 };
    (weather.fog_1pm + db_per_km * 1e-3 * core::f64::consts::LN_10 / 10.0) as f32
}

/// Parameters of one sensor in one weather and turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Receiver {
    range_min: f32,
    range_max: f32,
    /// Squared reach divided by the reflectance to which it refers.
    reach: f32,
    sigma: f32,
    step: f32,
    dropout: f32,
    full_squared: f32,
    extinction: f32,
    /// Key of the noise, from seed and turn.
    key: u64,
}

/// Return as reported by the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Return {
    /// Measured range, metres.
    pub(crate) range_m: f32,
    /// Intensity, 0 to 1.
    pub(crate) intensity: f32,
}

impl Receiver {
    /// Parameters of the sensor for one turn in a weather.
    pub(crate) fn new(spec: &LidarSpec, weather: &Weather, turn: u64) -> Self {
        Self {
            range_min: spec.range_min_m as f32,
            range_max: spec.range_max_m as f32,
            reach: (spec.reach_m * spec.reach_m) as f32 / REACH_REFLECTANCE,
            sigma: spec.range_sigma_m as f32,
            step: spec.range_step_m as f32,
            dropout: spec.dropout as f32,
            full_squared: (spec.intensity_full_m * spec.intensity_full_m) as f32,
            extinction: extinction_1pm(weather),
            key: mix(spec.seed ^ mix(turn)),
        }
    }

    /// Parameters as words for a compute shader: see `Params` of `gpu/rays.wgsl`.
    pub(crate) fn words(&self) -> [u32; 14] {
        let numbers = [
            self.range_min,
            self.range_max,
            self.range_max(),
            self.reach,
            self.sigma,
            self.step,
            self.dropout,
            self.full_squared,
            self.extinction,
            RETRO_GAIN,
            REACH_ODDS,
            0.0,
        ];
        let mut words = [0; 14];
        words[0] = self.key as u32;
        words[1] = (self.key >> 32) as u32;
        for (word, number) in words[2..].iter_mut().zip(numbers) {
            *word = number.to_bits();
        }
        words
    }

    /// Largest true range at which a return is possible, metres.
    pub(crate) fn range_max(&self) -> f32 {
        self.range_max + 6.0 * self.sigma
    }

    /// Return of a hit along a ray, if it is detected; `shot` is the index of the ray in its turn.
    pub(crate) fn detect(&self, hit: &Hit, direction: [f32; 3], shot: u32) -> Option<Return> {
        let range = hit.distance_m;
        if range < self.range_min {
            return None;
        }
        let hash = mix(self.key.wrapping_add(u64::from(shot).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        let cosine = -dot(hit.normal, direction);
        let air = if self.extinction > 0.0 { libm::expf(-2.0 * self.extinction * range) } else { 1.0 };
        let sent_back = if hit.is_retro_reflective { RETRO_GAIN } else { cosine };
        let light = hit.reflectance * sent_back * air / (range * range);
        if unit(hash) < self.miss_probability(light) {
            return None;
        }
        let measured = self.measured(range, hash);
        let counts = measured >= self.range_min && measured <= self.range_max;
        let intensity = (light * self.full_squared).clamp(0.0, 1.0);
        counts.then_some(Return { range_m: measured, intensity })
    }

    /// Probability that a return of this power is not detected.
    fn miss_probability(&self, light: f32) -> f32 {
        let ratio = light * self.reach;
        self.dropout + (1.0 - self.dropout) / (1.0 + REACH_ODDS * ratio * ratio)
    }

    /// Range with noise and quantisation.
    fn measured(&self, range: f32, hash: u64) -> f32 {
        let noisy = if self.sigma > 0.0 { range + self.sigma * normal(hash) } else { range };
        // Rounds by conversion; rounding functions are library calls on old processors.
        if self.step > 0.0 { (noisy / self.step + 0.5) as i64 as f32 * self.step } else { noisy }
    }
}

/// Mixes 64 bits: the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast Splittable Pseudorandom Number
/// Generators", 2014).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Uniform number in [0, 1).
fn unit(hash: u64) -> f32 {
    (hash >> 40) as f32 * (1.0 / 16_777_216.0)
}

/// Approximately normal number with mean 0 and standard deviation 1: the sum of eight uniform ones, within 4.9 of 0.
fn normal(hash: u64) -> f32 {
    let sum: u64 = [0x2545_f491_4f6c_dd1d, 0xd134_2543_de82_ef95]
        .into_iter()
        .map(|salt| {
            let bits = mix(hash ^ salt);
            (bits & 0xffff) + (bits >> 16 & 0xffff) + (bits >> 32 & 0xffff) + (bits >> 48)
        })
        .sum();
    // Each has the mean 65535 / 2 and the variance 65536^2 / 12.
    (sum as f32 - 262_140.0) * (1.224_744_9 / 65_536.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_scene::{Kind, MeshId, MeshLibrary, SemanticClass, WeatherPreset};

    fn receiver(spec: &LidarSpec, weather: WeatherPreset) -> Receiver {
        Receiver::new(spec, &weather.weather(), 3)
    }

    fn wall(mesh: MeshId, distance_m: f32, reflectance: f32) -> Hit {
        Hit {
            distance_m,
            instance_id: 0,
            class: SemanticClass::Wall,
            mesh,
            material: 0,
            reflectance,
            is_retro_reflective: false,
            normal: [-1.0, 0.0, 0.0],
        }
    }

    fn any_mesh() -> MeshId {
        MeshLibrary::default().model(Kind::Block, 0).mesh
    }

    /// Share of 4000 shots that are detected.
    fn share(receiver: &Receiver, hit: &Hit, direction: [f32; 3]) -> f32 {
        (0..4000).filter(|&shot| receiver.detect(hit, direction, shot).is_some()).count() as f32 / 4000.0
    }

    #[test]
    fn normal_numbers_have_the_moments_and_tails_of_a_gaussian() {
        let draws: Vec<f64> = (0..40_000).map(|k| f64::from(normal(mix(k)))).collect();
        let mean = draws.iter().sum::<f64>() / 4e4;
        let variance = draws.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / 4e4;
        let beyond_two = draws.iter().filter(|d| d.abs() > 2.0).count() as f64 / 4e4;
        assert!(mean.abs() < 0.015 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
        assert!((beyond_two - 0.0455).abs() < 0.005, "{beyond_two}");
    }

    #[test]
    fn dark_target_at_the_reach_is_detected_nine_times_of_ten() {
        let spec = LidarSpec { dropout: 0.0, reach_m: 60.0, ..LidarSpec::default() };
        let receiver = receiver(&spec, WeatherPreset::ClearNoon);
        let clear = Receiver { extinction: 0.0, ..receiver };
        let seen = share(&clear, &wall(any_mesh(), 60.0, 0.1), [1.0, 0.0, 0.0]);
        assert!((seen - 0.9).abs() < 0.015, "{seen}");
    }

    #[test]
    fn returns_fade_with_range_incidence_and_rain() {
        let spec = LidarSpec::default();
        let clear = receiver(&spec, WeatherPreset::ClearNoon);
        let (mesh, ahead) = (any_mesh(), [1.0, 0.0, 0.0]);
        let shares: Vec<f32> =
            [20.0, 80.0, 140.0, 190.0].iter().map(|&r| share(&clear, &wall(mesh, r, 0.1), ahead)).collect();
        assert!(shares.windows(2).all(|s| s[0] > s[1]), "{shares:?}");
        assert!(shares[0] > 0.99 && shares[3] < 0.6, "{shares:?}");
        let oblique = [0.1, 0.0, -(0.99_f32.sqrt())];
        assert!(share(&clear, &wall(mesh, 80.0, 0.1), oblique) < 0.2);
        let soft = receiver(&spec, WeatherPreset::SoftRainNoon);
        let hard = receiver(&spec, WeatherPreset::HardRainNoon);
        let in_rain = [&clear, &soft, &hard].map(|air| share(air, &wall(mesh, 80.0, 0.1), ahead));
        assert!(in_rain[0] > in_rain[1] + 0.05 && in_rain[1] > in_rain[2] + 0.2, "{in_rain:?}");
    }

    #[test]
    fn intensity_follows_the_lidar_equation_and_retro_reflectors_saturate() {
        let spec = LidarSpec::default().without_noise();
        let clear = Receiver { extinction: 0.0, ..receiver(&spec, WeatherPreset::ClearNoon) };
        let mut hit = wall(any_mesh(), 40.0, 0.6);
        let slanted = [0.5, 0.75_f32.sqrt(), 0.0];
        let seen = clear.detect(&hit, slanted, 0).unwrap();
        assert_eq!(seen.range_m, 40.0);
        assert!((seen.intensity - 0.6 * 0.5 * 100.0 / 1600.0).abs() < 1e-6, "{seen:?}");
        hit.is_retro_reflective = true;
        assert_eq!(clear.detect(&hit, slanted, 0).unwrap().intensity, 1.0);
        assert!(clear.detect(&wall(any_mesh(), 0.5, 0.6), [1.0, 0.0, 0.0], 0).is_none());
    }

    #[test]
    fn ranges_are_multiples_of_the_step() {
        let spec = LidarSpec { range_step_m: 0.25, ..LidarSpec::default() };
        let receiver = receiver(&spec, WeatherPreset::ClearNoon);
        for shot in 0..200 {
            let seen = receiver.detect(&wall(any_mesh(), 20.11, 0.9), [1.0, 0.0, 0.0], shot);
            assert!(seen.is_none_or(|r| r.range_m == 20.0 || r.range_m == 20.25), "{seen:?}");
        }
    }

    #[test]
    fn rain_attenuation_matches_the_model() {
        let weather = Weather { rain: 0.5, fog_1pm: 0.0, ..Weather::default() };
        // 25 mm/h: 1.076 * 25^0.67 = 9.301 dB/km.
        assert!((extinction_1pm(&weather) - 9.301e-3 / 4.342_945).abs() < 1e-6);
        assert_eq!(extinction_1pm(&Weather { rain: 0.0, ..weather }), 0.0);
    }
}
