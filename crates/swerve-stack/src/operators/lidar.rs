//! Lidars on the ego.

use std::sync::{Arc, Mutex};

use anyhow::Context as _;
use swerve_core::{Rng, Span, Time};
use swerve_flow::{
    At, Context, Inputs, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port, PortInfo, Workers,
};
use swerve_geom::{Ego, Lidar, Map, Transform};
use swerve_gpu::{AdapterKind, Gpu};
use swerve_lidar::{CloudMut, Firing, LidarEngine, SceneTree, Sweeper, TruthMut};
use swerve_msg::block::Memory;
use swerve_msg::truth::{PointInstances, WorldState};
use swerve_msg::{Packed, PointCloud};

use super::camera::on_its_way;
use crate::config::sensors::LidarConfig;
use crate::kind::{Heavy, Node, OnItsWay, OperatorKind, Settings};
use crate::site::Site;
use crate::stage::{Pool, SharedStage, StreamMemory, hides_ego, lock, threads};
use crate::street::EGO_INSTANCE;

/// Lidars, `[lidar.NAME]`: of the simulated world, or of a vehicle.
pub(super) struct Lidars;

/// Every state of the world.
#[derive(Inputs)]
struct In {
    /// State of the world to scan.
    world: At<WorldState>,
}

/// One sweep.
#[derive(Outputs)]
struct Out {
    /// Points of the sweep.
    points: Port<PointCloud>,
    /// Instances that the points are on.
    truth: Port<PointInstances>,
}

impl OperatorKind for Lidars {
    fn node(&self) -> Node {
        Node::sensor("lidar", "a lidar on the ego: the points of each turn, and what they lie on")
            .section(&LidarConfig::SECTION)
            .heavy(Heavy::OnWallClock)
            .origin()
            .on_demand()
            .follows_from_world()
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        if settings.setup.live.is_some() { <Port<PointCloud> as NamedOutputs>::ports() } else { Out::ports() }
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if settings.setup.live.is_some() { Vec::new() } else { In::ports() }
    }

    fn on_its_way(&self, settings: &Settings<'_>) -> Option<OnItsWay> {
        if settings.setup.live.is_some() { None } else { on_its_way(settings) }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        if site.config().live.is_some() {
            site.add_source::<PointCloud>();
            return Ok(());
        }
        // The arrays of a point cloud: x, y, z, intensity, ring, time.
        let memory = [site.memory("points", 6), site.memory("truth", 1)];
        let stage = site.stage();
        let settings = site.settings();
        let Some(lidar) = settings.setup.lidar.get(settings.name) else {
            anyhow::bail!("lidar.{}: there is no such table", settings.name);
        };
        let operator = LidarOperator::new(lidar, &settings, stage, memory)?;
        site.add(operator, None)
    }
}

/// A lidar on the ego: the points of each sweep, and the instances that they are on.
///
/// At every step of the world it fires the columns since the step before, each from the sensor's pose at that time, at
/// the scene of this step. A sweep is published at the first step at which it is complete.
struct LidarOperator {
    stage: SharedStage,
    sweeper: Arc<Sweeper>,
    ego_from_lidar: Transform<Ego, Lidar>,
    hidden_instance: Option<u32>,
    /// Begin and number of the current sweep.
    begins: Time,
    turn: u64,
    /// Time of the step before, and pose of the sensor then.
    last: Option<(Time, Transform<Map, Lidar>)>,
    /// Points so far, if columns are fired at each step;
    sweep: Option<Sweep>,
    /// firings to be done, if other threads fire the whole sweep once it is complete.
    steps: Vec<(Arc<SceneTree>, Firing)>,
    memory: Arc<Mutex<Memories>>,
}

/// Memory of sweeps.
struct Memories {
    clouds: Pool<PointCloud>,
    truths: Pool<PointInstances>,
}

/// The current sweep, with room for all its points.
struct Sweep {
    cloud: Arc<PointCloud>,
    truth: Arc<PointInstances>,
    /// Class of each point, which is not published.
    class: Vec<u8>,
    len: usize,
}

/// A sweep for publication.
type Ended = (Arc<PointCloud>, Arc<PointInstances>);

impl LidarOperator {
    fn new(
        lidar: &LidarConfig,
        settings: &Settings<'_>,
        stage: SharedStage,
        [points, truth]: [StreamMemory; 2],
    ) -> anyhow::Result<Self> {
        let Settings { name, setup: config, .. } = *settings;
        let shape = &config.sim.vehicle.shape;
        let seed = Rng::keyed(config.seed, name, &[]).bits();
        let wrong = |faults: Vec<(String, String)>| anyhow::anyhow!("lidar.{name}: {faults:?}");
        let (spec, threads) = (lidar.spec(seed).map_err(wrong)?, threads(config));
        let sweeper = match lidar.engine {
            LidarEngine::Cpu => Sweeper::new(spec, threads)?,
            LidarEngine::Gpu => {
                let gpu = Gpu::shared(AdapterKind::Gpu).context(format!("lidar.{name}.engine"))?;
                Sweeper::on_gpu(spec, threads, &gpu)?
            }
        };
        let ego_from_lidar = lidar.ego_from_lidar(shape);
        let hidden_instance = hides_ego(lidar.at_m(shape), shape).then_some(EGO_INSTANCE);
        let memory = Memories { clouds: Pool::new(points), truths: Pool::new(truth) };
        let begins = Time::ZERO + settings.phase(Span::from_ns(sweeper.period_ns()));
        let last = None;
        Ok(Self {
            stage,
            sweeper: Arc::new(sweeper),
            ego_from_lidar,
            hidden_instance,
            begins,
            turn: 0,
            last,
            sweep: None,
            steps: Vec::new(),
            memory: Arc::new(Mutex::new(memory)),
        })
    }

    /// Fires the columns of this sweep up to a step of the world, or records them `for_others`.
    fn fire(
        &mut self,
        world: &WorldState,
        end: Transform<Map, Lidar>,
        for_others: bool,
    ) -> Result<(), String> {
        let (since, begin) = self.last.unwrap_or((world.stamp, end));
        let firing = Firing {
            begin_ns: (since - self.begins).ns(),
            begin,
            end_ns: (world.stamp - self.begins).ns(),
            end,
            hidden_instance: self.hidden_instance,
        };
        let tree = self.stage.tree_of(world).map_err(|error| error.to_string())?;
        if for_others {
            firing.check().map_err(|error| error.to_string())?;
            self.steps.push((tree, firing));
            return Ok(());
        }
        let points_max = self.sweeper.points_max();
        let sweep = self.sweep.get_or_insert_with(|| Sweep::new(points_max, &self.memory));
        let sweeper = alone(&mut self.sweeper);
        sweeper.fire(&tree, &firing, &mut sweep.room()).map_err(|error| error.to_string())?;
        self.stage.note(sweeper);
        Ok(())
    }

    /// Ends the current sweep, whose columns are all fired, and begins the next one.
    fn end_turn(&mut self, stamp: Time, out: &mut Out) -> Result<(), String> {
        let Some(sweep) = &mut self.sweep else { return Ok(()) };
        let (cloud, truth) = sweep.end(self.begins, stamp, &self.memory)?;
        out.points.forward(cloud);
        out.truth.forward(truth);
        sweep.begin(self.sweeper.points_max(), &self.memory);
        alone(&mut self.sweeper).begin_turn(self.turn + 1, &mut sweep.room());
        Ok(())
    }

    /// Leaves the sweep to a worker thread.
    fn leave_turn(&mut self, stamp: Time, workers: &Workers, out: &mut Out) {
        let (points, truth) = (workers.promise(&mut out.points), workers.promise(&mut out.truth));
        let (sweeper, memory) = (self.sweeper.clone(), self.memory.clone());
        let (turn, begins, steps) = (self.turn, self.begins, core::mem::take(&mut self.steps));
        workers.spawn(move || {
            let mut sweep = Sweep::new(sweeper.points_max(), &memory);
            let fired = sweeper.fire_turn(turn, &steps, &mut sweep.room()).map_err(|error| error.to_string());
            match fired.and_then(|()| sweep.end(begins, stamp, &memory)) {
                Ok(ended) => {
                    points.keep(ended.0);
                    truth.keep(ended.1);
                }
                Err(error) => {
                    points.fail(error.as_str());
                    truth.fail(error);
                }
            }
        });
    }
}

/// The sweeper of an operator that leaves no sweep to other threads.
fn alone(sweeper: &mut Arc<Sweeper>) -> &mut Sweeper {
    Arc::get_mut(sweeper).expect("a run leaves all turns to others or none")
}

impl Operator for LidarOperator {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(world) = input.world.get() else { return };
        let map_from_lidar = world.ego.map_from_ego * self.ego_from_lidar;
        let period = Span::from_ns(self.sweeper.period_ns());
        let workers = cx.workers().filter(|_| self.sweeper.engine() == LidarEngine::Cpu).cloned();
        // One step may have the end of a sweep and the begin of the next.
        while self.begins <= world.stamp {
            if let Err(error) = self.fire(world, map_from_lidar, workers.is_some()) {
                return cx.stop_run(format!("lidar {}: {error}", cx.name()));
            }
            let ends = self.begins + period;
            if world.stamp < ends {
                break;
            }
            if let Some(workers) = &workers {
                self.leave_turn(world.stamp, workers, out);
            } else if let Err(error) = self.end_turn(world.stamp, out) {
                return cx.stop_run(format!("lidar {}: {error}", cx.name()));
            }
            self.turn += 1;
            self.begins = ends;
        }
        self.last = Some((world.stamp, map_from_lidar));
    }
}

impl Sweep {
    fn new(points_max: usize, memory: &Mutex<Memories>) -> Self {
        let (cloud, truth) = Self::memory(points_max, memory);
        let mut sweep = Self { cloud, truth, class: vec![0; points_max], len: 0 };
        sweep.reset(points_max);
        sweep
    }

    /// Takes memory that no reader holds, with room for a sweep.
    fn begin(&mut self, points_max: usize, memory: &Mutex<Memories>) {
        (self.cloud, self.truth) = Self::memory(points_max, memory);
        self.reset(points_max);
    }

    fn memory(points_max: usize, memory: &Mutex<Memories>) -> Ended {
        let truth = |memory: Option<&dyn Memory>| PointInstances {
            instance: Packed::in_memory(memory, points_max),
            ..PointInstances::default()
        };
        let Memories { clouds, truths } = &mut *lock(memory);
        (clouds.take(|memory| PointCloud::in_memory(memory, points_max)), truths.take(truth))
    }

    fn reset(&mut self, points_max: usize) {
        let (cloud, truth) = self.parts();
        for array in
            [&mut cloud.x_m, &mut cloud.y_m, &mut cloud.z_m, &mut cloud.intensity, &mut cloud.time_offset_s]
        {
            array.reset(points_max);
        }
        cloud.ring.reset(points_max);
        truth.instance.reset(points_max);
        self.len = 0;
    }

    fn parts(&mut self) -> (&mut PointCloud, &mut PointInstances) {
        let held = "what is being written is not published yet";
        (Arc::get_mut(&mut self.cloud).expect(held), Arc::get_mut(&mut self.truth).expect(held))
    }

    fn room(&mut self) -> CloudMut<'_> {
        let held = "what is being written is not published yet";
        let cloud = Arc::get_mut(&mut self.cloud).expect(held);
        let truth = Arc::get_mut(&mut self.truth).expect(held);
        CloudMut {
            len: &mut self.len,
            x_m: &mut cloud.x_m,
            y_m: &mut cloud.y_m,
            z_m: &mut cloud.z_m,
            intensity: &mut cloud.intensity,
            ring: &mut cloud.ring,
            offset_s: &mut cloud.time_offset_s,
            truth: Some(TruthMut { instance: &mut truth.instance, class: &mut self.class }),
        }
    }

    /// The sweep for publication: its points only, their times relative to the stamp.
    fn end(&mut self, begins: Time, stamp: Time, memory: &Mutex<Memories>) -> Result<Ended, String> {
        let (len, shift_s) = (self.len, (begins - stamp).as_secs());
        let (cloud, truth) = self.parts();
        (cloud.stamp, truth.stamp) = (stamp, stamp);
        for array in
            [&mut cloud.x_m, &mut cloud.y_m, &mut cloud.z_m, &mut cloud.intensity, &mut cloud.time_offset_s]
        {
            array.truncate(len);
        }
        cloud.ring.truncate(len);
        truth.instance.truncate(len);
        for offset_s in cloud.time_offset_s.iter_mut() {
            *offset_s = (f64::from(*offset_s) + shift_s) as f32;
        }
        cloud.seal()?;
        truth.instance.seal()?;
        let mut memory = lock(memory);
        memory.clouds.keep(&self.cloud);
        memory.truths.keep(&self.truth);
        Ok((self.cloud.clone(), self.truth.clone()))
    }
}
