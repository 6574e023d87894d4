//! Views of custom message types.

use core::any::type_name;
use std::sync::Arc;

use foxglove::messages::SceneEntity;
use swerve_flow::Payload;
use swerve_geom::Pose2;
use swerve_log::ViewSchema;
use swerve_msg::Extent;

use crate::form::{When, colour, point};
use crate::scene;
use crate::watch::Foxglove;

impl Foxglove {
    /// Publishes every message of type `T` under `/view/TOPIC` in a custom format: `encode` appends a message in
    /// the encoding of `schema`. It runs on the log's writer thread; empty messages are skipped.
    #[must_use]
    pub fn with<T: Payload + Clone>(
        self,
        topic: &str,
        schema: ViewSchema,
        encode: impl Fn(&T, &mut Vec<u8>) + Send + Sync + 'static,
    ) -> Self {
        let (topic, encode) = (topic.to_owned(), Arc::new(encode));
        self.also::<T>(move |watch, p, message| {
            let (message, encode) = (message.clone(), encode.clone());
            let bytes = size_of::<T>();
            watch.out.post(
                &topic,
                || schema.clone(),
                When::new(p),
                bytes,
                Box::new(move |out| encode(&message, out)),
            );
        })
    }

    /// Publishes every message of type `T` under `/view/TOPIC` as JSON with serde's field names, for plots, tables
    /// and the raw view. `schema` is a JSON Schema of an object (<https://json-schema.org>), from which Foxglove
    /// lists the fields.
    #[must_use]
    pub fn with_json<T: Payload + Clone>(self, topic: &str, schema: &'static str) -> Self {
        let name = type_name::<T>().rsplit("::").next().unwrap_or_default().to_owned();
        let schema = ViewSchema {
            name: name.into(),
            message_encoding: "json",
            encoding: "jsonschema",
            data: schema.as_bytes().into(),
        };
        self.with::<T>(topic, schema, |message, out| {
            serde_json::to_writer(out, message).expect("payloads serialize, and memory takes all");
        })
    }

    /// Publishes every message of type `T` under `/view/TOPIC` as a drawing in the map, which replaces the previous
    /// one.
    #[must_use]
    pub fn with_drawing<T: Payload + Clone>(
        self,
        topic: &str,
        draw: impl Fn(&T, &mut Drawing) + Send + Sync + 'static,
    ) -> Self {
        let (topic, draw) = (topic.to_owned(), Arc::new(draw));
        self.also::<T>(move |watch, p, message| {
            let (message, draw, when, id) = (message.clone(), draw.clone(), When::new(p), topic.clone());
            watch.out.show(&topic, when, size_of::<T>(), move || {
                let mut drawing = Drawing { entity: scene::entity(when.stamp, &id) };
                draw(&message, &mut drawing);
                Some(scene::anew(when.stamp, vec![drawing.entity]))
            });
        })
    }
}

/// Lines, boxes and text in the map. Colours are red, green, blue and opacity, 0 to 255 each.
pub struct Drawing {
    entity: SceneEntity,
}

impl Drawing {
    /// Adds a line through points in the map, metres, with this thickness, metres.
    pub fn line(&mut self, points: impl IntoIterator<Item = [f64; 3]>, color: [u8; 4], thickness_m: f64) {
        let points = points.into_iter().map(point).collect();
        self.entity.lines.push(scene::strip(points, color, thickness_m));
    }

    /// Adds an upright box whose lower face is centred on `pose` at height `bottom_m`, metres.
    pub fn cuboid(&mut self, pose: Pose2, bottom_m: f64, extent: Extent, color: [u8; 4]) {
        self.entity.cubes.push(scene::cube(pose, bottom_m, extent, colour(color)));
    }

    /// Adds text that faces the viewer, at a position in the map, metres.
    pub fn text(&mut self, [x_m, y_m, z_m]: [f64; 3], words: impl Into<String>) {
        self.entity.texts.push(scene::text(Pose2::new(x_m, y_m, 0.0), z_m, words.into()));
    }
}

#[cfg(test)]
mod tests;
