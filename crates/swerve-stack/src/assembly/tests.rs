//! Pipelines as text: operators added, replaced, left out and refused.

use std::path::{Path, PathBuf};

use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::truth::{PointInstances, RadarSources, Surroundings, WorldState};
use swerve_msg::{Detections, EgoState};
use swerve_scenario::Scenario;
use swerve_text::{Document, parse_assignment};

use super::*;
use crate::base::pipeline_names;
use crate::kind::{Kind, Node};
use crate::named::NoKeys;
use crate::pipeline::Pipeline;
use crate::registry::Registry;
use crate::site::Site;

/// Collects the boxes of all detectors.
struct Fusion;

#[derive(Inputs)]
struct FusionIn {
    /// Boxes of each detector.
    boxes: Vec<At<Detections>>,
}

impl Kind for Fusion {
    const NODE: Node = Node::new("all_boxes", "boxes of all detectors in one list");
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

fn read(text: &str, sets: &[&str]) -> Result<Setup, Vec<String>> {
    let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
    let document = Document::parse("c.toml", text).unwrap();
    let registry = Registry::standard().with::<Fusion>();
    Setup::from_document_with(&registry, &document, &sets)
        .map_err(|problems| problems.iter().map(ToString::to_string).collect())
}

fn assembly(text: &str) -> Assembly {
    let config = read(text, &[]).unwrap_or_else(|problems| panic!("{problems:#?}"));
    Assembly::new(&config).unwrap()
}

fn names(assembly: &Assembly) -> Vec<&str> {
    assembly.operators().iter().map(|placed| placed.name.as_str()).collect()
}

/// Streams that an operator reads, by port.
fn reads<'a>(assembly: &'a Assembly, operator: &str) -> Vec<(&'a str, Vec<String>)> {
    let inputs = &assembly.operator(operator).unwrap_or_else(|| panic!("there is no {operator}")).inputs;
    let streams = |input: &Input| input.from.iter().map(|edge| edge.stream.clone()).collect();
    let read = inputs.iter().filter(|input| input.port.payload.is_some());
    read.map(|input| (&*input.port.name, streams(input))).collect()
}

#[test]
fn built_in_pipeline_matches_its_text() {
    let default = assembly("");
    let stack = ["router", "tracker", "predictor", "behaviour", "planner", "controller"];
    assert_eq!(names(&default), [&["world", "obstacles", "pose", "imu"][..], &stack[..]].concat());
    assert_eq!(
        names(&assembly("[gate]\nenabled = true\n"))[10..],
        ["report", "switch", "gate", "pedals"],
        "the gate's operators come behind it"
    );
    let known: Vec<&str> = pipeline_names().collect();
    assert!(known.len() >= 24 && known.contains(&"deadlines") && known.contains(&"fresh"), "{known:?}");
}

/// All shipped configurations of a drive, and typical user configurations, in every scenario.
#[test]
fn printed_pipeline_makes_the_same_graph() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let files = |folder: &str| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        entries.filter(|path| path.extension().is_some_and(|extension| extension == "toml")).collect()
    };
    let shipped = [files("configs"), files("configs/live")].concat();
    let mut texts: Vec<String> = shipped.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
    assert!(texts.len() >= 12, "{shipped:?}");
    texts.push(TWO_CAMERAS.to_owned());
    let own = "[gate]\nenabled = true\n[resource.gpu]\nslots = 1\n[operator.imu]\nenabled = false\n\
               [operator.planner]\nruntime = { normal_ms = [40, 5] }\npolicy = \"queue(2)\"\nuses = \"gpu\"\n\
               deadline = { ms = 80, reaction = \"reuse_last\" }\ndelay_ms = 3\n\
               [fault.late]\nstream = \"obstacles\"\ndelay_ms = 100\n";
    texts.push(own.to_owned());
    let scenarios = files("scenarios");
    for (k, text) in texts.iter().enumerate() {
        let config = read(text, &[]).unwrap_or_else(|problems| panic!("{text}{problems:#?}"));
        for scenario in scenarios.iter().skip(k % 3).step_by(3) {
            let scenario = Scenario::read(scenario).unwrap();
            let build = |config: &Setup| Pipeline::build_without_stage(config, &scenario).unwrap();
            let before = build(&config);
            let graph = before.graph.describe().unwrap();
            let printed = before.assembly.to_toml(&config, &graph);
            let again = read(&printed, &[]).unwrap_or_else(|problems| panic!("{printed}{problems:#?}"));
            assert_eq!(build(&again).graph.describe().unwrap(), graph, "{printed}");
        }
    }
}

#[test]
fn printed_pipeline_shows_run_times_and_feedback_edges() {
    let config = read("[operator.planner]\nruntime = { fixed_ms = 30 }\n", &[]).unwrap();
    let lane = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/lane.toml");
    let pipeline = Pipeline::build_without_stage(&config, &Scenario::read(Path::new(lane)).unwrap()).unwrap();
    let printed = pipeline.assembly.to_toml(&config, &pipeline.graph.describe().unwrap());
    for line in [
        "# run time fixed 30 ms; skip_to_latest",
        "runtime = { fixed_ms = 30.0 }",
        "reads = { command = { feedback = true, stream = \"controller\" } }",
    ] {
        assert!(printed.lines().any(|printed| printed == line), "{line}\n{printed}");
    }
}

#[test]
fn operators_can_be_added_replaced_and_left_out() {
    let left_out = assembly("[operator.imu]\nenabled = false\n");
    assert!(!left_out.has("imu") && left_out.has("pose"));
    let added = assembly(
        "[operator.second]\nkind = \"predictor\"\nhorizon_ms = 2000\n[operator.behaviour]\nreads = { predictions = \"second\" }\n[operator.planner]\nreads = { predictions = \"second\" }\n",
    );
    assert_eq!(
        reads(&added, "second"),
        [("tracks", vec!["tracker".to_owned()]), ("route", vec!["router".to_owned()])]
    );
    assert_eq!(reads(&added, "planner")[1], ("predictions", vec!["second".to_owned()]));
    let place = |name| names(&added).iter().position(|own| *own == name).unwrap();
    assert!(place("tracker") < place("second") && place("second") < place("planner"));
    let config = read("[operator.second]\nkind = \"predictor\"\nhorizon_ms = 2000\n[operator.behaviour]\nreads = { predictions = \"second\" }\n[operator.planner]\nreads = { predictions = \"second\" }\n", &[]).unwrap();
    let horizon = |name: &str| added.operator(name).unwrap().settings(&config).setup.prediction.horizon_ms;
    assert_eq!((horizon("second"), horizon("predictor")), (2000.0, 5000.0), "its own key is its alone");
}

#[test]
fn sensor_runs_only_with_a_reader() {
    let camera = "[camera.front]\n";
    assert!(!assembly(camera).has("front"));
    assert!(assembly(&format!("{camera}[log]\nsensors = [\"front\"]\n")).has("front"));
    let watched = assembly(&format!("{camera}[monitor.eye]\nsensor = \"front\"\n"));
    assert_eq!(reads(&watched, "eye"), [("image", vec!["front.rgb".to_owned()])]);
    let as_operator =
        assembly("[operator.front]\nkind = \"camera\"\nwidth_px = 64\n[log]\nsensors = [\"front\"]\n");
    assert!(as_operator.has("front"));
}

/// Two cameras with a detector each, followed by a fusion.
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
kind = "all_boxes"
reads = { boxes = ["left_detector", "right_detector"] }
[operator.tracker]
reads = { boxes = "fusion" }
"#;

#[test]
fn fusion_reads_the_detectors_of_two_cameras() {
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

/// Texts, and the problem reported for each.
const REFUSED: &[(&str, &str)] = &[
    ("[operator.planer]\n", "c.toml:1: operator.planer: unknown operator, expected one of supervisor, world"),
    ("[operator.x]\nkind = \"predicter\"\n", "c.toml:2: operator.x.kind: unknown kind `predicter`"),
    (
        "[operator.x]\nkind = \"linear_predictor\"\n",
        "c.toml:2: operator.x.kind: the kind `linear_predictor` was removed: it was renamed to `predictor`",
    ),
    (
        "[operator.planer]\nenabled = false\n",
        "c.toml:1: operator.planer: unknown operator, expected one of supervisor, world",
    ),
    (
        "[operator.d]\nkind = \"emulated_detector\"\n",
        "c.toml:2: operator.d.kind: `emulated_detector` takes part where `perception.detector = \"NAME\"` asks for it",
    ),
    (
        "[operator.tracker]\nreads = { boxes = \"camera\" }\n",
        "c.toml:2: operator.tracker.reads.boxes: `tracker` has this port where `Detections` are published, and no operator \
         publishes any: `[operator.NAME] kind = \"camera_objects\"` or `perception.detector = \"NAME\"` or `[operator.NAME] kind = \"lidar_objects\"` adds one that does",
    ),
    (
        "[operator.x]\nkind = \"all_boxes\"\nreads = { boxes = \"camera\" }\n[operator.tracker]\nreads = { boxes = \"x\" }\n",
        "c.toml:3: operator.x.reads.boxes: unknown stream `camera`, expected one of x",
    ),
    (
        "[operator.tracker]\nruntme = { fixed_ms = 3 }\n",
        "c.toml:2: operator.tracker.runtme: unknown key; did you mean `runtime`?",
    ),
    (
        "[operator.predictor]\nreads = { track = \"tracker\" }\n",
        "c.toml:2: operator.predictor.reads.track: `predictor` has no port of this name, expected one of tracks, route; did you mean `tracks`?",
    ),
    (
        "[operator.predictor]\nreads = { tracks = \"trackr\" }\n",
        "c.toml:2: operator.predictor.reads.tracks: unknown stream `trackr`, expected one of tracker; did you mean `tracker`?",
    ),
    (
        "[operator.predictor]\nreads = { tracks = \"pose\" }\n",
        "c.toml:2: operator.predictor.reads.tracks: expected a stream of `TrackList`, found `pose` of `EgoState`",
    ),
    (
        "[operator.second]\nkind = \"predictor\"\n",
        "c.toml:1: operator.second: several streams carry `PredictionList`: name one of \"predictor\", \"second\" in [operator.behaviour] reads = { predictions = \"...\" }, [operator.planner] reads = { predictions = \"...\" }",
    ),
    (
        "[operator.predictor]\nenabled = false\n",
        "c.toml:2: operator.predictor.enabled: `planner` reads `PredictionList`, which no other operator publishes",
    ),
    (
        "[operator.predictor]\nhorizon = 2000\n",
        "c.toml:2: operator.predictor.horizon: unknown key; did you mean `horizon_ms`?",
    ),
    (
        "[operator.predictor]\nhorizon_ms = 1\n",
        "c.toml:2: operator.predictor.horizon_ms: expected 50 to 60000, found 1",
    ),
    ("[operator.x]\nkind = \"all_boxes\"\nkey = 1\n", "c.toml:3: operator.x.key: unknown key"),
    (
        "[operator.world]\nreads = { command = { stream = \"controller\", feedback = false } }\n",
        "c.toml:2: operator.world.reads: a cycle without a feedback edge goes through world,",
    ),
    (
        "[operator.predictor]\nreads = { tracks = [] }\n",
        "c.toml:2: operator.predictor.reads.tracks: expected one stream, found 0",
    ),
    (
        "[operator.predictor]\nreads = { tracks = { stream = \"tracker\", feedback = true } }\n",
        "c.toml:2: operator.predictor.reads.tracks.feedback: expected false: `tracks` reads the message of its",
    ),
    (
        "[operator.second_world]\nkind = \"simulator\"\n",
        "c.toml:2: operator.second_world.kind: expected another kind: a run has one simulated world",
    ),
    (
        "[operator.objects]\nkind = \"object_input\"\n[operator.obstacles]\nenabled = false\n",
        "c.toml:2: operator.objects.kind: only a vehicle of `swerve live` feeds `object_input`: a simulated run would",
    ),
    (
        "[perception]\ndetector = \"efficientdet-d3@v100\"\n[operator.detector]\nenabled = false\n",
        "c.toml:4: operator.detector.enabled: `perception.detector` is `efficientdet-d3@v100`, and nothing else detects",
    ),
    (
        "[operator.\"a b/c\"]\nkind = \"imu\"\n",
        "c.toml:1: operator.a b/c: expected a name of letters, digits and underscores",
    ),
    (
        "[operator.\"\"]\nkind = \"imu\"\n",
        "c.toml:1: operator.: expected a name of letters, digits and underscores",
    ),
    (
        "[operator.predictor]\nreads = { tracks = 3 }\n",
        "c.toml:2: operator.predictor.reads.tracks: expected a stream, an array of streams, or { stream = ",
    ),
    (
        "[operator.predictor]\nreads = { tracks = { stream = \"tracker\", feedbak = true } }\n",
        "c.toml:2: operator.predictor.reads.tracks.feedbak: unknown key; did you mean `feedback`?",
    ),
    (
        "[operator.watch]\nkind = \"sensor_monitor\"\n[camera.front]\n",
        "c.toml:1: operator.watch.sensor: is missing: expected a camera or a lidar, one of front",
    ),
    (
        "[camera.left]\noutputs = [\"rgb\"]\n[operator.m]\nkind = \"sensor_monitor\"\nsensor = \"left\"\n\
         reads = { image = \"left.depth\" }\n",
        "c.toml:6: operator.m.reads.image: `left.depth` holds nothing: `camera.left.outputs` has rgb alone",
    ),
    (
        "[monitor.watch]\n",
        "c.toml:1: monitor.watch.sensor: is missing: expected a camera or a lidar; [camera.NAME] or [lidar.NAME] makes one",
    ),
    (
        "[monitor.watch]\nsensor = \"frnt\"\n[camera.front]\n",
        "c.toml:2: monitor.watch.sensor: unknown camera or lidar `frnt`, expected one of front; did you mean `front`?",
    ),
    (
        "[operator.world]\nreads = { step = \"imu\" }\n",
        "c.toml:2: operator.world.reads.step: a timer reads no stream",
    ),
];

#[test]
fn operator_with_wrong_keys_is_not_reported_as_unknown() {
    let told = read("[operator.watch]\nkind = \"sensor_monitor\"\n", &[]).unwrap_err();
    assert_eq!(told.len(), 1, "{told:?}");
}

#[test]
fn wrong_operators_are_refused_with_line_key_and_nearest_name() {
    for (text, expected) in REFUSED {
        let problems = read(text, &[]).err().unwrap_or_default();
        assert!(problems.iter().any(|problem| problem.starts_with(expected)), "{expected}\n{problems:#?}");
    }
}

/// Problems that only follow from a mistake are not reported, and each mistake is reported once.
#[test]
fn problems_are_reported_without_their_consequences() {
    let several = "[operator.second]\nkind = \"tracker\"\n[operator.third]\nkind = \"predictor\"\n\
                   reads = { tracks = \"tracker\" }\n";
    let cases: [(&str, &[&str]); 6] = [
        (
            "[operator.predictor]\nruntime = { fixed_ms = 3 }\n[operator.tracker]\nkind = \"trackr\"\n",
            &["c.toml:4: operator.tracker.kind: unknown kind `trackr`"],
        ),
        (
            "[operator.predictor]\nreads = { tracks = \"mine\" }\n[operator.mine]\nkind = \"trackr\"\n",
            &["c.toml:4: operator.mine.kind: unknown kind `trackr`"],
        ),
        (
            "[operator.planner]\nreads = { predictions = \"predictr\" }\n[operator.mine]\nkind = \"trackr\"\n",
            &[
                "c.toml:2: operator.planner.reads.predictions: unknown stream `predictr`",
                "c.toml:4: operator.mine.kind: unknown kind `trackr`",
            ],
        ),
        (
            "[operator.obstacles]\nenabled = false\n[perception]\ndetector = \"truht\"\n",
            &["c.toml:4: perception.detector: unknown detector `truht`"],
        ),
        (
            several,
            &[
                "c.toml:1: operator.second: several streams carry `TrackList`: name one of \"tracker\", \"second\" \
                 in [operator.predictor] reads = { tracks = \"...\" }",
                "c.toml:3: operator.third: several streams carry `PredictionList`",
            ],
        ),
        (
            "[operator.second]\nkind = \"pose_sensor\"\n",
            &[
                "c.toml:1: operator.second: several streams carry `EgoState`: name one of \"pose\", \"second\" in \
               [operator.router] reads = { ego = \"...\" }, [operator.behaviour] reads = { poses = \"...\" }, \
               [operator.planner] reads = { poses = \"...\" }, [operator.controller] reads = { ego = \"...\" }",
            ],
        ),
    ];
    for (text, expected) in cases {
        let problems = read(text, &[]).err().unwrap_or_default();
        let are_expected = problems.iter().zip(expected).all(|(problem, start)| problem.starts_with(start));
        assert!(are_expected && problems.len() == expected.len(), "{expected:#?}\n{problems:#?}");
    }
}

#[test]
fn every_kind_has_a_description() {
    let registry = Registry::standard();
    for kind in registry.kinds() {
        let node = kind.node();
        assert!(node.doc.len() > 8 && !node.doc.ends_with('.'), "{}: {}", node.kind, node.doc);
        assert!(node.kind.bytes().all(|b| b.is_ascii_lowercase() || b == b'_'), "{}", node.kind);
    }
    assert!(registry.kinds().count() >= 30);
}

/// Configurations that are documented not to give the stack the simulator's truth about other road users.
#[test]
fn stack_reads_no_truth_in_sensor_only_configurations() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
    let told = |file: &str| -> Vec<String> {
        let document = Document::read(&folder.join(file)).unwrap();
        let assembly = Assembly::new(&Setup::from_document(&document, &[]).unwrap()).unwrap();
        let is_truth = |edge: &Edge| {
            let (by, output) = assembly.stream(&edge.stream).unwrap();
            let [world, around] = [PayloadType::of::<WorldState>(), PayloadType::of::<Surroundings>()];
            let [points, echoes] = [PayloadType::of::<PointInstances>(), PayloadType::of::<RadarSources>()];
            let truths = [world, around, points, echoes];
            // Of a camera's images only the colour image is available to a real camera.
            let drawn = ["depth", "semantic", "instance"].iter().any(|end| edge.stream.ends_with(end));
            truths.contains(&output.port.payload) || drawn || by.kind.node().kind == "obstacle_sensor"
        };
        let stack = assembly.operators().iter().filter(|placed| placed.kind.node().role == Role::Stack);
        let reads = stack.flat_map(|placed| placed.inputs.iter().map(move |input| (placed, input)));
        let truths = reads.filter(|(_, input)| input.from.iter().any(is_truth));
        truths.map(|(placed, input)| format!("{}.{}", placed.name, input.port.name)).collect()
    };
    for file in NO_TRUTH {
        assert_eq!(told(file), Vec::<String>::new(), "{file}");
    }
    // The pose sensor measures the true pose; the full pipeline does not read it.
    let document = Document::read(&folder.join("full.toml")).unwrap();
    let assembly = Assembly::new(&Setup::from_document(&document, &[]).unwrap()).unwrap();
    assert_eq!(assembly.publisher::<EgoState>(), Some("localizer"));
    // The search finds truth in configurations that use it.
    assert_eq!(told("paper.toml"), ["tracker.obstacles"]);
    assert_eq!(told("detector.toml"), ["detector.surroundings"]);
}

const NO_TRUTH: [&str; 4] = ["camera_objects.toml", "lidar_objects.toml", "fused_objects.toml", "full.toml"];

const EYE: &str = "[camera.eye]\n[operator.objects]\nkind = \"camera_objects\"\n";

#[test]
fn camera_detector_problems_are_reported_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let foreign = folder.path().join("foreign.weights");
    std::fs::write(&foreign, "a text").unwrap();
    let foreign = foreign.display().to_string();
    let said = |line: &str| read(&format!("{EYE}{line}\n"), &[]).unwrap_err().join("\n");
    for (line, expected) in [
        (&*format!("detector = \"{foreign}\""), "detector: PATH: no weights of a detector: expected a file"),
        ("detector = \"stret\"", "detector: no detector `stret`; did you mean `street`?"),
        ("detector = \"acf_inria\"\nrung = \"as_it_is\"", "detector: `acf_inria`: its scores are sums"),
        ("rung = \"grund\"", "rung: no rung `grund`; did you mean `ground`?"),
        ("score_min = 2", "score_min: expected 0 to 1, found 2"),
        ("run_times_ms = { fasst = 3 }", "run_times_ms.fasst: no rung `fasst`"),
        ("runtime = { fixed_ms = 5 }\nladder = true", "runtime: the rungs of its ladder"),
    ] {
        let said = said(line).replace(&foreign, "PATH");
        assert!(said.starts_with("c.toml:4: operator.objects."), "{said}");
        assert!(said.contains(expected), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
    let whole = folder.path().join("my.weights");
    std::fs::write(&whole, swerve_vision::shipped::detector("street").unwrap().unwrap().write()).unwrap();
    let own = format!("{EYE}detector = \"{}\"\n", whole.display());
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/lane.toml");
    let untimed = Pipeline::build(&read(&own, &[]).unwrap(), &Scenario::read(&file).unwrap());
    let told = format!("{:#}", untimed.err().expect("nobody measured it"));
    assert!(told.contains("expected a run time of rung `ground`"), "{told}");
    let timed = format!("{own}run_times_ms = {{ ground = 12.5 }}\n");
    assert_eq!(read(&timed, &[]).unwrap().expected_ms(), Setup::default().expected_ms() + 12.5);
}

#[test]
fn camera_detector_ladder_ends_at_the_named_rung() {
    let text = "[sensing]\nperiod_ms = 100\n[execution]\nmodel = \"static_deadlines\"\nplanner_ms = 20\n";
    let config = read(&format!("{text}{EYE}rung = \"full\"\nladder = true\n"), &[]).unwrap();
    let objects = Assembly::new(&config).unwrap().operator("objects").unwrap().clone();
    let full = crate::config::camera_detectors::run_time("street", "full").unwrap();
    assert_eq!(objects.schedule.deadline.map(swerve_core::Span::as_ms), Some(full.most_ms()));
    assert_eq!(objects.kind.takes_ms(&objects.settings(&config)), Some([full.most_ms(); 2]));
}

#[test]
fn track_guided_detector_reads_the_tracks() {
    for (keys, tracks) in [
        ("rung = \"tracked\"", true),
        ("rung = \"tracked\"\ndetector = \"hog_street\"", true),
        ("rung = \"ground\"", false),
        ("rung = \"ground\"\nladder = true", false),
    ] {
        let tracker = "[operator.tracker]\nreads = { boxes = \"objects\" }\n";
        let assembly = assembly(&format!("{EYE}{keys}\n{tracker}"));
        let objects = assembly.operator("objects").unwrap();
        let edges =
            objects.inputs.iter().filter(|input| input.port.name == "tracks").flat_map(|input| &input.from);
        let found: Vec<_> = edges.map(|edge| (edge.stream.as_str(), edge.feedback)).collect();
        assert_eq!(found, if tracks { vec![("tracker", true)] } else { vec![] }, "{keys}");
    }
}
