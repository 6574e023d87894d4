//! Forged RTPS 2.3 packets (OMG, 9.4).

use swerve_ros2::bridge::WriterGuid;

/// Discovery and user ports of the first participant of a domain (9.6.2.3).
pub(super) fn ports(domain: u16) -> [u16; 2] {
    let base = 7400 + 250 * domain;
    [base + 10, base + 11]
}

const DATA: u8 = 0x15;
const DATA_FRAG: u8 = 0x16;
const HEARTBEAT: u8 = 0x07;
const GAP: u8 = 0x08;
const LITTLE_ENDIAN: u8 = 1;
const HAS_DATA: u8 = 4;

/// Packet header of this writer's participant.
fn header(writer: WriterGuid) -> Vec<u8> {
    let mut packet = b"RTPS\x02\x03\x01\x12".to_vec();
    packet.extend(&writer.0[..12]);
    packet
}

fn submessage(packet: &mut Vec<u8>, kind: u8, flags: u8, body: &[u8]) {
    packet.extend([kind, flags]);
    packet.extend((body.len() as u16).to_le_bytes());
    packet.extend(body);
}

/// Any reader and this writer; the start of most submessages.
fn ends(writer: WriterGuid) -> Vec<u8> {
    [&[0; 4][..], &writer.0[12..]].concat()
}

fn number(n: u64) -> [u8; 8] {
    let [high, low] = [(n >> 32) as u32, n as u32].map(u32::to_le_bytes);
    [high, low].concat().try_into().unwrap()
}

/// One kilobyte that claims to be the first fragment of a message of `sample_bytes`.
pub(super) fn fragment(writer: WriterGuid, sequence: u64, sample_bytes: u32) -> Vec<u8> {
    let mut body = vec![0, 0, 28, 0];
    body.extend(ends(writer));
    body.extend(number(sequence));
    body.extend(1_u32.to_le_bytes());
    body.extend(1_u16.to_le_bytes());
    body.extend(1024_u16.to_le_bytes());
    body.extend(sample_bytes.to_le_bytes());
    body.extend([0; 1024]);
    let mut packet = header(writer);
    submessage(&mut packet, DATA_FRAG, LITTLE_ENDIAN, &body);
    packet
}

/// Generator of malformed packets.
pub(super) struct Noise(u64);

impl Noise {
    pub(super) fn new() -> Self {
        Self(0x9e37_79b9_7f4a_7c15)
    }

    /// xorshift64 (Marsaglia, 2003).
    fn random(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn bytes(&mut self, most: u64) -> Vec<u8> {
        let length = self.random() % most;
        (0..length).map(|_| (self.random() >> 32) as u8).collect()
    }

    /// Random bytes, or a packet of this writer with some bytes changed.
    pub(super) fn packet(&mut self, writer: WriterGuid, n: u64) -> Vec<u8> {
        if n.is_multiple_of(4) {
            return self.bytes(1400);
        }
        let mut packet = match n % 7 {
            0 => fragment(writer, self.random() % 100_000, (self.random() % (1 << 28)) as u32),
            1 | 2 => {
                let mut body = ends(writer);
                body.extend([number(self.random() % 1000), number(self.random() % 100_000)].concat());
                body.extend((n as u32).to_le_bytes());
                let mut packet = header(writer);
                submessage(&mut packet, HEARTBEAT, LITTLE_ENDIAN, &body);
                packet
            }
            3 => {
                let mut body = ends(writer);
                body.extend([number(self.random() % 1000), number(self.random() % 100_000)].concat());
                body.extend([64, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff]);
                let mut packet = header(writer);
                submessage(&mut packet, GAP, LITTLE_ENDIAN, &body);
                packet
            }
            _ => {
                let mut body = vec![0, 0, 16, 0];
                body.extend(ends(writer));
                body.extend(number(self.random() % 100_000));
                body.extend([0, 1, 0, 0]);
                body.extend(self.bytes(200));
                let mut packet = header(writer);
                submessage(&mut packet, DATA, LITTLE_ENDIAN | HAS_DATA, &body);
                packet
            }
        };
        for _ in 0..self.random() % 6 {
            // After the writer's name: packets from an unknown writer are ignored.
            let place = 20 + (self.random() as usize) % (packet.len() - 20);
            packet[place] = (self.random() >> 32) as u8;
        }
        packet
    }
}
