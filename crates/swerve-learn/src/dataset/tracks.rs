//! Tracks of all road users in drives and at a generated crossing, for training and evaluating predictors.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::bail;
use swerve_core::Span;
use swerve_drive::{drive_observed, read_scenario};
use swerve_flow::{Event, Observer};
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_prediction::recorded::{RecordedTrack, Recording, commonroad_text, made_finely};
use swerve_report::files::{claim, write_whole};
use swerve_report::progress::Progress;
use swerve_stack::Registry;
use swerve_stack::Setup;

use super::state::State;
use super::{DatasetArgs, call, configured};

/// Sampling interval.
const EVERY: Span = Span::from_ms(100);
/// Identity of the ego; other identities start at 1.
const EGO: ActorId = ActorId(0);

/// Records the positions of all road users.
struct Follower {
    ego: Extent,
    /// Distance from the rear axle to the centre of the ego's outline, metres.
    ahead_m: f64,
    tracks: BTreeMap<ActorId, RecordedTrack>,
}

impl Follower {
    fn new(config: &Setup) -> Self {
        let shape = &config.sim.vehicle.shape;
        let ego = Extent { length_m: shape.length_m, width_m: shape.width_m, height_m: shape.height_m };
        Self { ego, ahead_m: 0.5 * shape.length_m - shape.rear_overhang_m, tracks: BTreeMap::new() }
    }

    fn recording(self) -> Recording {
        Recording { step: EVERY, tracks: self.tracks.into_values().collect(), lanes: None }
    }
}

impl Observer for Follower {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(world) = publication.payload.and_then(|payload| payload.downcast_ref::<WorldState>()) else {
            return;
        };
        if world.stamp.ns() % EVERY.ns() != 0 {
            return;
        }
        let step = world.stamp.ns() / EVERY.ns();
        let ego = (EGO, ActorKind::Car, self.ego, world.ego.state.pose.ahead(self.ahead_m).point());
        let others =
            world.actors.iter().map(|actor| (actor.id, actor.kind, actor.extent, actor.pose.point()));
        for (id, kind, extent, place) in std::iter::once(ego).chain(others) {
            let new = || RecordedTrack { id, kind, extent, samples: Vec::new() };
            self.tracks.entry(id).or_insert_with(new).samples.push((step, place));
        }
    }
}

/// Writes one file per scenario, and one for the crossing, each with all seeds.
pub(super) fn write(args: &DatasetArgs, registry: &Registry) -> anyhow::Result<String> {
    let config = configured(args, registry)?;
    let scenarios: Vec<_> =
        args.scenarios.iter().map(|path| read_scenario(path)).collect::<anyhow::Result<_>>()?;
    let mut state = State::open(&args.out, &call(args, &config, &scenarios)?)?;
    let _held = claim(&args.out)?;
    state.write(&args.out)?;
    let progress =
        Progress::drives(args.seeds.len() * (scenarios.len() + usize::from(args.crossing.is_some())));
    let (mut tracks, mut files) = (0, 0);
    let mut names = BTreeSet::new();
    let mut add = |name: &str, recordings: Vec<(String, Recording)>| -> anyhow::Result<()> {
        let path = args.out.join(format!("{name}.csv"));
        if !names.insert(name.to_owned()) {
            bail!("{}: two scenarios of this name", path.display());
        }
        tracks += recordings.iter().map(|(_, recording)| recording.tracks.len()).sum::<usize>();
        files += 1;
        write_whole(&path, commonroad_text(&recordings)?.as_bytes())?;
        state.samples = files;
        state.write(&args.out)
    };
    for scenario in &scenarios {
        let mut recordings = Vec::new();
        for &seed in &args.seeds {
            let mut config = config.clone();
            config.seed = u64::from(seed);
            let mut follower = Follower::new(&config);
            drive_observed(&config, scenario, 1, &mut [&mut follower])?;
            recordings.push((format!("{} {seed}", scenario.name), follower.recording()));
            progress.one_done();
        }
        add(&scenario.name, recordings)?;
    }
    if let Some(people) = args.crossing {
        let minute = |seed: &u32| {
            progress.one_done();
            (format!("crossing {seed:05}"), made_finely(u64::from(*seed), usize::from(people)))
        };
        add("crossing", args.seeds.iter().map(minute).collect())?;
    }
    progress.finish();
    state.is_complete = true;
    state.write(&args.out)?;
    Ok(format!("{tracks} tracks in {files} files in {}\n", Path::new(&args.out).display()))
}
