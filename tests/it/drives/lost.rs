//! A car that loses its position: from the last fix to the standstill.

use swerve_core::{Span, Time};
use swerve_eval::{Milestone, Verdict};
use swerve_log::Log;
use swerve_msg::{Command, GateMode, GateOutput, PoseMode, PoseQuality, StopCause};
use swerve_stack::Registry;
use swerve_why::Logged;

use crate::common;

const ROAD: &str = r#"name = "road"

[road]
segments = [{ length_m = 220.0 }]
lane_width_m = 4.0

[ego]
target_speed_mps = 8.0
end_m = 180.0

[end]
timeout_s = 16.0
"#;

/// A receiver with corrections; without fixes the position soon becomes too uncertain.
const CAR: [&str; 5] = [
    "gate.enabled=true",
    "localization.localizer=eskf",
    "sensing.gnss={ noise_m = 0.02, bias_m = 0 }",
    "sensing.imu={ accel_noise_mps2 = 0.05, accel_bias_mps2 = 0.02, gyro_noise_radps = 0.002, gyro_bias_radps = 0.0005 }",
    "operator.localizer.params={ lost_sigma_m = 0.15 }",
];

/// Ways in which fixes cease.
const SILENCES: [&str; 2] = [
    "sensing.gnss.outages=[{ from_m = [40, 0], to_m = [300, 0], radius_m = 20 }]",
    "fault.f={ stream = \"gnss\", drop = true, from_ms = 3000 }",
];

#[test]
fn lost_car_is_stopped_by_its_gate() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["road.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, ROAD).unwrap();
    for silence in SILENCES {
        let outcome = common::record(&common::config(&[&CAR[..], &[silence]].concat()), &road, &path, 1);
        let log = Log::read(&path).unwrap();
        // The pose is published until it is unknown.
        let modes = log.publications("localizer.quality").map(|p| p.decode::<PoseQuality>().unwrap());
        let modes: Vec<_> = modes.map(|quality| (quality.stamp, quality.mode)).collect();
        // A localizer that restarts at its second fix is lost for a moment: the loss meant here follows coasting.
        let is_loss =
            |pair: &&[(Time, PoseMode)]| pair[0].1 == PoseMode::Coasting && pair[1].1 == PoseMode::Lost;
        let (known, mode) = modes.windows(2).find(is_loss).expect("it is lost")[0];
        assert!(mode == PoseMode::Coasting && known > Time::from_ms(4000), "{silence}: {known:?}");
        let told: Vec<Time> = log.publications("localizer.state").map(|p| p.header.stamp).collect();
        let lost = modes.iter().filter(|(_, mode)| *mode == PoseMode::Lost);
        assert!(
            lost.clone().count() > 10 && lost.clone().all(|(stamp, _)| !told.contains(stamp)),
            "{silence}"
        );
        // The gate stops the car 0.15 s after the last pose; the wheels report standstill.
        let gate =
            log.publications("gate").map(|p| (p.header.visible_at, p.decode::<GateOutput>().unwrap().mode));
        let gate: Vec<_> = gate.collect();
        let stopping = GateMode::Stopping(StopCause::PoseLost);
        let (stops, _) = *gate.iter().find(|(_, mode)| *mode == stopping).expect("it stops");
        let waited = stops - known;
        assert!(waited > Span::from_ms(150) && waited <= Span::from_ms(180), "{silence}: {waited:?}");
        assert_eq!(gate.last().unwrap().1, GateMode::Holding(StopCause::PoseLost), "{silence}");
        assert_eq!(outcome.metrics.verdict, Verdict::Stopped, "{silence}");
        assert!(outcome.metrics.drive.speed_end_mps.abs() < 0.01, "{silence}");
        let why = Logged::read(&path, &Registry::standard(), None).unwrap().why(&outcome.metrics).unwrap();
        let told = format!("the safety gate stopped it from {:.2} s on (the pose is lost", stops.as_secs());
        assert!(why.verdict == Verdict::Stopped && why.sentence.contains(&told), "{}", why.sentence);
        let steps: Vec<Milestone> = why.steps.iter().map(|step| step.what).collect();
        assert_eq!(steps, [Milestone::GateStop, Milestone::Effect, Milestone::Standstill], "{silence}");
    }
}

/// Without a gate the controller reacts: it brakes 0.3 s after the newest pose, and releases the throttle. Otherwise a
/// constant speed would let the integral of the speed control wind up.
#[test]
fn car_without_a_pose_is_braked_by_its_controller() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["road.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, ROAD).unwrap();
    let dropped = ["fault.f={ stream = \"pose\", drop = true, from_ms = 5000 }"];
    let lost = [&CAR[1..], &SILENCES[1..]].concat();
    for (settings, pose) in [(&dropped[..], "f.message"), (&lost[..], "localizer.state")] {
        for law in ["pid", "pure_pursuit", "stanley", "mpc"] {
            let law = format!("control.controller={law}");
            let settings = [settings, &[law.as_str()]].concat();
            let outcome = common::record(&common::config(&settings), &road, &path, 1);
            let log = Log::read(&path).unwrap();
            let last = log.publications(pose).map(|p| p.header.stamp).last().unwrap();
            assert!(last < Time::from_ms(15_000), "{settings:?}: {last:?}");
            let commands = log.publications("controller");
            let commands: Vec<(Time, Command)> = commands
                .filter(|p| p.header.stamp > last + Span::from_ms(310))
                .map(|p| (p.header.stamp, p.decode().unwrap()))
                .collect();
            assert!(commands.len() > 100 && commands.iter().all(|(_, c)| c.throttle == 0.0 && c.brake > 0.0));
            assert!(outcome.metrics.drive.speed_end_mps.abs() < 0.01, "{settings:?}");
            assert!(outcome.metrics.left_road_at_s.is_none(), "{settings:?}");
            assert_eq!(outcome.metrics.verdict, Verdict::Stopped, "{settings:?}");
            let why =
                Logged::read(&path, &Registry::standard(), None).unwrap().why(&outcome.metrics).unwrap();
            let told = format!("it had no pose: none came from {:.2} s on", last.as_secs());
            assert!(why.sentence.contains(&told), "{}", why.sentence);
        }
    }
}

/// A pose that repeats its content under new stamps while the car moves counts as missing.
#[test]
fn car_with_a_frozen_pose_is_braked_by_its_controller() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["road.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, ROAD).unwrap();
    let frozen = "fault.f={ stream = \"pose\", freeze_ms = 60000, from_ms = 5000, until_ms = 5005 }";
    let outcome = common::record(&common::config(&[frozen]), &road, &path, 1);
    assert_eq!(outcome.metrics.verdict, Verdict::Stopped);
    assert!(outcome.metrics.drive.speed_end_mps.abs() < 0.01);
    let why = Logged::read(&path, &Registry::standard(), None).unwrap().why(&outcome.metrics).unwrap();
    assert!(why.sentence.contains("it had no pose: none came from 5.0"), "{}", why.sentence);
}

/// A bend of 3.5 m wide lanes: radius 167 m at 18 m/s, where tyres slip and braking turns the car further in.
const BEND: &str = r#"name = "bend"

[road]
segments = [{ length_m = 60.0 }, { length_m = 250.0, curvature_1pm = 0.006 }, { length_m = 60.0 }]
lane_width_m = 3.5

[ego]
target_speed_mps = 20.0
end_m = 330.0

[end]
timeout_s = 25.0
"#;

/// Without a pose a bend is followed by dead reckoning. When the pose returns, the car continues to brake and limits
/// its steering rate to comfort until there is a plan from its position.
#[test]
fn pose_lost_in_a_bend_returns_without_a_jerk() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["bend.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, BEND).unwrap();
    let ways = [
        ("drop = true", 60_000, Verdict::Stopped),
        ("drop = true", 2_000, Verdict::Completed),
        ("freeze_ms = 2000", 10, Verdict::Completed),
    ];
    // At the entry of the bend, in it, and before its end.
    for (from_ms, (what, lasts_ms, verdict)) in
        [3000, 5500, 9000].iter().flat_map(|at| ways.map(|way| (at, way)))
    {
        let until_ms = from_ms + lasts_ms;
        let fault =
            format!("fault.f={{ stream = \"pose\", {what}, from_ms = {from_ms}, until_ms = {until_ms} }}");
        let metrics = common::record(&common::config(&[&fault]), &road, &path, 1).metrics;
        assert_eq!((metrics.verdict, metrics.left_road_at_s), (verdict, None), "{fault}");
        let log = Log::read(&path).unwrap();
        let commands =
            log.publications("controller").map(|p| (p.header.stamp, p.decode::<Command>().unwrap()));
        let commands: Vec<_> = commands.collect();
        let blind = Time::from_ms(from_ms + 320)..Time::from_ms(from_ms + 2000);
        for pair in commands.windows(2) {
            let [(_, before), (at, now)] = [pair[0], pair[1]];
            assert!(!blind.contains(&at) || now.throttle == 0.0, "{fault}: {at:?} {now:?}");
            // From its return on.
            let turned_rad = (now.steering_rad - before.steering_rad).abs();
            assert!(at < blind.end || turned_rad < 0.005, "{fault}: {at:?} {turned_rad} rad");
        }
    }
}
