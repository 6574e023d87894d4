// Reads a log with the libraries of the Foxglove app: every message of every channel.
//
//     node read.mjs LOG
//
// Prints a line for each channel; fails where something cannot be decoded or has no content.

import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";
import { decode as decodeCbor } from "cborg";
import jpeg from "jpeg-js";

const path = process.argv[2];
const file = await open(path);
const size = (await file.stat()).size;
const readable = {
  size: async () => BigInt(size),
  read: async (offset, length) => {
    const buffer = new Uint8Array(Number(length));
    await file.read(buffer, 0, Number(length), Number(offset));
    return buffer;
  },
};

const expect = (holds, what) => {
  if (!holds) throw new Error(`not as expected: ${what}`);
};

// What the app needs of a message of each schema to show it.
const checks = {
  "foxglove.CompressedImage": (m) => {
    expect(m.frame_id !== "" && m.data.length > 100, "an image has a frame and data");
    if (m.format === "jpeg") {
      const image = jpeg.decode(m.data, { useTArray: true });
      expect(image.width > 0 && image.data.length === 4 * image.width * image.height, "a whole JPEG");
    } else {
      expect(m.format === "png" && m.data[1] === 0x50, "a PNG");
    }
  },
  "foxglove.RawImage": (m) => expect(m.data.length === m.step * m.height, "as many bytes as rows need"),
  "foxglove.CameraCalibration": (m) =>
    expect(m.K.length === 9 && m.P.length === 12 && m.R.length === 9 && m.D.length === 5, "all matrices"),
  "foxglove.ImageAnnotations": (m) =>
    expect(m.points.every((p) => p.type === 4 && p.points.length % 2 === 0), "lists of lines"),
  "foxglove.PointCloud": (m) =>
    expect(
      m.data.length % m.point_stride === 0 && m.fields.slice(0, 3).map((f) => f.name).join("") === "xyz",
      "whole points",
    ),
  "foxglove.SceneUpdate": (m) =>
    expect(m.entities.every((e) => e.id !== "" && e.frame_id !== ""), "entities with names and frames"),
  "foxglove.FrameTransforms": (m) =>
    m.transforms.forEach(({ rotation: { x, y, z, w } }) =>
      expect(Math.abs(Math.hypot(x, y, z, w) - 1) < 1e-9, "a rotation"),
    ),
  "foxglove.LocationFix": (m) => expect(m.position_covariance.length === 9, "a covariance"),
  "foxglove.Log": (m) => expect(m.message !== "" && m.level > 0, "words"),
  "swerve.Figures": (m) => expect(Number.isFinite(m.speed_mps), "a speed"),
};

const reader = await McapIndexedReader.Initialize({
  readable,
  decompressHandlers: await loadDecompressHandlers(),
});
const types = new Map();
const counts = new Map();
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (channel.messageEncoding === "cbor") {
    expect(decodeCbor(message.data, { useMaps: true, allowBigInt: true }) instanceof Map, channel.topic);
  } else {
    expect(channel.messageEncoding === "protobuf" && schema.encoding === "protobuf", channel.topic);
    if (!types.has(schema.id)) {
      types.set(schema.id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
    }
    expect(schema.name in checks, `a schema that the app knows, found ${schema.name}`);
    const content = types.get(schema.id).decode(message.data);
    try {
      checks[schema.name](content);
    } catch (error) {
      throw new Error(`${channel.topic} (${schema.name}): ${error.message}`);
    }
  }
  counts.set(channel.topic, (counts.get(channel.topic) ?? 0) + 1);
}
const statistics = reader.statistics;
let total = 0;
for (const [topic, count] of [...counts].sort()) {
  console.log(String(count).padStart(6), topic);
  total += count;
}
expect(BigInt(total) === statistics.messageCount, "as many messages as the file says it has");
console.log(`${total} messages of ${counts.size} channels read`);
await file.close();
