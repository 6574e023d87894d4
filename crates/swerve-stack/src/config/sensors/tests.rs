use crate::Setup;
use swerve_text::Document;

fn problems(text: &str) -> Vec<String> {
    let document = Document::parse("c.toml", text).unwrap();
    let problems = Setup::from_document(&document, &[]).err().unwrap_or_default();
    problems.iter().map(ToString::to_string).collect()
}

/// Asserts that a file has exactly one problem, which begins with `start`.
fn told(text: &str, start: &str) {
    let found = problems(text);
    assert!(found.len() == 1 && found[0].starts_with(start), "{text}: {found:#?}, expected {start}");
}

#[test]
fn sensors_with_keys_of_all_kinds_are_read() {
    let text = "
[log]
sensors = [\"front\", \"roof\", \"imu\", \"gnss\", \"odometry\", \"collisions\", \"lane_invasions\", \"red_lights\"]
[sensing]
odometry_period_ms = 10
odometry = { counts_per_turn = 48, wheels = \"all\" }
[radar.front]
preset = \"corner\"
at_m = [3.9, 0.9, 0.6]
yaw_deg = 45
period_ms = 40
exposure_ms = 20
params = { range_max_m = 80, clutter_per_scan = 0 }
[lidar.roof]
preset = \"os1_64\"
beams_deg = [[-10, 0], [0, 1.5]]
rate_hz = 20
transfer_ms = 3
params = { columns = 512, range_sigma_m = 0 }
";
    let document = Document::parse("c.toml", text).unwrap();
    let config = Setup::from_document(&document, &[]).unwrap();
    let spec = config.lidar["roof"].spec(7).unwrap();
    assert_eq!((spec.beams.len(), spec.columns, spec.rate_hz, spec.seed), (2, 512, 20.0, 7));
    assert_eq!((spec.range_sigma_m, spec.reach_m), (0.0, 40.0));
    assert!((spec.beams[1].azimuth_rad.to_degrees() - 1.5).abs() < 1e-9);
    let radar = config.radar["front"].radar(&config.sim.vehicle).unwrap();
    assert_eq!((radar.params().range_max_m, radar.params().range_resolution_m), (80.0, 0.4));
    // The written configuration reads back as itself.
    let resolved = Document::parse("resolved", config.to_text()).unwrap();
    assert_eq!(Setup::from_document(&resolved, &[]).unwrap().config, config.config);
}

#[test]
fn invalid_radar_is_refused_with_file_line_and_key() {
    let with = |line: &str| format!("[radar.front]\n{line}\n");
    let at = "c.toml:2: radar.front.";
    for (line, said) in [
        ("preset = \"long\"", "preset: expected one of \"long_range\", \"corner\", found \"long\""),
        ("period_ms = 0", "period_ms: expected 1 to 60000, found 0"),
        ("period_ms = nan", "period_ms: expected 1 to 60000, found NaN"),
        ("at_m = [1.0, 0.0, 0.5]", "at_m: expected a place outside the car's body"),
        ("at_m = [nan, 0.0, 0.5]", "at_m: x_m: expected -30 to 30, found NaN"),
        ("yaw_deg = inf", "yaw_deg: expected -360 to 360, found inf"),
        ("exposure_ms = -1", "exposure_ms: expected 0 to 10000, found -1"),
        ("params = { range_max_m = nan }", "params.range_max_m: expected 0.1 to 10000, found NaN"),
        (
            "params = { range_min_m = 300 }",
            "params.range_min_m: expected a number below range_max_m, found 300",
        ),
        ("params = { range_max = 80 }", "params.range_max: unknown key; did you mean `range_max_m`?"),
        ("params = { preset = \"corner\" }", "params.preset: expected as `preset` beside `params`"),
        ("perod_ms = 50", "perod_ms: unknown key; did you mean `period_ms`?"),
    ] {
        told(&with(line), &format!("{at}{said}"));
    }
}

#[test]
fn invalid_lidar_is_refused_with_file_line_and_key() {
    let with = |line: &str| format!("[lidar.roof]\n{line}\n");
    let at = "c.toml:2: lidar.roof.";
    let twins = format!("beams_deg = [{}]", "[1, 0], ".repeat(200));
    for (line, said) in [
        ("preset = \"hdl_65\"", "preset: "),
        ("rate_hz = 0", "rate_hz: expected 0.01 to 1000, found 0"),
        ("rate_hz = nan", "rate_hz: expected 0.01 to 1000, found NaN"),
        ("rate_hz = 300", "rate_hz: expected at most one turn in a step of the world of 5 ms, found 300"),
        (
            twins.as_str(),
            "beams_deg[1]: expected beams that differ in elevation or azimuth offset, found at the angles of \
             beams_deg[0] (199 of 200 beams repeat another)",
        ),
        ("beams_deg = [[0, 0], [nan, 0]]", "beams_deg[1]: expected -90 to 90, found NaN"),
        ("beams_deg = [[91, 0]]", "beams_deg[0]: expected -90 to 90, found 91"),
        ("at_m = [1.0, 0.0, 1.0]", "at_m: expected a place outside the car's body"),
        ("at_m = [1.0, 0.0, inf]", "at_m: z_m: expected 0 to 10, found inf"),
        ("pitch_deg = nan", "pitch_deg: expected -360 to 360, found NaN"),
        ("transfer_ms = -1", "transfer_ms: expected 0 to 10000, found -1"),
        ("params = { columns = 0 }", "params.columns: expected 1 to 16384, found 0"),
        ("params = { columns = -3 }", "params.columns: expected "),
        ("params = { dropout = nan }", "params.dropout: expected 0 to 1, found NaN"),
        ("params = { seed = 3 }", "params.seed: unknown key; the noise is keyed by the run's seed"),
        ("params = { rate_hz = 3 }", "params.rate_hz: expected as `rate_hz` beside `params`"),
        ("params = { dropuot = 0 }", "params.dropuot: unknown key; did you mean `dropout`?"),
    ] {
        told(&with(line), &format!("{at}{said}"));
    }
}

#[test]
fn sensor_names_must_be_unique() {
    told(
        "[radar.gnss]\n",
        "c.toml:1: radar.gnss: expected a name of letters, digits and underscores that no operator has",
    );
    told("[lidar.planner]\n", "c.toml:1: lidar.planner: expected a name of");
    told("[lidar.\"a b\"]\n", "c.toml:1: lidar.a b: expected a name of");
    told(
        "[camera.front]\n[radar.front]\n",
        "c.toml:2: radar.front: expected a unique name, found that of `[camera.front]`",
    );
    told(
        "[radar.front]\n[lidar.front]\n",
        "c.toml:2: lidar.front: expected a unique name, found that of `[radar.front]`",
    );
}

#[test]
fn unknown_sensors_are_reported_with_the_nearest_name() {
    let with = |name: &str| format!("[lidar.roof]\n[log]\nsensors = [\"gnss\", \"{name}\"]\n");
    for (name, near) in
        [("rof", "roof"), ("odometer", "odometry"), ("collision", "collisions"), ("red_light", "red_lights")]
    {
        let start = format!(
            "c.toml:3: log.sensors[1]: unknown sensor `{name}`, expected one of obstacles, pose, imu, gnss, odometry,"
        );
        told(&with(name), &start);
        assert!(problems(&with(name))[0].ends_with(&format!("; did you mean `{near}`?")));
    }
}

#[test]
fn invalid_odometry_is_refused() {
    told(
        "[sensing]\nodometry_period_ms = 0\n",
        "c.toml:2: sensing.odometry_period_ms: expected 1 to 10000, found 0",
    );
    told(
        "[sensing.odometry]\ncounts_per_turn = 0\n",
        "c.toml:2: sensing.odometry.counts_per_turn: expected 1 to",
    );
    told(
        "[sensing.odometry]\nradius_error = nan\n",
        "c.toml:2: sensing.odometry.radius_error: expected 0 to 0.1, found NaN",
    );
}
