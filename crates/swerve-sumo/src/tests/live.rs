//! SUMO itself, where it is installed: `SUMO_HOME`, or `sumo` on `PATH`.

use std::path::{Path, PathBuf};

use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_tests::{data_or_skip, skipped};
use swerve_world::{Other, Others};

use super::{ego, settings};
use crate::{Environment, LightProgram, Sumo};

/// True if SUMO is there; else the test is counted as skipped.
fn has_sumo() -> bool {
    let program = Environment::of_process().program();
    if let Err(missing) = &program {
        skipped(&missing.to_string());
    }
    program.is_ok()
}

/// A configuration of the crossing with IDM cars.
fn cross(folder: &Path) -> Option<PathBuf> {
    let made = data_or_skip("worlds/sumo/made")?;
    let config = folder.join("cross.sumocfg");
    let text = format!(
        "<configuration><net-file value=\"{0}/cross.net.xml\"/><route-files value=\"{0}/cross.rou.xml\"/></configuration>",
        made.display()
    );
    std::fs::write(&config, text).unwrap();
    Some(config)
}

/// Vehicles at each step of 5 ms while the ego stands on the lane from the west.
fn stand(config: &Path, x_m: f64, steps: i64) -> Vec<Vec<Other>> {
    let start = Pose2::new(x_m, -4.8, 0.0);
    let mut sumo = Sumo::new(settings(config, &[start, Pose2::new(150.0, -4.8, 0.0)]));
    let (truth, outline) = ego(start, 0.0);
    (0..steps).map(|k| sumo.at(Time::from_ms(5 * k), &truth, &outline).unwrap().to_vec()).collect()
}

#[test]
fn vehicles_come_and_go_continuously_and_none_drives_into_the_ego() {
    let folder = tempfile::tempdir().unwrap();
    let Some(config) = cross(folder.path()).filter(|_| has_sumo()) else { return };
    let states = stand(&config, -60.0, 6_000);
    let (_, outline) = ego(Pose2::new(-60.0, -4.8, 0.0), 0.0);
    let mut seen = std::collections::BTreeSet::new();
    let mut nearest_m = f64::INFINITY;
    for two in states.windows(2) {
        for other in &two[1] {
            seen.insert(other.id);
            nearest_m = nearest_m.min(outline.distance(&other.extent.footprint(other.movement.pose)));
            let before = two[0].iter().find(|before| before.id == other.id);
            let way_m = before
                .map_or(0.0, |before| before.movement.pose.point().distance(other.movement.pose.point()));
            assert!(way_m < 0.2, "{other:?} moved by {way_m} m in 5 ms");
        }
    }
    println!("{} vehicles, at least {nearest_m:.2} m from the ego", seen.len());
    assert!(seen.len() > 15 && nearest_m > 0.3, "{} vehicles, {nearest_m} m", seen.len());
    assert_eq!(states, stand(&config, -60.0, 6_000));
}

#[test]
fn errors_of_sumo_itself_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let Some(config) = cross(folder.path()).filter(|_| has_sumo()) else { return };
    let start = Pose2::new(-60.0, -4.8, 0.0);
    let (truth, outline) = ego(start, 0.0);
    let text = std::fs::read_to_string(&config).unwrap();
    let routes = folder.path().join("twice.rou.xml");
    let one = "<vehicle id=\"x\" depart=\"5\"><route edges=\"WC CE\"/></vehicle>";
    std::fs::write(&routes, format!("<routes>{one}{one}</routes>")).unwrap();
    let routes =
        text.replace("<route-files value=\"", &format!("<route-files value=\"{},", routes.display()));
    std::fs::write(&config, routes).unwrap();
    let mut sumo = Sumo::new(settings(&config, &[start]));
    let error = sumo.at(Time::ZERO, &truth, &outline).unwrap_err().0;
    assert!(error.contains("cross.sumocfg: at 0 s") && error.contains("'x'"), "{error}");
    let far = Pose2::new(5_000.0, 0.0, 0.0);
    std::fs::write(&config, text).unwrap();
    let mut sumo = Sumo::new(settings(&config, &[far]));
    let error = sumo.at(Time::ZERO, &truth, &outline).unwrap_err().0;
    assert!(error.contains("from the nearest lane") && error.contains("world.offset_m"), "{error}");
}

/// Static programs of the net are those that SUMO runs; programs that differ are followed within a step.
#[test]
fn lights_of_sumo_show_the_phases_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let Some(config) = cross(folder.path()).filter(|_| has_sumo()) else { return };
    let net = data_or_skip("worlds/sumo/made/cross.net.xml").unwrap();
    let net = swerve_map_io::sumo::read("cross", &std::fs::read_to_string(net).unwrap()).unwrap();
    let start = Pose2::new(-60.0, -4.8, 0.0);
    let (truth, outline) = ego(start, 0.0);
    let corrections = |later_s: f64| {
        let mut settings = settings(&config, &[start]);
        for signal in net.lanes.map.signals() {
            let (light, link) = signal.name.rsplit_once(':').unwrap();
            let mut program = signal.program.clone().unwrap();
            program.offset_s += settings.begin_s + settings.warmup_s + later_s;
            let (light, link) = (light.to_owned(), link.parse().unwrap());
            settings.lights.push(LightProgram { light, link, program, gives_way: false });
        }
        let mut sumo = Sumo::new(settings);
        let mut counts = Vec::new();
        for k in 0..1_200 {
            sumo.at(Time::from_ms(100 * k), &truth, &outline).unwrap();
            counts.push(sumo.corrections());
        }
        counts
    };
    assert_eq!(corrections(0.0).iter().sum::<usize>(), 0);
    // The light is set at its switches only, as SUMO holds a state that it is given.
    let set = corrections(7.0);
    let phases = net.programs[0].phases.len() * 1_200 / 10 / 90 + 4;
    println!("{} commands", set.iter().sum::<usize>());
    assert!((2..=2 * phases).contains(&set.iter().sum::<usize>()), "{set:?}");
    assert!(set.array_windows().all(|[a, b]| *a == 0 || *b == 0), "{set:?}");
}
