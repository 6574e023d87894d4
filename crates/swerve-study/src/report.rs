//! `swerve report`: page of a run or a study, or of two of them side by side.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use serde_json::Value;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::page::{LogSoFar, REPORT, log_of, page_of_log, pair_of_logs};
use swerve_report::files::write_whole;
use swerve_report::output::print;
use swerve_report::page::{Page, Pair, data_of};
use swerve_stack::Registry;
use swerve_text::{FILE_MAX, read_string};

/// `swerve report`.
#[derive(clap::Args, Debug)]
pub struct ReportArgs {
    /// Log (MCAP), folder of a run, or folder of a study
    a: PathBuf,
    /// Second one of the same kind, to compare with
    b: Option<PathBuf>,
    /// Page to write [default: report.html, or comparison.html for two, in the folder of the first]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Ego of a run with several [default: the first]
    #[arg(long, value_name = "NAME", conflicts_with = "b")]
    ego: Option<String>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

/// Input named on the command line.
enum Source {
    Log(PathBuf),
    /// Data of a study's page.
    Study(Value),
}

/// Runs `swerve report`.
///
/// # Errors
/// If there is neither a log nor a study, if a run is compared with a study, or if the page cannot be written.
pub fn run(args: &ReportArgs, registry: &Registry) -> anyhow::Result<()> {
    let a = Source::read(&args.a)?;
    let name = if args.b.is_some() { "comparison.html" } else { REPORT };
    let folder = if args.a.is_dir() { &args.a } else { args.a.parent().unwrap_or(Path::new("")) };
    let out = args.out.clone().unwrap_or_else(|| folder.join(name));
    args.overwrite.check([out.as_path()])?;
    let html = match (a, args.b.as_deref().map(Source::read).transpose()?) {
        (Source::Log(log), None) => page_of_log(registry, &log, args.ego.as_deref())?.html(),
        (Source::Log(a), Some(Source::Log(b))) => {
            let [a, b] = [LogSoFar::read(&a, |_| true)?, LogSoFar::read(&b, |_| true)?];
            pair_of_logs(registry, &a, &b)?.html()
        }
        (Source::Study(_), _) if args.ego.is_some() => {
            bail!("--ego: expected a run, found a study: {}", args.a.display())
        }
        (Source::Study(study), None) => swerve_report::page::page(&title(&study), &study),
        (Source::Study(a), Some(Source::Study(b))) => {
            let title = format!("{} | {}", title(&a), title(&b));
            Page::new("studies", title, Pair { a, b, parting: () }).html()
        }
        _ => bail!("{}: expected two runs or two studies, found one of each", args.a.display()),
    };
    write_whole(&out, html.as_bytes())?;
    print(&format!("{}\n", out.display()))
}

impl Source {
    fn read(path: &Path) -> anyhow::Result<Self> {
        if !path.is_dir() {
            return Ok(Self::Log(path.to_owned()));
        }
        if let Some(log) = log_of(path) {
            return Ok(Self::Log(log));
        }
        let page = path.join(REPORT);
        let expected = || {
            let path = path.display();
            format!(
                "{path}: expected log.mcap of a run or {REPORT} of a study, which is there when all cells are driven"
            )
        };
        let text = read_string(&page, FILE_MAX).with_context(expected)?;
        let data = data_of(&text).and_then(|data| serde_json::from_str::<Value>(data).ok());
        data.filter(|data| data["kind"] == "study").map(Self::Study).with_context(expected)
    }
}

fn title(page: &Value) -> String {
    page["title"].as_str().unwrap_or_default().to_owned()
}
