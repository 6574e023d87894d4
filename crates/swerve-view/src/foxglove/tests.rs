//! Viewers that subscribe, connect late, are slow, or are refused.

use std::collections::BTreeMap;
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};
use swerve_foxglove::Form;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Message as Frame, WebSocket};

use super::hub::{Hub, Message};
use super::listen;

/// A client written from the protocol's specification.
pub(crate) struct Client {
    socket: WebSocket<TcpStream>,
    /// Topics and their channels.
    pub(crate) channels: BTreeMap<String, Value>,
    session: String,
    /// Messages received: subscription number, time, bytes.
    pub(crate) messages: Vec<(u32, u64, Vec<u8>)>,
    times: Vec<u64>,
    dropped: u64,
}

/// A server on a free port.
fn serving() -> (Arc<Hub>, String) {
    let hub = Arc::new(Hub::new("test".into()));
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let shared = Arc::clone(&hub);
    std::thread::spawn(move || listen(&shared, &listener));
    (hub, address)
}

impl Client {
    fn try_connect(address: &str, name: &'static str, origin: Option<&'static str>) -> Result<Self, u16> {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        let mut request = format!("ws://{address}/").into_client_request().unwrap();
        request.headers_mut().insert("sec-websocket-protocol", name.parse().unwrap());
        if let Some(origin) = origin {
            request.headers_mut().insert("origin", origin.parse().unwrap());
        }
        match tungstenite::client(request, stream) {
            Ok((socket, _)) => Ok(Self {
                socket,
                channels: BTreeMap::new(),
                session: String::new(),
                messages: Vec::new(),
                times: Vec::new(),
                dropped: 0,
            }),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
                Err(answer.status().as_u16())
            }
            Err(error) => panic!("{error}"),
        }
    }

    pub(crate) fn connect(address: &str) -> Self {
        Self::try_connect(address, "foxglove.sdk.v1", None).unwrap()
    }

    /// Receives until `enough` holds.
    pub(crate) fn until(&mut self, enough: impl Fn(&Self) -> bool) {
        while !enough(self) {
            match self.socket.read().unwrap() {
                Frame::Text(text) => self.take_text(&serde_json::from_str(&text).unwrap()),
                Frame::Binary(bytes) => {
                    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
                    match bytes[0] {
                        1 => {
                            let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
                            self.messages.push((subscription, u64_at(5), bytes[13..].to_vec()));
                        }
                        2 => self.times.push(u64_at(1)),
                        other => panic!("operation {other}"),
                    }
                }
                other => panic!("{other}"),
            }
        }
    }

    fn take_text(&mut self, said: &Value) {
        match said["op"].as_str().unwrap() {
            "serverInfo" => said["sessionId"].as_str().unwrap().clone_into(&mut self.session),
            "advertise" => {
                for channel in said["channels"].as_array().unwrap() {
                    self.channels.insert(channel["topic"].as_str().unwrap().into(), channel.clone());
                }
            }
            "unadvertise" => {
                let gone = said["channelIds"].as_array().unwrap();
                self.channels.retain(|_, channel| !gone.contains(&channel["id"]));
            }
            // A subscription to an unknown channel is answered with a separate status.
            "status" if said["id"] != "dropped" => {}
            "status" => {
                let message = said["message"].as_str().unwrap();
                self.dropped = message.split(' ').next().unwrap().parse().unwrap();
            }
            other => panic!("{other}"),
        }
    }

    pub(crate) fn subscribe(&mut self, id: u32, topic: &str) {
        let channel = &self.channels[topic]["id"];
        let ask = json!({ "op": "subscribe", "subscriptions": [{ "id": id, "channelId": channel }] });
        self.socket.send(Frame::text(ask.to_string())).unwrap();
    }
}

fn form() -> Form {
    Form {
        encoding: "json".into(),
        schema_name: "Number".into(),
        schema_encoding: "jsonschema".into(),
        schema: br#"{"type":"object"}"#.to_vec(),
    }
}

/// A message with its time as content, encoded only when read.
fn publish(hub: &Hub, topic: &str, at_ns: u64, bytes: usize) {
    let make = move || {
        let mut data = at_ns.to_string().into_bytes();
        data.resize(bytes.max(data.len()), b' ');
        data
    };
    hub.publish(topic, form, Message::new(at_ns, bytes, Box::new(make)));
}

#[test]
fn viewer_receives_its_subscriptions() {
    let (hub, address) = serving();
    hub.begin();
    publish(&hub, "/view/ground", 0, 1);
    let mut client = Client::connect(&address);
    client.until(|client| client.channels.contains_key("/view/ground"));
    let channel = &client.channels["/view/ground"];
    assert_eq!((&channel["schemaName"], &channel["encoding"]), (&json!("Number"), &json!("json")));
    assert_eq!(channel["schema"], r#"{"type":"object"}"#);
    // Earlier messages of once-per-run topics are available to it too.
    client.subscribe(7, "/view/ground");
    client.until(|client| client.messages.len() == 1);
    assert_eq!(client.messages[0], (7, 0, b"0".to_vec()));
    publish(&hub, "/view/ego", 20_000_000, 1);
    client.until(|client| client.channels.contains_key("/view/ego"));
    client.subscribe(8, "/view/ego");
    client.until(|client| client.messages.len() == 2);
    for k in 2..100 {
        publish(&hub, "/view/ego", k * 20_000_000, 1);
        publish(&hub, "/view/ground", k * 20_000_000, 1);
        // A viewer that is too slow on a busy host loses some.
        client.until(|client| client.messages.len() as u64 == 2 * k);
    }
    client.until(|client| client.times.last() >= Some(&(99 * 20_000_000)));
    let of = |id: u32| client.messages.iter().filter(move |(of, ..)| *of == id).map(|(_, at, _)| *at);
    assert!(of(8).eq((1..100).map(|k| k * 20_000_000)) && client.messages.is_sorted_by_key(|m| m.1));
    assert!(client.times.is_sorted(), "{:?}", client.times);
    assert_eq!(client.dropped, 0);
    let said = json!({ "op": "unsubscribe", "subscriptionIds": [7, 8] });
    client.socket.send(Frame::text(said.to_string())).unwrap();
    client.socket.send(Frame::text("{\"op\":\"setParameters\"} nonsense")).unwrap();
    client.subscribe(9, "/view/ground");
    client.until(|client| client.messages.last().is_some_and(|m| m.0 == 9));
    publish(&hub, "/view/ego", 1 << 40, 1);
    publish(&hub, "/view/ground", 1 << 40, 1);
    client.until(|client| client.messages.last().is_some_and(|m| m.1 == 1 << 40));
    assert_ne!(client.messages.last().unwrap().0, 8, "it has unsubscribed");
}

#[test]
fn another_run_is_a_new_session_with_new_channels() {
    let (hub, address) = serving();
    hub.begin();
    publish(&hub, "/view/ego", 5, 1);
    let mut client = Client::connect(&address);
    client.until(|client| client.channels.len() == 1);
    client.subscribe(1, "/view/ego");
    client.until(|client| client.messages.len() == 1);
    let (session, channel) = (client.session.clone(), client.channels["/view/ego"]["id"].clone());
    hub.begin();
    publish(&hub, "/view/ego", 3, 1);
    client.until(|client| client.session != session && client.channels.len() == 1);
    assert_ne!(client.channels["/view/ego"]["id"], channel);
    // The old subscription has ended, and its number is free.
    client.subscribe(1, "/view/ego");
    client.until(|client| client.messages.len() == 2);
    assert_eq!(client.messages[1], (1, 3, b"3".to_vec()));
}

/// The publisher never waits; messages lost and received by the slow viewer add up to all.
#[test]
fn slow_viewer_loses_the_oldest_messages_and_gets_their_count() {
    const COUNT: u64 = 1000;
    let (hub, address) = serving();
    hub.begin();
    publish(&hub, "/view/points", 0, 1);
    let mut slow = Client::connect(&address);
    slow.until(|client| client.channels.len() == 1);
    slow.subscribe(1, "/view/points");
    slow.until(|client| client.messages.len() == 1);
    // 200 MB: far more than the socket buffers of a connection.
    for at_ns in 1..=COUNT {
        publish(&hub, "/view/points", at_ns, 200_000);
    }
    slow.until(|client| client.messages.len() as u64 - 1 + client.dropped == COUNT);
    assert!(slow.dropped > COUNT / 2, "{}", slow.dropped);
    assert_eq!(slow.messages.last().unwrap().1, COUNT, "the newest is not lost");
    assert!(slow.messages.is_sorted_by_key(|m| m.1));
}

#[test]
fn foreign_origins_and_protocols_are_refused() {
    let (_hub, address) = serving();
    let refused = |name, origin| Client::try_connect(&address, name, origin).err();
    assert_eq!(refused("foxglove.sdk.v1", Some("https://evil.example")), Some(403));
    assert_eq!(refused("foxglove.sdk.v1", Some("null")), Some(403));
    assert_eq!(refused("chat", None), Some(400));
    assert_eq!(refused("foxglove.sdk.v1", Some("https://app.foxglove.dev")), None);
    assert_eq!(refused("foxglove.websocket.v1", Some("http://localhost:8080")), None);
}
