//! Comfort of drives with and without the comfortable layer: for the ten scenarios and four planners, medians over
//! twenty seeds. The table is Markdown, as in docs/comfort.md. `-- 3` drives three seeds.

use std::path::Path;

use rayon::iter::{IntoParallelIterator, ParallelIterator};
use swerve_benches::{Sample, asked_number, is_asked_to_measure, print};
use swerve_drive::{drive, problems_error, read_scenario};
use swerve_eval::Metrics;
use swerve_stack::Setup;
use swerve_stack::config::Config;

const SCENARIOS: [&str; 10] = [
    "lane",
    "street",
    "traffic_jam",
    "traffic_light",
    "car_behind_truck",
    "car_from_alley",
    "people_crossing",
    "person_behind_parked_car",
    "person_behind_truck",
    "person_crossing",
];
const PLANNERS: [&str; 4] = ["fot", "rrt_star", "hybrid_astar", "waypoint"];
const SEEDS: u64 = 20;

/// Medians of lateral acceleration, braking, lateral jerk and share of the time within nuPlan's limits, and the number
/// of collisions.
fn cell(drives: &[Metrics]) -> String {
    let median = |figure: fn(&Metrics) -> f64| Sample::new(drives.iter().map(figure).collect()).median();
    let across = median(|drive| drive.drive.lateral_accel_max_mps2);
    let braking = median(|drive| drive.drive.deceleration_max_mps2);
    let jerk = median(|drive| drive.lateral_jerk.raw_max_mps3.unwrap_or(0.0));
    let within = median(|drive| drive.comfort.as_ref().map_or(0.0, |comfort| comfort.share_within));
    let hits = drives.iter().filter(|drive| drive.impact.is_some()).count();
    let hits = if hits == 0 { String::new() } else { format!(" (hit: {hits})") };
    format!("{across:.1}, {braking:.1}, {jerk:.0}, {:.0} %{hits}", 100.0 * within)
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let seeds = asked_number(SEEDS);
    print(&format!("| | {} |\n|{}", PLANNERS.map(|p| format!("`{p}`")).join(" | "), "---|".repeat(5)));
    for name in SCENARIOS {
        let file = format!("{}/../scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let scenario = read_scenario(Path::new(&file))?;
        for (layer, head) in [(false, format!("`{name}`, without")), (true, "with".to_owned())] {
            let mut row = format!("| {head} |");
            for planner in PLANNERS {
                let set =
                    [format!("planning.planner={planner}"), format!("planning.comfort.enabled={layer}")];
                let set: Vec<_> =
                    set.iter().map(|one| swerve_text::parse_assignment(one)).collect::<Result<_, _>>()?;
                let config = Setup::load(None, &set).map_err(|problems| problems_error(&problems))?;
                let drive = |seed| drive(&Setup::from(Config { seed, ..config.config.clone() }), &scenario);
                let drives = (1..=seeds).into_par_iter().map(|seed| Ok(drive(seed)?.metrics));
                let drives = drives.collect::<anyhow::Result<Vec<_>>>()?;
                row += &format!(" {} |", cell(&drives));
            }
            print(&row);
        }
    }
    Ok(())
}
