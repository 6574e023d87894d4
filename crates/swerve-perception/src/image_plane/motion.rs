//! Motion model of a rectangle with standard deviations proportional to its height (Wojke et al. 2017, section 2.1),
//! used by DeepSORT and ByteTrack.

use super::{centred, edges};
use crate::axis::Axis;

/// Standard deviations of position and size relative to the height.
const PLACE: f64 = 1.0 / 20.0;

/// Standard deviations of their rates per frame relative to the height.
const RATE: f64 = 1.0 / 160.0;

/// Estimate of a rectangle and of its rates per frame.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Motion {
    /// Centre (across, down), width over height, height: px, px, 1, px.
    axes: [Axis; 4],
}

impl Motion {
    /// Initial estimate from a rectangle.
    pub(super) fn founded(box_px: [f64; 4]) -> Self {
        let measured = shape(box_px);
        let (places, rates) =
            (variances(measured[3], 2.0 * PLACE, 1e-2), variances(measured[3], 10.0 * RATE, 1e-5));
        Self { axes: core::array::from_fn(|k| Axis::new(measured[k], [places[k], rates[k]])) }
    }

    /// Predicts the next frame.
    pub(super) fn predict(&mut self) {
        let height = self.axes[3].value;
        let (places, rates) = (variances(height, PLACE, 1e-2), variances(height, RATE, 1e-5));
        for (k, axis) in self.axes.iter_mut().enumerate() {
            axis.predict(1.0, [places[k], rates[k]]);
        }
    }

    /// Sets the rate of the height to zero.
    pub(super) fn stop_growing(&mut self) {
        self.axes[3].rate = 0.0;
    }

    /// Updates with a measured rectangle.
    pub(super) fn update(&mut self, box_px: [f64; 4]) {
        let noise = self.noise();
        for ((axis, measured), variance) in self.axes.iter_mut().zip(shape(box_px)).zip(noise) {
            axis.update(measured, variance);
        }
    }

    /// Squared Mahalanobis distance of a measured rectangle (four degrees of freedom).
    pub(super) fn squared_distance(&self, box_px: [f64; 4]) -> f64 {
        let measured = self.axes.iter().zip(shape(box_px)).zip(self.noise());
        measured.map(|((axis, measured), variance)| axis.squared_distance(measured, variance)).sum()
    }

    /// Left, top, right, bottom.
    pub(super) fn edges(&self) -> [f64; 4] {
        let [x, y, aspect, height] = self.axes.map(|axis| axis.value);
        edges([x, y, aspect * height, height])
    }

    fn noise(&self) -> [f64; 4] {
        variances(self.axes[3].value, PLACE, 1e-1)
    }
}

/// Centre, aspect ratio and height of a rectangle.
fn shape(box_px: [f64; 4]) -> [f64; 4] {
    let [x, y, width, height] = centred(box_px);
    [x, y, width / height, height]
}

/// Variances for a rectangle of this height; the aspect ratio has separate deviations.
fn variances(height: f64, of_height: f64, of_aspect: f64) -> [f64; 4] {
    let square = |x: f64| x * x;
    let size = square(of_height * height);
    [size, size, square(of_aspect), size]
}
