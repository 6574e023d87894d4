//! A lead car that brakes to a stop, in the closed loop: every planner, speeds of 5 to 30 m/s, braking of 1 to 8 m/s²,
//! time gaps of 0.8 to 3 s, twenty seeds each. Every row counts avoidable collisions, and states by how much the
//! hardest braking exceeds the necessary minimum. `-- 3` drives three seeds.

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use swerve_benches::{Goal, Rows, Sample, asked_number, is_asked_to_measure};
use swerve_drive::{drive, problems_error};
use swerve_planning::testing::least_braking_mps2;
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::Config;

const PLANNERS: [&str; 4] = ["fot", "rrt_star", "hybrid_astar", "waypoint"];
const SPEEDS_MPS: [f64; 6] = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0];
const BRAKES_MPS2: [f64; 5] = [1.0, 2.0, 4.0, 6.0, 8.0];
const GAPS_S: [f64; 3] = [0.8, 1.5, 3.0];
const SEEDS: u64 = 20;

/// Time from the lead's first braking to the ego's, and brake build-up time, seconds.
const REACTION_S: f64 = 0.5;
/// Required gap at standstill, metres.
const STANDSTILL_M: f64 = 2.0;
/// Distance from the centre of the lead to its rear plus that from the ego's reference point to its front, metres.
const BODIES_M: f64 = 4.7;
/// Largest deceleration on a dry road, m/s².
const GRIP_MPS2: f64 = 8.5;
/// Comfortable braking while the gap is reopened, m/s².
const COMFORT_MPS2: f64 = 1.0;
/// Allowed excess over the necessary minimum, m/s².
const ALLOWANCE_MPS2: f64 = 1.0;

/// A lead car: speed, braking and distance ahead.
#[derive(Clone, Copy)]
struct Lead {
    speed_mps: f64,
    brake_mps2: f64,
    gap_m: f64,
}

impl Lead {
    /// Scenario in which the lead keeps its speed for 2 s, then brakes to a stop, on a road without a second lane.
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

    /// Minimum deceleration that leaves a gap of `rest_m` to the lead, m/s².
    fn least_mps2(self, rest_m: f64) -> f64 {
        least_braking_mps2(self.speed_mps, self.brake_mps2, self.gap_m, REACTION_S, rest_m)
    }
}

/// Scenario of a lead, with the decelerations that leave the standstill gap and a gap of zero, m/s².
struct Behind {
    lead: Lead,
    scenario: Scenario,
    suffices_mps2: f64,
    touches_mps2: f64,
}

impl Behind {
    fn new(lead: Lead) -> anyhow::Result<Self> {
        let [suffices_mps2, touches_mps2] = [STANDSTILL_M, 0.0].map(|rest_m| lead.least_mps2(rest_m));
        Ok(Self { lead, scenario: lead.scenario()?, suffices_mps2, touches_mps2 })
    }
}

/// Result of a drive behind a lead.
struct Drive<'a> {
    behind: &'a Behind,
    collides: bool,
    /// Minimum bumper-to-bumper gap, metres.
    gap_m: f64,
    brake_mps2: f64,
}

fn driven<'a>(config: &Setup, behind: &'a Behind) -> anyhow::Result<Drive<'a>> {
    let metrics = drive(config, &behind.scenario)?.metrics;
    Ok(Drive {
        behind,
        collides: metrics.impact.is_some(),
        gap_m: metrics.min_distance_m.unwrap_or(f64::INFINITY),
        brake_mps2: metrics.drive.deceleration_max_mps2,
    })
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let seeds = asked_number(SEEDS);
    let mut leads = Vec::new();
    for speed_mps in SPEEDS_MPS {
        for (brake_mps2, gap_s) in BRAKES_MPS2.iter().flat_map(|b| GAPS_S.map(|gap_s| (*b, gap_s))) {
            leads.push(Behind::new(Lead { speed_mps, brake_mps2, gap_m: gap_s * speed_mps })?);
        }
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "following");
    for planner in PLANNERS {
        let set = [swerve_text::parse_assignment(&format!("planning.planner={planner}"))?];
        let config = Setup::load(None, &set).map_err(|problems| problems_error(&problems))?;
        let cases: Vec<_> =
            leads.iter().flat_map(|behind| (1..=seeds).map(move |seed| (behind, seed))).collect();
        let drives = cases
            .into_par_iter()
            .map(|(behind, seed)| driven(&Setup::from(Config { seed, ..config.config.clone() }), behind))
            .collect::<anyhow::Result<Vec<_>>>()?;
        for speed_mps in SPEEDS_MPS {
            let of: Vec<_> = drives.iter().filter(|drive| drive.behind.lead.speed_mps == speed_mps).collect();
            let hits = || of.iter().filter(|drive| drive.collides);
            let hit = hits().filter(|drive| drive.behind.touches_mps2 < GRIP_MPS2).count();
            let excused = hits().count() - hit;
            let what = format!("{planner}, {speed_mps} m/s: avoidable collisions of {}", of.len());
            rows.row(&what, hit as f64, &format!("{hit} ({excused} unavoidable)"), Goal::Most(0.0));
            let excess = of
                .iter()
                .filter(|drive| !drive.collides)
                .map(|drive| drive.brake_mps2 - drive.behind.suffices_mps2.clamp(COMFORT_MPS2, GRIP_MPS2));
            let excess = Sample::new(excess.collect());
            let what = format!("{planner}, {speed_mps} m/s: braking above the least that suffices, m/s2");
            rows.row(&what, excess.at(1.0), &excess.text(2, "m/s2"), Goal::Most(ALLOWANCE_MPS2));
            let gap = Sample::new(of.iter().map(|drive| drive.gap_m).collect());
            let what = format!("{planner}, {speed_mps} m/s: least gap");
            rows.row(&what, gap.least(), &gap.text(2, "m"), Goal::None);
        }
    }
    rows.finish();
    Ok(())
}
