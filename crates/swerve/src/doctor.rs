//! `swerve doctor`: what this machine offers, and what Swerve will use.

use std::path::Path;

use swerve_gpu::{self as gpu, AdapterKind, Adapters};
use swerve_report::output;
use swerve_stack::config::camera::RenderBackend;

/// `swerve doctor`.
#[derive(clap::Args, Debug)]
pub(crate) struct DoctorArgs {}

/// Runs `swerve doctor`.
pub(crate) fn run(_: &DoctorArgs) -> anyhow::Result<()> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let mut lines = vec![
        line("swerve", env!("CARGO_PKG_VERSION")),
        line(
            "machine",
            &format!("{} {}, {processors} processors", std::env::consts::ARCH, std::env::consts::OS),
        ),
    ];
    lines.extend(features([
        ("foxglove", swerve_view::MISSING),
        ("gpu", gpu::MISSING),
        ("processes", swerve_ipc::MISSING),
        ("ros2", swerve_ros2::bridge::MISSING),
    ]));
    lines.push(String::new());
    lines.extend(rendering(&gpu::probe()));
    lines.push(String::new());
    lines.push(line("shared memory", &shared_memory(Path::new("/dev/shm"))));
    lines.extend(left_behind(swerve_ipc::dead_runs()).map(|left| line("", &left)));
    output::print(&(lines.join("\n") + "\n"))
}

fn line(name: &str, value: &str) -> String {
    format!("{name:<15}{value}").trim_end().to_owned()
}

/// Reports which optional features the program was built with, and how to build the others.
fn features(all: [(&str, Option<&str>); 4]) -> Vec<String> {
    let state = |(name, missing): (&str, Option<&str>)| format!("{name}: {}", missing.unwrap_or("built in"));
    let heads = ["features", "", "", ""];
    heads.into_iter().zip(all.map(state)).map(|(head, state)| line(head, &state)).collect()
}

/// Reports the rendering back ends and which one is used where.
fn rendering(adapters: &Adapters) -> Vec<String> {
    let mut lines = vec![line(
        "rendering",
        "cpu: the rasteriser of this program; the same bytes on every x86-64 machine and any number of threads",
    )];
    for adapter in &adapters.found {
        let what = match (&adapter.refused, adapter.kind) {
            (Some(why), _) => format!("not used, {why}"),
            (None, Some(AdapterKind::Gpu)) => "gpu".to_owned(),
            (None, _) => {
                "software: asked for by that name only; `cpu` is faster and the same everywhere".to_owned()
            }
        };
        lines.push(line("", &format!("{adapter}: {what}")));
    }
    lines.extend(adapters.absent.iter().map(|why| line("", why)));
    lines.push(line("  used by", "render.backend = \"auto\", the default"));
    let (chosen, why) = RenderBackend::Auto.on_this_machine(adapters);
    lines.push(line("", "virtual time: cpu, so that a run has the same digest on every machine"));
    lines.push(line("", &format!("wall clock, data sets: {}, {why}", chosen.in_virtual_time().name())));
    lines
}

/// Reports the folder in which the processes of one run share images.
fn shared_memory(folder: &Path) -> String {
    match std::fs::metadata(folder) {
        Ok(at) if at.is_dir() => match swerve_ipc::writable(folder) {
            Ok(()) => folder.display().to_string(),
            Err(why) => format!("{}: this user may not write there ({why})", folder.display()),
        },
        _ => format!("none: there is no folder {}", folder.display()),
    }
}

/// Reports shared files left by killed runs.
fn left_behind(runs: usize) -> Option<String> {
    let runs = match runs {
        0 => return None,
        1 => "1 run that was killed".to_owned(),
        more => format!("{more} runs that were killed"),
    };
    Some(format!("holds files of {runs}: the next run with processes removes them"))
}

#[cfg(test)]
mod tests {
    use swerve_gpu::AdapterReport;

    use super::*;

    fn adapter(name: &str, kind: AdapterKind, refused: Option<&str>) -> AdapterReport {
        AdapterReport {
            name: name.into(),
            api: "vulkan",
            driver: String::new(),
            device_type: if kind == AdapterKind::Gpu { "discrete" } else { "cpu" },
            kind: Some(kind),
            refused: refused.map(Into::into),
        }
    }

    fn told(found: Vec<AdapterReport>, absent: &[&str]) -> String {
        let absent = absent.iter().map(|why| (*why).to_owned()).collect();
        rendering(&Adapters { found, absent }).join("\n")
    }

    #[test]
    fn missing_feature_is_reported_with_its_build_option() {
        let why = "this program was built without ROS 2: build it with `--features ros2`";
        let lines = features([("foxglove", None), ("gpu", None), ("processes", None), ("ros2", Some(why))]);
        assert_eq!(lines[0], "features       foxglove: built in");
        assert_eq!(lines[3], format!("               ros2: {why}"));
    }

    #[test]
    fn available_gpu_is_named_and_used() {
        let text = told(vec![adapter("Strong One", AdapterKind::Gpu, None)], &[]);
        assert!(text.contains("Strong One (vulkan, discrete): gpu"), "{text}");
        assert!(text.contains("wall clock, data sets: gpu, Strong One"), "{text}");
    }

    #[test]
    fn missing_gpu_is_reported_with_reasons() {
        let found = vec![
            adapter("Broken", AdapterKind::Gpu, Some("parent device is lost")),
            adapter("llvmpipe", AdapterKind::Software, None),
        ];
        let text = told(found, &["gl: no loader"]);
        assert!(text.contains("Broken (vulkan, discrete): not used, parent device is lost"), "{text}");
        assert!(text.contains("llvmpipe (vulkan, cpu): software"), "{text}");
        assert!(text.contains("wall clock, data sets: cpu, no gpu adapter"), "{text}");
        assert!(text.contains("gl: no loader"), "{text}");
    }
}
