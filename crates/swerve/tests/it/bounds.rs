//! Memory bounds: images, files read whole, viewers, long drives.

use std::io::{BufRead as _, BufReader, ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::Duration;

use crate::support::{Bench, Said};

/// Runs the program with limited address space.
fn within_mib(bench: &Bench, mib: u64, args: &str) -> Said {
    let line = format!("ulimit -v {}; ulimit -c 0; exec swerve {args}", mib << 10);
    Said::of(&bench.shell_command(&line).output().unwrap())
}

/// First bytes of a PNG of this size, up to where a decoder allocates.
fn png_head(bench: &Bench, name: &str, px: u32, bits: u8, colour: u8) {
    let mut chunk = b"IHDR".to_vec();
    chunk.extend([px.to_be_bytes(), px.to_be_bytes()].concat());
    chunk.extend([bits, colour, 0, 0, 0]);
    let crc = chunk.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 0 { c >> 1 } else { 0xedb8_8320 ^ (c >> 1) })
    });
    let head =
        [b"\x89PNG\r\n\x1a\n\0\0\0\x0d", &chunk[..], &(!crc).to_be_bytes(), b"\0\0\0\x04IDAT"].concat();
    std::fs::write(bench.path(name), head).unwrap();
}

#[test]
fn images_of_many_pixels_are_refused_before_memory_is_taken() {
    let bench = Bench::new();
    png_head(&bench, "grey.png", 60_000, 1, 0);
    png_head(&bench, "colours.png", 8_000, 8, 2);
    for (image, px) in [("grey.png", "60000 x 60000"), ("colours.png", "8000 x 8000")] {
        for mode in ["--detector street", "--lanes", "--signs", "--traffic-light"] {
            let said = within_mib(&bench, 1024, &format!("look {mode} {image}"));
            let expected = format!("reading {image}: {px} pixels: expected at most 16 megapixels");
            assert!(said.code == Some(1) && said.stderr.contains(&expected), "{mode}: {said:?}");
        }
    }
    // With a higher limit the image is read, and found truncated.
    let said = bench.swerve(&["look", "--signs", "--megapixels", "64", "colours.png"]);
    assert!(said.code == Some(1) && !said.stderr.contains("megapixels"), "{said:?}");
}

#[test]
fn stream_without_end_is_refused_wherever_one_is_read_whole() {
    let bench = Bench::new();
    for args in [
        "track --tracker sort --out tracks.txt /dev/stdin",
        "eval localization /dev/stdin",
        "eval score /dev/stdin",
        "map check --map /dev/stdin short.toml",
        "map show /dev/stdin",
        "run /dev/stdin",
        "run short.toml -c /dev/stdin",
    ] {
        let said = within_mib(&bench, 1024, &format!("{args} < /dev/zero"));
        assert!(matches!(said.code, Some(1 | 2)), "{args}: {said:?}");
        assert!(said.stderr.contains("it is l") && said.stderr.contains(" MiB"), "{args}: {said:?}");
    }
}

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ended_before = self.0.kill();
        let _ended_before = self.0.wait();
    }
}

/// Field of a process's memory status, MiB.
fn memory_mib(process: u32, figure: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(figure))?;
    line.trim_start_matches(':').split_whitespace().next()?.parse().ok().map(|kib: u64| kib >> 10)
}

/// 64 MiB of pings, whose pongs would take 64 MiB.
#[test]
fn viewer_that_pings_and_never_reads_takes_no_memory() {
    const PINGS: usize = 1 << 19;
    let bench = Bench::new();
    let args = ["view", "short.toml", "--paused", "--no-open", "--port", "0", "--foxglove", "127.0.0.1:0"];
    let mut command = bench.command(&args);
    let mut view = Killed(command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap());
    let lines = BufReader::new(view.0.stdout.take().unwrap()).lines().map_while(Result::ok);
    let at = lines.filter_map(|line| line.split("ws://").nth(1).map(str::to_owned)).next().unwrap();
    let mut viewer = TcpStream::connect(at.trim()).unwrap();
    let request = format!(
        "GET / HTTP/1.1\r\nHost: {at}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
    );
    viewer.write_all(request.as_bytes()).unwrap();
    let mut answer = [0; 12];
    viewer.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 101");
    let before = memory_mib(view.0.id(), "VmRSS").unwrap();
    viewer.set_write_timeout(Some(Duration::from_secs(2))).unwrap();
    let ping = [&[0x89, 0x80 | 122, 0, 0, 0, 0][..], &[b'p'; 122]].concat();
    let some = ping.repeat(64);
    let sent = (0..PINGS / 64).map(|_| viewer.write_all(&some)).find_map(Result::err);
    let kind = sent.expect("it is not read for ever").kind();
    assert!(matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut), "{kind}");
    let after = memory_mib(view.0.id(), "VmHWM").unwrap();
    assert!(after < before + 16, "{before} MiB, then {after} MiB");
}

/// Computes for a minute or more: `.ci/run` runs it beside the tests with the real clock.
mod long {
    use super::*;

    #[test]
    #[ignore = "a minute"]
    fn drive_of_2000_s_takes_less_than_200_mb_and_has_its_report() {
        const SCENARIO: &str = r#"name = "long"

    [road]
    segments = [{ length_m = 9000.0 }]
    lane_width_m = 4.0
    left_m = 6.0
    right_m = 2.0

    [ego]
    target_speed_mps = 4.0
    end_m = 8900.0

    [[actor]]
    name = "parked van"
    kind = "car"
    s_m = 80.0
    d_m = 5.0

    [end]
    timeout_s = 2000.0
    "#;
        let bench = Bench::new();
        bench.write("long.toml", SCENARIO);
        let mut command = bench.command(&["run", "long.toml", "--out", "out"]);
        let mut run = Killed(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        let mut most_mib = 0;
        let status = loop {
            if let Some(status) = run.0.try_wait().unwrap() {
                break status;
            }
            most_mib = most_mib.max(memory_mib(run.0.id(), "VmHWM").unwrap_or(0));
            std::thread::park_timeout(Duration::from_millis(5));
        };
        assert!(status.success(), "{status}");
        // 200 MB is 190 MiB.
        assert!(most_mib < 190, "{most_mib} MiB");
        let report = bench.read("out/report.html");
        assert!(report.contains("The drive is long") && report.len() > 1 << 20);
    }
}
