//! Operators whose types are known at run time only.

use super::net::*;
use crate::*;

/// Publishes the sum of all its inputs, encoded in CBOR.
struct Adder;

impl AnyOperator for Adder {
    fn step(&mut self, _: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>) {
        let number = |message: &AnyMessage| *(*message.payload).as_any().downcast_ref::<i64>().unwrap();
        let sum: i64 = inputs
            .iter()
            .map(|input| match input {
                AnyInput::Nothing | AnyInput::Tick => 0,
                AnyInput::Message(message) => number(message),
                AnyInput::Window(messages) => messages.iter().map(number).sum(),
            })
            .sum();
        let mut cbor = Vec::new();
        ciborium::into_writer(&sum, &mut cbor).unwrap();
        assert_eq!(out.send_cbor(9, &cbor), Err(AnyOutputError::Port(9)));
        let wrong = out.send_cbor(0, &[0x61, b'x']).unwrap_err().to_string();
        assert!(wrong.starts_with("this is no i64: "), "{wrong}");
        out.send_cbor(0, &cbor).unwrap();
    }
}

#[test]
fn an_operator_of_any_types_reads_and_publishes_as_one_with_types() {
    let mut net = Net::new();
    net.stage("camera", tick(10)).out();
    let camera = net.graph.stream("camera").unwrap();
    assert!(net.graph.stream("nobody").is_none());
    assert!(camera.typed::<f64>().is_none());
    let inputs = [AnySource::At(camera), AnySource::Latest(camera), AnySource::Window(camera, 3)];
    let out = net.graph.add_any("adder", Adder, &inputs, &[("sum", PayloadType::of::<i64>())]);
    let sums = out[0].typed::<i64>().unwrap();
    net.stage("reader", join(&[sums])).out();
    let mut sums = Vec::new();
    let mut take = |event: &Event<'_>| {
        if let Event::Publication(Publication { operator: "adder", payload: Some(payload), .. }) = event {
            sums.push(*payload.downcast_ref::<i64>().unwrap() / 1_000_000);
        }
    };
    let report = run_virtual(net.graph, &RunOptions::until(at(30)), vec![&mut take]).unwrap();
    assert_eq!(sums, [0, 10 * 3, 20 * 3 + 10, 30 * 3 + 20 + 10]);
    assert_eq!(report.operator("reader").unwrap().messages, 4);
}

#[test]
fn an_operator_can_be_replaced_by_one_of_any_types() {
    let mut net = Net::new();
    let camera = net.stage("camera", tick(10)).out();
    net.stage("copy", join(&[camera])).out();
    assert!(net.graph.replace("nobody", Adder).is_err());
    assert_eq!(net.graph.output_types("copy").unwrap(), [PayloadType::of::<i64>()]);
    let digest = |graph| run_virtual(graph, &RunOptions::until(at(100)), vec![]).unwrap().digest;
    let mut plain = Net::new();
    let camera = plain.stage("camera", tick(10)).out();
    plain.stage("copy", join(&[camera])).out();
    net.graph.replace("copy", Adder).unwrap();
    assert_eq!(digest(net.graph), digest(plain.graph), "the sum of one stamp is that stamp");
}
