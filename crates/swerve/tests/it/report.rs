//! Report pages of runs and studies: their contents, and their rendering in a real browser. Without a browser the tests
//! that need one print a note; `.ci/tools` installs Debian's.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use swerve_report::page::data_of;

use crate::browser::Page;
use crate::support::Bench;

const STUDY: &str = "description = \"Two speeds\"\nbase = { scenario = \"short.toml\" }\n\
    [[axis]]\nkey = \"ego.speed_mps\"\nvalues = [8.0, 12.0]\n[[axis]]\nkey = \"seed\"\nvalues = [1, 2, 3]\n";

fn data(bench: &Bench, page: &str) -> Value {
    serde_json::from_str(data_of(&bench.read(page)).unwrap()).unwrap()
}

/// Browser of this machine, if any.
pub(crate) fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = std::env::split_paths(&path).flat_map(|folder| names.map(|name| folder.join(name)));
    let found = found.into_iter().find(|program| program.is_file());
    if found.is_none() {
        swerve_tests::skipped("no Chromium on the path");
    }
    found
}

/// HTML of a page after `ms` of the browser's virtual time, without its data and script. The console must be empty: no
/// errors, no warnings.
fn drawn(browser: &Path, page: &Path, hash: &str, ms: u32) -> String {
    drawn_at(browser, &format!("file://{}{hash}", page.display()), ms)
}

/// Same as [`drawn`], for an address.
pub(crate) fn drawn_at(browser: &Path, address: &str, ms: u32) -> String {
    let profile = tempfile::tempdir().unwrap();
    let said = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("--virtual-time-budget={ms}"))
        .arg(address)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&said.stderr).into_owned();
    let told: Vec<&str> = errors.lines().filter(|line| line.contains("CONSOLE")).collect();
    assert!(said.status.success() && told.is_empty(), "{address}: {told:?} {}", said.status);
    let html = String::from_utf8(said.stdout).unwrap();
    html.split("<script").next().unwrap().to_owned()
}

/// Text of the element with this id.
pub(crate) fn text<'a>(html: &'a str, id: &str) -> &'a str {
    let (_, rest) = html.split_once(&format!("id=\"{id}\"")).unwrap_or_else(|| panic!("no {id} in {html}"));
    let (_, rest) = rest.split_once('>').unwrap();
    rest.split('<').next().unwrap()
}

#[test]
fn page_of_a_run_equals_that_of_its_log() {
    let bench = Bench::new();
    bench.good(&[
        "run",
        "short.toml",
        "--out",
        "o",
        "--set",
        "operator.planner.runtime={fixed_ms=20}",
        "--seed",
        "2",
    ]);
    let said = bench.good(&["report", "o/log.mcap", "--out", "again.html"]);
    assert_eq!(said, "again.html\n");
    assert!(bench.read("o/report.html") == bench.read("again.html"), "the same run, the same bytes");
    let page = data(&bench, "again.html");
    assert_eq!(
        page["command"],
        "swerve run short.toml --set 'operator.planner.runtime={fixed_ms=20}' --seed 2"
    );
    assert_eq!(page["metrics"]["verdict"], "avoided");
    assert_eq!(page["digest"], page["metrics"]["digest"]);
    assert_eq!(page["actors"][0]["name"], "person");
    let changed: Vec<&str> =
        page["changed"].as_array().unwrap().iter().map(|change| change["key"].as_str().unwrap()).collect();
    assert_eq!(changed, ["operator.planner.runtime.fixed_ms", "seed"]);
    let planner = page["operators"].as_array().unwrap().iter().position(|o| o["name"] == "planner").unwrap();
    let took = page["steps"]["took"].as_array().unwrap();
    let of = page["steps"]["operator"].as_array().unwrap();
    let mut times = took.iter().zip(of).filter(|(_, of)| **of == planner);
    assert!(times.all(|(us, _)| *us == 20_000), "the planner takes 20 ms, always");
    assert!(bench.read("o/report.html").len() < 1_000_000);
    // Without the metrics beside the log, the page states that they are missing.
    std::fs::remove_file(bench.path("o/metrics.json")).unwrap();
    bench.good(&["report", "o", "--out", "bare.html"]);
    let bare = data(&bench, "bare.html");
    assert!(bare["metrics"].is_null() && bare["notes"][0].as_str().unwrap().contains("metrics.json"));
}

/// If a log holds JPEG files instead of raw images, its page shows these.
#[test]
fn camera_pictures_of_a_run_are_in_the_page_of_its_log() {
    let bench = Bench::new();
    let eye = "[log]\nsensors = [\"eye\"]\n[camera.eye]\nwidth_px = 64\nheight_px = 48\noutputs = [\"depth\", \"rgb\"]\n";
    bench.write("eye.toml", eye);
    bench.write("start.toml", &bench.read("short.toml").replace("timeout_s = 10.0", "timeout_s = 1.3"));
    let pictures = |page: &str| -> Vec<(Value, Value)> {
        let photos = data(&bench, page)["photos"].as_array().unwrap().clone();
        let is_png = |photo: &Value| photo["data"].as_str().unwrap().starts_with("data:image/png;base64,");
        assert!(photos.iter().all(is_png), "{page}");
        photos.iter().map(|photo| (photo["t"].clone(), photo["stream"].clone())).collect()
    };
    for (images, count) in [("jpeg", 2), ("lossless", 2), ("none", 0)] {
        let set = format!("log.images={images}");
        bench.good(&["run", "start.toml", "-c", "eye.toml", "--set", &set, "--out", "o"]);
        bench.good(&["report", "o/log.mcap", "--out", "again.html"]);
        let own = pictures("o/report.html");
        assert!(own.len() == count && own.iter().all(|(_, stream)| stream == "eye.rgb"), "{images}: {own:?}");
        assert_eq!(pictures("again.html"), own, "{images}");
    }
}

#[test]
fn comparison_finds_where_two_runs_diverge() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "a"]);
    bench.good(&["run", "short.toml", "--out", "b", "--set", "sensing.range_m=20"]);
    bench.good(&["report", "a", "b"]);
    let page = data(&bench, "a/comparison.html");
    let first = &page["parting"][0];
    assert_eq!(
        (&first["stream"], &first["by"]),
        (&"obstacles".into(), &"content".into()),
        "what is seen differs first"
    );
    bench.good(&["report", "a", "a", "--out", "same.html"]);
    let same = data(&bench, "same.html");
    assert!(same["parting"].as_array().unwrap().iter().all(|stream| stream["at"].is_null()));
    let said = bench.swerve(&["report", "nothing"]);
    assert!(said.code == Some(1) && said.stderr.contains("nothing"), "{said:?}");
    std::fs::create_dir(bench.path("empty")).unwrap();
    let said = bench.swerve(&["report", "empty"]);
    assert!(said.stderr.contains("empty: expected log.mcap of a run or report.html of a study"), "{said:?}");
}

#[test]
fn browser_draws_and_plays_a_run() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    let name = "</script><script>document['querySelector']('title')['remove']()</script>";
    bench.write(
        "nasty.toml",
        &bench.read("short.toml").replace("name = \"person\"", &format!("name = \"{name}\"")),
    );
    bench.good(&["run", "nasty.toml", "--out", "o"]);
    let page = bench.path("o/report.html");
    let still = drawn(&browser, &page, "#t=1.25", 1000);
    assert_eq!(text(&still, "time"), "1.25 s");
    assert!(
        still.contains("avoided") && still.contains("Run times") && still.contains("Speed, m/s"),
        "{still}"
    );
    assert!(still.contains("<title>short: ") && still.contains("id=\"repeat\""), "a name is a text: {still}");
    // On a busy machine a browser draws few frames, often only one: retried until there is a second one.
    let seconds = |ms: u32| -> f64 {
        let played = drawn(&browser, &page, "#t=1.25&play", ms);
        text(&played, "time").trim_end_matches(" s").parse().unwrap()
    };
    let mut lengths = [2000, 6000, 18_000].into_iter().cycle().take(18);
    assert!(lengths.any(|ms| seconds(ms) > 1.25), "the player stands still");
    let mut metrics: Value = serde_json::from_str(&bench.read("o/metrics.json")).unwrap();
    let closest = format!("{:.2} s", metrics["min_distance_at_s"].as_f64().unwrap());
    assert_eq!(text(&drawn(&browser, &page, "", 1000), "time"), closest, "it opens where it was decided");
    metrics["why"] = serde_json::json!({
        "actor": name, "verdict": "avoided", "sentence": format!("{name} was seen late"),
        "steps": [{ "what": "first_tracked", "at_s": 0.5, "waited": [{ "for": "planner busy", "ms": 20.0 }] }],
    });
    bench.write("o/metrics.json", &metrics.to_string());
    bench.good(&["report", "o"]);
    let told = drawn(&browser, &page, "", 1000);
    for part in ["was seen late", "0.50 s</button> first tracked", "waited 20 ms for planner busy"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let picked = drawn(&browser, &page, "#step=40", 1000);
    assert!(
        picked.contains("What it read") && picked.contains("From the sensor's frame to here"),
        "{picked}"
    );
}

#[test]
fn browser_draws_and_filters_studies() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    bench.write("study.toml", STUDY);
    bench.good(&["study", "study.toml", "--out", "s"]);
    bench.good(&["study", "study.toml", "--out", "t", "--set", "sensing.range_m=20"]);
    bench.good(&["report", "s", "t"]);
    let all = drawn(&browser, &bench.path("s/report.html"), "", 1000);
    assert_eq!(text(&all, "count"), "6 of 6 cells");
    assert!(all.contains("3 of 3"), "{all}");
    let few = drawn(&browser, &bench.path("s/report.html"), "#filter=12.0", 1000);
    assert_eq!(text(&few, "count"), "3 of 6 cells");
    let both = drawn(&browser, &bench.path("s/comparison.html"), "", 1000);
    assert!(both.contains("6 cells are in both"), "{both}");
}

#[test]
fn two_runs_are_distinguished_by_their_cars() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "a"]);
    bench.good(&["run", "short.toml", "--out", "b", "--set", "ego.speed_mps=13"]);
    bench.good(&["report", "a", "b"]);
    let both = drawn(&browser, &bench.path("a/comparison.html"), "", 1000);
    assert!(both.contains("The cars are more than 0.1 m apart from"), "{both}");
    bench.good(&["report", "a", "a", "--out", "same.html"]);
    let same = drawn(&browser, &bench.path("same.html"), "", 1000);
    assert!(same.contains("the cars are never more than 0.1 m apart"), "{same}");
}

#[test]
fn studies_without_common_cells_differ() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    bench.write("a.toml", STUDY);
    bench.write("b.toml", &STUDY.replace("ego.speed_mps", "sensing.range_m"));
    bench.good(&["study", "a.toml", "--out", "a"]);
    bench.good(&["study", "b.toml", "--out", "b"]);
    bench.good(&["report", "a", "b"]);
    let both = drawn(&browser, &bench.path("a/comparison.html"), "", 1000);
    assert!(both.contains("no cell is in both: there is nothing to compare"), "{both}");
    assert!(!both.contains("are the same"), "{both}");
}

#[test]
fn square_opens_the_pages_of_its_runs_and_rows_are_one_line_high() {
    let bench = Bench::new();
    bench.write("study.toml", STUDY);
    bench.good(&["study", "study.toml", "--out", "s"]);
    let cells = |page: &Value| page["cells"].as_array().unwrap().clone();
    assert!(cells(&data(&bench, "s/report.html")).iter().all(|cell| cell["report"].is_null()));
    // Cells finished without a page are run again.
    bench.good(&["study", "study.toml", "--out", "s", "--reports"]);
    let page = data(&bench, "s/report.html");
    let columns: Vec<&str> =
        page["columns"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    let head = ["ego.speed_mps", "seed"].into_iter().chain(columns).collect::<Vec<_>>().join(",");
    let csv = bench.read("s/cells.csv");
    assert!(csv.starts_with(&head.replace("ego.speed_mps", "speed_mps")), "{head}\n{csv}");
    for cell in cells(&page) {
        let run = data(&bench, &format!("s/{}", cell["report"].as_str().unwrap()));
        assert_eq!((&run["digest"], &run["command"]), (&cell["digest"], &cell["command"]));
    }
    let Some(browser) = browser() else { return };
    let mut shown = Page::open(&browser, &format!("file://{}", bench.path("s/report.html").display()));
    shown.until("document.querySelectorAll('#cells tbody tr').length === 6");
    let tallest =
        "Math.max(...[...document.querySelectorAll('#cells tbody tr')].map((row) => row.clientHeight))";
    let tallest = shown.evaluate(tallest).as_f64().unwrap();
    assert!(tallest < 45.0, "a row is {tallest} px high");
    shown.evaluate("document.querySelector('table.heat td button').click()");
    assert_eq!(shown.evaluate("document.querySelectorAll('#heat a').length"), 3);
    // Long scenario names below the axis of a plot are slanted, short ones are not.
    for (name, aslant) in [("a_long_name_of_a_scenario", 10), ("s", 0)] {
        let texts = format!(
            "namesBelow([...Array(10).keys()].map((k) => ({{ label: `{name}_${{k}}`, at: 60 + 100 * k }})), 260).texts"
        );
        let turned = format!("{texts}.filter((text) => text.hasAttribute('transform')).length");
        assert_eq!(shown.evaluate(&turned), aslant);
    }
    assert!(shown.errors.is_empty(), "{:?}", shown.errors);
}

#[test]
fn page_shows_only_the_non_default_settings_of_a_sensor() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "o", "--set", "camera.front.width_px=64"]);
    let page = data(&bench, "o/report.html");
    let changed: Vec<&str> =
        page["changed"].as_array().unwrap().iter().map(|change| change["key"].as_str().unwrap()).collect();
    assert_eq!(changed, ["camera.front", "camera.front.width_px"]);
}
