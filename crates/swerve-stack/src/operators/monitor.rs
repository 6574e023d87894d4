//! Monitors of single cameras and lidars.

use swerve_core::{Digest, Hasher};
use swerve_flow::{At, Context, Inputs, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo};
use swerve_msg::{Image, Packable, PointCloud, SensorHealth};

use crate::config::monitor::MonitorConfig;
use crate::kind::{Heavy, Node, OperatorKind, Settings};
use crate::site::Site;

/// Monitors, `[monitor.NAME]`.
pub(super) struct Monitors;

/// Every image of a camera.
#[derive(Inputs)]
struct Images {
    /// Images to check.
    image: At<Image>,
}

/// Every sweep of a lidar.
#[derive(Inputs)]
struct Clouds {
    /// Point clouds to check.
    cloud: At<PointCloud>,
}

impl OperatorKind for Monitors {
    fn node(&self) -> Node {
        Node::new("sensor_monitor", "detects a frozen, blank or broken camera or lidar")
            .section(&MonitorConfig::SECTION)
            .heavy(Heavy::OnWallClock)
            .follows_from_world()
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<SensorHealth> as NamedOutputs>::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if watches_lidar(settings) { Clouds::ports() } else { Images::ports() }
    }

    fn reads(&self, settings: &Settings<'_>) -> Vec<(&'static str, String)> {
        let Some(monitor) = settings.setup.monitor.get(settings.name) else { return Vec::new() };
        let sensor = monitor.sensor.clone();
        match (watches_lidar(settings), settings.setup.live.is_some()) {
            (true, _) => vec![("cloud", sensor)],
            (false, true) => vec![("image", sensor)],
            (false, false) => vec![("image", format!("{sensor}.{}", monitor.output.name()))],
        }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        if watches_lidar(&site.settings()) {
            site.add(CloudMonitor::default(), None)
        } else {
            site.add(ImageMonitor::default(), None)
        }
    }
}

fn watches_lidar(settings: &Settings<'_>) -> bool {
    let monitor = settings.setup.monitor.get(settings.name);
    monitor.is_some_and(|monitor| settings.setup.lidar.contains_key(&monitor.sensor))
}

/// Monitors a camera: reads every byte of its images.
#[derive(Default)]
struct ImageMonitor {
    last: Option<Digest>,
}

/// Monitors a lidar: reads every byte of its point clouds.
#[derive(Default)]
struct CloudMonitor {
    last: Option<Digest>,
}

impl Operator for ImageMonitor {
    type In = Images;
    type Out = Port<SensorHealth>;

    fn step(&mut self, cx: &mut Context<'_>, input: &Images, out: &mut Self::Out) {
        let Some(image) = input.image.get() else { return };
        let bytes = image.pixels.bytes();
        let (checksum, frozen) = compare(&mut self.last, [bytes]);
        let (numbers, invalid) = (image.pixels.len() as u64, u64::from(image.check().is_err()));
        let commonest_share = commonest_share(bytes);
        out.send(SensorHealth { stamp: cx.stamp(), numbers, invalid, commonest_share, frozen, checksum });
    }
}

impl Operator for CloudMonitor {
    type In = Clouds;
    type Out = Port<SensorHealth>;

    fn step(&mut self, cx: &mut Context<'_>, input: &Clouds, out: &mut Self::Out) {
        let Some(cloud) = input.cloud.get() else { return };
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

/// Fingerprint of the data, and true if it equals the last one.
fn compare<const N: usize>(last: &mut Option<Digest>, seen: [&[u8]; N]) -> (Digest, bool) {
    let mut hasher = Hasher::new();
    seen.into_iter().for_each(|bytes| hasher.bytes(bytes));
    let checksum = hasher.digest();
    (checksum, last.replace(checksum) == Some(checksum))
}

/// Share of the most frequent byte: near 1 for a blank image, 0 for no data.
fn commonest_share(bytes: &[u8]) -> f32 {
    let mut counts = [0_u64; 256];
    bytes.iter().for_each(|byte| counts[usize::from(*byte)] += 1);
    let most = counts.into_iter().max().unwrap_or(0);
    (most as f64 / bytes.len().max(1) as f64) as f32
}
