use swerve_core::Rng;
use swerve_geom::math;
use swerve_geom::simd::both;

use super::*;
use crate::image::Rgb;

/// Image bytes with slow gradients, an edge and some noise.
fn picture(width: usize, height: usize, seed: u64) -> Vec<u8> {
    let mut rng = Rng::keyed(seed, "picture", &[]);
    let colour = |x: usize, y: usize, rng: &mut Rng| {
        let edge = if x + 2 * y > width { 90.0 } else { 20.0 };
        [edge + x as f64, edge + 2.0 * y as f64, 160.0 - edge]
            .map(|c| (c + 20.0 * rng.unit()).min(255.0) as u8)
    };
    (0..width * height).flat_map(|k| colour(k % width, k / width, &mut rng)).collect()
}

/// Reference implementation in `f64`, value by value: LUV, smoothing, gradient, normalisation, mean over cells.
fn by_definition(bytes: &[u8], [width, height]: [usize; 2], shrink: usize) -> Vec<f64> {
    let at = |k: isize, n: usize| {
        let k = k.rem_euclid(2 * n as isize) as usize;
        k.min(2 * n - 1 - k)
    };
    let smooth = |plane: &[f64], radius: isize| -> Vec<f64> {
        let value = |x: usize, y: usize| {
            let taps = (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy)));
            let weight = |d: isize| (radius + 1 - d.abs()) as f64 / ((radius + 1) * (radius + 1)) as f64;
            let pixel = |dx, dy| plane[at(y as isize + dy, height) * width + at(x as isize + dx, width)];
            taps.map(|(dx, dy)| weight(dx) * weight(dy) * pixel(dx, dy)).sum()
        };
        (0..width * height).map(|k| value(k % width, k / width)).collect()
    };
    let luv = |rgb: &[u8]| {
        let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(|c| f64::from(c) / 255.0);
        let [x, y, z] = [
            0.430574 * r + 0.34155 * g + 0.178325 * b,
            0.222015 * r + 0.706655 * g + 0.07133 * b,
            0.020183 * r + 0.129553 * g + 0.93918 * b,
        ];
        let l = if y > 0.008856 { 116.0 * math::pow(y, 1.0 / 3.0) - 16.0 } else { 903.2963 * y };
        let sum = (x + 15.0 * y + 3.0 * z).max(1e-30);
        [l, 13.0 * l * (4.0 * x / sum - 0.197833) + 88.0, 13.0 * l * (9.0 * y / sum - 0.468331) + 134.0]
            .map(|c| c / 270.0)
    };
    let colours: Vec<[f64; 3]> = bytes.chunks_exact(3).map(luv).collect();
    let planes = [0, 1, 2].map(|k| smooth(&colours.iter().map(|c| c[k]).collect::<Vec<_>>(), 1));
    let gradient = |k: usize| {
        let (x, y) = (k % width, k / width);
        let of = |plane: &Vec<f64>| {
            let [l, r] = [x.saturating_sub(1), (x + 1).min(width - 1)];
            let [u, d] = [y.saturating_sub(1), (y + 1).min(height - 1)];
            let horizontal = (plane[y * width + r] - plane[y * width + l]) / (r - l).max(1) as f64;
            let vertical = (plane[d * width + x] - plane[u * width + x]) / (d - u).max(1) as f64;
            (math::hypot(horizontal, vertical), math::atan2(vertical, horizontal))
        };
        planes.iter().map(of).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    };
    let gradients: Vec<(f64, f64)> = (0..width * height).map(gradient).collect();
    let mean = smooth(&gradients.iter().map(|g| g.0).collect::<Vec<_>>(), 5);
    let (columns, lines) = (width / shrink, height / shrink);
    let mut cells = vec![0.0; 10 * columns * lines];
    for k in (0..width * height).filter(|k| k % width < columns * shrink && k / width < lines * shrink) {
        let cell = k / width / shrink * columns + k % width / shrink;
        let mut add = |plane: usize, value: f64| {
            cells[plane * columns * lines + cell] += value / (shrink * shrink) as f64
        };
        (0..3).for_each(|c| add(c, planes[c][k]));
        let m = gradients[k].0 / (mean[k] + 0.005);
        add(3, m);
        let turn = (gradients[k].1 * 6.0 / core::f64::consts::PI).rem_euclid(6.0);
        add(4 + turn as usize % 6, m * (1.0 - turn.fract()));
        add(4 + (turn as usize + 1) % 6, m * turn.fract());
    }
    cells
}

fn computed(bytes: &[u8], [width, height]: [usize; 2], shrink: usize) -> Stack {
    let (mut luv, mut cells) = (Stack::default(), Stack::default());
    Luv::default().compute(Rgb::new(width, height, bytes).unwrap(), 0..height, &mut luv);
    Channels::default().compute(&luv, 0..height, shrink, &mut cells);
    cells
}

#[test]
fn channels_match_the_reference() {
    for (size, shrink) in [([41, 30], 2), ([32, 27], 4), ([3, 2], 1), ([1, 9], 1)] {
        let bytes = picture(size[0], size[1], 3);
        let (found, expected) = (computed(&bytes, size, shrink), by_definition(&bytes, size, shrink));
        assert_eq!(found.numbers().len(), expected.len());
        // Lightness comes from a table of 1024 steps; a step is up to 0.003 in dark colours.
        let worst = found.numbers().iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs());
        let (sum, most) = worst.fold((0.0, 0.0_f64), |(sum, most), d| (sum + d, most.max(d)));
        assert!(
            sum / (expected.len() as f64) < 4e-3 && most < 0.12,
            "{size:?}: mean {}, most {most}",
            sum / expected.len() as f64
        );
    }
}

#[test]
fn orientation_matches_the_arc_tangent() {
    for k in 0..3600 {
        let angle = core::f64::consts::TAU * f64::from(k) / 3600.0;
        let (sin, cos) = math::sin_cos(angle);
        let expected = (angle * 6.0 / core::f64::consts::PI).rem_euclid(6.0);
        let off = (f64::from(orientation(cos as f32, sin as f32)) - expected).abs();
        assert!(off.min(6.0 - off) < 3e-5, "{angle}: off by {off}");
    }
    assert_eq!(orientation(0.0, 0.0), 0.0);
}

#[test]
fn flat_images_of_any_size_have_no_edges() {
    for (value, size) in [(0, [1, 1]), (255, [1, 1]), (255, [64, 48]), (0, [2, 7]), (128, [5, 1])] {
        let cells = computed(&vec![value; size[0] * size[1] * 3], size, 1);
        assert!(cells.numbers().iter().all(|n| n.is_finite()));
        let edges = (3..CHANNELS).flat_map(|plane| cells.plane(plane));
        assert!(edges.into_iter().all(|n| n.abs() < 1e-3), "{value} {size:?}");
    }
    assert_eq!(computed(&[], [0, 0], 2).numbers().len(), 0);
}

/// Includes row lengths that are not a multiple of the vector width, and both ways of summing cells.
#[test]
fn channels_are_bit_identical_with_wide_vectors() {
    for (size, shrink) in [([97, 61], 2), ([64, 48], 4), ([5, 9], 1)] {
        let bytes = picture(size[0], size[1], 7);
        let [wide, narrow] = both(|| {
            let cells = computed(&bytes, size, shrink);
            let (mut resampler, mut half) = (Resampler::default(), vec![0.0; size[0] * size[1]]);
            let mut resized = Stack::default();
            resized.shape(CHANNELS, size[0] + 3, size[1] / 2);
            resampler.set([cells.width(), cells.height()], [size[0] + 3, size[1] / 2]);
            for plane in 0..CHANNELS {
                resampler.plane(cells.plane(plane), 0.9, resized.plane_mut(plane));
            }
            halve(resized.plane(0), resized.width(), &mut half);
            [cells.numbers(), resized.numbers(), &half]
                .concat()
                .iter()
                .map(|n| n.to_bits())
                .collect::<Vec<_>>()
        });
        assert!(wide == narrow && wide.iter().any(|bits| *bits != 0), "{size:?}");
    }
}

#[test]
fn resampler_preserves_a_plane_of_equal_size() {
    let mut resampler = Resampler::default();
    let (from, mut into) = ([0.25, 1.5, -0.0, 7.0, 1e-30, 3.0], [0.0; 6]);
    resampler.set([3, 2], [3, 2]);
    resampler.plane(&from, 1.0, &mut into);
    assert_eq!(from, into);
}

#[test]
fn channels_have_the_same_digest_on_every_machine() {
    let cells = computed(&picture(97, 61, 5), [97, 61], 2);
    let bits: Vec<u32> = cells.numbers().iter().map(|n| n.to_bits()).collect();
    assert_eq!(swerve_core::digest_of(&bits).to_string(), "ced40527038f6bb2");
}
