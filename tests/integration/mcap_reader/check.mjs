// What BagWriter writes, read by @mcap/core: by its index, and from the first byte to the last.
// Usage: node --test check.mjs, with JOSTLE_SAMPLE naming the program that writes.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { createRequire } from "node:module";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { pathToFileURL } from "node:url";

// The libraries lie where they were installed, not beside this file.
const modules = createRequire(process.env.JOSTLE_NODE_MODULES ?? import.meta.url);
const load = async (name) => {
  const module = await import(pathToFileURL(modules.resolve(name)).href);
  return { ...module.default, ...module };
};
const { McapIndexedReader, McapStreamReader } = await load("@mcap/core");
const { decompress } = await load("fzstd");
const { parse } = await load("@foxglove/rosmsg");
const { MessageReader } = await load("@foxglove/rosmsg2-serialization");

const kBegin = 1_700_000_000_000_000_000n;
const kCount = 50_000; // on /hand
const kOnce = 2; // one on /goal, one on /wheel
const folder = mkdtempSync(join(tmpdir(), "jostle-mcap-"));
after(() => rmSync(folder, { recursive: true }));

const decompressHandlers = { zstd: (data, size) => decompress(data, new Uint8Array(Number(size))) };

const samples = Object.fromEntries(["mcap", "raw"].map((kind) => {
  const bag = join(folder, kind);
  execFileSync(process.env.JOSTLE_SAMPLE, [bag, kind]);
  return [kind, readFileSync(join(bag, `${kind}_0.mcap`))];
}));

function readable(bytes) {
  return {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
  };
}

async function indexed(bytes) {
  return McapIndexedReader.Initialize({ readable: readable(bytes), decompressHandlers });
}

async function all(generator) {
  const items = [];
  for await (const item of generator) items.push(item);
  return items;
}

for (const kind of ["mcap", "raw"]) {
  test(`${kind}: summary, channels, schemas, statistics`, async () => {
    const reader = await indexed(samples[kind]);
    assert.equal(reader.header.profile, "ros2");
    assert.match(reader.header.library, /^jostle \d+\.\d+/);
    const channels = [...reader.channelsById.values()];
    assert.deepEqual(channels.map((channel) => channel.topic).sort(), ["/goal", "/hand", "/plan", "/wheel"]);
    for (const channel of channels) {
      assert.equal(channel.messageEncoding, "cdr");
      assert.match(channel.metadata.get("offered_qos_profiles"), /^- history: 1\n  depth: \d+\n  reliability: [12]\n  durability: [12]\n/);
    }
    const schemas = channels.map((channel) => reader.schemasById.get(channel.schemaId));
    assert.deepEqual(schemas.map((schema) => schema.name).sort(), ["geometry_msgs/msg/Point", "geometry_msgs/msg/Pose", "jostle_msgs/msg/Plan", "rover_msgs/msg/Wheel"]);
    assert.ok(schemas.every((schema) => schema.encoding === "ros2msg"));
    assert.equal(reader.statistics.messageCount, BigInt(kCount + kOnce));
    assert.equal(reader.statistics.messageStartTime, kBegin);
    assert.equal(reader.statistics.chunkCount, reader.chunkIndexes.length);
    assert.ok(reader.chunkIndexes.length > 2);
    assert.ok(reader.chunkIndexes.every((index) => index.compression === (kind === "raw" ? "" : "zstd")));
    const metadata = await all(reader.readMetadata());
    assert.deepEqual(metadata.map(({ name, metadata }) => [name, Object.fromEntries(metadata)]),
      [["record", { command: "jostle record", host: "ä" }]]);
  });

  test(`${kind}: all messages, and those behind a seek, decoded by the embedded definitions`, async () => {
    const reader = await indexed(samples[kind]);
    const decoders = new Map();
    for (const [id, channel] of reader.channelsById) {
      const schema = reader.schemasById.get(channel.schemaId);
      decoders.set(id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
    }
    const messages = await all(reader.readMessages());
    assert.equal(messages.length, kCount + kOnce);
    const goal = messages.filter((message) => reader.channelsById.get(message.channelId).topic === "/goal");
    assert.equal(goal.length, 1);
    assert.equal(goal[0].publishTime, kBegin - 7n);
    assert.deepEqual(decoders.get(goal[0].channelId).readMessage(goal[0].data),
      { position: { x: 1, y: 2, z: 3 }, orientation: { x: 0, y: 0, z: 0, w: 1 } });
    const wheel = messages.find((message) => reader.channelsById.get(message.channelId).topic === "/wheel");
    assert.deepEqual(decoders.get(wheel.channelId).readMessage(wheel.data),
      { header: { stamp: { sec: 5, nanosec: 6 }, frame_id: "a" }, speed: 1.5, treads: [{ wear: 0.25, codes: new Uint8Array([7, 8]) }] });
    for (let i = 1; i < messages.length; ++i) assert.ok(messages[i - 1].logTime <= messages[i].logTime);

    const startTime = kBegin + 200_000_000_000n, endTime = startTime + 50_000_000n;
    const part = await all(reader.readMessages({ topics: ["/hand"], startTime, endTime }));
    assert.deepEqual(part.map((message) => decoders.get(message.channelId).readMessage(message.data).x),
      Array.from({ length: 11 }, (_, i) => 40_000 + i));
    assert.deepEqual(part.map((message) => message.sequence), Array.from({ length: 11 }, (_, i) => 40_001 + i));
    const last = await all(reader.readMessages({ topics: ["/hand"], reverse: true, startTime: startTime, endTime: startTime }));
    assert.equal(decoders.get(last[0].channelId).readMessage(last[0].data).z, 1e-300);
  });

  test(`${kind}: every record from the first byte to the last, checksums included`, async () => {
    const bytes = samples[kind];
    const reader = new McapStreamReader({ validateCrcs: true, includeChunks: true, decompressHandlers });
    const counts = {};
    for (let at = 0; at < bytes.length; at += 100_000) {
      reader.append(bytes.subarray(at, at + 100_000));
      for (let record; (record = reader.nextRecord());) counts[record.type] = (counts[record.type] ?? 0) + 1;
    }
    assert.ok(reader.done());
    assert.equal(counts.Message, kCount + kOnce);
    assert.equal(counts.Statistics, 1);
    assert.equal(counts.Chunk, counts.ChunkIndex);
    assert.equal(counts.DataEnd, 1);
  });
}

test("damage is noticed: the checksums are real", async () => {
  const bytes = Buffer.from(samples.raw);
  bytes[bytes.length >> 1] ^= 1;
  const reader = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  assert.throws(() => {
    reader.append(bytes);
    while (reader.nextRecord());
  }, /CRC|crc/);
});
