//! A run watched and controlled while in progress, by a client and by a real browser.

#![expect(clippy::disallowed_methods, reason = "another program is waited for, in real time")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::browser::Page;
use crate::report::{browser, drawn_at, text};
use crate::support::Bench;

/// The program while it serves a page.
struct Viewed {
    program: Child,
    address: String,
}

impl Viewed {
    fn start(bench: &Bench, words: &[&str]) -> Self {
        let mut program = Command::new(env!("CARGO_BIN_EXE_swerve"))
            .args(["view", "--no-open"])
            .args(words)
            .current_dir(bench.path(""))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut address = String::new();
        BufReader::new(program.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { program, address: address.trim().to_owned() }
    }

    /// Status and body of the response to a request.
    fn ask(&self, method: &str, path: &str, body: &str) -> (u16, String) {
        let (host, token) = self.address.strip_prefix("http://").unwrap().split_once('/').unwrap();
        let mut stream = TcpStream::connect(host).unwrap();
        let length = body.len();
        let head = format!("{method} /{token}{path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n");
        stream.write_all(format!("{head}Content-Length: {length}\r\n\r\n{body}").as_bytes()).unwrap();
        let mut said = String::new();
        stream.read_to_string(&mut said).unwrap();
        let (head, body) = said.split_once("\r\n\r\n").unwrap();
        (head[9..12].parse().unwrap(), body.to_owned())
    }

    fn rows(&self, have: &str) -> Value {
        let (status, body) = self.ask("GET", &format!("rows?{have}"), "");
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }

    fn command(&self, what: &Value) {
        assert_eq!(self.ask("POST", "control", &what.to_string()), (200, "{}".into()));
    }

    /// All rows, once `enough` holds.
    fn until(&self, enough: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let rows = self.rows("{}");
            if enough(&rows) {
                return rows;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "still {rows}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Viewed {
    fn drop(&mut self) {
        let _ended = self.program.kill().and_then(|()| self.program.wait().map(drop));
    }
}

#[test]
fn watched_run_equals_an_unwatched_one() {
    let bench = Bench::new();
    let digest = |words: &[&str]| -> Value {
        let said = bench.good(&[&["run", "short.toml", "--out", "o", "--json"], words].concat());
        serde_json::from_str::<Value>(&said).unwrap()["digest"].clone()
    };
    let viewed = Viewed::start(&bench, &["short.toml", "--speed", "max", "--paused"]);
    let paused = viewed.until(|rows| rows["state"] == "paused" && rows["ego"]["t"] != json!([]));
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(viewed.rows("{}")["end"], paused["end"], "it holds");
    viewed.command(&json!({ "do": "step" }));
    let stepped = viewed.until(|rows| rows["end"].as_i64() > paused["end"].as_i64());
    assert_eq!(stepped["state"], "paused");
    viewed.command(&json!({ "do": "go" }));
    let over = viewed.until(|rows| rows["state"] == "over");
    assert_eq!((&over["digest"], &over["verdict"]), (&digest(&[]), &"avoided".into()));
    // A client that has some rows gets the rest.
    let count = over["ego"]["t"].as_array().unwrap().len();
    let last = &over["ego"]["t"][count - 4];
    let rest = viewed.rows(&format!("{{\"ego\":{last}}}"));
    assert_eq!(rest["ego"]["t"].as_array().unwrap()[..], over["ego"]["t"].as_array().unwrap()[count - 3..]);
    assert!(viewed.ask("GET", "report", "").1.contains("id=\"data\""));
    viewed.command(&json!({ "do": "restart", "seed": 7, "set": ["sensing.range_m=20"] }));
    let again = viewed.until(|rows| rows["run"] == 2 && rows["state"] == "over");
    assert_eq!(again["digest"], digest(&["--seed", "7", "--set", "sensing.range_m=20"]));
    // From 1 s on with a stopping gate: the same drive before, another one after.
    let column = |rows: &Value, name: &str| -> Vec<i64> {
        rows["ego"][name].as_array().unwrap().iter().map(|x| x.as_i64().unwrap()).collect()
    };
    let stop = ["gate.enabled=true", "gate.emergency_at_ms=1000"];
    viewed.command(&json!({ "do": "restart", "set": stop, "from_s": 1.0 }));
    let changed = viewed.until(|rows| rows["run"] == 3 && rows["state"] == "over");
    let same = column(&again, "t").iter().take_while(|t| **t <= 1_000_000).count();
    for name in ["t", "x", "y", "v"] {
        assert_eq!(column(&changed, name)[..same], column(&again, name)[..same], "{name} up to 1 s");
    }
    assert_ne!(column(&changed, "v")[same..], column(&again, "v")[same..]);
    // The page offers commands that apply to the run shown, or none.
    for page in ["", "report"] {
        let html = viewed.ask("GET", page, "").1;
        assert!(
            html.contains(
                "\"command\":\"\",\"no_command\":\"No command line repeats this drive: up to 1.00 s"
            )
        );
    }
    let slip = json!({ "do": "restart", "seed": 7, "set": ["sensing.rang_m=20"] });
    let (status, why) = viewed.ask("POST", "control", &slip.to_string());
    assert!(status == 400 && why.contains("range_m"), "{status} {why}");
    assert_eq!(viewed.rows("{}")["run"], 3, "nothing was begun");
    for (method, path, body, status) in [
        ("POST", "control", "{\"do\":\"fly\"}", 400),
        ("POST", "control", "{\"do\":\"speed\",\"speed\":-1}", 400),
        ("GET", "rows?nonsense", "", 400),
        ("GET", "control", "", 404),
        ("DELETE", "", "", 405),
    ] {
        assert_eq!(viewed.ask(method, path, body).0, status, "{method} {path} {body}");
    }
}

#[test]
fn browser_shows_the_run_in_progress() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    let viewed = Viewed::start(&bench, &["short.toml"]);
    let page = drawn_at(&browser, &viewed.address, 3000);
    let seconds: f64 = text(&page, "time").trim_end_matches(" s").parse().unwrap();
    assert!(seconds > 0.2, "the player came to {seconds} s");
    drop(viewed);
    bench.good(&["run", "short.toml", "--out", "o"]);
    let viewed = Viewed::start(&bench, &["o"]);
    assert!(drawn_at(&browser, &viewed.address, 1000).contains("Run times"));
}

/// Last speed of the ego, mm/s, and its largest offset to the left, cm.
fn came_to(rows: &Value) -> (i64, i64) {
    let column = |name: &str| rows["ego"][name].as_array().unwrap().iter().map(|x| x.as_i64().unwrap());
    (column("v").next_back().unwrap(), column("y").max().unwrap())
}

fn held(steering: f64, throttle: f64, brake: f64) -> Value {
    json!({ "do": "hold", "steering": steering, "throttle": throttle, "brake": brake })
}

#[test]
fn person_drives_in_place_of_the_controller() {
    let bench = Bench::new();
    let viewed = Viewed::start(&bench, &["short.toml", "--speed", "max", "--paused"]);
    let drive = |run: u64, held: &Value| {
        viewed.command(&json!({ "do": "pause" }));
        viewed.command(&json!({ "do": "restart", "seed": 1, "set": [], "by_hand": true }));
        viewed.until(|rows| rows["run"] == run && rows["ego"]["t"] != json!([]));
        viewed.command(held);
        viewed.command(&json!({ "do": "go" }));
        came_to(&viewed.until(|rows| rows["run"] == run && rows["state"] == "over"))
    };
    let (status, why) = viewed.ask("POST", "control", &held(0.0, 0.0, 1.0).to_string());
    assert_eq!((status, why.trim()), (400, "this run is not driven by hand"));
    let (speed, left) = drive(2, &held(0.0, 0.0, 1.0));
    assert!(speed == 0 && left.abs() < 20, "it brakes: {speed} mm/s, {left} cm to the left");
    let (speed, left) = drive(3, &held(0.5, 0.0, 0.0));
    assert!(speed > 1000 && left > 300, "it turns: {speed} mm/s, {left} cm to the left");
    assert_eq!(viewed.ask("POST", "control", &held(2.0, 0.0, 0.0).to_string()).0, 400);
}

#[test]
fn arrow_keys_in_a_browser_drive_the_car() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    let viewed = Viewed::start(&bench, &["short.toml", "--paused"]);
    let mut page = Page::open(&browser, &viewed.address);
    page.until("document.getElementById('hand') !== null");
    page.evaluate("document.getElementById('hand').click()");
    page.until("document.getElementById('wheel') !== null");
    page.key("keyDown", "ArrowDown");
    page.until("document.getElementById('wheel').textContent.includes('brake 1.00')");
    page.evaluate("document.getElementById('go').click()");
    let stands =
        viewed.until(|rows| rows["run"] == 2 && rows["ego"]["v"] != json!([]) && came_to(rows).0 == 0);
    assert!(stands["commands"]["brake"].as_array().unwrap().iter().any(|brake| *brake == 1000));
    page.key("keyUp", "ArrowDown");
    page.key("keyDown", "ArrowUp");
    viewed.until(|rows| came_to(rows).0 > 300);
    page.until("parseFloat(document.getElementById('time').textContent) > 1");
    assert_eq!(page.errors, Vec::<String>::new());
}

#[test]
fn page_starts_no_program_and_names_no_file() {
    let bench = Bench::new();
    bench.write("secret", "");
    let viewed = Viewed::start(&bench, &["short.toml"]);
    let program = format!("[\"sh\", \"-c\", \"touch {}\"]", bench.path("ran").display());
    let file = bench.path("secret").display().to_string();
    let sets = [
        vec!["process.p.operators=[\"tracker\"]".to_owned(), format!("process.p.start={program}")],
        vec![format!("process={{p={{operators=[\"tracker\"],start={program}}}}}")],
        vec![format!("localization.map=\"{file}\"")],
        vec![format!("localization={{map=\"{file}\"}}")],
        vec![format!("operator.o={{kind=\"camera_objects\",detector=\"{file}\"}}")],
        vec![format!("source.rosbag=\"{file}\"")],
        vec![format!("live.route=\"{file}\"")],
        vec!["shared_memory.name=\"others\"".to_owned()],
    ];
    for set in sets {
        for from in [json!({}), json!({ "from_s": 0.5 })] {
            let mut ask = json!({ "do": "restart", "set": set });
            ask.as_object_mut().unwrap().extend(from.as_object().unwrap().clone());
            let (status, body) = viewed.ask("POST", "control", &ask.to_string());
            assert_eq!(status, 400, "{ask}: {body}");
            assert!(body.contains("starts programs or names files"), "{ask}: {body}");
        }
    }
    assert!(!bench.path("ran").exists());
}

#[test]
fn idle_connections_without_the_token_block_nobody() {
    const IDLE: usize = 200;
    let bench = Bench::new();
    let viewed = Viewed::start(&bench, &["short.toml", "--paused"]);
    let host = viewed.address.strip_prefix("http://").unwrap().split('/').next().unwrap().to_owned();
    let is_over = AtomicBool::new(false);
    let opened = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            // Half of them send the start of a request.
            let mut idle = std::collections::VecDeque::new();
            while !is_over.load(Ordering::Relaxed) {
                let Ok(mut stream) = TcpStream::connect(&host) else { continue };
                if opened.fetch_add(1, Ordering::Relaxed).is_multiple_of(2) {
                    let _may_be_closed = stream.write_all(b"GET / HTTP/1.1\r\n");
                }
                idle.push_back(stream);
                if idle.len() > IDLE {
                    idle.pop_front();
                }
            }
        });
        while opened.load(Ordering::Relaxed) < 2 * IDLE {
            std::thread::yield_now();
        }
        let before = opened.load(Ordering::Relaxed);
        let is_opening = || opened.load(Ordering::Relaxed) > before + IDLE / 10;
        // On a busy host the other thread may not have run by then.
        let all = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let asks = (0..50_000).take_while(|k| *k < 50 || !is_opening());
            asks.map(|_| viewed.ask("GET", "", "").0).collect::<Vec<_>>()
        }));
        is_over.store(true, Ordering::Relaxed);
        assert!(all.unwrap().into_iter().all(|status| status == 200));
        assert!(is_opening(), "none was opened meanwhile");
    });
}

#[test]
fn browser_is_opened_without_the_token_in_an_argument() {
    use std::os::unix::fs::PermissionsExt;
    let bench = Bench::new();
    let mode = |name: &str| bench.path(name).metadata().unwrap().permissions().mode() & 0o777;
    std::fs::create_dir(bench.path("bin")).unwrap();
    std::fs::create_dir(bench.path("runtime")).unwrap();
    bench.write("bin/xdg-open", "#!/bin/sh\necho \"$#\" > arguments.part\necho \"$1\" >> arguments.part\nmv arguments.part arguments\n");
    std::fs::set_permissions(bench.path("bin/xdg-open"), PermissionsExt::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", bench.path("bin").display(), std::env::var("PATH").unwrap());
    let mut program = bench
        .plain_command(&["view", "short.toml", "--paused"])
        .env("PATH", path)
        .env("DISPLAY", ":0")
        .env("XDG_RUNTIME_DIR", bench.path("runtime"))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut address = String::new();
    BufReader::new(program.stdout.take().unwrap()).read_line(&mut address).unwrap();
    let begun = Instant::now();
    while !bench.path("arguments").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "no browser is opened");
        std::thread::sleep(Duration::from_millis(20));
    }
    let said = bench.read("arguments");
    let [count, file] = said.lines().collect::<Vec<_>>()[..] else { panic!("{said}") };
    let token = address.trim().trim_end_matches('/').rsplit('/').next().unwrap();
    assert!(count == "1" && token.len() == 32 && !file.contains(token), "{said}");
    let folder = Path::new(file).parent().unwrap().file_name().unwrap().to_str().unwrap().to_owned();
    let folder = format!("runtime/{folder}");
    assert!(bench.read(&format!("{folder}/open.html")).contains(&format!("url={}\"", address.trim())));
    assert_eq!((mode(&folder), mode(&format!("{folder}/open.html"))), (0o700, 0o600));
    assert!(Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap().success());
    assert!(program.wait().unwrap().success());
    assert!(!bench.path(&folder).exists(), "the page is removed");
}
