//! Tests that write logs and read them back, intact and damaged.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};

use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};
use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Rng, Span, Time};

use crate::*;

mod faults; // full disks, failing devices, interrupting signals

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
struct Pose {
    x_m: f64,
    tag: String,
}

fn start() -> RunStart {
    RunStart {
        version: "0.1.0".into(),
        seed: u64::MAX,
        config: "[planner]\nkind = \"fot\"\n".into(),
        extra: BTreeMap::from([("scenario".into(), "person".into())]),
    }
}

fn end() -> RunEnd {
    RunEnd { digest: Digest(0xabc), at: Time::from_ms(9), reason: "until".into(), report: "{}".into() }
}

fn info(stream: &str) -> StreamInfo {
    StreamInfo {
        stream: stream.into(),
        operator: format!("{stream}r"),
        port: 1,
        type_name: "Pose".into(),
        form: "payload = Pose\nPose = { x_m: float, tag: tstr }\n".into(),
    }
}

fn header(k: i64) -> MessageHeader {
    MessageHeader {
        stamp: Time::from_ms(k),
        watermark: Time::from_ns(k * 1_000_000 + 1),
        visible_at: Time::from_ms(k + 5),
        pass: u32::from(k == 3),
        seq: k as u64,
        reused_from: (k == 4).then_some(Time::from_ms(3)),
        origin: (k > 0).then_some(Time::from_ms(k - 1)),
    }
}

fn pose(k: i64) -> Pose {
    Pose { x_m: (k as f64) / 3.0, tag: format!("pose {k} {}", "x".repeat(k as usize % 50)) }
}

fn message(recorder: &mut Recorder, stream: &str, k: i64) {
    recorder.message(stream, || info(stream), header(k), |out| ciborium::into_writer(&pose(k), out).unwrap());
}

/// Records `n` messages on each of two streams, and all other kinds of records.
fn record(recorder: &mut Recorder, n: i64) {
    let at = Time::from_ms(n + 5);
    for k in 0..n {
        message(recorder, "pose", k);
        message(recorder, "truth", k);
        recorder.step(StepRecord {
            operator: "planner",
            stamp: Time::from_ms(n - k),
            start: Time::from_ms(k),
            end: Time::from_ms(k + 3),
            units: 7,
            host_ns: 1,
            late: false,
        });
    }
    recorder.watermark(WatermarkRecord {
        stream: "pose",
        operator: "poser",
        port: 1,
        watermark: Time::MAX,
        visible_at: at,
        pass: 0,
        seq: n as u64,
    });
    let (operator, stamp) = ("planner", Time::from_ms(2));
    recorder.miss(MissRecord { operator, stamp, deadline: at, at, reaction: "reuse_last", started: true });
    recorder.dropped(DropRecord { operator, stamp, at, reason: "skipped" });
    recorder.decision(at, |out| ciborium::into_writer(&("stop", 55), out).unwrap());
}

fn written(path: &Path, n: i64) -> Vec<u8> {
    let mut recorder = Recorder::create(path, &start()).unwrap();
    record(&mut recorder, n);
    recorder.end(end());
    assert_eq!(recorder.finish().unwrap(), 3 * n as u64 + 4);
    std::fs::read(path).unwrap()
}

#[test]
fn log_round_trips_from_the_file_alone() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.mcap");
    written(&path, 600);
    let log = Log::read(&path).unwrap();
    assert_eq!((&log.start, log.end.as_ref()), (&start(), Some(&end())));
    let names: Vec<_> = log.streams.iter().map(|s| (**s).clone()).collect();
    assert_eq!(names, [info("pose"), info("truth")]);
    for stream in ["pose", "truth"] {
        let messages: Vec<_> = log.publications(stream).collect();
        assert_eq!(messages.len(), 600);
        for (k, m) in (0..).zip(&messages) {
            assert_eq!((m.header, m.decode::<Pose>().unwrap()), (header(k), pose(k)));
        }
    }
    assert_eq!(log.steps().count(), 600);
    assert_eq!(log.decisions().next().unwrap().decode::<(String, i32)>().unwrap(), ("stop".into(), 55));
    let times: Vec<_> = (1..=600).rev().map(|k| (Time::from_ms(k), Span::from_ms(3))).collect();
    assert_eq!(log.run_times(), BTreeMap::from([("planner".to_owned(), times)]));
    let [.., Record::Watermark(w), Record::Miss(m), Record::Drop(d), Record::Decision(_)] = &log.records[..]
    else {
        panic!("the last four records")
    };
    assert_eq!((w.watermark, w.seq), (Time::MAX, 600));
    assert_eq!((m.reaction.as_str(), m.started, d.reason.as_str()), ("reuse_last", true, "skipped"));
}

#[test]
fn recorder_is_deterministic() {
    let dir = tempfile::tempdir().unwrap();
    let a = written(&dir.path().join("a"), 300);
    assert_eq!(a, written(&dir.path().join("b"), 300));
}

#[test]
fn decode_error_names_both_types() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.mcap");
    written(&path, 2);
    let log = Log::read(&path).unwrap();
    let error = log.publications("pose").next().unwrap().decode::<u32>().unwrap_err().to_string();
    assert!(error.contains("`pose`, message 0") && error.contains("u32"), "{error}");
}

/// A file that can be read while it is being written.
#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Cursor<Vec<u8>>>>);

impl Write for Shared {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().write(data)
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Shared {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.0.lock().unwrap().seek(to)
    }
}

#[test]
fn truncated_log_is_read_up_to_the_cut_and_reported_incomplete() {
    let dir = tempfile::tempdir().unwrap();
    let whole = written(&dir.path().join("whole"), 3000);
    let path = dir.path().join("cut.mcap");
    let mut most = 0;
    for part in 1..60 {
        std::fs::write(&path, &whole[..whole.len() * part / 60]).unwrap();
        let (log, damage) = match Log::salvage(&path) {
            Ok((log, damage)) => (log, damage.expect("a cut log is not complete")),
            Err(error) => (Log::default(), error),
        };
        assert!(damage.to_string().contains("cut.mcap"), "{damage}");
        assert!(matches!(damage, LogError::Damaged { .. } | LogError::Incomplete { .. }), "{damage}");
        assert!(log.records.len() >= most, "more file gives no fewer records");
        most = log.records.len();
        for (k, m) in (0..).zip(log.publications("pose")) {
            assert_eq!(m.decode::<Pose>().unwrap(), pose(k));
        }
    }
    assert!(most > 2000, "each second of run time is flushed: {most}");
}

#[test]
fn log_is_readable_while_being_written() {
    let dir = tempfile::tempdir().unwrap();
    let file = Shared::default();
    let mut recorder = Recorder::start(Path::new("x"), file.clone(), &start()).unwrap();
    record(&mut recorder, 2500);
    recorder.finish().unwrap();
    let path = dir.path().join("killed.mcap");
    std::fs::write(&path, file.0.lock().unwrap().get_ref()).unwrap();
    let (log, damage) = Log::salvage(&path).unwrap();
    assert!(matches!(damage, Some(LogError::Incomplete { records: 7504, .. })), "{damage:?}");
    assert_eq!((log.records.len(), log.end), (7504, None));
    assert!(Log::read(&path).unwrap_err().to_string().contains("cut off"));
}

#[test]
fn a_recorder_dropped_in_a_panic_leaves_a_readable_log() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("log.mcap");
    let crash = std::panic::catch_unwind(|| {
        let mut recorder = Recorder::create(&path, &start()).unwrap();
        message(&mut recorder, "pose", 0);
        std::panic::resume_unwind(Box::new("operator"));
    });
    assert!(crash.is_err());
    let (log, damage) = Log::salvage(&path).unwrap();
    assert!(log.records.len() == 1 && matches!(damage, Some(LogError::Incomplete { .. })));
}

#[test]
fn mutated_log_yields_an_error_or_correct_records() {
    let dir = tempfile::tempdir().unwrap();
    let whole = written(&dir.path().join("whole"), 400);
    let truth = Log::read(&dir.path().join("whole")).unwrap();
    let path = dir.path().join("mutated.mcap");
    let mut rng = Rng::keyed(1, "mutations", &[]);
    let mut refused = 0;
    for k in 0..300 {
        let mut bytes = whole.clone();
        for _ in 0..=rng.below(3) {
            let at = rng.below(bytes.len());
            match k % 4 {
                0 => bytes[at] ^= 1 << rng.below(8),
                1 => bytes[at] = rng.bits() as u8,
                2 => bytes[at..].iter_mut().take(8).for_each(|b| *b = 0xff),
                _ => drop(bytes.drain(at..bytes.len().min(at + rng.below(40)))),
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        match Log::salvage(&path) {
            Ok((log, damage)) => {
                assert!(truth.records.starts_with(&log.records), "mutation {k} gave other records");
                assert!(damage.is_some() || log.records == truth.records, "mutation {k} lost records unseen");
                refused += usize::from(damage.is_some());
            }
            Err(error) => {
                assert!(error.to_string().contains("mutated.mcap"), "{error}");
                refused += 1;
            }
        }
    }
    assert!(refused > 290, "only what no checksum covers may pass: {refused}");
}

#[test]
fn log_reader_detects_every_flipped_bit_of_the_messages() {
    let dir = tempfile::tempdir().unwrap();
    let whole = written(&dir.path().join("whole"), 5);
    let path = dir.path().join("flipped.mcap");
    for at in (0..whole.len() / 2).step_by(7) {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        std::fs::write(&path, &bytes).unwrap();
        assert!(Log::read(&path).is_err(), "byte {at}");
    }
}

/// Records of a log with their opcodes, decompressed; without those derived from them (chunks, indices, checksums).
fn unpacked(whole: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let mut reader = LinearReader::new();
    let (mut records, mut rest) = (Vec::new(), whole);
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(n) => {
                let n = rest.read(reader.insert(n)).unwrap();
                reader.notify_read(n);
            }
            LinearReadEvent::Record { opcode: 0x0f, .. } => break, // end of the data section
            LinearReadEvent::Record { data, opcode } => {
                records.extend(matches!(opcode, 1 | 3 | 4 | 5 | 12).then(|| (opcode, data.to_vec())));
            }
        }
    }
    records
}

/// A file of these records without checksums, as a manipulated log would be.
fn packed(records: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut file = mcap::MAGIC.to_vec();
    let ends = [(0x0f, vec![0; 4]), (0x02, vec![0; 20])];
    for (opcode, body) in records.iter().chain(&ends) {
        file.push(*opcode);
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(body);
    }
    [&file[..], mcap::MAGIC].concat()
}

#[test]
fn seals_name_every_changed_byte_despite_valid_checksums() {
    let dir = tempfile::tempdir().unwrap();
    let records = unpacked(&written(&dir.path().join("whole"), 2));
    let path = dir.path().join("changed.mcap");
    std::fs::write(&path, packed(&records)).unwrap();
    Log::read(&path).unwrap();
    let mut by_channel = 0;
    for i in 0..records.len() {
        for at in 0..=records[i].1.len() {
            let mut changed = records.clone();
            let (opcode, body) = &mut changed[i];
            *body.get_mut(at).unwrap_or(opcode) ^= 1 << (at % 8);
            std::fs::write(&path, packed(&changed)).unwrap();
            let error = Log::read(&path).expect_err(&format!("record {i}, byte {at}")).to_string();
            by_channel += usize::from(error.contains("/pose was changed"));
        }
    }
    assert!(by_channel > 100, "{by_channel}");
    let exchanged: Vec<usize> = (0..records.len()).filter(|i| records[*i].0 == 5).collect();
    let mut changed = records.clone();
    changed.swap(exchanged[0], exchanged[1]);
    std::fs::write(&path, packed(&changed)).unwrap();
    Log::read(&path).expect_err("order");
}

#[test]
fn log_without_seals_is_read_and_reported_unsealed() {
    let dir = tempfile::tempdir().unwrap();
    let mut records = unpacked(&written(&dir.path().join("whole"), 2));
    let path = dir.path().join("changed.mcap");
    std::fs::write(&path, packed(&records)).unwrap();
    assert!(Log::read(&path).unwrap().is_sealed);
    // Body of a metadata record: its name, the length of the map, and its entries, all length-prefixed.
    let end = &mut records.iter_mut().rfind(|(opcode, _)| *opcode == 0x0c).unwrap().1;
    let length = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let map = 4 + length(end, 0);
    let key = end.windows(5).position(|five| five == b"seals").unwrap() - 4;
    let value = key + 9;
    let after = value + 4 + length(end, value);
    let rest = u32::try_from(length(end, map) - (after - key)).unwrap();
    end[map..map + 4].copy_from_slice(&rest.to_le_bytes());
    end.drain(key..after);
    std::fs::write(&path, packed(&records)).unwrap();
    let log = Log::read(&path).unwrap();
    assert!(!log.is_sealed && log.end.is_some());
}

#[test]
fn log_reader_detects_every_changed_byte_of_a_short_log() {
    let dir = tempfile::tempdir().unwrap();
    let whole = written(&dir.path().join("whole"), 1);
    let path = dir.path().join("changed.mcap");
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        std::fs::write(&path, &bytes).unwrap();
        Log::read(&path).expect_err(&format!("byte {at} of {}", whole.len()));
    }
}

#[test]
fn log_reader_rejects_other_files_with_position_and_expectation() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("f.mcap");
    let refuse = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Log::read(&path).unwrap_err().to_string()
    };
    let empty = refuse(b"");
    assert!(empty.contains("f.mcap: damaged at byte 0 of 0") && empty.contains("found the end"), "{empty}");
    let text = refuse(b"name = \"person behind truck\"");
    assert!(text.contains("byte 0 of 28") && text.contains("magic number of an MCAP file"), "{text}");
    let mut rng = Rng::keyed(2, "noise", &[]);
    for size in [1, 8, 9, 100, 10_000] {
        let noise: Vec<u8> = (0..size).map(|_| rng.bits() as u8).collect();
        refuse(&noise);
        let mut begun = b"\x89MCAP0\r\n".to_vec();
        begun.extend(&noise);
        refuse(&begun);
    }
    let huge = refuse(b"\x89MCAP0\r\n\x06\xff\xff\xff\xff\xff\xff\xff\x7f");
    assert!(huge.contains("byte 8"), "{huge}");
    let missing = Log::read(&dir.path().join("none.mcap")).unwrap_err().to_string();
    assert!(missing.contains("none.mcap: cannot read the file"), "{missing}");
}

#[test]
fn log_reader_recognises_mcap_files_of_other_programs() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("other.mcap");
    let mut writer = mcap::Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
    writer.add_channel(0, "/imu", "cdr", &BTreeMap::new()).unwrap();
    writer.finish().unwrap();
    drop(writer);
    assert!(matches!(Log::read(&path), Err(LogError::Foreign { .. })), "{:?}", Log::read(&path).err());
}

#[test]
fn log_reader_reports_damage_at_its_record() {
    let dir = tempfile::tempdir().unwrap();
    let whole = written(&dir.path().join("whole"), 400);
    let summary = {
        let reader = &whole[..];
        mcap::Summary::read(reader).unwrap().unwrap()
    };
    let chunk = summary.chunk_indexes.last().unwrap();
    let mut bytes = whole.clone();
    bytes[(chunk.chunk_start_offset + chunk.chunk_length / 2) as usize] ^= 4;
    let path = dir.path().join("bad.mcap");
    std::fs::write(&path, &bytes).unwrap();
    let (log, damage) = Log::salvage(&path).unwrap();
    let Some(LogError::Damaged { offset, record, records, .. }) = &damage else { panic!("{damage:?}") };
    assert_eq!((*offset, record.as_str()), (chunk.chunk_start_offset, "a chunk"));
    assert_eq!(*records as usize, log.records.len());
}
