//! Recorded exchanges with SUMO 1.28.0: the requests byte for byte, and the meaning of the answers.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use swerve_msg::ActorId;
use swerve_tests::data_or_skip;

use crate::client::Client;
use crate::states::{Names, state};
use crate::{Answer, Command, Domain, Insertion, LIGHT_STATE, SumoError, Value};

/// Requests and answers.
fn exchanges() -> Option<Vec<[Vec<u8>; 2]>> {
    let path = data_or_skip("worlds/sumo/made/traci_transcript.jsonl")?;
    let text = std::fs::read_to_string(path).unwrap();
    let bytes = |hex: &str| -> Vec<u8> {
        (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
    };
    let one = |line: &str| {
        let value: serde_json::Value = serde_json::from_str(line).unwrap();
        ["request", "response"].map(|key| bytes(value[key].as_str().unwrap()))
    };
    Some(text.lines().map(one).collect())
}

/// A client of a peer that answers the recorded requests, and fails on others.
fn client(exchanges: Vec<[Vec<u8>; 2]>) -> (Client, std::thread::JoinHandle<usize>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let server = std::thread::spawn(move || {
        let (mut peer, _) = listener.accept().unwrap();
        for (k, [request, answer]) in exchanges.iter().enumerate() {
            let mut found = vec![0; request.len()];
            peer.read_exact(&mut found).unwrap();
            assert_eq!(found, *request, "exchange {k}");
            peer.write_all(answer).unwrap();
        }
        exchanges.len()
    });
    (Client::new(stream, Duration::from_secs(20)).unwrap(), server)
}

fn text(texts: &Answer) -> Vec<String> {
    let Answer::Value(Value::Texts(texts)) = texts else { panic!("{texts:?}") };
    texts.clone()
}

#[test]
fn recorded_exchanges_are_repeated_byte_for_byte() {
    let Some(exchanges) = exchanges() else { return };
    let (mut client, server) = client(exchanges);
    let mut ask = |command: Command| client.ask(command);
    assert_eq!(ask(Command::version()), Ok(Answer::Version(22, "SUMO 1.28.0".to_owned())));
    assert_eq!(ask(Command::order(1)), Ok(Answer::Done));
    assert_eq!(ask(Command::step(20.0)), Ok(Answer::Subscribed(Vec::new())));
    let vehicles = text(&ask(Command::get(Domain::Vehicle, 0x00, "")).unwrap());
    assert_eq!((vehicles.len(), &*vehicles[0]), (12, "a.0"));
    assert_eq!(text(&ask(Command::get(Domain::Light, 0x00, "")).unwrap()), ["C"]);
    let found = ask(Command::get(Domain::Light, LIGHT_STATE, "C")).unwrap();
    let Answer::Value(Value::Text(letters)) = &found else { panic!("{found:?}") };
    assert_eq!(letters.len(), 18);
    assert_eq!(text(&ask(Command::get(Domain::Light, 0x26, "C")).unwrap()).len(), 18);
    let links = ask(Command::get(Domain::Light, 0x27, "C")).unwrap();
    let Answer::Value(Value::Compound(parts)) = links else { panic!("{links:?}") };
    assert_eq!(parts[2], Value::Texts(["NC_0", "CW_0", ":C_0_0"].map(str::to_owned).to_vec()));
    let insertion =
        Insertion { route: "we", kind: "idm", depart: ["0", "20", "0"], arrive: ["10", "max", "current"] };
    // The recorded request has the lane of arrival before its place.
    assert_eq!(ask(Command::add_vehicle("ego", &insertion)), Ok(Answer::Done));
    assert_eq!(ask(Command::step(0.0)), Ok(Answer::Subscribed(Vec::new())));
    let light = ask(Command::light_states("C")).unwrap();
    let Answer::Subscribed(light) = light else { panic!("{light:?}") };
    assert_eq!((&*light[0].name, light[0].objects[0].1.len()), ("C", 1));
    let variables = [0x42, 0x43, 0x40, 0x44, 0x4d, 0x4f, 0x5b];
    let around = ask(Command::vehicles_around("ego", 150.0, &variables)).unwrap();
    let Answer::Subscribed(around) = around else { panic!("{around:?}") };
    assert!(around[0].objects.iter().all(|(_, values)| values.len() == variables.len()));
    for k in 1..=60 {
        let x_m = -170.0 + 0.5 * f64::from(k);
        let answers = client.send(&[Command::move_to("ego", [x_m, -4.8], 90.0), Command::step(0.0)]).unwrap();
        let [Answer::Done, Answer::Subscribed(results)] = &answers[..] else { panic!("{answers:?}") };
        let around = results.iter().find(|result| result.name == "ego").unwrap();
        let (_, own) = around.objects.iter().find(|(name, _)| name == "ego").unwrap();
        let Some(Value::Position([x, _])) = own.get(&0x42) else { panic!("{own:?}") };
        assert!((x - x_m).abs() < 1e-6, "the ego is at {x} m, moved to {x_m} m");
        // Heights and classes were not recorded.
        assert!(state(&around.objects, "ego", [0.0; 2], &mut Names::from(ActorId(1))).is_err());
    }
    let refused = client.ask(Command::get(Domain::Vehicle, 0x42, "nobody"));
    assert!(
        matches!(&refused, Err(SumoError::Refused { command: 0xa4, why }) if why.contains("nobody")),
        "{refused:?}"
    );
    for variable in [0x7a, 0x81] {
        text(&client.ask(Command::get(Domain::Simulation, variable, "")).unwrap());
    }
    assert_eq!(client.ask(Command::close()), Ok(Answer::Done));
    assert_eq!(server.join().unwrap(), 76);
}

/// Every answer of the transcript, cut at every byte and with single bytes changed.
#[test]
fn damaged_answers_are_errors() {
    let Some(exchanges) = exchanges() else { return };
    let mut refused = 0;
    for [request, answer] in &exchanges[..20] {
        let id = request[5];
        let commands: Vec<Command> = match id {
            0xc4 if request[6] == 0xb4 => {
                vec![Command::move_to("ego", [0.0; 2], 90.0), Command::step(0.0)]
            }
            _ => vec![Command { id, ..Command::close() }],
        };
        let body = &answer[4..];
        assert!(crate::client::answers(&commands, body).is_ok(), "command 0x{id:02x}");
        for at in 0..body.len() {
            assert!(
                crate::client::answers(&commands, &body[..at]).is_err(),
                "command 0x{id:02x} cut at {at}"
            );
            let mut changed = body.to_vec();
            changed[at] ^= 0xff;
            refused += usize::from(crate::client::answers(&commands, &changed).is_err());
        }
    }
    println!("{refused} changed answers are refused");
    assert!(refused > 1_000);
}
