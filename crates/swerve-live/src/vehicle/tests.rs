//! Tests of the vehicle interfaces.

use swerve_core::Span;
use swerve_msg::{GateMode, MotionCommand, StopCause};
use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, Qos, Side, TopicMap};
use swerve_ros2::msg::carla_msgs::CarlaEgoVehicleStatus;
use swerve_ros2::msg::{autoware_vehicle_msgs, ds_dbw_msgs, raptor_dbw_msgs};
use swerve_stack::Setup;

use super::*;

/// Maximum length of an interface stated on the page about new vehicles, including imports and comments.
const LINES_MAX: usize = 100;

#[test]
fn interface_fits_the_documented_length() {
    let page = include_str!("../../../../docs/howto/vehicle.md");
    assert!(page.contains(&format!("at most {LINES_MAX} lines of Rust")));
    for (name, text) in [
        ("autoware", include_str!("autoware.rs")),
        ("carla", include_str!("carla.rs")),
        ("dataspeed", include_str!("dataspeed.rs")),
        ("plain", include_str!("plain.rs")),
        ("raptor", include_str!("raptor.rs")),
    ] {
        let lines = text.lines().count();
        assert!(lines <= LINES_MAX, "{name}: {lines} lines");
    }
    // Further lines per vehicle: its name, its topics, and the line that selects it.
    let tables = include_str!("../../../swerve-ros2/src/mapping/tables.rs");
    let own = |text: &str| text.lines().filter(|line| line.to_lowercase().contains("raptor")).count();
    let raptor = include_str!("raptor.rs").lines().count();
    assert!(page.contains(&format!("all {raptor} lines")), "the page shows the {raptor} lines of Raptor's");
    assert!(own(tables) >= 12);
    let all = raptor + own(tables) + own(include_str!("../vehicle.rs"));
    assert!(all <= LINES_MAX, "{all} lines with its topics");
}

fn config(live: &str) -> Setup {
    let text = format!("[live]\nroute = \"r.toml\"\n{live}[control]\ncontroller = \"stanley\"\n");
    let document = swerve_text::Document::parse("c.toml", text).unwrap();
    Setup::from_document(&document, &[]).unwrap()
}

fn gate(accel_mps2: f64) -> GateOutput {
    let command = MotionCommand { stamp: Time::ZERO, steering_rad: 0.1, speed_mps: 5.0, accel_mps2 };
    GateOutput { mode: GateMode::Driving, engaged: true, command, heartbeat: 300, ..GateOutput::default() }
}

/// Messages to a car at 4 m/s.
fn messages(vehicle: &mut dyn VehicleInterface, gate: &GateOutput) -> BTreeMap<Role, AnyMessage> {
    let mut outgoing = Outgoing::new(Time::from_ms(1500), Epoch { ns: 10_000_000_000 }, 4.0);
    vehicle.command(gate, &mut outgoing);
    for (_, message) in &outgoing.messages {
        assert_eq!(message.check(), Ok(()), "{message:?}");
    }
    outgoing.messages.into_iter().collect()
}

#[test]
fn dataspeed_speed_command_is_within_limits() {
    let mut car = interface(Vehicle::Dataspeed, &config(""));
    let ulc = |car: &mut dyn VehicleInterface, accel| match &messages(car, &gate(accel))[&Role::SpeedCommand]
    {
        AnyMessage::DataspeedUlcCmd(cmd) => cmd.clone(),
        other => panic!("{other:?}"),
    };
    let first = ulc(&mut *car, 1.5);
    assert_eq!((first.cmd, first.limit_accel, first.enable, first.clear), (4.75, 1.5, true, true));
    let braking = ulc(&mut *car, -3.0);
    assert_eq!((braking.cmd, braking.limit_decel, braking.clear), (2.5, 3.0, false));
    assert_eq!(ulc(&mut *car, -20.0).cmd, 0.0);
    // A stop is independent of the last reported speed.
    let mut stopping = gate(-1.5);
    (stopping.mode, stopping.command.speed_mps) = (GateMode::Stopping(StopCause::ReportTimeout), 0.0);
    let AnyMessage::DataspeedUlcCmd(stop) = &messages(&mut *car, &stopping)[&Role::SpeedCommand] else {
        panic!("none")
    };
    assert_eq!((stop.cmd, stop.limit_decel), (0.0, 1.5));
    let AnyMessage::DataspeedSteeringCmd(steering) = &messages(&mut *car, &gate(0.0))[&Role::SteeringCommand]
    else {
        panic!("no steering")
    };
    assert!((f64::from(steering.cmd) - 0.1_f64.to_degrees() * 14.8).abs() < 1e-3);
    assert_eq!((steering.header.stamp.sec, steering.header.stamp.nanosec), (11, 500_000_000));
    let manual = GateOutput { mode: GateMode::Manual, engaged: false, ..gate(0.0) };
    let AnyMessage::DataspeedSteeringCmd(steering) = &messages(&mut *car, &manual)[&Role::SteeringCommand]
    else {
        panic!("no steering")
    };
    assert!(!steering.enable && !steering.ignore);
}

#[test]
fn pedals_are_never_applied_together() {
    for (vehicle, live) in [(Vehicle::Dataspeed, "longitudinal = \"pedals\"\n"), (Vehicle::Raptor, "")] {
        let mut car = interface(vehicle, &config(live));
        for (accel, is_brake) in [(1.0, false), (-2.0, true)] {
            let sent = messages(&mut *car, &gate(accel));
            let pedal = |role| match &sent[&role] {
                AnyMessage::DataspeedThrottleCmd(cmd) => cmd.cmd,
                AnyMessage::DataspeedBrakeCmd(cmd) => cmd.cmd,
                AnyMessage::RaptorAcceleratorPedalCmd(cmd) => cmd.pedal_cmd,
                AnyMessage::RaptorBrakeCmd(cmd) => cmd.pedal_cmd,
                other => panic!("{other:?}"),
            };
            let (throttle, brake) = (pedal(Role::ThrottleCommand), pedal(Role::BrakeCommand));
            assert_eq!((throttle > 0.0, brake > 0.0), (!is_brake, is_brake), "{vehicle:?} {accel}");
        }
    }
}

#[test]
fn interfaces_never_accelerate_while_the_gate_stops_or_holds() {
    let cars = [
        (Vehicle::Autoware, ""),
        (Vehicle::Dataspeed, ""),
        (Vehicle::Dataspeed, "longitudinal = \"pedals\"\n"),
        (Vehicle::Raptor, ""),
        (Vehicle::Carla, CARLA_STEERING),
    ];
    let modes = [
        GateMode::Stopping(StopCause::CommandTimeout),
        GateMode::Stopping(StopCause::Emergency),
        GateMode::Holding(StopCause::Released),
    ];
    for (vehicle, live) in cars {
        let mut car = interface(vehicle, &config(live));
        for mode in modes {
            // Outputs that the gate never produces also result in a stop.
            for accel in [-3.0, 2.0] {
                for speed_mps in [0.0, -7.0, 8.0, 90.0, 1e9, f64::NAN] {
                    let output = GateOutput { mode, ..gate(accel) };
                    let mut outgoing = Outgoing::new(Time::from_ms(1500), Epoch { ns: 0 }, speed_mps);
                    car.command(&output, &mut outgoing);
                    let messages = outgoing.messages.iter().map(|(_, message)| message);
                    let brakes = messages.filter(|message| match message {
                        AnyMessage::Control(control) => {
                            let along = &control.longitudinal;
                            assert!(along.velocity == 0.0 && along.acceleration < 0.0, "{along:?}");
                            true
                        }
                        AnyMessage::DataspeedUlcCmd(cmd) => {
                            assert_eq!(cmd.cmd, 0.0, "{speed_mps}");
                            true
                        }
                        AnyMessage::DataspeedThrottleCmd(ds_dbw_msgs::ThrottleCmd { cmd, .. })
                        | AnyMessage::RaptorAcceleratorPedalCmd(raptor_dbw_msgs::AcceleratorPedalCmd {
                            pedal_cmd: cmd,
                            ..
                        }) => {
                            assert_eq!(*cmd, 0.0, "{vehicle:?} {speed_mps}");
                            false
                        }
                        AnyMessage::CarlaEgoVehicleControl(control) => {
                            assert!(control.throttle == 0.0 && control.brake > 0.1, "{control:?}");
                            true
                        }
                        AnyMessage::DataspeedBrakeCmd(ds_dbw_msgs::BrakeCmd { cmd, .. })
                        | AnyMessage::RaptorBrakeCmd(raptor_dbw_msgs::BrakeCmd { pedal_cmd: cmd, .. }) => {
                            assert!(*cmd > 10.0, "{vehicle:?} {speed_mps}");
                            true
                        }
                        _ => false,
                    });
                    assert_eq!(brakes.count(), 1, "{vehicle:?} {mode:?}");
                }
            }
        }
    }
}

const CARLA_STEERING: &str = "steering_ratio = 1.0\nsteering_wheel_max_deg = 70.0\n";

#[test]
fn carla_steers_to_the_right_with_positive_values_and_is_left_alone_until_engaged() {
    let mut car = interface(Vehicle::Carla, &config(CARLA_STEERING));
    let sent = messages(&mut *car, &gate(1.0));
    let AnyMessage::CarlaEgoVehicleControl(control) = &sent[&Role::Command] else { panic!("{sent:?}") };
    // 0.1 rad to the left of at most 70 degrees.
    assert!((f64::from(control.steer) + 0.1_f64.to_degrees() / 70.0).abs() < 1e-6, "{control:?}");
    assert!(control.throttle > 0.05 && control.brake == 0.0, "{control:?}");
    assert_eq!(
        (control.gear, control.reverse, control.hand_brake, control.manual_gear_shift),
        (1, false, false, false)
    );
    assert_eq!((control.header.stamp.sec, control.header.stamp.nanosec), (11, 500_000_000));
    let status = CarlaEgoVehicleStatus { velocity: 7.5, control: control.clone(), ..Default::default() };
    let facts = car.facts(&AnyMessage::CarlaEgoVehicleStatus(status));
    assert_eq!((facts.speed_mps, facts.listens, facts.driver), (Some(7.5), None, None));
    assert!((facts.steering_rad.unwrap() - 0.1).abs() < 1e-6, "{facts:?}");
    let manual = GateOutput { mode: GateMode::Manual, engaged: false, ..gate(1.0) };
    assert!(messages(&mut *car, &manual).is_empty());
    // An angle beyond the largest one.
    let mut full = gate(1.0);
    full.command.steering_rad = -1.5;
    let AnyMessage::CarlaEgoVehicleControl(control) = &messages(&mut *car, &full)[&Role::Command] else {
        panic!("no control")
    };
    assert_eq!(control.steer, 1.0);
}

#[test]
fn ackermann_command_has_each_field_and_is_sent_only_while_engaged() {
    let ackermann = "[ros2.topics.command]\ntopic = \"/drive\"\ntype = \"ackermann_msgs/msg/AckermannDriveStamped\"\n\
                     [ros2.topics.steering]\ntopic = \"/steering\"\n[ros2.topics.enable]\ntopic = \"/enable\"\n";
    for (vehicle, name) in [(Vehicle::Autoware, "autoware"), (Vehicle::Plain, "plain")] {
        let config =
            config(&format!("[ros2]\nvehicle = \"{name}\"\nframes.base_link = \"rear_axle\"\n{ackermann}"));
        let mut car = interface(vehicle, &config);
        let mut output = gate(-1.5);
        output.command.stamp = Time::from_ms(1500);
        let sent = messages(&mut *car, &output);
        let AnyMessage::AckermannDriveStamped(command) = &sent[&Role::Command] else { panic!("{sent:?}") };
        let drive = command.drive;
        assert_eq!((drive.steering_angle, drive.speed, drive.acceleration), (0.1, 5.0, -1.5), "{name}");
        assert_eq!((drive.steering_angle_velocity, drive.jerk), (0.0, 0.0));
        assert_eq!((command.header.stamp.sec, command.header.stamp.nanosec), (11, 500_000_000));
        assert_eq!(command.header.frame_id, "rear_axle");
        // While stopping: zero speed and the brake.
        let stop = GateOutput { mode: GateMode::Stopping(StopCause::Emergency), ..output };
        let sent = messages(&mut *car, &stop);
        let AnyMessage::AckermannDriveStamped(command) = &sent[&Role::Command] else { panic!("{sent:?}") };
        assert!(command.drive.speed == 0.0 && command.drive.acceleration < 0.0, "{command:?}");
        let manual = GateOutput { mode: GateMode::Manual, engaged: false, ..output };
        assert!(!messages(&mut *car, &manual).contains_key(&Role::Command), "{name}");
        assert!(car.needs().contains(&Role::Steering));
    }
    let watched = interface(Vehicle::Plain, &config("[ros2]\nvehicle = \"plain\"\n"));
    assert_eq!(watched.needs(), [Role::Odometry]);
}

/// The tables of the page about topics.
#[test]
fn documented_topics_are_those_of_the_program() {
    let page = include_str!("../../../../docs/howto/vehicle_topics.md");
    for vehicle in [Vehicle::Autoware, Vehicle::Dataspeed, Vehicle::Raptor, Vehicle::Carla, Vehicle::Plain] {
        let name = vehicle.name();
        let mapping = Mapping::of(vehicle, Network::default());
        let needs = interface(vehicle, &config(&format!("[ros2]\nvehicle = \"{name}\"\n")));
        let rows = |topic: &TopicMap| {
            let direction = match topic.role {
                Role::Enable | Role::Disable => "both",
                role if role.side() == Side::Vehicle => "to Swerve",
                _ => "from Swerve",
            };
            let code = |text: &str| if text.is_empty() { "-".to_owned() } else { format!("`{text}`") };
            let (kind, rate_hz) = (topic.kind, topic.rate_max_hz.unwrap_or_default());
            let kind = format!("{}/{}", kind.package(), kind.name());
            [code(&topic.name), code(&topic.topic), direction.into(), code(&kind), code(&topic.frame)]
                .into_iter()
                .chain([rate_hz.to_string(), qos_words(topic.qos)])
                .collect::<Vec<String>>()
        };
        let section = page.split(&format!("\n## `{name}`\n")).nth(1).unwrap_or_else(|| panic!("{name}"));
        let section = section.split("\n## ").next().unwrap();
        let cells = section.lines().filter(|line| line.starts_with("| `")).map(|line| {
            line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<String>>()
        });
        let written: Vec<Vec<String>> = cells.collect();
        let compared: Vec<Vec<String>> = written.iter().map(|row| [&row[..4], &row[5..8]].concat()).collect();
        assert_eq!(compared, mapping.topics.iter().map(rows).collect::<Vec<_>>(), "{name}");
        for (row, topic) in written.iter().zip(&mapping.topics) {
            let is_needed = topic.role == Role::Odometry || needs.needs().contains(&topic.role);
            assert_eq!(row[8].starts_with("**needed**"), is_needed, "{name}: {row:?}");
            assert!(!row[4].is_empty() && !row[8].is_empty(), "{name}: {row:?}");
        }
    }
    for (name, qos) in PROFILES {
        let reliability = if qos.reliable { "reliable" } else { "best effort" };
        let durability = if qos.transient_local { "transient local" } else { "volatile" };
        let row = format!("| `{name}` | {reliability} | {durability} | {} |", qos.depth);
        assert!(page.contains(&row), "{row}");
    }
}

const PROFILES: [(&str, Qos); 4] = [
    ("sensor", Qos::SENSOR),
    ("default", Qos::DEFAULT),
    ("vehicle", Qos::VEHICLE),
    ("latched", Qos::LATCHED),
];

fn qos_words(qos: Qos) -> String {
    match PROFILES.iter().find(|(_, profile)| *profile == qos) {
        Some((name, _)) => format!("`{name}`"),
        None => {
            assert!(qos.reliable && !qos.transient_local, "{qos:?}");
            format!("reliable, {}", qos.depth)
        }
    }
}

#[test]
fn raptor_counters_follow_the_gate_heartbeat() {
    let mut car = interface(Vehicle::Raptor, &config(""));
    let sent = messages(&mut *car, &gate(0.0));
    let AnyMessage::RaptorSteeringCmd(steering) = &sent[&Role::SteeringCommand] else {
        panic!("no steering")
    };
    assert_eq!((steering.rolling_counter, steering.enable), (44, true));
    let AnyMessage::RaptorGearCmd(gear) = &sent[&Role::GearCommand] else { panic!("no gear") };
    assert_eq!(gear.cmd.gear, 4);
}

#[test]
fn autoware_turns_on_hazard_lights_in_an_unrequested_stop() {
    let mut car = interface(Vehicle::Autoware, &config(""));
    for (mode, warns) in [
        (GateMode::Driving, 1),
        (GateMode::Stopping(StopCause::Released), 1),
        (GateMode::Stopping(StopCause::ReportTimeout), 2),
        (GateMode::Holding(StopCause::Emergency), 2),
    ] {
        let sent = messages(&mut *car, &GateOutput { mode, ..gate(0.0) });
        let AnyMessage::HazardLightsCommand(hazard) = sent[&Role::HazardLightsCommand] else {
            panic!("none")
        };
        assert_eq!(hazard.command, warns, "{mode:?}");
        assert!(matches!(sent[&Role::Command], AnyMessage::Control(_)));
    }
}

#[test]
fn autoware_gets_no_commands_in_manual_mode_unless_it_is_asked_to_accept_them() {
    let mut car = interface(Vehicle::Autoware, &config(""));
    let roles = |car: &mut dyn VehicleInterface, gate: &GateOutput, asks| -> Vec<Role> {
        let mut outgoing = Outgoing { asks, ..Outgoing::new(Time::from_ms(1500), Epoch { ns: 0 }, 4.0) };
        car.command(gate, &mut outgoing);
        outgoing.messages.iter().map(|(role, _)| *role).collect()
    };
    let manual = GateOutput { mode: GateMode::Manual, engaged: false, ..gate(0.0) };
    assert_eq!(roles(&mut *car, &manual, false), []);
    assert_eq!(roles(&mut *car, &manual, true), [Role::Command]);
    let all = [Role::Command, Role::GearCommand, Role::TurnIndicatorsCommand, Role::HazardLightsCommand];
    assert_eq!(roles(&mut *car, &gate(0.0), false), all);
    // The lights of the stack are turned off once.
    assert_eq!(roles(&mut *car, &manual, false), all[2..]);
    assert_eq!(roles(&mut *car, &manual, false), []);
}

#[test]
fn interfaces_convert_reports_to_facts() {
    let raptor = interface(Vehicle::Raptor, &config("steering_ratio = 10.0\n"));
    let misc = raptor_dbw_msgs::MiscReport { vehicle_speed: 36.0, ..Default::default() };
    let facts = raptor.facts(&AnyMessage::RaptorMiscReport(misc));
    assert_eq!((facts.speed_mps, facts.driver), (Some(10.0), Some(false)));
    let steering = raptor_dbw_msgs::SteeringReport {
        steering_wheel_angle: 90.0,
        driver_activity: true,
        ..Default::default()
    };
    let facts = raptor.facts(&AnyMessage::RaptorSteeringReport(steering));
    assert!((facts.steering_rad.unwrap() - 9.0_f64.to_radians()).abs() < 1e-6);
    assert_eq!((facts.driver, facts.listens), (Some(true), Some(false)));
    // A value that a Dataspeed car does not measure is `None`.
    let dataspeed = interface(Vehicle::Dataspeed, &config(""));
    let blind = ds_dbw_msgs::SteeringReport { steering_wheel_angle: f32::NAN, ..Default::default() };
    assert_eq!(dataspeed.facts(&AnyMessage::DataspeedSteeringReport(blind)).steering_rad, None);
    let autoware = interface(Vehicle::Autoware, &config(""));
    for (mode, driver) in [(1, false), (4, true), (6, true)] {
        let report = autoware_vehicle_msgs::ControlModeReport { mode, ..Default::default() };
        let facts = autoware.facts(&AnyMessage::ControlModeReport(report));
        assert_eq!((facts.driver, facts.listens), (Some(driver), Some(!driver)));
    }
}

#[test]
fn vehicle_report_has_its_oldest_stamp() {
    let needs = [Role::Velocity, Role::Steering];
    let mut car = Car::default();
    let at = |ms| Time::from_ms(ms);
    let speed = Facts { speed_mps: Some(3.0), ..Facts::default() };
    car.hear(Role::Velocity, Kind::VelocityReport, at(100), speed);
    assert_eq!(car.report(&needs), None, "the steering is not known");
    let angle = Facts { steering_rad: Some(0.1), ..Facts::default() };
    car.hear(Role::Steering, Kind::SteeringReport, at(110), angle);
    car.hear(Role::Velocity, Kind::VelocityReport, at(500), speed);
    let report = car.report(&needs).unwrap();
    assert_eq!((report.stamp, report.speed_mps, report.steering_rad), (at(110), 3.0, 0.1));
    let silent: Vec<Role> = car.silent(&needs, at(500) - Span::from_ms(200)).collect();
    assert_eq!(silent, [Role::Steering]);
    // One of several sources of driver activity is sufficient.
    let driver = |driver| Facts { driver: Some(driver), ..Facts::default() };
    car.hear(Role::Brake, Kind::DataspeedBrakeReport, at(600), driver(true));
    car.hear(Role::Steering, Kind::DataspeedSteeringReport, at(600), driver(false));
    assert!(car.report(&needs).unwrap().driver_active);
    car.hear(Role::Brake, Kind::DataspeedBrakeReport, at(610), driver(false));
    assert!(!car.report(&needs).unwrap().driver_active);
}
