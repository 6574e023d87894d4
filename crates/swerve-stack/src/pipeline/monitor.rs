use swerve_core::{Digest, Hasher};
use swerve_flow::{At, Context, Operator, Port};
use swerve_msg::{Image, Packable, PointCloud, SensorHealth};

/// Watches a camera: reads every byte of its images.
#[derive(Default)]
pub(super) struct ImageMonitor {
    last: Option<Digest>,
}

/// Watches a lidar: reads every byte of its point clouds.
#[derive(Default)]
pub(super) struct CloudMonitor {
    last: Option<Digest>,
}

impl Operator for ImageMonitor {
    type In = (At<Image>,);
    type Out = Port<SensorHealth>;

    fn step(&mut self, cx: &mut Context<'_>, (image,): &Self::In, out: &mut Self::Out) {
        let Some(image) = image.get() else { return };
        let bytes = image.pixels.bytes();
        let (checksum, frozen) = compare(&mut self.last, [bytes]);
        let (numbers, invalid) = (image.pixels.len() as u64, u64::from(image.check().is_err()));
        let commonest_share = commonest_share(bytes);
        out.send(SensorHealth { stamp: cx.stamp(), numbers, invalid, commonest_share, frozen, checksum });
    }
}

impl Operator for CloudMonitor {
    type In = (At<PointCloud>,);
    type Out = Port<SensorHealth>;

    fn step(&mut self, cx: &mut Context<'_>, (cloud,): &Self::In, out: &mut Self::Out) {
        let Some(cloud) = cloud.get() else { return };
        let floats = [&cloud.x_m, &cloud.y_m, &cloud.z_m, &cloud.intensity, &cloud.time_offset_s];
        let [x, y, z, intensity, time] = floats.map(|numbers| bytes(numbers));
        let ring = bytes(&cloud.ring);
        let (checksum, frozen) = compare(&mut self.last, [x, y, z, intensity, time, ring]);
        let broken =
            floats.iter().map(|numbers| numbers.iter().filter(|x| !x.is_finite()).count()).sum::<usize>();
        let invalid = broken as u64 + u64::from(cloud.check().is_err());
        let (numbers, commonest_share) = (cloud.len() as u64, commonest_share(ring));
        out.send(SensorHealth { stamp: cx.stamp(), numbers, invalid, commonest_share, frozen, checksum });
    }
}

fn bytes<T: Packable>(numbers: &[T]) -> &[u8] {
    T::bytes(numbers)
}

/// The fingerprint of what was seen, and whether it is that of the last time.
fn compare<const N: usize>(last: &mut Option<Digest>, seen: [&[u8]; N]) -> (Digest, bool) {
    let mut hasher = Hasher::new();
    seen.into_iter().for_each(|bytes| hasher.bytes(bytes));
    let checksum = hasher.digest();
    (checksum, last.replace(checksum) == Some(checksum))
}

/// How much of it is one and the same byte: nearly all of a blank image. Zero where there is nothing.
fn commonest_share(bytes: &[u8]) -> f32 {
    let mut counts = [0_u64; 256];
    bytes.iter().for_each(|byte| counts[usize::from(*byte)] += 1);
    let most = counts.into_iter().max().unwrap_or(0);
    (most as f64 / bytes.len().max(1) as f64) as f32
}
