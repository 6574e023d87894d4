//! Traffic lights: the phases of the scenario lead, and SUMO's lights follow where they differ.

use std::collections::BTreeMap;

use swerve_core::{Span, Time};
use swerve_map::{Aspect, SignalProgram};

use crate::SumoError;
use crate::client::Subscribed;
use crate::wire::{Command, Domain, LIGHT_STATE, Value};

/// Phases of one link of a traffic light, from the start of the run.
#[derive(Clone, PartialEq, Debug)]
pub struct LightProgram {
    /// Identity of the traffic light in SUMO.
    pub light: String,
    /// Number of the link: the place of its letter.
    pub link: usize,
    /// Its phases.
    pub program: SignalProgram,
    /// True if green of this link gives way to other traffic (`g`).
    pub gives_way: bool,
}

/// Links of all lights.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights(BTreeMap<String, Vec<LightProgram>>);

impl Lights {
    /// The links of those lights that SUMO has.
    pub(crate) fn of(programs: &[LightProgram], known: &[String]) -> Self {
        let mut lights: BTreeMap<String, Vec<LightProgram>> = BTreeMap::new();
        for program in programs.iter().filter(|program| known.contains(&program.light)) {
            lights.entry(program.light.clone()).or_default().push(program.clone());
        }
        Self(lights)
    }

    /// Subscriptions to their states.
    pub(crate) fn subscriptions(&self) -> Vec<Command> {
        self.0.keys().map(|light| Command::light_states(light)).collect()
    }

    /// Commands for the lights whose states differ from their phases both at `at` and a step before. SUMO switches at the
    /// begin of a step and reports at its end.
    pub(crate) fn corrections(
        &self,
        results: &[Subscribed],
        at: Time,
        step: Span,
    ) -> Result<Vec<Command>, SumoError> {
        let mut commands = Vec::new();
        for Subscribed { name, objects } in results {
            let Some(links) = self.0.get(name) else { continue };
            let state = objects.first().and_then(|(_, values)| values.get(&LIGHT_STATE));
            let Some(Value::Text(state)) = state else {
                return Err(SumoError::Answer(format!(
                    "expected the state of light \"{name}\", found {state:?}"
                )));
            };
            let [now, before] = [at, at - step].map(|at| followed(state, links, at));
            if now != *state && before != *state {
                commands.push(Command::set(Domain::Light, LIGHT_STATE, name, &Value::Text(now)));
            }
        }
        Ok(commands)
    }
}

/// A state with the letters of the links' phases at an instant; letters of the same aspect stay.
fn followed(state: &str, links: &[LightProgram], at: Time) -> String {
    let mut letters: Vec<char> = state.chars().collect();
    for LightProgram { link, program, gives_way, .. } in links {
        let Some(letter) = letters.get_mut(*link) else { continue };
        let aspect = program.aspect_at(at.ns());
        if aspect_of(*letter) != Some(aspect) {
            *letter = match aspect {
                Aspect::Green if *gives_way => 'g',
                Aspect::Green => 'G',
                Aspect::Yellow => 'y',
                Aspect::Red => 'r',
                Aspect::RedYellow => 'u',
                Aspect::Off => 'o',
            };
        }
    }
    letters.into_iter().collect()
}

/// Aspect of a letter, as the reader of nets has it.
fn aspect_of(letter: char) -> Option<Aspect> {
    Some(match letter {
        'r' | 's' => Aspect::Red,
        'y' | 'Y' => Aspect::Yellow,
        'g' | 'G' => Aspect::Green,
        'u' => Aspect::RedYellow,
        'o' | 'O' => Aspect::Off,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::client::Values;

    fn link(link: usize, durations_s: [f64; 3], gives_way: bool) -> LightProgram {
        let program = SignalProgram::green_yellow_red(durations_s, 0.0);
        LightProgram { light: "C".to_owned(), link, program, gives_way }
    }

    fn shown(state: &str) -> Vec<Subscribed> {
        let values: Values = [(LIGHT_STATE, Value::Text(state.to_owned()))].into();
        vec![Subscribed { name: "C".to_owned(), objects: vec![("C".to_owned(), values)] }]
    }

    #[test]
    fn lights_are_set_only_where_they_differ_for_longer_than_a_step() {
        let programs = [link(0, [10.0, 3.0, 20.0], false), link(2, [10.0, 3.0, 20.0], true)];
        let lights = Lights::of(&programs, &["C".to_owned()]);
        let step = Span::from_ms(100);
        let corrections =
            |state: &str, ms: i64| lights.corrections(&shown(state), Time::from_ms(ms), step).unwrap();
        assert_eq!(corrections("grG", 5_000), [], "letters of one aspect are equal");
        assert_eq!(corrections("GrG", 10_000), [], "the switch is reported a step later");
        let set = Command::set(Domain::Light, LIGHT_STATE, "C", &Value::Text("yry".to_owned()));
        assert_eq!(corrections("GrG", 10_100), [set]);
        let green = Command::set(Domain::Light, LIGHT_STATE, "C", &Value::Text("Grg".to_owned()));
        assert_eq!(corrections("rrr", 1_000), [green]);
        assert!(Lights::of(&programs, &[]).subscriptions().is_empty());
    }
}
