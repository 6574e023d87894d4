//! A lead car that brakes to a stop, in the whole closed loop: every planner, speeds of 5 to 30 m/s, braking of 1 to 8 m/s²,
//! time gaps of 0.8 to 3 s, twenty seeds each. Every row counts collisions that physics does not excuse, and says by how much
//! the hardest braking exceeds the least that suffices. `-- 3` drives three seeds.

use swerve_benches::{Goal, Rows, Sample, asked, is_asked_to_measure, on_all_cores};
use swerve_drive::{drive, problems_error};
use swerve_scenario::Scenario;
use swerve_stack::config::Config;

const PLANNERS: [&str; 4] = ["fot", "rrt_star", "hybrid_astar", "waypoint"];
const SPEEDS_MPS: [f64; 6] = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0];
const BRAKES_MPS2: [f64; 5] = [1.0, 2.0, 4.0, 6.0, 8.0];
const GAPS_S: [f64; 3] = [0.8, 1.5, 3.0];
const SEEDS: u64 = 20;

/// From the lead's first braking to the ego's, and the time in which its brakes build up, seconds.
const REACTION_S: f64 = 0.5;
/// Asked for between the two at rest, metres.
const STANDSTILL_M: f64 = 2.0;
/// From the middle of the lead to its rear and from the ego's reference point to its front, metres.
const BODIES_M: f64 = 4.7;
/// What a dry road gives, m/s².
const GRIP_MPS2: f64 = 8.5;
/// Braking for comfort when the gap is opened again, m/s².
const COMFORT_MPS2: f64 = 1.0;
/// Allowed above the least that suffices, m/s².
const ALLOWANCE_MPS2: f64 = 1.0;

/// One lead car: its speed, how hard it brakes, and how far ahead it is.
#[derive(Clone, Copy)]
struct Lead {
    speed_mps: f64,
    brake_mps2: f64,
    gap_m: f64,
}

impl Lead {
    /// The scenario: the lead keeps its speed for 2 s, then brakes to a stop, on a road without a second lane.
    fn scenario(self) -> anyhow::Result<Scenario> {
        let Self { speed_mps, brake_mps2, gap_m } = self;
        let stop_s = 2.0 + speed_mps / brake_mps2;
        let way_m = speed_mps * 2.0 + speed_mps * speed_mps / (2.0 * brake_mps2);
        let end_m = gap_m + way_m + 200.0;
        let text = format!(
            "name = 'following'
            road.segments = [{{ length_m = {} }}]
            road.lane_width_m = 3.6
            ego = {{ target_speed_mps = {speed_mps:?}, end_m = {end_m} }}
            end = {{ timeout_s = {}, standstill = {{ near = 'lead', within_m = 20.0, for_s = 2.0 }} }}
            [[actor]]
            name = 'lead'
            kind = 'car'
            s_m = {:?}
            d_m = 0.0
            motion = [{{ drive = {{ along = 'road', speeds = [[0.0, {speed_mps:?}], [2.0, {speed_mps:?}], [{stop_s:?}, 0.0]] }} }}]
            ",
            end_m + 100.0,
            stop_s + 40.0,
            gap_m + BODIES_M,
        );
        Scenario::parse("following", &text).map_err(|problems| problems_error(&problems))
    }

    /// The least constant deceleration from the reaction on that leaves `rest_m` to the lead, m/s².
    fn least_mps2(self, rest_m: f64) -> f64 {
        // Way since the lead's first braking of a car that brakes from `from_s` on, metres.
        let way_m = |brake_mps2: f64, from_s: f64, t_s: f64| {
            let braking_s = (t_s - from_s).clamp(0.0, self.speed_mps / brake_mps2);
            self.speed_mps * (t_s.min(from_s) + braking_s) - 0.5 * brake_mps2 * braking_s * braking_s
        };
        let keeps = |own_mps2: f64| {
            (0..6000).map(|k| 0.01 * f64::from(k)).all(|t_s| {
                let lead_m = way_m(self.brake_mps2, 0.0, t_s);
                self.gap_m + lead_m - way_m(own_mps2, REACTION_S, t_s) >= rest_m
            })
        };
        (1..1000).map(|k| 0.02 * f64::from(k)).find(|own_mps2| keeps(*own_mps2)).unwrap_or(f64::INFINITY)
    }
}

/// What a drive came to.
struct Drive {
    collides: bool,
    /// Bumper to bumper, least, metres.
    gap_m: f64,
    brake_mps2: f64,
}

fn driven(config: &Config, scenario: &Scenario) -> anyhow::Result<Drive> {
    let metrics = drive(config, scenario)?.metrics;
    Ok(Drive {
        collides: metrics.impact.is_some(),
        gap_m: metrics.min_distance_m.unwrap_or(f64::INFINITY),
        brake_mps2: metrics.drive.deceleration_max_mps2,
    })
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let seeds = asked().find_map(|word| word.parse().ok()).unwrap_or(SEEDS);
    let mut leads = Vec::new();
    for speed_mps in SPEEDS_MPS {
        for (brake_mps2, gap_s) in BRAKES_MPS2.iter().flat_map(|b| GAPS_S.map(|gap_s| (*b, gap_s))) {
            let lead = Lead { speed_mps, brake_mps2, gap_m: gap_s * speed_mps };
            leads.push((lead, lead.scenario()?));
        }
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "following");
    for planner in PLANNERS {
        let set = [swerve_text::parse_assignment(&format!("planning.planner={planner}"))?];
        let config = Config::load(None, &set).map_err(|problems| problems_error(&problems))?;
        let drives = on_all_cores(leads.len() * seeds as usize, |k| -> anyhow::Result<_> {
            let (lead, scenario) = &leads[k / seeds as usize];
            let config = Config { seed: 1 + k as u64 % seeds, ..config.clone() };
            Ok((*lead, driven(&config, scenario)?))
        })?;
        for speed_mps in SPEEDS_MPS {
            let of: Vec<_> = drives.iter().filter(|(lead, _)| lead.speed_mps == speed_mps).collect();
            let avoidable = |lead: &Lead| lead.least_mps2(0.0) < GRIP_MPS2;
            let hit = of.iter().filter(|(lead, drive)| drive.collides && avoidable(lead)).count();
            let excused = of.iter().filter(|(lead, drive)| drive.collides && !avoidable(lead)).count();
            let what = format!("{planner}, {speed_mps} m/s: avoidable collisions of {}", of.len());
            rows.row(&what, hit as f64, &format!("{hit} ({excused} unavoidable)"), Goal::Most(0.0));
            let excess = of.iter().filter(|(_, drive)| !drive.collides).map(|(lead, drive)| {
                drive.brake_mps2 - lead.least_mps2(STANDSTILL_M).clamp(COMFORT_MPS2, GRIP_MPS2)
            });
            let excess = Sample::new(excess.collect());
            let what = format!("{planner}, {speed_mps} m/s: braking above the least that suffices, m/s2");
            rows.row(&what, excess.at(1.0), &excess.text(2, "m/s2"), Goal::Most(ALLOWANCE_MPS2));
            let least = Sample::new(of.iter().map(|(_, drive)| drive.gap_m).collect());
            rows.row(
                &format!("{planner}, {speed_mps} m/s: least gap"),
                least.least(),
                &least.text(2, "m"),
                Goal::None,
            );
        }
    }
    rows.finish();
    Ok(())
}
