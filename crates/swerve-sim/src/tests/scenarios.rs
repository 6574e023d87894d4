//! The scenarios of `scenarios/`, driven by a driver who keeps the lane and brakes fully for actors in the lane or
//! about to enter it. The `[expect]` of a pipeline without a name states the result for such a driver.

use swerve_geom::{FrenetPoint, angle_between, math};
use swerve_msg::truth::{Collision, EndReason, WorldState};
use swerve_msg::{Command, Obstacle, Route};
use swerve_scenario::{Metric, Scenario, Verdict};
use swerve_vehicle::Shape;

use crate::Simulator;
use crate::sense::{SensorMount, SensorParams, visible_obstacles};

/// Metrics of a run.
struct Figures {
    first_hit: Option<Collision>,
    left_road: bool,
    min_distance_m: f64,
    road_margin_m: f64,
    end: WorldState,
}

struct Driver {
    shape: Shape,
    speed_mps: f64,
    braking: bool,
}

impl Driver {
    fn command(&mut self, state: &WorldState, route: &Route) -> Command {
        let ego = &state.ego.state;
        let place = route.project(ego.pose.point());
        let line = route.line().at(place.s_m + 0.5 * ego.speed_mps);
        let off_rad = angle_between(ego.pose.heading_rad, route.line().at(place.s_m).pose.heading_rad);
        let steering_rad =
            math::atan(self.shape.wheelbase_m * line.curvature_1pm) + 0.4 * off_rad - 0.05 * place.d_m;
        let seen = visible_obstacles(state, &SensorMount::roof(&self.shape), &SensorParams::default());
        self.braking = seen.obstacles.iter().any(|o| self.is_in_the_way(o, ego.speed_mps, place.s_m, route));
        if self.braking {
            return Command { steering_rad, throttle: 0.0, brake: 1.0 };
        }
        let wish = 0.8 * (self.speed_mps - ego.speed_mps);
        Command { steering_rad, throttle: wish.clamp(0.0, 1.0), brake: (-wish).clamp(0.0, 1.0) }
    }

    /// True if the obstacle is in the lane ahead now or within one second, and near enough to brake for.
    fn is_in_the_way(&self, obstacle: &Obstacle, speed_mps: f64, own_s_m: f64, route: &Route) -> bool {
        let corners = obstacle.extent.footprint(obstacle.pose).corners();
        let now = corners.map(|corner| route.project(corner));
        let soon = corners.map(|corner| route.project(corner + obstacle.velocity_mps));
        let lowest = |values: [f64; 8]| values.into_iter().fold(f64::INFINITY, f64::min);
        let both = |of: fn(&FrenetPoint) -> f64| {
            core::array::from_fn(|i| of(now.iter().chain(&soon).nth(i).unwrap()))
        };
        let own_front_m = own_s_m + self.shape.length_m - self.shape.rear_overhang_m;
        let gap_m = lowest(both(|p| p.s_m)) - own_front_m;
        // All corners right of the lane, all left of it, or in it.
        let (right_m, left_m) = (lowest(both(|p| p.d_m)), -lowest(both(|p| -p.d_m)));
        let in_lane = right_m < 1.3 && left_m > -1.3;
        in_lane && gap_m > -2.0 && gap_m < speed_mps * speed_mps / (2.0 * 7.0) + 0.3 * speed_mps + 3.0
    }
}

fn run(scenario: &Scenario, seed: u64, hz: i64) -> Figures {
    let mut sim = Simulator::new(scenario, &super::at_hz(hz), seed).unwrap();
    let route = sim.route().clone();
    let shape = sim.params().vehicle.shape;
    let mut driver = Driver { shape, speed_mps: sim.scenario().ego.target_speed_mps, braking: false };
    let mut figures = Figures {
        first_hit: None,
        left_road: false,
        min_distance_m: f64::INFINITY,
        road_margin_m: f64::INFINITY,
        end: sim.state().clone(),
    };
    while sim.state().ended.is_none() {
        let command = driver.command(sim.state(), &route);
        let state = sim.step(command);
        let outline = shape.footprint(state.ego.state.pose);
        figures.left_road |= !state.infractions.is_empty();
        figures.road_margin_m = figures.road_margin_m.min(route.margin_m(&outline));
        for actor in &state.actors {
            figures.min_distance_m = figures.min_distance_m.min(actor.gap_m(&outline));
        }
        if figures.first_hit.is_none() {
            figures.first_hit = state.collisions_of_ego().next().map(|(_, hit)| hit.clone());
        }
    }
    figures.end = sim.state().clone();
    figures
}

impl Figures {
    fn verdict(&self) -> Verdict {
        match self.end.ended {
            _ if self.first_hit.is_some() => Verdict::Collision,
            _ if self.left_road => Verdict::LeftRoad,
            Some(EndReason::Timeout) => Verdict::Timeout,
            _ if self.end.actors.is_empty() => Verdict::Completed,
            _ => Verdict::Avoided,
        }
    }

    fn get(&self, metric: Metric) -> Option<f64> {
        match metric {
            Metric::MinDistanceM => Some(self.min_distance_m),
            Metric::ImpactSpeedMps => self.first_hit.as_ref().map(|hit| hit.speeds_mps[0]),
            Metric::ClosingSpeedMps => self.first_hit.as_ref().map(|hit| hit.closing_speed_mps),
            Metric::EndSpeedMps => Some(self.end.ego.state.speed_mps),
            Metric::DurationS => Some(self.end.stamp.as_secs()),
            Metric::RoadMarginM => Some(self.road_margin_m),
            Metric::RedLightsPassed
            | Metric::LateralAccelMaxMps2
            | Metric::LateralJerkMaxMps3
            | Metric::DecelerationMaxMps2
            | Metric::ComfortShare
            | Metric::MinTtcS
            | Metric::MinHeadwayS
            | Metric::DistanceOverLineM
            | Metric::TimeInOncomingLaneS
            | Metric::SpeedOverTargetMps => None,
        }
    }
}

fn shipped() -> Vec<Scenario> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    // Scenarios in subfolders and on maps expect a driver who follows, waits and passes.
    paths.retain(|path| path.is_file());
    paths.sort();
    let read =
        |path: &std::path::PathBuf| Scenario::read(path).unwrap_or_else(|problems| panic!("{problems:#?}"));
    paths.iter().map(read).filter(|scenario| scenario.road.strip().is_some()).collect()
}

#[test]
fn scenarios_at_1_khz_match_those_at_200_hz() {
    for scenario in shipped() {
        let (coarse, fine) = (run(&scenario, 0, 200), run(&scenario, 0, 1000));
        assert_eq!(coarse.verdict(), fine.verdict(), "{}", scenario.name);
        for metric in [Metric::MinDistanceM, Metric::ImpactSpeedMps, Metric::DurationS, Metric::RoadMarginM] {
            let (a, b) = (coarse.get(metric), fine.get(metric));
            println!("{} {}: {a:.3?} at 200 Hz, {b:.3?} at 1 kHz", scenario.name, metric.name());
            let apart = a.zip(b).map_or(0.0, |(a, b)| if a == b { 0.0 } else { (a - b).abs() });
            assert!(
                a.is_some() == b.is_some() && apart < 0.25,
                "{} {}: {a:?} {b:?}",
                scenario.name,
                metric.name()
            );
        }
    }
}

#[test]
fn braking_driver_gets_the_expected_result_in_every_scenario() {
    let mut broken = Vec::new();
    for scenario in shipped() {
        for seed in 0..3 {
            let figures = run(&scenario, seed, 200);
            println!(
                "{} seed {seed}: {} ({:?} at {}), nearest {:.2} m, hit {:?}, margin {:.2} m",
                scenario.name,
                figures.verdict(),
                figures.end.ended,
                figures.end.stamp,
                figures.min_distance_m,
                figures.first_hit,
                figures.road_margin_m
            );
            let expectation = scenario.expectation("a driver").unwrap();
            for what in expectation.broken_by(figures.verdict(), |metric| figures.get(metric)) {
                broken.push(format!("{} seed {seed}: {what}", scenario.name));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
