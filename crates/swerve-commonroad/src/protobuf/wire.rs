//! The wire format of protobuf, and the text that is written of it.

use super::ProtobufError;

/// Longest text, bytes.
const TEXT_MAX: usize = 256 << 20;

/// Most bytes of a variable-length number.
const VARINT_MAX: usize = 10;

/// A message: its bytes, and its place in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Message<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The message that it is part of, and its name there.
    name: Name<'a>,
}

/// Name of a field, with those of the messages around it.
#[derive(Clone, Copy, Debug)]
struct Name<'a> {
    parts: [&'a str; 6],
    count: usize,
}

impl<'a> Name<'a> {
    fn with(mut self, part: &'a str) -> Self {
        if let Some(place) = self.parts.get_mut(self.count) {
            *place = part;
            self.count += 1;
        }
        self
    }

    fn text(&self) -> String {
        self.parts[..self.count].join(".")
    }
}

/// Value of a field.
#[derive(Clone, Copy, Debug)]
enum Value<'a> {
    Varint(u64),
    Fixed64([u8; 8]),
    Fixed32,
    Bytes(&'a [u8]),
}

/// A field of a message.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field<'a> {
    /// Number in the definition of the message.
    pub(super) number: u64,
    value: Value<'a>,
    at: usize,
    name: Name<'a>,
}

impl<'a> Field<'a> {
    pub(super) fn fault(&self, message: &str) -> ProtobufError {
        ProtobufError { at: self.at, field: self.name.text(), message: message.to_owned() }
    }

    /// The message that is its value.
    pub(super) fn message(&self, name: &'a str) -> Result<Message<'a>, ProtobufError> {
        let name = self.name.with(name);
        match self.value {
            Value::Bytes(bytes) => Ok(Message { bytes, at: self.at, name }),
            _ => Err(Self { name, ..*self }.fault("expected a message, found a number")),
        }
    }

    fn number(&self, name: &'a str) -> Result<f64, ProtobufError> {
        let named = Self { name: self.name.with(name), ..*self };
        let Value::Fixed64(bytes) = self.value else {
            return Err(named.fault("expected a number of 64 bits"));
        };
        let value = f64::from_le_bytes(bytes);
        match value.is_finite() {
            true => Ok(value),
            false => Err(named.fault(&format!("expected a finite number, found {value}"))),
        }
    }
}

/// Fields of a message, in order.
struct Fields<'a> {
    message: Message<'a>,
    next: usize,
}

impl<'a> Fields<'a> {
    fn fault(&self, message: &str) -> ProtobufError {
        let at = self.message.at + self.next;
        ProtobufError { at, field: self.message.name.text(), message: message.to_owned() }
    }

    fn varint(&mut self) -> Result<u64, ProtobufError> {
        let mut value = 0_u64;
        for k in 0..VARINT_MAX {
            let Some(byte) = self.message.bytes.get(self.next) else {
                return Err(self.fault(
                    "expected more bytes: the file is cut off, or no scenario in the protobuf format",
                ));
            };
            self.next += 1;
            value |= u64::from(byte & 0x7f).wrapping_shl(7 * k as u32);
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(self.fault("expected a number of at most 10 bytes: no scenario in the protobuf format"))
    }

    fn take(&mut self, count: u64) -> Result<&'a [u8], ProtobufError> {
        let rest = &self.message.bytes[self.next..];
        match usize::try_from(count).ok().and_then(|count| rest.get(..count)) {
            Some(bytes) => {
                self.next += bytes.len();
                Ok(bytes)
            }
            None => {
                let left = rest.len();
                Err(self.fault(&format!("expected {count} more bytes, found {left}: the file is cut off, or no scenario in the protobuf format")))
            }
        }
    }

    fn field(&mut self) -> Result<Field<'a>, ProtobufError> {
        let key = self.varint()?;
        let mut at = self.message.at + self.next;
        let value = match key & 7 {
            0 => Value::Varint(self.varint()?),
            1 => {
                let mut bytes = [0; 8];
                bytes.copy_from_slice(self.take(8)?);
                Value::Fixed64(bytes)
            }
            2 => {
                let count = self.varint()?;
                at = self.message.at + self.next;
                Value::Bytes(self.take(count)?)
            }
            5 => {
                self.take(4)?;
                Value::Fixed32
            }
            other => {
                return Err(self.fault(&format!(
                    "expected a field of type 0, 1, 2 or 5, found {other}: no scenario in the protobuf format"
                )));
            }
        };
        Ok(Field { number: key >> 3, value, at, name: self.message.name })
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<Field<'a>, ProtobufError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.next >= self.message.bytes.len() {
            return None;
        }
        let field = self.field();
        if field.is_err() {
            self.next = self.message.bytes.len();
        }
        Some(field)
    }
}

impl<'a> Message<'a> {
    /// The whole file.
    pub(super) fn top(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, name: Name { parts: [""; 6], count: 0 } }
    }

    /// Its fields, in order; ends after a fault.
    pub(super) fn fields(self) -> impl Iterator<Item = Result<Field<'a>, ProtobufError>> {
        Fields { message: self, next: 0 }
    }

    /// The last field of a number, which is the one that counts.
    fn find(self, number: u64) -> Result<Option<Field<'a>>, ProtobufError> {
        let mut found = None;
        for field in self.fields() {
            let field = field?;
            found = if field.number == number { Some(field) } else { found };
        }
        Ok(found)
    }

    fn missing(&self, name: &'a str) -> ProtobufError {
        let field = self.name.with(name).text();
        ProtobufError { at: self.at, field, message: "is missing".to_owned() }
    }

    /// A message in a field, if there is one.
    pub(super) fn maybe(self, number: u64, name: &'a str) -> Result<Option<Self>, ProtobufError> {
        self.find(number)?.map(|field| field.message(name)).transpose()
    }

    /// A message in a required field.
    pub(super) fn only(self, number: u64, name: &'a str) -> Result<Self, ProtobufError> {
        self.maybe(number, name)?.ok_or_else(|| self.missing(name))
    }

    /// The messages in a repeated field.
    pub(super) fn all(self, number: u64, name: &'a str) -> impl Iterator<Item = Result<Self, ProtobufError>> {
        self.fields().filter_map(move |field| match field {
            Ok(field) if field.number != number => None,
            Ok(field) => Some(field.message(name)),
            Err(error) => Some(Err(error)),
        })
    }

    /// A finite number in a field, if there is one.
    pub(super) fn maybe_number(self, number: u64, name: &'a str) -> Result<Option<f64>, ProtobufError> {
        self.find(number)?.map(|field| field.number(name)).transpose()
    }

    /// A finite number in a required field.
    pub(super) fn number(self, number: u64, name: &'a str) -> Result<f64, ProtobufError> {
        self.maybe_number(number, name)?.ok_or_else(|| self.missing(name))
    }

    /// A whole number in a field, if there is one.
    pub(super) fn maybe_whole(self, number: u64, name: &'a str) -> Result<Option<u64>, ProtobufError> {
        let Some(field) = self.find(number)? else { return Ok(None) };
        match field.value {
            Value::Varint(value) => Ok(Some(value)),
            _ => Err(Field { name: field.name.with(name), ..field }.fault("expected a whole number")),
        }
    }

    /// A whole number in a required field.
    pub(super) fn whole(self, number: u64, name: &'a str) -> Result<u64, ProtobufError> {
        self.maybe_whole(number, name)?.ok_or_else(|| self.missing(name))
    }

    /// The whole numbers in a repeated field, packed or not.
    pub(super) fn wholes(self, number: u64, name: &'a str) -> Result<Vec<u64>, ProtobufError> {
        let mut all = Vec::new();
        for field in self.fields() {
            let field = field?;
            match field.value {
                _ if field.number != number => {}
                Value::Varint(value) => all.push(value),
                Value::Bytes(bytes) => {
                    let message = Message { bytes, at: field.at, name: field.name.with(name) };
                    let mut packed = Fields { message, next: 0 };
                    while packed.next < bytes.len() {
                        all.push(packed.varint()?);
                    }
                }
                _ => {
                    return Err(
                        Field { name: field.name.with(name), ..field }.fault("expected whole numbers")
                    );
                }
            }
        }
        Ok(all)
    }

    /// The text in a required field.
    pub(super) fn text(self, number: u64, name: &'a str) -> Result<&'a str, ProtobufError> {
        let field = self.find(number)?.ok_or_else(|| self.missing(name))?;
        let text = match field.value {
            Value::Bytes(bytes) => core::str::from_utf8(bytes).ok(),
            _ => None,
        };
        text.ok_or_else(|| Field { name: field.name.with(name), ..field }.fault("expected a text in UTF-8"))
    }

    /// The texts in a repeated field.
    pub(super) fn texts(self, number: u64, name: &'a str) -> Result<Vec<&'a str>, ProtobufError> {
        let messages: Result<Vec<Self>, ProtobufError> = self.all(number, name).collect();
        let text = |one: Self| {
            let fault = || ProtobufError {
                at: one.at,
                field: one.name.text(),
                message: "expected a text in UTF-8".to_owned(),
            };
            core::str::from_utf8(one.bytes).map_err(|_| fault())
        };
        messages?.into_iter().map(text).collect()
    }
}

/// XML text that grows.
#[derive(Debug, Default)]
pub(super) struct Writer(String);

impl Writer {
    pub(super) fn text(self) -> String {
        self.0
    }

    pub(super) fn raw(&mut self, text: &str) {
        self.0 += text;
    }

    /// Fails after a field with which the text is too long.
    pub(super) fn within_limit(&self, field: &Field<'_>) -> Result<(), ProtobufError> {
        match self.0.len() <= TEXT_MAX {
            true => Ok(()),
            false => {
                Err(field.fault(&format!("expected a scenario of at most {} MiB as XML", TEXT_MAX >> 20)))
            }
        }
    }

    pub(super) fn open(&mut self, name: &str) {
        self.open_with(name, &[]);
    }

    pub(super) fn open_with(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.tag(name, attributes);
        self.0 += ">\n";
    }

    pub(super) fn empty_with(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.tag(name, attributes);
        self.0 += "/>\n";
    }

    fn tag(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.0.push('<');
        self.0 += name;
        for (key, value) in attributes {
            self.0.push(' ');
            self.0 += key;
            self.0 += "=\"";
            self.escaped(value);
            self.0.push('"');
        }
    }

    pub(super) fn close(&mut self, name: &str) {
        self.0 += "</";
        self.0 += name;
        self.0 += ">\n";
    }

    pub(super) fn leaf(&mut self, name: &str, content: &str) {
        self.0.push('<');
        self.0 += name;
        self.0.push('>');
        self.escaped(content);
        self.close(name);
    }

    pub(super) fn number(&mut self, name: &str, value: f64) {
        self.leaf(name, &format!("{value:?}"));
    }

    /// Adds text; characters that XML does not have become spaces.
    fn escaped(&mut self, text: &str) {
        for c in text.chars() {
            match c {
                '&' => self.0 += "&amp;",
                '<' => self.0 += "&lt;",
                '>' => self.0 += "&gt;",
                '"' => self.0 += "&quot;",
                c if c.is_control() => self.0.push(' '),
                c => self.0.push(c),
            }
        }
    }
}
