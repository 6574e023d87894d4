//! `swerve train lidar`: trees that classify objects in lidar points, trained on streets drawn from seeds and evaluated
//! on others and on given scenarios.

mod frames;
mod judge;
mod streets;

use std::path::PathBuf;

use anyhow::ensure;
use swerve_core::Span;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::read_scenario;
use swerve_eval::ground_iou;
use swerve_geom::{Ego, Lidar, Transform};
use swerve_msg::{ActorKind, Route};
use swerve_perception::LidarObjects;
use swerve_perception::lidar::score::Model;
use swerve_perception::lidar::train::{Recipe, Sample, boost};
use swerve_perception::lidar::{Candidate, Params, Scan};
use swerve_report::progress::Progress;
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_stack::config::sensors::LidarConfig;

use frames::{Frame, There, sweeps};
use judge::Judge;

/// `swerve train lidar`.
#[derive(clap::Args, Debug)]
pub(crate) struct LidarArgs {
    /// Number of training streets, each drawn from its number
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=FIRST_TEST as i64 - 1))]
    streets: u32,
    /// Number of test streets, different from the training streets
    #[arg(long, default_value_t = 6)]
    test_streets: u32,
    /// Test scenarios, each with seed 1
    #[arg(long, num_args = 1..)]
    test_scenarios: Vec<PathBuf>,
    /// Number of trees per class
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u32).range(1..=1000))]
    trees: u32,
    /// Evaluate the built-in weights without training
    #[arg(long, conflicts_with = "out")]
    judge_only: bool,
    /// Write the weights to this file
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

/// Number of the first test street; training streets have lower numbers.
const FIRST_TEST: u32 = 1001;
/// Name of the lidar.
const ROOF: &str = "roof";
/// Time between two training sweeps: consecutive sweeps add little information.
const EVERY: Span = Span::from_ms(500);

/// Runs `swerve train lidar`.
pub(super) fn run(args: &LidarArgs) -> anyhow::Result<()> {
    args.overwrite.check(args.out.as_deref())?;
    let model = if args.judge_only { Model::shipped() } else { learn(args.streets, args.trees)? };
    if let Some(path) = &args.out {
        let remarks = [
            format!("swerve train lidar --streets {} --trees {}", args.streets, args.trees),
            format!(
                "streets 1 to {}, a sweep of a VLP-32 every 500 ms, each with its route and without",
                args.streets
            ),
        ];
        swerve_report::files::write_whole(path, model.text(&remarks).as_bytes())?;
    }
    ensure!(
        args.test_streets > 0 || !args.test_scenarios.is_empty(),
        "expected a street or a scenario to judge by"
    );
    let seeds = (FIRST_TEST..).take(args.test_streets as usize).map(u64::from);
    let mut held_out: Vec<Drive> = seeds.map(Drive::of_street).collect::<anyhow::Result<_>>()?;
    for path in &args.test_scenarios {
        held_out.push(Drive::new(read_scenario(path)?, 1));
    }
    swerve_report::output::print(&judge(&model, &held_out)?.table())
}

/// Average precision of cars with the built-in weights.
pub(super) fn shipped_cars(streets: usize) -> anyhow::Result<[f64; 3]> {
    let drives: Vec<Drive> = (FIRST_TEST..)
        .take(streets)
        .map(|seed| Drive::of_street(seed.into()))
        .collect::<anyhow::Result<_>>()?;
    Ok(judge(&Model::shipped(), &drives)?.cars())
}

/// Evaluates weights on drives.
fn judge(model: &Model, drives: &[Drive]) -> anyhow::Result<Judge> {
    let progress = Progress::drives(drives.len());
    let mut judge = Judge::new();
    for drive in drives {
        let mut objects = LidarObjects::with_model(Params::default(), model.clone())?;
        judge.begin_drive()?;
        sweeps(&drive.config, &drive.scenario, Span::ZERO, &mut |frame| {
            judge.take(&mut objects, &drive.scan(frame), &frame.there);
        })?;
        progress.one_done();
    }
    progress.finish();
    Ok(judge)
}

/// Trains the trees of each class on this many streets.
fn learn(streets: u32, trees: u32) -> anyhow::Result<Model> {
    let progress = Progress::drives(streets as usize);
    let mut objects = LidarObjects::new(Params::default())?;
    let mut samples: Vec<(ActorKind, Vec<Sample>)> =
        Model::shipped().classes.iter().map(|(kind, _)| (*kind, Vec::new())).collect();
    for seed in 1..=u64::from(streets) {
        let drive = Drive::of_street(seed)?;
        sweeps(&drive.config, &drive.scenario, EVERY, &mut |frame| {
            let scan = drive.scan(frame);
            // The trees must also classify objects without a known route.
            for route in [scan.route, None] {
                for candidate in objects.propose(&Scan { route, ..scan }) {
                    let kind = candidate.found.kind;
                    let Some((_, samples)) = samples.iter_mut().find(|(of, _)| *of == kind) else { continue };
                    let sample =
                        Sample { features: candidate.features, truth: truth(candidate, &frame.there) };
                    samples.push(sample);
                }
            }
        })?;
        progress.one_done();
    }
    progress.finish();
    let recipe = Recipe { trees: trees as usize, ..Recipe::default() };
    let classes = samples.iter().map(|(kind, samples)| (*kind, boost(samples, recipe))).collect();
    Ok(Model { classes })
}

/// Target value of a candidate, 0 to 1, by its largest overlap with an actor of its kind, so that better placed boxes
/// rank above others of the same object.
fn truth(candidate: &Candidate, there: &[There]) -> f32 {
    let found = &candidate.found;
    let same = there.iter().filter(|there| there.truth.kind == found.kind);
    let overlap = same.map(|there| ground_iou(&there.truth, found)).fold(0.0, f64::max);
    let [none, all] = if found.kind.is_person() { [0.1, 0.4] } else { [0.3, 0.7] };
    ((overlap - none) / (all - none)).clamp(0.0, 1.0) as f32
}

/// Drive with a lidar on the roof, with perfect perception.
struct Drive {
    config: Setup,
    scenario: Scenario,
    ego_from_lidar: Transform<Ego, Lidar>,
    route: Route,
}

impl Drive {
    fn new(scenario: Scenario, seed: u64) -> Self {
        let lidar = LidarConfig::default();
        let mut config = Setup::from(Config { seed, ..Config::default() });
        let ego_from_lidar = lidar.ego_from_lidar(&config.sim.vehicle.shape);
        config.lidar.insert(ROOF.into(), lidar);
        config.log.sensors = vec![ROOF.into()];
        let route = scenario.road.route();
        Self { config, scenario, ego_from_lidar, route }
    }

    fn of_street(seed: u64) -> anyhow::Result<Self> {
        Ok(Self::new(streets::street(seed)?, seed))
    }

    fn scan<'a>(&'a self, frame: &Frame<'a>) -> Scan<'a> {
        let mut ego = frame.ego;
        ego.pose = ego.pose_after((frame.cloud.stamp - ego.stamp).as_secs());
        let shape = &self.config.sim.vehicle.shape;
        let rear_m = -shape.rear_overhang_m;
        let own_m = [rear_m, rear_m + shape.length_m, 0.5 * shape.width_m];
        Scan { cloud: frame.cloud, ego_from_lidar: self.ego_from_lidar, ego, own_m, route: Some(&self.route) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streets_are_valid_and_distinct_scenarios() {
        let all: Vec<Scenario> =
            (1..25).chain(1001..1009).map(|seed| streets::street(seed).unwrap()).collect();
        assert!(all.iter().all(|street| street.actors.len() > 10));
        assert!(all.windows(2).all(|two| two[0] != two[1]));
    }

    /// Computes for a minute or more: `.ci/run` runs it beside the tests with the real clock.
    mod long {
        use super::*;

        /// Trains briefly on two streets and tests on a third.
        #[test]
        #[ignore = "minutes of drives"]
        fn trained_weights_generalise_to_another_street() {
            let learned = judge(&learn(2, 30).unwrap(), &[Drive::of_street(1001).unwrap()]).unwrap();
            let [one, ..] = learned.cars();
            assert!(one > 0.6, "{}", learned.table());
        }

        /// Required accuracy: within 40 m, at least 20 points, overlap of one half.
        #[test]
        #[ignore = "minutes of drives"]
        fn built_in_weights_find_cars_on_unseen_streets() {
            let cars = shipped_cars(4).unwrap();
            assert!(cars.into_iter().all(|precision| precision >= 0.8), "{cars:?}");
        }
    }
}
