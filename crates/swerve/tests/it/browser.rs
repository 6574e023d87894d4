//! A real browser, inspected and controlled by the DevTools protocol over a pair of pipes
//! (<https://chromedevtools.github.io/devtools-protocol/>).

#![expect(clippy::disallowed_methods, reason = "another program is waited for, in real time")]

use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

/// A page in a separate browser.
pub(crate) struct Page {
    program: Child,
    to: File,
    from: BufReader<File>,
    sent: u64,
    session: Option<String>,
    /// Errors and warnings from the console.
    pub(crate) errors: Vec<String>,
    _profile: TempDir,
}

impl Page {
    pub(crate) fn open(browser: &Path, address: &str) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let pipe = |name: &str| profile.path().join(name);
        let made = Command::new("mkfifo").args([pipe("in"), pipe("out")]).status().unwrap();
        assert!(made.success());
        let program = Command::new("sh")
            .args(["-c", "cd \"$1\" && shift && exec \"$0\" \"$@\" 3<in 4>out"])
            .arg(browser)
            .arg(profile.path())
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe"])
            .arg(format!("--user-data-dir={}", pipe("profile").display()))
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let to = OpenOptions::new().write(true).open(pipe("in")).unwrap();
        let from = BufReader::new(File::open(pipe("out")).unwrap());
        let (sent, session, errors) = (0, None, Vec::new());
        let mut page = Self { program, to, from, sent, session, errors, _profile: profile };
        let target = page.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        page.session = page.call("Target.attachToTarget", attach)["sessionId"].as_str().map(str::to_owned);
        page.call("Runtime.enable", json!({}));
        page.call("Log.enable", json!({}));
        page.call("Page.navigate", json!({ "url": address }));
        page
    }

    /// Calls a method and waits for its result.
    fn call(&mut self, method: &str, params: Value) -> Value {
        self.sent += 1;
        let mut message = json!({ "id": self.sent, "method": method, "params": params });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.to.write_all(format!("{message}\0").as_bytes()).unwrap();
        loop {
            let mut bytes = Vec::new();
            self.from.read_until(0, &mut bytes).unwrap();
            assert_eq!(bytes.pop(), Some(0), "the browser has ended");
            let said: Value = serde_json::from_slice(&bytes).unwrap();
            if said["id"] == self.sent {
                // A page that is reloading has no state yet.
                assert!(said["error"].is_null() || method == "Runtime.evaluate", "{method}: {said}");
                return said["result"].clone();
            }
            self.hear(&said);
        }
    }

    fn hear(&mut self, event: &Value) {
        let kind = match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => "error",
            Some("Runtime.consoleAPICalled") => event["params"]["type"].as_str().unwrap_or_default(),
            Some("Log.entryAdded") => event["params"]["entry"]["level"].as_str().unwrap_or_default(),
            _ => "",
        };
        if ["error", "warning"].contains(&kind) {
            self.errors.push(event.to_string());
        }
    }

    /// Evaluates an expression in the page.
    pub(crate) fn evaluate(&mut self, expression: &str) -> Value {
        let ask = json!({ "expression": expression, "returnByValue": true });
        self.call("Runtime.evaluate", ask)["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub(crate) fn until(&mut self, expression: &str) {
        let begun = Instant::now();
        while self.evaluate(expression) != json!(true) {
            assert!(begun.elapsed() < Duration::from_secs(60), "still not {expression}: {:?}", self.errors);
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Presses or releases a key: `keyDown`, `keyUp`.
    pub(crate) fn key(&mut self, what: &str, code: &str) {
        self.call("Input.dispatchKeyEvent", json!({ "type": what, "code": code, "key": code }));
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ended = self.program.kill().and_then(|()| self.program.wait().map(drop));
    }
}
