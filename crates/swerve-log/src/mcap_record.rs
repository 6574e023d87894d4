//! Parsers for the MCAP records of a log, with every length checked.

use std::collections::BTreeMap;

use mcap::records::MessageHeader;

/// Opcodes of MCAP records (<https://mcap.dev/spec>, "Records").
pub(crate) mod op {
    pub(crate) const HEADER: u8 = 0x01;
    pub(crate) const SCHEMA: u8 = 0x03;
    pub(crate) const CHANNEL: u8 = 0x04;
    pub(crate) const MESSAGE: u8 = 0x05;
    pub(crate) const METADATA: u8 = 0x0c;
}

/// MCAP's name of an opcode.
pub(crate) fn op_name(opcode: u8) -> &'static str {
    match opcode {
        op::HEADER => "the header",
        0x02 => "the footer",
        op::SCHEMA => "a schema",
        op::CHANNEL => "a channel",
        op::MESSAGE => "a message",
        0x06 => "a chunk",
        0x07 => "a message index",
        0x08 => "a chunk index",
        0x09 => "an attachment",
        0x0a => "an attachment index",
        0x0b => "the statistics",
        op::METADATA => "a metadata record",
        0x0d => "a metadata index",
        0x0e => "a summary offset",
        0x0f => "the end of the data section",
        0x89 => "the magic number at its end",
        _ => "a record of unknown kind",
    }
}

/// A channel: its number, that of its schema, its topic, and its metadata.
pub(crate) struct Channel {
    pub(crate) id: u16,
    pub(crate) schema: u16,
    pub(crate) topic: String,
    pub(crate) encoding: String,
    pub(crate) metadata: BTreeMap<String, String>,
}

/// A schema: name, encoding, data, and the data as text where it is.
#[derive(Clone, Default)]
pub(crate) struct Schema {
    pub(crate) name: String,
    pub(crate) encoding: String,
    pub(crate) data: Vec<u8>,
    pub(crate) text: String,
}

/// Parses profile and library of a file.
pub(crate) fn header(body: &[u8]) -> Option<(String, String)> {
    let mut cursor = Cursor(body);
    Some((cursor.text()?, cursor.text()?))
}

/// Parses a schema and its number.
pub(crate) fn schema(body: &[u8]) -> Option<(u16, Schema)> {
    let mut cursor = Cursor(body);
    let (id, name, encoding) = (cursor.u16()?, cursor.text()?, cursor.text()?);
    let data = cursor.prefixed().unwrap_or_default().to_vec();
    let text = core::str::from_utf8(&data).unwrap_or_default().to_owned();
    Some((id, Schema { name, encoding, data, text }))
}

pub(crate) fn channel(body: &[u8]) -> Option<Channel> {
    let mut cursor = Cursor(body);
    let (id, schema) = (cursor.u16()?, cursor.u16()?);
    Some(Channel { id, schema, topic: cursor.text()?, encoding: cursor.text()?, metadata: cursor.map()? })
}

/// Parses the header and data of a message.
pub(crate) fn message(body: &[u8]) -> Option<(MessageHeader, &[u8])> {
    let mut cursor = Cursor(body);
    let (channel_id, sequence) = (cursor.u16()?, cursor.u32()?);
    let header = MessageHeader { channel_id, sequence, log_time: cursor.u64()?, publish_time: cursor.u64()? };
    Some((header, cursor.0))
}

/// Parses the name and entries of a metadata record.
pub(crate) fn metadata(body: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut cursor = Cursor(body);
    Some((cursor.text()?, cursor.map()?))
}

/// Unread rest of a record; every read past its end returns `None`.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn bytes(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.bytes(2)?.try_into().ok()?))
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.bytes(4)?.try_into().ok()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.bytes(8)?.try_into().ok()?))
    }

    fn prefixed(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.bytes(length as usize)
    }

    fn text(&mut self) -> Option<String> {
        Some(core::str::from_utf8(self.prefixed()?).ok()?.to_owned())
    }

    fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut entries = Cursor(self.prefixed()?);
        let mut map = BTreeMap::new();
        while !entries.0.is_empty() {
            map.insert(entries.text()?, entries.text()?);
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mcap_parser_rejects_lengths_beyond_the_record() {
        assert!(metadata(b"\xff\xff\xff\xffabc").is_none());
        assert!(metadata(b"\x01\x00\x00\x00a\x08\x00\x00\x00\x01\x00\x00\x00kX").is_none());
        assert!(schema(b"\x01").is_none() && message(&[0; 21]).is_none() && channel(b"").is_none());
        let (name, map) =
            metadata(b"\x01\x00\x00\x00a\x0a\x00\x00\x00\x01\x00\x00\x00k\x01\x00\x00\x00v").unwrap();
        assert_eq!((name.as_str(), map["k"].as_str()), ("a", "v"));
    }
}
