use std::collections::BTreeMap;

use swerve_core::{Digest, Time};
use swerve_flow::{Event, RunOptions, run_virtual};
use swerve_scenario::Scenario;
use swerve_text::Document;

use crate::Setup;
use crate::pipeline::Pipeline;

/// A car at rest, with a person in plain view 10 m ahead of it.
const SCENE: &str = r#"name = "x"
road = { segments = [{ length_m = 60.0 }] }
ego = { target_speed_mps = 5.0, start_speed_mps = 0.0, end_m = 50.0 }
end = { timeout_s = 0.25 }
"#;

const PERSON: &str = r#"
[[actor]]
name = "person"
kind = "pedestrian"
s_m = 10.0
d_m = 0.0
"#;

/// Every kind of sensor of other road users; the controller does not move the car.
const SENSORS: &str = r#"
[log]
sensors = ["eye", "roof", "front"]
[render]
backend = "cpu"
[sensing]
traffic_lights = true
[camera.eye]
width_px = 64
height_px = 48
outputs = ["rgb", "depth", "semantic", "instance"]
[lidar.roof]
beams_deg = [[-10, 0], [-5, 0], [0, 0]]
params = { columns = 180 }
[radar.front]
[operator.controller]
delay_ms = 400
"#;

fn scenario(actors: &str) -> Scenario {
    Scenario::parse("x.toml", &format!("{SCENE}{actors}")).unwrap()
}

fn setup(text: &str, unseen: &[&str]) -> Setup {
    let unseen = unseen.iter().map(|name| toml::Value::from(*name)).collect();
    let document = Document::parse("c.toml", text).unwrap();
    Setup::from_document(&document, &[("sensing.unseen".to_owned(), toml::Value::Array(unseen))]).unwrap()
}

/// Number of messages on each stream, and the digest of the last one.
fn messages(setup: &Setup, scenario: &Scenario) -> BTreeMap<String, (u64, Digest)> {
    let pipeline = Pipeline::build(setup, scenario).unwrap();
    let mut last = BTreeMap::new();
    let mut observer = |event: &Event<'_>| {
        if let Event::Publication(publication) = event
            && let Some(payload) = publication.payload
        {
            last.insert(publication.stream.to_owned(), (publication.seq, payload.digest()));
        }
    };
    let options = RunOptions::until(Time::from_ms(250)).seed(setup.seed);
    run_virtual(pipeline.graph, &options, vec![&mut observer]).unwrap();
    last
}

#[test]
fn no_sensor_sees_an_unseen_actor() {
    let detector = "[perception]\ndetector = \"efficientdet-d3@v100\"\n";
    let rendered = ["eye.rgb", "eye.depth", "eye.semantic", "eye.instance", "roof.points", "roof.truth"];
    let truth: Vec<&str> = rendered.into_iter().chain(["front.scan", "obstacles"]).collect();
    for (more, streams) in [("", truth), (detector, vec!["obstacles.surroundings", "detector"])] {
        let text = format!("{SENSORS}{more}");
        let seen = messages(&setup(&text, &[]), &scenario(PERSON));
        let unseen = messages(&setup(&text, &["person"]), &scenario(PERSON));
        let without = messages(&setup(&text, &[]), &scenario(""));
        for stream in streams {
            let of = |run: &BTreeMap<String, (u64, Digest)>| match run.get(stream) {
                Some(last) => *last,
                None => panic!("no {stream}: {:?}", run.keys()),
            };
            assert_ne!(of(&unseen), of(&seen), "{stream}: the person is in view");
            assert_eq!(of(&unseen), of(&without), "{stream}");
        }
        assert_eq!(unseen["world"], seen["world"], "the person is in the world");
        assert_ne!(unseen["world"], without["world"]);
    }
}

#[test]
fn unseen_actor_hides_nobody() {
    let wall = "[[actor]]\nname = \"wall\"\nkind = \"static\"\ns_m = 8.0\nd_m = 0.0\n\
                size = { length_m = 0.5, width_m = 3.0, height_m = 3.0 }\n";
    let both = scenario(&format!("{PERSON}{wall}"));
    let seen = |unseen: &[&str]| messages(&setup("", unseen), &both)["obstacles"];
    let person_alone = messages(&setup("", &[]), &scenario(PERSON))["obstacles"];
    assert_eq!(seen(&["wall"]), person_alone);
    assert_ne!(seen(&[]), person_alone);
}

#[test]
fn unknown_unseen_actor_is_refused_with_the_nearest_name() {
    let error = |name: &str, actors: &str| {
        let built = Pipeline::build(&setup("", &[name]), &scenario(actors));
        format!("{:#}", built.err().expect("there is no such actor"))
    };
    let near = "sensing.unseen: the scenario has no actor \"persn\"; did you mean `person`?";
    assert_eq!(error("persn", PERSON), near);
    assert_eq!(
        error("x", PERSON),
        "sensing.unseen: the scenario has no actor \"x\": expected one of \"person\""
    );
    assert!(error("ego", "").ends_with("no actor \"ego\": it has none"));
}
