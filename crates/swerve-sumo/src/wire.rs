//! Bytes of TraCI: commands and values out, answers in. Numbers are big-endian.

use crate::SumoError;

/// Longest message that is accepted, bytes.
pub(crate) const MESSAGE_MAX: usize = 64 << 20;

/// Begin and end of a subscription: from now on, without end.
const ALWAYS: f64 = -1_073_741_824.0;

/// Types of values.
const POSITION: u8 = 0x01;
const BYTE: u8 = 0x08;
const INTEGER: u8 = 0x09;
const DOUBLE: u8 = 0x0b;
const STRING: u8 = 0x0c;
const STRINGS: u8 = 0x0e;
const COMPOUND: u8 = 0x0f;

/// Deepest nesting of values.
const NESTING_MAX: usize = 8;

/// A command: its identity and content.
#[derive(Clone, PartialEq, Debug)]
pub struct Command {
    pub(crate) id: u8,
    pub(crate) content: Vec<u8>,
}

/// Writes values.
#[derive(Default)]
struct Content(Vec<u8>);

impl Content {
    fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend_from_slice(bytes);
        self
    }

    fn int(self, value: i32) -> Self {
        self.bytes(&value.to_be_bytes())
    }

    fn double(self, value: f64) -> Self {
        self.bytes(&value.to_be_bytes())
    }

    fn text(self, text: &str) -> Self {
        self.int(text.len() as i32).bytes(text.as_bytes())
    }

    fn typed(self, value: &Value) -> Self {
        match value {
            Value::Position([x, y]) => self.bytes(&[POSITION]).double(*x).double(*y),
            Value::Byte(byte) => self.bytes(&[BYTE]).bytes(&byte.to_be_bytes()),
            Value::Integer(value) => self.bytes(&[INTEGER]).int(*value),
            Value::Double(value) => self.bytes(&[DOUBLE]).double(*value),
            Value::Text(text) => self.bytes(&[STRING]).text(text),
            Value::Texts(texts) => {
                let begun = self.bytes(&[STRINGS]).int(texts.len() as i32);
                texts.iter().fold(begun, |content, text| content.text(text))
            }
            Value::Compound(values) => {
                let begun = self.bytes(&[COMPOUND]).int(values.len() as i32);
                values.iter().fold(begun, Self::typed)
            }
        }
    }

    fn command(self, id: u8) -> Command {
        Command { id, content: self.0 }
    }
}

/// A value with its type.
#[derive(Clone, PartialEq, Debug)]
pub enum Value {
    /// Two coordinates, metres.
    Position([f64; 2]),
    /// A signed byte.
    Byte(i8),
    /// An integer.
    Integer(i32),
    /// A number.
    Double(f64),
    /// A text.
    Text(String),
    /// A list of texts.
    Texts(Vec<String>),
    /// A list of values.
    Compound(Vec<Self>),
}

impl Value {
    fn text(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl Command {
    /// Version of protocol and program.
    pub fn version() -> Self {
        Content::default().command(0x00)
    }

    /// Place of this client among several.
    pub fn order(place: i32) -> Self {
        Content::default().int(place).command(0x03)
    }

    /// One step; if `until_s` is not 0, all steps until this simulated time.
    pub fn step(until_s: f64) -> Self {
        Content::default().double(until_s).command(0x02)
    }

    /// Ends the simulation.
    pub fn close() -> Self {
        Content::default().command(0x7f)
    }

    /// Asks for a variable of an object.
    pub fn get(domain: Domain, variable: u8, name: &str) -> Self {
        Content::default().bytes(&[variable]).text(name).command(domain.get())
    }

    /// Sets a variable of an object.
    pub fn set(domain: Domain, variable: u8, name: &str, value: &Value) -> Self {
        Content::default().bytes(&[variable]).text(name).typed(value).command(domain.set())
    }

    /// Adds a route over edges.
    pub fn add_route(name: &str, edges: &[String]) -> Self {
        Self::set(Domain::Route, 0x80, name, &Value::Texts(edges.to_vec()))
    }

    /// Inserts a vehicle now.
    pub fn add_vehicle(name: &str, insertion: &Insertion<'_>) -> Self {
        let Insertion { route, kind, depart, arrive } = *insertion;
        let texts = [[route, kind, "now"], depart, arrive, [""; 3]].concat();
        let mut values: Vec<Value> = texts.into_iter().map(Value::text).collect();
        values.extend([Value::Integer(0), Value::Integer(0)]);
        Self::set(Domain::Vehicle, 0x85, name, &Value::Compound(values))
    }

    /// Removes a vehicle.
    pub fn remove_vehicle(name: &str) -> Self {
        // The reason: it was vaporized.
        Self::set(Domain::Vehicle, 0x81, name, &Value::Byte(3))
    }

    /// Moves a vehicle to a place of its front bumper, metres in the coordinates of the net, with an angle in degrees
    /// clockwise from north; anywhere, also beside the road.
    pub fn move_to(name: &str, [x, y]: [f64; 2], angle_deg: f64) -> Self {
        let values = vec![
            Value::text(""),
            Value::Integer(-1),
            Value::Double(x),
            Value::Double(y),
            Value::Double(angle_deg),
            Value::Byte(2),
            Value::Double(100.0),
        ];
        Self::set(Domain::Vehicle, 0xb4, name, &Value::Compound(values))
    }

    /// Subscribes to variables of all vehicles within `range_m` of a vehicle, from now on in every step.
    pub fn vehicles_around(name: &str, range_m: f64, variables: &[u8]) -> Self {
        Content::default()
            .double(ALWAYS)
            .double(ALWAYS)
            .text(name)
            .bytes(&[Domain::Vehicle.get()])
            .double(range_m)
            .bytes(&[variables.len() as u8])
            .bytes(variables)
            .command(0x84)
    }

    /// Subscribes to the state of a traffic light, from now on in every step.
    pub fn light_states(name: &str) -> Self {
        Content::default()
            .double(ALWAYS)
            .double(ALWAYS)
            .text(name)
            .bytes(&[1, LIGHT_STATE])
            .command(Domain::Light.subscribe())
    }

    fn write(&self, out: &mut Vec<u8>) {
        match u8::try_from(self.content.len() + 2) {
            Ok(length) => out.push(length),
            Err(_) => {
                out.push(0);
                out.extend_from_slice(&(self.content.len() as u32 + 6).to_be_bytes());
            }
        }
        out.push(self.id);
        out.extend_from_slice(&self.content);
    }
}

/// Insertion of a vehicle; the texts are those of SUMO's attributes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Insertion<'a> {
    /// Name of its route.
    pub route: &'a str,
    /// Name of its type.
    pub kind: &'a str,
    /// Lane, place and speed at departure.
    pub depart: [&'a str; 3],
    /// Lane, place and speed at arrival.
    pub arrive: [&'a str; 3],
}

/// Variable: the state of a traffic light, a letter for each link.
pub const LIGHT_STATE: u8 = 0x20;

/// A message with commands.
pub(crate) fn message(commands: &[Command]) -> Vec<u8> {
    let mut message = vec![0; 4];
    commands.iter().for_each(|command| command.write(&mut message));
    let length = (message.len() as u32).to_be_bytes();
    message[..4].copy_from_slice(&length);
    message
}

/// Objects that commands are about.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Domain {
    /// Traffic lights.
    Light,
    /// Vehicles.
    Vehicle,
    /// Routes.
    Route,
    /// The simulation as a whole.
    Simulation,
}

impl Domain {
    fn get(self) -> u8 {
        match self {
            Self::Light => 0xa2,
            Self::Vehicle => 0xa4,
            Self::Route => 0xa6,
            Self::Simulation => 0xab,
        }
    }

    fn set(self) -> u8 {
        self.get() + 0x20
    }

    fn subscribe(self) -> u8 {
        self.get() + 0x30
    }
}

/// Reads an answer, never beyond its end.
#[derive(Clone, Copy)]
pub(crate) struct Bytes<'a>(pub(crate) &'a [u8]);

impl<'a> Bytes<'a> {
    pub(crate) fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], SumoError> {
        match self.0.split_at_checked(count) {
            Some((taken, rest)) => {
                self.0 = rest;
                Ok(taken)
            }
            None => {
                Err(SumoError::Answer(format!("it ends {} bytes before a value does", count - self.0.len())))
            }
        }
    }

    pub(crate) fn byte(&mut self) -> Result<u8, SumoError> {
        Ok(self.take(1)?[0])
    }

    pub(crate) fn int(&mut self) -> Result<i32, SumoError> {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(self.take(4)?);
        Ok(i32::from_be_bytes(bytes))
    }

    /// A number of elements, each of at least `least` bytes.
    pub(crate) fn count(&mut self, least: usize) -> Result<usize, SumoError> {
        let count = self.int()?;
        let most = self.0.len() / least.max(1);
        usize::try_from(count)
            .ok()
            .filter(|count| *count <= most)
            .ok_or_else(|| SumoError::Answer(format!("expected at most {most} elements, found {count}")))
    }

    fn double(&mut self) -> Result<f64, SumoError> {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(self.take(8)?);
        Ok(f64::from_be_bytes(bytes))
    }

    pub(crate) fn text(&mut self) -> Result<String, SumoError> {
        let length = self.count(1)?;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    /// The next command: its identity, and a reader of its content.
    pub(crate) fn command(&mut self) -> Result<(u8, Bytes<'a>), SumoError> {
        let (length, head) = match self.byte()? {
            0 => (self.int()?.unsigned_abs() as usize, 5),
            short => (usize::from(short), 1),
        };
        let length = length
            .checked_sub(head + 1)
            .ok_or_else(|| SumoError::Answer(format!("expected a command, found one of {length} bytes")))?;
        let id = self.byte()?;
        Ok((id, Bytes(self.take(length)?)))
    }

    /// A value with its type.
    pub(crate) fn value(&mut self) -> Result<Value, SumoError> {
        self.nested(0)
    }

    fn nested(&mut self, depth: usize) -> Result<Value, SumoError> {
        Ok(match self.byte()? {
            POSITION => Value::Position([self.double()?, self.double()?]),
            BYTE => Value::Byte(self.byte()?.cast_signed()),
            INTEGER => Value::Integer(self.int()?),
            DOUBLE => Value::Double(self.double()?),
            STRING => Value::Text(self.text()?),
            STRINGS => {
                let count = self.count(4)?;
                Value::Texts((0..count).map(|_| self.text()).collect::<Result<_, _>>()?)
            }
            COMPOUND if depth < NESTING_MAX => {
                let count = self.count(2)?;
                Value::Compound((0..count).map(|_| self.nested(depth + 1)).collect::<Result<_, _>>()?)
            }
            other => return Err(SumoError::Answer(format!("a value has the unknown type 0x{other:02x}"))),
        })
    }
}
