//! Serialized forms of a border.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Border, BorderError, Form, Station};

/// Text form.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Text {
    Constant(f64),
    Stations(Vec<(f64, f64)>),
}

/// Arc length and distance at each station; one station for a constant border.
fn stations(border: &Border) -> Vec<(f64, f64)> {
    match &border.0 {
        Form::Constant(distance_m) => vec![(0.0, *distance_m)],
        Form::Linear(stations) => stations.as_slice().iter().map(|x| (x.s_m, x.distance_m)).collect(),
    }
}

fn border(pairs: &[(f64, f64)]) -> Result<Border, BorderError> {
    let station = |&(s_m, distance_m): &(f64, f64)| Station { s_m, distance_m };
    Border::linear(&pairs.iter().map(station).collect::<Vec<_>>())
}

impl Serialize for Border {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match (serializer.is_human_readable(), &self.0) {
            (true, Form::Constant(distance_m)) => Text::Constant(*distance_m).serialize(serializer),
            (true, Form::Linear(_)) => Text::Stations(stations(self)).serialize(serializer),
            (false, _) => stations(self).serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Border {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let is_text = deserializer.is_human_readable();
        let pairs = match is_text {
            true => match Text::deserialize(deserializer)? {
                Text::Constant(distance_m) => vec![(0.0, distance_m)],
                Text::Stations(pairs) => pairs,
            },
            false => Vec::deserialize(deserializer)?,
        };
        if pairs.is_empty() && !is_text {
            return Ok(Self::constant(0.0));
        }
        border(&pairs).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Borders;

    #[test]
    fn binary_form_is_the_list_of_stations() {
        let linear = border(&[(0.0, 2.0), (50.0, 3.5)]).unwrap();
        let borders = Borders::new(linear, Border::constant(1.5));
        let bytes = postcard::to_allocvec(&borders).unwrap();
        assert_eq!(postcard::from_bytes::<Borders>(&bytes).unwrap(), borders);
        let lists = (vec![(0.0, 2.0), (50.0, 3.5)], vec![(0.0, 1.5)]);
        assert_eq!(postcard::to_allocvec(&lists).unwrap(), bytes);
        let wrong = postcard::to_allocvec(&(vec![(3.0, 2.0), (2.0, 3.5)], vec![(0.0, 1.5)])).unwrap();
        assert!(postcard::from_bytes::<Borders>(&wrong).is_err());
        // Schemas are traced with empty lists.
        let none = [Vec::<(f64, f64)>::new(), Vec::new()];
        let bytes = postcard::to_allocvec(&none).unwrap();
        assert_eq!(postcard::from_bytes::<Borders>(&bytes).unwrap(), Borders::constant(0.0, 0.0));
    }
}
