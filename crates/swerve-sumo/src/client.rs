//! Client of TraCI, the protocol over which SUMO is controlled.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use crate::SumoError;
use crate::wire::{self, Bytes, Command, MESSAGE_MAX, Value};

/// Values of one object by variable.
pub type Values = BTreeMap<u8, Value>;

/// Most objects that a subscription may return in a step.
pub(crate) const OBJECTS_MAX: usize = 20_000;

/// Answer to a command.
#[derive(Clone, PartialEq, Debug)]
pub enum Answer {
    /// It was executed.
    Done,
    /// Version of the protocol, and of the program.
    Version(i32, String),
    /// The value that was asked for.
    Value(Value),
    /// Results of subscriptions, of a step or of the subscription itself.
    Subscribed(Vec<Subscribed>),
}

/// Result of a subscription.
#[derive(Clone, PartialEq, Debug)]
pub struct Subscribed {
    /// Object of the subscription.
    pub name: String,
    /// Objects around it, or itself alone, with their variables, in the order of the answer.
    pub objects: Vec<(String, Values)>,
}

/// Connection to SUMO.
#[derive(Debug)]
pub struct Client {
    stream: TcpStream,
    /// Longest time of an answer.
    timeout: Duration,
}

impl Client {
    /// Uses an open connection; an answer may take `timeout`.
    ///
    /// # Errors
    /// If the connection has no timeouts.
    pub fn new(stream: TcpStream, timeout: Duration) -> Result<Self, SumoError> {
        let set = stream.set_nodelay(true).and_then(|()| stream.set_read_timeout(Some(timeout)));
        let set = set.and_then(|()| stream.set_write_timeout(Some(timeout)));
        set.map_err(|error| SumoError::Ended(error.to_string()))?;
        Ok(Self { stream, timeout })
    }

    /// Sends commands in one message; returns the answer to each.
    ///
    /// # Errors
    /// A command that SUMO refuses, a lost connection, no answer in time, or bytes that are no answer.
    pub fn send(&mut self, commands: &[Command]) -> Result<Vec<Answer>, SumoError> {
        let lost = |error: &std::io::Error, timeout: Duration| match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => SumoError::Silent(timeout.as_secs()),
            ErrorKind::UnexpectedEof | ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => {
                SumoError::Ended("it closed the connection".to_owned())
            }
            _ => SumoError::Ended(error.to_string()),
        };
        let timeout = self.timeout;
        self.stream.write_all(&wire::message(commands)).map_err(|error| lost(&error, timeout))?;
        let mut head = [0; 4];
        self.stream.read_exact(&mut head).map_err(|error| lost(&error, timeout))?;
        let length = u32::from_be_bytes(head) as usize;
        let length = length
            .checked_sub(4)
            .filter(|length| *length <= MESSAGE_MAX)
            .ok_or_else(|| SumoError::Answer(format!("a message of {length} bytes")))?;
        let mut body = Vec::new();
        let read = (&mut self.stream).take(length as u64).read_to_end(&mut body);
        read.map_err(|error| lost(&error, timeout))?;
        if body.len() < length {
            return Err(SumoError::Ended("it closed the connection within an answer".to_owned()));
        }
        answers(commands, &body)
    }

    /// Sends one command.
    ///
    /// # Errors
    /// As [`send`](Self::send).
    pub fn ask(&mut self, command: Command) -> Result<Answer, SumoError> {
        let answer = self.send(&[command])?.pop();
        answer.ok_or_else(|| SumoError::Answer("it is empty".to_owned()))
    }
}

/// Answers to commands in a message.
pub(crate) fn answers(commands: &[Command], body: &[u8]) -> Result<Vec<Answer>, SumoError> {
    let mut bytes = Bytes(body);
    let answers: Result<Vec<Answer>, SumoError> =
        commands.iter().map(|command| answer(command.id, &mut bytes)).collect();
    let answers = answers?;
    if bytes.is_empty() {
        return Ok(answers);
    }
    Err(SumoError::Answer(format!("{} bytes follow the last answer", bytes.0.len())))
}

/// Answer to the command with this identity: a status, and what follows it.
fn answer(command: u8, bytes: &mut Bytes<'_>) -> Result<Answer, SumoError> {
    let (id, mut status) = bytes.command()?;
    if id != command {
        let message = format!("expected the status of command 0x{command:02x}, found that of 0x{id:02x}");
        return Err(SumoError::Answer(message));
    }
    let (result, why) = (status.byte()?, status.text()?);
    if result != 0 {
        let why = if result == 1 { format!("it is not implemented ({why})") } else { why };
        return Err(SumoError::Refused { command, why });
    }
    Ok(match command {
        0x00 => {
            let (_, mut content) = bytes.command()?;
            Answer::Version(content.int()?, content.text()?)
        }
        0x02 => {
            let count = bytes.count(2)?;
            let results: Result<_, _> = (0..count).map(|_| subscribed(bytes)).collect();
            Answer::Subscribed(results?)
        }
        0x80..=0x8f | 0xd0..=0xdf => Answer::Subscribed(vec![subscribed(bytes)?]),
        0xa0..=0xaf => {
            let (_, mut content) = bytes.command()?;
            let (_, _) = (content.byte()?, content.text()?);
            Answer::Value(content.value()?)
        }
        _ => Answer::Done,
    })
}

/// Result of a subscription: to an object (`0xe0` and more), or to those around one (`0x90` and more).
fn subscribed(bytes: &mut Bytes<'_>) -> Result<Subscribed, SumoError> {
    let (id, mut content) = bytes.command()?;
    let name = content.text()?;
    if id >= 0xe0 {
        let count = usize::from(content.byte()?);
        let values = values(&mut content, count)?;
        return Ok(Subscribed { objects: vec![(name.clone(), values)], name });
    }
    let (_domain, count) = (content.byte()?, usize::from(content.byte()?));
    let found = content.count(4)?;
    if found > OBJECTS_MAX {
        let message = format!("expected at most {OBJECTS_MAX} vehicles around \"{name}\", found {found}");
        return Err(SumoError::Answer(message));
    }
    let mut objects = Vec::new();
    for _ in 0..found {
        objects.push((content.text()?, values(&mut content, count)?));
    }
    Ok(Subscribed { name, objects })
}

fn values(bytes: &mut Bytes<'_>, count: usize) -> Result<Values, SumoError> {
    let mut values = Values::new();
    for _ in 0..count {
        let (variable, status) = (bytes.byte()?, bytes.byte()?);
        let value = bytes.value()?;
        if status != 0 {
            return Err(SumoError::Answer(format!("variable 0x{variable:02x}: {value:?}")));
        }
        values.insert(variable, value);
    }
    Ok(values)
}
