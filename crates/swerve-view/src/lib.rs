//! `swerve view`: shows a run in progress in the report's player, at an address of this machine protected by a token.

#![cfg_attr(
    not(feature = "foxglove"),
    allow(dead_code, reason = "without the feature, its helpers are unused")
)]

mod drive;
#[cfg(feature = "foxglove")]
mod foxglove;
#[cfg(not(feature = "foxglove"))]
#[path = "no_foxglove.rs"]
mod foxglove;
mod http;
mod looks;
mod open;
mod reception;
mod server;
mod show;
mod vehicle;
mod wheel;

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;

use anyhow::Context as _;
use swerve_drive::RunInput;
use swerve_drive::interrupt::on_interrupt;
use swerve_drive::page::{log_of, page_of_log};
use swerve_report::output::{print, tell};
use swerve_stack::Registry;

pub use crate::drive::Summarise;
use crate::drive::{Begins, Driver};
use crate::foxglove::Streams;
use crate::server::Server;
use crate::show::{Begin, Show};

/// `swerve view`.
#[derive(clap::Args, Debug)]
pub struct ViewArgs {
    /// Scenario to run; or a log, or the folder of a run, to play back
    #[command(flatten)]
    input: RunInput,
    /// Drive a vehicle as `swerve live` does, with the configuration given as SCENARIO, and show it read-only
    #[arg(long, conflicts_with_all = ["config", "seed", "speed", "paused"])]
    live: bool,
    /// Port on 127.0.0.1 [default: any free port]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Playback speed as a multiple of real time, or max
    #[arg(long, default_value = "1", value_parser = speed)]
    speed: Speed,
    /// Wait for the start button of the page
    #[arg(long)]
    paused: bool,
    /// Also serve the run or the log to the Foxglove app, at IP:PORT or a port of 127.0.0.1 [default: 127.0.0.1:8765]
    #[arg(
        long, value_name = "ADDR", num_args = 0..=1, default_missing_value = USUAL_FOR_FOXGLOVE,
        value_parser = address
    )]
    foxglove: Option<SocketAddr>,
    /// Print the address without opening a browser
    #[arg(long)]
    no_open: bool,
}

/// Multiple of real time at which virtual time is shown; `None` for as fast as possible.
#[derive(Clone, Copy, Debug)]
struct Speed(Option<f64>);

fn speed(text: &str) -> Result<Speed, String> {
    if text == "max" {
        return Ok(Speed(None));
    }
    let times = text.parse().ok().filter(|times| show::is_speed(*times));
    times.map(|times| Speed(Some(times))).ok_or_else(|| show::NO_SPEED.into())
}

/// Default address of the Foxglove app.
const USUAL_FOR_FOXGLOVE: &str = "127.0.0.1:8765";
/// Parses a listening address: `IP:PORT`, or a port of 127.0.0.1.
fn address(text: &str) -> Result<SocketAddr, String> {
    let port =
        |text: &str| text.parse().ok().map(|port| SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port));
    let wrong = || format!("expected IP:PORT, or a port of 127.0.0.1, such as {USUAL_FOR_FOXGLOVE}");
    text.parse().ok().or_else(|| port(text)).ok_or_else(wrong)
}

/// Reason why this program has no server for the Foxglove app; `None` if it has one.
pub const MISSING: Option<&str> = if cfg!(feature = "foxglove") { None } else { Some(NOT_BUILT) };

const NOT_BUILT: &str = "this program was built without Foxglove's server: build it with `--features foxglove` (all: `--features full`)";

/// Runs `swerve view` until it is interrupted.
///
/// # Errors
/// If the input cannot be read, or the port is in use.
pub fn run(args: &ViewArgs, registry: &Registry, summarise: Summarise<'_>) -> anyhow::Result<()> {
    let show = if args.live { Show::of_vehicle() } else { Show::new(args.speed.0, args.paused) };
    let show = Arc::new(show);
    let log = log_of(&args.input.scenario).filter(|_| !args.live);
    if let Some(log) = &log {
        anyhow::ensure!(
            args.input.set.is_empty() && args.input.config.is_empty(),
            "{}: a log is shown as it was driven: `swerve replay --set` computes the result of other settings",
            log.display()
        );
        show.set_page(page_of_log(registry, log, None)?.html());
    }
    let (streams, foxglove) = args.foxglove.map(Streams::start).transpose()?.unzip();
    if let (Some(log), Some(streams)) = (&log, &streams) {
        streams.play(log.clone(), args.speed.0)?;
    }
    let begins = Arc::new(Begins::new(registry.clone(), args.input.clone()));
    let drives = log.is_none() && !args.live;
    if drives {
        begins.check(&Begin::default())?;
        begins.programs()?.iter().for_each(|line| tell(&format!("note: {line}")));
    }
    if !args.live {
        let interrupted = Arc::clone(&show);
        on_interrupt(move || interrupted.quit()).context("waiting for Ctrl-C")?;
    }
    let address = Server::start(args.port, Arc::clone(&show), drives.then(|| Arc::clone(&begins)))?;
    let lines = [Some(address.clone()), foxglove].into_iter().flatten().map(|line| line + "\n");
    print(&lines.collect::<String>())?;
    // Kept until the end: a browser may start slowly.
    let _page = if args.no_open { None } else { open::in_browser(&address) };
    if args.live {
        // Ctrl-C is handled by the drive: it stops the car.
        return vehicle::drive(&args.input, registry, &show, streams);
    }
    if drives {
        return Driver { begins, summarise, show: &show, streams }.drive_until_quit();
    }
    show.wait_for_quit();
    Ok(())
}
