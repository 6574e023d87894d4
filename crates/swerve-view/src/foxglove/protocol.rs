//! Messages of the Foxglove WebSocket protocol, as far as a server needs them that shows and is told nothing
//! (<https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>).

use data_encoding::BASE64;
use serde::Deserialize;
use serde_json::json;

/// What a client may call the protocol; the first is of today, the second of older programs. What is used of them here
/// is the same.
pub(super) const NAMES: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// A topic and the form of its messages.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Channel {
    pub(super) id: u64,
    pub(super) topic: String,
    pub(super) form: Form,
}

/// The form of a topic's messages, as MCAP's registry has them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Form {
    /// Of the messages: `protobuf`, `json`.
    pub(super) encoding: String,
    pub(super) schema_name: String,
    /// Of the schema: `protobuf`, `jsonschema`.
    pub(super) schema_encoding: String,
    pub(super) schema: Vec<u8>,
}

/// What a client asks for.
#[derive(Deserialize, Debug, PartialEq, Eq)]
#[serde(tag = "op", rename_all = "camelCase")]
pub(super) enum Asked {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    /// What is not offered here.
    #[serde(other)]
    Other,
}

#[derive(Deserialize, Debug, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    pub(super) id: u32,
    pub(super) channel_id: u64,
}

/// The first message: who serves, and that the time is the run's. Another session is another run.
pub(super) fn server_info(session: &str) -> String {
    json!({ "op": "serverInfo", "name": "swerve", "capabilities": ["time"], "sessionId": session })
        .to_string()
}

pub(super) fn advertise<'a>(channels: impl Iterator<Item = &'a Channel>) -> String {
    let channels = channels.map(|Channel { id, topic, form }| {
        // A schema in text stands as it is, one in bytes as base 64.
        let schema = match form.schema_encoding.as_str() {
            "protobuf" | "flatbuffer" => BASE64.encode(&form.schema),
            _ => String::from_utf8_lossy(&form.schema).into_owned(),
        };
        json!({
            "id": id, "topic": topic, "encoding": form.encoding, "schemaName": form.schema_name,
            "schemaEncoding": form.schema_encoding, "schema": schema,
        })
    });
    json!({ "op": "advertise", "channels": channels.collect::<Vec<_>>() }).to_string()
}

pub(super) fn unadvertise(channels: &[u64]) -> String {
    json!({ "op": "unadvertise", "channelIds": channels }).to_string()
}

/// How many messages were dropped, as a warning that takes the place of the one before.
pub(super) fn dropped(count: u64) -> String {
    let message = format!("{count} messages dropped: this viewer takes them more slowly than they come");
    json!({ "op": "status", "level": 1, "id": "dropped", "message": message }).to_string()
}

/// A message of a subscription; the time is when it was published, nanoseconds of the run.
pub(super) fn message(subscription: u32, at_ns: u64, data: &[u8]) -> Vec<u8> {
    let head = [&[1][..], &subscription.to_le_bytes(), &at_ns.to_le_bytes()];
    [head.concat().as_slice(), data].concat()
}

/// The time of the run, nanoseconds.
pub(super) fn time(at_ns: u64) -> Vec<u8> {
    [&[2][..], &at_ns.to_le_bytes()].concat()
}

/// Whether a page of this origin may look: the Foxglove app, a program on this machine, no browser at all. Any other
/// site's page could otherwise look through the browser of whoever has it open.
pub(super) fn may_look(origin: Option<&str>) -> bool {
    let Some(origin) = origin else { return true };
    let Some((scheme, place)) = origin.split_once("://") else { return false };
    let host = match place.strip_prefix('[') {
        Some(v6) => v6.split(']').next(),
        None => place.split(':').next(),
    };
    let host = host.unwrap_or_default();
    let is_foxglove = scheme == "https" && (host == "foxglove.dev" || host.ends_with(".foxglove.dev"));
    let is_here = matches!(host, "localhost" | "127.0.0.1" | "::1");
    is_foxglove || is_here || !matches!(scheme, "http" | "https")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_clients_ask_is_understood_or_passed_over() {
        let asked = |text: &str| serde_json::from_str::<Asked>(text).ok();
        let subscribe = asked(r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":3}]}"#);
        let subscriptions = vec![Subscription { id: 7, channel_id: 3 }];
        assert_eq!(subscribe, Some(Asked::Subscribe { subscriptions }));
        let unsubscribe = asked(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#);
        assert_eq!(unsubscribe, Some(Asked::Unsubscribe { subscription_ids: vec![7] }));
        assert_eq!(asked(r#"{"op":"setParameters","parameters":[]}"#), Some(Asked::Other));
        assert_eq!(asked(r#"{"op":"subscribe","subscriptions":[{"id":-1}]}"#), None);
    }

    /// The layouts of the specification's tables.
    #[test]
    fn messages_are_laid_out_as_specified() {
        assert_eq!(message(0x0102_0304, 5, b"ab"), [1, 4, 3, 2, 1, 5, 0, 0, 0, 0, 0, 0, 0, 97, 98]);
        assert_eq!(time(258), [2, 2, 1, 0, 0, 0, 0, 0, 0]);
        let form = |schema_encoding: &str, schema: &[u8]| Form {
            encoding: "protobuf".into(),
            schema_name: "a.B".into(),
            schema_encoding: schema_encoding.into(),
            schema: schema.into(),
        };
        let bytes = Channel { id: 1, topic: "/a".into(), form: form("protobuf", &[0xde, 0xad, 0xbe, 0xef]) };
        let words = Channel { id: 2, topic: "/b".into(), form: form("jsonschema", b"{}") };
        let said: serde_json::Value = serde_json::from_str(&advertise([&bytes, &words].into_iter())).unwrap();
        assert_eq!(
            (&said["channels"][0]["schema"], &said["channels"][1]["schema"]),
            (&json!("3q2+7w=="), &json!("{}"))
        );
        assert_eq!(
            (&said["channels"][0]["schemaName"], &said["channels"][1]["id"]),
            (&json!("a.B"), &json!(2))
        );
    }

    #[test]
    fn no_other_sites_page_looks() {
        for (origin, may) in [
            (None, true),
            (Some("https://app.foxglove.dev"), true),
            (Some("http://localhost:8080"), true),
            (Some("http://[::1]:8080"), true),
            (Some("file://"), true),
            (Some("https://evil.example"), false),
            (Some("https://notfoxglove.dev"), false),
            (Some("http://localhost.evil.example"), false),
            (Some("http://app.foxglove.dev"), false),
            (Some("null"), false),
        ] {
            assert_eq!(may_look(origin), may, "{origin:?}");
        }
    }
}
