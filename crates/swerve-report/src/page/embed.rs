//! Embedding of data in a page, and extraction from it.

use std::io;

use serde::Serialize;

use swerve_draw::escape;

const TEMPLATE: &str = include_str!("../../page/page.html");
const STYLE: &str = include_str!("../../page/style.css");
/// Scripts in order of dependency.
const SCRIPTS: [&str; 11] = [
    include_str!("../../page/kit.js"),
    include_str!("../../page/chart.js"),
    include_str!("../../page/player.js"),
    include_str!("../../page/gantt.js"),
    include_str!("../../page/run.js"),
    include_str!("../../page/heatmap.js"),
    include_str!("../../page/study.js"),
    include_str!("../../page/compare.js"),
    include_str!("../../page/wheel.js"),
    include_str!("../../page/live.js"),
    include_str!("../../page/main.js"),
];
const DATA_BEGIN: &str = "<script type=\"application/json\" id=\"data\">";
const DATA_END: &str = "</script>";

/// The page that shows `data`. Texts in the data are never read as markup: `<` is always escaped.
pub fn page(title: &str, data: &impl Serialize) -> String {
    let mut html = Vec::new();
    let mut rest = TEMPLATE;
    let mut until = |mark: &str, html: &mut Vec<u8>| {
        let (before, after) = rest.split_once(&format!("<!--{mark}-->")).expect("page.html has all marks");
        html.extend_from_slice(before.as_bytes());
        rest = after;
    };
    until("title", &mut html);
    html.extend_from_slice(escape(title).as_bytes());
    until("style", &mut html);
    html.extend_from_slice(STYLE.as_bytes());
    until("data", &mut html);
    serde_json::to_writer(Escaped(&mut html), data).expect("pages are plain structs");
    until("script", &mut html);
    html.extend_from_slice(SCRIPTS.join("\n").as_bytes());
    html.extend_from_slice(rest.as_bytes());
    String::from_utf8(html).expect("all of it is text")
}

/// Writer that escapes JSON into a page. A long run is held in memory only once.
struct Escaped<'a>(&'a mut Vec<u8>);

impl io::Write for Escaped<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut parts = bytes.split(|byte| *byte == b'<');
        self.0.extend_from_slice(parts.next().unwrap_or_default());
        for part in parts {
            self.0.extend_from_slice(b"\\u003c");
            self.0.extend_from_slice(part);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The JSON text that a page was made from; `None` if the text is not such a page.
pub fn data_of(html: &str) -> Option<&str> {
    let (_, rest) = html.split_once(DATA_BEGIN)?;
    rest.split_once(DATA_END).map(|(data, _)| data)
}
