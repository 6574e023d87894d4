//! The world of a scenario, where another simulator moves its road users.

use std::path::Path;

use swerve_text::{Range, TableReader};

use super::DURATION;
use crate::SumoWorld;

/// Times of the other simulator, seconds.
const TIME: Range = Range::between(0.0, 1e8);
/// Its steps, seconds.
const STEP: Range = Range::between(0.001, 1.0);
/// Offsets of coordinates, metres.
const OFFSET: Range = Range::between(-1e7, 1e7);

/// Reads the table `[world]`.
pub(super) fn read(top: &TableReader<'_>) -> Option<SumoWorld> {
    let table = top.table_if_any("world")?;
    let config = table.text("sumo");
    let folder = Path::new(top.reading().file()).parent().unwrap_or(Path::new(""));
    let world = SumoWorld {
        config: folder.join(config),
        begin_s: table.number_or("begin_s", 0.0, TIME),
        warmup_s: table.number_or("warmup_s", SumoWorld::WARMUP_S, Range::between(0.0, 86_400.0)),
        step_s: table.number_or("step_s", SumoWorld::STEP_S, STEP),
        range_m: table.number_or("range_m", SumoWorld::RANGE_M, Range::between(10.0, 2_000.0)),
        timeout_s: table.number_or("timeout_s", SumoWorld::TIMEOUT_S, DURATION),
        offset_m: ["offset_x_m", "offset_y_m"].map(|key| table.number_or(key, 0.0, OFFSET)),
    };
    if !top.has("map") {
        table.report_whole("expected a scenario on a `[map]`");
    }
    if top.has("traffic") {
        table.report("sumo", "expected only one of `traffic` and `world.sumo`");
    }
    table.finish();
    Some(world)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MapText, Scenario};

    fn parse(world: &str) -> Result<Scenario, String> {
        let map = include_str!("../../../swerve-map-io/maps/junction.net.xml");
        let text = format!(
            "name = \"way\"\n[map]\nfile = \"junction.net.xml\"\n[ego]\nstart = {{ lane = \"in_2\", s_m = 10.0 }}\n\
             goal = {{ lane = \"out_0\", s_m = 30.0 }}\ntarget_speed_mps = 2.0\n{world}"
        );
        let map = MapText::from(map);
        Scenario::parse_on("town/x.toml", &text, Some(&map), &[]).map_err(|problems| problems.to_string())
    }

    #[test]
    fn world_is_relative_to_the_scenario_and_has_defaults() {
        assert_eq!(parse("").unwrap().sumo, None);
        let world = parse("[world]\nsumo = \"a/t.sumocfg\"\nbegin_s = 25200.0\n").unwrap().sumo.unwrap();
        assert_eq!(world.config, Path::new("town/a/t.sumocfg"));
        assert_eq!((world.begin_s, world.warmup_s, world.step_s), (25_200.0, 60.0, 0.1));
        assert_eq!((world.range_m, world.offset_m), (150.0, [0.0; 2]));
    }

    #[test]
    fn lights_begin_with_the_phase_of_the_other_simulator() {
        let plain = parse("").unwrap().road.lights;
        let later =
            parse("[world]\nsumo = \"t.sumocfg\"\nbegin_s = 7.0\nwarmup_s = 4.0\n").unwrap().road.lights;
        assert!(!plain.is_empty());
        for (plain, later) in plain.iter().zip(&later) {
            let offsets_s = [plain, later].map(|light| light.program.offset_s);
            assert_eq!(offsets_s[1] - offsets_s[0], 11.0, "{}", plain.name);
        }
    }

    #[test]
    fn worlds_that_make_no_sense_are_refused() {
        for (world, expected) in [
            ("[world]\n", "world.sumo: is missing"),
            ("[world]\nsumo = \"t\"\nstep_s = 0.0\n", "world.step_s"),
            ("[world]\nsumo = \"t\"\nrange_m = nan\n", "world.range_m"),
            ("[world]\nsumo = \"t\"\nstep = 1.0\n", "unknown key"),
            ("[traffic]\nvehicles = 2\n[world]\nsumo = \"t\"\n", "only one of `traffic` and `world.sumo`"),
        ] {
            let error = parse(world).unwrap_err();
            assert!(error.contains(expected) && error.contains("town/x.toml"), "{world}: {error}");
        }
        let text = "name = \"x\"\nroad = { segments = [{ length_m = 90.0 }] }\nego = { s_m = 1.0, target_speed_mps = 1.0, \
                    end_m = 9.0 }\n[world]\nsumo = \"t\"\n";
        let error = Scenario::parse("x.toml", text).unwrap_err().to_string();
        assert!(error.contains("expected a scenario on a `[map]`"), "{error}");
    }
}
