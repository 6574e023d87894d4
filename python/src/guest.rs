//! `swerve.Stack`: the stack in a foreign world, stepped from Python.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::Context as _;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use swerve::Summary;
use swerve_core::{Span, Time};
use swerve_drive::page::page_of_log;
use swerve_drive::trust::CodeArgs;
use swerve_drive::{Line, Stack, StackOptions, scenario_on_map, story};
use swerve_flow::{Event, Observer, cbor};
use swerve_geom::Point2;
use swerve_msg::{EgoState, ObstacleList, Signal};
use swerve_report::files::{RunFolder, write_whole};
use swerve_report::story::{Story, draw};
use swerve_scenario::Scenario;
use swerve_why::of_run;

use crate::convert::{cbor, error, read_cbor};
use crate::run::{FileOr, load_config, load_scenario, remove_log};
use crate::streams::{Capture, Streams};

/// The stack in a foreign world.
#[pyclass(frozen, module = "swerve._swerve")]
pub(crate) struct Guest {
    /// `None` once it has finished. On the heap: Python aligns objects to 16 bytes only.
    stack: Mutex<Option<Box<Stack>>>,
    seen: Arc<Mutex<Seen>>,
    log: Option<PathBuf>,
    folder: Mutex<Option<RunFolder>>,
    scenario_text: String,
}

/// Kept of a run for its result.
struct Seen {
    capture: Capture,
    story: Option<Story>,
}

impl Observer for Seen {
    fn event(&mut self, event: &Event<'_>) {
        self.capture.event(event);
        if let Some(story) = &mut self.story {
            story.event(event);
        }
    }
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An instant in seconds as nanoseconds.
fn time(seconds: f64) -> PyResult<Time> {
    // Beyond this the nearest nanosecond is not certain.
    const MOST_S: f64 = 9e6;
    if !(0.0..=MOST_S).contains(&seconds) {
        return Err(PyValueError::new_err(format!("{seconds} s: expected 0 to {MOST_S} seconds")));
    }
    Ok(Time::ZERO + Span::from_secs(seconds))
}

/// Way of the ego: a line of points, a place on a map, or a scenario.
fn course(way: &Bound<'_, PyDict>) -> PyResult<(Scenario, String, String)> {
    let number = |key: &str| -> PyResult<Option<f64>> { way.get_item(key)?.map(|n| n.extract()).transpose() };
    let points = |key: &str| -> PyResult<Option<Vec<Point2>>> {
        let points: Option<Vec<(f64, f64)>> =
            way.get_item(key)?.map(|points| points.extract()).transpose()?;
        Ok(points.map(|points| points.into_iter().map(|(x_m, y_m)| Point2::new(x_m, y_m)).collect()))
    };
    if let Some(scenario) = way.get_item("scenario")? {
        return load_scenario(&scenario.extract::<FileOr<'_>>()?);
    }
    let seconds = number("seconds")?.unwrap_or(3600.0);
    let scenario = match (points("route")?, way.get_item("map")?) {
        (Some(points), _) => {
            let lanes = |key: &str| -> PyResult<usize> {
                Ok(way.get_item(key)?.map(|n| n.extract()).transpose()?.unwrap_or(0))
            };
            let mut line = Line::new(points, number("speed_mps")?.unwrap_or(10.0));
            line.lane_width_m = number("lane_width_m")?.unwrap_or(line.lane_width_m);
            (line.lanes_left, line.lanes_right) = (lanes("lanes_left")?, lanes("lanes_right")?);
            line.timeout_s = seconds;
            line.scenario().map_err(error)?
        }
        (None, Some(map)) => {
            let [start, goal] = points("ends")?
                .and_then(|ends| ends.try_into().ok())
                .ok_or_else(|| PyValueError::new_err("map: expected `start` and `goal` as well"))?;
            let map: PathBuf = map.extract()?;
            scenario_on_map(&map, [start, goal], number("speed_mps")?, seconds).map_err(error)?
        }
        (None, None) => {
            return Err(PyValueError::new_err(
                "the stack has no route: expected `route`, `map` or `scenario`",
            ));
        }
    };
    let text = scenario.text.to_string();
    Ok((scenario, text, "route".to_owned()))
}

/// Name, type, meaning, readers of an input, and the latency of its messages in nanoseconds.
type InputFacts = (String, String, &'static str, Vec<String>, i64);

/// Command of the vehicle: instant, stamp of the sensor frame that it derives from, and steering angle, throttle, brake.
type CommandFacts = (i64, Option<i64>, (f64, f64, f64));

fn facts(commanded: &swerve_drive::Commanded) -> CommandFacts {
    let command = commanded.command;
    let numbers = (command.steering_rad, command.throttle, command.brake);
    (commanded.at.ns(), commanded.origin.map(Time::ns), numbers)
}

#[pymethods]
impl Guest {
    #[new]
    #[pyo3(signature = (way, *, config=None, set=None, seed=None, threads=1, streams=None, log=None, out=None, allow_code=false))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn new(
        way: &Bound<'_, PyDict>,
        config: Option<FileOr<'_>>,
        set: Option<Bound<'_, PyDict>>,
        seed: Option<i64>,
        threads: usize,
        streams: Option<Vec<String>>,
        log: Option<PathBuf>,
        out: Option<PathBuf>,
        allow_code: bool,
    ) -> PyResult<Self> {
        let config = load_config(config.as_ref(), set.as_ref(), seed, CodeArgs { allow_code })?;
        let (scenario, scenario_text, scenario_file) = course(way)?;
        let folder = out.map(|out| RunFolder::claim(Some(&out), "guest", true));
        let folder = folder.transpose().map_err(error)?;
        let log = folder.as_ref().map(|folder| folder.path.join("log.partial.mcap")).or(log);
        log.as_deref().map_or(Ok(()), remove_log).map_err(error)?;
        let is_way = !way.contains("scenario")?;
        let options = StackOptions {
            threads,
            log: log.clone(),
            scenario_file: scenario_file.into(),
            draws: is_way.then_some(false),
            ..StackOptions::default()
        };
        let capture = Capture::new(streams);
        let seen = Arc::new(Mutex::new(Seen { capture, story: None }));
        let watching = seen.clone();
        let stack = Stack::with_observers(&config, &scenario, &options, |setup, pipeline| {
            lock(&watching).story = Some(story(setup, &pipeline.scenario, pipeline));
            vec![Box::new(move |event: &Event<'_>| lock(&watching).event(event))]
        });
        let stack = stack.map_err(error)?;
        lock(&seen).capture.check(&stack.streams().collect::<Vec<_>>()).map_err(error)?;
        let stack = Mutex::new(Some(Box::new(stack)));
        Ok(Self { stack, seen, log, folder: Mutex::new(folder), scenario_text })
    }

    /// Inputs, by name.
    fn inputs(&self) -> PyResult<Vec<InputFacts>> {
        self.with(|stack| {
            let of = |input: &swerve_drive::InputStream| {
                let latency = input.latency.ns();
                (input.name.clone(), input.payload.name(), input.doc, input.readers.clone(), latency)
            };
            Ok(stack.inputs().map(of).collect())
        })
    }

    /// Names of all streams.
    fn streams(&self) -> PyResult<Vec<String>> {
        self.with(|stack| Ok(stack.streams().map(str::to_owned).collect()))
    }

    /// Names of the scenario's traffic lights.
    fn lights(&self) -> PyResult<Vec<String>> {
        self.with(|stack| Ok(stack.scenario().road.lights.iter().map(|light| light.name.clone()).collect()))
    }

    /// Feeds a message, as plain values.
    fn feed(&self, py: Python<'_>, stream: &str, message: &Bound<'_, PyAny>) -> PyResult<()> {
        let bytes = cbor(message)?;
        py.detach(|| self.with(|stack| stack.feed_cbor(stream, &bytes)))
    }

    /// Feeds a world without sensors, as plain values: the ego, and a list of obstacles. Returns the reason for the end of the
    /// scenario, if it is over.
    fn feed_scene<'py>(
        &self,
        py: Python<'py>,
        ego: &Bound<'_, PyAny>,
        obstacles: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (ego, obstacles) = (cbor(ego)?, cbor(obstacles)?);
        let ended = py.detach(|| {
            self.with(|stack| {
                let ego: EgoState = cbor::read(&ego[..]).map_err(anyhow::Error::msg).context("ego")?;
                let list: ObstacleList =
                    cbor::read(&obstacles[..]).map_err(anyhow::Error::msg).context("obstacles")?;
                stack.feed_scene(ego, list.obstacles)
            })
        })?;
        let mut bytes = Vec::new();
        cbor::write(&ended, &mut bytes);
        read_cbor(py, &bytes)
    }

    /// Feeds signals of traffic lights by name, as plain values, with the ego.
    fn feed_lights(
        &self,
        py: Python<'_>,
        ego: &Bound<'_, PyAny>,
        signals: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let (ego, signals) = (cbor(ego)?, cbor(signals)?);
        py.detach(|| {
            self.with(|stack| {
                let ego: EgoState = cbor::read(&ego[..]).map_err(anyhow::Error::msg).context("ego")?;
                let signals: BTreeMap<String, Signal> =
                    cbor::read(&signals[..]).map_err(anyhow::Error::msg).context("signals")?;
                stack.feed_lights(&ego, &signals)
            })
        })
    }

    /// Advances to an instant in seconds; returns the newest command, and the commands since the last advance.
    fn advance_to(
        &self,
        py: Python<'_>,
        seconds: f64,
    ) -> PyResult<(Option<CommandFacts>, Vec<CommandFacts>)> {
        let instant = time(seconds)?;
        let commands = py.detach(|| self.with(|stack| stack.advance_to(instant)))?;
        Ok((commands.newest.as_ref().map(facts), commands.new.iter().map(facts).collect()))
    }

    /// Type of the newest message of a stream, and the message as plain values; `None` before the first.
    fn newest<'py>(&self, py: Python<'py>, stream: &str) -> PyResult<Option<(String, Bound<'py, PyAny>)>> {
        let newest = self.with(|stack| {
            Ok(stack.newest_any(stream)?.map(|(_, payload)| {
                let mut bytes = Vec::new();
                payload.to_cbor(&mut bytes);
                (payload.type_name().to_owned(), bytes)
            }))
        })?;
        newest.map(|(name, bytes)| Ok((name, read_cbor(py, &bytes)?))).transpose()
    }

    /// Instant that the stack was advanced to, and the last one that it can be advanced to, seconds.
    fn times(&self) -> PyResult<(f64, f64)> {
        self.with(|stack| Ok((stack.now().as_secs(), stack.until().as_secs())))
    }

    /// Points of the route, and its length, metres.
    fn route(&self) -> PyResult<Vec<(f64, f64)>> {
        self.with(|stack| Ok(stack.route().line().points().iter().map(|p| (p.x_m, p.y_m)).collect()))
    }

    /// Ends the run; returns the result as a dictionary.
    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let finished = py.detach(|| self.finished()).map_err(error)?;
        let result = PyDict::new(py);
        for (key, value) in finished.texts {
            result.set_item(key, value)?;
        }
        result.set_item("streams", finished.streams.into_dict(py)?)?;
        Ok(result)
    }

    /// Ends the run without a result: the log stays readable up to its last instant.
    fn drop(&self) {
        *lock(&self.stack) = None;
        *lock(&self.folder) = None;
    }
}

/// Result of a run.
struct Finished {
    texts: [(&'static str, String); 4],
    streams: Streams,
}

/// Error of a stack that is used after its end.
fn over() -> anyhow::Error {
    anyhow::anyhow!("the stack has finished")
}

impl Guest {
    fn with<T>(&self, act: impl FnOnce(&mut Stack) -> anyhow::Result<T>) -> PyResult<T> {
        let mut stack = lock(&self.stack);
        stack.as_deref_mut().ok_or_else(over).and_then(act).map_err(error)
    }

    fn finished(&self) -> anyhow::Result<Finished> {
        let stack = lock(&self.stack).take().ok_or_else(over)?;
        let (setup, scenario) = (stack.setup().clone(), stack.scenario().clone());
        let outcome = stack.finish()?;
        let log = self.log.as_deref();
        let why = log.and_then(|log| of_run(log, &setup.registry, &outcome.metrics));
        let mut seen = lock(&self.seen);
        let story = seen.story.take().map_or_else(String::new, |mut story| {
            story.conclude(&outcome.metrics, why.as_ref());
            draw(&story).svg()
        });
        let summary = Summary::of(&setup, &scenario, &outcome, why);
        if let Some(folder) = lock(&self.folder).take() {
            folder.name_whole()?;
            folder.conclude("report.html, log.mcap", &(serde_json::to_string_pretty(&summary)? + "\n"))?;
            report(&setup.registry, &folder.path)?;
        }
        let texts = [
            ("metrics", serde_json::to_string(&summary)?),
            ("story", story),
            ("config", setup.to_text()),
            ("scenario", self.scenario_text.clone()),
        ];
        let streams = core::mem::take(&mut seen.capture.streams);
        Ok(Finished { texts, streams })
    }
}

/// Writes the page of a run beside its log.
fn report(registry: &swerve_stack::Registry, folder: &Path) -> anyhow::Result<()> {
    let page = page_of_log(registry, &folder.join("log.mcap"), None)?;
    write_whole(&folder.join(swerve_drive::page::REPORT), page.html().as_bytes())
}
