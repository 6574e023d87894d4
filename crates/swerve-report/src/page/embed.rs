//! Data into a page, and out of it again.

use serde::Serialize;

use swerve_draw::escape;

const TEMPLATE: &str = include_str!("../../page/page.html");
const STYLE: &str = include_str!("../../page/style.css");
/// In the order in which they build on each other.
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

/// The page that shows `data`. Whatever texts the data hold, they stay data: no `<` is left in them.
pub fn page(title: &str, data: &impl Serialize) -> String {
    let data = serde_json::to_string(data).expect("pages are plain structs").replace('<', "\\u003c");
    let scripts = SCRIPTS.join("\n");
    let mut html = String::with_capacity(TEMPLATE.len() + STYLE.len() + scripts.len() + data.len());
    let mut rest = TEMPLATE;
    let title = escape(title);
    for (mark, text) in [("title", &*title), ("style", STYLE), ("data", &data), ("script", &scripts)] {
        let (before, after) = rest.split_once(&format!("<!--{mark}-->")).expect("page.html has all marks");
        html += before;
        html += text;
        rest = after;
    }
    html + rest
}

/// The JSON text that a page was made of; none where it is no such page.
pub fn data_of(html: &str) -> Option<&str> {
    let (_, rest) = html.split_once(DATA_BEGIN)?;
    rest.split_once(DATA_END).map(|(data, _)| data)
}
