//! Clouds of a logged drive, with each point placed on the map by the poses in the log.
//!
//! ```text
//! log: poses (of the world, else of the localizer), clouds ──────────────> points on the map
//! log without the clouds' data: states of the world > lidar, once more ──>
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, bail};
use swerve_core::{Span, Time};
use swerve_drive::{logged_scenario, problems_error, threads};
use swerve_flow::{Event, Observer, RunOptions, run_virtual};
use swerve_geom::{Ego, Lidar, Map, Point, Transform};
use swerve_localization::ndt::Vector3;
use swerve_log::{Log, PublicationRecord, Reader, Record};
use swerve_msg::truth::{PointInstances, WorldState};
use swerve_msg::{EgoState, PointCloud};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::{Config, Images, LogConfig};
use swerve_stack::pipeline::Pipeline;

/// First bytes of an MCAP file.
const MAGIC: &[u8; 6] = b"\x89MCAP0";
/// Points nearer to the lidar than this belong to the ego if their instances are unknown, metres.
const NEAR_M: f32 = 2.0;
/// Maximum time from a pose's stamp for which it is extrapolated, seconds.
const POSE_S: f64 = 0.2;

/// True if a file is a log by its first bytes or its name.
pub(super) fn is_log(path: &Path) -> bool {
    use std::io::Read as _;
    let mut head = [0; MAGIC.len()];
    let begins = swerve_text::open_file(path).and_then(|mut file| file.read_exact(&mut head));
    path.extension().is_some_and(|ending| ending == "mcap") || (begins.is_ok() && head == *MAGIC)
}

/// Log and its selected lidar.
pub(super) struct Logged {
    log: Log,
    config: Setup,
    lidar: String,
    ego_from_lidar: Transform<Ego, Lidar>,
    way: Way,
}

impl Logged {
    /// Reads a log for the lidar of this name; without a name the log must have only one.
    ///
    /// # Errors
    /// If the file is not a complete log, or has no clouds or no poses.
    pub(super) fn read(path: &Path, registry: &Registry, lidar: Option<&str>) -> anyhow::Result<Self> {
        let reader = Reader::open(path)?;
        let document = Config::logged(&reader.run_start().config)?;
        let config = Setup::from_document_with(registry, &document, &[])
            .map_err(|problems| problems_error(&problems))?;
        let has_data = config.log.images == Images::Lossless;
        let log = Log::read_where(path, |record| match record {
            Record::Publication(p) => {
                is_of::<WorldState>(p) || is_of::<EgoState>(p) || (has_data && is_cloud(p))
            }
            Record::Watermark(_) => true,
            _ => false,
        })?;
        Self::of(log, config, lidar).with_context(|| path.display().to_string())
    }

    fn of(log: Log, config: Setup, lidar: Option<&str>) -> anyhow::Result<Self> {
        let ran = |name: &&String| log.streams.iter().any(|stream| stream.operator == **name);
        let names: Vec<&str> = config.lidar.keys().filter(ran).map(String::as_str).collect();
        let lidar = match (lidar, &names[..]) {
            (_, []) => bail!("expected a log with a lidar's clouds, as `log.sensors` asks for; it has none"),
            (None, [only]) => *only,
            (Some(name), _) if names.contains(&name) => name,
            _ => bail!("expected --lidar with one of the lidars that it has clouds of: {}", names.join(", ")),
        };
        let ego_from_lidar = config.lidar[lidar].ego_from_lidar(&config.sim.vehicle.shape);
        let (lidar, way) = (lidar.to_owned(), Way::of(&log)?);
        Ok(Self { log, config, lidar, ego_from_lidar, way })
    }

    /// Passes the points of each turn on the map to `each`, without those on actors where known. Returns the number of
    /// turns.
    ///
    /// # Errors
    /// If the clouds are neither in the log nor can be computed again, or have no pose near them.
    pub(super) fn turns(&self, each: &mut (dyn FnMut(&[Vector3<f64>]) + Send)) -> anyhow::Result<usize> {
        let mut turns = 0;
        let mut take = |cloud: &PointCloud, on: Option<&PointInstances>| {
            if let Some(points) = self.placed(cloud, on) {
                turns += 1;
                each(&points);
            }
        };
        if self.config.log.images == Images::Lossless {
            self.recorded(&mut take)?;
        } else {
            self.computed(&mut take)?;
        }
        if turns == 0 {
            bail!(
                "expected poses beside the clouds of `{}`: it has none within {POSE_S} s of any",
                self.lidar
            );
        }
        Ok(turns)
    }

    /// Clouds whose data are in the log.
    fn recorded(&self, take: Take<'_>) -> anyhow::Result<()> {
        let own = || self.log.all_publications().filter(|p| p.stream.operator == self.lidar);
        let truths: BTreeMap<Time, &PublicationRecord> =
            own().filter(|p| is_of::<PointInstances>(p)).map(|p| (p.header.stamp, p)).collect();
        for record in own().filter(|p| is_of::<PointCloud>(p)) {
            let cloud: PointCloud = record.decode()?;
            cloud.check()?;
            let on = truths.get(&record.header.stamp).map(|truth| truth.decode()).transpose()?;
            take(&cloud, on.as_ref());
        }
        Ok(())
    }

    /// Clouds computed again by the lidar from the logged states of the world.
    fn computed(&self, take: Take<'_>) -> anyhow::Result<()> {
        let (true, None) = (self.log.start.extra.contains_key("scenario"), &self.config.live) else {
            bail!("it has only fingerprints of the clouds: record it with log.images = \"lossless\"");
        };
        let Some(world) = self.log.all_publications().find(|p| is_of::<WorldState>(p)) else {
            bail!("expected states of the world, to compute the clouds of `{}` again", self.lidar);
        };
        let scenario = logged_scenario(&self.log.start)?;
        let Config { seed, ego, sim, render, lidar, .. } = self.config.config.clone();
        let log = LogConfig { sensors: vec![self.lidar.clone()], ..LogConfig::default() };
        let alone = Config { seed, ego, sim, render, lidar, log, ..Config::default() };
        let alone = self.config.with_config(alone);
        let mut pipeline = Pipeline::build(&alone, &scenario)?;
        let others = pipeline.assembly.operators().iter().map(|placed| placed.name.clone());
        for name in others.filter(|name| *name != self.lidar).collect::<Vec<_>>() {
            let is_world = name == world.stream.operator;
            let played = if is_world { self.log.playback(&name) } else { Vec::new() };
            pipeline.graph.playback(&name, played)?;
        }
        let until = self.log.end.as_ref().map(|end| end.at);
        let options = RunOptions { seed: self.log.start.seed, threads: threads::cores(), until };
        let mut clouds = Clouds { lidar: &self.lidar, cloud: None, take };
        run_virtual(pipeline.graph, &options, vec![&mut clouds])?;
        Ok(())
    }

    /// Points of a turn on the map, each by the lidar's pose at its own instant. `None` if a pose is missing.
    fn placed(&self, cloud: &PointCloud, on: Option<&PointInstances>) -> Option<Vec<Vector3<f64>>> {
        let mut points = Vec::with_capacity(cloud.len());
        for k in 0..cloud.len() {
            let there = [cloud.x_m[k], cloud.y_m[k], cloud.z_m[k]];
            let is_still = match on {
                Some(on) => on.instance.get(k) == Some(&0),
                None => there.iter().map(|x| x * x).sum::<f32>() > NEAR_M * NEAR_M,
            };
            if is_still {
                let then = cloud.stamp + Span::from_secs(f64::from(cloud.time_offset_s[k]));
                let [x, y, z] = there.map(f64::from);
                let at = (self.way.at(then)? * self.ego_from_lidar * Point::new(x, y, z)).coords;
                points.push(Vector3::new(at.x, at.y, at.z));
            }
        }
        Some(points)
    }
}

/// Consumer of a cloud and its points' instances.
type Take<'a> = &'a mut (dyn FnMut(&PointCloud, Option<&PointInstances>) + Send);

/// Passes on the clouds of a run, each with its points' instances.
struct Clouds<'a> {
    lidar: &'a str,
    cloud: Option<PointCloud>,
    take: Take<'a>,
}

impl Observer for Clouds<'_> {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload.filter(|_| publication.operator == self.lidar) else {
            return;
        };
        if let Some(cloud) = payload.downcast_ref::<PointCloud>() {
            self.cloud = Some(cloud.clone());
        } else if let Some(on) = payload.downcast_ref::<PointInstances>()
            && let Some(cloud) = self.cloud.take().filter(|cloud| cloud.stamp == on.stamp)
        {
            (self.take)(&cloud, Some(on));
        }
    }
}

fn is_of<T>(publication: &PublicationRecord) -> bool {
    publication.stream.type_name == core::any::type_name::<T>()
}

fn is_cloud(publication: &PublicationRecord) -> bool {
    is_of::<PointCloud>(publication) || is_of::<PointInstances>(publication)
}

/// Motion of the ego, by stamp.
struct Way(Vec<Moment>);

/// Pose of the ego at an instant, and its velocities.
struct Moment {
    stamp: Time,
    map_from_ego: Transform<Map, Ego>,
    speed_mps: f64,
    /// Angular velocity about the ego's axes, rad/s.
    turn_radps: [f64; 3],
}

impl Way {
    /// Motion from the states of the world if the log has them, else from the poses of the localizer, or else of the
    /// vehicle.
    fn of(log: &Log) -> anyhow::Result<Self> {
        let mut moments = Vec::new();
        for record in log.all_publications().filter(|p| is_of::<WorldState>(p)) {
            moments.push(Moment::of_world(&record.decode()?));
        }
        if moments.is_empty() {
            let told = || log.all_publications().filter(|p| is_of::<EgoState>(p));
            let by = told().find(|p| p.stream.operator == "localizer").or(told().next());
            let Some(by) = by else {
                bail!("expected a log with poses, of the world or of a localizer; it has none")
            };
            for record in told().filter(|p| p.stream.stream == by.stream.stream) {
                moments.push(Moment::of_state(&record.decode()?));
            }
        }
        moments.sort_by_key(|moment| moment.stamp);
        Ok(Self(moments))
    }

    /// Pose extrapolated from the last moment up to `at`, or else from the first; `None` if that is more than
    /// [`POSE_S`] away.
    fn at(&self, at: Time) -> Option<Transform<Map, Ego>> {
        let place = self.0.partition_point(|moment| moment.stamp <= at);
        let moment = self.0.get(place.saturating_sub(1))?;
        let dt_s = (at - moment.stamp).as_secs();
        let [roll, pitch, yaw] = moment.turn_radps.map(|turn| turn * dt_s);
        let moved = Transform::<Ego, Ego>::from_roll_pitch_yaw(
            Point::new(moment.speed_mps * dt_s, 0.0, 0.0),
            roll,
            pitch,
            yaw,
        );
        (dt_s.abs() <= POSE_S).then(|| moment.map_from_ego * moved)
    }
}

impl Moment {
    fn of_world(world: &WorldState) -> Self {
        let turn = world.ego.angular_velocity_radps.coords;
        Self {
            stamp: world.stamp,
            map_from_ego: world.ego.map_from_ego,
            speed_mps: world.ego.state.speed_mps,
            turn_radps: [turn.x, turn.y, turn.z],
        }
    }

    fn of_state(state: &EgoState) -> Self {
        let at = Point::new(state.pose.x_m, state.pose.y_m, 0.0);
        Self {
            stamp: state.stamp,
            map_from_ego: Transform::from_roll_pitch_yaw(at, 0.0, 0.0, state.pose.heading_rad),
            speed_mps: state.speed_mps,
            turn_radps: [0.0, 0.0, state.yaw_rate_radps],
        }
    }
}
