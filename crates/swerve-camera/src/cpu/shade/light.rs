//! Light of sun, sky, ground and lamps; reflection and fog.

use swerve_scene::vector::scale;

use super::inputs::{PixelRays, Shading};
use super::lanes::{F, V, clamp01, dot8, mix8, splat, splat3};
use crate::frontend::light::Environment;

/// Gloss of a surface, and the visibility of the sources that it reflects.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct Gloss {
    /// 1 for a mirror, 0 for matt.
    pub(in crate::cpu) polish: F,
    /// Mirror reflectance at normal incidence.
    pub(in crate::cpu) specular: F,
    /// Visible share of the sun.
    pub(in crate::cpu) sharp: F,
    /// Visible share of the sky.
    pub(in crate::cpu) open: F,
}

/// Response of a surface to the light of lamps.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct Lit {
    /// 1 for retro-reflective surfaces.
    pub(in crate::cpu) retro: F,
    /// 1 for rough ground.
    pub(in crate::cpu) ground: F,
}

impl Shading<'_> {
    /// Reflected light of a polished surface, and its share of all light.
    pub(in crate::cpu) fn mirror(&self, normal: V, direction: V, facing: F, gloss: &Gloss) -> (V, F) {
        let environment = self.environment;
        let Gloss { polish, specular, sharp, open } = *gloss;
        let twice = facing + facing;
        let out = [0, 1, 2].map(|k| direction[k] + normal[k] * twice);
        let base = F::ONE - facing.fast_min(F::ONE);
        let square = base * base;
        let fresnel = specular + (F::ONE - specular) * (square * square * base);
        let share = fresnel * polish * open;
        // Sky above, a dark band of houses and trees at the horizon, the ground below.
        let up = out[2].fast_max(F::ZERO);
        let sky = mix8(splat3(environment.horizon), splat3(environment.zenith), up.sqrt());
        let rim = clamp01((out[2] - splat(0.08)) * splat(7.0));
        let seen = mix8(splat3(scale(environment.bounce, 1.6)), sky, rim);
        let near = dot8(out, splat3(environment.sun)).fast_max(F::ZERO);
        let (n2, n4) = (near * near, near * near * near * near);
        let n8 = n4 * n4;
        let n32 = n8 * n8 * n8 * n8;
        let wide = n8 * n2;
        let glint = (n32 * n32 * splat(9.0) * polish + n32 * splat(2.0) + wide * splat(0.2))
            * polish
            * polish
            * sharp;
        let sun = splat3(environment.sunlight);
        ([0, 1, 2].map(|k| seen[k] * share + sun[k] * glint * fresnel), share)
    }

    /// Adds the light of lamps. The ground scatters grazing light as if from a minimum cosine, since its grains face
    /// the light, so head lamps illuminate it farther than a smooth surface.
    pub(in crate::cpu) fn add_lamps(
        &self,
        rays: &PixelRays,
        (point, normal): (V, V),
        of: Lit,
        light: &mut V,
    ) {
        let along = of.ground * splat(0.2);
        let (row, columns) = (rays.y.to_array()[0], rays.x.to_array());
        let (first, last) = (columns[0], columns[7]);
        for lamp in self.lamps {
            if row < lamp.rows[0] || row > lamp.rows[1] || last < lamp.columns[0] || first > lamp.columns[1] {
                continue;
            }
            let to = [0, 1, 2].map(|k| splat(lamp.position[k]) - point[k]);
            let square = dot8(to, to).fast_max(splat(0.04));
            let over = F::ONE / square.sqrt();
            let cone = F::ZERO - dot8(to, splat3(lamp.direction)) * over;
            let beam = clamp01((cone - splat(lamp.cos_outer)) * splat(lamp.over_fall));
            let cosine = (dot8(to, normal) * over).fast_max(along);
            let fade = clamp01(F::ONE - square * splat(1.0 / (lamp.range * lamp.range)));
            // A lamp has a finite size: close to it the light does not follow the inverse square.
            let spread = F::ONE / (square + splat(9.0));
            let strength = beam * beam * fade * spread * (cosine + of.retro * splat(2.5));
            for (light, intensity) in light.iter_mut().zip(lamp.intensity) {
                *light += splat(intensity) * strength;
            }
        }
    }
}

/// Transmittance of fog by Beer's law; exp(-x) is approximated by the reciprocal of its series.
#[inline]
pub(in crate::cpu) fn through_fog(x: F) -> F {
    F::ONE / (F::ONE + x * (F::ONE + x * (splat(0.5) + x * (splat(1.0 / 6.0) + x * splat(1.0 / 24.0)))))
}

/// Light on a surface from sun, sky and ground; `sun` is the cosine times the visible share.
#[inline]
pub(in crate::cpu) fn daylight(environment: &Environment, normal: V, sun: F, open: F) -> V {
    let up = (normal[2] * splat(0.5) + splat(0.5)) * open;
    let down = (splat(0.5) - normal[2] * splat(0.5)) * (open * splat(0.7) + splat(0.3));
    [0, 1, 2].map(|k| {
        splat(environment.sunlight[k]) * sun
            + splat(environment.ambient[k]) * up
            + splat(environment.bounce[k]) * down
    })
}

/// Effect of stains and water on ground: tone of its colour, wetness, share of puddle.
#[inline]
pub(in crate::cpu) fn ground_tone(environment: &Environment, stain: F, up: F, ground: F) -> [F; 3] {
    let wet = ground * splat(environment.wetness);
    let level = splat(0.72 - 0.42 * environment.puddles);
    let flat = clamp01((up - splat(0.9)) * splat(20.0));
    let puddle = clamp01((stain - level) * splat(9.0)) * wet * flat;
    let tone = F::ONE + ground * (stain - splat(0.5)) * splat(0.7);
    let tone = tone * (F::ONE - wet * splat(0.45)) * (F::ONE - puddle * splat(0.5));
    [tone, wet, puddle]
}
