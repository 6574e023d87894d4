//! One viewer and the feeding of its server.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use swerve_foxglove::{Listener, Server};

use super::gate::{Count, Knock, Taken};
use super::hub::{Hub, Todo};

/// Time to wait for an item to send, or for the viewer to read, before the other is checked.
const TURN: Duration = Duration::from_millis(20);
/// Time that a new session waits for messages of the previous one in flight.
const PATIENCE: Duration = Duration::from_secs(1);
/// Maximum number of messages in flight to a viewer,
const UNDER_WAY: u64 = 256;
/// and approximate maximum of their bytes. Further messages wait in the hub, which drops and counts the oldest of a
/// topic.
const UNDER_WAY_BYTES: u64 = 4 << 20;
/// Bytes of a message besides its data: opcode, subscription and time; a time message has nine.
const MESSAGE_HEAD: u64 = 13;
const TIME_BYTES: u64 = 9;

struct Ears {
    hub: Arc<Hub>,
    id: u64,
}

impl Listener for Ears {
    fn subscribe(&self, topic: &str) {
        self.hub.subscribe(self.id, topic);
    }

    fn unsubscribe(&self, topic: &str) {
        self.hub.unsubscribe(self.id, topic);
    }
}

/// Serves a viewer until it disconnects.
///
/// # Errors
/// If the connection failed or was not a WebSocket.
pub(super) fn serve(hub: &Arc<Hub>, knock: Knock) -> io::Result<()> {
    let (id, session) = hub.enter();
    let listener = Ears { hub: Arc::clone(hub), id };
    // Twice: times and messages have separate queues, and neither may ever be full.
    let started = Server::start(&session, 2 * UNDER_WAY as usize, listener).map_err(io::Error::other);
    let ended = started.and_then(|server| {
        let (at, count) = (server.at(), Count::default());
        std::thread::scope(|scope| {
            scope.spawn(|| feed(hub, id, server, &count));
            let ended = knock.lead_to(at, &count);
            count.close();
            ended
        })
    });
    let (taken, dropped) = hub.leave(id);
    swerve_report::output::tell(&format!("a viewer has gone: {taken} messages sent, {dropped} dropped"));
    ended
}

/// Feeds the server with items for the viewer at the rate at which it reads.
fn feed(hub: &Hub, id: u64, mut server: Server, count: &Count) {
    let (mut messages, mut bytes) = (0, 0);
    loop {
        let is_full =
            |taken: &Taken| messages - taken.messages >= UNDER_WAY || bytes - taken.bytes >= UNDER_WAY_BYTES;
        let taken = count.wait_while(is_full, TURN);
        if taken.is_gone {
            return;
        }
        if is_full(&taken) {
            continue;
        }
        match hub.next(id, TURN) {
            None => {}
            Some(Todo::Session(session)) => {
                // Messages in flight belong to the previous session: a viewer that reads gets them before the next.
                let taken = count.wait_while(|taken| taken.messages < messages, PATIENCE);
                (messages, bytes) = (taken.messages, taken.bytes);
                server.begin(&session);
            }
            Some(Todo::Offer(topic, form)) => {
                // Without the topic it is useless to this viewer, but the rest continues.
                let _is_understood = server.offer(&topic, &form);
            }
            Some(Todo::Dropped(dropped)) => server.tell_dropped(dropped),
            Some(Todo::Time(at_ns)) => {
                server.tell_time(at_ns);
                (messages, bytes) = (messages + 1, bytes + TIME_BYTES);
            }
            Some(Todo::Message(topic, message)) => {
                let data = message.data();
                // Nothing to show, or no subscriber: a viewer that has unsubscribed meanwhile is sent nothing.
                if !data.is_empty() && server.send(&topic, message.at_ns, data) {
                    (messages, bytes) = (messages + 1, bytes + MESSAGE_HEAD + data.len() as u64);
                }
            }
        }
    }
}
