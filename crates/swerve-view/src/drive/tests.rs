use super::*;
use crate::foxglove::tests::Client;
use crate::server::tests::post;
use crate::show::Ask;

fn begins() -> Arc<Begins> {
    let set = vec!["operator.planner.runtime={fixed_ms=30}".into()];
    let scenario = "person_behind_truck".into();
    let input = RunInput { scenario, config: Vec::new(), set, seed: Some(3), allow_code: false };
    Arc::new(Begins::new(Registry::standard(), input))
}

/// Digest of a drive with spectators.
fn digest(show: &Show, begins: Arc<Begins>, streams: Option<Streams>) -> String {
    let summarise = |_: &Setup, _: &Scenario, _: &swerve_drive::Outcome| Ok("{}".to_owned());
    let driver = Driver { begins, summarise: &summarise, show, streams };
    let (over, page) = driver.drive(&Begin::default()).unwrap();
    assert!(page.is_some());
    over.digest.unwrap()
}

#[test]
fn viewers_do_not_affect_the_run_however_slow() {
    let alone = digest(&Show::new(None, false), begins(), None);
    let (streams, address) = Streams::start("127.0.0.1:0".parse().unwrap()).unwrap();
    let show = Arc::new(Show::new(None, true));
    let begins = begins();
    let driving = {
        let (show, begins) = (Arc::clone(&show), Arc::clone(&begins));
        std::thread::spawn(move || digest(&show, begins, Some(streams)))
    };
    let address = address.strip_prefix("ws://").unwrap();
    let (mut quick, mut asleep) = (Client::connect(address), Client::connect(address));
    for client in [&mut quick, &mut asleep] {
        // The run holds at the first pose; the topics up to then are advertised.
        client.until(|client| client.channels.contains_key("/view/ground"));
        let topics: Vec<String> = client.channels.keys().cloned().collect();
        topics.iter().zip(1..).for_each(|(topic, id)| client.subscribe(id, topic));
    }
    quick.until(|client| !client.messages.is_empty());
    // Nor does an invalid request: it is answered with an error, and the run continues.
    for (set, why) in [
        ("sensing.rang_m=20", "did you mean `range_m`?"),
        ("actor.nobody.speed_mps=1", "nobody"),
        ("sensing", "expected key=value"),
        ("clock.source=\\\"wall\\\"", "virtual time"),
    ] {
        for from in ["", ",\"from_s\":1"] {
            let answer = post(&show, &begins, &format!("{{\"do\":\"restart\",\"set\":[\"{set}\"]{from}}}"));
            assert!(answer.starts_with("400 ") && answer.contains(why), "{set}: {answer}");
        }
    }
    show.ask(Ask::Go).unwrap();
    assert_eq!(driving.join().unwrap(), alone);
    // The fast one receives the drive to its end, in the formats of a log; the slow one never read anything.
    for topic in ["/view/ego", "/view/actors", "/view/tracks", "/view/plan", "/view/figures", "/view/log"] {
        quick.until(|client| client.channels.contains_key(topic));
        let (schema, encoding) = (&quick.channels[topic]["schemaName"], &quick.channels[topic]["encoding"]);
        assert!(schema.as_str().is_some_and(|name| name.contains('.')), "{topic} {schema}");
        assert_eq!(encoding, "protobuf", "{topic}");
    }
    assert!(quick.channels["/view/ego"]["schema"].as_str().is_some_and(|schema| schema.len() > 100));
    drop(asleep);
}
