//! Comparison of the shaders with this back end: `shade.wgsl`, translated to Rust, against the functions here. Needs no
//! adapter.
//!
//! `draw.wgsl` and `pass.wgsl` are not translated, because they read buffers and images; their output on an adapter is
//! compared instead.

#[expect(clippy::too_many_arguments, reason = "constructors that the translation makes of structs")]
mod wgsl {
    naga_rust_embed::include_wgsl_mr!(public_items = true, "src/gpu/shade.wgsl");
}

use naga_rust_embed::rt::Vec3;
use swerve_scene::hash::{self, Draws};
use swerve_scene::{Scene, Texture, WeatherPreset};
use wide::f32x8;

use super::shade::{Shading, light};
use super::shadow_maps::ShadowCache;
use crate::frontend::lamp::Lamp as CpuLamp;
use crate::frontend::light::Environment as Light;
use crate::frontend::sensor::Sensor;
use crate::frontend::texture::{self, STRIDE, Tiles};
use crate::{Camera, CameraSpec, Exposure, SensorNoise};
use wgsl::{Environment, Gloss, Lamp};

type F = f32x8;

const PRESETS: [WeatherPreset; 4] = [
    WeatherPreset::ClearNoon,
    WeatherPreset::ClearSunset,
    WeatherPreset::HardRainNoon,
    WeatherPreset::ClearNight,
];

fn vec3([x, y, z]: [f32; 3]) -> Vec3<f32> {
    Vec3::new(x, y, z)
}

fn array(v: Vec3<f32>) -> [f32; 3] {
    [v.x, v.y, v.z]
}

fn first(v: [F; 3]) -> [f32; 3] {
    v.map(|c| c.to_array()[0])
}

fn splat(v: [f32; 3]) -> [F; 3] {
    v.map(F::splat)
}

fn assert_near(a: [f32; 3], b: [f32; 3], what: &str) {
    for k in 0..3 {
        assert!((a[k] - b[k]).abs() <= 1e-5 + 1e-4 * b[k].abs(), "{what}: {a:?} is not {b:?}");
    }
}

fn direction(draws: &mut Draws) -> [f32; 3] {
    swerve_scene::vector::normalized([0, 1, 2].map(|_| draws.between(-1.0, 1.0)))
}

fn translated(light: &Light) -> Environment {
    Environment {
        sun: vec3(light.sun),
        exposure: light.exposure,
        sunlight: vec3(light.sunlight),
        cloudiness: light.cloudiness,
        zenith: vec3(light.zenith),
        wetness: light.wetness,
        horizon: vec3(light.horizon),
        puddles: light.puddles,
        glow: vec3(light.glow),
        rain: light.rain,
        cloud: vec3(light.cloud),
        fog_1pm: light.fog_1pm,
        ambient: vec3(light.ambient),
        bounce: vec3(light.bounce),
        fog: vec3(light.fog),
    }
}

/// Texture value as read by `pass.wgsl`.
fn sampled(tile: usize, u: f32, v: f32, footprint: f32) -> f32 {
    let level = wgsl::mip_level(footprint);
    let (tu, tv) = (wgsl::texel(level, u), wgsl::texel(level, v));
    let word = Tiles::get().words()[tile * STRIDE + wgsl::texel_index(level, tu, tv) as usize];
    wgsl::unpack_word(word, tu - tu.floor(), tv - tv.floor())
}

/// Calls `check` with the light of each weather.
fn each_light(mut check: impl FnMut(&Light, &Shading<'_>, Environment, &mut Draws)) {
    let mut cache = ShadowCache::default();
    let maps = &*cache.around(&Scene::new(PRESETS[0]), [0.0; 3], None);
    let mut draws = Draws::new(4, 4);
    for preset in PRESETS {
        let light = Light::new(&Scene::new(preset), Exposure::Metered);
        let shading = Shading {
            chunks: &[],
            surfaces: &[],
            environment: &light,
            maps,
            lamps: &[],
            tiles: Tiles::get().words(),
            ray: [[0.0; 3]; 3],
            eye: [0.0; 3],
            flat: None,
            focal: 400.0,
        };
        check(&light, &shading, translated(&light), &mut draws);
    }
}

#[test]
fn shader_mixes_bits_like_the_cpu() {
    for k in 0..1000_u32 {
        let x = k.wrapping_mul(0x9e37_79b9);
        assert_eq!(wgsl::mix_bits(x), hash::mix(x));
    }
}

#[test]
fn shader_reads_textures_like_the_cpu() {
    each_light(|_, shading, _, draws| {
        for _ in 0..2000 {
            let tile = draws.below(Texture::ALL.len());
            let (u, v) = (draws.between(-900.0, 900.0), draws.between(-3.0, 3.0));
            let footprint = libm::exp2f(draws.between(-3.0, 18.0));
            let base = [(tile * STRIDE) as u32; 8];
            let cpu = shading.sample(&base, false, F::splat(u), F::splat(v), F::splat(footprint));
            let gpu = sampled(tile, u, v, footprint);
            assert!((cpu.to_array()[0] - gpu).abs() < 1e-5, "{tile} {u} {v} {footprint}");
        }
    });
}

#[test]
fn shader_sky_and_reflections_match_the_cpu() {
    each_light(|_, shading, e, draws| {
        for _ in 0..500 {
            let d = direction(draws);
            let place = wgsl::cloud_place(vec3(d));
            let grain = place.z * place.z * 400.0 / shading.focal;
            let large = sampled(texture::CLOUDS, place.x * 0.25, place.y * 0.25, grain * 0.3);
            let small = sampled(texture::CLOUDS, place.x, place.y, grain * 4.0);
            let gpu = wgsl::clouded(e, vec3(d), wgsl::open_sky(e, vec3(d)), large, small);
            assert_near(array(gpu), first(shading.sky(splat(d))), "sky");

            let normal = direction(draws);
            let [facing, polish, specular, sharp, open] = [0; 5].map(|_| draws.between(0.02, 1.0));
            let [p, s, h, o] = [polish, specular, sharp, open].map(F::splat);
            let gloss = light::Gloss { polish: p, specular: s, sharp: h, open: o };
            let (cpu, share) = shading.mirror(splat(normal), splat(d), F::splat(facing), &gloss);
            let gloss = Gloss { polish, specular, sharp, open };
            let gpu = wgsl::mirrored(e, vec3(normal), vec3(d), facing, gloss);
            assert_near([gpu.x, gpu.y, gpu.z], first(cpu), "mirror");
            assert!((gpu.w - share.to_array()[0]).abs() < 1e-5);
        }
    });
}

#[test]
fn shader_daylight_matches_the_cpu() {
    each_light(|day, _, e, draws| {
        for _ in 0..500 {
            let normal = direction(draws);
            let [sun, open, stain, ground] = [0; 4].map(|_| draws.between(0.0, 1.0));
            let cpu = light::daylight(day, splat(normal), F::splat(sun), F::splat(open));
            assert_near(array(wgsl::daylight(e, vec3(normal), sun, open)), first(cpu), "daylight");

            let up = draws.between(0.85, 1.0);
            let [tone, wet, puddle] =
                light::ground_tone(day, F::splat(stain), F::splat(up), F::splat(ground))
                    .map(|v| v.to_array()[0]);
            let expected = [tone, (0.25 * wet).max(0.95 * puddle), 0.02 * puddle];
            assert_near(array(wgsl::ground_tone(e, stain, up, ground)), expected, "ground");

            let depth = draws.between(0.0, 9.0);
            let cpu = light::through_fog(F::splat(depth)).to_array()[0];
            assert!((wgsl::through_fog(depth) - cpu).abs() < 1e-6);
        }
    });
}

#[test]
fn shader_lamps_match_the_cpu() {
    each_light(|_, shading, _, draws| {
        for _ in 0..300 {
            let lamp = CpuLamp {
                position: [0, 1, 2].map(|_| draws.between(-9.0, 9.0)),
                direction: direction(draws),
                intensity: [80.0, 40.0, 20.0],
                range: draws.between(1.0, 40.0),
                cos_outer: draws.between(-1.0, 0.9),
                over_fall: draws.between(1.0, 10.0),
                columns: [-1.0, 1e6],
                rows: [-1.0, 1e6],
            };
            let (normal, retro) = (direction(draws), draws.between(0.0, 1.0));
            let ground = draws.between(0.0, 1.0);
            let mut cpu = splat([0.0; 3]);
            let point = [0.5, -0.5, 1.0];
            let shading = Shading { lamps: core::slice::from_ref(&lamp), ..*shading };
            let rays = shading.rays(F::splat(3.0), F::splat(3.0));
            let lit = light::Lit { retro: F::splat(retro), ground: F::splat(ground) };
            shading.add_lamps(&rays, (splat(point), splat(normal)), lit, &mut cpu);
            let gpu = Lamp {
                position: vec3(lamp.position),
                range: lamp.range,
                direction: vec3(lamp.direction),
                cos_outer: lamp.cos_outer,
                intensity: vec3(lamp.intensity),
                over_fall: lamp.over_fall,
            };
            let strength = wgsl::lamp_strength(gpu, vec3(point), vec3(normal), retro, ground);
            assert_near(lamp.intensity.map(|c| c * strength), first(cpu), "lamp");
        }
    });
}

#[test]
fn shader_sensor_response_matches_the_cpu() {
    let tiles = Tiles::get().words();
    let noise = SensorNoise { read: 0.01, shot: 0.05, seed: 9 };
    let camera = Camera::new(CameraSpec { noise, vignetting: 0.6, ..CameraSpec::default() }).unwrap();
    each_light(|light, _, _, draws| {
        let sensor = Sensor::new(&camera, light, 77, tiles);
        for _ in 0..500 {
            let colour = [0, 1, 2].map(|_| draws.between(0.0, 2.0) / light.exposure);
            let (column, row) = (draws.below(800), draws.below(600));
            let mut cpu = [0; 3];
            sensor.write(splat(colour), column, row, &mut cpu);

            let (x, y) = (column as f32, row as f32);
            let (u, v) = (x * sensor.across[0] + sensor.across[1], y * sensor.down[0] + sensor.down[1]);
            let gain = light.exposure * wgsl::vignette(sensor.vignetting, u, v);
            let (column, row) = (column as u32, row as u32);
            let mut streak = 0.0;
            for layer in 0..2 {
                let at =
                    wgsl::streak_index(column, row, 2 + layer, hash::mix(sensor.rain_key ^ layer)) as usize;
                streak += (tiles[texture::STREAKS * STRIDE + at] & 255) as f32 / 255.0;
            }
            let rain = light.horizon.map(|c| (c + 0.02) * 0.16 * light.rain);
            let wet =
                if light.rain > 0.0 { array(wgsl::rained(vec3(colour), vec3(rain), streak)) } else { colour };
            let bits = wgsl::noise_bits(sensor.key, column, row);
            for k in 0..3 {
                let draw = Sensor::quantiles()[(bits >> (10 * k) & 1023) as usize];
                let signal = wet[k] * gain;
                let byte = wgsl::tone(signal + wgsl::deviation(signal, sensor.read, sensor.shot) * draw);
                assert!(byte.abs_diff(u32::from(cpu[k])) <= 1, "{byte} is not {}", cpu[k]);
            }
        }
    });
}
