//! One viewer's connection.

use std::net::TcpStream;
use std::time::Duration;

use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode, header};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError, Message, WebSocket, accept_hdr_with_config};

use super::hub::{Hub, Todo};
use super::protocol::{self, NAMES, may_look};

/// How long a viewer may take to say what it is.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long to wait for something to send before the viewer is listened to again, or for it to take more.
const TURN: Duration = Duration::from_millis(20);
/// Messages in one direction before the other one has its turn.
const AT_ONCE: usize = 64;
/// Bytes of what a viewer asks, at most.
const LONGEST: usize = 256 << 10;

/// Serves a viewer until it goes.
///
/// # Errors
/// The connection broke off, or never was one.
pub(super) fn serve(hub: &Hub, stream: TcpStream) -> Result<(), Error> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
    let socket = accept_hdr_with_config(stream, Greeting, Some(config)).map_err(|error| match error {
        HandshakeError::Failure(error) => error,
        HandshakeError::Interrupted(_) => Error::ConnectionClosed,
    })?;
    socket.get_ref().set_nonblocking(true)?;
    let id = hub.enter();
    let ended = converse(hub, id, socket);
    let (taken, dropped) = hub.leave(id);
    swerve_report::output::tell(&format!("a viewer has gone: {taken} messages sent, {dropped} dropped"));
    ended
}

/// Says whether a viewer is let in, and by which name of the protocol.
struct Greeting;

impl tungstenite::handshake::server::Callback for Greeting {
    fn on_request(self, request: &Request, mut answer: Response) -> Result<Response, ErrorResponse> {
        let refusal = |status, why: &str| {
            let mut refusal = ErrorResponse::new(Some(why.to_owned()));
            *refusal.status_mut() = status;
            refusal
        };
        let origin = request.headers().get(header::ORIGIN).map(|origin| origin.to_str().unwrap_or_default());
        if !may_look(origin) {
            return Err(refusal(StatusCode::FORBIDDEN, "another site's page asks"));
        }
        let offered = request.headers().get_all(header::SEC_WEBSOCKET_PROTOCOL).iter();
        let offered: Vec<&str> =
            offered.flat_map(|names| names.to_str().unwrap_or_default().split(',')).map(str::trim).collect();
        let Some(name) = NAMES.into_iter().find(|name| offered.contains(name)) else {
            return Err(refusal(StatusCode::BAD_REQUEST, "expected the protocol foxglove.sdk.v1"));
        };
        answer.headers_mut().insert(header::SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(name));
        Ok(answer)
    }
}

/// Whether it is only that nothing goes on at the moment.
fn must_wait(error: &Error) -> bool {
    matches!(error, Error::Io(error) if error.kind() == std::io::ErrorKind::WouldBlock)
}

fn converse(hub: &Hub, id: u64, mut socket: WebSocket<TcpStream>) -> Result<(), Error> {
    loop {
        hear(hub, id, &mut socket)?;
        match say(hub, id, &mut socket) {
            Err(error) if must_wait(&error) => std::thread::park_timeout(TURN / 4),
            said => said?,
        }
    }
}

/// Takes in what the viewer has asked by now.
fn hear(hub: &Hub, id: u64, socket: &mut WebSocket<TcpStream>) -> Result<(), Error> {
    for _ in 0..AT_ONCE {
        match socket.read() {
            // What is not understood is not offered.
            Ok(Message::Text(text)) => {
                if let Ok(asked) = serde_json::from_str(&text) {
                    hub.hear(id, asked);
                }
            }
            Ok(_) => {}
            Err(error) if must_wait(&error) => return Ok(()),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Sends what there is, as far as the viewer takes it.
fn say(hub: &Hub, id: u64, socket: &mut WebSocket<TcpStream>) -> Result<(), Error> {
    socket.flush()?;
    for count in 0..AT_ONCE {
        let wait = if count == 0 { TURN } else { Duration::ZERO };
        let Some(todo) = hub.next(id, wait) else { break };
        let message = match todo {
            Todo::Session(session, gone) => {
                if !gone.is_empty() {
                    // It is kept in any case: what must wait is what is kept after it.
                    let unadvertise = Message::text(protocol::unadvertise(&gone));
                    socket
                        .write(unadvertise)
                        .or_else(|error| must_wait(&error).then_some(()).ok_or(error))?;
                }
                Message::text(protocol::server_info(&session))
            }
            Todo::Advertise(channels) => {
                Message::text(protocol::advertise(channels.iter().map(|channel| &**channel)))
            }
            Todo::Dropped(count) => Message::text(protocol::dropped(count)),
            Todo::Time(at_ns) => Message::binary(protocol::time(at_ns)),
            Todo::Message(subscription, message) => match message.data() {
                [] => continue,
                data => Message::binary(protocol::message(subscription, message.at_ns, data)),
            },
        };
        socket.write(message)?;
    }
    socket.flush()
}
