//! Drawn pictures of cars with their labels.

use std::path::Path;

use swerve_core::Rng;
use swerve_measure::picture::Picture;

/// Noisy picture of three cars, fully visible: grey boxes with dark wheels.
pub(in crate::train::detector) struct Drawing {
    picture: Picture,
    /// Left, top, width, height.
    pub(in crate::train::detector) boxes: Vec<[usize; 4]>,
}

impl Drawing {
    pub(in crate::train::detector) fn new(size: [usize; 2], seed: u64) -> Self {
        let mut rng = Rng::keyed(seed, "drawn", &[]);
        let mut drawing = Self::empty(size, &mut rng);
        for (k, width) in [23, 32, 44].into_iter().enumerate() {
            let [left, top] = [10 + 50 * k + rng.below(8), 20 + rng.below(30)];
            drawing.car([left, top, width, 20]);
        }
        drawing
    }

    /// Noise alone.
    pub(in crate::train::detector) fn empty(size: [usize; 2], rng: &mut Rng) -> Self {
        let bytes = (0..3 * size[0] * size[1]).map(|_| 90 + rng.below(40) as u8).collect();
        Self { picture: Picture { size, bytes }, boxes: Vec::new() }
    }

    pub(in crate::train::detector) fn car(&mut self, [left, top, width, height]: [usize; 4]) {
        for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
            let shade = if 4 * y > 3 * height && 23 * x / width % 16 < 7 { 10 } else { 200 };
            self.picture.bytes[3 * ((top + y) * self.picture.size[0] + left + x)..][..3].fill(shade);
        }
        self.boxes.push([left, top, width, height]);
    }

    pub(in crate::train::detector) fn size(&self) -> [usize; 2] {
        self.picture.size
    }

    pub(in crate::train::detector) fn write(&self, file: &Path) {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        self.picture.write(file).unwrap();
    }

    /// Writes the picture and its labels in KITTI's layout, at a distance of 20 m.
    pub(in crate::train::detector) fn kitti(&self, folder: &Path, name: &str) {
        self.write(&folder.join("image_2").join(name).with_extension("png"));
        let label = |[left, top, width, height]: &[usize; 4]| {
            format!("Car 0.00 0 0 {left} {top} {} {} 0 0 0 0 0 20 0\n", left + width, top + height)
        };
        std::fs::create_dir_all(folder.join("label_2")).unwrap();
        let labels: String = self.boxes.iter().map(label).collect();
        std::fs::write(folder.join("label_2").join(name).with_extension("txt"), labels).unwrap();
    }
}
