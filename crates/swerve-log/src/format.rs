//! Format of a log: an MCAP file (<https://mcap.dev/spec>) of CBOR messages (RFC 8949).
//!
//! - Metadata record `swerve_run`, first: version, seed, configuration.
//! - One channel per stream, topic `/NAME`: `{header, payload}`, in exactly this order.
//! - Channels `/swerve/watermarks`, `/swerve/steps`, `/swerve/unfinished`,
//!   `/swerve/misses`, `/swerve/drops`, `/swerve/decisions`.
//! - Channels of kind `view`: messages in third-party formats and encodings. They are not part of the record:
//!   readers skip them, and they are not counted.
//! - Metadata record `swerve_run_end`, last: digest, instant, reason, report, number of records, seals.
//!
//! The `log_time` of a message is the instant of its publication, its `publish_time` the stamp; both in nanoseconds
//! of run time, zero for instants before the run. Channel schemas describe the messages in CDDL (RFC 8610).

use std::collections::BTreeMap;

use swerve_core::{Digest, Time};
use swerve_flow::cbor;

use crate::record::{MessageHeader, RunEnd, RunStart};

/// Version of this format; readers reject any other.
pub(crate) const FORM: &str = "1";
pub(crate) const RUN_START: &str = "swerve_run";
pub(crate) const RUN_END: &str = "swerve_run_end";
/// Key in the metadata of the run's end: digests of everything else ([`crate::seals`]); absent in old logs.
pub(crate) const SEALS: &str = "seals";
pub(crate) const ENCODING: &str = "cbor";
pub(crate) const SCHEMA_ENCODING: &str = "cddl";
/// Key in the metadata of a channel: the kind of its records.
pub(crate) const KIND: &str = "kind";
/// Longest record that a reader accepts, bytes.
pub(crate) const RECORD_MAX: usize = 64 << 20;

/// Kinds of channels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Kind {
    Stream,
    Watermarks,
    Steps,
    Unfinished,
    Misses,
    Drops,
    Decisions,
    View,
}

impl Kind {
    /// Kinds with exactly one channel per log.
    pub(crate) const SINGLE: [Self; 6] =
        [Self::Watermarks, Self::Steps, Self::Unfinished, Self::Misses, Self::Drops, Self::Decisions];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Stream => "stream",
            Self::Watermarks => "watermarks",
            Self::Steps => "steps",
            Self::Unfinished => "unfinished",
            Self::Misses => "misses",
            Self::Drops => "drops",
            Self::Decisions => "decisions",
            Self::View => "view",
        }
    }

    pub(crate) fn from_name(name: &str) -> Option<Self> {
        [Self::Stream, Self::View].into_iter().chain(Self::SINGLE).find(|kind| kind.name() == name)
    }

    /// CDDL schema of a message; times are nanoseconds since the start of the run.
    pub(crate) fn schema(self) -> &'static str {
        match self {
            Self::Stream => {
                "message = { header: header, payload: payload / left_out }\n\
                 left_out = { left_out: tstr }\n\
                 header = { stamp: int, watermark: int, visible_at: int, pass: uint, seq: uint, \
                 reused_from: int / null, origin: int / null }\n"
            }
            Self::Watermarks => {
                "watermark = { stream: tstr, operator: tstr, port: uint, watermark: int, visible_at: int, \
                 pass: uint, seq: uint }\n"
            }
            Self::Steps => {
                "step = { operator: tstr, stamp: int, start: int, end: int, units: uint, host_ns: uint, \
                 late: bool }\n"
            }
            Self::Unfinished => "unfinished = { operator: tstr, stamp: int, start: int }\n",
            Self::Misses => {
                "miss = { operator: tstr, stamp: int, deadline: int, at: int, reaction: tstr, started: bool }\n"
            }
            Self::Drops => "drop = { operator: tstr, stamp: int, at: int, reason: tstr }\n",
            Self::Decisions => {
                "decision = begin / arrival / run_time / deadline / drop / stop / lost / restarted / end\n\
                 begin = { decision: \"begin\", wall_clock: bool }\n\
                 arrival = { decision: \"arrival\", operator: tstr, stamp: int / null, at: int }\n\
                 run_time = { decision: \"run_time\", operator: tstr, stamp: int, run_time: int }\n\
                 deadline = { decision: \"deadline\", operator: tstr, stamp: int, at: int, offers: uint }\n\
                 drop = { decision: \"drop\", operator: tstr, stamp: int, at: int, reason: tstr }\n\
                 stop = { decision: \"stop\", operator: tstr, stamp: int, units: uint }\n\
                 lost = { decision: \"lost\", operator: tstr, stamp: int, why: tstr }\n\
                 restarted = { decision: \"restarted\", operator: tstr, stamp: int }\n\
                 end = { decision: \"end\", at: int }\n"
            }
            Self::View => "", // each view has its own schema
        }
    }
}

/// Converts a time to MCAP's unsigned nanoseconds; 0 for negative times.
pub(crate) fn unsigned(time: Time) -> u64 {
    u64::try_from(time.ns()).unwrap_or(0)
}

/// Start of a CBOR map of two entries and its first key; header, second key and payload follow.
const BEFORE_HEADER: &[u8] = b"\xa2\x66header";
const BEFORE_PAYLOAD: &[u8] = b"\x67payload";

/// Appends a message of a stream to `out`. The payload is copied unchanged, so that it can be compared byte for
/// byte later.
pub(crate) fn write_message(header: &MessageHeader, payload_cbor: &[u8], out: &mut Vec<u8>) {
    out.extend_from_slice(BEFORE_HEADER);
    cbor::write(header, out);
    out.extend_from_slice(BEFORE_PAYLOAD);
    out.extend_from_slice(payload_cbor);
}

/// Splits a message of a stream into header and payload.
pub(crate) fn read_message(data: &[u8]) -> Result<(MessageHeader, &[u8]), String> {
    let form = || "expected a message of the form {header, payload}".to_owned();
    let mut rest = data.strip_prefix(BEFORE_HEADER).ok_or_else(form)?;
    let header = cbor::read(&mut rest).map_err(|error| format!("in a message header: {error}"))?;
    let payload = rest.strip_prefix(BEFORE_PAYLOAD).ok_or_else(form)?;
    Ok((header, payload))
}

/// Converts the start of a run to metadata.
pub(crate) fn start_to_map(start: &RunStart) -> BTreeMap<String, String> {
    let mut map = start.extra.clone();
    map.insert("form".into(), FORM.into());
    map.insert("version".into(), start.version.clone());
    map.insert("seed".into(), start.seed.to_string());
    map.insert("config".into(), start.config.clone());
    map
}

/// Parses the start of a run from metadata; the error describes the problem.
pub(crate) fn start_from_map(mut map: BTreeMap<String, String>) -> Result<RunStart, String> {
    let form = take(&mut map, "form")?;
    if form != FORM {
        return Err(format!("expected form {FORM}, found `{form}`: written by another version"));
    }
    Ok(RunStart {
        version: take(&mut map, "version")?,
        seed: number(&take(&mut map, "seed")?, 10)?,
        config: take(&mut map, "config")?,
        extra: map,
    })
}

/// Converts the end of a run with `records` records to metadata.
pub(crate) fn end_to_map(end: &RunEnd, records: u64) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("digest".into(), end.digest.to_string()),
        ("at_ns".into(), end.at.ns().to_string()),
        ("reason".into(), end.reason.clone()),
        ("report".into(), end.report.clone()),
        ("records".into(), records.to_string()),
    ])
}

/// Parses the end of a run and the number of records before it; the error describes the problem.
pub(crate) fn end_from_map(mut map: BTreeMap<String, String>) -> Result<(RunEnd, u64), String> {
    let at_ns = take(&mut map, "at_ns")?;
    let end = RunEnd {
        digest: Digest(number(&take(&mut map, "digest")?, 16)?),
        at: Time::from_ns(at_ns.parse().map_err(|_| format!("expected an instant, found `{at_ns}`"))?),
        reason: take(&mut map, "reason")?,
        report: take(&mut map, "report")?,
    };
    let records = number(&take(&mut map, "records")?, 10)?;
    let unknown = map.into_keys().next().map(|key| format!("expected no entry `{key}` in the run's end"));
    unknown.map_or(Ok((end, records)), Err)
}

fn take(map: &mut BTreeMap<String, String>, key: &str) -> Result<String, String> {
    map.remove(key).ok_or_else(|| format!("expected an entry `{key}` in the run's metadata"))
}

fn number(text: &str, radix: u32) -> Result<u64, String> {
    u64::from_str_radix(text, radix).map_err(|_| format!("expected a number, found `{text}`"))
}
