//! One viewer, and its server fed.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use swerve_foxglove::{Listener, Server};

use super::gate::{Count, Knock, Taken};
use super::hub::{Hub, Todo};

/// How long to wait for something to send, or for the viewer to take more, before the other is looked at.
const TURN: Duration = Duration::from_millis(20);
/// How long another session waits for what is under way of the one before.
const PATIENCE: Duration = Duration::from_secs(1);
/// Messages under way to a viewer, at most,
const UNDER_WAY: u64 = 256;
/// and about how many bytes of them. What is more waits in the hub, which drops the oldest of a topic and counts.
const UNDER_WAY_BYTES: u64 = 4 << 20;
/// Bytes of a message beside its data: operation, subscription and time; a time alone has nine.
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

/// Serves a viewer until it goes.
///
/// # Errors
/// The connection broke off, or never was one.
pub(super) fn serve(hub: &Arc<Hub>, knock: Knock) -> io::Result<()> {
    let (id, session) = hub.enter();
    let listener = Ears { hub: Arc::clone(hub), id };
    // Twice: times and messages wait in queues of their own, and neither may ever be full.
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

/// Hands the server what there is for the viewer, as fast as the viewer takes it.
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
                // What is under way is of the session before: a viewer that takes it gets it before the next.
                let taken = count.wait_while(|taken| taken.messages < messages, PATIENCE);
                (messages, bytes) = (taken.messages, taken.bytes);
                server.begin(&session);
            }
            Some(Todo::Offer(topic, form)) => {
                // Of no use to a viewer without, and no reason to stop the rest.
                let _is_understood = server.offer(&topic, &form);
            }
            Some(Todo::Dropped(dropped)) => server.tell_dropped(dropped),
            Some(Todo::Time(at_ns)) => {
                server.tell_time(at_ns);
                (messages, bytes) = (messages + 1, bytes + TIME_BYTES);
            }
            Some(Todo::Message(topic, message)) => {
                let data = message.data();
                // Nothing to show, or nobody: whoever has unsubscribed meanwhile is sent nothing.
                if !data.is_empty() && server.send(&topic, message.at_ns, data) {
                    (messages, bytes) = (messages + 1, bytes + MESSAGE_HEAD + data.len() as u64);
                }
            }
        }
    }
}
