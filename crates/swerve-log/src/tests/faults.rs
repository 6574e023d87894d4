//! Tests with failing input and output: at the n-th byte, in short transfers, interrupted by signals.

use std::io::ErrorKind;

use super::*;
use crate::reader::Reader;

/// A disk that rejects bytes beyond `room` with `refusal`, transfers at most `part` bytes per call and, with
/// `signals`, interrupts every other call.
#[derive(Clone)]
struct Disk {
    file: Shared,
    room: usize,
    refusal: ErrorKind,
    part: usize,
    signals: bool,
    calls: u64,
}

impl Disk {
    fn new(bytes: Vec<u8>) -> Self {
        Self {
            file: Shared(Arc::new(Mutex::new(Cursor::new(bytes)))),
            room: usize::MAX,
            refusal: ErrorKind::StorageFull,
            part: usize::MAX,
            signals: false,
            calls: 0,
        }
    }

    fn held(&self) -> Vec<u8> {
        self.file.0.lock().unwrap().get_ref().clone()
    }

    /// Number of bytes, of `wanted`, that this call transfers.
    fn moves(&mut self, wanted: usize) -> io::Result<usize> {
        self.calls += 1;
        if self.signals && self.calls % 2 == 1 {
            return Err(ErrorKind::Interrupted.into());
        }
        let at = self.file.0.lock().unwrap().position() as usize;
        match wanted.min(self.part).min(self.room.saturating_sub(at)) {
            0 if wanted > 0 => Err(self.refusal.into()),
            moved => Ok(moved),
        }
    }
}

impl Write for Disk {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        let moved = self.moves(data.len())?;
        self.file.write(&data[..moved])
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Read for Disk {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let moved = self.moves(into.len())?;
        self.file.0.lock().unwrap().read(&mut into[..moved])
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Records six seconds of run time in few bytes, so that more than one chunk is flushed.
fn record_on(disk: &Disk) -> Result<u64, LogError> {
    let mut recorder = Recorder::start(Path::new("log.mcap"), disk.clone(), &start())?;
    for k in 0..40 {
        message(&mut recorder, "pose", 150 * k);
    }
    recorder.end(end());
    recorder.finish()
}

fn whole() -> Vec<u8> {
    let disk = Disk::new(Vec::new());
    assert_eq!(record_on(&disk).unwrap(), 40);
    disk.held()
}

fn read_from(disk: Disk) -> Result<(Log, Option<LogError>), LogError> {
    let size = disk.held().len() as u64;
    Ok(Log::gather(Reader::of(Path::new("log.mcap"), disk, size)?, &|_| true))
}

#[test]
fn log_is_readable_up_to_the_last_flush_wherever_the_disk_is_full() {
    let whole = whole();
    let (mut most, mut none) = (0, 0);
    for room in 0..whole.len() {
        let disk = Disk { room, ..Disk::new(Vec::new()) };
        let error = record_on(&disk).unwrap_err().to_string();
        assert!(error.starts_with("log.mcap: cannot write: "), "{room}: {error}");
        let left = disk.held();
        assert!(whole.starts_with(&left), "{room}: what was written before is as it would have been");
        let Ok((log, damage)) = read_from(Disk::new(left)) else {
            none += 1;
            continue;
        };
        // All records may be present only if just the closing checksum is missing.
        assert!(damage.is_some(), "{room}: a log that was not finished passes as whole");
        assert!(log.records.len() >= most, "{room}: more room gives no fewer records");
        most = log.records.len();
        for (k, message) in (0..).zip(log.publications("pose")) {
            assert_eq!(message.decode::<Pose>().unwrap(), pose(150 * k), "{room}");
        }
    }
    assert_eq!(most, 40);
    assert!(none < whole.len() / 2, "the run's start is on the disk early: {none} of {}", whole.len());
}

#[test]
fn full_disk_ends_the_recording_but_not_the_run() {
    let small = Disk { room: 20_000, ..Disk::new(Vec::new()) };
    let mut recorder = Recorder::start(Path::new("out/log.mcap"), small, &start()).unwrap();
    assert!(recorder.failure().is_none());
    record(&mut recorder, 60_000);
    recorder.end(end());
    let told = recorder.failure().map(ToString::to_string);
    let error = recorder.finish().unwrap_err().to_string();
    assert_eq!(told.as_ref(), Some(&error), "it is known before the end");
    assert!(
        error.starts_with("out/log.mcap: cannot write: no storage space; what it holds stays"),
        "{error}"
    );
    let none = Recorder::create(Path::new("/nonexistent/log.mcap"), &start());
    assert!(matches!(none, Err(LogError::Create { .. })));
}

#[test]
fn recorder_reports_the_system_error() {
    for (refusal, words) in
        [(ErrorKind::StorageFull, "no storage space"), (ErrorKind::PermissionDenied, "permission denied")]
    {
        let disk = Disk { room: 3000, refusal, ..Disk::new(Vec::new()) };
        let error = record_on(&disk).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn log_is_identical_despite_short_writes_and_signals() {
    let whole = whole();
    for part in [1, 7, 4096] {
        let disk = Disk { part, signals: true, ..Disk::new(Vec::new()) };
        assert_eq!(record_on(&disk).unwrap(), 40);
        assert!(disk.held() == whole, "{part} bytes at a time");
        let (log, damage) = read_from(Disk { part, signals: true, ..Disk::new(whole.clone()) }).unwrap();
        assert!(damage.is_none(), "{part}: {damage:?}");
        assert_eq!(log.records.len(), 40);
    }
}

#[test]
fn log_is_readable_up_to_the_byte_where_the_device_fails() {
    let whole = whole();
    let mut most = 0;
    for room in (0..whole.len()).step_by(3) {
        let failing = Disk { room, part: 64, refusal: ErrorKind::Other, ..Disk::new(whole.clone()) };
        let (records, error) = match read_from(failing) {
            Ok((log, damage)) => (log.records.len(), damage.expect("not all could be read")),
            Err(error) => (0, error),
        };
        assert!(error.to_string().starts_with("log.mcap: "), "{room}: {error}");
        assert!(records >= most, "{room}");
        most = records;
    }
    assert!(most > 30, "{most}");
}

/// Found by fuzzing: `mcap` 0.26.0 subtracts the length of such a record from the rest of the chunk.
#[test]
fn a_record_longer_than_its_chunk_is_damage() {
    let record = |opcode: u8, body: &[u8]| [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat();
    let cut = &record(5, &[0; 40])[..29];
    let length = (cut.len() as u64).to_le_bytes();
    // Times, both lengths of the chunk's content, no checksum, no compression.
    let chunk = [&[0; 16][..], &length, &[0; 8], &length, cut].concat();
    let bytes =
        [mcap::MAGIC, &record(1, &[0; 8]), &record(6, &chunk), &record(15, &[0; 4]), mcap::MAGIC].concat();
    let error = read_from(Disk::new(bytes)).unwrap_err();
    assert!(matches!(error, LogError::Damaged { .. }), "{error}");
}
