//! Scanner for images of any size.

use swerve_vision::acf::{Ground, Rung, Scanner, Weights};

use crate::train::images::Camera;

/// Scanner of a rung of weights; keeps the buffers of the last image size.
#[derive(Clone)]
pub(super) struct Scanners {
    weights: Weights,
    rung: Rung,
    camera: Option<Camera>,
    last: Option<([usize; 2], Scanner)>,
}

impl Scanners {
    /// Scanner that expects objects on the ground in front of a camera, if the rung uses it.
    pub(super) fn new(weights: Weights, rung: Rung, camera: Option<&Camera>) -> Self {
        Self { weights, rung, camera: camera.cloned(), last: None }
    }

    /// Scanner for images of this width and height.
    pub(super) fn of(&mut self, size: [usize; 2]) -> &mut Scanner {
        let last = self.last.take().filter(|(of, _)| *of == size);
        let ground = self.camera.as_ref().map(|camera| Ground {
            horizon_px: 0.5 * size[1] as f64,
            focal_px: camera.focal_of(size[0] as f64),
            height_m: camera.height_m,
        });
        let new = || (size, Scanner::new(self.weights.clone(), self.rung.clone(), size, ground));
        &mut self.last.insert(last.unwrap_or_else(new)).1
    }
}
