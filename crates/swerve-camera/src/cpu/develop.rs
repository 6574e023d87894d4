//! From radiance to bytes: exposure, vignetting, rain, noise, tone curve.

use swerve_scene::hash;
use wide::f32x8;

use crate::frontend::sensor::Sensor;
use crate::frontend::texture;

type F = f32x8;

impl Sensor<'_> {
    /// Writes up to eight pixels of a row, from column `column` on.
    pub(super) fn write(&self, colour: [F; 3], column: usize, row: usize, out: &mut [u8]) {
        let x = F::from([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) + F::splat(column as f32);
        let mut gain = F::splat(self.exposure);
        if self.vignetting > 0.0 {
            let u = x * F::splat(self.across[0]) + F::splat(self.across[1]);
            let v = row as f32 * self.down[0] + self.down[1];
            let fall = F::ONE / (F::ONE + u * u + F::splat(v * v));
            gain *= F::ONE + F::splat(self.vignetting) * (fall * fall - F::ONE);
        }
        let mut colour = colour;
        if self.rain != [0.0; 3] {
            let streak = self.streaks(column, row);
            colour = [0, 1, 2]
                .map(|k| colour[k] * (F::ONE - streak * F::splat(0.12)) + F::splat(self.rain[k]) * streak);
        }
        let mut signal = colour.map(|c| c * gain);
        if self.read > 0.0 || self.shot > 0.0 {
            self.add_noise(&mut signal, column, row);
        }
        let [red, green, blue] = signal.map(tone);
        let pixels: [i32; 8] = (red | (green << 8_i32) | (blue << 16_i32)).to_array();
        // Four bytes each, the last of which is overwritten by the next pixel.
        let mut bytes = [0; 28];
        for (k, pixel) in pixels.into_iter().enumerate() {
            bytes[3 * k..3 * k + 4].copy_from_slice(&pixel.to_le_bytes());
        }
        match out.first_chunk_mut::<24>() {
            Some(out) => out.copy_from_slice(&bytes[..24]),
            None => out.copy_from_slice(&bytes[..out.len()]),
        }
    }

    /// Adds photon noise, which grows with the square root of the signal, and read-out noise.
    fn add_noise(&self, signal: &mut [F; 3], column: usize, row: usize) {
        let line = self.key ^ (row as u32).wrapping_mul(0x9e37_79b9);
        let mut draws = [[0.0; 8]; 3];
        let [red, green, blue] = &mut draws;
        for (k, ((red, green), blue)) in red.iter_mut().zip(green).zip(blue).enumerate() {
            let bits = hash::mix(line.wrapping_add((column + k) as u32));
            *red = self.normal[(bits & 1023) as usize];
            *green = self.normal[(bits >> 10 & 1023) as usize];
            *blue = self.normal[(bits >> 20 & 1023) as usize];
        }
        let (read, shot) = (F::splat(self.read * self.read), F::splat(self.shot * self.shot));
        for (s, draw) in signal.iter_mut().zip(draws) {
            let deviation = (read + shot * s.fast_max(F::ZERO)).sqrt();
            *s += deviation * F::from(draw);
        }
    }

    /// Rain streaks: two layers of falling drops, blurred by the exposure.
    fn streaks(&self, column: usize, row: usize) -> F {
        let mut sum = [0.0; 8];
        for (layer, size) in [(0, 2_usize), (1, 3)] {
            let key = hash::mix(self.rain_key ^ layer);
            let (dx, dy) = (key as usize & 255, key as usize >> 8 & 255);
            for (k, value) in sum.iter_mut().enumerate() {
                let x = ((column + k) * size / 4 + row / 24 + dx) & 255;
                let y = (row * size / 5 + dy) & 255;
                let word = self.tiles[texture::STREAKS * texture::STRIDE + y * texture::SIDE + x];
                *value += (word & 255) as f32 * (1.0 / 255.0);
            }
        }
        F::from(sum)
    }
}

/// Tone curve, 0 to 255.
///
/// A filmic curve with a toe and a shoulder (Narkowicz's fit to ACES) followed by the sRGB curve, combined: a quotient
/// of two squares in the root of the signal, fitted to within 0.9 of 255.
fn tone(x: F) -> wide::i32x8 {
    let t = x.fast_max(F::ZERO).fast_min(F::splat(64.0)).sqrt();
    let up = t * (t * F::splat(0.997_46) - F::splat(0.017_452));
    let down = t * (t - F::splat(0.088_746)) + F::splat(0.167_746);
    let curve = (up / down).fast_max(F::ZERO).fast_min(F::ONE);
    (curve * F::splat(255.0) + F::splat(0.5)).fast_trunc_int()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_curve_rises_from_black_to_white() {
        let bytes: Vec<i32> = (0..200).map(|k| tone(F::splat(0.05 * k as f32)).to_array()[0]).collect();
        assert_eq!((bytes[0], bytes[199]), (0, 255));
        assert!(bytes.windows(2).all(|pair| pair[0] <= pair[1]));
        let grey = tone(F::splat(0.18)).to_array()[0];
        assert!((120..160).contains(&grey), "{grey}");
    }
}
