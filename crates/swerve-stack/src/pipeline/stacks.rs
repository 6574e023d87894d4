//! The graph of the stacks of all egos.

use std::collections::BTreeMap;

use anyhow::{Context as _, anyhow};
use swerve_core::Span;
use swerve_flow::{Policy, RuntimeModel};
use swerve_text::in_one_line;

use crate::agent;
use crate::assembly::{Assembly, Placed};
use crate::config::execution::{parse_policy, span_ms};
use crate::kind::{Heavy, Role};
use crate::namespace::Namespace;
use crate::operators::{add_shared, deadlines};
use crate::problems::KeyProblems;
use crate::setup::Setup;
use crate::site::{Building, OnRung, Site, Surroundings};

/// Builds the graph of the stacks of all egos, the first with the world, each with its surroundings. Agents, and what follows them in their stacks, are added after
/// everything before them in all stacks, so that an instant's observations of all egos precede the first decision.
pub(super) fn assemble(
    stacks: &[(&Setup, &Assembly, &Namespace)],
    surroundings: &[Surroundings],
) -> anyhow::Result<Building> {
    let mut building = Building::default();
    let all: Vec<&Namespace> = stacks.iter().map(|stack| stack.2).collect();
    let mut added = |(k, (stack, around)): (usize, (&(_, _, _), _))| {
        let world = if k == 0 { World::Added(&all) } else { World::There };
        AddedStack::new(&mut building, *stack, around, world)
    };
    let stacks: Vec<_> = stacks.iter().zip(surroundings).enumerate().map(&mut added).collect();
    stacks.iter().try_for_each(|stack| stack.add(&mut building, stack.before_agent()))?;
    stacks.iter().try_for_each(|stack| stack.add(&mut building, stack.agent_and_after()))?;
    for (feedback, edge) in core::mem::take(&mut building.loops) {
        let befallen = building.befallen.get(&edge.stream).filter(|_| !edge.raw).copied();
        let stream = befallen.or_else(|| building.graph.stream(&edge.stream));
        let stream = stream.with_context(|| format!("there is no stream `{}`", edge.stream))?;
        building.graph.connect_any(feedback, stream)?;
    }
    Ok(building)
}

/// The world of a stack that is added.
#[derive(Clone, Copy)]
enum World<'a> {
    /// It is added with this stack, for stacks of these names.
    Added(&'a [&'a Namespace]),
    /// It is there already.
    There,
}

/// A stack that is added.
struct AddedStack<'a> {
    setup: &'a Setup,
    assembly: &'a Assembly,
    names: &'a Namespace,
    surroundings: &'a Surroundings,
    world: World<'a>,
    resources: BTreeMap<&'a str, swerve_flow::Resource>,
}

impl<'a> AddedStack<'a> {
    fn new(
        building: &mut Building,
        (setup, assembly, names): (&'a Setup, &'a Assembly, &'a Namespace),
        surroundings: &'a Surroundings,
        world: World<'a>,
    ) -> Self {
        let mut added = |name: &String, slots: usize| building.graph.resource(names.operator(name), slots);
        let resources = setup.resource.iter();
        let resources = resources.map(|(name, resource)| (name.as_str(), added(name, resource.slots)));
        Self { setup, assembly, names, surroundings, world, resources: resources.collect() }
    }

    /// Operators before the agent: all, without one.
    fn before_agent(&self) -> &'a [Placed] {
        let operators = self.assembly.operators();
        &operators[..operators.len() - self.agent_and_after().len()]
    }

    /// The agent, and the operators after it.
    fn agent_and_after(&self) -> &'a [Placed] {
        let operators = self.assembly.operators();
        let agent = operators.iter().position(|placed| placed.kind.node().kind == agent::KIND);
        &operators[agent.unwrap_or(operators.len())..]
    }

    /// Adds operators with their `[operator.NAME]` settings and the faults on their streams, in the order of the
    /// assembly.
    fn add(&self, building: &mut Building, operators: &[Placed]) -> anyhow::Result<()> {
        let Self { setup, assembly, names, surroundings, world, .. } = *self;
        for placed in operators {
            let mut site = Site {
                building,
                operators: assembly.operators(),
                placed,
                setup,
                surroundings,
                names,
                on_rung: None,
            };
            match (placed.kind.node().role, world) {
                (Role::World, World::Added(stacks)) if stacks.len() > 1 => add_shared(&mut site, stacks)?,
                (Role::World, World::There) => {
                    put_faults(building, setup, placed, names)?;
                    continue;
                }
                _ => add_rungs(&mut site)?,
            }
            let resource = placed.own.uses.as_deref().and_then(|name| self.resources.get(name)).copied();
            configure(&mut site, resource)?;
            put_faults(building, setup, placed, names)?;
        }
        Ok(())
    }
}

/// Adds an operator, on each of its rungs.
fn add_rungs(site: &mut Site<'_>) -> anyhow::Result<()> {
    let (placed, setup) = (site.placed, site.setup);
    let wrong = |found: KeyProblems| anyhow!("operator.{}: {}", placed.name, in_one_line(&found));
    for rung in placed.schedule.rungs() {
        site.on_rung = rung.map(|rung| OnRung::new(placed, setup, rung)).transpose().map_err(wrong)?;
        placed.kind.add(site)?;
    }
    site.on_rung = None;
    Ok(())
}

/// Sets timer, run time, policy, deadline, resource and delay of an operator.
fn configure(site: &mut Site<'_>, resource: Option<swerve_flow::Resource>) -> anyhow::Result<()> {
    let (placed, setup) = (site.placed, site.setup);
    let (name, schedule) = (&placed.name, &placed.schedule);
    let wrong = |message: String| anyhow!("operator.{name}: {message}");
    let (own, settings) = (&placed.own, placed.settings(setup));
    let way = placed.kind.on_its_way(&settings);
    let deadline = match &own.deadline {
        Some(deadline) => Some(deadline.deadline().map_err(wrong)?),
        None => deadlines::deadline(site)?,
    };
    let mut node = site.node()?;
    if let Some(period) = schedule.period {
        node = node.on_timer(settings.drawn_timer(period));
    }
    if placed.kind.node().origin {
        node = node.origin();
    }
    node = node.runtime(match (&own.runtime, &way) {
        _ if !own.rungs.is_empty() => RuntimeModel::LADDER,
        (Some(runtime), _) => runtime.model().map_err(wrong)?,
        (None, Some(way)) => RuntimeModel::Fixed(way.after),
        (None, None) => placed.kind.runtime(&settings).map_err(wrong)?,
    });
    if let Some(policy) = &own.policy {
        node = node.policy(parse_policy(policy).map_err(wrong)?);
    } else if let Some(way) = &way {
        node = node.policy(Policy::pipelined(way.frames));
    }
    if let Some(deadline) = deadline {
        node = node.deadline(deadline);
    }
    if let Some(resource) = resource {
        node = node.uses(resource);
    }
    let delay = span_ms(own.delay_ms + placed.kind.added_delay_ms(&settings)).map_err(wrong)?;
    let later = way.filter(|_| own.runtime.is_some()).map_or(Span::ZERO, |way| way.after);
    node = node.delay(delay + later);
    let is_heavy = match placed.kind.node().heavy {
        Heavy::Yes => true,
        Heavy::OnWallClock => settings.on_wall_clock(),
        Heavy::No => false,
    };
    let _configured = if is_heavy || setup.process_of(name).is_some() { node.heavy() } else { node };
    Ok(())
}

/// Adds the configuration's faults between an operator's streams and their readers.
fn put_faults(
    building: &mut Building,
    setup: &Setup,
    placed: &Placed,
    names: &Namespace,
) -> anyhow::Result<()> {
    for (k, output) in placed.outputs.iter().enumerate() {
        let on_it = |name: &str| name == output.stream || (k == 0 && name == placed.name);
        for (name, fault) in setup.fault.iter().filter(|(_, fault)| on_it(&fault.stream)) {
            let corruptible = setup.registry.corruptible(output.port.payload);
            let corruptible = corruptible
                .with_context(|| format!("fault.{name}: no fault befalls `{}`", output.port.payload))?;
            let in_graph = names.stream(&output.stream);
            let stream = building.befallen.get(&in_graph).copied();
            let stream = stream.or_else(|| building.graph.stream(&in_graph));
            let stream = stream.with_context(|| format!("there is no stream `{in_graph}`"))?;
            let operator = names.operator(name);
            let befallen = corruptible.put_on(&mut building.graph, stream, (&operator, fault), setup.seed)?;
            building.befallen.insert(in_graph.clone(), befallen);
            building.last_fault.insert(in_graph, operator);
        }
    }
    Ok(())
}
