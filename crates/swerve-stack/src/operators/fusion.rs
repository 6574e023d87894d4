//! Fusion of the objects of camera and lidar detectors with a radar's echoes into one list.

use anyhow::{Context as _, bail, ensure};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span, Time};
use swerve_flow::{
    Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo, Window,
};
use swerve_geom::{Ego, Pose2};
use swerve_msg::{Detections, EgoState, Image, RadarScan};
use swerve_perception::fusion::{CameraSight, Echoes, Params, Sighted, Sources, fuse};
use swerve_perception::image_box::ImageCamera;

use crate::config::camera::CameraConfig;
use crate::config::execution::span_of_ms;
use crate::config::perception::image_camera;
use crate::kind::{Node, OperatorKind, Settings};
use crate::problems::problems_of_ranges;
use crate::section::Section;
use crate::site::Site;

/// Past poses kept to find those at the stamps of the inputs.
const POSES: usize = 256;
/// Past depth images and radar scans kept to find those at the boxes' stamp: detectors take time.
const DEPTHS: usize = 32;
const SCANS: usize = 32;

/// Fuses objects of a camera and a lidar with a radar's echoes.
pub(super) struct Fusions;

/// Its keys in `[operator.NAME]`.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
struct Table {
    /// The `[camera.NAME]` of the boxes' images; when absent the only camera, else the emulated detector's.
    view: Option<String>,
    /// Time between two lists, ms; there is none without new inputs.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    period_ms: f64,
    /// Age relative to the newest boxes above which boxes and echoes are ignored, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    age_max_ms: f64,
    /// Expected errors of the sources, and limits for associating objects.
    #[ranges(nested)]
    params: Params,
}

impl Default for Table {
    fn default() -> Self {
        Self { view: None, period_ms: 50.0, age_max_ms: 1000.0, params: Params::default() }
    }
}

/// Inputs when a list is due. Streams that `reads` does not name are not read.
#[derive(Inputs)]
struct In {
    /// Period of the fusion.
    tick: Every,
    /// Boxes found in a camera's images.
    camera: Option<Latest<Detections>>,
    /// Boxes found in a lidar's points.
    lidar: Option<Latest<Detections>>,
    /// Past echoes of a radar.
    radar: Option<Window<RadarScan, SCANS>>,
    /// Depth images of the camera.
    depth: Option<Window<Image, DEPTHS>>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
}

/// Ports that exist only where `reads` names them.
const NAMED: [&str; 4] = ["camera", "lidar", "radar", "depth"];

/// Its settings.
const SECTION: Section<Table> = Section::own(|table, _| problems_of_ranges(table));

impl OperatorKind for Fusions {
    fn node(&self) -> Node {
        Node::new("fusion", "one list of the objects of a camera and a lidar, with a radar's speeds")
            .section(&SECTION)
    }

    fn schema(&self) -> Option<schemars::Schema> {
        Some(schemars::schema_for!(Table))
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<Detections> as NamedOutputs>::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        let reads = settings.setup.operator.get(settings.name).map(|own| &own.reads);
        let named = |port: &str| reads.is_some_and(|reads| reads.contains_key(port));
        let all = In::ports();
        // Two lists of boxes differ by name only; without a name, or with a wrong one, all ports are listed.
        let is_known =
            reads.is_some_and(|reads| reads.keys().all(|name| all.iter().any(|port| *port.name == **name)));
        if !is_known || !NAMED.iter().any(|port| named(port)) {
            return all;
        }
        all.into_iter().filter(|port| !NAMED.contains(&&*port.name) || named(&port.name)).collect()
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let (name, config, settings) = (site.name().to_owned(), site.config(), site.settings());
        let table = SECTION.get(config, &name);
        let own = config.operator.get(&name);
        let is_read = |port: &str| own.is_some_and(|own| own.reads.contains_key(port));
        ensure!(
            is_read("camera") || is_read("lidar"),
            "operator.{name}.reads: expected `camera` or `lidar`, or both: the boxes that are to be fused"
        );
        let ego_from_radar = match site.source_of("radar").filter(|_| is_read("radar")) {
            None => Pose2::default(),
            Some(radar) => {
                let at = config.radar.get(radar).with_context(|| {
                    format!("operator.{name}: expected echoes of a [radar.NAME], whose mounting pose is known, found `{radar}`")
                })?;
                let mount = at.mount(&config.sim.vehicle.shape);
                Pose2::new(mount.x_m, mount.y_m, mount.yaw_rad)
            }
        };
        let view = match (&table.view, config.camera.len()) {
            (Some(view), _) => config.camera.get(view).cloned().with_context(|| {
                let names: Vec<&str> = config.camera.keys().map(String::as_str).collect();
                let near = swerve_text::did_you_mean(view, names.iter().copied());
                format!(
                    "operator.{name}.view: unknown camera `{view}`, expected one of [{}]{near}",
                    names.join(", ")
                )
            })?,
            (None, 1) => config.camera.values().next().cloned().unwrap_or_default(),
            (None, _) => CameraConfig::default(),
        };
        let Some(view) = image_camera(&view) else {
            bail!("operator.{name}.view: expected a camera whose rays meet in one point");
        };
        let period = span_of_ms(table.period_ms);
        let operator = Fusion {
            params: table.params,
            age_max: span_of_ms(table.age_max_ms),
            view,
            ego_from_radar,
            newest: None,
            told: [None; 2],
        };
        let timer = settings.drawn_timer(period);
        site.add(operator, Some(timer))
    }
}

/// Fuses the newest message of each source.
struct Fusion {
    params: Params,
    age_max: Span,
    view: ImageCamera,
    ego_from_radar: Pose2<Ego>,
    /// Stamp of the newest list.
    newest: Option<Time>,
    /// Stamps of the camera's and the lidar's messages in that list.
    told: [Option<Time>; 2],
}

impl Operator for Fusion {
    type In = In;
    type Out = Port<Detections>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Port<Detections>) {
        let poses = input.poses.get();
        let ego_at = |stamp: Time| {
            let before = poses.iter().rev().find(|pose| pose.header().stamp <= stamp).or(poses.first())?;
            let mut ego = **before;
            ego.pose = before.pose_after((stamp - before.stamp).as_secs());
            Some(ego)
        };
        let boxes = [&input.camera, &input.lidar].map(|port| port.as_ref().and_then(Latest::get));
        let newest = boxes.iter().flatten().map(|found| found.stamp).max();
        // A list of the same instant as the last one has no news.
        let Some(newest) = newest.filter(|newest| Some(*newest) > self.newest) else { return };
        let [camera, lidar] = boxes.map(|found| {
            let found = found.filter(|found| newest - found.stamp <= self.age_max)?;
            Some((found, ego_at(found.stamp)?.pose))
        });
        let stamps = [&camera, &lidar].map(|source| source.as_ref().map(|(found, _)| found.stamp));
        let is_new = [0, 1].map(|source| stamps[source] != self.told[source]);
        let depth = camera.as_ref().and_then(|(found, _)| {
            input.depth.as_ref()?.get().iter().find(|image| image.stamp == found.stamp)
        });
        let echoes = input.radar.as_ref().and_then(|radar| {
            let apart = |scan: &RadarScan| (scan.stamp - newest).max(newest - scan.stamp);
            let scan = radar.get().iter().min_by_key(|scan| apart(scan))?;
            let scan = Some(scan).filter(|scan| apart(scan) <= self.age_max)?;
            Some(Echoes { scan, ego: ego_at(scan.stamp)?, ego_from_radar: self.ego_from_radar })
        });
        let sources = Sources {
            camera: camera.as_ref().map(|(found, ego)| CameraSight {
                boxes: Sighted { found, ego: *ego, is_new: is_new[0] },
                camera: self.view,
                depth: depth.map(|image| &**image),
            }),
            lidar: lidar.as_ref().map(|(found, ego)| Sighted { found, ego: *ego, is_new: is_new[1] }),
            radar: echoes,
        };
        let Some(fused) = fuse(&sources, &self.params) else { return };
        // Without a pose at the newest instant, the list is of an earlier one.
        if Some(fused.stamp) > self.newest {
            (self.newest, self.told) = (Some(fused.stamp), stamps);
            out.loan().send(fused);
        }
    }
}
