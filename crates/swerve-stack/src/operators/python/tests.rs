use swerve_scenario::Scenario;
use swerve_text::Document;

use super::*;
use crate::Assembly;
use crate::pipeline::Pipeline;
use crate::setup::Setup;

/// A detector added by the configuration only, and a process that runs it.
const DETECTOR: &str = "
[camera.front]
[operator.finder]
kind = 'python'
inputs = { poses = 'window(16) EgoState', image = 'Image' }
outputs = { boxes = 'Detections', health = 'SensorHealth' }
period_ms = 500
reads = { image = 'front.rgb' }
runtime = { fixed_ms = 30 }
[process.finder]
operators = ['finder']
start = ['python3', '-m', 'swerve', 'worker', 'finder.py:Finder']
";

fn read(text: &str) -> Result<Setup, Vec<String>> {
    let document = Document::parse("c.toml", text).unwrap();
    Setup::from_document(&document, &[])
        .map_err(|problems| problems.iter().map(ToString::to_string).collect())
}

#[test]
fn python_ports_are_declared_by_the_configuration() {
    let config = read(DETECTOR).unwrap_or_else(|problems| panic!("{problems:#?}"));
    let assembly = Assembly::new(&config).unwrap();
    let finder = assembly.operator("finder").unwrap();
    let reads = |input: &crate::assembly::Input| {
        let streams: Vec<&str> = input.from.iter().map(|edge| edge.stream.as_str()).collect();
        (input.port.name.to_string(), input.port.mode, streams.join(" "))
    };
    let expected = [
        ("image".to_owned(), PortMode::At, "front.rgb".to_owned()),
        ("poses".to_owned(), PortMode::Window(16), "pose".to_owned()),
        ("tick".to_owned(), PortMode::Every, String::new()),
    ];
    assert_eq!(finder.inputs.iter().map(reads).collect::<Vec<_>>(), expected);
    let streams: Vec<&str> = finder.outputs.iter().map(|output| output.stream.as_str()).collect();
    assert_eq!(streams, ["finder.boxes", "finder.health"]);
    let tracker = assembly.operator("tracker").unwrap();
    let boxes = tracker.inputs.iter().find(|input| input.port.name == "boxes").expect("it reads detections");
    assert_eq!(boxes.from[0].stream, "finder.boxes", "the tracker takes what is detected");
}

#[test]
fn printed_configuration_declares_the_same_ports() {
    let config = read(DETECTOR).unwrap();
    let lane = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/lane.toml");
    let lane = Scenario::read(std::path::Path::new(lane)).unwrap();
    let before = Pipeline::build_without_stage(&config, &lane).unwrap();
    let printed = before.assembly.to_toml(&config, &before.graph.describe().unwrap());
    let again = read(&printed).unwrap_or_else(|problems| panic!("{problems:#?}\n{printed}"));
    let (before, again) = (before.assembly, Assembly::new(&again).unwrap());
    let (was, is) = (before.operator("finder").unwrap(), again.operator("finder").unwrap());
    assert_eq!((&is.inputs, &is.outputs, &is.own.runtime), (&was.inputs, &was.outputs, &was.own.runtime));
}

#[test]
fn python_problems_are_reported_with_line_and_key() {
    let process = "[process.p]\noperators = [\"o\"]\nstart = [\"python3\"]\n";
    let cases = [
        (
            "inputs = { a = \"Imgae\" }",
            "c.toml:3: operator.o.inputs.a: unknown message `Imgae`, expected one of",
        ),
        ("inputs = { a = \"Imgae\" }", "; did you mean `Image`?"),
        ("inputs = { a = \"newest Image\" }", "expected MESSAGE, latest MESSAGE or window(N) MESSAGE"),
        ("inputs = { a = \"window(0) Image\" }", "with N from 1 to 4096, found `window(0) Image`"),
        ("inputs = { a = \"latest EgoState\" }", "c.toml:3: operator.o.inputs: nothing makes it step"),
        ("outputs = { b = \"Box\" }", "c.toml:3: operator.o.outputs.b: unknown message `Box`"),
        ("inputs = { tick = \"EgoState\" }", "operator.o.inputs.tick: the timer's port has this name"),
        ("inputs = { \"a-b\" = \"EgoState\" }", "expected a name of letters, digits and underscores"),
        (
            "inputs = { a = \"EgoState\" }\ndeadline = { ms = 5.0, reaction = \"on_deadline\" }",
            "c.toml:4: operator.o.deadline.reaction: an operator in Python has no answer to a missed deadline",
        ),
        ("period_ms = 0.5", "c.toml:3: operator.o.period_ms: expected 1 to 10000, found 0.5"),
        ("input = { a = \"Image\" }", "operator.o.input: unknown key"),
        (
            "inputs = { a = \"Image\" }",
            "operator.o.reads.a: reads `Image`, which no operator publishes: `[camera.NAME]` adds one",
        ),
    ];
    for (keys, expected) in cases {
        let told = read(&format!("[operator.o]\nkind = \"python\"\n{keys}\n{process}")).unwrap_err();
        assert!(told.iter().any(|line| line.contains(expected)), "{keys}: {told:#?}");
    }
    let good = "[operator.o]\nkind = \"python\"\ninputs = { ego = \"EgoState\" }\n";
    let told = read(good).unwrap_err();
    assert!(told[0].starts_with("c.toml:2: operator.o.kind: its steps are taken by a process"), "{told:?}");
    let told = read(&format!("{good}[process.p]\noperators = [\"o\"]\n")).unwrap_err();
    let expected =
        "c.toml:5: process.p.operators[0]: `o` is written in Python: expected `python = \"FILE.py:Class\"`";
    assert_eq!(told, [expected]);
    assert_eq!(read(&format!("{good}{process}")).err(), None);
}

/// Python reads streams by its message classes, which are generated from the same types.
#[test]
fn python_has_a_class_of_every_message() {
    let classes = include_str!("../../../../../python/swerve/messages.py");
    for message in Registry::standard().messages() {
        assert!(classes.contains(&format!("\nclass {message}(Message):")), "there is no class {message}");
    }
}
