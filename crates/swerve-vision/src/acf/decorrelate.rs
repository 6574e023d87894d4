//! Channel filters that decorrelate neighbouring pixels (Nam, Dollár, Han 2014, section 4).

use crate::channels::{CHANNELS, halve};
use crate::stack::Stack;

/// Filter size along one axis.
pub(super) const SIDE: usize = 5;

/// Convolves every channel with its filters, with zero padding, and halves the planes.
///
/// `filters` holds `SIDE` x `SIDE` coefficients for each channel, filter by filter; output planes have the same order.
pub(super) fn decorrelate(cells: &Stack, filters: &[f32], filtered: &mut Vec<f32>, into: &mut Stack) {
    let (width, height) = (cells.width(), cells.height());
    into.shape(filters.len() / (SIDE * SIDE), width / 2, height / 2);
    filtered.resize(width * height, 0.0);
    for (k, filter) in filters.chunks_exact(SIDE * SIDE).enumerate() {
        filtered.fill(0.0);
        for (tap, weight) in filter.iter().enumerate() {
            add(cells.plane(k % CHANNELS), width, (tap, *weight), filtered);
        }
        halve(filtered, width, into.plane_mut(k));
    }
}

/// Adds one filter tap to a convolution.
fn add(from: &[f32], width: usize, (tap, weight): (usize, f32), into: &mut [f32]) {
    let half = SIDE as isize / 2;
    let [down, across] = [tap / SIDE, tap % SIDE].map(|k| half - k as isize);
    let height = (from.len() / width) as isize;
    let overlap = |offset: isize, n: usize| (-offset).max(0) as usize..n - offset.max(0) as usize;
    for y in (0..height).filter(|y| (0..height).contains(&(y + down))) {
        let row = &from[(y + down) as usize * width..][..width];
        let out = &mut into[y as usize * width..][..width];
        let (columns, n) = (overlap(across, width), width - across.unsigned_abs());
        let begin = across.max(0) as usize;
        for (out, value) in out[columns].iter_mut().zip(&row[begin..begin + n]) {
            *out += value * weight;
        }
    }
}
