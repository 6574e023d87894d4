//! Pipelines as text: what is added, replaced, left out, and what is refused.

use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::Detections;
use swerve_text::{Document, parse_assignment};

use super::*;
use crate::kind::{Kind, NoKeys, Node};
use crate::registry::Registry;
use crate::site::Site;

/// Takes the boxes of all detectors.
struct Fusion;

#[derive(Inputs)]
struct FusionIn {
    /// Boxes of every detector.
    boxes: Vec<At<Detections>>,
}

impl Kind for Fusion {
    const NODE: Node = Node::new("fusion", "boxes of all detectors in one list");
    type Table = NoKeys;

    fn new(_: NoKeys, _: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self)
    }
}

impl Operator for Fusion {
    type In = FusionIn;
    type Out = Port<Detections>;

    fn step(&mut self, cx: &mut Context<'_>, input: &FusionIn, out: &mut Port<Detections>) {
        let all = input.boxes.iter().filter_map(At::get);
        let boxes = all.flat_map(|detections| detections.boxes.iter().cloned()).collect();
        out.send(Detections { stamp: cx.stamp(), boxes });
    }
}

fn read(text: &str, sets: &[&str]) -> Result<Config, Vec<String>> {
    let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
    let document = Document::parse("c.toml", text).unwrap();
    let registry = Registry::standard().with::<Fusion>();
    Config::from_document_with(&registry, &document, &sets)
        .map_err(|problems| problems.iter().map(ToString::to_string).collect())
}

fn assembly(text: &str) -> Assembly {
    let config = read(text, &[]).unwrap_or_else(|problems| panic!("{problems:#?}"));
    Assembly::new(&config).unwrap()
}

fn names(assembly: &Assembly) -> Vec<&str> {
    assembly.operators().iter().map(|placed| placed.name.as_str()).collect()
}

/// What an operator reads, by port.
fn reads(assembly: &Assembly, operator: &str) -> Vec<(&'static str, Vec<String>)> {
    let inputs = &assembly.operator(operator).unwrap_or_else(|| panic!("there is no {operator}")).inputs;
    let streams = |input: &Input| input.from.iter().map(|edge| edge.stream.clone()).collect();
    let read = inputs.iter().filter(|input| input.port.payload.is_some());
    read.map(|input| (input.port.name, streams(input))).collect()
}

#[test]
fn the_built_in_pipeline_is_what_its_text_says() {
    let default = assembly("");
    let stack = ["tracker", "predictor", "planner", "controller"];
    assert_eq!(names(&default), [&["world", "obstacles", "pose", "imu"][..], &stack[..]].concat());
    assert_eq!(
        names(&assembly("[gate]\nenabled = true\n"))[8..],
        ["report", "switch", "gate", "pedals"],
        "the gate's operators come behind it"
    );
    let known: Vec<&str> = pipeline_names().collect();
    assert!(known.len() >= 24 && known.contains(&"deadlines") && known.contains(&"fresh"), "{known:?}");
}

#[test]
fn what_is_printed_makes_the_same_pipeline() {
    for text in ["", "[gate]\nenabled = true\n", "[perception]\ndetector = \"efficientdet-d3@v100\"\n"] {
        let before = assembly(text);
        let again = assembly(&format!("{text}{}", before.to_toml()));
        assert_eq!(names(&again), names(&before));
        for placed in before.operators() {
            let other = again.operator(&placed.name).unwrap();
            assert_eq!((&other.inputs, &other.outputs), (&placed.inputs, &placed.outputs), "{}", placed.name);
        }
    }
}

#[test]
fn operators_are_added_replaced_and_left_out() {
    let left_out = assembly("[operator.imu]\nenabled = false\n");
    assert!(!left_out.has("imu") && left_out.has("pose"));
    let added = assembly(
        "[operator.second]\nkind = \"linear_predictor\"\nhorizon_ms = 2000\n[operator.planner]\nreads = { predictions = \"second\" }\n",
    );
    assert_eq!(reads(&added, "second"), [("tracks", vec!["tracker".to_owned()])]);
    assert_eq!(reads(&added, "planner")[0], ("predictions", vec!["second".to_owned()]));
    let place = |name| names(&added).iter().position(|own| *own == name).unwrap();
    assert!(place("tracker") < place("second") && place("second") < place("planner"));
    let config = read("[operator.second]\nkind = \"linear_predictor\"\nhorizon_ms = 2000\n[operator.planner]\nreads = { predictions = \"second\" }\n", &[]).unwrap();
    let horizon = |name: &str| added.operator(name).unwrap().settings(&config).config.prediction.horizon_ms;
    assert_eq!((horizon("second"), horizon("predictor")), (2000.0, 5000.0), "its own key is its alone");
}

#[test]
fn a_sensor_runs_where_somebody_reads_it() {
    let camera = "[camera.front]\n";
    assert!(!assembly(camera).has("front"));
    assert!(assembly(&format!("{camera}[log]\nsensors = [\"front\"]\n")).has("front"));
    let watched = assembly(&format!("{camera}[monitor.eye]\nsensor = \"front\"\n"));
    assert_eq!(reads(&watched, "eye"), [("image", vec!["front.rgb".to_owned()])]);
    let as_operator =
        assembly("[operator.front]\nkind = \"camera\"\nwidth_px = 64\n[log]\nsensors = [\"front\"]\n");
    assert!(as_operator.has("front"));
}

/// Two cameras with a detector each, and a fusion behind them.
const TWO_CAMERAS: &str = r#"
[camera.left]
yaw_deg = 40
[camera.right]
yaw_deg = -40

[operator.obstacles]
enabled = false

[operator.left_sight]
kind = "obstacle_sensor"
detector = "efficientdet-d3@v100"
camera = "left"
[operator.right_sight]
kind = "obstacle_sensor"
detector = "efficientdet-d3@v100"
camera = "right"

[operator.left_detector]
kind = "emulated_detector"
detector = "efficientdet-d3@v100"
camera = "left"
reads = { surroundings = "left_sight.surroundings" }
[operator.right_detector]
kind = "emulated_detector"
detector = "efficientdet-d0@v100"
camera = "right"
reads = { surroundings = "right_sight.surroundings" }

[operator.fusion]
kind = "fusion"
reads = { boxes = ["left_detector", "right_detector"] }
[operator.tracker]
reads = { boxes = "fusion" }
"#;

#[test]
fn two_cameras_have_a_detector_each_and_a_fusion_behind_them() {
    let all = assembly(TWO_CAMERAS);
    assert_eq!(reads(&all, "tracker")[0], ("boxes", vec!["fusion".to_owned()]));
    assert_eq!(reads(&all, "fusion")[0].1, ["left_detector", "right_detector"]);
    let config = read(TWO_CAMERAS, &[]).unwrap();
    let ms = |name: &str| {
        let placed = all.operator(name).unwrap();
        placed.kind.runtime(&placed.settings(&config)).unwrap().to_string()
    };
    assert_ne!(ms("left_detector"), ms("right_detector"), "each has its own published run time");
}

#[test]
fn what_does_not_fit_is_refused_with_line_key_and_nearest_name() {
    let cases = [
        (
            "[operator.planer]\n",
            "c.toml:1: operator.planer: unknown operator, expected one of supervisor, world",
        ),
        (
            "[operator.x]\nkind = \"linear_predicter\"\n",
            "c.toml:2: operator.x.kind: unknown kind `linear_predicter`",
        ),
        (
            "[operator.planer]\nenabled = false\n",
            "c.toml:1: operator.planer: unknown operator, expected one of supervisor, world",
        ),
        (
            "[operator.d]\nkind = \"emulated_detector\"\n",
            "c.toml:2: operator.d.kind: `emulated_detector` takes no part in this pipeline, which is set by [perception]",
        ),
        (
            "[operator.tracker]\nruntme = { fixed_ms = 3 }\n",
            "c.toml:2: operator.tracker.runtme: unknown key (did you mean `runtime`?)",
        ),
        (
            "[operator.predictor]\nreads = { track = \"tracker\" }\n",
            "c.toml:2: operator.predictor.reads.track: `linear_predictor` has no port of this name, expected one of tracks (did you mean `tracks`?)",
        ),
        (
            "[operator.predictor]\nreads = { tracks = \"trackr\" }\n",
            "c.toml:2: operator.predictor.reads.tracks: unknown stream `trackr`, expected one of tracker (did you mean `tracker`?)",
        ),
        (
            "[operator.predictor]\nreads = { tracks = \"pose\" }\n",
            "c.toml:2: operator.predictor.reads.tracks: expected a stream of `TrackList`, found `pose` of `EgoState`",
        ),
        (
            "[operator.second]\nkind = \"linear_predictor\"\n",
            "c.toml:1: operator.planner.reads.predictions: several streams carry `PredictionList`: name one of \"predictor\", \"second\"",
        ),
        (
            "[operator.predictor]\nenabled = false\n",
            "c.toml:1: operator.planner.reads.predictions: reads `PredictionList`, and no operator of the pipeline publishes any",
        ),
        (
            "[operator.predictor]\nhorizon = 2000\n",
            "c.toml:2: operator.predictor.horizon: unknown key; did you mean \"horizon_ms\"?",
        ),
        (
            "[operator.predictor]\nhorizon_ms = 1\n",
            "c.toml:2: operator.predictor.horizon_ms: expected 50 to 60000, found 1",
        ),
        ("[operator.x]\nkind = \"fusion\"\nkey = 1\n", "c.toml:3: operator.x.key: unknown key"),
        (
            "[operator.world]\nreads = { command = { stream = \"controller\", feedback = false } }\n",
            "c.toml:2: operator.world.reads: a cycle without a feedback edge goes through world,",
        ),
        (
            "[operator.predictor]\nreads = { tracks = [] }\n",
            "c.toml:2: operator.predictor.reads.tracks: expected one stream, found 0",
        ),
    ];
    for (text, expected) in cases {
        let problems = read(text, &[]).err().unwrap_or_default();
        assert!(problems.iter().any(|problem| problem.starts_with(expected)), "{expected}\n{problems:#?}");
    }
}

#[test]
fn every_kind_says_what_it_is() {
    let registry = Registry::standard();
    for kind in registry.kinds() {
        let node = kind.node();
        assert!(node.doc.len() > 8 && !node.doc.ends_with('.'), "{}: {}", node.kind, node.doc);
        assert!(node.kind.bytes().all(|b| b.is_ascii_lowercase() || b == b'_'), "{}", node.kind);
    }
    assert!(registry.kinds().count() >= 30);
}
